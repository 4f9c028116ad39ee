// Puts the clouds, seen through the air, before the sky: what the caller gets.
#import bindings
#import camera
#import atmosphere
#import light
#import high_layer
#import scene_depth
#import ground_shadow

override HIGH: bool = true; // there are high clouds
override HIGH_EMBOSS: bool = false; // they are embossed, and the sun shines on them
override HIGH_LOW_SUN: bool = true; // the sun is so low that it shines on each of them in its own way
override CLOUDLESS: bool = false; // nothing has been marched
override GROUND_SHADOW: bool = false; // clouds cast shadows on the ground in sight
override LAYERS: bool = true; // the sky and the depth are asked for

// The sun's angular radius, 0.2666 degrees (IAU: 695 700 km at 1 au).
const SUN_RADIUS = 0.004654;
// Exponents of the cosine at the sun's surface by which its limb darkens, at 680, 550 and 440 nm (Hestroffer and Magnan
// 1998, after Hillaire 2016).
const LIMB = vec3f(0.397, 0.503, 0.652);

// Height above or below the high clouds at which an eye sees all of them, m. Short, as a place in the sky without them is
// wrong too, and long enough that a level ray, which meets 50 times the layer, changes by 25 % a metre at the default.
const HIGH_FADE = 100.0;

// Pixels of a cell in each direction (as in composite.rs).
const TILE = 4u;
// Second difference of radiance and transmittance between corners of cells past which each pixel of a cell is worked out: as a
// share of the contrast past which clouds are marched, of the brightest corner. What is smooth errs by an eighth of it.
const CURVATURE = 0.1;
// Most of the high clouds between corners, in tiles of their texture, and of shadows on the ground, in their texels.
const FIBRE = 0.02;
const SHADOW_EDGE = 2.0;
// What stands for the distance of high clouds where a cell may hide an edge, m.
const EDGE = 1e30;

// Luminance of Rec. 709 red, green and blue.
const LUMINANCE = vec3f(0.2126, 0.7152, 0.0722);

// A sheet of light and shade at a distance, or several as one.
struct Layer {
    radiance: vec3f, // premultiplied
    transmittance: f32,
    distance: f32, // times opacity once it is seen
}

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width || id.y >= frame.rows {
        return;
    }
    compose(vec2u(id.x, frame.first_row + id.y));
}

// A pixel of the picture.
fn compose(pixel: vec2u) {
    let index = (pixel.y - frame.sheet_row) * frame.width + pixel.x;
    let view = view_direction(vec2f(pixel) + 0.5);
    if view.w == 0.0 {
        image[index] = vec4f(0.0);
        if LAYERS {
            sky[index] = vec4f(0.0);
            depth[index] = -1.0;
        }
        return;
    }
    var here = Layer(vec3f(0.0), 1.0, 0.0);
    if !CLOUDLESS {
        here = marched_layer(index);
    }
    put(index, sight_of(view.xyz, pixel, scene_distance(pixel), here));
}

// What has been marched, its distance as it is.
fn marched_layer(index: u32) -> Layer {
    let cloud = clouds[index];
    return Layer(cloud.rgb, cloud.a, max(cloud_depth[index], 0.0));
}

fn put(index: u32, sight: Sight) {
    if LAYERS {
        sky[index] = vec4f(sight.background, 1.0);
        let covered = 1.0 - sight.seen.transmittance;
        depth[index] = select(-1.0, sight.seen.distance / covered, covered > 0.0);
    }
    let whole = vec4f(sight.seen.radiance + sight.seen.transmittance * sight.background, sight.opacity);
    image[index] = select(vec4f(sight.seen.radiance, 1.0 - sight.seen.transmittance), whole, frame.background > 0u);
}

// What is behind the marched clouds is smooth nearly everywhere: it is worked out at the corners of cells, and between them
// where it bends.

fn cell_columns() -> u32 {
    return (frame.width + TILE - 1u) / TILE;
}

// Cells have a corner more than there are in each direction, and their neighbours one on either side.
fn corner_index(corner: vec2u) -> u32 {
    return corner.y * (cell_columns() + 3u) + corner.x;
}

