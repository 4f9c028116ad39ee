// Bakes the light field: on each level of nested cells the extinction, the optical depth toward the sun, and the light
// that clouds have scattered at least once out of the forward direction. A level is swept along 18 directions of a
// lattice; each sweep conserves energy in every cell. Levels are solved from the coarsest to the finest; what enters a
// finer level at its sides is the radiance of the coarser one.
//
// Two fields share a sweep: x is the sun's, for an irradiance of 1; y is that of a uniform sky of radiance 1 over black
// ground.
#import bindings
#import density
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
    let direction = abs(lattice_direction(d));
    if crosses_rows(d) {
        return level.cell.z / direction.z;
    }
    return select(level.cell.y / direction.y, level.cell.x / direction.x, direction.x > 0.0);
}

fn level_size() -> vec3u {
    return vec3u(level.across, level.along, level.rows);
}

fn coarser_size() -> vec3u {
    return vec3u(level.coarser_across, level.coarser_along, level.coarser_rows);
}

fn cell_index(at: vec3i) -> u32 {
    return (u32(at.z) * level.along + u32(at.y)) * level.across + u32(at.x);
}

// Mean density of a cell, from four points: corners of a tetrahedron.
@compute @workgroup_size(4, 4, 4)
fn field_density(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if any(id >= size) {
        return;
    }
    var sum = 0.0;
    var most = 0.0;
    var i = 0u;
    loop {
        let aside = vec3f(vec3u(i & 1u, i >> 1u, (i ^ (i >> 1u)) & 1u)) * 0.5 + 0.25;
        let q = level_place(vec3f(id) + aside);
        let width = 0.5 * level.cell.z;
        var density = 0.0;
        if VOLUME {
            density = cloud_density_at(q + frame.sky.volume_low - frame.sky.field_cell, 0.0, width);
        } else {
            let column = column_on_chart(q.xy, q.z + frame.sky.field_base);
            density = cloud_density(column, cloud_shape(column), width);
        }
        sum += density;
        most = max(most, density);
        i += 1u;
        if i >= 4u {
            break;
        }
    }
    textureStore(volume_out, id, vec4f(sum / 4.0, 0.0, most, 0.0));
}

// Texture coordinates in a texture of the level alone.
fn level_texel(cell: vec3f, size: vec3f) -> vec3f {
    let inside = clamp(cell.z, 0.5, size.z - 0.5);
    return vec3f(cell.xy, inside) / size;
}

fn density_of_level(cell: vec3f) -> f32 {
    let uvw = level_texel(cell, vec3f(level_size()));
    if level.sides == SIDES_PERIODIC {
        return textureSampleLevel(level_optics, repeat_sampler, uvw, 0.0).r;
    }
    return textureSampleLevel(level_optics, clamp_sampler, uvw, 0.0).r;
}

// Optical depth toward the sun from the middle of a cell: through this level for some cells, then that of the coarser
// level.
@compute @workgroup_size(4, 4, 4)
fn field_depth(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if any(id >= size) {
        return;
    }
    let start = vec3f(id) + 0.5;
    let speed = level.sun / level.cell; // cells per metre
    let whole = sun_way(start);
    let way = min(whole, f32(level.sun_steps) * sun_step());
    // The last step ends where the ray does: the others do not depend on where that is.
    let step = sun_step();
    var depth = 0.0;
    var t = 0.0;
    loop {
        let length = min(step, way - t);
        depth += length * density_of_level(sun_place(start, speed, t + 0.5 * length));
        t += step;
        if t >= way {
            break;
        }
    }
    depth *= frame.sky.extinction;
    if level.sides == SIDES_COARSER {
        let coarser = coarser_cell(sun_place(start, speed, way));
        let uvw = level_texel(coarser, vec3f(coarser_size()));
        let beyond = textureSampleLevel(coarser_optics, clamp_sampler, uvw, 0.0).g;
        depth += select(beyond, 0.0, way >= sun_rise(start.z));
    }
    let texel = textureLoad(level_optics, id, 0);
    textureStore(volume_out, id, vec4f(texel.r, min(depth, MOST_DEPTH), texel.b, 0.0));
}

// Largest optical depth that half floats hold with a margin.
const MOST_DEPTH = 30000.0;

