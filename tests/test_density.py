"""The cloud field: the published formulas in float64, where there is cloud and where not, seeds,
wind and maps.
"""

import math

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe
from ref64_noise import base_shape, eroded, gradients, height_profile, with_coverage

UNIT = np.linspace(0, 1, 11)


def grid(*axes):
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))


@pytest.mark.parametrize(
    "edges",
    [{}, {"clouds.stratus": (0.0, 0.3, 0.3, 0.4), "clouds.cumulus": (0.2, 0.5, 0.6, 0.9)}],
)
def test_height_profile(edges):
    """By the published gradients, and by others (vsu2022: three of the user's)."""
    params = nubis.Params().with_(**{"clouds.precipitation": 1.0, **edges})
    inputs = grid(np.linspace(-0.1, 1.1, 61), UNIT, [0.0, 0.3, 1.0])
    profile = "height_profile(x.x, x.y, x.z)"
    got = probe(profile, inputs, imports=["density"], params=params)[:, 0]
    height, kind, tower = inputs.T
    np.testing.assert_allclose(got, height_profile(height, kind, params.clouds, tower), atol=2e-4)
    for kind, (a, b, c, d) in zip((0, 0.5, 1), gradients(params.clouds), strict=True):
        ends = probe(
            profile,
            [(a, kind, 0), (0.5 * (b + c), kind, 0), (d, kind, 0)],
            imports=["density"],
            params=params,
        )
        np.testing.assert_allclose(ends[:, 0], [0, 1, 0], atol=1e-5)


def test_base_shape(rng):
    noise = rng.uniform(0, 1, (500, 4))
    got = probe("base_shape(x)", noise, imports=["gradient_noise"])[:, 0]
    np.testing.assert_allclose(got, base_shape(noise.astype(np.float32)), rtol=1e-5)


def test_coverage_of_a_shape():
    inputs = grid(UNIT, np.concatenate([UNIT, [1e-3, 0.999]]))
    got = probe("with_coverage(x.x, x.y)", inputs, imports=["density"])[:, 0]
    np.testing.assert_allclose(got, with_coverage(*inputs.T), atol=1e-5)
    assert (got[inputs[:, 1] == 0] == 0).all()
    np.testing.assert_allclose(got[inputs[:, 1] == 1], inputs[inputs[:, 1] == 1, 0], atol=1e-6)


@pytest.mark.parametrize("depth", [0.0, 0.2, 1.0])
def test_erosion(depth):
    params = nubis.Params().with_(**{"clouds.detail": depth})
    inputs = grid(UNIT, UNIT, [0.0, 0.03, 0.1, 0.7])
    got = probe("eroded(x.x, x.y, x.z)", inputs, imports=["density"], params=params)[:, 0]
    if depth == 1:
        # Where nothing is left of the range, either side of the step is right.
        clear = np.abs(inputs[:, 0] - 1) > 1e-3
        inputs, got = inputs[clear], got[clear]
        assert np.isfinite(got).all()
    # remap of a range without width is a division by zero in the published form.
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = eroded(*inputs.T, depth)
    proper = np.isfinite(expected)
    np.testing.assert_allclose(got[proper], expected[proper], atol=1e-5)


FIELDS = ("coverage", "kind", "precipitation")
WEATHER = f"vec4f({', '.join(f'weather_from_map(x.xyz).{field}' for field in FIELDS)}, 0.0)"


def local_weather(texels, **clouds):
    params = nubis.Params().with_(**{f"clouds.{name}": value for name, value in clouds.items()})
    return probe(WEATHER, texels, imports=["density"], params=params)[:, :3].T


def test_coverage_shifts_the_map():
    """vsu2022: 0 is clear, 0.5 the map as it is, 1 overcast, and more is never less."""
    texels = grid(UNIT, [0.5], [0.0])
    levels = [local_weather(texels, coverage=c, type=0.5)[0] for c in (0, 0.25, 0.5, 0.75, 1)]
    np.testing.assert_array_equal(levels[0], 0)
    np.testing.assert_allclose(levels[2], texels[:, 0], atol=1e-6)
    np.testing.assert_array_equal(levels[4], 1)
    assert (np.diff(levels, axis=0) >= 0).all()
    assert (np.diff(levels, axis=1) >= 0).all()


def test_type_shifts_the_map():
    texels = grid([0.5], UNIT, [0.0])
    kinds = [local_weather(texels, type=t, coverage=0.5)[1] for t in (0, 0.5, 1)]
    np.testing.assert_array_equal(kinds[0], 0)
    np.testing.assert_allclose(kinds[1], texels[:, 1], atol=1e-6)
    np.testing.assert_array_equal(kinds[2], 1)


