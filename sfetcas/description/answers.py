"""Names of quantities of an answer: every quantity once, with its name, unit, components and meaning.

One grammar of names for expectations, ``accuracy_of``, ``until``, sweeps, parameters, measurements, design, generated C
and the JSON answer::

    nodes.tip.position                    a table, the name of a record, a key
    nodes.tip.position.1                  one component, counted from 0
    nodes.tip.position.y                  the same component by its name: x y z, w x y z, or b1 b2 b3 (section axes)
    members.beam.moment at 0.5            at a fraction of the length of a member
    energy.elastic step 2                 of one of several answers: step, time, crossing, limit_point, ...
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..errors import SceneError
from .obstacles import members_of
from .records import say, unknown

__all__ = [
    "ANSWERS",
    "COUNTED",
    "MOTION",
    "PARAMETERS",
    "STATICS",
    "STEPS",
    "AnswerKind",
    "AnswerName",
    "answer_name",
    "answers_table",
    "check_answer",
    "may_lie",
    "outlined",
    "selected",
    "single_number",
]

STATICS, MOTION, PARAMETERS, STEPS = "statics", "motion", "parameters", "steps"
"""Kinds of answers: equilibria; states of a motion; equilibria as expressions of parameters
(:func:`~sfetcas.parametric`, design, generated C); motions as expressions (optimal control, generated C).
"""

MODES = "modes"
"""Small vibrations."""

ANALYSES = {"dynamic": [MOTION], "modes": [STATICS, MODES]}
"""What answers of types of the analysis tell, if not of statics alone."""

EVERYWHERE = (STATICS, MOTION, PARAMETERS, STEPS)


@dataclass(frozen=True)
class AnswerKind:
    """A kind of quantity that answers may have.

    Attributes
    ----------
    name : str
        With NAME for the name of a record: ``nodes.NAME.position``.
    unit : str
        SI unit; empty for dimensionless quantities.
    meaning : str
    where : tuple of str
        The kinds of answers that have it, see ``EVERYWHERE``.
    components : tuple of str
        Names of the components of a vector; empty for a single value.
    along : bool
        Whether it is a field along members.
    applies : callable
        (scene, record) -> whether a record of its table has it.
    """

    name: str
    unit: str
    meaning: str
    where: tuple[str, ...]
    components: tuple[str, ...]
    along: bool
    applies: Callable[[Any, Any], bool] = field(repr=False)

    @property
    def table(self) -> str:
        """Its table in the answer: ``nodes``; empty for a quantity of the whole answer."""
        return self.name.partition(".")[0] if "." in self.name else ""

    @property
    def key(self) -> str:
        """Its key in the table: ``position``; empty where the name ends with that of the record."""
        last = self.name.rpartition(".")[2]
        return "" if last == "NAME" else last

    @property
    def numeric(self) -> bool:
        """Whether its value consists of numbers."""
        return self.name not in (
            "certificate.stable",
            "contacts.NAME.member",
            "contacts.NAME.other",
            "contacts.NAME.touching",
            "contacts.NAME.sticking",
            "tendons.NAME.slack",
            "tendons.NAME.tensions",
            "tendons.NAME.released",
        )

    @property
    def named(self) -> bool:
        """Whether it belongs to a record of the scene, as a node."""
        return "NAME" in self.name.split(".")


def _in_plane(scene: Any, record: Any) -> bool:
    return bool(scene.resolved_dimension == "plane")


def _supported(scene: Any, record: Any) -> bool:
    return bool(record.support != "free")


def _told_of_members(scene: Any, contact: Any) -> bool:
    """Whether places along members are told: in motions where these touch each other."""
    return bool(contact.between_members or scene.analysis.type != "dynamic")


def outlined(scene: Any, record: Any) -> bool:
    """Whether a member is flexible and its section has a shape alone, so that its fibres are linear elastic."""
    if record.type != "flexible":
        return False
    section = scene.sections[str(record.section)]
    return section.shape is not None and section.law is section.coupling is section.stretch_law is None


def may_lie(scene: Any, record: Any) -> bool:
    """Whether a member is flexible and obstacles stop it, so that it may lie along one."""
    stops = [contact for contact in scene.contacts.values() if not contact.between_members]
    return record.type == "flexible" and any(
        stop.members == "all" or any(scene.members[name] is record for name in members_of(stop, ())) for stop in stops
    )


TABLE = """
factor | | | statics, motion | factor of the loads and motions; of a motion its time
omega | rad/s | | statics | at flutter points: angular frequency of the motion that grows
nodes.NAME.position | m | x y z | all | of the node
nodes.NAME.quaternion | | w x y z | all | rotation since the undeformed scene, where the node has one of its own
nodes.NAME.angle | rad | | all | the same in the plane, counting turns
nodes.NAME.velocity | m/s | x y z | motion, steps | of the node
nodes.NAME.angular_velocity | rad/s | x y z | motion | of the node, where it has a rotation of its own
reactions.NAME.force | N | x y z | all | at a supported node: what the ground does
reactions.NAME.moment | N m | x y z | all | the same about the node
members.NAME.position at | m | x y z | all | of the centre line
members.NAME.quaternion at | | w x y z | all | rotation of the sections since the undeformed scene
members.NAME.angle at | rad | | all | the same in the plane, counting turns
members.NAME.force at | N | x y z | statics, motion, parameters | section force: of what is beyond on what is before
members.NAME.moment at | N m | x y z | statics, motion, parameters | section moment, likewise
members.NAME.curvature at | 1/m | b1 b2 b3 | statics, motion, parameters | whole curvature about b1 (twist), b2, b3
members.NAME.strain at | | b1 b2 b3 | statics, motion, parameters | stretch (b1), shear (b2, b3), where it yields
members.NAME.bending_strain at | | | statics, motion, parameters | largest, with a shape and neither law nor coupling
members.NAME.bending_stress at | Pa | | statics, motion, parameters | E times that strain
members.NAME.pressure at | N/m | x y z | statics | of what it lies along, with friction; not at single places
members.NAME.velocity at | m/s | x y z | motion | of the centre line; not of small members
members.NAME.angular_velocity at | rad/s | x y z | motion | of the sections; not of small members
members.NAME.energy | J | | statics, motion, parameters | strain energy of a member that is not rigid
members.NAME.dissipated | J | | statics, motion | since it was undeformed, of one whose law has memory
members.NAME.largest_bending_strain | | | statics, motion | along the whole member
members.NAME.largest_bending_stress | Pa | | statics, motion | along the whole member
springs.NAME.angle | rad | | all | of a rotational one, counting turns
springs.NAME.moment | N m | | all | of a rotational one, without what its damper takes
springs.NAME.travel | m | | all | of a translational one
springs.NAME.force | N | | all | of a translational one, without what its damper takes
springs.NAME.stop | N m, N | | statics, motion, parameters | of one with a stop: what that adds; zero away from it
tendons.NAME.tension | N | | all | below zero where it pushes, as a chamber
tendons.NAME.length | m | | all | along its way
tendons.NAME.slack | | | statics, motion | of one that does not push, with a length or stiffness
tendons.NAME.far_tension | N | | all | of one with `friction`, at the end that is not pulled
tendons.NAME.tensions | N | | statics, motion | the same behind each piece of its way, a list from the pulled end on
tendons.NAME.released | | | statics, motion | of one with `friction`: whether it is let out instead of pulled
tubes.NAME.torque | N m | | statics, motion, parameters | about the tangent, of what turns its base on the tube
tubes.NAME.angle | rad | | all | of its front end against the section there, counting turns
tubes.NAME.energy | J | | statics, motion, parameters | strain energy of the tube along its members and behind them
tubes.NAME.turn at | rad | | statics, motion | against the section there, counting turns
tubes.NAME.curvature at | 1/m | b1 b2 b3 | statics, motion | its own twist (b1) and curvatures about its own axes
tubes.NAME.moment at | N m | b1 b2 b3 | statics, motion | its own torque (b1) and bending moments about its own axes
rings.NAME.at | | | all | fraction of the length of its member
rings.NAME.force | N | x y z | all | of the ring on its member
rings.NAME.drive | N | | all | of what moves one with a `travel`, towards the second node of the member
motions.NAME.moment | N m | x y z | all | what makes a rotation; a number where that is one
motions.NAME.force | N | x y z | all | what makes a displacement; a number at a driven joint
magnets.NAME.energy | J | | statics, motion, parameters | minus the moment times the field, summed along members
magnets.NAME.torque | N m | x y z | statics, motion, parameters | of the fields, about the places of the magnet
magnets.NAME.force | N | x y z | statics, motion, parameters | of fields that are not uniform
contacts.NAME.force | N | x y z | all | on the member; in motions and with parameters the sum
contacts.NAME.at | | | statics, motion, parameters | fraction of the length, or [from, to]; in motions between members
contacts.NAME.gap | m | | statics, motion | smallest distance
contacts.NAME.member | | | statics, motion | which it touches; all are lists where it touches more than once
contacts.NAME.other | | | statics, motion | between members: the second one; the force is that on the first
contacts.NAME.other_at | | | statics, motion | fraction of the length of the second one
contacts.NAME.touching | | | motion | what touches: `nodes.tip`, `members.rod at 0.25`; a list
contacts.NAME.friction | N | x y z | statics, motion | with `friction`: the part of the force along the surfaces
contacts.NAME.sticking | | | statics, motion | with `friction`: whether it does; in motions a list of what does
energy.elastic | J | | all | of members, springs, tendons and tubes
energy.dissipated | J | | statics, motion | by laws with memory, since undeformed; in motion also by impacts, friction
energy.loads | J | | all | from the undeformed scene
energy.total | J | | all | sum of all that there are
energy.potential | J | | statics, parameters | another name of the total of an equilibrium
energy.kinetic | J | | motion, steps | of all masses
momentum.linear | kg m/s | x y z | motion | of all masses
momentum.angular | kg m²/s | x y z | motion | about the centre of mass
certificate.residual | | | statics | relative, of all equations
certificate.stable | | | statics | true, false, "neutral", or "not defined"
certificate.negative | | | statics | ways out
certificate.smallest | N | | statics | smallest eigenvalue
certificate.error_estimate | | | statics | of positions over the size, or of what `certificate.error_of` names
modes.omega | rad/s | | modes | rising
modes.rigid | | | modes | motions that nothing resists
modes.damping | | | modes | damping ratios, where anything damps
modes.growing | 1/s | | modes | rates of what leaves an unstable equilibrium
modes.buckling | | | modes | factors at which it buckles, a linear estimate
modes.error_estimate | | | modes | largest relative one of the frequencies
stiffness.NAME | N/m and mixed | | parameters | of a free node: force and moment by displacement and rotation
compliance.NAME | 1/N and mixed | | parameters | of a node: displacement and rotation by force and moment
"""
"""The table of the README: name (with ``at`` along members), unit, components, where it is told, meaning."""

APPLIES: dict[str, Callable[[Any, Any], bool]] = {
    "nodes.NAME.angle": _in_plane,
    "members.NAME.angle": _in_plane,
    "reactions.NAME.force": _supported,
    "reactions.NAME.moment": _supported,
    "members.NAME.strain": lambda scene, member: member.stretches(scene.sections) or member.shifted(scene.sections),
    "members.NAME.bending_strain": outlined,
    "members.NAME.bending_stress": outlined,
    "members.NAME.largest_bending_strain": outlined,
    "members.NAME.largest_bending_stress": outlined,
    "members.NAME.pressure": may_lie,
    "members.NAME.velocity": lambda scene, member: member.type != "small",
    "members.NAME.angular_velocity": lambda scene, member: member.type != "small",
    "members.NAME.energy": lambda scene, member: member.type != "rigid",
    "members.NAME.dissipated": lambda scene, member: member.remembers(scene.sections),
    "springs.NAME.angle": lambda scene, spring: spring.type == "rotational",
    "springs.NAME.moment": lambda scene, spring: spring.type == "rotational",
    "springs.NAME.travel": lambda scene, spring: spring.type == "translational",
    "springs.NAME.force": lambda scene, spring: spring.type == "translational",
    "springs.NAME.stop": lambda scene, spring: spring.stop is not None,
    "tendons.NAME.slack": lambda scene, tendon: tendon.measured and not tendon.pushes,
    "tendons.NAME.far_tension": lambda scene, tendon: tendon.friction is not None,
    "tendons.NAME.tensions": lambda scene, tendon: tendon.friction is not None,
    "tendons.NAME.released": lambda scene, tendon: tendon.friction is not None,
    "contacts.NAME.at": _told_of_members,
    "contacts.NAME.member": _told_of_members,
    "contacts.NAME.other": _told_of_members,
    "contacts.NAME.other_at": _told_of_members,
    "contacts.NAME.touching": lambda scene, contact: not contact.between_members,
    "contacts.NAME.friction": lambda scene, contact: contact.friction > 0.0,
    "contacts.NAME.sticking": lambda scene, contact: contact.friction > 0.0,
    "rings.NAME.drive": lambda scene, ring: ring.driven,
    "motions.NAME.moment": lambda scene, motion: motion.rotation is not None,
    "motions.NAME.force": lambda scene, motion: motion.displacement is not None,
    "stiffness.NAME": lambda scene, node: node.support == "free",
}
"""Whether a record has a quantity, where not all of its table have it: (scene, record) -> bool."""


def _kind(row: str) -> AnswerKind:
    name, unit, components, where, meaning = (cell.strip() for cell in row.split(" |"))
    name, _, at = name.partition(" ")
    analyses = EVERYWHERE if where == "all" else tuple(where.split(", "))
    applies = APPLIES.get(name, lambda scene, record: True)
    return AnswerKind(name, unit, meaning, analyses, tuple(components.split()), bool(at), applies)


ANSWERS = tuple(_kind(row) for row in TABLE.strip().splitlines())
"""All quantities, in the order of the table in the README."""

RECORDS = {"reactions": "nodes", "stiffness": "nodes", "compliance": "nodes"}
"""Tables of the scene whose names stand in a table of the answer, where it has another name."""

SELECTORS = ("at", "step", "time", "crossing", "limit_point", "bifurcation", "flutter_point", "transition")
"""Words that say where and of which answer."""

COUNTED = SELECTORS[3:]
"""Those that whole numbers follow."""

VALUE = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[^\s.]+"
"""A number or a word behind a selector; a dot in another place is one of the name, which may have spaces."""

SELECTED = re.compile(rf"(?P<name>.*\S)\s+(?P<key>{'|'.join(SELECTORS)})\s+(?P<value>{VALUE})\s*")


@dataclass(frozen=True)
class AnswerName:
    """The parsed name of one quantity of an answer.

    Attributes
    ----------
    kind : AnswerKind
    record : str
        Name of the node, member, ...; empty for a quantity of the whole answer.
    component : int or None
        Index of a component of a vector.
    selectors : mapping
        Place along a member (``at``), and which of several answers: ``step``, ``time``, ``crossing``, ...
    """

    kind: AnswerKind
    record: str = ""
    component: int | None = None
    selectors: Mapping[str, float] = field(default_factory=dict)

    @property
    def at(self) -> float | None:
        """The fraction of the member's length; None where the name has none."""
        return self.selectors.get("at")

    @property
    def quantity(self) -> str:
        """The name without component and selectors: ``members.beam.moment``."""
        words = [self.record if word == "NAME" else word for word in self.kind.name.split(".")]
        return ".".join(words)

    @property
    def bare(self) -> str:
        """The name without selectors: ``members.beam.moment.2``."""
        return self.quantity if self.component is None else f"{self.quantity}.{self.component}"

    @property
    def text(self) -> str:
        """The whole name: ``members.beam.moment.2 at 0.5``."""
        return " ".join([self.bare, *(f"{key} {_shortest(value)}" for key, value in self.selectors.items())])


