//! Light field: light in clouds of every order of scattering, solved on nested levels (passes/light_field).

use glam::{DVec2, DVec3};

use super::lut::{Inputs, Lut, view};
use super::volume::Grid;
use crate::camera::Camera;
use crate::clipmap::{Casters, casters};
use crate::error::Result;
use crate::field::{self, Anchor, Due, FieldShape, Now, Work};
use crate::frame::Frame;
use crate::gpu::{Binding, Bindings, Gpu, Recorder, Token};
use crate::params;
use crate::scattering::{FORWARD_SIZE, forward_table};
use crate::shared::constants;
use crate::uniforms::{FieldLevel, uniform};

constants! {
    /// Sides of a level: what leaves at one side enters at the other.
    const SIDES_PERIODIC: u32 = 1;
    /// Sides of a level: radiance of the coarser level around it.
    const SIDES_COARSER: u32 = 2;
}

/// Sides of a level: dark but for the sky.
const SIDES_OPEN: u32 = 0;
/// Directions of the lattice, and those of them that are steep or tilted out of the rows.
const DIRECTIONS: u64 = 18;
const STEEP: u32 = 10;
/// Slope of the tilted directions (passes/light_field.wgsl).
const TILT: f32 = 0.12;
/// Sweeps of the grids of the cascade that starts the outermost level, from that level to the coarsest grid. Deep decks
/// have slow modes: at an optical depth of 80, a slab's transmitted light is half of the right value after 42 sweeps.
/// Grids with few columns know them at little cost.
const CASCADE_SWEEPS: [u32; 5] = [8, 10, 20, 50, 150];
/// Sweeps of the finer levels: of the others, and of the finest. Of a low sun, whose light comes from afar: at 5 degrees
/// the finest level is 9 % from the converged solution after the first numbers, and 6 % after the second.
const LEVEL_SWEEPS: [u32; 2] = [4, 3];
const LOW_SUN_SWEEPS: [u32; 2] = [7, 4];
/// Sine of the sun's elevation, 15 degrees, below which it is low.
const LOW_SUN: f32 = 0.2588;
/// Upper bound of the spectrum of a sweep that Chebyshev's iteration assumes. Eigenvalues are complex: 0.93 is the
/// limit of stability, and 0.97 diverges.
const SPECTRUM: f64 = 0.9;
/// Cells that a ray toward the sun crosses in a level before it reads the coarser one.
const SUN_CELLS: u32 = 24;
/// Largest number of cells that it crosses in a level without a coarser one.
const MOST_SUN_CELLS: f32 = 512.0;

/// Largest number of cells of a grid that one workgroup sweeps, and of iterations of its loops. lavapipe ends the loops
/// of a kernel after 65,535 iterations in all.
const FEW_CELLS: u64 = 1024;
const FEW_ITERATIONS: u64 = 50_000;
/// Invocations of a workgroup (`field_sweep_few`).
const FEW_GROUP: u64 = 256;

/// Key of the field of a still: shadow casters, light, planet and grid, snapped position and time, shape, whether the
/// sun is up and the sweeps.
type Key = (Casters, params::Light, (f32, Grid), [i64; 3], FieldShape, (bool, u32));

/// Light field on the GPU.
#[derive(Default)]
pub(crate) struct LightField {
    still: Lut<Key, Textures>,
    animated: Option<(Solved, Token)>,
    forward: Lut<params::Light>,
    /// Number of times that all sweeps are made more often, less one.
    pub more_sweeps: u32,
}

/// Textures of all levels: optics, sun's field and sky's field, and the light on the ground.
#[derive(Clone)]
struct Textures {
    levels: [wgpu::TextureView; 3],
    ground: wgpu::TextureView,
}

/// Field of an animation, whose levels follow the sky.
struct Solved {
    shape: FieldShape,
    textures: Textures,
    /// Levels, from the finest.
    levels: Vec<(Anchor, Solution)>,
    scratch: Scratch,
}

/// Grid of cells that is solved, and how its solution is obtained.
#[derive(Clone, Debug)]
struct Stage {
    cells: [u32; 3],
    cell: [f32; 3],
    /// Number of the lowest row.
    lowest: i32,
    sides: u32,
    sweeps: u32,
    /// Level of the field that it is, if any.
    level: Option<u32>,
}

