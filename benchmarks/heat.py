"""Heat maps of the cost per pixel, as in thesis2018, figure 39: one panel per optimisation.

    python -m benchmarks.heat --scene fair_weather

The cost of a pixel is the number of texture reads of its march, as in the source, without bakes and
the background. Reads are counted (benchmarks/counts.py). Optimisations A and C of the thesis cannot
be switched off in this march, so their panels are computed from counts: without A every step has
the light samples that a lit step has, without C every view step reads all textures. The result is
exact for equal steps without coarse steps.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import nubis
from benchmarks import counts, measure, page
from benchmarks.counts import Job
from benchmarks.reference import Size

RESULTS = Path(__file__).parent / "results"
#: Number of reads that is shown as white, as in the source.
WHITE = 1000
#: Reads per density evaluation: weather, shape, curl, detail.
FULL = 4


@dataclass(frozen=True)
class Panel:
    """The reads of each pixel at one stage."""

    name: str
    reads: npt.NDArray[Any]


def light_reads(quality: nubis.Quality) -> int:
    """Light-sample reads of a lit step of a published quality; the far one has no detail."""
    return FULL * quality.light_steps + 2 * quality.far_sample


def stages() -> dict[str, nubis.Quality]:
    """Qualities of the optimisation stages of the thesis that this march can switch off."""
    whole = nubis.quality("thesis2018")
    return {
        "off": whole.replace(min_transmittance=0.0, coarse_step=1),
        "B": whole.replace(coarse_step=1),
        "D": whole,
    }


def ours() -> dict[str, nubis.Quality]:
    """Qualities of the panels after the thesis: named qualities, without and with upsampling."""
    found = {}
    for name in "draft", "balanced":
        quality = nubis.quality(name)
        found |= {
            f"{name}, a ray for each pixel": quality.replace(adaptive_threshold=0.0),
            f"{name}": quality,
        }
    return found


def panels(camera: nubis.Camera, params: nubis.Params, size: Size) -> list[Panel]:
    """Panels of all stages."""
    # The source has one weather map and one detail noise: a full evaluation reads four textures.
    params = params.with_(**{"weather.broad_variety": 0.0, "clouds.fine_detail": 0.0})
    # Without irradiance there are no light samples; view steps are unchanged.
    night = params.with_(**{"sun.irradiance": (0.0, 0.0, 0.0)})
    by_name = stages()
    jobs = {
        ("steps", "off"): Job(camera, night, by_name["off"], "evaluations"),
        ("steps", "B"): Job(camera, night, by_name["B"], "evaluations"),
        ("view", "off"): Job(camera, night, by_name["off"], "reads"),
        ("view", "B"): Job(camera, night, by_name["B"], "reads"),
        **{("all", n): Job(camera, params, q, "reads") for n, q in (by_name | ours()).items()},
    }
    found = dict(zip(jobs, counts.count(list(jobs.values()), size), strict=True))

    def everything_read(stage: str) -> npt.NDArray[Any]:
        light = found["all", stage] - found["view", stage]
        return FULL * found["steps", stage] + light

    steps = found["steps", "off"]
    return [
        Panel("no optimisation", (FULL + light_reads(by_name["off"])) * steps),
        Panel("A: light only in cloud", everything_read("off")),
        Panel("B: and early exit", everything_read("B")),
        Panel("C: and detail only in the shape", found["all", "B"]),
        Panel("D: and big steps (thesis2018)", found["all", "D"]),
        *(Panel(name, found["all", name]) for name in ours()),
    ]


def rows(found: Sequence[Panel]) -> list[dict[str, Any]]:
    """Statistics of the panels: mean, share of the first, maximum, fraction of white pixels."""
    first = found[0].reads.mean()
    return [
        {
            "stage": panel.name,
            "reads": float(panel.reads.mean()),
            "share": float(panel.reads.mean() / first),
            "most": int(panel.reads.max()),
            "white": float(np.mean(panel.reads >= WHITE)),
        }
        for panel in found
    ]


def draw(path: Path, picture: npt.NDArray[Any], found: Sequence[Panel]) -> None:
    """Plot the picture and the panels, with one colour scale."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, grid = pyplot.subplots(5, 2, figsize=(7.5, 10.6), layout="constrained")
    # Order: stages of the thesis, the picture, a row per named quality.
    places = list(grid.flat)
    axes = places.pop(5)
    axes.imshow(nubis.to_srgb8(picture)[..., :3])
    axes.set_title("the picture", fontsize=9)
    for axes, panel, row in zip(places, found, rows(found), strict=True):
        image = axes.imshow(panel.reads, cmap="hot", vmin=0, vmax=WHITE, interpolation="nearest")
        share = f"{100 * row['share']:.3g} %"
        axes.set_title(f"{panel.name}\nmean {row['reads']:.0f}, {share}", fontsize=9)
    for axes in grid.flat:
        axes.set(xticks=[], yticks=[])
    figure.colorbar(image, ax=grid, label="texture reads a pixel", shrink=0.6, extend="max")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> None:
    """Count, plot, write the results, and update docs/speed.md."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.heat", description="What each pixel costs."
    )
    parser.add_argument("--scene", default="fair_weather", choices=list(nubis.scenes))
    parser.add_argument("--size", default="640x360", metavar="WxH", help="default: 640x360")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="DIR")
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    args = parser.parse_args(arguments)
    width, _, height = args.size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        parser.error(f"--size: {args.size!r} is no size such as 640x360")
    size = int(width), int(height)
    camera, params = nubis.scenes[args.scene]
    command = f"benchmarks.heat {shlex.join(arguments)}".strip().split()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
        head = measure.header(command) | {"size": size, "scene": args.scene}
        found = panels(camera, params, size)
        picture = nubis.Renderer(*size).render(camera, params)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "heat.json").write_text(
        json.dumps({"header": head, "white": WHITE, "rows": rows(found)}, indent=1) + "\n"
    )
    for row in rows(found):
        print(f"{row['stage']:32} {row['reads']:8.1f} {100 * row['share']:8.2f} %")
    draw(args.out / "plots" / "heat.png", picture, found)
    if args.out.resolve() == RESULTS:
        page.write_speed(args.out)


if __name__ == "__main__":
    main()
