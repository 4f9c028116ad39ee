//! How many of the window's pixels are rendered while anything moves, and by which method, so that frames come in time.

use std::time::Duration;

/// How many times as many pixels a step has as the next.
const RATIO: f64 = 1.2;
/// The last step: a fifth of the window's width and height.
const LAST: f64 = 18.0;
/// From which step on frames are those of `preview` where these follow one pixel in sixteen, and as large as ones of `draft` were so many
/// steps before, whose time they take 0.27 to 0.38 of: no step up takes more time than it is taken for. They look better than small
/// ones of `draft`: the sky and the ground have all their pixels, and clouds that come into the picture are rid of guesses in a
/// fourth of the frames.
const PREVIEW: f64 = 7.0;
/// Frames of a judgement, and which of them, by its time, it is of: what one in five takes to bake or compile says nothing, and most
/// of the others are to be in time.
const FRAMES: usize = 5;
const JUDGED: usize = 3;
/// Steps that frames may be late by (5 %): as times are noisy, the step would change to and fro.
const LATE: f64 = 0.27;

/// The share of the window's width and height at a step, by `draft`.
fn share(step: f64) -> f64 {
    RATIO.powf(-0.5 * step)
}

/// The step at hand, and what frames took.
#[derive(Clone, Debug)]
pub struct Resolution {
    step: f64,
    seconds: Vec<f64>,
}

impl Resolution {
    /// From a share of the window's width and height on.
    pub fn new(share: f64) -> Self {
        let step = (-2.0 * share.log(RATIO)).round().clamp(0.0, LAST);
        Self { step, seconds: Vec::new() }
    }

    /// Pixels rendered for a window of so many, and the name of the method, where `preview` is one for pictures that are `sparse`.
    pub fn of(&self, window: [u32; 2], sparse: impl Fn([u32; 2]) -> bool) -> ([u32; 2], &'static str) {
        let at = |step: f64| window.map(|side| ((f64::from(side) * share(step)).round() as u32).max(1));
        match at(self.step - PREVIEW) {
            size if self.step >= PREVIEW && sparse(size) => (size, "preview"),
            _ => (at(self.step), "draft"),
        }
    }

    /// Hears what a frame took, and chooses the step for a frame time that is wanted, as if all of the time went by the pixels.
    ///
    /// A part of it does not. So a step up never takes more time than there is, and frames that were in time stay so; and the way
    /// down is gone in a few judgements, none of which goes too far.
    pub fn learn(&mut self, took: Duration, wanted: Duration) {
        self.seconds.push(took.as_secs_f64());
        if self.seconds.len() < FRAMES {
            return;
        }
        self.seconds.sort_by(f64::total_cmp);
        let late = (self.seconds[JUDGED] / wanted.as_secs_f64()).log(RATIO);
        self.seconds.clear();
        // Up with a step to spare and by two at most, or frames that were quick by chance would be followed by slow ones: the first of
        // another size takes twice as long.
        let steps = if late > LATE { late.ceil() } else { (late + 1.0).ceil().clamp(-2.0, 0.0) };
        self.step = (self.step + steps).clamp(0.0, LAST);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames whose time is a fixed one and that of so many pixels a second.
    fn run(resolution: &mut Resolution, fixed: f64, pixels_per_second: f64, wanted: f64, frames: usize) -> Vec<f64> {
        let mut shares = Vec::new();
        for _ in 0..frames {
            let ([w, h], _) = resolution.of([1280, 720], |_| false);
            let took = Duration::from_secs_f64(fixed + f64::from(w * h) / pixels_per_second);
            resolution.learn(took, Duration::from_secs_f64(wanted));
            shares.push(share(resolution.step));
        }
        shares
    }

    #[test]
    fn slow_machines_get_as_many_pixels_as_there_is_time_for_and_stay_there() {
        for fixed in [0.0, 0.03, 0.06] {
            for first in [1.0, 0.2] {
                let mut resolution = Resolution::new(first);
                let shares = run(&mut resolution, fixed, 4e6, 0.1, 200);
                let ([w, h], _) = resolution.of([1280, 720], |_| false);
                let took = fixed + f64::from(w * h) / 4e6;
                assert!((0.1 / RATIO / RATIO..0.105).contains(&took), "{w} x {h}: {took}");
                assert!(shares[100..].windows(2).all(|pair| pair[0] == pair[1]), "to and fro: {shares:?}");
            }
        }
    }

    /// What a flight on two cores takes by each method, ms: of so many pixels, and of the window.
    fn flight(size: [u32; 2], name: &str) -> f64 {
        let pixels = f64::from(size[0] * size[1]) / (890.0 * 625.0);
        0.04 + pixels * if name == "preview" { 0.037 } else { 0.1 }
    }

    #[test]
    fn late_frames_are_previews_as_far_as_those_are_sparse() {
        let window = [890, 625];
        let mut seen = Vec::new();
        for wanted in [0.3, 0.2, 0.12, 0.09, 0.075, 0.065, 0.05] {
            let mut resolution = Resolution::new(0.45);
            let mut last = Vec::new();
            for _ in 0..400 {
                let (size, name) = resolution.of(window, |size| size[1] > 480);
                assert!(name == "draft" || size[1] > 480, "{size:?}");
                let took = flight(size, name);
                resolution.learn(Duration::from_secs_f64(took), Duration::from_secs_f64(wanted));
                last.push((size, name));
            }
            let settled = last[300];
            assert!(last[300..].iter().all(|at| *at == settled), "{wanted}: to and fro, {:?}", &last[300..320]);
            assert!(flight(settled.0, settled.1) < 1.06 * wanted, "{wanted}: {settled:?}");
            seen.push(settled);
        }
        let names: Vec<_> = seen.iter().map(|(_, name)| *name).collect();
        assert_eq!(names[..2], ["draft"; 2], "{seen:?}");
        assert!(names[2..5].contains(&"preview"), "{seen:?}");
        assert_eq!(names[6], "draft", "{seen:?}");
    }

    #[test]
    fn noise_moves_it_little() {
        let mut resolution = Resolution::new(0.3);
        let mut shares = Vec::new();
        let mut random = 1_u32;
        for i in 0..2000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = 0.9 + 0.2 * f64::from(random) / f64::from(u32::MAX) + if i % 10 == 0 { 0.7 } else { 0.0 };
            // What a flight on two cores takes: docs/demo.md.
            let took = noise * (0.045 + 0.165 * share(resolution.step).powi(2));
            resolution.learn(Duration::from_secs_f64(took), Duration::from_secs_f64(0.1));
            shares.push(share(resolution.step));
        }
        let changes = shares[100..].windows(2).filter(|pair| pair[0] != pair[1]).count();
        let (least, most) = shares[100..].iter().fold((1.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!(changes <= 10 && most / least < 1.25, "{changes} changes, {least} to {most}");
    }

    #[test]
    fn fast_machines_get_them_all_again() {
        let mut resolution = Resolution::new(0.1875);
        run(&mut resolution, 0.001, 1e9, 1.0 / 60.0, 120);
        assert_eq!(resolution.step, 0.0);
    }

    #[test]
    fn a_hitch_changes_nothing() {
        let mut resolution = Resolution::new(0.5);
        let before = resolution.step;
        for i in 0..40 {
            let took = if i % 5 == 0 { 2.0 } else { 0.09 };
            resolution.learn(Duration::from_secs_f64(took), Duration::from_secs_f64(0.1));
        }
        assert_eq!(resolution.step, before);
    }
}
