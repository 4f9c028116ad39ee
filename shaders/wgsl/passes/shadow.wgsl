// How much direct sun comes through the clouds to a plane (the user's map), or to the ground around the eye (for pictures):
// each texel looks at the sun.
#import bindings
#import density
#import panels
#import shell
#import ground_shadow

// Most steps of a ray toward the sun: of the user's map, and of the ground around the eye. And the fewest.
const MAP_STEPS = 2048.0;
const GROUND_STEPS = 48.0;
const FEWEST = 12.0;
// Behind this optical depth is less than a thousandth of the sun.
const DARK = 7.0;

@compute @workgroup_size(8, 8)
fn shadow_map(@builtin(global_invocation_id) id: vec3u) {
    let texel = vec2u(id.x, frame.first_row + id.y);
    if id.x >= frame.width || id.y >= frame.rows {
        return;
    }
    // From the middle, which is where the eye stands: east and north.
    let size = vec2f(f32(frame.width), f32(frame.height));
    let at = (vec2f(texel) + 0.5 - 0.5 * size) * vec2f(1.0, -1.0) * frame.shadow_texel;
    let p = vec3f(at, 0.0);
    let hidden = hit_ground_from(p, frame.sun_direction).enters;
    let fine = select(2.0 * finest_feature(), frame.voxel, VOLUME);
    let depth = cloud_depth_to_sun(p, fine, MAP_STEPS) + high_depth_from(p, frame.sun_direction);
    shadow_out[texel.y * frame.width + id.x] = select(exp(-depth), 0.0, hidden);
}

@compute @workgroup_size(8, 8)
fn shadow_ground(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= SHADOW_SIDE || id.y >= SHADOW_SIDE * SHADOW_LEVELS {
        return;
    }
    let level = id.y / SHADOW_SIDE;
    let texel = shadow_texel(level);
    let at = (vec2f(vec2u(id.x, id.y % SHADOW_SIDE)) + 0.5 - 0.5 * f32(SHADOW_SIDE)) * texel;
    let fine = select(max(2.0 * finest_feature(), texel), max(frame.voxel, 0.5 * texel), VOLUME);
    let depth = cloud_depth_to_sun(ground_place(at), fine, GROUND_STEPS);
    textureStore(map_out, id.xy, vec4f(exp(-depth)));
}

// Lets each level go over into the next in the outer fifth of its reach, and the last into its mean.
@compute @workgroup_size(8, 8)
fn shadow_blend(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= SHADOW_SIDE || id.y >= SHADOW_SIDE * SHADOW_LEVELS {
        return;
    }
    let level = id.y / SHADOW_SIDE;
    let last = level + 1u == SHADOW_LEVELS;
    let q = (vec2f(vec2u(id.x, id.y % SHADOW_SIDE)) + 0.5 - 0.5 * f32(SHADOW_SIDE)) * shadow_texel(level);
    let mean = textureLoad(ground_shadow_mean, vec2u(0u), 0).r;
    let beyond = select(shadow_in_level(q, min(level + 1u, SHADOW_LEVELS - 1u)), mean, last);
    let edge = smoothstep(0.8, 1.0, max(abs(q.x), abs(q.y)) / shadow_reach(level));
    textureStore(map_out, id.xy, vec4f(mix(textureLoad(ground_shadow, id.xy, 0).r, beyond, edge)));
}

var<workgroup> sums: array<f32, SHADOW_SIDE>; // of rows of the last level

@compute @workgroup_size(SHADOW_SIDE)
fn shadow_mean(@builtin(local_invocation_id) id: vec3u) {
    var sum = 0.0;
    for (var i = 0u; i < SHADOW_SIDE; i++) {
        sum += textureLoad(ground_shadow, vec2u(i, (SHADOW_LEVELS - 1u) * SHADOW_SIDE + id.x), 0).r;
    }
    sums[id.x] = sum / f32(SHADOW_SIDE);
    workgroupBarrier();
    if id.x == 0u {
        var mean = 0.0;
        for (var i = 0u; i < SHADOW_SIDE; i++) {
            mean += sums[i];
        }
        textureStore(map_out, vec2u(0u), vec4f(mean / f32(SHADOW_SIDE)));
    }
}

// Optical depth of the marched clouds from a point to the sun, in steps of `fine` metres, or longer ones. Each reads the finest
// noise: coarser levels of detail make clouds smaller, and the ground of `fair_weather` 3 % too bright in the mean, not 1 %.
fn cloud_depth_to_sun(p: vec3f, fine: f32, most: f32) -> f32 {
    let s = cloud_stretches_from(p, frame.sun_direction);
    let length = s.first + s.second;
    let count = clamp(ceil(length / fine), FEWEST, most);
    let step = length / count;
    var depth = 0.0;
    var i = 0.0;
    // A loop in a loop, as in passes/march: where the weather alone says that there is nothing, nothing else is read.
    loop {
        var column: Column;
        loop {
            let q = p + stretch_distance(s, (i + 0.5) * step) * frame.sun_direction;
            column = cloud_column(q, altitude_at(q));
            i += 1.0;
            if column.limit > 0.0 || i >= count {
                break;
            }
        }
        depth += frame.extinction * step * cloud_density(column, cloud_shape(column, 0.0), 0.0);
        if i >= count || depth > DARK {
            break;
        }
    }
    return select(0.0, depth, length > 0.0);
}
