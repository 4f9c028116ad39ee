"""Tone mapping, exposure, image files, and weather maps from files."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._arrays import numbers
from nubis._errors import FileError, ParameterError

#: Supported file extensions.
ENDINGS = (".png", ".exr", ".hdr", ".npy")


def to_srgb8(
    frame: npt.ArrayLike,
    exposure: float = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
    *,
    dither: bool = True,
) -> npt.NDArray[np.uint8]:
    """Return 8-bit sRGB pixels of a linear frame: exposure, tone map, sRGB encoding, dithering.

    This is the only function that clips or gamma-encodes.

    Parameters
    ----------
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries, premultiplied by alpha where there is one.
    exposure : float
        Exposure in stops: 1 doubles the radiance.
    tonemap : {"agx", "aces", "none"}
        AgX (Sobotka 2022, polynomial of Wrensch 2023), ACES 1.0 (fit of Hill 2016), or plain
        clipping.
    dither : bool
        Adds blue noise of up to half a quantization step in both directions before rounding,
        against banding. The noise is the same in every picture. Exact 8-bit values, such as black
        and white, are not changed. False rounds to the nearest value.

    Returns
    -------
    array of uint8, shape (H, W, 3) or (H, W, 4)
        sRGB-encoded colour and linear alpha. Colour is not premultiplied (as in PNG, Pillow and
        matplotlib): it is divided by alpha before the tone map. Where alpha is 0 it is that of
        zero radiance. Infinite radiance is white.

    Raises
    ------
    ParameterError
        For another shape, NaN, an unknown tone map, or another value that is not allowed.

    Examples
    --------
    >>> pixels = nubis.to_srgb8(renderer.render(camera, params), exposure=0.5)
    """
    if not isinstance(tonemap, str):
        raise ParameterError(f"tonemap = {tonemap!r} is not allowed: it must be a name")
    _check_switch("dither", dither)
    stops = _nubis.number("exposure", exposure)
    return _nubis.to_srgb8(_pixels(frame), stops, tonemap, dither)


def auto_exposure(
    frame: npt.ArrayLike,
    *,
    key: float = 0.18,
    low: float = 5.0,
    high: float = 95.0,
) -> float:
    """Return the exposure in stops that maps the log-average luminance of a frame to `key`.

    The log-average (Reinhard et al. 2002) is taken over the pixels of non-zero luminance between
    the percentiles `low` and `high`, so that the sun's disc and its glare do not change it.

    Parameters
    ----------
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries.
    key : float
        Log-average luminance after exposure: 0.18 is middle grey; a lower key is a night.
    low, high : float
        Percentiles of the pixels of non-zero luminance; pixels outside are ignored.

    Returns
    -------
    float
        Exposure in stops, for `to_srgb8` and `save`; 0 for a frame without light.

    Raises
    ------
    ParameterError
        For another shape, or percentiles that leave no pixels.

    Examples
    --------
    >>> stops = nubis.auto_exposure(renderer.render(camera, params))
    """
    wanted = _nubis.number("key", key)
    first, last = _nubis.number("low", low), _nubis.number("high", high)
    return _nubis.auto_exposure(_pixels(frame, nonfinite="nan"), wanted, first, last)


def heat(counts: npt.NDArray[np.uint32], white: int = 1000) -> npt.NDArray[np.uint8]:
    """Return a heat map as 8-bit RGB: black at a count of 0, red, yellow, white from `white` on."""
    ramp = 3 * counts[..., None] / white - np.arange(3)
    pixels: npt.NDArray[np.uint8] = np.rint(255 * ramp.clip(0, 1)).astype(np.uint8)
    return pixels


def save(
    path: str | os.PathLike[str],
    frame: npt.ArrayLike,
    *,
    exposure: float | Literal["auto"] = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
    dither: bool = True,
) -> None:
    """Write a frame to a file, in the format of the file extension.

    ``.png`` is tone-mapped by `to_srgb8`; alpha is written if any pixel is not opaque. ``.exr``
    (float32), ``.hdr`` (Radiance RGBE, without alpha and negative values) and ``.npy`` are linear.
    Writing is atomic: the file is written under a temporary name and renamed when complete.

    Parameters
    ----------
    path : path
        Path that ends in .png, .exr, .hdr or .npy.
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries, premultiplied by alpha where there is one;
        finite.
    exposure : float or "auto"
        Exposure in stops, or "auto" for `auto_exposure` of the frame (png).
    tonemap, dither
        As for `to_srgb8` (png).

    Raises
    ------
    ParameterError
        For another extension, another shape, or values that are not finite.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> nubis.save("sky.png", frame, exposure="auto")
    """
    target = _check_ending(path)
    pixels = _pixels(frame, nonfinite="")
    if isinstance(exposure, str) and exposure != "auto":
        raise ParameterError(
            f"exposure = {exposure!r} is not allowed: it must be a number of stops or 'auto'"
        )
    _nubis.check_target(target)
    kind = target.suffix.lower()
    if kind == ".png":
        stops = auto_exposure(pixels) if isinstance(exposure, str) else exposure
        image = to_srgb8(pixels, stops, tonemap, dither=dither)
        if image.shape[2] == 4 and np.all(image[..., 3] == 255):
            image = np.ascontiguousarray(image[..., :3])
        _nubis.write_png(target, image)
    elif kind == ".exr":
        _nubis.write_exr(target, pixels)
    elif kind == ".hdr":
        _nubis.write_hdr(target, pixels)
    else:
        _nubis.write_bytes(target, npy(pixels))


def check_target(path: str | os.PathLike[str]) -> None:
    """Raise the errors of `save` for a path, ahead of a render that could not be written."""
    _nubis.check_target(_check_ending(path))


def npy(array: npt.NDArray[Any]) -> bytes:
    """Contents of a ``.npy`` file of an array."""
    out = io.BytesIO()
    np.save(out, array, allow_pickle=False)
    return out.getvalue()


def _check_ending(path: str | os.PathLike[str]) -> Path:
    try:
        target = Path(path)
    except TypeError:
        raise ParameterError(f"path = {path!r} is not allowed: it must be a path") from None
    if target.suffix.lower() not in ENDINGS:
        raise _refused(target, f"a path that ends in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")
    return target


def _check_switch(name: str, value: Any) -> None:
    if not isinstance(value, bool | np.bool_):
        raise ParameterError(f"{name} = {value!r} is not allowed: it must be True or False")


def load_map(path: str | os.PathLike[str]) -> npt.NDArray[np.float32]:
    """Read a weather map from an image file, for `weather.map`.

    Parameters
    ----------
    path : path
        A ``.png`` (8 or 16 bits), ``.exr``, ``.hdr`` or ``.npy`` file. Red is coverage, green type,
        blue precipitation. A single channel is coverage, with type 0.5 and precipitation 0. Alpha
        is ignored. Integers are divided by their maximum, 255 or 65535, without decoding of gamma;
        floats are used unchanged.

    Returns
    -------
    map : array of float32, shape (H, W, 3)
        Coverage, type and precipitation, 0 to 1; row 0, the top of the image, is in the north.

    Raises
    ------
    ParameterError
        For another extension, a file of another format, more than 8192 rows or columns, or values
        outside 0 to 1.
    FileError
        If the file cannot be read.

    Examples
    --------
    >>> weather = nubis.Weather(map=nubis.load_map("weather.png"))
    """
    source = _check_ending(path)
    npy_file = source.suffix.lower() == ".npy"
    pixels = _load_array(source) if npy_file else _nubis.read_pixels(source)
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
    """Array of a ``.npy`` file as float32, shape (H, W, 1) or (H, W, 3)."""
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


def _pixels(frame: Any, nonfinite: str = "inf") -> npt.NDArray[np.float32]:
    return numbers(
        "frame",
        frame,
        "an array of numbers of shape (H, W, 3) or (H, W, 4)",
        shapes=[(None, None, 3), (None, None, 4)],
        dims=("y", "x"),
        dtype=np.float32,
        nonfinite=nonfinite,
    )
