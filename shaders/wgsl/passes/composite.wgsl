// Compositing: clouds, seen through the air, over the background.
#import bindings
#import workgroups
#import camera
#import atmosphere
#import aerial
#import high_light
#import sample_grid
#import scene_depth
#import ground_shadow

override HIGH: bool = true; // high clouds
override CLOUDLESS: bool = false; // no marched clouds
override GROUND_SHADOW: bool = false; // cloud shadows on the visible ground
override LAYERS: bool = true; // background radiance and depth are outputs too
override DISCS: bool = false; // pixels of a disc of sun or moon (disc.wgsl)
override WIDE: bool = false; // the sky varies within a pixel

// Thresholds on the second difference between corners of cells, above which each pixel of a cell is evaluated, relative
// to the threshold of adaptive sampling. They hold for the brightness of the background and the high clouds (relative
// to the brightest corner), the transmittance of the high clouds, and the brightness of the background alone (relative
// to the brightest corner). The third is lower, as in wide smooth gradients the errors of many pixels have the same
// sign. Interpolation of a smooth function errs by an eighth of its second difference.
const CURVATURE = vec3f(0.1, 0.1, 0.05);
// Maximum spacing of corners on the high clouds, in tiles of their texture, and on shadows on the ground, in texels of
// the shadow clipmap.
const FIBRE = 0.02;
const SHADOW_EDGE = 2.0;
// Markers in place of the distance of the high clouds, m: FINE if a cell is wider than the variation of high clouds or
// shadows, EDGE if it may contain an edge.
const FINE = 1e20;
const EDGE = 1e30;

@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn composite(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    let id = GRID_GROUP * swizzle_rows(group.xy, groups.xy) + local.xy;
    if id.x >= frame.view.width || id.y >= dispatch.rows {
        return;
    }
    compose(vec2u(id.x, dispatch.first_row + id.y));
}

// Pixels with discs of light: `columns` columns from `first_column` on; a panorama wraps around.
@compute @workgroup_size(8, 8)
fn composite_discs(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns || id.y >= dispatch.rows {
        return;
    }
    compose(vec2u((dispatch.first_column + id.x) % frame.view.width, dispatch.first_row + id.y));
}

// Composites a pixel.
fn compose(pixel: vec2u) {
    let index = (pixel.y - dispatch.strip_row) * frame.view.width + pixel.x;
    let view = view_direction(vec2f(pixel) + 0.5);
    if view.w == 0.0 {
        image[index] = vec4f(0.0);
        if LAYERS {
            sky[index] = vec4f(0.0);
            depth[index] = -1.0;
        }
        return;
    }
    let at = vec2u(pixel.x, pixel.y - dispatch.strip_row);
    let here = marched_layer(at / TILE, cell_samples(at / TILE), at.y % TILE * TILE + at.x % TILE);
    let scene = scene_distance(pixel);
    var sight = sight_of(view.xyz, vec2f(pixel), pixel, scene, here);
    if DISCS {
        // Discs, as stored by the kernel `discs`.
        sight.background += select(image[index].rgb, vec3f(0.0), scene < NO_SCENE);
    }
    write_pixel(index, sight);
}

// Mean radiance of the air in a wide pixel: the glow around the sun is narrower than the pixel. The mean is over the
// part of the pixel on the same side of the horizon as its centre.
fn wide_sky(direction: vec3f, corner: vec2f, grounded: bool) -> vec3f {
    if !WIDE {
        return sky_radiance(direction);
    }
    let n = frame.view.sky_samples;
    var sum = vec3f(0.0);
    var whole = 0.0;
    for (var i = 0u; i < n * n; i++) {
        let at = corner + (vec2f(vec2u(i % n, i / n)) + 0.5) / f32(n);
        let there = view_direction(at).xyz;
        let beside = hit_sphere(there, frame.view.power_ground).enters == grounded;
        let weight = select(0.0, place_weight(at), beside);
        sum += weight * sky_radiance(there);
        whole += weight;
    }
    return select(sky_radiance(direction), sum / max(whole, 1e-30), whole > 0.0);
}

// Samples of the marched clouds at the corners of a cell, at low resolution.
struct CellSamples {
    clouds: mat4x4f,
    distance: mat4x2f, // weight times depth, weight
}

