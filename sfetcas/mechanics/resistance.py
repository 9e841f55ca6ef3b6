"""Check for stiffness that is negligible beside the loads, so that deflections would be meaningless."""

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
    """Refuse members and springs whose stiffness is negligible beside the loads or the stiffest member, but not zero.

    Raises
    ------
    SceneError
        Names the motion that nothing resists, its stiffness and what it is compared with.
    """
    length = max(line.length for line in scene.center_lines.values())
    with np.errstate(over="ignore"):
        loads = _factor(scene) * load_size(scene, length)
        found = list(_stiffnesses(scene))
        stiffest = max((stiffness for *_, stiffness, member in found if member), default=0.0)
        for where, motion, stiffness, member in found:
            beside, what = max((loads, "loads"), (stiffest if member else 0.0, "a stiffness"))
            if 0.0 < stiffness < WEAK * beside:
                message = (
                    f"nothing resists its {motion}: found a stiffness of {stiffness:.3g} N m beside {what} of "
                    f"{beside:.3g} N m, accepted: from {WEAK:g} of this on"
                )
                raise SceneError(message, where)


def _factor(scene: Scene) -> float:
    """The largest factor that a load of the scene is multiplied by."""
    steps = scene.analysis.span if scene.analysis.type == "path" else scene.analysis.steps
    grown = [history.factor(step) for history in scene.histories.values() for step in steps]
    return max(map(abs, [*steps, *grown]))


def _stiffnesses(scene: Scene) -> Iterator[tuple[tuple[str, ...], str, float, bool]]:
    """Place, motion and stiffness, N m, of all that is elastic, least and largest, and whether it is a member."""
    space, x = scene.resolved_dimension == "space", np.linspace(0.0, 1.0, 5)
    for name, member in scene.members.items():
        line = scene.center_lines[name]
        if member.stiffness is not None:
            length = line.length
            unit = np.tile([1.0, 1.0, 1.0, length, length, length], len(member.nodes))
            largest = float(np.abs(np.asarray(member.stiffness) / np.outer(unit, unit)).max()) * length**2
            yield ("members", name, "stiffness"), "deformation", largest, True
        elif member.section is not None and member.type != "rigid":
            values = scene.sections[member.section].stiffness(x) / line.length
            for i in range(3) if space else [line.bending_axis - 1]:
                for value in (values[:, i].min(), values[:, i].max()):
                    yield ("members", name), "bending" if i else "torsion", float(value), True
    for name, spring in scene.springs.items():
        turning = spring.type == "rotational"
        lever = 1.0 if turning else max(line.length for line in scene.center_lines.values()) ** 2
        motion = f"{'turn' if turning else 'travel'} at node {spring.node!r}"
        yield ("springs", name, "stiffness"), motion, spring.stiffness * lever, False
