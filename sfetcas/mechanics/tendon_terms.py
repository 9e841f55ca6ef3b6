"""Tendons as terms: their tension times their length, or their length as a constraint with the tension as multiplier.

Along an element the way has the offset ``d(s)`` from the centre line in axes of the undeformed scene that turn with
the sections, so that the derivative of its places by the arc length has the length

    | R_0 (t_0 + kappa_0 x d + d') + (kappa - kappa_0) x d |,

in which everything is in the axes before the rotation: a function of the rotations of the element alone.  A straight
piece goes from a hole ``x_a + R_a d_a`` to a hole ``x_b + R_b d_b``, a function of two rotations and two places.
Within a member ``x_b - x_a`` is the chord of the elements between the holes: a function of their rotations alone.

A tendon whose force is given has the energy tension times change of length.  One whose length is given is one row,
to which all its parts add, and its multiplier is the tension; where it is elastic a further place, of which nothing
else is at, has its elongation as displacement.

Source: Rao, Peyron, Lilge and Burgner-Kahrs, Frontiers in Robotics and AI 7, 630245 (2021), for the two ways to route.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, final

import casadi as ca
import numpy as np

from ..description.tendons import Hole, Piece, Stretch, Tendon, length_of_piece, tangent
from ..mathematics.arrays import Array, numbers
from ..mathematics.quaternion import product
from .beams import Scales
from .elements import Element
from .parts import Parts
from .segments import elongation_of, spanned
from .terms import ARGUMENTS, GROUND, One, Side, Term, name_of

__all__ = ["Elongation", "Routed", "Spanned", "Strung", "loose_in", "pull_of", "tendons_in"]

_Chart = Literal["vectors", "components"]
"""Derivatives by rotations: by vectors about the fixed axes, or by components of quaternions."""

_WIDTHS: Mapping[_Chart, int] = {"vectors": 3, "components": 4}
"""Numbers of a rotation in space."""


@dataclass(frozen=True)
class _Part(Term):
    """A part of a tendon, with a length; the last data are its length at rest, and one that does not change.

    Attributes
    ----------
    given : bool
        Whether the length of the tendon is given, not its tension.
    """

    table: ClassVar[str] = "tendons"
    answers: ClassVar[Mapping[str, str]] = {"tension": "N", "length": "m"}
    shares_row: ClassVar[bool] = True

    given: bool

    def along(self, q: list[Side], u: list[Side], data: ca.SX) -> list[ca.SX]:
        """The vectors along it whose lengths add up to its length, of an element before they turn."""
        raise NotImplementedError

    def length(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """Length at a state."""
        return sum((ca.norm_2(part) for part in self.along(q, u, data)), ca.SX(0))

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The tension times the change of the length."""
        return ca.SX(0) if self.given else load * (self.length(q, u, data) - data[data.shape[0] - 2])

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The change of the length, and the shortening of the free length."""
        return [self.length(q, u, data) - data[data.shape[0] - 2] + load] if self.given else []

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The tension, and the length of this part with that which does not change."""
        return [lam if self.given else load, self.length(q, u, data) + data[data.shape[0] - 1]]


