//! Sunlight through the clouds around the eye: baked when sun or clouds have changed, or when wind or eye have gone far.

use glam::{DVec2, DVec3};

use super::{Baked, Bindings, Context};
use crate::camera::Camera;
use crate::error::Result;
use crate::frame::Frame;
use crate::params::{self, Params};
use crate::wind::{Carried, fastest};

/// Cells across a level, and levels (as in sun_volume.wgsl).
const SIDE: u32 = 96;
const LEVELS: u32 = 6;
/// Height of a cell, m, and how many there may be of them: clouds are no flatter than that, and storms no dearer.
const CELL_HEIGHT: f32 = 85.0;
const ROWS: [u32; 2] = [24, 72];
/// The eye and the clouds may move so far while the volume stays, m: a sixth of the finest level, a third of its cell.
const EYE_STEP: f64 = 600.0;
const CLOUD_STEP: f64 = 25.0;

/// What the light is made from: whether it is wanted, sun, clouds, weather, wind and planet, and from where and when.
type Key = (bool, Shadows, f32, [i64; 3]);

/// What clouds cast shadows, and where: the sun's place, clouds, weather and wind.
pub(crate) type Shadows = (
    [f32; 2],
    (params::Clouds, params::UpperClouds),
    (params::Weather, Vec<(params::Weather, f32)>),
    (params::Wind, params::Wander, params::Drift),
);

pub(crate) fn shadows(params: &Params) -> Shadows {
    (
        [params.sun.elevation, params.sun.azimuth],
        (params.clouds.clone(), params.upper_clouds.clone()),
        (params.weather.clone(), params.weather_mix.clone()),
        (params.wind.clone(), params.wander.clone(), params.drift.clone()),
    )
}

/// The levels on the GPU.
pub(crate) struct SunVolume {
    made: Baked<Key, wgpu::TextureView>,
}

/// From where and when a picture's volume is baked. It follows from the picture alone, not from those before.
pub(crate) struct Origin {
    pub steps: [i64; 3],
    pub place: DVec2,
    pub time: f64,
}

impl Origin {
    /// The clouds move by `step` metres until the next.
    pub fn new(eye: DVec3, params: &Params, time: f64, step: f64) -> Self {
        let period = step / fastest(params).max(0.125);
        let place = (eye.truncate() / EYE_STEP).round();
        let steps = [place.x as i64, place.y as i64, (time / period).floor() as i64];
        Self { steps, place: EYE_STEP * place, time: period * (time / period).floor() }
    }
}

/// Where the eye is in the volume of its picture.
pub(crate) fn eye_in(eye: DVec3, params: &Params, time: f64) -> [f32; 2] {
    let origin = Origin::new(eye, params, time, CLOUD_STEP);
    let drift = Carried::new(params, origin.time, time).drift();
    (eye.truncate() - origin.place - drift.truncate()).as_vec2().to_array()
}

/// Cells between the lowest and the highest clouds.
pub(crate) fn rows(params: &Params) -> u32 {
    let [base, top] = params.shell();
    (((top - base) / CELL_HEIGHT) as u32).clamp(ROWS[0], ROWS[1])
}

impl SunVolume {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    /// `world` holds the uniforms, the noises and the weather map.
    pub fn run(
        &mut self,
        ctx: &mut Context<'_>,
        params: &Params,
        frame: &Frame,
        (eye, time): (DVec3, f64),
        world: &Bindings<'_>,
    ) -> Result<Bindings<'_>> {
        let wanted = ctx.variant.sun_volume;
        let origin = Origin::new(eye, params, time, CLOUD_STEP);
        let key = (wanted, shadows(params), params.atmosphere.planet_radius, origin.steps);
        let view = self.made.get(key, || {
            let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
            if !wanted {
                return Ok(view(&ctx.gpu.texture_3d("sun_volume", [1; 3])));
            }
            let size = [SIDE, SIDE, LEVELS * frame.sun_volume_rows];
            let density = view(&ctx.gpu.texture_3d("sun_volume_density", size));
            let light = view(&ctx.gpu.texture_3d("sun_volume", size));
            let camera = Camera::equirect(origin.place.extend(0.0))?;
            let there = Frame::new(&camera, params, origin.time, [1, 1]);
            ctx.uniforms.upload_frame(ctx.gpu, &Frame { sun_volume_eye: [0.0; 2], ..there });
            let mut work = ctx.gpu.work();
            let bindings = [world.as_slice(), &[("volume_out", (&density).into())]].concat();
            work.dispatch(&*ctx.gpu.kernel("sun_volume", "sun_volume_density", ctx.variant)?, &bindings, size)?;
            let ours = [("volume_in", (&density).into()), ("volume_out", (&light).into())];
            let bindings = [world.as_slice(), &ours].concat();
            work.dispatch(&*ctx.gpu.kernel("sun_volume", "sun_volume_light", ctx.variant)?, &bindings, size)?;
            work.submit(ctx.timings, ctx.interrupt)?;
            ctx.uniforms.upload_frame(ctx.gpu, frame);
            Ok(light)
        })?;
        Ok(vec![("sun_volume", view.into())])
    }
}
