"""What is behind the clouds is worked out at every fourth pixel where it is smooth
(shaders/wgsl/passes/composite.wgsl), against every pixel: with contrast 0, of the same shader.
"""

import numpy as np
import pytest

import nubis

SIZE = 160, 92
EYE = 0.0, 0.0, 200.0
FAIR = nubis.Params()
#: Nothing to march: what is left is all behind the clouds.
CIRRUS = FAIR.with_(**{"clouds.coverage": 0.0})
CLEAR = CIRRUS.with_(**{"high_clouds.coverage": 0.0})
#: Loose enough that brightness alone hardly shows an edge.
LOOSE = 1.0


def looking(azimuth=0.0, pitch=0.0, fov_y=10.0, eye=EYE):
    """Pixels of a ninth of a degree, if not told otherwise."""
    a, p = np.radians([azimuth, pitch])
    forward = np.array([np.sin(a) * np.cos(p), np.cos(a) * np.cos(p), np.sin(p)])
    return nubis.Camera.look_at(eye, np.add(eye, 1000.0 * forward), (0, 0, 1), fov_y)


def quality(contrast, name="draft"):
    return nubis.quality(name).replace(adaptive_threshold=contrast)


def both(camera, params, adaptive_threshold=0.5, size=SIZE, **given):
    """The layers of a picture where each pixel is worked out, and where cells are."""
    return (
        nubis.Renderer(*size, quality=quality(c)).render_layers(camera, params, **given)
        for c in (0.0, adaptive_threshold)
    )


def relative_rmse(few, full):
    return np.sqrt(np.mean((few - full) ** 2)) / max(np.abs(full).mean(), 1e-30)


def picture(of):
    return of["radiance"] + of["transmittance"][..., None] * of["sky"]


VIEWS = {
    "noon": (looking(0.0, 8.0, 60.0), CIRRUS, (1280, 720)),
    "cirrus": (looking(0.0, 20.0), CIRRUS, SIZE),
    "overhead": (looking(90.0, 60.0), CIRRUS, SIZE),
    "low sun": (
        looking(250.0, 16.0),
        nubis.scenes["sunset"][1].with_(**{"clouds.coverage": 0.0}),
        SIZE,
    ),
    "clear": (looking(120.0, 1.0), CLEAR, SIZE),
    "night": (looking(30.0, 18.0), CIRRUS.with_(**{"sun.elevation": -25.0}), SIZE),
    "dusk": (looking(250.0, 18.0), CIRRUS.with_(**{"sun.elevation": -4.0}), SIZE),
    "mackerel": (looking(330.0, 24.0), nubis.scenes["mackerel"][1], SIZE),
    "from space": (looking(0.0, -34.0, eye=(0.0, 0.0, 1.5e6)), CLEAR, SIZE),
    "fisheye": (nubis.Camera.fisheye(EYE, (0.3, 1.0, 0.5), 10.0), CIRRUS, SIZE),
    "panorama": (nubis.Camera.equirect(EYE), CIRRUS, (2880, 1440)),
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("view", VIEWS)
def test_cells_cost_little_error(view):
    """1 % of the mean radiance and transmittance, of a pixel 5 % but for one in 2000."""
    camera, params, size = VIEWS[view]
    full, few = both(camera, params, size=size)
    for name in "sky", "transmittance":
        assert relative_rmse(few[name], full[name]) < 0.01, name
    assert relative_rmse(picture(few), picture(full)) < 0.01
    brightest = picture(full).max(axis=-1)
    error = np.abs(picture(few) - picture(full)).max(axis=-1)
    assert np.mean(error > 0.05 * brightest) < 5e-4
    assert (error <= 0.2 * brightest).all()
    seen = np.isfinite(few["depth"]) & (full["transmittance"] < 0.95)
    np.testing.assert_allclose(few["depth"][seen], full["depth"][seen], rtol=0.05)
    # Corners are as they were, and not all that is between them: cells are in use.
    differs = error > 1e-5 * brightest
    assert differs.any()
    assert not differs[::4, ::4].any()


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["fair_weather", "overcast", "above", "storm", "sunset"])
def test_shadows_and_beams_behind_clouds(scene):
    """The sky and the ground with their shadows, whatever is marched before them."""
    camera, params = nubis.scenes[scene]
    full, few = both(camera, params, size=(1280, 720))
    assert relative_rmse(few["sky"], full["sky"]) < 0.003
    error = np.abs(few["sky"] - full["sky"]).max(axis=-1)
    assert np.quantile(error / full["sky"].max(axis=-1), 0.999) < 0.02


