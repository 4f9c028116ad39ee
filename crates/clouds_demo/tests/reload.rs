//! Shader hot reload: a saved shader takes effect, and an invalid one is reported with its line.
//!
//! The test has a file of its own because the shader folder is shared by the whole process.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clouds_core::Gpu;
use clouds_demo::app::{App, Options};
use eframe::egui;
use egui_kittest::Harness;

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("can be made");
    for file in fs::read_dir(from).expect("can be listed") {
        let path = file.expect("can be listed").path();
        let target = to.join(path.file_name().expect("has a name"));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, target).expect("can be copied");
        }
    }
}

fn step_until(harness: &mut Harness<'_, App>, condition: impl Fn(&App) -> bool) {
    let started = Instant::now();
    while !condition(harness.state()) {
        assert!(started.elapsed() < Duration::from_secs(60), "{}", harness.state().notice());
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

/// Mean of the displayed still.
fn mean(app: &App) -> Option<f64> {
    let picture = app.rendered_frame()?.still.as_ref()?;
    Some(picture.image.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.image.len() as f64)
}

#[test]
fn saved_shaders_take_effect_and_invalid_ones_are_reported() {
    let folder: PathBuf = std::env::temp_dir().join(format!("nubis-shaders-{}", std::process::id()));
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders/wgsl"), &folder);
    // SAFETY: this is the only test of the process, and it has started no thread.
    unsafe { std::env::set_var("NUBIS_SHADERS", &folder) };
    let gpu = Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter");
    let app = App::new(&egui::Context::default(), gpu, Options::default()).expect("starts");
    let mut harness =
        Harness::builder().with_size([500.0, 400.0]).build_ui_state(|ui, app: &mut App| app.frame(ui, None), app);
    step_until(&mut harness, |app| mean(app).is_some());
    let before = mean(harness.state()).expect("is there");

    let path = folder.join("passes").join("march.wgsl");
    let good = fs::read_to_string(&path).expect("was copied");
    fs::write(&path, good.replace("return Cloud(radiance,", "return Cloud(missing * radiance,")).expect("is saved");
    step_until(&mut harness, |app| app.notice().contains("march.wgsl:"));
    assert_eq!(mean(harness.state()), Some(before));

    fs::write(&path, good.replace("return Cloud(radiance,", "return Cloud(3.0 * radiance,")).expect("is saved");
    step_until(&mut harness, |app| mean(app).is_some_and(|now| now > 1.2 * before));
    fs::remove_dir_all(&folder).expect("was made");
}
