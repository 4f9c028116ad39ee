"""Files appear whole or not at all, and what cannot be written is refused before the work."""

import os
import random
import signal
import stat
import subprocess
import sys
import time

import numpy as np
import pytest

import nubis
from nubis import FileError, ParameterError
from nubis.__main__ import main

ENDINGS = ["png", "exr", "hdr", "npy"]
FRAME = np.full((4, 6, 3), 0.25, np.float32)


def _content(path):
    """What a whole file holds: the one number all over it."""
    if path.suffix == ".toml":
        return nubis.Params.load(path).clouds.coverage
    pixels = nubis.load_map(path)
    assert pixels.shape == (300, 400, 3) and np.ptp(pixels) == 0
    return float(pixels[0, 0, 0])


WRITER = """
import sys
import numpy as np
import nubis
path = sys.argv[1]
frames = [np.full((300, 400, 3), value, np.float32) for value in (0.25, 0.5)]
skies = [nubis.Params().with_(**{"clouds.coverage": value}) for value in (0.25, 0.5)]
print("ready", flush=True)
while True:
    for frame, sky in zip(frames, skies):
        if path.endswith("toml"):
            sky.save(path)
        else:
            nubis.save(path, frame, dither=False)
"""


# What 0.25 and 0.5 are in a file; by AgX for png.
VALUES = {ending: (0.25, 0.5) for ending in (*ENDINGS, "toml")}
VALUES["png"] = tuple(
    float(np.float32(nubis.to_srgb8(np.full((1, 1, 3), v), dither=False)[0, 0, 0] / 255))
    for v in (0.25, 0.5)
)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("ending", [*ENDINGS, "toml"])
def test_a_killed_writer_leaves_a_whole_file(tmp_path, ending):
    path = tmp_path / f"sky.{ending}"
    random.seed(7)
    for _ in range(4):
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout.readline() == b"ready\n"
            while not path.exists() and writer.poll() is None:
                time.sleep(0.001)
            time.sleep(random.uniform(0, 0.05))
            writer.send_signal(signal.SIGKILL)
        assert _content(path) in VALUES[ending]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_refused_picture_leaves_the_old_file_alone(tmp_path, ending):
    path = tmp_path / f"sky.{ending}"
    nubis.save(path, FRAME)
    before = path.read_bytes()
    for bad in (FRAME * np.nan, FRAME[0]):
        with pytest.raises(ParameterError):
            nubis.save(path, bad)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", ENDINGS)
def test_modes_and_links_stay(tmp_path, ending):
    path, link = tmp_path / f"sky.{ending}", tmp_path / f"link.{ending}"
    mask = os.umask(0o027)
    try:
        nubis.save(path, FRAME)
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o604)
    link.symlink_to(path.name)
    nubis.save(link, FRAME * 2)
    assert link.is_symlink() and stat.S_IMODE(path.stat().st_mode) == 0o604
    assert {p.name for p in tmp_path.iterdir()} == {path.name, link.name}


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_no_file_is_written_as_it_is(tmp_path, ending):
    link = tmp_path / f"null.{ending}"
    link.symlink_to("/dev/null")
    nubis.save(link, FRAME)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


@pytest.fixture
def no_render(monkeypatch):
    def made(*_, **__):
        raise AssertionError("a renderer was made first")

    monkeypatch.setattr(nubis, "Renderer", made)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--out", "x.jpg"], "--out = 'x.jpg'"),
        (["--out", "x.tiff", "--format", "png"], "--out = 'x.tiff'"),
        (["--out", "y.png", "--format", "exr"], "--format = 'exr'"),
        (["--out", "/dev/null/y.png"], "/dev/null"),
        (["--out", "/proc/y.png"], "/proc/y.png"),
        (["--out", "file/pictures"], "file"),
        (["--out", "folder.png"], None),
        (["--out", "z.exr", "--heat"], "z.heat.png"),
    ],
)
def test_what_cannot_be_written_is_refused_before_rendering(
    no_render, tmp_path, monkeypatch, capsys, options, named
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "z.heat.png").mkdir()
    if named is None:  # An existing folder, whatever its name.
        (tmp_path / "folder.png").mkdir()
        assert main(["render", "sunset", *options]) == 1
        assert "a renderer was made first" in capsys.readouterr().err
        return
    assert main(["render", "sunset", *options]) == 2
    assert named in capsys.readouterr().err
    assert {p.name for p in tmp_path.iterdir()} == {"file", "z.heat.png"}


def test_a_new_folder_with_a_dot(tmp_path):
    out = f"{tmp_path}/v1.2/"
    assert main(["render", "mackerel", "--size", "16x9", "--quality", "draft", "--out", out]) == 0
    assert (tmp_path / "v1.2" / "mackerel.png").is_file()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_folder_in_the_way(tmp_path, ending):
    (tmp_path / f"sky.{ending}").mkdir()
    with pytest.raises(FileError, match="folder"):
        nubis.save(tmp_path / f"sky.{ending}", FRAME)


def test_parameters_into_no_folder(tmp_path):
    with pytest.raises(FileError, match="none"):
        nubis.Params().save(tmp_path / "none" / "sky.toml")
