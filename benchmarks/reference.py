"""Reference pictures of the methods, cached in files."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
from pathlib import Path

import numpy as np

import nubis
from benchmarks.metrics import Layers

ROOT = Path(__file__).parents[1]
CACHE = ROOT / "out" / "benchmarks"

Size = tuple[int, int]


def reference_layers(scene: str, size: Size) -> Layers:
    """Converged layers of a scene in `reference` quality, from the cache if possible."""
    renderer = _renderer(size)
    path = CACHE / f"{scene}-{size[0]}x{size[1]}-{_key(scene, renderer)}.npz"
    if path.exists():
        with np.load(path) as file:
            return dict(file)
    layers = renderer.render_layers(*nubis.scenes[scene])
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}.npz")
    np.savez(unfinished, **layers)
    unfinished.replace(path)
    return layers


def about(size: Size) -> dict[str, object]:
    """Settings of the reference, for the header of the results."""
    return {"quality": _renderer(size).quality.to_dict()}


def shader_hash() -> str:
    """Hash of the names and contents of all shaders, and of the constants shared with Rust."""
    folder = Path(os.environ.get("NUBIS_SHADERS") or ROOT / "shaders" / "wgsl")
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.wgsl")):
        digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes())
    for file in sorted((ROOT / "crates" / "clouds_core" / "src").rglob("*.rs")):
        for block in re.findall(
            rb"^constants! \{.*?^\}", file.read_bytes(), re.DOTALL | re.MULTILINE
        ):
            digest.update(block)
    return digest.hexdigest()[:16]


def _key(scene: str, renderer: nubis.Renderer) -> str:
    camera, params = nubis.scenes[scene]
    view = [camera.kind, camera.eye, camera.forward, camera.up, camera.fov]
    key = [
        [view, params.to_dict(), renderer.size, renderer.quality.to_dict()],
        [nubis.__version__, shader_hash(), renderer.adapter],
    ]
    return hashlib.sha256(json.dumps(key).encode()).hexdigest()[:16]


@functools.cache
def _renderer(size: Size) -> nubis.Renderer:
    return nubis.Renderer(*size, quality="reference")
