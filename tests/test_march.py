"""The march: transmittance against the integral of the renderer's own density, and what each
layer of a picture means.
"""

import os

import numpy as np
import pytest

import grids
import nubis
import ref64
from nubis.testing import probe
from test_api import run_python

EARTH = 6_371_000.0
THESIS = 400_000.0


def looking(height, elevation, fov_y=3.0):
    eye = np.array([0.0, 0.0, height])
    return nubis.Camera.look_at(eye, eye + ref64.compass(15, elevation), fov_y=fov_y)


# Narrow views, as the level of detail grows with a pixel's width. On thesis2018's planet of 400 km
# the horizon is near.
VIEWS = {
    "below": (looking(100, 34), EARTH, 0.004),
    "zenith": (looking(100, 88), EARTH, 0.004),
    "horizon": (looking(100, 2, 1), EARTH, 0.001),
    "inside": (looking(1700, 2), EARTH, 0.002),
    "inside, down": (looking(2500, -30), EARTH, 0.004),
    "above": (looking(6000, -22), EARTH, 0.004),
    "small planet": (looking(100, 2, 1), THESIS, 0.001),
    # Tops dip by 12.0 degrees under this eye, bases by 13.3, the ground by 13.9.
    "under the base and out again": (looking(12_000, -13.5, 0.5), THESIS, 0.0002),
    "through the tops": (looking(12_000, -12.6, 0.5), THESIS, 0.0002),
}


def view_params(view, **changes):
    camera, radius, extinction = VIEWS[view]
    values = {"atmosphere.planet_radius": radius, "clouds.extinction": extinction}
    return camera, ref64.smooth_params(**(values | changes))


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("view", VIEWS)
def test_transmittance(renderer, view):
    """The integral in float64 starts at the eye and knows nothing of shells."""
    camera, params = view_params(view)
    directions = ref64.pixel_directions(camera, 16, 9).reshape(-1, 3)
    time = ref64.cloudy_time(renderer(), params, camera, 0.05, 0.95)
    got = (
        renderer(16, 9, ref64.fine(1024))
        .render_layers(camera, params, time=time)["transmittance"]
        .ravel()
    )
    expected = ref64.transmittance(renderer(), params, camera.eye, directions, 8000, time)
    np.testing.assert_allclose(got, expected, atol=3e-4)


@pytest.mark.parametrize("view", ["below", "inside", "above"])
def test_more_steps_converge(renderer, view):
    """Twice the steps, a third of the error or less: the rule is of second order."""
    camera, params = view_params(view)
    time = ref64.cloudy_time(renderer(), params, camera, 0.05, 0.95)
    counts = (32, 64, 128, 1024)
    layers = {
        n: renderer(16, 9, ref64.fine(n)).render_layers(camera, params, time=time) for n in counts
    }
    expected = layers.pop(1024)["transmittance"]
    error = [np.sqrt(np.mean((v["transmittance"] - expected) ** 2)) for v in layers.values()]
    assert error[1] < error[0] / 3 and error[2] < error[1] / 3


