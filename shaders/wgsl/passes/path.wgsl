// Path tracer: every order of scattering, from each pixel. Collisions are found by delta tracking, transmittance toward
// the sun by ratio tracking (Novák et al. 2018), and the environment is sky and ground.
//
// One loop, whose every iteration is one step of one flight. No path waits for another, and a pixel can stop after any
// iteration and continue in the next dispatch.
#import bindings
#import camera
#import majorant
#import light
#import random
#import atmosphere
#import scene_depth
#import subrays

// Stages of a pixel.
const START = 0u; // start of a path
const FLIGHT = 1u; // flight against the direction of the light, to the next collision
const SHADOW = 2u; // shadow ray toward the sun, from a collision
const GROUND = 3u; // shadow ray toward the sun, from the ground
const DONE = 4u;

// Shortest step, m: longer than the rounding of positions, so that a flight ends at any extinction. The mean free path
// in the densest cloud is several metres. An extinction of 1 / m is reduced by 5e-5.
const SHORTEST = 1e-2;
// Largest number of iterations of a path, at which it ends. No path reaches it where the mean free path is a metre.
// Paths must also end where it is shorter (extinction up to 1e8 / m) or where clouds are a metre thick.
const MOST_TURNS = 1u << 20u;
// Russian-roulette threshold: paths with less throughput end at random, and survivors take over their weight.
const ROULETTE_THRESHOLD = 0.1;

@compute @workgroup_size(64)
fn path(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.active_rays {
        return;
    }
    let index = active_rays[id.x];
    let pixel = vec2u(index % frame.view.width, dispatch.strip_row + index / frame.view.width);
    let middle = view_direction(vec2f(pixel) + 0.5);
    let rays = rays_through(middle.xyz);
    let seen = seen_turn(middle.xyz, vec2f(pixel));
    let pixel_size = pixel_width(middle.xyz);
    let sunlit = is_sunlit();

    var ray = path_rays[index];
    evaluations = ray.evaluations;
    var turns = 0u;
    for (; turns < dispatch.budget && ray.stage != DONE; turns++) {
        if ray.stage == START {
            ray.origin = vec3f(0.0);
            var view = middle;
            if SUBRAYS {
                let number = pixel.y * frame.view.width + pixel.x;
                let place = random3(vec3u(number, frame.view.first_sample + ray.done, 0u), params.quality.seed).xy;
                view = vec4f(view_direction(ray_place(pixel, place, rays)).xyz, middle.w);
            }
            ray.direction = view.xyz;
            ray.flight = view_flight(view, scene_distance(pixel));
            ray.x = 0.0;
            ray.throughput = vec3f(1.0);
            ray.light = vec3f(0.0);
            ray.scatterings = 0u;
            ray.random_dimension = 0u;
            ray.stage = FLIGHT;
        }
        let u = draw(&ray, pixel);

        // One step: to a real or null collision, or as far as the majorant holds.
        let s = Segments(ray.flight.x, ray.flight.y, ray.flight.z, ray.flight.w);
        let length = s.first + s.second;
        let direction = select(frame.sky.sun_direction, ray.direction, ray.stage == FLIGHT);
        let here = ray.origin + stretch_distance(s, ray.x) * direction;
        let majorant = majorant_at(here, altitude_at(here));
        let free = max(-log(1.0 - u.x) / max(majorant.density * frame.sky.extinction, 1e-30), SHORTEST);
        let before_gap = ray.x < s.first && s.second > 0.0;
        let room = select(length, s.first, before_gap) - ray.x;
        // Every step makes progress, despite rounding.
        let reach = max(majorant.reach, 4e-7 * (s.start + ray.x) + SHORTEST);
        let collides = free < min(reach, room);
        // The end of the segments is reached exactly; the step over the gap ends behind it for certain.
        let edge = select(length, s.first + SHORTEST + 4e-7 * s.first, before_gap);
        ray.x = select(select(edge, ray.x + reach, reach < room), ray.x + free, collides);
        let t = stretch_distance(s, ray.x);
        let p = ray.origin + t * direction;
        if ray.scatterings == 0u {
            ray.width = t * pixel_size;
        }
        let density = cloud_density_at(p, altitude_at(p), ray.width);
        let real = select(0.0, saturate(density / max(majorant.density, 1e-30)), collides);
        let ends = ray.x >= length;

        if ray.random_dimension > MOST_TURNS {
            ray = path_ended(ray);
        } else if ray.stage == FLIGHT {
            if real > u.y {
                ray.scatterings += 1u;
                ray.throughput *= params.light.albedo;
                ray.distance += select(0.0, t, ray.scatterings == 1u);
                if AIR && ray.scatterings == 1u {
                    // The eye sees the first collision, and with it the rest of the path, through the air.
                    let way = air_segment(direction);
                    let air = air_before(direction, t, way, air_texels(direction), sky_radiance(direction));
                    ray.throughput *= air.transmittance;
                    ray.light = air.radiance;
                }
                ray.origin = p;
                ray.x = 0.0;
                if ray.scatterings > params.quality.path_scatterings {
                    ray = path_ended(ray);
                } else if sunlit {
                    let turned = model_phase(one_minus_cos(direction, frame.sky.sun_direction));
                    let phase = select(turned, seen.phase, ray.scatterings == 1u);
                    ray.sunlight = ray.throughput * phase * sun_at(p);
                    ray.shadow = 1.0;
                    ray.flight = flight_from(p, frame.sky.sun_direction);
                    ray.stage = SHADOW;
                } else {
                    ray = scattered_on(ray, pixel);
                }
            } else if ends {
                ray = escaped(ray, pixel);
            }
        } else {
            ray.shadow *= 1.0 - real;
            if ray.shadow < ROULETTE_THRESHOLD && ray.shadow > 0.0 && real > 0.0 {
                ray.shadow = select(0.0, ROULETTE_THRESHOLD, u.y * ROULETTE_THRESHOLD < ray.shadow);
            }
            if ends || ray.shadow <= 0.0 {
                ray.light += ray.shadow * ray.sunlight;
                ray = scattered_on(ray, pixel);
            }
        }
        if ray.stage == START && ray.done >= params.quality.path_samples {
            write_pixel(ray, index);
            ray.stage = DONE;
        }
    }
    ray.evaluations = evaluations;
    path_rays[index] = ray;
    progress[id.x] = vec2u(turns, select(0u, 1u, ray.stage == DONE));
}

