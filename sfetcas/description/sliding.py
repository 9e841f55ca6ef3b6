"""Whether a tendon with friction is pulled or let out, which decides in which direction its guides hold it back.

What is told of a step or a motion is what happens at the pulled end: the tension there, or by how much the tendon is
shortened.  Where that rises the tendon is pulled and slides towards this end, where it falls the tendon is let out;
where it stays it goes on to be what it was last.  Before all steps it is zero, so that a tendon with a shortening below
zero begins to be let out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, values_of
from .loads import History
from .shapes import CenterLine
from .task import Analysis
from .tendons import Piece, Tendon, length_of_piece

__all__ = ["check_sliding", "let_out", "let_out_at", "shortening_of"]


def shortening_of(tendon: Tendon, pieces: Sequence[Piece], lines: Mapping[str, CenterLine]) -> float | None:
    """By how much a tendon is shorter at factor 1 than its way in the undeformed scene, m; None where its force is
    given.
    """
    if not tendon.measured:
        return None
    lengths: list[Any] = []
    for piece in pieces:
        if isinstance(piece, tuple):
            lengths.append(np.linalg.norm(values_of(piece[1].position) - values_of(piece[0].position)))
        else:
            lengths.append(length_of_piece(piece, lines[piece.member]))
    rest = float(values_of(sum(lengths)))
    by = float(values_of(tendon.pull or 0.0)) if tendon.length is None else rest - float(values_of(tendon.length))
    # What is told to be as long as it is.
    return 0.0 if abs(by) <= tolerances.WRITTEN * rest else by


def let_out_at(
    tendon: Tendon, shortening: float | None, factors: Sequence[float], histories: Mapping[str, History]
) -> tuple[bool, ...]:
    """For each load factor (n,) whether the tendon is let out there."""
    history = None if tendon.history is None else histories[tendon.history]
    values = _pulls(shortening, [factor if history is None else history.factor(factor) for factor in factors]).tolist()
    found, size = [False], max([0.0, *map(abs, values)])
    for before, now in pairwise([0.0, *values]):
        found.append(found[-1] if abs(now - before) <= tolerances.DECIMAL * size else now < before)
    return tuple(found[1:])


def _pulls(shortening: float | None, factors: Sequence[float] | Array) -> Array:
    """What rises where the tendon is pulled: the size of a given tension, or the shortening."""
    values = np.asarray(factors, dtype=float)
    return np.abs(values) if shortening is None else values * shortening


def check_sliding(
    name: str, tendon: Tendon, shortening: float | None, analysis: Analysis, histories: Mapping[str, History]
) -> None:
    """Refuse analyses in which a tendon with friction would not slide in one direction, or which friction disturbs.

    Raises
    ------
    SceneError
        Names the tendon, or the key of the analysis.
    """
    try:
        let_out(tendon, shortening, analysis, histories)
    except SceneError as error:
        raise error.within("tendons", name) from None
    if analysis.count_of_modes:
        message = "found with modes, in which it would slide to and fro, accepted: without friction"
        raise SceneError(message, ("tendons", name, "friction"))
    if analysis.integrator in ("conserving", "stepping", "idas"):
        message = f"found {analysis.integrator!r} with friction in the guides of a tendon"
        raise SceneError(f"{message}, accepted: radau-3, radau-2 or generalised-alpha", ("analysis", "integrator"))


def let_out(tendon: Tendon, shortening: float | None, analysis: Analysis, histories: Mapping[str, History]) -> bool:
    """Whether a tendon is let out throughout a path or a motion, or at the first of steps.

    Raises
    ------
    SceneError
        It is pulled in one part of it and let out in another.
    """
    if analysis.type not in ("path", "dynamic"):
        return let_out_at(tendon, shortening, analysis.steps[:1], histories)[0]
    begin, end = analysis.span if analysis.type == "path" else (0.0, analysis.duration)
    history = None if tendon.history is None else histories[tendon.history]
    if history is None:
        # A path goes up and down again; what is constant was pulled or let out before.
        return let_out_at(tendon, shortening, (1.0,), histories)[0]
    ends = sorted({begin, end, *(t for t in history.t if min(begin, end) < t < max(begin, end))})
    times = np.unique(np.concatenate([[ends[0]], *(np.linspace(a, b, SAMPLES + 1)[1:] for a, b in pairwise(ends))]))
    times = times if begin <= end else times[::-1]
    values = _pulls(shortening, history.factor(times))
    least = tolerances.DECIMAL * np.abs(values).max()
    # How far it has risen and fallen since the last lowest and highest value.
    risen, fallen = values - np.minimum.accumulate(values), np.maximum.accumulate(values) - values
    rises, falls = np.flatnonzero(risen > least), np.flatnonzero(fallen > least)
    if len(rises) and len(falls):
        turn = float(times[max(rises[0], falls[0]) - 1])
        what = "time" if analysis.type == "dynamic" else "factor"
        pull = "tension" if shortening is None else "pull"
        message = f"found a {pull} that rises and falls, near the {what} {turn:.4g}, where friction would jump"
        raise SceneError(f"{message}, accepted: with friction one that only rises, or only falls", ("history",))
    return bool(len(falls)) if len(rises) or len(falls) else bool(values[0] < 0.0)


SAMPLES = 32
"""Places in each interval of a history at which it is looked whether it rises or falls."""
