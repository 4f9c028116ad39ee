"""The high clouds: patterns, cover, light, what lies before what, and a sky of nothing else."""

import itertools
from itertools import pairwise

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from test_twins import texels

ALONE = {"clouds.coverage": 0.0, "sun.visible": False, "atmosphere.enabled": False}


def high_params(values=None, **others):
    """No air, no other clouds; the fields of the block by their own names."""
    values = {f"high_clouds.{name}": value for name, value in (values or {}).items()}
    return nubis.Params().with_(**ALONE | values | others)


def high_map(size=256, time=0.0, **values):
    """The whole texture, shape (size, size)."""
    params = high_params({"texture_size": size} | values)
    at = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1)
    return texels("high_map", at, params, time=time)[..., 0]


def thickness(renderer, points, params, time=0.0):
    """Optical depth straight up from points near the ground, of the thickest: what a sun straight
    above loses. The first is left out: it is where f32 counts from.
    """
    points = np.column_stack([points, np.full(len(points), 10.0)])
    above = params.with_(**{"sun.elevation": 90.0})
    through = renderer().sun_transmittance(np.vstack([[0, 0, 10], points]), above, time=time)[1:]
    return -np.log(through) / params.high_clouds.optical_depth


def straight(eye, down=False, fov=20.0):
    """A narrow view straight up or down."""
    x, y, z = eye
    return nubis.Camera.look_at(eye, (x, y, z - 1000 if down else z + 1000), (0, 1, 0), fov)


def layer_hits(camera, size, params):
    """Where the rays of a view meet the layer, shape (h, w, 3), and the cosines of the rays and of
    the sun with the zenith there.
    """
    directions = ref64.pixel_directions(camera, *size)
    radius, altitude = params.atmosphere.planet_radius, params.high_clouds.altitude
    near, far = ref64.sphere_hits(camera.eye, directions, radius, altitude)
    at = camera.eye + np.where(near > 0, near, far)[..., None] * directions
    up = ref64.normalized(ref64.from_centre(at, radius))
    return at, (up * directions).sum(axis=-1), up @ ref64.sun_direction(params)


# --- Patterns ---------------------------------------------------------------------------------


def spectrum(picture):
    """Power by waves a tile along and across."""
    power = np.abs(np.fft.fft2(picture - picture.mean())) ** 2
    waves = np.fft.fftfreq(len(picture), 1 / len(picture))
    across, along = np.meshgrid(waves, waves, indexing="ij")
    return power / power.sum(), along, across


def test_streaks_lie_along_the_wind():
    """Waves are as many times shorter across as they are stretched, in their mean squares."""
    for stretch, low, high in ((1.0, 0.6, 1.6), (3.0, 2.2, 5.0), (9.0, 5.0, 15.0)):
        ratios = []
        for seed in range(4):
            power, along, across = spectrum(high_map(stretch=stretch, seed=seed, octaves=1))
            ratios.append((power * across**2).sum() / (power * along**2).sum())
        assert low < np.sqrt(np.mean(ratios)) < high, stretch


def test_cells_have_a_size():
    """The strongest waves that are smaller than patches are those of hexagons 1/12 tile apart:
    sqrt(4/3) of them in a cell. Streaks have no such size.
    """
    bands = np.arange(6, 30, 2)
    for kind in (0.0, 1.0):
        total = np.zeros(len(bands))
        for seed in range(4):
            power, along, across = spectrum(high_map(type=kind, stretch=1.0, seed=seed, octaves=3))
            waves = np.hypot(along, across)
            total += [power[(waves >= a) & (waves < a + 2)].sum() for a in bands]
        peak = bands[total.argmax()] + 1
        assert (10 <= peak <= 16) if kind else (peak == 7), (kind, total)


