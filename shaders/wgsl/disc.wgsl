// Discs of sun and moon: the fraction of the disc's light in each pixel, exact at any pixel size. Points of the sky
// project to the plane that touches the sphere of directions at the disc's centre (gnomonic projection), in disc radii;
// great circles become straight lines. A pixel is a polygon in that plane, and its fraction of the disc is a sum over
// its edges (Green's theorem). Neighbouring pixels share edges, so that their fractions add up to 1 despite rounding.
#import math
#import camera
#import atmosphere
#import aerial

// Limb darkening of the sun: exponents of the cosine at its surface, at 680, 550 and 440 nm (Hestroffer and Magnan
// 1998, after Hillaire 2016).
const LIMB = vec3f(0.397, 0.503, 0.652);

struct Disc {
    direction: vec3f,
    radius: f32,
    bounds: vec4f, // left, top, right and bottom of a rectangle that contains it, pixels
    irradiance: vec3f,
    limb: vec3f,
    bright: vec3f, // unit vector to its bright side
    phase: f32, // cosine of the phase angle between light source and eye at the disc: 1 is fully lit
}

fn sun_disc() -> Disc {
    let at = frame.sky.sun_direction;
    return Disc(at, SUN_RADIUS, frame.view.sun_bounds, params.sun.irradiance, LIMB, perpendicular(at), 1.0);
}

// The moon has no limb darkening: a full moon is as bright at its limb as at its centre.
fn moon_disc() -> Disc {
    let bounds = frame.view.moon_bounds;
    let light = frame.sky.moon_light;
    let phase = frame.sky.moon_phase;
    return Disc(frame.sky.moon_direction, MOON_RADIUS, bounds, light, vec3f(0.0), frame.sky.moon_bright, phase);
}

// Mean radiance of the discs in a pixel, through the air.
fn discs_in_pixel(pixel: vec2u) -> vec3f {
    var light = vec3f(0.0);
    // The loop has one call of `disc_in_pixel`. Compilers inline every call, and the function takes seconds to compile.
    for (var k = 0u; k < 2u; k++) {
        var disc = sun_disc();
        if k == 1u {
            disc = moon_disc();
        }
        let visible = k == 1u || params.sun.visible > 0u;
        light += select(vec3f(0.0), disc_in_pixel(disc, vec2f(pixel)), visible);
    }
    // Rounding may give a negative sum next to a disc.
    return max(light, vec3f(0.0)) / pixel_solid_angle(vec2f(pixel));
}

// Irradiance of a disc in a pixel.
fn disc_in_pixel(disc: Disc, corner: vec2f) -> vec3f {
    // A panorama wraps around at its sides.
    let rounds = select(0, 1, CAMERA == EQUIRECT);
    let plane = disc_plane(disc);
    var share = vec3f(0.0);
    for (var round = -rounds; round <= rounds; round++) {
        let shift = vec2f(f32(round * i32(frame.view.width)), 0.0);
        let low = max(corner + shift, disc.bounds.xy);
        let high = min(corner + shift + 1.0, disc.bounds.zw);
        if all(low < high) {
            share += disc_in_part(disc, plane, low - shift, high - shift);
        }
    }
    return disc.irradiance * share;
}

// Pieces, along each side of the disc's bounds, in which its transmittance is sampled. Air dims the lower half of a
// disc at the horizon more than the upper half.
const PIECES_ACROSS = 5.0;

fn disc_in_part(disc: Disc, plane: DiscPlane, low: vec2f, high: vec2f) -> vec3f {
    let pieces = ceil(PIECES_ACROSS * saturate((high - low) / (disc.bounds.zw - disc.bounds.xy)));
    let size = (high - low) / pieces;
    var share = vec3f(0.0);
    for (var y = 0.0; y < pieces.y; y += 1.0) {
        for (var x = 0.0; x < pieces.x; x += 1.0) {
            let from_corner = low + vec2f(x, y) * size;
            let to_corner = select(from_corner + size, high, vec2f(x, y) + 1.0 == pieces);
            let region = clipped(pixel_polygon(plane, from_corner, to_corner), vec2f(0.0, 1.0), plane.horizon);
            let through = disc_transmittance(view_direction(0.5 * (from_corner + to_corner)).xyz);
            share += through * lit_share(region, plane.bright, disc.phase, 1.0 + 0.5 * disc.limb);
        }
    }
    return share;
}

