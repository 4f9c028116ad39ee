//! The clouds before the sky: what the caller gets.

use super::march::Marched;
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};
use crate::kernel::Variant;

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
