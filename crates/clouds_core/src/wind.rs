//! Where the winds have carried what they carry, and how much cover there is: closed forms in time, in f64. No frame is
//! stepped through, so a picture a month on is as exact as the first, and frames may come in any order. Where winds change,
//! `drift` says how far the winds of before have carried things ([`Params::after`], [`Between`]).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::directions::compass;
use crate::error::{Error, Result};
use crate::params::{Drift, HighClouds, Params, UpperClouds, Wind, Wander};
use crate::schema::Block as _;

/// How many slow turns a wander is the mean of.
const TURNS: i32 = 4;
/// Ratio of their periods: the fourth root of 3, whose first four powers have no sum of whole numbers that is 0. So no turn
/// follows from the others, and they never come round together. (The golden and the plastic number have such sums.) The
/// fastest takes two thirds of `wander.period`, the slowest half as long again.
const RATIO: f64 = 1.316_074_012_952_492_5;
/// Steps of a swing of the cover: each is new shadows and new majorants, and changes no pixel that one would see.
const COVER_STEPS: f64 = 1024.0;

/// What the phases of the wind and of the cover are drawn for.
#[derive(Clone, Copy)]
enum Of {
    Wind,
    Cover,
}

impl Wander {
    /// Angular velocity in 1/s, every second one the other way round, and phase at 0 s of each turn of a wander that is so
    /// many periods ahead.
    fn turns(&self, of: Of, swings: f64) -> impl Iterator<Item = (f64, f64)> {
        let (mean, seed) = (f64::from(self.period), self.seed);
        (0..TURNS).map(move |turn| {
            let period = mean * RATIO.powf(f64::from(turn) - 0.5 * f64::from(TURNS - 1));
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let random = pcg3d([seed, turn as u32, of as u32])[0];
            let omega = sign * TAU / period;
            (omega, f64::from(random) / 2f64.powi(32) * TAU + omega * (swings * mean))
        })
    }

    /// For how many seconds a wind has blown, along its mean and across it to the left, in `time` seconds. Its velocity
    /// is the mean one times 1 + wind x mean of exp(i (omega t + phase)), in complex numbers, which has this integral.
    fn way(&self, swings: f64, time: f64) -> DVec2 {
        let gusts: DVec2 = self
            .turns(Of::Wind, swings)
            .map(|(omega, phase)| {
                let (from, to) = (phase.sin_cos(), (omega * time + phase).sin_cos());
                DVec2::new(to.0 - from.0, from.1 - to.1) / omega
            })
            .sum();
        f64::from(self.wind) / f64::from(TURNS) * gusts
    }

    /// The cover at a time, for a mean of `coverage`.
    fn cover(&self, coverage: f32, swings: f64, time: f64) -> f32 {
        let sum: f64 = self.turns(Of::Cover, swings).map(|(omega, phase)| (omega * time + phase).sin()).sum();
        let swing = (sum / f64::from(TURNS) * COVER_STEPS).round() / COVER_STEPS;
        (coverage + self.coverage * swing as f32).clamp(0.0, 1.0)
    }
}

impl Params {
    /// The sky at a time: what wanders has its value of then, and all that reads it need not know.
    pub fn at(&self, time: f64) -> Self {
        let mut now = self.clone();
        now.clouds.coverage = self.wander.cover(self.clouds.coverage, self.drift.swings, time);
        now
    }

    /// The drift with which this sky goes on from another: at `time` all that winds carry is where `before` has it.
    pub fn after(&self, before: &Self, time: f64) -> Drift {
        if self.has_winds_of(before) {
            // To the bit, without a sum and a difference.
            return before.drift.clone();
        }
        Advection::at(before, time).drift_of(self, time)
    }

    /// Whether what winds carry moves as in another sky.
    pub fn has_winds_of(&self, other: &Self) -> bool {
        fn winds(params: &Params) -> (&Wind, &Wander, [f32; 5]) {
            let UpperClouds { direction, speed, .. } = params.upper_clouds;
            let HighClouds { direction: high_direction, speed: high_speed, evolution, .. } = params.high_clouds;
            (&params.wind, &params.wander, [direction, speed, high_direction, high_speed, evolution])
        }
        winds(self) == winds(other)
    }
}

