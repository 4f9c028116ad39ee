//! The frame, top to bottom.

use std::mem;
use std::sync::{Arc, LazyLock};
use std::thread;

use crate::blue_noise;
use crate::error::{Error, Result};
use crate::gpu::Recorder;
use crate::gpu::{Gpu, Interrupt, Timings, check_fork};
use crate::grid;
use crate::history::{Accumulator, Past, upload_scenes};
use crate::luts::Luts;
use crate::params::{Model, Quality};
use crate::passes::composite::Parts;
use crate::passes::display::{self, Screen};
use crate::passes::{composite, march, path, reference, reproject};
use crate::picture::{Picture, download};
use crate::plan::{Integrator, Plan};
use crate::scene_depth::SceneTextures;
use crate::shot::{Shot, check_size};
use crate::targets::{StillTargets, TemporalTargets, count, fit_temporal};
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
    still: Option<StillTargets>,
    temporal: Option<TemporalTargets>,
    last: Option<Past>,
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
            temporal: None,
            last: None,
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
        let temporal = self.temporal.iter().flat_map(|targets| targets.bindings()).map(|held| ("animation", held));
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

    /// A still by one light; `first_sample` is the number of the first path of each pixel.
    pub(crate) fn still(
        &mut self,
        shot: &Shot<'_>,
        layers: bool,
        first_sample: u32,
        interrupt: Interrupt<'_>,
    ) -> Result<Picture> {
        let (mut frame, params) = shot.checked(self.size, &self.quality)?;
        frame.view.first_sample = first_sample;
        frame.ground_shadow = (shot.background || layers) && frame.has_ground_shadow(shot.camera, &params);
        let plan = Plan::new(&mut frame, &params, &self.quality, false, layers);
        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        let inputs = plan.inputs(shot, &params, &self.quality, &frame);
        self.luts.update(&mut rec, &inputs)?;
        let scene =
            SceneTextures::fit(&mut self.scene_depth, &self.gpu, shot.scene, frame.view.width * plan.most_rows());
        rec.bind(scene.map_or(Vec::new(), SceneTextures::bindings));
        self.lut_memory = rec.held();

        let mut picture = Picture::default();
        for strip in &plan.strips {
            plan.set_strip(&mut frame, &self.quality, strip);
            let targets = StillTargets::fit(&mut self.still, &self.gpu, &frame, plan.integrator);
            let StillTargets { ray_list, cloud_buffers, output, background_corners, rays, .. } = targets;
            if let (Some(textures), Some(given)) = (scene, &shot.scene) {
                let [first, pixels] =
                    [strip.start, frame.dispatch.strip_rows].map(|rows| rows as usize * frame.view.width as usize);
                textures.upload(&self.gpu, given, first..first + pixels);
            }
            match (plan.integrator, rays) {
                (Integrator::Reference, Some(rays)) => reference::run(&mut rec, &frame, rays, cloud_buffers)?,
                (Integrator::Path, Some(rays)) => path::run(&mut rec, &frame, rays, cloud_buffers)?,
                _ if frame.cloudless => rec.clear(&cloud_buffers.samples),
                _ => march::record(&mut rec, &frame.at_samples(), &self.quality, ray_list, cloud_buffers),
            }
            let parts = Parts { cloud_buffers, background_corners, ray_list, out: output };
            composite::record(&mut rec, &frame, &params, &parts, plan.by_cells);
            download(&mut rec, &frame, targets, layers);
            picture.append(&rec.flush()?, &frame, layers);
        }
        self.gpu.pipelines.store();
        Ok(picture)
    }

    /// The next frame of an animation by one light, onto a screen or, without one, to memory: a sixteenth of its pixels is
    /// marched, the others follow the clouds from the frame before. The first frame, and the first after a cut, is a still.
    pub(crate) fn next_frame(
        &mut self,
        shot: &Shot<'_>,
        screen: Option<&Screen>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let cut = self.last.as_ref().is_some_and(|last| last.is_cut(shot));
        let params = &self.going.on(shot.params, shot.time, cut);
        let shot = &shot.of(params);
        let integrator = Integrator::new(params, &self.quality);
        if integrator != Integrator::March {
            let image = self.accumulate(shot, interrupt)?;
            screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
            return Ok(image);
        }
        let (mut frame, params) = shot.checked(self.size, &self.quality)?;
        self.check_pixels(shot)?;
        frame.ground_shadow = shot.background && frame.has_ground_shadow(shot.camera, &params);
        // Taken out while the frame is in the making: if it fails, the next one starts anew.
        let last = self.last.take().filter(|last| !last.is_cut(&shot.of(&params)));
        let cloudless = integrator.is_cloudless(&params);
        let last = last.filter(|last| {
            let same_size = [last.frame.view.width, last.frame.view.height] == self.size;
            last.frame.cloudless == cloudless && (last.is_bare(shot.scene.is_some()) || same_size)
        });
        frame.scene = shot.scene.is_some() || last.as_ref().is_some_and(|last| last.scene.is_some());
        let plan = Plan::new(&mut frame, &params, &self.quality, true, false);
        let last = last.filter(|last| last.is_bare(shot.scene.is_some()) || last.frame.grid == frame.grid);
        let (targets, resized) = fit_temporal(&mut self.temporal, &self.gpu, &frame);
        let resized = resized.filter(|_| last.is_some());
        upload_scenes(&mut self.scene_depth, targets, &self.gpu, shot.scene, last.as_ref(), &frame);
        frame.follow(shot, &params, last.as_ref(), resized.as_ref());
        frame.dispatch.strip_rows = frame.view.height;

        self.timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut self.timings, interrupt);
        let inputs = plan.inputs(shot, &params, &self.quality, &frame);
        self.luts.update(&mut rec, &inputs)?;
        rec.bind(self.scene_depth.as_ref().map_or(Vec::new(), SceneTextures::bindings));
        self.lut_memory = rec.held();

        let TemporalTargets { ray_list, current, before, now, output, background_corners, scene_before, .. } =
            &*targets;
        if let Some(old) = &resized {
            reproject::rescale(&mut rec, &frame, &old.before, before);
        }
        let index = last.as_ref().map_or(0, |last| last.index + 1);
        let buffers = reproject::Buffers { ray_list, current, before, scene_before, now };
        let follow = |rec: &mut Recorder<'_>| reproject::record(rec, &frame, &self.quality, index, &buffers);
        if frame.cloudless {
        } else if last.is_some() {
            follow(&mut rec);
        } else {
            rec.compile_ahead(follow);
            reproject::begin(&mut rec, &frame, &self.quality, ray_list, now);
        }
        let parts = Parts { cloud_buffers: &now.cloud_buffers, background_corners, ray_list, out: output };
        composite::record(&mut rec, &frame, &params, &parts, plan.by_cells);
        match screen {
            Some(screen) => display::record(&mut rec, &frame, output, screen),
            None => rec.download(&output.image, 0, 16 * count(self.size)),
        }
        let downloads = rec.submit()?;
        let image = downloads.first().map_or(Vec::new(), |image| image.numbers().to_vec());

        self.gpu.pipelines.store();
        mem::swap(&mut targets.before, &mut targets.now);
        let scene = shot.scene.map(|scene| scene.distance.to_vec());
        self.last = Some(Past { camera: *shot.camera, params, time: shot.time, frame, scene, index });
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
        if mean.count == 0 || shot.params.light.model == Model::Path {
            let first_sample = mean.count.wrapping_mul(self.quality.path_samples);
            mean.add(self.still(shot, false, first_sample, interrupt)?.image);
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
        let followed = self.last.as_ref().is_some_and(|last| !last.frame.cloudless);
        let Some(targets) = self.temporal.as_ref().filter(|targets| followed && targets.grid.size == self.size) else {
            return Ok(Vec::new());
        };
        let [width, height] = targets.grid.size;
        let [columns, rows] = targets.grid.samples();
        let mut timings = Timings::default();
        let mut rec = Recorder::new(&self.gpu, &mut timings, &|| Ok(()));
        rec.download(&targets.before.length, 0, 4 * count([columns, rows]));
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
        self.last = None;
    }
}
