//! The window without a window: its panels are driven as by a user, its pictures come from whatever adapter there is.

mod read;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clouds_core::color::{Metering, auto_exposure};
use clouds_core::params::Model;
use clouds_core::{Gpu, Screen};
use clouds_demo::app::{App, Start};
use clouds_demo::painter::Shown;
use clouds_demo::sight::Sight;
use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, OutputCommand, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

/// How long a picture may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn gpu() -> Arc<Gpu> {
    Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter")
}

fn window(start: Start) -> Harness<'static, App> {
    scaled_window(start, 1.0)
}

/// Points around the window, which are the harness's.
const MARGIN: f32 = 8.0;
/// Points of the panel on the left.
const PANEL: f32 = 360.0;

/// 500 x 400 points, of which the view has the right 140.
fn scaled_window(start: Start, pixels_per_point: f32) -> Harness<'static, App> {
    let app = App::new(&egui::Context::default(), gpu(), start).expect("starts");
    let size = Vec2::new(500.0, 400.0) + Vec2::splat(2.0 * MARGIN);
    let builder = Harness::builder().with_size(size).with_pixels_per_point(pixels_per_point);
    builder.build_ui_state(|ui, app: &mut App| app.frame(ui, None), app)
}

/// Steps until something is so.
fn until(harness: &mut Harness<'_, App>, what: &str, so: impl Fn(&App) -> bool) {
    let started = Instant::now();
    while !so(harness.state()) {
        assert!(started.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}; {}", harness.state().notice());
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

fn at_rest(harness: &mut Harness<'_, App>) {
    harness.run_steps(2);
    until(harness, "a picture at rest", |app| {
        app.shown().is_some_and(|shown| shown.still.is_some() && shown.wish.params == *app.params())
    });
}

/// What is copied as Python.
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
fn keys_fly_and_the_picture_follows() {
    let mut harness = window(Start::default());
    at_rest(&mut harness);
    let before = harness.state().flight().eye;
    harness.key_down(Key::W);
    until(&mut harness, "flight north", |app| app.flight().eye.y > before.y + 20.0);
    harness.key_up(Key::W);
    harness.run_steps(2);
    let there = harness.state().flight().eye;
    // The view is 14 degrees above the horizon.
    assert!(there.x.abs() < 1e-6 && ((there.z - before.z) / (there.y - before.y) - 0.2493).abs() < 1e-3, "{there}");
    until(&mut harness, "a picture from there", |app| {
        app.shown().is_some_and(|shown| shown.wish.camera.eye == there && shown.still.is_some())
    });
}

#[test]
fn the_search_leaves_the_fields_that_are_meant_and_they_change_the_sky() {
    let mut harness = window(Start::default());
    harness.run_steps(2);
    assert!(harness.query_by_label("clouds").is_some());
    harness.get_by_role(Role::TextInput).focus();
    harness.run_steps(2);
    harness.get_by_role(Role::TextInput).type_text("beams");
    harness.run_steps(5);
    assert!(harness.query_by_label("clouds").is_none());
    assert!(harness.state().params().atmosphere.beams);
    harness.get_by_role_and_label(Role::CheckBox, "beams").scroll_to_me();
    harness.run_steps(10);
    harness.get_by_role_and_label(Role::CheckBox, "beams").click();
    harness.run_steps(3);
    assert!(!harness.state().params().atmosphere.beams);
    at_rest(&mut harness);
}

#[test]
fn buttons_go_to_places_and_copy_python() {
    let mut harness = window(Start { scene: Some("storm".into()), ..Start::default() });
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
fn the_automatic_exposure_comes_by_and_by_and_renders_nothing_anew() {
    let mut harness = window(Start { scene: Some("sunset".into()), ..Start::default() });
    at_rest(&mut harness);
    let still =
        |harness: &Harness<'_, App>| harness.state().shown().expect("is shown").still.clone().expect("is at rest");
    let exposure = |app: &App| app.shown().expect("is shown").wish.exposure;
    let before = still(&harness);
    let wanted = auto_exposure(&before.image, 4, Metering::default()).expect("is allowed") as f32;
    assert!(wanted.abs() > 0.3, "{wanted}");
    let first = |harness: &Harness<'_, App>| {
        harness.get_all_by_role(Role::Slider).next().expect("is there").accesskit_node().is_disabled()
    };
    assert!(!first(&harness));
    harness.get_by_label("auto").click();
    let mut way = vec![0.0];
    let started = Instant::now();
    while way.last() != Some(&wanted) {
        assert!(started.elapsed() < PATIENCE, "{way:?}, not {wanted}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
        way.push(exposure(harness.state()));
    }
    assert!(first(&harness));
    // By steps, none of them back, and never beyond.
    way.dedup();
    assert!(way.len() > 2 && way.windows(2).all(|pair| (pair[1] - pair[0]) * wanted > 0.0), "{way:?}");
    assert!(Arc::ptr_eq(&before, &still(&harness)), "is rendered anew");
    // What moves keeps it, and the lines have it.
    harness.key_down(Key::W);
    until(&mut harness, "flight", |app| app.shown().is_some_and(|shown| shown.still.is_none()));
    assert_eq!(exposure(harness.state()), wanted);
    assert!(copied(&mut harness).contains(&format!("exposure={wanted:?},")));
}

/// Chooses from a menu.
fn choose(harness: &mut Harness<'_, App>, menu: &str, choice: &str) {
    harness.get_by_role_and_label(Role::ComboBox, menu).click();
    harness.run_steps(3);
    harness.get_by_label(choice).click();
    harness.run_steps(3);
}

/// Moves the pointer with its button down.
fn drag(harness: &mut Harness<'_, App>, from: Pos2, by: Vec2) {
    harness.hover_at(from);
    harness.step();
    harness.drag_at(from);
    harness.step();
    // The first points only tell a drag from a click.
    for share in [0.5, 0.75, 1.0] {
        harness.hover_at(from + share * by);
        harness.step();
    }
    harness.drop_at(from + by);
    harness.step();
}

/// The value of a slider by its name.
fn slider(harness: &Harness<'_, App>, name: &str) -> f64 {
    let node = harness.get_by_role_and_label(Role::Slider, name);
    node.accesskit_node().numeric_value().expect("is a number")
}

#[test]
fn keys_are_listed_and_panels_hidden() {
    let mut harness = window(Start::default());
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
    until(&mut harness, "the view alone", |app| {
        app.shown().is_some_and(|shown| shown.wish.window == [500, 400] && shown.still.is_some())
    });
    assert!(!is_there(&harness, "Save picture") && !is_there(&harness, "clouds"));
    harness.key_press(Key::F2);
    harness.run_steps(3);
    assert!(is_there(&harness, "Save picture"));
}

#[test]
fn another_wind_moves_no_cloud() {
    let mut harness = window(Start::default());
    harness.run_steps(2);
    // An hour on.
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
fn the_hour_is_that_of_the_sun_and_names_stand_before_their_widgets() {
    let mut harness = window(Start { scene: Some("sunset".into()), ..Start::default() });
    harness.run_steps(3);
    let sun = |harness: &Harness<'_, App>| {
        let sun = &harness.state().params().sun;
        [sun.elevation, sun.azimuth]
    };
    let [elevation, azimuth] = sun(&harness);
    assert!(slider(&harness, "hour") > 15.0, "{}", slider(&harness, "hour"));
    // A point of the slider, a third of an hour: the sun goes five degrees on, and not to the morning.
    harness.get_by_role_and_label(Role::Slider, "hour").focus();
    harness.run_steps(2);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(3);
    let [lower, later] = sun(&harness);
    assert!((lower, later) != (elevation, azimuth) && (lower - elevation).abs() < 6.0 && (later - azimuth).abs() < 6.0);
    // Another scene has another hour, and a sun placed by hand too.
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
fn the_colours_of_the_weather_map_have_a_legend() {
    let mut harness = window(Start::default());
    at_rest(&mut harness);
    harness.get_by_label("weather map").click();
    harness.run_steps(4);
    for entry in ["red: coverage", "green: type", "blue: precipitation"] {
        assert!(harness.query_by_label(entry).is_some(), "{entry}");
    }
}

/// However few pictures there are to come, and wherever one has no room, the window leaves.
#[test]
fn what_asks_for_pictures_ends() {
    for (frames, fly, size) in
        [(1, false, 500.0), (2, false, 500.0), (50, false, 500.0), (6, true, 500.0), (3, true, 300.0)]
    {
        let start = Start { frames: Some(frames), fly, ..Start::default() };
        let failed = start.failed.clone();
        let mut harness = window(start);
        harness.set_size(Vec2::new(size, 400.0));
        until(&mut harness, "leaves", App::is_leaving);
        assert_eq!(failed.get().is_some(), size < PANEL, "{:?}", failed.get());
    }
}

/// The pixels of what is shown, and of what is beside it.
fn shown_pixels(harness: &Harness<'_, App>) -> (Vec<u8>, Option<Vec<u8>>) {
    let shown = harness.state().shown().expect("is shown");
    let pixels = |screen: &Arc<Screen>| read::bytes(&gpu(), screen);
    (pixels(&shown.screen), shown.beside.as_ref().map(pixels))
}

#[test]
fn two_pixels_a_point_are_twice_the_picture_and_the_same_hands() {
    let mut sizes = Vec::new();
    for scale in [1.0, 2.0] {
        let mut harness = scaled_window(Start::default(), scale);
        at_rest(&mut harness);
        let shown = harness.state().shown().expect("is shown");
        assert_eq!(shown.screen.size(), shown.wish.window);
        sizes.push(shown.wish.window.map(|side| side as f32 / scale));
        let before = *harness.state().flight();
        drag(&mut harness, Pos2::new(450.0, 200.0), Vec2::new(-40.0, 0.0));
        // 0.15 degrees a point.
        let turned = harness.state().flight().azimuth - before.azimuth;
        assert!((turned - 6.0).abs() < 1e-3, "{turned} degrees at {scale}");
        choose(&mut harness, "beside", "light single");
        until(&mut harness, "two pictures", |app| app.shown().is_some_and(|shown| shown.beside.is_some()));
        drag(&mut harness, Pos2::new(MARGIN + PANEL + 70.0, 200.0), Vec2::new(28.0, 0.0));
        let bar = harness.state().bar();
        assert!((bar - 0.7).abs() < 1e-3, "{bar} at {scale}");
        assert_eq!(harness.state().flight().azimuth, before.azimuth + turned);
    }
    assert!(sizes[0][0] == 140.0 && sizes[1][0] == 140.0 && (sizes[0][1] - sizes[1][1]).abs() <= 1.0, "{sizes:?}");
}

#[test]
fn another_light_model_is_beside_the_picture_at_rest() {
    let mut harness = window(Start::default());
    at_rest(&mut harness);
    assert_eq!(shown_pixels(&harness).1, None);
    let own = harness.state().params().light.model;
    let mut beside = |name: &str, model: Model| {
        choose(&mut harness, "beside", name);
        until(&mut harness, name, |app| {
            let is_there = |shown: &Shown| shown.wish.beside.as_ref().is_some_and(|(sky, _)| sky.light.model == model);
            app.shown().is_some_and(|shown| shown.beside.is_some() && is_there(shown))
        });
        let (picture, other) = shown_pixels(&harness);
        (picture, other.expect("is beside it"))
    };
    let (picture, other) = beside("light single", Model::Single);
    let differ = picture.iter().zip(&other).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(differ > picture.len() / 20, "{differ} of {}", picture.len());
    // The method of the picture itself.
    let (picture, other) = beside("balanced", own);
    assert!(picture == other);
}

#[test]
fn the_error_is_black_where_there_is_none() {
    let mut harness = window(Start::default());
    harness.run_steps(2);
    choose(&mut harness, "shown", "error");
    let error_at_rest = |harness: &mut Harness<'_, App>| {
        until(harness, "the error in a quarter of the pixels", |app| {
            let is_of = |shown: &Shown| shown.wish.sight == Sight::Error && shown.wish.params == *app.params();
            let is_whole = |shown: &Shown| shown.screen.size() == shown.wish.window.map(|side| side / 4);
            app.shown().is_some_and(|shown| is_of(shown) && is_whole(shown))
        });
    };
    error_at_rest(&mut harness);
    let bright = |harness: &Harness<'_, App>| shown_pixels(harness).0.chunks(4).filter(|p| p[0] > 8).count();
    let some = bright(&harness);
    assert!(some > 50, "{some}");
    drop_file(&mut harness, "clear", "[clouds]\ncoverage = 0.0\n");
    error_at_rest(&mut harness);
    assert_eq!(bright(&harness), 0);
}

#[test]
fn a_turn_has_a_history_of_its_own() {
    let mut harness = window(Start::default());
    at_rest(&mut harness);
    choose(&mut harness, "shown", "history length");
    let has_history = |app: &App| app.shown().is_some_and(|shown| shown.wish.sight == Sight::History);
    until(&mut harness, "a history", has_history);
    // Each pixel of what is at rest has had its ray.
    let dark = |harness: &Harness<'_, App>| shown_pixels(harness).0.chunks(4).filter(|p| p[1] < 8).count();
    assert_eq!(dark(&harness), 0);
    let before = harness.state().flight().azimuth;
    drag(&mut harness, Pos2::new(450.0, 200.0), Vec2::new(-60.0, 0.0));
    assert!(harness.state().flight().azimuth != before);
    until(&mut harness, "another history", |app| {
        app.shown().is_some_and(|shown| app.flight().camera().is_ok_and(|camera| camera == shown.wish.camera))
    });
}

#[test]
fn windows_of_any_size_have_pictures_of_it_and_of_none_the_last() {
    let mut harness = window(Start::default());
    at_rest(&mut harness);
    let resize = |harness: &mut Harness<'_, App>, width: f32| {
        harness.set_size(Vec2::new(width, 300.0));
        until(harness, "another size", |app| {
            let size = |shown: &Shown| shown.still.as_ref().map(|_| shown.screen.size()[0]);
            app.shown().and_then(size) == Some((width - 2.0 * MARGIN - PANEL) as u32)
        });
    };
    resize(&mut harness, 700.0);
    resize(&mut harness, 400.0);
    let before = harness.state().shown().expect("is shown").wish.window;
    harness.key_down(Key::W);
    for size in [[360.0, 300.0], [0.0, 0.0], [1.0, 1.0], [400.0, 40.0]] {
        harness.set_size(size.into());
        for _ in 0..5 {
            std::thread::sleep(Duration::from_millis(20));
            harness.step();
        }
        let wish = &harness.state().shown().expect("is shown").wish;
        assert_eq!(wish.window, before, "{size:?}");
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
fn dropped_skies_are_read_or_refused_by_the_field() {
    let mut harness = window(Start::default());
    harness.run_steps(2);
    drop_file(&mut harness, "good", "[clouds]\ncoverage = 0.9\n");
    assert_eq!(harness.state().params().clouds.coverage, 0.9);
    drop_file(&mut harness, "bad", "[clouds]\ncoverage = 1.5\n");
    assert!(harness.state().notice().contains("clouds.coverage = 1.5"), "{}", harness.state().notice());
    assert_eq!(harness.state().params().clouds.coverage, 0.9);
    at_rest(&mut harness);
}

#[test]
fn scenes_that_do_not_exist_are_refused() {
    let start = Start { scene: Some("sunst".into()), ..Start::default() };
    let error = App::new(&egui::Context::default(), gpu(), start).err().expect("is no scene");
    assert!(error.to_string().contains("fair_weather"), "{error}");
}
