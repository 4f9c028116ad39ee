"""Checksums of pictures, to verify that a refactoring is bit-exact.

Run `python -m benchmarks.guard --store FILE` before the change and `--check FILE` after it, on the
same adapter and driver: pictures of different adapters and drivers differ in their bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import nubis

QUALITIES = "preview", "draft", "balanced", "high", "nubis2015", "thesis2018", "vsu2022"
SIZES = (96, 54), (256, 144)
#: Size for the slow integrators, and for light models and phase functions.
SMALL = 24, 16
FLIGHT = 160, 90
FRAMES = 20

Case = tuple[str, Callable[[], Any]]


def checksum(value: Any) -> str:
    """SHA-256 of an array, or of several arrays by name, shortened to 24 digits."""
    digest = hashlib.sha256()
    if isinstance(value, tuple):
        value = dict(zip(map(str, range(len(value))), value, strict=True))
    arrays = value if isinstance(value, dict) else {"": value}
    for name in sorted(arrays):
        digest.update(name.encode() + np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()[:24]


def layers(scene: str, quality: str, size: tuple[int, int], **changes: Any) -> Any:
    camera, params = nubis.scenes[scene]
    return nubis.Renderer(*size, quality=quality).render_layers(camera, params.with_(**changes))


def flight(scene: str, quality: str, size: tuple[int, int]) -> Any:
    """Frames of a flight forward, up and turning, with wind, a setting sun, and one cut."""
    camera, params = nubis.scenes[scene]
    eye, forward = np.array(camera.eye), np.array(camera.forward)

    def shots() -> Iterator[tuple[nubis.Camera, nubis.Params, float]]:
        for i in range(FRAMES):
            angle = radians(0.3 * i)
            turn = np.array(((cos(angle), sin(angle), 0), (-sin(angle), cos(angle), 0), (0, 0, 1)))
            at = eye + 12.0 * i * forward + (3000.0 if i >= 14 else 0.0, 0.0, 2.0 * i)
            sky = params.with_(**{"sun.elevation": params.sun.elevation - 0.02 * i})
            view = nubis.Camera.look_at(at, at + turn @ forward, fov_y=camera.fov)
            yield view, sky, i / 24

    renderer = nubis.Renderer(*size, quality=quality)
    frames = [np.array(frame) for frame in renderer.animate(shots())]
    named = {f"{i:02d}": frame for i, frame in enumerate(frames)}
    history = renderer.history_length
    return named if history is None else named | {"history": history}


def others() -> Iterator[Case]:
    """Cases that no scene of `nubis.scenes` covers."""
    rng = np.random.default_rng(7)
    grid = nubis.DensityGrid(
        rng.uniform(0, 0.05, (12, 16, 16)).astype(np.float32) ** 2 * 40,
        ((-800, -800, 500), (800, 800, 1500)),
    )
    camera, params = nubis.scenes["fair_weather"]
    small = lambda quality="draft", size=(64, 36): nubis.Renderer(*size, quality=quality)  # noqa: E731
    eye = (0.0, -3000.0, 300.0)
    at_grid = nubis.Camera.look_at(eye, (0, 0, 900), fov_y=50)
    in_grid = params.replace(volume=grid)
    distance = np.full((36, 64), np.inf, np.float32)
    distance[20:, 10:40] = 5000
    color = np.full((36, 64, 3), 0.1, np.float32)
    moon = params.with_(**{"sun.elevation": -3.0, "moon.elevation": 30.0, "moon.phase": 0.4})
    for quality in ("draft", "balanced", "high", "reference"):
        yield f"grid {quality}", lambda q=quality: small(q).render_layers(at_grid, in_grid)
        yield f"moon {quality}", lambda q=quality: small(q, (24, 14)).render_layers(camera, moon)
    for model in ("single", "octaves", "nubis2015", "thesis2018", "vsu2022", "path"):
        for phase in ("henyey_greenstein", "droplet", "mie"):
            changes = {"light.model": model, "light.phase": phase}
            yield (
                f"{model} {phase}",
                lambda c=changes: small("draft", SMALL).render_layers(camera, params.with_(**c)),
            )
    yield (
        "path grid",
        lambda: small("draft", SMALL).render_layers(
            at_grid, in_grid.with_(**{"light.model": "path"})
        ),
    )
    views = {
        "panorama": nubis.Camera.equirect(camera.eye),
        "all sky": nubis.Camera.fisheye(camera.eye),
        "from 12 km": nubis.Camera.look_at((0, 0, 12e3), (30e3, 0, 0)),
        "from 400 km": nubis.Camera.look_at((0, 0, 4e5), (3e5, 0, 0)),
    }
    for name, view in views.items():
        for quality in ("draft", "balanced"):
            yield name + " " + quality, lambda v=view, q=quality: small(q).render_layers(v, params)
    for quality in ("draft", "balanced"):
        yield (
            f"scene {quality}",
            lambda q=quality: small(q).render(
                camera, params, scene_depth=distance, scene_color=color
            ),
        )
    switches: dict[str, dict[str, Any]] = {
        "no air": {"atmosphere.enabled": False},
        "no high clouds": {"high_clouds.coverage": 0.0},
        "no clouds": {"clouds.coverage": 0.0},
        "clear spot": {"weather.clear_at": (0.0, 3000.0), "weather.clear_radius": 2000.0},
        "no shadows": {"atmosphere.ground_shadows": False, "atmosphere.light_shafts": False},
        "low sun": {"sun.elevation": 2.0},
    }
    for name, changes in switches.items():
        sky = params.with_(**changes)
        yield name, lambda s=sky: small("balanced").render_layers(camera, s)
    yield "shadow map", lambda: small().shadow_map(params, center=(0, 0), extent=2e4, size=64)
    points = rng.uniform((-5e3, -5e3, 0), (5e3, 5e3, 4e3), (500, 3))
    yield "density", lambda: small().density(points, params)
    yield "sun", lambda: small().sun_transmittance(points, params)
    yield "weather", lambda: small().weather_map(params)


def cases() -> Iterator[Case]:
    for scene in nubis.scenes:
        for quality in QUALITIES:
            for size in SIZES if quality != "vsu2022" else SIZES[:1]:
                name = f"{scene} {quality} {size[0]}x{size[1]}"
                yield name, lambda s=scene, q=quality, z=size: layers(s, q, z)
        yield f"{scene} reference", lambda s=scene: layers(s, "reference", SMALL)
        yield f"{scene} path", lambda s=scene: layers(s, "draft", SMALL, **{"light.model": "path"})
        for quality in ("preview", "draft", "balanced"):
            name = f"{scene} {quality} flight"
            yield name, lambda s=scene, q=quality: flight(s, q, FLIGHT)
    yield from others()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--store", type=Path, metavar="FILE")
    task.add_argument("--check", type=Path, metavar="FILE")
    parser.add_argument("--only", default="", help="names that hold this text")
    options = parser.parse_args()
    chosen = [(name, make) for name, make in cases() if options.only in name]
    found: dict[str, str] = {}
    stored = json.loads(options.check.read_text()) if options.check else {}
    changed = []
    for name, make in tqdm(chosen, disable=None):
        try:
            found[name] = checksum(make())
        except nubis.NubisError as error:
            found[name] = f"{type(error).__name__}: {error}"
        if options.store:
            adapter = nubis.Renderer(8, 8).adapter
            options.store.write_text(json.dumps({"adapter": str(adapter)} | found, indent=1) + "\n")
        elif stored.get(name) != found[name]:
            changed.append(name)
            print(f"differs: {name}", flush=True)
    if options.store:
        print(f"{len(found)} stored")
    elif changed:
        sys.exit(f"{len(changed)} of {len(found)} differ")
    else:
        print(f"{len(found)} the same")


if __name__ == "__main__":
    main()
