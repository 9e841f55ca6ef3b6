"""The core as part of generated C: its sources, and the tables of a model."""

from __future__ import annotations

import ctypes
import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ..core.building import SOURCES
from ..dynamics.core_steps import CoreStep
from ..errors import SceneError
from ..mathematics import core as c
from ..mathematics.arrays import Array, Index
from ..mathematics.core import TapeTable
from ..mathematics.linear import factor_tables, last_rows, pivot_order
from ..mathematics.source import in_lines, table
from ..mathematics.tapes import NAMES, tape_of
from ..mechanics.evaluation import Handed, handed
from ..mechanics.model import Model
from ..mechanics.terms import rotation_gradient
from ..parametric.equilibrium import EquilibriumSolver
from .rendering import optimised

__all__ = ["SolverTables", "StepTables", "core_in_c"]

EQUATIONS = ("states.c", "equations.c", "factors.c")
"""What every kind of generated C takes of the core beside tapes."""


@functools.cache
def core_in_c(method: str) -> list[str]:
    """The sources of the core that a solver or a time step takes, as static C without comments.

    ``method`` is the last of them.
    """
    done = set[str]()
    # Most of the time goes into tapes, which need all that GCC can; what else it tries takes half of the time to
    # compile.
    parts = (("O3", ("core.h", "tape.c")), ("no-ivopts", (*EQUATIONS, method)))
    return [optimised(level, _plain("\n".join(_included(name, done) for name in names))) for level, names in parts]


