"""Skies between skies."""

import dataclasses
import math
import re
import typing

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import nubis
import strategies
from nubis import ParameterError, Params, Weather, lerp
from test_params import GROUPS, IMAGES, allowed, kind
from test_weather import shares

FIELDS = [
    (group, field.name)
    for group, cls in GROUPS.items()
    if group != "weather"
    for field in dataclasses.fields(cls)
]
FLOATS = [f for f in FIELDS if kind(*f) is float]
ANGLES = [f for f in FLOATS if "from -360 to 360 degrees" in allowed(*f)[0]]
VECTORS = [f for f in FIELDS if typing.get_origin(kind(*f)) is tuple]
OTHERS = [f for f in FIELDS if f not in FLOATS + VECTORS]

#: What all weathers of a mixture have in common.
MUST_BE_EQUAL = ("extent", "edge", "broad_extent")

thorough = settings(
    max_examples=150, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True
)
between = st.one_of(
    st.sampled_from([0.0, 1.0, 0.5, 1e-9, 1 - 1e-9, math.nextafter(0.5, 0)]), st.floats(0, 1)
)


def value(params, group, name):
    return getattr(getattr(params, group), name)


def apart(a, b):
    """Degrees between two directions."""
    return abs((a - b + 180) % 360 - 180)


def test_there_are_fields_of_every_kind():
    assert {("sun", "azimuth"), ("wind", "direction"), ("wind", "weather_direction")} <= set(ANGLES)
    assert ("sun", "elevation") not in ANGLES
    assert len(FLOATS) > 30 and len(VECTORS) > 3 and ("light", "model") in OTHERS


def test_no_room_for_a_deck():
    """Between a sky whose clouds reach as high as any may and one with a deck there is none yet."""
    deck = {"upper_clouds.coverage": 0.5, "upper_clouds.base": 6000.0, "upper_clouds.top": 7000.0}
    high, low = Params().with_(**{"clouds.top": 25_000.0}), Params().with_(**deck)
    assert lerp(high, low, 1e-9).upper_clouds.coverage == 0
    sky = lerp(high, low, 0.1)
    assert sky.upper_clouds.coverage == pytest.approx(0.05)
    assert sky.upper_clouds.base >= sky.clouds.top


@pytest.mark.slow
@thorough
@given(a=strategies.params(), b=strategies.params(), t=between)
def test_between_any_two_skies(a, b, t):
    """It is a sky: every range holds, tops are above bases, shares are 1 together. Each number lies
    where it should.
    """
    sky = lerp(a, b, t)
    for group, name in FLOATS:
        x, y, z = (value(p, group, name) for p in (a, b, sky))
        if (group, name) in ANGLES:
            continue
        if group == "upper_clouds" and name in ("base", "top"):
            # A deck stands above the clouds, which may be higher where it has none.
            assert z >= min(x, y)
            continue
        if (group, name) == ("upper_clouds", "coverage") and sky.clouds.top > 24_999:
            assert z in (0, pytest.approx((1 - t) * x + t * y))  # no room for a deck
            continue
        close = 1e-6 * max(abs(x), abs(y))
        if name == "top":
            close += 0.002  # what f32 knows at 25 km
        assert z == pytest.approx((1 - t) * x + t * y, rel=0, abs=close + 1e-30), (group, name)
        assert min(x, y) - (close if name == "top" else 0) <= z <= max(x, y) + close
    for group, name in ANGLES:
        x, y, z = (value(p, group, name) for p in (a, b, sky))
        arc = apart(x, y)
        assert apart(x, z) == pytest.approx(t * arc, abs=1e-4), (group, name)
        assert apart(z, y) == pytest.approx((1 - t) * arc, abs=1e-4), (group, name)
    for group, name in VECTORS:
        x, y, z = (np.array(value(p, group, name)) for p in (a, b, sky))
        # Of numbers with unlike signs next to nothing may be left.
        most = 1e-6 * np.maximum(np.abs(x), np.abs(y)).max()
        np.testing.assert_allclose(z, (1 - t) * x + t * y, rtol=1e-6, atol=most + 1e-30)
    later = b if t >= 0.5 else a
    for group, name in OTHERS:
        if (group, name) in IMAGES:
            continue
        assert value(sky, group, name) == value(later, group, name), (group, name)
    assert sky.volume == later.volume
    if all(getattr(a.weather, n) == getattr(b.weather, n) for n in MUST_BE_EQUAL):
        want = {}
        for p, weight in ((a, 1 - t), (b, t)):
            for weather, share in shares(p.weather, p.weather_mix).items():
                want[weather] = want.get(weather, 0) + weight * share
        got = shares(sky.weather, sky.weather_mix)
        for weather in {*want, *got}:
            assert got.get(weather, 0) == pytest.approx(want.get(weather, 0), abs=1e-7)
    else:
        assert (sky.weather, sky.weather_mix) == (later.weather, later.weather_mix)


