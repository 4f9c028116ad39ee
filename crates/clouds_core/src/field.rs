//! Shape of the light field: nested levels around the eye, or one level over the user's grid.

use glam::DVec3;

use crate::clipmap::{self, Origin};
use crate::params::{Model, Params, Quality};

/// Levels of the light field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldShape {
    /// Cells of the finest level across, along, and up.
    pub cells: [u32; 3],
    /// Cell of the finest level, m.
    pub cell: [f32; 3],
    /// Altitude of the base of the lowest row, m; of a grid, the base of its box less a cell.
    pub base: f32,
    /// Number of levels. Each has as many cells as the one before across and along, twice as wide.
    pub levels: u32,
    /// Number of levels beyond the finest whose rows are twice as high as those of the level before. Rows of further
    /// levels have the height of the last of them, in flat cells.
    pub halvings: u32,
}

/// Smallest number of rows of a level of clouds: half as many are too few for decks that fill a third of the shell
/// (docs/notes/accuracy.md).
const LEAST_ROWS: u32 = 20;
/// Largest number of rows.
const MOST_ROWS: u32 = 64;
/// Number of cells along a side of a grid that a grid of fewer voxels has, too; with fewer rows cells are flat.
const FEWEST_CELLS: f32 = 16.0;
/// Largest number of cells of a grid's level: its radiances, of 72 bytes per cell, fit a buffer of 128 MiB.
const MOST_CELLS: f32 = 1.5e6;
/// Half width of the coarsest level of clouds, m: clouds beyond hide behind nearer ones.
const REACH: f32 = 50_000.0;
/// Displacement of the clouds in m up to which the field is reused. A power of two (clipmap.rs).
const CLOUD_STEP: f64 = 64.0;

/// Whether a picture reads the light field.
pub(crate) fn is_read(params: &Params) -> bool {
    params.light.model == Model::Multiple && params.has_clouds()
}

impl FieldShape {
    /// Shape for a sky. `altitude` is that of the eye in m.
    pub fn new(params: &Params, quality: &Quality, altitude: f32) -> Self {
        let across = quality.field_cells;
        if let Some(grid) = &params.volume {
            let [low, high] = grid.bounds();
            let side = (high - low).as_vec3();
            let voxel = side / glam::UVec3::from_array(grid.size().map(|n| n as u32)).as_vec3();
            // None smaller than a voxel, unless voxels are few.
            let least = voxel.min(side / FEWEST_CELLS);
            // Cubes: as many cells as a level of clouds has across, each way. Flat cells where cubes would be few upward.
            let most = (across as f32).powi(3).min(MOST_CELLS);
            let cube = (side.element_product() / most).cbrt();
            let height = cube.min(side.z / FEWEST_CELLS).max(least.z);
            let wide = (side.element_product() / (most * height)).sqrt().max(least.x.min(least.y));
            let count = |side: f32, cell: f32| ((side / cell).round() as u32).clamp(2, 4 * across);
            let cells = [count(side.x, wide), count(side.y, wide), count(side.z, height)];
            let cell: [f32; 3] = std::array::from_fn(|axis| side[axis] / cells[axis] as f32);
            // An empty cell on each side: the light at a face is between that of a cell inside and one outside.
            return Self { cells: cells.map(|n| n + 2), cell, base: low.z as f32 - cell[2], levels: 1, halvings: 0 };
        }
        let [base, top] = params.shell();
        let thick = top - base;
        // Cells double with the altitude of the eye, as pixels do.
        let wide = quality.field_cell * (altitude.max(top) / 12_000.0).max(1.0).log2().floor().exp2();
        let thinnest = if params.has_upper_clouds() {
            (params.clouds.top - params.clouds.base).min(params.upper_clouds.top - params.upper_clouds.base)
        } else {
            thick
        };
        let height = wide.min(thinnest / LEAST_ROWS as f32);
        // An empty row below and above the clouds, as beside a grid.
        let rows = ((thick / height).ceil() as u32 + 2).clamp(LEAST_ROWS, MOST_ROWS);
        let halvings = (rows / LEAST_ROWS).ilog2();
        let rows = rows.next_multiple_of(1 << halvings);
        let height = thick / (rows - 2) as f32;
        let wide = wide.max(height);
        let levels = (REACH / (0.5 * wide * across as f32)).max(1.0).log2().ceil() as u32 + 1;
        let (cells, cell) = ([across, across, rows], [wide, wide, height]);
        Self { cells, cell, base: base - height, levels: levels.clamp(1, 8), halvings }
    }

    /// Rows of a level.
    pub fn rows(&self, level: u32) -> u32 {
        self.cells[2] >> level.min(self.halvings)
    }

    /// Rows of all levels before one.
    pub fn rows_before(&self, level: u32) -> u32 {
        (0..level).map(|finer| self.rows(finer)).sum()
    }

    /// Cell of a level, m.
    pub fn cell(&self, level: u32) -> [f32; 3] {
        let [x, y, z] = self.cell;
        let wide = (1 << level) as f32;
        [wide * x, wide * y, z * self.cells[2] as f32 / self.rows(level) as f32]
    }
}

/// Origin of the light field of a picture. A user-supplied grid does not move with time.
pub(crate) fn origin(eye: DVec3, params: &Params, time: f64) -> Origin {
    if params.volume.is_some() {
        return Origin { steps: [0; 3], place: glam::DVec2::ZERO, time: 0.0 };
    }
    clipmap::Origin::new(eye, params, time, CLOUD_STEP)
}
