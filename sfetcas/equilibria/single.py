"""One equilibrium of an assembled model on its own mesh: from a start guess, or from a nearby equilibrium."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from ..errors import SolveError, Status
from ..mathematics.threads import single_threaded
from ..mechanics.loading import Loading
from ..solvers.constraints import contradiction
from ..solvers.continuation import follow
from ..solvers.prepared import Prepared, Solved
from ..solvers.stability import Stability
from .solution import Equilibrium, equilibrium

__all__ = ["SolverName", "cold", "finished", "solve_model", "solved_from", "unjudged"]

SolverName = Literal["ipopt", "newton"]
"""What finds an equilibrium that none near is known of."""


@single_threaded
def solve_model(
    model: Any, factor: float = 1.0, *, start: Equilibrium | None = None, solver: SolverName = "ipopt"
) -> Equilibrium:
    """One equilibrium of an assembled model: from the start guess, or by Newton's method from a nearby equilibrium.

    Parameters
    ----------
    model : Model or Prepared
        Pass the same :class:`~sfetcas.Prepared` for repeated solves, so that functions and factorisations are reused.
    factor : float
        Factor of loads and prescribed displacements.
    start : Equilibrium, optional
        An equilibrium of the same model for a similar factor.
    solver : str
        From the start guess: ``ipopt``, or ``newton`` and IPOPT where that fails.

    Raises
    ------
    SceneError
        The scene has contacts or springs with stops, which only :func:`~sfetcas.solve` can treat.
    SolveError
        No equilibrium was found.
    """
    prepared = model if isinstance(model, Prepared) else Prepared(model)
    prepared.model.check_complete()
    loading = prepared.model.loading(factor)
    found, iterations = _warm(prepared, start, loading) if start is not None else None, 0
    if found is None:
        found, iterations, _ = cold(prepared, loading, solver)
    return finished(found, iterations=iterations)


def _warm(prepared: Prepared, start: Equilibrium, loading: Loading) -> Solved | None:
    found = prepared.correct(start.state, loading, iterations=20, most=2.0)
    return found if found.converged else None


def cold(prepared: Prepared, loading: Loading, solver: SolverName = "ipopt") -> tuple[Solved, int, str]:
    """The equilibrium from the start guess, with the number of iterations and the name of the strategy.

    Models whose loads have no potential cannot be minimised: their loads are followed from zero instead.

    Raises
    ------
    SolveError
        No equilibrium was found.
    """
    if solver == "newton":
        found, iterations = prepared.globalised(loading)
        if found is not None:
            return found, iterations, "afar"
    if not prepared.model.minimisable:
        start = prepared.equations.start(prepared.model.loading(0.0, 0.0))
        followed = follow(prepared, loading.scaled, start, switch_branch=False)
        if not followed.reached:
            raise SolveError(Status.FAILED, "the loads could not be followed from zero", followed.state)
        return prepared.correct(followed.state, loading), 0, "growing"
    state, gap = prepared.guess(loading)
    if gap > 0.2:
        equations = prepared.equations
        rows = np.abs(equations.at(state, loading).residual[equations.unknowns :])
        worst = ", ".join(equations.row_names[i] for i in np.flatnonzero(rows > 0.3 * rows.max())[:4])
        detail = f"the closings miss by {gap * prepared.model.scales.length:.3g} m at {worst}"
        message = contradiction(equations, state, loading)
        detail += f"; {message}" if message else ""
        raise SolveError(Status.INFEASIBLE, detail, state)
    return *prepared.minimise(loading, state), "minimum"


UNJUDGED = Stability("not defined", 0, np.nan, np.zeros(0), np.zeros(0))
"""Of a state on the way, whose stability nobody asks for."""


def unjudged(found: Solved) -> Equilibrium:
    """What was solved as an :class:`~sfetcas.Equilibrium` without a stability test."""
    return finished(found, UNJUDGED)


def solved_from(found: Equilibrium) -> Solved:
    """An answer as it was solved, on its own mesh."""
    return Solved.taken(Prepared(found.model), found.state, found.loading)


HIDDEN = (
    "members that are very stiff or short beside others leave more rounding than the smallest eigenvalue: whether this "
    "is stable is not told; make such members rigid"
)
"""What is said where neutral means not told."""


def finished(
    found: Solved, stability: Stability | None = None, *, notes: tuple[str, ...] = (), **more: Any
) -> Equilibrium:
    """What was solved as an :class:`~sfetcas.Equilibrium`, with a note where its stability is hidden.

    ``stability`` is the result of another test than its own; ``more`` are as of
    :func:`~sfetcas.equilibria.solution.equilibrium`.
    """
    stability = found.stability if stability is None else stability
    return equilibrium(found, stability, notes=(*notes, HIDDEN) if stability.hidden else notes, **more)
