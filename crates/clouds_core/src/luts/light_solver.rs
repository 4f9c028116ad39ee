//! Solver of the light field on one level of cells (passes/light_solver): sweeps of its cells, corrected by grids of wider
//! cells (multigrid).
//!
//! A sweep alone moves light by a mean free path: a storm would need thousands. After one cycle, begun with the light of
//! the level around it, a level is 1 to 8 % from its converged solution (`tests/test_light_field.py`). W-cycles, which visit
//! the wider grids twice, solve a slab of optical depth 80 in two cycles instead of eight, and leave 0.9 of the error of
//! skies for 1.6 times the time.

use glam::{DVec2, DVec3};

use super::lut::view;
use crate::camera::Camera;
use crate::error::Result;
use crate::field::FieldShape;
use crate::frame::Frame;
use crate::gpu::{Bindings, Gpu, Recorder};
use crate::params;
use crate::shared::constants;
use crate::uniforms::{FieldLevel, uniform};

constants! {
    /// Sides of a level: what leaves at one side enters at the other.
    const SIDES_PERIODIC: u32 = 1;
    /// Sides of a level: radiance of the coarser level around it.
    const SIDES_COARSER: u32 = 2;
}

/// Sides of a level: dark but for the sky.
pub(super) const SIDES_OPEN: u32 = 0;
/// Directions of the lattice, and those of them that are steep or tilted out of the rows.
pub(super) const DIRECTIONS: u64 = 18;
const STEEP: u32 = 10;
/// Slope of the tilted directions (light_lattice.wgsl).
const TILT: f32 = 0.12;
/// Grids that correct a level at most, each of wider cells than the one before, and sweeps of the last of them.
const MOST_GRIDS: usize = 4;
const LAST_SWEEPS: u32 = 4;
/// Ratio of the sides of a cell from which on it is halved along the shorter ones alone: light goes from cell to cell
/// along these.
const OBLONG: f32 = 1.5;
/// Cells that a ray toward the sun crosses in a level before it reads the coarser one.
const SUN_CELLS: u32 = 24;
/// Largest number of cells that it crosses in a level without a coarser one.
const MOST_SUN_CELLS: f32 = 512.0;

/// Grid of cells that is solved.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub cells: [u32; 3],
    pub cell: [f32; 3],
    /// Number of the lowest row.
    pub lowest: i32,
    pub sides: u32,
}

/// Solution of a stage.
#[derive(Clone)]
pub(super) struct Solution {
    pub stage: Stage,
    pub densities: wgpu::TextureView,
    pub optics: wgpu::TextureView,
    pub sun: wgpu::TextureView,
    pub sky: wgpu::TextureView,
    /// Radiance that enters at the sides.
    pub entering: wgpu::Buffer,
}

/// Buffers that the levels share while they are solved.
pub(super) struct Scratch {
    deposits: wgpu::Buffer,
    radiances: wgpu::Buffer,
    balance: wgpu::Buffer,
    /// Fluence and flux.
    moments: wgpu::Buffer,
}

impl Scratch {
    pub fn new(gpu: &Gpu, stages: &[Stage]) -> Self {
        let most = stages.iter().map(Stage::count).max().unwrap_or(1);
        Self {
            deposits: gpu.buffer("deposits", 8 * most),
            radiances: gpu.buffer("radiances", 4 * DIRECTIONS * most),
            balance: gpu.buffer("balance", 4),
            moments: gpu.buffer("moments", 32 * most),
        }
    }

    pub fn bindings(&self) -> Bindings {
        vec![
            ("deposits", (&self.deposits).into()),
            ("radiances", (&self.radiances).into()),
            ("balance", (&self.balance).into()),
            ("moments_now", (&self.moments).into()),
        ]
    }
}

/// Grid of multigrid: the cells of a level, or wider ones that correct the grid before.
struct Grid {
    level: FieldLevel,
    optics: wgpu::TextureView,
    sources: wgpu::TextureView,
    moments: wgpu::Buffer,
    /// What the grid has to correct.
    residuals: wgpu::Buffer,
}

