"""Clouds on grids against what other programs and closed forms say of them.

The references in tests/references come from tests/references/make.py. Radiance there is for an
irradiance of 1.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import grids
import nubis
import ref64

REFERENCES = Path(__file__).parent / "references"
EXACT = sorted(p.stem.removeprefix("exact_") for p in REFERENCES.glob("exact_*.json"))
MITSUBA = sorted(p.stem.removeprefix("mitsuba_") for p in REFERENCES.glob("mitsuba_*.json"))
SLABS = json.loads((REFERENCES / "disort.json").read_text())["slabs"]

# Different for each colour, so that none stands for another.
IRRADIANCE = np.array([3.0, 2.0, 1.0])


def stored(name):
    """A case's settings and its arrays, in float64."""
    with np.load(REFERENCES / f"{name}.npz") as arrays:
        values = {key: arrays[key].astype(np.float64) for key in arrays.files}
    return json.loads((REFERENCES / f"{name}.json").read_text()), values


def cloud(extinction, bounds, **changes):
    """Params with a grid and nothing else: no air, no ground that shines, no high clouds."""
    values = {
        "light.model": "single",
        "sun.irradiance": tuple(IRRADIANCE),
        "sun.visible": False,
        "atmosphere.enabled": False,
        "atmosphere.ground_albedo": (0.0, 0.0, 0.0),
        "high_clouds.coverage": 0.0,
    }
    volume = nubis.DensityGrid(extinction, bounds)
    return nubis.Params().replace(volume=volume).with_(**(values | changes))


def camera_of(case):
    return nubis.Camera.look_at(case["eye"], case["target"], (0, 0, 1), case["fov_y"])


def scene(case, **changes):
    values = {
        "sun.azimuth": case["azimuth"],
        "sun.elevation": case["elevation"],
        "light.g": case["g"],
        "light.albedo": case["albedo"],
    }
    grid = grids.make(case["grid"], case["scale"])
    return camera_of(case), cloud(*grid, **(values | changes))


# ------------------------------------------------------------------------ the references themselves


@pytest.mark.parametrize("name", [f"exact_{n}" for n in EXACT] + [f"mitsuba_{n}" for n in MITSUBA])
def test_the_grid_is_the_one_that_was_stored(name):
    """To all digits of float32, but not to the bit: cosines differ between machines."""
    case = stored(name)[0]
    extinction, _ = grids.make(case["grid"])
    assert extinction.sum(dtype=np.float64) == pytest.approx(case["sum_of_grid"], rel=1e-6)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", EXACT)
def test_stored_pictures_against_a_plain_marcher(name):
    """Equal steps in float64, with cameras, sun and phase function of this folder: conventions
    agree, and numbers to what the steps allow.
    """
    case, want = stored(f"exact_{name}")
    grid = grids.make(case["grid"], case["scale"])
    directions = ref64.pixel_directions(camera_of(case), case["width"], case["height"])
    some = (slice(2, None, 4), slice(1, None, 5))
    clear = grids.transmittance(*grid, case["eye"], directions[some], 1000)
    np.testing.assert_allclose(clear, want["transmittance"][some], atol=2e-3)

    # From the brightest pixel down, as most are dark.
    few = np.argsort(want["radiance"], axis=None)[-1:-700:-100]
    directions = directions.reshape(-1, 3)[few]
    sun = ref64.compass(case["azimuth"], case["elevation"])
    got = case["albedo"] * ref64.henyey_greenstein(directions @ sun, case["g"])
    got = got * grids.single_scattering(*grid, case["eye"], directions, sun, 200)
    expected = want["radiance"].ravel()[few]
    np.testing.assert_allclose(got, expected, rtol=2e-2, atol=2e-3 * expected[0])


# ----------------------------------------------------------------------------------- deterministic

# Largest error of transmittance; relative RMSE and relative bias of single scattering, over pixels
# with an optical depth of 1e-3 and more.
BOUNDS = {
    "reference": (1e-4, 1e-3, 3e-4),
    # Measured: at most 0.002, 1.3 % and 0.1 %; 0.028, 39 % (away from a low sun) and 3.9 %. One
    # light for a tenth of a pixel's cloud is a good part of the last two: the light of a mean place
    # is less than the mean light.
    "high": (3e-3, 0.017, 4e-3),
    "balanced": (0.04, 0.45, 0.05),
}


# What a mean of the phase function over pixels that its peak is narrower than adds to the second:
# 1.3 % where g is 0.99 and the sun is in the picture.
PEAKED = {"blob_against": 0.015}


