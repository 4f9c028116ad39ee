//! Light field: light in clouds of every order of scattering, solved on nested levels (passes/light_field).

use glam::DVec3;

use super::lut::{Inputs, Lut, view};
use super::volume::Grid;
use crate::camera::Camera;
use crate::clipmap::{Casters, casters};
use crate::error::Result;
use crate::field::{self, FieldShape};
use crate::frame::Frame;
use crate::gpu::{Binding, Bindings, Recorder};
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
/// Sweeps of the finer levels: of the others, and of the finest.
const LEVEL_SWEEPS: [u32; 2] = [4, 3];
/// Upper bound of the spectrum of a sweep that Chebyshev's iteration assumes. Eigenvalues are complex: 0.93 is the
/// limit of stability, and 0.97 diverges.
const SPECTRUM: f64 = 0.9;
/// Cells that a ray toward the sun crosses in a level before it reads the coarser one.
const SUN_CELLS: u32 = 12;
/// Largest number of cells that it crosses in a level without a coarser one.
const MOST_SUN_CELLS: f32 = 512.0;

/// Key of the field: shadow casters, light, planet and grid, snapped position and time, shape, whether the sun is up.
type Key = (Casters, params::Light, (f32, Grid), [i64; 3], FieldShape, bool);

/// Light field on the GPU.
#[derive(Default)]
pub(crate) struct LightField {
    lut: Lut<Key, Field>,
    forward: Lut<params::Light>,
}

/// Textures of optics, of the sun's field and of the sky's field, and the light on the ground.
type Field = ([wgpu::TextureView; 3], wgpu::TextureView);

/// Grid of cells that is solved, and how its solution is obtained.
#[derive(Clone, Debug)]
struct Stage {
    cells: [u32; 3],
    cell: [f32; 3],
    sides: u32,
    sweeps: u32,
    /// Level of the field that it is, if any.
    level: Option<u32>,
}

/// Solution of a stage.
struct Solution {
    stage: Stage,
    optics: wgpu::TextureView,
    moments: wgpu::Buffer,
    radiances: wgpu::Buffer,
    deposits: wgpu::Buffer,
    balance: wgpu::Buffer,
}

impl Stage {
    fn count(&self) -> u64 {
        self.cells.iter().map(|n| u64::from(*n)).product()
    }
}

