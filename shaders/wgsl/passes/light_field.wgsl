// Bakes the light field: on each level of nested cells the extinction, the optical depth toward the sun, and the light
// that clouds have scattered at least once out of the forward direction (passes/light_solver). Levels are solved from
// the coarsest to the finest; what enters a finer level at its sides is the radiance of the coarser one.
#import bindings
#import density
#import light_field
#import light_lattice

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

var<workgroup> partial: array<vec2f, 256>;

// Ratio of the light that the sun loses in the level, by its transmittance at the faces, to what the cells take from
// it.
@compute @workgroup_size(256)
fn field_balance(@builtin(local_invocation_id) id: vec3u) {
    let size = level_size();
    let count = size.x * size.y * size.z;
    let volume = level.cell.x * level.cell.y * level.cell.z;
    let scale = frame.sky.split.z;
    var sum = vec2f(0.0);
    let rounds = (count + 255u) / 256u;
    // The same number of iterations for all threads.
    for (var round = 0u; round < rounds; round++) {
        let i = round * 256u + id.x;
        let index = min(i, count - 1u);
        let deposit = deposits[index];
        let at = cell_of(index);
        let lost = lost_at(at, scale * textureLoad(level_optics, at, 0).g, deposit.x);
        sum += select(vec2f(0.0), vec2f(deposit.x * deposit.y * volume, lost), i < count);
    }
    partial[id.x] = sum;
    workgroupBarrier();
    if id.x == 0u {
        var whole = vec2f(0.0);
        for (var i = 0u; i < 256u; i++) {
            whole += partial[i];
        }
        balance[0] = clamp(whole.y / max(whole.x, 1e-20), 0.25, 4.0);
    }
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
        let path = length_through(d, level.cell / level.coarser_scale, d < STEEP || level.coarser_tilt_crosses > 0u);
        radiance = vec2f(0.0);
        for (var i = 0u; i < 8u; i++) {
            let index = corner_index(corner, i, there.xy);
            let other = mean_radiance(d, index, there.x * there.y * there.z, path * deposits[index].x);
            radiance += corner_weight(corner, i) * other;
        }
    }
    entering[d * rim_cells() + id.x] = packed(radiance);
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
                let index = corner_index(corner, i, size.xy);
                let depth = lattice_length(d) * deposits[index].x;
                radiance += corner_weight(corner, i) * mean_radiance(d, index, cell_count(), depth);
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
