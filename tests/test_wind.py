"""Winds: each its own direction and speed, at any time as exact as at the first second, and in
their wandering the integral of what `ref64_noise` says their velocity is.
"""

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from nubis.testing import probe

MONTH = 2.6e6  # s
# A whole number of every tile, m: the ref64 of a point may be any number of these away.
TILE = 60_000.0
WANDER = {"wind_variation.wind": 0.6, "wind_variation.coverage": 0.0, "wind_variation.seed": 5}


def alike(direction, speed, **changes):
    """All winds alike, no updraft, and tiles that come round together."""
    kinds = ("", "detail_", "weather_")
    values = {f"wind.{kind}direction": direction for kind in kinds}
    values |= {f"wind.{kind}speed": speed for kind in kinds}
    values |= {
        "wind.updraft": 0.0,
        "clouds.coverage": 0.6,
        "clouds.shape_scale": 5000.0,
        "clouds.detail_scale": 400.0,
        "clouds.curl_scale": 1500.0,
        "weather.extent": TILE,
        "weather.broad_extent": TILE,
    }
    return nubis.Params().with_(**(values | changes))


def points_of(rng, params, n, reach, low=0.0, high=1.0):
    """Random points between two heights, 0 the base and 1 the top, and their altitudes."""
    base, top = params.clouds.base, params.clouds.top
    points = np.zeros((n, 3))
    points[:, :2] = rng.uniform(-reach, reach, (n, 2))
    altitude = base + rng.uniform(low, high, n) * (top - base)
    return ref64.raised(points, params.atmosphere.planet_radius, altitude), altitude


def moved(points, way, altitude, params):
    """The points moved by a way on the chart, at the same altitude."""
    radius = params.atmosphere.planet_radius
    return ref64.from_chart(ref64.on_chart(points, radius) + np.asarray(way), radius, altitude)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


@pytest.mark.parametrize("wander", [{}, WANDER], ids=["steady", "wandering"])
@pytest.mark.parametrize("time", [1.0, 3600.0, -3600.0, MONTH])
def test_the_field_moves_by_the_wind(renderer, rng, time, wander):
    """The density at p and t is that at p - (the way of the wind) and 0, and a month is as exact
    as a second.

    The error is given in metres: the difference of the fields over how much a metre along the wind
    changes them. The way comes from f64, which keeps 1e-8 m of the 40,000 km of a month, and is
    wrapped by each noise's tile before it becomes f32: half of 2^-24 of a tile, 0.15 mm of the base
    shape and 2 mm of the weather map, which is the smoothest. Points reach the GPU in f32 relative
    to the first, up to 30 km away, and from there onto the chart: a few mm. Measured: 1 to 3 mm,
    whatever the time. The time alone, in f32, would have a month off by 2 m.
    """
    params = alike(72.0, 15.0, **wander)
    points, altitude = points_of(rng, params, 4000, 15_000)
    way = ref64_noise.blown(params, 72.0, 15.0, time)
    if wander:
        # It is another way, or this tests nothing new.
        assert np.linalg.norm(way - ref64_noise.blown(alike(72.0, 15.0), 72.0, 15.0, time)) > 1
    now = renderer().density(points, params, time=time)
    then = renderer().density(moved(points, -np.fmod(way, TILE), altitude, params), params)
    beside = renderer().density(moved(points, [0.5, 0.0], altitude, params), params, time=time)
    assert (now > 0).mean() > 0.05
    metres = rms(now - then) / (rms(beside - now) / 0.5)
    assert metres < 0.004


