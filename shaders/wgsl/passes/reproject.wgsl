// Fills the picture from the subset of pixels that was marched, and from the frame before (nubis2015, "reprojection").
// One invocation fills a cell. Its pixels have the same marched neighbours, and all but the same motion, so that these are
// found, and the frame before is read, once for all of them: loads are all that this pass costs. In a sparse picture a pixel
// here is one that is known (lattice.wgsl).
#import bindings
#import camera
#import shell
#import lattice
#import scene_depth

// Pixels of a cell in each direction: 4, in a sparse picture 2 (reproject.rs).
override STRIDE: i32 = 4;

// How many standard deviations of its neighbourhood a moving pixel may be from its mean. Measured on a pan: 1.25 blurs
// (error 13.0 %), 2 keeps what 4 keeps (11.7 and 11.4 %) and still catches ghosts.
const SPREAD = 2.0;

// Frames in which every pixel of a cell is marched once. A pixel rests on so many when it has had its own
// ray and has been followed since; before that on as many as it has been guessed in, from neighbours, and its value is their
// mean.
override ROUND: u32 = u32(STRIDE * STRIDE);

// How many times as far as its nearest the user's scene may be around a cell, now and in the frame before. Past that
// there is an edge, beside which neighbours and past say nothing of a pixel, as their rays have ended elsewhere.
const SCENE_STEP = 1.1;

// What the pixels of a cell have in common.
struct Cell {
    corner: vec2i, // its first pixel
    // The marched pixels around it, row by row, and where their like is not found, a pixel of the past is a ghost.
    above: mat3x4f,
    level: mat3x4f,
    below: mat3x4f,
    low: vec4f,
    high: vec4f,
    own_distance: f32, // m to the cloud of its own marched pixel, -1 if there is none
    distance: f32, // m to the nearest cloud of the nine, -1 if there is none
    shift: vec2i, // whole pixels to where it was
    seen: bool, // whether it was before the camera
}

@compute @workgroup_size(8, 8)
fn reproject(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.march_width || id.y * u32(STRIDE) >= frame.rows {
        return;
    }
    let at = vec2i(vec2u(id.x, frame.first_row / u32(STRIDE) + id.y));
    var cell: Cell;
    cell.corner = at * STRIDE;
    cell.above = fresh_row(at - vec2i(0, 1));
    cell.level = fresh_row(at);
    cell.below = fresh_row(at + vec2i(0, 1));
    let mean = (cell.above + cell.level + cell.below) * vec3f(1.0 / 9.0);
    let square = (squares(cell.above) + squares(cell.level) + squares(cell.below)) / 9.0;
    let deviation = sqrt(max(square - mean * mean, vec4f(0.0)));
    cell.low = mean - SPREAD * deviation;
    cell.high = mean + SPREAD * deviation;
    cell.own_distance = fresh_depth[fresh_index(at)];
    cell.distance = nearest_cloud(at);

    // Where the cloud seen here was in the frame before. Where no cloud is near, the sky stands still.
    let centre = pixel_place(vec2f(cell.corner) + 0.5 * f32(STRIDE));
    let away = select(frame.far_distance, cell.distance, cell.distance >= 0.0);
    let before = away * view_direction(centre).xyz + frame.eye_motion - frame.cloud_motion;
    let was = previous_pixel(normalize(before));
    // What stands still is where it was, to the bit: a narrow view, a pole of a panorama or a wide picture turn the
    // rounding of a direction into a good part of a pixel.
    let motion = select(shortest_way(was.xy - centre) / f32(spacing()), vec2f(0.0), frame.moving == 0u);
    cell.shift = vec2i(round(motion));
    cell.seen = was.z > 0.0 || frame.moving == 0u;

    // The frame before between pixel centres, by Catmull-Rom splines: linear interpolation, repeated every frame, would
    // blur. What has moved by whole pixels reads them, exactly. Four rows at a time make one.
    let snapped = select(motion, round(motion), abs(motion - round(motion)) < vec2f(1e-3));
    let corner = cell.corner + vec2i(floor(snapped)) - 1;
    let alone = SCENE && frame.moving > 0u && has_scene_edge(at, cell.corner, corner);
    let across = catmull_rom(snapped.x - floor(snapped.x));
    let down = catmull_rom(snapped.y - floor(snapped.y));
    var a = history_row(corner, across);
    var b = history_row(corner + vec2i(0, 1), across);
    var c = history_row(corner + vec2i(0, 2), across);
    var y = 0;
    // Left at its end: lavapipe runs a loop that is left at its start once more, for nothing.
    loop {
        let d = history_row(corner + vec2i(0, y + 3), across);
        let old = a * down.x + b * down.y + c * down.z + d * down.w;
        fill(cell, vec2i(0, y), old[0], alone);
        fill(cell, vec2i(1, y), old[1], alone);
        if !SPARSE {
            fill(cell, vec2i(2, y), old[2], alone);
            fill(cell, vec2i(3, y), old[3], alone);
        }
        if y == STRIDE - 1 {
            break;
        }
        a = b;
        b = c;
        c = d;
        y++;
    }
}

