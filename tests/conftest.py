"""What all tests share: a folder of their own for compiled kernels, so that no answer depends on what a user's cache
holds; which of them are fast, and which run only where they are asked for (`durations.txt`)."""

import gc
import os
import sys
from collections import Counter
from pathlib import Path

import pytest
from browser import chromium, opened

__all__ = ["chromium", "opened"]

DURATIONS = Path(__file__).with_name("durations.txt")
FAST = 0.2
"""Seconds below which each case of a test is fast, with the fixtures that it is the first to need."""

COLLECTED = pytest.StashKey()

# Thousands of tests and the records of their scenes are looked through again and again for nothing.
gc.set_threshold(20_000, 20, 20)


@pytest.fixture(autouse=True)
def _pictures_closed():
    """Figures that a test asked for are registered with pyplot, and would stay there."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


def durations():
    """What the file says: of tests the seconds of the slowest case, of single cases `long` or `fast`."""
    lines = DURATIONS.read_text(encoding="utf-8").splitlines()
    return {name: first for first, name in (line.split(" ", 1) for line in lines if not line.startswith("#"))}


def function(name):
    """The test without the parameters of the case."""
    return name.partition("[")[0]


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="also run what tests/durations.txt calls long")
    parser.addoption("--time", action="store_true", help="measure what runs and write it to tests/durations.txt")


def pytest_configure(config):
    config.addinivalue_line("markers", f"fast: takes less than {FAST} s")
    if config.getoption("--time") and "PYTEST_XDIST_WORKER" not in os.environ:
        config.pluginmanager.register(Clock())


class Clock:
    """Seconds of what runs, in this process or in workers; they replace what the file said of it."""

    def __init__(self):
        self.seconds = Counter()

    def pytest_runtest_logreport(self, report):
        self.seconds[report.nodeid] += report.duration

    def pytest_sessionfinish(self):
        said, measured = durations(), {}
        for name, seconds in self.seconds.items():
            measured[function(name)] = max(seconds, measured.get(function(name), 0.0))
        slow = {name: f"{seconds:.1f}" for name, seconds in measured.items() if seconds >= FAST}
        kept = {name: first for name, first in said.items() if first in ("long", "fast") or name not in measured}
        head = [line for line in DURATIONS.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
        lines = [f"{first} {name}" for name, first in sorted({**slow, **kept}.items())]
        DURATIONS.write_text("\n".join([*head, *lines, ""]), encoding="utf-8")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Marks what is fast; what is long runs with --long or where it is named."""
    said = durations()
    long = {name for name, first in said.items() if first == "long"}
    whole = not any("::" in argument for argument in config.args)
    config.stash[COLLECTED] = {item.nodeid for item in items if whole}
    for item in items:
        if said.get(item.nodeid, said.get(function(item.nodeid), "fast")) == "fast":
            item.add_marker("fast")
    if whole and not config.getoption("--long"):
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in long])
        items[:] = [item for item in items if item.nodeid not in long]


@pytest.fixture(scope="session")
def lost_names(pytestconfig):
    """What `durations.txt` says of tests that are not there any more, in files that were collected as a whole."""
    found = pytestconfig.stash[COLLECTED]
    files = {name.partition("::")[0] for name in found}
    there = found | {function(name) for name in found}
    return sorted(name for name in durations() if name not in there and name.partition("::")[0] in files)


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        # What one worker has compiled the others take.
        folder = folder.parent
    folder = folder / "kernels"
    folder.mkdir(mode=0o700, exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SFETCAS_CACHE", str(folder))
        from sfetcas.mathematics.core import core

        # Whether there is a core, with whose last digits answers come, must not hang on which test is the first.
        core()
        yield


@pytest.fixture(scope="module")
def interpreted():
    """Short motions: compiling would take longer than running them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SFETCAS_KERNELS", "interpreted")
        yield
