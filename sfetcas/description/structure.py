"""The nodes of a structure, with their supports and joints, and the members between them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, PrivateAttr, model_validator

from ..errors import SceneError
from .formulas import Formula
from .matrices import Mass, Stiffness, check_mass, check_stiffness
from .records import Direction, NotNegative, Number, Record, Vector, counted, listed, number, say, turn, whole
from .relaxation import Relaxation
from .sections import OFF_LINE, CrossSection, Polynomial, Quantity, Table, quantity
from .shapes import Shape, Straight

__all__ = ["SLIDING", "Member", "Node", "released", "unit"]


def unit(direction: Iterable[float]) -> tuple[float, float, float]:
    """The unit vector of a direction, also where squares of its components overflow or underflow."""
    x, y, z = direction
    largest = max(abs(x), abs(y), abs(z))
    x, y, z = x / largest, y / largest, z / largest
    length = (x * x + y * y + z * z) ** 0.5
    return (x / length, y / length, z / length)


def _count(value: Any) -> int:
    return whole(value, 1, 1_000_000)


def _ends(value: Any) -> tuple[Any, ...]:
    accepted = "a list of two, or more for a small member, one for each end"
    entries = listed(value, accepted)
    if len(entries) < 2:
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return entries


def _spin(value: Any) -> Any:
    if isinstance(value, (str, Mapping, Table, Polynomial, Formula)):
        return quantity(value)
    return turn(value)


def _turned(value: Any) -> Any:
    if isinstance(value, (list, tuple)) or hasattr(value, "shape"):
        entries = listed(value, "a number, or a vector of three")
        if len(entries) not in (2, 3):
            raise ValueError(f"found {len(entries)} entries, accepted: three, a rotation vector")
        return (*(quantity(entry) for entry in entries), *[0.0] * (3 - len(entries)))
    return quantity(value)


def _inertia(value: Any) -> tuple[float, ...]:
    accepted = "three numbers of zero or above, about x, y and z"
    entries = tuple(number(entry) for entry in listed(value, accepted))
    if len(entries) != 3 or min(entries) < 0.0:
        raise ValueError(f"found {say(entries)}, accepted: {accepted}")
    return entries


def _weld(value: Any) -> Any:
    return "rigid" if value == "weld" else value


def _superelement(value: Any) -> Any:
    return "small" if value == "superelement" else value


def _welds(value: Any) -> tuple[Any, ...]:
    return tuple(_weld(entry) for entry in _ends(value))


Turning = Annotated[Literal["rigid", "hinge", "ball", "universal"], BeforeValidator(_weld)]
Release = Literal["rigid", "hinge", "ball", "universal", "slider", "cylindrical", "slot"]

SLIDING = ("slider", "cylindrical", "slot")
"""Releases whose end slides along its node."""
Count = Annotated[int, BeforeValidator(_count)]
Spin = Annotated[Quantity | tuple[float, float, float], BeforeValidator(_spin)]


Turned = Annotated[Quantity | tuple[Quantity, Quantity, Quantity], BeforeValidator(_turned)]


class Node(Record):
    """A point where members end, with the joint between them and the support.

    Parameters
    ----------
    position : (3,), m, fixed axes
        Place in the undeformed scene.
    support : text
        How the ground holds the node: ``free``, ``clamped``, ``hinge`` (turns about ``axis``), ``ball``,
        ``slider`` (moves along ``direction``), ``cylindrical`` (moves along and turns about ``direction``) or
        ``universal`` (turns about ``axis``, fixed in the ground, and ``axis2``, fixed in the node).
    axis : (3,), fixed axes
        Axis of the hinges and universal joints of this node: of its support, its joint and the member ends
        released here.  The axis of a universal joint is fixed in its first side: the ground, the first member
        that ends here, or the node.
    axis2 : (3,), fixed axes
        Second axis of a universal joint, across the first.  It is fixed in the other side: the node, every
        other member, or the released end.
    direction : (3,), fixed axes
        Guide of a slider or cylindrical support, fixed in the ground; or the line along which released member
        ends slide, which turns with the node.
    rotation : text
        How a slider turns: ``fixed``, ``hinge`` (about ``axis``) or ``ball``.
    joint : text
        How the member ends are joined to each other: ``rigid`` (or ``weld``), ``hinge``, ``ball`` or
        ``universal``.  Unless it is rigid each end turns against every other one, and the node has no rotation
        of its own.
    mass : kg
        Lumped mass.  It has weight where there is gravity.
    inertia : (3,), kg m²
        Moments of inertia of the lumped mass about x, y and z.  For modes and motions, with a rigid joint only.
    start : (3,), m, fixed axes
        Roughly where the node ends up: chooses among several equilibria.
    velocity : (3,), m/s, fixed axes
        Dynamics: velocity at t = 0.  Default: what follows from the others, else zero.
    drag : N s/m
        Force against the velocity of the node, per unit of the velocity.
    """

    position: Vector
    support: Literal["free", "clamped", "hinge", "ball", "slider", "cylindrical", "universal"] = "free"
    axis: Direction = (0.0, 0.0, 1.0)
    axis2: Direction | None = None
    direction: Direction | None = None
    rotation: Literal["fixed", "hinge", "ball"] = "fixed"
    joint: Turning = "rigid"
    mass: NotNegative = 0.0
    inertia: Annotated[tuple[float, float, float], BeforeValidator(_inertia)] | None = None
    start: Vector | None = None
    velocity: Vector | None = None
    drag: NotNegative = 0.0

    @model_validator(mode="after")
    def _check(self) -> Node:
        if self.slides and self.direction is None:
            raise SceneError("the key 'direction' is missing: a slider needs the direction of its guide")
        if self.support != "slider" and self.rotation != "fixed":
            raise SceneError(
                f"found {self.rotation!r}, accepted: only for a slider, and the support is {self.support!r}",
                ("rotation",),
            )
        if self.inertia is not None and self.joint != "rigid":
            message = f"the node has no rotation of its own, as its joint is a {self.joint}"
            raise SceneError(message, ("inertia",))
        return self

    @property
    def slides(self) -> bool:
        """Whether its support is a guide along one direction."""
        return self.support in ("slider", "cylindrical")

    @property
    def has_hinge(self) -> bool:
        """Whether its support or its joint is a hinge."""
        return "hinge" in (self.support, self.rotation, self.joint) or self.is_universal

    @property
    def is_universal(self) -> bool:
        """Whether its support or its joint is a universal joint, with two axes."""
        return "universal" in (self.support, self.joint)

    @property
    def turn(self) -> Literal["free", "fixed", "hinge", "ball", "universal"]:
        """How its support lets the node rotate."""
        if self.support == "slider":
            return self.rotation
        if self.support == "cylindrical":
            return "hinge"
        return "fixed" if self.support == "clamped" else self.support

    @property
    def turn_axis(self) -> tuple[float, float, float]:
        """Axis about which its support lets it rotate; the direction for a cylindrical support."""
        return self.direction if self.support == "cylindrical" and self.direction is not None else self.axis

    @property
    def joint_axis(self) -> tuple[float, float, float]:
        """Axis of its support or its joint; the direction for a cylindrical support."""
        cylindrical = self.direction is not None and "cylindrical" in (self.support, self.joint)
        return self.direction if cylindrical and self.direction is not None else self.axis


class Member(Record):
    """A member between nodes: a flexible inextensible beam, a rigid body, or a superelement with small deformation.

    Parameters
    ----------
    nodes : list of names
        Names of the nodes at its first and second end.  A small member with a ``stiffness`` may have more than
        two.
    section : name
        Name of its cross-section.  A rigid member needs one for its mass only.
    type : text
        ``flexible``, ``rigid``, or ``small`` (or ``superelement``): linear elasticity in a frame that moves
        with the member.  A small one with a section that may touch something is taken for flexible.
    shape : table
        The unloaded centre line: a table with the key ``type`` (``straight``, ``arc``, ``helix``, ``curvature``
        or ``spline``) and the keys of that shape.
    b2 : (3,), fixed axes
        Direction of the section's axis b2 at the first end.  Default: such that b3 is along z, where the member
        lies in x-y.
    element : text
        ``SFET2``, ``SFET3``, ``SFET4``, ``SFET5``, ``SFET6``, ``SFET7``, ``SFET8`` or ``SFET9``: the number of
        nodes of an element.  Default: chosen by the accuracy.
    elements : whole number
        Number of elements, 1 to 1000000.  Default: chosen by the accuracy.
    release : list of two texts
        How each end is joined to its node: ``rigid`` (or ``weld``), ``hinge`` (turns about the node's
        ``axis``), ``ball``, ``universal``, ``slider`` (moves along the node's ``direction``), ``cylindrical``
        (moves along and turns about it) or ``slot`` (moves along it and turns freely).
    stiffness : (6 n, 6 n), N/m, N, N m, or a file name
        Of a small member, instead of a section: forces and moments at its n nodes by displacements and
        rotations (x, y, z, then about x, y, z, at the first node, then at the next), along the axes b1, b2, b3
        at its start.  Or the name of a file (``.npz``, ``.npy``, Matrix Market), in a scene file relative to
        its folder.
    mass : (6 n, 6 n), kg, kg m, kg m², or a file name
        Mass matrix of a small member, in the same order, for its weight and for dynamics.
    spin : rad/s
        Dynamics: angular velocity of the sections along the member at t = 0.  In a plane scene a number or
        varying along the member, in space (3,) in the fixed axes.  Default: what follows from the others, else
        zero.
    turned : rad
        Dynamic: rotation of the sections along the member at t = 0 since the undeformed scene.  In a plane scene a
        number or varying along the member, in space a rotation vector (3,) in the fixed axes, each number of which may
        vary.  Default: zero, of a rigid member that of its nodes.
    insertion : m
        Statics: length by which a straight member is pushed out of its clamped first node at factor 1; below zero it
        is drawn in.  It grows there, and what lies beyond it goes with its end.
    insertion_history : name
        Name of a history that replaces the load factor of the step.  It multiplies the ``insertion``.
    """

    nodes: Annotated[tuple[str, ...], BeforeValidator(_ends)]
    section: str | None = None
    type: Annotated[Literal["flexible", "rigid", "small"], BeforeValidator(_superelement)] = "flexible"
    shape: Shape = Straight()
    b2: Direction | None = None
    element: Literal["SFET2", "SFET3", "SFET4", "SFET5", "SFET6", "SFET7", "SFET8", "SFET9"] | None = None
    elements: Count | None = None
    release: Annotated[tuple[Release, ...], BeforeValidator(_welds)] = ("rigid", "rigid")
    stiffness: Stiffness | None = None
    mass: Mass | None = None
    spin: Spin | None = None
    turned: Turned | None = None
    insertion: Number = 0.0
    insertion_history: str | None = None

    _was_small: bool = PrivateAttr(False)

    @property
    def was_small(self) -> bool:
        """Whether it was described as small, and is flexible as it may touch something."""
        return self._was_small

    def taken_for(self, type_: Literal["flexible", "small"]) -> Member:
        """A small member as a flexible one, which :attr:`was_small`, and the other way round."""
        found = self.model_copy(update={"type": type_})
        found._was_small = type_ == "flexible"
        return found

    def replace(self, **changes: Any) -> Member:
        """A copy with other values, validated anew as it was described; None stands for the default."""
        return super().replace(**({"type": "small"} if self.was_small else {}) | changes)

    def to_dict(self) -> dict[str, Any]:
        """Keys and values as files have them: as it was described."""
        return super().to_dict() | ({"type": "small"} if self.was_small else {})

    @property
    def turned_about(self) -> tuple[Quantity, Quantity, Quantity]:
        """The rotation vector at the begin of a motion, rad."""
        given = 0.0 if self.turned is None else self.turned
        return given if isinstance(given, tuple) else (0.0, 0.0, given)

    def overhangs(self, sections: Mapping[str, CrossSection]) -> bool:
        """Whether it is flexible and the centre of mass of its section is off its line."""
        return self.type == "flexible" and sections[str(self.section)].mass_center is not None

    def off_line(self, sections: Mapping[str, CrossSection]) -> str:
        """What a flexible member has off its line, in words; empty where it has nothing."""
        key = sections[str(self.section)].off_line if self.type == "flexible" else ""
        return OFF_LINE.get(key, "")

    def shifted(self, sections: Mapping[str, CrossSection]) -> bool:
        """Whether it is flexible and its section couples forces with moments, as by centres that are off its line."""
        return self.type == "flexible" and sections[str(self.section)].shifted

    def stretches(self, sections: Mapping[str, CrossSection]) -> bool:
        """Whether it is flexible and its section stretches or shears."""
        return self.type == "flexible" and sections[str(self.section)].stretches

    def branches(self, sections: Mapping[str, CrossSection]) -> tuple[Relaxation, ...]:
        """The branches in which it relaxes where it is flexible; none of others."""
        return sections[str(self.section)].relaxation if self.type == "flexible" else ()

    def remembers(self, sections: Mapping[str, CrossSection]) -> bool:
        """Whether it is flexible and the law of its section has memory."""
        law = sections[str(self.section)].law if self.type == "flexible" else None
        return law is not None and law.remembers

    @model_validator(mode="before")
    @classmethod
    def _released(cls, values: Any) -> Any:
        """Ends are rigid unless said otherwise, however many there are."""
        if isinstance(values, Mapping) and "release" not in values and len(values.get("nodes") or ()) > 2:
            return {**values, "release": ("rigid",) * len(values["nodes"])}
        return values

    @model_validator(mode="after")
    def _check(self) -> Member:
        if len(set(self.nodes)) < len(self.nodes):
            double = next(n for n in self.nodes if self.nodes.count(n) > 1)
            at, accepted = (
                ("both ends", "two different nodes") if len(self.nodes) == 2 else ("two ends", "different ones")
            )
            raise SceneError(f"found {double!r} at {at}, accepted: {accepted}", ("nodes",))
        if len(self.nodes) > 2 and self.type != "small":
            message = f"found {len(self.nodes)} nodes, accepted: two; only a small member may have more"
            raise SceneError(message, ("nodes",))
        if self.turned is not None and self.type == "small":
            raise SceneError("found with a small member, accepted: with a flexible or rigid one", ("turned",))
        if len(self.release) != len(self.nodes):
            found = counted(len(self.release), "entry", "entries")
            message = f"found {found}, accepted: one for each of {len(self.nodes)} nodes"
            raise SceneError(message, ("release",))
        self._check_kind()
        return self

    def _check_kind(self) -> None:
        """What each type needs and what it has no use for."""
        if self.type != "small":
            for key in ("stiffness", "mass"):
                if getattr(self, key) is not None:
                    raise SceneError(f"only a small member has a matrix, and the type is {self.type!r}", (key,))
        if self.type != "flexible":
            for key in ("element", "elements"):
                if getattr(self, key) is not None:
                    raise SceneError(f"a {self.type} member is not cut into elements; only a flexible one is", (key,))
        if self.type == "flexible" and self.section is None:
            raise SceneError("the key 'section' is missing: a flexible member needs a cross-section")
        if self.type == "small" and (self.section is None) == (self.stiffness is None):
            raise SceneError("accepted for a small member: either a section or a stiffness, one of them")
        if len(self.nodes) > 2 and self.stiffness is None:
            raise SceneError("the key 'stiffness' is missing: a small member with more than two nodes needs it")
        if self.stiffness is not None:
            check_stiffness(self.stiffness, len(self.nodes))
        if self.mass is not None:
            check_mass(self.mass, len(self.nodes), self.stiffness is not None)


def released(nodes: Mapping[str, Node], members: Mapping[str, Member], how: Iterable[str]) -> set[str]:
    """Names of the nodes at which a member end is released in one of these ways."""
    kinds = set(how)
    return {
        node
        for member in members.values()
        for node, release in zip(member.nodes, member.release, strict=True)
        if release in kinds
    }
