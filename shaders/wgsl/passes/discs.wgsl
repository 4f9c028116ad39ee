// Radiance of the discs of sun and moon in the pixels that they cover, without clouds. `composite_discs` reads it from
// `image` and composites the clouds over it. The kernel is specialized by the projection alone: as part of
// `composite_discs` it took 4 s of compilation for each new specialization (Mesa 22.3, two cores).
#import bindings
#import disc

// Range of `columns` columns from `first_column` on; a panorama wraps around.
@compute @workgroup_size(8, 8)
fn discs(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.columns || id.y >= dispatch.rows {
        return;
    }
    let pixel = vec2u((dispatch.first_column + id.x) % frame.view.width, dispatch.first_row + id.y);
    let index = (pixel.y - dispatch.strip_row) * frame.view.width + pixel.x;
    image[index] = vec4f(discs_in_pixel(pixel), 0.0);
}
