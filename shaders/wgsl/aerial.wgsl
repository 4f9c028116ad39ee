// The air between the eye and what it sees, and the light along a ray: both follow from the distance alone, and smoothly,
// so that a ray works them out at four distances and not for every sample.
#import atmosphere
#import light_shafts

// The air along a ray, up to the ground or to space.
struct AirSegment {
    start: f32, // where the ray enters the air, m
    length: f32, // m from there
    grounded: bool, // whether it ends on the ground
}

fn air_segment(direction: vec3f) -> AirSegment {
    let air = hit_sphere(direction, frame.view.power_air);
    let ground = hit_sphere(direction, frame.view.power_ground);
    let end = select(air.far, ground.near, ground.enters);
    return AirSegment(air.near, select(0.0, max(end - air.near, 0.0), air.hit), ground.enters);
}

// Optical depth of the air between two distances on a ray from the eye, in so many pieces.
fn aerial_depth(direction: vec3f, start: f32, end: f32, pieces: u32) -> vec3f {
    var depth = vec3f(0.0);
    var before = altitude_at(start * direction);
    let piece = (end - start) / f32(pieces);
    for (var i = 1u; i <= pieces; i++) {
        let after = altitude_at((start + f32(i) * piece) * direction);
        depth += air_depth_between(before, after, piece);
        before = after;
    }
    return depth;
}

// The air before a distance: its transmittance, and the radiance that it adds.
struct Air {
    transmittance: vec3f,
    radiance: vec3f,
}

// Pieces of the way to the first distance, and of the ways between them.
const FIRST_PIECES = 4u;
const PIECES = 2u;
// Pieces of the way to the ground.
const GROUND_PIECES = 8u;

// The air before a distance on a ray, of a sky of so much radiance.
fn air_before(direction: vec3f, distance: f32, way: AirSegment, texels: AirTexels, sky: vec3f) -> Air {
    let start = min(way.start, distance);
    let end = min(distance, way.start + way.length);
    return air_of(aerial_depth(direction, start, end, FIRST_PIECES), distance, way, texels, sky);
}

fn air_of(depth: vec3f, distance: f32, way: AirSegment, texels: AirTexels, sky: vec3f) -> Air {
    let amount = params.atmosphere.aerial_perspective;
    let slices = f32(textureDimensions(aerial_perspective_lut).z);
    let root = sqrt(saturate((distance - way.start) / max(way.length, 1e-3)));
    let at = vec3f(texels.share, (root * (slices - 1.0) + 0.5) / slices);
    let share = saturate(textureSampleLevel(aerial_perspective_lut, clamp_sampler, at, 0.0).rgb);
    // So much more air hides so much more of the sky behind.
    let scaled = select(1.0 - pow(1.0 - share, vec3f(amount)), share, amount == 1.0);
    var radiance = scaled * sky;
    if LIGHT_SHAFTS {
        let lack = shafts_before(texels.shafts, distance);
        radiance = max(radiance - select(scaled / max(share, vec3f(1e-6)), vec3f(1.0), amount == 1.0) * lack, vec3f(0.0));
    }
    return Air(exp(-amount * depth), radiance);
}

// Where the textures of the air have a direction.
struct AirTexels {
    share: vec2f, // `aerial_perspective_lut`
    shafts: vec2f,
}

fn air_texels(direction: vec3f) -> AirTexels {
    let share = sky_texel(sky_coordinates(direction), vec2f(textureDimensions(aerial_perspective_lut).xy));
    var shafts = vec2f(0.0);
    if LIGHT_SHAFTS {
        shafts = shaft_texel(direction);
    }
    return AirTexels(share, shafts);
}

// All the air along a ray: to the ground, or to space from where it enters the air.
fn whole_air(direction: vec3f, way: AirSegment, texels: AirTexels, sky: vec3f) -> Air {
    var radiance = sky;
    if LIGHT_SHAFTS {
        radiance = max(sky - shafts_before(texels.shafts, way.start + way.length), vec3f(0.0));
    }
    if way.grounded {
        let depth = aerial_depth(direction, way.start, way.start + way.length, GROUND_PIECES);
        return Air(exp(-params.atmosphere.aerial_perspective * depth), radiance);
    }
    let altitude = select(max(frame.view.altitude, 0.0), AIR_TOP, frame.view.power_air > 0.0);
    let through = air_transmittance(altitude, cos_zenith_along(direction, way.start, altitude));
    return Air(select(vec3f(1.0), through, way.length > 0.0), radiance);
}

// Four distances on a ray, the first where its clouds may begin and the last where they end: near ones lie closer together.
struct AerialPoints {
    start: f32,
    length: f32,
    bend: f32, // m from the start within which they are as good as evenly spread
}

// The air hides half of what is some tens of kilometres away.
const AERIAL_BEND = 40000.0;

fn aerial_points(start: f32, length: f32) -> AerialPoints {
    return AerialPoints(start, max(length, 1.0), AERIAL_BEND);
}

// The distance of a node.
fn aerial_point_distance(nodes: AerialPoints, k: f32) -> f32 {
    let x = k / 3.0;
    return nodes.start + nodes.length * nodes.bend * x / (nodes.length + nodes.bend - nodes.length * x);
}

// Shares of a distance in the four nodes, by which what is worked out there is interpolated.
fn aerial_point_shares(nodes: AerialPoints, distance: f32) -> vec4f {
    let d = clamp(distance - nodes.start, 0.0, nodes.length);
    let k = 3.0 * d * (nodes.length + nodes.bend) / (nodes.length * (d + nodes.bend));
    return saturate(1.0 - abs(k - vec4f(0.0, 1.0, 2.0, 3.0)));
}
