"""What an equilibrium depends on, in one row of numbers: data that vary, loads, motions.

Rows are what the globalised Newton method takes, in process, in batches and in generated C: see ``sf_inputs`` of the
core.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.constants import times
from .equations import Equations, State
from .expressions import Expressions, Given
from .loading import Loading
from .rotations import RotationFreedom

__all__ = ["Inputs", "Taken"]


class Taken(NamedTuple):
    """A row of inputs, taken apart.

    Attributes
    ----------
    equations : Equations
        With the data of the row.
    given : ndarray (given,)
        Loads and motions, as of :meth:`~sfetcas.mechanics.equations.Equations.given`.
    vectors : ndarray (turned, 3)
        Prescribed rotation vectors, rad.
    angles : ndarray (angles,)
        Values near which angles count turns in the undeformed state, rad; where they are prescribed always.
    """

    equations: Equations
    given: Array
    vectors: Array
    angles: Array


class Inputs:
    """What a row of inputs has: data of groups of terms, what is given, rotation vectors, angles; all dimensionless.

    Parameters
    ----------
    equations : Equations
    varying : sequence of int, optional
        Numbers of the groups of terms whose data are in the row; those of all others are the model's.

    Attributes
    ----------
    data : int
        How many numbers of a row are data.
    turned : ndarray (turned,)
        Numbers of the rotations that are prescribed.
    held : ndarray (angles,) of bool
        Which angles that count turns are prescribed.
    couples : list of int
        Numbers of the groups of terms whose loads are moments.
    """

    def __init__(self, equations: Equations, varying: Sequence[int] = ()) -> None:
        self.equations, self.varying, model = equations, list(varying), equations.model
        self.turned = np.flatnonzero(model.rotations.kind == RotationFreedom.FIXED)
        self.held = model.unwrapping.held(model.rotations.kind)
        self.couples = [i for i, group in enumerate(model.terms) if i and group.kind.is_couple]
        sizes = [model.terms[i].data.size for i in self.varying]
        self.data = sum(sizes)
        given = equations.layout.given["force"].stop
        self._bounds = np.cumsum([*sizes, given, 3 * len(self.turned)]).tolist()

    @property
    def size(self) -> int:
        """Numbers of a row."""
        return int(self._bounds[-1]) + self.equations.model.unwrapping.count

    @property
    def parts(self) -> dict[str, slice]:
        """Where the parts of what is given are in a row, by their names in the layout, and the ``vectors``."""
        given = {
            name: slice(self.data + part.start, self.data + part.stop)
            for name, part in self.equations.layout.given.items()
        }
        return {**given, "vectors": slice(*self._bounds[-2:])}

    def of(self, loading: Loading, equations: Equations | None = None) -> Array:
        """The row of a loading; or that of other ``equations`` of this structure, with their data."""
        equations = equations or self.equations
        model, given = equations.model, equations.given(loading)
        unwrapping = model.unwrapping
        angles, prescribed = unwrapping.of_vectors(loading.turn), unwrapping.prescribed(model.rotations.kind, loading)
        data = [model.terms[i].data.ravel() for i in self.varying]
        after = [loading.turn[self.turned].ravel(), np.where(np.isnan(prescribed), angles, prescribed)]
        return np.concatenate([*data, given, *after])

    def expression(self, expressions: Expressions, given: Given, angles: ca.MX) -> ca.MX:
        """The row (size,) as an expression of all data and loads, with the angles (angles,)."""
        positions, equations = expressions.model.positions, self.equations
        data = [expressions.data(0, given, ca.MX()) if i == 0 else given.data[i - 1] for i in self.varying]
        beside = ca.MX.zeros(equations.total)
        if equations.displacement_unknowns:
            beside[equations.rotation_unknowns : equations.unknowns] = -times(positions.Y.T, given.force)
        parts = [*data, given.pull, *given.loads, times(positions.B, given.shift), times(positions.BZ, given.shift)]
        turn = ca.reshape(given.turn, 3, len(expressions.model.rotations.kind))
        parts += [beside, given.force, turn[:, self.turned.tolist()], angles]
        return ca.densify(ca.vertcat(*(ca.vec(part) for part in parts)))

    def taken(self, row: Array) -> Taken:
        """A row, taken apart; with data of its own the equations are others, which the core does not evaluate."""
        *data, given, vectors, angles = np.split(row, self._bounds)
        equations = self.equations
        if data:
            groups = equations.model.terms
            pairs = zip(self.varying, data, strict=True)
            equations = equations.with_data({i: part.reshape(groups[i].data.shape) for i, part in pairs})
        return Taken(equations, given, vectors.reshape(-1, 3), angles)

    def turns(self, row: Array) -> bool:
        """Whether there are moments."""
        given, parts = row[self.data :], self.equations.layout.given
        return any(given[parts[f"loads {i - 1}"]].any() for i in self.couples)

    def shared(self, row: Array, share: float) -> Array:
        """The same with a share of all loads and motions."""
        return np.concatenate([row[: self.data], share * row[self.data :]])

    @property
    def rest(self) -> State:
        """The undeformed state without motions."""
        return self.equations.start(self.equations.model.loading(0.0, 0.0))

    def begun(self, taken: Taken) -> State:
        """The undeformed state with what is prescribed."""
        state = self.rest
        return self.holding(State(state.q, state.y, state.lam, taken.angles), taken)

    def holding(self, state: State, taken: Taken) -> State:
        """A state with prescribed rotations and angles at their values, quaternions normalised."""
        q, model = state.q.copy(), self.equations.model
        if model.space:
            # However large those of a start are that somebody gives.
            q /= np.abs(q).max(axis=1, keepdims=True)
            q /= np.linalg.norm(q, axis=1, keepdims=True)
        q[self.turned] = model.prescribed_rotations(taken.vectors)
        return State(q, state.y, state.lam, np.where(self.held, taken.angles, state.unwrapped))
