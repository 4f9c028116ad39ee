// How much sun reaches the ground around the eye, as it is baked: a stack of levels, each twice as wide and coarse as the one
// before (passes/shadow). Transmittance is what is interpolated.
#import bindings
#import shell
#import high_layer

// Texels across a level, and levels (as in shadow.rs).
const SHADOW_SIDE = 88u;
const SHADOW_LEVELS = 5u;

// The side of a texel of a level, m.
fn shadow_texel(level: u32) -> f32 {
    return frame.shadow_texel * f32(1u << level);
}

// The ground under, or over, a place beside the eye.
fn ground_place(xy: vec2f) -> vec3f {
    let centre = frame.zenith * frame.centre_distance;
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
fn shadow_in_level(q: vec2f, level: u32) -> f32 {
    let side = f32(SHADOW_SIDE);
    let texel = clamp(q / shadow_texel(level) + 0.5 * side, vec2f(0.5), vec2f(side - 0.5));
    let at = texel + vec2f(0.0, f32(level) * side);
    return textureSampleLevel(ground_shadow, clamp_sampler, at / vec2f(side, side * f32(SHADOW_LEVELS)), 0.0).r;
}

// How much sun reaches a point on the ground through the marched clouds: from the finest level that holds it. Levels go over
// into the next toward their rims, so that one read does.
fn baked_ground_sun(p: vec3f) -> f32 {
    let q = p.xy + frame.shadow_eye;
    let away = max(abs(q.x), abs(q.y)) / shadow_reach(0u);
    return shadow_in_level(q, u32(clamp(ceil(log2(max(away, 1e-6))), 0.0, f32(SHADOW_LEVELS - 1u))));
}

// Optical depth of the high clouds over a point on the ground, for the sun's cosine with its zenith: the way leaves their
// sphere once.
fn high_depth_over(p: vec3f, mu_sun: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    let altitude = params.high_clouds.altitude;
    let q = p + crossing(radius * mu_sun, -altitude * (2.0 * radius + altitude)).far * frame.sun_direction;
    let slant = max(abs(cos_zenith_at(q, frame.sun_direction)), 0.02);
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
