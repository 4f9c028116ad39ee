"""Generation of the results in docs/accuracy.md, docs/speed.md and docs/demo.md, between markers.

All tables and all prose with measured numbers are generated.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.measure import Row
from benchmarks.plots import geometric_mean, is_preset, pareto
from benchmarks.shapes import fit

PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
SPEED = PAGE.with_name("speed.md")
DEMO = PAGE.with_name("demo.md")


def write(folder: Path, page: Path = PAGE) -> None:
    """Update the results of docs/accuracy.md from `folder`; text outside markers is unchanged."""
    text = page.read_text()
    blocks = {}
    if (results := _read(folder, "results.json")) is not None:
        rows = results["rows"]
        blocks["about the errors"] = _about(results["header"]) + _reference(results["header"])
        blocks["presets"] = _presets(geometric_mean(rows))
        blocks["scenes"] = _scenes(rows)
        blocks["reading"] = _reading(rows)
        names = ["summary", *results["header"]["seeds"]]
        blocks["plots"] = _plots(folder, page, names)
    if (shapes := _read(folder, "shapes.json")) is not None:
        blocks["about the shapes"] = _about(shapes["header"])
        blocks["shapes"] = _shapes(shapes) + "\n\n" + _image(folder, page, "shapes")
    if (octaves := _read(folder, "octaves.json")) is not None:
        blocks["octaves"] = _octaves(octaves)
    if (oracle := _read(folder, "oracle.json")) is not None:
        blocks["oracle"] = _oracle(oracle)
    if (motion := _read(folder, "motion.json")) is not None:
        blocks["motion"] = _about(motion["header"]) + "\n\n" + _motion(motion["rows"])
        blocks["motion"] += "\n\n" + _image(folder, page, "motion")
    if (soak := _read(folder, "soak.json")) is not None:
        blocks["soak"] = _soak(soak) + "\n\n" + _image(folder, page, "soak")
    page.write_text(_filled(text, blocks))


def write_speed(folder: Path, page: Path = SPEED) -> None:
    """Update the results of docs/speed.md from `folder`."""
    blocks = {}
    if (found := _read(folder, "profile.json")) is not None:
        blocks["profile"] = _about(found["header"]) + _load(found) + "\n\n" + profile(found)
        blocks["memory"] = memory(found)
    if (found := _read(folder, "speed.json")) is not None:
        about = {part: _about(header) + "\n\n" for part, header in found["headers"].items()}
        blocks["against the published"] = about["published"] + _against(found)
        blocks["content"] = about["content"] + _content(found["content"])
        blocks["growth"] = about["growth"] + _growth(found["growth"])
        blocks["animation"] = about["animation"] + _animation(found)
    if (heat := _read(folder, "heat.json")) is not None:
        blocks["heat"] = _heat(heat) + "\n\n" + _image(folder, page, "heat")
    page.write_text(_filled(page.read_text(), blocks))


def write_demo(folder: Path, page: Path = DEMO) -> None:
    """Update the results of docs/demo.md from `folder`."""
    if (found := _read(folder, "demo.json")) is not None:
        block = _about(found["header"]) + "\n\n" + _flights(found["rows"])
        page.write_text(_filled(page.read_text(), {"flights": block}))


def _flights(rows: list[Row]) -> str:
    heads = (
        "scene",
        "frames/s wanted",
        "median ms",
        "slowest twentieth",
        "worst",
        "longest wait of a key",
        "pixels at the end",
    )
    return _table(
        heads,
        [
            [
                f"`{row['scene']}`",
                str(row["rate"]),
                *(str(row[key]) for key in ("median", "slow", "worst", "longest_wait")),
                "×".join(str(side) for side in row["size"]),
            ]
            for row in rows
        ],
    )


def _against(found: Row) -> str:
    """Speed-up over the published methods, by scene and as geometric mean."""
    ratios = found["ratios"]
    names = list(dict.fromkeys(row["published"] for row in ratios))
    times = {(row["scene"], row["method"]): row for row in found["presets"]}
    lines = []
    for scene in dict.fromkeys(row["scene"] for row in ratios):
        line = [f"`{scene}`"]
        for row in (row for row in ratios if row["scene"] == scene):
            theirs = times[scene, row["published"]]
            cell = f"{_percent(row['error'])}, {theirs['processor_seconds']:.2g} s"
            if row["ours"] is None:
                line.append(f"{cell}: none of ours errs as little")
            else:
                line.append(
                    f"{cell}: **{row['ratio']:.1f}×**, {row['ours']} ({_percent(row['our_error'])})"
                )
        lines.append(line)
    means = ["geometric mean"]
    named = ["the same, of `preview`, `draft` and `balanced` alone"]
    for name in names:
        means.append(_mean([row["ratio"] for row in ratios if row["published"] == name]))
        named.append(_mean([row["named_ratio"] for row in ratios if row["published"] == name]))
    heads = list(dict.fromkeys(m for _, m in times if m not in names))
    ours = []
    for scene in dict.fromkeys(s for s, _ in times):
        rows = [times[scene, name] for name in heads]
        cells = [f"{_percent(r['rel_rmse'])}, {r['processor_seconds']:.2g} s" for r in rows]
        ours.append([f"`{scene}`", *cells])
    return (
        _table(["scene", *(f"`{name}`" for name in names)], [*lines, means, named])
        + "\n\nOurs, error and processor time:\n\n"
        + _table(["scene", *heads], ours)
    )


def _mean(ratios: list[float | None]) -> str:
    known = [ratio for ratio in ratios if ratio]
    return f"**{np.exp(np.mean(np.log(known))):.1f}×** over {len(known)} scenes" if known else "–"


def _content(rows: list[Row]) -> str:
    lines = [
        [
            row["what"],
            f"`{row['scene']}`",
            f"`{row['quality']}`",
            " of ".join(_percent(share) for share in row["cover"]),
            " of ".join(f"{1e3 * t:.0f}" for t in row["processor_seconds"]),
            f"**{_percent(row['share'])}**",
        ]
        for row in rows
    ]
    heads = ["", "scene", "quality", "pixels with cloud", "processor ms", "share"]
    return _table(heads, lines)


def _growth(rows: list[Row]) -> str:
    lines = [
        [
            "{}×{}".format(*row["size"]),
            f"`{row['quality']}`",
            f"{row['processor_seconds']:.2f}",
            f"{1e9 * row['processor_seconds'] / (row['size'][0] * row['size'][1]):.0f}",
        ]
        for row in rows
    ]
    return _table(["pixels", "quality", "processor seconds", "ns a pixel"], lines)


def _animation(found: Row) -> str:
    cores = found["headers"]["animation"]["cores"]
    lines = []
    for row in [*found["animation"], *found["anchors"]]:
        still = f"{row['still']['seconds']:.2f}" if "still" in row else "–"
        lines.append(
            [
                f"`{row['scene']}`",
                "{}×{}".format(*row["size"]),
                f"`{row['quality']}`",
                still,
                f"{1e3 * row['seconds']:.0f}",
                f"{1e3 * row['processor_seconds'] / cores:.0f}",
                ", ".join(_percent(e) for e in row["rel_rmse"]),
                ", ".join(_percent(e) for e in row["rel_rmse_high"]),
            ]
        )
    heads = ["scene", "pixels", "quality", "still, s", "frame, ms", "processor ms / cores"]
    errors = ["frames from stills", "frame, still from `high`"]
    return _table(heads + errors, lines)


def _filled(text: str, blocks: dict[str, str]) -> str:
    for name, block in blocks.items():
        text = fill(text, name, block)
    return text


def fill(text: str, name: str, block: str) -> str:
    """Replace the text between the markers `name` by `block`."""
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    if text.count(begin) != 1 or text.count(end) != 1:
        raise ValueError(f"the page needs the markers {begin} and {end}, once each")
    between = re.escape(begin) + ".*?" + re.escape(end)
    return re.sub(between, lambda _: f"{begin}\n{block}\n{end}", text, flags=re.DOTALL)


def _read(folder: Path, name: str) -> Row | None:
    path = folder / name
    return json.loads(path.read_text()) if path.exists() else None


def _about(header: Row) -> str:
    adapter = header["adapter"]
    renders = f", median of {header['repeats']} renders" if "repeats" in header else ""
    size = "{}×{}{}".format(*header["size"], renders) if "size" in header else "the cases' sizes"
    return (
        f"Measured {header['date']} on {adapter['name']} ({adapter['kind']}, {adapter['driver']}), "
        f"{header['cpu']}, {header['cores']} cores; nubis {header['version']}, shaders "
        f"{header['shaders']}, {size}; `{header['command']}`."
    )


def _reference(header: Row) -> str:
    tolerance = header["reference"]["quality"]["tolerance"]
    return (
        ' The reference is `quality="reference"`: steps halved until no pixel changes by more than '
        f"{tolerance:.1%}."
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _percent(value: float, sign: str = "") -> str:
    return f"{100 * value:{sign}.2g} %" if abs(value) < 0.1 else f"{100 * value:{sign}.0f} %"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}" if value < 100 else f"{value:.0f}"


def _presets(means: list[Row]) -> str:
    head = (
        "quality",
        "ms",
        "p95",
        "set-up",
        "evaluations",
        "rel. RMSE",
        "bias",
        "p99.9",
        "T RMSE",
        "T max",
        "HDR-FLIP",
    )
    rows = [
        (
            f"`{m['method']}`",
            _number(1000 * m["seconds"]),
            _number(1000 * m["seconds_p95"]),
            _number(1000 * m["setup_seconds"]),
            _number(m["evaluations"]),
            _percent(m["rel_rmse"]),
            _percent(m["bias"], "+"),
            _number(m["p999"]),
            _number(m["t_rmse"]),
            _number(m["t_max"]),
            _number(m["flip"]),
        )
        for m in means
        if is_preset(m)
    ]
    return _table(head, rows)


def _scenes(rows: list[Row]) -> str:
    presets = list(dict.fromkeys(row["method"] for row in rows if is_preset(row)))
    found = {(row["scene"], row["method"]): row for row in rows}
    scenes = dict.fromkeys(row["scene"] for row in rows)

    def cell(scene: str, preset: str) -> str:
        row = found[scene, preset]
        return f"{_percent(row['rel_rmse'])} ({_number(1000 * row['seconds'])} ms)"

    head = ["scene", *(f"`{preset}`" for preset in presets)]
    return _table(head, ([f"`{s}`", *(cell(s, p) for p in presets)] for s in scenes))


def _reading(rows: list[Row]) -> str:
    means = geometric_mean(rows)
    presets = [m for m in means if is_preset(m)]
    front = {m["method"] for m in pareto(means)}
    lines = []
    on = [f"`{m['method']}`" for m in presets if m["method"] in front]
    lines.append(f"Named qualities on the Pareto front of the mean: {', '.join(on) or 'none'}.")
    for preset in presets:
        if preset["method"] in front:
            continue
        as_good = [m for m in means if m["rel_rmse"] <= preset["rel_rmse"]]
        cheap = min(as_good, key=lambda m: m["seconds"])
        in_time = [m for m in means if m["seconds"] <= preset["seconds"]]
        good = min(in_time, key=lambda m: m["rel_rmse"])
        lines.append(
            f"`{preset['method']}`: its error of {_percent(preset['rel_rmse'])} is had in "
            f"{_percent(cheap['seconds'] / preset['seconds'])} of its time by `{cheap['method']}`; "
            f"in its time `{good['method']}` errs by {_percent(good['rel_rmse'])}."
        )
    for base in dict.fromkeys(m["family"].split(":")[0] for m in means if not is_preset(m)):
        lines += _limits(base, means)
    for preset in presets:
        same = [row for row in rows if row["method"] == preset["method"]]
        worst = max(same, key=lambda row: row["rel_rmse"])
        tilted = max(same, key=lambda row: abs(row["bias"]))
        lines.append(
            f"`{preset['method']}` is farthest off in `{worst['scene']}` "
            f"({_percent(worst['rel_rmse'])}); its largest bias is "
            f"{_percent(tilted['bias'], '+')}, in `{tilted['scene']}`."
        )
    return "\n".join(f"- {line}" for line in lines)


def _limits(base: str, means: list[Row]) -> list[str]:
    """Error budget of a quality: the setting whose refinement reduces the error most."""
    start = next((m for m in means if m["method"] == base), None)
    families = {m["family"]: m for m in means}  # the last member is the finest
    view, light = families.get(f"{base}: view steps"), families.get(f"{base}: light steps")
    lines = []
    if start and view and light:
        less = min(view, light, key=lambda m: m["rel_rmse"])
        more = "view steps" if less is view else "light steps"
        lines.append(
            f"From `{base}`, whose error is {_percent(start['rel_rmse'])}, {view['value']} view "
            f"steps alone lead to {_percent(view['rel_rmse'])} and {light['value']} light steps "
            f"alone to {_percent(light['rel_rmse'])}: "
            + (
                f"more {more} help most."
                if less["rel_rmse"] < 0.9 * start["rel_rmse"]
                else "neither alone removes a tenth of it; it comes from what both leave as it is."
            )
        )
    half = next((m for m in means if m["method"] == f"{base}: resolution 1/2"), None)
    if start and half:
        lines.append(
            f"`{base}` at half the resolution takes "
            f"{_percent(half['seconds'] / start['seconds'])} of the time; its error is "
            f"{_percent(half['rel_rmse'])}, its bias {_percent(half['bias'], '+')}."
        )
    return lines


def _image(folder: Path, page: Path, name: str) -> str:
    path = os.path.relpath(folder / "plots" / f"{name}.png", page.parent)
    return f"![{name}]({Path(path).as_posix()})"


def _plots(folder: Path, page: Path, names: Sequence[str]) -> str:
    return "\n\n".join(
        f"{_image(folder, page, f'{name}-seconds')}\n{_image(folder, page, f'{name}-evaluations')}"
        for name in names
    )


def _shapes(shapes: Row) -> str:
    sweeps = {sweep["name"]: sweep for sweep in shapes["sweeps"]}
    pixels = shapes["header"]["size"][0] * shapes["header"]["size"][1]
    software = shapes["header"]["adapter"]["kind"] == "cpu"
    clock = "processor_seconds" if software else "seconds"
    parts = [_table_of_sweeps(sweeps.values())]
    tables = [sweep for name, sweep in sweeps.items() if name.startswith("table")]
    notes = [_note(sweep, pixels, clock) for sweep in tables]
    notes += _coverage(sweeps["table 4"], pixels) if "table 4" in sweeps else []
    notes += _resolutions(sweeps)
    parts.append("\n".join(f"- {note}" for note in notes))
    if shapes["factors"]:
        parts.append(_factors(shapes["factors"]))
    if shapes["bakes"]:
        parts.append(_bakes(shapes["bakes"]))
    if shapes["switches"]:
        parts.append(_switches(shapes["switches"]))
    return "\n\n".join(parts)


def _table_of_sweeps(sweeps: Iterable[Row]) -> str:
    def line(sweep: Row) -> list[str]:
        published = sweep["published_fit"]
        times = {row["value"]: row["seconds"] for row in sweep["rows"]}
        known = dict(sweep["published_ms"])
        both = [value for value in times if value in known]
        growth = ["–", "–", "–"]
        if len(both) > 1:
            a, b = both[0], both[-1]
            growth = [
                f"{a:g} → {b:g}",
                f"×{_number(times[b] / times[a])}",
                f"×{_number(known[b] / known[a])}",
            ]
        return [
            sweep["title"],
            _number(1000 * sweep["fit"]["slope"]),
            f"{sweep['fit']['r2']:.3f}",
            f"{sweep['fit_of_processor']['r2']:.3f}",
            f"{published['r2']:.3f}" if published else "–",
            *growth,
        ]

    head = [
        "",
        "slope, ms",
        "R²",
        "R² of processor time",
        "R² published",
        "from → to",
        "time grows",
        "published",
    ]
    return _table(head, map(line, sweeps))


def _note(sweep: Row, pixels: int, clock: str) -> str:
    """Linearity of a sweep, in its setting and in density evaluations."""
    rows = sweep["rows"]
    times = [row[clock] for row in rows]
    r2, by_evaluations, in_step = (
        fit([row[key] for row in rows], times)["r2"]
        for key in ("value", "evaluations", "evaluations_in_step")
    )
    line = "is a line" if r2 >= 0.97 else "is nearly a line" if r2 >= 0.9 else "is no line"
    costs = [_cost(row, pixels) for row in rows]
    name = clock.replace("_seconds", " time").replace("seconds", "time")
    return (
        f"{sweep['name'].capitalize()}: {name} against {sweep['knob']} {line} (R² {r2:.3f}). "
        f"Against density evaluations a pixel R² is {by_evaluations:.3f}, and {in_step:.3f} if "
        "eight neighbours wait for the longest of them, as they do on lavapipe. An evaluation "
        f"takes {min(costs):.0f} to {max(costs):.0f} ns by the clock."
    )


def _cost(row: Row, pixels: int) -> float:
    """Nanoseconds per density evaluation."""
    return float(1e9 * row["seconds"] / row["evaluations"] / pixels)


def _coverage(sweep: Row, pixels: int) -> list[str]:
    rows = sweep["rows"]
    first, last = rows[0], rows[-1]
    dearest = max(rows, key=lambda row: row["seconds"])
    notes = []
    if dearest is not last:
        notes.append(
            f"Coverage makes a frame dearer up to {dearest['value']:g} only: at 1 it takes "
            f"{_percent(last['seconds'] / dearest['seconds'])} of that time. Pixels with cloud go "
            f"from {_percent(first['cloudy'])} at {first['value']:g} to "
            f"{_percent(dearest['cloudy'])} and {_percent(last['cloudy'])}, but rays that end in "
            f"opaque cloud go from {_percent(first['opaque'])} to "
            f"{_percent(dearest['opaque'])} and {_percent(last['opaque'])}, so that a cloudy pixel "
            f"takes {_number(dearest['evaluations_cloudy'])} evaluations there and "
            f"{_number(last['evaluations_cloudy'])} at 1. The published sky keeps getting dearer."
        )
        waste = [row["evaluations_in_step"] / row["evaluations"] - 1 for row in (dearest, last)]
        notes.append(
            f"Broken cloud is dear twice. An evaluation takes {_cost(first, pixels):.0f} ns at "
            f"{first['value']:g}, {_cost(dearest, pixels):.0f} at {dearest['value']:g} and "
            f"{_cost(last, pixels):.0f} at 1: neighbouring rays work together, and those that wait "
            f"for the longest of eight add {_percent(waste[0])} to the evaluations at "
            f"{dearest['value']:g}, {_percent(waste[1])} at 1."
        )
    if clear := [row["value"] for row in rows if row["cloudy"] == 0]:
        notes.append(f"Up to coverage {max(clear):g} no cloud is in view: only the search is paid.")
    return notes


def _resolutions(sweeps: dict[str, Row]) -> list[str]:
    figure = {name[-1]: s for name, s in sweeps.items() if name.startswith("figure 41")}
    if "1" not in figure:
        return []
    whole = figure["1"]["rows"][-1]
    shares = [
        f"1/{divisor} {_percent(sweep['rows'][-1]['seconds'] / whole['seconds'])} "
        f"({_percent(1 / int(divisor) ** 2)} of the pixels)"
        for divisor, sweep in figure.items()
        if divisor != "1"
    ]
    return [
        f"Figure 41: at {whole['value']} view steps the resolutions take, of the time of the "
        f"whole: {', '.join(shares)}."
    ]


def _factors(rows: list[Row]) -> str:
    """Growth of the time by each of three factors, the others fixed (vsu2022, table 6)."""

    def effect(name: str, key: str) -> float:
        others = [n for n in ("steps", "coverage", "light_steps") if n != name]
        low, high = sorted({row[name] for row in rows})
        found = {(row[name], *(row[n] for n in others)): row[key] for row in rows}
        logs = [np.log(found[high, *rest] / t) for (v, *rest), t in found.items() if v == low]
        return float(np.exp(np.mean(logs)))

    lines = []
    for name, title in [
        ("steps", "view steps 100 → 200"),
        ("coverage", "coverage 0.3 → 0.8"),
        ("light_steps", "light steps doubled (50 → 100; published 100 → 200)"),
    ]:
        measured, published = effect(name, "seconds"), effect(name, "published_ms")
        lines.append((title, f"×{measured:.2f}", f"×{published:.2f}"))
    return "Table 6, by its three factors (geometric mean over the others):\n\n" + _table(
        ["", "time grows", "published"], lines
    )


def _bakes(bakes: Row) -> str:
    measured, published = bakes["passes_ms"], bakes["published_ms"]
    lines = [(name, _number(ms), _number(published.get(name))) for name, ms in measured.items()]
    lines.append(
        ("all, by the clock", _number(bakes["clock_ms"]), _number(bakes["published_clock_ms"]))
    )
    note = ""
    if "shape" in measured and "detail" in measured:
        note = (
            f" The base shape has 64 times the texels of the detail and takes "
            f"{_number(measured['shape'] / measured['detail'])} times as long; published is "
            f"{_number(published['shape'] / published['detail'])}, which is not the work of "
            "sixty-four times as many texels."
        )
    return f"Table 2, the noises, which are baked once.{note}\n\n" + _table(
        ["noise", "ms", "published, ms"], lines
    )


def _switches(rows: list[Row]) -> str:
    lines = [
        (row["switch"], _number(row["evaluations"]), _number(1000 * row["seconds"])) for row in rows
    ]
    return "What the optimisations of thesis2018 save (its figure 39):\n\n" + _table(
        ["with", "evaluations a pixel", "ms"], lines
    )


def _octaves(octaves: Row) -> str:
    """Residual error of the light model "octaves"."""

    def line(row: Row) -> list[str]:
        constants = ", ".join(f"{v:.2f}" for v in row["constants"])
        return [
            f"{row['what']}, {row['octaves']}" if row["octaves"] > 1 else row["what"],
            constants if row["octaves"] > 1 else "–",
            _percent(row["rel_rmse"]),
            _percent(row["worst_rel_rmse"]),
            _percent(row["rms_relative"]),
            _percent(row["bias"], "+"),
            _percent(row["bias_rms"]),
        ]

    head = ["", "a, b, c", "rel. RMSE", "worst case", "rms relative", "bias", "rms bias"]
    return (
        _about(octaves["header"])
        + f" {len(octaves['cases'])} cases, {octaves['header']['samples']} paths a pixel; a tile's "
        f"standard error is {_percent(octaves['noise'])} in the mean.\n\n"
        + _table(head, map(line, octaves["rows"]))
    )


def _oracle(oracle: Row) -> str:
    """Errors of the qualities against other programs."""
    qualities = [key for key in oracle["exact"][0] if key != "case"]

    def line(row: Row) -> list[str]:
        cells = [row["case"]]
        for q in qualities:
            e = row[q]
            cells.append(f"{e['rel_rmse']:.2g}, {e['bias']:+.1g}, {e['t_max']:.1g}")
        return cells

    paths = [
        [
            row["case"],
            str(row["paths"]),
            f"{row['ratio']:.4f} ± {row['ratio_error']:.4f}",
            f"{row['z_std']:.2f}",
            f"{row['z_max']:.2f}",
        ]
        for row in oracle["mitsuba"]
    ]
    return (
        _about(oracle["header"])
        + "\n\nRelative RMSE, bias and largest error of the transmittance:\n\n"
        + _table(["case", *(f"`{q}`" for q in qualities)], map(line, oracle["exact"]))
        + "\n\nThe path tracer over Mitsuba 3.9.1, and the z-scores of tiles of 8 × 8 pixels:\n\n"
        + _table(["case", "paths a pixel", "ratio of the means", "std of z", "largest z"], paths)
    )


def _motion(rows: list[Row]) -> str:
    motions = list(dict.fromkeys(row["motion"] for row in rows))

    def cell(scene: str, motion: str, quality: str) -> str:
        found = next(
            r for r in rows if (r["scene"], r["motion"], r["quality"]) == (scene, motion, quality)
        )
        dark = f", {found['dark']:.0f} dark" if found["dark"] else ""
        return f"{_percent(found['frame'])} / {_percent(found['still'])}{dark}"

    keys = dict.fromkeys((row["quality"], row["scene"]) for row in rows)
    lines = [[f"`{s}`", f"`{q}`", *(cell(s, m, q) for m in motions)] for q, s in keys]
    return _table(("scene", "quality", *motions), lines)


def _soak(soak: Row) -> str:
    memory = soak["memory_mib"]
    half = memory[len(memory) // 2]
    equal = "equals" if soak["still_equals_new_process"] else "**differs from**"
    static = "equals" if soak["static_shot_equals_still"] else "**differs from**"
    held = "becomes the still" if soak["held_equals_still"] else "comes near the still"
    growth = soak["memory_growth_mib_per_1000_frames"]
    return (
        _about(soak["header"])
        + f"\n\n{soak['frames']} frames in {soak['seconds']:.0f} s, with {soak['cuts']} cuts. "
        f"{soak['broken_frames']} frames had a number that is not finite; values lie between "
        f"{_number(soak['lowest'])} and {_number(soak['highest'])} (the sun's disc). Of "
        f"{soak['stills_compared']} stills after cuts {soak['stills_that_differ']} differ from "
        f"those of a new renderer. The last still {equal} that of a new process byte for byte; a "
        f"static shot {static} the still byte for byte. The last frame, held for "
        f"{soak['held_frames']} frames, {held} (relative RMSE "
        f"{_percent(soak['held_rel_rmse'])}). Memory: {half[1]:.0f} MiB at frame {half[0]}, "
        f"{memory[-1][1]:.0f} MiB at the end, {growth:+.2f} MiB a 1000 frames over the second half."
    )


def _load(found: Row) -> str:
    text = f" The fastest of {found['header']['frames']} frames."
    if found["load"] is not None:
        text += f" Load average at the start: {found['load']:.1f}."
    return text


def profile(found: Row) -> str:
    """Tables of profiled frames: pass times, and texture reads of the march with their cost."""
    pixels = found["header"]["size"][0] * found["header"]["size"][1]
    software = found["header"]["adapter"]["kind"] == "cpu"
    clock = "processor" if software else "device"
    return "\n\n".join(_frame(f, found["read_ns"], pixels, clock) for f in found["frames"])


def _frame(frame: Row, read_ns: dict[str, float] | None, pixels: int, clock: str) -> str:
    wall, passes = frame["ms"], frame["passes_ms"]
    rest = {"not in a pass: copies, waiting": wall - sum(passes.values())} if passes else {}
    lines = [
        (name, f"{ms:.1f}", f"{100 * ms / wall:.1f} %")
        for name, ms in [*passes.items(), *rest.items(), ("the frame, by the clock", wall)]
    ]
    bakes = ", ".join(f"{name} {ms:.1f}" for name, ms in frame["bakes_ms"].items()) or "none"
    parts = [
        f"`{frame['scene']}`, `{frame['quality']}`; the first picture took "
        f"{frame['first_ms']:.0f} ms, of which bakes: {bakes}.",
        _table(["pass", "ms", "share of the frame"], lines),
    ]
    evaluations, march = frame["evaluations"], frame["march_ms"]
    counted = f"Density evaluations a pixel: {evaluations:.1f}"
    if march and evaluations:
        counted += (
            f", {1e6 * march / evaluations / pixels:.1f} ns each of the march's {march:.0f} ms of "
            f"{clock} time"
        )
    parts.append(counted + ".")
    reads = {name: n for name, n in frame["reads"].items() if n}
    lines = []
    ceiling = 0.0
    for name, n in reads.items():
        price, ms = "–", "–"
        if read_ns is not None:
            cost = 1e-6 * n * pixels * read_ns[name]
            ceiling += cost
            price, ms = f"{read_ns[name]:.2f}", f"{cost:.1f}"
        lines.append((f"`{name}`", f"{n:.1f}", price, ms))
    total = f"{ceiling:.1f}" if read_ns is not None else "–"
    lines.append(("all", f"{sum(reads.values()):.1f}", "", total))
    parts.append(_table(["texture", "reads a pixel", "ns a read", f"{clock} ms a frame"], lines))
    if march and ceiling:
        parts.append(
            f"Its reads alone would take {100 * ceiling / march:.0f} % of the {clock} time of the "
            "march."
        )
    return "\n\n".join(parts)


def memory(found: Row) -> str:
    """Table of the GPU memory of a renderer after the first frame."""
    held = found["frames"][0]["memory"]
    width, height = found["header"]["size"]
    lines = [(f"`{name}`", owner, _bytes(size)) for owner, name, size in held]
    total = {o: sum(size for owner, _, size in held if owner == o) for o in ("scene", "still")}
    return (
        _table(["texture or buffer", "of", "bytes"], lines)
        + f"\n\nWhat every picture reads (scene): {_megabytes(total['scene'])}. Buffers of the "
        f"frame itself (still) at {width}×{height}: {_megabytes(total['still'])}."
    )


def _bytes(size: int) -> str:
    return f"{size:,}".replace(",", " ")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"


def _heat(heat: Row) -> str:
    lines = [
        (row["stage"], f"{row['reads']:.1f}", f"{100 * row['share']:.2f} %", str(row["most"]))
        for row in heat["rows"]
    ]
    return (
        _about(heat["header"])
        + f" Scene: `{heat['header']['scene']}`; white is {heat['white']} reads or more.\n\n"
        + _table(["stage", "reads a pixel", "share of the first", "most in a pixel"], lines)
    )
