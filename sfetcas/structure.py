"""Nodes and the members between them."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator

from .errors import SceneError
from .later import Staged
from .records import Direction, Vector, listed, say
from .shapes import Shape, Straight

__all__ = ["Member", "Node", "hinged", "unit"]


def unit(direction: Iterable[float]) -> tuple[float, float, float]:
    """The direction with length one, also where its square is no number of the machine."""
    x, y, z = direction
    largest = max(abs(x), abs(y), abs(z))
    x, y, z = x / largest, y / largest, z / largest
    length = (x * x + y * y + z * z) ** 0.5
    return (x / length, y / length, z / length)


def _pair(value: Any) -> tuple[Any, ...]:
    accepted = "a list of two, for the first and the second end"
    entries = listed(value, accepted)
    if len(entries) != 2:
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return entries


def _count(value: Any) -> int:
    try:
        count = operator.index(value)
    except TypeError:
        count = 0
    if isinstance(value, bool) or not 1 <= count <= 1_000_000:
        raise ValueError(f"found {say(value)}, accepted: a whole number from 1 to 1000000")
    return count


Turning = Literal["rigid", "hinge", "ball"]
Count = Annotated[int, BeforeValidator(_count)]


class Node(Staged):
    """A point where members end, are joined and are held.

    Parameters
    ----------
    position : (3,), m, fixed axes - in the undeformed scene
    support : what holds the node: free, clamped, hinge (about axis), ball or slider (along direction)
    axis : (3,), fixed axes - of the hinges of this node: support, joint, or member ends released here
    direction : (3,), fixed axes - the guide of a slider
    rotation : how a slider turns: fixed, hinge (about axis) or ball
    joint : how the member ends are joined: rigid, hinge (about axis) or ball; in the last two cases each
        end turns against every other and the node has no rotation of its own
    start : (3,), m, fixed axes - roughly where the node ends up, as a first guess
    """

    position: Vector
    support: Literal["free", "clamped", "hinge", "ball", "slider"] = "free"
    axis: Direction = (0.0, 0.0, 1.0)
    direction: Direction | None = None
    rotation: Literal["fixed", "hinge", "ball"] = "fixed"
    joint: Turning = "rigid"
    start: Vector | None = None

    @model_validator(mode="after")
    def _check(self) -> Node:
        if self.support == "slider" and self.direction is None:
            raise SceneError("the key 'direction' is missing: a slider needs the direction of its guide")
        if self.support != "slider" and self.direction is not None:
            raise SceneError(f"only a slider has a direction, and the support is {self.support!r}", ("direction",))
        if self.support != "slider" and self.rotation != "fixed":
            raise SceneError(
                f"found {self.rotation!r}, accepted: only for a slider, and the support is {self.support!r}",
                ("rotation",),
            )
        return self

    @property
    def has_hinge(self) -> bool:
        """Whether its support or its joint turns about the axis."""
        return "hinge" in (self.support, self.rotation, self.joint)

    @property
    def turn(self) -> Literal["free", "fixed", "hinge", "ball"]:
        """How the ground lets the node turn."""
        if self.support == "slider":
            return self.rotation
        return "fixed" if self.support == "clamped" else self.support


class Member(Staged):
    """A flexible inextensible beam between two nodes.

    Parameters
    ----------
    nodes : names of the nodes at its first and second end
    section : name of the cross-section
    shape : the unloaded centre line
    b2 : (3,), fixed axes - direction of the section's axis b2 at the first end; left out: b3 along z
        where the member lies in x-y
    element : SFET2 to SFET9, by the nodes of an element; left out: chosen by the accuracy
    elements : number of elements, 1 to 1000000; left out: chosen by the accuracy
    release : how each end is joined to its node: rigid, hinge (about the node's axis) or ball
    """

    nodes: Annotated[tuple[str, str], BeforeValidator(_pair)]
    section: str
    type: Literal["flexible"] = "flexible"
    shape: Shape = Straight()
    b2: Direction | None = None
    element: Literal["SFET2", "SFET3", "SFET4", "SFET5", "SFET6", "SFET7", "SFET8", "SFET9"] | None = None
    elements: Count | None = None
    release: Annotated[tuple[Turning, Turning], BeforeValidator(_pair)] = ("rigid", "rigid")

    @model_validator(mode="after")
    def _check(self) -> Member:
        if self.nodes[0] == self.nodes[1]:
            raise SceneError(f"found {self.nodes[0]!r} at both ends, accepted: two different nodes", ("nodes",))
        return self


def hinged(nodes: Mapping[str, Node], members: Mapping[str, Member]) -> set[str]:
    """Names of the nodes whose axis has a use: support, joint or a released member end is a hinge."""
    released = {
        node
        for member in members.values()
        for node, release in zip(member.nodes, member.release, strict=True)
        if release == "hinge"
    }
    return released | {name for name, node in nodes.items() if node.has_hinge}
