//! Noise textures of nubis2015 (base shape, detail, curl), baked once per seed and shared by all renderers on a device.

use std::sync::{Arc, Mutex};

use super::lut::{Inputs, load_or_bake, view};
use crate::error::Result;
use crate::gpu::Bindings;
use crate::gpu::{COPIED, Gpu, lock};
use crate::gpu::{Recorder, Token};
use crate::params;
use crate::shared::constants;

constants! {
    /// Side of the base-shape noise in texels (nubis2015).
    const SHAPE_SIZE: u32 = 128;
    /// Side of the detail noise in texels (nubis2015).
    const DETAIL_SIZE: u32 = 32;
    /// Ratio of the tile of the detail noise to that of the finer detail noise added to it. It is an integer, so that
    /// the finer tiles fill the tile of the detail.
    const FINER: u32 = 5;
    /// Side of the curl noise in texels (nubis2015).
    const CURL_SIZE: u32 = 128;
}

/// Noise textures of a renderer.
#[derive(Default)]
pub(crate) struct Noises {
    own: Option<Arc<Noise>>,
}

/// Latest noise textures of a device: renderers of the same seed share them.
type Shared = Mutex<Option<Arc<Noise>>>;

type Key = (u32, params::Noise, params::Field);

/// Baked noise textures.
struct Noise {
    key: Key,
    /// Weight of the finer detail; of the field `heaped`, 0.
    finer: f32,
    shape: wgpu::TextureView,
    /// Detail noise without finer detail.
    coarse: wgpu::Texture,
    /// Detail noise with finer detail.
    detail: wgpu::TextureView,
    curl: wgpu::TextureView,
    token: Token,
}

impl Noises {
    /// Binds the noise of the parameters: that of this renderer, or the latest of the device, or a new one.
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let clouds = &inputs.params.clouds;
        let heaped = clouds.field == params::Field::Heaped;
        // The field `heaped` has noises of its own.
        let kind = if heaped { params::Noise::Nubis2015 } else { clouds.noise };
        let finer = if heaped { 0.0 } else { clouds.fine_detail };
        let key = (clouds.seed, kind, clouds.field);
        let shared = rec.gpu.common::<Shared>();
        let mut shared = lock(&shared);
        let matches_key = |noise: &Arc<Noise>| noise.key == key && rec.has(&noise.token);
        let baked: Vec<_> = self.own.clone().into_iter().chain(shared.clone()).filter(matches_key).collect();
        let noise = match baked.iter().find(|noise| noise.finer == finer) {
            Some(noise) => noise.clone(),
            None => {
                let noise = Arc::new(Noise::new(rec, key, finer, baked.first().map(|noise| &**noise))?);
                *shared = Some(noise.clone());
                noise
            }
        };
        rec.bind([
            ("shape_noise", (&noise.shape).into()),
            ("detail_noise", (&noise.detail).into()),
            ("curl_noise", (&noise.curl).into()),
        ]);
        self.own = Some(noise);
        Ok(())
    }
}

impl Noise {
    /// Bakes noise textures; those that match are taken from `other`, which has the same seed.
    fn new(rec: &mut Recorder<'_>, key: Key, finer: f32, other: Option<&Self>) -> Result<Self> {
        let heaped = key.2 == params::Field::Heaped;
        let (shape, coarse, curl) = match other {
            Some(noise) => (noise.shape.clone(), noise.coarse.clone(), noise.curl.clone()),
            None => {
                let [shape, coarse] = [("shape", SHAPE_SIZE), ("detail", DETAIL_SIZE)]
                    .map(|(label, size)| volume(rec.gpu, label, size, 1));
                let curl = rec.gpu.flat("curl", [CURL_SIZE; 2], wgpu::TextureFormat::Rg16Float);
                load_or_bake(rec, "noise", "noise", &format!("{key:?}"), &[&shape, &coarse, &curl], |rec| {
                    bake_volume(rec, if heaped { "heaped_shape" } else { "shape" }, vec![], &shape);
                    bake_volume(rec, "detail", vec![], &coarse);
                    bake_curl(rec, &curl);
                })?;
                (view(&shape), coarse, view(&curl))
            }
        };
        // The size does not depend on the finer detail: another number of texels changes the filtering by levels of
        // detail, and the picture would jump by 1 to 4 % between no finer detail and any.
        let detail = volume(rec.gpu, "finer_detail", FINER * DETAIL_SIZE, (FINER * DETAIL_SIZE).ilog2() + 1);
        load_or_bake(rec, "noise", "finer_detail", &format!("{key:?} {finer}"), &[&detail], |rec| {
            let reads = if heaped { vec![] } else { vec![("volume_in", (&view(&coarse)).into())] };
            bake_volume(rec, if heaped { "heaped_relief" } else { "finer_detail" }, reads, &detail);
        })?;
        Ok(Self { key, finer, shape, coarse, detail: view(&detail), curl, token: rec.token() })
    }
}

fn bake_curl(rec: &mut Recorder<'_>, target: &wgpu::Texture) {
    let texels = rec.gpu.buffer("curl", u64::from(4 * CURL_SIZE * CURL_SIZE));
    rec.dispatch(("noise", "curl"), vec![("texels_out", (&texels).into())], [CURL_SIZE, CURL_SIZE, 1]);
    rec.fill(target, 0, &texels);
}

/// 3D texture of one channel with `levels` mips.
fn volume(gpu: &Gpu, label: &str, size: u32, levels: u32) -> wgpu::Texture {
    gpu.volume(label, [size; 3], levels, wgpu::TextureFormat::R16Float)
}

/// Bakes a 3D texture with the kernel `entry`, and its mips, into a texture of one channel. With the four channels of
/// the sources reads took lavapipe a quarter of a frame instead of a seventh. Stores to a texture of one channel are
/// not supported, so it is filled from buffers.
fn bake_volume(rec: &mut Recorder<'_>, entry: &'static str, reads: Bindings, target: &wgpu::Texture) {
    let size = target.width();
    let texture = rec.gpu.texture(entry, [size; 3], target.mip_level_count());
    let mip = |level: u32| {
        texture.create_view(&wgpu::TextureViewDescriptor {
            base_mip_level: level,
            mip_level_count: Some(1),
            ..Default::default()
        })
    };
    let out = [reads, vec![("volume_out", (&mip(0)).into())]].concat();
    rec.dispatch(("noise", entry), out, [size; 3]);
    for level in 1..texture.mip_level_count() {
        let bindings = vec![("volume_in", (&mip(level - 1)).into()), ("volume_out", (&mip(level)).into())];
        rec.dispatch(("noise", "downsample"), bindings, [size >> level; 3]);
    }
    for level in 0..texture.mip_level_count() {
        let size = size >> level;
        let texels = rec.gpu.buffer("packed", u64::from((2 * size).next_multiple_of(COPIED) * size * size));
        let bindings = vec![("volume_in", (&mip(level)).into()), ("texels_out", (&texels).into())];
        rec.dispatch(("noise", "pack"), bindings, [size.div_ceil(2), size, size]);
        rec.fill(target, level, &texels);
    }
}
