"""Errors and statuses: each carries one sentence that a user can act on."""

from __future__ import annotations

import enum

from .quoting import printable

__all__ = ["LIMITS", "SceneError", "SolveError", "Status"]


class SceneError(ValueError):
    """Bad input: one sentence naming what, where, what was found and what is accepted.

    Attributes
    ----------
    where : tuple of str
        Place in the scene, from the outside in: ``("members", "beam", "shape")``.
    """

    def __init__(self, message: str, where: tuple[str, ...] = ()) -> None:
        super().__init__(printable(message if not where else f"{'.'.join(where)}: {message}"))
        self.bare = message
        self.where = where

    def within(self, *outer: str) -> SceneError:
        """The error with further keys put before its place, as when a record is part of another one."""
        return SceneError(self.bare, (*outer, *self.where))


class Status(enum.Enum):
    """How a solve ended; the value of each member is a sentence for the user."""

    SOLVED = "solved"
    SHORT = "solved, but not to the accuracy asked for"
    CUT = "solved, but the path could not be followed to the end of its range"
    INFEASIBLE = "no shape of the members satisfies all supports, joints and motions"
    UNMET = "no values of the unknowns within their bounds were found that meet all that is asked for"
    STRETCHED = "no finite force holds the members"
    BENT = "a small member bends beyond linear elasticity"
    OUTSIDE = "a magnet leaves the table of its field"
    SLID = "a member slides out of a ring"
    UNBOUNDED = "the loads are not held: the energy falls without bound"
    STOPPED = "the motion could not be followed further"
    INTERRUPTED = "interrupted: what was computed up to then is kept"
    ITERATIONS = "the solver used up its iterations"
    SINGULAR = "the equilibrium is singular, where derivatives do not exist"
    KINK = "the equilibrium is at a kink, about which nothing is linear"
    UNDETERMINED = "the measurements do not determine all parameters"
    FAILED = "the solver stopped before it reached an equilibrium"


LIMITS = (Status.BENT, Status.OUTSIDE, Status.SLID)
"""Why a state is beyond what its scene describes."""


class SolveError(RuntimeError):
    """No solution was found; the message says why and what was tried.

    Attributes
    ----------
    status : Status
        Why there is no solution.
    detail : str
        What was tried.
    last : object or None
        Last iterate as the solver left it, for diagnosis; not an equilibrium.
    reached : object or None
        The :class:`~sfetcas.equilibria.solution.Solution` with the load steps before the one that failed, if any.
    """

    reached: object = None

    def __init__(self, status: Status, detail: str = "", last: object = None) -> None:
        super().__init__(status.value + (f" ({detail})" if detail else ""))
        self.status = status
        self.detail = detail
        self.last = last
