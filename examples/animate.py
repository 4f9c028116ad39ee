"""An animation.

A time-lapse of 16 frames, one second apart, with temporal reprojection between frames.
`ffmpeg -i out/animate_%02d.png clouds.mp4` encodes a video.
"""

from pathlib import Path

import nubis

Path("out").mkdir(exist_ok=True)

camera, params = nubis.scenes["fair_weather"]
shots = [(camera, params, 1.0 * i) for i in range(16)]
renderer = nubis.Renderer(320, 180, quality="draft")
for i, frame in enumerate(renderer.animate(shots)):
    nubis.save(f"out/animate_{i:02}.png", frame)
