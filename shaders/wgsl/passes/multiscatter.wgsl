// Bakes the multiscattering LUT, order by order. The first order keeps its phase functions. Higher orders are kept as
// mean and two moments, which are functions of altitude and sun alone, so that each order is gathered from the tables
// of the one before. Hillaire 2020 extrapolates the higher orders from the second as a geometric series, which fails at
// dusk, when low air is lit by high air alone.
#import bindings
#import atmosphere

// Directions of the gather: rows above and below the horizon, columns from the sun's azimuth to the opposite one. Steps
// along each direction.
const ROWS_ABOVE = 8u;
const ROWS_BELOW = 4u;
const COLUMNS = 6u;
const STEPS = 10u;

// Light that arrives at a point, in the form of the tables.
struct Arriving {
    mean: vec3f,
    up: vec3f,
    sunward: vec3f,
    flux_sunward: vec3f,
    above: vec3f,
    below: vec3f,
}

@compute @workgroup_size(8, 8)
fn first_order(@builtin(global_invocation_id) id: vec3u) {
    write_order(id, true);
}

@compute @workgroup_size(8, 8)
fn next_order(@builtin(global_invocation_id) id: vec3u) {
    write_order(id, false);
}

fn write_order(id: vec3u, first: bool) {
    if id.x >= TABLE_COSINES || id.y >= TABLE_ALTITUDES {
        return;
    }
    let at = vec2f(id.xy) / vec2f(f32(TABLE_COSINES - 1u), f32(TABLE_ALTITUDES - 1u));
    let side = 2.0 * at.x - 1.0;
    let arriving = gather_light(AIR_TOP * at.y * at.y, sign(side) * side * side, first);
    write_table(id.xy, SCATTERED, arriving.mean);
    write_table(id.xy, SCATTERED_UP, arriving.up);
    write_table(id.xy, SCATTERED_SUNWARD, arriving.sunward);
    write_table(id.xy, FLUX_SUNWARD, arriving.flux_sunward);
    write_table(id.xy, FROM_ABOVE, arriving.above);
    write_table(id.xy, FROM_BELOW, arriving.below);
}

fn write_table(at: vec2u, table: u32, light: vec3f) {
    textureStore(map_out, at + vec2u(0u, table * TABLE_ALTITUDES), vec4f(to_table(light), 1.0));
}

fn gather_light(h: f32, mu_sun: f32, first: bool) -> Arriving {
    let radius = params.atmosphere.planet_radius;
    let dip = atan2(sqrt(h * (2.0 * radius + h)), radius);
    var sum = Arriving(vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0));
    var cosines = vec2f(0.0);
    for (var row = 0u; row < ROWS_ABOVE + ROWS_BELOW; row++) {
        // Quadratic spacing of elevation angles around the horizon, where light changes fastest with the angle.
        let is_above = row < ROWS_ABOVE;
        let rows = f32(select(ROWS_BELOW, ROWS_ABOVE, is_above));
        let x = vec3f(0.0, 0.5, 1.0) / rows + f32(select(row - ROWS_ABOVE, row, is_above)) / rows;
        let angle = select(-x * x * (0.5 * PI - dip), x * x * (0.5 * PI + dip), is_above) - dip;
        let share = abs(sin(angle.z) - sin(angle.x)) / (2.0 * f32(COLUMNS));
        let up = sin(angle.y);
        for (var column = 0u; column < COLUMNS; column++) {
            let azimuth = PI * (f32(column) + 0.5) / f32(COLUMNS);
            let cosine = clamp(
                up * mu_sun + cos(angle.y) * cos(azimuth) * sqrt(max(1.0 - mu_sun * mu_sun, 0.0)),
                -1.0,
                1.0,
            );
            let light = light_along(h, mu_sun, up, cosine, is_above, first);
            let sunward = cos(angle.y) * cos(azimuth);
            sum.mean += share * light;
            sum.up += share * up * up * light;
            sum.sunward += share * sunward * sunward * light;
            sum.flux_sunward += share * sunward * light;
            sum.above += share * max(up, 0.0) * light;
            sum.below += share * max(-up, 0.0) * light;
            cosines += share * vec2f(max(up, 0.0), max(-up, 0.0));
        }
    }
    sum.above /= cosines.x;
    sum.below /= cosines.y;
    return sum;
}

