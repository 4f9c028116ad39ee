//! The frame, top to bottom.

use std::mem;
use std::ops::Range;
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Instant;

use glam::DVec3;

use crate::blue_noise;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::{Gpu, Interrupt, Timings, check_fork};
use crate::kernel::{Binding, Kernel, Variant, Wanted};
use crate::moon::Lights;
use crate::params::{self, Model, Params, Quality};
use crate::passes::beams::{self, Beams};
use crate::passes::broad_weather::BroadWeather;
use crate::passes::composite::{Backdrop, Composed, Parts, TILE};
use crate::passes::display::{self, Screen};
use crate::passes::high_clouds::{self, HighClouds};
use crate::passes::majorant::Majorants;
use crate::passes::march::Marched;
use crate::passes::multiscatter::Multiscatter;
use crate::passes::noise::Noise;
use crate::passes::phase::PhaseTable;
use crate::passes::profile::Profile;
use crate::passes::rays::Rays;
use crate::passes::refine::{COARSEST, Refined};
use crate::passes::reproject::{Current, Followed, History};
use crate::passes::shadow::{self, GroundShadow};
use crate::passes::sky::Sky;
use crate::passes::transmittance::Transmittance;
use crate::passes::volume::Volume;
use crate::passes::weather::Weather;
use crate::passes::{Bindings, Context, Scene, Uniforms, composite, march, path, points, reference, refine, reproject};
use crate::scene_depth::{SceneDepth, SceneTextures};
use crate::shader::Linked;
use crate::wind::{Carried, Going};

/// What [`Renderer::history_length`] says of a pixel that has had a ray of its own: frames in which every pixel is marched once.
pub const ROUND: u32 = reproject::round(false);

/// Makes pictures of one size with one numerical method on one device.
pub struct Renderer {
    gpu: Arc<Gpu>,
    size: [u32; 2],
    quality: Quality,
    world: World,
    still: Option<Still>,
    animation: Option<Animation>,
    going: Going,
    refining: Option<Refining>,
    /// Makes what the moon lights, where that is seen.
    moonlit: Option<Box<Self>>,
    march_pace: Pace,
    reproject_pace: Pace,
    pixel_pace: Pace,
    shadow_pace: Pace,
    /// Milliseconds on the GPU by kernel, for the last picture or answer.
    pub timings: Timings,
}

/// A picture, row by row.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Four numbers a pixel: radiance and alpha (see [`Renderer::render`]).
    pub image: Vec<f32>,
    /// Four numbers a pixel: radiance of the sky without clouds, and 1.
    pub sky: Vec<f32>,
    /// Metres to the mean scattering point, -1 where there is none.
    pub depth: Vec<f32>,
    /// Density evaluations, primary and light together.
    pub samples: Vec<u32>,
    /// Four numbers a pixel: how sure the radiance of the clouds is, and 0. A standard error where paths are traced, the
    /// change by the last halving where rays converge, nothing where they are marched.
    pub uncertainty: Vec<f32>,
}

/// How the clouds of a picture are computed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Method {
    /// By so many steps.
    March,
    /// By steps that are halved until nothing changes.
    Reference,
    /// By tracing paths.
    Path,
}

/// The kernels of the bakes that are kept from no earlier process.
const BAKES: [(&str, &str); 3] = [("sky", "sky_map_bake"), ("sky", "air_share_bake"), ("sky", "sky_light_bake")];

impl Method {
    /// The kernels of a still.
    fn kernels(self, params: &Params, quality: &Quality, frame: &Frame, variant: Variant, layers: bool) -> Vec<Wanted> {
        let clouds: &[_] = match self {
            _ if frame.cloudless > 0 => &[],
            Self::March if refine::is_needed(frame, quality) => &[("march", "march_list"), ("refine", "refine")],
            Self::March => &[("march", "march")],
            Self::Reference => &[("reference", "reference")],
            Self::Path => &[("path", "path")],
        };
        let with = |variant| move |&(pass, entry): &(&'static str, &'static str)| (pass, entry, variant);
        let high = params.has_high_clouds();
        let high = high.then(|| ("high_clouds", high_clouds::kernel(&params.high_clouds)));
        let bakes = high.into_iter().chain(BAKES).map(|(pass, entry)| (pass, entry, Variant::bake()));
        let composite: &[_] = if self.by_cells(frame, quality) { &composite::CELLS } else { &composite::WHOLE };
        let composite = composite.iter().map(with(composite::variant(variant, frame, layers)));
        let clouds = clouds.iter().map(with(variant));
        let discs = Variant { discs: true, ..composite::variant(variant, frame, layers) };
        let discs = (!frame.disc_pixels(params).is_empty()).then_some(("composite", "composite_discs", discs));
        bakes
            .chain(shadow::kernels(frame, variant))
            .chain(beams::kernel(variant))
            .chain(clouds)
            .chain(composite)
            .chain(discs)
            .collect()
    }

    /// Whether what is behind the clouds is worked out by cells.
    fn by_cells(self, frame: &Frame, quality: &Quality) -> bool {
        self == Self::March && composite::by_cells(frame, quality)
    }

    /// Whether there is nothing to march.
    fn is_cloudless(self, params: &Params) -> bool {
        !params.has_clouds() && self == Self::March
    }

    fn new(params: &Params, quality: &Quality) -> Self {
        match params.light.model {
            Model::Path => Self::Path,
            _ if quality.tolerance > 0.0 => Self::Reference,
            _ => Self::March,
        }
    }
}

/// Buffers of the sheets of a still, kept from one to the next.
struct Still {
    size: [u32; 2],
    method: Method,
    sparse: bool,
    refined: Refined,
    marched: Marched,
    composed: Composed,
    backdrop: Backdrop,
    rays: Option<Rays>,
}

/// A picture that every frame of a static shot makes better, where frames are not reprojected.
struct Refining {
    camera: Camera,
    params: Params,
    time: f64,
    background: bool,
    /// Distance and radiance of the user's scene.
    scene: Option<(Vec<f32>, Option<Vec<f32>>)>,
    image: Vec<f32>,
    /// Stills that it is the mean of.
    count: u32,
}

/// Buffers of whole pictures, and what reprojection remembers of the frame before.
struct Animation {
    size: [u32; 2],
    sparse: bool,
    refined: Refined,
    current: Current,
    before: Followed,
    now: Followed,
    composed: Composed,
    backdrop: Backdrop,
    scene_before: SceneTextures,
    last: Option<Shot>,
}

