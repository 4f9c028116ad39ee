"""Skies, cameras and numerical methods for hypothesis, made from the one definition of the
parameters: every range and every word comes from the generated classes.
"""

import dataclasses
import functools
import math
import re
import typing

import numpy as np
from hypothesis import strategies as st

import nubis
import ref64
from nubis import Camera, ParameterError, Params, Quality
from test_params import CLASSES, IMAGES, allowed, filled, kind

AIR_TOP = 100_000.0  # m, where the air ends (Hillaire 2020)
FARTHEST = 2e8  # m: no eye may be farther from the origin in any coordinate


def numbers(low, high):
    """Numbers of a range: its ends and their neighbours, zero, log-uniform ones, any."""
    ends = [low, high, math.nextafter(low, high), math.nextafter(high, low), 0.0]
    most = max(abs(low), abs(high))
    size = st.floats(-8, math.log10(most)).map(lambda e: min(10**e, most))
    logarithmic = st.builds(math.copysign, size, st.sampled_from([1.0, -1.0] if low < 0 else [1.0]))
    inside = st.one_of(st.sampled_from(ends), logarithmic).map(lambda v: min(max(v, low), high))
    return st.one_of(inside, inside, st.floats(low, high))


def whole_numbers(low, high):
    few = st.integers(low, min(low + 8, high))
    return st.one_of(st.sampled_from([low, high]), few, st.integers(low, high))


# Bakes that take half a second or more: seldom anything but the default.
COSTLY = {
    # Each of Mie's functions is a second of work.
    ("light", "droplet_diameter"): st.sampled_from([5.0, 20.0, 50.0]),
    ("clouds", "seed"): st.sampled_from([1] * 60 + [0, 4294967295]),
    ("clouds", "noise"): st.sampled_from(["nubis2015"] * 60 + ["vsu2022"]),
    ("high_clouds", "texture_size"): st.sampled_from([16, 17, 64, 512] * 15 + [4096]),
}


@st.composite
def images(draw, channels):
    """All empty, all full, one texel, steps, noise."""
    size = draw(st.sampled_from([(1, 1), (1, 2), (2, 1), (3, 5), (8, 8)]))
    values = st.sampled_from([0.0, 1.0, 0.5, 1e-7, math.nextafter(1, 0)])
    if draw(st.booleans()):
        image = np.full((*size, 3), draw(st.tuples(values, values, values)), dtype=np.float32)
    else:
        steps = draw(st.lists(values, min_size=3 * math.prod(size), max_size=3 * math.prod(size)))
        image = np.array(steps, dtype=np.float32).reshape(*size, 3)
    return image if channels == 3 else image[..., 0]


# Made once: making strategies takes longer than rendering their examples.
@functools.cache
def field(group, name):
    """All values of a parameter."""
    hint = kind(group, name)
    if (group, name) in COSTLY:
        return COSTLY[group, name]
    if typing.get_origin(hint) is typing.Literal:
        return st.sampled_from(typing.get_args(hint))
    if hint is bool:
        return st.booleans()
    if (group, name) in IMAGES:
        return st.one_of(st.none(), images(3 if IMAGES[group, name].ndim == 3 else 1))
    low, high = allowed(group, name)[1]
    if hint is int:
        return whole_numbers(int(low), int(high))
    one = numbers(low, high)
    if hint is float:
        return one
    count = len(typing.get_args(hint))
    return st.one_of(one.map(lambda v: filled(hint, v)), st.tuples(*[one] * count))


FIELDS = [
    (group, f.name)
    for group, cls in CLASSES.items()
    if group != "quality"
    for f in dataclasses.fields(cls)
]
FLOATS = [f for f in FIELDS if kind(*f) is float]


@st.composite
def grids(draw):
    """Grids of extinction: empty, full, one voxel, as thin as can be."""
    shape = draw(st.sampled_from([(1, 1, 1), (2, 3, 4), (1, 8, 8), (8, 1, 1), (5, 5, 5)]))
    peak = 10.0 ** draw(st.integers(-8, 8))
    extinction = np.full(shape, draw(st.sampled_from([0.0, peak])), dtype=np.float32)
    extinction[tuple(draw(st.integers(0, n - 1)) for n in shape)] = peak
    low = [draw(st.sampled_from([-1e4, -100.0, 0.0, 1000.0])) for _ in range(3)]
    size = [draw(st.sampled_from([0.01, 1.0, 100.0, 2e4])) for _ in range(3)]
    return nubis.DensityGrid(
        extinction, (tuple(low), tuple(a + b for a, b in zip(low, size, strict=True)))
    )