def test_types_go_over_into_each_other():
    """A small step of the type is a small step of the texture, also to and from the two ends, which
    have kernels of their own.
    """
    kinds = [0.0, 1e-4, 0.25, 0.2501, 0.5, 0.75, 0.9999, 1.0]
    maps = dict(zip(kinds, (high_map(64, type=k) for k in kinds), strict=True))
    for a, b in ((0.0, 1e-4), (0.25, 0.2501), (0.9999, 1.0)):
        np.testing.assert_allclose(maps[a], maps[b], atol=2e-3)

    # More of the one and less of the other, and never a field that has lost its contrast.
    def likeness(kind, end):
        return np.corrcoef(maps[kind].ravel(), maps[end].ravel())[0, 1]

    middle = [0.25, 0.5, 0.75]
    assert all(likeness(a, 0.0) > likeness(b, 0.0) + 0.05 for a, b in pairwise(middle))
    assert all(likeness(a, 1.0) < likeness(b, 1.0) - 0.05 for a, b in pairwise(middle))
    spread = [maps[k].std() for k in (0.0, *middle, 1.0)]
    assert min(spread) > 0.8 * min(spread[0], spread[-1])
    assert all(abs(m.mean() - 0.5) < 0.06 for m in maps.values())


def test_the_type_varies_over_the_tile():
    """Between the ends one finds each pattern somewhere: the blend follows one in some places and
    the other elsewhere.
    """
    ends, mixed = [high_map(type=k) - 0.5 for k in (0.0, 1.0)], high_map(type=0.5) - 0.5

    def blocks(a, b):
        """Correlation in each of 8 x 8 places."""
        a, b = (v.reshape(8, 32, 8, 32).transpose(0, 2, 1, 3).reshape(64, -1) for v in (a, b))
        a, b = (v - v.mean(axis=1, keepdims=True) for v in (a, b))
        return (a * b).sum(axis=1) / np.sqrt((a * a).sum(axis=1) * (b * b).sum(axis=1))

    streaks, cells = (blocks(mixed, end) for end in ends)
    assert (streaks > 0.9).any() and (cells > 0.9).any()
    assert (streaks > cells).any() and (cells > streaks).any()


# --- Octaves and time -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [0.0, 0.5, 1.0])
def test_fewer_octaves_lack_only_detail(kind):
    """An octave has half the amplitude of the one before: what is left out is less and less, and
    the clouds are the same.
    """
    maps = [high_map(128, type=kind, octaves=n) for n in range(1, 7)]
    missing = [np.sqrt(np.mean((m - maps[-1]) ** 2)) for m in maps[:-1]]
    assert all(0.3 * a < b < 0.75 * a for a, b in pairwise(missing)), missing
    likeness = [np.corrcoef(m.ravel(), maps[-1].ravel())[0, 1] for m in maps]
    assert likeness[2] > 0.96 and likeness[3] > 0.99


@pytest.mark.parametrize("kind", [0.0, 0.5, 1.0])
def test_smaller_textures_show_the_same_clouds(kind):
    """Means over a sixteenth of the tile's width."""

    def coarse(size):
        n = size // 16
        return high_map(size, type=kind).reshape(16, n, 16, n).mean(axis=(1, 3)).ravel()

    best = coarse(512)
    likeness = [np.corrcoef(coarse(size), best)[0, 1] for size in (64, 128, 256)]
    assert min(likeness) > 0.97 and likeness[2] > 0.999


@pytest.mark.parametrize("kind", [0.0, 1.0])
def test_no_evolution_freezes(kind):
    first, later = (high_map(64, t, type=kind, evolution=0.0) for t in (0.0, 1e7))
    assert first.tobytes() == later.tobytes()
    moving = [high_map(64, t, type=kind, evolution=1e-3) for t in (0.0, 100.0, 1e7)]
    assert 0.01 < np.abs(moving[1] - moving[0]).mean() < np.abs(moving[2] - moving[0]).mean()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("kind", [0.0, 1.0])
