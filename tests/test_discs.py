"""What is narrower than a pixel is its mean over the pixel: the sun's disc, the glow around it, the
peaks of phase functions. Whatever the projection and the size of the picture.
"""

import numpy as np
import pytest

import nubis
from nubis.testing import probe

CLEAR = {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0}
EYE = 0.0, 0.0, 2.0
SUN_RADIUS = 0.004654


def clear(**changes):
    return nubis.Params().with_(**{**CLEAR, **changes})


def toward(azimuth, elevation):
    a, e = np.radians([azimuth, elevation])
    return np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])


def pinhole(azimuth, elevation, fov_y, eye=EYE):
    up = (0, 0, 1) if abs(elevation) < 80 else (0, 1, 0)
    return nubis.Camera.look_at(eye, np.add(eye, 1000 * toward(azimuth, elevation)), up, fov_y)


def solid_angles(camera, width, height):
    """Of each pixel, by the mean over 16 x 16 places in it, sr."""
    n = 16
    x, y = (np.arange(n * size) + 0.5 for size in (width, height))
    x, y = x[None, :] / n, y[:, None] / n
    if camera.kind == "equirect":
        omega = 2 * np.pi / width * np.pi / height * np.cos(np.pi * (0.5 - y / height)) + 0 * x
    elif camera.kind == "fisheye":
        scale = np.radians(camera.fov) / min(width, height)
        angle = np.hypot(x - width / 2, y - height / 2) * scale
        omega = scale**2 * np.sinc(angle / np.pi)
    else:
        scale = 2 * np.tan(np.radians(camera.fov) / 2) / height
        omega = scale**2 * (
            1 + (scale * (x - width / 2)) ** 2 + (scale * (y - height / 2)) ** 2
        ) ** (-1.5)
    return omega.reshape(height, n, width, n).mean(axis=(1, 3))


def disc_flux(make, camera, params):
    """Irradiance that a picture has of the sun's disc, and where it is."""
    hidden = make.render(camera, params.with_(**{"sun.visible": False}))
    height, width, _ = hidden.shape
    disc = make.render(camera, params).astype(np.float64) - hidden
    assert disc[..., :3].min() >= -1e-6 * disc.max()
    return np.einsum("yxc,yx->c", disc[..., :3], solid_angles(camera, width, height)), disc


def limb(r, exponent):
    return np.where(r < 1, np.maximum(1 - r * r, 0) ** (exponent / 2), 0) * (1 + exponent / 2)


def through_air(params, height=EYE[2]):
    """Transmittance toward the sun, the mean of its disc."""
    r = np.sqrt((np.arange(30) + 0.5) / 30)[:, None]
    height_in_disc = r * np.cos(2 * np.pi * (np.arange(40) + 0.5) / 40)
    mu = np.sin(np.radians(params.sun.elevation) + SUN_RADIUS * height_in_disc)
    points = np.stack([np.full(mu.size, height), mu.ravel()], axis=1)
    through = probe(
        "vec4f(air_transmittance(x.x, x.y), 1.0)", points, params=params, imports=["atmosphere"]
    )[:, :3].reshape(*mu.shape, 3)
    weight = limb(r, np.array([0.397, 0.503, 0.652]))[:, None, :]
    return (through * weight).sum(axis=(0, 1)) / weight.sum(axis=(0, 1)) / mu.shape[1]


