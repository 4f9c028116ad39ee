"""What one process leaves on disk for the next: found, checked, and never in the way."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import nubis
from nubis.__main__ import main
from test_api import run_python

pytestmark = pytest.mark.skipif(
    nubis.Renderer(1, 1).adapter.kind != "cpu", reason="a GPU bakes sooner than it reads"
)

# Prints a checksum of the picture and which kernels ran for it.
RENDER = """
import hashlib, nubis
renderer = nubis.Renderer(48, 27, quality="draft")
camera, params = nubis.scenes["fair_weather"]
changes = {{"clouds.seed": {seed}, "clouds.fine_detail": {finer}}}
frame = renderer.render(camera, params.with_(**changes))
print(hashlib.sha256(frame.tobytes()).hexdigest(), *renderer.timings)
"""
FINER = {"finer_detail", "downsample"}
NOISE = {"shape", "detail", "curl"} | FINER


def render(folder, seed=5, finer=0.6):
    """The picture's checksum and the kernels of a first render in a process of its own."""
    done = run_python(RENDER.format(seed=seed, finer=finer), NUBIS_CACHE=str(folder))
    assert done.returncode == 0, done.stderr
    picture, *kernels = done.stdout.split()
    return picture, set(kernels)


@pytest.fixture(scope="module")
def baked():
    """The picture, without a cache."""
    picture, kernels = render("off")
    assert kernels >= NOISE | {"weather"}
    return picture


@pytest.fixture(scope="module")
def _filled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("filled") / "not" / "yet"
    assert render(folder)[1] >= NOISE | {"weather"}
    return folder


@pytest.fixture
def filled(_filled, tmp_path):
    """A folder that a process has filled, for each test to spoil."""
    return Path(shutil.copytree(_filled, tmp_path / "cache"))


def files(folder, kind):
    return sorted(folder.glob(f"nubis-cache-{kind}-*"))


def test_the_next_process_bakes_nothing_and_sees_the_same(filled, baked):
    [noise], [weather] = files(filled, "noise"), files(filled, "weather")
    before = noise.read_bytes(), weather.read_bytes()
    picture, kernels = render(filled)
    assert picture == baked and not kernels & (NOISE | {"weather"})
    assert (noise.read_bytes(), weather.read_bytes()) == before


@pytest.mark.slow
def test_another_seed_is_another_file(filled, baked):
    picture, kernels = render(filled, seed=6)
    assert picture != baked and kernels >= NOISE
    assert len(files(filled, "noise")) == 2 and len(files(filled, "weather")) == 1


def test_another_finer_detail_is_baked_alone(filled, baked):
    picture, kernels = render(filled, finer=0.25)
    assert picture != baked and "finer_detail" in kernels
    assert not kernels & (NOISE - FINER)
    assert len(files(filled, "noise")) == 1 and len(files(filled, "finer_detail")) == 2


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("damage", ["truncated", "empty", "flipped", "longer", "foreign"])
def test_damaged_files_are_made_again(filled, baked, damage):
    good = {path: path.read_bytes() for path in filled.iterdir()}
    assert len(good) >= 2
    for path, whole in good.items():
        middle = len(whole) // 2
        bad = {
            "truncated": whole[:middle],
            "empty": b"",
            "flipped": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
            "longer": whole + b"\0",
            "foreign": b"nubis 9" + whole[7:],
        }
        path.write_bytes(bad[damage])
    picture, kernels = render(filled)
    assert picture == baked and kernels >= NOISE | {"weather"}
    assert {path: path.read_bytes() for path in filled.iterdir()} == good


@pytest.mark.slow
def test_folders_in_the_place_of_files(filled, baked):
    for path in list(filled.iterdir()):
        path.unlink()
        path.mkdir()
    assert render(filled)[0] == baked


