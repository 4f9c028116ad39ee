"""An all-sky camera.

The upper half of the sky as a meteorological camera sees it: a circle with the zenith in the
middle, north at the top and east on the left.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera = nubis.Camera.fisheye(eye=(0, 0, 2), fov=180)
params = nubis.Params().with_(**{"sun.elevation": 55.0, "clouds.coverage": 0.5})
frame = nubis.Renderer(240, 240, quality="draft").render(camera, params)
# Outside the circle alpha is 0: the corners of the PNG are transparent.
nubis.save("out/all_sky.png", frame)
