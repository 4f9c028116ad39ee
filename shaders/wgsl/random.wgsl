// Random numbers on lattices. Inputs are integers, so that nothing repeats or thins out at large coordinates
// (docs/numerics.md).

// pcg3d: three 32-bit hashes of three integers (Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020).
fn pcg3d(input: vec3u) -> vec3u {
    var v = input * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3u(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// Three random numbers in [0, 1) for a lattice cell; `salt` distinguishes lattices and seeds.
fn random3(cell: vec3u, salt: u32) -> vec3f {
    let hash = pcg3d(cell + vec3u(salt * 747796405u, salt * 2891336453u, salt * 277803737u));
    return vec3f(hash >> vec3u(8u)) / 16777216.0;
}

// Lattice cell wrapped by its period, for cells at most one period outside. Comparison replaces integer division, which
// has no vector instruction: a bake hashes hundreds of cells per texel.
fn wrap_cell(cell: vec3i, period: vec3i) -> vec3u {
    let up = select(cell, cell + period, cell < vec3i(0));
    return vec3u(select(up, up - period, up >= period));
}