impl Solution {
    /// Solution of a stage, not solved yet.
    pub fn new(gpu: &Gpu, stage: Stage) -> Self {
        let texture = |label| view(&gpu.texture_3d(label, stage.cells));
        let [densities, optics] = ["densities", "optics"].map(texture);
        let [sun, sky] = ["sun", "sky"].map(texture);
        let entering = gpu.buffer("entering", 4 * DIRECTIONS * stage.rim());
        Self { densities, optics, sun, sky, entering, stage }
    }

    /// Bindings as the level that is solved.
    pub fn as_level(&self) -> Bindings {
        vec![
            ("level_optics", (&self.optics).into()),
            ("level_sun", (&self.sun).into()),
            ("level_sky", (&self.sky).into()),
            ("entering", (&self.entering).into()),
        ]
    }

    /// Bindings as the level around it.
    pub fn as_coarser(&self) -> Bindings {
        vec![
            ("coarser_optics", (&self.optics).into()),
            ("coarser_sun", (&self.sun).into()),
            ("coarser_sky", (&self.sky).into()),
        ]
    }
}

impl Stage {
    /// Stages of the levels of a field, from the outermost, whose sides are open or periodic.
    pub fn of_levels(shape: &FieldShape, is_open: bool) -> Vec<Self> {
        let stage = |level: u32| Self {
            cells: [shape.cells[0], shape.cells[1], shape.rows(level)],
            cell: shape.cell(level),
            lowest: shape.lowest(level),
            sides: match level + 1 == shape.levels {
                true if is_open => SIDES_OPEN,
                true => SIDES_PERIODIC,
                false => SIDES_COARSER,
            },
        };
        (0..shape.levels).rev().map(stage).collect()
    }

    pub fn count(&self) -> u64 {
        self.cells.iter().map(|n| u64::from(*n)).product()
    }

    /// Number of cells at one side across and one along.
    pub fn rim(&self) -> u64 {
        u64::from((self.cells[0] + self.cells[1]) * self.cells[2])
    }

    /// Whether the tilted directions cross a row in less than a cell.
    fn is_flat(&self) -> bool {
        TILT * self.cell[0].min(self.cell[1]) > self.cell[2]
    }

    /// Grid of wider cells over the same box, if there is one: of cells that are twice as wide along all short sides.
    /// The last cells may reach beyond the box.
    fn coarser(&self) -> Option<Self> {
        let divisible = |axis: &usize| self.cells[*axis] > 2;
        let shortest = (0..3).filter(divisible).map(|axis| self.cell[axis]).fold(f32::INFINITY, f32::min);
        let halved: [bool; 3] = std::array::from_fn(|axis| divisible(&axis) && self.cell[axis] < OBLONG * shortest);
        let cells: [u32; 3] = std::array::from_fn(|axis| self.cells[axis].div_ceil(1 + u32::from(halved[axis])));
        let cell = std::array::from_fn(|axis| if halved[axis] { 2.0 * self.cell[axis] } else { self.cell[axis] });
        halved.contains(&true).then(|| Self { cells, cell, ..self.clone() })
    }
}

/// Sky in which a field is solved.
pub(super) struct Sun {
    /// Unit vector toward the sun in the axes of the field.
    pub toward: [f32; 3],
    pub is_up: bool,
    /// Half of the reciprocal of the planet's radius, 1/m; 0 in the straight box of a grid.
    pub bend: f32,
}

/// Solve of a level.
pub(super) struct Task<'a> {
    pub solution: &'a Solution,
    pub sun: &'a Sun,
    /// Level around it, and the position of the middle relative to the middle of that, m.
    pub coarser: Option<(&'a Solution, DVec2)>,
    /// Own field to begin with instead of that of the level around it: the displacement of the middle since, m.
    pub moved: Option<DVec2>,
    /// Number of cycles.
    pub cycles: u32,
    /// Whether the densities are baked.
    pub bakes: bool,
    /// Uniform blocks of a frame at the middle of the field.
    pub frame: &'a Bindings,
    pub scratch: &'a Scratch,
}