fn cell_samples(cell: vec2u) -> CellSamples {
    var found: CellSamples;
    if LOW_RESOLUTION && !CLOUDLESS {
        let columns = sample_count().x;
        let first = cell.y * columns + cell.x;
        found.clouds = mat4x4f(
            clouds[first],
            clouds[first + 1u],
            clouds[first + columns],
            clouds[first + columns + 1u],
        );
        found.distance = mat4x2f(
            weighted_depth(first),
            weighted_depth(first + 1u),
            weighted_depth(first + columns),
            weighted_depth(first + columns + 1u),
        );
    }
    return found;
}

fn weighted_depth(index: u32) -> vec2f {
    let depth = cloud_depth[index];
    return depth_weight(clouds[index].a, depth) * vec2f(depth, 1.0);
}

// Marched clouds at a pixel of a cell, at low resolution interpolated between the corners. The distance is not
// premultiplied.
fn marched_layer(cell: vec2u, samples: CellSamples, i: u32) -> Layer {
    if CLOUDLESS {
        return Layer(vec3f(0.0), 1.0, 0.0);
    }
    if LOW_RESOLUTION {
        let cloud = samples.clouds * corner_shares(i);
        let distance = samples.distance * corner_shares(i);
        return Layer(cloud.rgb, cloud.a, select(0.0, distance.x / distance.y, distance.y > 0.0));
    }
    let at = cell_pixel(TILE * cell, i);
    let index = at.y * frame.view.width + at.x;
    let cloud = clouds[index];
    return Layer(cloud.rgb, cloud.a, max(cloud_depth[index], 0.0));
}

fn write_pixel(index: u32, sight: Sight) {
    if LAYERS {
        sky[index] = vec4f(sight.background, 1.0);
        let covered = 1.0 - sight.seen.transmittance;
        depth[index] = select(-1.0, sight.seen.distance / covered, covered > 0.0);
    }
    let whole = vec4f(sight.seen.radiance + sight.seen.transmittance * sight.background, sight.opacity);
    let clouds_alone = vec4f(sight.seen.radiance, 1.0 - sight.seen.transmittance);
    image[index] = select(clouds_alone, whole, frame.view.background > 0u);
}

// The background of the marched clouds is smooth nearly everywhere, and is evaluated at the corners of cells. Most
// curvature between corners is in the high clouds and the shadows on the ground. In fine cells these two are evaluated
// at each pixel, and sky, ground and air are interpolated. Where these are curved too, or may have an edge, the pixels
// of the cell are evaluated in full.

fn cell_columns() -> u32 {
    return (frame.view.width + TILE - 1u) / TILE;
}

// Cells have one corner more than their number in each direction, and their neighbours one more on either side.
fn corner_index(corner: vec2u) -> u32 {
    return corner.y * (cell_columns() + 3u) + corner.x;
}

// Background of the marched clouds, without the user's scene, at the corners of the cells of a strip and of the cells
// around it.
@compute @workgroup_size(8, 8)
fn background_corners(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= cell_columns() + 3u || id.y >= (dispatch.rows + TILE - 1u) / TILE + 3u {
        return;
    }
    let pixel = (vec2f(id.xy) - 1.0) * f32(TILE) + vec2f(0.0, f32(dispatch.strip_row));
    let view = view_direction(pixel + 0.5);
    let sight = sight_of(view.xyz, pixel, vec2u(0u, dispatch.strip_row), NO_SCENE, Layer(vec3f(0.0), 1.0, 0.0));
    let ground = hit_sphere(view.xyz, frame.view.power_ground);
    var layer = vec4f(sight.seen.radiance, sight.seen.transmittance);
    var distance = sight.seen.distance;
    var air = sight.high_air;
    if ground.enters {
        layer = vec4f(-sight.shadow, 1.0);
        air = Air(sight.sunlight, vec3f(0.0));
    }
    if is_fine(view.xyz, ground) {
        distance = FINE;
    }
    distance = select(distance, -1.0 - distance, ground.enters);
    if view.w == 0.0 {
        distance = EDGE;
    }
    let behind = vec4f(sight.background + sight.shadow, distance);
    const MEAN = vec3f(1.0 / 3.0);
    corners[corner_index(id.xy)] = mat4x4f(
        layer,
        behind,
        vec4f(air.transmittance, dot(layer.rgb + layer.a * behind.rgb, MEAN)),
        vec4f(air.radiance, dot(behind.rgb, MEAN)),
    );
}

