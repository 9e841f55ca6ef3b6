"""Whether a tendon with friction is pulled or let out, which decides in which direction its guides hold it back.

What is told of a step or a motion is the tension at the pulled end.  Where that rises the tendon is pulled and slides
towards this end, where it falls the tendon is let out; where it stays it goes on to be what it was last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from .. import tolerances
from ..errors import SceneError
from .loads import History
from .task import Analysis
from .tendons import Tendon

__all__ = ["check_sliding", "let_out", "let_out_at"]


def let_out_at(tendon: Tendon, factors: Sequence[float], histories: Mapping[str, History]) -> tuple[bool, ...]:
    """For each load factor (n,) whether the tendon is let out there: at the first one it is pulled."""
    history = None if tendon.history is None else histories[tendon.history]
    values = [abs(factor if history is None else history.factor(factor)) for factor in factors]
    found, size = [False], max([0.0, *values])
    for before, now in pairwise(values):
        found.append(found[-1] if abs(now - before) <= tolerances.DECIMAL * size else now < before)
    return tuple(found)


def check_sliding(name: str, tendon: Tendon, analysis: Analysis, histories: Mapping[str, History]) -> None:
    """Refuse analyses in which a tendon with friction would not slide in one direction, or which friction disturbs.

    Raises
    ------
    SceneError
        Names the tendon, or the key of the analysis.
    """
    try:
        let_out(tendon, analysis, histories)
    except SceneError as error:
        raise error.within("tendons", name) from None
    if analysis.count_of_modes:
        message = "found with modes, in which it would slide to and fro, accepted: without friction"
        raise SceneError(message, ("tendons", name, "friction"))
    if analysis.integrator in ("conserving", "idas"):
        message = f"found {analysis.integrator!r} with friction in the guides of a tendon"
        raise SceneError(f"{message}, accepted: radau-3, radau-2 or generalised-alpha", ("analysis", "integrator"))


def let_out(tendon: Tendon, analysis: Analysis, histories: Mapping[str, History]) -> bool:
    """Whether a tendon is let out throughout a path or a motion.

    Raises
    ------
    SceneError
        It is pulled in one part of it and let out in another.
    """
    if analysis.type not in ("path", "dynamic"):
        return False
    begin, end = analysis.span if analysis.type == "path" else (0.0, analysis.duration)
    history = None if tendon.history is None else histories[tendon.history]
    if history is None:
        return False
    ends = sorted({begin, end, *(t for t in history.t if min(begin, end) < t < max(begin, end))})
    times = np.unique(np.concatenate([[ends[0]], *(np.linspace(a, b, SAMPLES + 1)[1:] for a, b in pairwise(ends))]))
    times = times if begin <= end else times[::-1]
    values = np.abs(history.factor(times))
    least = tolerances.DECIMAL * values.max()
    # How far it has risen and fallen since the last lowest and highest value.
    risen, fallen = values - np.minimum.accumulate(values), np.maximum.accumulate(values) - values
    rises, falls = np.flatnonzero(risen > least), np.flatnonzero(fallen > least)
    if len(rises) and len(falls):
        turn = float(times[max(rises[0], falls[0]) - 1])
        what = "time" if analysis.type == "dynamic" else "factor"
        message = f"found a tension that rises and falls, near the {what} {turn:.4g}, where friction would jump"
        raise SceneError(f"{message}, accepted: with friction one that only rises, or only falls", ("history",))
    return bool(len(falls))


SAMPLES = 32
"""Places in each interval of a history at which it is looked whether it rises or falls."""
