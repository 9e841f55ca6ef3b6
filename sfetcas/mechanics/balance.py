"""Balance of nodes: reactions of supports, forces of springs and small members, moments inside rigid members.

Every force and moment here is what one term takes from its surroundings; at a node they add up to the load and
the reaction, see :mod:`~sfetcas.mechanics.reactions`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.keeping import kept
from .batches import GroupBatch
from .connections import connections_of, row_of
from .equations import Equations, State
from .loading import Loading
from .reactions import shares_rotation
from .segments import SIDES, elongation_of
from .tendon_chains import part_of
from .terms import answers_of

__all__ = ["Balance", "SpringState", "three"]

GROUPS = 64
"""Groups of connections of which something is kept at hand."""


@dataclass(frozen=True)
class SpringState:
    """The state of a spring; force and moment act on its second party.

    Attributes
    ----------
    rotational : bool
    travel : float
        Angle, rad; elongation, or displacement along its direction, m.
    effort : float
        Moment, N m, or force, N.
    stop : float or None
        Moment or force of its stop, zero while it is not reached; None without a stop.
    """

    rotational: bool
    travel: float
    effort: float
    stop: float | None = None

    def to_dict(self) -> dict[str, float]:
        """The spring with the keys of the JSON answer: ``angle``, ``moment`` or ``travel``, ``force``; ``stop``."""
        names = ("angle", "moment") if self.rotational else ("travel", "force")
        found = dict(zip(names, (self.travel, self.effort), strict=True))
        return found if self.stop is None else {**found, "stop": self.stop}


def three(a: Array) -> Array:
    """Vectors (..., 2) of the plane, or (..., 3), with three components (..., 3)."""
    return a if a.shape[-1] == 3 else np.concatenate([a, np.zeros((*a.shape[:-1], 1))], axis=-1)


class Balance:
    """The balance of one state; dimensionless and with three components unless said otherwise.

    Parameters
    ----------
    places : ndarray (places, axes)
        Displacements of the places, dimensionless.
    """

    def __init__(self, equations: Equations, state: State, loading: Loading, places: Array) -> None:
        self.model, self._state, self._loading = equations.model, state, equations.acting(state, loading)
        self._reactions, self._places = equations.reactions, places
        self._shares = equations.shares(state, loading)
        self._turns = equations.model.element.turns

    # -- shares of connections ------------------------------------------------------------------

    def _three(self, moments: Array) -> Array:
        """Moments about the axes that turn as (..., 3)."""
        return np.concatenate([np.zeros((*moments.shape[:-1], 3 - self._turns)), moments], axis=-1)

    @functools.cached_property
    def _cells(self) -> Array:
        """What terms take, then couples on places and elements that are loads."""
        beside = [-part[:, 3 - self._turns :] for part in (self._loading.couple, self._loading.jump)]
        return np.concatenate([part.ravel() for part in (*self._shares, *beside)])

    @functools.cached_property
    def _left(self) -> tuple[Array, Array]:
        """Moments (rotations, 3) and forces (places, 3) that are left to supports."""
        loading, axes, turns = self._loading, self.model.element.axes, self._turns
        reactions, closings = self._reactions, len(self.model.positions.rows)
        left = reactions.left @ self._cells[: reactions.cells]
        first = turns * len(loading.moment)
        on_places = left[first:] - loading.force.ravel()
        forces = reactions.forces @ np.concatenate([on_places, self._state.lam[:closings]])
        moments = left[:first].reshape(-1, turns) - loading.moment[:, 3 - turns :]
        return self._three(moments), three(forces.reshape(-1, axes))

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force (3,) and moment about the node (3,) that the ground exerts on it."""
        moments, forces = self._left
        force = self._reactions.pushed(node) @ forces[self.model.segments.place(node)]
        if shares_rotation(self.model, node):
            return force, self._rigid.get(("node", node), np.zeros(3))
        return force, sum((fixed @ moments[turn] for turn, fixed in self._reactions.turned(node)), np.zeros(3))

    def starting_moments(self, elements: slice) -> Array:
        """Moments (n, 3) that the surroundings exert on the first nodes of elements and what runs along them."""
        return self._three(self._on_elements[elements])

    @functools.cached_property
    def _on_elements(self) -> Array:
        """Moments (elements, turns) that elements and what runs along them take from their first nodes."""
        found = self._shares[0][:, : self._turns].copy()
        for group, share in zip(self.model.terms, self._shares, strict=True):
            if group.kind.along_element:
                np.add.at(found, group.elements, share[:, : self._turns])
        return found

    def jumps(self, elements: slice) -> Array:
        """Moments (n, 3) that tendons exert on a member where its elements begin, but on the first."""
        found = np.zeros((len(self._shares[0]), self._turns))
        for number, i, side, element in self._reactions.jumping:
            found[element] -= self._shares[number][i, side * self._turns : (side + 1) * self._turns]
        return self._three(found[elements])

    def tendon(self, name: str) -> dict[str, Any]:
        """Tension, N, and length, m, of a tendon; of one that rubs tensions (pieces,) behind its pieces, too, N."""
        found: dict[str, Any] = {"tension": 0.0, "length": 0.0}
        scales, behind = self.model.scales, list[tuple[float, float, float]]()
        for number, group in enumerate(self.model.connections):
            if group.kind.table == "tendons" and name in group.names:
                own = self._answers(number)[[each == name for each in group.names]]
                found["tension"] = float(own[0, 0]) * scales.force
                found["length"] += float(own[:, 1].sum()) * scales.length
                if "piece" in group.kind.answers:
                    behind += [(number, piece, tension) for tension, piece, number in own[:, 2:5].tolist()]
        # The last part of each piece.
        tensions = {piece: tension * scales.force for _, piece, tension in sorted(behind)}
        return found | {"tensions": list(tensions.values())} if tensions else found

    def tensions(self, name: str, piece: int, element: int = -1) -> Array:
        """Tensions (points,) of a tendon that rubs at the points of an element along which a piece of its way goes, or
        where a piece begins that goes along a rigid member, dimensionless.
        """
        number, i = part_of(self.model, name, piece, element)
        return np.asarray(self._answers(number - 1)[i, 5:])

    def tube(self, name: str) -> dict[str, float]:
        """Torque, N m, of the base of a tube, angle, rad, of its front end, and energy, J."""
        found, moment = {"torque": 0.0, "angle": 0.0, "energy": 0.0}, float(self.model.scales.moment)
        for number, group in enumerate(self.model.connections):
            if group.kind.table == "tubes" and name in group.names:
                own = self._answers(number)[[each == name for each in group.names]]
                found["torque"] += float(own[:, 0].sum()) * moment
                found["energy"] += float(own[:, -1].sum()) * moment
                if group.kind.along_element:
                    found["angle"] = float(own[-1, 1])
        return found

    def rest_length(self, name: str) -> float:
        """Length of a tendon in the undeformed scene, m."""
        groups = [group for group in self.model.connections if group.kind.table == "tendons"]
        own = [group.data[[each == name for each in group.names], -2:].sum() for group in groups]
        return float(sum(own)) * self.model.scales.length

    def elongation(self, name: str) -> float:
        """Of an elastic tendon, dimensionless."""
        return float(self._places[self.model.segments.place(elongation_of(name)), 0])

    def start_moment(self, member: str) -> Array:
        """Moment (3,) that the surroundings exert on the first end of a flexible or rigid member."""
        if self.model.scene.members[member].type == "rigid":
            return self._rigid["member", member]
        first = self.model.beams.first[member]
        return np.asarray(self.starting_moments(slice(first, first + 1))[0])

    @functools.cached_property
    def _rigid(self) -> dict[tuple[str, str], Array]:
        """Moments on first ends of rigid members, and reactions of nodes that share a rotation."""
        return {key: self._three(found) for key, found in self._reactions.rigid.solved(self._cells).items()}

    # -- springs and small members ----------------------------------------------------------------

    def spring(self, name: str) -> SpringState:
        """State of a spring, in SI units."""
        found, record = self.answers("springs", name), self.model.scene.springs[name]
        state = SpringState("angle" in found, *found.values())
        if record.stop is None:
            return state
        unit, names = self.model.scales.moment if state.rotational else self.model.scales.force, self.model.row_names
        acting = [names.index(row) for side in SIDES if (row := row_of("springs", name, side)) in names]
        return replace(state, stop=0.0 - float(self._state.lam[acting].sum()) * unit)

    def answers(self, table: str, name: str) -> dict[str, float]:
        """Quantities that the terms of a record (``table``, ``name``) add to the answer, by key, in SI units."""
        return dict(self._told(table).get(name, {}))

    @kept(GROUPS)
    def _told(self, table: str) -> dict[str, dict[str, float]]:
        """As of :meth:`answers`, for all records of a table; of several terms of one kind the first tells."""
        found: dict[str, dict[str, float]] = {}
        for number, group in enumerate(self.model.connections):
            units = group.kind.answers if group.kind.table == table else {}
            if units and group.kind.largest_at is None:
                sizes = np.array([self.model.scales.of(unit) for unit in units.values()])
                rows = dict(zip(group.names[::-1], (self._answers(number) * sizes).tolist()[::-1], strict=True))
                for name, row in rows.items():
                    found.setdefault(name, {}).update(zip(units, row, strict=True))
        return found

    @functools.cached_property
    def pressed(self) -> dict[str, Array]:
        """Of each end of elements on a line, by the name of its point, push and friction where there is any (1 or 2,
        elements, points, 3) N at the points of the elements beside it.
        """
        falling, rising = found = dict[str, Array](), dict[str, Array]()
        points = len(self.model.element.points)
        for number, group in enumerate(self.model.connections):
            if group.kind.largest_at is not None:
                forces = self._answers(number) * self.model.scales.force
                forces = forces.reshape(len(forces), -1, 1, points, 3)
                found[group.kind.largest_at].update(zip(group.names, forces, strict=True))
        both = {name: np.concatenate([rising[name], falling[name]], axis=1) for name in rising.keys() & falling.keys()}
        return rising | falling | both

    @kept(GROUPS)
    def _answers(self, number: int) -> Array:
        """What all connections of a group tell, (n, answers), dimensionless."""
        model, state, group = self.model, self._state, self.model.connections[number]
        batch = GroupBatch(model, group, answers_of(group.kind), model.unwrapping.parts[number + 1])
        lam = state.lam[len(model.positions.rows) + group.labels.ravel()]
        return batch(state.q, self._places, state.unwrapped, self._loading.loads[number], lam)[0]

    def body_ends(self, member: str) -> list[tuple[Array, Array]]:
        """Force (3,) and moment (3,) that the surroundings exert on each end of a small member."""
        number, i = next(connections_of(self.model.connections, "members", member))
        count, width = self.model.connections[number].places.shape[1], self._turns
        moments, forces = np.split(self._shares[number + 1][i], [count * width])
        return list(zip(three(forces.reshape(count, -1)), self._three(moments.reshape(count, width)), strict=True))
