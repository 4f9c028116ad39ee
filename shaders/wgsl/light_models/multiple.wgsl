// Light model `multiple`: every order of scattering. A phase function is split into light that keeps going, with the
// moments of a forward peak, and light that turns. Light that only kept going has closed forms along straight rays;
// light that has turned comes from the light field (passes/light_field). A single turn between two forward chains is a
// closed form, too, and is not part of the field. Nothing is fitted.
#import bindings
#import math
#import droplets
#import light
#import light_field
#import ground_shadow

const AMBIENT = true;

fn lobe_phase(one_minus_mu: f32) -> f32 {
    return henyey_greenstein(one_minus_mu, params.light.g);
}

// Weight of a sample: share of the eye's light that it turns or absorbs. What it scatters forward reaches what lies
// behind.
fn sample_weight(transmittance: f32, depth: f32, x: f32) -> f32 {
    let scaled = frame.sky.split.z * x;
    return exp(-frame.sky.split.z * depth) * scaled * one_minus_exp_over(scaled);
}

fn is_opaque(transmittance: f32, depth: f32) -> bool {
    return exp(-frame.sky.split.z * depth) < params.quality.min_transmittance;
}

// The last span of a ray that ends early stands for all behind it.
fn tail_scale(transmittance: f32) -> f32 {
    return 1.0;
}

fn opaque_depth() -> f32 {
    return min(18.0 / frame.sky.split.z, 1000.0);
}

fn sky_share(column: WeatherSample) -> f32 {
    return 0.0;
}

// Optical depth toward the sun: of relief finer than a cell by samples of the density, from there on by the light
// field. Segment k of n starts at (k / n)^2 of the reach.
fn depth_toward_sun(p: vec3f, opacity: f32, width: f32) -> f32 {
    let sun = frame.sky.sun_direction;
    let altitude = altitude_at(p);
    let q = field_place(p, altitude);
    let along = abs(field_direction(sun, cos_zenith_at(p, sun)));
    let cell = frame.sky.field_cell * vec3f(vec2f(exp2(field_level(q))), 1.0);
    let reach = f32(params.quality.relief_samples) / max(max(along.x / cell.x, along.y / cell.y), along.z / cell.z);
    let n = params.quality.relief_samples;
    var depth = 0.0;
    var begin = 0.0;
    if n > 0u {
        var i = 0u;
        loop {
            i += 1u;
            let end = reach * f32(i * i) / f32(n * n);
            let at = p + 0.5 * (begin + end) * sun;
            depth += (end - begin) * cloud_density_at(at, altitude_at(at), max(width, 0.5 * (end - begin)));
            begin = end;
            if i >= n {
                break;
            }
        }
    }
    let far = p + begin * sun;
    return frame.sky.extinction * depth + field_sun_depth(field_place(far, altitude_at(far)));
}

fn lit_span(span: Span, p: vec3f, direction: vec3f, turned: Turn) -> Lit {
    let scale = frame.sky.split.z;
    let source = frame.sky.split.w; // scaled albedo / 4 pi
    let end = span.start + span.thick;
    let weight = exp(-scale * span.start) * select(1.0 - exp(-scale * span.thick), 1.0, span.is_last);
    let seen = exp(-span.start) * select(1.0 - exp(-span.thick), 1.0, span.is_last);
    // Light that keeps going, and light that turns once.
    let to_sun = span.depth_to_sun;
    let beam = exp(-to_sun) * seen;
    let scaled_beam = exp(-scale * to_sun) * weight / scale;
    var chains = forward_chains(to_sun + span.start + 0.5 * span.thick, turned.one_minus_mu) * span.thick;
    if span.is_last {
        chains += forward_chains(to_sun + end, turned.one_minus_mu) / scale;
    }
    var sun = once_turned(turned, beam, scaled_beam, chains);
    // Light that has turned before.
    let altitude = altitude_at(p);
    let q = field_place(p, altitude);
    let uvw = field_texel(q, field_level(q));
    let of_sun = textureSampleLevel(field_sun, clamp_sampler, uvw, 0.0);
    let of_sky = textureSampleLevel(field_sky, clamp_sampler, uvw, 0.0);
    let ray = field_direction(direction, cos_zenith_at(p, direction));
    let toward_eye = vec4f(1.0, -3.0 * frame.sky.turned_cosine * ray);
    sun = max(sun / max(weight, 1e-20) + source * dot(of_sun, toward_eye), 0.0);
    // Without clouds the sky has half of the sphere, and the ground the other.
    let above = clamp(source * dot(of_sky, toward_eye), 0.0, 4.0 * PI * source);
    return Lit(weight, sun, above, 4.0 * PI * source - above, span.distance);
}