// Whether corners are so far apart that they may miss high clouds, or shadows on the ground, between them.
fn is_fine(direction: vec3f, ground: Hit) -> bool {
    var fine = false;
    if HIGH {
        let far = hit_sphere(direction, frame.view.power_high).far;
        let across = cell_across(direction, far, params.high_clouds.altitude);
        fine = !ground.enters && across > FIBRE * params.high_clouds.scale;
    }
    if GROUND_SHADOW {
        let q = ground.near * direction.xy + frame.sky.shadow_eye;
        var most = SHADOW_EDGE * shadow_texel(shadow_level(q, 0.0));
        if HIGH {
            most = min(most, FIBRE * params.high_clouds.scale);
        }
        fine = fine || (ground.enters && cell_across(direction, ground.near, 0.0) > most);
    }
    return fine;
}

// Extent of a cell along a sphere, at the distance where its ray meets the sphere, m.
fn cell_across(direction: vec3f, distance: f32, altitude: f32) -> f32 {
    let cosine = abs(cos_zenith_along(direction, distance, altitude));
    return distance * f32(TILE) * pixel_width(direction) / max(cosine, 1e-6);
}

// Composites the pixels of a cell, or adds the cell to the list.
@compute @workgroup_size(8, 8)
fn composite_cells(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    let id = 8u * swizzle_rows(group.xy, groups.xy) + local.xy;
    let columns = cell_columns();
    if id.x >= columns || id.y >= (dispatch.rows + TILE - 1u) / TILE {
        return;
    }
    let first = vec2u(id.x * TILE, dispatch.strip_row + id.y * TILE);
    // Unrolled: lavapipe keeps arrays that a loop indexes in memory.
    let c0 = corner_index(id.xy + 1u);
    let c1 = c0 + 1u;
    let c2 = corner_index(id.xy + vec2u(1u, 2u));
    let c3 = c2 + 1u;
    let layers = mat4x4f(corners[c0][0], corners[c1][0], corners[c2][0], corners[c3][0]);
    let behind = mat4x4f(corners[c0][1], corners[c1][1], corners[c2][1], corners[c3][1]);
    let air = mat4x4f(corners[c0][2], corners[c1][2], corners[c2][2], corners[c3][2]);
    let haze = mat4x4f(corners[c0][3], corners[c1][3], corners[c2][3], corners[c3][3]);
    let v0 = vec3f(air[0].w, layers[0].w, haze[0].w); // equal to `varied`
    let v1 = vec3f(air[1].w, layers[1].w, haze[1].w);
    let v2 = vec3f(air[2].w, layers[2].w, haze[2].w);
    let v3 = vec3f(air[3].w, layers[3].w, haze[3].w);
    // Curvature is tested at the surrounding corners too: high clouds near the horizon are lower than a cell.
    let above = varied_row(corner_index(id.xy));
    let upper = mat4x3f(varied(c0 - 1u), v0, v1, varied(c1 + 1u));
    let lower = mat4x3f(varied(c2 - 1u), v2, v3, varied(c3 + 1u));
    let below = varied_row(corner_index(id.xy + vec2u(0u, 3u)));
    let along = max(max(bend_along(above), bend_along(upper)), max(bend_along(lower), bend_along(below)));
    let across = max(bend_across(above, upper, lower), bend_across(upper, lower, below));
    let brightest = max(max(v0.x, v1.x), max(v2.x, v3.x));
    let bends = max(along, across) > CURVATURE * params.quality.adaptive_threshold * vec3f(brightest, 1.0, brightest);
    let nearest = min(min(behind[0].w, behind[1].w), min(behind[2].w, behind[3].w));
    let farthest = max(max(behind[0].w, behind[1].w), max(behind[2].w, behind[3].w));
    // The horizon is an edge at any brightness.
    let grounded = farthest < 0.0;
    var edge = farthest >= EDGE || (nearest < 0.0) != grounded || bends.z;
    if SCENE {
        edge = edge || nearest_scene(first) < NO_SCENE;
    }
    let fine = !edge && (max(farthest, -nearest) >= FINE || any(bends));
    let samples = cell_samples(id.xy);
    // Pixels behind opaque clouds need no background, unless it is an output.
    var hidden = false;
    if !LAYERS && !CLOUDLESS {
        hidden = (edge || fine) && (!HIGH || (!VOLUME && frame.sky.shell_top <= params.high_clouds.altitude));
        let c = samples.clouds;
        hidden = hidden && (!LOW_RESOLUTION || all(vec4f(c[0].a, c[1].a, c[2].a, c[3].a) == vec4f(0.0)));
    }
    if !LOW_RESOLUTION && !LAYERS && !CLOUDLESS {
        let last = vec2u(frame.view.width, dispatch.strip_row + dispatch.rows) - 1u;
        var i = 0u;
        // The loop ends early: most cells have a visible background, and smooth cells start with false. Once false,
        // `hidden` stays false, whatever lavapipe computes for a cell that has left the loop.
        loop {
            let pixel = min(cell_pixel(first, i), last);
            hidden = hidden && clouds[(pixel.y - dispatch.strip_row) * frame.view.width + pixel.x].a == 0.0;
            i++;
            if !hidden || i == TILE * TILE {
                break;
            }
        }
    }
    // Each kind of cell has its own loop. Neighbouring cells, which lavapipe runs together, are mostly of one kind:
    // loops of the other kinds have one iteration for them, whereas a branch would be run in full.
    let fine_high = HIGH && fine && !hidden && !grounded;
    let fine_ground = GROUND_SHADOW && fine && !hidden && grounded;
    let smooth_cell = !fine_high && !fine_ground;
    var i = 0u;
    loop {
        if smooth_cell && in_strip(first, i) {
            let layer = layers * corner_shares(i);
            let sky = behind * corner_shares(i);
            // On the ground `layer` is minus the radiance that shadows remove. Hidden cells may have high clouds at
            // some corners and ground at others, and are composited without a layer.
            var high = Layer(select(layer.rgb, vec3f(0.0), grounded), layer.a, sky.w);
            if hidden {
                high = Layer(vec3f(0.0), 1.0, 0.0);
            }
            put_behind(
                strip_index(first, i),
                marched_layer(id.xy, samples, i),
                high,
                sky.rgb + select(vec3f(0.0), layer.rgb, grounded),
            );
        }
        i++;
        if i >= select(1u, TILE * TILE, smooth_cell) {
            break;
        }
    }
    if HIGH {
        var n = 0u;
        loop {
            if fine_high && in_strip(first, n) {
                let direction = view_direction(vec2f(cell_pixel(first, n)) + 0.5).xyz;
                let turned = seen_turn(direction, vec2f(cell_pixel(first, n)));
                let layer = high_layer(direction, hit_sphere(direction, frame.view.power_high).far, true, turned);
                let shares = corner_shares(n);
                let before = Air((air * shares).rgb, (haze * shares).rgb);
                put_behind(
                    strip_index(first, n),
                    marched_layer(id.xy, samples, n),
                    through_air(layer, before),
                    (behind * shares).rgb,
                );
            }
            n++;
            if n >= select(1u, TILE * TILE, fine_high) {
                break;
            }
        }
    }
    if GROUND_SHADOW {
        var n = 0u;
        loop {
            if fine_ground && in_strip(first, n) {
                let direction = view_direction(vec2f(cell_pixel(first, n)) + 0.5).xyz;
                let p = hit_sphere(direction, frame.view.power_ground).near * direction;
                let sun = ground_sun(p, cos_zenith_at(p, frame.sky.sun_direction));
                let shares = corner_shares(n);
                let lit = (behind * shares).rgb - (1.0 - sun) * (air * shares).rgb;
                put_behind(strip_index(first, n), marched_layer(id.xy, samples, n), Layer(vec3f(0.0), 1.0, 0.0), lit);
            }
            n++;
            if n >= select(1u, TILE * TILE, fine_ground) {
                break;
            }
        }
    }
    if edge && !hidden {
        active_rays[atomicAdd(&ray_count, 1u)] = id.y * columns + id.x;
    }
}

