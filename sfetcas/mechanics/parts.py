"""The numbered parts of a scene on a mesh, from which the terms of its Lagrangian are made."""

from __future__ import annotations

from dataclasses import dataclass

from ..description.scene import Scene
from .beams import Beams, Scales
from .elements import Element
from .mesh import Mesh
from .rotations import Rotations
from .segments import Segments

__all__ = ["Parts"]


@dataclass(frozen=True, eq=False)
class Parts:
    """What the makers of terms need to know: where a term acts, and in which units its data are.

    Attributes
    ----------
    scene, mesh, element, scales
        The scene, its mesh, the element type, and the units of all data.
    beams : Beams
        Stiffness, tangents and weights of the elements.
    segments : Segments
        Members divided at places, and the numbers of these.
    rotations : Rotations
        Numbers of the rotations, and how each is restrained.
    """

    scene: Scene
    mesh: Mesh
    element: Element
    scales: Scales
    beams: Beams
    segments: Segments
    rotations: Rotations
