//! Queries that need no picture: density, transmittance, optical depth, shadow map, weather map, and probes of shaders.

use std::sync::Arc;

use glam::DVec3;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::field::{Due, FieldShape};
use crate::frame::Frame;
use crate::gpu::Linked;
use crate::gpu::{Download, Recorder, Which, texture_rows};
use crate::gpu::{Interrupt, Timings, check_fork};
use crate::gpu::{Program, Specialization};
use crate::luts::light_solver::{Cells, solve_cells};
use crate::luts::lut::params_block;
use crate::luts::{Inputs, shadow};
use crate::params::{Model, Params};
use crate::passes::points;
use crate::renderer::Renderer;
use crate::schema::Typed as _;
use crate::shot::Shot;
use crate::specialization;

/// Maximum number of texels along a side of the user's shadow map.
const MAX_SHADOW_SIZE: u32 = 8192;

impl Renderer {
    /// Extinction in 1/m at world points in m: the field that [`Renderer::render`] marches.
    pub fn density(
        &mut self,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        self.query_points("extinction_at_points", at, params, time, interrupt)
    }

    /// Transmittance of the clouds toward the sun at world points in m; 0 where the ground hides the sun.
    pub fn sun_transmittance(
        &mut self,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        self.query_points("sun_transmittance_at_points", at, params, time, interrupt)
    }

    /// Optical depth of all clouds along rays from an eye; -1 where the ground is hit.
    pub fn depth_along(
        &mut self,
        eye: DVec3,
        directions: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        check_fork()?;
        let camera = Camera::equirect(eye)?;
        let points: Vec<_> =
            directions.iter().map(|d| DVec3::from_array(*d).as_vec3().normalize().extend(0.0).to_array()).collect();
        let kernel = Which::Named(("points", "depth_along_directions"), self.points_specialization(params));
        let answers = self.run_points(&kernel, &Shot::new(&camera, params, time), &points, points::CHUNK, interrupt)?;
        Ok(answers.iter().map(|answer| answer[0]).collect())
    }

    fn query_points(
        &mut self,
        entry: &'static str,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        check_fork()?;
        let Some(first) = at.first() else { return Ok(Vec::new()) };
        // Positions on the GPU are relative to the first point: f32 keeps millimetres within a few kilometres of it.
        let eye = DVec3::from_array(*first);
        let camera = Camera::equirect(eye)?;
        let offset = |p: &[f64; 3]| (DVec3::from_array(*p) - eye).as_vec3().extend(0.0).to_array();
        let points: Vec<_> = at.iter().map(offset).collect();
        let kernel = Which::Named(("points", entry), self.points_specialization(params));
        let answers = self.run_points(&kernel, &Shot::new(&camera, params, time), &points, points::CHUNK, interrupt)?;
        Ok(answers.iter().map(|answer| answer[0]).collect())
    }

    fn points_specialization(&self, params: &Params) -> Arc<Specialization> {
        specialization::of_points(params, &self.quality)
    }

    /// Transmittance of the clouds toward the sun on a horizontal square around `center` (east, north and altitude, m).
    /// `extent` is the side of the square in m. The map has `size` by `size` values, row 0 in the north.
    ///
    /// Returns [`Error::Parameter`] for a value out of range.
    pub fn shadow_map(
        &mut self,
        params: &Params,
        time: f64,
        center: [f64; 3],
        (extent, size): (f64, u32),
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        if !(1..=MAX_SHADOW_SIZE).contains(&size) {
            return Err(Error::parameter("size", size, format!("a whole number from 1 to {MAX_SHADOW_SIZE}")));
        }
        // The negation rejects NaN.
        if !(1.0..=1e7).contains(&extent) {
            return Err(Error::parameter("extent", extent, "from 1 to 10000000 m"));
        }
        let [x, y, altitude] = center;
        if !(-1e5..=1e5).contains(&altitude) {
            return Err(Error::parameter("altitude", altitude, "from -100000 to 100000 m"));
        }
        if let Some(place) = [x, y].into_iter().find(|v| !(-1e8..=1e8).contains(v)) {
            return Err(Error::parameter("center", place, "2 numbers from -100000000 to 100000000 m"));
        }
        let camera = Camera::equirect(DVec3::from_array(center))?;
        let map_buffer = self.gpu.buffer("shadow_out", 4 * u64::from(size) * u64::from(size));
        let (mut rec, mut frame) = self.record(&Shot::new(&camera, params, time), false, interrupt)?;
        [frame.view.width, frame.view.height] = [size; 2];
        [frame.dispatch.march_width, frame.dispatch.strip_rows] = [size; 2];
        frame.sky.shadow_texel = (extent / f64::from(size)) as f32;
        shadow::map(&mut rec, &frame, size, &map_buffer);
        rec.download(&map_buffer, 0, map_buffer.size());
        let map = rec.submit()?;
        Ok(map[0].numbers()[..(size * size) as usize].to_vec())
    }