@pytest.mark.parametrize("wander", [{}, WANDER], ids=["steady", "wandering"])
@pytest.mark.parametrize("time", [0.0, 1.0, 86_400.0, MONTH])
def test_where_each_tile_stands(time, wander):
    """What the shaders read, for the eye at the origin: the way of each wind in tiles, without the
    whole ones, to a rounding of f32. In metres: 2^-24 of each tile.
    """
    speeds = {"wind.speed": 7.0, "wind.detail_speed": 12.5, "wind.weather_speed": 3.25}
    directions = {
        "wind.direction": 10.0,
        "wind.detail_direction": 200.0,
        "wind.weather_direction": -80.0,
    }
    params = nubis.Params().with_(**speeds, **directions, **wander)
    clouds, high = params.clouds, params.high_clouds

    def way(wind, kind=""):
        direction, speed = (getattr(wind, kind + name) for name in ("direction", "speed"))
        return ref64_noise.blown(params, direction, speed, time)

    rise = time * ref64_noise.f32(params.wind.updraft)
    along = ref64.compass(high.direction)[:2]
    at_high = way(high) @ np.column_stack([along, [-along[1], along[0]]])
    # The middle of the map is the origin, and its rows run south.
    weather = way(params.wind, "weather_") * [1, -1] - 0.5 * params.weather.extent
    expected = {
        "shape_origin": (np.append(way(params.wind), rise), clouds.shape_scale),
        "detail_origin": (np.append(way(params.wind, "detail_"), rise), clouds.detail_scale),
        "curl_origin": (way(params.wind, "detail_"), clouds.curl_scale),
        "weather_origin": (weather, params.weather.extent),
        "high_origin": (at_high, high.scale),
        "high_broad_origin": (at_high, 3.2 * high.scale),
    }
    for name, (metres, tile) in expected.items():
        n = len(metres)
        wgsl = f"vec4f(frame.sky.{name}, {', '.join(['0.0'] * (4 - n))})"
        got = probe(wgsl, [0.0], imports=["bindings"], params=params, time=time)[0, :n]
        apart = np.mod(got + metres / ref64_noise.f32(tile) + 0.5, 1) - 0.5
        # Rounding to f32, and what the ref64's own sums and sines lose of the way.
        assert (np.abs(apart) * tile < 2.0**-24 * tile + 1e-6).all(), name


def columns(params, across, rows, spacing):
    """Points of a grid of columns, shape (across^2 * rows, 3), columns outermost."""
    side = (np.arange(across) - 0.5 * (across - 1)) * spacing
    x, y = np.meshgrid(side, side, indexing="ij")
    level = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    height = (np.arange(rows) + 0.5) / rows
    altitude = params.clouds.base + height * (params.clouds.top - params.clouds.base)
    radius = params.atmosphere.planet_radius
    return np.stack([ref64.raised(level, radius, a) for a in altitude], axis=1).reshape(-1, 3)


def test_still_weather_keeps_a_sky_in_place(renderer):
    """thesis2018: without wind of its own the weather keeps its clouds where they are, seen from
    above, while their shapes are others after an hour.
    """
    params = nubis.Params().with_(**{"clouds.coverage": 0.5, "wind.shear": 0.0})
    points = columns(params, 40, 12, 500.0)

    def field(time, weather_speed):
        sky = params.with_(**{"wind.weather_speed": weather_speed})
        return renderer().density(points, sky, time=time).reshape(-1, 12)

    def alike(a, b):
        return np.corrcoef(a.ravel(), b.ravel())[0, 1]

    def silhouette(field):
        # Over 1.5 km, which is less than a cloud and more than a billow.
        mask = (field.max(axis=1) > 0).reshape(40, 40)
        return sum(np.roll(mask, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1))

    first, kept, gone = field(0.0, 0.0), field(3600.0, 0.0), field(3600.0, 8.0)
    assert 0.1 < (first.max(axis=1) > 0).mean() < 0.7
    place = alike(silhouette(first), silhouette(kept))
    assert place > 0.8
    assert alike(first, kept) < 0.7
    assert alike(silhouette(first), silhouette(gone)) < 0.3


@pytest.mark.parametrize("shear", [800.0, -300.0])
def test_tops_lean_by_the_shear(renderer, rng, shear):
    """At time 0 a leaning field is the upright one, moved downwind by the shear times the height in
    the layer.
    """
    upright = alike(30.0, 8.0, **{"wind.shear": 0.0})
    leaning = upright.with_(**{"wind.shear": shear})
    points, altitude = points_of(rng, upright, 4000, 10_000)
    clouds = upright.clouds
    height = (altitude - clouds.base) / (clouds.top - clouds.base)
    lean = np.column_stack([*(ref64.compass(30.0)[:2, None] * shear * height), np.zeros(4000)])
    expected = renderer().density(points, upright)
    there = ref64.raised(points + lean, upright.atmosphere.planet_radius, altitude)
    got = renderer().density(there, leaning)
    assert (expected > 0).mean() > 0.05
    assert rms(got - expected) < 0.005 * expected.std()
    assert rms(renderer().density(points, leaning) - expected) > 0.3 * expected.std()


