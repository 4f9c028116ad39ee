"""Transitions between weathers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from nubis import _nubis
from nubis._errors import ParameterError
from nubis.params import Params, Weather

Mixture = tuple[tuple[Weather, float], ...]


def mixture(layers: Iterable[tuple[Weather, float]]) -> tuple[Weather, Mixture]:
    """The ``weather`` and ``weather_mix`` of weighted weathers; weights sum to 1.

    Equal weathers are merged, and weathers of weight 0 are omitted.
    """
    weights: dict[Weather, float] = {}
    for weather, weight in layers:
        if weight > 0:
            weights[weather] = weights.get(weather, 0.0) + weight
    (base, _), *others = weights.items()
    return base, tuple((weather, min(weight, 1.0)) for weather, weight in others)


def layers(params: Params) -> list[tuple[Weather, float]]:
    """Weathers of a sky and their weights, which sum to 1."""
    rest = 1 - sum(weight for _, weight in params.weather_mix)
    return [(params.weather, max(rest, 0.0)), *params.weather_mix]


class WeatherChange(NamedTuple):
    """A transition of a `WeatherBlend`.

    Attributes
    ----------
    weather : Weather
        Weather at the end of the transition.
    at : float
        Start of the transition in seconds.
    seconds : float
        Duration of the transition in seconds; 0 switches at once.
    """

    weather: Weather
    at: float
    seconds: float = 30.0


@dataclass(frozen=True)
class WeatherBlend:
    """A weather with transitions: each new weather is blended in linearly, over 30 s (thesis2018).

    A transition that starts during another one is blended over it, so that the sky is continuous.

        blend = nubis.WeatherBlend(params.weather).change(nubis.Weather(seed=8), at=10.0)
        frame = renderer.render(camera, blend.apply(params, 25.0), time=25.0)

    Parameters
    ----------
    weather : Weather
        Weather before the first transition.
    changes : sequence of WeatherChange
        Transitions, in any order. They are blended in the order of their start.

    Raises
    ------
    ParameterError
        For weathers of different `extent`, `edge` or `broad_extent`, a start that is not finite, or
        a negative duration.
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
        """Return a blend with a further transition to `weather`: from `at` on, over `seconds`."""
        return WeatherBlend(self.weather, (*self.changes, WeatherChange(weather, at, seconds)))

    def at(self, time: float) -> tuple[Weather, Mixture]:
        """Return the fields ``weather`` and ``weather_mix`` of `Params` at a time in seconds."""
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
        """Return the parameters with the weather of a time in seconds."""
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
