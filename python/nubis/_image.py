"""Linear pictures to screens and files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._errors import FileError, ParameterError


def to_srgb8(
    frame: npt.ArrayLike,
    exposure: float = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
) -> npt.NDArray[np.uint8]:
    """Return 8-bit sRGB pixels: the only place where anything is clipped or gamma-encoded.

    Parameters
    ----------
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries. Alpha is passed on, linear.
    exposure : float
        Stops: 1 doubles the light.
    tonemap : {"agx", "aces", "none"}
        AgX (Sobotka, in Wrensch's polynomial form), ACES (Hill's fit), or plain clipping.
    """
    if not isinstance(tonemap, str):
        raise ParameterError(f"tonemap = {tonemap!r} is not allowed: it must be a name")
    stops = _nubis.number("exposure", exposure)
    return _nubis.to_srgb8(_pixels(frame), stops, tonemap)


def heat(counts: npt.NDArray[np.uint32], white: int = 1000) -> npt.NDArray[np.uint8]:
    """Return 8-bit pixels: black where a count is 0, then red, yellow, white from `white` on."""
    ramp = 3 * counts[..., None] / white - np.arange(3)
    pixels: npt.NDArray[np.uint8] = np.rint(255 * ramp.clip(0, 1)).astype(np.uint8)
    return pixels


def save(
    path: str | os.PathLike[str],
    frame: npt.ArrayLike,
    *,
    exposure: float = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
) -> None:
    """Write a picture; the ending says how.

    ``.png`` is tone-mapped with `to_srgb8` (alpha is kept where any pixel is not opaque);
    ``.exr`` (float32), ``.hdr`` (Radiance, no alpha) and ``.npy`` stay linear.

    Raises
    ------
    ParameterError
        For another ending, or an array that is no picture.
    FileError
        When the file cannot be written.
    """
    target = Path(path)
    kind = target.suffix.lower()
    pixels = _pixels(frame)
    if kind == ".png":
        image = to_srgb8(pixels, exposure, tonemap)
        if image.shape[2] == 4 and np.all(image[..., 3] == 255):
            image = np.ascontiguousarray(image[..., :3])
        _nubis.write_png(target, _straight(image))
    elif kind == ".exr":
        _nubis.write_exr(target, pixels)
    elif kind == ".hdr":
        _nubis.write_hdr(target, pixels)
    elif kind == ".npy":
        try:
            np.save(target, pixels)
        except OSError as error:
            raise FileError(f"{target}: {error}") from error
    else:
        raise ParameterError(
            f"path = {os.fspath(path)!r} is not allowed: it must end in .png, .exr, .hdr or .npy"
        )


def _straight(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """PNG holds colours that are not multiplied by alpha."""
    if image.shape[2] == 3:
        return image
    alpha = image[..., 3:].astype(np.float32) / 255
    colour = np.divide(image[..., :3], alpha, out=np.zeros(image[..., :3].shape), where=alpha > 0)
    return np.concatenate([np.clip(colour + 0.5, 0, 255), image[..., 3:]], axis=2).astype(np.uint8)


def _pixels(frame: Any) -> npt.NDArray[np.float32]:
    try:
        pixels = np.ascontiguousarray(frame, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise ParameterError(
            f"frame is not allowed: it must be an array of numbers ({error})"
        ) from None
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or 0 in pixels.shape:
        raise ParameterError(
            f"frame of shape {pixels.shape} is not allowed: it must be (H, W, 3) or (H, W, 4)"
        )
    return pixels
