"""Quantities along members by which pictures colour them.

Each is one entry of :data:`QUANTITIES`: all that a new one needs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..description.answers import outlined
from ..description.records import unknown
from ..description.scene import Scene
from ..equilibria.solution import Configuration
from ..errors import SceneError
from ..mathematics.arrays import Array
from .sketch import tangents_of

__all__ = ["NONE", "QUANTITIES", "ColourQuantity", "coloured"]

NONE = "none"
"""Name of the choice to colour nothing."""

Along = Callable[[Configuration, str, Array, Mapping[str, Array]], Array]
"""(state, member, fractions of its length (n,), fields there) -> values (n,) in SI units."""


@dataclass(frozen=True)
class ColourQuantity:
    """A quantity along members.

    Attributes
    ----------
    plane, space : str
        What it is called in a plane and in a spatial scene.
    unit : str
    values : callable
        (state, member, fractions of its length (n,), fields there) -> (n,) in the SI unit.
    signed : tuple of bool
        Whether it has a sign in the plane and in space: then colours go from one side through grey to the other.
    rounding : callable
        State -> size up to which values are rounding, given the largest section force, N.
    """

    plane: str
    space: str
    unit: str
    values: Along
    signed: tuple[bool, bool]
    rounding: Callable[[Configuration, float], float]

    def label(self, space: bool) -> str:
        """What it is called."""
        return self.space if space else self.plane

    def diverging(self, space: bool) -> bool:
        """Whether it has a sign."""
        return self.signed[space]

    def of(self, step: Configuration, fields: Mapping[str, Mapping[str, Array]], x: Mapping[str, Array]) -> list[Array]:
        """Values (n,) along each member; empty where all are rounding.

        Parameters
        ----------
        step : Configuration
        fields : fields of each member, as of :meth:`Configuration.along`
        x : fractions (n,) of its length where they are
        """
        found = [self.values(step, name, x[name], fields[name]) for name in fields]
        force = max(float(np.linalg.norm(entry["force"], axis=1).max()) for entry in fields.values())
        known = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in found]
        return [] if max(known) <= self.rounding(step, force) else found


def coloured(scene: Scene, colour: str) -> ColourQuantity | None:
    """The quantity of a name; None for ``none``.

    Raises
    ------
    SceneError
        There is no such quantity, or no member of the scene has it.
    """
    if colour == NONE:
        return None
    if colour not in QUANTITIES:
        raise SceneError(unknown(str(colour), [*QUANTITIES, NONE]), ("colour",))
    if colour == "stress" and not any(outlined(scene, member) for member in scene.members.values()):
        accepted = "'shape' in the section of a flexible member, or another colour"
        raise SceneError(f"found 'stress', but no section has a shape, accepted: {accepted}", ("colour",))
    return QUANTITIES[colour]


def _along(vectors: Array, tangents: Array) -> Array:
    return np.asarray(np.einsum("ni,ni->n", vectors, tangents))


def _across(vectors: Array, tangents: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors - _along(vectors, tangents)[:, None] * tangents, axis=1))


def _bending(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    if not step.model.space:
        return fields["moment"][:, 2]
    return _across(fields["moment"], tangents_of(step, member, x, fields))


def _twisting(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    return _along(fields["moment"], tangents_of(step, member, x, fields))


def _curving(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    change = fields["curvature"] - step.model.scene.center_lines[member].curvatures(x)
    return np.asarray(np.linalg.norm(change[:, 1:], axis=1)) if step.model.space else change[:, 2]


def _pulling(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    return _along(fields["force"], tangents_of(step, member, x, fields))


def _shearing(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    tangents = tangents_of(step, member, x, fields)
    if step.model.space:
        return _across(fields["force"], tangents)
    return fields["force"][:, 1] * tangents[:, 0] - fields["force"][:, 0] * tangents[:, 1]


def _stressing(step: Configuration, member: str, x: Array, fields: Mapping[str, Array]) -> Array:
    return fields.get("bending_stress", np.full(len(x), np.nan))


def _of_force(step: Configuration, force: float) -> float:
    return max(1e-9 * force, 1e-12 * step.model.scales.force)


def _of_moment(step: Configuration, force: float) -> float:
    return max(1e-9 * force * step.model.scales.length, 1e-12 * step.model.scales.moment)


def _of_curvature(step: Configuration, force: float) -> float:
    return 1e-9 / step.model.scales.length


def _of_stress(step: Configuration, force: float) -> float:
    return 1e-9 * step.model.scales.force / step.model.scales.length**2


QUANTITIES: dict[str, ColourQuantity] = {
    "moment": ColourQuantity("bending moment about z", "bending moment", "N m", _bending, (True, False), _of_moment),
    "magnitude": ColourQuantity(
        "size of bending moment",
        "bending moment",
        "N m",
        lambda *given: np.abs(_bending(*given)),
        (False, False),
        _of_moment,
    ),
    "twist": ColourQuantity("torsional moment", "torsional moment", "N m", _twisting, (True, True), _of_moment),
    "curvature": ColourQuantity(
        "change of curvature about z", "change of bending curvature", "1/m", _curving, (True, False), _of_curvature
    ),
    "tension": ColourQuantity("axial force", "axial force", "N", _pulling, (True, True), _of_force),
    "shear": ColourQuantity("shear force", "shear force", "N", _shearing, (True, False), _of_force),
    "stress": ColourQuantity("bending stress", "bending stress", "Pa", _stressing, (False, False), _of_stress),
}
"""Quantities by the names that ``colour`` takes.

``moment``, ``magnitude``: about z in the plane, in space the size of what is across the tangent; ``twist``: the part of
the moment along the tangent; ``curvature``: what bending adds to the curvature of the undeformed member; ``tension``:
section force along the tangent, below zero in compression; ``shear``: that across it, in the plane to the left;
``stress``: the largest of the fibres, where the section has a shape.
"""
