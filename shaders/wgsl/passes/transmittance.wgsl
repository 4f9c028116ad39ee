// Bakes the transmittance LUT: optical depth of the air from any altitude to space, by direction (Hillaire 2020,
// "transmittance").
#import bindings
#import atmosphere

// Pieces of a ray, each integrated in closed form. On the longest ray, 1100 km from the ground through the horizon, the
// planet curves by 50 m within a piece.
const PIECES = 64u;

@compute @workgroup_size(8, 8)
fn transmittance_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // Inverse of `transmittance_lut_coordinates` at texel centres.
    let at = vec2f(id.xy) / vec2f(size - 1u);
    let radius = params.atmosphere.planet_radius;
    let whole = sqrt(AIR_TOP * (2.0 * radius + AIR_TOP));
    let horizon = at.y * whole;
    let h = horizon * horizon / (radius + sqrt(radius * radius + horizon * horizon));
    let nearest = AIR_TOP - h;
    let distance = max(mix(nearest, horizon + whole, at.x), 1e-3);
    let r = radius + h;
    let power = (AIR_TOP - h) * (2.0 * radius + h + AIR_TOP);
    let mu = clamp((power - distance * distance) / (2.0 * r * distance), -1.0, 1.0);
    var depth = vec3f(0.0);
    var before = h;
    for (var i = 1u; i <= PIECES; i++) {
        let t = distance * f32(i) / f32(PIECES);
        let d = t * (t + 2.0 * r * mu);
        let after = max(h + d / (r + sqrt(max(r * r + d, 0.0))), 0.0);
        depth += air_depth_between(before, after, distance / f32(PIECES));
        before = after;
    }
    textureStore(map_out, id.xy, vec4f(min(depth, vec3f(1e4)), 1.0));
}