def _shortest(value: float) -> str:
    """A number with all its digits, 2.0 as 2."""
    return f"{value:g}" if float(f"{value:g}") == value else repr(value)


def answer_name(text: Any, *where: str) -> AnswerName:
    """Parse a name; :func:`check_answer` checks that the scene has such a record.

    Parameters
    ----------
    text : str
    where : str
        Keys of the place in the scene where it is given, for messages.

    Raises
    ------
    SceneError
        No quantity has this name.

    >>> answer_name("members.my beam.moment.z at 0.5 step 2").text
    'members.my beam.moment.2 at 0.5 step 2'
    """
    if not isinstance(text, str):
        raise SceneError(f"found {say(text)}, accepted: a name, as 'nodes.tip.position'", where)
    try:
        name, selectors = selected(text.strip())
        return replace(_named(name), selectors=selectors)
    except SceneError as error:
        raise SceneError(error.bare, where) from None


def selected(text: str) -> tuple[str, dict[str, float]]:
    """Split a text into a name and its selectors, in their order.

    Raises
    ------
    SceneError
        No number stands after one of them.

    >>> selected("members.my beam.moment at 0.5 step 2")
    ('members.my beam.moment', {'at': 0.5, 'step': 2.0})
    """
    found: dict[str, float] = {}
    while match := SELECTED.fullmatch(text):
        key, value = match["key"], match["value"]
        try:
            number = float(int(value)) if key in COUNTED else float(value)
        except ValueError:
            raise SceneError(f"found {text!r}, accepted: a number after {key!r}") from None
        text, found = match["name"], {key: number, **found}
    return text, found


