"""Plots of the results. Plotting requires matplotlib; importing this module does not."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.measure import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colour-blind safe palette of Okabe and Ito; markers carry the same information.
COLOURS = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8C6D00"
MARKERS = "o", "s", "^", "D", "v", "P", "X"

AXES = {
    "seconds": "seconds a frame (median)",
    "evaluations": "density evaluations a pixel",
}
ERROR = "relative RMSE of the clouds' radiance"


def draw(folder: Path) -> list[Path]:
    """Plot all results in `folder`; return the files."""
    import matplotlib

    matplotlib.use("Agg")
    plots = folder / "plots"
    plots.mkdir(exist_ok=True)
    files = []
    if (folder / "results.json").exists():
        rows = json.loads((folder / "results.json").read_text())["rows"]
        scenes = {scene: list(g) for scene, g in groupby(rows, lambda row: row["scene"])}
        scenes["summary"] = geometric_mean(rows)
        for scene, of_scene in scenes.items():
            for axis in AXES:
                title = f"geometric mean of {len(scenes) - 1} scenes"
                title = title if scene == "summary" else scene
                files.append(_errors(plots / f"{scene}-{axis}.png", title, of_scene, axis))
    if (folder / "shapes.json").exists():
        shapes = json.loads((folder / "shapes.json").read_text())
        files.append(_shapes(plots / "shapes.png", shapes["sweeps"]))
    if (folder / "soak.json").exists():
        files.append(_memory(plots / "soak.png", json.loads((folder / "soak.json").read_text())))
    return files


def geometric_mean(rows: Iterable[Row]) -> list[Row]:
    """Geometric means over the scenes of times, evaluations and errors: one row per method.

    Bias is the arithmetic mean, set-up time the median, `t_max` the maximum.
    """
    by_method: dict[str, list[Row]] = {}
    for row in rows:
        by_method.setdefault(row["method"], []).append(row)
    names = "seconds", "seconds_p95", "evaluations", "rel_rmse", "p999", "t_rmse", "flip"
    means = []
    for same in by_method.values():
        mean = dict(same[0])
        for name in names:
            values = [row[name] for row in same if row[name] is not None]
            logs = np.log(np.maximum(values, 1e-12))  # an error may be exactly 0
            mean[name] = float(np.exp(logs.mean())) if values else None
        mean["bias"] = float(np.mean([row["bias"] for row in same]))
        mean["setup_seconds"] = float(np.median([row["setup_seconds"] for row in same]))
        mean["t_max"] = max(row["t_max"] for row in same)
        means.append(mean)
    return means


def pareto(rows: Iterable[Row], x: str = "seconds", y: str = "rel_rmse") -> list[Row]:
    """Pareto front: rows that no other row beats in both `x` and `y`, in ascending order of `x`."""
    front: list[Row] = []
    for row in sorted(rows, key=lambda row: (row[x], row[y])):
        if not front or row[y] < front[-1][y]:
            front.append(row)
    return front


def is_preset(row: Row) -> bool:
    """Whether a row is a named quality instead of a member of a family."""
    return bool(row["method"] == row["family"])


def _errors(path: Path, title: str, rows: list[Row], x: str) -> Path:
    from matplotlib import pyplot
    from matplotlib.ticker import LogLocator, NullFormatter

    figure, axes = pyplot.subplots(figsize=(8.5, 5.2), layout="constrained")
    front = pareto(rows, x)
    axes.plot(
        [r[x] for r in front],
        [r["rel_rmse"] for r in front],
        color="0.8",
        lw=7,
        label="Pareto front",
    )
    families: dict[str, list[Row]] = {}
    for row in rows:
        if not is_preset(row):
            families.setdefault(row["family"], []).append(row)
    for (family, members), colour, marker in zip(families.items(), COLOURS, MARKERS, strict=False):
        xs, ys = [r[x] for r in members], [r["rel_rmse"] for r in members]
        first, last = members[0]["value"], members[-1]["value"]
        span = f"1/{first} … 1/{last}" if "resolution" in family else f"{first} … {last}"
        axes.plot(xs, ys, color=colour, marker=marker, ms=4.5, lw=1.3, label=f"{family} {span}")
        axes.axhline(ys[-1], color=colour, ls=":", lw=1)
    axes.set(xscale="log", yscale="log", xlabel=AXES[x], ylabel=ERROR, title=title)
    axes.margins(x=0.08)
    for side in (axes.xaxis, axes.yaxis):
        side.set_major_locator(LogLocator(subs=(1, 2, 5)))
        side.set_major_formatter("{x:g}")
        side.set_minor_formatter(NullFormatter())
    _name_presets(axes, [row for row in rows if is_preset(row)], x)
    axes.grid(which="both", color="0.92")
    axes.set_axisbelow(True)
    axes.plot([], [], color="0.3", ls=":", lw=1, label="floor: error of a family's finest setting")
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    return _save(figure, path)


def _name_presets(axes: Axes, presets: list[Row], x: str) -> None:
    """Labelled circles of the named qualities; labels are placed away from other marks."""
    at = np.array([[row[x], row["rel_rmse"]] for row in presets])
    axes.plot(*at.T, "o", ms=9, mfc="none", mec="black", mew=1.5, zorder=5)
    at = axes.transData.transform(at)
    taken: list[Any] = []
    for i, row in enumerate(presets):
        others = [*np.delete(at, i, axis=0), *taken]
        # A label is about three times as wide as high.
        shape = np.array([1 / 3, 1])
        sides = np.array([[0, 16], [0, -16], [48, 0], [-48, 0]])
        room = [
            min((np.hypot(*((at[i] + s - o) * shape)) for o in others), default=0) for s in sides
        ]
        offset = sides[int(np.argmax(np.minimum(room, 24)))]
        taken.append(at[i] + offset)
        axes.annotate(
            row["method"],
            (row[x], row["rel_rmse"]),
            xytext=offset * 72 / axes.figure.dpi,
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=9,
            weight="bold",
            zorder=6,
            bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.5},
        )


def _shapes(path: Path, sweeps: Sequence[Row]) -> Path:
    from matplotlib import pyplot

    single = [s for s in sweeps if not s["name"].startswith("figure")]
    lines = [s for s in sweeps if s["name"].startswith("figure")]
    panels = len(single) + bool(lines)
    columns = min(panels, 2)
    figure, grid = pyplot.subplots(
        -(-panels // columns), columns, figsize=(9, 3.3 * -(-panels // columns)), squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for axes, sweep in zip(grid.flat, single, strict=False):
        _sweep(axes, sweep, COLOURS[0], MARKERS[0], "measured")
        if sweep["published_ms"]:
            # Published times are scaled to the same mean: only the shapes are comparable.
            x, y = np.array(sweep["published_ms"]).T
            mean = np.mean([1000 * row["seconds"] for row in sweep["rows"]])
            axes.plot(x, y * mean / y.mean(), "x--", color=COLOURS[3], label="published, scaled")
        axes.set_title(sweep["title"], fontsize=9)
        axes.legend(fontsize=8)
    if lines:
        axes = grid.flat[len(single)]
        for sweep, colour, marker in zip(lines, COLOURS, MARKERS, strict=False):
            _sweep(axes, sweep, colour, marker, sweep["name"].split()[-1])
        axes.set_title("time against view steps, overcast (thesis2018, figure 41)", fontsize=9)
        axes.legend(fontsize=8, title="resolution", title_fontsize=8)
    for axes in grid.flat:
        axes.set_ylim(bottom=0)
        axes.set_visible(axes.has_data())
    return _save(figure, path)


def _sweep(axes: Axes, sweep: Row, colour: str, marker: str, label: str) -> None:
    x = [row["value"] for row in sweep["rows"]]
    axes.plot(
        x, [1000 * row["seconds"] for row in sweep["rows"]], marker, color=colour, label=label
    )
    line = 1000 * (sweep["fit"]["slope"] * np.array([x[0], x[-1]]) + sweep["fit"]["intercept"])
    axes.plot([x[0], x[-1]], line, color=colour, lw=1)
    axes.set(xlabel=sweep["knob"], ylabel="milliseconds a frame")
    axes.grid(color="0.92")


def _memory(path: Path, soak: Row) -> Path:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8, 2.8), layout="constrained")
    axes.plot(*np.array(soak["memory_mib"]).T, color=COLOURS[0], lw=1)
    axes.set(xlabel="frame", ylabel="MiB of memory", ylim=(0, None))
    axes.grid(color="0.92")
    return _save(figure, path)


def _save(figure: object, path: Path) -> Path:
    from matplotlib import pyplot

    figure.savefig(path, dpi=100)  # type: ignore[attr-defined]
    pyplot.close(figure)  # type: ignore[arg-type]
    return path
