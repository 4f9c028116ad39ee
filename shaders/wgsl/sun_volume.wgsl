// Sunlight through the clouds, baked around the eye: a stack of levels, each twice as wide and coarse as the one before,
// between the base and the top of the clouds. Transmittance is what is interpolated: exp(-x) of an interpolated depth is
// too dark (Jensen).
#import bindings
#import shell

const LEVELS = 6u;
// The side of a cell of the finest level, m.
const CELL = 75.0;
// Cells across a level; between base and top they are `frame.sun_volume_rows`.
const SIDE = 96u;
// Deep clouds pass no light that half floats hold, yet models that scatter many times see their depth: the texels hold
// exp(-rate * depth) for four rates.
const RATES = vec4f(1.0, 0.25, 0.0625, 0.015625);

fn level_cell(level: u32) -> f32 {
    return CELL * f32(1u << level);
}

// The finest level that holds a place beside the eye.
fn level_at(p: vec2f) -> u32 {
    const REACH = (0.5 * f32(SIDE) - 2.0) * CELL;
    let q = abs(p + frame.sun_volume_eye);
    let away = max(q.x, q.y) / REACH;
    return min(u32(ceil(max(log2(max(away, 1e-6)), 0.0))), LEVELS - 1u);
}

// Where a place is in the stack; z keeps half a cell from the levels above and below.
fn stack_coordinates(p: vec2f, height: f32, level: u32) -> vec3f {
    let rows = frame.sun_volume_rows;
    let across = (p + frame.sun_volume_eye) / (level_cell(level) * f32(SIDE)) + 0.5;
    let row = clamp(height * f32(rows), 0.5, f32(rows) - 0.5) + f32(level * rows);
    return vec3f(across, row / f32(LEVELS * rows));
}

fn height_at(altitude: f32) -> f32 {
    return (altitude - frame.shell_base) / (frame.shell_top - frame.shell_base);
}

// Optical depth from a point to the sun, as it is baked.
fn sun_volume_depth(given: vec3f, level: u32) -> f32 {
    let altitude = altitude_at(given);
    // Light from below has crossed the clouds beyond the horizon.
    let inner = hit_sphere_from(given, frame.sun_direction, frame.shell_base);
    let under = altitude < frame.shell_base && inner.hit;
    let p = given + select(0.0, inner.far, under) * frame.sun_direction;
    let height = height_at(select(altitude, frame.shell_base, under));
    let at = stack_coordinates(p.xy, height, max(level, level_at(p.xy)));
    let depth = -log(max(textureSampleLevel(sun_volume, clamp_sampler, at, 0.0), vec4f(1e-7)));
    // Of the rates the highest at which light is left.
    let known = smoothstep(vec4f(6.0), vec4f(3.0), depth);
    let d = depth / RATES;
    let beyond = mix(mix(mix(d.w, d.z, known.z), d.y, known.y), d.x, known.x);
    return select(beyond, 0.0, height >= 1.0);
}
