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
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from ..core.building import named
from .arrays import Array
from .kernels import cache_folder, made_apart, whole_files
from .splines import Knotted, spline_of

__all__ = ["KEPT", "NAMES", "Tape", "tape_of"]

# fmt: off
NAMES = [
    "IN", "OUT", "CONSTANT", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "SQ", "TWICE", "SQRT", "INV",
    "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "EXP", "LOG", "EXPM1", "LOG1P", "POW",
    "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ERF", "HYPOT", "FABS", "SIGN", "COPYSIGN", "FMIN",
    "FMAX", "FMOD", "REMAINDER", "FLOOR", "CEIL", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF", "SPLINE",
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
        Constants, then knots and coefficients of splines.
    slots, arguments, results : int
        Numbers of slots, and of the entries of all arguments and all results, one after the other.
    parts : tuple of int
        Where each result begins among all, and their number.
    splines : ndarray of int
        What of which spline is taken: rows that begin with where in it that spline stands, its component, and the order
        of the derivative along each of three axes; then for each spline axes, components, coefficients along each axis,
        and where among the constants its knots begin, which its coefficients follow.
    """

    code: Array
    constant: Array
    slots: int
    arguments: int
    results: int
    parts: tuple[int, ...]
    splines: Array


@functools.cache
def _operations() -> dict[int, int]:
    """Number of the core's operation by that of CasADi."""
    theirs = {name[3:]: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
    names = {OTHERS.get(name, name): number for name, number in theirs.items() if name not in ("IN", "IF")}
    found = {names[name]: number for number, name in enumerate(NAMES) if name in names}
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
                return Tape(parts["code"], parts["constant"], slots, arguments, results, where, parts["splines"])
    return None


def _keep(folder: Path, key: str, tape: Tape) -> None:
    """Put a tape into a folder, if that is possible, and take out the oldest ones that are too many."""
    content, sizes = io.BytesIO(), (tape.slots, tape.arguments, tape.results)
    arrays = {"code": tape.code, "constant": tape.constant, "splines": tape.splines}
    np.savez(content, sizes=sizes, parts=tape.parts, **arrays)  # type: ignore[arg-type]
    with contextlib.suppress(OSError), made_apart(folder) as place:
        if place is None:
            return
        (place / "made").write_bytes(content.getvalue())
        os.replace(place / "made", folder / named(key, content.getvalue(), SUFFIX))
        for path in sorted(folder.glob(f"tape-*{SUFFIX}"), key=lambda path: path.stat().st_mtime)[:-FILES]:
            path.unlink(missing_ok=True)


def _read(function: ca.Function) -> Tape | None:
    """The tape of a function from its instructions."""
    reader = _Reader()
    arguments = np.cumsum([0, *(function.nnz_in(i) for i in range(function.n_in()))])
    parts = np.cumsum([0, *(function.nnz_out(i) for i in range(function.n_out()))]).tolist()
    try:
        reader.read(function)
    except (RuntimeError, KeyError):
        return None
    code, slots = reader.code()
    return Tape(code, reader.constants(), slots, int(arguments[-1]), parts[-1], tuple(parts), reader.splines())


IN, OUT, CONSTANT, ASSIGN, SPLINE = map(NAMES.index, ("IN", "OUT", "CONSTANT", "ASSIGN", "SPLINE"))

COMMUTATIVE = frozenset(map(NAMES.index, ("ADD", "MUL")))
"""Operations that give the same bits in either order."""

PUTS, TAKES_NONE = frozenset((OUT, ASSIGN)), frozenset((IN, CONSTANT, SPLINE))
"""Operations that put the value b somewhere, and those that take no values; all others take two."""


class _Reader:
    """The operations of a function, with those of what it calls in the place of each call, and equal ones once.

    An operation (kind, a, b) is the value that it computes, and takes others by number.  ``OUT`` is the result a;
    ``IN`` and ``CONSTANT`` are the a-th one.  ``ASSIGN`` puts a coordinate into slot a, ``SPLINE`` finds it beside
    others from slot a on, with the row b of what is looked up.
    """

    def __init__(self) -> None:
        self._operations, self._known = list[tuple[int, int, int]](), dict[tuple[int, int, int], int]()
        self._constants, self._places, self._held = dict[str, int](), dict[tuple[int, ...], int](), 0
        self._splines, self._rows = list[Knotted](), dict[tuple[int, ...], int]()

    def constants(self) -> Array:
        """See :class:`Tape`."""
        numbers = [part for spline in self._splines for part in (*spline.knots, spline.values)]
        return np.concatenate([np.array([float.fromhex(number) for number in self._constants], dtype=float), *numbers])

    def splines(self) -> Array:
        """See :class:`Tape`."""
        rows, shapes, first = np.array([*self._rows], np.int32).reshape(-1, 5), list[int](), len(self._constants)
        begins = np.zeros(len(self._splines), np.int32)
        for i, spline in enumerate(self._splines):
            begins[i] = rows.size + len(shapes)
            along = [len(knots) - 4 for knots in spline.knots]
            shapes += [len(along), spline.components, *along, first]
            first += sum(map(len, spline.knots)) + len(spline.values)
        rows[:, 0] = begins[rows[:, 0]]
        return np.concatenate([rows.ravel(), np.array(shapes, np.int32)])

    def code(self) -> tuple[Array, int]:
        """The operations whose values anything takes, see :class:`Tape`, and how many slots they need."""
        operations, last = self._operations, [-1] * len(self._operations)
        for k in range(len(operations) - 1, -1, -1):
            kind, a, b = operations[k]
            if kind in PUTS or (kind not in TAKES_NONE and last[k] >= 0):
                last[b] = k if last[b] < 0 else last[b]
                if kind not in PUTS and last[a] < 0:
                    last[a] = k
        slots, unused, slot, found = self._held, list[int](), [-1] * len(last), list[tuple[int, int, int, int]]()
        for k, (kind, a, b) in enumerate(operations):
            if kind in PUTS:
                found.append((kind, a, slot[b], slot[b]))
                if last[b] == k:
                    unused.append(slot[b])
                continue
            if last[k] < 0:
                continue
            taken = (a, b) if kind in TAKES_NONE else (slot[a], slot[b])
            if kind not in TAKES_NONE:
                if last[a] == k:
                    unused.append(slot[a])
                if last[b] == k and a != b:
                    unused.append(slot[b])
            if not unused:
                unused.append(slots)
                slots += 1
            slot[k] = unused.pop()
            found.append((kind, slot[k], *taken))
        return np.array(found, np.int32).reshape(-1, 4), slots

    def read(self, function: ca.Function, given: Sequence[int] | None = None) -> list[int]:
        """Append the operations of a function; returns the values of its results.

        ``given`` are the values of its arguments where it is called.

        Raises
        ------
        RuntimeError, KeyError
            It has operations that the core does not know.
        """
        scalar, known = function if function.is_a("SXFunction") else function.expand(), _operations()
        inputs = np.cumsum([0, *(scalar.nnz_in(i) for i in range(scalar.n_in()))]).tolist()
        outputs = np.cumsum([0, *(scalar.nnz_out(i) for i in range(scalar.n_out()))]).tolist()
        found, held, nodes = [0] * outputs[-1], [0] * scalar.sz_w(), None
        kind_of, results_of, taken_by = scalar.instruction_id, scalar.instruction_output, scalar.instruction_input
        values, operations, plain = self._known, self._operations, {*known} - {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        for k in range(scalar.n_instructions()):
            theirs, to, by = kind_of(k), results_of(k), taken_by(k)
            if theirs in plain:
                kind, a, b = known[theirs], held[by[0]], held[by[-1]]
                if kind in COMMUTATIVE and b < a:
                    a, b = b, a
                # As of _value, which would take half of the time.
                value = a if kind == ASSIGN else values.setdefault((kind, a, b), len(operations))
                if value == len(operations):
                    operations.append((kind, a, b))
                held[to[0]] = value
            elif theirs == ca.OP_CALL:
                nodes = scalar.instructions_sx() if nodes is None else nodes
                results = self._called(nodes[k].which_function(), [held[one] for one in by])
                for one, value in zip(to, results, strict=True):
                    if one >= 0:
                        held[one] = value
            elif theirs == ca.OP_INPUT:
                number = inputs[by[0]] + by[1]
                held[to[0]] = self._value(IN, number, 0) if given is None else given[number]
            elif theirs == ca.OP_OUTPUT:
                number = outputs[to[0]] + to[1]
                found[number] = held[by[0]]
                if given is None:
                    self._operations.append((OUT, number, found[number]))
            elif theirs == ca.OP_CONST:
                held[to[0]] = self._constant(scalar.instruction_constant(k))
            else:
                raise KeyError(theirs)
        return found

    def _value(self, kind: int, a: int, b: int) -> int:
        """The value of an operation, which is appended where there is no equal one."""
        found = self._known.setdefault((kind, a, b), len(self._operations))
        if found == len(self._operations):
            self._operations.append((kind, a, b))
        return found

    def _constant(self, number: float) -> int:
        # Zeros of both signs are equal, and what is not a number is not.
        return self._value(CONSTANT, self._constants.setdefault(number.hex(), len(self._constants)), 0)

    def _called(self, function: ca.Function, given: Sequence[int]) -> list[int]:
        """The values of the results of a function that is called with values."""
        found = spline_of(function)
        if found is None:
            return self.read(function, given)
        spline, order = found
        axes = len(spline.knots)
        place = self._places.setdefault(tuple(given[:axes]), self._held)
        if place == self._held:
            self._operations += [(ASSIGN, place + i, value) for i, value in enumerate(given[:axes])]
            self._held += axes
        if spline not in self._splines:
            self._splines.append(spline)
        rows = []
        for number in range(spline.components * axes**order):
            derivatives = [number // spline.components // axes**i % axes for i in range(order)]
            along = (derivatives.count(axis) for axis in range(3))
            row = (self._splines.index(spline), number % spline.components, *along)
            rows.append(self._rows.setdefault(row, len(self._rows)))
        return [self._value(SPLINE, place, 5 * row) for row in rows]
