// Which pixels need rays of their own: pixels between marched ones that look alike are interpolated.
//
// A lattice of pixels `frame.lattice` apart, with the last column and row, is known. This halves the distance: each pixel
// that the finer lattice adds is put on the list of rays, or gets its value here. An invocation has a square of the
// lattice: the pixel in its middle, and those of its upper and its left edge, which it shares with its neighbours.
#import bindings
#import camera
#import scene_depth

@compute @workgroup_size(8, 8)
fn refine(@builtin(global_invocation_id) id: vec3u) {
    let square = square_of(id.xy);
    if square.has.x {
        settle(square.top, square.above, square.top_between);
    }
    if square.has.y {
        settle(square.side, square.left, square.side_between);
    }
    if all(square.has) {
        settle(square.middle, square.own, square.middle_between);
    }
}

// In an animation what the frame before had between the rays counts as well: farther apart than in a still, they are not likely
// to miss the same small cloud twice.
@compute @workgroup_size(8, 8)
fn refine_again(@builtin(global_invocation_id) id: vec3u) {
    let square = square_of(id.xy);
    if square.has.x {
        settle(square.top, with_past(square.above, square.top, square.top_between), square.top_between);
    }
    if square.has.y {
        settle(square.side, with_past(square.left, square.side, square.side_between), square.side_between);
    }
    if all(square.has) {
        settle(square.middle, with_past(square.own, square.middle, square.middle_between), square.middle_between);
    }
}

// The pixels that a square of the lattice adds, how the corners around each look, and what lies between those.
struct Square {
    has: vec2<bool>, // room for a pixel between the columns, between the rows
    top: vec2u,
    side: vec2u,
    middle: vec2u,
    above: Looks,
    left: Looks,
    own: Looks,
    top_between: Known,
    side_between: Known,
    middle_between: Known,
}

fn square_of(number: vec2u) -> Square {
    let last = vec2u(frame.march_width, frame.sheet_rows) - 1u;
    let half = frame.lattice / 2u;
    let low = min(number * frame.lattice, last);
    let high = min(low + frame.lattice, last);
    let middle = low + half;
    var square: Square;
    square.has = middle < high;
    if !any(square.has) {
        return square;
    }
    // Of the squares above and to the left, narrower behind the last column and row; on the rim the square itself again.
    let before = (max(low, vec2u(1u)) - 1u) / frame.lattice * frame.lattice;

    let a = read(low);
    let b = read(vec2u(high.x, low.y));
    let c = read(vec2u(low.x, high.y));
    let d = read(high);
    let above = joined(looks(read(vec2u(low.x, before.y))), looks(read(vec2u(high.x, before.y))));
    let left = joined(looks(read(vec2u(before.x, low.y))), looks(read(vec2u(before.x, high.y))));
    let share = vec2f(middle - low) / vec2f(max(high - low, vec2u(1u)));
    square.top = vec2u(middle.x, low.y);
    square.side = vec2u(low.x, middle.y);
    square.middle = middle;
    square.own = joined(joined(looks(a), looks(b)), joined(looks(c), looks(d)));
    square.above = joined(square.own, above);
    square.left = joined(square.own, left);
    square.top_between = mixed(a, b, share.x);
    square.side_between = mixed(a, c, share.y);
    square.middle_between = mixed(mixed(a, b, share.x), mixed(c, d, share.x), share.y);
    return square;
}

