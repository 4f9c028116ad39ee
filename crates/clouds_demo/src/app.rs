//! The window: one function that reads top to bottom.

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

use crate::flight::{Controls, Flight};
use crate::help;
use crate::painter::{Painter, Shown, Wish};
use crate::panel::{self, Panel};
use crate::preset::{self, Shot};
use crate::sight::Sight;
use crate::sun::Clock;
use crate::watch::{self, Watch};
use crate::weather::WeatherPanel;

/// Degrees that a dragged or captured pointer turns the view for each point.
const TURN: f64 = 0.15;
/// Longest step of the flight, s: after a hitch nobody is elsewhere at once.
const LONGEST_STEP: f64 = 0.25;
/// Stops that the slider offers.
const EXPOSURES: RangeInclusive<f32> = -8.0..=16.0;
/// The time in which the automatic exposure goes all but a third of its way, s: in half a second it is there but for a twentieth.
const ADAPTATION: f32 = 0.17;
/// Stops that nobody sees: the last step of the way.
const UNSEEN: f32 = 0.01;
/// Width of the panel, points.
const PANEL: f32 = 360.0;
/// Pictures whose costs are plotted.
const COSTS: usize = 120;
/// When the window is painted again although no picture has come, while anything moves.
const LONGEST_WAIT: Duration = Duration::from_millis(100);
/// The methods that the menu offers.
const QUALITIES: [&str; 3] = ["draft", "balanced", "high"];
/// Places to be: name, altitude in m, degrees above the horizon.
const PLACES: [(&str, f64, f64); 4] =
    [("ground", 1.7, 12.0), ("in cloud", 1900.0, 2.0), ("above", 4500.0, -12.0), ("space", 300_000.0, -18.0)];

/// What the command line asks for.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// A scene's name, or a TOML file.
    pub scene: Option<String>,
    /// Part of an adapter's name.
    pub adapter: Option<String>,
    /// Leave after so many pictures.
    pub frames: Option<u64>,
    /// Where a picture of the window goes then.
    pub screenshot: Option<PathBuf>,
    /// Frames a second that moving pictures shall reach.
    pub rate: Option<f64>,
    /// Forward from the first picture on.
    pub fly: bool,
    /// Why the window has left without what it was asked for.
    pub failed: Arc<OnceLock<String>>,
}

/// The window's state.
pub struct App {
    start: Start,
    painter: Painter,
    scenes: Vec<(String, Camera, Params)>,
    flight: Flight,
    params: Params,
    time: f64,
    playing: bool,
    clock: Clock,
    /// Elevation and azimuth of the sun that the clock reads.
    read: Option<[f32; 2]>,
    quality: Quality,
    quality_name: String,
    exposure: f32,
    /// Whether the exposure is that of the last still.
    auto: bool,
    /// What the last still asks for, stops.
    metered: Option<f32>,
    /// When the exposure was last moved toward that, while it is on its way.
    adapted: Option<Instant>,
    tone_map: &'static str,
    sight: Sight,
    rate: f64,
    panel: Panel,
    weather: WeatherPanel,
    /// What the last pictures cost, by pass.
    costs: VecDeque<(f64, Vec<(String, f64)>)>,
    captured: bool,
    /// Whether the keys are listed.
    help: bool,
    /// Since when there is nothing but the view.
    bare: Option<Instant>,
    beside: Beside,
    /// Where the bar between the two is, as a share of the view.
    bar: f32,
    /// Where moving pictures are kept.
    record: Option<PathBuf>,
    folder: PathBuf,
    /// What was done last, or went wrong.
    notice: String,
    /// What is wished for.
    asked: Option<Wish>,
    shown: Option<Shown>,
    texture: Option<egui::TextureId>,
    texture_beside: Option<egui::TextureId>,
    watch: Option<Watch>,
    last_step: Instant,
    last_picture: Instant,
    /// From one picture to the next.
    intervals: Vec<Duration>,
    /// From one frame of the window to the next, while anything moved: as long may a key wait.
    waits: Vec<Duration>,
    leaving: bool,
}

