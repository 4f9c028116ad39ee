//! Texture of the high clouds, rebaked as its shapes evolve.

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::COPIED;
use crate::gpu::Recorder;
use crate::params;

/// Key of the texture: seed, octaves, stretch, type, size, and the ages and indices of the updates of its octaves.
type Key = (u32, u32, f32, f32, u32, [[f32; 4]; 4]);

/// Kernel that bakes a type; patterns that the type lacks are compiled out.
fn kernel(high: &params::HighClouds) -> &'static str {
    match high.r#type {
        0.0 => "high_clouds",
        1.0 => "high_clouds_cells",
        _ => "high_clouds_mixed",
    }
}

/// Texture of the high clouds on the GPU.
#[derive(Default)]
pub(crate) struct HighClouds {
    lut: Lut<Key>,
}

impl HighClouds {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, frame, .. } = *inputs;
        if !params.has_high_clouds() {
            return Ok(());
        }
        let high = &params.high_clouds;
        let updates =
            [frame.sky.high_age, frame.sky.high_age_small, frame.sky.high_update, frame.sky.high_update_small];
        let size = high.texture_size;
        let key = (high.seed, high.octaves, high.stretch, high.r#type, size, updates);
        let map = self.lut.update(rec, key, |rec| {
            // One channel: with three unused channels the texture exceeds the cache of a core (reads in composite took
            // 24 ms instead of 16 ms at 1080p on a busy machine). Stores to such a texture are not supported, so it is
            // filled from a buffer.
            let texture = rec.gpu.flat("high_clouds", [size; 2], wgpu::TextureFormat::R16Float);
            let texels = rec.gpu.buffer("high_clouds", u64::from((2 * size).next_multiple_of(COPIED) * size));
            let out = vec![("texels_out", (&texels).into())];
            rec.dispatch(("high_clouds", kernel(high)), out, [size.div_ceil(2), size, 1]);
            rec.fill(&texture, 0, &texels);
            Ok(view(&texture))
        })?;
        rec.bind([("high_map", (&map).into())]);
        Ok(())
    }
}
