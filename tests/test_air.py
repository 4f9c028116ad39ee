"""The air: its radiance against paths traced in float64, its look, its tables, and clouds in it."""

import json
from itertools import pairwise

import numpy as np
import pytest

import nubis
import ref64_air
from nubis import DensityGrid
from nubis.testing import probe

CLEAR = {"clouds.coverage": 0.0, "high_clouds.coverage": 0.0, "sun.visible": False}
UNIT = {"sun.irradiance": (1.0, 1.0, 1.0)}
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def clear(**changes):
    return nubis.Params().with_(**{**CLEAR, **UNIT, **changes})


def looking(direction, height=2.0, fov=1e-3):
    eye = np.array([0.0, 0.0, height])
    up = (0.0, 1.0, 0.3) if abs(direction[2]) > 0.9 else (0.0, 0.0, 1.0)
    return nubis.Camera.look_at(eye, eye + 1000 * np.asarray(direction), up, fov)


def sky(renderer, params, direction, height=2.0):
    return renderer(1, 1).render_layers(looking(direction, height), params)["sky"][0, 0]


def test_radiance_of_the_air(renderer):
    """Every case that was traced, all orders: within 5 %, what the paths are unsure of aside."""
    cases = json.loads(ref64_air.FILE.read_text())
    got, expected, unsure = [], [], []
    for case in cases:
        direction = ref64_air.direction_of(case["view"], case["azimuth"])
        params = clear(**{"sun.elevation": case["sun"], "sun.azimuth": 0.0})
        got.append(sky(renderer, params, direction, case["eye"]))
        expected.append(case["radiance"])
        unsure.append(case["error"])
    got, expected, unsure = map(np.array, (got, expected, unsure))
    # Where next to nothing is seen: 1e-6 of the irradiance.
    error = np.abs(got - expected) / (expected + 1e-6)
    excess = error - 3 * unsure / (expected + 1e-6)
    assert len(cases) > 100
    assert {-6.0, 0.0, 90.0} <= {case["sun"] for case in cases}
    assert np.sqrt(np.mean(error**2)) < 0.04
    assert excess.max() < 0.05


def test_the_traced_file_is_of_this_twin():
    case = next(c for c in json.loads(ref64_air.FILE.read_text()) if c["sun"] == 20.0)
    direction = ref64_air.direction_of(case["view"], case["azimuth"])
    sun = ref64_air.direction_of(case["sun"], 0.0)
    rng = np.random.default_rng(5)
    mean, error = ref64_air.Air(1).trace(rng, case["eye"], direction, sun, 500)
    assert abs(mean - case["radiance"][1]) < 4 * (error + case["error"][1])


def test_transmittance_to_space():
    """By quadrature, from the ground to the top and down to the horizon: within 1 %."""
    h = np.array([0.0, 100.0, 2000.0, 12_000.0, 40_000.0])
    dip = np.degrees(np.arccos(ref64_air.EARTH / (ref64_air.EARTH + h)))
    above = np.array([0.05, 0.5, 2, 10, 45, 90])
    h, elevation = np.repeat(h, 6), (above - np.minimum(dip, 89)[:, None] * (above < 45)).ravel()
    mu = np.sin(np.radians(elevation))
    got = probe(
        "vec4f(air_transmittance(x.x, x.y), 1.0)", np.stack([h, mu], 1), imports=["atmosphere"]
    )
    for channel in range(3):
        air = ref64_air.Air(channel)
        r = ref64_air.EARTH + h[:, None]
        top = (ref64_air.EARTH + ref64_air.TOP) ** 2
        end = -r * mu[:, None] + np.sqrt(r * r * mu[:, None] ** 2 + top - r * r)
        s = end * np.linspace(0, 1, 40_001)
        at = np.sqrt(r * r + s * s + 2 * r * s * mu[:, None]) - ref64_air.EARTH
        expected = np.exp(-np.trapezoid(air.parts(at)[2], s, axis=1))
        np.testing.assert_allclose(got[:, channel], expected, rtol=0.01, atol=2e-4)


