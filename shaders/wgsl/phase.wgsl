// Phase functions, 1/sr: each integrates to 1 over the sphere.
#import math

// Scattering angle of sunlight toward the eye, as 1 minus its cosine, and the phase function, averaged over a pixel.
struct Turn {
    one_minus_mu: f32,
    phase: f32,
}

// Henyey and Greenstein 1941. `one_minus_mu` is 1 minus the cosine of the scattering angle, between the light's
// direction of travel before and after. With it, and with 1 - g, the denominator keeps its digits: 1 + g^2 - 2 g mu is
// off by 8 % in f32 at g = 0.999, and negative, which gives NaN, from g = 0.9997 (docs/numerics.md).
fn henyey_greenstein(one_minus_mu: f32, g: f32) -> f32 {
    // A backward lobe peaks at 1 + mu = 0; the difference to 2 is exact near 2.
    let from_peak = select(one_minus_mu, 2.0 - one_minus_mu, g < 0.0);
    let a = abs(g);
    let den = (1.0 - a) * (1.0 - a) + 2.0 * a * from_peak;
    return (1.0 - g) * (1.0 + g) / (4.0 * PI * den * sqrt(den));
}

// 1 minus the cosine of the angle between two unit vectors, without cancellation at small angles.
fn one_minus_cos(a: vec3f, b: vec3f) -> f32 {
    let d = a - b;
    return min(0.5 * dot(d, d), 2.0);
}

// Draine 2003: Henyey and Greenstein's function times 1 + alpha mu^2, normalised.
fn draine(one_minus_mu: f32, g: f32, alpha: f32) -> f32 {
    let mu = 1.0 - one_minus_mu;
    return henyey_greenstein(one_minus_mu, g) * (1.0 + alpha * mu * mu) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0);
}

// Direction sampled by Henyey and Greenstein's function about `direction`, for two random numbers. The sample is
// 1 - mu: the published inverse cancels near |g| = 1 (docs/numerics.md).
fn scattered(direction: vec3f, g: f32, u: vec2f) -> vec3f {
    return rotate_by(direction, scattered_cosine(g, u.x), u.y);
}

// Sample of 1 minus the cosine of the scattering angle.
fn scattered_cosine(g: f32, u: f32) -> f32 {
    if abs(g) <= 1e-4 {
        return 2.0 * u;
    }
    let s = (1.0 - g) * (1.0 + g) / (1.0 - g + 2.0 * g * u);
    return clamp((s + 1.0 - g) * (1.0 - g) * (1.0 - u) / (1.0 - g + 2.0 * g * u), 0.0, 2.0);
}

// Direction at an angle to `direction`, given as 1 minus its cosine, with a random azimuth.
fn rotate_by(direction: vec3f, one_minus_mu: f32, u: f32) -> vec3f {
    let sine = sqrt(one_minus_mu * (2.0 - one_minus_mu));
    let angle = 2.0 * PI * u - PI;
    let across = perpendicular(direction);
    let side = cos(angle) * across + sin(angle) * cross(direction, across);
    return normalize((1.0 - one_minus_mu) * direction + sine * side);
}

// Unit vector orthogonal to a unit vector.
fn perpendicular(v: vec3f) -> vec3f {
    return normalize(select(cross(v, vec3f(1.0, 0.0, 0.0)), cross(v, vec3f(0.0, 0.0, 1.0)), abs(v.x) > 0.7));
}
