"""Fit of the constants of the light model ``"octaves"`` to the path tracer, and its residual error.

    python -m benchmarks.octaves

Cases: clouds of three scenes on grids, four positions of the sun, two phase functions. The sun is
the only light; the surroundings are black.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from tqdm import tqdm

import nubis
from benchmarks import measure
from benchmarks.__main__ import RESULTS

Array = npt.NDArray[np.floating[Any]]

SIZE = 32, 24
TILE = 4
#: Azimuth and elevation of the sun; the camera looks north.
SUNS = {"behind": (190.0, 35.0), "beside": (80.0, 30.0), "against": (10.0, 25.0), "above": (0, 75)}
G = 0.6, 0.85
#: Scene of each cloud, and the width of its box in metres.
CLOUDS = {
    "cumulus": ("fair_weather", 3000.0),
    "deck": ("stratocumulus", 4000.0),
    "tower": ("storm", 5000.0),
}
#: Extinction factors for which sunlight is rendered; it is interpolated between them.
SHARES = np.geomspace(1.0, 0.002, 14)
COUNTS = 3, 8
USUAL = 0.5, 0.5, 0.5


@dataclass
class Case:
    name: str
    camera: nubis.Camera
    params: nubis.Params
    truth: Array  # tile means of the reference
    noise: Array  # their standard errors
    light: Array  # by factor and tile: integral of weight * exp(-factor * depth) / 4 pi
    phase: Array  # cosine of the scattering angle by tile


def grid(name: str) -> nubis.DensityGrid:
    """The cloud of largest column density of a scene within 12 km, sampled on a grid."""
    scene, width = CLOUDS[name]
    params = nubis.scenes[scene][1]
    base, top = params.clouds.base, params.clouds.top
    ask = nubis.Renderer(1, 1).density
    x = np.arange(-12_000, 12_000, 400.0)
    z = np.linspace(base, top, 16)
    points = np.stack(np.meshgrid(x, x, z, indexing="ij"), axis=-1)
    columns = ask(points.reshape(-1, 3), params).reshape(points.shape[:3]).sum(axis=2)
    i, j = np.unravel_index(columns.argmax(), columns.shape)
    across, up = 56, 40
    low = np.array([x[i] - width / 2, x[j] - width / 2, base])
    high = np.array([x[i] + width / 2, x[j] + width / 2, top])
    steps = [(np.arange(n) + 0.5) / n for n in (across, across, up)]
    w, v, u = np.meshgrid(steps[2], steps[1], steps[0], indexing="ij")
    inside = low + np.stack([u, v, w], axis=-1) * (high - low)
    extinction = ask(inside.reshape(-1, 3), params).reshape(up, across, across)
    return nubis.DensityGrid(extinction, (tuple(low), tuple(high)))


def tiles(image: Array) -> Array:
    """Means of square tiles, flattened."""
    height, width = image.shape[0] // TILE, image.shape[1] // TILE
    return image.reshape(height, TILE, width, TILE).mean(axis=(1, 3), dtype=np.float64).ravel()


def cases(samples: int) -> list[Case]:
    """Path-traced references of all cases, and the renders that the fit needs."""
    found = []
    for name in CLOUDS:
        volume = grid(name)
        low, high = map(np.array, volume.bounds)
        middle = (low + high) / 2
        eye = middle - [0, 1.6 * (high - low)[0], 0.25 * (high - low)[2]]
        camera = nubis.Camera.look_at(eye, middle, (0, 0, 1), 34)
        for (sun, (azimuth, elevation)), g in tqdm(list(product(SUNS.items(), G)), desc=name):
            params = (
                nubis.Params()
                .replace(volume=volume)
                .with_(
                    **{
                        "sun.azimuth": azimuth,
                        "sun.elevation": elevation,
                        "sun.visible": False,
                        "sun.irradiance": (1.0, 1.0, 1.0),
                        "atmosphere.enabled": False,
                        "high_clouds.coverage": 0.0,
                        "light.g": g,
                    }
                )
            )
            traced = nubis.quality("balanced").replace(integrator="path", path_samples=samples)
            layers = nubis.Renderer(*SIZE, quality=traced).render_layers(camera, params)
            cloudy = tiles(layers["transmittance"]) < np.exp(-0.5)
            truth = tiles(layers["radiance"][..., 0])
            noise = np.sqrt(tiles(layers["standard_error"][..., 0] ** 2) / TILE**2)
            light = [tiles(_sunlight(camera, params, share)) for share in SHARES]
            cosine = tiles(_directions(camera) @ _sun(azimuth, elevation))
            found.append(
                Case(
                    f"{name}, sun {sun}, g {g}",
                    camera,
                    params,
                    truth[cloudy],
                    noise[cloudy],
                    np.array(light)[:, cloudy],
                    cosine[cloudy],
                )
            )
    return found


def _sunlight(camera: nubis.Camera, params: nubis.Params, share: float) -> Array:
    """Radiance of isotropic single scattering, with a factor on the extinction toward the sun."""
    sky = params.with_(
        **{
            "light.model": "nubis2015",
            "light.absorption": share,
            "light.powder": 0.0,
            "light.sun_gain": 0.5,
            "light.g": 0.0,
            "light.ambient_gain": 0.0,
        }
    )
    return nubis.Renderer(*SIZE, quality="high").render_layers(camera, sky)["radiance"][..., 0]


def _directions(camera: nubis.Camera) -> Array:
    tan = np.tan(np.radians(camera.fov) / 2)
    x = (2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 1) * tan * SIZE[0] / SIZE[1]
    y = (1 - 2 * (np.arange(SIZE[1]) + 0.5) / SIZE[1]) * tan
    x, y = np.meshgrid(x, y)
    right, up, forward = (np.array(v) for v in (camera.right, camera.up, camera.forward))
    d = x[..., None] * right + y[..., None] * up + forward
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def _sun(azimuth: float, elevation: float) -> Array:
    a, e = np.radians([azimuth, elevation])
    return np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])


def model(case: Case, constants: Array, count: int) -> Array:
    """Tiles of the model ``"octaves"`` for some constants, from the renders of a case."""
    a, b, c = constants
    g = case.params.light.g
    total = np.zeros(case.truth.shape)
    for i in range(count):
        share = max(b**i, SHARES[-1])
        k = np.interp(-np.log(share), -np.log(SHARES), np.arange(len(SHARES)))
        low = min(int(k), len(SHARES) - 2)
        light = case.light[low] + (k - low) * (case.light[low + 1] - case.light[low])
        gi = g * c**i
        phase = (1 - gi**2) / (1 + gi**2 - 2 * gi * case.phase) ** 1.5
        total += a**i * phase * light
    return case.params.light.albedo * total


def error(image: Array, case: Case) -> dict[str, float]:
    """Relative RMS error less the noise of the reference, RMSE over the mean, relative bias."""
    relative = np.mean(((image - case.truth) / case.truth) ** 2 - (case.noise / case.truth) ** 2)
    return {
        "rms_relative": float(np.sqrt(max(relative, 0.0))),
        "rel_rmse": float(np.sqrt(np.mean((image - case.truth) ** 2)) / case.truth.mean()),
        "bias": float(image.mean() / case.truth.mean() - 1),
    }


def fit(found: list[Case], count: int) -> Array:
    """Constants that minimise the mean square of the relative RMSE over all cases."""

    def loss(logits: Array) -> float:
        constants = 1 / (1 + np.exp(-logits))
        return float(
            np.mean([error(model(c, constants, count), c)["rel_rmse"] ** 2 for c in found])
        )

    starts = [np.full(3, 0.0), np.array([0.5, -1.5, 0.5]), np.array([1.5, -0.5, 1.0])]
    best = min((minimize(loss, s, method="Nelder-Mead") for s in starts), key=lambda r: r.fun)
    return np.asarray(1 / (1 + np.exp(-best.x)))


def rendered(case: Case, constants: Array, count: int) -> dict[str, float]:
    """Error metrics of a render with the model ``"octaves"``."""
    names = "octave_scattering", "octave_extinction", "octave_phase"
    values = {f"light.{n}": float(v) for n, v in zip(names, constants, strict=True)}
    params = case.params.with_(**values, **{"light.model": "octaves", "light.octaves": count})
    layers = nubis.Renderer(*SIZE, quality="high").render_layers(case.camera, params)
    cloudy = tiles(layers["transmittance"]) < np.exp(-0.5)
    image = tiles(layers["radiance"][..., 0])
    return error(image[cloudy], case) if cloudy.sum() == len(case.truth) else {}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.octaves", description=__doc__)
    parser.add_argument("--samples", type=int, default=512, help="paths a pixel (default: 512)")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    found = cases(args.samples)
    rows = []
    fits = {count: fit(found, count) for count in COUNTS}
    chosen = [(1, np.array(USUAL), "single scattering")]
    chosen += [(n, np.array(USUAL), "usual") for n in COUNTS]
    chosen += [(n, fits[n], "fitted") for n in COUNTS]
    for count, constants, what in chosen:
        errors = [rendered(case, constants, count) for case in found]
        kept = [e for e in errors if e]
        mean = {key: float(np.mean([e[key] for e in kept])) for key in kept[0]}
        mean["bias_rms"] = float(np.sqrt(np.mean([e["bias"] ** 2 for e in kept])))
        mean["worst_rel_rmse"] = max(e["rel_rmse"] for e in kept)
        rows.append({"octaves": count, "constants": constants.tolist(), "what": what, **mean})
    noise = float(np.mean([np.sqrt(np.mean((c.noise / c.truth) ** 2)) for c in found]))
    head = measure.header(["benchmarks.octaves", *sys.argv[1:]]) | {
        "size": SIZE,
        "samples": args.samples,
    }
    result = {"header": head, "cases": [c.name for c in found], "noise": noise, "rows": rows}
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "octaves.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
