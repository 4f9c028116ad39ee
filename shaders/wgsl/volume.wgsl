// User's grid: extinction at voxel centres, trilinearly interpolated, in an axis-aligned box.
#import bindings

fn in_volume(p: vec3f) -> bool {
    return all(p >= frame.sky.volume_low) && all(p <= frame.sky.volume_high);
}

// Position in voxels. Voxel centres are integers, and along a ray the value is a cubic between two integer planes.
fn volume_cell(p: vec3f) -> vec3f {
    return (p - frame.sky.volume_low) * frame.sky.volume_scale - 0.5;
}

// Density in the box, 1 at the largest extinction. Outside the box it is that of the nearest face.
fn volume_density(p: vec3f) -> f32 {
    if PRECISE {
        return volume_density_exact(volume_cell(p));
    }
    let uvw = (volume_cell(p) + 0.5) / vec3f(textureDimensions(volume));
    return textureSampleLevel(volume, clamp_sampler, uvw, 0.0).r;
}

// Trilinear interpolation with weights of 24 bits; hardware filters have as few as 8 (docs/numerics.md).
fn volume_density_exact(cell: vec3f) -> f32 {
    let last = vec3f(textureDimensions(volume_exact)) - 1.0;
    let at = clamp(cell, vec3f(0.0), last);
    let low = min(floor(at), max(last - 1.0, vec3f(0.0)));
    let f = at - low;
    let a = vec3i(low);
    let b = vec3i(min(low + 1.0, last));
    let x00 = mix(volume_texel(a.x, a.y, a.z), volume_texel(b.x, a.y, a.z), f.x);
    let x10 = mix(volume_texel(a.x, b.y, a.z), volume_texel(b.x, b.y, a.z), f.x);
    let x01 = mix(volume_texel(a.x, a.y, b.z), volume_texel(b.x, a.y, b.z), f.x);
    let x11 = mix(volume_texel(a.x, b.y, b.z), volume_texel(b.x, b.y, b.z), f.x);
    return mix(mix(x00, x10, f.y), mix(x01, x11, f.y), f.z);
}

fn volume_texel(x: i32, y: i32, z: i32) -> f32 {
    return textureLoad(volume_exact, vec3i(x, y, z), 0).r;
}

// Distance along a ray to the first plane through voxel centres beyond `t`. Between two of those planes the density is
// a cubic, for which two Gauss points are exact. Planes come from integers, so that errors do not accumulate
// (docs/numerics.md).
fn next_plane(origin: vec3f, direction: vec3f, t: f32) -> f32 {
    let start = volume_cell(origin);
    let speed = direction * frame.sky.volume_scale;
    var next = 1e30;
    for (var axis = 0; axis < 3; axis++) {
        let v = speed[axis];
        if abs(v) > 1e-20 {
            let at = start[axis] + t * v;
            let ahead = sign(v);
            // Next integer along the ray; if rounding has put it behind `t`, the one after.
            let plane = select(ceil(at) - 1.0, floor(at) + 1.0, v > 0.0);
            let hit = (plane - start[axis]) / v;
            next = min(next, select((plane + ahead - start[axis]) / v, hit, hit > t * (1.0 + 2e-7)));
        }
    }
    return next;
}