def test_a_month_is_as_sharp_as_a_second(kind):
    """Differences of neighbouring texels, and the spread, after any time; also halfway between two
    updates, where a plain blend would be flat.
    """
    times = [1.0, 500.0, 250.0, 30 * 86400.0, 1e9 + 0.5]
    maps = [np.stack([high_map(128, t, type=kind, seed=s) for s in range(6)]) for t in times]
    for measure in (np.std, lambda m: np.sqrt(np.mean(np.diff(m, axis=-1) ** 2))):
        values = [measure(m) for m in maps]
        assert max(values) < 1.15 * min(values), values


def test_small_octaves_change_sooner():
    """A little later, small waves have changed more of themselves than large ones."""
    a, b = (high_map(256, t, octaves=5, stretch=1.0, evolution=1e-3) for t in (0.0, 60.0))
    before, along, across = spectrum(a)
    waves = np.hypot(along, across)
    change = spectrum(b - a)[0] * (b - a).var() / a.var()
    bands = [(waves >= low) & (waves < 2 * low) for low in (2, 8, 32)]
    shares = [change[band].sum() / before[band].sum() for band in bands]
    assert shares[0] < 0.2 * shares[1] and shares[1] < 0.5 * shares[2], shares


# --- Cover ------------------------------------------------------------------------------------


@pytest.mark.parametrize("curve", ["exponential", "clamp"])
@pytest.mark.parametrize("kind", [0.0, 0.6, 1.0])
def test_the_whole_layer_follows_its_formulas(renderer, rng, curve, kind):
    """Thickness at points, from noise to the curve, wind and evolution included, in float64."""
    values = {"type": kind, "curve": curve, "texture_size": 128, "optical_depth": 2.0}
    params = high_params(values | {"coverage": 0.6, "direction": 33.0, "stretch": 2.0})
    points = rng.uniform(-30_000, 30_000, (300, 2))
    got = thickness(renderer, points, params, time=1234.0)
    radius, height = params.atmosphere.planet_radius, params.high_clouds.altitude
    layer = ref64.raised(np.column_stack([points, np.zeros(300)]), radius, height)
    expected = ref64_noise.high_clouds(ref64.on_chart(layer, radius), params, 1234.0)[0]
    assert expected.std() > 0.1
    # A texel is wrong by up to 2^-11, which the steeper curve multiplies by 2.5.
    np.testing.assert_allclose(got, expected, atol=2e-3)


@pytest.mark.parametrize("curve", ["exponential", "clamp"])
@pytest.mark.parametrize("kind", [0.0, 1.0])
def test_cover(renderer, rng, curve, kind):
    """More cover is more cloud at every point: none at 0, some everywhere at 1."""
    points = rng.uniform(-30_000, 30_000, (400, 2))
    covers = [0.0, 0.2, 0.4, 0.5, 0.6, 0.8, 0.9, 1.0]
    depths = [
        thickness(renderer, points, high_params({"coverage": c, "curve": curve, "type": kind}))
        for c in covers
    ]
    assert (depths[0] == 0).all()
    for thinner, thicker in pairwise(depths):
        assert (thicker >= thinner - 1e-5).all()
        assert thicker.mean() > 1.01 * thinner.mean() or not 0.01 < thicker.mean() < 0.99
    assert depths[-1].min() > 0.4 and depths[-1].mean() > 0.8
    half = (depths[3] > 0.01).mean()
    assert 0.25 < half < 0.85


def test_the_clamp_cuts_sharper(renderer, rng):
    """Both are functions of the same noise: where the clamped one is full, the other still has its
    gradations, and each grows with the other.
    """
    points = rng.uniform(-30_000, 30_000, (1000, 2))
    soft, sharp = (
        thickness(renderer, points, high_params({"coverage": 0.6, "curve": c, "type": 1.0}))
        for c in ("exponential", "clamp")
    )
    between = (sharp > 0.02) & (sharp < 0.98)
    assert (np.diff(soft[between][np.argsort(sharp[between])]) > -1e-4).all()
    assert (soft[sharp > 0.999].max() - soft[sharp > 0.999].min()) > 0.02
    assert (sharp > 0.999).mean() > 0.01 and (soft > 0.999).mean() == 0
    assert (sharp[soft > 1e-3] > 1e-3).all()


