// Which workgroup does which part of the work.
#import bindings

// The part of a workgroup by its number: those that follow each other are spread over all of them. Lavapipe gives each of
// its threads as many workgroups in a row, and waits for the slower (Mesa, lp_cs_tpool.c): without this one of two has
// the sky above and the other the clouds below. The march of `above` took 76 ms, and takes 59.
fn swizzle_workgroup(number: u32, count: u32) -> u32 {
    let length = max(count / dispatch.threads, 1u);
    let part = number % length * dispatch.threads + number / length;
    return select(number, part, number < length * dispatch.threads);
}

// The same for a picture of `groups`, in which they are numbered row by row.
fn spread_over(group: vec2u, groups: vec2u) -> vec2u {
    let part = swizzle_workgroup(group.y * groups.x + group.x, groups.x * groups.y);
    return vec2u(part % groups.x, part / groups.x);
}

// The same by rows, where neighbours read the same.
fn swizzle_rows(group: vec2u, groups: vec2u) -> vec2u {
    return vec2u(group.x, swizzle_workgroup(group.y, groups.y));
}
