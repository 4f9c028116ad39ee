// Cloud density: weather and height profile (nubis2015, "density sampler"; thesis2018, "six steps"), and the base shape
// and detail of the field, or the user's grid. `cloud_field` stands for the file of the field in fields/.
#import math
#import bindings
#import volume
#import chart
#import cloud_field

// Density evaluations of this invocation.
var<private> evaluations: u32 = 0u;

struct LocalWeather {
    coverage: f32,
    kind: f32, // cloud type: 0 stratus, 0.5 stratocumulus, 1 cumulus
    precipitation: f32, // grows cumulus into cumulonimbus
}

// Medium of a sample.
const CLOUD = 0u;
const UPPER_CLOUD = 1u; // upper deck
const RAIN = 2u; // rain below the base of the lower deck

// Weather at a point, without noise: enough to skip clear air.
struct WeatherSample {
    limit: f32, // upper bound of the base shape; 0 in clear air
    profile: f32,
    coverage: f32,
    height: f32, // fraction of the cloud's height: 0 at its base, 1 at its top
    precipitation: f32,
    // Position at which the noises are read, m: on the chart, without wind shear, and the altitude as z. In a grid the
    // point itself.
    at: vec3f,
    medium: u32,
    thickness: f32, // of the cloud at this place, from base to top, m
    depth_share: f32, // fraction of the thickness below the point
    over_base: f32, // height above the base of the deck in the coordinates of the noises, m
    growth: f32, // 0 in layers, 1 in heaps
}

// Local weather from a texel of the weather map. The parameters offset the map's values (vsu2022: coverage shifts the
// map).
fn weather_from_map(texel: vec3f) -> LocalWeather {
    let rain = texel.b * params.clouds.precipitation;
    let shifted = saturate(texel.r + 2.0 * params.clouds.coverage - 1.0);
    let kind = saturate(texel.g + 2.0 * params.clouds.type_ - 1.0);
    // Rain raises coverage, and shifts the type toward cumulonimbus. A clear sky stays clear.
    let wet = saturate(WET * rain) * saturate(5.0 * params.clouds.coverage);
    return LocalWeather(max(shifted, wet), mix(kind, 1.0, rain), rain);
}

// Factor on the coverage around the region kept clear: 0 within its radius, 1 from 1.5 times its radius on.
fn kept_clear(place: vec2f) -> f32 {
    if !KEEP_CLEAR {
        return 1.0;
    }
    let radius = frame.sky.clear_radius;
    return smoothstep(radius, 1.5 * radius, length(place - frame.sky.clear_at));
}

// Height profile of a type: fractions of the height at which it rises from 0, reaches 1, starts to fall and reaches 0.
// It is the weighted sum of three profiles (nubis2015, figure 4.10; vsu2022's gradients, equations 8 to 11), blended
// with that of cumulonimbus by rain.
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

// Height profile at a height: from the four fractions, or from the user's table.
fn height_profile(height: f32, kind: f32, rain: f32) -> f32 {
    if PROFILE_TABLE {
        let dry = profile_from_table(height, kind);
        return select(dry, mix(dry, profile_between(height, params.clouds.cumulonimbus), rain), RAINY);
    }
    return profile_between(height, profile_edges(kind, rain));
}

// Profile table. Row 0 is the top of the clouds, the last row their base; column 0 is type 0, the last column type 1.
fn profile_from_table(height: f32, kind: f32) -> f32 {
    let size = vec2f(textureDimensions(profile_table));
    let uv = (vec2f(kind, 1.0 - height) * (size - 1.0) + 0.5) / size;
    return textureSampleLevel(profile_table, clamp_sampler, uv, 0.0).r;
}

// Weather at a point `p` relative to the eye.
fn cloud_column(p: vec3f, altitude: f32) -> WeatherSample {
    evaluations += 1u;
    if VOLUME {
        let height = saturate((p.z - frame.sky.volume_low.z) / (frame.sky.volume_high.z - frame.sky.volume_low.z));
        let thickness = frame.sky.volume_high.z - frame.sky.volume_low.z;
        let inside = select(0.0, 1.0, in_volume(p));
        return WeatherSample(inside, 1.0, 1.0, height, 0.0, p, CLOUD, thickness, height, 0.0, 0.0);
    }
    return column_on_chart(on_chart(p, altitude), altitude);
}

