"""Compiled kernels of the tests go to a folder of their own: no answer depends on what a user's cache holds."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SFETCAS_CACHE", str(tmp_path_factory.mktemp("kernels")))
        yield


@pytest.fixture(scope="module")
def interpreted():
    """Short motions: compiling would take longer than running them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SFETCAS_KERNELS", "interpreted")
        yield
