// High clouds: a layer without thickness on a sphere (nubis2015, thesis2018; cover after gems2001).
#import math
#import bindings
#import chart

// Weight of the second, broader read of the texture.
const BROAD_SHARE = 0.4;

// Offset of the cover threshold below the texture's minimum at a cover of 1, so that no sky stays clear.
const OVERCAST = 0.35;
// Gain of the clamped curve. It saturates the clamped curve as often as the exponential one approaches its maximum.
const CLAMP_GAIN = 2.5;

// Offset toward the sun of the emboss's second read, in tiles: a quarter of an altocumulus.
const EMBOSS_STEP = 0.02;

struct HighCloud {
    optical_depth: f32, // vertical
    relief: f32, // thickness minus the thickness a step toward the sun, as a fraction of the largest thickness
}

// Vertical optical depth of the layer at a point relative to the eye.
fn high_optical_depth(p: vec3f) -> f32 {
    return high_cloud_at(p, false).optical_depth;
}

fn high_cloud_at(p: vec3f, emboss: bool) -> HighCloud {
    let along = frame.sky.high_direction;
    let across = vec2f(-along.y, along.x);
    let place = on_chart(p, params.high_clouds.altitude);
    let tiles = vec2f(dot(place, along), dot(place, across)) / params.high_clouds.scale;
    // A second read at another scale hides the repetition of the tiles.
    let broad = textureSampleLevel(high_map, repeat_sampler, frame.sky.high_broad_origin + tiles / BROAD, 0.0).r;
    let uv = frame.sky.high_origin + tiles;
    let thickness = high_thickness(mix(textureSampleLevel(high_map, repeat_sampler, uv, 0.0).r, broad, BROAD_SHARE));
    var relief = 0.0;
    if emboss {
        // Horizontal component of the sun's direction. It shortens as the sun rises; under a sun at the zenith there is
        // no relief.
        let sun = vec2f(dot(frame.sky.sun_direction.xy, along), dot(frame.sky.sun_direction.xy, across));
        let nearer = textureSampleLevel(high_map, repeat_sampler, uv + EMBOSS_STEP * sun, 0.0).r;
        relief = thickness - high_thickness(mix(nearer, broad, BROAD_SHARE));
    }
    return HighCloud(params.high_clouds.optical_depth * thickness, relief);
}

// Thickness, as a fraction of the largest, for a value of the texture: the part above the cover threshold condenses.
fn high_thickness(value: f32) -> f32 {
    let more = max(2.0 * params.high_clouds.coverage - 1.0, 0.0);
    let over = max(value - (1.0 - params.high_clouds.coverage) + OVERCAST * more * more, 0.0);
    // gems2001 subtracts and clamps; its exponential curve saturates.
    let clamped = min(CLAMP_GAIN * over, 1.0);
    return select(1.0 - exp(-3.0 * over * over / (over + 0.15)), clamped, params.high_clouds.curve == CURVE_CLAMP);
}
