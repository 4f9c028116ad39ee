//! Dynamic resolution: pixel count and quality of animated frames, chosen to hold a target frame time.

use std::time::Duration;

/// Ratio of the pixel counts of adjacent steps.
const PIXEL_RATIO: f64 = 1.2;
/// Last step: a fifth of the window's width and height in `draft`.
const LAST_STEP: f64 = 18.0;
/// First step that renders `preview` in place of `draft`, if `preview` marches one pixel in sixteen at that size.
///
/// - A `preview` frame has the size of a `draft` frame this many steps earlier and takes 0.27 to 0.38 of its time.
/// - `PIXEL_RATIO.powf(-7.0)` is 0.28, so no step toward more pixels takes more time than the model expects.
/// - `preview` looks better than a small `draft` frame: sky and ground have full resolution, and disoccluded clouds
///   have rays of their own after a quarter of the frames.
const PREVIEW_STEP: f64 = 7.0;
/// Frames per decision.
const FRAMES_PER_DECISION: usize = 5;
/// Index of the deciding frame among those of a decision, in ascending order of time.
///
/// The slowest frame in five is ignored because it may include baking or compiling. Most others must be on time.
const DECIDING_FRAME: usize = 3;
/// Tolerated lateness, steps: 5 % of the frame time. A smaller value lets timing noise toggle the step.
const LATENESS_TOLERANCE: f64 = 0.27;

/// Scale of the window's width and height in `draft`.
fn scale(step: f64) -> f64 {
    PIXEL_RATIO.powf(-0.5 * step)
}

/// State of the controller: the current step, and the frame times since the last decision.
#[derive(Clone, Debug)]
pub struct DynamicResolution {
    step: f64,
    seconds: Vec<f64>,
}

impl DynamicResolution {
    /// Controller that starts at the step nearest to a scale of the window's width and height.
    pub fn new(scale: f64) -> Self {
        let step = (-2.0 * scale.log(PIXEL_RATIO)).round().clamp(0.0, LAST_STEP);
        Self { step, seconds: Vec::new() }
    }

    /// Frame size for a window size, and the name of the quality.
    ///
    /// `is_low_resolution` tells whether `preview` marches one pixel in sixteen of a frame size.
    pub fn choose(&self, window: [u32; 2], is_low_resolution: impl Fn([u32; 2]) -> bool) -> ([u32; 2], &'static str) {
        let at = |step: f64| window.map(|side| ((f64::from(side) * scale(step)).round() as u32).max(1));
        match at(self.step - PREVIEW_STEP) {
            size if self.step >= PREVIEW_STEP && is_low_resolution(size) => (size, "preview"),
            _ => (at(self.step), "draft"),
        }
    }