// Three random numbers in [0, 1), distinct for every pixel, path and iteration.
fn draw(ray: ptr<function, PathRay>, pixel: vec2u) -> vec3f {
    (*ray).random_dimension += 1u;
    let number = pixel.y * frame.view.width + pixel.x;
    return random3(vec3u(number, frame.view.first_sample + (*ray).done, (*ray).random_dimension), params.quality.seed);
}

fn sun_at(p: vec3f) -> vec3f {
    if AIR {
        return sun_irradiance(altitude_at(p), cos_zenith_at(p, frame.sky.sun_direction));
    }
    return sky_light[2].rgb;
}

fn view_flight(view: vec4f, limit: f32) -> vec4f {
    let s = segments_before(cloud_segments(view.xyz), limit);
    let clear = view.w == 0.0 || (!VOLUME && !UPPER && params.clouds.coverage <= 0.0);
    return select(vec4f(s.start, s.first, s.gap, s.second), vec4f(0.0), clear);
}

// Segments of a flight from a point, up to the ground.
fn flight_from(p: vec3f, direction: vec3f) -> vec4f {
    let ground = hit_ground_from(p, direction);
    var s = cloud_stretches_from(p, direction);
    if ground.enters {
        let first = clamp(ground.near - s.start, 0.0, s.first);
        let second = clamp(ground.near - s.start - s.first - s.gap, 0.0, s.second);
        s = Segments(s.start, first, s.gap, second);
    }
    return vec4f(s.start, s.first, s.gap, s.second);
}

// Continuation of a path from a collision or from the ground.
fn scattered_on(given: PathRay, pixel: vec2u) -> PathRay {
    var ray = given;
    let u = draw(&ray, pixel);
    let brightest = max(max(ray.throughput.r, ray.throughput.g), ray.throughput.b);
    if brightest < ROULETTE_THRESHOLD {
        if u.z * ROULETTE_THRESHOLD >= brightest {
            return path_ended(ray);
        }
        ray.throughput *= ROULETTE_THRESHOLD / brightest;
    }
    if ray.stage == GROUND {
        // Cosine-weighted sampling about the local zenith (Lambertian ground).
        let up = normalize(frame.view.zenith * frame.view.centre_distance + ray.origin);
        let side = perpendicular(up);
        let angle = 2.0 * PI * u.y - PI;
        let level = cos(angle) * side + sin(angle) * cross(up, side);
        ray.direction = normalize(sqrt(1.0 - u.x) * up + sqrt(u.x) * level);
    } else if PHASE == PHASE_HENYEY_GREENSTEIN {
        ray.direction = scattered(ray.direction, params.light.g, u.xy);
    } else {
        let sample = droplet_sample(u.xy);
        ray.direction = rotate_by(ray.direction, sample.x, u.y);
        ray.throughput *= sample.y;
    }
    ray.flight = flight_from(ray.origin, ray.direction);
    ray.x = 0.0;
    ray.stage = FLIGHT;
    return ray;
}

// Escape from the clouds: without a collision, to the background of the eye, else to the sky or to the ground.
fn escaped(given: PathRay, pixel: vec2u) -> PathRay {
    var ray = given;
    if ray.scatterings == 0u {
        return path_ended(ray);
    }
    ray.light += ray.throughput * params.light.ambient;
    let ground = hit_ground_from(ray.origin, ray.direction);
    if !ground.enters {
        if AIR {
            ray.light += ray.throughput * params.light.ambient_gain * sky_radiance(ray.direction);
        }
        return path_ended(ray);
    }
    ray.scatterings += 1u;
    if ray.scatterings > params.quality.path_scatterings {
        return path_ended(ray);
    }
    ray.origin += ground.near * ray.direction;
    ray.throughput *= params.atmosphere.ground_albedo;
    let mu = max(cos_zenith_at(ray.origin, frame.sky.sun_direction), 0.0);
    ray.sunlight = ray.throughput / PI * mu * sun_irradiance(0.0, mu);
    ray.shadow = select(0.0, 1.0, mu > 0.0);
    ray.flight = flight_from(ray.origin, frame.sky.sun_direction);
    ray.x = 0.0;
    ray.stage = GROUND;
    return ray;
}

fn path_ended(given: PathRay) -> PathRay {
    var ray = given;
    // Paths without a collision, truncated or not, see the background of the eye.
    ray.seen += select(0.0, 1.0, ray.scatterings == 0u);
    ray.radiance += ray.light;
    ray.squares += ray.light * ray.light;
    ray.done += 1u;
    ray.stage = START;
    return ray;
}

fn write_pixel(ray: PathRay, index: u32) {
    let n = f32(ray.done);
    let mean = ray.radiance / n;
    let variance = max(ray.squares / n - mean * mean, vec3f(0.0));
    clouds[index] = vec4f(mean, ray.seen / n);
    cloud_depth[index] = select(-1.0, ray.distance / max(n - ray.seen, 1.0), ray.seen < n);
    samples[index] = evaluations;
    uncertainty[index] = vec4f(sqrt(variance / (n - 1.0)), 0.0);
}