struct Shot {
    camera: Camera,
    params: Params,
    time: f64,
    frame: Frame,
    /// Distance of the user's scene.
    scene: Option<Vec<f32>>,
    /// Frames since the last cut.
    index: u32,
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
    fn on(gpu: Arc<Gpu>, size: [u32; 2], quality: Quality) -> Self {
        let pace = Pace::new(if gpu.info.kind == "cpu" { 3e5 } else { 1e8 });
        Self {
            world: World::new(&gpu),
            still: None,
            animation: None,
            going: Going::default(),
            refining: None,
            moonlit: None,
            march_pace: pace,
            reproject_pace: pace,
            pixel_pace: pace,
            // Its texels may take many times as long as a pixel's march.
            shadow_pace: Pace::new(if gpu.info.kind == "cpu" { 1e4 } else { 1e6 }),
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
        let mut held: Vec<_> = self.world.memory.iter().map(|&(name, bytes)| ("scene", name, bytes)).collect();
        let mut add = |owner, bindings: Bindings<'_>| {
            held.extend(bindings.into_iter().map(|(name, binding)| (owner, name, binding.bytes())));
        };
        if let Some(Still { refined, marched, composed, backdrop, rays, .. }) = &self.still {
            add("still", [marched.bindings(), refined.bindings(), composed.bindings(), backdrop.bindings()].concat());
            add("still", rays.as_ref().map_or(Vec::new(), |rays| rays.bindings("rays")));
        }
        if let Some(Animation { refined, current, before, now, composed, backdrop, scene_before, .. }) = &self.animation
        {
            add(
                "animation",
                [current.bindings(), refined.bindings(), composed.bindings(), backdrop.bindings()].concat(),
            );
            add("animation", vec![("scene_before", scene_before.depth())]);
            add("animation", [before.bindings(), now.bindings()].concat());
        }
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
        self.refining = None;
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

    /// A still: finished in one call, without history or noise to wait for.
    ///
    /// With `background` the image is the radiance of the whole sky with alpha 1; without it the clouds alone,
    /// premultiplied, alpha 1 minus their transmittance. `all` fills the other layers of the picture too. A `scene_depth`
    /// hides what is behind it; with its radiance it is a part of the picture, without it alpha leaves room for it.
    #[expect(clippy::too_many_arguments, reason = "what a still depends on")]
    pub fn render(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        all: bool,
        scene_depth: Option<SceneDepth<'_>>,
        interrupt: Interrupt<'_>,
    ) -> Result<Picture> {
        let Lights { sun, moon } = self.lights(camera, params, time)?;
        let still = |lit: &mut Self, sky: &Params, scene: Option<SceneDepth<'_>>| {
            lit.still(camera, sky, time, background, all, 0, scene, interrupt)
        };
        let Some(moon) = moon else { return still(self, sun.as_ref().unwrap_or(params), scene_depth) };
        let first = sun.map(|sun| still(self, &sun, scene_depth)).transpose()?;
        let black = black(scene_depth, first.is_some());
        let scene = scene_of(scene_depth, black.as_deref());
        let second = self.by_moon(|lit| still(lit, &moon, scene), first.is_some())?;
        Ok(match first {
            Some(first) => first.and(&second),
            None => second,
        })
    }

    /// What lights a sky.
    fn lights(&mut self, camera: &Camera, params: &Params, time: f64) -> Result<Lights> {
        if !params.moon.exists() {
            return Ok(Lights { sun: Some(params.clone()), moon: None });
        }
        let (frame, _) = self.begin(camera, params, time)?;
        Ok(Lights::new(params, &frame))
    }

    /// What the renderer of moonlight makes; its times are a part of ours, or all of them.
    fn by_moon<T>(&mut self, make: impl FnOnce(&mut Self) -> Result<T>, part: bool) -> Result<T> {
        let mut lit = match self.moonlit.take() {
            Some(lit) => lit,
            None => Box::new(Self::on(self.gpu.clone(), self.size, self.quality.clone())),
        };
        let made = make(&mut lit);
        let times = mem::take(&mut lit.timings);
        self.moonlit = Some(lit);
        if part {
            times.0.iter().for_each(|(label, time)| self.timings.add(label, *time));
        } else {
            self.timings = times;
        }
        made
    }

    /// A still; `first_sample` is the number of the first path of each pixel.
    #[expect(clippy::too_many_arguments, reason = "what a still depends on")]
    fn still(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        all: bool,
        first_sample: u32,
        scene_depth: Option<SceneDepth<'_>>,
        interrupt: Interrupt<'_>,
    ) -> Result<Picture> {
        let (mut frame, params) = self.begin(camera, params, time)?;
        scene_depth.map_or(Ok(()), |scene| scene.check(self.size))?;
        frame.scene = u32::from(scene_depth.is_some());
        let colored = scene_depth.is_some_and(|scene| scene.color.is_some());
        frame.scene_lit = u32::from(colored);
        let params = &params;
        frame.background = u32::from(background);
        frame.first_sample = first_sample;
        frame.ground_shadow = u32::from((background || all) && frame.has_ground_shadow(camera, params));
        frame.beams = u32::from(frame.has_beams(camera, params));
        let method = Method::new(params, &self.quality);
        frame.cloudless = u32::from(method.is_cloudless(params));
        let Self { gpu, world, quality, timings, .. } = self;
        let sparse = method == Method::March && refine::is_sparse(&frame, quality);
        frame.sparse = u32::from(sparse);
        let variant = Variant::of_frame(params, quality, &frame);
        let [width, height] = self.size;
        let sheet_pixels = scene_depth.map_or(0, |_| u64::from(width) * u64::from(largest_sheet(self.size, method)));
        if !world.scene_depth.holds(sheet_pixels, colored) {
            world.scene_depth = SceneTextures::new(gpu, sheet_pixels, colored);
        }
        let world = &mut *world;
        let scene = gpu.compiling(&method.kernels(params, quality, &frame, variant, all), || {
            world.run(gpu, params, &frame, (camera.eye, time), quality, timings, interrupt)
        })?;

        let lattice = method == Method::March && refine::is_needed(&frame, quality);
        let by_cells = method.by_cells(&frame, quality);
        let mut picture = Picture::default();
        for sheet in sheets([width, height], method) {
            frame.sheet_row = sheet.start;
            frame.rows = sheet.len() as u32;
            // Lattices of rays meet in the first row of the next sheet.
            let shared = u32::from(lattice && sheet.end < height);
            frame.sheet_rows = frame.rows + shared;
            let size = [width, frame.sheet_rows];
            if self.still.as_ref().is_none_or(|still| !still.holds(size, method, sparse)) {
                self.still = Some(Still::new(gpu, size, method, sparse));
            }
            let Some(still) = &self.still else { unreachable!("was just made") };
            if let Some(given) = &scene_depth {
                let first = sheet.start as usize * width as usize;
                let pixels = width as usize * frame.sheet_rows as usize;
                scene.scene_depth.upload(gpu, given, first..first + pixels);
            }

            let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
            match (method, &still.rays) {
                (Method::Reference, Some(rays)) => reference::run(&mut ctx, &scene, &frame, rays, &still.marched)?,
                (Method::Path, Some(rays)) => path::run(&mut ctx, &scene, &frame, rays, &still.marched)?,
                _ if frame.cloudless > 0 => {
                    let mut work = gpu.work();
                    work.clear(&still.marched.samples);
                    work.submit(ctx.timings, interrupt)?;
                }
                _ => {
                    let pace = &mut self.march_pace;
                    let mut frame = frame.of_known();
                    march_sheet(&mut ctx, &scene, &mut frame, quality, pace, &still.refined, &still.marched)?;
                }
            }
            let Still { marched, refined, composed, backdrop, rays, .. } = still;
            let parts = Parts { marched, backdrop, refined, out: composed };
            frame.rows = sheet.len() as u32;
            let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
            compose_sheet(&mut ctx, &scene, &mut frame, params, &mut self.pixel_pace, &parts, by_cells, all)?;
            let mut work = gpu.work();
            let pixels = u64::from(width) * sheet.len() as u64;
            work.download(&composed.image, 0, 16 * pixels);
            let [columns, rows] = refine::known([width, sheet.len() as u32], sparse);
            if all {
                work.download(&composed.sky, 0, 16 * pixels);
                work.download(&composed.depth, 0, 4 * pixels);
                work.download(&marched.samples, 0, 4 * u64::from(columns) * u64::from(rows));
                if let Some(rays) = rays {
                    work.download(&rays.uncertainty, 0, 16 * pixels);
                }
            }
            let downloads = work.submit(timings, interrupt)?;
            picture.image.extend_from_slice(downloads[0].numbers());
            if all {
                picture.sky.extend_from_slice(downloads[1].numbers());
                picture.depth.extend_from_slice(downloads[2].numbers());
                let samples: &[u32] = downloads[3].numbers();
                if sparse {
                    picture.samples.extend(at_known(samples, columns, [width, sheet.len() as u32]));
                } else {
                    picture.samples.extend_from_slice(samples);
                }
                if let Some(uncertainty) = downloads.get(4) {
                    picture.uncertainty.extend_from_slice(uncertainty.numbers());
                }
            }
        }
        gpu.pipelines.store();
        Ok(picture)
    }

