"""Clouds exist wherever the eye is: to the limb from any altitude, and as much of them whatever
the size of the picture and the numerical method.
"""

import math

import numpy as np
import pytest

import nubis
import ref64

RADIUS = nubis.Params().atmosphere.planet_radius
CUMULUS = nubis.Params().with_(**{"clouds.coverage": 0.5, "high_clouds.coverage": 0.0})


def toward_limb(height, below, fov):
    """A view so many degrees under the horizon of an eye."""
    angle = math.acos(RADIUS / (RADIUS + height)) + math.radians(below)
    ahead = (0, math.cos(angle), height - math.sin(angle))
    return nubis.Camera.look_at((0, 0, height), ahead, fov_y=fov)


def straight_down(height, fov):
    return nubis.Camera.look_at((0, 0, height), (0, 1e-3, 0), (0, 1, 0), fov)


def seen(renderer, camera, size, quality="draft", params=CUMULUS):
    """Mean opacity and radiance of the clouds."""
    layers = renderer(size, size, quality).render_layers(camera, params)
    return 1 - layers["transmittance"].mean(), layers["radiance"].mean()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("height", [10.0, 9e3, 3e4, 4.02e5, 2e6, 3.6e7])
@pytest.mark.parametrize("quality", ["draft", "high"])
def test_overcast_reaches_the_limb(renderer, height, quality):
    """A closed deck hides all of the ground, or the sky, up to the ray that touches the planet:
    400 km straight down, and 700 km away from 30 km up, nothing was.
    """
    overcast = CUMULUS.with_(
        **{
            "clouds.coverage": 1.0,
            "weather.map": np.ones((1, 1, 3), np.float32),
            "clouds.extinction": 1.0,
            "clouds.type": 0.5,
        }
    )
    dip = math.degrees(math.acos(RADIUS / (RADIUS + height)))
    side = 1 if height > overcast.clouds.top else -1  # down on the deck, or up
    for below in (0.01, 0.3, 2.0, 10.0, 89.9 - dip):
        camera = toward_limb(height, side * below, 0.002)
        opacity, _ = seen(renderer, camera, 8, quality, overcast)
        assert opacity > 0.97, f"{below} degrees from the horizon"


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("height", [3e4, 4.02e5, 2e6])
def test_transmittance_from_afar(renderer, height):
    """Rays straight down and slanting, in float64, through a field that steps resolve."""
    params = ref64.smooth_params(**{"clouds.extinction": 5e-4})
    angles = np.radians([0.0, 3.0, 10.0])
    for angle in angles:
        direction = np.array([0.0, math.sin(angle), -math.cos(angle)])
        eye = np.array([2000.0, 1000.0, height])
        camera = nubis.Camera.look_at(eye, eye + direction, (0, 1, 0.1), fov_y=1e-4)
        got = renderer(1, 1, ref64.fine(256)).render_layers(camera, params)["transmittance"][0, 0]
        near = ref64.sphere_hits(eye, direction, RADIUS, params.clouds.top)[0]
        start = (eye + near * direction)[None]
        ends = ref64.sphere_hits(start[0], direction, RADIUS, params.clouds.base)[0].reshape(1)
        depth, _ = ref64.optical_depths(renderer(), params, start, direction[None], ends, 2000)
        np.testing.assert_allclose(got, np.exp(-depth.sum()), atol=5e-3)


VIEWS = {
    "30 km": (lambda: toward_limb(3e4, 1.0, 4.0), (16, 64, 128)),
    "402 km": (lambda: straight_down(4.02e5, 20.0), (48, 96, 256)),
    "402 km, limb": (lambda: toward_limb(4.02e5, 6.0, 10.0), (32, 64, 128)),
    "2000 km": (lambda: straight_down(2e6, 30.0), (32, 64, 128)),
    "36000 km": (lambda: straight_down(3.6e7, 8.0), (16, 32, 64)),
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("view", VIEWS)
def test_there_is_as_much_cloud_at_any_size(renderer, view):
    """Mean opacity to 0.02, and mean radiance to 10 %, whatever the size of the picture: where
    levels of detail made far clouds smaller, a third of the cover was lost in small ones. The light
    field of small pictures has cells twice as wide: from 402 km clouds are 8 % darker in them.
    """
    camera, sizes = VIEWS[view]
    means = np.array([seen(renderer, camera(), size) for size in sizes])
    assert 0.2 < means[0, 0] < 0.9
    assert np.ptp(means[:, 0]) < 0.02
    assert np.ptp(means[:, 1]) < 0.10 * means[-1, 1]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("view", VIEWS)
def test_there_is_as_much_cloud_by_any_method(renderer, view):
    """In cells of a light field that are wider than clouds these are darker: in `high`, whose cells
    are half as wide, clouds are 17 % brighter from 402 km. Paths are in between.
    """
    camera, sizes = VIEWS[view]
    means = np.array(
        [seen(renderer, camera(), sizes[1], q) for q in ("preview", "draft", "balanced", "high")]
    )
    assert np.ptp(means[:, 0]) < 0.015
    assert np.ptp(means[:-1, 1]) < 0.05 * means[-1, 1]
    assert np.ptp(means[:, 1]) < 0.2 * means[-1, 1]


@pytest.mark.slow
def test_converged_and_traced_clouds_are_as_many(renderer):
    """One ray through each pixel, and one path in each of many places of it."""
    camera = straight_down(2e6, 20.0)
    traced = CUMULUS.with_(**{"light.model": "path"})
    few = nubis.quality("balanced").replace(path_samples=16, path_scatterings=1)
    means = [
        seen(renderer, camera, 48)[0],
        seen(renderer, camera, 48, few, traced)[0],
        seen(renderer, camera, 48, nubis.quality("reference").replace(tolerance=0.05))[0],
    ]
    assert np.ptp(means) < 0.03


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(("height", "fov"), [(3e6, 40.0), (3.6e7, 8.0)])
def test_clouds_smaller_than_pixels_do_not_speckle(renderer, height, fov):
    """A pixel that covers many clouds has their mean: neighbours differ by 0.2 at most, root mean
    square, where one ray through each would see cloud or none and differ by 0.6.
    """
    layers = renderer(64, 64).render_layers(straight_down(height, fov), CUMULUS)
    opacity = 1 - layers["transmittance"].astype(float)
    assert np.sqrt(np.mean(np.diff(opacity, axis=1) ** 2)) < 0.2


def test_no_line_where_the_number_of_rays_changes(renderer):
    """No pixel is brighter, or clearer than clear, than the clouds around it, where its neighbours
    have more rays: on lavapipe the others' last turn was added to it.
    """
    layers = renderer(240, 120).render_layers(toward_limb(4.02e5, 8.0, 30.0), CUMULUS)
    opacity = 1 - layers["transmittance"].astype(float)
    assert opacity.min() >= 0
    light = layers["radiance"].sum(axis=-1) / np.maximum(opacity, 0.2)
    assert light.max() < 1.5 * np.percentile(light, 99)
