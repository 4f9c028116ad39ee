// Bakes the optical depth to the sun around the eye, which stands in the middle: first the density of each cell, then the
// light from those.
#import bindings
#import density
#import shell
#import sun_volume

// Points that a cell's density is the mean of, beyond the finest level.
const POINTS = 4u;
// Samples toward the sun for each doubling of the distance, and most of them. They read cells as long as they are, or by so
// many halvings shorter. Storms cast shadows over tens of kilometres: there, more and shorter ones take the mean error of the
// transmittance in the scene `storm` from 0.11 to 0.04.
const DENSE_SAMPLES = vec2f(4.0, 8.0);
const MOST_SAMPLES = vec2f(50.0, 90.0);
const SHORTER = vec2f(0.5, 1.5);

// The one or the other, by how far storms have grown.
fn by_storms(choice: vec2f) -> f32 {
    return mix(choice.x, choice.y, saturate((frame.lower_top - params.clouds.top) / max(tallest() - params.clouds.top, 1.0)));
}

@compute @workgroup_size(8, 8)
fn sun_volume_density(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= vec3u(SIDE, SIDE, LEVELS * frame.sun_volume_rows)) {
        return;
    }
    let level = id.z / frame.sun_volume_rows;
    let cell = level_cell(level);
    let corner = vec3f(vec2f(id.xy) - 0.5 * f32(SIDE), f32(id.z % frame.sun_volume_rows));
    let count = select(POINTS, 1u, level == 0u);
    var density = 0.0;
    for (var i = 0u; i < count; i++) {
        // A low-discrepancy sequence (R3) that begins in the middle.
        let at = corner + fract(0.5 + f32(i) * vec3f(0.8191725, 0.6710436, 0.5497004));
        let altitude = mix(frame.shell_base, frame.shell_top, at.z / f32(frame.sun_volume_rows));
        density += cloud_density_cheap(place(cell * at.xy, altitude), altitude);
    }
    textureStore(volume_out, id, vec4f(density / f32(count)));
}

@compute @workgroup_size(8, 8)
fn sun_volume_light(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= vec3u(SIDE, SIDE, LEVELS * frame.sun_volume_rows)) {
        return;
    }
    let level = id.z / frame.sun_volume_rows;
    let cell = level_cell(level);
    let xy = cell * (vec2f(id.xy) + 0.5 - 0.5 * f32(SIDE));
    let altitude = mix(frame.shell_base, frame.shell_top, (f32(id.z % frame.sun_volume_rows) + 0.5) / f32(frame.sun_volume_rows));
    let p = place(xy, altitude);
    let s = cloud_stretches_from(p, frame.sun_direction);
    let whole = s.start + s.first + s.gap + s.second;
    let doublings = log2(1.0 + whole / cell);
    let count = clamp(ceil(by_storms(DENSE_SAMPLES) * doublings), 1.0, by_storms(MOST_SAMPLES));
    let rate = doublings / count;
    var depth = 0.0;
    var begin = 0.0;
    for (var i = 1.0; i <= count; i += 1.0) {
        let end = cell * (exp2(rate * i) - 1.0);
        let at = p + 0.5 * (begin + end) * frame.sun_direction;
        let height = height_at(altitude_at(at));
        let coarse = u32(clamp(log2((end - begin) / CELL) - by_storms(SHORTER), f32(level), f32(LEVELS - 1u)));
        let coordinates = stack_coordinates(at.xy, height, max(coarse, level_at(at.xy)));
        let density = textureSampleLevel(volume_in, clamp_sampler, coordinates, 0.0).r;
        let inside = height >= 0.0 && height <= 1.0;
        depth += select(0.0, density, inside) * (end - begin);
        begin = end;
    }
    textureStore(volume_out, id, exp(-frame.extinction * depth * RATES));
}

// The point at an altitude above, or below, a place beside the eye.
fn place(xy: vec2f, altitude: f32) -> vec3f {
    let centre = frame.zenith * frame.centre_distance;
    let across = length(centre.xy + xy);
    let r = params.atmosphere.planet_radius + altitude;
    let up = sqrt(max((r - across) * (r + across), 0.0));
    return vec3f(xy, select(-up, up, centre.z >= 0.0) - centre.z);
}
