//! The window without a window: its panels are driven as by a user, its pictures come from whatever adapter there is.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clouds_core::Gpu;
use clouds_core::color::{Metering, auto_exposure};
use clouds_demo::app::{App, Start};
use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, OutputCommand};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

/// How long a picture may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn window(start: Start) -> Harness<'static, App> {
    let gpu = Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter");
    let app = App::new(&egui::Context::default(), gpu, start).expect("starts");
    Harness::builder().with_size([500.0, 400.0]).build_ui_state(|ui, app: &mut App| app.frame(ui, None), app)
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
    // The first is that of the automatic exposure.
    harness.get_all_by_role(Role::CheckBox).nth(1).expect("is found").click();
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
    assert!(std::sync::Arc::ptr_eq(&before, &still(&harness)), "is rendered anew");
    // What moves keeps it, and the lines have it.
    harness.key_down(Key::W);
    until(&mut harness, "flight", |app| app.shown().is_some_and(|shown| shown.still.is_none()));
    assert_eq!(exposure(harness.state()), wanted);
    assert!(copied(&mut harness).contains(&format!("exposure={wanted:?},")));
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
    harness.input_mut().dropped_files = vec![std::sync::Arc::new(Dropped(path.clone()))];
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
    let gpu = Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter");
    let start = Start { scene: Some("sunst".into()), ..Start::default() };
    let error = App::new(&egui::Context::default(), gpu, start).err().expect("is no scene");
    assert!(error.to_string().contains("fair_weather"), "{error}");
}
