"""The renderer at and beyond the ends of everything: properties of thousands of skies.

A few always run and some hundreds in the second tier, the same every time. `make stress` runs many
more: EXAMPLES of them, other ones for each SEED.
"""

import functools
import itertools
import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis import strategies as st

import nubis
import ref64
import strategies
from nubis import Camera, ParameterError, Params
from strategies import DRAFT
from test_params import CLASSES, IMAGES, allowed, filled, kind

EXAMPLES = int(os.environ.get("EXAMPLES", 700))
FEW = 1  # of each in the first tier: most of what one takes is to compile another kernel
SEED = os.environ.get("SEED")
RAN = {}  # examples by property, for the summary (conftest.py)


def stress(share, *arguments):
    """`given` for a share of all examples."""

    def decorate(test):
        @functools.wraps(test)
        def counted(**values):
            test(**values)
            RAN[test.__name__] = RAN.get(test.__name__, 0) + 1

        def of(examples):
            chosen = settings(
                max_examples=max(math.ceil(share * examples), 1),
                derandomize=SEED is None,
                database=None,
                deadline=None,
                print_blob=False,
                suppress_health_check=list(HealthCheck),
                # Without explaining failures, which traces every line.
                phases=[Phase.explicit, Phase.generate, Phase.target, Phase.shrink],
            )
            made = chosen(given(*arguments)(counted))
            return seed(int(SEED))(made) if SEED else made

        @pytest.mark.slow_after(1)
        @pytest.mark.parametrize("examples", [of(FEW), of(EXAMPLES)], ids=["few", "many"])
        def both(examples):
            examples()

        both.__name__, both.__doc__ = test.__name__, test.__doc__
        return both

    return decorate


# Enough for the sizes and methods of a neighbourhood; each keeps tens of megabytes.
@functools.lru_cache(16)
def renderer(size, quality):
    return nubis.Renderer(*size, quality=quality)


PUBLISHED = ("nubis2015", "thesis2018", "vsu2022")


def phase_peak(light):
    """The largest value of Henyey and Greenstein's function for either lobe; that of droplets is
    less than of the fit's forward lobe.
    """
    if light.phase != "henyey_greenstein":
        g = ref64.droplet_lobes(light.droplet_diameter)[0]
        return (1 + g) / (4 * np.pi * (1 - g) ** 2)
    return max((1 + abs(g)) / (4 * np.pi * (1 - abs(g)) ** 2) for g in (light.g, light.g_back))


def brightest(params, quality):
    """No cloud may be brighter, in black air: what the light model can make of the irradiance."""
    light, sun = params.light, np.array(params.sun.irradiance)
    peak = phase_peak(light) * sun
    if light.model == "single":
        return light.albedo * peak
    # The sky and the ground give at most four times the irradiance (Mie's forward peak is 3.6).
    tint = np.maximum(light.ambient_top, light.ambient_bottom)
    ambient = 4 * light.ambient_gain * tint * sun + np.array(light.ambient)
    if light.model in PUBLISHED:
        return 2 * light.sun_gain * peak + ambient
    # Many orders, each no brighter than the first.
    orders = light.octaves if light.model == "octaves" else quality.path_scatterings
    return orders * peak + ambient


def checked(layers, params, quality):
    """What holds for every picture."""
    radiance, transmittance, depth = (layers[n] for n in ("radiance", "transmittance", "depth"))
    for name in ("radiance", "transmittance", "sky"):
        assert np.isfinite(layers[name]).all(), name
    assert radiance.min() >= 0 and layers["sky"].min() >= 0
    assert transmittance.min() >= 0 and transmittance.max() <= 1
    assert not np.isnan(depth).any() and depth.min() > 0
    assert np.isfinite(depth[transmittance < 1]).all()
    traced = "path" in (quality.integrator, params.light.model)
    converged = traced or quality.integrator == "reference"
    if not converged:
        steps = 2 * max(quality.steps_zenith, quality.steps_horizon)
        # A full sample, a cheap one, and where it is lit one more and those toward the sun.
        assert layers["samples"].max() <= steps * (4 + quality.light_steps)
    if not params.atmosphere.enabled:
        # Rounding: five digits.
        assert (radiance <= brightest(params, quality) * (1 + 1e-5)).all()


