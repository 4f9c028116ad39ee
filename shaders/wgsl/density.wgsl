// The cloud field: weather, height profile, base shape, detail (nubis2015, "density sampler"; thesis2018, "six steps");
// or the user's grid in its place.
#import math
#import bindings
#import volume
#import chart

// How many times the field was read by this invocation.
var<private> evaluations: u32 = 0u;

struct LocalWeather {
    coverage: f32,
    kind: f32, // 0 stratus, 0.5 stratocumulus, 1 cumulus
    precipitation: f32, // turns cumulus into cumulonimbus
}

// What a point can lie in.
const CLOUD = 0u;
const UPPER_CLOUD = 1u; // of the deck above
const RAIN = 2u; // below the base

// What the weather alone says of a point: enough to know that there is nothing.
struct WeatherSample {
    limit: f32, // the base shape cannot exceed it; 0 where there is nothing
    profile: f32,
    coverage: f32,
    height: f32, // 0 at the base of the cloud, 1 at its top
    precipitation: f32,
    at: vec3f, // where the noises are read: on the chart without the wind's lean, the altitude as z, m; in a grid the point itself
    medium: u32,
    thickness: f32, // of the cloud here from its base to its top, m
    depth_share: f32, // share of that below the point
}

// How the three parameters of a cloud meet the weather map (vsu2022: coverage shifts the map).
fn weather_from_map(texel: vec3f) -> LocalWeather {
    let rain = texel.b * params.clouds.precipitation;
    let shifted = saturate(texel.r + 2.0 * params.clouds.coverage - 1.0);
    let kind = saturate(texel.g + 2.0 * params.clouds.type_ - 1.0);
    // Where it rains, coverage is at least 0.7 (nubis2015; here 0.95, so that towers have no holes) and the type is pushed
    // toward cumulonimbus, but a clear sky stays clear.
    let wet = 0.95 * rain * saturate(5.0 * params.clouds.coverage);
    return LocalWeather(max(shifted, wet), mix(kind, 1.0, rain), rain);
}

// The share of the cover that is left: none over the spot to keep clear, all from half a radius outside.
fn kept_clear(place: vec2f) -> f32 {
    if !KEEP_CLEAR {
        return 1.0;
    }
    let radius = frame.sky.clear_radius;
    return smoothstep(radius, 1.5 * radius, length(place - frame.sky.clear_at));
}

// Where the profile of a type rises from 0 to 1 and falls back, as fractions of the height: the weighted sum of three
// (nubis2015, figure 4.10; vsu2022's gradients, equations 8 to 11), and where it rains that of cumulonimbus.
fn profile_edges(kind: f32, rain: f32) -> vec4f {
    let stratus = saturate(1.0 - 2.0 * kind);
    let cumulus = saturate(2.0 * kind - 1.0);
    let dry = stratus * params.clouds.stratus + (1.0 - stratus - cumulus) * params.clouds.stratocumulus
        + cumulus * params.clouds.cumulus;
    if RAINY {
        return mix(dry, params.clouds.cumulonimbus, rain);
    }
    return dry;
}

fn profile_between(height: f32, edges: vec4f) -> f32 {
    return remap01(height, edges.x, edges.y) * (1.0 - smoothstep(edges.z, max(edges.w, edges.z + 1e-4), height));
}

// Density by height for a type: from its edges, or from the user's table.
fn height_profile(height: f32, kind: f32, rain: f32) -> f32 {
    if PROFILE_TABLE {
        let dry = profile_from_table(height, kind);
        return select(dry, mix(dry, profile_between(height, params.clouds.cumulonimbus), rain), RAINY);
    }
    return profile_between(height, profile_edges(kind, rain));
}

