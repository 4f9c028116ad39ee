// Bakes light shafts: the radiance that the air lacks in the shadows of clouds, by position in the picture and
// distance. Rays are marched through the shadow clipmap of the ground.
#import bindings
#import camera
#import atmosphere
#import aerial
#import light_shafts
#import ground_shadow
#import light

// Steps between two slices. With 2, rings are visible in the sky of `sunset`. With 8, the lack has the same error as
// with 3: 2 to 10 % where shadows are smooth (tests/test_light_shafts.py).
const STEPS = 3u;
// Angle below the horizon of rays that interpolate with rays above it, radians: three times the angle between rays.
const SUNK = 0.05;

@compute @workgroup_size(8, 8)
fn light_shafts_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id.xy >= size.xy) {
        return;
    }
    let place = vec2f(id.xy) / vec2f(size.xy - 1u);
    let direction = view_direction(place * vec2f(f32(frame.view.width), f32(frame.view.height))).xyz;
    let way = air_segment(direction);
    // Segment of the ray below the highest clouds.
    let under = hit_sphere(direction, frame.view.power_shade);
    let start = max(under.near, way.start);
    var end = select(0.0, min(under.far, way.start + way.length), under.hit);
    // Rays just below the horizon continue as if through air: pixels just above it interpolate between them and rays
    // above.
    let sunk = -asin(clamp(dot(direction, frame.view.zenith), -1.0, 1.0)) - frame.view.horizon_dip;
    end = select(end, frame.view.shaft_start + frame.view.shaft_length, way.grounded && sunk < SUNK);
    var depth = aerial_depth(direction, min(way.start, start), start, FIRST_PIECES);

    let one_minus_cosine = one_minus_cos(direction, frame.sky.sun_direction);
    // Displacement of a shadow on the ground per metre of the ray.
    let sine_sun = dot(frame.view.zenith, frame.sky.sun_direction);
    let rise = dot(frame.view.zenith, direction) / select(min(sine_sun, -0.02), max(sine_sun, 0.02), sine_sun >= 0.0);
    let spread = length(direction - rise * frame.sky.sun_direction);

    let last = size.z - 1u;
    var lack = vec3f(0.0);
    var slice = 0u;
    var reached = shaft_distance(0.0);
    loop {
        textureStore(volume_out, vec3u(id.xy, slice), vec4f(frame.sky.sky_scale * lack, 1.0));
        let next = shaft_distance(f32(slice + 1u) / f32(last));
        // March through the ground to the slice behind it: reads at the ground interpolate between that slice and the
        // one before.
        let to_t = select(min(next, end), next, way.grounded && reached < end);
        let from_t = max(reached, start);
        let step = max(to_t - from_t, 0.0) / f32(STEPS);
        // One step suffices before and behind the shaded air.
        let most = select(1u, STEPS, step > 0.0);
        var i = 0u;
        loop {
            let p = (from_t + (f32(i) + 0.5) * step) * direction;
            let h = altitude_at(p);
            let mu_sun = cos_zenith_at(p, frame.sky.sun_direction);
            let parts = air_parts(h);
            let shade = 1.0 - baked_air_sun(p, h, mu_sun, spread * step);
            // Clouds scatter a part of the sunlight to the air.
            let even = (RAYLEIGH * parts.x + MIE_SCATTERING * parts.y) * cloud_light(p, h, mu_sun, shade);
            let source = (air_scattering_toward(parts, one_minus_cosine) * shade - even) * sunlight(h, mu_sun);
            let x = air_extinction(parts) * step;
            lack += exp(-depth) * source * step * one_minus_exp_over3(x);
            depth += x;
            i += 1u;
            if i >= most {
                break;
            }
        }
        reached = next;
        slice += 1u;
        if slice > last {
            break;
        }
    }
}
