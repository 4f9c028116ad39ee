"""The light field: against a float64 reference implementation, closed forms, other programs'
slabs, and path-traced clouds.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import nubis
import ref64_light_field as ref64
from benchmarks import light_field
from nubis.testing import light_field as field_of
from nubis.testing import probe, solve_light

ROOT = Path(__file__).parent


def light(g=0.85, albedo=1.0):
    return nubis.Params(light=nubis.params.Light(model="multiple", g=g, albedo=albedo))


def toward(elevation, azimuth=50.0):
    """Unit vector toward the sun; degrees, clockwise from north."""
    e, a = np.radians([elevation, azimuth])
    return float(np.cos(e) * np.sin(a)), float(np.cos(e) * np.cos(a)), float(np.sin(e))


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("cell", [(100.0, 100.0, 100.0), (900.0, 800.0, 60.0), (70.0, 70.0, 90.0)])
def test_solutions_of_the_reference_implementation(rng, cell, periodic):
    """Every cell, by cycles of multigrid, and by plain sweeps until nothing changes; cubes, flat
    cells, tall cells; two fields at once.
    """
    shape = 6, 5, 7
    extinction = rng.uniform(0, 0.05, shape) * (rng.uniform(size=shape) < 0.6)
    extinction = extinction.astype(np.float16).astype(float)
    sun = toward(35)
    params = light(0.8, 0.98)
    of_sun, of_sky, deposits, factor = solve_light(
        extinction, cell, sun, periodic=periodic, cycles=8, params=params
    )
    scale = ref64.split(0.8, 0.98)[1]
    np.testing.assert_allclose(deposits[0], scale * extinction, rtol=1e-3)
    beam = factor * deposits[1].astype(float)
    for got, want in zip(
        (of_sun, of_sky),
        ref64.solve(extinction, cell, sun, 0.8, 0.98, beam, periodic=periodic, sweeps=30),
        strict=True,
    ):
        np.testing.assert_allclose(got, want, atol=4e-3 * np.abs(want[0]).max())


def slab(depth, elevation, cells, *, albedo=1.0, cycles=12):
    """Field of a homogeneous slab of 1 km with an empty row below and above."""
    # Cells of a width at which the tilted lines rise by their own slope around the level.
    wide = 4 / 32 * np.sqrt(1 - ref64.TILT**2) / ref64.TILT
    extinction = np.zeros((cells + 2, 32, 32))
    extinction[1:-1] = depth / 1000.0
    high = 1000.0 / cells
    return solve_light(
        extinction,
        (wide * high, wide * high, high),
        toward(elevation),
        cycles=cycles,
        params=light(0.85, albedo),
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
    """Without extinction the sky's field is that of half a sphere."""
    _, of_sky, _, _ = solve_light(np.zeros((5, 6, 7)), (80.0, 90.0, 70.0), toward(30), cycles=1)
    np.testing.assert_allclose(of_sky[0], 2 * np.pi, rtol=1e-3)
    np.testing.assert_allclose(of_sky[3], -np.pi, rtol=1e-3)


@pytest.mark.parametrize(("depth", "bound"), [(0.5, 0.001), (5.0, 0.12), (50.0, 0.5), (500.0, 1.0)])
@pytest.mark.parametrize("cell", [(100.0, 100.0, 100.0), (800.0, 800.0, 100.0)])
def test_cycles_converge_at_any_depth(rng, cell, depth, bound):
    """Broken clouds whose cells have a scaled optical depth of up to `depth`, of droplets that
    absorb nothing: error after eight cycles from no light.
    """
    shape = 24, 32, 32
    waves = np.add.outer(np.sin(np.arange(24) / 4), np.sin(np.arange(32) / 3))
    waves = np.add.outer(waves, np.cos(np.arange(32) / 5)) + rng.uniform(-1, 1, shape)
    extinction = np.clip(waves, 0, 1) * depth / cell[2] / ref64.split(0.85, 1.0)[1]
    got, converged = (
        solve_light(extinction, cell, toward(30), cycles=n, params=light())[0][0] for n in (8, 40)
    )
    assert np.isfinite(converged).all()
    assert abs(weighted_error(got, converged, extinction)) < bound


#: Path-traced tiles of one cloud, of optical depth 20 and 80: see the JSON file beside it.
GRIDS = np.load(ROOT / "references" / "light_field_grids.npz")
GRID_CASE = json.loads((ROOT / "references" / "light_field_grids.json").read_text())


