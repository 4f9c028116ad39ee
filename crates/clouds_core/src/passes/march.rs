//! The march through the clouds, of every pixel or of a subset.

use super::refine::Refined;
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};

/// What the march makes of each pixel of a band or of a picture.
pub(crate) struct Marched {
    /// Premultiplied radiance and transmittance.
    pub clouds: wgpu::Buffer,
    /// Metres to the mean scattering point, -1 where there is none.
    pub depth: wgpu::Buffer,
    /// Density evaluations.
    pub samples: wgpu::Buffer,
}

impl Marched {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self {
            clouds: gpu.buffer("clouds", 16 * pixels),
            depth: gpu.buffer("cloud_depth", 4 * pixels),
            samples: gpu.picture_buffer("samples", 4 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![
            ("clouds", (&self.clouds).into()),
            ("cloud_depth", (&self.depth).into()),
            ("samples", (&self.samples).into()),
        ]
    }
}

/// Marches the pixels of a list: `frame.active_rays` of them from `frame.first_ray` on.
pub(crate) fn run_list(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    refined: &Refined,
    out: &Marched,
) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings(), &refined.bindings()].concat();
    work.dispatch(&*gpu.kernel("march", "march_list", scene.variant)?, &bindings, [frame.active_rays, 1, 1])
}

/// Marches the band of `frame` through the `scene`.
pub(crate) fn run(gpu: &Gpu, work: &mut Work<'_>, scene: &Scene<'_>, frame: &Frame, out: &Marched) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings()].concat();
    work.dispatch(&*gpu.kernel("march", "march", scene.variant)?, &bindings, [frame.march_width, frame.rows, 1])
}
