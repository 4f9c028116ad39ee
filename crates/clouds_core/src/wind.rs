//! Advection by the winds and variation of the cloud cover: closed forms in time, in f64. No frame is integrated from
//! the one before, so a picture at a month is as exact as the first, and frames may be rendered in any order. After a
//! change of the winds, `drift` holds the displacements by the winds before it ([`Params::after`], [`Between`]).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::directions::compass;
use crate::error::{Error, Result};
use crate::params::{Drift, HighClouds, Params, UpperClouds, Wind, WindVariation};
use crate::schema::Block as _;

/// Number of sinusoids that a wander averages.
const SINUSOIDS: i32 = 4;
/// Ratio of consecutive periods: the fourth root of 3. Its powers from 0 to 3 are linearly independent over the
/// integers, so no sinusoid follows from the others and they never realign. (Powers of the golden ratio and of the
/// plastic number are dependent.) The shortest period is two thirds of `wind_variation.period`, the longest one and a half
/// times.
const RATIO: f64 = 1.316_074_012_952_492_5;
/// Quantization steps of the variation of cloud cover. Each step rebakes shadows and majorants, and is too small to be
/// visible.
const COVER_STEPS: f64 = 1024.0;

/// Quantity that the phases are drawn for.
#[derive(Clone, Copy)]
enum Quantity {
    Wind,
    Cover,
}

impl WindVariation {
    /// Angular velocity in rad/s, with alternating sign, and phase in radians at 0 s of each sinusoid. The wander
    /// starts `swings` periods ahead.
    fn sinusoids(&self, quantity: Quantity, swings: f64) -> impl Iterator<Item = (f64, f64)> {
        let (mean, seed) = (f64::from(self.period), self.seed);
        (0..SINUSOIDS).map(move |turn| {
            let period = mean * RATIO.powf(f64::from(turn) - 0.5 * f64::from(SINUSOIDS - 1));
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let random = pcg3d([seed, turn as u32, quantity as u32])[0];
            let omega = sign * TAU / period;
            (omega, f64::from(random) / 2f64.powi(32) * TAU + omega * (swings * mean))
        })
    }

    /// Displacement by gusts from 0 s to `time`, in seconds of the mean wind: along it and to its left. As complex
    /// numbers the velocity of a wind is its mean times 1 + wind x mean of exp(i (omega t + phase)); this is the
    /// integral of the second term.
    fn gust_displacement(&self, swings: f64, time: f64) -> DVec2 {
        let gusts: DVec2 = self
            .sinusoids(Quantity::Wind, swings)
            .map(|(omega, phase)| {
                let (from, to) = (phase.sin_cos(), (omega * time + phase).sin_cos());
                DVec2::new(to.0 - from.0, from.1 - to.1) / omega
            })
            .sum();
        f64::from(self.wind) / f64::from(SINUSOIDS) * gusts
    }

    /// Cloud cover at a time in s, for a mean of `coverage`.
    fn cover(&self, coverage: f32, swings: f64, time: f64) -> f32 {
        let sum: f64 = self.sinusoids(Quantity::Cover, swings).map(|(omega, phase)| (omega * time + phase).sin()).sum();
        let swing = (sum / f64::from(SINUSOIDS) * COVER_STEPS).round() / COVER_STEPS;
        (coverage + self.coverage * swing as f32).clamp(0.0, 1.0)
    }
}

impl Params {
    /// Parameters at a time in s, with the variation of the cloud cover applied.
    pub fn at(&self, time: f64) -> Self {
        let mut now = self.clone();
        now.clouds.coverage = self.wind_variation.cover(self.clouds.coverage, self.drift.swings, time);
        now
    }

    /// Drift with which this sky continues the motion of another: at `time` in s all displacements equal those of
    /// `before`.
    pub fn after(&self, before: &Self, time: f64) -> Drift {
        if self.has_winds_of(before) {
            // Bit-exact: no sum and difference.
            return before.drift.clone();
        }
        Advection::at(before, time).drift_of(self, time)
    }