@stress(0.44, st.data())
def test_any_picture(data):
    """Finite, in range, no brighter than what lights it, and the same twice."""
    params = data.draw(strategies.params())
    camera = data.draw(strategies.cameras(params))
    size, quality = data.draw(strategies.pictures())
    time = data.draw(strategies.times)
    make = renderer(size, quality)
    layers = make.render_layers(camera, params, time=time)
    checked(layers, params, quality)

    clouds = make.render(camera, params, time=time, background=None)
    np.testing.assert_array_equal(clouds[..., :3], layers["radiance"])
    assert clouds[..., 3].min() >= 0 and clouds[..., 3].max() <= 1
    frame = make.render(camera, params, time=time)
    assert np.isfinite(frame).all() and frame.min() >= 0
    inside = frame[..., 3] > 0
    picture = layers["radiance"] + layers["transmittance"][..., None] * layers["sky"]
    # The transmittance comes back from alpha = 1 - transmittance, which has seven digits.
    slack = 2e-7 * layers["sky"].max() + 1e-5 * picture
    assert (np.abs(frame[..., :3] - picture) <= slack)[inside].all()


@stress(0.03, st.data())
def test_the_same_bytes_after_another_sky(data):
    """Nothing of one picture is left in the next."""
    skies = [data.draw(strategies.params()) for _ in range(2)]
    cameras = [data.draw(strategies.cameras(sky)) for sky in skies]
    make = renderer((8, 6), DRAFT)
    pictures = [make.render(cameras[i], skies[i]).tobytes() for i in (0, 1, 0, 1)]
    assert pictures[:2] == pictures[2:]
    assert nubis.Renderer(8, 6, quality=DRAFT).render(cameras[1], skies[1]).tobytes() == pictures[1]


@stress(0.12, st.data())
def test_density_and_sunlight_anywhere(data):
    params = data.draw(strategies.params())
    time = data.draw(strategies.times)
    eye = data.draw(strategies.eyes(params))
    away = st.one_of(st.sampled_from([0.0, 1e-3, 1.0]), st.floats(0, 7).map(lambda e: 10**e))
    steps = [data.draw(away) * data.draw(strategies.directions(params, eye)) for _ in range(6)]
    points = np.clip(np.add(eye, [np.zeros(3), *steps]), -2e8, 2e8)
    make = renderer((1, 1), DRAFT)
    extinction = make.density(points, params, time=time)
    assert np.isfinite(extinction).all() and extinction.min() >= 0
    clouds, deck = params.clouds, params.upper_clouds
    most = max(clouds.extinction, clouds.rain_extinction, deck.extinction)
    if getattr(params, "volume", None) is not None:
        most = max(most, float(params.volume.extinction.max()))
    assert extinction.max() <= np.float32(most) * (1 + 1e-6)
    sunlight = make.sun_transmittance(points, params, time=time)
    assert np.isfinite(sunlight).all() and sunlight.min() >= 0 and sunlight.max() <= 1


@stress(
    0.02,
    st.floats(0, 5).map(lambda e: 10**e),
    st.floats(0, 360),
    st.one_of(st.floats(-89, -0.5), st.sampled_from([-90.0, -0.1])),
    strategies.numbers(1e6, 1e9),
)
def test_no_sun_through_the_ground(distance, azimuth, elevation, radius):
    """On the surface, wherever it is, at night."""
    params = Params().with_(
        **{"sun.elevation": elevation, "sun.azimuth": 30.0, "atmosphere.planet_radius": radius}
    )
    # The first point says where the others are measured from.
    there = distance * ref64.compass(azimuth)[None]
    assume(math.degrees(distance / radius) < -elevation - 0.01)
    points = np.concatenate([[[0.0, 0, 0]], ref64.raised(there, radius, 0.0)])
    sunlight = renderer((1, 1), DRAFT).sun_transmittance(points, params)
    np.testing.assert_array_equal(sunlight, 0)