/// How far each wind has carried what it carries from one time to another, m; or how fast it does, m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Advection {
    /// The base shapes, east and north, as the next four.
    pub shape: DVec2,
    /// The detail.
    pub detail: DVec2,
    /// The weather map.
    pub weather: DVec2,
    /// The upper deck, its weather with its shapes.
    pub upper: DVec2,
    /// Its detail, which is as much faster as that of the deck below.
    pub upper_detail: DVec2,
    /// The high clouds, along their direction and to the left of it: the layer turns with its wind, about the origin of the
    /// world. About where the origin has been carried, a turn of a degree would move it by kilometres.
    pub high: DVec2,
    /// Upward, shapes and detail.
    pub rise: f64,
    /// How often the largest shapes of the high clouds have been replaced.
    pub evolution: f64,
    /// How many of its periods the wander has gone.
    pub swings: f64,
}

/// Numbers of [`Advection`] in a row.
pub const NUMBERS: usize = 15;

impl Advection {
    /// By one sky's winds.
    pub fn new(params: &Params, from: f64, to: f64) -> Self {
        let (wind, upper, high) = (&params.wind, &params.upper_clouds, &params.high_clouds);
        let (wander, swings) = (&params.wander, params.drift.swings);
        // Difference by difference: the way to either time may be too long for f64 where the way between is not.
        let seconds = DVec2::new(to - from, 0.0) + (wander.way(swings, to) - wander.way(swings, from));
        // Of a wind that does not wander exactly its speed times the time.
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

    /// To a time, and by what has been before.
    pub fn at(params: &Params, time: f64) -> Self {
        Self::from(&params.drift).plus(&Self::new(params, 0.0, time), 1.0)
    }

    /// From one sky at a time to another at another.
    pub(crate) fn between((before, from): (&Params, f64), (params, to): (&Params, f64)) -> Self {
        if params.has_winds_of(before) && params.drift == before.drift {
            return Self::new(params, from, to);
        }
        Self::at(params, to).plus(&Self::at(before, from), -1.0)
    }

    /// The drift of a sky that has carried things so far at a time.
    pub fn drift_of(&self, params: &Params, time: f64) -> Drift {
        let swings = self.swings - time / f64::from(params.wander.period);
        // The gusts are those of where the wander is.
        let ahead = Params { drift: Drift { swings, ..Drift::default() }, ..params.clone() };
        Drift { swings, ..Drift::from(&self.plus(&Self::new(&ahead, 0.0, time), -1.0)) }
    }

    /// The sum with so many times another.
    #[must_use]
    pub fn plus(&self, other: &Self, times: f64) -> Self {
        let (mut sum, other) = (self.numbers(), other.numbers());
        sum.iter_mut().zip(other).for_each(|(a, b)| *a += times * b);
        Self::from(sum)
    }

    /// All numbers in a row.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let Self { shape, detail, weather, upper, upper_detail, high, rise, evolution, swings } = *self;
        let [a, b, c, d, e, f] = [shape, detail, weather, upper, upper_detail, high].map(|v| v.to_array());
        let [[a, x], [b, y], [c, z], [d, u], [e, v], [f, w]] = [a, b, c, d, e, f];
        [a, x, b, y, c, z, d, u, e, v, f, w, rise, evolution, swings]
    }

    /// In gusts, as complex numbers.
    fn blown(mut self, gust: DVec2) -> Self {
        let Self { shape, detail, weather, upper, upper_detail, high, .. } = &mut self;
        for wind in [shape, detail, weather, upper, upper_detail, high] {
            *wind = rotate_by(*wind, gust);
        }
        self
    }

