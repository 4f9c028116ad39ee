// Radiance of the discs of sun and moon in the pixels that they cover, without clouds. `composite_discs` reads it from the
// picture and puts the clouds before it. The kernel depends on the projection alone: as a part of `composite_discs` it took
// 4 s of compilation for every new mixture of switches (Mesa 22.3, two cores).
#import bindings
#import disc

// `columns` columns from `first_column` on, around a panorama.
@compute @workgroup_size(8, 8)
fn discs(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns || id.y >= dispatch.rows {
        return;
    }
    let pixel = vec2u((dispatch.first_column + id.x) % frame.view.width, dispatch.first_row + id.y);
    let index = (pixel.y - dispatch.strip_row) * frame.view.width + pixel.x;
    image[index] = vec4f(discs_in_pixel(pixel), 0.0);
}
