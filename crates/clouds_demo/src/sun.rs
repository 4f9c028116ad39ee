//! Position of the sun from latitude, date and time of day, and the inverse.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use anyhow::{Context as _, Result};
use glam::DVec3;
use solar_positioning::{Location, SolarPositions, time::JulianDate};

/// ΔT, terrestrial time minus universal time, s, as in the Python package; it grows by less than 1 s a year.
const DELTA_T: f64 = 69.0;

/// Latitude, date and time of day, with the speed at which the time advances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Latitude, degrees north.
    pub latitude: f64,
    /// Day of the year 2026, counted from 1.
    pub day: u32,
    /// Local mean solar time, hours; the sun culminates at about 12.
    pub hour: f64,
    /// Speed of the clock, hours per minute.
    pub rate: f64,
    /// Whether the clock runs.
    pub playing: bool,
    /// Whether no hour of any day has the sun at the sky's position; the clock then shows the nearest.
    pub is_approximate: bool,
}

/// Largest angle between the clock's sun and the sky's, degrees: the sun's angular radius.
///
/// Half a day changes the declination by no more than that.
const SUN_TOLERANCE: f64 = 0.25;
/// Error that ranks as zero when dates are compared, degrees.
const NEGLIGIBLE_ERROR: f64 = 0.01;
/// Obliquity of the ecliptic, degrees.
const OBLIQUITY: f64 = 23.44;
/// Margin for candidate days, degrees: error of [`declination_of`] plus the change of the declination within a day.
const DECLINATION_MARGIN: f64 = 1.0;
/// Largest number of candidate days.
const MAX_DAYS: usize = 24;

impl Default for Clock {
    fn default() -> Self {
        Self { latitude: 48.0, day: 172, hour: 10.0, rate: 2.0, playing: false, is_approximate: false }
    }
}

impl Clock {
    /// Advances the clock by `seconds` of real time; returns whether the sun moves.
    pub fn advance(&mut self, seconds: f64) -> bool {
        if self.playing {
            self.hour = (self.hour + self.rate * seconds / 60.0).rem_euclid(24.0);
        }
        self.playing
    }

    /// Elevation and azimuth of the sun's centre, degrees, without refraction.
    pub fn sun(&self) -> Result<(f64, f64)> {
        // Universal time equals mean solar time at longitude 0.
        let start = JulianDate::from_utc(2026, 1, 1, 0, 0, 0.0, DELTA_T)?;
        let day = start.julian_date() + f64::from(self.day - 1) + self.hour / 24.0;
        let at = JulianDate::new(day, DELTA_T).context("a day of 2026")?;
        let place = Location { latitude: self.latitude, longitude: 0.0 };
        let position = SolarPositions::new().at_from_julian(at, place, 0.0, None)?;
        Ok((position.elevation_angle(), position.azimuth()))
    }

