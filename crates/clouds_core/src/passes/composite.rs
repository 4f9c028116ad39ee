//! The clouds before the sky: what the caller gets.

use super::march::Marched;
use super::refine::{Refined, WIDEST};
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};
use crate::kernel::Variant;

/// Pixels of a cell in each direction (as in composite.wgsl).
const CELL: u32 = 4;

/// The picture, of a band or whole.
pub(crate) struct Composed {
    /// Radiance and alpha.
    pub image: wgpu::Buffer,
    /// Radiance of the sky without clouds.
    pub sky: wgpu::Buffer,
    /// Depth of all clouds, -1 where there is none.
    pub depth: wgpu::Buffer,
}

impl Composed {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self {
            image: gpu.buffer("image", 16 * pixels),
            sky: gpu.buffer("sky", 16 * pixels),
            depth: gpu.buffer("depth", 4 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![("image", (&self.image).into()), ("sky", (&self.sky).into()), ("depth", (&self.depth).into())]
    }
}

/// What is behind the marched clouds at the corners of cells of pixels.
pub(crate) struct Backdrop {
    /// Radiance and transmittance of the high clouds.
    pub high: wgpu::Buffer,
    /// Radiance of the sky behind them, and their distance.
    pub sky: wgpu::Buffer,
}

impl Backdrop {
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let [columns, rows] = size.map(|n| u64::from(n.div_ceil(CELL) + 1));
        Self {
            high: gpu.buffer("backdrop_high", 16 * columns * rows),
            sky: gpu.buffer("backdrop_sky", 16 * columns * rows),
        }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![("backdrop_high", (&self.high).into()), ("backdrop_sky", (&self.sky).into())]
    }
}

/// Whether what is behind the clouds can be worked out by cells: where these are narrow, and the high clouds are a single
/// layer, as they are from below.
pub(crate) fn by_cells(frame: &Frame) -> bool {
    let below = frame.high_clouds == 0 || frame.power_high <= 0.0;
    below && CELL as f32 * frame.marched_angle() / frame.stride as f32 <= WIDEST
}

/// Works out what is behind the clouds, of the whole picture.
pub(crate) fn backdrop(gpu: &Gpu, work: &mut Work<'_>, scene: &Scene<'_>, frame: &Frame, out: &Backdrop) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings()].concat();
    let kernel = gpu.kernel("composite", "backdrop", variant(scene.variant, frame, false))?;
    work.dispatch(&kernel, &bindings, [frame.width.div_ceil(CELL) + 1, frame.height.div_ceil(CELL) + 1, 1])
}

/// Composes the cells of the band of `frame`, and lists the pixels of those that are not smooth.
#[expect(clippy::too_many_arguments, reason = "what a picture is made of")]
pub(crate) fn run_cells(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    marched: &Marched,
    backdrop: &Backdrop,
    refined: &Refined,
    out: &Composed,
) -> Result<()> {
    let (marched, out) = (marched.bindings(), out.bindings());
    let bindings = [scene.bindings.as_slice(), &marched, &backdrop.bindings(), &refined.bindings(), &out].concat();
    let kernel = gpu.kernel("composite", "composite_cells", variant(scene.variant, frame, false))?;
    work.dispatch(&kernel, &bindings, [frame.width.div_ceil(CELL), frame.rows.div_ceil(CELL), 1])
}

/// Composes pixels of a list: `frame.active_rays` of them from `frame.first_ray` on.
pub(crate) fn run_list(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    marched: &Marched,
    refined: &Refined,
    out: &Composed,
) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &marched.bindings(), &refined.bindings(), &out.bindings()].concat();
    let kernel = gpu.kernel("composite", "composite_list", variant(scene.variant, frame, false))?;
    work.dispatch(&kernel, &bindings, [frame.active_rays, 1, 1])
}

/// Composes the band of `frame`; `layers` fills `sky` and `depth` too, which takes lavapipe a seventh of the time.
pub(crate) fn run(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    marched: &Marched,
    out: &Composed,
    layers: bool,
) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &marched.bindings(), &out.bindings()].concat();
    let kernel = gpu.kernel("composite", "composite", variant(scene.variant, frame, layers))?;
    work.dispatch(&kernel, &bindings, [frame.width, frame.rows, 1])
}

/// What it is made for.
pub(crate) fn variant(of: Variant, frame: &Frame, layers: bool) -> Variant {
    let high = frame.high_clouds > 0;
    Variant {
        high,
        high_emboss: high && frame.high_emboss > 0,
        high_low_sun: high && frame.high_low_sun > 0,
        cloudless: frame.cloudless > 0,
        ground_shadow: frame.ground_shadow > 0,
        layers,
        ..of
    }
}
