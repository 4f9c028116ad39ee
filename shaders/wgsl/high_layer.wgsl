// The high clouds as a layer without thickness on a sphere (nubis2015, thesis2018; cover as in gems2001).
#import math
#import bindings
#import chart

// What the second, broader read adds to the first.
const BROAD_SHARE = 0.4;

// How far below the texture's 0 the level sinks that clouds rise above, for a cover of 1: nothing stays clear.
const OVERCAST = 0.35;
// Gain of the clamped curve, which then is at its end as often as the exponential one is near it.
const CLAMP_GAIN = 2.5;

// How far toward the sun the thickness is read for the emboss, in tiles: a quarter of an altocumulus.
const EMBOSS_STEP = 0.02;

// The high clouds at a point.
struct HighCloud {
    optical_depth: f32, // straight through the layer
    relief: f32, // how much thicker they are than a step nearer to the sun, of the thickest; for the emboss
}

// Optical depth straight through the layer at a point, relative to the camera.
fn high_optical_depth(p: vec3f) -> f32 {
    return high_cloud_at(p, false).optical_depth;
}

fn high_cloud_at(p: vec3f, emboss: bool) -> HighCloud {
    let along = frame.sky.high_direction;
    let across = vec2f(-along.y, along.x);
    let place = on_chart(p, params.high_clouds.altitude);
    let tiles = vec2f(dot(place, along), dot(place, across)) / params.high_clouds.scale;
    // A second read at another scale breaks the tiles up.
    let broad = textureSampleLevel(high_map, repeat_sampler, frame.sky.high_broad_origin + tiles / BROAD, 0.0).r;
    let uv = frame.sky.high_origin + tiles;
    let thickness = high_thickness(mix(textureSampleLevel(high_map, repeat_sampler, uv, 0.0).r, broad, BROAD_SHARE));
    var relief = 0.0;
    if emboss {
        // The sun's direction on the layer, the shorter the higher it stands: straight above there is no relief.
        let sun = vec2f(dot(frame.sky.sun_direction.xy, along), dot(frame.sky.sun_direction.xy, across));
        let nearer = textureSampleLevel(high_map, repeat_sampler, uv + EMBOSS_STEP * sun, 0.0).r;
        relief = thickness - high_thickness(mix(nearer, broad, BROAD_SHARE));
    }
    return HighCloud(params.high_clouds.optical_depth * thickness, relief);
}

// How thick they are, of the thickest, for a value of the texture: what rises above the cover condenses.
fn high_thickness(value: f32) -> f32 {
    let more = max(2.0 * params.high_clouds.coverage - 1.0, 0.0);
    let over = max(value - (1.0 - params.high_clouds.coverage) + OVERCAST * more * more, 0.0);
    // gems2001 subtracts and clamps, where there is no exponential curve: ever less the denser it is.
    let clamped = min(CLAMP_GAIN * over, 1.0);
    return select(1.0 - exp(-3.0 * over * over / (over + 0.15)), clamped, params.high_clouds.curve == CURVE_CLAMP);
}
