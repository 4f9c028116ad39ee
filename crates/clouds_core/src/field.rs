//! Shape of the light field: nested levels around the eye, or one level over the user's grid.

use glam::{DVec2, DVec3};

use crate::chart::{from_chart, on_chart};
use crate::clipmap::Origin;
use crate::directions::sun_direction;
use crate::params::{self, Model, Params, Quality};
use crate::wind::Advection;

/// Levels of the light field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldShape {
    /// Cells of the finest level across, along, and up.
    pub cells: [u32; 3],
    /// Cell of the finest level, m.
    pub cell: [f32; 3],
    /// Altitude of the base of the lowest row, m; of a grid, the base of its box less a cell.
    pub base: f32,
    /// Number of the lowest row: row 0 begins at the base of the lower deck, at any shell.
    pub lowest: i32,
    /// Number of levels. Each has as many cells as the one before across and along, twice as wide.
    pub levels: u32,
    /// Number of levels beyond the finest whose rows are twice as high as those of the level before. Rows of further
    /// levels have the height of the last of them, in flat cells.
    pub halvings: u32,
}

/// Smallest number of rows of a deck: half as many are too few for decks that fill a third of the shell
/// (docs/notes/accuracy.md).
const LEAST_ROWS: u32 = 20;
/// Largest number of rows of the shell.
const MOST_ROWS: u32 = 60;
/// Part of a row by which the shell may reach into the empty row beyond its last. The shell ends at a multiple of the
/// height in many skies; there a little more of it adds no row.
const IN_EMPTY_ROW: f32 = 0.25;
/// Number of cells along a side of a grid that a grid of fewer voxels has, too; with fewer rows cells are flat.
const FEWEST_CELLS: f32 = 16.0;
/// Largest number of cells of a grid's level: its radiances, of 72 bytes per cell, fit a buffer of 128 MiB.
const MOST_CELLS: f32 = 1.5e6;
/// Half width of the coarsest level of clouds, m: clouds beyond hide behind nearer ones.
const REACH: f32 = 50_000.0;
/// Displacement of the clouds in m up to which the field is reused. A power of two (clipmap.rs).
const CLOUD_STEP: f64 = 64.0;

/// Number of pixels below which a picture of procedural clouds has half as many cells across, twice as wide, if it has
/// at most `SMALL_CELLS`: its field takes a third of the time (docs/speed.md). From 320 x 180 on the whole field is solved.
const SMALL_PICTURE: u64 = 57_600;
const SMALL_CELLS: u32 = 64;
/// Smallest number of cells across.
const FEWEST_ACROSS: u32 = 16;

impl FieldShape {
    /// Shape for a picture of a number of pixels; None if it does not read the field. `altitude` is that of the eye in m.
    pub fn new(params: &Params, quality: &Quality, altitude: f32, pixels: u64) -> Option<Self> {
        if params.light.model != Model::Multiple || !params.has_clouds() {
            return None;
        }
        let small = params.volume.is_none() && pixels < SMALL_PICTURE && quality.field_cells <= SMALL_CELLS;
        let halved = u32::from(small && quality.field_cells >= 2 * FEWEST_ACROSS);
        Some(Self::with_cells(
            params,
            quality.field_cells >> halved,
            quality.field_cell * (1 << halved) as f32,
            altitude,
        ))
    }

    /// Shape with a number of cells across, and the finest cell in m.
    fn with_cells(params: &Params, across: u32, cell: f32, altitude: f32) -> Self {
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
            return Self {
                cells: cells.map(|n| n + 2),
                cell,
                base: low.z as f32 - cell[2],
                lowest: 0,
                levels: 1,
                halvings: 0,
            };
        }
        let [base, top] = params.shell();
        // Cells double with the altitude of the eye, as pixels do.
        let wide = cell * (altitude.max(top) / 12_000.0).max(1.0).log2().floor().exp2();
        // Rows have fixed places relative to the lower deck, and their height changes with the decks continuously: what
        // is switched on adds rows, and leaves the others alone.
        let height = (wide.min(params.thinnest_deck() / LEAST_ROWS as f32)).max((top - base) / MOST_ROWS as f32);
        // An empty row below and above the clouds, as beside a grid.
        let row = |altitude: f32| (altitude - params.clouds.base) / height;
        let lowest = (row(base) + IN_EMPTY_ROW).floor() as i32 - 1;
        let end = (row(top) - IN_EMPTY_ROW).ceil() as i32 + 1;
        let halvings = ((end - lowest) as u32 / LEAST_ROWS).max(1).ilog2();
        // Rows of the coarser levels are whole numbers of these.
        let together = 1 << halvings;
        let lowest = together * lowest.div_euclid(together);
        let rows = ((end - lowest) as u32).next_multiple_of(together as u32);
        let wide = wide.max(height);
        let levels = (REACH / (0.5 * wide * across as f32)).max(1.0).log2().ceil() as u32 + 1;
        let (cells, cell) = ([across, across, rows], [wide, wide, height]);
        let base = params.clouds.base + lowest as f32 * height;
        Self { cells, cell, base, lowest, levels: levels.clamp(1, 8), halvings }
    }

    /// Rows of a level.
    pub fn rows(&self, level: u32) -> u32 {
        self.cells[2] >> level.min(self.halvings)
    }

    /// Number of the lowest row of a level.
    pub fn lowest(&self, level: u32) -> i32 {
        self.lowest >> level.min(self.halvings)
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

/// Sky of a picture.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Now<'a> {
    pub params: &'a Params,
    pub eye: DVec3,
    /// Time in s.
    pub time: f64,
}

