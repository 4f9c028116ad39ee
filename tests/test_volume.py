"""A cloud of your own: what is accepted, what comes back, and that every method renders it."""

import pickle

import numpy as np
import pytest

import nubis
from nubis import DensityGrid, ParameterError

BOX = ((-500.0, 1000.0, 800.0), (500.0, 2000.0, 1600.0))


def ball(n=12, peak=0.02):
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij")
    return (peak * np.clip(1 - np.sqrt(x * x + y * y + z * z), 0, 1)).astype(np.float32)


def sky(grid, **changes):
    values = {"atmosphere.enabled": False, "high_clouds.coverage": 0.0, "sun.visible": False}
    return nubis.Params().replace(volume=grid).with_(**(values | changes))


def test_it_gives_back_what_it_was_given():
    given = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    grid = DensityGrid(given, BOX)
    assert grid.shape == (2, 3, 4) and grid.bounds == BOX
    assert grid.extinction.dtype == np.float32
    np.testing.assert_array_equal(grid.extinction, given)
    grid.extinction[:] = 0
    given[:] = 0
    assert grid.extinction.max() == 23
    assert DensityGrid(np.ones((2, 2, 2), dtype=np.int64)[::-1], BOX).extinction.all()


def test_it_compares_by_value():
    grid, same = DensityGrid(ball(), BOX), DensityGrid(ball(), BOX)
    assert grid == same and hash(grid) == hash(same) and pickle.loads(pickle.dumps(grid)) == grid
    assert grid != DensityGrid(ball(peak=0.03), BOX)
    assert grid != DensityGrid(ball(), (BOX[0], (500.0, 2000.0, 1700.0)))
    assert "12, 12, 12" in repr(grid)


def test_parameters_hold_it(tmp_path):
    params = sky(DensityGrid(ball(4), BOX))
    assert params == sky(DensityGrid(ball(4), BOX)) != sky(None)
    assert pickle.loads(pickle.dumps(params)) == params
    assert nubis.Params.from_dict(params.to_dict()) == params
    params.save(tmp_path / "sky.toml")
    assert nubis.Params.load(tmp_path / "sky.toml") == params
    assert "volume" not in sky(None).to_dict()


@pytest.mark.parametrize(
    ("extinction", "bounds", "field"),
    [
        (np.ones((2, 2)), BOX, "extinction"),
        (np.ones((0, 2, 2)), BOX, "extinction"),
        (np.ones((1, 1, 2049)), BOX, "extinction"),
        ("cloud", BOX, "extinction"),
        (None, BOX, "extinction"),
        (np.full((2, 2, 2), np.nan), BOX, "extinction"),
        (np.full((2, 2, 2), np.inf), BOX, "extinction"),
        (np.full((2, 2, 2), -1e-9), BOX, "extinction"),
        (np.full((2, 2, 2), 1.1e8), BOX, "extinction"),
        (ball(), (BOX[1], BOX[0]), "bounds"),
        (ball(), (BOX[0], BOX[0]), "bounds"),
        (ball(), ((0, 0, 0), (1, 1, np.nan)), "bounds"),
        (ball(), ((0, 0, 0), (1, 1, 1e9)), "bounds"),
        (ball(), (0, 0, 0), "bounds"),
        (ball(), None, "bounds"),
    ],
)
def test_what_is_refused(extinction, bounds, field):
    with pytest.raises(ParameterError, match=field):
        DensityGrid(extinction, bounds)


