"""What the other methods are measured by, on procedural clouds: rays that converge, and paths. On
grids they are compared with other programs in test_oracle.py.
"""

import numpy as np
import pytest

import nubis
import ref64
from nubis.testing import probe

# A narrow view: the level of detail is the finest, which is the one that `density` reads.
CAMERA = nubis.Camera.look_at((0, 0, 100), (300, 1000, 1200), fov_y=4)


def lit(**changes):
    values = {
        "light.model": "single",
        "light.g": 0.6,
        "light.albedo": 0.9,
        "sun.elevation": 50.0,
        "sun.azimuth": 70.0,
        "sun.irradiance": (3.0, 2.0, 1.0),
        "clouds.extinction": 0.004,
    }
    return ref64.smooth_params(**(values | changes))


def paths(samples, scatterings=4096):
    return nubis.quality("balanced").replace(path_samples=samples, path_scatterings=scatterings)


def test_the_reference_against_a_plain_marcher(renderer):
    """In float64, through the renderer's own density, with shell and shadows of its own."""
    params = lit()
    directions = ref64.pixel_directions(CAMERA, 8, 4).reshape(-1, 3)
    time = ref64.cloudy_time(renderer(), params, CAMERA, 0.05, 0.8)
    layers = renderer(8, 4, "reference").render_layers(CAMERA, params, time=time)
    light = ref64.single_scattering(renderer(), params, CAMERA.eye, directions, 800, 400, time)
    np.testing.assert_allclose(
        layers["radiance"].reshape(-1, 3), light, rtol=2e-3, atol=1e-3 * light.mean()
    )
    clear = ref64.transmittance(renderer(), params, CAMERA.eye, directions, 8000, time)
    np.testing.assert_allclose(layers["transmittance"].ravel(), clear, atol=2e-4)


def test_more_evaluations_than_a_dispatch_may_make(renderer):
    """Rays go on in the next dispatch: beyond the 65,535 iterations after which lavapipe ends all
    loops of a shader, the numbers are still right.
    """
    params = lit()
    strict = nubis.quality("reference").replace(tolerance=1e-6)
    time = ref64.cloudy_time(renderer(), params, CAMERA, 0.05, 0.8)
    fine, usual = (
        renderer(8, 4, q).render_layers(CAMERA, params, time=time) for q in (strict, "reference")
    )
    assert fine["samples"].max() > 4 * 65_535
    assert fine["samples"].sum() > 2 * usual["samples"].sum()
    # Each of two halvings as fine changes nothing that matters: the reference had converged.
    np.testing.assert_allclose(fine["transmittance"], usual["transmittance"], atol=2e-4)
    error = fine["radiance"] - usual["radiance"]
    assert np.sqrt(np.mean(error**2)) < 1e-3 * usual["radiance"].mean()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("model", ["nubis2015", "thesis2018", "vsu2022", "octaves"])
