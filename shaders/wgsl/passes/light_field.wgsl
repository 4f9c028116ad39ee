// Bakes the light field: on each level of nested cells the extinction, the optical depth toward the sun, and the light
// that clouds have scattered at least once out of the forward direction. A level is swept along 14 directions of a
// lattice; each sweep conserves energy in every cell. Levels are solved from the coarsest to the finest; what enters a
// finer level at its sides is the radiance of the coarser one.
//
// Two fields share a sweep: x is the sun's, for an irradiance of 1; y is that of a uniform sky of radiance 1 over black
// ground.
#import bindings
#import density
#import light_field

// Directions: eight corners, up, down, and four along the rows. Quadrature weights in units of 4 pi: they integrate
// second moments, and the flux of isotropic light through a plane, exactly.
const DIRECTIONS = 14u;
const CORNERS = 8u;
const STEEP = 10u; // directions that cross rows
const AXIS_WEIGHT = 0.0528312;
const CORNER_WEIGHT = 0.0853766;

fn is_corner(d: u32) -> bool {
    return d < CORNERS;
}

// Steps of a direction from cell to cell.
fn lattice_step(d: u32) -> vec3i {
    if is_corner(d) {
        return vec3i(i32(d & 1u), i32((d >> 1u) & 1u), i32(d >> 2u)) * 2 - 1;
    }
    let sign = 1 - 2 * i32(d & 1u);
    if d < STEEP {
        return vec3i(0, 0, sign);
    }
    return select(vec3i(0, sign, 0), vec3i(sign, 0, 0), d < 12u);
}

// Unit vector of a direction: the same angles in cells of any shape.
fn lattice_direction(d: u32) -> vec3f {
    return vec3f(lattice_step(d)) * select(1.0, inverseSqrt(3.0), is_corner(d));
}

// Length of a direction's path through a cell, m.
fn lattice_length(d: u32) -> f32 {
    if is_corner(d) {
        return level.cell.z * sqrt(3.0);
    }
    return select(select(level.cell.y, level.cell.x, d < 12u), level.cell.z, d < STEEP);
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

// Mean density of a cell, from eight points.
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
        let aside = vec3f(vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u)) * 0.5 + 0.25;
        let q = level_place(vec3f(id) + aside);
        let width = 0.5 * level.cell.z;
        var density = 0.0;
        if VOLUME {
            density = cloud_density_at(q + frame.sky.volume_low, 0.0, width);
        } else {
            let column = column_on_chart(q.xy, q.z + frame.sky.shell_base);
            density = cloud_density(column, cloud_shape(column), width);
        }
        sum += density;
        most = max(most, density);
        i += 1u;
        if i >= 8u {
            break;
        }
    }
    textureStore(volume_out, id, vec4f(sum / 8.0, 0.0, most, 0.0));
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
    let cells = vec3f(size);
    let speed = level.sun / level.cell; // cells per metre
    let step = sun_step();
    let open = level.sides != SIDES_PERIODIC;
    var depth = 0.0;
    var i = 0u;
    var at = start;
    var outside = false;
    // Density beyond a side, of which nothing is known in an open level, is 0.
    loop {
        let t = (f32(i) + 0.5) * step;
        at = sun_place(start, speed, t);
        outside = at.z >= cells.z || at.z < 0.0 || (open && any(at.xy < vec2f(0.0)) || open && any(at.xy > cells.xy));
        depth += select(density_of_level(at), 0.0, outside);
        i += 1u;
        if outside || i >= level.sun_steps {
            break;
        }
    }
    depth *= frame.sky.extinction * step;
    if level.sides == SIDES_COARSER {
        let end = sun_place(start, speed, select(f32(i), f32(i) - 1.0, outside) * step);
        let coarser = coarser_cell(end);
        let size_there = vec3f(coarser_size());
        let uvw = level_texel(coarser, size_there);
        let beyond = textureSampleLevel(coarser_optics, clamp_sampler, uvw, 0.0).g;
        depth += select(beyond, 0.0, end.z >= cells.z || end.z < 0.0);
    }
    let texel = textureLoad(level_optics, id, 0);
    textureStore(volume_out, id, vec4f(texel.r, min(depth, MOST_DEPTH), texel.b, 0.0));
}

// Largest optical depth that half floats hold with a margin.
const MOST_DEPTH = 30000.0;

