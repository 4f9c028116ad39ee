"""Numerical error of the named qualities, over the scenes and over random skies.

    python -m benchmarks.skies                       # nine scenes and twenty skies, half an hour
    python -m benchmarks.skies --seed 7 --count 40

Cameras stand near the ground, fly at 9 km or are inside the clouds; half of the suns are 3 to 10
degrees high. A picture is compared with a converged march (``quality="reference"``) of the same
light model in two light fields: the quality's own, which leaves the error of the march, and that of
the reference.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

import nubis
from benchmarks import measure
from benchmarks.metrics import CLOUD, Layers

QUALITIES = "draft", "balanced", "high"
#: Angle to the sun within which a pixel shows its aureole, degrees.
AUREOLE = 10.0


def random_sky(rng: np.random.Generator) -> tuple[nubis.Camera, nubis.Params]:
    """A sky, a camera and a sun."""
    base = float(rng.uniform(600, 2000))
    top = base + float(rng.uniform(800, 2500))
    elevation = float(rng.uniform(3, 10) if rng.random() < 0.5 else rng.uniform(10, 80))
    changes: dict[str, Any] = {
        "clouds.base": base,
        "clouds.top": top,
        "clouds.cumulonimbus_top": max(8000.0, top),
        "clouds.coverage": float(rng.uniform(0.3, 0.8)),
        "clouds.type": float(rng.uniform(0, 1)),
        "clouds.precipitation": float(rng.uniform(0, 1)) if rng.random() < 0.3 else 0.0,
        "upper_clouds.coverage": float(rng.uniform(0.3, 0.7)) if rng.random() < 0.3 else 0.0,
        "weather.seed": int(rng.integers(1000)),
        "sun.elevation": elevation,
        "sun.azimuth": float(rng.uniform(0, 360)),
    }
    height, pitch = (
        (200.0, rng.uniform(5, 30)),
        (9000.0, rng.uniform(-30, -5)),
        (0.5 * (base + top), rng.uniform(-20, 20)),
    )[rng.integers(3)]
    azimuth, pitch = np.radians((rng.uniform(0, 360), pitch))
    ahead = np.cos(pitch) * np.sin(azimuth), np.cos(pitch) * np.cos(azimuth), np.sin(pitch)
    eye = np.array([*rng.uniform(-20_000, 20_000, 2), height])
    camera = nubis.Camera.look_at(tuple(eye), tuple(eye + 1000 * np.array(ahead)), fov_y=50)
    return camera, nubis.Params().with_(**changes)


def near_sun(camera: nubis.Camera, params: nubis.Params, size: tuple[int, int]) -> npt.NDArray[Any]:
    """Pixels that show the sun's aureole."""
    width, height = size
    tan = np.tan(np.radians(camera.fov) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * tan * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tan
    right, up, forward = (np.array(axis) for axis in (camera.right, camera.up, camera.forward))
    rays = forward + x[None, :, None] * right + y[:, None, None] * up
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    elevation, azimuth = np.radians((params.sun.elevation, params.sun.azimuth))
    level = np.cos(elevation)
    sun = np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])
    return rays @ sun > np.cos(np.radians(AUREOLE))


def error(got: Layers, want: Layers, mask: npt.NDArray[Any]) -> float:
    """Relative RMSE of the radiance of clouds in some pixels; NaN without clouds."""
    seen = mask & (want["transmittance"] < np.exp(-CLOUD))
    if seen.mean() < 0.01:
        return np.nan
    got, want = (layers["radiance"][seen].astype(float) for layers in (got, want))
    return float(np.sqrt(np.mean((got - want) ** 2)) / want.mean())


def errors(
    camera: nubis.Camera, params: nubis.Params, size: tuple[int, int]
) -> Iterator[tuple[str, list[float]]]:
    """Errors of each quality: in its own field, with and without the aureole, and in the
    reference's field.
    """
    reference = nubis.quality("reference")
    whole = np.ones(size[::-1], bool)
    aureole = near_sun(camera, params, size)

    @functools.cache
    def rendered(quality: nubis.Quality) -> Layers:
        return nubis.Renderer(*size, quality=quality).render_layers(camera, params)

    for name in QUALITIES:
        quality = nubis.quality(name)
        cells = {"field_cells": quality.field_cells, "field_cell": quality.field_cell}
        got, own, best = map(rendered, (quality, reference.replace(**cells), reference))
        yield (
            name,
            [error(got, own, whole), error(got, own, ~aureole), error(got, best, whole)],
        )


def main() -> None:
    """Print the errors of each sky, and the geometric means and worst as lines of a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="64x40", help="pixels")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20, help="number of random skies")
    parser.add_argument("--scenes", nargs="*", default=measure.marched())
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    cases = [(name, *nubis.scenes[name]) for name in args.scenes]
    rng = np.random.default_rng(args.seed)
    cases += [(f"sky {i}", *random_sky(rng)) for i in range(args.count)]
    found: dict[str, list[list[float]]] = {name: [] for name in QUALITIES}
    for name, camera, params in cases:
        for quality, row in errors(camera, params, (width, height)):
            found[quality].append(row)
            print(f"{name}, {quality}:", *(f"{100 * e:.2f} %" for e in row), flush=True)
    print("| quality | own field | without the aureole | field of the reference |")
    for quality, rows in found.items():
        table = np.array(rows)
        means = np.exp(np.nanmean(np.log(np.maximum(table, 1e-6)), axis=0))
        cells = (
            f"{100 * m:.2g} / {100 * w:.2g} %"
            for m, w in zip(means, np.nanmax(table, axis=0), strict=True)
        )
        print(f"| `{quality}` |", " | ".join(cells), "|")


if __name__ == "__main__":
    main()
