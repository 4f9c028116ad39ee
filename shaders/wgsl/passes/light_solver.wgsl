// Solves a level of the light field by cycles of multigrid: sweeps of its cells along the directions of the lattice,
// and grids of wider cells that correct what such sweeps would need hundreds of rounds for (luts/light_solver.rs). Each
// sweep conserves energy in every cell.
#import bindings
#import light_lattice

fn write_sources(index: u32, moments: Moments) {
    let source = source_functions(index, moments);
    let sun = vec2u(packed(source.sun.xy), packed(source.sun.zw));
    let sky = vec2u(packed(source.sky.xy), packed(source.sky.zw));
    textureStore(sources_out, cell_of(index), vec4u(sun, sky));
}

fn write_moments(index: u32, moments: Moments) {
    moments_now[2u * index] = moments.sun;
    moments_now[2u * index + 1u] = moments.sky;
    write_sources(index, moments);
}

// Moments to begin with: those of the coarser level, or of the level's own of before; none without either.
@compute @workgroup_size(64)
fn field_start(@builtin(global_invocation_id) id: vec3u) {
    if id.x < cell_count() {
        var moments = Moments(vec4f(0.0), vec4f(0.0));
        if level.coarser_rows > 0u {
            moments = coarser_moments(cell_of(id.x));
        }
        write_moments(id.x, moments);
    }
}

// Radiance that enters at a cell of the rim of the sides.
fn side_radiance(rim: u32) -> vec2f {
    if level.corrects > 0u {
        return vec2f(0.0);
    }
    return unpack2x16float(entering[rim]);
}

// Source functions of a cell in a direction.
fn source_toward(at: vec3i, direction: vec3f) -> vec2f {
    let halves = textureLoad(sources, at, 0);
    let sun = vec4f(unpack2x16float(halves.x), unpack2x16float(halves.y));
    let sky = vec4f(unpack2x16float(halves.z), unpack2x16float(halves.w));
    return vec2f(sun.x + dot(sun.yzw, direction), sky.x + dot(sky.yzw, direction));
}

// Radiance that leaves a cell, and the part of its mean along the path through it that is not of the cell's own source
// (`own_mean`). The source is linear along the path, with the slope between the neighbours; the mean follows from the
// balance of the cell, so that energy is conserved for any optical depth. No limiter on the slope: the solve is linear.
//
// The mean without its own part: in a thick cell nearly all of it is its own, and the rest would be lost in the
// rounding to half floats.
struct Crossing {
    leaving: vec2f,
    of_others: vec2f,
}

