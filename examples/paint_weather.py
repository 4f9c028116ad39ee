"""Painted weather.

Brush strokes on the default weather map at reduced coverage: a ring of clouds with a clear lane
through it, seen from an altitude of 20 km.
"""

from pathlib import Path

import numpy as np

import nubis

Path("out").mkdir(exist_ok=True)

extent = 50_000.0
renderer = nubis.Renderer(320, 180, quality="draft")
# The baked weather map as an array, with its coverage scaled by 0.6.
map = renderer.weather_map(nubis.Params(weather=nubis.Weather(extent=extent)))
map = nubis.paint_mask(map, np.ones(map.shape[:2]), mode="multiply", amount=0.6)

# World metres: x east, y north.
angle = np.linspace(0, 2 * np.pi, 64)
ring = 9000 * np.column_stack([np.cos(angle), np.sin(angle)])
map = nubis.paint(map, ring, 4000.0, extent=extent, amount=0.6, hardness=0.1)
lane = [(-3000, -14_000), (3000, 14_000)]
map = nubis.paint(map, lane, 2000.0, extent=extent, mode="set", amount=0.0, hardness=0.8)
nubis.save("out/paint_weather_map.exr", map)  # `nubis.load_map` reads it

params = nubis.Params().with_(
    **{
        "weather.map": map,
        "weather.extent": extent,
        "clouds.coverage": 0.5,  # leaves the map unchanged
        "high_clouds.coverage": 0.0,
    }
)
camera = nubis.Camera.look_at(eye=(0, -22_000, 20_000), target=(0, -1000, 0), fov_y=50)
nubis.save("out/paint_weather.png", renderer.render(camera, params))
