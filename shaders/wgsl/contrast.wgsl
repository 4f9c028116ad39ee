// Contrast between clouds: the criterion of adaptive sampling and of history validation.
#import bindings

// Brightness of a pixel of `clouds`: its largest channel.
fn brightness(cloud: vec4f) -> f32 {
    return max(max(cloud.r, cloud.g), cloud.b);
}

// Contrast of a group of pixels from the minima (x) and maxima (y) of their brightness and transmittance: the larger of
// the difference in transmittance and the relative difference in brightness. The latter is relative to the brightest of
// them or to the sky seen through them, whichever is brighter.
fn contrast(light: vec2f, transmittance: vec2f) -> f32 {
    let against = max(light.y, transmittance.y * brightness(sky_light_uniform[0]));
    return max(transmittance.y - transmittance.x, (light.y - light.x) / max(against, 1e-30));
}

fn contrast_of_two(a: vec4f, b: vec4f) -> f32 {
    let light = vec2f(brightness(a), brightness(b));
    return contrast(
        vec2f(min(light.x, light.y), max(light.x, light.y)),
        vec2f(min(a.a, b.a), max(a.a, b.a)),
    );
}
