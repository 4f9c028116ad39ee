// Bakes majorants: the largest density in each cell of the weather map by height, or of the user's grid; then the largest
// of each cell and its neighbours, so that a step as long as a cell is safe from anywhere in it.
#import bindings
#import density
#import majorant

// Half floats round by up to 2^-11: up, then, by more than that.
const ROUND_UP = 1.001;

// The largest voxel of a brick and of those that its edge is interpolated with.
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

// No noise is above 1, so what bounds the density is profile and coverage: the largest of each, of all the weather that
// a cell's points can read.
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
    // From the lowest that the lower side of the cell can be in its cloud to the highest that its upper side can.
    let heights = vec2f(
        (altitudes.x - base) / (cloud_top(wettest.precipitation) - base),
        (altitudes.y - base) / (cloud_top(driest.precipitation) - base),
    );
    let profile = largest_profile(heights, vec2f(driest.kind, wettest.kind), tower(wettest.precipitation));
    var bound = with_coverage(profile, wettest.coverage);
    if RAINY {
        // The anvil lies at the top; it rises and falls within more than one cell.
        let spread = max(anvil(wettest.precipitation, altitudes.x), anvil(wettest.precipitation, altitudes.y));
        let middle = mix(params.clouds.base, tallest(), 0.84);
        let whole = altitudes.x < middle && middle < altitudes.y;
        bound = max(bound, max(spread, select(0.0, anvil(wettest.precipitation, middle), whole)));
    }
    if UPPER || RAIN_SHAFTS {
        bound *= frame.sky.share;
        // No bound but the largest for what has its own weather.
        let deck = altitudes.y >= params.upper_clouds.base && altitudes.x <= params.upper_clouds.top;
        bound = max(bound, select(0.0, frame.sky.upper_share, UPPER && deck));
        let rain = frame.sky.rain_share * wettest.precipitation;
        bound = max(bound, select(0.0, rain, RAIN_SHAFTS && altitudes.x < base));
    }
    textureStore(volume_out, id, vec4f(ROUND_UP * bound));
}

// What lies beyond the edge of the weather map; beside its edge its mirror image begins with the same texels.
fn wrapped(at: vec2i, size: vec2i) -> vec2i {
    let repeated = ((at % size) + size) % size;
    return select(clamp(at, vec2i(0), size - 1), repeated, params.weather.edge == EDGE_REPEAT);
}

// The largest value of `height_profile` between two heights and two types, where it rains so much or less.
fn largest_profile(heights: vec2f, kinds: vec2f, rain: f32) -> f32 {
    if heights.y <= 0.0 || heights.x >= 1.0 {
        return 0.0;
    }
    if PROFILE_TABLE {
        return 1.0;
    }
    // Where the profile rises and falls goes from stratus to stratocumulus to cumulus to cumulonimbus in straight lines.
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
    // It rises to at most that of the earliest rise at the upper height, and falls at least that of the latest fall at
    // the lower one.
    let rise = remap01(heights.y, first.x, first.y);
    return rise * (1.0 - smoothstep(last.z, max(last.w, last.z + 1e-4), heights.x));
}

// The largest of a cell and its neighbours.
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