    /// Whether two skies have the same winds.
    pub fn has_winds_of(&self, other: &Self) -> bool {
        fn winds(params: &Params) -> (&Wind, &WindVariation, [f32; 5]) {
            let UpperClouds { direction, speed, .. } = params.upper_clouds;
            let HighClouds { direction: high_direction, speed: high_speed, evolution, .. } = params.high_clouds;
            (&params.wind, &params.wind_variation, [direction, speed, high_direction, high_speed, evolution])
        }
        winds(self) == winds(other)
    }
}

/// Displacements by the winds between two times in m, or their velocities in m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Advection {
    /// Base shapes, east and north.
    pub shape: DVec2,
    /// Detail, east and north.
    pub detail: DVec2,
    /// Weather map, east and north.
    pub weather: DVec2,
    /// Upper deck (shapes and weather), east and north.
    pub upper: DVec2,
    /// Detail of the upper deck, east and north. Its speed relative to the shapes equals that of the lower deck.
    pub upper_detail: DVec2,
    /// High clouds, along their direction and to its left. The layer rotates with its direction about the origin of the
    /// world: about the displaced origin, a degree would move it by kilometres.
    pub high: DVec2,
    /// Upward displacement of shapes and detail.
    pub rise: f64,
    /// Number of replacements of the largest octave of the high clouds.
    pub evolution: f64,
    /// Number of periods of the wander.
    pub swings: f64,
}

/// Length of [`Advection::numbers`].
pub const NUMBERS: usize = 15;

impl Advection {
    /// Displacements by the winds of a sky between two times in s, without its drift.
    pub fn new(params: &Params, from: f64, to: f64) -> Self {
        let (wind, upper, high) = (&params.wind, &params.upper_clouds, &params.high_clouds);
        let (wander, swings) = (&params.wind_variation, params.drift.swings);
        // Difference of each term first: a displacement from 0 s may exceed the range of f64 where the one between the
        // times does not.
        let seconds = DVec2::new(to - from, 0.0)
            + (wander.gust_displacement(swings, to) - wander.gust_displacement(swings, from));
        // Without variation the displacement is exactly speed times time.
        let by = |direction: f32, speed: f32| rotate_by(compass(f64::from(direction)) * f64::from(speed), seconds);
        Self {
            shape: by(wind.direction, wind.speed),
            detail: by(wind.detail_direction, wind.detail_speed),
            weather: by(wind.weather_direction, wind.weather_speed),
            upper: by(upper.direction, upper.speed),
            upper_detail: by(upper.direction, upper.speed + wind.detail_speed - wind.speed),
            high: f64::from(high.speed) * seconds,
            rise: f64::from(wind.updraft) * (to - from),
            evolution: f64::from(high.evolution) * (to - from),
            swings: (to - from) / f64::from(wander.period),
        }
    }

    /// Displacements from 0 s to a time in s, including the drift of the sky.
    pub fn at(params: &Params, time: f64) -> Self {
        Self::from(&params.drift).plus(&Self::new(params, 0.0, time), 1.0)
    }

    /// Displacements from one sky at one time to another sky at another time, s.
    pub(crate) fn between((before, from): (&Params, f64), (params, to): (&Params, f64)) -> Self {
        if params.has_winds_of(before) && params.drift == before.drift {
            return Self::new(params, from, to);
        }
        Self::at(params, to).plus(&Self::at(before, from), -1.0)
    }

    /// Drift of a sky whose displacements at a time in s, including the drift, are these.
    pub fn drift_of(&self, params: &Params, time: f64) -> Drift {
        let swings = self.swings - time / f64::from(params.wind_variation.period);
        // The gusts depend on the time offset of the wander.
        let ahead = Params { drift: Drift { swings, ..Drift::default() }, ..params.clone() };
        Drift { swings, ..Drift::from(&self.plus(&Self::new(&ahead, 0.0, time), -1.0)) }
    }