SHADE = {"coverage": 1.0, "optical_depth": 0.8}


def test_high_clouds_shade(renderer, rng):
    """A layer without thickness: where a slanted ray meets it, its optical depth straight up over
    the sine of the ray's height there.
    """
    params = high_params(SHADE, **{"sun.elevation": 30.0})
    points = rng.uniform(-20_000, 20_000, (200, 3)) * [1, 1, 0] + [0, 0, 10]
    radius, altitude = params.atmosphere.planet_radius, params.high_clouds.altitude

    def shade(points, **changes):
        points = np.vstack([[0, 0, 0.1], points])
        return -np.log(renderer().sun_transmittance(points, params.with_(**changes)))[1:]

    slanted, sun = shade(points), ref64.sun_direction(params)
    meets = points + ref64.sphere_hits(points, sun, radius, altitude)[1][:, None] * sun
    sine = ref64.normalized(ref64.from_centre(meets, radius)) @ sun
    straight = shade(meets * [1, 1, 0] + [0, 0, 10], **{"sun.elevation": 90.0})
    assert 0.05 < straight.max() <= 0.8
    np.testing.assert_allclose(slanted * sine, straight, rtol=1e-2, atol=1e-3)
    twice = shade(points, **{"high_clouds.optical_depth": 1.6})
    np.testing.assert_allclose(twice, 2 * slanted, rtol=1e-4, atol=1e-6)
    above = points + np.array([0, 0, altitude + 100])
    assert (renderer().sun_transmittance(above, params) == 1).all()


def test_high_clouds_stay_where_they_are(renderer, rng):
    """Wherever their tiles begin: a step of the eye, a second of wind or other company change
    nothing to speak of.
    """
    drift = {"direction": 0.0, "speed": 10.0, "evolution": 0.0}
    params = high_params(SHADE | drift)
    points = rng.uniform(-60_000, 60_000, (100, 3)) * [1, 1, 0] + [0, 0, 1000]
    forward = renderer().sun_transmittance(points, params)
    backward = renderer().sun_transmittance(points[::-1], params)[::-1]
    np.testing.assert_allclose(forward, backward, atol=1e-3)

    def seen(y, time):
        camera = nubis.Camera.look_at((0, y, 100), (0, y + 1000, 500))
        return renderer(32, 18).render_layers(camera, params, time=time)["transmittance"]

    still = seen(-0.5, 0.0)
    assert still.std() > 0.01
    np.testing.assert_allclose(seen(0.5, 0.0), still, atol=5e-3)
    period = params.high_clouds.scale / 10
    np.testing.assert_allclose(seen(0, period + 0.1), seen(0, period - 0.1), atol=5e-3)


# --- Light ------------------------------------------------------------------------------------

