// Bakes the larger weather map: what it shifts coverage, type and precipitation by, and, in alpha, bends the smaller map by.
#import bindings
#import gradient_noise

const BROAD_SALT = 131u;
// Noise cells across the map: features of a third of it, 140 km at the default, which is wider than the smaller map.
const BROAD_CELLS = 3u;

@compute @workgroup_size(8, 8)
fn large_scale_weather(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // As in passes/weather. The middle, where the origin of the world is, keeps the weather of the smaller map.
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
        // Of no seed: were it of one, the clouds would slide where one weather changes to another.
        perlin_fbm(p, BROAD_CELLS, 2u, BROAD_SALT + 24u),
    );
}
