// Atmosphere (Hillaire 2020): Rayleigh scattering, aerosol and ozone by altitude, and the functions that read their
// LUTs. Around a spherical planet under a distant sun, every quantity that is independent of the view direction is a
// function of altitude and the cosine of the sun's zenith angle, and fits into a small 2D LUT.
#import math
#import phase
#import shell

// Coefficients at sea level, 1/m, for Rec. 709 red, green and blue; scale heights, m (Hillaire 2020, table 1).
const RAYLEIGH = vec3f(5.802e-6, 13.558e-6, 33.1e-6);
const RAYLEIGH_HEIGHT = 8000.0;
const MIE_SCATTERING = 3.996e-6;
const MIE_EXTINCTION = 4.440e-6;
const MIE_HEIGHT = 1200.0;
const MIE_G = 0.8;
// Absorption of ozone at the peak of its layer, 1/m, and half width of its triangular profile, m. Red differs from the
// table's 0.650e-6, which holds for 680 nm. Rec. 709 red is near 610 nm, close to the peak of the Chappuis band, where
// ozone absorbs at least as much as at 550 nm. With the table's value dusk is purple and the blue hour is not blue.
const OZONE = vec3f(1.881e-6, 1.881e-6, 0.085e-6);
const OZONE_ALTITUDE = 25000.0;
const OZONE_WIDTH = 15000.0;

// Relative densities of Rayleigh scatterers, aerosol and ozone at an altitude: 1 where the standard layer is densest;
// `haze` scales the aerosol.
fn air_parts(h: f32) -> vec3f {
    let up = max(h, 0.0);
    let ozone = saturate(1.0 - abs(up - OZONE_ALTITUDE) / OZONE_WIDTH);
    return vec3f(exp(-up / RAYLEIGH_HEIGHT), params.atmosphere.haze * exp(-up / MIE_HEIGHT), ozone);
}

fn air_extinction(parts: vec3f) -> vec3f {
    return RAYLEIGH * parts.x + MIE_EXTINCTION * parts.y + OZONE * parts.z;
}

// Scattering coefficient times phase function, 1/(m sr), for a scattering angle given as 1 minus its cosine.
fn air_scattering_toward(parts: vec3f, one_minus_mu: f32) -> vec3f {
    let mu = 1.0 - one_minus_mu;
    let rayleigh = 3.0 / (16.0 * PI) * (1.0 + mu * mu);
    return RAYLEIGH * (parts.x * rayleigh) + MIE_SCATTERING * (parts.y * henyey_greenstein(one_minus_mu, MIE_G));
}

// Length at sea level with the same column as a path between two altitudes through an exponential layer, m.
fn path_length(h0: f32, h1: f32, distance: f32, scale_height: f32) -> f32 {
    let low = max(min(h0, h1), 0.0);
    return distance * exp(-low / scale_height) * one_minus_exp_over(abs(h1 - h0) / scale_height);
}

// Optical depth of a short straight segment between two altitudes. Ozone is integrated by Simpson's rule.
fn air_depth_between(h0: f32, h1: f32, distance: f32) -> vec3f {
    let ozone = air_parts(h0).z + 4.0 * air_parts(0.5 * (h0 + h1)).z + air_parts(h1).z;
    return RAYLEIGH * path_length(h0, h1, distance, RAYLEIGH_HEIGHT)
        + params.atmosphere.haze * MIE_EXTINCTION * path_length(h0, h1, distance, MIE_HEIGHT)
        + OZONE * (distance * ozone / 6.0);
}

// Coordinates of a direction in the transmittance LUT (Bruneton and Neyret 2008). u is the distance to the top of the
// atmosphere, from 0 straight up to 1 toward the horizon. v is the distance to the horizon, as a fraction of the one
// from the top of the atmosphere.
fn transmittance_lut_coordinates(altitude: f32, mu: f32) -> vec2f {
    let h = clamp(altitude, 0.0, AIR_TOP);
    let radius = params.atmosphere.planet_radius;
    let whole = sqrt(AIR_TOP * (2.0 * radius + AIR_TOP));
    let horizon = sqrt(h * (2.0 * radius + h));
    let b = (radius + h) * mu;
    let power = (AIR_TOP - h) * (2.0 * radius + h + AIR_TOP);
    let s = sqrt(b * b + power);
    let distance = select(s - b, power / max(s + b, 1e-3), b > 0.0);
    let nearest = AIR_TOP - h;
    return vec2f(saturate((distance - nearest) / (horizon + whole - nearest)), horizon / whole);
}

