"""Pictures that must not change unnoticed, compared on the kind of driver that made them.

After a change that is meant: ``UPDATE=1 pytest tests/test_goldens.py``, look, commit.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import nubis

GOLDENS = Path(__file__).parent / "goldens"
FAILURES = Path(__file__).parent / "failures"
BLESS = "UPDATE=1 pytest tests/test_goldens.py"
SIZE = 96, 54
CAP = 64 * 1024
SCENES = ["fair_weather", "sunset", "above"]

# A pixel may differ by this much: rounding to float16, and what another version of a driver rounds
# otherwise.
RELATIVE, ABSOLUTE = 0.02, 0.002
# So many may differ by more: where rounding turns one step of a ray into another.
OUTLIERS = 5
# Of float16; the sun's disc is brighter.
BRIGHTEST = 60_000.0


def driver(adapter):
    """The kind of driver: software and each maker's hardware round in ways of their own."""
    return adapter.name.split()[0]


def compare(actual, golden):
    """How many pixels differ, and the difference of each as a multiple of what is allowed."""
    excess = np.abs(actual - golden) / (ABSOLUTE + RELATIVE * np.abs(golden))
    excess = np.nan_to_num(excess, nan=np.inf).max(axis=2)
    return int((excess > 1).sum()), excess


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("scene", SCENES)
def test_golden(renderer, scene):
    make = renderer(*SIZE, "balanced")
    actual = make.render(*nubis.scenes[scene])[..., :3].clip(max=BRIGHTEST)
    picture, made_on = GOLDENS / f"{scene}.npz", GOLDENS / f"{scene}.json"
    if os.environ.get("UPDATE"):
        GOLDENS.mkdir(exist_ok=True)
        np.savez_compressed(picture, image=actual.astype(np.float16))
        about = {"adapter": make.adapter.name, "driver": make.adapter.driver}
        made_on.write_text(json.dumps(about, indent=2) + "\n")
    if not (picture.exists() and made_on.exists()):
        pytest.fail(f"there is no golden for {scene}: {BLESS}")
    about = json.loads(made_on.read_text())
    if about["adapter"].split()[0] != driver(make.adapter):
        pytest.skip(f"made on {about['adapter']}, this is {make.adapter.name}")
    golden = np.load(picture)["image"].astype(np.float32)
    count, excess = compare(actual, golden)
    if count > OUTLIERS:
        FAILURES.mkdir(exist_ok=True)
        nubis.save(FAILURES / f"{scene}_actual.png", actual)
        nubis.save(FAILURES / f"{scene}_golden.png", golden)
        difference = np.repeat(np.minimum(excess, 10)[..., None] / 10, 3, axis=2)
        nubis.save(FAILURES / f"{scene}_difference.png", difference, tonemap="none")
        pytest.fail(
            f"{count} of {excess.size} pixels differ, the most by {excess.max():.1f} times what is "
            f"allowed (golden: {about['driver']}, this: {make.adapter.driver}): see {FAILURES}; "
            f"if it is meant: {BLESS}"
        )


def test_the_comparator_compares():
    golden = np.full((4, 5, 3), 0.5, dtype=np.float32)
    assert compare(golden, golden)[0] == 0
    assert compare(golden * 1.01, golden)[0] == 0
    assert compare(golden * 1.05, golden)[0] == 20
    for value in (0.6, np.nan, np.inf):
        one = golden.copy()
        one[1, 2, 0] = value
        assert compare(one, golden)[0] == 1


def test_no_orphans():
    names = {f"{scene}{ending}" for scene in SCENES for ending in (".npz", ".json")}
    assert {path.name for path in GOLDENS.glob("*")} <= names


def test_goldens_are_small():
    for path in GOLDENS.glob("*"):
        assert path.stat().st_size <= CAP, path.name
        if path.suffix == ".npz":
            image = np.load(path)["image"]
            assert image.dtype == np.float16 and image.shape == (*SIZE[::-1], 3)
            assert np.isfinite(image).all()
