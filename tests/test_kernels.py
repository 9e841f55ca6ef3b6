"""Compiled kernels against the virtual machine, and a cache that nothing can spoil."""

import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from sfetcas.mathematics import kernels
from sfetcas.mechanics.elements import Element
from sfetcas.mechanics.terms import curvatures_of, energies_of, rotation_forces, rotation_gradient, slopes_of

ELEMENT = Element(True, 2)
ROTATION_GRADIENT = rotation_gradient(ELEMENT)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SFETCAS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("SFETCAS_KERNELS", raising=False)
    kernels._loaded.cache_clear()
    return tmp_path / "cache"


@pytest.fixture
def compiler():
    if kernels._compiler() is None:
        pytest.skip("no compiler here")


def small(factor=2.0, name="small"):
    x = ca.SX.sym("x", 3)
    return ca.Function(name, [x], [factor * ca.sin(x) * ca.sumsqr(x)], ["x"], ["y"])


def arguments(function, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.normal(size=function.size_in(i)) for i in range(function.n_in())]


def files(folder):
    return sorted(p.name for p in folder.iterdir()) if folder.exists() else []


@pytest.mark.parametrize("made", [energies_of, slopes_of, curvatures_of, rotation_forces, rotation_gradient])
def test_compiled_equals_virtual_machine(cache, compiler, made):
    function = made(ELEMENT)
    machine = kernels.compiled(function)
    assert machine.class_name() != function.class_name()
    for seed in range(3):
        given = arguments(function, seed)
        a, b = function(*given), machine(*given)
        for x, y in zip(*((r if isinstance(r, tuple) else (r,)) for r in (a, b)), strict=True):
            x, y = x.full(), y.full()
            # Same operations; contraction to fused multiply-adds changes last digits of sums of such size.
            np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-13 * max(1.0, np.abs(x).max()))


def test_second_call_takes_the_file(cache, compiler, monkeypatch):
    kernels.compiled(small())
    before = files(cache)
    assert len(before) == 1
    assert before[0].startswith("small-")
    monkeypatch.setattr(kernels.subprocess, "run", lambda *a, **k: pytest.fail("compiled again"))
    kernels._loaded.cache_clear()
    assert kernels.compiled(small())([1, 2, 3]).full() == pytest.approx(small()([1, 2, 3]).full())


def test_key_is_the_content(cache, compiler):
    two, three = kernels.compiled(small(2.0)), kernels.compiled(small(3.0))
    assert len(files(cache)) == 2
    # Same name and shapes, other content: never the other's file.
    np.testing.assert_allclose(three([1, 2, 3]).full(), 1.5 * two([1, 2, 3]).full(), rtol=1e-15)