/// Sky that a level of the field is solved for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Anchor {
    /// Middle of the level on the chart, m.
    pub place: DVec2,
    /// Time of its clouds, s.
    pub time: f64,
    /// Its clouds and winds.
    params: Params,
    /// Unit vector toward its sun.
    sun: DVec3,
}

/// Levels of the field that a picture needs solved.
#[derive(Clone, Default)]
pub(crate) enum Due {
    /// Those of a still: all from nothing, unless they were solved for the same sky. A still does not depend on what was
    /// rendered before it.
    #[default]
    Still,
    /// All of an animation, from nothing.
    Whole,
    /// Some of an animation, from their own light. For each level: the sky that it is solved for, and what has changed.
    Levels(Vec<(Anchor, Work)>),
}

impl Due {
    /// Whether the field is that of an animation.
    pub fn is_animated(&self) -> bool {
        !matches!(self, Self::Still)
    }
}

/// What is done for a level of an animation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Work {
    /// Number of cycles; 0 if the level is up to date.
    pub cycles: u32,
    /// Whether its clouds are new, besides its sun.
    pub clouds: bool,
}

/// Lag up to which the finest level is not solved anew: angle of the sun in degrees. The n-th level may lag n times as
/// far, as may its drift.
const SUN_LAG: f64 = 0.25;
/// Sine of the elevation at which the sun may lag by that: at others in proportion, down to a part of it. At a low sun
/// shadows are long.
const LAG_SINE: f64 = 0.5;
const LEAST_LAG: f64 = 0.4;
/// Lag of the eye, as `SUN_LAG`: distance from the middle of the level in m.
const EYE_LAG: f64 = 600.0;
/// Lag of clouds that form: change of the coverage, or fraction of the weather that differs. The same for all levels: a
/// change of 0.01 is 6 % of the brightness of `fair_weather`.
const CLOUD_CHANGE: f64 = 0.003;
/// Cycles of multigrid of a level that follows a drifting sky.
const DRIFT_CYCLES: u32 = 1;
/// Lag in units of the above from which on a level is solved at once, by twice as many cycles; up to then one level is
/// solved per frame.
const URGENT_LAG: f64 = 1.5;
/// Lag in units of the above from which on the field is solved from nothing.
const MOST_LAG: f64 = 2.5;

/// Position and time on the grid of stills.
pub(crate) fn origin(eye: DVec3, params: &Params, time: f64) -> Origin {
    if params.volume.is_some() {
        return Origin { steps: [0; 3], place: DVec2::ZERO, time: 0.0 };
    }
    Origin::new(on_chart(eye, params).extend(0.0), params, time, CLOUD_STEP)
}

impl Anchor {
    /// Anchor of the levels of a still.
    pub fn still(eye: DVec3, params: &Params, time: f64) -> Self {
        let Origin { place, time, .. } = origin(eye, params, time);
        Self { place, time, params: params.clone(), sun: sun_direction(params) }
    }

    /// Middle of the level on the ground; of a grid, the origin of the world.
    pub fn on_ground(&self, params: &Params) -> DVec3 {
        from_chart(self.place, params)
    }

    /// Displacements of the clouds since.
    fn advection(&self, now: &Now<'_>) -> Advection {
        Advection::between((&self.params, self.time), (now.params, now.time))
    }

    /// Position of the eye relative to the middle of the level, after advection, on the chart, m.
    pub fn eye(&self, now: &Now<'_>) -> DVec2 {
        if now.params.volume.is_some() {
            return DVec2::ZERO;
        }
        on_chart(now.eye, now.params) - self.place - self.advection(now).drift().truncate()
    }

