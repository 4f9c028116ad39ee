// Radiance that clouds scatter toward the eye from sunlight and skylight. `light_model` stands for the file of the
// light model in light_models/, which has `lobe_phase`, `seen_scattering`, `slowest_extinction` and `AMBIENT`, and the
// functions of marched_light.wgsl, or imports them.
#import math
#import phase
#import droplets
#import light_model
#import shell
#import density
#import ambient
#import aerial
#import camera

// Six directions in the unit sphere for the cone of light samples (nubis2015's noise kernel).
const CONE = array<vec3f, 6>(
    vec3f(0.38051305, 0.92453449, -0.02111345),
    vec3f(-0.50625799, -0.03590792, -0.86163418),
    vec3f(-0.32509218, -0.94557439, 0.01428793),
    vec3f(0.09026238, -0.27376545, 0.95755165),
    vec3f(0.28128598, 0.42443639, -0.86065785),
    vec3f(-0.16852403, 0.14748697, 0.97460106),
);

// Optical depth from a point toward the sun. Each sample represents a segment around it; segments grow with distance.
// The far sample lies at three times the reach of the others (nubis2015) and represents the range from one to five
// times the reach.
fn optical_depth_to_sun(p: vec3f, opacity: f32, width: f32) -> f32 {
    let samples = light_samples(p);
    let n = samples.count;
    var depth = 0.0;
    // Cheap samples leave out the detail. Behind much cloud all samples are cheap. So are samples whose segment covers
    // most of a tile of the detail, over which the detail averages out.
    let fine = detailed_samples(samples);
    let full = select(0u, fine, opacity < params.quality.light_detail_cutoff);
    // The test at the end of the loop: lavapipe runs a loop that is tested at its start once more for nothing.
    var i = 0u;
    if LIGHT_DETAIL && full > 0u {
        loop {
            let at = light_sample(samples, p, i, width);
            depth += cloud_density_at(at.p, at.altitude, at.width) * at.length;
            i += 1u;
            if i >= full {
                break;
            }
        }
    }
    if LIGHT_CHEAP && i < n + params.quality.far_sample {
        loop {
            let at = light_sample(samples, p, i, width);
            depth += cloud_density_cheap(at.p, at.altitude) * at.length;
            i += 1u;
            if i >= n + params.quality.far_sample {
                break;
            }
        }
    }
    depth *= frame.sky.extinction;
    return depth;
}

// Placement of the light samples. With a given reach, segment k of n starts at (k / n)^2 of it. Without one, samples
// reach to the end of the clouds, in equal steps of log(1 + distance / NEAR).
struct LightSamples {
    reach: f32,
    rate: f32, // logarithm per sample; 0 for quadratic placement
    near: u32, // number of samples so placed; the others lie evenly in the upper deck
    above: vec2f, // start and end of the upper deck, m
    count: u32, // number of all samples but the far one
}

// Scale of the logarithmic placement, m: sunlight is extinguished within the first tens of metres or crosses
// kilometres.
const NEAR = 150.0;

fn light_samples(p: vec3f) -> LightSamples {
    let n = params.quality.light_steps;
    if params.quality.light_distance > 0.0 {
        return LightSamples(params.quality.light_distance, 0.0, n, vec2f(0.0), n);
    }
    let s = cloud_stretches_from(p, frame.sky.sun_direction);
    var reach = s.start + s.first + s.gap + s.second;
    var count = n;
    var above = vec2f(0.0);
    if UPPER && altitude_at(p) < frame.sky.lower_top {
        // A third more samples for the upper deck: of the logarithmic ones, whose segments there are as long as they
        // are far, one or none falls into it. The error of `draft` in `two_decks` is 26 % without the additional
        // samples and 14 % with them. Additional samples, unlike a share of the given number, leave the placement of
        // the others independent of the presence of an upper deck.
        count = n + (n + 2u) / 3u;
        let begin = hit_sphere_from(p, frame.sky.sun_direction, max(params.upper_clouds.base, frame.sky.lower_top)).far;
        above = vec2f(min(begin, reach), reach);
        reach = min(hit_sphere_from(p, frame.sky.sun_direction, frame.sky.lower_top).far, reach);
    }
    return LightSamples(reach, log2(1.0 + reach / NEAR) / f32(n), n, above, count);
}