/// Solution of a stage.
#[derive(Clone)]
struct Solution {
    stage: Stage,
    densities: wgpu::TextureView,
    optics: wgpu::TextureView,
    sun: wgpu::TextureView,
    sky: wgpu::TextureView,
    /// Radiance that enters at the sides.
    entering: wgpu::Buffer,
    /// Light that the sun loses, now and before.
    balance: wgpu::Buffer,
}

/// Buffers that the stages share while they are solved.
struct Scratch {
    moments: [wgpu::Buffer; 2],
    deposits: wgpu::Buffer,
    radiances: wgpu::Buffer,
}

impl Scratch {
    fn new(gpu: &Gpu, stages: &[Stage]) -> Self {
        let most = stages.iter().map(Stage::count).max().unwrap_or(1);
        Self {
            moments: ["moments", "moments"].map(|label| gpu.buffer(label, 32 * most)),
            deposits: gpu.buffer("deposits", 8 * most),
            radiances: gpu.buffer("radiances", 4 * DIRECTIONS * most),
        }
    }

    fn bindings(&self) -> Bindings {
        vec![
            ("moments_now", (&self.moments[0]).into()),
            ("moments_before", (&self.moments[1]).into()),
            ("deposits", (&self.deposits).into()),
            ("radiances", (&self.radiances).into()),
        ]
    }
}

impl Solution {
    /// Solution of a stage, not solved yet.
    fn new(gpu: &Gpu, stage: Stage) -> Self {
        let texture = |label| view(&gpu.texture_3d(label, stage.cells));
        let [densities, optics] = ["densities", "optics"].map(texture);
        let [sun, sky] = ["sun", "sky"].map(texture);
        let entering = gpu.buffer("entering", 4 * DIRECTIONS * stage.rim());
        let balance = gpu.buffer("balance", 16);
        Self { densities, optics, sun, sky, entering, balance, stage }
    }

    /// Bindings as the level that is solved.
    fn as_level(&self) -> Bindings {
        vec![
            ("level_optics", (&self.optics).into()),
            ("level_sun", (&self.sun).into()),
            ("level_sky", (&self.sky).into()),
            ("entering", (&self.entering).into()),
            ("balance", (&self.balance).into()),
        ]
    }

    /// Bindings as the level around it.
    fn as_coarser(&self) -> Bindings {
        vec![
            ("coarser_optics", (&self.optics).into()),
            ("coarser_sun", (&self.sun).into()),
            ("coarser_sky", (&self.sky).into()),
        ]
    }
}

impl Stage {
    fn count(&self) -> u64 {
        self.cells.iter().map(|n| u64::from(*n)).product()
    }

    /// Number of cells at one side across and one along.
    fn rim(&self) -> u64 {
        u64::from((self.cells[0] + self.cells[1]) * self.cells[2])
    }

    /// Whether the tilted directions cross a row in less than a cell.
    fn is_flat(&self) -> bool {
        TILT * self.cell[0].min(self.cell[1]) > self.cell[2]
    }

    /// Whether one workgroup makes all sweeps.
    fn is_small(&self) -> bool {
        let [x, y, z] = self.cells.map(u64::from);
        let rounds = (x * y * DIRECTIONS).div_ceil(FEW_GROUP) * (z + 1)
            + self.count().div_ceil(FEW_GROUP) * (DIRECTIONS + 1)
            + 1;
        self.is_flat() && self.count() <= FEW_CELLS && u64::from(self.sweeps) * rounds < FEW_ITERATIONS
    }
}

