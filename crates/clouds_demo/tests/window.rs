//! Tests of the window without a display: `egui_kittest` supplies input, and any available adapter renders.

mod read;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clouds_core::color::{Metering, auto_exposure};
use clouds_core::params::Model;
use clouds_core::{Gpu, Screen};
use clouds_demo::app::{App, Options};
use clouds_demo::debug_view::DebugView;
use clouds_demo::render_thread::RenderedFrame;
use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, OutputCommand, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

/// Timeout of each wait, ample for a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

fn gpu() -> Arc<Gpu> {
    Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter")
}

fn window(options: Options) -> Harness<'static, App> {
    scaled_window(options, 1.0)
}

/// Margin that the harness adds around the window, points.
const MARGIN: f32 = 8.0;
/// Width of the left panel, points.
const PANEL_WIDTH: f32 = 360.0;

/// Window of 500 x 400 points; the view is 140 points wide.
fn scaled_window(options: Options, pixels_per_point: f32) -> Harness<'static, App> {
    sized_window(options, [500.0, 400.0], pixels_per_point)
}

fn sized_window(options: Options, points: [f32; 2], pixels_per_point: f32) -> Harness<'static, App> {
    let app = App::new(&egui::Context::default(), gpu(), options).expect("starts");
    let size = Vec2::from(points) + Vec2::splat(2.0 * MARGIN);
    let builder = Harness::builder().with_size(size).with_pixels_per_point(pixels_per_point);
    builder.build_ui_state(|ui, app: &mut App| app.frame(ui, None), app)
}