// Transmittance of the air from altitude `h` to space along a direction with zenith cosine `mu`. Below the horizon it
// is that of the horizon.
fn air_transmittance(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(1.0);
    }
    let size = vec2f(textureDimensions(transmittance_lut));
    let uv = (transmittance_lut_coordinates(h, mu) * (size - 1.0) + 0.5) / size;
    return exp(-textureSampleLevel(transmittance_lut, clamp_sampler, uv, 0.0).rgb);
}

// Visible fraction of the sun's disc above the horizon of a point: 0 below it, 1 above, with a ramp over the disc's
// half degree.
fn sun_above_ground(h: f32, mu: f32) -> f32 {
    let ratio = params.atmosphere.planet_radius / (params.atmosphere.planet_radius + max(h, 0.0));
    let horizon = -sqrt(max(1.0 - ratio * ratio, 0.0));
    return smoothstep(-SUN_EDGE, SUN_EDGE, mu - horizon);
}

// Transmittance of the sun's light to a point through air and planet.
fn sunlight(h: f32, mu: f32) -> vec3f {
    return air_transmittance(h, mu) * sun_above_ground(h, mu);
}

// Irradiance of the sun at a point on a plane that faces it.
fn sun_irradiance(h: f32, mu: f32) -> vec3f {
    return params.sun.irradiance * sunlight(h, mu);
}

// Tables of the multiscattering LUT, by altitude and zenith cosine of the sun, stacked in v, for a sun of irradiance 1.
// The light is that which air or ground have scattered or reflected at least once.
const SCATTERED = 0u; // mean radiance over the sphere
const SCATTERED_UP = 1u; // mean over the sphere of radiance times squared cosine to the vertical
const SCATTERED_SUNWARD = 2u; // mean of radiance times squared cosine to the horizontal axis toward the sun
const FROM_ABOVE = 3u; // irradiance on a horizontal plane from above, over pi
const FROM_BELOW = 4u; // irradiance on a horizontal plane from below, over pi
const FLUX_SUNWARD = 5u; // mean of radiance times cosine to the horizontal axis toward the sun

// Encoding of the tables: the logarithm relative to a middle value. Twilight loses a factor of two or more per degree,
// so the logarithm is what interpolates well. The middle value brings typical logarithms near 0, where half floats are
// finest.
const TABLE_MIDDLE = 1e-4;
// Encoding of zero, and the encoded value below which a half float counts as zero. The light of ten thousand suns at
// this level outshines the night.
const TABLE_NONE = 1e-13;
const TABLE_DARK = -20.7;

fn to_table(light: vec3f) -> vec3f {
    return log(max(light, vec3f(TABLE_NONE)) / TABLE_MIDDLE);
}

fn from_table(texel: vec3f) -> vec3f {
    return select(TABLE_MIDDLE * exp(texel), vec3f(0.0), texel < vec3f(TABLE_DARK));
}

// Coordinates in a table. Square roots concentrate rows at the ground, where air is densest, and columns at the
// horizon, where twilight changes fastest.
fn table_coordinates(table: u32, h: f32, mu: f32) -> vec2f {
    let cosine = clamp(mu, -1.0, 1.0);
    let root = sqrt(abs(cosine));
    let across = 0.5 + 0.5 * select(-root, root, cosine > 0.0);
    let up = sqrt(saturate(h / AIR_TOP)) + f32(table) * f32(TABLE_ALTITUDES) / f32(TABLE_ALTITUDES - 1u);
    let column = across * f32(TABLE_COSINES - 1u) + 0.5;
    let row = up * f32(TABLE_ALTITUDES - 1u) + 0.5;
    return vec2f(column / f32(TABLE_COSINES), row / f32(TABLES * TABLE_ALTITUDES));
}

fn air_light_at(table: u32, h: f32, mu: f32) -> vec3f {
    return from_table(textureSampleLevel(multiscattering_lut, clamp_sampler, table_coordinates(table, h, mu), 0.0).rgb);
}

// Moments of the light that has been scattered at least once.
struct Scattered {
    mean: vec3f,
    up: vec3f,
    sunward: vec3f,
    flux_up: vec3f,
    flux_sunward: vec3f,
}

// Radiance per metre that the air scatters from that light into a direction with zenith cosine `mu` and cosine `cosine`
// to the sun. Rayleigh's phase function is quadratic in the direction, so second moments of the light suffice. The
// moment along the horizontal axis at right angles to the sun follows from the mean; the mixed moment is neglected.
// Aerosol's phase function is truncated after the second order (1, g, g^2 of its Legendre series).
fn scattered_again(parts: vec3f, light: Scattered, mu_sun: f32, mu: f32, cosine: f32) -> vec3f {
    let sine_sun = max(1.0 - mu_sun * mu_sun, 0.0);
    let level = max(1.0 - mu * mu, 0.0);
    let toward = cosine - mu * mu_sun;
    let sunward = select(0.5 * level, min(toward * toward / max(sine_sun, 1e-6), level), sine_sun > 1e-4);
    let beside = max(light.mean - light.up - light.sunward, vec3f(0.0));
    let moment = mu * mu * light.up + sunward * light.sunward + (level - sunward) * beside;
    let flux = mu * light.flux_up + sign(toward) * sqrt(sunward) * light.flux_sunward;
    let aerosol = light.mean + 3.0 * MIE_G * flux + 2.5 * MIE_G * MIE_G * (3.0 * moment - light.mean);
    return RAYLEIGH * parts.x * 0.75 * (light.mean + moment) + MIE_SCATTERING * parts.y * max(aerosol, vec3f(0.0));
}