// Weather at a point of the chart, relative to the eye.
fn column_on_chart(place: vec2f, altitude: f32) -> WeatherSample {
    let at = sheared(place, altitude);
    let broad = large_scale_weather(at);
    var weather = weather_from_map(weather_texel(frame.sky.weather_origin, at, broad));
    weather.coverage *= kept_clear(place);
    var column = cloud_in(weather, at, altitude);
    if RAIN_SHAFTS && altitude < params.clouds.base {
        column = rain_below(weather, at, altitude);
    }
    if UPPER {
        // Within the height range of the upper deck its sample replaces an empty one, even if it is empty itself: the
        // march derives the length of a leap from how far the sample is from being cloud.
        let upper = upper_cloud_at(place, altitude, broad);
        let alone = altitude > frame.sky.lower_top && upper.height > 0.0 && upper.height < 1.0;
        if upper.limit > column.limit || (column.limit <= 0.0 && alone) {
            column = upper;
        }
        // Density ends at the shell, whose height range grows with the visibility of a deck (`shell` in params.rs).
        column.limit = select(0.0, column.limit, altitude >= frame.sky.shell_base && altitude <= frame.sky.shell_top);
    }
    return column;
}

// Position on the chart without wind shear.
fn sheared(place: vec2f, altitude: f32) -> vec2f {
    let lean = (altitude - params.clouds.base) / (params.clouds.top - params.clouds.base) * params.wind.shear;
    return place - lean * frame.sky.wind_direction;
}

// Direction in which the large-scale map displaces the smaller one, in u and v: along no axis of the tiles.
const BEND = vec2f(0.8, 0.6);

// Large-scale weather: offsets of coverage, type and precipitation in rgb, displacement of the smaller map in alpha.
// The displacement hides the smaller map's repetition.
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

// Texel of the weather map at `at`, m on the chart relative to the eye, whose place in the map is `origin`.
fn weather_texel(origin: vec2f, at: vec2f, broad: vec4f) -> vec3f {
    let texel = textureSampleLevel(weather_map, weather_sampler, weather_uv(origin, at, broad), 0.0).rgb;
    return select(texel, saturate(texel + frame.sky.broad_scale * broad.rgb), LARGE_SCALE_WEATHER);
}

// Tower of a cumulonimbus: its completeness, 0 to 1, in the core of the rain. The anvil reaches farther out.
fn tower(rain: f32) -> f32 {
    return smoothstep(TOWER.x, TOWER.y, rain);
}

// Altitude of the cloud tops, m: rain raises them to those of cumulonimbus (nubis2015).
fn cloud_top(rain: f32) -> f32 {
    if RAINY {
        return mix(params.clouds.top, tallest(), tower(rain));
    }
    return params.clouds.top;
}

fn tallest() -> f32 {
    return max(params.clouds.top, params.clouds.cumulonimbus_top);
}

// Lower deck at a chart position and altitude.
fn cloud_in(weather: LocalWeather, at: vec2f, altitude: f32) -> WeatherSample {
    let rain = weather.precipitation;
    let base = params.clouds.base;
    let height = (altitude - base) / (cloud_top(rain) - base);
    // Bound of the base shape: noise is at most 1, so there is no cloud where the profile alone is below 1 - coverage.
    let inside = height > 0.0 && height < 1.0;
    var column = WeatherSample(
        0.0,
        0.0,
        weather.coverage,
        height,
        rain,
        vec3f(at, altitude),
        CLOUD,
        0.0,
        0.0,
        altitude - base,
        growth_of(weather.kind, rain),
    );
    column.profile = select(0.0, height_profile(height, weather.kind, tower(rain)), inside);
    column = with_extent(column, weather.kind, tower(rain), cloud_top(rain) - base);
    if RAINY {
        column = with_anvil(column, anvil(rain, altitude) * saturate(4.0 * weather.coverage));
    }
    column.limit = limit_of(column.profile, column.coverage);
    return column;
}

// Vertical extent of the cloud: from the start of the profile to the height at which the profile falls below
// 1 - coverage.
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

// Upper deck, with its own weather, wind and scale.
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
    let limit = select(0.0, limit_of(profile, coverage), inside);
    let over_base = (altitude - base) / params.upper_clouds.scale;
    let growth = growth_of(kind, 0.0);
    let column =
        WeatherSample(limit, profile, coverage, height, 0.0, at, UPPER_CLOUD, 0.0, 0.0, over_base, growth);
    return with_extent(column, kind, 0.0, params.upper_clouds.top - base);
}

// Rain below the base. Evaporation thins it on its way down.
fn rain_below(weather: LocalWeather, at: vec2f, altitude: f32) -> WeatherSample {
    let height = altitude / params.clouds.base;
    let wet = frame.sky.rain_reach * weather.precipitation * weather.coverage;
    let limit = select(0.0, saturate(2.0 * wet - 0.6 + 0.6 * height), altitude > 0.0);
    let streak = vec3f(at, altitude / RAIN_STRETCH + frame.sky.rain_fall);
    // The whole cloud lies above the rain.
    let thickness = cloud_top(weather.precipitation) - params.clouds.base;
    return WeatherSample(limit, 1.0, 1.0, 0.0, weather.precipitation, streak, RAIN, thickness, 0.0, 0.0, 0.0);
}