impl Task<'_> {
    /// Uniform block of the level.
    pub fn level(&self) -> FieldLevel {
        let coarser = self.coarser.map(|(coarser, offset)| (&coarser.stage, offset));
        level_block(&self.solution.stage, self.sun, coarser)
    }

    /// Bindings of a dispatch for the level, or for a grid that corrects it: those given take precedence.
    pub fn bindings(&self, level: &FieldLevel, given: Bindings) -> Bindings {
        let Self { solution, scratch, frame, .. } = self;
        // Without a level around it nothing of that is read.
        let none = || Solution { optics: solution.densities.clone(), ..(*solution).clone() }.as_coarser();
        let coarser = self.coarser.map_or_else(none, |(coarser, _)| coarser.as_coarser());
        let own = vec![("level", uniform(&[level]))];
        [own, given, scratch.bindings(), solution.as_level(), coarser, (*frame).clone()].concat()
    }

    /// Records it.
    pub fn solve(&self, rec: &mut Recorder<'_>) {
        let Self { solution, sun, .. } = *self;
        let stage = &solution.stage;
        let level = self.level();
        let count = [stage.count() as u32, 1, 1];
        let mut dispatch = |kernel, level, given, size| {
            rec.dispatch(("light_field", kernel), self.bindings(level, given), size);
        };
        let own = |texture, out| -> Bindings { vec![("level_optics", texture), ("volume_out", out)] };
        if self.bakes {
            dispatch("field_density", &level, vec![("volume_out", (&solution.densities).into())], stage.cells);
        }
        let optics = own((&solution.densities).into(), (&solution.optics).into());
        dispatch("field_depth", &level, optics, stage.cells);
        dispatch("field_beam", &level, vec![], count);
        dispatch("field_balance", &level, vec![], [256, 1, 1]);
        if stage.sides == SIDES_OPEN {
            dispatch("field_entering", &level, vec![], [stage.rim() as u32, DIRECTIONS as u32, 1]);
        }
        let grids = self.grids(rec);
        // The field to begin with: that of the level around it, or its own.
        let (start, begin_with) = match self.moved {
            Some(moved) => (level_block(stage, sun, Some((stage, moved))), solution.as_coarser()),
            None => (level.clone(), vec![]),
        };
        let sources = ("sources_out", (&grids[0].sources).into());
        let given = [begin_with, vec![sources]].concat();
        rec.dispatch(("light_solver", "field_start"), self.bindings(&start, given), count);
        for _ in 0..self.cycles {
            self.cycle(rec, &grids);
        }
        let keep = vec![("sun_out", (&solution.sun).into()), ("sky_out", (&solution.sky).into())];
        rec.dispatch(("light_field", "field_keep"), self.bindings(&level, keep), stage.cells);
    }

    /// Grids of the level, from the finest: its own cells, and those that correct it.
    fn grids(&self, rec: &mut Recorder<'_>) -> Vec<Grid> {
        let gpu = rec.gpu;
        let mut stage = self.solution.stage.clone();
        // The cells of the level have no residuals: they are solved for the light itself.
        let mut grids = vec![Grid {
            level: self.level(),
            optics: self.solution.optics.clone(),
            sources: view(&gpu.words_3d("sources", stage.cells)),
            moments: self.scratch.moments.clone(),
            residuals: gpu.buffer("residuals", 32),
        }];
        while let Some(coarser) = stage.coarser().filter(|_| grids.len() <= MOST_GRIDS) {
            let optics = view(&gpu.texture_3d("coarser_grid", coarser.cells));
            let finer = grids.last_mut().expect("has the cells of the level");
            [finer.level.coarser_across, finer.level.coarser_along, finer.level.coarser_rows] = coarser.cells;
            finer.level.coarser_scale = std::array::from_fn(|axis| stage.cell[axis] / coarser.cell[axis]);
            let given = vec![("level_optics", (&finer.optics).into()), ("volume_out", (&optics).into())];
            rec.dispatch(("light_solver", "field_coarsen"), self.bindings(&finer.level, given), coarser.cells);
            let [moments, residuals] = ["moments", "residuals"].map(|label| gpu.buffer(label, 32 * coarser.count()));
            let level = FieldLevel { corrects: 1, ..level_block(&coarser, self.sun, None) };
            let sources = view(&gpu.words_3d("sources", coarser.cells));
            grids.push(Grid { level, optics, sources, moments, residuals });
            stage = coarser;
        }
        grids
    }

    /// One cycle on the first of some grids: a sweep, the correction of its residual by the coarser grids, a sweep.
    fn cycle(&self, rec: &mut Recorder<'_>, grids: &[Grid]) {
        let Some((grid, coarser)) = grids.split_first() else { return };
        let dispatch = |rec: &mut Recorder<'_>, kernel, given: Bindings, size| {
            let bindings = self.bindings(&grid.level, [grid.bindings(), given].concat());
            rec.dispatch(("light_solver", kernel), bindings, size);
        };
        let [x, y, z] = grid.size();
        let count = [x * y * z, 1, 1];
        let is_flat = grid.level.tilt_crosses > 0;
        let sweep = |rec: &mut Recorder<'_>| {
            let down = if is_flat { DIRECTIONS as u32 } else { STEEP };
            dispatch(rec, "field_sweep_down", vec![("sources", (&grid.sources).into())], [x, y, down]);
            if !is_flat {
                let size = [x.max(y), z, DIRECTIONS as u32 - STEEP];
                dispatch(rec, "field_sweep_along", vec![("sources", (&grid.sources).into())], size);
            }
        };
        if grid.level.corrects > 0 {
            // The first sweep of a correction is one of no light.
            dispatch(rec, "field_begin_correction", vec![], count);
        }
        if let Some(next) = coarser.first() {
            sweep(rec);
            let out = vec![("coarser_residuals", (&next.residuals).into())];
            dispatch(rec, "field_restrict", out, [next.size().iter().product(), 1, 1]);
            self.cycle(rec, coarser);
            dispatch(rec, "field_correct", vec![("coarser_correction", (&next.moments).into())], count);
        }
        for _ in 0..if coarser.is_empty() { LAST_SWEEPS } else { 1 } {
            sweep(rec);
            dispatch(rec, "field_gather", vec![], count);
        }
    }
}