@st.composite
def mixtures(draw, sky):
    """Up to three other weathers for a sky, some of no weight and some of all."""
    same = {n: getattr(sky.weather, n) for n in ("extent", "edge", "broad_extent")}
    weathers = st.one_of(
        images(3).map(lambda map: nubis.Weather(map=map, **same)),
        st.integers(0, 2).map(lambda seed: nubis.Weather(seed=seed, **same)),
        st.just(sky.weather),
    )
    left, mix = 1.0, []
    for weather in draw(st.lists(weathers, max_size=3)):
        weight = left * draw(st.sampled_from([0.0, 1e-7, 0.3, 0.5, 1.0]))
        left -= weight
        mix.append((weather, weight))
    return tuple(mix)


@st.composite
def params(draw, fields=tuple(FIELDS), **fixed):
    """A few parameters away from their defaults, or all of them."""
    few = st.lists(st.sampled_from(fields), unique=True, max_size=10)
    changed = draw(st.one_of(few, few, st.just(list(fields))))
    # A small texture of high clouds, where none is drawn: it is baked for most skies anew.
    values = {"high_clouds.texture_size": 64}
    values |= {f"{g}.{n}": draw(field(g, n)) for g, n in changed} | fixed
    base, top = (values.get(f"clouds.{n}", getattr(Params().clouds, n)) for n in ("base", "top"))
    if np.float32(top) <= np.float32(base):
        # The thinnest shell that f32 knows, or one of a metre.
        thin = float(np.nextafter(np.float32(base), np.float32(np.inf)))
        values["clouds.base"] = base
        values["clouds.top"] = draw(st.sampled_from([max(thin, 1.0), base + 1.0]))
    for name in ("stratus", "stratocumulus", "cumulus", "cumulonimbus"):
        if f"clouds.{name}" in values:
            values[f"clouds.{name}"] = tuple(sorted(values[f"clouds.{name}"]))
    deck = Params().upper_clouds
    base, top = (values.get(f"upper_clouds.{n}", getattr(deck, n)) for n in ("base", "top"))
    lower = values.get("clouds.top", Params().clouds.top)
    if values.get("upper_clouds.coverage", 0.0) > 0 and base < lower:
        values["upper_clouds.base"] = base = lower
    if np.float32(top) <= np.float32(base):
        values["upper_clouds.base"] = base = min(base, 24_999.0)
        values["upper_clouds.top"] = base + 1.0
        if base < lower:
            values["upper_clouds.coverage"] = 0.0
    sky = Params().with_(**values)
    if draw(st.integers(0, 5)) == 0:
        sky = sky.replace(weather_mix=draw(mixtures(sky)))
    if hasattr(nubis, "DensityGrid") and draw(st.integers(0, 3)) == 0:
        sky = sky.replace(volume=draw(grids()))
    return sky


def shells(sky):
    """Altitudes where something begins or ends."""
    clouds, deck = sky.clouds, sky.upper_clouds
    volumetric = [clouds.base, clouds.top, clouds.cumulonimbus_top, deck.base, deck.top]
    return [0.0, *volumetric, sky.high_clouds.altitude, AIR_TOP]


@st.composite
def eyes(draw, sky, arcs=(0.0, 0.0, 1.0, 1e4, 3e5, 1e7), highest=1e8):
    """From 100 m under the ground to 100 000 km, often a centimetre from a shell."""
    shell = st.sampled_from(shells(sky))
    altitude = draw(
        st.one_of(
            st.builds(sum, st.tuples(shell, st.sampled_from([-0.01, 0.0, 0.01]))),
            st.floats(0, 8).map(lambda e: 10**e),
            st.sampled_from([-100.0, -0.01, 0.0, 2.0, 200.0, 4e5, 3.6e7, 1e8]),
        )
    )
    altitude = min(altitude, highest)
    radius = sky.atmosphere.planet_radius
    angle = draw(st.sampled_from(arcs)) / radius
    heading = ref64.compass(draw(st.sampled_from([0.0, 45.0, 200.0])))
    zenith = math.sin(angle) * heading + np.array([0, 0, math.cos(angle)])
    # The distance to sea level under the origin, without the difference of two large numbers.
    eye = zenith * altitude + radius * (zenith - [0, 0, 1])
    return tuple(np.clip(eye, -FARTHEST, FARTHEST).tolist())


