//! Where the winds have carried what they carry, and how much cover there is: closed forms in time, in f64. No time is
//! stepped through, so a picture a month on is as exact as the first, and frames may come in any order.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::frame::compass;
use crate::params::{Params, Wander};

/// How many slow turns a wander is the mean of.
const TURNS: i32 = 4;
/// Ratio of their periods: the fourth root of 3, whose first four powers have no sum of whole numbers that is 0. So no turn
/// follows from the others, and they never come round together. (The golden and the plastic number have such sums.) The
/// fastest takes two thirds of `wander.period`, the slowest half as long again.
const RATIO: f64 = 1.316_074_012_952_492_5;
/// Steps of a swing of the cover: each is a new sun volume and new majorants, and changes no pixel that one would see.
const COVER_STEPS: f64 = 1024.0;

/// What the phases of the wind and of the cover are drawn for.
#[derive(Clone, Copy)]
enum Of {
    Wind,
    Cover,
}

impl Wander {
    /// Angular velocity in 1/s, every second one the other way round, and phase of each turn.
    fn turns(&self, of: Of) -> impl Iterator<Item = (f64, f64)> {
        let (period, seed) = (f64::from(self.period), self.seed);
        (0..TURNS).map(move |turn| {
            let period = period * RATIO.powf(f64::from(turn) - 0.5 * f64::from(TURNS - 1));
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let random = pcg3d([seed, turn as u32, of as u32])[0];
            (sign * TAU / period, f64::from(random) / 2f64.powi(32) * TAU)
        })
    }

    /// For how many seconds a wind has blown, along its mean and across it to the left, in `time` seconds. Its velocity
    /// is the mean one times 1 + wind x mean of exp(i (omega t + phase)), in complex numbers, which has this integral.
    fn way(&self, time: f64) -> DVec2 {
        let gusts: DVec2 = self
            .turns(Of::Wind)
            .map(|(omega, phase)| {
                let (from, to) = (phase.sin_cos(), (omega * time + phase).sin_cos());
                DVec2::new(to.0 - from.0, from.1 - to.1) / omega
            })
            .sum();
        f64::from(self.wind) / f64::from(TURNS) * gusts
    }

    /// The cover at a time, for a mean of `coverage`.
    fn cover(&self, coverage: f32, time: f64) -> f32 {
        let sum: f64 = self.turns(Of::Cover).map(|(omega, phase)| (omega * time + phase).sin()).sum();
        let swing = (sum / f64::from(TURNS) * COVER_STEPS).round() / COVER_STEPS;
        (coverage + self.coverage * swing as f32).clamp(0.0, 1.0)
    }
}

impl Params {
    /// The sky at a time: what wanders has its value of then, and all that reads it need not know.
    pub fn at(&self, time: f64) -> Self {
        let mut now = self.clone();
        now.clouds.coverage = self.wander.cover(self.clouds.coverage, time);
        now
    }
}

/// How far each wind has carried what it carries from one time to another, m.
pub(crate) struct Carried {
    pub shape: DVec2,
    pub detail: DVec2,
    pub weather: DVec2,
    /// The upper deck, its weather with its shapes.
    pub upper: DVec2,
    /// Its detail, which is as much faster as that of the deck below.
    pub upper_detail: DVec2,
    pub high: DVec2,
    /// Upward, shapes and detail.
    pub rise: f64,
}

impl Carried {
    pub fn new(params: &Params, from: f64, to: f64) -> Self {
        let (wind, upper, high) = (&params.wind, &params.upper_clouds, &params.high_clouds);
        // Difference by difference: the way to either time may be too long for f64 where the way between is not.
        let seconds = DVec2::new(to - from, 0.0) + (params.wander.way(to) - params.wander.way(from));
        let by = |direction: f32, speed: f32| {
            // Of a wind that does not wander exactly its speed times the time.
            let mean = compass(f64::from(direction)) * f64::from(speed);
            DVec2::new(mean.x * seconds.x - mean.y * seconds.y, mean.y * seconds.x + mean.x * seconds.y)
        };
        Self {
            shape: by(wind.direction, wind.speed),
            detail: by(wind.detail_direction, wind.detail_speed),
            weather: by(wind.weather_direction, wind.weather_speed),
            upper: by(upper.direction, upper.speed),
            upper_detail: by(upper.direction, upper.speed + wind.detail_speed - wind.speed),
            high: by(high.direction, high.speed),
            rise: f64::from(wind.updraft) * (to - from),
        }
    }

