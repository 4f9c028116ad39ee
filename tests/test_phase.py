"""Phase functions: normalised, with the mean cosine they promise, and exact where their peak is;
those of droplets against Mie's theory by miepython (tests/references/make.py).
"""

import json
from pathlib import Path

import numpy as np
import pytest

import nubis
import ref64
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
    np.testing.assert_allclose(shader_hg(v, g), ref64.henyey_greenstein(1 - v, g), rtol=2e-5)


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
    forward, backward = ref64.henyey_greenstein(mu, g), ref64.henyey_greenstein(mu, back)
    expected = {
        "single": forward,
        "nubis2015": forward,
        "thesis2018": np.maximum(forward, backward),
        "vsu2022": share * forward + (1 - share) * backward,
    }
    np.testing.assert_allclose(got, expected[model], rtol=1e-5)


MIE = json.loads((Path(__file__).parent / "references" / "mie.json").read_text())
DIAMETERS = [5.0, 10.0, 20.0, 50.0]
ANGLES = np.array(MIE["angles"])


def droplets(phase, diameter, model="single", **light):
    changes = {"model": model, "phase": phase, "droplet_diameter": diameter, **light}
    return nubis.Params().with_(**{f"light.{name}": value for name, value in changes.items()})


def cloud_phase(one_minus_mu, params, call="model_phase(x.x)"):
    return probe(call, one_minus_mu, imports=["light"], params=params)[:, 0].astype(np.float64)


def sphere():
    """1 - cos over the sphere, at angles that are dense where peak and glory are, in float32."""
    angle = np.pi * np.sin(0.5 * np.pi * np.linspace(0, 1, 6001)) ** 2
    return (2 * np.sin(angle / 2) ** 2).astype(np.float32).astype(np.float64)


def over_sphere(values, v):
    return 2 * np.pi * np.trapezoid(values, v)


@pytest.mark.parametrize("diameter", DIAMETERS)
@pytest.mark.parametrize("phase", ["droplet", "mie"])
def test_droplets_scatter_all_light(phase, diameter):
    """The integral is 1; the mean cosine of the baked function is Mie's, that of the fit near it
    (it is fitted to 95 % of the light), and a twentieth of the light goes backward.
    """
    v = sphere()
    p = cloud_phase(v, droplets(phase, diameter))
    assert np.isfinite(p).all() and (p > 0).all()
    assert over_sphere(p, v) == pytest.approx(1, abs=2e-3)
    cosine = MIE["droplets"][f"{diameter:.0f}"]["mean_cosine"]
    assert over_sphere(p * (1 - v), v) == pytest.approx(
        cosine, abs=2e-3 if phase == "mie" else 0.03
    )
    back = v >= 1
    assert 0.02 < over_sphere(p[back], v[back]) < 0.08


@pytest.mark.parametrize("peak", [1.0, 0.5, 0.1, 0.0])
@pytest.mark.parametrize("diameter", DIAMETERS)
def test_fit_of_droplets(diameter, peak):
    v = sphere()
    params = droplets("droplet", diameter)
    got = cloud_phase(v, params, f"droplet_fit(x.x, {peak})")
    np.testing.assert_allclose(
        got, ref64.droplet(1 - v.astype(np.longdouble), diameter, peak), 2e-4
    )
    if peak == 1:
        np.testing.assert_array_equal(cloud_phase(v, params), got)
    if peak == 0:
        np.testing.assert_allclose(got, 1 / (4 * np.pi), rtol=1e-6)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("diameter", DIAMETERS)
def test_mie(diameter):
    """Twice as many colours by another program. The rings of the largest droplets, half a degree
    wide, are what fewer see less well.
    """
    expected = np.array(MIE["droplets"][f"{diameter:.0f}"]["phase"])
    got = cloud_phase(2 * np.sin(np.radians(ANGLES) / 2) ** 2, droplets("mie", diameter))
    error = np.abs(got / expected - 1)
    assert np.sqrt((error**2).mean()) < (0.03 if diameter < 50 else 0.07)
    assert error.max() < 0.2


@pytest.mark.parametrize("diameter", DIAMETERS)
def test_bow_and_glory(diameter):
    """The fit has the forward peak and neither bow nor glory; Mie's function has all three."""
    degrees = np.array([100.0, 120.0, 150.0, 165.0, 178.0, 178.5, 179.0, 180.0])
    bow = np.arange(134.0, 150.0)
    v = 2 * np.sin(np.radians(np.concatenate([degrees, bow])) / 2) ** 2
    mie = cloud_phase(v, droplets("mie", diameter))
    fit = cloud_phase(v, droplets("droplet", diameter))
    assert 138 <= bow[np.argmax(mie[8:])] <= 147
    assert mie[8:].max() > 3 * mie[1]
    assert mie[4:8].max() > 2 * mie[3]
    assert (np.diff(fit[8:]) > 0).all() and fit[8:].max() < 1.4 * fit[8:].min()
    assert fit[4:8].max() < 1.1 * fit[3]
    # As bright as each other in the forward peak's flank, where Henyey and Greenstein are not.
    flank = 2 * np.sin(np.radians([10.0, 20.0, 40.0]) / 2) ** 2
    ratio = cloud_phase(flank, droplets("droplet", diameter)) / cloud_phase(
        flank, droplets("mie", diameter)
    )
    assert (np.abs(ratio - 1) < 0.35).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("model", ["nubis2015", "thesis2018", "vsu2022", "octaves", "path"])
