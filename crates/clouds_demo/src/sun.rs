//! Where the sun stands: the time of day, played or set.

use anyhow::{Context as _, Result};
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
}

impl Default for Clock {
    fn default() -> Self {
        Self { latitude: 48.0, day: 172, hour: 10.0, rate: 2.0, playing: false }
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
}