@pytest.mark.slow
@thorough
@given(a=strategies.params(), b=strategies.params())
def test_both_ends(a, b):
    assert lerp(a, b, 0.0) == a and lerp(a, b, 1.0) == b
    assert lerp(a, b, 0) is a and lerp(a, b, 1) is b


@pytest.mark.slow
@thorough
@given(a=strategies.params(), t=between)
def test_between_a_sky_and_itself(a, t):
    """To the bit, but for mixtures, in which equal weathers become one and those without weight
    go.
    """
    same = lerp(a, a, t)
    assert same.replace(weather=a.weather, weather_mix=a.weather_mix) == a
    got, want = (shares(p.weather, p.weather_mix) for p in (same, a))
    for weather in {*want, *got}:
        assert got.get(weather, 0) == pytest.approx(want.get(weather, 0), abs=1e-7)


@pytest.mark.parametrize(
    ("a", "b", "half"),
    [
        (10.0, 30.0, 20.0),
        (350.0, 10.0, 360.0),
        (10.0, 350.0, 0.0),
        (-170.0, 170.0, -180.0),
        (170.0, -170.0, 180.0),
        (0.0, 180.0, 90.0),
        (180.0, 0.0, 270.0),
        (360.0, -360.0, 360.0),
        (350.0, -350.0, 0.0),
        (-350.0, 350.0, -360.0),
    ],
)
@pytest.mark.parametrize("field", ANGLES, ids=".".join)
def test_directions_take_the_shorter_arc(a, b, half, field):
    """Clockwise where both are equally long."""
    path = ".".join(field)
    sky = lerp(Params().with_(**{path: a}), Params().with_(**{path: b}), 0.5)
    assert value(sky, *field) % 360 == pytest.approx(half % 360)
    assert -360 <= value(sky, *field) <= 360


def test_weathers_blend():
    """Equal ones are one; a mixture with a mixture is a mixture of all."""
    a, b, c = (Params(weather=Weather(seed=seed)) for seed in (1, 2, 3))
    ab = lerp(a, b, 0.25)
    assert (ab.weather, ab.weather_mix) == (a.weather, ((b.weather, 0.25),))
    abc = lerp(ab, c, 0.5)
    assert shares(abc.weather, abc.weather_mix) == pytest.approx(
        {a.weather: 0.375, b.weather: 0.125, c.weather: 0.5}
    )
    back = lerp(lerp(a, b, 0.5), lerp(b, a, 0.5), 0.5)
    assert shares(back.weather, back.weather_mix) == pytest.approx({a.weather: 0.5, b.weather: 0.5})
    # All of the weight on the one and then on the other: the first has none left.
    gone = lerp(a.replace(weather_mix=((b.weather, 1.0),)), b, 0.5)
    assert (gone.weather, gone.weather_mix) == (b.weather, ())


def test_weathers_that_cannot_be_mixed_switch():
    a, b = Params(), Params(weather=Weather(extent=1e5, seed=3))
    for t, sky in ((0.499, a), (0.5, b)):
        got = lerp(a, b, t)
        assert (got.weather, got.weather_mix) == (sky.weather, ())


def test_the_thinnest_clouds():
    """Between two altitudes that f32 tells apart there may be none."""

    def thin(base):
        return Params().with_(
            **{
                "clouds.base": base,
                "clouds.top": float(np.nextafter(np.float32(base), np.float32(np.inf))),
            }
        )

    for t in np.linspace(0, 1, 101):
        clouds = lerp(thin(1.0), thin(20_000.0), t).clouds
        assert np.float32(clouds.top) > np.float32(clouds.base)


def test_pictures_go_from_one_to_the_other(renderer):
    """In steps that are small against the whole way."""
    camera, a = nubis.scenes["fair_weather"]
    b = nubis.scenes["overcast"][1].with_(**{"weather.seed": 8, "sun.azimuth": 200.0})
    skies = [lerp(a, b, t) for t in np.linspace(0, 1, 17)]
    pictures = np.stack([renderer(48, 27).render(camera, sky) for sky in skies])
    np.testing.assert_array_equal(pictures[0], renderer(48, 27).render(camera, a))
    np.testing.assert_array_equal(pictures[-1], renderer(48, 27).render(camera, b))
    way = np.abs(pictures[-1] - pictures[0]).mean()
    steps = np.abs(np.diff(pictures, axis=0)).mean(axis=(1, 2, 3))
    assert steps.min() > 0 and steps.max() < 0.4 * way, steps / way


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((Params(), Params(), -0.1), "t = -0.1"),
        ((Params(), Params(), 1.1), "t = 1.1"),
        ((Params(), Params(), float("nan")), "t = nan"),
        ((Params(), Params(), "half"), "t = "),
        ((1, Params(), 0.5), "a = 1"),
        ((Params(), None, 0.5), "b = None"),
    ],
)
def test_what_is_no_sky(arguments, words):
    with pytest.raises(ParameterError, match=re.escape(words) + ".*is not allowed: it must be"):
        lerp(*arguments)
