"""Tendons and chambers: the way of each through a structure, and what pulls it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal, final

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.quaternion import matrix
from .formulas import Formula
from .records import Fraction, NotNegative, Number, Positive, Record, Vector, listed, number, say, unknown, whole
from .sections import Polynomial, Quantity, Table, breaks, evaluate, quantity
from .shapes import CenterLine
from .structure import Member, Node

__all__ = [
    "Coil",
    "Hole",
    "Piece",
    "Stretch",
    "Tendon",
    "Way",
    "breaks_along",
    "check_pieces",
    "check_way",
    "kinks_along",
    "length_of_piece",
    "offsets",
    "pieces_of",
    "tangent",
]


def _offset(value: Any) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (number(value),)
    accepted = "a number, [y, z] across a member, or [x, y, z] from a node"
    if isinstance(value, (Mapping, Record)):
        return (quantity(value),)
    entries = listed(value, accepted)
    if not 1 <= len(entries) <= 3:
        raise ValueError(f"found {len(entries)} numbers, accepted: {accepted}")
    return tuple(quantity(entry) for entry in entries)


def _discs(value: Any) -> Any:
    if isinstance(value, int) and not isinstance(value, bool):
        return whole(value, 1, 1000, what="number of discs")
    entries = tuple(number(entry) for entry in listed(value, "a number of discs, or a list of fractions of the length"))
    if not entries or not all(0.0 <= entry <= 1.0 for entry in entries):
        raise ValueError(f"found {say(value)}, accepted: a number of discs, or fractions of the length from 0 to 1")
    return entries


@final
class Coil(Record):
    """A way that winds around a member at a constant distance.

    Parameters
    ----------
    radius : m
        Distance from the centre line.
    turns : 1
        Turns over the part of the member, by the right hand about b1 where they are above zero.
    phase : rad
        Angle from b2 towards b3 at which it begins.
    """

    radius: Positive
    turns: Number
    phase: Number = 0.0


@final
class Way(Record):
    """A part of the way of a tendon: a point of the ground, a hole at a node, or a way along a member.

    Parameters
    ----------
    ground : (3,), m, fixed axes
        A fixed point.
    node : name
        A hole that is fixed to a node.
    member : name
        A way along a flexible or rigid member, or holes in it.
    offset : (3,) from a node, fixed axes of the undeformed scene; or [y, z] across a member, along b2 and b3; m
        From the node, with which it turns, or from the centre line of the member.  Along a member one number is an
        offset along b2, and each may vary, as a table or a polynomial.  Default: zero.
    helix : table
        Instead of an offset along a member: the table ``radius``, ``turns``, ``phase``.
    from_ : 1
        Along a member: fraction of its length where the way begins.  In Python ``from_``, in files ``from``.
        Default: ``0``.
    to : 1
        Along a member: fraction of its length where it ends; before the beginning where it runs against the member.
        Default: ``1``.
    discs : whole number, or (n,), 1
        Straight between holes in a member instead of along it: a number of equal distances, with a hole at the
        beginning and after each, or the fractions of the length at which the holes are.
    """

    ground: Vector | None = None
    node: str | None = None
    member: str | None = None
    offset: Annotated[tuple[Quantity, ...], BeforeValidator(_offset)] | None = None
    helix: Coil | None = None
    from_: Fraction | None = Field(default=None, alias="from")
    to: Fraction | None = None
    discs: Annotated[int | tuple[Fraction, ...], BeforeValidator(_discs)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Way:
        given = [key for key in ("ground", "node", "member") if getattr(self, key) is not None]
        if len(given) != 1:
            found = f"found {' and '.join(given)}, " if given else ""
            raise SceneError(f"{found}accepted: one of 'ground', 'node' and 'member'")
        for part in self.offset or ():
            if isinstance(part, Formula):
                accepted = "numbers, {at = [..], value = [..]} or {polynomial = [..]}"
                raise SceneError(f"found the formula {part.formula!r}, accepted: {accepted}", ("offset",))
        along = ("helix", "from_", "to", "discs")
        useless = {"ground": ("offset", *along), "node": along, "member": ()}
        for key in useless[given[0]]:
            if getattr(self, key) is not None:
                raise SceneError(f"not accepted with a {given[0]}", (key.rstrip("_"),))
        begin, end = self.ends
        if abs(end - begin) <= tolerances.DECIMAL:
            raise SceneError(f"found {begin:g} to {end:g}, accepted: two different fractions", ("to",))
        if self.member is not None and self.offset is not None and len(self.offset) > 2:
            raise SceneError("found three numbers, accepted across a member: a number, or [y, z]", ("offset",))
        varying = any(not isinstance(part, float) for part in self.offset or ())
        if self.node is not None and self.offset is not None and (varying or len(self.offset) == 1):
            raise SceneError("accepted from a node: [x, y] or [x, y, z], numbers", ("offset",))
        if self.helix is not None and self.offset is not None:
            raise SceneError("found the keys 'offset' and 'helix', accepted: one of them")
        if isinstance(self.discs, tuple) and (self.from_, self.to) != (None, None):
            key = "from" if self.to is None else "to"
            raise SceneError("found with fractions of 'discs', accepted: with a number of discs", (key,))
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Fractions of the length of a member from which and to which it goes."""
        return 0.0 if self.from_ is None else self.from_, 1.0 if self.to is None else self.to

    @property
    def holes(self) -> tuple[float, ...]:
        """Fractions (n,) of the length of a member at which its holes are; none where it goes along the member."""
        if self.discs is None or isinstance(self.discs, tuple):
            return self.discs or ()
        return tuple(np.linspace(*self.ends, self.discs + 1).tolist())


