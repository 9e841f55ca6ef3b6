"""Paths of scenes whose laws have memory: what they compare between two meshes, and what they leave out.

Each point remembers what has led there, so a path is one sequence on one mesh.  What is compared are its limit points,
bifurcations and crossings, and samples: where both sequences meet the same factors between the same limit points.
Fronts between elastic and inelastic parts within elements leave errors of their own, see
:mod:`~sfetcas.mechanics.fronts`; they are those across the path, on which the factor gives way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..description.task import Analysis
from ..equilibria.memory_steps import left_by_fronts, worst_fronts
from ..mathematics.arrays import Array
from ..mechanics.accuracy import largest_difference
from ..mechanics.mesh import Mesh
from ..solvers.arclength import Curve, Standing
from .switching import Followed

__all__ = ["HILL", "MISSING", "chosen_of", "left_along", "refined_by_fronts", "sampled_again", "steps_of"]

MISSING = 0.1
"""Share of the accuracy that steps may leave out of what members remember, over a length of the path of one radian."""

POINTS = 1000
"""Points after which such a path ends if the scene does not say: where places begin to unload its steps are short."""

FEW = 0.1
"""Share of the elements up to which none is halved by itself, as each mesh takes a path of its own."""

MUCH = 16.0
"""Times more than the accuracy that an element, were all like it, leaves by its front if it is halved twice at once."""

HILL = (
    "laws with memory: stability and bifurcations are those of the stiffness while all that yields or transforms goes "
    "on to do so; branches are not followed"
)
"""A note on what critical points mean: Hill's comparison solid."""


def steps_of(analysis: Analysis) -> int:
    """Points after which a path ends."""
    return analysis.points if "points" in analysis.model_fields_set else POINTS


def chosen_of(curve: Curve, traced: Followed, steady: float, count: int) -> list[Standing]:
    """About so many points along a stretch, at which the factor changes by a share of the length at least."""
    points = [p for p in traced.points if abs(p.tangent.factor) >= steady * curve.unit and not p.inertia.zero]
    places = np.unique(np.linspace(0, len(points) - 1, count).round().astype(int)).tolist() if points else []
    return [points[i] for i in places]


def sampled_again(
    chosen: list[Standing], coarse: Followed, fine: Followed, met_at: Callable[[list[Standing], float], list[Standing]]
) -> float:
    """Largest difference of chosen points of a coarse stretch from those of a fine one with the same factors.

    Each is looked for between the same limit points, between which each factor occurs once; ``met_at`` finds the points
    of a stretch at a factor.
    """
    largest = 0.0
    for part, other in zip(_monotone(coarse), _monotone(fine), strict=False):
        own = {id(point) for point in part}
        for one in (point for point in chosen if id(point) in own):
            met = met_at(other, one.factor)
            if met:
                largest = max(largest, largest_difference(one.fields, met[0].fields))
    return largest


def _monotone(traced: Followed) -> list[list[Standing]]:
    """The points from one limit point to the next, both included."""
    limits = {id(event.standing) for event in traced.events if event.kind == "limit"}
    limits |= {id(change.standing) for change in traced.transitions if change.turns}
    ends = [i for i, point in enumerate(traced.points) if id(point) in limits]
    return [traced.points[a : b + 1] for a, b in zip([0, *ends], [*ends, len(traced.points) - 1], strict=True)]


def left_at(curve: Curve, point: Standing) -> Array:
    """What fronts leave across the path at one of its points, (elements,), see :func:`.left_by_fronts`."""
    row, along = curve.weight * point.tangent.z, point.tangent.z

    def across(moved: Array) -> Array:
        return np.asarray(moved - np.outer(along, row @ moved))

    return left_by_fronts(point, across)


def left_along(curve: Curve, points: list[Standing]) -> Callable[[float], float]:
    """What fronts leave up to an arc length, rad, from some of the points of a path: all that follows remembers it."""
    found = [(point.arc, float(left_at(curve, point).sum())) for point in points]
    return lambda arc: max((left for place, left in found if place <= arc), default=0.0)


def refined_by_fronts(curve: Curve, points: list[Standing], accuracy: float, fixed: set[str]) -> Mesh | None:
    """The mesh with elements halved whose fronts leave most at some of the points, if that is too much.

    What a front leaves falls by four with each halving: where it is much too much, an element is halved twice.  None
    where these are so few elements that all may be halved instead.
    """
    mesh, most = curve.model.mesh, np.zeros(curve.model.mesh.elements)
    for point in points:
        fronts = left_at(curve, point)
        worst = worst_fronts(fronts, accuracy)
        most = np.maximum(most, np.where(worst, fronts * worst.sum() / accuracy, 0.0))
    if (most > 0.0).sum() <= FEW * mesh.elements:
        return None
    by_member = {n: most[curve.model.elements_of(n)] * (n not in fixed) for n in mesh.cuts}
    once, much = ({n: part > least for n, part in by_member.items()} for least in (0.0, MUCH))
    return mesh.refined(once).refined({n: np.repeat(much[n], 1 + once[n]) for n in once})