@pytest.mark.slow
@pytest.mark.parametrize("width", [2, 8, 64, 128, 257, 512, 1024, 2048])
@pytest.mark.parametrize("elevation", [40.0, 3.0, 86.0, 90.0])
def test_flux_of_the_disc_in_panoramas(renderer, width, elevation):
    """E T to 0.5 %, in each colour; also around the pole."""
    params = clear(**{"sun.elevation": elevation, "sun.azimuth": 117.3})
    make = renderer(width, max(width // 2, 1), "draft")
    flux, _ = disc_flux(make, nubis.Camera.equirect(EYE), params)
    expected = np.array(params.sun.irradiance) * through_air(params)
    np.testing.assert_allclose(flux, expected, rtol=0.005)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("azimuth", [0.0, 180.0, 179.9, -90.0, 180.1])
def test_flux_across_the_seam_of_a_panorama(renderer, azimuth):
    params = clear(**{"sun.azimuth": azimuth, "atmosphere.enabled": False})
    for width in (2, 64, 720):
        flux, _ = disc_flux(
            renderer(width, max(width // 2, 1), "draft"), nubis.Camera.equirect(EYE), params
        )
        np.testing.assert_allclose(flux, params.sun.irradiance, rtol=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("fov_y", [0.5, 2.0, 10.0, 60.0, 120.0])
def test_flux_of_the_disc_in_pinholes(renderer, fov_y):
    """Panned by parts of a pixel, in the middle and toward a corner."""
    params = clear(**{"sun.azimuth": 120.0, "sun.elevation": 40.0})
    make = renderer(160, 90, "draft")
    expected = np.array(params.sun.irradiance) * through_air(params)
    pixel = fov_y / 90
    flux = []
    for i in range(5):
        away = (13.0 if fov_y > 20 else 0.0) + 0.37 * i * pixel
        camera = pinhole(120.0 + away, 40.0 + 0.6 * away, fov_y)
        if fov_y > 0.6:
            flux.append(disc_flux(make, camera, params)[0])
    if flux:
        np.testing.assert_allclose(flux, np.broadcast_to(expected, (5, 3)), rtol=0.005)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("fov", [60.0, 180.0, 240.0])
@pytest.mark.parametrize("size", [24, 96, 500])
def test_flux_of_the_disc_in_fisheyes(renderer, fov, size):
    """From the middle to the rim."""
    make = renderer(size, size, "draft")
    camera = nubis.Camera.fisheye((0.0, 0.0, 2e6), (0, 0, 1), fov)
    pixel = fov / size
    for elevation in (90.0, 70.0, 90 - fov / 2 + 0.3 + 1.5 * pixel):
        params = clear(
            **{"sun.elevation": elevation, "sun.azimuth": 33.0, "atmosphere.enabled": False}
        )
        flux, _ = disc_flux(make, camera, params)
        np.testing.assert_allclose(flux, params.sun.irradiance, rtol=0.005)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("fov_y", [1.2, 5.0, 25.0, 90.0])
def test_each_pixel_has_its_share_of_the_disc(renderer, fov_y):
    """Against 40 x 40 places in each pixel: edge, limb and middle."""
    width, height = 48, 36
    params = clear(**{"sun.azimuth": 10.0, "sun.elevation": 30.0, "atmosphere.enabled": False})
    tan = np.tan(np.radians(fov_y) / 2)
    camera = pinhole(10.0 + 0.11 * fov_y, 30.0 - 0.07 * fov_y, fov_y)
    _, disc = disc_flux(renderer(width, height, "draft"), camera, params)
    n = 40
    x = ((np.arange(n * width) + 0.5) / n / width * 2 - 1) * tan * width / height
    y = (1 - (np.arange(n * height) + 0.5) / n / height * 2) * tan
    axes = np.array([camera.right, camera.up, camera.forward])
    rays = x[None, :, None] * axes[0] + y[:, None, None] * axes[1] + axes[2]
    weight = np.linalg.norm(rays, axis=-1) ** -3
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    r = np.linalg.norm(rays - toward(10.0, 30.0), axis=-1) / SUN_RADIUS
    for channel, exponent in enumerate((0.397, 0.503, 0.652)):
        bright = params.sun.irradiance[channel] / (np.pi * SUN_RADIUS**2)
        light = bright * limb(r, exponent) * weight
        blocks = (height, n, width, n)
        mean = light.reshape(blocks).mean(axis=(1, 3)) / weight.reshape(blocks).mean(axis=(1, 3))
        np.testing.assert_allclose(disc[..., channel], mean, rtol=0.02, atol=0.004 * mean.max())


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("up", [-0.9, -0.4, 0.0, 0.4, 0.9])
@pytest.mark.parametrize("size", [(64, 32), (1024, 512), (160, 90)])
def test_a_setting_sun_has_the_part_that_is_up(renderer, up, size):
    """The segment of a disc without a darker limb is between what limb darkening makes of it."""
    eye = (0.0, 0.0, 200.0)
    dip = np.degrees(np.arccos(6371e3 / (6371e3 + 200.0)))
    params = clear(
        **{
            "sun.elevation": -dip + up * np.degrees(SUN_RADIUS),
            "sun.azimuth": 77.0,
            "atmosphere.enabled": False,
        }
    )
    camera = pinhole(75.0, 0.1, 20.0, eye) if size[0] == 160 else nubis.Camera.equirect(eye)
    flux, _ = disc_flux(renderer(*size, "draft"), camera, params)
    r = np.sqrt((np.arange(4000) + 0.5) / 4000)
    visible = np.where(r > abs(up), np.arccos(np.clip(-up / r, -1, 1)) / np.pi, up > 0)
    for channel, exponent in enumerate((0.397, 0.503, 0.652)):
        share = np.mean(limb(r, exponent) * visible)
        assert flux[channel] / params.sun.irradiance[channel] == pytest.approx(share, abs=0.005)


def test_a_telephoto_disc_is_smooth(renderer):
    """Its brightness falls from the middle to the limb without steps, and is none beyond."""
    params = clear(**{"sun.elevation": 35.0, "sun.azimuth": 0.0, "atmosphere.enabled": False})
    _, disc = disc_flux(renderer(640, 8, "draft"), pinhole(0.0, 35.0, 8 * 0.6 / 640), params)
    row = disc[4, :, 1]
    x = np.abs(np.arange(640) + 0.5 - 320) * np.radians(0.6 / 640) / SUN_RADIUS
    expected = limb(x, 0.503) * params.sun.irradiance[1] / (np.pi * SUN_RADIUS**2)
    inside = x < 0.97
    np.testing.assert_allclose(row[inside], expected[inside], rtol=0.01)
    assert (row[x > 1.01] == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("elevation", [40.0, 8.0, 0.5])
def test_glow_around_the_sun_in_coarse_panoramas(renderer, elevation):
    """The mean of a fine panorama over each pixel near the sun: to 1.5 %."""
    params = clear(**{"sun.elevation": elevation, "sun.visible": False, "atmosphere.haze": 10.0})
    camera = nubis.Camera.equirect((0.0, 0.0, 300.0))
    fine = renderer(1024, 512, "draft").render(camera, params)[..., :3].astype(np.float64)
    weight = solid_angles(camera, 1024, 512)[:, :, None]
    for width in (16, 32, 64):
        n = 1024 // width
        blocks = (width // 2, n, width, n, -1)
        mean = (fine * weight).reshape(blocks).sum(axis=(1, 3)) / weight.reshape(blocks).sum(
            axis=(1, 3)
        )
        coarse = renderer(width, width // 2, "draft").render(camera, params)[..., :3]
        up = slice(0, width // 4)
        np.testing.assert_allclose(coarse[up], mean[up], rtol=0.015)


SLAB = nubis.DensityGrid(
    np.full((2, 2, 2), 1e-4, np.float32), ((-9e5, -9e5, 1000.0), (9e5, 9e5, 1200.0))
)
PEAKS = {
    "glory": ({"light.phase": "mie"}, -1),
    "aureole": ({"light.phase": "mie"}, 1),
    "small droplets": ({"light.phase": "mie", "light.droplet_diameter": 8.0}, -1),
    "fit": ({"light.phase": "droplet"}, 1),
    "narrow lobe": ({"light.g": 0.99}, 1),
    "backward lobe": ({"light.g": -0.98}, -1),
}


@pytest.mark.slow
@pytest.mark.parametrize("peak", PEAKS)
@pytest.mark.parametrize("model", ["single", "octaves"])
def test_peaks_of_phase_functions_in_wide_pixels(renderer, peak, model):
    """The mean of a fine picture over each pixel, of a thin uniform layer: to 2 %."""
    changes, side = PEAKS[peak]
    params = nubis.Params(volume=SLAB).with_(
        **{
            "light.model": model,
            "atmosphere.enabled": False,
            "high_clouds.coverage": 0.0,
            "sun.elevation": 40.0,
            "sun.azimuth": 0.0,
            **changes,
        }
    )
    eye = (0.0, 0.0, 100.0 if side > 0 else 9000.0)
    direction = side * toward(0.7, 41.3)
    camera = nubis.Camera.look_at(eye, np.add(eye, 1000 * direction), fov_y=30.0)
    size, n = (16, 12), 16
    few = nubis.quality("draft").replace(adaptive_threshold=0.0, steps_zenith=12, steps_horizon=12)
    fine = renderer(size[0] * n, size[1] * n, few).render(camera, params, background=None)
    fine = fine[..., :3].astype(np.float64)
    weight = solid_angles(camera, size[0] * n, size[1] * n)[..., None]
    blocks = size[1], n, size[0], n, -1
    mean = (fine * weight).reshape(blocks).sum(axis=(1, 3)) / weight.reshape(blocks).sum(
        axis=(1, 3)
    )
    coarse = renderer(*size, few).render(camera, params, background=None)[..., :3]
    np.testing.assert_allclose(coarse, mean, rtol=0.02)


def test_width_of_a_pixel_is_that_of_its_place(renderer):
    """A pixel that looks 50 degrees off the axis of a wide pinhole shows the clouds that one of the
    same width shows in the middle of a narrow one.
    """
    params = nubis.Params().with_(**{"high_clouds.coverage": 0.0, "sun.visible": False})
    eye = (0.0, 0.0, 200.0)
    quality = nubis.quality("draft").replace(adaptive_threshold=0.0, jitter=False)
    off, fov = 50.0, 110.0
    wide = renderer(601, 41, quality)
    narrow = renderer(3, 3, quality)
    tan = np.tan(np.radians(fov) / 2)
    # Of the row through the middle, the pixel nearest to that angle.
    aim = toward(20.0, 25.0)
    level = np.cross(aim, (0, 0, 1))
    level /= np.linalg.norm(level)
    column = int(301 + np.tan(np.radians(off)) / (tan * 2 / 41))
    angle = np.arctan((column + 0.5 - 300.5) * tan * 2 / 41)
    errors = []
    axis = np.cos(angle) * aim - np.sin(angle) * level
    up = np.cross(level * np.cos(angle) + aim * np.sin(angle), axis)
    camera = nubis.Camera.look_at(eye, np.add(eye, 1e4 * axis), up, fov)
    seen = wide.render(camera, params, background=None)[20, column]
    for scale in (np.cos(angle), 1.0):
        fov_y = np.degrees(2 * np.arctan(3 * tan / 41 * scale))
        same = nubis.Camera.look_at(eye, np.add(eye, 1e4 * aim), (0, 0, 1), fov_y)
        errors.append(np.abs(narrow.render(same, params, background=None)[1, 1] - seen).max())
    assert errors[0] < 1e-4 < errors[1]
