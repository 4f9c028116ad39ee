"""Scaling of the render time: sweeps of vsu2022, tables 2 to 6, and thesis2018, figures 39 and 41.

Published times come from other machines. Comparable are the linearity of a sweep and the ratio of
the times at its end and its start.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

import nubis
from benchmarks.measure import Row, timed
from benchmarks.reference import Size


@dataclass(frozen=True)
class Sweep:
    """A setting, its values, and published milliseconds by value."""

    name: str
    title: str
    knob: str
    values: Sequence[float]
    change: Callable[[Any], dict[str, Any]]
    published: dict[float, float] = field(default_factory=dict)


# Milliseconds of vsu2022 on an RTX 2060. It has up to 250 light steps, `Quality` at most 128.
SWEEPS = (
    Sweep(
        "table 3",
        "time against view steps (vsu2022, table 3)",
        "view steps",
        (50, 100, 150, 200, 250),
        lambda n: {"steps": n},
        {50: 0.2, 100: 0.4, 150: 1.0, 200: 1.6, 250: 2.0},
    ),
    Sweep(
        "table 4",
        "time against coverage (vsu2022, table 4)",
        "coverage",
        (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
        lambda c: {"coverage": c},
        {0.1: 1.3, 0.2: 1.6, 0.5: 2.0, 0.7: 2.2, 1.0: 2.6},
    ),
    Sweep(
        "table 5",
        "time against light steps (vsu2022, table 5)",
        "light steps",
        (25, 50, 75, 100, 125),
        lambda n: {"light_steps": n},
        {50: 1.8, 100: 2.2, 150: 2.7, 200: 3.0, 250: 3.4},
    ),
    *(
        Sweep(
            f"figure 41, 1/{divisor}",
            f"time against view steps at 1/{divisor} of the resolution, overcast (thesis2018)",
            "view steps",
            (32, 64, 96, 128),
            lambda n, divisor=divisor: {
                "base": "thesis2018",
                "steps": n,
                "coverage": 1.0,
                "divisor": divisor,
            },
        )
        for divisor in (1, 2, 3, 4)
    ),
)

# vsu2022, table 6: (view steps, coverage, light steps) -> milliseconds.
FACTORS = {
    (100, 0.3, 100): 0.5,
    (100, 0.3, 200): 0.7,
    (100, 0.8, 100): 0.9,
    (100, 0.8, 200): 1.1,
    (200, 0.3, 100): 0.9,
    (200, 0.3, 200): 1.3,
    (200, 0.8, 100): 2.2,
    (200, 0.8, 200): 2.8,
}

# vsu2022, table 2: milliseconds of each bake. `noise="vsu2022"` bakes the same textures.
BAKES = {"weather": 3.0, "curl": 1.0, "shape": 8.0, "detail": 6.0}


def measure(size: Size, repeats: int, quick: bool = False) -> Row:
    """Measurements and linear fits of all sweeps."""
    sweeps = [replace(SWEEPS[0], values=(50, 100, 150))] if quick else SWEEPS
    factors = [] if quick else FACTORS
    bar = tqdm(total=sum(len(s.values) for s in sweeps) + len(factors), desc="shapes", disable=None)

    def run(**knobs: Any) -> Row:
        row = _render(size, repeats, **knobs)
        bar.update()
        return row

    with bar:
        return {
            "sweeps": [_sweep(sweep, run) for sweep in sweeps],
            "factors": [
                # Half of the published light steps: `Quality` allows at most 128.
                {"steps": n, "coverage": c, "light_steps": m // 2, "published_ms": ms}
                | run(steps=n, coverage=c, light_steps=m // 2)
                for (n, c, m), ms in (FACTORS.items() if factors else ())
            ],
            "bakes": None if quick else _bakes(repeats),
            "switches": [] if quick else _switches(size, repeats),
        }


def fit(x: Sequence[float], y: Sequence[float]) -> dict[str, float]:
    """Linear least-squares fit of points, and its coefficient of determination."""
    slope, intercept = np.polyfit(x, y, 1)
    left = np.asarray(y) - (slope * np.asarray(x) + intercept)
    spread = np.sum((np.asarray(y) - np.mean(y)) ** 2)
    return {
        "slope": float(slope),
        "intercept": float(intercept),
        "r2": float(1 - np.sum(left**2) / spread),
    }


def in_step(samples: npt.NDArray[Any]) -> float:
    """Mean evaluations per pixel if each of eight neighbours in a row costs as much as the maximum.

    lavapipe executes eight invocations in lockstep (256-bit vectors); GPUs have wider groups.
    """
    edge = -samples.shape[1] % 8
    groups = np.pad(samples, ((0, 0), (0, edge))).reshape(len(samples), -1, 8)
    return float(groups.max(axis=-1).sum(dtype=np.int64) * 8 / samples.size)


def _render(
    size: Size,
    repeats: int,
    *,
    base: str = "vsu2022",
    steps: int = 0,
    light_steps: int = 0,
    coverage: float = 0.5,
    divisor: int = 1,
    **switches: Any,
) -> Row:
    quality = nubis.quality(base).replace(**switches)
    if steps:  # toward the horizon; the ratio to those toward the zenith is kept
        zenith = round(steps * quality.steps_zenith / quality.steps_horizon)
        quality = quality.replace(steps_zenith=zenith, steps_horizon=steps)
    if light_steps:
        quality = quality.replace(light_steps=light_steps)
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(
        **{"clouds.coverage": coverage, "light.model": base, "high_clouds.coverage": 0.0}
    )
    renderer = nubis.Renderer(size[0] // divisor, size[1] // divisor, quality=quality)
    times, layers = timed(renderer, camera, params, repeats)
    cloudy = layers["transmittance"] < 0.999
    samples = layers["samples"]
    return times | {
        "evaluations": float(samples.mean()),
        "evaluations_in_step": in_step(samples),
        # Cost of a cloudy pixel; fractions of cloudy and of opaque pixels.
        "evaluations_cloudy": float(samples[cloudy].mean()) if cloudy.any() else 0.0,
        "cloudy": float(cloudy.mean()),
        "opaque": float(np.mean(layers["transmittance"] <= 0)),
    }


def _sweep(sweep: Sweep, run: Callable[..., Row]) -> Row:
    rows = [{"value": v} | run(**sweep.change(v)) for v in sweep.values]
    seconds = [row["seconds"] for row in rows]
    published = sweep.published
    return {
        "name": sweep.name,
        "title": sweep.title,
        "knob": sweep.knob,
        "rows": rows,
        "fit": fit(sweep.values, seconds),
        "fit_of_processor": fit(sweep.values, [row["processor_seconds"] for row in rows]),
        "published_ms": list(published.items()),
        "published_fit": fit(list(published), list(published.values())) if published else None,
    }


def _bakes(repeats: int) -> Row:
    """GPU milliseconds of each noise bake (with timestamps), and wall-clock time of all."""
    renderer = nubis.Renderer(1, 1)
    params = nubis.Params().with_(**{"clouds.noise": "vsu2022", "light.model": "vsu2022"})
    clock, passes = [], []
    for i in range(repeats + 1):
        changed = params.with_(**{"clouds.seed": 100 + i, "weather.seed": 100 + i})
        started = perf_counter()
        renderer.density([[0, 0, 0]], changed)
        clock.append(1000 * (perf_counter() - started))
        passes.append(renderer.timings)
    # The first run compiles.
    names = [name for name in passes[-1] if name in (*BAKES, "downsample")]
    return {
        "clock_ms": float(np.median(clock[1:])),
        "passes_ms": {n: float(np.median([p[n] for p in passes[1:]])) for n in names},
        "published_ms": BAKES,
        "published_clock_ms": 18.3,
    }


def _switches(size: Size, repeats: int) -> list[Row]:
    """thesis2018, figure 39: savings by optimisations. A and C cannot be switched off."""
    off = {"min_transmittance": 0.0, "coarse_step": 1}
    steps = {
        "A, C: light and detail only in cloud": off,
        "B: and early exit": off | {"min_transmittance": 0.01},
        "D: and big steps": {},
    }
    return [
        {"switch": name} | _render(size, repeats, base="thesis2018", **change)
        for name, change in steps.items()
    ]