BOUNDS = {
    "draft": 0.06,
    "balanced": 0.03,
    "high": 0.01,
    "nubis2015": 0.06,
    "thesis2018": 0.06,
    "vsu2022": 0.03,
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("quality", BOUNDS)
def test_methods_agree(renderer, quality):
    """The method is no part of the look: every one is near a converged picture, the better ones
    nearer.
    """
    camera, params = nubis.scenes["fair_weather"]
    best = nubis.quality("high").replace(
        steps_zenith=1000, steps_horizon=2000, light_steps=1, min_transmittance=1e-4
    )
    got, expected = (
        renderer(48, 27, q).render_layers(camera, params)["transmittance"] for q in (quality, best)
    )
    assert np.sqrt(np.mean((got - expected) ** 2)) < BOUNDS[quality]
    assert abs(np.mean(got - expected)) < 0.2 * BOUNDS[quality]


#: Relative RMSE that lighting as much of a pixel as one as `balanced` does may cost. Measured at
#: this size: 1.9 to 2.8 %, in `storm` 6.8 %; a share of 0.03 costs 0.4 to 1.2 %.
SHARES = {"fair_weather": 0.03, "overcast": 0.023, "in_cloud": 0.03, "storm": 0.08}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", SHARES)
def test_light_for_a_share_is_that_of_each_sample(renderer, scene):
    """Fewer looks at the sun, and nearly the same picture; less share, less error."""
    camera, params = nubis.scenes[scene]
    balanced = nubis.quality("balanced").replace(adaptive_threshold=0.0)
    each, fine, coarse = (
        renderer(96, 54, balanced.replace(light_group_weight=share)).render_layers(camera, params)
        for share in (0.0, 0.03, balanced.light_group_weight)
    )
    cloud = each["transmittance"] < 0.999
    mean = each["radiance"][cloud].mean()
    errors = [
        np.sqrt(np.mean((layers["radiance"] - each["radiance"])[cloud] ** 2)) / mean
        for layers in (fine, coarse)
    ]
    assert 0 < errors[0] < 0.5 * errors[1]
    assert errors[1] < SHARES[scene]
    assert coarse["samples"].sum() < 0.97 * each["samples"].sum()
    np.testing.assert_array_equal(coarse["transmittance"], each["transmittance"])
    np.testing.assert_allclose(coarse["depth"], each["depth"], rtol=1e-4)


@pytest.mark.slow
def test_rain_is_lit_in_small_shares(renderer):
    """A tenth of a pixel of rain is kilometres of sun and shadow: were it lit as one, shafts had
    edges and an error of 14 %.
    """
    camera, storm = nubis.scenes["storm"]
    params = storm.with_(**{"clouds.rain_extinction": 5e-4})
    balanced = nubis.quality("balanced").replace(adaptive_threshold=0.0)
    each, shared = (
        renderer(96, 54, balanced.replace(light_group_weight=share)).render_layers(camera, params)
        for share in (0.0, balanced.light_group_weight)
    )
    cloud = each["transmittance"] < 0.999
    error = (shared["radiance"] - each["radiance"])[cloud]
    assert np.sqrt(np.mean(error**2)) < 0.06 * each["radiance"][cloud].mean()
    assert shared["samples"].sum() < 0.4 * each["samples"].sum()


def test_a_veil_does_not_move_the_light_of_the_cloud_behind(renderer):
    """A slab behind a veil of less than a share is lit where it is: what was gathered before it
    does not draw its light into the gap, where the sun shines. Single scattering from straight
    above: the slab's is none, the veil's at most its opacity of 0.06.
    """
    extinction = np.zeros((2, 1, 120), np.float32)
    extinction[..., :3] = 0.06 / 150
    extinction[..., 60:] = 0.1
    grid = nubis.DensityGrid(extinction, ((0, -3000, 0), (6000, 3000, 4000)))
    params = nubis.Params().replace(volume=grid)
    params = params.with_(
        **{
            "atmosphere.enabled": False,
            "high_clouds.coverage": 0.0,
            "sun.visible": False,
            "sun.elevation": 90.0,
            "light.model": "single",
        }
    )
    camera = nubis.Camera.look_at((-500, 0, 1000), (0, 0, 1000), fov_y=2)
    fine = ref64.fine(600, 32)
    each, together = (
        renderer(8, 4, fine.replace(light_group_weight=share)).render_layers(camera, params)
        for share in (0.0, 0.1)
    )
    assert each["transmittance"].max() < 1e-3
    lit = params.light.albedo * params.sun.irradiance[0] / (4 * np.pi)
    veil = each["radiance"][..., 0]
    assert 0.001 * lit < veil.mean() < 0.5 * lit
    np.testing.assert_allclose(together["radiance"][..., 0], veil, atol=0.1 * veil.mean())


def test_jitter_spreads_the_error_and_adds_none(renderer):
    """Each ray of its own starts elsewhere; over the picture the mean stays."""
    camera, params = view_params("below")
    time = ref64.cloudy_time(renderer(), params, camera, 0.05, 0.8)
    straight, jittered, exact = (
        renderer(64, 36, method).render_layers(camera, params, time=time)["transmittance"]
        for method in (ref64.fine(24), ref64.fine(24, jitter=True), ref64.fine(1024))
    )
    assert not np.array_equal(straight, jittered)
    assert abs(np.mean(jittered - exact)) < 2e-3
    # Blue noise: neighbours err to different sides, across and down.
    error = jittered - exact
    assert np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1] < 0.1
    assert np.corrcoef(error[1:].ravel(), error[:-1].ravel())[0, 1] < 0.1


