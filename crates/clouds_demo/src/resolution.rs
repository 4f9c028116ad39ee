//! How many of the window's pixels are rendered while anything moves, so that frames come in time.

use std::time::Duration;

/// Shares of the window's width and height, best first.
const STEPS: [f64; 6] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875];
/// Frames that a judgement is the median of: one that compiles or bakes says nothing.
const FRAMES: usize = 5;
/// Share of a frame's time that is taken to depend on its pixels, until frames of two sizes tell.
const BY_PIXELS: f64 = 0.6;

/// The step at hand, and what frames took.
#[derive(Clone, Debug)]
pub struct Resolution {
    step: usize,
    seconds: Vec<f64>,
    /// The last judgement of each step, s.
    known: [Option<f64>; STEPS.len()],
}

impl Resolution {
    /// From a share of the window on.
    pub fn new(share: f64) -> Self {
        let step = STEPS.iter().position(|step| *step <= share + 1e-9).unwrap_or(STEPS.len() - 1);
        Self { step, seconds: Vec::new(), known: [None; STEPS.len()] }
    }

    /// Share of the window's width and height.
    pub fn share(&self) -> f64 {
        STEPS[self.step]
    }

    /// Pixels rendered for a window of so many.
    pub fn of(&self, window: [u32; 2]) -> [u32; 2] {
        window.map(|side| ((f64::from(side) * self.share()).round() as u32).max(1))
    }

    /// Hears what a frame took, and chooses the step for a frame time that is wanted.
    ///
    /// Down as soon as frames are too long by a tenth, to the first step that is quick enough; up by one step, where it would
    /// take nine tenths at most, or the step would change to and fro.
    pub fn learn(&mut self, took: Duration, wanted: Duration) {
        self.seconds.push(took.as_secs_f64());
        if self.seconds.len() < FRAMES {
            return;
        }
        self.seconds.sort_by(f64::total_cmp);
        let median = self.seconds[FRAMES / 2];
        self.seconds.clear();
        self.known[self.step] = Some(median);
        let wanted = wanted.as_secs_f64();
        if median > 1.1 * wanted {
            let quick = |step: &usize| self.expected(*step, median) <= wanted;
            self.step = (self.step + 1..STEPS.len()).find(quick).unwrap_or(STEPS.len() - 1);
        } else if self.step > 0 && self.expected(self.step - 1, median) <= 0.9 * wanted {
            self.step -= 1;
        }
    }

    /// What a frame of another step will take, s, where those of this one take `now`: a line through what is known of this and of
    /// the nearest other step.
    fn expected(&self, step: usize, now: f64) -> f64 {
        let pixels = |step: usize| STEPS[step].powi(2);
        let others = (0..STEPS.len()).filter(|other| *other != self.step);
        let known = others.filter_map(|other| Some((other, self.known[other]?)));
        let slope = match known.min_by_key(|(other, _)| other.abs_diff(self.step)) {
            Some((other, then)) => (now - then) / (pixels(self.step) - pixels(other)),
            None => BY_PIXELS * now / pixels(self.step),
        };
        // Times are noisy, but no frame is quicker for more pixels.
        now + slope.max(0.1 * now / pixels(self.step)) * (pixels(step) - pixels(self.step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames whose time is a fixed one and that of so many pixels a second.
    fn run(resolution: &mut Resolution, fixed: f64, pixels_per_second: f64, wanted: f64, frames: usize) -> Vec<f64> {
        let mut shares = Vec::new();
        for _ in 0..frames {
            let [w, h] = resolution.of([1280, 720]);
            let took = Duration::from_secs_f64(fixed + f64::from(w * h) / pixels_per_second);
            resolution.learn(took, Duration::from_secs_f64(wanted));
            shares.push(resolution.share());
        }
        shares
    }

    #[test]
    fn slow_machines_get_fewer_pixels_and_stay_there() {
        for fixed in [0.0, 0.03, 0.06] {
            let mut resolution = Resolution::new(1.0);
            let shares = run(&mut resolution, fixed, 4e6, 0.1, 200);
            let [w, h] = resolution.of([1280, 720]);
            let took = fixed + f64::from(w * h) / 4e6;
            assert!(took <= 0.11, "{w} x {h}: {took}");
            // As many as there is time for.
            let [w, h] = [w * 3 / 2, h * 3 / 2];
            assert!(fixed + f64::from(w * h) / 4e6 > 0.09, "{w} x {h}");
            assert!(shares[60..].windows(2).all(|pair| pair[0] == pair[1]), "to and fro: {shares:?}");
        }
    }

    #[test]
    fn fast_machines_get_them_all_again() {
        let mut resolution = Resolution::new(0.1875);
        run(&mut resolution, 0.001, 1e9, 1.0 / 60.0, 60);
        assert_eq!(resolution.share(), 1.0);
    }

    #[test]
    fn a_hitch_changes_nothing() {
        let mut resolution = Resolution::new(0.5);
        for i in 0..40 {
            let took = if i % 5 == 0 { 2.0 } else { 0.09 };
            resolution.learn(Duration::from_secs_f64(took), Duration::from_secs_f64(0.1));
        }
        assert_eq!(resolution.share(), 0.5);
    }
}
