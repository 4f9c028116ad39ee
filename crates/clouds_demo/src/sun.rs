//! Where the sun stands: the time of day, played or set.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use anyhow::{Context as _, Result};
use glam::DVec3;
use solar_positioning::{Location, SolarPositions, time::JulianDate};

/// Terrestrial time minus universal time now, s, as in the Python package: it grows by less than 1 s a year.
const DELTA_T: f64 = 69.0;

/// A place, a day and an hour, and how fast hours go by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Degrees north.
    pub latitude: f64,
    /// Day of the year 2026, from 1.
    pub day: u32,
    /// Hours of local solar time: the sun is highest about noon.
    pub hour: f64,
    /// Hours a minute.
    pub rate: f64,
    /// Whether they go by.
    pub playing: bool,
    /// Whether no hour of any day has the sun where it stands: then this one is the nearest.
    pub by_hand: bool,
}

/// Farthest that the sun of a clock may be from that of the sky, degrees: half of its disc, which is what half a day moves it.
const UNSEEN: f64 = 0.25;
/// What is as good as none.
const EXACT: f64 = 0.01;
/// The tilt of the Earth's axis, degrees.
const TILT: f64 = 23.44;
/// By how much the declination of a day may err by the formula of `declination`, and what it goes by in a day, degrees.
const DECLINATION_ERROR: f64 = 1.0;
/// Days that are tried in turn.
const TRIES: usize = 24;

impl Default for Clock {
    fn default() -> Self {
        Self { latitude: 48.0, day: 172, hour: 10.0, rate: 2.0, playing: false, by_hand: false }
    }
}

impl Clock {
    /// Goes on for `seconds`; says whether the sun moves.
    pub fn step(&mut self, seconds: f64) -> bool {
        if self.playing {
            self.hour = (self.hour + self.rate * seconds / 60.0).rem_euclid(24.0);
        }
        self.playing
    }

    /// Elevation, of the middle of the disc and without refraction, and azimuth in degrees.
    pub fn sun(&self) -> Result<(f64, f64)> {
        // At longitude 0 universal time is the mean solar time.
        let start = JulianDate::from_utc(2026, 1, 1, 0, 0, 0.0, DELTA_T)?;
        let day = start.julian_date() + f64::from(self.day - 1) + self.hour / 24.0;
        let at = JulianDate::new(day, DELTA_T).context("a day of 2026")?;
        let place = Location { latitude: self.latitude, longitude: 0.0 };
        let position = SolarPositions::new().at_from_julian(at, place, 0.0, None)?;
        Ok((position.elevation_angle(), position.azimuth()))
    }

    /// The hour at which the sun stands at an elevation and an azimuth, degrees: at the latitude and on the day that are nearest
    /// to those of this clock among those that have it there.
    pub fn at_sun(&self, elevation: f64, azimuth: f64) -> Self {
        let (high, toward) = (elevation.to_radians(), azimuth.to_radians());
        let wanted = unit(elevation, azimuth);
        // The declination of a sun that stands there, and its hour angle.
        let declination = |latitude: f64| {
            let (sin, cos) = latitude.to_radians().sin_cos();
            (sin * high.sin() + cos * high.cos() * toward.cos()).clamp(-1.0, 1.0).asin().to_degrees()
        };
        let hour = |latitude: f64| {
            let (sin, cos) = latitude.to_radians().sin_cos();
            let angle = (-high.cos() * toward.sin()).atan2(high.sin() * cos - high.cos() * toward.cos() * sin);
            (12.0 + angle.to_degrees() / 15.0).rem_euclid(24.0)
        };
        let latitudes = (0..=180).flat_map(|step| [self.latitude + f64::from(step), self.latitude - f64::from(step)]);
        // Where the declination has no name, at a pole of the sky, one of the tropics does.
        let latitude = latitudes
            .filter(|latitude| latitude.abs() <= 90.0)
            .find(|latitude| declination(*latitude).abs() < TILT - 0.1)
            .unwrap_or(self.latitude);
        let mut days: Vec<u32> = (1..=365).collect();
        days.sort_by_key(|day| day.abs_diff(self.day).min(365 - day.abs_diff(self.day)));
        let near = |day: &u32| (declination_of(*day) - declination(latitude)).abs() < DECLINATION_ERROR;
        let start = Self { latitude, hour: hour(latitude), ..*self };
        let tried = days.into_iter().filter(near).take(TRIES).map(|day| Self { day, ..start }.refined(wanted));
        // Of those that have it there the nearest latitude, of others the least error.
        let strange = |(error, clock): &(f64, Self)| (error.max(EXACT), (clock.latitude - self.latitude).abs());
        let best = tried.min_by(|a, b| strange(a).partial_cmp(&strange(b)).unwrap_or(Ordering::Equal));
        let (error, clock) = best.unwrap_or((f64::INFINITY, start));
        Self { by_hand: error > UNSEEN, ..clock }
    }

