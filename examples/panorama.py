"""A panorama.

An equirectangular environment map in linear light, for image-based lighting. Blender, Unreal and
most other programs read both files.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera = nubis.Camera.equirect(eye=(0, 0, 2))
# The disc of the sun covers few pixels and causes noise: use a directional light for it.
params = nubis.Params(sun=nubis.Sun(elevation=30, azimuth=140, visible=False))
frame = nubis.Renderer(400, 200, quality="draft").render(camera, params)
nubis.save("out/panorama.exr", frame)
nubis.save("out/panorama.hdr", frame)
