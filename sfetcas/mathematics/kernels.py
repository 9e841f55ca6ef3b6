"""Element functions applied to many elements at once, on CasADi's virtual machine or compiled.

A kernel depends on the element type only, never on a scene, so a compiled one is kept in a cache on disk,
keyed by its content, by CasADi's version and by the compiler.  A library is compiled beside its final name and
moved there in one step: processes that run at once and interrupted writes leave nothing half-written.  Its name ends
with the checksum of what it holds, so that neither is ever without the other: what was cut short or changed is
compiled anew, never loaded.  Nor is anything from a folder that somebody else owns or may write to.
Without a compiler, and without such a folder, everything runs on the virtual machine.
"""

from __future__ import annotations

import contextlib
import contextvars
import functools
import hashlib
import os
import platform
import stat
import subprocess
import tempfile
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import casadi as ca
import numpy as np

from ..core.building import compiler, named
from ..files import UnreadableError, read_file
from .arrays import Array
from .source import loadable

__all__ = [
    "Batch",
    "Direct",
    "Kernels",
    "cache_folder",
    "chosen",
    "compiled",
    "interpreted",
    "made_apart",
    "private",
    "switched_on",
    "whole_files",
]

Kernels = Literal["auto", "core", "compiled", "interpreted"]
"""How equations are evaluated: by the core, or in Python with functions of elements compiled or interpreted."""

FLAGS = ("-fPIC", "-shared", "-fno-math-errno")

STRAIGHT, LOOPS = "-O1", "-O3"
"""Straight-line code runs as fast with -O1, which compiles three times faster; loops gain a third by -O3."""

SECONDS_PER_INSTRUCTION = 5e-9
"""What the virtual machine spends on an instruction (measured 4 to 6 ns)."""

COMPILE_SECONDS = 0.06
"""What a compiler spends on nothing."""

COMPILE_SECONDS_PER_INSTRUCTION = 8e-5
"""What the compiler spends on an instruction (measured: 16,000 instructions in 1.3 s)."""


LIBRARY, LARGEST = ".so", 100_000_000
"""End of the names of libraries, and bytes of a file that is looked at; those of kernels have up to a few million."""

RULER = 0
"""Who may do anything on a machine, by number."""

COUNTED = 128
"""Functions whose instructions are remembered, and which live as long: those of a model and its kinds of parts."""

LOADED = 256
"""Libraries that are kept at hand, some for each kind of element; one that is not is read again."""


def cache_folder() -> Path | None:
    """Folder of compiled kernels: $SFETCAS_CACHE, else one in the user's cache; None where there is no safe folder."""
    given = os.environ.get("SFETCAS_CACHE")
    if given:
        return Path(given)
    try:
        usual = Path.home() / ".cache" if os.environ.get("HOME") != "" else None
    except RuntimeError:
        # Nobody knows this user.
        usual = None
    # What is no path from the root is to be ignored; it would be a place in whatever folder the program runs in.
    places = (place for place in (Path(os.environ.get("XDG_CACHE_HOME", "")), usual) if place and place.is_absolute())
    return next((place / "sfetcas" for place in places), None)


@functools.cache
def _compiler() -> str | None:
    return compiler()


def _flags(function: ca.Function) -> tuple[str, ...]:
    return (STRAIGHT if function.is_a("SXFunction") else LOOPS, *FLAGS)


def _key(function: ca.Function) -> str:
    """Beginning of the name of the compiled library of a function; its checksum follows."""
    flags = _flags(function)
    content = "\n".join([function.serialize(), ca.CasadiMeta.version(), platform.machine(), *flags, str(_compiler())])
    return f"{function.name()}-{hashlib.sha256(content.encode()).hexdigest()[:24]}-"