@pytest.mark.parametrize("updraft", [2.0, -0.5])
def test_the_updraft_raises_the_noises(renderer, rng, updraft):
    """Between 0.15 and 0.33 of the height of stratocumulus the profile is 1, the erosion is the
    same, and without curl nothing but the noises knows the altitude: what was here is above.
    """
    still = {"wind.speed": 0.0, "wind.detail_speed": 0.0, "wind.weather_speed": 0.0}
    params = nubis.Params().with_(
        **still,
        **{
            "wind.shear": 0.0,
            "wind.updraft": updraft,
            "clouds.curl": 0.0,
            "clouds.base": 1000.0,
            "clouds.top": 21_000.0,
            "clouds.coverage": 0.5,
            "clouds.type": 0.5,
            "weather.map": np.full((1, 1, 3), [0.8, 0.5, 0.0]),
        },
    )
    points, altitude = points_of(rng, params, 3000, 8000, 0.20, 0.28)
    time = 1000.0 / abs(updraft)  # s: a kilometre
    radius = params.atmosphere.planet_radius
    above = ref64.from_chart(ref64.on_chart(points, radius), radius, altitude + updraft * time)
    before = renderer().density(points, params)
    after = renderer().density(above, params, time=time)
    assert (before > 0).mean() > 0.05
    assert rms(after - before) < 0.01 * before.std()
    assert rms(renderer().density(points, params, time=time) - before) > 0.3 * before.std()


def test_the_detail_drifts_its_own_way(renderer, rng):
    """With nothing else in motion the field is that of another time, in which the detail's wind has
    gone around its tile in another direction.
    """
    still = {"wind.speed": 0.0, "wind.weather_speed": 0.0, "wind.updraft": 0.0}
    params = nubis.Params().with_(
        **still, **{"clouds.coverage": 0.6, "clouds.curl": 0.0, "wind.detail_speed": 1.0}
    )
    tile = params.clouds.detail_scale
    points, _ = points_of(rng, params, 3000, 10_000)

    def field(direction, time):
        sky = params.with_(**{"wind.detail_direction": direction})
        return renderer().density(points, sky, time=time)

    # A quarter of a tile to the east is three quarters to the west.
    east, west, north = field(90.0, 0.25 * tile), field(-90.0, 0.75 * tile), field(0.0, 0.25 * tile)
    assert (east > 0).mean() > 0.05
    assert rms(east - west) < 0.002 * east.std()
    assert rms(east - north) > 0.05 * east.std()


@pytest.mark.slow
def test_cover_wanders_in_the_picture(renderer):
    """The picture at a time is that of the cover that the ref64 has for it, and no cover leaves
    0 to 1: at the ends of the range it is that of a clear and of an overcast sky.
    """
    still = {"wind.speed": 0.0, "wind.detail_speed": 0.0, "wind.weather_speed": 0.0}
    still |= {"wind.updraft": 0.0, "high_clouds.coverage": 0.0}
    make, camera = renderer(48, 48), nubis.Camera.fisheye((0, 0, 0), fov=120)

    def pair(swing, mean, time):
        plain = nubis.Params().with_(**still)
        changes = {
            "wind_variation.coverage": swing,
            "wind_variation.seed": 4,
            "clouds.coverage": mean,
        }
        wandering = plain.with_(**changes)
        cover = ref64_noise.cover(wandering, time)
        steady = plain.with_(**{"clouds.coverage": cover})
        pictures = (
            make.render(camera, p, time=time, background=None)[..., 3] for p in (wandering, steady)
        )
        return cover, *pictures

    covers, opacities = [], []
    for time in (0.0, 1200.0, 2400.0, 7200.0, 50_000.0, MONTH):
        cover, wandering, steady = pair(0.3, 0.45, time)
        covers.append(cover)
        opacities.append(wandering.mean())
        # f32 has the cover to 6e-8.
        np.testing.assert_allclose(wandering, steady, atol=1e-3)
    assert 0.15 <= min(covers) < 0.4 and 0.5 < max(covers) <= 0.75
    assert np.argsort(covers).tolist() == np.argsort(opacities).tolist()

    times = np.arange(0, 100_000, 600.0)
    wild = nubis.Params().with_(**{"wind_variation.coverage": 1.0, "wind_variation.seed": 4})
    ends = [ref64_noise.cover(wild, time) for time in times]
    for end, time in ((0.0, times[np.argmin(ends)]), (1.0, times[np.argmax(ends)])):
        cover, wandering, steady = pair(1.0, 0.45, time)
        assert cover == end
        assert wandering.tobytes() == steady.tobytes()
        assert wandering.max() == 0 if end == 0 else wandering.mean() > 0.5


