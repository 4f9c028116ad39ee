"""What comes in as an array keeps its meaning, or is refused by the name of its argument."""

import numpy as np
import pytest
import xarray

import nubis
from nubis import ParameterError
from nubis.testing import probe

CAMERA = nubis.Camera.look_at((0, 0, 100), (0, 1000, 100))
BOX = ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
MAP = np.full((4, 6, 3), 0.5, np.float32)
PARAMS = nubis.Params(clouds=nubis.Clouds(coverage=0.0))

# Each array argument: the name in its errors, an array that fits, a call.
ARGUMENTS = {
    "extinction": (np.ones((2, 3, 4)), lambda a, r: nubis.DensityGrid(a, BOX)),
    "bounds": (np.array(BOX), lambda a, r: nubis.DensityGrid(np.ones((1, 1, 1)), a)),
    "weather.map": (MAP, lambda a, r: nubis.Weather(map=a)),
    "weather.broad_map": (MAP, lambda a, r: nubis.Weather(broad_map=a)),
    "clouds.profile": (MAP[..., 0], lambda a, r: nubis.Clouds(profile=a)),
    "sun.irradiance": (np.ones(3), lambda a, r: nubis.Sun(irradiance=a)),
    "clouds.stratus": (np.full(4, 0.5), lambda a, r: nubis.Clouds(stratus=a)),
    "points": (np.ones((5, 3)), lambda a, r: r.density(a, PARAMS)),
    "points ": (np.ones((5, 3)), lambda a, r: r.sun_transmittance(a, PARAMS)),
    "center": (np.ones(2), lambda a, r: r.shadow_map(PARAMS, center=a, size=2)),
    "scene_depth": (np.ones((2, 3)), lambda a, r: r.render(CAMERA, PARAMS, scene_depth=a)),
    "scene_color": (
        np.ones((2, 3, 3)),
        lambda a, r: r.render(CAMERA, PARAMS, scene_depth=np.ones((2, 3)), scene_color=a),
    ),
    "z": (np.ones((2, 3)), lambda a, r: nubis.distance_from_z(CAMERA, a)),
    "eye": (np.ones(3), lambda a, r: nubis.Camera.equirect(a)),
    "target": (np.ones(3), lambda a, r: nubis.Camera.look_at((0, 0, 0), a)),
    "up": (np.ones(3), lambda a, r: nubis.Camera.fisheye((0, 0, 0), a)),
    "world_from_camera": (np.eye(4), lambda a, r: nubis.Camera.from_matrix(a)),
    "frame": (np.ones((2, 3, 4)), lambda a, r: nubis.to_srgb8(a)),
    "frame ": (np.ones((2, 3, 4)), lambda a, r: nubis.auto_exposure(a)),
    "frame  ": (np.ones((2, 3, 4)), lambda a, r: nubis.luminance(a)),
    "frame   ": (np.ones((2, 3, 4)), lambda a, r: nubis.save("/dev/null/x.npy", a)),
    "map": (MAP, lambda a, r: nubis.paint(a, (0, 0), 10, extent=1000)),
    "map ": (MAP, lambda a, r: nubis.paint_mask(a, MAP[..., 0])),
    "mask": (MAP[..., 0], lambda a, r: nubis.paint_mask(MAP, a)),
    "at": (np.ones((2, 2)), lambda a, r: nubis.paint(MAP, a, 10, extent=1000)),
    "inputs": (np.ones((2, 3)), lambda a, r: probe("x.x", a)),
    # Numbers, where an array without axes would do.
    "time": (np.array(1.0), lambda a, r: r.density(np.ones((1, 3)), PARAMS, time=a)),
    "exposure": (np.array(1.0), lambda a, r: nubis.to_srgb8(np.ones((1, 1, 3)), exposure=a)),
    "clouds.coverage": (np.array(0.5), lambda a, r: nubis.Clouds(coverage=a)),
    "fov_y": (np.array(50.0), lambda a, r: nubis.Camera.look_at((0, 0, 0), (1, 0, 0), fov_y=a)),
}


def _with_one_masked(array):
    mask = np.zeros(array.shape, bool)
    mask.flat[-1:] = True
    return np.ma.array(array, mask=mask)


class Sparse:
    """As of scipy.sparse, which NumPy makes an object of."""

    def __init__(self, array):
        self.shape, self.ndim, self.dtype = array.shape, array.ndim, array.dtype

    def todense(self):
        raise AssertionError("not asked for")


MEANINGLESS = {
    "masked": _with_one_masked,
    "all masked": lambda a: np.ma.array(a, mask=True),
    "masked in a list": lambda a: list(_with_one_masked(a)) if a.ndim else np.ma.masked,
    "complex": lambda a: a + 1j,
    "datetime": lambda a: a.astype("datetime64[ns]"),
    "duration": lambda a: a.astype("timedelta64[s]"),
    "text": lambda a: a.astype(str),
    "objects": lambda a: np.full(a.shape, None),
    "switches": lambda a: a > 0,
    "records": lambda a: np.zeros(a.shape, "f4,f4"),
    "sparse": Sparse,
}
REFUSED_NAN = [name for name in ARGUMENTS if name not in ("inputs", "frame ", "frame  ")]


