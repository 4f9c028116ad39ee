"""Winds that change on the way: the sky goes on from where it is, as far as the integral of the
winds says, and any time can be asked for in any order.
"""

import dataclasses
import itertools
import re

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from nubis import Keyframes, ParameterError, Params, _nubis
from test_wind import TILE, alike, moved, points_of, rms

#: What winds carry: direction and speed of each (east, north), by the names of their drift.
LEVEL = {
    "shape": ("wind.direction", "wind.speed"),
    "detail": ("wind.detail_direction", "wind.detail_speed"),
    "weather": ("wind.weather_direction", "wind.weather_speed"),
    "upper": ("upper_clouds.direction", "upper_clouds.speed"),
}
#: Each parameter that what is carried goes by, and two values of it that differ by a little.
MEMBERS = {
    "wind.speed": (8.0, 8.1),
    "wind.direction": (60.0, 62.0),
    "wind.detail_speed": (11.0, 11.1),
    "wind.detail_direction": (60.0, 62.0),
    "wind.weather_speed": (8.0, 8.1),
    "wind.weather_direction": (60.0, 62.0),
    "wind.updraft": (0.8, 0.9),
    "upper_clouds.speed": (10.0, 10.1),
    "upper_clouds.direction": (70.0, 72.0),
    "high_clouds.speed": (25.0, 25.5),
    "high_clouds.direction": (75.0, 75.3),
    "high_clouds.evolution": (0.001, 0.0011),
    "wind_variation.wind": (0.3, 0.5),
    "wind_variation.period": (7200.0, 5000.0),
}
DECK = {"upper_clouds.coverage": 0.5, "upper_clouds.base": 5000.0, "upper_clouds.top": 6500.0}
HOUR = 3600.0
gauss_nodes, gauss_weights = np.polynomial.legendre.leggauss(40)


def value(params, path):
    block, _, name = path.partition(".")
    return float(ref64_noise.f32(getattr(getattr(params, block), name)))


def wander(params):
    wanders = {"wind_variation.wind": 0.4, "wind_variation.coverage": 0.2}
    return wanders if params.startswith("wind_variation") else {}


def place(params, time):
    """Where all that is carried is, by what the closed form of an unchanging wind says."""
    carried = _nubis.carried(params, time)
    drift = [
        number
        for field in dataclasses.fields(params.drift)
        for number in np.ravel(getattr(params.drift, field.name))
    ]
    return np.array(carried) + drift


def rates(params):
    """Velocities without gusts, in the order of `place`, from the fields of a sky."""
    each = [
        (1j * np.exp(-1j * np.radians(value(params, direction)))) * value(params, speed)
        for direction, speed in LEVEL.values()
    ]
    faster = value(params, "wind.detail_speed") - value(params, "wind.speed")
    upper = 1j * np.exp(-1j * np.radians(value(params, "upper_clouds.direction")))
    each.append(upper * (value(params, "upper_clouds.speed") + faster))
    each.append(value(params, "high_clouds.speed"))
    pairs = [part for wind in each for part in (np.real(wind), np.imag(wind))]
    updraft, evolution = value(params, "wind.updraft"), value(params, "high_clouds.evolution")
    return np.array([*pairs, updraft, evolution, 1 / value(params, "wind_variation.period")])


def numerical(keys, start, end, pieces=8):
    """The integral of the winds that `at` has, by quadrature."""
    ends = np.linspace(start, end, pieces + 1)
    total = np.zeros(15)
    for a, b in itertools.pairwise(ends):
        for node, weight in zip(gauss_nodes, gauss_weights, strict=True):
            sky = keys.at(0.5 * (a + b) + 0.5 * (b - a) * node)
            total += 0.5 * (b - a) * keys.seconds * weight * rates(sky)
    return total


def other_winds(rng, **changes):
    winds = {path: rng.uniform(-180, 180) for path, _ in LEVEL.values()}
    winds |= {path: rng.uniform(-30, 30) for _, path in LEVEL.values()}
    winds |= {"wind.updraft": rng.uniform(-2, 2), "high_clouds.speed": rng.uniform(-40, 40)}
    winds |= {"high_clouds.evolution": rng.uniform(0, 0.01), "high_clouds.direction": 10.0}
    return Params().with_(**(winds | changes))


