"""Radiometric and photometric units (docs/units.md)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from nubis._arrays import UnfitError, opened
from nubis._errors import ParameterError

#: Luminance weights of red, green and blue for Rec. 709 primaries (ITU-R BT.709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: Luminous efficacy in lm/W of extraterrestrial sunlight from 380 to 780 nm: 683 lm/W times the
#: mean of V(lambda) (CIE 1931) over the extraterrestrial spectrum of ASTM G173-03.
LUMINOUS_EFFICACY = 202.93

#: Solar irradiance in W/m2 of visible light (380 to 780 nm), on a plane that faces the sun, above
#: the atmosphere, at the mean distance: a value for ``sun.irradiance``. It follows from ASTM
#: G173-03 and the CIE 1931 observer. Its luminance-weighted mean is 656 W/m2 (of a solar constant
#: of 1361), which times `LUMINOUS_EFFICACY` is 133 000 lx.
SOLAR_IRRADIANCE = (719.6, 640.9, 617.8)

#: Radiance of the night sky (airglow and stars) above the atmosphere in W/(m2 sr) of visible light:
#: a value for ``atmosphere.night`` with `SOLAR_IRRADIANCE`. 20.9, 21.6 and 22.6 magnitudes per
#: square arcsecond in R, V and B (Patat 2003) against the sun's -27.1, -26.74 and -26.09.
NIGHT_RADIANCE = (1.94e-6, 1.28e-6, 8.6e-7)

#: Irradiance of the full moon in W/m2 of visible light: a value for ``moon.irradiance`` with
#: `SOLAR_IRRADIANCE`. V = -12.73 (moon) against -26.74 (sun), B - V = 0.92 against 0.65 (Allen's
#: Astrophysical Quantities).
LUNAR_IRRADIANCE = (1.94e-3, 1.60e-3, 1.23e-3)


def luminance(frame: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return the luminance in cd/m2 of a frame that is rendered with `SOLAR_IRRADIANCE`.

    Radiance of such a frame is in W/(m2 sr) of visible light. Luminance is `LUMINOUS_EFFICACY`
    times its luminance-weighted mean. The same function converts irradiance in W/m2 to illuminance
    in lx.

    Parameters
    ----------
    frame : array-like, shape (..., 3) or (..., 4)
        Scene-linear radiance with Rec. 709 primaries, as returned by `Renderer.render`. Alpha is
        ignored.

    Returns
    -------
    array of float32, shape (...)
        Luminance in cd/m2.

    Raises
    ------
    ParameterError
        For another shape, or a value that is no array of numbers.

    Examples
    --------
    >>> params = nubis.Params().with_(**{"sun.irradiance": nubis.SOLAR_IRRADIANCE})
    >>> cd_per_m2 = nubis.luminance(renderer.render(camera, params))
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
