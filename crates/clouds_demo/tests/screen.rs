//! Screens against images in memory, interrupted frames, and animations that change size or quality.

mod read;

use std::cell::Cell;
use std::sync::Arc;

use clouds_core::color::{TONE_MAPS, to_srgb8};
use clouds_core::{Camera, Error, Gpu, Params, Quality, Renderer, Screen, Shot};
use clouds_demo::preset;
use glam::DVec3;

fn adapter() -> Option<String> {
    std::env::var("NUBIS_ADAPTER").ok()
}

fn renderer(width: u32, height: u32) -> Renderer {
    renderer_by("draft", width, height)
}

fn renderer_by(name: &str, width: u32, height: u32) -> Renderer {
    Renderer::new(width, height, Quality::named(name).expect("quality exists"), adapter().as_deref()).expect("opens")
}

fn shot(i: u32) -> (Camera, Params, f64) {
    let (_, camera, params) = preset::scenes().expect("scenes are valid").swap_remove(0);
    let eye = camera.eye + DVec3::new(3.0 * f64::from(i), 0.0, 0.0);
    (Camera { eye, ..camera }, params, f64::from(i) / 24.0)
}

#[test]
fn a_screen_equals_the_image_in_memory() {
    for (tone_map, exposure) in TONE_MAPS.into_iter().zip([0.0, 1.5, -2.0]) {
        let [mut on_screen, mut in_memory] = [renderer(64, 40), renderer(64, 40)];
        let gpu: Arc<Gpu> = on_screen.gpu().clone();
        let screen = Screen::new(&gpu, [64, 40], exposure, tone_map).expect("is made");
        for i in 0..3 {
            let (camera, params, time) = shot(i);
            on_screen.animate_onto(&screen, &Shot::new(&camera, &params, time), &|| Ok(())).expect("is painted");
            let image = in_memory.animate(&Shot::new(&camera, &params, time), &|| Ok(())).expect("is made");
            let expected = to_srgb8(&image, 4, 64, exposure, tone_map, true).expect("is shown");
            let got = read::pixels(&gpu, &screen);
            let most = got.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(most <= Some(1), "{tone_map}, frame {i}: {most:?} levels");
            assert!(got.iter().any(|v| *v > 100) && got.chunks(4).any(|p| p[2] > p[0]));
        }
    }
}

#[test]
fn screens_of_another_size_are_rejected() {
    let mut renderer = renderer(64, 40);
    let screen = Screen::new(&renderer.gpu().clone(), [64, 41], 0.0, "agx").expect("is made");
    let (camera, params, time) = shot(0);
    let error =
        renderer.animate_onto(&screen, &Shot::new(&camera, &params, time), &|| Ok(())).expect_err("does not fit");
    assert!(error.to_string().contains("64 x 41"), "{error}");
    assert!(Screen::new(renderer.gpu(), [64, 40], 0.0, "best").is_err());
}

/// Relative root-mean-square error of radiance.
fn relative_rmse(got: &[f32], expected: &[f32]) -> f64 {
    let square = |a: f32, b: f32| f64::from(a - b).powi(2);
    let off: f64 = got.iter().zip(expected).map(|(a, b)| square(*a, *b)).sum();
    (off / expected.iter().map(|v| square(*v, 0.0)).sum::<f64>()).sqrt()
}

/// Bilinear resampling of an image to another size.
fn resample(image: &[f32], [w, h]: [u32; 2], [width, height]: [u32; 2]) -> Vec<f32> {
    let source = |i: u32, target: u32, source: u32| {
        let at = ((i as f32 + 0.5) * source as f32 / target as f32 - 0.5).clamp(0.0, source as f32 - 1.0);
        (at as u32, (at as u32 + 1).min(source - 1), at.fract())
    };
    let mut resampled = Vec::new();
    for y in 0..height {
        let (y0, y1, fy) = source(y, height, h);
        for x in 0..width {
            let (x0, x1, fx) = source(x, width, w);
            for c in 0..4 {
                let at = |x: u32, y: u32| image[(4 * (y * w + x) + c) as usize];
                let row = |y| at(x0, y) * (1.0 - fx) + at(x1, y) * fx;
                resampled.push(row(y0) * (1.0 - fy) + row(y1) * fy);
            }
        }
    }
    resampled
}

