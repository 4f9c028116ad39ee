"""Linear pictures to screens and files, and weather maps from files."""

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

#: What a picture's file can end in.
ENDINGS = (".png", ".exr", ".hdr", ".npy")


def to_srgb8(
    frame: npt.ArrayLike,
    exposure: float = 0.0,
    tonemap: Literal["agx", "aces", "none"] = "agx",
    *,
    dither: bool = True,
) -> npt.NDArray[np.uint8]:
    """Return 8-bit sRGB pixels: the only place where anything is clipped or gamma-encoded.

    Parameters
    ----------
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Scene-linear radiance with Rec. 709 primaries. Where there is alpha, the radiance is
        premultiplied by it, as of all pictures here.
    exposure : float
        Stops: 1 doubles the light.
    tonemap : {"agx", "aces", "none"}
        AgX (Sobotka, in Wrensch's polynomial form), ACES (Hill's fit), or plain clipping.
    dither : bool
        Adds blue noise of half a step to each side before rounding, the same in each picture, so
        that slow gradients have no bands. Whole steps, such as black and white, stay as they are;
        with False every number goes to the nearest step.

    Returns
    -------
    array of uint8, shape (H, W, 3) or (H, W, 4)
        Alpha is linear, rounded, and the colours are no longer multiplied by it (as in a PNG, in
        Pillow and in matplotlib): they are divided before the tone map, which is for the radiance
        of what is there. Where alpha is 0 they are those of no light.

    Raises
    ------
    ParameterError
        For an array that is no picture or has NaN in it, and other arguments that are not allowed.
        Infinite radiance is white.

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
    return _nubis.auto_exposure(_pixels(frame, nonfinite="nan"), wanted, first, last)


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
    dither: bool = True,
) -> None:
    """Write a picture; the ending says how.

    ``.png`` is made by `to_srgb8` (alpha is kept where any pixel is not opaque); ``.exr``
    (float32), ``.hdr`` (Radiance, 8 bits and a common exponent, no alpha, nothing below 0) and
    ``.npy`` stay linear. The file is written under another name beside its place and renamed when
    it is whole: who reads finds the old picture or the new one, whatever happens meanwhile.

    Parameters
    ----------
    path : path
        Ends in .png, .exr, .hdr or .npy.
    frame : array-like, shape (H, W, 3) or (H, W, 4)
        Linear radiance, premultiplied by alpha where there is one; finite.
    exposure : float or "auto"
        Stops, or `auto_exposure` of the frame (png).
    tonemap, dither
        As for `to_srgb8` (png).

    Raises
    ------
    ParameterError
        For another ending, or an array that is no picture of finite numbers.
    FileError
        When the file cannot be written.

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
    """Raise what `save` would for a path: asked before pictures are made that would be lost."""
    _nubis.check_target(_check_ending(path))


def npy(array: npt.NDArray[Any]) -> bytes:
    """The bytes of a file as `numpy.save` writes it."""
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
