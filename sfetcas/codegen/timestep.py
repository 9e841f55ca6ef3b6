"""A time step of a motion as one function of a flat state, loads and the length of the step, to be written as C."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene, check_scene
from ..description.showing import shown
from ..dynamics.core_steps import CoreStep, core_step
from ..dynamics.impulses import Impulsive
from ..dynamics.inertia import Inertia
from ..dynamics.inertialess import refuse_spinning
from ..dynamics.integrating import SHORTEST, Stepper
from ..dynamics.methods import Method, Radau
from ..dynamics.motion import Mover
from ..dynamics.simulation import INTEGRATORS, Simulation
from ..dynamics.stages import StageEquations
from ..dynamics.steps import LAST_CHANGE, step_function
from ..dynamics.taken import Memory
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.kernels import Direct
from ..mechanics.equations import Equations
from ..mechanics.masses import masses_of
from ..mechanics.model import Model, assemble
from ..mechanics.spots import spots_of
from ..mechanics.unilateral import rows_of
from ..parametric.arguments import Arguments, Asked, asked_for, in_words
from ..parametric.equilibrium import Place, chosen_places
from ..parametric.moving import ParametricStages, answers_of_motion, forces_are_unique, motion_of, parametric_stages
from ..parametric.results import Results, default_motion_results

__all__ = ["TimeStep", "time_step"]


IMPACT = re.compile(r"contacts\..+\.(restitution|friction)")
"""Numbers that are no arguments of a step."""


@dataclass(frozen=True, eq=False)
class TimeStep:
    """A step of one scene on one mesh by one method, the same in process and in C: that of the core, or of CasADi.

    Attributes
    ----------
    name : str
        Prefix of all names in C.
    scene : Scene
    arguments : Arguments
        Numbers of the scene that are arguments, in their SI units.
    results : Results
    system : ParametricStages
        The equations of a step as expressions of the arguments.
    method : Method
    time : float
        Unit of time of the model, s.
    begin : ndarray (states,)
        First state of the motion, dimensionless; parts as in :attr:`sizes`.
    """

    name: str
    scene: Scene
    arguments: Arguments
    results: Results
    system: ParametricStages
    method: Method
    time: float
    begin: Array

    def __repr__(self) -> str:
        return shown(self, [self.name, self.model.size_in_words], in_words(self.arguments, self.results))

    @property
    def model(self) -> Model:
        """The model, assembled at values of the arguments for which no entry vanishes by chance."""
        return self.arguments.model

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the parts of a state: the motion, data of the last step, and its length (0 for a fresh start)."""
        n, stages = self.system.layout, self.method.stages
        return {
            "q": n.components * n.rotations,
            "y": n.y,
            "lam": n.lam,
            "turns": self.system.turns * n.rotations * stages,
            "shifts": n.y * stages,
            "x": n.x,
            "rates": n.x * self.method.kept,
            "near": n.unwrapped,
            "opening": self.openings,
            "last": 1,
        }

    @property
    def openings(self) -> int:
        """How many numbers a state has of gaps and their rates."""
        return self.method.openings(self.system) if isinstance(self.method, Impulsive) else 0

    @functools.cached_property
    def by_core(self) -> CoreStep | None:
        """The step by the core; None where it is one by CasADi's functions."""
        # A state has angles that count turns, and nothing else that is remembered.
        plain = self.system.layout.unwrapped == self.model.unwrapping.count
        found = core_step(self.system, self.method) if plain else None
        if found is not None:
            found.prefer_pivots_of(self.system.rows(self._values(None)), self.usual / self.time, self.begin)
        return found

    @property
    def usual(self) -> float:
        """Length of steps that the scene asks for, s."""
        analysis = self.scene.analysis
        return float(analysis.step or analysis.duration / 1000.0)

    @functools.cached_property
    def _step(self) -> ca.Function:
        """A step of the method."""
        method = self.method
        return method.step(self.system) if isinstance(method, Impulsive) else step_function(self.system, method)

    @functools.cached_property
    def advance(self) -> ca.Function:
        """(state, h, arguments) -> state after a step of h, s; last change of Newton's method, iterations, largest gap.

        Arguments are (numbers, times): a column for each of :attr:`times` of the step.
        """
        n, program = self.system.layout, self.arguments.program
        step = self._step
        state, h = ca.MX.sym("state", len(self.begin)), ca.MX.sym("h")
        p = ca.MX.sym("arguments", n.factors, len(self.times))
        parts = dict(zip(self.sizes, ca.vertsplit(state, np.cumsum([0, *self.sizes.values()]).tolist()), strict=True))
        span = h / self.time
        # A fresh start has no step before it.
        ratio = ca.if_else(parts["last"] > 0.0, span / ca.fmax(parts["last"], 1e-300), 0.0)
        shaped = [ca.reshape(parts[name], *step.size_in(i)) for i, name in enumerate(list(parts)[:7])]
        given = [*shaped, ratio, span, p, parts["near"], *([parts["opening"]] if "opening" in step.name_in() else [])]
        found = dict(zip(step.name_out(), step(*given), strict=True))
        q = found["q_next"]
        lam = ca.reshape(found["lam_stages"], n.lam, self.method.stages)[:, -1]
        x = ca.reshape(found["x_stages"], n.x, self.method.stages)[:, -1]
        rest = [found["turns_stages"], found["shifts_stages"], x, found["rates_next"]]
        acting = found.get("acting", ca.MX(0, 1))
        angles = parts["near"][: n.unwrapped - 2 * acting.numel()]
        kept = [program.counted(q, angles), acting, ca.MX.zeros(acting.shape), found.get("opening_next", ca.MX(0, 1))]
        after = ca.vertcat(ca.vec(q), found["y_next"], lam, *[ca.vec(part) for part in rest], *kept, span)
        results = [ca.densify(after), found["size"], found["iterations"], found["gap"]]
        names = ["after", "size", "iterations", "gap"]
        return ca.Function(f"{self.name}_advance", [state, h, p], results, ["state", "h", "arguments"], names)

    @functools.cached_property
    def output(self) -> ca.Function:
        """(state, arguments) -> results (results,) in their SI units."""
        layout = self.system.layout
        state, p = ca.MX.sym("state", len(self.begin)), ca.MX.sym("arguments", layout.factors)
        bounds = np.cumsum([0, *self.sizes.values()]).tolist()
        parts = dict(zip(self.sizes, ca.vertsplit(state, bounds), strict=True))
        rates = ca.reshape(parts["rates"], layout.x, self.method.kept)
        # Nothing hangs on it where the method knows none.
        velocity, acceleration = rates[:, 0], rates[:, self.method.acceleration]
        angles = parts["near"][: self.model.unwrapping.count]
        still = ca.vertcat(parts["q"], parts["y"], parts["lam"], angles)
        outputs = answers_of_motion(self.results, self.arguments, self.system, self.time)
        as_given = outputs(still, p, velocity, acceleration)
        return ca.Function(
            f"{self.name}_results", [state, p], [ca.densify(as_given)], ["state", "arguments"], ["results"]
        )

    @property
    def times(self) -> Array:
        """Times (times,) within a step at which arguments are needed, shares of the step."""
        return np.asarray(self.method.loaded)

    @property
    def shortest(self) -> float:
        """The shortest step that is taken, s: in shorter ones rates would be rounding of places over their length."""
        return float(SHORTEST * self.time)

    def step(self, state: Array, h: float, arguments: Array | None = None) -> Array:
        """The state (states,) after a step of h, s.

        It is nan if Newton's method did not converge, arguments are outside of their ranges, or the step is shorter
        than :attr:`shortest`.

        Parameters
        ----------
        state : ndarray (states,)
        h : float
        arguments : ndarray (numbers,) or (times, numbers), optional
            Constant during the step, or at its :attr:`times`; by default the values of the scene.
        """
        p = self._values(arguments)
        if not h >= self.shortest or not all(map(self.arguments.accepted, p)):
            return np.full(len(state), np.nan)
        if self.by_core is not None:
            after, size, *_ = self.by_core.after(self.system.rows(p), h / self.time, state)
        else:
            found = self.advance(state, h, p.T)
            after, size = np.array(found[0]).ravel(), float(found[1])
        good = size <= LAST_CHANGE and np.isfinite(after).all()
        return after if good else np.full(len(state), np.nan)

    def _values(self, arguments: Array | None) -> Array:
        """Values (times, numbers) of the arguments at the times of a step; by default those of the scene."""
        p = self.arguments.defaults if arguments is None else np.asarray(arguments, dtype=float)
        return np.broadcast_to(p, (len(self.times), self.arguments.defaults.size))

    def outputs(self, state: Array, arguments: Array | None = None) -> Array:
        """The results (results,) at a state, in their SI units."""
        p = self.arguments.defaults if arguments is None else np.asarray(arguments, dtype=float)
        return self._output(state, p)

    @functools.cached_property
    def _output(self) -> Direct:
        return Direct(self.output)


