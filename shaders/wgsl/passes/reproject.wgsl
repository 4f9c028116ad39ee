// Temporal reprojection: a frame from one ray in each cell and from the previous frame (nubis2015, "reprojection").
// "Pixel" in this file is a pixel that holds a sample (sample_grid.wgsl).
//
// `predict` reads the history at the previous position of each new ray. `validate` compares ray and prediction.
// `reproject` reuses the history where it has predicted the rays around, interpolates between rays of low contrast, and
// adds the remaining pixels to the ray list. There is no variance clipping: radiance and transmittance belong together,
// and a pixel is reprojected, interpolated or marched as a whole. An unchanged picture therefore converges to its
// still, and the smaller the change, the closer a frame is to its still.
#import bindings
#import camera
#import shell
#import contrast
#import sample_grid
#import scene_depth

// Samples along each side of a cell: 4, or 2 at low resolution (grid.rs).
override STRIDE: i32 = 4;

// Frames in which every pixel of a cell is marched once. It is the history length of pixels that have been marched and
// reprojected since. The history length of interpolated pixels counts their frames.
override CYCLE: u32 = u32(STRIDE * STRIDE);

// Bounds on the tolerance: the contrast between a ray and its prediction up to which the history around is reprojected.
// Within the bounds it is the threshold of adaptive sampling (`quality.adaptive_threshold`). Error against a picture of
// rays alone and fraction of pixels marched, measured in flights of five scenes at 480x270: with 0.2 5.6 % and 0.099,
// with 0.4 6.4 % and 0.075, with 0.7 7.7 % and 0.066, without a bound 15.5 % and 0.063.
const LEAST_TOLERANCE = 0.1;
const MOST_TOLERANCE = 0.4;

// Contrast between the rays around a pixel without history up to which the pixel is interpolated, relative to
// `quality.adaptive_threshold`. The rays are as far apart as samples of the initial grid of a still, which is refined
// further. In a flight of `fair_weather` the error is 5.9 % with 0.5 and 6.8 % with 1.
const INTERPOLATION_SHARE = 0.5;

// Maximum width of a cell for these thresholds, radians: half a degree, within which no clouds are lost between rays
// (grid.rs). In wider cells rays carry less information about the pixels between them, and all thresholds are lower in
// proportion.
const WIDEST = 0.0087;

// Ghosting test. If rays of low contrast differ from their predictions by more than GHOST times their own contrast, the
// history shows clouds that have disappeared, and interpolation is more accurate. An error below LEAST_GHOST is
// rounding, and invisible.
const GHOST = 4.0;
const LEAST_GHOST = 1e-3;

// Factor on the error of a change of brightness that the gain compensates: slow changes are reprojected, jumps are not.
const JUMP = 0.6;

// Squared ratio of a mean to its standard error below which a change of brightness counts as noise.
const SIGNIFICANT = 4.0;

// Glare: clouds in front of the sun show the forward peak of the phase function of droplets. Outside of GLARE_WIDTH,
// radians, it falls with about the square (GLARE_SLOPE) of the angle to the sun (Jendersie and d'Eon 2023, figure 3).
// As the sun moves, the highlight moves within a cell.
const GLARE_SLOPE = 2.0;
const GLARE_WIDTH = 0.0044;
// Angle to the sun, radians, within which, plus the width of a cell, each pixel is marched: a pixel may be a hundred
// times as bright as its neighbour.
const SPARK = 0.02;

// Maximum parallax, pixels: the distance between the position at which the history was read and the position that its
// depth implies. Beyond it the history belongs to another cloud. In a flight through clouds at 40 m per frame the error
// is 5.7 % without this test and 3.6 % with it.
const PARALLAX = 1.0;

// Maximum ratio of the largest to the smallest distance of the user's scene around a cell, in this frame and the
// previous one. Above it the scene has an edge: rays beside it have ended elsewhere, and neither neighbours nor history
// carry information about a pixel there.
const SCENE_STEP = 1.1;

// Transmittance above which a cell does not vote on whether the frame is a still.
const CLEAR = 0.98;