@stress(0.04, st.data(), st.integers(-3, 3), st.integers(0, 8))
def test_the_wind_comes_round(data, turns, exponent):
    """After a time in which it has crossed whole tiles of everything: the same bytes, bit for bit.

    Powers of two, so that no product is rounded before it is wrapped.
    """
    period = 2.0 ** data.draw(st.integers(9, 15))
    speed = 2.0 ** data.draw(st.integers(-4, 9)) * data.draw(st.sampled_from([1, -1]))
    drift = {"wind.speed": speed, "wind.detail_speed": speed, "wind.weather_speed": -speed}
    drift["wind.detail_direction"] = 180.0
    params = Params().with_(
        **drift,
        **{
            "wind.direction": data.draw(st.sampled_from([0.0, 360.0])),
            "wind.weather_direction": 0.0,
            "wind.updraft": data.draw(st.sampled_from([0.0, 1.0, -2.0, 0.125])),
            "weather.extent": 4 * period,
            "weather.broad_extent": 4 * period,
            "clouds.shape_scale": period,
            "clouds.detail_scale": period / 16,
            "clouds.curl_scale": period / 4,
            "clouds.coverage": 0.7,
            "high_clouds.coverage": 0.0,
        },
    )
    time = data.draw(st.integers(-50, 50)) * 0.5
    # The slowest of all winds has crossed the largest of all tiles.
    later = time + turns * 2.0**exponent * 4 * period * 16
    camera = look_up_at_clouds()
    make = renderer((8, 6), DRAFT)
    first, second = (make.render(camera, params, time=t) for t in (time, later))
    assert first.tobytes() == second.tobytes()
    points = np.array([[0, 0, 1500], [256, -128, 1800], [1024, 512, 2000]])
    first, second = (make.density(points, params, time=t) for t in (time, later))
    assert first.tobytes() == second.tobytes()


def look_up_at_clouds():
    return strategies.look((0, 0, 256), ref64.compass(20, 25))


# Fields in which a sky may not change continuously: they count whole cells of a tile.
WHOLE_CELLS = {("weather", "extent"), ("weather", "scale"), ("high_clouds", "stretch")}
SMOOTH_FIELDS = [f for f in strategies.FLOATS if f not in WHOLE_CELLS]
STEADY = {
    # The disc's edge is as sharp as a pixel.
    "sun.visible": False,
}


def changed_pixels(before, after, whole=None):
    """The share of pixels that change by more than 2 % of themselves or of a tenth of the mean: of
    the picture before or after, or of the `whole` one, whichever is brighter.
    """
    pictures = [v for v in (before, after, whole) if v is not None]
    before, after, *_ = pictures = [np.asarray(v, dtype=np.float64)[..., :3] for v in pictures]
    brightest = np.maximum.reduce(pictures)
    scale = brightest + 0.1 * brightest.mean()
    return (np.abs(after - before) > 0.02 * scale).any(axis=-1).mean()


def nudged(value, low, high):
    """A millionth more, or less at the upper end."""
    step = 1e-6 * (abs(value) or min(high - low, 1.0))
    return value + step if value + step <= high else value - step


