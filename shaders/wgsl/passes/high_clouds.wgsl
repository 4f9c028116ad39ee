// Bakes the texture of the high clouds: octaves of noise, each replaced at its own rate (gems2001), of two patterns,
// the streaks of cirrus and the cells of altocumulus.
#import bindings
#import gradient_noise

// Cells per tile of the largest octave: of streaks, and of altocumulus cells.
const STREAKS = 4u;
const CELLS = 12u;
// Cells per tile of low-frequency noises: patches of altocumulus, the displacement of streaks and rows, the hooks of
// streaks, and the variation of the type between streaks and cells.
const PATCHES = 3u;
const SWIRLS = 3u;
const HOOKS = 8u;
const BLENDS = 2u;
// Displacement by swirls and hooks, in tiles, at a noise of 1.
const SWIRL = 0.1;
const HOOK = 0.015;

// Contrast of the patterns: deviation from 0.5 at a noise of 1, set by eye. Streaks are as deep as in the first version
// of this layer, which had five octaves, each with 0.62 of the amplitude of the one before. Altocumulus cells have
// gaps.
const STREAK_CONTRAST = 0.387;
const CELL_CONTRAST = 0.774;
const PATCH_CONTRAST = 0.45;
// Amplitude of the variation of the type where it is halfway.
const BLEND_CONTRAST = 1.6;

// Salts of the noises. An octave adds up to 49 and a multiple of 977 (`octave_at`); the values are chosen so that no
// two noises share a salt.
const SWIRL_SALT = 51u;
const BLEND_SALT = 53u;
const HOOK_SALT = 54u;
const PATCH_SALT = 500009u;
const CELL_SALT = 900001u;

@compute @workgroup_size(8, 8)
fn high_clouds(@builtin(global_invocation_id) id: vec3u) {
    bake(id, true, false);
}

@compute @workgroup_size(8, 8)
fn high_clouds_cells(@builtin(global_invocation_id) id: vec3u) {
    bake(id, false, true);
}

@compute @workgroup_size(8, 8)
fn high_clouds_mixed(@builtin(global_invocation_id) id: vec3u) {
    bake(id, true, true);
}

// Each invocation writes two texels, packed into one word of the buffer.
fn bake(id: vec3u, with_streaks: bool, with_cells: bool) {
    let size = params.high_clouds.texture_size;
    if 2u * id.x >= size || id.y >= size {
        return;
    }
    var pair = vec2f(0.0);
    var x = 2u * id.x;
    loop {
        pair = vec2f(pair.y, cover((vec2f(vec2u(x, id.y)) + 0.5) / f32(size), with_streaks, with_cells));
        if x % 2u == 1u {
            break;
        }
        x++;
    }
    texels_out[id.y * packed_row(size) + id.x] = pack2x16float(pair);
}

// Value of the texture at a position in the tile.
fn cover(uv: vec2f, with_streaks: bool, with_cells: bool) -> f32 {
    let p = vec3f(uv, 0.5);
    let seed = params.high_clouds.seed * 61u;
    // Displacement bends streaks and rows.
    let swirl = vec2f(perlin(p, SWIRLS, seed + SWIRL_SALT), perlin(p, SWIRLS, seed + SWIRL_SALT + 1u));
    let at = uv + SWIRL * swirl;
    var hooked = at;
    if with_streaks {
        hooked += HOOK * vec2f(perlin(p, HOOKS, seed + HOOK_SALT), perlin(p, HOOKS, seed + HOOK_SALT + 1u));
    }
    var streaks = 0.0;
    var cells = 0.0;
    // Sum over noise(2^i x) / 2^i (gems2001, a = b = 2), not normalised by the sum of amplitudes: with fewer octaves
    // the same clouds lack detail.
    var amplitude = 1.0;
    var i = 0u;
    loop {
        let octave = octave_at(i);
        if with_streaks {
            let before = streak_noise(hooked, i, seed + octave.salts.x);
            let after = streak_noise(hooked, i, seed + octave.salts.y);
            streaks += amplitude * STREAK_CONTRAST * mix(before, after, octave.age) * octave.steady;
        }
        if with_cells {
            let before = cell_noise(at, CELLS << i, seed + CELL_SALT + octave.salts.x);
            let after = cell_noise(at, CELLS << i, seed + CELL_SALT + octave.salts.y);
            cells += amplitude * CELL_CONTRAST * mix(before, after, octave.age) * octave.steady;
        }
        amplitude *= 0.5;
        // The test at the end of the loop: lavapipe runs a loop that is tested at its start once more for nothing.
        i++;
        if i >= params.high_clouds.octaves {
            break;
        }
    }
    if with_cells {
        // Patches live as long as the largest cells.
        let octave = octave_at(0u);
        let place = vec3f(at, 0.5);
        let before = perlin(place, PATCHES, seed + PATCH_SALT + octave.salts.x);
        let after = perlin(place, PATCHES, seed + PATCH_SALT + octave.salts.y);
        cells += PATCH_CONTRAST * mix(before, after, octave.age) * octave.steady;
    }
    if !with_cells {
        return saturate(0.5 + streaks);
    }
    if !with_streaks {
        return saturate(0.5 + cells);
    }
    let kind = params.high_clouds.type_;
    let varied = BLEND_CONTRAST * perlin(p, BLENDS, seed + BLEND_SALT);
    let share = saturate(kind + 4.0 * kind * (1.0 - kind) * varied);
    return saturate(0.5 + mix(streaks, cells, share) * steadied(share));
}