def _parts(value: Any) -> tuple[Any, ...]:
    return listed(value, 'a list of parts, as {node = "A"} or {member = "beam", offset = 0.01}')


class Tendon(Record):
    """A tendon that pulls along its way, or a chamber that pushes along it.

    Parameters
    ----------
    way : list of tables
        The parts in their order: ``{ground = [x, y]}``, ``{node = "A", offset = [x, y]}``, ``{member = "m", offset =
        [y, z]}``.  From the end of one to the begin of the next it is straight.
    tension : N
        Its tension, zero or above.
    pressure : Pa
        Of a chamber instead of a tension: it pushes by pressure times area.
    area : m²
        Of the cross-section of a chamber.
    pull : m
        Shortening of its free length.
    length : m
        Its free length at the factor 1 instead of its shortening: without a ``history`` it goes there with the factor
        from that of its way in the undeformed scene, which it is by default.  Default: that of its way.
    stiffness : N/m
        Of a tendon of given length.  Default: it does not stretch.
    pushes : boolean
        Whether a tendon of given length also pushes, as a rod does; else it is slack instead.
    history : name
        Name of a history that replaces the load factor of the step, by which tension, pressure or shortening grow.
    friction : 1
        Coefficient of friction of a tendon in its guides, zero or above: along its way the tension changes by the
        exponential of this times the angle by which the way has turned.  Default: none.
    pulled_at : text
        With friction: ``start`` or ``end`` of its way, at which it is pulled.  Default: ``start``.
    """

    way: Annotated[tuple[Way, ...], BeforeValidator(_parts)]
    tension: NotNegative | None = None
    pressure: NotNegative | None = None
    area: Positive | None = None
    pull: Number | None = None
    length: Positive | None = None
    stiffness: Positive | None = None
    pushes: bool = False
    history: str | None = None
    friction: NotNegative | None = None
    pulled_at: Literal["start", "end"] | None = None

    @model_validator(mode="after")
    def _check(self) -> Tendon:
        ways = {"tension": self.tension, "pressure": self.pressure, "pull": self.pull, "length": self.length}
        given = [key for key, value in ways.items() if value is not None]
        if len(given) > 1 or (not given and self.stiffness is None):
            found = f"found {' and '.join(map(repr, given))}, " if given else ""
            message = (
                f"{found}accepted: one of 'tension', 'pressure' with 'area', 'pull' and 'length', or a 'stiffness'"
            )
            raise SceneError(message)
        if (self.pressure is None) != (self.area is None):
            raise SceneError("accepted: 'pressure' and 'area' together")
        if not self.measured:
            for key in ("stiffness", "pushes"):
                if getattr(self, key):
                    raise SceneError(f"found with a {given[0]}, accepted: with a pull or a length", (key,))
        if self.friction is not None and (not given or self.pressure is not None):
            found = "found with a pressure" if given else "found without a pull"
            raise SceneError(f"{found}, accepted: with a tension, a pull or a length", ("friction",))
        if self.pulled_at is not None and self.friction is None:
            raise SceneError("found without a friction, accepted: with one, of zero too", ("pulled_at",))
        return self

    @property
    def rubs(self) -> bool:
        """Whether there is friction in its guides."""
        return self.friction is not None and bool(values_of(self.friction) > 0.0)

    @property
    def measured(self) -> bool:
        """Whether its length is given, not its force."""
        return self.tension is None and self.pressure is None

    @property
    def may_be_slack(self) -> bool:
        """Whether it has to be found whether it is slack: its length is given, and it neither stretches nor pushes."""
        return self.measured and self.stiffness is None and not self.pushes

    @property
    def elastic_string(self) -> bool:
        """Whether it is elastic and does not push, so that its stiffness ends where it becomes slack."""
        return self.stiffness is not None and not self.pushes

    @property
    def force(self) -> Any:
        """Tension at factor 1, N, below zero where a chamber pushes; of one whose force is given."""
        return self.tension if self.pressure is None else -1.0 * self.pressure * numbers(self.area)


