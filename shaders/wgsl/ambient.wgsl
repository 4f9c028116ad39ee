// Light of sky and ground in the clouds. A cloud lit from above and from below is, inside, as bright as two streams make it:
// between what comes in at its top and at its base by its optical depth below and above the point (Bohren 1987). So it
// occludes itself: thick clouds are dark below, thin ones as bright as what is around them, and in a light that is the
// same everywhere no cloud is seen.
#import math
#import bindings
#import density

// 1 - g of droplets (Hansen 1971): forward scattering is as good as none.
const DIFFUSED = 0.15;
// Optical depth, after that, of the skin in which light is as much from outside as from inside: with it a thick cloud lets
// through 1 / (3/4 depth), as two streams do.
const SKIN = 1.333;
// Mean density of a cloud where the coverage is 1, as a share of the largest: noise, profile and detail together. Measured
// along verticals of optical depth over 1: 0.15 in the scene `overcast`, 0.12 in `stratocumulus` and `storm`.
const FILLING = 0.12;

// Share of the clear sky's light on the ground that the clouds leave: all beside them, under them what gets through.
fn ground_share() -> f32 {
    if VOLUME {
        return 1.0;
    }
    let thick = DIFFUSED * FILLING * params.clouds.extinction * (params.clouds.top - params.clouds.base);
    return 1.0 - params.light.ambient_occlusion * cloud_cover() * (1.0 - 1.0 / (1.0 + 0.75 * thick));
}

// Share of the sky that is cloudy, about: 0.43 at the default coverage of 0.45, all of it at 1.
fn cloud_cover() -> f32 {
    return select(smoothstep(0.0, 1.0, params.clouds.coverage), 0.0, VOLUME);
}

// The sky as clouds see it: other clouds hide their share of it, about as bright, but white.
fn clouded_sky(sky: vec3f) -> vec3f {
    return mix(sky, vec3f(dot(sky, LUMINANCE)), cloud_cover());
}

// Share of the ambient light at a point that comes from above; the rest comes from below.
fn ambient_share(column: WeatherSample) -> f32 {
    let thick = DIFFUSED * FILLING * column.coverage * frame.sky.extinction * column.thickness;
    let two_streams = (SKIN + column.depth_share * thick) / (2.0 * SKIN + thick);
    return mix(saturate(column.height), two_streams, params.light.ambient_occlusion);
}
