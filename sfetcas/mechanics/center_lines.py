"""Centre lines of all members at once that are rigid or keep their length: many places, and what forces there do.

Along an element the line is a polynomial, the sum of the turned tangents of its points with weights that depend on the
place.  A place is an element and a fraction of it.  What turns by a Rodrigues vector ``psi`` gains exactly
``psi x (a_0 + a_1) / 2``: with the mean of the tangents of two states the derivatives are exact between these, as those
of :mod:`~sfetcas.dynamics.conserving` are.  Everything is dimensionless, in two or three axes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, Sparse
from .fields import Fields
from .model import Model
from .segments import place_of_cut
from .tables import Tables

__all__ = ["Along", "Curve", "Lines", "gained", "gathered", "moment_of"]


@dataclass(frozen=True, eq=False)
class Along:
    """Places along members: numbers of their elements (n,) among those of the lines, and fractions (n,) of these."""

    elements: Index
    xi: Array

    def __len__(self) -> int:
        return len(self.xi)

    def chosen(self, which: Array) -> Along:
        """Some of them, by numbers or by a mask."""
        return Along(self.elements[which], self.xi[which])

    def with_more(self, other: Along) -> Along:
        """These, then others."""
        return Along(np.concatenate([self.elements, other.elements]), np.concatenate([self.xi, other.xi]))


@dataclass(frozen=True, eq=False)
class Curve:
    """The lines in one state, or the mean of two.

    Attributes
    ----------
    starts : ndarray (elements, axes)
        Positions of the starts of elements.
    tangents : ndarray (elements, points, axes)
        Turned tangents of the points of elements, times weight and length.
    """

    starts: Array
    tangents: Array

    def mean(self, other: Curve, share: float = 0.5) -> Curve:
        """What is a share of the straight way from here to another state; the middle gives the exact derivatives."""
        first = 1.0 - share
        return Curve(first * self.starts + share * other.starts, first * self.tangents + share * other.tangents)


class Lines:
    """The centre lines of a model.

    Parameters
    ----------
    model : Model
    names : collection of str
        Its members that count.
    tables : Tables, optional
        They number the unknowns.

    Attributes
    ----------
    members : tuple of str
    first : ndarray (members + 1,)
        Number of the first element of each member, then that of all elements; a rigid member is one element.
    owner : ndarray (elements,)
        Number of the member of each element.
    length, whole : ndarray (elements,), (members,)
        Lengths of the elements and of the members in the undeformed scene.
    scene : Scene
    unit : float
        The unit of length, m.
    axes : int
    """

    def __init__(self, model: Model, names: Collection[str], tables: Tables | None = None) -> None:
        # Not the model: what is kept for it shall not keep it.
        self.scene, self.unit, self.axes, self._space = (
            model.scene,
            model.scales.length,
            model.element.axes,
            model.space,
        )
        if tables is not None:
            self.tables = tables
        self._moving = tables is not None
        scene, mesh, points = model.scene, model.mesh, len(model.element.points)
        self.members = tuple(name for name in model.members if name in names)
        unit, counts = model.scales.length, list[int]()
        turns, tangents, places, starts, ends, numbers = [], [], [], [], [], []
        for name in self.members:
            cuts, first, line = mesh.cuts[name], model.beams.first[name], scene.center_lines[name]
            own = np.arange(first, first + len(cuts) - 1)
            if self._is_chord(name):
                begin, end = line.positions(np.array([0.0, 1.0]))[:, : self.axes] / unit
                own, cuts = own[:1], np.array([0.0, 1.0])
                turns.append(np.repeat(model.rotations.turns[own, :1], points, axis=1))
                tangents.append(model.element.weights[None, :, None] * (end - begin))
            else:
                turns.append(model.rotations.turns[own])
                tangents.append(model.beams.tangent[own])
            counts.append(len(own))
            numbers.append(own)
            at = line.positions(cuts)[:, : self.axes] / unit
            starts.append(at[:-1])
            ends.append(np.diff(cuts) * line.length / unit)
            if tables is not None:
                cut_at = (place_of_cut(mesh, model.segments.ends, name, cut) for cut in range(len(own)))
                places += [model.segments.place(place) for place in cut_at]
        self.first = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        self.owner = np.repeat(np.arange(len(counts)), counts)
        self._turns, self._tangents = np.concatenate(turns), np.concatenate(tangents)
        self._places, self._starts = np.array(places, np.intp), np.concatenate(starts)
        self.length = np.concatenate(ends)
        self._numbers = np.concatenate(numbers)
        # A rigid member is a multiple of the first of its elements.
        self._whole = self.length / model.beams.weight[self._numbers].sum(axis=1)
        # Along each member lengths go on from those of the ones before.
        self._far = np.concatenate([[0.0], np.cumsum(self.length)])
        self.whole = np.diff(self._far[self.first])
        # Weights are polynomials of what goes from -1 to 1.
        powers = np.vander(2.0 * model.element.points - 1.0, increasing=True)
        self._lagrange = np.linalg.inv(powers)
        self._weights = self._lagrange / model.element.weights
        self._bend()

    def _bend(self) -> None:
        """What the polynomials of members that are curved in the undeformed scene miss of their centre lines."""
        turning = (self.scene.center_lines[name].turning for name in self.members)
        curved = (turns > 0.0 and not self._is_chord(name) for turns, name in zip(turning, self.members, strict=True))
        self._curved = np.array(list(curved), bool)

    def _is_chord(self, name: str) -> bool:
        """Whether a member is rigid and one element, straight between its nodes."""
        scene = self.scene
        return scene.members[name].type == "rigid" and (self._moving or scene.center_lines[name].turning == 0.0)

    # -- states ---------------------------------------------------------------------------------------

    def curve(self, q: Array, places: Array) -> Curve:
        """The lines for rotations (rotations, components) and displacements (places, axes) of all places."""
        turned = q[self._turns]
        if self._space:
            turned = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
        return Curve(self._starts + places[self._places], quaternion.turned_by(turned, self._tangents))

    def of(self, fields: Fields) -> Curve:
        """The lines in a state, whose members may also stretch."""
        tangents = fields.turned[self._numbers] * self._whole[:, None, None]
        counts = zip(self.members, np.diff(self.first).tolist(), strict=True)
        starts = np.concatenate([fields.element_starts(name)[:count] for name, count in counts])
        return Curve(self._starts + starts, tangents)

    # -- places ---------------------------------------------------------------------------------------

    def at(self, member: int, x: Array) -> Along:
        """Places at fractions (n,) of the length of a member, by its number."""
        return self.moved(Along(np.full(len(x), self.first[member]), np.zeros(len(x))), x * self.whole[member])

    def fractions(self, along: Along) -> Array:
        """Fractions (n,) of the lengths of the members."""
        far = self._far[along.elements] + along.xi * self.length[along.elements]
        owner = self.owner[along.elements]
        begin, end = self._far[self.first[owner]], self._far[self.first[owner + 1]]
        return np.where(self.end(along, np.ones(len(along))), 1.0, np.clip((far - begin) / (end - begin), 0.0, 1.0))

    def lengths(self, along: Along) -> Array:
        """Arc lengths (n,) from the begins of the members."""
        first = self.first[self.owner[along.elements]]
        return np.asarray(self._far[along.elements] + along.xi * self.length[along.elements] - self._far[first])

    def moved(self, along: Along, by: Array) -> Along:
        """Places moved by arc lengths (n,), which stop at the ends of their members."""
        owner = self.owner[along.elements]
        begin, end = self._far[self.first[owner]], self._far[self.first[owner + 1]]
        far = np.clip(self._far[along.elements] + along.xi * self.length[along.elements] + by, begin, end)
        inside = np.searchsorted(self._far, far, side="right") - 1
        e = np.clip(inside, self.first[owner], self.first[owner + 1] - 1)
        # Rounding leaves nothing of the way to an end.
        return Along(e, np.where(far == end, 1.0, np.clip((far - self._far[e]) / self.length[e], 0.0, 1.0)))

    def end(self, along: Along, by: Array) -> Array:
        """Whether places (n,) are at the end of their member to which ``by`` (n,) points, of bool."""
        e, owner = along.elements, self.owner[along.elements]
        low = (e == self.first[owner]) & (along.xi <= 0.0) & (by < 0.0)
        return np.asarray(low | ((e == self.first[owner + 1] - 1) & (along.xi >= 1.0) & (by > 0.0)))

    def positions(self, curve: Curve, along: Along) -> Array:
        """Positions (n, axes)."""
        found = curve.starts[along.elements] + np.einsum(
            "np,npa->na", self._reach(along), curve.tangents[along.elements]
        )
        return found if not self._curved.any() else found + self._missed(along)

    def slopes(self, curve: Curve, along: Along) -> Array:
        """Derivatives (n, axes) of positions by the arc length."""
        found = self._derivative(curve, along, self._powers(along))
        return found if not self._curved.any() else found + self._missed(along, slope=True)

    def bends(self, curve: Curve, along: Along) -> Array:
        """Second derivatives (n, axes) of positions by the arc length."""
        t = 2.0 * along.xi - 1.0
        count = self._weights.shape[0]
        powers = np.stack([2.0 * k * t ** max(k - 1, 0) for k in range(count)], axis=1)
        return self._derivative(curve, along, powers) / self.length[along.elements][:, None]

    def _derivative(self, curve: Curve, along: Along, powers: Array) -> Array:
        found = np.einsum("np,npa->na", powers @ self._weights, curve.tangents[along.elements])
        return np.asarray(found / self.length[along.elements][:, None])

    def _powers(self, along: Along) -> Array:
        t = 2.0 * along.xi - 1.0
        return np.stack([t**k for k in range(self._weights.shape[0])], axis=1)

    def _reach(self, along: Along) -> Array:
        """Weights (n, points) of the tangents in the line from the start of the element."""
        t = 2.0 * along.xi - 1.0
        count = self._weights.shape[0]
        powers = np.stack([(t ** (k + 1) - (-1.0) ** (k + 1)) / (2.0 * (k + 1)) for k in range(count)], axis=1)
        return np.asarray(powers @ self._weights)

    def _missed(self, along: Along, *, slope: bool = False) -> Array:
        """Centre lines of the undeformed scene, or their slopes, less those of the polynomials, (n, axes)."""
        found, owner = np.zeros((len(along), self.axes)), self.owner[along.elements]
        for k in np.flatnonzero(self._curved).tolist():
            here = np.flatnonzero(owner == k)
            if not len(here):
                continue
            own, line = along.chosen(here), self.scene.center_lines[self.members[k]]
            tangents, x = self._tangents[own.elements], self.fractions(own)
            if slope:
                within = np.einsum("np,npa->na", self._powers(own) @ self._weights, tangents)
                found[here] = line.tangents(x)[:, : self.axes] - within / self.length[own.elements][:, None]
            else:
                within = self._starts[own.elements] + np.einsum("np,npa->na", self._reach(own), tangents)
                found[here] = line.positions(x)[:, : self.axes] / self.unit - within
        return found

    # -- forces ---------------------------------------------------------------------------------------

    def derivatives(self, curve: Curve, along: Along, directions: Array) -> Sparse:
        """Derivatives (n, total) of ``directions`` (n, axes) times the positions by the unknowns; directions stay."""
        return gathered(self.tables, *self.entries(curve, along, directions))

    def entries(
        self, curve: Curve, along: Along, directions: Array, moments: Array | None = None
    ) -> tuple[Index, Array]:
        """The same by full coordinates: their numbers (n, k) and the derivatives by them.

        ``moments`` (n, points, turns) of points, of :meth:`shared` for instance, are added.
        """
        n, tables, weights = len(along), self.tables, self._reach(along)
        e = along.elements
        turning = moment_of(weights[..., None] * curve.tangents[e], directions[:, None, :])
        if moments is not None:
            turning = turning + moments
        cells = [
            tables.place_cells(self._places[e]),
            (tables.width * self._turns[e][..., None] + np.arange(tables.width)).reshape(
                n, tables.width * weights.shape[1]
            ),
        ]
        values = [directions, turning.reshape(n, cells[1].shape[1])]
        return np.concatenate(cells, axis=1), np.concatenate(values, axis=1)

    def shared(self, along: Along, moments: Array, gain: Array | None = None) -> Array:
        """Moments (n, points, turns) of points for moments (n, turns) on sections.

        With ``gain`` (n, points, turns), what points have turned since a state, they are the derivatives by further
        rotation vectors of the work of these moments on the turns of sections.
        """
        found = (self._powers(along) @ self._lagrange)[..., None] * moments[:, None, :]
        if gain is None:
            return np.asarray(found)
        half = 0.5 * gain
        along_it = half * np.einsum("npa,npa->np", half, found)[..., None]
        return np.asarray(found + along_it + (np.cross(half, found) if self._space else 0.0))

    def turned(self, before: Array, after: Array, along: Along) -> Array:
        """Rodrigues vectors (n, points, turns) by which points turn between rotations (rotations, components)."""
        own = self._turns[along.elements]
        return gained(before[own], after[own])

    def of_sections(self, along: Along, points: Array) -> Array:
        """Those of sections (n, turns) from those of points (n, points, turns)."""
        return np.asarray(np.einsum("np,npa->na", self._powers(along) @ self._lagrange, points))


def moment_of(arms: Array, forces: Array) -> Array:
    """Moments (..., turns) of forces (..., axes) at arms (..., axes)."""
    if arms.shape[-1] == 3:
        return np.asarray(np.cross(arms, forces))
    return np.asarray(arms[..., :1] * forces[..., 1:] - arms[..., 1:] * forces[..., :1])


def gained(before: Array, after: Array) -> Array:
    """Rodrigues vectors (..., turns) from rotations (..., components) to others."""
    if before.shape[-1] == 1:
        return 2.0 * np.tan(0.5 * (after - before))
    turned = quaternion.multiply(after, quaternion.conjugate(before))
    return np.asarray(2.0 * turned[..., 1:] / turned[..., :1])


def gathered(tables: Tables, cells: Index, values: Array) -> Sparse:
    """Rows (n, total) by the unknowns of values (n, k) by full coordinates (n, k), -1 for what is none."""
    from scipy.sparse import csr_matrix

    unknown = np.where(cells < 0, -1, tables.unknown[cells])
    row, column = np.nonzero(unknown >= 0)
    entries = values[row, column] * tables.weight[cells[row, column]]
    return csr_matrix((entries, (row, unknown[row, column])), shape=(len(cells), tables.total))
