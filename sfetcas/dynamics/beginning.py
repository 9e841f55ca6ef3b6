"""Initial conditions of a motion: a configuration, and velocities that are compatible with the joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import tolerances
from ..description.scene import Analysis, History, Node, Scene
from ..description.sections import evaluate
from ..description.structure import SLIDING, released
from ..equilibria import statics, stops
from ..equilibria.settings import Settings
from ..equilibria.solution import Equilibrium
from ..errors import SceneError
from ..mathematics.arrays import Array, first_of_largest
from ..mechanics.equations import Equations, State
from ..mechanics.fields import rotations_along, strained_like
from ..mechanics.model import Model
from ..mechanics.relaxation import relax
from ..mechanics.tendon_chains import settle
from .stages import StageEquations

__all__ = ["at_rest", "equilibrium_before", "moving", "posed", "velocities"]


def equilibrium_before(scene: Scene, settings: Settings) -> Equilibrium:
    """The equilibrium from which a motion starts: under the loads and motions at t = 0, with those that are cut then.

    Raises
    ------
    SceneError, SolveError
        As :func:`sfetcas.equilibria.statics.solve`.
    """
    histories = scene.histories

    def now(record: Any) -> dict[str, Any]:
        if record.history is None:
            return {}
        factor = histories[record.history].factor(0.0)
        return {
            "history": None,
            **{key: _scaled(getattr(record, key), factor) for key in DRIVEN if hasattr(record, key)},
        }

    driven: dict[str, Any] = {}
    for table, name, record in scene.driven:
        if table != "tendons":
            driven.setdefault(table, {})[name] = record.model_copy(update=now(record))
    analysis = Analysis(accuracy=scene.analysis.accuracy, unstable=scene.analysis.unstable)
    nodes = {name: node.model_copy(update={"velocity": None}) for name, node in scene.nodes.items()}
    members = {name: member.model_copy(update={"spin": None, "turned": None}) for name, member in scene.members.items()}
    # Of tendons what their histories begin with.
    still = {name: history.factor(0.0) for name, history in histories.items()} if scene.tendons else {}
    driven["histories"] = {name: History(t=(0.0, 1.0), value=(factor, factor)) for name, factor in still.items()}
    tables: dict[str, Any] = {**driven, "nodes": nodes, "members": members}
    if scene.rubs:
        smooth = {name: contact.model_copy(update={"friction": 0.0}) for name, contact in scene.contacts.items()}
        tables["contacts"] = smooth
    # What acts later only, or is cut, may be all that makes a scene one in space.
    tables |= {"dimension": scene.resolved_dimension, "analysis": analysis, "expect": ()}
    before = Scene(**{**_given_keys(scene), **tables})
    out = tuple((name, "released" if name in scene.released else "pulled") for name in scene.shortenings)
    return (stops.solve_stopped(before, settings) if scene.stopped else statics.solve(before, settings, stops=out)).last


DRIVEN = ("value", "displacement", "rotation", "gradient", "moment")
"""Keys of loads, prescribed motions, actuations and fields whose values a history multiplies."""


def _given_keys(scene: Scene) -> dict[str, Any]:
    """Values by key, without what a scene has found of itself meanwhile."""
    return {key: getattr(scene, key) for key in type(scene).model_fields}


def _scaled(value: Any, factor: float) -> Any:
    if value is None:
        return None
    return tuple(_scaled(part, factor) for part in value) if isinstance(value, tuple) else factor * value


def moving(scene: Scene) -> Scene:
    """The scene during the motion: without the loads that are cut and the supports that are released at t = 0."""
    cut, released = scene.analysis.cut, scene.analysis.release
    if not cut and not released:
        return scene
    loads = {name: load for name, load in scene.loads.items() if name not in cut}
    nodes = {name: _freed(scene, name) if name in released else node for name, node in scene.nodes.items()}
    motions = {name: motion for name, motion in scene.motions.items() if motion.node not in released}
    analysis = scene.analysis.model_copy(update={"cut": (), "release": ()})
    tables: dict[str, Any] = {"loads": loads, "nodes": nodes, "motions": motions, "analysis": analysis}
    tables["dimension"] = scene.resolved_dimension
    # Rules of equilibria, as that something holds every node, are those of the scene before.
    return scene.model_copy(update=tables)


def _freed(scene: Scene, name: str) -> Node:
    """A node whose support is released: what only the support needed goes with it."""
    node = scene.nodes[name]
    free: dict[str, Any] = {"support": "free", "rotation": "fixed"}
    if not any(name in released(scene.nodes, scene.members, ends) for ends in (SLIDING, ("cylindrical",))):
        free["direction"] = None
    ends = ("hinge", "universal")
    if node.joint not in ends and name not in released(scene.nodes, scene.members, ends):
        free |= {"axis": (0.0, 0.0, 1.0), "axis2": None}
    return node.model_copy(update=free)


def at_rest(model: Model) -> State:
    """The undeformed state of a model, dimensionless."""
    q = np.zeros((len(model.rotations.kind), model.element.components))
    q[:, 0] = 1.0 if model.space else 0.0
    y, lam = np.zeros(len(model.positions.unknowns)), np.zeros(len(model.row_names))
    settle(model, q, y)
    return State(q, y, lam, np.zeros(model.unwrapping.count))


def posed(model: Model, source: Equilibrium) -> State:
    """An equilibrium as a state of another model of the same members, which may have other supports."""
    state, origin = at_rest(model), source.model
    q, moved = state.q.copy(), np.zeros((len(model.segments.places), 3))
    for name, ends in model.rotations.ends.items():
        q[list(ends)] = source.state.q[list(origin.rotations.ends[name])]
    for name in model.members:
        if model.scene.members[name].type == "flexible":
            q[model.chain(name)] = rotations_along(origin, source.state.q, name, model.along(name))
    for name, number in model.rotations.node_turn.items():
        other = origin.rotations.node_turn[name]
        if number is not None and other is not None:
            q[number] = source.state.q[other]
    for name in model.nodes:
        moved[model.segments.place(name)] = source.position(name) - np.asarray(model.scene.nodes[name].position)
    for name, places, x in _along_members(model):
        there = source.fields.positions(name, x) - model.scene.center_lines[name].positions(x)
        moved[places] = there
    shift = model.loading(0.0).shift
    u = moved[:, : model.element.axes].ravel() / model.scales.length - model.positions.B @ shift
    y = np.bincount(
        model.positions.Y.column,
        weights=model.positions.Y.value * u[model.positions.Y.row],
        minlength=len(model.positions.unknowns),
    )
    strained_like(model, y, origin, source.state.y)
    settle(model, q, y)
    relax(model, q, y)
    unwrapped = model.unwrapping.angles(q, _unwrapped(model, source))
    return State(q, y, state.lam, unwrapped)


def _unwrapped(model: Model, source: Equilibrium) -> Array:
    """Counted angles by their names."""
    known = dict(zip(source.model.unwrapping.names, source.state.unwrapped, strict=True))
    return np.array([known.get(name, 0.0) for name in model.unwrapping.names])


def _along_members(model: Model) -> list[tuple[str, list[int], Array]]:
    """Of each member of elements its places but nodes of the scene, and the fractions of its length."""
    found = []
    for name in model.members:
        parts = [part for part in model.segments.parts if part.member == name]
        cuts, first = model.mesh.cuts[name], model.beams.first[name]
        ends = [(part.start, part.elements.start - first) for part in parts]
        ends.append((parts[-1].end, len(cuts) - 1))
        inner = [(model.segments.place(place), cuts[i]) for place, i in ends if place not in model.scene.nodes]
        if inner:
            places, x = zip(*inner, strict=True)
            found.append((name, list(places), np.array(x)))
    return found


# -- velocities -------------------------------------------------------------------------------------------


def velocities(system: StageEquations, equations: Equations, state: State) -> tuple[Array, tuple[str, ...]]:
    """Initial rates of all unknowns (unknowns,), dimensionless, and notes.

    Velocities that are given are kept.  Those left open follow from the joints, with the least rates of bending, then
    of rotation and translation.

    Raises
    ------
    SceneError
        The given velocities contradict the joints or each other.
    """
    model = equations.model
    rows, wanted, names = _given(system, equations)
    rates = np.zeros(equations.unknowns)
    if not len(wanted) or not np.abs(wanted).max():
        return rates, ()
    n, closings = equations.unknowns, equations.rows
    # Without loads: theirs depend on what a rotation is measured by, and what is left open must not.
    free = State(state.q, state.y, np.zeros(closings), state.unwrapped)
    full = np.zeros((equations.total, equations.total))
    full[equations.row, equations.column] = equations.at(free, model.loading(0.0).scaled(0.0)).entries
    stiffness = 0.5 * (full[:n, :n] + full[:n, :n].T)
    values, vectors = np.linalg.eigh(stiffness)
    small = np.where(np.arange(n) < equations.rotation_unknowns, TURNING, MOVING)
    root = np.vstack([np.sqrt(np.abs(values))[:, None] * vectors.T, np.diag(small)])
    constrained = full[n:, :n]
    both = np.vstack([constrained, rows])
    right = np.concatenate([np.zeros(closings), wanted])
    # What cannot be met is missed as little as possible; then the least energy on what is given.
    u, sizes, axes = np.linalg.svd(both)
    rank = int((sizes > tolerances.RANK * sizes[0]).sum())
    rates = axes[:rank].T @ ((u[:, :rank].T @ right) / sizes[:rank])
    rest = axes[rank:].T
    rates = rates - rest @ np.linalg.lstsq(root @ rest, root @ rates, rcond=None)[0]
    missed = rows @ rates - wanted
    largest = float(np.abs(wanted).max())
    # Of those that are missed alike the one that asks for most.
    alike = np.flatnonzero(np.abs(missed) >= (1.0 - tolerances.ALIKE) * np.abs(missed).max())
    worst = int(alike[first_of_largest(wanted[alike])])
    share = float(np.abs(missed[worst])) / largest
    joints = float(np.abs(constrained @ rates).max(initial=0.0)) / largest
    if max(share, joints) > CONTRADICTION:
        other = _open_row(model, constrained @ rates) if joints > share else ""
        raise SceneError(
            f"contradicts the joints{other}: {max(share, joints):.2g} of the largest velocity cannot be met",
            names[worst],
        )
    if max(share, joints) > TOLD:
        changed = f"initial velocities were changed by up to {max(share, joints):.1e} of the largest to suit the joints"
        return rates, (changed,)
    return rates, ()


TURNING, MOVING = 1e-4, 1e-8
"""Square roots of the weights of rotation and translation beside bending, in model units, where velocities are open.

