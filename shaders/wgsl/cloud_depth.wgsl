// Optical depth of all clouds along a ray, integrated by panels.
#import bindings
#import shell
#import panels
#import ground_shadow

// Largest number of panels: it keeps a shader below lavapipe's limit of 65,535 loop iterations (docs/numerics.md).
const MAX_SUN_PANELS = 16384u;

// Optical depth of all clouds along a ray from a point.
fn depth_from(p: vec3f, direction: vec3f) -> f32 {
    let s = cloud_stretches_from(p, direction);
    let length = s.first + s.second;
    // Longer panels where `MAX_SUN_PANELS` of the finest would not cover the ray.
    let longest = max(2.0 * finest_feature(), length / f32(MAX_SUN_PANELS));
    var depth = 0.0;
    var x = 0.0;
    for (var i = 0u; i < 2u * MAX_SUN_PANELS && x < length; i++) {
        let panel = panel_from(p, direction, s, x, min(longest, length - x));
        depth += panel_depth(panel, read_panel(panel, p, direction, s, 0.0).density);
        x = panel.end;
    }
    return depth + high_depth_from(p, direction);
}
