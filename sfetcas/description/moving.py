"""Checks of scenes for vibrations and motions: masses, initial conditions, and prescribed motions that do not jump."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from ..errors import SceneError
from .contacts import Contact
from .formulas import Formula
from .loads import History, Load, Motion
from .obstacles import members_of, obstacle
from .records import say, unknown
from .sections import HEAVY, CrossSection, Polynomial, Table
from .springs import Spring
from .structure import Member, Node
from .task import Analysis
from .tendons import Tendon

__all__ = [
    "check_beginning",
    "check_contact",
    "check_driving",
    "check_masses",
    "check_no_contact",
    "check_unilateral",
    "check_velocities",
]


def check_masses(
    nodes: Mapping[str, Node], members: Mapping[str, Member], sections: Mapping[str, CrossSection]
) -> None:
    """Refuse a scene of which nothing has mass.

    Raises
    ------
    SceneError
        No member and no node has any.
    """
    heavy = any(m.section is not None and sections[m.section].heavy for m in members.values())
    heavy = heavy or any(any(map(any, member.mass or ())) for member in members.values())
    if not heavy and not any(node.mass or any(node.inertia or ()) for node in nodes.values()):
        accepted = "a section with 'rhoA', a node with 'mass' or 'inertia', or a small member with 'mass'"
        raise SceneError(f"scene without mass, which could not be set in motion, accepted: at least {accepted}")


def check_no_contact(analysis: Analysis, contacts: Mapping[str, Contact], springs: Mapping[str, Spring]) -> None:
    """Refuse contacts and stops, which vibrations along paths cannot treat.

    Raises
    ------
    SceneError
        Names the first contact or stop.
    """
    if analysis.type != "path":
        return
    given = "with analysis.modes on a path, accepted: with 'static', 'modes', 'dynamic', or 'path' without modes"
    for name in contacts:
        raise SceneError(f"found an obstacle {given}", ("contacts", name))
    for name, spring in springs.items():
        if spring.stop is not None:
            raise SceneError(f"found a stop {given}", ("springs", name, "stop"))


def check_contact(
    analysis: Analysis,
    contacts: Mapping[str, Contact],
    nodes: Mapping[str, Node],
    members: Mapping[str, Member],
    motions: Mapping[str, Motion],
    sections: Mapping[str, CrossSection],
    space: bool,
) -> None:
    """Refuse obstacles that motions do not know, and what cannot hit one.

    Raises
    ------
    SceneError
        Names the obstacle.
    """
    for name, contact in contacts.items():
        where = "contacts", name
        if contact.between_members:
            _check_between(analysis, name, contacts)
        elif obstacle(contact, space).kind == "sharp":
            message = f"found a {contact.type} that members slide over, accepted in a motion: a plane, circle, cylinder"
            raise SceneError(f"{message} or sphere, or with 'member_radius'", (*where, "type"))
        elif contact.friction > 0.0 and contact.member_radius > 0.0:
            message = "found a radius of members with friction in a motion, whose arm it does not know"
            raise SceneError(f"{message}, accepted: without one of both", (*where, "member_radius"))
        if analysis.integrator in ("idas", "conserving"):
            found = f"found with the integrator {analysis.integrator!r}, which does not find when it is touched"
            more = "" if contact.between_members else ", generalised-alpha"
            raise SceneError(f"{found}, accepted: radau-3, radau-2{more}, stepping", where)
        if contact.node is not None:
            _check_carried(analysis, contact, nodes[contact.node], motions.values(), where)
        if analysis.integrator == "stepping":
            _check_stepping(analysis, name, contact, members, sections, space)
        # Names of nothing are refused elsewhere.
        for member in (name for name in members_of(contact, members) if name in members):
            section = sections.get(str(members[member].section))
            if members[member].type == "flexible" and section is not None and not section.mass(HEAVY).all():
                message = f"found the member {member!r}, whose section is without mass, so that it would have to jump"
                raise SceneError(f"{message}, accepted: a small rhoA", where)


def _check_carried(
    analysis: Analysis, contact: Contact, node: Node, motions: Iterable[Motion], where: tuple[str, ...]
) -> None:
    """Refuse an obstacle that a node carries with what motions do not know of it."""
    turned = any(motion.node == contact.node and motion.rotation is not None for motion in motions)
    steps = analysis.integrator == "stepping"
    if contact.friction > 0.0 and not steps and (contact.type != "plane" or node.support != "clamped" or turned):
        message = f"found of an obstacle that the node {contact.node!r} carries in a motion, accepted: of a plane on a"
        raise SceneError(
            f"{message} clamped node that motions displace and do not turn, or 0, or 'stepping'", (*where, "friction")
        )
    if analysis.initial == "equilibrium":
        message = "found 'equilibrium' with an obstacle that a node carries, accepted: a motion that begins undeformed"
        raise SceneError(message, ("analysis", "initial"))


def _check_stepping(
    analysis: Analysis,
    name: str,
    contact: Contact,
    members: Mapping[str, Member],
    sections: Mapping[str, CrossSection],
    space: bool,
) -> None:
    """Refuse what steps with impulses do not know."""
    if analysis.initial == "equilibrium":
        message = "found 'equilibrium' with the integrator 'stepping', accepted: a motion that begins undeformed"
        raise SceneError(message, ("analysis", "initial"))
    if not (contact.between_members and contact.friction > 0.0 and space):
        return
    for member in (name for name in members_of(contact, members) if name in members):
        section = sections.get(str(members[member].section))
        if section is None or not (section.inertia(HEAVY)[:, 0] > 0.0).all():
            message = f"found the member {member!r}, which friction would spin about itself without inertia"
            raise SceneError(f"{message}, accepted: a section with rhoI, or with a shape and rho", ("contacts", name))


def _check_between(analysis: Analysis, name: str, contacts: Mapping[str, Contact]) -> None:
    """Refuse contact between members with what motions do not know beside it."""
    for other, contact in contacts.items():
        if contact.friction > 0.0 and analysis.integrator != "stepping":
            what = "between members" if contact.between_members else "beside contact between members"
            message = f"found {what} in a motion, accepted: with the integrator 'stepping', in statics, or 0"
            raise SceneError(message, ("contacts", other, "friction"))
    if analysis.integrator == "generalised-alpha":
        found = "found with the integrator 'generalised-alpha', which does not follow where members touch each other"
        raise SceneError(f"{found}, accepted: radau-3, radau-2", ("contacts", name))
    if analysis.initial == "equilibrium":
        message = "found 'equilibrium' with contact between members, accepted: a motion that begins undeformed"
        raise SceneError(message, ("analysis", "initial"))


def check_unilateral(
    analysis: Analysis,
    springs: Mapping[str, Spring],
    tendons: Mapping[str, Tendon],
    contacts: Mapping[str, Contact],
) -> None:
    """Refuse stops and slack tendons with integrators that do not find when they act, or where friction hides it.

    Raises
    ------
    SceneError
        Names the first of them.
    """
    for name, tendon in tendons.items():
        if tendon.may_be_slack and tendon.friction is not None:
            message = "found with a given length in a motion, which does not find when what slides is slack, accepted:"
            raise SceneError(f"{message} pushes = true, or a stiffness", ("tendons", name, "friction"))
    apart = [name for name, contact in contacts.items() if contact.friction > 0.0 or contact.between_members]
    if analysis.integrator not in ("idas", "conserving", *(["stepping"] if apart else [])):
        return
    beside, accepted = "", "accepted: radau-3, radau-2, generalised-alpha, stepping"
    if analysis.integrator == "stepping":
        beside, accepted = f"beside contacts.{apart[0]} ", "accepted: obstacles without friction beside it"
    found = f"found {beside}with the integrator {analysis.integrator!r}, which does not find when"
    for name, spring in springs.items():
        if spring.stop is not None:
            raise SceneError(f"{found} it acts, {accepted}", ("springs", name, "stop"))
    for name, tendon in tendons.items():
        if tendon.may_be_slack:
            message = f"{found} a tendon is slack, {accepted}, or pushes = true, or a stiffness"
            raise SceneError(message, ("tendons", name))


def check_velocities(
    nodes: Mapping[str, Node],
    members: Mapping[str, Member],
    motions: Mapping[str, Motion],
    analysis: Analysis,
    space: str | None,
) -> None:
    """Refuse velocities without a motion in time, of what the ground holds, and a spin in the wrong form.

    Parameters
    ----------
    space : why the scene is in space; None in a plane scene

    Raises
    ------
    SceneError
        Names the key.
    """
    for where in _begun(nodes, members):
        if analysis.type != "dynamic":
            raise SceneError(f"found the analysis {analysis.type!r}, accepted: 'dynamic' with this key", where)
    moved = {motion.node for motion in motions.values() if motion.displacement is not None and motion.between is None}
    for name, node in nodes.items():
        free = node.support == "free" or node.slides or name in moved
        if node.velocity is not None and any(node.velocity) and not free:
            message = f"found {say(node.velocity)}, accepted: zero, as the support is {node.support!r}"
            raise SceneError(message, ("nodes", name, "velocity"))
    for name, member in members.items():
        if space is not None and member.spin is not None and not isinstance(member.spin, tuple):
            found = say(member.spin if isinstance(member.spin, float) else member.spin.to_dict())
            message = f"found {found}, accepted: a vector [x, y, z], as {space}"
            raise SceneError(message, ("members", name, "spin"))
        if space is not None and member.turned is not None and not isinstance(member.turned, tuple):
            found = say(member.turned if isinstance(member.turned, float) else member.turned.to_dict())
            message = f"found {found}, accepted: a rotation vector [x, y, z], as {space}"
            raise SceneError(message, ("members", name, "turned"))
        if member.turned is not None and analysis.initial == "equilibrium":
            message = "found with initial = 'equilibrium', which says the shape at t = 0, accepted: 'undeformed'"
            raise SceneError(message, ("members", name, "turned"))


def _begun(nodes: Mapping[str, Node], members: Mapping[str, Member]) -> Iterator[tuple[str, ...]]:
    """Places of the keys that set a scene in motion at t = 0."""
    yield from (("nodes", name, "velocity") for name, node in nodes.items() if node.velocity is not None)
    yield from (("members", name, "spin") for name, member in members.items() if member.spin is not None)
    yield from (("members", name, "turned") for name, member in members.items() if member.turned is not None)


def _spins(member: Member) -> bool:
    """Whether it begins with an angular velocity that is not zero."""
    match member.spin:
        case Table():
            return any(member.spin.value)
        case Polynomial():
            return any(member.spin.polynomial)
        case tuple():
            return any(member.spin)
        case Formula():
            return True
    return bool(member.spin)


def check_beginning(analysis: Analysis, nodes: Mapping[str, Node], loads: Mapping[str, Load]) -> None:
    """Refuse to cut or release what the scene does not have.

    Raises
    ------
    SceneError
        Names the key.
    """
    for name in analysis.cut:
        if name not in loads:
            raise SceneError(unknown(name, loads, "loads"), ("analysis", "cut"))
    for name in analysis.release:
        if name not in nodes:
            raise SceneError(unknown(name, nodes, "nodes"), ("analysis", "release"))
        if nodes[name].support == "free":
            raise SceneError(f"found {name!r}, which is free, accepted: a node with a support", ("analysis", "release"))


def check_driving(
    analysis: Analysis,
    nodes: Mapping[str, Node],
    members: Mapping[str, Member],
    motions: Mapping[str, Motion],
    histories: Mapping[str, History],
    tendons: Mapping[str, Tendon],
) -> None:
    """Refuse motions and tendons whose place or velocity would jump in time, which takes a force without bound.

    Raises
    ------
    SceneError
        Names the history and the motion or tendon, the time and the size of the jump.
    """
    resting = not any(any(node.velocity or ()) for node in nodes.values()) and not any(map(_spins, members.values()))
    for name, motion in motions.items():
        turned = motion.rotation if isinstance(motion.rotation, tuple) else (motion.rotation or 0.0,)
        still = not any((*turned, *(motion.displacement or ())))
        # A released node is held in the first equilibrium only: its motion ends there.
        if still or (motion.between is None and motion.node in analysis.release):
            continue
        if motion.history is None:
            _check_constant(name, analysis)
            continue
        history, where = histories[motion.history], ("histories", motion.history)
        try:
            _check_start(name, history, analysis, resting)
            _check_course(name, history, analysis.duration)
        except SceneError as error:
            raise error.within(*where) from None
    for name, tendon in tendons.items():
        if not tendon.measured or tendon.stiffness is not None or not (tendon.pull or tendon.length):
            continue
        if tendon.history is None:
            # One that is too short at t = 0 is refused where lengths are known.
            if not tendon.may_be_slack:
                _check_constant(name, analysis, "tendons")
            continue
        try:
            _check_start(name, histories[tendon.history], analysis, resting, may_begin=tendon.may_be_slack)
            _check_course(name, histories[tendon.history], analysis.duration)
        except SceneError as error:
            raise error.within("histories", tendon.history) from None


def _check_constant(motion: str, analysis: Analysis, table: str = "motions") -> None:
    if analysis.initial == "undeformed":
        message = (
            "the key 'history' is missing: without one the motion would jump at t = 0, accepted: a history that begins "
            "with 0, or initial = 'equilibrium'"
        )
        raise SceneError(message, (table, motion))


def _check_start(motion: str, history: History, analysis: Analysis, resting: bool, *, may_begin: bool = False) -> None:
    """Refuse a history that begins with a jump; ``may_begin``: with any number, which a slack tendon may."""
    factor, rate = history.factor(0.0), history.rate(0.0)
    least, slowest = history.rounding
    if abs(factor) > least and analysis.initial == "undeformed" and not may_begin:
        accepted = "a history that begins with 0, or initial = 'equilibrium'"
        raise SceneError(
            f"begins with {factor:g}, so that the motion {motion!r} would jump at t = 0, accepted: {accepted}"
        )
    if abs(rate) > slowest and resting:
        how = ", as with interpolation = 'spline'," if history.value is not None else ","
        accepted = f"a history that begins at rest{how} or a scene that begins with velocities"
        raise SceneError(
            f"begins with a rate of {rate:g} 1/s, so that the motion {motion!r} would start with a jump, "
            f"accepted: {accepted}"
        )


def _check_course(motion: str, history: History, end: float) -> None:
    for t, step, kink in history.jumps():
        if not 0.0 < t < end:
            continue
        if step:
            so = f"so that the motion {motion!r} would jump too"
            raise SceneError(f"jumps by {step:g} at t = {t:g} s, {so}, accepted: intervals whose values meet")
        if t == history.t[-1]:
            accepted = f"a history until the end of the analysis at {end:g} s or one that ends at rest"
            raise SceneError(
                f"ends at {t:g} s with a rate of {-kink:g} 1/s, so that the motion {motion!r} would stop with a jump, "
                f"accepted: {accepted}"
            )
        so = f"so that the velocity of the motion {motion!r} would jump"
        accepted = "intervals whose rates meet, as polynomials can, or interpolation = 'spline'"
        raise SceneError(f"its rate jumps by {kink:g} 1/s at t = {t:g} s, {so}, accepted: {accepted}")
