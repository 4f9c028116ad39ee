"""`Quality.integrator`, its deprecated alias and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import nubis
from nubis import ParameterError

SIZE = 16, 9
CAMERA, SKY = nubis.scenes["fair_weather"]
SKY = SKY.with_(**{"light.model": "octaves"})
PATH = nubis.quality("draft").replace(integrator="path", path_samples=16, path_scatterings=64)


@pytest.fixture(scope="module")
def traced():
    return nubis.Renderer(*SIZE, quality=PATH).render_layers(CAMERA, SKY)


def test_the_light_model_path_is_an_alias_that_warns(traced):
    alias = nubis.Renderer(*SIZE, quality=PATH.replace(integrator="march"))
    params = SKY.with_(**{"light.model": "path"})
    with pytest.warns(DeprecationWarning, match=r"Quality\(integrator='path'\)"):
        layers = alias.render_layers(CAMERA, params)
    assert layers.keys() == traced.keys() and "standard_error" in traced
    for name, layer in layers.items():
        assert np.array_equal(layer, traced[name]), name


@pytest.mark.parametrize("model", ["single", "nubis2015", "thesis2018", "vsu2022"])
def test_paths_have_one_light_model(model):
    renderer = nubis.Renderer(*SIZE, quality=PATH)
    with pytest.raises(ParameterError, match=rf"light\.model = \"{model}.*octaves"):
        renderer.render(CAMERA, SKY.with_(**{"light.model": model}))


def test_seeds_are_independent_samples_of_one_picture(traced):
    """The means of two seeds differ by as much as their standard errors say."""
    other = nubis.Renderer(*SIZE, quality=PATH.replace(seed=7)).render_layers(CAMERA, SKY)
    error = np.hypot(traced["standard_error"], other["standard_error"])
    noisy = error > 1e-3 * traced["radiance"].max()
    assert noisy.mean() > 0.1
    deviation = (traced["radiance"] - other["radiance"])[noisy] / error[noisy]
    assert 0.5 < np.sqrt(np.mean(deviation**2)) < 2.0
    assert abs(np.mean(deviation)) < 0.5


def test_a_shot_that_stays_accumulates_paths():
    renderer = nubis.Renderer(*SIZE, quality=PATH)
    first, *_, last = renderer.animate((CAMERA, SKY, 0.0) for _ in range(4))
    assert np.array_equal(first, nubis.Renderer(*SIZE, quality=PATH).render(CAMERA, SKY))
    assert not np.array_equal(first, last)


def test_the_reference_is_an_integrator_with_a_tolerance():
    reference = nubis.quality("reference")
    assert (reference.integrator, reference.tolerance) == ("reference", 1e-3)
    assert all(nubis.quality(name).integrator == "march" for name in ("draft", "high", "vsu2022"))
    by_hand = nubis.quality("balanced").replace(integrator="reference", tolerance=1e-3)
    layers = nubis.Renderer(4, 3, quality=by_hand).render_layers(CAMERA, SKY)
    same = nubis.Renderer(4, 3, quality="reference").render_layers(CAMERA, SKY)
    assert all(np.array_equal(layers[name], same[name]) for name in same) and "change" in same
    with pytest.raises(ParameterError, match=r"tolerance"):
        nubis.Quality(tolerance=0.0)
