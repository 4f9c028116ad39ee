"""Presets, and `sky`: parameters from a cover, a preset, a map, a volume or single fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from nubis._errors import ParameterError
from nubis._names import Named
from nubis._nubis import DensityGrid
from nubis.params import Params


def _make() -> dict[str, Params]:
    fair = Params()
    skies: dict[str, dict[str, Any]] = {
        "clear": {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0},
        "few": {
            "clouds.coverage": 0.47,
            "clouds.top": 2600.0,
            "high_clouds.coverage": 0.35,
        },
        "scattered": {"clouds.coverage": 0.56, "clouds.type": 0.8},
        "broken": {"clouds.coverage": 0.7, "clouds.type": 0.7},
        "overcast": {"clouds.coverage": 0.9, "clouds.type": 0.35, "clouds.extinction": 0.1},
        "stratus": {
            "clouds.coverage": 0.95,
            "clouds.type": 0.1,
            "clouds.extinction": 0.1,
            "clouds.base": 400.0,
            "clouds.top": 2400.0,
            "high_clouds.coverage": 0.0,
        },
        "stratocumulus": {
            "clouds.coverage": 0.6,
            "clouds.type": 0.5,
            "clouds.extinction": 0.1,
        },
        "cumulus": {
            "clouds.coverage": 0.5,
            "clouds.type": 1.0,
            "clouds.base": 1000.0,
            "clouds.top": 4400.0,
            "high_clouds.coverage": 0.3,
        },
        "storm": {
            "clouds.coverage": 0.55,
            "clouds.precipitation": 0.9,
            "clouds.base": 900.0,
        },
        "two_decks": {
            "clouds.coverage": 0.42,
            "upper_clouds.coverage": 0.55,
        },
        "cirrus": {
            "clouds.coverage": 0.25,
            "high_clouds.coverage": 0.6,
            "high_clouds.optical_depth": 2.0,
        },
    }
    return {name: fair.with_(**fields) for name, fields in skies.items()}


#: Preset skies by name: kinds of clouds, with the default sun, wind and atmosphere.
presets: Mapping[str, Params] = Named("preset", _make())


def sky(
    cover: float | None = None,
    *,
    preset: str | None = None,
    map: npt.ArrayLike | None = None,
    volume: DensityGrid | None = None,
    **fields: Any,
) -> Params:
    """Return the parameters of a sky, from any of five levels of detail.

    Levels are applied in the order preset, cover, map, volume, fields. Each overrides the fields
    that it sets and leaves all others unchanged.

    Parameters
    ----------
    cover : float, optional
        Cloud cover: 0 is clear, 1 overcast. Sets ``clouds.coverage``.
    preset : str, optional
        Name of a sky in `presets`. Sets every field. `cover`, if given, replaces the cover of the
        preset.
    map : array-like, shape (H, W, 3), optional
        Weather map: coverage, type and precipitation, 0 to 1, row 0 in the north. Sets
        ``weather.map``, and the values that leave the map unchanged: ``clouds.coverage`` 0.5,
        ``clouds.type`` 0.5, ``clouds.precipitation`` 1.
    volume : DensityGrid, optional
        Extinction grid that replaces all clouds. Sets ``volume``. High clouds are drawn with it if
        ``high_clouds.with_volume`` is True.
    **fields
        Single fields by dotted names, such as ``**{"sun.elevation": 5.0}``.

    Returns
    -------
    Params

    Raises
    ------
    ParameterError
        For a value that is not allowed, an unknown preset or an unknown field.

    Examples
    --------
    >>> params = nubis.sky(0.4, preset="storm", **{"sun.elevation": 5.0})
    """
    params = Params()
    if preset is not None:
        params = presets[preset]
    if cover is not None:
        try:
            params = params.with_(**{"clouds.coverage": cover})
        except ParameterError as error:
            raise ParameterError(str(error).replace("clouds.coverage", "cover", 1)) from None
    if map is not None:
        as_it_is = {"clouds.coverage": 0.5, "clouds.type": 0.5, "clouds.precipitation": 1.0}
        params = params.with_(**{"weather.map": map}, **as_it_is)
    if volume is not None:
        params = params.replace(volume=volume)
    return params.with_(**fields)
