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
// Mean density of a cloud where the coverage is 1, as a share of the largest: baked noise, profile and detail together.
const FILLING = 0.3;

// Share of the clear sky's light on the ground that the clouds leave: all beside them, under them what gets through.
fn ground_share() -> f32 {
    if VOLUME {
        return 1.0;
    }
    let thick = DIFFUSED * FILLING * params.clouds.extinction * (params.clouds.top - params.clouds.base);
    let cover = params.clouds.coverage * params.clouds.coverage * (3.0 - 2.0 * params.clouds.coverage);
    return 1.0 - params.light.ambient_occlusion * cover * (1.0 - 1.0 / (1.0 + 0.75 * thick));
}

// Share of the ambient light at a point that comes from above; the rest comes from below.
fn ambient_share(column: Column) -> f32 {
    let thick = DIFFUSED * FILLING * column.coverage * frame.extinction * column.thickness;
    let two_streams = (SKIN + column.depth_share * thick) / (2.0 * SKIN + thick);
    return mix(saturate(column.height), two_streams, params.light.ambient_occlusion);
}
