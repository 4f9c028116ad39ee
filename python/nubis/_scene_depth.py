"""Validation of user-supplied scenes: `scene_depth` and `scene_color`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from nubis._arrays import first_bad, numbers
from nubis._errors import ParameterError
from nubis._nubis import Camera

Array = npt.NDArray[np.float32]

# Largest distance of a scene in m; larger is sky (crates/clouds_core/src/scene_depth.rs).
FARTHEST = np.float32(1e10)


class Scene(NamedTuple):
    """A validated scene: distance in m along each ray, radiance and pixel coverage."""

    depth: Array
    color: Array | None  # (H, W, 3), not premultiplied by the coverage
    cover: Array | None  # (H, W), None if it is 1 everywhere


def checked(depth: Any, color: Any, size: tuple[int, int]) -> Scene | None:
    """The validated scene for a picture of `size` (width, height), or None without a scene."""
    if depth is None:
        if color is not None:
            raise ParameterError("scene_color is not allowed without scene_depth")
        return None
    width, height = size
    depth = _numbers("scene_depth", depth, [(height, width)], finite=False)
    if (beyond := np.isfinite(depth) & (depth > FARTHEST)).any():
        depth = np.where(beyond, np.float32(np.inf), depth)
    if color is None:
        return None if np.isinf(depth).all() else Scene(depth, None, None)
    color = _numbers("scene_color", color, [(height, width, 3), (height, width, 4)], finite=True)
    if np.isinf(depth).all():
        return None
    if color.shape[2] == 3:
        return Scene(depth, color, None)
    cover = color[..., 3]
    if (cover > 1).any():
        raise first_bad("scene_color[..., 3]", cover, cover > 1, "from 0 to 1")
    # A coverage of 0 means no surface. The radiance is divided by the coverage.
    depth = np.where(cover > 0, depth, np.float32(np.inf))
    whole = np.ascontiguousarray(color[..., :3] / np.where(cover > 0, cover, 1)[..., None])
    there = np.isfinite(depth)
    if not there.any():
        return None
    return Scene(depth, whole, None if (cover[there] == 1).all() else cover)


def _numbers(name: str, value: Any, shapes: list[tuple[int | None, ...]], *, finite: bool) -> Array:
    shown = " or ".join(str(shape).replace("None", "N") for shape in shapes)
    rule = "finite and not negative" if finite else "0 m to infinity"
    allowed = f"an array of numbers of shape {shown}, {rule}"
    array = numbers(
        name,
        value,
        allowed,
        shapes=shapes,
        dims=("y", "x"),
        dtype=np.float32,
        nonfinite="" if finite else "inf",
    )
    bad = array < 0
    if bad.any():
        raise first_bad(name, array, bad, rule)
    return array


def distance_from_z(camera: Camera, z: npt.ArrayLike) -> Array:
    """Return the distance along the ray of each pixel, from the z of a rasterizer.

    A linearised depth buffer holds z, the distance along the camera axis. `scene_depth` is the
    distance along the ray, which is larger away from the centre of the picture.

    Parameters
    ----------
    camera : Camera
        Pinhole camera of the depth buffer (`Camera.look_at`, `Camera.from_matrix`).
    z : array-like, shape (height, width)
        Metres along the camera axis, inf for no surface.

    Returns
    -------
    distance : array of float32, shape (height, width)
        Metres along the ray, inf for no surface.

    Raises
    ------
    ParameterError
        For a camera that is no pinhole, another shape, NaN or negative values.

    Examples
    --------
    >>> depth = nubis.distance_from_z(camera, z)
    >>> frame = renderer.render(camera, params, scene_depth=depth)
    """
    if not isinstance(camera, Camera) or camera.kind != "perspective":
        raise ParameterError(f"camera = {camera!r} is not allowed: it must be a pinhole camera")
    array = _numbers("z", z, [(None, None)], finite=False)
    height, width = array.shape
    tan = math.tan(math.radians(camera.fov) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * tan * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tan
    distance: Array = (array * np.sqrt(1 + x**2 + y[:, None] ** 2)).astype(np.float32)
    return distance
