// Light model `octaves`: multiple scattering as octaves of single scattering, each with less light, less extinction and
// less anisotropy (Wrenninge et al. 2013, Hillaire 2016). The high clouds have no thickness and use it with the path
// tracer, too.
#import bindings
#import marched_light
#import droplets

const AMBIENT = true;

fn lobe_phase(one_minus_mu: f32) -> f32 {
    return henyey_greenstein(one_minus_mu, params.light.g);
}

fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    return params.light.albedo * octaves(depth, turned);
}

fn octaves(depth: f32, turned: Turn) -> f32 {
    var sum = 0.0;
    var share = 1.0;
    var d = depth;
    var peak = 1.0;
    for (var i = 0u; i < params.light.octaves; i++) {
        var phase = turned.phase;
        if i > 0u {
            if PHASE == PHASE_HENYEY_GREENSTEIN {
                phase = henyey_greenstein(turned.one_minus_mu, peak * params.light.g);
            } else {
                phase = droplet_fit(turned.one_minus_mu, peak);
            }
        }
        sum += share * phase * exp(-d);
        share *= params.light.octave_scattering;
        d *= params.light.octave_extinction;
        peak *= params.light.octave_phase;
    }
    return sum;
}

fn slowest_extinction() -> f32 {
    return pow(params.light.octave_extinction, f32(params.light.octaves - 1u));
}