@functools.cache
def _by_first_word() -> dict[str, list[AnswerKind]]:
    """Quantities by the first word of their names."""
    found: dict[str, list[AnswerKind]] = {}
    for kind in ANSWERS:
        found.setdefault(kind.table or kind.name, []).append(kind)
    return found


def _named(text: str) -> AnswerName:
    """A name without selectors."""
    words = text.split(".")
    words[0] = {"prescribed": "motions"}.get(words[0], words[0])
    kinds = _by_first_word().get(words[0])
    if kinds is None:
        raise SceneError(unknown(words[0], _by_first_word()))
    first = kinds[0]
    if not first.table:
        return AnswerName(first) if len(words) == 1 else _refused(text, first)
    record = words[1] if first.named and len(words) > 1 else ""
    rest = words[2:] if first.named else words[1:]
    if first.key:
        if not rest or (first.named and not record):
            return _refused(text, first)
        by_key = {kind.key: kind for kind in kinds}
        if rest[0] not in by_key:
            raise SceneError(unknown(rest[0], by_key))
        first, rest = by_key[rest[0]], rest[1:]
    if len(rest) > 1 or (first.named and not record):
        return _refused(text, first)
    return AnswerName(first, record, _component(first, rest[0]) if rest else None)


def _refused(text: str, kind: AnswerKind) -> AnswerName:
    words = kind.name.split(".")
    accepted = ".".join("KEY" if kind.table and word == kind.key else word for word in words)
    raise SceneError(f"found {text!r}, accepted: {accepted}")


