"""Interpolation of skies."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from nubis import _nubis
from nubis._block import Block
from nubis._errors import ParameterError
from nubis._weather import layers, mixture
from nubis.params import Params, UpperClouds


def lerp(a: Params, b: Params, t: float) -> Params:
    """Return the interpolation of two skies: `a` at t = 0, `b` at t = 1.

    - Numbers, vectors and arrays of equal shape are interpolated linearly. Every result is an
      allowed value.
    - Compass directions (azimuths, winds) are interpolated along the shorter arc, clockwise if both
      arcs are equally long.
    - Weather maps are blended (`Params.weather_mix`): clouds of one map vanish while clouds of the
      other appear. Weathers of different `extent`, `edge` or `broad_extent` cannot be blended and
      switch at t = 0.5.
    - Discrete fields switch from `a` to `b` at t = 0.5: names (models, noises), booleans, integers
      (seeds, octaves, sizes) and the volume. Keep them equal for a continuous sky.

    Clouds are displaced by wind speed times the time since 0 s, plus `Params.drift`. `lerp` does
    not know the time: hours after 0 s, a small change of `t` between two winds moves the clouds by
    kilometres. For skies that change in time use `Keyframes` or `Params.after`, which keep the
    displacement continuous.

    Parameters
    ----------
    a, b : Params
    t : float
        Interpolation parameter, 0 to 1.

    Returns
    -------
    Params

    Raises
    ------
    ParameterError
        If `a` or `b` is no `Params`, or `t` is outside 0 to 1.

    Examples
    --------
    >>> dusk = nubis.lerp(nubis.presets["scattered"], nubis.presets["overcast"], 0.3)
    """
    for name, value in (("a", a), ("b", b)):
        if not isinstance(value, Params):
            raise ParameterError(f"{name} = {value!r} is not allowed: it must be a nubis.Params")
    share = _nubis.number("t", t)
    if not 0 <= share <= 1:
        raise ParameterError(f"t = {t!r} is not allowed: it must be a number from 0 to 1")
    if share in (0, 1):
        return b if share else a
    values: dict[str, Any] = {}
    for field in dataclasses.fields(Params):
        old, new = getattr(a, field.name), getattr(b, field.name)
        if isinstance(old, Block) and isinstance(new, Block) and field.name != "weather":
            values[field.name] = _block(old, new, share)
        else:
            values[field.name] = new if share >= 0.5 else old
    if all(
        getattr(a.weather, n) == getattr(b.weather, n) for n in ("extent", "edge", "broad_extent")
    ):
        old_layers = [(weather, (1 - share) * weight) for weather, weight in layers(a)]
        new_layers = [(weather, share * weight) for weather, weight in layers(b)]
        values["weather"], values["weather_mix"] = mixture(old_layers + new_layers)
    values["upper_clouds"] = _above(values["upper_clouds"], values["clouds"].top)
    return Params(**values)


def _above(deck: UpperClouds, lowest: float) -> UpperClouds:
    """The upper deck, raised to the top of the lower one if that is higher.

    Without an upper deck in one of the skies, its lower deck may be higher than the upper deck of
    the other sky.
    """
    if deck.coverage == 0 or deck.base >= lowest:
        return deck
    top = min(deck.top + lowest - deck.base, 25_000.0)
    room = np.float32(top) > np.float32(lowest)
    return deck.replace(base=lowest, top=top) if room else deck.replace(coverage=0.0)


def _block(a: Block, b: Block, t: float) -> Block:
    values: dict[str, Any] = {}
    for field in dataclasses.fields(a):
        values[field.name] = _value(field.name, getattr(a, field.name), getattr(b, field.name), t)
    if {"base", "top"} <= values.keys():
        # Between two decks as thin as float32 resolves, base and top may round to the same.
        base = np.float32(values["base"])
        values["top"] = max(values["top"], float(np.nextafter(base, np.float32(np.inf))))
    return type(a)(**values)


def _value(name: str, a: Any, b: Any, t: float) -> Any:
    if isinstance(a, float) and isinstance(b, float):
        return _arc(a, b, t) if name == "azimuth" or name.endswith("direction") else _line(a, b, t)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return tuple(_line(x, y, t) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.shape == b.shape:
        return np.clip((1 - t) * a + t * b, np.minimum(a, b), np.maximum(a, b))
    return b if t >= 0.5 else a


def _line(a: float, b: float, t: float) -> float:
    # Clamped: equal values stay bit-exact, and rounding leaves no allowed range.
    return min(max(a + t * (b - a), min(a, b)), max(a, b))


def _arc(a: float, b: float, t: float) -> float:
    """Interpolation of degrees along the shorter arc, within -360 to 360."""
    turn = 180 - (180 - (b - a)) % 360
    angle = a + t * turn
    return angle - math.copysign(360, angle) if abs(angle) > 360 else angle
