// Phase function of cloud droplets: a two-lobe fit, and a table of Mie scattering.
#import bindings
#import math
#import phase
#import random

fn droplet_phase(one_minus_mu: f32) -> f32 {
    if PHASE == PHASE_MIE {
        return mie_phase(one_minus_mu);
    }
    return droplet_fit(one_minus_mu, 1.0);
}

// Fit of Jendersie and d'Eon 2023: a forward peak of Henyey and Greenstein and a body of Draine. A `peak` below 1
// reduces the anisotropy of both lobes; at 0 scattering is isotropic.
fn droplet_fit(one_minus_mu: f32, peak: f32) -> f32 {
    let d = frame.sky.droplet;
    let forward = henyey_greenstein(one_minus_mu, peak * d.x);
    return mix(forward, draine(one_minus_mu, peak * d.y, peak * d.z), d.w);
}

// The table is f32 and loaded, not filtered: half floats lose the digits of a forward peak, and all digits of its
// integral.
fn phase_entry(i: u32) -> vec2f {
    return textureLoad(phase_table, vec2u(i, 0u), 0).rg;
}

// Angle of entry `s` in [0, 1]: pi sin^2(s pi / 2). Entries are dense at both ends, at forward peak and glory.
fn mie_phase(one_minus_mu: f32) -> f32 {
    let last = textureDimensions(phase_table).x - 1u;
    // atan2 keeps the digits of small angles; acos(1 - one_minus_mu) has lost them.
    let angle = 2.0 * atan2(sqrt(one_minus_mu), sqrt(max(2.0 - one_minus_mu, 0.0)));
    let share = saturate(angle / PI);
    let x = 2.0 / PI * atan2(sqrt(share), sqrt(1.0 - share)) * f32(last);
    let i = min(u32(x), last - 1u);
    return mix(phase_entry(i).x, phase_entry(i + 1u).x, saturate(x - f32(i)));
}

// 1 minus the cosine of the scattering angle of an entry.
fn phase_entry_cosine(i: u32) -> f32 {
    let s = sin(0.5 * PI * f32(i) / f32(textureDimensions(phase_table).x - 1u));
    let half = sin(0.5 * PI * s * s);
    return 2.0 * half * half;
}

// Sample of `droplet_phase`: 1 minus the cosine of the scattering angle, and the weight of the sample. The second
// random number stays free for the azimuth.
fn droplet_sample(u: vec2f) -> vec2f {
    if PHASE == PHASE_MIE {
        return mie_sample(u.x);
    }
    return vec2f(droplet_fit_sample(u), 1.0);
}

// Rejection sampling of the two lobes. Draine's function is Henyey and Greenstein's times 1 + alpha mu^2, so that at
// least a third of the trials is accepted. 1e-9 of the samples reject all trials and take the last.
fn droplet_fit_sample(u: vec2f) -> f32 {
    const MOST_TRIALS = 50u;
    let seed = bitcast<vec2u>(u);
    let lobe = random3(vec3u(seed, 0u), 1u).x < frame.sky.droplet.w;
    let g = select(frame.sky.droplet.x, frame.sky.droplet.y, lobe);
    let alpha = select(0.0, frame.sky.droplet.z, lobe);
    var i = 0u;
    var one_minus_mu = 0.0;
    loop {
        i += 1u;
        let trial = random3(vec3u(seed, i), 1u);
        one_minus_mu = scattered_cosine(g, trial.x);
        let mu = 1.0 - one_minus_mu;
        if trial.y * (1.0 + alpha) < 1.0 + alpha * mu * mu || i >= MOST_TRIALS {
            break;
        }
    }
    return one_minus_mu;
}

// Sample of the table, uniform in mu between two entries: 1 minus the cosine of the scattering angle, and the ratio of
// the phase function to the probability density of the sample.
fn mie_sample(u: f32) -> vec2f {
    var low = 0u;
    var high = textureDimensions(phase_table).x - 1u;
    loop {
        let middle = (low + high) / 2u;
        if phase_entry(middle).y <= u {
            low = middle;
        } else {
            high = middle;
        }
        if high - low <= 1u {
            break;
        }
    }
    let a = phase_entry_cosine(low);
    let b = phase_entry_cosine(high);
    let before = phase_entry(low).y;
    let held = max(phase_entry(high).y - before, 1e-12);
    let one_minus_mu = mix(a, b, saturate((u - before) / held));
    return vec2f(one_minus_mu, mie_phase(one_minus_mu) * 2.0 * PI * (b - a) / held);
}
