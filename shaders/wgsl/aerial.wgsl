// Aerial perspective: transmittance and inscattered radiance of the air between the eye and a point. Both are smooth
// functions of distance along a ray, and so is the light at a point. Each ray evaluates them at four distances and
// interpolates, instead of once per sample.
#import atmosphere
#import light_shafts

// Segment of a ray inside the atmosphere: from its entry to the ground or to space.
struct AirSegment {
    start: f32, // distance of the entry into the atmosphere, m
    length: f32, // m
    grounded: bool, // whether the segment ends on the ground
}

fn air_segment(direction: vec3f) -> AirSegment {
    let air = hit_sphere(direction, frame.view.power_air);
    let ground = hit_sphere(direction, frame.view.power_ground);
    let end = select(air.far, ground.near, ground.enters);
    return AirSegment(air.near, select(0.0, max(end - air.near, 0.0), air.hit), ground.enters);
}

// Optical depth of the air between two distances on a ray from the eye, integrated in `pieces` pieces.
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

// Air before a distance: its transmittance and its inscattered radiance.
struct Air {
    transmittance: vec3f,
    radiance: vec3f,
}

// Pieces of the integral to the first of the four distances, and between two of them.
const FIRST_PIECES = 4u;
const PIECES = 2u;
// Pieces of the integral to the ground.
const GROUND_PIECES = 8u;

// Air before a distance on a ray. `sky` is the radiance of the whole ray (sky-view LUT).
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
    // Scaling by the amount of air: the share of the sky's radiance from behind the distance falls exponentially with
    // it.
    let scaled = select(1.0 - pow(1.0 - share, vec3f(amount)), share, amount == 1.0);
    var radiance = scaled * sky;
    if LIGHT_SHAFTS {
        let lack = shafts_before(texels.shafts, distance);
        radiance = max(
            radiance - select(scaled / max(share, vec3f(1e-6)), vec3f(1.0), amount == 1.0) * lack,
            vec3f(0.0),
        );
    }
    return Air(exp(-amount * depth), radiance);
}

// Texture coordinates of a direction in the LUTs of the air.
struct AirTexels {
    share: vec2f, // in `aerial_perspective_lut`
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

// Air along a whole ray: to the ground, or to space from the entry into the atmosphere.
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

// Four sample distances on a ray, from the start of its clouds to their end. Spacing grows with distance.
struct AerialPoints {
    start: f32,
    length: f32,
    bend: f32, // distance from the start up to which spacing is about uniform, m
}

// Scale of that spacing, m: air hides about half of an object some tens of kilometres away.
const AERIAL_BEND = 40000.0;

fn aerial_points(start: f32, length: f32) -> AerialPoints {
    return AerialPoints(start, max(length, 1.0), AERIAL_BEND);
}

// Distance of sample point `k`, m.
fn aerial_point_distance(nodes: AerialPoints, k: f32) -> f32 {
    let x = k / 3.0;
    return nodes.start + nodes.length * nodes.bend * x / (nodes.length + nodes.bend - nodes.length * x);
}

// Interpolation weights of the four sample points at a distance.
fn aerial_point_shares(nodes: AerialPoints, distance: f32) -> vec4f {
    let d = clamp(distance - nodes.start, 0.0, nodes.length);
    let k = 3.0 * d * (nodes.length + nodes.bend) / (nodes.length * (d + nodes.bend));
    return saturate(1.0 - abs(k - vec4f(0.0, 1.0, 2.0, 3.0)));
}