// Origin of the prediction of a ray (`CellPast.source`).
const UNSEEN = 0u; // outside the previous picture
const INTERPOLATED = 1u;
const MARCHED = 2u;

@compute @workgroup_size(8, 8)
fn predict(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.march_width || id.y >= dispatch.strip_rows {
        return;
    }
    let at = vec2i(id.xy);
    var past: CellPast;
    past.distance = nearest_cloud(at);
    past.ray_distance = current_depth[cell_index(at)];
    // Position in the previous frame of the cloud at this cell. Cells without cloud nearby move like a point at
    // `far_distance`.
    let centre = pixel_place(vec2f(at * STRIDE) + 0.5 * f32(STRIDE));
    let away = select(frame.view.far_distance, past.distance, past.distance >= 0.0);
    let direction = view_direction(centre).xyz;
    let way = frame.view.eye_motion - frame.view.cloud_motion;
    let was = previous_pixel(normalize(away * direction + way));
    past.approach = dot(way, direction);
    past.width = pixel_width(direction) * f32(spacing());
    let sun = acos(clamp(dot(direction, frame.sky.sun_direction), -1.0, 1.0));
    let sun_before = acos(clamp(dot(normalize(away * direction + way), frame.sky.previous_sun), -1.0, 1.0));
    let glare = GLARE_SLOPE * abs(sun - sun_before) / (sun + GLARE_WIDTH);
    past.glare = select(glare, UNKNOWN, sun < SPARK + f32(STRIDE) * past.width);
    // Without motion the position is exactly that of the pixel. In a narrow view, at a pole of a panorama or in a wide
    // picture, rounding of the direction is a good part of a pixel.
    let motion = select(shortest_way(was.xy - centre) / f32(spacing()), vec2f(0.0), frame.view.moving == 0u);
    // Motion by whole pixels reads the history exactly.
    past.motion = select(motion, round(motion), abs(motion - round(motion)) < vec2f(1e-3));

    // The last cells may extend beyond the picture. Their rays are those of its edge; at low resolution they lie beyond
    // it, where nothing is reprojected.
    let cell_pixel = at * STRIDE + own_pixel();
    let pixel = min(cell_pixel, vec2i(sample_count()) - 1);
    let inside = !LOW_RESOLUTION || all(cell_pixel == pixel);
    let shifted = pixel + vec2i(round(past.motion));
    let corner = pixel + vec2i(floor(past.motion)) - 1;
    let across = catmull_rom(fract(past.motion.x));
    let down = catmull_rom(fract(past.motion.y));
    let f = fract(past.motion);
    let a = history_row(corner, across, f.x);
    let b = history_row(corner + vec2i(0, 1), across, f.x);
    let c = history_row(corner + vec2i(0, 2), across, f.x);
    let d = history_row(corner + vec2i(0, 3), across, f.x);
    let cubic = a.cubic[0] * down.x + b.cubic[0] * down.y + c.cubic[0] * down.z + d.cubic[0] * down.w;
    let from_history = limited(cubic, mix(b.linear[0], c.linear[0], f.y), b, c, 0u);
    past.predicted = select(current[cell_index(at)], from_history, inside);
    let seen = (was.z > 0.0 || frame.view.moving == 0u) && was_known(shifted) && is_finite4(past.predicted);
    let length = history_length[pixel_index(shifted)];
    past.source = select(UNSEEN, select(INTERPOLATED, MARCHED, inside && length == CYCLE), seen || !inside);
    cells[cell_index(at)] = past;
}

