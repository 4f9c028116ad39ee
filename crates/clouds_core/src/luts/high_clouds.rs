//! The texture of the high clouds, made again when its shapes have evolved.

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::COPIED;
use crate::gpu::Recorder;
use crate::params;

/// What the texture is made from: seed, octaves, stretch, type, size, and the ages and numbers of its updates.
type Key = (u32, u32, f32, f32, u32, [[f32; 4]; 4]);

/// The kernel that bakes a type: a pattern that it has nothing of is compiled out.
fn kernel(high: &params::HighClouds) -> &'static str {
    match high.r#type {
        0.0 => "high_clouds",
        1.0 => "high_clouds_cells",
        _ => "high_clouds_mixed",
    }
}

/// The texture of the high clouds on the GPU.
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
            // One channel: with four, three of them for nothing, it drops out of the cache of a core (reading it took
            // composite 24 ms at 1080p on a busy machine, not 16). Such a texture cannot be stored to, so it is filled
            // from a buffer.
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
