"""Layers.

Composites the clouds over a custom background, and saves their depth.
"""

from pathlib import Path

import numpy as np

import nubis

Path("out").mkdir(exist_ok=True)

camera, params = nubis.scenes["fair_weather"]
layers = nubis.Renderer(320, 180, quality="draft").render_layers(camera, params)

# With `layers["sky"]` the composite equals `render`. This background goes from violet to orange.
down = np.linspace(0, 1, 180)[:, None, None]
background = (1 - down) * [0.2, 0.1, 0.5] + down * [1.0, 0.5, 0.2]
picture = layers["radiance"] + layers["transmittance"][..., None] * background
nubis.save("out/layers.png", picture)

# White: depth of 2 km or less. Black: infinite depth, no clouds.
nearness = 2000 / layers["depth"]
nubis.save("out/layers_depth.png", np.stack([nearness] * 3, axis=-1), tonemap="none")