/// Stages of a field, from the coarsest.
fn stages(shape: &FieldShape, sides: u32, level_sweeps: [u32; 2]) -> Vec<Stage> {
    let last = shape.levels - 1;
    let outermost = Stage {
        cells: [shape.cells[0], shape.cells[1], shape.rows(last)],
        cell: shape.cell(last),
        lowest: shape.lowest(last),
        sides,
        sweeps: 0,
        level: Some(last),
    };
    // A cascade of coarser grids over the same box.
    let mut cascade = vec![outermost];
    for sweeps in CASCADE_SWEEPS {
        let last = cascade.len() - 1;
        cascade[last].sweeps = sweeps;
        let fine = &cascade[last];
        let halved = |n: u32, fewest: u32| if n >= 2 * fewest { n / 2 } else { n };
        let [x, y] = [fine.cells[0], fine.cells[1]].map(|n| halved(n, 4));
        let rows = if sides == SIDES_OPEN { halved(fine.cells[2], 16) } else { fine.cells[2] };
        let cells = [x, y, rows];
        if cells == fine.cells || cascade.len() == CASCADE_SWEEPS.len() {
            // Whatever its size, the coarsest grid finds the slowest modes.
            cascade[last].sweeps = CASCADE_SWEEPS[CASCADE_SWEEPS.len() - 1];
            break;
        }
        let cell = std::array::from_fn(|axis| fine.cell[axis] * fine.cells[axis] as f32 / cells[axis] as f32);
        cascade.push(Stage { cells, cell, level: None, ..fine.clone() });
    }
    cascade.reverse();
    for level in (0..last).rev() {
        let cells = [shape.cells[0], shape.cells[1], shape.rows(level)];
        let sweeps = level_sweeps[usize::from(level == 0)];
        let (cell, lowest) = (shape.cell(level), shape.lowest(level));
        cascade.push(Stage { cells, cell, lowest, sides: SIDES_COARSER, sweeps, level: Some(level) });
    }
    cascade
}

/// Weights of the steps of Chebyshev's iteration: factor on the change by a sweep, and on the step.
fn chebyshev(sweeps: u32) -> Vec<[f32; 2]> {
    let (mu, relaxation) = (SPECTRUM / (2.0 - SPECTRUM), 2.0 / (2.0 - SPECTRUM));
    let mut weight = 1.0;
    let steps = (0..sweeps).map(|k| {
        weight = match k {
            0 => 1.0,
            1 => 1.0 / (1.0 - 0.5 * mu * mu),
            _ => 1.0 / (1.0 - 0.25 * mu * mu * weight),
        };
        [relaxation as f32, weight as f32]
    });
    steps.collect()
}

/// Sky in which a field is solved.
struct Sun {
    /// Unit vector toward the sun in the axes of the field.
    toward: [f32; 3],
    is_up: bool,
    /// Half of the reciprocal of the planet's radius, 1/m; 0 in the straight box of a grid.
    bend: f32,
}

/// How a stage is solved.
struct Task<'a> {
    sun: &'a Sun,
    /// Level around it, and the position of the middle relative to the middle of that, m.
    coarser: Option<(&'a Solution, DVec2)>,
    /// Own field to begin with instead of that of the level around it: the displacement of the middle since, m, and the
    /// number of sweeps.
    moved: Option<(DVec2, u32)>,
    /// Whether the densities are baked.
    bakes: bool,
    /// Uniform blocks of a frame at the middle of the field.
    frame: &'a Bindings,
    scratch: &'a Scratch,
}

impl Task<'_> {
    /// Uniform block of a stage.
    fn level(&self, stage: &Stage) -> FieldLevel {
        level_block(stage, self.sun, self.coarser.map(|(coarser, offset)| (&coarser.stage, offset)))
    }

    /// Bindings of a dispatch for a level: those given take precedence.
    fn bindings(&self, solution: &Solution, level: &FieldLevel, given: Bindings) -> Bindings {
        // Without a level around it nothing of that is read.
        let none = || Solution { optics: solution.densities.clone(), ..solution.clone() }.as_coarser();
        let coarser = self.coarser.map_or_else(none, |(coarser, _)| coarser.as_coarser());
        let own = vec![("level", uniform(&[level]))];
        [own, given, self.scratch.bindings(), solution.as_level(), coarser, self.frame.clone()].concat()
    }
}