def test_a_clear_sky_is_shaped_as_cie_says(renderer):
    """CIE standard clear sky (type 12, of low turbidity: ten times our clearest aerosol): its
    luminance by angle from sun and zenith, to a factor of 1.9, where it spans one of seven.
    """
    sun = ref64_air.direction_of(45.0, 0.0)
    params = clear(**{"sun.elevation": 45.0, "sun.azimuth": 0.0, "atmosphere.haze": 10.0})
    a, b, c, d, e = -1.0, -0.32, 10.0, -3.0, 0.45

    def relative(direction):
        angle = np.arccos(np.clip(direction @ sun, -1, 1))
        gradation = 1 + a * np.exp(b / max(direction[2], 1e-3))
        return gradation * (
            1 + c * (np.exp(d * angle) - np.exp(d * np.pi / 2)) + e * np.cos(angle) ** 2
        )

    zenith = np.array([0.0, 0.0, 1.0])
    ours, cie = [], []
    for elevation in (10, 25, 40, 60, 75):
        for azimuth in (15, 60, 90, 135, 180):
            direction = ref64_air.direction_of(elevation, azimuth)
            ours.append(sky(renderer, params, direction) @ LUMINANCE)
            cie.append(relative(direction) / relative(zenith))
    ratio = np.array(ours) / (sky(renderer, params, zenith) @ LUMINANCE) / np.array(cie)
    assert np.ptp(np.log(cie)) > 1.9
    assert np.corrcoef(np.log(ours), np.log(cie))[0, 1] > 0.9
    assert np.abs(np.log(ratio)).max() < np.log(1.9)


def test_skylight_on_the_ground():
    """The table's irradiance is that of the sky map, and a clear day's share of the sun's."""
    params = clear(**{"sun.elevation": 45.0})
    table = probe(
        f"vec4f(sky_from_above(0.0, {np.sin(np.pi / 4)}), 1.0)", [[0]], imports=["atmosphere"]
    )
    rng = np.random.default_rng(2)
    u, v = rng.random((2, 4000))
    level, angle = np.sqrt(u), 2 * np.pi * v
    up = np.sqrt(1 - u)
    directions = np.stack([level * np.cos(angle), level * np.sin(angle), up], 1)
    radiance = probe(
        "vec4f(sky_radiance(x.xyz), 1.0)", directions, imports=["atmosphere"], params=params
    )
    np.testing.assert_allclose(table[0, :3], radiance[:, :3].mean(axis=0), rtol=0.03)
    assert 0.05 < np.pi * table[0, :3] @ LUMINANCE < 0.15


#: That beside which the night is as dark as it is.
SUN = {"sun.irradiance": (10.0, 10.0, 10.0)}


def test_night_falls(renderer):
    """Astronomical dusk ends at -18 degrees; what is left is the night's own light (Patat 2003)."""
    zenith = (0.0, 0.0, 1.0)
    light = [
        sky(renderer, clear(**{"sun.elevation": e, **SUN}), zenith) @ LUMINANCE
        for e in (0.0, -6.0, -12.0, -18.0, -30.0, -90.0)
    ]
    assert all(after < before * 1.001 for before, after in pairwise(light))
    assert light[0] / light[1] > 20 and light[1] / light[2] > 50
    assert 1.5e-8 < light[-1] < 2.5e-8
    # At -18 degrees what is left of the sun's is of the night's order.
    assert light[3] < 10 * light[-1]
    bright = clear(**{"sun.elevation": -90.0, "sun.irradiance": (1e6,) * 3})
    np.testing.assert_allclose(sky(renderer, bright, zenith) @ LUMINANCE, light[-1], rtol=1e-3)


def test_tables_are_made_when_their_inputs_change():
    make = nubis.Renderer(16, 9)
    camera = looking((0.0, 1.0, 0.2), fov=60.0)
    air = {"transmittance_bake", "first_order", "sum_orders"}
    bakes = air | {"sky_view_bake", "aerial_perspective_bake"}

    def baked(**changes):
        make.render(camera, clear(**changes))
        return bakes & set(make.timings)

    baked()
    assert baked() == set()
    assert baked(**{"atmosphere.aerial_perspective": 0.5}) == set()
    assert baked(**{"light.g": 0.3}) == set()
    assert baked(**{"sun.elevation": 20.0}) == bakes - air
    # Its scattered light may be kept on disk.
    assert baked(**{"atmosphere.haze": 2.125}) >= {"transmittance_bake", "sky_view_bake"}
    assert baked(**{"atmosphere.haze": 2.125}) == set()


def dusk(make, step):
    """Small pictures from a low sun to night, and the largest change from one to the next: against
    what is bright in both, as a share.
    """
    camera = looking((0.0, 1.0, 0.3), fov=80.0)
    scene = nubis.scenes["fair_weather"][1].with_(**{"sun.visible": False, "sun.azimuth": 20.0})
    pictures = [
        make.render(camera, scene.with_(**{"sun.elevation": float(e)}))[..., :3].astype(float)
        for e in np.arange(4.0, -14.0, -step)
    ]
    changes = []
    for before, after in pairwise(pictures):
        scale = np.maximum(before, after) + 0.1 * before.mean(axis=(0, 1))
        changes.append(np.abs(after - before) / scale)
    return np.array(changes)