def cloud_on_a_grid(depth, sun, albedo):
    """Camera and sky of a path-traced case."""
    x, y, z = np.array(GRID_CASE["suns"][sun]) / np.linalg.norm(GRID_CASE["suns"][sun])
    extinction = GRIDS["density"].astype(np.float32) * GRIDS[f"extinction_{depth}"]
    params = nubis.Params(
        volume=nubis.DensityGrid(extinction, ((0.0, 0.0, 0.0), (1000.0, 1000.0, 1000.0))),
        light=nubis.params.Light(model="multiple", g=GRID_CASE["g"], albedo=albedo),
        atmosphere=nubis.params.Atmosphere(enabled=False, ground_albedo=(0.0, 0.0, 0.0)),
        sun=nubis.params.Sun(
            elevation=float(np.degrees(np.arcsin(z))),
            azimuth=float(np.degrees(np.arctan2(x, y))),
            irradiance=(1.0, 1.0, 1.0),
        ),
    )
    camera = nubis.Camera.look_at(GRID_CASE["eye"], GRID_CASE["target"], fov_y=GRID_CASE["fov_y"])
    return camera, params


@pytest.mark.parametrize("depth", [20, 80])
@pytest.mark.parametrize(
    "quality", ["draft", "high", pytest.param("reference", marks=pytest.mark.slow)]
)
def test_a_path_traced_cloud(renderer, depth, quality):
    """Every order of scattering, over suns and albedos: relative error of tiles, bias."""
    cloudy = GRIDS[f"depth_{depth}"] > 0.5
    errors, biases = [], []
    for i, sun in enumerate(GRID_CASE["suns"]):
        for j, albedo in enumerate(GRID_CASE["albedos"]):
            camera, params = cloud_on_a_grid(depth, sun, albedo)
            image = renderer(64, 64, quality).render(camera, params, background=None)[..., 0]
            got = image.astype(float).reshape(8, 8, 8, 8).mean((1, 3))
            want, noise = (GRIDS[f"{key}_{depth}"][i, j] for key in ("radiance", "error"))
            biases.append(got.mean() / want.mean() - 1)
            got, want, noise = got[cloudy], want[cloudy], noise[cloudy]
            relative = (got / want - 1) ** 2 - (noise / want) ** 2
            errors.append(np.sqrt(relative.mean()))
    # Measured: 0.09 and 0.10 in the mean, 0.14 and 0.15 at worst; bias 0.02, at worst 0.044.
    assert np.mean(errors) < {20: 0.10, 80: 0.115}[depth]
    assert np.max(errors) < {20: 0.15, 80: 0.20}[depth]
    assert np.sqrt(np.mean(np.square(biases))) < 0.03
    assert np.max(np.abs(biases)) < 0.05


def test_octaves_are_farther_from_the_paths(renderer):
    """The same tiles by the light model `octaves`: several times the error."""
    camera, params = cloud_on_a_grid(20, "side", 0.9999)
    want = GRIDS["radiance_20"][1, 1]
    error = {}
    for model in ("octaves", "multiple"):
        given = params.with_(**{"light.model": model})
        image = renderer(64, 64, "high").render(camera, given, background=None)[..., 0]
        got = image.astype(float).reshape(8, 8, 8, 8).mean((1, 3))
        error[model] = np.sqrt(np.mean((got - want) ** 2)) / want.mean()
    assert error["multiple"] < 0.06 < 0.3 < error["octaves"]


@pytest.mark.slow_after(2)
@pytest.mark.parametrize(
    ("scene", "elevation", "beside"),
    [(s, *sun) for sun in light_field.SUNS[:2] for s in light_field.SCENES[:2]],
)
def test_path_traced_skies(scene, elevation, beside):
    """Clouds out to the horizon, beside this project's path tracer."""
    weighted, _, _, bias = light_field.errors("multiple", 0.85, scene, (elevation, beside), "high")
    # Measured: 0.10 to 0.14, bias -0.01 to 0.09.
    assert weighted < 0.16 and abs(bias) < 0.11
    by_octaves = light_field.errors("octaves", 0.6, scene, (elevation, beside), "high")
    assert by_octaves[0] > 2 * weighted