/// Solves a stage. Returns the buffer of fluence and flux.
fn solve<'a>(rec: &mut Recorder<'_>, solution: &Solution, task: &Task<'a>) -> &'a wgpu::Buffer {
    let Task { sun, scratch, .. } = *task;
    let stage = &solution.stage;
    let level = task.level(stage);
    let count = stage.count() as u32;
    let bindings = |level: &FieldLevel, given: Bindings| task.bindings(solution, level, given);
    let [x, y, z] = stage.cells;
    if task.bakes {
        let out = vec![("volume_out", (&solution.densities).into())];
        rec.dispatch(("light_field", "field_density"), bindings(&level, out), stage.cells);
    }
    let own: Bindings = vec![("level_optics", (&solution.densities).into()), ("volume_out", (&solution.optics).into())];
    rec.dispatch(("light_field", "field_depth"), bindings(&level, own), stage.cells);
    rec.dispatch(("light_field", "field_beam"), bindings(&level, vec![]), [count, 1, 1]);
    rec.dispatch(("light_field", "field_balance"), bindings(&level, vec![]), [256, 1, 1]);
    if stage.sides == SIDES_OPEN {
        let size = [stage.rim() as u32, DIRECTIONS as u32, 1];
        rec.dispatch(("light_field", "field_entering"), bindings(&level, vec![]), size);
    }
    // The field to begin with: that of the level around it, or its own.
    let (start, from) = match task.moved {
        Some((moved, _)) => {
            let own = FieldLevel { continues: u32::from(!task.bakes), ..level_block(stage, sun, Some((stage, moved))) };
            (own, solution.as_coarser())
        }
        None => (level.clone(), vec![]),
    };
    let few = stage.is_small();
    let words = |size| view(&rec.gpu.words_3d("sources", size));
    let sources = words(if few { [1; 3] } else { stage.cells });
    // Bound to the kernel that reads and writes the buffer instead.
    let unread = words([1; 3]);
    let few_sources = rec.gpu.buffer("few_sources", if few { 16 * u64::from(count) } else { 16 });
    let mut moments = scratch.moments.each_ref();
    let stepped = |moments: [&wgpu::Buffer; 2]| -> Bindings {
        vec![
            ("moments_now", moments[0].into()),
            ("moments_before", moments[1].into()),
            ("sources_out", (&sources).into()),
            ("few_sources", (&few_sources).into()),
        ]
    };
    let swept = || -> Bindings { vec![("sources", (&sources).into()), ("few_sources", (&few_sources).into())] };
    let outer = rec.specialize_with(&[("ALONE", f64::from(u8::from(few)))]);
    let begin = [from, stepped(moments)].concat();
    rec.dispatch(("light_field", "field_start"), bindings(&start, begin), [count, 1, 1]);
    let steps = match task.moved {
        Some((_, sweeps)) => vec![[1.0; 2]; sweeps as usize],
        None => chebyshev(stage.sweeps),
    };
    if few {
        let level = FieldLevel { relaxation: steps[0][0], sweeps: steps.len() as u32, ..level.clone() };
        let all = [vec![("sources", (&unread).into())], stepped(moments)].concat();
        rec.dispatch(("light_field", "field_sweep_few"), bindings(&level, all), [FEW_GROUP as u32, 1, 1]);
    } else {
        for [relaxation, weight] in steps {
            let down = if stage.is_flat() { DIRECTIONS as u32 } else { STEEP };
            rec.dispatch(("light_field", "field_sweep_down"), bindings(&level, swept()), [x, y, down]);
            if !stage.is_flat() {
                let size = [x.max(y), z, DIRECTIONS as u32 - STEEP];
                rec.dispatch(("light_field", "field_sweep_along"), bindings(&level, swept()), size);
            }
            let step = FieldLevel { relaxation, weight, ..level.clone() };
            rec.dispatch(("light_field", "field_gather"), bindings(&step, stepped(moments)), [count, 1, 1]);
            moments.reverse();
        }
    }
    rec.specialize(outer);
    let keep = vec![
        ("moments_now", moments[0].into()),
        ("sun_out", (&solution.sun).into()),
        ("sky_out", (&solution.sky).into()),
    ];
    rec.dispatch(("light_field", "field_keep"), bindings(&level, keep), stage.cells);
    moments[0]
}

/// Uniform block of a stage. `coarser` is the stage around it, with the position of the middle relative to that of it.
fn level_block(stage: &Stage, sun: &Sun, coarser: Option<(&Stage, DVec2)>) -> FieldLevel {
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
        let [x, y, _] = coarser.cell;
        level.coarser_offset = [offset.x as f32 / x, offset.y as f32 / y];
    }
    level
}

