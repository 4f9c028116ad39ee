//! Light field: light in clouds of every order of scattering, solved on nested levels (passes/light_field).

use glam::DVec2;

use super::light_solver::{DIRECTIONS, SIDES_OPEN, Scratch, Solution, Stage, Sun, Task, level_block};
use super::lut::{Inputs, Lut, view};
use super::volume::Grid;
use crate::camera::Camera;
use crate::clipmap::{Casters, casters};
use crate::error::Result;
use crate::field::{self, Anchor, Due, FieldShape, Now, Work};
use crate::frame::Frame;
use crate::gpu::{Binding, Bindings, Recorder, Token};
use crate::params;
use crate::scattering::{FORWARD_SIZE, forward_table};
use crate::uniforms::{FieldLevel, uniform};

/// Cycles of multigrid: of a user's grid and of the outermost level, which begin without light, and of the other levels,
/// which begin with that of the level around them.
const GRID_CYCLES: u32 = 6;
const OUTERMOST_CYCLES: u32 = 2;
const LEVEL_CYCLES: u32 = 1;
/// Sine of the sun's elevation, 15 degrees, below which there is one more: light comes from afar. At 5 degrees the finest
/// level of a storm is 18 % from its converged solution after one cycle, and 3 % after two.
const LOW_SUN: f32 = 0.2588;

/// Key of the field of a still: shadow casters, light, planet and grid, snapped position and time, shape, whether the
/// sun is up and the cycles.
type Key = (Casters, params::Light, (f32, Grid), [i64; 3], FieldShape, (bool, u32));

/// Light field on the GPU.
#[derive(Default)]
pub(crate) struct LightField {
    still: Lut<Key, Textures>,
    animated: Option<(Solved, Token)>,
    forward: Lut<params::Light>,
    /// Number of cycles of each level besides the planned ones.
    pub more_cycles: u32,
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
            let Solution { densities, optics, sun, sky, entering, .. } = level;
            let textures = [densities, optics, sun, sky].map(|texture| Binding::from(texture).bytes());
            textures.iter().sum::<u64>() + entering.size()
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
        let more_cycles = self.more_cycles;
        let textures = match &inputs.field {
            Due::Still => {
                let planet = (params.atmosphere.planet_radius, Grid(params.volume.clone()));
                let steps = field::origin(eye, params, time).steps;
                let lit = frame.sunlit(params);
                let key = (casters(params), params.light.clone(), planet, steps, shape, (lit, more_cycles));
                self.still.update(rec, key, |rec| Ok(bake(rec, inputs, more_cycles)?.textures))?
            }
            Due::Whole => {
                self.animated = None;
                let solved = bake(rec, inputs, more_cycles)?;
                self.animated.insert((solved, rec.token())).0.textures.clone()
            }
            Due::Levels(anchors) => {
                let (mut solved, _) = self.animated.take().expect("was found when the frame was planned");
                // From the coarsest, whose light enters the others.
                for number in (0..anchors.len()).rev().filter(|number| anchors[*number].1.cycles > 0) {
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
fn bake(rec: &mut Recorder<'_>, inputs: &Inputs<'_>, more_cycles: u32) -> Result<Solved> {
    let Inputs { params, eye, time, .. } = *inputs;
    let anchor = Anchor::still(eye, params, time);
    let (there, sun) = there(inputs, &anchor)?;
    let shape = there.field.expect("was set");
    let bindings = there.bindings(rec.gpu).to_vec();
    let whole = [shape.cells[0], shape.cells[1], shape.rows_before(shape.levels)];
    let levels = ["field_optics", "field_sun", "field_sky"].map(|label| view(&rec.gpu.texture_3d(label, whole)));
    let ground = view(&rec.gpu.texture("field_ground", [shape.cells[0], shape.cells[1] * shape.levels, 1], 1));
    let textures = Textures { levels, ground };
    let stages = Stage::of_levels(&shape, params.volume.is_some());
    let scratch = Scratch::new(rec.gpu, &stages);
    let low_sun = u32::from(sun.is_up && sun.toward[2].abs() < LOW_SUN);
    // From the finest.
    let mut levels: Vec<(Anchor, Solution)> = Vec::new();
    for (stage, number) in stages.into_iter().zip((0..shape.levels).rev()) {
        let solution = Solution::new(rec.gpu, stage);
        let coarser = levels.first().map(|(_, coarser)| (coarser, DVec2::ZERO));
        if let Some(around) = coarser {
            enter(rec, &solution, around, &sun, &scratch, &bindings);
        }
        let planned = match coarser {
            _ if params.volume.is_some() => GRID_CYCLES,
            Some(_) => LEVEL_CYCLES,
            None => OUTERMOST_CYCLES,
        };
        let cycles = planned + low_sun + more_cycles;
        let (frame, scratch) = (&bindings, &scratch);
        let task = Task { solution: &solution, sun: &sun, coarser, moved: None, cycles, bakes: true, frame, scratch };
        task.solve(rec);
        store(rec, &task, number, &shape, &textures);
        levels.insert(0, (anchor.clone(), solution));
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
fn store(rec: &mut Recorder<'_>, task: &Task<'_>, number: u32, shape: &FieldShape, textures: &Textures) {
    let level = task.level();
    let Stage { cells: size, sides, .. } = task.solution.stage;
    let [optics_out, sun_out, sky_out] = &textures.levels;
    let out: Bindings =
        vec![("volume_out", optics_out.into()), ("sun_out", sun_out.into()), ("sky_out", sky_out.into())];
    let bindings = |first_row: u32, out| task.bindings(&FieldLevel { first_row, ..level.clone() }, out);
    rec.dispatch(("light_field", "field_store"), bindings(shape.rows_before(number), out), size);
    if sides != SIDES_OPEN {
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
    let Work { cycles, clouds: bakes } = levels[number].1;
    let moved = Some(before - eyes[number]);
    let (frame, scratch) = (&frame, &solved.scratch);
    let task = Task { solution, sun: &sun, coarser: around, moved, cycles, bakes, frame, scratch };
    task.solve(rec);
    store(rec, &task, number as u32, &solved.shape, &solved.textures);
    if let Some(finer) = number.checked_sub(1) {
        let offset = eyes[number] - eyes[finer];
        enter(rec, &fine[finer].1, (solution, offset), &sun, scratch, frame);
    }
    solved.levels[number].0 = anchor;
    Ok(())
}
