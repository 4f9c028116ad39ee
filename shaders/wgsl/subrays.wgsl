// Several rays through a pixel that is wider than what is in the clouds, as pixels are that look at a planet from space: what
// is smaller than a pixel shows with its mean, as much of it as there is, and not as speckle.
#import bindings
#import camera
#import shell
#import sample_grid

// How many rays are marched through a pixel: as many as clouds fit into it where its ray meets them.
fn rays_through(view: vec3f) -> f32 {
    if !SUBRAYS {
        return 1.0;
    }
    let width = cloud_segments(view).start * pixel_width(view) * f32(spacing()) / (CLOUD_WIDTH * frame.sky.leap_scale);
    return clamp(ceil(width * width), 1.0, frame.view.most_rays);
}

// Where in its pixel, or in what stands for it where not all are known, a ray lies; one alone in the middle.
fn ray_place(pixel: vec2u, at: vec2f, rays: f32) -> vec2f {
    return vec2f(pixel) + 0.5 + select(vec2f(0.0), (at - 0.5) * f32(spacing()), rays > 1.0);
}
