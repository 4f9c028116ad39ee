//! Where the visitor is and how keys and mouse move them: thesis2018's table of keys.

use clouds_core::{Camera, Result};
use glam::DVec3;

/// Height of the eyes of someone who walks, m.
const EYES: f64 = 1.7;
/// What pulls a jump back, m/s².
const GRAVITY: f64 = 9.81;
/// How fast a jump begins, m/s.
const JUMP: f64 = 4.0;
/// The slowest and the fastest flight that the wheel chooses, m/s.
const SPEEDS: (f64, f64) = (1.0, 5000.0);
/// How steep one may look: straight up has no azimuth.
const STEEPEST: f64 = 89.0;
/// Farthest altitude, m: space.
const HIGHEST: f64 = 400_000.0;

/// What keys and mouse ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// Forward (W, S), right (D, A) and up (E, Q), each from -1 to 1.
    pub toward: [f64; 3],
    /// Shift.
    pub fast: bool,
    /// Control.
    pub slow: bool,
    /// Space.
    pub jump: bool,
    /// Degrees to the right and upward.
    pub look: [f64; 2],
    /// Notches of the wheel.
    pub wheel: f64,
}

impl Controls {
    /// Whether anything moves.
    pub fn is_any(&self) -> bool {
        self.toward != [0.0; 3] || self.look != [0.0; 2] || self.jump
    }
}

/// Someone on their way through the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// World metres: x east, y north, z up.
    pub eye: DVec3,
    /// Degrees clockwise from north.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub pitch: f64,
    /// Vertical field of view, degrees.
    pub fov: f64,
    /// Speed of flight, m/s.
    pub speed: f64,
    /// In the air, or on foot.
    pub flying: bool,
    falling: f64,
}

impl Flight {
    /// At a place, looking along a compass direction.
    pub fn new(eye: DVec3, azimuth: f64, pitch: f64, fov: f64) -> Self {
        Self { eye, azimuth, pitch, fov, speed: 100.0, flying: true, falling: 0.0 }
    }

    /// Where a camera is and looks.
    pub fn at(camera: &Camera) -> Self {
        let f = camera.forward;
        let azimuth = f.x.atan2(f.y).to_degrees().rem_euclid(360.0);
        Self::new(camera.eye, azimuth, f.z.clamp(-1.0, 1.0).asin().to_degrees(), camera.fov)
    }

    /// The direction of the view.
    pub fn forward(&self) -> DVec3 {
        let (azimuth, pitch) = (self.azimuth.to_radians(), self.pitch.to_radians());
        DVec3::new(azimuth.sin() * pitch.cos(), azimuth.cos() * pitch.cos(), pitch.sin())
    }

    /// What is seen.
    pub fn camera(&self) -> Result<Camera> {
        Camera::look_at(self.eye, self.eye + self.forward(), DVec3::Z, self.fov)
    }

    /// Takes off, or lands: who walks stands on the ground.
    pub fn switch(&mut self) {
        self.flying = !self.flying;
        self.falling = 0.0;
    }

    /// Goes on for `seconds`.
    pub fn step(&mut self, controls: &Controls, seconds: f64) {
        self.azimuth = (self.azimuth + controls.look[0]).rem_euclid(360.0);
        self.pitch = (self.pitch + controls.look[1]).clamp(-STEEPEST, STEEPEST);
        self.speed = (self.speed * 1.25_f64.powf(controls.wheel)).clamp(SPEEDS.0, SPEEDS.1);
        let factor = if controls.fast { 5.0 } else { 1.0 } * if controls.slow { 0.2 } else { 1.0 };
        let azimuth = self.azimuth.to_radians();
        let right = DVec3::new(azimuth.cos(), -azimuth.sin(), 0.0);
        let [forward, aside, up] = controls.toward;
        if self.flying {
            let way = forward * self.forward() + aside * right + up * DVec3::Z;
            self.eye += way.clamp_length_max(1.0) * (self.speed * factor * seconds);
        } else {
            let ahead = DVec3::new(azimuth.sin(), azimuth.cos(), 0.0);
            // m/s: a brisk walk.
            self.eye += (forward * ahead + aside * right).clamp_length_max(1.0) * (2.0 * factor * seconds);
            let standing = self.eye.z <= EYES;
            if standing && controls.jump {
                self.falling = -JUMP;
            }
            if !standing || self.falling < 0.0 {
                self.falling += GRAVITY * seconds;
                self.eye.z -= self.falling * seconds;
            }
            if self.eye.z <= EYES {
                self.falling = 0.0;
            }
        }
        self.eye.z = self.eye.z.clamp(EYES, HIGHEST);
    }