    /// How far the clouds have drifted. What the eye follows is the silhouette: it drifts with the weather, and its
    /// billows with the base shape.
    pub fn drift(&self) -> DVec3 {
        ((self.weather + self.shape) * 0.5).extend(0.5 * self.rise)
    }
}

/// The largest speed at which anything that casts a shadow may move, m/s.
pub(crate) fn fastest(params: &Params) -> f64 {
    let wind = &params.wind;
    let upper = if params.has_upper_clouds() { params.upper_clouds.speed.abs() } else { 0.0 };
    let level = wind.speed.abs().max(wind.weather_speed.abs()).max(upper) * (1.0 + params.wander.wind);
    f64::from(level.max(wind.updraft.abs()))
}

/// As in random.wgsl.
fn pcg3d(v: [u32; 3]) -> [u32; 3] {
    let mix = |[x, y, z]: [u32; 3]| {
        let x = x.wrapping_add(y.wrapping_mul(z));
        let y = y.wrapping_add(z.wrapping_mul(x));
        [x, y, z.wrapping_add(x.wrapping_mul(y))]
    };
    let v = v.map(|v| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(mix(v).map(|v| v ^ (v >> 16)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Wind;

    fn wandering(wind: f32, seed: u32) -> Params {
        Params { wander: Wander { wind, coverage: 0.3, seed, ..Wander::default() }, ..Params::default() }
    }

    /// Displacements of all winds, in the order of their mean velocities.
    fn carried(params: &Params, from: f64, to: f64) -> [DVec2; 4] {
        let Carried { shape, detail, weather, high, .. } = Carried::new(params, from, to);
        [shape, detail, weather, high]
    }

    fn means(params: &Params) -> [DVec2; 4] {
        let (wind, high) = (&params.wind, &params.high_clouds);
        [
            (wind.direction, wind.speed),
            (wind.detail_direction, wind.detail_speed),
            (wind.weather_direction, wind.weather_speed),
            (high.direction, high.speed),
        ]
        .map(|(direction, speed)| compass(f64::from(direction)) * f64::from(speed))
    }

    /// The velocity in place of its integral: the mean of turning vectors, as complex numbers.
    fn gust(wander: &Wander, time: f64) -> DVec2 {
        let turn = |(omega, phase): (f64, f64)| DVec2::from_angle(omega * time + phase);
        wander.turns(Of::Wind).map(turn).sum::<DVec2>() / f64::from(TURNS)
    }

    #[test]
    fn a_wind_that_does_not_wander_blows_by_its_speed() {
        let params = Params { wind: Wind { direction: 90.0, updraft: 2.0, ..Wind::default() }, ..Params::default() };
        for time in [0.0, 1.0, -3600.0, 2.6e6, 1e12] {
            assert_eq!(carried(&params, 0.0, time), means(&params).map(|mean| mean * time));
            assert_eq!(Carried::new(&params, 0.0, time).shape, DVec2::new(8.0 * time, 0.0));
            assert_eq!(Carried::new(&params, 0.0, time).rise, 2.0 * time);
        }
    }

    /// Central differences over a second err by the third derivative, 1e-9 of the velocity, and by rounding: 1e-16 of
    /// the way.
    #[test]
    fn the_way_is_the_integral_of_the_velocity() {
        let params = wandering(0.7, 3);
        for time in [0.0, 1.0, 1800.0, -5000.0, 86_400.0, 2.6e6] {
            let gust = gust(&params.wander, time);
            let slopes = carried(&params, time - 0.5, time + 0.5);
            let whole = [carried(&params, 0.0, time - 0.5), carried(&params, 0.0, time + 0.5)];
            for (i, mean) in means(&params).into_iter().enumerate() {
                // A complex product: stretched by the gust and turned by it.
                let velocity =
                    mean + 0.7 * DVec2::new(gust.x * mean.x - gust.y * mean.y, gust.y * mean.x + gust.x * mean.y);
                assert!(slopes[i].distance(velocity) < 1e-6, "{i} at {time} s: {} {velocity}", slopes[i]);
                let tolerance = 1e-6 + 1e-15 * mean.length() * time.abs();
                assert!((whole[1][i] - whole[0][i]).distance(velocity) < tolerance);
            }
        }
        assert_eq!(carried(&params, 0.0, 0.0), [DVec2::ZERO; 4]);
    }

    /// Never more than the share, about zero in the mean, half of it as a rule (four vectors of a quarter in any
    /// direction), and both along the wind and across.
    #[test]
    fn gusts_are_bounded_and_have_no_mean() {
        for seed in 0..20 {
            let wander = Wander { seed, ..Wander::default() };
            let times = (0..40_000).map(|i| f64::from(i) * 100.0);
            let gusts: Vec<_> = times.map(|time| gust(&wander, time)).collect();
            let count = gusts.len() as f64;
            assert!(gusts.iter().all(|gust| gust.length() <= 1.0 + 1e-12));
            assert!(gusts.iter().any(|gust| gust.length() > 0.9));
            assert!((gusts.iter().sum::<DVec2>() / count).length() < 0.01, "{seed}");
            let square = gusts.iter().map(|gust| *gust * *gust).sum::<DVec2>() / count;
            assert!((square - DVec2::splat(0.125)).abs().max_element() < 0.01, "{square}");
        }
    }

    #[test]
    fn seeds_repeat_and_differ() {
        let at = |seed| carried(&wandering(0.5, seed), 0.0, 5000.0)[0];
        assert_eq!(at(1), at(1));
        for (a, b) in [(0, 1), (1, 2), (1, u32::MAX)] {
            assert!(at(a).distance(at(b)) > 100.0);
        }
    }

    #[test]
    fn cover_swings_between_its_ends() {
        let params = wandering(0.0, 5);
        let covers: Vec<_> = (0..40_000).map(|i| params.at(f64::from(i) * 100.0).clouds.coverage).collect();
        let mean = covers.iter().map(|c| f64::from(*c)).sum::<f64>() / covers.len() as f64;
        assert!((mean - 0.45).abs() < 0.005, "{mean}");
        let (least, most) = covers.iter().fold((1f32, 0f32), |(a, b), &c| (a.min(c), b.max(c)));
        assert!((0.15..0.2).contains(&least) && (0.7..=0.75).contains(&most), "{least} {most}");
        for second in 0..20_000 {
            // In a second by less than the fastest turn, 0.3 x 2 pi / 4770 s, and a step.
            let [a, b] = [0.0, 1.0].map(|dt| params.at(f64::from(second) + dt).clouds.coverage);
            assert!((a - b).abs() < 4e-4 + 0.3 / COVER_STEPS as f32);
        }
        let mut wild = params.clone();
        wild.wander.coverage = 1.0;
        assert!((0..1000).all(|i| (0.0..=1.0).contains(&wild.at(f64::from(i) * 500.0).clouds.coverage)));
        // What does not wander is what the user has said.
        wild.wander.coverage = 0.0;
        assert_eq!(wild.at(1234.5), wild);
    }

    #[test]
    fn any_time_is_a_time() {
        let params = wandering(1.0, 1);
        for time in [1e-300, -1e300, f64::MAX, f64::MIN] {
            assert!(Carried::new(&params, time, time).drift() == DVec3::ZERO);
            assert!((0.0..=1.0).contains(&params.at(time).clouds.coverage));
        }
    }
}
