// Bakes the sky-view LUT, the aerial-perspective LUT, and the light of sky and sun on the clouds.
#import bindings
#import atmosphere
#import aerial

// Steps of a ray with a low and with a high sun, and the sines of its elevation (4 and 10 degrees) between which they
// change. Rays at dusk cross the edge of the planet's shadow, which takes more steps. Largest error of a direction
// against 384 steps, at altitudes from 10 m to 100 km. 24 steps: 1.2 % with the sun at 5 degrees or higher, 4.5 % at 2,
// 35 % at -3. 48 steps: 1 %, at -3 5 %.
const STEPS_LOW = 48.0;
const STEPS_HIGH = 24.0;
const SUN_LOW = 0.07;
const SUN_HIGH = 0.175;

// Sky-view LUT: radiance by azimuth from the sun and angle from the horizon.
@compute @workgroup_size(8, 8)
fn sky_view_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    let direction = texel_direction(vec2f(id.xy), vec2f(size));
    let radiance = min(frame.sky.sky_scale * air_radiance(direction) / frame.sky.sky_unit, vec3f(65504.0));
    textureStore(map_out, id.xy, vec4f(radiance, 1.0));
}

// Inverse of `sky_coordinates` at texel centres.
fn texel_direction(texel: vec2f, size: vec2f) -> vec3f {
    let azimuth = texel.x / (size.x - 1.0) * PI;
    let v = (texel.y + 0.5) / size.y;
    let above = (1.0 - 2.0 * v) * (1.0 - 2.0 * v) * (0.5 * PI + frame.view.horizon_dip);
    let below = (2.0 * v - 1.0) * (2.0 * v - 1.0) * (0.5 * PI - frame.view.horizon_dip);
    let elevation = select(-below, above, v < 0.5) - frame.view.horizon_dip;
    return sky_direction(azimuth, elevation);
}

// Direction at an azimuth from the sun and an elevation above the horizontal plane.
fn sky_direction(azimuth: f32, elevation: f32) -> vec3f {
    var toward = frame.sky.sun_direction - dot(frame.sky.sun_direction, frame.view.zenith) * frame.view.zenith;
    if length(toward) < 1e-4 {
        // A sun at the zenith has no azimuth: any reference will do.
        toward = cross(frame.view.zenith, vec3f(0.6, 0.8, 0.0));
    }
    toward = normalize(toward);
    let side = cross(frame.view.zenith, toward);
    let level = cos(azimuth) * toward + sin(azimuth) * side;
    return cos(elevation) * level + sin(elevation) * frame.view.zenith;
}

// Radiance of the air along a direction from the eye, up to the ground or to space, and of the night sky behind it.
fn air_radiance(direction: vec3f) -> vec3f {
    let way = air_segment(direction);
    if params.atmosphere.enabled == 0u || way.length <= 0.0 {
        return vec3f(0.0);
    }
    // Quadratic spacing from the lowest point of the ray, where the air is densest.
    let b = frame.view.centre_distance * dot(frame.view.zenith, direction);
    let lowest = clamp(-b - way.start, 0.0, way.length);
    let from_s = -sqrt(lowest);
    let to_s = sqrt(way.length - lowest);
    var light = AirLight(vec3f(0.0), vec3f(0.0));
    let sun = dot(frame.view.zenith, frame.sky.sun_direction);
    let steps = round(mix(STEPS_LOW, STEPS_HIGH, saturate((sun - SUN_LOW) / (SUN_HIGH - SUN_LOW))));
    for (var i = 0u; i < u32(steps); i++) {
        let s = mix(vec3f(from_s), vec3f(to_s), (f32(i) + vec3f(0.0, 0.5, 1.0)) / steps);
        let t = lowest + s * abs(s);
        light = air_step(light, direction, way.start + t.y, t.z - t.x);
    }
    let night = select(exp(-light.depth) * params.atmosphere.night, vec3f(0.0), way.grounded);
    return params.sun.irradiance * light.radiance + night;
}

// Inscattered radiance and optical depth of the air up to a distance, for a sun of irradiance 1.
struct AirLight {
    radiance: vec3f,
    depth: vec3f,
}

fn air_step(before: AirLight, direction: vec3f, t: f32, step: f32) -> AirLight {
    let p = t * direction;
    let h = altitude_at(p);
    let mu_sun = cos_zenith_at(p, frame.sky.sun_direction);
    let parts = air_parts(h);
    let one_minus_cosine = one_minus_cos(direction, frame.sky.sun_direction);
    let once = air_scattering_toward(parts, one_minus_cosine) * sunlight(h, mu_sun);
    let again = scattered_again(
        parts,
        air_scattered(h, mu_sun),
        mu_sun,
        cos_zenith_at(p, direction),
        1.0 - one_minus_cosine,
    );
    let source = once + again;
    let x = air_extinction(parts) * step;
    let radiance = before.radiance + exp(-before.depth) * source * step * one_minus_exp_over3(x);
    return AirLight(radiance, before.depth + x);
}

// Aerial-perspective LUT: fraction of the sky's radiance from before a distance, by direction and square root of that
// distance. The night sky is behind all air.
@compute @workgroup_size(8, 8)
fn aerial_perspective_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(volume_out);
    if any(id.xy >= size.xy) {
        return;
    }
    const STEPS_EACH = 2u;
    let direction = texel_direction(vec2f(id.xy), vec2f(size.xy));
    let way = air_segment(direction);
    var reached: array<vec3f, SHARE_SLICES>;
    var light = AirLight(vec3f(0.0), vec3f(0.0));
    for (var i = 0u; i < SHARE_SLICES; i++) {
        reached[i] = light.radiance;
        for (var j = 0u; j < STEPS_EACH; j++) {
            let s = vec3f(f32(STEPS_EACH * i + j)) + vec3f(0.0, 0.5, 1.0);
            let t = s * s / f32((SHARE_SLICES - 1u) * STEPS_EACH * (SHARE_SLICES - 1u) * STEPS_EACH) * way.length;
            if i + 1u < SHARE_SLICES {
                light = air_step(light, direction, way.start + t.y, t.z - t.x);
            }
        }
    }
    let night = select(exp(-light.depth) * params.atmosphere.night, vec3f(0.0), way.grounded);
    let whole = params.sun.irradiance * light.radiance + night;
    for (var i = 0u; i < SHARE_SLICES; i++) {
        let share = select(
            vec3f(0.0),
            params.sun.irradiance * reached[i] / max(whole, vec3f(1e-30)),
            whole > vec3f(1e-20),
        );
        textureStore(volume_out, vec3u(id.xy, i), vec4f(share, 1.0));
    }
}

// Light on the clouds: ambient radiance from above and from below at the middle of the clouds; irradiance of the sun
// there and at the high clouds.
@compute @workgroup_size(1)
fn sky_light_bake() {
    let middle = 0.5 * (params.clouds.base + params.clouds.top);
    let mu = dot(frame.view.zenith, frame.sky.sun_direction);
    sky_light[0] = vec4f(light_from_above(middle, mu), 1.0);
    sky_light[1] = vec4f(light_from_below(middle, mu), 1.0);
    sky_light[2] = vec4f(sun_irradiance(middle, mu), 1.0);
    sky_light[3] = vec4f(sun_irradiance(params.high_clouds.altitude, mu), 1.0);
}