@pytest.mark.slow
def test_a_file_of_another_key_is_not_read(filled):
    """Names are short hashes: what says whose a file is stands in the file."""
    [path] = files(filled, "noise")
    good = path.read_bytes()
    picture, _ = render(filled, seed=6)
    [other] = set(files(filled, "noise")) - {path}
    other.write_bytes(good)
    again, kernels = render(filled, seed=6)
    assert again == picture and kernels >= NOISE - FINER


@pytest.mark.slow
def test_processes_at_once(tmp_path, baked):
    code = RENDER.format(seed=5, finer=0.6)
    env = os.environ | {"NUBIS_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", code]
    running = [
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    for process in running:
        out, _ = process.communicate(timeout=120)
        assert process.returncode == 0 and out.split()[0] == baked
    assert len(files(tmp_path, "noise")) == len(files(tmp_path, "weather")) == 1
    picture, kernels = render(tmp_path)
    assert picture == baked and not kernels & NOISE


@pytest.mark.slow
def test_a_folder_that_cannot_be_written(tmp_path, baked):
    """A file stands where the folder should: nobody can write there, root included."""
    (tmp_path / "file").write_text("mine")
    picture, kernels = render(tmp_path / "file" / "cache")
    assert picture == baked and kernels >= NOISE
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
def test_off_nothing_is_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    render("off")
    assert not list(tmp_path.glob("**/nubis*"))


@pytest.mark.parametrize("off", ["", "0", "off", "OFF"])
def test_how_to_say_off(off, monkeypatch, capsys):
    monkeypatch.setenv("NUBIS_CACHE", off)
    assert main(["cache", "--clear"]) == 0
    assert capsys.readouterr().out == "off (NUBIS_CACHE)\n"


def test_the_users_cache_folder(monkeypatch, capsys, tmp_path):
    monkeypatch.delenv("NUBIS_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert main(["cache"]) == 0
    assert capsys.readouterr().out.startswith(str(tmp_path))


def render_seeds(folder, seeds):
    code = f"""
import nubis
renderer = nubis.Renderer(8, 4, quality="draft")
camera, params = nubis.scenes["fair_weather"]
for seed in {seeds}:
    renderer.render(camera, params.with_(**{{"clouds.seed": seed}}))
"""
    done = run_python(code, NUBIS_CACHE=str(folder))
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_what_was_used_last_stays(filled):
    render_seeds(filled, range(100, 104))
    assert not render(filled)[1] & NOISE
    render_seeds(filled, range(110, 114))
    assert len(files(filled, "noise")) == 8
    assert not render(filled)[1] & NOISE
    assert sum(file.stat().st_size for file in filled.iterdir()) < 200e6


@pytest.mark.slow
def test_of_thousands_of_seeds_the_first_are_kept(tmp_path):
    render_seeds(tmp_path, range(9))
    assert len(files(tmp_path, "noise")) < 8
    assert not render(tmp_path, seed=0)[1] & NOISE


def test_clear_removes_what_is_ours(_filled, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("NUBIS_CACHE", str(tmp_path / "cache"))
    assert main(["cache", "--clear"]) == 0  # there is none yet
    shutil.copytree(_filled, tmp_path / "cache")
    assert main(["cache"]) == 0
    folder, size = capsys.readouterr().out.splitlines()[-1].rsplit(": ", 1)
    assert folder == str(tmp_path / "cache")
    assert np.isclose(float(size.removesuffix(" MB")), 16.4, atol=0.3)
    # One of a writer that died, and one of somebody else.
    (tmp_path / "cache" / "nubis-cache-noise-x1y2.tmp").write_bytes(b"torn")
    (tmp_path / "cache" / "nubis-thesis.tex").write_text("mine")
    assert main(["cache", "--clear"]) == 0
    assert [file.name for file in (tmp_path / "cache").iterdir()] == ["nubis-thesis.tex"]
    (tmp_path / "cache" / "nubis-thesis.tex").unlink()
    assert main(["cache", "--clear"]) == 0
    assert not (tmp_path / "cache").exists()
