//! The three noise textures of nubis2015, baked once for a seed and shared by all renderers on a device.

use std::sync::Arc;

use super::{Bindings, Context, kept};
use crate::error::Result;
use crate::gpu::lock;
use crate::params::{self, Params};

/// Texels of the base shape's side (nubis2015).
const SHAPE_SIZE: u32 = 128;
/// Texels of the detail's side (nubis2015).
const DETAIL_SIZE: u32 = 32;
/// How much smaller the finer detail is that is added to it (as in bindings.wgsl).
const FINER: u32 = 5;
/// Texels of the curl noise's side (nubis2015).
const CURL_SIZE: u32 = 128;

/// The baked textures.
pub struct Noise {
    key: (u32, params::Noise),
    finer: f32,
    shape: wgpu::TextureView,
    /// The detail alone.
    coarse: wgpu::Texture,
    /// The same with the finer one.
    detail: wgpu::TextureView,
    curl: wgpu::TextureView,
}

impl Noise {
    /// The noise for these parameters: the renderer's own or the last one baked if they fit, else a new one.
    pub(crate) fn run(ctx: &mut Context<'_>, params: &Params, own: Option<&Arc<Self>>) -> Result<Arc<Self>> {
        let key = (params.clouds.seed, params.clouds.noise);
        let finer = params.clouds.fine_detail;
        let mut shared = lock(&ctx.gpu.noise);
        let known: Vec<_> = own.cloned().into_iter().chain(shared.clone()).filter(|noise| noise.key == key).collect();
        if let Some(noise) = known.iter().find(|noise| noise.finer == finer) {
            return Ok(noise.clone());
        }
        let (shape, coarse, curl) = match known.first() {
            Some(noise) => (noise.shape.clone(), noise.coarse.clone(), noise.curl.clone()),
            None => {
                let (shape, coarse) = (volume(ctx, "shape", SHAPE_SIZE, 1), volume(ctx, "detail", DETAIL_SIZE, 1));
                let curl = ctx.gpu.flat("curl", [CURL_SIZE; 2], wgpu::TextureFormat::Rg16Float);
                kept(ctx, "noise", "noise", &format!("{key:?}"), &[&shape, &coarse, &curl], |ctx| {
                    bake_volume(ctx, "shape", &vec![], &shape)?;
                    bake_volume(ctx, "detail", &vec![], &coarse)?;
                    bake_curl(ctx, &curl)
                })?;
                (view(&shape), coarse, view(&curl))
            }
        };
        // Of as many texels where nothing is added: with others, levels of detail would filter otherwise, and the picture would
        // leap by 1 to 4 % from no finer detail to any.
        let detail = volume(ctx, "finer_detail", FINER * DETAIL_SIZE, (FINER * DETAIL_SIZE).ilog2() + 1);
        kept(ctx, "noise", "finer_detail", &format!("{key:?} {finer}"), &[&detail], |ctx| {
            bake_volume(ctx, "finer_detail", &vec![("volume_in", (&view(&coarse)).into())], &detail)
        })?;
        let noise = Arc::new(Self { key, finer, shape, coarse, detail: view(&detail), curl });
        *shared = Some(noise.clone());
        Ok(noise)
    }

    pub(crate) fn bindings(&self) -> Bindings<'_> {
        vec![
            ("shape_noise", (&self.shape).into()),
            ("detail_noise", (&self.detail).into()),
            ("curl_noise", (&self.curl).into()),
        ]
    }
}

fn bake_curl(ctx: &mut Context<'_>, target: &wgpu::Texture) -> Result<()> {
    let texels = ctx.gpu.buffer("curl", u64::from(4 * CURL_SIZE * CURL_SIZE));
    let bindings = [ctx.uniforms.bindings(), vec![("texels_out", (&texels).into())]].concat();
    let mut work = ctx.gpu.work();
    work.dispatch(&*ctx.gpu.kernel("noise", "curl", ctx.variant)?, &bindings, [CURL_SIZE, CURL_SIZE, 1])?;
    work.fill(target, 0, &texels);
    work.submit(ctx.timings, ctx.interrupt)?;
    Ok(())
}

/// A volume of one channel with so many levels of detail.
fn volume(ctx: &Context<'_>, label: &str, size: u32, levels: u32) -> wgpu::Texture {
    ctx.gpu.volume(label, [size; 3], levels, wgpu::TextureFormat::R16Float)
}

fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Bakes a volume with the kernel `entry` from what it reads, and its mips from it, into a texture of one channel: with four,
/// as the sources have it, reading took lavapipe a quarter of a frame, not a seventh. Such a texture cannot be stored to.
fn bake_volume(ctx: &mut Context<'_>, entry: &str, reads: &Bindings<'_>, target: &wgpu::Texture) -> Result<()> {
    let size = target.width();
    let texture = ctx.gpu.texture(entry, [size; 3], target.mip_level_count());
    let mip = |level: u32| {
        texture.create_view(&wgpu::TextureViewDescriptor {
            base_mip_level: level,
            mip_level_count: Some(1),
            ..Default::default()
        })
    };
    let mut work = ctx.gpu.work();
    let out = mip(0);
    let bindings = [ctx.uniforms.bindings(), reads.clone(), vec![("volume_out", (&out).into())]].concat();
    work.dispatch(&*ctx.gpu.kernel("noise", entry, ctx.variant)?, &bindings, [size; 3])?;
    let downsample = ctx.gpu.kernel("noise", "downsample", ctx.variant)?;
    for level in 1..texture.mip_level_count() {
        let (from, to) = (mip(level - 1), mip(level));
        let bindings = [("volume_in", (&from).into()), ("volume_out", (&to).into())];
        work.dispatch(&downsample, &bindings, [size >> level; 3])?;
    }
    let pack = ctx.gpu.kernel("noise", "pack", ctx.variant)?;
    for level in 0..texture.mip_level_count() {
        let (from, size) = (mip(level), size >> level);
        let texels = ctx.gpu.buffer("packed", u64::from(2 * size.next_multiple_of(128) * size * size));
        let bindings = [("volume_in", (&from).into()), ("texels_out", (&texels).into())];
        work.dispatch(&pack, &bindings, [size.div_ceil(2), size, size])?;
        work.fill(target, level, &texels);
    }
    work.submit(ctx.timings, ctx.interrupt)?;
    Ok(())
}
