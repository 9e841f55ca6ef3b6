"""Rows of a model that act on one side only: stops of springs, which push, and tendons of given length, which pull.

A model contains those that act, as :attr:`.Mesh.stops` says.  What changes them from one time to the next takes a model
with all of them, and switches them on and off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array, Index
from .model import Model

__all__ = ["NONE", "OneSided", "all_stops", "one_sided_of"]


@dataclass(frozen=True, eq=False)
class OneSided:
    """The rows of a model with all of them that may act or not.

    Attributes
    ----------
    parts : tuple of (str, str)
        The record of each, and ``low`` or ``high`` of a spring, ``taut`` of a tendon.
    rows : ndarray (n,)
        Their numbers among the rows.
    signs : ndarray (n,)
        1 where a row must not be above zero, and its multiplier not below; -1 where it is the other way round.
    """

    parts: tuple[tuple[str, str], ...]
    rows: Index
    signs: Array

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def names(self) -> list[str]:
        """Where each stands in the scene."""
        return [f"tendons.{name}" if side == "taut" else f"springs.{name}" for name, side in self.parts]

    def stops(self, acting: Array) -> tuple[tuple[str, str], ...]:
        """The stops of the mesh of a model in which those act whose number in ``acting`` (n,) is not zero."""
        both = list(zip(self.parts, acting, strict=True))
        found = [part for part, now in both if now and part[1] != "taut"]
        return (*found, *((name, "slack") for (name, side), now in both if side == "taut" and not now))

    def acting(self, stops: tuple[tuple[str, str], ...]) -> Array:
        """The numbers (n,), one of those that act, for the stops of a mesh."""
        there = [(name, "slack") not in stops if s == "taut" else (name, s) in stops for name, s in self.parts]
        return np.array(there, dtype=float)


NONE = OneSided((), np.zeros(0, np.intp), np.zeros(0))
"""No row."""


def all_stops(scene: Scene) -> tuple[tuple[str, str], ...]:
    """The stops of the mesh of a model that contains all one-sided rows of a scene."""
    return tuple((name, side) for name, spring in scene.springs.items() if spring.stop for side in ("low", "high"))


def one_sided_of(model: Model) -> OneSided:
    """The one-sided rows of a model that contains all of them; of a scene that has none, none."""
    scene, names = model.scene, model.row_names
    parts: list[tuple[str, str]] = list(all_stops(scene))
    found = [
        [i for i, row in enumerate(names) if row == f"springs.{name}.stop"][side == "high"] for name, side in parts
    ]
    for name, tendon in scene.tendons.items():
        if tendon.may_be_slack:
            parts.append((name, "taut"))
            found.append(names.index(f"tendons.{name}"))
    signs = [-1.0 if side == "low" else 1.0 for _, side in parts]
    return OneSided(tuple(parts), np.array(found, dtype=np.intp), np.array(signs))
