"""What a state means along the members: positions, rotations, section forces and moments at any place.

Section forces and moments come from equilibrium, not from the derivative of the rotations: the moment at the
first node of a member is minus the gradient of its energy there, and the rest follows by integrating
``m' = -r' x n``.  They are therefore as accurate as the positions, of order 2p at the element ends.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from . import interpolation, quaternion
from .arrays import Array
from .balance import Balance, SpringState
from .balance import three as _three
from .equations import Equations, State
from .loading import Loading

__all__ = ["Fields", "rotations_along", "transferred"]


class Fields:
    """Fields of one state of a model.  All results are in SI units and fixed axes, with three components."""

    def __init__(self, equations: Equations, state: State, loading: Loading) -> None:
        self.model, self._state, self._applied = equations.model, state, loading
        self._loading = loading = equations.effective(state, loading)
        self._equations = equations
        self.q = state.q
        model = self.model
        self.turned = _turned_tangents(equations, state)
        reach = self.turned.sum(axis=1)
        nodal, _ = equations.displacements(state, loading, reach)
        self._nodal = nodal.reshape(len(model.segments.places), -1)
        self._pull = loading.pull + equations.segment_pulls(state.lam, loading)[model.segments.owner][:, None, :]

    @functools.cached_property
    def balance(self) -> Balance:
        """The balance of the nodes."""
        parts, loading = self.model.segments.parts, self._loading
        starts = [self._start_forces(part.elements) for part in parts]
        last = [loading.spread[part.elements][-1].sum(axis=0) for part in parts]
        ends = [force[-1] - spread for force, spread in zip(starts, last, strict=True)]
        starts = [force[0] for force in starts]
        return Balance(self._equations, self._state, self._applied, starts, ends, self._nodal)

    # -- nodes ----------------------------------------------------------------------------------

    def position(self, node: str) -> Array:
        """Position of a node, m."""
        moved = _three(self._nodal[self.model.nodes.index(node)]) * self.model.scales.length
        return np.asarray(self.model.scene.nodes[node].position, dtype=float) + moved

    def rotation(self, node: str) -> Array | None:
        """Quaternion (4,) or, in the plane, angle (1,) of a node since the undeformed scene; None if it has none."""
        number = self.model.rotations.node_turn[node]
        return None if number is None else self._state.q[number]

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force (N) and moment about the node (N m) that the ground exerts on a supported node."""
        force, moment = self.balance.reaction(node)
        return force * self.model.scales.force, moment * self.model.scales.moment

    def spring(self, name: str) -> SpringState:
        """A spring of the scene."""
        return self.balance.spring(name)

    # -- members --------------------------------------------------------------------------------

    def along(self, member: str, x: Array, *, dimensionless: bool = False) -> dict[str, Array]:
        """Fields at fractions x of a member's length.

        Returns
        -------
        dict
            ``position`` (n, 3) m, ``rotation`` (n, 4) or (n, 1) since the undeformed scene, ``force`` (n, 3) N
            and ``moment`` (n, 3) N m of what is beyond on what is before, ``curvature`` (n, 3) 1/m about the
            section's axes b1, b2, b3.
        """
        model, element = self.model, self.model.element
        x = np.asarray(x, dtype=float)
        if model.scene.members[member].type == "small":
            return self._along_body(member, x)
        part, cuts = model.elements_of(member), model.mesh.cuts[member]
        e, xi = _located(cuts, x)
        to_x = _per_place(xi, lambda places: interpolation.integration(element.points, places)) / element.weights
        turned, spread = self.turned[part], self._loading.spread[part]
        rest = model.beams.tangent[part]
        here = np.einsum("nk,nka->na", to_x, (turned - rest)[e])
        start, moments = self._element_starts(member)
        line = model.scene.center_lines[member]
        position = line.positions(x) + _three(start[e] + here) * model.scales.length
        force = _three(self._start_forces(part)[e] - np.einsum("nk,nka->na", to_x, spread[e]))
        # m' = -r' x n; the pull at the points is minus the force there.
        couple = _cross(turned, self._pull[part])
        moment = moments[e] + np.einsum("nk,nka->na", to_x, couple[e])
        rotation = rotations_along(model, self._state.q, member, x)
        frames = self._frames(member, x, rotation)
        result = {"position": position, "rotation": rotation, "force": force, "moment": moment}
        if dimensionless:
            return result
        result["force"] = force * model.scales.force
        result["moment"] = moment * model.scales.moment
        strain = np.einsum("nij,ni->nj", frames, result["moment"])
        record = model.scene.members[member]
        if record.type == "rigid":
            return {**result, "curvature": line.curvatures(x)}
        stiffness = model.scene.sections[str(record.section)].stiffness(x)
        with np.errstate(invalid="ignore"):
            strain = np.where(np.isnan(stiffness), 0.0, strain / stiffness)
        result["curvature"] = line.curvatures(x) + strain
        return result

    def _frames(self, member: str, x: Array, rotation: Array) -> Array:
        """Section axes as columns, (n, 3, 3)."""
        line = self.model.scene.center_lines[member]
        if not self.model.space:
            zero = np.zeros(len(x))
            vectors = np.stack([zero, zero, rotation[:, 0]], axis=-1)
            rotation = quaternion.from_rotation_vector(vectors)
        return quaternion.matrix(quaternion.multiply(rotation, line.quaternions(x)))

    def _along_body(self, member: str, x: Array) -> dict[str, Array]:
        """Fields of a small member: its ends, and between them the shape of a beam that carries no load."""
        model = self.model
        line, ends = model.scene.center_lines[member], model.rotations.ends[member]
        numbers = [ends[0], ends[-1]]
        places = [model.segments.place(model.segments.ends[member, i]) for i in (0, len(ends) - 1)]
        moved = _three(self._nodal[places]) * model.scales.length
        turned = self._state.q[numbers]
        if not model.space:
            turned = quaternion.from_rotation_vector(np.pad(turned, ((0, 0), (2, 0))))
        signed = turned[1] * (1.0 if turned[0] @ turned[1] >= 0.0 else -1.0)
        # Rotations go linearly from end to end; the rigid motion with them is corrected to meet the second end.
        mixed = (1.0 - x)[:, None] * turned[0] + x[:, None] * signed
        mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
        mean = turned[0] + signed
        mean /= np.linalg.norm(mean)
        rest = line.positions(np.concatenate([[0.0], x, [1.0]]))
        rigid = rest[0] + moved[0] + quaternion.rotate(mean, rest - rest[0])
        miss = rest[-1] + moved[1] - rigid[-1]
        bent = x**2 * (3.0 - 2.0 * x)
        chord = quaternion.rotate(mean, line.tangents(x)) * line.length
        spins = [2.0 * quaternion.multiply(q, quaternion.conjugate(mean))[1:] for q in (turned[0], signed)]
        hermite = (x * (1.0 - x) ** 2)[:, None] * np.cross(spins[0], chord) - (x**2 * (1.0 - x))[:, None] * np.cross(
            spins[1], chord
        )
        position = rigid[1:-1] + bent[:, None] * miss + hermite
        wrenches = self.balance.body_ends(member)
        force, moment = ((1.0 - x)[:, None] * -wrenches[0][k] + x[:, None] * wrenches[-1][k] for k in range(2))
        if model.space:
            rotation = mixed
        else:
            rotation = ((1.0 - x) * self._state.q[ends[0], 0] + x * self._state.q[ends[-1], 0])[:, None]
        scaled = {"force": force * model.scales.force, "moment": moment * model.scales.moment}
        return {"position": position, "rotation": rotation, **scaled, "curvature": line.curvatures(x)}

    def _start_forces(self, part: slice) -> Array:
        """Internal force at the start of each of consecutive elements, (elements, axes)."""
        element = self.model.element
        spread = self._loading.spread[part]
        # The pull at the first point is minus the force there; the spread load is distributed as in its adjoint.
        beyond = np.einsum("j,eja->ea", element.to_points[:, 0], spread) / element.weights[0]
        return -self._pull[part][:, 0] - beyond + spread.sum(axis=1)

    @functools.cache  # noqa: B019 - lives as long as the fields
    def _element_starts(self, member: str) -> tuple[Array, Array]:
        """Displacement and moment at the start of each element of a member (and its end)."""
        model = self.model
        part = model.elements_of(member)
        turned = self.turned[part]
        first = self._nodal[model.segments.place(model.segments.ends[member, 0])]
        steps = (turned - model.beams.tangent[part]).sum(axis=1)
        starts = first + np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
        gains = _cross(turned, self._pull[part]).sum(axis=1)
        chain = model.rotations.turns[part]
        # A couple at a cut is a jump of the moment.
        if model.scene.members[member].type == "rigid":
            gains[:-1] -= self._loading.jump[part][1:]
        else:
            gains[:-1] -= self._loading.moment[chain[1:, 0]]
        start = self.balance.start_moment(member)
        moment = -start
        moments = moment + np.concatenate([np.zeros((1, 3)), np.cumsum(gains, axis=0)])
        return starts, moments