// What is behind the marched clouds, and the user's scene, at the corners of the cells of a sheet and of those around it.
@compute @workgroup_size(8, 8)
fn backdrop(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= cell_columns() + 3u || id.y >= (frame.rows + TILE - 1u) / TILE + 3u {
        return;
    }
    let pixel = (vec2f(id.xy) - 1.0) * f32(TILE) + vec2f(0.0, f32(frame.sheet_row));
    let view = view_direction(pixel + 0.5);
    let sight = sight_of(view.xyz, vec2u(0u, frame.sheet_row), NO_SCENE, Layer(vec3f(0.0), 1.0, 0.0));
    let ground = hit_sphere(view.xyz, frame.power_ground);
    var distance = select(sight.seen.distance, -1.0 - sight.seen.distance, ground.enters);
    if view.w == 0.0 || hides_edge(view.xyz, ground) {
        distance = EDGE;
    }
    let high = vec4f(sight.seen.radiance, sight.seen.transmittance);
    corners[corner_index(id.xy)] = mat2x4f(high, vec4f(sight.background, distance));
}

// Whether corners so far apart may miss an edge between them: the sun's disc, and, toward the horizon, high clouds and shadows.
fn hides_edge(direction: vec3f, ground: Hit) -> bool {
    let near_sun = SUN_RADIUS + f32(2u * TILE) * pixel_width();
    var hides = one_minus_cos(direction, frame.sun_direction) < 0.5 * near_sun * near_sun;
    if HIGH {
        let far = hit_sphere(direction, frame.power_high).far;
        let across = cell_across(direction, far, params.high_clouds.altitude);
        hides = hides || (!ground.enters && across > FIBRE * params.high_clouds.scale);
    }
    if GROUND_SHADOW {
        let q = ground.near * direction.xy + frame.shadow_eye;
        var fine = SHADOW_EDGE * shadow_texel(shadow_level(q, 0.0));
        if HIGH {
            fine = min(fine, FIBRE * params.high_clouds.scale);
        }
        hides = hides || (ground.enters && cell_across(direction, ground.near, 0.0) > fine);
    }
    return hides;
}

// How far a cell reaches along a sphere that its ray meets at a distance, m.
fn cell_across(direction: vec3f, distance: f32, altitude: f32) -> f32 {
    let cosine = abs(cos_zenith_along(direction, distance, altitude));
    return distance * f32(TILE) * pixel_width() / max(cosine, 1e-6);
}