    /// The next frame of an animation: a sixteenth of its pixels is marched, the others follow the clouds from the frame
    /// before. The first frame, and the first after a cut, is a still. Returns what [`Renderer::render`] does.
    ///
    /// Beside edges of the user's scene, now or in the frame before, every pixel is marched.
    ///
    /// Where rays converge or paths are traced, every frame is a still; a static shot goes on tracing.
    pub fn animate(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        scene_depth: Option<SceneDepth<'_>>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        self.lit_frame(camera, params, time, background, scene_depth, None, interrupt)
    }

    /// The same, of the whole sky, onto a screen of the size of the pictures, without bringing it to memory.
    pub fn animate_onto(
        &mut self,
        screen: &Screen,
        camera: &Camera,
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<()> {
        if screen.size() != self.size {
            let [width, height] = screen.size();
            let [w, h] = self.size;
            return Err(Error::parameter("screen", format!("{width} x {height}"), format!("of {w} x {h} pixels")));
        }
        self.lit_frame(camera, params, time, true, None, Some(screen), interrupt).map(drop)
    }

    /// The next frame by the light of sun, moon or both, each of which is followed by itself.
    #[expect(clippy::too_many_arguments, reason = "what a frame depends on")]
    fn lit_frame(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        scene_depth: Option<SceneDepth<'_>>,
        screen: Option<&Screen>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let Lights { sun, moon } = self.lights(camera, params, time)?;
        let Some(moon) = moon else {
            self.moonlit.iter_mut().for_each(|lit| lit.forget());
            let sky = sun.as_ref().unwrap_or(params);
            return self.next_frame(camera, sky, time, background, scene_depth, screen, interrupt);
        };
        let Some(sun) = sun else {
            self.forget();
            let make = |lit: &mut Self| lit.next_frame(camera, &moon, time, background, scene_depth, screen, interrupt);
            return self.by_moon(make, false);
        };
        let mut image = self.next_frame(camera, &sun, time, background, scene_depth, None, interrupt)?;
        let black = black(scene_depth, true);
        let scene = scene_of(scene_depth, black.as_deref());
        let make = |lit: &mut Self| lit.next_frame(camera, &moon, time, background, scene, None, interrupt);
        add_light(&mut image, &self.by_moon(make, true)?);
        screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
        Ok(image)
    }

    /// The next frame, onto a screen or, without one, to memory.
    #[expect(clippy::too_many_arguments, reason = "what a frame depends on")]
    fn next_frame(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        scene_depth: Option<SceneDepth<'_>>,
        screen: Option<&Screen>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let last = self.animation.as_ref().and_then(|animation| animation.last.as_ref());
        let params = &self.going.on(params, time, last.is_some_and(|last| last.is_cut(camera, params, time)));
        if Method::new(params, &self.quality) != Method::March {
            let image = self.refine(camera, params, time, background, scene_depth, interrupt)?;
            screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
            return Ok(image);
        }
        let (mut frame, params) = self.begin(camera, params, time)?;
        scene_depth.map_or(Ok(()), |scene| scene.check(self.size))?;
        let params = &params;
        frame.background = u32::from(background);
        frame.ground_shadow = u32::from(background && frame.has_ground_shadow(camera, params));
        frame.beams = u32::from(frame.has_beams(camera, params));
        frame.cloudless = u32::from(Method::March.is_cloudless(params));
        let [width, height] = self.size;
        let pixels = u64::from(width) * u64::from(height);
        let most = (self.gpu.max_buffer / 16).min(scene_depth.map_or(u64::MAX, |_| SceneTextures::MOST_PIXELS));
        if pixels > most {
            let size = format!("{width} x {height}");
            return Err(Error::parameter(
                "width x height",
                size,
                format!("at most {most} pixels for animate on this adapter"),
            ));
        }
        let Self { gpu, world, quality, timings, .. } = self;
        // Taken out while the frame is in the making: if it fails, the next one starts anew.
        let last = self.animation.as_mut().and_then(|animation| animation.last.take());
        let last = last.filter(|last| !last.is_cut(camera, params, time));
        // A frame without clouds leaves no history, nor do the edges of a scene in a picture of another size.
        let last = last.filter(|last| last.frame.cloudless == frame.cloudless);
        let bare = |last: &Shot| last.scene.is_none() && scene_depth.is_none();
        let fits = |last: &Shot| [last.frame.width, last.frame.height] == [width, height];
        let last = last.filter(|last| bare(last) || fits(last));
        frame.scene = u32::from(scene_depth.is_some() || last.as_ref().is_some_and(|last| last.scene.is_some()));
        let sparse = refine::is_sparse(&frame, quality);
        frame.sparse = u32::from(sparse);
        let last = last.filter(|last| bare(last) || last.frame.sparse == frame.sparse);
        let old = self.animation.take_if(|old| (old.size, old.sparse) != ([width, height], sparse));
        let resized = old.map(|old| (old.before, old.size, old.sparse));
        let animation = self.animation.get_or_insert_with(|| Animation::new(gpu, [width, height], sparse));
        let index = last.as_ref().map_or(0, |last| last.index + 1);
        // Where a scene was and is no more, or is and was not, there is nothing.
        let had = last.as_ref().and_then(|last| last.scene.as_deref());
        let has = scene_depth.map(|scene| scene.distance);
        if frame.scene > 0 {
            let color = scene_depth.and_then(|scene| scene.color);
            frame.scene_lit = u32::from(color.is_some());
            if !world.scene_depth.holds(pixels, color.is_some()) {
                world.scene_depth = SceneTextures::new(gpu, pixels, color.is_some());
            }
            if !animation.scene_before.holds(pixels, false) {
                animation.scene_before = SceneTextures::new(gpu, pixels, false);
            }
            let nothing = vec![f32::INFINITY; pixels as usize];
            let now = SceneDepth { distance: has.unwrap_or(&nothing), color };
            let before = SceneDepth { distance: had.unwrap_or(&nothing), color: None };
            world.scene_depth.upload(gpu, &now, 0..pixels as usize);
            animation.scene_before.upload(gpu, &before, 0..pixels as usize);
        }
        if let Some(last) = &last {
            frame.set_previous(
                &last.frame,
                camera.eye - last.camera.eye,
                &Carried::between((&last.params, last.time), (params, time)),
            );
            frame.moving = u32::from(last.camera != *camera || frame.cloud_motion != [0.0; 3] || had != has);
        }
        let variant = Variant::of_frame(params, quality, &frame);
        let scene = gpu.compiling(&Method::March.kernels(params, quality, &frame, variant, false), || {
            world.run(gpu, params, &frame, (camera.eye, time), quality, timings, interrupt)
        })?;

        let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
        let Animation { refined, current, before, now, composed, backdrop, scene_before, .. } = &*animation;
        if let (Some((old, size, was_sparse)), Some(_)) = (&resized, &last) {
            [frame.previous_width, frame.previous_height] = *size;
            frame.previous_spacing = refine::spacing(*was_sparse);
            frame.previous_round = reproject::round(*was_sparse);
            scene.uniforms.upload_frame(gpu, &frame);
            let mut work = gpu.work();
            reproject::rescale(gpu, &mut work, &scene, &frame, old, before)?;
            work.submit(ctx.timings, interrupt)?;
        }
        frame.sheet_rows = height;
        let mut follows = last.is_some() && frame.cloudless == 0;
        if follows {
            let past = History { clouds: before, scene: scene_before };
            let pace = (&mut self.march_pace, &mut self.reproject_pace);
            follows = follow(&mut ctx, &scene, &frame, quality, index, pace, refined, current, &past, now)?;
        }
        if !follows && frame.cloudless == 0 {
            let mut still = frame.of_known();
            march_sheet(&mut ctx, &scene, &mut still, quality, &mut self.march_pace, refined, &now.marched)?;
            still.lattice = refine::coarsest(&still, quality);
            scene.uniforms.upload_frame(gpu, &still);
            let mut work = gpu.work();
            reproject::begin(gpu, &mut work, &scene, &still, now)?;
            work.submit(ctx.timings, interrupt)?;
        }
        frame.rows = height;
        let parts = Parts { marched: &now.marched, backdrop, refined, out: composed };
        let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
        let by_cells = Method::March.by_cells(&frame, quality);
        compose_sheet(&mut ctx, &scene, &mut frame, params, &mut self.pixel_pace, &parts, by_cells, false)?;
        let mut work = gpu.work();
        if let Some(screen) = screen {
            frame.first_row = 0;
            frame.rows = height;
            scene.uniforms.upload_frame(gpu, &frame);
            display::run(gpu, &mut work, &scene, &frame, composed, screen)?;
        } else {
            work.download(&composed.image, 0, 16 * pixels);
        }
        let downloads = work.submit(timings, interrupt)?;
        let image = downloads.first().map_or(Vec::new(), |image| image.numbers().to_vec());

        gpu.pipelines.store();
        mem::swap(&mut animation.before, &mut animation.now);
        let seen = has.map(<[f32]>::to_vec);
        animation.last = Some(Shot { camera: *camera, params: params.clone(), time, frame, scene: seen, index });
        Ok(image)
    }

    /// A still, or, of the same shot again, a better one.
    fn refine(
        &mut self,
        camera: &Camera,
        params: &Params,
        time: f64,
        background: bool,
        scene_depth: Option<SceneDepth<'_>>,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        let seen = |last: &Refining| match (&last.scene, &scene_depth) {
            (Some((distance, color)), Some(scene)) => *distance == scene.distance && color.as_deref() == scene.color,
            (last, now) => last.is_none() && now.is_none(),
        };
        let same = |last: &Refining| {
            (last.camera, last.time, last.background) == (*camera, time, background)
                && last.params == *params
                && seen(last)
        };
        let last = self.refining.take().filter(same);
        let count = last.as_ref().map_or(0, |last| last.count);
        let image = match last {
            // What has converged stays.
            Some(last) if params.light.model != Model::Path => last.image,
            last => {
                let first_sample = count.wrapping_mul(self.quality.path_samples);
                let fresh =
                    self.still(camera, params, time, background, false, first_sample, scene_depth, interrupt)?.image;
                let share = 1.0 / (count as f32 + 1.0);
                match last {
                    Some(last) => last.image.iter().zip(&fresh).map(|(old, new)| old + share * (new - old)).collect(),
                    None => fresh,
                }
            }
        };
        let refining = Refining {
            camera: *camera,
            params: params.clone(),
            time,
            background,
            scene: scene_depth.map(|scene| (scene.distance.to_vec(), scene.color.map(<[f32]>::to_vec))),
            image: image.clone(),
            count: count + 1,
        };
        self.refining = Some(refining);
        Ok(image)
    }

