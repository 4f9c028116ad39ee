//! Unit vectors toward compass directions and celestial bodies.

use glam::{DVec2, DVec3};

use crate::params::Params;

/// Unit vector toward the sun.
pub fn sun_direction(params: &Params) -> DVec3 {
    direction_to(params.sun.elevation, params.sun.azimuth)
}

/// Unit vector toward an elevation above the horizon and an azimuth clockwise from north, degrees.
pub(crate) fn direction_to(elevation: f32, azimuth: f32) -> DVec3 {
    let (elevation, azimuth) = (f64::from(elevation), f64::from(azimuth));
    let level = compass(azimuth) * elevation.to_radians().cos();
    DVec3::new(level.x, level.y, elevation.to_radians().sin())
}

/// Unit vector toward a compass direction in degrees, clockwise from north.
pub(crate) fn compass(degrees: f64) -> DVec2 {
    // Multiples of 90 degrees are exact: a wind toward the east has no northward component of 1e-16.
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) as u32 {
        0 => DVec2::new(sin, cos),
        1 => DVec2::new(cos, -sin),
        2 => DVec2::new(-sin, -cos),
        _ => DVec2::new(-cos, sin),
    }
}
