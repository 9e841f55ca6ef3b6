"""How members share forces that the equations leave open, the one rule of all analyses.

Where closings depend on each other to first order, as along straight members between more supports than balance
needs, multipliers are not determined: without stretch any set of axial forces that balances will do, and critical loads
depend on which.  Chosen are those of flexible members that stretch alike: with one stiffness ``EA`` everywhere the
energy of stretch is least where the integral of the square of the axial force along them is, whatever ``EA``, and so
it is in the limit of members that do not stretch.  What this leaves open, within rigid bodies or across what turns
about held axes, stretches nothing: there the reactions of supports are the least, and then the multipliers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, State, turned_tangents
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading

__all__ = ["SHARED", "SMALLEST", "shared", "stretches"]

FELT = 1e-6
"""A combination of redundant rows that changes axial forces or reactions by less than this share changes none."""

SHARED = (
    "reactions are not unique: forces along straight members are not determined without stretch and shared as among "
    "members that stretch alike (equal EA); what is stable, and critical loads, depend on it"
)
"""The note of every analysis in which redundant rows change axial forces."""

SMALLEST = "reactions are not unique, the smallest are given"
"""What is said where redundant rows change none."""

MOST_LOOSE = 60
"""Up to so many redundant rows reactions are made least; beyond, the multipliers only."""


def shared(equations: Equations, state: State, loading: Loading, loose: Array, *, reactions: bool = False) -> State:
    """The state with the multipliers of the rule of this module.

    Parameters
    ----------
    loose : ndarray (rows, n)
        Combinations of rows that vanish here, orthonormal, of :func:`~sfetcas.solvers.redundancy.loose_rows`.
    reactions : bool
        Whether reactions are wanted: what changes them alone, and nothing that acts along a member, is left at the
        least multipliers without.
    """
    state = replace(state, lam=state.lam - loose @ (loose.T @ state.lam))
    for rigid in (False, True):
        own, gains = _axial(equations, state, loading, loose, rigid)
        least, left = _least_squares(gains, own)
        if rigid and (reactions or left.shape[1] < loose.shape[1]):
            return _with_least_reactions(equations, state, loading, loose)
        if not rigid:
            state, loose = replace(state, lam=state.lam - loose @ least), loose @ left
        if not loose.shape[1]:
            break
    return state


def stretches(equations: Equations, state: State, loading: Loading, loose: Array) -> bool:
    """Whether redundant rows change axial forces of flexible members, and with them critical loads."""
    own, gains = _axial(equations, state, loading, loose, False)
    return bool(_least_squares(gains, own)[1].shape[1] < loose.shape[1])


def _with_least_reactions(equations: Equations, state: State, loading: Loading, loose: Array) -> State:
    """The state with reactions whose sum of squares is least; moments count over the unit of length."""
    model = equations.model
    supported = [name for name, node in model.scene.nodes.items() if node.support != "free"]
    units = np.concatenate([np.full(3, model.scales.force), np.full(3, model.scales.moment)])
    if not supported or loose.shape[1] > MOST_LOOSE:
        return state

    def told(lam: Array) -> Array:
        fields = Fields(equations, replace(state, lam=lam), loading)
        return np.concatenate([np.concatenate(fields.reaction(name)) / units for name in supported])

    own = told(state.lam)
    gains = np.column_stack([told(state.lam + way) - own for way in loose.T])
    return replace(state, lam=state.lam - loose @ _least_squares(gains, own)[0])


def _axial(equations: Equations, state: State, loading: Loading, loose: Array, rigid: bool) -> tuple[Array, Array]:
    """Axial forces times the roots of the lengths they act on, (places,), and their change with loose combinations."""
    model = equations.model
    acting, nothing = equations.effective(state, loading), loading.scaled(0.0)
    kinds = [(model.scene.members[part.member].type == "rigid") == rigid for part in model.segments.parts]
    chosen = np.array(kinds, dtype=bool)[model.segments.owner]
    along = (turned_tangents(model, state.q) / np.sqrt(model.beams.weight)[..., None])[chosen]

    def force(pulls: Array, spread: Array | float = 0.0) -> Array:
        return np.asarray(((spread + pulls[model.segments.owner[chosen]][:, None, :]) * along).sum(axis=2).ravel())

    own = force(equations.segment_pulls(state.lam, acting), acting.pull[chosen])
    gains = [force(equations.segment_pulls(way, nothing)) for way in loose.T]
    return own, np.array(gains).reshape(loose.shape[1], len(own)).T


def _least_squares(gains: Array, own: Array) -> tuple[Array, Array]:
    """What combinations take to make ``own`` least, and an orthonormal basis of those that change nothing, (n, m).

    Columns are of length one and forces dimensionless: what gains less than :data:`FELT` says nothing but rounding.
    """
    orthonormal, upper = np.linalg.qr(gains)
    left, sizes, right = np.linalg.svd(upper, full_matrices=True)
    kept = int((sizes > FELT).sum())
    return right[:kept].T @ ((left[:, :kept].T @ (orthonormal.T @ own)) / sizes[:kept]), right[kept:].T
