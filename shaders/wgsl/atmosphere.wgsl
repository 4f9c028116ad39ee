// The air: Rayleigh, aerosol and ozone with exponential profiles, their optical depths in closed form, and one order of
// scattering plus an isotropic guess at the rest. A stand-in until the look-up tables of Hillaire 2020; it looks right
// from noon to the end of dusk, and is not a measured sky.
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
// The whole ozone layer straight up: absorption 0.650, 1.881, 0.085e-6 1/m at its middle, a triangle 30 km wide.
const OZONE = vec3f(0.00975, 0.0282, 0.0013);
const OZONE_ALTITUDE = 25000.0;
// Altitude where the air ends, m (as in frame.rs).
const AIR_TOP = 100000.0;

// exp(x^2) erfc(x) for x >= 0: the form 2 / (sqrt(pi) (x + sqrt(x^2 + c))) with c from 4 / pi, exact at 0, to 2, exact far
// away; between them fitted to 0.1 %.
fn erfcx(x: f32) -> f32 {
    let c = 2.0 - (2.0 - 4.0 / PI) * exp(-0.85 * x);
    return 2.0 / (sqrt(PI) * (x + sqrt(x * x + c)));
}

// Optical depth of an exponential layer of scale height H from altitude h to space, as a length at sea level: Chapman's
// function for x = (R + h) / H, sqrt(pi x / 2) erfcx(sqrt(x / 2) mu), which is right to 1 / x.
fn chapman(h: f32, mu: f32, scale_height: f32) -> f32 {
    let x = (params.atmosphere.planet_radius + h) / scale_height;
    let up = chapman_up(h, abs(mu), scale_height);
    if mu >= 0.0 {
        return up;
    }
    // Through the lowest point of the ray and out again: twice the way up from there, less the part behind.
    let x0 = sqrt(max(1.0 - mu * mu, 0.0)) * x;
    let lowest = h - (x - x0) * scale_height;
    // Through the ground: so deep that nothing arrives, but finite.
    let below = min(exp(-lowest / scale_height), 1e6);
    return max(2.0 * scale_height * sqrt(0.5 * PI * x0) * below - up, 0.0);
}

// The same for directions up, where mu is not negative: a third of the work.
fn chapman_up(h: f32, mu: f32, scale_height: f32) -> f32 {
    let x = (params.atmosphere.planet_radius + h) / scale_height;
    return scale_height * exp(-max(h, 0.0) / scale_height) * sqrt(0.5 * PI * x) * erfcx(sqrt(0.5 * x) * mu);
}

// Transmittance of the air from altitude h to space along a direction with zenith cosine mu.
fn air_transmittance(h: f32, mu: f32) -> vec3f {
    return whole_air_transmittance(h, mu, vec2f(chapman(h, mu, RAYLEIGH_HEIGHT), chapman(h, mu, MIE_HEIGHT)));
}

// The same for directions up.
fn air_transmittance_up(h: f32, mu: f32) -> vec3f {
    return whole_air_transmittance(h, mu, vec2f(chapman_up(h, mu, RAYLEIGH_HEIGHT), chapman_up(h, mu, MIE_HEIGHT)));
}

// The same for the lengths through the two exponential layers, as at sea level.
fn whole_air_transmittance(h: f32, mu: f32, lengths: vec2f) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(1.0);
    }
    let radius = params.atmosphere.planet_radius;
    let ratio = (radius + h) / (radius + OZONE_ALTITUDE);
    let ozone = OZONE / sqrt(max(1.0 - ratio * ratio * (1.0 - mu * mu), 1e-3));
    let depth = RAYLEIGH * lengths.x
        + params.atmosphere.haze * MIE_EXTINCTION * lengths.y
        + select(ozone, vec3f(0.0), h > OZONE_ALTITUDE);
    return exp(-depth);
}

// How much of the sun stands above the horizon of a point: 0 below it, 1 above, over the sun's half degree.
fn sun_above_ground(h: f32, mu: f32) -> f32 {
    let ratio = params.atmosphere.planet_radius / (params.atmosphere.planet_radius + max(h, 0.0));
    let horizon = -sqrt(max(1.0 - ratio * ratio, 0.0));
    return smoothstep(-0.005, 0.005, mu - horizon);
}

// Irradiance of the sun at a point, on a plane that faces it.
fn sun_irradiance(h: f32, mu: f32) -> vec3f {
    let shadow = sun_above_ground(h, mu);
    return params.sun.irradiance * air_transmittance(h, mu) * shadow;
}

// Length of a path through an exponential layer between two altitudes, as a length at sea level.
fn path_length(h0: f32, h1: f32, distance: f32, scale_height: f32) -> f32 {
    let low = max(min(h0, h1), 0.0);
    return distance * exp(-low / scale_height) * one_minus_exp_over(abs(h1 - h0) / scale_height);
}

// Transmittance of the air between the camera and a point at altitude `h` and distance `t`.
fn aerial_transmittance(h: f32, t: f32) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(1.0);
    }
    let depth = RAYLEIGH * path_length(frame.altitude, h, t, RAYLEIGH_HEIGHT)
        + params.atmosphere.haze * MIE_EXTINCTION * path_length(frame.altitude, h, t, MIE_HEIGHT);
    return exp(-params.atmosphere.aerial_perspective * depth);
}

