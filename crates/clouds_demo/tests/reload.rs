//! Shaders are read anew when they are saved; broken ones say where. In a file of its own: their folder is the process's.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clouds_core::Gpu;
use clouds_demo::app::{App, Start};
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

fn until(harness: &mut Harness<'_, App>, so: impl Fn(&App) -> bool) {
    let started = Instant::now();
    while !so(harness.state()) {
        assert!(started.elapsed() < Duration::from_secs(60), "{}", harness.state().notice());
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

/// The mean of a still.
fn mean(app: &App) -> Option<f64> {
    let picture = app.shown()?.still.as_ref()?;
    Some(picture.image.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.image.len() as f64)
}

#[test]
fn saved_shaders_are_used_and_broken_ones_named() {
    let folder: PathBuf = std::env::temp_dir().join(format!("nubis-shaders-{}", std::process::id()));
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders/wgsl"), &folder);
    // SAFETY: the only test of this process, before it starts threads.
    unsafe { std::env::set_var("NUBIS_SHADERS", &folder) };
    let gpu = Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter");
    let app = App::new(&egui::Context::default(), gpu, Start::default()).expect("starts");
    let mut harness =
        Harness::builder().with_size([500.0, 400.0]).build_ui_state(|ui, app: &mut App| app.frame(ui, None), app);
    until(&mut harness, |app| mean(app).is_some());
    let before = mean(harness.state()).expect("is there");

    let path = folder.join("passes").join("march.wgsl");
    let good = fs::read_to_string(&path).expect("was copied");
    fs::write(&path, good.replace("return Cloud(scale * gathered", "return Cloud(missing * gathered"))
        .expect("is saved");
    until(&mut harness, |app| app.notice().contains("march.wgsl:"));
    assert_eq!(mean(harness.state()), Some(before));

    fs::write(&path, good.replace("return Cloud(scale * gathered", "return Cloud(3.0 * scale * gathered"))
        .expect("is saved");
    until(&mut harness, |app| mean(app).is_some_and(|now| now > 1.2 * before));
    fs::remove_dir_all(&folder).expect("was made");
}
