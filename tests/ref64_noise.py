"""The noises, the textures baked from them, and the cloud field that reads the textures: float64
and whole numbers, from the published formulas.

Textures are functions from texels to values, so that only the texels that a test reads are
computed. Parameters are rounded to float32 first, as the renderer keeps them.
"""

import itertools
import math

import numpy as np

import ref64

FBM = np.array([0.625, 0.25, 0.125])
SHAPE_SIZE, DETAIL_SIZE, CURL_SIZE, WEATHER_SIZE, BROAD_SIZE = 128, 32, 128, 512, 128
FINER_SIZE = 5 * DETAIL_SIZE  # of the detail with the finer one


def f32(values):
    """Values as the shader gets them, in float64."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def half(values):
    """Values as a texture keeps them, in float64."""
    return np.asarray(values, dtype=np.float16).astype(np.float64)


def pcg3d(v):
    """Jarzynski and Olano 2020, listing of pcg3d; shape (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(v).astype(np.uint32), -1, 0) * np.uint32(1664525) + np.uint32(
        1013904223
    )
    for mixed in range(2):
        if mixed:
            x, y, z = (c ^ (c >> np.uint32(16)) for c in (x, y, z))
        x = x + y * z
        y = y + z * x
        z = z + x * y
    return np.stack([x, y, z], axis=-1)


def random3(cells, salt):
    """The upper 24 bits of three hashes, as fractions of 1."""
    multipliers = np.array([747796405, 2891336453, 277803737], dtype=np.uint64)
    salts = (multipliers * np.uint64(salt % 2**32)).astype(np.uint32)
    return (pcg3d(np.asarray(cells).astype(np.uint32) + salts) >> np.uint32(8)) / 2**24


def neighbours(p, period, offsets):
    """For each offset: the cells beside those of points in tiles, wrapped, and the points seen from
    their corners.
    """
    at = p * period
    cell = np.floor(at).astype(np.int64)
    for offset in itertools.product(offsets, repeat=p.shape[-1]):
        wrapped = np.zeros((*p.shape[:-1], 3), dtype=np.int64)
        wrapped[..., : p.shape[-1]] = np.mod(cell + offset, period)
        yield wrapped, at - cell - offset


def perlin(p, period, salt):
    """Perlin 2002 in two or three dimensions: ramps from the corners, weighted by his quintic.

    The gradients are not his twelve but random in a cube.
    """
    total = 0.0
    for cell, apart in neighbours(p, np.array(period), (0, 1)):
        gradient = 2 * random3(cell, salt)[..., : p.shape[-1]] - 1
        # 1 at the corner and 0 at all others.
        t = 1 - np.abs(apart)
        weight = np.prod(6 * t**5 - 15 * t**4 + 10 * t**3, axis=-1)
        total = total + weight * (gradient * apart).sum(axis=-1)
    return total


def perlin_fbm(p, period, octaves, salt):
    """Octaves of twice the frequency and half the amplitude, spread over 0 to 1."""
    octave = np.arange(octaves)
    total = sum(perlin(p, period * 2**i, salt + i) / 2**i for i in octave)
    return np.clip(0.5 + 0.85 * total / (0.5**octave).sum(), 0, 1)


def simplex(p, period, salt):
    """Perlin 2001 in the plane, as the sum over all points of a lattice of triangles near by: rows
    of them, every other one shifted by half a triangle, whose number is even so that they repeat.
    A gradient reaches as far as the triangles at its point.
    """
    rows = 2 * max(round(period / math.sqrt(3)), 1)
    x, y = np.moveaxis(p * np.array([period, rows]), -1, 0)
    total = 0.0
    for i, j in itertools.product(range(-2, 4), range(-1, 3)):
        column, row = (np.floor(v).astype(np.int64) + k for v, k in ((x, i), (y, j)))
        apart = np.stack([x - column + row % 2 / 2, (y - row) * math.sqrt(3) / 2], axis=-1)
        cell = np.stack([column % period, row % rows, 0 * row], axis=-1)
        gradient = 2 * random3(cell, salt)[..., :2] - 1
        weight = (3 / 4 - (apart**2).sum(axis=-1)).clip(0) ** 4
        total = total + weight * (gradient * apart).sum(axis=-1)
    return 7 * total


def simplex_fbm(p, period, octaves, salt):
    octave = np.arange(octaves)
    total = sum(simplex(p, period * 2**i, salt + i) / 2**i for i in octave)
    return np.clip(0.5 + 0.85 * total / (0.5**octave).sum(), 0, 1)


def worley(p, period, salt):
    """Worley 1996 with one point a cell, inverted: 1 at a point, 0 a cell away from the nearest."""
    distance = 1.0
    for cell, apart in neighbours(p, np.array(period), (-1, 0, 1)):
        distance = np.minimum(distance, np.linalg.norm(apart - random3(cell, salt), axis=-1))
    return 1 - distance


