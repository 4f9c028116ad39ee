"""Profile of a frame: pass times, density evaluations, texture reads, memory.

    python -m benchmarks.profile --scenes fair_weather --quality balanced --size 1280x720

The cost of one texture read is measured on the same adapter by loops of reads alone
(shaders/wgsl/read_cost.wgsl). The number of reads of a frame times that cost is a lower bound of
the time of the march. On a software adapter both are CPU time of all threads, which hardly depends
on other load of the machine, as wall-clock time does.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import nubis
from benchmarks import counts, measure, page
from benchmarks.measure import Row
from benchmarks.reference import Size

RESULTS = Path(__file__).parent / "results" / "profile.json"
#: Passes that read the cloud textures.
MARCH = "march", "march_list"


def read_costs(repeats: int = 10) -> dict[str, float] | None:
    """Nanoseconds per read of each texture, or None on an adapter without timestamps.

    Neighbouring invocations read neighbouring texels, and rays advance by about a texel, as in a
    march of near clouds. Reads are from the finest mip level. The result is the minimum of
    `repeats` runs less that of an empty loop.
    """
    renderer = nubis.Renderer(1, 1)
    software = renderer.adapter.kind == "cpu"
    rays, reads = (1 << 14 if software else 1 << 19), 512
    rng = np.random.default_rng(1)
    groups = rng.uniform(0, 40, (rays // 64, 1, 3))  # within every texture
    beside = 0.25 * np.arange(64)[:, None] * [1.0, 0.0, 0.0]
    starts = np.concatenate([groups + beside, np.full((rays // 64, 64, 1), reads)], axis=-1)
    points = starts.reshape(-1, 4).astype(np.float32).tolist()
    params = nubis.Params()

    def best(function: str) -> float | None:
        seen = []
        for _ in range(repeats + 1):
            call = f"vec4f({function}(x.xyz, u32(x.w)))"
            used = process_time()
            renderer._core.probe(["read_cost"], call, points, params, (0.0, 0.0, 0.0), 0.0)
            used = 1000 * (process_time() - used)
            # The upload of the points is part of the empty loop, too.
            seen.append(used if software else renderer.timings.get("probe"))
        return None if None in seen else min(seen[1:])

    empty = best("no_reads")
    if empty is None:
        return None
    added = {name: (best(f"reads_of_{name}") or 0.0) - empty for name in counts.TEXTURES}
    return {name: 1e6 * max(ms, 0.0) / (rays * reads) for name, ms in added.items()}


def frame(scene: str, quality: str, size: Size, repeats: int) -> Row:
    """Profile of one scene: its fastest frame, the bakes before it, and its texture reads.

    The fastest frame is the one least disturbed by other load, as are the measured read costs.
    """
    camera, params = nubis.scenes[scene]
    renderer = nubis.Renderer(*size, quality=quality)
    started = perf_counter()
    renderer.render(camera, params)
    first = 1000 * (perf_counter() - started)
    bakes = dict(renderer.timings)
    frames = []
    for _ in range(repeats):
        started, used = perf_counter(), process_time()
        renderer.render(camera, params)
        clock, used = perf_counter() - started, process_time() - used
        frames.append((1000 * clock, 1000 * used, dict(renderer.timings)))
    wall, _, passes = min(frames, key=lambda f: f[0])
    march = sum(passes.get(name, 0.0) for name in MARCH)
    if renderer.adapter.kind == "cpu" and march:
        march *= min(used for _, used, _ in frames) / sum(passes.values())
    kinds = ["evaluations", *counts.TEXTURES]
    jobs = [counts.Job(camera, params, renderer.quality, kind) for kind in kinds]
    means = [float(c.mean()) for c in counts.count(jobs, size)]
    return {
        "scene": scene,
        "quality": quality,
        "ms": wall,
        "passes_ms": passes,
        "march_ms": march,
        "first_ms": first,
        "bakes_ms": {name: ms for name, ms in bakes.items() if name not in passes},
        "evaluations": means[0],
        "reads": dict(zip(counts.TEXTURES, means[1:], strict=True)),
        "memory": renderer._core.memory(),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write the results, and update docs/speed.md."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.profile",
        description="Where the time of a frame goes.",
        epilog="NUBIS_ADAPTER chooses the adapter.",
    )
    parser.add_argument(
        "--scenes", nargs="+", metavar="S", choices=list(nubis.scenes), default=["fair_weather"]
    )
    parser.add_argument("--quality", default="balanced", metavar="NAME")
    parser.add_argument("--size", default="1280x720", metavar="WxH", help="default: 1280x720")
    parser.add_argument("--repeats", type=int, default=5, help="frames (default: 5)")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FILE")
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    args = parser.parse_args(arguments)
    width, _, height = args.size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        parser.error(f"--size: {args.size!r} is no size such as 1280x720")
    size = int(width), int(height)
    command = f"benchmarks.profile {shlex.join(arguments)}".strip().split()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
        found = {
            "header": measure.header(command) | {"size": size, "frames": args.repeats},
            "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
            "read_ns": read_costs(),
            "frames": [frame(s, args.quality, size, args.repeats) for s in args.scenes],
        }
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(json.dumps(found, indent=1) + "\n")
    print(page.profile(found))
    print("\n" + page.memory(found))
    if args.out.resolve() == RESULTS:
        page.write_speed(args.out.parent)


if __name__ == "__main__":
    main()
