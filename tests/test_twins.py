"""Noises, baked textures and the whole cloud field against `ref64_noise`: what the formulas say, in
float64.
"""

import itertools

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from nubis.testing import probe

NOISES = ["nubis2015", "vsu2022"]
# So large that its multiples pass 2^32, as in the shader.
SEED = 4_000_000_007
# The step of a half float between 0.5 and 1. Which way a texel is rounded is up to the driver:
# lavapipe cuts.
STEP = 2.0**-11


def test_hashes_to_the_bit(rng):
    """Numbers of 32 bits go in and come out as 24 bits in each of three floats, and 8 of each in
    the fourth.
    """
    whole = rng.integers(0, 2**32, (5000, 3))
    whole[:8] = list(itertools.product([0, 2**32 - 1], repeat=3))
    top = np.array([1, 2**8, 2**16])
    inputs = np.column_stack([whole % 2**24, (whole >> 24) @ top])
    hashed = "pcg3d(vec3u(x.xyz) + ((vec3u(u32(x.w)) >> vec3u(0u, 8u, 16u)) << vec3u(24u)))"
    wgsl = f"""vec4f(
        vec3f({hashed} & vec3u(0xffffffu)),
        f32(dot({hashed} >> vec3u(24u), vec3u(1u, 256u, 65536u))))"""
    got = probe(wgsl, inputs, imports=["random"]).astype(np.int64)
    got = got[:, :3] + (got[:, 3:] // top % 2**8 << 24)
    np.testing.assert_array_equal(got, ref64_noise.pcg3d(whole))


@pytest.mark.parametrize("salt", [0, 1, 131 * SEED % 2**32, 2**32 - 1])
def test_random_numbers_to_the_bit(rng, salt):
    cells = rng.integers(0, 2**24, (5000, 3))
    got = probe(f"vec4f(random3(vec3u(x.xyz), {salt}u), 0.0)", cells, imports=["random"])[:, :3]
    np.testing.assert_array_equal(got, ref64_noise.random3(cells, salt))


@pytest.mark.parametrize("period", [(1, 3, 8), (2, 111, 1)])
def test_cells_wrap(rng, period):
    period = np.array(period)
    cells = rng.integers(-period, 2 * period, (2000, 3))
    wgsl = "vec4f(vec3f(wrap_cell(vec3i(x.xyz), vec3i({}, {}, {}))), 0.0)".format(*period)
    got = probe(wgsl, cells, imports=["random"])[:, :3]
    np.testing.assert_array_equal(got, np.mod(cells, period))


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("salt", [0, 977, 2**32 - 2])
@pytest.mark.parametrize("period", [1, 2, 3, 48])
def test_noises_at_points(rng, period, salt):
    """Over several tiles, so that they must tile as well.

    In the shader a coordinate is off by up to 2^-23 of a tile (its fraction, then the product with
    the period). Worley noise has a slope of 1 a cell, Perlin noise under 4, and in its FBM every
    octave has the same; the sums of 8 corners are good to 1e-6.
    """
    p = ref64_noise.f32(rng.uniform(-2, 3, (4000, 3)))
    functions = [f"perlin({{}}, {period}u, {salt}u)", f"worley({{}}, {period}u, {salt}u)"]
    functions += [f"perlin_fbm({{}}, {period}u, {n}u, {salt}u)" for n in (1, 4)]
    wgsl = f"vec4f({', '.join(functions)})".format(*["x.xyz"] * 4)
    got = probe(wgsl, p, imports=["gradient_noise"])
    expected = [
        ref64_noise.perlin(p, period, salt),
        ref64_noise.worley(p, period, salt),
        ref64_noise.perlin_fbm(p, period, 1, salt),
        ref64_noise.perlin_fbm(p, period, 4, salt),
    ]
    slopes = np.array([4, 1, 4 * 0.85, 4 * 4 * 0.85 / 1.875])
    error = np.abs(got.T - expected).max(axis=1)
    assert (error < 2.0**-23 * period * slopes + 1e-6).all(), error


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("salt", [0, 977, 2**32 - 2])
@pytest.mark.parametrize("period", [1, 2, 3, 7, 48])
def test_simplex_noise(rng, period, salt):
    """Over several tiles, so that it must tile as well; its slope is under 4 a triangle."""
    p = ref64_noise.f32(rng.uniform(-2, 3, (4000, 2)))
    wgsl = f"simplex(x.xy, {period}u, {salt}u), simplex_fbm(x.xy, {period}u, 4u, {salt}u)"
    got = probe(f"vec4f({wgsl}, 0.0, 0.0)", p, imports=["gradient_noise"])
    expected = [
        ref64_noise.simplex(p, period, salt),
        ref64_noise.simplex_fbm(p, period, 4, salt),
    ]
    slopes = np.array([4, 4 * 4 * 0.85 / 1.875])
    error = np.abs(got.T[:2] - expected).max(axis=1)
    assert (error < 2.0**-23 * period * slopes + 1e-6).all(), error


def test_simplex_noise_is_like_perlin_noise(rng):
    """As wide, so that one can stand for the other; about 0, and smooth from tile to tile."""
    p = rng.uniform(0, 1, (100_000, 3))
    simplex = ref64_noise.simplex(p[:, :2], 48, 5)
    assert abs(simplex.mean()) < 5e-3
    assert simplex.std() == pytest.approx(ref64_noise.perlin(p, 48, 5).std(), rel=0.05)
    edge, e = np.zeros((1000, 2)), 1e-6
    edge[:, 1] = rng.uniform(0, 1, 1000)
    for side in (edge, edge[:, ::-1]):
        across = (side == 0) * e
        step = ref64_noise.simplex(1 + side - across, 5, 9) - ref64_noise.simplex(
            across + side, 5, 9
        )
        assert np.abs(step).max() < 1e-4


def test_perlin_worley(rng):
    inputs = np.concatenate([rng.uniform(0, 1, (3000, 2)), [(0, 0), (1, 0), (0, 1), (1, 1)]])
    got = probe("perlin_worley(x.x, x.y)", inputs, imports=["gradient_noise"])[:, 0]
    perlin, worley = ref64_noise.f32(inputs).T
    # The new range is as wide as the Worley noise is bright: dividing by it enlarges the rounding
    # of 1 - worley.
    tolerance = 2e-7 / np.maximum(worley, 1e-4)
    error = np.abs(got - ref64_noise.perlin_worley(perlin, worley))
    assert (error <= tolerance + 1e-6).all()


def texels(texture, at, params, level=0, time=0.0):
    """What stands in a texture, shape (..., 4)."""
    flat = at.reshape(-1, at.shape[-1])
    d = flat.shape[-1]
    wgsl = f"textureLoad({texture}, vec{d}i(x.{'xyz'[:d]}), {level})"
    got = probe(wgsl, flat, imports=["bindings"], params=params, time=time)
    return got.astype(np.float64).reshape(*at.shape[:-1], 4)


# Scoped so that the tests of one noise run together: the last one baked is kept.
@pytest.fixture(scope="module", params=NOISES)
def noise_params(request):
    return nubis.Params().with_(**{"clouds.noise": request.param, "clouds.seed": SEED})


@pytest.mark.slow_after(1)
def test_base_shape(rng, noise_params):
    at = rng.integers(0, ref64_noise.SHAPE_SIZE, (3000, 3))
    expected = ref64_noise.bakes(noise_params)["shape_noise"](at)
    got = texels("shape_noise", at, noise_params)[:, :1]
    np.testing.assert_allclose(got, expected, atol=STEP + 1e-5)
    # It varies, or it could be anything.
    assert expected.std() > 0.1


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("share", [0.0, 0.6, 1.0])
def test_detail(rng, noise_params, share, level):
    """It lies in one texture with the detail, as far as both together stay within 0 to 1."""
    params = noise_params.with_(**{"clouds.fine_detail": share})
    bake, size = ref64_noise.detail_bake(params.clouds), ref64_noise.FINER_SIZE
    at = rng.integers(0, size >> level, (1500 >> 3 * level, 3))
    expected = ref64_noise.mip(bake, at, level)
    got = texels("detail_noise", at, params, level)[:, :1]
    np.testing.assert_allclose(got, expected, atol=(level + 3) * STEP)
    assert expected.std() > 0.03


def test_curl_noise(rng, noise_params):
    at = rng.integers(0, ref64_noise.CURL_SIZE, (3000, 2))
    expected = ref64_noise.curl_texels(at, noise_params.clouds)
    got = texels("curl_noise", at, noise_params)[:, :2]
    assert expected.std(axis=0).min() > 0.1
    # A little passes 1, where the step is twice as large.
    np.testing.assert_allclose(got, expected, atol=2 * STEP)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize(
    "weather",
    [
        {},
        {"extent": 33_333.3, "scale": 2100.0, "variety": 0.9, "seed": SEED},
        {"extent": 20_000.0, "scale": 60_000.0, "variety": 0.0},
        {"noise": "worley_simplex", "type_variety": 1.7},
        {"noise": "worley_simplex", "extent": 33_333.3, "scale": 2100.0, "seed": SEED},
        {"noise": "perlin_worley", "seed": SEED},
        {"map": np.random.default_rng(3).uniform(0, 1, (5, 7, 3))},
    ],
    ids=[
        "default",
        "many cells",
        "one cell",
        "simplex",
        "simplex, many cells",
        "perlin_worley",
        "of your own",
    ],
)
def test_weather_map(rng, weather):
    params = nubis.Params().with_(**{f"weather.{name}": value for name, value in weather.items()})
    at = rng.integers(0, [7, 5] if "map" in weather else ref64_noise.WEATHER_SIZE, (3000, 2))
    expected = ref64_noise.weather_texels(at, params.weather)
    got = texels("weather_map", at, params)[:, :3]
    assert expected.std(axis=0).min() > 0.03
    np.testing.assert_allclose(got, expected, atol=STEP + 1e-5)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize(
    ("time", "high"),
    [
        (0.0, {}),
        (12_345.6, {"octaves": 1, "stretch": 1.0}),
        (1e9, {"octaves": 8, "stretch": 1.5, "texture_size": 333}),
        (-1e9, {"octaves": 8, "stretch": 7.3, "seed": SEED, "evolution": 0.3}),
        (2.6e6, {"octaves": 3, "type": 1.0, "stretch": 1.0}),
        (-77.7, {"octaves": 5, "type": 1.0, "evolution": 0.02, "seed": SEED, "stretch": 16.0}),
        (1e9, {"octaves": 5, "type": 0.35, "texture_size": 444}),
    ],
)
def test_high_cloud_map(rng, time, high):
    params = nubis.Params().with_(**{f"high_clouds.{name}": value for name, value in high.items()})
    at = rng.integers(0, params.high_clouds.texture_size, (3000, 2))
    expected = ref64_noise.high_texels(at, params.high_clouds, time)
    got = texels("high_map", at, params, time=time)[:, :1]
    assert expected.std() > 0.05
    # The swirl moves points off the centres of texels, where f32 has 2^-24 of a tile: 1e-4 of the
    # finest cell. No time is more than 1/512 of the smallest octave's life from a texture's.
    rounded = 2e-3 if time else 0.0
    np.testing.assert_allclose(got, expected, atol=STEP + 1e-4 + rounded)


@pytest.mark.parametrize("clouds", [(0.5, 0.5, 1.0), (0.03, 0.9, 1.0), (0.8, 0.2, 0.4)])
def test_weather_of_a_texel(rng, clouds):
    names = ["clouds.coverage", "clouds.type", "clouds.precipitation"]
    params = nubis.Params().with_(**dict(zip(names, clouds, strict=True)))
    texel = ref64_noise.f32(rng.uniform(0, 1, (2000, 3)))
    fields = ("coverage", "kind", "precipitation")
    wgsl = ", ".join(f"weather_from_map(x.xyz).{field}" for field in fields)
    got = probe(f"vec4f({wgsl}, 0.0)", texel, imports=["density"], params=params)
    expected = ref64_noise.weather_from_map(texel, params.clouds)
    np.testing.assert_allclose(got[:, :3].T, expected, atol=1e-6)


def any_sky(rng, params):
    """Parameters of everything that shapes the field; fairly cloudy, so that there is a field."""

    def log_uniform(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    base = rng.uniform(300, 3000)
    return params.with_(
        **{
            "clouds.coverage": rng.uniform(0.7, 1),
            "clouds.type": rng.uniform(0.2, 1),
            "clouds.precipitation": rng.uniform(0, 1),
            "clouds.base": base,
            "clouds.top": base + rng.uniform(1000, 6000),
            "clouds.cumulonimbus_top": base + rng.uniform(3000, 8000),
            "clouds.anvil": rng.uniform(0, 1),
            "clouds.extinction": log_uniform(0.01, 1),
            "clouds.shape_scale": log_uniform(1000, 20_000),
            "clouds.detail_scale": log_uniform(100, 2000),
            "clouds.detail": rng.uniform(0.1, 0.6),
            "clouds.fine_detail": rng.choice([0.0, 0.5, 1.0]),
            "clouds.curl_scale": log_uniform(500, 5000),
            "clouds.curl": rng.uniform(20, 300),
            "weather.extent": log_uniform(10_000, 100_000),
            "weather.scale": log_uniform(1000, 10_000),
            "weather.variety": rng.uniform(0, 1),
            "weather.broad_variety": rng.uniform(0.1, 1),
            "weather.broad_extent": log_uniform(100_000, 1_000_000),
            "weather.seed": int(rng.integers(2**32)),
            "wind.direction": rng.uniform(-360, 360),
            "wind.speed": rng.uniform(-30, 30),
            "wind.detail_direction": rng.uniform(-360, 360),
            "wind.detail_speed": rng.uniform(-30, 30),
            "wind.shear": rng.uniform(-2000, 2000),
            "wind.updraft": rng.uniform(-3, 3),
            "wind.weather_direction": rng.uniform(-360, 360),
            "wind.weather_speed": rng.uniform(-30, 30),
            "wind_variation.wind": rng.uniform(0, 1),
            "wind_variation.coverage": rng.uniform(0, 0.2),
            "wind_variation.period": log_uniform(600, 30_000),
            "wind_variation.seed": int(rng.integers(2**32)),
            "weather.clear_at": tuple(rng.uniform(-60_000, 60_000, 2)),
            "weather.clear_radius": log_uniform(3000, 30_000),
            "atmosphere.planet_radius": log_uniform(400_000, 6_371_000),
            # Not part of the field, and dear to bake for every time.
            "high_clouds.coverage": 0.0,
        }
    )


def points_about_the_shell(rng, params, n):
    """Three in four inside, the others around its base and its top, from metres to kilometres
    away; the first at the edge of it all, since positions go to the GPU relative to it.
    """
    base, top = ref64.shell(params)
    heights = rng.uniform(base, top, n)
    edge = slice(0, None, 4)
    away = rng.choice([-1, 1], n) * 10 ** rng.uniform(0, 3, n)
    heights[edge] = (rng.choice([base, top], n) + away)[edge]
    level = np.zeros((n, 3))
    level[:, :2] = rng.uniform(-60_000, 60_000, (n, 2))
    level[0, :2] = 60_000
    return ref64.raised(level, params.atmosphere.planet_radius, heights), heights


def added(rng, kind):
    """What a sky has besides a deck of clouds and a wind."""
    return {
        "plain": {},
        "dry": {"clouds.precipitation": 0.0, "weather.broad_variety": 0.0},
        "own map": {"weather.map": rng.uniform(0.2, 1, (6, 9, 3))},
        "own maps": {
            "weather.map": rng.uniform(0.2, 1, (6, 9, 3)),
            "weather.broad_map": rng.uniform(0, 1, (4, 3, 3)),
        },
        "decks": {
            "upper_clouds.coverage": rng.uniform(0.4, 0.9),
            "upper_clouds.type": rng.uniform(0, 1),
            "upper_clouds.base": 9000.0,
            "upper_clouds.top": 9000.0 + rng.uniform(500, 3000),
            "upper_clouds.extinction": rng.uniform(0.01, 1),
            "upper_clouds.scale": rng.uniform(0.3, 2),
            "upper_clouds.direction": rng.uniform(-360, 360),
            "upper_clouds.speed": rng.uniform(-30, 30),
            "upper_clouds.shear": rng.uniform(-2000, 2000),
        },
        "shafts": {
            "clouds.precipitation": rng.uniform(0.6, 1),
            "clouds.rain_extinction": rng.uniform(0.001, 0.1),
            "upper_clouds.coverage": 0.6,
            "upper_clouds.base": 9500.0,
            "upper_clouds.top": 11_000.0,
        },
        "table": {"clouds.profile": rng.uniform(0.3, 1, (5, 4))},
        "heaped": {"clouds.field": "heaped"},
        "heaped decks": {
            "clouds.field": "heaped",
            "clouds.precipitation": 0.9,
            "clouds.rain_extinction": 0.02,
            "upper_clouds.coverage": 0.7,
            "upper_clouds.base": 9500.0,
            "upper_clouds.top": 11_000.0,
            "upper_clouds.scale": 0.6,
        },
        "heaped table": {
            "clouds.field": "heaped",
            "clouds.profile": np.random.default_rng(3).uniform(0.6, 1, (5, 4)),
        },
    }[kind]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("seed", "time", "kind", "edge"),
    [
        (1, 0.0, "plain", "repeat"),
        (2, 1e5, "dry", "mirror"),
        (3, 1e9, "plain", "repeat"),
        (4, -1e7, "own map", "mirror"),
        (5, 1e4, "own maps", "clamp"),
        (6, 1e8, "decks", "repeat"),
        (7, -1e5, "shafts", "mirror"),
        (8, 1e3, "table", "repeat"),
        (9, -3e3, "plain", "clamp"),
        (10, 0.0, "heaped", "repeat"),
        (11, 1e4, "heaped decks", "repeat"),
        (12, -1e3, "heaped table", "mirror"),
    ],
)
def test_extinction(renderer, noise_params, seed, time, kind, edge):
    """The whole field, twice: with the ref64's own texels, and with those on the GPU.

    Errors are shares of the extinction at density 1.

    - With the GPU's texels what is left is f32: positions to two or three centimetres 170 km from
      the first point, seen where the detail is finest or the profile steepest. In 32 such skies up
      to 7e-4 (mean square 4e-5), or 2e-3 (1e-4) with the filter weights in steps of 1/256 that GPUs
      may have. The finer detail, whose tiles are as little as 20 m wide, makes 7e-3 of that.
    - With its own texels, exact where the GPU's are half floats, each read is off by up to one
      step, 5e-4. That goes into the shape as it is, but what it does to the type is enlarged by
      the profile, tens of times for stratus at its top. In the same skies up to 3e-3 (2e-4). The
      larger map bends the smaller one by half a tile, so that half a step of it moves what is
      read by up to 12 m: in such skies up to 3e-2 (1.4e-3).
    """
    rng = np.random.default_rng(seed)
    params = any_sky(rng, noise_params).with_(**{"weather.edge": edge})
    params = params.with_(**added(rng, kind))
    points, heights = points_about_the_shell(rng, params, 1000)
    # The ref64 follows each swing: ten thousand at most.
    period = max(params.wind_variation.period, abs(time) / 1e4)
    params = params.with_(**{"wind_variation.period": period})
    deck = params.upper_clouds
    largest = max(
        params.clouds.extinction,
        params.clouds.rain_extinction,
        deck.extinction if deck.coverage > 0 else 0.0,
    )
    got = renderer().density(points, params, time=time) / largest
    base, top = ref64.shell(params)
    inside = (heights > base) & (heights < top)
    assert (got[inside] > 0).mean() > 0.02 and (got[~inside] == 0).all()

    bakes = ref64_noise.bakes(params)
    on_gpu = {name: lambda at, name=name: texels(name, at, params, time=time) for name in bakes}
    bent = params.weather.broad_variety > 0 and params.weather.map is None
    own = (bakes, 5e-2, 3e-3) if bent else (bakes, 5e-3, 4e-4)
    # Half a step of the noise is a tenth of a narrow edge.
    if params.clouds.field == "heaped":
        own = (bakes, 0.2, 8e-3)
    for textures, worst, typical in ((on_gpu, 1e-2, 4e-4), own):
        expected = ref64_noise.Field(params, time, textures).extinction(points)
        error = got - expected / largest
        assert np.abs(error).max() < worst
        assert np.sqrt(np.mean(error**2)) < typical
