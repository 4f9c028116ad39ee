"""Float64 reference implementation of passes/light_solver.wgsl: one level of cells, swept along its
lattice of directions, in plain loops over cells.
"""

import numpy as np

TILT = 0.12


def quadrature():
    """Directions and weights, sum 4 pi: exact second moments and half-sphere flux."""
    r = np.sqrt(3.0)
    tilted = (0.25 - 0.5 / r) / ((2 - 6 * TILT**2) - 6 / r * (1 - TILT**2) + 4 * TILT)
    axis = tilted * (2 - 6 * TILT**2)
    corner = 0.125 - 1.5 * tilted * (1 - TILT**2)
    level = np.sqrt(1 - TILT**2)
    signs = (-1, 1)
    found = [((x / r, y / r, z / r), corner) for x in signs for y in signs for z in signs]
    found += [((0, 0, z), axis) for z in signs]
    found += [((x * level, 0, z * TILT), tilted) for x in signs for z in signs]
    found += [((0, y * level, z * TILT), tilted) for y in signs for z in signs]
    directions, weights = zip(*found, strict=True)
    return np.array(directions, float), 4 * np.pi * np.array(weights)


def split(g, albedo):
    """Forward fraction, scale of the extinction, scaled albedo, mean cosine of what turns."""
    forward = g**2
    scale = 1 - albedo * forward
    return forward, scale, albedo * (1 - forward) / scale, (g - forward) / (1 - forward)


def crossing(t, entering, source, slope):
    """Radiance that leaves a cell, and its mean along the path."""
    e = np.exp(-t)
    a = (1 - e) / t if t > 1e-9 else 1 - t / 2
    q = (0.5 * (1 + e) - a) / t if t > 1e-4 else t / 12
    return (
        entering * e + source * (1 - e) + slope * q * t,
        entering * a + source * (1 - a) - slope * q,
    )


def lines(shape, cell, direction, periodic):
    """Cells of each line of a direction, in order, as segments between its resets: where it has
    left at the top, at the base or, wrapped, at a side. Yields (cells, wrapped before each).
    """
    nz, ny, nx = shape
    d = np.asarray(direction)
    step = np.sign(d).astype(int)
    steep = abs(d[2]) > 0.5 or TILT / np.sqrt(1 - TILT**2) * min(cell[:2]) > cell[2]
    if steep:
        shift = abs(d[:2]) / abs(d[2]) * cell[2] / np.asarray(cell[:2])
        first = 1 if step[2] > 0 else 21 - nz  # rows since that where staircases begin
        for j in range(ny):
            for i in range(nx):
                cells = []
                for m in range(nz):
                    moved = np.floor(shift * (first + m) + 0.5).astype(int)
                    moved -= np.floor(shift * first + 0.5).astype(int)
                    x, y = i + step[0] * moved[0], j + step[1] * moved[1]
                    z = m if step[2] > 0 else nz - 1 - m
                    cells.append((z, y % ny, x % nx, (x // nx, y // ny), 0))
                yield cells
        return
    axis = 0 if step[0] else 1
    count = (nx, ny)[axis]
    rise = TILT / np.sqrt(1 - TILT**2) * cell[axis] / cell[2]
    if periodic:
        rise = max(round(rise * count), 1) / count
    for row in range(nz):
        for other in range((ny, nx)[axis]):
            cells = []
            # Around the level until it has left at the top or at the base.
            rounds = int(np.ceil(nz / (rise * count))) + 1 if periodic else 1
            for m in range((1 - rounds) * count, count):
                z = row + step[2] * int(np.floor(rise * m + 0.5))
                place = m % count if step[axis] > 0 else count - 1 - m % count
                y, x = (other, place) if axis == 0 else (place, other)
                cells.append((z % nz, y, x, m // count, z // nz, m >= 0))
            yield cells


def sweep(extinction, cell, sources, sky, periodic):
    """Fluence and flux (4, nz, ny, nx) of one sweep. `sources` (4, nz, ny, nx): S(d) = S0 + S . d;
    `sky` is the radiance that enters from above.
    """
    directions, weights = quadrature()
    moments = np.zeros((4, *extinction.shape))
    for d, weight in zip(directions, weights, strict=True):
        steep = abs(d[2]) > 0.5 or TILT / np.sqrt(1 - TILT**2) * min(cell[:2]) > cell[2]
        length = cell[2] / abs(d[2]) if steep else max(abs(d[:2])) ** -1 * cell[int(d[1] != 0)]
        field = sources[0] + np.tensordot(d, sources[1:], 1)
        outside = sky if d[2] < 0 else 0.0
        for cells in lines(extinction.shape, cell, d, periodic):
            radiance = outside
            for n, (z, y, x, side, turn, *write) in enumerate(cells):
                joined = []
                for other in (n - 1, n + 1):
                    near = cells[other] if 0 <= other < len(cells) else None
                    same = near is not None and near[4] == turn and (periodic or near[3] == side)
                    joined.append(field[near[:3]] if same else None)
                if n and joined[0] is None:
                    radiance = outside
                before, after = joined
                here = field[z, y, x]
                if before is not None and after is not None:
                    slope = 0.5 * (after - before)
                elif before is not None:
                    slope = here - before
                else:
                    slope = after - here if after is not None else 0.0
                radiance, mean = crossing(extinction[z, y, x] * length, radiance, here, slope)
                if not write or write[0]:
                    moments[:, z, y, x] += weight * mean * np.array([1, *d])
    return moments


def solve(extinction, cell, sun, g, albedo, beam, *, periodic, sweeps):
    """Fluence and flux of the sun's light and of the sky's by plain sweeps, for the true extinction
    and a given scaled sunlight `beam`.
    """
    _, scale, scaled_albedo, turned = split(g, albedo)
    factor = scaled_albedo / (4 * np.pi)
    sun = np.asarray(sun, float)
    result = []
    for sky, light in ((0.0, beam), (1.0, 0.0 * beam)):
        moments = np.zeros((4, *extinction.shape))
        for _ in range(sweeps):
            flux = moments[1:] - sun[:, None, None, None] * light
            sources = factor * np.concatenate([(moments[0] + light)[None], 3 * turned * flux])
            moments = sweep(scale * extinction, cell, sources, sky, periodic)
        result.append(moments)
    return result