def _plain(text: str) -> str:
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    # What a library has for others, and what of it is made elsewhere.
    text = re.sub(r"^SF_PUBLIC [^;]*;\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"^(int|double) (sf_\w+\()", r"static \1 \2", text, flags=re.MULTILINE)
    return "\n".join(filter(None, map(str.rstrip, text.splitlines()))) + "\n"


def _included(name: str, done: set[str]) -> str:
    """A file with those of the core that it includes in their place; headers once."""
    if name in done and name != "lanes.h":
        return ""
    done.add(name)
    text = (SOURCES / name).read_text(encoding="utf-8")
    return re.sub(r'#include "([\w.]+)"', lambda match: _included(match[1], done), text)


FEW, LONGEST = 4, 3_000
"""Up to so many terms compiled operations are faster than those of a tape, which are for eight at once; and the longest
tape that compiles in a fraction of a second.
"""


@functools.cache
def _expressions() -> list[str]:
    """For each operation of a tape what it is in C, of ``{x}`` and ``{y}``."""
    text = (SOURCES / "tape.c").read_text(encoding="utf-8") + (SOURCES / "lanes.h").read_text(encoding="utf-8")
    found = dict(re.findall(r"case SF_(\w+): return (.*);", text))
    found |= {name: what.replace("[l]", "") for name, what in re.findall(r"(?:UNARY|BINARY)\(SF_(\w+), (.*)\)", text)}
    return [re.sub(r"\b([xy])\b", r"{\1}", found.get(name, "")) for name in NAMES]


def compiled(name: str, stretch: Array, code: Array, constant: Array, slots: int) -> str:
    """A tape as a function in C, of the arguments and results of one term."""
    lines = [f"static void {name}(const double *in, double *out) {{"]
    lines += [f"double {','.join(f'w{i}' for i in range(k, min(k + 20, slots)))};" for k in range(0, slots, 20)]
    kinds = np.repeat(stretch[:, 0], stretch[:, 1]).tolist()
    values = [repr(float(x)) if np.isfinite(x) else "HUGE_VAL" if x > 0 else "-HUGE_VAL" for x in constant]
    values = ["NAN" if np.isnan(x) else text for x, text in zip(constant, values, strict=True)]
    first = {"IN": "w{to}=in[{a}];", "OUT": "out[{to}]=w{a};", "CONSTANT": "w{to}={value};"}
    for kind, (to, a, b) in zip(kinds, code.tolist(), strict=True):
        operation = NAMES[kind]
        if operation in first:
            value = values[a] if operation == "CONSTANT" else ""
            lines.append(first[operation].format(to=to, a=a, value=value))
            continue
        what = _expressions()[kind].format(x=f"w{a}", y=f"w{b}")
        lines.append(f"w{to}={what};")
    return "\n".join([*lines, "}\n"])


class InC:
    """Structures of the core as initialisers in C, and the constant arrays that they point to.

    Parameters
    ----------
    arrays : mapping
        What the structures point to, by addresses.
    compiled : set of int
        Addresses of tapes of which there are few terms: their operations are compiled, unless there are many.

    Attributes
    ----------
    tables : list of str
        Definitions of the arrays, in the order in which they were met.
    """

    def __init__(self, arrays: Mapping[int, Any], compiled: set[int]) -> None:
        self._arrays, self._compiled, self.tables = arrays, compiled, list[str]()
        self._names, self._known = dict[int, str](), dict[tuple[str, bytes], str]()

    def value(self, structure: ctypes.Structure, **own: str) -> str:
        """The initialiser of a structure, with values of some of its fields as they are given, in C."""
        parts = []
        for name, kind, *_ in structure._fields_:
            value = getattr(structure, name)
            if name in own:
                parts.append(own[name])
            elif isinstance(value, ctypes.Structure):
                parts.append(self.value(value))
            elif kind is ctypes.c_void_p:
                parts.append(self.pointer(value) if value else "0")
            else:
                parts.append(repr(value) if np.isfinite(value) else "HUGE_VAL")
        return f"{{{', '.join(parts)}}}"

    def groups(self, groups: Iterable[ctypes.Structure], varying: Sequence[int]) -> list[str]:
        """The initialisers of groups of terms; of some of them the data are given later."""
        return [self.value(one, **({"datum": "0"} if i in varying else {})) for i, one in enumerate(groups)]

    def pointer(self, address: int) -> str:
        """What is at an address, by its name."""
        if address not in self._names:
            what = self._arrays[address]
            self._names[address] = self.tape(what) if isinstance(what, TapeTable) else self.array(what)
        return self._names[address]

    def array(self, values: Array) -> str:
        """The name of a constant array; equal ones are one."""
        kind = "double" if values.dtype.kind == "f" else "int"
        key = (kind, values.tobytes())
        if key not in self._known:
            self._known[key] = f"sf_t{len(self._known)}"
            self.tables.append(table(self._known[key], values, kind))
        return self._known[key]

    def tape(self, tape: TapeTable) -> str:
        """The name of a tape."""
        name = f"sf_tape_{len(self.tables)}"
        stretch, code, constant = (self._arrays[address] for address in (tape.stretch, tape.code, tape.constant))
        if ctypes.addressof(tape) in self._compiled and len(code) <= LONGEST and not tape.spline:
            self.tables.append(optimised("O1", compiled(f"{name}_compiled", stretch, code, constant, tape.slots)))
            own = {"stretches": "0", "slots": "0", "stretch": "0", "code": "0", "constant": "0"}
            inner = self.value(tape, **own, compiled=f"{name}_compiled")
        else:
            inner = self.value(tape, stretch=self._pairs(stretch), code=self._pairs(code))
        self.tables.append(f"static const sf_tape {name} = {inner};\n")
        return f"&{name}"

    def _pairs(self, rows: Array) -> str:
        """The name of an array of operations or stretches."""
        kind = "sf_stretch" if rows.shape[1] == 2 else "sf_operation"
        key = (kind, rows.tobytes())
        if key not in self._known:
            self._known[key] = f"sf_t{len(self._known)}"
            inner = in_lines(list(map(str, rows.ravel().tolist())) or ["0"])
            self.tables.append(f"static const {kind} {self._known[key]}[{max(len(rows), 1)}] = {{\n{inner}\n}};\n")
        return self._known[key]


NONE: dict[str, type[ctypes.Structure]] = {"sf_group": c.Group, "sf_observables": c.Observables}
"""Structures of which there are arrays, by their names in C."""


class _Tables:
    """What the core takes of a model for generated C: definitions, sizes, and how much memory a call takes.

    Attributes
    ----------
    constants : dict
        Sizes by their names in the driver.
    texts : list of str
        Definitions of structures and tables.
    numbers, whole : int
        Doubles and whole numbers of the memory of a call.
    """

    def __init__(self) -> None:
        self.constants, self.texts = dict[str, int](), list[str]()
        self.numbers = self.whole = 0

    def _write(self, text: InC, structures: Mapping[str, str], lists: Mapping[str, Sequence[str]]) -> None:
        """Enter tables, arrays of structures, and structures."""
        self.texts += text.tables
        for name, values in lists.items():
            # There are no empty arrays in C.
            inner = f",{chr(10)}  ".join(values or [text.value(NONE[name.split()[0]]())])
            self.texts.append(f"static const {name}[] = {{\n  {inner}\n}};\n")
        self.texts += [f"static const {name} = {value};\n" for name, value in structures.items()]

    def _enter(self, **tables: Array) -> None:
        """Enter tables of whole numbers by their names."""
        self.texts += [table(f"sf_{name}", values, "int") for name, values in tables.items()]

    def _vary(self, varying: Sequence[int], sizes: Sequence[int], inputs: int, stages: int = 1) -> None:
        """Enter which groups of terms have data among the inputs, and how many; both are needed for all stages."""
        self._enter(varying=np.array(varying, np.intp), counts=np.array(sizes, np.intp))
        self.constants |= {"VARYING": len(varying), "INPUTS": inputs}
        self.numbers += stages * (sum(sizes) + inputs)

    def _pivot(self, n: int, row: Index, column: Index, order: Array) -> None:
        """Enter what factors with pivots take: as much room as orthogonal factors, whose patterns hold those of factors
        with any pivots (George and Ng 1985).
        """
        own = ca.Sparsity.triplet(n, n, row.tolist(), np.argsort(order)[column].tolist())
        room = n + max((part.nnz() for part in own.qr_sparse(False)[:2]), default=0) if n else 1
        self._enter(order_with_pivots=order)
        self.constants["ROOM"] = room
        self.numbers += 2 * room + 2 * n
        self.whole += 2 * room + 8 * n + 2


def _of_point(structure: c.Model, results: int) -> int:
    """Numbers of results, places and pulls at a state."""
    return results + structure.places * structure.axes + structure.elements * structure.points * structure.axes


class SolverTables(_Tables):
    """What the core takes of an equilibrium solver.

    Parameters
    ----------
    solver : EquilibriumSolver

    Attributes
    ----------
    sizes : dict
        What the core says of its memory: ``sf_work_size``, ``sf_find_size``.
    """

    def __init__(self, solver: EquilibriumSolver) -> None:
        super().__init__()
        method, inputs = solver.method, solver.method.inputs
        equations, model = method.equations, solver.model
        known = handed(equations.layout, model, equations.noise)
        if known is None or not known.layout.searchable:
            raise SceneError(_unknown(model))
        rules, given, arrays = method.for_core()
        points = known.arrays | {array.ctypes.data: array for array in arrays}
        structure, convex, varying = known.structure, known.layout.convex, inputs.varying
        known.layout.set_convex(rules)
        if convex is not None:
            points |= {rules.convex: convex[0], **{array.ctypes.data: array for array in convex[1]}}
        given.groups = len(varying)
        few = {group.tape for group in known.groups if group.terms <= FEW}
        few |= {rules.convex} if convex is not None and known.groups[0].terms <= FEW else set()
        text, n = InC(points, few), structure.total
        structures = {
            "sf_model sf_the_model": text.value(structure, group="0"),
            "sf_rules sf_the_rules": text.value(rules),
            "sf_inputs sf_the_inputs": text.value(given, count="0", datum="0"),
        }
        self._write(text, structures, {"sf_group sf_groups": text.groups(known.groups, varying)})
        self._vary(varying, [model.terms[number].data.size for number in varying], inputs.size)
        names = ("start_of_columns", "rows", "order", "place_in_order")
        factors, count = factor_tables(n, equations.row, equations.column), method.states
        self._enter(**dict(zip(names, factors, strict=True)))
        self.texts.append(table("sf_start", solver.start if solver.start is not None else np.zeros(0)))
        below = _filled(n, factors)
        self.constants |= {
            "TOTAL": n,
            "STATE": count,
            "STARTED": int(solver.start is not None),
            "GROUPS": len(known.groups),
            "FILLED": below,
            "ROOM": 0,
        }
        self.sizes = {"work": _work_size(known), "find": _find_size(known, convex, inputs.size, count)}
        self.numbers += count + _of_point(structure, structure.results) + sum(self.sizes.values()) + below + 2 * n
        self.whole += 5 * n + 1 + below
        if method.pivoted and n:
            order = pivot_order(n, equations.row, equations.column, last_rows(equations.rows))
            self._pivot(n, equations.row, equations.column, order)


class StepTables(_Tables):
    """What the core takes of a time step.

    Parameters
    ----------
    step : CoreStep
    """

    def __init__(self, step: CoreStep) -> None:
        super().__init__()
        known, motion, flat, varying = step.handed, step.motion, step.flat, step.inputs.varying
        structure, stages = known.structure, motion.stages
        few = {group.tape for group in step.groups if group.terms <= FEW}
        text = InC(step.arrays, few)
        structures = {
            "sf_model sf_the_model": text.value(structure, group="0"),
            "sf_motion sf_the_motion": text.value(
                motion, turning="0", rows="0", slide="0", seen="sf_seen", observables="sf_observed"
            ),
            "sf_flat sf_the_flat": text.value(flat, datum="0"),
            "sf_group sf_the_turning": text.value(step.turning, datum="0"),
        }
        lists = {
            "sf_group sf_groups": text.groups(known.groups, varying),
            "sf_group sf_further": text.groups(step.rows, varying),
            "sf_group sf_seen": [text.value(group) for group in step.seen],
            "sf_observables sf_observed": [text.value(one) for one in step.observables],
        }
        self._write(text, structures, lists)
        n, row, column, order = step.pattern
        sizes = [known.data[number].size // stages for number in varying]
        self._vary(varying, sizes, step.inputs.size, stages)
        start, rows, *_ = factor_tables(n, row, column)
        self._enter(start_of_columns=start, rows=rows)
        self._pivot(n, row, column, order)
        self.constants |= {"TOTAL": n, "GROUPS": len(known.groups), "ENTRIES": len(row), "RESULTS": step.results}
        self.numbers += n + _of_point(structure, step.results) + step.room


def _filled(n: int, factors: list[Array]) -> int:
    """Entries of the factors without pivoting below the diagonal, see ``sf_count``."""
    start, rows, order, place = (part.tolist() for part in factors)
    parent, mark, found = [-1] * n, [-1] * n, 0
    for k in range(n):
        mark[k] = k
        for p in range(start[order[k]], start[order[k] + 1]):
            i = place[rows[p]]
            while i < k and mark[i] != k:
                parent[i] = k if parent[i] < 0 else parent[i]
                found += 1
                mark[i], i = k, parent[i]
    return found


def _work_size(known: Handed) -> int:
    """What ``sf_work_size`` says."""
    structure, tapes = known.structure, known.layout.tables
    arguments, slots = (max((getattr(tape, name) for tape in tapes), default=0) for name in ("arguments", "slots"))
    found = 2 * structure.segments * structure.axes + max(structure.elements, structure.closings)
    return found + structure.displacements + structure.places * structure.axes + 8 * (arguments + slots)


def _find_size(known: Handed, convex: tuple[TapeTable, list[Array]] | None, inputs: int, states: int) -> int:
    """What ``sf_find_size`` says."""
    structure = known.structure
    found = 2 * (states + 2 * structure.total + structure.entry_count) + 3 * structure.entry_count
    of_convex = 0 if convex is None else 8 * (convex[0].results + convex[0].slots)
    return found + 6 * structure.total + of_convex + inputs + 2 * states


def _unknown(model: Model) -> str:
    """A sentence on what generated equilibria do not contain."""
    lacking = (group for group in model.terms if tape_of(rotation_gradient(group.kind)) is None)
    named = ((group.kind.table, name.removeprefix(f"{group.kind.table}.")) for group in lacking for name in group.names)
    records = dict.fromkeys(f"{kind}.{name}" for kind, name in named if name)
    what = ", ".join(records) or "a kind of member"
    accepted = "accepted: to solve in Python, or to export time steps"
    return f"found {what} with an operation that generated equilibria do not have, as erfinv, {accepted}"
