"""The equilibrium of a case as constraints of a larger program: functions of a step from a reference state and numbers.

The unknown of an equilibrium is no state but the *step* that leads to it from a reference: rotation vectors of the
nodes, displacements, multipliers.  So there are no norms to keep and no more unknowns than equations, and what comes
out is an equilibrium whatever the reference was.  References are constants: all cases share one function, and another
reference builds nothing again.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from ..parametric.arguments import Argument, Arguments
from ..parametric.results import Results
from ..solvers.globalised import Code, Globalised, Rules
from ..solvers.prepared import Prepared

__all__ = ["CaseEquations", "Place"]

Place = Mapping[str, Sequence[float]]
"""Fractions of the length of members at which they are told of."""


class CaseEquations:
    """Functions that all cases share, on one mesh.

    Parameters
    ----------
    scene : Scene
        With start values of its numbers.
    mesh : Mesh
    assembly : str
        As of :func:`~sfetcas.assemble`.
    arguments : sequence of Argument
        Numbers that vary from case to case, or are unknown; single numbers only.
    free : sequence of int
        Indices of those that are unknown in any case.
    results : sequence of str
        Names of the results that are needed.
    places : mapping
        Fractions of the length at which results along members are needed.

    Attributes
    ----------
    total : int
        Number of unknowns of a step, multipliers included.
    """

    def __init__(
        self,
        scene: Scene,
        mesh: Mesh,
        assembly: str,
        arguments: Sequence[Argument],
        free: Sequence[int],
        results: Sequence[str],
        places: Place,
    ) -> None:
        self.scene, self.mesh, self.assembly = scene, mesh, assembly
        of_all: Any = assembly
        base = assemble(scene, mesh, assembly=of_all)
        self.scales = base.scales
        self.results = Results(base, results, places)
        self.arguments = Arguments(scene, base, arguments, self.results, "design_")
        self.program = self.arguments.program
        self.model = self.arguments.model
        self.total = self.program.expressions.total
        self.free = list(free)
        self.fixed = [i for i in range(len(arguments)) if i not in set(free)]
        self._step = ca.MX.sym("step", self.total)
        self._free = ca.MX.sym("free", len(self.free))
        self._state = ca.MX.sym("state", self.program.states)
        self._fixed = ca.MX.sym("fixed", len(self.fixed))

    # -- expressions --------------------------------------------------------------------------------

    @functools.cached_property
    def _numbers(self) -> ca.MX:
        numbers = ca.MX.zeros(len(self.free) + len(self.fixed))
        numbers[self.free] = self._free
        numbers[self.fixed] = self._fixed
        return ca.densify(numbers)

    @functools.cached_property
    def _given(self) -> ca.MX:
        return ca.densify(self.arguments.given(self._numbers))

    @functools.cached_property
    def _there(self) -> ca.MX:
        """The state after the step."""
        program = self.program
        return program.move(program.hold(self._state, self._given), self._step, 1.0)

    def _at(self, expression: ca.MX) -> ca.MX:
        """An expression of the state and what is given, after the step."""
        program = self.program
        function = ca.Function("there", [program.state_symbol, program.symbol], [ca.densify(expression)])
        return function(self._there, self._given)

    def _function(self, name: str, more: Sequence[ca.MX], result: ca.MX) -> ca.Function:
        """(w, c) -> result, w a step, free numbers and more, c a reference and fixed numbers."""
        w, c = ca.vertcat(self._step, self._free, *more), ca.vertcat(self._state, self._fixed)
        flat_w, flat_c = ca.MX.sym("w", w.numel()), ca.MX.sym("c", c.numel())
        whole = ca.Function(name, [self._step, self._free, *more, self._state, self._fixed], [result])
        of_w = ca.vertsplit(flat_w, np.cumsum([0, self.total, len(self.free), *(m.numel() for m in more)]).tolist())
        of_c = ca.vertsplit(flat_c, [0, self.program.states, c.numel()])
        return ca.Function(name, [flat_w, flat_c], whole.call([*of_w, *of_c]))

    # -- functions ------------------------------------------------------------------------------------

    @functools.cached_property
    def balance(self) -> ca.Function:
        """``(w, c) ->`` residual of the equilibrium, (total,), dimensionless; w unknowns, c constants of a case."""
        return self._function("balance", [], self._at(self.program.stationarity.residual))

    @functools.cached_property
    def _outputs(self) -> ca.MX:
        """All results, flat."""
        undeformed = ca.MX.sym("undeformed", self.arguments.undeformed(self._numbers).numel())
        program = self.program
        symbols = [program.state_symbol, program.symbol, undeformed]
        outputs = ca.Function("outputs", symbols, [ca.densify(self.results.expression(program, undeformed))])
        return outputs(self._there, self._given, self.arguments.undeformed(self._numbers))

    @functools.cached_property
    def outputs(self) -> ca.Function:
        """``(w, c) ->`` all results, flat, in SI units."""
        return self._function("outputs", [], self._outputs)

    def lifted(self, part: Sequence[int]) -> ca.Function:
        """``(w, c) ->`` some of the results less unknowns that stand for them, which come last in w."""
        said = ca.MX.sym("said", len(part))
        return self._function("lifted", [said], said - self._outputs[list(part)])

    @functools.cached_property
    def mass(self) -> Array:
        """Weights (total,) of the eigenvalue problem of stability, as in certificates; only rotations have any."""
        equations = self.program.equations
        return np.concatenate([equations.mass, np.zeros(self.total - equations.rotation_unknowns)])

    @functools.cached_property
    def eigen(self) -> ca.Function:
        """``(w, c) -> K v - sigma M v`` on the constraints, and ``v.M v - 1``; w ends with v, multipliers, sigma."""
        v, sigma = ca.MX.sym("v", self.total), ca.MX.sym("sigma")
        tangent, mass = self._at(self.program.matrix), self.mass
        rows = ca.mtimes(tangent, v) - sigma * ca.DM(mass) * v
        return self._function("eigen", [v, sigma], ca.vertcat(rows, ca.dot(v, ca.DM(mass) * v) - 1.0))

    @functools.cached_property
    def arrive(self) -> ca.Function:
        """``(w, c) ->`` the state after the step, (states,)."""
        return self._function("arrive", [], self._there)

    # -- numbers ----------------------------------------------------------------------------------------

    @functools.cached_property
    def method(self) -> Globalised:
        """Globalised Newton method, for the first equilibria."""
        return Globalised(self.program, Prepared(self.model).weight, Rules())

    @functools.cached_property
    def prepare(self) -> ca.Function:
        """``(numbers) ->`` data and loads of the equations."""
        return self.arguments.prepare("design_prepare")

    def equilibrium(
        self, numbers: Array, start: State | None, *, switch_branch: bool = True
    ) -> tuple[Array | None, bool]:
        """The equilibrium (states,) for values of all numbers (None where none was found), and whether it is stable.

        Parameters
        ----------
        numbers : (numbers,), in the units of the scene
        start : state to start from; by default the undeformed one
        switch_branch : leave an unstable equilibrium for a stable one
        """
        given = np.array(self.prepare(numbers)).ravel()
        flat = None if start is None else self.program.flat(start)
        method = self.method if switch_branch else self._near
        outcome = method(given, flat)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return None, False
        return outcome.state, outcome.negative <= 0

    @functools.cached_property
    def _near(self) -> Globalised:
        return Globalised(self.program, Prepared(self.model).weight, Rules(escapes=0))
