// The cloud field: weather, height profile, base shape, detail (nubis2015, "density sampler"; thesis2018, "six steps");
// or the user's grid in its place.
#import math
#import bindings
#import volume

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
    height: f32, // 0 at the base of the clouds, 1 at their top
    precipitation: f32,
    at: vec3f, // where the noises are read: without the wind's lean, the altitude as z, m; in a grid the point itself
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

// Where the profile of a type rises and falls: the weighted sum of three.
fn profile_edges(kind: f32) -> vec4f {
    let stratus = saturate(1.0 - 2.0 * kind);
    let cumulus = saturate(2.0 * kind - 1.0);
    return stratus * STRATUS + (1.0 - stratus - cumulus) * STRATOCUMULUS + cumulus * CUMULUS;
}

// Density by height for a type.
fn height_profile(height: f32, kind: f32) -> f32 {
    let g = profile_edges(kind);
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
    if VOLUME {
        let height = saturate((p.z - frame.volume_low.z) / (frame.volume_high.z - frame.volume_low.z));
        return Column(select(0.0, 1.0, in_volume(p)), 1.0, 1.0, height, 0.0, p);
    }
    let height = (altitude - params.clouds.base) / (params.clouds.top - params.clouds.base);
    let at = p.xy - height * params.wind.shear * frame.wind_direction;
    let uv = frame.weather_origin + vec2f(at.x, -at.y) / params.weather.extent;
    let weather = weather_from_map(textureSampleLevel(weather_map, weather_sampler, uv, 0.0).rgb);
    let profile = height_profile(height, weather.kind);
    // The noise is at most 1: where the profile alone does not rise above 1 - coverage, nothing does.
    let inside = height > 0.0 && height < 1.0;
    let limit = select(0.0, with_coverage(profile, weather.coverage), inside);
    return Column(limit, profile, weather.coverage, height, weather.precipitation, vec3f(at, altitude));
}

// The base shape, before detail: cheap, and never smaller than the density. `width` is the size of what one sample
// stands for, in metres.
fn cloud_shape(column: Column, width: f32) -> f32 {
    if VOLUME {
        return select(0.0, volume_density(column.at), column.limit > 0.0);
    }
    let lod = log2(max(width * 128.0 / params.clouds.shape_scale, 1.0));
    let at = frame.shape_origin + column.at / params.clouds.shape_scale;
    let noise = textureSampleLevel(shape_noise, repeat_sampler, at, lod);
    let shape = with_coverage(base_shape(noise) * column.profile, column.coverage);
    return select(0.0, shape, column.limit > 0.0);
}

// The density at a point whose shape is known.
fn cloud_density(column: Column, shape: f32, width: f32) -> f32 {
    if VOLUME {
        return shape;
    }
    let curl_at = frame.curl_origin + column.at.xy / params.clouds.curl_scale;
    let swirl = textureSampleLevel(curl_noise, repeat_sampler, curl_at, 0.0).xy;
    let moved = column.at + vec3f(params.clouds.curl * (1.0 - column.height) * swirl, 0.0);
    let lod = log2(max(width * 32.0 / params.clouds.detail_scale, 1.0));
    let at = frame.detail_origin + moved / params.clouds.detail_scale;
    let detail = fbm3(textureSampleLevel(detail_noise, repeat_sampler, at, lod).rgb);
    return eroded(shape, detail, column.height);
}

// The density with everything read.
fn cloud_density_at(p: vec3f, altitude: f32, width: f32) -> f32 {
    let column = cloud_column(p, altitude);
    return cloud_density(column, cloud_shape(column, width), width);
}

// The density without reading the detail: eroded by its mean instead, so that light samples keep their mean.
fn cloud_density_cheap(p: vec3f, altitude: f32, width: f32) -> f32 {
    let shape = cloud_shape(cloud_column(p, altitude), width);
    if VOLUME {
        return shape;
    }
    return remap01(shape, 0.5 * params.clouds.detail, 1.0);
}
