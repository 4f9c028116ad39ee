//! Makes the pictures on a thread of its own, so that the window never waits for one.

use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use clouds_core::color::Metering;
use clouds_core::gpu::Timings;
use clouds_core::params::Weather;
use clouds_core::picture::Picture;
use clouds_core::schema::Map;
use clouds_core::{Camera, Error, Gpu, Params, Quality, Renderer, Result, Screen, Shot, color, files};

use crate::resolution::Resolution;
use crate::sight::{Sight, error_pixels, history_pixels, pixels_of};

/// How long everything has to stand still before it is rendered at its best.
const REST: Duration = Duration::from_millis(300);
/// How many times the pixels of the view are as wide where they are compared with `reference`.
const TRUTH_SHARE: u32 = 4;
/// Pixels of a panorama.
const PANORAMA: [u32; 2] = [4096, 2048];

/// What is to be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// From where.
    pub camera: Camera,
    /// The sky.
    pub params: Params,
    /// Its time, s.
    pub time: f64,
    /// The method of stills.
    pub quality: Quality,
    /// Pixels of the view.
    pub window: [u32; 2],
    /// Stops.
    pub exposure: f32,
    /// One of [`clouds_core::color::TONE_MAPS`].
    pub tone_map: &'static str,
    /// How long a moving picture may take; without, it has all pixels.
    pub wanted: Option<Duration>,
    /// What of it is shown.
    pub sight: Sight,
    /// Another sky or method that is shown beside it at rest.
    pub beside: Option<(Params, Quality)>,
    /// Where moving pictures are kept, one file each.
    pub record: Option<PathBuf>,
}

/// A picture that is ready.
#[derive(Clone)]
pub struct Shown {
    /// Where it is.
    pub screen: Arc<Screen>,
    /// Where what is beside it is.
    pub beside: Option<Arc<Screen>>,
    /// What it is of.
    pub wish: Arc<Wish>,
    /// The whole of a still.
    pub still: Option<Arc<Picture>>,
    /// Its automatic exposure, stops, where it is one of [`Sight::Picture`].
    pub metered: Option<f32>,
    /// How long it took.
    pub took: Duration,
    /// Where the time went on the device.
    pub timings: Timings,
    /// The weather map that was in the sky when it was last at rest.
    pub map: Option<Arc<Map>>,
    /// How many pictures there have been.
    pub count: u64,
}

#[derive(Default)]
struct Inbox {
    wish: Option<Arc<Wish>>,
    number: u64,
    /// Where a panorama of what is wished for goes.
    panorama: Option<PathBuf>,
    /// Whether the shaders have changed.
    reload: bool,
    closed: bool,
}

#[derive(Default)]
struct Outbox {
    shown: Option<Shown>,
    written: Option<PathBuf>,
    problem: Option<Error>,
}

struct Shared {
    inbox: Mutex<Inbox>,
    changed: Condvar,
    outbox: Mutex<Outbox>,
    notify: Box<dyn Fn() + Send + Sync>,
}

/// The thread that makes pictures; it ends with this.
pub struct Painter {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

// No panic leaves what is behind a lock half written.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Painter {
    /// Starts it; `notify` is called from it when a picture or a problem has come.
    pub fn new(gpu: Arc<Gpu>, adapter: Option<String>, notify: impl Fn() + Send + Sync + 'static) -> Self {
        let shared = Arc::new(Shared {
            inbox: Mutex::default(),
            changed: Condvar::new(),
            outbox: Mutex::default(),
            notify: Box::new(notify),
        });
        let inner = shared.clone();
        let thread = thread::spawn(move || {
            let work = || Work::new(&gpu, adapter.as_deref())?.run(&inner);
            let ended = catch_unwind(AssertUnwindSafe(work));
            let problem = match ended {
                Ok(Ok(())) => return,
                Ok(Err(error)) => error,
                Err(_) => Error::Device("internal error, please report it".into()),
            };
            lock(&inner.outbox).problem = Some(problem);
            (inner.notify)();
        });
        Self { shared, thread: Some(thread) }
    }

    /// Asks for another picture; what is being made of an earlier still is dropped.
    pub fn ask(&self, wish: Wish) {
        let mut inbox = lock(&self.shared.inbox);
        if inbox.wish.as_deref() == Some(&wish) {
            return;
        }
        inbox.wish = Some(Arc::new(wish));
        inbox.number += 1;
        drop(inbox);
        self.shared.changed.notify_all();
    }

