"""Position of the sun for a place and a time."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Self

import numpy as np

from nubis import _nubis
from nubis._block import Block
from nubis._errors import ParameterError

# Terrestrial time minus universal time in s, at present. It grows by less than 1 s a year, which
# moves the sun by 1e-5 degrees.
_DELTA_T = 69.0


class SunBlock(Block):
    """Base class of `nubis.Sun`: constructors."""

    @classmethod
    def at(cls, latitude: float, longitude: float, time: datetime, **fields: Any) -> Self:
        """Return the sun for a place and a time.

        Elevation and azimuth come from the Solar Position Algorithm (Reda and Andreas 2004), which
        is within 0.0003 degrees of an almanac. The elevation is geometric: of the centre of the
        disc, without refraction, because light travels in straight lines in this renderer.
        Refraction lifts the real sun by half a degree near the horizon, so that it rises some
        minutes earlier and sets some minutes later.

        Parameters
        ----------
        latitude, longitude : float
            Degrees, north and east positive: -90 to 90 and -180 to 180.
        time : datetime
            Time with a time zone, such as ``datetime(2026, 6, 21, 12, tzinfo=UTC)``.
        **fields
            Other fields of the sun, such as ``irradiance``.

        Returns
        -------
        Sun

        Raises
        ------
        ParameterError
            For a latitude or longitude out of range, or a time without a time zone.
        ImportError
            Without the package sunposition: ``pip install "nubis[sun]"`` installs it.

        Examples
        --------
        >>> noon = datetime(2026, 6, 21, 12, tzinfo=UTC)
        >>> params = nubis.Params(sun=nubis.Sun.at(48.1, 11.6, noon))
        """
        place = []
        for name, value, most in (("latitude", latitude, 90), ("longitude", longitude, 180)):
            degrees = _nubis.number(name, value)
            if not -most <= degrees <= most:
                raise ParameterError(
                    f"{name} = {value!r} is not allowed: it must be a number of degrees from "
                    f"{-most} to {most}"
                )
            place.append(degrees)
        if not isinstance(time, datetime) or time.utcoffset() is None:
            raise ParameterError(
                f"time = {time!r} is not allowed: it must be a datetime with a time zone, such as "
                "datetime(2026, 6, 21, 12, tzinfo=UTC)"
            )
        try:
            from sunposition import observed_sunposition
        except ImportError as error:
            raise ImportError(
                'nubis.Sun.at needs the package sunposition: pip install "nubis[sun]"'
            ) from error
        universal = np.datetime64(time.astimezone(UTC).replace(tzinfo=None), "us")
        # A pressure of 0 switches refraction off.
        azimuth, zenith = observed_sunposition(
            universal, *place, 0.0, pressure=0.0, delta_t=_DELTA_T, jit=False
        )
        fields = {"elevation": 90 - float(zenith), "azimuth": float(azimuth), **fields}
        return cls(**fields)