impl LightField {
    /// What a frame of an animation needs of the field. Sets the positions of its levels in the frame. `before` is the
    /// sky of the frame that it continues.
    pub fn follow(&self, frame: &mut Frame, before: Option<Now<'_>>, now: &Now<'_>) -> Due {
        let Some(shape) = frame.field else { return Due::Still };
        let made = self.animated.as_ref().filter(|(solved, token)| token.is_submitted() && solved.shape == shape);
        let (Some((solved, _)), Some(before)) = (made, before) else { return Due::Whole };
        let anchors = solved.levels.iter().map(|(anchor, _)| anchor);
        let due = field::due(anchors, &shape, now, before == *now);
        if let Due::Levels(levels) = &due {
            frame.set_field_levels(&shape, |level| levels[level].0.eye(now));
        }
        due
    }

    /// What an animation keeps besides the textures that are bound, by name, in bytes: its levels, and the buffers that
    /// they share.
    pub fn kept(&self) -> Vec<(&'static str, u64)> {
        let Some((Solved { levels, scratch, .. }, _)) = &self.animated else { return Vec::new() };
        let level = |(_, level): &(Anchor, Solution)| -> u64 {
            let Solution { densities, optics, sun, sky, entering, balance, .. } = level;
            let textures = [densities, optics, sun, sky].map(|texture| Binding::from(texture).bytes());
            textures.iter().sum::<u64>() + entering.size() + balance.size()
        };
        let shared = scratch.bindings().into_iter().map(|(_, binding)| binding.bytes()).sum();
        vec![("levels", levels.iter().map(level).sum()), ("scratch", shared)]
    }

    /// Textures of optics, of the sun's field and of the sky's field: of the last still, or of the animation.
    pub fn textures(&self, animated: bool) -> Option<&[wgpu::TextureView; 3]> {
        let animation = self.animated.as_ref().map(|(solved, _)| &solved.textures);
        let textures = if animated { animation } else { self.still.made() };
        textures.map(|textures| &textures.levels)
    }

    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, frame, eye, time, .. } = *inputs;
        if params.light.model != params::Model::Multiple {
            return Ok(());
        }
        let forward = self.forward.update(rec, params.light.clone(), |rec| {
            let [columns, rows] = FORWARD_SIZE.map(|n| n as u32);
            let texture = rec.gpu.flat("forward_table", [columns, rows], wgpu::TextureFormat::R32Float);
            rec.gpu.write_texture(&texture, &forward_table(&params.light));
            Ok(view(&texture))
        })?;
        // High clouds need no field.
        rec.bind([("forward_table", (&forward).into())]);
        let Some(shape) = frame.field else { return Ok(()) };
        let more_sweeps = self.more_sweeps;
        let textures = match &inputs.field {
            Due::Still => {
                let planet = (params.atmosphere.planet_radius, Grid(params.volume.clone()));
                let steps = field::origin(eye, params, time).steps;
                let lit = frame.sunlit(params);
                let key = (casters(params), params.light.clone(), planet, steps, shape, (lit, more_sweeps));
                self.still.update(rec, key, |rec| Ok(bake(rec, inputs, more_sweeps)?.textures))?
            }
            Due::Whole => {
                self.animated = None;
                let solved = bake(rec, inputs, more_sweeps)?;
                self.animated.insert((solved, rec.token())).0.textures.clone()
            }
            Due::Levels(anchors) => {
                let (mut solved, _) = self.animated.take().expect("was found when the frame was planned");
                // From the coarsest, whose light enters the others.
                for number in (0..anchors.len()).rev().filter(|number| anchors[*number].1.sweeps > 0) {
                    follow(rec, inputs, &mut solved, number, anchors)?;
                }
                self.animated.insert((solved, rec.token())).0.textures.clone()
            }
        };
        let names = ["field_optics", "field_sun", "field_sky"];
        rec.bind(names.into_iter().zip(textures.levels.iter().map(Binding::from)));
        rec.bind([("field_ground", (&textures.ground).into())]);
        Ok(())
    }
}

/// Frame at the middle of a level, and the sun there.
fn there(inputs: &Inputs<'_>, anchor: &Anchor) -> Result<(Frame, Sun)> {
    let Inputs { params, frame, .. } = *inputs;
    let centre = anchor.on_ground(params);
    let mut there = Frame::new(&Camera::equirect(centre)?, params, anchor.time, [1, 1]);
    let shape = frame.field.expect("the picture reads the field");
    there.set_field(centre, params, anchor.time, shape);
    there.dispatch = frame.dispatch.clone();
    let toward = there.in_field(glam::Vec3::from_array(there.sky.sun_direction)).to_array();
    let bend = if params.volume.is_some() { 0.0 } else { 0.5 / params.atmosphere.planet_radius };
    Ok((there, Sun { toward, is_up: frame.sunlit(params), bend }))
}

