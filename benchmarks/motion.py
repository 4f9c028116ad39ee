"""Error of frames of `animate`, in comparison with stills of the same quality.

Five scenes and five motions are measured. The reference of a frame is a still of the same shot in
`high`; a still of the quality of the frame is compared with it, too.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

import nubis
from benchmarks import measure, page
from benchmarks.reference import Size

Row = dict[str, Any]
Shot = tuple[nubis.Camera, nubis.Params, float]
Picture = npt.NDArray[np.float32]

RESULTS = Path(__file__).parent / "results"

SCENES = "fair_weather", "stratocumulus", "storm", "sunset", "above"
MOTIONS = "held", "flight", "turn", "time lapse", "sun"
#: Indices of the measured frames; every pixel has been marched after 16 frames.
FRAMES = 9, 18
TRUTH = "high"


def shots(scene: str, motion: str) -> Iterator[Shot]:
    """Shots of a motion. Per frame: none, 5 m ahead, 5 degrees right, 60 s, sun up 0.25 degrees."""
    camera, params = nubis.scenes[scene]
    params = params.with_(**{"high_clouds.coverage": 0.0, "sun.visible": False})
    eye, forward = np.array(camera.eye), np.array(camera.forward)
    level = forward * (1, 1, 0) / np.linalg.norm(forward[:2])
    for i in range(FRAMES[-1] + 1):
        at, ahead, sky, time = eye, forward, params, i / 24
        if motion == "held":
            time = 0.0
        elif motion == "flight":
            at = eye + 5.0 * i * level
        elif motion == "turn":
            c, s = cos(radians(5.0 * i)), sin(radians(5.0 * i))
            ahead = np.array(
                (c * forward[0] + s * forward[1], c * forward[1] - s * forward[0], forward[2])
            )
        elif motion == "time lapse":
            time = 60.0 * i
        elif motion == "sun":
            time = 0.0
            sky = params.with_(**{"sun.elevation": params.sun.elevation + 0.25 * i})
        yield nubis.Camera.look_at(at, at + ahead, fov_y=camera.fov), sky, time


def rmse(test: Picture, reference: Picture) -> float:
    """RMSE of the radiance, relative to the root mean square of the reference."""
    x, r = test[..., :3].astype(float), reference[..., :3].astype(float)
    return float(np.sqrt(np.sum((x - r) ** 2) / np.sum(r**2)))


def darkened(frame: Picture, still: Picture) -> int:
    """Number of pixels darker than half the minimum of the still in a 3 x 3 neighbourhood."""
    height, width = still.shape[:2]
    padded = np.pad(still[..., :3].max(axis=-1), 1, mode="edge")
    around = [padded[y : y + height, x : x + width] for x in range(3) for y in range(3)]
    return int((frame[..., :3].max(axis=-1) < 0.5 * np.min(around, axis=0)).sum())


def row(size: Size, scene: str, motion: str, quality: str, strip: list[Picture]) -> Row:
    """Errors of one motion in one scene; its last three frames are appended to `strip`."""
    film = list(shots(scene, motion))
    other = nubis.Renderer(*size, quality=quality)
    truth = nubis.Renderer(*size, quality=TRUTH)
    found: dict[str, list[float]] = {"still": [], "frame": [], "apart": [], "dark": []}
    frames = nubis.Renderer(*size, quality=quality).animate(film)
    for i, (frame, (camera, params, time)) in enumerate(zip(frames, film, strict=True)):
        if i >= FRAMES[-1] - 2:
            strip.append(frame)
        if i in FRAMES:
            still = other.render(camera, params, time=time)
            best = truth.render(camera, params, time=time)
            found["still"].append(rmse(still, best))
            found["frame"].append(rmse(frame, best))
            found["apart"].append(rmse(frame, still))
            found["dark"].append(darkened(frame, still))
    about: Row = {"scene": scene, "motion": motion, "quality": quality}
    return about | {key: float(np.mean(values)) for key, values in found.items()}


def run(size: Size, qualities: tuple[str, ...], plots: Path | None = None) -> list[Row]:
    """All rows. With `plots`, motion.png shows the last three frames of every motion."""
    rows, strips = [], []
    work = [(s, m, q) for q in qualities for s in SCENES for m in MOTIONS]
    for scene, motion, quality in tqdm(work, unit="flight", disable=None):
        strip: list[Picture] = []
        rows.append(row(size, scene, motion, quality, strip))
        if quality == qualities[0] and motion != "held":
            strips.append(np.concatenate(strip, axis=1))
    if plots is not None:
        half = np.concatenate([strip[::2, ::2] for strip in strips], axis=0)
        nubis.save(plots / "motion.png", half)
    return rows


def main() -> None:
    """Measure, write benchmarks/results/motion.json, and update docs/accuracy.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.motion", description=__doc__)
    parser.add_argument("--size", default="480x270", metavar="WxH")
    parser.add_argument("--qualities", nargs="+", default=["draft", "balanced"])
    parser.add_argument("--out", type=Path, default=RESULTS / "motion.json")
    args = parser.parse_args()
    width, height = (int(n) for n in args.size.split("x"))
    command = ["benchmarks.motion", "--size", args.size, "--qualities", *args.qualities]
    header = measure.header(command) | {"size": (width, height)}
    plots = args.out.parent / "plots"
    plots.mkdir(parents=True, exist_ok=True)
    rows = run((width, height), tuple(args.qualities), plots)
    args.out.write_text(json.dumps({"header": header, "rows": rows}, indent=1) + "\n")
    if args.out.parent.resolve() == RESULTS:
        page.write(RESULTS)


if __name__ == "__main__":
    main()