// Transmittance of the air toward a disc, without the ground: the polygon is already clipped at the horizon.
fn disc_transmittance(direction: vec3f) -> vec3f {
    if !AIR {
        return vec3f(1.0);
    }
    let way = air_segment(direction);
    let altitude = select(max(frame.view.altitude, 0.0), AIR_TOP, frame.view.power_air > 0.0);
    let through = air_transmittance(altitude, cos_zenith_along(direction, way.start, altitude));
    return select(vec3f(1.0), through, way.length > 0.0);
}

// Tangent plane at the centre of a disc. Its axes are local directions (right, up, forward).
struct DiscPlane {
    middle: vec3f, // local direction to the centre, with the length of `local_direction` (camera.wgsl)
    toward: vec3f, // unit local direction to the centre
    right: vec3f,
    up: vec3f, // away from the ground
    radius: f32,
    bright: vec2f, // unit vector to the bright side
    horizon: f32, // height of the horizon in the plane, radii
}

fn disc_plane(disc: Disc) -> DiscPlane {
    let sine = dot(disc.direction, frame.view.zenith);
    let level = cross(disc.direction, frame.view.zenith);
    let cosine = length(level);
    let right = select(perpendicular(disc.direction), level / max(cosine, 1e-6), cosine > 1e-6);
    let up = cross(right, disc.direction);
    let toward = to_local(disc.direction);
    let middle = select(toward, toward / max(toward.z, 1e-6), CAMERA != EQUIRECT && CAMERA != FISHEYE);
    let horizon = -(sine + sin(frame.view.horizon_dip)) / max(cosine, 1e-6) / disc.radius;
    let bright = vec2f(dot(disc.bright, right), dot(disc.bright, up));
    return DiscPlane(middle, toward, to_local(right), to_local(up), disc.radius, bright, horizon);
}

fn to_local(direction: vec3f) -> vec3f {
    return vec3f(dot(direction, frame.view.right), dot(direction, frame.view.up), dot(direction, frame.view.forward));
}

// Projection of a picture position to the plane, in radii. The subtraction precedes the dot products: narrow views lose
// their digits otherwise.
fn disc_place(plane: DiscPlane, pixel: vec2f) -> vec2f {
    let local = local_direction(pixel).xyz;
    let beside = local - plane.middle;
    return vec2f(dot(beside, plane.right), dot(beside, plane.up))
        / (max(dot(local, plane.toward), 1e-3) * plane.radius);
}

// Corners per side of a pixel's polygon. A pinhole's pixels have straight edges in the plane; those of panorama and
// fisheye are curved.
const CORNERS_A_SIDE = 3u;
// Corners of a polygon after two cuts.
const MOST_CORNERS = 4u * CORNERS_A_SIDE + 4u;

struct Polygon {
    corners: array<vec2f, MOST_CORNERS>,
    count: u32,
}

// Polygon in the plane of a rectangle of the picture, counterclockwise.
fn pixel_polygon(plane: DiscPlane, low: vec2f, high: vec2f) -> Polygon {
    let a_side = select(1u, CORNERS_A_SIDE, CAMERA == EQUIRECT || CAMERA == FISHEYE);
    var polygon: Polygon;
    polygon.count = 4u * a_side;
    for (var i = 0u; i < polygon.count; i++) {
        let s = f32(i % a_side) / f32(a_side);
        var at = vec2f(s, 1.0);
        switch i / a_side {
            case 0u: {}
            case 1u: { at = vec2f(1.0, 1.0 - s); }
            case 2u: { at = vec2f(1.0 - s, 0.0); }
            default: { at = vec2f(0.0, s); }
        }
        // Interpolation in this form is exact at both ends.
        polygon.corners[i] = disc_place(plane, (1.0 - at) * low + at * high);
    }
    return polygon;
}

// Part of a polygon beyond a line, on the side of its normal.
fn clipped(given: Polygon, normal: vec2f, offset: f32) -> Polygon {
    var polygon: Polygon;
    polygon.count = 0u;
    for (var i = 0u; i < given.count; i++) {
        let a = given.corners[i];
        let b = given.corners[(i + 1u) % given.count];
        let beyond = vec2f(dot(normal, a), dot(normal, b)) - offset;
        if beyond.x >= 0.0 {
            polygon.corners[polygon.count] = a;
            polygon.count += 1u;
        }
        if (beyond.x >= 0.0) != (beyond.y >= 0.0) && polygon.count < MOST_CORNERS {
            polygon.corners[polygon.count] = a + (b - a) * (beyond.x / (beyond.x - beyond.y));
            polygon.count += 1u;
        }
    }
    return polygon;
}

