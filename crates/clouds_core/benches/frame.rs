//! Time of a small frame and of each of its kernels: `frame/*` is wall-clock time, `pass/*` comes from GPU timestamps.
//!
//! `NUBIS_ADAPTER` selects the adapter, as in Python.

use std::time::Duration;

use clouds_core::{Camera, Params, Quality, Renderer, Shot};
use criterion::{BenchmarkGroup, Criterion, SamplingMode, measurement::WallTime};
use glam::DVec3;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 180;

/// Renderer and inputs of a benchmark. The inputs change with each iteration, so that LUTs are rebaked.
struct Scene {
    renderer: Renderer,
    camera: Camera,
    params: Params,
    time: f64,
}

impl Scene {
    fn new(adapter: Option<&str>) -> clouds_core::Result<Self> {
        Ok(Self {
            renderer: Renderer::new(WIDTH, HEIGHT, Quality::default(), adapter)?,
            camera: Camera::look_at(DVec3::new(0.0, 0.0, 200.0), DVec3::new(0.0, 1000.0, 450.0), DVec3::Z, 60.0)?,
            params: Params::default(),
            time: 0.0,
        })
    }

    fn still(&mut self) {
        self.renderer.render(&Shot::new(&self.camera, &self.params, self.time), false, &|| Ok(())).expect("renders");
    }

    /// Next frame of an animation with moving clouds and camera.
    fn animate(&mut self) {
        self.time += 1.0 / 24.0;
        self.camera.eye.y += 1.0;
        self.renderer.animate(&Shot::new(&self.camera, &self.params, self.time), &|| Ok(())).expect("renders");
    }

    /// Queries the density at one point, which rebakes stale LUTs without a march.
    fn bake(&mut self) {
        self.renderer.density(&[[0.0; 3]], &self.params, self.time, &|| Ok(())).expect("answers");
    }

    /// Time of a kernel in the last frame in ms; None on adapters without timestamps.
    fn timing(&self, kernel: &str) -> Option<f64> {
        self.renderer.timings.0.iter().find(|(name, _)| name == kernel).map(|(_, milliseconds)| *milliseconds)
    }
}

/// Measures each kernel that one call of `run` dispatches.
fn passes(group: &mut BenchmarkGroup<'_, WallTime>, scene: &mut Scene, kernels: &[&str], run: impl Fn(&mut Scene)) {
    for kernel in kernels {
        group.bench_function(*kernel, |bencher| {
            bencher.iter_custom(|iterations| {
                let milliseconds = |_| {
                    run(scene);
                    scene.timing(kernel).unwrap_or_else(|| panic!("{kernel} did not run"))
                };
                Duration::from_secs_f64((0..iterations).map(milliseconds).sum::<f64>() * 1e-3)
            });
        });
    }
}

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let adapter = std::env::var("NUBIS_ADAPTER").ok();
    let mut scene = Scene::new(adapter.as_deref()).expect("there is an adapter");
    let info = &scene.renderer.gpu().info;
    println!("{} ({}), {WIDTH} x {HEIGHT}", info.name, info.driver);
    // Warm-up: compiles the kernels and bakes the LUTs.
    scene.still();

    let mut frames = criterion.benchmark_group("frame");
    frames.sampling_mode(SamplingMode::Flat);
    frames.bench_function("still", |bencher| bencher.iter(|| scene.still()));
    frames.bench_function("animate", |bencher| bencher.iter(|| scene.animate()));
    frames.finish();

    scene.still();
    if scene.timing("march").is_none() {
        println!("no pass/*: this adapter has no timestamps");
        return;
    }
    let mut group = criterion.benchmark_group("pass");
    group.sampling_mode(SamplingMode::Flat);
    passes(&mut group, &mut scene, &["march", "composite"], Scene::still);
    passes(&mut group, &mut scene, &["reproject"], Scene::animate);
    passes(&mut group, &mut scene, &["shape", "detail", "curl", "downsample"], |scene| {
        scene.params.clouds.seed += 1;
        scene.bake();
    });
    passes(&mut group, &mut scene, &["weather"], |scene| {
        scene.params.weather.seed += 1;
        scene.bake();
    });
    passes(&mut group, &mut scene, &["high_clouds"], |scene| {
        scene.params.high_clouds.seed += 1;
        scene.bake();
    });
    passes(&mut group, &mut scene, &["sky_view_bake", "aerial_perspective_bake", "sky_light_bake"], |scene| {
        scene.params.sun.azimuth = (scene.params.sun.azimuth + 1.0) % 360.0;
        scene.bake();
    });
    group.finish();
    criterion.final_summary();
}
