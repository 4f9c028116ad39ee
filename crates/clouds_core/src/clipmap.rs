//! Origin of a clipmap: nested levels around the eye, rebaked when the eye or the clouds have moved by a step.
//!
//! The origin is snapped to a grid in space and time that depends on the picture alone: a picture is the same, whatever
//! was rendered before it.

use glam::{DVec2, DVec3};

use crate::params::{self, Params};
use crate::wind::{Advection, fastest};

/// Grid spacing of the position in m: a tenth of the finest level of the ground shadows (luts/shadow.rs).
const EYE_STEP: f64 = 600.0;

/// Texel size of the finest level in m for eyes up to `TEXEL_ALTITUDE` in m. It doubles with each doubling of the
/// altitude, as the size of pixels on the ground does. The sun's half degree blurs shadows of clouds at 3 km by 28 m.
const TEXEL: f32 = 64.0;
const TEXEL_ALTITUDE: f32 = 12_000.0;

/// Displacement of the clouds in m up to which the shadows are reused: half a texel. It is a power of two, so that
/// winds that repeat after a power of two in s repeat their shadows.
const CLOUD_STEP: f64 = 32.0;

/// Shadow casters: elevation and azimuth of the sun, clouds, weather and winds.
pub(crate) type Casters = (
    [f32; 2],
    (params::Clouds, params::UpperClouds),
    (params::Weather, Vec<(params::Weather, f32)>),
    (params::Wind, params::WindVariation, params::Drift),
);

/// Shadow casters of a sky.
pub(crate) fn casters(params: &Params) -> Casters {
    (
        [params.sun.elevation, params.sun.azimuth],
        (params.clouds.clone(), params.upper_clouds.clone()),
        (params.weather.clone(), params.weather_mix.clone()),
        (params.wind.clone(), params.wind_variation.clone(), params.drift.clone()),
    )
}

/// Position and time that a clipmap is baked for.
pub(crate) struct Origin {
    /// Indices on the grid of positions and times, for keys.
    pub steps: [i64; 3],
    /// Centre of the levels, east and north, m.
    pub place: DVec2,
    /// Time of the clouds, s.
    pub time: f64,
}

impl Origin {
    /// Snapped origin for an eye and a time in s. The fastest clouds move `step` metres between two times of the grid.
    pub fn new(eye: DVec3, params: &Params, time: f64, step: f64) -> Self {
        let period = step / fastest(params).max(0.125);
        let place = (eye.truncate() / EYE_STEP).round();
        // The nearest, as of the position: 0 s, where many skies begin, is no border.
        let number = (time / period).round();
        let steps = [place.x as i64, place.y as i64, number as i64];
        Self { steps, place: EYE_STEP * place, time: period * number }
    }
}

/// Origin of the ground shadows of a picture. A user-supplied grid does not move with time.
pub(crate) fn origin(eye: DVec3, params: &Params, time: f64) -> Origin {
    Origin::new(eye, params, if params.volume.is_some() { 0.0 } else { time }, CLOUD_STEP)
}

/// Position of the eye relative to the centre of the clipmap, after advection of the clouds, m.
pub(crate) fn camera_in_clipmap(eye: DVec3, params: &Params, time: f64) -> [f32; 2] {
    let origin = origin(eye, params, time);
    let drift = match params.volume {
        Some(_) => DVec2::ZERO,
        None => Advection::new(params, origin.time, time).drift().truncate(),
    };
    (eye.truncate() - origin.place - drift).as_vec2().to_array()
}

/// Texel size of the finest level in m for an altitude of the eye in m.
pub(crate) fn texel(altitude: f32) -> f32 {
    TEXEL * (altitude / TEXEL_ALTITUDE).max(1.0).log2().floor().exp2()
}