impl App {
    /// A window on the clouds of a device, which it shares.
    pub fn new(context: &egui::Context, gpu: Arc<Gpu>, start: Start) -> Result<Self> {
        let repaint = context.clone();
        // Without a wait egui would paint twice.
        let soon = Duration::from_millis(1);
        let painter = Painter::new(gpu.clone(), start.adapter.clone(), move || repaint.request_repaint_after(soon));
        let scenes = preset::scenes()?;
        let name = start.scene.clone().unwrap_or_else(|| "fair_weather".into());
        let (flight, params) = match scenes.iter().find(|(scene, ..)| *scene == name) {
            Some((_, camera, params)) => (Flight::at(camera), params.clone()),
            None if Path::new(&name).exists() => (Flight::at(&scenes[0].1), preset::load(Path::new(&name))?),
            None => {
                let names: Vec<_> = scenes.iter().map(|(name, ..)| name.as_str()).collect();
                anyhow::bail!("{name:?} is neither a TOML file nor a scene: {}", names.join(", "));
            }
        };
        Ok(Self {
            rate: start.rate.unwrap_or(if gpu.info.kind == "cpu" { 10.0 } else { 60.0 }),
            start,
            painter,
            scenes,
            flight,
            params,
            time: 0.0,
            playing: false,
            clock: Clock::default(),
            read: None,
            quality: Quality::named("balanced")?,
            quality_name: "balanced".into(),
            exposure: 0.0,
            auto: false,
            metered: None,
            adapted: None,
            tone_map: TONE_MAPS[0],
            sight: Sight::Picture,
            panel: Panel::default(),
            weather: WeatherPanel::default(),
            costs: VecDeque::new(),
            captured: false,
            help: false,
            bare: None,
            beside: Beside::Nothing,
            bar: 0.5,
            record: None,
            folder: std::env::current_dir().unwrap_or_default(),
            notice: String::new(),
            asked: None,
            shown: None,
            texture: None,
            texture_beside: None,
            watch: Watch::new(std::env::var_os("NUBIS_SHADERS")),
            last_step: Instant::now(),
            last_picture: Instant::now(),
            intervals: Vec::new(),
            waits: Vec::new(),
            leaving: false,
        })
    }

    /// The picture that is shown.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// What was done last, or went wrong.
    pub fn notice(&self) -> &str {
        &self.notice
    }

    /// Someone on their way.
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    /// The sky.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The time of the clouds, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Whether the window closes.
    pub fn is_leaving(&self) -> bool {
        self.leaving
    }

    /// Where the bar between the picture and what is beside it is, as a share of the view.
    pub fn bar(&self) -> f32 {
        self.bar
    }

    /// One frame of the window.
    pub fn frame(&mut self, ui: &mut Ui, device: Option<&RenderState>) {
        self.hear_commands(ui);
        self.look_at_shaders(ui);
        self.receive(ui, device);
        self.read_dropped_files(ui);
        self.read_clock();
        if self.bare.is_none() {
            egui::Panel::top("top").show(ui, |ui| self.menu(ui));
            egui::Panel::bottom("status").show(ui, |ui| self.status(ui));
            egui::Panel::left("panel").resizable(false).exact_size(PANEL).show(ui, |ui| self.settings(ui));
        }
        help::keys(ui.ctx(), &mut self.help);
        let view = egui::CentralPanel::no_frame().show(ui, |ui| self.view(ui)).inner;
        self.go_on(ui, &view);
        self.adapt(ui);
        self.ask(ui, view.rect);
        self.leave_when_done(ui, view.rect);
    }

    /// Takes a new picture, or a problem, from the painter.
    fn receive(&mut self, ui: &Ui, device: Option<&RenderState>) {
        match self.painter.problem() {
            // Errors of shaders are drawn with lines that the font lacks.
            Some(problem @ (Error::Parameter(_) | Error::File(_))) => {
                self.notice = problem.to_string().replace(['┌', '─', '│'], " ");
                if self.start.frames.is_some() {
                    // Nobody is there to mend it.
                    self.give_up(ui, problem.to_string());
                }
            }
            Some(problem) => {
                // Nothing more can be painted, and the window is on the same device.
                self.notice = problem.to_string();
                self.give_up(ui, problem.to_string());
            }
            None => {}
        }
        if let Some(path) = self.painter.written() {
            self.notice = format!("wrote {}", path.display());
        }
        let Some(shown) = self.painter.shown() else { return };
        if self.shown.as_ref().is_some_and(|old| old.count == shown.count) {
            return;
        }
        if let Some(device) = device {
            show_screen(device, &shown.screen, &mut self.texture);
            if let Some(beside) = &shown.beside {
                show_screen(device, beside, &mut self.texture_beside);
            }
        }
        self.costs.push_back((shown.count as f64, shown.timings.0.clone()));
        if self.costs.len() > COSTS {
            self.costs.pop_front();
        }
        self.intervals.push(self.last_picture.elapsed());
        self.last_picture = Instant::now();
        self.metered = shown.metered.or(self.metered);
        self.shown = Some(shown);
    }

