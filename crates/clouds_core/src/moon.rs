//! The moon: how bright it is, and which of sun and moon lights a picture. Radiance is linear in its sources, so that a picture
//! lit by both is the sum of two, each of which has one of them where the sun is.

use glam::DVec3;

use crate::constants::constants;
use crate::frame::{Frame, direction_to, sun_direction};
use crate::params::{Moon, Params, Sun};

constants! {
    /// The moon's mean angular radius, 15.54 minutes of arc (Allen's Astrophysical Quantities), radians.
    pub(crate) const MOON_RADIUS: f64 = 0.004_520;
}

/// Phase angle, degrees, from which on a crescent is as bright as its lit share says: the law is of moons up to there.
const LAST_CRESCENT: f64 = 150.0;

/// Light that is fainter than this share of the other source's, or of the night's, is left out.
const FAINT: f64 = 1e-4;
/// By how many powers of two light falls with each degree that its source is under the horizon. Measured, the brightest of sky
/// and clouds: 9, 17, 26 and 34 at 6, 12, 18 and 24 degrees.
const DUSK: f64 = 1.4;

impl Moon {
    /// The angle at the moon between sun and eye, radians: 0 when it is full.
    pub(crate) fn phase_angle(&self) -> f64 {
        std::f64::consts::PI * (1.0 - 2.0 * f64::from(self.phase)).abs()
    }

    /// Its irradiance in its phase (Krisciunas and Schaefer 1991, equation 9).
    pub(crate) fn light(&self) -> [f32; 3] {
        let law = |degrees: f64| 10f64.powf(-0.4 * (0.026 * degrees + 4e-9 * degrees.powi(4)));
        let lit = |degrees: f64| 0.5 * (1.0 + degrees.to_radians().cos());
        let angle = self.phase_angle().to_degrees();
        let crescent = if angle > LAST_CRESCENT { lit(angle) / lit(LAST_CRESCENT) } else { 1.0 };
        self.irradiance.map(|full| (f64::from(full) * law(angle) * crescent) as f32)
    }

    /// Whether there is one.
    pub(crate) fn exists(&self) -> bool {
        self.elevation > -90.0 && self.light() != [0.0; 3]
    }

    /// The unit vector toward it.
    pub(crate) fn direction(&self) -> DVec3 {
        direction_to(self.elevation, self.azimuth)
    }
}

/// The skies whose pictures are one sky's together: that of the sun, and that of the moon. What comes from neither is in the first.
pub(crate) struct Lights {
    pub sun: Option<Params>,
    pub moon: Option<Params>,
}

impl Lights {
    /// Of a sky as it is seen in a frame.
    pub fn new(params: &Params, frame: &Frame) -> Self {
        let strength = |direction: DVec3, light: [f32; 3]| {
            let under = -frame.height_of(direction) - f64::from(frame.view.horizon_dip).to_degrees();
            f64::from(light.into_iter().fold(0.0, f32::max)) * (-DUSK * under.max(0.0)).exp2()
        };
        let night = if params.atmosphere.enabled { params.atmosphere.night } else { [0.0; 3] };
        let night = std::f64::consts::PI * f64::from(night.into_iter().fold(0.0, f32::max));
        let sun = strength(sun_direction(params), params.sun.irradiance);
        let moon = if params.moon.exists() { strength(params.moon.direction(), params.moon.light()) } else { 0.0 };
        let by_moon = moon > FAINT * sun.max(night);
        let by_sun = !by_moon || sun > FAINT * moon.max(night);
        let mut lit = by_moon.then(|| moonlit(params));
        if let (true, Some(second)) = (by_sun, &mut lit) {
            second.moon.visible = false;
            second.atmosphere.night = [0.0; 3];
            second.light.ambient = [0.0; 3];
        }
        Self { sun: by_sun.then(|| params.clone()), moon: lit }
    }
}

/// The same sky with the moon's light in place of the sun's.
fn moonlit(params: &Params) -> Params {
    let Moon { elevation, azimuth, .. } = params.moon;
    let sun = Sun { elevation, azimuth, irradiance: params.moon.light(), visible: false };
    Params { sun, lights_moon: Some(sun_direction(params).to_array()), ..params.clone() }
}
