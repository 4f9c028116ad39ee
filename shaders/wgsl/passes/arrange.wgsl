// Arguments of indirect dispatches: how many workgroups a list needs, or whether a grid is wanted.
#import bindings

// Of a list in slices: an invocation for each. Workgroups along x, y, z, and how many invocations the whole list has.
@compute @workgroup_size(64)
fn arrange_list(@builtin(global_invocation_id) id: vec3u) {
    let slices = arrangement.x;
    let most = arrangement.y;
    if id.x >= slices {
        return;
    }
    let invocations = list_count * arrangement.z;
    let left = invocations - min(invocations, id.x * most);
    let groups = (min(left, most) + LIST_GROUP - 1u) / LIST_GROUP;
    put_arguments(id.x, vec4u(groups, 1u, 1u, invocations));
}

// Of a grid that is dispatched if a number is not 0.
@compute @workgroup_size(1)
fn arrange_grid() {
    let wanted = select(0u, 1u, list_count != 0u);
    put_arguments(0u, vec4u(wanted * arrangement.xy, wanted, 0u));
}

fn put_arguments(slice: u32, values: vec4u) {
    for (var i = 0u; i < 4u; i++) {
        arguments[ARGUMENT_STRIDE / 4u * slice + i] = values[i];
    }
}