// The looks of the corners around a pixel, and of the frame before around where it was: of nine pixels half as far apart as
// it is from the corners.
fn with_past(around: Looks, cell: vec2u, between: Known) -> Looks {
    let pixel = marched_pixel(vec2u(cell.x, frame.sheet_row + cell.y));
    let centre = vec2f(pixel) + 0.5;
    let away = select(frame.far_distance, between.distance.x / between.distance.y, between.distance.y > 0.0);
    let direction = away * view_direction(centre).xyz + frame.eye_motion - frame.cloud_motion;
    let was = previous_pixel(normalize(direction));
    let motion = select(shortest_way(was.xy - centre), vec2f(0.0), frame.moving == 0u);
    let at = vec2i(pixel) + vec2i(round(motion));
    let apart = i32(frame.stride * frame.lattice / 4u);
    var both = around;
    var i = 0;
    loop {
        let past = history[pixel_index(at + apart * (vec2i(i % 3, i / 3) - 1))];
        both = joined(both, Looks(vec2f(max(max(past.r, past.g), past.b)), past.aa, NOWHERE, NO_SCENE));
        if i == 8 {
            break;
        }
        i++;
    }
    // What comes into the picture has no past, and clouds that the corners do not have may be anywhere.
    let new_here = (was.z <= 0.0 && frame.moving > 0u) || !in_picture(at);
    both.scene = select(both.scene, 0.0, new_here);
    if contrast_of(both) > quality.contrast && contrast_of(around) <= quality.contrast {
        both.span = EVERYWHERE;
    }
    return both;
}

const EVERYWHERE = vec2f(0.0, 1e30); // as in march.wgsl
const NOWHERE = vec2f(1e30, 0.0);

// What is known of a pixel.
struct Known {
    value: vec4f, // as `clouds`
    distance: vec2f, // opacity times depth, opacity
    span: vec2f,
    scene: f32, // m along the ray
}

fn read(pixel: vec2u) -> Known {
    let index = pixel.y * frame.march_width + pixel.x;
    let value = clouds[index];
    let depth = cloud_depth[index];
    let opacity = select(0.0, max(1.0 - value.a, 1e-6), depth >= 0.0);
    return Known(value, opacity * vec2f(depth, 1.0), cloud_span[index], scene_at(pixel));
}

fn scene_at(pixel: vec2u) -> f32 {
    return scene_distance(marched_pixel(vec2u(pixel.x, frame.sheet_row + pixel.y)));
}

fn mixed(a: Known, b: Known, share: f32) -> Known {
    return Known(mix(a.value, b.value, share), mix(a.distance, b.distance, share), vec2f(0.0), NO_SCENE);
}

// How the corners of squares look: least and most light, least and most transmittance, where the clouds are, and how
// near the user's scene.
struct Looks {
    light: vec2f,
    transmittance: vec2f,
    span: vec2f,
    scene: f32,
}

fn looks(k: Known) -> Looks {
    return Looks(vec2f(max(max(k.value.r, k.value.g), k.value.b)), k.value.aa, k.span, k.scene);
}

fn joined(a: Looks, b: Looks) -> Looks {
    return Looks(
        vec2f(min(a.light.x, b.light.x), max(a.light.y, b.light.y)),
        vec2f(min(a.transmittance.x, b.transmittance.x), max(a.transmittance.y, b.transmittance.y)),
        vec2f(min(a.span.x, b.span.x), max(a.span.y, b.span.y)),
        min(a.scene, b.scene),
    );
}

fn settle(pixel: vec2u, around: Looks, between: Known) {
    let index = pixel.y * frame.march_width + pixel.x;
    // Rays that the user's scene ends say nothing of what lies behind it: each ray beside it is marched, and all of it.
    let open = min(around.scene, scene_at(pixel)) >= NO_SCENE;
    cloud_span[index] = select(EVERYWHERE, around.span, open);
    if contrast_of(around) > quality.contrast || !open {
        active_rays[atomicAdd(&ray_count, 1u)] = index;
    } else {
        let distance = between.distance;
        clouds[index] = between.value;
        cloud_depth[index] = select(-1.0, distance.x / distance.y, distance.y > 0.0);
        samples[index] = 0u;
    }
}

fn contrast_of(around: Looks) -> f32 {
    // Light counts by what it is seen against: the brightest corner, or the sky behind it.
    let backdrop = max(max(sky_light[0].r, sky_light[0].g), sky_light[0].b);
    let against = max(around.light.y, around.transmittance.y * backdrop);
    return max(
        around.transmittance.y - around.transmittance.x,
        (around.light.y - around.light.x) / max(against, 1e-30),
    );
}
