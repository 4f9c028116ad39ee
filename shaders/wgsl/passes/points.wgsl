// Answers questions at points: the extinction there, and how much direct sun arrives through the clouds.
#import bindings
#import shell
#import density
#import high_layer

// Extinction in 1/m, the field that `march` marches.
@compute @workgroup_size(64)
fn extinction_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width {
        return;
    }
    let p = points[id.x].xyz;
    let altitude = altitude_at(p);
    results[id.x] = vec4f(cloud_density_at(p, altitude, 0.0) * params.clouds.extinction, 0.0, 0.0, 0.0);
}

// Step of the march toward the sun, m: half a texel of the base shape at its default scale.
const SUN_STEP = 20.0;
// So that lavapipe's limit of 65,535 iterations over a shader is never met (hazard 21).
const MAX_SUN_STEPS = 8192.0;

@compute @workgroup_size(64)
fn sun_transmittance_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width {
        return;
    }
    let p = points[id.x].xyz;
    let h = altitude_at(p);
    let radius = params.atmosphere.planet_radius;
    let b = (radius + h) * cos_zenith_at(p, frame.sun_direction);
    let top = params.clouds.top;
    let base = params.clouds.base;
    let high = params.high_clouds.altitude;
    // A point under the ground is on it: rounding alone would put half of the points on the ground there.
    let ground = crossing(b, max(h, 0.0) * (2.0 * radius + h));
    if ground.enters {
        results[id.x] = vec4f(0.0);
        return;
    }
    let s = stretches_between(
        crossing(b, (h - top) * (2.0 * radius + h + top)),
        crossing(b, (h - base) * (2.0 * radius + h + base)),
        Hit(0.0, 0.0, false, false),
    );
    let length = s.first + s.second;
    let steps = clamp(ceil(length / SUN_STEP), 1.0, MAX_SUN_STEPS);
    var depth = 0.0;
    if length > 0.0 {
        for (var i = 0.0; i < steps; i += 1.0) {
            let from_start = (i + 0.5) / steps * length;
            let t = s.start + from_start + select(0.0, s.gap, from_start > s.first);
            let q = p + t * frame.sun_direction;
            depth += cloud_density_at(q, altitude_at(q), 0.0);
        }
        depth *= params.clouds.extinction * length / steps;
    }
    let layer = crossing(b, (h - high) * (2.0 * radius + h + high));
    if layer.hit && params.high_clouds.coverage > 0.0 {
        for (var side = 0; side < 2; side++) {
            let t = select(layer.far, layer.near, side == 0);
            let q = p + t * frame.sun_direction;
            let slant = max(abs(cos_zenith_at(q, frame.sun_direction)), 0.02);
            depth += select(0.0, high_optical_depth(q) / slant, t > 0.0);
        }
    }
    results[id.x] = vec4f(exp(-depth), 0.0, 0.0, 0.0);
}
