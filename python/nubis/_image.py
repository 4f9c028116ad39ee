"""Linear pictures to screens and files, and weather maps from files."""

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


def auto_exposure(
    frame: npt.ArrayLike,
    *,
    key: float = 0.18,
    low: float = 5.0,
    high: float = 95.0,
) -> float:
    """Return the exposure, in stops, at which a picture is neither too dark nor too bright.

    It brings the mean of the logarithm of the luminance to that of `key` (Reinhard et al. 2002).
    Pixels without light count nothing, and neither do the darkest and the brightest of the others:
    the sun's disc and its glare change nothing.

    Parameters
    ----------
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries.
    key : float
        What the mean becomes: 0.18 is middle grey, less a night.
    low, high : float
        Percent of the pixels with light below and from which on they are left out.

    Returns
    -------
    float
        Stops, for `to_srgb8` and `save`; 0 where there is no light.

    Raises
    ------
    ParameterError
        For an array that is no picture, and shares that leave nothing.
    """
    wanted = _nubis.number("key", key)
    first, last = _nubis.number("low", low), _nubis.number("high", high)
    return _nubis.auto_exposure(_pixels(frame), wanted, first, last)


def heat(counts: npt.NDArray[np.uint32], white: int = 1000) -> npt.NDArray[np.uint8]:
    """Return 8-bit pixels: black where a count is 0, then red, yellow, white from `white` on."""
    ramp = 3 * counts[..., None] / white - np.arange(3)
    pixels: npt.NDArray[np.uint8] = np.rint(255 * ramp.clip(0, 1)).astype(np.uint8)
    return pixels


def save(
    path: str | os.PathLike[str],
    frame: npt.ArrayLike,
    *,
    exposure: float | Literal["auto"] = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
) -> None:
    """Write a picture; the ending says how.

    ``.png`` is tone-mapped with `to_srgb8` (alpha is kept where any pixel is not opaque);
    ``.exr`` (float32), ``.hdr`` (Radiance, no alpha) and ``.npy`` stay linear. An exposure of
    ``"auto"`` is that of `auto_exposure`.

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
    if isinstance(exposure, str) and exposure != "auto":
        raise ParameterError(
            f"exposure = {exposure!r} is not allowed: it must be a number of stops or 'auto'"
        )
    if kind == ".png":
        stops = auto_exposure(pixels) if isinstance(exposure, str) else exposure
        image = to_srgb8(pixels, stops, tonemap)
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


def load_map(path: str | os.PathLike[str]) -> npt.NDArray[np.float32]:
    """Read a weather map from a picture, for `weather.map`.

    Parameters
    ----------
    path : path
        A ``.png`` (8 or 16 bits), ``.exr``, ``.hdr`` or ``.npy`` file. Red is the coverage, green
        the type, blue the precipitation; one channel is the coverage alone, with type 0.5 and no
        precipitation. Alpha is left out. Whole numbers are parts of their largest, 255 or 65535,
        and no gamma is undone; floats are taken as they are.

    Returns
    -------
    map : array of float32, shape (H, W, 3)
        0 to 1; row 0, the top of the picture, is the north.

    Raises
    ------
    ParameterError
        For another ending, a file that is none of these, or values that are not from 0 to 1.
    FileError
        When the file cannot be read.
    """
    source = Path(path)
    kind = source.suffix.lower()
    if kind == ".npy":
        pixels = _load_array(source)
    elif kind in (".png", ".exr", ".hdr"):
        pixels = _nubis.read_pixels(source)
    else:
        raise _refused(source, "a path that ends in .png, .exr, .hdr or .npy")
    bad = pixels[~((pixels >= 0) & (pixels <= 1))]
    if bad.size:
        raise _refused(source, f"a map with values from 0 to 1 (it has {bad[0]})")
    if not (0 < pixels.shape[0] <= 8192 and 0 < pixels.shape[1] <= 8192):
        raise _refused(source, f"a map of 1 to 8192 rows and columns (it has {pixels.shape[:2]})")
    if pixels.shape[2] == 1:
        rest = np.broadcast_to(np.array([0.5, 0.0], np.float32), (*pixels.shape[:2], 2))
        pixels = np.concatenate([pixels, rest], axis=2)
    return np.ascontiguousarray(pixels[..., :3], dtype=np.float32)


def _load_array(path: Path) -> npt.NDArray[np.float32]:
    """Shape (H, W, 1) or (H, W, 3)."""
    try:
        array = np.load(path, allow_pickle=False)
    except OSError as error:
        raise FileError(f"{path}: {error}") from error
    except (ValueError, EOFError) as error:
        raise _refused(path, f"a file that numpy.save has written ({error})") from error
    if not isinstance(array, np.ndarray):
        raise _refused(path, "a file that numpy.save has written (it is an archive)")
    if array.dtype in (np.uint8, np.uint16):
        array = array / np.float32(np.iinfo(array.dtype).max)
    elif array.dtype.kind != "f":
        raise _refused(path, f"an array of floats, uint8 or uint16 (it is of {array.dtype})")
    if array.ndim == 2:
        array = array[..., None]
    if array.ndim != 3 or array.shape[2] not in (1, 3, 4):
        raise _refused(
            path,
            f"an array of shape (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) (it is {array.shape})",
        )
    return np.asarray(array[..., :3], dtype=np.float32)


def _refused(path: Path, allowed: str) -> ParameterError:
    return ParameterError(f"path = {os.fspath(path)!r} is not allowed: it must be {allowed}")


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
