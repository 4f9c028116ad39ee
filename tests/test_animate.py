"""Animation: stills at its cuts, the still in the end where nothing moves, and close to it where
something does.
"""

from itertools import pairwise

import numpy as np
import pytest

import nubis
import ref64
from nubis import ParameterError

SIZE = 96, 54
CAMERA, PARAMS = nubis.scenes["fair_weather"]


def colours(frame):
    assert np.isfinite(frame).all()
    return frame[..., :3]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", ["fair_weather", "above", "in_cloud"])
def test_a_static_shot_becomes_the_still(renderer, scene):
    camera, params = nubis.scenes[scene]
    make = renderer(*SIZE)
    still = make.render(camera, params)
    frames = list(make.animate([(camera, params, 0.0)] * 32))
    assert frames[0].tobytes() == still.tobytes()
    assert frames[0].shape == still.shape and frames[0].dtype == np.float32
    for frame in frames:
        assert ref64.relative_rmse(colours(frame), colours(still)) < 0.1
    assert ref64.relative_rmse(colours(frames[-1]), colours(still)) < 0.02


def test_without_background(renderer):
    make = renderer(*SIZE)
    still = make.render(CAMERA, PARAMS, background=None)
    *_, last = make.animate([(CAMERA, PARAMS, 0.0)] * 32, background=None)
    assert last[..., 3].min() >= 0 and last[..., 3].max() <= 1
    assert np.abs(last[..., 3] - still[..., 3]).mean() < 0.02


def look(azimuth, eye=(0, 0, 300)):
    return nubis.Camera.look_at(eye, eye + ref64.compass(azimuth, 12))


