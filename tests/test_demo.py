"""The window, tried as by a user: on a display of its own, with keys and mouse."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import nubis
from nubis import _nubis

ROOT = Path(__file__).parent.parent
DEMO = ROOT / "target" / "release" / "clouds_demo"
SCENES = ROOT / "crates" / "clouds_demo" / "src" / "scenes.toml"
TOOLS = "Xvfb", "xdotool", "xclip"
#: Where the view begins, and its size, in a window of 1280 x 720.
CORNER, VIEW = (360, 48), (920, 647)
PATIENCE = 120.0

needs_display = pytest.mark.skipif(
    not DEMO.exists() or any(shutil.which(tool) is None for tool in TOOLS),
    reason="clouds_demo is not built, or Xvfb, xdotool or xclip is missing",
)


def test_scenes_are_those_of_the_package():
    usual = nubis.Params().to_dict()
    wanted = {}
    for name, (camera, params) in nubis.scenes.items():
        scene = {
            "camera": {
                "eye": list(camera.eye),
                "forward": list(camera.forward),
                "fov_y": camera.fov,
            }
        }
        for block, fields in params.to_dict().items():
            changes = {k: v for k, v in fields.items() if v != usual[block][k]}
            if changes:
                scene[block] = changes
        wanted[name] = scene
    text = tomli_w.dumps(wanted)
    if os.environ.get("UPDATE"):
        SCENES.write_text(text)
    assert SCENES.read_text() == text, "UPDATE=1 writes it anew"


@pytest.fixture(scope="module")
def display():
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        number = server.stdout.readline().decode().strip()
        yield f":{number}"
        server.terminate()


class Window:
    """A demo that runs in a folder, and the hands of a user."""

    def __init__(self, display: str, folder: Path, *arguments: str) -> None:
        self.environment = os.environ | {"DISPLAY": display}
        self.environment.setdefault("XDG_RUNTIME_DIR", str(folder))
        self.folder = folder
        self.process = subprocess.Popen(
            [DEMO, *arguments],
            cwd=folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        _, errors = self.process.communicate()
        print(errors)

    def do(self, *arguments: object) -> str:
        words = ["xdotool", *map(str, arguments)]
        found = subprocess.run(
            words, env=self.environment, check=True, capture_output=True, text=True, timeout=60
        )
        return found.stdout

    def appear(self) -> str:
        window = self.do("search", "--sync", "--name", "^nubis$").split()[0]
        self.do("windowfocus", window)
        return window

    def click(self, x: int, y: int) -> None:
        self.do("mousemove", x, y)
        self.do("mousedown", 1)
        time.sleep(0.3)
        self.do("mouseup", 1)
        # A late frame handles the release and the next move together, and puts both there.
        time.sleep(1)

    def drag(self, x: int, y: int, dx: int, dy: int) -> None:
        self.do("mousemove", x, y, "mousedown", 1)
        for _ in range(8):
            time.sleep(0.1)
            self.do("mousemove_relative", "--", dx // 8, dy // 8)
        self.do("mouseup", 1)

    def save(self) -> Path:
        """The picture at rest: until it is, the button says so and saves nothing."""
        before = set(self.folder.glob("sky*.png"))
        started = time.monotonic()
        while time.monotonic() < started + PATIENCE:
            self.click(51, 35)
            new = set(self.folder.glob("sky*.png")) - before
            if new:
                time.sleep(0.5)
                return new.pop()
            time.sleep(1)
        raise AssertionError("no picture was saved")

    def code(self) -> str:
        self.click(374, 35)
        time.sleep(1)
        command = ["xclip", "-o", "-selection", "clipboard"]
        return subprocess.run(
            command, env=self.environment, check=True, capture_output=True, text=True, timeout=10
        ).stdout

    def leave(self, window: str) -> None:
        self.do("windowfocus", window, "key", "ctrl+q")
        _, errors = self.process.communicate(timeout=PATIENCE)
        assert self.process.returncode == 0, errors
        assert "panicked" not in errors


def pixels(path: Path) -> np.ndarray:
    return np.rint(255 * np.asarray(_nubis.read_pixels(path))[..., :3])


def off(got: np.ndarray, expected: np.ndarray) -> float:
    """Relative RMSE."""
    return float(np.sqrt(((got - expected) ** 2).mean() / (expected**2).mean()))


def check_screenshot(
    path: Path, scale: int, corner: tuple[int, int], view: tuple[int, int]
) -> None:
    """The view is the picture of the library, in pixels of the screen."""
    got = pixels(path)
    frame = nubis.Renderer(*view).render(*nubis.scenes["fair_weather"])
    expected = nubis.to_srgb8(frame)[..., :3].astype(np.float64)
    x, y = corner
    assert off(got[y : y + view[1], x : x + view[0]], expected) < 0.01
    # The panel beside it is dark, with bright words.
    panel = got[y + 12 : y + view[1] - 5, : 350 * scale]
    assert np.median(panel) < 60 < panel.max()


@pytest.mark.slow
@needs_display
def test_frames_and_a_screenshot(display, tmp_path):
    """The window leaves by itself."""
    arguments = "--frames", "2", "--screenshot", "window.png"
    with Window(display, tmp_path, *arguments) as demo:
        _, errors = demo.process.communicate(timeout=PATIENCE)
        assert demo.process.returncode == 0, errors
    assert pixels(tmp_path / "window.png").shape == (720, 1280, 3)
    check_screenshot(tmp_path / "window.png", 1, CORNER, VIEW)


@pytest.mark.slow_after(1)
@needs_display
@pytest.mark.parametrize(
    "arguments",
    [
        ["--frames", "3"],
        ["--frames", "1000", "--scene", "sunset", "--rate", "20"],
        ["--frames", "5", "--fly"],
        ["--frames", "1", "--size", "500x300"],
    ],
    ids=" ".join,
)
def test_a_window_that_is_asked_for_pictures_ends(display, tmp_path, arguments):
    """After as many as there are, where nothing moves, with its own picture."""
    with Window(display, tmp_path, *arguments, "--screenshot", "window.png") as demo:
        _, errors = demo.process.communicate(timeout=PATIENCE)
        assert demo.process.returncode == 0, errors
    assert pixels(tmp_path / "window.png").max() > 100


@needs_display
def test_a_window_without_room_for_a_picture_says_so(display, tmp_path):
    arguments = "--frames", "3", "--size", "300x300", "--screenshot", "window.png"
    with Window(display, tmp_path, *arguments) as demo:
        _, errors = demo.process.communicate(timeout=PATIENCE)
        assert demo.process.returncode == 1 and "--size" in errors


@pytest.mark.slow
@needs_display
def test_a_screen_of_two_pixels_a_point(display, tmp_path, monkeypatch):
    monkeypatch.setenv("WINIT_X11_SCALE_FACTOR", "2")
    arguments = "--size", "640x400", "--frames", "2", "--screenshot", "window.png"
    with Window(display, tmp_path, *arguments) as demo:
        _, errors = demo.process.communicate(timeout=PATIENCE)
        assert demo.process.returncode == 0, errors
    assert pixels(tmp_path / "window.png").shape == (800, 1280, 3)
    check_screenshot(tmp_path / "window.png", 2, (720, 188), (560, 562))


@pytest.mark.slow
@needs_display
def test_a_user_flies_paints_saves_and_goes_on_in_python(display, tmp_path, monkeypatch):
    with Window(display, tmp_path) as demo:
        window = demo.appear()
        first = demo.save()
        # Into the sky, with a look to the right.
        demo.do("mousemove", 700, 400, "keydown", "w")
        time.sleep(2)
        demo.do("keyup", "w")
        demo.drag(700, 400, -160, 40)
        second = demo.save()
        assert off(pixels(second), pixels(first)) > 0.1
        # Another time of the day.
        for _ in range(5):
            demo.click(226, 129)
            # Where the panel has not settled, the click sets the clock to midnight.
            sun = float(demo.code().split('"sun.elevation": ')[1].split(",")[0])
            if sun > 0:
                break
        evening = demo.save()
        assert off(pixels(evening), pixels(second)) > 0.03
        lines = demo.code()
        assert '"sun.elevation"' in lines
        # Weather by hand.
        demo.click(64, 221)
        demo.drag(120, 400, 80, 40)
        painted = demo.save()
        assert off(pixels(painted), pixels(evening)) > 0.01
        code = demo.code()
        assert "nubis.Params.load(" in code
        demo.leave(window)

    monkeypatch.chdir(tmp_path)
    for picture, text in (evening, lines), (painted, code):
        exec(text, {})
        assert off(pixels(tmp_path / "sky.png"), pixels(picture)) < 0.02
    linear = nubis.Params.load(next(tmp_path.glob("*.toml")))
    assert linear.weather.map is not None


@pytest.mark.slow
@needs_display
def test_panoramas_and_recordings(display, tmp_path):
    with Window(display, tmp_path, "--scene", "cirrus") as demo:
        window = demo.appear()
        demo.save()
        demo.click(285, 35)
        demo.do("mousemove", 700, 400, "keydown", "w")
        time.sleep(2)
        demo.do("keyup", "w")
        demo.click(285, 35)
        frames = sorted(tmp_path.glob("frames*/frame*.png"))
        assert len(frames) >= 2
        assert all(pixels(frame).max() > 100 for frame in frames)
        demo.click(212, 35)
        started = time.monotonic()
        while not list(tmp_path.glob("panorama*.png")):
            assert time.monotonic() < started + PATIENCE
            time.sleep(0.5)
        time.sleep(1)
        demo.leave(window)
    panorama = np.asarray(_nubis.read_pixels(next(tmp_path.glob("panorama*.exr"))))
    assert panorama.shape == (2048, 4096, 3) and np.isfinite(panorama).all()
    camera, params = nubis.scenes["cirrus"]
    small = nubis.Renderer(512, 256).render(nubis.Camera.equirect(camera.eye), params)[..., :3]
    # The flight was some hundred metres; the sun's disc is a few pixels of the small one.
    coarse = panorama.reshape(256, 8, 512, 8, 3).mean((1, 3))
    dim = small[..., 0] < 2 * small[..., 0].mean()
    assert off(coarse[dim], small[dim]) < 0.15


@pytest.mark.slow
@needs_display
def test_a_window_is_resized_and_small_and_closed_in_the_middle_of_a_picture(display, tmp_path):
    with Window(display, tmp_path, "--scene", "storm") as demo:
        window = demo.appear()
        for size in (900, 500), (400, 200), (1280, 720):
            demo.do("windowsize", window, *size)
            time.sleep(0.7)
        demo.do("windowunmap", window)
        time.sleep(0.5)
        demo.do("windowmap", window)
        demo.do("windowfocus", window, "keydown", "w")
        time.sleep(0.5)
        demo.do("keyup", "w")
        demo.leave(window)


def test_bad_arguments_are_refused_by_name():
    if not DEMO.exists():
        pytest.skip("clouds_demo is not built")
    for arguments, named in (
        (["--size", "12"], "--size"),
        (["--rate", "0"], "--rate"),
        (["--screenshot", "x.png"], "--frames"),
        (["--frames", "0"], "--frames"),
        (["--frames", "2", "--screenshot", "no/such/folder/x.png"], "--screenshot"),
        (["--frames", "2", "--screenshot", "x.jpg"], "--screenshot"),
        (["--adapter", "no such adapter"], "no adapter matches"),
    ):
        result = subprocess.run(
            [DEMO, *arguments], capture_output=True, text=True, timeout=60, check=False
        )
        assert result.returncode != 0 and named in result.stderr, result.stderr
        assert "panicked" not in result.stderr
