"""Answers of dynamic analyses by name: states at the times of the answer, with velocities, energies and momenta."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..contact.closest import Closest
from ..contact.pressing import pressed, push_at
from ..description.answers import MOTION
from ..description.records import counted, plain, say
from ..description.showing import error_in_words, notes_in_words, number_in_words, shown
from ..equilibria.quantities import WHERE, Quantity
from ..equilibria.solution import Configuration, Viewed, heading, heading_in_words
from ..errors import SceneError, Status
from ..mathematics.arrays import Array
from ..mathematics.threads import single_threaded
from ..mechanics.balance import three
from ..mechanics.equations import Equations, State
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading
from ..mechanics.memory import Remembering
from ..mechanics.mesh import Approach, Spot
from ..mechanics.model import Model, assemble
from ..mechanics.unilateral import UnilateralRows
from ..solvers.redundancy import loose_rows
from ..solvers.sharing import shared
from .friction import dragged, pushed_along, rubbed
from .projecting import factor_closings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..pictures.animation import Animation
    from .events import Event
    from .inertia import Inertia
    from .sampling import Sample, StepRecord

__all__ = ["Forces", "MotionState", "Mover", "StopEvent", "Trajectory", "apart_in"]


class Mover:
    """Turns samples of an integrator into states by name: the equations of one model, its masses and its unit of time.

    ``factors`` gives the factors of the groups of loads at a dimensionless time; ``time`` is the unit of time, s.
    """

    def __init__(self, equations: Equations, inertia: Inertia, time: float, factors: Callable[[float], Array]) -> None:
        self.equations, self.inertia, self.time, self.factors = equations, inertia, time, factors
        self.model: Model = equations.model
        self.memory, self.unilateral = Remembering(self.model), inertia.system.unilateral
        self._models: dict[object, Equations] = {}
        self._redundant: bool | None = None

    def event(self, event: Event) -> StopEvent:
        """What happens to a unilateral constraint, by name."""
        scales, part = self.model.scales, event.part
        turns = part.table == "springs" and self.model.scene.springs[part.name].type == "rotational"
        side = "taut" if part.table == "tendons" else part.side
        side = "sticking" if event.sticks else side
        impulse = event.impulse * (scales.moment if turns else scales.force) * self.time
        where = part.where
        lost, spot = event.lost * scales.moment, part.spot
        told = turns, spot.where if spot else "", isinstance(spot, Approach)
        return StopEvent(event.t * self.time, where, side, event.acts, impulse, lost, *told)

    def instant(self, sample: Sample) -> MotionState:
        """The state by name of a dimensionless sample."""
        model, equations, system = self.model, self.equations, self.inertia.system
        if self.memory.size:
            model = self.memory.model_with(sample.remembered)
            equations = equations.remembering(model)
        if len(sample.unilateral):
            equations = self.acting(sample.unilateral, sample.acting)
            model = equations.model
        loading = (
            system.loading_of(model, sample.t) if len(sample.unilateral) else system.loading(self.factors(sample.t))
        )
        free = system.state_of(model, State(sample.q, sample.y, np.zeros(0), sample.unwrapped))
        forces = Forces(self, equations, free, loading, sample)
        # Whether rows are redundant is decided in the order of time.
        if self._redundant is not False or self.model.scene.hits:
            forces.balanced()
        fields = Fields(equations, free, loading, forces.balanced)
        seconds = sample.t * self.time
        return MotionState(factor=seconds, fields=fields, time=seconds, sample=sample, mover=self, forces=forces)

    @property
    def free(self) -> Equations:
        """The equations of the model in which no unilateral constraint acts."""
        return self.acting(self.unilateral, np.zeros(len(self.unilateral)))

    def acting(self, rows: UnilateralRows, acting: Array) -> Equations:
        """The equations of the model in which unilateral constraints act as told, (rows,), 1 or 0."""
        model = self.model
        mesh = rows.mesh(model.mesh, acting)
        choice = mesh.stops, mesh.spots, mesh.approaches
        found = self._models.get(choice)
        if found is None:
            alone = assemble(model.scene, mesh, assembly=model.assembly, scales=model.scales, like=model)  # type: ignore[arg-type]
            found = self._models[choice] = Equations(alone, kernels="interpreted")
        return found

    def balanced(self, equations: Equations, free: State, loading: Loading) -> State:
        """The state with internal forces that leave the least out of balance, and what is open by the rule for it."""
        point, n = equations.at(free, loading), equations.unknowns
        if not equations.rows:
            return free
        # Least squares of the residual, rows of the closings last.
        factor_closings(equations, point)
        right = np.concatenate([-point.residual[:n], np.zeros(equations.rows)])
        state = replace(free, lam=np.asarray(equations.solver.solve(right)[n:]))
        if self._redundant is False and not self.model.scene.hits:
            return state
        # What is straight where it begins may be bent later, but hardly the other way round.
        loose = loose_rows(equations, point)
        self._redundant = bool(loose.size)
        return shared(equations, state, loading, loose, reactions=True) if loose.size else state


class Forces:
    """What acts in a sample: multipliers that balance all forces in least squares, found when they are first asked for.

    Parameters
    ----------
    mover : Mover
    equations, free, loading
        Of the sample: equations, state without multipliers, loads.
    sample : Sample
    """

    def __init__(self, mover: Mover, equations: Equations, free: State, loading: Loading, sample: Sample) -> None:
        self._mover, self._equations, self._free, self._loading = mover, equations, free, loading
        self._sample, self._system = sample, mover.inertia.system

    def balanced(self) -> tuple[State, Loading]:
        """The state with multipliers, and the loads with what inertia and dampers do, dimensionless."""
        return self._found[:2]

    @property
    def friction(self) -> dict[str | Approach, tuple[Array, bool]]:
        """Of places that stick or slide, by the names of their rows, forces (3,) along obstacles, N, and which do."""
        return self._found[2]

    @functools.cached_property
    def _found(self) -> tuple[State, Loading, dict[str | Approach, tuple[Array, bool]]]:
        equations, free, sample, rubbing = self._equations, self._free, self._sample, self._system.rubbing
        inertia, friction = self._mover.inertia, np.zeros((0, 0))
        effective = equations.effective(free, self._loading)
        found = inertia.loading(equations, free, effective, sample.v, sample.a)
        if rubbing is not None and sample.rubs is not None:
            friction = rubbed(rubbing, equations, free, found, sample)
            found = pushed_along(rubbing, found, friction, rubbing.arms(sample.y, found.shift))
        if sample.dragged.size:
            found = dragged(equations, found, sample.dragged)
        return self._mover.balanced(equations, free, found), found, self._of_rows(friction)

    @functools.cached_property
    def energies(self) -> tuple[float, float, float]:
        """Kinetic energy, elastic energy, potential of the loads, dimensionless."""
        point = self._equations.at(self._free, self._loading)
        return self._mover.inertia.kinetic(self._sample.v), point.strain, point.potential - point.strain

    def _of_rows(self, forces: Array) -> dict[str | Approach, tuple[Array, bool]]:
        """Of forces (places, axes) along obstacles what :attr:`friction` tells."""
        rubbing, rubs = self._system.rubbing, self._sample.rubs
        unit = self._mover.model.scales.force
        if self._sample.rubbed:
            # Members may touch at several places whose rows have one name.
            return {
                key.name if isinstance(key, Spot) else key: (three(force) * unit, sticks)
                for key, (force, sticks) in self._sample.rubbed.items()
            }
        if rubbing is None or rubs is None:
            return {}
        found = dict[str | Approach, tuple[Array, bool]]()
        for k in np.flatnonzero(rubs.sticks + rubs.slides).tolist():
            spot = self._mover.unilateral.parts[rubbing.of[k]].spot
            assert spot is not None
            found[spot.name] = three(forces[k]) * unit, bool(rubs.sticks[k])
        return found


@dataclass(frozen=True, eq=False)
class MotionState(Configuration):
    """The state of a motion at one time; section forces and reactions include inertia and damping.

    Attributes
    ----------
    time : float
        s; also its ``factor``.
    sample : Sample
        Rotations, displacements and their rates, dimensionless.
    mover : Mover
        Made it.
    forces : Forces
        What acts.
    """

    where: ClassVar[str] = MOTION

    time: float
    sample: Sample = field(repr=False)
    mover: Mover = field(repr=False)
    forces: Forces = field(repr=False)

    @property
    def energies(self) -> tuple[float, float, float]:
        """Kinetic energy, elastic energy, potential of the loads, dimensionless; :attr:`energy` has them in N m."""
        kinetic, strain, loads = self.forces.energies
        return kinetic, strain, loads - self.fields.spent / self.model.scales.moment

    @property
    def friction(self) -> Mapping[str | Approach, tuple[Array, bool]]:
        """What touches with friction, by the name of its row, of a place on an obstacle or where members are near.

        The force (3,) along the surfaces on the member or the first one, N, and whether it sticks.
        """
        return self.forces.friction

    def __repr__(self) -> str:
        energy = ", ".join(f"{kind} {number_in_words(value)}" for kind, value in self.energy.items())
        return shown(self, [f"time={self.time:g} s"], [*self._moved(), f"energy {energy} N m"])

    def _place(self, name: str) -> str:
        return f"{super()._place(name)}, velocity {number_in_words(self.velocity(name), 'm/s')}"

    def velocity(self, node: str) -> Array:
        """Velocity of a node, (3,) m/s."""
        place = self.model.segments.place(self._known(node, self.model.nodes, "node"))
        axes = self.model.element.axes
        rate = self.sample.v[axes * place : axes * (place + 1)]
        return three(rate) * self.model.scales.length / self.mover.time

    def angular_velocity(self, node: str) -> Array | None:
        """Angular velocity of a node about the fixed axes, (3,) rad/s; None for a node without its own rotation."""
        number = self.model.rotations.node_turn[self._known(node, self.model.nodes, "node")]
        if number is None:
            return None
        found, spin = np.zeros(3), self.sample.spin[number]
        found[3 - len(spin) :] = spin / self.mover.time
        return found

    def along(self, member: str, at: Any) -> dict[str, Array]:
        """As :meth:`.Configuration.along`, with ``velocity`` (n, 3) m/s and ``angular_velocity`` (n, 3) rad/s.

        Small members have no velocities along them: their interior is not integrated in time.
        """
        found, model = super().along(member, at), self.model
        if member in model.members:
            places, axes = len(model.segments.places), model.element.axes
            known = self.sample.v[: axes * places].reshape(places, axes)
            velocity, turning = self.fields.rates(member, np.atleast_1d(at), self.sample.spin, known)
            found["velocity"] = velocity * model.scales.length / self.mover.time
            found["angular_velocity"] = turning / self.mover.time
        return found

    @property
    def energy(self) -> dict[str, float]:
        """``kinetic`` and ``elastic`` energy, potential of the present ``loads``, and their sum ``total``, N m.

        ``loads`` is minus the present forces times displacements, so that the sum also changes while loads change.
        Where laws have memory, tendons may be slack, springs have stops or members touch obstacles also what is
        ``dissipated``, in impacts, by friction and otherwise, which the total does not have.
        """
        kinetic, elastic, loads = (part * self.model.scales.moment for part in self.energies)
        lost, spent = dict[str, float](), self.fields.dissipated
        if spent or self.model.scene.hits:
            lost["dissipated"] = sum(spent.values()) + self.sample.lost * self.model.scales.moment
        return {"kinetic": kinetic, "elastic": elastic, **lost, "loads": loads, "total": kinetic + elastic + loads}

    @functools.cached_property
    def momentum(self) -> dict[str, Array]:
        """``linear`` momentum, (3,) kg m/s, and ``angular`` momentum about the centre of mass, (3,) kg m2/s."""
        linear, angular = self.mover.inertia.momentum(self.sample.x, self.sample.v)
        time, scales = self.mover.time, self.model.scales
        return {"linear": linear * scales.force * time, "angular": angular * scales.moment * time}

    @functools.cached_property
    def contacts(self) -> dict[str, dict[str, Any]]:
        """For each obstacle of the scene: ``force`` (3,) N on all members, ``gap`` m, and what is ``touching``.

        The gap is the smallest distance of a member, below zero where one dips in between ends of elements.  Nodes are
        told as ``nodes.tip``, members with the fraction of their length: ``members.rod at 0.25``.  Of one with friction
        also ``friction`` (3,) N, the part of the force that is along it, and what is ``sticking``; what else touches
        slides.
        """
        model, scene = self.model, self.model.scene
        if not scene.contacts:
            return {}
        closest, found = Closest(scene), dict[str, dict[str, Any]]()
        between = [name for name, one in scene.contacts.items() if one.between_members]
        found |= pressed(self.fields, between, self.friction, self._pushed) if between else {}
        for name in scene.obstacles:
            force = sum((force for _, _, force in self.pushes(name)), np.zeros(3))
            spots = [spot for spot in model.mesh.spots or () if spot.contact == name]
            touching = [spot.where for spot in spots]
            found[name] = {"force": force, "gap": closest.gap(self.fields, name), "touching": touching}
            if scene.contacts[name].friction:
                rubbed = [(spot.where, *self.friction[spot.name]) for spot in spots if spot.name in self.friction]
                found[name]["friction"] = sum((force for _, force, _ in rubbed), np.zeros(3))
                found[name]["sticking"] = [where for where, _, sticks in rubbed if sticks]
        return found

    def pushes(self, contact: str) -> list[tuple[str, float, Array]]:
        """As of :meth:`.Configuration.pushes`, at each place where the obstacle stops a member."""
        spots = [spot for spot in self.model.mesh.spots or () if spot.contact == contact]
        nothing = np.zeros(3), False
        return [
            (
                spot.member,
                spot.at,
                push_at(self.fields, spot, self._pushed.get(spot.name)) + self.friction.get(spot.name, nothing)[0],
            )
            for spot in spots
        ]

    @functools.cached_property
    def _pushed(self) -> dict[str | Approach, float]:
        """Of spots, by name, and approaches the forces across surfaces, N, where steps tell them."""
        unit, told = self.model.scales.force, self.sample.pushed.items()
        return {key.name if isinstance(key, Spot) else key: unit * force for key, force in told if key is not None}

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """As :meth:`.Configuration.table`; also for the kinds ``energy`` and ``momentum``."""
        if kind == "momentum":
            return dict(self.momentum)
        return self.energy if kind == "energy" else super().table(kind, name)

    def _node(self, name: str) -> dict[str, Any]:
        found = {**super()._node(name), "velocity": self.velocity(name)}
        turning = self.angular_velocity(name)
        return found if turning is None else {**found, "angular_velocity": turning}

    def to_dict(self) -> dict[str, Any]:
        """The quantities of this time as nested dictionaries, of which :meth:`Trajectory.to_dict` makes lists."""
        tables = self.tables("nodes", "reactions", "springs", "tendons", "tubes", "rings", "motions")
        tables |= {"contacts": dict(self.contacts)} if self.contacts else {}
        return {**tables, "energy": self.energy, "momentum": self.momentum}


@dataclass(frozen=True)
class StopEvent:
    """When a tendon becomes taut or slack, or a stop of a spring or an obstacle is reached or left.

    Attributes
    ----------
    time : float
        s.
    name : str
        ``tendons.NAME``, ``springs.NAME`` or ``contacts.NAME``.
    side : str
        ``taut`` of a tendon; ``low`` or ``high`` of a stop; ``touching`` or ``sticking`` of an obstacle.
    acts : bool
        Whether from then on the tendon is taut, the spring at its stop, the member at the obstacle, or held by its
        friction.
    impulse : float
        Of the tension, the stop or across the obstacle, not below zero, N s; N m s of a stop of an angle; zero where
        nothing hits.
    dissipated : float
        The energy that all impulses of that time dissipate, J, at the largest of them; else zero.
    turns : bool
        Whether it is a stop of an angle.
    where : str
        What touches the obstacle: ``nodes.tip``, or ``members.rod at 0.25``; members that touch each other:
        ``members.rod and members.post``; else empty.
    between_members : bool
        Whether members touch each other.
    """

    time: float
    name: str
    side: str
    acts: bool
    impulse: float
    dissipated: float
    turns: bool = False
    where: str = ""
    between_members: bool = False

    def __str__(self) -> str:
        when, unit = f"at {self.time:.9g} s {self.name}", "N m s" if self.turns else "N s"
        what = f"{'at' if self.acts else 'off'} its {self.side} stop"
        if self.side == "taut":
            what = "taut" if self.acts else "slack"
        elif self.where:
            touches, hits, leaves = BETWEEN if self.between_members else ALONE
            sticks = self.side == "sticking"
            what = f"{self.where} {touches if self.acts else hits if self.impulse else leaves}"
            what = f"{self.where} {'sticks' if self.acts else 'slides'}" if sticks else what
        hit = f", after an impulse of {number_in_words(self.impulse, unit)}" if self.impulse else ""
        lost = f", {number_in_words(self.dissipated, 'N m')} dissipated" if self.dissipated else ""
        return f"{when}: {what}{hit}{lost}"


ALONE = "touches it", "hits it and leaves", "leaves it"
"""What a member does to an obstacle."""

BETWEEN = "touch each other", "hit and leave each other", "leave each other"
"""What members do to each other."""


def apart_in(
    quantity: Quantity, coarse: Sequence[MotionState], fine: Sequence[MotionState], where: tuple[str, ...] = WHERE
) -> float:
    """How far two runs are apart in a quantity at any time, over its largest value.

    Raises
    ------
    SceneError
        It does not consist of numbers; it was named at ``where``.
    """
    own, apart = list[Array](), 0.0
    # What ends at a condition ends at times that differ a little: both ends are compared.
    ends = [] if coarse[-1].time == fine[-1].time else [(coarse[-1], fine[-1])]
    pairs = [(one, other) for one, other in zip(coarse, fine, strict=False) if one.time == other.time]
    try:
        for one, other in (*pairs, *ends):
            a, b = quantity.value(one), quantity.value(other)
            own.append(b)
            apart = max(apart, quantity.apart(a, b))
    except SceneError as error:
        raise SceneError(str(error), where) from None
    return apart / quantity.unit(fine[0], own)


@dataclass(frozen=True, eq=False)
class Trajectory(Viewed):
    """The answer of a dynamic analysis: the motion of a scene in time.

    Attributes
    ----------
    scene : Scene
    status : Status
    steps : tuple of MotionState
        One for each time of the answer.
    seconds : mapping
        Wall time of assembling, of building and compiling the time step, and of integrating, s.
    integrator : str
        Name of the integrator, as in ``analysis.integrator``.
    count : int
        Number of time steps of the last run.
    error_estimate : float or None
        Largest estimated error of the positions at any time, over the size of the scene; None where step and mesh are
        prescribed.
    error_of : str
        Name of the quantity that the estimate refers to instead, relative to its largest value; empty: the positions.
    violation : mapping
        Largest error at the ends of steps of the unit ``norms`` of quaternions, and of the ``closings``: gaps of loop
        closures and joints over the unit of length.
    notes : tuple of str
    failure : str
        Why the motion ended early; empty where it did not.
    record : StepRecord or None
        The time steps of the integrator, which :meth:`between` and :meth:`resampled` interpolate; None of ``idas``.
    events : tuple of StopEvent
        When tendons became taut or slack, and stops of springs and obstacles were reached or left, as time goes on.
    coarser : tuple of MotionState
        The answers of the run before the last one, with longer steps on a coarser mesh; empty where there is none.
    """

    scene: Any = field(repr=False)
    status: Status
    steps: tuple[MotionState, ...] = field(repr=False)
    seconds: Mapping[str, float]
    integrator: str
    count: int
    error_estimate: float | None
    error_of: str
    violation: Mapping[str, float]
    notes: tuple[str, ...] = ()
    failure: str = ""
    record: StepRecord | None = field(repr=False, default=None)
    events: tuple[StopEvent, ...] = field(repr=False, default=())
    coarser: tuple[MotionState, ...] = field(repr=False, default=())

    def __repr__(self) -> str:
        answers = f"{counted(len(self.steps), 'answer')} from {self.steps[0].time:g} to {self.last.time:g} s"
        steps = f"{counted(self.count, 'time step')} of {self.integrator}" if self.integrator else ""
        _, *last = repr(self.last).splitlines()
        return shown(
            self,
            heading_in_words(self, self.last.model),
            [
                ", ".join(filter(None, [answers, steps, error_in_words(self.error_estimate, self.error_of)])),
                self.failure,
                f"at {self.last.time:g} s",
                *last,
                *notes_in_words(self.notes),
            ],
        )

    @property
    def last(self) -> MotionState:
        """The state at the last time."""
        return self.steps[-1]

    @property
    def times(self) -> Array:
        """Times of the answer, s."""
        return np.array([step.time for step in self.steps])

    @single_threaded
    def error_in(self, name: str) -> float | None:
        """Estimated error of any quantity, as reactions and section forces, over its largest value in the motion.

        It is the largest difference of the last two runs over all times of the answer, which is about the error of the
        first of them: nothing is taken off for the order by which the errors of positions fall.  Forces that jump, as
        those of impacts and of stops that are reached, differ by their size where the two runs jump at other times.

        Of what is nothing but rounding, as forces at free ends, it says nothing.

        Parameters
        ----------
        name : str
            ``reactions.pin.force``, ``members.beam.moment at 0.5``; lengths are over the size of the scene, angles in
            rad, see ``accuracy_of`` of an analysis, by which a motion is found to the accuracy of one quantity.

        Returns
        -------
        float or None
            None where there was one run, as with a prescribed step or mesh.

        Raises
        ------
        SceneError
            There is no such quantity, or it does not consist of numbers.
        """
        quantity = Quantity.named(name, self.scene, ("name",))
        # With one run it is nevertheless looked whether there is such a quantity.
        runs = (self.coarser, self.steps) if self.coarser else (self.steps[-1:], self.steps[-1:])
        apart = apart_in(quantity, *runs, ("name",))
        return apart if self.coarser else None

    def at(self, time: float) -> MotionState:
        """The state of the answer whose time is nearest to a time in s; nothing is interpolated."""
        return self.steps[int(np.abs(self.times - time).argmin())]

    @single_threaded
    def between(self, times: ArrayLike) -> tuple[MotionState, ...]:
        """States at any times between the first and the last answer, interpolated between the time steps.

        Parameters
        ----------
        times : (n,), s
            At the time of an answer the state is that of the answer.

        Raises
        ------
        SceneError
            A time is no number or outside, or the integrator is ``idas``, which does not tell its steps.
        """
        own = self.times
        try:
            wanted = np.atleast_1d(np.asarray(times, dtype=float))
        except (TypeError, ValueError):
            wanted = np.zeros((0, 0))
        if wanted.ndim != 1:
            raise SceneError(f"found {say(times)}, accepted: times from {own[0]:g} to {own[-1]:g} s")
        outside = [t for t in wanted if not own[0] <= t <= own[-1]]
        if outside:
            raise SceneError(f"found {outside[0]:g} s, accepted: times from {own[0]:g} to {own[-1]:g} s")
        answered = np.abs(own - wanted[:, None]).argmin(axis=1) if len(wanted) else []
        record, mover, found = self.record, self.last.mover, list[MotionState]()
        for t, i in zip(wanted, answered, strict=True):
            if own[i] == t:
                found.append(self.steps[i])
            elif record is None:
                raise SceneError(f"found integrator {self.integrator!r}, which tells the times of the answer only")
            else:
                found.append(mover.instant(record.sample(t / mover.time)))
        return tuple(found)

    def resampled(self, most: int = 800, least: int = 200) -> Trajectory:
        """The same motion told more closely: at its answers and at the ends of time steps.

        Pictures are drawn from it.  Where steps are longer than a share 1 / ``least`` of the time there are states
        between them, and of steps shorter than a share 1 / ``most`` some are passed over.  A motion integrated by
        ``idas`` is returned as it is.
        """
        if self.record is None or len(self.steps) < 2:
            return self
        own = self.times
        span = float(own[-1] - own[0])
        ends = self.record.times * self.last.mover.time
        marks = np.unique([*own, *ends[(ends > own[0]) & (ends < own[-1])]])
        parts = np.maximum(1, np.ceil(np.diff(marks) * (least / span) * (1.0 - 1e-9))).astype(int)
        filled = np.concatenate([np.linspace(a, b, n + 1)[1:] for a, b, n in zip(marks, marks[1:], parts)])
        times, answers = [float(own[0])], set(own.tolist())
        for t in filled.tolist():
            near = t - times[-1] < span / most
            if t in answers and near and times[-1] not in answers:
                times[-1] = t
            elif t in answers or not near:
                times.append(t)
        return replace(self, steps=self.between(times))

    def positions(self, node: str) -> Array:
        """Positions of a node over the times, (times, 3) m."""
        return np.array([step.position(node) for step in self.steps])

    def velocities(self, node: str) -> Array:
        """Velocities of a node over the times, (times, 3) m/s."""
        return np.array([step.velocity(node) for step in self.steps])

    def angular_velocities(self, node: str) -> Array:
        """Angular velocities of a node over the times, (times, 3) rad/s; nan for a node without its own rotation."""
        return np.array([step.angular_velocity(node) for step in self.steps], dtype=float)

    def energies(self, kind: str = "total") -> Array:
        """Energies over the times, (times,) N m; ``kind`` is kinetic, elastic, loads or total."""
        return np.array([step.energy[kind] for step in self.steps])

    def plot(self, *, quantities: Sequence[str] | None = None) -> Figure:
        """Positions over each other and curves over time, see :func:`~sfetcas.pictures.motions.motion_picture`."""
        from ..pictures.motions import motion_picture

        return motion_picture(self, quantities=quantities)

    def animate(self, file: str | os.PathLike[str] | None = None, *, colour: str = "none") -> Animation | File:
        """A moving picture, see :func:`~sfetcas.pictures.animation.animation`.

        The path of the ``file`` where one is given, ``.gif`` or ``.mp4``; else what notebooks show.
        """
        from ..pictures.animation import animated

        return animated(self, file, colour=colour)

    def to_dict(self) -> dict[str, Any]:
        """The JSON answer as nested dictionaries; each quantity is a list over ``times``."""
        return {
            **heading(self, self.last.model, self.failure),
            "integrator": self.integrator,
            "count": self.count,
            "error_estimate": self.error_estimate,
            **({"error_of": self.error_of} if self.error_of else {}),
            "violation": dict(self.violation),
            "notes": list(self.notes),
            **({"events": [vars(event) for event in self.events]} if self.scene.hits else {}),
            "times": self.times.tolist(),
            **_columns([step.to_dict() for step in self.steps]),
        }


def _columns(entries: list[dict[str, Any]]) -> dict[str, Any]:
    """Equal nested tables as one whose leaves are lists."""
    found: dict[str, Any] = {}
    for key, first in entries[0].items():
        values = [entry[key] for entry in entries]
        found[key] = _columns(values) if isinstance(first, dict) else [plain(value) for value in values]
    return found
