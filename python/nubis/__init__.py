"""Volumetric clouds: fast, accurate, on any Vulkan device or none.

    import nubis

    camera = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400), fov_y=60.0)
    frame = nubis.Renderer(960, 540).render(camera, nubis.Params())
    nubis.save("sky.png", frame)

World coordinates are right-handed and in metres: x east, y north, z up, z = 0 at sea level at the
origin. Angles are in degrees, time is in seconds. Frames are float32, scene-linear, with Rec. 709
primaries and premultiplied alpha.
"""

import atexit as _atexit
import os as _os

from nubis import _nubis
from nubis._errors import (
    AdapterError,
    DeviceError,
    FileError,
    ForkError,
    NubisError,
    ParameterError,
)
from nubis._image import auto_exposure, load_map, save, to_srgb8
from nubis._keyframes import Keyframes
from nubis._lerp import lerp
from nubis._levels import presets, sky
from nubis._nubis import Camera, DensityGrid
from nubis._paint import paint, paint_mask
from nubis._renderer import Adapter, Renderer, adapters, quality
from nubis._scene_depth import distance_from_z
from nubis._scenes import scenes
from nubis._shadow import ShadowMap, SunVisibility
from nubis._units import (
    LUMINOUS_EFFICACY,
    LUNAR_IRRADIANCE,
    NIGHT_RADIANCE,
    SOLAR_IRRADIANCE,
    luminance,
)
from nubis._weather import WeatherBlend, WeatherChange
from nubis.params import (
    Atmosphere,
    Clouds,
    Drift,
    HighClouds,
    Light,
    Moon,
    Params,
    Quality,
    Sun,
    UpperClouds,
    Weather,
    Wind,
    WindVariation,
)

# At import: settings of the driver must precede its loading and the start of threads.
_os.environ.update(_nubis.driver_settings())
# Stops renders in daemon threads at interpreter exit (crates/clouds_py/src/exit.rs).
_atexit.register(_nubis.close)
if hasattr(_os, "register_at_fork"):
    _os.register_at_fork(after_in_child=_nubis.forked)

__version__ = "0.1.0"

__all__ = [
    "LUMINOUS_EFFICACY",
    "LUNAR_IRRADIANCE",
    "NIGHT_RADIANCE",
    "SOLAR_IRRADIANCE",
    "Adapter",
    "AdapterError",
    "Atmosphere",
    "Camera",
    "Clouds",
    "DensityGrid",
    "DeviceError",
    "Drift",
    "FileError",
    "ForkError",
    "HighClouds",
    "Keyframes",
    "Light",
    "Moon",
    "NubisError",
    "ParameterError",
    "Params",
    "Quality",
    "Renderer",
    "ShadowMap",
    "Sun",
    "SunVisibility",
    "UpperClouds",
    "Weather",
    "WeatherBlend",
    "WeatherChange",
    "Wind",
    "WindVariation",
    "adapters",
    "auto_exposure",
    "distance_from_z",
    "lerp",
    "load_map",
    "luminance",
    "paint",
    "paint_mask",
    "presets",
    "quality",
    "save",
    "scenes",
    "sky",
    "to_srgb8",
]


def __getattr__(name: str) -> object:
    if name == "Wander":
        import warnings

        message = "nubis.Wander is deprecated: it is nubis.WindVariation now"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return WindVariation
    raise AttributeError(f"module 'nubis' has no attribute {name!r}")
