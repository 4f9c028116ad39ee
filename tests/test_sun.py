"""Where the sun stands, and skies by time."""

import copy
import pickle
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

import nubis

# Reda and Andreas 2004 (NREL/TP-560-34302), appendix A.5: Golden, Colorado, on 17 October 2003 at
# 12:30:30, 7 h behind UTC. Their zenith distance of 50.11162 has 0.01633 of refraction in it
# (820 mbar, 11 degrees), and their observer stands at 1830 m. Azimuth 194.34024.
GOLDEN = (
    39.742476,
    -105.1786,
    datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7))),
)


def test_published_example():
    sun = nubis.Sun.at(*GOLDEN)
    assert sun.elevation == pytest.approx(90 - 50.11162 - 0.01633, abs=5e-4)
    assert sun.azimuth == pytest.approx(194.34024, abs=5e-4)


# Meeus, "Astronomical Algorithms", example 25.b: on 13 October 1992 at 0 h of dynamical time
# (59 s before that of UTC) the sun's declination is -7d 47' 1.74". At the pole, that is its
# elevation, less a parallax of 0.0024. Solstices and equinoxes are the Astronomical Almanac's,
# to a minute.
ALMANAC = [
    (90.0, 0.0, datetime(1992, 10, 12, 23, 59, 1, tzinfo=UTC), -7.783817 - 0.0024, 3e-4),
    (90.0, 0.0, datetime(2024, 6, 20, 20, 51, tzinfo=UTC), 23.4386 - 0.0024, 4e-3),
    (90.0, 0.0, datetime(2024, 3, 20, 3, 6, tzinfo=UTC), -0.0024, 1e-3),
    (-90.0, 0.0, datetime(2025, 12, 21, 15, 3, tzinfo=UTC), 23.4386 - 0.0024, 4e-3),
]


@pytest.mark.parametrize(("latitude", "longitude", "time", "elevation", "tolerance"), ALMANAC)
def test_almanac(latitude, longitude, time, elevation, tolerance):
    sun = nubis.Sun.at(latitude, longitude, time)
    assert sun.elevation == pytest.approx(elevation, abs=tolerance)


def test_noon_by_the_equation_of_time():
    """The sun culminates at Greenwich when the equation of time says: 3 November (+16.4 minutes)
    and 11 February (-14.2), the extremes that almanacs print.
    """
    for day, minutes in ((datetime(2024, 11, 3, 12, tzinfo=UTC), 16.45),
                         (datetime(2024, 2, 11, 12, tzinfo=UTC), -14.22)):  # fmt: skip
        culmination = day - timedelta(minutes=minutes)
        assert nubis.Sun.at(51.48, 0.0, culmination).azimuth == pytest.approx(180, abs=0.03)


def test_zones_and_fields():
    """One instant has one sun, whatever the zone; other fields are passed on."""
    utc = nubis.Sun.at(48.1, 11.6, datetime(2026, 6, 21, 10, tzinfo=UTC))
    summer = timezone(timedelta(hours=2))
    assert nubis.Sun.at(48.1, 11.6, datetime(2026, 6, 21, 12, tzinfo=summer)) == utc
    warm = nubis.Sun.at(
        48.1, 11.6, datetime(2026, 6, 21, 10, tzinfo=UTC), irradiance=(3.0, 2.0, 1.0), visible=False
    )
    assert warm == utc.replace(irradiance=(3.0, 2.0, 1.0), visible=False)
    assert isinstance(utc, nubis.Sun) and nubis.Params(sun=utc).sun == utc


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((91.0, 0.0, GOLDEN[2]), "latitude"),
        ((float("nan"), 0.0, GOLDEN[2]), "latitude"),
        ((0.0, -181.0, GOLDEN[2]), "longitude"),
        (("north", 0.0, GOLDEN[2]), "latitude"),
        ((0.0, 0.0, datetime(2026, 6, 21, 12)), "time"),
        ((0.0, 0.0, "2026-06-21"), "time"),
        ((0.0, 0.0, 12.0), "time"),
    ],
)
def test_refused(arguments, name):
    with pytest.raises(nubis.ParameterError, match=rf"^{name} = "):
        nubis.Sun.at(*arguments)


def test_without_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "sunposition", None)
    with pytest.raises(ImportError, match=r'pip install "nubis\[sun\]"'):
        nubis.Sun.at(*GOLDEN)


SKIES = [
    nubis.Params().with_(**{"sun.elevation": e, "clouds.coverage": c})
    for e, c in ((0.0, 0.2), (40.0, 0.8), (10.0, 0.4))
]


def test_keyframes_between_and_beyond():
    """In any order; between two keys `lerp` of the two, at and beyond the ends the ends."""
    keys = nubis.Keyframes([(10.0, SKIES[1]), (4, SKIES[0]), (16.0, SKIES[2])])
    assert [time for time, _ in keys.keys] == [4.0, 10.0, 16.0]
    assert keys.at(5.5) == nubis.lerp(SKIES[0], SKIES[1], 0.25)
    assert keys.at(14.5) == nubis.lerp(SKIES[1], SKIES[2], 0.75)
    for time, sky in ((-1e300, 0), (4, 0), (10, 1), (16, 2), (1e300, 2)):
        assert keys.at(time) == SKIES[sky]
    assert nubis.Keyframes([(3.0, SKIES[1])]).at(7.0) == SKIES[1]


def test_smooth_keyframes():
    """Without a kink: from key to key the same, and slow at each."""
    keys = nubis.Keyframes(zip((0.0, 1.0, 3.0), SKIES, strict=True), easing="smooth")
    elevation = np.array([keys.at(t).sun.elevation for t in (0, 1e-3, 0.25, 0.5, 0.999, 1, 1.002)])
    expected = 40 * np.array([0, 3e-6, 0.15625, 0.5, 1 - 3e-6, 1, 1])
    np.testing.assert_allclose(elevation, expected, atol=1e-3)


def test_keyframes_are_values():
    make = lambda: nubis.Keyframes([(0, SKIES[0]), (1, SKIES[1])], easing="smooth")  # noqa: E731
    keys = make()
    assert keys == make() == pickle.loads(pickle.dumps(keys)) == copy.deepcopy(keys)
    assert hash(keys) == hash(make())
    assert keys != nubis.Keyframes(keys.keys)
    with pytest.raises(AttributeError):
        keys.easing = "linear"
    with pytest.raises(AttributeError):
        del keys.keys


@pytest.mark.parametrize(
    ("keys", "easing", "message"),
    [
        ([], "linear", "keys"),
        (5, "linear", "keys"),
        ([SKIES[0]], "linear", "keys"),
        ([(0, "sky")], "linear", r"keys\[0\]"),
        ([(0, SKIES[0]), (float("nan"), SKIES[1])], "linear", r"keys\[1\] time"),
        ([(1, SKIES[0]), (1.0, SKIES[1])], "linear", "keys time = 1.0"),
        ([(0, SKIES[0])], "fast", "easing"),
    ],
)
def test_keyframes_refused(keys, easing, message):
    with pytest.raises(nubis.ParameterError, match=message):
        nubis.Keyframes(keys, easing=easing)
    with pytest.raises(nubis.ParameterError, match="time"):
        nubis.Keyframes([(0, SKIES[0])]).at("noon")