    /// Lag of sun and of clouds behind a picture, in units of the lags allowed for a level. Infinite for another sky.
    fn lag(&self, level: usize, now: &Now<'_>) -> [f64; 2] {
        let (old, new) = (&self.params, now.params);
        let planet = |params: &Params| params.atmosphere.planet_radius;
        let clouds = params::Clouds { coverage: new.clouds.coverage, ..old.clouds.clone() };
        let same = (clouds, &old.upper_clouds, &old.light, &old.volume)
            == (new.clouds.clone(), &new.upper_clouds, &new.light, &new.volume);
        if !same || planet(old) != planet(new) {
            return [f64::INFINITY; 2];
        }
        let toward = sun_direction(new);
        let allowed = SUN_LAG * (toward.z.abs() / LAG_SINE).clamp(LEAST_LAG, 1.0 / LAG_SINE);
        let more = (level + 1) as f64;
        let sun = self.sun.angle_between(toward).to_degrees() / (more * allowed);
        if new.volume.is_some() {
            return [sun, 0.0];
        }
        let formed =
            f64::from(new.weather_change(old)).max(f64::from((old.clouds.coverage - new.clouds.coverage).abs()));
        let lags = [
            self.advection(now).spread(new.has_upper_clouds()) / (more * CLOUD_STEP),
            formed / CLOUD_CHANGE,
            self.eye(now).abs().max_element() / (more * EYE_LAG),
        ];
        // Displacements beyond the range of f64 give NaN.
        [sun, lags.into_iter().fold(0.0, |a, b| if b <= a { a } else { b })]
    }

    /// Anchor of a level with cells of a width in m for a picture: its middle moves with the clouds, and by whole cells
    /// with the eye.
    fn moved(&self, [across, along, _]: [f32; 3], now: &Now<'_>) -> Self {
        let cell = DVec2::new(across.into(), along.into());
        let drift = self.advection(now).drift().truncate();
        let place = self.place + drift + (self.eye(now) / cell).round() * cell;
        Self { place, time: now.time, params: now.params.clone(), sun: sun_direction(now.params) }
    }
}

