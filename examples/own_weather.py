"""A user-supplied weather map.

An array sets coverage, type and precipitation by place: a spiral of 40 km in diameter, seen from an
altitude of 25 km.
"""

from pathlib import Path

import numpy as np

import nubis

Path("out").mkdir(exist_ok=True)

# East and north of the centre of the map, the origin of the world; row 0 is in the north.
x, y = np.meshgrid(np.linspace(-1, 1, 256), np.linspace(1, -1, 256))
radius, angle = np.hypot(x, y), np.arctan2(y, x)
coverage = (0.5 + 0.5 * np.cos(2 * angle - 14 * radius)) * np.clip(4 * (0.8 - radius), 0, 1)
kind = np.full_like(coverage, 0.6)
rain = np.zeros_like(coverage)

params = nubis.Params().with_(
    **{
        "weather.map": np.stack([coverage, kind, rain], axis=-1),
        "weather.extent": 50_000.0,
        # 0.5 leaves the map unchanged.
        "clouds.coverage": 0.5,
        "clouds.type": 0.5,
        "high_clouds.coverage": 0.0,
    }
)
camera = nubis.Camera.look_at(eye=(0, -25_000, 25_000), target=(0, -2000, 0), fov_y=50)
frame = nubis.Renderer(320, 180, quality="draft").render(camera, params)
nubis.save("out/own_weather.png", frame)