def phase_over_pixels(case, fine=32):
    """Mean of the phase function over each pixel, as a share of its value in the middle."""
    camera, width, height = camera_of(case), case["width"], case["height"]
    sun = ref64.compass(case["azimuth"], case["elevation"])

    def phase(columns, rows):
        directions = ref64.pixel_directions(camera, columns, rows)
        weight = (directions @ np.array(camera.forward)) ** 3  # solid angle
        return ref64.henyey_greenstein(directions @ sun, case["g"]), weight

    values, weights = phase(width * fine, height * fine)
    sums = [v.reshape(height, fine, width, fine).sum((1, 3)) for v in (values * weights, weights)]
    return sums[0] / sums[1] / phase(width, height)[0]


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("quality", BOUNDS)
def test_single_scattering(renderer, quality, name):
    case, want = stored(f"exact_{name}")
    make = renderer(case["width"], case["height"], quality)
    layers = make.render_layers(*scene(case))
    largest, rmse, bias = BOUNDS[quality]
    error = np.abs(layers["transmittance"] - want["transmittance"])
    assert error.max() <= largest
    cloudy = want["transmittance"] < math.exp(-1e-3)
    got = layers["radiance"][cloudy] / IRRADIANCE
    # The references look through the middles of pixels, the renderer shows their means.
    radiance = (want["radiance"] * phase_over_pixels(case))[cloudy]
    expected = np.broadcast_to(radiance[:, None], got.shape)
    assert ref64.relative_rmse(got, expected) <= rmse + PEAKED.get(name, 0.0)
    assert abs(got.mean() / expected.mean() - 1) <= bias
    dark = (want["radiance"] == 0) & (want["transmittance"] == 1)
    assert (layers["radiance"][dark] == 0).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["blob_beside", "cumulus_inside", "rough_inside"])
def test_order_of_convergence(renderer, name):
    """Equal steps, twice as many each time: the error falls with the square of the step, down to
    what the half floats of a filtered grid leave. From inside, as where a ray begins and ends in
    nothing even samples at the start of steps are of second order.
    """
    case, want = stored(f"exact_{name}")
    camera, params = scene(case)

    def clear(n):
        make = renderer(case["width"], case["height"], ref64.fine(n))
        return make.render_layers(camera, params)["transmittance"]

    steps, limit = [16, 32, 64, 128], clear(2048)
    error = [np.sqrt(np.mean((clear(n) - limit) ** 2)) for n in steps]
    order = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert order >= 1.7
    assert np.sqrt(np.mean((limit - want["transmittance"]) ** 2)) < 5e-5


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", grids.ALL)
def test_density_and_sun(renderer, rng, name):
    """At points in the box, on its faces, and outside."""
    extinction, bounds = grids.make(name)
    params = cloud(extinction, bounds, **{"sun.elevation": 35.0, "sun.azimuth": 40.0})
    low, high = np.array(bounds)
    u = rng.uniform(-0.1, 1.1, (400, 3))
    # A face's own points may go either way; a thousandth of the box inside or outside may not.
    u[:60] = u[:60].clip(0.001, 0.999)
    u[60:120] = np.where(u[60:120] > 0.5, 1.001, u[60:120])
    points = low + u * (high - low)
    got = renderer().density(points, params)
    want = grids.lookup(extinction.astype(np.float64), bounds, points)
    # Half floats, filtered; and f32.
    np.testing.assert_allclose(got, want, rtol=5e-4, atol=1e-6 * extinction.max())
    got = renderer(8, 8, "reference").density(points, params)
    np.testing.assert_allclose(got, want, rtol=1e-5, atol=4e-6 * extinction.max())
    some = points[:120]
    got = renderer(8, 8, "reference").sun_transmittance(some, params)
    sun = np.broadcast_to(ref64.sun_direction(params), some.shape)
    want = np.exp(-grids.march(extinction, bounds, some, sun, 3000)[0].sum(axis=1))
    np.testing.assert_allclose(got, want, atol=1e-3)


# ------------------------------------------------------------------------------------ closed forms

WIDE = 4000.0
BOTTOM = 1000.0


def slab(optical_depth, thickness=100.0, **changes):
    """A homogeneous layer that is wide enough not to have sides."""
    extinction = np.full((2, 3, 2), optical_depth / thickness, dtype=np.float32)
    bounds = ((-WIDE, -WIDE, BOTTOM), (WIDE, WIDE, BOTTOM + thickness))
    return cloud(extinction, bounds, **changes)