    /// How much each pixel of the last frame of [`Renderer::animate`] rests on, row by row, from 1, a guess from the rays
    /// around it in that frame alone, to [`ROUND`], a ray of its own that has been followed since; between those, the mean of guesses
    /// in so many frames. Empty where no frame was reprojected or could be: before the first, after a cut, without clouds, and
    /// where frames converge or are traced.
    pub fn history_length(&mut self) -> Result<Vec<u32>> {
        check_fork()?;
        let Some(animation) = self.animation.as_ref().filter(|animation| {
            animation.size == self.size && animation.last.as_ref().is_some_and(|last| last.frame.cloudless == 0)
        }) else {
            return Ok(Vec::new());
        };
        let [width, height] = animation.size;
        let [columns, rows] = refine::known(animation.size, animation.sparse);
        let mut work = self.gpu.work();
        work.download(&animation.before.length, 0, 4 * count([columns, rows]));
        let lengths = work.submit(&mut Timings::default(), &|| Ok(()))?;
        let lengths: &[u32] = lengths[0].numbers();
        let spacing = refine::spacing(animation.sparse);
        let unit = ROUND / reproject::round(animation.sparse);
        let at = |x: u32, y: u32| unit * lengths[(y / spacing * columns + x / spacing) as usize];
        Ok((0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect())
    }

    /// Forgets the frame before: the next one of [`Renderer::animate`] is a still.
    pub fn cut(&mut self) {
        self.forget();
        self.moonlit.iter_mut().for_each(|lit| lit.forget());
    }

    fn forget(&mut self) {
        self.refining = None;
        self.going = Going::default();
        if let Some(animation) = &mut self.animation {
            animation.last = None;
        }
    }

    /// Extinction in 1/m at world points: the field that [`Renderer::render`] marches.
    pub fn density(
        &mut self,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        self.ask("extinction_at_points", at, params, time, interrupt)
    }

    /// The share of direct sunlight that reaches world points through the clouds; 0 where the ground hides the sun.
    pub fn sun_transmittance(
        &mut self,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        self.ask("sun_transmittance_at_points", at, params, time, interrupt)
    }

    /// The optical depth of all clouds from an eye along directions; -1 where the ground is in the way.
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
        let kernel = self.gpu.kernel("points", "depth_along_directions", Variant::new(params, &self.quality))?;
        let answers = self.run_points(&kernel, &camera, &points, params, time, points::CHUNK, interrupt)?;
        Ok(answers.iter().map(|answer| answer[0]).collect())
    }

