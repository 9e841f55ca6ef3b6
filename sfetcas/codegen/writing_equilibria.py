"""An equilibrium solver as C: its functions, the tables of the driver, and the cases of the check."""

from __future__ import annotations

import functools
import textwrap
from typing import Any

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.records import counted
from ..mathematics.source import table
from ..parametric.equilibrium import EquilibriumSolver
from ..parametric.switched import BEYOND
from ..solvers.globalised import MEANINGS, Code
from .core_in_c import SolverTables, core_in_c
from .rendering import Status, Writer, defined, filled, row, rows, template

__all__ = ["EquilibriumWriter"]

SWITCHED = "  sf_switch_as(m->given, state);\n"
"""What derivatives begin with: what acts at the state."""

SLOPES = "`{name}_sensitivities` gives the derivatives of all results by all arguments at a solution.\n\n"
"""Sentence of the README about sensitivities."""


class EquilibriumWriter(Writer):
    """The files of an equilibrium solver, optionally with the derivatives of results by arguments."""

    header, example, check = "solver.h", "main.c", "check.c"
    loader, readme = "loader.py.in", "README.md"
    # They are called once in a solve, and would take most of the time to compile.
    optimisation = "Og"

    def __init__(self, solver: EquilibriumSolver, *, sensitivities: bool = False) -> None:
        super().__init__(solver.name, solver.scene, solver.arguments, solver.results)
        self.solver, self._sensitivities = solver, sensitivities
        switches = ["switches.c"] if solver.switches is not None else []
        self.bodies = ("memory.c", *switches, "solver.c", *(["sensitivities.c"] if sensitivities else []))

    @property
    def functions(self) -> list[ca.Function]:
        """The functions of the solver, and those that compute the results."""
        solver, program = self.solver, self.arguments.program
        found = [solver.prepare, solver.output, program.row, solver.error]
        if solver.margins is not None:
            found.append(solver.margins)
        return [*found, solver.sensitivities] if self._sensitivities else found

    @property
    def statuses(self) -> list[Status]:
        """The codes of :class:`~sfetcas.solvers.globalised.Code`."""
        looked = self.solver.margins is not None or self.solver.switches is not None
        codes = [code for code in Code if code is not Code.TOUCHES or looked]
        return [(code.name, int(code), MEANINGS[code]) for code in codes]

    @property
    def states(self) -> int:
        """Length of a state."""
        return self.solver.method.states

    @property
    def _watched(self) -> int:
        """Number of margins of contacts that are looked at."""
        return 0 if self.solver.margins is None else int(self.solver.margins.numel_out(0))

    @property
    def _margins(self) -> int:
        """Room for margins: of contacts, or of strings and stops."""
        switches = self.solver.switches
        return max(self._watched, 0 if switches is None else len(switches))

    @property
    def _sizes(self) -> dict[str, int]:
        tables = self._tables
        return {
            "sz_given": max(1, self.arguments.program.symbol.shape[0]),
            "sz_numbers": max(1, tables.numbers),
            "sz_whole": max(1, tables.whole),
        }

    @property
    def memory(self) -> int:
        """Number of doubles for states, residuals, matrices and factors."""
        given, numbers, whole = self._sizes.values()
        return given + numbers + whole // 2 + 1 + self._margins

    @functools.cached_property
    def _tables(self) -> SolverTables:
        return SolverTables(self.solver)

    @property
    def own(self) -> dict[str, object]:
        """Sizes of the memory, and texts about the model and the sensitivities."""
        names: dict[str, object] = {"name": self.name, "NAME": self.name.upper()}
        flexible = counted(self.model.mesh.elements, f"{self.model.element.name} element")
        unknowns = counted(self.arguments.expressions.total, "unknown")
        started, switched = self.solver.start is not None, self.solver.switches is not None
        find = filled(template("find.c"), names)
        if switched:
            find = filled(template("find_switched.c"), {**names, "once": textwrap.indent(find, "  ")})
        return {
            **self._sizes,
            "find": find,
            "switched": SWITCHED if switched else "",
            "indent": " " * len(f"int {self.name}_solve("),
            "margins_declared": f"\n  double margins[{self._margins}];" if self._margins else "",
            "sensitivities_declared": filled(template("sensitivities.h"), names) if self._sensitivities else "",
            "model_in_words": f"In {self.where}: {flexible}, {unknowns}.",
            "about_sensitivities": SLOPES.format(name=self.name) if self._sensitivities else "",
            "error_in_words": f"{self.solver.answer.certificate.error_estimate or 0.0:.1g}",
            "start_in_words": "a bent state near that of the scene" if started else "the undeformed structure",
        }

    @property
    def about(self) -> dict[str, Any]:
        """Functions, and the estimated error for the default arguments."""
        functions = ["solve", "defaults", "message", *(["sensitivities"] if self._sensitivities else [])]
        return {"functions": functions, "error_estimate": self.solver.answer.certificate.error_estimate}

    @property
    def tables(self) -> list[str]:
        """The core, ranges of arguments, and all that it takes of the model."""
        found = [*self.ranges, *self._tables.texts]
        constants: dict[str, float] = {**self._tables.constants, "MARGINS": self._watched}
        switches = self.solver.switches
        if switches is not None:
            numbers = {"SWITCHES": len(switches), "CHOICES": switches.most}
            constants |= {**numbers, "BEYOND": BEYOND, "ALIKE": tolerances.ALIKE}
            places = {"flag": switches.flags, "multiplier": switches.multipliers, "opening": switches.openings}
            found += [table(f"sf_{name}_of", values, "int") for name, values in places.items()]
            found += [table("sf_string", switches.strings, "int"), table("sf_sign_of", switches.signs)]
            found += [table("sf_acts", switches.default)]
        return [*core_in_c("afar.c"), defined(constants), *found]

    @property
    def cases(self) -> dict[str, object]:
        """Solutions for the default arguments, for up to four steps of the scene, and for changed arguments."""
        solver, base = self.solver, self.arguments.defaults
        names = [name for one in self.arguments.arguments for name in one.names]
        chosen = [base]
        for step in self.scene.analysis.steps[:-1][:4]:
            chosen.append(np.array([step if n == "factor" else x for n, x in zip(names, base, strict=True)]))
        chosen += [np.clip(base * (1.0 + shift), *self.limits) for shift in (0.03, -0.07)]
        solved = [solver.solve(case) for case in chosen]
        results = [result for _, result in solved]
        return {
            "n_cases": len(chosen),
            "case_statuses": ", ".join(str(int(outcome.code)) for outcome, _ in solved),
            "case_arguments": rows(chosen),
            "case_results": rows(results),
            "units": row(self.units(results)),
        }
