"""Shader functions that stay exact where the textbook form does not, against float64 references."""

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe
from ref64_noise import f32, random3

EARTH = 6_371_000.0


def test_share_of_a_step():
    """(1 - exp(-x)) / x, whose plain form has no digit left below 1e-6."""
    x = f32(np.concatenate([np.logspace(-12, 2, 400), np.linspace(0.09, 0.11, 50)]))
    got = probe("one_minus_exp_over(x.x)", x, imports=["math"])[:, 0]
    np.testing.assert_allclose(got, -np.expm1(-x) / x, rtol=5e-6)
    assert probe("one_minus_exp_over(x.x)", [0.0], imports=["math"])[0, 0] == 1


def test_transmittance_of_next_to_nothing():
    """On lavapipe the exponential of -1e-9 is 6e-8 less than 1."""
    x = f32(np.concatenate([[0], np.logspace(-12, 2, 300), np.linspace(0.09, 0.11, 50)]))
    got = probe("transmittance_of(x.x)", x, imports=["math"])[:, 0]
    np.testing.assert_allclose(got, np.exp(-x), atol=1.2e-7)
    assert (got[x < 1e-8] == 1).all() and got.min() >= 0


def test_remap_is_clamped_and_finite():
    v, a, b = np.meshgrid([-1, 0, 0.25, 0.5, 0.7, 1, 2], [0, 0.25, 0.5, 1], [0, 0.3, 0.5, 1])
    inputs = np.stack([v.ravel(), a.ravel(), b.ravel()], axis=1)
    got = probe("remap01(x.x, x.y, x.z)", inputs, imports=["math"])[:, 0]
    assert np.isfinite(got).all()
    assert got.min() == 0 and got.max() == 1
    v, a, b = f32(inputs).T
    proper = b > a
    expected = np.clip(ref64.remap(v[proper], a[proper], b[proper]), 0, 1)
    np.testing.assert_allclose(got[proper], expected, atol=1e-6)
    # A range without width is a step.
    empty = b == a
    np.testing.assert_array_equal(got[empty], (v[empty] > a[empty]).astype(np.float32))


@pytest.mark.parametrize("radius", [EARTH, 400_000.0])
def test_altitude(radius):
    """Subtracting the radius from a length is 0.8 m off at 100 km on Earth."""
    level = np.logspace(0, 5, 60)
    points = np.concatenate(
        [[x * ref64.compass(200, e) for x in level] for e in (-1, 0, 0.5, 5, 40, 90)]
    )
    params = nubis.Params().with_(**{"atmosphere.planet_radius": radius})
    got = probe("altitude_at(x.xyz)", points, imports=["shell"], params=params)[:, 0]
    expected = ref64.altitude(f32(points), radius)
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=0.02)


def test_cosine_to_the_local_zenith(rng):
    points = f32(rng.uniform(-1, 1, (500, 3)) * [2e5, 2e5, 1e4])
    direction = ref64.compass(130, 10)
    wgsl = "cos_zenith_at(x.xyz, vec3f({}, {}, {}))".format(*direction)
    got = probe(wgsl, points, imports=["shell"])[:, 0]
    expected = ref64.normalized(ref64.from_centre(points, EARTH)) @ direction
    np.testing.assert_allclose(got, expected, atol=3e-7)


@pytest.mark.parametrize("height", [0.01, 1.0, 1500.0, 4000.0])
def test_distance_to_a_shell_from_the_ground(height):
    """Grazing to zenith, from 1 cm under the shell to 4 km. The plain quadratic is 11 m off at
    1.5 km.
    """
    elevations = [0, 0.01, 0.1, 1, 5, 20, 45, 80, 90]
    directions = f32([ref64.compass(30, e) for e in elevations])
    params = nubis.Params().with_(**{"clouds.base": height, "clouds.top": height + 1000})
    hit = "hit_sphere(x.xyz, frame.view.power_base)"
    wgsl = f"vec4f({hit}.near, {hit}.far, 0.0, 0.0)"
    near, far = probe(wgsl, directions, imports=["shell"], params=params)[:, :2].T
    expected = ref64.sphere_hits((0, 0, 0), ref64.normalized(directions), EARTH, height)[1]
    assert (near == 0).all()
    np.testing.assert_allclose(far, expected, rtol=2e-6, atol=0.02)