MOVES = {
    "time": lambda i: (look(0), PARAMS, i / 24),
    "turn": lambda i: (look(0.3 * i), PARAMS, i / 24),
    "flight": lambda i: (look(0, (0, 5.0 * i, 300)), PARAMS, i / 24),
    "climb through the clouds": lambda i: (look(0, (0, 0, 1000 + 30.0 * i)), PARAMS, i / 24),
    "sun": lambda i: (look(0), PARAMS.with_(**{"sun.azimuth": 100 + 0.2 * i}), 0.0),
    "coverage": lambda i: (look(0), PARAMS.with_(**{"clouds.coverage": 0.45 + 0.002 * i}), 0.0),
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("move", MOVES)
def test_what_moves_stays_near_the_still(renderer, move):
    """Loosely, at this size: neighbours that are marched in a frame are four pixels apart."""
    shots = [MOVES[move](i) for i in range(20)]
    other = nubis.Renderer(*SIZE, quality="draft")
    for i, frame in enumerate(renderer(*SIZE).animate(shots)):
        colours(frame)
        if i in (1, 5, 19):
            camera, params, time = shots[i]
            still = colours(other.render(camera, params, time=time))
            assert ref64.relative_rmse(colours(frame), still) < 0.4
            assert colours(frame).mean() == pytest.approx(still.mean(), rel=0.1)


@pytest.mark.slow
def test_a_panorama_has_no_seam(renderer):
    """What moves out at one side comes in at the other."""
    params = PARAMS.with_(
        **{"clouds.coverage": 0.7, "sun.azimuth": 0.0, "high_clouds.coverage": 0.0}
    )
    shots = [(nubis.Camera.equirect((200.0 * i, 0, 300)), params, 0.0) for i in range(12)]
    *_, last = renderer(192, 96).animate(shots)
    camera, params, time = shots[-1]
    error = np.abs(colours(last) - colours(renderer(192, 96).render(camera, params, time=time)))
    error = error[12:48].mean(axis=(0, 2))
    seam = error[[-2, -1, 0, 1]].mean()
    assert seam < 0.15 * colours(last).mean()


def test_what_stops_becomes_the_still(renderer):
    shots = [MOVES["flight"](i) for i in range(9)]
    *_, last = renderer(*SIZE).animate(shots + shots[-1:] * 48)
    camera, params, time = shots[-1]
    still = renderer(*SIZE).render(camera, params, time=time)
    assert ref64.relative_rmse(colours(last), colours(still)) < 0.02


def test_what_vanishes_leaves_no_ghost(renderer):
    """No cut, and yet nothing of the frame before is kept where its like is nowhere around."""
    params = PARAMS.with_(**{"high_clouds.coverage": 0.0})
    clear = params.with_(**{"clouds.coverage": 0.0})
    shots = [(CAMERA, params, 0.0)] * 3 + [(CAMERA, clear, 0.0)]
    *_, before, after = renderer(*SIZE).animate(shots, background=None)
    assert before[..., 3].max() > 0.5
    assert after[..., 3].max() < 1e-3


CUTS = {
    "turn": (look(120), PARAMS, 0.0),
    "lens": (nubis.Camera.look_at((0, 0, 300), (0, 1000, 500), fov_y=20), PARAMS, 0.0),
    "jump": (look(0, (50_000, 0, 300)), PARAMS, 0.0),
    "later": (look(0), PARAMS, 3600.0),
    "projection": (nubis.Camera.equirect((0, 0, 300)), PARAMS, 0.0),
    "weather": (look(0), PARAMS.with_(**{"weather.seed": 99}), 0.0),
    "light": (look(0), PARAMS.with_(**{"light.model": "single"}), 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("cut", CUTS)
def test_a_cut_shows_nothing_of_the_shot_before(renderer, cut):
    make = renderer(*SIZE)
    *_, last = make.animate([(look(0), PARAMS, 0.0)] * 3 + [CUTS[cut]])
    camera, params, time = CUTS[cut]
    assert last.tobytes() == make.render(camera, params, time=time).tobytes()


def test_a_new_animation_is_a_cut(renderer):
    make = renderer(*SIZE)
    list(make.animate([(look(0.0), PARAMS, 0.0)] * 3))
    shot = look(0.5), PARAMS, 0.1
    (first,) = make.animate([shot])
    assert first.tobytes() == make.render(*shot[:2], time=shot[2]).tobytes()


def test_the_same_animation_twice(renderer):
    shots = [MOVES["flight"](i) for i in range(6)]
    once, twice = ([f.tobytes() for f in renderer(*SIZE).animate(shots)] for _ in range(2))
    assert once == twice


@pytest.mark.slow
def test_other_calls_in_between_change_nothing(renderer):
    shots = [MOVES["turn"](i) for i in range(6)]
    make = renderer(*SIZE)
    alone = [f.tobytes() for f in make.animate(shots)]
    disturbed = []
    for frame in make.animate(shots):
        disturbed.append(frame.tobytes())
        make.render(*nubis.scenes["sunset"])
        make.density([[0, 0, 2000]], PARAMS)
    assert alone == disturbed


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("size", [(1, 1), (5, 3), (33, 17)])
def test_sizes_that_four_does_not_divide(renderer, size):
    make = renderer(*size)
    still = make.render(CAMERA, PARAMS)
    *_, last = make.animate([(CAMERA, PARAMS, 0.0)] * 32)
    assert ref64.relative_rmse(colours(last), colours(still)) < 0.02


def test_frames_are_made_one_by_one(renderer):
    """A shot is asked for when its frame is; an endless animation can be left at any time."""
    asked = []

    def shots():
        while True:
            asked.append(len(asked))
            yield CAMERA, PARAMS, len(asked) / 24

    frames = renderer(16, 9).animate(shots())
    assert iter(frames) is frames and asked == []
    next(frames)
    assert asked == [0]
    next(frames)
    assert asked == [0, 1]
    frames.close()
    assert asked == [0, 1]


def test_frames_are_arrays_of_their_own(renderer):
    first, second = renderer(16, 9).animate([(CAMERA, PARAMS, 0.0)] * 2)
    assert not np.shares_memory(first, second)
    first[:] = 0
    assert second.max() > 0


def test_no_shots(renderer):
    assert list(renderer(16, 9).animate([])) == []


def test_progress(renderer):
    """A wrapper such as tqdm sees every shot, and what it returns is what is rendered."""
    seen = []

    def progress(shots):
        for shot in shots:
            seen.append(shot)
            yield shot

    shots = [(CAMERA, PARAMS, float(i)) for i in range(3)]
    assert len(list(renderer(16, 9).animate(shots, progress=progress))) == 3
    assert seen == shots


@pytest.mark.parametrize(
    ("named", "shot"),
    [
        ("shot", None),
        ("shot", (CAMERA, PARAMS)),
        ("camera", (None, PARAMS, 0.0)),
        ("params", (CAMERA, None, 0.0)),
        ("time", (CAMERA, PARAMS, float("nan"))),
        ("time", (CAMERA, PARAMS, "now")),
    ],
)
def test_bad_shots(renderer, named, shot):
    """The frames before are delivered, and the renderer goes on working."""
    make = renderer(16, 9)
    frames = make.animate([(CAMERA, PARAMS, 0.0), shot])
    next(frames)
    with pytest.raises(ParameterError, match="is not allowed") as error:
        next(frames)
    assert str(error.value).startswith(named)
    assert len(list(make.animate([(CAMERA, PARAMS, 0.0)]))) == 1


def test_a_bad_background_is_refused_at_once(renderer):
    with pytest.raises(ParameterError, match="background"):
        renderer(16, 9).animate([], background="black")


def test_the_sky_is_baked_every_so_often():
    """In steps of one percent of the height, which change the sky by less than half of that."""
    params = nubis.Params().with_(**{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0})
    make = nubis.Renderer(32, 18)
    pictures, baked = [], 0
    for height in np.arange(1000.0, 1040.0, 2.0):
        camera = nubis.Camera.look_at((0, 0, height), (0, 1000, height + 200), (0, 0, 1), 60.0)
        pictures.append(make.render(camera, params))
        baked += "sky_view_bake" in make.timings
    assert 3 <= baked <= 6
    for before, after in pairwise(pictures):
        np.testing.assert_allclose(after[:11], before[:11], rtol=5e-3)  # above the horizon
    fresh = nubis.Renderer(32, 18).render(camera, params)
    assert fresh.tobytes() == pictures[-1].tobytes()


def near(azimuth):
    """A narrow view, whose cells are a degree wide: wider ones are followed less."""
    eye = np.array((0.0, 0.0, 300.0))
    return nubis.Camera.look_at(eye, eye + ref64.compass(azimuth, 10), fov_y=15)


def test_history_grows_until_each_pixel_has_had_its_ray():
    make = nubis.Renderer(*SIZE, quality="draft")
    shots = [(near(0), PARAMS, 0.0)] * 2 + [(near(3), PARAMS, 0.0)] * 40
    frames = make.animate(shots)
    lengths = []
    assert make.history_length is None
    for _ in shots:
        next(frames)
        assert make.history_length.shape == SIZE[::-1]
        lengths.append(make.history_length)
    # Of a still, 15 is between its rays.
    assert (lengths[0] >= 15).all()
    # What comes in at the right has a ray or is between two that look alike, and then for so many
    # frames; test_low_resolution.py has where histories go.
    assert np.isin(lengths[2][:, -8:], (1, 16)).all()
    assert (lengths[2][:, : SIZE[0] // 2] < 15).mean() < 0.1
    for i, length in enumerate(lengths[2:]):
        young = length[:, -8:] < 15
        assert (length[:, -8:][young] <= 1 + i).all()  # interpolated again, it is young again
    assert (lengths[-1] == 16).all()


def test_without_reprojection_there_is_no_history(renderer):
    clear = PARAMS.with_(**{"clouds.coverage": 0.0})
    make = renderer(*SIZE)
    list(make.animate([(CAMERA, clear, 0.0)] * 2))
    assert make.history_length is None
    path = renderer(8, 4, "reference")
    list(path.animate([(CAMERA, PARAMS, 0.0)]))
    assert path.history_length is None