fn air_scattered(h: f32, mu: f32) -> Scattered {
    return Scattered(
        air_light_at(SCATTERED, h, mu),
        air_light_at(SCATTERED_UP, h, mu),
        air_light_at(SCATTERED_SUNWARD, h, mu),
        0.25 * (sky_from_above(h, mu) - sky_from_below(h, mu)),
        air_light_at(FLUX_SUNWARD, h, mu),
    );
}

fn sky_from_above(h: f32, mu: f32) -> vec3f {
    return air_light_at(FROM_ABOVE, h, mu);
}

fn sky_from_below(h: f32, mu: f32) -> vec3f {
    return air_light_at(FROM_BELOW, h, mu);
}

// Irradiance over pi on a horizontal plane from above, without direct sunlight: that of the air and of the night sky.
fn light_from_above(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(0.0);
    }
    return params.sun.irradiance * sky_from_above(h, mu) + params.atmosphere.night;
}

// Irradiance over pi on a horizontal plane from below: that of the ground and of the air above it.
fn light_from_below(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return ground_radiance(mu);
    }
    return params.sun.irradiance * sky_from_below(h, mu) + params.atmosphere.ground_albedo * params.atmosphere.night;
}

// Radiance of the ground, a Lambertian reflector of sunlight and skylight.
fn ground_radiance(mu: f32) -> vec3f {
    let sun = params.sun.irradiance * sunlight(0.0, mu) * max(mu, 0.0) / PI;
    return params.atmosphere.ground_albedo * (sun + light_from_above(0.0, mu));
}

// Coordinates of a direction in the sky-view LUT: u is the azimuth from the sun over pi, v runs from the zenith over
// the horizon, at 0.5, to the nadir. Square roots concentrate rows at the horizon, where the sky changes fastest.
fn sky_coordinates(direction: vec3f) -> vec2f {
    let sine = clamp(dot(direction, frame.view.zenith), -1.0, 1.0);
    let elevation = asin(sine) + frame.view.horizon_dip;
    let flat_sun = frame.sky.sun_direction - dot(frame.sky.sun_direction, frame.view.zenith) * frame.view.zenith;
    let flat_view = direction - sine * frame.view.zenith;
    let cosine = dot(flat_sun, flat_view) / max(length(flat_sun) * length(flat_view), 1e-6);
    let u = acos(clamp(cosine, -1.0, 1.0)) / PI;
    let above = saturate(elevation / (0.5 * PI + frame.view.horizon_dip));
    let below = saturate(-elevation / (0.5 * PI - frame.view.horizon_dip));
    let v = select(0.5 + 0.5 * sqrt(below), 0.5 - 0.5 * sqrt(above), elevation >= 0.0);
    return vec2f(u, v);
}

// Texture coordinates for a LUT of `size` texels. The two halves stay half a texel away from the horizon on either
// side, so that filtering does not mix sky and ground.
fn sky_texel(at: vec2f, size: vec2f) -> vec2f {
    let half_texel = 0.5 / size;
    let v = select(
        clamp(at.y, 0.5 + half_texel.y, 1.0 - half_texel.y),
        clamp(at.y, half_texel.y, 0.5 - half_texel.y),
        at.y < 0.5,
    );
    return vec2f(mix(half_texel.x, 1.0 - half_texel.x, at.x), v);
}

// Radiance of the air in a direction, without clouds, sun and ground.
//
// Encoding of the sky-view LUT: radiance times `sky_scale` over `sky_unit`. The unit is the sun's irradiance, or that
// of a sun as bright as the night. The quotient is at most 4 toward the sun and 1e-9 at night; half floats (6e-8 to
// 65,504) cannot hold both, and `sky_scale` grows as the sun sinks. The irradiance itself can have any magnitude.
fn sky_radiance(direction: vec3f) -> vec3f {
    let uv = sky_texel(sky_coordinates(direction), vec2f(textureDimensions(sky_view_lut)));
    return textureSampleLevel(sky_view_lut, clamp_sampler, uv, 0.0).rgb * (frame.sky.sky_unit / frame.sky.sky_scale);
}
