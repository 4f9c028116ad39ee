//! Weather map: baked from noise, user-supplied, or a mixture.

use super::lut::{Inputs, Lut, MIXED, bake_map, load_or_bake, view};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::{Binding, Bindings};
use crate::gpu::{Recorder, Token};
use crate::params::{self, Edge, Params};
use crate::schema::Map;
use crate::shared::constants;
use crate::specialization;

constants! {
    /// Side of a baked weather map in texels (nubis2015).
    const WEATHER_SIZE: u32 = 512;
}

/// Width and height of the weather map in texels; for a mixture the largest of each.
pub(crate) fn size(params: &Params) -> [u32; 2] {
    let sizes = params.weather_shares().into_iter().map(|(weather, _)| size_of(&weather));
    sizes.fold([1; 2], |[w, h], [width, height]| [w.max(width), h.max(height)])
}

fn size_of(weather: &params::Weather) -> [u32; 2] {
    weather.map.as_ref().map_or([WEATHER_SIZE; 2], |map| [map.width as u32, map.height as u32])
}

/// Map of one weather on the GPU.
struct Source {
    weather: params::Weather,
    texture: wgpu::Texture,
    token: Token,
    /// Number of pictures since its last use.
    idle: u32,
}

/// Weather map on the GPU.
#[derive(Default)]
pub(crate) struct Weather {
    /// Maps of this picture and the previous one, so that pictures that alternate rebake nothing.
    sources: Vec<Source>,
    /// Mixture of several maps, by their weights and the addressing beyond the edge.
    mixture: Lut<(Vec<(params::Weather, f32)>, Edge), wgpu::Texture>,
}

impl Weather {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let texture = self.texture(rec, inputs.params)?;
        let sampler = sampler(rec.gpu, inputs.params.weather.edge).into();
        rec.bind([("weather_map", (&view(&texture)).into()), ("weather_sampler", sampler)]);
        Ok(())
    }

    /// Weather map that the march reads.
    pub fn texture(&mut self, rec: &mut Recorder<'_>, params: &Params) -> Result<wgpu::Texture> {
        let shares = params.weather_shares();
        self.sources.retain(|source| rec.has(&source.token));
        for source in &mut self.sources {
            source.idle += 1;
        }
        let mut maps = Vec::new();
        for (weather, share) in &shares {
            let cached = self.sources.iter().position(|source| source.weather == *weather);
            let index = match cached {
                Some(index) => index,
                None => {
                    let texture = bake_source(rec, params, weather)?;
                    self.sources.push(Source { weather: weather.clone(), texture, token: rec.token(), idle: 0 });
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
        self.mixture.update(rec, (shares, edge), |rec| Ok(mix(rec, &maps, size(params), edge)))
    }
}

fn sampler(gpu: &Gpu, edge: Edge) -> &wgpu::Sampler {
    match edge {
        Edge::Repeat => &gpu.repeat_sampler,
        Edge::Mirror => &gpu.mirror_sampler,
        Edge::Clamp => &gpu.clamp_sampler,
    }
}

/// Map of one weather, which may differ from that of the picture.
fn bake_source(rec: &mut Recorder<'_>, params: &Params, weather: &params::Weather) -> Result<wgpu::Texture> {
    if let Some(map) = &weather.map {
        return Ok(upload(rec.gpu, map));
    }
    let texture = rec.gpu.texture("weather", [WEATHER_SIZE, WEATHER_SIZE, 1], 1);
    load_or_bake(rec, "weather", "weather", &format!("{weather:?}"), &[&texture], |rec| {
        let noise = ("WEATHER_NOISE", f64::from(weather.noise as u32));
        let usual = rec.specialize(specialization::of_bakes().with(&[noise]));
        let alone = Params { weather: weather.clone(), ..params.clone() };
        bake_map(rec, ("weather", "weather"), Some(&alone), &texture);
        rec.specialize(usual);
    })?;
    Ok(texture)
}

fn upload(gpu: &Gpu, map: &Map) -> wgpu::Texture {
    let texture = gpu.texture("weather", [map.width as u32, map.height as u32, 1], 1);
    let texel = |v: &[f32]| [v[0], v[1], v[2], 1.0].map(half::f16::from_f32);
    let texels: Vec<_> = map.data.chunks_exact(3).map(texel).collect();
    gpu.write_texture(&texture, &texels);
    texture
}

/// Weighted sum of several maps, of `width` x `height` texels.
pub(crate) fn mix(
    rec: &mut Recorder<'_>,
    maps: &[(wgpu::Texture, f32)],
    [width, height]: [u32; 2],
    edge: Edge,
) -> wgpu::Texture {
    let (first, mut rest) = maps.split_first().expect("there are several");
    let mut sum = first.clone();
    // Each dispatch adds three maps to the sum.
    while !rest.is_empty() {
        let (some, others) = rest.split_at(rest.len().min(MIXED.len() - 1));
        rest = others;
        let mut shares = [0.0_f32; MIXED.len()];
        let mut views = Vec::new();
        for (index, (texture, share)) in std::iter::once(&sum).chain(some).enumerate() {
            shares[index] = *share;
            views.push(view(texture));
        }
        let source = |index: usize| views.get(index).unwrap_or(&views[0]).into();
        let texture = rec.gpu.texture("weather", [width, height, 1], 1);
        let mut bindings: Bindings = MIXED.into_iter().enumerate().map(|(i, name)| (name, source(i))).collect();
        bindings.extend([
            ("mix_shares", Binding::block(&shares.map(f32::to_bits))),
            ("weather_sampler", sampler(rec.gpu, edge).into()),
            ("map_out", (&view(&texture)).into()),
        ]);
        rec.dispatch(("weather", "weather_mix"), bindings, [width, height, 1]);
        sum = (texture, 1.0);
    }
    sum.0
}
