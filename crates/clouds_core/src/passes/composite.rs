//! The clouds before the sky: what the caller gets.

use super::march::Marched;
use super::refine::{COARSEST, Refined, WIDEST};
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};
use crate::kernel::Variant;
use crate::params::Quality;

/// Pixels of a cell in each direction (as in lattice.wgsl).
pub(crate) const TILE: u32 = COARSEST;

/// What a picture is composed of, and into.
pub(crate) struct Parts<'a> {
    pub marched: &'a Marched,
    pub backdrop: &'a Backdrop,
    pub refined: &'a Refined,
    pub out: &'a Composed,
}

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
            image: gpu.picture_buffer("image", 16 * pixels),
            sky: gpu.picture_buffer("sky", 16 * pixels),
            depth: gpu.picture_buffer("depth", 4 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![("image", (&self.image).into()), ("sky", (&self.sky).into()), ("depth", (&self.depth).into())]
    }
}

/// What is behind the marched clouds at the corners of the cells of a sheet, and of those around it.
pub(crate) struct Backdrop {
    pub corners: wgpu::Buffer,
}

impl Backdrop {
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        Self { corners: gpu.buffer("corners", 64 * corners(size).map(u64::from).iter().product::<u64>()) }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![("corners", (&self.corners).into())]
    }
}

fn corners(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE) + 3)
}

/// The kernels where each pixel is worked out, and where cells are.
pub(crate) const WHOLE: [(&str, &str); 1] = [("composite", "composite")];
pub(crate) const CELLS: [(&str, &str); 3] =
    [("composite", "backdrop"), ("composite", "composite_cells"), ("composite", "composite_list")];

/// Whether what is behind the clouds is worked out by cells: where clouds are marched so, and cells as narrow as theirs. The
/// high clouds are a single layer then, as they are from below.
pub(crate) fn by_cells(frame: &Frame, quality: &Quality) -> bool {
    let single = frame.high_clouds == 0 || frame.power_high <= 0.0;
    quality.contrast > 0.0 && single && TILE as f32 * frame.marched_angle() / frame.stride as f32 <= WIDEST
}

/// Composes the cells of the sheet of `frame`, and lists those that are not smooth.
pub(crate) fn run_cells(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    parts: &Parts<'_>,
    layers: bool,
) -> Result<()> {
    let Parts { marched, backdrop, refined, out } = parts;
    let size = [frame.width, frame.rows];
    let [columns, rows] = corners(size);
    let bindings = [scene.bindings.as_slice(), &backdrop.bindings()].concat();
    let kernel = gpu.kernel("composite", "backdrop", variant(scene.variant, frame, layers))?;
    work.dispatch(&kernel, &bindings, [columns, rows, 1])?;
    let bindings = [bindings, marched.bindings(), refined.bindings(), out.bindings()].concat();
    let kernel = gpu.kernel("composite", "composite_cells", variant(scene.variant, frame, layers))?;
    work.clear(&refined.count);
    let [columns, rows] = size.map(|pixels| pixels.div_ceil(TILE));
    work.dispatch(&kernel, &bindings, [columns, rows, 1])
}

/// Composes pixels of the listed cells: `frame.active_rays` of them from `frame.first_ray` on.
pub(crate) fn run_list(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    parts: &Parts<'_>,
    layers: bool,
) -> Result<()> {
    let Parts { marched, refined, out, .. } = parts;
    let bindings = [scene.bindings.as_slice(), &marched.bindings(), &refined.bindings(), &out.bindings()].concat();
    let kernel = gpu.kernel("composite", "composite_list", variant(scene.variant, frame, layers))?;
    work.dispatch(&kernel, &bindings, [frame.active_rays, 1, 1])
}

/// Composes the pixels of the sheet of `frame` in which a disc of light is seen, anew.
pub(crate) fn run_discs(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    parts: &Parts<'_>,
    layers: bool,
) -> Result<()> {
    let Parts { marched, out, .. } = parts;
    let bindings = [scene.bindings.as_slice(), &marched.bindings(), &out.bindings()].concat();
    let variant = Variant { discs: true, ..variant(scene.variant, frame, layers) };
    work.dispatch(&*gpu.kernel("composite", "composite_discs", variant)?, &bindings, [frame.columns, frame.rows, 1])
}

/// Composes the band of `frame`; `layers` fills `sky` and `depth` too, which takes lavapipe a seventh of the time.
pub(crate) fn run(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    parts: &Parts<'_>,
    layers: bool,
) -> Result<()> {
    let Parts { marched, out, .. } = parts;
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
        wide: frame.sky_samples > 1,
        ..of
    }
}
