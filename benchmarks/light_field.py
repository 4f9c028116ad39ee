"""Light models against path-traced skies.

    python -m benchmarks.light_field                     # errors of the light models
    python -m benchmarks.light_field --truth --paths 256 # path-traces the skies, an hour
    python -m benchmarks.light_field --speed             # times of the field, and of animations

The path tracer of this project traces every order of scattering in the same clouds. The sun is the
only light; ground and sky are black. Compared are means of 8 x 8 pixels that show clouds.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

import nubis
from benchmarks import measure

Array = npt.NDArray[np.floating[Any]]

SIZE = 96, 64
TILE = 8
#: Elevation of the sun, and its azimuth from the direction of view, in degrees.
SUNS = (60.0, 45.0), (25.0, 135.0), (5.0, 100.0)
SCENES = "fair_weather", "stratocumulus", "storm"
#: Mean cosine of the phase function (Henyey-Greenstein): that of cloud droplets.
G = 0.85
STORE = Path(__file__).parents[1] / "tests" / "references" / "light_field_skies.npz"
#: Opacity from which on a tile is compared.
CLOUDY = 0.3


def sky(scene: str, elevation: float, beside: float) -> tuple[nubis.Camera, nubis.Params]:
    """Camera and sky of a case, with the light model `octaves`."""
    camera, params = nubis.scenes[scene]
    east, north, _ = camera.forward
    return camera, params.with_(
        **{
            "light.model": "octaves",
            "light.g": G,
            "high_clouds.coverage": 0.0,
            "atmosphere.enabled": False,
            "atmosphere.ground_albedo": (0.0, 0.0, 0.0),
            "sun.irradiance": (1.0, 1.0, 1.0),
            "sun.elevation": elevation,
            "sun.azimuth": float((np.degrees(np.arctan2(east, north)) + beside) % 360),
        }
    )


def tiles(image: Array) -> Array:
    """Means of tiles of an (H, W) image."""
    width, height = SIZE
    parts = image.astype(float).reshape(height // TILE, TILE, width // TILE, TILE)
    return parts.mean((1, 3))


def traced(scene: str, sun: tuple[float, float], paths: int) -> dict[str, Array]:
    """Path-traced tiles of a case: radiance, its standard error, opacity."""
    quality = nubis.quality("balanced").replace(integrator="path", path_samples=paths)
    camera, params = sky(scene, *sun)
    layers = nubis.Renderer(*SIZE, quality=quality).render_layers(camera, params)
    error = np.sqrt(tiles(layers["standard_error"][..., 0].astype(float) ** 2)) / TILE
    return {
        "radiance": tiles(layers["radiance"][..., 0]),
        "error": error,
        "opacity": tiles(1 - layers["transmittance"]),
    }


def name(scene: str, sun: tuple[float, float]) -> str:
    return f"{scene} {sun[0]:.0f}"


def store(paths: int) -> None:
    """Traces the cases that the store lacks."""
    found = dict(np.load(STORE)) if STORE.exists() else {}
    for sun in SUNS:
        for scene in SCENES:
            if f"{name(scene, sun)} radiance" not in found:
                for key, value in traced(scene, sun, paths).items():
                    found[f"{name(scene, sun)} {key}"] = value.astype(np.float32)
                np.savez_compressed(STORE, **found)
                print(name(scene, sun), flush=True)


def errors(model: str, g: float, scene: str, sun: tuple[float, float], quality: str) -> Array:
    """Errors of a light model in a case: weighted by brightness (RMSE over mean), the same of the
    truth's own noise, rms of the tiles' relative errors, bias of the mean.
    """
    truth = np.load(STORE)
    radiance, noise, opacity = (
        truth[f"{name(scene, sun)} {key}"] for key in ("radiance", "error", "opacity")
    )
    camera, params = sky(scene, *sun)
    params = params.with_(**{"light.model": model, "light.g": g})
    layers = nubis.Renderer(*SIZE, quality=quality).render_layers(camera, params)
    seen = opacity > CLOUDY
    got, want, noise = tiles(layers["radiance"][..., 0])[seen], radiance[seen], noise[seen]
    weighted = np.mean((got - want) ** 2 - noise**2)
    relative = np.mean((got / want - 1) ** 2 - (noise / want) ** 2)
    return np.array(
        [
            np.sqrt(max(weighted, 0)) / want.mean(),
            np.sqrt(np.mean(noise**2)) / want.mean(),
            np.sqrt(max(relative, 0)),
            got.mean() / want.mean() - 1,
        ]
    )


def solved_in(scene: str, quality: str, size: tuple[int, int]) -> float:
    """Seconds that a new sun adds to a picture: the least of four."""
    camera, params = nubis.scenes[scene]
    params = params.with_(**{"light.model": "multiple", "light.g": G})
    renderer = nubis.Renderer(*size, quality=quality)
    new, same = [], []
    for i in range(4):
        turned = params.with_(**{"sun.azimuth": 10.0 + i})
        for times in (new, same):
            started = perf_counter()
            renderer.render(camera, turned)
            times.append(perf_counter() - started)
    return min(new) - min(same)


def frames_in(scene: str, quality: str, what: str, model: str) -> float:
    """Mean seconds of ten frames of 640 x 360: a sun that rises by 0.05 degrees a frame, a lapse of
    10 s a frame, or a flight of 5 m a frame.
    """
    camera, params = nubis.scenes[scene]
    params = params.with_(**{"light.model": model, "light.g": G if model == "multiple" else 0.6})

    def shots() -> Iterator[tuple[nubis.Camera, nubis.Params, float]]:
        for i in range(14):
            flown = 5.0 * i if what == "flight" else 0.0
            eye = np.add(camera.eye, [flown, 0.0, 0.0])
            sun = params.sun.elevation + (0.05 * i if what == "sun" else 0.0)
            yield (
                nubis.Camera.look_at(eye, eye + camera.forward),
                params.with_(**{"sun.elevation": sun}),
                10.0 * i if what == "lapse" else i / 30,
            )

    times = [perf_counter()]
    for _ in nubis.Renderer(640, 360, quality=quality).animate(shots()):
        times.append(perf_counter())
    return float(np.mean(np.diff(times)[4:]))


def speed() -> None:
    """Prints the times of the field and of animations."""
    kinds = "sun", "lapse", "flight"
    print("| sky, quality | field, s | " + " | ".join(f"{kind}, ms" for kind in kinds) + " |")
    print("| --- | ---: |" + " ---: |" * len(kinds))
    for scene in ("fair_weather", "storm"):
        for quality in ("draft", "balanced", "high"):
            cells = []
            for kind in kinds:
                octaves, field = (
                    frames_in(scene, quality, kind, model) for model in ("octaves", "multiple")
                )
                cells.append(f"{1000 * field:.0f}, {field / octaves:.2f}")
            solved = solved_in(scene, quality, (640, 360))
            print(
                f"| {scene}, `{quality}` | {solved:.2f} | " + " | ".join(cells) + " |", flush=True
            )
    small = solved_in("fair_weather", "balanced", (64, 36))
    print(f"| fair_weather, `balanced`, 64×36 | {small:.2f} | | | |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--speed", action="store_true", help="print times instead of errors")
    parser.add_argument("--truth", action="store_true", help="trace the skies that are missing")
    parser.add_argument("--paths", type=int, default=256)
    parser.add_argument("--quality", default="high")
    arguments = parser.parse_args()
    if arguments.truth:
        store(arguments.paths)
        return
    made = measure.header(["benchmarks.light_field"])
    adapter = made["adapter"]
    machine = f"{made['cpu']}, {made['cores']} cores"
    print(f"{made['date']}, {adapter['name']} ({adapter['driver']}), {machine}")
    if arguments.speed:
        speed()
        return
    truth = np.load(STORE)
    models = ("single", G), ("octaves", 0.6), ("octaves", G), ("multiple", G)
    print("| sky, sun | noise | " + " | ".join(f"{m}, g {g}" for m, g in models) + " |")
    print("| --- | ---: |" + " ---: |" * len(models))
    for sun in SUNS:
        for scene in SCENES:
            if f"{name(scene, sun)} radiance" not in truth:
                continue
            cells = [errors(m, g, scene, sun, arguments.quality) for m, g in models]
            texts = [f"{w:.2f} / {e:.2f} / {b:+.2f}" for w, _, e, b in cells]
            print(f"| {name(scene, sun)}° | {cells[0][1]:.2f} | " + " | ".join(texts) + " |")


if __name__ == "__main__":
    main()