def _located(cuts: Array, x: Array) -> tuple[Any, Array]:
    """Element of each fraction, and the place in it."""
    e = np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2)
    return e, (x - cuts[e]) / (cuts[e + 1] - cuts[e])


def _per_place(xi: Array, rows: Any) -> Array:
    """Rows of a matrix for places that often repeat."""
    places, inverse = np.unique(xi, return_inverse=True)
    return np.asarray(rows(places)[inverse])


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors in the plane or in space, (..., 3)."""
    return np.cross(_three(a), _three(b))


def _turned_tangents(equations: Equations, state: State) -> Array:
    """Turned tangents times weight and length at the integration points, (elements, points, axes)."""
    model, element = equations.model, equations.model.element
    q = state.q[model.rotations.turns]
    if element.gauss:
        q = np.einsum("kj,ejc->ekc", interpolation.evaluation(element.nodes, element.points), q)
    if model.space:
        return quaternion.rotate(q / np.linalg.norm(q, axis=-1, keepdims=True), model.beams.tangent)
    c, s = np.cos(q[..., 0]), np.sin(q[..., 0])
    t = model.beams.tangent
    return np.stack([c * t[..., 0] - s * t[..., 1], s * t[..., 0] + c * t[..., 1]], axis=-1)


def rotations_along(model: Any, q: Array, member: str, x: Array) -> Array:
    """Rotations at fractions x of a member, (n, 4) unit or (n, 1)."""
    e, xi = _located(model.mesh.cuts[member], x)
    nodal = q[model.rotations.turns[model.elements_of(member)]]
    rows = _per_place(xi, lambda places: interpolation.evaluation(model.element.nodes, places))
    values = np.einsum("nj,njc->nc", rows, nodal[e])
    return values / np.linalg.norm(values, axis=-1, keepdims=True) if model.space else values


def transferred(source: Any, state: State, target: Any) -> State:
    """A state of one mesh on another mesh of the same scene.

    Displacements and multipliers go by their names; those that the other mesh does not have are left zero.
    """
    q = np.zeros((len(target.rotations.kind), target.element.components))
    for name, ends in target.rotations.ends.items():
        q[list(ends)] = state.q[list(source.rotations.ends[name])]
    for name in target.members:
        q[target.chain(name)] = rotations_along(source, state.q, name, target.along(name))
    for name, number in target.rotations.node_turn.items():
        if number is not None and source.rotations.node_turn[name] is not None:
            q[number] = state.q[source.rotations.node_turn[name]]
    y = _by_name(source.positions.unknowns, state.y, target.positions.unknowns)
    lam = _by_name(source.row_names, state.lam, target.row_names)
    return State(q, y, lam)


def _by_name(names: tuple[str, ...], values: Array, wanted: tuple[str, ...]) -> Array:
    """Values by their names; names that repeat go in their order."""
    if names == wanted:
        return values.copy()
    known: dict[tuple[str, int], float] = {}
    count: dict[str, int] = {}
    for name, value in zip(names, values, strict=True):
        count[name] = count.get(name, 0) + 1
        known[name, count[name]] = float(value)
    count, found = {}, []
    for name in wanted:
        count[name] = count.get(name, 0) + 1
        found.append(known.get((name, count[name]), 0.0))
    return np.array(found)