/// Solves all levels from nothing.
fn bake(rec: &mut Recorder<'_>, inputs: &Inputs<'_>, more_sweeps: u32) -> Result<Solved> {
    let Inputs { params, eye, time, .. } = *inputs;
    let anchor = Anchor::still(eye, params, time);
    let (there, sun) = there(inputs, &anchor)?;
    let shape = there.field.expect("was set");
    let bindings = there.bindings(rec.gpu).to_vec();
    let whole = [shape.cells[0], shape.cells[1], shape.rows_before(shape.levels)];
    let levels = ["field_optics", "field_sun", "field_sky"].map(|label| view(&rec.gpu.texture_3d(label, whole)));
    let ground = view(&rec.gpu.texture("field_ground", [shape.cells[0], shape.cells[1] * shape.levels, 1], 1));
    let textures = Textures { levels, ground };
    let sides = if params.volume.is_some() { SIDES_OPEN } else { SIDES_PERIODIC };
    let low = sun.is_up && sun.toward[2].abs() < LOW_SUN;
    let mut stages = stages(&shape, sides, if low { LOW_SUN_SWEEPS } else { LEVEL_SWEEPS });
    stages.iter_mut().for_each(|stage| stage.sweeps *= 1 + more_sweeps);
    let scratch = Scratch::new(rec.gpu, &stages);
    let mut levels: Vec<(Anchor, Solution)> = Vec::new();
    let mut coarser: Option<Solution> = None;
    for stage in stages {
        let solution = Solution::new(rec.gpu, stage);
        let around = coarser.as_ref().map(|coarser| (coarser, DVec2::ZERO));
        if let Some(around) = around.filter(|_| solution.stage.sides == SIDES_COARSER) {
            enter(rec, &solution, around, &sun, &scratch, &bindings);
        }
        let task = Task { sun: &sun, coarser: around, moved: None, bakes: true, frame: &bindings, scratch: &scratch };
        solve(rec, &solution, &task);
        store(rec, &solution, &task, &shape, &textures);
        if solution.stage.level.is_some() {
            levels.insert(0, (anchor.clone(), solution.clone()));
        }
        coarser = Some(solution);
    }
    Ok(Solved { shape, textures, levels, scratch })
}

/// Radiance of the level around that has just been solved, where it enters a level.
fn enter(
    rec: &mut Recorder<'_>,
    solution: &Solution,
    (coarser, offset): (&Solution, DVec2),
    sun: &Sun,
    scratch: &Scratch,
    frame: &Bindings,
) {
    let level = level_block(&solution.stage, sun, Some((&coarser.stage, offset)));
    let own = vec![("level", uniform(&[&level]))];
    let bindings = [own, scratch.bindings(), solution.as_level(), frame.clone()].concat();
    rec.dispatch(("light_field", "field_entering"), bindings, [solution.stage.rim() as u32, DIRECTIONS as u32, 1]);
}

/// Stores a level that has just been solved in the textures of all levels, and the light on the ground under it.
fn store(rec: &mut Recorder<'_>, solution: &Solution, task: &Task<'_>, shape: &FieldShape, textures: &Textures) {
    let Some(number) = solution.stage.level else { return };
    let level = task.level(&solution.stage);
    let size = solution.stage.cells;
    let [optics_out, sun_out, sky_out] = &textures.levels;
    let out: Bindings =
        vec![("volume_out", optics_out.into()), ("sun_out", sun_out.into()), ("sky_out", sky_out.into())];
    let bindings = |first_row: u32, out| task.bindings(solution, &FieldLevel { first_row, ..level.clone() }, out);
    rec.dispatch(("light_field", "field_store"), bindings(shape.rows_before(number), out), size);
    if solution.stage.sides != SIDES_OPEN {
        let map = vec![("map_out", (&textures.ground).into())];
        let extent = [size[0], size[1], 1];
        rec.dispatch(("light_field", "field_ground_bake"), bindings(number * shape.cells[1], map), extent);
    }
}