    /// Records a frame's time; every `FRAMES_PER_DECISION` frames, chooses the step for a target frame time.
    ///
    /// The model takes frame time as proportional to pixel count. Part of the time is constant, so the model
    /// overestimates the effect of a step. Steps toward more pixels therefore never miss the target, and steps toward
    /// fewer pixels reach it in a few decisions without overshoot.
    pub fn record(&mut self, elapsed: Duration, target: Duration) {
        self.seconds.push(elapsed.as_secs_f64());
        if self.seconds.len() < FRAMES_PER_DECISION {
            return;
        }
        self.seconds.sort_by(f64::total_cmp);
        let lateness = (self.seconds[DECIDING_FRAME] / target.as_secs_f64()).log(PIXEL_RATIO);
        self.seconds.clear();
        // The first frame of a new size takes twice as long, so growing after a few fast outliers would cause slow
        // frames. Growth leaves one step of headroom and is limited to two steps.
        let steps =
            if lateness > LATENESS_TOLERANCE { lateness.ceil() } else { (lateness + 1.0).ceil().clamp(-2.0, 0.0) };
        self.step = (self.step + steps).clamp(0.0, LAST_STEP);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulated frames with a constant cost (s) and a throughput (pixels/s); returns the scale after each frame.
    fn run(
        resolution: &mut DynamicResolution,
        fixed: f64,
        pixels_per_second: f64,
        target: f64,
        frames: usize,
    ) -> Vec<f64> {
        let mut scales = Vec::new();
        for _ in 0..frames {
            let ([w, h], _) = resolution.choose([1280, 720], |_| false);
            let elapsed = Duration::from_secs_f64(fixed + f64::from(w * h) / pixels_per_second);
            resolution.record(elapsed, Duration::from_secs_f64(target));
            scales.push(scale(resolution.step));
        }
        scales
    }

    #[test]
    fn slow_machines_converge_to_the_largest_size_within_the_target() {
        for fixed in [0.0, 0.03, 0.06] {
            for first in [1.0, 0.2] {
                let mut resolution = DynamicResolution::new(first);
                let scales = run(&mut resolution, fixed, 4e6, 0.1, 200);
                let ([w, h], _) = resolution.choose([1280, 720], |_| false);
                let elapsed = fixed + f64::from(w * h) / 4e6;
                assert!((0.1 / PIXEL_RATIO / PIXEL_RATIO..0.105).contains(&elapsed), "{w} x {h}: {elapsed}");
                assert!(scales[100..].windows(2).all(|pair| pair[0] == pair[1]), "oscillates: {scales:?}");
            }
        }
    }

    /// Frame time of a flight on two cores, s: a cost per pixel that depends on the quality, plus 40 ms.
    fn flight_seconds(size: [u32; 2], name: &str) -> f64 {
        let pixels = f64::from(size[0] * size[1]) / (890.0 * 625.0);
        0.04 + pixels * if name == "preview" { 0.037 } else { 0.1 }
    }

    #[test]
    fn late_frames_are_previews_where_those_are_sparse() {
        let window = [890, 625];
        let mut seen = Vec::new();
        for target in [0.3, 0.2, 0.12, 0.09, 0.075, 0.065, 0.05] {
            let mut resolution = DynamicResolution::new(0.45);
            let mut last = Vec::new();
            for _ in 0..400 {
                let (size, name) = resolution.choose(window, |size| size[1] > 480);
                assert!(name == "draft" || size[1] > 480, "{size:?}");
                let elapsed = flight_seconds(size, name);
                resolution.record(Duration::from_secs_f64(elapsed), Duration::from_secs_f64(target));
                last.push((size, name));
            }
            let settled = last[300];
            assert!(last[300..].iter().all(|at| *at == settled), "{target}: oscillates, {:?}", &last[300..320]);
            assert!(flight_seconds(settled.0, settled.1) < 1.06 * target, "{target}: {settled:?}");
            seen.push(settled);
        }
        let names: Vec<_> = seen.iter().map(|(_, name)| *name).collect();
        assert_eq!(names[..2], ["draft"; 2], "{seen:?}");
        assert!(names[2..5].contains(&"preview"), "{seen:?}");
        assert_eq!(names[6], "draft", "{seen:?}");
    }

    #[test]
    fn noise_barely_changes_the_resolution() {
        let mut resolution = DynamicResolution::new(0.3);
        let mut scales = Vec::new();
        let mut random = 1_u32;
        for i in 0..2000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = 0.9 + 0.2 * f64::from(random) / f64::from(u32::MAX) + if i % 10 == 0 { 0.7 } else { 0.0 };
            // Frame time of a flight on two cores, from docs/demo.md.
            let elapsed = noise * (0.045 + 0.165 * scale(resolution.step).powi(2));
            resolution.record(Duration::from_secs_f64(elapsed), Duration::from_secs_f64(0.1));
            scales.push(scale(resolution.step));
        }
        let changes = scales[100..].windows(2).filter(|pair| pair[0] != pair[1]).count();
        let (least, most) = scales[100..].iter().fold((1.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!(changes <= 10 && most / least < 1.25, "{changes} changes, {least} to {most}");
    }

    #[test]
    fn fast_machines_return_to_full_resolution() {
        let mut resolution = DynamicResolution::new(0.1875);
        run(&mut resolution, 0.001, 1e9, 1.0 / 60.0, 120);
        assert_eq!(resolution.step, 0.0);
    }

    #[test]
    fn a_hitch_does_not_change_the_step() {
        let mut resolution = DynamicResolution::new(0.5);
        let before = resolution.step;
        for i in 0..40 {
            let elapsed = if i % 5 == 0 { 2.0 } else { 0.09 };
            resolution.record(Duration::from_secs_f64(elapsed), Duration::from_secs_f64(0.1));
        }
        assert_eq!(resolution.step, before);
    }
}
