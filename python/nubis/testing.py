"""Evaluation of single shader functions, for tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from nubis._arrays import numbers
from nubis._nubis import Camera
from nubis._renderer import Renderer
from nubis.params import Light, Params, Quality


def probe(
    expression: str,
    inputs: npt.ArrayLike,
    *,
    imports: Sequence[str] = (),
    params: Params | None = None,
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0),
    time: float = 0.0,
    quality: str | Quality = "balanced",
) -> npt.NDArray[np.float32]:
    """Return the value of a WGSL expression of ``x: vec4f`` for each input.

    Parameters
    ----------
    expression : str
        Expression of type scalar or vec4f, such as ``"henyey_greenstein(x.x, x.y)"``.
    inputs : array-like, shape (N,) or (N, k), k up to 4
        Values of ``x``; missing components are 0.
    imports : sequence of str
        Files of ``shaders/wgsl`` without their extension, such as ``"phase"``.
    params : Params, optional
        Parameters of the uniform blocks; the defaults if left out.
    eye : three floats
        Camera position in world metres, the origin of positions in the shaders.
    time : float
        Time in seconds.
    quality : str or Quality
        Numerical method of the uniform blocks.

    Returns
    -------
    values : array of float32, shape (N, 4)

    Examples
    --------
    >>> values = probe("henyey_greenstein(x.x, x.y)", [(0.0, 0.6)], imports=["phase"])
    """
    given = numbers(
        "inputs",
        inputs,
        "an array of numbers of shape (N,) or (N, k), k up to 4",
        shapes=[(None,), *((None, k) for k in range(1, 5))],
        dtype=np.float32,
        nonfinite="nan",
    )
    given = given.reshape(len(given), -1)
    full = np.zeros((len(given), 4), dtype=np.float32)
    full[:, : given.shape[1]] = given
    renderer = Renderer(1, 1, quality=quality)
    given_params = params or Params()
    return renderer._core.probe(list(imports), expression, full.tolist(), given_params, eye, time)


def solve_light(
    extinction: npt.ArrayLike,
    cell: tuple[float, float, float],
    sun: tuple[float, float, float],
    *,
    periodic: bool = True,
    cycles: int = 10,
    params: Params | None = None,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float32], float]:
    """Return the light field of one level of cells, solved from no light.

    Parameters
    ----------
    extinction : array-like, shape (nz, ny, nx)
        Extinction of each cell in 1/m.
    cell : three floats
        Size of a cell along x, y and z in m.
    sun : three floats
        Unit vector toward the sun.
    periodic : bool
        Whether the cells repeat in x and y; otherwise skylight alone enters at the sides.
    cycles : int
        Number of cycles.
    params : Params, optional
        Phase function and albedo.

    Returns
    -------
    of_sun, of_sky : array of float32, shape (4, nz, ny, nx)
        Fluence and flux of light that has turned, for a sun of irradiance 1 and for a uniform sky
        of radiance 1.
    deposits : array of float32, shape (2, nz, ny, nx)
        Scaled extinction in 1/m, and scaled sunlight.
    factor : float
        Factor on the scaled sunlight that balances what the cells take from the sun.
    """
    cells = np.ascontiguousarray(extinction, np.float32)
    given = params or Params(light=Light(model="multiple"))
    core = Renderer(1, 1)._core
    moments, deposits, factor = core.solve_light(cells, cell, sun, (periodic, cycles), given)
    of_sun, of_sky = np.moveaxis(moments, -1, 0).reshape(2, 4, *cells.shape)
    return of_sun, of_sky, np.moveaxis(deposits, -1, 0), factor


def light_field(
    renderer: Renderer,
    camera: Camera,
    params: Params,
    *,
    time: float = 0.0,
    more_cycles: int = 0,
    animated: bool = False,
) -> tuple[npt.NDArray[np.float32], ...]:
    """Return the light field of a shot, with the light model ``"multiple"``.

    Parameters
    ----------
    renderer : Renderer
    camera : Camera
    params : Params
    time : float
        Time in seconds.
    more_cycles : int
        Number of cycles of each level besides the planned ones.
    animated : bool
        Whether to return the field of the last frame of `Renderer.animate` instead, whatever the
        shot.

    Returns
    -------
    optics, of_sun, of_sky : array of float32, shape (rows of all levels, ny, nx, 4)
        Density, optical depth toward the sun; fluence and flux of light that has turned, for a sun
        of irradiance 1 and for a uniform sky of radiance 1. The rows of the finest level are first.
    """
    textures = renderer._core.light_field(camera, params, time, (more_cycles, animated))
    return tuple(textures)
