"""Multipliers of redundant rows: how members share forces that equilibrium leaves open, one rule for all analyses.

Where closings depend on each other to first order, as along straight members between more supports than balance
needs, multipliers are not determined: in inextensible members any axial forces in balance will do, and critical loads
depend on which.  The rule takes the limit of flexible members with one axial stiffness ``EA``: the integral of the
squared axial force along them is least, whatever ``EA``.  What this leaves open, within rigid bodies or across
rotations about fixed axes, stretches nothing: of these the reactions of supports are least, and then the multipliers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, State, turned_tangents
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading
from ..mechanics.mesh import within_elements
from ..mechanics.tendon_shares import stretches_of

__all__ = ["SHARED", "SMALLEST", "shared", "stretches"]

FELT = 1e-6
"""Singular value, dimensionless, up to which a redundant combination counts as changing no axial force or reaction."""

SHARED = (
    "reactions are not unique: forces along straight members are not determined without stretch and shared as among "
    "members that stretch alike (equal EA); what is stable, and critical loads, depend on it"
)
"""Note of every analysis in which redundant rows change axial forces."""

SMALLEST = "reactions are not unique, the smallest are given"
"""Note of analyses in which redundant rows change no axial force."""

INSIDE = 1e-9
"""Share of an element by which points at its ends are moved into it."""

MOST_LOOSE = 60
"""Largest number of redundant combinations for which reactions are made least; with more only the multipliers are."""


def shared(equations: Equations, state: State, loading: Loading, loose: Array, *, reactions: bool = False) -> State:
    """The state with the multipliers of the rule of this module.

    Parameters
    ----------
    equations, state, loading
    loose : ndarray (rows, n)
        Redundant combinations of rows, orthonormal, of :func:`~sfetcas.solvers.redundancy.loose_rows`.
    reactions : bool
        Whether to make reactions least also where redundant combinations change no axial force of any member;
        otherwise the multipliers are least there.
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
    """Whether redundant combinations (rows, n) change axial forces of flexible members, and so critical loads."""
    own, gains = _axial(equations, state, loading, loose, False)
    return bool(_least_squares(gains, own)[1].shape[1] < loose.shape[1])


def _with_least_reactions(equations: Equations, state: State, loading: Loading, loose: Array) -> State:
    """The state with the least sum of squares of reactions, moments over the unit of length of the model."""
    model = equations.model
    supported = [name for name, node in model.scene.nodes.items() if node.support != "free"]
    units = np.concatenate([np.full(3, model.scales.force), np.full(3, model.scales.moment)])
    if not supported or loose.shape[1] > MOST_LOOSE:
        return state

    def strain(lam: Array) -> Array:
        fields = Fields(equations, replace(state, lam=lam), loading)
        return np.concatenate([np.concatenate(fields.reaction(name)) / units for name in supported])

    own = strain(state.lam)
    gains = np.column_stack([strain(state.lam + way) - own for way in loose.T])
    return replace(state, lam=state.lam - loose @ _least_squares(gains, own)[0])


def _axial(equations: Equations, state: State, loading: Loading, loose: Array, rigid: bool) -> tuple[Array, Array]:
    """Axial forces times the root of the lengths they act on, (points,), and their change (points, n) with ``loose``.

    Of the ``rigid`` members or of all others, at their integration points, dimensionless.
    """
    model = equations.model
    acting, nothing = equations.effective(state, loading), loading.scaled(0.0)
    kinds = [(model.scene.members[part.member].type == "rigid") == rigid for part in model.segments.parts]
    chosen = np.array(kinds, dtype=bool)[model.segments.owner]
    along = (turned_tangents(model, state) / np.sqrt(model.beams.weight)[..., None])[chosen]

    def force(lam: Array, loading: Loading, spread: Array | float = 0.0) -> Array:
        pulls = equations.segment_pulls(lam, loading)[model.segments.owner]
        pulls = (pulls + equations.strings(replace(state, lam=lam), loading))[chosen]
        return np.asarray(((spread + pulls[:, None, :]) * along).sum(axis=2).ravel())

    strung = [name for name in model.members if stretches_of(model.scene, name)]

    def taken(lam: Array) -> Array:
        """What tendons along members take over from their sections, which is not linear in the multipliers."""
        found, fields = np.zeros((*acting.pull.shape[:2], 3)), Fields(equations, replace(state, lam=lam), loading)
        for name in strung:
            cuts, part = model.mesh.cuts[name], model.elements_of(name)
            # Within the elements, as a tendon may begin or end between two of them.
            within = np.clip(model.element.points, INSIDE, 1.0 - INSIDE)
            x = within_elements(cuts, within)
            found[part] = fields.taken(name, x.ravel()).reshape(*x.shape, 3)
        return np.asarray((found[chosen][..., : model.element.axes] * along).sum(axis=2).ravel())

    own = force(state.lam, acting, acting.pull[chosen])
    gains = [force(way, nothing) for way in loose.T]
    if strung:
        rest = taken(state.lam)
        own, gains = (
            own + rest,
            [gain + taken(state.lam + way) - rest for gain, way in zip(gains, loose.T, strict=True)],
        )
    return own, np.array(gains).reshape(loose.shape[1], len(own)).T


def _least_squares(gains: Array, own: Array) -> tuple[Array, Array]:
    """Least squares solution (n,) of ``gains x = own``, and an orthonormal null space (n, m) of ``gains``.

    Singular values up to :data:`FELT` are rounding: combinations are of length one and forces dimensionless.
    """
    orthonormal, upper = np.linalg.qr(gains)
    left, sizes, right = np.linalg.svd(upper, full_matrices=True)
    kept = int((sizes > FELT).sum())
    return right[:kept].T @ ((left[:, :kept].T @ (orthonormal.T @ own)) / sizes[:kept]), right[kept:].T
