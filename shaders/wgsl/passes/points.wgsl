// Queries at points: extinction, and transmittance toward the sun; optical depth along directions.
#import bindings
#import shell
#import density
#import cloud_depth

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
