"""Tapes in the cache: the same as those that CasADi tells, whatever lies there."""

import os

import casadi as ca
import numpy as np
import pytest

from sfetcas.core.building import named
from sfetcas.mathematics import tapes
from sfetcas.mathematics.tapes import tape_of
from sfetcas.mechanics.elements import element_by_name
from sfetcas.mechanics.terms import rotation_gradient


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SFETCAS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def long_function(share=1.0):
    """A function whose tape is long enough to be kept."""
    x = ca.SX.sym("x", 4)
    y = x
    for k in range(2_000):
        y = ca.sin(y) + share * (k + 1) * x
    return ca.Function("long", [x], [y])


def anew(function):
    """The tape as a new process finds it."""
    tapes.tape_of.cache_clear()
    return tape_of(function)


def same(one, other):
    sizes = [(tape.slots, tape.arguments, tape.results, tape.parts) for tape in (one, other)]
    return sizes[0] == sizes[1] and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("code", "constant")
    )


def counted(monkeypatch):
    """Grows with every function that is read from CasADi."""
    found, read = [], tapes._read
    monkeypatch.setattr(tapes, "_read", lambda function: found.append(function) or read(function))
    return found


def test_a_tape_is_read_once(folder, monkeypatch):
    function = rotation_gradient(element_by_name("SFET5", True))
    read = counted(monkeypatch)
    first, again = anew(function), anew(function)
    assert len(read) == 1
    assert first is not again
    assert same(first, again)
    assert same(first, tapes._read(function))
    assert again.code.dtype == np.int32
    assert len(list(folder.iterdir())) == 1


def test_short_tapes_are_not_kept(folder):
    x = ca.SX.sym("x")
    assert anew(ca.Function("short", [x], [x + 1.0])).results == 1
    assert not folder.exists()


@pytest.mark.parametrize("how", ["truncated", "other bytes", "no archive", "other parts", "a folder"])
def test_what_is_not_whole_is_read_anew(folder, monkeypatch, how):
    function = long_function()
    right = anew(function)
    (file,) = folder.iterdir()
    key, content = file.name[:30], file.read_bytes()
    assert key.startswith("tape-")
    file.unlink()
    if how == "truncated":
        file.write_bytes(content[: len(content) // 2])
    elif how == "other bytes":
        file.write_bytes(content[:-100] + bytes(100))
    elif how == "a folder":
        file.mkdir()
    else:
        # Named as by this program.
        planted = folder / "planted.npz"
        if how == "other parts":
            np.savez(planted, numbers=np.arange(3))
        else:
            planted.write_bytes(b"nothing")
        planted.rename(folder / named(key, planted.read_bytes(), ".npz"))
    read = counted(monkeypatch)
    assert same(anew(function), right)
    assert len(read) == 1


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="who may write is told by modes")
def test_a_folder_that_others_may_write_to_is_not_used(folder, monkeypatch):
    function = long_function()
    anew(function)
    folder.chmod(0o777)
    read = counted(monkeypatch)
    with pytest.warns(UserWarning, match="others may write to it"):
        anew(function)
    assert len(read) == 1


def test_the_oldest_tapes_go(folder, monkeypatch):
    monkeypatch.setattr(tapes, "FILES", 3)
    names = []
    for share in (1.0, 2.0, 3.0, 4.0):
        anew(long_function(share))
        names.append({file.name for file in folder.iterdir()})
        for file in folder.iterdir():
            # Younger than all before.
            if share == 1.0 or file.name not in names[-2]:
                os.utime(file, (share, share))
    assert [len(one) for one in names] == [1, 2, 3, 3]
    assert not names[0] & names[-1]


def test_without_a_folder_tapes_are_found_all_the_same(monkeypatch):
    for name in ("SFETCAS_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, "")
    assert anew(long_function()).results == 4
