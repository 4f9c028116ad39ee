// Ambient light of sky and ground inside a cloud, by the two-stream approximation (Bohren 1987). A point mixes the
// light at the top and at the base of its cloud by the optical depths below and above it. Clouds thereby occlude
// themselves: thick clouds are dark below, thin clouds are as bright as their surroundings, and a cloud in uniform
// light is invisible.
#import math
#import bindings
#import density

// 1 - g of cloud droplets (Hansen 1971): the similarity scaling of optical depth, by which forward scattering counts as
// no scattering.
const DIFFUSED = 0.15;
// Optical depth, after that scaling, of the boundary layer in which light comes as much from outside as from inside the
// cloud. Its value gives thick clouds the two-stream transmittance of 1 / (3/4 depth).
const SKIN = 1.333;

// Fraction of the clear sky's irradiance on the ground under partial cloud cover: 1 beside the clouds, their two-stream
// transmittance under them.
fn ground_share() -> f32 {
    if VOLUME {
        return 1.0;
    }
    let thick = DIFFUSED * filling_of(0.5) * params.clouds.extinction * (params.clouds.top - params.clouds.base);
    return 1.0 - params.light.ambient_occlusion * cloud_cover() * (1.0 - 1.0 / (1.0 + 0.75 * thick));
}

// Approximate cloud fraction of the sky: 0.43 at the default coverage of 0.45, 1 at a coverage of 1.
fn cloud_cover() -> f32 {
    return select(smoothstep(0.0, 1.0, params.clouds.coverage), 0.0, VOLUME);
}

// Sky radiance at a cloud: other clouds replace their fraction of the sky by white of the same luminance.
fn clouded_sky(sky: vec3f) -> vec3f {
    return mix(sky, vec3f(dot(sky, LUMINANCE)), cloud_cover());
}

// Fraction of the ambient light at a point that comes from above; the rest comes from below.
fn ambient_share(column: WeatherSample) -> f32 {
    let thick = DIFFUSED * filling_of(column.growth) * column.coverage * frame.sky.extinction * column.thickness;
    let two_streams = (SKIN + column.depth_share * thick) / (2.0 * SKIN + thick);
    return mix(saturate(column.height), two_streams, params.light.ambient_occlusion);
}
