//! What reaches a screen is what reaches memory; and frames whose size changes go on.

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
    Renderer::new(width, height, Quality::named(name).expect("is one"), adapter().as_deref()).expect("opens")
}

fn shot(i: u32) -> (Camera, Params, f64) {
    let (_, camera, params) = preset::scenes().expect("are read").swap_remove(0);
    let eye = camera.eye + DVec3::new(3.0 * f64::from(i), 0.0, 0.0);
    (Camera { eye, ..camera }, params, f64::from(i) / 24.0)
}

#[test]
fn a_screen_shows_what_memory_gets() {
    for (tone_map, exposure) in TONE_MAPS.into_iter().zip([0.0, 1.5, -2.0]) {
        let [mut one, mut other] = [renderer(64, 40), renderer(64, 40)];
        let gpu: Arc<Gpu> = one.gpu().clone();
        let screen = Screen::new(&gpu, [64, 40], exposure, tone_map).expect("is made");
        for i in 0..3 {
            let (camera, params, time) = shot(i);
            one.animate_onto(&screen, &Shot::new(&camera, &params, time), &|| Ok(())).expect("is painted");
            let image = other.animate(&Shot::new(&camera, &params, time), &|| Ok(())).expect("is made");
            let expected = to_srgb8(&image, 4, 64, exposure, tone_map, true).expect("is shown");
            let got = read::bytes(&gpu, &screen);
            let most = got.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(most <= Some(1), "{tone_map}, frame {i}: {most:?} levels");
            assert!(got.iter().any(|v| *v > 100) && got.chunks(4).any(|p| p[2] > p[0]));
        }
    }
}

#[test]
fn screens_of_another_size_are_refused() {
    let mut renderer = renderer(64, 40);
    let screen = Screen::new(&renderer.gpu().clone(), [64, 41], 0.0, "agx").expect("is made");
    let (camera, params, time) = shot(0);
    let error =
        renderer.animate_onto(&screen, &Shot::new(&camera, &params, time), &|| Ok(())).expect_err("does not fit");
    assert!(error.to_string().contains("64 x 41"), "{error}");
    assert!(Screen::new(renderer.gpu(), [64, 40], 0.0, "best").is_err());
}

/// Relative RMSE of radiance.
fn error(got: &[f32], expected: &[f32]) -> f64 {
    let square = |a: f32, b: f32| f64::from(a - b).powi(2);
    let off: f64 = got.iter().zip(expected).map(|(a, b)| square(*a, *b)).sum();
    (off / expected.iter().map(|v| square(*v, 0.0)).sum::<f64>()).sqrt()
}

/// A picture in another size, linear between its pixels.
fn stretch(image: &[f32], [w, h]: [u32; 2], [width, height]: [u32; 2]) -> Vec<f32> {
    let place = |i: u32, of: u32, had: u32| {
        let at = ((i as f32 + 0.5) * had as f32 / of as f32 - 0.5).clamp(0.0, had as f32 - 1.0);
        (at as u32, (at as u32 + 1).min(had - 1), at.fract())
    };
    let mut stretched = Vec::new();
    for y in 0..height {
        let (y0, y1, fy) = place(y, height, h);
        for x in 0..width {
            let (x0, x1, fx) = place(x, width, w);
            for c in 0..4 {
                let at = |x: u32, y: u32| image[(4 * (y * w + x) + c) as usize];
                let row = |y| at(x0, y) * (1.0 - fx) + at(x1, y) * fx;
                stretched.push(row(y0) * (1.0 - fy) + row(y1) * fy);
            }
        }
    }
    stretched
}

/// Wherever it is: the next picture is that of a renderer to which nothing has happened. A frame of `draft` asks once, one that
/// converges in many submissions often. Each time the sun stands elsewhere, so that what is baked from it is recorded, too.
#[test]
#[ignore = "is in the second tier, `make test-slow`"]
fn what_is_interrupted_leaves_nothing_behind() {
    for (quality, questions) in [("draft", 1), ("reference", 3)] {
        let [mut renderer, mut other] = [(); 2].map(|()| renderer_by(quality, 16, 10));
        for patience in (0..4).chain((3..).map(|power| 1 << power)) {
            let left = Cell::new(patience);
            let interrupt = || {
                left.set(left.get() - 1);
                if left.get() < 0 { Err(Error::Interrupted) } else { Ok(()) }
            };
            let (camera, mut params, time) = shot(0);
            params.sun.elevation = 20.0 + patience as f32 % 60.0;
            let shot = Shot::new(&camera, &params, time);
            let interrupted = renderer.animate(&shot, &interrupt).is_err();
            // The first frame after it is a still.
            renderer.cut();
            let image = renderer.animate(&shot, &|| Ok(())).expect("is made");
            let expected = other.animate(&shot, &|| Ok(())).expect("is made");
            assert!(image == expected, "{quality}: interrupted after {patience} questions");
            for animated in [&mut renderer, &mut other] {
                animated.cut();
            }
            if !interrupted {
                assert!(patience >= questions, "{quality}: {patience}");
                break;
            }
        }
    }
}

#[test]
fn an_animation_goes_on_in_another_size() {
    goes_on("draft", [480, 280], "draft", [640, 374]);
    goes_on("draft", [640, 374], "draft", [480, 280]);
}

/// `preview` follows one in sixteen of the larger pictures' pixels, as they are narrow, and each of the smaller ones'.
#[test]
#[ignore = "is in the second tier, `make test-slow`"]
fn an_animation_goes_on_with_other_pixels_known() {
    goes_on("preview", [640, 500], "preview", [720, 562]);
    goes_on("preview", [640, 500], "draft", [320, 250]);
    goes_on("draft", [320, 250], "preview", [640, 500]);
    goes_on("preview", [640, 500], "draft", [640, 500]);
}

fn goes_on(first: &str, [w, h]: [u32; 2], then: &str, [width, height]: [u32; 2]) {
    let make = |renderer: &mut Renderer, i| {
        let (camera, params, time) = shot(i);
        renderer.animate(&Shot::new(&camera, &params, time), &|| Ok(())).expect("is made")
    };
    let mut animated = renderer_by(first, w, h);
    for i in 0..17 {
        make(&mut animated, i);
    }
    animated.set(width, height, Quality::named(then).expect("is one")).expect("is allowed");
    let got = make(&mut animated, 17);
    let fresh = make(&mut renderer_by(then, width, height), 17);
    let off = error(&got, &fresh);
    // What a still of the old size knows of the new one, between its pixels.
    let old = make(&mut renderer_by(first, w, h), 17);
    let stretched = stretch(&old, [w, h], [width, height]);
    let most = error(&stretched, &fresh);
    // The history is that and a part of fresh pixels; without, it would be a guess between those.
    let case = format!("{first} {w} x {h}, {then} {width} x {height}");
    assert!(off < 1.25 * most && most < 0.25, "{case}: {off}, stretched {most}");
    // No still is made instead: that would be a hitch.
    assert!(off > 0.2 * most, "{case}: {off}, stretched {most}");
}
