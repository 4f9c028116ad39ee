// Light model `single`: physical single scattering with the phase function of the droplets.
#import bindings
#import marched_light
#import droplets

// Whether skylight is added.
const AMBIENT = false;

// Henyey-Greenstein phase function of the model.
fn lobe_phase(one_minus_mu: f32) -> f32 {
    return henyey_greenstein(one_minus_mu, params.light.g);
}

// Radiance per unit of irradiance and of optical depth along the view ray, for sunlight that has crossed the optical
// depth `depth`.
fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    return params.light.albedo * turned.phase * exp(-depth);
}

// Lowest factor on the optical depth toward the sun.
fn slowest_extinction() -> f32 {
    return 1.0;
}