def test_droplets_in_every_model(model):
    """The published models take the function as it is; octaves lose a share of each lobe."""
    v, depth = sphere()[::200], 0.7
    light = {"octaves": 3, "octave_scattering": 0.6, "octave_extinction": 0.3, "octave_phase": 0.4}
    light |= {"albedo": 0.9}
    for phase in ("droplet", "mie"):
        params = droplets(phase, 20.0, model, **light)
        first = cloud_phase(v, droplets(phase, 20.0))
        if model not in ("octaves", "path"):
            np.testing.assert_array_equal(cloud_phase(v, params), first)
            continue
        got = cloud_phase(v, params, f"sun_scattering({depth}, 0.0, x.x)")
        expected = first * np.exp(-depth) + sum(
            0.6**i * ref64.droplet(1 - v, 20.0, 0.4**i) * np.exp(-(0.3**i) * depth) for i in (1, 2)
        )
        np.testing.assert_allclose(got, 0.9 * expected, rtol=2e-4)


@pytest.mark.parametrize("diameter", [5.0, 20.0, 50.0])
@pytest.mark.parametrize("phase", ["droplet", "mie"])
def test_sampled_directions(phase, diameter):
    """Samples with their weights give the integrals of the function: Legendre moments, and the
    light within a degree, between 138 and 146 and beyond 177 degrees. 2^16 samples in rows; the
    tolerance is five standard errors of independent ones.
    """
    params = droplets(phase, diameter)
    count = 256
    row, column = np.meshgrid(*(np.random.default_rng(i).permutation(count) for i in (1, 2)))
    shift = np.random.default_rng(3).random((2, count, count))
    u = np.stack([(row + shift[0]) / count, (column + shift[1]) / count], axis=-1).reshape(-1, 2)
    u = np.minimum(u, 1 - 2**-24)
    got = probe("vec4f(droplet_sample(x.xy), 0.0, 0.0)", u, imports=["light"], params=params)
    cosine, weight = 1 - got[:, 0].astype(np.float64), got[:, 1].astype(np.float64)
    assert np.abs(cosine).max() <= 1 and np.isfinite(weight).all()
    assert abs(weight - 1).max() < 0.2
    v = sphere()
    p = cloud_phase(v, params)

    def between(low, high):
        low, high = (np.cos(np.radians(angle)) for angle in (low, high))
        return lambda mu: (mu <= low) & (mu >= high)

    for weigh in (
        lambda mu: np.ones_like(mu),
        lambda mu: mu,
        lambda mu: 1.5 * mu**2 - 0.5,
        lambda mu: 2.5 * mu**3 - 1.5 * mu,
        between(0, 1.0),
        between(20, 60),
        between(138, 146),
        between(177, 180),
    ):
        values = weight * weigh(cosine)
        expected = over_sphere(p * weigh(1 - v), v)
        assert values.mean() == pytest.approx(
            expected, abs=5 * values.std() / count + 2e-3 * expected
        )


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("diameter", [5.0, 50.0])
@pytest.mark.parametrize("phase", ["henyey_greenstein", "droplet", "mie"])
def test_no_nan_at_the_ends(phase, diameter):
    """Straight forward and back, and at what rounding makes of these."""
    v = np.array([0, 1e-45, 1e-38, 1e-20, 1e-12, 1e-7, 1, 2 - 1e-6, 2 - 2**-23, 2])
    for g in (0.9999, -0.9999, 0.0):
        for model in ("single", "thesis2018", "vsu2022", "octaves"):
            params = droplets(phase, diameter, model, g=g, g_back=-0.9999)
            for call in ("model_phase(x.x)", "sun_scattering(0.0, 0.0, x.x)"):
                got = cloud_phase(v, params, call)
                assert np.isfinite(got).all() and (got > 0).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("phase", ["henyey_greenstein", "droplet", "mie"])
def test_paths_of_one_scattering(renderer, phase):
    """A path cut after its first scattering is single scattering, whatever the function: in a
    box of fog, toward the sun, at the bow and at the glory.
    """
    params = ref64.smooth_params(
        **{
            "light.phase": phase,
            "light.droplet_diameter": 10.0,
            "light.albedo": 0.9,
            "light.g": 0.85,
            "light.ambient_gain": 0.0,
            "sun.elevation": 50.0,
            "sun.azimuth": 70.0,
            "sun.irradiance": (3.0, 2.0, 1.0),
        }
    )
    low, high = (-500.0, -500.0, 3000.0), (500.0, 500.0, 4000.0)
    grid = nubis.DensityGrid(np.full((2, 2, 2), 1e-3, np.float32), (low, high))
    params = params.replace(volume=grid)
    path = nubis.quality("draft").replace(path_samples=400, path_scatterings=1)
    sun = ref64.sun_direction(params)
    for degrees in (0.0, 40.0, 142.0, 178.0):
        # In the vertical plane of the sun, away from the zenith.
        across = np.cross(np.cross(sun, [0, 0, 1.0]), sun)
        angle = np.radians(degrees)
        ray = np.cos(angle) * sun + np.sin(angle) * across / np.linalg.norm(across)
        eye = np.array([0, 0, 3500.0]) - 3000 * ray
        camera = nubis.Camera.look_at(eye, eye + ray, up=(1, 0, 0.1), fov_y=0.6)
        single, traced = (
            renderer(16, 16, q).render_layers(camera, params.with_(**{"light.model": model}))
            for model, q in (("single", "reference"), ("path", path))
        )
        mean = single["radiance"].mean(axis=(0, 1))
        assert mean.min() > 0
        np.testing.assert_allclose(traced["radiance"].mean(axis=(0, 1)), mean, rtol=0.02)