    /// Sum with a multiple of another: `self + times * other`.
    #[must_use]
    pub fn plus(&self, other: &Self, times: f64) -> Self {
        let (mut sum, other) = (self.numbers(), other.numbers());
        sum.iter_mut().zip(other).for_each(|(a, b)| *a += times * b);
        Self::from(sum)
    }

    /// All components as an array, in the order of the fields.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let Self { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings } = *self;
        let [a, b, c, d, e, f] = [shape, detail, weather, upper, upper_detail, high].map(|v| v.to_array());
        let [[a, x], [b, y], [c, z], [d, u], [e, v], [f, w]] = [a, b, c, d, e, f];
        [a, x, b, y, c, z, d, u, e, v, f, w, rise, evolution, swings]
    }

    /// Velocities rotated and scaled by a gust, as complex numbers.
    fn with_gust(mut self, gust: DVec2) -> Self {
        let Self { shape, detail, weather, upper, upper_detail, high, .. } = &mut self;
        for wind in [shape, detail, weather, upper, upper_detail, high] {
            *wind = rotate_by(*wind, gust);
        }
        self
    }

    /// Largest displacement of a part of the clouds relative to their drift, m.
    pub(crate) fn spread(&self, has_upper: bool) -> f64 {
        let drift = self.drift().truncate();
        let lower = [self.shape, self.detail, self.weather];
        let upper = if has_upper { [self.upper, self.upper_detail] } else { [drift; 2] };
        let parts = lower.into_iter().chain(upper);
        parts.map(|part| (part - drift).length()).fold(self.rise.abs(), f64::max)
    }

    /// Apparent displacement of the clouds in m: silhouettes move with the weather map, their billows with the base
    /// shapes. The mean of both is used.
    pub(crate) fn drift(&self) -> DVec3 {
        ((self.weather + self.shape) * 0.5).extend(0.5 * self.rise)
    }
}

impl From<[f64; NUMBERS]> for Advection {
    fn from(numbers: [f64; NUMBERS]) -> Self {
        let pair = |index: usize| DVec2::new(numbers[2 * index], numbers[2 * index + 1]);
        let [.., rise, evolution, swings] = numbers;
        let [shape, detail, weather, upper, upper_detail, high] = [0, 1, 2, 3, 4, 5].map(pair);
        Self { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings }
    }
}

impl From<&Drift> for Advection {
    fn from(drift: &Drift) -> Self {
        let Drift { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings } = *drift;
        let [shape, detail, weather] = [shape, detail, weather].map(DVec2::from);
        let [upper, upper_detail, high] = [upper, upper_detail, high].map(DVec2::from);
        Self { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings }
    }
}

impl From<&Advection> for Drift {
    fn from(carried: &Advection) -> Self {
        let Advection { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings } = *carried;
        let [shape, detail, weather] = [shape, detail, weather].map(|v| v.to_array());
        let [upper, upper_detail, high] = [upper, upper_detail, high].map(|v| v.to_array());
        Self { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings }
    }
}

/// Product of two complex numbers.
fn rotate_by(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.y * b.x + a.x * b.y)
}

/// Winds interpolated between two skies as by `nubis.lerp`: speeds linearly, directions along the shorter arc, the
/// wander by its instantaneous period.
pub struct Between<'a> {
    /// Skies at the start and at the end.
    pub skies: [&'a Params; 2],
    /// Start and end in s.
    pub span: [f64; 2],
    /// Whether the interpolation is a smoothstep instead of linear.
    pub smooth: bool,
}

/// Positive nodes and weights of eight-point Gauss-Legendre quadrature on -1 to 1; the negative nodes mirror them.
/// Exact for polynomials up to degree 15; the error on the segments of [`Between::segment_end`] is 1e-15.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];
/// Maximum number of wander periods between two skies whose winds wander: it takes a tenth of a second to integrate.
const MAX_PERIODS: f64 = 16384.0;

/// Quadrature nodes and weights between two numbers.
fn gauss(from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    GAUSS.into_iter().flat_map(move |(x, w)| [(middle - half * x, half * w), (middle + half * x, half * w)])
}

