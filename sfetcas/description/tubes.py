"""Tubes that share the centre line of members, and turn and slide on it: what each is, and where it lies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, final

import numpy as np
from pydantic import AfterValidator, BeforeValidator, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.quaternion import matrix
from .records import NotNegative, Number, Positive, Record, Turn, listed, unknown
from .sections import CrossSection
from .shapes import CenterLine
from .structure import Member, Node

__all__ = ["Run", "Tube", "check_reach", "check_tube", "check_turns", "mass_of_tubes", "runs_of", "tube_breaks"]


def _names(value: Any) -> tuple[Any, ...]:
    names = (value,) if isinstance(value, str) else listed(value, "the name of a member, or a list of names")
    if not names:
        raise ValueError("found an empty list, accepted: at least one member")
    return names


def _angle(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"found {value:g}, accepted: an angle from {-LARGEST:g} to {LARGEST:g} rad")
    return value


LARGEST = 1e6
"""Largest angle of a base, rad: rounding leaves 1e-10 of it, and no drive makes so many turns."""

Angle = Annotated[Number, AfterValidator(_angle)]


@final
class Tube(Record):
    """A further tube around or within a member, or within one around it: all have one centre line.

    The member is the tube that reaches furthest; a tube ends before it or with it.  Each turns about the centre line
    and slides along it without friction and without clearance, and is held at its base.

    Parameters
    ----------
    members : list of names, or name
        The members along which it lies, in their order, each beginning where the one before it ends.
    section : name
        Name of its cross-section.
    length : m
        Its length, from its base to its front end.
    start : m
        Arc length along the members at which its base is.  Below zero the base is behind the first member, and what
        is there is held straight and only twists.
    curvature : (3,), 1/m, about b1 (twist), b2 and b3 of its sections
        What it has by itself, unloaded.  One number is the curvature about b3.
    curved_from : m
        Its own arc length, from its base, from which it is curved; before that it is straight.
    angle : rad
        Angle by which its base is turned about the tangent against the section of the member there, b2 towards b3, at
        every load factor; of a base behind the members against their first section.
    rotation : rad
        Further angle at factor 1.
    history : name
        Name of a history that replaces the load factor of the step.  It multiplies the ``rotation``.
    insertion : m
        Length by which it is pushed forward from ``start`` at factor 1; below zero it is drawn back.  Load steps come
        one after the other then.
    insertion_history : name
        Name of a history that replaces the load factor of the step.  It multiplies the ``insertion``.

    Examples
    --------
    >>> Tube(members="inner", section="steel", length=0.2, curvature=5.0, curved_from=0.1).vector
    (0.0, 0.0, 5.0)
    """

    members: Annotated[tuple[str, ...], BeforeValidator(_names)]
    section: str
    length: Positive
    start: Number = 0.0
    curvature: Turn = 0.0
    curved_from: NotNegative = 0.0
    angle: Angle = 0.0
    rotation: Angle = 0.0
    history: str | None = None
    insertion: Number = 0.0
    insertion_history: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Tube:
        if not self.start + self.length > 0.0:
            found = f"found a base at {self.start:g} m and a length of {self.length:g} m"
            raise SceneError(f"{found}, accepted: a tube that reaches beyond the start of its members", ("length",))
        if self.start < 0.0 and self.vector[0] and self.curved_from < -self.start:
            message = f"found a twist that begins at {self.curved_from:g} m, behind the members, accepted: one that"
            raise SceneError(f"{message} begins along them, from {-self.start:g} m on", ("curved_from",))
        return self

    @property
    def vector(self) -> tuple[float, float, float]:
        """Its natural twist and curvature (3,), 1/m, about b1, b2, b3; a single number is the curvature about b3."""
        return self.curvature if isinstance(self.curvature, tuple) else (0.0, 0.0, self.curvature)


@dataclass(frozen=True)
class Run:
    """The part of one member along which a tube lies.

    Attributes
    ----------
    member : str
    start, end : float
        Fractions of the length of the member.
    begin : float
        Arc length of the tube where the member begins, m; below zero where the tube begins later.
    turned : float
        Angle, rad, about the tangent from axes that go on along the members before it to those of this member.
    """

    member: str
    start: float
    end: float
    begin: float
    turned: float


def runs_of(tube: Tube, lines: Mapping[str, CenterLine]) -> tuple[Run, ...]:
    """The parts of the members along which a tube lies, in their order."""
    found, arc, turned, before = [], 0.0, 0.0, None
    for member in tube.members:
        line = lines[member]
        if before is not None:
            turned += _turned(before, line)
        start, end = (_snapped((place - arc) / line.length) for place in (tube.start, tube.start + tube.length))
        if start < 1.0 and end > 0.0:
            found.append(Run(member, max(start, 0.0), min(end, 1.0), arc - tube.start, turned))
        arc, before = arc + line.length, line
    return tuple(found)


def _snapped(x: float) -> float:
    """A fraction of a length, exactly 0 or 1 where lengths that were written say that it is."""
    return next((end for end in (0.0, 1.0) if abs(x - end) < tolerances.WRITTEN), x)


def _turned(before: CenterLine, after: CenterLine) -> float:
    """Angle, rad, about the tangent from the axes at the end of a line to those at the start of the next one."""
    last, first = (matrix(values_of(line.quaternions(np.array([x]))))[0] for line, x in ((before, 1.0), (after, 0.0)))
    between = last.T @ first
    return math.atan2(between[2, 1] - between[1, 2], between[1, 1] + between[2, 2])


def tube_breaks(tube: Tube, run: Run, line: CenterLine) -> Iterator[float]:
    """Fractions of the length of a member at which elements have to end for a tube."""
    yield from (run.start, run.end)
    curved = (tube.curved_from - run.begin) / line.length
    if any(values_of(tube.vector)) and run.start + tolerances.WRITTEN < curved < run.end - tolerances.WRITTEN:
        yield curved


def check_tube(
    tube: Tube,
    nodes: Mapping[str, Node],
    members: Mapping[str, Member],
    sections: Mapping[str, CrossSection],
    lines: Mapping[str, CenterLine],
) -> None:
    """Refuse a tube along what is no chain of members that bend, and one that reaches beyond it.

    Raises
    ------
    SceneError
        Its place begins with a key of the tube.
    """
    for name in tube.members:
        if name not in members:
            raise SceneError(unknown(name, members, "members"), ("members",))
        found = f"found the member {name!r}"
        if members[name].type != "flexible":
            raise SceneError(f"{found}, which is {members[name].type}, accepted: flexible ones", ("members",))
        _check_section(str(members[name].section), sections, found, "members")
    if tube.section not in sections:
        raise SceneError(unknown(tube.section, sections, "sections"), ("section",))
    _check_section(tube.section, sections, "found a tube", "section")
    missing = sections[tube.section].missing(("EI2", "EI3", "GJ"))
    if missing:
        raise SceneError(f"the section {tube.section!r} lacks the key {missing[0]!r}: a tube needs it", ("section",))
    for one, other in pairwise(tube.members):
        _check_joined(one, other, nodes, members, lines)
    check_reach(tube, sum(lines[name].length for name in tube.members))


def check_turns(tube: Tube, factors: Iterable[float]) -> None:
    """Refuse a base that ``factors`` turn beyond the largest angle.

    Raises
    ------
    SceneError
        Its place begins with a key of the tube.
    """
    for factor in factors:
        angle = tube.angle + factor * tube.rotation
        if abs(angle) > LARGEST:
            accepted = f"an angle of the base from {-LARGEST:g} to {LARGEST:g} rad"
            raise SceneError(f"found {angle:g} rad for the factor {factor:g}, accepted: {accepted}", ("rotation",))


def check_reach(tube: Tube, total: float) -> None:
    """Refuse a tube that reaches beyond its members, which have a length of ``total``, m, together.

    Raises
    ------
    SceneError
        Its place begins with a key of the tube.
    """
    if tube.start + tube.length > total * (1.0 + tolerances.WRITTEN):
        found = f"found an end at {tube.start + tube.length:.9g} m along the members"
        accepted = f"up to their end at {total:.9g} m: the tube that reaches furthest is the member"
        raise SceneError(f"{found}, accepted: {accepted}", ("length",))


def _check_section(name: str, sections: Mapping[str, CrossSection], found: str, key: str) -> None:
    """Refuse sections whose bending moments are not proportional to changes of curvature, and those that stretch."""
    section = sections[name]
    if section.law is not None:
        raise SceneError(f"{found}, whose section has the law {section.law.type!r}, accepted: none with a law", (key,))
    if section.stretches:
        raise SceneError(f"{found}, whose section {name!r} stretches or shears, accepted: one that does not", (key,))
    if section.off_line in ("tension_center", "shear_center"):
        message = f"{found}, whose section {name!r} has a {section.off_line}, accepted: one without"
        raise SceneError(message, (key,))
    if section.relaxation:
        raise SceneError(f"{found}, whose section {name!r} relaxes, accepted: one that does not", (key,))


def _check_joined(
    one: str, other: str, nodes: Mapping[str, Node], members: Mapping[str, Member], lines: Mapping[str, CenterLine]
) -> None:
    """Refuse members of which one does not go on where the other ends."""
    end, start = members[one].nodes[-1], members[other].nodes[0]
    found = f"found {other!r} after {one!r}"
    if end != start:
        raise SceneError(f"{found}, which ends at node {end!r}, accepted: a member that begins there", ("members",))
    joints = {nodes[end].joint, members[one].release[-1], members[other].release[0]}
    if joints != {"rigid"}:
        raise SceneError(f"{found}, with a joint at node {end!r}, accepted: members joined rigidly", ("members",))
    tangents = (values_of(lines[n].tangents(np.array([x])))[0] for n, x in ((one, 1.0), (other, 0.0)))
    if float(np.linalg.norm(np.cross(*tangents))) > tolerances.PARALLEL:
        message = f"{found}, with a kink at node {end!r}, accepted: a centre line whose tangent goes on"
        raise SceneError(message, ("members",))


def mass_of_tubes(scene: Any, member: str, x: Array) -> Array:
    """Mass per length, kg/m, of the tubes at points x (elements, points) of a member, fractions of its length."""
    found, length = np.zeros(x.shape), scene.center_lines[member].length
    middle = values_of(x).mean(axis=1)
    for name, runs in scene.tube_runs.items():
        tube = scene.tubes[name]
        for run in runs:
            if run.member == member:
                own = (run.begin + x * length) / tube.length
                inside = ((middle > run.start) & (middle < run.end))[:, None]
                mass = scene.sections[tube.section].mass(np.clip(values_of(own).ravel(), 0.0, 1.0))
                found = found + numbers(mass).reshape(x.shape) * inside
    return found
