"""Starts for optimal control: at rest, or the solution for the scene with rigid members."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .. import tolerances
from ..description.records import unknown
from ..description.scene import Scene
from ..dynamics.methods import RADAU
from ..errors import SceneError, Status
from ..mathematics.arrays import Array, Index
from ..mathematics.constants import constant
from ..mathematics.interpolation import differentiation, evaluation
from ..mathematics.nlp import Ipopt
from ..mathematics.pieces import Pieces
from ..mechanics.expressions import moved_by
from .controlled import ControlledSystem
from .statement import MotionStatement
from .transcription import GridMotion

__all__ = ["at_rest", "carried_over", "restaged", "rigid", "straight"]


def rigid(scene: Scene) -> Scene | None:
    """The scene with its flexible members made rigid; None where none is flexible, or natural curvature bends some."""
    flexible = [name for name, member in scene.members.items() if member.type == "flexible"]
    if not flexible or scene.actuations:
        return None
    table = scene.to_dict()
    table["dimension"] = scene.resolved_dimension
    for name in flexible:
        member = table["members"][name]
        member["type"] = "rigid"
        for key in ("element", "elements", "spin", "turned"):
            member.pop(key, None)
    table.pop("expect", None)
    return Scene.from_dict(table)


def at_rest(
    statement: MotionStatement, system: ControlledSystem, end: float, controls: Mapping[str, ArrayLike]
) -> GridMotion:
    """A start in which the initial state stays for all times.

    Parameters
    ----------
    end : end time, s
    controls : start values (n,) of controls, at n evenly spaced times, and of variables, in the units of the scene

    Raises
    ------
    SceneError
        There is no such control.
    """
    n, begin = len(statement.shares) * statement.stages, system.begin
    known = [*(one.name for one in statement.controls), *(one.name for one in statement.variables)]
    for name in controls:
        if name not in known:
            raise SceneError(f"guess: {unknown(name, known, 'such controls')}")
    ends = np.append(0.0, np.cumsum(statement.shares))
    at = ends if statement.order else 0.5 * (ends[:-1] + ends[1:])
    defaults = system.arguments.defaults
    columns = []
    for k, one in enumerate(statement.controls):
        values = np.atleast_1d(np.asarray(controls.get(one.name, defaults[k]), dtype=float)).ravel()
        spread = np.linspace(0.0, 1.0, len(values)) if len(values) > 1 else np.zeros(1)
        columns.append(np.clip(np.interp(at, spread, values), one.low, one.high))
    rest = defaults[len(statement.controls) :]
    variables = [float(np.ravel(controls.get(v.name, x))[0]) for v, x in zip(statement.variables, rest, strict=True)]
    still = np.zeros((n, system.quantities))
    return GridMotion(
        end=end,
        q=np.tile(begin.state.q, (n, 1, 1)),
        d=np.tile(system.start, (n, 1)),
        x=np.tile(begin.x, (n, 1)),
        v=still,
        a=still,
        unwrapped=np.tile(begin.state.unwrapped, (n, 1)),
        controls=np.stack(columns, axis=1) if columns else np.zeros((len(at), 0)),
        variables=np.array(variables),
    )


def straight(statement: MotionStatement, system: ControlledSystem, start: GridMotion) -> GridMotion:
    """A motion with uniform rotation from the initial state to one that meets the end constraints on answers.

    It is the nearest such state that meets the constraints of joints and loops, not an equilibrium; where there is
    none, or no end constraint, the start is returned.
    """
    turned = _end_shape(statement, system)
    if turned is None:
        return start
    own = system.system
    phi, q0 = ca.MX.sym("phi", len(turned)), ca.DM(system.begin.state.q.T)
    moved = ca.Function("moved", [phi], [moved_by(own, ca.MX(q0), own.spins(phi))])
    q = np.stack([np.array(moved(share * turned)).T for share in statement.fractions.ravel()])
    return _still(statement, system, start, q)


def _end_shape(statement: MotionStatement, system: ControlledSystem) -> Array | None:
    """Rotation vectors from the begin to the nearest shape that meets what is asked of answers at the end."""
    ends = {s.end.__hash__(): s for s in statement.signals.values() if s.kind == "answer"}
    rows = [
        one.relation
        for one in statement.required
        if all(s.__hash__() in ends for s in ca.symvar(one.relation.expression))
    ]
    rows = [r for r in rows if ca.symvar(r.expression)]
    if not rows:
        return None
    n, equations = system.quantities, system.system.equations
    free, rotation_unknowns = equations.unknowns, equations.rotation_unknowns
    pieces = Pieces("interpreted")
    d = pieces.unknowns("d", system.start[:free])
    still = ca.DM.zeros(n)
    whole = ca.vertcat(d.symbol, ca.DM(system.start[free:]))
    balance, _, outputs = system.stage(whole, still, still, system.arguments.defaults, system.reference)
    bounds = np.cumsum([0, *(one.size for one in system.results.results)]).tolist()
    parts = dict(zip([one.name for one in system.results.results], ca.vertsplit(outputs, bounds), strict=True))
    symbols = list(ends.values())
    values = [parts[s.name][system.picked[s.name].tolist()] for s in symbols]
    if free < system.total:
        pieces.add_expression("closings", balance[free:])
    for row in rows:
        expression = ca.substitute([row.expression], [s.end for s in symbols], values)[0]
        used = np.unique(np.array(ca.jacobian_sparsity(expression, d.symbol).row(), dtype=np.intp))
        if len(used):
            pieces.add_expression("end", expression[used.tolist()], row.low[used], row.high[used])
    if len(pieces.row_names()) > pieces.size:
        return None
    pieces.add_term("turns", ca.sumsqr(d.symbol[:rotation_unknowns]))
    result = Ipopt(1e-6, 100).solve(pieces.nlp())
    return pieces.value(d, result.x)[:rotation_unknowns] if result.status is Status.SOLVED else None


def _still(statement: MotionStatement, system: ControlledSystem, start: GridMotion, q: Array) -> GridMotion:
    """A motion through rotations (stages, rotations, components), with controls and variables of a start."""
    unwrapped = np.tile(system.begin.state.unwrapped, (len(q), 1))
    y, x = _placed(system, q, unwrapped, _numbers(statement, start))
    d = np.zeros((len(q), system.total))
    equations = system.system.equations
    d[:, equations.rotation_unknowns : equations.unknowns] = y
    v = _rates(statement, start.end / system.time, x, system.begin.x)
    a = _rates(statement, start.end / system.time, v, system.begin.v)
    return GridMotion(start.end, q, d, x, v, a, unwrapped, start.controls, start.variables)


def carried_over(
    statement: MotionStatement, stiff: ControlledSystem, course: GridMotion, system: ControlledSystem
) -> GridMotion:
    """The motion of the rigid scene as one of the flexible scene, with undeformed members."""
    source = _sources(stiff, system)
    q = np.stack(
        [
            course.q[:, k] if k >= 0 else np.tile(system.begin.state.q[i], (len(course.q), 1))
            for i, k in enumerate(source)
        ],
        axis=1,
    )
    return _still(statement, system, course, q)


def restaged(statement: MotionStatement, system: ControlledSystem, course: GridMotion, stages: int) -> GridMotion:
    """A motion given at ``stages`` stages of each interval, interpolated to the stages of the statement."""
    n, begin = len(statement.shares), system.begin
    old, new = np.append(0.0, RADAU[stages]), RADAU[statement.stages]
    through, among = evaluation(old, new), evaluation(RADAU[stages], new)

    def moved(values: Array, first: Array) -> Array:
        return np.einsum("ij,kjm->kim", through, _whole(values, first, n, stages)).reshape(n * len(new), -1)

    equations = system.system.equations
    kept = slice(equations.rotation_unknowns, equations.unknowns)
    q = moved(course.q, begin.state.q).reshape(n * len(new), *begin.state.q.shape)
    if system.model.space:
        q /= np.linalg.norm(q, axis=2, keepdims=True)
    d = np.zeros((len(q), system.total))
    d[:, kept] = moved(course.d[:, kept], begin.state.y)
    pushed = course.d[:, equations.unknowns :].reshape(n, stages, -1)
    d[:, equations.unknowns :] = np.einsum("ij,kjm->kim", among, pushed).reshape(len(q), -1)
    x = moved(course.x, begin.x)
    v = _rates(statement, course.end / system.time, x, begin.x)
    a = _rates(statement, course.end / system.time, v, begin.v)
    unwrapped = moved(course.unwrapped, begin.state.unwrapped)
    return GridMotion(course.end, q, d, x, v, a, unwrapped, course.controls, course.variables)


def _sources(stiff: ControlledSystem, system: ControlledSystem) -> Index:
    """For each rotation of the flexible scene that of the rigid one which it follows, -1 where it has none."""
    mine, its = system.model.rotations, stiff.model.rotations
    source = np.full(len(mine.kind), -1, dtype=np.intp)
    for node, number in mine.node_turn.items():
        other = its.node_turn.get(node)
        if number is not None and other is not None:
            source[number] = other
    for name, ends in mine.ends.items():
        for number, other in zip(ends, its.ends[name], strict=True):
            source[number] = other
    for name, member in system.scene.members.items():
        if member.type == "flexible":
            inner = np.setdiff1d(mine.turns[system.model.elements_of(name)].ravel(), mine.ends[name])
            source[inner] = its.ends[name][0]
    return source


def _numbers(statement: MotionStatement, course: GridMotion) -> Array:
    """Controls and variables at all stages, (stages, numbers)."""
    places, n = RADAU[statement.stages], len(statement.shares)
    if statement.order:
        first, second = course.controls[:-1, None], course.controls[1:, None]
        controls = first + (second - first) * places[None, :, None]
    else:
        controls = np.repeat(course.controls[:, None], len(places), axis=1)
    flat = controls.reshape(n * len(places), -1)
    return np.hstack([flat, np.tile(course.variables, (len(flat), 1))])


def _placed(system: ControlledSystem, q: Array, unwrapped: Array, numbers: Array) -> tuple[Array, Array]:
    """Displacements that close the members as well as they can, and quantities, of all stages."""
    own, n = system.system, system.system.layout
    s = [
        ca.MX.sym("q", n.components, n.rotations),
        ca.MX.sym("unwrapped", n.unwrapped),
        ca.MX.sym("numbers", n.factors),
    ]
    y = ca.MX.sym("y", n.y)
    given = own.given(s[2])
    prescribed = own.with_prescribed_rotations(ca.MX(s[0]), given)
    closings = len(own.model.positions.rows)
    open_ = ca.Function("open", s, [own.gaps(prescribed, ca.MX.zeros(n.y), given, s[1])[:closings]])
    moved = ca.Function("moved", [*s, y], [own.moving(prescribed, y, given, s[1])])
    # Closings are linear in displacements.
    # Of closings that depend on each other rounding leaves 1e-16.
    back = -np.linalg.pinv(
        np.array(constant(own.model.positions.W).full()).reshape(closings, n.y), rcond=tolerances.RANK
    )
    ys, xs = [], []
    for one, angles, values in zip(q, unwrapped, numbers, strict=True):
        found = back @ np.array(open_(one.T, angles, values)).ravel() if n.y else np.zeros(0)
        ys.append(found)
        xs.append(np.array(moved(one.T, angles, values, found)).ravel())
    return np.array(ys), np.array(xs)


def _whole(values: Array, begin: Array, intervals: int, stages: int) -> Array:
    """Values before each interval and at its stages, (intervals, 1 + stages, n), of those at all stages."""
    inside = values.reshape(intervals, stages, -1)
    before = np.concatenate([begin.reshape(1, -1), inside[:-1, -1]])
    return np.concatenate([before[:, None], inside], axis=1)


def _rates(statement: MotionStatement, span: float, values: Array, begin: Array) -> Array:
    """Derivatives of the collocation polynomials at all stages."""
    slopes = differentiation(np.append(0.0, RADAU[statement.stages]))[1:]
    n, s = len(statement.shares), statement.stages
    found = np.einsum("ij,kjm->kim", slopes, _whole(values, begin, n, s)) / (span * statement.shares)[:, None, None]
    return found.reshape(n * s, -1)
