//! The clouds of each pixel: what `march`, `reference` and `path` make and `reproject` and `composite` read.

use crate::gpu::{Bindings, Gpu};

/// What the march makes of each pixel of a sheet or of a picture.
pub(crate) struct CloudBuffers {
    /// Premultiplied radiance and transmittance.
    pub clouds: wgpu::Buffer,
    /// Metres to the mean scattering point, -1 where there is none.
    pub depth: wgpu::Buffer,
    /// Density evaluations.
    pub samples: wgpu::Buffer,
}

impl CloudBuffers {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self {
            clouds: gpu.buffer("clouds", 16 * pixels),
            depth: gpu.buffer("cloud_depth", 4 * pixels),
            samples: gpu.picture_buffer("samples", 4 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings {
        vec![
            ("clouds", (&self.clouds).into()),
            ("cloud_depth", (&self.depth).into()),
            ("samples", (&self.samples).into()),
        ]
    }
}