// Validation of the history: compares the rays of a cell and of those around with their predictions.
@compute @workgroup_size(8, 8)
fn validate(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.march_width || id.y >= dispatch.strip_rows {
        return;
    }
    let at = vec2i(id.xy);
    // Relative change of brightness, (now - before) / (now + before), of the cells around whose predictions have been
    // marched: mean weighted by opacity, and its significance. Each cell contributes a ratio: in a ratio of sums one
    // highlight would outweigh all others.
    var weights = vec2f(0.0); // sums of weights and of their squares
    var sum = vec3f(0.0);
    var moments = vec2f(0.0); // sums for the mean over the channels and for its square
    var i = 0;
    loop {
        let near = cell_index(at + vec2i(i % 3, i / 3) - 1);
        let past = cells[near];
        let ray = current[near];
        if past.source == MARCHED {
            let weight = 1.0 - max(ray.a, past.predicted.a);
            let change = (ray.rgb - past.predicted.rgb) / max(ray.rgb + past.predicted.rgb, vec3f(1e-30));
            let mean = dot(change, vec3f(1.0 / 3.0));
            weights += vec2f(weight, weight * weight);
            sum += weight * change;
            moments += weight * vec2f(mean, mean * mean);
        }
        if i == 8 {
            break;
        }
        i++;
    }
    let index = cell_index(at);
    let past = cells[index];
    let weight = max(weights.x, 1e-6);
    let mean = moments.x / weight;
    // Fraction of the mean that is significant, from its squared standard error (James and Stein 1961).
    let noise = max(moments.y / weight - mean * mean, 0.0) * weights.y / (weight * weight);
    let sure = select(0.0, max(1.0 - SIGNIFICANT * noise / (mean * mean), 0.0), mean != 0.0);
    let change = clamp(sure * sum / weight, vec3f(-MOST_CHANGE), vec3f(MOST_CHANGE));
    let gain = (1.0 + change) / (1.0 - change);

    let ray = current[index];
    let with_gain = vec4f(past.predicted.rgb * gain, past.predicted.a);
    let error = max(contrast_of_two(ray, with_gain), JUMP * contrast_of_two(ray, past.predicted));
    // A clouded cell whose prediction fails has three votes for a still, one whose prediction holds has one vote
    // against it. If more than a fourth fail, none of the history is reused.
    let clouded = past.source != UNSEEN && min(ray.a, past.predicted.a) < CLEAR;
    if clouded {
        atomicAdd(&votes, select(-1, 3, error > tolerance(past)));
    }
    cells[index].gain = gain;
    cells[index].error = select(max(error, past.glare), UNKNOWN, past.source == UNSEEN);
}

// Maximum change of brightness between two frames, (now - before) / (now + before): a factor of four. Beyond it the
// history is useless.
const MOST_CHANGE = 0.6;
// Above any contrast.
const UNKNOWN = 1e9;

// Values shared by the pixels of a cell.
struct Cell {
    corner: vec2i, // its first pixel
    shift: vec2i, // offset to its position in the previous frame, whole pixels
    past: CellPast,
    // Rays of the 3x3 cells around, row by row, and their gains.
    above: mat3x4f,
    level: mat3x4f,
    below: mat3x4f,
    gain_above: mat3x3f,
    gain_level: mat3x3f,
    gain_below: mat3x3f,
    // Values for each quarter of the cell around its marched pixel (`quarter`), from the rays around that quarter:
    // maximum error of the predictions, maximum error of the marched ones, contrast of the rays.
    error: vec4f,
    own_error: vec4f,
    contrast: vec4f,
    tolerance: f32,
}

