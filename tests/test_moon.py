"""The moon: the sun's light path with another light, and both together."""

import numpy as np
import pytest

import nubis
from test_discs import EYE, pinhole, solid_angles, toward

DARK = {"atmosphere.night": (0.0, 0.0, 0.0)}
CLEAR = {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0}
BELOW = {"sun.elevation": -90.0}
MOON_RADIUS = 0.004520
CAMERA = nubis.Camera.look_at((0, 0, 200.0), (900, -700, 500.0), fov_y=60.0)


def up(elevation=40.0, azimuth=120.0, **changes):
    return {"moon.elevation": elevation, "moon.azimuth": azimuth, **changes}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("model", ["octaves", "single", "nubis2015", "path"])
@pytest.mark.parametrize("background", ["sky", None])
def test_moonlight_is_the_suns_light_path(renderer, model, background):
    """A full moon gives the picture of a sun in its place, times their irradiances. Of grey light:
    clouds hide the sky behind their own white, which mixes colours.
    """
    base = nubis.Params().with_(**{"light.model": model, "sun.visible": False, **DARK})
    method = nubis.quality("draft").replace(adaptive_threshold=0.0, path_samples=4)
    make = renderer(32, 18, method)
    day = make.render(CAMERA, base, background=background)
    grey = {"moon.irradiance": (3e-5, 3e-5, 3e-5)} if model != "single" else {}
    moon = base.with_(**up(), **BELOW, **{"moon.visible": False}, **grey)
    night = make.render(CAMERA, moon, background=background)
    share = np.array(moon.moon.irradiance) / moon.sun.irradiance
    np.testing.assert_allclose(
        night[..., :3], day[..., :3] * share, rtol=2e-3, atol=1e-4 * (day[..., :3] * share).max()
    )
    np.testing.assert_array_equal(night[..., 3], day[..., 3])


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("background", ["sky", None])
@pytest.mark.parametrize("sun", [-8.0, -4.5, 40.0])
def test_sun_and_moon_shine_together(renderer, sun, background):
    """Their picture is the sum of that by the sun and that by the moon, the night counted once."""
    bright = up(25.0, 300.0, **{"moon.irradiance": (1.0, 0.8, 0.6)}) if sun > 0 else up(25.0, 300.0)
    both = nubis.Params().with_(**{"sun.elevation": sun, "sun.visible": False, **bright})
    both = both.with_(**{"moon.visible": False, "light.ambient": (1e-6, 2e-6, 3e-6)})
    make = renderer(32, 18)
    together, sun_only, moon_only, neither = (
        make.render(CAMERA, both.with_(**changes), background=background)[..., :3]
        for changes in (
            {},
            {"moon.elevation": -90.0},
            {"sun.irradiance": (0.0,) * 3},
            {"sun.irradiance": (0.0,) * 3, "moon.elevation": -90.0},
        )
    )
    assert sun_only.max() > 1e-9 and moon_only.max() > 1e-9
    expected = sun_only.astype(np.float64) + moon_only - neither
    np.testing.assert_allclose(together, expected, rtol=5e-3, atol=1e-3 * expected.max())


@pytest.mark.slow
def test_layers_of_both(renderer):
    """They make up the picture, as those of one light do; depth and transmittance know no light."""
    params = nubis.Params().with_(**{"sun.elevation": -7.0}, **up())
    make = renderer(32, 18)
    layers, picture = make.render_layers(CAMERA, params), make.render(CAMERA, params)
    over = layers["radiance"] + layers["transmittance"][..., None] * layers["sky"]
    np.testing.assert_allclose(picture[..., :3], over, rtol=1e-4, atol=1e-9)
    sunlit = make.render_layers(CAMERA, params.with_(**{"moon.elevation": -90.0}))
    for name in "depth", "transmittance":
        np.testing.assert_array_equal(layers[name], sunlit[name])


@pytest.mark.slow
def test_no_moon_by_default(renderer):
    """Nor does one far under the horizon change a byte."""
    make = renderer(32, 18)
    for sun in 40.0, -7.0, -40.0:
        params = nubis.Params().with_(**{"sun.elevation": sun})
        picture = make.render(CAMERA, params)
        sunk = params.with_(**up(-75.0))
        np.testing.assert_array_equal(make.render(CAMERA, sunk), picture)


@pytest.mark.slow
def test_frames_of_both_are_their_stills(renderer):
    """An animation by two lights, of a static shot, and one whose lights come and go."""
    make = nubis.Renderer(32, 18, quality=nubis.quality("draft").replace(adaptive_threshold=0.0))
    params = nubis.Params().with_(**{"sun.elevation": -7.0}, **up())
    still = make.render(CAMERA, params)
    for frame in make.animate((CAMERA, params, 0.0) for _ in range(3)):
        np.testing.assert_allclose(frame, still, rtol=1e-5, atol=1e-10)
    dusk = [params.with_(**{"sun.elevation": -e}) for e in (0.0, 7.0, 40.0, 7.0)]
    for sky, frame in zip(dusk, make.animate((CAMERA, sky, 0.0) for sky in dusk), strict=True):
        assert np.isfinite(frame).all() and frame[..., :3].min() >= 0
        expected = make.render(CAMERA, sky)[..., :3].mean()
        assert frame[..., :3].mean() == pytest.approx(expected, rel=0.5)


