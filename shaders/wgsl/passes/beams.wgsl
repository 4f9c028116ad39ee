// Bakes what the air lacks of the sun's light where clouds shade it, by place in the picture and distance: a march through the
// shadows that lie on the ground.
#import bindings
#import camera
#import atmosphere
#import aerial
#import beams
#import ground_shadow

// Steps between two slices. At 2 the beams of `sunset` err by BEAMERR, at 1 by more.
const STEPS = 2u;

@compute @workgroup_size(8, 8)
fn beams_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id.xy >= size.xy) {
        return;
    }
    let place = vec2f(id.xy) / vec2f(size.xy - 1u);
    let direction = view_direction(place * vec2f(f32(frame.width), f32(frame.height))).xyz;
    let way = air_way(direction);
    // Where the ray is under the highest clouds.
    let under = hit_sphere(direction, frame.power_shade);
    let start = max(under.near, way.start);
    let end = select(0.0, min(under.far, way.start + way.length), under.hit);
    var depth = aerial_depth(direction, min(way.start, start), start, FIRST_PIECES);

    let one_minus_cosine = one_minus_cos(direction, frame.sun_direction);
    // How far a shadow moves over the ground for each metre of the ray.
    let sine_sun = dot(frame.zenith, frame.sun_direction);
    let rise = dot(frame.zenith, direction) / select(min(sine_sun, -0.02), max(sine_sun, 0.02), sine_sun >= 0.0);
    let spread = length(direction - rise * frame.sun_direction);

    let last = size.z - 1u;
    var lack = vec3f(0.0);
    var slice = 0u;
    var reached = beam_distance(0.0);
    loop {
        textureStore(volume_out, vec3u(id.xy, slice), vec4f(frame.sky_scale * lack, 1.0));
        let next = beam_distance(f32(slice + 1u) / f32(last));
        let from_t = max(reached, start);
        let step = max(min(next, end) - from_t, 0.0) / f32(STEPS);
        var i = 0u;
        loop {
            let p = (from_t + (f32(i) + 0.5) * step) * direction;
            let h = altitude_at(p);
            let mu_sun = cos_zenith_at(p, frame.sun_direction);
            let parts = air_parts(h);
            let shade = 1.0 - baked_air_sun(p, h, mu_sun, spread * step);
            // Clouds pass on a part of what they keep, from above, evenly.
            let even = (RAYLEIGH * parts.x + MIE_SCATTERING * parts.y) * (PASSED_ON * max(mu_sun, 0.0) / (2.0 * PI));
            let source = (air_scattering_toward(parts, one_minus_cosine) - even) * sunlight(h, mu_sun) * shade;
            let x = air_extinction(parts) * step;
            lack += exp(-depth) * source * step * one_minus_exp_over3(x);
            depth += x;
            i += 1u;
            if i >= STEPS {
                break;
            }
        }
        reached = next;
        slice += 1u;
        if slice >= last || reached >= end {
            break;
        }
    }
    loop {
        textureStore(volume_out, vec3u(id.xy, slice), vec4f(frame.sky_scale * lack, 1.0));
        slice += 1u;
        if slice > last {
            break;
        }
    }
}
