"""Painting of weather maps with a soft brush."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._arrays import Shape, first_bad, numbers
from nubis._errors import ParameterError

Channel = Literal["coverage", "type", "precipitation"]
Mode = Literal["add", "set", "multiply"]
Edge = Literal["repeat", "mirror", "clamp"]
Map = npt.NDArray[np.float32]


def paint(
    map: npt.ArrayLike,
    at: npt.ArrayLike,
    radius: float,
    *,
    extent: float,
    channel: Channel = "coverage",
    amount: float = 1.0,
    hardness: float = 0.5,
    mode: Mode = "add",
    edge: Edge = "repeat",
) -> Map:
    """Return a copy of a weather map with one brush stroke painted on it.

    Positions are world positions at time 0; the painted clouds drift with the wind of the weather
    map. A stroke with ``mode="set", amount=0`` keeps a place clear as long as `clouds.coverage`,
    which offsets the whole map, is at most 0.5.

    Parameters
    ----------
    map : array-like, shape (H, W, 3)
        Weather map: coverage, type and precipitation, 0 to 1, row 0 in the north; from an array,
        `load_map` or `Renderer.weather_map`. It is not modified.
    at : (2,) or (N, 2) floats
        World metres, x east and y north of the centre of the map: a point, or the vertices of a
        path. A path is one stroke: where it crosses itself, it paints once.
    radius : float
        Radius of the brush in metres, at most `extent`.
    extent : float
        `weather.extent` of the map, in metres.
    channel : {"coverage", "type", "precipitation"}
        Channel of the map that is painted.
    amount : float
        Value in the centre of the brush that is added (-1 to 1), set (0 to 1) or multiplied by
        (from 0).
    hardness : float
        Fraction of the radius, 0 to 1, within which the brush has full strength. Beyond it the
        strength falls to 0 at the radius by a smoothstep.
    mode : {"add", "set", "multiply"}
    edge : {"repeat", "mirror", "clamp"}
        `weather.edge` of the map: a stroke beyond the edge wraps around, is mirrored, or is
        clipped.

    Returns
    -------
    map : array of float32, shape (H, W, 3)
        Values are clamped to 0 to 1.

    Raises
    ------
    ParameterError
        For a value that is not allowed.

    Examples
    --------
    >>> weather = renderer.weather_map(params)
    >>> weather = nubis.paint(weather, (2000, 5000), 1500, extent=params.weather.extent)
    >>> params = nubis.sky(map=weather)
    """
    texels = _map(map)
    path = _path(at)
    width = _number("extent", extent, 100.0, 1e7, "m")
    reach = _number("radius", radius, 1e-3, width, "m")
    hard = _number("hardness", hardness, 0.0, 1.0)
    _one_of("edge", edge, Edge)
    mask = _stroke(texels.shape[:2], path, reach, width, hard, edge)
    return paint_mask(texels, mask, channel=channel, amount=amount, mode=mode)


def paint_mask(
    map: npt.ArrayLike,
    mask: npt.ArrayLike,
    *,
    channel: Channel = "coverage",
    amount: float = 1.0,
    mode: Mode = "add",
) -> Map:
    """Return a copy of a weather map, painted through a mask.

    Parameters
    ----------
    map : array-like, shape (H, W, 3)
        Weather map, as for `paint`.
    mask : array-like, shape (H, W)
        Strength of the brush at each texel, 0 to 1.
    channel, amount, mode
        As for `paint`.

    Returns
    -------
    map : array of float32, shape (H, W, 3)
        Values are clamped to 0 to 1.

    Raises
    ------
    ParameterError
        For a value that is not allowed.

    Examples
    --------
    >>> half = np.full(weather.shape[:2], 0.5)
    >>> weather = nubis.paint_mask(weather, half, mode="multiply", amount=0.0)
    """
    texels = _map(map)
    index = get_args(Channel).index(_one_of("channel", channel, Channel))
    low, high = {"add": (-1.0, 1.0), "set": (0.0, 1.0), "multiply": (0.0, 1e6)}[
        _one_of("mode", mode, Mode)
    ]
    strength = _number("amount", amount, low, high)
    height, width, _ = texels.shape
    share = _shares("mask", mask, (height, width))
    old = texels[..., index].astype(np.float64)
    if mode == "add":
        new = old + strength * share
    elif mode == "set":
        new = old + (strength - old) * share
    else:
        new = old * (1 + (strength - 1) * share)
    texels[..., index] = new.clip(0, 1)
    return texels


def _stroke(
    size: tuple[int, ...],
    path: npt.NDArray[np.float64],
    radius: float,
    extent: float,
    hardness: float,
    edge: str,
) -> npt.NDArray[np.float64]:
    """Strength of the brush at the centre of each texel, shape (H, W)."""
    height, width = size
    x = ((np.arange(width) + 0.5) / width - 0.5) * extent
    y = (0.5 - (np.arange(height) + 0.5) / height) * extent
    squares = np.full((height, width), np.inf)
    corners = path if len(path) > 1 else np.concatenate([path, path])
    for start, end in _pieces(corners, extent):
        low, high = np.minimum(start, end) - radius, np.maximum(start, end) + radius
        # A texel has one image in each tile that the stroke reaches, mirrored in every other tile.
        for px in _images(x, low[0], high[0], extent, edge):
            columns = np.flatnonzero((px >= low[0]) & (px <= high[0]))
            for py in _images(y, low[1], high[1], extent, edge):
                rows = np.flatnonzero((py >= low[1]) & (py <= high[1]))
                if columns.size and rows.size:
                    window = np.ix_(rows, columns)
                    found = _squared_distance(px[columns], py[rows][:, None], start, end)
                    squares[window] = np.minimum(squares[window], found)
    beyond = (np.sqrt(squares) / radius - hardness) / max(1 - hardness, 1e-9)
    fall = 1 - beyond.clip(0, 1)
    smooth: npt.NDArray[np.float64] = fall * fall * (3 - 2 * fall)
    return smooth


def _images(
    places: npt.NDArray[np.float64], low: float, high: float, extent: float, edge: str
) -> list[npt.NDArray[np.float64]]:
    """Texel centres of an axis in each tile that the brush reaches."""
    if edge == "clamp":
        return [places]
    first, last = (int(np.floor(v / extent + 0.5)) for v in (low, high))
    mirrored = [-1 if edge == "mirror" and k % 2 else 1 for k in range(first, last + 1)]
    return [k * extent + s * places for k, s in zip(range(first, last + 1), mirrored, strict=True)]


def _pieces(
    corners: npt.NDArray[np.float64], longest: float
) -> Iterator[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """Segments of a path, split to `longest`, which bounds the tiles that each may reach."""
    for start, end in itertools.pairwise(corners):
        count = max(int(np.ceil(np.hypot(*(end - start)) / longest)), 1)
        yield from itertools.pairwise(np.linspace(start, end, count + 1))


def _squared_distance(
    x: npt.NDArray[np.float64],
    y: npt.NDArray[np.float64],
    start: npt.NDArray[np.float64],
    end: npt.NDArray[np.float64],
) -> Any:
    """Squared distances from points to a line segment."""
    (dx, dy), (rx, ry) = end - start, (x - start[0], y - start[1])
    length = dx * dx + dy * dy
    along = ((rx * dx + ry * dy) / length).clip(0, 1) if length > 0 else 0.0
    return (rx - along * dx) ** 2 + (ry - along * dy) ** 2


def _map(value: npt.ArrayLike) -> Map:
    """A validated copy of a weather map."""
    return _shares("map", value, (None, None, 3)).astype(np.float32)


def _path(value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    allowed = "a point (x, y) or points of shape (N, 2), world metres within 1e7 of the origin"
    points = numbers("at", value, allowed, shapes=[(2,), (None, 2)])
    beyond = np.abs(points) > 1e7
    if beyond.any():
        raise first_bad("at", points, beyond, allowed)
    return np.atleast_2d(points)


def _shares(name: str, value: Any, shape: Shape) -> npt.NDArray[np.float64]:
    shown = str(shape).replace("None, None", "H, W")
    allowed = f"an array of numbers of shape {shown}, values from 0 to 1"
    values = numbers(name, value, allowed, shapes=[shape], dims=("y", "x"))
    bad = (values < 0) | (values > 1)
    if bad.any():
        raise first_bad(name, values, bad, allowed)
    return values


def _number(name: str, value: Any, low: float, high: float, unit: str = "") -> float:
    number = _nubis.number(name, value)
    if not low <= number <= high:
        allowed = f"a number from {low:g} to {high:g} {unit}".rstrip()
        raise ParameterError(f"{name} = {value!r} is not allowed: it must be {allowed}")
    return number


def _one_of(name: str, value: Any, words: Any) -> str:
    known = get_args(words)
    if not isinstance(value, str) or value not in known:
        raise ParameterError(f"{name} = {value!r} is not allowed: it must be one of {known}")
    return value
