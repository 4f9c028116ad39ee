//! How many of the window's pixels are rendered while anything moves, so that frames come in time.

use std::time::Duration;

/// Shares of the window's width and height, best first.
const STEPS: [f64; 6] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875];
/// Frames that a judgement is the mean of.
const FRAMES: u32 = 6;

/// The step at hand, and what its frames took.
#[derive(Clone, Copy, Debug)]
pub struct Resolution {
    step: usize,
    seconds: f64,
    frames: u32,
}

impl Resolution {
    /// From a share of the window on.
    pub fn new(share: f64) -> Self {
        let step = STEPS.iter().position(|step| *step <= share + 1e-9).unwrap_or(STEPS.len() - 1);
        Self { step, seconds: 0.0, frames: 0 }
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
    /// Down as soon as the mean is too long by a tenth; up only where the next step, by its pixels, would take three quarters of
    /// it at most, or the step would change to and fro, and each change costs a frame that has no history.
    pub fn learn(&mut self, took: Duration, wanted: Duration) {
        self.seconds += took.as_secs_f64();
        self.frames += 1;
        if self.frames < FRAMES {
            return;
        }
        let mean = self.seconds / f64::from(self.frames);
        (self.seconds, self.frames) = (0.0, 0);
        let wanted = wanted.as_secs_f64();
        if mean > 1.1 * wanted {
            // As far down as is needed, at once.
            let fits = |step: &usize| mean * (STEPS[*step] / self.share()).powi(2) <= wanted;
            self.step = (self.step + 1..STEPS.len()).find(fits).unwrap_or(STEPS.len() - 1);
        } else if self.step > 0 && mean * (STEPS[self.step - 1] / self.share()).powi(2) < 0.75 * wanted {
            self.step -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames whose time is that of so many pixels a second.
    fn run(resolution: &mut Resolution, pixels_per_second: f64, wanted: f64, frames: usize) -> Vec<f64> {
        let mut shares = Vec::new();
        for _ in 0..frames {
            let [w, h] = resolution.of([1280, 720]);
            let took = Duration::from_secs_f64(f64::from(w * h) / pixels_per_second);
            resolution.learn(took, Duration::from_secs_f64(wanted));
            shares.push(resolution.share());
        }
        shares
    }

    #[test]
    fn slow_machines_get_fewer_pixels_and_stay_there() {
        let mut resolution = Resolution::new(1.0);
        let shares = run(&mut resolution, 3e6, 0.1, 120);
        let [w, h] = resolution.of([1280, 720]);
        assert!(f64::from(w * h) / 3e6 <= 0.11, "{w} x {h}");
        assert!(shares[20..].windows(2).all(|pair| pair[0] == pair[1]), "it changes to and fro: {shares:?}");
    }

    #[test]
    fn fast_machines_get_them_all_again() {
        let mut resolution = Resolution::new(0.1875);
        run(&mut resolution, 1e9, 1.0 / 60.0, 60);
        assert_eq!(resolution.share(), 1.0);
    }
}
