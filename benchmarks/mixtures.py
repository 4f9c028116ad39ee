"""Memory and time of skies that differ in what kernels are specialized for.

    python -m benchmarks.mixtures --pictures 500

Each picture has random switches: light model, phase function, decks, rain, grid, camera, user's
grid. A second picture has the same switches under another sun: the first compiles kernels, the
second does not. Printed: resident memory of the process, and the median times of both kinds.
"""

from __future__ import annotations

import argparse
import statistics
from time import perf_counter

import numpy as np
from tqdm import tqdm

import nubis
from benchmarks import measure

SIZE = 32, 18
#: Pictures between two readings of the memory.
READING = 50
MODELS = "octaves", "single", "nubis2015", "thesis2018", "vsu2022", "path"
GRID = nubis.DensityGrid(
    np.full((8, 8, 8), 0.02, np.float32), ((-800, 200, 800), (800, 1800, 2000))
)


def sky(rng: np.random.Generator) -> tuple[nubis.Camera, nubis.Params]:
    """A camera and a sky with random switches."""
    model, phase, upper, rain, high, air, beams, shadows, grid, camera = (
        str(rng.choice(MODELS, p=(0.5, 0.1, 0.1, 0.1, 0.1, 0.1))),
        str(rng.choice(("henyey_greenstein", "droplet", "mie"))),
        *(bool(on) for on in rng.random(7) < 0.5),
        int(rng.integers(3)),
    )
    params = nubis.Params().with_(
        **{
            "light.model": model,
            "light.phase": phase,
            "upper_clouds.coverage": 0.5 * upper,
            "clouds.precipitation": 0.5 * rain,
            "high_clouds.coverage": 0.5 * high,
            "atmosphere.enabled": air,
            "atmosphere.light_shafts": beams,
            "atmosphere.ground_shadows": shadows,
            "clouds.coverage": float(rng.uniform(0.2, 0.8)),
        }
    )
    if grid:
        params = params.replace(volume=GRID)
    eye = (0.0, 0.0, 200.0)
    cameras = (
        nubis.Camera.look_at(eye, (900.0, 700.0, 500.0), fov_y=60.0),
        nubis.Camera.equirect(eye),
        nubis.Camera.fisheye(eye),
    )
    return cameras[camera], params


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pictures", type=int, default=500)
    parser.add_argument("--quality", default="draft")
    arguments = parser.parse_args()
    rng = np.random.default_rng(1)
    renderer = nubis.Renderer(*SIZE, quality=arguments.quality)
    times: dict[str, list[float]] = {"new": [], "known": []}
    for number in tqdm(range(1, arguments.pictures // 2 + 1)):
        camera, params = sky(rng)
        for kind in times:
            sun = float(rng.uniform(5, 60))
            started = perf_counter()
            renderer.render(camera, params.with_(**{"sun.elevation": sun}))
            times[kind].append(perf_counter() - started)
        if 2 * number % READING == 0:
            tqdm.write(f"{2 * number:5d} pictures  {measure.resident_memory():6.0f} MiB")
    for kind, taken in times.items():
        median = 1e3 * statistics.median(taken)
        print(f"{kind} switches: {len(taken)} pictures, median {median:.0f} ms")


if __name__ == "__main__":
    main()
