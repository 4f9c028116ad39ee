//! What a march reads: look-up tables on the device, one module for each with the WGSL file of the same name under `passes/`.
//! Each is baked when what it is made from changes.

pub mod beams;
pub mod broad_weather;
pub mod high_clouds;
pub mod majorant;
pub mod multiscatter;
pub mod noise;
pub mod phase;
pub mod profile;
pub mod shadow;
pub mod sky;
pub mod transmittance;
pub mod volume;
pub mod weather;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;

use crate::blue_noise;
use crate::cache;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::{Gpu, texture_bytes, texture_rows};
use crate::kernel::{Binding, Name, Specialization};
use crate::params::{self, Params, Quality};
use crate::plan::Plan;
use crate::recorder::{Recorder, Token};
use crate::shader::Linked;
use crate::shot::Shot;
use crate::specialization;

/// What a picture is made from: all that a LUT or a pass may depend on.
pub(crate) struct Inputs<'a> {
    pub params: &'a Params,
    pub quality: &'a Quality,
    pub frame: &'a Frame,
    pub eye: DVec3,
    pub time: f64,
    /// What its kernels are compiled for.
    pub specialization: Arc<Specialization>,
}

impl<'a> Inputs<'a> {
    /// Those of a shot, whose sky has its values at that time.
    pub fn new(shot: &Shot<'_>, params: &'a Params, quality: &'a Quality, frame: &'a Frame, plan: &Plan) -> Self {
        let specialization = plan.specialization.clone();
        Self { params, quality, frame, eye: shot.camera.eye, time: shot.time, specialization }
    }
}

/// One LUT: what was made, from what, and whether it has been submitted.
pub(crate) struct Lut<K, T = wgpu::TextureView> {
    made: Option<(K, T, Token)>,
}

impl<K, T> Default for Lut<K, T> {
    fn default() -> Self {
        Self { made: None }
    }
}

impl<K: PartialEq, T: Clone> Lut<K, T> {
    /// What it is for a key, baked if that is another than before.
    pub fn update<'a>(
        &mut self,
        rec: &mut Recorder<'a>,
        key: K,
        bake: impl FnOnce(&mut Recorder<'a>) -> Result<T>,
    ) -> Result<T> {
        if let Some((_, made, _)) = self.made.as_ref().filter(|(known, _, token)| *known == key && rec.has(token)) {
            return Ok(made.clone());
        }
        self.made = None;
        let made = bake(rec)?;
        self.made = Some((key, made.clone(), rec.token()));
        Ok(made)
    }
}

/// Everything that a march can read.
pub(crate) struct Luts {
    blue_noise: wgpu::TextureView,
    noise: noise::Noises,
    weather: weather::Weather,
    broad_weather: broad_weather::BroadWeather,
    profile: profile::Profile,
    phase: phase::PhaseTable,
    high_clouds: high_clouds::HighClouds,
    transmittance: transmittance::Transmittance,
    multiscatter: multiscatter::Multiscatter,
    sky: sky::Sky,
    volume: volume::Volume,
    majorants: majorant::Majorants,
    ground_shadow: shadow::GroundShadow,
    beams: beams::Beams,
}

impl Luts {
    pub fn new(gpu: &Gpu) -> Self {
        let side = blue_noise::BLUE_SIZE as u32;
        let texture = gpu.texture("blue_noise", [side, side, 1], 1);
        let texels: Vec<_> = blue_noise::TILE.iter().map(|v| [half::f16::from_f32(*v); 4]).collect();
        gpu.write_texture(&texture, &texels);
        Self {
            blue_noise: view(&texture),
            noise: Default::default(),
            weather: Default::default(),
            broad_weather: Default::default(),
            profile: Default::default(),
            phase: Default::default(),
            high_clouds: Default::default(),
            transmittance: Default::default(),
            multiscatter: Default::default(),
            sky: Default::default(),
            volume: Default::default(),
            majorants: Default::default(),
            ground_shadow: Default::default(),
            beams: Default::default(),
        }
    }

    /// Binds the uniform blocks and the LUTs of a picture, after baking what has changed.
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        rec.bind([("params", params_block(inputs.params, inputs.quality)), ("blue_noise", (&self.blue_noise).into())]);
        rec.bind(inputs.frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.noise.update(rec, inputs)?; // once for a seed and a finer detail
        self.weather.update(rec, inputs)?; // when its block or the mixture changes
        self.broad_weather.update(rec, inputs)?; // when the larger map or its shares change
        self.profile.update(rec, inputs)?; // once for a table
        self.phase.update(rec, inputs)?; // once for a droplet
        self.high_clouds.update(rec, inputs)?; // as they evolve
        self.transmittance.update(rec, inputs)?; // when the air changes
        self.multiscatter.update(rec, inputs)?; // when the air or the ground change
        self.sky.update(rec, inputs)?; // when sun or air change, or the eye has gone far
        rec.specialize(inputs.specialization.clone()); // those so far know no picture
        self.volume.update(rec, inputs)?; // once for a grid
        self.majorants.update(rec, inputs)?; // when paths are traced
        self.ground_shadow.update(rec, inputs)?; // as clouds and eye move, where it is seen
        self.beams.update(rec, inputs) // as those and the view, where they shade air
    }

    /// The weather map alone.
    pub fn weather_map(&mut self, rec: &mut Recorder<'_>, params: &Params, frame: &Frame) -> Result<wgpu::Texture> {
        rec.bind([("params", params_block(params, &Quality::default()))]);
        rec.bind(frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.weather.texture(rec, params)
    }
}

/// Maps that a kernel adds up, by name.
const MIXED: [&str; 4] = ["mix_a", "mix_b", "mix_c", "mix_d"];

/// The uniform block of parameters.
pub(crate) fn params_block(params: &Params, quality: &Quality) -> Binding {
    Binding::block(&params::uniform(params, quality))
}

pub(crate) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Fills a flat texture with a kernel.
fn bake_map(rec: &mut Recorder<'_>, name: Name, params: Option<&Params>, texture: &wgpu::Texture) {
    let mut bindings = vec![("map_out", (&view(texture)).into())];
    bindings.extend(params.map(|params| ("params", params_block(params, &Quality::default()))));
    rec.dispatch(name, bindings, [texture.width(), texture.height(), 1]);
}

/// Fills textures with what an earlier process has baked for `key`, or by `bake`, a kernel of `pass`, for the next process to
/// find among its files of this `kind`.
///
/// Only where the CPU bakes: a GPU needs a few milliseconds, which is less than reading the file takes.
fn load_or_bake<'a>(
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
