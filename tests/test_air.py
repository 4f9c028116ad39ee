"""The air: its radiance against paths traced in float64, its look, its tables, and clouds in it."""

import json
from itertools import pairwise

import air_twin
import numpy as np
import pytest

import nubis
from nubis.testing import probe

CLEAR = {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0, "sun.visible": False}
UNIT = {"sun.irradiance": (1.0, 1.0, 1.0)}


def clear(**changes):
    return nubis.Params().with_(**{**CLEAR, **UNIT, **changes})


def looking(direction, height=2.0, fov=1e-3):
    eye = np.array([0.0, 0.0, height])
    up = (0.0, 1.0, 0.3) if abs(direction[2]) > 0.9 else (0.0, 0.0, 1.0)
    return nubis.Camera.look_at(eye, eye + 1000 * np.asarray(direction), up, fov)


def sky(renderer, params, direction, height):
    return renderer(1, 1).render_layers(looking(direction, height), params)["sky"][0, 0]


def test_radiance_of_the_air(renderer):
    """Every case that was traced, all orders: within 5 %, what the paths are unsure of aside."""
    cases = json.loads(air_twin.FILE.read_text())
    got, expected, unsure = [], [], []
    for case in cases:
        direction = air_twin.direction_of(case["view"], case["azimuth"])
        params = clear(**{"sun.elevation": case["sun"], "sun.azimuth": 0.0})
        got.append(sky(renderer, params, direction, case["eye"]))
        expected.append(case["radiance"])
        unsure.append(case["error"])
    got, expected, unsure = map(np.array, (got, expected, unsure))
    # Where next to nothing is seen: 1e-6 of the irradiance.
    error = np.abs(got - expected) / (expected + 1e-6)
    excess = error - 3 * unsure / (expected + 1e-6)
    for case, g, e, x in zip(cases, got, expected, excess, strict=True):
        if x.max() > 0.05:
            print(case["sun"], case["eye"], case["view"], case["azimuth"], g / e - 1, x)
    assert len(cases) > 100
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert excess.max() < 0.05
