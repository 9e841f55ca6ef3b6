"""Contact: of members with obstacles, points, lines, planes, circles, cylinders and spheres, and of
members with each other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import numbers, unit, values_of
from .records import Direction, Positive, Record, Vector, listed, number, say
from .sections import CrossSection
from .structure import Member

__all__ = ["Contact", "contact_radius", "pairs_of"]

_KEYS = {
    "point": ({"position", "side"}, {"member_radius"}),
    "line": ({"point", "direction", "side"}, {"member_radius"}),
    "plane": ({"point", "normal"}, {"side", "member_radius", "node"}),
    "circle": ({"center", "radius"}, {"side", "member_radius", "node"}),
    "cylinder": ({"center", "radius"}, {"side", "axis", "member_radius", "node"}),
    "sphere": ({"center", "radius"}, {"side", "member_radius", "node"}),
    "members": (set(), {"radius"}),
}
"""Of each type the keys that it needs, and those that it may have."""


def _members(value: Any) -> Any:
    return value if value == "all" else listed(value, "a list of members, or 'all'")


def _side(value: Any) -> Any:
    if isinstance(value, str):
        if value not in ("inside", "outside"):
            raise ValueError(f"found {say(value)}, accepted: inside, outside, or a direction [x, y] or [x, y, z]")
        return value
    return value


def _not_below_zero(value: float) -> float:
    if not value >= 0.0:
        raise ValueError(f"found {value:g}, accepted: zero or above")
    return value


def _share(value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"found {value:g}, accepted: a share of the speed before, from 0 to 1")
    return value


class Contact(Record):
    """An obstacle, or members that touch each other; forces push members apart and never hold them.

    Parameters
    ----------
    type : text
        ``point`` (in plane scenes), ``line``, ``plane``, ``circle`` (in space a cylinder along z), ``cylinder``
        or ``sphere``; ``members`` where members of round section touch each other and, where they are flexible,
        themselves.
    position : (3,), m
        Of a point that members slide over.
    point : (3,), m
        Any point of a line or a plane.
    normal : (3,)
        Of a plane: points to where members are allowed, unless ``side`` says otherwise.
    direction : (3,)
        Of a line.
    center : (3,), m
        Of a circle or sphere, or any point of the axis of a cylinder.
    radius : m
        Of a circle, cylinder or sphere; of ``members`` that of their surfaces, by default that of their shape.
    axis : (3,)
        Of a cylinder.
    node : name
        Of a plane, circle, cylinder or sphere: the node that carries it.  Its place and directions are those in the
        undeformed scene; it moves and turns with the node, on which what it pushes acts back.  By default it stays.
    member : name
        Name of the member that the obstacle stops, or that touches itself.
    members : list of names
        Instead of ``member``: several names, or ``"all"``.
    side : (3,), or text
        Where members are allowed: a direction that points there; of what is round ``"inside"`` or
        ``"outside"``.  Default: of what is round the outside.
    member_radius : m
        Radius of the surface of the members that an obstacle stops; by default their centre line touches it.
    friction : 1
        Coulomb's coefficient: the largest force along the surfaces over that across them; in statics, where it counts
        in which order the steps come, on paths, and in motions.
    restitution : 1
        Speed across the surfaces after an impact over that before, from 0 to 1; of motions alone.
    """

    type: Literal["point", "line", "plane", "circle", "cylinder", "sphere", "members"]
    position: Vector | None = None
    point: Vector | None = None
    normal: Direction | None = None
    direction: Direction | None = None
    center: Vector | None = None
    radius: Positive | None = None
    axis: Direction = (0.0, 0.0, 1.0)
    node: str | None = None
    member: str | None = None
    members: Annotated[tuple[str, ...] | Literal["all"], BeforeValidator(_members)] | None = None
    side: Annotated[Direction | Literal["inside", "outside"], BeforeValidator(_side)] | None = None
    member_radius: Annotated[float, BeforeValidator(number), AfterValidator(_not_below_zero)] = 0.0
    friction: Annotated[float, BeforeValidator(number), AfterValidator(_not_below_zero)] = 0.0
    restitution: Annotated[float, BeforeValidator(number), AfterValidator(_share)] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Contact:
        needed, possible = _KEYS[self.type]
        given = {key for key in self.model_fields_set if getattr(self, key) is not None}
        for key in sorted(needed - given):
            raise SceneError(f"the key {key!r} is missing: a {self.type} needs {' and '.join(sorted(needed))}")
        for key in sorted(given - needed - possible - {"type", "member", "members", "restitution", "friction"}):
            what = "members touch each other" if self.between_members else f"the obstacle is a {self.type}"
            kinds = ", ".join(kind for kind, keys in _KEYS.items() if key in set().union(*keys))
            raise SceneError(f"not accepted: {what}" + (f", accepted of: {kinds}" if kinds else ""), (key,))
        if (self.member is None) == (self.members is None):
            raise SceneError("accepted: either member or members, one of them")
        if isinstance(self.members, tuple) and len(set(self.members)) != max(1, len(self.members)):
            found = "a member twice" if self.members else "no member"
            raise SceneError(f"found {found}, accepted: names of members, each once, or 'all'", ("members",))
        if isinstance(self.side, str) != (self.type in ("circle", "cylinder", "sphere")) and self.side is not None:
            accepted = "a direction [x, y] or [x, y, z]" if isinstance(self.side, str) else "inside or outside"
            raise SceneError(f"found {say(self.side)}, accepted for a {self.type}: {accepted}", ("side",))
        if isinstance(self.side, tuple):
            along = self.type == "plane" and self.normal is not None
            if along and abs(unit(self.side) @ unit(self.normal)) < tolerances.PARALLEL:
                raise SceneError(f"found {say(self.side)}, which is along the plane, accepted: out of it", ("side",))
            along = self.type == "line" and self.direction is not None
            if along and float(np.linalg.norm(np.cross(unit(self.side), unit(self.direction)))) < tolerances.PARALLEL:
                raise SceneError(f"found {say(self.side)}, which is along the line, accepted: across it", ("side",))
        return self

    @property
    def between_members(self) -> bool:
        """Whether members touch each other, not an obstacle."""
        return self.type == "members"


def contact_radius(contact: Contact, member: Member, sections: Mapping[str, CrossSection]) -> float | None:
    """Radius of the surface of a member, m, in a contact between members; None where nothing says it."""
    if contact.radius is not None:
        return contact.radius
    section = sections.get(str(member.section))
    if section is None or section.shape not in ("circle", "tube"):
        return None
    x = np.linspace(0.0, 1.0, 5)
    outermost = numbers(section.fibres(x))[:, 1]
    return outermost[0] if np.ptp(values_of(outermost)) == 0.0 else None


def pairs_of(names: Iterable[str], members: Mapping[str, Member]) -> list[tuple[str, str]]:
    """Pairs of members that may touch in a contact between them; flexible ones also touch themselves."""
    listed = list(names)
    own = [(name, name) for name in listed if members[name].type == "flexible"]
    return own + [(a, b) for i, a in enumerate(listed) for b in listed[i + 1 :]]