def test_rain_brings_cloud():
    """nubis2015: where precipitation is 1, coverage is at least 0.7 and the type pushed toward
    cumulonimbus.
    """
    texels = grid([0.0, 0.5, 1.0], [0.0, 0.5], [1.0])
    coverage, kind, rain = local_weather(texels, coverage=0.5, type=0.5, precipitation=1.0)
    assert coverage.min() >= 0.7 - 1e-6
    assert (kind > texels[:, 1]).all()
    np.testing.assert_allclose(rain, 1)
    # A dry sky ignores the map's rain, and a clear one stays clear.
    assert (local_weather(texels, coverage=0.5, type=0.5, precipitation=0.0)[2] == 0).all()
    assert (local_weather(texels, coverage=0.0, precipitation=1.0)[0] == 0).all()


def cloudy_params(**changes):
    """One weather everywhere, so that only the noises say where there is cloud."""
    return nubis.Params().with_(
        **{"clouds.coverage": 0.5, "weather.map": np.full((1, 1, 3), [0.8, 0.6, 0.0]), **changes}
    )


def points_in_shell(rng, params, n, reach):
    points = np.zeros((n, 3))
    points[:, :2] = rng.uniform(-reach, reach, (n, 2))
    heights = rng.uniform(params.clouds.base, params.clouds.top, n)
    return ref64.raised(points, params.atmosphere.planet_radius, heights), heights


@pytest.mark.parametrize("time", [0.0, 7200.0])
def test_density_is_the_published_sampler(renderer, rng, time):
    """Everything but the texture reads in float64: wind, lean, curl, height, shape, coverage and
    erosion.
    """
    params = cloudy_params(**{"clouds.type": 0.5, "wind.weather_speed": 0.0})
    c, w = params.clouds, params.wind
    points, altitude = points_in_shell(rng, params, 4000, 30_000)
    height = (altitude - c.base) / (c.top - c.base)
    downwind = ref64.compass(w.direction)[:2]
    places = ref64.on_chart(points, params.atmosphere.planet_radius)
    at = places - (height * w.shear)[:, None] * downwind

    def moved(xy, speed):
        return np.column_stack([xy - time * speed * downwind, altitude - time * w.updraft])

    def read(texture, uvw):
        at = "x.xy" if texture == "curl_noise" else "x.xyz"
        wgsl = f"textureSampleLevel({texture}, repeat_sampler, {at}, 0.0)"
        return probe(wgsl, np.mod(uvw, 1), imports=["bindings"], params=params).astype(np.float64)

    noise = read("shape_noise", moved(at, w.speed) / c.shape_scale)[:, 0]
    swirl = read("curl_noise", moved(at, w.detail_speed)[:, :2] / c.curl_scale)[:, :2]
    swirled = at + c.curl * (1 - height[:, None]) * swirl
    at = moved(swirled, w.detail_speed) / c.detail_scale
    detail = read("detail_noise", at)[:, 0]

    profile = height_profile(height, np.full(len(height), 0.6), c)
    shape = with_coverage(noise * profile, 0.8)
    expected = eroded(shape, detail, height, c.detail) * c.extinction
    got = renderer().density(points, params, time=time)
    assert (expected > 0).mean() > 0.05
    np.testing.assert_allclose(got, expected, atol=1e-2 * c.extinction)
    assert np.sqrt(np.mean((got - expected) ** 2)) < 1e-3 * c.extinction


def test_does_not_depend_on_the_company_of_points(renderer, rng):
    """Positions go to the GPU relative to the first."""
    params = cloudy_params()
    points, _ = points_in_shell(rng, params, 300, 30_000)
    together = renderer().density(points, params)
    backward = renderer().density(points[::-1], params)[::-1]
    assert (together > 0).any()
    np.testing.assert_allclose(together, backward, atol=1e-2 * params.clouds.extinction)


def test_no_coverage_is_no_cloud(renderer, rng):
    params = nubis.Params().with_(**{"clouds.coverage": 0.0, "clouds.precipitation": 1.0})
    points, _ = points_in_shell(rng, params, 3000, 50_000)
    assert (renderer().density(points, params) == 0).all()


