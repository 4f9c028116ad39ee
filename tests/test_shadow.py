"""Shadows of clouds: the map, the ground in pictures, and the sun as a camera sees it."""

import math

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe

DOWN = nubis.Camera.look_at((0, 0, 6000), (0, 5000, 0), (0, 0, 1), 50.0)
SIZE = 64, 36


def rms(error):
    return np.sqrt(np.mean(np.square(error)))


def centres(shadow):
    """World points of the centres of texels."""
    size = len(shadow.transmittance)
    rows, columns = np.mgrid[:size, :size] + 0.5
    at = np.stack([columns, rows, 0 * rows, 0 * rows + 1], axis=-1)
    return (at @ shadow.world_from_map.T)[..., :3]


def box(extinction, low, high):
    return nubis.Params(volume=nubis.DensityGrid(np.full((2, 2, 2), extinction), (low, high)))


@pytest.mark.parametrize("scene", ["fair_weather", "storm", "sunset", "mackerel"])
def test_map_is_sun_transmittance(renderer, scene):
    """Against the converged answers at the centres of all texels, with wind, beside the origin and
    above the ground: 2 % RMS of full sun.
    """
    params = nubis.scenes[scene][1]
    ours = renderer()
    shadow = ours.shadow_map(
        params, time=77.0, center=(3000.0, -8000.0), extent=9000.0, size=48, altitude=150.0
    )
    assert shadow.transmittance.shape == (48, 48) and shadow.transmittance.dtype == np.float32
    points = centres(shadow)
    assert np.allclose(points[0, 0], (3000 - 4500 + 93.75, -8000 + 4500 - 93.75, 150))
    expected = ours.sun_transmittance(points.reshape(-1, 3), params, time=77.0)
    assert 0.02 < expected.mean() < 0.98 and expected.std() > 0.02
    assert rms(shadow.transmittance.ravel() - expected) < 0.02


def test_map_is_the_marched_reference(renderer):
    """Against float64 rays through the renderer's own density."""
    params = ref64.smooth_params(**{"sun.elevation": 35.0})
    shadow = renderer().shadow_map(params, extent=30_000.0, size=24)
    points = centres(shadow).reshape(-1, 3)
    expected = ref64.sun_transmittance(renderer(), params, points, 600)
    assert expected.std() > 0.1
    assert rms(shadow.transmittance.ravel() - expected) < 0.005


def test_depth_is_the_sum_of_its_samples(renderer, rng):
    """Neighbours whose rays leave the clouds earlier lose and gain none by those that go on."""
    params = nubis.scenes["fair_weather"][1]
    points = np.zeros((1500, 3))
    points[:, :2] = rng.uniform(-8000, 8000, (1500, 2))
    step = "2.0 * finest_feature()"
    ask = {"imports": ["passes/shadow"], "params": params}
    got = probe(f"cloud_depth_to_sun(x.xyz, {step}, 2048.0)", points, **ask)[:, 0].astype(float)
    stretches = "cloud_stretches_from(x.xyz, frame.sky.sun_direction)"
    way = f"vec4f({stretches}.start, {stretches}.first, {stretches}.second, {step})"
    start, first, second, fine = probe(way, points, **ask).astype(float).T
    assert (second == 0).all()
    sun = probe("vec4f(frame.sky.sun_direction, frame.sky.extinction)", [0.0], **ask)[0].astype(
        float
    )
    counts = np.ceil(first / fine).astype(int)
    assert len(set(counts)) > 1
    owner = np.repeat(np.arange(len(points)), counts)
    number = np.concatenate([np.arange(n) for n in counts])
    length = first[owner] / counts[owner]
    at = points[owner] + (start[owner] + (number + 0.5) * length)[:, None] * sun[:3]
    density = probe("cloud_density_at(x.xyz, altitude_at(x.xyz), 0.0)", at, **ask)[:, 0]
    expected = np.bincount(owner, density * sun[3] * length)
    # Past an optical depth of 7 it stops, as all is dark.
    light = expected < 7
    assert light.mean() > 0.5 and (expected[light] > 0.1).sum() > 50
    np.testing.assert_allclose(got[light], expected[light], rtol=1e-3, atol=1e-4)
    assert (got[~light] >= 7 * (1 - 1e-3)).all()


