"""Where the sun stands at a place and a time."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Self

import numpy as np

from nubis import _nubis
from nubis._block import Block
from nubis._errors import ParameterError

# Terrestrial time minus universal time in s, now: it grows by less than 1 s a year, in which the
# sun goes 1e-5 degrees.
_DELTA_T = 69.0


class SunBlock(Block):
    """What `nubis.Sun` can do beside holding parameters."""

    @classmethod
    def at(cls, latitude: float, longitude: float, time: datetime, **fields: Any) -> Self:
        """Return the sun of a place and a time.

        Its elevation is the geometric one, of the middle of the disc and without refraction, as
        light goes straight in this renderer: near the horizon air lifts the sun that is seen by
        half a degree, so that it rises and sets some minutes earlier and later than here. By the
        Solar Position Algorithm (Reda and Andreas 2004), 0.0003 degrees from an almanac.

        Parameters
        ----------
        latitude, longitude : float
            Degrees, north and east positive: -90 to 90 and -180 to 180.
        time : datetime
            With a time zone, such as ``datetime(2026, 6, 21, 12, tzinfo=UTC)``.
        **fields
            The other fields of the sun, such as ``irradiance``.

        Raises
        ------
        ParameterError
            For a place that is none, and for a time without a zone.
        ImportError
            Where the library is missing: ``pip install "nubis[sun]"`` brings it.

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
        # Without pressure it does not refract.
        azimuth, zenith = observed_sunposition(
            universal, *place, 0.0, pressure=0.0, delta_t=_DELTA_T, jit=False
        )
        fields = {"elevation": 90 - float(zenith), "azimuth": float(azimuth), **fields}
        return cls(**fields)