def test_crossings_from_below_inside_and_above():
    """Relative to what the given numbers mean: near a tangent point, rounding moves the crossings
    apart or merges them.
    """
    h, height = np.meshgrid(
        [0.0, 2.0, 1499.99, 1500.01, 3000.0, 20_000.0, 400_000.0], [0.0, 1500.0, 4000.0]
    )
    h, height = (v.ravel()[:, None] for v in (h, height))
    mu = np.sin(np.radians([-90, -45, -20, -10, -3, -1, -0.1, 0, 0.1, 3, 45, 90]))
    b = f32((EARTH + h) * mu + 0 * height)
    power = f32((h - height) * (2 * EARTH + h + height) + 0 * mu)
    wgsl = (
        "vec4f(crossing(x.x, x.y).near, crossing(x.x, x.y).far, f32(crossing(x.x, x.y).hit), 0.0)"
    )
    near, far, hit = probe(wgsl, np.stack([b.ravel(), power.ravel()], 1), imports=["shell"])[
        :, :3
    ].T
    b, power = b.ravel(), power.ravel()

    disc = b.astype(np.longdouble) ** 2 - power
    clear = np.abs(disc) > 1e-6 * b * b
    root = np.sqrt(np.maximum(disc, 0))
    expected_hit = (disc >= 0) & ((power <= 0) | (b <= 0))
    np.testing.assert_array_equal(hit[clear] > 0, expected_hit[clear])
    sure = clear & expected_hit
    tolerance = 1e-6 * np.abs(-b + root) + 3e-7 * b * b / np.maximum(root, 1)
    # Where the crossings have no cancellation to fear, no digit may be lost to one.
    tolerance = np.where(power <= 0, 2e-6 * np.abs(-b + root), tolerance)
    expected_near = np.where(power > 0, -b - root, 0)
    tolerance_near = np.where(power <= 0, 0, tolerance)
    # The far crossing from below or inside is -power / (b + root), without a difference of large
    # numbers.
    expected_far = np.where(b > 0, -power / np.maximum(b + root, 1), -b + root)
    assert (np.abs(near - expected_near) <= tolerance_near)[sure].all()
    assert (np.abs(far - expected_far) <= np.maximum(tolerance, 1e-30))[sure].all()
    assert (near >= 0).all() and (far >= near).all()


MISS = (0.0, 0.0, 0)
STRETCHES = {
    # Crossings (near, far, whether) of top, base and ground; then start, first, gap, second.
    "below, looking up": ((0, 9, 1), (0, 4, 1), MISS, (4, 5, 0, 0)),
    "below, looking down": ((0, 9, 1), (0, 4, 1), (1, 3, 1), (4, 0, 0, 0)),
    "inside, leaving by the top": ((0, 9, 1), MISS, MISS, (0, 9, 0, 0)),
    "inside, to the ground": ((0, 9, 1), (2, 7, 1), (3, 6, 1), (0, 2, 1, 0)),
    "inside, under the base and out again": ((0, 9, 1), (2, 7, 1), MISS, (0, 2, 5, 2)),
    "above, to the ground": ((1, 9, 1), (2, 7, 1), (3, 6, 1), (1, 1, 1, 0)),
    "above, under the base and out again": ((1, 9, 1), (2, 7, 1), MISS, (1, 1, 5, 2)),
    "above, through the top alone": ((1, 9, 1), MISS, MISS, (1, 8, 0, 0)),
    "above, past it": (MISS, MISS, MISS, (0, 0, 0, 0)),
    "below the surface, looking up": ((0, 9, 1), (0, 4, 1), (0, 3, 1), (4, 5, 0, 0)),
}


@pytest.mark.parametrize("case", STRETCHES)
def test_stretches_of_a_ray_inside_the_shell(case):
    """A stretch of no length may start anywhere."""
    *hits, (start, first, gap, second) = STRETCHES[case]
    top, base, _ = (
        f"Hit({near:.1f}, {far:.1f}, {str(hit > 0).lower()}, {str(near > 0).lower()})"
        for near, far, hit in hits
    )
    # The ground ends a ray that enters it.
    ground = hits[2][0] if hits[2][0] > 0 else 1e30
    call = f"stretches_between({top}, {base}, {ground:.1f})"
    wgsl = f"vec4f({call}.start, {call}.first, {call}.gap, {call}.second)"
    got = probe(wgsl, [0.0], imports=["shell"])[0]
    if first + second == 0:
        assert got[1] + got[3] == 0
    elif second == 0:
        assert tuple(got[[0, 1, 3]]) == (start, first, 0)
    else:
        assert tuple(got) == (start, first, gap, second)


