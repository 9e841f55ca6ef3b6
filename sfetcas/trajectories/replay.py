"""Replay of commands by time integration, to check a trajectory, or to see what any command does.

The time integration is independent of the collocation: by default it is the energy-momentum scheme, on a finer mesh,
and its step is halved until the positions, extrapolated to zero step, no longer change.  The remaining difference is
the error of the trajectory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import tolerances
from ..description.loads import History
from ..description.records import counted, plain, unknown
from ..description.scene import Scene, check_scene
from ..description.showing import error_in_words, shown
from ..description.sliding import check_sliding
from ..dynamics.motion import MotionState, Trajectory
from ..dynamics.sampling import StepRecord
from ..dynamics.simulation import Simulation
from ..equilibria.settings import Settings
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.threads import single_threaded
from ..mechanics.mesh import Mesh
from ..parametric.arguments import argument

__all__ = ["HALVINGS", "Response", "commanded", "respond"]

ORDERS = {"conserving": 2, "radau-2": 3, "radau-3": 5, "generalised-alpha": 2}
"""Orders of the integrators that take steps of equal length."""


HALVINGS = 7
"""How often the step is halved, at most."""


@dataclass(frozen=True, eq=False)
class Response:
    """The motion of a scene under commands.

    Attributes
    ----------
    times : ndarray (times,)
        Times of the answer, s.
    places : mapping of str to ndarray (times, 3)
        Positions of the nodes, m, extrapolated from two step lengths.
    instants : tuple of MotionState
        The states at these times, computed with the shorter steps.
    end : float
        Time at which the command ends, s.
    error_estimate : float
        Estimated error of the positions by the time steps, over the size of the scene.
    count : int
        Number of steps of the last run.
    record : StepRecord or None
        The time steps of that run.
    """

    times: Array
    places: Mapping[str, Array] = field(repr=False)
    instants: tuple[MotionState, ...] = field(repr=False)
    end: float
    error_estimate: float
    count: int
    record: StepRecord | None = field(repr=False, default=None)

    def __repr__(self) -> str:
        span = f"{counted(len(self.times), 'answer')} from {self.times[0]:g} to {self.times[-1]:g} s"
        _, *last = repr(self.instants[-1]).splitlines()
        return shown(
            self,
            [span, f"end={self.end:g} s", counted(self.count, "time step"), error_in_words(self.error_estimate)],
            [f"at {self.instants[-1].time:g} s", *last],
        )

    def positions(self, node: str) -> Array:
        """Positions of a node, (times, 3) m; SceneError if there is no such node."""
        if node not in self.places:
            raise SceneError(f"node: {unknown(node, list(self.places), 'nodes')}")
        return self.places[node]

    def energies(self, kind: str = "total") -> Array:
        """Energies over the times, (times,) N m; ``kind`` is kinetic, elastic, loads or total."""
        return np.array([one.energy[kind] for one in self.instants])

    @property
    def trajectory(self) -> Trajectory:
        """The states as the answer of a dynamic analysis, for pictures and animations."""
        first = self.instants[0].model
        return Trajectory(
            scene=first.scene,
            status=Status.SOLVED,
            steps=self.instants,
            seconds={},
            integrator="",
            count=self.count,
            error_estimate=self.error_estimate,
            error_of="",
            violation={},
            record=self.record,
        )

    @property
    def after(self) -> Array:
        """Which times come after the end, (times,) bool."""
        return np.asarray(self.times >= self.end * (1.0 - tolerances.DECIMAL))

    def residual_vibration(self, node: str | None = None) -> float:
        """Largest distance of nodes (of one or all) from their mean position after the end, m."""
        names = list(self.places) if node is None else [node]
        after = self.after
        found = 0.0
        for name in names:
            places = self.positions(name)[after]
            found = max(found, float(np.linalg.norm(places - places.mean(axis=0), axis=1).max(initial=0.0)))
        return found

    def residual_energy(self) -> float:
        """Largest kinetic energy after the end, N m."""
        return float(self.energies("kinetic")[self.after].max(initial=0.0))


class _Timed(Simulation):
    """A motion told at given times."""

    wanted: Array

    @property
    def times(self) -> Array:
        """The given times."""
        return self.wanted


def commanded(scene: Scene, commands: Mapping[str, History]) -> Scene:
    """The scene with histories in the place of numbers: components of the values of loads, actuations and fields, or
    histories that these have.

    Raises
    ------
    SceneError
        The scene has no such number.
    """
    table = scene.to_dict()
    table["dimension"] = scene.resolved_dimension
    histories = table.setdefault("histories", {})
    for name, history in commands.items():
        argument(scene, name)
        path = name.split(".")
        if path[0] == "histories":
            histories[path[1]] = _table(history)
            continue
        if path[0] == "tendons":
            own = " ".join(path)
            histories[own] = _table(history)
            table["tendons"][path[1]] |= {path[2]: 1.0, "history": own}
            continue
        load, loads = path[1], table[path[0]]
        own = f"{load} {' '.join(path[2:])}"
        histories[own] = _table(history)
        value = plain(getattr(scene, path[0])[load].value)
        index = int(path[3]) if len(path) > 3 else None
        unit: Any = 1.0 if index is None else [float(i == index) for i in range(len(value))]
        more = {**loads[load], "value": unit, "history": own}
        # What else a field does is told of once.
        loads[own] = {"type": "uniform", "value": unit, "history": own} if path[0] == "fields" else more
        if index is None:
            loads[load]["value"] = 0.0
        else:
            loads[load]["value"] = [0.0 if i == index else x for i, x in enumerate(plain(loads[load]["value"]))]
    return Scene.from_dict(table)


def _table(history: History) -> dict[str, Any]:
    found: dict[str, Any] = {"t": plain(history.t)}
    key = "value" if history.value is not None else "polynomial"
    return found | {key: plain(getattr(history, key))}


@single_threaded
def respond(
    scene: Scene,
    commands: Mapping[str, History],
    end: float,
    *,
    tail: float = 0.0,
    times: Array | None = None,
    step: float | None = None,
    mesh: Mesh | None = None,
    accuracy: float = 1e-5,
    integrator: str = "conserving",
    against: Mapping[str, Array] | None = None,
    halvings: int = HALVINGS,
    settings: Settings | None = None,
) -> Response:
    """Integrate the motion of a scene under commands, and for a while after them.

    Parameters
    ----------
    scene : Scene
    commands : histories by the names of numbers: ``{"loads.motor.value": History(t=[0, 1], value=[2, 0])}``
    end : time at which the commands end, s
    tail : time for which the motion is followed after that, s
    times : (n,), times of the answer, s; by default a hundred before the end and a hundred in the tail
    step : first time step, s; it is halved until the positions no longer change
    mesh : by default the one for the scene's accuracy, refined
    accuracy : permitted change of positions, over the size of the scene, when the step is halved
    integrator : conserving (without follower loads), radau-2, radau-3 or generalised-alpha
    against : positions of nodes to compare with at the first times, (n, 3) m; a tenth of the difference is accurate
        enough
    halvings : how often the step is halved, at most

    Raises
    ------
    SceneError
        There is no such number or integrator.
    SolveError
        A time step does not converge.
    """
    check_scene(scene, "respond({}, ...)", steps=False)
    for name, history in commands.items():
        if not isinstance(history, History):
            raise SceneError(f"commands: found {history!r} for {name}, accepted: History(t=[...], value=[...])")
    if not tail >= 0.0 or not end > 0.0:
        raise SceneError(f"found an end of {end:g} s and a tail of {tail:g} s, accepted: above zero, and zero or more")
    if integrator not in ORDERS:
        raise SceneError(f"integrator: {unknown(integrator, list(ORDERS), 'integrators')}")
    if times is None:
        inner, later = np.linspace(0.0, end, 101), end + np.linspace(0.0, tail, 101)[1:]
        times = np.concatenate([inner, later if tail > 0.0 else []])
    replays = _Replays(commanded(scene, commands), end + tail, np.asarray(times, dtype=float), integrator)
    replays.mesh, replays.settings = mesh, settings or Settings()
    step, gain = step or end / 200.0, 2.0 ** ORDERS[integrator] - 1.0
    run = replays.run(step)
    coarse = replays.places(run)
    best, error = coarse, np.inf
    for _ in range(halvings):
        step *= 0.5
        try:
            run = replays.run(step)
        except SolveError:
            # Steps so short that rounding is what is left; the estimate says what the longer ones are worth.
            if np.isinf(error):
                raise
            break
        fine = replays.places(run)
        better = {name: one + (one - coarse[name]) / gain for name, one in fine.items()}
        # Of the first extrapolation only what it changed is known.
        change = _apart(better, best) if np.isfinite(error) else _apart(better, fine)
        best, coarse, error = better, fine, change / scene.size
        off = 0.0
        if against is not None:
            off = _apart(against, {n: best[n][: len(one)] for n, one in against.items()}) / scene.size
        if error <= max(accuracy, 0.1 * off):
            break
    return Response(replays.times, best, tuple(run.instants), end, error, run.count, run.record)


@dataclass
class _Replays:
    """Runs of one scene with steps of several lengths."""

    scene: Scene
    end: float
    times: Array
    integrator: str
    mesh: Mesh | None = None
    settings: Settings = field(default_factory=Settings)

    def run(self, step: float) -> Any:
        """One run."""
        analysis = self.scene.analysis
        kept = {key: getattr(analysis, key) for key in ("initial", "cut", "release") if analysis.type == "dynamic"}
        given = {"type": "dynamic", "end": self.end, "step": step, "integrator": self.integrator, **kept}
        one = self.scene.model_copy(update={"analysis": type(analysis)(**given), "expect": ()})
        for name, by in one.shortenings.items():
            check_sliding(name, one.tendons[name], by, one.analysis, one.histories)
        simulation = _Timed(one, self.settings)
        simulation.wanted = self.times
        run = simulation.run(self.mesh or simulation.mesh.refined(), 0)
        if run.failure is not None:
            raise SolveError(run.failure.status, f"replay: {run.failure.detail}", run)
        return run

    @staticmethod
    def places(run: Any) -> dict[str, Array]:
        """Positions of all nodes."""
        nodes = list(run.instants[0].model.nodes)
        return {name: np.array([one.position(name) for one in run.instants]) for name in nodes}


def _apart(one: Mapping[str, Array], other: Mapping[str, Array]) -> float:
    """Largest distance of nodes."""
    return max(float(np.linalg.norm(one[name] - other[name], axis=1).max()) for name in one)
