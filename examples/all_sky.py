"""An all-sky camera.

The upper hemisphere in the view of a meteorological camera: a circle with the zenith in the centre,
north at the top and east on the left.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera = nubis.Camera.fisheye(eye=(0, 0, 2), fov=180)
params = nubis.Params().with_(**{"sun.elevation": 55.0, "clouds.coverage": 0.5})
frame = nubis.Renderer(240, 240, quality="draft").render(camera, params)
# Alpha is 0 outside the circle: the corners of the PNG are transparent.
nubis.save("out/all_sky.png", frame)
