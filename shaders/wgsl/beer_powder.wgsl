// Scattering of the published models: Beer's law on a scaled optical depth, times powder, times 2 (nubis2015).
#import bindings
#import phase

// Optical depth of the models: scaled down, and up again in rain (nubis2015's p).
fn scaled_depth(depth: f32, precipitation: f32) -> f32 {
    return depth * params.light.absorption * mix(1.0, params.light.rain_absorption, precipitation);
}

// Radiance per unit of irradiance and of optical depth, for the transmittance `beer` of a scaled optical depth.
fn beer_powder(beer: f32, scaled: f32, turned: Turn) -> f32 {
    let powder = 1.0 - params.light.powder * exp(-2.0 * scaled);
    return 2.0 * params.light.sun_gain * beer * powder * turned.phase;
}
