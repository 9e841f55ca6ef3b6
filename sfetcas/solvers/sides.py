"""Signs of eigenvectors, and vectors of equal eigenvalues, by a rule that depends on the scene and not on rounding.

An eigenvector has no sign, and equal eigenvalues have no single vectors.  Chosen is the projection, onto the space of
eigenvectors (*shapes*), of reference fields that the scene defines: rotations about the ``b3`` of the sections at the
first ends of members (about z in the plane), which decay exponentially along each member from its first node, and are
smaller the later a member's name stands in the alphabet.  No symmetry of a structure keeps such a field.  If its
projection nearly vanishes, fields of other decay follow, then those about ``b2`` and ``b1``; for shapes in which
nothing rotates, displacements of nodes along the same directions.

Neither the order of a scene file, nor axes or units, nor rounding change what is chosen.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from .. import tolerances
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, first_of_largest
from ..mathematics.keeping import kept
from ..mechanics.equations import Equations
from ..mechanics.rotations import RotationFreedom

__all__ = ["Sides", "alike"]

DECAYS = (2.0, 0.7, 4.0)
"""Decay rates of the reference fields, over the length of the member, in the order of their use."""

WITHOUT_ELEMENTS = 1e-9
"""Weight beside others of members without elements in the mean at a node: they count if there is no other."""

LEAST = 1e-3
"""Least projection of a field, relative to its norm, for it to decide; symmetry leaves 0, rounding 1e-10."""

FADING = 0.125
"""Ratio of successive fields in their sum :attr:`Sides.seed`."""


class Sides:
    """The rule for one model.

    Parameters
    ----------
    equations : Equations
    travels : ndarray, optional
        Numbers of the displacement unknowns that follow the rotation unknowns in shapes; by default all of them.
    """

    def __init__(self, equations: Equations, travels: Index | None = None) -> None:
        self._equations = equations
        self._travels = slice(equations.rotation_unknowns, equations.unknowns) if travels is None else travels

    @property
    def fields(self) -> Iterator[Array]:
        """The reference fields of rotations in the order of their use, each (rotation unknowns,), rad."""
        # The first one nearly always decides.
        for axis in (2, 1, 0) if self._equations.model.space else (2,):
            for decay in DECAYS:
                yield self._field(axis, decay)

    @kept(16)
    def _field(self, axis: int, decay: float) -> Array:
        """The field about a section axis that fades along each member."""
        equations, model = self._equations, self._equations.model
        lines = model.scene.center_lines
        about = np.flatnonzero(model.rotations.kind == RotationFreedom.AXIS) if model.space else ()
        vectors, shares = np.zeros((len(model.rotations.kind), 3)), np.zeros(len(model.rotations.kind))
        rank = {name: place for place, name in enumerate(sorted(model.rotations.ends))}
        for names, chains, along in self._chains:
            ways = np.tile([0.0, 0.0, 1.0], (len(names), 1))
            if model.space:
                begins = np.concatenate([lines[name].quaternions(np.array([0.0])) for name in names])
                ways = quaternion.matrix(begins)[:, :, axis]
            sizes = np.array([lines[n].length * (1.0 if n in model.beams.first else WITHOUT_ELEMENTS) for n in names])
            # At a node of several members the mean, weighted by the length that the node stands for in each:
            # integrals are then the same on all meshes, also of a field that jumps there.
            share = np.gradient(along, axis=1) * sizes[:, None]
            ranked = ways / (1.0 + np.array([rank[name] for name in names]))[:, None]
            # What has one rotation has it once.
            once = np.array([chain[:-1] != last for chain, last in zip(chains, chains[:, -1], strict=True)])
            once = np.column_stack([once, np.ones(len(names), bool)])
            np.add.at(vectors, chains[once], ((share * np.exp(-decay * along))[..., None] * ranked[:, None])[once])
            np.add.at(shares, chains[once], share[once])
        vectors /= np.where(shares > 0.0, shares, 1.0)[:, None]
        values = vectors if model.space else vectors[:, 2:3]
        if len(about):
            values = values.copy()
            values[about, 0] = (vectors[about] * model.rotations.axis[about]).sum(axis=1)
        field = np.zeros(equations.rotation_unknowns)
        used = equations.number >= 0
        field[equations.number[used]] = values[used]
        return field

    @functools.cached_property
    def _chains(self) -> list[tuple[list[str], Index, Array]]:
        """Members with chains of the same number of nodes: names, rotations and fractions of the length (names, n)."""
        model, found = self._equations.model, dict[int, list[tuple[str, Index, Array]]]()
        # Sums at their nodes are then the same in whatever order a file has them.
        for name, ends in sorted(model.rotations.ends.items()):
            if name in model.beams.first:
                one = name, model.chain(name), model.along(name)
            else:
                one = name, np.array(ends), np.linspace(0.0, 1.0, len(ends))
            found.setdefault(len(one[1]), []).append(one)
        return [
            ([name for name, *_ in own], np.array([chain for _, chain, _ in own]), np.array([x for *_, x in own]))
            for own in found.values()
        ]

    @functools.cached_property
    def displacing(self) -> tuple[Array, ...]:
        """The reference fields of displacements, each (unknowns,), dimensionless, zero for rotations.

        Nodes move along the section axes of that member at each whose name comes first in the alphabet.
        """
        equations, model = self._equations, self._equations.model
        axes, lines = model.element.axes, model.scene.center_lines
        found = []
        for axis in (2, 1, 0) if model.space else (1, 0):
            ways = np.zeros((len(model.segments.places), axes))
            for place, name in reversed(list(enumerate(sorted(lines)))):
                frame = quaternion.matrix(lines[name].quaternions(np.array([0.0])))[0]
                for node in model.scene.members[name].nodes:
                    ways[model.segments.place(node)] = frame[:axes, axis] / (1.0 + place)
            field = np.zeros(equations.unknowns)
            field[equations.rotation_unknowns :] = model.positions.Y.T @ ways.ravel()
            found.append(field)
        return tuple(found)

    def taken(self, shapes: Array, metric: Array) -> Array:
        """The shape (entries,) that the rule chooses from the span of several.

        Parameters
        ----------
        shapes : ndarray (entries, n)
            Columns of rotation unknowns, possibly followed by displacements; orthonormal in the metric.
        metric : ndarray (entries,)
            Weight of each entry.
        """
        return np.asarray(shapes @ self._share(shapes, metric))

    def ordered(self, shapes: Array, metric: Array) -> Array:
        """A basis (entries, n) of the span of shapes: each is chosen from the part orthogonal to those before."""
        found = []
        while shapes.shape[1]:
            share = self._share(shapes, metric)
            found.append(shapes @ share)
            shapes = shapes @ np.linalg.qr(np.column_stack([share, np.eye(len(share))]))[0][:, 1 : len(share)]
        return np.column_stack(found)

    def in_groups(self, values: Array, shapes: Array, metric: Array, unit: float = 1.0) -> Array:
        """Shapes (entries, n) of rising eigenvalues (n,), those of equal ones as :meth:`ordered`.

        Parameters
        ----------
        unit : float
            Eigenvalues of smaller size are compared with this instead of themselves.
        """
        begin, found = 0, shapes.copy()
        while begin < len(values):
            near = tolerances.ALIKE * max(unit, abs(float(values[begin])))
            end = begin + 1 + int((values[begin + 1 :] - values[begin] <= near).sum())
            found[:, begin:end] = self.ordered(shapes[:, begin:end], metric)
            begin = end
        return found

    def _share(self, shapes: Array, metric: Array) -> Array:
        """Coefficients (n,) of the chosen shape in the given ones, of length one."""
        rotation_unknowns = self._equations.rotation_unknowns
        travels = shapes[rotation_unknowns:]
        largest = float(np.linalg.norm(travels, axis=0).max(initial=0.0))
        size = max(np.sqrt(float((metric @ np.abs(shapes) ** 2).max())), tolerances.NEGLIGIBLE * largest)
        for field in self.fields:
            weighted = metric[:rotation_unknowns] * field
            parts = weighted @ shapes[:rotation_unknowns]
            if np.linalg.norm(parts) > LEAST * size * np.sqrt(float(weighted @ field)):
                # The phase of complex shapes is chosen such that their part in the field is real.
                return np.asarray(parts.conj() / np.linalg.norm(parts))
        for field in self.displacing if len(travels) else ():
            parts = field[self._travels] @ travels
            if np.linalg.norm(parts) > LEAST * largest * np.linalg.norm(field):
                return np.asarray(parts.conj() / np.linalg.norm(parts))
        share, shape = np.eye(shapes.shape[1])[0], shapes[:, 0]
        return share * np.sign(shape[first_of_largest(shape, 0.5)].real or 1.0) if len(shape) else share

    @functools.cached_property
    def seed(self) -> Array:
        """Weighted sum of all fields, (rotation unknowns,), as a start of inverse iteration, which keeps its side.

        Each field counts far less than the one before it, and far more than rounding.
        """
        return np.asarray(sum(FADING**i * field for i, field in enumerate(self.fields)))


def alike(values: Array) -> int:
    """Number of the rising eigenvalues (n,), dimensionless, that equal the lowest one to :data:`.tolerances.ALIKE`."""
    return int((values - values[0] <= tolerances.ALIKE * max(1.0, abs(float(values[0])))).sum())
