"""The gate for arrays: what comes in as an array keeps its meaning, or is refused.

`numpy.asarray` drops masks, axis names, units and imaginary parts without a word. The binding
(crates/clouds_py/src/convert.rs) asks here too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from nubis._errors import ParameterError

#: One entry an axis: its length, or None for any.
Shape = tuple[int | None, ...]


class UnfitError(ValueError):
    """A value that is no array of numbers. The message is the value in the words of an error."""


def opened(value: Any, dims: Sequence[str] = (), kinds: str = "fiu") -> npt.NDArray[Any]:
    """Return a value as an array of numbers, in its own dtype.

    Parameters
    ----------
    value : array-like
        NumPy arrays, nested sequences, and what has ``__array__``.
    dims : sequence of str
        Names of the first axes. A DataArray is transposed to them, its other axes last.
    kinds : str
        The kinds of dtype (`numpy.dtype.kind`) that are allowed.

    Raises
    ------
    UnfitError
        For masked values, axes without a known name, sparse and ragged arrays, numbers with a unit,
        and other dtypes.
    """
    hidden = sum(_masked(value))
    if hidden:
        raise UnfitError(
            f"masked array with {hidden} masked values (array.filled(...) replaces them)"
        )
    if type(value).__name__ == "Quantity":
        raise UnfitError("quantity with a unit (give its numbers alone, in the unit named here)")
    if hasattr(value, "toarray") or hasattr(value, "todense"):
        raise UnfitError(f"sparse {type(value).__name__} (its todense() is an array)")
    if isinstance(getattr(value, "dims", None), tuple) and hasattr(value, "transpose"):
        value = _by_dims(value, tuple(dims))
    try:
        array = np.asarray(value)
    except Exception as error:  # whatever a class of its own raises
        raise UnfitError(f"{type(value).__name__} that is no array ({error})") from None
    if array.dtype.kind not in kinds:
        raise UnfitError(f"array of shape {array.shape} and dtype {array.dtype}")
    return array


def numbers(
    name: str,
    value: Any,
    allowed: str,
    *,
    shapes: Sequence[Shape],
    dims: Sequence[str] = (),
    dtype: npt.DTypeLike = np.float64,
    nonfinite: str = "",
) -> npt.NDArray[Any]:
    """Return the array argument `name` in C order, not copied where it is so already.

    Parameters
    ----------
    name, allowed : str
        For the error: ``<name> = <what was given> is not allowed: it must be <allowed>``.
    shapes : sequence of shapes
        Those allowed, None for any length from 1 on.
    dims : sequence of str
        As for `opened`.
    dtype : dtype
        Of the result.
    nonfinite : {"", "inf", "nan"}
        None, infinities, or NaN too.

    Raises
    ------
    ParameterError
    """
    try:
        array = opened(value, dims)
    except UnfitError as error:
        raise _refused(name, str(error), allowed) from None
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise _refused(name, f"array of shape {array.shape}", allowed)
    with np.errstate(over="ignore"):
        result = np.ascontiguousarray(array, dtype=dtype)
    if nonfinite != "nan":
        bad = np.isnan(result) if nonfinite == "inf" else ~np.isfinite(result)
        if bad.any():
            raise first_bad(name, array, bad, allowed)
    return result


def first_bad(
    name: str, array: npt.NDArray[Any], bad: npt.NDArray[np.bool_], allowed: str
) -> ParameterError:
    """The error for values that are not allowed: the first, where it is, and how many there are."""
    at = tuple(int(i) for i in np.argwhere(bad)[0])
    place = f"[{', '.join(map(str, at))}]" if at else ""
    count = int(bad.sum())
    more = f" (one of {count} such values)" if count > 1 else ""
    return _refused(f"{name}{place}", f"{array[at]}{more}", allowed)


def _refused(name: str, given: str, allowed: str) -> ParameterError:
    return ParameterError(f"{name} = {given} is not allowed: it must be {allowed}")


def _fits(shape: tuple[int, ...], wanted: Shape) -> bool:
    return len(shape) == len(wanted) and all(
        n == m if m is not None else n > 0 for n, m in zip(shape, wanted, strict=True)
    )


def _masked(value: Any) -> Iterator[int]:
    """How many values are masked, in an array or in those of a nested list."""
    if isinstance(value, np.ma.MaskedArray):
        yield int(np.count_nonzero(np.ma.getmaskarray(value)))
    elif isinstance(value, list | tuple):
        for part in value:
            if not isinstance(part, float | int):
                yield from _masked(part)


def _by_dims(value: Any, dims: tuple[str, ...]) -> Any:
    """The values of a DataArray with the axes `dims` first."""
    given = value.dims
    if len(given) < 2:
        return value.values
    rest = [name for name in given if name not in dims]
    if not dims or not set(dims) <= set(given) or len(rest) > 1:
        wanted = f"name them {', '.join(dims)}, or " if dims else ""
        raise UnfitError(
            f"DataArray with dims {given} ({wanted}give its .values in the right order)"
        )
    for name in dims:
        _check_ascending(name, value, upward=len(dims) == 3)
    with contextlib.suppress(AttributeError):
        return value.transpose(*dims, *rest).values
    return value


def _check_ascending(name: str, value: Any, *, upward: bool) -> None:
    """Refuses an axis that runs the other way: x to the west, or of a grid any toward less."""
    coords = getattr(value, "coords", {})
    if name not in coords or not (upward or name == "x"):
        return
    along = np.asarray(coords[name])
    if along.dtype.kind in "fiu" and along.size > 1 and not (np.diff(along) > 0).all():
        raise UnfitError(
            f"DataArray whose {name} does not ascend (sortby({name!r}) puts it in order)"
        )
