"""The kinds of cloud: types by their profiles, cumulonimbus, rain, a second deck, and a weather
that does not repeat.
"""

import math

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe
from ref64_noise import gradients, height_profile


def even(kind, **changes):
    """One weather everywhere, of one type."""
    return nubis.Params().with_(
        **{
            "weather.map": np.full((1, 1, 3), [0.75, kind, 1.0]),
            "clouds.coverage": 0.5,
            "clouds.type": 0.5,
            "wind.shear": 0.0,
            "clouds.detail": 0.0,
            **changes,
        }
    )


def density_by_height(renderer, rng, params, heights, n=3000, reach=20_000.0):
    """The mean density at altitudes over the ground around the origin."""
    points = np.zeros((len(heights), n, 3))
    points[..., :2] = rng.uniform(-reach, reach, (1, n, 2))
    raised = [
        ref64.raised(p, params.atmosphere.planet_radius, h)
        for p, h in zip(points, heights, strict=True)
    ]
    extinction = renderer().density(np.concatenate(raised), params)
    return extinction.reshape(len(heights), n).mean(axis=1) / params.clouds.extinction


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("kind", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_types_stand_where_their_gradients_say(renderer, rng, kind):
    """nubis2015, figure 4.10: nothing where the gradient is 0, most where it is 1, and the more of
    it the more cloud.
    """
    params = even(kind)
    clouds = params.clouds
    share = (np.arange(60) + 0.5) / 60
    got = density_by_height(renderer, rng, params, clouds.base + share * (clouds.top - clouds.base))
    profile = height_profile(share, np.full(60, kind), clouds)
    assert (got[profile == 0] == 0).all()
    assert got[profile > 0.99].min() > 0.05
    # Coverage of 0.75 leaves what is above a quarter; the noise is higher here than there.
    assert np.corrcoef(got, np.clip(profile - 0.25, 0, None))[0, 1] > 0.9
    # Stratus is low, cumulus tall.
    tops = [share[height_profile(share, np.full(60, k), clouds) > 0.3].max() for k in (0, kind, 1)]
    assert tops[0] <= tops[1] <= tops[2]


def test_types_are_continuous(renderer, rng):
    """A quarter of a step in type is a quarter of a step in cloud; a jump would stay as large."""
    heights = np.linspace(1250, 3150, 30)
    state = rng.bit_generator.state

    def profile(kind):
        rng.bit_generator.state = state
        return density_by_height(renderer, rng, even(float(kind)), heights, n=300)

    def largest_step(kinds):
        return np.abs(np.diff([profile(kind) for kind in kinds], axis=0)).max()

    assert np.abs(profile(0) - profile(1)).max() > 0.1
    assert largest_step(np.linspace(0, 1, 161)) < 0.4 * largest_step(np.linspace(0, 1, 41)) < 0.08


@pytest.mark.parametrize("name", ["stratus", "stratocumulus", "cumulus"])
def test_gradients_of_your_own(renderer, rng, name):
    """vsu2022: the four numbers of a gradient say where its type begins and ends."""
    kind = {"stratus": 0.0, "stratocumulus": 0.5, "cumulus": 1.0}[name]
    edges = (0.4, 0.5, 0.6, 0.7)
    params = even(kind, **{f"clouds.{name}": edges})
    clouds = params.clouds
    share = (np.arange(50) + 0.5) / 50
    got = density_by_height(renderer, rng, params, clouds.base + share * (clouds.top - clouds.base))
    assert (got[(share < 0.4) | (share > 0.7)] == 0).all()
    assert (got[(share > 0.48) & (share < 0.62)] > 0.02).all()
    other = [g for g in gradients(clouds) if tuple(np.round(g, 6)) == edges]
    assert len(other) == 1


def test_a_table_reads_like_a_picture(renderer, rng):
    """Row 0 at the tops, column 0 type 0: cloud only where the table has it."""
    table = np.zeros((10, 3))
    table[2:4, 0] = 1  # stratus between 0.65 and 0.8 of the height
    table[6:8, 2] = 1  # cumulus between 0.2 and 0.35
    for kind, low, high in ((0.0, 0.55, 0.9), (1.0, 0.1, 0.45)):
        params = even(kind, **{"clouds.profile": table})
        clouds = params.clouds
        share = (np.arange(50) + 0.5) / 50
        got = density_by_height(
            renderer, rng, params, clouds.base + share * (clouds.top - clouds.base)
        )
        middle = 0.5 * (low + high)
        assert (got[(share < low) | (share > high)] == 0).all()
        assert (got[np.abs(share - middle) < 0.05] > 0.02).all()
    nothing = even(0.5, **{"clouds.profile": np.zeros((1, 1))})
    assert (density_by_height(renderer, rng, nothing, np.linspace(1300, 3100, 9)) == 0).all()


def test_a_table_that_samples_the_gradients_changes_little(renderer, rng):
    """The looked-up profile against the analytic one: 256 rows, 33 types."""
    params = nubis.Params()
    height, kind = np.meshgrid(np.linspace(1, 0, 256), np.linspace(0, 1, 33), indexing="ij")
    table = height_profile(height.ravel(), kind.ravel(), params.clouds).reshape(height.shape)
    points = rng.uniform((-20_000, -20_000, 1200), (20_000, 20_000, 3200), (20_000, 3))
    analytic, looked_up = (
        renderer().density(points, p) for p in (params, params.with_(**{"clouds.profile": table}))
    )
    assert (analytic > 0).mean() > 0.01
    assert np.sqrt(np.mean((analytic - looked_up) ** 2)) < 0.02 * params.clouds.extinction


def storm_params(**changes):
    """A shower in the middle, ever less rain around it, and no cloud besides."""
    y, x = np.mgrid[-1:1:128j, -1:1:128j] * 30
    rain = np.exp(-((x**2 + y**2) / 9**2))
    weather = np.stack([0 * rain, 0 * rain + 0.5, rain], axis=-1)
    return nubis.Params().with_(
        **{
            "weather.map": weather,
            "clouds.coverage": 0.4,
            "clouds.precipitation": 1.0,
            "wind.shear": 0.0,
            **changes,
        }
    )


def cloud_by_distance(renderer, rng, params, altitude, edges):
    """The share of cloud in rings around the middle."""
    n = 4000
    radius = rng.uniform(0, edges[-1], n)
    angle = rng.uniform(0, 2 * math.pi, n)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * radius], axis=-1)
    points = ref64.raised(points, params.atmosphere.planet_radius, altitude)
    cloudy = renderer().density(points, params) > 0
    ring = np.digitize(radius, edges)
    return np.array([cloudy[ring == i].mean() for i in range(len(edges))])