    /// Asks for a panorama of the sky that is wished for, in a file of linear radiance (EXR) and one to look at beside it (PNG).
    pub fn ask_panorama(&self, path: PathBuf) {
        let mut inbox = lock(&self.shared.inbox);
        inbox.panorama = Some(path);
        inbox.number += 1;
        drop(inbox);
        self.shared.changed.notify_all();
    }

    /// Says that the shaders have changed.
    pub fn reload(&self) {
        let mut inbox = lock(&self.shared.inbox);
        inbox.reload = true;
        inbox.number += 1;
        drop(inbox);
        self.shared.changed.notify_all();
    }

    /// The panorama that was written since it was asked last.
    pub fn written(&self) -> Option<PathBuf> {
        lock(&self.shared.outbox).written.take()
    }

    /// The last picture.
    pub fn shown(&self) -> Option<Shown> {
        lock(&self.shared.outbox).shown.clone()
    }

    /// What went wrong since it was asked last: [`Error::Parameter`] can be mended, others end the pictures.
    pub fn problem(&self) -> Option<Error> {
        lock(&self.shared.outbox).problem.take()
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        lock(&self.shared.inbox).closed = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What came of a wish.
struct Made {
    screen: Arc<Screen>,
    beside: Option<Arc<Screen>>,
    still: Option<Arc<Picture>>,
    metered: Option<f32>,
    timings: Timings,
}

/// A still that needs no rendering to be shown by another exposure or tone map.
struct Rested {
    wish: Wish,
    picture: Arc<Picture>,
    beside: Option<Picture>,
    metered: f32,
    timings: Timings,
}

/// What the thread has.
struct Work<'a> {
    gpu: &'a Gpu,
    /// One has what the last frame has left behind, the other does not disturb it.
    moving: Renderer,
    still: Renderer,
    resolution: Resolution,
    /// One is shown while the other is painted.
    screens: [Option<Arc<Screen>>; 2],
    /// The last still.
    rested: Option<Arc<Rested>>,
    /// The last weather map, and whose it is.
    map: Option<(Weather, Arc<Map>)>,
    count: u64,
}

impl<'a> Work<'a> {
    fn new(gpu: &'a Gpu, adapter: Option<&str>) -> Result<Self> {
        let renderer = || Renderer::new(16, 16, Quality::named("draft")?, adapter);
        let share = if gpu.info.kind == "cpu" { 0.45 } else { 1.0 };
        let [moving, still] = [renderer()?, renderer()?];
        Ok(Self {
            gpu,
            moving,
            still,
            resolution: Resolution::new(share),
            screens: [None, None],
            rested: None,
            map: None,
            count: 0,
        })
    }

    fn run(&mut self, shared: &Shared) -> Result<()> {
        let mut done = 0;
        loop {
            let Some((wish, number)) = next(shared, done, None) else { return Ok(()) };
            done = number;
            if mem::take(&mut lock(&shared.inbox).reload) {
                self.rested = None;
                self.grant(shared, |work| work.gpu.reload_shaders())?;
            }
            self.grant(shared, |work| work.panorama(shared, &wish))?;
            self.publish(shared, &wish, number, false)?;
            // Until something moves again.
            match next(shared, done, Some(REST)) {
                None => return Ok(()),
                Some((_, number)) if number != done => {}
                Some((wish, _)) if self.rested(&wish).is_some() => {}
                Some((wish, number)) => self.publish(shared, &wish, number, true)?,
            }
        }
    }

