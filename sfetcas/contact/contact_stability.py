"""Stability of states in contact: with the places of contact fixed along members, and free to slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..mechanics.mesh import Touch
from ..solvers.stability import Stability
from .rolling import rolling
from .settling import Held, Settler, Way

__all__ = ["ContactStability", "can_switch_branch"]

IDLE = 1e-7
"""Largest pressure between the ends of a stretch that counts as none, share of the force on the stretch."""

STRAIGHT = 1e-4
"""Curvatures, times the length scale, that count as zero: those of a straight member on a coarse mesh."""


def can_switch_branch(held: Held) -> bool:
    """Whether the loads have a potential and the constraints leave an unknown free, so that a state can be left."""
    equations = held.prepared.equations
    return held.prepared.model.minimisable and equations.rows < equations.unknowns


class ContactStability:
    """Tests of states in contact of one scene."""

    def __init__(self, settler: Settler) -> None:
        self.settler = settler

    def strictly(self, held: Held, way: Way) -> Stability | None:
        """The stability test with sliding places, with a nan eigenvalue; None if sliding changes nothing."""
        judged = rolling(held).stability
        freed = self._freed(held, way) if judged.stable in (True, False) else 0
        if not freed:
            return None
        ways_out = max(judged.negative + freed, 0)
        return replace(judged, stable=ways_out == 0, negative=ways_out, smallest=np.nan)

    def judged(self, held: Held, way: Way) -> Stability:
        """The stability test of a state; sliding places count only where they make an unstable state stable.

        A stretch without pressure may leave its obstacle between its ends: only these are constrained.
        """
        held = self.pressing(held, way)
        stability = rolling(held).stability
        if stability.negative > 0 and stability.negative + self._freed(held, way) <= 0:
            # The smallest eigenvalue was that of places that do not slide.
            stability = replace(stability, stable=True, negative=0, smallest=np.nan)
        return stability

    def pressing(self, held: Held, way: Way) -> Held:
        """The state with stretches without pressure replaced by their ends; the same one if there are none."""
        touches: list[Touch] = []
        for touch in held.mesh.touches:
            if touch.to is None:
                touches.append(touch)
                continue
            pressed = held.touched.pressures(touch, np.linspace(touch.at, touch.to, 9))
            idle = np.abs(pressed).max() < IDLE * float(np.linalg.norm(held.touched.force(touch)))
            if idle and all(0.0 < x < 1.0 or held.touched.goes_on(touch, x) for x in touch.places):
                inner = [x for x in touch.places if 0.0 < x < 1.0]
                ends = (replace(touch, at=x, to=None, flat=True) for x in inner)
                touches += [replace(end, number=touch.number + 50 * i) for i, end in enumerate(ends)]
            else:
                touches.append(touch)
        if [t.to for t in touches] == [t.to for t in held.mesh.touches]:
            return held
        source = held.prepared.model, held.corrected.state
        return self.settler.solved(replace(held.mesh, touches=tuple(touches)), source, way) or held

    def _freed(self, held: Held, way: Way) -> int:
        """Number of further negative eigenvalues when places of contact may slide along their members.

        With f the force and g the gap, the Lagrangian ``Pi - f g(x, s)`` has the places s among its unknowns;
        its inertia counted with s eliminated last and first gives the two numbers of ways out.
        """
        touched, touches = held.touched, held.mesh.touches
        free = [(i, k) for i, t in enumerate(touches) for k, x in enumerate(t.places) if 0.0 < x < 1.0]
        # Rolling on planes is among the entries already.
        kinds = [touched.obstacles[touches[i].contact].kind for i, _ in free]
        single = [
            j for j, (i, _) in enumerate(free) if touches[i].to is None and not touches[i].flat and kinds[j] != "flat"
        ]
        # Where the member is straight at an edge, as before an end that hangs over, sliding changes nothing.
        single = [j for j in single if not self._straight_over_edge(held, touches[free[j][0]])]
        if not single:
            return 0
        slopes = self.settler.slopes(held, way)
        if slopes is None:
            return 0
        own = np.array([touched.gap_curvature(touches[free[j][0]]) for j in single])
        push = np.array([touched.push(touches[free[j][0]]) for j in single])
        sharp = np.array([touched.obstacles[touches[free[j][0]].contact].kind == "sharp" for j in single])
        weight = np.where(sharp, push * own, -push)
        last = weight[:, None] * slopes[np.ix_(single, single)]
        first = np.where(sharp, push * own, -push * own)
        return int((np.linalg.eigvalsh(0.5 * (last + last.T)) < 0.0).sum()) - int((first < 0.0).sum())

    @staticmethod
    def _straight_over_edge(held: Held, touch: Touch) -> bool:
        bent = abs(held.touched.gap_curvature(touch)) * held.prepared.model.scales.length
        return held.touched.obstacles[touch.contact].kind == "sharp" and bent < STRAIGHT