// Fraction of a disc's light in a polygon. Brightness falls toward the limb as (1 - r^2)^(exponent - 1), so that the
// light within radius r is 1 - (1 - r^2)^exponent. The fraction is the integral of that over the polar angle along the
// edges.
fn polygon_share(polygon: Polygon, exponent: vec3f) -> vec3f {
    // A polygon that does not surround the centre: the constant 1 integrates to 0 and is left out. This is exact
    // outside the disc.
    var size = 0.0;
    for (var i = 1u; i < polygon.count; i++) {
        size = max(size, distance(polygon.corners[i], polygon.corners[0]));
    }
    let beside = size < 0.4 * length(polygon.corners[0]);
    var sum = vec3f(0.0);
    for (var i = 0u; i < polygon.count; i++) {
        sum += edge_share(polygon.corners[i], polygon.corners[(i + 1u) % polygon.count], exponent, beside);
    }
    return sum / (2.0 * PI);
}

// Fraction of the light of a partly lit ball in a polygon. The lit part has uniform radiance: it is the half disc
// toward the light, plus (gibbous) or minus (crescent) half an ellipse, which is a squeezed disc. A fully lit ball is
// one disc.
fn lit_share(region: Polygon, bright: vec2f, phase: f32, exponent: vec3f) -> vec3f {
    let full = phase >= 1.0;
    let narrow = max(abs(phase), 1e-3);
    var sum = vec3f(0.0);
    for (var k = 0u; k < select(2u, 1u, full); k++) {
        let ellipse = k == 1u;
        var part = clipped(region, select(bright, -bright, ellipse && phase > 0.0), select(0.0, -1e30, full));
        for (var i = 0u; i < select(0u, part.count, ellipse); i++) {
            let at = part.corners[i];
            part.corners[i] = at + bright * (dot(at, bright) * (1.0 / narrow - 1.0));
        }
        sum += select(1.0, phase, ellipse) * polygon_share(part, exponent);
    }
    return select(sum / max(0.5 * (1.0 + phase), 1e-4), sum, full);
}

// Nodes and weights of the four-point Gauss-Legendre rule on [-1, 1].
const GAUSS_AT = vec4f(-0.8611363116, -0.3399810436, 0.3399810436, 0.8611363116);
const GAUSS_WEIGHT = vec4f(0.3478548451, 0.6521451549, 0.6521451549, 0.3478548451);

fn edge_share(a: vec2f, b: vec2f, exponent: vec3f, beside: bool) -> vec3f {
    let long = distance(a, b);
    if long <= 0.0 {
        return vec3f(0.0);
    }
    let along = (b - a) / long;
    let away = a.x * along.y - a.y * along.x;
    // Part of the edge inside the disc.
    let half_chord = sqrt(max(1.0 - away * away, 0.0));
    let s = clamp(vec2f(dot(a, along), dot(b, along)), vec2f(-half_chord), vec2f(half_chord));
    let foot = away * vec2f(along.y, -along.x);
    var sum = vec3f(0.0);
    for (var i = 0u; i < 4u; i++) {
        let at = mix(s.x, s.y, 0.5 + 0.5 * GAUSS_AT[i]);
        let r2 = min(away * away + at * at, 1.0);
        let outside = pow(vec3f(1.0 - r2), exponent);
        // Series near the centre, where (1 - (1 - r^2)^exponent) / r^2 cancels.
        let inside = select((1.0 - outside) / max(r2, 1e-2), exponent * (1.0 - 0.5 * (exponent - 1.0) * r2), r2 < 1e-2);
        sum += GAUSS_WEIGHT[i] * select(inside, -outside / max(r2, 1e-12), beside);
    }
    sum *= 0.5 * (s.y - s.x) * away;
    if !beside {
        sum += turn(a, foot + s.x * along) + turn(foot + s.y * along, b);
    }
    return sum;
}

// Angle between two points about the centre, radians.
fn turn(a: vec2f, b: vec2f) -> f32 {
    return atan2(a.x * b.y - a.y * b.x, dot(a, b) + 1e-20);
}
