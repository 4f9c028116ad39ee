"""The renderer's contract: arrays, layers, adapters, errors, threads, and stopping it."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import nubis
from nubis import AdapterError, ParameterError

SCENES = [
    "fair_weather",
    "overcast",
    "stratocumulus",
    "storm",
    "sunset",
    "in_cloud",
    "above",
    "cirrus",
]


def run_python(code, timeout=120, **environment):
    """Runs a program in a process of its own; None removes a variable from its environment."""
    env = {k: v for k, v in (os.environ | environment).items() if v is not None}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=env, timeout=timeout, capture_output=True, text=True)


def is_picture(array, shape, dtype=np.float32):
    assert array.shape == shape and array.dtype == dtype
    assert array.flags.c_contiguous and array.flags.writeable
    return True


def test_there_are_scenes():
    assert set(SCENES) <= set(nubis.scenes)
    for camera, params in nubis.scenes.values():
        assert isinstance(camera, nubis.Camera) and isinstance(params, nubis.Params)
    with pytest.raises(TypeError):
        nubis.scenes["fair_weather"] = None


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("scene", nubis.scenes)
def test_a_picture(renderer, scene):
    camera, params = nubis.scenes[scene]
    frame = renderer(64, 36).render(camera, params)
    assert is_picture(frame, (36, 64, 4))
    assert np.isfinite(frame).all() and (frame >= 0).all()
    assert (frame[..., 3] == 1).all() and frame[..., :3].max() > 0
    clouds = renderer(64, 36).render(camera, params, background=None)
    assert is_picture(clouds, (36, 64, 4))
    assert np.isfinite(clouds).all() and clouds.min() >= 0 and clouds[..., 3].max() <= 1


def test_layers(renderer):
    camera, params = nubis.scenes["fair_weather"]
    layers = renderer(64, 36).render_layers(camera, params)
    assert is_picture(layers["radiance"], (36, 64, 3))
    assert is_picture(layers["transmittance"], (36, 64))
    assert is_picture(layers["depth"], (36, 64))
    assert is_picture(layers["samples"], (36, 64), np.uint32)
    assert is_picture(layers["sky"], (36, 64, 3))


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("call", ["density", "sun_transmittance"])
def test_answers_at_points(renderer, call):
    ask = getattr(renderer(), call)
    params = nubis.Params()
    points = np.random.default_rng(1).uniform(0, 3000, (20_000, 3))
    answers = ask(points, params)
    assert is_picture(answers, (20_000,))
    assert np.isfinite(answers).all() and (answers >= 0).all()
    # Any array-like, any order in memory, any number of points.
    np.testing.assert_array_equal(ask(points[:5].tolist(), params), answers[:5])
    np.testing.assert_array_equal(ask(np.asfortranarray(points), params), answers)
    np.testing.assert_array_equal(ask(points[:1].astype(np.float32), params).shape, (1,))
    assert is_picture(ask(np.empty((0, 3)), params), (0,))


def test_same_inputs_same_bytes(renderer):
    """On the same renderer, on another, and after other work."""
    camera, params = nubis.scenes["fair_weather"]
    other = nubis.scenes["sunset"]
    make = renderer(64, 36)
    first = make.render(camera, params, time=12.5).tobytes()
    assert make.render(camera, params, time=12.5).tobytes() == first
    make.render(*other, time=99.0)
    make.density([[0, 0, 2000]], other[1])
    list(make.animate([(*other, 0.0), (*other, 1.0)]))
    assert make.render(camera, params, time=12.5).tobytes() == first
    # Clouds that are where they were among shadows that are not: the wind has gone on by a whole
    # step of those.
    make.render(*other)
    make.render(camera, params, time=12.5 + 32.0 / params.wind.speed)
    assert make.render(camera, params, time=12.5).tobytes() == first
    fresh = nubis.Renderer(64, 36, quality=make.quality)
    assert fresh.render(camera, params, time=12.5).tobytes() == first


@pytest.mark.parametrize(
    "quality", ["draft", "balanced", "high", "nubis2015", "thesis2018", "vsu2022"]
)
def test_named_methods(renderer, quality):
    make = nubis.Renderer(16, 9, quality=quality)
    assert make.quality == nubis.quality(quality) and isinstance(make.quality, nubis.Quality)
    frame = make.render(*nubis.scenes["in_cloud"])
    assert np.isfinite(frame).all()
    assert (
        renderer(16, 9, nubis.quality(quality)).render(*nubis.scenes["in_cloud"]).tobytes()
        == frame.tobytes()
    )


def test_published_steps():
    """64 to 128 view steps and 6 light samples; 5 + 1 and big steps of 3; 250 and 64."""
    for name in ("nubis2015", "thesis2018"):
        method = nubis.quality(name)
        assert (method.steps_zenith, method.steps_horizon) == (64, 128)
        assert method.light_steps + method.far_sample == 6
    assert nubis.quality("thesis2018").coarse_step == 3
    vsu = nubis.quality("vsu2022")
    assert (vsu.steps_zenith, vsu.steps_horizon, vsu.light_steps) == (250, 250, 64)


def test_timings(renderer):
    make = renderer(64, 36)
    make.render(*nubis.scenes["fair_weather"])
    if not make.timings:
        pytest.skip("an adapter without timestamps")
    assert {"march", "composite"} <= set(make.timings)
    assert all(isinstance(v, float) and v >= 0 for v in make.timings.values())
    assert make.timings["march"] > 0


def test_a_renderer_says_what_it_is(renderer):
    make = renderer(64, 36)
    assert make.size == (64, 36)
    adapter = make.adapter
    assert all(isinstance(v, str) for v in adapter)
    assert adapter.kind in {"discrete", "integrated", "virtual", "cpu", "other"}
    assert adapter.name and adapter.driver
    assert adapter.name in repr(make)


def test_adapters():
    found = nubis.adapters()
    assert found and all(isinstance(a, nubis.Adapter) for a in found)
    rank = ["discrete", "integrated", "virtual", "other", "cpu"]
    assert [a.kind for a in found] == sorted((a.kind for a in found), key=rank.index)


def test_choosing_an_adapter(monkeypatch):
    for index, adapter in enumerate(nubis.adapters()):
        assert nubis.Renderer(1, 1, adapter=index).adapter == adapter
        assert nubis.Renderer(1, 1, adapter=str(index)).adapter == adapter
        assert nubis.Renderer(1, 1, adapter=adapter.kind).adapter.kind == adapter.kind
        part = adapter.name[:6].upper()
        assert part in nubis.Renderer(1, 1, adapter=part).adapter.name.upper()
        monkeypatch.setenv("NUBIS_ADAPTER", str(index))
        assert nubis.Renderer(1, 1).adapter == adapter


@pytest.mark.parametrize("how", ["argument", "environment"])
@pytest.mark.parametrize("wanted", ["no such adapter", "99"])
def test_no_such_adapter(monkeypatch, how, wanted):
    """The error lists what there is; an argument wins over the environment."""
    monkeypatch.setenv("NUBIS_ADAPTER", wanted if how == "environment" else "0")
    arguments = {"adapter": wanted} if how == "argument" else {}
    with pytest.raises(AdapterError) as error:
        nubis.Renderer(1, 1, **arguments)
    assert wanted in str(error.value)
    for adapter in nubis.adapters():
        assert adapter.name in str(error.value) and adapter.driver in str(error.value)
    assert nubis.Renderer(1, 1, adapter=0).adapter == nubis.adapters()[0]


def test_no_adapter_at_all():
    """The error names the package that would help."""
    code = (
        "import nubis\ntry: nubis.Renderer(1, 1)\nexcept nubis.AdapterError as error: print(error)"
    )
    nowhere = "/no/such/driver.json"
    done = run_python(code, VK_DRIVER_FILES=nowhere, VK_ICD_FILENAMES=nowhere, NUBIS_ADAPTER=None)
    assert done.returncode == 0, done.stderr
    assert "mesa-vulkan-drivers" in done.stdout


CAMERA, PARAMS = nubis.scenes["fair_weather"]


@pytest.mark.parametrize(
    ("named", "call"),
    [
        ("width", lambda r: nubis.Renderer(0, 1)),
        ("width", lambda r: nubis.Renderer(65537, 1)),
        ("width", lambda r: nubis.Renderer(1.5, 1)),
        ("height", lambda r: nubis.Renderer(1, -1)),
        ("height", lambda r: nubis.Renderer(1, "1")),
        ("height", lambda r: nubis.Renderer(1, True)),
        ("quality", lambda r: nubis.Renderer(1, 1, quality="best")),
        ("quality", lambda r: nubis.Renderer(1, 1, quality=3)),
        ("adapter", lambda r: nubis.Renderer(1, 1, adapter=1.0)),
        ("camera", lambda r: r.render(None, PARAMS)),
        ("params", lambda r: r.render(CAMERA, {})),
        ("params", lambda r: r.density([[0, 0, 0]], None)),
        ("background", lambda r: r.render(CAMERA, PARAMS, background="black")),
        ("background", lambda r: r.render(CAMERA, PARAMS, background=False)),
        ("time", lambda r: r.render(CAMERA, PARAMS, time=float("nan"))),
        ("time", lambda r: r.render(CAMERA, PARAMS, time=float("inf"))),
        ("time", lambda r: r.render(CAMERA, PARAMS, time="noon")),
        ("time", lambda r: r.density([[0, 0, 0]], PARAMS, time=float("nan"))),
        ("points", lambda r: r.density([0, 0, 0], PARAMS)),
        ("points", lambda r: r.density([[0, 0]], PARAMS)),
        ("points", lambda r: r.density([[0, 0, float("nan")]], PARAMS)),
        ("points", lambda r: r.sun_transmittance([[0, 0, 1e9]], PARAMS)),
        ("points", lambda r: r.sun_transmittance("abc", PARAMS)),
    ],
)
def test_wrong_arguments(renderer, named, call):
    with pytest.raises(ParameterError, match="is not allowed: it must be") as error:
        call(renderer())
    assert str(error.value).startswith(named)


def test_exceptions():
    for name in ("ParameterError", "AdapterError", "DeviceError", "ForkError", "FileError"):
        assert issubclass(getattr(nubis, name), nubis.NubisError)
    assert issubclass(nubis.ParameterError, ValueError)
    for name in ("AdapterError", "DeviceError", "ForkError"):
        assert issubclass(getattr(nubis, name), RuntimeError)


def test_threads(renderer):
    """Renderers of the same and of different threads keep out of each other's way."""
    shared = renderer(64, 36, nubis.quality("draft"))
    own = [nubis.Renderer(64, 36, quality="draft") for _ in range(2)]
    expected = shared.render(CAMERA, PARAMS).tobytes()
    pictures = []

    def work(make):
        pictures.extend(make.render(CAMERA, PARAMS).tobytes() for _ in range(3))

    threads = [threading.Thread(target=work, args=(make,)) for make in (shared, shared, *own)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(pictures) == 12 and set(pictures) == {expected}


def test_other_python_threads_run_during_a_render(renderer):
    make = renderer(192, 108, "high")
    ticks, done = [], threading.Event()

    def tick():
        while not done.wait(0.001):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    started = time.monotonic()
    make.render(CAMERA, PARAMS)
    ended = time.monotonic()
    done.set()
    thread.join()
    during = [t for t in ticks if started + 0.01 < t < ended - 0.01]
    assert len(during) > 5


FORK = """
import os, sys, nubis
{before}
child = os.fork()
if child == 0:
    try:
        {inside}
    except nubis.ForkError as error:
        os._exit(42 if "spawn" in str(error) else 1)
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
RENDER = "renderer.render(*nubis.scenes['fair_weather'])"


@pytest.mark.parametrize(
    ("before", "inside", "code"),
    [
        ("renderer = nubis.Renderer(8, 8)", RENDER, 42),
        ("renderer = nubis.Renderer(8, 8)", "renderer.density([[0, 0, 0]], nubis.Params())", 42),
        ("nubis.Renderer(8, 8)", "nubis.Renderer(8, 8)", 42),
        ("nubis.adapters()", "nubis.adapters()", 42),
        ("", "nubis.Renderer(8, 8)", 0),
    ],
    ids=["render", "density", "new renderer", "adapters", "forked before"],
)
def test_forked_children(before, inside, code):
    """A child of a process that has used the GPU is told to be spawned, and does not hang."""
    done = run_python(FORK.format(before=before, inside=inside))
    assert done.returncode == code, done.stderr


# Jobs that a shell starts in the background ignore SIGINT, and so would their children.
LONG = """
import signal, nubis
signal.signal(signal.SIGINT, signal.default_int_handler)
camera, params = nubis.scenes["fair_weather"]
nubis.Renderer(8, 8, quality="draft").render(camera, params)
renderer = nubis.Renderer(8192, 8192, quality="draft")
print("ready", flush=True)
try:
    renderer.render(camera, params)
except KeyboardInterrupt:
    print("stopped", flush=True)
    assert renderer.density([[0, 0, 0]], params).shape == (1,)
    print("works", flush=True)
"""


@pytest.mark.slow
def test_ctrl_c_stops_a_long_render():
    """A render of minutes, interrupted after a second, ends within another two; the renderer can
    still be used.
    """
    program = subprocess.Popen([sys.executable, "-c", LONG], stdout=subprocess.PIPE, text=True)
    watchdog = threading.Timer(120, program.kill)
    watchdog.start()
    try:
        assert program.stdout.readline() == "ready\n"
        time.sleep(1)
        assert program.poll() is None
        program.send_signal(signal.SIGINT)
        sent = time.monotonic()
        assert program.stdout.readline() == "stopped\n"
        assert time.monotonic() - sent < 2
        out, _ = program.communicate(timeout=60)
        assert out == "works\n" and program.returncode == 0
    finally:
        watchdog.cancel()
        program.kill()
        program.communicate()


WARNINGS = """
import warnings, nubis
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    for _ in range(3):
        nubis.Renderer(1, 1{arguments})
print(len(caught), *(w.message for w in caught))
"""


@pytest.mark.skipif(nubis.adapters()[0].kind != "cpu", reason="there is a hardware adapter")
@pytest.mark.parametrize(
    ("arguments", "environment", "count"),
    [("", None, 1), (', adapter="cpu"', None, 0), ("", "cpu", 0)],
    ids=["nothing said", "argument", "environment"],
)
def test_software_rendering_warns_once_unless_asked_for(arguments, environment, count):
    done = run_python(WARNINGS.format(arguments=arguments), NUBIS_ADAPTER=environment)
    said, _, message = done.stdout.strip().partition(" ")
    assert said == str(count), done.stderr
    assert ("NUBIS_ADAPTER" in message) == (count > 0)


def test_everything_public_is_documented():
    for name in set(nubis.__all__) - {"presets", "scenes"}:
        assert getattr(nubis, name).__doc__, name
    for owner in (nubis.Renderer, nubis.Camera):
        for name, value in vars(owner).items():
            if not name.startswith("_") and (callable(value) or isinstance(value, staticmethod)):
                assert getattr(owner, name).__doc__, name
