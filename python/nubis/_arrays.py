"""Validation of array arguments: an array that would lose meaning in the conversion is refused.

`numpy.asarray` silently drops masks, axis names, units and imaginary parts. The binding
(crates/clouds_py/src/convert.rs) converts arrays by this module too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from nubis._errors import ParameterError

#: Length of each axis; None allows any length.
Shape = tuple[int | None, ...]


class UnfitError(ValueError):
    """A value that is no array of numbers. The message describes the value, for an error text."""


def opened(value: Any, dims: Sequence[str] = (), kinds: str = "fiu") -> npt.NDArray[Any]:
    """Return a value as an array of numbers, in its own dtype.

    Parameters
    ----------
    value : array-like
        NumPy array, nested sequence, or object with ``__array__``.
    dims : sequence of str
        Names of the leading axes. A DataArray is transposed to this order, other axes last.
    kinds : str
        Allowed kinds of dtype (`numpy.dtype.kind`).

    Returns
    -------
    array
        A view of `value` where NumPy makes one.

    Raises
    ------
    UnfitError
        For masked values, unexpected axis names, sparse and ragged arrays, quantities with a unit,
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
    except Exception as error:  # a foreign class may raise anything
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
    """Return the array argument `name` in C order, without a copy where possible.

    Parameters
    ----------
    name, allowed : str
        Parts of the error message: ``<name> = <value> is not allowed: it must be <allowed>``.
    shapes : sequence of shapes
        Allowed shapes; None allows any length from 1.
    dims : sequence of str
        As for `opened`.
    dtype : dtype
        Dtype of the result.
    nonfinite : {"", "inf", "nan"}
        Allowed non-finite values: none, infinities, or infinities and NaN.

    Raises
    ------
    ParameterError
        For a value that is no array of numbers, another shape, or non-finite values.
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
    """The error for values that are not allowed: the first one, its index, and their number."""
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
    """Numbers of masked values, of an array or of the arrays in a nested list."""
    if isinstance(value, np.ma.MaskedArray):
        yield int(np.count_nonzero(np.ma.getmaskarray(value)))
    elif isinstance(value, list | tuple):
        for part in value:
            if not isinstance(part, float | int):
                yield from _masked(part)


def _by_dims(value: Any, dims: tuple[str, ...]) -> Any:
    """Values of a DataArray, transposed to the axes `dims`, other axes last."""
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
    """Refuse a descending axis: x, or any axis of a grid (`upward`)."""
    coords = getattr(value, "coords", {})
    if name not in coords or not (upward or name == "x"):
        return
    along = np.asarray(coords[name])
    if along.dtype.kind in "fiu" and along.size > 1 and not (np.diff(along) > 0).all():
        raise UnfitError(
            f"DataArray whose {name} does not ascend (sortby({name!r}) puts it in order)"
        )