def remap01(v, a, b):
    """nubis2015's remap to 0..1, clamped; a step where the old range has no width."""
    return np.clip(ref64.remap(v, a, np.maximum(b, a + 1e-4)), 0, 1)


def perlin_worley(perlin, worley):
    """nubis2015: the Worley noise, bright borders, is the new minimum of the Perlin noise."""
    return remap01(perlin, 1 - worley, 1)


def centres(texels, size):
    return (np.asarray(texels) + 0.5) / size


def worley_octaves(p, period, octaves, salt):
    """Worley FBMs that start an octave apart, spread over 0 to 1; the last lacks its third
    octave.
    """
    w = np.stack([worley(p, period * 2**i, salt + i) for i in range(octaves)], axis=-1)
    fbms = [w[..., i : i + 3] @ FBM for i in range(octaves - 2)]
    fbms.append(0.75 * w[..., -2] + 0.25 * w[..., -1])
    return remap01(np.stack(fbms, axis=-1), 0.2, 0.75)


def shape_texels(texels, clouds):
    """R Perlin-Worley, G, B, A dark where they shape: Worley (nubis2015) or Perlin-Worley
    (vsu2022), each an octave above the one before.
    """
    p = centres(texels, SHAPE_SIZE)
    seed = 131 * clouds.seed
    out = worley_octaves(p, 3, 5, seed + 31)
    # The four channels share the octaves of the Worley noise, not those of the Perlin noise.
    salts = seed + np.array([1, 6, 10, 13])
    for i in range(4 if clouds.noise == "vsu2022" else 1):
        out[..., i] = perlin_worley(perlin_fbm(p, 3 * 2**i, 5 - i, salts[i]), out[..., i])
    out[..., 1:] = 1 - out[..., 1:]
    return out


def detail_texels(texels, clouds):
    p = centres(texels, DETAIL_SIZE)
    seed = 131 * clouds.seed + 61
    out = worley_octaves(p, 2, 4, seed)
    if clouds.noise == "vsu2022":
        for i in range(3):
            out[..., i] = perlin_worley(perlin_fbm(p, 2 * 2**i, 3, seed + 4 + i), out[..., i])
    return out


def detail_bake(clouds):
    """The detail, and the same again a fifth as wide, with its axes turned."""

    def coarse(texels):
        return (detail_texels(texels, clouds) @ FBM)[..., None]

    every = np.stack(np.meshgrid(*[np.arange(DETAIL_SIZE)] * 3, indexing="ij"), axis=-1)
    table = coarse(every)

    def known(texels):
        return table[tuple(np.moveaxis(texels, -1, 0))]

    def both(texels):
        p = centres(texels, FINER_SIZE).reshape(-1, 3)
        fine = sample(known, DETAIL_SIZE, 5 * p[:, [2, 0, 1]])
        found = sample(known, DETAIL_SIZE, p) + f32(clouds.fine_detail) * (fine - 0.5)
        return np.clip(found, 0, 1).reshape(*texels.shape[:-1], 1)

    return both


def curl_texels(texels, clouds):
    """Bridson 2007: (dpsi/dy, -dpsi/dx), by differences over one texel, a fifth of it."""

    def potential(dx, dy):
        p = centres(texels, CURL_SIZE) + 0.5 / CURL_SIZE * np.array([dx, dy])
        p = np.concatenate([p, np.full((*p.shape[:-1], 1), 0.5)], axis=-1)
        return perlin_fbm(p, 4, 3, 131 * clouds.seed + 91)

    slope = [potential(0, 1) - potential(0, -1), potential(-1, 0) - potential(1, 0)]
    return np.stack(slope, axis=-1) * CURL_SIZE / 5