def test_map_is_orthographic_along_the_sun(renderer):
    """A point of a cloud has its shadow where the inverse of the matrix says: a box that lets
    nothing through, of known corners.
    """
    low, high = (1000.0, 400.0, 2000.0), (1600.0, 900.0, 2050.0)
    params = box(1.0, low, high).with_(
        **{"sun.elevation": 45.0, "sun.azimuth": 100.0, "high_clouds.coverage": 0.0}
    )
    shadow = renderer().shadow_map(params, extent=8000.0, size=200)
    middle = np.mean([low, high], axis=0)
    column, row, height, _ = np.linalg.inv(shadow.world_from_map) @ [*middle, 1]
    assert height == pytest.approx(middle[2])
    assert shadow.transmittance[int(row), int(column)] < 1e-3
    # The sun is in the east, and so the shadow is west of the box by its height.
    ground = shadow.world_from_map @ [column, row, 0, 1]
    assert ground[0] == pytest.approx(middle[0] - middle[2] * math.sin(math.radians(100)))
    dark = (shadow.transmittance < 0.5).sum() * (8000 / 200) ** 2
    assert dark == pytest.approx(600 * 500, rel=0.1)
    assert (shadow.transmittance > 0.999).mean() > 0.95


@pytest.mark.parametrize("elevation", [-0.5, -40.0])
def test_no_sun_below_the_horizon(renderer, elevation):
    params = nubis.Params().with_(**{"sun.elevation": elevation})
    shadow = renderer().shadow_map(params, size=16)
    assert (shadow.transmittance == 0).all() and np.isfinite(shadow.world_from_map).all()
    low = nubis.Camera.look_at((0, 0, 2), (0, 1000, 2), (0, 0, 1), 60.0)
    assert renderer().sun_visibility(low, params) == (0, 0)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"size": 0}, "size = 0"),
        ({"size": 9000}, "size = 9000"),
        ({"size": 2.5}, "size = 2.5"),
        ({"extent": 0.0}, "extent = 0"),
        ({"extent": math.nan}, "extent = NaN"),
        ({"altitude": math.inf}, "altitude = inf"),
        ({"center": (0.0, math.nan)}, r"center\[1\] = nan"),
        ({"center": 5.0}, "center = array of shape ()"),
        ({"center": ("a", "b")}, "center"),
        ({"time": math.inf}, "time = inf"),
    ],
)
def test_maps_that_are_none(renderer, changes, message):
    with pytest.raises(nubis.ParameterError, match=message):
        renderer().shadow_map(nubis.Params(), **({"size": 8} | changes))


def ground_points(camera, params):
    """Where the rays of a picture meet the ground, NaN where they do not."""
    directions = ref64.pixel_directions(camera, *SIZE).reshape(-1, 3)
    radius = params.atmosphere.planet_radius
    near = ref64.sphere_hits(np.array(camera.eye), directions, radius, 0.0)[0]
    return np.array(camera.eye) + np.where(near > 0, near, np.nan)[:, None] * directions


def seen_ground(camera, params, time=0.0, **changes):
    """The radiance behind the clouds and behind air without shadows: by the model `octaves`, with
    which clouds pass on a quarter of the sunlight.
    """
    quality = nubis.quality("draft").replace(steps_zenith=8, steps_horizon=8, light_steps=1)
    ours = nubis.Renderer(*SIZE, quality=quality)
    params = params.with_(**{"light.model": "octaves", "atmosphere.light_shafts": False}, **changes)
    sky = ours.render_layers(camera, params, time=time)["sky"]
    return sky.reshape(-1, 3).astype(np.float64)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("eye, time", [((0, 0, 6000), 0.0), ((290, -290, 3000), 2.4)])
