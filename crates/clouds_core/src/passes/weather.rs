//! The weather map: baked from noise, the user's own, or a mixture of such maps.

use super::{Baked, Bindings, Context, kept};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::kernel::Variant;
use crate::params::{self, Edge, Params};
use crate::schema::Map;

/// Texels of a baked map's side (nubis2015).
const SIZE: u32 = 512;
/// Maps that are mixed at once (as in passes/weather.wgsl).
const MIXED: usize = 4;

/// Width and height of the map in texels: of a mixture the largest of each.
pub(crate) fn size(params: &Params) -> [u32; 2] {
    let sizes = params.weather_shares().into_iter().map(|(weather, _)| size_of(&weather));
    sizes.fold([1; 2], |[w, h], [width, height]| [w.max(width), h.max(height)])
}

fn size_of(weather: &params::Weather) -> [u32; 2] {
    weather.map.as_ref().map_or([SIZE; 2], |map| [map.width as u32, map.height as u32])
}

/// A map on the GPU.
struct Source {
    weather: params::Weather,
    texture: wgpu::Texture,
    /// Pictures since it was last needed.
    idle: u32,
}

/// The weather map on the GPU.
pub(crate) struct Weather {
    /// The maps that this picture and the last one needed, so that one that goes back and forth bakes nothing.
    sources: Vec<Source>,
    /// The mixture of them, if there is more than one, from these shares and read across this edge.
    mixture: Baked<(Vec<(params::Weather, f32)>, Edge), wgpu::Texture>,
    /// What is bound.
    bound: Option<(wgpu::TextureView, wgpu::Sampler)>,
}

impl Weather {
    pub const fn new() -> Self {
        Self { sources: Vec::new(), mixture: Baked::new(), bound: None }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let texture = self.texture(ctx, params)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (view, sampler) = self.bound.insert((view, sampler(ctx.gpu, params.weather.edge).clone()));
        Ok(vec![("weather_map", (&*view).into()), ("weather_sampler", (&*sampler).into())])
    }

    /// The map that the march reads.
    pub fn texture(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<wgpu::Texture> {
        let shares = params.weather_shares();
        for source in &mut self.sources {
            source.idle += 1;
        }
        let mut maps = Vec::new();
        for (weather, share) in &shares {
            let known = self.sources.iter().position(|source| source.weather == *weather);
            let index = match known {
                Some(index) => index,
                None => {
                    let texture = bake_source(ctx, params, weather)?;
                    self.sources.push(Source { weather: weather.clone(), texture, idle: 0 });
                    self.sources.len() - 1
                }
            };
            self.sources[index].idle = 0;
            maps.push((self.sources[index].texture.clone(), *share));
        }
        self.sources.retain(|source| source.idle < 2);
        if let [(only, _)] = &*maps {
            return Ok(only.clone());
        }
        let edge = params.weather.edge;
        self.mixture.get((shares, edge), || mix(ctx, &maps, size(params), edge)).cloned()
    }
}

fn sampler(gpu: &Gpu, edge: Edge) -> &wgpu::Sampler {
    match edge {
        Edge::Repeat => &gpu.repeat_sampler,
        Edge::Mirror => &gpu.mirror_sampler,
        Edge::Clamp => &gpu.clamp_sampler,
    }
}

/// The map of one weather. The uniform holds that of the picture, which may be another.
fn bake_source(ctx: &mut Context<'_>, params: &Params, weather: &params::Weather) -> Result<wgpu::Texture> {
    if let Some(map) = &weather.map {
        return Ok(upload(ctx, map));
    }
    let texture = ctx.gpu.texture("weather", [SIZE, SIZE, 1], 1);
    kept(ctx, "weather", "weather", &format!("{weather:?}"), &[&texture], |ctx| {
        let alone = Params { weather: weather.clone(), ..params.clone() };
        ctx.uniforms.upload_params(ctx.gpu, &alone);
        let usual = ctx.variant;
        ctx.variant = Variant { weather_noise: weather.noise, ..usual };
        let baked = bake_map(ctx, "weather", "weather", &texture);
        ctx.variant = usual;
        ctx.uniforms.upload_params(ctx.gpu, params);
        baked
    })?;
    Ok(texture)
}

fn upload(ctx: &Context<'_>, map: &Map) -> wgpu::Texture {
    let texture = ctx.gpu.texture("weather", [map.width as u32, map.height as u32, 1], 1);
    let texel = |v: &[f32]| [v[0], v[1], v[2], 1.0].map(half::f16::from_f32);
    let texels: Vec<_> = map.data.chunks_exact(3).map(texel).collect();
    ctx.gpu.write_texture(&texture, &texels);
    texture
}

/// The weighted sum of several maps in so many texels.
pub(crate) fn mix(
    ctx: &mut Context<'_>,
    maps: &[(wgpu::Texture, f32)],
    [width, height]: [u32; 2],
    edge: Edge,
) -> Result<wgpu::Texture> {
    let kernel = ctx.gpu.kernel("weather", "weather_mix", ctx.variant)?;
    let (first, mut rest) = maps.split_first().expect("there are several");
    let mut sum = first.clone();
    let mut work = ctx.gpu.work();
    // The sum so far and three more at a time.
    while !rest.is_empty() {
        let (some, others) = rest.split_at(rest.len().min(MIXED - 1));
        rest = others;
        let mut shares = [0.0; MIXED];
        let mut views = Vec::new();
        for (index, (texture, share)) in std::iter::once(&sum).chain(some).enumerate() {
            shares[index] = *share;
            views.push(texture.create_view(&wgpu::TextureViewDescriptor::default()));
        }
        let view = |index: usize| views.get(index).unwrap_or(&views[0]).into();
        let buffer = ctx.gpu.uniform("mix_shares", size_of_val(&shares));
        ctx.gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&shares));
        let texture = ctx.gpu.texture("weather", [width, height, 1], 1);
        let out = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bindings = [
            ("mix_a", view(0)),
            ("mix_b", view(1)),
            ("mix_c", view(2)),
            ("mix_d", view(3)),
            ("mix_shares", (&buffer).into()),
            ("weather_sampler", sampler(ctx.gpu, edge).into()),
            ("map_out", (&out).into()),
        ];
        work.dispatch(&kernel, &bindings, [width, height, 1])?;
        sum = (texture, 1.0);
    }
    work.submit(ctx.timings, ctx.interrupt)?;
    Ok(sum.0)
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