def view_of_slab(cosine, azimuth, fov_y, thickness=100.0):
    """A camera 50 m away from the face whose light it sees: light that travels upward (positive
    cosine) is seen from above.
    """
    direction = ref64.compass(azimuth, -math.degrees(math.asin(cosine)))
    face = np.array([0, 0, BOTTOM + (thickness if cosine > 0 else 0)])
    eye = face - 50 * direction
    return nubis.Camera.look_at(eye, eye + direction, (0, 0, 1), fov_y)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("quality, atol", [("reference", 1e-5), ("balanced", 1e-4)])
@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 5), (16, 4, 4)])
def test_homogeneous_slab(renderer, quality, atol, shape):
    """T = exp(-tau / cosine), for every step rule and every number of voxels."""
    bounds = ((-WIDE, -WIDE, 1000.0), (WIDE, WIDE, 1100.0))
    params = cloud(np.full(shape, 0.01, dtype=np.float32), bounds)
    for elevation in (50, -50):
        eye = np.array([100.0, 200.0, 1050 - 400 * np.sign(elevation)])
        camera = nubis.Camera.look_at(eye, eye + ref64.compass(20, elevation), fov_y=50)
        got = renderer(16, 9, quality).render_layers(camera, params)["transmittance"]
        cosine = np.abs(ref64.pixel_directions(camera, 16, 9)[..., 2])
        np.testing.assert_allclose(got, np.exp(-1 / cosine), atol=atol)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("height", [900.0, 1050.0, 1130.0, 1290.0, 1370.0, 1500.0])
def test_linear_extinction(renderer, height, down):
    """Two voxels on top of each other: constant below the lower centre, linear between the
    centres, constant above.
    """
    a, b = 0.001, 0.006
    extinction = np.array([a, b], dtype=np.float32).reshape(2, 1, 1)
    params = cloud(extinction, ((-WIDE, -WIDE, 1000.0), (WIDE, WIDE, 1400.0)))

    def below(z):
        """Optical depth between the bottom and z, straight up."""
        z = min(max(z, 1000), 1400)
        t = min(max(z - 1100, 0), 200)
        return a * (min(z, 1100) - 1000) + a * t + (b - a) / 400 * t * t + b * max(z - 1300, 0)

    camera = nubis.Camera.look_at((0, 0, height), (0, 100, height + (-150 if down else 150)))
    got = renderer(8, 6, "reference").render_layers(camera, params)["transmittance"]
    depth = below(height) if down else below(1400) - below(height)
    cosine = np.abs(ref64.pixel_directions(camera, 8, 6)[..., 2])
    np.testing.assert_allclose(got, np.exp(-depth / cosine), atol=1e-5)


SIDE = 1000.0


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("sun", ["above", "behind", "ahead"])
@pytest.mark.parametrize("g", [0.0, 0.6, 0.9])
def test_single_scattering_of_a_box(renderer, sun, g):
    """One horizontal ray through a homogeneous cube, with the sun across it or along it."""
    s, albedo = 0.003, 0.9
    extinction = np.full((3, 2, 4), s, dtype=np.float32)
    bounds = ((-SIDE / 2, 2000.0, 1000.0), (SIDE / 2, 2000.0 + SIDE, 1000.0 + SIDE))
    azimuth, elevation = {"above": (0, 90), "behind": (180, 0), "ahead": (0, 0)}[sun]
    params = cloud(
        extinction,
        bounds,
        **{
            "sun.azimuth": azimuth,
            "sun.elevation": elevation,
            "light.g": g,
            "light.albedo": albedo,
        },
    )
    for deep in (30.0, 500.0, 950.0):
        z = 1000 + SIDE - deep
        camera = nubis.Camera.look_at((10, 0, z), (10, 1000, z), fov_y=1)
        layers = renderer(1, 1, "reference").render_layers(camera, params)
        expected = {
            "above": math.exp(-s * deep) * -math.expm1(-s * SIDE),
            "behind": -math.expm1(-2 * s * SIDE) / 2,
            "ahead": s * SIDE * math.exp(-s * SIDE),
        }[sun]
        cosine = {"above": 0, "behind": -1, "ahead": 1}[sun]
        expected = albedo * ref64.henyey_greenstein(cosine, g) * expected * IRRADIANCE
        np.testing.assert_allclose(layers["radiance"][0, 0], expected, rtol=1e-4)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("cosine", [0.5, -0.5])
