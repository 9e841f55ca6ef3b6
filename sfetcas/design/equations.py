"""The equilibrium of a case as constraints of a larger program: functions of a step from a reference state and numbers.

The unknown of an equilibrium is no state but the *step* that leads to it from a reference: rotation vectors of the
nodes, displacements, multipliers.  So there are no norms to keep and no more unknowns than equations, and what comes
out is an equilibrium whatever the reference was.  References are constants: all cases share one function, and another
reference builds nothing again.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.inputs import Inputs
from ..mechanics.mesh import Mesh, breaks_of
from ..mechanics.model import assemble
from ..parametric.arguments import Argument, Arguments, refuse_idle
from ..parametric.results import Results
from ..solvers.globalised import Code, Globalised, Rules
from ..solvers.prepared import Prepared
from ..solvers.program import Program

__all__ = ["CaseEquations", "Place"]

LEFT, FITS, FITTED = 0.05, 12, 1e-9
"""Share of what is between the end of a line and a kink that is kept; meshes at most until elements end where lines do,
and how far these may be apart, fractions of a length: what presses between is one force, off by the square of that.
"""

Place = Mapping[str, Sequence[float]]
"""Fractions of the length of members at which they are told of."""

SHORTEST = 1.0 / 64
"""Step, share of the way from one set of numbers to another one, at least."""


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
    ends : int
        Number of places where lines on obstacles end, at which elements end: unknowns that come after the free numbers.
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
        self.arguments = Arguments(scene, base, arguments, self.results, "design_", needed=False)
        # Numbers of an obstacle count as soon as it is touched.
        refuse_idle([name for name in self.arguments.idle if not name.startswith("contacts.")])
        self.program = self.arguments.program
        self.model = self.arguments.model
        self.total = self.program.expressions.total
        self.ends = len(self.arguments.ends)
        self.free = list(free)
        self.fixed = [i for i in range(len(arguments)) if i not in set(free)]
        self._step = ca.MX.sym("step", self.total)
        self._free = ca.MX.sym("free", len(self.free) + self.ends)
        self._state = ca.MX.sym("state", self.program.states)
        self._fixed = ca.MX.sym("fixed", len(self.fixed))

    # -- expressions --------------------------------------------------------------------------------

    @functools.cached_property
    def _numbers(self) -> ca.MX:
        numbers, free = ca.MX.zeros(len(self.free) + len(self.fixed)), len(self.free)
        numbers[self.free] = self._free[:free]
        numbers[self.fixed] = self._fixed
        return ca.densify(ca.vertcat(numbers, self._free[free:]) if self.ends else numbers)

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
        """(w, c) -> result, w a step, free numbers, ends and more, c a reference and fixed numbers."""
        w, c = ca.vertcat(self._step, self._free, *more), ca.vertcat(self._state, self._fixed)
        flat_w, flat_c = ca.MX.sym("w", w.numel()), ca.MX.sym("c", c.numel())
        whole = ca.Function(name, [self._step, self._free, *more, self._state, self._fixed], [result])
        of_w = ca.vertsplit(flat_w, np.cumsum([0, self.total, self._free.numel(), *(m.numel() for m in more)]).tolist())
        of_c = ca.vertsplit(flat_c, [0, self.program.states, c.numel()])
        return ca.Function(name, [flat_w, flat_c], whole.call([*of_w, *of_c]))

    # -- functions ------------------------------------------------------------------------------------

    @functools.cached_property
    def balance(self) -> ca.Function:
        """``(w, c) ->`` residual of the equilibrium, (total,), dimensionless; w unknowns, c constants of a case."""
        return self._function("balance", [], self._at(self.program.stationarity.residual))

    def _told(self, told: Callable[[Program, ca.MX], ca.MX]) -> ca.MX:
        """What is told of a program and undeformed positions, after the step."""
        rest = self.arguments.undeformed(self._numbers)
        undeformed, program = ca.MX.sym("undeformed", rest.numel()), self.program
        symbols = [program.state_symbol, program.symbol, undeformed]
        outputs = ca.Function("outputs", symbols, [ca.densify(told(program, undeformed))])
        return outputs(self._there, self._given, rest)

    @functools.cached_property
    def _outputs(self) -> ca.MX:
        """All results, flat."""
        return self._told(self.results.expression)

    @functools.cached_property
    def beside(self) -> ca.Function:
        """``(w, c) ->`` how far lines end from where elements do, (ends,), fractions of the lengths of members."""
        ends = self.arguments.ends
        there = self._told(lambda program, undeformed: self.results.touches(program, undeformed, ends))
        return self._function("beside", [], there - self._free[len(self.free) :])

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
    def room(self) -> tuple[Array, Array]:
        """Least and largest places (ends,) at which elements may end with lines, fractions of a length.

        ``LEFT`` of what is between them and kinks, and half of what is between two of them, is kept.
        """
        low, high = np.zeros(self.ends), np.ones(self.ends)
        ends = list(zip((point.members[0] for point in self.arguments.ends), self.arguments.places, strict=True))
        for i, (member, place) in enumerate(ends):
            kinks = [(float(x), LEFT) for x in breaks_of(self.scene, member)]
            others = [(x, 0.5) for k, (name, x) in enumerate(ends) if name == member and k != i]
            before, kept = max(one for one in [*kinks, *others] if one[0] < place)
            after, left = min(one for one in [*kinks, *others] if one[0] > place)
            low[i], high[i] = before + kept * (place - before), after - left * (after - place)
        return low, high

    @functools.cached_property
    def method(self) -> Globalised:
        """Globalised Newton method, for the first equilibria."""
        return self._method(Rules())

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
        numbers : (size,), in the units of the scene, then places where elements end with lines
        start : state to start from; by default the undeformed one
        switch_branch : leave an unstable equilibrium for a stable one
        """
        row = np.array(self.program.row(self.prepare(numbers))).ravel()
        flat = None if start is None else start.flat
        method = self.method if switch_branch else self._near
        outcome = method(row, flat)
        if outcome.code not in (Code.SOLVED, Code.UNSTABLE):
            return None, False
        return outcome.state, outcome.negative <= 0

    def fitted(self, numbers: Array, start: State | None, places: Array) -> tuple[Array | None, Array]:
        """The equilibrium (states,) for values (numbers,), and the places (ends,) where lines end there, from others.

        None where none was found.
        """
        for _ in range(FITS):
            found, _ = self.equilibrium(np.concatenate([numbers, places]), start)
            if found is None or not self.ends:
                return found, places
            w = np.concatenate([np.zeros(self.total), numbers[self.free], places])
            apart = np.array(self.beside(w, np.concatenate([found, numbers[self.fixed]]))).ravel()
            if np.abs(apart).max() <= FITTED:
                return found, places
            places, start = places + apart, self.program.equations.state(found)
            low, high = self.room
            if not ((low < places) & (places < high)).all():
                break
        return None, places

    def led(self, begin: Array, end: Array, start: State, places: Array) -> tuple[Array | None, Array]:
        """As :meth:`fitted` from the equilibrium for other numbers: at once, or along lines in steps, as these end near
        to where they did.
        """
        share, step = 0.0, 1.0
        while step >= SHORTEST:
            there = min(1.0, share + step)
            found, fitted = self.fitted(begin + there * (end - begin), start, places)
            if found is None:
                step *= 0.5 if self.ends else 0.0
            elif there == 1.0:
                return found, fitted
            else:
                share, start, places = there, self.program.equations.state(found), fitted
        return None, places

    @functools.cached_property
    def _near(self) -> Globalised:
        return self._method(Rules(escapes=0))

    def _method(self, rules: Rules) -> Globalised:
        prepared = Prepared(self.model)
        return Globalised(Inputs(prepared.equations, self.program.varying), prepared.weight, rules)
