// Bakes the large-scale weather map: offsets of coverage, type and precipitation, and, in alpha, the displacement of
// the smaller map.
#import bindings
#import gradient_noise

const BROAD_SALT = 131u;
// Noise cells across the map: features are a third of it, 140 km at the default, which is wider than the smaller map.
const BROAD_CELLS = 3u;

@compute @workgroup_size(8, 8)
fn large_scale_weather(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // Row 0 is the north edge. The centre of the map, at the origin of the world, has no offset.
    let p = vec3f((f32(id.x) + 0.5) / f32(size.x), 1.0 - (f32(id.y) + 0.5) / f32(size.y), 0.5);
    let shift = broad_noise(p) - broad_noise(vec3f(0.5));
    textureStore(map_out, id.xy, clamp(shift, vec4f(-0.5), vec4f(0.5)));
}

fn broad_noise(p: vec3f) -> vec4f {
    let salt = params.weather.seed * 97u + BROAD_SALT;
    return vec4f(
        perlin_fbm(p, 2u * BROAD_CELLS, 2u, salt),
        perlin_fbm(p, BROAD_CELLS, 2u, salt + 8u),
        perlin_fbm(p, 2u * BROAD_CELLS, 2u, salt + 16u),
        // The displacement has no seed: with one, clouds slide while one weather changes into another.
        perlin_fbm(p, BROAD_CELLS, 2u, BROAD_SALT + 24u),
    );
}
