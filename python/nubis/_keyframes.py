"""Keyframe animation of skies."""

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
    """Skies at key times, interpolated by `lerp` between them.

    The displacement of the clouds is the integral of the interpolated winds, in float64 and
    independent of the order of evaluation: a change of wind does not make the clouds jump. `at`
    stores it in `Params.drift`. A sky of `at` is valid at its time alone: render it with
    ``render(..., time=seconds * time)``.

    Parameters
    ----------
    keys : iterable of (float, Params)
        Key times, in any unit and order, and their skies. Times are unique.
    easing : {"linear", "smooth"}
        Interpolation in time: linear, or smoothstep, whose derivative is 0 at the keys.
    seconds : float
        Seconds of `Renderer.render` per unit of key time: 1 for times in seconds, 3600 for hours.
        It affects only skies whose winds change.

    Attributes
    ----------
    keys : tuple of (float, Params)
        Keys in the order of time.
    easing : str
    seconds : float

    Raises
    ------
    ParameterError
        Without keys, for two keys of the same time, a time that is not finite, or a key that is no
        `Params`; if winds that wander change over more than 16,384 times `wind_variation.period`
        between two keys.

    Examples
    --------
    >>> day = nubis.Keyframes([(6, clear), (15, stormy), (21, clear)], "smooth", seconds=3600)
    >>> frame = renderer.render(camera, day.at(12.5), time=3600 * 12.5)
    """

    __slots__ = ("_carried", "easing", "keys", "seconds")

    keys: tuple[tuple[float, Params], ...]
    easing: Literal["linear", "smooth"]
    seconds: float
    # Displacements by the winds at each key; empty if all keys have the same winds.
    _carried: list[list[float]]

    def __init__(
        self,
        keys: Iterable[tuple[float, Params]],
        easing: Literal["linear", "smooth"] = "linear",
        seconds: float = 1.0,
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
        unit = _nubis.number("seconds", seconds)
        if not 0 < unit < math.inf:
            raise ParameterError(
                f"seconds = {seconds!r} is not allowed: it must be a finite number above 0"
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
        object.__setattr__(self, "seconds", unit)
        object.__setattr__(self, "_carried", [])
        if not all(_nubis.same_winds(made[0][1], params) for _, params in made):
            self._carried.append(_nubis.carried(made[0][1], unit * made[0][0]))
            for index in range(len(made) - 1):
                self._carried.append(self._carried_at(index, made[index + 1][0]))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot assign to {name!r}: Keyframes are frozen")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"cannot delete {name!r}: Keyframes are frozen")

    def __reduce__(self) -> tuple[type[Keyframes], tuple[object, ...]]:
        return (Keyframes, (self.keys, self.easing, self.seconds))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Keyframes):
            return NotImplemented
        return self.__reduce__() == other.__reduce__()

    def __hash__(self) -> int:
        return hash(self.__reduce__())

    def __repr__(self) -> str:
        return f"Keyframes({list(self.keys)!r}, easing={self.easing!r}, seconds={self.seconds!r})"

    def at(self, time: float) -> Params:
        """Return the sky at a time, in the unit of the key times.

        The first sky holds before the first key, the last sky after the last key.

        Raises
        ------
        ParameterError
            If the time is not finite.
        """
        now = _time("time", time)
        index = bisect_right([key for key, _ in self.keys], now)
        if index in (0, len(self.keys)):
            # After the last key its winds go on from the displacements at that key.
            (key, sky) = self.keys[max(index - 1, 0)]
            return self._drifted(sky, index - 1, key) if index else sky
        (start, before), (end, after) = self.keys[index - 1], self.keys[index]
        # Halved, so that no difference overflows.
        share = (0.5 * now - 0.5 * start) / (0.5 * end - 0.5 * start)
        if self.easing == "smooth":
            share = share * share * (3 - 2 * share)
        return self._drifted(lerp(before, after, min(max(share, 0.0), 1.0)), index - 1, now)

    def _drifted(self, sky: Params, index: int, time: float) -> Params:
        """The sky with the drift of a time between the key `index` and the next."""
        if not self._carried:
            return sky
        fields = _nubis.drift_of(sky, self.seconds * time, self._carried_at(index, time))
        return sky.with_(**{f"drift.{name}": value for name, value in fields.items()})

    def _carried_at(self, index: int, time: float) -> list[float]:
        """Displacements at a time between the key `index` and the next."""
        carried = self._carried[index]
        start, before = self.keys[index]
        if time == start:
            return carried
        end, after = self.keys[index + 1]
        span = (self.seconds * start, self.seconds * end)
        way = _nubis.carried_between(
            (before, after),
            span,
            self.easing == "smooth",
            carried[-1] + before.drift.swings,
            self.seconds * time,
        )
        return [a + b for a, b in zip(carried, way, strict=True)]


def _time(name: str, value: object) -> float:
    time = _nubis.number(name, value)
    if not math.isfinite(time):
        raise ParameterError(f"{name} = {value!r} is not allowed: it must be a finite number")
    return time