    /// Weather map that the march reads, baked, user-supplied or mixed: width and height in texels, and coverage, type
    /// and precipitation of each texel, row 0 in the north.
    pub fn weather_map(&mut self, params: &Params, interrupt: Interrupt<'_>) -> Result<([u32; 2], Vec<f32>)> {
        let camera = Camera::equirect(DVec3::ZERO)?;
        let (frame, params) = Shot::new(&camera, params, 0.0).checked(self.size, &self.quality)?;
        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        let texture = self.luts.weather_map(&mut rec, &params, &frame)?;
        rec.download_texture(&texture);
        let downloads = rec.submit()?;
        let (width, height) = (texture.width() as usize, texture.height() as usize);
        let halves: &[half::f16] = downloads[0].numbers();
        // Rows are padded.
        let rows = halves.chunks_exact(halves.len() / height).map(|row| &row[..4 * width]);
        let texels = rows.flat_map(|row| row.chunks_exact(4));
        let numbers = texels.flat_map(|texel| [texel[0], texel[1], texel[2]]).map(half::f16::to_f32);
        Ok(([texture.width(), texture.height()], numbers.collect()))
    }

    /// Value of a WGSL `expression` of `x: vec4f` for each input, with the modules of `imports` in scope and the camera
    /// at `eye` at `time` in s. Tests call single shader functions with it.
    ///
    /// Returns [`Error::Parameter`] for a module that does not exist and [`Error::Device`] for an invalid expression.
    pub fn probe(
        &mut self,
        imports: &[String],
        expression: &str,
        inputs: &[[f32; 4]],
        params: &Params,
        (eye, time): (DVec3, f64),
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<[f32; 4]>> {
        check_fork()?;
        let imports: String = imports.iter().map(|name| format!("#import {name}\n")).collect();
        let source = format!(
            "#import bindings\n{imports}@compute @workgroup_size(64)\n\
             fn probe(@builtin(global_invocation_id) id: vec3u) {{\n\
             if id.x >= arrayLength(&points) {{ return; }}\nlet x = points[id.x];\n\
             results[id.x] = vec4f({expression});\n}}\n"
        );
        let specialization = self.points_specialization(params);
        let linked = Linked::from_source(&source, &specialization.imports, self.gpu.generated)
            .map_err(|error| Error::parameter("imports", error, "shader names"))?;
        let kernel = Program::from_linked(&self.gpu, &linked)?.compile(&self.gpu, "probe", &specialization)?;
        let camera = Camera::equirect(eye)?;
        // A single dispatch, so that timed probes fill the device.
        let kernel = Which::Made(Arc::new(kernel));
        self.run_points(&kernel, &Shot::new(&camera, params, time), inputs, 1 << 20, interrupt)
    }

    /// Light field of given cells, solved from no light by a number of cycles, with the phase function and the albedo of
    /// `params`: fluence and flux of the sun's light and of the sky's, eight numbers per cell; scaled extinction in 1/m
    /// and scaled sunlight, two per cell; factor on the scaled sunlight. Tests call it.
    pub fn solve_light(
        &mut self,
        cells: &Cells<'_>,
        params: &Params,
        interrupt: Interrupt<'_>,
    ) -> Result<(Vec<f32>, Vec<f32>, f32)> {
        check_fork()?;
        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        rec.bind([("params", params_block(params, &self.quality))]);
        rec.specialize(specialization::of_points(params, &self.quality));
        solve_cells(&mut rec, cells, params)?;
        let downloads = rec.submit()?;
        let [moments, deposits, balance] = [0, 1, 2].map(|i| downloads[i].numbers::<f32>().to_vec());
        Ok((moments, deposits, balance[0]))
    }

    /// Textures of the light field of a shot, solved by `more` cycles besides the planned ones, or of the last frame of an
    /// animation: optics, fluence and flux of the sun's light and of the sky's, four half floats per cell, x first, the
    /// rows of the finest level first; and the number of texels along each axis. Tests call it.
    pub fn light_field(
        &mut self,
        shot: &Shot<'_>,
        more: u32,
        animated: bool,
        interrupt: Interrupt<'_>,
    ) -> Result<([u32; 3], Vec<Vec<f32>>)> {
        check_fork()?;
        if !animated {
            self.luts.light_field.more_cycles = more;
            let recorded = self.record(shot, true, interrupt).and_then(|(rec, _)| rec.submit());
            self.luts.light_field.more_cycles = 0;
            recorded?;
        }
        let Some(textures) = self.luts.light_field.textures(animated) else { return Ok(([0; 3], Vec::new())) };
        let textures: Vec<_> = textures.iter().map(|view| view.texture().clone()).collect();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        textures.iter().for_each(|texture| rec.download_texture(texture));
        let downloads = rec.submit()?;
        let half = |bytes: &[u8]| half::f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
        let numbers = |(texture, download): (&wgpu::Texture, &Download)| {
            texture_rows(texture, download.numbers()).flat_map(|row| row.chunks_exact(2)).map(half).collect()
        };
        let size = textures[0].size();
        let size = [size.width, size.height, size.depth_or_array_layers];
        Ok((size, textures.iter().zip(&downloads).map(numbers).collect()))
    }

    /// Irradiance at world points in m on planes with a normal, by the light field: eight numbers per point, those of the
    /// sun's light that comes straight from it (three), those of all other light (three), and two without meaning.
    ///
    /// Returns [`Error::Parameter`] for a light model without a light field.
    pub fn irradiance(
        &mut self,
        at: &[[f64; 3]],
        normal: [f64; 3],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<[[f32; 4]; 2]>> {
        check_fork()?;
        if params.light.model != Model::Multiple {
            let allowed = "'multiple', whose light field has the irradiance";
            return Err(Error::parameter("light.model", params.light.model.to_value(), allowed));
        }
        let Some(first) = at.first() else { return Ok(Vec::new()) };
        let eye = DVec3::from_array(*first);
        let camera = Camera::equirect(eye)?;
        let normal = DVec3::from_array(normal).normalize().as_vec3().extend(0.0).to_array();
        let offset = |p: &[f64; 3]| (DVec3::from_array(*p) - eye).as_vec3().extend(0.0).to_array();
        let points: Vec<_> = at.iter().flat_map(|p| [offset(p), normal]).collect();
        let kernel = Which::Named(("irradiance", "irradiance_at_points"), self.points_specialization(params));
        let answers = self.run_points(&kernel, &Shot::new(&camera, params, time), &points, points::CHUNK, interrupt)?;
        Ok(answers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
    }

    fn run_points(
        &mut self,
        kernel: &Which,
        shot: &Shot<'_>,
        points: &[[f32; 4]],
        most: usize,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<[f32; 4]>> {
        let read = match kernel {
            Which::Named(name, specialization) => self.gpu.kernel(*name, specialization)?,
            Which::Made(kernel) => kernel.clone(),
        };
        let (mut rec, frame) = self.record(shot, read.reads("field_"), interrupt)?;
        points::run(&mut rec, &frame, kernel, points, most)
    }

    /// Recording with the LUTs of a sky bound, the light field among them if it is read, and its frame.
    fn record<'a>(
        &'a mut self,
        shot: &Shot<'_>,
        reads_field: bool,
        interrupt: Interrupt<'a>,
    ) -> Result<(Recorder<'a>, Frame)> {
        let (mut frame, params) = shot.checked(self.size, &self.quality)?;
        frame.light_shafts = false;
        // Answers do not depend on the size of pictures.
        match FieldShape::new(&params, &self.quality, frame.view.altitude, u64::MAX).filter(|_| reads_field) {
            Some(shape) => frame.set_field(shot.camera.eye, &params, shot.time, shape),
            None => frame.field = None,
        }
        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        let specialization = specialization::of_picture(&params, &self.quality, &frame, false);
        let (quality, eye, time) = (&self.quality, shot.camera.eye, shot.time);
        let inputs = Inputs { params: &params, quality, frame: &frame, eye, time, specialization, field: Due::Still };
        self.luts.update(&mut rec, &inputs)?;
        self.lut_memory = rec.held();
        Ok((rec, frame))
    }
}