def test_shadows_on_the_ground_of_pictures(renderer, eye, time):
    """Direct sun times transmittance, against `sun_transmittance` where each pixel's ray meets the
    ground: 2 % of the radiance of the ground, RMS, where shadows are as smooth as the levels.
    """
    params = ref64.smooth_params(**{"atmosphere.enabled": True, "sun.elevation": 50.0})
    camera = nubis.Camera.look_at(eye, np.add(eye, (0, 3500, -5000)), (0, 0, 1), 50.0)
    points = ground_points(camera, params)
    open_ground = seen_ground(camera, params, time, **{"atmosphere.ground_shadows": False})
    dark = {"clouds.coverage": 1.0, "clouds.extinction": 10.0, "clouds.type": 0.5}
    full_shadow = seen_ground(camera, params, time, **dark)
    sun = renderer().sun_transmittance(points, params, time=time)[:, None]
    assert sun.std() > 0.1
    expected = full_shadow + sun * (open_ground - full_shadow)
    shadowed = seen_ground(camera, params, time)
    assert ref64.relative_rmse(shadowed, expected) < 0.02
    # Not merely because shadows are faint: the direct sun is most of the light.
    assert ref64.relative_rmse(open_ground, expected) > 0.1


def test_direct_sun_on_the_ground():
    """What a full shadow takes is the sun's irradiance on the ground times albedo / pi, dimmed by
    the air: by Beer's law for Rayleigh, aerosol and ozone straight up, 2 %. A quarter of it the
    cloud passes on (Haurwitz 1948, stratus).
    """
    params = nubis.Params().with_(
        **{
            "sun.elevation": 90.0,
            "atmosphere.ground_albedo": (0.5, 0.5, 0.5),
            "atmosphere.aerial_perspective": 0.0,
            "high_clouds.coverage": 0.0,
            "clouds.coverage": 1.0,
            "clouds.extinction": 10.0,
        }
    )
    camera = nubis.Camera.look_at((0, 0, 900), (0, 0, 0), (0, 1, 0), 10.0)
    lit = seen_ground(camera, params, **{"atmosphere.ground_shadows": False})
    dark = seen_ground(camera, params)
    depth = 1e-6 * np.array([5.802, 13.558, 33.1]) * 8000 + 4.44e-6 * 1200
    depth += np.array([0.00975, 0.0282, 0.0013])
    expected = 0.75 * 0.5 / np.pi * np.array(params.sun.irradiance) * np.exp(-depth)
    assert np.allclose((lit - dark).mean(axis=0), expected, rtol=0.02)


def test_high_clouds_cast_shadows(renderer):
    """High clouds alone, which nothing is marched for."""
    params = nubis.Params().with_(
        **{
            "clouds.coverage": 0.0,
            "high_clouds.coverage": 0.7,
            "high_clouds.optical_depth": 2.0,
            "high_clouds.scale": 8000.0,
        }
    )
    sun = renderer().sun_transmittance(ground_points(DOWN, params), params)[:, None]
    assert 0.2 < sun.mean() < 0.9
    open_ground = seen_ground(DOWN, params, **{"atmosphere.ground_shadows": False})
    full = {"high_clouds.coverage": 1.0, "high_clouds.optical_depth": 100.0}
    full_shadow = seen_ground(DOWN, params, **full)
    expected = full_shadow + sun * (open_ground - full_shadow)
    assert ref64.relative_rmse(seen_ground(DOWN, params), expected) < 0.01
    assert ref64.relative_rmse(open_ground, expected) > 0.1


def test_shadows_of_a_grid():
    """They stay where the grid is, whatever the wind; what they take is gone under a box alone."""
    params = box(1.0, (-500, 3000, 1000), (500, 4000, 1500)).with_(
        **{"sun.elevation": 90.0, "high_clouds.coverage": 0.0, "atmosphere.aerial_perspective": 0.0}
    )
    off = {"atmosphere.ground_shadows": False}
    points = ground_points(DOWN, params)
    under = (np.abs(points[:, 0]) < 400) & (np.abs(points[:, 1] - 3500) < 400)
    beside = (np.abs(points[:, 0]) > 800) | (np.abs(points[:, 1] - 3500) > 800)
    for time in (0.0, 3.0):
        ratio = (seen_ground(DOWN, params, time) / seen_ground(DOWN, params, time, **off)).mean(
            axis=1
        )
        # Skylight, and the quarter of the sun that the cloud passes on.
        assert ratio[under].max() < 0.5 and ratio[beside].min() > 0.999


@pytest.mark.slow
def test_switched_off_nothing_is_kept_from_the_ground():
    """Then clouds change nothing of what is behind them; nor do shadows without clouds."""
    params = nubis.scenes["fair_weather"][1]
    clear = {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0}
    off = {"atmosphere.ground_shadows": False}
    plain = seen_ground(DOWN, params, **clear)
    assert np.array_equal(seen_ground(DOWN, params, **off), plain)
    assert np.array_equal(seen_ground(DOWN, params, **off, **clear), plain)
    assert not np.array_equal(seen_ground(DOWN, params), plain)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("altitude", [2.0, 200.0, 2e4, 4e5, 2e7])
