// How unlike clouds look: what adaptive sampling and the validation of a history decide by.
#import bindings

// The light of a pixel of `clouds`: its brightest channel.
fn brightness(cloud: vec4f) -> f32 {
    return max(max(cloud.r, cloud.g), cloud.b);
}

// The contrast of clouds whose light and transmittance lie between a least and a most: the larger of the difference in
// transmittance and that in light, which counts by what it is seen against, the brightest of them or the sky behind it.
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
