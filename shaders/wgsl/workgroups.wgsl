// Swizzling of workgroup ids.
#import bindings

// Swizzled number of a workgroup: consecutive numbers are interleaved over the whole dispatch. llvmpipe gives each
// worker thread a contiguous run of workgroups and waits for the last thread (Mesa, lp_cs_tpool.c). Without
// interleaving one of two threads has the sky at the top and the other the clouds below. The march of `above` takes
// 59 ms instead of 76.
fn swizzle_workgroup(number: u32, count: u32) -> u32 {
    let length = max(count / dispatch.threads, 1u);
    let part = number % length * dispatch.threads + number / length;
    return select(number, part, number < length * dispatch.threads);
}

// Swizzled id in a 2D dispatch of `groups` workgroups, numbered row by row.
fn spread_over(group: vec2u, groups: vec2u) -> vec2u {
    let part = swizzle_workgroup(group.y * groups.x + group.x, groups.x * groups.y);
    return vec2u(part % groups.x, part / groups.x);
}

// Swizzled id that keeps rows together, for kernels whose neighbours along a row read the same data.
fn swizzle_rows(group: vec2u, groups: vec2u) -> vec2u {
    return vec2u(group.x, swizzle_workgroup(group.y, groups.y));
}
