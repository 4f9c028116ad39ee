"""Errors about names say what there is, and what may have been meant."""

import pytest

import nubis
from nubis import ParameterError
from nubis.__main__ import main


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda: nubis.scenes["sunse"], KeyError, ["scene = 'sunse'", "'sunset'?", "overcast"]),
        (lambda: nubis.presets["Cirus"], KeyError, ["preset = 'Cirus'", "'cirrus'?", "storm"]),
        (lambda: nubis.presets[3], KeyError, ["preset = 3", "storm"]),
        (lambda: nubis.sky(preset="strom"), KeyError, ["preset = 'strom'", "'storm'?"]),
        (lambda: nubis.Clouds(coverag=0.5), TypeError, ["Clouds(coverag=", "'coverage'?"]),
        (lambda: nubis.Params(cloud=None), TypeError, ["Params(cloud=", "'clouds'?"]),
        (lambda: nubis.Quality(step=3), TypeError, ["Quality(step=", "steps_zenith"]),
        (lambda: nubis.Clouds().replace(coverag=1), ValueError, ["Clouds.coverag", "coverage"]),
        (
            lambda: nubis.Params().with_(**{"cloud.coverage": 1}),
            ValueError,
            ["cloud.coverage = 1", "clouds."],
        ),
        (
            lambda: nubis.Params().with_(**{"clouds.coverag": 1}),
            ValueError,
            ["clouds.coverag = 1", "'clouds.coverage'?"],
        ),
        (
            lambda: nubis.Params.from_dict({"sun": {"elevate": 1}}),
            ValueError,
            ["sun.elevate = 1", "'sun.elevation'?"],
        ),
        (lambda: nubis.quality("balance"), ValueError, ["quality = 'balance'", "'balanced'?"]),
        (lambda: nubis.Renderer(1, 1, quality="bogus"), ValueError, ["bogus", "draft, balanced"]),
    ],
)
def test_unknown_names(call, kind, words):
    with pytest.raises(ParameterError, match="is not allowed") as error:
        call()
    assert isinstance(error.value, kind)
    assert all(word in str(error.value) for word in words), str(error.value)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(["sunse"], "'sunset'?"), (["sunset", "--preset", "strom"], "'storm'?")],
)
def test_unknown_names_on_the_command_line(capsys, arguments, word):
    assert main(["render", *arguments]) == 2
    assert word in capsys.readouterr().err


def test_names_of_methods_are_all_there():
    from nubis._renderer import QUALITIES

    assert all(isinstance(nubis.quality(name), nubis.Quality) for name in QUALITIES)
    with pytest.raises(ParameterError) as error:
        nubis._nubis.quality("bogus")
    assert [n for n in QUALITIES if f'"{n}"' not in str(error.value)] == []
    assert str(error.value).count('"') == 2 * len(QUALITIES) + 2


def test_tables_are_mappings():
    assert "sunset" in nubis.scenes and "sunse" not in nubis.scenes and [] not in nubis.scenes
    assert nubis.presets.get("bogus") is None and dict(nubis.presets)["storm"]
    assert len(nubis.scenes) == len(list(nubis.scenes)) > 5
    with pytest.raises(TypeError):
        nubis.scenes["mine"] = nubis.scenes["sunset"]


def test_variables_of_the_environment_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv("NUBIS_ADAPTER", "no such card")
    with pytest.raises(nubis.AdapterError, match=r"NUBIS_ADAPTER = 'no such card': no adapter"):
        nubis.Renderer(1, 1)
    with pytest.raises(nubis.AdapterError) as error:
        nubis.Renderer(1, 1, adapter="nor this")
    assert "NUBIS_ADAPTER" not in str(error.value)
    monkeypatch.setenv("NUBIS_ADAPTER", "cpu")
    monkeypatch.setenv("NUBIS_SHADERS", str(tmp_path))
    # A kernel that nothing has compiled yet.
    with pytest.raises(nubis.NubisError, match=r"NUBIS_SHADERS = .*no file"):
        nubis.testing.probe("x.x * 77.125", [1.0], imports=["no_such_file"])


@pytest.mark.parametrize(
    ("old", "new", "value"),
    [
        ("contrast", "adaptive_threshold", 0.2),
        ("big_step", "coarse_step", 4),
        ("leap", "sphere_tracing", 0.1),
        ("empty_samples", "empty_before_coarse", 8),
        ("light_share", "light_group_weight", 0.05),
        ("cheap_light", "light_detail_cutoff", 0.5),
    ],
)
def test_deprecated_names_of_settings(old, new, value):
    expected = nubis.Quality(**{new: value})
    changed = pytest.warns(DeprecationWarning, match=f"'{old}' is deprecated: it is '{new}' now")
    with changed:
        assert nubis.Quality(**{old: value}) == expected
    with changed:
        assert nubis.Quality().replace(**{old: value}) == expected
    with changed:
        assert getattr(expected, old) == value
    with changed, pytest.raises(ParameterError, match=f"{old} and {new} are one field"):
        nubis.Quality(**{old: value, new: value})
    # Pickles of earlier versions.
    state = dict(expected.__dict__)
    state[old] = state.pop(new)
    copy = nubis.Quality.__new__(nubis.Quality)
    copy.__setstate__(state)
    assert copy == expected


def test_deprecated_names_of_parameters(tmp_path):
    expected = nubis.Params().with_(**{"atmosphere.light_shafts": False})
    changed = pytest.warns(DeprecationWarning, match=r"beams' is deprecated: .*light_shafts' now")
    with changed:
        assert nubis.Params().with_(**{"atmosphere.beams": False}) == expected
    path = tmp_path / "sky.toml"
    path.write_text("[atmosphere]\nbeams = false\n")
    with changed:
        assert nubis.Params.load(path) == expected
    with changed:
        assert expected.atmosphere.beams is False
    with pytest.warns(DeprecationWarning, match="WindVariation"):
        assert nubis.Wander is nubis.WindVariation
    with pytest.raises(AttributeError, match="nope"):
        _ = expected.atmosphere.nope