@pytest.mark.slow
def test_the_users_scene_shines_once(renderer):
    """Its radiance is not counted by each light."""
    params = nubis.Params().with_(**{"sun.elevation": -7.0}, **up(), **CLEAR)
    make = renderer(16, 12)
    distance = np.full((12, 16), 5.0, np.float32)
    color = np.full((12, 16, 3), 3.0, np.float32)
    seen = make.render(CAMERA, params, scene_depth=distance, scene_color=color)
    np.testing.assert_allclose(seen[..., :3], 3.0, rtol=1e-3)


def moon_flux(make, camera, params):
    hidden = make.render(camera, params.with_(**{"moon.visible": False}))
    height, width, _ = hidden.shape
    disc = (make.render(camera, params).astype(np.float64) - hidden)[..., :3]
    return np.einsum("yxc,yx->c", disc, solid_angles(camera, width, height)), disc


def law(phase):
    """Krisciunas and Schaefer 1991, equation 9."""
    degrees = 180 * abs(1 - 2 * phase)
    return 10 ** (-0.4 * (0.026 * degrees + 4e-9 * degrees**4))


@pytest.mark.parametrize("phase", [0.15, 0.25, 0.4, 0.5, 0.75])
@pytest.mark.parametrize("width", [64, 512])
def test_flux_of_the_moons_disc(renderer, phase, width):
    """The moon's irradiance in its phase, in wide and narrow pixels; by day too."""
    vacuum = {"atmosphere.enabled": False, "moon.phase": phase, **CLEAR}
    make = renderer(width, width // 2)
    for sun in -60.0, 30.0:
        params = nubis.Params().with_(
            **vacuum, **up(), **{"sun.elevation": sun, "sun.azimuth": 10.0}
        )
        flux, _ = moon_flux(make, nubis.Camera.equirect(EYE), params)
        np.testing.assert_allclose(flux, np.array(params.moon.irradiance) * law(phase), rtol=0.005)


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_a_new_moon_is_dark(renderer, phase):
    params = nubis.Params().with_(**up(), **BELOW, **{"moon.phase": phase}, **CLEAR)
    none = params.with_(**{"moon.elevation": -90.0})
    make = renderer(32, 18)
    np.testing.assert_allclose(make.render(CAMERA, params), make.render(CAMERA, none), atol=1e-9)


@pytest.mark.parametrize("phase", [0.12, 0.25, 0.36, 0.5])
@pytest.mark.parametrize("sun", [(-20.0, 90.0), (5.0, 200.0), (70.0, 120.0)])
def test_the_lit_side_is_toward_the_sun(renderer, phase, sun):
    """Against a ball that is lit from there, at 20 x 20 places in each pixel."""
    params = nubis.Params().with_(
        **up(30.0, 150.0, **{"moon.phase": phase, "atmosphere.enabled": False}), **CLEAR
    )
    params = params.with_(**{"sun.elevation": sun[0], "sun.azimuth": sun[1], "sun.visible": False})
    size, n = 40, 20
    camera = pinhole(150.0, 30.0, 0.7)
    _, disc = moon_flux(renderer(size, size), camera, params)
    tan = np.tan(np.radians(0.35))
    at = ((np.arange(n * size) + 0.5) / n / size * 2 - 1) * tan / MOON_RADIUS
    x, y = at[None, :], -at[:, None]
    moon = toward(150.0, 30.0)
    beside = toward(sun[1], sun[0]) - toward(sun[1], sun[0]) @ moon * moon
    light = np.array([beside @ camera.right, beside @ camera.up])
    light /= np.linalg.norm(light)
    along, across = x * light[0] + y * light[1], x * light[1] - y * light[0]
    angle = np.pi * abs(1 - 2 * phase)
    edge = np.sqrt(np.maximum(1 - across**2, 0))
    lit = (x * x + y * y < 1) & (along > -np.cos(angle) * edge)
    share = lit.reshape(size, n, size, n).mean(axis=(1, 3))
    bright = disc[..., 1] / disc[..., 1].max()
    np.testing.assert_allclose(bright, share / share.max(), atol=0.03)


def test_moonlight_casts_shadows(renderer):
    """On the ground, as the sun's does there."""
    camera = nubis.Camera.look_at((0, 0, 7000.0), (1800, 5000, 0.0), fov_y=60.0)
    base = nubis.Params().with_(**{"high_clouds.coverage": 0.0, **DARK})
    make = renderer(64, 36)
    day = make.render_layers(camera, base)["sky"][20:]
    night = make.render_layers(camera, base.with_(**BELOW, **up()))["sky"][20:]
    assert day.std() > 0.05 * day.mean()
    share = np.array(base.moon.irradiance) / base.sun.irradiance
    np.testing.assert_allclose(night, day * share, rtol=0.01)


def test_bad_moons_are_refused():
    for name, value in (("phase", 1.5), ("elevation", 91.0), ("irradiance", (0.0, -1.0, 0.0))):
        with pytest.raises(nubis.ParameterError, match=f"moon.{name}|{name}"):
            nubis.Renderer(4, 4).render(CAMERA, nubis.Params().with_(**{f"moon.{name}": value}))