DUSK = {
    "adaptive_threshold": 0.0,
    "steps_zenith": 80,
    "steps_horizon": 148,
    "light_steps": 96,
    "light_group_weight": 0.0,
}


@pytest.mark.slow
def test_dusk_does_not_pop():
    """In steps of a quarter of a degree, half of the sun's width, a picture changes by less than
    20 % in the mean and all but one in a hundred of its numbers by less than 50 %; in half the
    steps by about half: what jumps would not. With four times the light samples: at so low a sun
    those of `balanced` meet other clouds with each step, which changes one number in a hundred
    by a third.
    """
    make = nubis.Renderer(24, 14, quality=nubis.quality("balanced").replace(**DUSK))
    coarse, fine = dusk(make, 0.25), dusk(make, 0.125)
    mean = [changes.mean(axis=(1, 2, 3)).max() for changes in (coarse, fine)]
    assert 0.05 < mean[0] < 0.2
    assert mean[1] < 0.65 * mean[0]
    assert np.percentile(coarse, 99) < 0.5
    assert np.percentile(fine, 99) < 0.65 * np.percentile(coarse, 99)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [1e4, 400_000.0, 6_371_000.0, 1e9])
@pytest.mark.parametrize("haze", [0.0, 20.0])
def test_finite_everywhere(radius, haze):
    make = nubis.Renderer(12, 8)
    base = nubis.scenes["fair_weather"][1]
    for elevation in (-90.0, -18.0, -4.0, 0.0, 0.3, 30.0, 90.0):
        for height in (-300.0, 0.0, 1500.0, 60_000.0, 99_999.0, 2e6):
            params = base.with_(
                **{
                    "sun.elevation": elevation,
                    "atmosphere.planet_radius": radius,
                    "atmosphere.haze": haze,
                    "atmosphere.ground_albedo": (1.0, 1.0, 1.0),
                }
            )
            camera = looking((0.0, 1.0, -0.1), height, 120.0)
            picture = make.render(camera, params)
            assert np.isfinite(picture).all() and picture.min() >= 0
            # The sun's disc aside nothing is brighter than what the sun gives in full.
            dark = make.render(camera, params.with_(**{"sun.visible": False}))[..., :3]
            assert dark.max() < 10 * 5


# Slabs that stand across the view at two distances, 52 voxels apart.
VOXEL = 2000.0
NEAR, FAR = 10_000.0, 62_000.0


def slabs(*places, extinction=0.05):
    data = np.zeros((3, int((FAR - NEAR) / VOXEL), 3), dtype=np.float32)
    for place in places:
        data[:, place, :] = extinction
    return DensityGrid(data, ((-9000, NEAR, 0), (9000, FAR, 6000)))


def among_slabs(grid, **changes):
    base = {
        "light.model": "single",
        "light.g": 0.0,
        "light.albedo": 1.0,
        "sun.elevation": 45.0,
        "sun.azimuth": 180.0,
        "sun.visible": False,
        "high_clouds.coverage": 0.0,
        "atmosphere.light_shafts": False,  # test_light_shafts.py
        **UNIT,
    }
    return nubis.Params(volume=grid).with_(**{**base, **changes})


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("place", [1, 8, 24])
def test_the_air_before_a_cloud(place):
    """What an opaque slab shows at 12 to 58 km: its own light through the air, and the light of the
    air before it; both by their own quadrature.
    """
    make = nubis.Renderer(1, 1, quality=nubis.quality("high").replace(jitter=False))
    direction = np.array([0.0, 1.0, 0.0])
    camera = looking(direction, 2000.0)
    grid = slabs(place)
    seen = make.render_layers(camera, among_slabs(grid))
    dark = make.render_layers(camera, among_slabs(grid, **{"light.albedo": 0.0}))
    bare = make.render_layers(camera, among_slabs(grid, **{"atmosphere.aerial_perspective": 0.0}))[
        "radiance"
    ][0, 0]
    assert seen["transmittance"][0, 0] < 0.01
    distance = float(seen["depth"][0, 0])
    own = (seen["radiance"] - dark["radiance"])[0, 0] / bare
    sun = ref64_air.direction_of(45.0, 180.0)
    rng = np.random.default_rng(4)
    for channel in range(3):
        air = ref64_air.Air(channel)
        s = np.linspace(0, distance, 4001)
        h = np.sqrt((ref64_air.EARTH + 2000) ** 2 + s * s) - ref64_air.EARTH
        through = np.exp(-np.trapezoid(air.parts(h)[2], s))
        assert own[channel] == pytest.approx(through, rel=0.03)
        light, unsure = air.trace(rng, 2000.0, direction, sun, 1500, limit=distance)
        assert dark["radiance"][0, 0, channel] == pytest.approx(light, rel=0.06, abs=3 * unsure)


