"""From one number to a cloud of one's own: what each level sets, and what overrides what."""

import dataclasses
import re

import numpy as np
import pytest

import nubis
from nubis import DensityGrid, ParameterError, Params
from nubis.__main__ import main

NAMES = ["clear", "few", "scattered", "broken", "overcast"]
TYPES = ["stratus", "stratocumulus", "cumulus", "storm", "cirrus"]
MAP = np.random.default_rng(1).uniform(0, 1, (4, 5, 3)).astype(np.float32)
GRID = DensityGrid(np.full((2, 2, 2), 0.01), ((-500, 2000, 1000), (500, 3000, 2000)))


def changed(before, after):
    """Names of the deep fields that differ."""
    names = set()
    for group in dataclasses.fields(Params):
        old, new = getattr(before, group.name), getattr(after, group.name)
        if not (dataclasses.is_dataclass(old) and dataclasses.is_dataclass(new)):
            names |= {group.name} if old != new else set()
            continue
        for field in dataclasses.fields(old):
            if not np.array_equal(getattr(old, field.name), getattr(new, field.name)):
                names.add(f"{group.name}.{field.name}")
    return names


def test_presets():
    assert set(NAMES + TYPES) <= set(nubis.presets)
    assert all(isinstance(params, Params) for params in nubis.presets.values())
    assert len(set(nubis.presets.values())) == len(nubis.presets)
    with pytest.raises(TypeError):
        nubis.presets["clear"] = Params()
    for params in nubis.presets.values():
        # What the time of day, the wind and the chance of a seed are, is nothing of a preset.
        assert {name.split(".")[0] for name in changed(Params(), params)} <= {
            "clouds",
            "upper_clouds",
            "high_clouds",
        }


def test_nothing_said_is_the_default():
    assert nubis.sky() == Params()


def test_what_each_level_sets():
    assert changed(Params(), nubis.sky(0.7)) == {"clouds.coverage"}
    assert nubis.sky(0.7).clouds.coverage == 0.7
    for name, params in nubis.presets.items():
        assert nubis.sky(preset=name) == params
        assert changed(params, nubis.sky(0.123, preset=name)) == {"clouds.coverage"}
    mapped = nubis.sky(map=MAP)
    assert changed(Params(), mapped) == {
        "weather.map",
        "clouds.coverage",
        "clouds.type",
        "clouds.precipitation",
    }
    assert (mapped.clouds.coverage, mapped.clouds.type, mapped.clouds.precipitation) == (
        0.5,
        0.5,
        1,
    )
    np.testing.assert_array_equal(mapped.weather.map, MAP)
    assert changed(Params(), nubis.sky(volume=GRID)) == {"volume"}
    assert nubis.sky(volume=GRID).volume == GRID


def test_each_overrides_the_one_before():
    storm = nubis.presets["storm"]
    both = nubis.sky(0.9, preset="storm")
    assert both.clouds == storm.clouds.replace(coverage=0.9)
    # A map overrides the number and what the preset says of the same.
    assert nubis.sky(0.9, preset="storm", map=MAP) == nubis.sky(preset="storm", map=MAP)
    assert nubis.sky(preset="storm", map=MAP).clouds.top == storm.clouds.top
    # A grid leaves what is not cloud.
    every = nubis.sky(0.9, preset="storm", map=MAP, volume=GRID)
    assert changed(nubis.sky(preset="storm", map=MAP), every) == {"volume"}


def test_fields_override_all():
    fields = {"clouds.coverage": 0.2, "clouds.top": 7000.0, "wind.speed": 3}
    for levels in ({}, {"preset": "storm"}, {"map": MAP}, {"volume": GRID}):
        sky = nubis.sky(0.9, **levels, **fields)
        assert (sky.clouds.coverage, sky.clouds.top, sky.wind.speed) == (0.2, 7000, 3)
        assert sky == nubis.sky(0.9, **levels).with_(**fields)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"cover": 1.5}, "cover = 1.5"),
        ({"cover": float("nan")}, "cover = "),
        ({"cover": "much"}, "cover = "),
        ({"preset": "fog"}, "preset = 'fog'"),
        ({"preset": 3}, "preset = 3"),
        ({"preset": ["storm"]}, "preset = "),
        ({"map": np.zeros((3, 4))}, "weather.map = "),
        ({"volume": MAP}, "volume = "),
        ({"wind": 3}, "wind = 3"),
        ({"wind.sped": 3}, "wind.sped = 3"),
    ],
)
def test_what_is_not_allowed(arguments, named):
    with pytest.raises(ParameterError, match="is not allowed: ") as error:
        nubis.sky(**arguments)
    assert str(error.value).startswith(named)
    if named.startswith("preset"):
        known = str(error.value).split("one of")[1].split(";")[0]
        assert re.findall(r"\w+", known) == list(nubis.presets)


