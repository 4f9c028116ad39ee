// Light model `nubis2015`: Beer's law, times powder, times Henyey-Greenstein, times 2, plus ambient light.
#import bindings
#import marched_light
#import beer_powder

const AMBIENT = true;

fn lobe_phase(one_minus_mu: f32) -> f32 {
    return henyey_greenstein(one_minus_mu, params.light.g);
}

fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    let d = scaled_depth(depth, precipitation);
    return beer_powder(exp(-d), d, turned);
}

fn slowest_extinction() -> f32 {
    return params.light.absorption;
}
