// Bakes the texture of the high clouds: octaves of noise that are replaced at their own rates (gems2001).
#import bindings
#import gradient_noise

// Updates after which their numbers come round, as in frame.rs.
const UPDATES = 65536u;

// Two texels in each invocation, as one number of the buffer holds them; its rows are padded as copies ask for.
@compute @workgroup_size(8, 8)
fn high_clouds(@builtin(global_invocation_id) id: vec3u) {
    let size = params.high_clouds.texture_size;
    if 2u * id.x >= size || id.y >= size {
        return;
    }
    var pair = vec2f(0.0);
    var x = 2u * id.x;
    loop {
        pair = vec2f(pair.y, cover((vec2f(vec2u(x, id.y)) + 0.5) / f32(size)));
        if x % 2u == 1u {
            break;
        }
        x++;
    }
    texels_out[id.y * ((size + 127u) / 128u * 64u) + id.x] = pack2x16float(pair);
}

// How much of the sky they cover at a place in the tile.
fn cover(uv: vec2f) -> f32 {
    let p = vec3f(uv, 0.5);
    // Streaks lie along x: fewer cells along than across. The field is swirled so that they are not ruled lines.
    let seed = params.high_clouds.seed * 61u;
    let swirl = vec3f(perlin(p, 3u, seed + 51u), perlin(p, 3u, seed + 52u), 0.0);
    let at = p + 0.1 * swirl;
    var sum = 0.0;
    var total = 0.0;
    var amplitude = 1.0;
    var i = 0u;
    loop {
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
        // Left at its end: lavapipe runs a loop that is left at its start once more, for nothing.
        i++;
        if i >= params.high_clouds.octaves {
            break;
        }
    }
    return saturate(0.5 + 0.75 * sum / total);
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