// Length of the sun's path through a cell along the axis that it crosses fastest, m.
fn sun_step() -> f32 {
    let speed = abs(level.sun / level.cell);
    return 1.0 / max(max(speed.x, speed.y), speed.z);
}

// Curvature of the ground under the sun's ray, 1/m: the ray rises by this times the square of its length.
fn sun_bend() -> f32 {
    return level.bend * (1.0 - level.sun.z * level.sun.z);
}

// Point on the sun's ray, in cells.
fn sun_place(start: vec3f, speed: vec3f, t: f32) -> vec3f {
    return start + t * speed + vec3f(0.0, 0.0, sun_bend() * t * t / level.cell.z);
}

// Distance at which the sun's ray from a row leaves the level at the top, or at the base, m.
fn sun_rise(row: f32) -> f32 {
    let over = (f32(level.rows) - row) * level.cell.z;
    let under = row * level.cell.z;
    let mu = level.sun.z;
    let bend = sun_bend();
    if mu < 0.0 {
        let disc = mu * mu - 4.0 * bend * under;
        if disc > 0.0 {
            return 2.0 * under / (sqrt(disc) - mu);
        }
        return (sqrt(mu * mu + 4.0 * bend * over) - mu) / max(2.0 * bend, 1e-12);
    }
    return 2.0 * over / max(mu + sqrt(mu * mu + 4.0 * bend * over), 1e-6);
}

// Distance at which the sun's ray leaves the level, m. A periodic level has no sides.
fn sun_way(start: vec3f) -> f32 {
    let rise = sun_rise(start.z);
    let ahead = select(start.xy, vec2f(f32(level.across), f32(level.along)) - start.xy, level.sun.xy > vec2f(0.0));
    let sides = ahead * level.cell.xy / max(abs(level.sun.xy), vec2f(1e-9));
    return select(min(rise, min(sides.x, sides.y)), rise, level.sides == SIDES_PERIODIC);
}

// Scaled extinction of each cell, and the scaled sunlight in it: its mean over the cell, in which the optical depth is
// linear.
@compute @workgroup_size(64)
fn field_beam(@builtin(global_invocation_id) id: vec3u) {
    let size = vec3i(level_size());
    if id.x >= u32(size.x * size.y * size.z) {
        return;
    }
    let at = cell_of(id.x);
    let optics = textureLoad(level_optics, at, 0);
    let scale = frame.sky.split.z;
    // At most the depth behind the face toward the sun, where none of the light is lost yet.
    let across = scale * vec3f(
        depth_across(at, vec3i(1, 0, 0)),
        depth_across(at, vec3i(0, 1, 0)),
        depth_across(at, vec3i(0, 0, 1)),
    );
    let depth = scale * optics.g;
    let steps = across * min(2.0 * depth / max(across.x + across.y + across.z, 1e-20), 1.0);
    let before = depth - 0.5 * (steps.x + steps.y + steps.z);
    let beam = exp(-before) * one_minus_exp_over(steps.x) * one_minus_exp_over(steps.y) * one_minus_exp_over(steps.z);
    deposits[id.x] = vec2f(scale * frame.sky.extinction * optics.r, select(0.0, min(beam, 1.0), level.sunlit > 0u));
}

fn cell_of(index: u32) -> vec3i {
    let size = level_size();
    return vec3i(vec3u(index % size.x, index / size.x % size.y, index / (size.x * size.y)));
}

// Difference of the optical depth across a cell along an axis: the larger of those to its neighbours, as of a cell at
// the surface of a cloud one of them lies outside.
fn depth_across(at: vec3i, axis: vec3i) -> f32 {
    let size = vec3i(level_size());
    var low = at - axis;
    var high = at + axis;
    if level.sides == SIDES_PERIODIC {
        low = vec3i((low.xy + size.xy) % size.xy, low.z);
        high = vec3i(high.xy % size.xy, high.z);
    }
    let here = textureLoad(level_optics, at, 0).g;
    let under = textureLoad(level_optics, max(low, vec3i(0)), 0).g;
    let over = textureLoad(level_optics, min(high, size - 1), 0).g;
    return max(abs(here - under), abs(over - here));
}

