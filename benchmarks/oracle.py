"""Errors of the qualities against other programs, on the cases of tests/test_oracle.py.

python -m benchmarks.oracle
"""

from __future__ import annotations

import json
import sys

import numpy as np
from tqdm import tqdm

import nubis
from benchmarks import measure, reference
from benchmarks.__main__ import RESULTS

sys.path.insert(0, str(reference.ROOT / "tests"))
import test_oracle

QUALITIES = "reference", "high", "balanced"
# Paths per pixel: the standard error of the mean is at most about a quarter of a percent.
PATHS = {"tau_60": 4096, "tau_20": 768}


def main() -> None:
    rows = []
    for name in tqdm(test_oracle.EXACT):
        case, want = test_oracle.stored(f"exact_{name}")
        cloudy = want["transmittance"] < np.exp(-1e-3)
        mean = want["radiance"][cloudy].mean()
        row = {"case": name.replace("_", ", ")}
        for quality in QUALITIES:
            renderer = nubis.Renderer(case["width"], case["height"], quality=quality)
            layers = renderer.render_layers(*test_oracle.scene(case))
            got = layers["radiance"][..., 0] / test_oracle.IRRADIANCE[0]
            error = (got - want["radiance"])[cloudy]
            row[quality] = {
                "rel_rmse": float(np.sqrt(np.mean(error**2)) / mean),
                "bias": float(error.mean() / mean),
                "t_max": float(np.abs(layers["transmittance"] - want["transmittance"]).max()),
            }
        rows.append(row)
    paths = []
    for name in tqdm(test_oracle.MITSUBA):
        case, want = test_oracle.stored(f"mitsuba_{name}")
        method = test_oracle.paths(PATHS.get(name, 512), case["scatterings"] or 4096)
        camera, params = test_oracle.scene(case, **{"light.model": "path"})
        renderer = nubis.Renderer(case["width"], case["height"], quality=method)
        layers = renderer.render_layers(camera, params)
        scale = test_oracle.IRRADIANCE[0]
        got = test_oracle.tiles(layers["radiance"])[..., 0] / scale
        noise = np.sqrt(test_oracle.tiles(layers["standard_error"] ** 2)[..., 0] / 64) / scale
        sigma = np.hypot(noise, want["tiles_error"])
        bright = want["tiles"] > 0.05 * want["tiles"].max()
        z = ((got - want["tiles"]) / np.maximum(sigma, 1e-30))[bright]
        paths.append(
            {
                "case": name.replace("_", " "),
                "paths": method.path_samples,
                "ratio": float(got.mean() / want["tiles"].mean()),
                "ratio_error": float(np.sqrt((sigma**2).sum()) / sigma.size / want["tiles"].mean()),
                "z_std": float(z.std()),
                "z_max": float(np.abs(z).max()),
            }
        )
    result = {"header": measure.header(["benchmarks.oracle"]), "exact": rows, "mitsuba": paths}
    (RESULTS / "oracle.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