/// Solves a level of an animation anew, beginning with its own field.
fn follow(
    rec: &mut Recorder<'_>,
    inputs: &Inputs<'_>,
    solved: &mut Solved,
    number: usize,
    levels: &[(Anchor, Work)],
) -> Result<()> {
    let now = inputs.now();
    let anchor = levels[number].0.clone();
    let (there, sun) = there(inputs, &anchor)?;
    let frame = there.bindings(rec.gpu).to_vec();
    let eyes: Vec<_> = levels.iter().map(|(anchor, _)| anchor.eye(&now)).collect();
    let before = solved.levels[number].0.eye(&now);
    let (fine, coarse) = solved.levels.split_at(number + 1);
    let solution = &fine[number].1;
    let around = coarse.first().map(|(_, coarser)| (coarser, eyes[number + 1] - eyes[number]));
    let Work { sweeps, clouds: bakes } = levels[number].1;
    let moved = Some((before - eyes[number], sweeps));
    let task = Task { sun: &sun, coarser: around, moved, bakes, frame: &frame, scratch: &solved.scratch };
    solve(rec, solution, &task);
    store(rec, solution, &task, &solved.shape, &solved.textures);
    if let Some(finer) = number.checked_sub(1) {
        let offset = eyes[number] - eyes[finer];
        enter(rec, &fine[finer].1, (solution, offset), &sun, &solved.scratch, &frame);
    }
    solved.levels[number].0 = anchor;
    Ok(())
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
    /// Number of sweeps.
    pub sweeps: u32,
}

/// Solves the light field of given cells, from no light, for tests. Records readbacks of fluence and flux of the sun's
/// light and of the sky's (eight numbers per cell), and of scaled extinction and scaled sunlight (two).
pub(crate) fn solve_cells(rec: &mut Recorder<'_>, cells: &Cells<'_>, params: &params::Params) -> Result<()> {
    let mut frame = Frame::new(&Camera::equirect(DVec3::ZERO)?, params, 0.0, [1, 1]);
    frame.sky.extinction = 1.0;
    let bindings = frame.bindings(rec.gpu).to_vec();
    let sides = if cells.periodic { SIDES_PERIODIC } else { SIDES_OPEN };
    let stage = Stage { cells: cells.size, cell: cells.cell, lowest: 0, sides, sweeps: cells.sweeps, level: None };
    let scratch = Scratch::new(rec.gpu, std::slice::from_ref(&stage));
    let sun = Sun { toward: cells.sun, is_up: true, bend: 0.0 };
    let texel = |v: &f32| [half::f16::from_f32(*v), half::f16::ZERO, half::f16::ZERO, half::f16::ZERO];
    let solution = Solution::new(rec.gpu, stage);
    let densities = solution.densities.texture();
    rec.gpu.write_texture(densities, &cells.extinction.iter().map(texel).collect::<Vec<_>>());
    let (frame, scratch) = (&bindings, &scratch);
    let moments = solve(rec, &solution, &Task { sun: &sun, coarser: None, moved: None, bakes: false, frame, scratch });
    for buffer in [moments, &scratch.deposits, &solution.balance] {
        rec.download(buffer, 0, buffer.size());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels lie in the middle of coarser ones, and the cascade ends at the outermost.
    #[test]
    fn stages_go_from_the_coarsest_to_the_finest() {
        let shape = FieldShape { cells: [64, 64, 20], cell: [100.0; 3], base: 0.0, lowest: -2, levels: 5, halvings: 1 };
        let stages = stages(&shape, SIDES_PERIODIC, LEVEL_SWEEPS);
        let levels: Vec<_> = stages.iter().map(|stage| stage.level).collect();
        assert_eq!(levels, [None, None, None, None, Some(4), Some(3), Some(2), Some(1), Some(0)]);
        for stage in &stages {
            assert!((stage.cell[2] * stage.cells[2] as f32 - 2000.0).abs() < 1e-3, "{stage:?}");
        }
    }

    #[test]
    fn chebyshev_damps_the_slowest_mode() {
        // A mode of eigenvalue 0.9, started at an error of 1.
        let (mut now, mut before) = (1.0_f64, 1.0_f64);
        for [relaxation, weight] in chebyshev(12) {
            let stepped = now + f64::from(relaxation) * (0.9 * now - now);
            let next = before + f64::from(weight) * (stepped - before);
            (before, now) = (now, next);
        }
        assert!(now.abs() < 0.01, "{now}");
    }
}
