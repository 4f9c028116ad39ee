"""Measurement of methods: one row of times and errors per scene and method."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
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
    """Times of `repeats` renders, after one warm-up for bakes, compilation and the layers."""
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
        # CPU time of all threads: on a software adapter it is independent of the machine's load.
        "processor_seconds": float(np.median(processor)),
    }
    return times, layers


def measure(scenes: Iterable[str], methods: list[Method], size: Size, repeats: int) -> list[Row]:
    """Return a row per scene and method. Identical methods are measured once."""
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
    """Machine, adapter, version and command of a measurement."""
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


def resident_memory() -> float:
    """MiB of memory that the process holds; NaN where there is no /proc."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return float("nan")
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def marched() -> list[str]:
    """Names of the scenes with volumetric clouds."""
    return [name for name, (_, params) in nubis.scenes.items() if params.clouds.coverage > 0]


def seeds(scenes: Iterable[str]) -> dict[str, dict[str, int]]:
    """Random seeds of the scenes."""
    blocks = "clouds", "weather", "high_clouds"
    return {s: {b: getattr(nubis.scenes[s][1], b).seed for b in blocks} for s in scenes}


def _cpu() -> str:
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":")[1].strip() for line in file if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
