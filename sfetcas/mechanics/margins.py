"""Margins of unilateral constraints at a state: what is left of a tension, a reaction or a gap."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from .fields import Fields
from .unilateral import Unilateral, unilaterals

__all__ = ["ROUNDING", "UNDECIDED", "margins", "undecided"]

ROUNDING = 1e-12
"""Of margins: what has next to nothing to do stays as it is."""


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


UNDECIDED = 1e-6
"""Margins below which neither side is linear: vibrations as small as those that are seen would cross over."""


def undecided(fields: Fields) -> Iterator[str]:
    """Names of what is neither active nor inactive at a state, as sentences; elastic strings among them."""
    yield from (one.undecided for one, margin in margins(fields).items() if margin < UNDECIDED)
    scene, scales = fields.model.scene, fields.model.scales
    for name, tendon in scene.tendons.items():
        if tendon.elastic_string:
            taut = fields.tendon(name)["tension"] / scales.force
            if max(taut, -fields.balance.elongation(name) / scales.length) < UNDECIDED:
                yield Unilateral("tendons", name, "slack").undecided
