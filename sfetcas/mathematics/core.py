"""The core in C in this process: its library, found or compiled, and what is handed to it.

A library is looked for beside the sources, where installing has put it, then in the cache of compiled kernels, where it
is compiled at the first use if there is a compiler and ``$SFETCAS_KERNELS`` is not ``interpreted``.  One that was made
from other sources or for another machine has another name, one that was cut short or changed another checksum, and what
does not agree on the sizes of structures is not used.  ``$SFETCAS_CORE=off`` does without.
"""

from __future__ import annotations

import contextlib
import contextvars
import ctypes
import functools
import os
from pathlib import Path

import numpy as np

from ..core.building import SOURCES, compile_core, prefix, whole
from .arrays import Array
from .kernels import cache_folder, private, switched_on
from .tapes import KEPT, NAMES, Tape

__all__ = [
    "Advance",
    "Border",
    "Cases",
    "Counting",
    "Curve",
    "Factors",
    "Flat",
    "Group",
    "Inputs",
    "Limits",
    "Map",
    "Model",
    "Motion",
    "Observables",
    "Pivoted",
    "Point",
    "Report",
    "Rules",
    "Sought",
    "State",
    "Sums",
    "System",
    "TapeTable",
    "Told",
    "Way",
    "core",
    "doubles",
    "integers",
    "table_of",
    "without_core",
]

_int, _double, _pointer = ctypes.c_int, ctypes.c_double, ctypes.c_void_p


class TapeTable(ctypes.Structure):
    """``sf_tape``."""

    _fields_ = (
        *((name, _int) for name in ("stretches", "slots", "arguments", "results", "constants")),
        ("stretch", _pointer),
        ("code", _pointer),
        ("constant", _pointer),
        ("spline", _pointer),
        ("compiled", _pointer),
    )


class Map(ctypes.Structure):
    """``sf_map``."""

    _fields_ = (("rows", _int), ("columns", _int), ("start", _pointer), ("column", _pointer), ("value", _pointer))


class Sums(ctypes.Structure):
    """``sf_sums``."""

    _fields_ = (("count", _int), ("start", _pointer), ("from", _pointer), ("weight", _pointer))


class Group(ctypes.Structure):
    """``sf_group``."""

    _fields_ = (
        ("tape", _pointer),
        *((name, _int) for name in ("terms", "turns", "places", "data", "loads", "rows")),
        ("turn", _pointer),
        ("place", _pointer),
        ("datum", _pointer),
        ("angle", _int),
        ("row", _pointer),
        *((name, _int) for name in ("load", "result", "rests", "gradient", "jacobian", "proportional")),
    )


class Model(ctypes.Structure):
    """``sf_model``."""

    _fields_ = (
        *((name, _int) for name in ("space", "components", "turning", "axes")),
        *((name, _int) for name in ("rotations", "places", "displacements", "rows", "closings", "angles")),
        *((name, _int) for name in ("unknowns", "rotation_unknowns", "total")),
        *((name, _int) for name in ("elements", "points", "segments", "groups")),
        ("group", _pointer),
        ("owner", _pointer),
        ("weight", _pointer),
        *((name, Map) for name in ("Y", "Z", "ZT", "W", "WT", "WTa", "YTa")),
        *((name, _int) for name in ("given", "pull", "shift", "opening", "beside", "force", "results")),
        *((name, Sums) for name in ("entries", "sides", "sizes")),
        ("side_of", _pointer),
        ("noise", _pointer),
        ("retained", _int),
        ("retain", _pointer),
        ("sliding", _int),
        ("slide", _pointer),
        ("unloaded", _double),
        ("unknown", _pointer),
        ("share", _pointer),
        ("counted", _pointer),
        ("counting", _pointer),
        ("entry_count", _int),
        ("entry_row", _pointer),
        ("entry_column", _pointer),
        ("diagonal", _pointer),
    )


class State(ctypes.Structure):
    """``sf_state``."""

    _fields_ = (("q", _pointer), ("y", _pointer), ("lam", _pointer), ("unwrapped", _pointer))


class Point(ctypes.Structure):
    """``sf_point``."""

    _fields_ = (
        ("potential", _double),
        ("stored", _double),
        *((name, _pointer) for name in ("residual", "scale", "entries", "result", "place", "pull", "work")),
    )


class Factors(ctypes.Structure):
    """``sf_factors``."""

    _fields_ = (
        ("n", _int),
        ("entries", _int),
        *((name, _pointer) for name in ("start", "row", "order", "place")),
        ("filled", _int),
        *((name, _pointer) for name in ("parent", "lower", "lower_row", "value", "pivot", "mark", "path", "used")),
        ("column", _pointer),
        ("least", _double),
    )


