"""Weathers that turn into one another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from nubis import _nubis
from nubis._errors import ParameterError
from nubis.params import Params, Weather

Mixture = tuple[tuple[Weather, float], ...]


def mixture(layers: Iterable[tuple[Weather, float]]) -> tuple[Weather, Mixture]:
    """The ``weather`` and ``weather_mix`` of weathers whose weights are 1 together.

    Equal ones are one, and those without weight are left out.
    """
    weights: dict[Weather, float] = {}
    for weather, weight in layers:
        if weight > 0:
            weights[weather] = weights.get(weather, 0.0) + weight
    (base, _), *others = weights.items()
    return base, tuple((weather, min(weight, 1.0)) for weather, weight in others)


def layers(params: Params) -> list[tuple[Weather, float]]:
    """What the map of a sky is mixed from, with weights that are 1 together."""
    rest = 1 - sum(weight for _, weight in params.weather_mix)
    return [(params.weather, max(rest, 0.0)), *params.weather_mix]


class WeatherChange(NamedTuple):
    """A change of a `WeatherBlend`.

    Attributes
    ----------
    weather : Weather
        What the sky turns to.
    at : float
        Time at which it begins, in seconds.
    seconds : float
        How long it takes; 0 is at once.
    """

    weather: Weather
    at: float
    seconds: float = 30.0


@dataclass(frozen=True)
class WeatherBlend:
    """A weather that changes: every new one blends in linearly, over 30 s as in thesis2018.

    A change that begins while another runs lies over it, so that the sky never jumps.

        blend = nubis.WeatherBlend(params.weather).change(nubis.Weather(seed=8), at=10.0)
        frame = renderer.render(camera, blend.apply(params, 25.0), time=25.0)

    Parameters
    ----------
    weather : Weather
        What the sky is like before the first change.
    changes : sequence of WeatherChange
        In any order: one that begins later lies over those before.

    Raises
    ------
    ParameterError
        For weathers that do not all have the same `extent`, `edge` and `broad_extent`, and for
        times that are not finite or take less than 0 s.
    """

    weather: Weather
    changes: tuple[WeatherChange, ...] = ()

    def __post_init__(self) -> None:
        _check("weather", self.weather)
        try:
            changes = [WeatherChange(*change) for change in self.changes]
        except TypeError as error:
            raise ParameterError(
                f"changes = {self.changes!r} is not allowed: it must be a sequence of "
                f"nubis.WeatherChange ({error})"
            ) from None
        checked = []
        for index, (weather, at, seconds) in enumerate(changes):
            path = f"changes[{index}]"
            _check(f"{path}.weather", weather)
            for name in ("extent", "edge", "broad_extent"):
                value, wanted = getattr(weather, name), getattr(self.weather, name)
                if value != wanted:
                    raise ParameterError(
                        f"{path}.weather.{name} = {value!r} is not allowed: it must be {wanted!r}, "
                        "as of all weathers of a blend"
                    )
            begins = _finite(f"{path}.at", at)
            checked.append(WeatherChange(weather, begins, _finite(f"{path}.seconds", seconds, 0.0)))
        object.__setattr__(self, "changes", tuple(sorted(checked, key=lambda change: change.at)))

    def change(self, weather: Weather, at: float, seconds: float = 30.0) -> WeatherBlend:
        """Return a blend that also turns to `weather`, from time `at` on, over `seconds`."""
        return WeatherBlend(self.weather, (*self.changes, WeatherChange(weather, at, seconds)))

    def at(self, time: float) -> tuple[Weather, Mixture]:
        """Return what `Params` needs at a time: ``weather`` and ``weather_mix``."""
        time = _finite("time", time)
        layers = [(self.weather, 1.0)]
        for weather, begins, seconds in self.changes:
            if time < begins:
                break
            share = (time - begins) / seconds if time < begins + seconds else 1.0
            layers = [(below, (1 - share) * weight) for below, weight in layers]
            layers.append((weather, share))
        return mixture(layers)

    def apply(self, params: Params, time: float) -> Params:
        """Return the parameters with the weather of a time."""
        if not isinstance(params, Params):
            raise ParameterError(f"params = {params!r} is not allowed: it must be a nubis.Params")
        weather, mix = self.at(time)
        return params.replace(weather=weather, weather_mix=mix)


def _check(path: str, weather: Any) -> None:
    if not isinstance(weather, Weather):
        raise ParameterError(f"{path} = {weather!r} is not allowed: it must be a nubis.Weather")


def _finite(path: str, value: Any, least: float = float("-inf")) -> float:
    number = _nubis.number(path, value)
    if not (least <= number < float("inf") and number > float("-inf")):
        allowed = "a finite number of seconds" + (" from 0" if least == 0 else "")
        raise ParameterError(f"{path} = {value!r} is not allowed: it must be {allowed}")
    return number
