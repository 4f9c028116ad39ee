"""Parameters: values that are checked when they are made, compare and hash as wholes, and survive
files.
"""

import copy
import dataclasses
import functools
import math
import pickle
import re
import shutil
import typing

import numpy as np
import pytest

import nubis
import nubis.params
from nubis import ParameterError, Params, Quality

GROUPS = {
    f.name: type(getattr(Params(), f.name))
    for f in dataclasses.fields(Params)
    if getattr(Params(), f.name)
}
CLASSES = {**GROUPS, "quality": Quality}
FIELDS = [
    (group, field.name) for group, cls in CLASSES.items() for field in dataclasses.fields(cls)
]
NAN, INF = float("nan"), float("inf")


@functools.cache
def allowed(group, name):
    """What the documentation of a field says is allowed: its words, and the range that they name
    if they do.
    """
    doc = " ".join(CLASSES[group].__doc__.split())
    words = re.search(rf" {name} : .*? Allowed: (.*?)\.(?: \w+ : |$)", doc)[1]
    numbers = re.search(r"from (-?[\d.]+) to (-?[\d.]+)", words)
    return words, tuple(float(n) for n in numbers.groups()) if numbers else None


def each(fields):
    """Runs a test for each of some fields."""
    fields = list(fields)
    return pytest.mark.parametrize(("group", "name"), fields, ids=[".".join(f) for f in fields])


@functools.cache
def kind(group, name):
    return typing.get_type_hints(CLASSES[group])[name]


def make(group, name, value):
    return CLASSES[group](**{name: value})


def refused(group, name, value):
    with pytest.raises(ParameterError) as error:
        make(group, name, value)
    message = str(error.value)
    assert message.startswith(f"{group}.{name} = ")
    assert message.endswith(f"is not allowed: it must be {allowed(group, name)[0]}")
    return message


def filled(hint, value):
    """The value in the shape of a field: as it is, or once for each component."""
    return (
        tuple(value for _ in typing.get_args(hint)) if typing.get_origin(hint) is tuple else value
    )


NUMERIC = [f for f in FIELDS if kind(*f) in (int, float) or typing.get_origin(kind(*f)) is tuple]


def test_every_field_is_documented():
    assert len(FIELDS) > 50
    for group, name in FIELDS:
        assert allowed(group, name)[0]


@each(NUMERIC)
def test_range(group, name):
    """Both ends are allowed; the next number beyond either is not, and the error says so."""
    hint, (low, high) = kind(group, name), allowed(group, name)[1]
    if hint is int:
        inside, outside = (int(low), int(high)), (int(low) - 1, int(high) + 1)
    else:
        inside, outside = (
            (low, high),
            (math.nextafter(low, -INF), math.nextafter(high, INF), low - 1, high + 1e3),
        )
    for value in inside:
        try:
            assert getattr(make(group, name, filled(hint, value)), name) == pytest.approx(
                filled(hint, value), rel=1e-6
            )
        except ParameterError as error:
            # What no single field can say is about two of them.
            assert str(error).startswith("quality.") and "times" in str(error)
    for value in outside:
        message = refused(group, name, filled(hint, value))
    assert float(re.search(r" = \(?(-?[\d.]+)", message)[1]) == value


@each(NUMERIC)
def test_what_is_no_number(group, name):
    hint = kind(group, name)
    for value in (NAN, INF, -INF, "1", None, [1.0], object(), 1j, np.array(NAN)):
        refused(group, name, filled(hint, value))
    refused(group, name, True)
    if hint is int:
        refused(group, name, 1.5)
        refused(group, name, 2**70)
    elif hint is not float:
        (low, _), n = allowed(group, name)[1], len(typing.get_args(hint))
        for value in (low, (low,) * (n - 1), (low,) * (n + 1), (low,) * (n - 1) + (NAN,)):
            refused(group, name, value)


@each(f for f in FIELDS if kind(*f) is bool)
def test_switches(group, name):
    assert getattr(make(group, name, False), name) is False
    assert getattr(make(group, name, True), name) is True
    for value in (1, 0.0, "yes", None):
        refused(group, name, value)


@each(f for f in FIELDS if typing.get_origin(kind(*f)) is typing.Literal)
def test_choices(group, name):
    for word in typing.get_args(kind(group, name)):
        assert getattr(make(group, name, word), name) == word
    for value in ("no such word", "", 0, None):
        refused(group, name, value)


def test_numpy_numbers_are_numbers():
    params = Params().with_(
        **{
            "clouds.coverage": np.float32(0.25),
            "clouds.seed": np.uint32(7),
            "sun.irradiance": np.array([1, 2, 3]),
            "sun.visible": np.bool_(False),
        }
    )
    assert params.clouds.coverage == 0.25 and params.clouds.seed == 7
    assert params.sun.irradiance == (1.0, 2.0, 3.0) and params.sun.visible is False


