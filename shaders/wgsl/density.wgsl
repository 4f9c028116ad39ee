// The cloud field: weather, height profile, base shape, detail (nubis2015, "density sampler"; thesis2018, "six steps").
#import math
#import bindings

// How many times the field was read by this invocation.
var<private> evaluations: u32 = 0u;

// Where the profile rises from 0 to 1 and falls back, as fractions of the shell's height (nubis2015, figure 4.10).
const STRATUS = vec4f(0.02, 0.05, 0.09, 0.11);
const STRATOCUMULUS = vec4f(0.02, 0.12, 0.35, 0.60);
const CUMULUS = vec4f(0.01, 0.07, 0.25, 1.0);

struct LocalWeather {
    coverage: f32,
    kind: f32, // 0 stratus, 0.5 stratocumulus, 1 cumulus
    precipitation: f32,
}

// What the weather alone says of a point: enough to know that there is no cloud.
struct Column {
    limit: f32, // the base shape cannot exceed it; 0 where there is no cloud
    profile: f32,
    coverage: f32,
    height: f32, // 0 at the base of the shell, 1 at its top
    precipitation: f32,
    at: vec2f, // where the point would be without the wind's lean, m
}

// How the three parameters of a cloud meet the weather map (vsu2022: coverage shifts the map).
fn weather_from_map(texel: vec3f) -> LocalWeather {
    let rain = texel.b * params.clouds.precipitation;
    let shifted = saturate(texel.r + 2.0 * params.clouds.coverage - 1.0);
    let kind = saturate(texel.g + 2.0 * params.clouds.type_ - 1.0);
    // Where it rains, coverage is at least 0.7 and the type is pushed toward cumulonimbus (nubis2015), but a clear
    // sky stays clear.
    let wet = 0.7 * rain * saturate(5.0 * params.clouds.coverage);
    return LocalWeather(max(shifted, wet), mix(kind, 1.0, rain), rain);
}

// Density by height for a type: the weighted sum of three profiles.
fn height_profile(height: f32, kind: f32) -> f32 {
    let stratus = saturate(1.0 - 2.0 * kind);
    let cumulus = saturate(2.0 * kind - 1.0);
    let g = stratus * STRATUS + (1.0 - stratus - cumulus) * STRATOCUMULUS + cumulus * CUMULUS;
    return remap01(height, g.x, g.y) * (1.0 - smoothstep(g.z, g.w, height));
}

// nubis2015: the low-frequency FBM lowers the old minimum, which raises the shape.
fn base_shape(noise: vec4f) -> f32 {
    let low = 1.0 - fbm3(noise.gba);
    return (noise.r + low) / (1.0 + low);
}

// The base shape with coverage: what is left of it above 1 - coverage, lighter where there is little.
fn with_coverage(base: f32, coverage: f32) -> f32 {
    return remap01(base, 1.0 - coverage, 1.0) * coverage;
}

// Detail eats into the shape: wispy at the base, billowy above.
fn eroded(shape: f32, detail: f32, height: f32) -> f32 {
    let modifier = mix(detail, 1.0 - detail, saturate(10.0 * height));
    return select(0.0, remap01(shape, modifier * params.clouds.detail, 1.0), shape > 0.0);
}

// The weather at a point `p`, relative to the camera.
fn cloud_column(p: vec3f, altitude: f32) -> Column {
    evaluations += 1u;
    let height = (altitude - params.clouds.base) / (params.clouds.top - params.clouds.base);
    let at = p.xy - height * params.wind.shear * frame.wind_direction;
    let uv = frame.weather_origin + vec2f(at.x, -at.y) / params.weather.extent;
    let weather = weather_from_map(textureSampleLevel(weather_map, repeat_sampler, uv, 0.0).rgb);
    let profile = height_profile(height, weather.kind);
    // The noise is at most 1: where the profile alone does not rise above 1 - coverage, nothing does.
    let inside = height > 0.0 && height < 1.0;
    let limit = select(0.0, with_coverage(profile, weather.coverage), inside);
    return Column(limit, profile, weather.coverage, height, weather.precipitation, at);
}

// The base shape, before detail: cheap, and never smaller than the density. `width` is the size of what one sample
// stands for, in metres.
fn cloud_shape(column: Column, altitude: f32, width: f32) -> f32 {
    let lod = log2(max(width * 128.0 / params.clouds.shape_scale, 1.0));
    let at = frame.shape_origin + vec3f(column.at, altitude) / params.clouds.shape_scale;
    let noise = textureSampleLevel(shape_noise, repeat_sampler, at, lod);
    let shape = with_coverage(base_shape(noise) * column.profile, column.coverage);
    return select(0.0, shape, column.limit > 0.0);
}

// The density at a point whose shape is known.
fn cloud_density(column: Column, shape: f32, altitude: f32, width: f32) -> f32 {
    let swirl = textureSampleLevel(curl_noise, repeat_sampler, frame.curl_origin + column.at / params.clouds.curl_scale, 0.0).xy;
    let moved = vec3f(column.at + params.clouds.curl * (1.0 - column.height) * swirl, altitude);
    let lod = log2(max(width * 32.0 / params.clouds.detail_scale, 1.0));
    let at = frame.detail_origin + moved / params.clouds.detail_scale;
    let detail = fbm3(textureSampleLevel(detail_noise, repeat_sampler, at, lod).rgb);
    return eroded(shape, detail, column.height);
}

// The density with everything read.
fn cloud_density_at(p: vec3f, altitude: f32, width: f32) -> f32 {
    let column = cloud_column(p, altitude);
    return cloud_density(column, cloud_shape(column, altitude, width), altitude, width);
}

// The density without reading the detail: eroded by its mean instead, so that light samples keep their mean.
fn cloud_density_cheap(p: vec3f, altitude: f32, width: f32) -> f32 {
    let shape = cloud_shape(cloud_column(p, altitude), altitude, width);
    return remap01(shape, 0.5 * params.clouds.detail, 1.0);
}
