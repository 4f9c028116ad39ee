"""Where the sun is seen: shadow maps and the sun in a camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._nubis import Camera
from nubis.params import Params

Vectors = npt.NDArray[np.float64]

# The sun's angular radius, 0.2666 degrees (IAU: 695 700 km at 1 au).
SUN_RADIUS = 0.004654
# Points of the disc, each moved by a part of a pixel's width: a sharp edge across the disc is right
# to 0.02.
DISC_POINTS = 256
# How much of the light into a cloud of optical depth 1 turns back: 3/4 (1 - g) by two streams
# without absorption, with g = 0.85 of droplets (Hansen 1971).
TURNED_BACK = 0.75 * (1 - 0.85)


class ShadowMap(NamedTuple):
    """Direct sun on a level square: see `Renderer.shadow_map`.

    Attributes
    ----------
    transmittance : array of float32, shape (size, size)
        Through all clouds; row 0 is the north, column 0 the west.
    world_from_map : array of float64, shape (4, 4)
        Takes (column, row, height, 1) to world metres, with the centres of texels at
        half-integers. The height is that over the square, along the rays of the sun: the inverse
        takes a point to where its ray meets the square, so a point under the clouds has the light
        of its column and row. With the sun at or below the horizon, heights are straight up.
    """

    transmittance: npt.NDArray[np.float32]
    world_from_map: Vectors


class SunVisibility(NamedTuple):
    """How much of the sun is seen: see `Renderer.sun_visibility`.

    Attributes
    ----------
    direct : float
        Share of the sun's disc that is seen, 0 to 1: the mean of exp(-optical depth).
    ambient : float
        Share of the sunlight that arrives scattered by clouds, 0 to 1: the mean of what two streams
        let through, 1 / (1 + 0.1125 optical depth), less the direct share. 0 under a clear sky,
        0.5 under an optical depth of 9, and less again under a thicker cloud.
    """

    direct: float
    ambient: float


def sun_direction(params: Params) -> Vectors:
    """Unit vector toward the sun."""
    elevation, azimuth = math.radians(params.sun.elevation), math.radians(params.sun.azimuth)
    level = math.cos(elevation)
    return np.array(
        [math.sin(azimuth) * level, math.cos(azimuth) * level, math.sin(elevation)],
        dtype=np.float64,
    )


def world_from_map(
    params: Params, center: tuple[float, float], altitude: float, extent: float, size: int
) -> Vectors:
    """The matrix of a shadow map."""
    texel = extent / size
    matrix = np.eye(4)
    matrix[:2, :2] = [[texel, 0], [0, -texel]]
    matrix[:3, 3] = center[0] - extent / 2, center[1] + extent / 2, altitude
    sun = sun_direction(params)
    if sun[2] > 1e-6:
        matrix[:3, 2] = sun / sun[2]
    return matrix


def disc(params: Params, pixel: float) -> Vectors:
    """Directions spread evenly over the sun's disc, each moved within a pixel of that angle."""
    sun = sun_direction(params)
    side = np.cross(sun, [0, 0, 1] if abs(sun[2]) < 0.9 else [1, 0, 0])
    side /= np.linalg.norm(side)
    over = np.cross(side, sun)
    i = np.arange(DISC_POINTS) + 0.5
    # Vogel's spiral, and for the pixel a low-discrepancy sequence (R2).
    angle, radius = i * math.pi * (3 - math.sqrt(5)), SUN_RADIUS * np.sqrt(i / DISC_POINTS)
    within = pixel * (np.outer(i, [0.7548776662, 0.5698402910]) % 1 - 0.5)
    x = radius * np.cos(angle) + within[:, 0]
    y = radius * np.sin(angle) + within[:, 1]
    directions = sun + x[:, None] * side + y[:, None] * over
    unit: Vectors = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def pixel_angle(camera: Camera, size: tuple[int, int]) -> float:
    """Width of a pixel in the middle of the picture, radians."""
    width, height = size
    if camera.kind == "equirect":
        return 2 * math.pi / width
    if camera.kind == "fisheye":
        return math.radians(camera.fov) / min(width, height)
    return 2 * math.tan(math.radians(camera.fov) / 2) / height


def pixels(
    camera: Camera, size: tuple[int, int], directions: Vectors
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Rows and columns that directions fall on, and whether they are in the picture."""
    width, height = size
    axes = np.array([camera.right, camera.up, camera.forward])
    x, y, z = axes @ directions.T
    seen = np.ones(len(directions), dtype=bool)
    if camera.kind == "equirect":
        across = np.arctan2(x, z) / math.pi
        down = np.arcsin(y.clip(-1, 1)) / (math.pi / 2)
    elif camera.kind == "fisheye":
        sine = np.hypot(x, y)
        r = np.arctan2(sine, z) / math.radians(camera.fov / 2)
        scale = r / np.maximum(sine, 1e-12) * min(size)
        across, down, seen = x * scale / width, y * scale / height, r <= 1
    else:
        seen = z > 1e-6
        tan = math.tan(math.radians(camera.fov) / 2) * np.where(seen, z, 1)
        across, down = x / tan * height / width, y / tan
    columns = np.floor((0.5 + 0.5 * across) * width).astype(np.intp)
    rows = np.floor((0.5 - 0.5 * down) * height).astype(np.intp)
    if camera.kind == "equirect":
        columns, rows = columns % width, rows.clip(0, height - 1)
    seen &= (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    return rows, columns, seen


def seen_sun(
    core: _nubis.Renderer,
    camera: Camera,
    params: Params,
    time: float,
    scene_depth: npt.NDArray[np.float32] | None,
    size: tuple[int, int],
) -> SunVisibility:
    """The sun through the clouds, the mean over its disc."""
    # The ground hides what is below the horizon of the disc alone, however wide pixels are.
    points, directions = disc(params, 0.0), disc(params, pixel_angle(camera, size))
    depths = core.depth_along(camera, np.concatenate([points, directions]), params, time)
    bare, moved = depths.astype(np.float64).reshape(2, -1)
    up, depth = bare >= 0, np.where(moved >= 0, moved, bare)
    direct = np.where(up, np.exp(-depth.clip(0)), 0)
    scattered = np.where(up, 1 / (1 + TURNED_BACK * depth.clip(0)), 0) - direct
    if scene_depth is not None:
        rows, columns, seen = pixels(camera, size, directions)
        there = scene_depth[np.where(seen, rows, 0), np.where(seen, columns, 0)]
        direct[seen & np.isfinite(there)] = 0
    return SunVisibility(float(direct.mean()), float(scattered.mean().clip(0)))
