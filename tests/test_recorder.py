"""How often a picture talks to the device, and how soon Ctrl-C ends one.

Each runs in a process of its own: what a device has learned of its kernels decides where a
recording is cut into slices (``SLICE_SECONDS`` in recorder.rs), and other tests have taught that of
this process otherwise.
"""

import subprocess
import sys

import pytest


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return [[float(word) for word in line.split()] for line in done.stdout.splitlines()]


# Submissions and waits of each picture, and seconds of its kernels.
COUNT = """
import nubis
camera, params = nubis.scenes["fair_weather"]
ahead = [a + b for a, b in zip(camera.eye, camera.forward)]
camera = nubis.Camera.look_at(camera.eye, ahead, fov_y={fov})
renderer = nubis.Renderer({size}, quality={quality!r})
before = renderer._core.counters()
for picture in {pictures}:
    after = renderer._core.counters()
    print(*(b - a for a, b in zip(before, after)), sum(renderer.timings.values()) / 1000)
    before = after
"""
STILLS = "(renderer.render(camera, params) for _ in range(5))"
FRAMES = "renderer.animate((camera, params, i / 24) for i in range(20))"

# Dispatches too small to be timed (`MIN_TIMED_INVOCATIONS` in gpu/recorder.rs): estimates come
# to a fifth of a slice, whatever else the machine does. Pixels narrow enough for adaptive sampling,
# as in larger pictures; up to a million pixels (`STRIP_PIXELS` in plan.rs) all are alike.
SMALL = {"size": "32, 24", "fov": 2.0}
# Under load, work is thought of as longer, and may be cut into more slices.
LARGE = {"size": "480, 270", "fov": 60.0}


@pytest.mark.parametrize(
    ("quality", "pictures"),
    [("balanced", STILLS), ("draft", STILLS), ("preview", FRAMES), ("draft", FRAMES)],
    ids=["balanced still", "draft still", "preview frame", "draft frame"],
)
def test_a_warm_picture_is_submitted_and_waited_for_once(quality, pictures):
    """The first bakes and the second may compile what only frames after others need."""
    counts = run(COUNT.format(**SMALL, quality=quality, pictures=pictures))
    assert [c[:2] for c in counts[2:]] == [[1, 1]] * (len(counts) - 2), counts


@pytest.mark.slow
def test_a_long_still_is_submitted_as_seldom_as_may_be():
    """Two submissions, and one more for each eighth of a second of work at most: a fourth of a
    slice, as kernels may be thought to take longer than they did.
    """
    for submissions, waits, seconds in run(
        COUNT.format(**LARGE, quality="balanced", pictures=STILLS)
    )[2:]:
        assert waits <= submissions <= 2 + seconds / 0.125


# Ctrl-C once a picture of minutes is on its way, and the seconds until it ends. Jobs that a shell
# starts in the background ignore SIGINT, and so would their children. The small picture teaches the
# device how long kernels take; what the large one compiles, which nothing interrupts, it compiles
# before the submissions that are counted here.
INTERRUPTED = """
import signal, threading, time, nubis
signal.signal(signal.SIGINT, signal.default_int_handler)
camera, params = nubis.scenes["fair_weather"]
params = params.with_(**{changes!r})
small = nubis.Renderer(160, 90, quality={quality!r})
small.render(camera, params) if {teach} else small.density([[0, 0, 0]], params)
large = nubis.Renderer(1920, 1080, quality={quality!r})
first = small._core.counters()[0]
sent = []

def interrupt():
    # The counters are the device's, whoever uses it.
    while small._core.counters()[0] < first + {submissions}:
        time.sleep(0.001)
    sent.append(time.monotonic())
    signal.raise_signal(signal.SIGINT)

thread = threading.Thread(target=interrupt, daemon=True)
thread.start()
try:
    large.render(camera, params)
except KeyboardInterrupt:
    print(time.monotonic() - sent[0])
"""
# Each takes minutes on two cores: rays that converge, paths, and a march in one recording. How many
# submissions are waited for, and how soon each must end, s. It is meant to be 0.2: there is a look
# at the interrupt every 0.1 s, and where the driver computes while it is handed work, as lavapipe
# does, after each dispatch: those of rays take 0.1 s, those of a march half a second. The rest is
# for two cores that have ten times as much to do.
PICTURES = {
    "reference": ("reference", {}, False, 20, 2.0),
    "path": ("balanced", {"light.model": "path"}, False, 20, 2.0),
    "high": ("high", {}, True, 4, 6.0),
}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("picture", PICTURES)
def test_an_interrupt_is_answered_soon(picture):
    """The one bound on a time among the tests: without it, nobody would notice that a picture can
    no longer be stopped before it is done.
    """
    quality, changes, teach, submissions, allowed = PICTURES[picture]
    code = INTERRUPTED.format(
        quality=quality, changes=changes, teach=teach, submissions=submissions
    )
    [[seconds]] = run(code)
    print(f"{picture}: ended {seconds:.3f} s after the interrupt")
    assert seconds < allowed