def private(folder: Path) -> bool:
    """Whether only this user, or the one who rules the machine, can have put anything into a folder."""
    found = folder.stat()
    if not stat.S_ISDIR(found.st_mode):
        raise NotADirectoryError
    if not hasattr(os, "geteuid"):
        return True
    foreign = found.st_uid not in (os.geteuid(), RULER)
    if foreign or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        why = "it belongs to somebody else" if foreign else "others may write to it"
        message = f"{folder}: no kernels are taken from this folder or compiled, which costs time only, as {why}"
        warnings.warn(
            f"{message}; accepted: a folder of your own of mode 700, or another one as SFETCAS_CACHE", stacklevel=1
        )
        return False
    return True


def whole_files(folder: Path, key: str, suffix: str) -> Iterator[tuple[Path, bytes]]:
    """Files of a folder whose names begin so and which hold what their names say, with their contents.

    None of a folder into which others may have put them.

    Raises
    ------
    OSError
        There is no such folder.
    """
    if private(folder):
        for path in (folder / entry for entry in os.listdir(folder) if entry.startswith(key)):
            with contextlib.suppress(UnreadableError):
                content = read_file(path, LARGEST)
                if named(key, content, suffix) == path.name:
                    yield path, content


@contextlib.contextmanager
def made_apart(folder: Path) -> Iterator[Path | None]:
    """A place within a folder for what is then moved into it in one step; None where others may write to the folder.

    What is left at the place goes with it.

    Raises
    ------
    OSError
        The folder cannot be made, or not be written to.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not private(folder):
        yield None
        return
    with tempfile.TemporaryDirectory(dir=folder) as place:
        yield Path(place)


@functools.lru_cache(maxsize=LOADED)
def _loaded(name: str, key: str, folder: Path) -> ca.Function:
    """The function in the library of a key; OSError where there is none that is whole and can be loaded."""
    for path, _ in whole_files(folder, key, LIBRARY):
        with contextlib.suppress(RuntimeError):
            return ca.external(name, str(path))
    raise FileNotFoundError


def _load(function: ca.Function, folder: Path | None) -> ca.Function | None:
    """The compiled function from the cache, or None."""
    if folder is None:
        return None
    try:
        return _loaded(function.name(), _key(function), folder)
    except OSError:
        return None


def compiled(function: ca.Function) -> ca.Function:
    """The function compiled to machine code, from the cache or compiled now; itself where there is no compiler."""
    folder = cache_folder()
    return _load(function, folder) or (_compile(function, folder) and _load(function, folder)) or function


def _compile(function: ca.Function, place: Path | None) -> bool:
    """Put the library of a function into the cache; whether that went well."""
    program = _compiler()
    if program is None or place is None:
        return False
    try:
        with made_apart(place) as folder:
            if folder is None:
                return False
            source, library = folder / f"{function.name()}.c", folder / "library.so"
            source.write_text(loadable(function))
            command = [program, *_flags(function), "-o", str(library), str(source), "-lm"]
            # What the compiler itself leaves where it is interrupted goes with the folder.
            subprocess.run(command, check=True, capture_output=True, env={**os.environ, "TMPDIR": str(folder)})
            os.replace(library, place / named(_key(function), library.read_bytes(), LIBRARY))
    except (OSError, subprocess.CalledProcessError):
        return False
    return True


@functools.lru_cache(maxsize=COUNTED)
def _instructions(function: ca.Function) -> tuple[float, float]:
    """Instructions that a call runs, and that the source has; those of a short function are run twice as fast."""
    if function.is_a("Map"):
        parts = function.info()
        run, written = _instructions(parts["f"])
        return 0.5 * parts["n"] * run, written
    if not function.is_a("MXFunction"):
        return float(function.n_instructions()), float(function.n_instructions())
    total, sources = 0.0, {function.__hash__(): float(function.n_instructions())}
    for k in range(function.n_instructions()):
        if function.instruction_id(k) == ca.OP_CALL:
            called = function.instruction_MX(k).which_function()
            run, written = _instructions(called)
            total, sources[called.__hash__()] = total + run, written
        elif function.instruction_id(k) not in (ca.OP_INPUT, ca.OP_OUTPUT):
            # Loops over what comes out.
            total += LOOPED * function.instruction_MX(k).nnz()
    return total, sum(sources.values())


LOOPED = 0.5
"""What a number costs that a loop makes, in instructions: most of these are sums of products."""


_INTERPRETED = contextvars.ContextVar("interpreted", default=False)


@contextlib.contextmanager
def switched_on(variable: contextvars.ContextVar[bool]) -> Iterator[None]:
    """Context manager within which a variable is true."""
    token = variable.set(True)
    try:
        yield
    finally:
        variable.reset(token)


def interpreted() -> contextlib.AbstractContextManager[None]:
    """Context manager within which nothing is compiled and no compiled function is loaded."""
    return switched_on(_INTERPRETED)


def chosen(function: ca.Function, calls: float, kernels: Kernels = "auto") -> ca.Function:
    """The function interpreted or compiled, as requested or as it pays.

    Parameters
    ----------
    calls : float
        Expected number of calls.  ``auto`` compiles where interpreting would take longer than compiling, and loads a
        cached library where that is worth it; $SFETCAS_KERNELS replaces ``auto`` by ``compiled`` or ``interpreted``.
    """
    way = os.environ.get("SFETCAS_KERNELS", "auto") if kernels == "auto" else kernels
    if way == "interpreted" or _INTERPRETED.get():
        return function
    run, written = _instructions(function)
    spent = calls * run * SECONDS_PER_INSTRUCTION
    if way == "compiled" or spent > COMPILE_SECONDS + written * COMPILE_SECONDS_PER_INSTRUCTION:
        return compiled(function)
    # Looking into the cache costs a serialization: worth it only where time is spent at all.
    return (_load(function, cache_folder()) or function) if spent > 0.02 else function


class Batch:
    """A function applied to n sets of arguments, without copies between NumPy and CasADi.

    Arrays are read and written in place: the last axes of an argument are CasADi's column-major entries.
    """

    def __init__(self, function: ca.Function, n: int) -> None:
        self._n = n
        self._function = function.map(n) if n > 1 else function
        buffer: Any
        buffer, self._call = self._function.buffer()
        self._buffer = buffer
        self._arguments: list[Array] = [np.zeros((n, function.nnz_in(i))) for i in range(function.n_in())]
        self.results: list[Array] = [np.zeros((n, function.nnz_out(i))) for i in range(function.n_out())]
        if n == 0:
            return
        for i, array in enumerate(self._arguments):
            self._buffer.set_arg(i, array.data)
        for i, array in enumerate(self.results):
            self._buffer.set_res(i, array.data)

    def set(self, i: int, values: Array) -> None:
        """Set argument i for all n sets: an array (n, ...)."""
        self._arguments[i][...] = values.reshape(self._arguments[i].shape)

    def __call__(self) -> list[Array]:
        """Evaluate; the arrays returned are overwritten by the next call."""
        if self._n:
            self._call()
        return self.results


class Direct:
    """A function of dense columns with one result, called with arrays; calls in threads do not disturb each other.

    A call takes 3 instead of 25 microseconds of conversions; what CasADi fails to compute is nan.
    """

    def __init__(self, function: ca.Function) -> None:
        if not function.sparsity_out(0).is_dense():
            given = function.mx_in()
            function = ca.Function(function.name(), given, [ca.densify(function(*given))])
        self.__setstate__(function)

    def __getstate__(self) -> ca.Function:
        return self._function

    def __setstate__(self, function: ca.Function) -> None:
        self._function, self._own = function, threading.local()

    def __call__(self, *arguments: Array) -> Array:
        """The result, flat."""
        batch: Batch | None = getattr(self._own, "batch", None)
        if batch is None:
            batch = self._own.batch = Batch(self._function, 1)
        for i, values in enumerate(arguments):
            if values.size:
                batch.set(i, values)
        batch.results[0][...] = np.nan
        return batch()[0].ravel().copy()