def test_only_a_grid_is_a_volume():
    with pytest.raises(ParameterError, match=r"(?s)volume.*DensityGrid or None"):
        nubis.Params(volume=ball())
    with pytest.raises(ParameterError, match="volume"):
        nubis.Params().with_(**{"volume.extinction": 1.0})
    for bad in ({"extinction": [[[1.0]]]}, {"extinction": 1.0, "bounds": BOX, "x": 1}):
        with pytest.raises(ParameterError, match="volume"):
            nubis.Params.from_dict({"volume": bad})


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("model", ["single", "nubis2015", "thesis2018", "vsu2022", "octaves"])
@pytest.mark.parametrize("quality", ["draft", "balanced", "high", "nubis2015", "vsu2022"])
def test_every_method_renders_it(renderer, quality, model):
    """Near the converged picture of the same light model."""
    camera = nubis.Camera.look_at((0, -500, 900), (0, 1500, 1200), fov_y=34)
    params = sky(DensityGrid(ball(), BOX), **{"light.model": model, "light.ambient": (0.1,) * 3})
    got, want = (renderer(24, 16, q).render_layers(camera, params) for q in (quality, "reference"))
    assert want["transmittance"].min() < 0.2
    assert np.abs(got["transmittance"] - want["transmittance"]).max() < 0.05
    near = np.isfinite(want["depth"]) & (want["transmittance"] < 0.9)
    np.testing.assert_allclose(got["depth"][near], want["depth"][near], rtol=0.05)
    difference = got["radiance"] - want["radiance"]
    assert np.sqrt(np.mean(difference**2)) < 0.25 * want["radiance"].mean()


def test_a_volume_replaces_the_clouds_and_stays_where_it_is(renderer):
    """No weather, no wind, no cover reaches it; without it the clouds are back."""
    camera = nubis.Camera.look_at((0, -500, 900), (0, 1500, 1200), fov_y=60)
    make = renderer(24, 16, "balanced")
    params = sky(DensityGrid(ball(), BOX))
    still = make.render(camera, params)
    other = {"clouds.coverage": 0.0, "clouds.extinction": 9.0, "weather.seed": 3}
    changed = params.with_(**other, **{"wind.speed": 50.0})
    np.testing.assert_array_equal(make.render(camera, changed, time=1e5), still)
    assert (make.render(camera, params.replace(volume=None)) != still).any()
    empty = make.render_layers(camera, sky(DensityGrid(0 * ball(), BOX)))
    assert (empty["transmittance"] == 1).all() and (empty["radiance"] == 0).all()


EMPTY = DensityGrid(np.zeros((2, 2, 2)), BOX)
HIGH = {
    "high_clouds.coverage": 1.0,
    "high_clouds.altitude": 2000.0,
    "high_clouds.optical_depth": 3.0,
    "atmosphere.enabled": False,
}
UP = nubis.Camera.look_at((0, 0, 100), (0, 1000, 900))


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["draft", "reference"])
@pytest.mark.parametrize("model", ["nubis2015", "path"])
def test_a_grid_is_all_the_cloud_there_is(renderer, quality, model):
    """An empty one leaves the picture of a clear sky, whatever the defaults, unless high clouds are
    asked for; then they are those of a sky without a grid.
    """
    maker = renderer(16, 9, quality)
    base = nubis.Params().with_(**HIGH, **{"light.model": model, "clouds.coverage": 0.0})
    points = np.array([[0.0, 0.0, 0.0], [2000.0, 100.0, 1000.0]])

    def answers(params):
        layers = maker.render_layers(UP, params)
        return {
            "picture": maker.render(UP, params),
            "frame": next(maker.animate([(UP, params, 0.0)])),
            "transmittance": layers["transmittance"],
            "sun": maker.sun_transmittance(points, params),
            "map": maker.shadow_map(params, size=4).transmittance,
            "seen": np.array(maker.sun_visibility(UP, params)),
        }

    clear = answers(base.with_(**{"high_clouds.coverage": 0.0}))
    assert (clear["transmittance"] == 1).all() and (clear["sun"] == 1).all()
    for name, value in answers(base.replace(volume=EMPTY)).items():
        np.testing.assert_array_equal(value, clear[name], err_msg=name)
    high = answers(base)
    assert high["transmittance"].min() < 0.9 and high["sun"].min() < 0.9
    wished = answers(base.with_(**{"high_clouds.with_volume": True}).replace(volume=EMPTY))
    for name, value in wished.items():
        np.testing.assert_allclose(value, high[name], rtol=0.02, atol=0.005, err_msg=name)
