// Light model `thesis2018`: `nubis2015` with a slower second term of Beer's law and the larger of two lobes.
#import bindings
#import marched_light
#import beer_powder

const AMBIENT = true;

fn lobe_phase(one_minus_mu: f32) -> f32 {
    let forward = henyey_greenstein(one_minus_mu, params.light.g);
    return max(forward, henyey_greenstein(one_minus_mu, params.light.g_back));
}

fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    let d = scaled_depth(depth, precipitation);
    return beer_powder(max(exp(-d), 0.7 * exp(-0.5 * d)), d, turned);
}

fn slowest_extinction() -> f32 {
    return params.light.absorption * 0.5;
}
