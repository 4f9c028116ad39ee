// Bakes the weather map: coverage, type and precipitation over a square that repeats (nubis2015, thesis2018).
#import bindings
#import gradient_noise

const COVERAGE_SALT = 7u;
const TYPE_SALT = 47u;
const RAIN_SALT = 77u;

@compute @workgroup_size(8, 8)
fn weather(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // Row 0 is the north edge, so that a user's map reads like a map.
    let p = vec3f((f32(id.x) + 0.5) / f32(size.x), 1.0 - (f32(id.y) + 0.5) / f32(size.y), 0.5);
    let seed = params.weather.seed * 97u;
    let cells = max(u32(round(params.weather.extent / params.weather.scale)), 1u);
    let broad_cells = max(cells / 4u, 1u);

    // Clouds stand where Worley's blobs are, and lean on a Perlin noise so that no two are alike.
    let blobs = worley(p, cells, seed + COVERAGE_SALT) * 0.6 + worley(p, cells * 2u, seed + COVERAGE_SALT + 1u) * 0.4;
    let shape = perlin_fbm(p, cells, 4u, seed + COVERAGE_SALT + 2u);
    let broad = perlin_fbm(p, broad_cells, 3u, seed + COVERAGE_SALT + 9u) - 0.5;
    let sum = 0.9 * blobs + 0.7 * (shape - 0.5) + params.weather.variety * broad;
    let coverage = remap01(sum, 0.2, 0.7);

    let kind = saturate(0.5 + 0.9 * (perlin_fbm(p, max(cells / 3u, 1u), 3u, seed + TYPE_SALT) - 0.5));
    let rain = remap01(perlin_fbm(p, broad_cells, 2u, seed + RAIN_SALT) + 0.3 * (coverage - 0.5), 0.3, 0.7);
    textureStore(map_out, id.xy, vec4f(coverage, kind, rain, 1.0));
}