// Puts the clouds of a cell before what lies behind them, or lists it.
@compute @workgroup_size(8, 8)
fn composite_cells(@builtin(global_invocation_id) id: vec3u) {
    let columns = cell_columns();
    if id.x >= columns || id.y >= (frame.rows + TILE - 1u) / TILE {
        return;
    }
    let first = vec2u(id.x * TILE, frame.sheet_row + id.y * TILE);
    var high: mat4x4f; // of the four corners
    var behind: mat4x4f;
    var bend = vec4f(0.0);
    var brightest = 0.0;
    var nearest = EDGE;
    var farthest = -EDGE;
    // It shows at the corners of the cells around too: high clouds near the horizon are lower than a cell.
    var before: mat4x4f;
    var earlier: mat4x4f;
    var k = 0u;
    loop {
        var row: mat4x4f;
        for (var j = 0u; j < 4u; j++) {
            let both = corners[corner_index(id.xy + vec2u(j, k))];
            let layer = both[0];
            let sky = both[1];
            row[j] = vec4f(layer.rgb + layer.a * sky.rgb, layer.a);
            brightest = max(brightest, max(max(row[j].r, row[j].g), row[j].b));
            if (j == 1u || j == 2u) && (k == 1u || k == 2u) {
                let corner = 2u * (k - 1u) + j - 1u;
                high[corner] = layer;
                behind[corner] = sky;
                nearest = min(nearest, sky.a);
                farthest = max(farthest, sky.a);
            }
        }
        bend = max(bend, max(abs(row[0] - 2.0 * row[1] + row[2]), abs(row[1] - 2.0 * row[2] + row[3])));
        if k >= 2u {
            for (var j = 0u; j < 4u; j++) {
                bend = max(bend, abs(row[j] - 2.0 * before[j] + earlier[j]));
            }
        }
        if k == 3u {
            break;
        }
        earlier = before;
        before = row;
        k++;
    }
    // The horizon is an edge, however bright.
    var smooth_cell = farthest < EDGE && (nearest < 0.0) == (farthest < 0.0)
        && all(bend <= CURVATURE * quality.contrast * vec4f(vec3f(brightest), 1.0));
    if SCENE {
        smooth_cell = smooth_cell && nearest_scene(first) >= NO_SCENE;
    }
    // Nor does it matter what opaque clouds hide, but to who asks for the sky.
    var hidden = !LAYERS && !CLOUDLESS && (!HIGH || (!VOLUME && frame.shell_top <= params.high_clouds.altitude));
    var i = 0u;
    loop {
        let place = vec2u(i % TILE, i / TILE);
        let pixel = first + place;
        if all(pixel < vec2u(frame.width, frame.sheet_row + frame.rows)) {
            let index = (pixel.y - frame.sheet_row) * frame.width + pixel.x;
            let share = vec2f(place) / f32(TILE);
            let rest = 1.0 - share;
            let shares = vec4f(rest.x * rest.y, share.x * rest.y, rest.x * share.y, share.x * share.y);
            let layer = high * shares;
            let sky = behind * shares;
            let far = Layer(layer.rgb, layer.a, select(sky.a, -1.0 - sky.a, sky.a < 0.0));
            var seen = far;
            if !CLOUDLESS {
                let here = marched_layer(index);
                hidden = hidden && here.transmittance == 0.0;
                let depth = far.distance / max(1.0 - far.transmittance, 1e-6);
                let near = Layer(here.radiance, here.transmittance, (1.0 - here.transmittance) * here.distance);
                seen = over(near, far);
                if HIGH {
                    let under = over(far, near);
                    let first = depth < here.distance;
                    seen = Layer(
                        select(seen.radiance, under.radiance, first),
                        seen.transmittance,
                        select(seen.distance, under.distance, first),
                    );
                }
            }
            put(index, Sight(seen, sky.rgb, 1.0));
        }
        if i == TILE * TILE - 1u {
            break;
        }
        i++;
    }
    if !smooth_cell && !hidden {
        active_rays[atomicAdd(&ray_count, 1u)] = id.y * columns + id.x;
    }
}

// How near the user's scene comes in a cell.
fn nearest_scene(first: vec2u) -> f32 {
    let last = vec2u(frame.width, frame.sheet_row + frame.rows) - 1u;
    var nearest = NO_SCENE;
    for (var i = 0u; i < TILE * TILE; i++) {
        nearest = min(nearest, scene_distance(min(first + vec2u(i % TILE, i / TILE), last)));
    }
    return nearest;
}

// The pixels of the cells of the list.
@compute @workgroup_size(64)
fn composite_list(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.active_rays {
        return;
    }
    let number = frame.first_ray + id.x;
    let cell = active_rays[number / (TILE * TILE)];
    let i = number % (TILE * TILE);
    let pixel = TILE * vec2u(cell % cell_columns(), cell / cell_columns()) + vec2u(i % TILE, i / TILE);
    if all(pixel < vec2u(frame.width, frame.rows)) {
        compose(pixel + vec2u(0u, frame.sheet_row));
    }
}

// What a pixel sees: all clouds, what is behind them, and how much of that is ours to say.
struct Sight {
    seen: Layer,
    background: vec3f,
    opacity: f32,
}

