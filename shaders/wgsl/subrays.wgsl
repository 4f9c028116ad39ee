// Subrays: several rays through a pixel that is wider than clouds, such as the pixels of a planet seen from space.
// Clouds smaller than a pixel contribute their mean, in proportion to their cover, instead of speckle.
#import bindings
#import camera
#import shell
#import sample_grid

// Number of rays through a pixel: the number of clouds that fit into it at the distance where its ray meets the clouds.
fn rays_through(view: vec3f) -> f32 {
    if !SUBRAYS {
        return 1.0;
    }
    let width = cloud_segments(view).start * pixel_width(view) * f32(spacing()) / (CLOUD_WIDTH * frame.sky.leap_scale);
    return clamp(ceil(width * width), 1.0, frame.view.most_rays);
}

// Position of a ray, pixels. Several rays are spread over the pixel, at low resolution over the spacing of samples. A
// single ray passes through the centre.
fn ray_place(pixel: vec2u, at: vec2f, rays: f32) -> vec2f {
    return vec2f(pixel) + 0.5 + select(vec2f(0.0), (at - 0.5) * f32(spacing()), rays > 1.0);
}
