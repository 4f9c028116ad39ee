//! User-supplied cloud: extinction on a regular grid.

use glam::DVec3;

use crate::error::{Error, Result};

/// Extinction at the centres of the voxels of a cuboid, with trilinear interpolation. The outermost values extend to
/// the faces of the box; the extinction outside the box is 0.
#[derive(Clone)]
pub struct DensityGrid {
    /// Voxels along x, y and z.
    size: [usize; 3],
    /// Extinction in 1/m, x fastest, then y.
    extinction: Vec<f32>,
    /// Lowest corner in world metres.
    low: DVec3,
    /// Highest corner in world metres.
    high: DVec3,
    /// Largest extinction in 1/m.
    max: f32,
}

/// Maximum number of voxels along a side: the texture size that every Vulkan adapter supports.
const MAX_SIDE: usize = 2048;
/// Maximum extinction in 1/m, the same as of `clouds.extinction`.
const MAX_EXTINCTION: f32 = 1e8;
/// Maximum coordinate of a face in m.
const MAX_COORDINATE: f64 = 1e7;

impl DensityGrid {
    /// Grid of `size` voxels along x, y and z in the box from `low` to `high`, in world metres. `extinction` is in 1/m,
    /// x fastest, then y.
    ///
    /// Returns [`Error::Parameter`] for a wrong length, a value out of range, or an empty box.
    pub fn new(size: [usize; 3], extinction: Vec<f32>, low: DVec3, high: DVec3) -> Result<Self> {
        let [nx, ny, nz] = size;
        if size.iter().any(|n| !(1..=MAX_SIDE).contains(n)) || extinction.len() != nx * ny * nz {
            return Err(Error::parameter(
                "extinction",
                format!("an array of shape ({nz}, {ny}, {nx})"),
                format!("an array of shape (nz, ny, nx), each from 1 to {MAX_SIDE}"),
            ));
        }
        // The negation rejects NaN.
        if let Some(bad) = extinction.iter().find(|v| !(**v >= 0.0 && **v <= MAX_EXTINCTION)) {
            let allowed = format!("finite numbers from 0 to {MAX_EXTINCTION} 1/m");
            return Err(Error::parameter("extinction", format!("an array with {bad}"), allowed));
        }
        // The comparison alone accepts NaN: the maximum of NaN and 1 is 1.
        let finite = low.is_finite() && high.is_finite();
        let in_range = low.abs().max(high.abs()).max_element() <= MAX_COORDINATE;
        if !(finite && in_range && (high - low).min_element() >= 1e-3) {
            return Err(Error::parameter(
                "bounds",
                format!("(({}, {}, {}), ({}, {}, {}))", low.x, low.y, low.z, high.x, high.y, high.z),
                format!(
                    "two corners within {MAX_COORDINATE} m of the origin, the second above the first by 1 mm or more"
                ),
            ));
        }
        let max = extinction.iter().copied().fold(0.0, f32::max);
        Ok(Self { size, extinction, low, high, max })
    }

    /// Voxels along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Extinction in 1/m, x fastest, then y.
    pub fn extinction(&self) -> &[f32] {
        &self.extinction
    }

    /// Lowest and highest corner in world metres.
    pub fn bounds(&self) -> [DVec3; 2] {
        [self.low, self.high]
    }

    /// Largest extinction in 1/m.
    pub fn max(&self) -> f32 {
        self.max
    }
}

impl PartialEq for DensityGrid {
    fn eq(&self, other: &Self) -> bool {
        // Shortcut: successive frames share one grid.
        let corners = (self.low, self.high) == (other.low, other.high);
        std::ptr::eq(self, other) || (self.size == other.size && corners && self.extinction == other.extinction)
    }
}

impl std::fmt::Debug for DensityGrid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DensityGrid({} x {} x {}, {} to {})", self.size[0], self.size[1], self.size[2], self.low, self.high)
    }
}
