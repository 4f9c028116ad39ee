"""Light that is baked around the eye (shaders/wgsl/sun_volume.wgsl)."""

import numpy as np
import pytest

import nubis
from nubis.testing import probe

LIVE = nubis.quality("balanced").replace(contrast=0.0)
BAKED = LIVE.replace(sun_volume=True, light_steps=3)
SIZE = 96, 54


def rendered(scene, quality, size=SIZE, **changes):
    camera, params = nubis.scenes[scene]
    return nubis.Renderer(*size, quality=quality).render_layers(camera, params.with_(**changes))


@pytest.mark.parametrize("scene", ["fair_weather", "overcast", "storm", "sunset"])
def test_transmittance_of_points(rng, scene):
    """Against the converged integral along each point's own ray, within 4 km of the eye.

    A cell of 75 to 150 m knows the mean of what is in it, so single points are off where the light
    changes within one: 0.05 in the mean, 0.1 under a low sun. Their mean is right to 0.04.
    """
    params = nubis.scenes[scene][1].with_(**{"high_clouds.coverage": 0.0})
    points = rng.uniform(
        (-4000, -4000, params.clouds.base + 50), (4000, 4000, params.clouds.top), (400, 3)
    )
    expected = nubis.Renderer(1, 1).sun_transmittance(points, params)
    baked = probe(
        "vec4f(exp(-sun_volume_depth(x.xyz, 0u)))",
        points,
        imports=["sun_volume"],
        params=params,
        quality=BAKED,
    )[:, 0]
    assert np.abs(baked - expected).mean() < (0.1 if scene == "sunset" else 0.05)
    assert abs(baked.mean() - expected.mean()) < 0.04
    assert np.corrcoef(baked, expected)[0, 1] > 0.7


@pytest.mark.parametrize(
    "scene, most", [("fair_weather", 0.10), ("overcast", 0.12), ("storm", 0.33)]
)
def test_on_is_off(scene, most):
    """Against 32 live samples: the errors of three samples and the volume, of all light."""
    best = rendered(scene, LIVE.replace(light_steps=32))
    baked = rendered(scene, BAKED)
    seen = best["transmittance"] < 0.999
    error = (baked["radiance"] - best["radiance"])[seen]
    assert np.sqrt(np.mean(error**2)) < most * best["radiance"][seen].mean()
    assert np.array_equal(baked["transmittance"], best["transmittance"])


def test_an_eye_beside_the_middle():
    """The volume stays where it is while the eye moves by up to 300 m: as right there as in the
    middle. Read with the wrong sign, 800 m beside, it errs by three times as much.
    """
    camera, params = nubis.scenes["storm"]
    errors = []
    for eye in ((0, 0, 200), (290, -290, 200)):
        moved = nubis.Camera.look_at(eye, np.add(eye, camera.forward), (0, 0, 1), camera.fov)
        best, baked = (
            nubis.Renderer(*SIZE, quality=q).render_layers(moved, params)["radiance"]
            for q in (LIVE.replace(light_steps=32), BAKED)
        )
        errors.append(np.sqrt(np.mean((baked - best) ** 2)) / best.mean())
    assert errors[1] < 1.3 * errors[0]


def test_it_follows_from_the_picture_alone():
    """The same bytes whatever has been rendered before, though the volume stays for a while."""
    camera, params = nubis.scenes["fair_weather"]
    used = nubis.Renderer(32, 18, quality=BAKED)
    for eye, time in [
        ((0, 0, 200), 0.0),
        ((120, 40, 260), 0.0),
        ((120, 40, 260), 1.7),
        ((900, 0, 200), 50.0),
    ]:
        camera = nubis.Camera.look_at(eye, (0, 5000, 1500), (0, 0, 1), 60.0)
        fresh = nubis.Renderer(32, 18, quality=BAKED).render(camera, params, time=time)
        assert used.render(camera, params, time=time).tobytes() == fresh.tobytes()


def test_it_stays_while_the_eye_moves_a_little():
    params = nubis.scenes["fair_weather"][1]
    used = nubis.Renderer(32, 18, quality=BAKED)
    baked = []
    for x, time in [(0, 0.0), (50, 0.0), (50, 1.0), (1000, 1.0), (1000, 60.0)]:
        used.render(
            nubis.Camera.look_at((x, 0, 200), (x, 5000, 1500), (0, 0, 1), 60.0), params, time=time
        )
        baked.append("sun_volume_light" in used.timings)
    assert baked == [True, False, False, True, True]


def test_shadows_drift_with_the_clouds():
    """Between two bakes the volume is read where the wind has carried it from."""
    params = nubis.Params().with_(
        **{"wind.speed": 20.0, "wind.weather_speed": 20.0, "wind.updraft": 0.0}
    )
    step = nubis.Renderer(32, 18, quality=BAKED)
    camera = nubis.Camera.look_at((0, 0, 200), (0, 5000, 1500), (0, 0, 1), 60.0)
    # 25 m / 20 m/s: a bake every 1.25 s.
    late, baked = step.render(camera, params, time=1.24), step.render(camera, params, time=1.2501)
    assert np.abs(late - baked).mean() < 0.01 * baked.mean()