def time_step(
    scene: Scene,
    name: str,
    *,
    arguments: Asked = None,
    results: Sequence[str] | None = None,
    places: Place | None = None,
    settings: Settings | None = None,
) -> TimeStep:
    """The step of a scene whose analysis is dynamic.

    Parameters
    ----------
    scene, name, arguments, results, places, settings
        As of :func:`~sfetcas.parametric.equilibrium.equilibrium_solver`.

    Raises
    ------
    SceneError
        The scene or its integrator cannot be exported, or it does not have an argument or result that was asked for.
    """
    check_scene(scene, "export({}, ...)", steps=False)
    simulation = motion_of(scene, settings or Settings(), one_sided=True)
    method = _method(simulation)
    scene = simulation.scene
    mesh = simulation.mesh if simulation.prescribed else simulation.mesh.refined()
    mesh = replace(mesh, spots=spots_of(scene, mesh)) if scene.contacts else mesh
    base = assemble(scene, mesh, assembly="nodal")
    members = [n for n, member in scene.members.items() if member.type == "flexible"]
    own = StageEquations(Equations(base), masses_of(base), "interpreted", unilateral=rows_of(base))
    mover = Mover(own.equations, Inertia(own), own.masses.time, own.factors)
    # Velocities are those that nothing stops.
    begun, _ = simulation.begun(own, mover.free if len(own.unilateral) else None)
    state, loading = begun.state, own.loading(own.factors(0.0))
    unique = forces_are_unique(own, state)
    names = results or default_motion_results(base, forces=unique and _tells_forces(method))
    outputs = Results(base, names, chosen_places(members, places or {}), motion=True, unique=unique)
    if outputs.by_inertia:
        method = _accelerating(method, outputs.by_inertia[0])
    asked = asked_for(scene, arguments)
    for one in asked:
        if IMPACT.fullmatch(one.name):
            raise SceneError("found what impacts have of the scene, accepted: another number", ("arguments", one.name))
    known = Arguments(scene, base, asked, outputs, f"{name}_")
    system = parametric_stages(known, own.masses, own.unilateral)
    rates = np.zeros((method.kept, len(begun.x)))
    rates[0] = begun.v
    given = state.q, state.y, state.lam, begun.x, rates, state.unwrapped
    memory = Memory(0.0, *given, acting=begun.touching, held=0.0 * begun.touching)
    if method.kept > 1 or base.segments.pulled:
        step = scene.analysis.step or scene.analysis.duration / 1000.0
        # How tendons pull at once is asked of a method that knows which rows act.
        stepper = Stepper(own, Radau(2) if isinstance(method, Impulsive) else method)
        memory = stepper.refreshed(memory, step / own.masses.time)
    if outputs.by_inertia:
        free, (v, *_), a = replace(state, lam=0.0 * state.lam), memory.rates, memory.rates[method.acceleration]
        forces = mover.inertia.loading(own.equations, free, own.equations.effective(free, loading), v, a)
        memory = replace(memory, lam=mover.balanced(own.equations, free, forces).lam)
    stages, layout = method.stages, system.layout
    still = np.zeros(system.turns * layout.rotations * stages + layout.y * stages)
    moved = [memory.q.ravel(), memory.y, memory.lam, still, memory.x, memory.rates.ravel(), memory.unwrapped]
    if isinstance(method, Impulsive):
        moved += method.beginning(own, begun)
    first = np.concatenate([*moved, np.zeros(1)])
    made = TimeStep(name, scene, known, outputs, system, method, own.masses.time, first)
    if made.by_core is not None and np.isnan(made.step(made.begin, made.usual)).any():
        simulation.refuse_unresisted(own, begun)
    return made


