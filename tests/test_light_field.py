"""The light field: against a float64 reference implementation, closed forms, other programs'
slabs, and path-traced clouds.
"""

import numpy as np
import pytest

import nubis
import ref64_light_field as ref64
from nubis.testing import solve_light


def light(g=0.85, albedo=1.0):
    return nubis.Params(light=nubis.params.Light(model="multiple", g=g, albedo=albedo))


def toward(elevation, azimuth=50.0):
    """Unit vector toward the sun; degrees, clockwise from north."""
    e, a = np.radians([elevation, azimuth])
    return float(np.cos(e) * np.sin(a)), float(np.cos(e) * np.cos(a)), float(np.sin(e))


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("cell", [(100.0, 100.0, 100.0), (900.0, 800.0, 60.0), (70.0, 70.0, 90.0)])
def test_sweeps_against_the_reference_implementation(rng, cell, periodic):
    """Every cell, after six sweeps; cubes, flat cells, tall cells; two fields at once."""
    shape = 6, 5, 7
    extinction = rng.uniform(0, 0.05, shape) * (rng.uniform(size=shape) < 0.6)
    extinction = extinction.astype(np.float16).astype(float)
    sun = toward(35)
    params = light(0.8, 0.98)
    of_sun, of_sky, deposits, factor = solve_light(
        extinction, cell, sun, periodic=periodic, sweeps=6, params=params
    )
    scale = ref64.split(0.8, 0.98)[1]
    np.testing.assert_allclose(deposits[0], scale * extinction, rtol=1e-3)
    beam = factor * deposits[1].astype(float)
    for got, want in zip(
        (of_sun, of_sky),
        ref64.solve(extinction, cell, sun, 0.8, 0.98, beam, periodic=periodic, sweeps=6),
        strict=True,
    ):
        np.testing.assert_allclose(got, want, atol=4e-3 * np.abs(want[0]).max())


def slab(depth, elevation, cells, *, albedo=1.0, sweeps=400):
    """Field of a homogeneous slab of 1 km with an empty row below and above."""
    # As many cells across as make the tilted lines rise by nearly their own slope.
    extinction = np.zeros((cells + 2, 25, 25))
    extinction[1:-1] = depth / 1000.0
    high = 1000.0 / cells
    return solve_light(
        extinction, (high,) * 3, toward(elevation), sweeps=sweeps, params=light(0.85, albedo)
    )


#: Plane albedo by Monte Carlo (within 0.0015): optical depth, sine of the sun's elevation, cells
#: through the slab, plane albedo, tolerance. Henyey-Greenstein, g = 0.85, no absorption.
SLABS = [
    (5, 0.894, 6, 0.278, 0.025),
    (5, 0.447, 6, 0.488, 0.035),
    (20, 0.894, 6, 0.639, 0.012),
    (20, 0.447, 6, 0.750, 0.012),
    (20, 0.0905, 6, 0.862, 0.045),
    (80, 0.894, 22, 0.880, 0.012),
    (80, 0.447, 22, 0.916, 0.012),
    (80, 0.0905, 22, 0.955, 0.045),
]


@pytest.mark.parametrize(("depth", "sine", "cells", "albedo", "tolerance"), SLABS)
def test_slabs(depth, sine, cells, albedo, tolerance):
    """What a slab reflects is right, and with what it transmits all that comes in."""
    of_sun, _, deposits, factor = slab(depth, np.degrees(np.arcsin(sine)), cells)
    scale = ref64.split(0.85, 1.0)[1]
    reflected = of_sun[3, -1].mean() / sine
    straight = np.exp(-scale * depth / sine)
    transmitted = straight - of_sun[3, 0].mean() / sine
    assert reflected == pytest.approx(albedo, abs=tolerance)
    assert reflected + transmitted == pytest.approx(1, abs=2e-3)
    # What the cells take is what the sun loses.
    taken = factor * (deposits[0] * deposits[1]).sum(0).mean() * 1000 / cells
    assert taken == pytest.approx(sine * (1 - straight), rel=2e-3)


@pytest.mark.parametrize(("depth", "cells", "albedo"), [(20, 6, 0.699), (80, 22, 0.898)])
def test_a_uniform_sky_over_a_slab(depth, cells, albedo):
    _, of_sky, _, _ = slab(depth, 50, cells)
    # Skylight enters with a flux of pi downward.
    reflected = 1 + of_sky[3, -1].mean() / np.pi
    assert reflected == pytest.approx(albedo, abs=0.01)
    assert reflected - of_sky[3, 0].mean() / np.pi == pytest.approx(1, abs=2e-3)


def test_absorption_is_what_is_missing():
    """Of a slab of droplets that absorb a thousandth: absorbed light by cells, and by fluxes."""
    of_sun, _, deposits, factor = slab(20, 40, 12, albedo=0.999)
    sine = np.sin(np.radians(40))
    scale = ref64.split(0.85, 0.999)[1]
    lost = sine * (1 - np.exp(-scale * 20 / sine)) - of_sun[3, -1].mean() + of_sun[3, 0].mean()
    light_in = of_sun[0] + factor * deposits[1]
    absorbed = (0.001 / scale * deposits[0] * light_in).sum(0).mean() * 1000 / 12
    assert lost == pytest.approx(absorbed, rel=0.02)


def test_no_clouds_leave_the_sky():
    """Without extinction the sky's field is that of half a sphere, without rounding but of halves."""
    _, of_sky, _, _ = solve_light(np.zeros((5, 6, 7)), (80.0, 90.0, 70.0), toward(30), sweeps=1)
    # The first step of Chebyshev's iteration goes beyond a sweep by this factor.
    step = 2 / 1.1
    np.testing.assert_allclose(of_sky[0], step * 2 * np.pi, rtol=1e-3)
    np.testing.assert_allclose(of_sky[3], -step * np.pi, rtol=1e-3)