def weather_texels(texels, weather):
    """Coverage, type, precipitation; the first row is the north. A map of the user's as it is."""
    texels = np.asarray(texels)
    if weather.map is not None:
        return half(weather.map[texels[..., 1], texels[..., 0]])
    x, y = np.moveaxis(centres(texels, WEATHER_SIZE), -1, 0)
    p = np.stack([x, 1 - y, np.full_like(x, 0.5)], axis=-1)
    seed = 97 * weather.seed
    cells = max(round(f32(weather.extent) / f32(weather.scale)), 1)
    broad = max(cells // 4, 1)

    def fbm(period, octaves, salt):
        if weather.noise == "worley_simplex":
            return simplex_fbm(p[..., :2], period, octaves, seed + salt)
        return perlin_fbm(p, period, octaves, seed + salt)

    w = [worley(p, cells * 2**i, seed + 7 + i) for i in range(3)]
    # Blobs and their shape.
    if weather.noise == "worley_perlin":
        coverage = 0.9 * (0.6 * w[0] + 0.4 * w[1]) + 0.7 * (fbm(cells, 4, 9) - 0.5)
        least, most = 0.2, 0.7
    elif weather.noise == "worley_simplex":
        coverage = np.stack(w, axis=-1) @ FBM * (0.2 + 1.6 * fbm(cells, 4, 9))
        least, most = 0.2, 0.75
    else:
        coverage = perlin_worley(fbm(cells, 4, 9), remap01(np.stack(w, axis=-1) @ FBM, 0.1, 0.65))
        least, most = -0.05, 0.6
    # How much there is of them from one region to the next.
    coverage = coverage + f32(weather.variety) * (fbm(broad, 3, 16) - 0.5)
    coverage = remap01(coverage, least, most)
    kind = 0.5 + f32(weather.type_variety) * (fbm(max(cells // 3, 1), 3, 47) - 0.5)
    rain = fbm(broad, 2, 77) + 0.3 * (coverage - 0.5)
    return np.stack([coverage, np.clip(kind, 0, 1), remap01(rain, 0.3, 0.7)], axis=-1)


def broad_texels(texels, weather):
    """What the larger map shifts coverage, type and precipitation by, and what bends the smaller
    one: at most half, nothing in the middle. From a map of the user's, whose fourth is 0.
    """
    texels = np.asarray(texels)
    if weather.broad_map is not None:
        own = half(f32(weather.broad_map[texels[..., 1], texels[..., 0]]) - 0.5)
        return np.concatenate([own, np.zeros((*own.shape[:-1], 1))], axis=-1)
    x, y = np.moveaxis(centres(texels, BROAD_SIZE), -1, 0)
    seed = 97 * weather.seed + 131

    def noise(p):
        fbm = [perlin_fbm(p, period, 2, seed + 8 * i) for i, period in enumerate((6, 3, 6))]
        # What bends is the same for every seed.
        return np.stack([*fbm, perlin_fbm(p, 3, 2, 155)], axis=-1)

    p = np.stack([x, 1 - y, np.full_like(x, 0.5)], axis=-1)
    return (noise(p) - noise(np.full((1, 3), 0.5))).clip(-0.5, 0.5)


def evolving(noise, time, evolution, octave):
    """gems2001: an octave fades from its last random update to its next, small ones sooner. `noise`
    is a function of what tells one update from another.

    Two independent noises of equal variance: the blend keeps it.
    """
    update, age = divmod(time * float(f32(evolution)) * 2**octave, 1.0)
    old, new = (noise(7 * octave + 977 * (int(update) % 65536 + k)) for k in (0, 1))
    return ((1 - age) * old + age * new) / math.hypot(age, 1 - age)


def rows_of_cells(p, along, across, salt):
    """Inverted Worley noise of points that stray by 0.3 of a cell from the middles of hexagons,
    about its mean.
    """
    columns, rows = np.meshgrid(np.arange(along), np.arange(across), indexing="ij")
    cells = np.stack([columns, rows, np.zeros_like(rows)], axis=-1)
    points = cells[..., :2] + 0.5 + 0.6 * (random3(cells, salt)[..., :2] - 0.5)
    points[..., 1] += 0.5 * (columns % 2)
    size = np.array([along, across])
    nearest = np.full(len(p), np.inf)
    at = np.mod(p, 1) * size
    column, row = (np.floor(at).astype(np.int64)).T
    for i, j in itertools.product(range(-2, 3), repeat=2):
        ring = np.stack([column + i, row + j], axis=-1)
        wrapped = np.mod(ring, size)
        point = points[wrapped[:, 0], wrapped[:, 1]] + (ring - wrapped)
        nearest = np.minimum(nearest, np.linalg.norm(point - at, axis=-1))
    return 0.388 - nearest


def high_texels(texels, high, time):
    """gems2001: the sum over noise(2^i x) / 2^i for streaks and cells, each octave evolving."""
    p = centres(texels, high.texture_size).reshape(-1, 2)
    seed = 61 * high.seed
    deep = np.column_stack([p, np.full(len(p), 0.5)])

    def displacement(period, salt):
        return np.stack([perlin(deep, period, seed + salt + k) for k in (0, 1)], axis=-1)

    at = p + 0.1 * displacement(3, 51)
    hooked = at + 0.015 * displacement(8, 54)
    stretch = float(f32(high.stretch))
    streaks = cells = 0.0
    for i in range(high.octaves):
        longer = math.sqrt(min(stretch ** (1 + i / 4), 16))
        period = [max(round(4 * 2**i * k), 1) for k in (1 / longer, longer)]

        def streak(salt, period=period):
            return 1.4 * perlin(hooked, period, seed + salt)

        size = 12 * 2**i
        along = 2 * max(round(size * stretch**0.25 / 2), 1)
        across = max(round(size / stretch**0.25), 1)

        def cell(salt, along=along, across=across):
            return rows_of_cells(at, along, across, seed + 900001 + salt)

        if high.type < 1:
            streaks = streaks + 0.387 / 2**i * evolving(streak, time, high.evolution, i)
        if high.type > 0:
            cells = cells + 0.774 / 2**i * evolving(cell, time, high.evolution, i)

    def patch(salt):
        place = np.column_stack([at, np.full(len(p), 0.5)])
        return perlin(place, 3, seed + 500009 + salt)

    cells = cells + 0.45 * evolving(patch, time, high.evolution, 0)
    kind = float(f32(high.type))
    share = np.clip(kind + 6.4 * kind * (1 - kind) * perlin(deep, 2, seed + 53), 0, 1)
    total = ((1 - share) * streaks + share * cells) / np.hypot(share, 1 - share)
    return np.clip(0.5 + total, 0, 1).reshape(*np.shape(texels)[:-1], 1)


def high_thickness(values, high):
    """gems2001's two ways from noise to cloud: what is above a level, of the thickest."""
    coverage = float(f32(high.coverage))
    over = values - (1 - coverage) + 0.35 * max(2 * coverage - 1, 0) ** 2
    if high.curve == "clamp":
        return np.clip(2.5 * over, 0, 1)
    over = np.maximum(over, 0)
    return 1 - np.exp(-3 * over**2 / (over + 0.15))


def high_clouds(points, params, time):
    """Thickness of the high clouds at places on the chart (N, 2), of the thickest, and how much
    thicker they are than 0.02 tiles nearer to the sun.
    """
    high = params.high_clouds
    wind = ref64.compass(float(f32(high.direction)))[:2]
    axes = np.stack([wind, [-wind[1], wind[0]]], axis=-1)
    at = (points - time * f32(high.speed) * wind) @ axes / f32(high.scale)
    toward = ref64.sun_direction(params)[:2] @ axes

    def bake(texels):
        return half(high_texels(texels, high, time))

    def read(at):
        return sample(bake, high.texture_size, at)[:, 0]

    broad = 0.4 * read(at / 3.2)
    here, nearer = (high_thickness(0.6 * read(a) + broad, high) for a in (at, at + 0.02 * toward))
    return here, here - nearer


def mip(bake, texels, level):
    """Texels of a smaller level: the mean of what they cover."""
    corners = np.array(list(itertools.product(range(2**level), repeat=texels.shape[-1])))
    return bake(2**level * texels[..., None, :] + corners).mean(axis=-2)


def sample(bake, size, at, edge="repeat"):
    """Linear between the centres of texels; `at` in tiles, shape (N, 2 or 3). Beyond the texels
    there are the same again, their mirror image, or the outermost ones.
    """
    at = at * np.array(size) - 0.5
    corners = np.array(list(itertools.product((0, 1), repeat=at.shape[-1])))
    first = np.floor(at).astype(np.int64)
    beyond = (at - first)[:, None]
    weights = np.where(corners, beyond, 1 - beyond).prod(axis=-1)
    texel = first[:, None] + corners
    if edge == "repeat":
        texel = np.mod(texel, size)
    elif edge == "mirror":
        texel = np.mod(texel, 2 * np.array(size))
        texel = np.where(texel < size, texel, 2 * np.array(size) - 1 - texel)
    else:
        texel = np.clip(texel, 0, np.array(size) - 1)
    return (weights[..., None] * bake(texel)).sum(axis=1)


def smoothstep(a, b, v):
    x = np.clip((v - a) / (b - a), 0, 1)
    return x * x * (3 - 2 * x)


def weather_from_map(texel, clouds):
    """vsu2022: the parameters shift the map, 0.5 leaves it. nubis2015: rain brings coverage of at
    least 0.7 and cumulus, here in proportion and not to a clear sky. Coverage, type, precipitation.
    """
    coverage, kind, rain = np.moveaxis(np.asarray(texel, dtype=np.float64), -1, 0)
    rain = rain * f32(clouds.precipitation)
    kind = np.clip(kind + 2 * (f32(clouds.type) - 0.5), 0, 1)
    coverage = np.clip(coverage + 2 * (f32(clouds.coverage) - 0.5), 0, 1)
    wet = np.clip((1.25 if clouds.field == "heaped" else 0.95) * rain, 0, 1)
    coverage = np.maximum(coverage, wet * min(5 * f32(clouds.coverage), 1))
    return coverage, kind + rain * (1 - kind), rain


def gradients(clouds):
    return [f32(getattr(clouds, t)) for t in ("stratus", "stratocumulus", "cumulus")]


def between(height, a, b, c, d):
    return np.clip(ref64.remap(height, a, b), 0, 1) * (1 - smoothstep(c, d, height))


def profile_of(height, edges, clouds):
    """Rise and fall; of the field `heaped` the fall alone."""
    if clouds.field == "heaped":
        return 1 - smoothstep(edges[2], edges[3], height)
    return between(height, *edges)


def height_profile(height, kind, clouds, tower=0.0):
    """nubis2015: the sum of three gradients, weighted by type; or a table, by type from left to
    right and by height from the last row to the first. Where a tower stands, its own.
    """
    storm = f32(clouds.cumulonimbus)
    if clouds.profile is not None:
        rows, columns = clouds.profile.shape
        at = np.stack([kind * (columns - 1), (1 - np.clip(height, 0, 1)) * (rows - 1)], axis=-1)
        at = (at + 0.5) / (columns, rows)

        def texels(t):
            # What repeats is not what is between the outer centres.
            return half(clouds.profile[t[..., 1], t[..., 0]])[..., None]

        dry = sample(texels, (columns, rows), at)[:, 0]
        return dry + tower * (profile_of(height, storm, clouds) - dry)
    weights = np.stack([1 - 2 * kind, 1 - np.abs(2 * kind - 1), 2 * kind - 1]).clip(0)
    edges = np.tensordot(np.transpose(gradients(clouds)), weights, 1)
    edges = edges + tower * (storm.reshape(4, *[1] * edges[0].ndim) - edges)
    return profile_of(height, edges, clouds)


def base_shape(noise):
    return ref64.remap(noise[..., 0], -(1 - noise[..., 1:] @ FBM), 1)


def with_coverage(base, coverage):
    """More coverage is more cloud: nothing is left at 0, the base as it is at 1."""
    coverage = np.maximum(coverage, 1e-9)
    return np.clip(ref64.remap(base, 1 - coverage, 1), 0, 1) * coverage


def eroded(shape, detail, height, depth):
    """Wispy below, billowy above."""
    share = np.clip(10 * height, 0, 1)
    modifier = detail * (1 - share) + (1 - detail) * share
    return np.where(shape > 0, np.clip(ref64.remap(shape, modifier * depth, 1), 0, 1), 0)


def billows(p, period, salt):
    return 1 - np.clip(1.25 * (1 - worley(p, period, salt)) ** 2, 0, 1)


def heaped_texels(texels, clouds):
    """Base noise of the field `heaped`."""
    p = (texels + 0.5) / SHAPE_SIZE
    seed = clouds.seed * 131
    heaps = sum(
        w * billows(p, 3 << i, (seed + 31 + i) % 2**32)
        for i, w in enumerate((0.45, 0.28, 0.17, 0.1))
    )
    noise = (perlin_fbm(p, 3, 3, (seed + 1) % 2**32) + heaps) / 2
    return np.clip(0.42 + 1.9 * (noise - 0.563), 0, 1)[..., None]


def relief_texels(texels, clouds):
    """Relief of the field `heaped`."""
    p = (texels + 0.5) / FINER_SIZE
    seed = clouds.seed * 131 + 61
    weights = 0.5, 0.27, 0.14, 0.09, 0.06
    relief = sum(w * billows(p, 3 << i, (seed + i) % 2**32) for i, w in enumerate(weights))
    return np.clip(0.5 + 1.6 * (relief - 0.6 - 0.6 * weights[-1]), 0, 1)[..., None]


def bakes(params):
    """What is in each texture."""
    if params.clouds.field == "heaped":
        return {
            **bakes(params.with_(**{"clouds.field": "eroded"})),
            "shape_noise": lambda texels: heaped_texels(texels, params.clouds),
            "detail_noise": lambda texels: relief_texels(texels, params.clouds),
        }
    return {
        "weather_map": lambda texels: weather_texels(texels, params.weather),
        "broad_map": lambda texels: broad_texels(texels, params.weather),
        "shape_noise": lambda texels: base_shape(shape_texels(texels, params.clouds))[..., None],
        "curl_noise": lambda texels: curl_texels(texels, params.clouds),
        "detail_noise": detail_bake(params.clouds),
    }


def turns(wander, channel):
    """Angular velocities (1/s) and phases of the four turns of a wander; 0 is the wind, 1 the
    cover.
    """
    k = np.arange(4)
    period = f32(wander.period) * 3 ** ((k - 1.5) / 4)
    keys = np.stack([np.full(4, wander.seed), k, np.full(4, channel)], axis=-1)
    phase = 2 * np.pi * pcg3d(keys)[..., 0] / 2**32
    return (-1.0) ** k * 2 * np.pi / period, phase


def blown(params, degrees, speed, time):
    """Where a wind has carried what it carries, m (east, north): the integral of its velocity from
    0 to `time`, by Gauss-Legendre quadrature on pieces of an eighth of the shortest period, which
    is exact to 1e-15.

    The velocity is the mean one, stretched and turned by 1 + share * (mean of four unit vectors
    that turn), in complex numbers.
    """
    rate, phase = turns(params.wind_variation, 0)
    pieces = int(np.ceil(abs(time) * np.abs(rate).max() / 2 / np.pi * 8)) + 1
    ends = np.linspace(0, time, pieces + 1)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(ends)[:, None]
    at = 0.5 * (ends[:-1, None] + ends[1:, None]) + half * nodes
    gust = np.exp(1j * (rate * at[..., None] + phase)).mean(axis=-1)
    seconds = time + f32(params.wind_variation.wind) * (half * weights * gust).sum()
    east, north, _ = ref64.compass(float(f32(degrees))) * f32(speed)
    way = (east + 1j * north) * seconds
    return np.array([way.real, way.imag])


def cover(params, time):
    """The mean cover, and what wanders, in steps of a 1024th."""
    rate, phase = turns(params.wind_variation, 1)
    swing = np.round(np.sin(rate * time + phase).mean() * 1024) / 1024
    return float(
        np.clip(f32(params.clouds.coverage) + f32(params.wind_variation.coverage) * swing, 0, 1)
    )


def kept_clear(points, weather):
    """The share of the cover that is left: none within the radius, all of it from half a radius
    outside.
    """
    radius = float(f32(weather.clear_radius))
    if radius == 0:
        return 1.0
    away = np.linalg.norm(points[:, :2] - f32(weather.clear_at), axis=1)
    return smoothstep(radius, 1.5 * radius, away)


class Field:
    """The whole sampler of nubis2015 at world points at a time, with what has been added to it.

    `textures`: texels to values, as `bakes` has them.
    """

    def __init__(self, params, time, textures):
        self.params = params.with_(**{"clouds.coverage": cover(params, time)})
        self.time, self.textures = time, textures

    def extinction(self, points):
        """In 1/m."""
        clouds, deck = self.params.clouds, self.params.upper_clouds
        radius = float(f32(self.params.atmosphere.planet_radius))
        altitude = ref64.altitude(points, radius)
        points = ref64.on_chart(points, radius)
        limit, density = self.lower(points, altitude)
        extinction = density * f32(clouds.extinction)
        if clouds.rain_extinction > 0:
            below = altitude < f32(clouds.base)
            rain_limit, rain = self.rain(points, altitude)
            limit = np.where(below, rain_limit, limit)
            extinction = np.where(below, rain * f32(clouds.rain_extinction), extinction)
        if deck.coverage > 0:
            upper_limit, upper = self.upper(points, altitude)
            extinction = np.where(upper_limit > limit, upper * f32(deck.extinction), extinction)
        return extinction

    def sheared(self, points, altitude):
        """Without the lean of the wind."""
        clouds, wind = self.params.clouds, self.params.wind
        height = (altitude - f32(clouds.base)) / (f32(clouds.top) - f32(clouds.base))
        downwind = ref64.compass(float(f32(wind.direction)))[:2]
        return points[:, :2] - f32(wind.shear) * height[:, None] * downwind

    def texel(self, on_map, upright, drift):
        """Of the weather map. Column 0 is the west, row 0 the north."""
        weather = self.params.weather
        down = np.array([1, -1])
        at = 0.5 + on_map * down
        size = WEATHER_SIZE if weather.map is None else weather.map.shape[1::-1]
        if weather.broad_variety == 0 or (weather.map is not None and weather.broad_map is None):
            return sample(self.textures["weather_map"], size, at, weather.edge)[:, :3]
        own = weather.broad_map
        broad_at = 0.5 + (upright - drift) / f32(weather.broad_extent) * down
        broad_size = BROAD_SIZE if own is None else own.shape[1::-1]
        shift = sample(self.textures["broad_map"], broad_size, broad_at)
        if own is None:
            bend = 0.8 * min(f32(weather.broad_variety) / 0.3, 1)
            at = at + bend * shift[:, 3:] * np.array([0.8, 0.6])
        texel = sample(self.textures["weather_map"], size, at, weather.edge)[:, :3]
        return np.clip(texel + f32(weather.broad_variety) * shift[:, :3], 0, 1)

    def weather(self, points, altitude):
        """Where the weather is read, and what it says: coverage, type, precipitation."""
        drift = self.weather_drift()
        upright = self.sheared(points, altitude)
        on_map = (upright - drift) / f32(self.params.weather.extent)
        texel = self.texel(on_map, upright, drift)
        coverage, kind, rain = weather_from_map(texel, self.params.clouds)
        return upright, (coverage * kept_clear(points, self.params.weather), kind, rain)

    def weather_drift(self):
        wind = self.params.wind
        return blown(self.params, wind.weather_direction, wind.weather_speed, self.time)

    def lower(self, points, altitude):
        clouds = self.params.clouds
        base, top = f32(clouds.base), f32(clouds.top)
        upright, (coverage, kind, rain) = self.weather(points, altitude)
        tallest = np.maximum(top, f32(clouds.cumulonimbus_top))
        tower = smoothstep(0.5, 0.9, rain)
        height = (altitude - base) / (top + tower * (tallest - top) - base)
        profile = np.where(
            (height > 0) & (height < 1), height_profile(height, kind, clouds, tower), 0
        )
        whole = top + tower * (tallest - top) - base
        heap = Heap(clouds, altitude - base, kind, rain, tower, coverage, whole)
        if clouds.precipitation > 0 and clouds.field == "heaped":
            edge = 0.6 - 0.5 * f32(clouds.anvil)
            spread = smoothstep(edge, edge + 0.4, rain)
            under = 0.86 - 0.14 * spread**2
            up = (altitude - base) / (tallest - base)
            anvil = spread * smoothstep(under, under + 0.08, up) * (1 - smoothstep(0.9, 0.98, up))
            anvil = anvil * np.clip(4 * coverage, 0, 1)
            outweighs = 2 * anvil > profile + coverage
            profile, coverage = (np.where(outweighs, anvil, v) for v in (profile, coverage))
            heap.growth = np.where(outweighs, 0, heap.growth)
            height = np.minimum(height, 1)
        elif clouds.precipitation > 0:
            edge = 0.6 - 0.5 * f32(clouds.anvil)
            anvil = smoothstep(edge, edge + 0.3, rain) * np.clip(4 * coverage, 0, 1)
            anvil = anvil * between((altitude - base) / (tallest - base), 0.64, 0.8, 0.88, 1)
            profile, coverage = np.maximum(profile, anvil), np.maximum(coverage, anvil)
            height = np.minimum(height, 1)
        wind = self.params.wind
        winds = (wind.direction, wind.speed), (wind.detail_direction, wind.detail_speed)
        density = self.cloud(upright, altitude, height, profile, coverage, winds, 1.0, heap)
        return limit_of(profile, coverage, clouds), density

    def upper(self, points, altitude):
        """The deck above: scaled, in a wind of its own, from another part of the map."""
        deck, wind = self.params.upper_clouds, self.params.wind
        base, scale = f32(deck.base), f32(deck.scale)
        height = (altitude - base) / (f32(deck.top) - base)
        downwind = ref64.compass(float(f32(deck.direction)))[:2]
        upright = points[:, :2] - f32(deck.shear) * height[:, None] * downwind
        extent = f32(self.params.weather.extent) * scale
        drift = blown(self.params, deck.direction, deck.speed, self.time)
        on_map = (upright - drift) / extent + (0.37 - 0.5, 0.61 + 0.5)
        texel = self.texel(on_map, self.sheared(points, altitude), self.weather_drift())
        coverage = np.clip(texel[:, 0] + 2 * f32(deck.coverage) - 1, 0, 1)
        coverage = coverage * kept_clear(points, self.params.weather)
        kind = np.clip(texel[:, 1] + 2 * f32(deck.type) - 1, 0, 1)
        profile = np.where(
            (height > 0) & (height < 1), height_profile(height, kind, self.params.clouds), 0
        )
        faster = f32(f32(deck.speed) + f32(wind.detail_speed) - f32(wind.speed))
        winds = (deck.direction, deck.speed), (deck.direction, faster)
        whole = f32(deck.top) - base
        clouds = self.params.clouds
        heap = Heap(clouds, (altitude - base) / scale, kind, 0 * kind, 0.0, coverage, whole, scale)
        density = self.cloud(upright, altitude, height, profile, coverage, winds, scale, heap)
        return limit_of(profile, coverage, clouds), density

    def rain(self, points, altitude):
        """Streaks, twelve times longer than wide, that thin out on their way down; what is thinner
        than air evaporates there.
        """
        clouds, wind = self.params.clouds, self.params.wind
        upright, (coverage, _, rain) = self.weather(points, altitude)
        share = altitude / f32(clouds.base)
        wet = rain * coverage * smoothstep(1.5e-6, 1e-5, f32(clouds.rain_extinction))
        limit = np.where(altitude > 0, np.clip(2 * wet - 0.6 + 0.6 * share, 0, 1), 0)
        # They fall at 7.4 m/s; what is far up now is here later.
        above = (altitude + 7.4 * self.time) / 12
        at = self.carried(upright, above, (wind.direction, wind.speed))
        noise = sample(self.textures["shape_noise"], SHAPE_SIZE, at / f32(clouds.shape_scale))
        return limit, limit * np.clip(ref64.remap(noise[:, 0], 0.15, 0.65), 0, 1)

    def carried(self, at, altitude, wind, scale=1.0):
        """Where the wind has brought here what was baked."""
        at = at - blown(self.params, *wind, self.time)
        rise = self.time * f32(self.params.wind.updraft)
        return np.column_stack([at / scale, altitude / scale - rise / scale])

    def cloud(self, upright, altitude, height, profile, coverage, winds, scale, heap):
        clouds = self.params.clouds
        heaped = clouds.field == "heaped"
        place = self.carried(upright, altitude, winds[0], scale)
        if heaped:
            place[:, 2] += heap.upright() - heap.over_base
        at = place / f32(clouds.shape_scale)
        noise = sample(self.textures["shape_noise"], SHAPE_SIZE, at)[:, 0]
        shape = with_coverage(noise * profile, coverage)
        if heaped:
            shape = heap.shape(noise, profile, coverage)
        shape = np.where(limit_of(profile, coverage, clouds) > 0, shape, 0)

        moved = self.carried(upright, altitude, winds[1], scale)
        at = moved[:, :2] / f32(clouds.curl_scale)
        swirl = sample(self.textures["curl_noise"], CURL_SIZE, at)[:, :2]
        curled = 1 - heap.vigour(coverage) if heaped else 1 - height
        moved[:, :2] += f32(clouds.curl) * curled[:, None] * swirl
        at = moved / f32(clouds.detail_scale)
        detail = sample(self.textures["detail_noise"], FINER_SIZE, at)[:, 0]
        if heaped:
            return heap.density(shape, detail, swirl[:, 0], coverage)
        return eroded(shape, detail, height, f32(clouds.detail))


def limit_of(profile, coverage, clouds):
    if clouds.field == "heaped":
        return np.clip(profile - 1.2 * (1 - coverage), 0, 1)
    return with_coverage(profile, coverage)


def mix(a, b, t):
    return a + t * (b - a)


class Heap:
    """What the field `heaped` has besides weather and noises (docs/clouds.md), in the coordinates
    of the noises.
    """

    def __init__(self, clouds, over_base, kind, rain, tower, coverage, whole, scale=1.0):
        self.slope = 4.16 / f32(clouds.shape_scale)
        self.over_base = over_base
        self.growth = np.maximum(smoothstep(0.35, 0.85, kind), np.minimum(2 * rain, 1))
        storm = f32(clouds.cumulonimbus)
        if clouds.profile is not None:
            edges = mix(np.array([0.0, 0, 1, 1])[:, None], storm[:, None], tower + 0 * kind)
        else:
            weights = np.stack([1 - 2 * kind, 1 - np.abs(2 * kind - 1), 2 * kind - 1]).clip(0)
            dry = np.tensordot(np.transpose(gradients(clouds)), weights, 1)
            edges = mix(dry, storm[:, None], tower)
        top = mix(edges[2], edges[3], coverage)
        self.depth = np.maximum(top - edges[0], 1e-3) * whole / scale
        self.relief = np.minimum(0.5 * f32(clouds.detail), 0.6 * self.slope * self.depth)

    def upright(self):
        h = np.maximum(self.over_base, 0)
        return np.where(h < 600, h**2 / 1200, h - 300)

    def shape(self, noise, profile, coverage):
        s = noise + profile - 1 - 1.2 * (1 - coverage)
        lift = mix(0.9 * self.depth, 350, self.growth) * (mix(0.55, 0.72, self.growth) - noise)
        s = np.minimum(s, self.slope * (self.over_base - lift))
        return np.maximum(s - 0.1 * self.relief, 0)

    def vigour(self, coverage):
        risen = np.clip(self.over_base / 250, 0, 1)
        return smoothstep(0.15, 0.5, coverage) * self.growth * risen

    def density(self, shape, detail, swirl, coverage):
        v = self.vigour(coverage)
        modifier = mix(detail, 1 - detail, smoothstep(0.1, 0.5, v))
        here = self.relief * mix(0.6, 1.4, np.clip(0.5 + 0.5 * swirl, 0, 1))
        edge = np.minimum(mix(0.03, 0.008, v), np.maximum(0.3 * self.relief, 0.008))
        core = np.clip(shape / np.minimum(0.4, 0.667 * self.slope * self.depth), 0, 1)
        risen = np.clip(self.over_base / mix(300, 700, self.growth), 0, 1)
        water = mix(core, 1, self.growth) * mix(0.25, 1, risen)
        left = np.clip((shape - here * (modifier - 0.1)) / edge, 0, 1)
        return np.where(shape > 0, water * left, 0)
