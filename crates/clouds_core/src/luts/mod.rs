//! Look-up tables and textures that a march reads. Each has a module here and a WGSL file of the same name under
//! `passes/`, and is rebaked when its key changes.

pub mod high_clouds;
pub mod large_scale_weather;
pub mod light_field;
pub mod light_shafts;
pub mod light_solver;
pub mod lut;
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

use crate::blue_noise;
use crate::error::Result;
use crate::field::{Due, Now};
use crate::frame::Frame;
use crate::gpu::{Gpu, Recorder};
use crate::params::{Params, Quality};
use crate::specialization;

pub(crate) use lut::Inputs;
use lut::{params_block, view};

/// All LUTs of a renderer.
pub(crate) struct Luts {
    blue_noise: wgpu::TextureView,
    noise: noise::Noises,
    weather: weather::Weather,
    large_scale_weather: large_scale_weather::LargeScaleWeather,
    profile: profile::Profile,
    phase: phase::PhaseTable,
    high_clouds: high_clouds::HighClouds,
    transmittance: transmittance::Transmittance,
    multiscatter: multiscatter::Multiscatter,
    sky: sky::Sky,
    volume: volume::Volume,
    majorants: majorant::Majorants,
    ground_shadow: shadow::GroundShadow,
    pub light_field: light_field::LightField,
    light_shafts: light_shafts::LightShafts,
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
            large_scale_weather: Default::default(),
            profile: Default::default(),
            phase: Default::default(),
            high_clouds: Default::default(),
            transmittance: Default::default(),
            multiscatter: Default::default(),
            sky: Default::default(),
            volume: Default::default(),
            majorants: Default::default(),
            ground_shadow: Default::default(),
            light_field: Default::default(),
            light_shafts: Default::default(),
        }
    }

    /// Rebakes the LUTs whose keys have changed, and binds them with the uniform blocks of a picture.
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        rec.bind([("params", params_block(inputs.params, inputs.quality)), ("blue_noise", (&self.blue_noise).into())]);
        rec.bind(inputs.frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.noise.update(rec, inputs)?; // on a new seed or weight of finer detail
        self.weather.update(rec, inputs)?; // on a new weather or mixture
        self.large_scale_weather.update(rec, inputs)?; // on a new large-scale map or weights
        self.profile.update(rec, inputs)?; // on a new table
        self.phase.update(rec, inputs)?; // once for a droplet
        self.high_clouds.update(rec, inputs)?; // as they evolve
        self.transmittance.update(rec, inputs)?; // on a new atmosphere
        self.multiscatter.update(rec, inputs)?; // on a new atmosphere or ground
        self.sky.update(rec, inputs)?; // on a new sun or atmosphere, or a step of the eye
        rec.specialize(inputs.specialization.clone()); // the bakes above are specialized for no picture
        self.volume.update(rec, inputs)?; // on a new grid
        self.majorants.update(rec, inputs)?; // for path tracing
        self.light_field.update(rec, inputs)?; // on a step of clouds or eye, if the light model reads it
        self.ground_shadow.update(rec, inputs)?; // on a step of clouds or eye, if the shadows are visible
        self.light_shafts.update(rec, inputs) // on a step of clouds or eye or a new view, if clouds shade visible air
    }

    /// What a frame of an animation needs of the light field. `before` is the sky of the frame that it continues.
    pub fn follow(&self, frame: &mut Frame, before: Option<Now<'_>>, now: &Now<'_>) -> Due {
        self.light_field.follow(frame, before, now)
    }

    /// Weather map without the other LUTs.
    pub fn weather_map(&mut self, rec: &mut Recorder<'_>, params: &Params, frame: &Frame) -> Result<wgpu::Texture> {
        rec.bind([("params", params_block(params, &Quality::default()))]);
        rec.bind(frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.weather.texture(rec, params)
    }
}
