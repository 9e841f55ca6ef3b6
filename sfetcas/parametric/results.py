"""What the generated code tells of an equilibrium: positions, rotations, reactions, section forces, stiffness.

Reactions are derivatives of the Lagrangian by what the ground holds, section forces the pull on the integration
points: both as accurate as the positions.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..description.records import unknown
from ..errors import SceneError
from ..mathematics import interpolation, quaternion
from ..mathematics.arrays import Array
from ..mathematics.constants import constant, times
from ..mechanics.joints import LineSpring, Spring, TurnSpring, Universal
from ..mechanics.load_terms import spread_of
from ..mechanics.model import Model
from ..mechanics.rotations import Turn
from ..mechanics.singles import turned_vector
from ..mechanics.stationarity import Stationarity
from ..mechanics.terms import GROUND
from ..solvers.program import Program

__all__ = ["Result", "Results", "default_motion_results", "default_results"]


@dataclass(frozen=True)
class Result:
    """One result of the generated code: rows of numbers, or a vector, or a number.

    Attributes
    ----------
    name : str
        As in the JSON answer: ``nodes.tip.position``; along a member a row for each place.
    shape : tuple of int
    unit, meaning : str
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    meaning: str

    @property
    def size(self) -> int:
        """How many numbers."""
        return int(np.prod(self.shape, dtype=int))


FIELDS = {"position": "m", "force": "N", "moment": "N m", "curvature": "1/m"}
"""What is told along a member, beside its rotation."""


def default_results(model: Model, *, unique: bool = True) -> list[str]:
    """Positions and rotations of all nodes, positions of members, springs; reactions and section forces if unique."""
    names = []
    rotation = "quaternion" if model.space else "angle"
    for name in model.nodes:
        names.append(f"nodes.{name}.position")
        if model.rotations.node_turn[name] is not None:
            names.append(f"nodes.{name}.{rotation}")
    for name, node in model.scene.nodes.items():
        if node.support != "free" and unique:
            names.append(f"reactions.{name}.force")
            if _moment_known(model, name):
                names.append(f"reactions.{name}.moment")
    for name, member in model.scene.members.items():
        if member.type == "flexible":
            fields = ("position", rotation, "force", "moment") if unique else ("position", rotation)
            names += [f"members.{name}.{field}" for field in fields]
    for name, spring in model.scene.springs.items():
        pair = ("angle", "moment") if spring.type == "rotational" else ("travel", "force")
        names += [f"springs.{name}.{field}" for field in pair]
    return [*names, "energy.elastic", "energy.potential"]


def default_motion_results(model: Model) -> list[str]:
    """Of a motion: positions, rotations and velocities of all nodes, positions along the members, springs."""
    every = [name for name in default_results(model) if name.rpartition(".")[2] not in STATIC]
    names = [name for name in every if name.startswith(("nodes.", "springs.")) or name.endswith(".position")]
    nodes = [f"nodes.{name}.velocity" for name in model.nodes]
    springs = [name for name in names if name.startswith("springs.")]
    return [*(name for name in names if name not in springs), *nodes, *springs]


def _moment_known(model: Model, node: str) -> bool:
    """Whether what the ground does to turn a node is told by one rotation: no other held node shares it."""
    number = model.rotations.node_turn[node]
    if number is None:
        return True
    nodes = model.scene.nodes
    held = [n for n, turn in model.rotations.node_turn.items() if turn == number and nodes[n].turn not in FREE]
    return held in ([], [node])


STATIC = ("moment", "force", "curvature", "potential")
"""What is told of equilibria only; springs are told by their travel."""

FREE = ("free", "ball")
"""How a support may leave a node to turn."""


