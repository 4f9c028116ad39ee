// Tileable Perlin, simplex and Worley noise, and their FBMs. Coordinates are in tiles: [0, 1) is one period.
#import math
#import random

const SIMPLEX_GAIN = 7.0; // standard deviation: `perlin` has 0.19, `simplex` without gain 0.0275

// Perlin noise of `period` cells per tile, in about [-1, 1] (Perlin 2002: quintic fade).
fn perlin(p: vec3f, period: u32, salt: u32) -> f32 {
    let q = fract(p) * f32(period);
    let cell = vec3i(floor(q));
    let f = q - floor(q);
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    var corner: array<f32, 8>;
    for (var i = 0; i < 8; i++) {
        let o = vec3i(i & 1, (i >> 1) & 1, i >> 2);
        let gradient = random3(wrap_cell(cell + o, vec3i(i32(period))), salt) * 2.0 - 1.0;
        corner[i] = dot(gradient, f - vec3f(o));
    }
    let x = mix(
        vec4f(corner[0], corner[2], corner[4], corner[6]),
        vec4f(corner[1], corner[3], corner[5], corner[7]),
        w.x,
    );
    let y = mix(x.xz, x.yw, w.y);
    return mix(y.x, y.y, w.z);
}

// FBM of Perlin noise from `period` cells per tile up, mapped to [0, 1] with mean 0.5 and standard deviation 0.2.
fn perlin_fbm(p: vec3f, period: u32, octaves: u32, salt: u32) -> f32 {
    var sum = 0.0;
    var amplitude = 1.0;
    var total = 0.0;
    for (var i = 0u; i < octaves; i++) {
        sum += amplitude * perlin(p, period << i, salt + i);
        total += amplitude;
        amplitude *= 0.5;
    }
    return saturate(0.5 + 0.85 * sum / total);
}

// Simplex noise in the plane (Perlin 2001), tileable after Gustavson and McEwan ("Tiling simplex noise and flow noise",
// JCGT 2022). A tile is `period` triangles wide and has as many rows as make the triangles about equilateral. Rows are
// shifted by half a triangle against each other, so that their number is even. The variance is that of `perlin`.
fn simplex(p: vec2f, period: u32, salt: u32) -> f32 {
    let rows = 2u * max(u32(round(f32(period) / sqrt(3.0))), 1u);
    let q = fract(p) * vec2f(f32(period), f32(rows));
    // Skewed coordinates, in which the lattice is square and each triangle is half a square.
    let skewed = vec2f(q.x + 0.5 * q.y, q.y);
    let cell = floor(skewed);
    let f = skewed - cell;
    var sum = 0.0;
    for (var i = 0; i < 3; i++) {
        let o = select(select(vec2f(0.0, 1.0), vec2f(1.0, 0.0), f.x > f.y), vec2f(f32(i / 2)), i != 1);
        // Offset from the corner, in triangle sides. A corner's weight falls to 0 at the rim of its six triangles.
        let apart = vec2f(f.x - o.x - 0.5 * (f.y - o.y), 0.5 * sqrt(3.0) * (f.y - o.y));
        let corner = vec2u(cell + o);
        let wrapped = vec3u((corner.x - corner.y / 2u) % period, corner.y % rows, 0u);
        let gradient = random3(wrapped, salt).xy * 2.0 - 1.0;
        let weight = max(0.75 - dot(apart, apart), 0.0);
        sum += weight * weight * weight * weight * dot(gradient, apart);
    }
    return SIMPLEX_GAIN * sum;
}

// FBM of simplex noise, with the parameters of `perlin_fbm`.
fn simplex_fbm(p: vec2f, period: u32, octaves: u32, salt: u32) -> f32 {
    var sum = 0.0;
    var amplitude = 1.0;
    var total = 0.0;
    for (var i = 0u; i < octaves; i++) {
        sum += amplitude * simplex(p, period << i, salt + i);
        total += amplitude;
        amplitude *= 0.5;
    }
    return saturate(0.5 + 0.85 * sum / total);
}

// Inverted Worley noise (Worley 1996): 1 at the feature points, falling to 0 at a distance of one cell.
fn worley(p: vec3f, period: u32, salt: u32) -> f32 {
    let q = fract(p) * f32(period);
    let cell = vec3i(floor(q));
    let f = q - floor(q);
    var nearest = 1.0;
    for (var z = -1; z <= 1; z++) {
        for (var y = -1; y <= 1; y++) {
            for (var x = -1; x <= 1; x++) {
                let o = vec3i(x, y, z);
                let d = vec3f(o) + random3(wrap_cell(cell + o, vec3i(i32(period))), salt) - f;
                nearest = min(nearest, dot(d, d));
            }
        }
    }
    return 1.0 - sqrt(nearest);
}

// Perlin-Worley noise: a Worley FBM raises the old minimum of the Perlin noise's remap (nubis2015). `worley` is
// inverted, so that the dark borders of its cells carve the noise and round shapes stay.
fn perlin_worley(perlin: f32, worley: f32) -> f32 {
    return remap01(perlin, 1.0 - worley, 1.0);
}

// Base shape of four noises: the low-frequency FBM lowers the old minimum of the remap, which raises the shape
// (nubis2015).
fn base_shape(noise: vec4f) -> f32 {
    let low = 1.0 - fbm3(noise.gba);
    return (noise.r + low) / (1.0 + low);
}
