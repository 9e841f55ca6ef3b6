"""Energy, constraints and their derivatives as C: functions, patterns, and the cases of the check."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..description.records import counted
from ..mathematics.arrays import Array
from ..mathematics.source import table
from .derivatives import Derivatives
from .rendering import Status, Writer, row, rows

__all__ = ["DerivativesWriter"]

WEIGHT = 0.7
"""Weight of the energy in the Hessians of the check, dimensionless."""


class DerivativesWriter(Writer):
    """The files of a nonlinear program."""

    header, example, check = "derivatives.h", "derivatives_main.c", "derivatives_check.c"
    loader, readme, bodies = None, "derivatives_README.md", ("derivatives.c",)
    last = ()

    def __init__(self, program: Derivatives) -> None:
        super().__init__(program.name, program.scene, program.arguments, program.results)
        self.program = program

    @property
    def functions(self) -> list[ca.Function]:
        """Energy, gradient, constraints, Jacobian and Hessian."""
        return list(self.program.functions.values())

    @property
    def statuses(self) -> list[Status]:
        """Empty: a function always succeeds."""
        return []

    @property
    def states(self) -> int:
        """Number of unknowns."""
        return len(self.program.guess)

    @property
    def memory(self) -> int:
        """0: nothing beside the memory of the functions."""
        return 0

    @property
    def _sizes(self) -> dict[str, int]:
        return {what: function.nnz_out(0) for what, function in self.program.functions.items()}

    @property
    def own(self) -> dict[str, object]:
        """Numbers of entries, the units of length and energy, and words for the README."""
        sizes = self._sizes
        flexible = counted(self.model.mesh.elements, f"{self.model.element.name} element")
        rows_of = counted(sizes["constraints"], "constraint")
        return {
            "n_constraints": sizes["constraints"],
            "n_jacobian": sizes["jacobian"],
            "n_hessian": sizes["hessian"],
            "n_numbers": sum(sizes.values()),
            "sz_x": max(1, self.states),
            "sz_g": max(1, sizes["constraints"]),
            "unit_of_length": repr(self.model.scales.length),
            "unit_of_energy": repr(self.model.scales.moment),
            "indent": " " * len(f"void {self.name}_hessian("),
            "model_in_words": f"In {self.where}: {flexible}, {counted(self.states, 'unknown')}, {rows_of}.",
        }

    @property
    def about(self) -> dict[str, Any]:
        """Functions, units, names of the constraints, and patterns of the matrices."""
        names = ["energy", "gradient", "constraints", "jacobian", "hessian", "guess", "defaults"]
        scales = {"length": self.model.scales.length, "energy": self.model.scales.moment}
        found: dict[str, Any] = {"functions": names, "units": scales, "constraints": list(self.program.nlp.rows)}
        for what, pattern in self.program.patterns.items():
            found[what] = {"shape": list(pattern.shape), "colind": pattern.colind(), "row": pattern.row()}
        return found

    @property
    def tables(self) -> list[str]:
        """The guess, and the patterns of the matrices."""
        found = [table("sf_guess", self.program.guess)]
        for what, pattern in self.program.patterns.items():
            found.append(table(f"sf_{what}", np.array([*pattern.colind(), *pattern.row()]), "int"))
        return found

    @property
    def cases(self) -> dict[str, object]:
        """The functions at the guess and at two points near it, with other arguments and random multipliers."""
        random, program = np.random.default_rng(0), self.program
        base, count = self.arguments.defaults, self._sizes["constraints"]
        arguments, places, multipliers, results = [], [], [], []
        for share in (0.0, 0.01, 0.1):
            arguments.append(base * (1.0 + share))
            places.append(program.guess + share * random.standard_normal(self.states))
            multipliers.append(random.standard_normal(count))
            results.append(self._evaluated(arguments[-1], places[-1], multipliers[-1]))
        return {
            "n_cases": len(results),
            "case_arguments": rows(arguments),
            "case_places": rows(places),
            "case_multipliers": rows(multipliers),
            "case_results": rows(results),
            "units": row(np.zeros(0)),
        }

    def _evaluated(self, p: Array, x: Array, multipliers: Array) -> Array:
        """The values of all functions, one after the other, (numbers,)."""
        found = []
        for what, function in self.program.functions.items():
            values = function(p, x, WEIGHT, multipliers) if what == "hessian" else function(p, x)
            found.append(np.array(values).ravel())
        return np.concatenate(found)