@pytest.mark.parametrize("salt", [0, 1, 977])
def test_random_numbers_are_uniform(salt):
    """Each component, and neighbours and salts without correlation: 1/sqrt(n) is one standard
    deviation.
    """
    cells = np.indices((20, 20, 20)).reshape(3, -1).T
    n = len(cells)
    wgsl = f"vec4f(random3(vec3u(x.xyz), {salt}u), random3(vec3u(x.xyz), {salt + 1}u).x)"
    got = probe(wgsl, cells, imports=["random"])
    assert got.min() >= 0 and got.max() < 1
    for component in got.T:
        counts = np.histogram(component, bins=16, range=(0, 1))[0]
        chi2 = ((counts - n / 16) ** 2 / (n / 16)).sum()
        assert chi2 < 15 + 5 * np.sqrt(30)
    grid = got.reshape(20, 20, 20, 4)
    pairs = [(grid[1:], grid[:-1]), (grid[:, 1:], grid[:, :-1]), (grid[:, :, 1:], grid[:, :, :-1])]
    for a, b in pairs:
        correlation = [np.corrcoef(a[..., i].ravel(), b[..., i].ravel())[0, 1] for i in range(4)]
        assert np.abs(correlation).max() < 5 / np.sqrt(n)
    assert np.abs(np.corrcoef(got.T) - np.eye(4)).max() < 5 / np.sqrt(n)


def noises(p):
    """Three noises at points, shape (N, 3)."""
    wgsl = "vec4f(perlin(x.xyz, 4u, 3u), perlin_fbm(x.xyz, 3u, 4u, 3u), worley(x.xyz, 4u, 3u), 0.0)"
    return probe(wgsl, p, imports=["gradient_noise"])[:, :3]


def test_noise_tiles(rng):
    """Dyadic coordinates, so that adding 1 rounds nothing away."""
    p = rng.integers(0, 1024, (400, 3)) / 1024
    here, there = np.split(noises(np.concatenate([p, p + rng.integers(-2, 3, p.shape)])), 2)
    np.testing.assert_array_equal(here, there)
    assert here.std(axis=0).min() > 0.05


def test_noise_is_continuous_across_the_seam(rng):
    """Also just under 0, where fract of a tiny negative number rounds to 1."""
    edges = [1 - 1e-6, 0, -1e-9, 1e-6]
    at = np.tile(rng.uniform(0, 1, (100, 3)), (3, len(edges), 1, 1))
    for axis in range(3):
        at[axis, ..., axis] = np.array(edges)[:, None]
    values = noises(at.reshape(-1, 3)).reshape(3, len(edges), -1, 3)
    # The steepest octave crosses 24 cells a tile with a slope of a few per cell.
    assert np.ptp(values, axis=1).max() < 2e-6 * 24 * 5


def test_worley_against_all_feature_points(rng):
    """Its 27 cells find the nearest of all points of the tile and of the tiles around it."""
    period, salt = 3, 5
    p = f32(rng.uniform(0, 1, (300, 3)))
    cells = np.indices((period,) * 3).reshape(3, -1).T
    points = cells + random3(cells, salt)
    apart = np.abs(p[:, None] * period - points)
    apart = np.minimum(apart, period - apart)
    nearest = np.linalg.norm(apart, axis=2).min(axis=1)
    got = probe(f"worley(x.xyz, {period}u, {salt}u)", p, imports=["gradient_noise"])[:, 0]
    np.testing.assert_allclose(got, 1 - np.minimum(nearest, 1), atol=2e-6)


def test_perlin_is_zero_on_its_lattice():
    cells = np.indices((4, 4, 4)).reshape(3, -1).T / 4
    assert (
        np.abs(probe("perlin(x.xyz, 4u, 3u)", cells, imports=["gradient_noise"])[:, 0]).max() < 1e-6
    )


def test_zenith_along_a_ray():
    """The cosine from the altitude, which is known, and that from the point."""
    elevation = np.radians(np.linspace(-5, 90, 60))
    at = np.stack([np.cos(elevation), np.sin(elevation)], 1)
    direction = "vec3f(x.x, 0.0, x.y)"
    hit = f"hit_sphere({direction}, -2.0 * 6371000.0 * 8500.0 - 8500.0 * 8500.0).far"
    at_point = f"cos_zenith_at({hit} * {direction}, {direction})"
    got = probe(f"cos_zenith_along({direction}, {hit}, 8500.0)", at, imports=["shell"])
    expected = probe(at_point, at, imports=["shell"])
    np.testing.assert_allclose(got[:, 0], expected[:, 0], atol=1e-6)