@stress(0.22, st.data())
def test_a_little_change_changes_little(data):
    """A millionth of a parameter, a millimetre, a tenth of a microradian, a microsecond (in it the
    fastest wind blows a millimetre): five pixels in six stay within 2 %.

    Not all: a row of them may be on the horizon, and a step of the march may fall on the other side
    of a cloud's edge. Without jitter, which is noise. And only where such changes are small:

    - g to 0.999: at 0.9999 the forward peak itself changes by 3 % with a millionth of g;
    - shells and grids of 100 m at least that lean by at most ten times their thickness: in one that
      leans by 20 km a metre, a millimetre moves 20 m; the upper deck likewise, and not made a
      hundred times smaller;
    - twists of at most a tenth of their size: where 100 m of twist change every 10 m, a millimetre
      moves 60 mm of detail;
    - planets to 10 000 km: around one of a million kilometres a level ray that turns by a
      microradian meets the high clouds 1 km farther;
    - a second deck that is there before: with it rays take other steps, up to its top, and the
      light of those of `draft` is another by up to 15 %;
    - an eye 10 cm at least from where something begins.
    """
    params = data.draw(strategies.params(**STEADY))
    if params.volume is not None:
        assume(np.subtract(*params.volume.bounds[::-1]).min() >= 100)
    light, clouds = params.light, params.clouds
    thickness = np.clip(clouds.top - clouds.base, 100.0, 10_000.0)
    base = min(clouds.base, 25_000 - 2 * thickness)
    lean = min(abs(params.wind.shear), 10 * thickness)
    params = params.with_(
        **{
            "light.g": min(max(light.g, -0.999), 0.999),
            "light.g_back": min(max(light.g_back, -0.999), 0.999),
            "clouds.top": base + thickness,
            "clouds.base": base,
            "upper_clouds.base": base + thickness,
            "upper_clouds.top": base + 2 * thickness,
            "upper_clouds.scale": max(params.upper_clouds.scale, 0.3),
            "upper_clouds.shear": math.copysign(
                min(abs(params.upper_clouds.shear), 10 * thickness), params.upper_clouds.shear
            ),
            "atmosphere.planet_radius": min(params.atmosphere.planet_radius, 1e7),
            "clouds.curl": min(clouds.curl, 0.1 * clouds.curl_scale),
            "wind.shear": math.copysign(lean, params.wind.shear),
        }
    )
    # Near enough to the clouds and to the origin of space and time that a millionth of the way is
    # small.
    eye = data.draw(strategies.eyes(params, arcs=(0.0, 1.0, 1e3), highest=strategies.AIR_TOP))
    time = data.draw(st.floats(-100, 100))
    direction = data.draw(strategies.directions(params, eye))
    fov = data.draw(st.sampled_from([0.1, 5.0, 60.0, 120.0]))
    quality = DRAFT.replace(jitter=False)
    make = renderer((8, 6), quality)
    camera = strategies.look(eye, direction, fov)
    before, whole = make.render(camera, params, time=time), None

    which = data.draw(st.sampled_from(["parameter", "parameter", "eye", "direction", "time"]))
    if which == "eye":
        up = np.add(eye, [0, 0, params.atmosphere.planet_radius])
        altitude = np.linalg.norm(up) - params.atmosphere.planet_radius
        assume(np.abs(np.subtract(strategies.shells(params), altitude)).min() >= 0.1)
        eye = np.array(eye) + 1e-3 * data.draw(strategies.directions(params, eye))
    elif which == "direction":
        off = np.cross(direction, data.draw(strategies.directions(params, eye)))
        direction = ref64.normalized(direction + 1e-7 * off)
    elif which == "time":
        time += 1e-6
    else:
        group, name = data.draw(st.sampled_from(SMOOTH_FIELDS))
        which, value = f"{group}.{name}", getattr(getattr(params, group), name)
        low, high = allowed(group, name)[1]
        assume((which, value) != ("upper_clouds.coverage", 0))
        try:
            if value == 0:
                # Any light is infinitely more than none: a millionth is compared with the whole.
                one = params.with_(**{which: min(high, 1.0)})
                whole = make.render(camera, one, time=time)
            params = params.with_(**{which: nudged(value, low, high)})
        except ParameterError:
            assume(False)  # the thinnest shell has no room for a thinner one
    after = make.render(strategies.look(eye, direction, fov, camera.up), params, time=time)
    assert changed_pixels(before, after, whole) <= 0.17, which


@stress(0.06, st.data())
def test_a_climb_has_no_jumps(data):
    """From the ground to 20 km in steps of a centimetre, through clouds and high clouds.

    Where no edge is, a centimetre of the densest cloud changes 0.2 %, one of bright high clouds
    before a dark sky 0.3 %. One row in six may be on the horizon, which is as sharp as a pixel.
    """
    params = Params().with_(
        **STEADY,
        **{
            "clouds.coverage": data.draw(st.sampled_from([0.3, 0.6, 1.0])),
            "high_clouds.coverage": data.draw(st.sampled_from([0.0, 0.6, 1.0])),
            "sun.elevation": data.draw(st.sampled_from([-3.0, 2.0, 40.0])),
        },
    )
    shell = st.builds(
        sum, st.tuples(st.sampled_from(strategies.shells(params)[:4]), st.floats(-1, 1))
    )
    height = data.draw(st.one_of(st.floats(0, 20_000), shell))
    assume(height >= 0)
    direction = ref64.compass(20, data.draw(st.sampled_from([-90, -10, -1, 0, 1, 10, 90])))
    make = renderer((8, 6), DRAFT.replace(jitter=False))
    frames = [
        make.render(strategies.look((0, 0, height + 0.01 * i), direction), params) for i in range(4)
    ]
    for before, after in itertools.pairwise(frames):
        assert changed_pixels(before, after) <= 0.17, height