    /// Keys of the window itself.
    fn hear_commands(&mut self, ui: &Ui) {
        let pressed = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
        if pressed(egui::Modifiers::COMMAND, Key::Q) {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
        if pressed(egui::Modifiers::NONE, Key::F1) {
            self.help = !self.help;
        }
        if pressed(egui::Modifiers::NONE, Key::F2) {
            self.bare = self.bare.is_none().then(Instant::now);
        }
    }

    /// Leaves without what was asked for, and says why.
    fn give_up(&mut self, ui: &Ui, why: String) {
        self.leaving = true;
        let _ = self.start.failed.set(why);
        ui.ctx().send_viewport_cmd(ViewportCommand::Close);
    }

    /// Where something else has put the sun, the clock goes to the hour at which it stands there.
    fn read_clock(&mut self) {
        let sun = [self.params.sun.elevation, self.params.sun.azimuth];
        if self.read != Some(sun) {
            self.clock = self.clock.at_sun(f64::from(sun[0]), f64::from(sun[1]));
            self.read = Some(sun);
        }
    }

    fn look_at_shaders(&mut self, ui: &Ui) {
        let Some(watch) = &mut self.watch else { return };
        if watch.has_changed() {
            self.notice = "reading the shaders".into();
            self.painter.reload();
        }
        ui.ctx().request_repaint_after(watch::EVERY);
    }

    fn read_dropped_files(&mut self, ui: &Ui) {
        let dropped = ui.input(|input| input.raw.dropped_files.clone());
        if let Some(path) = dropped.first().map(|file| file.path().to_path_buf()) {
            let loaded = preset::load(&path).map(|params| self.params = params);
            self.say(loaded, format!("read {}", path.display()));
        }
    }

    fn say(&mut self, outcome: Result<()>, done: String) {
        self.notice = outcome.map_or_else(|error| format!("{error:#}"), |()| done);
    }

    fn menu(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            panel::menu(ui, "scene", "go to", |ui| {
                for (name, camera, params) in &self.scenes {
                    if ui.selectable_label(false, name.replace('_', " ")).clicked() {
                        (self.flight, self.params) = (Flight::at(camera), params.clone());
                    }
                }
            });
            for (name, altitude, pitch) in PLACES {
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
            panel::menu(ui, "shown", self.sight.name(), |ui| {
                for sight in Sight::ALL {
                    ui.selectable_value(&mut self.sight, sight, sight.name());
                }
            });
            panel::menu(ui, "beside", &self.beside.name(), |ui| {
                for beside in Beside::all() {
                    ui.selectable_value(&mut self.beside, beside, beside.name());
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
                self.say_path(saved);
            }
            if ui.button("Save sky").on_hover_text("TOML; drop such a file here to read it").clicked() {
                let path = self.free_path("sky", "toml");
                let saved = preset::save(&path, &self.params).map(|()| path);
                self.say_path(saved);
            }
            let panorama = ui.button("Panorama").on_hover_text("the whole sphere, EXR and PNG; it may take a while");
            if panorama.clicked() {
                self.painter.ask_panorama(self.free_path("panorama", "exr"));
                self.notice = "making a panorama".into();
            }
            let mut recording = self.record.is_some();
            let record = ui.toggle_value(&mut recording, "Record");
            if record.on_hover_text("keeps moving pictures as they come, PNG, in a new folder").changed() {
                self.set_recording(recording);
            }
            if ui.button("Copy as Python").clicked() {
                let copied = self.python().map(|code| ui.ctx().copy_text(code));
                self.say(copied, "copied".into());
            }
            ui.separator();
            let exposure = egui::Slider::new(&mut self.exposure, EXPOSURES).suffix(" stops");
            panel::labelled(ui, "exposure", |ui| ui.add_enabled(!self.auto, exposure));
            ui.checkbox(&mut self.auto, "auto").on_hover_text("as the last picture at rest asks for");
            let rate = egui::Slider::new(&mut self.rate, 2.0..=120.0).logarithmic(true).suffix(" Hz");
            panel::labelled(ui, "wanted", |ui| ui.add(rate)).on_hover_text("frames a second while anything moves");
            ui.separator();
            ui.toggle_value(&mut self.help, "F1 keys");
            if ui.button("F2 view alone").on_hover_text("hides the panels").clicked() {
                self.bare = Some(Instant::now());
            }
        });
    }

    fn set_recording(&mut self, on: bool) {
        self.record = None;
        if on {
            let folder = self.free_path("frames", "d");
            let made = std::fs::create_dir(&folder).with_context(|| format!("{} cannot be made", folder.display()));
            self.record = made.is_ok().then(|| folder.clone());
            self.say(made, format!("recording into {}", folder.display()));
        }
    }

    fn say_path(&mut self, saved: Result<PathBuf>) {
        self.notice = saved.map_or_else(|error| format!("{error:#}"), |path| format!("wrote {}", path.display()));
    }

    /// The first name with a number that is not taken.
    fn free_path(&self, stem: &str, extension: &str) -> PathBuf {
        let path = |n: u32| self.folder.join(format!("{stem}{n}.{extension}"));
        (1..).map(path).find(|path| !path.exists()).expect("numbers do not end")
    }

    /// Writes the still that is shown.
    fn save_picture(&self) -> Result<PathBuf> {
        let shown = self.shown.as_ref().filter(|shown| self.asked.as_ref() == Some(&*shown.wish));
        let shown = shown.filter(|shown| shown.wish.sight == Sight::Picture);
        let still = shown.and_then(|shown| Some((shown, shown.still.as_ref()?)));
        let (shown, picture) = still.context("hold still until the picture is at its best, then save it")?;
        let (size, wish) = (shown.screen.size().map(|side| side as usize), &shown.wish);
        let path = self.free_path("sky", "png");
        let pixels = to_srgb8(&picture.image, 4, size[0], wish.exposure, wish.tone_map, true)?;
        files::write_png(&path, &pixels, size, 4)?;
        files::write_exr(&path.with_extension("exr"), &picture.image, size, 4)?;
        Ok(path)
    }

    /// The lines that make the picture at rest.
    fn python(&self) -> Result<String> {
        let camera = self.flight.camera()?;
        let file = if preset::needs_file(&self.params) {
            let path = self.free_path("sky", "toml");
            preset::save(&path, &self.params)?;
            Some(path.display().to_string())
        } else {
            None
        };
        let size = self.shown.as_ref().map_or([960, 540], |shown| shown.wish.window);
        let shot = Shot {
            camera: &camera,
            params: &self.params,
            time: self.time,
            quality: &self.quality_name,
            size,
            exposure: self.exposure,
            tone_map: self.tone_map,
        };
        Ok(preset::python(&shot, file.as_deref()))
    }

    fn settings(&mut self, ui: &mut Ui) {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.add(egui::TextEdit::singleline(&mut self.panel.search).hint_text("search"));
            if let Some(refused) = &self.panel.refused {
                ui.colored_label(ui.visuals().error_fg_color, refused);
            }
            egui::CollapsingHeader::new("time").default_open(true).show(ui, |ui| self.times(ui));
            egui::CollapsingHeader::new("weather map").show(ui, |ui| self.weather_map(ui));
            egui::CollapsingHeader::new("cost").show(ui, |ui| self.plot(ui));
            let before = self.params.clone();
            if self.panel.sky(ui, &mut self.params) {
                // Another wind blows from now on: the clouds go on from where they are.
                self.params.drift = self.params.after(&before, self.time);
            }
            let usual = Quality::named(&self.quality_name).unwrap_or_default();
            self.panel.quality(ui, &mut self.quality, &usual);
        });
    }

