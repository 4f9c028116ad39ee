"""Per-pixel counts of the texture reads of the march.

The march itself counts its density evaluations only (the layer `samples`). Reads are counted by an
instrumented copy of the shaders in a temporary folder, which a separate process loads
(`NUBIS_SHADERS`), so that the shaders of ordinary renders stay as fast as they are.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import nubis
from benchmarks.reference import ROOT, Size

#: Textures that the march reads, by their names in shaders/wgsl/bindings.wgsl.
TEXTURES = (
    "profile_table",
    "broad_map",
    "weather_map",
    "shape_noise",
    "curl_noise",
    "detail_noise",
)

Counts = npt.NDArray[np.uint32]

# `quality.path_samples` has no effect on a march. In the copy it selects what is counted:
# evaluations up to this value, then the reads of each texture, then the reads of all.
_EVALUATIONS = 1000
_ALL = _EVALUATIONS + len(TEXTURES)


class Job(NamedTuple):
    """A picture, and the quantity to count: "evaluations", "reads", or the name of a texture."""

    camera: nubis.Camera
    params: nubis.Params
    quality: nubis.Quality
    what: str


def count(jobs: Sequence[Job], size: Size) -> list[Counts]:
    """Per-pixel counts of each job."""
    for job in jobs:
        traced = "path" in (job.quality.integrator, job.params.light.model)
        if job.params.volume is not None or traced or job.quality.integrator != "march":
            raise ValueError("only the march through procedural clouds is counted")
    with tempfile.TemporaryDirectory() as folder:
        counting_shaders(Path(folder))
        context = multiprocessing.get_context("spawn")
        with context.Pool(1, _use, (folder,)) as pool:
            return pool.starmap(_count, [(job, size) for job in jobs])


def counting_shaders(folder: Path) -> None:
    """Write a copy of the shaders into a folder that counts each read of `TEXTURES`."""
    source = Path(os.environ.get("NUBIS_SHADERS") or ROOT / "shaders" / "wgsl")
    shutil.copytree(source, folder, dirs_exist_ok=True)
    found, lines = [], []
    path = folder / "density.wgsl"
    for line in path.read_text().splitlines():
        indent = line[: len(line) - len(line.lstrip())]
        if line.strip() == "evaluations += 1u;":
            line = f"{indent}evaluations += u32(params.quality.path_samples <= {_EVALUATIONS}u);"
        for texture in re.findall(r"textureSampleLevel\((\w+)", line):
            found.append(texture)
            chosen = _EVALUATIONS + found.index(texture) + 1
            asked = "params.quality.path_samples"
            counts = f"{asked} == {chosen}u || {asked} == {_ALL + 1}u"
            lines.append(f"{indent}evaluations += u32({counts});")
        lines.append(line)
    path.write_text("\n".join(lines) + "\n")
    if tuple(found) != TEXTURES:
        raise ValueError(f"the clouds read {found}, where {TEXTURES} are counted")


def _use(folder: str) -> None:
    os.environ["NUBIS_SHADERS"] = folder
    warnings.filterwarnings("ignore", "no hardware Vulkan adapter")


def _count(job: Job, size: Size) -> Counts:
    chosen: dict[str, int] = {"evaluations": _EVALUATIONS, "reads": _ALL + 1}
    chosen |= {name: _EVALUATIONS + i for i, name in enumerate(TEXTURES, start=1)}
    quality = job.quality.replace(path_samples=chosen[job.what])
    layers: dict[str, Any] = nubis.Renderer(*size, quality=quality).render_layers(
        job.camera, job.params
    )
    return layers["samples"]
