// Bakes majorants: the largest density in each cell of the weather map and altitude, or of the user's grid. Each is
// then dilated to the largest of its cell and the neighbours, so that a step as long as a cell is safe from anywhere in
// it.
#import bindings
#import density
#import majorant

// Factor that rounds majorants up by more than the rounding error of half floats, 2^-11.
const ROUND_UP = 1.001;

// Largest voxel of a brick, and of the voxels with which its boundary is interpolated.
@compute @workgroup_size(4, 4, 4)
fn majorant_grid(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= textureDimensions(volume_out)) {
        return;
    }
    let last = vec3i(textureDimensions(volume_exact)) - 1;
    let corner = vec3i(id * BRICK) - 1;
    const SIDE = i32(BRICK) + 2;
    var most = 0.0;
    for (var i = 0; i < SIDE * SIDE * SIDE; i++) {
        let at = clamp(corner + vec3i(i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)), vec3i(0), last);
        most = max(most, textureLoad(volume_exact, at, 0).r);
    }
    textureStore(volume_out, id, vec4f(ROUND_UP * most));
}

// Bound by profile and coverage, as noise is at most 1: the largest of each over all weather that the points of a cell
// can read.
@compute @workgroup_size(4, 4, 4)
fn majorant_weather(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let map = vec2f(textureDimensions(weather_map));
    let low = vec2i(floor(vec2f(id.xy) / vec2f(size.xy) * map - 0.5));
    let high = vec2i(ceil(vec2f(id.xy + 1u) / vec2f(size.xy) * map - 0.5));
    var most = vec3f(0.0);
    var least = vec3f(1.0);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let texel = textureLoad(weather_map, wrapped(vec2i(x, y), vec2i(map)), 0).rgb;
            most = max(most, texel);
            least = min(least, texel);
        }
    }
    if LARGE_SCALE_WEATHER {
        most = saturate(most + frame.sky.broad_most);
        least = saturate(least - frame.sky.broad_most);
    }
    let wettest = weather_from_map(most);
    let driest = weather_from_map(least);
    let part = vec2f(f32(id.z), f32(id.z + 1u)) / f32(size.z);
    let altitudes = mix(vec2f(frame.sky.shell_base), vec2f(frame.sky.shell_top), part);
    let base = params.clouds.base;
    // Range of relative heights: from the lowest in a cloud at the lower side of the cell to the highest at its upper
    // side.
    let heights = vec2f(
        (altitudes.x - base) / (cloud_top(wettest.precipitation) - base),
        (altitudes.y - base) / (cloud_top(driest.precipitation) - base),
    );
    let profile = largest_profile(heights, vec2f(driest.kind, wettest.kind), tower(wettest.precipitation));
    var bound = bound_of(profile, wettest.coverage);
    if RAINY {
        // The anvil lies at the top. Its rise and its fall are each thicker than a cell, and the full anvil includes a
        // height of 0.84.
        let spread = max(anvil(wettest.precipitation, altitudes.x), anvil(wettest.precipitation, altitudes.y));
        let middle = mix(params.clouds.base, tallest(), 0.84);
        let whole = altitudes.x < middle && middle < altitudes.y;
        bound = max(bound, max(spread, select(0.0, anvil(wettest.precipitation, middle), whole)));
    }
    if UPPER || RAIN_SHAFTS {
        bound *= frame.sky.share;
        // Upper deck and rain, which have weather of their own, are bounded by their largest density.
        let deck = altitudes.y >= params.upper_clouds.base && altitudes.x <= params.upper_clouds.top;
        bound = max(bound, select(0.0, frame.sky.upper_share, UPPER && deck));
        let rain = frame.sky.rain_share * wettest.precipitation;
        bound = max(bound, select(0.0, rain, RAIN_SHAFTS && altitudes.x < base));
    }
    textureStore(volume_out, id, vec4f(ROUND_UP * bound));
}

// Texel index beyond the edge of the weather map. For a mirrored map, clamping gives the first texels of the mirror
// image.
fn wrapped(at: vec2i, size: vec2i) -> vec2i {
    let repeated = ((at % size) + size) % size;
    return select(clamp(at, vec2i(0), size - 1), repeated, params.weather.edge == EDGE_REPEAT);
}

// Largest value of `height_profile` between two heights, between two types, and up to a precipitation.
fn largest_profile(heights: vec2f, kinds: vec2f, rain: f32) -> f32 {
    if heights.y <= 0.0 || heights.x >= 1.0 {
        return 0.0;
    }
    if PROFILE_TABLE {
        return 1.0;
    }
    // Profile edges are piecewise linear in the type, from stratus over stratocumulus to cumulus, and linear in rain.
    let middle = clamp(0.5, kinds.x, kinds.y);
    let a = profile_edges(kinds.x, 0.0);
    let b = profile_edges(middle, 0.0);
    let c = profile_edges(kinds.y, 0.0);
    var first = min(min(a, b), c);
    var last = max(max(a, b), c);
    if RAINY {
        first = min(first, mix(first, params.clouds.cumulonimbus, rain));
        last = max(last, mix(last, params.clouds.cumulonimbus, rain));
    }
    // Bound of the rise: that of the earliest rise, at the upper height. Bound of the fall: that of the latest fall, at
    // the lower height.
    let rise = remap01(heights.y, first.x, first.y);
    return rise * (1.0 - smoothstep(last.z, max(last.w, last.z + 1e-4), heights.x));
}

// Largest of a cell and its neighbours.
@compute @workgroup_size(4, 4, 4)
fn majorant_dilate(@builtin(global_invocation_id) id: vec3u) {
    let size = vec3i(textureDimensions(volume_out));
    if any(vec3i(id) >= size) {
        return;
    }
    var most = 0.0;
    for (var i = 0; i < 27; i++) {
        var at = vec3i(id) + vec3i(i % 3, i / 3 % 3, i / 9) - 1;
        if !VOLUME {
            at = vec3i(wrapped(at.xy, size.xy), at.z);
        }
        most = max(most, textureLoad(volume_in, clamp(at, vec3i(0), size - 1), 0).r);
    }
    textureStore(volume_out, id, vec4f(most));
}