class Pivoted(ctypes.Structure):
    """``sf_pivoted``."""

    _fields_ = (
        ("n", _int),
        *((name, _pointer) for name in ("start", "row", "order")),
        ("room", _int),
        *((name, _pointer) for name in ("place", "row_of", "mark", "reached", "stack", "at", "lower", "upper")),
        *((name, _pointer) for name in ("lower_row", "upper_row", "lower_value", "upper_value", "pivot", "x")),
        ("known", _int),
    )


class System(ctypes.Structure):
    """``sf_system``."""

    _fields_ = (
        *((name, _pointer) for name in ("factors", "pivoted", "soft")),
        *((name, _int) for name in ("symmetric", "lost", "often")),
        ("solved", _double),
    )


class Limits(ctypes.Structure):
    """``sf_limits``."""

    _fields_ = (
        *((name, _int) for name in ("iterations", "returns", "slides")),
        ("slide", _pointer),
        *((name, _double) for name in ("most", "slid", "contraction", "brief", "turned", "near")),
        *((name, _double) for name in ("converged", "exact", "balanced", "least", "epsilon", "placed")),
        *((name, _double) for name in ("proximal", "dual")),
        ("weight", _pointer),
    )


class Border(ctypes.Structure):
    """``sf_border``."""

    _fields_ = (
        *((name, _pointer) for name in ("begun", "rate", "row")),
        *((name, _double) for name in ("unit", "apart", "passing", "factor")),
    )


class Report(ctypes.Structure):
    """``sf_report``."""

    _fields_ = (
        *((name, _int) for name in ("good", "iterations", "refused", "steps")),
        *((name, _double) for name in ("residual", "tolerance", "first", "second")),
    )


class Counting(ctypes.Structure):
    """``sf_count_of``."""

    _fields_ = (
        ("weight", _pointer),
        *((name, _double) for name in ("shift", "softest", "soft", "rounding", "graded", "broken", "blurred", "signs")),
        ("rounds", _int),
    )


class Way(ctypes.Structure):
    """``sf_way``."""

    _fields_ = (
        *((name, _pointer) for name in ("begun", "rate")),
        ("turning", _int),
        ("turned", _pointer),
        *((name, _double) for name in ("done", "step")),
        ("tries", _int),
        *((name, _double) for name in ("longest", "linear", "unbalanced", "still", "shortest", "least", "brief")),
    )


NAMES_OF_CASES = ("count", "datum", "row", "zero", "near", "longest", "stiffer", "state", "found", "residual")


class Cases(ctypes.Structure):
    """``sf_cases``."""

    _fields_ = (
        *((name, _int) for name in ("cases", "done", "follows", "groups")),
        *((name, _pointer) for name in NAMES_OF_CASES),
    )


class Inputs(ctypes.Structure):
    """``sf_inputs``."""

    _fields_ = (
        ("groups", _int),
        *((name, _pointer) for name in ("count", "datum")),
        ("turning", _int),
        *((name, _pointer) for name in ("turned", "held")),
        ("couples", _int),
        *((name, _pointer) for name in ("couple", "rest", "begun", "reached")),
    )


class Rules(ctypes.Structure):
    """``sf_rules``."""

    _fields_ = (
        *((name, _pointer) for name in ("mass", "sides", "seed", "convex")),
        *((name, _int) for name in ("stiffness", "iterations", "corrections", "rounds", "halvings", "escapes")),
        *((name, _int) for name in ("sweeps", "symmetric", "minimisable", "downhill", "pivoted", "sliding")),
        *((name, _double) for name in ("converged", "rounding", "gain", "turn", "near", "proximal", "soft", "hard")),
        *((name, _double) for name in ("firm", "firmer", "left", "armijo", "noise", "nudge", "far", "shortest")),
        *((name, _double) for name in ("level", "least", "miscounted")),
    )


class Sought(ctypes.Structure):
    """``sf_sought``."""

    _fields_ = (*((name, _int) for name in ("status", "negative", "iterations")), ("residual", _double))


class Told(ctypes.Structure):
    """``sf_told_of``."""

    _fields_ = (
        *((name, _double) for name in ("factor", "arc", "residual")),
        *((name, _int) for name in ("iterations", "negative", "doubtful")),
    )


class Curve(ctypes.Structure):
    """``sf_curve``."""

    _fields_ = (
        *((name, _pointer) for name in ("begun", "rate", "metric", "probe", "column", "line", "entry")),
        *((name, _double) for name in ("unit", "low", "high", "stride", "longest", "shortest", "turning", "sharpest")),
        *((name, _double) for name in ("far", "passing", "doubt", "effort", "roughly", "usual", "apart")),
        *((name, _int) for name in ("known", "loop", "room", "points")),
        ("length", _double),
        ("before", _pointer),
        ("arc_before", _double),
        *((name, _pointer) for name in ("state", "tangent", "first")),
        ("first_factor", _double),
        ("told", _pointer),
    )


