//! Direction, phase and irradiance of the moon.

use glam::DVec3;

use crate::directions::direction_to;
use crate::params::Moon;
use crate::shared::constants;

constants! {
    /// Mean angular radius of the moon, 15.54 minutes of arc (Allen's Astrophysical Quantities), radians.
    pub(crate) const MOON_RADIUS: f64 = 0.004_520;
}

/// Phase angle in degrees from which on the irradiance is proportional to the lit fraction of the disc. The phase law
/// is based on moons up to this angle.
const LAST_CRESCENT: f64 = 150.0;

impl Moon {
    /// Phase angle, the angle at the moon between sun and observer, radians; 0 at full moon.
    pub(crate) fn phase_angle(&self) -> f64 {
        std::f64::consts::PI * (1.0 - 2.0 * f64::from(self.phase)).abs()
    }

    /// Irradiance of the moon at its phase (Krisciunas and Schaefer 1991, equation 9).
    pub(crate) fn light(&self) -> [f32; 3] {
        let law = |degrees: f64| 10f64.powf(-0.4 * (0.026 * degrees + 4e-9 * degrees.powi(4)));
        let lit = |degrees: f64| 0.5 * (1.0 + degrees.to_radians().cos());
        let angle = self.phase_angle().to_degrees();
        let crescent = if angle > LAST_CRESCENT { lit(angle) / lit(LAST_CRESCENT) } else { 1.0 };
        self.irradiance.map(|full| (f64::from(full) * law(angle) * crescent) as f32)
    }

    /// Whether the moon is switched on and gives light.
    pub(crate) fn exists(&self) -> bool {
        self.elevation > -90.0 && self.light() != [0.0; 3]
    }

    /// Unit vector toward the moon.
    pub(crate) fn direction(&self) -> DVec3 {
        direction_to(self.elevation, self.azimuth)
    }
}