def test_irradiance_without_clouds(renderer):
    """Of sun and sky alone: the sun's is that above the air through the air, the sky's that of its
    pictures.
    """
    params = nubis.Params().with_(
        **{
            "light.model": "multiple",
            "clouds.coverage": 0.02,
            "high_clouds.coverage": 0.0,
            "sun.elevation": 40.0,
            "weather.clear_radius": 1e6,
        }
    )
    maker = renderer(64, 64, "high")
    direct, diffuse = maker.irradiance([(0, 0, 10)], params)
    picture = maker.render(nubis.Camera.fisheye((0, 0, 10)), params)[..., :3].astype(float)
    axis = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(axis, axis)
    angle = np.hypot(x, y) * np.pi / 2
    weight = np.sinc(angle / np.pi) * np.cos(angle) * (np.pi / 64) ** 2
    disc = one_sun(x, y, params)
    seen = (picture * np.where((angle < np.pi / 2) & ~disc, weight, 0)[..., None]).sum((0, 1))
    np.testing.assert_allclose(diffuse[0], seen, rtol=0.06)
    facing, _ = maker.irradiance([(0, 0, 10)], params, normal=toward(40, params.sun.azimuth))
    np.testing.assert_allclose(direct, facing * np.sin(np.radians(40)), rtol=1e-4)
    assert (facing < params.sun.irradiance[0]).all() and (facing > 5).all()


def one_sun(x, y, params):
    """Pixels of the all-sky picture near the sun's disc, which is no part of diffuse light."""
    e, a = np.radians([params.sun.elevation, params.sun.azimuth])
    r = (np.pi / 2 - e) / (np.pi / 2)
    # Up in an all-sky picture is north, right is west.
    near = [np.hypot(x - sign * r * np.sin(a), y + r * np.cos(a)) < 0.08 for sign in (-1, 1)]
    return near[0] | near[1]


def test_irradiance_on_the_ground_of_a_deck(renderer):
    """Mean over points under an overcast: what an all-sky picture of the clouds gathers."""
    params = nubis.scenes["stratocumulus"][1].with_(
        **{
            "light.model": "multiple",
            "light.g": 0.85,
            "high_clouds.coverage": 0.0,
            "atmosphere.enabled": False,
            "atmosphere.ground_albedo": (0.0, 0.0, 0.0),
            "sun.irradiance": (1.0, 1.0, 1.0),
        }
    )
    points = [(x, y, 1.0) for x in np.linspace(-2500, 2500, 4) for y in np.linspace(-2500, 2500, 4)]
    direct, diffuse = renderer(24, 24, "draft").irradiance(points, params)
    axis = (np.arange(24) + 0.5) / 12 - 1
    x, y = np.meshgrid(axis, axis)
    angle = np.hypot(x, y) * np.pi / 2
    weight = np.where(angle < np.pi / 2, np.sinc(angle / np.pi) * np.cos(angle), 0)
    weight *= np.pi / weight.sum()
    maker = renderer(24, 24, "draft")
    pictures = (maker.render(nubis.Camera.fisheye(p), params, background=None) for p in points)
    seen = [(picture[..., 0] * weight).sum() for picture in pictures]
    whole = direct[:, 0].mean() + np.mean(seen)
    assert direct[:, 0].mean() + diffuse[:, 0].mean() == pytest.approx(whole, rel=0.07)


def test_irradiance_of_another_model(renderer):
    with pytest.raises(nubis.ParameterError, match=r"light.model.*octaves.*multiple"):
        params = nubis.Params().with_(**{"light.model": "octaves"})
        renderer(8, 8).irradiance([(0, 0, 0)], params)


@pytest.mark.parametrize("normal", [(0, 0, 0), (0, np.nan, 1), (1, 2), "up"])
def test_irradiance_of_no_plane(renderer, normal):
    params = nubis.Params().with_(**{"light.model": "multiple"})
    with pytest.raises(nubis.ParameterError, match="normal"):
        renderer(8, 8).irradiance([(0, 0, 0)], params, normal=normal)


@pytest.mark.parametrize("g", [-0.9, -0.5, 0.0, 0.99])
def test_any_phase_function(renderer, g):
    """Clouds that scatter all light send back no more than comes in; the ground stays lit."""
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(**{"light.g": g, "light.albedo": 1.0, "high_clouds.coverage": 0.0})
    bright = {}
    for model in ("octaves", "multiple"):
        picture = renderer(64, 36).render(camera, params.with_(**{"light.model": model}))
        bright[model] = picture[-6:, :, :3].mean()
    assert bright["multiple"] == pytest.approx(bright["octaves"], rel=0.2)
    points = np.array([(x, 0.0, z) for x in (-900.0, 0.0, 900.0) for z in (1300.0, 1700.0)])
    direct, diffuse = renderer(64, 36).irradiance(
        points, params.with_(**{"light.model": "multiple"})
    )
    assert (direct + diffuse < 2 * np.array(params.sun.irradiance)).all() and (diffuse > 0).all()