    /// How far the clouds have drifted. What the eye follows is the silhouette: it drifts with the weather, and its
    /// billows with the base shape.
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

/// The product of two complex numbers.
fn rotate_by(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.y * b.x + a.x * b.y)
}

/// The winds on the way from one sky to another, as `nubis.lerp` has them: speeds in a straight line, directions on the
/// shorter arc, the wander by its period of each moment.
pub struct Between<'a> {
    /// The sky at the start and that at the end.
    pub skies: [&'a Params; 2],
    /// Start and end, s.
    pub span: [f64; 2],
    /// Whether the way is slow at both ends.
    pub smooth: bool,
}

/// Nodes and weights of Gauss and Legendre's quadrature by eight points on -1 to 1 (the other half of them mirrored). Exact
/// for polynomials to the 15th degree; of the pieces of [`Between::piece`] it misses 1e-15.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];
/// Most periods of a wind that wanders from one sky to another: a tenth of a second to integrate.
const MOST_PERIODS: f64 = 16384.0;

/// Nodes and weights between two numbers.
fn gauss(from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    GAUSS.into_iter().flat_map(move |(x, w)| [(middle - half * x, half * w), (middle + half * x, half * w)])
}

impl Between<'_> {
    /// The integral of all velocities and rates from the start to a time of the span, for a wander that is `swings` ahead at
    /// the start.
    pub fn carried(&self, swings: f64, time: f64) -> Result<Advection> {
        let [start, end] = self.span;
        let gusty = self.skies.iter().any(|sky| sky.wander.wind > 0.0);
        let periods =
            (end - start) / self.skies.map(|sky| f64::from(sky.wander.period)).into_iter().fold(f64::MAX, f64::min);
        if gusty && periods > MOST_PERIODS {
            let allowed = format!("at most {MOST_PERIODS} times wander.period where winds change and wander");
            return Err(Error::parameter("keys time between two", end - start, allowed));
        }
        let turns = self.skies.map(|sky| {
            let wander = Wander { period: 1.0, ..sky.wander.clone() };
            wander.turns(Of::Wind, 0.0).collect::<Vec<_>>()
        });
        let seconds = end - start;
        let last = ((time - start) / seconds).clamp(0.0, 1.0);
        let mut sum = Advection { swings, ..Advection::default() };
        let mut at = 0.0;
        while at < last {
            let next = self.piece(at, gusty).min(last);
            let before = sum.swings;
            for (u, weight) in gauss(at, next) {
                let share = self.share(u);
                let mut rates = self.rates(share);
                if gusty {
                    let gone: f64 = gauss(at, u).map(|(v, weight)| weight * self.rates(self.share(v)).swings).sum();
                    let swings = before + seconds * gone;
                    let turn = |&(omega, phase): &(f64, f64)| DVec2::from_angle((omega * swings + phase) % TAU);
                    let gust = turns[usize::from(share >= 0.5)].iter().map(turn).sum::<DVec2>() / f64::from(TURNS);
                    let [a, b] = self.skies.map(|sky| f64::from(sky.wander.wind));
                    rates = rates.blown(DVec2::X + (a + share * (b - a)) * gust);
                }
                sum = sum.plus(&rates, seconds * weight);
            }
            at = next;
        }
        sum.swings -= swings;
        Ok(sum)
    }

    /// Where a piece ends that begins at a share of the time: a quarter of the way, a quarter of the wander's period (its
    /// fastest turn then goes 140 degrees), and so short that the period changes by a quarter. None goes over the middle, where
    /// what has nothing between switches.
    fn piece(&self, at: f64, gusty: bool) -> f64 {
        let [from, to] = self.skies.map(|sky| f64::from(sky.wander.period));
        let period = from + self.share(at) * (to - from);
        let seconds = if gusty { self.span[1] - self.span[0] } else { 0.0 };
        // A smooth way is up to half as steep again as a straight one.
        let length = [0.25 * period / seconds, period / (6.0 * (to - from).abs())].into_iter().fold(0.25, f64::min);
        let next = at + length;
        if at < 0.5 { next.min(0.5) } else { next }
    }

    /// How much of the second sky there is at a share of the time.
    fn share(&self, u: f64) -> f64 {
        if self.smooth { u * u * (3.0 - 2.0 * u) } else { u }
    }

    /// Velocities, and what else goes by a second, where there is so much of the second sky; without gusts.
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
            swings: 1.0 / line(&|sky| sky.wander.period),
        }
    }
}

