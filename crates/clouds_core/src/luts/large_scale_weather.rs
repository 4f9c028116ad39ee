//! Large-scale weather map, which offsets and distorts the weather map: baked from noise, user-supplied, or a mixture.

use super::lut::{Inputs, Lut, bake_map, load_or_bake, view};
use super::weather::mix;
use crate::error::Result;
use crate::gpu::Recorder;
use crate::params::{BroadShares, BroadSource, Edge, Params, Weather};
use crate::shared::constants;

constants! {
    /// Side of the baked large-scale map in texels: its smallest features are a twelfth of the map.
    const BROAD_SIZE: u32 = 128;
}

/// Large-scale weather map on the GPU.
#[derive(Default)]
pub(crate) struct LargeScaleWeather {
    lut: Lut<BroadShares>,
}

impl LargeScaleWeather {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let shares = inputs.params.broad_shares();
        if shares.maps.is_empty() {
            return Ok(());
        }
        let map = self.lut.update(rec, shares.clone(), |rec| {
            let mut maps = Vec::new();
            let mut size = [1, 1];
            for (source, share) in &shares.maps {
                let texture = bake_source(rec, inputs.params, source)?;
                size = [size[0].max(texture.width()), size[1].max(texture.height())];
                maps.push((texture, *share));
            }
            Ok(match &*maps {
                [(only, _)] => view(only),
                maps => view(&mix(rec, maps, size, Edge::Repeat)),
            })
        })?;
        rec.bind([("broad_map", (&map).into())]);
        Ok(())
    }
}

/// Map of one source; its weather may differ from that of the picture.
fn bake_source(rec: &mut Recorder<'_>, params: &Params, source: &BroadSource) -> Result<wgpu::Texture> {
    match source {
        BroadSource::Own(map) => {
            let texture = rec.gpu.texture("large_scale_weather", [map.width as u32, map.height as u32, 1], 1);
            let shift = |v: &[f32]| [v[0] - 0.5, v[1] - 0.5, v[2] - 0.5, 0.0].map(half::f16::from_f32);
            let texels: Vec<_> = map.data.chunks_exact(3).map(shift).collect();
            rec.gpu.write_texture(&texture, &texels);
            Ok(texture)
        }
        BroadSource::Seed(seed) => {
            let texture = rec.gpu.texture("large_scale_weather", [BROAD_SIZE, BROAD_SIZE, 1], 1);
            load_or_bake(rec, "large_scale_weather", "large_scale_weather", &seed.to_string(), &[&texture], |rec| {
                let weather = Weather { seed: *seed, ..params.weather.clone() };
                let alone = Params { weather, ..params.clone() };
                bake_map(rec, ("large_scale_weather", "large_scale_weather"), Some(&alone), &texture);
            })?;
            Ok(texture)
        }
    }
}