@stress(0.07, st.data())
def test_any_animation(data):
    """Cuts, standing still, jumps of the eye, of time and of parameters: always finite, and what
    stands still in the end becomes the still.
    """
    size = data.draw(st.sampled_from([(1, 1), (5, 3), (8, 6), (1, 9), (17, 2)]))
    # Without contrast: the frames of an animation become the still in which every pixel is marched.
    balanced = nubis.quality("balanced").replace(path_samples=2, adaptive_threshold=0.0)
    make = renderer(size, data.draw(st.sampled_from([DRAFT, balanced])))
    background = data.draw(st.sampled_from(["sky", None]))
    params = data.draw(strategies.params())
    time = data.draw(strategies.times)
    eye = data.draw(strategies.eyes(params))
    camera = data.draw(strategies.cameras(params))
    shots = [(camera, params, time)]
    for _ in range(data.draw(st.integers(1, 6))):
        move = data.draw(
            st.sampled_from(["stay", "time", "jump", "fly", "turn", "sky", "parameter"])
        )
        if move == "time":
            time += data.draw(st.sampled_from([1 / 24, -1 / 24, 299.0, 1e5]))
        elif move == "jump":
            camera = data.draw(strategies.cameras(params))
        elif move == "fly":
            eye = np.array(camera.eye) + data.draw(st.sampled_from([0.1, 30.0, 1999.0])) * np.array(
                data.draw(strategies.directions(params, eye))
            )
            eye = np.clip(eye, -strategies.FARTHEST, strategies.FARTHEST)
            camera = moved(camera, eye)
        elif move == "turn" and camera.kind == "perspective":
            off = np.cross(camera.forward, data.draw(strategies.directions(params, camera.eye)))
            direction = np.array(camera.forward) + data.draw(st.sampled_from([1e-6, 0.1])) * off
            camera = strategies.look(camera.eye, ref64.normalized(direction), camera.fov)
        elif move == "sky":
            params = data.draw(strategies.params())
        elif move == "parameter":
            group, name = data.draw(st.sampled_from(strategies.FLOATS))
            try:
                value = data.draw(strategies.field(group, name))
                params = params.with_(**{f"{group}.{name}": value})
            except ParameterError:
                pass  # a top under its base
        shots.append((camera, params, time))
    still = make.render(camera, params, time=time, background=background)
    # Sixteen more, after the frame in which it came to a stop.
    for frame in make.animate(shots + shots[-1:] * 16, background=background):
        assert np.isfinite(frame).all() and frame.min() >= 0
        assert frame[..., 3].max() <= 1
    # In the middle of the planet no direction is up, and rounding differs by five digits.
    middle = np.linalg.norm(np.add(camera.eye, [0, 0, params.atmosphere.planet_radius])) < 1
    # A static shot goes on tracing paths.
    traced = params.light.model == "path"
    assert middle or traced or frame.tobytes() == still.tobytes()


def moved(camera, eye):
    """The same camera elsewhere."""
    if camera.kind == "equirect":
        return Camera.equirect(eye)
    if camera.kind == "fisheye":
        return Camera.fisheye(eye, camera.forward, camera.fov)
    matrix = np.array(camera.matrix())
    matrix[:3, 3] = eye
    return Camera.from_matrix(matrix, camera.fov)


class Hostile:
    """What no call may choke on."""

    def __repr__(self):
        return "Hostile()"

    def _refuse(self):
        raise RuntimeError("hostile")

    __float__ = __index__ = __iter__ = __len__ = _refuse


