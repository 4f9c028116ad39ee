//! Window of the demo: menus, panels, view and input. [`App::frame`] is the order of work in one window frame.

use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use clouds_core::color::{TONE_MAPS, to_srgb8};
use clouds_core::frame::Frame;
use clouds_core::params::Model;
use clouds_core::{Camera, Error, Gpu, Params, Quality, Screen, files};
use eframe::egui::{self, Key, PointerButton, Sense, Ui, ViewportCommand};
use eframe::egui_wgpu::RenderState;
use eframe::wgpu::FilterMode;
use egui_plot::{Legend, Line, Plot, PlotPoints};

use crate::debug_view::DebugView;
use crate::flight::{Controls, Flight};
use crate::help;
use crate::panel::{self, Panel};
use crate::preset::{self, PythonCall};
use crate::render_thread::{RenderThread, RenderedFrame, Request};
use crate::shader_watch::{self, ShaderWatch};
use crate::sun::Clock;
use crate::weather::WeatherPanel;

/// Rotation of the view per point of pointer motion, degrees.
const DEGREES_PER_POINT: f64 = 0.15;
/// Longest time step of the simulation, s; it bounds the jump after a hitch.
const MAX_TIME_STEP: f64 = 0.25;
/// Range of the exposure, stops.
const EXPOSURE_RANGE: RangeInclusive<f32> = -8.0..=16.0;
/// Time constant of the automatic exposure, s: 95 % of a change is done after 0.5 s.
const ADAPTATION_TIME: f32 = 0.17;
/// Exposure difference that ends the adaptation, stops; it is invisible.
const EXPOSURE_TOLERANCE: f32 = 0.01;
/// Width of the left panel, points.
const PANEL_WIDTH: f32 = 360.0;
/// Number of frames in the cost plot.
const COST_FRAMES: usize = 120;
/// Longest interval between window frames while anything moves.
const MAX_REPAINT_INTERVAL: Duration = Duration::from_millis(100);
/// Qualities in the menu.
const QUALITIES: [&str; 3] = ["draft", "balanced", "high"];
/// Viewpoints: name, altitude (m), pitch (degrees).
const VIEWPOINTS: [(&str, f64, f64); 4] =
    [("ground", 1.7, 12.0), ("in cloud", 1900.0, 2.0), ("above", 4500.0, -12.0), ("space", 300_000.0, -18.0)];
/// Frames left out of the printed statistics, as they compile shaders and bake textures.
const WARM_UP_FRAMES: usize = 5;

/// Options of the command line.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of a scene, or path of a TOML file.
    pub scene: Option<String>,
    /// Part of the adapter's name.
    pub adapter: Option<String>,
    /// Number of frames after which the window closes.
    pub frames: Option<u64>,
    /// Path of a screenshot taken before the window closes.
    pub screenshot: Option<PathBuf>,
    /// Target frame rate while anything moves, frames per second.
    pub target_frame_rate: Option<f64>,
    /// Whether the camera flies forward without input.
    pub fly: bool,
    /// Reason why the window closed before it finished the requested frames.
    pub failure: Arc<OnceLock<String>>,
}

/// State of the window.
pub struct App {
    options: Options,
    render_thread: RenderThread,
    scenes: Vec<(String, Camera, Params)>,
    flight: Flight,
    params: Params,
    /// Animation time, s.
    time: f64,
    /// Whether the animation time advances.
    playing: bool,
    clock: Clock,
    /// Elevation and azimuth of the sun that the clock was last set from, degrees.
    clock_sun: Option<[f32; 2]>,
    quality: Quality,
    quality_name: String,
    /// Exposure, stops.
    exposure: f32,
    /// Whether the exposure follows the metered exposure.
    auto_exposure: bool,
    /// Automatic exposure of the last still, stops.
    metered_exposure: Option<f32>,
    /// Time of the last adaptation step; `None` while the exposure is constant.
    last_adaptation: Option<Instant>,
    tone_map: &'static str,
    debug_view: DebugView,
    /// Target frame rate while anything moves, frames per second.
    target_frame_rate: f64,
    panel: Panel,
    weather: WeatherPanel,
    /// Device time of each pass in the last frames, ms.
    costs: VecDeque<(f64, Vec<(String, f64)>)>,
    /// Whether the pointer is locked to the view.
    pointer_captured: bool,
    /// Whether the list of keys is open.
    key_list_open: bool,
    /// Time at which the panels were hidden; `None` while they are visible.
    hidden_panels_since: Option<Instant>,
    comparison: Comparison,
    /// Position of the divider of a comparison, as a fraction of the view's width.
    divider: f32,
    /// Folder in which animated frames are saved.
    recording_folder: Option<PathBuf>,
    output_folder: PathBuf,
    /// Message in the status bar: the last action or error.
    notice: String,
    last_request: Option<Request>,
    rendered_frame: Option<RenderedFrame>,
    texture: Option<egui::TextureId>,
    comparison_texture: Option<egui::TextureId>,
    shader_watch: Option<ShaderWatch>,
    last_advance: Instant,
    last_rendered: Instant,
    /// Intervals between rendered frames.
    render_intervals: Vec<Duration>,
    /// Intervals between window frames while input was active; each bounds the latency of a key.
    input_intervals: Vec<Duration>,
    closing: bool,
}

