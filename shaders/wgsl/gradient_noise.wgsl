// Perlin and Worley noise that tile, and their FBMs. Coordinates are in tiles: [0, 1) is one period.
#import math
#import random

// Perlin noise of `period` cells a tile, about -1 to 1 (Perlin 2002: quintic fade).
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

// FBM of Perlin noise from `period` cells a tile up, mapped to [0, 1] with mean 0.5 and standard deviation 0.2.
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

// Inverted Worley noise (Worley 1996): 1 at the feature points, falling to 0 one cell away; blobs are bright.
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

// Perlin noise with the billows of Worley noise: nubis2015 raises the old minimum of the Perlin range to a Worley FBM.
// `worley` is inverted, so it is the dark borders of its cells that carve, and round shapes stay.
fn perlin_worley(perlin: f32, worley: f32) -> f32 {
    return remap01(perlin, 1.0 - worley, 1.0);
}
