"""Shadows of clouds on the air, against a float64 march through `sun_transmittance`."""

import numpy as np
import pytest

import nubis
import ref64
import ref64_air

SIZE = 160, 90
#: Pixels that are compared with the ref64.
SOME = slice(4, None, 9), slice(4, None, 9)
OFF = {"atmosphere.light_shafts": False}
CHEAP = nubis.quality("draft").replace(steps_zenith=8, steps_horizon=8, light_steps=1)
#: As clouds pass it on (Haurwitz 1948, stratus) with the light model `octaves`.
PASSED_ON = 0.25


def sky(camera, params, size=SIZE, **given):
    params = params.with_(**{"light.model": "octaves"})
    layers = nubis.Renderer(*size, quality=CHEAP).render_layers(camera, params, **given)
    return layers["sky"].astype(np.float64)


def lack(camera, params, size=SIZE, **given):
    """How much less light there is with beams than without, behind the clouds."""
    return sky(camera, params.with_(**OFF), size, **given) - sky(camera, params, size, **given)


def lack_of_twin(renderer, camera, params, limit=np.inf, time=0.0, steps=400):
    """The same: light scattered once that clouds keep from the air before a distance, less what
    they pass on, from above and evenly. No step is longer than what is near it is wide.
    """
    radius = params.atmosphere.planet_radius
    directions = ref64.pixel_directions(camera, *SIZE)[SOME]
    shape, directions = directions.shape, directions.reshape(-1, 3)
    eye = np.array(camera.eye)
    near, top = ref64.sphere_hits(eye, directions, radius, 20_000.0)
    ground = ref64.sphere_hits(eye, directions, radius, 0.0)[0]
    end = np.minimum(np.where(ground > 0, ground, top), limit)
    start = np.maximum(near, 0)
    # By a logarithm, from 1 km on.
    share = np.linspace(0, 1, steps + 1)
    edges = start[:, None] + 1000 * ((1 + (end - start)[:, None] / 1000) ** share - 1)
    t, dt = 0.5 * (edges[:, 1:] + edges[:, :-1]), np.diff(edges, axis=1)
    points = eye + t[..., None] * directions[:, None]
    h = ref64.altitude(points, radius)
    low = h < top_of(params)
    through = np.ones(t.shape)
    through[low] = renderer().sun_transmittance(points[low], params, time=time)
    sun = ref64.sun_direction(params)
    mu = (ref64.from_centre(points, radius) @ sun) / (radius + h)
    cosine = (directions @ sun)[:, None]
    found = []
    for channel in range(3):
        air = ref64_air.Air(channel, params.atmosphere.haze)
        rayleigh, aerosol, extinction = air.parts(h)
        depth = np.cumsum(extinction * dt, axis=1) - 0.5 * extinction * dt
        once = rayleigh * ref64_air.phase(cosine, 0) + aerosol * ref64_air.phase(cosine, 1)
        even = (rayleigh + aerosol) * PASSED_ON * np.maximum(mu, 0) / (2 * np.pi)
        source = (once - even) * air.sunlight(h, mu) * (1 - through)
        found.append(params.sun.irradiance[channel] * np.sum(np.exp(-depth) * source * dt, axis=1))
    return np.stack(found, axis=-1).reshape(shape)


def top_of(params):
    return params.volume.bounds[1][2] if params.volume else ref64.shell(params)[1]


def smooth(**changes):
    base = {"atmosphere.enabled": True, "high_clouds.coverage": 0.0, "sun.visible": False}
    ground = {"atmosphere.ground_albedo": (0.0, 0.0, 0.0)}
    return ref64.smooth_params(**(base | ground | changes))


def looking(pitch, azimuth=0.0, eye=(0.0, 0.0, 200.0), fov=50.0):
    eye = np.array(eye)
    return nubis.Camera.look_at(eye, eye + 100 * ref64.compass(azimuth, pitch), (0, 0, 1), fov)


