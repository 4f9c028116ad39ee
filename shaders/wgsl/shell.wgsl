// Rays and points around a planet, in the altitude form: no radius is ever squared in f32, which would cost metres at
// the horizon (docs/numerics.md, hazards 1 to 3). Positions are relative to the camera. `frame` brings the camera's
// altitude, its distance to the planet's centre, its zenith, and for a sphere at altitude H the power of the camera's
// point, (h - H)(2 R + h + H), from f64.
#import math
#import bindings

struct Hit {
    near: f32, // distance to the first crossing in front of the camera, 0 from inside
    far: f32, // distance to the last one
    hit: bool, // whether there is any
    enters: bool, // whether the ray comes from outside, or from the surface, and goes in
}

// Where a ray from a point crosses a sphere: `b` is the point's distance to the planet's centre times the cosine
// between its zenith and the ray, `power` the power of the point for the sphere.
fn crossing(b: f32, power: f32) -> Hit {
    let disc = b * b - power;
    if disc < 0.0 || (power > 0.0 && b > 0.0) {
        return Hit(0.0, 0.0, false, false);
    }
    let s = sqrt(disc);
    let far = select(s - b, -power / (b + s), b > 0.0);
    let near = select(0.0, power / (s - b), power > 0.0);
    return Hit(max(near, 0.0), max(far, 0.0), true, power >= 0.0 && b < 0.0);
}

// Where a ray from the camera crosses the sphere whose power is `power`.
fn hit_sphere(direction: vec3f, power: f32) -> Hit {
    return crossing(frame.view.centre_distance * dot(frame.view.zenith, direction), power);
}

// Where a ray from a point crosses the sphere at an altitude.
fn hit_sphere_from(p: vec3f, direction: vec3f, altitude: f32) -> Hit {
    let radius = params.atmosphere.planet_radius;
    let h = altitude_at(p);
    let b = (radius + h) * cos_zenith_at(p, direction);
    return crossing(b, (h - altitude) * (2.0 * radius + h + altitude));
}

// Where a ray from a point meets the ground. A point under the ground is on it: rounding alone would put half of the
// points on the ground there.
fn hit_ground_from(p: vec3f, direction: vec3f) -> Hit {
    let radius = params.atmosphere.planet_radius;
    let h = altitude_at(p);
    let b = (radius + h) * cos_zenith_at(p, direction);
    return crossing(b, max(h, 0.0) * (2.0 * radius + h));
}

// Altitude of a point. The planet's centre is as far from itself as a millimetre: 0 / 0 is no altitude.
fn altitude_at(p: vec3f) -> f32 {
    let rh = frame.view.centre_distance;
    let d = dot(p, p) + 2.0 * rh * dot(frame.view.zenith, p);
    return frame.view.altitude + d / max(rh + sqrt(max(rh * rh + d, 0.0)), 1e-3);
}

// Cosine between a unit direction and the local zenith at a point.
fn cos_zenith_at(p: vec3f, direction: vec3f) -> f32 {
    let up = frame.view.zenith * frame.view.centre_distance + p;
    return dot(up, direction) / max(length(up), 1.0);
}

// The same for a ray from the camera and its own point at a distance, whose altitude is known: no square root.
fn cos_zenith_along(direction: vec3f, distance: f32, altitude: f32) -> f32 {
    let up = frame.view.centre_distance * dot(frame.view.zenith, direction) + distance;
    return up / (params.atmosphere.planet_radius + altitude);
}

// The part of a ray where there can be cloud: up to two segments, the second after the ray has passed under the base.
// It runs to the last exit of the shell: ending it at the first would cut a band along the horizon.
struct Segments {
    start: f32,
    first: f32, // length of the first stretch
    gap: f32, // length of the gap after it
    second: f32, // length of the second stretch
}

// Of a ray from the camera, to the ground at most.
fn cloud_segments(direction: vec3f) -> Segments {
    let ground = hit_sphere(direction, frame.view.power_ground);
    let end = select(1e30, ground.near, ground.enters);
    if VOLUME {
        return box_stretch(vec3f(0.0), direction, end);
    }
    let top = hit_sphere(direction, frame.view.power_top);
    return stretches_between(top, hit_sphere(direction, frame.view.power_base), end);
}

// Of a ray from a point, as if there were no ground.
fn cloud_stretches_from(p: vec3f, direction: vec3f) -> Segments {
    if VOLUME {
        return box_stretch(p, direction, 1e30);
    }
    return stretches_between(
        hit_sphere_from(p, direction, frame.sky.shell_top),
        hit_sphere_from(p, direction, frame.sky.shell_base),
        1e30,
    );
}

fn stretches_between(outer: Hit, inner: Hit, limit: f32) -> Segments {
    if !outer.hit {
        return Segments(0.0, 0.0, 0.0, 0.0);
    }
    let end = min(outer.far, limit);
    if !inner.hit || inner.near >= end {
        return Segments(outer.near, max(end - outer.near, 0.0), 0.0, 0.0);
    }
    let first = max(inner.near - outer.near, 0.0);
    let second = max(end - inner.far, 0.0);
    if first == 0.0 {
        return Segments(inner.far, second, 0.0, 0.0);
    }
    return Segments(outer.near, first, inner.far - inner.near, second);
}

// Through the box of the user's grid. A direction along a face divides by a number that is small, not zero (hazard 17).
fn box_stretch(p: vec3f, direction: vec3f, limit: f32) -> Segments {
    let d = select(direction, vec3f(1e-20), abs(direction) < vec3f(1e-20));
    let a = (frame.sky.volume_low - p) / d;
    let b = (frame.sky.volume_high - p) / d;
    let near = min(a, b);
    let far = max(a, b);
    let start = max(max(near.x, near.y), max(near.z, 0.0));
    let end = min(min(far.x, far.y), min(far.z, limit));
    return Segments(start, max(end - start, 0.0), 0.0, 0.0);
}

// The distance along a ray that lies `x` metres into its segments.
fn stretch_distance(s: Segments, x: f32) -> f32 {
    return s.start + x + select(0.0, s.gap, x > s.first);
}
