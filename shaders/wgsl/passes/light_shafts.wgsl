// Bakes what the air lacks of the sun's light where clouds shade it, by place in the picture and distance: a march through the
// shadows that lie on the ground.
#import bindings
#import camera
#import atmosphere
#import aerial
#import light_shafts
#import ground_shadow

// Steps between two slices. At 2 rings show in the sky of `sunset`; at 8 what the air lacks errs as much as at 3, by 2 to 10 %
// where shadows are smooth (tests/test_beams.py).
const STEPS = 3u;
// Angle below the horizon of the rays that are next to others above it, radians: three times that between rays.
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
    // Where the ray is under the highest clouds.
    let under = hit_sphere(direction, frame.view.power_shade);
    let start = max(under.near, way.start);
    var end = select(0.0, min(under.far, way.start + way.length), under.hit);
    // Rays just below the horizon go on, as if through air, for those just above it that lie between the two.
    let sunk = -asin(clamp(dot(direction, frame.view.zenith), -1.0, 1.0)) - frame.view.horizon_dip;
    end = select(end, frame.view.shaft_start + frame.view.shaft_length, way.grounded && sunk < SUNK);
    var depth = aerial_depth(direction, min(way.start, start), start, FIRST_PIECES);

    let one_minus_cosine = one_minus_cos(direction, frame.sky.sun_direction);
    // How far a shadow moves over the ground for each metre of the ray.
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
        // Through the ground to the slice behind it: between the two lies what is read at the ground.
        let to_t = select(min(next, end), next, way.grounded && reached < end);
        let from_t = max(reached, start);
        let step = max(to_t - from_t, 0.0) / f32(STEPS);
        // Before and behind the shaded air it is one.
        let most = select(1u, STEPS, step > 0.0);
        var i = 0u;
        loop {
            let p = (from_t + (f32(i) + 0.5) * step) * direction;
            let h = altitude_at(p);
            let mu_sun = cos_zenith_at(p, frame.sky.sun_direction);
            let parts = air_parts(h);
            let shade = 1.0 - baked_air_sun(p, h, mu_sun, spread * step);
            // Clouds pass on a part of what they keep, from above, evenly.
            let even = (RAYLEIGH * parts.x + MIE_SCATTERING * parts.y) * (PASSED_ON * max(mu_sun, 0.0) / (2.0 * PI));
            let source = (air_scattering_toward(parts, one_minus_cosine) - even) * sunlight(h, mu_sun) * shade;
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
