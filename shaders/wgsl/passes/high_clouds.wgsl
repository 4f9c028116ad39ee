// Bakes the texture of the high clouds: octaves of noise that are replaced at their own rates (gems2001).
#import bindings
#import gradient_noise

// Updates after which their numbers come round, as in frame.rs.
const UPDATES = 65536u;

@compute @workgroup_size(8, 8)
fn high_clouds(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    let p = vec3f((vec2f(id.xy) + 0.5) / vec2f(size), 0.5);
    // Streaks lie along x: fewer cells along than across. The field is swirled so that they are not ruled lines.
    let seed = params.high_clouds.seed * 61u;
    let swirl = vec3f(perlin(p, 3u, seed + 51u), perlin(p, 3u, seed + 52u), 0.0);
    let at = p + 0.1 * swirl;
    var sum = 0.0;
    var total = 0.0;
    var amplitude = 1.0;
    for (var i = 0u; i < params.high_clouds.octaves; i++) {
        // Small octaves are replaced more often; between two updates each fades linearly from the old to the new.
        let age = select(frame.high_age, frame.high_age_small, i >= 4u)[i % 4u];
        let update = u32(select(frame.high_update, frame.high_update_small, i >= 4u)[i % 4u]);
        let before = streaks(at, 4u << i, seed + i * 7u + update * 977u);
        // The numbers come round (frame.rs): after the last update comes the first.
        let after = streaks(at, 4u << i, seed + i * 7u + (update + 1u) % UPDATES * 977u);
        // The variance of the blend dips halfway; dividing it out keeps the cover steady.
        let steady = inverseSqrt(age * age + (1.0 - age) * (1.0 - age));
        sum += amplitude * mix(before, after, age) * steady;
        total += amplitude;
        amplitude *= 0.62;
    }
    textureStore(map_out, id.xy, vec4f(vec3f(saturate(0.5 + 0.75 * sum / total)), 1.0));
}

// Perlin noise stretched along x by squeezing its cells across; whole cells a tile either way, so it tiles.
fn streaks(p: vec3f, period: u32, salt: u32) -> f32 {
    let across = max(u32(round(f32(period) * sqrt(params.high_clouds.stretch))), 1u);
    let along = max(u32(round(f32(period) / sqrt(params.high_clouds.stretch))), 1u);
    let q = fract(p.xy) * vec2f(f32(along), f32(across));
    let cell = vec2i(floor(q));
    let f = q - floor(q);
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    var corner: array<f32, 4>;
    for (var i = 0; i < 4; i++) {
        let o = vec2i(i & 1, i >> 1);
        let wrapped = wrap_cell(vec3i(cell + o, 0), vec3i(i32(along), i32(across), 1));
        let gradient = random3(wrapped, salt).xy * 2.0 - 1.0;
        corner[i] = dot(gradient, f - vec2f(o));
    }
    return 1.4 * mix(mix(corner[0], corner[1], w.x), mix(corner[2], corner[3], w.x), w.y);
}