#: Share of a picture that is between the corners of cells.
BETWEEN = 15.0 / 16.0


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("elevation", [45.0, 8.0])
def test_fine_high_clouds(elevation):
    """Where cells are wider than streaks, those are worked out at each pixel, the air is not."""
    params = CIRRUS.with_(**{"sun.elevation": elevation, "high_clouds.emboss": 0.5})
    full, few = both(looking(0.0, 6.0, 6.0), params)
    assert full["transmittance"].std() > 0.1
    np.testing.assert_allclose(few["transmittance"], full["transmittance"], rtol=1e-5)
    error = np.abs(picture(few) - picture(full)).max(axis=-1) / picture(full).max(axis=-1)
    assert error.max() < 0.005
    assert 0.5 < np.mean(error > 1e-7) <= BETWEEN


def test_fine_shadows():
    """The same of shadows on the ground."""
    params = FAIR.with_(**{"high_clouds.coverage": 0.9, "high_clouds.optical_depth": 3.0})
    full, few = both(looking(0.0, -3.0, 8.0), params)
    bright = full["sky"].max(axis=-1)
    assert np.quantile(bright, 0.95) > 1.5 * np.quantile(bright, 0.05)
    error = np.abs(few["sky"] - full["sky"]).max(axis=-1) / bright
    assert error.max() < 0.01
    assert 0.5 < np.mean(error > 1e-7) <= BETWEEN


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("haze", [1.0, 12.0])
@pytest.mark.parametrize("pitch", [0.0, 1.3, -2.05])
def test_the_horizon_is_sharp(haze, pitch):
    """The last row of the sky and the first of the ground are worked out, however alike they are,
    as in haze that hides nearly all of the ground.
    """
    params = CLEAR.with_(**{"atmosphere.haze": haze})
    full, few = both(looking(40.0, pitch), params, LOOSE)
    radius = params.atmosphere.planet_radius
    dip = np.degrees(np.arccos(radius / (radius + EYE[2])))
    up = 1.0 - (np.arange(SIZE[1]) + 0.5) / (0.5 * SIZE[1])
    elevation = pitch + np.degrees(np.arctan(up * np.tan(np.radians(5.0))))
    edge = int(np.argmax(elevation < -dip))
    middle = slice(edge - 1, edge + 1), SIZE[0] // 2
    np.testing.assert_array_equal(few["sky"][middle], full["sky"][middle])


@pytest.mark.slow
@pytest.mark.parametrize("shift", [(0.0, 0.0), (2.0, 2.0), (1.5, 0.5), (1.5, -0.5)])
@pytest.mark.parametrize("air", [True, False])
def test_the_sun_between_corners(shift, air):
    """Its disc is narrower than a cell's diagonal, in pixels of an eighth of a degree."""
    fov_y = 0.124 * SIZE[1]
    sun = CLEAR.with_(**{"sun.elevation": 30.0, "sun.azimuth": 120.0, "atmosphere.enabled": air})
    pitch, azimuth = 30.0 + 0.124 * shift[1], 120.0 + 0.124 * shift[0] / np.cos(np.radians(30.0))
    full, few = both(looking(azimuth, pitch, fov_y), sun, LOOSE)
    bright = full["sky"].max(axis=-1)
    disc = bright > 2 * np.median(bright)
    assert 10 < disc.sum() < 40
    np.testing.assert_array_equal(few["sky"][disc], full["sky"][disc])