def test_ground_from_everywhere(altitude):
    """From the ground to space: finite, and never brighter than without shadows."""
    params = nubis.scenes["fair_weather"][1]
    down = 0.3 if altitude < 1e6 else 50.0
    camera = nubis.Camera.look_at((0, 0, altitude), (0, 1, altitude - down), (0, 0, 1), 70.0)
    shadowed = seen_ground(camera, params)
    plain = seen_ground(camera, params, **{"atmosphere.ground_shadows": False})
    assert np.isfinite(shadowed).all()
    assert (shadowed <= plain).all() and (shadowed < 0.99 * plain).any()


@pytest.mark.slow
def test_what_sees_no_ground_bakes_nothing():
    """Nor does night, nor a picture of the clouds alone, where the air is not shaded; and one that
    has been baked stays.
    """
    params = nubis.Params().with_(**{"wind.speed": 20.0, "wind.weather_speed": 20.0})
    params = params.with_(**{"atmosphere.light_shafts": False})
    up = nubis.Camera.look_at((0, 0, 100), (0, 1000, 900), (0, 0, 1), 40.0)
    ours = nubis.Renderer(*SIZE, quality="draft")

    def bakes(camera, time=0.0, background="sky", **changes):
        ours.render(camera, params.with_(**changes), time=time, background=background)
        return "shadow_ground" in ours.timings

    assert not bakes(up)
    assert bakes(up, **{"atmosphere.light_shafts": True})
    assert not bakes(DOWN, **{"sun.elevation": -20.0})
    assert not bakes(DOWN, background=None)
    assert not bakes(DOWN, **{"atmosphere.ground_shadows": False})
    assert not bakes(DOWN, **{"clouds.coverage": 0.0})
    # What was baked for the shaded air above is still there.
    assert not bakes(DOWN)
    assert not bakes(DOWN, time=0.79)  # 32 m / 20 m/s: every 1.6 s, for the times nearest to it
    assert bakes(DOWN, time=0.81)
    assert not bakes(DOWN, time=2.39)
    assert bakes(DOWN, time=2.39, **{"sun.azimuth": 10.0})


def test_pictures_do_not_depend_on_those_before():
    params = nubis.scenes["fair_weather"][1]
    flown, fresh = (nubis.Renderer(*SIZE, quality="draft") for _ in range(2))
    for y in (0.0, 250.0, 350.0, 900.0):
        camera = nubis.Camera.look_at((0, y, 5000), (0, y + 5000, 0), (0, 0, 1), 50.0)
        frame = flown.render(camera, params, time=y / 200)
    assert np.array_equal(frame, fresh.render(camera, params, time=900.0 / 200))


def test_sun_visibility_is_a_mean_over_the_disc(renderer):
    """Against `sun_transmittance` for a sun that stands at each of many points of the disc."""
    params = ref64.smooth_params(**{"sun.elevation": 40.0, "clouds.extinction": 0.01})
    eye = np.array([0.0, 0.0, 100.0])
    camera = nubis.Camera.look_at(eye, eye + ref64.sun_direction(params), (0, 0, 1), 1.0)
    ours = nubis.Renderer(200, 200, quality="draft")  # pixels far smaller than the disc
    points = np.stack([np.linspace(-20_000, 20_000, 40), np.zeros(40), np.full(40, 100.0)], axis=-1)
    sun = renderer().sun_transmittance(points, params)
    eye = points[np.argmin(np.abs(sun - 0.4))]
    camera = nubis.Camera.look_at(eye, eye + ref64.sun_direction(params), (0, 0, 1), 1.0)
    rng = np.random.default_rng(8)
    radius = 0.2666 * np.sqrt(rng.uniform(size=12))
    angle = 2 * np.pi * (np.arange(12) + rng.uniform(size=12)) / 12
    seen = [
        renderer().sun_transmittance(
            [eye],
            params.with_(
                **{
                    "sun.elevation": params.sun.elevation + r * math.sin(a),
                    "sun.azimuth": params.sun.azimuth
                    + r * math.cos(a) / math.cos(math.radians(params.sun.elevation)),
                }
            ),
        )[0]
        for r, a in zip(radius, angle, strict=True)
    ]
    assert 0.2 < np.mean(seen) < 0.8
    assert ours.sun_visibility(camera, params).direct == pytest.approx(np.mean(seen), abs=0.01)