@pytest.mark.parametrize("how", ["truncated", "emptied", "another", "a pipe"])
def test_a_library_that_is_not_what_was_compiled_is_never_loaded(how, cache, compiler):
    kernels.compiled(small())
    kernels.compiled(small(3.0, "other"))
    (path,) = (file for file in cache.iterdir() if file.name.startswith("small-"))
    (other,) = (file for file in cache.iterdir() if file.name.startswith("other-"))
    whole = path.read_bytes()
    # In a process of its own: what is mapped would end it where it was cut off.
    path.unlink()
    if how == "a pipe":
        os.mkfifo(path)
    else:
        path.write_bytes({"truncated": whole[: len(whole) // 2], "emptied": b"", "another": other.read_bytes()}[how])
    run = subprocess.run([sys.executable, "-c", AGAIN], capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 0, run.stderr
    assert path.read_bytes() == whole
    assert len(files(cache)) == 2


AGAIN = """
import casadi as ca, numpy as np
from sfetcas.mathematics import kernels
x = ca.SX.sym('x', 3)
f = ca.Function('small', [x], [2.0 * ca.sin(x) * ca.sumsqr(x)], ['x'], ['y'])
g = kernels.compiled(f)
assert g is not f
np.testing.assert_allclose(g([1, 2, 3]).full(), f([1, 2, 3]).full(), rtol=1e-14)
"""


def test_the_folder_is_private(cache, compiler):
    kernels.compiled(small())
    assert cache.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("how", ["group", "others", "somebody else"])
def test_a_folder_that_others_fill_is_not_used(how, cache, compiler, monkeypatch):
    kernels.compiled(small())
    kernels._loaded.cache_clear()
    before = files(cache)
    if how == "somebody else":
        owner = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
        monkeypatch.setattr(kernels, "RULER", owner + 2)
    else:
        cache.chmod({"group": 0o770, "others": 0o707}[how])
    for function in (small(), small(3.0)):
        with pytest.warns(UserWarning, match="no kernels are taken from this folder.*accepted: a folder of your own"):
            assert kernels.compiled(function) is function
    assert files(cache) == before


def test_interrupted_write_leaves_nothing(cache, compiler, monkeypatch):
    def interrupted(command, **_):
        Path(command[command.index("-o") + 1]).write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(kernels.subprocess, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        kernels.compiled(small())
    assert files(cache) == []


def test_failing_compiler_and_none_at_all(cache, monkeypatch):
    def fails(command, **_):
        raise subprocess.CalledProcessError(1, command)

    monkeypatch.setattr(kernels, "_compiler", lambda: "cc")
    monkeypatch.setattr(kernels.subprocess, "run", fails)
    function = small()
    assert kernels.compiled(function) is function
    monkeypatch.setattr(kernels, "_compiler", lambda: None)
    assert kernels.compiled(function) is function
    assert files(cache) == []


def test_folder_that_cannot_be_written(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setenv("SFETCAS_CACHE", str(blocked))
    function = small()
    assert kernels.compiled(function) is function


def test_concurrent_processes(cache, compiler):
    source = str(Path(kernels.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": source}
    running = [
        subprocess.Popen([sys.executable, "-c", AGAIN], env=environment, stderr=subprocess.PIPE) for _ in range(3)
    ]
    for process in running:
        error = process.communicate(timeout=60)[1]
        assert process.returncode == 0, error.decode()
    assert len(files(cache)) == 1  # no folder or half file is left


def test_where_it_pays(cache, compiler, monkeypatch):
    function = small()
    assert kernels.chosen(function, 10.0) is function
    assert files(cache) == []
    assert kernels.chosen(function, 1e9) is not function
    assert len(files(cache)) == 1
    # Once it is there it is taken as soon as time is spent at all, and compiling alone would not pay.
    calls = 0.5 * kernels.COMPILE_SECONDS_PER_INSTRUCTION / kernels.SECONDS_PER_INSTRUCTION
    large = ROTATION_GRADIENT
    assert kernels.chosen(large, calls) is large
    kernels.compiled(large)
    assert kernels.chosen(large, calls) is not large
    monkeypatch.setenv("SFETCAS_KERNELS", "interpreted")
    assert kernels.chosen(function, 1e9) is function
    monkeypatch.setenv("SFETCAS_KERNELS", "compiled")
    assert kernels.chosen(function, 1.0) is not function
    # What is asked for by argument comes before the environment.
    assert kernels.chosen(function, 1e9, "interpreted") is function
    monkeypatch.delenv("SFETCAS_KERNELS")
    assert kernels.chosen(function, 1.0, "compiled") is not function


def test_cache_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("SFETCAS_CACHE", "/somewhere/else")
    assert kernels.cache_folder() == Path("/somewhere/else")
    monkeypatch.delenv("SFETCAS_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert kernels.cache_folder() == tmp_path / "sfetcas"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert kernels.cache_folder() == tmp_path / ".cache" / "sfetcas"
    # Never in the folder in which the program runs.
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert kernels.cache_folder() == tmp_path / ".cache" / "sfetcas"
    for nowhere in ("", "relative"):
        monkeypatch.setenv("HOME", nowhere)
        assert kernels.cache_folder() is None


def test_without_a_home_nothing_is_compiled(monkeypatch):
    def nobody():
        raise RuntimeError("Could not determine home directory.")

    for name in ("SFETCAS_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", nobody)
    assert kernels.chosen(ROTATION_GRADIENT, 1e9) is kernels.compiled(ROTATION_GRADIENT) is ROTATION_GRADIENT


@pytest.mark.parametrize("n", [1, 2, 7])
def test_batch_is_the_function_n_times(n):
    function = ROTATION_GRADIENT
    batch = kernels.Batch(function, n)
    rng = np.random.default_rng(n)
    for _ in range(2):
        given = [rng.normal(size=(n, function.size2_in(i), function.size1_in(i))) for i in range(function.n_in())]
        for i, values in enumerate(given):
            if values.size:
                batch.set(i, values)
        results = batch()
        for k in range(n):
            for found, one in zip(results, function(*[values[k].T for values in given]), strict=True):
                np.testing.assert_allclose(found[k], one.full().ravel(order="F"), rtol=1e-14, atol=1e-14)


def solving():
    a, b = ca.MX.sym("a", 4), ca.MX.sym("b", 2)
    return ca.Function("solving", [a, b], [ca.solve(ca.reshape(a, 2, 2), b, "qr", {"eps": 1e-300})])


def test_direct_calls_are_those_of_casadi():
    """Also of results with zeros that CasADi does not store, and of what it cannot compute."""
    direct, numbers = kernels.Direct(solving()), np.array([2.0, 0.0, 1.0, 3.0])
    for call in (direct, pickle.loads(pickle.dumps(direct))):
        np.testing.assert_array_equal(call(numbers, np.ones(2)), solving()(numbers, np.ones(2)).full().ravel())
        assert np.isnan(call(0.0 * numbers, np.ones(2))).all()
        np.testing.assert_array_equal(call(numbers, np.ones(2)), solving()(numbers, np.ones(2)).full().ravel())
    x = ca.MX.sym("x", 0)
    sparse = ca.Function("sparse", [x], [ca.MX(ca.DM(ca.Sparsity.triplet(3, 1, [1], [0]), [4.0]))])
    np.testing.assert_array_equal(kernels.Direct(sparse)(np.zeros(0)), [0.0, 4.0, 0.0])


def test_direct_calls_in_threads_have_memory_of_their_own():
    """Slow functions: two threads that shared memory would take each other's numbers."""
    x = ca.MX.sym("x", 200)
    y = x
    for _ in range(200):
        y = ca.sin(y) + x
    direct, given = kernels.Direct(ca.Function("slow", [x], [y])), np.random.default_rng(0).normal(size=(64, 200))
    expected = [direct(one) for one in given]
    with ThreadPoolExecutor(4) as pool:
        for one, other in zip(pool.map(direct, given), expected, strict=True):
            np.testing.assert_array_equal(one, other)