NOT_NUMBERS = [
    *(None, True, "1", "\ud800", b"1", 1j, [], {}, (1.0,), [[1.0]], object(), Hostile(), Params()),
    *(float("nan"), float("inf"), -float("inf"), 10**400, -(10**400), np.float32("nan")),
    *(np.array("x"), np.zeros(2), np.zeros((0, 3)), np.datetime64("2020-01-01"), np.array([None])),
]
wrong = st.sampled_from(NOT_NUMBERS)
GOOD = {
    "camera": look_up_at_clouds(),
    "params": Params(),
    "time": 0.0,
    "width": 2,
    "height": 2,
    "quality": "draft",
    "background": "sky",
    "eye": (0.0, 0.0, 2.0),
    "target": (0.0, 100.0, 2.0),
    "up": (0.0, 0.0, 1.0),
    "fov": 60.0,
    "matrix": look_up_at_clouds().matrix(),
    "convention": "opengl",
    "points": [[0.0, 0.0, 2.0]],
    "shots": [],
    "tonemap": "agx",
    "exposure": 0.0,
    "frame": np.zeros((1, 1, 3), dtype=np.float32),
}


def small():
    return renderer((2, 2), DRAFT)


def shot(v):
    return list(
        small().animate([(v["camera"], v["params"], v["time"])], background=v["background"])
    )


CALLS = {
    shot: ("camera", "params", "time", "background"),
    lambda v: small().render(
        v["camera"], v["params"], time=v["time"], background=v["background"]
    ): ("camera", "params", "time", "background"),
    lambda v: small().render_layers(v["camera"], v["params"], time=v["time"]): (
        *("camera", "params", "time"),
    ),
    lambda v: small().density(v["points"], v["params"], time=v["time"]): (
        *("points", "params", "time"),
    ),
    lambda v: small().sun_transmittance(v["points"], v["params"], time=v["time"]): (
        *("points", "params", "time"),
    ),
    lambda v: list(small().animate(v["shots"])): ("shots",),
    lambda v: list(small().animate([v["shots"]])): ("shots",),
    lambda v: nubis.Renderer(v["width"], v["height"], quality=v["quality"]): (
        *("width", "height", "quality"),
    ),
    lambda v: Camera.look_at(v["eye"], v["target"], v["up"], v["fov"]): (
        *("eye", "target", "up", "fov"),
    ),
    lambda v: Camera.equirect(v["eye"]): ("eye",),
    lambda v: Camera.fisheye(v["eye"], v["up"], v["fov"]): ("eye", "up", "fov"),
    lambda v: Camera.from_matrix(v["matrix"], v["fov"], v["convention"]): (
        *("matrix", "fov", "convention"),
    ),
    lambda v: nubis.to_srgb8(v["frame"], v["exposure"], v["tonemap"]): ("exposure", "tonemap"),
    lambda v: nubis.quality(v["quality"]): ("quality",),
}
# What the list above holds that is right for an argument.
RIGHT = {
    "background": [None],
    "up": [None],
    "convention": [None],
    "fov": [None],
    "params": [Params],
    "shots": [[], {}, np.zeros((0, 3))],
    "points": [np.zeros((0, 3))],
}


def is_right(argument, value):
    return any(
        isinstance(value, right) if isinstance(right, type) else _same(value, right)
        for right in RIGHT.get(argument, [])
    )


def _same(a, b):
    return type(a) is type(b) and np.array_equal(a, b)


def test_the_calls_are_right():
    """What is refused below is refused for its one wrong argument."""
    for call in CALLS:
        if call is not list(CALLS)[6]:
            call(GOOD)


@pytest.mark.parametrize("call", CALLS, ids=["-".join(names) for names in CALLS.values()])
def test_wrong_arguments(call):
    """ParameterError and nothing else, before anything is done on the GPU."""
    for argument in CALLS[call]:
        for value in NOT_NUMBERS:
            if not is_right(argument, value):
                before = small().timings
                with pytest.raises(ParameterError):
                    call(GOOD | {argument: value})
                assert small().timings == before


