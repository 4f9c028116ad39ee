"""Shadow maps, and the visibility of the sun from a camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._nubis import Camera
from nubis.params import Params

Vectors = npt.NDArray[np.float64]

# Angular radius of the sun in radians: 0.2666 degrees (IAU: 695 700 km at 1 au).
SUN_RADIUS = 0.004654
# Number of sample points on the disc, each jittered within the width of a pixel: the visible part
# of a disc behind a sharp edge is exact to 0.02.
DISC_POINTS = 256
# Two-stream reflection per unit of optical depth without absorption: 3/4 (1 - g), with g = 0.85 for
# droplets (Hansen 1971).
TURNED_BACK = 0.75 * (1 - 0.85)


class ShadowMap(NamedTuple):
    """Transmittance toward the sun on a horizontal square: see `Renderer.shadow_map`.

    Attributes
    ----------
    transmittance : array of float32, shape (size, size)
        Transmittance of all clouds; row 0 is in the north, column 0 in the west.
    world_from_map : array of float64, shape (4, 4)
        Matrix from (column, row, height, 1) to world metres. Texel centres are at half-integers.
        Height is in metres above the square, along the direction of the sun (vertical if the sun is
        at or below the horizon). The inverse projects a world point along its sun ray onto the
        square: a point under the clouds has the transmittance of its column and row.

    Examples
    --------
    >>> column, row, height, _ = np.linalg.inv(shadow.world_from_map) @ (1000, 2000, 1500, 1)
    """

    transmittance: npt.NDArray[np.float32]
    world_from_map: Vectors


class SunVisibility(NamedTuple):
    """Visibility of the sun: see `Renderer.sun_visibility`.

    Attributes
    ----------
    direct : float
        Direct transmittance, 0 to 1: the mean of exp(-optical depth) over the sun's disc.
    ambient : float
        Diffuse transmittance, 0 to 1: the mean of the two-stream transmittance, 1 / (1 + 0.1125 x
        optical depth), less `direct`. It is 0 under a clear sky, 0.5 at an optical depth of 9, and
        decreases under thicker clouds.
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
    """Matrix from (column, row, height, 1) of a shadow map to world metres."""
    texel = extent / size
    matrix = np.eye(4)
    matrix[:2, :2] = [[texel, 0], [0, -texel]]
    matrix[:3, 3] = center[0] - extent / 2, center[1] + extent / 2, altitude
    sun = sun_direction(params)
    if sun[2] > 1e-6:
        matrix[:3, 2] = sun / sun[2]
    return matrix


def disc(params: Params, pixel: float) -> Vectors:
    """Unit vectors evenly over the sun's disc, each jittered within an angle of `pixel`."""
    sun = sun_direction(params)
    side = np.cross(sun, [0, 0, 1] if abs(sun[2]) < 0.9 else [1, 0, 0])
    side /= np.linalg.norm(side)
    over = np.cross(side, sun)
    i = np.arange(DISC_POINTS) + 0.5
    # Vogel's spiral over the disc, the low-discrepancy sequence R2 within the pixel.
    angle, radius = i * math.pi * (3 - math.sqrt(5)), SUN_RADIUS * np.sqrt(i / DISC_POINTS)
    within = pixel * (np.outer(i, [0.7548776662, 0.5698402910]) % 1 - 0.5)
    x = radius * np.cos(angle) + within[:, 0]
    y = radius * np.sin(angle) + within[:, 1]
    directions = sun + x[:, None] * side + y[:, None] * over
    unit: Vectors = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def pixel_angle(camera: Camera, size: tuple[int, int]) -> float:
    """Angular width in radians of a pixel in the centre of the picture."""
    width, height = size
    if camera.kind == "equirect":
        return 2 * math.pi / width
    if camera.kind == "fisheye":
        return math.radians(camera.fov) / min(width, height)
    return 2 * math.tan(math.radians(camera.fov) / 2) / height


def pixels(
    camera: Camera, size: tuple[int, int], directions: Vectors
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Rows and columns of directions, and whether they are in the picture."""
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
    """Visibility of the sun, averaged over its disc."""
    # Unjittered points decide what the ground hides, independent of the width of a pixel.
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