@pytest.mark.parametrize("depth", [0.01, 1.0, 8.0])
def test_single_scattering_of_a_slab(renderer, depth, cosine):
    """Seen from the sun's side and from the other, at many angles."""
    sun, g = 0.6, 0.5
    changes = {"sun.azimuth": 30.0, "sun.elevation": math.degrees(math.asin(sun)), "light.g": g}
    params = slab(depth, **changes, **{"light.albedo": 1.0})
    camera = view_of_slab(cosine, 75, 40)
    got = renderer(8, 8, "reference").render_layers(camera, params)["radiance"]
    directions = ref64.pixel_directions(camera, 8, 8)
    mu = np.abs(directions[..., 2])
    if cosine > 0:
        weight = sun / (sun + mu) * -np.expm1(-depth * (1 / sun + 1 / mu))
    else:
        x = depth * (1 / sun - 1 / mu)
        weight = depth / mu * np.exp(-depth / mu) * -np.expm1(-x) / x
    weight = weight * ref64.henyey_greenstein(directions @ ref64.sun_direction(params), g)
    np.testing.assert_allclose(got, weight[..., None] * IRRADIANCE, rtol=1e-3)


# ------------------------------------------------------------------------------------- path tracer


def paths(samples, scatterings=4096):
    return nubis.quality("balanced").replace(path_samples=samples, path_scatterings=scatterings)


def tiles(image):
    height, width, colours = image.shape
    tiled = image.reshape(height // 8, 8, width // 8, 8, colours)
    return tiled.mean(axis=(1, 3), dtype=np.float64)


def traced(renderer, size, quality, camera, params):
    """Radiance for an irradiance of 1 and its standard error, in float64."""
    layers = renderer(*size, quality).render_layers(camera, params)
    assert layers["standard_error"].shape == layers["radiance"].shape
    assert layers["standard_error"].dtype == np.float32
    scale = np.where(IRRADIANCE > 0, IRRADIANCE, 1)
    return (layers[name].astype(np.float64) / scale for name in ("radiance", "standard_error"))


def agree(image, error, expected, expected_error):
    """Means of tiles of 8 x 8 pixels within four standard errors, the mean of all within half a
    percent, or four standard errors where these are more.
    """
    got, noise = tiles(image), np.sqrt(tiles(error**2) / 64)
    expected, expected_error = expected[..., None], expected_error[..., None]
    sigma = np.hypot(noise, expected_error)
    # In a tile that few paths brighten, they may all be missing, and no error with them.
    lit = np.broadcast_to(expected > 0.05 * expected.max(), got.shape)
    assert lit.mean() > 0.3
    z = ((got - expected) / np.where(lit, sigma, 1))[lit]
    assert np.abs(z).max() < 4
    assert np.abs(got - expected)[~lit].max(initial=0) < 0.03 * expected.max()
    # Too large an error of its own would let anything pass.
    assert np.median(noise[lit] / got[lit]) < 0.15
    sigma = np.sqrt((sigma**2).sum(axis=(0, 1))) / expected.size
    bias = got.mean(axis=(0, 1)) - expected.mean()
    assert (np.abs(bias) < np.maximum(0.005 * expected.mean(), 4 * sigma)).all()


# Paths a pixel: fewer where they are long, more where single ones are bright.
SAMPLES = {"tau_5": 256, "events_4": 256, "tau_20": 128, "tau_60": 384}


@pytest.mark.slow
@pytest.mark.parametrize("name", MITSUBA)
def test_path_tracer_against_mitsuba(renderer, name):
    case, want = stored(f"mitsuba_{name}")
    method = paths(SAMPLES[name], case["scatterings"] or 4096)
    camera, params = scene(case, **{"light.model": "path"})
    image, error = traced(renderer, (case["width"], case["height"]), method, camera, params)
    agree(image, error, want["tiles"], want["tiles_error"])


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["blob_beside", "cumulus_inside", "dense_front", "rough_inside"])
def test_one_scattering_is_single_scattering(renderer, name):
    """Tiles and mean, and each pixel by itself: the errors are neither larger nor smaller than it
    says.
    """
    case, want = stored(f"exact_{name}")
    camera, params = scene(case, **{"light.model": "path"})
    image, error = traced(renderer, (case["width"], case["height"]), paths(128, 1), camera, params)
    expected = want["radiance"]
    agree(image, error, tiles(expected[..., None])[..., 0], np.zeros((4, 6)))
    seen = (want["transmittance"] < 0.9) & (expected > 0.1 * expected.mean())
    z = (image - expected[..., None])[seen] / error[seen]
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3


def slab_radiance(renderer, camera, params, samples):
    """The mean over a picture of a hundredth of a degree, and its standard error."""
    image, error = traced(renderer, (16, 16), paths(samples), camera, params)
    return image.mean(axis=(0, 1)), np.sqrt((error**2).mean(axis=(0, 1)) / 256)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("direction", range(8))
