"""What a scene on a mesh consists of before the terms of its Lagrangian are made."""

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
    """Everything that it takes to say where a term acts and what its data are.

    Attributes
    ----------
    scene, mesh, element, scales
        The scene, its cuts, the element type, and the units in which all data are given.
    beams : Beams
        Stiffness, tangents and weights of the elements.
    segments : Segments
        Members cut between places, and the numbers of these.
    rotations : Rotations
        Numbers and freedoms of the rotations.
    """

    scene: Scene
    mesh: Mesh
    element: Element
    scales: Scales
    beams: Beams
    segments: Segments
    rotations: Rotations