    /// Does something; where a wish cannot be granted, that is said, and where it is no more, nothing.
    fn grant<T>(&mut self, shared: &Shared, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<Option<T>> {
        match work(self) {
            Ok(done) => Ok(Some(done)),
            Err(Error::Interrupted) => Ok(None),
            Err(problem @ (Error::Parameter(_) | Error::File(_))) => {
                lock(&shared.outbox).problem = Some(problem);
                (shared.notify)();
                Ok(None)
            }
            Err(problem) => Err(problem),
        }
    }

    /// Makes a picture and shows it.
    fn publish(&mut self, shared: &Shared, wish: &Arc<Wish>, number: u64, at_rest: bool) -> Result<()> {
        let started = Instant::now();
        let made = self.grant(shared, |work| work.paint(shared, wish, number, at_rest))?;
        let Some(made) = made else { return Ok(()) };
        let Made { screen, beside, still, metered, timings } = made;
        let took = started.elapsed();
        let map = self.map.as_ref().map(|(_, map)| map.clone());
        if let (None, Some(wanted)) = (&still, wish.wanted) {
            self.resolution.learn(took, wanted);
        }
        self.count += 1;
        let (wish, count) = (wish.clone(), self.count);
        let shown = Shown { screen, beside, wish, still, metered, took, timings, map, count };
        lock(&shared.outbox).shown = Some(shown);
        (shared.notify)();
        Ok(())
    }

    fn paint(&mut self, shared: &Shared, wish: &Wish, number: u64, at_rest: bool) -> Result<Made> {
        let Wish { camera, params, time, .. } = wish;
        let interrupt = || {
            let inbox = lock(&shared.inbox);
            let stale = inbox.closed || (at_rest && inbox.number != number);
            if stale { Err(Error::Interrupted) } else { Ok(()) }
        };
        if let Some(rested) = self.rested(wish) {
            return self.show_rested(&rested, wish);
        }
        if at_rest {
            self.look_at_weather(params, &interrupt)?;
        }
        // A still has no history: that of the moving picture goes on.
        if at_rest && wish.sight != Sight::History {
            return self.paint_still(wish, wish.window, &wish.quality, &interrupt);
        }
        // A layer has each of its pixels.
        let animated = matches!(wish.sight, Sight::Picture | Sight::History);
        let sparse = |size| animated && Quality::named("preview").is_ok_and(|preview| preview.is_sparse(camera, size));
        let (size, name) = wish.wanted.map_or((wish.window, "draft"), |_| self.resolution.of(wish.window, sparse));
        let quality = Quality::named(name)?;
        if !animated {
            return self.paint_still(wish, size, &quality, &interrupt);
        }
        let screen = self.screen(wish, size)?;
        self.moving.set(size[0], size[1], quality)?;
        if wish.sight == Sight::History {
            self.moving.animate(&Shot::new(camera, params, *time), &interrupt)?;
            screen.write_pixels(self.gpu, &history_pixels(&self.moving.history_length()?, size))?;
        } else if let Some(folder) = &wish.record {
            let image = self.moving.animate(&Shot::new(camera, params, *time), &interrupt)?;
            screen.write(self.gpu, &image)?;
            let path = folder.join(format!("frame{:05}.png", self.count));
            let pixels = color::to_srgb8(&image, 4, size[0] as usize, wish.exposure, wish.tone_map, true)?;
            files::write_png(&path, &pixels, size.map(|side| side as usize), 4)?;
        } else {
            self.moving.animate_onto(&screen, &Shot::new(camera, params, *time), &interrupt)?;
        }
        Ok(Made { screen, beside: None, still: None, metered: None, timings: self.moving.timings.clone() })
    }

    /// A still by a method, what it is made of, or how far it is from the truth; and what is wished beside it.
    fn paint_still(
        &mut self,
        wish: &Wish,
        size: [u32; 2],
        quality: &Quality,
        interrupt: &dyn Fn() -> Result<()>,
    ) -> Result<Made> {
        let Wish { camera, time, .. } = wish;
        let mut still = |size: [u32; 2], params: &Params, quality: &Quality, layers: bool| {
            self.still.set(size[0], size[1], quality.clone())?;
            self.still.render(&Shot { background: !layers, ..Shot::new(camera, params, *time) }, layers, interrupt)
        };
        // The truth takes its time.
        let size = if wish.sight == Sight::Error { size.map(|side| (side / TRUTH_SHARE).max(1)) } else { size };
        let picture = still(size, &wish.params, quality, wish.sight.is_of_layers())?;
        let truth = match wish.sight {
            Sight::Error => Some(still(size, &wish.params, &Quality::named("reference")?, false)?),
            _ => None,
        };
        let other = match &wish.beside {
            Some((params, quality)) if wish.sight == Sight::Picture => Some(still(size, params, quality, false)?),
            _ => None,
        };
        let timings = self.still.timings.clone();
        let picture = Arc::new(picture);
        if wish.sight == Sight::Picture {
            let metered = color::auto_exposure(&picture.image, 4, Metering::default())? as f32;
            let rested = Arc::new(Rested { wish: wish.clone(), picture, beside: other, metered, timings });
            self.rested = Some(rested.clone());
            return self.show_rested(&rested, wish);
        }
        let screen = self.screen(wish, size)?;
        match (wish.sight, truth) {
            (_, Some(truth)) => screen.write_pixels(self.gpu, &error_pixels(&picture, &truth))?,
            (sight, None) => screen.write_pixels(self.gpu, &pixels_of(sight, &picture))?,
        }
        Ok(Made { screen, beside: None, still: Some(picture), metered: None, timings })
    }

    /// The last still, if it is what is wished for but for its exposure and tone map.
    fn rested(&self, wish: &Wish) -> Option<Arc<Rested>> {
        let is_of = |rested: &&Arc<Rested>| {
            let Wish { exposure, tone_map, .. } = rested.wish;
            rested.wish == Wish { exposure, tone_map, ..wish.clone() }
        };
        self.rested.as_ref().filter(is_of).cloned()
    }

    /// Shows the last still by the exposure and the tone map that are wished for.
    fn show_rested(&mut self, rested: &Rested, wish: &Wish) -> Result<Made> {
        let screen = self.screen(wish, wish.window)?;
        screen.write(self.gpu, &rested.picture.image)?;
        let show = |other: &Picture| {
            let screen = Screen::new(self.gpu, wish.window, wish.exposure, wish.tone_map)?;
            screen.write(self.gpu, &other.image).map(|()| Arc::new(screen))
        };
        let beside = rested.beside.as_ref().map(show).transpose()?;
        let (still, timings) = (Some(rested.picture.clone()), rested.timings.clone());
        Ok(Made { screen, beside, still, metered: Some(rested.metered), timings })
    }

    /// Makes the panorama that is asked for, if one is.
    fn panorama(&mut self, shared: &Shared, wish: &Wish) -> Result<()> {
        let Some(path) = lock(&shared.inbox).panorama.take() else { return Ok(()) };
        let interrupt = || if lock(&shared.inbox).closed { Err(Error::Interrupted) } else { Ok(()) };
        let [width, height] = PANORAMA;
        self.still.set(width, height, wish.quality.clone())?;
        let camera = Camera::equirect(wish.camera.eye)?;
        let image = self.still.render(&Shot::new(&camera, &wish.params, wish.time), false, &interrupt)?.image;
        let size = PANORAMA.map(|side| side as usize);
        files::write_exr(&path, &image, size, 4)?;
        let pixels = color::to_srgb8(&image, 4, size[0], wish.exposure, wish.tone_map, true)?;
        files::write_png(&path.with_extension("png"), &pixels, size, 4)?;
        lock(&shared.outbox).written = Some(path);
        (shared.notify)();
        Ok(())
    }

    /// Fetches the weather map if it is another; while weathers go over into each other, it would be in every frame.
    fn look_at_weather(&mut self, params: &Params, interrupt: &dyn Fn() -> Result<()>) -> Result<()> {
        if self.map.as_ref().is_none_or(|(weather, _)| *weather != params.weather) {
            let ([width, height], data) = self.still.weather_map(params, interrupt)?;
            let map = Map { width: width as usize, height: height as usize, channels: 3, data };
            self.map = Some((params.weather.clone(), Arc::new(map)));
        }
        Ok(())
    }

    /// The screen that is not shown, made anew where another is wanted.
    fn screen(&mut self, wish: &Wish, size: [u32; 2]) -> Result<Arc<Screen>> {
        self.screens.swap(0, 1);
        let fits = |screen: &&Arc<Screen>| screen.size() == size && screen.look() == (wish.exposure, wish.tone_map);
        if let Some(screen) = self.screens[0].as_ref().filter(fits) {
            return Ok(screen.clone());
        }
        let screen = Arc::new(Screen::new(self.gpu, size, wish.exposure, wish.tone_map)?);
        self.screens[0] = Some(screen.clone());
        Ok(screen)
    }
}

/// The wish that is newer than `done`, for which it waits; or after a while the old one; or, at the end, none.
fn next(shared: &Shared, done: u64, most: Option<Duration>) -> Option<(Arc<Wish>, u64)> {
    let mut inbox = lock(&shared.inbox);
    let until = most.map(|most| Instant::now() + most);
    loop {
        if inbox.closed {
            return None;
        }
        let left = until.map(|until| until.saturating_duration_since(Instant::now()));
        if let Some(wish) = inbox.wish.clone().filter(|_| inbox.number != done || left == Some(Duration::ZERO)) {
            return Some((wish, inbox.number));
        }
        inbox = match left {
            Some(left) => {
                shared.changed.wait_timeout(inbox, left).map_or_else(|e| e.into_inner().0, |(inbox, _)| inbox)
            }
            None => shared.changed.wait(inbox).unwrap_or_else(PoisonError::into_inner),
        };
    }
}
