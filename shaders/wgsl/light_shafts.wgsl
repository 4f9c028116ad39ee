// Light shafts: radiance that the air before a distance lacks in the shadows of clouds, baked for each picture by
// position in the picture and distance (passes/light_shafts).
#import bindings
#import camera

// Distance from the first slice up to which slices are about evenly spaced, m.
const SHAFT_BEND = 2000.0;

// Distance at a fraction of the slices, and its inverse.
fn shaft_distance(share: f32) -> f32 {
    let most = log(1.0 + frame.view.shaft_length / SHAFT_BEND);
    return frame.view.shaft_start + SHAFT_BEND * (exp(share * most) - 1.0);
}

fn shaft_share(distance: f32) -> f32 {
    let most = log(1.0 + frame.view.shaft_length / SHAFT_BEND);
    return saturate(log(1.0 + max(distance - frame.view.shaft_start, 0.0) / SHAFT_BEND) / most);
}

// Texture coordinates of a direction. The outer texels lie on the edges of the picture, so that a panorama has no seam.
fn shaft_texel(direction: vec3f) -> vec2f {
    let level = vec2f(dot(direction, frame.view.right), dot(direction, frame.view.up));
    let local = vec3f(level, dot(direction, frame.view.forward));
    let place = picture_place(local, frame.view.tan_half_fov, frame.view.half_fov).xy * vec2f(0.5, -0.5) + 0.5;
    let size = vec2f(textureDimensions(light_shafts).xy);
    return (saturate(place) * (size - 1.0) + 0.5) / size;
}

// Radiance that the air before a distance lacks, at the texel of its direction.
fn shafts_before(texel: vec2f, distance: f32) -> vec3f {
    let slices = f32(textureDimensions(light_shafts).z);
    let at = vec3f(texel, (shaft_share(distance) * (slices - 1.0) + 0.5) / slices);
    return textureSampleLevel(light_shafts, clamp_sampler, at, 0.0).rgb * (params.sun.irradiance / frame.sky.sky_scale);
}
