// The high clouds as a layer without thickness on a sphere (nubis2015, thesis2018; cover as in gems2001).
#import math
#import bindings

// How much larger the second read is than the first: no small ratio, so that they do not repeat together (as in frame.rs).
const BROAD = 3.2;

// Optical depth straight through the layer at a point, relative to the camera.
fn high_optical_depth(p: vec3f) -> f32 {
    let along = frame.high_direction;
    let across = vec2f(-along.y, along.x);
    let tiles = vec2f(dot(p.xy, along), dot(p.xy, across)) / params.high_clouds.scale;
    let uv = frame.high_origin + tiles;
    let noise = textureSampleLevel(high_map, repeat_sampler, uv, 0.0).r;
    // gems2001's exponential curve: what rises above the cover condenses, ever less the denser it is. A second read at
    // another scale breaks the tiles up.
    let broad = textureSampleLevel(high_map, repeat_sampler, frame.high_broad_origin + tiles / BROAD, 0.0).r;
    let over = max(mix(noise, broad, 0.4) - (1.0 - params.high_clouds.coverage), 0.0);
    return params.high_clouds.optical_depth * (1.0 - exp(-3.0 * over * over / (over + 0.15)));
}