// All orders of scattering after the first as one isotropic field, per irradiance of the sun. The more the air scatters
// at a wavelength the more of its light comes from them: 0.02, 0.05, 0.10 for red, green, blue at noon, a sixth of that
// at sunset. The form and its four numbers were set by eye against the pictures of Hillaire 2020.
fn further_orders(h: f32, mu_sun: f32) -> vec3f {
    let vertical = RAYLEIGH * RAYLEIGH_HEIGHT;
    let noon = 0.26 * (1.0 - exp(-1.5 * vertical));
    // Light that has been scattered before has come a higher and shorter way than the direct light.
    let dimmed = exp(-0.3 * RAYLEIGH * chapman_up(h, max(mu_sun, 0.0), RAYLEIGH_HEIGHT)
        - OZONE / max(mu_sun + 0.12, 0.12));
    let height_of_sun = smoothstep(-0.2, 0.5, mu_sun);
    return noon * dimmed * (0.9 * height_of_sun + 0.1 * smoothstep(-0.25, 0.0, mu_sun));
}

// Radiance of the air along a direction from the camera, up to the ground or to space, for a sun of irradiance 1.
fn air_radiance(direction: vec3f) -> vec3f {
    if params.atmosphere.enabled == 0u {
        return vec3f(0.0);
    }
    let air = hit_sphere(direction, frame.power_air);
    if !air.hit {
        return vec3f(0.0);
    }
    let ground = hit_sphere(direction, frame.power_ground);
    let end = select(air.far, ground.near, ground.enters);
    let length = max(end - air.near, 0.0);
    let one_minus_mu = one_minus_cos(direction, frame.sun_direction);
    let mu = 1.0 - one_minus_mu;
    let rayleigh_phase = 3.0 / (16.0 * PI) * (1.0 + mu * mu);
    let mie_phase = henyey_greenstein(one_minus_mu, MIE_G);

    const STEPS = 48;
    var radiance = vec3f(0.0);
    var transmittance = vec3f(1.0);
    for (var i = 0; i < STEPS; i++) {
        // Squares put the samples where the air is dense: near the camera.
        let a = f32(i) / f32(STEPS);
        let b = f32(i + 1) / f32(STEPS);
        let step = (b * b - a * a) * length;
        let p = (air.near + 0.5 * (a * a + b * b) * length) * direction;
        let h = altitude_at(p);
        let mu_sun = cos_zenith_at(p, frame.sun_direction);
        let rayleigh = RAYLEIGH * exp(-max(h, 0.0) / RAYLEIGH_HEIGHT);
        let mie = params.atmosphere.haze * exp(-max(h, 0.0) / MIE_HEIGHT);
        let sun = air_transmittance(h, mu_sun) * sun_above_ground(h, mu_sun);
        let rest = further_orders(h, mu_sun);
        let source = rayleigh * (rayleigh_phase * sun + rest) + mie * MIE_SCATTERING * (mie_phase * sun + rest);
        let extinction = rayleigh + mie * MIE_EXTINCTION;
        let x = extinction * step;
        let share = vec3f(one_minus_exp_over(x.r), one_minus_exp_over(x.g), one_minus_exp_over(x.b));
        radiance += transmittance * source * step * share;
        transmittance *= exp(-x);
    }
    return radiance;
}

// Radiance of the ground under the sun and a sky that adds a fifth to it.
fn ground_radiance(mu_sun: f32) -> vec3f {
    let up = max(mu_sun, 0.0);
    let sun = params.sun.irradiance * air_transmittance_up(0.0, up) * sun_above_ground(0.0, mu_sun) * up;
    let skylight = 0.12 * params.sun.irradiance * smoothstep(-0.15, 0.6, mu_sun) * vec3f(0.7, 0.9, 1.2);
    return params.atmosphere.ground_albedo / PI * (sun + skylight);
}

// Coordinates of a direction in the sky map: azimuth from the sun across, angle from the horizon down, with square
// roots so that the horizon, where the sky changes fastest, has most of the rows; its edge is the middle of the map.
fn sky_coordinates(direction: vec3f) -> vec2f {
    let sine = clamp(dot(direction, frame.zenith), -1.0, 1.0);
    let elevation = asin(sine) + frame.horizon_dip;
    let flat_sun = frame.sun_direction - dot(frame.sun_direction, frame.zenith) * frame.zenith;
    let flat_view = direction - sine * frame.zenith;
    let cosine = dot(flat_sun, flat_view) / max(length(flat_sun) * length(flat_view), 1e-6);
    let u = acos(clamp(cosine, -1.0, 1.0)) / PI;
    let above = saturate(elevation / (0.5 * PI + frame.horizon_dip));
    let below = saturate(-elevation / (0.5 * PI - frame.horizon_dip));
    let v = select(0.5 + 0.5 * sqrt(below), 0.5 - 0.5 * sqrt(above), elevation >= 0.0);
    return vec2f(u, v);
}

// What the sky map holds is the radiance for a sun of irradiance 1, times this: at most 4 in front of the sun, and 1e-7
// at the end of dusk, both well inside the range of half floats (6e-5 to 65,504). The irradiance itself can be anything.
const SKY_MAP_SCALE = 1024.0;

// Radiance of the air in a direction, without clouds, sun and ground.
fn sky_radiance(direction: vec3f) -> vec3f {
    let size = vec2f(textureDimensions(sky_map));
    let at = sky_coordinates(direction);
    // Keep the two halves apart: half a texel from the horizon on either side.
    let half_texel = 0.5 / size;
    let v = select(
        clamp(at.y, 0.5 + half_texel.y, 1.0 - half_texel.y),
        clamp(at.y, half_texel.y, 0.5 - half_texel.y),
        at.y < 0.5,
    );
    let u = mix(half_texel.x, 1.0 - half_texel.x, at.x);
    return textureSampleLevel(sky_map, clamp_sampler, vec2f(u, v), 0.0).rgb * (params.sun.irradiance / SKY_MAP_SCALE);
}