def test_floats_keep_their_digits():
    """They are 32-bit numbers inside, and 0.45 stays 0.45."""
    assert Params().with_(**{"clouds.coverage": 0.45}).clouds.coverage == 0.45


MAP = np.linspace(0, 1, 2 * 3 * 3).reshape(2, 3, 3)
#: The parameters that are images: of three channels, or of one.
IMAGES = {
    ("weather", "map"): MAP,
    ("weather", "broad_map"): MAP,
    ("clouds", "profile"): MAP[..., 0],
}


def test_a_map_is_a_copy():
    given = MAP.copy()
    weather = nubis.Weather(map=given)
    given[:] = 0
    assert weather.map.dtype == np.float32
    np.testing.assert_array_equal(weather.map, MAP.astype(np.float32))


@pytest.mark.parametrize(
    "clone", [lambda v: v, copy.copy, copy.deepcopy, lambda v: pickle.loads(pickle.dumps(v))]
)
def test_a_map_is_read_only(clone):
    """Else a hash would change under a key."""
    weather = clone(nubis.Weather(map=MAP))
    with pytest.raises(ValueError, match="read-only"):
        weather.map[0, 0, 0] = 1


@pytest.mark.parametrize(
    "bad",
    [
        MAP[0],
        MAP[..., :2],
        MAP[:0],
        MAP + 0.5,
        MAP - 0.5,
        np.where(MAP > 0.5, NAN, MAP),
        MAP.astype(str),
        MAP.astype(complex),
        "map.png",
        1.0,
        np.zeros((1, 8193, 3)),
    ],
    ids=[
        "flat",
        "two channels",
        "empty",
        "above 1",
        "below 0",
        "NaN",
        "text",
        "complex",
        "path",
        "number",
        "too wide",
    ],
)
def test_maps_that_are_none(bad):
    refused("weather", "map", bad)
    if not isinstance(bad, np.ndarray):
        refused("clouds", "profile", bad)
    elif bad.shape[2:] == (3,):
        refused("clouds", "profile", bad[..., 0])


def test_images_have_their_channels():
    for (group, name), image in IMAGES.items():
        np.testing.assert_array_equal(getattr(make(group, name, image), name), np.float32(image))
    refused("clouds", "profile", MAP)
    refused("weather", "broad_map", MAP[..., 0])


@pytest.mark.parametrize(
    "edges", [(0.2, 0.1, 0.3, 0.4), (0.0, 0.5, 0.4, 1.0), (0.0, 0.1, 0.9, 0.8)]
)
@pytest.mark.parametrize("name", ["stratus", "stratocumulus", "cumulus", "cumulonimbus"])
def test_profiles_rise_before_they_fall(name, edges):
    with pytest.raises(nubis.ParameterError, match=rf"^clouds\.{name} = .*rising order"):
        Params().with_(**{f"clouds.{name}": edges})


def test_decks_that_do_not_stand_above_one_another():
    with pytest.raises(nubis.ParameterError, match=r"^upper_clouds\.top = 4000 .*4800 m"):
        Params().with_(**{"upper_clouds.top": 4000.0})
    below = {"upper_clouds.base": 3000.0, "upper_clouds.top": 4000.0}
    Params().with_(**below)
    with pytest.raises(nubis.ParameterError, match=r"^upper_clouds\.base = 3000 .*3200 m"):
        Params().with_(**below, **{"upper_clouds.coverage": 0.1})


def test_frozen_and_keyword_only():
    params = Params()
    for owner, name in (
        (params, "sun"),
        (params.sun, "elevation"),
        (nubis.quality("draft"), "jitter"),
    ):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(owner, name, getattr(owner, name))
    for cls in (*CLASSES.values(), Params):
        with pytest.raises(TypeError):
            cls(1.0)


@each(FIELDS)
def test_equality_sees_every_field(group, name):
    """And so do hash and repr."""
    hint, default = kind(group, name), getattr(CLASSES[group](), name)
    if typing.get_origin(hint) is typing.Literal:
        other = next(word for word in typing.get_args(hint) if word != default)
    elif hint is bool:
        other = not default
    elif (group, name) in IMAGES:
        other = IMAGES[group, name]
    else:
        low, high = allowed(group, name)[1]
        # Near the default, so that no pair of fields is at odds.
        first = default[0] if isinstance(default, tuple) else default
        near = first + (1 if hint is int else 1e-3)
        value = near if near <= high else first - (1 if hint is int else 1e-3)
        assert low <= value <= high
        other = filled(hint, value)
    plain, changed, again = (
        make(group, name, default),
        make(group, name, other),
        make(group, name, other),
    )
    assert (
        plain == CLASSES[group]()
        and hash(plain) == hash(CLASSES[group]())
        and plain is not CLASSES[group]()
    )
    assert changed == again and hash(changed) == hash(again)
    assert changed != plain and hash(changed) != hash(plain)
    assert repr(changed) != repr(plain) and f"{name}=" in repr(changed)
    if group != "quality":
        assert (
            Params(**{group: changed}) == Params().with_(**{f"{group}.{name}": other}) != Params()
        )


