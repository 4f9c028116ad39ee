//! Device loss closes the window with a message and without a panic.
//!
//! The test has a file of its own because the device is shared by the whole process.

use std::time::{Duration, Instant};

use clouds_core::Gpu;
use clouds_demo::app::{App, Options};
use eframe::egui::{self, Key, ViewportCommand, ViewportId};
use egui_kittest::Harness;

#[test]
fn a_lost_device_closes_the_window_with_a_message() {
    let gpu = Gpu::open(std::env::var("NUBIS_ADAPTER").ok().as_deref()).expect("there is an adapter");
    let app = App::new(&egui::Context::default(), gpu.clone(), Options::default()).expect("starts");
    let mut harness =
        Harness::builder().with_size([500.0, 400.0]).build_ui_state(|ui, app: &mut App| app.frame(ui, None), app);
    let started = Instant::now();
    let step = |harness: &mut Harness<'_, App>| {
        assert!(started.elapsed() < Duration::from_secs(60), "{}", harness.state().notice());
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    };
    while harness.state().rendered_frame().is_none() {
        step(&mut harness);
    }
    let (_, _, device, _) = gpu.shared();
    device.destroy();
    harness.key_down(Key::W);
    let is_closing = |harness: &Harness<'_, App>| {
        let viewports = &harness.output().viewport_output;
        viewports.get(&ViewportId::ROOT).is_some_and(|root| root.commands.contains(&ViewportCommand::Close))
    };
    while !is_closing(&harness) {
        step(&mut harness);
    }
    assert!(harness.state().notice().contains("lost"), "{}", harness.state().notice());
}