@stress(
    0.03,
    st.sampled_from([(g, n) for g, cls in CLASSES.items() for n in cls.__dataclass_fields__]),
    st.data(),
)
def test_wrong_values_of_parameters(field, data):
    """Beyond the ends, and what is no number at all; in one component of several too."""
    group, name = field
    hint = kind(group, name)
    value = data.draw(wrong)
    if hint in (int, float) or filled(hint, 0) != 0:
        low, high = allowed(group, name)[1]
        beyond = st.one_of(
            st.floats(high, exclude_min=True), st.floats(max_value=low, exclude_max=True)
        )
        value = data.draw(st.one_of(st.just(value), beyond))
        if filled(hint, 0) != 0 and data.draw(st.booleans()):
            value = (low, high, value)
    elif (hint is bool and value is True) or ((group, name) in IMAGES and value is None):
        return
    with pytest.raises(ParameterError):
        CLASSES[group](**{name: value})


# What the properties above have found, at its simplest.


BLACK_AIR = {"atmosphere.enabled": False, "high_clouds.coverage": 0.0}
FULL = {"weather.map": np.full((1, 1, 3), [1.0, 0.5, 0.0]), "clouds.coverage": 1.0}


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.0), (0.0, 0.0, -10_000.0)])
def test_an_invisible_cloud_stays_where_it_is(eye):
    """Its light is known, its opacity rounds to none: the history lost its distance, and from the
    middle of a planet, where nothing has an altitude, drew NaN.
    """
    low = np.add(eye, [-5000, 300, -5000])
    grid = nubis.DensityGrid(np.full((2, 2, 2), 1e-12, np.float32), (low, low + 10_000))
    changes = {"atmosphere.planet_radius": 10_000.0, "light.model": "single"}
    params = Params().with_(**changes).replace(volume=grid)
    camera, make = strategies.look(eye, ref64.compass(30, 40)), renderer((8, 6), DRAFT)
    layers = make.render_layers(camera, params)
    assert (layers["radiance"] > 0).any()
    still = make.render(camera, params)
    *_, last = make.animate([(camera, params, 0.0)] * 17)
    assert np.isfinite(still).all() and last.tobytes() == still.tobytes()


def test_a_path_that_is_cut_saw_the_background():
    """Through 20 km of nothing in steps of a centimetre, because the densest cloud is beside it:
    more turns than a path may have.
    """
    extinction = np.zeros((1, 8, 8), np.float32)
    extinction[0, 7, 7] = 1e8
    grid = nubis.DensityGrid(extinction, ((0, 0, 0), (20_000, 20_000, 1000)))
    params = Params().with_(**BLACK_AIR, **{"light.model": "path"}).replace(volume=grid)
    camera = strategies.look((1000, -10, 500), (0, 1, 0), 1.0)
    layers = renderer((1, 1), DRAFT).render_layers(camera, params)
    assert layers["samples"].min() > 1_000_000
    np.testing.assert_array_equal(layers["transmittance"], 1)
    assert layers["depth"].min() == np.inf


def test_a_sun_of_any_strength():
    """The sky was kept in half floats, which end at 65,504. The light of the night is not the
    sun's, so it is off.
    """
    camera, make = look_up_at_clouds(), renderer((8, 6), DRAFT)
    dark = {"atmosphere.night": (0.0, 0.0, 0.0)}
    pictures = [
        make.render(camera, Params().with_(**{"sun.irradiance": (e, e, e)}, **dark)) / e
        for e in (1e-6, 1.0, 1e6)
    ]
    for picture in pictures:
        np.testing.assert_allclose(picture[..., :3], pictures[1][..., :3], rtol=1e-5)


def test_the_thinnest_clouds():
    """Brightness and opacity fall with the extinction, and the depth stays, until opacity is too
    small for f32 to tell from 0. Products of transmittances lost both.
    """
    params = Params().with_(**BLACK_AIR, **FULL, **{"light.model": "single"})
    make = renderer((8, 6), DRAFT)
    layers = {
        e: make.render_layers(look_up_at_clouds(), params.with_(**{"clouds.extinction": e}))
        for e in (1e-7, 1e-8, 3e-10, 1e-14)
    }
    thick = layers[1e-7]
    for extinction, thin in layers.items():
        share = extinction / 1e-7
        np.testing.assert_allclose(thin["radiance"] / share, thick["radiance"], rtol=2e-3)
        opacity, expected = (1 - v["transmittance"] for v in (thin, thick))
        np.testing.assert_allclose(opacity, share * expected, rtol=2e-3, atol=1.5e-7)
        known = opacity > 0
        np.testing.assert_allclose(thin["depth"][known], thick["depth"][known], rtol=1e-3)
    assert (1 - layers[3e-10]["transmittance"]).max() > 0


