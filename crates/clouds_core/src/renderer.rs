//! The frame, top to bottom.

use std::mem;
use std::sync::{Arc, LazyLock};
use std::thread;

use crate::blue_noise;
use crate::error::{Error, Result};
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

/// What [`Renderer::history_length`] says of a pixel that has had a ray of its own: frames in which every pixel is marched once.
pub const CYCLE: u32 = grid::CYCLE;

/// Makes pictures of one size with one numerical method on one device.
pub struct Renderer {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) size: [u32; 2],
    pub(crate) quality: Quality,
    pub(crate) luts: Luts,
    scene_depth: Option<SceneTextures>,
    still: Option<Targets>,
    animation: Option<Targets>,
    past: Option<Past>,
    going: Going,
    accumulator: Option<Accumulator>,
    /// Makes what the moon lights, where that is seen.
    pub(crate) moonlit: Option<Box<Self>>,
    /// Names and bytes of the LUTs, as they were bound last.
    pub(crate) lut_memory: Vec<(&'static str, u64)>,
    /// Milliseconds on the GPU by kernel, for the last picture or answer.
    pub timings: Timings,
}

impl Renderer {
    /// A renderer of pictures of `width` by `height` pixels on the adapter that `adapter` means: an index or a part of
    /// a name, or none for the best.
    pub fn new(width: u32, height: u32, quality: Quality, adapter: Option<&str>) -> Result<Self> {
        quality.check()?;
        check_size([width, height])?;
        // Each takes a process's first renderer some 20 ms of one thread.
        let gpu = thread::scope(|scope| {
            scope.spawn(|| LazyLock::force(&blue_noise::TILE));
            Gpu::open(adapter)
        })?;
        Ok(Self::on(gpu, [width, height], quality))
    }

    /// The same on a device that is open.
    pub(crate) fn on(gpu: Arc<Gpu>, size: [u32; 2], quality: Quality) -> Self {
        Self {
            luts: Luts::new(&gpu),
            scene_depth: None,
            still: None,
            animation: None,
            past: None,
            going: Going::default(),
            accumulator: None,
            moonlit: None,
            lut_memory: Vec::new(),
            timings: Timings::default(),
            size,
            quality,
            gpu,
        }
    }

    /// What the last picture has left on the GPU: for whom, the variable of the shaders, and bytes.
    ///
    /// The `scene` is what every picture reads, whatever its size, but for `beams`, which small ones have less of; noises among it are shared by the renderers of a device.
    /// A `still` and an `animation` have buffers of so many bytes a pixel.
    pub fn memory(&self) -> Vec<(&'static str, &'static str, u64)> {
        let mut held: Vec<_> = self.lut_memory.iter().map(|&(name, bytes)| ("scene", name, bytes)).collect();
        let still = self.still.iter().flat_map(|targets| targets.bindings()).map(|held| ("still", held));
        let temporal = self.animation.iter().flat_map(|targets| targets.bindings()).map(|held| ("animation", held));
        held.extend(still.chain(temporal).map(|(owner, (name, binding))| (owner, name, binding.bytes())));
        held.extend(self.moonlit.iter().flat_map(|lit| lit.memory()));
        held
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Makes pictures of another size and by another method from now on; what has been baked stays, and an animation goes on
    /// with what it has been following.
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

    /// One frame by one light: checked, planned, recorded, submitted.
    pub(crate) fn frame(&mut self, shot: &Shot<'_>, target: Target<'_>, interrupt: Interrupt<'_>) -> Result<Picture> {
        let (mut frame, params) = shot.checked(self.size, &self.quality)?;
        frame.ground_shadow = (shot.background || target.layers()) && frame.has_ground_shadow(shot.camera, &params);
        let past = self.take_past(&shot.of(&params), target, &mut frame);
        let plan = Plan::new(&mut frame, &params, &self.quality, target);
        let past = past.filter(|past| past.is_bare(shot.scene.is_some()) || past.frame.grid == frame.grid);
        let kept = if target.is_animation() { &mut self.animation } else { &mut self.still };
        let (targets, resized) = Targets::fit(kept, &self.gpu, &frame, &plan, target.is_animation());
        let resized = resized.filter(|_| past.is_some());
        frame.follow(shot, &params, past.as_ref(), resized.as_ref());

        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        self.luts.update(&mut rec, &plan.inputs(shot, &params, &self.quality, &frame))?;
        let pixels = frame.view.width * plan.most_rows();
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

    /// Takes out the frame before, where the next one may be reprojected from it: if that fails, the one after is a still.
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

    /// The next frame of an animation by one light: a sixteenth of its pixels is marched, the others are reprojected. The
    /// first frame, and the first after a cut, is a still.
    pub(crate) fn next_frame(
        &mut self,
        shot: &Shot<'_>,
        screen: Option<&Screen>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let cut = self.past.as_ref().is_some_and(|past| past.is_cut(shot));
        let params = &self.going.on(shot.params, shot.time, cut);
        let shot = &shot.of(params);
        if self.quality.integrator_of(params) == Integrator::March {
            self.check_pixels(shot)?;
            return Ok(self.frame(shot, Target::Animation(screen), interrupt)?.image);
        }
        let image = self.accumulate(shot, interrupt)?;
        screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
        Ok(image)
    }

    /// Whether a frame of an animation may be so large.
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

    /// A still, or, of the same shot again, a better one.
    fn accumulate(&mut self, shot: &Shot<'_>, interrupt: Interrupt<'_>) -> Result<Vec<f32>> {
        let last = self.accumulator.take().filter(|last| last.is_of(shot));
        let mut mean = last.unwrap_or_else(|| Accumulator::new(shot));
        // What has converged stays.
        if mean.count == 0 || self.quality.integrator_of(shot.params) == Integrator::Path {
            let first_sample = mean.count.wrapping_mul(self.quality.path_samples);
            mean.add(self.frame(shot, Target::Still { layers: false, first_sample }, interrupt)?.image);
        }
        let image = mean.image.clone();
        self.accumulator = Some(mean);
        Ok(image)
    }

    /// How much each pixel of the last frame of [`Renderer::animate`] rests on, row by row, from 1, a guess from the rays
    /// around it in that frame alone, to [`CYCLE`], a ray of its own that has been followed since; between those, the mean of guesses
    /// in so many frames. Empty where no frame was reprojected or could be: before the first, after a cut, without clouds, and
    /// where frames converge or are traced.
    pub fn history_length(&mut self) -> Result<Vec<u32>> {
        check_fork()?;
        let followed = self.past.as_ref().is_some_and(|past| !past.frame.cloudless);
        let Some(targets) = self.animation.as_ref().filter(|targets| followed && targets.grid.size == self.size) else {
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

    /// Forgets the frame before: the next one of [`Renderer::animate`] is a still.
    pub fn cut(&mut self) {
        self.forget();
        self.moonlit.iter_mut().for_each(|lit| lit.forget());
    }

    pub(crate) fn forget(&mut self) {
        self.accumulator = None;
        self.going = Going::default();
        self.past = None;
    }
}
