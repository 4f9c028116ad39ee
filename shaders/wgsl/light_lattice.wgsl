// Cells and directions of a level of the light field while it is solved (passes/light_field, passes/light_solver).
//
// Two fields share a sweep: x is the sun's, for an irradiance of 1; y is that of a uniform sky of radiance 1 over black
// ground.
#import bindings
#import light_field

// Directions: eight corners, up, down, and eight that are tilted out of the rows. Horizontal directions in place of the
// tilted would never leave a row of scattered clouds: the fluence between them came out three to ten times too large.
// The quadrature integrates second moments, and the flux of isotropic light through a plane, exactly. The tilt makes
// the fourth moment of the vertical exact within 4 %.
const DIRECTIONS = 18u;
const CORNERS = 8u;
const STEEP = 10u; // corners, up and down
const TILT = 0.12; // sine of the tilt
const TILTED_WEIGHT = 0.0378938; // in units of 4 pi
const AXIS_WEIGHT = 0.0725136;
const CORNER_WEIGHT = 0.0689778;

fn is_corner(d: u32) -> bool {
    return d < CORNERS;
}

// Steps of a direction from cell to cell.
fn lattice_step(d: u32) -> vec3i {
    if is_corner(d) {
        return vec3i(i32(d & 1u), i32((d >> 1u) & 1u), i32(d >> 2u)) * 2 - 1;
    }
    let up = 1 - 2 * i32(d & 1u);
    if d < STEEP {
        return vec3i(0, 0, up);
    }
    let along = 1 - 2 * i32((d >> 1u) & 1u);
    return select(vec3i(0, along, up), vec3i(along, 0, up), d < 14u);
}

// Unit vector of a direction: the same angles in cells of any shape.
fn lattice_direction(d: u32) -> vec3f {
    let step = vec3f(lattice_step(d));
    if is_corner(d) {
        return step * inverseSqrt(3.0);
    }
    return select(step * vec3f(vec2f(sqrt(1.0 - TILT * TILT)), TILT), step, d < STEEP);
}

fn lattice_weight(d: u32) -> f32 {
    return 4.0 * PI * select(select(TILTED_WEIGHT, AXIS_WEIGHT, d < STEEP), CORNER_WEIGHT, is_corner(d));
}

// Whether a direction is followed from row to row, in at most one cell per row; else along a row, from cell to cell.
fn crosses_rows(d: u32) -> bool {
    return d < STEEP || level.tilt_crosses > 0u;
}

// Length of a direction's path through a cell, m.
fn lattice_length(d: u32) -> f32 {
    return length_through(d, level.cell, crosses_rows(d));
}

fn length_through(d: u32, cell: vec3f, by_rows: bool) -> f32 {
    let direction = abs(lattice_direction(d));
    if by_rows {
        return cell.z / direction.z;
    }
    return select(cell.y / direction.y, cell.x / direction.x, direction.x > 0.0);
}

fn level_size() -> vec3u {
    return vec3u(level.across, level.along, level.rows);
}

fn cell_count() -> u32 {
    return level.across * level.along * level.rows;
}

fn coarser_size() -> vec3u {
    return vec3u(level.coarser_across, level.coarser_along, level.coarser_rows);
}

fn cell_index(at: vec3i) -> u32 {
    return (u32(at.z) * level.along + u32(at.y)) * level.across + u32(at.x);
}

fn cell_of(index: u32) -> vec3i {
    let size = level_size();
    return vec3i(vec3u(index % size.x, index / size.x % size.y, index / (size.x * size.y)));
}

// Moments of the light in a cell: fluence and flux of the sun's field and of the sky's.
struct Moments {
    sun: vec4f,
    sky: vec4f,
}

// Moments of the scaled sunlight in a cell.
fn beam_moments(index: u32) -> vec4f {
    if level.corrects > 0u {
        return vec4f(0.0);
    }
    let beam = deposits[index].y * balance[0];
    return vec4f(beam, -beam * level.sun);
}