def test_cumulonimbus_reach_eight_kilometres(renderer, rng):
    """nubis2015: with precipitation they fill the height from the base to 8 km, in the core of the
    rain alone; where it is dry the tops stay at `clouds.top`, and lower precipitation builds less.
    """
    params = storm_params()
    altitudes = np.arange(1500, 8000, 500)
    core = density_by_height(renderer, rng, params, altitudes, n=400, reach=1500.0)
    assert (core[altitudes < 7500] > 0.1).all() and core[-1] >= 0
    above = density_by_height(renderer, rng, params, [8005.0, 9000.0], n=400, reach=1500.0)
    assert (above == 0).all()
    # Without the anvil, 15 km away, where a sixteenth of the rain falls.
    bare = storm_params(**{"clouds.anvil": 0.0})
    assert cloud_by_distance(renderer, rng, bare, 5000.0, [3000, 14_000, 18_000])[2] == 0
    weak = storm_params(**{"clouds.precipitation": 0.45})
    assert (density_by_height(renderer, rng, weak, [5000.0], n=400, reach=1500.0) == 0).all()


def test_anvils_spread(renderer, rng):
    """More, farther; at their own height alone."""
    rings = [2000, 6000, 9000, 12_000]
    cover = np.array(
        [
            cloud_by_distance(renderer, rng, storm_params(**{"clouds.anvil": anvil}), 7000.0, rings)
            for anvil in (0.0, 0.5, 1.0)
        ]
    )
    assert (cover[:, 0] > 0.9).all()
    assert (
        cover[0, 2] < 0.05 < cover[1, 2] + cover[1, 1]
        and cover[2, 2] > cover[1, 2] + 0.3
        and cover[2, 3] > cover[1, 3] + 0.05
    )
    below = cloud_by_distance(renderer, rng, storm_params(**{"clouds.anvil": 1.0}), 5000.0, rings)
    assert below[3] < 0.02


