// The air (Hillaire 2020): Rayleigh, aerosol and ozone by altitude, and what is baked of them. Around a round planet under
// a distant sun all that does not depend on a direction depends on two numbers, altitude and the sun's cosine with the
// zenith, and so fits into small tables.
#import math
#import phase
#import shell

// Coefficients at sea level, 1/m, for Rec. 709 red, green, blue, and scale heights (Hillaire 2020, table 1).
const RAYLEIGH = vec3f(5.802e-6, 13.558e-6, 33.1e-6);
const RAYLEIGH_HEIGHT = 8000.0;
const MIE_SCATTERING = 3.996e-6;
const MIE_EXTINCTION = 4.440e-6;
const MIE_HEIGHT = 1200.0;
const MIE_G = 0.8;
// Ozone absorbs most at its middle, 1/m, and falls to none along a triangle so wide to either side, m. Red is not the
// table's 0.650e-6, of 680 nm: at the 610 nm that Rec. 709 means, near the top of Chappuis' band, ozone absorbs as much as
// at 550 or more, without which dusk is purple and no hour is blue.
const OZONE = vec3f(1.881e-6, 1.881e-6, 0.085e-6);
const OZONE_ALTITUDE = 25000.0;
const OZONE_WIDTH = 15000.0;

// Shares of Rayleigh, aerosol and ozone at an altitude, 1 where they are densest.
fn air_parts(h: f32) -> vec3f {
    let up = max(h, 0.0);
    let ozone = saturate(1.0 - abs(up - OZONE_ALTITUDE) / OZONE_WIDTH);
    return vec3f(exp(-up / RAYLEIGH_HEIGHT), params.atmosphere.haze * exp(-up / MIE_HEIGHT), ozone);
}

fn air_extinction(parts: vec3f) -> vec3f {
    return RAYLEIGH * parts.x + MIE_EXTINCTION * parts.y + OZONE * parts.z;
}

// What the air scatters of light whose direction turns by an angle, given as 1 minus its cosine.
fn air_scattering_toward(parts: vec3f, one_minus_mu: f32) -> vec3f {
    let mu = 1.0 - one_minus_mu;
    let rayleigh = 3.0 / (16.0 * PI) * (1.0 + mu * mu);
    return RAYLEIGH * (parts.x * rayleigh) + MIE_SCATTERING * (parts.y * henyey_greenstein(one_minus_mu, MIE_G));
}

// Length of a path through an exponential layer between two altitudes, as a length at sea level.
fn path_length(h0: f32, h1: f32, distance: f32, scale_height: f32) -> f32 {
    let low = max(min(h0, h1), 0.0);
    return distance * exp(-low / scale_height) * one_minus_exp_over(abs(h1 - h0) / scale_height);
}

// Optical depth of a short straight way between two altitudes.
fn air_depth_between(h0: f32, h1: f32, distance: f32) -> vec3f {
    let ozone = air_parts(h0).z + 4.0 * air_parts(0.5 * (h0 + h1)).z + air_parts(h1).z;
    return RAYLEIGH * path_length(h0, h1, distance, RAYLEIGH_HEIGHT)
        + params.atmosphere.haze * MIE_EXTINCTION * path_length(h0, h1, distance, MIE_HEIGHT)
        + OZONE * (distance * ozone / 6.0);
}

// Where in the table of optical depths to space a direction is: by how far it is to the top of the air, between straight
// up and the horizon, and by the distance of that (Bruneton and Neyret 2008).
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

// Transmittance of the air from altitude h to space along a direction with zenith cosine mu; under the horizon that of
// the horizon.
fn air_transmittance(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(1.0);
    }
    let size = vec2f(textureDimensions(transmittance_lut));
    let uv = (transmittance_lut_coordinates(h, mu) * (size - 1.0) + 0.5) / size;
    return exp(-textureSampleLevel(transmittance_lut, clamp_sampler, uv, 0.0).rgb);
}

// How much of the sun stands above the horizon of a point: 0 below it, 1 above, over the sun's half degree.
fn sun_above_ground(h: f32, mu: f32) -> f32 {
    let ratio = params.atmosphere.planet_radius / (params.atmosphere.planet_radius + max(h, 0.0));
    let horizon = -sqrt(max(1.0 - ratio * ratio, 0.0));
    return smoothstep(-SUN_EDGE, SUN_EDGE, mu - horizon);
}

