"""Soak test: thousands of animated frames, checked for memory growth, drift and non-finite values.

    python -m benchmarks.soak --frames 10000

Camera, wind, sun and clouds change with every frame. Cuts change place, time, seeds, light model
and projection.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import shlex
import sys
import warnings
from collections.abc import Iterator, Sequence
from math import cos, pi, sin
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from tqdm import tqdm

import nubis
from benchmarks import measure

RESULTS = Path(__file__).parent / "results"
SIZE = 64, 36
#: Frames between two cuts.
SHOT = 250
#: Frames between two readings of memory.
READING = 50
#: Number of repeats of the last shot.
HELD = 64

Shot = tuple[nubis.Camera, nubis.Params, float]


def shot(i: int) -> Shot:
    """The i-th shot of the run. It depends on `i` alone, so that it can be reproduced."""
    scene, since = divmod(i, SHOT)
    rng = np.random.default_rng(scene)
    _, params = list(nubis.scenes.values())[scene % len(nubis.scenes)]
    swing = sin(2 * pi * since / SHOT)
    # A change of sun or altitude rebakes the sky LUTs, which costs more than a small picture.
    bend = swing if scene % 4 == 0 else 0.0
    params = params.with_(
        **{
            "clouds.coverage": 0.5 + 0.3 * swing,
            "clouds.extinction": 0.1 + 0.05 * swing,
            "clouds.seed": scene % 3,
            "weather.seed": int(rng.integers(2**32)),
            "sun.elevation": float(rng.uniform(-5, 60)) + 3 * bend,
            "wind.direction": float(rng.uniform(0, 360)),
            "high_clouds.texture_size": 64,  # a bake of 512 costs ten times as much as the picture
            "light.model": ("thesis2018", "single", "nubis2015", "vsu2022")[scene % 4],
        }
    )
    x, y = rng.uniform(-1e5, 1e5, 2)
    # Altitudes below, inside and above the clouds.
    eye = np.array([x, y + 10.0 * since, rng.uniform(100, 5000) + 200 * bend])
    azimuth = rng.uniform(0, 2 * pi) + 0.004 * since
    ahead = np.array([sin(azimuth), cos(azimuth), 0.15 * swing])
    camera = nubis.Camera.look_at(eye, eye + ahead)
    if scene % 5 == 4:
        camera = nubis.Camera.fisheye(eye)
    return camera, params, float(rng.uniform(0, 1e6)) + since / 24


def run(frames: int) -> dict[str, Any]:
    """Render the frames; return statistics."""
    renderer = nubis.Renderer(*SIZE, quality="draft")
    memory: list[tuple[int, float]] = []
    low, high, broken = np.inf, 0.0, 0
    drifted, compared = 0, 0
    started = perf_counter()

    def shots() -> Iterator[Shot]:
        yield from (shot(i) for i in range(frames))
        yield from [shot(frames - 1)] * HELD

    bar = tqdm(shots(), total=frames + HELD, unit="frame", disable=None)
    for i, frame in enumerate(renderer.animate(bar)):
        broken += not np.isfinite(frame).all()
        low, high = min(low, float(frame.min())), max(high, float(frame[..., :3].max()))
        if i % READING == 0:
            memory.append((i, measure.resident_memory()))
        if i < frames and i % SHOT == 0:
            # A frame after a cut equals the still of a new renderer, without history.
            fresh = nubis.Renderer(*SIZE, quality="draft")
            camera, params, time = shot(i)
            compared += 1
            drifted += frame.tobytes() != fresh.render(camera, params, time=time).tobytes()
    seconds = perf_counter() - started

    last = shot(frames - 1)
    still = renderer.render(last[0], last[1], time=last[2])
    static = next(renderer.animate([last]))
    held = np.sqrt(np.mean((frame - still)[..., :3] ** 2)) / still[..., :3].mean()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        afresh = pool.apply(_afresh, last)
    # The first shots fill caches: growth is measured over the second half of the run.
    index, mib = np.array(memory[len(memory) // 2 :]).T
    return {
        "frames": frames,
        "cuts": (frames - 1) // SHOT,
        "seconds": seconds,
        "broken_frames": int(broken),
        "lowest": low,
        "highest": high,
        "stills_compared": compared,
        "stills_that_differ": int(drifted),
        "still_equals_new_process": still.tobytes() == afresh,
        "static_shot_equals_still": static.tobytes() == still.tobytes(),
        "held_rel_rmse": float(held),
        "held_equals_still": frame.tobytes() == still.tobytes(),
        "held_frames": HELD,
        "memory_mib": memory,
        "memory_growth_mib_per_1000_frames": float(1000 * np.polyfit(index, mib, 1)[0]),
    }


def faults(found: dict[str, Any]) -> list[str]:
    """Descriptions of the failed checks of a run."""
    checks = {
        "a frame is not finite": not found["broken_frames"],
        "radiance is negative": found["lowest"] >= 0,
        "a still after a cut differs from one of a new renderer": not found["stills_that_differ"],
        "the last still differs from one of a new process": found["still_equals_new_process"],
        "a static shot differs from the still": found["static_shot_equals_still"],
        "a held shot stays away from its still": found["held_rel_rmse"] < 0.03,
    }
    return [fault for fault, holds in checks.items() if not holds]


def _afresh(camera: nubis.Camera, params: nubis.Params, time: float) -> bytes:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
        renderer = nubis.Renderer(*SIZE, quality="draft")
    return renderer.render(camera, params, time=time).tobytes()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print and write the results; return 1 if a check fails."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description="A long run.")
    parser.add_argument("--frames", type=int, default=10_000, help="default: 10000")
    parser.add_argument("--out", type=Path, default=RESULTS / "soak.json", metavar="FILE")
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    args = parser.parse_args(arguments)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
        command = f"benchmarks.soak {shlex.join(arguments)}".strip()
        head = measure.header(command.split()) | {"size": SIZE, "quality": "draft"}
        found = run(args.frames)
    wrong = faults(found)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(json.dumps({"header": head, "faults": wrong} | found) + "\n")
    for name, value in found.items():
        if name != "memory_mib":
            print(f"{name}: {value}")
    print("\n".join(wrong) or "nothing is wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