VIEWS = [
    (50.0, 25.0, (0, 0, 200)),
    (50.0, -10.0, (300, -800, 900)),
    (20.0, 20.0, (0, 0, 200)),
    (20.0, -40.0, (0, 0, 9000)),
    (5.0, 20.0, (0, 0, 200)),
]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("sun, pitch, eye", VIEWS)
def test_where_shadows_are_as_smooth_as_their_levels(renderer, sun, pitch, eye):
    """To the ground or to space, from below and from above: 12 % of what the air lacks, RMS, which
    is up to a quarter of the sky and no even dimming.
    """
    params = smooth(**{"sun.elevation": sun, "sun.azimuth": 20.0})
    camera = looking(pitch, eye=eye)
    expected = lack_of_twin(renderer, camera, params, time=60.0)
    assert expected.std() > 0.5 * expected.mean() and expected.max() > 0.01
    assert ref64.relative_rmse(lack(camera, params, time=60.0)[SOME], expected) < 0.12


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("sun, pitch, eye", VIEWS)
def test_among_clouds_with_detail(renderer, sun, pitch, eye):
    """`fair_weather`, whose shadows have edges finer than 64 m: 3 % of the sky, RMS; toward a sun
    at 5 degrees, where the air lacks most, 8 %.
    """
    params = nubis.scenes["fair_weather"][1].with_(
        **{"sun.elevation": sun, "sun.azimuth": 20.0, "sun.visible": False},
        **{"high_clouds.coverage": 0.0, "atmosphere.ground_albedo": (0.0, 0.0, 0.0)},
    )
    camera = looking(pitch, eye=eye)
    expected = lack_of_twin(renderer, camera, params, time=60.0)
    bright = sky(camera, params.with_(**OFF), time=60.0)[SOME].mean()
    error = np.sqrt(np.mean((lack(camera, params, time=60.0)[SOME] - expected) ** 2)) / bright
    assert error < (0.03 if sun > 10 else 0.08)
    assert np.sqrt(np.mean(expected**2)) > 1.4 * error * bright


@pytest.mark.slow
@pytest.mark.parametrize("distance", [2000.0, 8000.0, 30_000.0])
def test_before_a_scene(renderer, distance):
    """The air before a black scene, as before clouds at that distance: 12 %."""
    params = smooth(**{"sun.elevation": 20.0, "sun.azimuth": 20.0})
    camera = looking(14.0)
    shape = SIZE[1], SIZE[0]
    scene = {"scene_depth": np.full(shape, distance)}
    expected = lack_of_twin(renderer, camera, params, limit=distance)
    assert expected.mean() > 1e-3
    assert ref64.relative_rmse(lack(camera, params, **scene)[SOME], expected) < 0.12


@pytest.mark.slow
def test_shadow_of_a_grid(renderer):
    """A box that lets nothing through, with a sharp edge: 20 % of what the air under it lacks."""
    grid = nubis.DensityGrid(np.full((2, 2, 2), 0.1), ((-2e4, 1000, 1500), (2e4, 9000, 2500)))
    params = smooth(**{"sun.elevation": 45.0, "sun.azimuth": 0.0, "atmosphere.haze": 4.0})
    params = params.replace(volume=grid)
    camera = looking(15.0)
    expected = lack_of_twin(renderer, camera, params)
    assert expected.mean() > 0.01
    assert ref64.relative_rmse(lack(camera, params)[SOME], expected) < 0.2


@pytest.mark.slow
def test_clouds_are_seen_through_shaded_air():
    """A black wall of cloud behind a box's shadow has the same air before it as a scene there."""
    data = np.zeros((12, 40, 2), dtype=np.float32)
    data[6:8, :20] = 0.02  # a roof
    data[:, 38:] = 0.02  # a wall, where the box ends: there is a distance at which light is known
    grid = nubis.DensityGrid(data, ((-2e4, 500, 0), (2e4, 20_500, 6000)))
    params = smooth(**{"sun.elevation": 60.0, "sun.azimuth": 180.0, "light.albedo": 0.0})
    black = {"light.model": "single", "atmosphere.haze": 4.0}
    params = params.replace(volume=grid).with_(**black)
    camera = looking(6.0, fov=8.0)
    fine = nubis.quality("high").replace(jitter=False)
    on, off = (
        nubis.Renderer(16, 9, quality=fine).render_layers(camera, params.with_(**changes))
        for changes in ({}, OFF)
    )
    assert on["transmittance"].max() < 0.01
    assert np.array_equal(on["depth"], off["depth"])
    got = (off["radiance"] - on["radiance"]).astype(np.float64)
    scene = {"scene_depth": on["depth"]}
    expected = lack(camera, params, (16, 9), **scene)
    assert expected.mean() > 0.05 * off["radiance"].mean()
    np.testing.assert_allclose(got, expected, rtol=0.05, atol=0.05 * expected.mean())


