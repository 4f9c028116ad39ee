//! Blue-noise tile by void-and-cluster (Ulichney 1993): dither thresholds with errors at high spatial frequencies.

use std::sync::LazyLock;

use crate::shared::constants;

/// The tile, computed once per process: thresholds from 0 to 1, row by row.
pub static TILE: LazyLock<Vec<f32>> = LazyLock::new(tile);

constants! {
    /// Width and height of the blue-noise tile in points; a power of two, so that coordinates wrap by masking.
    pub const BLUE_SIZE: usize = 64;
}

/// Standard deviation of the energy of a point in pixels (Ulichney recommends 1.5).
const SIGMA: f32 = 1.5;
/// Distance in pixels beyond which the energy, exp(-18), does not change an f32 sum.
const REACH: isize = 9;

struct Energy {
    kernel: Vec<(isize, isize, f32)>,
    field: Vec<f32>,
    on: Vec<bool>,
}

impl Energy {
    fn new() -> Self {
        let mut kernel = Vec::new();
        for y in -REACH..=REACH {
            for x in -REACH..=REACH {
                kernel.push((x, y, (-((x * x + y * y) as f32) / (2.0 * SIGMA * SIGMA)).exp()));
            }
        }
        Self { kernel, field: vec![0.0; BLUE_SIZE * BLUE_SIZE], on: vec![false; BLUE_SIZE * BLUE_SIZE] }
    }

    /// Sets or clears a point and updates the energy around it.
    fn set(&mut self, point: usize, on: bool) {
        self.on[point] = on;
        let sign = if on { 1.0 } else { -1.0 };
        let (x, y) = ((point % BLUE_SIZE) as isize, (point / BLUE_SIZE) as isize);
        for &(dx, dy, energy) in &self.kernel {
            let at = ((y + dy).rem_euclid(BLUE_SIZE as isize) * BLUE_SIZE as isize
                + (x + dx).rem_euclid(BLUE_SIZE as isize)) as usize;
            self.field[at] += sign * energy;
        }
    }

    /// Set point with the most energy around it.
    fn cluster(&self) -> usize {
        self.extreme(true, |a, b| a > b)
    }

    /// Empty point with the least energy around it.
    fn void(&self) -> usize {
        self.extreme(false, |a, b| a < b)
    }

    fn extreme(&self, on: bool, better: impl Fn(f32, f32) -> bool) -> usize {
        let candidates = (0..BLUE_SIZE * BLUE_SIZE).filter(|&i| self.on[i] == on);
        candidates
            .reduce(|best, i| if better(self.field[i], self.field[best]) { i } else { best })
            .expect("there are points of both kinds")
    }
}

/// Rank of each point divided by the number of points, row by row: each value once.
fn tile() -> Vec<f32> {
    let mut energy = Energy::new();
    // Initial pattern: a tenth of the points at pseudo-random positions (a Weyl sequence), relaxed until no point
    // moves.
    let count = BLUE_SIZE * BLUE_SIZE / 10;
    let mut state = 0u32;
    while energy.on.iter().filter(|on| **on).count() < count {
        state = state.wrapping_add(2_654_435_769);
        let mixed = (state ^ (state >> 15)).wrapping_mul(0x2c1b_3c6d);
        let point = (mixed ^ (mixed >> 12)) as usize % (BLUE_SIZE * BLUE_SIZE);
        if !energy.on[point] {
            energy.set(point, true);
        }
    }
    loop {
        let from = energy.cluster();
        energy.set(from, false);
        let to = energy.void();
        energy.set(to, true);
        if to == from {
            break;
        }
    }
    let start = energy.on.clone();

    let mut rank = vec![0usize; BLUE_SIZE * BLUE_SIZE];
    // Ranks of the initial pattern: the tightest clusters are removed first.
    for r in (0..count).rev() {
        let point = energy.cluster();
        energy.set(point, false);
        rank[point] = r;
    }
    // Remaining ranks: the largest voids are filled. (Ulichney continues with clusters of empty points halfway; for a
    // Gaussian of one width they coincide with the largest voids.)
    for (point, on) in start.iter().enumerate() {
        if *on {
            energy.set(point, true);
        }
    }
    for r in count..BLUE_SIZE * BLUE_SIZE {
        let point = energy.void();
        energy.set(point, true);
        rank[point] = r;
    }
    rank.iter().map(|r| *r as f32 / (BLUE_SIZE * BLUE_SIZE) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_comes_once() {
        let mut ranks: Vec<_> = tile().iter().map(|v| (v * (BLUE_SIZE * BLUE_SIZE) as f32) as usize).collect();
        ranks.sort_unstable();
        assert!(ranks.iter().enumerate().all(|(i, r)| i == *r));
    }

    #[test]
    fn low_frequencies_are_missing() {
        // Standard deviation of the means of 8 x 8 blocks: 0.289 / 8 = 0.036 for white noise, far less for blue noise.
        let tile = tile();
        let mut sum = 0.0;
        for block in 0..64 {
            let (bx, by) = (8 * (block % 8), 8 * (block / 8));
            let mean = (0..64).map(|i| tile[(by + i / 8) * BLUE_SIZE + bx + i % 8]).sum::<f32>() / 64.0;
            sum += (mean - 0.5) * (mean - 0.5);
        }
        let deviation = (sum / 64.0).sqrt();
        assert!(deviation < 0.01, "block means deviate by {deviation}");
    }
}