impl Grid {
    fn size(&self) -> [u32; 3] {
        [self.level.across, self.level.along, self.level.rows]
    }

    fn bindings(&self) -> Bindings {
        vec![
            ("level_optics", (&self.optics).into()),
            ("moments_now", (&self.moments).into()),
            ("residuals", (&self.residuals).into()),
            ("sources_out", (&self.sources).into()),
        ]
    }
}

/// Uniform block of a stage. `coarser` is the stage around it, with the position of the middle relative to that of it.
pub(super) fn level_block(stage: &Stage, sun: &Sun, coarser: Option<(&Stage, DVec2)>) -> FieldLevel {
    let speed = (0..3).map(|axis| sun.toward[axis].abs() / stage.cell[axis]).fold(0.0, f32::max);
    let height = stage.cell[2] * stage.cells[2] as f32;
    // Until the ray leaves at the top, or at a side.
    let way = match stage.sides {
        SIDES_OPEN => {
            let side = |axis: usize| stage.cell[axis] * stage.cells[axis] as f32;
            side(0).hypot(side(1)).hypot(side(2))
        }
        _ => {
            let mu = sun.toward[2].max(0.0);
            2.0 * height / (mu + (mu * mu + 4.0 * sun.bend * height).sqrt()).max(1e-6)
        }
    };
    let sun_steps = match stage.sides {
        SIDES_COARSER => SUN_CELLS,
        _ => ((way * speed).ceil() + 1.0).min(MOST_SUN_CELLS) as u32,
    };
    let mut level = FieldLevel {
        across: stage.cells[0],
        along: stage.cells[1],
        rows: stage.cells[2],
        lowest: stage.lowest as f32,
        sides: stage.sides,
        cell: stage.cell,
        sun: sun.toward,
        sunlit: sun.is_up.into(),
        bend: sun.bend,
        sun_steps,
        tilt_crosses: stage.is_flat().into(),
        ..FieldLevel::default()
    };
    if let Some((coarser, offset)) = coarser {
        [level.coarser_across, level.coarser_along, level.coarser_rows] = coarser.cells;
        level.coarser_scale = std::array::from_fn(|axis| stage.cell[axis] / coarser.cell[axis]);
        level.coarser_tilt_crosses = coarser.is_flat().into();
        let [x, y, _] = coarser.cell;
        level.coarser_offset = [offset.x as f32 / x, offset.y as f32 / y];
    }
    level
}