def test_each_cloud_has_its_own_air():
    """Half of what is seen stands at 12 km, half at 58: as if each were composed with its own air.
    Their mean distance, 35 km, would be 10 % off and more.
    """
    make = nubis.Renderer(1, 1, quality=nubis.quality("high").replace(jitter=False))
    camera = looking((0.0, 1.0, 0.0), 2000.0)
    thin = np.log(2) / VOXEL
    near = make.render_layers(camera, among_slabs(slabs(1, extinction=thin)))
    far = make.render_layers(camera, among_slabs(slabs(24)))
    data = slabs(24).extinction.copy()
    data[:, 1, :] = thin
    both = make.render_layers(camera, among_slabs(DensityGrid(data, slabs().bounds)))
    through = near["transmittance"][0, 0]
    assert 0.4 < through < 0.6
    expected = near["radiance"] + through * far["radiance"]
    np.testing.assert_allclose(both["radiance"], expected, rtol=0.01)
    alone = make.render_layers(camera, among_slabs(slabs(12)))
    assert np.abs(alone["radiance"] / both["radiance"] - 1).max() > 0.05


def test_the_sun_sets_later_above():
    """Under a sun at -1.5 degrees a slab is in the planet's shadow at 500 m, at 8 km it is red."""
    data = np.zeros((9, 2, 2), dtype=np.float32)
    data[0], data[8] = 0.05, 0.05
    grid = DensityGrid(data, ((-9000, 3000, 0), (9000, 4000, 9000)))
    make = nubis.Renderer(1, 1)
    changes = {"sun.elevation": -1.5, "sun.azimuth": 180.0, "atmosphere.aerial_perspective": 0.0}
    low = make.render(
        looking((0.0, 1.0, 0.0), 300.0), among_slabs(grid, **changes), background=None
    )
    high = make.render(
        looking((0.0, 1.0, 0.0), 8700.0), among_slabs(grid, **changes), background=None
    )
    assert low[0, 0, 3] > 0.9 and high[0, 0, 3] > 0.9
    assert (low[0, 0, :3] == 0).all()
    mu = np.sin(np.radians(-1.5))
    light = [ref64_air.Air(c).sunlight(np.array([8700.0]), np.array([mu]))[0] for c in range(3)]
    ratio = high[0, 0, :3] / light
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.1)
    assert light[0] > 3 * light[2] > 0


@pytest.mark.slow
def test_methods_agree_in_air():
    """The march, the reference and paths of one scattering: the same air, the same light."""
    grid = slabs(2, 9, 20, extinction=4e-4)
    params = among_slabs(grid, **{"sun.elevation": 4.0})
    camera = looking((0.0, 1.0, 0.0), 2000.0, 10.0)
    fine = nubis.quality("high").replace(steps_zenith=400, steps_horizon=400, light_steps=40)
    march, reference = (
        nubis.Renderer(4, 4, quality=q).render_layers(camera, params) for q in (fine, "reference")
    )
    np.testing.assert_allclose(march["radiance"], reference["radiance"], rtol=0.02)
    once = nubis.quality("balanced").replace(path_samples=4096, path_scatterings=1)
    path = nubis.Renderer(4, 4, quality=once).render_layers(
        camera, params.with_(**{"light.model": "path", "light.ambient_gain": 0.0})
    )
    got, expected = (layers["radiance"].mean(axis=(0, 1)) for layers in (path, reference))
    np.testing.assert_allclose(got, expected, rtol=0.02)


def share(height, changes):
    params = nubis.Params().with_(**{"clouds.type": 0.5, "weather.type_variety": 0.0, **changes})
    base, top = params.clouds.base, params.clouds.top
    column = "WeatherSample(1.0, 1.0, 1.0, x.x, 0.0, vec3f(0.0), CLOUD, x.y, x.x, 0.0, 0.0)"
    at = [[h, top - base] for h in np.atleast_1d(height)]
    return probe(f"ambient_share({column})", at, imports=["ambient"], params=params)[:, 0]