class Observables(ctypes.Structure):
    """``sf_observables``."""

    _fields_ = (("group", Group), ("mass", _pointer), ("damping", _pointer), ("vectors", _int))


class Motion(ctypes.Structure):
    """``sf_motion``."""

    _fields_ = (
        *((name, _int) for name in ("stages", "kept", "quantities", "linear", "groups")),
        *((name, _pointer) for name in ("part", "at", "velocity", "acceleration", "after")),
        *((name, _pointer) for name in ("velocity_kept", "acceleration_kept", "after_kept", "power", "turning")),
        ("tangent", _int),
        *((name, _pointer) for name in ("seen", "rows", "observables")),
        *((name, Map) for name in ("by_place", "by_tangent", "onto_pull", "onto_places", "mass", "drag")),
        *((name, Sums) for name in ("shares", "entries")),
        *((name, _int) for name in ("couples", "massive")),
        *((name, _pointer) for name in ("inside", "point_of", "inner_mass", "inner_drag", "first_mass", "first_drag")),
        *((name, _int) for name in ("masses", "drags")),
        *((name, _pointer) for name in ("place_mass", "place_drag")),
        *((name, _int) for name in ("entry_count", "iterations", "driven")),
        ("drive", _pointer),
        *((name, _int) for name in ("sliding", "further")),
        *((name, _pointer) for name in ("slide", "cross")),
        ("coriolis", Map),
        ("weights", _int),
        ("weight", _pointer),
        *((name, _double) for name in ("dual", "last_change", "lost")),
    )


class Advance(ctypes.Structure):
    """``sf_advance_of``."""

    _fields_ = (
        *((name, _double) for name in ("h", "ratio")),
        *((name, _pointer) for name in ("given", "vector", "q", "y", "lam", "turn", "shift", "x", "rate")),
        *((name, _pointer) for name in ("unwrapped", "acting", "held")),
        *((name, _pointer) for name in ("last_q", "last_y", "rows", "turns", "shifts", "there", "rates")),
        *((name, _double) for name in ("size", "gap")),
        ("iterations", _int),
    )


class Flat(ctypes.Structure):
    """``sf_flat``."""

    _fields_ = (
        *((name, _int) for name in ("inputs", "groups")),
        *((name, _pointer) for name in ("count", "datum", "given", "row")),
        *((name, _int) for name in ("angles", "counts")),
        *((name, _pointer) for name in ("angle", "pivots")),
    )


OF_WAYS = (Counting, Way, Cases, Rules, Sought, Inputs, Curve, Told)

HANDED = (TapeTable, Group, Model, Point, Factors, Pivoted, System, Limits, Border, Report, *OF_WAYS)

SIZES = (
    12,
    *(ctypes.sizeof(kind) for kind in HANDED),
    8,
    *map(ctypes.sizeof, (Observables, Motion, Advance, Flat)),
    len(NAMES),
)
"""What the core says of the sizes of what is handed to it, if it is the one that this module was written for."""

VERSION = 9
"""Number of the interface, as ``SF_VERSION``."""


def integers(values: Array) -> Array:
    """Whole numbers (n, ...) as the core takes them."""
    return np.ascontiguousarray(values, dtype=np.intc)


def doubles(values: Array) -> Array:
    """Numbers (n, ...) as the core takes them."""
    return np.ascontiguousarray(values, dtype=float)


@functools.lru_cache(maxsize=KEPT)
def table_of(tape: Tape) -> tuple[TapeTable, list[Array]]:
    """A tape as the core takes it, and the arrays that it points to.

    Where there is a core operations of a kind stand together, which it does faster.
    """
    library, code, constant, splines = core(), integers(tape.code), doubles(tape.constant), integers(tape.splines)
    stretch, arranged, slots = _stretches(code), integers(code[:, 1:]), tape.slots
    # Where splines are looked up coordinates stand in slots beside each other.
    if library is not None and not len(splines):
        memory, needed = np.empty(9 * len(code) + slots + 1, np.intc), _int()
        most, arranged = np.empty((len(code), 2), np.intc), np.empty_like(arranged)
        places = (array.ctypes.data for array in (code, most, arranged, memory))
        count = library.sf_arrange(len(code), *places, ctypes.addressof(needed))
        stretch, slots = most[:count].copy(), needed.value
    sizes = (len(stretch), slots, tape.arguments, tape.results, len(constant))
    arrays = [stretch, arranged, constant, splines]
    addresses = [array.ctypes.data for array in arrays]
    return TapeTable(*sizes, *addresses[:3], addresses[3] if len(splines) else None, None), arrays


