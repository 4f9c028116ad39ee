"""Error metrics against the reference, as defined in docs/accuracy.md."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

Layers = dict[str, npt.NDArray[Any]]

#: Optical depth of the reference above which a pixel counts as cloud. Clear sky is exact with every
#: method and would dilute the mean.
CLOUD = 1e-3


def errors(test: Layers, reference: Layers) -> dict[str, float | None]:
    """Return all error metrics of the layers of a picture."""
    x, r = (layers["radiance"].astype(float) for layers in (test, reference))
    t, t_ref = (layers["transmittance"].astype(float) for layers in (test, reference))
    cloud = t_ref < np.exp(-CLOUD)
    difference = x[cloud] - r[cloud]
    mean = r[cloud].mean() if cloud.any() else np.nan
    return {
        "rel_rmse": float(np.sqrt(np.mean(difference**2)) / mean),
        "bias": float(np.mean(difference) / mean),
        "p999": float(np.percentile(np.abs(x - r).max(axis=-1), 99.9)),
        "t_rmse": float(np.sqrt(np.mean((t - t_ref) ** 2))),
        "t_max": float(np.abs(t - t_ref).max()),
        "flip": flip(composed(test, reference["sky"]), composed(reference, reference["sky"])),
    }


def composed(layers: Layers, sky: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Composite of clouds over a sky: that of the reference, for every method."""
    picture = layers["radiance"] + layers["transmittance"][..., None] * sky
    return picture.astype(np.float32)


def flip(test: npt.NDArray[Any], reference: npt.NDArray[Any]) -> float | None:
    """Mean HDR-FLIP at its default of 67 pixels per degree, None if it is not installed."""
    if find_spec("flip_evaluator") is None:
        return None
    import flip_evaluator

    # Exposures come from the first argument, and are the same for all methods.
    _, mean, _ = flip_evaluator.evaluate(reference, test, "HDR", applyMagma=False)
    return float(mean)


def enlarge(image: npt.NDArray[Any], factor: int) -> npt.NDArray[np.float64]:
    """Bilinear upsampling between pixel centres, clamped at the border (thesis2018)."""
    for axis in (0, 1):
        n = image.shape[axis]
        at = np.clip((np.arange(n * factor) + 0.5) / factor - 0.5, 0, n - 1)
        low = np.minimum(at.astype(int), max(n - 2, 0))
        share = (at - low).reshape([-1 if a == axis else 1 for a in range(image.ndim)])
        high = np.minimum(low + 1, n - 1)
        image = image.take(low, axis) * (1 - share) + image.take(high, axis) * share
    return image