// Number of samples, from the first on, whose segment is shorter than most of a tile of the detail.
fn detailed_samples(samples: LightSamples) -> u32 {
    let most = 0.875 * params.clouds.detail_scale;
    if samples.rate <= 0.0 {
        return samples.near;
    }
    let first = NEAR * (exp2(samples.rate) - 1.0);
    let near = u32(clamp(ceil(log2(max(most / first, 1.0)) / samples.rate), 0.0, f32(samples.near)));
    // The samples of the upper deck are last: they read the detail if all others do.
    let above = (samples.above.y - samples.above.x) / f32(max(samples.count - samples.near, 1u));
    return select(near, samples.count, UPPER && near == samples.near && above < most);
}

// Start of segment `i`, m.
fn light_stretch(samples: LightSamples, i: f32) -> f32 {
    if UPPER && i > f32(samples.near) {
        return mix(samples.above.x, samples.above.y, (i - f32(samples.near)) / f32(samples.count - samples.near));
    }
    if samples.rate > 0.0 {
        return NEAR * (exp2(samples.rate * i) - 1.0);
    }
    let share = i / f32(samples.near);
    return share * share * samples.reach;
}

struct LightSample {
    p: vec3f,
    altitude: f32,
    length: f32, // of its segment, m
    width: f32,
}

fn light_sample(samples: LightSamples, p: vec3f, i: u32, width: f32) -> LightSample {
    let a = select(light_stretch(samples, f32(i)), samples.above.x, UPPER && i == samples.near);
    let b = light_stretch(samples, f32(i + 1u));
    let reach = samples.reach;
    let is_far = i == samples.count;
    let length = select(b - a, 4.0 * reach, is_far);
    let s = select(0.5 * (a + b), 3.0 * reach, is_far);
    let at = p + s * (frame.sky.sun_direction + params.quality.cone * CONE[i % 6u]);
    return LightSample(at, altitude_at(at), length, max(width, 0.5 * length));
}

// Phase function of the light model: Henyey-Greenstein, two lobes of it, or that of droplets.
fn model_phase(one_minus_mu: f32) -> f32 {
    if PHASE != PHASE_HENYEY_GREENSTEIN {
        return droplet_phase(one_minus_mu);
    }
    return lobe_phase(one_minus_mu);
}

// Scattering angle at a pixel, given by its corner.
fn seen_turn(direction: vec3f, corner: vec2f) -> Turn {
    let one_minus_mu = one_minus_cos(direction, frame.sky.sun_direction);
    if frame.view.phase_samples <= 1u {
        return Turn(one_minus_mu, model_phase(one_minus_mu));
    }
    let n = frame.view.phase_samples;
    var sum = 0.0;
    var whole = 0.0;
    for (var i = 0u; i < n * n; i++) {
        let at = corner + (vec2f(vec2u(i % n, i / n)) + 0.5) / f32(n);
        let weight = place_weight(at);
        sum += weight * model_phase(one_minus_cos(view_direction(at).xyz, frame.sky.sun_direction));
        whole += weight;
    }
    return Turn(one_minus_mu, sum / whole);
}

// Radiance that a cloud scatters toward the eye per unit of irradiance and of optical depth along the view ray, for
// sunlight that has crossed the optical depth `depth`.
fn sun_scattering(depth: f32, precipitation: f32, one_minus_mu: f32) -> f32 {
    return seen_scattering(depth, precipitation, Turn(one_minus_mu, model_phase(one_minus_mu)));
}

// Optical depth toward the sun beyond which `sun_scattering` is less than a millionth of its value at 0.
fn dark_depth() -> f32 {
    const MILLIONTH = 14.0;
    return MILLIONTH / max(slowest_extinction(), 1e-6);
}

// Ambient radiance at a point: from the sky above and from below, each with the user's own ambient light.
fn ambient_above(sky: vec3f) -> vec3f {
    return params.light.ambient + params.light.ambient_gain * params.light.ambient_top * sky;
}

fn ambient_below(ground: vec3f) -> vec3f {
    return params.light.ambient + params.light.ambient_gain * params.light.ambient_bottom * ground;
}

// Whether the sun reaches any of the clouds.
fn is_sunlit() -> bool {
    if AIR {
        return SUNLIT;
    }
    return any(sky_light[2].rgb > vec3f(0.0));
}

// Consecutive samples of a ray that are lit together.
struct Span {
    start: f32, // optical depth in front of it
    thick: f32, // its optical depth
    weight: f32, // sum of `sample_weight`
    depth_to_sun: f32, // optical depth toward the sun
    precipitation: f32,
    above: f32, // `sky_share`
    distance: f32, // m from the eye
    is_last: bool, // whether it stands for all behind it
}

