//! Render thread: renders frames so that the window never waits for the GPU.

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

use crate::debug_view::{DebugView, error_pixels, history_pixels, layer_pixels};
use crate::resolution::DynamicResolution;

/// Time without a new request after which the still is rendered.
const REST_DELAY: Duration = Duration::from_millis(300);
/// Divisor of the view's width and height in [`DebugView::Error`], as `reference` is slow.
const ERROR_VIEW_DIVISOR: u32 = 4;
/// Width and height of a panorama, pixels.
const PANORAMA_SIZE: [u32; 2] = [4096, 2048];

/// Request for a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Camera.
    pub camera: Camera,
    /// Sky parameters.
    pub params: Params,
    /// Animation time, s.
    pub time: f64,
    /// Quality of stills.
    pub quality: Quality,
    /// Width and height of the view, pixels.
    pub view_size: [u32; 2],
    /// Exposure, stops.
    pub exposure: f32,
    /// Tone map, one of [`clouds_core::color::TONE_MAPS`].
    pub tone_map: &'static str,
    /// Target time of an animated frame; `None` renders animated frames at full resolution.
    pub frame_budget: Option<Duration>,
    /// Debug view.
    pub debug_view: DebugView,
    /// Parameters and quality of a second still for comparison.
    pub comparison: Option<(Params, Quality)>,
    /// Folder in which animated frames are saved, one file each.
    pub recording_folder: Option<PathBuf>,
}

/// Finished frame.
#[derive(Clone)]
pub struct RenderedFrame {
    /// Image on the device.
    pub screen: Arc<Screen>,
    /// Image of the comparison.
    pub comparison: Option<Arc<Screen>>,
    /// Request that the frame answers.
    pub request: Arc<Request>,
    /// Layers of a still; `None` for an animated frame.
    pub still: Option<Arc<Picture>>,
    /// Automatic exposure of a still in [`DebugView::Color`], stops.
    pub metered_exposure: Option<f32>,
    /// Wall-clock time of the frame.
    pub elapsed: Duration,
    /// Device time of each pass.
    pub timings: Timings,
    /// Weather map of the last still.
    pub weather_map: Option<Arc<Map>>,
    /// Number of frames rendered so far, including this one.
    pub count: u64,
}

#[derive(Default)]
struct Inbox {
    request: Option<Arc<Request>>,
    /// Number of changes to the inbox.
    revision: u64,
    /// File of a requested panorama.
    panorama: Option<PathBuf>,
    /// Whether the shaders must be reloaded.
    reload_shaders: bool,
    closed: bool,
}

#[derive(Default)]
struct Outbox {
    frame: Option<RenderedFrame>,
    panorama: Option<PathBuf>,
    error: Option<Error>,
}

struct Shared {
    inbox: Mutex<Inbox>,
    inbox_changed: Condvar,
    outbox: Mutex<Outbox>,
    /// Callback after each change to the outbox.
    notify: Box<dyn Fn() + Send + Sync>,
}

/// Handle of the render thread; dropping it ends the thread.
pub struct RenderThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

