// Shows a picture on a screen, in 8 bits: exposure and tone map, as color.rs does for pictures in memory.
#import bindings
#import color

@compute @workgroup_size(8, 8)
fn display(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2u(id.x, frame.first_row + id.y);
    if id.x >= frame.width || id.y >= frame.rows {
        return;
    }
    // Exposure as a factor, and which of color.rs's TONE_MAPS.
    let radiance = shown.x * image[pixel.y * frame.width + pixel.x].rgb;
    var color = encode_srgb(radiance);
    if shown.y == 0.0 {
        color = agx(radiance);
    } else if shown.y == 1.0 {
        color = aces(radiance);
    }
    textureStore(screen, pixel, vec4f(color, 1.0));
}
