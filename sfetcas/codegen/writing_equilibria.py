"""An equilibrium solver as C: its functions, the tables of the driver, and the cases of the check."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..description.records import counted
from ..mathematics.source import sparsity_table, table
from ..parametric.equilibrium import EquilibriumSolver
from ..parametric.watching import LEAST
from ..solvers.globalised import MEANINGS, Code
from .rendering import Status, Writer, filled, row, rows, template

__all__ = ["EquilibriumWriter"]

PIVOTS = "with_pivots_as_they_come"

SLOPES = "`{name}_sensitivities` gives the derivatives of all results by all arguments at a solution.\n\n"
"""Sentence of the README about sensitivities."""


class EquilibriumWriter(Writer):
    """The files of an equilibrium solver, optionally with the derivatives of results by arguments."""

    header, example, check = "solver.h", "main.c", "check.c"
    loader, readme = "loader.py.in", "README.md"

    def __init__(self, solver: EquilibriumSolver, *, sensitivities: bool = False) -> None:
        super().__init__(solver.name, solver.scene, solver.arguments, solver.results)
        self.solver, self._sensitivities = solver, sensitivities
        self.bodies = ("solver.c", "sensitivities.c") if sensitivities else ("solver.c",)

    @property
    def functions(self) -> list[ca.Function]:
        """The functions of the solver and its program, and those that compute the results."""
        solver, program = self.solver, self.arguments.program
        found = [solver.prepare, solver.output, program.begin, program.hold, program.move, program.at, program.left]
        if self.model.downhill:
            found += [program.merit, program.convex]
        if solver.margins is not None:
            found.append(solver.margins)
        if self.model.has_potential:
            found.append(_pivots())
        if solver.method.pivoted:
            found.append(program.linear)
        return [*found, solver.sensitivities] if self._sensitivities else found

    @property
    def roots(self) -> set[str]:
        """All functions, with CasADi's factorisation and solution in place of the one that solves linear systems."""
        return super().roots - {PIVOTS} | {"casadi_ldl", "casadi_ldl_solve"}

    @property
    def statuses(self) -> list[Status]:
        """The codes of :class:`~sfetcas.solvers.globalised.Code`."""
        codes = [code for code in Code if code is not Code.TOUCHES or self.solver.margins is not None]
        return [(code.name, int(code), MEANINGS[code]) for code in codes]

    @property
    def states(self) -> int:
        """Length of a state of the program."""
        return self.arguments.program.states

    @property
    def _sizes(self) -> dict[str, int]:
        program = self.arguments.program
        lower = self._lower[0].nnz() if self.model.has_potential else 0
        return {
            "sz_given": max(1, program.symbol.shape[0]),
            "sz_total": max(1, program.expressions.total),
            "sz_entries": max(1, program.sparsity.nnz()),
            "sz_lower": max(1, lower),
        }

    @property
    def _margins(self) -> int:
        """Number of margins that are looked at."""
        margins = self.solver.margins
        return 0 if margins is None else int(margins.numel_out(0))

    @property
    def memory(self) -> int:
        """Number of doubles for states, residuals, matrices and factors."""
        given, total, entries, lower = self._sizes.values()
        return 2 * given + 4 * max(1, self.states) + 8 * total + 5 * entries + lower + self._margins

    @property
    def own(self) -> dict[str, object]:
        """Sizes of the memory, and texts about the model and the sensitivities."""
        names: dict[str, object] = {"name": self.name, "NAME": self.name.upper()}
        flexible = counted(self.model.mesh.elements, f"{self.model.element.name} element")
        unknowns = counted(self.arguments.expressions.total, "unknown")
        started = self.solver.start is not None
        return {
            **self._sizes,
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
    def _lower(self) -> tuple[ca.Sparsity, list[int]]:
        """Pattern of the factor of the matrix without pivoting, and the order of the unknowns in it."""
        found, order = self.arguments.program.sparsity.ldl(True)
        return found, list(order)

    @property
    def tables(self) -> list[str]:
        """Sizes, rules of the method, ranges of arguments, start, and patterns of the matrix."""
        solver, program = self.solver, self.arguments.program
        equations = program.equations
        moments, loads = program.slice_of_moments, program.slice_of_loads
        begun = solver.followed_from
        constants: dict[str, object] = {
            "TOTAL": program.expressions.total,
            "UNKNOWNS": equations.unknowns,
            "TURNING": equations.rotation_unknowns,
            "ENTRIES": program.sparsity.nnz(),
            "STATE": program.states,
            "MULTIPLIERS": program.states - program.expressions.layout.unwrapped - equations.rows,
            "GIVEN": program.symbol.shape[0],
            "LOADS": loads.start,
            "MOMENT": moments.start,
            "MOMENTS": moments.stop - moments.start,
            "SYMMETRIC": int(self.model.has_potential),
            "PIVOTED": int(solver.method.pivoted),
            "MINIMISABLE": int(self.model.minimisable),
            "DOWNHILL": int(self.model.downhill),
            "SLIDING": self.model.mesh.sliding,
            "BEGUN": int(begun is not None),
            "MARGINS": self._margins,
            "LEAST": LEAST,
            "STARTED": int(solver.start is not None),
            **{key.upper(): value for key, value in vars(solver.rules).items()},
        }
        found = [
            "\n".join(f"#define SF_{key} {value!r}" for key, value in constants.items()) + "\n",
            *self.ranges,
            table("sf_diagonal", solver.method.diagonal, "int"),
            table("sf_mass", solver.method.mass),
            table("sf_soft", solver.method.soft),
            table("sf_start", solver.start if solver.start is not None else np.zeros(0)),
        ]
        if begun is not None:
            found.append(table("sf_begun", begun[0]))
        if self.model.downhill:
            found.append(table("sf_seed", solver.method.seed))
        if self.model.has_potential:
            lower, order = self._lower
            found += [
                sparsity_table("sf_pattern", program.sparsity),
                sparsity_table("sf_lower", lower),
                table("sf_order", np.array(order), "int"),
            ]
        return found

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


def _pivots() -> ca.Function:
    """A small function that factorises without pivoting, so that CasADi writes the C code which the driver calls."""
    matrix, b = ca.MX.sym("matrix", 2, 2), ca.MX.sym("b", 2)
    return ca.Function(PIVOTS, [matrix, b], [ca.solve(matrix, b, "ldl")])