// Light that the sun loses through the faces of a cell at the faces of the level, by the transmittance there, W per
// unit of irradiance.
fn lost_at(at: vec3i, depth: f32, extinction: f32) -> f32 {
    let size = vec3i(level_size());
    let area = vec3f(level.cell.y * level.cell.z, level.cell.x * level.cell.z, level.cell.x * level.cell.y);
    let half_way = 0.5 * extinction * level.cell / max(abs(level.sun), vec3f(1e-3));
    // What enters has lost less than at the middle of the cell, what leaves more.
    let before = 1.0 - exp(-max(vec3f(depth) - half_way, vec3f(0.0)));
    let after = 1.0 - exp(-(vec3f(depth) + half_way));
    let flux = abs(level.sun) * area;
    let toward_sun = select(vec3<bool>(at == vec3i(0)), at == size - 1, level.sun > vec3f(0.0));
    let away = select(at == size - 1, vec3<bool>(at == vec3i(0)), level.sun > vec3f(0.0));
    var lost = select(vec3f(0.0), flux * after, away) - select(vec3f(0.0), flux * before, toward_sun);
    if level.sides == SIDES_PERIODIC {
        lost = vec3f(0.0, 0.0, lost.z);
    }
    return lost.x + lost.y + lost.z;
}

var<workgroup> partial: array<vec3f, 256>;

// Ratio of the light that the sun loses in the level, by its transmittance at the faces, to what the cells take from
// it. Mean scaled sunlight on what scatters it, and its ratio to that when the level was last solved.
@compute @workgroup_size(256)
fn field_balance(@builtin(local_invocation_id) id: vec3u) {
    let size = level_size();
    let count = size.x * size.y * size.z;
    let volume = level.cell.x * level.cell.y * level.cell.z;
    let scale = frame.sky.split.z;
    var sum = vec3f(0.0);
    let rounds = (count + 255u) / 256u;
    // The same number of iterations for all threads.
    for (var round = 0u; round < rounds; round++) {
        let i = round * 256u + id.x;
        let index = min(i, count - 1u);
        let deposit = deposits[index];
        let at = cell_of(index);
        let lost = lost_at(at, scale * textureLoad(level_optics, at, 0).g, deposit.x);
        sum += select(vec3f(0.0), vec3f(deposit.x * deposit.y * volume, lost, deposit.x * volume), i < count);
    }
    partial[id.x] = sum;
    workgroupBarrier();
    if id.x == 0u {
        var whole = vec3f(0.0);
        for (var i = 0u; i < 256u; i++) {
            whole += partial[i];
        }
        let factor = clamp(whole.y / max(whole.x, 1e-20), 0.25, 4.0);
        let mean = factor * whole.x / max(whole.z, 1e-20);
        let before = balance[0].y;
        balance[0] = vec4f(factor, mean, select(1.0, mean / before, before > 0.0), 0.0);
    }
}

// Moments of the light in a cell: fluence and flux of the sun's field and of the sky's.
struct Moments {
    sun: vec4f,
    sky: vec4f,
}

// Source functions, linear in the direction: S(d) = S.x + S.yzw . d
fn write_sources(index: u32, moments: Moments) {
    let c = frame.sky.split.w; // scaled albedo / 4 pi
    let turn = vec4f(1.0, vec3f(3.0 * frame.sky.turned_cosine));
    let beam = deposits[index].y * balance[0].x;
    let of_sun = c * turn * (moments.sun + vec4f(beam, -beam * level.sun));
    let of_sky = c * turn * moments.sky;
    let halves = vec4u(packed(of_sun.xy), packed(of_sun.zw), packed(of_sky.xy), packed(of_sky.zw));
    if ALONE {
        few_sources[index] = halves;
    } else {
        textureStore(sources_out, cell_of(index), halves);
    }
}

// Nearest values that half floats hold. lavapipe rounds toward zero when it stores them: the loss of 2e-4 per
// scattering is absorption, which takes 2 % of the light from a slab of optical depth 80.
fn nearest_half(v: vec4f) -> vec4f {
    return bitcast<vec4f>((bitcast<vec4u>(v) + 0x1000u) & vec4u(0xffffe000u));
}

fn packed(radiance: vec2f) -> u32 {
    return pack2x16float(nearest_half(vec4f(radiance, 0.0, 0.0)).xy);
}

