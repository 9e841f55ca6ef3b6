"""Members cut into segments between places, and which displacements have to be unknowns of their own.

A *place* is a node of the scene, a cut of a member whose displacement is asked for by itself (a load there turns
with the section), or the end of a member that slides along its node.  A *segment* is a run of elements of one
member between two places; most members are one segment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .arrays import Index
from .mesh import Mesh
from .scene import Scene

__all__ = ["Segment", "Segments", "cut_members"]


@dataclass(frozen=True)
class Segment:
    """A run of elements of a member, numbered in the model, between two places."""

    member: str
    elements: slice
    start: str
    end: str


@dataclass(frozen=True, eq=False)
class Segments:
    """All segments and places of a model.

    Attributes
    ----------
    places : tuple of str
        The nodes of the scene, then cuts and sliding ends.
    kept : frozenset of str
        Places whose displacement is prescribed or an unknown in either assembly.
    parts : tuple of Segment
        In the order of their elements.
    owner : ndarray (elements,)
        Number of the segment of an element.
    ends : mapping of (str, int) to str
        Place of the first (0) and the second end (1) of a member.
    """

    places: tuple[str, ...]
    kept: frozenset[str]
    parts: tuple[Segment, ...]
    owner: Index
    ends: Mapping[tuple[str, int], str]

    @property
    def first(self) -> Index:
        """Number of the first element of each segment."""
        return np.array([part.elements.start for part in self.parts], dtype=np.intp)

    def place(self, name: str) -> int:
        """Number of a place."""
        return self._number[name]

    @property
    def _number(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.places)}


def cut_members(scene: Scene, mesh: Mesh) -> Segments:
    """The segments of a scene on a mesh."""
    places, ends = list(scene.nodes), {}
    kept: set[str] = set()
    parts: list[Segment] = []
    begin = 0
    for name, member in scene.members.items():
        for i, (node, release) in enumerate(zip(member.nodes, member.release, strict=True)):
            ends[name, i] = node
        if name not in mesh.cuts:
            continue
        count = len(mesh.cuts[name]) - 1
        parts.append(Segment(name, slice(begin, begin + count), ends[name, 0], ends[name, 1]))
        begin += count
    sizes = [part.elements.stop - part.elements.start for part in parts]
    owner = np.repeat(np.arange(len(parts)), sizes)
    return Segments(tuple(places), frozenset(kept), tuple(parts), owner, ends)
