"""Relaxation of sections: moments and forces that fade while the strain is kept, as a series of Prony."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, final

from pydantic import BeforeValidator

from ..errors import SceneError
from .records import Positive, Record, listed

__all__ = ["Relaxation", "Relaxations", "check_relaxation", "shares_of"]


@final
class Relaxation(Record):
    """One branch of a section that relaxes: a spring in series with a damper, beside the stiffness of the section.

    Parameters
    ----------
    ratio : 1
        Share of the instantaneous stiffness that fades; of all branches together below 1.
    time : s
        Relaxation time: while the strain is kept, the branch's share falls to 1/e in this time.
    """

    ratio: Positive
    time: Positive


def _branches(value: Any) -> tuple[Any, ...]:
    return listed(value, "a list of branches, as {ratio = 0.3, time = 0.1}")


Relaxations = Annotated[tuple[Relaxation, ...], BeforeValidator(_branches)]
"""Branches of a section, in any order."""


def check_relaxation(branches: Sequence[Relaxation]) -> None:
    """Refuse branches that leave nothing of the stiffness.

    Raises
    ------
    SceneError
        The ratios add up to one or more.
    """
    total = sum(branch.ratio for branch in branches)
    if total >= 1.0:
        found = f"found ratios that add up to {total:g}"
        raise SceneError(f"{found}, accepted: less than 1, so that some stiffness stays", ("relaxation",))


def shares_of(branches: Sequence[Relaxation]) -> list[Any]:
    """Stiffness of each branch over that of the section, which stays when everything has relaxed."""
    left = 1.0 - sum((branch.ratio for branch in branches), 0.0)
    return [branch.ratio / left for branch in branches]