def test_sun_visibility_behind_an_edge():
    """A straight edge across the middle of the sun hides half of it, and the mean over a pixel's
    width is what is left where pixels are wide.
    """
    params = box(1.0, (-5000, 0, 1000), (5000, 9000, 1100)).with_(
        **{"sun.elevation": 90.0, "high_clouds.coverage": 0.0}
    )
    ours = nubis.Renderer(100, 100, quality="draft")

    def direct(y, fov):
        camera = nubis.Camera.look_at((0, y, 0), (0, y, 1), (0, 1, 0), fov)
        return ours.sun_visibility(camera, params).direct

    # At 1000 m the disc is 9.3 m wide.
    assert direct(0.0, 10.0) == pytest.approx(0.5, abs=0.02)
    assert direct(-6.0, 10.0) == 1 and direct(6.0, 10.0) < 1e-6
    # A pixel of 1.9 degrees is 33 m wide there: 6 m from the edge a third is hidden.
    assert direct(-6.0, 124.6) == pytest.approx(0.5 + 6 / (1000 * 2 * 1.9044 / 100), abs=0.05)


@pytest.mark.parametrize("depth", [0.0, 0.3, 3.0, 30.0])
def test_sun_visibility_through_a_slab(depth):
    """Beer's law for the direct light, two streams for what is scattered."""
    params = box(depth / 500.0, (-9e4, -9e4, 1000), (9e4, 9e4, 1500)).with_(
        **{"sun.elevation": 90.0, "high_clouds.coverage": 0.0}
    )
    camera = nubis.Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), 60.0)  # the sun is not in view
    seen = nubis.Renderer(64, 36).sun_visibility(camera, params)
    assert seen.direct == pytest.approx(math.exp(-depth), abs=1e-4)
    expected = 1 / (1 + 0.75 * 0.15 * depth) - math.exp(-depth)
    assert seen.ambient == pytest.approx(expected, abs=1e-4)


@pytest.mark.slow
def test_sun_visibility_over_ground_and_scene():
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0, "sun.azimuth": 0.0}
    )
    ours = nubis.Renderer(90, 90, quality="draft")

    def direct(elevation, camera=None, scene_depth=None):
        low = params.with_(**{"sun.elevation": elevation})
        toward = 1e3 * ref64.sun_direction(low) + np.array([0, 0, 0.01])
        camera = camera or nubis.Camera.look_at((0, 0, 0.01), toward, (0, 0, 1), 2.0)
        return ours.sun_visibility(camera, low, scene_depth=scene_depth).direct

    assert direct(1.0) == 1 and direct(-1.0) == 0
    assert direct(0.0) == pytest.approx(0.5, abs=0.05)
    # A scene over the left half of the picture, and one that is not before the sun.
    half = np.full((90, 90), np.inf)
    half[:, :45] = 100.0
    assert direct(20.0, scene_depth=half) == pytest.approx(0.5, abs=0.03)
    corner = np.full((90, 90), np.inf)
    corner[:20] = 100.0
    assert direct(20.0, scene_depth=corner) == 1
    # All kinds of cameras find the sun's pixel: a scene there hides it, elsewhere it does not.
    for camera in (
        nubis.Camera.equirect((0, 0, 1)),
        nubis.Camera.fisheye((0, 0, 1)),
        nubis.Camera.look_at((0, 0, 1), (0, 1, 1.5), (0, 0, 1), 60.0),
    ):
        bright = ours.render(camera, params.with_(**{"sun.elevation": 20.0}))[..., :3].sum(axis=-1)
        row, column = np.unravel_index(bright.argmax(), bright.shape)
        y, x = np.mgrid[:90, :90]
        near = np.maximum(abs(y - row), abs(x - column)) <= 2
        assert direct(20.0, camera, np.where(near, 50.0, np.inf)) == 0
        assert direct(20.0, camera, np.where(near, np.inf, 50.0)) == 1