class Results:
    """The results of one program.

    Parameters
    ----------
    model : Model
    names : sequence of str
    places : mapping of str to sequence of float
        Of each member the fractions of its length at which it is told.
    unique : bool
        Whether reactions and section forces are: not where closings depend on each other.
    motion : bool
        Of a motion, where velocities are known, and forces of inertia are not in those of statics.

    Attributes
    ----------
    results : tuple of Result
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        places: Mapping[str, Sequence[float]],
        *,
        motion: bool = False,
        unique: bool = True,
    ) -> None:
        self._motion, self._unique = motion, unique
        self.model, self.places = model, {name: tuple(x) for name, x in places.items()}
        self.results = tuple(self._result(name) for name in names)

    @property
    def size(self) -> int:
        """How many numbers all of them are."""
        return sum(result.size for result in self.results)

    # -- what there is ------------------------------------------------------------------------------

    def _result(self, name: str) -> Result:
        kind, _, rest = name.partition(".")
        what, _, key = rest.rpartition(".")
        if self._motion and (kind in ("reactions", "stiffness", "compliance") or key in STATIC):
            accepted = (
                "nodes.*.position, .angle or .quaternion, .velocity, members.*.position, springs.*, energy.elastic"
            )
            raise SceneError(f"found {name!r}, accepted of a step: {accepted}", ("results",))
        if not self._unique and (
            kind == "reactions" or (kind == "members" and key in ("force", "moment", "curvature"))
        ):
            message = f"found {name!r}, which is not unique as closings depend on each other, accepted: what is"
            raise SceneError(message, ("results",))
        tables = {"nodes": self._node, "reactions": self._reaction, "members": self._member, "springs": self._spring}
        if kind in tables and what:
            return tables[kind](name, what, key)
        if kind in ("stiffness", "compliance"):
            self._known(rest, self.model.nodes, name)
            if self.model.rotations.node_turn[rest] is None:
                raise SceneError(f"found {name!r}, a node that has no rotation of its own", ("results",))
            if kind == "stiffness" and self.model.scene.nodes[rest].support != "free":
                message = f"found {name!r}, a node that the ground holds, accepted: a free one, or compliance.{rest}"
                raise SceneError(message, ("results",))
            n = 6 if self.model.space else 3
            inverse = kind == "compliance"
            what = "displacement and rotation by force and moment" if inverse else "force and moment by displacement"
            mixed = "1/N, rad/(N m) and mixed" if inverse else "N/m, N m/rad and mixed"
            return Result(name, (n, n), mixed, f"tangent {kind} of the node {rest}: {what}")
        if name in ("energy.elastic", "energy.potential"):
            return Result(
                name, (), "J", "strain energy" if key == "elastic" else "potential energy of all that has one"
            )
        accepted = (
            "nodes.*, reactions.*, members.*, springs.*, stiffness.*, compliance.*, energy.elastic, energy.potential"
        )
        raise SceneError(f"found {name!r}, accepted: {accepted}", ("results",))

    @staticmethod
    def _known(what: str, known: Sequence[str], name: str) -> None:
        if what not in known:
            raise SceneError(f"{name}: {unknown(what, known)}", ("results",))

    def _key(self, name: str, key: str, known: Sequence[str]) -> None:
        if key not in known:
            raise SceneError(f"{name}: {unknown(key, known)}", ("results",))

    @property
    def _rotation(self) -> str:
        return "quaternion" if self.model.space else "angle"

    def _node(self, name: str, node: str, key: str) -> Result:
        self._known(node, self.model.nodes, name)
        self._key(name, key, ("position", self._rotation, *(["velocity"] if self._motion else [])))
        if key == "velocity":
            return Result(name, (3,), "m/s", f"velocity of the node {node}")
        if key == "position":
            return Result(name, (3,), "m", f"position of the node {node}")
        if self.model.rotations.node_turn[node] is None:
            raise SceneError(f"found {name!r}, a node that has no rotation of its own", ("results",))
        return self._turned(name, (), f"the node {node}")

    def _turned(self, name: str, shape: tuple[int, ...], what: str) -> Result:
        own = (4,) if self.model.space else ()
        return Result(name, (*shape, *own), "1" if own else "rad", f"rotation of {what} since the undeformed scene")

    def _reaction(self, name: str, node: str, key: str) -> Result:
        supported = [n for n, record in self.model.scene.nodes.items() if record.support != "free"]
        self._known(node, supported, name)
        self._key(name, key, ("force", "moment"))
        if key == "moment" and not _moment_known(self.model, node):
            message = (
                f"found {name!r}, which other supports of the same rigid body share, accepted: reactions alone in it"
            )
            raise SceneError(message, ("results",))
        return Result(name, (3,), FIELDS[key], f"{key} that the ground exerts at the node {node}")

    def _member(self, name: str, member: str, key: str) -> Result:
        flexible = [n for n, record in self.model.scene.members.items() if record.type == "flexible"]
        self._known(member, flexible, name)
        self._key(name, key, ("position", self._rotation, "force", "moment", "curvature"))
        count = len(self.places[member])
        if key == self._rotation:
            return self._turned(name, (count,), f"the sections of {member}")
        whose = "" if key == "position" else ", of what is beyond a place on what is before"
        if key == "curvature":
            whose = " about the axes b1, b2, b3 of its sections"
        return Result(name, (count, 3), FIELDS[key], f"{key} along the member {member}{whose}")

    def _spring(self, name: str, spring: str, key: str) -> Result:
        self._known(spring, list(self.model.scene.springs), name)
        turning = self.model.scene.springs[spring].type == "rotational"
        units = {"angle": "rad", "moment": "N m"} if turning else {"travel": "m", "force": "N"}
        self._key(name, key, tuple(units))
        return Result(name, (), units[key], f"{key} of the spring {spring}")

    # -- what they are ------------------------------------------------------------------------------

    @property
    def curved(self) -> list[str]:
        """Members whose curvature is told."""
        names = [result.name.split(".") for result in self.results if result.name.endswith(".curvature")]
        return [name[1] for name in names]

    def rest(self, model: Model) -> Array:
        """Undeformed positions (m) of all nodes, then of the places of all members, flat; then what curvatures need."""
        scene = model.scene
        nodes = [np.asarray(scene.nodes[name].position, dtype=float) for name in model.nodes]
        along = [scene.center_lines[name].positions(np.array(x)) for name, x in self.places.items()]
        sections = [self._sections(model, name).ravel() for name in self.curved]
        return np.concatenate([*nodes, *(part.ravel() for part in along), *sections])

    def _sections(self, model: Model, member: str) -> Array:
        """Stiffness over that of the first model, curvature times size and axes b1, b2, b3 at places, (places, 15)."""
        scene, x = model.scene, np.array(self.places[member])
        line, section = scene.center_lines[member], scene.sections[str(scene.members[member].section)]
        stiffness = section.stiffness(x) / self._stiffness(member)
        axes = np.moveaxis(quaternion.matrix(line.quaternions(x)), 2, 1).reshape(len(x), 9)
        return np.concatenate([np.nan_to_num(stiffness), line.curvatures(x) * self.model.scene.size, axes], axis=1)

    def _stiffness(self, member: str) -> Array:
        """Of the first model at the places of a member, (places, 3); infinite where it is not known."""
        scene = self.model.scene
        values = scene.sections[str(scene.members[member].section)].stiffness(np.array(self.places[member]))
        return np.where(np.isnan(values), np.inf, values)

    def curvature(self, member: str, moment: ca.MX, axes: Callable[[ca.MX], ca.MX], sections: ca.MX) -> ca.MX:
        """Curvature about the axes of the sections, (places, 3), 1/m.

        Parameters
        ----------
        moment : (3, places), N m, fixed axes
        axes : what turns vectors (3, places) as the sections turn
        sections : what :meth:`rest` tells of them, (15, places)
        """
        known, found = self._stiffness(member), []
        for k in range(3):
            along = ca.sum1(axes(sections[6 + 3 * k : 9 + 3 * k, :]) * moment)
            finite = np.isfinite(known[:, k])
            # What is not known is not bent: there is no moment about that axis.
            inverse = ca.DM(np.where(finite, 1.0 / known[:, k], 0.0)).T
            relative = sections[k, :] * ca.DM(finite.astype(float)).T + ca.DM((~finite).astype(float)).T
            found.append(sections[3 + k, :] / self.model.scene.size + along * inverse / relative)
        return ca.vertcat(*found).T

    def expression(self, program: Program, rest: ca.MX, speeds: ca.MX | None = None, *, short: bool = False) -> ca.MX:
        """All results one after the other, rows before columns, in SI units.

        ``speeds`` (axes, places) are those of a motion; of what is ``short`` derivatives are, too.
        """
        told = _Told(self, program, rest, speeds, program.forces if short else program.stationarity)
        return ca.vertcat(*(ca.densify(ca.vec(told.value(result.name).T)) for result in self.results))


class _Told:
    """The values of results."""

    def __init__(
        self, results: Results, program: Program, rest: ca.MX, speeds: ca.MX | None, found: Stationarity
    ) -> None:
        self._speeds = speeds
        self._results, self._program = results, program
        self._model, self._expressions = program.model, program.expressions
        model, expressions = self._model, self._expressions
        self._q, self._y, self._lam, self._near = program.parts
        places = expressions.displacements(self._q, self._y, program.given)
        self._places = ca.reshape(places, expressions.axes, expressions.places)
        self._found = found
        count = len(model.nodes)
        along = [len(x) for x in results.places.values()]
        curved = [15 * len(results.places[name]) for name in results.curved]
        bounds = np.cumsum([0, 3 * count, *(3 * n for n in along), *curved]).tolist()
        nodes, *members = ca.vertsplit(rest, bounds)
        sections = members[len(along) :]
        self._sections = {n: ca.reshape(x, 15, -1) for n, x in zip(results.curved, sections, strict=True)}
        self._rest = ca.reshape(nodes, 3, count)
        self._along = {n: ca.reshape(x, 3, -1) for n, x in zip(results.places, members, strict=False)}
        if expressions.elements:
            self._tangents = expressions.tangents(self._q, program.given)

    def value(self, name: str) -> ca.MX:
        """A result as a matrix of its rows and columns."""
        kind, _, rest = name.partition(".")
        what, _, key = rest.rpartition(".")
        if kind == "nodes":
            return self._node(what, key)
        if kind == "reactions":
            return self._reaction(what, key)
        if kind == "members":
            return self._member(what, key)
        if kind == "springs":
            return self._spring(what, key)
        if kind == "energy":
            return (self._program.strain if key == "elastic" else self._program.potential) * self._model.scales.moment
        return self._tangent(kind, rest)

    def _three(self, vectors: ca.MX) -> ca.MX:
        return vectors if self._model.space else ca.vertcat(vectors, ca.MX.zeros(1, vectors.shape[1]))

    def _node(self, node: str, key: str) -> ca.MX:
        number = self._model.nodes.index(node)
        if key == "velocity":
            assert self._speeds is not None
            return self._three(self._speeds[:, number]).T
        if key == "position":
            moved = self._three(self._places[:, number]) * self._model.scales.length
            return (self._rest[:, number] + moved).T
        turn = self._model.rotations.node_turn[node]
        assert turn is not None
        return self._q[:, turn].T

    # -- reactions ----------------------------------------------------------------------------------

    def _shares(self, *, moments: bool) -> ca.MX:
        """What is not in balance in full coordinates, on what the ground holds; universal supports are ground."""
        expressions, found = self._expressions, self._found
        total = ca.densify(ca.vertcat(ca.MX(expressions.of_places, 1), found.on_places))
        for group, (sides, values) in zip(self._model.terms, found.shares, strict=True):
            ground = isinstance(group.kind, Universal) & (group.turns == GROUND).any(axis=1) & moments
            cells = np.where(ground[:, None], -1, sides).ravel()
            used = np.flatnonzero(cells >= 0)
            onto = ca.DM(ca.Sparsity.triplet(expressions.of_rows, len(cells), cells[used].tolist(), used.tolist()), 1.0)
            total += times(onto, ca.vec(values))
        return total

    def _reaction(self, node: str, key: str) -> ca.MX:
        model, expressions = self._model, self._expressions
        positions = model.positions
        if key == "force":
            on_places = self._shares(moments=False)[expressions.of_places :]
            lam = self._lam[: len(positions.rows)]
            # By displacements of what the ground holds; what hangs on it by its members follows.
            force = times(constant(positions.B).T, on_places) + times(constant(positions.BZ).T, lam)
            place = model.segments.place(node)
            found = self._three(ca.reshape(force, expressions.axes, expressions.places)[:, place])
            found -= self._across(node, found)
            return found.T * model.scales.force
        turns = expressions.turns
        moments = ca.reshape(self._shares(moments=True)[: expressions.of_places], turns, -1)
        moments = moments if model.space else ca.vertcat(ca.MX.zeros(2, moments.shape[1]), moments)
        number = model.rotations.node_turn[node]
        if number is None:
            return sum((moments[:, turn] for turn in self._pinned(node)), ca.MX.zeros(3)).T * model.scales.moment
        found = moments[:, number]
        kind = model.rotations.kind[number]
        if kind == Turn.AXIS:
            axis = ca.DM(model.rotations.axis[number])
            found -= ca.dot(axis, found) * axis
        if kind == Turn.FREE and model.scene.nodes[node].support != "universal":
            found = ca.MX.zeros(3)
        return found.T * model.scales.moment

    def _across(self, node: str, force: ca.MX) -> ca.MX:
        """The share of a force along a guide, which does nothing along itself."""
        scene = self._model.scene
        record = scene.nodes[node]
        driven = any(m.node == node and m.displacement is not None for m in scene.motions.values())
        if not record.slides or driven:
            return ca.MX.zeros(3)
        along = np.asarray(record.direction, dtype=float)
        along /= np.linalg.norm(along)
        return ca.dot(ca.DM(along), force) * ca.DM(along)

    def _pinned(self, node: str) -> list[int]:
        model = self._model
        if model.scene.nodes[node].joint != "hinge":
            return []
        members = model.scene.members.items()
        return [model.rotations.ends[name][m.nodes.index(node)] for name, m in members if node in m.nodes]

    # -- members ------------------------------------------------------------------------------------

    def _located(self, member: str) -> tuple[Array, Array, Array]:
        """Elements of the places of a member, places within them, and weights that integrate up to there."""
        model, x = self._model, np.array(self._results.places[member])
        cuts, element = model.mesh.cuts[member], model.element
        e = np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2)
        xi = (x - cuts[e]) / (cuts[e + 1] - cuts[e])
        to_x = np.concatenate([interpolation.integration(element.points, np.array([one])) for one in xi])
        return e, xi, to_x / element.weights

    def _points(self, values: ca.MX, member: str, weights: Array) -> ca.MX:
        """Sums over the points of the elements of a member, (axes, places), by weights (places, points of all)."""
        first = self._model.elements_of(member)
        n = self._expressions.points
        return ca.mtimes(values[:, first.start * n : first.stop * n], ca.sparsify(ca.DM(weights)).T)

    def _up_to(self, member: str) -> Array:
        """Weights that integrate from the start of a member to its places, (places, points of all elements)."""
        e, _, to_x = self._located(member)
        n = self._expressions.points
        part = self._model.elements_of(member)
        weights = np.zeros((len(e), (part.stop - part.start) * n))
        for row, (element, own) in enumerate(zip(e, to_x, strict=True)):
            weights[row, : element * n] = 1.0
            weights[row, element * n : (element + 1) * n] = own
        return weights

    def _within(self, member: str, rows: Array) -> Array:
        """Weights of the points of the element of each place, (places, points of all elements)."""
        e, _, _ = self._located(member)
        n, part = self._expressions.points, self._model.elements_of(member)
        weights = np.zeros((len(e), (part.stop - part.start) * n))
        for row, (element, own) in enumerate(zip(e, rows, strict=True)):
            weights[row, element * n : (element + 1) * n] = own
        return weights

    def _member(self, member: str, key: str) -> ca.MX:
        model, scales = self._model, self._model.scales
        if key == "position":
            moved = self._points(self._tangents - self._program.given.tangent, member, self._up_to(member))
            start = self._places[:, model.segments.place(model.segments.ends[member, 0])]
            moved += ca.repmat(start, 1, moved.shape[1])
            return (self._along[member] + self._three(moved) * scales.length).T
        if key in ("quaternion", "angle"):
            return self._rotations(member)
        if key == "curvature":
            return self._curvature(member)
        return (self._force(member) * scales.force if key == "force" else self._moment(member) * scales.moment).T

    def _curvature(self, member: str) -> ca.MX:
        def turned(vectors: ca.MX) -> ca.MX:
            if not self._model.space:
                # About z nothing in the plane counts, and z turns to itself.
                return vectors
            function = self._expressions.many(turned_vector(True), vectors.shape[1])
            return function(self._rotations(member).T, vectors)

        moment = self._moment(member) * self._model.scales.moment
        return self._results.curvature(member, moment, turned, self._sections[member])

    def _rotations(self, member: str) -> ca.MX:
        model, element = self._model, self._model.element
        e, xi, _ = self._located(member)
        rows = np.concatenate([interpolation.evaluation(element.nodes, np.array([one])) for one in xi])
        turns = model.rotations.turns[model.elements_of(member)][e]
        found = [ca.mtimes(self._q[:, t.tolist()], ca.DM(row)) for t, row in zip(turns, rows, strict=True)]
        found = [one / ca.norm_2(one) for one in found] if model.space else found
        return ca.horzcat(*found).T

    @functools.cached_property
    def _spread(self) -> tuple[ca.MX, ca.MX]:
        """Distributed forces at the points of all elements and the whole pull there, (axes, points)."""
        spread, pull = spread_of(self._expressions, self._q, self._program.given)
        return spread, self._found.pull + pull

    def _force(self, member: str) -> ca.MX:
        """Internal force at the places, (3, places)."""
        element = self._model.element
        e, _, to_x = self._located(member)
        spread, pull = self._spread
        first = np.zeros(self._expressions.points)
        first[0] = 1.0
        # The pull at the first point is minus the force there; the spread load is distributed as in its adjoint.
        beyond = element.to_points[:, 0] / element.weights[0]
        from_spread = self._points(spread, member, self._within(member, 1.0 - beyond - to_x))
        return self._three(from_spread - self._points(pull, member, self._within(member, np.tile(first, (len(e), 1)))))

    def _moment(self, member: str) -> ca.MX:
        """Section moment at the places, (3, places): that at the first node of the element, and what forces add."""
        expressions, model = self._expressions, self._model
        e, _, to_x = self._located(member)
        width = expressions.points * expressions.turns
        starts = (model.elements_of(member).start + e) * width
        pull = self._spread[1]
        own = self._found.moments(starts // expressions.turns)
        if model.space:
            crossed = ca.cross(self._tangents, pull, 1)
        else:
            crossed = self._tangents[0, :] * pull[1, :] - self._tangents[1, :] * pull[0, :]
        gained = self._points(crossed, member, self._within(member, to_x)) - own
        return gained if model.space else ca.vertcat(ca.MX.zeros(2, gained.shape[1]), gained)

    # -- springs ------------------------------------------------------------------------------------

    def _spring(self, spring: str, key: str) -> ca.MX:
        model, scales = self._model, self._model.scales
        kinds = (TurnSpring, LineSpring, Spring)
        number = next(i for i, g in enumerate(model.terms) if spring in g.names and isinstance(g.kind, kinds))
        group = model.terms[number]
        i, axes = group.names.index(spring), self._expressions.axes
        turned, moved = self._expressions.sides(group, self._q, ca.vec(self._places))
        data = self._expressions.data(number, self._program.given, self._near)[:, i]
        if isinstance(group.kind, TurnSpring):
            angle = _angle(group.kind)(turned[:, 2 * i : 2 * i + 2], data)
            first = group.kind.first
            return angle if key == "angle" else -data[first] * (angle - data[first + 1]) * scales.moment
        gap = moved[:, 2 * i + 1] - moved[:, 2 * i]
        if isinstance(group.kind, LineSpring):
            travel = ca.dot(data[:axes], gap)
            force = -data[axes] * (travel - data[axes + 1])
        else:
            travel = ca.norm_2(data[:axes] + gap) - data[axes + 1]
            force = -data[axes] * travel
        return travel * scales.length if key == "travel" else force * scales.force

    # -- stiffness ----------------------------------------------------------------------------------

    def _tangent(self, kind: str, node: str) -> ca.MX:
        """Tangent stiffness or compliance of a node: displacements, then rotations."""
        model, expressions, program = self._model, self._expressions, self._program
        number, axes = model.rotations.node_turn[node], expressions.axes
        assert number is not None
        step = ca.MX.sym("step", expressions.total)
        moved = program.moved_expression(step)
        place = model.segments.place(node)
        at = expressions.displacements(*moved[:2], program.given)[axes * place : axes * (place + 1)]
        spin = expressions.spins(step)[:, number]
        jacobian = ca.substitute([ca.jacobian(ca.vertcat(at, spin), step)], [step], [ca.DM.zeros(expressions.total)])[0]
        compliance = ca.mtimes(jacobian, ca.solve(program.matrix, ca.densify(jacobian).T, "qr", {"eps": 1e-300}))
        units = np.repeat([model.scales.length, 1.0], [axes, expressions.turns])
        loads = np.repeat([model.scales.force, model.scales.moment], [axes, expressions.turns])
        found = ca.DM(units[:, None] / loads[None, :]) * compliance
        return found if kind == "compliance" else ca.solve(found, ca.DM.eye(len(units)), "qr", {"eps": 1e-300})


def _angle(kind: TurnSpring) -> ca.Function:
    """(q, data) -> the angle of a rotational spring."""
    q, data = ca.SX.sym("q", kind.components, 2), ca.SX.sym("data", kind.sizes[3])
    return ca.Function("angle", [q, data], [kind.angle([ca.vertsplit(q[:, i]) for i in range(2)], data)])