    /// Clock whose sun has an elevation and an azimuth, degrees.
    ///
    /// Of the latitudes and days that allow the position, the result has those nearest to the clock's own.
    pub fn at_sun(&self, elevation: f64, azimuth: f64) -> Self {
        let (el, az) = (elevation.to_radians(), azimuth.to_radians());
        let target = unit(elevation, azimuth);
        // Declination and local hour of that position at a latitude.
        let declination = |latitude: f64| {
            let (sin, cos) = latitude.to_radians().sin_cos();
            (sin * el.sin() + cos * el.cos() * az.cos()).clamp(-1.0, 1.0).asin().to_degrees()
        };
        let hour = |latitude: f64| {
            let (sin, cos) = latitude.to_radians().sin_cos();
            let angle = (-el.cos() * az.sin()).atan2(el.sin() * cos - el.cos() * az.cos() * sin);
            (12.0 + angle.to_degrees() / 15.0).rem_euclid(24.0)
        };
        let latitudes = (0..=180).flat_map(|step| [self.latitude + f64::from(step), self.latitude - f64::from(step)]);
        // A position whose declination exceeds the obliquity, such as the celestial pole, needs another latitude.
        let latitude = latitudes
            .filter(|latitude| latitude.abs() <= 90.0)
            .find(|latitude| declination(*latitude).abs() < OBLIQUITY - 0.1)
            .unwrap_or(self.latitude);
        let mut days: Vec<u32> = (1..=365).collect();
        days.sort_by_key(|day| day.abs_diff(self.day).min(365 - day.abs_diff(self.day)));
        let is_candidate = |day: &u32| (declination_of(*day) - declination(latitude)).abs() < DECLINATION_MARGIN;
        let start = Self { latitude, hour: hour(latitude), ..*self };
        let candidates =
            days.into_iter().filter(is_candidate).take(MAX_DAYS).map(|day| Self { day, ..start }.refined(target));
        // Ranking: error, then distance in latitude.
        let rank = |(error, clock): &(f64, Self)| (error.max(NEGLIGIBLE_ERROR), (clock.latitude - self.latitude).abs());
        let best = candidates.min_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal));
        let (error, clock) = best.unwrap_or((f64::INFINITY, start));
        Self { is_approximate: error > SUN_TOLERANCE, ..clock }
    }

    /// Latitude and hour refined by Gauss-Newton steps so that the sun has a direction; the error is in degrees.
    fn refined(self, target: DVec3) -> (f64, Self) {
        // Interval of the finite differences, degrees and hours.
        const DIFFERENCE: f64 = 1e-4;
        // Largest step, degrees and hours.
        const MAX_STEP: f64 = 2.0;
        let residual_of = |clock: &Self| clock.sun().map_or(DVec3::splat(f64::INFINITY), |(e, a)| target - unit(e, a));
        let (mut clock, mut residual) = (self, residual_of(&self));
        for _ in 0..8 {
            let moved = |latitude: f64, hours: f64| Self {
                latitude: (clock.latitude + latitude).clamp(-90.0, 90.0),
                hour: (clock.hour + hours).rem_euclid(24.0),
                ..clock
            };
            // Derivatives of the sun's direction. The latitude varies toward the equator, away from the clamp.
            let inward = -DIFFERENCE.copysign(clock.latitude);
            let by_latitude = (residual - residual_of(&moved(inward, 0.0))) / inward;
            let by_hour = (residual - residual_of(&moved(0.0, DIFFERENCE))) / DIFFERENCE;
            // Damped least squares: the derivative by latitude vanishes for a sun due east on the horizon.
            let (a, b, c) =
                (by_latitude.dot(by_latitude) + 1e-9, by_latitude.dot(by_hour), by_hour.dot(by_hour) + 1e-9);
            let (p, q) = (by_latitude.dot(residual), by_hour.dot(residual));
            let determinant = a * c - b * b;
            let step = [(c * p - b * q) / determinant, (a * q - b * p) / determinant];
            let next = moved(step[0].clamp(-MAX_STEP, MAX_STEP), step[1].clamp(-MAX_STEP, MAX_STEP));
            let next_residual = residual_of(&next);
            if next_residual.length() >= residual.length() {
                break;
            }
            (clock, residual) = (next, next_residual);
        }
        (residual.length().to_degrees(), clock)
    }
}

/// Unit vector of an elevation and an azimuth, degrees.
fn unit(elevation: f64, azimuth: f64) -> DVec3 {
    let ((up, horizontal), (east, north)) = (elevation.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    DVec3::new(east * horizontal, north * horizontal, up)
}

/// Declination of the sun on a day of the year, degrees, accurate to a degree.
fn declination_of(day: u32) -> f64 {
    OBLIQUITY * (TAU * (284.0 + f64::from(day)) / 365.0).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle_between(a: (f64, f64), b: (f64, f64)) -> f64 {
        unit(a.0, a.1).distance(unit(b.0, b.1)).to_degrees()
    }

    /// Every position from astronomical dusk to the zenith has a clock that reproduces it.
    #[test]
    fn every_sun_position_has_a_clock() {
        for elevation in [-18.0, -2.0, 0.0, 1.5, 8.0, 28.0, 40.0, 65.0, 89.0, 90.0] {
            for azimuth in (0..24).map(|step| 15.0 * f64::from(step)) {
                let clock = Clock::default().at_sun(elevation, azimuth);
                let off = angle_between(clock.sun().expect("is a day"), (elevation, azimuth));
                assert!(!clock.is_approximate && off < SUN_TOLERANCE, "{elevation} {azimuth}: {off} by {clock:?}");
                assert!((0.0..24.0).contains(&clock.hour) && (1..=365).contains(&clock.day));
            }
        }
    }

    /// The clock read from its own sun is the same but for rounding.
    #[test]
    fn the_clock_of_its_own_sun_is_unchanged() {
        for (latitude, day, hour) in [(48.0, 172, 10.0), (-33.0, 20, 17.5), (0.5, 80, 7.0), (69.0, 172, 0.5)] {
            let clock = Clock { latitude, day, hour, ..Clock::default() };
            let (elevation, azimuth) = clock.sun().expect("is a day");
            let again = clock.at_sun(elevation, azimuth);
            assert_eq!(again.day, day);
            assert!((again.latitude - latitude).abs() < 0.05 && (again.hour - hour).abs() < 0.01, "{again:?}");
        }
    }
}
