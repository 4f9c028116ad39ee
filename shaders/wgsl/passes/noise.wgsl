// Bakes the three tileable noise textures (nubis2015, "noise"): base shape, detail, curl.
#import bindings
#import gradient_noise

// Salts that give octaves and textures different lattices.
const PERLIN_SALT = 1u;
const WORLEY_SALT = 31u;
const DETAIL_SALT = 61u;
const CURL_SALT = 91u;

fn tile_point(id: vec3u, size: vec3u) -> vec3f {
    return (vec3f(id) + 0.5) / vec3f(size);
}

// Contrast stretch of a Worley FBM. Nine in ten of its values lie between 0.28 and 0.68; only the full range carves
// shapes.
fn stretched(worley: f32) -> f32 {
    return remap01(worley, 0.2, 0.75);
}

// Base shape, 128^3, of four noises. R is Perlin-Worley noise; G, B and A are Worley FBMs of rising frequency, dark at
// the feature points, as the sampler's remap(R, -(1 - fbm(GBA)), 1, 0, 1) requires. The five Worley octaves are
// computed once and shared. In vsu2022 all four are Perlin-Worley noise of rising frequency, with G, B and A in the
// same sense.
@compute @workgroup_size(4, 4, 4)
fn shape(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let p = tile_point(id, size);
    let seed = params.clouds.seed * 131u;
    var w: array<f32, 5>; // 3, 6, 12, 24, 48 cells per tile
    for (var i = 0u; i < 5u; i++) {
        w[i] = worley(p, 3u << i, seed + WORLEY_SALT + i);
    }
    let r = stretched(fbm3(vec3f(w[0], w[1], w[2])));
    let g = stretched(fbm3(vec3f(w[1], w[2], w[3])));
    let b = stretched(fbm3(vec3f(w[2], w[3], w[4])));
    let a = stretched(0.75 * w[3] + 0.25 * w[4]);
    var texel = vec4f(perlin_worley(perlin_fbm(p, 3u, 5u, seed + PERLIN_SALT), r), 1.0 - g, 1.0 - b, 1.0 - a);
    if params.clouds.noise == NOISE_VSU2022 {
        texel.g = 1.0 - perlin_worley(perlin_fbm(p, 6u, 4u, seed + PERLIN_SALT + 5u), g);
        texel.b = 1.0 - perlin_worley(perlin_fbm(p, 12u, 3u, seed + PERLIN_SALT + 9u), b);
        texel.a = 1.0 - perlin_worley(perlin_fbm(p, 24u, 2u, seed + PERLIN_SALT + 12u), a);
    }
    textureStore(volume_out, id, vec4f(base_shape(texel)));
}

// Detail, 32^3: an FBM of three Worley FBMs of rising frequency; of Perlin-Worley noises in vsu2022.
@compute @workgroup_size(4, 4, 4)
fn detail(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let p = tile_point(id, size);
    let seed = params.clouds.seed * 131u + DETAIL_SALT;
    var w: array<f32, 4>; // 2, 4, 8, 16 cells per tile
    for (var i = 0u; i < 4u; i++) {
        w[i] = worley(p, 2u << i, seed + i);
    }
    var texel = vec3f(
        stretched(fbm3(vec3f(w[0], w[1], w[2]))),
        stretched(fbm3(vec3f(w[1], w[2], w[3]))),
        stretched(0.75 * w[2] + 0.25 * w[3]),
    );
    if params.clouds.noise == NOISE_VSU2022 {
        for (var i = 0u; i < 3u; i++) {
            texel[i] = perlin_worley(perlin_fbm(p, 2u << i, 3u, seed + 4u + i), texel[i]);
        }
    }
    textureStore(volume_out, id, vec4f(fbm3(texel)));
}

// Detail and its finer copy, 160^3. Texels have the size of the finer copy's, and every fifth centre is that of a texel
// of the detail. Linear interpolation between the texels therefore equals that of the two textures on their own.
@compute @workgroup_size(4, 4, 4)
fn finer_detail(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let p = tile_point(id, size);
    let detail = textureSampleLevel(volume_in, repeat_sampler, p, 0.0).r;
    // Permuted axes avoid a common pattern of the two. The copy's mean is 0.5.
    let fine = textureSampleLevel(volume_in, repeat_sampler, f32(FINER) * p.zxy, 0.0).r;
    textureStore(volume_out, id, vec4f(saturate(detail + params.clouds.fine_detail * (fine - 0.5))));
}