// Factor that restores the variance of a blend of two independent noises.
fn steadied(share: f32) -> f32 {
    return inverseSqrt(share * share + (1.0 - share) * (1.0 - share));
}

// State of an octave between two updates.
struct Octave {
    salts: vec2u, // of the old and the new update
    age: f32, // 0 at the old update, 1 at the new one
    steady: f32, // restores the variance of the blend
}

fn octave_at(i: u32) -> Octave {
    // Small octaves are replaced more often. Between two updates an octave fades linearly from the old to the new.
    let age = select(frame.sky.high_age, frame.sky.high_age_small, i >= 4u)[i % 4u];
    let update = u32(select(frame.sky.high_update, frame.sky.high_update_small, i >= 4u)[i % 4u]);
    // Update numbers wrap: the first follows the last.
    let salts = i * 7u + vec2u(update, (update + 1u) % UPDATES) * 977u;
    return Octave(salts, age, steadied(age));
}

// Largest stretch of an octave: the upper end of the parameter's range, which the first octave reaches.
const MAX_STRETCH = 16.0;

// Perlin noise stretched along x by narrower cells across it. Small octaves are stretched more than large ones: they
// are fibres. Cell counts along both axes are integers, so that the noise tiles.
fn streak_noise(p: vec2f, octave: u32, salt: u32) -> f32 {
    let period = f32(STREAKS << octave);
    let stretch = sqrt(min(pow(params.high_clouds.stretch, 1.0 + 0.25 * f32(octave)), MAX_STRETCH));
    let across = max(u32(round(period * stretch)), 1u);
    let along = max(u32(round(period / stretch)), 1u);
    let q = fract(p) * vec2f(f32(along), f32(across));
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

// Range of the feature points in their cells, in cells. It is less than the 1 of Worley noise, so that altocumulus
// cells stand in rows.
const CELL_JITTER = 0.6;
// Mean distance to the nearest feature point, cells.
const CELL_DISTANCE = 0.388;

// Inverted 2D Worley noise about its mean, with feature points nearly in rows. Rows are shifted by half a cell against
// each other, as in a hexagonal lattice. Cells are longer across the wind than along it.
fn cell_noise(p: vec2f, period: u32, salt: u32) -> f32 {
    let squeeze = sqrt(sqrt(params.high_clouds.stretch));
    // The number of rows is even, as every other one is shifted. Neither count is below six, so that cells lie at most
    // one period outside, as `wrap_cell` requires.
    let along = 2u * max(u32(round(0.5 * f32(period) * squeeze)), 1u);
    let across = max(u32(round(f32(period) / squeeze)), 1u);
    let q = fract(p) * vec2f(f32(along), f32(across));
    let column = i32(floor(q.x));
    var nearest = 4.0;
    for (var x = -1; x <= 1; x++) {
        let shift = 0.5 * f32((column + x) & 1);
        let row = i32(floor(q.y - shift));
        for (var y = -1; y <= 1; y++) {
            let cell = wrap_cell(vec3i(column + x, row + y, 0), vec3i(i32(along), i32(across), 1));
            let jitter = CELL_JITTER * (random3(cell, salt).xy - 0.5);
            let point = vec2f(f32(column + x), f32(row + y) + shift) + 0.5 + jitter;
            let d = point - q;
            nearest = min(nearest, dot(d, d));
        }
    }
    return CELL_DISTANCE - sqrt(nearest);
}
