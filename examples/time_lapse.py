"""Twenty-four hours at one place.

The position of the sun is that over Munich at the summer solstice; the weather changes from fair to
stormy and back. Exposure adapts partly to the luminance, as the eye does.
`python examples/time_lapse.py --frames 288 --size 960x540` renders all frames, and
`ffmpeg -i out/time_lapse_%03d.png time_lapse.mp4` encodes a video. Requires
`pip install "nubis[sun]"`.
"""

import argparse
from datetime import datetime, timedelta, timezone
from pathlib import Path

import nubis


def size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


parser = argparse.ArgumentParser(description="A time-lapse of 24 hours.")
parser.add_argument("--frames", type=int, default=8)
parser.add_argument("--size", type=size, default=(320, 180), metavar="WxH")
parser.add_argument("--latitude", type=float, default=48.14)
parser.add_argument("--longitude", type=float, default=11.58)
args = parser.parse_args()

fair = nubis.Params()
storm = {"clouds.coverage": 0.6, "clouds.precipitation": 0.7, "clouds.top": 5000.0}
gale = {"wind.speed": 16.0, "wind.weather_speed": 16.0, "wind.detail_speed": 21.0}
# Seconds of wind per hour of the day. The time of the wind is scaled by an eighth, against flicker
# in a time-lapse of few frames. Key times are hours since midnight.
WIND = 3600 / 8
weather = nubis.Keyframes(
    [
        (4.0, fair.with_(**{"clouds.coverage": 0.3})),
        (11.0, fair),
        (17.0, fair.with_(**storm, **gale)),
        (22.0, fair.with_(**{"clouds.coverage": 0.35})),
    ],
    easing="smooth",
    seconds=WIND,
)
midnight = datetime(2026, 6, 21, tzinfo=timezone(timedelta(hours=2)))

Path("out").mkdir(exist_ok=True)
camera = nubis.Camera.look_at(eye=(0, 0, 200), target=(-800, 1000, 550), fov_y=65)
renderer = nubis.Renderer(*args.size, quality="draft")
for i in range(args.frames):
    hours = 24 * i / args.frames
    sun = nubis.Sun.at(args.latitude, args.longitude, midnight + timedelta(hours=hours))
    sky = weather.at(hours).replace(sun=sun)
    frame = renderer.render(camera, sky, time=WIND * hours)
    exposure = min(0.7 * nubis.auto_exposure(frame), 6.0)
    nubis.save(f"out/time_lapse_{i:03}.png", frame, exposure=exposure)
