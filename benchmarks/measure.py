"""Time and error of methods: one row of results for each scene and method."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from datetime import UTC, datetime
from time import perf_counter, process_time
from typing import Any

import numpy as np
from tqdm import tqdm

import nubis
from benchmarks import metrics, reference
from benchmarks.methods import Method
from benchmarks.metrics import Layers
from benchmarks.reference import Size

Row = dict[str, Any]


def timed(
    renderer: nubis.Renderer, camera: nubis.Camera, params: nubis.Params, repeats: int
) -> tuple[Row, Layers]:
    """Render once to bake, compile and see the layers, then `repeats` times by the clock."""
    started = perf_counter()
    layers = renderer.render_layers(camera, params)
    first = perf_counter() - started
    seconds, processor = [], []
    for _ in range(repeats):
        started, used = perf_counter(), process_time()
        renderer.render(camera, params)
        seconds.append(perf_counter() - started)
        processor.append(process_time() - used)
    median = float(np.median(seconds))
    times = {
        "seconds": median,
        "seconds_p95": float(np.percentile(seconds, 95)),
        "setup_seconds": first - median,
        # Of all threads: on a software adapter this is what others on the machine do not disturb.
        "processor_seconds": float(np.median(processor)),
    }
    return times, layers


def measure(scenes: Iterable[str], methods: list[Method], size: Size, repeats: int) -> list[Row]:
    """Return a row for each scene and method; methods that are the same are measured once."""
    rows = []
    for scene in tqdm(scenes, unit="scene", disable=None):
        truth = reference.reference_layers(scene, size)
        known: dict[Any, Row] = {}
        for method in tqdm(methods, desc=scene, unit="method", leave=False, disable=None):
            same = method.quality, method.divisor
            if same not in known:
                known[same] = _measure(scene, method, truth, size, repeats)
            rows.append(
                {
                    "scene": scene,
                    "method": method.name,
                    "family": method.family,
                    "value": method.value,
                    "steps_zenith": method.quality.steps_zenith,
                    "steps_horizon": method.quality.steps_horizon,
                    "light_steps": method.quality.light_steps,
                    "divisor": method.divisor,
                    "width": size[0],
                    "height": size[1],
                    "repeats": repeats,
                    **known[same],
                }
            )
    return rows


def _measure(scene: str, method: Method, truth: Layers, size: Size, repeats: int) -> Row:
    width, height = (n // method.divisor for n in size)
    renderer = nubis.Renderer(width, height, quality=method.quality)
    times, layers = timed(renderer, *nubis.scenes[scene], repeats)
    pixels = size[0] * size[1]
    row = {**times, "evaluations": float(layers["samples"].sum(dtype=np.int64) / pixels)}
    if method.divisor > 1:
        layers = {
            name: metrics.enlarge(layers[name], method.divisor)
            for name in ("radiance", "transmittance")
        }
    return row | metrics.errors(layers, truth)


def header(command: list[str]) -> Row:
    """On what the numbers were measured."""
    return {
        "version": nubis.__version__,
        "shaders": reference.shader_hash(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "adapter": nubis.Renderer(1, 1).adapter._asdict(),
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "platform": platform.platform(),
        "command": " ".join(["python -m", *command]),
    }


def marched() -> list[str]:
    """The scenes in which there is anything to march."""
    return [name for name, (_, params) in nubis.scenes.items() if params.clouds.coverage > 0]


def seeds(scenes: Iterable[str]) -> dict[str, dict[str, int]]:
    """The random seeds of the scenes' skies."""
    blocks = "clouds", "weather", "high_clouds"
    return {s: {b: getattr(nubis.scenes[s][1], b).seed for b in blocks} for s in scenes}


def _cpu() -> str:
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":")[1].strip() for line in file if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
