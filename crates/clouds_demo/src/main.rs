//! Command line of the demo.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use std::sync::Arc;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::Parser;
use clouds_core::Gpu;
use clouds_demo::app::{App, Options};
use eframe::egui::ViewportBuilder;
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting};

/// Fly through clouds. W A S D move, Q and E go down and up, F lands and takes off, Space jumps, Shift is fast,
/// Control slow, the wheel sets the speed, F1 lists the keys, F2 hides the panels, Control and Q leave; drag to look
/// around, or click to take the pointer and press Esc to give it back.
#[derive(Parser)]
struct Arguments {
    /// A scene, such as fair_weather or storm, or a TOML file
    #[arg(long)]
    scene: Option<String>,
    /// Width and height of the window
    #[arg(long, default_value = "1280x720", value_parser = size)]
    size: (f32, f32),
    /// Part of the name of the adapter (see `python -m nubis adapters`)
    #[arg(long, env = "NUBIS_ADAPTER")]
    adapter: Option<String>,
    /// Target frame rate while anything moves, frames per second: the resolution adapts to it
    #[arg(long, value_parser = rate)]
    rate: Option<f64>,
    /// Leave after this many frames; if nothing moves, leave after the still, which is the second frame
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// Save a picture of the window (PNG) before leaving
    #[arg(long, requires = "frames", value_parser = png)]
    screenshot: Option<PathBuf>,
    /// Fly ahead from the first frame on
    #[arg(long)]
    fly: bool,
}

fn size(text: &str) -> Result<(f32, f32)> {
    let (width, height) = text.split_once('x').context("it must be WIDTHxHEIGHT, such as 1280x720")?;
    let side = |text: &str| -> Result<f32> {
        let side: u16 = text.parse()?;
        (64..=16384).contains(&side).then_some(f32::from(side)).context("each must be from 64 to 16384")
    };
    Ok((side(width)?, side(height)?))
}

fn png(text: &str) -> Result<PathBuf> {
    let path = PathBuf::from(text);
    path.extension().filter(|ending| ending.eq_ignore_ascii_case("png")).context("its name must end with .png")?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    ensure!(folder.is_none_or(Path::is_dir) && !path.is_dir(), "it must be a file in a folder that exists");
    Ok(path)
}

fn rate(text: &str) -> Result<f64> {
    let rate: f64 = text.parse()?;
    (1.0..=1000.0).contains(&rate).then_some(rate).context("it must be from 1 to 1000 frames a second")
}

fn main() -> ExitCode {
    for (name, value) in clouds_core::gpu::driver_settings() {
        // SAFETY: no other thread exists yet.
        unsafe { std::env::set_var(name, value) };
    }
    #[cfg(debug_assertions)]
    if std::env::var_os("NUBIS_SHADERS").is_none() {
        // Debug builds read the shaders from the source tree, for hot reload.
        // SAFETY: no other thread exists yet.
        unsafe { std::env::set_var("NUBIS_SHADERS", concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/wgsl")) };
    }
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<()> {
    let gpu = Gpu::open(arguments.adapter.as_deref())?;
    let (instance, adapter, device, queue) = gpu.shared();
    let setup = WgpuSetup::Existing(WgpuSetupExisting { instance, adapter, device, queue });
    let native_options = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("nubis")
            .with_inner_size(arguments.size)
            .with_drag_and_drop(true),
        wgpu_options: WgpuConfiguration { wgpu_setup: setup, ..Default::default() },
        // egui's dithering is redundant because rendered frames are dithered already; it is costly on a CPU adapter.
        dithering: false,
        ..Default::default()
    };
    let options = Options {
        scene: arguments.scene,
        adapter: arguments.adapter,
        frames: arguments.frames,
        screenshot: arguments.screenshot,
        target_frame_rate: arguments.rate,
        fly: arguments.fly,
        failure: Arc::default(),
    };
    let failure = options.failure.clone();
    eframe::run_native(
        "nubis",
        native_options,
        Box::new(|context| Ok(Box::new(App::new(&context.egui_ctx, gpu, options)?))),
    )
    .map_err(|error| anyhow!("{error}"))?;
    match failure.get() {
        Some(reason) => bail!("{reason}"),
        None => Ok(()),
    }
}
