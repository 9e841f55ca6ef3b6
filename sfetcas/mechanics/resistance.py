"""Stiffness that is nothing beside the loads: what it should resist goes beyond all numbers that mean something."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..description.scene import Scene
from ..errors import SceneError
from .beams import load_size

__all__ = ["check_resistance"]

WEAK = 1e-20
"""Share of the loads: beams of this stiffness bend over 1e-10 of their length, springs turn by 1e20 rad."""


def check_resistance(scene: Scene) -> None:
    """Refuse members and springs whose stiffness is nothing beside the loads, but not zero.

    Raises
    ------
    SceneError
        Names the motion that nothing resists, its stiffness and the size of the loads.
    """
    length = max(line.length for line in scene.center_lines.values())
    factors = scene.analysis.span if scene.analysis.type == "path" else scene.analysis.steps
    scale = 1.0 if scene.histories else max(map(abs, factors))
    with np.errstate(over="ignore"):
        loads = scale * load_size(scene, length)
        for where, motion, stiffness in _stiffnesses(scene):
            if 0.0 < stiffness < WEAK * loads:
                message = (
                    f"nothing resists its {motion}: found a stiffness of {stiffness:.3g} N m under loads of "
                    f"{loads:.3g} N m, accepted: from {WEAK:g} of the loads on"
                )
                raise SceneError(message, where)


def _stiffnesses(scene: Scene) -> Iterator[tuple[tuple[str, ...], str, float]]:
    """Place, motion and stiffness, N m, of all that is elastic."""
    space, x = scene.resolved_dimension == "space", np.linspace(0.0, 1.0, 5)
    for name, member in scene.members.items():
        line = scene.center_lines[name]
        if member.stiffness is not None:
            length = line.length
            unit = np.tile([1.0, 1.0, 1.0, length, length, length], len(member.nodes))
            largest = float(np.abs(np.asarray(member.stiffness) / np.outer(unit, unit)).max()) * length**2
            yield ("members", name, "stiffness"), "deformation", largest
        elif member.section is not None and member.type != "rigid":
            values = scene.sections[member.section].stiffness(x).min(axis=0) / line.length
            for i in range(3) if space else [line.bending_axis - 1]:
                yield ("members", name), "bending" if i else "torsion", float(values[i])
    for name, spring in scene.springs.items():
        turning = spring.type == "rotational"
        lever = 1.0 if turning else max(line.length for line in scene.center_lines.values()) ** 2
        motion = f"{'turn' if turning else 'travel'} at node {spring.node!r}"
        yield ("springs", name, "stiffness"), motion, spring.stiffness * lever
