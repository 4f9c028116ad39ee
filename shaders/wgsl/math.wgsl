// Functions that stay finite and precise where the textbook form does not (docs/numerics.md).

const PI = 3.14159265358979;

// Position of v between a and b, clamped to [0, 1]. It is defined at a = b, where the plain remap is 0/0.
fn remap01(v: f32, a: f32, b: f32) -> f32 {
    return saturate((v - a) / max(b - a, 1e-4));
}

// (1 - exp(-x)) / x. The plain form loses all digits below x = 1e-6 in f32. This form has an error of at most 2.2e-6
// with the least accurate exp that WGSL allows.
fn one_minus_exp_over(x: f32) -> f32 {
    if x < 0.1 {
        return 1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0)));
    }
    return (1.0 - exp(-x)) / x;
}

fn one_minus_exp_over3(x: vec3f) -> vec3f {
    return vec3f(one_minus_exp_over(x.r), one_minus_exp_over(x.g), one_minus_exp_over(x.b));
}

// exp(-depth) for an optical depth of at least 0: exactly 1 at 0, where exp may be 6e-8 less.
fn transmittance_of(depth: f32) -> f32 {
    return select(exp(-depth), 1.0 - depth * one_minus_exp_over(depth), depth < 0.1);
}

// FBM of three octaves with nubis2015's weights.
fn fbm3(octaves: vec3f) -> f32 {
    return dot(octaves, vec3f(0.625, 0.25, 0.125));
}
