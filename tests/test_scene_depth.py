"""A user's scene among the clouds: `scene_depth` and `scene_color`."""

from itertools import pairwise

import numpy as np
import pytest

import nubis
import ref64

SIZE = 32, 18
INF = np.float32(np.inf)
# From below, through a field whose features are hundreds of metres.
CAMERA = nubis.Camera.look_at((0, 0, 200), (0, 3000, 2200), (0, 0, 1), 20.0)


def single(**changes):
    return ref64.smooth_params(**{"light.model": "single", "light.g": 0.3} | changes)


def mountain():
    """Metres along each ray: a slope that runs from before the clouds to far behind them, its
    summit a jump from near to nothing.
    """
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    depth = 900.0 * np.exp2(x / 6.0) + 20.0 * y
    return np.where((x + y) % 11 == 0, np.inf, depth).astype(np.float32)


def narrow(camera):
    """The same view through pixels of a ninth of a degree, between which rays are interpolated."""
    return nubis.Camera.look_at(camera.eye, np.add(camera.eye, camera.forward), (0, 0, 1), 20.0)


def cut_twin(monkeypatch, depth, function, *args):
    """A ref64 whose rays end at the scene."""
    ends = ref64.ray_ends

    def cut(eye, directions, params):
        return np.minimum(ends(eye, directions, params), depth.ravel())

    monkeypatch.setattr(ref64, "ray_ends", cut)
    return function(*args)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("method", ["march", "reference"])
def test_mountain_in_the_clouds(renderer, monkeypatch, method):
    """In front of, inside and behind cloud, against float64 rays that end at the same depth: single
    scattering and transmittance, 1 % RMS.
    """
    params, depth = single(), mountain()
    quality = ref64.fine(400, 40) if method == "march" else "reference"
    ours = nubis.Renderer(*SIZE, quality=quality)
    time = ref64.cloudy_time(ours, params, CAMERA, 0.2, 0.7)
    layers = ours.render_layers(CAMERA, params, time=time, scene_depth=depth)
    directions = ref64.pixel_directions(CAMERA, *SIZE).reshape(-1, 3)
    eye = np.array(CAMERA.eye)
    seen = cut_twin(
        monkeypatch, depth, ref64.transmittance, ours, params, eye, directions, 800, time
    ).reshape(depth.shape)
    whole = ours.render_layers(CAMERA, params, time=time)["transmittance"]
    # The mountain is in front of cloud, behind cloud, and within it.
    front, behind = (seen > 0.999) & (whole < 0.5), (seen < 0.5) & (seen < whole + 0.01)
    assert front.sum() > 20 and behind.sum() > 20
    assert ((seen < 0.9) & (seen > whole + 0.1)).sum() > 20
    assert np.abs(layers["transmittance"] - seen).max() < 0.01
    light = ref64.single_scattering(ours, params, eye, directions, 300, 100, time)
    assert ref64.relative_rmse(layers["radiance"].reshape(-1, 3), light) < 0.01


@pytest.mark.slow
def test_path_tracing_ends_at_the_scene(monkeypatch):
    """Its transmittance is a share of 256 paths: within five standard errors everywhere."""
    params, depth = single(**{"light.model": "path"}), mountain()
    quality = nubis.quality("balanced").replace(path_samples=256, path_scatterings=1)
    ours = nubis.Renderer(*SIZE, quality=quality)
    time = ref64.cloudy_time(ours, params, CAMERA, 0.2, 0.7)
    layers = ours.render_layers(CAMERA, params, time=time, scene_depth=depth)
    directions = ref64.pixel_directions(CAMERA, *SIZE).reshape(-1, 3)
    seen = cut_twin(
        monkeypatch, depth, ref64.transmittance, ours, params, CAMERA.eye, directions, 800, time
    ).reshape(depth.shape)
    error = np.sqrt(seen * (1 - seen) / 256) + 0.002
    assert (np.abs(layers["transmittance"] - seen) < 5 * error).all()


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["fair_weather", "above"])
@pytest.mark.parametrize("contrast", [0.0, 0.2])
def test_nothing_there_changes_nothing(scene, contrast):
    """Where the scene is infinitely far the picture is the same to the bit: everywhere, and beside
    a scene; between samples of a grid, as far as the scene does not reach.
    """
    camera, params = nubis.scenes[scene]
    camera = narrow(camera)
    size = 320, 180
    quality = nubis.quality("draft").replace(adaptive_threshold=contrast)
    ours = nubis.Renderer(*size, quality=quality)
    plain = ours.render(camera, params)
    depth = np.full(size[::-1], np.inf)
    assert np.array_equal(ours.render(camera, params, scene_depth=depth), plain)
    depth[:, :80] = 500.0
    frame = ours.render(camera, params, scene_depth=depth)
    first = 80 if contrast == 0 else 84
    assert np.array_equal(frame[:, first:], plain[:, first:])
    assert not np.array_equal(frame[:, :80], plain[:, :80])
    assert np.array_equal(ours.render(camera, params), plain)


