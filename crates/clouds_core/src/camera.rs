//! Cameras: where the eye is, which way it looks, and how pixels become directions.
//!
//! World: right-handed metres, x east, y north, z up. A camera's own axes are right, up and forward; a matrix from
//! outside may follow OpenGL (+x right, +y up, looking down -z) or OpenCV (+x right, +y down, looking down +z).

use glam::DVec3;

use crate::error::{Error, Result};
use crate::shared::constants;

/// How pixels become directions. WGSL has the discriminants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// A pinhole; `fov` is the vertical field of view.
    #[default]
    Perspective = 0,
    /// The whole sphere by longitude and latitude: image centre north, right clockwise from above.
    Equirect = 1,
    /// Equidistant fisheye; `fov` spans the image's shorter side.
    Fisheye = 2,
}

constants! {
    /// [`Projection::Equirect`]: image centre north, right clockwise from above.
    const EQUIRECT: u32 = Projection::Equirect as u32;
    /// [`Projection::Fisheye`]: equidistant, so that the angle to the axis grows linearly from the centre.
    const FISHEYE: u32 = Projection::Fisheye as u32;
}

/// The axes of a camera matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// +x right, +y up, looking down -z.
    OpenGl,
    /// +x right, +y down, looking down +z.
    OpenCv,
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// How pixels become directions.
    pub projection: Projection,
    /// Position in world metres.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector into the picture.
    pub forward: DVec3,
    /// Field of view in degrees (see [`Projection`]).
    pub fov: f64,
}

/// Farthest eye from the origin in metres: 100 000 km and the planet's far side.
const FARTHEST_EYE: f64 = 2e8;

fn finite(field: &str, v: DVec3, limit: f64) -> Result<DVec3> {
    // Written so that NaN fails it.
    if v.abs().max_element() <= limit && v.is_finite() {
        return Ok(v);
    }
    // All that f64 holds has 309 digits.
    let range = if limit < f64::MAX { format!(" from {} to {limit}", -limit) } else { String::new() };
    Err(Error::parameter(field, format!("({}, {}, {})", v.x, v.y, v.z), format!("3 finite numbers{range}")))
}

/// The vector made one long. Scaled first: the square of a length below 1e-154 m or above 1e154 m is no f64.
fn unit(v: DVec3) -> Option<DVec3> {
    (v / v.abs().max_element()).try_normalize()
}

fn check_fov(field: &str, fov: f64, max: f64) -> Result<f64> {
    if fov > 0.0 && fov <= max {
        return Ok(fov);
    }
    Err(Error::parameter(field, fov, format!("above 0 and at most {max} degrees")))
}

impl Camera {
    /// A pinhole at `eye` that looks at `target`; `fov_y` is the vertical field of view in degrees.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Result<Self> {
        let eye = finite("eye", eye, FARTHEST_EYE)?;
        let target = finite("target", target, 4.0 * FARTHEST_EYE)?;
        let up = finite("up", up, f64::MAX)?;
        let fov = check_fov("fov_y", fov_y, 179.0)?;
        let Some(forward) = unit(target - eye) else {
            let at = format!("({}, {}, {})", target.x, target.y, target.z);
            return Err(Error::parameter("target", at, "another point than eye"));
        };
        let across = unit(up).and_then(|up| forward.cross(up).try_normalize_above(1e-9));
        let Some(right) = across else {
            let at = format!("({}, {}, {})", up.x, up.y, up.z);
            return Err(Error::parameter("up", at, "a vector that is not along the view"));
        };
        let up = right.cross(forward);
        Ok(Self { projection: Projection::Perspective, eye, right, up, forward, fov })
    }

    /// A pinhole from a 4x4 matrix, given by rows, that takes camera coordinates to world coordinates.
    pub fn from_matrix(rows: [[f64; 4]; 4], fov_y: f64, convention: Convention) -> Result<Self> {
        let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
        let fov = check_fov("fov_y", fov_y, 179.0)?;
        let eye = finite("world_from_camera[:3, 3]", column(3), FARTHEST_EYE)?;
        let (x, y, z) = (column(0), column(1), column(2));
        let rotation = x.dot(y).abs().max(x.dot(z).abs()).max(y.dot(z).abs()) < 1e-3
            && [x, y, z].iter().all(|v| (v.length() - 1.0).abs() < 1e-3)
            && x.cross(y).dot(z) > 0.0
            && rows[3] == [0.0, 0.0, 0.0, 1.0];
        if !rotation {
            return Err(Error::parameter(
                "world_from_camera",
                format!("{rows:?}"),
                "a rigid motion: orthonormal right-handed axes without scale, and a last row of 0, 0, 0, 1",
            ));
        }
        let (up, forward) = match convention {
            Convention::OpenGl => (y, -z),
            Convention::OpenCv => (-y, z),
        };
        let forward = forward.normalize();
        let right = forward.cross(up).normalize();
        Ok(Self { projection: Projection::Perspective, eye, right, up: right.cross(forward), forward, fov })
    }

    /// The whole sphere around `eye`: image centre north, right clockwise from above, top the zenith.
    pub fn equirect(eye: DVec3) -> Result<Self> {
        let eye = finite("eye", eye, FARTHEST_EYE)?;
        Ok(Self { projection: Projection::Equirect, eye, right: DVec3::X, up: DVec3::Z, forward: DVec3::Y, fov: 360.0 })
    }

    /// An all-sky camera that looks along `up`: centre of the image `up`, its top as far north as can be, equidistant.
    /// As on a photograph from below, east is on the left. Outside the circle of `fov` degrees nothing is seen.
    pub fn fisheye(eye: DVec3, up: DVec3, fov: f64) -> Result<Self> {
        let eye = finite("eye", eye, FARTHEST_EYE)?;
        let fov = check_fov("fov", fov, 360.0)?;
        let axis = finite("up", up, f64::MAX)?;
        let Some(forward) = unit(axis) else {
            return Err(Error::parameter("up", "(0, 0, 0)", "a vector with a direction"));
        };
        // North made perpendicular to the axis; looking north or south, the zenith or nadir takes its place.
        let north = (DVec3::Y - forward.y * forward).try_normalize_above(1e-6);
        let image_up = north.unwrap_or(DVec3::Z * -forward.y.signum());
        let right = forward.cross(image_up).normalize();
        Ok(Self { projection: Projection::Fisheye, eye, right, up: right.cross(forward), forward, fov })
    }

    /// The matrix, by rows, that takes camera coordinates (OpenGL) to world coordinates.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let (x, y, z, e) = (self.right, self.up, -self.forward, self.eye);
        [[x.x, y.x, z.x, e.x], [x.y, y.y, z.y, e.y], [x.z, y.z, z.z, e.z], [0.0, 0.0, 0.0, 1.0]]
    }
}

trait TryNormalizeAbove: Sized {
    fn try_normalize_above(self, least: f64) -> Option<Self>;
}

impl TryNormalizeAbove for DVec3 {
    /// The unit vector, unless the vector is shorter than `least`.
    fn try_normalize_above(self, least: f64) -> Option<Self> {
        (self.length() > least).then(|| self.normalize())
    }
}
