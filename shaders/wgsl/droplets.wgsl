// The phase function of real droplets: a fit of two lobes, and Mie's own as a table.
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

// Jendersie and d'Eon 2023: Henyey and Greenstein's forward peak and Draine's body. With a `peak` less than 1, each lobe is
// as much less one-sided: at 0, all directions are alike.
fn droplet_fit(one_minus_mu: f32, peak: f32) -> f32 {
    let d = frame.sky.droplet;
    let forward = henyey_greenstein(one_minus_mu, peak * d.x);
    return mix(forward, draine(one_minus_mu, peak * d.y, peak * d.z), d.w);
}

// The table is loaded, not filtered: in half floats a forward peak would lose its digits, and its integral all of them.
fn phase_entry(i: u32) -> vec2f {
    return textureLoad(phase_table, vec2u(i, 0u), 0).rg;
}

// The angle of entry `s` of 0 to 1 is pi sin^2(s pi / 2): entries are dense at both ends, where peak and glory are.
fn mie_phase(one_minus_mu: f32) -> f32 {
    let last = textureDimensions(phase_table).x - 1u;
    // atan2 keeps the digits of small angles, which acos(1 - one_minus_mu) has lost.
    let angle = 2.0 * atan2(sqrt(one_minus_mu), sqrt(max(2.0 - one_minus_mu, 0.0)));
    let share = saturate(angle / PI);
    let x = 2.0 / PI * atan2(sqrt(share), sqrt(1.0 - share)) * f32(last);
    let i = min(u32(x), last - 1u);
    return mix(phase_entry(i).x, phase_entry(i + 1u).x, saturate(x - f32(i)));
}

// 1 minus the cosine at an entry.
fn phase_entry_cosine(i: u32) -> f32 {
    let s = sin(0.5 * PI * f32(i) / f32(textureDimensions(phase_table).x - 1u));
    let half = sin(0.5 * PI * s * s);
    return 2.0 * half * half;
}

// 1 minus the cosine of a scattering by `droplet_phase` for random numbers, of which the second is free for the angle
// around, and what its light is to be multiplied with.
fn droplet_sample(u: vec2f) -> vec2f {
    if PHASE == PHASE_MIE {
        return mie_sample(u.x);
    }
    return vec2f(droplet_fit_sample(u), 1.0);
}

// One lobe or the other. Draine's is Henyey and Greenstein's times 1 + alpha mu^2, so that at least a third of those trials
// is accepted; 1e-9 of the samples find none and take the last.
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

// 1 minus the cosine of a scattering by the table for a random number, evenly between two entries, and the share of the
// function in what that makes of it.
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
