//! Moments of phase functions, and the split of scattering into light that keeps going and light that turns.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::{Arc, Mutex, OnceLock};

use crate::gpu::disk_cache as cache;
use crate::mie;
use crate::params::{Light, Phase};
use crate::shared::constants;

/// Number of angles of the Mie phase function: pi sin^2 of equal steps, dense at the forward peak and at the glory, 0.14
/// degrees apart in the middle.
pub(crate) const ENTRIES: usize = 2048;

/// Angles of tables of phase functions, radians: dense at both ends.
fn angles(count: usize) -> Vec<f64> {
    (0..count).map(|i| PI * (0.5 * PI * i as f64 / (count - 1) as f64).sin().powi(2)).collect()
}

/// Phase function by angle in 1/sr, and its integral from the forward direction.
type PhaseTable = Arc<Vec<[f32; 2]>>;

/// Mie phase function of a droplet diameter in µm by angle, in 1/sr, with its integral from the forward direction. Kept
/// on disk, as the largest droplets take a second, and in memory.
pub(crate) fn mie_table(diameter: f32) -> PhaseTable {
    static TABLES: OnceLock<Mutex<HashMap<u32, PhaseTable>>> = OnceLock::new();
    let mut tables = TABLES.get_or_init(Mutex::default).lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let key = format!("{diameter} {ENTRIES} {}", mie::VERSION);
    let load = || {
        if let Some(stored) = cache::load("phase", &key).filter(|stored| stored.len() == 8 * ENTRIES) {
            return bytemuck::pod_collect_to_vec(&stored);
        }
        let table = table_of(f64::from(diameter));
        cache::store("phase", &key, &[bytemuck::cast_slice(&table)]);
        table
    };
    tables.entry(diameter.to_bits()).or_insert_with(|| Arc::new(load())).clone()
}

fn table_of(diameter: f64) -> Vec<[f32; 2]> {
    let angles = angles(ENTRIES);
    let phase = mie::phase(diameter, &angles);
    // Trapezoidal rule over 1 - cos: exact for linear interpolation between entries.
    let cosine: Vec<_> = angles.iter().map(|angle| 2.0 * (0.5 * angle).sin().powi(2)).collect();
    let mut integral = vec![0.0];
    for i in 1..ENTRIES {
        let mean = 0.5 * (phase[i - 1] + phase[i]);
        integral.push(integral[i - 1] + 2.0 * PI * mean * (cosine[i] - cosine[i - 1]));
    }
    let whole = integral[ENTRIES - 1];
    (0..ENTRIES).map(|i| [(phase[i] / whole) as f32, (integral[i] / whole) as f32]).collect()
}

/// Fit to the phase function of droplets of 5 to 50 µm diameter: g of the Henyey-Greenstein lobe, g and alpha of the
/// Draine lobe, weight of the Draine lobe (Jendersie and d'Eon 2023, equations 4 to 7).
pub(crate) fn droplet(diameter: f64) -> [f64; 4] {
    [
        (-0.099_056_7 / (diameter - 1.671_54)).exp(),
        (-2.206_79 / (diameter + 3.910_29) - 0.428_934).exp(),
        (3.624_89 - 8.292_88 / (diameter + 5.528_25)).exp(),
        (-0.599_085 / (diameter - 0.641_583) - 0.665_888).exp(),
    ]
}

/// Largest number of moments: those of droplets of 50 µm, whose diffraction peak is 0.6 degrees wide.
const MOST_MOMENTS: usize = 1200;
/// Moment below which the rest of the series is dropped.
const LEAST_MOMENT: f64 = 1e-4;