@pytest.fixture
def small():
    return nubis.Renderer(3, 2, quality="draft")


def _refused(name, call, value, renderer):
    with pytest.raises(ParameterError, match="is not allowed") as error:
        call(value, renderer)
    message = str(error.value)
    assert message.startswith(name.strip()), message
    assert len(message) < 500, message


@pytest.mark.parametrize("kind", MEANINGLESS)
@pytest.mark.parametrize("name", ARGUMENTS)
def test_what_numpy_would_strip_of_its_meaning_is_refused(name, kind, small):
    fits, call = ARGUMENTS[name]
    _refused(name, call, MEANINGLESS[kind](fits), small)


@pytest.mark.parametrize("name", REFUSED_NAN)
def test_nan_is_refused(name, small):
    fits, call = ARGUMENTS[name]
    bad = fits.astype(np.float64)
    bad.flat[-1:] = np.nan
    if not fits.ndim:
        bad = np.array(np.nan)
    _refused(name, call, bad, small)


@pytest.mark.parametrize("name", ARGUMENTS)
def test_what_is_none_the_worse_is_taken(name, small):
    """Masks that hide nothing, lists, other dtypes and orders, and whatever has `__array__`."""
    fits, call = ARGUMENTS[name]
    if name == "frame   ":
        return  # It has nowhere to go.

    class Tensor:
        shape, ndim, dtype = fits.shape, fits.ndim, "float32"

        def __array__(self, dtype=None, copy=None):
            return np.array(fits, dtype=dtype)

    want = call(fits, small)
    again = [np.ma.array(fits), fits.tolist(), np.array(fits, order="F"), Tensor()]
    for value in again:
        got = call(value, small)
        if isinstance(want, tuple | np.ndarray | float):
            np.testing.assert_equal(got, want)
        else:
            assert got == want, type(value)


def test_a_mask_says_what_to_do():
    grid = np.ma.masked_invalid([[[0.1, np.nan], [0.1, np.nan]]])
    with pytest.raises(ParameterError, match=r"2 masked values.*filled"):
        nubis.DensityGrid(grid, BOX)
    assert nubis.DensityGrid(grid.filled(0), BOX).extinction[0, 0, 1] == 0


def test_ragged_arrays_are_refused(small):
    for name in ("extinction", "weather.map", "points", "scene_depth", "bounds"):
        _refused(name, ARGUMENTS[name][1], [[[1.0, 2.0]], [[1.0]]], small)


def test_where_what_is_not_allowed_is(small):
    depth = np.ones((2, 3))
    depth[1, 2] = depth[0, 1] = np.nan
    with pytest.raises(ParameterError, match=r"scene_depth\[0, 1\] = nan \(one of 2 such values\)"):
        small.render(CAMERA, PARAMS, scene_depth=depth)


@pytest.mark.parametrize("dims", [("z", "y", "x"), ("x", "y", "z"), ("y", "z", "x")])
def test_labelled_grids_are_read_by_their_names(dims, rng):
    values = rng.random((2, 3, 4)).astype(np.float32)
    labelled = xarray.DataArray(values, dims=("z", "y", "x")).transpose(*dims)
    np.testing.assert_array_equal(nubis.DensityGrid(labelled, BOX).extinction, values)


@pytest.mark.parametrize("dims", [("y", "x", "c"), ("c", "y", "x"), ("x", "c", "y")])
def test_labelled_pictures_are_read_by_their_names(dims, rng):
    values = rng.random((5, 4, 3)).astype(np.float32)
    labelled = xarray.DataArray(values, dims=("y", "x", "c")).transpose(*dims)
    np.testing.assert_array_equal(nubis.Weather(map=labelled).map, values)
    np.testing.assert_array_equal(nubis.to_srgb8(labelled), nubis.to_srgb8(values))


def test_labels_that_say_nothing_are_refused(small):
    grid = xarray.DataArray(np.ones((2, 3, 4)), dims=("level", "lat", "lon"))
    _refused("extinction", ARGUMENTS["extinction"][1], grid, small)
    _refused("points", ARGUMENTS["points"][1], xarray.DataArray(np.ones((5, 3))), small)
    down = xarray.DataArray(np.ones((2, 3, 4)), dims=("z", "y", "x"), coords={"z": [9.0, 1.0]})
    with pytest.raises(ParameterError, match=r"sortby\('z'\)"):
        nubis.DensityGrid(down, BOX)
    nubis.DensityGrid(down.sortby("z"), BOX)


def test_bounds_are_numbers_to_the_last():
    for index in np.ndindex(2, 3):
        for bad in (np.nan, np.inf, -np.inf):
            bounds = np.array(BOX)
            bounds[index] = bad
            with pytest.raises(ParameterError, match=r"bounds.*finite"):
                nubis.DensityGrid(np.ones((1, 1, 1)), bounds)
