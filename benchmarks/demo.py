"""Frame times of flights in the demo, on a virtual display (Xvfb).

python -m benchmarks.demo
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks import measure, page
from benchmarks.reference import ROOT

RESULTS = Path(__file__).parent / "results"
SCENES = "fair_weather", "sunset", "above", "storm"
#: Requested frames per second: the default of the demo on a CPU, and twice that.
RATES = 10, 20
_LINE = re.compile(r"median (\d+), 95 % (\d+), worst (\d+); (\d+) x (\d+) pixels")


@contextmanager
def display(size: str) -> Iterator[str]:
    """Start Xvfb and yield the name of its display."""
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", f"{size}x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        yield f":{server.stdout.readline().decode().strip()}"
        server.terminate()


def fly(scene: str, rate: int, frames: int, size: str) -> dict[str, Any]:
    """Frame times in ms of a forward flight through a scene."""
    demo = ROOT / "target" / "release" / "clouds_demo"
    arguments = ["--scene", scene, "--rate", str(rate), "--frames", str(frames), "--size", size]
    with display(size) as name:
        result = subprocess.run(
            [demo, "--fly", *arguments],
            env=os.environ | {"DISPLAY": name},
            check=True,
            capture_output=True,
            text=True,
        )
    pictures, keys = ([int(n) for n in found.groups()] for found in _LINE.finditer(result.stdout))
    median, slow, worst, *pixels = pictures
    times = {"median": median, "slow": slow, "worst": worst, "longest_wait": keys[2]}
    return {"scene": scene, "rate": rate, "size": pixels} | times


def main() -> None:
    """Measure, write benchmarks/results/demo.json, and update docs/demo.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.demo", description=__doc__)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--size", default="1280x720", metavar="WxH")
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "clouds_demo"], cwd=ROOT, check=True)
    command = ["benchmarks.demo", "--frames", str(args.frames), "--size", args.size]
    width, height = (int(n) for n in args.size.split("x"))
    header = measure.header(command) | {"size": (width, height), "repeats": 1}
    rows = [fly(scene, rate, args.frames, args.size) for scene in SCENES for rate in RATES]
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "demo.json").write_text(
        json.dumps({"header": header, "rows": rows}, indent=1) + "\n"
    )
    page.write_demo(RESULTS)


if __name__ == "__main__":
    main()
