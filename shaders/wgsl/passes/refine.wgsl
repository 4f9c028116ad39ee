// Which pixels need rays of their own: pixels between marched ones that look alike are interpolated.
//
// A lattice of pixels `frame.stride` apart, and the last column and row, are known. This halves the distance: each pixel
// that the finer lattice adds is put on the list of rays, or gets its value here.
#import bindings

@compute @workgroup_size(8, 8)
fn refine(@builtin(global_invocation_id) id: vec3u) {
    let half = frame.stride / 2u;
    let last = vec2u(frame.width, frame.sheet_rows) - 1u;
    let pixel = min(id.xy * half, last);
    let is_new = (pixel % frame.stride != vec2u(0u)) & (pixel != last);
    let is_twin = id.xy > (last + half - 1u) / half;
    if any(is_twin) || !any(is_new) {
        return;
    }
    // Between which known columns and rows it lies.
    let low = select(pixel, pixel - half, is_new);
    let high = select(pixel, min(pixel + half, last), is_new);

    // The corners of the squares that it lies in: one, or on an edge between two both.
    let before = select(previous(pixel), low, is_new);
    let after = select(min(pixel + frame.stride, last), high, is_new);
    var least = vec2f(1e30);
    var most = vec2f(0.0);
    var span = vec2f(1e30, 0.0);
    for (var i = 0u; i < 9u; i++) {
        let corner = array<vec2u, 3>(before, select(pixel, low, is_new), after);
        let at = index_of(vec2u(corner[i % 3u].x, corner[i / 3u].y));
        let value = clouds[at];
        span = vec2f(min(span.x, cloud_span[at].x), max(span.y, cloud_span[at].y));
        let brightness = vec2f(max(max(value.r, value.g), value.b), value.a);
        least = min(least, brightness);
        most = max(most, brightness);
    }
    // Light counts by what it is seen against: that of the brightest corner, or of the sky behind it.
    let backdrop = sky_light[0].rgb;
    let against = max(most.x, most.y * max(max(backdrop.r, backdrop.g), backdrop.b));
    let contrast = max(most.y - least.y, (most.x - least.x) / max(against, 1e-30));
    let index = index_of(pixel);
    cloud_span[index] = span;
    if contrast > quality.contrast {
        active_rays[atomicAdd(&ray_count, 1u)] = index;
        return;
    }

    let share = select(vec2f(0.0), vec2f(pixel - low) / vec2f(max(high - low, vec2u(1u))), is_new);
    var value = vec4f(0.0);
    var distance = vec2f(0.0); // weighted by opacity, and the weight
    for (var i = 0u; i < 4u; i++) {
        let is_high = vec2u(i % 2u, i / 2u) == vec2u(1u);
        let corner = index_of(select(low, high, is_high));
        let weights = select(1.0 - share, share, is_high);
        let weight = weights.x * weights.y;
        value += weight * clouds[corner];
        let opacity = select(0.0, weight * max(1.0 - clouds[corner].a, 1e-6), cloud_depth[corner] >= 0.0);
        distance += opacity * vec2f(cloud_depth[corner], 1.0);
    }
    clouds[index] = value;
    cloud_depth[index] = select(-1.0, distance.x / distance.y, distance.y > 0.0);
    samples[index] = 0u;
}

// The lattice's column and row before those of a pixel of it.
fn previous(pixel: vec2u) -> vec2u {
    let beyond = pixel % frame.stride;
    return pixel - min(pixel, select(beyond, vec2u(frame.stride), beyond == vec2u(0u)));
}

fn index_of(pixel: vec2u) -> u32 {
    return pixel.y * frame.width + pixel.x;
}