def test_the_end_of_a_ray_is_not_lost(renderer):
    """Ending at a transmittance of 0.1 scales away what is left: brightness stays within a few
    percent.
    """
    camera, params = view_params("above", **{"clouds.extinction": 0.05, "light.model": "single"})
    time = ref64.cloudy_time(renderer(), params, camera, 0, 1e-3)
    to_the_end, cut = (
        renderer(16, 9, ref64.fine(512, 16, min_transmittance=m)).render_layers(
            camera, params, time=time
        )
        for m in (0.0, 0.1)
    )
    opaque = to_the_end["transmittance"] < 1e-3
    assert (cut["transmittance"][opaque] == 0).all()
    a, b = (v["radiance"][opaque].mean() for v in (to_the_end, cut))
    assert b == pytest.approx(a, rel=0.1)


def test_big_steps_find_the_same_clouds(renderer):
    """A big step that hits cloud goes back to take the small ones: only a cloud that fits between
    two big steps can be lost.
    """
    camera, params = nubis.scenes["fair_weather"]
    small, big = (
        renderer(
            48, 27, ref64.fine(192, coarse_step=b, sphere_tracing=0.0, empty_before_coarse=6)
        ).render_layers(camera, params)
        for b in (1, 4)
    )
    assert (small["transmittance"] < 0.9).any()
    assert (small["transmittance"] != big["transmittance"]).mean() < 0.01
    assert np.abs(small["transmittance"] - big["transmittance"]).mean() < 2e-3
    assert big["samples"].sum() < 0.7 * small["samples"].sum()


def _searching(**changes):
    """A method whose steps are small; what it finds depends on how it searches alone."""
    return ref64.fine(96, steps_horizon=192, empty_before_coarse=6, **changes)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("seed", range(16))
def test_leaps_find_the_clouds_of_any_sky(renderer, seed):
    """Against a march that leaves out no step, one that leaps loses no more than one with big steps
    alone, but a thousandth of a pixel; from below, among and above clouds flat and tall, with wind,
    lean, towers, a larger weather map, a spot to keep clear and, in every other one, a second
    deck.
    """
    random = np.random.default_rng(seed)
    base, thickness = random.uniform(500, 2500), 10 ** random.uniform(2.5, 3.7)
    eye = random.choice([2.0, base + 0.5 * thickness, base + thickness + 2000.0])
    params = nubis.Params().with_(
        **{
            "clouds.base": base,
            "clouds.top": base + thickness,
            "clouds.cumulonimbus_top": base + thickness + 5000.0,
            "clouds.coverage": random.uniform(0.25, 0.8),
            "clouds.type": random.uniform(0, 1),
            "clouds.shape_scale": 10 ** random.uniform(3.3, 4.3),
            "clouds.detail": random.uniform(0, 0.8),
            "clouds.noise": str(random.choice(["nubis2015", "vsu2022"])),
            "clouds.precipitation": random.choice([0.0, 0.8]),
            "clouds.rain_extinction": 0.0,
            "weather.scale": 10 ** random.uniform(3.2, 4.2),
            "weather.broad_variety": random.choice([0.0, 1.0]),
            "weather.clear_radius": random.choice([0.0, 400.0, 4000.0]),
            "weather.seed": int(random.integers(100)),
            "wind.shear": random.uniform(-1500, 1500),
        }
    )
    if seed % 2:
        upper = base + thickness + random.uniform(0, 3000)
        params = params.with_(
            **{
                "upper_clouds.coverage": random.uniform(0.3, 0.7),
                "upper_clouds.type": random.uniform(0, 1),
                "upper_clouds.base": upper,
                "upper_clouds.top": upper + 10 ** random.uniform(2.5, 3.3),
                "upper_clouds.scale": 10 ** random.uniform(-0.7, 0.3),
            }
        )
    camera = looking(eye, {True: 10.0, False: -15.0}[eye < base], 70.0)
    time = random.uniform(0, 1e5)
    every, big, leaps = (
        renderer(48, 27, method).render_layers(camera, params, time=time)
        for method in (
            _searching(coarse_step=1),
            _searching(coarse_step=3, sphere_tracing=0.0),
            _searching(coarse_step=3),
        )
    )
    lost = [
        np.abs(found["transmittance"] - every["transmittance"]).mean() for found in (big, leaps)
    ]
    assert lost[1] < lost[0] + 1e-3
    assert leaps["samples"].sum() <= 1.02 * big["samples"].sum()


