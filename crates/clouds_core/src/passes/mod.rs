//! One module for each pass, with the WGSL file of the same name: what it reads, what it makes, when it runs again.

pub mod beams;
pub mod broad_weather;
pub mod composite;
pub mod display;
pub mod high_clouds;
pub mod majorant;
pub mod march;
pub mod multiscatter;
pub mod noise;
pub mod path;
pub mod phase;
pub mod points;
pub mod profile;
pub mod rays;
pub mod reference;
pub mod refine;
pub mod reproject;
pub mod shadow;
pub mod sky;
pub mod transmittance;
pub mod volume;
pub mod weather;

use crate::cache;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::{Gpu, Interrupt, Timings, texture_bytes, texture_rows};
use crate::kernel::{Binding, Variant};
use crate::params::{self, Params, Quality};
use crate::scene_depth::SceneTextures;
use crate::schema::{self, Block as _};
use crate::shader::Linked;

/// The variables that a kernel may use, by name.
pub(crate) type Bindings<'a> = Vec<(&'static str, Binding<'a>)>;

/// What every pass needs: the device, the uniform blocks, which pipelines, and where time and interrupts go.
pub(crate) struct Context<'a> {
    pub gpu: &'a Gpu,
    pub uniforms: &'a Uniforms,
    pub variant: Variant,
    pub timings: &'a mut Timings,
    pub interrupt: Interrupt<'a>,
}

/// Everything that a march can read, ready to be bound, and the pipelines that it asks for.
pub(crate) struct Scene<'a> {
    pub uniforms: &'a Uniforms,
    pub variant: Variant,
    pub bindings: Bindings<'a>,
    pub scene_depth: &'a SceneTextures,
}

/// The uniform blocks on the GPU.
pub(crate) struct Uniforms {
    params: wgpu::Buffer,
    frame: wgpu::Buffer,
    quality: wgpu::Buffer,
}

impl Uniforms {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            params: gpu.uniform("params", params::uniform_layout().1),
            frame: gpu.uniform("frame", schema::size(Frame::FIELDS)),
            quality: gpu.uniform("quality", schema::size(Quality::FIELDS)),
        }
    }

    pub fn upload(&self, gpu: &Gpu, params: &Params, frame: &Frame, quality: &Quality) {
        self.upload_params(gpu, params);
        let mut words = vec![0; schema::size(Quality::FIELDS) / 4];
        quality.write(&mut words);
        gpu.queue.write_buffer(&self.quality, 0, bytemuck::cast_slice(&words));
        self.upload_frame(gpu, frame);
    }

    /// For a bake from parameters that are not the picture's.
    pub fn upload_params(&self, gpu: &Gpu, params: &Params) {
        gpu.queue.write_buffer(&self.params, 0, bytemuck::cast_slice(&params::uniform(params)));
    }

    /// For the next band of the same picture.
    pub fn upload_frame(&self, gpu: &Gpu, frame: &Frame) {
        let mut words = vec![0; schema::size(Frame::FIELDS) / 4];
        Frame { threads: gpu.threads, ..frame.clone() }.write(&mut words);
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::cast_slice(&words));
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![("params", (&self.params).into()), ("frame", (&self.frame).into()), ("quality", (&self.quality).into())]
    }
}

/// A bake and what it was made from: made again only when that changes.
pub(crate) struct Baked<K, T> {
    made: Option<(K, T)>,
}

impl<K: PartialEq, T> Baked<K, T> {
    pub const fn new() -> Self {
        Self { made: None }
    }

    pub fn get(&mut self, key: K, bake: impl FnOnce() -> Result<T>) -> Result<&T> {
        if self.made.as_ref().is_none_or(|(made_from, _)| *made_from != key) {
            self.made = None;
            self.made = Some((key, bake()?));
        }
        Ok(&self.made.as_ref().expect("was just made").1)
    }
}

/// Fills textures with what an earlier process has baked for `key`, or by `bake`, a kernel of `pass`, for the next process to
/// find among its files of this `kind`.
///
/// Only where the CPU bakes: a GPU needs a few milliseconds, which is less than reading the file takes.
pub(crate) fn kept<'a>(
    ctx: &mut Context<'a>,
    pass: &str,
    kind: &str,
    key: &str,
    textures: &[&wgpu::Texture],
    bake: impl FnOnce(&mut Context<'a>) -> Result<()>,
) -> Result<()> {
    let gpu = ctx.gpu;
    if gpu.info.kind != "cpu" || cache::folder().is_none() {
        return bake(ctx);
    }
    let shader = Linked::new(&format!("passes/{pass}")).map_err(Error::Device)?.code;
    let bytes: Vec<_> = textures.iter().map(|texture| texture_bytes(texture, 1) as usize).collect();
    // Drivers differ in how they round.
    let key = format!("{} {}\n{key}\n{bytes:?}\n{shader}", gpu.info.name, gpu.info.driver);
    if let Some(stored) = cache::load(kind, &key).filter(|stored| stored.len() == bytes.iter().sum()) {
        let mut rest = stored.as_slice();
        for (texture, bytes) in textures.iter().zip(bytes) {
            let (own, others) = rest.split_at(bytes);
            gpu.restore_texture(texture, own);
            rest = others;
        }
        return Ok(());
    }
    bake(ctx)?;
    let mut work = gpu.work();
    for texture in textures {
        work.download_texture(texture);
    }
    let baked = work.submit(ctx.timings, ctx.interrupt)?;
    let rows = textures.iter().zip(&baked).flat_map(|(texture, bytes)| texture_rows(texture, bytes.numbers()));
    cache::store(kind, &key, &[&rows.collect::<Vec<_>>().concat()]);
    Ok(())
}
