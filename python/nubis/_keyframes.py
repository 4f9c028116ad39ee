"""Skies by time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from itertools import pairwise
from typing import Literal

from nubis import _nubis
from nubis._errors import ParameterError
from nubis._lerp import lerp
from nubis.params import Params


class Keyframes:
    """Skies at some times, and by `lerp` those between them.

    Parameters
    ----------
    keys : iterable of (float, Params)
        Times, in any unit and order but each once, and their skies.
    easing : {"linear", "smooth"}
        How a sky goes to the next: evenly, or slowly away from the one and slowly up to the other,
        without a kink at the keys.

    Attributes
    ----------
    keys : tuple of (float, Params)
        The same, in the order of time.
    easing : str

    Raises
    ------
    ParameterError
        For no keys at all, two at one time, and what is no time or sky.

    Examples
    --------
    >>> day = nubis.Keyframes([(6, clear), (15, stormy), (21, clear)], easing="smooth")
    >>> sky = day.at(12.5)
    """

    __slots__ = ("easing", "keys")

    keys: tuple[tuple[float, Params], ...]
    easing: Literal["linear", "smooth"]

    def __init__(
        self,
        keys: Iterable[tuple[float, Params]],
        easing: Literal["linear", "smooth"] = "linear",
    ) -> None:
        try:
            pairs = [(time, params) for time, params in keys]
        except (TypeError, ValueError):
            raise ParameterError(
                f"keys = {keys!r} is not allowed: it must be pairs (time, nubis.Params)"
            ) from None
        if not pairs:
            raise ParameterError("keys = [] is not allowed: there must be one at least")
        if easing not in ("linear", "smooth"):
            raise ParameterError(
                f"easing = {easing!r} is not allowed: it must be 'linear' or 'smooth'"
            )
        made = []
        for index, (time, params) in enumerate(pairs):
            if not isinstance(params, Params):
                raise ParameterError(
                    f"keys[{index}] = {params!r} is not allowed: it must be a nubis.Params"
                )
            made.append((_time(f"keys[{index}] time", time), params))
        made.sort(key=lambda key: key[0])
        for (time, _), (after, _) in pairwise(made):
            if time == after:
                raise ParameterError(
                    f"keys time = {time!r} is not allowed twice: each key has a time of its own"
                )
        object.__setattr__(self, "keys", tuple(made))
        object.__setattr__(self, "easing", easing)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot assign to {name!r}: Keyframes are frozen")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"cannot delete {name!r}: Keyframes are frozen")

    def __reduce__(self) -> tuple[type[Keyframes], tuple[object, ...]]:
        return (Keyframes, (self.keys, self.easing))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Keyframes):
            return NotImplemented
        return (self.keys, self.easing) == (other.keys, other.easing)

    def __hash__(self) -> int:
        return hash((self.keys, self.easing))

    def __repr__(self) -> str:
        return f"Keyframes({list(self.keys)!r}, easing={self.easing!r})"

    def at(self, time: float) -> Params:
        """Return the sky at a time: before the first key the first's, after the last the last's."""
        now = _time("time", time)
        index = bisect_right([key for key, _ in self.keys], now)
        if index in (0, len(self.keys)):
            return self.keys[min(index, len(self.keys) - 1)][1]
        (start, before), (end, after) = self.keys[index - 1], self.keys[index]
        # Halves, so that no difference is beyond the largest float.
        share = (0.5 * now - 0.5 * start) / (0.5 * end - 0.5 * start)
        if self.easing == "smooth":
            share = share * share * (3 - 2 * share)
        return lerp(before, after, min(max(share, 0.0), 1.0))


def _time(name: str, value: object) -> float:
    time = _nubis.number(name, value)
    if not math.isfinite(time):
        raise ParameterError(f"{name} = {value!r} is not allowed: it must be a finite number")
    return time
