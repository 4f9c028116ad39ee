"""Skies between skies."""

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
    """Return the sky between two: `a` at t = 0, `b` at t = 1, and smoothly from one to the other.

    - Numbers and vectors go in a straight line; compass directions (azimuths, winds) along the
      shorter arc, clockwise if both are equally long. What `a` and `b` allow is allowed between.
    - The weather maps blend into each other (`Params.weather_mix`): clouds of the one vanish while
      those of the other appear, whatever the two weathers are. Only weathers of another `extent`,
      `edge` or `broad_extent` cannot be mixed: they switch.
    - Arrays of equal shape go in a straight line.
    - What has nothing between switches from `a` to `b` at t = 0.5: words (models, noises), True and
      False, whole numbers (seeds, octaves, sizes), the volume. Keep it equal for a smooth sky.

    Winds are how fast clouds go, and where they are is that times the time since 0 s, and
    `Params.drift`. `lerp` knows no time: after hours another share of two winds has the clouds
    elsewhere by kilometres. Over time use `Keyframes`, which carry them on, or `Params.after`.

    Parameters
    ----------
    a, b : Params
    t : float
        0 to 1.
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
    """The deck above the clouds: where the other sky has none, those may stand higher than it does,
    and it comes from above.
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
        # A shell that is as thin as f32 knows may be between two altitudes that f32 does.
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
    # What is equal stays so to the bit, and rounding leaves no range.
    return min(max(a + t * (b - a), min(a, b)), max(a, b))


def _arc(a: float, b: float, t: float) -> float:
    """Degrees on the shorter arc, within 360 of north."""
    turn = 180 - (180 - (b - a)) % 360
    angle = a + t * turn
    return angle - math.copysign(360, angle) if abs(angle) > 360 else angle