impl App {
    /// Window that shares a GPU device with its renderer.
    pub fn new(context: &egui::Context, gpu: Arc<Gpu>, options: Options) -> Result<Self> {
        let repaint = context.clone();
        // A repaint request without a delay makes egui paint twice.
        let delay = Duration::from_millis(1);
        let notify = move || repaint.request_repaint_after(delay);
        let render_thread = RenderThread::new(gpu.clone(), options.adapter.clone(), notify);
        let scenes = preset::scenes()?;
        let name = options.scene.clone().unwrap_or_else(|| "fair_weather".into());
        let (flight, params) = match scenes.iter().find(|(scene, ..)| *scene == name) {
            Some((_, camera, params)) => (Flight::from_camera(camera), params.clone()),
            None if Path::new(&name).exists() => (Flight::from_camera(&scenes[0].1), preset::load(Path::new(&name))?),
            None => {
                let names: Vec<_> = scenes.iter().map(|(name, ..)| name.as_str()).collect();
                anyhow::bail!("{name:?} is neither a TOML file nor a scene: {}", names.join(", "));
            }
        };
        let default_frame_rate = if gpu.info.kind == "cpu" { 10.0 } else { 60.0 };
        Ok(Self {
            target_frame_rate: options.target_frame_rate.unwrap_or(default_frame_rate),
            options,
            render_thread,
            scenes,
            flight,
            params,
            time: 0.0,
            playing: false,
            clock: Clock::default(),
            clock_sun: None,
            quality: Quality::named("balanced")?,
            quality_name: "balanced".into(),
            exposure: 0.0,
            auto_exposure: false,
            metered_exposure: None,
            last_adaptation: None,
            tone_map: TONE_MAPS[0],
            debug_view: DebugView::Color,
            panel: Panel::default(),
            weather: WeatherPanel::default(),
            costs: VecDeque::new(),
            pointer_captured: false,
            key_list_open: false,
            hidden_panels_since: None,
            comparison: Comparison::None,
            divider: 0.5,
            recording_folder: None,
            output_folder: std::env::current_dir().unwrap_or_default(),
            notice: String::new(),
            last_request: None,
            rendered_frame: None,
            texture: None,
            comparison_texture: None,
            shader_watch: ShaderWatch::new(std::env::var_os("NUBIS_SHADERS")),
            last_advance: Instant::now(),
            last_rendered: Instant::now(),
            render_intervals: Vec::new(),
            input_intervals: Vec::new(),
            closing: false,
        })
    }

    /// Displayed frame.
    pub fn rendered_frame(&self) -> Option<&RenderedFrame> {
        self.rendered_frame.as_ref()
    }

    /// Message in the status bar.
    pub fn notice(&self) -> &str {
        &self.notice
    }

    /// Camera state.
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Sky parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Animation time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Exposure, stops.
    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Whether the window is about to close.
    pub fn is_closing(&self) -> bool {
        self.closing
    }

    /// Position of the divider of a comparison, as a fraction of the view's width.
    pub fn divider(&self) -> f32 {
        self.divider
    }

    /// Window frame.
    pub fn frame(&mut self, ui: &mut Ui, device: Option<&RenderState>) {
        self.handle_shortcuts(ui);
        self.reload_changed_shaders(ui);
        self.receive_frame(ui, device);
        self.read_dropped_files(ui);
        self.sync_clock();
        if self.hidden_panels_since.is_none() {
            egui::Panel::top("top").show(ui, |ui| self.menu(ui));
            egui::Panel::bottom("status").show(ui, |ui| self.status(ui));
            egui::Panel::left("panel").resizable(false).exact_size(PANEL_WIDTH).show(ui, |ui| self.settings(ui));
        }
        help::key_window(ui.ctx(), &mut self.key_list_open);
        let view = egui::CentralPanel::no_frame().show(ui, |ui| self.view(ui)).inner;
        self.advance(ui, &view);
        self.adapt_exposure(ui);
        self.request_frame(ui, view.rect);
        self.close_when_done(ui, view.rect);
    }