def test_rain_falls_below_the_clouds(renderer, rng):
    """Where it rains, down to the ground, less the lower; none without, and none in dry air."""
    params = storm_params(**{"clouds.rain_extinction": 0.002})
    heights = [1150.0, 700.0, 300.0, 5.0]
    rain = density_by_height(renderer, rng, params, heights, n=2000, reach=2500.0)
    rain *= params.clouds.extinction / params.clouds.rain_extinction
    assert (np.diff(rain) < 0).all() and rain[-1] > 0.1 and rain[0] < 1
    under = density_by_height(renderer, rng, params, [-5.0], n=500, reach=2500.0)
    assert (under == 0).all()
    aside = np.array([[20_000.0, 0, 600], [0, 22_000.0, 600]])
    assert (renderer().density(aside, params) == 0).all()
    hidden = storm_params()
    assert (density_by_height(renderer, rng, hidden, heights, n=500, reach=2500.0) == 0).all()


def test_rain_falls(renderer, rng):
    """At 7.4 m/s where no wind blows: what was here is below a minute later, and another streak is
    here in time.
    """
    still = {f"wind.{kind}speed": 0.0 for kind in ("", "detail_", "weather_")} | {
        "wind.updraft": 0.0
    }
    params = storm_params(**{"clouds.rain_extinction": 0.002, **still})
    points = rng.uniform((-2000, -2000, 650), (2000, 2000, 1150), (2000, 3))
    seconds = 60.0
    before = renderer().density(points, params)
    below = renderer().density(points - [0, 0, 7.4 * seconds], params, time=seconds)
    # Only that it thins out on its way, by at most a third.
    wet = before > 1e-4
    assert wet.mean() > 0.3
    assert np.corrcoef(before[wet], below[wet])[0, 1] > 0.95
    # Streaks are kilometres long.
    same_place = renderer().density(points, params, time=1500.0)
    assert np.corrcoef(before[wet], same_place[wet])[0, 1] < 0.8


def test_rain_darkens_the_base(renderer):
    """nubis2015: the absorption gain, of the same cloud."""
    camera = nubis.Camera.look_at((0, 0, 100), (0, 300, 1000), (0, 1, 0), 60.0)
    # As thick with rain as without.
    same = {"clouds.cumulonimbus_top": 3200.0, "light.model": "nubis2015", "light.absorption": 0.02}
    dark, bright = (
        renderer(16, 12).render(
            camera, storm_params(**same, **{"light.rain_absorption": gain}), background=None
        )
        for gain in (5.0, 1.0)
    )
    assert bright[..., 3].mean() > 0.5
    np.testing.assert_array_equal(dark[..., 3], bright[..., 3])
    assert dark[..., :3].mean() < 0.9 * bright[..., :3].mean()


DECKS = {"upper_clouds.coverage": 0.6, "clouds.coverage": 0.5}


def test_two_decks(renderer, rng):
    """Each between its own base and top, nothing between them, and either alone as it is with the
    other.
    """
    params = nubis.Params().with_(**DECKS)
    deck = params.upper_clouds
    heights = [2000.0, 3250.0, 4000.0, 4750.0, 5000.0, 5650.0]
    both = density_by_height(renderer, rng, params, heights)
    assert both[0] > 0 and both[4] > 0
    assert (both[[1, 2, 3, 5]] == 0).all()
    points = rng.uniform((-9000, -9000, 1200), (9000, 9000, 5600), (20_000, 3))
    field = {
        name: renderer().density(points, params.with_(**changes))
        for name, changes in (
            ("both", {}),
            ("lower", {"upper_clouds.coverage": 0.0}),
            ("upper", {"clouds.coverage": 0.0}),
        )
    }
    np.testing.assert_allclose(field["both"], field["lower"] + field["upper"], rtol=1e-5)
    assert (field["lower"] > 0).any() and field["upper"].max() <= deck.extinction * (1 + 1e-6)


