"""A day.

A time-lapse from dawn to dusk, interpolated between five skies: clouds grow until the afternoon and
dissipate in the evening. `python examples/day.py --frames 480 --size 960x540` renders all frames,
and `ffmpeg -i out/day_%03d.png day.mp4` encodes a video.
"""

import argparse
from itertools import pairwise
from pathlib import Path
from typing import Any

import nubis


def size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


parser = argparse.ArgumentParser(description="A time-lapse of a day.")
parser.add_argument("--frames", type=int, default=8)
parser.add_argument("--size", type=size, default=(320, 180), metavar="WxH")
args = parser.parse_args()

# Hour of the day, and the changes of its sky. Winds are constant, as `nubis.lerp` requires.
base = nubis.Params()
keys: list[tuple[float, dict[str, Any]]] = [
    (6.0, {"sun.elevation": 1.0, "sun.azimuth": 80.0, "clouds.coverage": 0.33}),
    (9.0, {"sun.elevation": 26.0, "sun.azimuth": 112.0, "clouds.coverage": 0.4}),
    (
        12.0,
        {
            "sun.elevation": 48.0,
            "sun.azimuth": 165.0,
            "clouds.coverage": 0.46,
            "clouds.top": 3000.0,
            "weather.seed": 8,
        },
    ),
    (
        15.0,
        {
            "sun.elevation": 40.0,
            "sun.azimuth": 228.0,
            "clouds.coverage": 0.55,
            "clouds.top": 4200.0,
            "clouds.precipitation": 0.3,
            "weather.seed": 9,
            "weather.noise": "perlin_worley",
        },
    ),
    (
        18.5,
        {
            "sun.elevation": 1.5,
            "sun.azimuth": 275.0,
            "clouds.coverage": 0.36,
            "clouds.type": 0.7,
            "weather.seed": 8,
        },
    ),
]
skies = [(hour, base.with_(**changes)) for hour, changes in keys]


def sky_at(hour: float) -> nubis.Params:
    for (start, before), (end, after) in pairwise(skies):
        if hour <= end:
            return nubis.lerp(before, after, (hour - start) / (end - start))
    return skies[-1][1]


Path("out").mkdir(exist_ok=True)
camera = nubis.Camera.look_at(eye=(0, 0, 200), target=(-800, 1000, 550), fov_y=65)
renderer = nubis.Renderer(*args.size, quality="draft")
first, last = skies[0][0], skies[-1][0]
for i in range(args.frames):
    hour = first + (last - first) * i / max(args.frames - 1, 1)
    # The time of the wind is scaled by an eighth, against flicker in a time-lapse of few frames.
    frame = renderer.render(camera, sky_at(hour), time=3600 * hour / 8)
    nubis.save(f"out/day_{i:03}.png", frame)
