"""Forces along lines of contact as densities, which a state has whatever its mesh.

Each place of a line stands for what is spread along the elements beside it, see
:mod:`~sfetcas.mechanics.contact_lines`: together a density that is linear along each element.  On another mesh, or
where a force on two elements is parted into one on each, places take their forces from that.  With friction Newton's
method would not find them again from nothing.
"""

from __future__ import annotations

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.model import Model
from ..mechanics.segments import beside_line
from ..solvers.prepared import Solved
from .pairs import PairKey

__all__ = ["Numbers", "Spread"]

INSIDE = 1e-9
"""Share of an element by which it is looked inside of its end for what is on its side of that."""


class Numbers:
    """Where the multipliers and the forces of points are among those of a model.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    rows, unknowns : dict of int
        Numbers of multipliers by the names of rows, and of displacements by their names.
    axes : int
    """

    def __init__(self, model: Model) -> None:
        self.rows = {name: i for i, name in reversed(list(enumerate(model.row_names)))}
        self.unknowns = {name: i for i, name in enumerate(model.positions.unknowns)}
        self.axes = model.element.axes

    def multipliers(self, point: ContactPoint) -> list[int]:
        """Those of a point."""
        return [self.rows[name] for name in point.rows(self.axes)]

    def forces(self, point: ContactPoint) -> list[int]:
        """Displacements that are the force across and the friction of a point; none without friction."""
        ways = ("across", "along", "along too")[: self.axes] if point.grip is not None else ()
        return [self.unknowns[f"{point.pressed}, {way}"] for way in ways]


class Spread:
    """What is spread along the lines of a state.

    Parameters
    ----------
    found : Solved
    """

    def __init__(self, found: Solved) -> None:
        self._mesh = mesh = found.model.mesh
        numbers = Numbers(found.model)
        self._densities: dict[PairKey, Array] = {}
        for point in mesh.points:
            if point.line:
                lam, y = found.state.lam[numbers.multipliers(point)], found.state.y[numbers.forces(point)]
                cuts, own = mesh.cuts[point.members[0]], np.concatenate([lam, y])
                whole = self._densities.setdefault(point.pair, np.zeros((len(cuts) - 1, 2, len(own))))
                for element, ends, share in beside_line(mesh, point):
                    whole[element, int(ends)] += share * own / (cuts[element + 1] - cuts[element])

    def of(self, mesh: Mesh, point: ContactPoint) -> Array | None:
        """Multipliers and forces of a point of a line on a mesh, as of :class:`Numbers`; None where no line was."""
        densities, (member, *_) = self._densities.get(point.pair), point.members
        if densities is None:
            return None
        cuts, before, total = mesh.cuts[member], self._mesh.cuts[member], np.zeros(densities.shape[-1])
        for element, ends, _ in beside_line(mesh, point):
            length = float(cuts[element + 1] - cuts[element])
            x = cuts[element] + length * (1.0 - INSIDE if ends else INSIDE)
            former = self._mesh.element_at(member, x)
            low, high = densities[former]
            share = (x - before[former]) / (before[former + 1] - before[former])
            total += length * ((1.0 - share) * low + share * high)
        return total