    /// The clouds' time and that of the day.
    fn times(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.toggle_value(&mut self.playing, "wind blows");
            ui.add(egui::DragValue::new(&mut self.time).speed(1.0).suffix(" s"));
            ui.separator();
            ui.toggle_value(&mut self.clock.playing, "sun moves");
        });
        let before = Clock { playing: false, ..self.clock };
        // Formatted and not rounded: what a slider rounds, it changes.
        let hour =
            egui::Slider::new(&mut self.clock.hour, 0.0..=24.0).suffix(" h").custom_formatter(|v, _| format!("{v:.2}"));
        panel::field(ui, "hour", |ui| ui.add(hour)).on_hover_text("local solar time: the sun is highest about noon");
        let rate = egui::Slider::new(&mut self.clock.rate, 0.1..=60.0).logarithmic(true).suffix(" h/min");
        panel::field(ui, "rate", |ui| ui.add(rate));
        let latitude = egui::Slider::new(&mut self.clock.latitude, -90.0..=90.0)
            .suffix("°")
            .custom_formatter(|v, _| format!("{v:.1}"));
        panel::field(ui, "latitude", |ui| ui.add(latitude));
        panel::field(ui, "day of the year", |ui| ui.add(egui::Slider::new(&mut self.clock.day, 1..=365)));
        if self.clock.by_hand {
            ui.weak("The sun is placed by hand; this is the nearest hour.");
        }
        let changed = Clock { playing: false, rate: before.rate, ..self.clock } != before;
        if changed {
            self.set_sun();
        }
    }

    fn weather_map(&mut self, ui: &mut Ui) {
        let shown = self.shown.as_ref().and_then(|shown| shown.map.as_ref());
        let map = self.params.weather.map.clone().or_else(|| shown.cloned());
        let Ok(camera) = self.flight.camera() else { return };
        let eye = Frame::new(&camera, &self.params, self.time, [1, 1]).sky.weather_origin;
        self.weather.show(ui, &mut self.params, map.as_ref(), eye);
    }

    /// Milliseconds on the device of each pass of the last pictures.
    fn plot(&self, ui: &mut Ui) {
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

    fn set_sun(&mut self) {
        match self.clock.sun() {
            Ok((elevation, azimuth)) => {
                let sun = [elevation as f32, azimuth as f32];
                [self.params.sun.elevation, self.params.sun.azimuth] = sun;
                (self.read, self.clock.by_hand) = (Some(sun), false);
            }
            Err(error) => self.notice = format!("{error:#}"),
        }
    }

    fn status(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let flight = &self.flight;
            ui.monospace(format!("{:>3.0}° {:<2}", flight.azimuth, flight.compass()));
            ui.monospace(format!("{:>7.0} m", flight.eye.z));
            let speed = if flight.flying { format!("{:.0} m/s", flight.speed) } else { "on foot".into() };
            ui.monospace(speed);
            if let Some(shown) = &self.shown {
                let [width, height] = shown.screen.size();
                let kind = if shown.still.is_some() { "still" } else { "moving" };
                ui.monospace(format!("{width} x {height} {kind} {:.0} ms", 1e3 * shown.took.as_secs_f64()));
            }
            ui.separator();
            ui.label(&self.notice);
        });
    }

    fn view(&mut self, ui: &mut Ui) -> egui::Response {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let part = |left: f32, right: f32| {
            let uv = egui::Rect::from_min_max(egui::pos2(left, 0.0), egui::pos2(right, 1.0));
            let across = |share| rect.left() + share * rect.width();
            (egui::Rect::from_x_y_ranges(across(left)..=across(right), rect.y_range()), uv)
        };
        let beside = self.shown.as_ref().is_some_and(|shown| shown.beside.is_some());
        let bar = if beside { self.bar } else { 1.0 };
        if let Some(texture) = self.texture {
            let (place, uv) = part(0.0, bar);
            ui.painter().image(texture, place, uv, egui::Color32::WHITE);
        }
        if beside {
            let (place, uv) = part(bar, 1.0);
            if let Some(texture) = self.texture_beside {
                ui.painter().image(texture, place, uv, egui::Color32::WHITE);
            }
            let line = egui::Rect::from_x_y_ranges(place.left() - 1.0..=place.left() + 1.0, rect.y_range());
            ui.painter().rect_filled(line, 0.0, egui::Color32::WHITE);
            let handle = ui.interact(line.expand(5.0), ui.scope_id().with("bar"), Sense::drag());
            self.bar = (self.bar + handle.drag_delta().x / rect.width()).clamp(0.02, 0.98);
            handle.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal);
        }
        if let Some(since) = self.bare {
            help::way_back(ui, rect, since);
        }
        response.on_hover_cursor(egui::CursorIcon::Crosshair)
    }

    /// Moves the visitor, the clouds and the sun by the time since the last frame.
    fn go_on(&mut self, ui: &Ui, view: &egui::Response) {
        let waited = self.last_step.elapsed();
        self.last_step = Instant::now();
        let seconds = waited.as_secs_f64().min(LONGEST_STEP);
        self.capture(ui, view);
        let mut controls = self.controls(ui, view);
        if self.start.fly && self.shown.is_some() {
            controls.toward[0] = 1.0;
        }
        self.flight.step(&controls, seconds);
        if controls.is_any() {
            self.waits.push(waited);
        }
        if self.playing {
            self.time += seconds;
        }
        let sun_moves = self.clock.step(seconds);
        if sun_moves {
            self.set_sun();
        }
        let weather_changes = self.weather.step(&mut self.params, seconds);
        if controls.is_any() || self.flight.is_falling() || self.playing || sun_moves || weather_changes {
            // The next picture repaints the window. To do it as often as one can would leave a processor that draws both
            // no time for pictures.
            ui.ctx().request_repaint_after(LONGEST_WAIT);
        }
    }

    /// Moves the exposure toward what the last still asks for, as eyes do.
    fn adapt(&mut self, ui: &Ui) {
        let Some(metered) = self.metered.filter(|_| self.auto) else {
            self.adapted = None;
            return;
        };
        let target = metered.clamp(*EXPOSURES.start(), *EXPOSURES.end());
        let left = target - self.exposure;
        // The way begins now, however long the window has been at rest, and a hitch is no jump.
        let waited = self.adapted.replace(Instant::now()).map_or(Duration::ZERO, |last| last.elapsed());
        let seconds = waited.min(LONGEST_WAIT).as_secs_f32();
        if left.abs() < UNSEEN {
            self.exposure = target;
            self.adapted = None;
        } else {
            self.exposure += left * (1.0 - (-seconds / ADAPTATION).exp());
            ui.ctx().request_repaint_after(LONGEST_WAIT);
        }
    }

    /// A click in the view takes the pointer, Esc gives it back.
    fn capture(&mut self, ui: &Ui, view: &egui::Response) {
        let wanted = if view.clicked() {
            view.surrender_focus();
            true
        } else {
            self.captured && !ui.input(|input| input.key_pressed(Key::Escape) || !input.focused)
        };
        if wanted != self.captured {
            self.captured = wanted;
            let grab = if wanted { egui::CursorGrab::Locked } else { egui::CursorGrab::None };
            ui.ctx().send_viewport_cmd(ViewportCommand::CursorGrab(grab));
            ui.ctx().send_viewport_cmd(ViewportCommand::CursorVisible(!wanted));
        }
    }

    fn controls(&mut self, ui: &Ui, view: &egui::Response) -> Controls {
        let mut controls = Controls::default();
        let typing = ui.ctx().egui_wants_keyboard_input();
        // Asked before: what is asked for within `input` waits for itself.
        let (dragged, hovered) = (view.dragged_by(PointerButton::Primary).then(|| view.drag_delta()), view.hovered());
        ui.input(|input| {
            if !typing {
                let axis = |plus, minus| f64::from(input.key_down(plus)) - f64::from(input.key_down(minus));
                controls.toward = [axis(Key::W, Key::S), axis(Key::D, Key::A), axis(Key::E, Key::Q)];
                controls.fast = input.modifiers.shift;
                controls.slow = input.modifiers.ctrl;
                controls.jump = input.key_down(Key::Space);
                if input.key_pressed(Key::F) {
                    self.flight.switch();
                }
            }
            let turned =
                if self.captured { input.pointer.motion().unwrap_or_default() } else { -dragged.unwrap_or_default() };
            controls.look = [TURN * f64::from(turned.x), -TURN * f64::from(turned.y)];
            if self.captured || hovered {
                controls.wheel = f64::from(input.smooth_scroll_delta().y) / 50.0;
            }
        });
        controls
    }

    /// Wishes for the picture of now.
    fn ask(&mut self, ui: &Ui, rect: egui::Rect) {
        let scale = ui.pixels_per_point();
        let window = [rect.width(), rect.height()].map(|side| (side * scale).round().clamp(1.0, 8192.0) as u32);
        // A minimised window has no view.
        if rect.width() < 1.0 || rect.height() < 1.0 {
            return;
        }
        let camera = match self.flight.camera() {
            Ok(camera) => camera,
            Err(error) => {
                self.notice = error.to_string();
                return;
            }
        };
        let wish = Wish {
            camera,
            params: self.params.clone(),
            time: self.time,
            quality: self.quality.clone(),
            window,
            exposure: self.exposure,
            tone_map: self.tone_map,
            wanted: Some(Duration::from_secs_f64(1.0 / self.rate)),
            sight: self.sight,
            beside: self.beside.apply(&self.params, &self.quality),
            record: self.record.clone(),
        };
        self.painter.ask(wish.clone());
        self.asked = Some(wish);
    }

    /// After as many pictures as were asked for, or all that there will be, perhaps with a picture of the window.
    fn leave_when_done(&mut self, ui: &Ui, view: egui::Rect) {
        let Some(frames) = self.start.frames.filter(|_| !self.leaving) else { return };
        if view.width() < 1.0 || view.height() < 1.0 {
            let why = format!(
                "the window has no room for a picture beside the panel of {PANEL} points: --size must be larger"
            );
            self.give_up(ui, why);
            return;
        }
        let count = self.shown.as_ref().map_or(0, |shown| shown.count);
        // Where nothing moves there is one picture by the moving method and one at its best, and no other.
        let is_last = |shown: &Shown| shown.still.is_some() && self.asked.as_ref() == Some(&*shown.wish);
        let at_rest = !self.start.fly && self.shown.as_ref().is_some_and(is_last);
        if count < frames && !at_rest {
            return;
        }
        if count < frames {
            println!("{count} pictures, not {frames}: nothing moves (--fly flies ahead)");
        }
        self.leaving = true;
        self.print_intervals();
        let Some(path) = self.start.screenshot.clone() else {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            return;
        };
        let (context, failed) = (ui.ctx().clone(), self.start.failed.clone());
        ui.ctx().request_screenshot(move |image| {
            let pixels: Vec<_> = image.pixels.iter().flat_map(|pixel| pixel.to_array()).collect();
            if let Err(error) = files::write_png(&path, &pixels, image.size, 4) {
                let _ = failed.set(error.to_string());
            }
            context.send_viewport_cmd(ViewportCommand::Close);
        });
    }

    /// What a recorded flight took: the first pictures compile and bake, and are left out.
    fn print_intervals(&self) {
        let Some(shown) = &self.shown else { return };
        let [width, height] = shown.screen.size();
        for (what, times) in [("from picture to picture", &self.intervals), ("until a key is heard", &self.waits)] {
            let mut milliseconds: Vec<_> = times.iter().skip(5).map(|time| 1e3 * time.as_secs_f64()).collect();
            milliseconds.sort_by(f64::total_cmp);
            let Some(last) = milliseconds.len().checked_sub(1) else { return };
            let [median, slow, worst] =
                [0.5, 0.95, 1.0].map(|share| milliseconds[(share * last as f64).round() as usize]);
            println!("ms {what}: median {median:.0}, 95 % {slow:.0}, worst {worst:.0}; {width} x {height} pixels");
        }
    }
}

