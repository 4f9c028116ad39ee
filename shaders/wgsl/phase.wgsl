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
