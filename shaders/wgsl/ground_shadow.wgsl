// How much sun reaches the ground around the eye, and the air over it, as it is baked: a stack of levels, each twice as wide
// and coarse as the one before (passes/shadow). Transmittance is what is interpolated. A texel's four numbers are those of the
// sun's ray to that place on the ground: where it leaves the clouds, and at a quarter, a half and three quarters of their height.
#import bindings
#import shell
#import high_layer

// The side of a texel of a level, m.
fn shadow_texel(level: u32) -> f32 {
    return frame.sky.shadow_texel * f32(1u << level);
}

// The ground under, or over, a place beside the eye.
fn ground_place(xy: vec2f) -> vec3f {
    let centre = frame.view.zenith * frame.view.centre_distance;
    let across = length(centre.xy + xy);
    let r = params.atmosphere.planet_radius;
    let up = sqrt(max((r - across) * (r + across), 0.0));
    return vec3f(xy, select(-up, up, centre.z >= 0.0) - centre.z);
}

// How far a level reaches from its middle, m: to half a texel from its rim.
fn shadow_reach(level: u32) -> f32 {
    return (0.5 * f32(SHADOW_SIDE) - 0.5) * shadow_texel(level);
}

// A place from the middle of the levels, as one of them has it: half a texel from those above and below.
fn shadow_in_level(q: vec2f, level: u32) -> vec4f {
    let side = f32(SHADOW_SIDE);
    let texel = clamp(q / shadow_texel(level) + 0.5 * side, vec2f(0.5), vec2f(side - 0.5));
    let at = texel + vec2f(0.0, f32(level) * side);
    return textureSampleLevel(ground_shadow, clamp_sampler, at / vec2f(side, side * f32(SHADOW_LEVELS)), 0.0);
}

// The finest level that holds a place and whose texels are no finer than `fine` metres. Levels go over into the next toward
// their rims, so that one read does.
fn shadow_level(q: vec2f, fine: f32) -> u32 {
    let away = max(abs(q.x), abs(q.y)) / shadow_reach(0u);
    let level = max(ceil(log2(max(away, 1e-6))), round(log2(max(fine / shadow_texel(0u), 1e-6))));
    return u32(clamp(level, 0.0, f32(SHADOW_LEVELS - 1u)));
}

// How much sun reaches a point on the ground through the marched clouds.
fn baked_ground_sun(p: vec3f) -> f32 {
    let q = p.xy + frame.sky.shadow_eye;
    return shadow_in_level(q, shadow_level(q, 0.0)).x;
}

// How much sun reaches a point in the air through them, as its ray goes on to the ground; beyond the levels, and where the ray
// misses the ground, that is their mean.
fn baked_air_sun(p: vec3f, altitude: f32, mu_sun: f32, fine: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    let down = crossing(-(radius + altitude) * mu_sun, max(altitude, 0.0) * (2.0 * radius + altitude));
    const BEYOND = vec2f(1e9);
    let q = select(BEYOND, p.xy - down.near * frame.sky.sun_direction.xy + frame.sky.shadow_eye, down.enters);
    let baked = shadow_in_level(q, shadow_level(q, fine));
    let x = 4.0 * height_among_clouds(p, altitude);
    return dot(saturate(1.0 - abs(max(x, 0.0) - vec4f(0.0, 1.0, 2.0, 3.0))), baked) + saturate(x - 3.0);
}

// A height from the lowest marched clouds, 0, to the highest, 1.
fn height_among_clouds(p: vec3f, altitude: f32) -> f32 {
    if VOLUME {
        return (p.z - frame.sky.volume_low.z) / (frame.sky.volume_high.z - frame.sky.volume_low.z);
    }
    return (altitude - frame.sky.shell_base) / (frame.sky.shell_top - frame.sky.shell_base);
}

// Share of the sun that the clouds in its way scatter on to the ground: that of stratus (Haurwitz 1948: stratus 0.25,
// stratocumulus 0.35, nimbostratus 0.18 of a clear sky). Without it ground and air under overcast are lit by blue sky alone.
const PASSED_ON = 0.25;

// Optical depth of the high clouds over a point on the ground, for the sun's cosine with its zenith: the way leaves their
// sphere once.
fn high_depth_over(p: vec3f, mu_sun: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    let altitude = params.high_clouds.altitude;
    let q = p + crossing(radius * mu_sun, -altitude * (2.0 * radius + altitude)).far * frame.sky.sun_direction;
    let slant = max(abs(cos_zenith_at(q, frame.sky.sun_direction)), 0.02);
    return high_optical_depth(q) / slant;
}

// Optical depth of the high clouds on a ray from a point: where it enters their sphere, and where it leaves it.
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
