// Irradiance at points, by the light field: of the sun, straight from it, and of all other light.
#import bindings
#import shell
#import light
#import light_field
#import cloud_depth

// Directions over the hemisphere, weighted by the cosine. With 72 the mean error of light on the ground was 0.3 % over
// cumulus (docs/accuracy.md).
const RAYS = 72u;
// Steps of a ray, at most; half a cell each.
const MOST_STEPS = 400u;
// Scaled transmittance below which a ray ends.
const DARK = 1e-3;

// Entry 2 i of `points` is a place, entry 2 i + 1 the normal of a plane there.
@compute @workgroup_size(64)
fn irradiance_at_points(@builtin(global_invocation_id) id: vec3u) {
    if 2u * id.x >= dispatch.columns {
        return;
    }
    let p = points[2u * id.x].xyz;
    let normal = points[2u * id.x + 1u].xyz;
    let h = altitude_at(p);
    let mu = cos_zenith_at(p, frame.sky.sun_direction);
    let sun = sun_irradiance(h, mu);
    var depth = 0.0;
    if !hit_ground_from(p, frame.sky.sun_direction).enters {
        depth = depth_from(p, frame.sky.sun_direction);
    }
    let facing = max(dot(normal, frame.sky.sun_direction), 0.0);
    let direct = exp(-depth) * facing * sun;
    // Sunlight that clouds have scattered forward comes from around the sun.
    var sum = (exp(-frame.sky.split.z * depth) - exp(-depth)) * facing * sun;
    let across = perpendicular(normal);
    var i = 0u;
    loop {
        // Low-discrepancy sequence (R2).
        let u = fract(0.5 + f32(i) * vec2f(0.7548776662, 0.5698402910));
        let angle = 2.0 * PI * u.y - PI;
        let side = cos(angle) * across + sin(angle) * cross(normal, across);
        sum += PI / f32(RAYS) * incoming(p, normalize(sqrt(1.0 - u.x) * normal + sqrt(u.x) * side));
        i += 1u;
        if i >= RAYS {
            break;
        }
    }
    results[2u * id.x] = vec4f(direct, 0.0);
    results[2u * id.x + 1u] = vec4f(sum, 0.0);
}

// Radiance at a point from a direction, without the sun's disc and aureole: of the clouds, and through them of sky and
// ground.
fn incoming(p: vec3f, direction: vec3f) -> vec3f {
    let ground = hit_ground_from(p, direction);
    var s = cloud_stretches_from(p, direction);
    let end = select(1e30, ground.near, ground.enters);
    let length = max(min(s.first + s.second, end - s.start), 0.0);
    let mu = cos_zenith_at(p, frame.sky.sun_direction);
    let scale = frame.sky.split.z;
    let source = frame.sky.split.w;
    let turn = 3.0 * frame.sky.turned_cosine;
    var transmittance = 1.0;
    var sun = 0.0;
    var above = 0.0;
    var below = 0.0;
    var x = 0.0;
    var i = 0u;
    loop {
        let at = stretch_distance(s, x);
        let q_here = field_place(p + at * direction, altitude_at(p + at * direction));
        let cell = frame.sky.field_cell * vec3f(vec2f(exp2(field_level(q_here))), 1.0);
        let ray = field_direction(direction, cos_zenith_at(p + at * direction, direction));
        let speed = abs(ray) / cell;
        let step = min(0.5 / max(max(speed.x, speed.y), speed.z), length - x);
        let middle = p + stretch_distance(s, x + 0.5 * step) * direction;
        let q = field_place(middle, altitude_at(middle));
        let uvw = field_texel(q, field_level(q));
        let optics = textureSampleLevel(field_optics, clamp_sampler, uvw, 0.0);
        let of_sun = textureSampleLevel(field_sun, clamp_sampler, uvw, 0.0);
        let of_sky = textureSampleLevel(field_sky, clamp_sampler, uvw, 0.0);
        let taken = transmittance * (1.0 - exp(-scale * frame.sky.extinction * optics.r * max(step, 0.0)));
        let beam = exp(-scale * optics.g);
        let cosine = dot(direction, frame.sky.sun_direction);
        let toward = vec4f(1.0, -turn * ray);
        let turned = dot(of_sun, toward) + beam * (1.0 + turn * cosine);
        let of_above = clamp(source * dot(of_sky, toward), 0.0, 4.0 * PI * source);
        sun += taken * source * max(turned, 0.0);
        above += taken * of_above;
        below += taken * (4.0 * PI * source - of_above);
        transmittance -= taken;
        x += step;
        i += 1u;
        if x >= length || i >= MOST_STEPS || transmittance < DARK {
            break;
        }
    }
    let h = altitude_at(p);
    let seen = p + stretch_distance(s, 0.5 * length) * direction;
    var radiance = sun * sun_irradiance(altitude_at(seen), mu);
    radiance += ambient_light(above, below, light_from_above(h, mu), ground_factor(seen, mu) * light_from_below(h, mu));
    if ground.enters {
        let there = p + ground.near * direction;
        let light = field_ground_at(field_place(there, 0.0).xy);
        radiance += transmittance * ground_under(there, mu, light.z);
    } else if AIR {
        radiance += transmittance * sky_radiance(direction);
    }
    return radiance;
}
