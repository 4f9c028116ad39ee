"""A still.

The shortest program: a camera, the parameters of a sky, and an image file.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400), up=(0, 0, 1), fov_y=60.0)
params = nubis.Params()
frame = nubis.Renderer(320, 180, quality="draft").render(camera, params)
nubis.save("out/still.png", frame)