def test_what_does_not_wander_stays(renderer):
    """A seed and a period change nothing where nothing wanders, and do where something does; the
    same seed has the same bytes.
    """
    camera, params = nubis.scenes["fair_weather"]

    def picture(**wander):
        sky = params.with_(**{f"wind_variation.{name}": value for name, value in wander.items()})
        return renderer().render(camera, sky, time=3000.0).tobytes()

    assert picture() == picture(seed=1) == picture(period=100.0)
    for name in ("wind", "coverage"):
        assert picture(**{name: 0.3}) == picture(**{name: 0.3})
        assert len({picture(**{name: 0.3}, seed=seed) for seed in (1, 2, 3)} | {picture()}) == 4


@pytest.mark.slow
def test_an_animation_of_a_wandering_wind_stays_near_the_still(renderer):
    """The reprojection follows the wind as it wanders. In a lull, where a gale of 100 m/s all but
    stands still, the error is 0.22, which is what this size has of neighbours four pixels apart;
    where the clouds are looked for as if it blew, 0.38.
    """
    gale = {f"wind.{kind}speed": 100.0 for kind in ("", "detail_", "weather_")}
    params = nubis.Params().with_(
        **gale,
        **{"wind.updraft": 0.0, "high_clouds.coverage": 0.0, "wind_variation.wind": 1.0},
    )
    rate, phase = ref64_noise.turns(params.wind_variation, 0)
    times = np.arange(0, 500_000, 60.0)
    speeds = np.abs(1 + np.exp(1j * (rate * times[:, None] + phase)).mean(axis=1))
    assert speeds.min() < 0.2
    camera, make = nubis.Camera.look_at((0, 0, 300), (0, 1000, 500)), renderer(96, 54)
    shots = [(camera, params, times[np.argmin(speeds)] + 0.5 * i) for i in range(32)]
    *_, last = make.animate(shots)
    still = make.render(camera, params, time=shots[-1][2])
    assert np.isfinite(last).all()
    assert last.mean() == pytest.approx(still.mean(), rel=0.1)
    assert ref64.relative_rmse(last[..., :3], still[..., :3]) < 0.3


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("wander", [{}, {"wind_variation.wind": 1.0}], ids=["steady", "wandering"])
def test_shadows_drift_with_the_wind(wander):
    """Those on the ground are baked every 600 m of the eye's way and every 32 m of the fastest that
    the wind may blow, and read where they have drifted to since: half way between the weather and
    the shapes.
    """
    params = nubis.Params().with_(
        **wander,
        **{"wind.direction": 90.0, "wind.speed": 20.0, "wind_variation.period": 600.0},
    )

    def drift(time):
        wind = params.wind
        shape = ref64_noise.blown(params, wind.direction, wind.speed, time)
        return 0.5 * (
            shape + ref64_noise.blown(params, wind.weather_direction, wind.weather_speed, time)
        )

    period = 32.0 / (20.0 * (1.0 + params.wind_variation.wind))
    for time in (0.0, 0.6, 333.3, 5000.1, MONTH + 0.4):
        baked = np.round(time / period) * period
        for eye, place in [((0.0, 0.0), (0.0, 0.0)), ((299.0, -1510.0), (0.0, -1800.0))]:
            got = probe(
                "vec4f(frame.sky.shadow_eye, 0.0, 0.0)",
                [0.0],
                imports=["bindings"],
                params=params,
                eye=(*eye, 100.0),
                time=time,
            )[0, :2]
            gone = got - np.subtract(eye, place)
            np.testing.assert_allclose(gone, drift(baked) - drift(time), atol=3e-5)
            assert np.linalg.norm(gone) <= 32.0