/// Steps the window until a condition holds.
fn step_until(harness: &mut Harness<'_, App>, goal: &str, condition: impl Fn(&App) -> bool) {
    let started = Instant::now();
    while !condition(harness.state()) {
        assert!(started.elapsed() < TIMEOUT, "{goal}: not within {TIMEOUT:?}; {}", harness.state().notice());
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

/// Steps the window until the still of the current parameters is displayed.
fn wait_for_still(harness: &mut Harness<'_, App>) {
    harness.run_steps(2);
    step_until(harness, "a picture at rest", |app| {
        app.rendered_frame().is_some_and(|frame| frame.still.is_some() && frame.request.params == *app.params())
    });
}

/// Text that the button copies.
fn copied(harness: &mut Harness<'_, App>) -> String {
    harness.get_by_label("Copy as Python").click();
    harness.step();
    let copied = harness.output().platform_output.commands.iter().find_map(|command| match command {
        OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    copied.expect("is copied")
}

#[test]
fn keys_move_the_camera_and_the_frame_follows() {
    let mut harness = window(Options::default());
    wait_for_still(&mut harness);
    let before = harness.state().flight().eye;
    harness.key_down(Key::W);
    step_until(&mut harness, "flight north", |app| app.flight().eye.y > before.y + 20.0);
    harness.key_up(Key::W);
    harness.run_steps(2);
    let there = harness.state().flight().eye;
    // The pitch of the scene is 14 degrees, whose tangent is 0.2493.
    assert!(there.x.abs() < 1e-6 && ((there.z - before.z) / (there.y - before.y) - 0.2493).abs() < 1e-3, "{there}");
    step_until(&mut harness, "a picture from there", |app| {
        app.rendered_frame().is_some_and(|frame| frame.request.camera.eye == there && frame.still.is_some())
    });
}

#[test]
fn the_search_filters_the_fields_and_edits_change_the_sky() {
    let mut harness = window(Options::default());
    harness.run_steps(2);
    assert!(harness.query_by_label("clouds").is_some());
    harness.get_by_role(Role::TextInput).focus();
    harness.run_steps(2);
    harness.get_by_role(Role::TextInput).type_text("light shafts");
    harness.run_steps(5);
    assert!(harness.query_by_label("clouds").is_none());
    assert!(harness.state().params().atmosphere.light_shafts);
    harness.get_by_role_and_label(Role::CheckBox, "light shafts").scroll_to_me();
    harness.run_steps(10);
    harness.get_by_role_and_label(Role::CheckBox, "light shafts").click();
    harness.run_steps(3);
    assert!(!harness.state().params().atmosphere.light_shafts);
    wait_for_still(&mut harness);
}

#[test]
fn buttons_move_the_camera_and_copy_python() {
    let mut harness = window(Options { scene: Some("storm".into()), ..Options::default() });
    harness.run_steps(2);
    harness.get_by_label("space").click();
    harness.run_steps(2);
    assert_eq!(harness.state().flight().eye.z, 300_000.0);
    harness.get_by_label("ground").click();
    harness.run_steps(2);
    assert!(harness.state().flight().eye.z < 2.0);
    let code = copied(&mut harness);
    assert!(code.contains("nubis.Params().with_(") && code.contains("\"sun.elevation\": 28.0"), "{code}");
}

#[test]
fn the_automatic_exposure_adapts_gradually_without_rendering() {
    let mut harness = window(Options { scene: Some("sunset".into()), ..Options::default() });
    wait_for_still(&mut harness);
    let still = |harness: &Harness<'_, App>| {
        harness.state().rendered_frame().expect("is shown").still.clone().expect("is at rest")
    };
    // A busy render thread skips exposures of the window.
    let displayed = |app: &App| app.rendered_frame().expect("is shown").request.exposure;
    let before = still(&harness);
    let wanted = auto_exposure(&before.image, 4, Metering::default()).expect("is allowed") as f32;
    assert!(wanted.abs() > 0.3, "{wanted}");
    let first = |harness: &Harness<'_, App>| {
        harness.get_all_by_role(Role::Slider).next().expect("is there").accesskit_node().is_disabled()
    };
    assert!(!first(&harness));
    harness.get_by_label("auto").click();
    let mut exposures = vec![0.0];
    let started = Instant::now();
    while exposures.last() != Some(&wanted) || displayed(harness.state()) != wanted {
        assert!(started.elapsed() < TIMEOUT, "{exposures:?}, not {wanted}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
        exposures.push(harness.state().exposure());
    }
    assert!(first(&harness));
    // The exposure is monotonic and never overshoots.
    exposures.dedup();
    assert!(
        exposures.len() > 2 && exposures.windows(2).all(|pair| (pair[1] - pair[0]) * wanted > 0.0),
        "{exposures:?}"
    );
    assert!(Arc::ptr_eq(&before, &still(&harness)), "is rendered again");
    // Animated frames and the Python code keep the exposure.
    harness.key_down(Key::W);
    step_until(&mut harness, "flight", |app| app.rendered_frame().is_some_and(|frame| frame.still.is_none()));
    assert_eq!(displayed(harness.state()), wanted);
    assert!(copied(&mut harness).contains(&format!("exposure={wanted:?},")));
}

/// Chooses an entry of a menu.
fn choose(harness: &mut Harness<'_, App>, menu: &str, choice: &str) {
    harness.get_by_role_and_label(Role::ComboBox, menu).click();
    harness.run_steps(3);
    harness.get_by_label(choice).click();
    harness.run_steps(3);
}

/// Drags the pointer.
fn drag(harness: &mut Harness<'_, App>, from: Pos2, by: Vec2) {
    harness.hover_at(from);
    harness.step();
    harness.drag_at(from);
    harness.step();
    // egui treats the first few points of motion as a possible click.
    for share in [0.5, 0.75, 1.0] {
        harness.hover_at(from + share * by);
        harness.step();
    }
    harness.drop_at(from + by);
    harness.step();
}

/// Value of a slider.
fn slider(harness: &Harness<'_, App>, name: &str) -> f64 {
    let node = harness.get_by_role_and_label(Role::Slider, name);
    node.accesskit_node().numeric_value().expect("is a number")
}

#[test]
fn function_keys_toggle_the_key_list_and_the_panels() {
    let mut harness = window(Options::default());
    harness.run_steps(2);
    let is_there = |harness: &Harness<'_, App>, what: &str| harness.query_by_label_contains(what).is_some();
    assert!(!is_there(&harness, "five times as fast") && is_there(&harness, "Save picture"));
    harness.key_press(Key::F1);
    harness.run_steps(3);
    for what in ["five times as fast", "F1", "F2", "leave"] {
        assert!(harness.query_all_by_label_contains(what).next().is_some(), "{what}");
    }
    harness.key_press(Key::F1);
    harness.run_steps(3);
    assert!(!is_there(&harness, "five times as fast"));
    harness.key_press(Key::F2);
    step_until(&mut harness, "the view alone", |app| {
        app.rendered_frame().is_some_and(|frame| frame.request.view_size == [500, 400] && frame.still.is_some())
    });
    assert!(!is_there(&harness, "Save picture") && !is_there(&harness, "clouds"));
    harness.key_press(Key::F2);
    harness.run_steps(3);
    assert!(is_there(&harness, "Save picture"));
}

#[test]
fn a_change_of_wind_moves_no_cloud() {
    let mut harness = window(Options::default());
    harness.run_steps(2);
    // Drift after some time of wind.
    drop_file(&mut harness, "windy", "[wind]\nspeed = 12.0\n[drift]\nshape = [-1000.0, 500.0]\n");
    let before = harness.state().params().clone();
    harness.get_by_role(Role::TextInput).focus();
    harness.run_steps(2);
    harness.get_by_role(Role::TextInput).type_text("wind.updraft");
    harness.run_steps(5);
    harness.get_by_role_and_label(Role::Slider, "updraft").focus();
    harness.run_steps(2);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(3);
    let after = harness.state().params().clone();
    assert!(after.wind.updraft != before.wind.updraft);
    let time = harness.state().time();
    assert_eq!(after.drift, after.after(&before, time));
    assert_eq!(after.drift.shape, before.drift.shape);
}

#[test]
fn the_clock_follows_the_sun_and_labels_precede_their_widgets() {
    let mut harness = window(Options { scene: Some("sunset".into()), ..Options::default() });
    harness.run_steps(3);
    let sun = |harness: &Harness<'_, App>| {
        let sun = &harness.state().params().sun;
        [sun.elevation, sun.azimuth]
    };
    let [elevation, azimuth] = sun(&harness);
    assert!(slider(&harness, "hour") > 15.0, "{}", slider(&harness, "hour"));
    // One point of the slider is a third of an hour, which moves the sun by five degrees.
    harness.get_by_role_and_label(Role::Slider, "hour").focus();
    harness.run_steps(2);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(3);
    let [lower, later] = sun(&harness);
    assert!((lower, later) != (elevation, azimuth) && (lower - elevation).abs() < 6.0 && (later - azimuth).abs() < 6.0);
    // A sun set by a file changes the hour too.
    drop_file(&mut harness, "morning", "[sun]\nelevation = 10.0\nazimuth = 80.0\n");
    harness.run_steps(2);
    assert!(slider(&harness, "hour") < 9.0, "{}", slider(&harness, "hour"));
    for name in ["hour", "latitude", "exposure", "wanted"] {
        let label = harness.get_by_role_and_label(Role::Label, name).rect();
        let widget = harness.get_by_role_and_label(Role::Slider, name).rect();
        assert!(label.right() <= widget.left(), "{name}: {label} {widget}");
    }
}

#[test]
fn the_weather_map_has_a_legend() {
    let mut harness = window(Options::default());
    wait_for_still(&mut harness);
    harness.get_by_label("weather map").click();
    harness.run_steps(4);
    for entry in ["red: coverage", "green: type", "blue: precipitation"] {
        assert!(harness.query_by_label(entry).is_some(), "{entry}");
    }
}

/// The window closes after the requested frames, after fewer if nothing moves, and if the view has no room.
#[test]
fn a_window_with_a_number_of_frames_closes() {
    for (frames, fly, size) in
        [(1, false, 500.0), (2, false, 500.0), (50, false, 500.0), (6, true, 500.0), (3, true, 300.0)]
    {
        let options = Options { frames: Some(frames), fly, ..Options::default() };
        let failure = options.failure.clone();
        let mut harness = window(options);
        harness.set_size(Vec2::new(size, 400.0));
        step_until(&mut harness, "closing", App::is_closing);
        assert_eq!(failure.get().is_some(), size < PANEL_WIDTH, "{:?}", failure.get());
    }
}

/// Pixels of the displayed frame and of its comparison.
fn displayed_pixels(harness: &Harness<'_, App>) -> (Vec<u8>, Option<Vec<u8>>) {
    let frame = harness.state().rendered_frame().expect("is shown");
    let pixels = |screen: &Arc<Screen>| read::pixels(&gpu(), screen);
    (pixels(&frame.screen), frame.comparison.as_ref().map(pixels))
}

#[test]
fn the_pixel_scale_changes_the_frame_size_and_not_the_input() {
    let mut sizes = Vec::new();
    for scale in [1.0, 2.0] {
        let mut harness = scaled_window(Options::default(), scale);
        wait_for_still(&mut harness);
        let frame = harness.state().rendered_frame().expect("is shown");
        assert_eq!(frame.screen.size(), frame.request.view_size);
        sizes.push(frame.request.view_size.map(|side| side as f32 / scale));
        let before = *harness.state().flight();
        drag(&mut harness, Pos2::new(450.0, 200.0), Vec2::new(-40.0, 0.0));
        // Sensitivity: 0.15 degrees per point.
        let turned = harness.state().flight().azimuth - before.azimuth;
        assert!((turned - 6.0).abs() < 1e-3, "{turned} degrees at {scale}");
        choose(&mut harness, "beside", "light single");
        step_until(&mut harness, "two pictures", |app| {
            app.rendered_frame().is_some_and(|frame| frame.comparison.is_some())
        });
        drag(&mut harness, Pos2::new(MARGIN + PANEL_WIDTH + 70.0, 200.0), Vec2::new(28.0, 0.0));
        let divider = harness.state().divider();
        assert!((divider - 0.7).abs() < 1e-3, "{divider} at {scale}");
        assert_eq!(harness.state().flight().azimuth, before.azimuth + turned);
    }
    assert!(sizes[0][0] == 140.0 && sizes[1][0] == 140.0 && (sizes[0][1] - sizes[1][1]).abs() <= 1.0, "{sizes:?}");
}

#[test]
fn a_still_is_compared_with_another_light_model() {
    let mut harness = window(Options::default());
    wait_for_still(&mut harness);
    assert_eq!(displayed_pixels(&harness).1, None);
    let own = harness.state().params().light.model;
    let mut compare = |name: &str, model: Model| {
        choose(&mut harness, "beside", name);
        step_until(&mut harness, name, |app| {
            let is_there = |frame: &RenderedFrame| {
                frame.request.comparison.as_ref().is_some_and(|(sky, _)| sky.light.model == model)
            };
            app.rendered_frame().is_some_and(|frame| frame.comparison.is_some() && is_there(frame))
        });
        let (picture, other) = displayed_pixels(&harness);
        (picture, other.expect("is beside it"))
    };
    let (picture, other) = compare("light single", Model::Single);
    let differ = picture.iter().zip(&other).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(differ > picture.len() / 20, "{differ} of {}", picture.len());
    // A comparison with the same quality has the same pixels.
    let (picture, other) = compare("balanced", own);
    assert!(picture == other);
}

#[test]
fn the_error_view_of_a_clear_sky_is_black() {
    let mut harness = window(Options::default());
    harness.run_steps(2);
    choose(&mut harness, "shown", "error");
    let error_at_rest = |harness: &mut Harness<'_, App>| {
        step_until(harness, "the error in a quarter of the pixels", |app| {
            let is_current = |frame: &RenderedFrame| {
                frame.request.debug_view == DebugView::Error && frame.request.params == *app.params()
            };
            let is_full_size =
                |frame: &RenderedFrame| frame.screen.size() == frame.request.view_size.map(|side| side / 4);
            app.rendered_frame().is_some_and(|frame| is_current(frame) && is_full_size(frame))
        });
    };
    error_at_rest(&mut harness);
    let bright = |harness: &Harness<'_, App>| displayed_pixels(harness).0.chunks(4).filter(|p| p[0] > 8).count();
    let some = bright(&harness);
    assert!(some > 50, "{some}");
    drop_file(&mut harness, "clear", "[clouds]\ncoverage = 0.0\n");
    error_at_rest(&mut harness);
    assert_eq!(bright(&harness), 0);
}

#[test]
fn the_history_view_follows_a_rotation() {
    // Narrower menus wrap, and a line more or less resizes the view.
    let mut harness = sized_window(Options::default(), [1600.0, 200.0], 1.0);
    wait_for_still(&mut harness);
    let view_size = |harness: &Harness<'_, App>| harness.state().rendered_frame().expect("is shown").request.view_size;
    let size_at_rest = view_size(&harness);
    choose(&mut harness, "shown", "history length");
    let has_history =
        |app: &App| app.rendered_frame().is_some_and(|frame| frame.request.debug_view == DebugView::HistoryLength);
    step_until(&mut harness, "a history", has_history);
    // After a still view every pixel has had a ray of its own.
    let dark = |harness: &Harness<'_, App>| displayed_pixels(harness).0.chunks(4).filter(|p| p[1] < 8).count();
    assert_eq!(view_size(&harness), size_at_rest);
    assert_eq!(dark(&harness), 0);
    let before = harness.state().flight().azimuth;
    drag(&mut harness, Pos2::new(450.0, 150.0), Vec2::new(-60.0, 0.0));
    assert!(harness.state().flight().azimuth != before);
    step_until(&mut harness, "another history", |app| {
        app.rendered_frame()
            .is_some_and(|frame| app.flight().camera().is_ok_and(|camera| camera == frame.request.camera))
    });
}

#[test]
fn frames_follow_the_window_size_and_stay_without_a_view() {
    let mut harness = window(Options::default());
    wait_for_still(&mut harness);
    let resize = |harness: &mut Harness<'_, App>, width: f32| {
        harness.set_size(Vec2::new(width, 300.0));
        step_until(harness, "another size", |app| {
            let size = |frame: &RenderedFrame| frame.still.as_ref().map(|_| frame.screen.size()[0]);
            app.rendered_frame().and_then(size) == Some((width - 2.0 * MARGIN - PANEL_WIDTH) as u32)
        });
    };
    resize(&mut harness, 700.0);
    resize(&mut harness, 400.0);
    let before = harness.state().rendered_frame().expect("is shown").request.view_size;
    harness.key_down(Key::W);
    for size in [[360.0, 300.0], [0.0, 0.0], [1.0, 1.0], [400.0, 40.0]] {
        harness.set_size(size.into());
        for _ in 0..5 {
            std::thread::sleep(Duration::from_millis(20));
            harness.step();
        }
        let request = &harness.state().rendered_frame().expect("is shown").request;
        assert_eq!(request.view_size, before, "{size:?}");
    }
    harness.key_up(Key::W);
    resize(&mut harness, 500.0);
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

fn drop_file(harness: &mut Harness<'_, App>, name: &str, text: &str) {
    let path: PathBuf = std::env::temp_dir().join(format!("{}-{name}.toml", std::process::id()));
    std::fs::write(&path, text).expect("can be written");
    harness.input_mut().dropped_files = vec![Arc::new(Dropped(path.clone()))];
    harness.step();
    harness.step();
    std::fs::remove_file(path).expect("was written");
}

#[test]
fn dropped_files_are_read_or_rejected_by_field() {
    let mut harness = window(Options::default());
    harness.run_steps(2);
    drop_file(&mut harness, "good", "[clouds]\ncoverage = 0.9\n");
    assert_eq!(harness.state().params().clouds.coverage, 0.9);
    drop_file(&mut harness, "bad", "[clouds]\ncoverage = 1.5\n");
    assert!(harness.state().notice().contains("clouds.coverage = 1.5"), "{}", harness.state().notice());
    assert_eq!(harness.state().params().clouds.coverage, 0.9);
    wait_for_still(&mut harness);
}

#[test]
fn unknown_scenes_are_rejected() {
    let options = Options { scene: Some("sunst".into()), ..Options::default() };
    let error = App::new(&egui::Context::default(), gpu(), options).err().expect("is no scene");
    assert!(error.to_string().contains("fair_weather"), "{error}");
}
