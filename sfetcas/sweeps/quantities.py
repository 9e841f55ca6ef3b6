"""The quantities that a sweep keeps of each answer.

Names are those of :mod:`~sfetcas.description.answers`; one of several answers is selected as in ``expect``:
``nodes.tip.position step 2``, ``nodes.tip.velocity time 0.5``, ``factor limit_point 1``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import Answer, asked
from ..description.answers import COUNTED, answer_name, check_answer
from ..description.records import say
from ..description.scene import Expect, Scene
from ..errors import SceneError
from ..mathematics.arrays import Array

__all__ = ["Wanted", "wanted_of"]

COMING_AND_GOING = ("contacts", "modes")
"""Tables of the answer whose number of entries may differ from case to case."""


@dataclass(frozen=True)
class Wanted:
    """A quantity that is kept of each answer.

    Attributes
    ----------
    text : str
        The name given, which is also its name in the table.
    expect : Expect
        The quantity, with the selection of one of several answers.
    """

    text: str
    expect: Expect

    @property
    def optional(self) -> bool:
        """Whether some answers may lack it: it belongs to contacts, modes or critical points, whose number varies."""
        numbered = any(getattr(self.expect, key) is not None for key in COUNTED)
        return numbered or answer_name(self.expect.quantity).kind.table in COMING_AND_GOING

    def numbers(self, answer: Answer) -> Array:
        """The value in an answer, (n,), in the unit of the quantity; empty where an optional quantity is absent.

        Raises
        ------
        SceneError
            The answer lacks a quantity that is not optional, or its value does not consist of numbers.
        """
        try:
            found = asked(answer, self.expect)
        except SceneError as error:
            if self.optional:
                return np.zeros(0)
            raise SceneError(error.bare, ("quantities", self.text)) from None
        if found is None and self.optional:
            return np.zeros(0)
        try:
            return np.atleast_1d(np.asarray(found, dtype=float)).ravel()
        except (TypeError, ValueError):
            message = f"found {say(found)}, accepted: a quantity made of numbers"
            raise SceneError(message, ("quantities", self.text)) from None


def wanted_of(scene: Scene, names: Sequence[str]) -> tuple[Wanted, ...]:
    """Quantities from their names.

    Raises
    ------
    SceneError
        There are no names, one appears twice, or the answers of such a scene have no such quantity.
    """
    if isinstance(names, str) or not names:
        raise SceneError(f"found {say(names)}, accepted: a list of names, as ['nodes.tip.position']", ("quantities",))
    found: list[Wanted] = []
    for text in names:
        try:
            one = _wanted(scene, text)
        except SceneError as error:
            raise SceneError(error.bare, ("quantities", *([text] if isinstance(text, str) else []))) from None
        if one.text in [other.text for other in found]:
            raise SceneError(f"found {one.text!r} twice, accepted: each once", ("quantities",))
        found.append(one)
    return tuple(found)


def _wanted(scene: Scene, text: Any) -> Wanted:
    """A quantity with its selectors, which stand behind the name."""
    name = answer_name(text)
    check_answer(scene, name)
    if not name.kind.numeric:
        raise SceneError(f"found {name.quantity!r}, accepted: a quantity made of numbers")
    if name.kind.along != (name.at is not None):
        where = "a place, as members.beam.moment at 0.5" if name.kind.along else "a place along members only"
        raise SceneError(f"found {'none' if name.kind.along else f'{name.at:g}'}, accepted: {where}")
    expect = Expect.from_dict({"quantity": text, "value": True})
    scene.replace(expect=(expect,))
    return Wanted(text.strip(), expect)