// The frame before in the size of this one, and known at as many pixels: what lies between its own.
@compute @workgroup_size(8, 8)
fn rescale(@builtin(global_invocation_id) id: vec3u) {
    let size = known_size();
    if any(id.xy >= size) {
        return;
    }
    let scale = vec2f(vec2u(frame.previous_width, frame.previous_height)) / vec2f(vec2u(frame.width, frame.height));
    let at = (pixel_place(vec2f(id.xy) + 0.5) * scale - 0.5) / f32(frame.previous_spacing);
    let corner = vec2i(floor(at));
    let f = at - floor(at);
    let above = mix(history[previous_index(corner)], history[previous_index(corner + vec2i(1, 0))], f.x);
    let below = mix(history[previous_index(corner + vec2i(0, 1))], history[previous_index(corner + 1)], f.x);
    let index = id.y * size.x + id.x;
    clouds[index] = mix(above, below, f.y);
    let nearest = previous_index(vec2i(round(at)));
    cloud_depth[index] = history_depth[nearest];
    // A ray of its own, or as many guesses.
    let past = history_length[nearest];
    followed[index] = select(min(past, ROUND - 1u), ROUND, past == frame.previous_round);
}

fn previous_index(pixel: vec2i) -> u32 {
    let size = known_size_by(vec2u(frame.previous_width, frame.previous_height), frame.previous_spacing);
    let inside = vec2u(clamp(pixel, vec2i(0), vec2i(size) - 1));
    return inside.y * size.x + inside.x;
}

// Where in the picture a place among the known pixels is; both have the centres of theirs at half-integers.
fn pixel_place(place: vec2f) -> vec2f {
    return (place - 0.5) * f32(spacing()) + 0.5;
}

// The pixel of a cell that has been marched.
fn own_pixel() -> vec2i {
    return vec2i(vec2u(frame.subpixel_x, frame.subpixel_y) / spacing());
}

// Whether the frame before has a pixel.
fn was_known(pixel: vec2i) -> bool {
    let has = all(pixel >= vec2i(0)) && all(pixel < vec2i(known_size()));
    return select(in_picture(pixel), has && (CAMERA != FISHEYE || in_picture(i32(TILE) * pixel)), SPARSE);
}

// Fills a pixel of a cell, for what the frame before has in its place; `alone`, it is marched instead.
fn fill(cell: Cell, place: vec2i, old: vec4f, alone: bool) {
    let pixel = cell.corner + place;
    if any(pixel >= vec2i(known_size())) {
        return;
    }
    let subpixel = own_pixel();
    let is_fresh = all(place == subpixel);

    // Marched just now, or, without history, a smooth guess.
    let offset = vec2f(subpixel - place) / f32(STRIDE);
    let x = hats(offset.x);
    let y = hats(offset.y);
    let guess = (cell.above * y.x + cell.level * y.y + cell.below * y.z) * x;
    var value = select(guess, cell.level[1], is_fresh);
    var value_depth = select(cell.distance, cell.own_distance, is_fresh);
    var length = select(1u, ROUND, is_fresh);
    if !is_fresh && cell.seen && was_known(pixel + cell.shift) && is_finite4(old) {
        let past = history_length[pixel_index(pixel + cell.shift)];
        let kept = select(clamp(old, cell.low, cell.high), old, frame.moving == 0u);
        value = select(mix(kept, guess, 1.0 / f32(past + 1u)), kept, past == ROUND);
        value_depth = select(cell.distance, history_depth[pixel_index(pixel)], frame.moving == 0u);
        length = select(min(past + 1u, ROUND - 1u), ROUND, past == ROUND);
    }
    if SCENE && alone && !is_fresh {
        active_rays[atomicAdd(&ray_count, 1u)] = pixel_index(pixel);
        length = ROUND;
    }
    if !is_finite4(value) {
        value = vec4f(0.0, 0.0, 0.0, 1.0);
    }
    let index = pixel_index(pixel);
    clouds[index] = vec4f(max(value.rgb, vec3f(0.0)), saturate(value.a));
    // Thinner than f32 tells from nothing, a cloud may still shine from where it is.
    let clear = value.a >= 1.0 && all(value.rgb <= vec3f(0.0));
    followed[index] = length;
    cloud_depth[index] = select(max(value_depth, 0.0), -1.0, clear);
}

