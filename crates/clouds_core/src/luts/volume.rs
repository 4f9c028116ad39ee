//! User-supplied extinction grid on the GPU: half floats for hardware filtering, or f32 for exact loads.

use std::sync::Arc;

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::volume::DensityGrid;

/// Grid texture, normalized to its largest extinction, which half floats could not hold.
#[derive(Default)]
pub(crate) struct Volume {
    lut: Lut<(Grid, bool)>,
}

/// Identity of a grid: equal only for the same allocation, as a comparison of all voxels would take longer than a bake.
/// The reference keeps the allocation alive, so that no other grid can reuse its address.
#[derive(Clone)]
pub(crate) struct Grid(pub Option<Arc<DensityGrid>>);

impl PartialEq for Grid {
    fn eq(&self, other: &Self) -> bool {
        self.0.as_ref().map(Arc::as_ptr) == other.0.as_ref().map(Arc::as_ptr)
    }
}

impl Volume {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Some(grid) = &inputs.params.volume else { return Ok(()) };
        let precise = inputs.quality.is_precise(inputs.params);
        let name = if precise { "volume_exact" } else { "volume" };
        let texture = self.lut.update(rec, (Grid(Some(grid.clone())), precise), |rec| {
            let size = grid.size().map(|n| n as u32);
            let scale = grid.max().max(f32::MIN_POSITIVE).recip();
            let scaled = grid.extinction().iter().map(|v| v * scale);
            let texture = if precise {
                let texture = rec.gpu.volume(name, size, 1, wgpu::TextureFormat::R32Float);
                rec.gpu.write_texture(&texture, &scaled.collect::<Vec<_>>());
                texture
            } else {
                let texture = rec.gpu.volume(name, size, 1, wgpu::TextureFormat::R16Float);
                rec.gpu.write_texture(&texture, &scaled.map(half::f16::from_f32).collect::<Vec<_>>());
                texture
            };
            Ok(view(&texture))
        })?;
        rec.bind([(name, (&texture).into())]);
        Ok(())
    }
}