@pytest.mark.slow
def test_more_coverage_is_more_cloud(renderer):
    """From clear to overcast, seen from the ground; overcast hides the sky nearly everywhere."""
    camera = nubis.Camera.fisheye((0, 0, 0), fov=120)
    opacity = []
    for coverage in (0, 0.25, 0.5, 0.75, 1):
        params = nubis.Params().with_(
            **{"clouds.coverage": coverage, "clouds.extinction": 1.0, "high_clouds.coverage": 0.0}
        )
        opacity.append(renderer(48, 48).render(camera, params, background=None)[..., 3])
    y, x = np.mgrid[:48, :48] + 0.5 - 24
    inside = np.hypot(x, y) < 24
    cover = [alpha[inside].mean() for alpha in opacity]
    assert cover[0] == 0
    assert (np.diff(cover) >= 0).all()
    assert cover[1] < cover[3] and cover[2] < cover[4]
    assert (opacity[-1][inside] > 0.99).mean() > 0.98


def test_nothing_outside_the_shell(renderer, rng):
    """To 200 km away, where the ground has sunk by 3 km."""
    params = cloudy_params()
    radius, base, top = params.atmosphere.planet_radius, params.clouds.base, params.clouds.top
    level = np.zeros((2000, 3))
    level[:, :2] = rng.uniform(-150_000, 150_000, (2000, 2))
    outside = [
        ref64.raised(level, radius, h) for h in (0, 0.5 * base, base - 0.5, top + 0.5, top + 5000)
    ]
    for points in outside:
        # The first point is the origin of the others: put it in their midst.
        assert (renderer().density(np.vstack([[0, 0, base], points]), params) == 0).all()
    inside = ref64.raised(level, radius, base + 0.3 * (top - base))
    near, far = (np.hypot(*level[:, :2].T) < 75_000), (np.hypot(*level[:, :2].T) > 150_000)
    cloudy = renderer().density(inside, params) > 0
    assert cloudy[near].mean() > 0.1
    assert cloudy[far].mean() == pytest.approx(cloudy[near].mean(), rel=0.3)


def test_seeds(renderer, rng):
    """Same seeds, same bytes, also after others were baked; another seed or noise is another
    field.
    """
    params = nubis.Params().with_(**{"clouds.coverage": 0.6})
    points, _ = points_in_shell(rng, params, 4000, 60_000)

    def field(**changes):
        return renderer().density(points, params.with_(**changes))

    first = field()
    weather = field(**{"weather.seed": params.weather.seed + 1})
    shapes = field(**{"clouds.seed": params.clouds.seed + 1})
    noises = field(**{"clouds.noise": "vsu2022"})
    assert field().tobytes() == first.tobytes()
    for other in (weather, shapes, noises):
        assert other.max() > 0
        assert np.corrcoef(first, other)[0, 1] < 0.9


def test_extinction_scales_the_field(renderer, rng):
    params = cloudy_params()
    points, _ = points_in_shell(rng, params, 1000, 10_000)
    one, small = (
        renderer().density(points, params.with_(**{"clouds.extinction": k})) for k in (1.0, 0.02)
    )
    assert one.max() <= 1
    np.testing.assert_allclose(small, 0.02 * one, rtol=1e-6)


def wind_params(direction, speed, **changes):
    names = ["wind.direction", "wind.detail_direction", "wind.weather_direction"]
    speeds = ["wind.speed", "wind.detail_speed", "wind.weather_speed"]
    values = dict.fromkeys(names, direction) | dict.fromkeys(speeds, speed) | {"wind.updraft": 0.0}
    return nubis.Params().with_(**{"clouds.coverage": 0.6, **values, **changes})


@pytest.mark.parametrize(
    ("time", "speed"), [(600.0, 20.0), (86_400.0, 15.0), (1e6, 1.5), (-3600.0, 10.0)]
)
def test_wind_carries_the_field(renderer, rng, time, speed):
    """All winds alike: what was here is there, at the same height above the curved ground, after
    a minute or a month.
    """
    direction = 60.0
    params = wind_params(direction, speed)
    radius = params.atmosphere.planet_radius
    points, heights = points_in_shell(rng, params, 2000, 10_000)
    places = ref64.on_chart(points, radius) + time * speed * ref64.compass(direction)[:2]
    carried = ref64.from_chart(places, radius, heights)
    before = renderer().density(points, params)
    after = renderer().density(carried, params, time=time)
    assert (before > 0).mean() > 0.05
    assert np.sqrt(np.mean((after - before) ** 2)) < 0.01 * before.std()