// Source functions, linear in the direction: S(d) = S.x + S.yzw . d
fn source_functions(index: u32, moments: Moments) -> Moments {
    let c = frame.sky.split.w * vec4f(1.0, vec3f(3.0 * frame.sky.turned_cosine)); // scaled albedo / 4 pi
    return Moments(c * (moments.sun + beam_moments(index)), c * moments.sky);
}

// Mean radiance of a direction in a cell: that of others (`radiances`) with that of the cell's own source along a path
// of an optical depth.
fn mean_radiance(d: u32, index: u32, cells: u32, depth: f32) -> vec2f {
    let source = source_functions(index, Moments(moments_now[2u * index], moments_now[2u * index + 1u]));
    let direction = vec4f(1.0, lattice_direction(d));
    let own = vec2f(dot(source.sun, direction), dot(source.sky, direction));
    return unpack2x16float(radiances[d * cells + index]) + own * (1.0 - one_minus_exp_over(depth));
}

// Nearest values that half floats hold. lavapipe rounds toward zero when it stores them: the loss of 2e-4 per
// scattering is absorption, which takes 2 % of the light from a slab of optical depth 80.
fn nearest_half(v: vec4f) -> vec4f {
    return bitcast<vec4f>((bitcast<vec4u>(v) + 0x1000u) & vec4u(0xffffe000u));
}

fn packed(radiance: vec2f) -> u32 {
    return pack2x16float(nearest_half(vec4f(radiance, 0.0, 0.0)).xy);
}

// Texture coordinates in a texture of the level alone.
fn level_texel(cell: vec3f, size: vec3f) -> vec3f {
    let inside = clamp(cell.z, 0.5, size.z - 0.5);
    return vec3f(cell.xy, inside) / size;
}

// Moments of the coarser level at a cell.
fn coarser_moments(at: vec3i) -> Moments {
    let uvw = level_texel(coarser_cell(vec3f(at) + 0.5), vec3f(coarser_size()));
    return Moments(
        textureSampleLevel(coarser_sun, clamp_sampler, uvw, 0.0),
        textureSampleLevel(coarser_sky, clamp_sampler, uvw, 0.0),
    );
}

// Trilinear interpolation between middles of cells, clamped at the faces.
struct Corner {
    low: vec3i,
    high: vec3i,
    share: vec3f,
}

fn interpolation(cell: vec3f, size: vec3u) -> Corner {
    let at = clamp(cell - 0.5, vec3f(0.0), vec3f(size) - 1.0);
    let low = vec3i(floor(at));
    return Corner(low, min(low + 1, vec3i(size) - 1), at - vec3f(low));
}

fn corner_weight(corner: Corner, i: u32) -> f32 {
    let w = select(1.0 - corner.share, corner.share, vec3<bool>((i & 1u) > 0u, (i & 2u) > 0u, (i & 4u) > 0u));
    return w.x * w.y * w.z;
}

fn corner_index(corner: Corner, i: u32, size: vec2u) -> u32 {
    let at = select(corner.low, corner.high, vec3<bool>((i & 1u) > 0u, (i & 2u) > 0u, (i & 4u) > 0u));
    return (u32(at.z) * size.y + u32(at.y)) * size.x + u32(at.x);
}

// Cells of a side's rim that a direction enters, by direction: those at a side in x, then those at a side in y.
fn rim_cells() -> u32 {
    return (level.across + level.along) * level.rows;
}

fn rim_x(d: u32, at: vec3i) -> u32 {
    return d * rim_cells() + u32(at.z) * level.along + u32(at.y);
}

fn rim_y(d: u32, at: vec3i) -> u32 {
    return d * rim_cells() + level.rows * level.along + u32(at.z) * level.across + u32(at.x);
}

// Radiance that enters at the top, at the base, or at the sides of an open level: that of the sky from above, which
// needs no correction.
fn open_radiance(d: u32) -> vec2f {
    return vec2f(0.0, select(0.0, 1.0, lattice_step(d).z < 0 && level.corrects == 0u));
}
