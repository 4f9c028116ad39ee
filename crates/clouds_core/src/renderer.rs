//! Renderer: one frame from shot to picture, and the state that is kept between frames.

use std::mem;
use std::sync::{Arc, LazyLock};
use std::thread;

use crate::blue_noise;
use crate::error::{Error, Result};
use crate::field::{Due, Now};
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::gpu::{Gpu, Interrupt, Timings, check_fork};
use crate::grid;
use crate::history::{Accumulator, Past, upload_scenes};
use crate::luts::Luts;
use crate::params::{Integrator, Quality};
use crate::passes::display::{self, Screen};
use crate::passes::{composite, march, path, reference, reproject};
use crate::picture::{Picture, download};
use crate::plan::{Plan, Target};
use crate::scene_depth::SceneTextures;
use crate::shot::{Shot, check_size};
use crate::targets::{Targets, count};
use crate::wind::Going;

/// History length of a pixel that has been sampled directly ([`Renderer::history_length`]): the number of frames in
/// which an animation marches every pixel once.
pub const CYCLE: u32 = grid::CYCLE;

/// Renderer of pictures of one size and quality on one device.
pub struct Renderer {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) size: [u32; 2],
    pub(crate) quality: Quality,
    pub(crate) luts: Luts,
    scene_depth: Option<SceneTextures>,
    still: Option<Targets>,
    animation: Option<Targets>,
    past: Option<Past>,
    winds: Going,
    accumulator: Option<Accumulator>,
    /// Renderer of moonlight, which has a history of its own (lights.rs).
    pub(crate) moonlit: Option<Box<Self>>,
    /// Names of the LUTs bound last, and their sizes in bytes.
    pub(crate) lut_memory: Vec<(&'static str, u64)>,
    /// GPU time of each kernel in ms, for the last picture or query.
    pub timings: Timings,
}

impl Renderer {
    /// Renderer of pictures of `width` x `height` pixels. `adapter` is as in [`Gpu::open`]; None selects the best one.
    ///
    /// Returns [`Error::Parameter`] for a value out of range, [`Error::Adapter`] if no adapter matches, and
    /// [`Error::Fork`] in a forked child.
    pub fn new(width: u32, height: u32, quality: Quality, adapter: Option<&str>) -> Result<Self> {
        quality.check()?;
        check_size([width, height])?;
        // Blue noise and device take about 20 ms each in the first renderer of a process, and are prepared in parallel.
        let gpu = thread::scope(|scope| {
            scope.spawn(|| LazyLock::force(&blue_noise::TILE));
            Gpu::open(adapter)
        })?;
        Ok(Self::on(gpu, [width, height], quality))
    }

    /// Renderer on an open device.
    pub(crate) fn on(gpu: Arc<Gpu>, size: [u32; 2], quality: Quality) -> Self {
        Self {
            luts: Luts::new(&gpu),
            scene_depth: None,
            still: None,
            animation: None,
            past: None,
            winds: Going::default(),
            accumulator: None,
            moonlit: None,
            lut_memory: Vec::new(),
            timings: Timings::default(),
            size,
            quality,
            gpu,
        }
    }

    /// GPU memory after the last picture: owner, name of the shader variable, and size in bytes.
    ///
    /// The owner `scene` has LUTs, whose sizes do not depend on the picture's. Exceptions are `light_shafts`, which is
    /// smaller for small pictures, and the textures of the user's scene. Noise textures are shared by the renderers of
    /// a device. The owners `still` and `animation` have buffers in proportion to the number of pixels. The owner
    /// `light_field` has what an animation keeps to follow the sky.
    pub fn memory(&self) -> Vec<(&'static str, &'static str, u64)> {
        let mut held: Vec<_> = self.lut_memory.iter().map(|&(name, bytes)| ("scene", name, bytes)).collect();
        let still = self.still.iter().flat_map(|targets| targets.bindings()).map(|held| ("still", held));
        let temporal = self.animation.iter().flat_map(|targets| targets.bindings()).map(|held| ("animation", held));
        held.extend(still.chain(temporal).map(|(owner, (name, binding))| (owner, name, binding.bytes())));
        held.extend(self.luts.light_field.kept().into_iter().map(|(name, bytes)| ("light_field", name, bytes)));
        held.extend(self.moonlit.iter().flat_map(|lit| lit.memory()));
        held
    }

