"""Clouds on grids, always the same ones: what tests/references/make.py has computed elsewhere is
computed here again.

Plain NumPy: neither nubis nor any of the programs that it is compared with.
"""

import numpy as np


def centres(shape):
    """Coordinates x, y, z of voxel centres, 0 to 1 across the box, in arrays of (nz, ny, nx)."""
    z, y, x = np.meshgrid(*((np.arange(n) + 0.5) / n for n in shape), indexing="ij")
    return x, y, z


def waves(shape, seed, low, high, count=40):
    """Cosine waves of random directions, `low` to `high` of them across the box: mean 0,
    variance 1.
    """
    rng = np.random.default_rng(seed)
    x, y, z = centres(shape)
    total = np.zeros(shape)
    for _ in range(count):
        direction = rng.uniform(-1, 1, 3)
        k = direction / np.linalg.norm(direction) * rng.uniform(low, high)
        phase = rng.uniform(0, 1)
        total += np.cos(2 * np.pi * (k[0] * x + k[1] * y + k[2] * z + phase))
    return total * np.sqrt(2 / count)


def empty_border(field):
    for axis in range(3):
        for end in (0, -1):
            field[(slice(None),) * axis + (end,)] = 0
    return field


def blob():
    """Lumpy, with soft edges, in the middle of its box."""
    shape = 32, 32, 32
    x, y, z = centres(shape)
    radius = np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2)
    field = 4.0 * (0.36 - radius) + 0.2 * waves(shape, 1, 1, 4)
    field = empty_border(np.clip(field, 0, 1))
    return 0.02 * field, ((-1000.0, 1500.0, 700.0), (1000.0, 3500.0, 2700.0))


def cumulus():
    """A flat base and turrets with billowed edges; voxels of 60 x 75 x 90 m."""
    shape = 20, 28, 36
    x, y, z = centres(shape)
    turrets = [
        (0.50, 0.50, 0.38, 0.30),
        (0.30, 0.42, 0.34, 0.21),
        (0.70, 0.58, 0.34, 0.20),
        (0.46, 0.58, 0.60, 0.20),
        (0.60, 0.40, 0.56, 0.16),
    ]
    inside = np.full(shape, -1.0)
    for cx, cy, cz, r in turrets:
        away = np.sqrt((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2)
        inside = np.maximum(inside, r - away)
    inside -= 0.05 * np.abs(waves(shape, 2, 3, 7))
    inside = np.minimum(inside, 1.5 * (z - 0.15))
    field = np.clip(inside / 0.06, 0, 1) * (0.5 + 0.5 * z)
    return 0.03 * empty_border(field), ((-1080.0, 1000.0, 900.0), (1080.0, 3100.0, 2700.0))


def layer():
    """Thin and ragged; it touches every face of its box, where it ends at once."""
    shape = 8, 40, 44
    field = np.clip(0.6 + 0.6 * waves(shape, 3, 2, 6), 0, None)
    return 0.008 * field, ((-3000.0, -500.0, 1000.0), (3000.0, 4500.0, 1320.0))


def wisps():
    """Nearly empty: twelve voxels out of 13 824, one of them at a corner of the box."""
    field = np.zeros((24, 24, 24))
    for i, (k, j, n) in enumerate(np.random.default_rng(4).integers(4, 20, (11, 3))):
        field[k, j, n] = 1 + i % 3
    field[0, 0, 0] = 4.0
    return 0.02 * field, ((-1200.0, 1000.0, 600.0), (1200.0, 3400.0, 2400.0))


def dense():
    """From nothing to an optical depth of several a voxel in one step."""
    shape = 30, 24, 27
    x, y, z = centres(shape)
    radius = np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + ((z - 0.5) / 1.1) ** 2)
    field = np.where(radius + 0.05 * waves(shape, 5, 2, 5) < 0.36, 1.0, 0.0)
    return 0.06 * empty_border(field), ((-700.0, 1200.0, 500.0), (700.0, 2500.0, 2000.0))


def rough():
    """White noise, a few large voxels of 150 x 400 x 120 m, full to every face."""
    field = np.random.default_rng(6).random((6, 3, 8)) ** 3
    return 0.015 * field, ((-600.0, 1000.0, 400.0), (600.0, 2200.0, 1120.0))


ALL = {f.__name__: f for f in (blob, cumulus, layer, wisps, dense, rough)}


def make(name, scale=1.0):
    """(extinction, bounds): float32 (nz, ny, nx) in 1/m, and two corners in metres."""
    field, bounds = ALL[name]()
    return (scale * field).astype(np.float32), bounds


def lookup(extinction, bounds, points):
    """Extinction at points (..., 3): trilinear between voxel centres, edge values held to the
    faces, 0 outside.
    """
    low, high = np.array(bounds)
    shape = np.array(extinction.shape[::-1])
    u = (points - low) / (high - low)
    inside = ((u >= 0) & (u <= 1)).all(axis=-1)
    q = np.clip(u * shape - 0.5, 0, shape - 1)
    first = np.floor(q).astype(int)
    second = np.minimum(first + 1, shape - 1)
    part = q - first
    total = np.zeros(points.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        index = np.where(corner, second, first)
        weight = np.where(corner, part, 1 - part).prod(axis=-1)
        total += weight * extinction[index[..., 2], index[..., 1], index[..., 0]]
    return np.where(inside, total, 0.0)


def span(bounds, starts, directions):
    """(near, far) distances of each ray inside the box, near = far for a miss."""
    low, high = np.array(bounds)
    with np.errstate(divide="ignore"):
        a, b = (low - starts) / directions, (high - starts) / directions
    near = np.minimum(a, b).max(axis=-1).clip(0)
    return near, np.maximum(np.maximum(a, b).min(axis=-1), near)


def march(extinction, bounds, starts, directions, steps):
    """Optical depth of each of `steps` equal steps between the faces of the box, by the midpoint
    rule, and the midpoints.
    """
    extinction = extinction.astype(np.float64)
    near, far = span(bounds, starts, directions)
    length = (far - near) / steps
    t = near[..., None] + (np.arange(steps) + 0.5) * length[..., None]
    points = starts[..., None, :] + t[..., None] * directions[..., None, :]
    return lookup(extinction, bounds, points) * length[..., None], points


def transmittance(extinction, bounds, eye, directions, steps):
    starts = np.broadcast_to(np.array(eye, dtype=float), directions.shape)
    return np.exp(-march(extinction, bounds, starts, directions, steps)[0].sum(axis=-1))


def single_scattering(extinction, bounds, eye, directions, sun, steps):
    """The integral of extinction T_sun T dt, without albedo, phase function and irradiance."""
    starts = np.broadcast_to(np.array(eye, dtype=float), directions.shape)
    depth, points = march(extinction, bounds, starts, directions, steps)
    lit = depth > 0
    to_sun = np.broadcast_to(sun, points[lit].shape)
    shade = np.zeros(depth.shape)
    shade[lit] = np.exp(-march(extinction, bounds, points[lit], to_sun, steps)[0].sum(axis=-1))
    before = np.cumsum(depth, axis=-1) - depth
    return (np.exp(-before) * -np.expm1(-depth) * shade).sum(axis=-1)
