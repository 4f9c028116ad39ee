//! The larger weather map, which shifts and bends the smaller one: baked from noise, or the user's own.

use std::sync::Arc;

use super::weather::bake_map;
use super::{Baked, Bindings, Context, kept};
use crate::error::Result;
use crate::params::Params;
use crate::schema::Map;

/// Texels of a baked map's side: it holds nothing smaller than a twelfth of itself.
const SIZE: u32 = 128;
/// By how many tiles of the smaller map a value of 1 bends it. Measured on the default sky, whose clouds stand 5 km apart: a
/// tile of 60 km and the next are bent apart by 5 km or more nearly everywhere.
pub(crate) const BEND: f32 = 0.5;
/// The steepest that a baked value changes, for each width of the map.
pub(crate) const STEEPEST: f64 = 40.0;

/// What the map is made from: whether it is wanted, its seed, or the user's own.
type Key = (bool, u32, Option<Arc<Map>>);

/// The larger map on the GPU.
pub(crate) struct BroadWeather {
    map: Baked<Key, wgpu::TextureView>,
}

impl BroadWeather {
    pub const fn new() -> Self {
        Self { map: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let weather = &params.weather;
        let wanted = params.has_broad_weather();
        let view = self.map.get((wanted, weather.seed, weather.broad_map.clone()), || {
            let texture = match &weather.broad_map {
                // A kernel that could read a texture must be given one.
                _ if !wanted => ctx.gpu.texture("broad_weather", [1; 3], 1),
                Some(map) => {
                    let texture = ctx.gpu.texture("broad_weather", [map.width as u32, map.height as u32, 1], 1);
                    let shift = |v: &[f32]| [v[0] - 0.5, v[1] - 0.5, v[2] - 0.5, 0.0].map(half::f16::from_f32);
                    let texels: Vec<_> = map.data.chunks_exact(3).map(shift).collect();
                    ctx.gpu.write_texture(&texture, &texels);
                    texture
                }
                None => {
                    let texture = ctx.gpu.texture("broad_weather", [SIZE, SIZE, 1], 1);
                    kept(ctx, "broad_weather", &format!("{}", weather.seed), &[&texture], |ctx| {
                        bake_map(ctx, "broad_weather", "broad_weather", &texture)
                    })?;
                    texture
                }
            };
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("broad_map", view.into())])
    }
}