@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn reproject(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.march_width || id.y * u32(STRIDE) >= dispatch.rows {
        return;
    }
    let at = vec2i(vec2u(id.x, dispatch.first_row / u32(STRIDE) + id.y));
    let cell = read_cell(at);
    let motion = cell.past.motion;
    // History between pixel centres by Catmull-Rom splines: linear interpolation, repeated every frame, would blur.
    // Each row of output uses four rows of the history.
    let corner = cell.corner + vec2i(floor(motion)) - 1;
    let alone = SCENE && frame.view.moving > 0u && has_scene_edge(at, cell.corner, corner);
    let f = fract(motion);
    let across = catmull_rom(f.x);
    let down = catmull_rom(f.y);
    var a = history_row(corner, across, f.x);
    var b = history_row(corner + vec2i(0, 1), across, f.x);
    var c = history_row(corner + vec2i(0, 2), across, f.x);
    var y = 0;
    // The loop tests at its end: lavapipe runs one iteration more of a loop that tests at its start.
    loop {
        let d = history_row(corner + vec2i(0, y + 3), across, f.x);
        let cubic = a.cubic * down.x + b.cubic * down.y + c.cubic * down.z + d.cubic * down.w;
        let linear = b.linear * (1.0 - f.y) + c.linear * f.y;
        fill(cell, vec2i(0, y), limited(cubic[0], linear[0], b, c, 0u), alone);
        fill(cell, vec2i(1, y), limited(cubic[1], linear[1], b, c, 1u), alone);
        if !LOW_RESOLUTION {
            fill(cell, vec2i(2, y), limited(cubic[2], linear[2], b, c, 2u), alone);
            fill(cell, vec2i(3, y), limited(cubic[3], linear[3], b, c, 3u), alone);
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

fn read_cell(at: vec2i) -> Cell {
    var cell: Cell;
    cell.corner = at * STRIDE;
    cell.past = cells[cell_index(at)];
    cell.shift = vec2i(round(cell.past.motion));
    cell.above = fresh_row(at - vec2i(0, 1));
    cell.level = fresh_row(at);
    cell.below = fresh_row(at + vec2i(0, 1));
    let above = past_row(at - vec2i(0, 1));
    let level = past_row(at);
    let below = past_row(at + vec2i(0, 1));
    cell.gain_above = above.gain;
    cell.gain_level = level.gain;
    cell.gain_below = below.gain;
    cell.error = largest(above.error, level.error, below.error);
    cell.own_error = largest(above.own_error, level.own_error, below.own_error);
    let light = mat3x3f(brightest(cell.above), brightest(cell.level), brightest(cell.below));
    let most = largest(light[0], light[1], light[2]);
    let least = -largest(-light[0], -light[1], -light[2]);
    let clear = mat3x3f(alphas(cell.above), alphas(cell.level), alphas(cell.below));
    let clearest = largest(clear[0], clear[1], clear[2]);
    let thickest = -largest(-clear[0], -clear[1], -clear[2]);
    cell.contrast = vec4f(
        contrast(vec2f(least.x, most.x), vec2f(thickest.x, clearest.x)),
        contrast(vec2f(least.y, most.y), vec2f(thickest.y, clearest.y)),
        contrast(vec2f(least.z, most.z), vec2f(thickest.z, clearest.z)),
        contrast(vec2f(least.w, most.w), vec2f(thickest.w, clearest.w)),
    );
    // Pixels beyond the outermost rays are not interpolated.
    let last = vec2i(vec2u(dispatch.march_width, dispatch.strip_rows)) - 1;
    let wraps = CAMERA == EQUIRECT && !LOW_RESOLUTION;
    let outside = vec4<bool>(at.y == 0, at.y == last.y, at.x == 0 && !wraps, at.x == last.x && !wraps);
    cell.contrast = select(cell.contrast, vec4f(UNKNOWN), outside.xxyy | outside.zwzw);
    cell.tolerance = tolerance(cell.past);
    return cell;
}

// Maximum contrast between ray and prediction for reprojection.
fn tolerance(past: CellPast) -> f32 {
    return clamp(params.quality.adaptive_threshold, LEAST_TOLERANCE, MOST_TOLERANCE) * narrowness(past);
}

fn narrowness(past: CellPast) -> f32 {
    return min(WIDEST / (f32(STRIDE) * past.width), 1.0);
}

struct PastRow {
    gain: mat3x3f,
    error: vec3f,
    own_error: vec3f,
}

fn past_row(cell: vec2i) -> PastRow {
    let a = cells[cell_index(cell - vec2i(1, 0))];
    let b = cells[cell_index(cell)];
    let c = cells[cell_index(cell + vec2i(1, 0))];
    let error = vec3f(a.error, b.error, c.error);
    let guessed = vec3<bool>(a.source == INTERPOLATED, b.source == INTERPOLATED, c.source == INTERPOLATED);
    return PastRow(mat3x3f(a.gain, b.gain, c.gain), error, select(error, vec3f(0.0), guessed));
}

// Maximum around each quarter of a cell: above its pixel left and right, below it left and right.
fn largest(above: vec3f, level: vec3f, below: vec3f) -> vec4f {
    let a = max(above.xy, above.yz);
    let b = max(level.xy, level.yz);
    let c = max(below.xy, below.yz);
    return vec4f(max(a, b), max(b, c));
}

fn brightest(row: mat3x4f) -> vec3f {
    return vec3f(brightness(row[0]), brightness(row[1]), brightness(row[2]));
}

fn alphas(row: mat3x4f) -> vec3f {
    return vec3f(row[0].a, row[1].a, row[2].a);
}

// Value of the quarter that contains a pixel of the cell.
fn quarter(numbers: vec4f, place: vec2i) -> f32 {
    let row = select(numbers.zw, numbers.xy, place.y < own_pixel().y);
    return select(row.y, row.x, place.x < own_pixel().x);
}

// Limiter of cubic interpolation: the value between linear and cubic interpolation that is closest to cubic and has all
// channels within the range of the four pixels around. Without it edges have rings, and clouds are black where radiance
// and transmittance overshoot by different fractions. `above` and `below` are the rows of the four pixels, `x` is the
// column.
fn limited(cubic: vec4f, linear: vec4f, above: HistoryRow, below: HistoryRow, x: u32) -> vec4f {
    let beyond = cubic - linear;
    let low = min(above.low[x], below.low[x]) - linear;
    let high = max(above.high[x], below.high[x]) - linear;
    let room = select(low, high, beyond > vec4f(0.0));
    let share = select(vec4f(1.0), room / beyond, abs(beyond) > abs(room));
    return linear + min(min(share.x, share.y), min(share.z, share.w)) * beyond;
}

// Decision whether the frame is a still: if more than a fourth of the predictions fail, or if more pixels are listed
// than a still marches (`most_listed`). The ray list is empty then.
@compute @workgroup_size(1)
fn choose() {
    is_still = select(0u, 1u, atomicLoad(&votes) > 0 || f32(atomicLoad(&ray_count)) > most_listed.x);
    if is_still != 0u {
        atomicStore(&ray_count, 0u);
    }
}

// History length of a still, for the frames after it. Samples of its initial grid have been marched. The other pixels
// are interpolated, or their rays have searched for cloud only in the range of their neighbours (passes/refine).
@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn begin(@builtin(global_invocation_id) id: vec3u) {
    let size = sample_count();
    if any(id.xy >= size) {
        return;
    }
    let on_grid = (id.xy % dispatch.grid_spacing == vec2u(0u)) | (id.xy == size - 1u);
    followed[id.y * size.x + id.x] = select(CYCLE - 1u, CYCLE, all(on_grid));
}

// History resampled to the size and the sample spacing of this frame.
@compute @workgroup_size(8, 8)
fn rescale(@builtin(global_invocation_id) id: vec3u) {
    let size = sample_count();
    if any(id.xy >= size) {
        return;
    }
    let before = vec2f(vec2u(frame.view.previous_width, frame.view.previous_height));
    let scale = before / vec2f(vec2u(frame.view.width, frame.view.height));
    let at = (pixel_place(vec2f(id.xy) + 0.5) * scale - 0.5) / f32(frame.view.previous_spacing);
    let corner = vec2i(floor(at));
    let f = at - floor(at);
    let above = mix(history[previous_index(corner)], history[previous_index(corner + vec2i(1, 0))], f.x);
    let below = mix(history[previous_index(corner + vec2i(0, 1))], history[previous_index(corner + 1)], f.x);
    let index = id.y * size.x + id.x;
    clouds[index] = mix(above, below, f.y);
    let nearest = previous_index(vec2i(round(at)));
    cloud_depth[index] = history_depth[nearest];
    // CYCLE for marched pixels; for interpolated ones their number of frames.
    let past = history_length[nearest];
    followed[index] = select(min(past, CYCLE - 1u), CYCLE, past == frame.view.previous_cycle);
}

fn previous_index(pixel: vec2i) -> u32 {
    let size = sample_count_by(
        vec2u(frame.view.previous_width, frame.view.previous_height),
        frame.view.previous_spacing,
    );
    let inside = vec2u(clamp(pixel, vec2i(0), vec2i(size) - 1));
    return inside.y * size.x + inside.x;
}

// Position in the picture of a position on the sample grid, both in pixels with centres at half-integers.
fn pixel_place(place: vec2f) -> vec2f {
    return (place - 0.5) * f32(spacing()) + 0.5;
}

// Pixel of a cell that is marched in this frame.
fn own_pixel() -> vec2i {
    return vec2i(vec2u(dispatch.subpixel_x, dispatch.subpixel_y) / spacing());
}

// Whether the previous frame has a pixel.
fn was_known(pixel: vec2i) -> bool {
    let has = all(pixel >= vec2i(0)) && all(pixel < vec2i(sample_count()));
    return select(in_picture(pixel), has && (CAMERA != FISHEYE || in_picture(i32(TILE) * pixel)), LOW_RESOLUTION);
}

// Fills a pixel of a cell. `old` is the history at its previous position; with `alone` the pixel is marched without use
// of history and neighbours.
fn fill(cell: Cell, place: vec2i, old: vec4f, alone: bool) {
    let pixel = cell.corner + place;
    if any(pixel >= vec2i(sample_count())) {
        return;
    }
    let index = pixel_index(pixel);
    let subpixel = own_pixel();
    let is_current = all(place == subpixel);

    // Interpolation of the rays around and of their gains at this pixel.
    let offset = vec2f(subpixel - place) / f32(STRIDE);
    let x = hats(offset.x);
    let y = hats(offset.y);
    let guess = (cell.above * y.x + cell.level * y.y + cell.below * y.z) * x;
    let gain = (cell.gain_above * y.x + cell.gain_level * y.y + cell.gain_below * y.z) * x;

    let shifted = pixel + cell.shift;
    let length = history_length[pixel_index(shifted)];
    let depth = history_depth[pixel_index(shifted)];
    let error = select(quarter(cell.error, place), quarter(cell.own_error, place), length == CYCLE);
    let contrast = quarter(cell.contrast, place);
    let least = INTERPOLATION_SHARE * params.quality.adaptive_threshold * narrowness(cell.past);
    let alike = contrast <= least;
    let ghost = alike && error > max(GHOST * contrast, LEAST_GHOST);
    let seen = was_known(shifted) && is_finite4(old);
    let followed_value = vec4f(old.rgb * gain, old.a);
    // A cloud smaller than a cell is in the history alone, or has disappeared. The pixel is marched if history and
    // interpolation differ.
    let agreed = !seen || contrast_of_two(followed_value, guess) <= least;
    let follows = !ghost && seen && error <= cell.tolerance && parallax(cell, depth) <= PARALLAX;

    var value = guess;
    var value_depth = cell.past.distance;
    var value_length = 1u;
    if is_current {
        value = cell.level[1];
        value_depth = cell.past.ray_distance;
        value_length = CYCLE;
    } else if (SCENE && alone) || !(follows || (alike && agreed)) {
        active_rays[atomicAdd(&ray_count, 1u)] = index;
        value_length = CYCLE;
    } else if follows {
        value = followed_value;
        value_depth = select(cell.past.distance, depth - cell.past.approach, depth >= 0.0);
        value_length = select(min(length + 1u, CYCLE - 1u), CYCLE, length == CYCLE);
    }
    if !is_finite4(value) {
        value = vec4f(0.0, 0.0, 0.0, 1.0);
    }
    clouds[index] = vec4f(max(value.rgb, vec3f(0.0)), saturate(value.a));
    // A cloud whose opacity is below the precision of f32 may have radiance, and keeps its depth.
    let clear = value.a >= 1.0 && all(value.rgb <= vec3f(0.0));
    followed[index] = value_length;
    cloud_depth[index] = select(max(value_depth, 0.0), -1.0, clear);
}

// Upper bound of the parallax of a cloud at a depth relative to the cell, pixels.
fn parallax(cell: Cell, depth: f32) -> f32 {
    let far = vec2f(frame.view.far_distance);
    let distances = vec2f(depth, cell.past.distance);
    let inverse = 1.0 / max(select(far, distances, distances >= vec2f(0.0)), vec2f(1.0));
    let way = length(frame.view.eye_motion - frame.view.cloud_motion);
    return way * abs(inverse.x - inverse.y) / cell.past.width;
}

// Whether the scene has an edge among the pixels of a cell, the marched pixels around it and the history that the cell
// reads.
fn has_scene_edge(at: vec2i, corner: vec2i, past_corner: vec2i) -> bool {
    let size = vec2i(vec2u(dispatch.march_width, dispatch.strip_rows));
    var near = NO_SCENE;
    var far = 0.0;
    var i = 0;
    loop {
        // 7x7 pixels of the history. The first 4x4 of the places are also those of the cell's own pixels, the first 3x3
        // those of its neighbours.
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

// Marched pixels of three cells in a row, around a cell.
fn fresh_row(cell: vec2i) -> mat3x4f {
    return mat3x4f(
        current[cell_index(cell - vec2i(1, 0))],
        current[cell_index(cell)],
        current[cell_index(cell + vec2i(1, 0))],
    );
}

// Weights of linear interpolation for the marched pixel `offset` cells away, in the middle, and for the ones before and
// after it.
fn hats(offset: f32) -> vec3f {
    return max(1.0 - abs(vec3f(-1.0, 0.0, 1.0) + offset), vec3f(0.0));
}

// Distance of the cloud closest to the centre of a cell among the 3x3 marched pixels around it, m, -1 if there is none.
fn nearest_cloud(cell: vec2i) -> f32 {
    let subpixel = vec2f(own_pixel()) + 0.5;
    var distance = -1.0;
    var nearest = 1e9;
    var i = 0;
    loop {
        let neighbour = vec2i(i % 3, i / 3) - 1;
        let offset = vec2f(neighbour) + subpixel / f32(STRIDE) - 0.5;
        let away = dot(offset, offset);
        let depth = current_depth[cell_index(cell + neighbour)];
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

fn cell_index(cell: vec2i) -> u32 {
    let size = vec2i(vec2u(dispatch.march_width, dispatch.strip_rows));
    var inside = clamp(cell, vec2i(0), size - 1);
    if CAMERA == EQUIRECT && !LOW_RESOLUTION {
        inside.x = (cell.x + size.x) % size.x;
    }
    return u32(inside.y * size.x + inside.x);
}

fn pixel_index(pixel: vec2i) -> u32 {
    let size = vec2i(sample_count());
    var inside = clamp(pixel, vec2i(0), size - 1);
    if CAMERA == EQUIRECT && !LOW_RESOLUTION {
        inside.x = (pixel.x % size.x + size.x) % size.x;
    }
    return u32(inside.y * size.x + inside.x);
}

// Four interpolated values along a row of the history, from seven pixels.
struct HistoryRow {
    cubic: mat4x4f,
    linear: mat4x4f,
    low: mat4x4f, // minimum of the two pixels around each value
    high: mat4x4f,
}

fn history_row(at: vec2i, weights: vec4f, f: f32) -> HistoryRow {
    let p0 = history[pixel_index(at)];
    let p1 = history[pixel_index(at + vec2i(1, 0))];
    let p2 = history[pixel_index(at + vec2i(2, 0))];
    let p3 = history[pixel_index(at + vec2i(3, 0))];
    let p4 = history[pixel_index(at + vec2i(4, 0))];
    let p5 = history[pixel_index(at + vec2i(5, 0))];
    let p6 = history[pixel_index(at + vec2i(6, 0))];
    return HistoryRow(
        mat4x4f(
            mat4x4f(p0, p1, p2, p3) * weights,
            mat4x4f(p1, p2, p3, p4) * weights,
            mat4x4f(p2, p3, p4, p5) * weights,
            mat4x4f(p3, p4, p5, p6) * weights,
        ),
        mat4x4f(mix(p1, p2, f), mix(p2, p3, f), mix(p3, p4, f), mix(p4, p5, f)),
        mat4x4f(min(p1, p2), min(p2, p3), min(p3, p4), min(p4, p5)),
        mat4x4f(max(p1, p2), max(p2, p3), max(p3, p4), max(p4, p5)),
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

// NaN in the history persists for ever, and lavapipe optimises x != x away. The bits are tested instead
// (docs/numerics.md).
fn is_finite4(v: vec4f) -> bool {
    return all((bitcast<vec4u>(v) & vec4u(0x7fffffffu)) < vec4u(0x7f800000u));
}