def test_clouds_hide_the_sky_from_themselves():
    """Thin ones see sky and ground alike; thick ones are lit by each from its own side; and light
    from all around has no share of its own (test_light has that furnace).
    """
    height = np.linspace(0, 1, 11)
    thin = share(height, {"clouds.extinction": 1e-6})
    np.testing.assert_allclose(thin, 0.5, atol=1e-3)
    thick = share(height, {"clouds.extinction": 10.0})
    np.testing.assert_allclose(thick, height, atol=0.01)
    usual = share(height, {})
    assert (np.diff(usual) > 0).all() and 0.02 < usual[0] < 0.2
    np.testing.assert_allclose(usual + usual[::-1], 1, atol=1e-5)
    np.testing.assert_allclose(share(height, {"light.ambient_occlusion": 0.0}), height, atol=1e-6)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("depth", [20.0, 60.0])
def test_light_through_a_deck(depth):
    """What light from above comes out at the base of a deck, by paths through a slab of droplets:
    within 25 %.
    """
    rng = np.random.default_rng(6)
    n, g = 20_000, 0.85
    z, mu = np.zeros(n), np.sqrt(rng.random(n))
    inside = np.ones(n, dtype=bool)
    for _ in range(4000):
        z = np.where(inside, z - mu * np.log(1 - rng.random(n)), z)
        inside &= (z > 0) & (z < depth)
        if not inside.any():
            break
        u = rng.random(n)
        turned = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
        angle = 2 * np.pi * rng.random(n)
        sine = np.sqrt(np.maximum(1 - mu * mu, 0) * np.maximum(1 - turned**2, 0))
        mu = np.clip(np.where(inside, mu * turned + sine * np.cos(angle), mu), -1, 1)
    through = np.mean(z >= depth)
    clouds = nubis.Params().clouds
    extinction = depth / (0.12 * (clouds.top - clouds.base))
    assert share(0.0, {"clouds.extinction": extinction})[0] == pytest.approx(through, rel=0.25)


@pytest.mark.parametrize("elevation", [90.0, 40.0, 5.0, -10.0])
def test_ground_without_air(renderer, elevation):
    """Albedo / pi E sin(elevation), as the surface of Lambert that it is."""
    params = clear(
        **{
            "sun.elevation": elevation,
            "sun.irradiance": (10.0, 9.0, 8.0),
            "atmosphere.enabled": False,
            "atmosphere.ground_albedo": (0.1, 0.5, 0.9),
        }
    )
    seen = renderer(8, 6).render(looking((0.3, 0.0, -1.0), 800.0, 40.0), params)[..., :3]
    mu = max(np.sin(np.radians(elevation)), 0.0)
    expected = np.array([0.1, 0.5, 0.9]) * (10.0, 9.0, 8.0) / np.pi * mu
    np.testing.assert_allclose(seen, np.broadcast_to(expected, seen.shape), rtol=3e-3, atol=1e-9)


def test_clouds_shade_the_ground_without_air(renderer):
    """By their transmittance toward the sun, but for what they pass on."""
    grid = DensityGrid(
        np.full((2, 2, 2), 5e-3, np.float32), ((-9e4, -9e4, 1000.0), (9e4, 9e4, 1400.0))
    )
    params = clear(**{"atmosphere.enabled": False, "sun.elevation": 50.0}).replace(volume=grid)
    params = params.with_(**{"light.model": "octaves"})
    camera = looking((0.0, 0.2, -1.0), 300.0, 20.0)
    lit, shaded = (
        renderer(8, 6).render(camera, sky)[..., :3] for sky in (params.replace(volume=None), params)
    )
    through = np.exp(-5e-3 * 400.0 / np.sin(np.radians(50.0)))
    share = shaded / lit
    np.testing.assert_allclose(share, through + (1 - through) * 0.25, atol=0.02)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("model", ["octaves", "multiple", "path"])