    /// Whether something moves by itself: a fall.
    pub fn is_falling(&self) -> bool {
        !self.flying && self.eye.z > EYES
    }

    /// The point of the compass that the view is toward.
    pub fn compass(&self) -> &'static str {
        const POINTS: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
        POINTS[(self.azimuth / 45.0).round() as usize % 8]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn north() -> Flight {
        Flight::new(DVec3::new(0.0, 0.0, 500.0), 0.0, 0.0, 60.0)
    }

    #[test]
    fn keys_move_along_the_view() {
        let mut flight = north();
        flight.step(&Controls { toward: [1.0, 0.0, 0.0], ..Controls::default() }, 2.0);
        assert!(flight.eye.distance(DVec3::new(0.0, 200.0, 500.0)) < 1e-9);
        flight.step(&Controls { toward: [0.0, 1.0, 0.0], fast: true, ..Controls::default() }, 1.0);
        assert!(flight.eye.distance(DVec3::new(500.0, 200.0, 500.0)) < 1e-9);
        // Two keys are no faster than one.
        let before = flight.eye;
        flight.step(&Controls { toward: [1.0, 0.0, 1.0], slow: true, ..Controls::default() }, 1.0);
        assert!((flight.eye.distance(before) - 20.0).abs() < 1e-9);
    }

    #[test]
    fn the_wheel_sets_the_speed_within_its_range() {
        let mut flight = north();
        let mut wheel = |notches| {
            flight.step(&Controls { wheel: notches, ..Controls::default() }, 1.0);
            flight.speed
        };
        assert_eq!((wheel(2.0), wheel(-2.0)), (156.25, 100.0));
        assert_eq!((wheel(100.0), wheel(-200.0)), (5000.0, 1.0));
    }

    #[test]
    fn looking_turns_and_stops_before_the_zenith() {
        let mut flight = north();
        flight.step(&Controls { look: [-90.0, 200.0], ..Controls::default() }, 0.1);
        assert_eq!((flight.azimuth, flight.pitch), (270.0, STEEPEST));
        assert_eq!(flight.compass(), "W");
        assert!(flight.camera().is_ok());
    }

    #[test]
    fn who_walks_falls_and_jumps() {
        let mut flight = north();
        flight.switch();
        let nothing = Controls::default();
        for _ in 0..1200 {
            flight.step(&nothing, 0.01);
        }
        assert_eq!(flight.eye.z, EYES);
        flight.step(&Controls { jump: true, ..nothing }, 0.01);
        let mut top: f64 = 0.0;
        for _ in 0..100 {
            flight.step(&nothing, 0.01);
            top = top.max(flight.eye.z);
        }
        // v² / 2g, within what steps of a hundredth of a second err.
        assert!((top - EYES - JUMP * JUMP / (2.0 * GRAVITY)).abs() < 0.05, "{top}");
        assert_eq!(flight.eye.z, EYES);
    }

    #[test]
    fn a_camera_comes_back() {
        let flight = Flight::new(DVec3::new(1.0, 2.0, 3.0), 250.0, -12.0, 45.0);
        let again = Flight::at(&flight.camera().expect("is allowed"));
        assert!((again.azimuth - 250.0).abs() < 1e-9 && (again.pitch + 12.0).abs() < 1e-9);
        assert_eq!((again.eye, again.fov), (flight.eye, 45.0));
    }
}