/// Stages of a field, from the coarsest.
fn stages(shape: &FieldShape, sides: u32) -> Vec<Stage> {
    let last = shape.levels - 1;
    let outermost = Stage {
        cells: [shape.cells[0], shape.cells[1], shape.rows(last)],
        cell: shape.cell(last),
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
        let sweeps = LEVEL_SWEEPS[usize::from(level == 0)];
        cascade.push(Stage { cells, cell: shape.cell(level), sides: SIDES_COARSER, sweeps, level: Some(level) });
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

/// Densities of a stage.
enum Densities {
    /// Baked from the clouds.
    Baked,
    /// Given as a texture.
    Given(wgpu::TextureView),
}

/// Solves a stage.
fn solve(
    rec: &mut Recorder<'_>,
    stage: Stage,
    sky_of: &Sun,
    coarser: Option<&Solution>,
    frame: &Bindings,
    densities: Densities,
) -> Solution {
    let count = stage.count();
    let optics = view(&rec.gpu.texture_3d("optics", stage.cells));
    let [mut now, mut before] = ["moments", "moments"].map(|label| rec.gpu.buffer(label, 32 * count));
    let [sun, sky] = ["sun_sources", "sky_sources"].map(|label| view(&rec.gpu.texture_3d(label, stage.cells)));
    let deposits = rec.gpu.buffer("deposits", 8 * count);
    let radiances = rec.gpu.buffer("radiances", 4 * DIRECTIONS * count);
    let rim = u64::from((stage.cells[0] + stage.cells[1]) * stage.cells[2]);
    let entering = rec.gpu.buffer("entering", 4 * DIRECTIONS * rim);
    let balance = rec.gpu.buffer("balance", 16);
    let level = level_block(&stage, sky_of, coarser.map(|coarser| &coarser.stage));
    let fallback = now.clone();
    let bindings = |level: &FieldLevel, more: Bindings| -> Bindings {
        let mut bindings = more;
        bindings.extend([
            ("level", uniform(&[level])),
            ("deposits", (&deposits).into()),
            ("radiances", (&radiances).into()),
            ("entering", (&entering).into()),
            ("balance", (&balance).into()),
        ]);
        if let Some(coarser) = coarser {
            bindings.push(("coarser_moments", (&coarser.moments).into()));
            bindings.push(("coarser_radiances", (&coarser.radiances).into()));
            bindings.push(("coarser_optics", (&coarser.optics).into()));
        } else {
            // Not read without a coarser level.
            bindings.push(("coarser_moments", (&fallback).into()));
            bindings.push(("coarser_radiances", (&entering).into()));
        }
        bindings.extend(frame.iter().cloned());
        bindings
    };
    let [x, y, z] = stage.cells;
    let densities = match densities {
        Densities::Given(densities) => densities,
        Densities::Baked => {
            let densities = view(&rec.gpu.texture_3d("densities", stage.cells));
            let out = vec![("volume_out", (&densities).into())];
            rec.dispatch(("light_field", "field_density"), bindings(&level, out), stage.cells);
            densities
        }
    };
    let own: Bindings = vec![("level_optics", (&densities).into()), ("volume_out", (&optics).into())];
    rec.dispatch(("light_field", "field_depth"), bindings(&level, own), stage.cells);
    let optics_in = || vec![("level_optics", Binding::from(&optics))];
    rec.dispatch(("light_field", "field_beam"), bindings(&level, optics_in()), [count as u32, 1, 1]);
    rec.dispatch(("light_field", "field_balance"), bindings(&level, optics_in()), [256, 1, 1]);
    rec.dispatch(("light_field", "field_entering"), bindings(&level, vec![]), [rim as u32, DIRECTIONS as u32, 1]);
    let moments = |now: &wgpu::Buffer, before: &wgpu::Buffer| -> Bindings {
        let sources = [("sun_out", (&sun).into()), ("sky_out", (&sky).into())];
        [vec![("moments_now", now.into()), ("moments_before", before.into())], sources.to_vec()].concat()
    };
    let sources = || -> Bindings {
        let optics = ("level_optics", (&optics).into());
        vec![("sun_sources", (&sun).into()), ("sky_sources", (&sky).into()), optics]
    };
    rec.dispatch(("light_field", "field_start"), bindings(&level, moments(&now, &before)), [count as u32, 1, 1]);
    for [relaxation, weight] in chebyshev(stage.sweeps) {
        let down = if level.tilt_crosses > 0 { DIRECTIONS as u32 } else { STEEP };
        rec.dispatch(("light_field", "field_sweep_down"), bindings(&level, sources()), [x, y, down]);
        if level.tilt_crosses == 0 {
            let size = [x.max(y), z, DIRECTIONS as u32 - STEEP];
            rec.dispatch(("light_field", "field_sweep_along"), bindings(&level, sources()), size);
        }
        let step = FieldLevel { relaxation, weight, ..level.clone() };
        rec.dispatch(("light_field", "field_gather"), bindings(&step, moments(&now, &before)), [count as u32, 1, 1]);
        std::mem::swap(&mut now, &mut before);
    }
    Solution { stage, optics, moments: now, radiances, deposits, balance }
}

/// Uniform block of a stage.
fn level_block(stage: &Stage, sun: &Sun, coarser: Option<&Stage>) -> FieldLevel {
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
        sides: stage.sides,
        cell: stage.cell,
        sun: sun.toward,
        sunlit: sun.is_up.into(),
        bend: sun.bend,
        sun_steps,
        tilt_crosses: (TILT * stage.cell[0].min(stage.cell[1]) > stage.cell[2]).into(),
        ..FieldLevel::default()
    };
    if let Some(coarser) = coarser {
        [level.coarser_across, level.coarser_along, level.coarser_rows] = coarser.cells;
        level.coarser_scale = std::array::from_fn(|axis| stage.cell[axis] / coarser.cell[axis]);
    }
    level
}

impl LightField {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, quality, frame, eye, time, .. } = *inputs;
        if !field::is_read(params) {
            return Ok(());
        }
        let forward = self.forward.update(rec, params.light.clone(), |rec| {
            let [columns, rows] = FORWARD_SIZE.map(|n| n as u32);
            let texture = rec.gpu.flat("forward_table", [columns, rows], wgpu::TextureFormat::R32Float);
            rec.gpu.write_texture(&texture, &forward_table(&params.light));
            Ok(view(&texture))
        })?;
        let shape = FieldShape::new(params, quality, frame.view.altitude);
        let lit = frame.sunlit(params);
        let planet = (params.atmosphere.planet_radius, Grid(params.volume.clone()));
        let key = (casters(params), params.light.clone(), planet, field::origin(eye, params, time).steps, shape, lit);
        let (textures, ground) = self.lut.update(rec, key, |rec| bake(rec, inputs, &shape, lit))?;
        let names = ["field_optics", "field_sun", "field_sky"];
        rec.bind(names.into_iter().zip(textures.iter().map(Binding::from)));
        rec.bind([("forward_table", (&forward).into()), ("field_ground", (&ground).into())]);
        Ok(())
    }
}

