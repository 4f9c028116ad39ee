"""Shadows of clouds.

A shadow map of the ground, the visibility of the sun from a camera while clouds drift by, and the
shadowed ground from above.
"""

from pathlib import Path

import numpy as np

import nubis

params = nubis.Params().with_(**{"sun.elevation": 45.0})
renderer = nubis.Renderer(320, 180, quality="draft")
Path("out").mkdir(exist_ok=True)

shadow = renderer.shadow_map(params, extent=20_000.0, size=256)
light = shadow.transmittance
nubis.save("out/shadow_map.png", np.repeat(light[..., None], 3, axis=2), tonemap="none")
print(f"{light.mean():.0%} of the sun reaches the ground")

# The texel of the shadow of a point in a cloud.
column, row, height, _ = np.linalg.inv(shadow.world_from_map) @ (1000, 2000, 1500, 1)
print(f"a point {height:.0f} m up has its shadow at row {row:.0f}, column {column:.0f}")

walker = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400))
for minute in range(0, 30, 6):
    direct, ambient = renderer.sun_visibility(walker, params, time=60.0 * minute)
    print(f"{minute:2} min: {direct:4.0%} of the sun is seen, {ambient:4.0%} comes scattered")

plane = nubis.Camera.look_at(eye=(0, 0, 6000), target=(0, 9000, 0))
nubis.save("out/shadows.png", renderer.render(plane, params))
