// Light model `vsu2022`: `nubis2015` with a blend of two lobes.
#import bindings
#import marched_light
#import beer_powder

const AMBIENT = true;

fn lobe_phase(one_minus_mu: f32) -> f32 {
    let forward = henyey_greenstein(one_minus_mu, params.light.g);
    return mix(henyey_greenstein(one_minus_mu, params.light.g_back), forward, params.light.lobe_mix);
}

fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    let d = scaled_depth(depth, precipitation);
    return beer_powder(exp(-d), d, turned);
}

fn slowest_extinction() -> f32 {
    return params.light.absorption;
}
