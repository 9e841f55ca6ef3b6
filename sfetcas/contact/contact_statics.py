"""States of a scene with obstacles in which touches are conditions of elements: ways to them, and their stability."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np

from .. import tolerances
from ..description.obstacles import members_of, nearest
from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.mesh import Mesh, Touch
from ..solvers.continuation import between
from ..solvers.prepared import Prepared
from ..solvers.stability import Stability
from .settling import Held, Way
from .touches import COARSE, edge_sides
from .touching import Toucher

__all__ = ["ContactRun"]


class ContactRun:
    """States in contact at the load factors of a scene.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    accuracy : float
        Wanted error of the positions over the size of the scene.
    """

    def __init__(self, scene: Scene, prepare: Callable[[Mesh], Prepared], accuracy: float) -> None:
        self.scene = scene
        self.toucher = Toucher(scene, prepare, COARSE, edge_sides(scene))
        self.settler, self.reviser = self.toucher.settler, self.toucher.reviser
        self.stability = self.toucher.stability
        self.fine = max(tolerances.CLOSED, 0.1 * accuracy)
        self.prepare = prepare

    # -- ways -----------------------------------------------------------------------------------

    def grown(self, base: Mesh, factor: float) -> Held | None:
        """The state followed from the undeformed scene, loads and motions growing together; None if it is lost."""
        start: Held | tuple[Touch, ...] = self.first_touches
        if self.scene.histories and factor != 0.0:
            held = self.toucher.follow(base, lambda t: Way(lambda model: model.loading(0.0, t), {}), start)
            if held is None:
                return None
            start = held
        return self._through(base, 0.0, factor, start)

    def _factors(self, begin: float, end: float) -> list[float]:
        """Factors from one to another, where histories have knots."""
        low, high = min(begin, end), max(begin, end)
        knots = {t for history in self.scene.histories.values() for t in history.knots if low < t < high}
        return [begin, *sorted(knots, reverse=end < begin), end]

    def _through(self, base: Mesh, begin: float, end: float, start: Held | tuple[Touch, ...]) -> Held | None:
        stops = self._factors(begin, end)
        held: Held | None = None
        for a, b in zip(stops, stops[1:], strict=False):
            way = _between(a, b)
            held = self.toucher.follow(base, way, start)
            if held is None:
                return None
            start = held
        return held

    @functools.cached_property
    def first_touches(self) -> tuple[Touch, ...]:
        """The touches in the undeformed scene."""
        found: list[Touch] = []
        for contact, stop in self.scene.obstacles.items():
            for member in members_of(self.scene.contacts[contact], self.scene.members):
                line = self.scene.center_lines[member]
                x = np.linspace(0.0, 1.0, 257)
                if stop.kind == "sharp":
                    way = self.reviser.sides[contact, member]
                    places = np.array(nearest(stop, line.positions, line.tangents, x))
                    gaps = stop.gaps(line.positions(places), line.tangents(places), 0.0, way) if len(places) else places
                    found += [
                        Touch(contact, member, float(p), way=way)
                        for p, gap in zip(places, gaps, strict=True)
                        if abs(gap) < tolerances.CLOSED * self.scene.size
                    ]
                    continue
                gaps = stop.gaps(line.positions(x), line.tangents(x))
                found += self._lying(contact, member, x, gaps)
        return self.reviser.numbered(tuple(found))

    def _lying(self, contact: str, member: str, x: Array, gaps: Array) -> Iterator[Touch]:
        """Places and stretches of the undeformed member at no distance."""
        near = np.abs(gaps) < tolerances.CLOSED * self.scene.size
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        nodes = self.scene.members[member].nodes
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            low, high = float(x[a]), float(x[b - 1])
            if b - a == 1:
                if 0.0 < low < 1.0 or self.reviser.takes_part(contact, nodes[int(low)]):
                    yield Touch(contact, member, low)
                continue
            yield Touch(contact, member, low, high)

    def at(self, factor: float) -> Way:
        """The loads at a factor as a point of a way."""
        return Way(lambda model: model.loading(factor), {})

    # -- stability ------------------------------------------------------------------------------

    def _stability(self, held: Held, way: Way) -> tuple[Stability, list[str]]:
        """Stability with what touches held on its obstacles, free to slide along them."""
        notes: list[str] = []
        touched, touches = held.touched, held.mesh.touches
        stability = self.stability.judged(held, way)
        if touches:
            notes.append(f"in contact: {_told(held)}; stability is that with these places held on their obstacles")
        pushes = {touch.name: float(np.linalg.norm(touched.force(touch))) for touch in touches}
        largest = max([held.prepared.model.scales.force, *pushes.values()])
        weak = [name for name, push in pushes.items() if push < tolerances.BALANCED * largest]
        if weak:
            notes.append(f"touches without force: {', '.join(weak)}")
        return stability, notes

    def certified(self, held: Held, factor: float) -> tuple[Stability, tuple[str, ...]]:
        """Stability of a state on its mesh, with sliding places counted in both directions, and notes."""
        way = self.at(factor)
        stability, notes = self._stability(held, way)
        return self.stability.strictly(held, way) or stability, tuple(notes)


def _between(a: float, b: float) -> Callable[[float], Way]:
    return lambda t: Way(lambda model: between(model, a, b)(t), {})


def _told(held: Held) -> str:
    parts = []
    for touch in held.mesh.touches:
        where = f"at {touch.at:.6g}" if touch.to is None else f"from {touch.at:.6g} to {touch.to:.6g}"
        parts.append(f"{touch.member} on {touch.contact} {where}")
    return ", ".join(parts)
