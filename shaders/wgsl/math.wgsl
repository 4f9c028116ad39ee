// Small functions that stay finite where the textbook form does not (docs/numerics.md).

const PI = 3.14159265358979;

// Where v lies between a and b, 0 to 1. Defined for a = b too, where the plain remap is 0/0 (hazard 7).
fn remap01(v: f32, a: f32, b: f32) -> f32 {
    return saturate((v - a) / max(b - a, 1e-4));
}

// (1 - exp(-x)) / x. The plain form loses all its digits below x = 1e-6 in f32 (hazard 4); this one is right to
// 2.2e-6 with the worst exp that WGSL allows.
fn one_minus_exp_over(x: f32) -> f32 {
    if x < 0.1 {
        return 1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0)));
    }
    return (1.0 - exp(-x)) / x;
}

fn one_minus_exp_over3(x: vec3f) -> vec3f {
    return vec3f(one_minus_exp_over(x.r), one_minus_exp_over(x.g), one_minus_exp_over(x.b));
}

// exp(-depth) for an optical depth from 0: 1 exactly for 0, where exp may be 6e-8 less (hazard 8).
fn transmittance_of(depth: f32) -> f32 {
    return select(exp(-depth), 1.0 - depth * one_minus_exp_over(depth), depth < 0.1);
}

// nubis2015's weights of three octaves.
fn fbm3(octaves: vec3f) -> f32 {
    return dot(octaves, vec3f(0.625, 0.25, 0.125));
}
