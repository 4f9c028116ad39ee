"""A spot that is kept clear: fixed in the world, with a soft rim, whatever drifts over it."""

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from nubis.testing import probe

SPOT, RADIUS = (3000.0, -2000.0), 4000.0
CLOUDY = nubis.Params().with_(
    **{"clouds.coverage": 0.85, "clouds.extinction": 0.05, "high_clouds.coverage": 0.0}
)
CLEAR = CLOUDY.with_(**{"weather.clear_at": SPOT, "weather.clear_radius": RADIUS})


def points_around(rng, n, spot=SPOT, reach=2.5 * RADIUS, params=CLEAR):
    """Points at all heights of the clouds, and how far each is from the middle of the spot."""
    places = np.array(spot) + rng.uniform(-reach, reach, (n, 2))
    altitude = rng.uniform(params.clouds.base, params.clouds.top, n)
    points = ref64.from_chart(places, params.atmosphere.planet_radius, altitude)
    return points, np.linalg.norm(places - spot, axis=1)


@pytest.mark.parametrize("time", [0.0, 3000.0])
def test_the_spot_stays_while_the_weather_drifts(renderer, rng, time):
    """Nothing within the radius, at any height and at any time; half a radius outside all is as
    without it; less, and something, in between.
    """
    points, away = points_around(rng, 20_000)
    with_spot, without = (renderer().density(points, p, time=time) for p in (CLEAR, CLOUDY))
    inside, outside = away < RADIUS - 1, away > 1.5 * RADIUS + 1
    rim = ~inside & ~outside & (without > 0)
    assert (without[inside] > 0).mean() > 0.1 and (without[outside] > 0).mean() > 0.1
    assert (with_spot[inside] == 0).all()
    assert (with_spot[outside] == without[outside]).all()
    assert (with_spot <= without).all() and with_spot[rim].max() > 0
    assert with_spot[rim].mean() < 0.8 * without[rim].mean()
    # It has drifted, or that would be no news.
    assert (renderer().density(points, CLOUDY, time=time + 300) != without).any()


def test_the_rim(rng):
    """The share of the cover by distance: a smoothstep, in float64."""
    points, _ = points_around(rng, 2000)
    got = probe("vec4f(kept_clear(x.xy))", points, imports=["density"], params=CLEAR)[:, 0]
    expected = ref64_noise.kept_clear(points, CLEAR.weather)
    assert 0.1 < (expected == 0).mean() < 0.9 and (expected == 1).any()
    np.testing.assert_allclose(got, expected, atol=1e-5)


def test_far_from_the_origin(renderer, rng):
    """Relative to the eye in f64: 3000 km away, where f32 has steps of 25 cm, the edge of a spot of
    8 m is where it should be, to a millimetre or two.
    """
    spot = (3_000_000.0, 0.25)
    everywhere = CLOUDY.with_(
        **{
            "clouds.coverage": 1.0,
            "clouds.detail": 0.0,
            "clouds.type": 0.5,
            "weather.map": np.full((1, 1, 3), [1.0, 0.5, 0.0]),
            "atmosphere.planet_radius": 1e9,
        }
    )
    params = everywhere.with_(**{"weather.clear_at": spot, "weather.clear_radius": 8.0})
    points, away = points_around(rng, 4000, spot, 16.0, params)
    places = ref64.on_chart(points, params.atmosphere.planet_radius)
    cover = ref64_noise.kept_clear(places, params.weather)
    got = renderer().density(points, params) / params.clouds.extinction
    full = renderer().density(points, everywhere) / params.clouds.extinction
    # With full cover the shape is what `with_coverage` makes of it with less.
    expected = ref64_noise.with_coverage(full, cover)
    assert (away < 8).any() and 0.2 < (expected > 0).mean() < 0.9
    np.testing.assert_allclose(got, expected, atol=2e-3)


@pytest.mark.slow
def test_a_ray_straight_up_sees_the_sky(renderer):
    """March, reference and path tracing alike: majorants know nothing of the spot, and need not."""
    eye = (*SPOT, 0.0)
    camera = nubis.Camera.fisheye(eye, fov=150)
    y, x = np.mgrid[:32, :32] + 0.5 - 16
    zenith_angle = np.radians(75 * np.hypot(x, y) / 16)
    # What the top of the clouds over the edge of the spot is seen at, less a pixel.
    within = zenith_angle < np.arctan(RADIUS / CLEAR.clouds.top) - np.radians(5)
    around = (zenith_angle > np.radians(62)) & (zenith_angle < np.radians(74))
    paths = nubis.quality("balanced").replace(path_samples=256)
    alpha = {}
    for method, model in (("draft", "single"), ("reference", "single"), (paths, "path")):
        sky = CLEAR.with_(**{"light.model": model, "light.albedo": 0.0})
        make = renderer(32, 32, method)
        alpha[model, method] = make.render(camera, sky, background=None)[..., 3]
        assert alpha[model, method][within].max() == 0
    draft, reference, traced = (a[around].mean() for a in alpha.values())
    assert reference > 0.2
    assert draft == pytest.approx(reference, rel=0.1)
    # 256 paths of some 300 pixels: a standard error under 0.002.
    assert traced == pytest.approx(reference, abs=0.01)


def test_moving_the_spot_bakes_no_map():
    """Neither map nor majorants are made of it; where it goes, the picture follows."""
    make = nubis.Renderer(16, 9)
    camera = nubis.Camera.look_at((0, 0, 200), (0, 5000, 3000))
    pictures = []
    for changes in ({}, {"weather.clear_at": (0.0, 4000.0)}, {"weather.clear_radius": 2000.0}):
        pictures.append(make.render(camera, CLEAR.with_(**changes, **{"weather.seed": 1234})))
        assert ("weather" in make.timings) == (not changes)
    assert len({picture.tobytes() for picture in pictures}) == 3
    fresh = nubis.Renderer(16, 9).render(camera, CLEAR.with_(**changes, **{"weather.seed": 1234}))
    assert fresh.tobytes() == pictures[-1].tobytes()


def test_no_radius_is_no_spot(renderer):
    camera, params = nubis.scenes["fair_weather"]
    moved = params.with_(**{"weather.clear_at": (100.0, 5000.0)})
    first, second = (renderer().render(camera, p).tobytes() for p in (params, moved))
    assert first == second


@pytest.mark.slow
def test_a_moving_spot_is_no_cut(renderer):
    """The frames of an animation follow it, near the stills."""
    camera = nubis.Camera.look_at((0, 0, 200), (0, 5000, 2000))
    shots = [
        (camera, CLEAR.with_(**{"weather.clear_at": (2.0 * i, 6000.0)}), i / 24) for i in range(20)
    ]
    make = renderer(96, 54)
    *_, last = make.animate(shots)
    still = make.render(*shots[-1][:2], time=shots[-1][2])
    assert last.tobytes() != still.tobytes()
    assert ref64.relative_rmse(last[..., :3], still[..., :3]) < 0.4