/// Legendre moments of a phase function, the means of P_l(cos), from l = 0 on. At least three.
pub(crate) fn moments(light: &Light) -> Vec<f64> {
    let henyey_greenstein = |g: f64| move |l: i32| g.powi(l);
    let series = |moment: &dyn Fn(i32) -> f64| -> Vec<f64> {
        (0..MOST_MOMENTS).map(|l| moment(l as i32)).take_while(|p| p.abs() > LEAST_MOMENT).collect()
    };
    let mut moments = match light.phase {
        Phase::HenyeyGreenstein => series(&henyey_greenstein(f64::from(light.g))),
        Phase::Droplet => {
            let [g, body, alpha, weight] = droplet(f64::from(light.droplet_diameter));
            let peak = henyey_greenstein(g);
            let angles = angles(4 * ENTRIES);
            let draine: Vec<_> = angles.iter().map(|angle| draine(angle.cos(), body, alpha)).collect();
            let body = integrated(&angles, &draine);
            let part = |l: i32| body.get(l as usize).copied().unwrap_or(0.0);
            series(&|l| (1.0 - weight) * peak(l) + weight * part(l))
        }
        Phase::Mie => {
            let phase: Vec<_> = mie_table(light.droplet_diameter).iter().map(|v| f64::from(v[0])).collect();
            integrated(&angles(ENTRIES), &phase)
        }
    };
    moments.resize(moments.len().max(3), 0.0);
    moments
}

/// Draine's phase function (Draine 2003), 1/sr.
fn draine(mu: f64, g: f64, alpha: f64) -> f64 {
    let lobe = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * mu).powf(1.5));
    lobe * (1.0 + alpha * mu * mu) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)
}

/// Moments of a phase function given by angle, normalised.
fn integrated(angles: &[f64], phase: &[f64]) -> Vec<f64> {
    let cosine: Vec<_> = angles.iter().map(|angle| angle.cos()).collect();
    let drop: Vec<_> = angles.iter().map(|angle| 2.0 * (0.5 * angle).sin().powi(2)).collect();
    // Trapezoidal weights over 1 - cos.
    let last = angles.len() - 1;
    let weight = |i: usize| 0.5 * (drop[(i + 1).min(last)] - drop[i.saturating_sub(1)]);
    let weighted: Vec<_> = (0..=last).map(|i| phase[i] * weight(i)).collect();
    let whole: f64 = weighted.iter().sum();
    // Legendre polynomials by their recurrence, for all angles at once.
    let (mut before, mut now) = (vec![0.0; angles.len()], vec![1.0; angles.len()]);
    let mut moments = Vec::new();
    for l in 0..MOST_MOMENTS {
        let moment = weighted.iter().zip(&now).map(|(w, p)| w * p).sum::<f64>() / whole;
        if moment.abs() < LEAST_MOMENT {
            break;
        }
        moments.push(moment);
        let n = l as f64;
        for i in 0..angles.len() {
            let next = ((2.0 * n + 1.0) * cosine[i] * now[i] - n * before[i]) / (n + 1.0);
            (before[i], now[i]) = (now[i], next);
        }
    }
    moments
}

/// Split of a phase function: light that keeps going, with the moments of a forward peak of weight `forward`, and light
/// that turns, which is smooth (delta scaling; Joseph, Wiscombe and Weinman 1976 with the second moment).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Split {
    /// Fraction of the scattered light that keeps going: the second moment.
    pub forward: f64,
    /// Mean cosine of the whole phase function.
    pub mean_cosine: f64,
    /// Extinction of the light that has turned, relative to the extinction.
    pub scale: f64,
    /// Albedo with respect to the scaled extinction.
    pub albedo: f64,
    /// Mean cosine of the light that turns.
    pub turned_cosine: f64,
}

impl Split {
    /// Split of the phase function of a sky.
    pub fn new(light: &Light) -> Self {
        let moments = moments(light);
        let (mean_cosine, albedo) = (moments[1], f64::from(light.albedo));
        // Light that scatters backwards does not keep going.
        let forward = if mean_cosine > 0.0 { moments[2].max(0.0) } else { 0.0 };
        let scale = 1.0 - albedo * forward;
        Self {
            forward,
            mean_cosine,
            scale,
            albedo: albedo * (1.0 - forward) / scale,
            // Light that scatters backwards turns evenly: with a negative mean cosine the sweeps diverge.
            turned_cosine: ((mean_cosine - forward) / (1.0 - forward)).max(0.0),
        }
    }
}

constants! {
    /// Optical depth at the end of the table of forward chains (`forward_table`).
    const FORWARD_DEPTH: f64 = 60.0;
}

/// Size of the table: angles by optical depths.
pub(crate) const FORWARD_SIZE: [usize; 2] = [128, 64];