    fn ask(
        &mut self,
        entry: &str,
        at: &[[f64; 3]],
        params: &Params,
        time: f64,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        check_fork()?;
        let Some(first) = at.first() else { return Ok(Vec::new()) };
        // Positions go to the GPU relative to the first: f32 keeps millimetres a few kilometres around it.
        let eye = DVec3::from_array(*first);
        let camera = Camera::equirect(eye)?;
        let offset = |p: &[f64; 3]| (DVec3::from_array(*p) - eye).as_vec3().extend(0.0).to_array();
        let points: Vec<_> = at.iter().map(offset).collect();
        let kernel = self.gpu.kernel("points", entry, Variant::new(params, &self.quality))?;
        let answers = self.run_points(&kernel, &camera, &points, params, time, points::CHUNK, interrupt)?;
        Ok(answers.iter().map(|answer| answer[0]).collect())
    }

    /// The share of direct sunlight that reaches a level square at an `altitude` around `center`: `size` by `size` numbers,
    /// row 0 in the north. `extent` is its side, m.
    #[expect(clippy::too_many_arguments, reason = "where and how fine the map is")]
    pub fn shadow_map(
        &mut self,
        params: &Params,
        time: f64,
        center: [f64; 2],
        altitude: f64,
        extent: f64,
        size: u32,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<f32>> {
        if !(1..=MOST_SHADOW).contains(&size) {
            return Err(Error::parameter("size", size, format!("a whole number from 1 to {MOST_SHADOW}")));
        }
        // Written so that NaN fails it.
        if !(1.0..=1e7).contains(&extent) {
            return Err(Error::parameter("extent", extent, "from 1 to 10000000 m"));
        }
        if !(-1e5..=1e5).contains(&altitude) {
            return Err(Error::parameter("altitude", altitude, "from -100000 to 100000 m"));
        }
        if let Some(place) = center.into_iter().find(|v| !(-1e8..=1e8).contains(v)) {
            return Err(Error::parameter("center", place, "2 numbers from -100000000 to 100000000 m"));
        }
        let camera = Camera::equirect(DVec3::new(center[0], center[1], altitude))?;
        let (frame, params) = self.begin(&camera, params, time)?;
        let params = &params;
        let Self { gpu, world, quality, timings, .. } = self;
        let scene = world.run(gpu, params, &frame, (camera.eye, time), quality, timings, interrupt)?;
        let shadow_texel = (extent / f64::from(size)) as f32;
        let mut frame = Frame { width: size, height: size, march_width: size, sheet_rows: size, shadow_texel, ..frame };
        let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
        let room = shadow::room(gpu, size);
        let mut map = Vec::with_capacity(size as usize * size as usize);
        in_bands(&mut self.shadow_pace, gpu, &scene, &mut frame, [size, size], |frame| {
            map.extend(shadow::map(&mut ctx, &scene, frame, &room)?);
            Ok(())
        })?;
        Ok(map)
    }

    /// The weather map as the march reads it, baked, the user's own or mixed: its width and height in texels, and three
    /// numbers for each of them, coverage, type and precipitation, row 0 in the north.
    pub fn weather_map(&mut self, params: &Params, interrupt: Interrupt<'_>) -> Result<([u32; 2], Vec<f32>)> {
        let (frame, params) = self.begin(&Camera::equirect(DVec3::ZERO)?, params, 0.0)?;
        let params = &params;
        let Self { gpu, world, quality, timings, .. } = self;
        world.uniforms.upload(gpu, params, &frame, quality);
        let mut ctx = Context { gpu, uniforms: &world.uniforms, variant: Variant::bake(), timings, interrupt };
        let texture = world.weather.texture(&mut ctx, params)?;
        let mut work = gpu.work();
        work.download_texture(&texture);
        let downloads = work.submit(timings, interrupt)?;
        let (width, height) = (texture.width() as usize, texture.height() as usize);
        let halves: &[half::f16] = downloads[0].numbers();
        // Rows are padded.
        let rows = halves.chunks_exact(halves.len() / height).map(|row| &row[..4 * width]);
        let texels = rows.flat_map(|row| row.chunks_exact(4));
        let numbers = texels.flat_map(|texel| [texel[0], texel[1], texel[2]]).map(half::f16::to_f32);
        Ok(([texture.width(), texture.height()], numbers.collect()))
    }

    /// The value of a WGSL `expression` of `x: vec4f` for each input, with the shaders named by `imports` in scope and
    /// the eye at the origin: how tests reach single shader functions.
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
        let linked =
            Linked::from_source(&source).map_err(|error| Error::parameter("imports", error, "shader names"))?;
        let kernel = Kernel::from_linked(&self.gpu, &linked, "probe", Variant::new(params, &self.quality))?;
        let camera = Camera::equirect(eye)?;
        // At once, so that what is timed fills the device.
        self.run_points(&kernel, &camera, inputs, params, time, 1 << 20, interrupt)
    }

    #[expect(clippy::too_many_arguments, reason = "what answers depend on, and how many are asked at once")]
    fn run_points(
        &mut self,
        kernel: &Kernel,
        camera: &Camera,
        points: &[[f32; 4]],
        params: &Params,
        time: f64,
        most: usize,
        interrupt: Interrupt<'_>,
    ) -> Result<Vec<[f32; 4]>> {
        let (frame, params) = self.begin(camera, params, time)?;
        let params = &params;
        let Self { gpu, world, quality, timings, .. } = self;
        let scene = world.run(gpu, params, &frame, (camera.eye, time), quality, timings, interrupt)?;
        let mut ctx = Context { gpu, uniforms: scene.uniforms, variant: scene.variant, timings, interrupt };
        points::run(&mut ctx, &scene, &frame, kernel, points, most)
    }

    /// Checks the arguments of a call and works out its frame, and its sky, in which what wanders has its value.
    fn begin(&mut self, camera: &Camera, params: &Params, time: f64) -> Result<(Frame, Params)> {
        check_fork()?;
        params.check()?;
        if !time.is_finite() {
            return Err(Error::parameter("time", time, "a finite number of seconds"));
        }
        self.timings = Timings::default();
        let params = params.at(time);
        let mut frame = Frame::new(camera, &params, time, self.size);
        frame.most_rays = self.quality.most_rays();
        Ok((frame, params))
    }
}