// Lock poisoning is ignored: no code can panic between two writes to a locked value.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RenderThread {
    /// Starts the thread, which calls `notify` after each frame, panorama or error.
    pub fn new(gpu: Arc<Gpu>, adapter: Option<String>, notify: impl Fn() + Send + Sync + 'static) -> Self {
        let shared = Arc::new(Shared {
            inbox: Mutex::default(),
            inbox_changed: Condvar::new(),
            outbox: Mutex::default(),
            notify: Box::new(notify),
        });
        let inner = shared.clone();
        let thread = thread::spawn(move || {
            let work = || Worker::new(&gpu, adapter.as_deref())?.run(&inner);
            let ended = catch_unwind(AssertUnwindSafe(work));
            let error = match ended {
                Ok(Ok(())) => return,
                Ok(Err(error)) => error,
                Err(_) => Error::Device("internal error, please report it".into()),
            };
            lock(&inner.outbox).error = Some(error);
            (inner.notify)();
        });
        Self { shared, thread: Some(thread) }
    }

    /// Requests a frame; a still in progress for an earlier request is interrupted.
    pub fn request_frame(&self, request: Request) {
        let mut inbox = lock(&self.shared.inbox);
        if inbox.request.as_deref() == Some(&request) {
            return;
        }
        inbox.request = Some(Arc::new(request));
        inbox.revision += 1;
        drop(inbox);
        self.shared.inbox_changed.notify_all();
    }

    /// Requests a panorama of the current sky: linear radiance (EXR) in `path`, and a PNG file of the same name.
    pub fn request_panorama(&self, path: PathBuf) {
        let mut inbox = lock(&self.shared.inbox);
        inbox.panorama = Some(path);
        inbox.revision += 1;
        drop(inbox);
        self.shared.inbox_changed.notify_all();
    }

    /// Requests a reload of the shaders.
    pub fn reload_shaders(&self) {
        let mut inbox = lock(&self.shared.inbox);
        inbox.reload_shaders = true;
        inbox.revision += 1;
        drop(inbox);
        self.shared.inbox_changed.notify_all();
    }

    /// Takes the path of the panorama written since the last call.
    pub fn take_panorama(&self) -> Option<PathBuf> {
        lock(&self.shared.outbox).panorama.take()
    }

    /// Latest frame.
    pub fn latest_frame(&self) -> Option<RenderedFrame> {
        lock(&self.shared.outbox).frame.clone()
    }

    /// Takes the error since the last call; [`Error::Parameter`] and [`Error::File`] leave the thread running.
    pub fn take_error(&self) -> Option<Error> {
        lock(&self.shared.outbox).error.take()
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        lock(&self.shared.inbox).closed = true;
        self.shared.inbox_changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Result of rendering a request.
struct Output {
    screen: Arc<Screen>,
    comparison: Option<Arc<Screen>>,
    still: Option<Arc<Picture>>,
    metered_exposure: Option<f32>,
    timings: Timings,
}

/// Radiance of the last still, for display with another exposure or tone map without rendering.
struct CachedStill {
    request: Request,
    picture: Arc<Picture>,
    comparison: Option<Picture>,
    metered_exposure: f32,
    timings: Timings,
}

/// State of the thread.
struct Worker<'a> {
    gpu: &'a Gpu,
    /// Renderer of animated frames, which holds their history.
    animation_renderer: Renderer,
    /// Renderer of stills, separate so that stills leave the history intact.
    still_renderer: Renderer,
    resolution: DynamicResolution,
    /// Double buffer: one screen is displayed while the other is written.
    screens: [Option<Arc<Screen>>; 2],
    cached_still: Option<Arc<CachedStill>>,
    /// Weather map of the last still, with the parameters that it is made from.
    weather_map: Option<(Weather, Arc<Map>)>,
    count: u64,
}

impl<'a> Worker<'a> {
    fn new(gpu: &'a Gpu, adapter: Option<&str>) -> Result<Self> {
        let renderer = || Renderer::new(16, 16, Quality::named("draft")?, adapter);
        let scale = if gpu.info.kind == "cpu" { 0.45 } else { 1.0 };
        let [animation_renderer, still_renderer] = [renderer()?, renderer()?];
        Ok(Self {
            gpu,
            animation_renderer,
            still_renderer,
            resolution: DynamicResolution::new(scale),
            screens: [None, None],
            cached_still: None,
            weather_map: None,
            count: 0,
        })
    }

    fn run(&mut self, shared: &Shared) -> Result<()> {
        let mut seen = 0;
        loop {
            let Some((request, revision)) = wait_for_request(shared, seen, None) else { return Ok(()) };
            seen = revision;
            if mem::take(&mut lock(&shared.inbox).reload_shaders) {
                self.cached_still = None;
                self.report_errors(shared, |worker| worker.gpu.reload_shaders())?;
            }
            self.report_errors(shared, |worker| worker.write_panorama(shared, &request))?;
            self.publish(shared, &request, revision, false)?;
            // The still follows unless a new request arrives within the delay.
            match wait_for_request(shared, seen, Some(REST_DELAY)) {
                None => return Ok(()),
                Some((_, revision)) if revision != seen => {}
                Some((request, _)) if self.cached_still_for(&request).is_some() => {}
                Some((request, revision)) => self.publish(shared, &request, revision, true)?,
            }
        }
    }