@st.composite
def directions(draw, sky, eye):
    """Up, down, level, tangent to a shell, to, from and across the sun, and any."""
    radius = sky.atmosphere.planet_radius
    up = np.add(eye, [0, 0, radius])
    distance = np.linalg.norm(up)
    up = up / distance if distance > 0 else np.array([0.0, 0, 1])
    sun = ref64.sun_direction(sky)
    across = np.add(np.cross(sun, [0, 0, 1]), [1e-9, 0, 0])
    special = [sun, -sun, across, np.cross(sun, across), up, -up]
    dips = [-math.acos(min((radius + h) / distance, 1)) for h in shells(sky) if distance > 0]
    elevation = st.one_of(
        st.sampled_from([0.0, *dips]), st.floats(-math.pi / 2, math.pi / 2), numbers(-0.01, 0.01)
    )

    @st.composite
    def slanted(draw):
        heading = ref64.compass(draw(st.floats(0, 360)))
        level = heading - heading @ up * up
        level = ref64.normalized(level) if np.linalg.norm(level) > 1e-3 else np.cross(up, [0, 1, 0])
        e = draw(elevation)
        return math.cos(e) * level + math.sin(e) * up

    return ref64.normalized(draw(st.one_of(st.sampled_from(special), slanted(), slanted())))


def look(eye, direction, fov=60.0, up=None):
    """A pinhole that looks along any direction, straight up included."""
    up = np.eye(3)[np.argmin(np.abs(direction))] if up is None else up
    return Camera.look_at(eye, np.array(eye) + 1e6 * np.array(direction), up, fov)


def middle_is_in_reach(sky):
    """Whether an eye may be in the middle of the planet, where no direction is up."""
    return sky.atmosphere.planet_radius <= FARTHEST


@st.composite
def cameras(draw, sky):
    middle = st.just((0.0, 0.0, -sky.atmosphere.planet_radius))
    near = eyes(sky)
    eye = draw(st.one_of(near, near, near, middle) if middle_is_in_reach(sky) else near)
    projection = draw(st.sampled_from(["perspective", "perspective", "equirect", "fisheye"]))
    if projection == "equirect":
        return Camera.equirect(eye)
    direction = draw(directions(sky, eye))
    if projection == "fisheye":
        return Camera.fisheye(eye, direction, draw(numbers(0.001, 360)))
    return look(eye, direction, draw(st.one_of(numbers(0.001, 179), st.just(60.0))))


times = st.one_of(
    st.just(0.0),
    st.sampled_from([86_400.0, 30 * 86_400.0, 1e9, -1e9, 1e-9, -1.0, 1.7e308]),
    numbers(-1e9, 1e9),
)


def words_of_quality():
    """The names that the package knows, from the error that lists them."""
    try:
        nubis.quality("no such method")
    except ParameterError as error:
        return re.findall(r'"(\w+)"', str(error).split("must be")[1])


NAMES = words_of_quality()
# Numerical methods that march for long: for pictures of a few pixels.
SLOW = [name for name in ("reference", "vsu2022", "high") if name in NAMES]
FEW = {"steps_zenith": 32, "steps_horizon": 64, "light_steps": 6}


# Each picture has a sky of its own, whose light field would take most of the time.
FIELD = {"field_cells": 16, "field_cell": 400.0}
# Paths are dear: two, and not for long.
#: Every pixel is marched: a static shot becomes the still.
DRAFT = nubis.quality("draft").replace(
    adaptive_threshold=0.0, path_samples=2, path_scatterings=64, **FIELD
)


@st.composite
def qualities(draw):
    """A named method, or any with few samples."""
    named = draw(st.sampled_from([None, None, "draft", "draft", *NAMES]))
    if named:
        method, slow = nubis.quality(named).replace(**FIELD), named in SLOW
    else:
        values = {}
        for f in dataclasses.fields(Quality):
            if kind("quality", f.name) is int and f.name not in (
                "coarse_step",
                "empty_before_coarse",
            ):
                low = int(allowed("quality", f.name)[1][0])
                values[f.name] = draw(st.integers(low, FEW.get(f.name, low + 1)))
            else:
                values[f.name] = draw(field("quality", f.name))
        # Paths have a light model of their own: skies ask for them by its alias.
        values["integrator"] = draw(st.sampled_from(["march", "march", "reference"]))
        values["tolerance"] = draw(st.sampled_from([1e-3, 0.1, 1.0]))
        method, slow = Quality(**values), values["integrator"] == "reference"
    scatterings = draw(st.sampled_from([1, 2, 64, 4096]))
    return method.replace(path_samples=2, path_scatterings=scatterings), slow


@st.composite
def pictures(draw):
    """A size and a numerical method."""
    method, slow = draw(qualities())
    sizes = [(1, 1), (2, 3), (4, 4)]
    if not slow:
        sizes += [(8, 6), (5, 7), (13, 3), (1, 33), (8, 6), (5, 7), (13, 3)]
    if method.replace(path_scatterings=64) == DRAFT:
        sizes += [(1, 4096), (4096, 1)]
    return draw(st.sampled_from(sizes)), method