// Billows: round, with narrow creases between them, from the squared distance to the nearest feature point.
fn billows(p: vec3f, period: u32, salt: u32) -> f32 {
    let away = 1.0 - worley(p, period, salt);
    return 1.0 - saturate(1.25 * away * away);
}

// Base noise of the field `heaped`, 128^3: Perlin noise and billows of 1730 to 220 m in tiles of 5200 m. Its slope is
// even to 10 % between 0.3 and 0.6; 10, 50 and 90 % of it are below 0.23, 0.43 and 0.61.
@compute @workgroup_size(4, 4, 4)
fn heaped_shape(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let p = tile_point(id, size);
    let seed = params.clouds.seed * 131u;
    const WEIGHTS = array<f32, 4>(0.45, 0.28, 0.17, 0.10);
    var heaps = 0.0;
    for (var i = 0u; i < 4u; i++) {
        heaps += WEIGHTS[i] * billows(p, 3u << i, seed + WORLEY_SALT + i);
    }
    let noise = 0.5 * (perlin_fbm(p, 3u, 3u, seed + PERLIN_SALT) + heaps);
    textureStore(volume_out, id, vec4f(saturate(0.42 + 1.9 * (noise - 0.563))));
}

// Relief of the field `heaped`, 160^3: billows of 140 to 9 m in tiles of 420 m, each octave half as deep.
@compute @workgroup_size(4, 4, 4)
fn heaped_relief(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id >= size) {
        return;
    }
    let p = tile_point(id, size);
    let seed = params.clouds.seed * 131u + DETAIL_SALT;
    const WEIGHTS = array<f32, 5>(0.50, 0.27, 0.14, 0.09, 0.06);
    var relief = -0.6 - 0.6 * WEIGHTS[4];
    for (var i = 0u; i < 5u; i++) {
        relief += WEIGHTS[i] * billows(p, 3u << i, seed + i);
    }
    textureStore(volume_out, id, vec4f(saturate(0.5 + 1.6 * relief)));
}

fn curl_potential(p: vec2f, seed: u32) -> f32 {
    return perlin_fbm(vec3f(p, 0.5), 4u, 3u, seed);
}

// Curl of a potential, 128^2: a divergence-free vector field, which swirls and never gathers (Bridson 2007), in about
// [-1, 1].
@compute @workgroup_size(8, 8)
fn curl(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= vec2u(CURL_SIZE)) {
        return;
    }
    let p = (vec2f(id.xy) + 0.5) / f32(CURL_SIZE);
    let seed = params.clouds.seed * 131u + CURL_SALT;
    const e = 0.5 / f32(CURL_SIZE);
    let dx = curl_potential(p + vec2f(e, 0.0), seed) - curl_potential(p - vec2f(e, 0.0), seed);
    let dy = curl_potential(p + vec2f(0.0, e), seed) - curl_potential(p - vec2f(0.0, e), seed);
    // Normalisation: a slope of 5 per tile is about the largest of three octaves from 4 cells up.
    texels_out[id.y * CURL_SIZE + id.x] = pack2x16float(vec2f(dy, -dx) / (2.0 * e) / 5.0);
}

// Packs a volume as half floats of one channel, two per word.
@compute @workgroup_size(64)
fn pack(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_in);
    if any(id * vec3u(2u, 1u, 1u) >= size) {
        return;
    }
    let at = vec3u(2u * id.x, id.yz);
    let pair = vec2f(textureLoad(volume_in, at, 0).r, textureLoad(volume_in, at + vec3u(1u, 0u, 0u), 0).r);
    texels_out[(id.z * size.y + id.y) * packed_row(size.x) + id.x] = pack2x16float(pair);
}

// Mip of half the size, by a box filter: wgpu makes no mips of volumes.
@compute @workgroup_size(4, 4, 4)
fn downsample(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= textureDimensions(volume_out)) {
        return;
    }
    var sum = vec4f(0.0);
    for (var i = 0u; i < 8u; i++) {
        sum += textureLoad(volume_in, id * 2u + vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u), 0);
    }
    textureStore(volume_out, id, sum / 8.0);
}
