// How sunlight and skylight become the brightness of a cloud: the published models, each as its source gives it.
#import math
#import phase
#import shell
#import density

// Six directions spread over the unit sphere for the cone of light samples (nubis2015's noise kernel).
const CONE = array<vec3f, 6>(
    vec3f(0.38051305, 0.92453449, -0.02111345),
    vec3f(-0.50625799, -0.03590792, -0.86163418),
    vec3f(-0.32509218, -0.94557439, 0.01428793),
    vec3f(0.09026238, -0.27376545, 0.95755165),
    vec3f(0.28128598, 0.42443639, -0.86065785),
    vec3f(-0.16852403, 0.14748697, 0.97460106),
);

// Optical depth from a point toward the sun. Near samples are spaced by squares, each standing for the stretch around
// it; the far one, at three times their reach (nubis2015), stands for the stretch from one to five times.
fn optical_depth_to_sun(p: vec3f, opacity: f32, width: f32) -> f32 {
    let n = quality.light_steps;
    let reach = quality.light_distance;
    let cone = select(params.light.cone, 0.0, params.light.model == MODEL_SINGLE);
    var depth = 0.0;
    // Behind little cloud the near samples see the detail; the others are cheap.
    let full = select(0u, n, opacity < quality.cheap_light);
    for (var i = 0u; i < full; i++) {
        let at = light_sample(p, i, n, reach, cone, width);
        depth += cloud_density_at(at.p, at.altitude, at.width) * at.length;
    }
    for (var i = full; i < n + quality.far_sample; i++) {
        let at = light_sample(p, i, n, reach, cone, width);
        depth += cloud_density_cheap(at.p, at.altitude, at.width) * at.length;
    }
    return depth * params.clouds.extinction;
}

struct LightSample {
    p: vec3f,
    altitude: f32,
    length: f32, // of the stretch it stands for
    width: f32,
}

fn light_sample(p: vec3f, i: u32, n: u32, reach: f32, cone: f32, width: f32) -> LightSample {
    let a = f32(i) / f32(n);
    let b = f32(i + 1u) / f32(n);
    let is_far = i == n;
    let length = select((b * b - a * a) * reach, 4.0 * reach, is_far);
    let s = select(0.5 * (b * b + a * a) * reach, 3.0 * reach, is_far);
    let at = p + s * (frame.sun_direction + cone * CONE[i % 6u]);
    return LightSample(at, altitude_at(at), length, max(width, 0.5 * length));
}

// The phase function of the light model: Henyey-Greenstein, or two lobes of it.
fn model_phase(one_minus_mu: f32) -> f32 {
    let forward = henyey_greenstein(one_minus_mu, params.light.g);
    let backward = henyey_greenstein(one_minus_mu, params.light.g_back);
    switch params.light.model {
        case MODEL_THESIS2018: {
            return max(forward, backward);
        }
        case MODEL_VSU2022: {
            return mix(backward, forward, params.light.lobe_mix);
        }
        default: {
            return forward;
        }
    }
}

// What the model makes of sunlight that has crossed the optical depth `depth`, without the phase function.
fn sun_energy(depth: f32, precipitation: f32) -> f32 {
    if params.light.model == MODEL_SINGLE {
        return params.light.albedo * exp(-depth);
    }
    // Artistic models see a thinner cloud, and a thicker one where it rains (nubis2015's p).
    let d = depth * params.light.absorption * mix(1.0, params.light.rain_absorption, precipitation);
    let powder = 1.0 - params.light.powder * exp(-2.0 * d);
    var beer = exp(-d);
    if params.light.model == MODEL_THESIS2018 {
        beer = max(beer, 0.7 * exp(-0.5 * d));
    }
    return 2.0 * params.light.sun_gain * beer * powder;
}

// Share of the ambient light at a height that comes from above; the rest comes from below.
fn ambient_share(height: f32) -> f32 {
    return saturate(height);
}

fn has_ambient() -> f32 {
    return select(params.light.ambient_gain, 0.0, params.light.model == MODEL_SINGLE);
}