@pytest.mark.parametrize("periods", [1, 200, 10**6])
def test_long_times_lose_nothing(renderer, periods):
    """After a whole number of all periods the sky is the same to the bit, high clouds too."""
    params = wind_params(
        0.0,
        10.0,
        **{
            "clouds.shape_scale": 5000.0,
            "clouds.detail_scale": 500.0,
            "clouds.curl_scale": 2500.0,
            "weather.extent": 50_000.0,
            "weather.broad_extent": 400_000.0,
            "high_clouds.scale": 50_000.0,
            "high_clouds.direction": 0.0,
            "high_clouds.speed": 10.0,
            "high_clouds.evolution": 0.0,
        },
    )
    camera = nubis.Camera.look_at((0, 0, 100), (0, 1000, 400))
    # 800 km: a whole number of tiles of each, also of the second map of the weather and of that of
    # the high clouds, 3.2 times as wide.
    period = 80_000.0
    first, later, between = (
        renderer().render(camera, params, time=t) for t in (0, periods * period, 0.5 * period)
    )
    assert later.tobytes() == first.tobytes()
    assert between.tobytes() != first.tobytes()


def test_updraft_lifts_the_shapes(renderer, rng):
    """Rising by a whole tile of the base shape changes nothing; by half a tile it does."""
    params = cloudy_params(
        **{"wind.speed": 0.0, "wind.detail_speed": 0.0, "wind.updraft": 2.0, "clouds.detail": 0.0}
    )
    scale = params.clouds.shape_scale
    points, _ = points_in_shell(rng, params, 500, 10_000)
    still = renderer().density(points, params)
    whole = renderer().density(points, params, time=scale / 2.0)
    half = renderer().density(points, params, time=scale / 4.0)
    np.testing.assert_allclose(whole, still, atol=1e-3 * params.clouds.extinction)
    assert np.abs(half - still).max() > 0.1 * params.clouds.extinction


@pytest.mark.parametrize(
    ("half", "direction"),
    [("north", (0, 1)), ("south", (0, -1)), ("east", (1, 0)), ("west", (-1, 0))],
)
def test_a_map_of_your_own(renderer, rng, half, direction):
    """Row 0 is the north edge, column 0 the west edge, and the middle of the map is the origin of
    the world.
    """
    weather = np.zeros((64, 64, 3))
    rows = {"north": np.s_[:32], "south": np.s_[32:], "east": np.s_[:, 32:], "west": np.s_[:, :32]}
    weather[rows[half]] = [1.0, 0.5, 0.0]
    extent = 40_000.0
    params = nubis.Params().with_(
        **{
            "clouds.coverage": 0.5,
            "weather.map": weather,
            "weather.extent": extent,
            "wind.shear": 0.0,
        }
    )
    points, _ = points_in_shell(rng, params, 4000, 0.5 * extent)
    side = points[:, :2] @ direction
    texel = extent / 64
    # The map is filtered and repeats: leave out a texel at its middle and at its edge.
    sure = (np.abs(side) > texel) & (np.abs(side) < 0.5 * extent - texel)
    cloudy = renderer().density(points, params) > 0
    assert not cloudy[sure & (side < 0)].any()
    assert cloudy[sure & (side > 0)].mean() > 0.3
    beyond = renderer().density(points + np.array([extent, -extent, 0]), params) > 0
    assert not beyond[sure & (side < 0)].any()


def test_a_map_of_zeros_is_clear(renderer, rng):
    params = nubis.Params().with_(**{"clouds.coverage": 0.5, "weather.map": np.zeros((3, 5, 3))})
    points, _ = points_in_shell(rng, params, 2000, 50_000)
    assert (renderer().density(points, params) == 0).all()


def test_the_weather_drifts_on_its_own_wind(renderer, rng):
    """A single cloudy texel of the map, carried by the weather's wind alone."""
    weather = np.zeros((8, 8, 3))
    weather[3:5, 3:5] = [1.0, 0.5, 0.0]
    drift = {"wind.weather_direction": 90.0, "wind.weather_speed": 10.0, "wind.shear": 0.0}
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.5, "weather.map": weather, "weather.extent": 64_000.0, **drift}
    )
    points, _ = points_in_shell(rng, params, 8000, 32_000)
    extinction = renderer().density(points, params, time=1200.0)
    centre = (points[:, :2] * extinction[:, None]).sum(axis=0) / extinction.sum()
    np.testing.assert_allclose(centre, [12_000, 0], atol=1500)
    assert math.isclose(points[extinction > 0, 0].mean(), 12_000, abs_tol=1500)