def test_the_ground_does_not_vanish_under_it():
    camera = [strategies.look((0, 0, z), ref64.compass(20, -20)) for z in (0.001, 0, -0.001, -100)]
    clear = Params().with_(**{"clouds.coverage": 0.0, "high_clouds.coverage": 0.0})
    frames = [renderer((8, 6), DRAFT).render(c, clear) for c in camera]
    for frame in frames[1:]:
        np.testing.assert_allclose(frame, frames[0], rtol=0.05)


def test_a_narrow_static_shot_becomes_the_still():
    """Its pixels are as small as the rounding of their directions."""
    camera = strategies.look((0, 0, 1), ref64.compass(20, 40), 0.001)
    make = renderer((8, 6), DRAFT)
    *_, last = make.animate([(camera, Params(), 0.0)] * 17)
    assert last.tobytes() == make.render(camera, Params()).tobytes()


@pytest.mark.parametrize("updates", [0, 65536])
def test_high_clouds_evolve_without_a_jump(updates):
    """Where the time changes its sign, and where the numbers of the updates come round."""
    params = Params().with_(**{"clouds.coverage": 0.0, "high_clouds.evolution": 0.25})
    time, make = updates / 0.25, renderer((8, 6), DRAFT)
    # They evolve in steps of a 512th of the smallest octave's life, here 0.5 ms.
    frames = [make.render(look_up_at_clouds(), params, time=t) for t in (time - 4e-4, time + 4e-4)]
    assert (frames[0] != frames[1]).any()
    np.testing.assert_allclose(*frames, rtol=4e-3)


def test_a_full_turn_is_none():
    """A wind that blows by 2e-16 of its way across has gone far after thirty years."""
    points = np.array([[x, 0, 1600.0] for x in range(0, 5000, 50)])
    skies = [
        Params().with_(**FULL, **{"wind.direction": d, "wind.speed": 1000.0}) for d in (0.0, 360.0)
    ]
    first, second = (renderer((1, 1), DRAFT).density(points, s, time=1e9) for s in skies)
    assert first.max() > 0
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("size", [1e-300, 1e-161, 1e161, 1e300])
def test_directions_of_any_length(size):
    """Squares of these lengths are no f64."""
    up = (size, 0.0, size)
    camera = Camera.fisheye((0, 0, 0), up)
    np.testing.assert_allclose(camera.forward, np.array([1, 0, 1]) / math.sqrt(2), rtol=1e-15)
    if size < 1:
        camera = Camera.look_at((0, 0, 0), up, (0, 1, 0))
        np.testing.assert_allclose(camera.forward, np.array([1, 0, 1]) / math.sqrt(2), rtol=1e-15)


def test_the_largest_method_runs_to_its_end():
    """As many iterations as a method may have: lavapipe stops at 65,535 without a word."""
    params = Params().with_(**BLACK_AIR, **FULL, **{"light.model": "single"})
    params = params.with_(**{"clouds.extinction": 1e-4})
    camera = strategies.look((0, 0, 256), ref64.compass(20, 25), 5.0)
    pictures = []
    for steps, light in ((512, 2), (4000, 2), (1800, 8)):
        quality = ref64.fine(steps, light, step_growth=1.0)
        pictures.append(renderer((8, 1), quality).render_layers(camera, params))
        assert pictures[-1]["samples"].min() > steps
    for picture in pictures[1:]:
        np.testing.assert_allclose(
            picture["transmittance"], pictures[0]["transmittance"], atol=2e-3
        )
        np.testing.assert_allclose(picture["radiance"], pictures[0]["radiance"], rtol=0.02)