@pytest.mark.slow
def test_leaps_miss_no_small_cloud(renderer):
    """A sky with a tenth of cloud is searched by fewer samples; one from a map whose islands are a
    texel wide, which a leap could miss, is as well found.
    """
    camera, params = nubis.scenes["fair_weather"]
    few = params.with_(**{"clouds.coverage": 0.365})
    islands = np.full((64, 64, 3), [0.0, 0.5, 0.0])
    islands[::8, ::8, 0] = 1.0
    sharp = params.with_(**{"weather.map": islands, "weather.extent": 20_000.0})
    for sky in few, sharp:
        every, big, leaps = (
            renderer(96, 54, method).render_layers(camera, sky)
            for method in (
                _searching(coarse_step=1),
                _searching(coarse_step=3, sphere_tracing=0.0),
                _searching(coarse_step=3),
            )
        )
        assert (every["transmittance"] < 0.9).any()
        lost = [
            np.abs(found["transmittance"] - every["transmittance"]).mean() for found in (big, leaps)
        ]
        assert lost[1] < lost[0] + 6e-4
        assert leaps["samples"].sum() < (0.85 if sky is few else 1.0) * big["samples"].sum()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("scene", "changes", "coarse_step"),
    [
        ("grid", {}, 3),
        ("fair_weather", {}, 1),
    ],
)
def test_nothing_leaps_where_it_does_not_know(renderer, scene, changes, coarse_step):
    """In a grid the noise says nothing of what else there is; and a big step of one leaves out
    nothing.
    """
    if scene == "grid":
        grid = nubis.DensityGrid(*grids.make("layer"))
        camera, params = looking(2.0, 30.0, 70.0), nubis.Params().replace(volume=grid)
    else:
        camera, params = nubis.scenes[scene]
    on, off = (
        renderer(32, 18, _searching(coarse_step=coarse_step, sphere_tracing=leap)).render_layers(
            camera, params.with_(**changes)
        )
        for leap in (1.0, 0.0)
    )
    assert on["samples"].sum() > 0
    for name in on:
        np.testing.assert_array_equal(on[name], off[name])


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("height", [30.0, 9000.0])
def test_no_leap_goes_into_the_rain(renderer, height):
    """Rays that leap through clear air lose no more of rain and clouds than big steps do."""
    _, storm = nubis.scenes["storm"]
    params = storm.with_(**{"clouds.rain_extinction": 5e-4})
    camera = looking(height, 8.0 if height < 1000 else -12.0, 50.0)
    every, big, leaps = (
        renderer(48, 27, _searching(coarse_step=b, sphere_tracing=leap)).render_layers(
            camera, params
        )
        for b, leap in ((1, 0.0), (3, 0.0), (3, 0.2))
    )
    lost = [
        np.abs(found["transmittance"] - every["transmittance"]).mean() for found in (big, leaps)
    ]
    assert lost[1] < lost[0] + 5e-4