@pytest.mark.slow
@pytest.mark.parametrize("easing", ["linear", "smooth"])
def test_the_way_between_keys_is_the_integral_of_the_winds(rng, easing):
    """Of three skies with winds of any direction, in hours, a day's way, to the millimetre: `at`
    rounds no wind, and the sky that it returns has f32, 6e-8 of 30 m/s times a day, 0.15 m in 1300
    km, which its drift makes good at its own time.
    """
    periods = 3000.0, 9000.0, 60.0
    skies = [other_winds(rng, **{"wind_variation.period": period}) for period in periods]
    keys = Keyframes(zip((2.0, 8.0, 26.0), skies, strict=True), easing, seconds=HOUR)
    first = place(keys.at(2.0), 2 * HOUR)
    np.testing.assert_allclose(first, place(skies[0], 2 * HOUR), rtol=1e-12)
    for start, end in ((2.0, 5.0), (2.0, 8.0), (8.0, 9.5), (8.0, 26.0)):
        went = place(keys.at(end), end * HOUR) - place(keys.at(start), start * HOUR)
        expected = numerical(keys, start, end, 64)
        tolerance = 1e-6 * np.abs(expected).max()
        np.testing.assert_allclose(went[:12], expected[:12], rtol=0, atol=0.02 + tolerance * 0.1)
        np.testing.assert_allclose(went[12:], expected[12:], rtol=1e-6, atol=1e-6)
    # After the last key its winds blow on.
    later = place(keys.at(30.0), 30 * HOUR) - place(keys.at(26.0), 26 * HOUR)
    np.testing.assert_allclose(later, 4 * HOUR * rates(skies[2]), rtol=1e-6, atol=1e-6)


