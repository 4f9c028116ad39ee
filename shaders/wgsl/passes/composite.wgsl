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
// Second difference of radiance and transmittance from corner to corner past which each pixel of a cell is worked out, as a
// share of the brightest.
const SMOOTH = 0.05;

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
        let cloud = clouds[index];
        here = Layer(cloud.rgb, cloud.a, max(cloud_depth[index], 0.0));
    }
    let sight = sight_of(view.xyz, pixel, here);
    if LAYERS {
        sky[index] = vec4f(sight.background, 1.0);
        let covered = 1.0 - sight.seen.transmittance;
        depth[index] = select(-1.0, sight.seen.distance / covered, covered > 0.0);
    }
    image[index] = picture_of(sight);
}

// What is behind the marched clouds at every fourth pixel, in both directions, from the first to the first past the last.
@compute @workgroup_size(8, 8)
fn backdrop(@builtin(global_invocation_id) id: vec3u) {
    let size = (vec2u(frame.width, frame.height) + TILE - 1u) / TILE + 1u;
    if any(id.xy >= size) {
        return;
    }
    let index = id.y * size.x + id.x;
    let pixel = id.xy * TILE;
    let view = view_direction(vec2f(pixel) + 0.5);
    let sight = sight_of(view.xyz, min(pixel, vec2u(frame.width, frame.height) - 1u), Layer(vec3f(0.0), 1.0, 0.0));
    let opacity = 1.0 - sight.seen.transmittance;
    var distance = sight.seen.distance / max(opacity, 1e-6);
    // The sun's disc may lie between the corners of a cell.
    let near_sun = SUN_RADIUS + f32(2u * TILE) * pixel_width();
    if view.w == 0.0 || one_minus_cos(view.xyz, frame.sun_direction) < 0.5 * near_sun * near_sun {
        distance = -1.0;
    }
    backdrop_high[index] = vec4f(sight.seen.radiance, sight.seen.transmittance);
    backdrop_sky[index] = vec4f(sight.background, distance);
}

// Puts the clouds of a cell before what lies behind its corners, where these look alike; else it lists its pixels.
@compute @workgroup_size(8, 8)
fn composite_cells(@builtin(global_invocation_id) id: vec3u) {
    let columns = (frame.width + TILE - 1u) / TILE;
    let corner = vec2u(id.x * TILE, frame.first_row + id.y * TILE);
    if id.x >= columns || corner.y >= frame.first_row + frame.rows {
        return;
    }
    let first = corner.y / TILE * (columns + 1u) + id.x;
    let corners = vec4u(first, first + 1u, first + columns + 1u, first + columns + 2u);
    let high = mat4x4f(
        backdrop_high[corners[0]],
        backdrop_high[corners[1]],
        backdrop_high[corners[2]],
        backdrop_high[corners[3]],
    );
    let sky = mat4x4f(
        backdrop_sky[corners[0]],
        backdrop_sky[corners[1]],
        backdrop_sky[corners[2]],
        backdrop_sky[corners[3]],
    );
    let last = vec2i(vec2u(columns, (frame.height + TILE - 1u) / TILE));
    // Whether it is smooth shows at the corners of the cells around too: high clouds near the horizon are lower than a cell.
    // What bends from one to the next by so much, interpolation misses by an eighth of that, if it is smooth.
    var before: mat4x4f;
    var earlier: mat4x4f;
    var bend = vec4f(0.0);
    var brightest = 0.0;
    var nearest = 0.0;
    var k = 0;
    loop {
        var row: mat4x4f;
        for (var j = 0; j < 4; j++) {
            let at = vec2u(clamp(vec2i(corner / TILE) + vec2i(j, k) - 1, vec2i(0), last));
            let one = at.y * (columns + 1u) + at.x;
            let layer = backdrop_high[one];
            let behind = backdrop_sky[one];
            row[j] = vec4f(layer.rgb + layer.a * behind.rgb, layer.a);
            brightest = max(brightest, max(max(row[j].r, row[j].g), row[j].b));
            nearest = min(nearest, behind.a);
        }
        let across = max(abs(row[0] - 2.0 * row[1] + row[2]), abs(row[1] - 2.0 * row[2] + row[3]));
        bend = max(bend, across);
        if k >= 2 {
            for (var j = 0; j < 4; j++) {
                bend = max(bend, abs(row[j] - 2.0 * before[j] + earlier[j]));
            }
        }
        if k == 3 {
            break;
        }
        earlier = before;
        before = row;
        k++;
    }
    var alike = nearest >= 0.0 && all(bend <= SMOOTH * vec4f(vec3f(brightest), 1.0));
    if SCENE {
        alike = alike && nearest_scene(corner) >= NO_SCENE;
    }
    var i = 0u;
    loop {
        let place = vec2u(i % TILE, i / TILE);
        let pixel = corner + place;
        if all(pixel < vec2u(frame.width, frame.height)) {
            let index = pixel.y * frame.width + pixel.x;
            let share = vec2f(place) / f32(TILE);
            let shares = vec4f((1.0 - share.x) * (1.0 - share.y), share.x * (1.0 - share.y), (1.0 - share.x) * share.y, share.x * share.y);
            let far = high * shares;
            let behind = sky * shares;
            var here = Layer(vec3f(0.0), 1.0, 0.0);
            if !CLOUDLESS {
                let cloud = clouds[index];
                here = Layer(cloud.rgb, cloud.a, max(cloud_depth[index], 0.0));
            }
            var layer = Layer(far.rgb, far.a, behind.a);
            let under = layer.distance < here.distance;
            if alike {
                let seen = Layer(
                    select(here.radiance + here.transmittance * layer.radiance, layer.radiance + layer.transmittance * here.radiance, under),
                    here.transmittance * layer.transmittance,
                    0.0,
                );
                image[index] = picture_of(Sight(seen, behind.rgb, 1.0));
            } else {
                active_rays[atomicAdd(&ray_count, 1u)] = index;
            }
        }
        if i == TILE * TILE - 1u {
            break;
        }
        i++;
    }
}

fn nearest_scene(corner: vec2u) -> f32 {
    var nearest = NO_SCENE;
    var i = 0u;
    loop {
        let pixel = min(corner + vec2u(i % TILE, i / TILE), vec2u(frame.width, frame.height) - 1u);
        nearest = min(nearest, scene_distance(pixel));
        if i == TILE * TILE - 1u {
            break;
        }
        i++;
    }
    return nearest;
}

// The pixels of the list.
@compute @workgroup_size(64)
fn composite_list(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.active_rays {
        return;
    }
    let index = active_rays[frame.first_ray + id.x];
    compose(vec2u(index % frame.width, index / frame.width));
}

// What a pixel sees: all clouds, what is behind them, and how much of that is ours to say.
struct Sight {
    seen: Layer,
    background: vec3f,
    opacity: f32,
}

fn picture_of(sight: Sight) -> vec4f {
    let whole = vec4f(sight.seen.radiance + sight.seen.transmittance * sight.background, sight.opacity);
    return select(vec4f(sight.seen.radiance, 1.0 - sight.seen.transmittance), whole, frame.background > 0u);
}

// What is seen in a direction, with the clouds that were marched there.
fn sight_of(direction: vec3f, pixel: vec2u, here: Layer) -> Sight {
    let scene = scene_distance(pixel);
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
