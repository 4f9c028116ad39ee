//! The weather map: baked from noise, or the user's own.

use super::{Baked, Bindings, Context, kept};
use crate::error::Result;
use crate::params::{self, Params};
use crate::schema::Map;

/// Texels of a baked map's side (nubis2015).
const SIZE: u32 = 512;

/// Width and height of the map in texels.
pub(crate) fn size(weather: &params::Weather) -> [u32; 2] {
    weather.map.as_ref().map_or([SIZE; 2], |map| [map.width as u32, map.height as u32])
}

/// The weather map on the GPU.
pub(crate) struct Weather {
    map: Baked<params::Weather, wgpu::TextureView>,
}

impl Weather {
    pub const fn new() -> Self {
        Self { map: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let weather = &params.weather.map_only();
        let view = self.map.get(weather.clone(), || {
            let texture = match &weather.map {
                Some(map) => upload(ctx, map),
                None => {
                    let texture = ctx.gpu.texture("weather", [SIZE, SIZE, 1], 1);
                    kept(ctx, "weather", &format!("{weather:?}"), &[&texture], |ctx| {
                        bake_map(ctx, "weather", "weather", &texture)
                    })?;
                    texture
                }
            };
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("weather_map", view.into())])
    }
}

fn upload(ctx: &Context<'_>, map: &Map) -> wgpu::Texture {
    let texture = ctx.gpu.texture("weather", [map.width as u32, map.height as u32, 1], 1);
    let texel = |v: &[f32]| [v[0], v[1], v[2], 1.0].map(half::f16::from_f32);
    let texels: Vec<_> = map.data.chunks_exact(3).map(texel).collect();
    ctx.gpu.write_texture(&texture, &texels);
    texture
}

/// Fills a flat texture with the kernel `entry`.
pub(crate) fn bake_map(ctx: &mut Context<'_>, pass: &str, entry: &str, texture: &wgpu::Texture) -> Result<()> {
    let out = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut bindings = ctx.uniforms.bindings();
    bindings.push(("map_out", (&out).into()));
    let mut work = ctx.gpu.work();
    work.dispatch(&*ctx.gpu.kernel(pass, entry, ctx.variant)?, &bindings, [texture.width(), texture.height(), 1])?;
    work.submit(ctx.timings, ctx.interrupt)?;
    Ok(())
}
