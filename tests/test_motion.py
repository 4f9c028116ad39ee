"""Frames of `animate` against the stills of the same shots: the less differs between two frames,
the nearer to their stills they are, and what a change makes invalid is not shown again.
"""

import numpy as np
import pytest

import nubis
import ref64

SIZE = 240, 135
EYES = {
    "fair_weather": ((0, 0, 200), 0, 14),
    "stratocumulus": ((0, 0, 200), 340, 16),
    "storm": ((0, 0, 200), 40, 14),
    "sunset": ((0, 0, 200), 250, 11),
    "above": ((0, 0, 3500), 20, -10),
}


def look(scene, turn=0.0, forward=0.0):
    eye, azimuth, pitch = EYES[scene]
    eye = np.add(eye, forward * ref64.compass(azimuth))
    return nubis.Camera.look_at(eye, eye + ref64.compass(azimuth + turn, pitch))


def sky(scene, **fields):
    still = {"high_clouds.coverage": 0.0, "wind.speed": 0.0, "wind.weather_speed": 0.0}
    still |= {"wind.detail_speed": 0.0, "wind.updraft": 0.0}
    return nubis.scenes[scene][1].with_(**(still | fields))


def rendered(shot, quality="draft", background=None):
    camera, params, time = shot
    make = nubis.Renderer(*SIZE, quality=quality)
    return make.render(camera, params, time=time, background=background)


def all_rays(shot, quality="draft"):
    return rendered(shot, nubis.quality(quality).replace(adaptive_threshold=0.0))


def error(frame, still):
    return ref64.relative_rmse(frame[..., :3], still[..., :3])


HARDLY = {
    "time": lambda i: (look("fair_weather"), sky("fair_weather"), i * 1e-9),
    "wind": lambda i: (
        look("fair_weather"),
        sky("fair_weather", **{"wind.speed": 8.0, "wind.weather_speed": 8.0}),
        i * 1e-7,
    ),
    "eye": lambda i: (look("fair_weather", forward=1e-6 * i), sky("fair_weather"), 0.0),
    "turn": lambda i: (look("fair_weather", turn=1e-6 * i), sky("fair_weather"), 0.0),
    "sun": lambda i: (
        look("fair_weather"),
        sky("fair_weather", **{"sun.elevation": 40 + 1e-5 * i}),
        0.0,
    ),
    "coverage": lambda i: (
        look("fair_weather"),
        sky("fair_weather", **{"clouds.coverage": 0.45 + 1e-7 * i}),
        0.0,
    ),
    "exposed": lambda i: (
        look("fair_weather"),
        sky("fair_weather", **{"sun.irradiance": (10, 10, 10 + 1e-5 * i)}),
        0.0,
    ),
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
@pytest.mark.parametrize("change", HARDLY)
def test_what_hardly_changes_becomes_the_still(change, quality):
    if quality == "balanced" and change not in ("time", "sun"):
        pytest.skip("as in draft")
    shots = [HARDLY[change](i) for i in range(18)]
    *_, last = nubis.Renderer(*SIZE, quality=quality).animate(shots, background=None)
    still = all_rays(shots[-1], quality)
    assert error(last, still) < 5e-3
    assert not ((last[..., 3] == 1) & (last[..., :3] == 0).all(axis=-1)).any()


@pytest.mark.slow
def test_a_sunset_that_hardly_changes_becomes_the_still():
    shots = [(look("sunset"), sky("sunset"), i * 1e-9) for i in range(18)]
    *_, last = nubis.Renderer(*SIZE, quality="draft").animate(shots, background=None)
    assert error(last, all_rays(shots[-1])) < 5e-3


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", EYES)
def test_a_flight_errs_no_more_than_its_stills(scene):
    """Against `high`; and no pixel is darker than half of the darkest around it in the still."""
    params = nubis.scenes[scene][1].with_(**{"high_clouds.coverage": 0.0, "sun.visible": False})
    shots = [(look(scene, forward=5.0 * i), params, i / 24) for i in range(19)]
    frames = list(nubis.Renderer(*SIZE, quality="draft").animate(shots))
    for i in (9, 18):
        still, truth = rendered(shots[i], background="sky"), rendered(shots[i], "high", "sky")
        assert error(frames[i], truth) < error(still, truth) + 0.02
        light = still[..., :3].max(axis=-1)
        padded = np.pad(light, 1, mode="edge")
        around = [padded[y : y + SIZE[1], x : x + SIZE[0]] for x in range(3) for y in range(3)]
        dark = frames[i][..., :3].max(axis=-1) < 0.5 * np.min(around, axis=0)
        assert dark.sum() == 0


JUMPS = {
    "sun": {"sun.elevation": 2.0},
    "cover": {"clouds.coverage": 0.8},
    "light": {"light.albedo": 0.8},
    "extinction": {"clouds.extinction": 0.02},
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("jump", JUMPS)
def test_a_jump_leaves_nothing_behind(jump):
    before = (look("fair_weather"), sky("fair_weather"), 0.0)
    after = (look("fair_weather"), sky("fair_weather", **JUMPS[jump]), 0.0)
    frames = nubis.Renderer(*SIZE, quality="draft").animate(
        [before] * 3 + [after] * 4, background=None
    )
    truth = all_rays(after)
    bound = error(rendered(after), truth) + 0.05  # before: 0.46 to 1.7 in the first frame
    for frame in list(frames)[3:]:
        assert error(frame, truth) < bound


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "field", "start", "step"),
    [
        ("fair_weather", "sun.elevation", 40.0, 0.25),
        ("fair_weather", "sun.elevation", 12.0, -0.05),
        ("stratocumulus", "sun.elevation", 30.0, -0.25),
        ("fair_weather", "clouds.coverage", 0.45, 0.002),
        ("fair_weather", "clouds.extinction", 0.2, -0.004),
        ("fair_weather", "light.albedo", 0.999, -0.003),
    ],
)
def test_a_slow_change_lags_by_less_than_two_percent(scene, field, start, step):
    shots = [(look(scene), sky(scene, **{field: start + step * i}), 0.0) for i in range(21)]
    frames = list(nubis.Renderer(*SIZE, quality="draft").animate(shots, background=None))
    for i in (10, 20):
        still = all_rays(shots[i])
        assert frames[i][..., :3].mean() == pytest.approx(still[..., :3].mean(), rel=0.02)
        assert error(frames[i], still) < error(rendered(shots[i]), still) + 0.12


@pytest.mark.slow
def test_turns_and_lapses_are_near_their_stills():
    """A turn of 5 degrees and a minute between two frames."""
    params = nubis.scenes["fair_weather"][1].with_(**{"high_clouds.coverage": 0.0})
    for shots, allowed in (
        ([(look("fair_weather", turn=5.0 * i), params, i / 24) for i in range(13)], 0.12),
        ([(look("fair_weather"), params, 60.0 * i) for i in range(13)], 0.02),
    ):
        *_, last = nubis.Renderer(*SIZE, quality="draft").animate(shots, background=None)
        truth = all_rays(shots[-1])
        assert error(last, truth) < error(rendered(shots[-1]), truth) + allowed
