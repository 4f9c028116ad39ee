"""One adapter for all tests, named in the header, and renderers that are made once and shared."""

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
            quality = nubis.quality(quality).replace(contrast=0.0)
        return nubis.Renderer(width, height, quality=quality)

    return make


@pytest.fixture
def rng():
    return np.random.default_rng(20150809)


def pytest_unconfigure():
    shutil.rmtree(os.environ["NUBIS_CACHE"], ignore_errors=True)


def pytest_terminal_summary(terminalreporter):
    """How many examples the stress suite has run."""
    ran = getattr(sys.modules.get("test_stress"), "RAN", {})
    if ran:
        terminalreporter.section("stress")
        for name, count in ran.items():
            terminalreporter.write_line(f"{count:7} {name}")
        terminalreporter.write_line(f"{sum(ran.values()):7} examples")
