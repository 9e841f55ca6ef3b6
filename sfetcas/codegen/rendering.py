"""The C files of an equilibrium solver: its functions, its tables and the driver, put together."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from importlib import resources

import casadi as ca
import numpy as np

from ..solvers.globalised import MEANINGS, Code
from .equilibrium import EquilibriumSolver
from .source import functions_in_c, sizes_of, sparsity_table, table

__all__ = ["constants", "filled", "identifiers", "solver_files", "template"]


def template(name: str) -> str:
    """A file of the driver."""
    return resources.files(__package__).joinpath("templates").joinpath(name).read_text()


def filled(text: str, values: dict[str, object]) -> str:
    """A template with its ``@marks@`` filled in."""
    return re.sub(r"@(\w+)@", lambda match: str(values[match.group(1)]), text)


def identifiers(names: Iterable[str]) -> list[str]:
    """Names as parts of C identifiers, no two alike."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r"\W", "_", name).upper()
        count = 2
        unique = plain
        while unique in found:
            unique = f"{plain}_{count}"
            count += 1
        found.append(unique)
    return found


def solver_files(solver: EquilibriumSolver, *, sensitivities: bool = False) -> dict[str, str]:
    """Texts of ``NAME.c`` and ``NAME.h``."""
    values = constants(solver, sensitivities)
    header = filled(template("solver.h"), values)
    functions = _functions(solver, sensitivities)
    roots = {function.name() for function in functions} - {PIVOTS} | {"casadi_ldl", "casadi_ldl_solve"}
    parts = [
        f"/* {values['title']}\n *\n * Made by sfetcas; not meant to be read or changed. */",
        '#include "@name@.h"\n',
        "#if defined(__GNUC__)\n/* What CasADi generates takes arguments that it may not need. */\n"
        '#pragma GCC diagnostic ignored "-Wunused-parameter"\n#endif\n',
        functions_in_c(functions, solver.name, roots),
        "/* ---- tables ---- */\n",
        *_tables(solver),
        template("solver.c"),
        template("defaults.c"),
    ]
    if sensitivities:
        parts.append(template("sensitivities.c"))
    return {f"{solver.name}.h": header, f"{solver.name}.c": filled("\n".join(parts), values)}


def _functions(solver: EquilibriumSolver, sensitivities: bool) -> list[ca.Function]:
    program, model = solver.arguments.program, solver.model
    found = [solver.prepare, solver.tell, program.begin, program.hold, program.move, program.at, program.left]
    if model.minimisable:
        found += [program.merit, program.convex]
    found.append(_pivots() if model.has_potential else program.linear)
    return [*found, solver.sensitivities] if sensitivities else found


PIVOTS = "with_pivots_as_they_come"


def _pivots() -> ca.Function:
    """Any function that solves without pivots: the driver makes and uses factors itself, with what this one calls."""
    matrix, b = ca.MX.sym("matrix", 2, 2), ca.MX.sym("b", 2)
    return ca.Function(PIVOTS, [matrix, b], [ca.solve(matrix, b, "ldl")])


