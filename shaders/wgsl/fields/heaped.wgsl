// Field `heaped`: a shape that behaves like a distance, with relief of five octaves and a narrow edge. Its slope is
// about the same everywhere, so that what is subtracted from it moves the surface by as many metres.
//
// Noise and profile are added, not multiplied: where the profile falls slowly the noise makes turrets. Near the base
// the noise is read nearly upright, and thick cloud hangs lower, so that clouds stand on bases that undulate.
#import math
#import bindings
#import density

// Part of the rain that raises coverage.
const WET = 1.25;
// Distance of clear sky from cloud in the noise, at a coverage of 0: more than the noise has, so that it is clear.
const THRESHOLD = 1.2;
// Median slope of the base noise, per tile: 8e-4 per metre in tiles of 5200 m.
const NOISE_SLOPE = 4.16;
// Height above the base up to which the noise changes more slowly upward, m.
const UPRIGHT = 600.0;
// Undulation of the base, m; in layers a part of their thickness.
const BASE_RELIEF = 350.0;
const LAYER_RELIEF = 0.9;
// Depth of the relief per unit of `clouds.detail`, in units of the shape.
const RELIEF = 0.5;
// Mean of the relief that is subtracted.
const MEAN_RELIEF = 0.1;
// Widths of the edge in units of the shape: of dissolving clouds, and of growing ones (37 m and 10 m).
const SOFT_EDGE = 0.03;
const CRISP_EDGE = 0.008;
// Mean density of a cloud relative to the largest: of layers and of heaps (light model `octaves`).
const FILLINGS = vec2f(0.1, 0.45);

// Slope of the shape, 1/m.
fn slope() -> f32 {
    return NOISE_SLOPE / params.clouds.shape_scale;
}

// Growth: 0 in layers, 1 in heaps.
fn growth_of(kind: f32, rain: f32) -> f32 {
    return max(smoothstep(0.35, 0.85, kind), min(2.0 * rain, 1.0));
}

// Height profile: the fall alone. The rise is that of the lifted base.
fn profile_between(height: f32, edges: vec4f) -> f32 {
    return 1.0 - smoothstep(edges.z, max(edges.w, edges.z + 1e-4), height);
}

// Shape for the largest noise.
fn limit_of(profile: f32, coverage: f32) -> f32 {
    return saturate(profile - THRESHOLD * (1.0 - coverage));
}

// Bound of the density.
fn bound_of(profile: f32, coverage: f32) -> f32 {
    return select(0.0, 1.0, limit_of(profile, coverage) > 0.0);
}

// Height profile of the anvil at a precipitation: the more rain, the lower its underside.
fn anvil(rain: f32, altitude: f32) -> f32 {
    let height = (altitude - params.clouds.base) / (tallest() - params.clouds.base);
    let edge = ANVIL_EDGE.x - ANVIL_EDGE.y * params.clouds.anvil;
    let spread = smoothstep(edge, edge + 0.4, rain);
    let under = mix(0.86, 0.72, spread * spread);
    return spread * smoothstep(under, under + 0.08, height) * (1.0 - smoothstep(0.9, 0.98, height));
}

// Where the anvil outweighs the tower the cloud is a layer.
fn with_anvil(given: WeatherSample, spread: f32) -> WeatherSample {
    var column = given;
    let outweighs = 2.0 * spread > column.profile + column.coverage;
    column.profile = select(column.profile, spread, outweighs);
    column.coverage = select(column.coverage, spread, outweighs);
    column.growth = select(column.growth, 0.0, outweighs);
    column.height = min(column.height, 1.0);
    return column;
}

// Position at which the base noise is read: near the base the same for all heights.
fn noise_place(column: WeatherSample) -> vec3f {
    let h = max(column.over_base, 0.0);
    let risen = select(h - 0.5 * UPRIGHT, h * h / (2.0 * UPRIGHT), h < UPRIGHT);
    return vec3f(column.at.xy, column.at.z + risen - column.over_base);
}

// Thickness of the layer in the coordinates of the noises, m.
fn depth_of(column: WeatherSample) -> f32 {
    return column.thickness / select(1.0, params.upper_clouds.scale, UPPER && column.medium == UPPER_CLOUD);
}

fn relief_of(column: WeatherSample) -> f32 {
    return min(RELIEF * params.clouds.detail, 0.6 * slope() * depth_of(column));
}

fn shape_of(column: WeatherSample, noise: f32) -> f32 {
    let open = noise + column.profile - 1.0 - THRESHOLD * (1.0 - column.coverage);
    let relief = mix(LAYER_RELIEF * depth_of(column), BASE_RELIEF, column.growth);
    let lift = relief * (mix(0.55, 0.72, column.growth) - noise);
    return max(min(open, slope() * (column.over_base - lift)) - MEAN_RELIEF * relief_of(column), 0.0);
}

// What the noise falls short of cloud by: for a profile of 1, which holds at any height, and for the profile here.
fn lacks_of(column: WeatherSample, noise: f32) -> vec2f {
    let open = THRESHOLD * (1.0 - column.coverage) - noise;
    return vec2f(open, open + 1.0 - column.profile);
}

// Vigour: crisp where the cloud grows, soft where it does not.
fn vigour_of(column: WeatherSample) -> f32 {
    return smoothstep(0.15, 0.5, column.coverage) * column.growth * saturate(column.over_base / 250.0);
}

fn curled(column: WeatherSample) -> f32 {
    return 1.0 - vigour_of(column);
}

// Liquid water as a fraction of that in a core: more with height, and in layers with depth.
fn water_of(column: WeatherSample, shape: f32) -> f32 {
    let core = saturate(shape / min(0.4, 0.667 * slope() * depth_of(column)));
    let risen = saturate(column.over_base / mix(300.0, 700.0, column.growth));
    return mix(core, 1.0, column.growth) * mix(0.25, 1.0, risen);
}

// Density for values of detail and of curl.
fn density_of(column: WeatherSample, shape: f32, detail: f32, swirl: f32, width: f32) -> f32 {
    let vigour = vigour_of(column);
    let relief = relief_of(column);
    // Wispy, or billowy.
    let modifier = mix(detail, 1.0 - detail, smoothstep(0.1, 0.5, vigour));
    // Rougher and smoother flanks, for no read.
    let here = relief * mix(0.6, 1.4, saturate(0.5 + 0.5 * swirl));
    let left = shape - here * (modifier - MEAN_RELIEF);
    let edge = min(mix(SOFT_EDGE, CRISP_EDGE, vigour), max(0.3 * relief, CRISP_EDGE)) + slope() * width;
    return select(0.0, water_of(column, shape) * saturate(left / edge), shape > 0.0);
}

// Mean over the detail.
fn mean_density_of(column: WeatherSample, shape: f32) -> f32 {
    let relief = relief_of(column);
    let ends = relief * mix(vec2f(0.05, 1.05), vec2f(-0.05, 0.75), vigour_of(column));
    return select(0.0, water_of(column, shape) * smoothstep(ends.x, max(ends.y, ends.x + 1e-4), shape), shape > 0.0);
}

// Mean density of a cloud as a fraction of the largest.
fn filling_of(growth: f32) -> f32 {
    return mix(FILLINGS.x, FILLINGS.y, growth);
}