def test_ground_without_air_lights_clouds(renderer, model):
    """By the ground's radiance, whatever the air: all that a cloud has which the sun's light does
    not reach through itself grows with the ground's albedo.
    """
    grid = DensityGrid(
        np.full((4, 4, 4), 5e-3, np.float32), ((-300.0, -300.0, 900.0), (300.0, 300.0, 1500.0))
    )
    params = clear(
        **{
            "atmosphere.enabled": False,
            "light.model": model,
            "light.g": 0.6,
            "light.ambient_occlusion": 0.0,
        }
    )
    params = params.replace(volume=grid)
    camera = looking((0.0, 0.0, 1.0), 10.0, 20.0)
    method = nubis.quality("draft").replace(adaptive_threshold=0.0, path_samples=512)
    dark, bright = (
        renderer(4, 3, method)
        .render(
            camera,
            params.with_(**{"atmosphere.ground_albedo": (a, a, a)}),
            background=None,
        )[..., :3]
        .mean()
        for a in (0.0, 1.0)
    )
    # A cloud without absorption sends back most of it.
    ground = np.sin(np.radians(40.0)) / np.pi
    assert 0.3 * ground < bright - dark < 1.0 * ground


@pytest.mark.parametrize("background", ["sky", None])
def test_night_does_not_come_from_the_sun(renderer, background):
    """Stars and airglow are as bright whatever the sun is, in the sky and on clouds; with the sun
    below the ground and with none above it.
    """
    camera = nubis.Camera.look_at((0, 0, 200.0), (0, 1000, 500.0), fov_y=60.0)
    base = nubis.Params()
    make = renderer(32, 24)
    pictures = {
        (elevation, e): make.render(
            camera,
            base.with_(**{"sun.elevation": elevation, "sun.irradiance": (e, e, e)}),
            background=background,
        )
        for elevation, e in [(-60.0, 0.0), (-60.0, 10.0), (-60.0, 1e4), (40.0, 0.0), (-3.0, 0.0)]
    }
    night = pictures[-60.0, 0.0]
    assert night[..., :3].mean() > 1e-9
    for key, picture in pictures.items():
        np.testing.assert_allclose(picture, night, rtol=0.01, atol=2e-11, err_msg=str(key))


def test_night_is_its_parameter_above_the_air(renderer):
    """Straight up, through the air; and it is a radiance of its own, in proportion."""
    up = np.array([0.0, 0.0, 1.0])
    night = (4e-8, 2e-8, 1e-8)
    dark = clear(**{"sun.irradiance": (0.0,) * 3, "atmosphere.night": night})
    seen = sky(renderer, dark, up)
    through = probe(
        "vec4f(air_transmittance(x.x, x.y), 1.0)", np.array([[2.0, 1.0]]), imports=["atmosphere"]
    )[0, :3]
    np.testing.assert_allclose(seen, through * night, rtol=0.01)
    double = sky(renderer, dark.with_(**{"atmosphere.night": tuple(2 * v for v in night)}), up)
    np.testing.assert_allclose(double, 2 * seen, rtol=1e-3)


HAZES = [0.0, 1.0, 10.0, 20.0, 50.0, 94.0, 100.0]


def test_optical_depth_of_haze():
    """0.00533 for each unit of haze straight up: what the manual says a clear day is."""
    depth = []
    for haze in HAZES:
        through = probe(
            "vec4f(air_transmittance(x.x, x.y), 1.0)",
            np.array([[0.0, 1.0]]),
            params=clear(**{"atmosphere.haze": haze}),
            imports=["atmosphere"],
        )[0, :3]
        depth.append(-np.log(through.astype(np.float64)))
    added = np.array(depth) - depth[0]
    # Extinction at the ground times the scale height (Hillaire 2020).
    expected = np.array(HAZES) * 4.440e-6 * 1200.0
    np.testing.assert_allclose(added, expected[:, None] + np.zeros(3), rtol=0.01, atol=2e-4)
    assert expected[HAZES.index(94.0)] == pytest.approx(0.5, abs=0.002)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("elevation", [60.0, 3.0, -4.0])
def test_every_haze_renders(renderer, elevation):
    """To the end of the range: no hole, and ever less of a dark ground is told from the sky."""
    camera = looking((0.0, 1.0, 0.0), 300.0, 40.0)
    contrast = []
    for haze in HAZES:
        params = nubis.Params().with_(
            **{"atmosphere.haze": haze, "sun.elevation": elevation, "sun.azimuth": 90.0}
        )
        picture = renderer(32, 24).render(camera, params)
        assert np.isfinite(picture).all() and picture.min() >= 0
        clear_sky = renderer(8, 64).render(
            camera, params.with_(**CLEAR, **{"atmosphere.ground_albedo": (0.0,) * 3})
        )
        above, below = clear_sky[31, :, 1].mean(), clear_sky[33, :, 1].mean()
        contrast.append(abs(above - below) / max(above, below))
        assert clear_sky[..., :3].mean() > 0
    assert all(after < before + 0.01 for before, after in pairwise(contrast))