// Whether the scene has an edge among the pixels of a cell, the marched ones around it, and those of the past that are read.
fn has_scene_edge(at: vec2i, corner: vec2i, past_corner: vec2i) -> bool {
    let size = vec2i(vec2u(frame.march_width, frame.sheet_rows));
    var near = NO_SCENE;
    var far = 0.0;
    var i = 0;
    loop {
        // Seven by seven pixels of the past, of which the first four by four are the cell's own now, and the first three
        // by three number its neighbours.
        let place = vec2i(i % 7, i / 7);
        let own = scene_now(corner + min(place, vec2i(STRIDE - 1)));
        let neighbour = clamp(at + min(place, vec2i(2)) - 1, vec2i(0), size - 1);
        let around = scene_distance(marched_pixel(vec2u(neighbour)));
        let past = scene_past(past_corner + place);
        near = min(near, min(own, min(around, past)));
        far = max(far, max(own, max(around, past)));
        if i == 48 {
            break;
        }
        i++;
    }
    return far > SCENE_STEP * near;
}

fn scene_now(pixel: vec2i) -> f32 {
    return textureLoad(scene_depth, scene_texel_of(pixel_index(pixel)), 0).r;
}

fn scene_past(pixel: vec2i) -> f32 {
    return textureLoad(scene_before, scene_texel_of(pixel_index(pixel)), 0).r;
}

// The three marched pixels around a cell in its row.
fn fresh_row(cell: vec2i) -> mat3x4f {
    return mat3x4f(
        fresh[fresh_index(cell - vec2i(1, 0))],
        fresh[fresh_index(cell)],
        fresh[fresh_index(cell + vec2i(1, 0))],
    );
}

fn squares(m: mat3x4f) -> vec4f {
    return m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
}

// Weights of linear interpolation for a marched pixel `offset` cells away, and for those before and after it.
fn hats(offset: f32) -> vec3f {
    return max(1.0 - abs(vec3f(-1.0, 0.0, 1.0) + offset), vec3f(0.0));
}

// Distance of the cloud nearest to the middle of a cell among the nine marched pixels around it, -1 if there is none.
fn nearest_cloud(cell: vec2i) -> f32 {
    let subpixel = vec2f(own_pixel()) + 0.5;
    var distance = -1.0;
    var nearest = 1e9;
    var i = 0;
    loop {
        let neighbour = vec2i(i % 3, i / 3) - 1;
        let offset = vec2f(neighbour) + subpixel / f32(STRIDE) - 0.5;
        let away = dot(offset, offset);
        let depth = fresh_depth[fresh_index(cell + neighbour)];
        if depth >= 0.0 && away < nearest {
            nearest = away;
            distance = depth;
        }
        if i == 8 {
            break;
        }
        i++;
    }
    return distance;
}

fn fresh_index(cell: vec2i) -> u32 {
    let size = vec2i(vec2u(frame.march_width, frame.sheet_rows));
    let inside = vec2u(clamp(cell, vec2i(0), size - 1));
    return inside.y * frame.march_width + inside.x;
}

fn pixel_index(pixel: vec2i) -> u32 {
    let size = vec2i(known_size());
    var inside = clamp(pixel, vec2i(0), size - 1);
    if CAMERA == EQUIRECT && !SPARSE {
        inside.x = (pixel.x % size.x + size.x) % size.x;
    }
    return u32(inside.y * size.x + inside.x);
}

// A row of the frame before, between the pixels across: four values from seven pixels.
fn history_row(at: vec2i, weights: vec4f) -> mat4x4f {
    let p0 = history[pixel_index(at)];
    let p1 = history[pixel_index(at + vec2i(1, 0))];
    let p2 = history[pixel_index(at + vec2i(2, 0))];
    let p3 = history[pixel_index(at + vec2i(3, 0))];
    let p4 = history[pixel_index(at + vec2i(4, 0))];
    let p5 = history[pixel_index(at + vec2i(5, 0))];
    let p6 = history[pixel_index(at + vec2i(6, 0))];
    return mat4x4f(
        mat4x4f(p0, p1, p2, p3) * weights,
        mat4x4f(p1, p2, p3, p4) * weights,
        mat4x4f(p2, p3, p4, p5) * weights,
        mat4x4f(p3, p4, p5, p6) * weights,
    );
}

fn catmull_rom(f: f32) -> vec4f {
    return vec4f(
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    );
}

// NaN would live in the history for ever, and lavapipe optimises x != x away: test the bits (hazard 11).
fn is_finite4(v: vec4f) -> bool {
    return all((bitcast<vec4u>(v) & vec4u(0x7fffffffu)) < vec4u(0x7f800000u));
}