impl Between<'_> {
    /// Integral of all velocities and rates from the start of the span to a time in it, s. The wander starts `swings`
    /// periods ahead.
    ///
    /// Returns [`Error::Parameter`] if the winds wander and the span exceeds 16384 periods.
    pub fn carried(&self, swings: f64, time: f64) -> Result<Advection> {
        let [start, end] = self.span;
        let gusty = self.skies.iter().any(|sky| sky.wind_variation.wind > 0.0);
        let periods = (end - start)
            / self.skies.map(|sky| f64::from(sky.wind_variation.period)).into_iter().fold(f64::MAX, f64::min);
        if gusty && periods > MAX_PERIODS {
            let allowed = format!("at most {MAX_PERIODS} times wind_variation.period where winds change and wander");
            return Err(Error::parameter("keys time between two", end - start, allowed));
        }
        let sinusoids = self.skies.map(|sky| {
            let wander = WindVariation { period: 1.0, ..sky.wind_variation.clone() };
            wander.sinusoids(Quantity::Wind, 0.0).collect::<Vec<_>>()
        });
        let seconds = end - start;
        let last = ((time - start) / seconds).clamp(0.0, 1.0);
        let mut sum = Advection { swings, ..Advection::default() };
        let mut at = 0.0;
        while at < last {
            let next = self.segment_end(at, gusty).min(last);
            let before = sum.swings;
            for (u, weight) in gauss(at, next) {
                let share = self.second_weight(u);
                let mut rates = self.rates(share);
                if gusty {
                    let gone: f64 =
                        gauss(at, u).map(|(v, weight)| weight * self.rates(self.second_weight(v)).swings).sum();
                    let swings = before + seconds * gone;
                    let turn = |&(omega, phase): &(f64, f64)| DVec2::from_angle((omega * swings + phase) % TAU);
                    let gust =
                        sinusoids[usize::from(share >= 0.5)].iter().map(turn).sum::<DVec2>() / f64::from(SINUSOIDS);
                    let [a, b] = self.skies.map(|sky| f64::from(sky.wind_variation.wind));
                    rates = rates.with_gust(DVec2::X + (a + share * (b - a)) * gust);
                }
                sum = sum.plus(&rates, seconds * weight);
            }
            at = next;
        }
        sum.swings -= swings;
        Ok(sum)
    }

    /// End of the quadrature segment that starts at a fraction of the span. A segment is at most a quarter of the span,
    /// at most a quarter of the wander period (140 degrees of the fastest sinusoid), and so short that the period
    /// changes by at most a quarter. No segment crosses the middle, where values that are not interpolated switch.
    fn segment_end(&self, at: f64, gusty: bool) -> f64 {
        let [from, to] = self.skies.map(|sky| f64::from(sky.wind_variation.period));
        let period = from + self.second_weight(at) * (to - from);
        let seconds = if gusty { self.span[1] - self.span[0] } else { 0.0 };
        // The slope of smoothstep is up to 1.5.
        let length = [0.25 * period / seconds, period / (6.0 * (to - from).abs())].into_iter().fold(0.25, f64::min);
        let next = at + length;
        if at < 0.5 { next.min(0.5) } else { next }
    }

    /// Weight of the second sky at a fraction of the span.
    fn second_weight(&self, u: f64) -> f64 {
        if self.smooth { u * u * (3.0 - 2.0 * u) } else { u }
    }

    /// Velocities and rates at a weight of the second sky, without gusts.
    fn rates(&self, share: f64) -> Advection {
        let line = |of: &dyn Fn(&Params) -> f32| {
            let [a, b] = self.skies.map(|sky| f64::from(of(sky)));
            a + share * (b - a)
        };
        let toward = |of: &dyn Fn(&Params) -> f32| {
            let [a, b] = self.skies.map(|sky| f64::from(of(sky)));
            compass(a + share * (180.0 - (180.0 - (b - a)).rem_euclid(360.0)))
        };
        let (speed, detail_speed) = (line(&|sky| sky.wind.speed), line(&|sky| sky.wind.detail_speed));
        let (upper, upper_speed) = (toward(&|sky| sky.upper_clouds.direction), line(&|sky| sky.upper_clouds.speed));
        Advection {
            shape: speed * toward(&|sky| sky.wind.direction),
            detail: detail_speed * toward(&|sky| sky.wind.detail_direction),
            weather: line(&|sky| sky.wind.weather_speed) * toward(&|sky| sky.wind.weather_direction),
            upper: upper_speed * upper,
            upper_detail: (upper_speed + detail_speed - speed) * upper,
            high: DVec2::new(line(&|sky| sky.high_clouds.speed), 0.0),
            rise: line(&|sky| sky.wind.updraft),
            evolution: line(&|sky| sky.high_clouds.evolution),
            swings: 1.0 / line(&|sky| sky.wind_variation.period),
        }
    }
}