SIZE = 32, 18


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("elevation", [20.0, 40.0, 75.0])
@pytest.mark.parametrize("down", [False, True], ids=["from below", "from above"])
def test_single_scattering_in_the_layer(renderer, elevation, down):
    """L / E = albedo p int exp(-t) exp(-t_sun) dt through a plate as thick as the transmittance
    says, lit from above: the light has crossed what is in front of a scattering for an eye above,
    and what is behind it for one below.
    """
    values = {"coverage": 1.0, "optical_depth": 4.0, "scale": 14e3, "type": 1.0}
    params = high_params(values, **{"sun.elevation": elevation, "light.model": "single"})
    camera = straight((0, 0, 16_000 if down else 10), down)
    layers = renderer(*SIZE).render_layers(camera, params)
    _, cosine, sun = layer_hits(camera, SIZE, params)
    along = -np.log(layers["transmittance"].astype(np.float64))
    toward = along * np.abs(cosine) / sun
    share = (np.arange(2000) + 0.5) / 2000
    t = along[..., None] * share
    crossed = toward[..., None] * (share if down else 1 - share)
    integral = (np.exp(-t - crossed) * along[..., None] / 2000).sum(axis=-1)
    directions = ref64.pixel_directions(camera, *SIZE)
    mu, g = directions @ ref64.sun_direction(params), params.light.g
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * mu) ** 1.5)
    expected = params.light.albedo * phase * integral * params.sun.irradiance[0]
    assert along.max() > 2 and expected.std() > 0.02 * expected.mean()
    np.testing.assert_allclose(layers["radiance"][..., 0], expected, rtol=3e-3)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("model", ["thesis2018", "nubis2015", "vsu2022", "octaves"])
def test_overcast_is_grey_and_dark(renderer, model):
    """The thicker, the darker from below and the brighter from above; as bright as the sky that it
    hides at most, when it is thick.
    """

    def seen(depth, down=False):
        values = {"coverage": 1.0, "optical_depth": depth, "altitude": 3000.0, "type": 0.5}
        params = nubis.Params().with_(
            **{"clouds.coverage": 0.0, "light.model": model, "sun.elevation": 45.0},
            **{f"high_clouds.{name}": value for name, value in values.items()},
        )
        camera = straight((0, 0, 8000 if down else 10), down)
        return renderer(*SIZE).render(camera, params)[..., :3].mean(axis=(0, 1))

    below = [seen(d) for d in (3.0, 10.0, 30.0, 100.0)]
    assert all((b < a).all() for a, b in pairwise(below)), below
    assert below[-1].mean() < 0.35 * below[0].mean()
    above = [seen(d, down=True) for d in (3.0, 100.0)]
    assert above[1].mean() > above[0].mean() and above[1].mean() > 1.5 * below[-1].mean()
    clear = seen(1e-6)
    # Greyer than the sky.
    assert below[1][2] / below[1][0] < 0.8 * clear[2] / clear[0]


def direct_light(renderer, elevation, azimuth=0.0, pitch=80.0, **others):
    """Direct light of the layer in a narrow view from the ground, with the sun in the north."""
    params = high_params(
        {"coverage": 1.0, "optical_depth": 3.0, "altitude": 6000.0},
        **{"sun.elevation": elevation, "sun.azimuth": 0.0, "light.model": "single"} | others,
    )
    eye, ahead = np.array([0, 0, 10.0]), ref64.compass(azimuth, pitch)
    camera = nubis.Camera.look_at(tuple(eye), tuple(eye + 1000 * ahead), (0, 0, 1), 5.0)
    return renderer(*SIZE).render_layers(camera, params)["radiance"].mean(axis=(0, 1))


def test_the_underside_is_lit_after_sunset(renderer):
    """The horizon of 6 km dips by 2.49 degrees: until then the sun shines on the layer, from below
    once it is under 0, so that what is thick is brighter than before. Later it does not.
    """
    with_air = {"atmosphere.enabled": True, "atmosphere.aerial_perspective": 0.0}
    up, under, set_ = (direct_light(renderer, e, pitch=89.0) for e in (6.0, -2.0, -3.2))
    assert under.min() > 3 * up.max() and (set_ == 0).all()
    warm = direct_light(renderer, -1.0, pitch=89.0, **with_air)
    assert warm[0] > 2 * warm[1] > 2 * warm[2] > 0


def test_the_sun_sets_first_in_the_east(renderer):
    """With the sun 2.6 degrees under the horizon, the layer toward it is still lit and that behind
    is not: 100 km of it are 0.9 degrees.
    """
    toward, behind = (direct_light(renderer, -2.6, azimuth, pitch=4.0) for azimuth in (0, 180))
    assert toward.min() > 0 and (behind == 0).all()