@pytest.mark.slow
def test_switched_off_nothing_is_shaded():
    """Nor in a clear sky, at night, without air, or over the clouds: the same pictures. With
    the light model `multiple` the light that clouds scatter to the air may be more than they take.
    """
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(**{"light.model": "octaves", "light.g": 0.6})
    up = looking(30.0, eye=(0, 0, 12_000))
    ours = nubis.Renderer(32, 18, quality="draft")

    def picture(camera=camera, **changes):
        image = ours.render(camera, params.with_(**changes))
        return image, "light_shafts_bake" in ours.timings

    lit, baked = picture()
    plain, not_baked = picture(**OFF)
    assert baked and not not_baked
    assert (lit <= plain + 1e-6).all() and (lit < 0.99 * plain).any()
    for changes in (
        {"clouds.coverage": 0.0},
        {"sun.elevation": -20.0},
        {"atmosphere.enabled": False},
        {"sun.irradiance": (0.0, 0.0, 0.0)},
    ):
        (with_beams, baked), (without, _) = picture(**changes), picture(**changes, **OFF)
        assert not baked and np.array_equal(with_beams, without)
    (with_beams, baked), (without, _) = picture(up), picture(up, **OFF)
    assert not baked and np.array_equal(with_beams, without)
    # With no air between the eye and the clouds, that before them has no shadows.
    none = {"atmosphere.aerial_perspective": 0.0}
    black = {"background": None}
    a, b = (ours.render(camera, params.with_(**none, **c), **black) for c in ({}, OFF))
    np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.slow
def test_a_picture_of_any_size():
    """Four times the pixels: the same beams, to 2 % of the sky."""
    params = smooth(**{"sun.elevation": 20.0, "sun.azimuth": 20.0})
    camera = looking(14.0)
    small, large = lack(camera, params, (80, 45)), lack(camera, params, (320, 180))
    large = large.reshape(45, 4, 80, 4, 3).mean(axis=(1, 3))
    assert np.sqrt(np.mean((small - large) ** 2)) < 0.02 * sky(camera, params, (80, 45)).mean()
    assert large.std() > 0.05 * sky(camera, params, (80, 45)).mean()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["equirect", "fisheye", "narrow", "wide"])
def test_every_camera_sees_the_same(kind):
    """What one pixel of it sees, a camera that looks that way alone sees too: 5 %."""
    params = smooth(**{"sun.elevation": 20.0, "sun.azimuth": 20.0})
    eye, size = (0.0, 0.0, 200.0), (240, 120)
    forward = ref64.compass(15.0, 10.0)
    if kind == "equirect":
        camera, pixel = nubis.Camera.equirect(eye), (52, 130)
        direction = ref64.compass((130.5 / 240 - 0.5) * 360, 90 - 52.5 / 120 * 180)
    elif kind == "fisheye":
        camera, pixel = nubis.Camera.fisheye(eye), (80, 119)
        y, x = 60 - 80.5, 119.5 - 120
        angle = np.hypot(x, y) / 60 * np.pi / 2
        axes = [np.array(v) for v in (camera.right, camera.up, camera.forward)]
        level = (x * axes[0] + y * axes[1]) / np.hypot(x, y)
        direction = np.sin(angle) * level + np.cos(angle) * axes[2]
    else:
        fov = 3.0 if kind == "narrow" else 120.0
        camera, pixel = nubis.Camera.look_at(eye, eye + 100 * forward, (0, 0, 1), fov), (52, 130)
        direction = ref64.pixel_directions(camera, *size)[pixel]
    alone = nubis.Camera.look_at(eye, eye + 100 * direction, (0, 0, 1), 1e-2)
    expected = lack(alone, params, (1, 1))[0, 0]
    assert expected.min() > 0
    np.testing.assert_allclose(lack(camera, params, size)[pixel], expected, rtol=0.05)


