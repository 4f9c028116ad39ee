"""Command line of the error and scaling benchmarks."""

from __future__ import annotations

import argparse
import csv
import json
import shlex
import sys
import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import nubis
from benchmarks import measure, methods, page, plots, reference, shapes

RESULTS = Path(__file__).parent / "results"
QUICK = reference.CACHE / "quick"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure the error of every method against its time.",
        epilog="NUBIS_ADAPTER chooses the adapter.",
    )
    names = [m.name for m in methods.full()]
    parser.add_argument("--scenes", nargs="+", metavar="S", choices=list(nubis.scenes))
    parser.add_argument(
        "--methods",
        nargs="+",
        metavar="M",
        help=f"names or families of methods: {', '.join(names)}",
    )
    parser.add_argument("--size", metavar="WxH", help="pixels (default: 192x108)")
    parser.add_argument("--repeats", type=int, help="renders by the clock, 5 unless --quick")
    parser.add_argument("--quick", action="store_true", help="a little of everything, 64x36")
    parser.add_argument(
        "--parts", nargs="+", choices=["error", "shapes"], default=["error", "shapes"]
    )
    parser.add_argument("--out", type=Path, help=f"folder of the results (default: {RESULTS})")
    parser.add_argument(
        "--plots-only", action="store_true", help="draw again what was measured, and write the page"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write and plot the results, and update docs/accuracy.md."""
    parser = _parser()
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    args = parser.parse_args(arguments)
    out = args.out or (QUICK if args.quick else RESULTS)
    if not args.plots_only:
        out.mkdir(parents=True, exist_ok=True)
        with warnings.catch_warnings():
            # Redundant: the results hold the adapter.
            warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
            _measure(parser, args, out, shlex.join(arguments))
    if find_spec("matplotlib"):
        plots.draw(out)
    else:
        print("no plots: matplotlib is not installed (pip install 'nubis[bench]')", file=sys.stderr)
    if out.resolve() == RESULTS:
        page.write(out)


def _measure(
    parser: argparse.ArgumentParser, args: argparse.Namespace, out: Path, command: str
) -> None:
    width, _, height = (args.size or ("64x36" if args.quick else "192x108")).partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        parser.error(f"--size: {args.size!r} is no size such as 192x108")
    size = int(width), int(height)
    repeats = args.repeats or (2 if args.quick else 5)
    scenes = args.scenes or measure.marched()[:: 6 if args.quick else 1]
    chosen = methods.quick() if args.quick else methods.full()
    if args.methods:
        known = {m.name for m in chosen} | {m.family for m in chosen}
        if unknown := [name for name in args.methods if name not in known]:
            parser.error(f"--methods: there is no {unknown[0]!r} among {sorted(known)}")
        chosen = [m for m in chosen if m.name in args.methods or m.family in args.methods]
    for method in chosen if "error" in args.parts else ():
        if size[0] % method.divisor or size[1] % method.divisor:
            parser.error(f"--size: {method.name!r} needs a multiple of {method.divisor}")

    head = measure.header(["benchmarks", command]) | {"size": size, "repeats": repeats}
    if "error" in args.parts:
        head_error = head | {
            "seeds": measure.seeds(scenes),
            "reference": reference.about(size),
        }
        rows = measure.measure(scenes, chosen, size, repeats)
        _write_json(out / "results.json", {"header": head_error, "rows": rows})
        with open(out / "results.csv", "w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
    if "shapes" in args.parts:
        found = shapes.measure(size, repeats, quick=args.quick)
        _write_json(out / "shapes.json", {"header": head} | found)


def _write_json(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=1) + "\n")


if __name__ == "__main__":
    main()