def test_light_changes_without_a_jump(renderer):
    """Where the sun crosses the plane of the layer, and where its height at each place stops to
    count: steps of 0.02 degrees change as much as their neighbours.
    """
    with_air = {"atmosphere.enabled": True, "atmosphere.aerial_perspective": 0.0}
    for middle, pitch in ((0.0, 89.0), (20.0, 4.0)):
        elevations = middle + 0.02 * np.arange(-5, 6)
        views = [direct_light(renderer, e, pitch=pitch, **with_air)[2] for e in elevations]
        steps = np.diff(np.log(views))
        assert np.abs(steps).max() < 0.1
        assert np.abs(np.diff(steps)).max() < 2e-3, steps


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("down", [False, True], ids=["from below", "from above"])
@pytest.mark.parametrize("kind", [0.0, 1.0])
def test_emboss(renderer, down, kind):
    """Brighter where the layer is thicker than a fiftieth of a tile nearer to the sun, by up to
    0.9, half of that at a step of 0.15 of the thickness; the rest of the light stays.
    """
    values = {"coverage": 0.7, "optical_depth": 3.0, "texture_size": 128, "type": kind}
    params = high_params(
        values, **{"sun.elevation": 30.0, "sun.azimuth": 70.0, "light.model": "single"}
    )
    camera = straight((500, 700, 16_000 if down else 10), down, 60.0)
    plain, embossed = (
        renderer(*SIZE).render_layers(camera, params.with_(**{"high_clouds.emboss": e}))
        for e in (0.0, 0.6)
    )
    np.testing.assert_array_equal(plain["transmittance"], embossed["transmittance"])
    at, *_ = layer_hits(camera, SIZE, params)
    places = ref64.on_chart(at.reshape(-1, 3), params.atmosphere.planet_radius)
    thick, relief = ref64_noise.high_clouds(places, params, 0.0)
    expected = 1 + 0.6 * 0.9 * relief / (np.abs(relief) + 0.15)
    seen = thick > 0.02
    ratio = (embossed["radiance"] / np.maximum(plain["radiance"], 1e-9))[..., 0].ravel()
    assert seen.mean() > 0.5 and expected[seen].std() > 0.05
    np.testing.assert_allclose(ratio[seen], expected[seen], atol=0.02)


def test_the_emboss_turns_with_the_sun(renderer):
    """What the sun in the east makes bright, one in the west makes dark, and one straight above
    leaves as it is; with the sun gone nothing is embossed.
    """

    def seen(emboss, **sun):
        values = {"emboss": emboss, "octaves": 1, "coverage": 0.7, "stretch": 1.0}
        params = high_params(values, **{"light.model": "single"}, **sun)
        return renderer(*SIZE).render(straight((0, 0, 10), fov=90.0), params)[..., 0]

    sides = []
    for azimuth in (90.0, -90.0):
        low = {"sun.azimuth": azimuth, "sun.elevation": 25.0}
        plain = seen(0.0, **low)
        lit = plain > 0.01
        sides.append(seen(1.0, **low) / np.maximum(plain, 1e-9))
    likeness = np.corrcoef(sides[0][lit], sides[1][lit])[0, 1]
    assert likeness < -0.8 and sides[0][lit].std() > 0.05
    for height in (90.0, -60.0):
        flat, embossed = (seen(e, **{"sun.elevation": height}) for e in (0.0, 1.0))
        assert np.isfinite(embossed).all()
        np.testing.assert_allclose(embossed, flat, rtol=1e-5)


