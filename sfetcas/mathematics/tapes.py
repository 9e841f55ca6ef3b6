"""CasADi functions as tapes, the lists of operations that the core runs.

To read thousands of operations from CasADi one by one takes a tenth of a second, so long tapes are kept in the cache of
compiled kernels, named by what their function is and by what they hold.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from ..core.building import named
from .arrays import Array
from .kernels import cache_folder, made_apart, whole_files

__all__ = ["KEPT", "NAMES", "Tape", "tape_of"]

# fmt: off
NAMES = [
    "IN", "OUT", "CONSTANT", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "SQ", "TWICE", "SQRT", "INV",
    "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "EXP", "LOG", "EXPM1", "LOG1P", "POW",
    "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ERF", "HYPOT", "FABS", "SIGN", "COPYSIGN", "FMIN",
    "FMAX", "FMOD", "REMAINDER", "FLOOR", "CEIL", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF",
]
# fmt: on
"""Operations of the core by name, in the order of its ``tape.c``."""

OTHERS = {
    "CONST": "CONSTANT",
    "INPUT": "IN",
    "OUTPUT": "OUT",
    "IF_ELSE_ZERO": "IF",
    "CONSTPOW": "POW",
    "LIFT": "ASSIGN",
}
"""What CasADi calls some of them."""

KEPT = 256
"""Functions whose tapes are kept at hand: those of the kinds of terms of some models."""


LONG = 10_000
"""Bytes of a serialised function from which on its tape is kept."""

SUFFIX = ".npz"

FILES = 100
"""Tapes that are kept on disk: laws with numbers of their own have their own functions, and there may be many."""


@dataclass(frozen=True, eq=False)
class Tape:
    """A function of SX as a list of operations.

    Attributes
    ----------
    code : ndarray (operations, 4) of int32
        Operation, slot of the result, and slots of what it takes.
    constant : ndarray (constants,)
    slots, arguments, results : int
        Numbers of slots, and of the entries of all arguments and all results, one after the other.
    parts : tuple of int
        Where each result begins among all, and their number.
    """

    code: Array
    constant: Array
    slots: int
    arguments: int
    results: int
    parts: tuple[int, ...]


@functools.cache
def _operations() -> dict[int, int]:
    """Number of the core's operation by that of CasADi."""
    theirs = {name[3:]: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
    names = {OTHERS.get(name, name): number for name, number in theirs.items() if name not in ("IN", "IF")}
    found = {names[name]: number for number, name in enumerate(NAMES)}
    return found | {theirs[name]: NAMES.index(ours) for name, ours in OTHERS.items()}


@functools.lru_cache(maxsize=KEPT)
def tape_of(function: ca.Function) -> Tape | None:
    """The tape of a function; None of one that has other operations than those of scalars."""
    content, folder = function.serialize(), cache_folder()
    if len(content) < LONG or folder is None:
        return _read(function)
    text = "\n".join([content, ca.CasadiMeta.version(), *NAMES])
    key = f"tape-{hashlib.sha256(text.encode()).hexdigest()[:24]}-"
    found = _kept(folder, key)
    if found is None and (found := _read(function)) is not None:
        _keep(folder, key, found)
    return found


def _kept(folder: Path, key: str) -> Tape | None:
    """The tape in a file of a folder whose name begins so, if there is one that is whole."""
    with contextlib.suppress(OSError):
        for _, content in whole_files(folder, key, SUFFIX):
            # Named as by this program, but not of this form.
            broken = contextlib.suppress(ValueError, KeyError, zipfile.BadZipFile)
            with broken, np.load(io.BytesIO(content), allow_pickle=False) as parts:
                slots, arguments, results = parts["sizes"].tolist()
                where = tuple(parts["parts"].tolist())
                return Tape(parts["code"], parts["constant"], slots, arguments, results, where)
    return None


def _keep(folder: Path, key: str, tape: Tape) -> None:
    """Put a tape into a folder, if that is possible, and take out the oldest ones that are too many."""
    content, sizes = io.BytesIO(), (tape.slots, tape.arguments, tape.results)
    np.savez(content, code=tape.code, constant=tape.constant, sizes=sizes, parts=tape.parts)
    with contextlib.suppress(OSError), made_apart(folder) as place:
        if place is None:
            return
        (place / "made").write_bytes(content.getvalue())
        os.replace(place / "made", folder / named(key, content.getvalue(), SUFFIX))
        for path in sorted(folder.glob(f"tape-*{SUFFIX}"), key=lambda path: path.stat().st_mtime)[:-FILES]:
            path.unlink(missing_ok=True)


def _read(function: ca.Function) -> Tape | None:
    """The tape of a function from its instructions."""
    try:
        scalar = function if function.is_a("SXFunction") else function.expand()
    except RuntimeError:
        return None
    known = _operations()
    inputs = np.cumsum([0, *(scalar.nnz_in(i) for i in range(scalar.n_in()))]).tolist()
    outputs = np.cumsum([0, *(scalar.nnz_out(i) for i in range(scalar.n_out()))]).tolist()
    code, constant = list[tuple[int, int, int, int]](), list[float]()
    for k in range(scalar.n_instructions()):
        theirs = scalar.instruction_id(k)
        to, taken = scalar.instruction_output(k), scalar.instruction_input(k)
        operation = known.get(theirs)
        if operation is None:
            return None
        if theirs == ca.OP_INPUT:
            code.append((operation, to[0], inputs[taken[0]] + taken[1], 0))
        elif theirs == ca.OP_OUTPUT:
            code.append((operation, outputs[to[0]] + to[1], taken[0], 0))
        elif theirs == ca.OP_CONST:
            code.append((operation, to[0], len(constant), 0))
            constant.append(scalar.instruction_constant(k))
        else:
            code.append((operation, to[0], taken[0], taken[-1]))
    table = np.array(code, np.int32).reshape(-1, 4)
    return Tape(table, np.array(constant), scalar.sz_w(), inputs[-1], outputs[-1], tuple(outputs))
