"""Gaps of all that may touch in a motion with many touches, and their derivatives; dimensionless.

A gap is that between two places on members, or between a place on a member and an obstacle.  Its derivatives are those
at fixed places, as it is least there.  Between two states the normal ``(d_0 + d_1) / (|d_0| + |d_1|)`` and the mean of
the lines make them exact: times what the unknowns gain they give what the gap does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..contact.closest import Closest
from ..contact.nearby import Nearby, Places
from ..mathematics.arrays import TINY, Array, Index, Sparse
from ..mechanics.center_lines import Curve, Lines
from ..mechanics.mesh import Spot
from ..mechanics.spots import spots_of
from .stages import StageEquations

__all__ = ["Rows", "Touching"]


@dataclass(frozen=True, eq=False)
class Rows:
    """Gaps of pairs of places and of places on obstacles, with directions in which these count.

    Attributes
    ----------
    gaps : ndarray (n,)
    normals : ndarray (n, axes)
        Unit vectors along which forces act on the first.
    """

    gaps: Array
    normals: Array


class Touching:
    """What may touch in a system, and the rows of what is near.

    Parameters
    ----------
    system : StageEquations
    """

    def __init__(self, system: StageEquations) -> None:
        model = system.model
        scene, self.unit, self.axes = model.scene, model.scales.length, model.element.axes
        self.lines = Lines(system.tables)
        self.nearby = Nearby(self.lines, Closest(scene))
        self.spots = spots_of(scene, model.mesh)
        self.places = np.array([model.segments.place(spot.place) for spot in self.spots], np.intp)
        self._rest = np.array([self._undeformed(scene, spot) for spot in self.spots]).reshape(-1, 3)[:, : self.axes]
        names = np.array([spot.contact for spot in self.spots], dtype=object)
        self._groups = [(scene.obstacles[name], np.flatnonzero(names == name)) for name in dict.fromkeys(names)]
        self.distance = float(self.nearby.distance.min(initial=np.inf))
        rebounds = [scene.contacts[name].restitution for name in (pair.contact for pair in self.nearby.pairs)]
        self.rebounds = np.array(rebounds), np.array([scene.contacts[s.contact].restitution for s in self.spots])

    def _undeformed(self, scene: Any, spot: Spot) -> Array:
        return np.asarray(scene.center_lines[spot.member].positions(np.array([spot.at]))[0]) / self.unit

    def on_obstacles(self, places: Array, before: Array | None = None) -> Rows:
        """Gaps (spots,) for displacements (places, axes) of all places, and normals; those between two states with the
        displacements ``before``.
        """
        gaps, normals = np.zeros(len(self.spots)), np.zeros((len(self.spots), self.axes))
        for stop, here in self._groups:
            across = stop.across[: self.axes, : self.axes]
            middle = stop.place[: self.axes] / self.unit
            out = (self._rest[here] + places[self.places[here]] - middle) @ across
            if stop.kind == "flat":
                normals[here] = stop.normal[: self.axes]
                gaps[here] = np.einsum("ni,ni->n", out, normals[here])
                continue
            apart = np.linalg.norm(out, axis=1)
            gaps[here] = stop.sign * (apart - stop.radius / self.unit)
            if before is not None:
                other = (self._rest[here] + before[self.places[here]] - middle) @ across
                out, apart = out + other, apart + np.linalg.norm(other, axis=1)
            normals[here] = stop.sign * out / np.maximum(apart, TINY)[:, None]
        return Rows(gaps, normals)

    def between(self, curve: Curve, places: Places, before: Curve | None = None) -> Rows:
        """As :meth:`on_obstacles` of pairs of places on members."""
        d = self.nearby.between(curve, places)
        apart = np.linalg.norm(d, axis=1)
        gaps = apart - self.nearby.distance[places.pairs]
        if before is not None:
            other = self.nearby.between(before, places)
            d, apart = d + other, apart + np.linalg.norm(other, axis=1)
        return Rows(gaps, d / np.maximum(apart, TINY)[:, None])

    def derivatives(self, curve: Curve, places: Places, spots: Index, between: Rows, on: Rows) -> Sparse:
        """Derivatives (rows, total) of gaps at given normals: of pairs, then of some spots."""
        from scipy.sparse import vstack

        lines = self.lines
        pairs = lines.derivatives(curve, places.one, between.normals) - lines.derivatives(
            curve, places.other, between.normals
        )
        return vstack([pairs, lines.of_places(self.places[spots], on.normals[spots])]).tocsr()
