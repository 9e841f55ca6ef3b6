"""Loads without potential: forces that turn with a section, and moments in space.

At a state they are dead loads of their present size; what they add to the Newton matrix is how they change when
what they follow turns.  For a rotation vector ``phi`` about the fixed axes a following force changes by
``phi x f``.  A moment ``C`` fixed in space does not change, a following one by ``phi x C``; in the symmetric form
in which all moments of a node are differentiated (half the commutator of two rotations is left out, and these
halves cancel in balance) they count with minus and plus half of the matrix of ``C x``.

Source: Barraco and Munteanu, Part 1, section 4 (virtual work); Argyris 1982 (moments that are not conservative).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.quaternion import cross_matrix
from .loading import Loading, carried
from .model import Model

__all__ = ["Work"]


class Work:
    """Loads without potential of one model: their present size, and entries of the Newton matrix.

    Attributes
    ----------
    row, column : ndarray
        Places of the entries, -1 where a side is held.
    """

    def __init__(self, model: Model, number: Index, place_number: Index, basis: dict[int, Array]) -> None:
        self._model, self._basis = model, basis
        if model.element.gauss and len(model.followers.elements):
            raise SceneError("distributed followers need integration at the nodes, found Gauss integration")
        followers = model.followers
        places = [np.searchsorted(model.segments.first, e) for e in followers.elements]
        starts = np.array([model.segments.place(model.segments.parts[i].start) for i in places], dtype=np.intp)
        width = model.rotations.turns.shape[1] * model.element.turns
        along = number[model.rotations.turns[followers.elements]].reshape(len(starts), width)
        local = np.concatenate([place_number[starts], along], axis=1)
        rows, columns = [], []

        def add(r: Array, c: Array) -> None:
            shape = np.broadcast_shapes(r[:, :, None].shape, c[:, None, :].shape)
            rows.append(np.broadcast_to(r[:, :, None], shape).ravel())
            columns.append(np.broadcast_to(c[:, None, :], shape).ravel())

        add(place_number[followers.places], number[followers.turns])
        add(local, along)
        if model.space:
            add(number, number)
        self.row, self.column = np.concatenate(rows), np.concatenate(columns)

    # -- present size -----------------------------------------------------------------------------

    def _turned(self, q: Array, vectors: Array) -> Array:
        """Vectors (..., axes) turned by rotations (..., components)."""
        if self._model.space:
            return quaternion.rotate(q, vectors)
        c, s = np.cos(q[..., 0]), np.sin(q[..., 0])
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack([c * x - s * y, s * x + c * y], axis=-1)

    def _forces(self, state_q: Array, loading: Loading) -> Array:
        return self._turned(state_q[self._model.followers.turns], loading.following)

    def _along(self, state_q: Array, loading: Loading) -> Array:
        elements = self._model.followers.elements
        return self._turned(state_q[self._model.rotations.turns[elements]], loading.tangential[elements])

    def effective(self, state_q: Array, loading: Loading) -> Loading:
        """The loading with what follows turned as it is at these rotations, and nothing left that follows."""
        model, followers = self._model, self._model.followers
        force, own = loading.force.copy(), loading.own.copy()
        pull, spread, moment = loading.pull, loading.spread, loading.moment
        forces = self._forces(state_q, loading)
        np.add.at(force, followers.places, forces)
        np.add.at(own, followers.places, forces)
        if len(followers.elements):
            along = np.zeros_like(spread)
            along[followers.elements] = self._along(state_q, loading)
            more, on_places = carried(along, model.segments, model.element)
            pull, spread, force = pull + more, spread + along, force + on_places
        couple = loading.couple
        if loading.twist.any():
            moment = moment + self._turned(state_q, loading.twist)
            couple = couple + self._turned_couples(state_q, loading)
        gone = ("twist", "couple_twist", "following", "tangential")
        nothing = {name: np.zeros_like(getattr(loading, name)) for name in gone}
        now = {"force": force, "own": own, "pull": pull, "spread": spread, "moment": moment, "couple": couple}
        return replace(loading, **now, **nothing)

    def _turned_couples(self, state_q: Array, loading: Loading) -> Array:
        """Moments that act on nodes and follow them, as they are now."""
        couples = np.zeros_like(loading.couple_twist)
        for place in np.flatnonzero(loading.couple_twist.any(axis=1)):
            turn = self._model.rotations.node_turn[self._model.segments.places[place]]
            couples[place] = self._turned(state_q[turn], loading.couple_twist[place])
        return couples

    # -- entries ----------------------------------------------------------------------------------

    def entries(self, state_q: Array, loading: Loading, *, convex: bool = False) -> Array:
        """Entries at :attr:`row` and :attr:`column`: minus the derivative of the loads; zero with ``convex``."""
        if convex:
            return np.zeros(len(self.row))
        parts = [self._of_forces(state_q, loading), self._of_spread(state_q, loading)]
        if self._model.space:
            parts.append(self._of_moments(state_q, loading))
        return np.concatenate([part.ravel() for part in parts])

    def _derivative(self, forces: Array) -> Array:
        """Minus the derivative of turned vectors by the rotation, (..., axes, turns)."""
        if self._model.space:
            return cross_matrix(forces)
        return np.stack([forces[..., 1], -forces[..., 0]], axis=-1)[..., None]

    def _on_bases(self, matrices: Array, turns: Index) -> Array:
        """Columns (n, rows, 3) by rotations, those about held axes first about these."""
        for n, turn in enumerate(turns):
            if int(turn) in self._basis:
                matrices[n] = matrices[n] @ self._basis[int(turn)]
        return matrices

    def _of_forces(self, state_q: Array, loading: Loading) -> Array:
        return self._on_bases(self._derivative(self._forces(state_q, loading)), self._model.followers.turns)

    def _of_spread(self, state_q: Array, loading: Loading) -> Array:
        model, element = self._model, self._model.element
        elements = model.followers.elements
        forces = self._along(state_q, loading)
        change = self._derivative(forces)
        n, points, axes, turns = change.shape
        on_start = change.transpose(0, 2, 1, 3).reshape(n, axes, points * turns)
        turned = self._turned(state_q[model.rotations.turns[elements]], model.beams.tangent[elements])
        arms = turned / element.weights[:, None]
        if model.space:
            moments = np.einsum("ij,ejab,eibc->ejaic", element.to_points, cross_matrix(arms), change)
        else:
            crossed = np.stack([-arms[..., 1], arms[..., 0]], axis=-1)
            moments = np.einsum("ij,ejb,eibc->ejic", element.to_points, crossed, change)
        on_turns = moments.reshape(n, points * turns, points * turns)
        result = np.concatenate([on_start, on_turns], axis=1)
        for e in range(n):
            for k, turn in enumerate(model.rotations.turns[elements[e]]):
                if int(turn) in self._basis:
                    basis, part = self._basis[int(turn)], slice(turns * k, turns * (k + 1))
                    result[e, :, part] = result[e, :, part] @ basis
                    below = slice(axes + part.start, axes + part.stop)
                    result[e, below] = basis.T @ result[e, below]
        return result

    def _of_moments(self, state_q: Array, loading: Loading) -> Array:
        halves = 0.5 * (cross_matrix(self._turned(state_q, loading.twist)) - cross_matrix(loading.moment))
        for turn, basis in self._basis.items():
            halves[turn] = basis.T @ halves[turn] @ basis
        return halves