def test_methods_converge_to_the_reference(renderer, model):
    """Every light model: many equal steps and light samples come to the same picture."""
    params = lit(**{"light.model": model, "light.ambient": (0.2, 0.2, 0.2)})
    time = ref64.cloudy_time(renderer(), params, CAMERA, 0.05, 0.8)
    got, want = (
        renderer(8, 4, q).render_layers(CAMERA, params, time=time)
        for q in (ref64.fine(220, 128, light_distance=0.0), "reference")
    )
    np.testing.assert_allclose(got["radiance"], want["radiance"], rtol=5e-3, atol=1e-4)
    assert want["change"].shape == want["radiance"].shape and "change" not in got
    assert (want["change"] <= 1.1e-3 * (want["radiance"] + 1e-6 * 3)).mean() > 0.9


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("scene", "field", "clear"),
    [
        ("fair_weather", "eroded", 0.1),
        ("storm", "eroded", 0.005),
        ("fair_weather", "heaped", 0.1),
        ("storm", "heaped", 0.005),
    ],
)
def test_majorants_are_never_exceeded(rng, scene, field, clear):
    """Not at the point, and nowhere within their reach."""
    changes = {"light.model": "path", "clouds.field": field}
    params = nubis.scenes[scene][1].with_(**changes)
    clouds = params.clouds
    top = clouds.cumulonimbus_top if clouds.precipitation > 0 else clouds.top
    low, high = [-20_000, -20_000, clouds.base], [20_000, 20_000, top]

    def ask(expression, points):
        inputs = np.hstack([points, np.zeros((len(points), 1))])
        return probe(expression, inputs, imports=["majorant", "shell"], params=params)

    near = "majorant_at(x.xyz, altitude_at(x.xyz))"
    at = "cloud_density_at(x.xyz, altitude_at(x.xyz), 0.0)"
    points = rng.uniform(low, high, (60_000, 3))
    limit = "cloud_column(x.xyz, altitude_at(x.xyz)).limit"
    density, limits = ask(f"vec4f({at}, {limit}, 0.0, 0.0)", points)[:, :2].T
    # Skipped is what has no limit.
    assert (limits[density > 0] > 0).all()
    # From every cloudy point back to one from where it can be reached.
    points, density = points[density > 0], density[density > 0]
    assert len(points) > 1000
    reach = ask(f"vec4f({near}.reach)", points[:1])[0, 0]
    assert reach > 20
    way = ref64.normalized(rng.normal(size=points.shape))
    start = points + way * reach * rng.uniform(0, 0.999, (len(points), 1))
    bound = ask(f"vec4f({near}.density)", start)[:, 0]
    inside = (start[:, 2] > clouds.base + 50) & (start[:, 2] < top - 50)
    # Rounding of positions apart, which are kilometres from the eye.
    assert (density <= bound + 1e-4)[inside].all()
    # Local: where there is no cloud for kilometres they say so.
    anywhere = ask(f"vec4f({near}.density)", rng.uniform(low, high, (4000, 3)))[:, 0]
    assert (anywhere == 0).mean() > clear


def test_majorants_of_a_grid(rng):
    """Never below the grid within their reach, and no more than the largest voxel near by."""
    peaks = np.where(rng.uniform(size=(20, 24, 28)) < 0.02, rng.uniform(0, 1, (20, 24, 28)), 0)
    grid = nubis.DensityGrid(peaks, ((-700.0, -600.0, 500.0), (700.0, 600.0, 1500.0)))
    params = nubis.Params().replace(volume=grid).with_(**{"light.model": "path"})
    low, high = map(np.array, grid.bounds)
    points = rng.uniform(low, high, (20_000, 3))

    def ask(expression, points):
        return probe(expression, points, imports=["majorant", "shell"], params=params)

    near = "majorant_at(x.xyz, altitude_at(x.xyz))"
    bound = ask(f"vec4f({near}.density, {near}.reach, 0.0, 0.0)", points)
    reach = bound[0, 1]
    assert reach == pytest.approx(4 * 50, rel=1e-5)
    way = ref64.normalized(rng.normal(size=points.shape))
    end = np.clip(points + way * reach * rng.uniform(0, 0.999, (len(points), 1)), low, high)
    density = ask("vec4f(volume_density(x.xyz))", end)[:, 0]
    assert (density > 0.3).sum() > 50
    assert (density <= bound[:, 0] + 1e-6).all()
    full = nubis.DensityGrid(np.ones((5, 5, 5)), grid.bounds)
    params = params.replace(volume=full)
    assert (ask(f"vec4f({near}.density)", points[:100]) >= 1).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("g", [0.6, -0.4])
