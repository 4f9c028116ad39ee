"""Speed-up over the published methods, cost of scene content, scaling with pixels, animation.

Every still is timed on a new renderer: the time includes bakes of sky, weather and light, but not
of noise and pipelines, which are cached on disk by the first process.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

import nubis
from benchmarks import measure, metrics, page, reference
from benchmarks.metrics import Layers
from benchmarks.reference import Size

Row = dict[str, Any]

RESULTS = Path(__file__).parent / "results"

PUBLISHED = "nubis2015", "thesis2018", "vsu2022"
#: Own qualities: the fastest of at most the same error is compared with a published one.
OURS = {
    "preview, coarser": nubis.quality("preview").replace(light_steps=6, light_group_weight=0.3),
    "preview": nubis.quality("preview"),
    "preview, finer": nubis.quality("preview").replace(
        steps_zenith=161, steps_horizon=384, coarse_step=6, light_steps=16, light_group_weight=0.1
    ),
    "draft": nubis.quality("draft"),
    "balanced": nubis.quality("balanced"),
    "balanced, finer": nubis.quality("balanced").replace(
        steps_zenith=161,
        steps_horizon=384,
        coarse_step=6,
        light_group_weight=0.1,
        adaptive_threshold=0.2,
    ),
    "balanced, finest": nubis.quality("balanced").replace(
        steps_zenith=215,
        steps_horizon=512,
        coarse_step=6,
        light_steps=24,
        light_group_weight=0.1,
        adaptive_threshold=0.1,
    ),
    "balanced, every ray": nubis.quality("balanced").replace(
        steps_zenith=168, steps_horizon=400, coarse_step=4, adaptive_threshold=0.0
    ),
}
#: Own qualities with a public name.
NAMED = "preview", "draft", "balanced"
#: Reference of all errors, because `reference` would take hours at this size. Its own error is 1 %,
#: in `storm` 7 %, in `sunset` 28 % (docs/accuracy.md).
TRUTH = nubis.quality("high")
#: Scenes that match the three views of the best open web renderer on the same driver.
ANCHORS = "fair_weather", "sunset", "above"
#: Cases that are also measured in `high`, at half a minute per picture.
AIMED = "clear sky", "night", "a tenth"
#: Qualities of animations at 1920x1080 and of the anchor scenes, from coarse to fine.
FLOWN = "preview", "draft", "balanced", "high"
ANCHORED = "preview", "draft"
FRAMES = 26  # per animation; the first is a still, the second compiles


def still(
    size: Size, quality: nubis.Quality, camera: nubis.Camera, params: nubis.Params, repeats: int
) -> Row:
    """Time of a still with cold caches, except noise and pipelines."""
    nubis.Renderer(*size, quality=quality).render(camera, params)
    wall, processor = [], []
    for _ in range(repeats):
        renderer = nubis.Renderer(*size, quality=quality)
        started, used = perf_counter(), process_time()
        renderer.render(camera, params)
        wall.append(perf_counter() - started)
        processor.append(process_time() - used)
    return {
        "seconds": float(np.median(wall)),
        "processor_seconds": float(np.median(processor)),
    }


def presets(size: Size, repeats: int) -> list[Row]:
    """Times and errors of the published and the own methods, for every scene."""
    methods = {name: nubis.quality(name) for name in PUBLISHED} | OURS
    rows = []
    for scene in tqdm(measure.marched(), unit="scene", disable=None):
        camera, params = nubis.scenes[scene]
        truth = _truth(scene, size)
        for name, quality in methods.items():
            layers = nubis.Renderer(*size, quality=quality).render_layers(camera, params)
            errors = metrics.errors(layers, truth)
            row = {"scene": scene, "method": name, "rel_rmse": errors["rel_rmse"]}
            rows.append(row | still(size, quality, camera, params, repeats))
    return rows


def ratios(rows: list[Row]) -> list[Row]:
    """Speed-up of the fastest own method of at most the same error over each published method.

    The speed-up is computed for all of `OURS`, and for `NAMED` alone.
    """
    found = []
    for theirs in (row for row in rows if row["method"] in PUBLISHED):
        best = _fastest(rows, theirs, list(OURS))
        named = _fastest(rows, theirs, NAMED)
        found.append(
            {"scene": theirs["scene"], "published": theirs["method"], "error": theirs["rel_rmse"]}
            | {"ours": best and best["method"], "our_error": best and best["rel_rmse"]}
            | {"ratio": best and theirs["processor_seconds"] / best["processor_seconds"]}
            | {"named_ratio": named and theirs["processor_seconds"] / named["processor_seconds"]}
        )
    return found


def _fastest(rows: list[Row], theirs: Row, methods: Sequence[str]) -> Row | None:
    """The fastest of `methods` whose error in the scene of `theirs` is at most that of `theirs`."""
    as_good = [
        row
        for row in rows
        if row["scene"] == theirs["scene"]
        and row["method"] in methods
        and row["rel_rmse"] <= theirs["rel_rmse"]
    ]
    return min(as_good, key=lambda row: float(row["processor_seconds"]), default=None)


def _truth(scene: str, size: Size) -> Layers:
    """Layers of the reference `TRUTH`, cached as in `reference.reference_layers`."""
    key = f"{scene}-truth-{size[0]}x{size[1]}-{reference.shader_hash()}.npz"
    path = reference.CACHE / key
    if not path.exists():
        layers = nubis.Renderer(*size, quality=TRUTH).render_layers(*nubis.scenes[scene])
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}.npz")
        np.savez(unfinished, **layers)
        unfinished.replace(path)
    with np.load(path) as file:
        return dict(file)


def content(size: Size, repeats: int) -> list[Row]:
    """Cost of scene content: time without a feature, relative to the time with it."""
    rows = []
    for quality in "draft", "balanced", "high":
        for name, scene, less, more in _pairs():
            if quality == "high" and not name.startswith(AIMED):
                continue
            camera, params = nubis.scenes[scene]
            times, cover = [], []
            for changes in less, more:
                sky = params.with_(**changes)
                method = nubis.quality(quality)
                times.append(still(size, method, camera, sky, repeats)["processor_seconds"])
                layers = nubis.Renderer(160, 90, quality=quality).render_layers(camera, sky)
                cover.append(float(np.mean(layers["transmittance"] < 0.99)))
            row = {"what": name, "scene": scene, "quality": quality, "share": times[0] / times[1]}
            rows.append(row | {"processor_seconds": times, "cover": cover})
    return rows


def _pairs() -> Iterator[tuple[str, str, Row, Row]]:
    bare = {"high_clouds.coverage": 0.0}
    clear = bare | {"clouds.coverage": 0.0}
    yield "clear sky, of an overcast one", "overcast", clear, {}
    yield "high clouds alone, of an overcast sky", "overcast", {"clouds.coverage": 0.0}, {}
    for scene in "fair_weather", "overcast":
        yield "night, of noon", scene, {"sun.elevation": -20.0}, {"sun.elevation": 60.0}
    yield (
        "a tenth cloud, of full cover",
        "fair_weather",
        bare | {"clouds.coverage": 0.325},
        bare | {"clouds.coverage": 0.9},
    )
    # Features that are switched off one at a time.
    yield "without air", "fair_weather", {"atmosphere.enabled": False}, {}
    yield "without shadows on the ground", "fair_weather", {"atmosphere.ground_shadows": False}, {}
    yield "without beams", "fair_weather", {"atmosphere.light_shafts": False}, {}
    yield "without high clouds", "fair_weather", bare, {}
    yield "without the larger weather map", "fair_weather", {"weather.broad_variety": 0.0}, {}
    yield "without the second deck", "two_decks", {"upper_clouds.coverage": 0.0}, {}
    yield "without rain in sight", "storm", {}, {"clouds.rain_extinction": 2e-4}


def growth(repeats: int) -> list[Row]:
    """Time of `fair_weather` by number of pixels (benchmarks/shapes.py: by number of steps)."""
    rows = []
    for size in (480, 270), (960, 540), (1920, 1080):
        for quality in "draft", "balanced":
            row = still(size, nubis.quality(quality), *nubis.scenes["fair_weather"], repeats)
            rows.append({"size": size, "quality": quality} | row)
    return rows


def animation(
    scene: str, size: Size, quality: str, *, errors: bool = True, plots: Path | None = None
) -> Row:
    """Frame times of a flight at 60 m/s, and differences between frames and stills.

    The last frame and its still are also compared with a still in `high`, which has little noise.
    With `plots`, the last frame is saved.
    """
    method = nubis.quality(quality)
    shots = list(_flight(scene))
    frames = nubis.Renderer(*size, quality=method).animate(shots)
    stills = nubis.Renderer(*size, quality=method)
    wall, processor, differences, truth = [], [], [], []
    for i in range(FRAMES):
        started, used = perf_counter(), process_time()
        frame = next(frames)
        wall.append(perf_counter() - started)
        processor.append(process_time() - used)
        if errors and i in (FRAMES // 2, FRAMES - 1):
            alone = stills.render(*shots[i][:2], time=shots[i][2])
            differences.append(_difference(frame, alone))
            if i == FRAMES - 1:
                high = nubis.Renderer(*size, quality="high")
                high = high.render(*shots[i][:2], time=shots[i][2])
                truth = [_difference(frame, high), _difference(alone, high)]
    if plots:
        plots.mkdir(parents=True, exist_ok=True)
        nubis.save(plots / f"{scene}-{quality}-frame.png", frame[..., :3])
    return {
        "scene": scene,
        "size": size,
        "quality": quality,
        "seconds": float(np.median(wall[2:])),
        "processor_seconds": float(np.median(processor[2:])),
        "rel_rmse": differences,
        "rel_rmse_high": truth,
    }


def _flight(scene: str) -> Iterator[tuple[nubis.Camera, nubis.Params, float]]:
    camera, params = nubis.scenes[scene]
    # The sun's disc is so bright that a shift by a twentieth of a pixel would dominate the error.
    params = params.with_(**{"sun.visible": False})
    eye, forward = np.array(camera.eye), np.array(camera.forward)
    for i in range(FRAMES):
        at = eye + 60.0 * i / 24 * forward
        yield nubis.Camera.look_at(at, at + forward, (0, 0, 1), camera.fov), params, i / 24


def _difference(frame: npt.NDArray[Any], still: npt.NDArray[Any]) -> float:
    error = (frame - still)[..., :3].astype(float)
    return float(np.sqrt(np.mean(error**2)) / still[..., :3].mean())


#: Parts of the measurement, with a table each in docs/speed.md.
PARTS = "published", "content", "growth", "animation"


def run(
    size: Size,
    repeats: int,
    parts: Sequence[str] = PARTS,
    *,
    plots: Path | None = None,
    quick: bool = False,
) -> Row:
    """Results of the given parts."""
    found: Row = {}
    if "published" in parts:
        found["presets"] = presets(size, repeats)
        found["ratios"] = ratios(found["presets"])
    if "content" in parts:
        found["content"] = content(size, repeats)
    if "growth" in parts:
        found["growth"] = [] if quick else growth(repeats)
    if "animation" in parts:
        large = (160, 90) if quick else (1920, 1080)
        anchor = (96, 54) if quick else (960, 540)
        found["animation"] = [
            animation("fair_weather", large, quality, plots=plots if quality == "preview" else None)
            for quality in FLOWN
        ]
        found["anchors"] = [
            {"still": still(anchor, nubis.quality(quality), *nubis.scenes[scene], repeats)}
            | animation(scene, anchor, quality, plots=plots if quality == "draft" else None)
            for quality in ANCHORED
            for scene in ANCHORS
        ]
    return found


def main() -> None:
    """Measure, and update the measured parts of benchmarks/results/speed.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--size", default="1280x720", metavar="WxH")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="smaller animations")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="some parts")
    parser.add_argument("--out", type=Path, default=RESULTS / "speed.json")
    args = parser.parse_args()
    width, height = (int(n) for n in args.size.split("x"))
    command = ["benchmarks.speed", "--size", args.size, "--repeats", str(args.repeats)]
    if args.only != PARTS:
        command += ["--only", *args.only]
    header = measure.header(command) | {"size": (width, height), "repeats": args.repeats}
    kept = json.loads(args.out.read_text()) if args.out.exists() else {"headers": {}}
    plots = args.out.parent / "plots"
    kept |= run((width, height), args.repeats, args.only, plots=plots, quick=args.quick)
    kept["headers"] |= dict.fromkeys(args.only, header)
    args.out.write_text(json.dumps(kept, indent=1) + "\n")
    if args.out.parent.resolve() == RESULTS:
        page.write_speed(RESULTS)


if __name__ == "__main__":
    main()