    /// Receives frames, errors and written files from the render thread.
    fn receive_frame(&mut self, ui: &Ui, device: Option<&RenderState>) {
        match self.render_thread.take_error() {
            Some(error @ (Error::Parameter(_) | Error::File(_))) => {
                // Shader errors contain box-drawing characters that the font lacks.
                self.notice = error.to_string().replace(['┌', '─', '│'], " ");
                if self.options.frames.is_some() {
                    // A run of a fixed number of frames has no user to correct the error.
                    self.close_with_failure(ui, error.to_string());
                }
            }
            Some(error) => {
                // The render thread has ended, and the window shares its device.
                self.notice = error.to_string();
                self.close_with_failure(ui, error.to_string());
            }
            None => {}
        }
        if let Some(path) = self.render_thread.take_panorama() {
            self.notice = format!("wrote {}", path.display());
        }
        let Some(frame) = self.render_thread.latest_frame() else { return };
        if self.rendered_frame.as_ref().is_some_and(|old| old.count == frame.count) {
            return;
        }
        if let Some(device) = device {
            update_texture(device, &frame.screen, &mut self.texture);
            if let Some(comparison) = &frame.comparison {
                update_texture(device, comparison, &mut self.comparison_texture);
            }
        }
        self.costs.push_back((frame.count as f64, frame.timings.0.clone()));
        if self.costs.len() > COST_FRAMES {
            self.costs.pop_front();
        }
        self.render_intervals.push(self.last_rendered.elapsed());
        self.last_rendered = Instant::now();
        self.metered_exposure = frame.metered_exposure.or(self.metered_exposure);
        self.rendered_frame = Some(frame);
    }

