// Answers questions at points: the extinction there, and how much direct sun arrives through the clouds.
#import bindings
#import shell
#import density
#import panels
#import high_layer

// Extinction in 1/m, the field that `march` marches.
@compute @workgroup_size(64)
fn extinction_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width {
        return;
    }
    let p = points[id.x].xyz;
    let altitude = altitude_at(p);
    results[id.x] = vec4f(cloud_density_at(p, altitude, 0.0) * frame.extinction, 0.0, 0.0, 0.0);
}

// So that lavapipe's limit of 65,535 iterations over a shader is never met (hazard 21).
const MAX_SUN_PANELS = 16384u;

@compute @workgroup_size(64)
fn sun_transmittance_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width {
        return;
    }
    let p = points[id.x].xyz;
    if hit_ground_from(p, frame.sun_direction).enters {
        results[id.x] = vec4f(0.0);
        return;
    }
    let s = cloud_stretches_from(p, frame.sun_direction);
    let length = s.first + s.second;
    // At least so long that they suffice.
    let longest = max(2.0 * finest_feature(), length / f32(MAX_SUN_PANELS));
    var depth = 0.0;
    var x = 0.0;
    for (var i = 0u; i < 2u * MAX_SUN_PANELS && x < length; i++) {
        let panel = panel_from(p, frame.sun_direction, s, x, min(longest, length - x));
        depth += panel_depth(panel, read_panel(panel, p, frame.sun_direction, s, 0.0).density);
        x = panel.end;
    }
    let high = hit_sphere_from(p, frame.sun_direction, params.high_clouds.altitude);
    if high.hit && params.high_clouds.coverage > 0.0 {
        for (var side = 0; side < 2; side++) {
            let t = select(high.far, high.near, side == 0);
            let q = p + t * frame.sun_direction;
            let slant = max(abs(cos_zenith_at(q, frame.sun_direction)), 0.02);
            depth += select(0.0, high_optical_depth(q) / slant, t > 0.0);
        }
    }
    results[id.x] = vec4f(exp(-depth), 0.0, 0.0, 0.0);
}
