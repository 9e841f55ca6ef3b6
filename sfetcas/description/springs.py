"""Springs, dampers and stops between members, between nodes, or between them and the ground."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator

from ..errors import SceneError
from .records import Direction, Number, Record, Vector, listed, number, say

__all__ = ["Spring"]


_UNITS = {"stiffness": ("N m", "N/m"), "length": ("m", "m"), "damping": ("N m s/rad", "N s/m")}
"""Of what is not below zero, by the key: of a rotational spring, and of a translational one."""


def _parties(value: Any) -> tuple[Any, ...]:
    accepted = "a list of two: 'ground', a member that ends at the node, or the node itself"
    entries = listed(value, accepted)
    if len(entries) != 2:
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return entries


def _stop(value: Any) -> tuple[float, float]:
    accepted = "[low, high] with zero, the undeformed scene, between them or at one end, not at both"
    entries = tuple(number(entry) for entry in listed(value, accepted))
    if len(entries) != 2 or not entries[0] <= 0.0 <= entries[1] or entries[0] == entries[1]:
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return entries[0], entries[1]


class Spring(Record):
    """A rotational spring at a node, or a translational one between two nodes or a node and the ground.

    Parameters
    ----------
    type : text
        ``rotational`` at a node, or ``translational`` between two nodes or a node and the ground.
    node : name
        Name of the node.
    stiffness : N m, or N/m of a translational spring
        Moment by angle, or force by travel.
    axis : (3,), fixed axes of the undeformed scene
        Axis of a rotational spring.  It turns with the first party of ``between``; at a universal joint with
        the side that has this axis.  Default: that of the node's hinge, else along z.
    between : list of two texts
        Of a rotational spring, two parties: ``"ground"``, the name of the node, or names of members that end
        there.  The angle is that of the second against the first since the undeformed scene.  Default: the
        ground and the node.
    rest : rad, or m with a ``direction``
        Angle without moment; with a ``direction`` the travel without force.
    to : name
        Other node of a translational spring.  Default: the ground.
    anchor : (3,), m, fixed axes
        Where a translational spring is fixed to the ground.  Default: the undeformed place of the node.
    length : m
        Free length of a translational spring.  Default: the undeformed distance.
    direction : (3,), fixed axes
        A translational spring with a direction acts along it only.
    damping : N m s/rad, or N s/m of a translational spring
        Moment or force against the rate of the angle, travel or length, per unit of that rate.
    stop : (2,), rad, or m with a ``direction``
        ``[low, high]`` about 0: the angle, or the travel along a ``direction``, goes no further.  In statics,
        on paths, in motions and in parametric solvers; what moves does not rebound from it.
    """

    type: Literal["rotational", "translational"] = "rotational"
    node: str
    stiffness: Number
    axis: Direction | None = None
    between: Annotated[tuple[str, str], BeforeValidator(_parties)] | None = None
    rest: Number = 0.0
    to: str | None = None
    anchor: Vector | None = None
    length: Number | None = None
    direction: Direction | None = None
    damping: Number = 0.0
    stop: Annotated[tuple[float, float], BeforeValidator(_stop)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Spring:
        turning = self.type == "rotational"
        for key, units in _UNITS.items():
            value = getattr(self, key)
            if value is not None and value < 0.0:
                accepted = f"zero or a number above zero, {units[not turning]}"
                raise SceneError(f"found {value:g}, accepted: {accepted}", (key,))
        useless = ("to", "anchor", "length", "direction") if turning else ("between", "axis")
        for key in useless:
            if key in self.model_fields_set and getattr(self, key) is not None:
                raise SceneError(f"not accepted: the spring is {self.type}", (key,))
        if self.to is not None and self.to == self.node:
            raise SceneError(f"found {self.to!r}, which is the node itself, accepted: another node", ("to",))
        if self.to is not None and self.anchor is not None:
            raise SceneError("found the keys 'to' and 'anchor', accepted: one of them")
        if self.between is not None and self.between[0] == self.between[1]:
            raise SceneError(f"found {self.between[0]!r} twice, accepted: two parties", ("between",))
        if not turning and self.direction is None and "rest" in self.model_fields_set:
            raise SceneError("accepted with a direction only; the free length is the key 'length'", ("rest",))
        if self.stop is not None and not turning and self.direction is None:
            raise SceneError("accepted with a rotational spring, or with a direction", ("stop",))
        if self.direction is not None and self.length is not None:
            raise SceneError("accepted without a direction only; with one it is the key 'rest'", ("length",))
        return self