@pytest.mark.parametrize("name", SLABS)
def test_path_tracer_against_disort(renderer, name, direction):
    case = SLABS[name]
    want = case["radiance"][direction]
    sun = 250.0
    params = slab(
        case["depth"],
        **{
            "light.model": "path",
            "light.g": case["g"],
            "light.albedo": case["albedo"],
            "sun.azimuth": sun,
            "sun.elevation": math.degrees(math.asin(case["sun_cosine"])),
        },
    )
    camera = view_of_slab(want["cosine"], sun + want["between"], 0.01)
    mean, error = slab_radiance(renderer, camera, params, 256)
    assert (error < 0.03 * want["value"]).all()
    assert (np.abs(mean - want["value"]) < 4 * error).all()


def chandrasekhar(albedo, cosine):
    """H of a half-space that scatters alike in all directions."""
    x, weight = np.polynomial.legendre.leggauss(96)
    x, weight = (x + 1) / 2, weight / 2

    def step(h, mu):
        integral = (weight * x * h / (np.asarray(mu)[..., None] + x)).sum(axis=-1)
        return 1 / (math.sqrt(1 - albedo) + albedo / 2 * integral)

    h = np.ones_like(x)
    for _ in range(200):
        h = step(h, x)
    return step(h, cosine)


def test_chandrasekhar():
    """Known values of albedo / 4 pi * mu0 / (mu0 + mu) * H(mu) * H(mu0)."""
    h = chandrasekhar(0.95, np.array([0.6, 0.3, 0.9]))
    got = 0.95 / (4 * np.pi) * 0.6 / (0.6 + np.array([0.3, 0.9])) * h[1:] * h[0]
    np.testing.assert_allclose(got, [0.129893, 0.107075], atol=1e-6)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("cosine", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("lit_by", ["sun", "sky"])
def test_half_space(renderer, lit_by, cosine):
    """All orders of isotropic scattering, lit by the sun or by a radiance of 1 from everywhere
    (of which it returns 1 - sqrt(1 - albedo) H).
    """
    albedo, sun = 0.95, 0.6
    changes = {"light.model": "path", "light.g": 0.0, "light.albedo": albedo}
    if lit_by == "sun":
        changes["sun.elevation"] = math.degrees(math.asin(sun))
        h = chandrasekhar(albedo, np.array([cosine, sun]))
        expected = albedo / (4 * np.pi) * sun / (sun + cosine) * h.prod()
    else:
        changes["light.ambient"] = tuple(IRRADIANCE)
        changes["sun.irradiance"] = (0.0, 0.0, 0.0)
        expected = 1 - math.sqrt(1 - albedo) * chandrasekhar(albedo, cosine)
    params = slab(60.0, 400.0, **changes)
    camera = view_of_slab(cosine, 10, 0.01, 400.0)
    mean, error = slab_radiance(renderer, camera, params, 128)
    assert (error < 0.02 * expected).all()
    assert (np.abs(mean - expected) < 4 * error).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("grid, scale", [("cumulus", 0.3), ("rough", 1.0)])
@pytest.mark.parametrize("g", [0.0, 0.85])
def test_white_furnace(renderer, grid, scale, g):
    """A radiance of 1 from everywhere: clouds that absorb nothing cannot be seen, others are
    darker, the more the darker.
    """
    case = stored("exact_cumulus_above" if grid == "cumulus" else "exact_rough_inside")[0]
    samples = 256
    furnace = {
        "light.model": "path",
        "light.ambient": (1.0, 1.0, 1.0),
        "light.g": g,
        "sun.irradiance": (0.0, 0.0, 0.0),
    }
    means = []
    for albedo in (1.0, 0.99, 0.9):
        params = cloud(*grids.make(grid, scale), **furnace, **{"light.albedo": albedo})
        layers = renderer(24, 16, paths(samples)).render_layers(camera_of(case), params)
        clear = layers["transmittance"][..., None].astype(np.float64)
        total = layers["radiance"] + clear
        assert (clear < 0.5).mean() > 0.3
        # Of a pixel that light passes in one of a thousand paths no sample tells the error.
        noise = 5 * np.sqrt(clear * (1 - clear) / samples) + 5 / samples
        assert (total < 1 + noise).all()
        if albedo == 1:
            assert (total > 1 - noise).all()
            assert total.mean() == pytest.approx(1, abs=2e-3)
        means.append(total.mean())
    assert means[0] > means[1] + 2e-3
    assert means[1] > means[2] + 0.02
