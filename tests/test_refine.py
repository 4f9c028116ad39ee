"""Pixels between rays that look alike are interpolated (shaders/wgsl/passes/refine.wgsl)."""

import numpy as np
import pytest

import nubis
from nubis.testing import probe

#: The clouds alone, as they are marched: no air before them, no high clouds.
BARE = {"atmosphere.aerial_perspective": 0.0, "high_clouds.coverage": 0.0}


def layers(size, contrast, scene="fair_weather", quality="balanced", **changes):
    """A part of a scene: pixels of a tenth of a degree, one in sixteen of which comes first."""
    eye = nubis.scenes[scene][0].eye
    target = np.add(eye, (0.3, 1.0, -0.2 if scene == "above" else 0.25))
    camera = nubis.Camera.look_at(eye, target, (0, 0, 1), min(0.1 * size[1], 60.0))
    params = nubis.scenes[scene][1]
    quality = nubis.quality(quality).replace(adaptive_threshold=contrast)
    return nubis.Renderer(*size, quality=quality).render_layers(camera, params.with_(**changes))


def clouds(of):
    return np.concatenate([of["radiance"], of["transmittance"][..., None]], axis=-1)


def sample_grid(size):
    """The columns or rows that are marched first: every fourth, and the last."""
    return sorted({*range(0, size, 4), size - 1})


def around(n, size, step):
    """The grid's columns or rows beside one, or on both sides of one of its own."""
    if n % step:
        return [n - n % step, n - n % step + step]
    return [max(n - step, 0), n, min(n + step, size - 1)]


def ref64(rays, contrast, backdrop):
    """What `refine` makes of the rays of all pixels, and which of them it takes.

    For pictures whose last column and row are multiples of four.
    """
    height, width = rays.shape[:2]
    picture = np.full_like(rays, np.nan, dtype=float)
    picture[::4, ::4] = rays[::4, ::4]
    for step in (4, 2):
        half, before = step // 2, picture.copy()
        for y, x in np.ndindex(height, width):
            if y % half or x % half or (y % step == 0 and x % step == 0):
                continue
            ys, xs = around(y, height, step), around(x, width, step)
            corners = before[np.ix_(ys, xs)].reshape(-1, 4)
            light = corners[:, :3].max(axis=1)
            against = max(light.max(), corners[:, 3].max() * backdrop)
            if max(np.ptp(corners[:, 3]), np.ptp(light) / against) > contrast:
                picture[y, x] = rays[y, x]
            else:
                between = np.ix_(
                    [ys[0], ys[-1]] if y % step else [y], [xs[0], xs[-1]] if x % step else [x]
                )
                picture[y, x] = before[between].mean(axis=(0, 1))
    return picture


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("contrast", [0.05, 0.3])
def test_it_does_what_its_twin_does(contrast):
    """The spans in which later rays look for cloud cost a little more: 2 % of the pixels."""
    size = 97, 61
    got = clouds(layers(size, contrast, **BARE))
    rays = clouds(layers(size, 0.0, **BARE))
    backdrop = probe(
        "sky_light[0]", [[0.0]], imports=["light"], params=nubis.scenes["fair_weather"][1]
    )
    expected = ref64(rays, contrast, backdrop[0, :3].max())
    differs = np.abs(got - expected).max(axis=-1) > 1e-4
    assert np.mean(differs) < 0.02
    assert np.abs(got - rays).max() > 10 * contrast * 1e-3


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", ["fair_weather", "overcast", "storm", "above", "in_cloud"])
def test_it_costs_little_error(scene):
    """Against a ray for every pixel: 9 % of the mean radiance, 0.03 of the transmittance, no bias
    past 1 %.
    """
    size = 320, 180
    full, few = (layers(size, contrast, scene, "draft") for contrast in (0.0, 0.1))
    seen = full["transmittance"] < 0.999
    mean = full["radiance"][seen].mean()
    error = (few["radiance"] - full["radiance"])[seen]
    assert np.sqrt(np.mean(error**2)) < 0.09 * mean
    assert abs(error.mean()) < 0.01 * mean
    assert np.sqrt(np.mean((few["transmittance"] - full["transmittance"]) ** 2)) < 0.03
    assert few["samples"].sum() < 0.8 * full["samples"].sum()
    has_depth = np.isfinite(few["depth"])
    assert (has_depth | (few["transmittance"] == 1)).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "size", [(1, 1), (1, 7), (7, 1), (2, 2), (3, 5), (4, 4), (5, 4), (6, 9), (23, 18)]
)
def test_sizes_that_four_does_not_divide(size):
    """Every pixel gets a value, and those of the grid the same as without."""
    full, few = (layers(size, contrast, "overcast", "draft") for contrast in (0.0, 0.2))
    rows, columns = np.ix_(sample_grid(size[1]), sample_grid(size[0]))
    for name, expected in full.items():
        if name == "sky":  # interpolated too (test_composite.py)
            np.testing.assert_allclose(few[name], expected, rtol=0.01)
        else:
            assert np.array_equal(few[name][rows, columns], expected[rows, columns]), name
        assert not np.isnan(few[name]).any()
    assert (few["radiance"] > 0).all(axis=-1).any()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("size", [(160, 90), (97, 62), (162, 91)])
def test_it_follows_from_the_picture_alone(size):
    """Whatever the renderer has made before, and so what its buffers hold."""
    camera, params = nubis.scenes["fair_weather"]
    used = nubis.Renderer(*size, quality="balanced")
    fresh = used.render(camera, params)
    for before in "fair_weather", "cirrus":
        used.render(*nubis.scenes[before])
        assert used.render(camera, params).tobytes() == fresh.tobytes()


@pytest.mark.slow
def test_strips_meet(monkeypatch):
    """A picture of more than a million pixels is made in strips, which share a row of rays."""
    size = 4096, 264  # 256 rows a strip
    full, few = (layers(size, contrast, "cirrus", "draft") for contrast in (0.0, 0.2))
    rows, columns = np.ix_(sample_grid(size[1]), sample_grid(size[0]))
    assert np.array_equal(few["transmittance"][rows, columns], full["transmittance"][rows, columns])
    error = np.abs(few["radiance"] - full["radiance"]).max(axis=(1, 2))
    assert error[252:260].max() <= 2 * error.max(initial=0.1)
    assert np.isfinite(few["radiance"]).all()


def test_nothing_is_left_of_the_picture_before():
    camera, (other, params) = nubis.scenes["above"][0], nubis.scenes["overcast"]
    used = nubis.Renderer(512, 288, quality="draft")
    used.render(camera, params)
    layers = used.render_layers(other, params)
    fresh = nubis.Renderer(512, 288, quality="draft").render_layers(other, params)
    assert (fresh["samples"] == 0).mean() > 0.3
    for name, expected in fresh.items():
        assert np.array_equal(layers[name], expected), name


def test_a_clear_sky_takes_no_samples():
    clear = layers((64, 36), 0.1, **{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0})
    assert (clear["samples"] == 0).all()
    assert (clear["transmittance"] == 1).all() and np.isinf(clear["depth"]).all()
    assert (clear["radiance"] == 0).all()