// Light that a span scatters toward the eye, relative to its weight.
struct Lit {
    weight: f32,
    sun: f32, // of the sun, for an irradiance of 1
    above: f32, // of a sky of radiance 1
    below: f32, // of a ground of radiance 1
    distance: f32,
}

// Scattering accumulated along a ray. The sums are scalars, distributed over the four distances of `AerialPoints` by
// interpolation weights; colours are computed once, at the end. Without air all weight is at the first distance.
struct Gathered {
    sun: vec4f, // sums of `Lit` times weights
    above: vec4f,
    below: vec4f,
    weight: vec4f, // sum of the weights: in total 1 minus the transmittance
}

fn gather(sum: Gathered, nodes: AerialPoints, lit: Lit) -> Gathered {
    if AIR {
        let w = lit.weight * aerial_point_shares(nodes, lit.distance);
        return Gathered(sum.sun + w * lit.sun, sum.above + w * lit.above, sum.below + w * lit.below, sum.weight + w);
    }
    let w = lit.weight;
    return Gathered(
        vec4f(sum.sun.x + w * lit.sun, 0.0, 0.0, 0.0),
        vec4f(sum.above.x + w * lit.above, 0.0, 0.0, 0.0),
        vec4f(sum.below.x + w * lit.below, 0.0, 0.0, 0.0),
        vec4f(sum.weight.x + w, 0.0, 0.0, 0.0),
    );
}

// Weight of all samples: 1 minus the transmittance.
fn gathered_weight(sum: Gathered) -> f32 {
    if AIR {
        return sum.weight.x + sum.weight.y + sum.weight.z + sum.weight.w;
    }
    return sum.weight.x;
}

// Radiance of the scattering accumulated along a ray from the eye, seen through the air.
fn gathered_radiance(sum: Gathered, nodes: AerialPoints, direction: vec3f) -> vec3f {
    if AIR {
        return radiance_through_air(sum, nodes, direction);
    }
    let sun = sum.sun.x * sky_light[2].rgb;
    if !AMBIENT {
        return sun;
    }
    let mu = dot(frame.view.zenith, frame.sky.sun_direction);
    return sun + ambient_light(sum.above.x, sum.below.x, vec3f(0.0), ground_factor(vec3f(0.0), mu) * sky_light[1].rgb);
}

fn radiance_through_air(sum: Gathered, nodes: AerialPoints, direction: vec3f) -> vec3f {
    let way = air_segment(direction);
    let texels = air_texels(direction);
    let sky = sky_radiance(direction);
    var radiance = vec3f(0.0);
    var depth = vec3f(0.0);
    var before = min(way.start, nodes.start);
    for (var k = 0u; k < 4u; k++) {
        let distance = aerial_point_distance(nodes, f32(k));
        depth += aerial_depth(direction, before, distance, select(PIECES, FIRST_PIECES, k == 0u));
        before = distance;
        let air = air_of(depth, distance, way, texels, sky);
        let p = distance * direction;
        let h = altitude_at(p);
        let mu = cos_zenith_at(p, frame.sky.sun_direction);
        var light = sum.sun[k] * sun_irradiance(h, mu);
        if AMBIENT {
            let ground = ground_factor(p, mu) * light_from_below(h, mu);
            light += ambient_light(sum.above[k], sum.below[k], light_from_above(h, mu), ground);
        }
        radiance += air.transmittance * light + sum.weight[k] * air.radiance;
    }
    return radiance;
}

// Half width, as a sine of the sun's elevation, of the range around the plane of a layer of clouds in which
// sunlight enters through their sides: 3 degrees.
const LAYER_SIDE = 0.05;

// Effective optical depth toward the sun of a uniform layer of optical depth `view` along the view ray and `light`
// along the sun's ray. Its transmittance is the mean over the single scattering that reaches the eye. `behind` is the
// sine of the sun's elevation beyond the layer as seen from the eye, negative on the eye's side.
fn depth_to_sun(view: f32, light: f32, behind: f32) -> f32 {
    let seen = log_mean_transmittance(view);
    let front = seen - log_mean_transmittance(view + light);
    let back = light + seen - log_mean_transmittance(view - light);
    return mix(front, back, smoothstep(-LAYER_SIDE, LAYER_SIDE, behind));
}

// Logarithm of (1 - exp(-x)) / x, also for negative x.
fn log_mean_transmittance(x: f32) -> f32 {
    return max(-x, 0.0) + log(one_minus_exp_over(abs(x)));
}
