"""Phase functions: normalised, with the mean cosine they promise, and exact where their peak is."""

import numpy as np
import pytest

import nubis
import twin
from nubis.testing import probe

G = [-0.9, -0.6, -0.25, 0.0, 0.25, 0.6, 0.9, 0.99, 0.999]


def shader_hg(one_minus_mu, g):
    inputs = np.stack(np.broadcast_arrays(one_minus_mu, g), axis=-1).reshape(-1, 2)
    return probe("henyey_greenstein(x.x, x.y)", inputs, imports=["phase"])[:, 0].astype(np.float64)


def test_integral_and_mean_cosine():
    """Over v = 1 - mu, in logarithmic steps from either end: at g = 0.999 the peak is a tenth of
    a degree wide.
    """
    half = np.logspace(-10, 0, 4000, dtype=np.float32).astype(np.float64)
    v = np.concatenate([[0], half, 2 - half[-2::-1], [2]])
    p = shader_hg(v[None], np.array(G)[:, None]).reshape(len(G), -1)
    np.testing.assert_allclose(2 * np.pi * np.trapezoid(p, v), 1, atol=1e-3)
    np.testing.assert_allclose(2 * np.pi * np.trapezoid(p * (1 - v), v), G, atol=1e-3)


@pytest.mark.parametrize("g", [0.6, 0.99, 0.999, 0.9999])
@pytest.mark.parametrize("sign", [1, -1])
def test_peak(g, sign):
    """Tiny angles from the forward (or, for negative g, backward) direction, at the very numbers
    that the shader gets.
    """
    angle = np.radians([0, 0.001, 0.01, 0.03, 0.1, 0.3, 1, 3, 10])
    v = 2 * np.sin(angle / 2) ** 2
    v = (v if sign > 0 else 2 - v).astype(np.float32).astype(np.longdouble)
    g = float(np.float32(sign * g))
    np.testing.assert_allclose(shader_hg(v, g), twin.henyey_greenstein(1 - v, g), rtol=2e-5)


def test_cosine_without_cancellation():
    """1 minus the cosine of unit vectors a hundredth of a degree apart and more; as 1 - dot it
    has no digit left.
    """
    angle = np.radians(np.concatenate([np.logspace(-2, 2.2, 30), [180]]))
    toward = np.array([0.6, 0.0, 0.8])
    across = np.array([0.8, 0.0, -0.6])
    a = np.cos(angle)[:, None] * toward + np.sin(angle)[:, None] * across
    a = a.astype(np.float32).astype(np.float64)
    got = probe("one_minus_cos(x.xyz, vec3f(0.6, 0.0, 0.8))", a, imports=["phase"])[:, 0]
    b = toward.astype(np.float32).astype(np.float64)
    expected = 0.5 * ((a - b) ** 2).sum(axis=1)
    np.testing.assert_allclose(got, np.minimum(expected, 2), rtol=1e-6)
    np.testing.assert_allclose(got, 2 * np.sin(angle / 2) ** 2, rtol=2e-3)
    assert got.max() <= 2


@pytest.mark.parametrize("model", ["single", "nubis2015", "thesis2018", "vsu2022"])
def test_phase_of_a_model(model):
    """One lobe (nubis2015), the larger of two (thesis2018), a blend of two (vsu2022)."""
    g, back, share = 0.7, -0.3, 0.35
    params = nubis.Params().with_(
        **{"light.model": model, "light.g": g, "light.g_back": back, "light.lobe_mix": share}
    )
    mu = np.linspace(-1, 1, 41)
    got = probe("model_phase(x.x)", 1 - mu, imports=["light"], params=params)[:, 0]
    forward, backward = twin.henyey_greenstein(mu, g), twin.henyey_greenstein(mu, back)
    expected = {
        "single": forward,
        "nubis2015": forward,
        "thesis2018": np.maximum(forward, backward),
        "vsu2022": share * forward + (1 - share) * backward,
    }
    np.testing.assert_allclose(got, expected[model], rtol=1e-5)
