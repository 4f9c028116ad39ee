"""High clouds alone.

Skies without volumetric clouds: cirrus, a mixture of cirrus and altocumulus, altocumulus (a
mackerel sky), and altocumulus with full emboss toward the sun.
"""

from pathlib import Path

import numpy as np

import nubis

Path("out").mkdir(exist_ok=True)

camera, params = nubis.scenes["mackerel"]
renderer = nubis.Renderer(320, 180)
skies = [
    params.with_(**{"high_clouds.type": kind, "high_clouds.emboss": emboss})
    for kind, emboss in ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1.0))
]
first, second, third, last = (renderer.render(camera, sky) for sky in skies)
picture = np.block([[[first], [second]], [[third], [last]]])
nubis.save("out/high_clouds.png", picture)
