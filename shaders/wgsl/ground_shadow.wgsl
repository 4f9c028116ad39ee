// Shadow clipmap: transmittance of the marched clouds toward the sun, for the ground around the eye and the air over
// it. Its levels are stacked in one texture, each twice as wide and coarse as the one before (passes/shadow). The four
// channels of a texel hold the transmittance on the sun ray to its place on the ground: below all clouds, and at a
// quarter, a half and three quarters of their height range. Reads interpolate transmittance, not optical depth.
#import bindings
#import shell
#import high_layer

// Side of a texel of a level, m.
fn shadow_texel(level: u32) -> f32 {
    return frame.sky.shadow_texel * f32(1u << level);
}

// Point of the planet's surface at a horizontal offset `xy` from the eye, relative to the eye.
fn ground_place(xy: vec2f) -> vec3f {
    let centre = frame.view.zenith * frame.view.centre_distance;
    let across = length(centre.xy + xy);
    let r = params.atmosphere.planet_radius;
    let up = sqrt(max((r - across) * (r + across), 0.0));
    return vec3f(xy, select(-up, up, centre.z >= 0.0) - centre.z);
}

// Half width of a level up to the centre of its outermost texels, m.
fn shadow_reach(level: u32) -> f32 {
    return (0.5 * f32(SHADOW_SIDE) - 0.5) * shadow_texel(level);
}

// Sample of a level at `q`, m from the centre of the clipmap. Clamping to texel centres keeps the stacked levels apart.
fn shadow_in_level(q: vec2f, level: u32) -> vec4f {
    let side = f32(SHADOW_SIDE);
    let texel = clamp(q / shadow_texel(level) + 0.5 * side, vec2f(0.5), vec2f(side - 0.5));
    let at = texel + vec2f(0.0, f32(level) * side);
    return textureSampleLevel(ground_shadow, clamp_sampler, at / vec2f(side, side * f32(SHADOW_LEVELS)), 0.0);
}

// Finest level that contains `q` and whose texels have at least `fine` metres. Each level blends into the next toward
// its rim, so that one read suffices.
fn shadow_level(q: vec2f, fine: f32) -> u32 {
    let away = max(abs(q.x), abs(q.y)) / shadow_reach(0u);
    let level = max(ceil(log2(max(away, 1e-6))), round(log2(max(fine / shadow_texel(0u), 1e-6))));
    return u32(clamp(level, 0.0, f32(SHADOW_LEVELS - 1u)));
}

// Transmittance of the marched clouds toward the sun at a point of the ground.
fn baked_ground_sun(p: vec3f) -> f32 {
    let q = p.xy + frame.sky.shadow_eye;
    return shadow_in_level(q, shadow_level(q, 0.0)).x;
}

// Transmittance of the marched clouds toward the sun at a point in the air, read where its sun ray, extended downwards,
// meets the ground. Points beyond the clipmap, and sun rays that miss the ground, have the mean of the last level.
fn baked_air_sun(p: vec3f, altitude: f32, mu_sun: f32, fine: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    let down = crossing(-(radius + altitude) * mu_sun, max(altitude, 0.0) * (2.0 * radius + altitude));
    const BEYOND = vec2f(1e9);
    let q = select(BEYOND, p.xy - down.near * frame.sky.sun_direction.xy + frame.sky.shadow_eye, down.enters);
    let baked = shadow_in_level(q, shadow_level(q, fine));
    let x = 4.0 * height_among_clouds(p, altitude);
    return dot(saturate(1.0 - abs(max(x, 0.0) - vec4f(0.0, 1.0, 2.0, 3.0))), baked) + saturate(x - 3.0);
}

// Height of a point in the range of the marched clouds: 0 at the lowest, 1 at the highest.
fn height_among_clouds(p: vec3f, altitude: f32) -> f32 {
    if VOLUME {
        return (p.z - frame.sky.volume_low.z) / (frame.sky.volume_high.z - frame.sky.volume_low.z);
    }
    return (altitude - frame.sky.shell_base) / (frame.sky.shell_top - frame.sky.shell_base);
}

// Fraction of the sun's irradiance that clouds transmit diffusely to the ground: that of stratus (Haurwitz 1948:
// stratus 0.25, stratocumulus 0.35, nimbostratus 0.18 of a clear sky). Without it, blue skylight alone lights ground
// and air under an overcast.
const PASSED_ON = 0.25;

// Optical depth of the high clouds toward the sun, over a point of the ground where the sun has zenith cosine `mu_sun`.
// The sun ray leaves their sphere once.
fn high_depth_over(p: vec3f, mu_sun: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    let altitude = params.high_clouds.altitude;
    let q = p + crossing(radius * mu_sun, -altitude * (2.0 * radius + altitude)).far * frame.sky.sun_direction;
    let slant = max(abs(cos_zenith_at(q, frame.sky.sun_direction)), 0.02);
    return high_optical_depth(q) / slant;
}

// Optical depth of the high clouds along a ray from a point: both crossings of their sphere.
fn high_depth_from(p: vec3f, direction: vec3f) -> f32 {
    let high = hit_sphere_from(p, direction, params.high_clouds.altitude);
    var depth = 0.0;
    if high.hit && params.high_clouds.coverage > 0.0 {
        for (var side = 0; side < 2; side++) {
            let t = select(high.far, high.near, side == 0);
            let q = p + t * direction;
            let slant = max(abs(cos_zenith_at(q, direction)), 0.02);
            depth += select(0.0, high_optical_depth(q) / slant, t > 0.0);
        }
    }
    return depth;
}