@pytest.mark.parametrize("high", [0.0, 0.6])
def test_a_sky_without_marched_clouds(renderer, high):
    """It has no field. Its ground is that of the other models, whose shadows of high clouds are all
    but the same.
    """
    camera = nubis.Camera.look_at((0, 0, 200), (900, 700, 0), fov_y=40)
    params = nubis.Params().with_(
        **{"clouds.coverage": 0.0, "high_clouds.coverage": high, "high_clouds.optical_depth": 0.5}
    )
    ground = {
        model: renderer(32, 18).render(camera, params.with_(**{"light.model": model}))[-6:]
        for model in ("octaves", "multiple")
    }
    np.testing.assert_allclose(ground["multiple"], ground["octaves"], rtol=0.12 if high else 1e-5)


def test_the_same_after_another_sky(renderer):
    """The field depends on the picture alone."""
    camera, params = nubis.scenes["fair_weather"]
    params = params.with_(**{"light.model": "multiple"})
    maker = renderer(48, 27, "draft")
    first = maker.render(camera, params)
    maker.render(camera, params.with_(**{"sun.elevation": 10.0, "clouds.coverage": 0.7}))
    np.testing.assert_array_equal(first, maker.render(camera, params))


@pytest.mark.parametrize("elevation", [60.0, 5.0])
def test_nested_levels_against_one(rng, elevation):
    """The finest level in coarser ones, and the same cells in a level four times as large: fluence
    weighted by density, in the inner half and where levels blend.
    """
    params = nubis.scenes["stratocumulus"][1].with_(
        **{"light.model": "multiple", "light.g": 0.85, "sun.elevation": elevation}
    )
    count = 30_000
    base, top = params.clouds.base, params.clouds.top
    points = np.c_[rng.uniform(-3200, 3200, (count, 2)), rng.uniform(base, top, count)]
    place = "field_place(x.xyz, altitude_at(x.xyz))"
    read = (
        f"textureSampleLevel(%s, clamp_sampler, field_texel({place}, field_level({place})), 0.0).r"
    )
    names = "field_optics", "field_sun", "field_sky"
    expression = f"vec4f({', '.join(read % name for name in names)}, 0.0)"
    few, many = (
        probe(
            expression,
            points,
            imports=["light_field", "shell"],
            params=params,
            quality=nubis.quality("balanced").replace(field_cells=cells),
        )[:, :3].T.astype(float)
        for cells in (64, 128)
    )
    away = np.abs(points[:, :2]).max(1)
    # Measured: 0.014 and 0.006 at 60 degrees, 0.033 and 0.006 at 5; at the rim 0.035 and 0.039.
    for inside, bounds in ((away < 1600, (0.04, 0.02)), (away > 2500, (0.06, 0.03))):
        density = many[0] * inside
        for got, want, bound in zip(few[1:], many[1:], bounds, strict=True):
            error = np.sqrt((density * (got - want) ** 2).sum() / (density * want**2).sum())
            assert error < bound


def test_a_deep_slab_is_solved(renderer):
    """The cycles that a picture has suffice for the slowest modes: light below an optical depth of
    80, in the middle of a wide box, is what Monte Carlo transmits (0.120 of the sun's).
    """
    wide = 20_000.0
    grid = nubis.DensityGrid(
        np.full((10, 20, 20), 0.08, np.float32),
        ((-wide / 2, -wide / 2, 1000.0), (wide / 2, wide / 2, 2000.0)),
    )
    params = nubis.Params(
        volume=grid,
        light=nubis.params.Light(model="multiple", g=0.85, albedo=1.0),
        atmosphere=nubis.params.Atmosphere(enabled=False, ground_albedo=(0.0, 0.0, 0.0)),
        sun=nubis.params.Sun(elevation=63.4, irradiance=(1.0, 1.0, 1.0)),
    )
    # Right below the base: from the ground the sides of the box are in sight.
    direct, diffuse = renderer(8, 8, "draft").irradiance([(0.0, 0.0, 999.0)], params)
    assert direct.max() < 1e-6
    assert diffuse[0, 0] / np.sin(np.radians(63.4)) == pytest.approx(0.120, rel=0.2)


def weighted_error(got, want, density):
    """Root of the mean square of a difference relative to the mean, weighted by density."""
    mean = (density * want).sum() / density.sum()
    return np.sqrt((density * (got - want).astype(float) ** 2).sum() / density.sum()) / mean


