"""Where paths begin: at factor 0, or beside it where straight members have no slack to begin with."""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from .arclength import Curve, Standing, Tangent
from .continuation import follow
from .deflation import nearest
from .prepared import Prepared, Solved
from .redundancy import loose_rows, named_in, stretched
from .sharing import SHARED, SMALLEST, stretches
from .tracing import Traced
from .unrestrained import refuse_unrestrained

__all__ = ["begin_path", "begun_at", "beside_zero", "check_slack"]

STARTED = "the path begins at the equilibrium of factor 0 that start places of nodes choose"

BEGINNING = 1e-3
"""Share of its last factor at which a path starts that cannot start at 0: members lack slack, or it is a mechanism."""

TAUT = 1e3
"""Ratio of the largest multiplier to the loads above which members without slack carry them like a taut string."""


def begin_path(prepared: Prepared, span: tuple[float, float]) -> tuple[Curve, Standing, tuple[str, ...]]:
    """The curve with its unit, its first point, and notes for the user.

    Parameters
    ----------
    prepared : Prepared
    span : (low, high)
        Range of factors.  The path goes towards smaller ones if the range ends at 0, else towards larger ones.

    Raises
    ------
    SolveError
        There is no equilibrium to start from.
    SceneError
        Loads drive a free motion without end.
    """
    return begun_at(prepared, *_first_state(prepared, beside_zero(span)), span)


def beside_zero(span: tuple[float, float]) -> float:
    """The factor at which a path starts that cannot start at 0."""
    return BEGINNING * (span[1] if span[1] > 0.0 else span[0])


def begun_at(
    prepared: Prepared, state: State, factor: float, notes: tuple[str, ...], span: tuple[float, float]
) -> tuple[Curve, Standing, tuple[str, ...]]:
    """As :func:`begin_path`, at a given equilibrium."""
    up, widest = 1.0 if span[1] > 0.0 else -1.0, max(map(abs, span))
    curve = Curve(prepared, widest)
    along = Tangent(np.zeros(prepared.equations.total), up)
    tangent = curve.standing(state, factor, along).tangent
    share = (tangent.factor / widest) ** 2
    # The unit is the factor at which the linear structure would rotate by a radian, if that is in the range.
    if share < 0.5:
        curve.unit = max(abs(tangent.factor) / np.sqrt(1.0 - share), tolerances.UNIT * widest)
    start = curve.standing(state, factor, along)
    loose = loose_rows(curve.equations, start.point)
    if loose.size:
        reactions = SHARED if stretches(curve.equations, start.state, start.loading, loose) else SMALLEST
        notes += (f"{reactions}; redundant: {named_in(curve.equations, loose)}",)
    return curve, start, notes


def _first_state(prepared: Prepared, beside: float) -> tuple[State, float, tuple[str, ...]]:
    """The equilibrium at factor 0, or at ``beside`` where there is none at 0; its factor; notes for the user."""
    model, equations = prepared.model, prepared.equations
    unloaded = model.loading(0.0, 0.0)
    state = equations.start(unloaded)
    refuse_unrestrained(prepared, beside)
    moved = np.any(model.loading(beside).shift - model.loading(0.0).shift)
    if moved and prepared.lacks_slack:
        note = f"straight members have no slack: the path starts at factor {beside:g}, where they have bent"
        return _bent(prepared, beside), beside, (note,)
    if prepared.diagnosis.mobility and model.minimisable:
        note = f"without loads it is a mechanism: the path starts at factor {beside:g}"
        return _bent(prepared, beside), beside, (note,)
    if prepared.started and model.minimisable:
        return _at_start_places(prepared, model.loading(0.0)), 0.0, (STARTED,)
    if not model.loaded_at_zero:
        return prepared.correct(state, model.loading(0.0)).state, 0.0, ()
    grown = follow(prepared, lambda t: model.loading(0.0, t), state)
    if not grown.reached:
        raise SolveError(Status.FAILED, "no equilibrium to start from at factor 0", grown.state)
    return grown.state, 0.0, ()


def _at_start_places(prepared: Prepared, loading: Loading) -> State:
    """The equilibrium that ``start`` places choose, as in statics: a stable one unless unstable ones are wanted."""
    near = nearest(prepared, loading) if prepared.model.scene.analysis.unstable == "stay" else None
    return _stable(prepared, loading).state if near is None else near.state


def _bent(prepared: Prepared, factor: float) -> State:
    if prepared.started and prepared.model.minimisable:
        return _at_start_places(prepared, prepared.model.loading(factor))
    return _stable(prepared, prepared.model.loading(factor)).state


def _stable(prepared: Prepared, loading: Loading) -> Solved:
    """A stable equilibrium near the start guess."""
    state, gap = prepared.guess(loading)
    if gap > 0.2:
        detail = f"the closings miss by {gap * prepared.model.scales.length:.3g} m where the path starts"
        raise SolveError(Status.INFEASIBLE, detail, state)
    found, _ = prepared.minimise(loading, state)
    return prepared.switch_branch(found, loading) if found.stability.negative else found


def check_slack(curve: Curve, traced: Traced) -> None:
    """Refuse members that are straight between fixed points from the start and carry the loads like a taut string.

    Raises
    ------
    SolveError
        Rows are redundant at the first point, and multipliers at the last exceed ``TAUT`` times the loads.
    """
    equations, (first, *_, last) = curve.equations, traced.points
    loose = loose_rows(equations, first.point)
    loads = max(float(np.abs(part).max(initial=0.0)) for part in (last.loading.force, last.loading.pull))
    if loose.size and loads > 0.0 and np.abs(last.state.lam).max() > TAUT * loads:
        raise SolveError(Status.STRETCHED, stretched(equations, last.point, loose), last.state)
