"""The equations of motion as functions of numbers of the scene, which replace the factors of its loads."""

from __future__ import annotations

import functools
from dataclasses import replace

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..dynamics.simulation import Simulation
from ..dynamics.stages import StageEquations
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.kernels import Direct
from ..mechanics.equations import State
from ..mechanics.expressions import Given
from ..mechanics.inputs import Inputs
from ..mechanics.masses import Masses, masses_of
from ..mechanics.terms import Term, rows_of
from ..mechanics.unilateral import NONE, UnilateralRows
from ..solvers.redundancy import loose_rows
from .arguments import Arguments
from .equilibrium import refuse_search
from .results import Moving, Results

__all__ = ["ParametricStages", "answers_of_motion", "forces_are_unique", "motion_of", "parametric_stages"]


class ParametricStages(StageEquations):
    """The equations of motion whose ``factors`` are the values of arguments."""

    def __init__(self, arguments: Arguments, masses: Masses, unilateral: UnilateralRows = NONE) -> None:
        super().__init__(arguments.expressions.equations, masses, "interpreted", unilateral=unilateral)
        self._arguments = arguments
        self.layout = replace(self.layout, factors=len(arguments.defaults))

    def given(self, factors: ca.MX) -> Given:
        """Data and loads for values of the arguments."""
        return self._arguments.program.given_by(self._arguments.given(factors))

    @property
    def inputs(self) -> Inputs:
        """What is given at a stage of a step, with the data that vary."""
        return self._arguments.program.inputs

    @functools.cached_property
    def row(self) -> ca.Function:
        """(arguments) -> the row of :attr:`inputs`."""
        program, p = self._arguments.program, ca.MX.sym("arguments", self.layout.factors)
        row = program.row(self._arguments.given(p))
        return ca.Function(f"{program.prefix}inputs", [p], [row], ["arguments"], ["row"])

    @functools.cached_property
    def _row(self) -> Direct:
        return Direct(self.row)

    def rows(self, factors: Array) -> Array:
        """Rows of :attr:`inputs` (stages, numbers) for values (stages, numbers) of the arguments."""
        return np.stack([self._row(one) for one in factors])


def motion_of(scene: Scene, settings: Settings, *, one_sided: bool = False) -> Simulation:
    """The dynamic analysis of a scene, not yet run; ``one_sided`` if what stops members may have to be found.

    Raises
    ------
    SceneError
        It needs a search that has no derivatives, or cannot be modelled.
    """
    refuse_search(scene, stopped=one_sided, touching=one_sided, moving=True)
    return Simulation(scene, settings)


def parametric_stages(arguments: Arguments, masses: Masses, unilateral: UnilateralRows = NONE) -> ParametricStages:
    """The equations of motion as a function of arguments; masses are those of their defaults, rows of obstacles those
    that the model contains.

    Raises
    ------
    SceneError
        An argument changes masses, or how axes rotate.
    """
    model = arguments.model
    found, frame = masses_of(model), model.rotating_frame
    if not _same(masses, found):
        changing = [one.name for one in arguments.arguments if not _same(masses, masses_of(arguments.model_near(one)))]
        message = (
            f"found {', '.join(changing) or 'numbers'}, with which masses change, accepted: loads, motions, stiffness"
        )
        raise SceneError(message, ("arguments",))
    # Coriolis forces are weights of rates, as masses are of accelerations.
    if frame is not None:
        given = np.asarray(arguments.scene_at(arguments.defaults).rotating, dtype=float)
        if not _alike(frame.omega, given):
            raise SceneError("found numbers that turn the axes, accepted: loads, motions, stiffness", ("arguments",))
    return ParametricStages(arguments, found, unilateral)


def forces_are_unique(system: StageEquations, state: State) -> bool:
    """Whether reactions are unique at the first state of a motion: not where constraints depend on each other."""
    equations = system.equations
    return not loose_rows(equations, equations.at(state, system.loading(system.factors(0.0)))).size


def answers_of_motion(results: Results, arguments: Arguments, system: ParametricStages, time: float) -> ca.Function:
    """A function ``(state, numbers, rates, accelerations) -> results``.

    ``state`` has rotations, displacements, multipliers and turn-counting angles, ``rates`` and ``accelerations`` are
    those of the quantities that carry mass; ``time`` is the unit of time, s.  Accelerations are without effect but on
    :attr:`.Results.by_inertia`.
    """
    layout, program = system.layout, arguments.program
    state, p, rates = ca.MX.sym("state", program.states), ca.MX.sym("numbers", layout.factors), ca.MX.sym("v", layout.x)
    accelerations = ca.MX.sym("a", layout.x)
    places = ca.reshape(rates[: system.axes * system.places], system.axes, system.places)
    speeds = places * (arguments.model.scales.length / time)
    kinetic = 0.5 * ca.dot(rates, system.forces(ca.MX.zeros(rates.shape), rates))
    q, y, lam, unwrapped = program.parts
    balance = system.balance(q, y, lam, system.forces(rates, accelerations), program.given, unwrapped)
    outputs = results.expression(program, arguments.undeformed(p), Moving(speeds, kinetic, *balance))
    as_given = ca.substitute([outputs], [program.state_symbol, program.symbol], [state, arguments.given(p)])[0]
    given = {"state": state, "numbers": p, "v": rates, "a": accelerations}
    return ca.Function("answers", list(given.values()), [ca.densify(as_given)], list(given), ["results"])


def _same(one: Masses, other: Masses) -> bool:
    """Whether two models have the same masses."""
    pairs = [(one.inner, other.inner), (one.inner_drag, other.inner_drag), (one.place_drag, other.place_drag)]
    pairs += [(one.places.value, other.places.value)]
    both = list(zip(one.observables, other.observables, strict=True))
    pairs += [(a.mass, b.mass) for a, b in both]
    pairs += [(a.damping, b.damping) for a, b in both]
    # Where masses are, as far as what is observed depends on it; some of these numbers may be rounding of others.
    placed = [(a.data[:, _felt(a.kind)], b.data[:, _felt(b.kind)]) for a, b in both]
    return all(_alike(a, b) for a, b in pairs) and all(_alike(a, b, np.abs(a).max(initial=0.0)) for a, b in placed)


@functools.cache
def _felt(kind: Term) -> list[int]:
    """Which of the data of a kind its rows depend on."""
    return sorted(set(rows_of(kind).jac_sparsity(0, 2).get_col()))


def _alike(one: Array, other: Array, size: float = 0.0) -> bool:
    near = tolerances.DECIMAL
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=near, atol=near * size))
