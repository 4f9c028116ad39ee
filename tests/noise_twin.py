"""The noises, the textures baked from them, and the cloud field that reads the textures: float64
and whole numbers, from the published formulas.

Textures are functions from texels to values, so that only the texels that a test reads are
computed. Parameters are rounded to float32 first, as the renderer keeps them.
"""

import itertools
import math

import numpy as np

import twin

FBM = np.array([0.625, 0.25, 0.125])
SHAPE_SIZE, DETAIL_SIZE, CURL_SIZE, WEATHER_SIZE = 128, 32, 128, 512


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
    return np.clip(twin.remap(v, a, np.maximum(b, a + 1e-4)), 0, 1)


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


def high_texels(texels, high, time):
    """gems2001: each octave fades from its last random update to its next, smaller ones sooner."""
    p = centres(texels, high.texture_size)
    seed = 61 * high.seed
    deep = np.concatenate([p, np.full((*p.shape[:-1], 1), 0.5)], axis=-1)
    at = p + 0.1 * np.stack([perlin(deep, 3, seed + 51), perlin(deep, 3, seed + 52)], axis=-1)
    total, amplitudes = 0.0, 0.62 ** np.arange(high.octaves)
    stretch = math.sqrt(f32(high.stretch))
    for i, amplitude in enumerate(amplitudes):
        period = [max(round(4 * 2**i * k), 1) for k in (1 / stretch, stretch)]
        update, age = divmod(time * float(f32(high.evolution)) * 2**i, 1.0)
        old, new = (
            perlin(at, period, seed + 7 * i + 977 * (int(update) % 65536 + k)) for k in (0, 1)
        )
        # Two independent noises of equal variance: the blend keeps it.
        total = total + amplitude * ((1 - age) * old + age * new) / math.hypot(age, 1 - age)
    return np.clip(0.5 + 0.75 * 1.4 * total / amplitudes.sum(), 0, 1)[..., None]


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
    """vsu2022: the parameters shift the map, 0.5 leaves it. nubis2015: rain brings coverage of 0.7
    and cumulus, here in proportion and not to a clear sky. Coverage, type, precipitation.
    """
    coverage, kind, rain = np.moveaxis(np.asarray(texel, dtype=np.float64), -1, 0)
    rain = rain * f32(clouds.precipitation)
    kind = np.clip(kind + 2 * (f32(clouds.type) - 0.5), 0, 1)
    coverage = np.clip(coverage + 2 * (f32(clouds.coverage) - 0.5), 0, 1)
    coverage = np.maximum(coverage, 0.7 * rain * min(5 * f32(clouds.coverage), 1))
    return coverage, kind + rain * (1 - kind), rain


def height_profile(height, kind, constants):
    """nubis2015: the sum of three gradients, weighted by type."""
    weights = np.stack([1 - 2 * kind, 1 - np.abs(2 * kind - 1), 2 * kind - 1]).clip(0)
    a, b, c, d = np.tensordot(constants.T, weights, 1)
    return np.clip(twin.remap(height, a, b), 0, 1) * (1 - smoothstep(c, d, height))


def base_shape(noise):
    return twin.remap(noise[..., 0], -(1 - noise[..., 1:] @ FBM), 1)


def with_coverage(base, coverage):
    """More coverage is more cloud: nothing is left at 0, the base as it is at 1."""
    coverage = np.maximum(coverage, 1e-9)
    return np.clip(twin.remap(base, 1 - coverage, 1), 0, 1) * coverage


def eroded(shape, detail, height, depth):
    """Wispy below, billowy above."""
    share = np.clip(10 * height, 0, 1)
    modifier = detail * (1 - share) + (1 - detail) * share
    return np.where(shape > 0, np.clip(twin.remap(shape, modifier * depth, 1), 0, 1), 0)


def bakes(params):
    """What is in each texture."""
    return {
        "weather_map": lambda texels: weather_texels(texels, params.weather),
        "shape_noise": lambda texels: shape_texels(texels, params.clouds),
        "curl_noise": lambda texels: curl_texels(texels, params.clouds),
        "detail_noise": lambda texels: detail_texels(texels, params.clouds),
    }


def extinction(points, params, time, gradients, textures):
    """The whole sampler of nubis2015 at world points, in 1/m. `gradients`: the three of its height
    profile; `textures`: texels to values, as `bakes` has them.
    """
    clouds, weather, wind = params.clouds, params.weather, params.wind
    altitude = twin.altitude(points, float(f32(params.atmosphere.planet_radius)))
    height = (altitude - f32(clouds.base)) / (f32(clouds.top) - f32(clouds.base))
    downwind, weather_wind = (
        twin.compass(float(f32(degrees)))[:2]
        for degrees in (wind.direction, wind.weather_direction)
    )
    upright = points[:, :2] - f32(wind.shear) * height[:, None] * downwind

    def carried(at, speed):
        """Where the wind has brought here what was baked."""
        at = at - time * f32(speed) * downwind
        return np.column_stack([at, altitude - time * f32(wind.updraft)])

    # Column 0 is the west, row 0 the north, and the origin of the world the middle of the map.
    size = WEATHER_SIZE if weather.map is None else weather.map.shape[1::-1]
    on_map = upright - time * f32(wind.weather_speed) * weather_wind
    texel = sample(
        textures["weather_map"],
        size,
        0.5 + on_map / f32(weather.extent) * np.array([1, -1]),
        weather.edge,
    )
    coverage, kind, _ = weather_from_map(texel[:, :3], clouds)
    at = carried(upright, wind.speed) / f32(clouds.shape_scale)
    noise = sample(textures["shape_noise"], SHAPE_SIZE, at)
    shape = with_coverage(base_shape(noise) * height_profile(height, kind, gradients), coverage)

    at = carried(upright, wind.detail_speed)[:, :2] / f32(clouds.curl_scale)
    swirl = sample(textures["curl_noise"], CURL_SIZE, at)[:, :2]
    swirled = upright + f32(clouds.curl) * (1 - height[:, None]) * swirl
    at = carried(swirled, wind.detail_speed) / f32(clouds.detail_scale)
    detail = sample(textures["detail_noise"], DETAIL_SIZE, at)[:, :3] @ FBM
    density = eroded(shape, detail, height, f32(clouds.detail))
    return np.where((height > 0) & (height < 1), density, 0) * f32(clouds.extinction)
