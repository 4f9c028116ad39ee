// Rays and points around the planet, in the altitude form. No radius is squared in f32, which would cost metres at the
// horizon (docs/numerics.md). Positions are relative to the eye. `frame.view` has from f64 the altitude of the eye, its
// distance to the planet's centre, its zenith, and its power (h - H)(2 R + h + H) for spheres at altitude H.
#import math
#import bindings

struct Hit {
    near: f32, // distance to the first crossing in front of the origin; 0 from inside
    far: f32, // distance to the last crossing
    hit: bool, // whether the ray meets the sphere
    enters: bool, // whether the ray starts outside or on the surface and goes in
}

// Crossings of a ray with a sphere. `b` is the distance of the ray's origin to the planet's centre times the zenith
// cosine of the ray, `power` the power of the origin for the sphere.
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

// Crossings of a ray from the eye with the sphere for which the eye has the power `power`.
fn hit_sphere(direction: vec3f, power: f32) -> Hit {
    return crossing(frame.view.centre_distance * dot(frame.view.zenith, direction), power);
}

// Crossings of a ray from a point with the sphere at an altitude.
fn hit_sphere_from(p: vec3f, direction: vec3f, altitude: f32) -> Hit {
    let radius = params.atmosphere.planet_radius;
    let h = altitude_at(p);
    let b = (radius + h) * cos_zenith_at(p, direction);
    return crossing(b, (h - altitude) * (2.0 * radius + h + altitude));
}

// Crossings of a ray from a point with the ground. A point under the ground counts as on it: rounding puts half of the
// points on the ground below it.
fn hit_ground_from(p: vec3f, direction: vec3f) -> Hit {
    let radius = params.atmosphere.planet_radius;
    let h = altitude_at(p);
    let b = (radius + h) * cos_zenith_at(p, direction);
    return crossing(b, max(h, 0.0) * (2.0 * radius + h));
}

// Altitude of a point, m. The lower bound of the divisor avoids 0 / 0 at the planet's centre.
fn altitude_at(p: vec3f) -> f32 {
    let rh = frame.view.centre_distance;
    let d = dot(p, p) + 2.0 * rh * dot(frame.view.zenith, p);
    return frame.view.altitude + d / max(rh + sqrt(max(rh * rh + d, 0.0)), 1e-3);
}

// Zenith cosine of a unit direction at a point.
fn cos_zenith_at(p: vec3f, direction: vec3f) -> f32 {
    let up = frame.view.zenith * frame.view.centre_distance + p;
    return dot(up, direction) / max(length(up), 1.0);
}

// Zenith cosine of a ray from the eye at the point of a given distance and altitude, without a square root.
fn cos_zenith_along(direction: vec3f, distance: f32, altitude: f32) -> f32 {
    let up = frame.view.centre_distance * dot(frame.view.zenith, direction) + distance;
    return up / (params.atmosphere.planet_radius + altitude);
}

// Part of a ray that can meet clouds: up to two segments, the second after the ray has passed below the base. It
// extends to the last exit from the shell; an end at the first exit cuts a band along the horizon.
struct Segments {
    start: f32,
    first: f32, // length of the first segment
    gap: f32, // length of the gap after it
    second: f32, // length of the second segment
}

// Segments of a ray from the eye, up to the ground.
fn cloud_segments(direction: vec3f) -> Segments {
    let ground = hit_sphere(direction, frame.view.power_ground);
    let end = select(1e30, ground.near, ground.enters);
    if VOLUME {
        return box_stretch(vec3f(0.0), direction, end);
    }
    let top = hit_sphere(direction, frame.view.power_top);
    return stretches_between(top, hit_sphere(direction, frame.view.power_base), end);
}

// Segments of a ray from a point, without regard to the ground.
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

// Segment in the box of the user's grid. A direction along a face is divided by 1e-20 instead of 0 (docs/numerics.md).
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

// Distance along a ray of the point `x` metres into its segments.
fn stretch_distance(s: Segments, x: f32) -> f32 {
    return s.start + x + select(0.0, s.gap, x > s.first);
}
