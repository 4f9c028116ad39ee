"""Transitions of the weather.

A fair sky becomes overcast (a uniform map of one texel) within 30 s; before the end of that
transition, another one to fair weather of another map begins. `renderer.animate` reprojects frames
of these transitions at three frames per second or more; at fewer, each frame is a still.
"""

from pathlib import Path

import numpy as np

import nubis

Path("out").mkdir(exist_ok=True)

camera, params = nubis.scenes["fair_weather"]
overcast = nubis.Weather(map=np.full((1, 1, 3), [0.9, 0.3, 0.0]))
fair = nubis.Weather(noise="perlin_worley", seed=4)
blend = nubis.WeatherBlend(params.weather).change(overcast, at=0.0, seconds=30.0)
blend = blend.change(fair, at=25.0, seconds=20.0)

renderer = nubis.Renderer(320, 180, quality="draft")
for i in range(10):
    time = 5.0 * i
    frame = renderer.render(camera, blend.apply(params, time), time=time)
    nubis.save(f"out/weather_change_{i:02}.png", frame)