// Radiance per unit of irradiance and of optical depth of a thin layer.
fn seen_scattering(depth: f32, precipitation: f32, turned: Turn) -> f32 {
    let chains = forward_chains(depth, turned.one_minus_mu);
    return max(once_turned(turned, exp(-depth), exp(-frame.sky.split.z * depth), chains), 0.0);
}

fn slowest_extinction() -> f32 {
    return frame.sky.split.z;
}

// Irradiance of the ground that the fraction `direct` of the sun's light reaches, and of what clouds send back to it.
fn ground_lit(mu: f32, direct: f32, light: vec4f) -> vec3f {
    let sun = sun_irradiance(0.0, mu);
    let sky = PI * light_from_above(0.0, mu);
    let lit = sun * (max(mu, 0.0) * direct + light.x) + sky * light.y;
    return lit / (1.0 - params.atmosphere.ground_albedo * saturate(1.0 - light.y));
}

// Light of the ground under a point, relative to that without clouds.
fn ground_factor(p: vec3f, mu: f32) -> vec3f {
    if VOLUME {
        return vec3f(1.0);
    }
    let light = field_ground_at(field_place(p, altitude_at(p)).xy);
    let clear = sun_irradiance(0.0, mu) * max(mu, 0.0) + PI * light_from_above(0.0, mu);
    return min(ground_lit(mu, light.z, light) / max(clear, vec3f(1e-30)), vec3f(2.0));
}

// Radiance of the ground at a point of it that the fraction `sun` of the sun's light reaches.
fn ground_under(p: vec3f, mu: f32, sun: f32) -> vec3f {
    if VOLUME {
        let passed = mix(PASSED_ON, 1.0, sun);
        let light = sun_irradiance(0.0, mu) * max(mu, 0.0) * passed / PI + light_from_above(0.0, mu);
        return params.atmosphere.ground_albedo * light;
    }
    let light = field_ground_at(field_place(p, altitude_at(p)).xy);
    return params.atmosphere.ground_albedo / PI * ground_lit(mu, sun, light);
}

fn ambient_light(above: f32, below: f32, sky: vec3f, ground: vec3f) -> vec3f {
    return above * ambient_above(sky) + below * ambient_below(ground);
}

// Mean radiance over the sphere of the sunlight that clouds scatter to the air; below and above them that at their base
// and top.
fn cloud_light(p: vec3f, altitude: f32, mu: f32, shade: f32) -> f32 {
    if VOLUME {
        return PASSED_ON * max(mu, 0.0) / (2.0 * PI) * shade;
    }
    let q = field_place(p, altitude);
    let uvw = field_texel(q, field_level(q));
    return textureSampleLevel(field_sun, clamp_sampler, uvw, 0.0).r / (4.0 * PI);
}