def test_equality_with_other_things():
    assert Params() != 1 and Params().sun != Params().clouds
    assert nubis.Weather(map=MAP) == nubis.Weather(map=MAP.astype(np.float32))
    assert nubis.Weather(map=MAP) != nubis.Weather(map=MAP.reshape(3, 2, 3))


def rich_params():
    return Params().with_(
        **{
            "weather.map": MAP,
            "weather.broad_map": MAP[::-1],
            "clouds.profile": MAP[..., 1],
            "clouds.seed": 4294967295,
            "clouds.coverage": 0.123456789,
            "clouds.extinction": 1e-7,
            "sun.irradiance": (1.5, 0.25, 1e6),
            "sun.visible": False,
            "light.model": "single",
            "sun.elevation": -7.25,
        }
    )


@pytest.mark.parametrize("params", [Params(), rich_params()], ids=["default", "rich"])
class TestCopies:
    def test_pickle(self, params):
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
            assert pickle.loads(pickle.dumps(params, protocol)) == params
        assert copy.deepcopy(params) == params == copy.copy(params)

    def test_repr(self, params):
        """It is Python that makes the same again, but for an array's digits."""
        plain = params.with_(**{f"{group}.{name}": None for group, name in IMAGES})
        assert eval(repr(plain), vars(nubis)) == plain

    def test_dict(self, params):
        values = params.to_dict()
        assert Params.from_dict(values) == params
        assert set(values) >= set(GROUPS)
        assert all(
            isinstance(v, bool | int | float | str | list | None)
            for g in GROUPS
            for v in values[g].values()
        )

    def test_toml(self, params, tmp_path):
        path = tmp_path / "sky.toml"
        params.save(path)
        assert Params.load(path) == params
        assert Params.load(str(path)) == params


def test_toml_may_leave_fields_out(tmp_path):
    path = tmp_path / "sky.toml"
    path.write_text("[clouds]\ncoverage = 1\n")
    assert Params.load(path) == Params().with_(**{"clouds.coverage": 1.0})


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[clouds]\ncoverage = 2", "clouds.coverage"),
        ("[clouds]\ncover = 1", "clouds.cover"),
        ("[cloud]\ncoverage = 1", "cloud"),
        ("[clouds]\ncoverage = nan", "clouds.coverage"),
        ("[weather]\nmap = [[[0, 0, 0], [0, 0]]]", "weather.map"),
        ("clouds = 1", "clouds"),
        ("coverage = ", "sky.toml"),
    ],
)
def test_bad_toml(tmp_path, text, named):
    path = tmp_path / "sky.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=re.escape(named)):
        Params.load(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError):
        Params.load(tmp_path / "none.toml")


def test_replace_and_with():
    params = Params()
    changed = params.with_(**{"clouds.coverage": 0.7, "clouds.base": 500.0, "sun.azimuth": 10.0})
    assert (changed.clouds.coverage, changed.clouds.base, changed.sun.azimuth) == (0.7, 500.0, 10.0)
    assert changed.wind == params.wind and params == Params()
    assert params.replace(clouds=changed.clouds, sun=changed.sun) == changed
    assert params.with_() == params
    assert changed.clouds.replace(coverage=0.1).coverage == 0.1


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda p: p.with_(**{"clouds.cover": 1.0}), "clouds.cover"),
        (lambda p: p.with_(**{"cloud.coverage": 1.0}), "cloud.coverage"),
        (lambda p: p.with_(coverage=1.0), "coverage"),
        (lambda p: p.with_(**{"clouds.": 1.0}), "clouds."),
        (lambda p: p.with_(**{"clouds.coverage": 2.0}), "clouds.coverage"),
        (lambda p: p.replace(cloud=p.clouds), "cloud"),
        (lambda p: p.replace(clouds=p.sun), "clouds"),
        (lambda p: p.clouds.replace(cover=1.0), "cover"),
        (lambda p: Params(clouds={"coverage": 1.0}), "clouds"),
        (lambda p: Params.from_dict({"clouds": {"cover": 1.0}}), "clouds.cover"),
        (lambda p: Params.from_dict({"clouds": 1.0}), "clouds"),
        (lambda p: Params.from_dict([1]), "values"),
    ],
)
def test_unknown_names_and_wrong_groups(change, named):
    with pytest.raises(ParameterError, match="is not allowed") as error:
        change(Params())
    assert named in str(error.value)