/// Radiance per irradiance and optical depth along the view ray, by scattering angle and by optical depth along sun and
/// view ray together, of light that has been scattered at least twice and kept going each time: the sum over all orders,
/// evenly distributed over their collisions. Rows are depths, at squares of equal steps; columns are angles, too.
pub(crate) fn forward_table(light: &Light) -> Vec<f32> {
    let [columns, rows] = FORWARD_SIZE;
    let (moments, split) = (moments(light), Split::new(light));
    let albedo = f64::from(light.albedo);
    let square = |i: usize, count: usize| (i as f64 / (count - 1) as f64).powi(2);
    let cosine: Vec<_> = (0..columns).map(|i| (PI * square(i, columns)).cos()).collect();
    let mut table = vec![0.0; columns * rows];
    let (mut before, mut now) = (vec![0.0; columns], vec![1.0; columns]);
    // A series that is cut off tapers off: otherwise it rings around the sun.
    let cut = moments.len() == MOST_MOMENTS;
    for (l, moment) in moments.iter().enumerate() {
        let n = l as f64;
        let taper = if cut { (1.0 - (n / MOST_MOMENTS as f64).powi(2)).powi(2) } else { 1.0 };
        let keeps = if l < 2 { split.forward } else { *moment };
        for row in 0..rows {
            let depth = FORWARD_DEPTH * square(row, rows);
            let x = albedo * keeps * depth;
            // (exp(x) - 1) / x - 1, times exp(-depth).
            let chains = if x.abs() < 1e-4 {
                (-depth).exp() * (0.5 * x + x * x / 6.0)
            } else {
                ((x - depth).exp() - (-depth).exp()) / x - (-depth).exp()
            };
            let weight = taper * (2.0 * n + 1.0) / (4.0 * PI) * keeps * chains;
            for (column, polynomial) in now.iter().enumerate() {
                table[row * columns + column] += weight * polynomial;
            }
        }
        for i in 0..columns {
            let next = ((2.0 * n + 1.0) * cosine[i] * now[i] - n * before[i]) / (n + 1.0);
            (before[i], now[i]) = (now[i], next);
        }
    }
    table.into_iter().map(|v| v as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(phase: Phase) -> Light {
        Light { phase, ..Light::default() }
    }

    #[test]
    fn moments_of_the_droplet_fit_are_those_of_its_lobes() {
        let moments = moments(&light(Phase::Droplet));
        assert!((moments[0] - 1.0).abs() < 1e-6);
        let [g, body, alpha, weight] = droplet(f64::from(Light::default().droplet_diameter));
        // Mean cosine of Draine's function in closed form.
        let mean =
            body * (1.0 + alpha * (3.0 + 2.0 * body * body) / 5.0) / (1.0 + alpha * (1.0 + 2.0 * body * body) / 3.0);
        assert!((moments[1] - ((1.0 - weight) * g + weight * mean)).abs() < 1e-4, "{}", moments[1]);
    }

    #[test]
    fn mie_droplets_scatter_forward() {
        let moments = moments(&light(Phase::Mie));
        assert!((moments[0] - 1.0).abs() < 1e-9);
        assert!((0.83..0.89).contains(&moments[1]), "{}", moments[1]);
    }

    /// The integral over the sphere of all chains is that of forward scattering alone, whose moment of order 0 is known.
    #[test]
    fn forward_chains_hold_the_energy_of_their_orders() {
        let light = Light { g: 0.7, albedo: 0.9, ..light(Phase::HenyeyGreenstein) };
        let table = forward_table(&light);
        let [columns, rows] = FORWARD_SIZE;
        let row = rows / 4;
        let depth = FORWARD_DEPTH * (row as f64 / (rows - 1) as f64).powi(2);
        let angle = |i: usize| PI * (i as f64 / (columns - 1) as f64).powi(2);
        let sum: f64 = (1..columns)
            .map(|i| {
                let mean = 0.5 * f64::from(table[row * columns + i - 1] + table[row * columns + i]);
                2.0 * PI * mean * (angle(i - 1).cos() - angle(i).cos())
            })
            .sum();
        let x: f64 = 0.9 * 0.49 * depth;
        let expected = 0.49 * (-depth).exp() * (((x.exp() - 1.0) / x) - 1.0);
        assert!((sum / expected - 1.0).abs() < 5e-3, "{sum} {expected}");
    }
}
