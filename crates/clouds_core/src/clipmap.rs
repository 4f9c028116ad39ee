//! The origin of a clipmap: levels of cells around the eye, baked again when the eye or the clouds have gone a step.
//!
//! It is snapped to a grid of places and times that follows from the picture alone, not from those before, so that a picture
//! is the same whatever the renderer made before it.

use glam::{DVec2, DVec3};

use crate::params::{self, Params};
use crate::wind::{Advection, fastest};

/// Side of the grid of places, m: a tenth of the finest level of the ground's shadows (passes/shadow.rs).
const EYE_STEP: f64 = 600.0;

/// The side of a texel of the finest level, m, for eyes up to so high; twice as long for each doubling of the altitude, as
/// pixels are. The sun's half degree blurs shadows of clouds 3 km up by 28 m.
const TEXEL: f32 = 64.0;
const TEXEL_ALTITUDE: f32 = 12_000.0;

/// The clouds may move so far while the shadows stay, m: half a texel, and a power of two, so that where winds have come
/// round after times that are powers of two, shadows have too.
const CLOUD_STEP: f64 = 32.0;

/// What casts shadows, and where: the sun's place, clouds, weather and wind.
pub(crate) type Casters = (
    [f32; 2],
    (params::Clouds, params::UpperClouds),
    (params::Weather, Vec<(params::Weather, f32)>),
    (params::Wind, params::Wander, params::Drift),
);

/// Those of a sky.
pub(crate) fn casters(params: &Params) -> Casters {
    (
        [params.sun.elevation, params.sun.azimuth],
        (params.clouds.clone(), params.upper_clouds.clone()),
        (params.weather.clone(), params.weather_mix.clone()),
        (params.wind.clone(), params.wander.clone(), params.drift.clone()),
    )
}

/// The place and the time that a clipmap is baked for.
pub(crate) struct Origin {
    /// The same by numbers, for a key.
    pub steps: [i64; 3],
    /// The middle of the levels, m.
    pub place: DVec2,
    /// The time of their clouds, s.
    pub time: f64,
}

impl Origin {
    /// That of a picture, whose clouds move by `step` metres until the next.
    pub fn new(eye: DVec3, params: &Params, time: f64, step: f64) -> Self {
        let period = step / fastest(params).max(0.125);
        let place = (eye.truncate() / EYE_STEP).round();
        let steps = [place.x as i64, place.y as i64, (time / period).floor() as i64];
        Self { steps, place: EYE_STEP * place, time: period * (time / period).floor() }
    }
}

/// From where and when a picture's shadows are baked: the user's grid stays where it is.
pub(crate) fn origin(eye: DVec3, params: &Params, time: f64) -> Origin {
    Origin::new(eye, params, if params.volume.is_some() { 0.0 } else { time }, CLOUD_STEP)
}

/// Where the eye is in the levels of its picture.
pub(crate) fn camera_in_clipmap(eye: DVec3, params: &Params, time: f64) -> [f32; 2] {
    let origin = origin(eye, params, time);
    let drift = match params.volume {
        Some(_) => DVec2::ZERO,
        None => Advection::new(params, origin.time, time).drift().truncate(),
    };
    (eye.truncate() - origin.place - drift).as_vec2().to_array()
}

/// The side of a texel of the finest level for an eye at an altitude, m.
pub(crate) fn texel(altitude: f32) -> f32 {
    TEXEL * (altitude / TEXEL_ALTITUDE).max(1.0).log2().floor().exp2()
}
