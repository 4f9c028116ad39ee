//! Buffers of the marched clouds: output of `march`, `reference` and `path`, input of `reproject` and `composite`.

use crate::gpu::{Bindings, Gpu};

/// Clouds by sample of a strip or a picture.
pub(crate) struct CloudBuffers {
    /// Premultiplied radiance and transmittance.
    pub clouds: wgpu::Buffer,
    /// Distance to the mean scattering point in m, -1 without clouds.
    pub depth: wgpu::Buffer,
    /// Number of density evaluations.
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
