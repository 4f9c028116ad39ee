// Field `eroded`, the published one: Perlin-Worley noise times the height profile is the shape, and detail erodes it
// (nubis2015, "density sampler").
#import math
#import bindings
#import density

// Part of the rain that raises coverage: to at least 0.7 in nubis2015, here to 0.95, as towers have holes otherwise.
const WET = 0.95;

fn profile_between(height: f32, edges: vec4f) -> f32 {
    return remap01(height, edges.x, edges.y) * (1.0 - smoothstep(edges.z, max(edges.w, edges.z + 1e-4), height));
}

// Base shape after coverage: values above 1 - coverage are stretched to [0, 1] and scaled by coverage, so that sparse
// clouds are thin.
fn with_coverage(base: f32, coverage: f32) -> f32 {
    return remap01(base, 1.0 - coverage, 1.0) * coverage;
}

// Erosion of the base shape by detail: wispy at the base, billowy above.
fn eroded(shape: f32, detail: f32, height: f32) -> f32 {
    let modifier = mix(detail, 1.0 - detail, saturate(10.0 * height));
    return select(0.0, remap01(shape, modifier * params.clouds.detail, 1.0), shape > 0.0);
}

fn limit_of(profile: f32, coverage: f32) -> f32 {
    return with_coverage(profile, coverage);
}

// Height profile of the anvil, in fractions of the height of a cumulonimbus: start and end of its rise, start and end
// of its fall.
const ANVIL = vec4f(0.64, 0.80, 0.88, 1.0);

fn anvil(rain: f32, altitude: f32) -> f32 {
    let height = (altitude - params.clouds.base) / (tallest() - params.clouds.base);
    let edge = ANVIL_EDGE.x - ANVIL_EDGE.y * params.clouds.anvil;
    return smoothstep(edge, edge + 0.3, rain) * profile_between(height, ANVIL);
}

fn with_anvil(given: WeatherSample, spread: f32) -> WeatherSample {
    var column = given;
    column.profile = max(column.profile, spread);
    column.coverage = max(column.coverage, spread);
    column.height = min(column.height, 1.0);
    return column;
}

// Bound of the density.
fn bound_of(profile: f32, coverage: f32) -> f32 {
    return with_coverage(profile, coverage);
}

// Mean density of a cloud at coverage 1, as a fraction of the largest: the product of noise, profile and detail.
// Measured along verticals of optical depth over 1: 0.15 in the scene `overcast`, 0.12 in `stratocumulus` and `storm`.
fn filling_of(growth: f32) -> f32 {
    return 0.12;
}

fn growth_of(kind: f32, rain: f32) -> f32 {
    return 0.0;
}

fn noise_place(column: WeatherSample) -> vec3f {
    return column.at;
}

fn shape_of(column: WeatherSample, noise: f32) -> f32 {
    return with_coverage(noise * column.profile, column.coverage);
}

// What the noise falls short of cloud by: for a profile of 1, which holds at any height, and for the profile here.
fn lacks_of(column: WeatherSample, noise: f32) -> vec2f {
    return 1.0 - column.coverage - noise * vec2f(1.0, column.profile);
}

fn curled(column: WeatherSample) -> f32 {
    return 1.0 - column.height;
}

fn density_of(column: WeatherSample, shape: f32, detail: f32, swirl: f32, width: f32) -> f32 {
    return eroded(shape, detail, column.height);
}

// Erosion by the mean of the detail keeps the mean of light samples.
fn mean_density_of(column: WeatherSample, shape: f32) -> f32 {
    return remap01(shape, 0.5 * params.clouds.detail, 1.0);
}