def test_paths_of_one_scattering(renderer, g):
    """They are the reference's single scattering, by Z-score of the tiles' means."""
    camera, params = CAMERA, lit(**{"light.g": g})
    time = ref64.cloudy_time(renderer(), params, camera, 0.05, 0.8)
    want = renderer(32, 16, "reference").render_layers(camera, params, time=time)
    traced = params.with_(**{"light.model": "path"})
    got = renderer(32, 16, paths(256, 1)).render_layers(camera, traced, time=time)

    def tiles(image):
        return image.reshape(2, 8, 4, 8, -1).mean(axis=(1, 3), dtype=np.float64)

    noise = np.sqrt(tiles(got["standard_error"] ** 2) / 64)
    z = (tiles(got["radiance"]) - tiles(want["radiance"])) / noise
    assert np.abs(z).max() < 4
    assert np.median(noise / tiles(want["radiance"])) < 0.05
    chance = np.sqrt(tiles(want["transmittance"] * (1 - want["transmittance"])) / 64 / 256)
    difference = tiles(got["transmittance"]) - tiles(want["transmittance"])
    assert (np.abs(difference) < 4 * chance + 1e-3).all()
    cloudy = want["transmittance"] < 0.5
    depth = (got["depth"] / want["depth"])[cloudy]
    assert depth.mean() == pytest.approx(1, abs=0.01)


def test_more_orders_are_more_light(renderer):
    params = lit(**{"light.model": "path", "light.albedo": 1.0})
    time = ref64.cloudy_time(renderer(), params, CAMERA, 0.05, 0.8)
    light = [
        renderer(16, 8, paths(64, n)).render_layers(CAMERA, params, time=time)["radiance"].mean()
        for n in (1, 2, 8, 4096)
    ]
    assert light == sorted(light) and light[3] > 1.3 * light[0]


@pytest.mark.slow
def test_a_static_shot_goes_on_tracing(renderer):
    """Each frame of an animation has the paths of those before it, and no path twice; the standard
    error tells how far two of them are apart.
    """
    params = lit(**{"light.model": "path"})
    make = renderer(32, 16, paths(32))
    time = ref64.cloudy_time(renderer(), params, CAMERA, 0.05, 0.8)
    layers = make.render_layers(CAMERA, params, time=time)
    frames = list(make.animate([(CAMERA, params, time)] * 4, background=None))
    np.testing.assert_array_equal(frames[0][..., :3], layers["radiance"])
    second = 2 * frames[1][..., :3] - frames[0][..., :3]
    z = (second - frames[0][..., :3]) / np.sqrt(2) / np.maximum(layers["standard_error"], 1e-9)
    lit_pixels = layers["standard_error"][..., 0] > 0
    assert 0.7 < z[lit_pixels].std() < 1.5 and abs(z[lit_pixels].mean()) < 0.2
    best = renderer(32, 16, paths(1024)).render_layers(CAMERA, params, time=time)["radiance"]
    error = [np.sqrt(np.mean((f[..., :3] - best) ** 2)) for f in frames]
    assert error[3] < 0.7 * error[0]
    # Another shot starts anew.
    moved = list(make.animate([(CAMERA, params, time), (CAMERA, params, time + 1)]))
    np.testing.assert_array_equal(moved[1], make.render(CAMERA, params, time=time + 1))


def test_a_converged_shot_stays(renderer):
    make = renderer(8, 4, "reference")
    frames = list(make.animate([(CAMERA, lit(), 0.0)] * 3))
    still = make.render(CAMERA, lit())
    assert all(frame.tobytes() == still.tobytes() for frame in frames)


@pytest.mark.slow
def test_paths_in_the_sky(renderer):
    """With air and ground: brighter than the sun alone makes it, and the ground's albedo is seen
    from below.
    """
    camera, params = nubis.scenes["overcast"]
    dark, bright = (
        renderer(16, 9, paths(16))
        .render_layers(
            camera, params.with_(**{"light.model": "path", "atmosphere.ground_albedo": (a,) * 3})
        )["radiance"]
        .mean()
        for a in (0.0, 0.9)
    )
    assert np.isfinite([dark, bright]).all() and bright > 1.3 * dark > 0


def test_the_reference_ends_where_positions_are_rounded(renderer):
    """From the planet's centre the clouds are 6,372 km away, where f32 knows half metres: panels
    that cannot be made shorter are taken as they are.
    """
    radius = nubis.Params().atmosphere.planet_radius
    camera = nubis.Camera.look_at((0, 0, -radius), (1e6, 7e4, -radius - 1e4), fov_y=0.001)
    layers = renderer(4, 4, "reference").render_layers(camera, nubis.Params())
    assert all(np.isfinite(layers[name]).all() for name in ("radiance", "transmittance"))