/// Continuation of the clouds of an animation whose winds change from shot to shot.
#[derive(Default)]
pub(crate) struct Going {
    /// Sky of the previous shot, its time in s, and the displacements added to its drift.
    last: Option<(Params, f64, Advection)>,
}

/// Maximum time in s between two shots that continue each other; the same as for the rest of the history.
const MAX_SHOT_INTERVAL: f64 = 300.0;

impl Going {
    /// Sky of a shot. If its winds differ from those of the previous shot, the clouds continue from where they are. The
    /// winds change half-way between the two shots, which gives the integral of a linear change. A shot with a drift of
    /// its own (`Keyframes`, `Params::after`) or after a cut is not changed.
    pub fn on(&mut self, params: &Params, time: f64, cut: bool) -> Params {
        let last = self.last.take().filter(|(_, then, _)| !cut && (time - then).abs() <= MAX_SHOT_INTERVAL);
        let mut added = last.as_ref().map_or_else(Advection::default, |(.., added)| *added);
        let with = |params: &Params, added: &Advection| {
            let drift = Drift::from(&Advection::from(&params.drift).plus(added, 1.0));
            Params { drift, ..params.clone() }
        };
        if let Some((before, then, _)) = &last
            && before.drift == params.drift
            && !params.has_winds_of(before)
        {
            let drift = params.after(&with(before, &added), 0.5 * (time + then));
            added = Advection::from(&drift).plus(&Advection::from(&params.drift), -1.0);
        }
        let mut now = with(params, &added);
        let allowed =
            |(index, field): (usize, &crate::schema::Field)| field.check("drift", &now.drift.get(index)).is_ok();
        if !Drift::FIELDS.iter().enumerate().all(allowed) {
            // The continued drift is out of range after an extreme time.
            (now, added) = (params.clone(), Advection::default());
        }
        self.last = Some((params.clone(), time, added));
        now
    }
}

/// Upper bound of the speed of shadow casters, m/s; of a deck that appears, continuously.
pub(crate) fn fastest(params: &Params) -> f64 {
    let wind = &params.wind;
    let upper = params.upper_shown() * params.upper_clouds.speed.abs();
    let level = wind.speed.abs().max(wind.weather_speed.abs()).max(upper) * (1.0 + params.wind_variation.wind);
    f64::from(level.max(wind.updraft.abs()))
}

