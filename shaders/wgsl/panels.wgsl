// Quadrature by panels with two Gauss points, exact for cubics. The user's grid is a cubic along a ray between two
// planes through voxel centres, and panels end at those planes (Novins and Arvo 1992).
#import bindings
#import shell
#import density

// Position of the first Gauss point in a panel, and of the second from its end: (1 - 1 / sqrt 3) / 2.
const GAUSS = 0.21132486540518713;

// Panel of a ray, in metres into its segments.
struct Panel {
    begin: f32,
    end: f32,
}

// Values of the field at the two points.
struct Reading {
    density: vec2f,
    first: WeatherSample,
    second: WeatherSample,
}

// Panel that starts `x` metres into the segments of a ray: at most `longest`, within one segment and one cell of the
// grid.
fn panel_from(origin: vec3f, direction: vec3f, s: Segments, x: f32, longest: f32) -> Panel {
    var end = x + longest;
    if x < s.first {
        end = min(end, s.first);
    }
    if VOLUME {
        end = min(end, next_plane(origin, direction, s.start + x) - s.start);
    }
    // Every panel makes progress, despite rounding.
    return Panel(x, max(end, x + shortest_panel(s, x)));
}

// Shortest panel, m: far from the eye positions are rounded by more than a millimetre.
fn shortest_panel(s: Segments, x: f32) -> f32 {
    return max(4e-7 * (s.start + x), 1e-3);
}

// The two points of a panel, in metres into the segments.
fn panel_points(panel: Panel) -> vec2f {
    return mix(vec2f(panel.begin), vec2f(panel.end), vec2f(GAUSS, 1.0 - GAUSS));
}

fn read_panel(panel: Panel, origin: vec3f, direction: vec3f, s: Segments, width: f32) -> Reading {
    let points = panel_points(panel);
    let p = origin + stretch_distance(s, points.x) * direction;
    let q = origin + stretch_distance(s, points.y) * direction;
    let a = cloud_column(p, altitude_at(p));
    let b = cloud_column(q, altitude_at(q));
    return Reading(
        vec2f(cloud_density(a, cloud_shape(a), width), cloud_density(b, cloud_shape(b), width)),
        a,
        b,
    );
}

// Optical depth of a panel.
fn panel_depth(panel: Panel, density: vec2f) -> f32 {
    return frame.sky.extinction * (panel.end - panel.begin) * 0.5 * (density.x + density.y);
}

// Fraction of a panel's weight at its first point. A point weighs its density times the transmittance from the panel's
// start; density between the points is taken as linear.
fn first_share(depth: f32, density: vec2f) -> f32 {
    let scale = 2.0 * depth / max(density.x + density.y, 1e-30);
    let slope = (density.y - density.x) / (1.0 - 2.0 * GAUSS);
    let start = density.x - slope * GAUSS;
    let u = vec2f(GAUSS, 1.0 - GAUSS);
    let before = scale * max(start * u + 0.5 * slope * u * u, vec2f(0.0));
    // Transmittance is relative to the nearer point, so that it does not underflow for both.
    let weight = density * exp(min(before.x, before.y) - before);
    return weight.x / max(weight.x + weight.y, 1e-30);
}

// Smallest feature of the procedural field, m: the least of a texel of the base shape, of the detail's texels, and of
// 1/128 of the thinnest deck. For the detail 2.5 texels of its finer copy count, as that is shallow: in partial
// sunlight the root mean square error is 0.5 %, and 1.6 % without the finer copy in this minimum. Cells of the user's
// grid limit its panels themselves.
fn finest_feature() -> f32 {
    if VOLUME {
        return 1e30;
    }
    let detail = params.clouds.detail_scale / (f32(DETAIL_SIZE * FINER) / 2.5);
    let noise = min(params.clouds.shape_scale / f32(SHAPE_SIZE), detail);
    return min(select(1.0, min(params.upper_clouds.scale, 1.0), UPPER) * noise, thinnest_deck() / 128.0);
}

fn thinnest_deck() -> f32 {
    let lower = params.clouds.top - params.clouds.base;
    return select(lower, min(lower, params.upper_clouds.top - params.upper_clouds.base), UPPER);
}

// Longest panel that resolves the features which the footprint does not smooth: the height profile, a texel of the
// weather map, and the rim of the region kept clear.
fn coarsest_panel() -> f32 {
    let texel = select(1.0, params.upper_clouds.scale, UPPER) * params.weather.extent
        / f32(textureDimensions(weather_map).x);
    let rim = select(1e30, 0.5 * frame.sky.clear_radius, KEEP_CLEAR);
    return max(min(min(thinnest_deck() / 16.0, 2.0 * texel), rim), 2.0 * finest_feature());
}
