"""Where one pixel in sixteen is marched and nothing else, as in "preview", the clouds are known at
the corners of cells of four by four pixels, in frames as in stills (shaders/wgsl/sample_grid.wgsl).
"""

import numpy as np
import pytest

import nubis
import ref64
from nubis import Camera

SIZE = 240, 136
PREVIEW = nubis.quality("preview")
#: A ray for each pixel.
EVERY = PREVIEW.replace(adaptive_threshold=0.0)
#: The clouds alone, as they are marched: no air before them, no high clouds.
BARE = {"atmosphere.enabled": False, "high_clouds.coverage": 0.0}
EYE, TARGET = (0, 0, 200), (300, 1000, 450)
SKY = nubis.scenes["fair_weather"][1]


def shots(count, speed=60.0, params=SKY):
    """A flight, in pixels of a tenth of a degree."""
    forward = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    for i in range(count):
        at = EYE + speed * i / 24 * forward
        yield Camera.look_at(at, at + forward, (0, 0, 1), 13), params, i / 24


def between(rays):
    """What lies between every fourth pixel of a picture, linearly, up to the last of those."""
    height, width = (4 * ((n - 1) // 4) for n in rays.shape[:2])
    known = rays[: height + 1 : 4, : width + 1 : 4]
    y, x = np.arange(height), np.arange(width)
    down, along = (y % 4 / 4)[:, None, None], (x % 4 / 4)[None, :, None]
    corner = [[known[np.ix_(y // 4 + i, x // 4 + j)] for j in (0, 1)] for i in (0, 1)]
    upper, lower = (row[0] * (1 - along) + row[1] * along for row in corner)
    return upper * (1 - down) + lower * down


def wider(camera, size, rim):
    """The same view with so many pixels more on each side."""
    half = np.tan(np.radians(camera.fov / 2)) * (1 + 2 * rim / size[1])
    fov = 2 * np.degrees(np.arctan(half))
    camera = Camera.look_at(camera.eye, np.add(camera.eye, camera.forward), (0, 0, 1), fov)
    return camera, [n + 2 * rim for n in size]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("size", [(240, 136), (241, 135), (163, 110), (242, 139), (1024, 1100)])
def test_a_still_lies_between_its_rays(size):
    """Up to those beyond its edges, and across the strips that a large one is made in."""
    camera, params = next(shots(1))[0], SKY.with_(**BARE)
    preview, every = (quality.replace(jitter=False) for quality in (PREVIEW, EVERY))
    got = nubis.Renderer(*size, quality=preview).render(camera, params, background=None)
    camera, large = wider(camera, size, 4)
    rays = nubis.Renderer(*large, quality=every).render(camera, params, background=None)
    expected = between(rays)[4:, 4:][: size[1], : size[0]]
    assert expected.shape == got.shape
    assert rays[..., 3].min() < 0.01 and rays[..., 3].max() > 0.99
    # Rounding moves rays by some 1e-7 of their length.
    assert np.abs(got - expected).mean() < 1e-4
    assert (np.abs(got - expected) > 1e-3).mean() < 0.02


@pytest.mark.slow
def test_what_is_between_is_put_where_it_belongs():
    """With air, sky, high clouds and shadows: near the picture that has a ray for each pixel."""
    camera, params, _ = next(shots(1))
    for scene in ("fair_weather", "above", "sunset"):
        params = nubis.scenes[scene][1].with_(**{"sun.visible": False})
        got, rays = (
            nubis.Renderer(*SIZE, quality=quality).render_layers(camera, params)
            for quality in (PREVIEW, EVERY)
        )
        assert ref64.relative_rmse(got["radiance"], rays["radiance"]) < 0.25
        assert got["radiance"].mean() == pytest.approx(rays["radiance"].mean(), rel=0.01)
        np.testing.assert_allclose(got["sky"], rays["sky"], rtol=0.05, atol=1e-3)
        thick = (got["transmittance"] < 0.1) & (rays["transmittance"] < 0.1)
        ratio = got["depth"][thick] / rays["depth"][thick]
        assert np.median(ratio) == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_layers_are_those_of_the_still():
    camera, params, _ = next(shots(1))
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    still = make.render(camera, params, background=None)
    layers = make.render_layers(camera, params)
    np.testing.assert_allclose(layers["radiance"], still[..., :3], rtol=1e-4, atol=1e-5)
    rays = nubis.Renderer(*SIZE, quality=EVERY).render_layers(camera, params)
    samples = layers["samples"].copy()
    assert (samples[::4, ::4] > 0).mean() > 0.5
    np.testing.assert_array_equal(samples[::4, ::4], rays["samples"][::4, ::4])
    samples[::4, ::4] = 0
    assert not samples.any()


def test_depth_is_that_of_the_opaque():
    """Between rays it is their mean by opacity."""
    camera, params = next(shots(1))[0], SKY.with_(**BARE)
    got, rays = (
        nubis.Renderer(*SIZE, quality=quality).render_layers(camera, params)
        for quality in (PREVIEW, EVERY)
    )
    opacity = 1.0 - rays["transmittance"].astype(float)
    depth = np.where(np.isfinite(rays["depth"]), rays["depth"], 0.0)
    reach, weight = (between(layer[..., None])[..., 0] for layer in (opacity * depth, opacity))
    seen = weight > 1e-3
    found = got["depth"][: len(seen), : seen.shape[1]]
    np.testing.assert_allclose(found[seen], (reach / weight.clip(1e-9))[seen], rtol=1e-3)
    assert np.ptp(found[seen]) > 5000
    assert np.isinf(found[weight == 0]).all()


@pytest.mark.slow
def test_a_static_shot_is_the_still():
    camera, params, _ = next(shots(1))
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    still = make.render(camera, params)
    for frame in make.animate([(camera, params, 0.0)] * 6):
        assert frame.tobytes() == still.tobytes()


def test_what_stops_becomes_the_still():
    moving = list(shots(6))
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    *_, last = make.animate(moving + moving[-1:] * 8)
    still = make.render(*moving[-1][:2], time=moving[-1][2])
    assert ref64.relative_rmse(last, still) < 1e-3


def test_clouds_go_where_they_are_seen_next():
    """A turn of one and a half cells a frame: what has been followed is where the still has it."""
    step = np.radians(13 / 130 * 6)

    def look(azimuth):
        target = EYE + np.array([np.sin(azimuth), np.cos(azimuth), 0.2]) * 1000
        return Camera.look_at(EYE, target, (0, 0, 1), 13)

    turn = [(look(step * i), SKY, 0.0) for i in range(8)]
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    *_, last = make.animate(turn)
    still = make.render(*turn[-1][:2])
    known = make.history_length == 16
    assert known.mean() > 0.8
    assert ref64.relative_rmse(last[known], still[known]) < 0.08  # 0.050; by whole pixels, 0.15


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", ["fair_weather", "above", "overcast"])
def test_a_flight_is_near_its_stills(scene):
    """Within 5 %, where frames that follow every pixel differ by 10 %."""
    params = nubis.scenes[scene][1].with_(**{"sun.visible": False})
    flight = list(shots(14, params=params))
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    other = nubis.Renderer(*SIZE, quality=PREVIEW)
    for i, frame in enumerate(make.animate(flight)):
        still = other.render(*flight[i][:2], time=flight[i][2])
        assert ref64.relative_rmse(frame[..., :3], still[..., :3]) < 0.06
    assert make.history_length.shape == SIZE[::-1]


def test_what_vanishes_leaves_no_ghost():
    camera, params, _ = next(shots(1))
    params = params.with_(**{"high_clouds.coverage": 0.0})
    thin = params.with_(**{"clouds.coverage": 0.1})
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    frames = list(
        make.animate([(camera, params, 0.0)] * 3 + [(camera, thin, 0.0)] * 4, background=None)
    )
    assert frames[2][..., 3].mean() > 0.2
    # Of what is smaller than the distance of the rays a trace may stay until its own ray.
    assert (frames[3][..., 3] > 1e-3).mean() < 2e-3
    assert frames[6][..., 3].max() < 1e-3


def test_history():
    """What comes into the picture is between its rays until it has one, 4 of 16 for each frame."""
    make = nubis.Renderer(*SIZE, quality=PREVIEW)

    def look(azimuth):
        target = EYE + np.array([np.sin(azimuth), np.cos(azimuth), 0.2]) * 1000
        return Camera.look_at(EYE, target, (0, 0, 1), 12)

    list(make.animate([(look(0.0), SKY, 0.0)] * 2))
    assert (make.history_length == 16).all()
    lengths = []
    for count in range(1, 6):
        list(make.animate([(look(0.0), SKY, 0.0)] + [(look(0.1), SKY, 0.0)] * count))
        lengths.append(make.history_length[:, -16:])
    shares = [(length == 16).mean() for length in lengths]
    assert (np.diff(shares) >= 0).all() and shares[0] >= 0.25 and shares[3:] == [1.0, 1.0]
    for count, length in enumerate(lengths[:3], start=1):
        assert set(np.unique(length)) <= {4 * n for n in range(1, count + 1)} | {16}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fisheye", "equirect"])
def test_other_projections(kind):
    """A flight in them is as near to its stills, their edges and rim no farther than the rest."""
    size = (160, 160) if kind == "fisheye" else (2880, 720)
    params = SKY.with_(**{"sun.visible": False})

    def shot(i):
        at = np.add(EYE, (0, 2.5 * i, 0))
        if kind == "fisheye":
            return Camera.fisheye(at, np.subtract(TARGET, EYE), 16), params, i / 24
        return Camera.equirect(at), params, i / 24

    flight = [shot(i) for i in range(5)]
    make = nubis.Renderer(*size, quality=PREVIEW)
    *_, last = make.animate(flight)
    still = make.render(*flight[-1][:2], time=flight[-1][2])
    assert make.history_length is not None
    assert ref64.relative_rmse(last, still) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1), (2, 7), (5, 6), (3, 200), (200, 3), (8, 8)])
def test_small_and_narrow_pictures(size):
    """Of fewer pixels than a cell has, too: in frames as in stills."""
    make = nubis.Renderer(*size, quality=PREVIEW)
    shot, other = (
        (Camera.look_at(eye, TARGET, (0, 0, 1), 0.1 * size[1]), SKY, 0.0)
        for eye in (EYE, (9, 9, 200))
    )
    still = make.render(*shot[:2])
    every = nubis.Renderer(*size, quality=EVERY).render(*shot[:2])
    assert ref64.relative_rmse(still, every) < 0.3
    frames = list(make.animate([shot] * 3 + [other] * 3))
    assert all(frame.tobytes() == still.tobytes() for frame in frames[:3])
    assert ref64.relative_rmse(frames[-1], make.render(*other[:2])) < 0.1


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("altitude", [9000.0, 40_000.0])
def test_from_above_the_high_clouds(altitude):
    """Each pixel is composed by itself there, before and behind the layer that is seen twice."""
    eye = np.array([0.0, 0.0, altitude])
    camera = Camera.look_at(eye, np.add(eye, (300, 3000, -1500)), (0, 0, 1), 13)
    got, rays = (
        nubis.Renderer(*SIZE, quality=quality).render(camera, SKY) for quality in (PREVIEW, EVERY)
    )
    assert ref64.relative_rmse(got, rays) < 0.21
    assert got.mean() == pytest.approx(rays.mean(), rel=0.01)


@pytest.mark.slow
def test_a_scene_has_each_ray_at_its_edges():
    """It is followed pixel by pixel, and what comes after it begins with a still."""
    camera, params, _ = next(shots(1))
    make = nubis.Renderer(*SIZE, quality=PREVIEW)
    wall = np.full(SIZE[::-1], np.inf, np.float32)
    wall[:, 101:] = 500.0
    bare, seen, after = make.animate(
        [(camera, params, 0.0), (camera, params, 0.0, wall), (camera, params, 0.0)],
        background=None,
    )
    expected = make.render(camera, params, background=None, scene_depth=wall)
    np.testing.assert_allclose(seen, expected, atol=1e-3)
    assert seen[:, 101:, 3].max() < 1e-3 < bare[:, 101:, 3].max()
    assert np.abs(after - bare).mean() < 0.03


def test_it_takes_a_sixteenth_of_the_buffers():
    camera, params, _ = next(shots(1))
    bytes_of = {}
    for name, quality in (("preview", PREVIEW), ("every", EVERY)):
        make = nubis.Renderer(*SIZE, quality=quality)
        list(make.animate([(camera, params, 0.0)] * 2))
        bytes_of[name] = {
            name: size for owner, name, size in make._core.memory() if owner == "animation"
        }
    for name in ("clouds", "cloud_depth", "followed", "active_rays"):
        assert bytes_of["preview"][name] < bytes_of["every"][name] / 14


def test_wide_pixels_have_their_rays():
    """Of more than an eighth of a degree they are marched as in "draft" with as many steps."""
    make = nubis.Renderer(48, 27, quality=PREVIEW)
    camera = nubis.scenes["fair_weather"][0]
    every = nubis.Renderer(48, 27, quality=EVERY)
    np.testing.assert_allclose(
        make.render(camera, SKY, background=None),
        every.render(camera, SKY, background=None),
        rtol=1e-3,
        atol=1e-3,
    )