/// Levels that an animation needs solved, from their anchors, the finest first. `rests` says whether the picture before
/// has the same sky: a static shot becomes its still.
pub(crate) fn due<'a>(
    anchors: impl Iterator<Item = &'a Anchor> + Clone,
    shape: &FieldShape,
    now: &Now<'_>,
    rests: bool,
) -> Due {
    let still = Anchor::still(now.eye, now.params, now.time);
    if rests && anchors.clone().any(|anchor| *anchor != still) {
        return Due::Whole;
    }
    let lags: Vec<_> = anchors
        .enumerate()
        .map(|(level, anchor)| {
            let [sun, clouds] = anchor.lag(level, now);
            (anchor, sun, clouds)
        })
        .collect();
    let lag = |level: usize| lags[level].1.max(lags[level].2);
    let worst = (0..lags.len()).max_by(|a, b| lag(*a).total_cmp(&lag(*b))).unwrap_or(0);
    if lag(worst).is_nan() || lag(worst) >= MOST_LAG {
        return Due::Whole;
    }
    let levels = lags.iter().enumerate().map(|(level, (anchor, _, clouds))| {
        let urgent = lag(level) > URGENT_LAG;
        if !urgent && (level != worst || lag(level) <= 1.0) {
            return ((*anchor).clone(), Work::default());
        }
        let cycles = DRIFT_CYCLES * (1 + u32::from(urgent));
        // With the sun the clouds are solved anew that would be due soon.
        if *clouds > 0.5 {
            return (anchor.moved(shape.cell(level as u32), now), Work { cycles, clouds: true });
        }
        (Anchor { sun: sun_direction(now.params), ..(*anchor).clone() }, Work { cycles, clouds: false })
    });
    Due::Levels(levels.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: FieldShape =
        FieldShape { cells: [64, 64, 20], cell: [100.0; 3], base: 0.0, lowest: 0, levels: 5, halvings: 0 };

    fn sky() -> Params {
        let mut params = Params::default();
        params.light.model = Model::Multiple;
        params.sun.elevation = 40.0;
        params
    }

    /// Levels due at an eye and a time, after a still of `before` at 0 s.
    fn due_after(before: &Params, now: &Now<'_>) -> Due {
        let anchors = vec![Anchor::still(DVec3::ZERO, before, 0.0); 5];
        due(anchors.iter(), &SHAPE, now, false)
    }

    fn works(due: Due) -> Vec<Work> {
        let Due::Levels(levels) = due else { panic!("all levels from nothing") };
        levels.into_iter().map(|(_, work)| work).collect()
    }

    #[test]
    fn a_sky_at_rest_needs_no_level() {
        let params = sky();
        let works = works(due_after(&params, &Now { params: &params, eye: DVec3::ZERO, time: 0.0 }));
        assert!(works.iter().all(|work| work.cycles == 0), "{works:?}");
    }

    #[test]
    fn a_drifting_sun_needs_one_level_per_frame() {
        let (before, mut after) = (sky(), sky());
        // Of the 0.32 degrees that the finest level may lag at this elevation.
        after.sun.elevation += 0.4;
        let works = works(due_after(&before, &Now { params: &after, eye: DVec3::ZERO, time: 0.0 }));
        assert_eq!(works[0], Work { cycles: DRIFT_CYCLES, clouds: false });
        assert!(works[1..].iter().all(|work| work.cycles == 0), "{works:?}");
    }

    #[test]
    fn jumps_solve_the_field_from_nothing() {
        let before = sky();
        let mut jumps = vec![sky(); 4];
        jumps[0].sun.elevation = 60.0;
        jumps[1].clouds.extinction *= 2.0;
        jumps[2].clouds.coverage += 0.3;
        jumps[3].weather.seed += 1;
        for params in &jumps {
            let due = due_after(&before, &Now { params, eye: DVec3::ZERO, time: 0.0 });
            assert!(matches!(due, Due::Whole), "{params:?}");
        }
        let far = Now { params: &before, eye: DVec3::new(30e3, 0.0, 0.0), time: 0.0 };
        assert!(matches!(due_after(&before, &far), Due::Whole));
    }

    /// A level that lags less than it may is left alone while the sky moves, and solved as that of a still when it stops.
    #[test]
    fn a_sky_that_stops_is_that_of_a_still() {
        let (before, mut after) = (sky(), sky());
        after.sun.elevation += 0.1;
        let now = Now { params: &after, eye: DVec3::ZERO, time: 0.0 };
        let anchors = [Anchor::still(DVec3::ZERO, &before, 0.0)];
        assert!(works(due(anchors.iter(), &SHAPE, &now, false)).iter().all(|work| work.cycles == 0));
        assert!(matches!(due(anchors.iter(), &SHAPE, &now, true), Due::Whole));
        let anchors = [Anchor::still(DVec3::ZERO, &after, 0.0)];
        assert!(works(due(anchors.iter(), &SHAPE, &now, true)).iter().all(|work| work.cycles == 0));
    }

    /// Clouds that drift as one need no new light, and a level that follows the eye keeps its cells on the clouds.
    #[test]
    fn levels_move_with_the_clouds() {
        let mut params = sky();
        params.wind.speed = 20.0;
        params.wind.weather_speed = 20.0;
        params.wind.detail_speed = 20.0;
        params.wind.weather_direction = params.wind.direction;
        params.wind.detail_direction = params.wind.direction;
        params.wind.updraft = 0.0;
        let now = Now { params: &params, eye: DVec3::ZERO, time: 20.0 };
        assert!(works(due_after(&params, &now)).iter().all(|work| work.cycles == 0));
        let now = Now { time: 40.0, ..now };
        let Due::Levels(levels) = due_after(&params, &now) else { panic!() };
        let (anchor, work) = &levels[0];
        assert!(work.clouds && work.cycles > 0, "{work:?}");
        let before = Anchor::still(DVec3::ZERO, &params, 0.0);
        let cells = (before.eye(&now) - anchor.eye(&now)) / 100.0;
        assert!(cells.distance(cells.round()) < 1e-6 && cells.length() > 7.0, "{cells}");
        assert!(anchor.eye(&now).abs().max_element() <= 50.0 + 1e-6);
    }

    /// Small pictures have half as many cells, twice as wide, but in `high` and `reference`.
    #[test]
    fn small_pictures_have_a_coarser_field() {
        let cells = |params: &Params, quality: &Quality, pixels| {
            let shape = FieldShape::new(params, quality, 0.0, pixels).expect("reads the field");
            (shape.cells[0], shape.cell[0])
        };
        let balanced = Quality::named("balanced").expect("exists");
        assert_eq!(cells(&sky(), &balanced, SMALL_PICTURE - 1), (32, 200.0));
        assert_eq!(cells(&sky(), &balanced, SMALL_PICTURE), (64, 100.0));
        let high = Quality::named("high").expect("exists");
        assert_eq!(cells(&sky(), &high, 1), (128, 50.0));
    }
}