def _stretches(code: Array) -> Array:
    """Kinds of operations as they follow each other, and how many of each, (stretches, 2)."""
    first = np.flatnonzero(np.diff(code[:, 0], prepend=-1))
    return integers(np.stack([code[first, 0], np.diff(first, append=len(code))], axis=1))


_SWITCHED_OFF = contextvars.ContextVar("switched off", default=False)


def without_core() -> contextlib.AbstractContextManager[None]:
    """Context manager within which there is no core, as with ``$SFETCAS_CORE=off`` everywhere."""
    return switched_on(_SWITCHED_OFF)


def core() -> ctypes.CDLL | None:
    """The core; None where there is none, or where it is switched off."""
    if _SWITCHED_OFF.get() or os.environ.get("SFETCAS_CORE", "") == "off":
        return None
    return _found(os.environ.get("SFETCAS_CACHE"), os.environ.get("SFETCAS_KERNELS") != "interpreted")


@functools.lru_cache(maxsize=4)
def _found(_: str | None, compiles: bool) -> ctypes.CDLL | None:
    """The core, compiled where that is allowed; looked for anew where the cache is another one."""
    beginning = prefix()
    found, cache = _in(SOURCES, beginning), cache_folder()
    if found is not None or cache is None:
        return found
    with contextlib.suppress(OSError):
        cache.mkdir(mode=0o700, parents=True, exist_ok=True)
        if private(cache):
            found = _in(cache, beginning)
            if found is None and compiles and compile_core(cache) is not None:
                found = _in(cache, beginning)
    return found


def _in(folder: Path, beginning: str) -> ctypes.CDLL | None:
    """The library in a folder whose name begins so, if it is whole."""
    with contextlib.suppress(OSError, AttributeError):
        path = whole(folder, beginning)
        return None if path is None else _declared(ctypes.CDLL(str(path)))
    return None


def _declared(library: ctypes.CDLL) -> ctypes.CDLL | None:
    """The library with the types of its functions; None if it is not the one that this module was written for."""
    sizes = (_int * len(SIZES))()
    library.sf_sizes(sizes)
    if library.sf_version() != VERSION or tuple(sizes) != SIZES:
        return None
    library.sf_arrange.argtypes = [_int, *[_pointer] * 5]
    library.sf_run.argtypes = [_pointer, _int, _pointer, _pointer, _pointer]
    library.sf_tape_work.argtypes = [_pointer]
    library.sf_work_size.argtypes = [_pointer]
    library.sf_evaluate.argtypes = [_pointer] * 4
    library.sf_at.argtypes = [_pointer] * 4
    library.sf_slope.argtypes = [_pointer] * 6
    library.sf_move.argtypes = [_pointer, _pointer, _pointer, _double, _pointer]
    library.sf_count.argtypes = [_pointer]
    library.sf_factorise.argtypes = [_pointer] * 3
    library.sf_backward.argtypes = [_pointer, _int, _pointer, _pointer]
    library.sf_correct_size.argtypes = [_pointer]
    library.sf_correct.argtypes = [_pointer] * 10
    library.sf_follow_size.argtypes = [_pointer]
    library.sf_negative.argtypes = [_pointer] * 5
    library.sf_follow.argtypes = [_pointer] * 10
    library.sf_lowest_size.argtypes = [_pointer]
    library.sf_lowest.argtypes = [*[_pointer] * 4, *[_double] * 3, *[_pointer] * 3]
    library.sf_independent.argtypes = [*[_pointer] * 5, _double, _double, _pointer]
    library.sf_trace_size.argtypes = [_pointer]
    library.sf_trace.argtypes = [_pointer] * 8
    library.sf_solve_cases.argtypes = [_pointer] * 9
    library.sf_find_size.argtypes = [_pointer] * 3
    library.sf_find.argtypes = [*[_pointer] * 5, _int, *[_pointer] * 4]
    library.sf_advance_size.argtypes = [_pointer] * 2
    library.sf_advance.argtypes = [_pointer] * 6
    library.sf_lemke.argtypes = [_int, _pointer, _pointer, _int, _int, *[_double] * 3]
    library.sf_pivots.argtypes = [_pointer] * 2
    library.sf_take_step_size.argtypes = [_pointer] * 3
    library.sf_take_step.argtypes = [*[_pointer] * 4, _double, *[_pointer] * 6]
    library.sf_solve.argtypes = [_pointer, _pointer, _int, _pointer, _pointer, _pointer]
    return library