// Base shape, without detail: cheap to evaluate, and an upper bound of the density.
fn cloud_shape(column: WeatherSample) -> f32 {
    return shape_in(column, base_noise(column));
}

// Base-shape noise at a point; in the user's grid its density. It has no mip levels: clouds are where the noise exceeds
// a threshold, and averages exceed it less often. Of a cover of 0.305 seen straight from above, mips with texels of
// 80 m left 0.298, of 160 m 0.285, of 330 m 0.263 and of 650 m 0.228; the cover depended on resolution and step length.
// With mips, pictures of 160x90 in `draft` had errors of 0.19, 0.14 and 0.25; without, 0.15, 0.13 and 0.21
// (`fair_weather`, `stratocumulus`, `above`), in the same time. Pixels wider than clouds are averaged over several rays
// instead (passes/march).
fn base_noise(column: WeatherSample) -> f32 {
    if VOLUME {
        return volume_density(column.at);
    }
    let upper = UPPER && column.medium == UPPER_CLOUD;
    let origin = select(frame.sky.shape_origin, frame.sky.upper_shape_origin, upper);
    let at = origin + noise_place(column) / params.clouds.shape_scale;
    return textureSampleLevel(shape_noise, repeat_sampler, at, 0.0).r;
}

// Base shape for a value of the base-shape noise.
fn shape_in(column: WeatherSample, noise: f32) -> f32 {
    if VOLUME {
        return select(0.0, noise, column.limit > 0.0);
    }
    var shape = shape_of(column, noise);
    if RAIN_SHAFTS && column.medium == RAIN {
        shape = column.limit * remap01(noise, 0.15, 0.65);
    }
    return select(0.0, shape, column.limit > 0.0);
}

// Width in the coordinates of the noises, which are scaled in the upper deck.
fn scaled(width: f32, upper: bool) -> f32 {
    return width / select(1.0, params.upper_clouds.scale, upper);
}

// Density at a point of known base shape. `width` is the footprint of the sample, m.
fn cloud_density(column: WeatherSample, shape: f32, width: f32) -> f32 {
    if VOLUME {
        return shape;
    }
    let upper = UPPER && column.medium == UPPER_CLOUD;
    let curl_origin = select(frame.sky.curl_origin, frame.sky.upper_curl_origin, upper);
    let curl_at = curl_origin + column.at.xy / params.clouds.curl_scale;
    let swirl = textureSampleLevel(curl_noise, repeat_sampler, curl_at, 0.0).xy;
    let moved = column.at + vec3f(params.clouds.curl * curled(column) * swirl, 0.0);
    let at = select(frame.sky.detail_origin, frame.sky.upper_detail_origin, upper) + moved / params.clouds.detail_scale;
    let detail = detail_at(at, scaled(width, upper) / params.clouds.detail_scale);
    return with_share(column, density_of(column, shape, detail, swirl.x, scaled(width, upper)), shape);
}

// Detail noise that erodes the edges, at a footprint of `tiles` tiles. The texture is the sum of the detail and its
// finer copy (passes/noise). Without the copy, near clouds have nothing finer than the detail's texels of 13 m. One
// read serves both: with two, the march of `fair_weather` took a seventh longer.
fn detail_at(at: vec3f, tiles: f32) -> f32 {
    let texels = tiles * f32(DETAIL_SIZE) * f32(FINER);
    return textureSampleLevel(detail_noise, repeat_sampler, at, log2(max(texels, 1.0))).r;
}

// Density of a medium as a fraction of `extinction`. Clouds are eroded by detail, rain is not.
fn with_share(column: WeatherSample, cloud: f32, rain: f32) -> f32 {
    if !(UPPER || RAIN_SHAFTS) {
        return cloud;
    }
    var density = cloud * select(frame.sky.share, frame.sky.upper_share, column.medium == UPPER_CLOUD);
    return select(density, rain * frame.sky.rain_share, column.medium == RAIN);
}

// Density at a point, with every read.
fn cloud_density_at(p: vec3f, altitude: f32, width: f32) -> f32 {
    let column = cloud_column(p, altitude);
    return cloud_density(column, cloud_shape(column), width);
}

// Density without the read of the detail: its mean.
fn cloud_density_cheap(p: vec3f, altitude: f32) -> f32 {
    let column = cloud_column(p, altitude);
    let shape = cloud_shape(column);
    if VOLUME {
        return shape;
    }
    return with_share(column, mean_density_of(column, shape), shape);
}
