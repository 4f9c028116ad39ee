// Display of a picture in a window, in 8 bits: exposure and tone map, equal to those of color.rs for pictures in
// memory.
#import bindings
#import color

@compute @workgroup_size(8, 8)
fn display(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2u(id.x, dispatch.first_row + id.y);
    if id.x >= frame.view.width || id.y >= dispatch.rows {
        return;
    }
    // `shown` is the exposure as a factor, and the index of a tone map in TONE_MAPS of color.rs.
    let radiance = shown.x * image[pixel.y * frame.view.width + pixel.x].rgb;
    var color = encode_srgb(radiance);
    if shown.y == 0.0 {
        color = agx(radiance);
    } else if shown.y == 1.0 {
        color = aces(radiance);
    }
    // Dither by half a step of blue noise to either side, equal to that of color.rs; the store rounds. Ranks are the
    // lower ends of their intervals, hence half an interval is added.
    let noise = textureLoad(blue_noise, pixel % BLUE_SIZE, 0).r + 0.5 / f32(BLUE_SIZE * BLUE_SIZE) - 0.5;
    textureStore(screen, pixel, vec4f(color + noise / 255.0, 1.0));
}