    fn handle_shortcuts(&mut self, ui: &Ui) {
        let pressed = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
        if pressed(egui::Modifiers::COMMAND, Key::Q) {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
        if pressed(egui::Modifiers::NONE, Key::F1) {
            self.key_list_open = !self.key_list_open;
        }
        if pressed(egui::Modifiers::NONE, Key::F2) {
            self.hidden_panels_since = self.hidden_panels_since.is_none().then(Instant::now);
        }
    }

    /// Closes the window and stores the reason for the exit status.
    fn close_with_failure(&mut self, ui: &Ui, reason: String) {
        self.closing = true;
        let _ = self.options.failure.set(reason);
        ui.ctx().send_viewport_cmd(ViewportCommand::Close);
    }

    /// Sets the clock from the sun if a scene, a slider or a file has moved the sun.
    fn sync_clock(&mut self) {
        let sun = [self.params.sun.elevation, self.params.sun.azimuth];
        if self.clock_sun != Some(sun) {
            self.clock = self.clock.at_sun(f64::from(sun[0]), f64::from(sun[1]));
            self.clock_sun = Some(sun);
        }
    }

    fn reload_changed_shaders(&mut self, ui: &Ui) {
        let Some(watch) = &mut self.shader_watch else { return };
        if watch.has_changed() {
            self.notice = "reading the shaders".into();
            self.render_thread.reload_shaders();
        }
        ui.ctx().request_repaint_after(shader_watch::POLL_INTERVAL);
    }

    fn read_dropped_files(&mut self, ui: &Ui) {
        let dropped = ui.input(|input| input.raw.dropped_files.clone());
        if let Some(path) = dropped.first().map(|file| file.path().to_path_buf()) {
            let loaded = preset::load(&path).map(|params| self.params = params);
            self.notify(loaded, format!("read {}", path.display()));
        }
    }

    /// Shows a message on success, the error otherwise.
    fn notify(&mut self, outcome: Result<()>, message: String) {
        self.notice = outcome.map_or_else(|error| format!("{error:#}"), |()| message);
    }

    /// Shows the path of a written file, or the error.
    fn notify_written(&mut self, written: Result<PathBuf>) {
        self.notice = written.map_or_else(|error| format!("{error:#}"), |path| format!("wrote {}", path.display()));
    }

    fn menu(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            panel::menu(ui, "scene", "go to", |ui| {
                for (name, camera, params) in &self.scenes {
                    if ui.selectable_label(false, name.replace('_', " ")).clicked() {
                        (self.flight, self.params) = (Flight::from_camera(camera), params.clone());
                    }
                }
            });
            for (name, altitude, pitch) in VIEWPOINTS {
                if ui.button(name).clicked() {
                    (self.flight.eye.z, self.flight.pitch, self.flight.flying) = (altitude, pitch, true);
                }
            }
            ui.separator();
            panel::menu(ui, "at rest", &self.quality_name.clone(), |ui| {
                for name in QUALITIES {
                    if ui.selectable_label(self.quality_name == name, name).clicked()
                        && let Ok(quality) = Quality::named(name)
                    {
                        (self.quality, self.quality_name) = (quality, name.into());
                    }
                }
            });
            panel::menu(ui, "shown", self.debug_view.name(), |ui| {
                for view in DebugView::ALL {
                    ui.selectable_value(&mut self.debug_view, view, view.name());
                }
            });
            panel::menu(ui, "beside", &self.comparison.name(), |ui| {
                for comparison in Comparison::all() {
                    ui.selectable_value(&mut self.comparison, comparison, comparison.name());
                }
            });
            panel::menu(ui, "tone map", self.tone_map, |ui| {
                for name in TONE_MAPS {
                    ui.selectable_value(&mut self.tone_map, name, name);
                }
            });
        });
        ui.horizontal_wrapped(|ui| {
            if ui.button("Save picture").on_hover_text("PNG and EXR, in the current folder").clicked() {
                let saved = self.save_picture();
                self.notify_written(saved);
            }
            if ui.button("Save sky").on_hover_text("TOML; drop such a file here to read it").clicked() {
                let path = self.unused_path("sky", "toml");
                let saved = preset::save(&path, &self.params).map(|()| path);
                self.notify_written(saved);
            }
            let panorama = ui.button("Panorama").on_hover_text("the whole sphere, EXR and PNG; it may take a while");
            if panorama.clicked() {
                self.render_thread.request_panorama(self.unused_path("panorama", "exr"));
                self.notice = "making a panorama".into();
            }
            let mut recording = self.recording_folder.is_some();
            let record = ui.toggle_value(&mut recording, "Record");
            if record.on_hover_text("saves each moving picture as PNG in a new folder").changed() {
                self.set_recording(recording);
            }
            if ui.button("Copy as Python").clicked() {
                let copied = self.python_code().map(|code| ui.ctx().copy_text(code));
                self.notify(copied, "copied".into());
            }
            ui.separator();
            let exposure = egui::Slider::new(&mut self.exposure, EXPOSURE_RANGE).suffix(" stops");
            panel::labelled(ui, "exposure", |ui| ui.add_enabled(!self.auto_exposure, exposure));
            ui.checkbox(&mut self.auto_exposure, "auto")
                .on_hover_text("follows the automatic exposure of the last picture at rest");
            let rate = egui::Slider::new(&mut self.target_frame_rate, 2.0..=120.0).logarithmic(true).suffix(" Hz");
            panel::labelled(ui, "wanted", |ui| ui.add(rate)).on_hover_text("frames a second while anything moves");
            ui.separator();
            ui.toggle_value(&mut self.key_list_open, "F1 keys");
            if ui.button("F2 view alone").on_hover_text("hides the panels").clicked() {
                self.hidden_panels_since = Some(Instant::now());
            }
        });
    }

    fn set_recording(&mut self, on: bool) {
        self.recording_folder = None;
        if on {
            let folder = self.unused_path("frames", "d");
            let created = std::fs::create_dir(&folder).with_context(|| format!("{} cannot be made", folder.display()));
            self.recording_folder = created.is_ok().then(|| folder.clone());
            self.notify(created, format!("recording into {}", folder.display()));
        }
    }

    /// First numbered path that does not exist.
    fn unused_path(&self, stem: &str, extension: &str) -> PathBuf {
        let path = |n: u32| self.output_folder.join(format!("{stem}{n}.{extension}"));
        (1..).map(path).find(|path| !path.exists()).expect("some number is unused")
    }

    /// Writes the displayed still.
    fn save_picture(&self) -> Result<PathBuf> {
        let is_current = |frame: &&RenderedFrame| {
            self.last_request.as_ref() == Some(&*frame.request) && frame.request.debug_view == DebugView::Color
        };
        let frame = self.rendered_frame.as_ref().filter(is_current);
        let still = frame.and_then(|frame| Some((frame, frame.still.as_ref()?)));
        let (frame, picture) = still.context("hold still until the picture is at its best, then save it")?;
        let (size, request) = (frame.screen.size().map(|side| side as usize), &frame.request);
        let path = self.unused_path("sky", "png");
        let pixels = to_srgb8(&picture.image, 4, size[0], request.exposure, request.tone_map, true)?;
        files::write_png(&path, &pixels, size, 4)?;
        files::write_exr(&path.with_extension("exr"), &picture.image, size, 4)?;
        Ok(path)
    }

    /// Python code that renders the still; writes a TOML file if the code needs one.
    fn python_code(&self) -> Result<String> {
        let camera = self.flight.camera()?;
        let params_file = if preset::needs_file(&self.params) {
            let path = self.unused_path("sky", "toml");
            preset::save(&path, &self.params)?;
            Some(path.display().to_string())
        } else {
            None
        };
        let call = PythonCall {
            camera: &camera,
            params: &self.params,
            time: self.time,
            quality: &self.quality_name,
            size: self.rendered_frame.as_ref().map_or([960, 540], |frame| frame.request.view_size),
            exposure: self.exposure,
            tone_map: self.tone_map,
        };
        Ok(preset::python_code(&call, params_file.as_deref()))
    }

    fn settings(&mut self, ui: &mut Ui) {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.add(egui::TextEdit::singleline(&mut self.panel.search).hint_text("search"));
            if let Some(error) = &self.panel.error {
                ui.colored_label(ui.visuals().error_fg_color, error);
            }
            egui::CollapsingHeader::new("time").default_open(true).show(ui, |ui| self.time_settings(ui));
            egui::CollapsingHeader::new("weather map").show(ui, |ui| self.weather_settings(ui));
            egui::CollapsingHeader::new("cost").show(ui, |ui| self.cost_plot(ui));
            let before = self.params.clone();
            if self.panel.sky(ui, &mut self.params) {
                // Drift offsets keep the clouds in place when the wind changes.
                self.params.drift = self.params.after(&before, self.time);
            }
            let default = Quality::named(&self.quality_name).unwrap_or_default();
            self.panel.quality(ui, &mut self.quality, &default);
        });
    }

    /// Controls of animation time, date and time of day.
    fn time_settings(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.toggle_value(&mut self.playing, "wind blows");
            ui.add(egui::DragValue::new(&mut self.time).speed(1.0).suffix(" s"));
            ui.separator();
            ui.toggle_value(&mut self.clock.playing, "sun moves");
        });
        let before = Clock { playing: false, ..self.clock };
        // The formatter rounds the text only; rounding in the slider would change the value.
        let hour =
            egui::Slider::new(&mut self.clock.hour, 0.0..=24.0).suffix(" h").custom_formatter(|v, _| format!("{v:.2}"));
        panel::labelled_row(ui, "hour", |ui| ui.add(hour))
            .on_hover_text("local solar time: the sun is highest about noon");
        let rate = egui::Slider::new(&mut self.clock.rate, 0.1..=60.0).logarithmic(true).suffix(" h/min");
        panel::labelled_row(ui, "rate", |ui| ui.add(rate));
        let latitude = egui::Slider::new(&mut self.clock.latitude, -90.0..=90.0)
            .suffix("°")
            .custom_formatter(|v, _| format!("{v:.1}"));
        panel::labelled_row(ui, "latitude", |ui| ui.add(latitude));
        panel::labelled_row(ui, "day of the year", |ui| ui.add(egui::Slider::new(&mut self.clock.day, 1..=365)));
        if self.clock.is_approximate {
            ui.weak("The sun is placed by hand; this is the nearest hour.");
        }
        let changed = Clock { playing: false, rate: before.rate, ..self.clock } != before;
        if changed {
            self.apply_clock();
        }
    }

    fn weather_settings(&mut self, ui: &mut Ui) {
        let rendered = self.rendered_frame.as_ref().and_then(|frame| frame.weather_map.as_ref());
        let map = self.params.weather.map.clone().or_else(|| rendered.cloned());
        let Ok(camera) = self.flight.camera() else { return };
        let eye = Frame::new(&camera, &self.params, self.time, [1, 1]).sky.weather_origin;
        self.weather.show(ui, &mut self.params, map.as_ref(), eye);
    }

    /// Plot of the device time of each pass in the last frames, ms.
    fn cost_plot(&self, ui: &mut Ui) {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in self.costs.iter().flat_map(|(_, passes)| passes) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        let plot = Plot::new("cost").height(180.0).legend(Legend::default()).allow_scroll(false).include_y(0.0);
        plot.show(ui, |plot| {
            for name in names {
                let at = |(count, passes): &(f64, Vec<(String, f64)>)| {
                    [*count, passes.iter().find(|(pass, _)| pass == name).map_or(0.0, |(_, time)| *time)]
                };
                plot.line(Line::new(name, self.costs.iter().map(at).collect::<PlotPoints<'_>>()));
            }
        });
    }

    /// Moves the sun to the position of the clock.
    fn apply_clock(&mut self) {
        match self.clock.sun() {
            Ok((elevation, azimuth)) => {
                let sun = [elevation as f32, azimuth as f32];
                [self.params.sun.elevation, self.params.sun.azimuth] = sun;
                (self.clock_sun, self.clock.is_approximate) = (Some(sun), false);
            }
            Err(error) => self.notice = format!("{error:#}"),
        }
    }

    /// One line whatever it says: a line more would change the size of the view, whose history starts anew.
    fn status(&mut self, ui: &mut Ui) {
        let is_report = self.notice.contains('\n');
        ui.horizontal(|ui| {
            let flight = &self.flight;
            ui.monospace(format!("{:>3.0}° {:<2}", flight.azimuth, flight.compass()));
            ui.monospace(format!("{:>7.0} m", flight.eye.z));
            let speed = if flight.flying { format!("{:.0} m/s", flight.speed) } else { "on foot".into() };
            ui.monospace(speed);
            if let Some(frame) = &self.rendered_frame {
                let [width, height] = frame.screen.size();
                let kind = if frame.still.is_some() { "still" } else { "moving" };
                ui.monospace(format!("{width} x {height} {kind} {:.0} ms", 1e3 * frame.elapsed.as_secs_f64()));
            }
            ui.separator();
            if !is_report {
                ui.add(egui::Label::new(&self.notice).truncate());
            }
        });
        if is_report {
            ui.label(&self.notice);
        }
    }

    fn view(&mut self, ui: &mut Ui) -> egui::Response {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        // Rectangle and texture coordinates of the part of the view between two fractions of its width.
        let part = |left: f32, right: f32| {
            let uv = egui::Rect::from_min_max(egui::pos2(left, 0.0), egui::pos2(right, 1.0));
            let x = |fraction| rect.left() + fraction * rect.width();
            (egui::Rect::from_x_y_ranges(x(left)..=x(right), rect.y_range()), uv)
        };
        let has_comparison = self.rendered_frame.as_ref().is_some_and(|frame| frame.comparison.is_some());
        let divider = if has_comparison { self.divider } else { 1.0 };
        if let Some(texture) = self.texture {
            let (area, uv) = part(0.0, divider);
            ui.painter().image(texture, area, uv, egui::Color32::WHITE);
        }
        if has_comparison {
            let (area, uv) = part(divider, 1.0);
            if let Some(texture) = self.comparison_texture {
                ui.painter().image(texture, area, uv, egui::Color32::WHITE);
            }
            let line = egui::Rect::from_x_y_ranges(area.left() - 1.0..=area.left() + 1.0, rect.y_range());
            ui.painter().rect_filled(line, 0.0, egui::Color32::WHITE);
            let handle = ui.interact(line.expand(5.0), ui.scope_id().with("divider"), Sense::drag());
            self.divider = (self.divider + handle.drag_delta().x / rect.width()).clamp(0.02, 0.98);
            handle.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal);
        }
        if let Some(hidden_since) = self.hidden_panels_since {
            help::panel_hint(ui, rect, hidden_since);
        }
        response.on_hover_cursor(egui::CursorIcon::Crosshair)
    }

    /// Advances camera, animation time, sun and weather by the time since the last window frame.
    fn advance(&mut self, ui: &Ui, view: &egui::Response) {
        let elapsed = self.last_advance.elapsed();
        self.last_advance = Instant::now();
        let seconds = elapsed.as_secs_f64().min(MAX_TIME_STEP);
        self.capture_pointer(ui, view);
        let mut controls = self.controls(ui, view);
        if self.options.fly && self.rendered_frame.is_some() {
            controls.movement[0] = 1.0;
        }
        self.flight.advance(&controls, seconds);
        if controls.is_active() {
            self.input_intervals.push(elapsed);
        }
        if self.playing {
            self.time += seconds;
        }
        let sun_moves = self.clock.advance(seconds);
        if sun_moves {
            self.apply_clock();
        }
        let weather_changes = self.weather.advance(&mut self.params, seconds);
        if controls.is_active() || self.flight.is_falling() || self.playing || sun_moves || weather_changes {
            // The next rendered frame repaints the window. Continuous repainting would leave a CPU adapter, which
            // draws the window too, no time to render frames.
            ui.ctx().request_repaint_after(MAX_REPAINT_INTERVAL);
        }
    }

    /// Moves the exposure toward the metered exposure by exponential smoothing, like the adaptation of an eye.
    fn adapt_exposure(&mut self, ui: &Ui) {
        let Some(metered) = self.metered_exposure.filter(|_| self.auto_exposure) else {
            self.last_adaptation = None;
            return;
        };
        let target = metered.clamp(*EXPOSURE_RANGE.start(), *EXPOSURE_RANGE.end());
        let difference = target - self.exposure;
        // The first step has zero length, however long the window was idle. The bound prevents a jump after a hitch.
        let elapsed = self.last_adaptation.replace(Instant::now()).map_or(Duration::ZERO, |last| last.elapsed());
        let seconds = elapsed.min(MAX_REPAINT_INTERVAL).as_secs_f32();
        if difference.abs() < EXPOSURE_TOLERANCE {
            self.exposure = target;
            self.last_adaptation = None;
        } else {
            self.exposure += difference * (1.0 - (-seconds / ADAPTATION_TIME).exp());
            ui.ctx().request_repaint_after(MAX_REPAINT_INTERVAL);
        }
    }

    /// Locks the pointer on a click in the view; Esc or a loss of focus releases it.
    fn capture_pointer(&mut self, ui: &Ui, view: &egui::Response) {
        let captured = if view.clicked() {
            view.surrender_focus();
            true
        } else {
            self.pointer_captured && !ui.input(|input| input.key_pressed(Key::Escape) || !input.focused)
        };
        if captured != self.pointer_captured {
            self.pointer_captured = captured;
            let grab = if captured { egui::CursorGrab::Locked } else { egui::CursorGrab::None };
            ui.ctx().send_viewport_cmd(ViewportCommand::CursorGrab(grab));
            ui.ctx().send_viewport_cmd(ViewportCommand::CursorVisible(!captured));
        }
    }

    fn controls(&mut self, ui: &Ui, view: &egui::Response) -> Controls {
        let mut controls = Controls::default();
        let typing = ui.ctx().egui_wants_keyboard_input();
        // Responses are read outside the `input` closure: they lock the context, which `input` holds locked.
        let (dragged, hovered) = (view.dragged_by(PointerButton::Primary).then(|| view.drag_delta()), view.hovered());
        ui.input(|input| {
            if !typing {
                let axis = |plus, minus| f64::from(input.key_down(plus)) - f64::from(input.key_down(minus));
                controls.movement = [axis(Key::W, Key::S), axis(Key::D, Key::A), axis(Key::E, Key::Q)];
                controls.fast = input.modifiers.shift;
                controls.slow = input.modifiers.ctrl;
                controls.jump = input.key_down(Key::Space);
                if input.key_pressed(Key::F) {
                    self.flight.toggle_flying();
                }
            }
            let rotation = if self.pointer_captured {
                input.pointer.motion().unwrap_or_default()
            } else {
                -dragged.unwrap_or_default()
            };
            controls.look = [DEGREES_PER_POINT * f64::from(rotation.x), -DEGREES_PER_POINT * f64::from(rotation.y)];
            if self.pointer_captured || hovered {
                controls.wheel = f64::from(input.smooth_scroll_delta().y) / 50.0;
            }
        });
        controls
    }

    /// Requests a frame of the current state.
    fn request_frame(&mut self, ui: &Ui, view: egui::Rect) {
        let scale = ui.pixels_per_point();
        let view_size = [view.width(), view.height()].map(|side| (side * scale).round().clamp(1.0, 8192.0) as u32);
        // A minimised window has no view.
        if view.width() < 1.0 || view.height() < 1.0 {
            return;
        }
        let camera = match self.flight.camera() {
            Ok(camera) => camera,
            Err(error) => {
                self.notice = error.to_string();
                return;
            }
        };
        let request = Request {
            camera,
            params: self.params.clone(),
            time: self.time,
            quality: self.quality.clone(),
            view_size,
            exposure: self.exposure,
            tone_map: self.tone_map,
            frame_budget: Some(Duration::from_secs_f64(1.0 / self.target_frame_rate)),
            debug_view: self.debug_view,
            comparison: self.comparison.apply(&self.params, &self.quality),
            recording_folder: self.recording_folder.clone(),
        };
        self.render_thread.request_frame(request.clone());
        self.last_request = Some(request);
    }

    /// Closes the window after the requested number of frames, or when no further frame will come.
    ///
    /// A requested screenshot is taken first.
    fn close_when_done(&mut self, ui: &Ui, view: egui::Rect) {
        let Some(frames) = self.options.frames.filter(|_| !self.closing) else { return };
        if view.width() < 1.0 || view.height() < 1.0 {
            let reason = format!(
                "the window has no room for a picture beside the panel of {PANEL_WIDTH} points: --size must be larger"
            );
            self.close_with_failure(ui, reason);
            return;
        }
        let count = self.rendered_frame.as_ref().map_or(0, |frame| frame.count);
        // Without motion there are two frames: an animated frame and the still.
        let is_last =
            |frame: &RenderedFrame| frame.still.is_some() && self.last_request.as_ref() == Some(&*frame.request);
        let at_rest = !self.options.fly && self.rendered_frame.as_ref().is_some_and(is_last);
        if count < frames && !at_rest {
            return;
        }
        if count < frames {
            println!("{count} pictures, not {frames}: nothing moves (--fly flies ahead)");
        }
        self.closing = true;
        self.print_statistics();
        let Some(path) = self.options.screenshot.clone() else {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            return;
        };
        let (context, failure) = (ui.ctx().clone(), self.options.failure.clone());
        ui.ctx().request_screenshot(move |image| {
            let pixels: Vec<_> = image.pixels.iter().flat_map(|pixel| pixel.to_array()).collect();
            if let Err(error) = files::write_png(&path, &pixels, image.size, 4) {
                let _ = failure.set(error.to_string());
            }
            context.send_viewport_cmd(ViewportCommand::Close);
        });
    }

    /// Prints median, 95th percentile and maximum of the frame intervals; benchmarks/demo.py parses the lines.
    fn print_statistics(&self) {
        let Some(frame) = &self.rendered_frame else { return };
        let [width, height] = frame.screen.size();
        let series =
            [("from picture to picture", &self.render_intervals), ("until a key is handled", &self.input_intervals)];
        for (name, intervals) in series {
            let measured = intervals.iter().skip(WARM_UP_FRAMES);
            let mut milliseconds: Vec<_> = measured.map(|interval| 1e3 * interval.as_secs_f64()).collect();
            milliseconds.sort_by(f64::total_cmp);
            let Some(last) = milliseconds.len().checked_sub(1) else { return };
            let [median, slow, worst] =
                [0.5, 0.95, 1.0].map(|quantile| milliseconds[(quantile * last as f64).round() as usize]);
            println!("ms {name}: median {median:.0}, 95 % {slow:.0}, worst {worst:.0}; {width} x {height} pixels");
        }
    }
}