@pytest.mark.parametrize("time", [0.0, 3600.0])
def test_the_upper_deck_has_its_own_wind(renderer, rng, time):
    """It drifts by its own direction and speed, the deck below by others; in an hour too."""
    still = {
        "wind.speed": 0.0,
        "wind.detail_speed": 0.0,
        "wind.weather_speed": 0.0,
        "wind.updraft": 0.0,
    }
    moving = {"upper_clouds.direction": 90.0, "upper_clouds.speed": 12.0}
    # The larger map drifts with the weather below.
    params = nubis.Params().with_(**DECKS, **still, **moving, **{"weather.broad_variety": 0.0})
    upper = rng.uniform((-5000, -5000, 4900), (5000, 5000, 5500), (3000, 3))
    lower = rng.uniform((-5000, -5000, 1300), (5000, 5000, 3100), (3000, 3))
    radius = params.atmosphere.planet_radius
    heights = ref64.altitude(upper, radius)
    places = ref64.on_chart(upper, radius) + time * 12.0 * np.array([1.0, 0])
    drifted = ref64.from_chart(places, radius, heights)
    before, after = (
        renderer().density(upper, params),
        renderer().density(drifted, params, time=time),
    )
    assert (before > 0).mean() > 0.02
    assert np.sqrt(np.mean((after - before) ** 2)) < 0.01 * before.std() + 1e-9
    np.testing.assert_array_equal(
        renderer().density(lower, params), renderer().density(lower, params, time=time)
    )


@pytest.mark.slow
def test_decks_in_pictures(renderer):
    """A mean depth in the deck that is seen: from below, between and above."""
    params = nubis.Params().with_(
        **{
            "upper_clouds.coverage": 1.0,
            "upper_clouds.extinction": 0.5,
            "clouds.coverage": 0.0,
            "high_clouds.coverage": 0.0,
        }
    )
    for eye, target, low, high in (
        ((0, 0, 100), (0, 1, 5000), 4700, 5500),
        ((0, 0, 4000), (0, 1, 5000), 800, 1600),
        ((0, 0, 9000), (0, 1, 5000), 3400, 4200),
    ):
        camera = nubis.Camera.look_at(eye, target, (0, 1, 0), 10.0)
        depth = renderer(8, 8).render_layers(camera, params)["depth"]
        seen = depth[np.isfinite(depth)]
        assert len(seen) > 32 and (seen > low).all() and (seen < high).all()


def coverage_at(points, params):
    expression = (
        "vec4f(weather_texel(frame.sky.weather_origin, x.xy, large_scale_weather(x.xy)), 0.0)"
    )
    padded = np.hstack([points, np.zeros((len(points), 2))])
    return probe(expression, padded, imports=["density"], params=params)[:, 0].astype(np.float64)


def test_the_weather_does_not_repeat(rng):
    """Within the horizon of the clouds, 200 km around, no tile of the map is like the one next to
    it or any other: coverage here and there has little in common, and without the larger map
    are the same.
    """
    params = nubis.Params()
    extent = params.weather.extent
    points = rng.uniform(-100_000, 100_000, (4000, 2))
    alone = params.with_(**{"weather.broad_variety": 0.0})
    lags = [(x, y) for x in range(-3, 4) for y in range(-3, 4) if (x, y) > (0, 0)]
    correlations = []
    for lag in lags:
        there = points + extent * np.array(lag)
        a, b = (coverage_at(p, params) for p in (points, there))
        correlations.append(np.corrcoef(a, b)[0, 1])
        np.testing.assert_allclose(coverage_at(points, alone), coverage_at(there, alone), atol=0.02)
    assert np.max(correlations) < 0.5 and np.mean(correlations) < 0.4
    assert a.std() > 0.1


def test_a_larger_map_of_your_own(rng):
    """0.5 leaves the map as it is; more is more. It bends nothing."""
    own = rng.uniform(0.2, 0.8, (6, 6, 3))
    broad = np.full((2, 2, 3), 0.5)
    params = nubis.Params().with_(**{"weather.map": own, "weather.broad_map": broad})
    points = rng.uniform(-30_000, 30_000, (500, 2))
    plain = coverage_at(points, params.with_(**{"weather.broad_map": None}))
    np.testing.assert_array_equal(coverage_at(points, params), plain)
    more = params.with_(**{"weather.broad_map": broad + 0.25, "weather.broad_variety": 0.4})
    np.testing.assert_allclose(coverage_at(points, more), plain + 0.1, atol=2e-3)