def levels_of(texture, scene):
    """Parts of a texture of all levels. Coarser levels of storms have half as many rows."""
    parts = 5 if scene != "storm" else 6
    rows = len(texture) // parts
    ends = [parts - 4 + n for n in range(4)]
    return np.split(texture, [rows * end for end in ends])


def multiple(scene, **changes):
    camera, params = nubis.scenes[scene]
    return camera, params.with_(**{"light.model": "multiple", "light.g": 0.85}, **changes)


@pytest.mark.parametrize(
    ("scene", "elevation", "bounds"),
    [
        ("fair_weather", 60.0, (0.03, 0.08)),
        ("fair_weather", 25.0, (0.03, 0.08)),
        ("fair_weather", 5.0, (0.015, 0.05)),
        ("stratocumulus", 60.0, (0.015, 0.05)),
        ("stratocumulus", 5.0, (0.01, 0.04)),
        ("storm", 60.0, (0.04, 0.08)),
        ("storm", 25.0, (0.08, 0.11)),
        ("storm", 5.0, (0.05, 0.10)),
    ],
)
def test_planned_cycles_against_ten_more(renderer, scene, elevation, bounds):
    """Fluence of the sun's light weighted by density, on the finest level and on the worst; that of
    the sky.
    """
    camera, params = multiple(scene, **{"sun.elevation": elevation, "sun.azimuth": 45.0})
    maker = renderer(64, 36, "balanced")
    planned, converged = (field_of(maker, camera, params, more_cycles=n) for n in (0, 10))
    parts = [[levels_of(texture, scene) for texture in field] for field in (planned, converged)]
    sun, sky = (
        [
            weighted_error(got[..., 0], want[..., 0], optics[..., 0])
            for got, want, optics in zip(parts[0][i], parts[1][i], parts[1][0], strict=True)
        ]
        for i in (1, 2)
    )
    assert sun[0] < bounds[0]
    assert max(sun) < bounds[1]
    assert max(sky) < 0.06


@pytest.mark.parametrize("elevation", [25.0, 60.0])
def test_an_animated_field_follows_the_sun(renderer, elevation):
    """After forty frames, the sun rising by 0.2 degrees a frame: the field of the last frame, and
    that of a still.
    """
    camera, params = multiple("fair_weather", **{"sun.elevation": elevation})
    maker = renderer(320, 180, "draft")
    shots = [
        (camera, params.with_(**{"sun.elevation": elevation + 0.2 * i}), 0.0) for i in range(40)
    ]
    for _ in maker.animate(iter(shots)):
        pass
    followed = field_of(maker, camera, params, animated=True)
    still = field_of(maker, camera, shots[-1][1])
    first = field_of(maker, camera, params)
    rows = len(still[0]) // 5
    # Measured: 0.034 on the finest level; 0.14 on the worst, which may lag by more than a degree.
    for level, bound in ((0, 0.045), (1, 0.08), (2, 0.1), (3, 0.15), (4, 0.15)):
        part = slice(level * rows, (level + 1) * rows)
        density = still[0][part, ..., 0]
        error = weighted_error(followed[1][part, ..., 0], still[1][part, ..., 0], density)
        assert error < bound, level
    # The sun's way is not nothing.
    part = slice(rows)
    moved = weighted_error(first[1][part, ..., 0], still[1][part, ..., 0], still[0][part, ..., 0])
    assert moved > 2 * weighted_error(
        followed[1][part, ..., 0], still[1][part, ..., 0], still[0][part, ..., 0]
    )


def test_an_animated_field_follows_wind_and_eye(renderer):
    """A time lapse from a moving eye: the last frame has the light of a still."""
    camera, params = multiple("fair_weather")
    maker = renderer(320, 180, "draft")
    east = np.array([40.0, 0.0, 0.0])
    shots = [
        (
            nubis.Camera.look_at(camera.eye + i * east, camera.eye + i * east + camera.forward),
            params,
            8.0 * i,
        )
        for i in range(25)
    ]
    *_, last = maker.animate(iter(shots))
    still = maker.render(*shots[-1][:2], time=shots[-1][2])
    # Measured: 0.98.
    assert 0.95 < last[..., :3].mean() / still[..., :3].mean() < 1.05