    /// Runs a task: sends recoverable errors to the outbox, ignores an interruption, and returns all other errors.
    fn report_errors<T>(&mut self, shared: &Shared, task: impl FnOnce(&mut Self) -> Result<T>) -> Result<Option<T>> {
        match task(self) {
            Ok(value) => Ok(Some(value)),
            Err(Error::Interrupted) => Ok(None),
            Err(error @ (Error::Parameter(_) | Error::File(_))) => {
                lock(&shared.outbox).error = Some(error);
                (shared.notify)();
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Renders a request and puts the frame into the outbox.
    fn publish(&mut self, shared: &Shared, request: &Arc<Request>, revision: u64, at_rest: bool) -> Result<()> {
        let started = Instant::now();
        let output = self.report_errors(shared, |worker| worker.render(shared, request, revision, at_rest))?;
        let Some(output) = output else { return Ok(()) };
        let Output { screen, comparison, still, metered_exposure, timings } = output;
        let elapsed = started.elapsed();
        let weather_map = self.weather_map.as_ref().map(|(_, map)| map.clone());
        if let (None, Some(budget)) = (&still, request.frame_budget) {
            self.resolution.record(elapsed, budget);
        }
        self.count += 1;
        let (request, count) = (request.clone(), self.count);
        let frame = RenderedFrame {
            screen,
            comparison,
            request,
            still,
            metered_exposure,
            elapsed,
            timings,
            weather_map,
            count,
        };
        lock(&shared.outbox).frame = Some(frame);
        (shared.notify)();
        Ok(())
    }

    fn render(&mut self, shared: &Shared, request: &Request, revision: u64, at_rest: bool) -> Result<Output> {
        let Request { camera, params, time, .. } = request;
        let interrupt = || {
            let inbox = lock(&shared.inbox);
            let stale = inbox.closed || (at_rest && inbox.revision != revision);
            if stale { Err(Error::Interrupted) } else { Ok(()) }
        };
        if let Some(still) = self.cached_still_for(request) {
            return self.display_still(&still, request);
        }
        if at_rest {
            self.update_weather_map(params, &interrupt)?;
        }
        // The history view shows animated frames at rest too, as stills have no history.
        if at_rest && request.debug_view != DebugView::HistoryLength {
            return self.render_still(request, request.view_size, &request.quality, &interrupt);
        }
        let animated = matches!(request.debug_view, DebugView::Color | DebugView::HistoryLength);
        // Layer views have a value in every pixel, which `preview` does not provide.
        let is_low_resolution =
            |size| animated && Quality::named("preview").is_ok_and(|preview| preview.is_low_resolution(camera, size));
        let (size, name) = request
            .frame_budget
            .map_or((request.view_size, "draft"), |_| self.resolution.choose(request.view_size, is_low_resolution));
        let quality = Quality::named(name)?;
        if !animated {
            return self.render_still(request, size, &quality, &interrupt);
        }
        let screen = self.back_screen(request, size)?;
        let renderer = &mut self.animation_renderer;
        renderer.set(size[0], size[1], quality)?;
        let shot = Shot::new(camera, params, *time);
        if request.debug_view == DebugView::HistoryLength {
            renderer.animate(&shot, &interrupt)?;
            screen.write_pixels(self.gpu, &history_pixels(&renderer.history_length()?, size))?;
        } else if let Some(folder) = &request.recording_folder {
            let image = renderer.animate(&shot, &interrupt)?;
            screen.write(self.gpu, &image)?;
            let path = folder.join(format!("frame{:05}.png", self.count));
            let pixels = color::to_srgb8(&image, 4, size[0] as usize, request.exposure, request.tone_map, true)?;
            files::write_png(&path, &pixels, size.map(|side| side as usize), 4)?;
        } else {
            renderer.animate_onto(&screen, &shot, &interrupt)?;
        }
        let timings = renderer.timings.clone();
        Ok(Output { screen, comparison: None, still: None, metered_exposure: None, timings })
    }

    /// Still of a request in its debug view, with the comparison.
    fn render_still(
        &mut self,
        request: &Request,
        size: [u32; 2],
        quality: &Quality,
        interrupt: &dyn Fn() -> Result<()>,
    ) -> Result<Output> {
        let Request { camera, time, debug_view, .. } = request;
        let mut render = |size: [u32; 2], params: &Params, quality: &Quality, layers: bool| {
            self.still_renderer.set(size[0], size[1], quality.clone())?;
            let shot = Shot { background: !layers, ..Shot::new(camera, params, *time) };
            self.still_renderer.render(&shot, layers, interrupt)
        };
        let size = match debug_view {
            DebugView::Error => size.map(|side| (side / ERROR_VIEW_DIVISOR).max(1)),
            _ => size,
        };
        let picture = render(size, &request.params, quality, debug_view.needs_layers())?;
        let reference = match debug_view {
            DebugView::Error => Some(render(size, &request.params, &Quality::named("reference")?, false)?),
            _ => None,
        };
        let comparison = match &request.comparison {
            Some((params, quality)) if *debug_view == DebugView::Color => Some(render(size, params, quality, false)?),
            _ => None,
        };
        let timings = self.still_renderer.timings.clone();
        let picture = Arc::new(picture);
        if *debug_view == DebugView::Color {
            let metered_exposure = color::auto_exposure(&picture.image, 4, Metering::default())? as f32;
            let still = CachedStill { request: request.clone(), picture, comparison, metered_exposure, timings };
            let still = Arc::new(still);
            self.cached_still = Some(still.clone());
            return self.display_still(&still, request);
        }
        let screen = self.back_screen(request, size)?;
        let pixels = match reference {
            Some(reference) => error_pixels(&picture, &reference),
            None => layer_pixels(*debug_view, &picture),
        };
        screen.write_pixels(self.gpu, &pixels)?;
        Ok(Output { screen, comparison: None, still: Some(picture), metered_exposure: None, timings })
    }

    /// Cached still if it differs from a request in nothing but exposure and tone map.
    fn cached_still_for(&self, request: &Request) -> Option<Arc<CachedStill>> {
        let is_match = |still: &&Arc<CachedStill>| {
            let Request { exposure, tone_map, .. } = still.request;
            still.request == Request { exposure, tone_map, ..request.clone() }
        };
        self.cached_still.as_ref().filter(is_match).cloned()
    }

    /// Displays a cached still with the exposure and tone map of a request.
    fn display_still(&mut self, still: &CachedStill, request: &Request) -> Result<Output> {
        let screen = self.back_screen(request, request.view_size)?;
        screen.write(self.gpu, &still.picture.image)?;
        let display = |picture: &Picture| {
            let screen = Screen::new(self.gpu, request.view_size, request.exposure, request.tone_map)?;
            screen.write(self.gpu, &picture.image).map(|()| Arc::new(screen))
        };
        Ok(Output {
            screen,
            comparison: still.comparison.as_ref().map(display).transpose()?,
            still: Some(still.picture.clone()),
            metered_exposure: Some(still.metered_exposure),
            timings: still.timings.clone(),
        })
    }

    /// Writes the requested panorama, if any.
    fn write_panorama(&mut self, shared: &Shared, request: &Request) -> Result<()> {
        let Some(path) = lock(&shared.inbox).panorama.take() else { return Ok(()) };
        let interrupt = || if lock(&shared.inbox).closed { Err(Error::Interrupted) } else { Ok(()) };
        let [width, height] = PANORAMA_SIZE;
        self.still_renderer.set(width, height, request.quality.clone())?;
        let camera = Camera::equirect(request.camera.eye)?;
        let shot = Shot::new(&camera, &request.params, request.time);
        let image = self.still_renderer.render(&shot, false, &interrupt)?.image;
        let size = PANORAMA_SIZE.map(|side| side as usize);
        files::write_exr(&path, &image, size, 4)?;
        let pixels = color::to_srgb8(&image, 4, size[0], request.exposure, request.tone_map, true)?;
        files::write_png(&path.with_extension("png"), &pixels, size, 4)?;
        lock(&shared.outbox).panorama = Some(path);
        (shared.notify)();
        Ok(())
    }

    /// Reads the weather map back if the weather has changed.
    ///
    /// Only stills call this: during a weather transition the map changes in every frame.
    fn update_weather_map(&mut self, params: &Params, interrupt: &dyn Fn() -> Result<()>) -> Result<()> {
        if self.weather_map.as_ref().is_none_or(|(weather, _)| *weather != params.weather) {
            let ([width, height], data) = self.still_renderer.weather_map(params, interrupt)?;
            let map = Map { width: width as usize, height: height as usize, channels: 3, data };
            self.weather_map = Some((params.weather.clone(), Arc::new(map)));
        }
        Ok(())
    }

    /// Screen that is not displayed, recreated if its size, exposure or tone map differ.
    fn back_screen(&mut self, request: &Request, size: [u32; 2]) -> Result<Arc<Screen>> {
        self.screens.swap(0, 1);
        let display = (request.exposure, request.tone_map);
        let is_reusable = |screen: &&Arc<Screen>| screen.size() == size && screen.look() == display;
        if let Some(screen) = self.screens[0].as_ref().filter(is_reusable) {
            return Ok(screen.clone());
        }
        let screen = Arc::new(Screen::new(self.gpu, size, request.exposure, request.tone_map)?);
        self.screens[0] = Some(screen.clone());
        Ok(screen)
    }
}

/// Waits for a change to the inbox after revision `seen`; returns the request and the current revision.
///
/// After `timeout` the result is the unchanged request. `None` means that the thread must end.
fn wait_for_request(shared: &Shared, seen: u64, timeout: Option<Duration>) -> Option<(Arc<Request>, u64)> {
    let mut inbox = lock(&shared.inbox);
    let deadline = timeout.map(|timeout| Instant::now() + timeout);
    loop {
        if inbox.closed {
            return None;
        }
        let remaining = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        let is_due = inbox.revision != seen || remaining == Some(Duration::ZERO);
        if let Some(request) = inbox.request.clone().filter(|_| is_due) {
            return Some((request, inbox.revision));
        }
        inbox = match remaining {
            Some(remaining) => {
                let waited = shared.inbox_changed.wait_timeout(inbox, remaining);
                waited.map_or_else(|error| error.into_inner().0, |(inbox, _)| inbox)
            }
            None => shared.inbox_changed.wait(inbox).unwrap_or_else(PoisonError::into_inner),
        };
    }
}
