//! Mie scattering by cloud droplets (Bohren and Huffman 1983, chapter 4): the phase function for human vision, averaged
//! over a distribution of sizes and over wavelengths, which smooths the ripples of a single sphere.

use std::f64::consts::PI;
use std::thread;

/// Version of the computation, part of the key of the disk cache. Increment it with each change.
pub(crate) const VERSION: u32 = 1;

/// Effective variance of the droplet sizes (Hansen and Travis 1974): narrow, as where glories are observed (Mayer et
/// al. 2004).
const VARIANCE: f64 = 0.05;
/// Number of sampled sizes per wavelength times the effective diameter in µm. Each wavelength has other sizes. Small
/// spheres need more samples, as neighbouring sizes differ more, and each takes less time.
const SIZES: f64 = 3200.0;
/// Range of the sampled radii as fractions of the effective radius. Droplets outside it scatter less than 1e-4 of the
/// light.
const SMALLEST: f64 = 0.2;
const LARGEST: f64 = 2.4;
/// Wavelengths in µm and their luminous efficiency (CIE 1924 photopic).
const WAVELENGTHS: [(f64, f64); 5] = [(0.47, 0.091), (0.51, 0.503), (0.55, 0.995), (0.59, 0.757), (0.63, 0.265)];

/// Refractive index of water at 20 °C at a wavelength in µm (Daimon and Masumura 2007). Water does not absorb visible
/// light.
fn water(wavelength: f64) -> f64 {
    const TERMS: [(f64, f64); 4] = [
        (5.684_027_565e-1, 5.101_829_712e-3),
        (1.726_177_391e-1, 1.821_153_936e-2),
        (2.086_189_578e-2, 2.620_722_293e-2),
        (1.130_748_688e-1, 1.069_792_721e1),
    ];
    let square = wavelength * wavelength;
    (1.0 + TERMS.iter().map(|(a, pole)| a * square / (square - pole)).sum::<f64>()).sqrt()
}

/// Mie coefficients a_n and b_n, n from 1, as real and imaginary parts, of a sphere of size parameter `x` and real
/// refractive index `m`.
fn coefficients(x: f64, m: f64) -> Vec<[f64; 4]> {
    let count = (x + 4.05 * x.cbrt() + 2.0) as usize; // number of terms (Wiscombe 1980)
    let mx = m * x;
    // Logarithmic derivative of psi inside the sphere by downward recurrence: upward recurrence loses precision.
    let mut inside = vec![0.0; count + 1];
    let mut d = 0.0;
    for n in (1..=count.max(mx as usize) + 16).rev() {
        let ratio = n as f64 / mx;
        if n <= count {
            inside[n] = d;
        }
        d = ratio - 1.0 / (d + ratio);
    }
    let (mut psi, mut chi) = ([x.cos(), x.sin()], [-x.sin(), x.cos()]);
    (1..=count)
        .map(|n| {
            let order = n as f64;
            psi = [psi[1], (2.0 * order - 1.0) / x * psi[1] - psi[0]];
            chi = [chi[1], (2.0 * order - 1.0) / x * chi[1] - chi[0]];
            let coefficient = |factor: f64| {
                // The coefficient is p / (p - i q), with xi = psi - i chi.
                let p = factor * psi[1] - psi[0];
                let q = factor * chi[1] - chi[0];
                let norm = p * p + q * q;
                [p * p / norm, p * q / norm]
            };
            let a = coefficient(inside[n] / m + order / x);
            let b = coefficient(inside[n] * m + order / x);
            [a[0], a[1], b[0], b[1]]
        })
        .collect()
}

/// Intensity scattered by spheres at angles in radians, in arbitrary units. Each sphere is a size parameter, a
/// refractive index and a weight.
fn intensity(spheres: &[(f64, f64, f64)], angles: &[f64]) -> Vec<f64> {
    let mu: Vec<_> = angles.iter().map(|angle| angle.cos()).collect();
    let count = mu.len();
    let mut sum = vec![0.0; count];
    for &(x, m, weight) in spheres {
        // Real and imaginary parts of S1 and S2; pi_n and its predecessor.
        let [mut s1, mut s1i, mut s2, mut s2i, mut before] =
            [const { Vec::new() }; 5].map(|_: Vec<f64>| vec![0.0; count]);
        let mut pi = vec![1.0; count];
        for (index, [a, ai, b, bi]) in coefficients(x, m).into_iter().enumerate() {
            let n = (index + 1) as f64;
            let scale = (2.0 * n + 1.0) / (n * (n + 1.0));
            let [a, ai, b, bi] = [a, ai, b, bi].map(|v| scale * v);
            let (next, last) = ((2.0 * n + 1.0) / n, (n + 1.0) / n);
            for i in 0..count {
                let tau = n * mu[i] * pi[i] - (n + 1.0) * before[i];
                s1[i] += a * pi[i] + b * tau;
                s1i[i] += ai * pi[i] + bi * tau;
                s2[i] += a * tau + b * pi[i];
                s2i[i] += ai * tau + bi * pi[i];
                let after = next * mu[i] * pi[i] - last * before[i];
                before[i] = pi[i];
                pi[i] = after;
            }
        }
        for i in 0..count {
            sum[i] += weight * (s1[i] * s1[i] + s1i[i] * s1i[i] + s2[i] * s2[i] + s2i[i] * s2i[i]);
        }
    }
    sum
}

/// Phase function of droplets of an effective diameter in µm at angles in radians, in arbitrary units.
pub(crate) fn phase(diameter: f64, angles: &[f64]) -> Vec<f64> {
    let effective = 0.5 * diameter;
    let sizes = (SIZES / diameter) as usize;
    let mut spheres = Vec::new();
    for (colour, (wavelength, seen)) in WAVELENGTHS.into_iter().enumerate() {
        for i in 0..sizes {
            let offset = (colour as f64 + 0.5) / WAVELENGTHS.len() as f64;
            let share = SMALLEST + (LARGEST - SMALLEST) * (i as f64 + offset) / sizes as f64;
            // Gamma distribution (Hansen 1971), divided by its value at the effective radius.
            let droplets = (((1.0 - 3.0 * VARIANCE) * share.ln() + 1.0 - share) / VARIANCE).exp();
            // Intensities are in units of the squared wave number.
            let weight = droplets * seen * wavelength * wavelength;
            spheres.push((2.0 * PI * share * effective / wavelength, water(wavelength), weight));
        }
    }
    // Few angles per thread, so that its working set fits its cache.
    let threads = thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let chunk = angles.len().div_ceil(threads).clamp(1, 256);
    let chunks: Vec<_> = angles.chunks(chunk).collect();
    let spheres = &spheres;
    let mut parts = Vec::new();
    for group in chunks.chunks(threads) {
        parts.extend(thread::scope(|scope| {
            let workers: Vec<_> = group.iter().map(|angles| scope.spawn(move || intensity(spheres, angles))).collect();
            workers.into_iter().flat_map(|worker| worker.join().expect("a sum")).collect::<Vec<_>>()
        }));
    }
    parts
}