@pytest.mark.slow
def test_a_panorama_has_no_seam():
    params = smooth(**{"sun.elevation": 20.0, "sun.azimuth": 170.0})
    seen = lack(nubis.Camera.equirect((0, 0, 200.0)), params, (240, 120))[30:90]
    seam = np.abs(seen[:, 0] - seen[:, -1]).mean()
    beside = [np.abs(seen[:, i] - seen[:, i + 1]).mean() for i in (0, -3, -2)]
    assert 0 < seam < 1.3 * max(beside)


@pytest.mark.slow
@pytest.mark.parametrize("height", [-300.0, 0.0, 2000.0, 9000.0, 60_000.0, 4e5])
def test_finite_everywhere(height):
    ours = nubis.Renderer(16, 8, quality=CHEAP)
    eye = (0.0, 0.0, height)
    cameras = (
        nubis.Camera.equirect(eye),
        nubis.Camera.fisheye(eye, fov=360.0),
        looking(-20.0, eye=eye, fov=120.0),
    )
    for elevation in (-90.0, -4.0, -1.0, 0.0, 0.3, 30.0, 90.0):
        for radius in (1e4, 6_371_000.0, 1e9):
            changes = {"sun.elevation": elevation, "atmosphere.planet_radius": radius}
            for camera in cameras:
                params = nubis.Params().with_(**changes, **{"atmosphere.haze": 20.0})
                image = ours.render(camera, params)
                assert np.isfinite(image).all() and image.min() >= 0


def test_animated():
    """The first frame is the still, and the wind takes the shadows along."""
    params = smooth(**{"sun.elevation": 20.0, "sun.azimuth": 20.0, "wind.speed": 40.0})
    params = params.with_(**{"wind.weather_speed": 40.0})
    camera = looking(-12.0, eye=(0, 0, 900))  # ground and air, and hardly a cloud
    quality = nubis.quality("draft").replace(adaptive_threshold=0.0)
    times = [0.0, 40.0, 80.0]
    frames = nubis.Renderer(64, 36, quality=quality).animate(
        (camera, params, time) for time in times
    )
    still = nubis.Renderer(64, 36, quality=quality)
    for time, frame in zip(times, frames, strict=True):
        expected = still.render(camera, params, time=time)
        if time == 0:
            assert np.array_equal(frame, expected)
        ground = (slice(14, None), slice(None))
        np.testing.assert_allclose(frame[ground], expected[ground], rtol=0.02)


def test_pictures_do_not_depend_on_those_before():
    params = nubis.scenes["fair_weather"][1]
    flown, fresh = (nubis.Renderer(48, 27, quality="draft") for _ in range(2))
    for pitch in (-20.0, 10.0, 40.0):
        image = flown.render(looking(pitch), params, time=3.0)
    assert np.array_equal(image, fresh.render(looking(40.0), params, time=3.0))


@pytest.mark.slow
def test_shadows_stay_as_they_are_baked_anew():
    """On either side of the eye's step of 600 m, and of the wind's of 32 m, nearly the same: were
    they to jump as far, they would change by 11 and 1 %.
    """
    params = smooth(**{"sun.elevation": 50.0, "wind.speed": 20.0, "wind.weather_speed": 20.0})
    params = params.with_(**{"clouds.shape_scale": 8000.0})

    def change(a, b):
        (y0, t0), (y1, t1) = a, b
        one = lack(looking(-8.0, eye=(0, y0, 900.0)), params, time=t0)
        other = lack(looking(-8.0, eye=(0, y1, 900.0)), params, time=t1)
        return ref64.relative_rmse(other, one)

    assert change((299.9, 0.0), (300.1, 0.0)) < 0.04 < 0.5 * change((0.0, 0.0), (600.0, 0.0))
    assert change((0.0, 0.799), (0.0, 0.801)) < 0.007
