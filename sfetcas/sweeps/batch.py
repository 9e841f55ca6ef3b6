"""The plain cases of a sweep, which the core solves in threads of this process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..parametric.arguments import asked_for
from ..parametric.plain import NO_CORE, PlainAnswers, PlainCases, plain_cases
from .outcomes import Outcomes
from .quantities import Wanted
from .work import Outcome

__all__ = ["batch_of", "outcomes_of"]


def batch_of(scene: Scene, names: Sequence[str], wanted: Sequence[Wanted], settings: Settings) -> PlainCases | None:
    """What solves the plain cases of a sweep; None without a core, where all are solved one by one.

    Raises
    ------
    SceneError
        No case of such a scene is plain, or its answers have no such quantity.
    """
    try:
        found = plain_cases(scene, asked_for(scene, list(names)), [one.text for one in wanted], settings)
    except SceneError as error:
        where = ("quantities", *error.where[1:]) if error.where[:1] == ("results",) else error.where
        raise SceneError(error.bare, where) from None
    if found == NO_CORE:
        return None
    if isinstance(found, str):
        raise SceneError(f"found {found}, accepted: such a scene in a sweep without batch", ("batch",))
    return found


def outcomes_of(plain: PlainCases, answers: PlainAnswers, others: Mapping[int, Outcome]) -> Outcomes:
    """The outcomes of all cases, with those of the ``others`` by their numbers."""
    numbers = np.split(answers.numbers, np.cumsum(plain.sizes)[:-1], axis=1)
    return Outcomes(others, numbers, answers.errors, answers.seconds)