// Share of the sun's light that arrives at a point, on a plane that faces it: the air and the planet are in its way.
fn sunlight(h: f32, mu: f32) -> vec3f {
    return air_transmittance(h, mu) * sun_above_ground(h, mu);
}

// Irradiance of the sun at a point, on a plane that faces it.
fn sun_irradiance(h: f32, mu: f32) -> vec3f {
    return params.sun.irradiance * sunlight(h, mu);
}

// Tables by altitude and the sun's cosine with the zenith, one below the other, for a sun of irradiance 1.
const SCATTERED = 0u; // mean radiance of the light that has been scattered, or reflected by the ground, once or more
const SCATTERED_UP = 1u; // of that the mean of radiance times the squared cosine with the vertical
const SCATTERED_SUNWARD = 2u; // the same with the horizontal toward the sun
const FROM_ABOVE = 3u; // its irradiance on a level plane from above, over pi
const FROM_BELOW = 4u; // the same from below
const FLUX_SUNWARD = 5u; // the mean of radiance times the cosine with the horizontal toward the sun

// Light falls by a factor of two or more with every degree of dusk: its logarithm is what is interpolated, around that of
// a value in the middle, as half floats are finer there.
const TABLE_MIDDLE = 1e-4;
// What stands for no light, and below which half floats may have put it: ten thousand suns of such light would outshine the night.
const TABLE_NONE = 1e-13;
const TABLE_DARK = -20.7;

fn to_table(light: vec3f) -> vec3f {
    return log(max(light, vec3f(TABLE_NONE)) / TABLE_MIDDLE);
}

fn from_table(texel: vec3f) -> vec3f {
    return select(TABLE_MIDDLE * exp(texel), vec3f(0.0), texel < vec3f(TABLE_DARK));
}

// Where a table has an altitude and a cosine: with square roots, as air is densest at the ground and dusk at the horizon.
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

// Light that has been scattered before.
struct Scattered {
    mean: vec3f,
    up: vec3f,
    sunward: vec3f,
    flux_up: vec3f,
    flux_sunward: vec3f,
}

// What the air sends of it, per metre, in a direction with zenith cosine `mu` and cosine `cosine` with the sun. Rayleigh's
// phase function, a square, asks of a field of light for no more than its second moments: those across the vertical and
// the sun's plane follow, and the mixed one is left out. That of aerosol is cut after them (1, g, g^2 of its series).
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

// Irradiance over pi on a level plane from above, but for the sun's own: that of the air and of the night.
fn light_from_above(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(0.0);
    }
    return params.sun.irradiance * sky_from_above(h, mu) + params.atmosphere.night;
}

// The same from below: that of the ground and of the air before it.
fn light_from_below(h: f32, mu: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return ground_radiance(mu);
    }
    return params.sun.irradiance * sky_from_below(h, mu) + params.atmosphere.ground_albedo * params.atmosphere.night;
}

// Radiance of the ground under sun and sky.
fn ground_radiance(mu: f32) -> vec3f {
    let sun = params.sun.irradiance * sunlight(0.0, mu) * max(mu, 0.0) / PI;
    return params.atmosphere.ground_albedo * (sun + light_from_above(0.0, mu));
}

// Coordinates of a direction in the sky map: azimuth from the sun across, angle from the horizon down, with square
// roots so that the horizon, where the sky changes fastest, has most of the rows; its edge is the middle of the map.
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

// The same in texels of a map of so many: the two halves keep apart, half a texel from the horizon on either side.
fn sky_texel(at: vec2f, size: vec2f) -> vec2f {
    let half_texel = 0.5 / size;
    let v = select(
        clamp(at.y, 0.5 + half_texel.y, 1.0 - half_texel.y),
        clamp(at.y, half_texel.y, 0.5 - half_texel.y),
        at.y < 0.5,
    );
    return vec2f(mix(half_texel.x, 1.0 - half_texel.x, at.x), v);
}

// What the sky map holds is the radiance over `sky_unit`, the sun's irradiance or what the night is as bright as, times
// `sky_scale`: at most 4 in front of the sun, and 1e-9 at night, which would not fit into half floats (6e-8 to 65,504)
// together. The irradiance can be anything.
// Radiance of the air in a direction, without clouds, sun and ground.
fn sky_radiance(direction: vec3f) -> vec3f {
    let uv = sky_texel(sky_coordinates(direction), vec2f(textureDimensions(sky_view_lut)));
    return textureSampleLevel(sky_view_lut, clamp_sampler, uv, 0.0).rgb * (frame.sky.sky_unit / frame.sky.sky_scale);
}
