//! The larger weather map, which shifts and bends the smaller one: baked from noise, the user's own, or a mixture.

use super::weather::mix;
use super::{Inputs, Lut, bake_map, load_or_bake, view};
use crate::constants::constants;
use crate::error::Result;
use crate::params::{BroadShares, BroadSource, Edge, Params, Weather};
use crate::recorder::Recorder;

constants! {
    /// Texels of the side of a baked larger map: it holds nothing smaller than a twelfth of itself.
    const BROAD_SIZE: u32 = 128;
}
/// By how many tiles of the smaller map a value of 1 bends it. Measured on the default sky, whose clouds stand 5 km apart: the
/// tiles next to each other are bent apart by more than that nearly everywhere.
pub(crate) const BEND: f32 = 0.8;
/// The steepest that a baked value changes, for each width of the map.
pub(crate) const STEEPEST: f64 = 40.0;

/// The larger map on the GPU.
#[derive(Default)]
pub(crate) struct BroadWeather {
    lut: Lut<BroadShares>,
}

impl BroadWeather {
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

/// One map, whose weather may be another than the picture's.
fn bake_source(rec: &mut Recorder<'_>, params: &Params, source: &BroadSource) -> Result<wgpu::Texture> {
    match source {
        BroadSource::Own(map) => {
            let texture = rec.gpu.texture("broad_weather", [map.width as u32, map.height as u32, 1], 1);
            let shift = |v: &[f32]| [v[0] - 0.5, v[1] - 0.5, v[2] - 0.5, 0.0].map(half::f16::from_f32);
            let texels: Vec<_> = map.data.chunks_exact(3).map(shift).collect();
            rec.gpu.write_texture(&texture, &texels);
            Ok(texture)
        }
        BroadSource::Seed(seed) => {
            let texture = rec.gpu.texture("broad_weather", [BROAD_SIZE, BROAD_SIZE, 1], 1);
            load_or_bake(rec, "broad_weather", "broad_weather", &seed.to_string(), &[&texture], |rec| {
                let weather = Weather { seed: *seed, ..params.weather.clone() };
                let alone = Params { weather, ..params.clone() };
                bake_map(rec, ("broad_weather", "broad_weather"), Some(&alone), &texture);
            })?;
            Ok(texture)
        }
    }
}
