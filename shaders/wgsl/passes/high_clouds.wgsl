// Bakes the texture of the high clouds: octaves of noise that are replaced at their own rates (gems2001), of two
// patterns: the streaks of cirrus and the cells of altocumulus.
#import bindings
#import gradient_noise

// Updates after which their numbers come round, as in frame.rs.
const UPDATES = 65536u;

// Cells of the largest octave in a tile: streaks, and puffs.
const STREAKS = 4u;
const CELLS = 12u;

// What is large, even and static in the noises has a salt that no update of an octave reaches, as it is odd to 7 and 977.
const SWIRL_SALT = 51u;
const HOOK_SALT = 54u;
const HOOK = 0.015;
const BLEND_SALT = 53u;
// Cells must not grow where streaks do.
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

// Two texels in each invocation, as one number of the buffer holds them; its rows are padded as copies ask for.
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
    texels_out[id.y * ((size + 127u) / 128u * 64u) + id.x] = pack2x16float(pair);
}

// How much of the sky they cover at a place in the tile.
fn cover(uv: vec2f, with_streaks: bool, with_cells: bool) -> f32 {
    let p = vec3f(uv, 0.5);
    // The field is swirled so that streaks are not ruled lines and rows bend.
    let seed = params.high_clouds.seed * 61u;
    let swirl = vec3f(perlin(p, 3u, seed + SWIRL_SALT), perlin(p, 3u, seed + SWIRL_SALT + 1u), 0.0);
    let at = (p + 0.1 * swirl).xy;
    let hook = vec3f(perlin(p, 8u, seed + HOOK_SALT), perlin(p, 8u, seed + HOOK_SALT + 1u), 0.0);
    let hooked = at + HOOK * hook.xy;
    var streaks = 0.0;
    var cells = 0.0;
    var amplitude = 1.0;
    var total = 0.0;
    var i = 0u;
    loop {
        let octave = octave_at(i);
        if with_streaks {
            let fade = mix(
                streak_noise(hooked, i, seed + octave.salts.x),
                streak_noise(hooked, i, seed + octave.salts.y),
                octave.age,
            );
            streaks += amplitude * fade * octave.steady;
        }
        if with_cells {
            let fade = mix(
                cell_noise(at, CELLS << i, seed + CELL_SALT + octave.salts.x),
                cell_noise(at, CELLS << i, seed + CELL_SALT + octave.salts.y),
                octave.age,
            );
            cells += amplitude * fade * octave.steady;
        }
        total += amplitude;
        amplitude *= 0.5;
        // Left at its end: lavapipe runs a loop that is left at its start once more, for nothing.
        i++;
        if i >= params.high_clouds.octaves {
            break;
        }
    }
    streaks *= STREAK_CONTRAST / total;
    cells *= CELL_CONTRAST / total;
    if with_cells {
        // Puffs stand in patches, which live as long as the largest of them.
        let octave = octave_at(0u);
        let patches = mix(
            perlin(p + 0.1 * swirl, PATCHES, seed + PATCH_SALT + octave.salts.x),
            perlin(p + 0.1 * swirl, PATCHES, seed + PATCH_SALT + octave.salts.y),
            octave.age,
        );
        cells += PATCH_CONTRAST * patches * octave.steady;
    }
    var sum = streaks;
    if with_cells {
        sum = cells;
    }
    if with_streaks && with_cells {
        let kind = params.high_clouds.type_;
        let varied = kind + 4.0 * kind * (1.0 - kind) * perlin(p, 2u, seed + BLEND_SALT);
        let share = saturate(varied);
        sum = mix(streaks, cells, share) * inverseSqrt(share * share + (1.0 - share) * (1.0 - share));
    }
    return saturate(0.5 + sum);
}

const STREAK_CONTRAST = 0.75;
const CELL_CONTRAST = 1.5;
const PATCH_CONTRAST = 0.45;
const PATCHES = 3u;

// Where an octave is between two updates.
struct Octave {
    salts: vec2u, // of the old and of the new
    age: f32, // 0 at the old, 1 at the new
    steady: f32, // the variance of the blend dips halfway; this times it does not
}

fn octave_at(i: u32) -> Octave {
    // Small octaves are replaced more often; between two updates each fades linearly from the old to the new.
    let age = select(frame.high_age, frame.high_age_small, i >= 4u)[i % 4u];
    let update = u32(select(frame.high_update, frame.high_update_small, i >= 4u)[i % 4u]);
    // The numbers come round (frame.rs): after the last update comes the first.
    let salts = i * 7u + vec2u(update, (update + 1u) % UPDATES) * 977u;
    return Octave(salts, age, inverseSqrt(age * age + (1.0 - age) * (1.0 - age)));
}

// Perlin noise stretched along x by squeezing its cells across; whole cells a tile either way, so it tiles.
// Small octaves are stretched more than large ones: fibres.
fn streak_noise(p: vec2f, octave: u32, salt: u32) -> f32 {
    let period = f32(STREAKS << octave);
    let stretch = sqrt(min(pow(params.high_clouds.stretch, 1.0 + 0.25 * f32(octave)), 16.0));
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

// How far the points of the cells may lie from their middles, cells: half of what Worley noise has, so that puffs stand in
// rows.
const CELL_JITTER = 0.6;
// Mean of 0.9 less the distance to the nearest of such points.
const CELL_MEAN = 0.62;

// Inverted Worley noise in two dimensions about its mean, of points that nearly stand in rows; the rows are shifted by half
// a cell from one to the next, as hexagons are.
fn cell_noise(p: vec2f, period: u32, salt: u32) -> f32 {
    let squeeze = sqrt(sqrt(params.high_clouds.stretch));
    // An even number of rows, as every other one is shifted.
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
    return 1.0 - CELL_MEAN - sqrt(nearest);
}