/// Cells of given extinctions for [`crate::Renderer::solve_light`].
pub struct Cells<'a> {
    /// Extinction of each cell in 1/m, x first.
    pub extinction: &'a [f32],
    /// Number of cells along each axis.
    pub size: [u32; 3],
    /// Cell in m.
    pub cell: [f32; 3],
    /// Unit vector toward the sun.
    pub sun: [f32; 3],
    /// Whether the cells repeat in x and y. Otherwise nothing but skylight enters at the sides.
    pub periodic: bool,
    /// Number of cycles.
    pub cycles: u32,
}

/// Solves the light field of given cells, from no light, for tests. Records readbacks of fluence and flux of the sun's
/// light and of the sky's (eight numbers per cell), and of scaled extinction and scaled sunlight (two).
pub(crate) fn solve_cells(rec: &mut Recorder<'_>, cells: &Cells<'_>, params: &params::Params) -> Result<()> {
    let mut frame = Frame::new(&Camera::equirect(DVec3::ZERO)?, params, 0.0, [1, 1]);
    frame.sky.extinction = 1.0;
    let bindings = frame.bindings(rec.gpu).to_vec();
    let sides = if cells.periodic { SIDES_PERIODIC } else { SIDES_OPEN };
    let stage = Stage { cells: cells.size, cell: cells.cell, lowest: 0, sides };
    let scratch = Scratch::new(rec.gpu, std::slice::from_ref(&stage));
    let sun = Sun { toward: cells.sun, is_up: true, bend: 0.0 };
    let texel = |v: &f32| [half::f16::from_f32(*v), half::f16::ZERO, half::f16::ZERO, half::f16::ZERO];
    let solution = Solution::new(rec.gpu, stage);
    let densities = solution.densities.texture();
    rec.gpu.write_texture(densities, &cells.extinction.iter().map(texel).collect::<Vec<_>>());
    let (frame, scratch) = (&bindings, &scratch);
    let cycles = cells.cycles;
    let solution = &solution;
    Task { solution, sun: &sun, coarser: None, moved: None, cycles, bakes: false, frame, scratch }.solve(rec);
    for buffer in [&scratch.moments, &scratch.deposits, &scratch.balance] {
        rec.download(buffer, 0, buffer.size());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells become cubes first; grids lie over the box of the level, or reach less than a cell beyond it.
    #[test]
    fn grids_of_wider_cells_end_with_few() {
        let stage = Stage { cells: [64, 50, 22], cell: [800.0, 800.0, 100.0], lowest: -2, sides: SIDES_PERIODIC };
        let mut sizes = vec![stage];
        while let Some(coarser) = sizes.last().and_then(Stage::coarser) {
            sizes.push(coarser);
        }
        let cells: Vec<_> = sizes.iter().map(|stage| stage.cells).collect();
        assert_eq!(cells[..4], [[64, 50, 22], [64, 50, 11], [64, 50, 6], [64, 50, 3]]);
        assert_eq!(cells.last(), Some(&[2, 2, 2]));
        for pair in sizes.windows(2) {
            for axis in 0..3 {
                let [fine, coarse] = [&pair[0], &pair[1]].map(|stage| stage.cell[axis] * stage.cells[axis] as f32);
                assert!(coarse >= fine && coarse < fine + pair[1].cell[axis], "{pair:?}");
            }
        }
    }
}
