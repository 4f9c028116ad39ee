"""Gain of each switch that kernels are specialized for.

    python -m benchmarks.switches

A sky without what a switch stands for is rendered twice, by the specialized kernels and by kernels
that hold the code of the switch nevertheless: in a copy of the shaders its `override` is a constant
`true`. Printed: GPU time of the second over the first, of a still in `balanced` and of a frame in
`draft`, and the largest difference of the stills.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from tqdm import tqdm

import nubis
from benchmarks.reference import ROOT

SIZE = 640, 360
REPEATS = 12
SWITCHES = (
    "KEEP_CLEAR",
    "RAINY",
    "RAIN_SHAFTS",
    "UPPER",
    "LARGE_SCALE_WEATHER",
    "LIGHT_SHAFTS",
    "SUBRAYS",
    "HIGH",
    "HIGH_EMBOSS",
    "HIGH_LOW_SUN",
    "LAYERS",
    "WIDE",
)
#: Nothing that a switch stands for.
PLAIN = {
    "clouds.precipitation": 0.0,
    "weather.broad_variety": 0.0,
    "high_clouds.coverage": 0.0,
    "atmosphere.light_shafts": False,
    "atmosphere.ground_shadows": False,
    "sun.visible": False,
}


def measure() -> None:
    """Print milliseconds of a still and of a frame, and save the still, in a process of its own."""
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(**PLAIN)
    still = nubis.Renderer(*SIZE, quality="balanced")
    flight = nubis.Renderer(*SIZE, quality="draft")
    np.save(sys.argv[2], still.render(camera, params))
    times: dict[str, list[float]] = {"still": [], "frame": []}
    frames = flight.animate((camera, params, k / 30) for k in range(REPEATS + 4))
    for _ in range(4):
        next(frames)
    for _ in frames:
        still.render(camera, params)
        for kind, renderer in (("still", still), ("frame", flight)):
            times[kind].append(sum(renderer.timings.values()))
    print(json.dumps({kind: min(taken) for kind, taken in times.items()}))


def run(folder: Path, picture: Path) -> dict[str, float]:
    """Milliseconds by the shaders of a folder."""
    command = [sys.executable, "-m", "benchmarks.switches", "--measure", str(picture)]
    environment = os.environ | {"NUBIS_SHADERS": str(folder)}
    out = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return dict(json.loads(out.stdout))


def forced(source: Path, folder: Path, switch: str) -> None:
    """Copy the shaders with a switch that is always on."""
    found = 0
    for path in source.rglob("*.wgsl"):
        pattern = rf"^override {switch}: bool = (true|false);"
        text, count = re.subn(pattern, f"const {switch} = true;", path.read_text(), flags=re.M)
        found += count
        copy = folder / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(text)
    if found != 1:
        raise ValueError(f"{switch} is declared {found} times")


def main() -> None:
    source = ROOT / "shaders" / "wgsl"
    with tempfile.TemporaryDirectory() as temporary:
        plain, picture = Path(temporary) / "plain.npy", Path(temporary) / "picture.npy"
        before = run(source, plain)
        print("| switch | still | frame | largest difference |\n| --- | --- | --- | --- |")
        for switch in tqdm(SWITCHES, leave=False):
            folder = Path(temporary) / switch
            forced(source, folder, switch)
            time = run(folder, picture)
            after = run(source, plain)
            still, frame = (2 * time[k] / (before[k] + after[k]) for k in ("still", "frame"))
            before = after
            difference = np.abs(np.load(picture) - np.load(plain)).max()
            tqdm.write(f"| `{switch}` | {still:.2f} | {frame:.2f} | {difference:.0e} |")


if __name__ == "__main__":
    measure() if sys.argv[1:2] == ["--measure"] else main()
