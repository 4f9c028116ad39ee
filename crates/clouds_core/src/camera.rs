//! Cameras: position, orientation, and the projection between pixels and directions.
//!
//! World coordinates are right-handed, in metres: x east, y north, z up. The axes of a camera are right, up and
//! forward. A camera matrix follows OpenGL (+x right, +y up, view direction -z) or OpenCV (+x right, +y down, view
//! direction +z).

use glam::DVec3;

use crate::error::{Error, Result};
use crate::shared::constants;

/// Projection between pixels and directions. WGSL shares the discriminants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Pinhole; `fov` is the vertical field of view.
    #[default]
    Perspective = 0,
    /// Equirectangular: the whole sphere by longitude and latitude. The image centre is north, right is clockwise seen
    /// from above.
    Equirect = 1,
    /// Equidistant fisheye; `fov` spans the shorter side of the image.
    Fisheye = 2,
}

constants! {
    /// [`Projection::Equirect`]: image centre north, right clockwise seen from above.
    const EQUIRECT: u32 = Projection::Equirect as u32;
    /// [`Projection::Fisheye`]: equidistant, the angle to the axis grows linearly from the centre.
    const FISHEYE: u32 = Projection::Fisheye as u32;
}

/// Axes of a camera matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// +x right, +y up, view direction -z.
    OpenGl,
    /// +x right, +y down, view direction +z.
    OpenCv,
}

/// Camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Projection between pixels and directions.
    pub projection: Projection,
    /// Position in world metres.
    pub eye: DVec3,
    /// Unit vector toward the right of the picture.
    pub right: DVec3,
    /// Unit vector toward the top of the picture.
    pub up: DVec3,
    /// Unit vector toward the centre of the picture.
    pub forward: DVec3,
    /// Field of view in degrees (see [`Projection`]).
    pub fov: f64,
}

/// Maximum coordinate of the eye in m: 100 000 km of altitude, also over the far side of the planet.
const FARTHEST_EYE: f64 = 2e8;

fn finite(field: &str, v: DVec3, limit: f64) -> Result<DVec3> {
    // The comparison rejects NaN.
    if v.abs().max_element() <= limit && v.is_finite() {
        return Ok(v);
    }
    // The range of f64 has 309 digits.
    let range = if limit < f64::MAX { format!(" from {} to {limit}", -limit) } else { String::new() };
    Err(Error::parameter(field, format!("({}, {}, {})", v.x, v.y, v.z), format!("3 finite numbers{range}")))
}

/// Normalized vector. It is scaled first: f64 does not hold the square of a length below 1e-154 m or above 1e154 m.
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
    /// Pinhole camera at `eye` that looks at `target`, both in world metres; `fov_y` is the vertical field of view in
    /// degrees.
    ///
    /// Returns [`Error::Parameter`] for a value out of range, or a degenerate view direction.
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

    /// Pinhole camera from a 4x4 camera-to-world matrix, by rows; `fov_y` is the vertical field of view in degrees.
    ///
    /// Returns [`Error::Parameter`] for a value out of range, or a matrix that is not a rigid transform.
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

    /// Equirectangular camera: the whole sphere around `eye`, in world metres. The image centre is north, right is
    /// clockwise seen from above, the top row is the zenith.
    ///
    /// Returns [`Error::Parameter`] for an eye out of range.
    pub fn equirect(eye: DVec3) -> Result<Self> {
        let eye = finite("eye", eye, FARTHEST_EYE)?;
        Ok(Self { projection: Projection::Equirect, eye, right: DVec3::X, up: DVec3::Z, forward: DVec3::Y, fov: 360.0 })
    }

    /// Equidistant fisheye (all-sky) camera at `eye`, in world metres. The image centre is the direction `up`, the top
    /// is the direction closest to north; east is on the left, as on a photograph of the sky. Pixels outside the circle
    /// of `fov` degrees are empty.
    ///
    /// Returns [`Error::Parameter`] for a value out of range.
    pub fn fisheye(eye: DVec3, up: DVec3, fov: f64) -> Result<Self> {
        let eye = finite("eye", eye, FARTHEST_EYE)?;
        let fov = check_fov("fov", fov, 360.0)?;
        let axis = finite("up", up, f64::MAX)?;
        let Some(forward) = unit(axis) else {
            return Err(Error::parameter("up", "(0, 0, 0)", "a vector with a direction"));
        };
        // North orthogonal to the axis; if the axis is north or south, the zenith or nadir.
        let north = (DVec3::Y - forward.y * forward).try_normalize_above(1e-6);
        let image_up = north.unwrap_or(DVec3::Z * -forward.y.signum());
        let right = forward.cross(image_up).normalize();
        Ok(Self { projection: Projection::Fisheye, eye, right, up: right.cross(forward), forward, fov })
    }

    /// Camera-to-world matrix by rows, for OpenGL camera coordinates.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let (x, y, z, e) = (self.right, self.up, -self.forward, self.eye);
        [[x.x, y.x, z.x, e.x], [x.y, y.y, z.y, e.y], [x.z, y.z, z.z, e.z], [0.0, 0.0, 0.0, 1.0]]
    }
}

trait TryNormalizeAbove: Sized {
    fn try_normalize_above(self, least: f64) -> Option<Self>;
}

impl TryNormalizeAbove for DVec3 {
    /// Normalized vector, or None if its length is at most `least`.
    fn try_normalize_above(self, least: f64) -> Option<Self> {
        (self.length() > least).then(|| self.normalize())
    }
}
