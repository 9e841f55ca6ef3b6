"""What is looked at beside an equilibrium with what touches as it was, as in generated code.

Margins, dimensionless, are below zero where something else touches: how hard each place pushes, how far it is from the
ends of its members, and gaps of places along members, from obstacles and from each other.  Between these the least gap
is that of a parabola.  Near a place that touches there is no other margin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from ..contact.closest import Closest
from ..contact.nearby import Nearby, Places
from ..description.answers import answer_name
from ..description.obstacles import members_of
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.model import Model
from ..mechanics.singles import turned_vector
from .arguments import Argument, Arguments
from .results import Outputs, Results

__all__ = ["watched_of"]

LEAST = -1e-5
"""Margin from which on something else touches: parabolas miss gaps by less than that of the size of the scene."""

SAMPLES = 65
"""Places along a member at which its gaps are looked at."""

BESIDE = 3.0
"""Distance from a place that touches, over that between such places, within which a gap is not looked at."""

FAR = 1.0
"""The margin of what is not looked at; that of what does not hold at all is as far below zero."""

NO_PUSH = 1e-12
"""A push, dimensionless, that is none: without one a place may be anywhere on a surface that its member crosses."""


def watched_of(name: str, base: Model, known: Arguments) -> ca.Function:
    """``(arguments, state, given) ->`` margins (n,) of all that may touch, each with what it may be below zero by
    added: something else touches where one is below zero.

    Raises
    ------
    SceneError
        Contacts whose margins are not known.
    """
    margins = _contact_margins(name, base, known.arguments)
    inputs = margins.mx_in()
    return ca.Function(name, inputs, [margins(*inputs) - LEAST], margins.name_in(), margins.name_out())


def _contact_margins(name: str, base: Model, arguments: Sequence[Argument]) -> ca.Function:
    """``(arguments, state, given) ->`` margins (n,).

    Parameters
    ----------
    name : str
        Of the function.
    base : Model
        With its places that touch.
    arguments : sequence of Argument

    Raises
    ------
    SceneError
        Contacts whose margins are not known.
    """
    _refuse(base, arguments)
    scene, points = base.scene, base.mesh.points
    x = np.linspace(0.0, 1.0, SAMPLES)
    near = {
        (contact, member): [x[0], x[-1]] if scene.members[member].type == "rigid" else x.tolist()
        for contact, record in scene.contacts.items()
        for member in members_of(record, scene.members)
        if scene.members[member].type != "small"
    }
    flexible = dict.fromkeys(member for (_, member), at in near.items() if len(at) > 2)
    names = [f"members.{member}.position" for member in flexible]
    ends = dict.fromkeys(
        node for (_, member), at in near.items() if len(at) == 2 for node in scene.members[member].nodes
    )
    turned = "quaternion" if base.space else "angle"
    turns = base.rotations.node_turn
    carriers = {
        name: contact.node
        for name, contact in scene.contacts.items()
        if contact.node is not None and turns[contact.node] is not None
    }
    names += [f"nodes.{node}.position" for node in dict.fromkeys([*ends, *carriers.values()])]
    names += [f"nodes.{node}.{turned}" for node in dict.fromkeys(carriers.values())]
    results = Results(base, names, dict.fromkeys(flexible, tuple(x.tolist())))
    known = Arguments(scene, base, arguments, results, needed=False)
    program, p = known.program, ca.MX.sym("arguments", known.size)
    outputs = Outputs(results, program, known.undeformed(p), None)
    positions = {member: outputs.value(answer_name(f"members.{member}.position")) for member in flexible}
    pushes = [outputs.push(point) / base.scales.force for point in points]
    found = [ca.if_else(push > NO_PUSH, push, -FAR) for push in pushes]
    places = [(point, outputs.place(point, 0)) for point in points]
    along = [(free, outputs.place(point, side)) for point in points for side, free in enumerate(point.slides)]
    found += [end for free, at in along if free for end in (at, 1.0 - at)]

    def ends_of(member: str) -> ca.MX:
        nodes = scene.members[member].nodes
        return ca.vertcat(*(outputs.value(answer_name(f"nodes.{node}.position")) for node in nodes))

    nearby = Closest(scene).nearby(base)
    for number, pair in enumerate(nearby.pairs):
        share = np.stack([1.0 - x, x], axis=1)
        lines = [positions[m] if m in positions else ca.mtimes(share, ends_of(m)) for m in pair.members]
        left_out: ca.MX | ca.DM = ca.DM(_next_to(nearby, number, x).astype(float))
        for point, _ in (one for one in places if one[0].pair == pair.key):
            close = [ca.fabs(ca.DM(x) - outputs.place(point, side)) <= BESIDE / (SAMPLES - 1) for side in (0, 1)]
            left_out = ca.logic_or(left_out, ca.mtimes(close[0], close[1].T))
        for squares, rows, columns in _squares(*lines):
            gaps = (ca.sqrt(ca.fmax(squares, 0.0)) - pair.distance) / scene.size
            found.append(ca.mmin(ca.if_else(left_out[rows, columns], FAR, gaps)))
    for (contact, member), at in near.items():
        if scene.contacts[contact].between_members:
            continue
        here = positions[member] if member in positions else ends_of(member)
        if contact in carriers:
            node = carriers[contact]
            place, turn = (outputs.value(answer_name(f"nodes.{node}.{key}")) for key in ("position", turned))
            here = _seen(here, scene.nodes[node].position, place, turn)
        gaps = _gaps(base, contact, here) / scene.size
        gaps = _least(gaps) if len(at) > 2 else gaps
        for touched in (place for point, place in places if point.pair == (contact, (member,))):
            gaps = ca.if_else(ca.fabs(ca.DM(at) - touched) <= BESIDE / (SAMPLES - 1), FAR, gaps)
        found.append(gaps)
    margins = ca.densify(ca.vertcat(*found))
    return ca.Function(
        name, [p, program.state_symbol, program.symbol], [margins], ["arguments", "state", "given"], ["margins"]
    )


def _refuse(base: Model, arguments: Sequence[Argument]) -> None:
    """Refuse contacts and arguments of which it cannot be told whether the same touches."""
    scene = base.scene
    for name, contact in scene.contacts.items():
        edge = not contact.between_members and scene.obstacles[name].kind == "sharp"
        what = "an edge without member_radius" if edge else ""
        curved = [
            m
            for m in members_of(contact, scene.members)
            if scene.members[m].type == "rigid" and scene.center_lines[m].turning
        ]
        what = what or (f"the curved rigid member {curved[0]!r}" if curved else "")
        if what:
            message = f"found {what}, which is not exported, accepted: planes and what is round, with flexible"
            raise SceneError(f"{message} or straight members", ("contacts", name))
    for one in arguments:
        if one.name.startswith("contacts.") or one.numbers is not None:
            message = "found a number of an obstacle, or one that others follow, accepted beside contact: numbers of"
            raise SceneError(f"{message} loads, motions, members and nodes", ("arguments", one.name))


def _seen(here: ca.MX, begin: Sequence[float], place: ca.MX, turn: ca.MX) -> ca.MX:
    """Positions (n, 3), m, as an obstacle sees them that a node carries, which began at a place and is at another.

    ``turn`` is the rotation of the node since then, an angle or a quaternion.
    """
    axes = 3 if turn.numel() > 1 else 2
    matrix, rotate = ca.MX.eye(3), turned_vector(axes == 3)
    for k in range(axes):
        matrix[:axes, k] = rotate(ca.vec(turn), ca.DM.eye(axes)[:, k])
    n = here.shape[0]
    out = here - ca.repmat(ca.reshape(place, 1, 3), n, 1)
    return ca.mtimes(out, matrix) + ca.repmat(ca.DM([*begin, 0.0][:3]).T, n, 1)


def _gaps(base: Model, contact: str, here: ca.MX) -> ca.MX:
    """Gaps (n,), m, of positions (n, 3) from an obstacle."""
    stop, n = base.scene.obstacles[contact], here.shape[0]
    out = here - ca.repmat(ca.DM(stop.place).T, n, 1)
    if stop.kind == "flat":
        distance = ca.mtimes(out, ca.DM(stop.normal))
    else:
        across = ca.mtimes(out, ca.DM(stop.across))
        distance = stop.sign * (ca.sqrt(ca.sum2(across**2)) - stop.radius)
    return distance - base.scene.contacts[contact].member_radius


def _next_to(nearby: Nearby, number: int, x: Array) -> Array:
    """Whether places (n, n) at fractions (n,) of both members of a pair, or those beside them, as which a parabola sees
    them, are too near along these to touch, of bool.
    """
    s, t = (part.ravel() for part in np.meshgrid(x, x, indexing="ij"))
    a, b = (nearby.lines.members.index(member) for member in nearby.pairs[number].members)
    whole = np.full(len(s), number)
    found = nearby.apart(Places(whole, nearby.lines.at(a, s), nearby.lines.at(b, t), whole))
    next_to = np.pad(~found.reshape(len(x), len(x)), 1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(next_to, (3, 3)).any(axis=(2, 3)))


def _squares(one: ca.MX, other: ca.MX) -> Iterator[tuple[ca.MX, slice, slice]]:
    """Squares of distances of places (n, 3) from places (n, 3), as little as between these, and which ones they are.

    They are those of parabolas: along the first line, along the other one, and along both where they are not parallel.
    """
    n, inner, every = one.shape[0], slice(1, -1), slice(None)
    square = ca.repmat(ca.sum2(one**2), 1, n) + ca.repmat(ca.sum2(other**2).T, n, 1) - 2.0 * ca.mtimes(one, other.T)
    yield _lowest(square[:-2, :], square[1:-1, :], square[2:, :]), inner, every
    yield _lowest(square[:, :-2], square[:, 1:-1], square[:, 2:]), every, inner
    f, rows, columns = square[1:-1, 1:-1], (square[2:, 1:-1], square[:-2, 1:-1]), (square[1:-1, 2:], square[1:-1, :-2])
    slopes = [0.5 * (after - before) for after, before in (rows, columns)]
    bends = [after - 2.0 * f + before for after, before in (rows, columns)]
    twist = 0.25 * (square[2:, 2:] - square[2:, :-2] - square[:-2, 2:] + square[:-2, :-2])
    both = bends[0] * bends[1] - twist**2
    steps = bends[1] * slopes[0] - twist * slopes[1], bends[0] * slopes[1] - twist * slopes[0]
    # The parabola is right near its middle.
    near = ca.logic_and(ca.fabs(steps[0]) <= both, ca.fabs(steps[1]) <= both)
    below = (slopes[0] * steps[0] + slopes[1] * steps[1]) / (2.0 * ca.if_else(near, ca.fmax(both, 1e-300), 1.0))
    yield f - ca.if_else(near, below, 0.0), inner, inner
    yield square[:: n - 1, :: n - 1], slice(None, None, n - 1), slice(None, None, n - 1)


def _least(gaps: ca.MX) -> ca.MX:
    """Gaps (n,) at places, in whose middle those that are less than both beside them are as little as a parabola."""
    return ca.vertcat(gaps[0], _lowest(gaps[:-2], gaps[1:-1], gaps[2:]), gaps[-1])


def _lowest(before: ca.MX, here: ca.MX, after: ca.MX) -> ca.MX:
    """What is at places, in whose middle it is as little as a parabola where it is less than beside them."""
    bend, slope = before - 2.0 * here + after, after - before
    lowest = ca.logic_and(here <= before, here <= after)
    return ca.if_else(ca.logic_and(lowest, bend > 0.0), here - slope**2 / (8.0 * ca.fmax(bend, 1e-300)), here)