// Length of the sun's path through a cell, along the axis that it crosses fastest, m.
fn sun_step() -> f32 {
    let speed = abs(level.sun / level.cell);
    return 1.0 / max(max(speed.x, speed.y), speed.z);
}

// Point on the sun's ray, in cells. The ground falls away below it.
fn sun_place(start: vec3f, speed: vec3f, t: f32) -> vec3f {
    let rise = level.bend * (1.0 - level.sun.z * level.sun.z) * t * t / level.cell.z;
    return start + t * speed + vec3f(0.0, 0.0, rise);
}

// Scaled extinction of each cell, and the scaled sunlight in it: the mean over the cell's path.
@compute @workgroup_size(64)
fn field_beam(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if id.x >= size.x * size.y * size.z {
        return;
    }
    let at = vec3u(id.x % size.x, id.x / size.x % size.y, id.x / (size.x * size.y));
    let optics = textureLoad(level_optics, at, 0);
    let scale = frame.sky.split.z;
    let extinction = scale * frame.sky.extinction * optics.r;
    let t = min(extinction * sun_step(), 80.0);
    // exp(-depth) sinh(t / 2) / (t / 2), without overflow.
    let beam = min(exp(min(0.5 * t - scale * optics.g, 0.0)) * one_minus_exp_over(t), 1.0);
    deposits[id.x] = vec2f(extinction, select(0.0, beam, level.sunlit > 0u));
}

// Ratio of the light that the sun loses in the level, by its transmittance at the faces, to what the cells take from it.
var<workgroup> partial: array<vec2f, 256>;

@compute @workgroup_size(256)
fn field_balance(@builtin(local_invocation_id) id: vec3u) {
    let size = level_size();
    let count = size.x * size.y * size.z;
    let volume = level.cell.x * level.cell.y * level.cell.z;
    let area = vec3f(level.cell.y * level.cell.z, level.cell.x * level.cell.z, level.cell.x * level.cell.y);
    let scale = frame.sky.split.z;
    var taken = 0.0;
    var lost = 0.0;
    for (var i = id.x; i < count; i += 256u) {
        let deposit = deposits[i];
        taken += deposit.x * deposit.y * volume;
        let at = vec3u(i % size.x, i / size.x % size.y, i / (size.x * size.y));
        for (var axis = 0u; axis < 3u; axis++) {
            if axis < 2u && level.sides == SIDES_PERIODIC {
                continue;
            }
            let last = at[axis] + 1u == size[axis];
            if at[axis] == 0u || last {
                // Of the sun's light through this face the clouds beyond have taken a part.
                let into = select(-1.0, 1.0, last) * level.sun[axis];
                let half_way = 0.5 * deposit.x * level.cell[axis] / max(abs(level.sun[axis]), 1e-3);
                let optics = textureLoad(level_optics, at, 0);
                let depth = max(scale * optics.g + select(half_way, -half_way, into > 0.0), 0.0);
                lost -= into * (1.0 - exp(-depth)) * area[axis];
            }
        }
    }
    partial[id.x] = vec2f(taken, lost);
    workgroupBarrier();
    if id.x == 0u {
        var sum = vec2f(0.0);
        for (var i = 0u; i < 256u; i++) {
            sum += partial[i];
        }
        balance[0] = vec4f(clamp(sum.y / max(sum.x, 1e-20), 0.5, 2.0), sum, 0.0);
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
    let turn = 3.0 * frame.sky.turned_cosine;
    let beam = deposits[index].y * balance[0].x;
    let sun = moments.sun + vec4f(beam, -beam * level.sun);
    sources[2u * index] = c * sun * vec4f(1.0, vec3f(turn));
    sources[2u * index + 1u] = c * moments.sky * vec4f(1.0, vec3f(turn));
}

// Moments to begin with: those of the coarser level, or none.
@compute @workgroup_size(64)
fn field_start(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if id.x >= size.x * size.y * size.z {
        return;
    }
    var moments = Moments(vec4f(0.0), vec4f(0.0));
    if level.coarser_rows > 0u {
        let at = vec3f(vec3u(id.x % size.x, id.x / size.x % size.y, id.x / (size.x * size.y))) + 0.5;
        let there = coarser_size();
        let corner = interpolation(coarser_cell(at), there);
        for (var i = 0u; i < 8u; i++) {
            let weight = corner_weight(corner, i);
            let index = corner_index(corner, i, there.xy);
            moments.sun += weight * coarser_moments[2u * index];
            moments.sky += weight * coarser_moments[2u * index + 1u];
        }
    }
    moments_now[2u * id.x] = moments.sun;
    moments_now[2u * id.x + 1u] = moments.sky;
    moments_before[2u * id.x] = moments.sun;
    moments_before[2u * id.x + 1u] = moments.sky;
    write_sources(id.x, moments);
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
    let up = lattice_step(d).z;
    return vec2f(0.0, select(select(0.0, 1.0, up < 0), HORIZON, up == 0));
}

// Radiance of the sky's field along a row without clouds: the horizon, half sky and half ground.
const HORIZON = 0.5;

// Radiance that enters at the sides: of the coarser level, half a path through a cell before its middle.
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
            radiance += corner_weight(corner, i) * coarser_radiances[d * cells + corner_index(corner, i, there.xy)];
        }
    }
    entering[d * rim_cells() + id.x] = radiance;
}

