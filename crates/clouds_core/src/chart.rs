//! Chart of weather and noises: stereographic projection of the sphere around the planet's centre, from the point
//! opposite to the origin (chart.wgsl).

use glam::{DVec2, DVec3};

use crate::params::Params;
use crate::shared::constants;

constants! {
    /// Minimum denominator of the chart's scale (`chart_reach`) in planet radii. Without it the chart would be
    /// unbounded near the antipode of the origin. The minimum is reached 172 degrees from the origin.
    const CHART_END: f64 = 0.01;
}

/// Denominator of the chart's scale at a point in m: the scale is the planet's diameter divided by it (chart.wgsl).
pub(crate) fn chart_reach(at: DVec3, radius: f64) -> f64 {
    let from_centre = at + DVec3::Z * radius;
    (from_centre.length() + from_centre.z).max(CHART_END * radius)
}

/// Projection of a point to the chart of weather and noises: east and north of the origin in m (chart.wgsl).
pub(crate) fn on_chart(at: DVec3, params: &Params) -> DVec2 {
    let radius = f64::from(params.atmosphere.planet_radius);
    2.0 * radius / chart_reach(at, radius) * at.truncate()
}

/// Point on the ground with a projection to the chart.
pub(crate) fn from_chart(at: DVec2, params: &Params) -> DVec3 {
    let diameter = 2.0 * f64::from(params.atmosphere.planet_radius);
    // Half the angle from the origin around the planet has this tangent.
    let tangent = at / diameter;
    let squared = tangent.length_squared();
    (diameter / (1.0 + squared) * tangent).extend(-diameter * squared / (1.0 + squared))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_the_ground_return_from_the_chart() {
        let params = Params::default();
        let radius = f64::from(params.atmosphere.planet_radius);
        for angle in [0.0, 1e-6, 0.01, 0.5, 1.5, 2.5] {
            let ground = DVec3::new(
                0.6 * radius * f64::sin(angle),
                0.8 * radius * f64::sin(angle),
                radius * (f64::cos(angle) - 1.0),
            );
            let back = from_chart(on_chart(ground, &params), &params);
            assert!(back.distance(ground) < 1e-6, "{angle}: {back} {ground}");
        }
    }
}