/// Solves all levels, and stores them in one stack of textures: optics, sun's field, sky's field.
fn bake(rec: &mut Recorder<'_>, inputs: &Inputs<'_>, shape: &FieldShape, lit: bool) -> Result<Field> {
    let Inputs { params, eye, time, frame, .. } = *inputs;
    let origin = field::origin(eye, params, time);
    let centre: DVec3 = origin.place.extend(0.0);
    let mut there = Frame::new(&Camera::equirect(centre)?, params, origin.time, [1, 1]);
    there.set_field(centre, params, origin.time, inputs.quality);
    let toward = there.in_field(glam::Vec3::from_array(there.sky.sun_direction)).to_array();
    let bend = if params.volume.is_some() { 0.0 } else { 0.5 / params.atmosphere.planet_radius };
    let sun = Sun { toward, is_up: lit, bend };
    there.dispatch = frame.dispatch.clone();
    let bindings = there.bindings(rec.gpu).to_vec();
    let whole = [shape.cells[0], shape.cells[1], shape.rows_before(shape.levels)];
    let stacks = ["field_optics", "field_sun", "field_sky"].map(|label| view(&rec.gpu.texture_3d(label, whole)));
    let ground = view(&rec.gpu.texture("field_ground", [shape.cells[0], shape.cells[1] * shape.levels, 1], 1));
    let sides = if params.volume.is_some() { SIDES_OPEN } else { SIDES_PERIODIC };
    let mut coarser: Option<Solution> = None;
    for stage in stages(shape, sides) {
        let size = stage.cells;
        let solved = solve(rec, stage, &sun, coarser.as_ref(), &bindings, Densities::Baked);
        if let Some(number) = solved.stage.level {
            let mut level = level_block(&solved.stage, &sun, coarser.as_ref().map(|coarser| &coarser.stage));
            level.first_row = shape.rows_before(number);
            let other = coarser.as_ref().unwrap_or(&solved);
            let [optics_out, sun_out, sky_out] = &stacks;
            let own: Bindings = vec![
                ("level", uniform(&[&level])),
                ("level_optics", (&solved.optics).into()),
                ("moments_now", (&solved.moments).into()),
                ("coarser_optics", (&other.optics).into()),
                ("coarser_moments", (&other.moments).into()),
                ("volume_out", optics_out.into()),
                ("sun_out", sun_out.into()),
                ("sky_out", sky_out.into()),
            ];
            if sides == SIDES_PERIODIC {
                let rows = FieldLevel { first_row: number * shape.cells[1], ..level.clone() };
                let more = vec![
                    ("level", uniform(&[&rows])),
                    ("radiances", (&solved.radiances).into()),
                    ("map_out", (&ground).into()),
                ];
                let bindings = [more, own.clone(), bindings.clone()].concat();
                rec.dispatch(("light_field", "field_ground_bake"), bindings, [size[0], size[1], 1]);
            }
            rec.dispatch(("light_field", "field_store"), [own, bindings.clone()].concat(), solved.stage.cells);
        }
        coarser = Some(solved);
    }
    Ok((stacks, ground))
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
    let stage = Stage { cells: cells.size, cell: cells.cell, sides, sweeps: cells.sweeps, level: None };
    let sun = Sun { toward: cells.sun, is_up: true, bend: 0.0 };
    let densities = rec.gpu.texture_3d("densities", cells.size);
    let texel = |v: &f32| [half::f16::from_f32(*v), half::f16::ZERO, half::f16::ZERO, half::f16::ZERO];
    rec.gpu.write_texture(&densities, &cells.extinction.iter().map(texel).collect::<Vec<_>>());
    let solved = solve(rec, stage, &sun, None, &bindings, Densities::Given(view(&densities)));
    rec.download(&solved.moments, 0, solved.moments.size());
    rec.download(&solved.deposits, 0, solved.deposits.size());
    rec.download(&solved.balance, 0, solved.balance.size());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels lie in the middle of coarser ones, and the cascade ends at the outermost.
    #[test]
    fn stages_go_from_the_coarsest_to_the_finest() {
        let shape = FieldShape { cells: [64, 64, 20], cell: [100.0, 100.0, 100.0], base: 0.0, levels: 5, halvings: 1 };
        let stages = stages(&shape, SIDES_PERIODIC);
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
