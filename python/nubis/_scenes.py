"""Example scenes: name -> (camera, parameters)."""

from __future__ import annotations

from collections.abc import Mapping

from nubis._levels import presets
from nubis._names import Named
from nubis._nubis import Camera
from nubis.params import Params


def _look(
    eye: tuple[float, float, float], azimuth: float, pitch: float, fov_y: float = 60.0
) -> Camera:
    """A camera that looks toward an azimuth, `pitch` degrees above the horizon."""
    from math import cos, radians, sin

    level = cos(radians(pitch))
    target = (
        eye[0] + sin(radians(azimuth)) * level,
        eye[1] + cos(radians(azimuth)) * level,
        eye[2] + sin(radians(pitch)),
    )
    return Camera.look_at(eye, target, (0, 0, 1), fov_y)


def _make() -> dict[str, tuple[Camera, Params]]:
    fair = Params()
    return {
        "fair_weather": (_look((0, 0, 200), 0, 14), fair),
        "overcast": (
            _look((0, 0, 200), 20, 16),
            presets["overcast"].with_(**{"sun.elevation": 35.0}),
        ),
        "stratocumulus": (
            _look((0, 0, 200), 340, 16),
            presets["stratocumulus"].with_(**{"sun.elevation": 30.0}),
        ),
        "storm": (
            _look((0, 0, 200), 40, 14),
            presets["storm"].with_(**{"sun.elevation": 28.0, "sun.azimuth": 140.0}),
        ),
        "sunset": (
            _look((0, 0, 200), 250, 11),
            # Clouds in front of the sun are dark where they are thick; thesis2018 lets them glow.
            fair.with_(
                **{
                    "sun.elevation": 3.0,
                    "sun.azimuth": 258.0,
                    "light.phase": "droplet",
                }
            ),
        ),
        "in_cloud": (
            _look((0, 0, 2000), 20, 4),
            fair.with_(**{"clouds.coverage": 0.46}),
        ),
        "above": (
            _look((0, 0, 3500), 20, -10),
            fair.with_(**{"clouds.coverage": 0.52, "sun.elevation": 30.0, "sun.azimuth": 320.0}),
        ),
        "cirrus": (
            _look((0, 0, 200), 300, 25),
            presets["cirrus"],
        ),
        "two_decks": (_look((0, 0, 200), 10, 20), presets["two_decks"]),
        "mackerel": (
            _look((0, 0, 200), 330, 24),
            fair.with_(
                **{
                    "clouds.coverage": 0.0,
                    "high_clouds.type": 1.0,
                    "high_clouds.coverage": 0.5,
                    "high_clouds.altitude": 4500.0,
                    "high_clouds.optical_depth": 8.0,
                    "high_clouds.scale": 16000.0,
                    "high_clouds.stretch": 4.0,
                    "high_clouds.emboss": 0.6,
                    "high_clouds.direction": 20.0,
                    "high_clouds.speed": 12.0,
                    "sun.elevation": 30.0,
                }
            ),
        ),
        "procedural_sky": (
            _look((0, 0, 200), 100, 22),
            fair.with_(
                **{
                    "clouds.coverage": 0.0,
                    "high_clouds.type": 0.6,
                    "high_clouds.coverage": 0.5,
                    "high_clouds.altitude": 2500.0,
                    "high_clouds.optical_depth": 5.0,
                    "high_clouds.scale": 18000.0,
                    "high_clouds.stretch": 1.5,
                    "high_clouds.emboss": 0.7,
                    "high_clouds.speed": 10.0,
                    "high_clouds.evolution": 0.002,
                    "sun.elevation": 12.0,
                    "sun.azimuth": 140.0,
                }
            ),
        ),
    }


#: Example scenes: name -> (camera, parameters).
scenes: Mapping[str, tuple[Camera, Params]] = Named("scene", _make())