// What is seen in a direction, with the clouds that were marched there, to the user's scene at a pixel.
fn sight_of(direction: vec3f, pixel: vec2u, scene: f32, here: Layer) -> Sight {
    let ground = hit_sphere(direction, frame.power_ground);
    var way = Way(0.0, 0.0, ground.enters);
    var texels = AirTexels(vec2f(0.0), vec2f(0.0));
    var sky_behind = vec3f(0.0);
    var air = Air(vec3f(1.0), vec3f(0.0));
    if AIR {
        way = air_way(direction);
        texels = air_texels(direction);
        sky_behind = sky_radiance(direction);
        air = whole_air(direction, way, texels, sky_behind);
    }

    // The march has seen them through the air.
    var seen = Layer(here.radiance, here.transmittance, (1.0 - here.transmittance) * here.distance);
    if HIGH {
        // The high clouds where the ray enters their sphere, which it cannot from inside, and where it leaves it; each
        // before or behind the clouds. The loop costs lavapipe one of the two where there is one, a branch both.
        let high = hit_sphere(direction, frame.power_high);
        var before = Layer(vec3f(0.0), 1.0, 0.0);
        var behind = before;
        var crossing = select(0, 1, frame.power_high <= 0.0);
        loop {
            let at = select(high.near, high.far, crossing == 1);
            let hit = high.hit && at > 0.0 && at < scene && !(ground.enters && at > ground.near);
            let layer = through_air(high_layer(direction, at, hit), direction, way, texels, sky_behind);
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
        seen = over(over(before, seen), behind);
    }

    var background = air.radiance;
    if ground.enters {
        let p = ground.near * direction;
        var lit = ground_seen(p);
        if GROUND_SHADOW {
            lit = ground_in_shadow(lit, p);
        }
        background += air.transmittance * lit;
    } else if params.sun.visible > 0u {
        background += air.transmittance * sun_disc(direction);
    }
    var opacity = 1.0;
    if SCENE && scene < NO_SCENE {
        let bright = scene_radiance(pixel);
        background = through_air(Layer(bright, 0.0, scene), direction, way, texels, sky_behind).radiance;
        if frame.scene_lit == 0u {
            // The caller puts a scene of his own behind: what he adds is dimmed by cloud and air.
            let white = through_air(Layer(vec3f(1.0), 0.0, scene), direction, way, texels, sky_behind).radiance;
            opacity = 1.0 - seen.transmittance * dot(white - background, LUMINANCE);
        }
    }
    return Sight(seen, background, opacity);
}

// The ground without the sun that clouds keep from it.
fn ground_in_shadow(lit: vec3f, p: vec3f) -> vec3f {
    let mu = cos_zenith_at(p, frame.sun_direction);
    var sun = 1.0;
    if !CLOUDLESS {
        sun = baked_ground_sun(p);
    }
    if HIGH {
        sun *= exp(-high_depth_over(p, mu));
    }
    // As in `ground_radiance`.
    let direct = sun_irradiance(0.0, mu) * max(mu, 0.0);
    return max(lit - (1.0 - PASSED_ON) * (1.0 - sun) * params.atmosphere.ground_albedo / PI * direct, vec3f(0.0));
}

fn ground_seen(p: vec3f) -> vec3f {
    if AIR {
        return ground_radiance(cos_zenith_at(p, frame.sun_direction));
    }
    return vec3f(0.0);
}

// A layer at a distance behind the air in front of it.
fn through_air(layer: Layer, direction: vec3f, way: Way, texels: AirTexels, sky: vec3f) -> Layer {
    let opacity = 1.0 - layer.transmittance;
    if !AIR {
        return Layer(layer.radiance, layer.transmittance, opacity * layer.distance);
    }
    let air = air_before(direction, layer.distance, way, texels, sky);
    let radiance = layer.radiance * air.transmittance + opacity * air.radiance;
    return Layer(radiance, layer.transmittance, opacity * layer.distance);
}

fn over(front: Layer, back: Layer) -> Layer {
    return Layer(
        front.radiance + front.transmittance * back.radiance,
        front.transmittance * back.transmittance,
        front.distance + front.transmittance * back.distance,
    );
}

// Smallest cosine that counts for the way of sunlight through the high clouds: they are 300 m thick (thesis2018: 200 to
// 400 m) and some 1500 m wide, so that light that comes in at their sides never goes more than five times their thickness.
const HIGH_GRAZING = 0.2;
// Sine of the sun's height above their plane, up or down, within which its light comes in at their sides: 3 degrees.
const HIGH_SIDE = 0.05;
// Sines of the sun's height between which it goes over to shine on all of them as it does overhead: 12 and 20 degrees (as in
// frame.rs).
const LOW_SUN = vec2f(0.208, 0.342);
// How much of the light from above a cloud of optical depth 1 turns back: 3/4 (1 - g), two streams, with g = 0.85 of
// droplets (Hansen 1971).
const HIGH_ALBEDO = 0.11;
// How much brighter, or darker, what is embossed is at most, and the relief that gives half of that.
const EMBOSS_GAIN = 0.9;
const EMBOSS_HALF = 0.15;

// The high clouds where a ray crosses their sphere, or nothing.
fn high_layer(direction: vec3f, distance: f32, visible: bool) -> Layer {
    // What is not seen reads the texture in one place, from the cache.
    let p = select(vec3f(0.0), distance * direction, visible);
    let cosine = cos_zenith_along(direction, distance, params.high_clouds.altitude);
    // An eye that climbs through a layer without thickness would see it jump from above to below: near it, it fades.
    let fade = saturate(abs(frame.altitude - params.high_clouds.altitude) / HIGH_FADE);
    let high = high_cloud_at(p, HIGH_EMBOSS);
    let optical_depth = select(0.0, fade * high.optical_depth, visible);
    let along = optical_depth / max(abs(cosine), 0.02);
    let transmittance = transmittance_of(along);

    let mu_sun = cos_zenith_at(p, frame.sun_direction);
    let depth = depth_to_sun(along, optical_depth / max(abs(mu_sun), HIGH_GRAZING), select(-mu_sun, mu_sun, cosine > 0.0));
    var sun = sun_scattering(depth, 0.0, one_minus_cos(direction, frame.sun_direction)) * high_sun(mu_sun);
    if HIGH_EMBOSS {
        sun *= 1.0 + params.high_clouds.emboss * EMBOSS_GAIN * high.relief / (abs(high.relief) + EMBOSS_HALF);
    }
    var radiance = sun;
    if MODEL != MODEL_SINGLE {
        // Overcast is grey: from below, only what it lets through comes from above.
        let through = select(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), cosine > 0.0);
        // The ground has what they and those under them let through.
        let ground = ground_share() * mix(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), params.high_clouds.coverage);
        radiance += mix(ambient_below(ground * sky_light_uniform[1].rgb), ambient_above(sky_light_uniform[0].rgb), through);
    }
    return Layer((1.0 - transmittance) * radiance, transmittance, distance);
}

