//! Look-up table that is rebaked when its key changes.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::field::{Due, Now};
use crate::frame::Frame;
use crate::gpu::{
    Binding, Linked, Name, Recorder, Specialization, Token, disk_cache as cache, texture_bytes, texture_rows,
};
use crate::params::{self, Params, Quality};

/// Inputs of a picture: everything that a LUT or a pass may depend on.
pub(crate) struct Inputs<'a> {
    pub params: &'a Params,
    pub quality: &'a Quality,
    pub frame: &'a Frame,
    pub eye: DVec3,
    pub time: f64,
    /// Specialization table of the kernels of the picture.
    pub specialization: Arc<Specialization>,
    /// Levels of the light field that are solved.
    pub field: Due,
}

impl Inputs<'_> {
    /// Sky that the light field follows.
    pub fn now(&self) -> Now<'_> {
        Now { params: self.params, eye: self.eye, time: self.time }
    }
}

/// Names of the maps that a mixing kernel adds up.
pub(super) const MIXED: [&str; 4] = ["mix_a", "mix_b", "mix_c", "mix_d"];

/// LUT with its key, and the token of the recording that bakes it.
pub(crate) struct Lut<K, T = wgpu::TextureView> {
    made: Option<(K, T, Token)>,
}

impl<K, T> Default for Lut<K, T> {
    fn default() -> Self {
        Self { made: None }
    }
}

impl<K: PartialEq, T: Clone> Lut<K, T> {
    /// The LUT that was used last.
    pub fn made(&self) -> Option<&T> {
        self.made.as_ref().map(|(_, made, _)| made)
    }

    /// The LUT for a key, rebaked if the key has changed or the recording was never submitted.
    pub fn update<'a>(
        &mut self,
        rec: &mut Recorder<'a>,
        key: K,
        bake: impl FnOnce(&mut Recorder<'a>) -> Result<T>,
    ) -> Result<T> {
        if let Some((_, made, _)) = self.made.as_ref().filter(|(old, _, token)| *old == key && rec.has(token)) {
            return Ok(made.clone());
        }
        self.made = None;
        let made = bake(rec)?;
        self.made = Some((key, made.clone(), rec.token()));
        Ok(made)
    }
}

/// Uniform block of the parameters.
pub(crate) fn params_block(params: &Params, quality: &Quality) -> Binding {
    Binding::block(&params::uniform(params, quality))
}

pub(crate) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Bakes a 2D texture with a kernel.
pub(super) fn bake_map(rec: &mut Recorder<'_>, name: Name, params: Option<&Params>, texture: &wgpu::Texture) {
    let mut bindings = vec![("map_out", (&view(texture)).into())];
    bindings.extend(params.map(|params| ("params", params_block(params, &Quality::default()))));
    rec.dispatch(name, bindings, [texture.width(), texture.height(), 1]);
}

/// Loads textures from the disk cache for `key`, or bakes them with `bake`, a kernel of `pass`, and stores them as
/// files of this `kind`.
///
/// On a CPU device alone: a GPU bakes within a few milliseconds, less than reading the file takes.
pub(super) fn load_or_bake<'a>(
    rec: &mut Recorder<'a>,
    pass: &str,
    kind: &'static str,
    key: &str,
    textures: &[&wgpu::Texture],
    bake: impl FnOnce(&mut Recorder<'a>),
) -> Result<()> {
    let gpu = rec.gpu;
    if gpu.info.kind != "cpu" || cache::folder().is_none() {
        bake(rec);
        return Ok(());
    }
    let shader = Linked::new(&format!("passes/{pass}"), &[], gpu.generated).map_err(Error::Device)?.code;
    let bytes: Vec<_> = textures.iter().map(|texture| texture_bytes(texture, 1) as usize).collect();
    // Drivers round differently.
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
    bake(rec);
    let rows: Rc<RefCell<Vec<u8>>> = Rc::default();
    let whole = bytes.iter().sum::<usize>();
    for texture in textures {
        rec.download_texture(texture);
        let (rows, texture, key) = (rows.clone(), (*texture).clone(), key.clone());
        rec.receive(move |bytes| {
            let mut rows = rows.borrow_mut();
            texture_rows(&texture, bytes).for_each(|row| rows.extend_from_slice(row));
            if rows.len() == whole {
                cache::store(kind, &key, &[&rows]);
            }
        });
    }
    Ok(())
}
