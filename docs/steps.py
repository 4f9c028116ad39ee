"""The pictures of docs/demo.md: the window, step by step, by keys and mouse.

    python -m docs.steps

It needs what tests/test_demo.py needs: target/release/clouds_demo, Xvfb, xdotool and xclip.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import numpy.typing as npt

from nubis import _nubis

ROOT = Path(__file__).parent.parent
IMAGES = ROOT / "docs" / "images" / "demo"
SIZE = 1280, 720


def screenshot(framebuffer: Path) -> npt.NDArray[np.uint8]:
    """Read what Xvfb keeps of its screen: an XWD file, pixels of blue, green, red and nothing."""
    dump = framebuffer.read_bytes()
    header = np.frombuffer(dump, ">u4", 20)
    size, height, line, colours = (int(header[i]) for i in (0, 5, 12, 19))
    pixels = np.frombuffer(dump, np.uint8, height * line, size + 12 * colours)
    return pixels.reshape(height, -1, 4)[: SIZE[1], : SIZE[0], 2::-1]


def save(name: str, framebuffer: Path) -> None:
    """Write the window in three quarters of its size."""
    pixels = screenshot(framebuffer).astype(np.float32)
    pixels = pixels.repeat(3, 0).repeat(3, 1)
    small = pixels.reshape(SIZE[1] * 3 // 4, 4, SIZE[0] * 3 // 4, 4, 3).mean((1, 3))
    _nubis.write_png(IMAGES / f"{name}.png", np.rint(small).astype(np.uint8))


def main() -> None:
    """Do what docs/demo.md says, and look at it."""
    sys.path.insert(0, str(ROOT / "tests"))
    window_of = import_module("test_demo").Window

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = ["Xvfb", "-displayfd", "1", "-screen", "0", "1280x720x24", "-fbdir", name]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        assert server.stdout is not None
        display = f":{server.stdout.readline().decode().strip()}"
        shot = folder / "Xvfb_screen0"
        try:
            with window_of(display, folder) as demo:
                window = demo.appear()
                demo.save()
                demo.do("mousemove", 700, 400)
                time.sleep(1)
                save("start", shot)
                demo.click(255, 12)
                demo.do("mousemove", 700, 400, "keydown", "shift", "keydown", "w")
                time.sleep(2)
                save("flight", shot)
                demo.do("keyup", "w", "keyup", "shift")
                time.sleep(5)
                save("in_cloud", shot)
                demo.click(187, 12)
                demo.click(227, 129)
                demo.do("mousemove", 700, 400)
                time.sleep(5)
                save("evening", shot)
                demo.click(64, 221)
                demo.drag(120, 400, 80, 40)
                demo.do("mousemove", 700, 400)
                time.sleep(5)
                save("painted", shot)
                demo.save()
                demo.code()
                time.sleep(1)
                save("saved", shot)
                demo.leave(window)
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