// Moments to begin with: those of the coarser level, or none, or the level's own of before. These change with the mean
// sunlight on what scatters it: deep decks have slow modes, which the few sweeps of a moving sun do not reach.
@compute @workgroup_size(64)
fn field_start(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if id.x >= size.x * size.y * size.z {
        return;
    }
    var moments = Moments(vec4f(0.0), vec4f(0.0));
    if level.coarser_rows > 0u {
        moments = coarser_moments(cell_of(id.x));
    }
    if level.continues > 0u {
        moments.sun *= balance[0].z;
    }
    moments_now[2u * id.x] = moments.sun;
    moments_now[2u * id.x + 1u] = moments.sky;
    moments_before[2u * id.x] = moments.sun;
    moments_before[2u * id.x + 1u] = moments.sky;
    write_sources(id.x, moments);
}

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

// Radiance that enters at the top, at the base, or at the sides of an open level: that of the sky from above.
fn open_radiance(d: u32) -> vec2f {
    return vec2f(0.0, select(0.0, 1.0, lattice_step(d).z < 0));
}

// Radiance that enters at the sides: of the coarser level, whose `radiances` they are, half a path through a cell
// before its middle.
@compute @workgroup_size(64)
fn field_entering(@builtin(global_invocation_id) id: vec3u) {
    let d = id.y;
    if id.x >= rim_cells() {
        return;
    }
    let size = level_size();
    let step = lattice_step(d);
    var at = vec3u(0u);
    let in_x = id.x < size.z * size.y;
    if in_x {
        at = vec3u(select(size.x - 1u, 0u, step.x > 0), id.x % size.y, id.x / size.y);
    } else {
        let i = id.x - size.z * size.y;
        at = vec3u(i % size.x, select(size.y - 1u, 0u, step.y > 0), i / size.x);
    }
    var radiance = open_radiance(d);
    if level.sides == SIDES_COARSER {
        let before = vec3f(at) + 0.5 - 0.5 * lattice_length(d) * lattice_direction(d) / level.cell;
        let there = coarser_size();
        let corner = interpolation(coarser_cell(before), there);
        radiance = vec2f(0.0);
        for (var i = 0u; i < 8u; i++) {
            let cells = there.x * there.y * there.z;
            let other = radiances[d * cells + corner_index(corner, i, there.xy)];
            radiance += corner_weight(corner, i) * unpack2x16float(other);
        }
    }
    entering[d * rim_cells() + id.x] = packed(radiance);
}

// Source functions of a cell in a direction.
fn source_toward(at: vec3i, direction: vec3f) -> vec2f {
    var halves: vec4u;
    if ALONE {
        halves = few_sources[cell_index(at)];
    } else {
        halves = textureLoad(sources, at, 0);
    }
    let sun = vec4f(unpack2x16float(halves.x), unpack2x16float(halves.y));
    let sky = vec4f(unpack2x16float(halves.z), unpack2x16float(halves.w));
    return vec2f(sun.x + dot(sun.yzw, direction), sky.x + dot(sky.yzw, direction));
}

// Scaled optical depth of a path of unit length through a cell, 1/m.
fn scaled_extinction(at: vec3i) -> f32 {
    return frame.sky.split.z * frame.sky.extinction * textureLoad(level_optics, at, 0).r;
}

// Radiance that leaves a cell, and its mean along the path through it. The source is linear along the path, with the
// slope between the neighbours; the mean follows from the balance of the cell, so that energy is conserved for any
// optical depth. No limiter on the slope: the solve is linear.
struct Crossing {
    leaving: vec2f,
    mean: vec2f,
}

fn cross_cell(t: f32, entering: vec2f, source: vec2f, slope: vec2f) -> Crossing {
    let thin = t < 0.02;
    let e = exp(-t);
    let a = select((1.0 - e) / max(t, 1e-6), 1.0 - 0.5 * t + t * t / 6.0, thin);
    let q = select((0.5 * (1.0 + e) - a) / max(t, 1e-6), t / 12.0, thin);
    let absorbed = a * t; // 1 - exp(-t)
    return Crossing(
        entering * (1.0 - absorbed) + source * absorbed + slope * (q * t),
        entering * a + source * (1.0 - a) - slope * q,
    );
}