// The first row of the table is the top of the clouds and the last their base, as in a picture; its first column is type
// 0 and its last type 1.
fn profile_from_table(height: f32, kind: f32) -> f32 {
    let size = vec2f(textureDimensions(profile_table));
    let uv = (vec2f(kind, 1.0 - height) * (size - 1.0) + 0.5) / size;
    return textureSampleLevel(profile_table, clamp_sampler, uv, 0.0).r;
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
fn cloud_column(p: vec3f, altitude: f32) -> WeatherSample {
    evaluations += 1u;
    if VOLUME {
        let height = saturate((p.z - frame.sky.volume_low.z) / (frame.sky.volume_high.z - frame.sky.volume_low.z));
        let thickness = frame.sky.volume_high.z - frame.sky.volume_low.z;
        return WeatherSample(select(0.0, 1.0, in_volume(p)), 1.0, 1.0, height, 0.0, p, CLOUD, thickness, height);
    }
    let place = on_chart(p, altitude);
    let at = sheared(place, altitude);
    let broad = large_scale_weather(at);
    var weather = weather_from_map(weather_texel(frame.sky.weather_origin, at, broad));
    weather.coverage *= kept_clear(place);
    var column = cloud_in(weather, at, altitude);
    if RAIN_SHAFTS && altitude < params.clouds.base {
        column = rain_below(weather, at, altitude);
    }
    if UPPER {
        // Within the height of that deck where there is nothing, too: the march reads how much it lacks of being cloud.
        let upper = upper_cloud_at(place, altitude, broad);
        let alone = altitude > frame.sky.lower_top && upper.height > 0.0 && upper.height < 1.0;
        if upper.limit > column.limit || (column.limit <= 0.0 && alone) {
            column = upper;
        }
        // Of a deck that hardly shows there is what the shell has room for (`shell` in params.rs).
        column.limit = select(0.0, column.limit, altitude >= frame.sky.shell_base && altitude <= frame.sky.shell_top);
    }
    return column;
}

// A place on the chart, without the wind's lean.
fn sheared(place: vec2f, altitude: f32) -> vec2f {
    let lean = (altitude - params.clouds.base) / (params.clouds.top - params.clouds.base) * params.wind.shear;
    return place - lean * frame.sky.wind_direction;
}

// Which way the larger map bends the smaller one, across and down: along no axis of their tiles.
const BEND = vec2f(0.8, 0.6);

// What a larger map shifts the weather by, and, in alpha, bends the smaller map by, so that it does not look like its own
// repetition.
fn large_scale_weather(at: vec2f) -> vec4f {
    if LARGE_SCALE_WEATHER {
        let uv = frame.sky.broad_origin + vec2f(at.x, -at.y) / params.weather.broad_extent;
        return textureSampleLevel(broad_map, repeat_sampler, uv, 0.0);
    }
    return vec4f(0.0);
}

fn weather_uv(origin: vec2f, at: vec2f, broad: vec4f) -> vec2f {
    let uv = origin + vec2f(at.x, -at.y) / params.weather.extent;
    return select(uv, uv + frame.sky.broad_bend * broad.a * BEND, LARGE_SCALE_WEATHER);
}

// The weather map at a place `at` from where the eye is in its tile.
fn weather_texel(origin: vec2f, at: vec2f, broad: vec4f) -> vec3f {
    let texel = textureSampleLevel(weather_map, weather_sampler, weather_uv(origin, at, broad), 0.0).rgb;
    return select(texel, saturate(texel + frame.sky.broad_scale * broad.rgb), LARGE_SCALE_WEATHER);
}

// How much of a cumulonimbus stands where it rains so much: its tower in the core of the rain, its anvil farther around.
fn tower(rain: f32) -> f32 {
    return smoothstep(TOWER.x, TOWER.y, rain);
}

// Altitude of the tops: where it rains they grow to those of cumulonimbus (nubis2015).
fn cloud_top(rain: f32) -> f32 {
    if RAINY {
        return mix(params.clouds.top, tallest(), tower(rain));
    }
    return params.clouds.top;
}

fn tallest() -> f32 {
    return max(params.clouds.top, params.clouds.cumulonimbus_top);
}

// Between which heights of the whole cloud its anvil rises to full strength and falls back.
const ANVIL = vec4f(0.64, 0.80, 0.88, 1.0);

fn anvil(rain: f32, altitude: f32) -> f32 {
    let height = (altitude - params.clouds.base) / (tallest() - params.clouds.base);
    let edge = ANVIL_EDGE.x - ANVIL_EDGE.y * params.clouds.anvil;
    return smoothstep(edge, edge + 0.3, rain) * profile_between(height, ANVIL);
}

// The cloud at a place and altitude.
fn cloud_in(weather: LocalWeather, at: vec2f, altitude: f32) -> WeatherSample {
    let rain = weather.precipitation;
    let base = params.clouds.base;
    let height = (altitude - base) / (cloud_top(rain) - base);
    // The noise is at most 1: where the profile alone does not rise above 1 - coverage, nothing does.
    let inside = height > 0.0 && height < 1.0;
    var column = WeatherSample(0.0, 0.0, weather.coverage, height, rain, vec3f(at, altitude), CLOUD, 0.0, 0.0);
    column.profile = select(0.0, height_profile(height, weather.kind, tower(rain)), inside);
    column = with_extent(column, weather.kind, tower(rain), cloud_top(rain) - base);
    if RAINY {
        let spread = anvil(rain, altitude) * saturate(4.0 * weather.coverage);
        column.profile = max(column.profile, spread);
        column.coverage = max(column.coverage, spread);
        column.height = min(height, 1.0);
    }
    column.limit = with_coverage(column.profile, column.coverage);
    return column;
}

// From where to where its profile lets a cloud reach: to where it falls below what the coverage asks for.
fn with_extent(given: WeatherSample, kind: f32, rain: f32, whole: f32) -> WeatherSample {
    var column = given;
    var edges = profile_edges(kind, rain);
    if PROFILE_TABLE {
        edges = mix(vec4f(0.0, 0.0, 1.0, 1.0), edges, select(0.0, rain, RAINY));
    }
    let top = mix(edges.z, edges.w, column.coverage);
    column.thickness = max(top - edges.x, 1e-3) * whole;
    column.depth_share = remap01(column.height, edges.x, top);
    return column;
}

// The deck above, with a weather and a wind of its own.
fn upper_cloud_at(place: vec2f, altitude: f32, broad: vec4f) -> WeatherSample {
    let base = params.upper_clouds.base;
    let height = (altitude - base) / (params.upper_clouds.top - base);
    let lean = height * params.upper_clouds.shear * frame.sky.upper_direction;
    let at = vec3f(place - lean, altitude) / params.upper_clouds.scale;
    let texel = weather_texel(frame.sky.upper_weather_origin, at.xy, broad);
    let coverage = kept_clear(place) * saturate(texel.r + 2.0 * params.upper_clouds.coverage - 1.0);
    let kind = saturate(texel.g + 2.0 * params.upper_clouds.type_ - 1.0);
    let profile = height_profile(height, kind, 0.0);
    let inside = height > 0.0 && height < 1.0;
    let limit = select(0.0, with_coverage(profile, coverage), inside);
    let column = WeatherSample(limit, profile, coverage, height, 0.0, at, UPPER_CLOUD, 0.0, 0.0);
    return with_extent(column, kind, 0.0, params.upper_clouds.top - base);
}

// Rain below the base, thinned by the air that it falls through.
fn rain_below(weather: LocalWeather, at: vec2f, altitude: f32) -> WeatherSample {
    let height = altitude / params.clouds.base;
    let wet = frame.sky.rain_reach * weather.precipitation * weather.coverage;
    let limit = select(0.0, saturate(2.0 * wet - 0.6 + 0.6 * height), altitude > 0.0);
    let streak = vec3f(at, altitude / RAIN_STRETCH + frame.sky.rain_fall);
    // All of the cloud is above it.
    let thickness = cloud_top(weather.precipitation) - params.clouds.base;
    return WeatherSample(limit, 1.0, 1.0, 0.0, weather.precipitation, streak, RAIN, thickness, 0.0);
}

// The base shape, before detail: cheap, and never smaller than the density.
fn cloud_shape(column: WeatherSample) -> f32 {
    return shape_in(column, base_noise(column));
}

// The noise that shapes the clouds at a point; in the user's grid its density. It has no levels of detail: clouds are where it
// passes a level, and means pass that less often. Seen straight from above, of a cover of 0.305 texels of 80 m left 0.298, 160 m
// 0.285, 330 m 0.263 and 650 m 0.228, so that what there is depended on the size of pictures and steps; and pictures of 160x90 in
// `draft` erred by 0.19, 0.14 and 0.25 where they err by 0.15, 0.13 and 0.21 (`fair_weather`, `stratocumulus`, `above`), in the
// same time. Of what is smaller than a pixel several rays find the mean (passes/march).
fn base_noise(column: WeatherSample) -> f32 {
    if VOLUME {
        return volume_density(column.at);
    }
    let upper = UPPER && column.medium == UPPER_CLOUD;
    let origin = select(frame.sky.shape_origin, frame.sky.upper_shape_origin, upper);
    return textureSampleLevel(shape_noise, repeat_sampler, origin + column.at / params.clouds.shape_scale, 0.0).r;
}

// The base shape where that noise is known.
fn shape_in(column: WeatherSample, noise: f32) -> f32 {
    if VOLUME {
        return select(0.0, noise, column.limit > 0.0);
    }
    var shape = with_coverage(noise * column.profile, column.coverage);
    if RAIN_SHAFTS && column.medium == RAIN {
        shape = column.limit * remap01(noise, 0.15, 0.65);
    }
    return select(0.0, shape, column.limit > 0.0);
}

// A width, where the noises of the upper deck are scaled.
fn scaled(width: f32, upper: bool) -> f32 {
    return width / select(1.0, params.upper_clouds.scale, upper);
}

// The density at a point whose shape is known. `width` is the size of what one sample stands for, in metres.
fn cloud_density(column: WeatherSample, shape: f32, width: f32) -> f32 {
    if VOLUME {
        return shape;
    }
    let upper = UPPER && column.medium == UPPER_CLOUD;
    let curl_origin = select(frame.sky.curl_origin, frame.sky.upper_curl_origin, upper);
    let curl_at = curl_origin + column.at.xy / params.clouds.curl_scale;
    let swirl = textureSampleLevel(curl_noise, repeat_sampler, curl_at, 0.0).xy;
    let moved = column.at + vec3f(params.clouds.curl * (1.0 - column.height) * swirl, 0.0);
    let at = select(frame.sky.detail_origin, frame.sky.upper_detail_origin, upper) + moved / params.clouds.detail_scale;
    let detail = detail_at(at, scaled(width, upper) / params.clouds.detail_scale);
    return with_share(column, eroded(shape, detail, column.height), shape);
}

// What erodes the edges, where one sample stands for so many of its tiles: the detail, and the same again, smaller, without
// which a cloud that is near has nothing finer than the detail's texels of 13 m (passes/noise). One read for both: with two,
// the march of `fair_weather` took a seventh longer.
fn detail_at(at: vec3f, tiles: f32) -> f32 {
    let texels = tiles * f32(DETAIL_SIZE) * f32(FINER);
    return textureSampleLevel(detail_noise, repeat_sampler, at, log2(max(texels, 1.0))).r;
}

// The density of a medium as a share of `extinction`: of cloud that has been eroded, or of rain, which is not.
fn with_share(column: WeatherSample, cloud: f32, rain: f32) -> f32 {
    if !(UPPER || RAIN_SHAFTS) {
        return cloud;
    }
    var density = cloud * select(frame.sky.share, frame.sky.upper_share, column.medium == UPPER_CLOUD);
    return select(density, rain * frame.sky.rain_share, column.medium == RAIN);
}

// The density with everything read.
fn cloud_density_at(p: vec3f, altitude: f32, width: f32) -> f32 {
    let column = cloud_column(p, altitude);
    return cloud_density(column, cloud_shape(column), width);
}

// The density without reading the detail: eroded by its mean instead, so that light samples keep their mean.
fn cloud_density_cheap(p: vec3f, altitude: f32) -> f32 {
    let column = cloud_column(p, altitude);
    let shape = cloud_shape(column);
    if VOLUME {
        return shape;
    }
    return with_share(column, remap01(shape, 0.5 * params.clouds.detail, 1.0), shape);
}
