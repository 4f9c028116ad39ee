// Arguments of indirect dispatches: workgroup counts for a list, or for a conditional grid.
#import bindings

// List in slices; each invocation writes one slice: workgroups along x, y and z, and the invocations of the whole list.
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

// Grid that is dispatched if the count is not 0.
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