// Tested quantities of a corner: brightness of high clouds and background together, transmittance of the high clouds,
// brightness of the background without high clouds and shadows.
fn varied(corner: u32) -> vec3f {
    return vec3f(corners[corner][2].w, corners[corner][0].w, corners[corner][3].w);
}

fn varied_row(first: u32) -> mat4x3f {
    return mat4x3f(varied(first), varied(first + 1u), varied(first + 2u), varied(first + 3u));
}

// Maximum second difference along a row of four corners, and across three rows.
fn bend_along(row: mat4x3f) -> vec3f {
    return max(abs(row[0] - 2.0 * row[1] + row[2]), abs(row[1] - 2.0 * row[2] + row[3]));
}

fn bend_across(a: mat4x3f, b: mat4x3f, c: mat4x3f) -> vec3f {
    let bend = a - 2.0 * b + c;
    return max(max(abs(bend[0]), abs(bend[1])), max(abs(bend[2]), abs(bend[3])));
}

// Pixel `i` of the cell that begins at `first`.
fn cell_pixel(first: vec2u, i: u32) -> vec2u {
    return first + vec2u(i % TILE, i / TILE);
}

fn in_strip(first: vec2u, i: u32) -> bool {
    return all(cell_pixel(first, i) < vec2u(frame.view.width, dispatch.strip_row + dispatch.rows));
}