/// Everything that a march can read, on the GPU.
struct World {
    uniforms: Uniforms,
    blue_noise: wgpu::TextureView,
    noise: Option<Arc<Noise>>,
    weather: Weather,
    broad_weather: BroadWeather,
    profile: Profile,
    phase: PhaseTable,
    high_clouds: HighClouds,
    transmittance: Transmittance,
    multiscatter: Multiscatter,
    sky: Sky,
    volume: Volume,
    majorants: Majorants,
    ground_shadow: GroundShadow,
    beams: Beams,
    scene_depth: SceneTextures,
    /// Names and bytes of all of it, as it was bound last.
    memory: Vec<(&'static str, u64)>,
}

impl Picture {
    /// The picture of the same sky by the light of both.
    fn and(mut self, other: &Self) -> Self {
        add_light(&mut self.image, &other.image);
        add_light(&mut self.sky, &other.sky);
        self.samples.iter_mut().zip(&other.samples).for_each(|(sum, more)| *sum += more);
        // Both have the same paths, so that their errors may be of one sign.
        self.uncertainty.iter_mut().zip(&other.uncertainty).for_each(|(sum, more)| *sum += more);
        self
    }
}

/// Adds the light of another picture of the same sky, whose alpha is the same.
fn add_light(image: &mut [f32], other: &[f32]) {
    for (sum, more) in image.chunks_exact_mut(4).zip(other.chunks_exact(4)) {
        sum[..3].iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
}

/// The radiance of the user's scene where another picture has it already: none.
fn black(scene: Option<SceneDepth<'_>>, known: bool) -> Option<Vec<f32>> {
    scene.and_then(|scene| scene.color).filter(|_| known).map(|color| vec![0.0; color.len()])
}

/// The scene, of another radiance where there is one.
fn scene_of<'a>(scene: Option<SceneDepth<'a>>, color: Option<&'a [f32]>) -> Option<SceneDepth<'a>> {
    scene.map(|scene| SceneDepth { distance: scene.distance, color: color.or(scene.color) })
}

impl World {
    fn new(gpu: &Gpu) -> Self {
        let side = blue_noise::SIZE as u32;
        let texture = gpu.texture("blue_noise", [side, side, 1], 1);
        let texels: Vec<_> = blue_noise::TILE.iter().map(|v| [half::f16::from_f32(*v); 4]).collect();
        gpu.write_texture(&texture, &texels);
        Self {
            uniforms: Uniforms::new(gpu),
            blue_noise: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            noise: None,
            weather: Weather::new(),
            broad_weather: BroadWeather::new(),
            profile: Profile::new(),
            phase: PhaseTable::new(),
            high_clouds: HighClouds::new(),
            transmittance: Transmittance::new(),
            multiscatter: Multiscatter::new(),
            sky: Sky::new(),
            volume: Volume::new(),
            majorants: Majorants::new(),
            ground_shadow: GroundShadow::new(),
            beams: Beams::new(),
            scene_depth: SceneTextures::new(gpu, 0, false),
            memory: Vec::new(),
        }
    }

    /// Uploads the uniforms and bakes what has changed, as seen from a place at a time.
    #[expect(clippy::too_many_arguments, reason = "what a scene depends on")]
    fn run(
        &mut self,
        gpu: &Gpu,
        params: &Params,
        frame: &Frame,
        at: (DVec3, f64),
        quality: &Quality,
        timings: &mut Timings,
        interrupt: Interrupt<'_>,
    ) -> Result<Scene<'_>> {
        self.uniforms.upload(gpu, params, frame, quality);
        let variant = Variant::of_frame(params, quality, frame);
        let mut ctx = Context { gpu, uniforms: &self.uniforms, variant: Variant::bake(), timings, interrupt };

        let noise = Noise::run(&mut ctx, params, self.noise.as_ref())?; // once for a seed and a finer detail
        let noise = self.noise.insert(noise);
        let weather = self.weather.run(&mut ctx, params)?; // when its block or the mixture changes
        let broad_weather = self.broad_weather.run(&mut ctx, params)?; // when the larger map or its shares change
        let profile = self.profile.run(&ctx, params)?; // once for a table
        let phase = self.phase.run(&ctx, params)?; // once for a droplet
        let high_clouds = self.high_clouds.run(&mut ctx, params, frame)?; // as they evolve
        let mut air = self.transmittance.run(&mut ctx, params)?; // when the air changes
        let multiscatter = self.multiscatter.run(&mut ctx, params, &air)?; // when the air or the ground change
        air.extend(multiscatter);
        let sky = self.sky.run(&mut ctx, params, frame, at.0, &air)?; // when sun or air change, or the eye has gone far

        ctx.variant = variant; // those so far know no picture
        let volume = self.volume.run(&ctx, params)?; // once for a grid

        let blue_noise = vec![("blue_noise", (&self.blue_noise).into())];
        let uniforms = self.uniforms.bindings();
        let mut bindings: Bindings<'_> = [
            uniforms,
            noise.bindings(),
            weather,
            broad_weather,
            profile,
            phase,
            high_clouds,
            air,
            sky,
            volume,
            blue_noise,
        ]
        .concat();
        let majorants = self.majorants.run(&mut ctx, params, &bindings)?; // when paths are traced
        bindings.extend(majorants);
        let ground_shadow = self.ground_shadow.run(&mut ctx, params, frame, at, &bindings)?; // as those, where it is seen
        bindings.extend(ground_shadow);
        let beams = self.beams.run(&mut ctx, params, frame, at, &bindings)?; // as those and the view, where they shade air
        bindings.extend(beams);
        bindings.extend(self.scene_depth.bindings());
        let held = bindings.iter().filter(|(_, binding)| !matches!(binding, Binding::Sampler(_)));
        self.memory = held.map(|(name, binding)| (*name, binding.bytes())).collect();
        Ok(Scene { uniforms: &self.uniforms, variant, bindings, scene_depth: &self.scene_depth })
    }
}

impl Still {
    fn new(gpu: &Gpu, size: [u32; 2], method: Method, sparse: bool) -> Self {
        let [pixels, known] = [size, refine::known(size, sparse)].map(count);
        let ray_bytes = match method {
            Method::March => None,
            Method::Reference => Some(reference::RAY_BYTES),
            Method::Path => Some(path::RAY_BYTES),
        };
        Self {
            size,
            method,
            sparse,
            refined: Refined::new(gpu, known),
            marched: Marched::new(gpu, known),
            composed: Composed::new(gpu, pixels),
            backdrop: Backdrop::new(gpu, size),
            rays: ray_bytes.map(|bytes| Rays::new(gpu, pixels, bytes)),
        }
    }