@pytest.mark.parametrize(
    ("field", "value", "why"), [("view_distance", 4e5, "horizon"), ("sun_volume", True, "balanced")]
)
def test_fields_of_older_versions(tmp_path, field, value, why):
    """What is gone is named with the reason, in calls, pickles and files."""
    named = rf"{field} = {value} is not allowed: it is gone, as .*{why}"
    with pytest.raises(ParameterError, match=rf"Quality\.{named}"):
        Quality().replace(**{field: value})
    with pytest.raises(ParameterError, match=rf"Quality\({field}=\.\.\.\) .* gone, as .*{why}"):
        Quality(**{field: value})
    old = copy.copy(Quality())
    object.__setattr__(old, field, value)
    with pytest.raises(ParameterError, match=rf"Quality\.{named}"):
        pickle.loads(pickle.dumps(old))
    path = tmp_path / "sky.toml"
    path.write_text(f"[quality]\n{field} = {str(value).lower()}\n")
    with pytest.raises(ParameterError, match=rf"quality\.{named}"):
        Params.load(path)


@pytest.mark.parametrize("top", [1000.0, 999.0])
def test_tops_are_above_bases(top):
    with pytest.raises(
        ParameterError, match=re.escape(f"clouds.top = {top:.0f} is not allowed")
    ) as error:
        Params().with_(**{"clouds.base": 1000.0, "clouds.top": top})
    assert "1000" in str(error.value).split("must be")[1]


def test_a_method_with_too_many_samples():
    """More iterations than lavapipe runs without dropping some."""
    with pytest.raises(ParameterError, match=r"quality\.light_steps"):
        nubis.Renderer(
            1, 1, quality=Quality(steps_zenith=4096, light_steps=128, light_group_weight=0.0)
        )


def test_named_methods_can_be_changed():
    draft = nubis.quality("draft")
    assert draft.replace() == draft != nubis.quality("high")
    assert Quality(**draft.to_dict()) == draft
    assert draft.replace(steps_zenith=7).steps_zenith == 7
    with pytest.raises(ParameterError, match="draft"):
        nubis.quality("no such method")


def test_files_with_a_byte_order_mark(tmp_path):
    text = "[clouds]\ncoverage = 0.25\n"
    for name, encoding in [("plain", "utf-8"), ("marked", "utf-8-sig")]:
        path = tmp_path / f"{name}.toml"
        path.write_text(text, encoding=encoding)
        assert nubis.Params.load(path).clouds.coverage == 0.25


def test_large_arrays_lie_beside_the_file(tmp_path, rng):
    def big(*shape):
        return rng.random(shape).astype(np.float32)

    weather = nubis.Weather(map=big(128, 130, 3), broad_map=big(2, 3, 3))
    params = nubis.Params(
        clouds=nubis.Clouds(profile=big(80, 90)),
        weather=weather,
        weather_mix=((weather.replace(map=big(128, 130, 3)), 0.25),),
        volume=nubis.DensityGrid(big(20, 30, 40), ((0, 0, 0), (1, 2, 3))),
    )
    path = tmp_path / "sky.toml"
    params.save(path)
    assert nubis.Params.load(path) == params
    assert path.stat().st_size < 100_000
    # Small ones can be read and changed.
    assert "broad_map = [" in path.read_text()
    beside = sorted(p.name for p in tmp_path.iterdir() if p != path)
    assert len(beside) == 4 and all(re.fullmatch(r"sky\.toml\..*\.npy", p) for p in beside)
    # Elsewhere together, and a copy that a later save of the other leaves whole.
    there = tmp_path / "there"
    shutil.copytree(tmp_path, there)
    assert nubis.Params.load(there / "sky.toml") == params
    shutil.copy(path, tmp_path / "copy.toml")
    params.with_(**{"weather.map": big(128, 130, 3)}).save(path)
    assert nubis.Params.load(tmp_path / "copy.toml") == params != nubis.Params.load(path)


def test_arrays_inside_the_file_are_still_read(tmp_path, rng):
    weather = nubis.Weather(map=rng.random((60, 60, 3)))
    params = nubis.Params(weather=weather)
    import tomli_w

    tables = params.to_dict()
    tables = {g: {k: v for k, v in f.items() if v is not None} for g, f in tables.items()}
    (tmp_path / "old.toml").write_text(tomli_w.dumps(tables))
    assert nubis.Params.load(tmp_path / "old.toml") == params


def test_arrays_that_are_not_there(tmp_path):
    path = tmp_path / "sky.toml"
    path.write_text('[weather]\nmap = "gone.npy"\n')
    with pytest.raises(nubis.FileError, match=r"weather.map = 'gone.npy'.*gone.npy"):
        nubis.Params.load(path)
    (tmp_path / "gone.npy").write_bytes(b"nothing")
    with pytest.raises(nubis.ParameterError, match=r"weather.map = 'gone.npy'"):
        nubis.Params.load(path)
