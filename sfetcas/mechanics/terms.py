"""Terms of the Lagrangian: functions of a kind of term, their derivatives in two charts of rotations, and their sides.

For statics the Lagrangian of a model is a sum over terms,

    L(q, u, lam) = sum energy(q_1..q_k, u_1..u_m; data, loads) + lam . rows(q_1..q_k, u_1..u_m; data, loads),

of the rotations ``q`` and displacements ``u`` of its *sides*.  The rows of a joint are constraints, whose multipliers
are unknowns.  The row of an element is the change of its chord, and its multiplier the internal force, which is linear
in the multipliers of the loop closures.  A term without potential gives generalised forces instead of an energy.

A kind of term is one class that defines these functions.  Their derivatives follow from the one expression, once for
each kind in a process, in either chart: components of rotations, whose norms are further constraints (IPOPT's
program), or rotation vectors about the fixed axes, ``dq = 1/2 (0, phi) q`` on unit quaternions (Newton's method).
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index, numbers
from ..mathematics.quaternion import Components, product, turned

__all__ = [
    "ALWAYS",
    "ARGUMENTS",
    "GROUND",
    "Discrete",
    "Group",
    "One",
    "Side",
    "Term",
    "answers_of",
    "curvatures_of",
    "densities_of",
    "energies_of",
    "grouped",
    "name_of",
    "pulls_of",
    "rotation_forces",
    "rotation_gradient",
    "rows_of",
    "slopes_of",
]

Side = list[ca.SX]
"""Components of a rotation or of a vector."""

Discrete = Literal["middle", "ends", "relative", "strains"]
"""Where derivatives are taken between two states in the energy-momentum scheme, see :attr:`Term.discrete`."""

ALWAYS = "\0"
"""In the place of the name of a history, none of which is called so: what no factor multiplies."""

GROUND = -1
"""Number of a side that is the ground, which neither rotates nor moves."""


@dataclass(frozen=True)
class Term(Components, abc.ABC):
    """Base class of the kinds of terms; a new kind overrides the methods that differ from their defaults.

    In all methods ``q`` and ``u`` list the rotations and displacements of the sides, ``data`` is constant, and ``load``
    grows with the load factor; everything is dimensionless.

    Attributes
    ----------
    space : bool
        In space (quaternions, three axes) or in the plane (angles, two axes).
    """

    space: bool

    table: ClassVar[str] = ""
    """Table of the scene and of the answer to which it belongs; empty where it belongs to none."""

    answers: ClassVar[Mapping[str, str]] = {}
    """Keys of the quantities that :meth:`answer` gives, with their units."""

    one_sided: ClassVar[bool] = False
    """Whether its moments on the rotations of one node have a non-zero sum."""

    supports: ClassVar[bool] = False
    """Whether its force and moment on the ground are a reaction of the support there."""

    follows: ClassVar[bool] = False
    """Whether it is a follower load."""

    is_load: ClassVar[bool] = False
    """Whether its forces are loads, not those of a joint or a spring."""

    is_couple: ClassVar[bool] = False
    """Whether it is a dead moment."""

    switches: ClassVar[bool] = False
    """Whether its one number of data says whether a unilateral constraint is active."""

    drives: ClassVar[str] = ""
    """What is prescribed by its ``load``: ``angle`` or ``travel`` of a joint, ``twist`` of a tube; else empty."""

    along_element: ClassVar[bool] = False
    """Whether it acts along an element, whose rotations are its sides, so that its moments are among those of the
    element; before the place at its start where it has one.
    """

    pulls: ClassVar[bool] = False
    """Whether it is :attr:`along_element` and carries a force beside the internal one at its start, :meth:`pull`."""

    strains_member: ClassVar[bool] = False
    """Whether its stored energy is part of the strain energy of the member along which it acts."""

    apart: ClassVar[bool] = False
    """Whether its first rotation has its moment at its first place, its second one at its second place."""

    shares_row: ClassVar[bool] = False
    """Whether its rows of the same name as those of other terms are one row, to which each adds its share."""

    on_face: ClassVar[bool] = False
    """Whether its row keeps a place on the surface of an obstacle."""

    along_face: ClassVar[bool] = False
    """Whether its rows keep a place from moving along the surface of an obstacle."""

    looks_up: ClassVar[bool] = False
    """Whether it has tables in it, among which it would take long to look for what is the same."""

    @property
    def spans(self) -> int:
        """Along how many elements it is a string between two of their nodes, whose pull they do not carry; else 0.

        They are that of the ``element`` of :class:`One` and the next ones, whose rotations are its sides.
        """
        return 0

    @property
    def discrete(self) -> Discrete:
        """How the energy-momentum scheme takes derivatives whose work equals the change of energy and rows between two
        states.

        ``middle``: at the mean state, to second order; ``ends``: the mean of those at both ends, exact for vectors that
        turn with one side; ``relative``: by the rotation of the second side relative to the first, or of one to the
        ground, exact for rows that are linear in it, and in the plane for energies quadratic in the angle; ``strains``:
        exact for energies that are linear in the strains of an element, of whose :meth:`efforts` it knows.
        """
        return "middle"

    @property
    def largest_at(self) -> int | None:
        """Of a force that it spreads along its element the end, 0 or 1, at which that is largest; None where it spreads
        none.  Its :meth:`answer` then is the force on each point of the element, across what it touches, then along.
        """
        return None

    @property
    def vectors(self) -> int:
        """How many vectors its rows begin with that have momentum, centrifugal and Coriolis forces."""
        return 0

    @property
    def from_place(self) -> int:
        """How many of its :attr:`vectors`, the first ones, are relative to its first place in the undeformed scene."""
        return 0

    @property
    def has_potential(self) -> bool:
        """Whether its forces are the derivative of its energy, not those of :meth:`forces`."""
        return True

    def counted(self, data: Array) -> tuple[Array, Array] | None:
        """Axis (n, 3) of the first side and direction (n, 3) of the second whose angle about the axis counts turns.

        A zero direction means the angle of the rotation itself.  For such terms the last number of the data is the
        reference value of the angle, see :class:`~sfetcas.mechanics.unwrapping.Unwrapping`.  None for terms without
        such an angle.
        """
        return None

    @property
    def proportional(self) -> bool:
        """Whether its forces are proportional to its loads, whatever the displacements."""
        return self.is_load

    @property
    @abc.abstractmethod
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Number of rotations, places, rows, data, and loads (data that grow with the load factor)."""

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Potential energy, dimensionless."""
        return ca.SX(0)

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """The constraint rows, zero where met: angles (rad) and displacements, dimensionless."""
        return []

    def forces(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Generalised forces without potential, as a residual: moments on rotations, then forces on places.

        A term with a potential has none, or only such that do no work on the possible motions of its sides.
        """
        return []

    def stiffest(self, data: Array) -> Array | None:
        """Largest stiffness (n,) of each term, where its rounding errors affect softer directions; None elsewhere."""
        return None

    def travel(self, q: list[Side], u: list[Side], data: ca.SX) -> ca.SX:
        """Angle, rad, or elongation, dimensionless, of a spring, whose rate a damper parallel to it resists."""
        return ca.SX(0)

    def work(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """What is to be reported with the energy and is never differentiated: minus the generalised forces times the
        displacements, or a part of the energy that loads alone say.
        """
        return ca.SX(0)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """The elastic part of the energy: what it is without loads, unless loads change what is free of stress."""
        return ca.substitute(self.energy(q, u, data, load), load, ca.SX.zeros(load.shape))

    def arms(self, q: list[Side], data: ca.SX) -> list[ca.SX]:
        """Of a kind whose vectors are ends of arms that turn with the nodes of an element: these arms, turned."""
        return []

    def densities(
        self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]] | None:
        """Of a kind along an element: forces and couples at its points, weights included, in the fixed axes.

        None where it acts on nothing but the strains.
        """
        return None

    def pull(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """Of a kind that :attr:`spans` elements, or :attr:`pulls`: the force (axes,) along it, fixed axes, which their
        internal force lacks.
        """
        return []

    def efforts(self, data: ca.SX, load: ca.SX) -> tuple[Any, ca.SX]:
        """The element on whose strains it acts, and the derivatives (turns, points) of the energy by its curvatures
        times its length, see :attr:`discrete`.
        """
        raise NotImplementedError

    @property
    def memory(self) -> int:
        """Internal variables of each of its points, which the steps before have left; they are the last of its data."""
        return 0

    @property
    def memory_columns(self) -> Index:
        """Numbers of these among the data, one point after the other."""
        return np.zeros(0, np.intp)

    def remembered(self) -> ca.Function:
        """``(q, u, data, load, lam) ->`` internal variables of its points, one point after the other, at the end of a
        step, what the step has dissipated, and by how much the element is bent for good about each axis of its section
        at each point, (3 points,), rad; of a kind with :attr:`memory`.
        """
        raise NotImplementedError

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """Quantities for the answer, in the order of :attr:`answers`, dimensionless; ``lam``: multipliers."""
        return []

    # -- vectors and rotations of the sides --------------------------------------------------------

    def back(self, q: Side, v: Side) -> Side:
        """The components of a vector in rotated axes, ``R(q)^T v``."""
        if self.space:
            return turned([q[0], -q[1], -q[2], -q[3]], v)
        c, s = ca.cos(q[0]), ca.sin(q[0])
        return [c * v[0] + s * v[1], c * v[1] - s * v[0]]

    def turned_back(self, q: Side, v: Side) -> Side:
        """``R(q)^T v - v``, to full relative precision also for small rotations."""
        if self.space:
            spin = [-a for a in q[1:]]
            once = ca.cross(ca.vertcat(*spin), ca.vertcat(*v))
            return ca.vertsplit(2.0 * (q[0] * once + ca.cross(ca.vertcat(*spin), once)))
        s, versine = ca.sin(q[0]), 2.0 * ca.sin(0.5 * q[0]) ** 2
        return [s * v[1] - versine * v[0], -s * v[0] - versine * v[1]]

    def forth(self, q: Side, v: Side) -> Side:
        """The rotated vector, ``R(q) v``."""
        if self.space:
            return turned(q, v)
        c, s = ca.cos(q[0]), ca.sin(q[0])
        return [c * v[0] - s * v[1], s * v[0] + c * v[1]]

    def turned_forth(self, q: Side, v: Side) -> Side:
        """``R(q) v - v``, to full relative precision also for small rotations."""
        return self.turned_back([q[0], *(-a for a in q[1:])] if self.space else [-q[0]], v)

    def relative(self, a: Side, b: Side) -> Side:
        """Rotation of side b relative to side a, in undeformed axes: ``conj(a) b``, in the plane the difference."""
        return product([a[0], -a[1], -a[2], -a[3]], b) if self.space else [b[0] - a[0]]

    # -- derivatives, where a kind has a shorter way to them than the whole expression ---------------

    def rotation_gradient(self) -> ca.Function:
        """The function :func:`rotation_gradient` of this kind."""
        return _rotation_gradient(self)

    def rotation_forces(self) -> ca.Function:
        """The function :func:`rotation_forces` of this kind."""
        whole = rotation_gradient(self)
        symbols = whole.sx_in()
        found = whole.call(symbols)
        names = whole.name_in()
        return _shared(f"forces_{name_of(self)}", symbols, [found[2], found[3]], names, ["rows", "gradient"], self)

    def slopes(self) -> ca.Function:
        """The function :func:`slopes_of` of this kind."""
        return _slopes(self)

    def curvatures(self) -> ca.Function:
        """The function :func:`curvatures_of` of this kind."""
        return _curvatures(self)


@dataclass(frozen=True)
class One:
    """One term before it is grouped with those of its kind; its data are dimensionless.

    Attributes
    ----------
    kind : Term
    name : str
        The record that it belongs to: a spring, member, motion, load, or joint.
    node : str
        The node at which it is; empty where there is none.
    data : ndarray (data,)
    turns, places : tuple of int
        Numbers of the rotations and places that are its sides.
    row : str
        Name of its rows.
    loads : mapping of str or None to ndarray (loads,)
        Data that grow with a history, with the load factor (None), or not at all (:data:`ALWAYS`), at factor 1, beside
        the loads of the scene.
    element : int
        Number of the element whose rotations are its sides, or of the first of them; -1 where there is none.
    """

    kind: Term
    name: str
    node: str
    data: Array
    turns: tuple[int, ...] = ()
    places: tuple[int, ...] = ()
    row: str = ""
    loads: Mapping[str | None, Array] = field(default_factory=dict)
    element: int = -1


@dataclass(frozen=True, eq=False)
class Group:
    """All terms of one kind: where they act, and their data.

    Attributes
    ----------
    kind : Term
    turns, places : ndarray (n, rotations | places)
        Numbers of the sides.
    data : ndarray (n, data)
    rows : tuple of str
        Names of the rows that have multipliers of their own, those of the first term first; rows that are shared stand
        with the first term that has them.
    names : tuple of str
        For each term the record that it belongs to: a spring, member, motion, load, or joint.
    nodes : tuple of str
        For each term the node at which it is; of a small member its first.
    loads : mapping of str or None to ndarray (n, loads)
        Data that grow with a history, or with the load factor (None), at factor 1, beside the loads of the scene.
    labels : ndarray (n, rows)
        Numbers of the rows of each term among those of all groups beside the elements.
    elements : ndarray (n,)
        Numbers of the elements whose rotations are the sides, or of the first of each; -1 where there is none.
    """

    kind: Term
    turns: Index
    places: Index
    data: Array
    rows: tuple[str, ...]
    names: tuple[str, ...]
    nodes: tuple[str, ...]
    loads: Mapping[str | None, Array] = field(default_factory=dict)
    labels: Index = field(default_factory=lambda: np.zeros((0, 0), np.intp))
    elements: Index = field(default_factory=lambda: np.zeros(0, np.intp))

    @property
    def shared(self) -> bool:
        """Whether some of its rows are shared, so that they do not stand one after the other."""
        return self.labels.size != len(self.rows)


def grouped(ones: Iterable[One]) -> tuple[Group, ...]:
    """Terms grouped by kind, in the order in which the kinds first appear; dead moments come last."""
    found: dict[Term, list[One]] = {}
    for one in ones:
        found.setdefault(one.kind, []).append(one)
    groups, known, count = list[Group](), dict[str, int](), 0
    for kind in sorted(found, key=lambda kind: kind.is_couple):
        groups.append(_group(kind, found[kind], known, count))
        count += len(groups[-1].rows)
    return tuple(groups)


def _group(kind: Term, ones: list[One], known: dict[str, int], first: int) -> Group:
    """The group of a kind; ``known`` collects the numbers of rows that are shared, ``first`` is that of its first."""
    turns, places, rows, data, loads = kind.sizes
    named = [one.row if rows == 1 else f"{one.row or one.name}, {c + 1} of {rows}" for one in ones for c in range(rows)]
    numbered = first + np.arange(len(named), dtype=np.intp)
    if kind.shares_row:
        own = [name for name in dict.fromkeys(named) if name not in known]
        known |= {name: first + i for i, name in enumerate(own)}
        numbered, named = np.array([known[name] for name in named], dtype=np.intp), own
    n, histories = len(ones), dict.fromkeys(history for one in ones for history in one.loads)
    nothing = np.zeros(loads)
    return Group(
        kind=kind,
        turns=np.array([one.turns for one in ones], dtype=np.intp).reshape(n, turns),
        places=np.array([one.places for one in ones], dtype=np.intp).reshape(n, places),
        data=numbers([one.data for one in ones]).reshape(n, data),
        rows=tuple(named),
        names=tuple(one.name for one in ones),
        nodes=tuple(one.node for one in ones),
        loads={history: numbers([one.loads.get(history, nothing) for one in ones]) for history in histories},
        labels=numbered.reshape(n, rows),
        elements=np.array([one.element for one in ones], dtype=np.intp),
    )


def name_of(kind: Term) -> str:
    """A name for the functions of a kind, unique among kinds."""
    extra = ""
    for item in fields(kind):
        value = getattr(kind, item.name)
        if item.name != "space" and value is not False:
            extra += "_" + (name_of(value) if isinstance(value, Term) else item.name if value is True else str(value))
    return f"{type(kind).__name__.lower()}_{'space' if kind.space else 'plane'}{extra}"


ARGUMENTS = ("q", "u", "data", "load", "lam")
"""Names of the arguments of functions of a term."""


@functools.cache
def _symbols(kind: Term) -> tuple[list[ca.SX], tuple[list[Side], list[Side]]]:
    """Arguments q, u, data, load, lam; the sides as lists."""
    turns, places, rows, data, load = kind.sizes
    q, u = ca.SX.sym("q", kind.components, turns), ca.SX.sym("u", kind.axes, places)
    arguments = [q, u, ca.SX.sym("data", data), ca.SX.sym("load", load), ca.SX.sym("lam", rows)]
    return arguments, ([ca.vertsplit(q[:, i]) for i in range(turns)], [ca.vertsplit(u[:, i]) for i in range(places)])


def _shared(
    name: str, arguments: list[ca.SX], results: list[ca.SX], given: list[str], outputs: list[str], kind: Term
) -> ca.Function:
    """A function that evaluates each common subexpression once: derivatives repeat sines and cosines many times."""
    return ca.Function(name, arguments, results, given, outputs, {"cse": not kind.looks_up})


@functools.cache
def _energy(kind: Term) -> ca.SX:
    arguments, sides = _symbols(kind)
    return kind.energy(*sides, arguments[2], arguments[3])


@functools.cache
def _stored(kind: Term) -> ca.SX:
    arguments, sides = _symbols(kind)
    return kind.stored(*sides, arguments[2], arguments[3])


@functools.cache
def _expressions(kind: Term) -> tuple[list[ca.SX], ca.SX, ca.SX, ca.SX]:
    """Arguments, energy, rows and generalised forces of a kind."""
    arguments, sides = _symbols(kind)
    rows = ca.vertcat(ca.SX(0, 1), *kind.residual(*sides, arguments[2], arguments[3]))
    forces = ca.vertcat(ca.SX(0, 1), *kind.forces(*sides, arguments[2], arguments[3]))
    return arguments, _energy(kind), rows, forces


def _work(kind: Term) -> ca.SX:
    arguments, sides = _symbols(kind)
    return kind.work(*sides, arguments[2], arguments[3])


@functools.cache
def rotation_gradient(kind: Term) -> ca.Function:
    """``(q, u, data, load, lam) ->`` energy, its part without loads, rows, gradient, stiffness, Jacobian of the rows.

    Derivatives of the Lagrangian ``energy + lam.rows`` by rotations about the fixed axes of all sides, then by all
    displacements, on unit quaternions: with ``E`` from ``dq = 1/2 (0, phi) q`` the gradient is ``E^T g`` and the
    stiffness ``E^T H E - 1/4 (q.g) I``, the symmetric second derivative along ``exp(phi/2) q`` (its second part keeps
    the quaternion on the unit sphere, as the multiplier of the norm does).

    Generalised forces ``f`` are added to the gradient, and to the stiffness ``df/dphi + 1/2 [m x]`` with the moment
    ``m`` of ``f`` on a rotation: the derivative in the same symmetric form, from which half the commutator of two
    rotations is left out; these halves cancel in balance.

    Source: Barraco and Munteanu, Part 1, section 4 (virtual work); Argyris 1982 (moments that are not conservative).
    """
    return kind.rotation_gradient()


def _rotation_gradient(kind: Term) -> ca.Function:
    arguments, energy, rows, forces = _expressions(kind)
    q, u = arguments[0], arguments[1]
    x = ca.vertcat(ca.vec(q), ca.vec(u))
    hessian, gradient = ca.hessian(energy + ca.dot(arguments[4], rows), x)
    blocks, radial = [ca.SX.eye(q.numel())], ca.SX.zeros(u.numel(), 1)
    if kind.space:
        sides = [ca.vertsplit(q[:, i]) for i in range(q.shape[1])]
        columns = [[ca.vertcat(*product([0.0, *a], side)) for a in np.eye(3).tolist()] for side in sides]
        blocks = [0.5 * ca.horzcat(*c) for c in columns]
        parts = [ca.dot(q[:, i], gradient[4 * i : 4 * i + 4]) for i in range(q.shape[1])]
        radial = ca.vertcat(*[part for part in parts for _ in range(3)], radial)
    else:
        radial = ca.SX.zeros(x.numel(), 1)
    basis = ca.diagcat(*blocks, ca.SX.eye(u.numel()))
    stiffness = ca.mtimes(basis.T, ca.mtimes(hessian, basis)) - 0.25 * ca.diag(radial)
    gradient = ca.mtimes(basis.T, gradient)
    if forces.numel():
        gradient += forces
        stiffness += ca.mtimes(ca.jacobian(forces, x), basis) + _halves(forces, q.shape[1], kind.space)
    results = [
        energy + _work(kind),
        _stored(kind),
        ca.densify(rows),
        ca.densify(gradient),
        ca.densify(stiffness),
        ca.densify(ca.mtimes(ca.jacobian(rows, x), basis)),
    ]
    names = ["energy", "stored", "rows", "gradient", "stiffness", "rotation_jacobian"]
    return _shared(f"rotation_gradient_{name_of(kind)}", arguments, results, [*ARGUMENTS], names, kind)


def _halves(forces: ca.SX, rotations: int, space: bool) -> ca.SX:
    """Half the matrices of ``m x`` of the moments on the rotations."""
    found = ca.SX(forces.numel(), forces.numel())
    for i in range(rotations if space else 0):
        part = slice(3 * i, 3 * i + 3)
        found[part, part] = 0.5 * ca.skew(forces[part])
    return found


@functools.cache
def rotation_forces(kind: Term) -> ca.Function:
    """``(q, u, data, load, lam) ->`` rows and gradient of :func:`rotation_gradient` alone, as a short expression
    graph."""
    return kind.rotation_forces()


@functools.cache
def slopes_of(kind: Term) -> ca.Function:
    """``(q, u, data, load) ->`` gradient of the energy and Jacobian of the rows of a kind that has a potential.

    By the components of all rotations, then of all displacements.
    """
    return kind.slopes()


def _slopes(kind: Term) -> ca.Function:
    arguments, energy, rows, _ = _expressions(kind)
    x = ca.vertcat(ca.vec(arguments[0]), ca.vec(arguments[1]))
    results = [ca.densify(ca.gradient(energy, x)), ca.densify(ca.jacobian(rows, x))]
    return _shared(f"slopes_{name_of(kind)}", arguments[:4], results, [*ARGUMENTS[:4]], ["gradient", "jacobian"], kind)


@functools.cache
def curvatures_of(kind: Term) -> ca.Function:
    """``(q, u, data, load, lam, weight) ->`` Hessian of ``weight energy + lam.rows`` by the components of all sides."""
    return kind.curvatures()


def _curvatures(kind: Term) -> ca.Function:
    arguments, energy, rows, _ = _expressions(kind)
    x, weight = ca.vertcat(ca.vec(arguments[0]), ca.vec(arguments[1])), ca.SX.sym("weight")
    hessian = ca.densify(ca.hessian(weight * energy + ca.dot(arguments[4], rows), x)[0])
    given = [*ARGUMENTS, "weight"]
    return _shared(f"curvatures_{name_of(kind)}", [*arguments, weight], [hessian], given, ["hessian"], kind)


@functools.cache
def energies_of(kind: Term) -> ca.Function:
    """``(q, u, data, load) ->`` energy of a kind, and its part without loads."""
    arguments, energy = _symbols(kind)[0], _energy(kind)
    results, names = [energy + _work(kind), _stored(kind)], ["energy", "stored"]
    return _shared(f"energies_{name_of(kind)}", arguments[:4], results, [*ARGUMENTS[:4]], names, kind)


@functools.cache
def rows_of(kind: Term) -> ca.Function:
    """``(q, u, data, load) ->`` constraint rows of a kind."""
    arguments, _, rows, _ = _expressions(kind)
    return ca.Function(f"rows_{name_of(kind)}", arguments[:4], [ca.densify(rows)], [*ARGUMENTS[:4]], ["rows"])


@functools.cache
def answers_of(kind: Term) -> ca.Function:
    """``(q, u, data, load, lam) ->`` quantities of a term for the answer, in the order of its ``answers``."""
    arguments, sides = _symbols(kind)
    found = kind.answer(*sides, *arguments[2:])
    name = f"answers_{name_of(kind)}"
    return ca.Function(name, arguments, [ca.densify(ca.vertcat(ca.SX(0, 1), *found))], [*ARGUMENTS], ["answers"])


@functools.cache
def pulls_of(kind: Term) -> ca.Function:
    """``(q, u, data, load, lam) ->`` force (axes,) along a string between two nodes of elements, fixed axes."""
    arguments, sides = _symbols(kind)
    found = ca.densify(ca.vertcat(ca.SX(0, 1), *kind.pull(*sides, *arguments[2:])))
    return _shared(f"pulls_{name_of(kind)}", arguments, [found], [*ARGUMENTS], ["pull"], kind)


@functools.cache
def densities_of(kind: Term) -> ca.Function:
    """``(q, u, data, load) ->`` forces (axes * points,) and couples (turns * points,) along an element, fixed axes."""
    arguments, sides = _symbols(kind)
    found = kind.densities(*sides, *arguments[2:4])
    results = [ca.densify(ca.vertcat(ca.SX(0, 1), *part)) for part in found or ([], [])]
    name = f"densities_{name_of(kind)}"
    return _shared(name, arguments[:4], results, [*ARGUMENTS[:4]], ["forces", "couples"], kind)
