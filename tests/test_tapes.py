"""Tapes in the cache: the same as those that CasADi tells, whatever lies there."""

import gc
import os

import casadi as ca
import numpy as np
import pytest

from sfetcas.core.building import named
from sfetcas.mathematics import tapes
from sfetcas.mathematics.many import Many
from sfetcas.mathematics.splines import GridSpline, _derivatives
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
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("code", "constant", "splines")
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


def test_equal_operations_are_done_once():
    """Also what takes the same numbers in the other order, and what a function does that is called twice."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    apart = ca.Function("apart", [x], [ca.sin(x), ca.cos(x)], {"never_inline": True})
    # Operations of CasADi's that nothing takes are left out, too.
    first, second = apart(x), apart(x)
    function = ca.Function("twice", [x, y], [x * y + first[0], y * x + second[0], ca.sin(x)])
    tape = tape_of(function)
    kinds = [tapes.NAMES[kind] for kind in tape.code[:, 0]]
    assert sorted(kinds) == sorted(["IN", "IN", "MUL", "SIN", "ADD", "OUT", "OUT", "OUT"])
    at = np.array([[0.3, -0.7]])
    expected = [[np.sin(0.3) - 0.21] * 2 + [np.sin(0.3)]]
    single = ca.Function("twice", [ca.vertcat(x, y)], [ca.vertcat(*function(x, y))])
    np.testing.assert_allclose(Many(single)(at), expected, rtol=1e-14)


def spline(axes, count=6):
    """A spline of two components through random values on a grid of uneven distances, and a generator."""
    random = np.random.default_rng(axes)
    grid = [np.cumsum(random.uniform(0.2, 1.0, count + i)) for i in range(axes)]
    points = int(np.prod([len(places) for places in grid]))
    return GridSpline(grid, random.uniform(-1.0, 1.0, (points, 2))), grid, random


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_splines_are_looked_up_as_scipy_does(axes):
    """All derivatives to the third, within the grid and at its points, on tapes, by another evaluation."""
    from scipy.interpolate import NdBSpline

    through, grid, random = spline(axes)
    place, own = ca.SX.sym("place", axes), through._spline
    within = np.stack([random.uniform(along[0], along[-1], 40) for along in grid], axis=1)
    points = np.stack([random.choice(along[:-1], 40) for along in grid], axis=1)
    shape = (*(len(knots) - 4 for knots in own.knots[::-1]), 2)
    other = NdBSpline(own.knots, own.values.reshape(shape).transpose(*range(axes)[::-1], axes), 3)
    along = [[]]
    for function in _derivatives(own):
        tape = Many(ca.Function("spline", [place], [ca.vec(function(place))]))
        wanted = [np.bincount(one, minlength=axes).tolist() if one else [0] * axes for one in along]
        for at in (within, points):
            expected = np.concatenate([other(at, nu=nu) for nu in wanted], axis=1)
            # Rounding of sums of 64 products.
            np.testing.assert_allclose(tape(at), expected, atol=1e-12 * np.abs(expected).max())
        along = [[*one, axis] for axis in range(axes) for one in along]


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_stiffnesses_of_what_follows_splines(axes):
    """Gradient and Hessian of an energy by CasADi's own splines, within the grid and beyond."""
    through, grid, random = spline(axes)
    place = ca.SX.sym("place", axes)
    energy = ca.dot(through(place), ca.vertcat(place[0], 1.0))
    hessian, gradient = ca.hessian(energy, place)
    function = ca.Function("energy", [place], [ca.densify(ca.vertcat(energy, gradient, ca.vec(hessian)))])
    assert tape_of(function) is not None
    at = np.stack([random.uniform(along[0] - 1.0, along[-1] + 1.0, 100) for along in grid], axis=1)
    expected = np.array([function(one).full().ravel() for one in at])
    np.testing.assert_allclose(Many(function)(at), expected, atol=1e-12 * np.abs(expected).max())


def test_beyond_the_grid_splines_go_on_straight():
    through, grid, _ = spline(2)
    place = ca.SX.sym("place", 2)
    value = through(place)
    function = ca.Function("spline", [place], [ca.vertcat(value, ca.vec(ca.jacobian(value, place)))])
    end = np.array([grid[0][-1], grid[1][2]])
    at, nearer, far = Many(function)(end + np.array([[0.0, 0.0], [0.5, 0.0], [2.0, 0.0]]))
    np.testing.assert_allclose(far - at, 4.0 * (nearer - at), atol=1e-12 * np.abs(far).max())
    assert np.isnan(Many(function)(np.array([[np.nan, 1.0]]))).all()


def test_splines_are_known_as_long_as_an_equal_one_lives():
    through, other = spline(2)[0], spline(2)[0]
    place = ca.SX.sym("place", 2)
    function = ca.Function("spline", [place], [through(place)])
    del other
    gc.collect()
    assert tape_of(function) is not None


def test_tapes_with_splines_are_kept(folder):
    through, _, _ = spline(3)
    place = ca.SX.sym("place", 3)
    value = through(place)
    function = ca.Function("spline", [place], [value, ca.hessian(ca.dot(value, value), place)[0]])
    assert same(anew(function), tapes._read(function))
    assert len(list(folder.iterdir())) == 1
    assert same(anew(function), tapes._read(function))