def all_sky_cover(make, params):
    """The share of the sky that clouds hide, from a fisheye, without the last degrees."""
    camera = nubis.Camera.fisheye((0, 0, 0), fov=160)
    alpha = make.render(camera, params, background=None)[..., 3]
    y, x = np.mgrid[: alpha.shape[0], : alpha.shape[1]] + 0.5
    inside = np.hypot(x - alpha.shape[1] / 2, y - alpha.shape[0] / 2) < alpha.shape[0] / 2
    return float(alpha[inside].mean())


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("preset", [None, "stratus", "cumulus", "storm"])
def test_more_cover_is_more_cloud_in_the_picture(renderer, preset):
    """From clear to nearly all of the sky, and never less."""
    make = renderer(48, 48)
    covers = [0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0]
    fields = {"high_clouds.coverage": 0.0}
    seen = [all_sky_cover(make, nubis.sky(c, preset=preset, **fields)) for c in covers]
    assert seen[0] == 0
    assert (np.diff(seen) >= 0).all() and (np.diff(seen)[2:-2] > 0.02).any()
    assert seen[-1] > 0.95


def test_cover_of_a_map_is_cover_in_the_picture(renderer):
    """A map of one value everywhere hides the more of the sky the larger the value is, as much as
    the number does whose map has that mean.
    """
    make = renderer(48, 48)
    seen = []
    for value in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        sky = nubis.sky(map=np.full((1, 1, 3), [value, 0.7, 0.0]))
        seen.append(all_sky_cover(make, sky.with_(**{"high_clouds.coverage": 0.0})))
    assert seen[0] == 0 and seen[-1] > 0.95
    assert (np.diff(seen) >= 0).all() and len(set(seen)) >= 4


def test_presets_hide_as_much_of_the_sky_as_their_names_say(renderer):
    """In eighths of the sky, as observers count them (WMO): few 1 to 2, scattered 3 to 4, broken
    5 to 7, overcast 8; half an eighth more or less is allowed for a camera that stands anywhere.
    """
    make = renderer(64, 64)

    def eighths(name):
        sky = nubis.sky(preset=name, **{"high_clouds.coverage": 0.0})
        return 8 * all_sky_cover(make, sky)

    ranges = {"clear": (0, 0), "few": (1, 2), "scattered": (3, 4), "broken": (5, 7)}
    ranges |= {"overcast": (8, 8), "stratus": (8, 8), "cirrus": (0, 1)}
    for name, (least, most) in ranges.items():
        assert least - 0.5 <= eighths(name) <= most + 0.5, name
    levels = [eighths(name) for name in NAMES]
    assert levels == sorted(levels)


@pytest.mark.slow
def test_command_line(tmp_path, capsys):
    """A preset in place of a scene's clouds, under its sun; a cover on top; unknown names."""
    assert main(["presets"]) == 0
    assert capsys.readouterr().out.split() == list(nubis.presets)

    def rendered(*options):
        path = tmp_path / "sky.npy"
        arguments = ["render", "sunset", "--size", "16x9", "--out", str(path), *options]
        assert main(arguments) == 0, capsys.readouterr().err
        return np.load(path)

    camera, params = nubis.scenes["sunset"]
    storm = nubis.presets["storm"].replace(sun=params.sun)
    make = nubis.Renderer(16, 9)
    np.testing.assert_array_equal(rendered("--preset", "storm"), make.render(camera, storm))
    less = storm.with_(**{"clouds.coverage": 0.3})
    both = rendered("--preset", "storm", "--cover", "0.3")
    np.testing.assert_array_equal(both, make.render(camera, less))
    few = params.with_(**{"clouds.coverage": 0.3})
    np.testing.assert_array_equal(rendered("--cover", "0.3"), make.render(camera, few))
    capsys.readouterr()
    assert main(["render", "sunset", "--preset", "fog", "--out", str(tmp_path)]) == 2
    assert "must be one of clear, few" in capsys.readouterr().err
