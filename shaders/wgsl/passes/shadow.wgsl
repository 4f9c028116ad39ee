// Shadow maps: transmittance of the clouds toward the sun, on a plane (the user's map), or on the ground around the eye
// (the shadow clipmap of pictures). Each texel marches one or more sun rays.
#import bindings
#import workgroups
#import density
#import panels
#import shell
#import ground_shadow

// Largest number of steps of a sun ray, for the user's map and for the ground; smallest number for both.
const MAP_STEPS = 2048.0;
const GROUND_STEPS = 48.0;
const FEWEST = 12.0;
// Largest number of sun rays per texel of the ground.
const MOST_PLACES = 16.0;
// Scaled optical depth beyond which less than a thousandth of the sunlight remains.
const DARK = 7.0;

@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn shadow_map(@builtin(global_invocation_id) id: vec3u) {
    let texel = vec2u(id.x, dispatch.first_row + id.y);
    if id.x >= frame.view.width || id.y >= dispatch.rows {
        return;
    }
    // Offset from the centre of the map, where the eye is: east and north.
    let size = vec2f(f32(frame.view.width), f32(frame.view.height));
    let at = (vec2f(texel) + 0.5 - 0.5 * size) * vec2f(1.0, -1.0) * frame.sky.shadow_texel;
    let p = vec3f(at, 0.0);
    let hidden = hit_ground_from(p, frame.sky.sun_direction).enters;
    let fine = select(2.0 * finest_feature(), frame.sky.voxel, VOLUME);
    let depth = cloud_depth_to_sun(p, fine, MAP_STEPS).x + high_depth_from(p, frame.sky.sun_direction);
    shadow_out[texel.y * frame.view.width + id.x] = select(exp(-depth), 0.0, hidden);
}

@compute @workgroup_size(8, 8)
fn shadow_ground(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    let id = 8u * spread_over(group.xy, groups.xy) + local.xy;
    if id.x >= SHADOW_SIDE || id.y >= SHADOW_SIDE * SHADOW_LEVELS {
        return;
    }
    let level = id.y / SHADOW_SIDE;
    let texel = shadow_texel(level);
    let at = (vec2f(vec2u(id.x, id.y % SHADOW_SIDE)) + 0.5 - 0.5 * f32(SHADOW_SIDE)) * texel;
    let fine = select(max(2.0 * finest_feature(), texel), max(frame.sky.voxel, 0.5 * texel), VOLUME);
    // Texels wider than clouds average several positions of a low-discrepancy sequence (R2).
    let width = texel / frame.sky.leap_scale;
    let places = select(clamp(ceil(width * width), 1.0, MOST_PLACES), 1.0, VOLUME);
    var sum = vec4f(0.0);
    var k = 0.0;
    loop {
        let aside = texel * (fract(0.5 + k * vec2f(0.7548776662, 0.5698402910)) - 0.5);
        // With a light field, what clouds scatter forward reaches the ground, too: there the extinction is scaled.
        sum += exp(-frame.sky.split.z * cloud_depth_to_sun(ground_place(at + aside), fine, GROUND_STEPS));
        k += 1.0;
        if k >= places {
            break;
        }
    }
    textureStore(map_out, id.xy, sum / places);
}

// Blends each level into the next over the outer fifth of its reach, and the last level into its mean. Where a finer
// level exists, a texel becomes the mean of its four finer texels: coarse levels are read there for averages.
@compute @workgroup_size(8, 8)
fn shadow_blend(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= SHADOW_SIDE || id.y >= SHADOW_SIDE * SHADOW_LEVELS {
        return;
    }
    let level = id.y / SHADOW_SIDE;
    let last = level + 1u == SHADOW_LEVELS;
    let q = (vec2f(vec2u(id.x, id.y % SHADOW_SIDE)) + 0.5 - 0.5 * f32(SHADOW_SIDE)) * shadow_texel(level);
    let mean = textureLoad(ground_shadow_mean, vec2u(0u), 0);
    let beyond = select(shadow_in_level(q, min(level + 1u, SHADOW_LEVELS - 1u)), mean, last);
    let edge = smoothstep(0.8, 1.0, max(abs(q.x), abs(q.y)) / shadow_reach(level));
    var own = textureLoad(ground_shadow, id.xy, 0);
    // The margin excludes texels that reads of the finest level at hand interpolate.
    let finer = shadow_reach(level) * 0.5 - 2.0 * shadow_texel(level);
    if level > 0u && max(abs(q.x), abs(q.y)) < finer {
        own = shadow_in_level(q, level - 1u);
    }
    textureStore(map_out, id.xy, mix(own, beyond, edge));
}

var<workgroup> sums: array<vec4f, SHADOW_SIDE>; // of rows of the last level

@compute @workgroup_size(SHADOW_SIDE)
fn shadow_mean(@builtin(local_invocation_id) id: vec3u) {
    var sum = vec4f(0.0);
    for (var i = 0u; i < SHADOW_SIDE; i++) {
        sum += textureLoad(ground_shadow, vec2u(i, (SHADOW_LEVELS - 1u) * SHADOW_SIDE + id.x), 0);
    }
    sums[id.x] = sum / f32(SHADOW_SIDE);
    workgroupBarrier();
    if id.x == 0u {
        var mean = vec4f(0.0);
        for (var i = 0u; i < SHADOW_SIDE; i++) {
            mean += sums[i];
        }
        textureStore(map_out, vec2u(0u), mean / f32(SHADOW_SIDE));
    }
}

// Optical depth of the marched clouds from a point to the sun (x), and of their parts above a quarter, a half and three
// quarters of the height range (y, z, w). The march starts at the far end, so that clouds which reach `DARK` are dark
// in all channels. Steps are `fine` metres long, or longer if that exceeds `most` steps.
fn cloud_depth_to_sun(p: vec3f, fine: f32, most: f32) -> vec4f {
    let s = cloud_stretches_from(p, frame.sky.sun_direction);
    let length = s.first + s.second;
    let count = clamp(ceil(length / fine), FEWEST, most);
    let step = length / count;
    var depth = vec4f(0.0);
    var i = 0.0;
    // Nested loops: the inner one skips samples that are empty by their weather alone, without further reads.
    loop {
        var column = WeatherSample();
        var q = vec3f(0.0);
        loop {
            let at = p + stretch_distance(s, (count - i - 0.5) * step) * frame.sky.sun_direction;
            let found = cloud_column(at, altitude_at(at));
            i += 1.0;
            // Two exits, with a sample or with none. With one exit, lavapipe gives a ray that has left the loop the
            // value of the other rays' next iteration (docs/numerics.md).
            if found.limit > 0.0 {
                column = found;
                q = at;
                break;
            }
            if i >= count {
                break;
            }
        }
        let above = vec4f(height_among_clouds(q, altitude_at(q))) >= vec4f(-1e30, 0.25, 0.5, 0.75);
        let here = frame.sky.extinction * step * cloud_density(column, cloud_shape(column), 0.0);
        depth += select(vec4f(0.0), vec4f(here), above);
        if i >= count || frame.sky.split.z * depth.x > DARK {
            break;
        }
    }
    return select(vec4f(0.0), depth, length > 0.0);
}