def test_stills_do_not_depend_on_animations(renderer):
    """A still before, between and after frames of a sky with a moving sun."""
    camera, params = multiple("fair_weather")
    maker = renderer(48, 27, "draft")
    first = maker.render(camera, params)
    shots = ((camera, params.with_(**{"sun.azimuth": 10.0 + i}), 2.0 * i) for i in range(6))
    for i, _ in enumerate(maker.animate(shots)):
        if i % 2:
            np.testing.assert_array_equal(first, maker.render(camera, params))
    np.testing.assert_array_equal(first, maker.render(camera, params))


def test_animations_do_not_depend_on_stills(renderer):
    """The frames of a flight with and without stills between them."""
    camera, params = multiple("fair_weather")
    shots = [(camera, params.with_(**{"sun.azimuth": 10.0 + 0.1 * i}), 1.0 * i) for i in range(8)]
    maker = renderer(48, 27, "draft")
    alone = [np.array(frame) for frame in maker.animate(iter(shots))]
    maker = renderer(48, 27, "draft")
    for want, got in zip(alone, maker.animate(iter(shots)), strict=True):
        np.testing.assert_array_equal(got, want)
        maker.render(camera, params.with_(**{"sun.elevation": 15.0}))


@pytest.mark.parametrize("depth", [1.0, 3.0])
@pytest.mark.parametrize(
    ("below", "pitch", "low", "high"),
    # Measured: 0.95 to 1.01, 0.86 to 0.96, 0.73 to 1.05, 0.64 to 0.73.
    [
        (True, 85.0, 0.88, 1.12),
        (True, 40.0, 0.82, 1.12),
        (False, 85.0, 0.68, 1.15),
        (False, 40.0, 0.58, 1.1),
    ],
)
def test_a_layer_against_paths(renderer, depth, below, pitch, low, high):
    """Radiance of a uniform layer, of every order of scattering, at two heights of the sun: the
    closed form relative to path tracing in a box of 60 km.
    """
    side = 30_000.0
    layer = nubis.DensityGrid(
        np.full((4, 8, 8), depth / 300.0, np.float32),
        ((-side, -side, 5000.0), (side, side, 5300.0)),
    )
    steep = np.sin(np.radians(pitch))
    direction = np.array([0, np.cos(np.radians(pitch)), steep if below else -steep])
    eye = np.array([0, 0, 4900.0 if below else 5400.0])
    camera = nubis.Camera.look_at(eye, eye + direction, (1, 0, 0), fov_y=2.0)
    quality = nubis.quality("balanced").replace(integrator="path", path_samples=48)
    paths = nubis.Renderer(16, 16, quality=quality)
    ratios = []
    for elevation in (60.0, 25.0):
        params = nubis.Params(
            volume=layer,
            light=nubis.params.Light(model="multiple", g=0.85, albedo=0.999),
            atmosphere=nubis.params.Atmosphere(
                enabled=False, ground_albedo=(0, 0, 0), planet_radius=1e9
            ),
            sun=nubis.params.Sun(elevation=elevation, azimuth=90.0, irradiance=(1, 1, 1)),
        )
        traced = paths.render_layers(camera, params)["radiance"][..., 0].astype(float)
        sun = toward(elevation, 90.0)
        away = 1 - direction @ sun
        turn = f"Turn({away:.9f}, model_phase({away:.9f}))"
        closed = probe(
            f"vec4f(layer_light(x.x, x.y, x.z, x.w, {turn}))",
            [(depth, sun[2], steep, sun[2] if below else -sun[2])],
            imports=["light"],
            params=params.replace(volume=None),
        )[0, 0]
        ratios.append(closed / traced.mean())
    # The mean of both suns has a noise of 4 %.
    assert low < np.mean(ratios) < high


@pytest.mark.parametrize("g", [0.85, 0.95])
def test_the_ground_through_thin_clouds(g):
    """Thin clouds from above, beside the path tracer: the ground's light that they scatter forward
    is most of theirs. Without it their sum is 0.30 and 0.11 of that of the paths.
    """
    camera = nubis.Camera.look_at((3000, -2000, 9000), (6000, -1000, 0), fov_y=40)
    changes = {
        "light.g": g,
        "clouds.extinction": 0.004,
        "atmosphere.enabled": False,
        "atmosphere.ground_albedo": (0.5,) * 3,
        "high_clouds.coverage": 0.0,
    }
    _, params = multiple("fair_weather")
    params = params.with_(**changes)
    paths = nubis.quality("balanced").replace(integrator="path", path_samples=128)
    got, want = (
        nubis.Renderer(16, 16, quality=quality).render_layers(camera, params)["radiance"]
        for quality in ("high", paths)
    )
    assert got.sum() == pytest.approx(want.sum(), rel=0.06)