@pytest.mark.parametrize("height", [2.0, 2000.0, 6000.0, 30_000.0])
@pytest.mark.parametrize("radius", [EARTH, THESIS])
def test_only_rays_that_meet_the_shell_are_marched(renderer, height, radius):
    """No sample where the ray misses the shell, past the horizon or beside the planet; some
    everywhere else.
    """
    params = ref64.smooth_params(**{"atmosphere.planet_radius": radius})
    camera = looking(height, -5, 60)
    directions = ref64.pixel_directions(camera, 64, 64).reshape(-1, 3)
    layers = renderer(64, 64, ref64.fine(64)).render_layers(camera, params)
    samples = layers["samples"].ravel()
    eye = np.array(camera.eye)

    def in_front(altitude):
        near, far = ref64.sphere_hits(eye, directions, radius, altitude)
        return near, far, far > 0

    near_top, _, meets_top = in_front(params.clouds.top)
    near_ground, _, meets_ground = in_front(0.0)
    if height < params.clouds.base:
        meets = meets_top & ~(meets_ground & (near_ground > 0))
    else:
        meets = meets_top
    # A pixel within a thousandth of a degree of an edge may go either way.
    edge = np.zeros_like(meets)
    for limit in (0.0, params.clouds.base, params.clouds.top):
        if height > limit:
            dip = -np.degrees(np.arccos((radius + limit) / (radius + height)))
            edge |= np.abs(np.degrees(np.arcsin(directions[:, 2])) - dip) < 1e-3
    assert meets[~edge].any()
    np.testing.assert_array_equal((samples > 0)[~edge], meets[~edge])
    assert (near_top[meets & (height > params.clouds.top)] > 0).all()


def test_the_horizon_hides_what_is_beyond(renderer):
    """From 2 m the ground hides every cloud below it; dense clouds stand right above it."""
    params = ref64.smooth_params(**{"clouds.extinction": 0.1})
    camera = looking(2, 0, 20)
    layers = renderer(9, 64).render_layers(camera, params)
    elevation = np.arcsin(ref64.pixel_directions(camera, 9, 64)[..., 2])
    dip = np.arccos(EARTH / (EARTH + 2))
    assert (layers["transmittance"][elevation < -dip] == 1).all()
    assert (layers["samples"][elevation < -dip] == 0).all()
    assert (layers["transmittance"][(elevation > 0) & (elevation < np.radians(5))] < 0.5).all()


@pytest.mark.parametrize("radius", [EARTH, 10_000.0])
def test_an_eye_at_sea_level_stands_on_the_ground(renderer, radius):
    """At z = 0 the ground hides what is below, as it does from a millimetre above."""
    params = nubis.Params().with_(**{"atmosphere.planet_radius": radius, "clouds.coverage": 0.8})
    at, above = (renderer(16, 16).render_layers(looking(z, 0, 60), params) for z in (0.0, 0.001))
    assert (above["samples"][9:] == 0).all()
    assert (at["samples"][9:] == 0).all()
    np.testing.assert_allclose(at["sky"][9:], above["sky"][9:], rtol=1e-2)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("scene", nubis.scenes)
def test_layers_belong_together(renderer, scene):
    camera, params = nubis.scenes[scene]
    make = renderer(64, 36)
    layers = make.render_layers(camera, params)
    picture = make.render(camera, params)
    clouds = make.render(camera, params, background=None)
    alpha = clouds[..., 3]
    assert alpha.min() >= 0 and alpha.max() <= 1
    assert clouds[..., :3].min() >= 0
    np.testing.assert_array_equal(picture[..., 3], 1)
    np.testing.assert_array_equal(layers["radiance"], clouds[..., :3])
    np.testing.assert_array_equal(layers["transmittance"], 1 - alpha)
    over = layers["radiance"] + layers["transmittance"][..., None] * layers["sky"]
    # Transmittance comes as 1 less the opacity: the sun's disc shows what that rounds away.
    rounded = 2.0**-23 * layers["sky"]
    np.testing.assert_array_less(np.abs(picture[..., :3] - over), 1e-5 * over + 1e-6 + rounded)
    np.testing.assert_array_equal(np.isfinite(layers["depth"]), layers["transmittance"] < 1)
    assert (layers["radiance"][layers["transmittance"] == 1] == 0).all()