// Slope of the source along a line, one-sided at its ends.
fn source_slope(before: vec2f, here: vec2f, next: vec2f, has_before: bool, has_next: bool) -> vec2f {
    let both = 0.5 * (next - before);
    return select(select(vec2f(0.0), next - here, has_next), select(here - before, both, has_next), has_before);
}

// Sweeps the directions that cross rows: a thread follows a line from row to row, in a staircase along the direction.
// Every cell lies on one line.
@compute @workgroup_size(32, 2, 1)
fn field_sweep_down(@builtin(global_invocation_id) id: vec3u) {
    if all(id < vec3u(level.across, level.along, select(STEEP, DIRECTIONS, level.tilt_crosses > 0u))) {
        follow_down(id.z, vec2i(id.xy));
    }
}

// Rows at which staircases down and up begin: about the top of a deck, and below its base. Were they the same row,
// lines up and down would go through the same cells, and columns exchange less light: after the planned sweeps a wide
// level is twice as far from convergence.
const DOWN_FROM = 20.0;
const UP_FROM = -1.0;

// Follows a direction from row to row, from a cell at the top or at the base.
fn follow_down(d: u32, begin: vec2i) {
    let size = vec3i(level_size());
    let step = lattice_step(d);
    let direction = lattice_direction(d);
    let length = lattice_length(d);
    let first = d * u32(size.x * size.y * size.z);
    let open = level.sides != SIDES_PERIODIC;
    // Cells by which the line moves per row.
    let shift = abs(direction.xy) / abs(direction.z) * level.cell.z / level.cell.xy;
    var radiance = open_radiance(d);
    var at = vec3i(begin, select(size.z - 1, 0, step.z > 0));
    // The staircase is that of the row's number, whichever row it begins in.
    let first_step = select(DOWN_FROM - (level.lowest + f32(size.z) - 1.0), level.lowest - UP_FROM, step.z > 0);
    var before = vec2f(0.0);
    var here = source_toward(at, direction);
    var has_before = false;
    var m = 1;
    var moved = vec2f(floor(shift * first_step + 0.5));
    loop {
        let move_to = floor(shift * (first_step + f32(m)) + 0.5);
        let last = m >= size.z;
        var next_at = vec3i(at.xy + step.xy * vec2i(move_to - moved), select(at.z + step.z, at.z, last));
        moved = move_to;
        let under = next_at.xy < vec2i(0);
        let over = next_at.xy >= size.xy;
        next_at = vec3i(next_at.xy + select(vec2i(0), size.xy, under) - select(vec2i(0), size.xy, over), next_at.z);
        let wraps = open && any(under | over);
        let next = source_toward(next_at, direction);
        let slope = source_slope(before, here, next, has_before, !(last || wraps));
        let crossing = cross_cell(scaled_extinction(at) * length, radiance, here, slope);
        radiances[first + cell_index(at)] = packed(crossing.mean);
        radiance = crossing.leaving;
        if open {
            let in_x = under.x || over.x;
            let from_side = unpack2x16float(entering[select(rim_y(d, next_at), rim_x(d, next_at), in_x)]);
            radiance = select(radiance, from_side, wraps);
        }
        before = here;
        has_before = !wraps;
        here = next;
        at = next_at;
        m += 1;
        if last {
            break;
        }
    }
}

