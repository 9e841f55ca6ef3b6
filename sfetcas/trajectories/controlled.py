"""A scene as a controlled system: its equations of motion at one time as a CasADi Function.

They are those of :mod:`~sfetcas.dynamics.stages`: the residual under forces of inertia and damping, and the quantities
whose rates cause these.  Written with quantities, rates and accelerations of their own,

    0 = balance(d, v, a, numbers),    x = quantities(d, numbers),    x' = v,    v' = a,

they contain neither time nor time step; a transcription adds linear relations between x, v and a.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..dynamics.stages import StageEquations
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.equations import Equations
from ..mechanics.expressions import moved_by
from ..mechanics.masses import masses_of
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from ..parametric.arguments import Arguments, argument, asked_for
from ..parametric.equilibrium import Place, chosen_places
from ..parametric.moving import answers_of_motion, forces_are_unique, motion_of, parametric_stages
from ..parametric.results import Result, Results
from .statement import Control, Variable

__all__ = ["ControlledSystem"]

COMMANDED = ("loads", "tendons", "actuations", "fields", "histories")
"""Tables of what may change with time as a control says."""


class ControlledSystem:
    """One scene on one mesh, with controls and unknown constants.

    Parameters
    ----------
    scene : Scene
    controls, variables : numbers that change with time, and unknown numbers that are constant
    answers : names of the answers that are needed
    places : fractions of the length at which answers along members are needed
    settings : accuracy, elements
    mesh : the mesh; by default the first one for the scene's accuracy

    Attributes
    ----------
    total : int
        Number of rotation unknowns, displacements and multipliers.
    quantities : int
        Number of the quantities that carry mass or are damped.
    time : float
        Unit of time, s.
    begin : InitialState
        The initial state.
    """

    def __init__(
        self,
        scene: Scene,
        controls: Sequence[Control],
        variables: Sequence[Variable],
        answers: Sequence[str],
        places: Place | None = None,
        settings: Settings | None = None,
        mesh: Mesh | None = None,
    ) -> None:
        simulation = motion_of(scene, settings or Settings())
        self.scene = simulation.scene
        self._refuse(controls, variables)
        base = assemble(self.scene, mesh or simulation.mesh, assembly="nodal")
        if _nothing_bends(self.scene):
            # Then the time is that of the motion, so that units of the scene do not matter.
            share = masses_of(base).time / self.scene.analysis.duration
            scales = replace(base.scales, moment=base.scales.moment * share**2)
            base = assemble(self.scene, base.mesh, assembly="nodal", scales=scales)
        members = [n for n, member in self.scene.members.items() if member.type == "flexible"]
        known = [argument(self.scene, one.name) for one in controls]
        known += asked_for(self.scene, {one.name: one.parameter for one in variables})
        for one in known:
            if len(one.default) != 1:
                accepted = ", ".join(one.names)
                raise SceneError(f"{one.name}: found {len(one.default)} numbers, accepted: one of them, as {accepted}")
        own = masses_of(base)
        stages = StageEquations(Equations(base), own, "interpreted")
        self.begin, self.notes = simulation.begun(stages)
        unique = forces_are_unique(stages, self.begin.state)
        self.results = Results(base, list(answers), chosen_places(members, places or {}), motion=True, unique=unique)
        self.arguments = Arguments(self.scene, base, known, self.results)
        self.system = parametric_stages(self.arguments, own)
        self.model, self.time = self.arguments.model, own.time
        self.total, self.quantities = self.system.total, self.system.layout.x

    def _refuse(self, controls: Sequence[Control], variables: Sequence[Variable]) -> None:
        scene, names = self.scene, [one.name for one in controls]
        for name in names:
            path = name.split(".")
            field = scene.fields.get(path[1]) if path[0] == "fields" else None
            if path[0] not in COMMANDED or (field is not None and (field.type == "dipole" or "value" not in path)):
                accepted = "a component of the value of a load, an actuation or a field, a number of a tendon, or"
                raise SceneError(f"found {name!r}, accepted: {accepted} histories.NAME of one", ("controls",))
        for name, field in scene.fields.items():
            if field.table is not None and scene.magnets:
                message = "found a table, with which no control knows where it ends, accepted: another type of field"
                raise SceneError(message, ("fields", name))
        for name, tendon in scene.tendons.items():
            controlled = any(one.startswith(f"tendons.{name}.") for one in names) or tendon.history is not None
            if controlled and tendon.rubs:
                what = "pull" if tendon.measured else "tension"
                message = f"found a control of a {what} that may rise and fall, with which friction would jump,"
                raise SceneError(f"{message} accepted: a tendon without friction", ("controls", f"tendons.{name}"))
            if controlled and tendon.measured and tendon.stiffness is None:
                message = "found a control of a length that has to be followed at once, accepted: of a tension, or of a"
                raise SceneError(f"{message} tendon with a stiffness", ("controls", f"tendons.{name}"))
        moved = {motion.history for motion in scene.motions.values()}
        for name in sorted(scene.histories_used - moved):
            if f"histories.{name}" not in names:
                message = f"found the history {name!r}, accepted: loads that are constant or controlled"
                raise SceneError(f"{message}, as controls {{'histories.{name}': (low, high)}}", ("histories",))
        driven = [name for name, one in scene.motions.items() if one.history is not None]
        if driven:
            raise SceneError(f"found {driven[0]!r}, accepted: motions that stand still", ("motions",))
        if variables and scene.analysis.initial == "equilibrium":
            message = "found initial = 'equilibrium', which variables change, accepted: 'undeformed'"
            raise SceneError(message, ("analysis",))

    # -- numbers ----------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers: controls, then constant unknowns."""
        return tuple(name for one in self.arguments.arguments for name in one.names)

    @property
    def reference(self) -> Array:
        """Initial rotations and turn-counting angles as one vector, see :meth:`referring`; the reference of ``d``."""
        return self.referring(self.begin.state.q, self.begin.state.unwrapped)

    @staticmethod
    def referring(q: Array, unwrapped: Array) -> Array:
        """Rotations (rotations, components) and turn-counting angles (angles,) as one vector."""
        return np.concatenate([q.ravel(), unwrapped])

    @functools.cached_property
    def start(self) -> Array:
        """The vector ``d`` (total,) of the initial state, dimensionless: no rotation, displacements, multipliers."""
        state = self.begin.state
        return np.concatenate([np.zeros(self.system.equations.rotation_unknowns), state.y, state.lam])

    def result(self, name: str) -> Result:
        """Shape, unit and meaning of an answer.

        Raises
        ------
        SceneError
            A motion has no such answer.
        """
        return Results(self.model, [name], self.results.places, motion=True).results[0]

    def picked_of(self, result: Result) -> Index:
        """Indices of its numbers that may change: in a plane scene z does not."""
        every = np.arange(result.size, dtype=np.intp)
        flat = not self.model.space and result.shape[-1:] == (3,)
        return every[every % 3 < 2] if flat else every

    @functools.cached_property
    def picked(self) -> dict[str, Index]:
        """For each answer the indices of its numbers that may change."""
        return {one.name: self.picked_of(one) for one in self.results.results}

    def unit(self, name: str) -> float:
        """Scale of an answer in the program, in its unit: the size of the scene for lengths, and so on."""
        scales = self.model.scales
        known = next(one.unit for one in self.results.results if one.name == name)
        units = {"m": scales.length, "N": scales.force, "N m": scales.moment, "m/s": scales.length / self.time}
        return float(units.get(known, 1.0))

    # -- functions --------------------------------------------------------------------------------------

    def _state(self, d: ca.MX, reference: ca.MX, numbers: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """Rotations, displacements, multipliers and counted angles."""
        system, n = self.system, self.system.layout
        q0, unwrapped = ca.vertsplit(reference, [0, n.components * n.rotations, reference.shape[0]])
        q = system.with_prescribed_rotations(ca.MX(ca.reshape(q0, n.components, n.rotations)), system.given(numbers))
        equations = system.equations
        bounds = [0, equations.rotation_unknowns, equations.unknowns, system.total]
        _, y, lam = ca.vertsplit(d, bounds)
        return moved_by(system, q, system.spins(d)), y, lam, unwrapped

    def _symbols(self) -> dict[str, ca.MX]:
        n = self.system.layout
        sizes = {"d": self.total, "v": n.x, "a": n.x, "numbers": n.factors}
        return {name: ca.MX.sym(name, size) for name, size in sizes.items()} | {
            "reference": ca.MX.sym("reference", n.components * n.rotations + n.unwrapped)
        }

    @functools.cached_property
    def stage(self) -> ca.Function:
        """``(d, v, a, numbers, reference) ->`` residual (total,), quantities, answers.

        ``d`` are rotation vectors from the reference, displacements and multipliers, dimensionless as v and a;
        numbers and answers in their own units.
        """
        s, system = self._symbols(), self.system
        q, y, lam, unwrapped = self._state(s["d"], s["reference"], s["numbers"])
        found = system.stage(q, y, lam, system.forces(s["v"], s["a"]), s["numbers"], unwrapped)
        quantities = system.moving(q, y, system.given(s["numbers"]), unwrapped)
        answers = self.outputs(ca.vertcat(ca.vec(q), y, lam, unwrapped), s["numbers"], s["v"], s["a"])
        results = [ca.densify(part) for part in (found.residual, quantities, answers)]
        return ca.Function("stage", list(s.values()), results, list(s), ["balance", "quantities", "answers"])

    def known_at_rates(self, name: str) -> bool:
        """Whether rotations, displacements and velocities tell an answer, without multipliers and accelerations."""
        results = self.results.results
        first = sum(one.size for one in results[: [one.name for one in results].index(name)])
        own = np.arange(first, first + self.result(name).size).tolist()
        by_d, by_a = (self.stage.jac_sparsity(2, i) for i in (0, 2))
        others = list(range(self.system.equations.unknowns, self.total))
        return not by_a.sub(own, list(range(self.quantities)))[0].nnz() and not by_d.sub(own, others)[0].nnz()

    @functools.cached_property
    def outputs(self) -> ca.Function:
        """``(state, numbers, v, a) -> answers``; state: rotations, displacements, multipliers, turn-counting angles."""
        return answers_of_motion(self.results, self.arguments, self.system, self.time)

    @functools.cached_property
    def turned(self) -> ca.Function:
        """``(d, numbers, reference) ->`` rotations, column by column, and angles that count turns."""
        s = self._symbols()
        q, _, _, unwrapped = self._state(s["d"], s["reference"], s["numbers"])
        counted = self.arguments.program.counted(q, unwrapped)
        names = ["d", "numbers", "reference"]
        result = ca.densify(ca.vertcat(ca.vec(q), counted))
        return ca.Function("turned", [s[name] for name in names], [result], names, ["rotations"])

    @functools.cached_property
    def rest(self) -> ca.Function:
        """``(d, v, reference, numbers, impulse, lam) ->`` momentum, residual: both (unknowns,) vanish at rest.

        Rates of structures with constraints depend on each other: at rest all momenta vanish but those along the
        constraints, given by impulses (rows,).  The state is an equilibrium with multipliers lam (rows,).
        """
        s, system = self._symbols(), self.system
        rows, free = system.layout.lam, slice(0, system.equations.unknowns)
        impulse, lam = ca.MX.sym("impulse", rows), ca.MX.sym("lam", rows)
        q, y, _, unwrapped = self._state(s["d"], s["reference"], s["numbers"])
        zeros = ca.MX.zeros(system.layout.x)
        momenta = system.forces(zeros, s["v"])
        pushed = system.stage(q, y, impulse, momenta, s["numbers"], unwrapped).residual
        without = system.stage(q, y, ca.MX.zeros(rows), zeros, s["numbers"], unwrapped).residual
        still = system.stage(q, y, lam, zeros, s["numbers"], unwrapped).residual
        symbols = {name: s[name] for name in ("d", "v", "reference", "numbers")} | {"impulse": impulse, "lam": lam}
        results = [ca.densify((pushed - without)[free]), ca.densify(still[free])]
        return ca.Function("rest", list(symbols.values()), results, list(symbols), ["momentum", "balance"])

    def shapes(self, d: Array, reference: Array, numbers: Array) -> tuple[Array, Array, Array]:
        """Small vibrations about a state at rest: angular frequencies, momenta and elastic forces of the modes.

        Returns
        -------
        omega : (shapes,)
            Angular frequencies times the unit of time, rising; infinite where a mode has no mass.
        momenta, forces : (unknowns, shapes)
        """
        free, still = self.system.equations.unknowns, np.zeros(self.quantities)
        stiffness, pushed, moved = (np.array(part) for part in self._linear(d, still, still, numbers, reference))
        mass = (pushed @ moved)[:free, :free]
        basis = _null_space(stiffness[free:, :free])
        k, m = (basis.T @ part @ basis for part in (stiffness[:free, :free], mass))
        k, m = 0.5 * (k + k.T), 0.5 * (m + m.T)
        shift, factor = _lifted(k, m)
        inner = np.linalg.solve(factor, np.linalg.solve(factor, m).T)
        values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
        values, vectors = values[::-1], vectors[:, ::-1]
        shapes = basis @ np.linalg.solve(factor.T, vectors)
        massive = values > tolerances.RANK * max(values.max(initial=0.0), TINY)
        squares = np.where(massive, 1.0 / np.where(massive, values, 1.0) - shift, np.inf)
        return np.sqrt(np.maximum(squares, 0.0)), mass @ shapes, stiffness[:free, :free] @ shapes

    @functools.cached_property
    def _linear(self) -> ca.Function:
        """(d, v, a, numbers, reference) -> derivatives of the balance by d and by a, and of the quantities by d."""
        s = self._symbols()
        balance, quantities, _ = self.stage.call(list(s.values()))
        found = [ca.jacobian(balance, s["d"]), ca.jacobian(balance, s["a"]), ca.jacobian(quantities, s["d"])]
        return ca.Function("linear", list(s.values()), [ca.densify(part) for part in found])


def _nothing_bends(scene: Scene) -> bool:
    """Whether nothing resists a motion by its stiffness."""
    elastic = any(tendon.stiffness is not None for tendon in scene.tendons.values())
    return not scene.springs and not elastic and all(member.type == "rigid" for member in scene.members.values())


def _null_space(rows: Array) -> Array:
    """An orthogonal basis of what rows do not see."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, sizes, right = np.linalg.svd(rows)
    rank = int((sizes > tolerances.RANK * max(sizes.max(initial=0.0), TINY)).sum())
    return np.asarray(right[rank:].T)


def _lifted(k: Array, m: Array) -> tuple[float, Array]:
    """A shift that makes ``k + shift m`` positive, and its lower Cholesky factor."""
    size = np.abs(k).max(initial=0.0)
    # Shapes without mass and stiffness, if there are any, are no shapes that could vibrate.
    k = k + 1e-12 * size * np.eye(len(k))
    shift = 1.0
    for _ in range(20):
        try:
            return shift, np.linalg.cholesky(k + shift * m)
        except np.linalg.LinAlgError:
            shift *= 10.0
    raise SceneError("the scene at the end: found shapes that neither mass nor stiffness resists, accepted: none")