@final
@dataclass(frozen=True)
class Routed(_Part):
    """A tendon along one element.

    Data: at each point the derivative of its places times weight and length, its arm times weight, and the compliance
    of the element.

    Attributes
    ----------
    element : Element
    """

    along_element: ClassVar[bool] = True

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, and its strains."""
        n, strains, *_ = self.element.sizes
        return n, strains, int(self.given), n * (2 * self.axes + self.element.compliances) + 2, 1

    def along(self, q: list[Side], u: list[Side], data: ca.SX) -> list[ca.SX]:
        """At each point the derivative of its places times weight and length, before the rotation of the point."""
        n, axes = self.element.order + 1, self.axes
        forward, arm = (ca.reshape(data[i * n * axes : (i + 1) * n * axes], axes, n) for i in range(2))
        compliance = ca.reshape(data[2 * n * axes : data.shape[0] - 2], self.element.compliances, n)
        here, slope = self.element.at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        found = []
        for k in range(n):
            if self.space:
                turned = ca.cross(self.element.curvature(here[:, k], slope[:, k]), arm[:, k])
            else:
                turned = slope[0, k] * ca.vertcat(-arm[1, k], arm[0, k])
            by = self.element.yields(here[:, k], slope[:, k], ca.vertcat(*u[k]) if u else ca.SX(0, 1))
            way = self.element.strained(forward[:, k], compliance[:, k], by)
            found.append(way + turned)
        return found

    # In space as of elements: derivatives of one point, mapped over the points and put together by constant matrices.

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`; in space assembled from the derivatives of single points."""
        if not self.space or self.element.yielding:
            return super().rotation_gradient()
        symbols, q, forward, arm, rest = self._large_symbols()
        _, _, _, load, lam = symbols
        length, gradient, hessian = self._point.map(self.element.order + 1)(*self.element.at(q), forward, arm)
        by_q, basis, change = self.element.on_nodes(gradient), self.element.basis(q), ca.sum2(length) - rest
        matrix = ca.mtimes(basis.T, ca.mtimes(self.element.between_nodes(hessian), basis))
        # What keeps quaternions on the unit sphere.
        matrix -= 0.25 * ca.diag(ca.vec(ca.repmat(ca.sum1(q * by_q), 3, 1)))
        slope = ca.mtimes(basis.T, ca.vec(by_q))
        tension = lam if self.given else load
        results = {
            "energy": ca.MX.zeros(1) if self.given else load * change,
            "stored": ca.MX.zeros(1),
            "rows": change + load if self.given else ca.MX(0, 1),
            "gradient": ca.densify(tension * slope),
            "stiffness": ca.densify(tension * matrix),
            "rotation_jacobian": ca.densify(slope.T) if self.given else ca.MX(0, slope.shape[0]),
        }
        name = f"rotation_gradient_{name_of(self)}"
        return ca.Function(name, symbols, list(results.values()), [*ARGUMENTS], list(results))

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`; in space assembled from the derivatives of single points."""
        if not self.space or self.element.yielding:
            return super().curvatures()
        symbols, q, forward, arm, _ = self._large_symbols()
        weight = ca.MX.sym("weight")
        _, _, hessian = self._point.map(self.element.order + 1)(*self.element.at(q), forward, arm)
        tension = symbols[4] if self.given else weight * symbols[3]
        found = ca.densify(tension * self.element.between_nodes(hessian))
        name = f"curvatures_{name_of(self)}"
        return ca.Function(name, [*symbols, weight], [found], [*ARGUMENTS, "weight"], ["hessian"])

    def _large_symbols(self) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX, ca.MX]:
        """Arguments of functions put together of others; of these rotations, derivatives of places, arms, and length at
        rest.
        """
        turns, places, rows, count, load = self.sizes
        shapes = ((4, turns), (3, places), (count, 1), (load, 1), (rows, 1))
        symbols = [ca.MX.sym(name, *shape) for name, shape in zip(ARGUMENTS, shapes, strict=True)]
        forward, arm, rest, _ = ca.vertsplit(symbols[2], [0, 3 * turns, 6 * turns, 6 * turns + 1, count])
        return symbols, symbols[0], ca.reshape(forward, 3, turns), ca.reshape(arm, 3, turns), rest

    @functools.cached_property
    def _point(self) -> ca.Function:
        """(rotation, slope, derivative of the place, arm) of one point -> length, gradient (8,) and Hessian (8, 8)."""
        names = {"here": 4, "slope": 4, "forward": 3, "arm": 3}
        here, slope, forward, arm = symbols = [ca.SX.sym(name, size) for name, size in names.items()]
        length = ca.norm_2(forward + ca.cross(self.element.curvature(here, slope), arm))
        hessian, gradient = ca.hessian(length, ca.vertcat(here, slope))
        results = [ca.densify(one) for one in (length, gradient, hessian)]
        return ca.Function(f"point_{name_of(self)}", symbols, results, {"cse": True})


@final
@dataclass(frozen=True)
class Strung(_Part):
    """A straight piece between two holes; data: vector between them at rest, arms of both."""

    one_sided: ClassVar[bool] = True
    apart: ClassVar[bool] = True

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Two rotations and two places."""
        return 2, 2, int(self.given), 3 * self.axes + 2, 1

    def along(self, q: list[Side], u: list[Side], data: ca.SX) -> list[ca.SX]:
        """The vector from hole to hole, in the fixed axes."""
        n = self.axes
        gap = data[:n] + ca.vertcat(*[b - a for a, b in zip(*u, strict=True)])
        moved = [
            self.turned_back(self.reverse(side), ca.vertsplit(data[n * i : n * i + n])) for i, side in enumerate(q, 1)
        ]
        return [gap + ca.vertcat(*moved[1]) - ca.vertcat(*moved[0])]

    def reverse(self, q: Side) -> Side:
        """The opposite rotation."""
        return [q[0], -q[1], -q[2], -q[3]] if self.space else [-q[0]]


@final
@dataclass(frozen=True)
class Spanned(_Part):
    """A straight piece between two holes of a member, over the elements between them.

    The vector from hole to hole gains ``sum (R(q) - I) w`` over the points of the elements: ``w`` is the tangent of a
    point, at the first one less the arm of the hole there, at the last one with the arm of the other hole.

    Data: vector from hole to hole at rest; the vectors ``w``, and the compliances of the points.

    Attributes
    ----------
    element : Element
        It integrates at its nodes.
    count : int
        Number of the elements.
    """

    element: Element
    count: int

    @property
    def spans(self) -> int:
        """The elements between the holes."""
        return self.count

    @property
    def nodes(self) -> int:
        """Number of their nodes."""
        return self.count * self.element.order + 1

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the elements, and their strains."""
        strains, points = self.count * self.element.sizes[1], len(self._node_of)
        data = self.axes + points * (self.axes + self.element.compliances)
        return self.nodes, strains, int(self.given), data + 2, 1

    def length(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """Distance of the holes."""
        return ca.norm_2(self.vector(q, u, data))

    def pull(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """The tension, from the first hole to the last one."""
        vector = self.vector(q, u, data)
        return ca.vertsplit((lam if self.given else load) / ca.norm_2(vector) * vector)

    def vector(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """From the first hole to the last one."""
        start, rest, compliance = self._split(data)
        total = start
        for k, node in enumerate(self._node_of):
            strain = ca.vertcat(ca.SX(0, 1), *(u[k] if u else []))
            total += self._gained(q[node], rest[:, k], strain, compliance[:, k])
        return total

    def _gained(self, side: Side, rest: ca.SX, strain: ca.SX, compliance: ca.SX) -> ca.SX:
        """What one point adds to the vector between the holes by its rotation and, where it has some, its strain."""
        opposite = [side[0], *[-part for part in side[1:]]] if self.space else [-side[0]]
        gained = ca.vertcat(*self.turned_back(opposite, ca.vertsplit(rest)))
        if not strain.numel():
            return gained
        more = self.element.strained(ca.SX.zeros(self.axes), compliance, strain)
        return gained + ca.vertcat(*self.forth(side, ca.vertsplit(more)))

    def _split(self, data: Any) -> tuple[Any, Any, Any]:
        """The vector between the holes at rest; vectors and compliances of the points, a column for each."""
        axes, n, size = self.axes, len(self._node_of), self.element.compliances
        start, rest, compliance, _ = ca.vertsplit(data, np.cumsum([0, axes, n * axes, n * size, 2]).tolist())
        return start, ca.reshape(rest, axes, n), ca.reshape(compliance, size, n)

    @functools.cached_property
    def _node_of(self) -> list[int]:
        """Number of the node at which each point is: where elements meet there are two, without strains their sum."""
        order = self.element.order
        if not self.element.strains:
            return list(range(self.nodes))
        return [element * order + k for element in range(self.count) for k in range(order + 1)]

    # In space derivatives of single points, mapped over the points and put together by constant matrices, as the length
    # is a function of a sum over the points.

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_gradient()
        symbols, tension, change, by_sides = self._large("vectors", "hessian")
        slope, hessian, load = by_sides[0], by_sides[1], symbols[3]
        results = {
            "energy": ca.MX.zeros(1) if self.given else load * change,
            "stored": ca.MX.zeros(1),
            "rows": change + load if self.given else ca.MX(0, 1),
            "gradient": tension * slope,
            "stiffness": tension * hessian,
            "rotation_jacobian": slope.T if self.given else ca.MX(0, slope.shape[0]),
        }
        return self._function("rotation_gradient", symbols, results)

    def rotation_forces(self) -> ca.Function:
        """As :meth:`.Term.rotation_forces`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_forces()
        symbols, tension, change, (slope,) = self._large("vectors", "gradient")
        rows = change + symbols[3] if self.given else ca.MX(0, 1)
        return self._function("forces", symbols, {"rows": rows, "gradient": tension * slope})

    def slopes(self) -> ca.Function:
        """As :meth:`.Term.slopes`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().slopes()
        symbols, _, _, (slope,) = self._large("components", "gradient")
        results = {
            "gradient": ca.MX.zeros(slope.shape[0]) if self.given else symbols[3] * slope,
            "jacobian": slope.T if self.given else ca.MX(0, slope.shape[0]),
        }
        return self._function("slopes", symbols[:4], results)

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().curvatures()
        symbols, tension, _, (_, hessian) = self._large("components", "hessian")
        weight = ca.MX.sym("weight")
        found = (tension if self.given else weight * tension) * hessian
        return self._function("curvatures", [*symbols, weight], {"hessian": found})

    def _function(self, name: str, symbols: list[ca.MX], results: dict[str, ca.MX]) -> ca.Function:
        names = [*ARGUMENTS, "weight"][: len(symbols)]
        values = [ca.densify(part) for part in results.values()]
        return ca.Function(f"{name}_{name_of(self)}", symbols, values, names, list(results))

    def _large(self, chart: _Chart, wanted: str) -> tuple[list[ca.MX], ca.MX, ca.MX, list[ca.MX]]:
        """Symbols, tension, change of the length, and its derivatives by all rotations, then by all strains.

        By rotation vectors about the fixed axes, as :func:`.rotation_gradient` says, or by components; to the second
        ones for ``hessian``.
        """
        turns, places, rows, count, load = self.sizes
        shapes = ((4, turns), (3, places), (count, 1), (load, 1), (rows, 1))
        symbols = [ca.MX.sym(name, *shape) for name, shape in zip(ARGUMENTS, shapes, strict=True)]
        q, u, data = symbols[:3]
        n = len(self._node_of)
        start, rest, compliance = self._split(data)
        given = [q[:, self._node_of], rest, *([u, compliance] if places else [])]
        vector = start + ca.sum2(self._point(chart, "value").map(n)(*given))
        length, unit, across = self._norm(vector)
        jacobians = self._point(chart, "gradient").map(n)(*given)
        jacobian = self._by_sides(jacobians if places else [jacobians], chart)
        by_sides = [ca.mtimes(jacobian.T, unit)]
        if wanted == "hessian":
            curved = self._point(chart, "hessian").map(n)(*given, ca.repmat(unit, 1, n))
            entries = ca.vertcat(*[ca.vec(part) for part in (curved if places else [curved])])
            total = jacobian.shape[1]
            summed = ca.reshape(ca.mtimes(self._onto_sides(chart), entries), total, total)
            by_sides.append(ca.mtimes(jacobian.T, ca.mtimes(across, jacobian)) + summed)
        tension = symbols[4] if self.given else symbols[3]
        return symbols, tension, length - data[count - 2], by_sides

    def _by_sides(self, jacobians: list[ca.MX], chart: _Chart) -> ca.MX:
        """Derivatives of the vector by all sides from those by the rotations of the points and by their strains."""
        points, width = len(self._node_of), _WIDTHS[chart]
        at = ca.DM.triplet(list(range(points)), self._node_of, ca.DM.ones(points), points, self.nodes)
        return ca.horzcat(ca.mtimes(jacobians[0], ca.kron(at, ca.DM.eye(width))), *jacobians[1:])

    def _onto_sides(self, chart: _Chart) -> ca.DM:
        """Matrix from the second derivatives of the points, those by rotations, then mixed ones, to those by all sides.

        What is added is linear in the strains, so that second derivatives by these vanish.
        """
        points, width = len(self._node_of), _WIDTHS[chart]
        strained = width * self.nodes
        total = strained + 3 * self.sizes[1]
        turned = width * np.array(self._node_of)[:, None] + np.arange(width)
        row, column = np.repeat(turned, width, axis=0).ravel(), np.repeat(turned.ravel(), width)
        places, entries = column * total + row, np.arange(points * width**2)
        if self.sizes[1]:
            # Entries of a point column by column: of each strain by all components of the rotation.
            row = np.repeat(turned, 3, axis=0).ravel()
            column = np.repeat(strained + np.arange(3 * points), width)
            mixed = len(entries) + np.arange(len(row))
            places = np.concatenate([places, column * total + row, row * total + column])
            entries = np.concatenate([entries, mixed, mixed])
        size = points * width**2 + (3 * width * points if self.sizes[1] else 0)
        return ca.DM.triplet(places.tolist(), entries.tolist(), ca.DM.ones(len(places)), total**2, size)

    @functools.cached_property
    def _norm(self) -> ca.Function:
        """A vector -> its length, and the first and second derivatives of that."""
        vector = ca.SX.sym("vector", self.axes)
        hessian, gradient = ca.hessian(ca.norm_2(vector), vector)
        results = [ca.norm_2(vector), gradient, ca.densify(hessian)]
        return ca.Function("norm", [vector], results, {"cse": True})

    def _point(self, chart: _Chart, wanted: str) -> ca.Function:
        """Arguments of a point -> what it adds, or derivatives of that by its rotation and its strain.

        The second ones along a direction, a further argument: by the rotation, and by both.
        """
        strains = 3 if self.element.strains else 0
        sizes = {"q": 4, "rest": 3, "strain": strains, "compliance": self.element.compliances, "unit": 3}
        symbols = [ca.SX.sym(name, size) for name, size in sizes.items() if size]
        q, rest, unit = symbols[0], symbols[1], symbols[-1]
        strain, compliance = symbols[2:4] if strains else (ca.SX(0, 1), ca.SX(0, 1))
        gained = self._gained(ca.vertsplit(q), rest, strain, compliance)
        basis = ca.SX.eye(4)
        if chart == "vectors":
            columns = [ca.vertcat(*product([0.0, *axis], ca.vertsplit(q))) for axis in np.eye(3).tolist()]
            basis = 0.5 * ca.horzcat(*columns)
        if wanted == "value":
            results = [gained]
        elif wanted == "gradient":
            by_strain = [ca.jacobian(gained, strain)] if strains else []
            results = [ca.mtimes(ca.jacobian(gained, q), basis), *by_strain]
        else:
            hessian, slope = ca.hessian(ca.dot(unit, gained), q)
            curved = ca.mtimes(basis.T, ca.mtimes(hessian, basis))
            if chart == "vectors":
                # What keeps quaternions on the unit sphere.
                curved -= 0.25 * ca.dot(q, slope) * ca.SX.eye(3)
            mixed = [ca.mtimes(basis.T, ca.jacobian(slope, strain))] if strains else []
            results = [curved, *mixed]
        given = symbols if wanted == "hessian" else symbols[:-1]
        name = f"point_{wanted}_{chart}"
        return ca.Function(name, given, [ca.densify(part) for part in results], {"cse": True})


@final
@dataclass(frozen=True)
class Elongation(Term):
    """What an elastic tendon is longer than its free length: the first displacement of a place; data: stiffness.

    Attributes
    ----------
    pushes : bool
        Whether it resists being shorter too.
    """

    shares_row: ClassVar[bool] = True

    pushes: bool

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """One place, one row."""
        return 0, 1, 1, 1, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the stiffness times the square of the elongation."""
        along = u[0][0] if self.pushes else ca.fmax(u[0][0], 0.0)
        return 0.5 * data[0] * (along**2 + sum((across**2 for across in u[0][1:]), ca.SX(0)))

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Its share of the row of the tendon."""
        return [-u[0][0]]


# -- of a scene -------------------------------------------------------------------------------------


def tendons_in(parts: Parts) -> Iterator[One]:
    """Terms of the tendons and chambers of a scene, but for those that rub."""
    for name, tendon in parts.scene.tendons.items():
        if not tendon.rubs:
            yield from _Maker(parts, name, tendon).all()


def loose_in(parts: Parts, name: str) -> Iterator[tuple[Piece, list[One]]]:
    """The pieces of a tendon, in the order of its way, and the terms of each without what links them.

    A piece along a rigid member has none.  Straight pieces go from the pulled end on, elements are in the order of
    their member.
    """
    tendon, scene = parts.scene.tendons[name], parts.scene
    maker = _Maker(parts, name, tendon)
    for piece in scene.tendon_pieces[name]:
        if isinstance(piece, tuple):
            yield piece, [maker._strung(*(piece[::-1] if tendon.pulled_at == "end" else piece))]
        else:
            yield piece, [] if scene.members[piece.member].type == "rigid" else list(maker._routed(piece))


def pull_of(tendon: Tendon, rest: Any, scales: Scales) -> Any:
    """Tension, or shortening of one whose length without load is ``rest``, at factor 1, dimensionless."""
    if not tendon.measured:
        return tendon.force / scales.force
    return (tendon.pull or 0.0) / scales.length if tendon.length is None else rest - tendon.length / scales.length


@dataclass(frozen=True, eq=False)
class _Maker:
    parts: Parts
    name: str
    tendon: Tendon

    @property
    def axes(self) -> int:
        return self.parts.element.axes

    @property
    def given(self) -> bool:
        """Whether its length is a constraint; of a slack tendon it is not."""
        return self.tendon.measured and (self.name, "slack") not in self.parts.mesh.stops

    def all(self) -> Iterator[One]:
        scene, scales = self.parts.scene, self.parts.scales
        found, still = list[One](), 0.0
        for piece in scene.tendon_pieces[self.name]:
            if isinstance(piece, tuple):
                between = spanned(scene, self.parts.mesh, piece)
                found.append(self._spanned(piece, between) if between else self._strung(*piece))
            elif scene.members[piece.member].type == "rigid":
                still = still + length_of_piece(piece, scene.center_lines[piece.member]) / scales.length
            else:
                found += self._routed(piece)
        rest = sum((one.data[-2] for one in found), still)
        history = self.tendon.history
        for i, one in enumerate(found):
            data = one.data if i else np.concatenate([one.data[:-1], np.reshape(numbers(still), (1,))])
            yield One(
                one.kind,
                self.name,
                one.node,
                numbers(data),
                one.turns,
                one.places,
                one.row,
                self._load(i, rest, history),
                one.element,
            )
        if self.tendon.stiffness is not None:
            stiffness = np.array([1.0]) * self.tendon.stiffness * scales.length / scales.force
            place = self.parts.segments.place(elongation_of(self.name))
            kind = Elongation(self.parts.element.space, self.tendon.pushes)
            yield One(kind, self.name, "", numbers(stiffness), (), (place,), f"tendons.{self.name}")

    def _load(self, i: int, rest: Any, history: str | None) -> dict[str | None, Array]:
        """Tension of each part, or the shortening with the first part alone."""
        if self.tendon.measured and (i or not self.given):
            return {}
        return {history: np.reshape(numbers(pull_of(self.tendon, rest, self.parts.scales)), (1,))}

    def _strung(self, first: Hole, last: Hole) -> One:
        space, unit, n = self.parts.element.space, self.parts.scales.length, self.axes
        gap, *arms = (numbers(v[:n] / unit) for v in (last.position - first.position, first.arm, last.arm))
        data = np.concatenate([gap, *arms, np.reshape(numbers(np.linalg.norm(gap)), (1,)), np.zeros(1)])
        turns, places = (self._turn(first), self._turn(last)), (self._place(first), self._place(last))
        return One(Strung(space, self.given), self.name, "", numbers(data), turns, places, self._row)

    def _spanned(self, piece: tuple[Hole, Hole], between: range) -> One:
        """A piece between two holes of a member, from that with the smaller fraction."""
        parts, unit, axes = self.parts, self.parts.scales.length, self.axes
        first, last = sorted(piece, key=lambda hole: hole.at)
        start = parts.beams.first[str(first.member)] + between.start
        elements = slice(start, start + len(between))
        kind = Spanned(parts.element.space, self.given, parts.element, len(between))
        gap, *arms = (numbers(v[:axes] / unit) for v in (last.position - first.position, first.arm, last.arm))
        vectors: list[Array] = []
        for number in range(elements.start, elements.stop):
            own = [parts.beams.tangent[number, k] for k in range(parts.element.order + 1)]
            if vectors and not kind.element.strains:
                own[0] = own[0] + vectors.pop()
            vectors += own
        vectors[0], vectors[-1] = vectors[0] - arms[0], vectors[-1] + arms[1]
        yielding = parts.beams.compliance[elements].ravel()
        rest = np.reshape(numbers(np.linalg.norm(gap)), (1,))
        data = np.concatenate([gap, *vectors, yielding, rest, np.zeros(1)])
        turns = tuple(parts.rotations.chain(elements).tolist())
        places = tuple(parts.segments.strains[elements].ravel().tolist())
        return One(kind, self.name, "", numbers(data), turns, places, self._row, element=start)

    @property
    def _row(self) -> str:
        return f"tendons.{self.name}" if self.given else ""

    def _cut(self, hole: Hole) -> int:
        return self.parts.mesh.cut_at(str(hole.member), hole.at)

    def _place(self, hole: Hole) -> int:
        """Place at which a hole pulls."""
        segments = self.parts.segments
        if hole.member is None:
            return GROUND if hole.node is None else segments.place(hole.node)
        parts = [part for part in segments.parts if part.member == hole.member]
        at = parts[0].elements.start + self._cut(hole)
        return segments.place(next((part.start for part in parts if part.elements.start == at), parts[-1].end))

    def _turn(self, hole: Hole) -> int:
        """Rotation with which a hole turns; of a node without a rotation of its own none, as it has no arm."""
        rotations, order = self.parts.rotations, self.parts.element.order
        if hole.member is None:
            number = None if hole.node is None else rotations.node_turn[hole.node]
            return GROUND if number is None else number
        runs = [part.elements for part in self.parts.segments.parts if part.member == hole.member]
        return int(rotations.chain(slice(runs[0].start, runs[-1].stop))[self._cut(hole) * order])

    def _routed(self, piece: Stretch) -> Iterator[One]:
        """A term for each element of a stretch."""
        parts, element, n = self.parts, self.parts.element, self.parts.element.order + 1
        line, cuts = parts.scene.center_lines[piece.member], parts.mesh.cuts[piece.member]
        first = parts.beams.first[piece.member]
        a, b = (parts.mesh.cut_at(piece.member, at) for at in (piece.start, piece.end))
        spans = np.diff(cuts[a : b + 1])
        x = (cuts[a:b, None] + spans[:, None] * element.points).ravel()
        middle = np.repeat(cuts[a:b] + 0.5 * spans, n)
        forward, arm = tangent(piece.way, line, x, middle)
        weight = np.tile(element.weights, b - a)
        length = np.repeat(line.length / parts.scales.length * spans, n) * weight
        forward = numbers(forward[:, : self.axes] * length[:, None]).reshape(b - a, n, self.axes)
        arm = numbers(arm[:, : self.axes] * (weight[:, None] / parts.scales.length)).reshape(b - a, n, self.axes)
        rest = np.linalg.norm(forward, axis=2).sum(axis=1)
        kind = Routed(element.space, self.given, element)
        for i in range(b - a):
            number = first + a + i
            yielding = parts.beams.compliance[number].ravel()
            data = np.concatenate([forward[i].ravel(), arm[i].ravel(), yielding, rest[i : i + 1], np.zeros(1)])
            turns, places = (tuple(part[number].tolist()) for part in (parts.rotations.turns, parts.segments.strains))
            yield One(kind, self.name, "", numbers(data), turns, places, self._row, element=number)
