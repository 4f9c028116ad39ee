//! First-person camera: flight, walking and jumping, with the keys of thesis2018.

use clouds_core::{Camera, Result};
use glam::DVec3;

/// Eye height above the ground while walking, m.
const EYE_HEIGHT: f64 = 1.7;
/// Gravitational acceleration, m/s².
const GRAVITY: f64 = 9.81;
/// Take-off speed of a jump, m/s.
const JUMP_SPEED: f64 = 4.0;
/// Range of flight speeds, m/s.
const SPEED_RANGE: (f64, f64) = (1.0, 5000.0);
/// Largest pitch, degrees: the azimuth is undefined at the zenith.
const MAX_PITCH: f64 = 89.0;
/// Highest altitude, m: the altitude of a low Earth orbit.
const MAX_ALTITUDE: f64 = 400_000.0;

/// Input of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// Forward (W, S), right (D, A) and up (E, Q), each from -1 to 1.
    pub movement: [f64; 3],
    /// Fast movement (Shift).
    pub fast: bool,
    /// Slow movement (Control).
    pub slow: bool,
    /// Jump (Space).
    pub jump: bool,
    /// Rotation to the right and upward, degrees.
    pub look: [f64; 2],
    /// Rotation of the wheel, notches.
    pub wheel: f64,
}

impl Controls {
    /// Whether the input moves or turns the camera.
    pub fn is_active(&self) -> bool {
        self.movement != [0.0; 3] || self.look != [0.0; 2] || self.jump
    }
}

/// State of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Position in the world, m: x east, y north, z up.
    pub eye: DVec3,
    /// Heading, degrees clockwise from north.
    pub azimuth: f64,
    /// Elevation of the view, degrees above the horizon.
    pub pitch: f64,
    /// Vertical field of view, degrees.
    pub fov: f64,
    /// Speed of flight, m/s.
    pub speed: f64,
    /// Whether the camera flies; otherwise it walks.
    pub flying: bool,
    /// Downward speed of a fall, m/s.
    fall_speed: f64,
}

impl Flight {
    /// Flying camera at a position.
    pub fn new(eye: DVec3, azimuth: f64, pitch: f64, fov: f64) -> Self {
        Self { eye, azimuth, pitch, fov, speed: 100.0, flying: true, fall_speed: 0.0 }
    }

    /// Flight that starts from a camera.
    pub fn from_camera(camera: &Camera) -> Self {
        let f = camera.forward;
        let azimuth = f.x.atan2(f.y).to_degrees().rem_euclid(360.0);
        Self::new(camera.eye, azimuth, f.z.clamp(-1.0, 1.0).asin().to_degrees(), camera.fov)
    }

    /// Unit vector along the view.
    pub fn forward(&self) -> DVec3 {
        let (azimuth, pitch) = (self.azimuth.to_radians(), self.pitch.to_radians());
        DVec3::new(azimuth.sin() * pitch.cos(), azimuth.cos() * pitch.cos(), pitch.sin())
    }

    /// Camera of the current state.
    pub fn camera(&self) -> Result<Camera> {
        Camera::look_at(self.eye, self.eye + self.forward(), DVec3::Z, self.fov)
    }

    /// Toggles between flying and walking; a walker falls to the ground.
    pub fn toggle_flying(&mut self) {
        self.flying = !self.flying;
        self.fall_speed = 0.0;
    }

    /// Advances the state by `seconds`.
    pub fn advance(&mut self, controls: &Controls, seconds: f64) {
        self.azimuth = (self.azimuth + controls.look[0]).rem_euclid(360.0);
        self.pitch = (self.pitch + controls.look[1]).clamp(-MAX_PITCH, MAX_PITCH);
        self.speed = (self.speed * 1.25_f64.powf(controls.wheel)).clamp(SPEED_RANGE.0, SPEED_RANGE.1);
        let factor = if controls.fast { 5.0 } else { 1.0 } * if controls.slow { 0.2 } else { 1.0 };
        let azimuth = self.azimuth.to_radians();
        let right = DVec3::new(azimuth.cos(), -azimuth.sin(), 0.0);
        let [forward, sideways, up] = controls.movement;
        if self.flying {
            let direction = forward * self.forward() + sideways * right + up * DVec3::Z;
            self.eye += direction.clamp_length_max(1.0) * (self.speed * factor * seconds);
        } else {
            let ahead = DVec3::new(azimuth.sin(), azimuth.cos(), 0.0);
            // 2 m/s: a brisk walk.
            self.eye += (forward * ahead + sideways * right).clamp_length_max(1.0) * (2.0 * factor * seconds);
            let standing = self.eye.z <= EYE_HEIGHT;
            if standing && controls.jump {
                self.fall_speed = -JUMP_SPEED;
            }
            if !standing || self.fall_speed < 0.0 {
                self.fall_speed += GRAVITY * seconds;
                self.eye.z -= self.fall_speed * seconds;
            }
            if self.eye.z <= EYE_HEIGHT {
                self.fall_speed = 0.0;
            }
        }
        self.eye.z = self.eye.z.clamp(EYE_HEIGHT, MAX_ALTITUDE);
    }