/// Gives the window a screen to sample, in place of the one before.
fn show_screen(device: &RenderState, screen: &Screen, texture: &mut Option<egui::TextureId>) {
    let mut renderer = device.renderer.write();
    let view = screen.view();
    match *texture {
        Some(id) => renderer.update_egui_texture_from_wgpu_texture(&device.device, view, FilterMode::Linear, id),
        None => *texture = Some(renderer.register_native_texture(&device.device, view, FilterMode::Linear)),
    }
}

/// What is shown beside the picture at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Beside {
    Nothing,
    Quality(&'static str),
    Light(Model),
}

impl Beside {
    /// All that can be chosen.
    fn all() -> impl Iterator<Item = Self> {
        let models = [Model::Single, Model::Nubis2015, Model::Thesis2018, Model::Vsu2022, Model::Octaves, Model::Path];
        let qualities = Quality::NAMES.into_iter().map(Self::Quality);
        [Self::Nothing].into_iter().chain(qualities).chain(models.map(Self::Light))
    }

    fn name(self) -> String {
        match self {
            Self::Nothing => "nothing".into(),
            Self::Quality(name) => name.into(),
            Self::Light(model) => format!("light {model:?}").to_lowercase(),
        }
    }

    /// The sky and the method, of those of the picture.
    fn apply(self, params: &Params, quality: &Quality) -> Option<(Params, Quality)> {
        match self {
            Self::Nothing => None,
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