fn strip_index(first: vec2u, i: u32) -> u32 {
    let pixel = cell_pixel(first, i);
    return (pixel.y - dispatch.strip_row) * frame.view.width + pixel.x;
}

// Interpolation weights of a cell's corners at pixel `i`.
fn corner_shares(i: u32) -> vec4f {
    let share = vec2f(vec2u(i % TILE, i / TILE)) / f32(TILE);
    let rest = 1.0 - share;
    return vec4f(rest.x * rest.y, share.x * rest.y, rest.x * share.y, share.x * share.y);
}

// Writes a pixel: marched clouds in front of or behind the high clouds, both in front of the background.
fn put_behind(index: u32, here: Layer, high: Layer, background: vec3f) {
    var seen = high;
    if !CLOUDLESS {
        let depth = high.distance / max(1.0 - high.transmittance, 1e-6);
        let near = Layer(here.radiance, here.transmittance, (1.0 - here.transmittance) * here.distance);
        seen = over(near, high);
        if HIGH {
            let under = over(high, near);
            let first = depth < here.distance;
            seen = Layer(
                select(seen.radiance, under.radiance, first),
                seen.transmittance,
                select(seen.distance, under.distance, first),
            );
        }
    }
    write_pixel(index, sight_to(seen, background));
}

// Smallest distance of the user's scene in a cell, m.
fn nearest_scene(first: vec2u) -> f32 {
    let last = vec2u(frame.view.width, dispatch.strip_row + dispatch.rows) - 1u;
    var nearest = NO_SCENE;
    for (var i = 0u; i < TILE * TILE; i++) {
        nearest = min(nearest, scene_distance(min(cell_pixel(first, i), last)));
    }
    return nearest;
}

// Pixels of the listed cells.
@compute @workgroup_size(LIST_GROUP)
fn composite_list(@builtin(global_invocation_id) id: vec3u) {
    let number = dispatch.first_ray + id.x;
    if number >= listed.w {
        return;
    }
    let cell = active_rays[number / (TILE * TILE)];
    let i = number % (TILE * TILE);
    let pixel = TILE * vec2u(cell % cell_columns(), cell / cell_columns()) + vec2u(i % TILE, i / TILE);
    if all(pixel < vec2u(frame.view.width, dispatch.rows)) {
        compose(pixel + vec2u(0u, dispatch.strip_row));
    }
}

// Pixel before it is written: layer of all clouds, background radiance, alpha of the output.
struct Sight {
    seen: Layer,
    background: vec3f,
    opacity: f32,
    // Values for the corners of cells: air and sunlight are smooth where high clouds and shadows are not.
    high_air: Air, // in front of the high clouds
    sunlight: vec3f, // reflected sunlight that clouds may block, seen through the air
    shadow: vec3f, // part of `sunlight` that clouds block
}

// Pixel of clouds in front of a background.
fn sight_to(seen: Layer, background: vec3f) -> Sight {
    return Sight(seen, background, 1.0, Air(vec3f(1.0), vec3f(0.0)), vec3f(0.0), vec3f(0.0));
}

