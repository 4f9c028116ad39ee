"""The chart on which weather, noises and high clouds lie: true near the eye, without a preferred
direction anywhere in sight.
"""

import math

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe

RADIUS = 6_371_000.0
PLACE = "vec4f(on_chart(x.xyz, altitude_at(x.xyz)), 0.0, 0.0)"
IMPORTS = ["shell", "chart"]
EYES = {
    "ground": (0.0, 0.0, 2.0),
    "town": (40_000.0, -25_000.0, 150.0),
    "far": (900_000.0, 700_000.0, -100_000.0),
    "orbit": (30_000.0, 10_000.0, 402_000.0),
    "geostationary": (0.0, 0.0, 35_786_000.0),
}


def at_angle(angle, azimuth, height):
    """World points so many radians around the planet from the origin."""
    level = (RADIUS + height) * np.sin(angle)
    z = -2 * RADIUS * np.sin(angle / 2) ** 2 + height * np.cos(angle)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), z], axis=-1)


def visible(eye, rng, n):
    """World points of the clouds that an eye sees, and of those beyond its horizon that rise over
    it.
    """
    height = ref64.altitude(eye, RADIUS)
    most = math.acos(RADIUS / (RADIUS + max(height, 0))) + math.acos(RADIUS / (RADIUS + 10_000))
    cap = at_angle(most * np.sqrt(rng.uniform(0, 1, n)), rng.uniform(0, 2 * np.pi, n), 0)
    return ref64.raised(cap, RADIUS, rng.uniform(0, 10_000, n)), most


@pytest.mark.slow_after(4)
@pytest.mark.parametrize("name", EYES)
@pytest.mark.parametrize("away", [1e-2, 10.0, 1e4, 3e5])
def test_places_beside_the_eye(rng, name, away):
    """A centimetre within 10 km, however far the eye is from the origin; beyond that 5e-7 of the
    distance, which is what single precision leaves of a point.
    """
    eye = np.array(EYES[name])
    p = (away * ref64.normalized(rng.normal(size=(300, 3)))).astype(np.float32)
    got = probe(PLACE, p, imports=IMPORTS, eye=tuple(eye))[:, :2]
    here, there = (ref64.on_chart(at, RADIUS) for at in (eye, eye + p.astype(np.float64)))
    np.testing.assert_allclose(got, there - here, atol=max(0.01, 5e-7 * away))


@pytest.mark.parametrize("height", [2e6, 36e6])
def test_no_direction_is_preferred_in_sight(rng, height):
    """Steps of 20 km through points in the visible cap: their images on the chart
    are as long in all directions, and at right angles, to 2 %. Straight along z the ratio was 1.3
    from 2000 km and 6.6 from 36 000 km.
    """
    points, most = visible((0.0, 0.0, height), rng, 400)
    up = ref64.normalized(ref64.from_centre(points, RADIUS))
    east = ref64.normalized(np.cross([0.0, 1.0, 0.0], up))
    north = np.cross(up, east)
    steps = []
    for side in (east, north):
        # An eye beside each point would be as good: these are read from above the origin.
        ends = [points + s * 20_000 * side - (0, 0, height) for s in (-0.5, 0.5)]
        a, b = (
            probe(PLACE, end, imports=IMPORTS, eye=(0, 0, height))[:, :2].astype(float)
            for end in ends
        )
        steps.append((b - a) / 20_000)
    jacobian = np.stack(steps, axis=-1)
    stretch = np.linalg.svd(jacobian, compute_uv=False)
    assert (stretch[:, 0] / stretch[:, 1]).max() < 1.02
    # By how much shapes are smaller: as the docs say, 1.73 at the limb from 36 000 km.
    assert stretch.max() < 2 / (1 + math.cos(most)) * 1.02


def correlation_length(values, spacing):
    """Distance over which the autocorrelation of rows falls to half."""
    rest = values - values.mean()
    variance = np.mean(rest**2)
    for lag in range(1, values.shape[1]):
        if np.mean(rest[:, lag:] * rest[:, :-lag]) < 0.5 * variance:
            return lag * spacing
    raise AssertionError("no end of the correlation")


@pytest.mark.parametrize("angle", [40.0, 75.0])
def test_clouds_keep_their_proportions(renderer, angle):
    """The density field far from the origin correlates over as long a way toward the origin as
    across, to 25 %, on lines of 200 m steps. Along z it was 3.9 times as long at 75 degrees.
    """
    params = nubis.Params().with_(**{"clouds.coverage": 0.6, "weather.broad_variety": 0.0})
    spacing, lines, length = 200.0, 48, 400
    along = np.arange(length) * spacing / RADIUS
    across = np.arange(lines) * 4100.0 / RADIUS
    middle = math.radians(angle)
    out, side = np.meshgrid(along, across)
    around = side.copy()
    toward = at_angle(middle + out, around / math.sin(middle), 2000.0)
    sideways = at_angle(middle + side, out / math.sin(middle), 2000.0)
    lengths = []
    for points in (toward, sideways):
        density = renderer().density(points.reshape(-1, 3), params).reshape(lines, length)
        lengths.append(correlation_length(density > 0, spacing))
    assert 0.8 < lengths[0] / lengths[1] < 1.25


def test_columns_are_upright_anywhere(renderer, rng):
    """Above one place on the ground there is one weather, up to 69 degrees from the origin: what is
    cloud 2 km up is so 4 km up, but at the borders of texels, where the noise decides, which is
    another there. Of columns along z a third would differ.
    """
    params = nubis.Params().with_(
        **{
            "weather.map": (rng.uniform(size=(64, 64, 1)) > 0.5).astype(np.float32).repeat(3, -1),
            "clouds.coverage": 0.5,
            "clouds.type": 1.0,
            "clouds.top": 9200.0,
            "clouds.detail": 0.0,
            "wind.shear": 0.0,
        }
    )
    angle, azimuth = rng.uniform(0, 1.2, 2000), rng.uniform(0, 2 * np.pi, 2000)
    low, high = (
        renderer().density(at_angle(angle, azimuth, h), params) > 0 for h in (2000.0, 4000.0)
    )
    assert 0.3 < high.mean() < 0.7
    assert (high != low).mean() < 0.15