def test_depth_is_where_the_cloud_is(renderer):
    """Between entering and leaving the shell; on average nearly where float64 finds the scattered
    light to come from.
    """
    camera, params = view_params("below")
    directions = ref64.pixel_directions(camera, 16, 9).reshape(-1, 3)
    time = ref64.cloudy_time(renderer(), params, camera, 0.05, 0.8)
    layers = renderer(16, 9, ref64.fine(512)).render_layers(camera, params, time=time)
    starts = np.broadcast_to(np.array(camera.eye), directions.shape)
    ends = ref64.ray_ends(camera.eye, directions, params)
    depth, points = ref64.optical_depths(renderer(), params, starts, directions, ends, 4000, time)
    weight = np.exp(depth - np.cumsum(depth, axis=1)) * -np.expm1(-depth)
    distance = np.linalg.norm(points - starts[:, None], axis=2)
    expected = (weight * distance).sum(axis=1) / weight.sum(axis=1)
    np.testing.assert_allclose(layers["depth"].ravel(), expected, rtol=2e-3)


def test_a_wide_view_is_made_of_narrow_ones(renderer):
    """The middle rows of a picture are the picture of a smaller angle: no row knows of the
    others.
    """
    params = nubis.Params().with_(**{"clouds.coverage": 0.6})
    method = nubis.quality("draft").replace(jitter=False, adaptive_threshold=0.0)
    whole = renderer(40, 72, method).render(looking(200, 15, 60), params)
    narrow = 2 * np.degrees(np.arctan(np.tan(np.radians(30)) / 3))
    middle = renderer(40, 24, method).render(looking(200, 15, narrow), params)
    np.testing.assert_allclose(whole[24:48], middle, rtol=2e-2, atol=2e-3)
    assert ref64.relative_rmse(whole[24:48, :, :3], middle[..., :3]) < 1e-3


