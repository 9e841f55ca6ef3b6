"""Unilateral constraints: strings that pull but do not push, and stops and obstacles that push but do not pull.

Each is an inequality.  While it is active, its multiplier - a tension, or the reaction of a stop - must not be below
zero; while it is not, its gap must not be: by how much a string is shorter than its free length, or what is left to
the stop.  Both are its margin, dimensionless.  Which of them are active is a choice, which a mesh carries as ``stops``;
where a margin changes its sign the choice is another one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array, Index, first_of_largest
from .connections import row_of
from .mesh import Approach, Mesh, Spot
from .model import Model
from .segments import one_sided

__all__ = [
    "NONE",
    "Stops",
    "Unilateral",
    "UnilateralRows",
    "all_stops",
    "rows_of",
    "switched_over",
    "unilaterals",
    "worst_of",
]

Stops = tuple[tuple[str, str], ...]
"""A choice: springs at a stop: name, and low or high; tendons slack or let out: name, and slack or released."""


@dataclass(frozen=True)
class Unilateral:
    """A unilateral constraint.

    Attributes
    ----------
    table, name : str
        ``tendons``, ``springs`` or ``contacts``, and the name of the record.
    side : str
        ``slack`` of a tendon; ``low`` or ``high`` of a stop; ``touching`` of an obstacle.
    spot : Spot, Approach or None
        Where an obstacle stops a member in a motion, or members are near to each other.
    """

    table: str
    name: str
    side: str
    spot: Spot | Approach | None = None

    @property
    def where(self) -> str:
        """Where it stands in the scene."""
        return f"{self.table}.{self.name}"

    @property
    def row(self) -> str:
        """Name of its row where it is active."""
        return row_of(self.table, self.name, self.side)

    @property
    def sign(self) -> float:
        """Times its multiplier its margin while it is active; times its gap minus that while it is not."""
        return -1.0 if self.side in ("low", "touching") else 1.0

    @property
    def entry(self) -> tuple[str, str]:
        """As it stands in a choice: a stop if it is active, a tendon if it is not."""
        return self.name, self.side

    def active(self, stops: Stops) -> bool:
        """Whether it is active in a choice."""
        return (self.entry in stops) != (self.side == "slack")

    def becomes(self, stops: Stops) -> str:
        """What happens to it in a sentence where it is switched in a choice: ``tendons.cable goes slack``."""
        if self.side == "slack":
            return f"{self.table}.{self.name} {'goes slack' if self.active(stops) else 'becomes taut'}"
        return f"{self.table}.{self.name} {'leaves' if self.active(stops) else 'reaches'} its {self.side} stop"

    def is_told(self, stops: Stops) -> str:
        """What it is in a choice: ``tendons.cable slack``."""
        if self.side == "slack":
            return f"{self.table}.{self.name} {'taut' if self.active(stops) else 'slack'}"
        return f"{self.table}.{self.name} {'at' if self.active(stops) else 'off'} its {self.side} stop"

    @property
    def undecided(self) -> str:
        """What it is in a sentence where its margin is zero: ``tendons.cable is neither taut nor slack``."""
        if self.side == "slack":
            return f"{self.table}.{self.name} is neither taut nor slack"
        return f"{self.table}.{self.name} touches its {self.side} stop without a force"


def unilaterals(scene: Scene) -> tuple[Unilateral, ...]:
    """The unilateral constraints of a scene but its obstacles: tendons first, in its order."""
    return tuple(Unilateral(*one) for one in one_sided(scene))


def worst_of(margins: Array, active: Array, strings: Array, least: float) -> int | None:
    """Number of the constraint to switch next; None where no margin (n,) is below zero by more than ``least``.

    Strings come before stops: of those that push the one that pushes most, else of those that are longer than they can
    be the longest; of what a symmetry makes the same the first.

    Parameters
    ----------
    margins : ndarray (n,)
        Dimensionless.
    active, strings : ndarray (n,) of bool
        Which are active, and which are strings.
    least : float
    """
    for table in (True, False):
        for acting in (True, False):
            wrong = np.where((strings == table) & (active == acting), np.maximum(-margins, 0.0), 0.0)
            if wrong.max(initial=0.0) > least:
                return first_of_largest(wrong)
    return None


def switched_over(stops: Stops, which: Iterable[Unilateral]) -> Stops:
    """A choice in which some constraints are active that were not, and the other way round."""
    for one in which:
        stops = tuple(e for e in stops if e != one.entry) if one.entry in stops else (*stops, one.entry)
    return tuple(sorted(stops))


# -- all of them in one model, switched on and off from one time to the next --------------------------------


@dataclass(frozen=True, eq=False)
class UnilateralRows:
    """The rows of a model that contains all unilateral constraints.

    Attributes
    ----------
    parts : tuple of Unilateral
        What each is.
    rows : ndarray (n,)
        Their numbers among the rows.
    signs : ndarray (n,)
        1 where a row must not be above zero, and its multiplier not below; -1 where it is the other way round.
    restitution : ndarray (n,)
        Speed after an impact over that before.
    """

    parts: tuple[Unilateral, ...]
    rows: Index
    signs: Array
    restitution: Array

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def names(self) -> list[str]:
        """Where each stands in the scene."""
        return [part.where for part in self.parts]

    def mesh(self, mesh: Mesh, acting: Array) -> Mesh:
        """The mesh of the choice in which those are active whose number in ``acting`` (n,) is not zero."""
        pairs = list(zip(self.parts, (acting != 0.0).tolist(), strict=True))
        stops = tuple(part.entry for part, now in pairs if part.spot is None and now != (part.side == "slack"))
        # Forces along obstacles are loads there.
        now_acting = [part.spot for part, now in pairs if now]
        spots = tuple(replace(spot, rubs=False) for spot in now_acting if isinstance(spot, Spot))
        approaches = tuple(spot for spot in now_acting if isinstance(spot, Approach))
        return replace(mesh, stops=stops, spots=None if mesh.spots is None else spots, approaches=approaches)

    def acting(self, stops: Stops) -> Array:
        """The numbers (n,), one of those that are active, of a choice; no obstacle is."""
        return np.array([part.spot is None and part.active(stops) for part in self.parts], dtype=float)


NONE = UnilateralRows((), np.zeros(0, np.intp), np.zeros(0), np.zeros(0))
"""No row."""


def all_stops(scene: Scene) -> Stops:
    """The choice in which all are active."""
    return tuple(part.entry for part in unilaterals(scene) if part.table == "springs")


def rows_of(model: Model) -> UnilateralRows:
    """The rows of a model in which all unilateral constraints of its scene are active; none where it has none."""
    scene, names = model.scene, model.row_names
    spots: tuple[Spot | Approach, ...] = (*(model.mesh.spots or ()), *model.mesh.approaches)
    touching = [Unilateral("contacts", spot.contact, "touching", spot) for spot in spots]
    parts = (*unilaterals(scene), *touching)
    number = {name: i for i, name in enumerate(names)} if touching else {}
    found, restitution = [], np.zeros(len(parts))
    for i, part in enumerate(parts):
        if part.spot is not None:
            found.append(number[part.spot.name])
            restitution[i] = scene.contacts[part.name].restitution
        else:
            found.append(names.index(part.row))
    return UnilateralRows(parts, np.array(found, dtype=np.intp), np.array([part.sign for part in parts]), restitution)
