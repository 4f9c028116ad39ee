// Queries at points: extinction, and transmittance toward the sun; optical depth along directions.
#import bindings
#import shell
#import density
#import panels
#import ground_shadow

// Extinction, 1/m, of the field that `march` integrates.
@compute @workgroup_size(64)
fn extinction_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns {
        return;
    }
    let p = points[id.x].xyz;
    let altitude = altitude_at(p);
    results[id.x] = vec4f(cloud_density_at(p, altitude, 0.0) * frame.sky.extinction, 0.0, 0.0, 0.0);
}

// Largest number of panels: it keeps a shader below lavapipe's limit of 65,535 loop iterations (docs/numerics.md).
const MAX_SUN_PANELS = 16384u;

@compute @workgroup_size(64)
fn sun_transmittance_at_points(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns {
        return;
    }
    let p = points[id.x].xyz;
    if hit_ground_from(p, frame.sky.sun_direction).enters {
        results[id.x] = vec4f(0.0);
        return;
    }
    results[id.x] = vec4f(exp(-depth_from(p, frame.sky.sun_direction)), 0.0, 0.0, 0.0);
}

// Optical depth of all clouds from the eye along directions; -1 where the ground is in the way.
@compute @workgroup_size(64)
fn depth_along_directions(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns {
        return;
    }
    let direction = points[id.x].xyz;
    let hidden = hit_ground_from(vec3f(0.0), direction).enters;
    results[id.x] = vec4f(select(depth_from(vec3f(0.0), direction), -1.0, hidden), 0.0, 0.0, 0.0);
}

// Optical depth of all clouds along a ray from a point.
fn depth_from(p: vec3f, direction: vec3f) -> f32 {
    let s = cloud_stretches_from(p, direction);
    let length = s.first + s.second;
    // Longer panels where `MAX_SUN_PANELS` of the finest would not cover the ray.
    let longest = max(2.0 * finest_feature(), length / f32(MAX_SUN_PANELS));
    var depth = 0.0;
    var x = 0.0;
    for (var i = 0u; i < 2u * MAX_SUN_PANELS && x < length; i++) {
        let panel = panel_from(p, direction, s, x, min(longest, length - x));
        depth += panel_depth(panel, read_panel(panel, p, direction, s, 0.0).density);
        x = panel.end;
    }
    return depth + high_depth_from(p, direction);
}