    /// Device of this renderer.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Changes size in pixels and quality of the pictures to come. Baked LUTs are kept, and an animation continues
    /// with its history.
    ///
    /// Returns [`Error::Parameter`] for a value out of range.
    pub fn set(&mut self, width: u32, height: u32, quality: Quality) -> Result<()> {
        quality.check()?;
        check_size([width, height])?;
        self.size = [width, height];
        self.accumulator = None;
        if let Some(lit) = &mut self.moonlit {
            lit.set(width, height, quality.clone())?;
        }
        self.quality = quality;
        Ok(())
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Renders a frame with one light source: checks the shot, plans, records and submits.
    pub(crate) fn frame(&mut self, shot: &Shot<'_>, target: Target<'_>, interrupt: Interrupt<'_>) -> Result<Picture> {
        let (mut frame, params) = shot.checked(self.size, &self.quality)?;
        frame.ground_shadow = (shot.background || target.layers()) && frame.has_ground_shadow(shot.camera, &params);
        let past = self.take_past(&shot.of(&params), target, &mut frame);
        let plan = Plan::new(&mut frame, &params, &self.quality, target);
        let past = past.filter(|past| past.is_bare(shot.scene.is_some()) || past.frame.grid == frame.grid);
        let stored = if target.is_animation() { &mut self.animation } else { &mut self.still };
        let (targets, resized) = Targets::fit(stored, &self.gpu, &frame, &plan, target.is_animation());
        let resized = resized.filter(|_| past.is_some());
        frame.set_motion(shot, &params, past.as_ref(), resized.as_ref());

        self.timings = Timings::default();
        let field = match target {
            Target::Still { .. } => Due::Still,
            Target::Animation(_) => {
                let now = Now { params: &params, eye: shot.camera.eye, time: shot.time };
                self.luts.follow(&mut frame, past.as_ref().map(Past::now), &now)
            }
        };
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        self.luts.update(&mut rec, &plan.inputs(shot, &params, &self.quality, &frame, field))?;
        let pixels = frame.view.width * plan.max_rows();
        let scene =
            SceneTextures::fit(&mut self.scene_depth, &self.gpu, frame.scene.then(|| shot.scene_or_none()), pixels);
        rec.bind(scene.map_or(Vec::new(), SceneTextures::bindings));
        self.lut_memory = rec.held();

        let mut picture = Picture::default();
        for strip in &plan.strips {
            plan.set_strip(&mut frame, strip);
            if let Some(textures) = scene {
                upload_scenes(textures, targets.temporal.as_mut(), &self.gpu, shot.scene, past.as_ref(), &frame);
            }
            let clouds = targets.clouds();
            match (plan.integrator, &targets.rays, targets.reprojection(resized.as_ref())) {
                _ if frame.cloudless => rec.clear(&clouds.samples),
                (Integrator::Reference, Some(rays), _) => reference::run(&mut rec, &frame, rays, clouds)?,
                (Integrator::Path, Some(rays), _) => path::run(&mut rec, &frame, rays, clouds)?,
                (.., Some(buffers)) => {
                    let previous = past.as_ref().map(|past| past.index);
                    reproject::record(&mut rec, &frame, &self.quality, previous, &buffers);
                }
                _ => march::record(&mut rec, &frame.at_samples(), &self.quality, &targets.ray_list, clouds),
            }
            composite::record(&mut rec, &frame, &params, &targets.parts(), plan.by_cells);
            match target {
                Target::Animation(Some(screen)) => display::record(&mut rec, &frame, &targets.output, screen),
                _ => download(&mut rec, &frame, targets, target.layers()),
            }
            picture.append(&rec.flush()?, &frame, target.layers());
        }
        self.gpu.pipelines.store();
        if let Some(temporal) = &mut targets.temporal {
            mem::swap(&mut temporal.before, &mut targets.now);
            let (scene, index) =
                (shot.scene.map(|scene| scene.distance.to_vec()), past.map_or(0, |past| past.index + 1));
            self.past = Some(Past { camera: *shot.camera, params, time: shot.time, frame, scene, index });
        }
        Ok(picture)
    }

    /// Takes the previous frame out of the renderer, if this frame can be reprojected from it. After a failed frame
    /// there is none, and the next frame is a still.
    fn take_past(&mut self, shot: &Shot<'_>, target: Target<'_>, frame: &mut Frame) -> Option<Past> {
        let Target::Still { first_sample, .. } = target else {
            let cloudless = Integrator::March.is_cloudless(shot.params);
            let past = self.past.take().filter(|past| past.serves(shot, cloudless, self.size));
            frame.scene |= past.as_ref().is_some_and(|past| past.scene.is_some());
            return past;
        };
        frame.view.first_sample = first_sample;
        None
    }

    /// Renders the next frame of an animation with one light source: one sample in sixteen is marched (one in four at
    /// low resolution), the others are reprojected. The first frame, and the first after a cut, is a still.
    pub(crate) fn next_frame(
        &mut self,
        shot: &Shot<'_>,
        screen: Option<&Screen>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let cut = self.past.as_ref().is_some_and(|past| past.is_cut(shot));
        let params = &self.winds.on(shot.params, shot.time, cut);
        let shot = &shot.of(params);
        if self.quality.integrator_of(params) == Integrator::March {
            self.check_pixels(shot)?;
            return Ok(self.frame(shot, Target::Animation(screen), interrupt)?.image);
        }
        let image = self.accumulate(shot, interrupt)?;
        screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
        Ok(image)
    }

    /// Checks that an animated frame fits the buffers and textures of the device.
    fn check_pixels(&self, shot: &Shot<'_>) -> Result<()> {
        let [width, height] = self.size;
        let scene = shot.scene.map_or(u64::MAX, |_| SceneTextures::MOST_PIXELS);
        let most = (self.gpu.max_buffer / 16).min(scene);
        if count(self.size) <= most {
            return Ok(());
        }
        let allowed = format!("at most {most} pixels for animate on this adapter");
        Err(Error::parameter("width x height", format!("{width} x {height}"), allowed))
    }

    /// Renders a still. While the shot does not change, path tracing accumulates the mean of the stills.
    fn accumulate(&mut self, shot: &Shot<'_>, interrupt: Interrupt<'_>) -> Result<Vec<f32>> {
        let last = self.accumulator.take().filter(|last| last.is_of(shot));
        let mut mean = last.unwrap_or_else(|| Accumulator::new(shot));
        // The reference integrator has converged after one still.
        if mean.count == 0 || self.quality.integrator_of(shot.params) == Integrator::Path {
            let first_sample = mean.count.wrapping_mul(self.quality.path_samples);
            mean.add(self.frame(shot, Target::Still { layers: false, first_sample }, interrupt)?.image);
        }
        let image = mean.image.clone();
        self.accumulator = Some(mean);
        Ok(image)
    }

    /// History length of each pixel of the last frame of [`Renderer::animate`] in frames, row by row.
    ///
    /// [`CYCLE`] is a pixel that was sampled directly: marched in that frame, or marched earlier and reprojected since.
    /// Less is the number of frames since the pixel was interpolated from the rays around it; 1 was interpolated in
    /// that frame. Empty without reprojection: before the first frame, after [`Renderer::cut`], without clouds, and
    /// with the integrators `reference` and `path`.
    ///
    /// Returns [`Error::Fork`] in a forked child.
    pub fn history_length(&mut self) -> Result<Vec<u32>> {
        check_fork()?;
        let reprojected = self.past.as_ref().is_some_and(|past| !past.frame.cloudless);
        let Some(targets) = self.animation.as_ref().filter(|targets| reprojected && targets.grid.size == self.size)
        else {
            return Ok(Vec::new());
        };
        let Some(temporal) = &targets.temporal else { return Ok(Vec::new()) };
        let [width, height] = targets.grid.size;
        let [columns, rows] = targets.grid.samples();
        let mut timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut timings, &|| Ok(()));
        rec.download(&temporal.before.length, 0, 4 * count([columns, rows]));
        let lengths = rec.submit()?;
        let lengths: &[u32] = lengths[0].numbers();
        let spacing = targets.grid.spacing();
        let unit = CYCLE / targets.grid.cycle();
        let at = |x: u32, y: u32| unit * lengths[(y / spacing * columns + x / spacing) as usize];
        Ok((0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect())
    }

    /// Discards the history: the next frame of [`Renderer::animate`] is a still.
    pub fn cut(&mut self) {
        self.forget();
        self.moonlit.iter_mut().for_each(|lit| lit.forget());
    }

    /// Discards the history of this light source.
    pub(crate) fn forget(&mut self) {
        self.accumulator = None;
        self.winds = Going::default();
        self.past = None;
    }
}