fn cross_cell(t: f32, entering: vec2f, source: vec2f, slope: vec2f) -> Crossing {
    let thin = t < 0.02;
    let e = exp(-t);
    let a = select((1.0 - e) / max(t, 1e-6), 1.0 - 0.5 * t + t * t / 6.0, thin);
    let q = select((0.5 * (1.0 + e) - a) / max(t, 1e-6), t / 12.0, thin);
    let absorbed = a * t; // 1 - exp(-t)
    return Crossing(
        entering * (1.0 - absorbed) + source * absorbed + slope * (q * t),
        entering * a - slope * q,
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
        radiances[first + cell_index(at)] = packed(crossing.of_others);
        radiance = crossing.leaving;
        if wraps {
            radiance = side_radiance(select(rim_y(d, next_at), rim_x(d, next_at), under.x || over.x));
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
        radiance = side_radiance(select(rim_y(d, at), rim_x(d, at), in_x));
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
            radiances[first + cell_index(at)] = packed(crossing.of_others);
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

// Scaled optical depth of a path of unit length through a cell, 1/m.
fn scaled_extinction(at: vec3i) -> f32 {
    return frame.sky.split.z * frame.sky.extinction * textureLoad(level_optics, at, 0).r;
}

// Part of its own light that a cell keeps no longer than a sweep, of fluence and flux: one minus the diagonal of a
// sweep. Relative to it a sweep changes thick cells as fast as thin ones.
fn left_share(index: u32) -> vec4f {
    let extinction = scaled_extinction(cell_of(index));
    let albedo = 4.0 * PI * frame.sky.split.w;
    var left = 0.0;
    var kept = vec3f(0.0);
    for (var d = 0u; d < DIRECTIONS; d += select(CORNERS, 2u, d > 0u)) {
        // Directions of one length: all corners, up and down, each tilted one with its opposite in the row.
        let directions = select(2.0, f32(CORNERS), is_corner(d));
        let leaves = one_minus_exp_over(extinction * lattice_length(d));
        let weight = directions * lattice_weight(d) / (4.0 * PI);
        let cosines = lattice_direction(d);
        left += weight * leaves;
        kept += weight * (1.0 - leaves) * cosines * cosines;
    }
    return vec4f(1.0 - albedo + albedo * left, 1.0 - 3.0 * albedo * frame.sky.turned_cosine * kept);
}

// What the moments of the last sweep differ by from those before it; of a correction, from what it has to correct.
fn residual_of(index: u32, left: vec4f) -> Moments {
    var of_others = Moments(vec4f(0.0), vec4f(0.0));
    for (var d = 0u; d < DIRECTIONS; d++) {
        let radiance = lattice_weight(d) * unpack2x16float(radiances[d * cell_count() + index]);
        let moment = vec4f(1.0, lattice_direction(d));
        of_others.sun += radiance.x * moment;
        of_others.sky += radiance.y * moment;
    }
    var given = Moments((1.0 - left) * beam_moments(index), vec4f(0.0));
    if level.corrects > 0u {
        given = Moments(residuals[2u * index], residuals[2u * index + 1u]);
    }
    return Moments(
        of_others.sun + given.sun - left * moments_now[2u * index],
        of_others.sky + given.sky - left * moments_now[2u * index + 1u],
    );
}

// Moments after a sweep.
@compute @workgroup_size(64)
fn field_gather(@builtin(global_invocation_id) id: vec3u) {
    if id.x < cell_count() {
        let left = left_share(id.x);
        let residual = residual_of(id.x, left);
        let sun = moments_now[2u * id.x] + residual.sun / left;
        let sky = moments_now[2u * id.x + 1u] + residual.sky / left;
        write_moments(id.x, Moments(sun, sky));
    }
}

// Cells of a grid that a cell of the coarser grid has along each axis: one or two.
fn cells_in_coarser() -> vec3u {
    return vec3u(round(1.0 / level.coarser_scale));
}

// Mean density of the cells of the coarser grid: an invocation for each.
@compute @workgroup_size(4, 4, 4)
fn field_coarsen(@builtin(global_invocation_id) id: vec3u) {
    if any(id >= coarser_size()) {
        return;
    }
    let each = cells_in_coarser();
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let within = vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let at = id * each + within;
        if all(within < each) && all(at < level_size()) {
            sum += textureLoad(level_optics, at, 0).r;
        }
    }
    textureStore(volume_out, id, vec4f(sum / f32(each.x * each.y * each.z), 0.0, 0.0, 0.0));
}

// Factor on all corrections, which are small: half floats below 6e-5 have fewer digits.
const CORRECTION_SCALE = 256.0;

// What the coarser grid has to correct: the mean residual of the cells, weighted by what they scatter.
@compute @workgroup_size(64)
fn field_restrict(@builtin(global_invocation_id) id: vec3u) {
    let size = coarser_size();
    if id.x >= size.x * size.y * size.z {
        return;
    }
    let each = cells_in_coarser();
    let coarse = vec3u(id.x % size.x, id.x / size.x % size.y, id.x / (size.x * size.y));
    var sun = vec4f(0.0);
    var sky = vec4f(0.0);
    var whole = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let within = vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let at = coarse * each + within;
        if all(within < each) && all(at < level_size()) {
            let index = cell_index(vec3i(at));
            let weight = scaled_extinction(vec3i(at)) + 1e-9;
            let residual = residual_of(index, left_share(index));
            sun += weight * residual.sun;
            sky += weight * residual.sky;
            whole += weight;
        }
    }
    let scale = select(CORRECTION_SCALE, 1.0, level.corrects > 0u) / whole;
    coarser_residuals[2u * id.x] = scale * sun;
    coarser_residuals[2u * id.x + 1u] = scale * sky;
}

// Correction to begin with: a sweep of no light.
@compute @workgroup_size(64)
fn field_begin_correction(@builtin(global_invocation_id) id: vec3u) {
    if id.x < cell_count() {
        let left = left_share(id.x);
        write_moments(id.x, Moments(residuals[2u * id.x] / left, residuals[2u * id.x + 1u] / left));
    }
}

// Adds the correction of the coarser grid.
@compute @workgroup_size(64)
fn field_correct(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= cell_count() {
        return;
    }
    let size = coarser_size();
    let corner = interpolation((vec3f(cell_of(id.x)) + 0.5) * level.coarser_scale, size);
    var sun = moments_now[2u * id.x];
    var sky = moments_now[2u * id.x + 1u];
    for (var i = 0u; i < 8u; i++) {
        let weight = corner_weight(corner, i) / select(CORRECTION_SCALE, 1.0, level.corrects > 0u);
        let index = corner_index(corner, i, size.xy);
        sun += weight * coarser_correction[2u * index];
        sky += weight * coarser_correction[2u * index + 1u];
    }
    write_moments(id.x, Moments(sun, sky));
}
