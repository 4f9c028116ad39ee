"""One adapter for all tests, named in the header, and renderers that are made once and shared."""

import collections
import functools
import os
import shutil
import sys
import tempfile

import numpy as np
import pytest

os.environ.setdefault("NUBIS_ADAPTER", "cpu")
os.environ["NUBIS_CACHE"] = tempfile.mkdtemp(prefix="nubis-tests-")  # not the user's own

import nubis
import nubis.testing

# Probes share a renderer: what it bakes takes longer than they do.
nubis.testing.Renderer = functools.cache(nubis.Renderer)


def pytest_report_header():
    adapter = nubis.Renderer(1, 1).adapter
    about = f"{adapter.name} ({adapter.kind}), {adapter.driver}, {adapter.backend}"
    return f"nubis {nubis.__version__} on {about}"


@pytest.fixture(scope="session", autouse=True)
def _vulkan():
    assert nubis.Renderer(1, 1).adapter.backend == "vulkan"


@pytest.fixture(scope="session")
def renderer():
    """``renderer(width, height, quality)``: the same object for the same arguments."""

    @functools.cache
    def make(width=64, height=36, quality="draft"):
        if isinstance(quality, str):
            # Every pixel is marched; which need not be is tested in test_refine.py.
            quality = nubis.quality(quality).replace(adaptive_threshold=0.0)
        return nubis.Renderer(width, height, quality=quality)

    return make


@pytest.fixture
def rng():
    return np.random.default_rng(20150809)


@pytest.hookimpl(tryfirst=True)  # before `-m` looks at the marks
def pytest_collection_modifyitems(items):
    """Puts what `slow_after` says into the second tier, and the stress suite first: it keeps one of
    two processes busy while the other does the rest.
    """
    items.sort(key=lambda item: "test_stress.py" not in item.nodeid)
    cases = collections.Counter()
    for item in items:
        for mark in item.iter_markers("slow_after"):
            test = item.nodeid.partition("[")[0]
            cases[test] += 1
            if cases[test] > mark.args[0]:
                item.add_marker("slow")


def pytest_unconfigure():
    shutil.rmtree(os.environ["NUBIS_CACHE"], ignore_errors=True)


# Examples of the stress suite, by property: of this process, or of those that it has started.
RAN = collections.Counter()


def pytest_sessionfinish(session):
    RAN.update(getattr(sys.modules.get("test_stress"), "RAN", {}))
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["ran"] = dict(RAN)


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_testnodedown(node):
    RAN.update(getattr(node, "workeroutput", {}).get("ran", {}))


def pytest_terminal_summary(terminalreporter):
    """How many examples the stress suite has run."""
    if RAN:
        terminalreporter.section("stress")
        for name, count in RAN.items():
            terminalreporter.write_line(f"{count:7} {name}")
        terminalreporter.write_line(f"{sum(RAN.values()):7} examples")