def test_a_straight_change_of_speed_has_a_closed_form():
    """v0 t + a t²/2: 8 to 20 m/s to the east in an hour are 14 m/s times it, and half way 11."""
    east = {"wind.direction": 90.0, "wind.speed": 8.0}
    calm = Params().with_(**east)
    keys = Keyframes([(0.0, calm), (HOUR, calm.with_(**{"wind.speed": 20.0}))])
    for share in (0.0, 0.25, 0.5, 1.0):
        time = share * HOUR
        expected = 8 * time + 12 * time * share / 2
        assert place(keys.at(time), time)[0] == pytest.approx(expected, abs=1e-8)
        assert place(keys.at(time), time)[1] == pytest.approx(0, abs=1e-8)
    assert place(keys.at(3 * HOUR), 3 * HOUR)[0] == pytest.approx(54 * HOUR, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("easing", ["linear", "smooth"])
def test_gusts_are_carried_on_by_the_period_of_each_moment(easing):
    """The velocity, by central differences of the way, is the wind of the moment in gusts of the
    phase that the wander has come to, which goes by the period of each moment.
    """
    gusty = {"wind_variation.seed": 5, "wind.direction": 90.0, "wind_variation.wind": 0.8}
    a = Params().with_(**gusty, **{"wind_variation.period": 900.0, "wind.speed": 10.0})
    b = a.with_(**{"wind_variation.wind": 0.2, "wind_variation.period": 3000.0, "wind.speed": 30.0})
    keys = Keyframes([(1000.0, a), (9000.0, b)], easing)
    k = np.arange(4)
    _, phase = ref64_noise.turns(a.wind_variation, 0)
    turn = (-1.0) ** k * 2 * np.pi * 3 ** (-(k - 1.5) / 4)
    for time in (1200.0, 3000.0, 4999.0, 5001.0, 8700.0):
        sky = keys.at(time)
        before, now, after = (place(keys.at(t), t) for t in (time - 1, time, time + 1))
        gust = np.exp(1j * (turn * now[-1] + phase)).mean()
        expected = value(sky, "wind.speed") * (1 + value(sky, "wind_variation.wind") * gust)
        went = complex(*(after - before)[:2]) / 2
        assert abs(went - expected) < 1e-4, time
    # The phases of the cover are those of the same wander.
    swings = [place(keys.at(t), t)[-1] for t in (1000.0, 9000.0)]
    assert swings[1] - swings[0] == pytest.approx(numerical(keys, 1000.0, 9000.0, 64)[-1], rel=1e-9)


@pytest.mark.parametrize("path", MEMBERS)
def test_what_winds_carry_goes_on_where_they_change(path):
    """For every parameter: nothing is elsewhere at the moment of the change, as it was by Δv t, and
    nothing but the drift is another.
    """
    old, new = MEMBERS[path]
    before = Params().with_(**(wander(path) | {path: old}))
    plain = before.with_(**{path: new})
    for time in (-HOUR, 0.0, 1.5, HOUR, 2.6e6):
        after = plain.after(before, time)
        there = place(before, time)
        np.testing.assert_allclose(place(after, time), there, rtol=1e-14, atol=1e-7)
        assert after.replace(drift=plain.drift) == plain
        back = before.after(after, time)
        np.testing.assert_allclose(place(back, 0.0), place(before, 0.0), atol=1e-6)
    if "high_clouds.direction" not in path:
        assert np.abs(place(plain, HOUR) - place(before, HOUR)).max() > 1e-3


def test_the_same_winds_have_the_same_drift():
    """To the bit, whatever else changes."""
    before = Params().with_(**{"drift.shape": (1e9 + 0.1, 1e-3), "drift.rise": 5.0})
    sky = before.with_(**{"clouds.coverage": 0.9, "drift.shape": (0.0, 0.0)})
    assert sky.after(before, 123.456).drift == before.drift
    keys = Keyframes([(0.0, before), (10.0, before.with_(**{"clouds.coverage": 0.9}))])
    for time in (0.0, 3.3, 10.0, 99.0):
        assert keys.at(time).drift == before.drift


def test_the_field_moves_by_the_integral(renderer, rng):
    """The density of a sky between keys at p is that of the first sky at 0 s at p less the way of a
    wind that turns and grows, after three hours as exact as after none (see test_wind).
    """
    start = alike(72.0, 5.0)
    keys = Keyframes([(HOUR, start), (4 * HOUR, alike(160.0, 25.0))], "smooth")
    points, altitude = points_of(rng, start, 4000, 15_000)
    for time in (0.5 * HOUR, 2.0 * HOUR, 5.0 * HOUR):
        if time < HOUR:
            way = ref64_noise.blown(start, 72.0, 5.0, time)
        else:
            way = ref64_noise.blown(start, 72.0, 5.0, HOUR)
            way = way + numerical(keys, HOUR, min(time, 4 * HOUR), 16)[:2]
        if time > 4 * HOUR:
            way = way + HOUR * rates(keys.at(time))[:2]
        now = renderer().density(points, keys.at(time), time=time)
        then = renderer().density(moved(points, -np.fmod(way, TILE), altitude, start), start)
        sky = keys.at(time)
        beside = renderer().density(moved(points, [0.5, 0.0], altitude, start), sky, time=time)
        # The tops lean by the wind's direction, which turns.
        straight = [sky.with_(**{"wind.shear": 0.0}), start.with_(**{"wind.shear": 0.0})]
        now = renderer().density(points, straight[0], time=time)
        there = moved(points, -np.fmod(way, TILE), altitude, start)
        then = renderer().density(there, straight[1])
        beside = renderer().density(
            moved(points, [0.5, 0.0], altitude, start), straight[0], time=time
        )
        assert (now > 0).mean() > 0.05
        assert rms(now - then) / (rms(beside - now) / 0.5) < 0.005  # m


def view():
    return nubis.Camera.look_at((0, 0, 500), (0, 1000, 900), fov_y=80)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("path", MEMBERS)
def test_frames_change_as_with_a_steady_wind(renderer, path):
    """A change within half a minute after ten hours: from one second to the next a picture changes
    as where nothing but time goes by. Where the way was velocity times time, by 3 to 58 times that
    (the direction of the high clouds apart, which turns them about the origin).
    """
    old, new = MEMBERS[path]
    # What the parameter moves alone is in sight.
    alone = {"high_clouds.coverage": 0.8 if "high" in path else 0.0}
    alone |= {"clouds.coverage": 0.0 if "_clouds" in path else 0.4}
    alone |= DECK if "upper" in path else {}
    before = Params().with_(**(alone | wander(path) | {path: old}))
    start = 10 * HOUR
    keys = Keyframes([(start, before), (start + 30, before.with_(**{path: new}))])

    def step(sky, time):
        a, b = (renderer().render(view(), sky(t), time=t)[..., :3] for t in (time, time + 1))
        return rms(b - a)

    changing = max(step(keys.at, start + t) for t in (9.0, 15.0))
    steady = max(step(lambda _: before, start + t) for t in (9.0, 15.0))
    assert 0 < changing < 1.5 * steady


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("path", ["wind.speed", "high_clouds.speed", "wind_variation.period"])
def test_an_animation_goes_on_where_winds_change(renderer, path):
    """Shots with another wind each, as from a slider, and nothing said of where the sky is: after
    an hour from one to the next the sky moves as with a steady wind.
    """
    old, new = MEMBERS[path]
    winds = {"wind_variation.wind": 0.4} if path.startswith("wind_variation") else {}
    before = Params().with_(**winds, **{path: old})
    make = renderer(48, 27)

    def frames(values):
        skies = [before.with_(**{path: v}) for v in values]
        return list(make.animate((view(), sky, 10 * HOUR + 0.5 * i) for i, sky in enumerate(skies)))

    def steps(pictures):
        return [rms(b - a) for a, b in itertools.pairwise(pictures)]

    steady = frames([old] * 8)
    changing = frames([old] * 4 + list(np.linspace(old, new, 4)))
    for a, b in zip(steady[:4], changing, strict=False):
        assert a.tobytes() == b.tobytes()
    for a, b in zip(steps(changing), steps(steady), strict=True):
        assert a < 1.2 * b


def test_an_animation_adds_up_even_changes(renderer):
    """Winds that change evenly from shot to shot, and back: the frame is, as it converges, the
    still of the integral; a cut begins anew at the still of the sky as it is given.
    """
    # The light field of an animation lags behind by a few percent.
    even = {"light.model": "octaves", "wind.direction": 90.0}
    skies = [Params().with_(**even, **{"wind.speed": v}) for v in range(8, 17)]
    times = [HOUR + 10.0 * i for i in range(len(skies))]
    make = renderer(48, 27)
    shots = [(view(), sky, time) for sky, time in zip(skies, times, strict=True)]
    *_, last = make.animate(shots + [shots[-1]] * 17)
    keys = Keyframes([(times[0], skies[0]), (times[-1], skies[-1])])
    still = make.render(view(), keys.at(times[-1]), time=times[-1])
    np.testing.assert_allclose(last, still, rtol=2e-3, atol=2e-3)
    elsewhere = make.render(view(), skies[-1], time=times[-1])
    assert rms(elsewhere - still) > 0.05 * rms(still)
    # A shot of another hour, and another animation, are cuts.
    cut = [shots[0], shots[1], (view(), skies[-1], 2 * HOUR)]
    *_, frame = make.animate(cut)
    assert frame.tobytes() == make.render(view(), skies[-1], time=2 * HOUR).tobytes()
    (frame,) = make.animate(shots[-1:])
    assert frame.tobytes() == elsewhere.tobytes()


@pytest.mark.slow
def test_an_animation_of_keys_stays_near_the_still(renderer):
    """What says where the sky is is not carried on twice, and what follows the clouds from frame to
    frame follows them by the way that they went.
    """
    start = Params().with_(**{"wind.speed": 5.0, "high_clouds.coverage": 0.0})
    storm = {"wind.speed": 60.0, "wind.weather_speed": 60.0, "wind.detail_speed": 60.0}
    keys = Keyframes([(HOUR, start), (HOUR + 60, start.with_(**storm))])
    make = renderer(96, 54)
    times = HOUR + np.linspace(20, 40, 33)
    *_, last = make.animate((view(), keys.at(t), t) for t in times)
    still = make.render(view(), keys.at(times[-1]), time=times[-1])
    steady = [(view(), keys.at(times[-1]), times[-1] + t - 20) for t in np.linspace(0, 20, 33)]
    *_, flown = make.animate(steady)
    expected = make.render(view(), keys.at(times[-1]), time=times[-1])
    usual = ref64.relative_rmse(flown[..., :3], expected[..., :3])
    assert ref64.relative_rmse(last[..., :3], still[..., :3]) < 1.3 * usual + 0.02


def test_any_time_is_a_time_of_an_animation():
    make = nubis.Renderer(8, 8, quality="draft")
    skies = [Params().with_(**{"wind.speed": v}) for v in (8.0, 9.0)]
    for time in (-1e300, 1e300, 1e15):
        frames = make.animate((view(), sky, time) for sky in skies)
        assert all(np.isfinite(frame).all() for frame in frames)


def test_drifts_survive_files(tmp_path):
    sky = Params().with_(**{"wind.speed": 9.0}).after(Params(), 1234.567)
    assert sky.drift.shape != (0, 0)
    sky.save(tmp_path / "sky.toml")
    assert Params.load(tmp_path / "sky.toml") == sky


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Params().after(None, 0.0), "before = None"),
        (lambda: Params().after(Params(), float("nan")), "time = nan"),
        (lambda: Params().after(Params(), "noon"), "time = "),
        (lambda: Keyframes([(0, Params())], seconds=0), "seconds = 0"),
        (lambda: Keyframes([(0, Params())], seconds="hour"), "seconds = "),
        (lambda: nubis.Drift(shape=(1e13, 0.0)), "drift.shape = (10000000000000, 0)"),
        (lambda: nubis.Drift(shape=1.0), "drift.shape = 1"),
        (lambda: gusts_for_years(), "keys time between two = "),
    ],
)
def test_what_is_no_change(make, words):
    with pytest.raises(ParameterError, match="^" + re.escape(words) + ".*is not allowed: it must"):
        make()


def gusts_for_years():
    a = Params().with_(**{"wind_variation.wind": 0.5, "wind_variation.period": 60.0})
    Keyframes([(0.0, a), (1e7, a.with_(**{"wind.speed": 9.0}))])