# -- where it goes ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Hole:
    """A point of the way, fixed to the ground, to a node, or to a section of a member.

    Attributes
    ----------
    node, member : str or None
        Both None: the ground.
    at : float
        Fraction of the length of the member.
    position : ndarray (3,)
        Where it is in the undeformed scene, m.
    arm : ndarray (3,)
        From the node, or the centre line, to it, m, fixed axes of the undeformed scene.
    """

    node: str | None
    member: str | None
    at: float
    position: Array
    arm: Array


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of the way along a member: between two holes, of which the first is that with the smaller fraction."""

    way: Way
    member: str
    start: float
    end: float

    @property
    def forwards(self) -> bool:
        """Whether the tendon goes in the direction of the member."""
        return self.way.ends[0] < self.way.ends[1]


Piece = tuple[Hole, Hole] | Stretch
"""A straight piece, or a stretch along a member."""


def offsets(way: Way, x: Array, middle: Array) -> tuple[Array, Array]:
    """Offsets (n, 2) along b2 and b3, m, at fractions x (n,) of a member, and their derivatives by the fraction.

    ``middle`` (n,) are places within the elements that these are in, which decide on which side of a kink they are.
    """
    if way.helix is not None:
        start, end = min(way.ends), max(way.ends)
        winding = 2.0 * math.pi * way.helix.turns / (end - start)
        angle = numbers(way.helix.phase + winding * (x - start))
        cosine, sine = way.helix.radius * np.cos(angle), way.helix.radius * np.sin(angle)
        return np.stack([cosine, sine], axis=-1), winding * np.stack([-1.0 * sine, cosine], axis=-1)
    given = (*(way.offset or ()), 0.0, 0.0)[:2]
    return (
        np.stack([evaluate(part, x) for part in given], axis=-1),
        np.stack([_slope(part, x, middle) for part in given], axis=-1),
    )


def _slope(part: Quantity, x: Array, middle: Array) -> Array:
    """Derivative (n,) of a quantity by the fraction of the length."""
    if isinstance(part, Table):
        at, value = np.asarray(part.at, dtype=float), numbers(part.value)
        i = np.clip(np.searchsorted(at, middle) - 1, 0, len(at) - 2)
        return numbers((value[i + 1] - value[i]) / (at[i + 1] - at[i]))
    if isinstance(part, Polynomial):
        return evaluate(
            Polynomial.model_construct(polynomial=tuple(k * c for k, c in enumerate(part.polynomial))[1:] or (0.0,)), x
        )
    return np.zeros(len(x))


def _holes_in(way: Way, line: CenterLine) -> list[Hole]:
    """The holes of a way in a member, or its ends along it."""
    x = np.array(way.ends if way.discs is None else way.holes)
    frames, across = matrix(line.quaternions(x)), offsets(way, x, x)[0]
    arms = numbers(frames[:, :, 1] * across[:, :1] + frames[:, :, 2] * across[:, 1:])
    places = numbers(line.positions(x) + arms)
    return [Hole(None, way.member, at, places[i], arms[i]) for i, at in enumerate(x.tolist())]


def _hole(way: Way, nodes: Mapping[str, Node]) -> Hole:
    if way.ground is not None:
        return Hole(None, None, 0.0, numbers(way.ground), np.zeros(3))
    arm = numbers([*(way.offset or ()), 0.0, 0.0, 0.0][:3])
    return Hole(way.node, None, 0.0, numbers(nodes[str(way.node)].position) + arm, arm)


def pieces_of(
    tendon: Tendon, nodes: Mapping[str, Node], members: Mapping[str, Member], lines: Mapping[str, CenterLine]
) -> tuple[Piece, ...]:
    """The straight pieces of a way, and its stretches along members, in their order."""
    found: list[Piece] = []
    last: Hole | None = None
    for way in tendon.way:
        holes = [_hole(way, nodes)] if way.member is None else _holes_in(way, lines[way.member])
        if last is not None and not _same(last, holes[0], members, nodes):
            found.append((last, holes[0]))
        if way.member is not None and way.discs is None:
            found.append(Stretch(way, way.member, min(way.ends), max(way.ends)))
        else:
            found += pairwise(holes)
        last = holes[-1]
    return tuple(found)


def _body(hole: Hole, members: Mapping[str, Member], nodes: Mapping[str, Node]) -> tuple[Any, ...]:
    """What a hole is fixed to."""
    if hole.member is not None and hole.at in (0.0, 1.0):
        member = members[hole.member]
        i = 0 if hole.at == 0.0 else -1
        node = member.nodes[i]
        if nodes[node].joint == "rigid" and member.release[i] == "rigid":
            return (node,)
    return (hole.node,) if hole.node is not None else (hole.member, hole.at)


def _same(a: Hole, b: Hole, members: Mapping[str, Member], nodes: Mapping[str, Node]) -> bool:
    """Whether one hole is the other one."""
    if _body(a, members, nodes) != _body(b, members, nodes):
        return False
    return bool(_apart(a, b) <= NEAR * max(1e-300, *(float(np.linalg.norm(values_of(h.arm))) for h in (a, b))))


def _apart(a: Hole, b: Hole) -> float:
    return float(np.linalg.norm(values_of(b.position) - values_of(a.position)))


NEAR = 1e-9
"""Holes of one body nearer than this share of their distance from the centre line are one."""


def breaks_along(way: Way) -> Iterator[float]:
    """Fractions of the length of a member at which the offset of a way along it has a kink."""
    for part in way.offset or ():
        yield from breaks(part)


def kinks_along(tendon: Tendon, member: str) -> Iterator[float]:
    """Fractions of the length of a member at which elements have to end for a tendon."""
    for way in tendon.way:
        if way.member != member:
            continue
        yield from way.ends if way.discs is None else way.holes
        if way.discs is None:
            yield from breaks_along(way)


def check_way(tendon: Tendon, nodes: Mapping[str, Node], members: Mapping[str, Member]) -> None:
    """Refuse a way through what is not there.

    Raises
    ------
    SceneError
        Its place begins with ``way``.
    """
    for i, way in enumerate(tendon.way):
        where = ("way", str(i))
        if way.node is not None and way.node not in nodes:
            raise SceneError(unknown(way.node, nodes, "nodes"), (*where, "node"))
        if way.member is not None and way.member not in members:
            raise SceneError(unknown(way.member, members, "members"), (*where, "member"))
        if way.member is not None and members[way.member].type == "small":
            message = f"found the small member {way.member!r}, accepted: a flexible or rigid member, or its nodes"
            raise SceneError(message, (*where, "member"))
        if way.node is not None and nodes[way.node].joint != "rigid" and any(way.offset or ()):
            joint = nodes[way.node].joint
            message = f"node {way.node!r} has no rotation of its own for an offset, as its joint is a {joint}"
            raise SceneError(
                f"{message}; accepted: the end of a member, as {{member, discs = [1]}}", (*where, "offset")
            )


def check_pieces(pieces: Sequence[Piece], lines: Mapping[str, CenterLine]) -> None:
    """Refuse a way without length, and one that runs backwards.

    Raises
    ------
    SceneError
        Its place begins with ``way``.
    """
    if not pieces:
        raise SceneError(
            "found a way without length, accepted: two places that are apart, or a part of a member", ("way",)
        )
    size = max(line.length for line in lines.values())
    for piece in pieces:
        if isinstance(piece, tuple) and _apart(*piece) <= NEAR * size:
            message = f"found a piece without length at {say(tuple(values_of(piece[0].position).tolist()))}"
            raise SceneError(f"{message}, accepted: places apart from each other, or both of one body", ("way",))
        if not isinstance(piece, tuple):
            _check_stretch(piece, lines[piece.member])


def _check_stretch(piece: Stretch, line: CenterLine) -> None:
    """Refuse a stretch so far from the axis of a curved member that it would run backwards."""
    x = np.linspace(piece.start, piece.end, 33)
    across, along = (values_of(part) for part in offsets(piece.way, x, x))
    kappa = line.curvatures(x)
    forward = 1.0 + kappa[:, 1] * across[:, 1] - kappa[:, 2] * across[:, 0]
    if (forward <= tolerances.WRITTEN).any() and not np.abs(along).any():
        message = f"found an offset beyond the centre of curvature of the member {piece.member!r}"
        raise SceneError(f"{message}, accepted: a smaller one", ("way",))


def tangent(way: Way, line: CenterLine, x: Array, middle: Array) -> tuple[Array, Array]:
    """Derivative (n, 3) of the places of a stretch by the arc length of its member, and arms (n, 3), m; fixed axes."""
    frames = matrix(line.quaternions(x))
    across, along = offsets(way, x, middle)
    nothing = np.zeros(len(x))
    arm = np.stack([nothing, across[:, 0], across[:, 1]], axis=-1)
    slope = np.stack([nothing, along[:, 0], along[:, 1]], axis=-1) / line.length
    forward = np.array([1.0, 0.0, 0.0]) + np.cross(line.curvatures(x), arm) + slope
    return numbers(np.einsum("nij,nj->ni", frames, forward)), numbers(np.einsum("nij,nj->ni", frames, arm))


def length_of_piece(piece: Stretch, line: CenterLine) -> Any:
    """Length of a stretch in the undeformed scene, m."""
    cuts = np.linspace(piece.start, piece.end, PARTS + 1)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    spans, middle = np.diff(cuts), 0.5 * (cuts[1:] + cuts[:-1])
    x = (middle[:, None] + 0.5 * spans[:, None] * nodes).ravel()
    forward, _ = tangent(piece.way, line, x, np.repeat(middle, len(nodes)))
    return (np.linalg.norm(forward, axis=1) * (0.5 * spans[:, None] * weights).ravel()).sum() * line.length


PARTS = 16
"""Parts of a stretch over which its length is integrated."""
