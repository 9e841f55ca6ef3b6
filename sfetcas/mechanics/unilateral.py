"""Unilateral constraints: strings that pull but do not push, and stops that push but do not pull.

Each is an inequality.  While it is active, its multiplier - a tension, or the reaction of a stop - must not be below
zero; while it is not, its gap must not be: by how much a string is shorter than its free length, or what is left to
the stop.  Both are its margin, dimensionless.  Which of them are active is a choice, which a mesh carries as ``stops``;
where a margin changes its sign the choice is another one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..description.scene import Scene
from .fields import Fields

__all__ = ["ROUNDING", "Stops", "Unilateral", "margins", "switched_over", "unilaterals"]

Stops = tuple[tuple[str, str], ...]
"""A choice: springs at a stop: name, and low or high; tendons slack or let out: name, and slack or released."""

ROUNDING = 1e-12
"""Of margins: what has next to nothing to do stays as it is."""


@dataclass(frozen=True)
class Unilateral:
    """A unilateral constraint.

    Attributes
    ----------
    table, name : str
        ``tendons`` or ``springs``, and the name of the record.
    side : str
        ``slack`` of a tendon; ``low`` or ``high`` of a stop.
    """

    table: str
    name: str
    side: str

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


def unilaterals(scene: Scene) -> tuple[Unilateral, ...]:
    """The unilateral constraints of a scene: tendons first, in its order."""
    strings = [Unilateral("tendons", name, "slack") for name, tendon in scene.tendons.items() if tendon.may_be_slack]
    stopped = [name for name, spring in scene.springs.items() if spring.stop is not None]
    return (*strings, *(Unilateral("springs", name, side) for name in stopped for side in ("low", "high")))


def switched_over(stops: Stops, which: Iterable[Unilateral]) -> Stops:
    """A choice in which some constraints are active that were not, and the other way round."""
    for one in which:
        stops = tuple(e for e in stops if e != one.entry) if one.entry in stops else (*stops, one.entry)
    return tuple(sorted(stops))


def margins(fields: Fields) -> Mapping[Unilateral, float]:
    """The margin of each unilateral constraint at a state, in the choice of its mesh."""
    scene, stops, scales = fields.model.scene, fields.model.mesh.stops, fields.model.scales
    found: dict[Unilateral, float] = {}
    for one in unilaterals(scene):
        if one.table == "tendons":
            pulls = one.active(stops)
            found[one] = (
                fields.tendon(one.name)["tension"] / scales.force if pulls else -fields.beyond(one.name) / scales.length
            )
            continue
        state, limits, high = fields.spring(one.name), scene.springs[one.name].stop, one.side == "high"
        assert limits is not None
        if one.active(stops):
            effort = (state.stop or 0.0) / (scales.moment if state.rotational else scales.force)
            found[one] = -effort if high else effort
        else:
            left = limits[1] - state.travel if high else state.travel - limits[0]
            found[one] = left / (1.0 if state.rotational else scales.length)
    return found