// Sweeps the tilted directions in cells that are not flat: a thread follows a line from cell to cell, which changes its
// row from time to time, and begins anew where it has left the level at the top or at the base. In a periodic level it
// has gone around before, until it has begun anew.
@compute @workgroup_size(32, 2, 1)
fn field_sweep_along(@builtin(global_invocation_id) id: vec3u) {
    let size = vec3i(level_size());
    let d = STEEP + id.z;
    let step = lattice_step(d);
    let in_x = step.x != 0;
    if id.z >= DIRECTIONS - STEEP || i32(id.x) >= select(size.x, size.y, in_x) || i32(id.y) >= size.z {
        return;
    }
    let count = select(size.y, size.x, in_x);
    let direction = lattice_direction(d);
    let length = lattice_length(d);
    let first = d * u32(size.x * size.y * size.z);
    let periodic = level.sides == SIDES_PERIODIC;
    let ahead = step.x + step.y;
    // Rows by which the line rises from cell to cell. Around a periodic level it rises by whole rows: what leaves a
    // cell enters another.
    var rise = TILT / sqrt(1.0 - TILT * TILT) * select(level.cell.y, level.cell.x, in_x) / level.cell.z;
    rise = select(rise, max(round(rise * f32(count)), 1.0) / f32(count), periodic);
    let rounds = select(1, i32(ceil(f32(size.z) / (rise * f32(count)))) + 1, periodic);
    var m = (1 - rounds) * count;
    // The line is in row `id.y` where its last round begins.
    var risen = floor(rise * f32(m) + 0.5);
    let turns = floor((f32(id.y) + f32(step.z) * risen) / f32(size.z));
    var row = i32(id.y) + step.z * i32(risen) - i32(turns) * size.z;
    var place = select(count - 1, 0, ahead > 0);
    var at = line_cell(id.x, place, row, in_x);
    var radiance = open_radiance(d);
    if !periodic {
        radiance = unpack2x16float(entering[select(rim_y(d, at), rim_x(d, at), in_x)]);
    }
    var before = vec2f(0.0);
    var here = source_toward(at, direction);
    var has_before = false;
    loop {
        m += 1;
        let rise_to = floor(rise * f32(m) + 0.5);
        row += step.z * i32(rise_to - risen);
        risen = rise_to;
        let leaves = row < 0 || row >= size.z;
        row = select(row, row - step.z * size.z, leaves);
        place += ahead;
        place = select(place, place - ahead * count, place < 0 || place >= count);
        let last = m >= count;
        let next_at = line_cell(id.x, place, row, in_x);
        let next = source_toward(next_at, direction);
        let slope = source_slope(before, here, next, has_before, !(leaves || last));
        let crossing = cross_cell(scaled_extinction(at) * length, radiance, here, slope);
        if m > 0 {
            radiances[first + cell_index(at)] = packed(crossing.mean);
        }
        radiance = select(crossing.leaving, open_radiance(d), leaves);
        before = here;
        has_before = !leaves;
        here = next;
        at = next_at;
        if last {
            break;
        }
    }
}

fn line_cell(line: u32, place: i32, row: i32, in_x: bool) -> vec3i {
    return select(vec3i(i32(line), place, row), vec3i(place, i32(line), row), in_x);
}

// Moments of a sweep, and the step of Chebyshev's iteration with them.
@compute @workgroup_size(64)
fn field_gather(@builtin(global_invocation_id) id: vec3u) {
    if id.x < level.across * level.along * level.rows {
        gather(id.x, level.weight);
    }
}

// The buffers of both moments exchange their roles after each step.
fn gather(index: u32, weight: f32) {
    let cells = level.across * level.along * level.rows;
    var swept = Moments(vec4f(0.0), vec4f(0.0));
    for (var d = 0u; d < DIRECTIONS; d++) {
        let radiance = lattice_weight(d) * unpack2x16float(radiances[d * cells + index]);
        let moment = vec4f(1.0, lattice_direction(d));
        swept.sun += radiance.x * moment;
        swept.sky += radiance.y * moment;
    }
    let now = Moments(moments_now[2u * index], moments_now[2u * index + 1u]);
    let before = Moments(moments_before[2u * index], moments_before[2u * index + 1u]);
    let next = Moments(
        before.sun + weight * (now.sun + level.relaxation * (swept.sun - now.sun) - before.sun),
        before.sky + weight * (now.sky + level.relaxation * (swept.sky - now.sky) - before.sky),
    );
    moments_before[2u * index] = select(next.sun, now.sun, ALONE);
    moments_before[2u * index + 1u] = select(next.sky, now.sky, ALONE);
    if ALONE {
        moments_now[2u * index] = next.sun;
        moments_now[2u * index + 1u] = next.sky;
    }
    write_sources(index, next);
}

