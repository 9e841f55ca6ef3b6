"""What all tests share: a folder of their own for compiled kernels, so that no answer depends on what a user's cache
holds, and which of them are run by themselves only."""

import os
from pathlib import Path

import pytest

LONG = Path(__file__).with_name("long.txt")


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="also run what tests/long.txt names")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """What takes seconds, with shorter tests of its kind beside it, runs with --long or where it is named."""
    named = {line for line in LONG.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")}
    if any("::" in argument for argument in config.args):
        return
    found = {item.nodeid for item in items}
    files = {name.partition("::")[0] for name in found}
    lost = sorted(name for name in named - found if name.partition("::")[0] in files)
    if lost:
        raise pytest.UsageError(f"{LONG.name}: found names of no tests: {', '.join(lost[:3])}")
    if not config.getoption("--long"):
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in named])
        items[:] = [item for item in items if item.nodeid not in named]


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
        yield


@pytest.fixture(scope="module")
def interpreted():
    """Short motions: compiling would take longer than running them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SFETCAS_KERNELS", "interpreted")
        yield