@pytest.mark.slow
def test_sample_grids_do_not_reach_across_the_scene():
    """With rays between samples of a grid, edges of the scene are as if every ray were marched."""
    camera, params = nubis.scenes["fair_weather"]
    camera = narrow(camera)
    size = 320, 180
    y, x = np.mgrid[: size[1], : size[0]]
    depth = np.where((x // 5 + y // 7) % 3 == 0, 1500.0, np.where(x % 31 == 3, 6000.0, np.inf))
    every, adaptive = (
        nubis.Renderer(
            *size, quality=nubis.quality("draft").replace(adaptive_threshold=c)
        ).render_layers(camera, params, scene_depth=depth)
        for c in (0.0, 0.2)
    )
    assert (adaptive["samples"] == 0).mean() > 0.1 + (every["samples"] == 0).mean()
    beside = np.isfinite(depth)
    for layer in ("radiance", "transmittance"):
        assert np.array_equal(every[layer][beside], adaptive[layer][beside])
    # Beside it rays look everywhere, not only where the scene let their neighbours see cloud.
    assert np.abs(every["transmittance"] - adaptive["transmittance"]).mean() < 0.01


def test_scene_colour_in_clear_air():
    """Without air and in front of all clouds the scene is what it is, whatever its background."""
    params = single()
    ours = nubis.Renderer(*SIZE, quality="draft")
    rng = np.random.default_rng(3)
    color = rng.uniform(0, 5, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    depth = np.full(SIZE[::-1], 100.0)
    frame = ours.render(CAMERA, params, scene_depth=depth, scene_color=color)
    assert np.allclose(frame[..., :3], color, rtol=1e-6) and (frame[..., 3] == 1).all()
    alone = ours.render(CAMERA, params, scene_depth=depth)
    assert np.allclose(alone, 0, atol=1e-6)


def test_colour_behind_cloud_and_air():
    """The scene is dimmed by what lies before it: picture = layers over air and scene, and without
    its colour the caller composites the same, to what one alpha for three colours can do.
    """
    camera, params = nubis.scenes["fair_weather"]
    ours = nubis.Renderer(64, 36, quality="draft")
    depth = np.full((36, 64), 15_000.0)
    layers = ours.render_layers(camera, params, scene_depth=depth)
    black = ours.render(camera, params, scene_depth=depth, scene_color=np.zeros((36, 64, 3)))
    mixed = layers["radiance"] + layers["transmittance"][..., None] * layers["sky"]
    assert np.allclose(black[..., :3], mixed, rtol=1e-5, atol=1e-6)
    grey = ours.render(camera, params, scene_depth=depth, scene_color=np.ones((36, 64, 3)))
    room = ours.render(camera, params, scene_depth=depth)
    assert np.allclose(room[..., :3], black[..., :3], rtol=1e-5, atol=1e-6)
    luminance = (grey - black)[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    assert np.allclose(1 - room[..., 3], luminance, atol=1e-3)
    # 15 km of air let more red through than blue.
    added = (grey - black)[layers["transmittance"] > 0.9]
    assert (added[:, 0] > 1.01 * added[:, 2]).all() and (added[:, :3] < 1).all()


def test_air_before_the_scene_is_a_part_of_all_air():
    """From nothing at the eye to all of it, ever more."""
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(**{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0})
    ours = nubis.Renderer(16, 9, quality="draft")
    seen = [
        ours.render(
            camera, params, scene_depth=np.full((9, 16), d), scene_color=np.zeros((9, 16, 3))
        )
        for d in (0.0, 1e3, 1e4, 1e5)
    ]
    assert (seen[0][..., :3] < 1e-6).all()
    assert all((a[..., :3] <= b[..., :3]).all() for a, b in pairwise(seen))
    above = np.s_[:3]  # the rows that see no ground
    sky = ours.render(camera, params)
    assert (seen[3][above][..., :3] <= 1.001 * sky[above][..., :3]).all()


def test_partial_cover_is_a_mixture():
    """A pixel covered in part is so much of the covered picture and the rest of the open one."""
    camera, params = nubis.scenes["fair_weather"]
    ours = nubis.Renderer(64, 36, quality=nubis.quality("draft").replace(adaptive_threshold=0.0))
    rng = np.random.default_rng(5)
    cover = rng.uniform(0, 1, (36, 64)) * (rng.uniform(size=(36, 64)) < 0.8)
    cover[rng.uniform(size=(36, 64)) < 0.2] = 1.0
    depth = np.full((36, 64), 4000.0)
    color = np.concatenate(
        [np.full((36, 64, 3), 0.7) * cover[..., None], cover[..., None]], axis=-1
    )
    frame = ours.render(camera, params, scene_depth=depth, scene_color=color)
    full = ours.render(camera, params, scene_depth=depth, scene_color=np.full((36, 64, 3), 0.7))
    none = ours.render(camera, params)
    expected = cover[..., None] * full + (1 - cover[..., None]) * none
    assert np.allclose(frame, expected, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_high_clouds_and_sun_are_behind_it():
    """A scene below the high clouds hides them, and the sun's disc."""
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.0, "high_clouds.coverage": 1.0, "high_clouds.optical_depth": 3.0}
    )
    toward = 1000.0 * ref64.sun_direction(params)
    camera = nubis.Camera.look_at((0, 0, 100), np.add((0, 0, 100), toward), (0, 0, 1), 4.0)
    ours = nubis.Renderer(*SIZE, quality="draft")
    open_sky = ours.render_layers(camera, params)
    assert open_sky["transmittance"].max() < 0.5 and open_sky["sky"].max() > 1e3
    hidden = ours.render_layers(camera, params, scene_depth=np.full(SIZE[::-1], 5000.0))
    assert (hidden["transmittance"] == 1).all() and hidden["sky"].max() < 10
    past = ours.render_layers(camera, params, scene_depth=np.full(SIZE[::-1], 50_000.0))
    assert np.array_equal(past["transmittance"], open_sky["transmittance"])


def test_strips_read_their_own_rows():
    """A picture of several strips: the scene of each row is its own."""
    params = nubis.Params().with_(**{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0})
    size = 2048, 700  # strips of a million pixels
    ours = nubis.Renderer(*size, quality="draft")
    color = np.zeros((size[1], size[0], 3), dtype=np.float32)
    color[...] = np.arange(size[1])[:, None, None] + np.arange(size[0])[:, None] / 4096
    frame = ours.render(
        CAMERA,
        params.with_(**{"atmosphere.enabled": False}),
        scene_depth=np.full(size[::-1], 10.0),
        scene_color=color,
    )
    assert np.allclose(frame[..., :3], color, rtol=1e-6)


# Of an animation, pixels whose every ray is marched: the still is what they are compared with.
EVERY = nubis.quality("draft").replace(adaptive_threshold=0.0)
CLOUDY = (
    nubis.scenes["fair_weather"][0],
    nubis.scenes["fair_weather"][1].with_(**{"clouds.coverage": 0.75, "high_clouds.coverage": 0.0}),
)


def ridge(size, shift):
    """A jagged mountain 1500 m away, moved to the right by some pixels."""
    y, x = np.mgrid[: size[1], : size[0]]
    top = 0.35 * size[1] + 0.25 * size[1] * np.abs(np.mod((x - shift) / 37.0, 2) - 1)
    return np.where(y > top, np.float32(1500.0), INF).astype(np.float32)


@pytest.mark.slow
def test_an_animation_of_a_scene_that_stands_still_becomes_the_still():
    size = 96, 54
    ours = nubis.Renderer(*size, quality="balanced")
    depth, color = ridge(size, 0.0), np.full((54, 96, 4), 0.3, dtype=np.float32)
    color[:27] *= 0.5
    shot = (*CLOUDY, 0.0, depth, color)
    still = ours.render(*CLOUDY, scene_depth=depth, scene_color=color)
    first, *_, last = ours.animate([shot] * 32)
    assert np.array_equal(first, still)
    assert ref64.relative_rmse(last, still) < 1e-3
    assert ref64.relative_rmse(ours.render(*CLOUDY), still) > 0.1


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("background", ["sky", None])
def test_an_edge_that_moves_leaves_no_ghost(background):
    """Where the scene of the frame before was another, the picture is the still's, to the bit."""
    size = 120, 68
    ours = nubis.Renderer(*size, quality=EVERY)
    scenes = [ridge(size, 5.0 * i) for i in range(6)] + [None, None, ridge(size, 7.0)]
    shots = [(*CLOUDY, 0.0, scene) for scene in scenes]
    open_sky = np.full(size[::-1], INF)
    for i, frame in enumerate(ours.animate(shots, background=background)):
        still = ours.render(*CLOUDY, background=background, scene_depth=scenes[i])
        if i == 0:
            assert np.array_equal(frame, still)
            continue
        now, before = (open_sky if s is None else s for s in (scenes[i], scenes[i - 1]))
        changed = now != before
        assert changed.sum() > 100 or scenes[i] is None
        assert np.array_equal(frame[changed], still[changed])
        ghost = ours.render(*CLOUDY, background=background, scene_depth=scenes[i - 1])
        if changed.any():
            assert np.abs(ghost[changed] - still[changed]).max() > 0.2
        # What has not changed is clamped to what is marched around it, here on a coarse grid.
        assert ref64.relative_rmse(frame, still) < 0.1


def flight(i, size):
    """Over a plain behind which a mountain stands, past a pillar, as a rasterizer sees them."""
    camera, params = CLOUDY
    eye = np.array([12.0 * i, 8.0 * i, 600.0])
    camera = nubis.Camera.look_at(eye, eye + np.array([0, 1000, 150]), (0, 0, 1), 50.0)
    rays = ref64.pixel_directions(camera, *size)
    depth = np.full(size[::-1], np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        wall = (6000.0 - eye[1]) / rays[..., 1]
        high = eye[2] + wall * rays[..., 2]
        peak = 2600.0 - 0.8 * np.abs(eye[0] + wall * rays[..., 0])
        depth = np.where((high > 0) & (high < peak), wall, depth)
        near = (800.0 - eye[1]) / rays[..., 1]
        pillar = np.abs(eye[0] + near * rays[..., 0] - 60.0) < 40.0
    return camera, params, i / 24, np.where(pillar, near, depth).astype(np.float32)


@pytest.mark.slow
def test_a_flight_past_a_scene_is_as_near_the_stills_as_without():
    """No farther from stills of the same shots than a flight without a scene, and not on the pixels
    beside its edges, which are marched: there only the jitter of later rounds differs.
    """
    size = 160, 90
    ours, other = (nubis.Renderer(*size, quality=EVERY.replace(jitter=False)) for _ in range(2))
    shots = [flight(i, size) for i in range(20)]
    errors, plain = [], []
    bare = ours.animate([shot[:3] for shot in shots])
    for shot, frame in zip(shots, list(bare), strict=True):
        plain.append(ref64.relative_rmse(frame, other.render(*shot[:2], time=shot[2])))
    for i, (shot, frame) in enumerate(zip(shots, ours.animate(shots), strict=True)):
        still = other.render(*shot[:2], time=shot[2], scene_depth=shot[3])
        errors.append(ref64.relative_rmse(frame, still))
        edge = np.zeros(size[::-1], dtype=bool)
        for axis in 0, 1:
            step = np.diff(np.minimum(shot[3], 1e6), axis=axis) ** 2 > 1e6
            edge[tuple(slice(0, n) for n in step.shape)] |= step
        assert edge.sum() > 100
        if i:
            assert np.array_equal(frame[edge], still[edge])
    # Measured: 1.04 in the mean; the worst of twenty frames 1.12.
    assert np.mean(errors) < 1.1 * np.mean(plain)
    assert max(errors) < 1.25 * max(plain)


@pytest.mark.slow
def test_animated_paths_end_at_the_scene():
    """A static shot goes on tracing; another scene is another shot."""
    params = CLOUDY[1].with_(**{"light.model": "path"})
    quality = nubis.quality("balanced").replace(path_samples=4, path_scatterings=4)
    ours = nubis.Renderer(32, 18, quality=quality)
    one, other = ridge((32, 18), 0.0), ridge((32, 18), 5.0)
    shots = [(CLOUDY[0], params, 0.0, scene) for scene in (one, one, other)]
    first, second, third = ours.animate(shots)
    assert np.array_equal(first, ours.render(CLOUDY[0], params, scene_depth=one))
    assert not np.array_equal(first, second)
    assert np.array_equal(third, ours.render(CLOUDY[0], params, scene_depth=other))


def test_shots_with_a_bad_scene(renderer):
    make = renderer(*SIZE)
    shot = CAMERA, nubis.Params(), 0.0
    for scene, message in [
        ((np.zeros((3, 3)),), "scene_depth = array of shape"),
        ((None, np.zeros((18, 32, 3))), "without scene_depth"),
        ((np.ones((18, 32)), None, None), "it must be .camera, params, time., or with scene_depth"),
    ]:
        with pytest.raises(nubis.ParameterError, match=message):
            list(make.animate([(*shot, *scene)]))
    scene = np.ones((18, 32)), np.ones((18, 32, 3))
    with pytest.raises(nubis.ParameterError, match="background"):
        list(make.animate([(*shot, *scene)], background=None))


def test_distance_from_z():
    """A plane across the axis is z away everywhere, and farther along rays to the corners."""
    z = np.full((36, 64), 1000.0)
    z[3, 5] = np.inf
    distance = nubis.distance_from_z(CAMERA, z)
    directions = ref64.pixel_directions(CAMERA, 64, 36)
    along = distance * (directions @ np.array(CAMERA.forward))
    assert np.allclose(along[np.isfinite(z)], 1000.0, rtol=1e-6) and np.isinf(distance[3, 5])
    with pytest.raises(nubis.ParameterError, match="pinhole"):
        nubis.distance_from_z(nubis.Camera.equirect((0, 0, 0)), z)
    with pytest.raises(nubis.ParameterError, match=r"z\[0, 1\] = -1"):
        nubis.distance_from_z(CAMERA, [[1.0, -1.0]])
    with pytest.raises(nubis.ParameterError, match="shape"):
        nubis.distance_from_z(CAMERA, 5.0)


@pytest.mark.parametrize(
    "depth, color, message",
    [
        (np.zeros((36, 64)), None, "scene_depth = array of shape"),
        (np.zeros(SIZE), None, "scene_depth = array of shape"),
        (np.zeros(SIZE[::-1], dtype=bool), None, "dtype bool"),
        (np.zeros(SIZE[::-1], dtype=complex), None, "dtype complex"),
        ("far", None, "scene_depth"),
        (np.full(SIZE[::-1], np.nan), None, r"scene_depth\[0, 0\] = nan"),
        (np.full(SIZE[::-1], -1.0), None, r"scene_depth\[0, 0\] = -1"),
        (None, np.zeros((*SIZE[::-1], 3)), "without scene_depth"),
        (np.ones(SIZE[::-1]), np.zeros((*SIZE[::-1], 2)), "scene_color = array of shape"),
        (np.ones(SIZE[::-1]), np.full((*SIZE[::-1], 3), np.inf), r"scene_color\[0, 0, 0\] = inf"),
        (np.ones(SIZE[::-1]), np.full((*SIZE[::-1], 3), -0.5), r"scene_color\[0, 0, 0\] = -0.5"),
        (
            np.ones(SIZE[::-1]),
            np.full((*SIZE[::-1], 4), 1.5),
            r"scene_color\[..., 3\]\[0, 0\] = 1.5",
        ),
    ],
)
def test_what_is_no_scene(renderer, depth, color, message):
    with pytest.raises(nubis.ParameterError, match=message):
        renderer(*SIZE).render(CAMERA, nubis.Params(), scene_depth=depth, scene_color=color)


def test_colour_needs_the_sky(renderer):
    depth, color = np.ones(SIZE[::-1]), np.ones((*SIZE[::-1], 3))
    with pytest.raises(nubis.ParameterError, match="background"):
        renderer(*SIZE).render(
            CAMERA, nubis.Params(), background=None, scene_depth=depth, scene_color=color
        )


@pytest.mark.parametrize("far", [1.001e10, 9e29, 1e30, 3e38, np.inf])
def test_what_is_beyond_all_skies_is_sky(renderer, far):
    """As inf: 1e10 m is the farthest that a scene is, whatever number the sky has elsewhere."""
    camera = nubis.Camera.look_at((0, 0, 100), (0, 1000, 300))
    maker, params = renderer(16, 9), nubis.Params()
    depth, colour = np.full((9, 16), np.inf), np.ones((9, 16, 3))
    depth[:, 8:] = 500.0
    sky = maker.render(camera, params, scene_depth=depth, scene_color=colour)
    depth[:, :8] = far
    got = maker.render(camera, params, scene_depth=depth, scene_color=colour)
    np.testing.assert_array_equal(got, sky)
    depth[:, :8] = 1e10
    assert (maker.render(camera, params, scene_depth=depth) != sky).any()