// All sweeps of a grid of few cells, by one workgroup: as dispatches of their own most of their time would be that of
// launching them.
@compute @workgroup_size(256)
fn field_sweep_few(@builtin(local_invocation_id) id: vec3u) {
    let size = level_size();
    let lines = size.x * size.y * DIRECTIONS;
    let cells = size.x * size.y * size.z;
    let mu = level.relaxation - 1.0;
    var weight = 1.0;
    for (var sweep = 0u; sweep < level.sweeps; sweep++) {
        for (var first = 0u; first < lines; first += 256u) {
            let line = first + id.x;
            if line < lines {
                let column = line % (size.x * size.y);
                follow_down(line / (size.x * size.y), vec2i(vec2u(column % size.x, column / size.x)));
            }
        }
        storageBarrier();
        for (var first = 0u; first < cells; first += 256u) {
            if first + id.x < cells {
                gather(first + id.x, weight);
            }
        }
        storageBarrier();
        weight = 1.0 / (1.0 - select(0.25 * weight, 0.5, sweep == 0u) * mu * mu);
    }
}

// Stores the solution of a level.
@compute @workgroup_size(4, 4, 4)
fn field_keep(@builtin(global_invocation_id) id: vec3u) {
    if all(id < level_size()) {
        let index = cell_index(vec3i(id));
        textureStore(sun_out, id, nearest_half(moments_now[2u * index]));
        textureStore(sky_out, id, nearest_half(moments_now[2u * index + 1u]));
    }
}

// Stores a level in the textures of all levels. Toward its rim a level blends into the coarser one, so that reads need
// no second level.
@compute @workgroup_size(4, 4, 4)
fn field_store(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if any(id >= size) {
        return;
    }
    var optics = textureLoad(level_optics, id, 0);
    var moments = Moments(textureLoad(level_sun, id, 0), textureLoad(level_sky, id, 0));
    if level.sides == SIDES_COARSER {
        let at = vec3f(id) + 0.5;
        let middle = 0.5 * vec2f(size.xy);
        let away = abs(at.xy - middle) / middle;
        let share = smoothstep(BLEND, 1.0, max(away.x, away.y));
        let coarser = coarser_moments(vec3i(id));
        moments.sun = mix(moments.sun, coarser.sun, share);
        moments.sky = mix(moments.sky, coarser.sky, share);
        let uvw = level_texel(coarser_cell(at), vec3f(coarser_size()));
        optics = mix(optics, textureSampleLevel(coarser_optics, clamp_sampler, uvw, 0.0), share);
    }
    let out = vec3u(id.xy, level.first_row + id.z);
    textureStore(volume_out, out, optics);
    textureStore(sun_out, out, moments.sun);
    textureStore(sky_out, out, moments.sky);
}

// Fraction of a level's half width from which on it blends into the coarser level.
const BLEND = 0.8;

// Light on the ground under a level: `field_ground`. The radiance of each direction that leaves the lowest row meets
// the ground beside it.
@compute @workgroup_size(8, 8)
fn field_ground_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if any(id.xy >= size.xy) {
        return;
    }
    let cells = size.x * size.y * size.z;
    var sun = 0.0;
    var sky = 0.0;
    for (var d = 0u; d < DIRECTIONS; d++) {
        let direction = lattice_direction(d);
        if direction.z < 0.0 {
            // Beyond the sides the level repeats.
            let beside = frame.sky.field_base * direction.xy / direction.z / level.cell.xy;
            let at = fract((vec2f(id.xy) + 0.5 + beside) / vec2f(size.xy)) * vec2f(size.xy);
            let corner = interpolation(vec3f(at, 0.5), size);
            var radiance = vec2f(0.0);
            for (var i = 0u; i < 4u; i++) {
                let index = d * cells + corner_index(corner, i, size.xy);
                radiance += corner_weight(corner, i) * unpack2x16float(radiances[index]);
            }
            sun -= lattice_weight(d) * direction.z * radiance.x;
            sky -= lattice_weight(d) * direction.z * radiance.y;
        }
    }
    // The sun's light, straight from the lowest row.
    let mu = max(level.sun.z, 1e-3);
    let beside = frame.sky.field_base * level.sun.xy / mu / level.cell.xy;
    let at = fract((vec2f(id.xy) + 0.5 + beside) / vec2f(size.xy)) * vec2f(size.xy);
    let depth = textureSampleLevel(level_optics, repeat_sampler, level_texel(vec3f(at, 0.5), vec3f(size)), 0.0).g;
    let direct = exp(-vec2f(frame.sky.split.z, 1.0) * depth);
    let out = vec2u(id.x, level.first_row + id.y);
    textureStore(map_out, out, vec4f(sun, sky / PI, direct));
}
