"""What the structure of a model alone says of its equations, kept for models of the same structure.

Numbers of the unknowns, the pattern of the Newton matrix, and which contributions each entry and each residual is the
sum of, follow from what is connected to what.  Scenes that are solved again and again, with other numbers or on the
meshes that another one had, share them.
"""

from __future__ import annotations

import copy
import functools
from typing import Any

import numpy as np

from ..mathematics.arrays import Index
from ..mathematics.keeping import Recent
from .model import Model
from .tables import Tables

__all__ = ["Layout", "layout_of"]

ROOM, LARGEST, EACH = 640_000, 20_000, 5_000
"""Contributions to matrices that layouts which are kept have together, those of the largest, as making larger ones is
little beside what they are for, and what each counts for beside them: the meshes of some scenes.
"""


def layout_of(model: Model) -> Layout:
    """The layout of a model, made now or for one of the same structure before."""
    return _KNOWN.found(_key(model), lambda: Layout(model), lambda layout: EACH + len(layout.entry))


_KNOWN: Recent[Layout] = Recent(ROOM, EACH + LARGEST)


def _key(model: Model) -> Any:
    """Everything that a layout is made of."""
    rotations, segments, positions, angles = model.rotations, model.segments, model.positions, model.unwrapping
    arrays = [rotations.turns, rotations.kind, rotations.axis, segments.owner, segments.first, segments.strains]
    for one in (positions.Y, positions.Z, positions.W, positions.B, positions.BZ):
        arrays += [one.row, one.column, one.value]
    arrays += [positions.retained, angles.sides]
    for group in model.terms:
        arrays += [group.turns, group.places, group.labels]
    return (
        *(group.kind for group in model.terms),
        *(len(group.data) for group in model.terms),
        *(len(segments.places), len(positions.rows), len(positions.unknowns), len(model.row_names)),
        *(model.has_potential, model.conservative),
        *(None if part is None else part.start for part in angles.parts),
        *(array.tobytes() for array in arrays),
    )


class Layout:
    """Pattern of the Newton matrix, and the sums that make its entries and the residuals.

    Attributes
    ----------
    tables : Tables
        Those of the model that it was made for: of others :meth:`tables_of`.
    row, column, diagonal : ndarray
        Rows and columns of the entries of the Newton matrix; which of them are on the diagonal.
    entry, to_entry, weight : ndarray
        Of each contribution to the matrix which of the numbers that are given it is, the entry to which it goes, and
        its weight.
    used, onto, share : ndarray
        Of the sides of all terms, one after the other, those that have an unknown, which one, and their weights.
    retained : ndarray (n, axes)
        Unknowns of the places whose displacements are unknowns by themselves.
    sliding : list of (ndarray (n,), ndarray (n, axes))
        Numbers of unknowns that say how far something has slid along a member, and of the rows of its force.
    unknown : list of ndarray (n, width)
        For each group of terms the unknowns of its sides, -1 where they have none.
    rows : list of ndarray
        For each group the multipliers of its rows.
    given : dict of str to slice
        Where the parts of what is given are in the row that :meth:`.Equations.given` makes of a loading.
    of_core : dict
        The same as the core takes it, by how many copies of it, once it was made.
    programs : dict
        Programs that have been made for models of this structure, by what distinguishes them.
    """

    def __init__(self, model: Model) -> None:
        self.tables = tables = Tables(model)
        row, column, self.weight, self.entry = tables.whole
        total = tables.total
        keys = column * total + row
        # What follows has entries on one side of the diagonal alone; of pressure the symmetric part is taken.
        mirrored = () if model.has_potential or not model.conservative else (row * total + column,)
        places, inverse = np.unique(np.concatenate([keys, *mirrored]), return_inverse=True)
        self.to_entry = inverse[: len(keys)]
        self.row, self.column = places % total, places // total
        self.diagonal = np.flatnonzero(self.row == self.column)
        self.unknown = [np.where(sides < 0, -1, tables.unknown[sides]) for sides in tables.sides]
        self.rows = [(labels - tables.of_rows).ravel() for labels in tables.labels]
        cells = np.concatenate([sides.ravel() for sides in tables.sides])
        unknown = np.concatenate([part.ravel() for part in self.unknown])
        self.used = np.flatnonzero(unknown >= 0)
        self.onto, self.share = unknown[self.used], tables.weight[cells[self.used]]
        self.retained = tables.place_number[(model.positions.retained >= 0).all(axis=1)]
        self.sliding = list(self._sliding(model))
        self.given = self._places_of_given(model)
        self.of_core: dict[int, Any] = {}
        self.programs: dict[Any, Any] = {}
        # What is kept keeps no scene alive.
        del tables.model

    def _places_of_given(self, model: Model) -> dict[str, slice]:
        axes = model.element.axes
        on_places = len(model.segments.places) * axes
        loads = [len(group.data) * group.kind.sizes[4] for group in model.connections]
        sizes = {
            "pull": len(model.segments.owner) * (model.element.order + 1) * axes,
            **{f"loads {i}": size for i, size in enumerate(loads)},
            "shift": on_places,
            "opening": len(model.positions.rows),
            "beside": self.tables.total,
            "force": on_places,
        }
        ends = np.cumsum(list(sizes.values())).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    def tables_of(self, model: Model) -> Tables:
        """The tables of a model of this structure."""
        found = copy.copy(self.tables)
        found.model = model
        return found

    @functools.cached_property
    def absolute_share(self) -> Any:
        """Magnitudes of the weights ``share``."""
        return np.abs(self.share)

    @functools.cached_property
    def transposed(self) -> Index:
        """For each entry of the matrix the number of the one across the diagonal."""
        return np.lexsort((self.column, self.row))

    def _sliding(self, model: Model) -> Any:
        for group in model.connections:
            if group.kind.pulls and len(group.data):
                place = group.places[:, -1]
                unknown = np.where(place < 0, -1, self.tables.place_number[place, 0])
                yield unknown[unknown >= 0], group.labels[unknown >= 0] + len(model.positions.rows)
