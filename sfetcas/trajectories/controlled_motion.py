"""The solution of an optimal control problem: controls, the motion by name, and its check by a replay."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.loads import History
from ..description.records import counted, unknown
from ..description.showing import error_in_words, notes_in_words, ranges_in_words, shown, values_in_words
from ..dynamics.motion import Trajectory
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.interpolation import evaluation
from ..parametric.arguments import with_values
from .replay import HALVINGS, Response, respond
from .transcription import GridMotion, Transcription

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..description.scene import Scene

__all__ = ["Check", "ControlledMotion"]


@dataclass(frozen=True, eq=False)
class Check:
    """Comparison of a trajectory with its replay by a time integrator.

    Attributes
    ----------
    response : Response
        The replay, at the begin, the ends of the intervals, and after the end.
    difference : float
        Largest distance between node positions of trajectory and replay, over the size of the scene.
    error_estimate : float
        Estimated error of the replay itself by its time steps, over the size of the scene.
    integrator : str
        Name of its integrator.
    residual_vibration : float
        Largest distance of nodes from their mean positions after the end, m.
    """

    response: Response = field(repr=False)
    difference: float
    error_estimate: float
    integrator: str
    residual_vibration: float

    def __repr__(self) -> str:
        return shown(
            self,
            [f"differs by {self.difference:.1e} of the size from the replay by {self.integrator}"],
            [f"{error_in_words(self.error_estimate)}; {self.residual_vibration:.3g} m of residual vibration"],
        )


@dataclass(frozen=True, eq=False)
class ControlledMotion:
    """The solution of an :class:`~sfetcas.trajectories.optimal_control.OptimalControl` problem.

    Attributes
    ----------
    status : Status
        SOLVED; another one for the last iterate of a failed solve, which is no solution.
    scene : Scene
        The scene with the values found for the variables.
    time : float
        End time, s.
    cost : float
        Value of the objective.
    variables : mapping of str to float
        In the units of the scene.
    iterations : int
        Of IPOPT, all rounds.
    seconds : mapping
        Wall time of the warm start, of building, solving and replaying, s.
    notes : tuple of str
    check : Check or None
        The replay; None where it was not asked for.
    """

    status: Status
    scene: Scene = field(repr=False)
    time: float
    cost: float
    variables: Mapping[str, float]
    iterations: int
    seconds: Mapping[str, float]
    notes: tuple[str, ...]
    transcription: Transcription = field(repr=False)
    x: Array = field(repr=False)
    check: Check | None = None

    def __repr__(self) -> str:
        checked = [] if self.check is None else repr(self.check).splitlines()
        return shown(
            self,
            [self.status.value, f"time={self.time:.6g} s", f"cost={self.cost:.6g}"],
            [
                *ranges_in_words({name: self.control(name) for name in self._names}),
                *values_in_words(self.variables),
                counted(self.iterations, "iteration"),
                *checked,
                *notes_in_words(self.notes),
            ],
        )

    @property
    def _names(self) -> list[str]:
        return [one.name for one in self.transcription.statement.controls]

    # -- times ------------------------------------------------------------------------------------------

    @property
    def ends(self) -> Array:
        """Times of the begin and of the ends of the intervals, (intervals + 1,) s."""
        shares = self.transcription.statement.shares
        return self.time * np.append(0.0, np.cumsum(shares))

    @property
    def times(self) -> Array:
        """Times of :meth:`answer`: the begin and all stages of all intervals, (1 + stages,) s."""
        return self.time * np.append(0.0, self.transcription.statement.fractions.ravel())

    # -- what was found ---------------------------------------------------------------------------------

    def control(self, name: str) -> Array:
        """Values of a control, in its unit: (intervals,) where it is constant in each, else (intervals + 1,) at
        :attr:`ends`.

        Raises
        ------
        SceneError
            There is no such control.
        """
        names = self._names
        if name not in names:
            raise SceneError(f"control: {unknown(name, names, 'such controls')}")
        return self.course.controls[:, names.index(name)]

    def at_rest(self, name: str) -> float:
        """Value of a control that keeps the scene at rest after the end; SceneError if rest was not asked for."""
        rests = self.transcription.resting
        if name not in rests:
            raise SceneError(f"control at rest: {unknown(name, list(rests), 'such controls')}")
        return float(self.transcription.pieces.value(rests[name], self.x).flat[0])

    def answer(self, name: str) -> Array:
        """An answer that the problem uses, at :attr:`times`, (times, numbers), SI units; SceneError for others."""
        names = [one.name for one in self.transcription.system.results.results]
        if name not in names:
            raise SceneError(f"answer: {unknown(name, names, 'answers in the problem')}")
        return self.transcription.answer(name, self.x)

    def value(self, expression: ca.MX) -> float:
        """Value of an expression of the problem that is one number: ``time``, an integral, ``at_tf(...)``."""
        return self.transcription.value(expression, self.x)

    @functools.cached_property
    def course(self) -> GridMotion:
        """The motion on the grid, dimensionless; it may start another search."""
        return self.transcription.course(self.x)

    @property
    def commands(self) -> dict[str, History]:
        """Controls as histories by their names; after the end the values at rest, or else those of the scene."""
        statement, found = self.transcription.statement, {}
        defaults = self.transcription.system.arguments.defaults
        ends = self.ends
        for k, one in enumerate(statement.controls):
            values = self.course.controls[:, k]
            after = self.at_rest(one.name) if statement.resting else float(defaults[k])
            pieces: list[tuple[float, ...]]
            if statement.order:
                pieces = [(float(a), float(b - a)) for a, b in zip(values[:-1], values[1:], strict=True)]
            else:
                pieces = [(float(a),) for a in values]
            times = (*ends.tolist(), float(ends[-1] * 2.0 + 1.0))
            found[one.name] = History(t=times, polynomial=(*pieces, (after,)))
        return found

    # -- check --------------------------------------------------------------------------------------------

    def replayed(
        self, tail: float | None = None, accuracy: float = 1e-5, integrator: str | None = None, **more: Any
    ) -> Check:
        """Replay the commands by a time integrator on a finer mesh.

        Parameters
        ----------
        tail : time after the end during which the motion is followed, s; by default as long as the motion
        accuracy : wanted error by the time steps of the replay, over the size of the scene
        integrator : by default ``conserving``, or radau-3 where that is refused or its order is too low
        more : further arguments of :func:`~sfetcas.respond`
        """
        system = self.transcription.system
        tail = self.time if tail is None else tail
        later = self.time + np.linspace(0.0, tail, 101)[1:] if tail > 0.0 else np.zeros(0)
        times = np.concatenate([self.ends, later])
        places = self._node_positions()
        given: dict[str, Any] = {"mesh": system.model.mesh.refined(), "tail": tail, "times": times}
        given |= {"against": places, **more}
        response, used = self._responded(integrator, {"accuracy": accuracy, "step": self.time / 400.0, **given})
        difference = self._off(response, places)
        return Check(response, difference, response.error_estimate, used, response.residual_vibration())

    def _responded(self, integrator: str | None, given: Mapping[str, Any]) -> tuple[Response, str]:
        for name, halvings in ((integrator, HALVINGS),) if integrator else (("conserving", 4), ("radau-3", HALVINGS)):
            try:
                one = {"integrator": name, "halvings": halvings, **given}
                found = respond(self.scene, self.commands, self.time, **one)
            except (SceneError, SolveError):
                if name == (integrator or "radau-3"):
                    raise
                continue
            if integrator or name == "radau-3" or found.error_estimate <= self._enough(found, given):
                break
        return found, name

    def _enough(self, found: Response, given: Mapping[str, Any]) -> float:
        """What a replay may be off: little of what the trajectory is."""
        return max(given["accuracy"], 0.1 * self._off(found, given["against"]))

    def _off(self, found: Response, places: Mapping[str, Array]) -> float:
        """Largest distance of nodes from where the trajectory has them, over the size of the scene."""
        size = self.transcription.system.scene.size
        pairs = [(own, found.positions(name)[: len(own)]) for name, own in places.items()]
        return max(float(np.linalg.norm(own - other, axis=1).max()) for own, other in pairs) / size

    @property
    def trajectory(self) -> Trajectory:
        """The replay as the answer of a dynamic analysis, for pictures and animations.

        Raises
        ------
        SceneError
            It was not replayed.
        """
        if self.check is None:
            raise SceneError("found no replay, accepted: an answer of solve(replay=True)")
        return self.check.response.trajectory

    def plot(self, *, nodes: Sequence[str] | None = None) -> Figure:
        """Controls with bounds beside positions, see ``controls.control_picture``."""
        from ..pictures.controls import control_picture

        return control_picture(self, nodes=nodes)

    def _node_positions(self) -> dict[str, Array]:
        """Positions of all nodes at the begin and the ends of the intervals, (intervals + 1, 3) m."""
        stages = self.transcription.stages
        x = np.vstack([self.transcription.system.begin.x, self.course.x[stages - 1 :: stages]])
        return {name: self._places(name, x) for name in self.transcription.system.model.nodes}

    def _places(self, node: str, x: Array) -> Array:
        """Positions (n, 3) m of a node of quantities (n, quantities)."""
        system = self.transcription.system
        axes, place = system.system.axes, system.model.segments.place(node)
        found = np.tile(np.asarray(self.scene.nodes[node].position, dtype=float), (len(x), 1))
        found[:, :axes] += x[:, axes * place : axes * (place + 1)] * system.model.scales.length
        return found

    def interpolated(self, node: str, parts: int = 8) -> tuple[Array, Array]:
        """Positions of a node within the intervals, by the polynomials of the collocation.

        Parameters
        ----------
        node : str
        parts : int
            Number of equal parts of each interval.

        Returns
        -------
        times : ndarray (n,)
            s
        positions : ndarray (n, 3)
            m

        Raises
        ------
        SceneError
            There is no such node.
        """
        if node not in self.transcription.system.model.nodes:
            raise SceneError(f"node: {unknown(node, list(self.transcription.system.model.nodes), 'nodes')}")
        inside, stages = np.arange(1, parts + 1) / parts, self.transcription.stages
        rows = evaluation(np.append(0.0, self.transcription.places), inside)
        x = np.vstack([self.transcription.system.begin.x, self.course.x])
        pieces = [rows @ x[first : first + stages + 1] for first in range(0, len(x) - 1, stages)]
        ends = self.ends
        times = [begin + inside * (end - begin) for begin, end in zip(ends[:-1], ends[1:], strict=True)]
        return np.concatenate([ends[:1], *times]), self._places(node, np.vstack([x[:1], *pieces]))

    def positions(self, node: str) -> Array:
        """Positions of a node at :attr:`ends`, (intervals + 1, 3) m; SceneError if there is no such node."""
        found = self._node_positions()
        if node not in found:
            raise SceneError(f"node: {unknown(node, list(found), 'nodes')}")
        return found[node]

    def with_variables(self, scene: Scene) -> Scene:
        """A scene with the values found for the variables."""
        found: dict[str, ArrayLike] = {}
        for one in self.transcription.statement.variables:
            value = self.variables[one.name]
            found |= {one.name: value} if one.parameter is None else one.parameter.numbers(value)
        return with_values(scene, found) if found else scene