    /// Whether a sheet has room in them.
    fn holds(&self, [width, rows]: [u32; 2], method: Method, sparse: bool) -> bool {
        (self.size[0], self.method, self.sparse) == (width, method, sparse) && self.size[1] >= rows
    }
}

fn count(size: [u32; 2]) -> u64 {
    size.map(u64::from).iter().product()
}

/// A number for each pixel of a part of a sparse picture: where it is known, one of `numbers`, which has so many columns, and
/// none between.
fn at_known(numbers: &[u32], columns: u32, [width, height]: [u32; 2]) -> impl Iterator<Item = u32> {
    let place = move |x: u32, y: u32| (y / COARSEST * columns + x / COARSEST) as usize;
    let known = |x: u32, y: u32| x.is_multiple_of(COARSEST) && y.is_multiple_of(COARSEST);
    (0..height).flat_map(move |y| (0..width).map(move |x| if known(x, y) { numbers[place(x, y)] } else { 0 }))
}

impl Animation {
    fn new(gpu: &Gpu, size: [u32; 2], sparse: bool) -> Self {
        let known = refine::known(size, sparse);
        let cells = reproject::cells(known, sparse);
        let [known, cells] = [known, cells].map(count);
        Self {
            size,
            sparse,
            refined: Refined::new(gpu, known),
            current: Current::new(gpu, cells),
            before: Followed::new(gpu, known),
            now: Followed::new(gpu, known),
            composed: Composed::new(gpu, count(size)),
            backdrop: Backdrop::new(gpu, size),
            scene_before: SceneTextures::new(gpu, 0, false),
            last: None,
        }
    }
}

impl Shot {
    /// Whether what was seen before says nothing about what is seen now.
    fn is_cut(&self, camera: &Camera, params: &Params, time: f64) -> bool {
        let (old, new) = (&self.params, params);
        let turned = camera.forward.dot(self.camera.forward) < 0.8 || camera.up.dot(self.camera.up) < 0.8;
        let jumped = camera.eye.distance(self.camera.eye) > 2000.0 || (time - self.time).abs() > 300.0;
        camera.projection != self.camera.projection
            || (camera.fov / self.camera.fov).ln().abs() > 0.2
            || turned
            || jumped
            || (old.clouds.seed, old.clouds.noise) != (new.clouds.seed, new.clouds.noise)
            || (old.weather.extent, old.weather.edge) != (new.weather.extent, new.weather.edge)
            || old.weather.broad_extent != new.weather.broad_extent
            || weather_change(old, new) > MOST_WEATHER_CHANGE
            || old.volume != new.volume
            || (old.light.model, old.light.phase) != (new.light.model, new.light.phase)
            || old.atmosphere.planet_radius != new.atmosphere.planet_radius
    }
}

/// Largest share of the weather map that may change from one frame to the next without a cut: a third within the sixteen
/// frames in which every pixel is marched anew. A change in thirty seconds (thesis2018) is that slow from two frames a
/// second on.
const MOST_WEATHER_CHANGE: f32 = 0.02;

/// The share of the weather map that is another.
fn weather_change(old: &Params, new: &Params) -> f32 {
    let old = old.weather_shares();
    let kept = |(weather, share): (params::Weather, f32)| {
        old.iter().find(|(before, _)| *before == weather).map_or(0.0, |(_, before)| before.min(share))
    };
    1.0 - new.weather_shares().into_iter().map(kept).sum::<f32>()
}

fn check_size([width, height]: [u32; 2]) -> Result<()> {
    for (name, value) in [("width", width), ("height", height)] {
        if !(1..=65536).contains(&value) {
            return Err(Error::parameter(name, value, "a whole number from 1 to 65536 pixels"));
        }
    }
    Ok(())
}

/// Most texels along a side of the user's shadow map.
const MOST_SHADOW: u32 = 8192;

/// What a submission should take, in seconds: short enough for every GPU's watchdog and for Ctrl-C, long enough that
/// submitting costs nothing.
const BAND_SECONDS: f64 = 0.1;
/// Most pixels of a sheet, which is as much of a still as the device holds: 64 bytes each.
const SHEET_PIXELS: u32 = 1 << 20;
/// Most rays that are on their way together where they take many dispatches.
const SHEET_RAYS: u32 = 1 << 14;

/// Most rows of what the buffers of a sheet hold.
fn largest_sheet(size: [u32; 2], method: Method) -> u32 {
    let shared = u32::from(method == Method::March);
    sheets(size, method).map(|sheet| sheet.len() as u32 + shared).max().unwrap_or(1)
}

/// The rows of each sheet of a still.
fn sheets([width, height]: [u32; 2], method: Method) -> impl Iterator<Item = Range<u32>> {
    let rows = match method {
        Method::March => (SHEET_PIXELS / width).next_multiple_of(COARSEST),
        Method::Reference | Method::Path => SHEET_RAYS / width,
    };
    let rows = rows.clamp(1, height);
    (0..height).step_by(rows as usize).map(move |row| row..(row + rows).min(height))
}

/// Marches a sheet of a still: the pixels of a lattice, then those between rays that do not look alike, or all of them.
fn march_sheet(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &mut Frame,
    quality: &Quality,
    pace: &mut Pace,
    refined: &Refined,
    out: &Marched,
) -> Result<()> {
    let (gpu, interrupt) = (ctx.gpu, ctx.interrupt);
    if !refine::is_needed(frame, quality) {
        let size = [frame.march_width, frame.sheet_row + frame.sheet_rows];
        return in_bands(pace, gpu, scene, frame, size, |frame| {
            let mut work = gpu.work();
            march::run(gpu, &mut work, scene, frame, out)?;
            work.submit(ctx.timings, interrupt).map(drop)
        });
    }
    let mut frame = frame.clone();
    frame.lattice = refine::coarsest(&frame, quality);
    let mut rays = refined.begin(gpu, &frame);
    loop {
        march_listed(ctx, scene, &mut frame, rays, pace, refined, out)?;
        if frame.lattice == 1 {
            return Ok(());
        }
        scene.uniforms.upload_frame(gpu, &frame);
        let mut work = gpu.work();
        refine::run(gpu, &mut work, scene, &frame, refined, out)?;
        work.download(&refined.count, 0, 4);
        rays = work.submit(ctx.timings, interrupt)?[0].numbers()[0];
        frame.lattice /= 2;
        frame.spans = 1;
    }
}

/// Largest share of the pixels of a frame that are marched one by one: a still, which marches an eighth to a fifth of them, is
/// nearer to the truth then and takes no longer.
const MOST_LISTED: f32 = 1.0 / 12.0;

