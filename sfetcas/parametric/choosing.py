"""Equilibria as functions of parameters where strings may be slack and springs may stand at their stops.

For each choice of what is taut and at a stop, see :mod:`~sfetcas.mechanics.unilateral`, there is a solver of its own;
which choice holds for given numbers is found as in statics.  Multipliers of active constraints are unknowns of the
choice, gaps of the others are the residuals of their rows in a model in which they are active.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.fields import transferred
from ..mechanics.model import Model, assemble
from ..mechanics.unilateral import Stops, Unilateral, unilaterals
from .arguments import Arguments
from .equilibrium import EquilibriumSolver
from .results import Results
from .watching import Gauge, gauges_of, refuse_idle_in_all, stop_margins_of

__all__ = ["Choosing"]

STRICT = 1e-7
"""Margins, dimensionless, that are as small leave it to a change of a number to which side of a change it leads."""


@dataclass(frozen=True, eq=False)
class Choosing:
    """The solvers of one scene on one mesh, by choice.

    Attributes
    ----------
    first : EquilibriumSolver
        That of the choice of the answer of statics.
    equilibria : dict
        What is kept of each choice by who asks for it.
    """

    first: EquilibriumSolver
    equilibria: dict[Stops, Any] = field(default_factory=dict)
    _margins: dict[Stops, ca.Function] = field(default_factory=dict)

    @functools.cached_property
    def constraints(self) -> tuple[Unilateral, ...]:
        """The unilateral constraints of the scene."""
        return unilaterals(self.first.scene)

    def solver(self, stops: Stops) -> EquilibriumSolver:
        """The solver of a choice, made anew but for the first."""
        first = self.first
        if stops == first.model.mesh.stops:
            return first
        base = self._assembled(stops)
        names = [one.name for one in first.results.results]
        results = Results(base, names, first.results.places, unique=first.unique)
        arguments = Arguments(first.scene, base, first.arguments.arguments, results, f"{first.name}_", needed=False)
        solver = replace(first, arguments=arguments, results=results, start=None)
        return solver if first.start is None else replace(solver, start=self.moved(first, first.start, solver))

    def _assembled(self, stops: Stops) -> Model:
        model = self.first.model
        mesh = replace(model.mesh, stops=stops)
        return assemble(self.first.scene, mesh, assembly=model.assembly, scales=model.scales)  # type: ignore[arg-type]

    @staticmethod
    def moved(one: EquilibriumSolver, state: Array, other: EquilibriumSolver) -> Array:
        """A flat state of one solver for another one."""
        if one is other:
            return state
        there = transferred(one.model, one.arguments.program.equations.state(state), other.model)
        return there.flat

    # -- margins --------------------------------------------------------------------------------

    def margins(self, solver: EquilibriumSolver, numbers: Array, flat: Array) -> Mapping[Unilateral, float]:
        """The margin of each constraint, dimensionless, at an equilibrium for numbers (numbers,)."""
        stops = solver.model.mesh.stops
        if stops not in self._margins:
            self._margins[stops] = stop_margins_of("margins", solver.model, solver.arguments, self._gauges)
        found = np.array(self._margins[stops](numbers, flat, solver.prepare(numbers))).ravel()
        return dict(zip(self.constraints, found.tolist(), strict=True))

    @functools.cached_property
    def _gauges(self) -> dict[str, Gauge]:
        first = self.first
        return gauges_of(first.model, first.arguments.arguments, unique=first.unique)

    def check(self) -> None:
        """Refuse numbers on which nothing depends, see :func:`~sfetcas.parametric.watching.refuse_idle_in_all`."""
        refuse_idle_in_all(self.first.arguments, self._gauges)

    def refuse_doubt(self, solver: EquilibriumSolver, numbers: Array, flat: Array) -> None:
        """Refuse derivatives where they differ to the sides of a change.

        Raises
        ------
        SolveError
            A constraint has no margin; names it.
        """
        stops = solver.model.mesh.stops
        for one, margin in self.margins(solver, numbers, flat).items():
            if margin <= STRICT:
                detail = f"{one.becomes(stops)} there, and derivatives differ to either side"
                raise SolveError(Status.KINK, detail)