// Optical depth to the sun of what is seen of a uniform layer of optical depth `view` along the ray and `light` along the
// sun's: that of the mean transmittance toward the sun, by single scattering, over what the eye sees. With a sine of the
// sun's height `behind` the layer, negative in front of it, as seen from the eye.
fn depth_to_sun(view: f32, light: f32, behind: f32) -> f32 {
    let seen = log_mean_transmittance(view);
    let front = seen - log_mean_transmittance(view + light);
    let back = light + seen - log_mean_transmittance(view - light);
    return mix(front, back, smoothstep(-HIGH_SIDE, HIGH_SIDE, behind));
}

// Logarithm of (1 - exp(-x)) / x, for negative x too.
fn log_mean_transmittance(x: f32) -> f32 {
    return max(-x, 0.0) + log(one_minus_exp_over(abs(x)));
}

// Sunlight at the high clouds for its cosine with their zenith.
fn high_sun(mu_sun: f32) -> vec3f {
    if !HIGH_LOW_SUN {
        return sky_light_uniform[3].rgb;
    }
    // Hundreds of kilometres away it stands degrees higher or lower, and has set or not.
    let here = dot(frame.zenith, frame.sun_direction);
    return sun_irradiance(params.high_clouds.altitude, mix(mu_sun, here, smoothstep(LOW_SUN.x, LOW_SUN.y, here)));
}

// Radiance of the sun's disc before the air, its edge one pixel soft.
fn sun_disc(direction: vec3f) -> vec3f {
    let angle = sqrt(2.0 * one_minus_cos(direction, frame.sun_direction));
    let edge = max(pixel_width(), 1e-4);
    let cover = saturate((SUN_RADIUS - angle) / edge + 0.5);
    // Its limb is darker (Hestroffer and Magnan 1998), whole it is as bright as the irradiance says.
    let ratio = min(angle / SUN_RADIUS, 1.0);
    let limb = pow(vec3f(max(1.0 - ratio * ratio, 0.02)), 0.5 * LIMB);
    return cover * params.sun.irradiance * limb * (1.0 + 0.5 * LIMB) / (PI * SUN_RADIUS * SUN_RADIUS);
}
