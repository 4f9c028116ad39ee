// Phase functions: the share of light scattered per steradian; each integrates to 1 over the sphere.
#import math

// Henyey and Greenstein 1941. `one_minus_mu` is 1 minus the cosine between the direction the light travels and the
// direction it is scattered to. Both come in this form because 1 + g^2 - 2 g mu loses 8 % in f32 at g = 0.999 and
// turns negative, hence NaN, from g = 0.9997 (hazard 5).
fn henyey_greenstein(one_minus_mu: f32, g: f32) -> f32 {
    // A backward lobe peaks where 1 + cos is small; near 2, the difference to 2 is exact.
    let from_peak = select(one_minus_mu, 2.0 - one_minus_mu, g < 0.0);
    let a = abs(g);
    let den = (1.0 - a) * (1.0 - a) + 2.0 * a * from_peak;
    return (1.0 - g) * (1.0 + g) / (4.0 * PI * den * sqrt(den));
}

// 1 minus the cosine between two unit vectors, without cancellation near zero.
fn one_minus_cos(a: vec3f, b: vec3f) -> f32 {
    let d = a - b;
    return min(0.5 * dot(d, d), 2.0);
}

// Draine 2003: Henyey and Greenstein's function times 1 + alpha mu^2, normalised.
fn draine(one_minus_mu: f32, g: f32, alpha: f32) -> f32 {
    let mu = 1.0 - one_minus_mu;
    return henyey_greenstein(one_minus_mu, g) * (1.0 + alpha * mu * mu) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0);
}

// A direction scattered from `direction` by Henyey and Greenstein's function, for two random numbers. The cosine comes as
// its difference to 1, without the cancellations of the printed form (hazard 5).
fn scattered(direction: vec3f, g: f32, u: vec2f) -> vec3f {
    return rotate_by(direction, scattered_cosine(g, u.x), u.y);
}

// Of that, 1 minus the cosine.
fn scattered_cosine(g: f32, u: f32) -> f32 {
    if abs(g) <= 1e-4 {
        return 2.0 * u;
    }
    let s = (1.0 - g) * (1.0 + g) / (1.0 - g + 2.0 * g * u);
    return clamp((s + 1.0 - g) * (1.0 - g) * (1.0 - u) / (1.0 - g + 2.0 * g * u), 0.0, 2.0);
}

// The direction at an angle to `direction` whose cosine is less than 1 by `one_minus_mu`, at a random place around it.
fn rotate_by(direction: vec3f, one_minus_mu: f32, u: f32) -> vec3f {
    let sine = sqrt(one_minus_mu * (2.0 - one_minus_mu));
    let angle = 2.0 * PI * u - PI;
    let across = perpendicular(direction);
    let side = cos(angle) * across + sin(angle) * cross(direction, across);
    return normalize((1.0 - one_minus_mu) * direction + sine * side);
}

// A unit vector at right angles to a unit vector.
fn perpendicular(v: vec3f) -> vec3f {
    return normalize(select(cross(v, vec3f(1.0, 0.0, 0.0)), cross(v, vec3f(0.0, 0.0, 1.0)), abs(v.x) > 0.7));
}
