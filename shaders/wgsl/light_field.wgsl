// Light field: nested levels of cells around the eye, each twice as wide as the one before, over the height range of
// the clouds; or one level over the box of the user's grid. Baked by passes/light_field.
#import bindings
#import math
#import chart

// Place of a point given in cells of the level, m: horizontal on the chart, from the middle of the field, and height
// above its base. In the user's grid: from the lowest corner of the field, a cell beyond that of the grid.
fn level_place(cell: vec3f) -> vec3f {
    let corner = select(0.5 * vec2f(f32(level.across), f32(level.along)), vec2f(0.0), VOLUME);
    return vec3f(cell.xy - corner, cell.z) * level.cell;
}

// Point of a level in cells of the coarser one.
fn coarser_cell(cell: vec3f) -> vec3f {
    let middle = 0.5 * vec2f(f32(level.across), f32(level.along));
    let middle_there = 0.5 * vec2f(f32(level.coarser_across), f32(level.coarser_along));
    let across = (cell.xy - middle) * level.coarser_scale.xy + middle_there + level.coarser_offset;
    return vec3f(across, cell.z * level.coarser_scale.z);
}

// Place of a point `p`, relative to the eye, in the field (`level_place`).
fn field_place(p: vec3f, altitude: f32) -> vec3f {
    if VOLUME {
        return p - frame.sky.volume_low + frame.sky.field_cell;
    }
    return vec3f(on_chart(p, altitude) + frame.sky.field_levels[0].xy, altitude - frame.sky.field_base);
}

// Components of a direction at a point along the axes of the field; `mu` is its zenith cosine there.
fn field_direction(direction: vec3f, mu: f32) -> vec3f {
    if VOLUME {
        return direction;
    }
    return vec3f(dot(direction, frame.sky.field_east), dot(direction, frame.sky.field_north), mu);
}

// Finest level that contains a place.
fn field_level(q: vec3f) -> f32 {
    if VOLUME {
        return 0.0;
    }
    let reach = (0.5 * frame.sky.field_size.x - 0.5) * frame.sky.field_cell.x;
    let away = max(abs(q.x), abs(q.y)) / reach;
    return clamp(ceil(log2(max(away, 1e-6))), 0.0, frame.sky.field_size.w - 1.0);
}

// Texture coordinates of a place in a level.
fn field_texel(q: vec3f, which: f32) -> vec3f {
    let size = frame.sky.field_size.xyz;
    let of_level = frame.sky.field_levels[u32(which)];
    let rows = of_level.w;
    let height = frame.sky.field_cell.z * size.z;
    let lag = of_level.xy - frame.sky.field_levels[0].xy;
    var cell = vec3f((q.xy + lag) / (frame.sky.field_cell.xy * exp2(which)), q.z / height * rows);
    if !VOLUME {
        // Beyond the outermost level the field repeats.
        cell = vec3f(fract(cell.xy / size.xy + 0.5) * size.xy, cell.z);
    }
    cell = clamp(cell, vec3f(0.5), vec3f(size.xy, rows) - 0.5);
    return (cell + vec3f(0.0, 0.0, of_level.z)) / vec3f(textureDimensions(field_sun));
}

// Optical depth toward the sun at a place.
fn field_sun_depth(q: vec3f) -> f32 {
    let uvw = field_texel(q, field_level(q));
    return textureSampleLevel(field_optics, clamp_sampler, uvw, 0.0).g;
}

// Radiance of forward chains (crates/clouds_core/src/scattering.rs). Loaded in f32: near the forward direction of
// narrow peaks it exceeds half floats.
fn forward_chains(depth: f32, one_minus_mu: f32) -> f32 {
    let last = vec2f(textureDimensions(forward_table)) - 1.0;
    let angle = 2.0 * atan2(sqrt(one_minus_mu), sqrt(max(2.0 - one_minus_mu, 0.0)));
    let at = sqrt(saturate(vec2f(angle / PI, depth / FORWARD_DEPTH))) * last;
    let low = min(floor(at), last - 1.0);
    let f = at - low;
    let i = vec2u(low);
    let a = mix(forward_entry(i), forward_entry(i + vec2u(1u, 0u)), f.x);
    let b = mix(forward_entry(i + vec2u(0u, 1u)), forward_entry(i + vec2u(1u, 1u)), f.x);
    return mix(a, b, f.y);
}

fn forward_entry(i: vec2u) -> f32 {
    return textureLoad(forward_table, i, 0).r;
}

// Light on the ground at a place (`field_ground`). It is read where cells are as wide as the clouds' base is high: the
// directions of the lattice would print copies of narrower gaps.
fn field_ground_at(q: vec2f) -> vec4f {
    // A sky without marched clouds has no field.
    if frame.sky.field_size.w < 1.0 {
        return vec4f(0.0, 1.0, 1.0, 1.0);
    }
    let across = frame.sky.field_size.x;
    let wide = ceil(log2(max(frame.sky.field_base / frame.sky.field_cell.x, 1.0)));
    let which = min(max(field_level(vec3f(q, 0.0)), wide), frame.sky.field_size.w - 1.0);
    let lag = frame.sky.field_levels[u32(which)].xy - frame.sky.field_levels[0].xy;
    let cell = fract((q + lag) / (frame.sky.field_cell.xy * exp2(which) * across) + 0.5) * across;
    let at = vec2f(cell.x, clamp(cell.y, 0.5, across - 0.5) + which * across);
    return textureSampleLevel(field_ground, repeat_sampler, at / vec2f(across, across * frame.sky.field_size.w), 0.0);
}