def test_bands_do_not_show(renderer):
    """A picture comes in bands as long as time allows: a new renderer, one used to light work and
    one to hard work agree.
    """
    size = 128, 256
    camera, params = looking(200, 40, 70), nubis.Params().with_(**{"clouds.coverage": 0.6})
    hard = params.with_(**{"clouds.extinction": 1e-4, "clouds.coverage": 1.0})
    pictures = []
    for warm_up in ([], [params.with_(**{"clouds.coverage": 0.0})] * 3, [hard]):
        make = nubis.Renderer(*size, quality="draft")
        for other in warm_up:
            make.render(camera, other)
        pictures.append(make.render(camera, params).tobytes())
    assert pictures[0] == pictures[1] == pictures[2]


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 301])
def test_workgroups_do_each_part_once(count):
    """And where threads share them out by their numbers, the first has one of each few."""
    numbers = np.arange(count)
    x = np.stack([numbers, np.full(count, count)], axis=-1)
    parts = probe("f32(swizzle_workgroup(u32(x.x), u32(x.y)))", x, imports=["workgroups"])[:, 0]
    np.testing.assert_array_equal(np.sort(parts), numbers)
    threads = int(probe("f32(dispatch.threads)", [0.0])[0, 0])
    assert threads >= 1
    if count >= 8 * threads:
        gaps = np.diff(parts[: count // threads])
        assert (gaps == threads).all()


PICTURE = """
import os, numpy as np, nubis
if "{processors}" == "one":
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
camera, params = nubis.scenes["above"]
renderer = nubis.Renderer(77, 45, quality="draft")
frames = renderer.animate([(camera, params, 0.0)] * 2)
np.save('{path}', np.stack([renderer.render(camera, params), *frames]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be bound")
def test_the_number_of_processors_does_not_show(tmp_path):
    pictures = []
    for processors in "one", "all":
        path = tmp_path / f"{processors}.npy"
        done = run_python(PICTURE.format(processors=processors, path=path))
        assert done.returncode == 0, done.stderr
        pictures.append(np.load(path))
    np.testing.assert_array_equal(*pictures)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("size", [(1, 1), (1, 64), (64, 1), (7, 5), (33, 17)])
def test_any_size(renderer, size):
    camera, params = nubis.scenes["fair_weather"]
    layers = renderer(*size).render_layers(camera, params)
    assert layers["radiance"].shape == (size[1], size[0], 3)
    assert np.isfinite(layers["radiance"]).all() and np.isfinite(layers["sky"]).all()


HEIGHTS = [-5.0, 0.01, 1199.99, 1200.01, 3199.99, 3200.01, 20_000.0, 400_000.0, 4e7]


@pytest.mark.slow
@pytest.mark.parametrize("height", HEIGHTS)
def test_anywhere(renderer, height):
    """On the ground, a centimetre from each side of the shell, in orbit: finite and in range in
    all directions.
    """
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.6, "clouds.base": 1200.0, "clouds.top": 3200.0}
    )
    layers = renderer(64, 32).render_layers(nubis.Camera.equirect((0, 0, height)), params)
    check_range(layers)


@pytest.mark.parametrize("shell", [1200.0, 3200.0])
@pytest.mark.parametrize("elevation", [-20.0, -0.2, 0.0, 0.2, 20.0])
def test_crossing_a_boundary_shows_nothing(renderer, shell, elevation):
    """A centimetre more of height changes hardly a pixel."""
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.9, "clouds.base": 1200.0, "clouds.top": 3200.0}
    )
    method = nubis.quality("high").replace(jitter=False)
    under, over = (
        renderer(16, 9, method).render_layers(looking(shell + dz, elevation, 4), params)[
            "transmittance"
        ]
        for dz in (-0.01, 0.01)
    )
    assert np.abs(under - over).mean() < 0.01


STRESS = [
    {"clouds.extinction": 1e-8},
    {"clouds.extinction": 1e8},
    {"light.g": 0.9999, "light.g_back": -0.9999},
    {"light.g": -0.9999},
    {"clouds.coverage": 0.0},
    {"clouds.coverage": 1.0, "clouds.precipitation": 1.0},
    {"clouds.detail": 1.0},
    {"sun.elevation": 0.0},
    {"sun.elevation": -0.3},
    {"sun.elevation": -90.0},
    {"sun.elevation": 90.0},
    {"clouds.base": 2000.0, "clouds.top": 2000.01},
    {"clouds.base": 0.0, "clouds.top": 25_000.0},
    {"atmosphere.planet_radius": 10_000.0},
    {"atmosphere.planet_radius": 1e9},
    {"atmosphere.haze": 20.0},
    {"high_clouds.coverage": 1.0, "high_clouds.altitude": 2000.0},
]


@pytest.mark.slow_after(2)
@pytest.mark.parametrize(
    "changes", STRESS, ids=lambda changes: ", ".join(f"{k}={v:g}" for k, v in changes.items())
)
@pytest.mark.parametrize("model", ["single", "thesis2018"])
def test_extreme_parameters(renderer, changes, model):
    camera, params = nubis.scenes["fair_weather"]
    check_range(
        renderer(32, 18).render_layers(camera, params.with_(**{"light.model": model, **changes}))
    )


@pytest.mark.parametrize("time", [-1e6, 86_400.0, 2.6e6, 1e12])
def test_any_time(renderer, time):
    camera, params = nubis.scenes["cirrus"]
    check_range(renderer(32, 18).render_layers(camera, params, time=time))


def check_range(layers):
    assert np.isfinite(layers["radiance"]).all() and (layers["radiance"] >= 0).all()
    assert np.isfinite(layers["sky"]).all() and (layers["sky"] >= 0).all()
    assert layers["transmittance"].min() >= 0 and layers["transmittance"].max() <= 1
    assert (layers["depth"] > 0).all()
