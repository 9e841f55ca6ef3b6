"""Magnetised members and magnetic dipoles in given fields, as terms.

Energy is minus the moment times the field, ``- (R m).B(x)``, counted from the undeformed scene.  In a uniform field
only rotations matter; members integrate it at the nodes of their elements.  In other fields the places matter, too:
within an element they follow from the place at its start and the turned tangents, as its chord does, so that forces
and couples are exactly the derivatives of one energy.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, final

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.actuation import ANYWHERE, PERMEABILITY, Magnet, MagneticField
from ..description.records import enumerated, say
from ..description.scene import Scene
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers, values_of
from .actuation import points_of
from .elements import Element
from .parts import Parts
from .terms import Discrete, Group, One, Side, Term

__all__ = ["Dipole", "Magnetised", "magnet_terms", "magnets_in", "where_fields_end"]

Law = Literal["uniform", "linear", "dipole"]
"""How a field depends on the place, as the types of :class:`~sfetcas.MagneticField`."""


@dataclass(frozen=True)
class FieldFunction:
    """A field as a table, or a function of the place from Python, with the unit of length (m) of the model."""

    field: MagneticField
    unit: float

    def __hash__(self) -> int:
        table = self.field.table
        return hash((id(self.field.function) if table is None else table.digest, self.unit))

    def __post_init__(self) -> None:
        """Refuse a function that takes numbers only, or makes something else of expressions.

        Raises
        ------
        SceneError
            It does.
        """
        place, accepted = ca.SX.sym("place", 3), "one that makes CasADi expressions, without float(...), if and math"
        sentence = f"found a field whose function takes numbers only, accepted: {accepted}"
        try:
            function = ca.Function("field", [place], [self.expression(place)])
        except (TypeError, ValueError, AttributeError, NotImplementedError, RuntimeError):
            raise SceneError(sentence) from None
        found, wanted = function(ANYWHERE / self.unit).full().ravel(), self.field.of(ANYWHERE)
        if not np.allclose(found, wanted, rtol=tolerances.WRITTEN, atol=0.0, equal_nan=True):
            raise SceneError(sentence)

    def expression(self, place: ca.SX) -> ca.SX:
        """The field (3,), T, at a place (3,) over the unit of length."""
        assert self.field.by_place is not None
        found = self.field.by_place(self.unit * place)
        entries: list[ca.SX] = list(found) if isinstance(found, (list, tuple)) else [ca.SX(found)]
        return ca.vertcat(*entries)

    def beyond(self, place: ca.SX) -> ca.SX:
        """How far a place over the unit of length is outside of a table, over the size of that; zero of a function."""
        table = self.field.table
        if table is None:
            return ca.SX(0)
        sizes = [high - low for low, high in table.ends.values()]
        at = self.unit * (place if place.numel() == 3 else ca.vertcat(place, 0))
        return ca.mmax(ca.vertcat(*[far / size for far, size in zip(table.spline.beyond(at), sizes, strict=True)]))

    def __str__(self) -> str:
        return f"function{_numbered(self)}"


@functools.cache
def _numbered(function: FieldFunction) -> int:
    """A number that names a function."""
    return next(_COUNT)


_COUNT = itertools.count()


@dataclass(frozen=True)
class _InField(Term):
    """What magnets have in common.

    Attributes
    ----------
    law : str
        How the field depends on the place.  Its numbers are the load: the field, T; of a linear one then its change
        along a unit of length, row by row; of a dipole its strength at a unit of length, T.
    """

    table: ClassVar[str] = "magnets"
    answers: ClassVar[Mapping[str, str]] = {
        "energy": "J",
        **{f"torque_{axis}": "N m" for axis in "xyz"},
        **{f"force_{axis}": "N" for axis in "xyz"},
        "beyond": "1",
    }

    law: Law | FieldFunction

    @property
    def looks_up(self) -> bool:  # type: ignore[override]
        """Whether the field is a table."""
        return isinstance(self.law, FieldFunction) and self.law.field.table is not None

    @property
    def proportional(self) -> bool:
        """Whether only rotations matter: displacements that motions prescribe change what other fields do."""
        return self.law == "uniform"

    @property
    def discrete(self) -> Discrete:
        """In a uniform field only vectors that turn."""
        return "ends" if self.law == "uniform" else "middle"

    @property
    def strengths(self) -> int:
        """How many numbers a field has."""
        if isinstance(self.law, FieldFunction):
            return 1
        return self.axes + (self.axes**2 if self.law == "linear" else 0)

    def field(self, load: ca.SX, x: ca.SX) -> ca.SX:
        """The field, T, at a place relative to its position, over the unit of length."""
        if self.law == "uniform":
            return load
        if isinstance(self.law, FieldFunction):
            whole = x if self.space else ca.vertcat(x, 0)
            return load * self.law.expression(whole)[: self.axes]
        if self.law == "linear":
            return load[: self.axes] + ca.mtimes(ca.reshape(load[self.axes :], self.axes, self.axes).T, x)
        square = ca.dot(x, x)
        return (3.0 * ca.dot(load, x) / square * x - load) / (square * ca.sqrt(square))

    def magnets(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
        """Of each of its points: moment, place, and the same in the undeformed scene."""
        raise NotImplementedError

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Minus moments times fields, and what that is in the undeformed scene."""
        found = ca.SX(0)
        for moment, place, rest, start in self.magnets(q, u, data):
            # In a uniform field the difference of the moments keeps its digits where they are small.
            if self.law == "uniform":
                found -= ca.dot(moment - rest, load)
            else:
                found -= ca.dot(moment, self.field(load, place)) - ca.dot(rest, self.field(load, start))
        return found

    def acting(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
        """Energy, force and couple of each of its points, in the fixed axes."""
        energies, forces, couples = [], [], []
        for moment, place, _, _ in self.magnets(q, u, data):
            field, x = self.field(load, place), ca.SX.sym("x", self.axes)
            slopes = ca.substitute(ca.jacobian(self.field(load, x), x), x, place)
            energies.append(-ca.dot(moment, field))
            forces.append(ca.mtimes(slopes.T, moment))
            couples.append(ca.cross(moment, field) if self.space else moment[0] * field[1] - moment[1] * field[0])
        return energies, forces, couples

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """Energy, torque about the places of the magnets, force, and how far it is beyond a table over its size."""
        energies, forces, couples = (sum(part[1:], part[0]) for part in self.acting(q, u, data, load))
        nothing = [ca.SX(0), ca.SX(0)]
        torque = ca.vertsplit(couples) if self.space else [*nothing, couples]
        beyond = ca.SX(0)
        if isinstance(self.law, FieldFunction):
            for _, place, _, _ in self.magnets(q, u, data):
                beyond = ca.fmax(beyond, self.law.beyond(place))
        return [energies, *torque, *[*ca.vertsplit(forces), ca.SX(0)][:3], beyond]


@final
@dataclass(frozen=True)
class Magnetised(_InField):
    """Magnetised material along an element.

    Data: moments at the nodes, weights included; where places matter also places of the nodes in the undeformed scene
    relative to that of the field, and the tangents and compliances of the element.

    Attributes
    ----------
    element : Element
        The element, which integrates at its nodes.
    """

    along_element: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, and where places matter the place at its start and its strains."""
        nodes, strains, *_ = self.element.sizes
        own = self.axes * nodes
        if self.law == "uniform":
            return nodes, 0, 0, own, self.strengths
        return nodes, 1 + strains, 0, 2 * own + self.element.line_data, self.strengths

    def magnets(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
        """Of each node: moment, place, and the same in the undeformed scene."""
        nodes = len(q)
        own = self.axes * nodes
        rest = ca.reshape(data[:own], self.axes, nodes)
        moments = [ca.vertcat(*self.forth(side, ca.vertsplit(rest[:, k]))) for k, side in enumerate(q)]
        if self.law == "uniform":
            nowhere = ca.SX.zeros(self.axes)
            return [(moment, nowhere, rest[:, k], nowhere) for k, moment in enumerate(moments)]
        start, line = ca.reshape(data[own : 2 * own], self.axes, nodes), data[2 * own :]
        gained = ca.horzcat(*self.element.tangents(q, u[1:], line)) - self.element.line(line)[0]
        onto = ca.DM(self.element.to_points / self.element.weights)
        moved = ca.repmat(ca.vertcat(*u[0]), 1, nodes) + ca.mtimes(gained, onto.T)
        return [(moment, (start + moved)[:, k], rest[:, k], start[:, k]) for k, moment in enumerate(moments)]

    def densities(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]] | None:
        """Forces and couples at the nodes."""
        _, forces, couples = self.acting(q, u, data, load)
        return forces, couples


@final
@dataclass(frozen=True)
class Dipole(_InField):
    """A dipole that turns with a rotation.

    Data: its moment; where places matter also its place in the undeformed scene relative to that of the field.
    """

    one_sided: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation, and where places matter a place."""
        moves = self.law != "uniform"
        return 1, int(moves), 0, self.axes * (2 if moves else 1), self.strengths

    def magnets(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
        """Its moment and place, and the same in the undeformed scene."""
        rest = data[: self.axes]
        moment = ca.vertcat(*self.forth(q[0], ca.vertsplit(rest)))
        if self.law == "uniform":
            nowhere = ca.SX.zeros(self.axes)
            return [(moment, nowhere, rest, nowhere)]
        start = data[self.axes :]
        return [(moment, start + ca.vertcat(*u[0]), rest, start)]


# -- of a scene -------------------------------------------------------------------------------------


def magnets_in(parts: Parts) -> Iterator[One]:
    """Terms of the magnets of a scene, each under the name ``magnets.NAME``.

    Raises
    ------
    SceneError
        Magnetised members with Gauss integration, or a dipole at a node without a rotation of its own.
    """
    scene = parts.scene
    for name, magnet in scene.magnets.items():
        _check_inside(parts, name, magnet)
        for law, position, loads in _laws(scene.fields, parts):
            found = _at_node if magnet.member is None else _along_member
            yield from found(parts, name, magnet, law, position, loads)


def where_fields_end(scene: Scene) -> list[str]:
    """Of a scene with fields that end with their tables what may be the reason of a failure."""
    names = [name for name, field in scene.fields.items() if field.table is not None]
    if not (names and scene.magnets):
        return []
    which = enumerated([repr(name) for name in names])
    return [f"a magnet may leave the table of the field {which}, beyond which there is none"]


def _check_inside(parts: Parts, name: str, magnet: Magnet) -> None:
    """Refuse a magnet that is in the undeformed scene where a field has no value."""
    scene = parts.scene
    if magnet.member is None:
        places = values_of(numbers(scene.nodes[str(magnet.node)].position))[None, :]
    else:
        x = values_of(points_of(parts, magnet.member))
        x = x[magnet.inside(x.mean(axis=1))]
        places = values_of(scene.center_lines[magnet.member].positions(x.ravel()))
    for key, field in scene.fields.items():
        if field.by_place is None:
            continue
        beyond = None if field.table is None else field.table.outside(places)
        if beyond is not None:
            axis, at, low, high = beyond
            message = f"the magnet {name!r} is at {axis} = {at:.6g} m, outside of the table from {low:g} to {high:g} m"
            raise SceneError(f"{message}, accepted: a table around all places of the magnets", ("fields", key))
        with np.errstate(all="ignore"):
            lost = np.flatnonzero(~np.isfinite(field.of(places)).all(axis=1))
        if len(lost):
            where = say(tuple(places[lost[0]].tolist()))
            message = f"the field is not finite at {where} m, where the magnet {name!r} is in the undeformed scene"
            raise SceneError(f"{message}, accepted: one that is finite at all magnets", ("fields", key))


def _laws(
    fields: Mapping[str, MagneticField], parts: Parts
) -> list[tuple[Law | FieldFunction, Array, dict[str | None, Any]]]:
    """Kind, position (m) and load of each field by its history; all uniform fields add up to one."""
    axes, unit = parts.element.axes, parts.scales.length
    found: list[tuple[Law | FieldFunction, Array, dict[str | None, Any]]] = []
    uniform: dict[str | None, Any] = {}
    for field in fields.values():
        position = numbers(field.position)[:axes]
        if field.by_place is not None:
            found.append((FieldFunction(field, float(unit)), position, {field.history: np.ones(1)}))
        elif field.uniform:
            value = numbers(field.vector)[:axes]
            uniform[field.history] = uniform[field.history] + value if field.history in uniform else value
        elif field.type == "dipole":
            load = PERMEABILITY * numbers(field.moment)[:axes] / unit**3
            found.append(("dipole", position, {field.history: load}))
        else:
            slopes = numbers(field.gradient)[:axes, :axes] * unit
            load = np.concatenate([numbers(field.vector)[:axes], slopes.ravel()])
            found.append(("linear", position, {field.history: load}))
    return [("uniform", np.zeros(axes), uniform), *found] if uniform else found


def _at_node(
    parts: Parts,
    name: str,
    magnet: Magnet,
    law: Law | FieldFunction,
    position: Array,
    loads: Mapping[str | None, Array],
) -> Iterator[One]:
    axes, node = parts.element.axes, str(magnet.node)
    turn = parts.rotations.node_turn[node]
    if turn is None:
        raise SceneError(f"nothing turns with node {node!r}, so no dipole can be there", ("magnets", name))
    data, places = [numbers(magnet.vector)[:axes] / parts.scales.moment], tuple[int, ...]()
    if law != "uniform":
        data.append((numbers(parts.scene.nodes[node].position)[:axes] - position) / parts.scales.length)
        places = (parts.segments.place(node),)
    kind = Dipole(parts.element.space, law)
    yield One(kind, f"magnets.{name}", node, np.concatenate(data), (turn,), places, loads=loads)


def _along_member(
    parts: Parts,
    name: str,
    magnet: Magnet,
    law: Law | FieldFunction,
    position: Array,
    loads: Mapping[str | None, Array],
) -> Iterator[One]:
    scene, element, member = parts.scene, parts.element, str(magnet.member)
    if element.gauss:
        raise SceneError("magnetised members need integration at the nodes, found Gauss integration")
    x, line, first = points_of(parts, member), scene.center_lines[member], parts.beams.first[member]
    frames, axes = line.quaternions(x.ravel()), element.axes
    density = quaternion.rotate(frames, magnet.along(x.ravel()))[:, :axes].reshape(*x.shape, axes)
    places = (line.positions(x.ravel())[:, :axes] - position).reshape(*x.shape, axes) / parts.scales.length
    kind, lines = Magnetised(element.space, law, element), parts.beams.flat("tangent", "compliance")
    for e in np.flatnonzero(magnet.inside(x.mean(axis=1))).tolist():
        number = first + e
        weight = parts.beams.weight[number][:, None] * (parts.scales.length / parts.scales.moment)
        data, starts = [(density[e] * weight).ravel()], tuple[int, ...]()
        if law != "uniform":
            data += [places[e].ravel(), lines[number]]
            start = parts.segments.place(parts.segments.parts[parts.segments.owner[number]].start)
            starts = (start, *parts.segments.strains[number].tolist())
        sides = tuple(parts.rotations.turns[number].tolist())
        data_of = np.concatenate(data)
        yield One(kind, f"magnets.{name}", "", data_of, sides, starts, loads=loads, element=number)


def magnet_terms(groups: Sequence[Group], name: str) -> Iterator[tuple[int, list[int]]]:
    """For each group with terms of a magnet: number of the group, numbers of the terms in it."""
    whole = f"magnets.{name}"
    for number, group in enumerate(groups):
        if group.kind.table == "magnets":
            own = [i for i, one in enumerate(group.names) if one == whole]
            if own:
                yield number, own
