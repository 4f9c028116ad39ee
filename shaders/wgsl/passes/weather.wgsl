// Bakes the weather map: coverage, type and precipitation over a tileable square (nubis2015, thesis2018, vsu2022). Also
// mixes weather maps.
#import bindings
#import gradient_noise

const COVERAGE_SALT = 7u;
const TYPE_SALT = 47u;
const RAIN_SALT = 77u;

// Specialization by `weather.noise`.
override WEATHER_NOISE: u32 = 0u;

// Smooth noise of the map, by `weather.noise`.
fn smooth_fbm(p: vec3f, period: u32, octaves: u32, salt: u32) -> f32 {
    if WEATHER_NOISE == NOISE_WORLEY_SIMPLEX {
        return simplex_fbm(p.xy, period, octaves, salt);
    }
    return perlin_fbm(p, period, octaves, salt);
}

// FBM of three octaves of Worley noise.
fn worley_fbm(p: vec3f, period: u32, salt: u32) -> f32 {
    return fbm3(vec3f(worley(p, period, salt), worley(p, period * 2u, salt + 1u), worley(p, period * 4u, salt + 2u)));
}

// Cover noise (x) and the values that map to coverages of 0 and 1 (y, z), chosen so that all noises give the same
// cover.
fn cover(p: vec3f, cells: u32, seed: u32) -> vec3f {
    let shape = smooth_fbm(p, cells, 4u, seed + 2u);
    if WEATHER_NOISE == NOISE_WORLEY_SIMPLEX {
        // Clouds stand where simplex noise is high; the borders of Worley cells cut them.
        return vec3f(worley_fbm(p, cells, seed) * (0.2 + 1.6 * shape), 0.2, 0.75);
    }
    if WEATHER_NOISE == NOISE_PERLIN_WORLEY {
        let blobs = remap01(worley_fbm(p, cells, seed), 0.1, 0.65);
        return vec3f(perlin_worley(shape, blobs), -0.05, 0.6);
    }
    // Clouds stand at the blobs of Worley noise. Perlin noise modulates them, so that no two are alike.
    let blobs = worley(p, cells, seed) * 0.6 + worley(p, cells * 2u, seed + 1u) * 0.4;
    return vec3f(0.9 * blobs + 0.7 * (shape - 0.5), 0.2, 0.7);
}

@compute @workgroup_size(8, 8)
fn weather(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // Row 0 is the north edge, so that a user's map reads like a map.
    let p = vec3f((f32(id.x) + 0.5) / f32(size.x), 1.0 - (f32(id.y) + 0.5) / f32(size.y), 0.5);
    let seed = params.weather.seed * 97u;
    let cells = max(u32(round(params.weather.extent / params.weather.scale)), 1u);
    let broad_cells = max(cells / 4u, 1u);

    let stands = cover(p, cells, seed + COVERAGE_SALT);
    let broad = smooth_fbm(p, broad_cells, 3u, seed + COVERAGE_SALT + 9u) - 0.5;
    let coverage = remap01(stands.x + params.weather.variety * broad, stands.y, stands.z);

    let varied = smooth_fbm(p, max(cells / 3u, 1u), 3u, seed + TYPE_SALT) - 0.5;
    let kind = saturate(0.5 + params.weather.type_variety * varied);
    let rain = remap01(smooth_fbm(p, broad_cells, 2u, seed + RAIN_SALT) + 0.3 * (coverage - 0.5), 0.3, 0.7);
    textureStore(map_out, id.xy, vec4f(coverage, kind, rain, 1.0));
}

// Weighted sum of up to four maps at the largest size, read with the filter of the march: smaller maps are magnified.
@compute @workgroup_size(8, 8)
fn weather_mix(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(size);
    var sum = mix_shares.x * textureSampleLevel(mix_a, weather_sampler, uv, 0.0);
    sum += mix_shares.y * textureSampleLevel(mix_b, weather_sampler, uv, 0.0);
    sum += mix_shares.z * textureSampleLevel(mix_c, weather_sampler, uv, 0.0);
    sum += mix_shares.w * textureSampleLevel(mix_d, weather_sampler, uv, 0.0);
    textureStore(map_out, id.xy, sum);
}
