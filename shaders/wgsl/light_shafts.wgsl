// The shadows of clouds on the air: how much less light the air before a distance sends than without them, as it is baked for
// each picture by place and distance (passes/light_shafts).
#import bindings
#import camera

// m from where they begin within which distances are as good as evenly spread.
const SHAFT_BEND = 2000.0;

// The distance at a share of the slices, and the share at a distance.
fn shaft_distance(share: f32) -> f32 {
    let most = log(1.0 + frame.view.shaft_length / SHAFT_BEND);
    return frame.view.shaft_start + SHAFT_BEND * (exp(share * most) - 1.0);
}

fn shaft_share(distance: f32) -> f32 {
    let most = log(1.0 + frame.view.shaft_length / SHAFT_BEND);
    return saturate(log(1.0 + max(distance - frame.view.shaft_start, 0.0) / SHAFT_BEND) / most);
}

// Where they have a direction: the outer texels lie on the rim of the picture, so that a panorama has no seam.
fn shaft_texel(direction: vec3f) -> vec2f {
    let level = vec2f(dot(direction, frame.view.right), dot(direction, frame.view.up));
    let local = vec3f(level, dot(direction, frame.view.forward));
    let place = picture_place(local, frame.view.tan_half_fov, frame.view.half_fov).xy * vec2f(0.5, -0.5) + 0.5;
    let size = vec2f(textureDimensions(light_shafts).xy);
    return (saturate(place) * (size - 1.0) + 0.5) / size;
}

// What the air before a distance lacks, for the texel of its direction.
fn shafts_before(texel: vec2f, distance: f32) -> vec3f {
    let slices = f32(textureDimensions(light_shafts).z);
    let at = vec3f(texel, (shaft_share(distance) * (slices - 1.0) + 0.5) / slices);
    return textureSampleLevel(light_shafts, clamp_sampler, at, 0.0).rgb * (params.sun.irradiance / frame.sky.sky_scale);
}