def test_the_last_light_is_embossed(renderer):
    """From 12 km one sees the layer at 8.5 km 3.5 + 3.0 degrees around the planet, where it sees
    the sun until that is 3.0 degrees lower still. Until then nothing may be compiled out.
    """

    def seen(emboss, elevation):
        values = {"coverage": 0.6, "optical_depth": 3.0, "emboss": emboss}
        sun = {"sun.elevation": elevation, "sun.azimuth": 0.0, "light.model": "single"}
        eye = np.array([0, 0, 12_000.0])
        ahead = tuple(eye + 1000 * ref64.compass(0.0, -3.2))
        camera = nubis.Camera.look_at(tuple(eye), ahead, fov_y=1.0)
        return renderer(*SIZE).render(camera, high_params(values, **sun))[..., 0]

    flat, embossed = seen(0.0, -8.5), seen(1.0, -8.5)
    assert flat.max() > 0 and np.abs(embossed - flat).max() > 0.01 * flat.max()
    assert (seen(1.0, -10.0) == 0).all()


# --- Before and behind ------------------------------------------------------------------------


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("altitude", [800.0, 2000.0, 6000.0], ids=["below", "inside", "above"])
@pytest.mark.parametrize(
    ("height", "pitch"), [(200.0, 25.0), (5000.0, -30.0), (12_000.0, -30.0), (30_000.0, -50.0)]
)
def test_order(renderer, altitude, height, pitch):
    """The clouds of a shell from 1.2 to 3.2 km and the layer, each rendered alone, put together in
    float64 by which is nearer: what is between eye and layer, behind it, or has its mean depth on
    one side of it.
    """
    values = {"altitude": altitude, "optical_depth": 3.0, "coverage": 0.6, "type": 0.7}
    # The clouds shade the ground, which lights the layer.
    dark = {"atmosphere.ground_albedo": (0.0, 0.0, 0.0)}
    params = high_params(values, **{"clouds.coverage": 0.6, "sun.elevation": 50.0} | dark)
    # By `multiple` the clouds shade the layer below them.
    params = params.with_(**{"light.model": "octaves"})
    eye = np.array([0, 0, height])
    # From between the two rays meet both where they pass just over the ground.
    pitch, fov = (-1.9, 1.0) if 3200 < height < altitude else (pitch, 30.0)
    ahead = eye + 1000 * ref64.compass(20, pitch)
    camera = nubis.Camera.look_at(tuple(eye), tuple(ahead), fov_y=fov)
    make = renderer(*SIZE)
    both, clouds, layer = (
        {k: np.nan_to_num(v, posinf=1e9) for k, v in make.render_layers(camera, sky).items()}
        for sky in (
            params,
            params.with_(**{"high_clouds.coverage": 0.0}),
            params.with_(**{"clouds.coverage": 0.0}),
        )
    )
    through_clouds, through_layer = (v["transmittance"][..., None] for v in (clouds, layer))
    layer_first = layer["radiance"] + through_layer * clouds["radiance"]
    clouds_first = clouds["radiance"] + through_clouds * layer["radiance"]
    nearer = layer["depth"] < clouds["depth"]
    there = (through_clouds[..., 0] < 0.95) & (through_layer[..., 0] < 0.95)
    assert there.mean() > 0.1
    if altitude != 2000.0:
        between = altitude < 1200 if height < 1200 else 3200 < altitude < height
        assert (nearer[there] == between).all()
    else:
        assert nearer[there].any() and (~nearer[there]).any()
    assert not np.allclose(layer_first[there], clouds_first[there], rtol=1e-2)
    np.testing.assert_allclose(
        both["transmittance"], (through_clouds * through_layer)[..., 0], rtol=1e-5, atol=2e-6
    )
    expected = np.where(nearer[..., None], layer_first, clouds_first)
    np.testing.assert_allclose(both["radiance"], expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("height", [200.0, 5000.0, 12_000.0, 30_000.0])
def test_no_seam_at_the_horizon_of_the_layer(renderer, height):
    """A uniform overcast: radiance runs on, and no row of pixels near any horizon is left out."""
    values = {"coverage": 1.0, "altitude": 6000.0, "optical_depth": 50.0, "scale": 1e6}
    params = high_params(values, **{"sun.elevation": 50.0, "sun.azimuth": 90.0})
    radius = params.atmosphere.planet_radius
    # Where the layer ends: at its own horizon from above it, at that of the ground from below.
    limb = params.high_clouds.altitude if height > params.high_clouds.altitude else 0.0
    dip = np.degrees(np.arccos((radius + limb) / (radius + height)))
    eye = np.array([0, 0, height])
    ahead = eye + 1000 * ref64.compass(0, -dip)
    camera = nubis.Camera.look_at(tuple(eye), tuple(ahead), fov_y=4.0)
    through = renderer(4, 120).render_layers(camera, params)["transmittance"]
    seen = ref64.sphere_hits(
        camera.eye, ref64.pixel_directions(camera, 4, 120), radius, params.high_clouds.altitude
    )
    covered = np.isfinite(seen[1]) & (seen[1] > 0)
    if limb == 0.0:
        ground = ref64.sphere_hits(camera.eye, ref64.pixel_directions(camera, 4, 120), radius, 0.0)
        covered &= ~(ground[0] > 0)
    assert 40 < covered[:, 0].sum() < 80
    assert (through[covered] < 1e-3).all() and (through[~covered] == 1).all()


# --- A sky of nothing else --------------------------------------------------------------------


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", ["mackerel", "procedural_sky"])
def test_nothing_is_marched(renderer, scene):
    camera, params = nubis.scenes[scene]
    make = renderer(*SIZE)
    layers = make.render_layers(camera, params)
    assert make.timings and not {"march", "march_list", "refine", "reproject"} & set(make.timings)
    assert (layers["samples"] == 0).all()
    assert 0.02 < (layers["transmittance"] < 0.5).mean() < 0.9
    list(make.animate([(camera, params, t) for t in (0.0, 1.0)]))
    assert make.timings and not {"march", "march_list", "refine", "reproject"} & set(make.timings)


def test_animated_frames_are_stills(renderer):
    """The layer is made anew for each frame: no ghosts of what it was, where it was."""
    camera, params = nubis.scenes["procedural_sky"]
    params = params.with_(**{"high_clouds.evolution": 0.05, "high_clouds.speed": 200.0})
    make = renderer(64, 36)
    eye = np.array(camera.eye)
    shots = []
    for frame in range(6):
        moved = tuple(eye + frame * np.array([30.0, 0, 10.0]))
        ahead = tuple(np.array(moved) + 1000 * np.array(camera.forward))
        shots.append((nubis.Camera.look_at(moved, ahead, fov_y=60), params, 0.7 * frame))
    frames = [frame.copy() for frame in make.animate(shots)]
    for shot, frame in zip(shots, frames, strict=True):
        assert make.render(*shot[:2], time=shot[2]).tobytes() == frame.tobytes()
    assert all((a != b).mean() > 0.1 for a, b in itertools.pairwise(frames))


def test_clouds_appear_in_an_animation(renderer):
    """The frame after a sky without clouds to march has no history, and is a still."""
    camera, params = nubis.scenes["fair_weather"]
    clear = params.with_(**{"clouds.coverage": 0.0})
    make = renderer(64, 36)
    frames = list(make.animate([(camera, clear, 0.0), (camera, params, 0.0), (camera, clear, 0.0)]))
    for sky, frame in zip((clear, params, clear), frames, strict=True):
        assert make.render(camera, sky).tobytes() == frame.tobytes()


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("type", 1.1, "from 0 to 1"),
        ("emboss", -0.1, "from 0 to 1"),
        ("curve", "linear", "exponential"),
        ("octaves", 0, "from 1 to 8"),
    ],
)
def test_bad_values_are_named(name, value, allowed):
    with pytest.raises(nubis.ParameterError, match=allowed) as error:
        nubis.Params().with_(**{f"high_clouds.{name}": value})
    assert f"high_clouds.{name} = {value!r}".replace("'", '"') in str(error.value).replace("'", '"')
