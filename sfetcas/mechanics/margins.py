"""Margins of unilateral constraints at a state: what is left of a tension, a reaction or a gap."""

from __future__ import annotations

from collections.abc import Mapping

from .fields import Fields
from .unilateral import Unilateral, unilaterals

__all__ = ["ROUNDING", "margins"]

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