    /// The latitude and the hour that bring the sun to a direction, by Newton's method, and by how many degrees they miss it.
    fn refined(self, wanted: DVec3) -> (f64, Self) {
        // Degrees and hours that tell a slope, and the farthest step.
        const SLOPE: f64 = 1e-4;
        const FARTHEST: f64 = 2.0;
        let miss = |clock: &Self| clock.sun().map_or(DVec3::splat(f64::INFINITY), |(e, a)| wanted - unit(e, a));
        let (mut clock, mut error) = (self, miss(&self));
        for _ in 0..8 {
            let moved = |latitude: f64, hours: f64| Self {
                latitude: (clock.latitude + latitude).clamp(-90.0, 90.0),
                hour: (clock.hour + hours).rem_euclid(24.0),
                ..clock
            };
            // What a degree and an hour take off the miss. Toward the equator, so that no pole is in the way.
            let inward = -SLOPE.copysign(clock.latitude);
            let north = (error - miss(&moved(inward, 0.0))) / inward;
            let later = (error - miss(&moved(0.0, SLOPE))) / SLOPE;
            // Least squares, a little damped: a sun due east stays there at every latitude.
            let (a, b, c) = (north.dot(north) + 1e-9, north.dot(later), later.dot(later) + 1e-9);
            let (p, q) = (north.dot(error), later.dot(error));
            let determinant = a * c - b * b;
            let step = [(c * p - b * q) / determinant, (a * q - b * p) / determinant];
            let next = moved(step[0].clamp(-FARTHEST, FARTHEST), step[1].clamp(-FARTHEST, FARTHEST));
            let left = miss(&next);
            if left.length() >= error.length() {
                break;
            }
            (clock, error) = (next, left);
        }
        (error.length().to_degrees(), clock)
    }
}

/// The direction of an elevation and an azimuth.
fn unit(elevation: f64, azimuth: f64) -> DVec3 {
    let ((up, level), (east, north)) = (elevation.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    DVec3::new(east * level, north * level, up)
}

/// The sun's declination on a day, degrees, to a degree.
fn declination_of(day: u32) -> f64 {
    TILT * (TAU * (284.0 + f64::from(day)) / 365.0).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(a: (f64, f64), b: (f64, f64)) -> f64 {
        unit(a.0, a.1).distance(unit(b.0, b.1)).to_degrees()
    }

    /// Where the sun may stand at all, from its set to the zenith, in all directions: the clock of it has it there.
    #[test]
    fn the_clock_reads_the_hour_of_any_sun() {
        for elevation in [-18.0, -2.0, 0.0, 1.5, 8.0, 28.0, 40.0, 65.0, 89.0, 90.0] {
            for azimuth in (0..24).map(|step| 15.0 * f64::from(step)) {
                let clock = Clock::default().at_sun(elevation, azimuth);
                let off = apart(clock.sun().expect("is a day"), (elevation, azimuth));
                assert!(!clock.by_hand && off < UNSEEN, "{elevation} {azimuth}: {off} by {clock:?}");
                assert!((0.0..24.0).contains(&clock.hour) && (1..=365).contains(&clock.day));
            }
        }
    }

    /// What a clock has set it reads again: nothing of it changes but by rounding.
    #[test]
    fn the_clock_stays_where_it_has_put_the_sun() {
        for (latitude, day, hour) in [(48.0, 172, 10.0), (-33.0, 20, 17.5), (0.5, 80, 7.0), (69.0, 172, 0.5)] {
            let clock = Clock { latitude, day, hour, ..Clock::default() };
            let (elevation, azimuth) = clock.sun().expect("is a day");
            let again = clock.at_sun(elevation, azimuth);
            assert_eq!(again.day, day);
            assert!((again.latitude - latitude).abs() < 0.05 && (again.hour - hour).abs() < 0.01, "{again:?}");
        }
    }
}
