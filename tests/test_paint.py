"""Strokes on weather maps: by a plain formula, and in the sky."""

import itertools
import math
import re

import numpy as np
import pytest

from nubis import ParameterError, Params, Weather, paint, paint_mask

EXTENT = 20_000.0
SIZE = 80, 100
CHANNELS = ["coverage", "type", "precipitation"]


def empty(size=SIZE, value=0.0):
    return np.full((*size, 3), value, np.float32)


def centres(size=SIZE):
    """World metres of each texel: x east, y north, the map's middle at the origin."""
    height, width = size
    x = np.array([(i + 0.5) / width - 0.5 for i in range(width)]) * EXTENT
    y = np.array([0.5 - (i + 0.5) / height for i in range(height)]) * EXTENT
    return np.meshgrid(x, y)


def brush(distance, radius, hardness):
    """Full to a share of the radius, then down by 1 - (3 t^2 - 2 t^3)."""
    t = np.clip((distance - hardness * radius) / (radius - hardness * radius), 0, 1)
    return 1 - 3 * t**2 + 2 * t**3


def test_a_dab():
    """In metres, whatever the texels' shape; elsewhere nothing, and the map given stays."""
    given = empty()
    got = paint(given, (2000, -3000), 2500, extent=EXTENT, hardness=0.2)
    x, y = centres()
    want = brush(np.hypot(x - 2000, y + 3000), 2500, 0.2)
    assert got.dtype == np.float32 and (given == 0).all()
    np.testing.assert_allclose(got[..., 0], want, atol=1e-6)
    assert (got[..., 1:] == 0).all() and 0.02 < (got[..., 0] > 0).mean() < 0.1


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize(
    ("mode", "amount", "formula"),
    [
        ("add", 0.5, lambda v, m: v + 0.5 * m),
        ("add", -1.0, lambda v, m: v - m),
        ("set", 0.9, lambda v, m: (1 - m) * v + 0.9 * m),
        ("set", 0.0, lambda v, m: (1 - m) * v),
        ("multiply", 3.0, lambda v, m: v * (1 - m + 3 * m)),
        ("multiply", 0.0, lambda v, m: v * (1 - m)),
    ],
)
def test_modes(rng, channel, mode, amount, formula):
    given = rng.uniform(0, 1, (*SIZE, 3)).astype(np.float32)
    mask = rng.uniform(0, 1, SIZE)
    got = paint_mask(given, mask, channel=channel, amount=amount, mode=mode)
    for index, name in enumerate(CHANNELS):
        old = given[..., index]
        want = np.clip(formula(old.astype(float), mask), 0, 1) if name == channel else old
        np.testing.assert_allclose(got[..., index], want, atol=1e-6)
    Weather(map=got)


def test_a_stroke_paints_once(rng):
    """A path that crosses itself, and corners on top of each other: the nearest part counts."""
    path = np.array([(-6000, -2000), (5000, 3000), (5000, 3000), (5000, -5000), (-4000, 4000)])
    got = paint(empty(), path, 1500, extent=EXTENT, amount=0.6)
    x, y = centres()
    # The path as points a metre apart.
    distance = np.full(SIZE, np.inf)
    for (x0, y0), (x1, y1) in itertools.pairwise(path):
        for t in np.linspace(0, 1, 2 + int(math.hypot(x1 - x0, y1 - y0) / 20)):
            distance = np.minimum(
                distance, np.hypot(x - x0 - t * (x1 - x0), y - y0 - t * (y1 - y0))
            )
    np.testing.assert_allclose(got[..., 0], 0.6 * brush(distance, 1500, 0.5), atol=2e-3)
    assert got.max() == pytest.approx(0.6)


