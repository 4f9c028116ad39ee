//! A cloud of the user's own: extinction on a grid.

use glam::DVec3;

use crate::error::{Error, Result};

/// Extinction at the centres of the voxels of a straight box, trilinear between them; the outermost values hold to the
/// faces of the box, and outside there is nothing.
#[derive(Clone)]
pub struct DensityGrid {
    /// Voxels along x, y and z.
    size: [usize; 3],
    /// Extinction in 1/m, x fastest, then y.
    extinction: Vec<f32>,
    /// The lowest corner in world metres.
    low: DVec3,
    /// The highest corner.
    high: DVec3,
    /// The largest extinction.
    max: f32,
}

/// Most voxels along a side: what every Vulkan adapter holds in a texture.
const LONGEST: usize = 2048;
/// Largest extinction in 1/m, as of `clouds.extinction`.
const DENSEST: f32 = 1e8;
/// Farthest face from the origin in metres.
const FARTHEST: f64 = 1e7;

impl DensityGrid {
    /// A grid of `size` voxels along x, y and z, in the box from `low` to `high`.
    pub fn new(size: [usize; 3], extinction: Vec<f32>, low: DVec3, high: DVec3) -> Result<Self> {
        let [nx, ny, nz] = size;
        if size.iter().any(|n| !(1..=LONGEST).contains(n)) || extinction.len() != nx * ny * nz {
            return Err(Error::parameter(
                "extinction",
                format!("an array of shape ({nz}, {ny}, {nx})"),
                format!("an array of shape (nz, ny, nx), each from 1 to {LONGEST}"),
            ));
        }
        // Written so that NaN fails it.
        if let Some(bad) = extinction.iter().find(|v| !(**v >= 0.0 && **v <= DENSEST)) {
            let allowed = format!("finite numbers from 0 to {DENSEST} 1/m");
            return Err(Error::parameter("extinction", format!("an array with {bad}"), allowed));
        }
        // The comparison alone would let NaN pass: the largest of NaN and 1 is 1.
        let finite = low.is_finite() && high.is_finite();
        let near = low.abs().max(high.abs()).max_element() <= FARTHEST;
        if !(finite && near && (high - low).min_element() >= 1e-3) {
            return Err(Error::parameter(
                "bounds",
                format!("(({}, {}, {}), ({}, {}, {}))", low.x, low.y, low.z, high.x, high.y, high.z),
                format!("two corners within {FARTHEST} m of the origin, the second above the first by 1 mm or more"),
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

    /// The lowest and the highest corner, in world metres.
    pub fn bounds(&self) -> [DVec3; 2] {
        [self.low, self.high]
    }

    /// The largest extinction in 1/m.
    pub fn max(&self) -> f32 {
        self.max
    }
}

impl PartialEq for DensityGrid {
    fn eq(&self, other: &Self) -> bool {
        // Frame after frame has the same one.
        let corners = (self.low, self.high) == (other.low, other.high);
        std::ptr::eq(self, other) || (self.size == other.size && corners && self.extinction == other.extinction)
    }
}

impl std::fmt::Debug for DensityGrid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DensityGrid({} x {} x {}, {} to {})", self.size[0], self.size[1], self.size[2], self.low, self.high)
    }
}