/// An interrupted frame leaves no state: the next frame is that of a renderer without the interruption.
///
/// A `draft` frame queries the callback once. A `reference` frame has many submissions and queries it often. The sun
/// moves before each frame so that the interrupted recording includes bakes.
#[test]
#[ignore = "is in the second tier, `make test-slow`"]
fn an_interrupted_frame_leaves_no_state() {
    for (quality, queries) in [("draft", 1), ("reference", 3)] {
        // The whole field takes seconds.
        let few = Quality { field_cells: 16, field_cell: 400.0, ..Quality::named(quality).expect("quality exists") };
        let make = || Renderer::new(16, 10, few.clone(), adapter().as_deref()).expect("opens");
        let [mut renderer, mut other] = [make(), make()];
        for allowed in (0..4).chain((3..).map(|power| 1 << power)) {
            let remaining = Cell::new(allowed);
            let interrupt = || {
                remaining.set(remaining.get() - 1);
                if remaining.get() < 0 { Err(Error::Interrupted) } else { Ok(()) }
            };
            let (camera, mut params, time) = shot(0);
            params.sun.elevation = 20.0 + allowed as f32 % 60.0;
            let shot = Shot::new(&camera, &params, time);
            let interrupted = renderer.animate(&shot, &interrupt).is_err();
            // After `cut` the next frame is a still.
            renderer.cut();
            let image = renderer.animate(&shot, &|| Ok(())).expect("is made");
            let expected = other.animate(&shot, &|| Ok(())).expect("is made");
            assert!(image == expected, "{quality}: interrupted after {allowed} queries");
            for animated in [&mut renderer, &mut other] {
                animated.cut();
            }
            if !interrupted {
                assert!(allowed >= queries, "{quality}: {allowed}");
                break;
            }
        }
    }
}

#[test]
fn an_animation_continues_in_another_size() {
    check_continuation("draft", [480, 280], "draft", [640, 374]);
    check_continuation("draft", [640, 374], "draft", [480, 280]);
}

/// `preview` marches one pixel in sixteen of the larger sizes, whose pixels are narrow; `draft` marches them all.
#[test]
#[ignore = "is in the second tier, `make test-slow`"]
fn an_animation_continues_on_another_sample_grid() {
    check_continuation("preview", [640, 500], "preview", [720, 562]);
    check_continuation("preview", [640, 500], "draft", [320, 250]);
    check_continuation("draft", [320, 250], "preview", [640, 500]);
    check_continuation("preview", [640, 500], "draft", [640, 500]);
}

/// The frame after a change of size and quality uses the history of the frames before.
fn check_continuation(first: &str, [w, h]: [u32; 2], then: &str, [width, height]: [u32; 2]) {
    let make = |renderer: &mut Renderer, i| {
        let (camera, params, time) = shot(i);
        renderer.animate(&Shot::new(&camera, &params, time), &|| Ok(())).expect("is made")
    };
    let mut animated = renderer_by(first, w, h);
    for i in 0..17 {
        make(&mut animated, i);
    }
    animated.set(width, height, Quality::named(then).expect("quality exists")).expect("is allowed");
    let got = make(&mut animated, 17);
    let still = make(&mut renderer_by(then, width, height), 17);
    let rmse = relative_rmse(&got, &still);
    // Upper bound: the error of a still of the old size, resampled.
    let old = make(&mut renderer_by(first, w, h), 17);
    let resampled = resample(&old, [w, h], [width, height]);
    let bound = relative_rmse(&resampled, &still);
    // The frame blends the resampled history with current samples. Without the history the error would be larger. Between
    // the smooth clouds of `preview` and of `draft` resampling errs by 1.4 %, which is less than reprojection does.
    let case = format!("{first} {w} x {h}, {then} {width} x {height}");
    assert!(rmse < (1.25 * bound).max(0.03) && bound < 0.25, "{case}: {rmse}, resampled {bound}");
    // Lower bound: a still in place of the animated frame would have no error, but would be a hitch.
    assert!(rmse > 0.2 * bound, "{case}: {rmse}, resampled {bound}");
}