    /// Whether the camera falls, so that it moves without input.
    pub fn is_falling(&self) -> bool {
        !self.flying && self.eye.z > EYE_HEIGHT
    }

    /// Compass point nearest to the heading.
    pub fn compass(&self) -> &'static str {
        const POINTS: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
        POINTS[(self.azimuth / 45.0).round() as usize % 8]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facing_north() -> Flight {
        Flight::new(DVec3::new(0.0, 0.0, 500.0), 0.0, 0.0, 60.0)
    }

    #[test]
    fn keys_move_along_the_view() {
        let mut flight = facing_north();
        flight.advance(&Controls { movement: [1.0, 0.0, 0.0], ..Controls::default() }, 2.0);
        assert!(flight.eye.distance(DVec3::new(0.0, 200.0, 500.0)) < 1e-9);
        flight.advance(&Controls { movement: [0.0, 1.0, 0.0], fast: true, ..Controls::default() }, 1.0);
        assert!(flight.eye.distance(DVec3::new(500.0, 200.0, 500.0)) < 1e-9);
        // Diagonal movement is as fast as movement along an axis.
        let before = flight.eye;
        flight.advance(&Controls { movement: [1.0, 0.0, 1.0], slow: true, ..Controls::default() }, 1.0);
        assert!((flight.eye.distance(before) - 20.0).abs() < 1e-9);
    }

    #[test]
    fn the_wheel_sets_the_speed_within_its_range() {
        let mut flight = facing_north();
        let mut wheel = |notches| {
            flight.advance(&Controls { wheel: notches, ..Controls::default() }, 1.0);
            flight.speed
        };
        assert_eq!((wheel(2.0), wheel(-2.0)), (156.25, 100.0));
        assert_eq!((wheel(100.0), wheel(-200.0)), (5000.0, 1.0));
    }

    #[test]
    fn rotation_stops_short_of_the_zenith() {
        let mut flight = facing_north();
        flight.advance(&Controls { look: [-90.0, 200.0], ..Controls::default() }, 0.1);
        assert_eq!((flight.azimuth, flight.pitch), (270.0, MAX_PITCH));
        assert_eq!(flight.compass(), "W");
        assert!(flight.camera().is_ok());
    }

    #[test]
    fn walkers_fall_and_jump() {
        let mut flight = facing_north();
        flight.toggle_flying();
        let nothing = Controls::default();
        for _ in 0..1200 {
            flight.advance(&nothing, 0.01);
        }
        assert_eq!(flight.eye.z, EYE_HEIGHT);
        flight.advance(&Controls { jump: true, ..nothing }, 0.01);
        let mut top: f64 = 0.0;
        for _ in 0..100 {
            flight.advance(&nothing, 0.01);
            top = top.max(flight.eye.z);
        }
        // Height v²/2g, within the error of steps of 0.01 s.
        assert!((top - EYE_HEIGHT - JUMP_SPEED * JUMP_SPEED / (2.0 * GRAVITY)).abs() < 0.05, "{top}");
        assert_eq!(flight.eye.z, EYE_HEIGHT);
    }

    #[test]
    fn a_camera_round_trips() {
        let flight = Flight::new(DVec3::new(1.0, 2.0, 3.0), 250.0, -12.0, 45.0);
        let again = Flight::from_camera(&flight.camera().expect("is allowed"));
        assert!((again.azimuth - 250.0).abs() < 1e-9 && (again.pitch + 12.0).abs() < 1e-9);
        assert_eq!((again.eye, again.fov), (flight.eye, 45.0));
    }
}