def constants(solver: EquilibriumSolver, sensitivities: bool = False) -> dict[str, object]:
    """What the marks of the templates stand for."""
    name, program = solver.name, solver.arguments.program
    functions = _functions(solver, sensitivities)
    sizes = sizes_of(functions)
    total, entries = program.expressions.total, program.sparsity.nnz()
    lower = _lower(program.sparsity)[0].nnz() if solver.model.has_potential else 0
    sizes["w"] = max(sizes["w"], total)
    upper = name.upper()
    arguments = solver.arguments.arguments
    results = solver.results.results
    return {
        "name": name,
        "NAME": upper,
        "title": (solver.scene.title or "an untitled scene").replace("*/", "* /"),
        "casadi": ca.CasadiMeta.version(),
        "arguments_in_words": _in_words([one.name for one in arguments]),
        "n_arguments": len(solver.arguments.defaults),
        "n_results": solver.results.size,
        "n_states": program.states,
        "argument_places": _places(f"{upper}_ARG", [(a.name, len(a.default), a.unit) for a in arguments]),
        "result_places": _places(f"{upper}_RES", [(r.name, r.size, r.unit) for r in results]),
        "statuses": _enumerated([(f"{upper}_{code.name}", int(code), MEANINGS[code]) for code in Code]),
        "sz_given": max(1, program.symbol.shape[0]),
        "sz_state": max(1, program.states),
        "sz_total": max(1, total),
        "sz_entries": max(1, entries),
        "sz_lower": max(1, lower),
        **{f"sz_{key}": value for key, value in sizes.items()},
        "indent": " " * len(f"int {name}_solve("),
        "defaults": ", ".join(repr(float(x)) for x in solver.arguments.defaults) or "0.0",
        "messages": "\n".join(f'    case {upper}_{code.name}: return "{MEANINGS[code]}";' for code in Code),
        "sensitivities_declared": filled(template("sensitivities.h"), {"name": name, "NAME": upper})
        if sensitivities
        else "",
    }


def _in_words(names: Sequence[str]) -> str:
    words = textwrap.fill(", ".join(names) if names else "loads of the scene", 110, initial_indent=" * ")
    return words.replace("\n", "\n * ")


def _places(prefix: str, sizes: Sequence[tuple[str, int, str]]) -> str:
    """An enum of where things begin."""
    if not sizes:
        return ""
    names, first, found = identifiers(name for name, _, _ in sizes), 0, []
    for identifier, (name, size, unit) in zip(names, sizes, strict=True):
        count = "1 number" if size == 1 else f"{size} numbers"
        found.append((f"{prefix}_{identifier}", first, f"{name}: {count}, {unit}"))
        first += size
    return f"enum {{\n{_enumerated(found)}\n}};\n"


def _enumerated(values: Sequence[tuple[str, int, str]]) -> str:
    """Constants of an enum with what they mean."""
    last = len(values) - 1
    ends = ["," if i < last else "" for i in range(len(values))]
    return "\n".join(f"  {n} = {v}{end} /* {what} */" for (n, v, what), end in zip(values, ends, strict=True))


def _lower(sparsity: ca.Sparsity) -> tuple[ca.Sparsity, list[int]]:
    """Pattern of the factors without pivots, and the order of the unknowns."""
    found, order = sparsity.ldl(True)
    return found, list(order)


def _tables(solver: EquilibriumSolver) -> list[str]:
    program, method, rules = solver.arguments.program, solver.method, solver.rules
    equations, total = program.equations, program.expressions.total
    moments, loads = program.slice_of("moment"), program.slice_of_loads
    constants: dict[str, object] = {
        "TOTAL": total,
        "UNKNOWNS": equations.unknowns,
        "TURNING": equations.turning_unknowns,
        "ENTRIES": program.sparsity.nnz(),
        "STATE": program.states,
        "MULTIPLIERS": program.states - program.expressions.layout.near - equations.rows,
        "GIVEN": program.symbol.shape[0],
        "LOADS": loads.start,
        "MOMENT": moments.start,
        "MOMENTS": moments.stop - moments.start,
        "SYMMETRIC": int(solver.model.has_potential),
        "MINIMISABLE": int(solver.model.minimisable),
        "STARTED": int(solver.start is not None),
        **{key.upper(): value for key, value in vars(rules).items()},
    }
    lines = [f"#define SF_{key} {value!r}" for key, value in constants.items()]
    start = solver.start if solver.start is not None else np.zeros(0)
    found = [
        "\n".join(lines) + "\n",
        table("sf_diagonal", method.diagonal, "int"),
        table("sf_mass", method.mass),
        table("sf_soft", method.soft),
        table("sf_start", start),
    ]
    if solver.model.has_potential:
        lower, order = _lower(program.sparsity)
        found += [
            sparsity_table("sf_pattern", program.sparsity),
            sparsity_table("sf_lower", lower),
            table("sf_order", np.array(order), "int"),
        ]
    return found