@pytest.mark.slow
def test_the_users_scene_is_exact():
    """Pixels of the scene are worked out, and those beside them."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    depth = np.where((x - 80) ** 2 + (y - 50) ** 2 < 700, 5e4, np.inf).astype(np.float32)
    camera = looking(0.0, 20.0)
    full, few = both(camera, CIRRUS, LOOSE, scene_depth=depth)
    near = np.isfinite(depth)
    for name in "sky", "radiance", "transmittance", "depth":
        np.testing.assert_array_equal(few[name][near], full[name][near], err_msg=name)
    assert relative_rmse(few["sky"][~near], full["sky"][~near]) < 0.01
    assert (picture(few) != picture(full)).any()


@pytest.mark.slow
def test_the_nearer_of_high_and_marched_clouds_is_before():
    """High clouds below the marched ones, as thick as them."""
    params = nubis.scenes["overcast"][1].with_(
        **{
            "high_clouds.altitude": 600.0,
            "high_clouds.coverage": 0.6,
            "high_clouds.optical_depth": 3.0,
            "high_clouds.scale": 42000.0,
        }
    )
    camera = looking(20.0, 30.0)
    full, few = (
        nubis.Renderer(*SIZE, quality=quality(c)).render(camera, params) for c in (0.0, 0.02)
    )
    assert relative_rmse(few, full) < 0.01


@pytest.mark.slow
def test_what_opaque_clouds_hide_is_not_missed():
    """A picture is made of its layers, for which all that is hidden is worked out."""
    make = nubis.Renderer(320, 184, quality=quality(0.5))
    for scene in "overcast", "storm", "fair_weather":
        camera, params = nubis.scenes[scene]
        camera = nubis.Camera.look_at(camera.eye, np.add(camera.eye, (0.3, 1, 0.1)), fov_y=20.0)
        image = make.render(camera, params)[..., :3]
        layers = make.render_layers(camera, params)
        np.testing.assert_allclose(image, picture(layers), rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["preview", "draft"])
def test_opaque_clouds_hide_what_is_behind(name):
    """The horizon, too, between whose ground and high clouds nothing is smooth."""
    camera, params = nubis.scenes["in_cloud"]
    make = nubis.Renderer(890, 626, quality=name)
    clouds = make.render(camera, params, background=None)
    opaque = clouds[..., 3] == 1
    assert opaque[366:372].mean() > 0.2  # the horizon
    whole = make.render(camera, params)
    np.testing.assert_allclose(whole[opaque], clouds[opaque], rtol=1e-5)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("size", [(1, 1), (2, 7), (9, 1), (5, 6), (23, 18)])
def test_sizes_that_four_does_not_divide(size):
    camera = looking(0.0, 12.0, 0.1 * size[1])
    for params in CLEAR, CIRRUS:
        full, few = both(camera, params, size=size)
        np.testing.assert_allclose(picture(few), picture(full), rtol=0.05)


def test_strips_do_not_show():
    """A still of two strips, and the first frame of an animation, which is one."""
    size = 2048, 600
    camera = looking(0.0, 16.0, 50.0)
    still = nubis.Renderer(*size, quality=quality(0.5)).render(camera, CIRRUS)
    shots = iter([(camera, CIRRUS, 0.0)])
    frame = next(iter(nubis.Renderer(*size, quality=quality(0.5)).animate(shots)))
    assert np.array_equal(still, frame)


def test_it_follows_from_the_picture_alone():
    make = nubis.Renderer(*SIZE, quality=quality(0.5))
    fresh = make.render(looking(0.0, 20.0), CIRRUS)
    make.render(looking(90.0, -3.0), FAIR)
    assert np.array_equal(make.render(looking(0.0, 20.0), CIRRUS), fresh)


def test_moving_frames_are_as_good():
    """An animation that goes on, without clouds to march, against stills of every pixel."""
    shots = [(looking(0.0, 20.0 + 0.07 * i), CIRRUS, 2.0 * i) for i in range(3)]
    frames = nubis.Renderer(*SIZE, quality=quality(0.5)).animate(iter(shots))
    exact = nubis.Renderer(*SIZE, quality=quality(0.0))
    for (camera, params, time), frame in zip(shots, frames, strict=True):
        assert relative_rmse(frame, exact.render(camera, params, time=time)) < 0.01


@pytest.mark.parametrize("name", ["high", "nubis2015", "thesis2018", "vsu2022"])
def test_published_qualities_know_no_cells(name):
    assert nubis.quality(name).adaptive_threshold == 0