def _component(kind: AnswerKind, word: str) -> int:
    """The number of a component by its number or name."""
    if word in kind.components:
        return kind.components.index(word)
    if word.isdecimal() and int(word) < max(len(kind.components), 1):
        return int(word)
    if not kind.components:
        raise SceneError(f"found the component {word!r}, accepted: none, as {kind.name} is one number")
    numbers = [str(i) for i in range(len(kind.components))]
    raise SceneError(f"found the component {word!r}, accepted: {', '.join([*kind.components, *numbers])}")


def check_answer(scene: Any, name: AnswerName, where: str = "") -> None:
    """Refuse a name of a record that the scene does not have, or of a quantity that its answers do not have.

    Parameters
    ----------
    where : str
        The kind of answer, see ``EVERYWHERE``; empty: that of the scene's analysis.

    Raises
    ------
    SceneError
        Which names or keys it has.
    """
    kind = name.kind
    analyses = [where] if where else ANALYSES.get(scene.analysis.type, [STATICS])
    if not set(analyses) & set(kind.where):
        known = [one for one in ANSWERS if set(analyses) & set(one.where)]
        same = [f"{one.table}.*.{one.key}" if one.named else one.name for one in known if one.table == kind.table]
        tables = dict.fromkeys(f"{one.table}.*" if one.table else one.name for one in known)
        message = f"found {name.quantity!r}, told of {', '.join(kind.where)} only, accepted of {analyses[0]}: "
        raise SceneError(message + ", ".join(filter(None, same) if kind.table and same else tables))
    if not kind.named:
        return
    records = getattr(scene, RECORDS.get(kind.table, kind.table))
    if name.record not in records:
        raise SceneError(unknown(name.record, records, RECORDS.get(kind.table, kind.table)))
    record = records[name.record]
    if kind.table == "reactions" and record.support == "free":
        raise SceneError(f"node {name.record!r} is free: no ground acts on it")
    if not kind.applies(scene, record):
        accepted = [one.key for one in ANSWERS if one.table == kind.table and one.applies(scene, record)]
        found = f"found {name.quantity!r}"
        raise SceneError(f"{found}, accepted of {name.record!r}: {', '.join(filter(None, accepted)) or 'none'}")


def single_number(motion: Any, key: str) -> bool:
    """Whether what enforces a motion is one number: at a driven joint, or a moment about a hinge axis."""
    return motion.between is not None or (key == "moment" and isinstance(motion.rotation, float))


HEAD = "name | unit | components | available in | what it is"


def answers_table() -> str:
    """The kinds of quantities as the Markdown table of the README."""
    rows = [row.split(" |") for row in (HEAD, *TABLE.strip().splitlines())]
    cells = [[cell.strip() for cell in row] for row in rows]
    quoted = [cells[0], ["---"] * 5, *([f"`{name.removesuffix(' at')}`", *rest] for name, *rest in cells[1:])]
    return "".join(f"| {' | '.join(row)} |\n" for row in quoted)
