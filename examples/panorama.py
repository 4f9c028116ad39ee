"""A panorama.

The whole sphere in linear light, to illuminate scenes in other programs: Blender, Unreal and most
others read either file.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera = nubis.Camera.equirect(eye=(0, 0, 2))
# A few pixels as bright as the sun's disc make noise; a lamp in the other program replaces it.
params = nubis.Params(sun=nubis.Sun(elevation=30, azimuth=140, visible=False))
frame = nubis.Renderer(400, 200, quality="draft").render(camera, params)
nubis.save("out/panorama.exr", frame)
nubis.save("out/panorama.hdr", frame)