With them a body that is thrown at one node only flies without rotation, and a part without any velocity stays at rest.
"""

CONTRADICTION = 1e-3
"""Share of the largest velocity up to which given velocities are projected onto those that the joints allow."""

TOLD = 1e-9
"""Share of the largest velocity from which on a note reports such a projection."""


def _open_row(model: Model, gaps: Array) -> str:
    return f" ({model.row_names[first_of_largest(gaps)]})"


def _given(system: StageEquations, equations: Equations) -> tuple[Array, Array, list[tuple[str, ...]]]:
    """Rows of the rates of the unknowns that are given, their values, and where they stand in the scene."""
    model, scene, unit = equations.model, equations.model.scene, system.masses.time
    axes, turns = model.element.axes, model.element.turns
    if all(node.velocity is None for node in scene.nodes.values()) and all(
        member.spin is None for member in scene.members.values()
    ):
        # Of many members the tables below would be large.
        return np.zeros((0, equations.unknowns)), np.zeros(0), []
    rows: list[Array] = []
    values: list[Array] = []
    names: list[tuple[str, ...]] = []
    moving_of = np.zeros((len(model.segments.places) * axes, equations.unknowns))
    y = model.positions.Y
    moving_of[y.row, equations.rotation_unknowns + y.column] = y.value
    turning_of = np.zeros((system.of_places, equations.unknowns))
    used = np.flatnonzero(system.unknown[: system.of_places] >= 0)
    turning_of[used, system.unknown[used]] = system.weight[used]
    for name, node in scene.nodes.items():
        if node.velocity is not None:
            place = model.segments.place(name)
            rows.append(moving_of[axes * place : axes * (place + 1)])
            values.append(np.asarray(node.velocity)[:axes] * unit / model.scales.length)
            names += [("nodes", name, "velocity")] * axes
    for name, member in scene.members.items():
        if member.spin is None:
            continue
        slender = name in model.beams.first
        chain = model.chain(name) if slender else np.array(model.rotations.ends[name])
        # Of a small member the nodes, as many as it has, stand for equal parts.
        x = model.along(name) if slender else np.linspace(0.0, 1.0, len(chain))
        chain, first = np.unique(chain, return_index=True)
        spins = _spins(member.spin, x[first], model.scene.center_lines[name].length) * unit
        for number, spin in zip(chain.tolist(), spins, strict=True):
            rows.append(turning_of[turns * number : turns * (number + 1)])
            values.append(spin[3 - turns :])
            names += [("members", name, "spin")] * turns
    # A motion begins relaxed, so that nothing of it relaxes yet.
    for place in (number for number in model.segments.relaxing.flat if number >= 0):
        own = moving_of[axes * place : axes * (place + 1)]
        rows.append(own)
        values.append(np.zeros(len(own)))
        names += [("sections",)] * len(own)
    return np.concatenate(rows), np.concatenate(values), names


def _spins(spin: Any, x: Array, length: float) -> Array:
    """Angular velocities (n, 3) along a member of a length in m."""
    if isinstance(spin, tuple):
        return np.tile(np.asarray(spin, dtype=float), (len(x), 1))
    about = evaluate(spin, x, length)
    return np.stack([np.zeros(len(x)), np.zeros(len(x)), about], axis=1)