// Source functions of a cell in a direction.
fn source_toward(index: u32, direction: vec3f) -> vec2f {
    let sun = sources[2u * index];
    let sky = sources[2u * index + 1u];
    return vec2f(sun.x + dot(sun.yzw, direction), sky.x + dot(sky.yzw, direction));
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

// Cells by which a line that crosses rows has moved after `row` rows: a staircase along the direction.
fn staircase(row: i32, d: u32) -> vec2i {
    let shift = select(0.0, level.cell.z, is_corner(d)) / level.cell.xy;
    return vec2i(floor(shift * f32(row) + 0.5));
}

// Sweeps the directions that cross rows: a thread follows a line from row to row. Every cell lies on one line.
@compute @workgroup_size(32, 2, 1)
fn field_sweep_down(@builtin(global_invocation_id) id: vec3u) {
    let size = vec3i(level_size());
    if any(vec3i(id) >= vec3i(size.xy, i32(STEEP))) {
        return;
    }
    let d = id.z;
    let step = lattice_step(d);
    let direction = lattice_direction(d);
    let length = lattice_length(d);
    let cells = u32(size.x * size.y * size.z);
    let open = level.sides != SIDES_PERIODIC;
    var radiance = open_radiance(d);
    var at = vec3i(vec2i(id.xy), select(size.z - 1, 0, step.z > 0));
    var side = vec2i(0); // sides crossed so far
    var index = cell_index(at);
    var before = vec2f(0.0);
    var here = source_toward(index, direction);
    var has_before = false;
    var m = 0;
    loop {
        let raw = vec2i(id.xy) + step.xy * staircase(m + 1, d);
        let next_side = vec2i(floor(vec2f(raw) / vec2f(size.xy)));
        let wraps = open && any(next_side != side);
        let last = m + 1 >= size.z;
        let next_at = vec3i(raw - next_side * size.xy, select(at.z + step.z, at.z, last));
        let next_index = cell_index(next_at);
        let next = source_toward(next_index, direction);
        let slope = source_slope(before, here, next, has_before, !(last || wraps));
        let crossing = cross_cell(deposits[index].x * length, radiance, here, slope);
        radiances[d * cells + index] = crossing.mean;
        radiance = crossing.leaving;
        if open {
            let from_side = entering[select(rim_y(d, next_at), rim_x(d, next_at), next_side.x != side.x)];
            radiance = select(radiance, from_side, wraps);
        }
        before = here;
        has_before = !wraps;
        here = next;
        at = next_at;
        index = next_index;
        side = next_side;
        m += 1;
        if m >= size.z {
            break;
        }
    }
}

// Sweeps the directions along rows: a thread follows a row. In a periodic level it does so twice, as what enters is what
// leaves.
@compute @workgroup_size(32, 2, 1)
fn field_sweep_along(@builtin(global_invocation_id) id: vec3u) {
    let size = vec3i(level_size());
    let d = STEEP + id.z;
    let step = lattice_step(d);
    let in_x = step.x != 0;
    if id.z >= 4u || i32(id.x) >= select(size.x, size.y, in_x) || i32(id.y) >= size.z {
        return;
    }
    let count = select(size.y, size.x, in_x);
    let direction = lattice_direction(d);
    let length = lattice_length(d);
    let cells = u32(size.x * size.y * size.z);
    let periodic = level.sides == SIDES_PERIODIC;
    let forward = step.x + step.y > 0;
    let begin = select(count - 1, 0, forward);
    let start = select(vec3i(i32(id.x), begin, i32(id.y)), vec3i(begin, i32(id.x), i32(id.y)), in_x);
    let end = start + step * (count - 1);
    var radiance = vec2f(0.0);
    if !periodic {
        radiance = entering[select(rim_y(d, start), rim_x(d, start), in_x)];
    }
    var before = source_toward(cell_index(end), direction);
    var here = source_toward(cell_index(start), direction);
    var depth = 0.0;
    var m = 0;
    let turns = select(count, 2 * count, periodic);
    loop {
        let i = m % count;
        let at = start + step * i;
        let index = cell_index(at);
        let next = source_toward(cell_index(select(at + step, start, i + 1 == count)), direction);
        let slope = source_slope(before, here, next, periodic || i > 0, periodic || i + 1 < count);
        let t = deposits[index].x * length;
        let crossing = cross_cell(t, radiance, here, slope);
        radiances[d * cells + index] = crossing.mean;
        radiance = crossing.leaving;
        depth += t;
        if periodic && m + 1 == count {
            // The sum over all rounds. A row without clouds has the light of the horizon.
            radiance = select(vec2f(0.0, HORIZON), radiance / max(1.0 - exp(-depth), 1e-6), depth > 1e-4);
        }
        before = here;
        here = next;
        m += 1;
        if m >= turns {
            break;
        }
    }
}

// Moments of a sweep, and the step of Chebyshev's iteration with them.
@compute @workgroup_size(64)
fn field_gather(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    let cells = size.x * size.y * size.z;
    if id.x >= cells {
        return;
    }
    var swept = Moments(vec4f(0.0), vec4f(0.0));
    for (var d = 0u; d < DIRECTIONS; d++) {
        let weight = 4.0 * PI * select(AXIS_WEIGHT, CORNER_WEIGHT, is_corner(d));
        let radiance = weight * radiances[d * cells + id.x];
        let moment = vec4f(1.0, lattice_direction(d));
        swept.sun += radiance.x * moment;
        swept.sky += radiance.y * moment;
    }
    let now = Moments(moments_now[2u * id.x], moments_now[2u * id.x + 1u]);
    let before = Moments(moments_before[2u * id.x], moments_before[2u * id.x + 1u]);
    let next = Moments(
        before.sun + level.weight * (now.sun + level.relaxation * (swept.sun - now.sun) - before.sun),
        before.sky + level.weight * (now.sky + level.relaxation * (swept.sky - now.sky) - before.sky),
    );
    // The buffers of both exchange their roles after this.
    moments_before[2u * id.x] = next.sun;
    moments_before[2u * id.x + 1u] = next.sky;
    write_sources(id.x, next);
}

// Stores a level in the textures of all levels. Toward its rim a level blends into the coarser one, so that reads need no
// second level.
@compute @workgroup_size(4, 4, 4)
fn field_store(@builtin(global_invocation_id) id: vec3u) {
    let size = level_size();
    if any(id >= size) {
        return;
    }
    let index = cell_index(vec3i(id));
    var optics = textureLoad(level_optics, id, 0);
    var moments = Moments(moments_now[2u * index], moments_now[2u * index + 1u]);
    if level.sides == SIDES_COARSER {
        let at = vec3f(id) + 0.5;
        let there = coarser_size();
        let corner = interpolation(coarser_cell(at), there);
        let middle = 0.5 * vec2f(size.xy);
        let away = abs(at.xy - middle) / middle;
        let share = smoothstep(BLEND, 1.0, max(away.x, away.y));
        moments.sun *= 1.0 - share;
        moments.sky *= 1.0 - share;
        for (var i = 0u; i < 8u; i++) {
            let weight = share * corner_weight(corner, i);
            let other = corner_index(corner, i, there.xy);
            moments.sun += weight * coarser_moments[2u * other];
            moments.sky += weight * coarser_moments[2u * other + 1u];
        }
        let beyond = textureSampleLevel(coarser_optics, clamp_sampler, level_texel(coarser_cell(at), vec3f(there)), 0.0);
        optics = mix(optics, beyond, share);
    }
    let out = vec3u(id.xy, level.first_row + id.z);
    textureStore(volume_out, out, optics);
    textureStore(sun_out, out, moments.sun);
    textureStore(sky_out, out, moments.sky);
}

// Fraction of a level's half width from which on it blends into the coarser level.
const BLEND = 0.8;
