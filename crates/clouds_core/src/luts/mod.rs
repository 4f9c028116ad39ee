//! What a march reads: look-up tables on the device, one module for each with the WGSL file of the same name under `passes/`.
//! Each is baked when what it is made from changes.

pub mod high_clouds;
pub mod large_scale_weather;
pub mod light_shafts;
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
use crate::frame::Frame;
use crate::gpu::{Gpu, Recorder};
use crate::params::{Params, Quality};
use crate::specialization;

pub(crate) use lut::Inputs;
use lut::{params_block, view};

/// Everything that a march can read.
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
            light_shafts: Default::default(),
        }
    }

    /// Binds the uniform blocks and the LUTs of a picture, after baking what has changed.
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        rec.bind([("params", params_block(inputs.params, inputs.quality)), ("blue_noise", (&self.blue_noise).into())]);
        rec.bind(inputs.frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.noise.update(rec, inputs)?; // once for a seed and a finer detail
        self.weather.update(rec, inputs)?; // when its block or the mixture changes
        self.large_scale_weather.update(rec, inputs)?; // when the larger map or its shares change
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
        self.light_shafts.update(rec, inputs) // as those and the view, where they shade air
    }

    /// The weather map alone.
    pub fn weather_map(&mut self, rec: &mut Recorder<'_>, params: &Params, frame: &Frame) -> Result<wgpu::Texture> {
        rec.bind([("params", params_block(params, &Quality::default()))]);
        rec.bind(frame.bindings(rec.gpu));
        rec.specialize(specialization::of_bakes());
        self.weather.texture(rec, params)
    }
}