/// Hash of three 32-bit integers to three (pcg3d: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020).
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
        Params {
            wind_variation: WindVariation { wind, coverage: 0.3, seed, ..WindVariation::default() },
            ..Params::default()
        }
    }

    /// Displacements by all winds, in the order of `means`.
    fn carried(params: &Params, from: f64, to: f64) -> [DVec2; 4] {
        let Advection { shape, detail, weather, high, .. } = Advection::new(params, from, to);
        [shape, detail, weather, high]
    }

    fn means(params: &Params) -> [DVec2; 4] {
        let (wind, high) = (&params.wind, &params.high_clouds);
        [
            (wind.direction, wind.speed),
            (wind.detail_direction, wind.detail_speed),
            (wind.weather_direction, wind.weather_speed),
            // Relative to the direction of the high clouds.
            (90.0, high.speed),
        ]
        .map(|(direction, speed)| compass(f64::from(direction)) * f64::from(speed))
    }

    /// Gust as a fraction of the mean velocity: the mean of rotating unit vectors, as complex numbers.
    fn gust(wander: &WindVariation, time: f64) -> DVec2 {
        let turn = |(omega, phase): (f64, f64)| DVec2::from_angle(omega * time + phase);
        wander.sinusoids(Quantity::Wind, 0.0).map(turn).sum::<DVec2>() / f64::from(SINUSOIDS)
    }

    #[test]
    fn a_wind_that_does_not_wander_blows_by_its_speed() {
        let params = Params { wind: Wind { direction: 90.0, updraft: 2.0, ..Wind::default() }, ..Params::default() };
        for time in [0.0, 1.0, -3600.0, 2.6e6, 1e12] {
            assert_eq!(carried(&params, 0.0, time), means(&params).map(|mean| mean * time));
            assert_eq!(Advection::new(&params, 0.0, time).shape, DVec2::new(8.0 * time, 0.0));
            assert_eq!(Advection::new(&params, 0.0, time).rise, 2.0 * time);
        }
    }

    /// Errors of central differences over a second: 1e-9 of the velocity by the third derivative, 1e-16 of the
    /// displacement by rounding.
    #[test]
    fn displacements_are_integrals_of_velocities() {
        let params = wandering(0.7, 3);
        for time in [0.0, 1.0, 1800.0, -5000.0, 86_400.0, 2.6e6] {
            let gust = gust(&params.wind_variation, time);
            let slopes = carried(&params, time - 0.5, time + 0.5);
            let whole = [carried(&params, 0.0, time - 0.5), carried(&params, 0.0, time + 0.5)];
            for (i, mean) in means(&params).into_iter().enumerate() {
                // Complex product: the gust scales and rotates the mean.
                let velocity =
                    mean + 0.7 * DVec2::new(gust.x * mean.x - gust.y * mean.y, gust.y * mean.x + gust.x * mean.y);
                assert!(slopes[i].distance(velocity) < 1e-6, "{i} at {time} s: {} {velocity}", slopes[i]);
                let tolerance = 1e-6 + 1e-15 * mean.length() * time.abs();
                assert!((whole[1][i] - whole[0][i]).distance(velocity) < tolerance);
            }
        }
        assert_eq!(carried(&params, 0.0, 0.0), [DVec2::ZERO; 4]);
    }

    /// Gusts are at most 1, with zero mean and an rms of a half (four vectors of length a quarter in random
    /// directions), equal along and across the wind.
    #[test]
    fn gusts_are_bounded_and_have_no_mean() {
        for seed in 0..20 {
            let wander = WindVariation { seed, ..WindVariation::default() };
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
            // Change per second: at most that of the fastest sinusoid, 0.3 x 2 pi / 4770 s, and one step.
            let [a, b] = [0.0, 1.0].map(|dt| params.at(f64::from(second) + dt).clouds.coverage);
            assert!((a - b).abs() < 4e-4 + 0.3 / COVER_STEPS as f32);
        }
        let mut wild = params.clone();
        wild.wind_variation.coverage = 1.0;
        assert!((0..1000).all(|i| (0.0..=1.0).contains(&wild.at(f64::from(i) * 500.0).clouds.coverage)));
        // Without variation the parameters stay as given.
        wild.wind_variation.coverage = 0.0;
        assert_eq!(wild.at(1234.5), wild);
    }

    #[test]
    fn extreme_times_have_finite_results() {
        let params = wandering(1.0, 1);
        for time in [1e-300, -1e300, f64::MAX, f64::MIN] {
            assert!(Advection::new(&params, time, time).drift() == DVec3::ZERO);
            assert!((0.0..=1.0).contains(&params.at(time).clouds.coverage));
        }
    }
}
