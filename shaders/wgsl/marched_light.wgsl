// Light of the models that march toward the sun: `seen_scattering` of a light model for the optical depth toward the
// sun, and ambient light by two streams.
#import math
#import light
#import ambient
#import ground_shadow

// Weight of a sample of optical depth `x` behind a transmittance: the share of the eye's light that it scatters.
fn sample_weight(transmittance: f32, depth: f32, x: f32) -> f32 {
    return transmittance * x * one_minus_exp_over(x);
}

// Whether what lies behind is negligible.
fn is_opaque(transmittance: f32, depth: f32) -> bool {
    return transmittance < params.quality.min_transmittance;
}

// Factor on the radiance of a ray that ends early: the rest is assumed to have the mean radiance of the marched part.
fn tail_scale(transmittance: f32) -> f32 {
    return 1.0 / (1.0 - transmittance);
}

// Optical depth at which a converged ray ends: fully lit cloud behind it is negligible.
fn opaque_depth() -> f32 {
    return 18.0;
}

// Fraction of the ambient light at a sample that comes from above.
fn sky_share(column: WeatherSample) -> f32 {
    return ambient_share(column);
}

// Optical depth from a sample toward the sun.
fn depth_toward_sun(p: vec3f, opacity: f32, width: f32) -> f32 {
    return optical_depth_to_sun(p, opacity, width);
}

fn lit_span(span: Span, p: vec3f, direction: vec3f, turned: Turn) -> Lit {
    let sun = seen_scattering(span.depth_to_sun, span.precipitation, turned);
    return Lit(span.weight, sun, span.above, 1.0 - span.above, span.distance);
}

// Light of the ground under a point, relative to that without clouds.
fn ground_factor(p: vec3f, mu: f32) -> vec3f {
    return vec3f(ground_share());
}

// Radiance of the ground at a point of it that the fraction `sun` of the sun's light reaches.
fn ground_under(p: vec3f, mu: f32, sun: f32) -> vec3f {
    return ground_radiance(mu) - (1.0 - sun) * kept_sunlight(mu);
}

// Reflected sunlight of the ground that clouds may block, part of `ground_radiance`.
fn kept_sunlight(mu: f32) -> vec3f {
    return (1.0 - PASSED_ON) * params.atmosphere.ground_albedo / PI * sun_irradiance(0.0, mu) * max(mu, 0.0);
}

// Ambient light of a sky and a ground of the given radiances.
fn ambient_light(above: f32, below: f32, sky: vec3f, ground: vec3f) -> vec3f {
    return above * ambient_above(clouded_sky(sky)) + below * ambient_below(ground);
}

// Mean radiance over the sphere of the sunlight that clouds scatter to the air, where they take the fraction `shade`
// of the sun's: isotropic light from above.
fn cloud_light(p: vec3f, altitude: f32, mu: f32, shade: f32) -> f32 {
    return PASSED_ON * max(mu, 0.0) / (2.0 * PI) * shade;
}

// Radiance per unit of irradiance that a uniform layer of an optical depth across it sends to the eye. `mu_sun` and
// `mu` are the cosines of the sun's ray and of the view ray to its normal; `behind` is the sine of the sun's elevation
// beyond the layer as seen from the eye, negative on the eye's side.
fn layer_light(optical_depth: f32, mu_sun: f32, mu: f32, behind: f32, turned: Turn) -> f32 {
    let along = optical_depth / mu;
    let depth = depth_to_sun(along, optical_depth / mu_sun, behind);
    return (1.0 - transmittance_of(along)) * seen_scattering(depth, 0.0, turned);
}

// Light of the background that clouds have scattered forward.
fn forward_background(direction: vec3f, transmittance: f32, depth: f32) -> vec3f {
    return vec3f(0.0);
}
