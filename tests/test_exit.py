"""Processes end with exit code 0 and without a word while threads render, and start without one."""

import os
import subprocess
import sys

import pytest

START = """
import sys, threading, time
import numpy as np
import nubis
camera, params = nubis.scenes["fair_weather"]
points = np.random.default_rng(1).uniform(-5000, 5000, (200_000, 3))
makers = [nubis.Renderer(160, 90, quality="balanced") for _ in range(3)]
begun = threading.Event()

def render(renderer):
    while True:
        renderer.render(camera, params)
        begun.set()

def animate(renderer):
    for i, frame in enumerate(renderer.animate((camera, params, t / 24) for t in range(10**9))):
        begun.set()

def density(renderer):
    while True:
        renderer.density(points, params)
        begun.set()

def think(renderer):
    while True:
        nubis.DensityGrid(np.ones((2, 2, 2)), ((0, 0, 0), (1, 1, 1)))
        params.with_(**{"sun.irradiance": np.ones(3)})
        renderer.timings, renderer.adapter
        begun.set()

def start(*targets):
    for target, renderer in zip(targets, makers):
        threading.Thread(target=target, args=(renderer,), daemon=True).start()
    begun.wait()
"""

ENDS = {
    "daemon renders": "start(render)",
    "daemon animates": "start(animate)",
    "daemon asks for densities": "start(density)",
    "daemon makes parameters": "start(think)",
    "three at once": "start(render, animate, density)",
    "a renderer shared": "makers[1] = makers[0]; start(render, render)",
    "a thread exits": "start(render); threading.Thread(target=sys.exit, args=(3,)).start()",
    "a generator is alive": (
        "frames = makers[0].animate((camera, params, 0.0) for _ in range(9)); next(frames)"
    ),
    "renders at exit": (
        "import atexit; atexit.unregister(nubis._nubis.close); "
        "atexit.register(lambda: makers[1].render(camera, params)); "
        "atexit.register(nubis._nubis.close); start(render)"
    ),
    "sys.exit": "start(render); sys.exit(0)",
}


def _run(code, **changes):
    environment = {**os.environ, **{k: v for k, v in changes.items() if v is not None}}
    for name, value in changes.items():
        if value is None:
            environment.pop(name, None)
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, timeout=90, env=environment)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("end", ENDS)
def test_the_interpreter_ends(end):
    for delay in (0.0, 0.013, 0.11):
        done = _run(f"{START}\n{ENDS[end]}\ntime.sleep({delay})")
        assert (done.returncode, done.stderr) == (0, "")


def test_an_interrupt_while_threads_render():
    # A job in the background is started with interrupts ignored.
    listen = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{START}\n{listen}\nstart(render, animate)\nsignal.raise_signal(signal.SIGINT)"
    done = _run(code)
    assert done.stderr.strip().endswith("KeyboardInterrupt") and "panic" not in done.stderr
    assert done.returncode in (1, 130, -2)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_forked_child_ends():
    done = _run(f"{START}\nstart(render)\nif os.fork(): os.wait()".replace("sys,", "sys, os,"))
    assert (done.returncode, done.stderr) == (0, "")


FIRST = """
import nubis
nubis.Renderer(16, 9, quality="draft").render(*nubis.scenes["fair_weather"])
"""


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("folder", [None, "relative"])
def test_no_word_without_a_screen(folder):
    done = _run(FIRST, XDG_RUNTIME_DIR=folder, NODEVICE_SELECT=None)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "given",
    [{"NODEVICE_SELECT": "0"}, {"MESA_VK_DEVICE_SELECT": "list"}, {"XDG_RUNTIME_DIR": "/tmp"}],
)
def test_what_the_user_says_of_the_driver_stays(given):
    unset = {"NODEVICE_SELECT": None, "XDG_RUNTIME_DIR": None, "MESA_VK_DEVICE_SELECT": None}
    code = "import os, nubis; print(os.environ.get('NODEVICE_SELECT'))"
    done = _run(code, **(unset | given))
    assert done.stdout.strip() == str(given.get("NODEVICE_SELECT"))
