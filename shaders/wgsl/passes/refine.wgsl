// Adaptive sampling: pixels between samples of low contrast are interpolated, the others get a ray.
//
// Samples lie on a grid of spacing `dispatch.grid_spacing`, to which the last column and row belong. `refine` halves
// the spacing: each new pixel of the grid is interpolated here or added to the ray list. An invocation has a square of
// the grid and resolves its middle and the middles of its upper and left edges; neighbouring squares share edges.
#import bindings
#import camera
#import contrast
#import sample_grid
#import scene_depth

// Ray list of the initial grid.
@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn list_grid(@builtin(global_invocation_id) id: vec3u) {
    let last = vec2u(dispatch.march_width, dispatch.strip_rows) - 1u;
    let size = (last + dispatch.grid_spacing - 1u) / dispatch.grid_spacing + 1u;
    if any(id.xy >= size) {
        return;
    }
    let pixel = min(id.xy * dispatch.grid_spacing, last);
    active_rays[id.y * size.x + id.x] = pixel.y * dispatch.march_width + pixel.x;
    if all(id.xy == vec2u(0u)) {
        atomicStore(&ray_count, size.x * size.y);
    }
}

@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn refine(@builtin(global_invocation_id) id: vec3u) {
    let last = vec2u(dispatch.march_width, dispatch.strip_rows) - 1u;
    if any(id.xy > (last + dispatch.grid_spacing - 1u) / dispatch.grid_spacing) {
        return;
    }
    let half = dispatch.grid_spacing / 2u;
    let low = min(id.xy * dispatch.grid_spacing, last);
    let high = min(low + dispatch.grid_spacing, last);
    let middle = low + half;
    let has = middle < high; // whether there is a pixel between the columns, and between the rows
    if !any(has) {
        return;
    }
    // Origins of the squares above and to the left, which are narrower behind the last column and row. At the edge of
    // the picture it is the square itself.
    let before = (max(low, vec2u(1u)) - 1u) / dispatch.grid_spacing * dispatch.grid_spacing;

    let a = read(low);
    let b = read(vec2u(high.x, low.y));
    let c = read(vec2u(low.x, high.y));
    let d = read(high);
    let own = union_of(union_of(bounds_of(a), bounds_of(b)), union_of(bounds_of(c), bounds_of(d)));
    let above = union_of(bounds_of(read(vec2u(low.x, before.y))), bounds_of(read(vec2u(high.x, before.y))));
    let left = union_of(bounds_of(read(vec2u(before.x, low.y))), bounds_of(read(vec2u(before.x, high.y))));
    let share = vec2f(middle - low) / vec2f(max(high - low, vec2u(1u)));
    if has.x {
        resolve(vec2u(middle.x, low.y), union_of(own, above), lerp_samples(a, b, share.x));
    }
    if has.y {
        resolve(vec2u(low.x, middle.y), union_of(own, left), lerp_samples(a, c, share.y));
    }
    if all(has) {
        resolve(middle, own, lerp_samples(lerp_samples(a, b, share.x), lerp_samples(c, d, share.x), share.y));
    }
}

// Sample at a pixel.
struct RaySample {
    value: vec4f, // premultiplied radiance, transmittance
    distance: vec2f, // weight times depth, weight
    span: vec2f,
    scene: f32, // m along the ray
}

fn read(pixel: vec2u) -> RaySample {
    let index = pixel.y * dispatch.march_width + pixel.x;
    let value = clouds[index];
    let depth = cloud_depth[index];
    let opacity = depth_weight(value.a, depth);
    return RaySample(value, opacity * vec2f(depth, 1.0), cloud_span[index], scene_at(pixel));
}

fn scene_at(pixel: vec2u) -> f32 {
    return scene_distance(marched_pixel(vec2u(pixel.x, dispatch.strip_row + pixel.y)));
}

fn lerp_samples(a: RaySample, b: RaySample, share: f32) -> RaySample {
    return RaySample(mix(a.value, b.value, share), mix(a.distance, b.distance, share), vec2f(0.0), NO_SCENE);
}

// Bounds over samples: minimum and maximum of brightness (x, y) and of transmittance, range of distances with cloud,
// distance of the user's scene.
struct Bounds {
    light: vec2f,
    transmittance: vec2f,
    span: vec2f,
    scene: f32,
}

fn bounds_of(k: RaySample) -> Bounds {
    return Bounds(vec2f(brightness(k.value)), k.value.aa, k.span, k.scene);
}

fn union_of(a: Bounds, b: Bounds) -> Bounds {
    return Bounds(
        vec2f(min(a.light.x, b.light.x), max(a.light.y, b.light.y)),
        vec2f(min(a.transmittance.x, b.transmittance.x), max(a.transmittance.y, b.transmittance.y)),
        vec2f(min(a.span.x, b.span.x), max(a.span.y, b.span.y)),
        min(a.scene, b.scene),
    );
}

fn resolve(pixel: vec2u, around: Bounds, between: RaySample) {
    let index = pixel.y * dispatch.march_width + pixel.x;
    // A ray that ends at the user's scene carries no information about what is behind the scene. Pixels beside such a
    // ray are marched over their full length.
    let open = min(around.scene, scene_at(pixel)) >= NO_SCENE;
    cloud_span[index] = select(vec2f(0.0, 1e30), around.span, open);
    if contrast(around.light, around.transmittance) > params.quality.adaptive_threshold || !open {
        active_rays[atomicAdd(&ray_count, 1u)] = index;
    } else {
        let distance = between.distance;
        clouds[index] = between.value;
        cloud_depth[index] = select(-1.0, distance.x / distance.y, distance.y > 0.0);
        samples[index] = 0u;
    }
}