@pytest.mark.parametrize("edge", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize("far", [0, 1, 2, -3])
def test_over_the_edge(edge, far):
    """As the sky repeats, mirrors or holds the map: a texel is painted if any place in the world at
    which it is seen is under the brush.
    """
    at = np.array([(9500 + far * EXTENT, 9000.0), (11_000 + far * EXTENT, 9800.0)])
    got = paint(empty(), at, 3000, extent=EXTENT, edge=edge, hardness=0.0)
    x, y = centres()
    distance = np.full(SIZE, np.inf)
    for k in range(far - 2, far + 3) if edge != "clamp" else [0]:
        for n in range(-1, 2) if edge != "clamp" else [0]:
            px = k * EXTENT + (-x if edge == "mirror" and k % 2 else x)
            py = n * EXTENT + (-y if edge == "mirror" and n % 2 else y)
            for t in np.linspace(0, 1, 100):
                sx, sy = (1 - t) * at[0] + t * at[1]
                distance = np.minimum(distance, np.hypot(px - sx, py - sy))
    np.testing.assert_allclose(got[..., 0], brush(distance, 3000, 0.0), atol=2e-3)
    assert (got.max() > 0.5) == (edge != "clamp" or far == 0)


def test_a_long_stroke():
    """Across many tiles: east along a row, which it covers once and for all."""
    got = paint(empty(), [(-1e6, 0), (1e6, 0)], 1000, extent=EXTENT)
    _, y = centres()
    np.testing.assert_allclose(got[..., 0], brush(np.abs(y), 1000, 0.5), atol=1e-6)


def test_hard_edges():
    got = paint(empty(), (0, 0), 3000, extent=EXTENT, hardness=1.0)
    x, y = centres()
    np.testing.assert_array_equal(got[..., 0], np.hypot(x, y) <= 3000)


@pytest.mark.parametrize("edge", ["repeat", "mirror"])
@pytest.mark.parametrize("drift", [0.0, 1500.0], ids=["at rest", "adrift"])
class TestInTheSky:
    AT = np.array([(7000.0, 2000.0), (12_500.0, 6000.0)])  # over the edge of the map
    RADIUS = 2500.0

    def ask(self, renderer, rng, map, drift, edge):
        """Where there is cloud, and how far the stroke is from there once it has drifted to the
        south-east.
        """
        params = Params().with_(
            **{
                "weather.map": map,
                "weather.extent": EXTENT,
                "weather.edge": edge,
                "clouds.coverage": 0.5,
                "clouds.type": 0.5,
                "wind.shear": 0.0,
                "wind.weather_direction": 135.0,
                "wind.weather_speed": 5.0,
            }
        )
        points = np.random.default_rng(3).uniform(
            [-EXTENT / 2, -EXTENT / 2, 1250], [EXTENT / 2, EXTENT / 2, 2400], (40_000, 3)
        )
        # With the weather: the stroke is in every tile, upright or mirrored, and so are the points.
        time = drift / 5.0
        gone = drift / math.sqrt(2)
        density = renderer().density(points + np.array([gone, -gone, 0]), params, time=time)
        distance = np.full(len(points), np.inf)
        for k in range(-2, 3):
            for n in range(-2, 3):
                signs = [-1 if edge == "mirror" and i % 2 else 1 for i in (k, n)]
                image = points[:, :2] * signs + EXTENT * np.array([k, n])
                for t in np.linspace(0, 1, 60):
                    on = (1 - t) * self.AT[0] + t * self.AT[1]
                    distance = np.minimum(distance, np.hypot(*(image - on).T))
        return density, distance

    @pytest.mark.slow_after(1)
    def test_cloud_appears_where_it_is_painted(self, renderer, rng, drift, edge):
        map = empty((256, 256))
        map[..., 1] = 0.6
        painted = paint(map, self.AT, self.RADIUS, extent=EXTENT, edge=edge)
        density, distance = self.ask(renderer, rng, painted, drift, edge)
        # A texel of 80 m is between its centre and the next.
        assert (density[distance > self.RADIUS + 120] == 0).all()
        assert (distance > self.RADIUS + 120).mean() > 0.3
        assert (density[distance < 0.5 * self.RADIUS - 120] > 0).mean() > 0.5

    @pytest.mark.slow_after(1)
    def test_a_place_is_kept_clear(self, renderer, rng, drift, edge):
        map = empty((256, 256), 1.0)
        map[..., 1:] = 0.6, 0.0
        clear = paint(
            map,
            self.AT,
            self.RADIUS,
            extent=EXTENT,
            edge=edge,
            mode="set",
            amount=0.0,
            hardness=0.8,
        )
        density, distance = self.ask(renderer, rng, clear, drift, edge)
        before, _ = self.ask(renderer, rng, map, drift, edge)
        inside, outside = distance < 0.8 * self.RADIUS - 120, distance > self.RADIUS + 120
        assert (before[inside] > 0).mean() > 0.5 and (density[inside] == 0).all()
        np.testing.assert_array_equal(density[outside], before[outside])


GOOD = {"map": empty((4, 4)), "at": (0, 0), "radius": 100.0, "extent": EXTENT}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"map": empty((4, 4))[0]}, "map = array of shape (4, 3)"),
        ({"map": empty((4, 4), 1.5)}, "map[0, 0, 0] = 1.5"),
        ({"map": empty((4, 4), np.nan)}, "map[0, 0, 0] = nan"),
        ({"map": "map.png"}, "map = array of shape () and dtype <U7"),
        ({"map": [[0, 1], [1]]}, "map = list that is no array"),
        ({"at": (0, 0, 0)}, "at = array of shape (3,)"),
        ({"at": np.zeros((0, 2))}, "at = array of shape (0, 2)"),
        ({"at": (0, np.inf)}, "at[1] = inf"),
        ({"at": (0, 1e8)}, "at[1] = 100000000.0"),
        ({"radius": 0.0}, "radius = 0.0"),
        ({"radius": EXTENT + 1}, "radius = 20001.0"),
        ({"radius": np.nan}, "radius = nan"),
        ({"extent": 1.0}, "extent = 1.0"),
        ({"hardness": 1.1}, "hardness = 1.1"),
        ({"amount": -1.1}, "amount = -1.1"),
        ({"amount": -0.1, "mode": "set"}, "amount = -0.1"),
        ({"amount": -0.1, "mode": "multiply"}, "amount = -0.1"),
        ({"mode": "blend"}, "mode = 'blend'"),
        ({"channel": "rain"}, "channel = 'rain'"),
        ({"edge": None}, "edge = None"),
    ],
)
def test_what_cannot_be_painted(changes, words):
    with pytest.raises(ParameterError, match=re.escape(words)) as error:
        paint(**(GOOD | changes))
    assert "is not allowed: " in str(error.value)


@pytest.mark.parametrize(
    ("mask", "words"),
    [
        (np.zeros((4, 5)), "mask = array of shape (4, 5)"),
        (np.zeros((4, 4, 1)), "mask = array of shape (4, 4, 1)"),
        (np.full((4, 4), 2.0), "mask[0, 0] = 2.0"),
        (np.full((4, 4), np.nan), "mask[0, 0] = nan"),
        (np.zeros((4, 4), bool), "mask = array of shape (4, 4) and dtype bool"),
    ],
)
def test_what_is_no_mask(mask, words):
    with pytest.raises(ParameterError, match=re.escape(words)):
        paint_mask(empty((4, 4)), mask)