// Radiance of one order that arrives at a point from a direction with zenith cosine `mu` and cosine `cosine` to the
// sun.
fn light_along(h: f32, mu_sun: f32, mu: f32, cosine: f32, is_above: bool, first: bool) -> vec3f {
    let radius = params.atmosphere.planet_radius;
    let r = radius + h;
    let b = r * mu;
    let out = (AIR_TOP - h) * (2.0 * radius + h + AIR_TOP);
    let to_top = select(sqrt(b * b + out) - b, out / max(sqrt(b * b + out) + b, 1e-3), b > 0.0);
    let ground = h * (2.0 * radius + h);
    let to_ground = ground / max(sqrt(max(b * b - ground, 0.0)) - b, 1e-3);
    let end = select(to_ground, to_top, is_above);
    // Quadratic spacing from the lowest point of the ray.
    let lowest = clamp(-b, 0.0, end);
    let from_s = -sqrt(lowest);
    let to_s = sqrt(end - lowest);
    var radiance = vec3f(0.0);
    var depth = vec3f(0.0);
    for (var i = 0u; i < STEPS; i++) {
        let s = mix(vec3f(from_s), vec3f(to_s), (f32(i) + vec3f(0.0, 0.5, 1.0)) / f32(STEPS));
        let t = lowest + s * abs(s);
        let step = t.z - t.x;
        let d = t.y * (t.y + 2.0 * b);
        let altitude = max(h + d / (r + sqrt(max(r * r + d, 0.0))), 0.0);
        let mu_there = (r * mu_sun + t.y * cosine) / (radius + altitude);
        let parts = air_parts(altitude);
        var source = vec3f(0.0);
        if first {
            source = air_scattering_toward(parts, 1.0 - cosine) * sunlight(altitude, mu_there);
        } else {
            let light = Scattered(
                order_before(SCATTERED, altitude, mu_there),
                order_before(SCATTERED_UP, altitude, mu_there),
                order_before(SCATTERED_SUNWARD, altitude, mu_there),
                0.25 * (order_before(FROM_ABOVE, altitude, mu_there) - order_before(FROM_BELOW, altitude, mu_there)),
                order_before(FLUX_SUNWARD, altitude, mu_there),
            );
            source = scattered_again(parts, light, mu_there, (b + t.y) / (radius + altitude), cosine);
        }
        let x = air_extinction(parts) * step;
        radiance += exp(-depth) * source * step * one_minus_exp_over3(x);
        depth += x;
    }
    if !is_above {
        let mu_there = (r * mu_sun + end * cosine) / radius;
        var lit = vec3f(0.0);
        if first {
            lit = sunlight(0.0, mu_there) * max(mu_there, 0.0) / PI;
        } else {
            lit = order_before(FROM_ABOVE, 0.0, mu_there);
        }
        radiance += exp(-depth) * params.atmosphere.ground_albedo * lit;
    }
    return radiance;
}

fn order_before(table: u32, h: f32, mu: f32) -> vec3f {
    return from_table(textureSampleLevel(mix_a, clamp_sampler, table_coordinates(table, h, mu), 0.0).rgb);
}

// Sum of all orders: four of them, and a geometric series with the ratio of the fourth to the third.
@compute @workgroup_size(8, 8)
fn sum_orders(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(map_out)) {
        return;
    }
    let third = from_table(textureLoad(mix_c, id.xy, 0).rgb);
    let fourth = from_table(textureLoad(mix_d, id.xy, 0).rgb);
    let rest = fourth / (1.0 - min(fourth / max(third, vec3f(TABLE_NONE)), vec3f(0.95)));
    let sum = from_table(textureLoad(mix_a, id.xy, 0).rgb) + from_table(textureLoad(mix_b, id.xy, 0).rgb)
        + third + rest;
    textureStore(map_out, id.xy, vec4f(to_table(sum), 1.0));
}
