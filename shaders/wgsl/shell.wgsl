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
    return crossing(frame.centre_distance * dot(frame.zenith, direction), power);
}

// Altitude of a point.
fn altitude_at(p: vec3f) -> f32 {
    let rh = frame.centre_distance;
    let d = dot(p, p) + 2.0 * rh * dot(frame.zenith, p);
    return frame.altitude + d / (rh + sqrt(max(rh * rh + d, 0.0)));
}

// Cosine between a unit direction and the local zenith at a point.
fn cos_zenith_at(p: vec3f, direction: vec3f) -> f32 {
    let up = frame.zenith * frame.centre_distance + p;
    return dot(up, direction) / max(length(up), 1.0);
}

// The part of a ray inside the cloud shell: up to two stretches, the second after the ray has passed under the base.
// It runs to the last exit of the shell: ending it at the first would cut a band along the horizon.
struct Stretches {
    start: f32,
    first: f32, // length of the first stretch
    gap: f32, // length of the gap after it
    second: f32, // length of the second stretch
}

fn cloud_stretches(direction: vec3f) -> Stretches {
    return stretches_between(
        hit_sphere(direction, frame.power_top),
        hit_sphere(direction, frame.power_base),
        hit_sphere(direction, frame.power_ground),
    );
}

fn stretches_between(outer: Hit, inner: Hit, ground: Hit) -> Stretches {
    if !outer.hit {
        return Stretches(0.0, 0.0, 0.0, 0.0);
    }
    let end = select(outer.far, min(outer.far, ground.near), ground.enters);
    if !inner.hit || inner.near >= end {
        return Stretches(outer.near, max(end - outer.near, 0.0), 0.0, 0.0);
    }
    let first = max(inner.near - outer.near, 0.0);
    let second = max(end - inner.far, 0.0);
    if first == 0.0 {
        return Stretches(inner.far, second, 0.0, 0.0);
    }
    return Stretches(outer.near, first, inner.far - inner.near, second);
}
