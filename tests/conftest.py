"""Compiled kernels of the tests go to a folder of their own: no answer depends on what a user's cache holds."""

import os

import pytest


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
