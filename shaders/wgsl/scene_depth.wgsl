// User's scene: its distance along each pixel's ray and its radiance there.
#import bindings
#import shell

// Distance along the ray of a pixel to the scene, m.
fn scene_distance(pixel: vec2u) -> f32 {
    if !SCENE {
        return NO_SCENE;
    }
    return textureLoad(scene_depth, scene_texel(pixel), 0).r;
}

// Radiance of the scene at a pixel; 0 if the user gives none.
fn scene_radiance(pixel: vec2u) -> vec3f {
    let lit = frame.view.scene_lit > 0u;
    return select(vec3f(0.0), textureLoad(scene_color, select(vec2u(0u), scene_texel(pixel), lit), 0).rgb, lit);
}

fn scene_texel(pixel: vec2u) -> vec2u {
    return scene_texel_of((pixel.y - dispatch.strip_row) * frame.view.width + pixel.x);
}

// Texel of pixel `index` of the strip.
fn scene_texel_of(index: u32) -> vec2u {
    return vec2u(index % SCENE_ROW, index / SCENE_ROW);
}

// Part of a ray's segments in front of a distance along the ray.
fn segments_before(s: Segments, distance: f32) -> Segments {
    if !SCENE {
        return s;
    }
    let first = clamp(distance - s.start, 0.0, s.first);
    let second = clamp(distance - s.start - s.first - s.gap, 0.0, s.second);
    return Segments(s.start, first, s.gap, second);
}