def _tells_forces(method: Method) -> bool:
    """Whether steps of a method can tell what forces of inertia have a share in."""
    return isinstance(method, Radau) or method.acceleration > 0


def _accelerating(method: Method, name: str) -> Method:
    """The method that keeps accelerations; SceneError, for a result of a name, if it knows none."""
    if not _tells_forces(method):
        accepted = ", ".join(
            n for n, one in INTEGRATORS.items() if _tells_forces(getattr(one, "keywords", {}).get("method", method))
        )
        raise SceneError(
            f"found steps of {method.name!r}, which do not tell it, accepted: {accepted}", ("results", name)
        )
    return Radau(method.stages, accelerating=True) if isinstance(method, Radau) else method


def _method(simulation: Simulation) -> Method:
    """The integration method that a scene chooses; SceneError for one whose steps are those of a library."""
    scene = simulation.scene
    if simulation.name == Impulsive.name:
        if scene.contacts or scene.stopped:
            refuse_spinning(scene)
        return Impulsive()
    if scene.contacts or scene.stopped:
        what = "contact" if scene.contacts else "stops, or tendons that may be slack"
        message = f"found {simulation.name!r} with {what}, accepted for C: {Impulsive.name}"
        raise SceneError(message, ("analysis", "integrator"))
    made: Any = INTEGRATORS[simulation.name]
    method = getattr(made, "keywords", {}).get("method")
    if method is None:
        accepted = ", ".join([*(n for n, one in INTEGRATORS.items() if hasattr(one, "keywords")), Impulsive.name])
        message = f"found {simulation.name!r}, whose steps are a library's own, accepted for C: {accepted}"
        raise SceneError(message, ("analysis", "integrator"))
    return method
