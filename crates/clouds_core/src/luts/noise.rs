//! The three noise textures of nubis2015, baked once for a seed and shared by all renderers on a device.

use std::sync::{Arc, Mutex};

use super::lut::{Inputs, load_or_bake, view};
use crate::error::Result;
use crate::gpu::Bindings;
use crate::gpu::{COPIED, Gpu, lock};
use crate::gpu::{Recorder, Token};
use crate::params;
use crate::shared::constants;

constants! {
    /// Texels of the base shape's side (nubis2015).
    const SHAPE_SIZE: u32 = 128;
    /// Texels of the detail's side (nubis2015).
    const DETAIL_SIZE: u32 = 32;
    /// How many times smaller than the detail the finer one is that is added to it: a whole number, so that its tiles
    /// fill that of the detail.
    const FINER: u32 = 5;
    /// Texels of the curl noise's side (nubis2015).
    const CURL_SIZE: u32 = 128;
}

/// The noises of a renderer.
#[derive(Default)]
pub(crate) struct Noises {
    own: Option<Arc<Noise>>,
}

/// The last noise of a device: renderers of the same seed share it.
type Shared = Mutex<Option<Arc<Noise>>>;

/// The baked textures.
struct Noise {
    key: (u32, params::Noise),
    finer: f32,
    shape: wgpu::TextureView,
    /// The detail alone.
    coarse: wgpu::Texture,
    /// The same with the finer one.
    detail: wgpu::TextureView,
    curl: wgpu::TextureView,
    token: Token,
}

impl Noises {
    /// The noise for these parameters: the renderer's own or the last one baked if they fit, else a new one.
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let clouds = &inputs.params.clouds;
        let key = (clouds.seed, clouds.noise);
        let shared = rec.gpu.common::<Shared>();
        let mut shared = lock(&shared);
        let there = |noise: &Arc<Noise>| noise.key == key && rec.has(&noise.token);
        let known: Vec<_> = self.own.clone().into_iter().chain(shared.clone()).filter(there).collect();
        let noise = match known.iter().find(|noise| noise.finer == clouds.fine_detail) {
            Some(noise) => noise.clone(),
            None => {
                let noise = Arc::new(Noise::new(rec, key, clouds.fine_detail, known.first().map(|noise| &**noise))?);
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
    /// New ones, or what is new beside another of the same seed.
    fn new(rec: &mut Recorder<'_>, key: (u32, params::Noise), finer: f32, other: Option<&Self>) -> Result<Self> {
        let (shape, coarse, curl) = match other {
            Some(noise) => (noise.shape.clone(), noise.coarse.clone(), noise.curl.clone()),
            None => {
                let [shape, coarse] = [("shape", SHAPE_SIZE), ("detail", DETAIL_SIZE)]
                    .map(|(label, size)| volume(rec.gpu, label, size, 1));
                let curl = rec.gpu.flat("curl", [CURL_SIZE; 2], wgpu::TextureFormat::Rg16Float);
                load_or_bake(rec, "noise", "noise", &format!("{key:?}"), &[&shape, &coarse, &curl], |rec| {
                    bake_volume(rec, "shape", vec![], &shape);
                    bake_volume(rec, "detail", vec![], &coarse);
                    bake_curl(rec, &curl);
                })?;
                (view(&shape), coarse, view(&curl))
            }
        };
        // Of as many texels where nothing is added: with others, levels of detail would filter otherwise, and the picture would
        // leap by 1 to 4 % from no finer detail to any.
        let detail = volume(rec.gpu, "finer_detail", FINER * DETAIL_SIZE, (FINER * DETAIL_SIZE).ilog2() + 1);
        load_or_bake(rec, "noise", "finer_detail", &format!("{key:?} {finer}"), &[&detail], |rec| {
            bake_volume(rec, "finer_detail", vec![("volume_in", (&view(&coarse)).into())], &detail);
        })?;
        Ok(Self { key, finer, shape, coarse, detail: view(&detail), curl, token: rec.token() })
    }
}

fn bake_curl(rec: &mut Recorder<'_>, target: &wgpu::Texture) {
    let texels = rec.gpu.buffer("curl", u64::from(4 * CURL_SIZE * CURL_SIZE));
    rec.dispatch(("noise", "curl"), vec![("texels_out", (&texels).into())], [CURL_SIZE, CURL_SIZE, 1]);
    rec.fill(target, 0, &texels);
}

/// A volume of one channel with so many levels of detail.
fn volume(gpu: &Gpu, label: &str, size: u32, levels: u32) -> wgpu::Texture {
    gpu.volume(label, [size; 3], levels, wgpu::TextureFormat::R16Float)
}

/// Bakes a volume with the kernel `entry` from what it reads, and its mips from it, into a texture of one channel: with four,
/// as the sources have it, reading took lavapipe a quarter of a frame, not a seventh. Such a texture cannot be stored to.
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
