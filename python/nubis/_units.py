"""Watts and candelas: docs/units.md."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from nubis._arrays import UnfitError, opened
from nubis._errors import ParameterError

#: Shares of red, green and blue in the luminance, for Rec. 709 primaries (ITU-R BT.709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: Luminous efficacy of unfiltered sunlight from 380 to 780 nm in lm/W: 683 lm/W times the mean of
#: V(lambda) (CIE 1931) over the spectrum of ASTM G173-03, extraterrestrial.
LUMINOUS_EFFICACY = 202.93

#: Irradiance of the sun on a plane that faces it, above the air, in W/m2 of visible light (380 to
#: 780 nm), at the mean distance: a value for ``sun.irradiance``. From the same spectrum and the
#: CIE 1931 observer; its luminance-weighted mean is the 656 W/m2 of that band (of 1361 in all), and
#: times the efficacy 133 000 lx.
SOLAR_IRRADIANCE = (719.6, 640.9, 617.8)

#: Radiance of the night's own light above the air, airglow and stars, beside a sun of
#: `SOLAR_IRRADIANCE`, in W/(m2 sr) of visible light: a value for ``atmosphere.night``. 20.9, 21.6
#: and 22.6 magnitudes a square arcsecond in R, V and B (Patat 2003) against -27.1, -26.74, -26.09.
NIGHT_RADIANCE = (1.94e-6, 1.28e-6, 8.6e-7)

#: Irradiance of the full moon beside that sun, in W/m2 of visible light: a value for
#: ``moon.irradiance``. V = -12.73 against -26.74 and B - V = 0.92 against 0.65 (Allen's
#: Astrophysical Quantities).
LUNAR_IRRADIANCE = (1.94e-3, 1.60e-3, 1.23e-3)


def luminance(frame: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return the luminance of a picture in cd/m2, where its sun has `SOLAR_IRRADIANCE`.

    Radiance is then in W/(m2 sr) of visible light, and `LUMINOUS_EFFICACY` times its
    luminance-weighted mean is the luminance. Illuminance in lx comes of irradiance in the same way.

    Parameters
    ----------
    frame : array-like, shape (..., 3) or (..., 4)
        Linear radiance with Rec. 709 primaries, such as `Renderer.render` returns. Alpha is left
        out.

    Returns
    -------
    array of float32, shape (...)

    Raises
    ------
    ParameterError
        For an array of another shape, or what is no array of numbers.
    """
    try:
        pixels = opened(frame)
    except UnfitError as error:
        raise ParameterError(f"frame = {error} is not allowed: it must be an array") from None
    if pixels.ndim < 1 or pixels.shape[-1] not in (3, 4):
        raise ParameterError(
            f"frame of shape {pixels.shape} is not allowed: it must be (..., 3) or (..., 4)"
        )
    weighted = LUMINOUS_EFFICACY * (pixels[..., :3].astype(np.float64) @ LUMINANCE)
    values: npt.NDArray[np.float32] = weighted.astype(np.float32)
    return values