/// Makes a frame of rays of its own, one in each cell, and of the frame before. Returns whether that was worth while: if not,
/// `now` is not filled.
#[expect(clippy::too_many_arguments, reason = "what a frame is made of")]
fn follow(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    quality: &Quality,
    index: u32,
    (march_pace, reproject_pace): (&mut Pace, &mut Pace),
    refined: &Refined,
    current: &Current,
    past: &History<'_>,
    now: &Followed,
) -> Result<bool> {
    let (gpu, interrupt) = (ctx.gpu, ctx.interrupt);
    let sparse = frame.sparse > 0;
    let mut cells = frame.clone();
    cells.stride = reproject::stride(sparse) * refine::spacing(sparse);
    [cells.subpixel_x, cells.subpixel_y] = reproject::subpixel(index, sparse);
    [cells.march_width, cells.sheet_rows] = reproject::cells(frame.known(), sparse);
    march_sheet(ctx, scene, &mut cells, quality, march_pace, refined, &current.marched)?;

    let mut votes = 0;
    let mut rays = 0;
    in_bands(reproject_pace, gpu, scene, &mut cells, frame.known(), |cells| {
        let mut work = gpu.work();
        let first = cells.first_row == 0;
        if first {
            work.clear(&refined.count);
            reproject::validate(gpu, &mut work, scene, cells, current, past, refined)?;
            work.download(&refined.count, 0, 4);
            work.clear(&refined.count);
        }
        reproject::run(gpu, &mut work, scene, cells, current, past, refined, now)?;
        work.download(&refined.count, 0, 4);
        let counts = work.submit(ctx.timings, interrupt)?;
        let counts: Vec<u32> = counts.iter().map(|count| count.numbers()[0]).collect();
        if first {
            votes = counts[0].cast_signed();
        }
        rays = counts[counts.len() - 1];
        Ok(())
    })?;
    // What neither rays nor past say anything about.
    let mut listed = frame.of_known();
    let most = MOST_LISTED * count(frame.known()) as f32;
    if votes > 0 || (refine::is_needed(&listed, quality) && rays as f32 > most) {
        return Ok(false);
    }
    march_listed(ctx, scene, &mut listed, rays, march_pace, refined, &now.marched)?;
    Ok(true)
}

/// Marches the first `rays` pixels of a list.
fn march_listed(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &mut Frame,
    rays: u32,
    pace: &mut Pace,
    refined: &Refined,
    out: &Marched,
) -> Result<()> {
    let (gpu, interrupt) = (ctx.gpu, ctx.interrupt);
    in_list(pace, gpu, scene, frame, rays, |frame| {
        let mut work = gpu.work();
        march::run_list(gpu, &mut work, scene, frame, refined, out)?;
        work.submit(ctx.timings, interrupt).map(drop)
    })
}

/// Composes the sheet of `frame`: cells, then the pixels of those that are not smooth, or all of them; then those in which a disc
/// of light is seen.
#[expect(clippy::too_many_arguments, reason = "what a picture is composed of")]
fn compose_sheet(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &mut Frame,
    params: &Params,
    pace: &mut Pace,
    parts: &Parts<'_>,
    by_cells: bool,
    layers: bool,
) -> Result<()> {
    let discs = frame.disc_pixels(params);
    compose_all(ctx, scene, frame, pace, parts, by_cells, layers)?;
    for [first_column, first_row, columns, rows] in discs {
        let frame = Frame { first_column, first_row, columns, rows, ..frame.clone() };
        scene.uniforms.upload_frame(ctx.gpu, &frame);
        let mut work = ctx.gpu.work();
        composite::run_discs(ctx.gpu, &mut work, scene, &frame, parts, layers)?;
        work.submit(ctx.timings, ctx.interrupt)?;
    }
    Ok(())
}

/// The same but for discs.
fn compose_all(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &mut Frame,
    pace: &mut Pace,
    parts: &Parts<'_>,
    by_cells: bool,
    layers: bool,
) -> Result<()> {
    let (gpu, interrupt) = (ctx.gpu, ctx.interrupt);
    if !by_cells {
        let size = [frame.width, frame.sheet_row + frame.rows];
        return in_bands(pace, gpu, scene, frame, size, |frame| {
            let mut work = gpu.work();
            composite::run(gpu, &mut work, scene, frame, parts, layers)?;
            work.submit(ctx.timings, interrupt).map(drop)
        });
    }
    // All at once: the corners are few, and a cell costs little.
    scene.uniforms.upload_frame(gpu, frame);
    let mut work = gpu.work();
    composite::run_cells(gpu, &mut work, scene, frame, parts, layers)?;
    work.download(&parts.refined.count, 0, 4);
    let cells: u32 = work.submit(ctx.timings, interrupt)?[0].numbers()[0];
    in_list(pace, gpu, scene, frame, cells * TILE * TILE, |frame| {
        let mut work = gpu.work();
        composite::run_list(gpu, &mut work, scene, frame, parts, layers)?;
        work.submit(ctx.timings, interrupt).map(drop)
    })
}

/// How many pixels a second buys, from the bands so far.
#[derive(Clone, Copy)]
struct Pace {
    pixels_per_second: f64,
}

impl Pace {
    const fn new(pixels_per_second: f64) -> Self {
        Self { pixels_per_second }
    }

    /// Pixels of the next band: whole workgroups.
    fn pixels(self) -> u32 {
        let pixels = (self.pixels_per_second * BAND_SECONDS) as u32;
        pixels.clamp(64, SHEET_PIXELS) / 64 * 64
    }

    /// Rows of the next band: whole workgroups, at most `left`.
    fn rows(self, width: u32, left: u32) -> u32 {
        let rows = self.pixels() / width / 8 * 8;
        rows.max(8).min(left)
    }

    fn learn(&mut self, pixels: u64, started: Instant) {
        let seen = pixels as f64 / started.elapsed().as_secs_f64().max(1e-6);
        self.pixels_per_second = seen.clamp(self.pixels_per_second / 4.0, self.pixels_per_second * 4.0);
    }
}

/// Runs `submit` for part after part of a list of so many pixels.
fn in_list(
    pace: &mut Pace,
    gpu: &Gpu,
    scene: &Scene<'_>,
    frame: &mut Frame,
    pixels: u32,
    mut submit: impl FnMut(&Frame) -> Result<()>,
) -> Result<()> {
    frame.first_ray = 0;
    while frame.first_ray < pixels {
        frame.active_rays = pace.pixels().min(pixels - frame.first_ray);
        scene.uniforms.upload_frame(gpu, frame);
        let started = Instant::now();
        submit(frame)?;
        pace.learn(u64::from(frame.active_rays), started);
        frame.first_ray += frame.active_rays;
    }
    Ok(())
}

/// Runs `submit` for band after band of a sheet, from the row where it begins to that where it ends.
fn in_bands(
    pace: &mut Pace,
    gpu: &Gpu,
    scene: &Scene<'_>,
    frame: &mut Frame,
    [width, end]: [u32; 2],
    mut submit: impl FnMut(&Frame) -> Result<()>,
) -> Result<()> {
    frame.first_row = frame.sheet_row;
    while frame.first_row < end {
        frame.rows = pace.rows(width, end - frame.first_row);
        scene.uniforms.upload_frame(gpu, frame);
        let started = Instant::now();
        submit(frame)?;
        pace.learn(u64::from(width) * u64::from(frame.rows), started);
        frame.first_row += frame.rows;
    }
    Ok(())
}