// Radiance per unit of irradiance that a layer sends to the eye (marched_light.wgsl). Light that keeps going or turns
// once has closed forms. Light that has turned before is the two-stream solution of the scaled layer without
// absorption: a net flux through it that is constant with depth, a fluence whose slope follows from it, and no diffuse
// light that enters at its faces (Marshak). Beside path-traced layers of an optical depth up to 6: from below within
// 15 %, from above up to 36 % too dark at a grazing view.
fn layer_light(optical_depth: f32, mu_sun: f32, mu: f32, behind: f32, turned: Turn) -> f32 {
    let through = smoothstep(-LAYER_SIDE, LAYER_SIDE, behind);
    let scale = frame.sky.split.z;
    let t = scale * optical_depth;
    let scaled_beam = layer_beam(t, mu_sun, mu, through);
    // Gauss-Legendre quadrature of two points.
    var chains = 0.0;
    for (var z = 0.2113; z < 1.0; z += 0.5774) {
        let before = z / mu_sun + mix(z, 1.0 - z, through) / mu;
        chains += 0.5 * forward_chains(optical_depth * before, turned.one_minus_mu) * optical_depth / mu;
    }
    let once = once_turned(
        turned,
        layer_beam(optical_depth, mu_sun, mu, through),
        scaled_beam / scale,
        chains,
    );
    // Net flux, of sunlight and turned light together: turned light has net - mu_sun exp(-z / mu_sun).
    let cosine = frame.sky.turned_cosine;
    let sun = exp(-t / mu_sun);
    let net = mu_sun * (3.0 * mu_sun * (1.0 - sun) + 2.0 * (1.0 + sun)) / (4.0 + 3.0 * (1.0 - cosine) * t);
    // Fluence: even - slope z - 3 mu_sun^2 exp(-z / mu_sun).
    let even = mu_sun * (3.0 * mu_sun + 2.0) - 2.0 * net;
    let slope = 3.0 * (1.0 - cosine) * net;
    // Integrals of 1 and z over what the eye sees.
    let whole = 1.0 - exp(-t / mu);
    let depth = mix(mu * whole - t * (1.0 - whole), t - mu * whole, through);
    let fluence = even * whole - slope * depth - 3.0 * mu_sun * mu_sun * scaled_beam;
    let flux = mix(-mu, mu, through) * (net * whole - mu_sun * scaled_beam);
    return max(once + frame.sky.split.w * (fluence + 3.0 * cosine * flux), 0.0);
}

// Optical depth of a layer along the view ray, weighted by the transmittance from the sun to the eye.
fn layer_beam(t: f32, mu_sun: f32, mu: f32, through: f32) -> f32 {
    let front = one_minus_exp_over(t * (1.0 / mu + 1.0 / mu_sun));
    let back = exp(-t / max(mu, mu_sun)) * one_minus_exp_over(t * abs(1.0 / mu - 1.0 / mu_sun));
    return t / mu * mix(front, back, through);
}

// Light that has turned at most once: `beam` and `scaled_beam` are the optical depth that the eye sees, weighted by the
// transmittance of the way, and the same with scaled extinctions.
fn once_turned(turned: Turn, beam: f32, scaled_beam: f32, chains: f32) -> f32 {
    let forward = frame.sky.split.x;
    let turn = (1.0 - forward + 3.0 * (frame.sky.split.y - forward) * (1.0 - turned.one_minus_mu)) / (4.0 * PI);
    return params.light.albedo * (turned.phase * beam + chains + turn * (scaled_beam - beam));
}

// Light of the background, sky or ground, that clouds have scattered forward.
fn forward_background(direction: vec3f, transmittance: f32, depth: f32) -> vec3f {
    let share = max(exp(-frame.sky.split.z * depth) - transmittance, 0.0);
    var behind = vec3f(0.0);
    let ground = hit_sphere(direction, frame.view.power_ground);
    if AIR {
        let sky = sky_radiance(direction);
        let air = whole_air(direction, air_segment(direction), air_texels(direction), sky);
        behind = air.radiance;
        if ground.enters {
            behind += air.transmittance * shaded_ground(ground.near * direction);
        }
    } else if ground.enters {
        behind = shaded_ground(ground.near * direction);
    }
    return share * (params.light.ambient + params.light.ambient_gain * behind);
}

// Radiance of the ground at a point, in sunlight averaged over a cell of the field.
fn shaded_ground(p: vec3f) -> vec3f {
    let altitude = altitude_at(p);
    let mu = cos_zenith_at(p, frame.sky.sun_direction);
    if VOLUME {
        return ground_radiance(mu);
    }
    return ground_under(p, mu, field_ground_at(field_place(p, altitude).xy).z);
}