/// Registers a screen as an egui texture, or redirects an existing texture to it.
fn update_texture(device: &RenderState, screen: &Screen, texture: &mut Option<egui::TextureId>) {
    let mut renderer = device.renderer.write();
    let view = screen.view();
    match *texture {
        Some(id) => renderer.update_egui_texture_from_wgpu_texture(&device.device, view, FilterMode::Linear, id),
        None => *texture = Some(renderer.register_native_texture(&device.device, view, FilterMode::Linear)),
    }
}

/// Second still, shown for comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Comparison {
    None,
    Quality(&'static str),
    Light(Model),
}

impl Comparison {
    /// Choices in the order of the menu.
    fn all() -> impl Iterator<Item = Self> {
        use Model::{Multiple, Nubis2015, Octaves, Path, Single, Thesis2018, Vsu2022};
        let models = [Single, Nubis2015, Thesis2018, Vsu2022, Octaves, Multiple, Path];
        let qualities = Quality::NAMES.into_iter().map(Self::Quality);
        [Self::None].into_iter().chain(qualities).chain(models.map(Self::Light))
    }

    fn name(self) -> String {
        match self {
            Self::None => "nothing".into(),
            Self::Quality(name) => name.into(),
            Self::Light(model) => format!("light {model:?}").to_lowercase(),
        }
    }

    /// Parameters and quality of the second still, derived from those of the first.
    fn apply(self, params: &Params, quality: &Quality) -> Option<(Params, Quality)> {
        match self {
            Self::None => None,
            Self::Quality(name) => Some((params.clone(), Quality::named(name).ok()?)),
            Self::Light(model) => {
                let mut params = params.clone();
                params.light.model = model;
                Some((params, quality.clone()))
            }
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        self.frame(ui, frame.wgpu_render_state());
    }
}