/// What has carried the sky of an animation whose winds change from shot to shot.
#[derive(Default)]
pub(crate) struct Going {
    /// The sky that was asked for last, its time, and what it lacked.
    last: Option<(Params, f64, Advection)>,
}

/// Longest time between two shots in which a sky goes on, s; as for the rest of the history.
const LONGEST_SHOT: f64 = 300.0;

impl Going {
    /// The sky that a shot shows: where its winds are not those of the shot before, it goes on from where it is. The winds change
    /// half way between the two, which is what the integral of an even change is. Shots that say their drift themselves
    /// (`Keyframes`, `Params::after`) need nothing; nor does what comes after a cut.
    pub fn on(&mut self, params: &Params, time: f64, cut: bool) -> Params {
        let last = self.last.take().filter(|(_, then, _)| !cut && (time - then).abs() <= LONGEST_SHOT);
        let mut lacked = last.as_ref().map_or_else(Advection::default, |(.., lacked)| *lacked);
        let with = |params: &Params, lacked: &Advection| {
            let drift = Drift::from(&Advection::from(&params.drift).plus(lacked, 1.0));
            Params { drift, ..params.clone() }
        };
        if let Some((before, then, _)) = &last
            && before.drift == params.drift
            && !params.has_winds_of(before)
        {
            let drift = params.after(&with(before, &lacked), 0.5 * (time + then));
            lacked = Advection::from(&drift).plus(&Advection::from(&params.drift), -1.0);
        }
        let mut now = with(params, &lacked);
        let allowed =
            |(index, field): (usize, &crate::schema::Field)| field.check("drift", &now.drift.get(index)).is_ok();
        if !Drift::FIELDS.iter().enumerate().all(allowed) {
            // After a time that is beyond all sense.
            (now, lacked) = (params.clone(), Advection::default());
        }
        self.last = Some((params.clone(), time, lacked));
        now
    }
}

/// The largest speed at which anything that casts a shadow may move, m/s.
pub(crate) fn fastest(params: &Params) -> f64 {
    let wind = &params.wind;
    let upper = if params.has_upper_clouds() { params.upper_clouds.speed.abs() } else { 0.0 };
    let level = wind.speed.abs().max(wind.weather_speed.abs()).max(upper) * (1.0 + params.wander.wind);
    f64::from(level.max(wind.updraft.abs()))
}

/// Three 32-bit hashes of three (pcg3d: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020).
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
        let Advection { shape, detail, weather, high, .. } = Advection::new(params, from, to);
        [shape, detail, weather, high]
    }

    fn means(params: &Params) -> [DVec2; 4] {
        let (wind, high) = (&params.wind, &params.high_clouds);
        [
            (wind.direction, wind.speed),
            (wind.detail_direction, wind.detail_speed),
            (wind.weather_direction, wind.weather_speed),
            // In the frame of its own direction.
            (90.0, high.speed),
        ]
        .map(|(direction, speed)| compass(f64::from(direction)) * f64::from(speed))
    }

    /// The velocity in place of its integral: the mean of turning vectors, as complex numbers.
    fn gust(wander: &Wander, time: f64) -> DVec2 {
        let turn = |(omega, phase): (f64, f64)| DVec2::from_angle(omega * time + phase);
        wander.turns(Of::Wind, 0.0).map(turn).sum::<DVec2>() / f64::from(TURNS)
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
            assert!(Advection::new(&params, time, time).drift() == DVec3::ZERO);
            assert!((0.0..=1.0).contains(&params.at(time).clouds.coverage));
        }
    }
}