// Pixel at a direction, up to the distance of the user's scene. `corner` is the corner of the pixel at the direction,
// `here` the marched clouds.
fn sight_of(direction: vec3f, corner: vec2f, pixel: vec2u, scene: f32, here: Layer) -> Sight {
    let ground = hit_sphere(direction, frame.view.power_ground);
    var way = AirSegment(0.0, 0.0, ground.enters);
    var texels = AirTexels(vec2f(0.0), vec2f(0.0));
    var sky_behind = vec3f(0.0);
    var air = Air(vec3f(1.0), vec3f(0.0));
    if AIR {
        way = air_segment(direction);
        texels = air_texels(direction);
        sky_behind = wide_sky(direction, corner, ground.enters);
        air = whole_air(direction, way, texels, sky_behind);
    }

    // The marched clouds include the air in front of them.
    var found = sight_to(
        Layer(here.radiance, here.transmittance, (1.0 - here.transmittance) * here.distance),
        air.radiance,
    );
    if HIGH {
        // High clouds at both crossings of their sphere, each in front of or behind the marched clouds. From inside
        // there is one crossing, where the ray leaves. lavapipe runs one iteration of the loop for it; with a branch it
        // would evaluate both crossings.
        let high = hit_sphere(direction, frame.view.power_high);
        let turned = seen_turn(direction, corner);
        var before = Layer(vec3f(0.0), 1.0, 0.0);
        var behind = before;
        var crossing = select(0, 1, frame.view.power_high <= 0.0);
        loop {
            let at = select(high.near, high.far, crossing == 1);
            let hit = high.hit && at > 0.0 && at < scene && !(ground.enters && at > ground.near);
            found.high_air = air_to(direction, at, way, texels, sky_behind);
            let layer = through_air(high_layer(direction, at, hit, turned), found.high_air);
            if at < here.distance {
                before = over(before, layer);
            } else {
                behind = over(behind, layer);
            }
            if crossing == 1 {
                break;
            }
            crossing = 1;
        }
        found.seen = over(over(before, found.seen), behind);
    }

    if ground.enters {
        let p = ground.near * direction;
        let mu = cos_zenith_at(p, frame.sky.sun_direction);
        if GROUND_SHADOW {
            let clear = ground_under(p, mu, 1.0);
            found.background += air.transmittance * clear;
            found.sunlight = air.transmittance * (clear - ground_under(p, mu, 0.0));
            found.shadow = (1.0 - ground_sun(p, mu)) * found.sunlight;
            found.background = max(found.background - found.shadow, vec3f(0.0));
        } else {
            found.background += air.transmittance * ground_radiance(mu);
        }
    }
    if SCENE && scene < NO_SCENE {
        let bright = scene_radiance(pixel);
        let before = air_to(direction, scene, way, texels, sky_behind);
        found.background = through_air(Layer(bright, 0.0, scene), before).radiance;
        if frame.view.scene_lit == 0u {
            // The caller blends the picture with a scene, which is dimmed by clouds and air.
            let white = through_air(Layer(vec3f(1.0), 0.0, scene), before).radiance;
            found.opacity = 1.0 - found.seen.transmittance * dot(white - found.background, LUMINANCE);
        }
    }
    return found;
}

// Fraction of the sun's light that clouds leave a point of the ground.
fn ground_sun(p: vec3f, mu: f32) -> f32 {
    var sun = 1.0;
    if !CLOUDLESS {
        sun = baked_ground_sun(p);
    }
    if HIGH {
        sun *= exp(-high_depth_over(p, mu));
    }
    return sun;
}

// Air in front of a distance on a ray; none without atmosphere.
fn air_to(direction: vec3f, distance: f32, way: AirSegment, texels: AirTexels, sky: vec3f) -> Air {
    if AIR {
        return air_before(direction, distance, way, texels, sky);
    }
    return Air(vec3f(1.0), vec3f(0.0));
}

// Layer seen through the air in front of it.
fn through_air(layer: Layer, air: Air) -> Layer {
    let opacity = 1.0 - layer.transmittance;
    return Layer(
        layer.radiance * air.transmittance + opacity * air.radiance,
        layer.transmittance,
        opacity * layer.distance,
    );
}

fn over(front: Layer, back: Layer) -> Layer {
    return Layer(
        front.radiance + front.transmittance * back.radiance,
        front.transmittance * back.transmittance,
        front.distance + front.transmittance * back.distance,
    );
}
