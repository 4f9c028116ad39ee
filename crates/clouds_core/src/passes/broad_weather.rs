//! The larger weather map, which shifts and bends the smaller one: baked from noise, the user's own, or a mixture.

use super::weather::{bake_map, mix};
use super::{Baked, Bindings, Context, kept};
use crate::error::Result;
use crate::params::{BroadShares, BroadSource, Edge, Params, Weather};

/// Texels of a baked map's side: it holds nothing smaller than a twelfth of itself.
const SIZE: u32 = 128;
/// By how many tiles of the smaller map a value of 1 bends it. Measured on the default sky, whose clouds stand 5 km apart: the
/// tiles next to each other are bent apart by more than that nearly everywhere.
pub(crate) const BEND: f32 = 0.8;
/// The steepest that a baked value changes, for each width of the map.
pub(crate) const STEEPEST: f64 = 40.0;

/// The larger map on the GPU.
pub(crate) struct BroadWeather {
    map: Baked<BroadShares, wgpu::TextureView>,
}

impl BroadWeather {
    pub const fn new() -> Self {
        Self { map: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let shares = params.broad_shares();
        let view = self.map.get(shares.clone(), || {
            let mut maps = Vec::new();
            let mut size = [1, 1];
            for (source, share) in &shares.maps {
                let texture = bake_source(ctx, params, source)?;
                size = [size[0].max(texture.width()), size[1].max(texture.height())];
                maps.push((texture, *share));
            }
            // A kernel that could read a texture must be given one.
            let texture = match &*maps {
                [] => ctx.gpu.texture("broad_weather", [1; 3], 1),
                [(only, _)] => only.clone(),
                maps => mix(ctx, maps, size, Edge::Repeat)?,
            };
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("broad_map", view.into())])
    }
}

/// One map. The uniform holds the weather of the picture, which may be another.
fn bake_source(ctx: &mut Context<'_>, params: &Params, source: &BroadSource) -> Result<wgpu::Texture> {
    match source {
        BroadSource::Own(map) => {
            let texture = ctx.gpu.texture("broad_weather", [map.width as u32, map.height as u32, 1], 1);
            let shift = |v: &[f32]| [v[0] - 0.5, v[1] - 0.5, v[2] - 0.5, 0.0].map(half::f16::from_f32);
            let texels: Vec<_> = map.data.chunks_exact(3).map(shift).collect();
            ctx.gpu.write_texture(&texture, &texels);
            Ok(texture)
        }
        BroadSource::Seed(seed) => {
            let texture = ctx.gpu.texture("broad_weather", [SIZE, SIZE, 1], 1);
            kept(ctx, "broad_weather", "broad_weather", &seed.to_string(), &[&texture], |ctx| {
                let weather = Weather { seed: *seed, ..params.weather.clone() };
                ctx.uniforms.upload_params(ctx.gpu, &Params { weather, ..params.clone() });
                let baked = bake_map(ctx, "broad_weather", "broad_weather", &texture);
                ctx.uniforms.upload_params(ctx.gpu, params);
                baked
            })?;
            Ok(texture)
        }
    }
}
