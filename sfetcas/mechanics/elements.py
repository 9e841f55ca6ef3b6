"""The special finite elements SFET2 to SFET9: energy of one element as a function of its nodal rotations.

The unknowns of an element with p + 1 nodes are rotations *since the undeformed state*: one angle a node in
the plane, one quaternion a node in space, interpolated by Lagrange polynomials on the Gauss-Lobatto points.
With ``q`` this rotation, ``kappa_0`` and ``t_0`` curvature and tangent of the unloaded centre line and
``R_0`` its section axes,

    kappa - kappa_0 = R_0^T 2 G(q) q',      u' = (R(q) - I) t_0,

so that an undeformed element of any shape has exactly no strain and no displacement.  For a straight member
this is the interpolation of the source; for a curved one it interpolates the smaller of the two rotations.

The data of an integration point are the stiffness (times weight over length, in the fixed axes of the undeformed
scene), the tangent (unit tangent of the unloaded centre line times weight times length) and the pull (minus the
internal force) that loads cause: the energy is the strain energy plus ``sum pull.(R(q) - I) tangent``.  The row of an
element is the change of its chord, ``sum (R(q) - I) tangent``, whose multiplier is the constant part of the pull.

Where members stretch or shear, the scaled strains ``eta`` of each point are unknowns, too: with the section forces'
compliance ``C_n^-1`` (axial, shear) in its axes ``R_0``, the tangent of a point becomes ``R(q) (t_0 + S eta)`` with
``S = R_0 (length weight C_n^-1)^1/2``, and the energy gains ``1/2 eta.eta``.  Their stiffness is the identity, whatever
the section's, so that members that hardly stretch are as well conditioned as those that do not.

Where forces and moments are coupled, as where the centres of tension or shear are off the line, the change of the
curvature strains the line by itself: the tangent is ``R(q) (t_0 + S eta + P k)`` with ``k`` the change of the curvature
times length and ``P = weight R_0 Q R_0^T``.  With the stiffness ``[[A, B], [B^T, D]]`` of forces and moments it is
``Q = -A^-1 B``, and the stiffness of the strain energy ``D - B^T A^-1 B``: squares are completed.  A line that is off
a fibre which keeps its length needs no strains at all.

Two ways to integrate: *at the nodes* (Lobatto), where ``q`` is exactly unit and everything is polynomial, and
*Gauss*, with the interpolated quaternion divided by its norm.  Both are of order 2p at the element ends.

Source: Barraco and Munteanu, Part 1, sections 3 and 4 (SFET2, SFET3); the higher orders are ours.  Strains: Reissner
1972, Simo 1985.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np

from ..mathematics import interpolation
from ..mathematics.arrays import Array
from ..mathematics.quaternion import product
from .terms import ARGUMENTS, Side, Term, name_of

__all__ = ["ELEMENTS", "Element", "element_by_name"]


@final
@dataclass(frozen=True)
class Element(Term):
    """A type of element: order, integration and dimension; everything else follows from these and is made once.

    Attributes
    ----------
    order : int
        Polynomial order p of the interpolation; the element has p + 1 nodes.
    gauss : bool
        Integration at p + 1 Gauss points of the normalised interpolation instead of at the nodes.
    strains : bool
        Whether the scaled strains of the points are sides: as places, one for each point.
    shifted : bool
        Whether the change of the curvature strains the line by itself.
    """

    order: int
    gauss: bool = False
    strains: bool = False
    shifted: bool = False

    @property
    def name(self) -> str:
        """The name in scene files: SFET2, SFET3, ..., by the number of nodes."""
        return f"SFET{self.order + 1}"

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation at each node, strains of each point; data: stiffnesses, tangents, compliances; load: pulls."""
        n = self.order + 1
        return n, n if self.strains else 0, self.axes, n * sum(self._widths), n * self.axes

    @property
    def _widths(self) -> tuple[int, int, int]:
        """Numbers of stiffness, tangent and compliance at a point."""
        return self.stiffnesses, self.axes, self.compliances

    @property
    def compliances(self) -> int:
        """Numbers of compliance at a point: a matrix, column by column, or none."""
        return self.axes * self.yielding

    @property
    def yielding(self) -> int:
        """By how many numbers of a point its tangent changes before it is turned: strains, then the curvature's."""
        return (self.axes if self.strains else 0) + (self.turns if self.shifted else 0)

    @property
    def stiffnesses(self) -> int:
        """Numbers of stiffness at a point: 6, the upper triangle of a symmetric 3 x 3 matrix, or 1 in the plane."""
        return 6 if self.space else 1

    @functools.cached_property
    def nodes(self) -> Array:
        """Places of the nodes in [0, 1], shape (p + 1,)."""
        return interpolation.lobatto(self.order + 1)[0]

    @functools.cached_property
    def points(self) -> Array:
        """Places of the integration points in [0, 1], shape (p + 1,)."""
        return self._rule[0]

    @functools.cached_property
    def weights(self) -> Array:
        """Weights of the integration points, sum 1, shape (p + 1,)."""
        return self._rule[1]

    @property
    def _rule(self) -> tuple[Array, Array]:
        return (interpolation.gauss if self.gauss else interpolation.lobatto)(self.order + 1)

    @functools.cached_property
    def to_points(self) -> Array:
        """Integrals from 0 to each integration point of what is given at them, shape (p + 1, p + 1)."""
        return interpolation.integration(self.points, self.points)

    # -- what it says ---------------------------------------------------------------------------------

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Strain energy, plus the potential of the loads by their pulls."""
        stiffness, tangent, _ = self.split(data)
        pull, now = ca.reshape(load, self.axes, self.order + 1), self.tangents(q, u, data)
        here, slope = self.at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        energy = ca.SX(0)
        for k in range(self.order + 1):
            energy += self._strain_energy(here[:, k], slope[:, k], stiffness[:, k])
            energy += ca.dot(pull[:, k], now[k] - tangent[:, k])
        for strain in u:
            energy += 0.5 * ca.sumsqr(ca.vertcat(*strain))
        return energy

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Change of the chord, the vector from the first to the last node, since the undeformed scene."""
        gained = ca.horzcat(*self.tangents(q, u, data)) - self.split(data)[1]
        return ca.vertsplit(ca.sum2(gained))

    def tangents(self, q: list[Side], u: list[Side], data: ca.SX) -> list[ca.SX]:
        """Turned and strained tangents of the points, for data of which the last are those of :attr:`line_data`."""
        tangent, compliance = self.line(data[-self.line_data :])
        here, slope = self.at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        found = []
        for k in range(self.order + 1):
            by = self.yields(here[:, k], slope[:, k], ca.vertcat(*u[k]) if u else ca.SX(0, 1))
            found.append(self._tangent(here[:, k], self.strained(tangent[:, k], compliance[:, k], by)))
        return found

    def yields(self, here: ca.SX, slope: ca.SX, strain: ca.SX) -> ca.SX:
        """By what the tangent of one point changes before it is turned: its scaled strain, then its curvature's."""
        if not self.shifted:
            return strain
        return ca.vertcat(strain, self.curvature(here, slope) if self.space else slope)

    def strained(self, tangent: ca.SX, compliance: ca.SX, by: ca.SX) -> ca.SX:
        """Tangent of one point before it is turned, with what :meth:`yields` says."""
        if not self.yielding:
            return tangent
        return tangent + ca.mtimes(ca.reshape(compliance, self.axes, self.yielding), by)

    @property
    def line_data(self) -> int:
        """How many of the data, the last ones, say how the centre line lies and yields: tangents and compliances."""
        return (self.order + 1) * sum(self._widths[1:])

    def line(self, data: Any) -> tuple[Any, Any]:
        """Tangents and compliances of the points from these data, a column for each point."""
        return self.split(ca.vertcat(ca.SX((self.order + 1) * self.stiffnesses, 1), data))[1:]

    def split(self, data: Any) -> tuple[Any, Any, Any]:
        """Stiffnesses, tangents and compliances of the points from the data, a column for each point."""
        n = self.order + 1
        parts = ca.vertsplit(data, np.cumsum([0, *(n * width for width in self._widths)]).tolist())
        stiffness, tangent, compliance = (
            ca.reshape(part, width, n) for part, width in zip(parts, self._widths, strict=True)
        )
        return stiffness, tangent, compliance

    def at_points(self, q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Rotation and its derivative by xi at the integration points."""
        slope = ca.mtimes(q, ca.DM(interpolation.differentiation(self.nodes, self.points).T))
        here = ca.mtimes(q, ca.DM(interpolation.evaluation(self.nodes, self.points).T)) if self.gauss else q
        return here, slope

    def curvature(self, here: ca.SX, slope: ca.SX) -> ca.SX:
        """Change of the curvature times length at one point in space, about the fixed axes of the undeformed scene."""
        q = ca.vertsplit(here)
        k = 2.0 * ca.vertcat(*product([q[0], -q[1], -q[2], -q[3]], ca.vertsplit(slope))[1:])
        return k / ca.dot(here, here) if self.gauss else k

    def changes(self, q: list[Side]) -> list[ca.SX]:
        """Change of the curvature times length (turns,) at each point, about the fixed axes; in the plane about z."""
        here, slope = self.at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        points = range(self.order + 1)
        return [self.curvature(here[:, k], slope[:, k]) if self.space else slope[:, k] for k in points]

    def section(self, stiffness: ca.SX) -> ca.SX:
        """Stiffness of one point as a matrix (turns, turns)."""
        return self._section(stiffness) if self.space else stiffness

    def _section(self, stiffness: ca.SX) -> ca.SX:
        """Stiffness of one point in space as a matrix."""
        c = ca.vertsplit(stiffness)
        return ca.vertcat(ca.horzcat(c[0], c[1], c[2]), ca.horzcat(c[1], c[3], c[4]), ca.horzcat(c[2], c[4], c[5]))

    def _strain_energy(self, here: ca.SX, slope: ca.SX, stiffness: ca.SX) -> ca.SX:
        """1/2 c k.k of one point, c the stiffness times weight over length, k the curvature times length."""
        if not self.space:
            return 0.5 * stiffness[0] * slope[0] ** 2
        q = ca.vertsplit(here)
        k = product([q[0], -q[1], -q[2], -q[3]], ca.vertsplit(slope))[1:]
        c = ca.vertsplit(stiffness)
        # 2 G(q) q' are twice the vector part of conj(q) q'; the factor 4 is 2^2.
        scale = 2.0 / ca.dot(here, here) ** 2 if self.gauss else 2.0
        square = c[0] * k[0] * k[0] + c[3] * k[1] * k[1] + c[5] * k[2] * k[2]
        cross = c[1] * k[0] * k[1] + c[2] * k[0] * k[2] + c[4] * k[1] * k[2]
        return scale * (square + 2.0 * cross)

    def _tangent(self, here: ca.SX, tangent: ca.SX) -> ca.SX:
        """The turned tangent ``R(q) t_0`` of one point."""
        v = ca.vertcat(*self.forth(ca.vertsplit(here), ca.vertsplit(tangent)))
        return v / ca.dot(here, here) if self.space and self.gauss else v

    @functools.cached_property
    def turned(self) -> ca.Function:
        """``(q, u, data) ->`` turned and strained tangents of the points, (axes, p + 1)."""
        turns, places, _, data, _ = self.sizes
        arguments = [
            ca.SX.sym("q", self.components, turns),
            ca.SX.sym("u", self.axes, places),
            ca.SX.sym("data", data),
        ]
        q, u = ([ca.vertsplit(side) for side in ca.horzsplit(part)] for part in arguments[:2])
        found = ca.horzcat(*self.tangents(q, u if places else [], arguments[2]))
        return ca.Function(f"turned_{name_of(self)}", arguments, [ca.densify(found)])

    # -- derivatives ----------------------------------------------------------------------------------
    # In space derivatives of the whole element are long: those of one point, mapped over the points and put together
    # by constant matrices, are a tenth of the code, and as fast.

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_gradient()
        symbols, q, point, load = self._large_symbols()
        strain, tangents, gradient, hessian, *change = self._point.map(self.order + 1)(*point)
        gained = tangents - self._tangent_of(point)
        moments, matrix = self.by_rotation_vectors(q, self._on_sides(gradient), self._between_sides(hessian))
        results = {
            "energy": ca.sum2(strain) + ca.dot(load, gained),
            "stored": ca.sum2(strain),
            "rows": ca.sum2(gained),
            "gradient": moments,
            "stiffness": matrix,
            "rotation_jacobian": ca.densify(ca.mtimes(self._by_sides(change), self._basis(q))),
        }
        return self._function("rotation_gradient", symbols, results)

    def rotation_forces(self) -> ca.Function:
        """As :meth:`.Term.rotation_forces`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_forces()
        symbols, q, point, _ = self._large_symbols()
        tangents, gradient, *_ = self._of_point("gradient").map(self.order + 1)(*point)
        moments = ca.mtimes(self._basis(q).T, self._on_sides(gradient))
        results = {"rows": ca.sum2(tangents - self._tangent_of(point)), "gradient": ca.densify(moments)}
        return self._function("forces", symbols, results)

    def slopes(self) -> ca.Function:
        """As :meth:`.Term.slopes`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().slopes()
        symbols, _, point, load = self._large_symbols()
        _, gradient, *change = self._of_point("gradient").map(self.order + 1)(*point[:-1], load)
        results = {"gradient": ca.densify(self._on_sides(gradient)), "jacobian": self._by_sides(change)}
        return self._function("slopes", symbols[:4], results)

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().curvatures()
        symbols, _, point, load = self._large_symbols()
        weight = ca.MX.sym("weight")
        pull = weight * load + ca.repmat(symbols[4], 1, self.order + 1)
        hessian = self._of_point("hessian").map(self.order + 1)(*point[:-1], pull, weight)
        return self._function("curvatures", [*symbols, weight], {"hessian": self._between_sides(hessian)})

    @functools.cached_property
    def convex(self) -> ca.Function:
        """``(q, u, data, load, lam) ->`` a positive semidefinite substitute for the stiffness of
        :meth:`rotation_gradient`.

        Of the strain energy it has the Gauss-Newton part, which in the plane is exact.  Of the internal force it has
        the geometric stiffness of its axial part about both normals, with the sign of tension also in compression.
        """
        symbols, q, point, _ = self._large_symbols()
        stiffness, tangent, pull = point[-3 - bool(self.yielding)], self._tangent_of(point), point[-1]
        if self.space:
            own = self._convex_in_space(q, stiffness, tangent, pull)
        else:
            own = self._convex_in_plane()(q, stiffness, tangent, pull)
        strains = ca.MX.eye(symbols[1].numel())
        return self._function("convex", symbols, {"convex": ca.densify(ca.diagcat(own, strains))})

    def _convex_in_plane(self) -> ca.Function:
        n = self.order + 1
        shapes = {"q": (self.components, n), "c": (1, n), "t": (self.axes, n), "p": (self.axes, n)}
        parts = [ca.SX.sym(name, *shape) for name, shape in shapes.items()]
        here, slope = self.at_points(parts[0])
        total = ca.SX(n, n)
        for k in range(n):
            by_turns = ca.jacobian(slope[:, k], parts[0])
            along = ca.fabs(ca.dot(self._tangent(here[:, k], parts[2][:, k]), parts[3][:, k]))
            row = ca.DM(interpolation.evaluation(self.nodes, self.points[k : k + 1]))
            total += parts[1][0, k] * ca.mtimes(by_turns.T, by_turns) + along * ca.mtimes(row.T, row)
        return ca.Function(f"convex_parts_{name_of(self)}", parts, [ca.densify(total)])

    def _convex_in_space(self, q: ca.MX, stiffness: ca.MX, tangent: ca.MX, pull: ca.MX) -> ca.MX:
        n = self.order + 1
        hessian, across = self._convex_point.map(n)(*self.at(q), stiffness, tangent, pull)
        basis = self.basis(q)
        pairs = ca.sparsify(ca.kron(self._shape, ca.DM.ones(1, n)) * ca.kron(ca.DM.ones(1, n), self._shape))
        summed = ca.densify(ca.mtimes(ca.reshape(across, 9, n), pairs))
        order = np.arange(9 * n * n).reshape(n, n, 3, 3).transpose(0, 2, 1, 3).ravel()
        total = ca.mtimes(basis.T, ca.mtimes(self.between_nodes(hessian), basis))
        return ca.densify(total + ca.reshape(summed.nz[order.tolist()], 3 * n, 3 * n))

    def _large_symbols(self) -> tuple[list[ca.MX], ca.MX, list[ca.MX], ca.MX]:
        """Arguments q, u, data, load, lam of functions put together of others.

        And rotations, the arguments of the functions of a point with the whole pull, a column a node or point, and the
        pulls of loads.
        """
        turns, places, rows, data, load = self.sizes
        shapes = ((self.components, turns), (self.axes, places), (data, 1), (load, 1), (rows, 1))
        symbols = [ca.MX.sym(name, *shape) for name, shape in zip(ARGUMENTS, shapes, strict=True)]
        given = ca.reshape(symbols[3], self.axes, turns)
        stiffness, tangent, compliance = self.split(symbols[2])
        strains, compliances = [symbols[1]] if self.strains else [], [compliance] if self.yielding else []
        at = self.at(symbols[0]) if self.space else ()
        point = [*at, *strains, stiffness, tangent, *compliances, given + ca.repmat(symbols[4], 1, turns)]
        return symbols, symbols[0], point, given

    def _tangent_of(self, point: list[ca.MX]) -> ca.MX:
        """Tangents of the undeformed centre line among the arguments of the functions of a point."""
        return point[-2 - bool(self.yielding)]

    def _function(self, name: str, arguments: list[ca.MX], results: dict[str, ca.MX]) -> ca.Function:
        names = [*ARGUMENTS, "weight"][: len(arguments)]
        return ca.Function(f"{name}_{name_of(self)}", arguments, list(results.values()), names, list(results))

    def point_energy(
        self, name: str, energy: Callable[[ca.SX, ca.SX, ca.SX], ca.SX], width: int, wanted: str
    ) -> ca.Function:
        """The energy of one point in space from the change of the curvature and the strain there, with its derivatives.

        Parameters
        ----------
        name : str
            Of the function.
        energy : callable
            (change of the curvature times length (3,), fixed axes of the undeformed scene; scaled strains (3,), or none
            where there are none; data (width,)) -> energy.
        wanted : str
            ``gradient``, ``hessian`` or ``both``; the other one is empty.

        Returns
        -------
        Function
            ``(rotation, slope, strain, data) ->`` energy, gradient and second derivatives by rotation, slope and
            strain, (8,) and (8, 8) or (11,) and (11, 11).
        """
        here, slope, data = ca.SX.sym("here", 4), ca.SX.sym("slope", 4), ca.SX.sym("data", width)
        strain = ca.SX.sym("strain", 3 * self.strains)
        value = energy(self.curvature(here, slope), strain, data)
        hessian, gradient = ca.hessian(value, ca.vertcat(here, slope, strain))
        results = [
            value,
            ca.SX(0, 1) if wanted == "hessian" else gradient,
            ca.SX(0, 0) if wanted == "gradient" else hessian,
        ]
        symbols = [here, slope, strain, data]
        return ca.Function(name, symbols, [ca.densify(part) for part in results], {"cse": True})

    def summed(self, function: ca.Function, q: ca.MX, u: ca.MX, data: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Sum over the points of a function as of :meth:`point_energy`, with its derivatives by the sides.

        Parameters
        ----------
        function : Function
        q : (4, p + 1), rotations of the nodes
        u : (3, p + 1) or nothing, scaled strains of the points
        data : (m, p + 1), a column for each point

        Returns
        -------
        energy, its gradient (n,) and its second derivatives (n, n) by the rotations of the nodes, then by the strains
        """
        energies, gradient, hessian = function.map(self.order + 1)(*self.at(q), u, data)
        by_sides = self._on_sides(gradient) if gradient.numel() else ca.MX(0, 1)
        return ca.sum2(energies), by_sides, self._between_sides(hessian) if hessian.numel() else ca.MX(0, 0)

    def by_rotation_vectors(self, q: ca.MX, gradient: ca.MX, hessian: ca.MX | None) -> tuple[ca.MX, ca.MX]:
        """Derivatives as of :meth:`summed` by rotation vectors about the fixed axes, then by the strains.

        Of unit quaternions, as :func:`~sfetcas.mechanics.terms.rotation_gradient` says; no second ones for None.
        """
        basis = self._basis(q)
        moments = ca.densify(ca.mtimes(basis.T, gradient))
        if hessian is None:
            return moments, ca.MX(0, 0)
        # What keeps quaternions on the unit sphere.
        by_nodes = ca.reshape(gradient[: q.numel()], *q.shape)
        radial = ca.vec(ca.repmat(ca.sum1(q * by_nodes), 3, 1))
        radial = ca.diag(ca.vertcat(radial, ca.MX.zeros(basis.shape[1] - radial.shape[0], 1)))
        return moments, ca.densify(ca.mtimes(basis.T, ca.mtimes(hessian, basis)) - 0.25 * radial)

    @functools.cached_property
    def _shape(self) -> ca.DM:
        """Values of the interpolation at the points by those at the nodes, (points, nodes)."""
        return ca.sparsify(ca.DM(interpolation.evaluation(self.nodes, self.points)), 1e-14)

    @functools.cached_property
    def _derivative(self) -> ca.DM:
        """Derivatives at the points by values at the nodes, (points, nodes)."""
        return ca.DM(interpolation.differentiation(self.nodes, self.points))

    def at(self, q: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Rotations and their derivatives at the points."""
        return (ca.mtimes(q, self._shape.T) if self.gauss else q), ca.mtimes(q, self._derivative.T)

    def on_nodes(self, gradient: ca.MX) -> ca.MX:
        """Derivatives by the nodes (4, nodes) from those by rotations and slopes at the points (8, points)."""
        return ca.mtimes(gradient[:4, :], self._shape) + ca.mtimes(gradient[4:8, :], self._derivative)

    def _on_sides(self, gradient: ca.MX) -> ca.MX:
        """Derivatives by the components of the nodes, then by the strains, from those at the points."""
        return ca.vertcat(ca.vec(self.on_nodes(gradient)), ca.vec(gradient[8:, :]))

    def _by_sides(self, change: list[ca.MX]) -> ca.MX:
        """Derivative of the chord by the components of the nodes (3, 4 nodes), then by the strains (3, 3 points).

        From those of the tangents (3, 4 points) by the rotations there, where they change with them by the slopes, and
        (3, 3 points) by the strains.
        """
        n, first = self.order + 1, 1 + self.shifted
        sides = zip(change[:first], (self._shape, self._derivative), strict=False)
        parts = [ca.mtimes(ca.reshape(part, 12, n), side) for part, side in sides]
        return ca.densify(ca.horzcat(ca.reshape(sum(parts[1:], parts[0]), 3, 4 * n), *change[first:]))

    def _between_sides(self, hessian: ca.MX) -> ca.MX:
        """Second derivatives by the components of the nodes, then by the strains, from those of the points."""
        n, size = self.order + 1, 11
        if not self.strains:
            return self.between_nodes(hessian)
        entries = np.arange(size**2 * n).reshape(n, size, size)
        picked = [
            ca.reshape(hessian.nz[entries[:, columns, rows].ravel().tolist()], -1, n)
            for columns, rows in ((slice(0, 8), slice(0, 8)), (slice(8, 11), slice(0, 4)), (slice(8, 11), slice(4, 8)))
        ]
        nodes = self.between_nodes(ca.reshape(picked[0], 8, 8 * n))
        # Of a node and the strains of a point: entries (4, 3), those of all nodes beside each other for each point.
        across = []
        for k in range(n):
            sides = zip((self._shape[k, :], self._derivative[k, :]), picked[1:], strict=True)
            across.append(sum((ca.kron(side.T, ca.reshape(part[:, k], 4, 3)) for side, part in sides), ca.MX(0)))
        cross = ca.horzcat(*across)
        return ca.densify(ca.vertcat(ca.horzcat(nodes, cross), ca.horzcat(cross.T, self._between_strains(hessian))))

    def _between_strains(self, hessian: ca.MX) -> ca.MX:
        """Second derivatives by the strains of the points, block by block."""
        return ca.diagcat(*[part[8:, 8:] for part in ca.horzsplit(hessian, 11)])

    def between_nodes(self, hessian: ca.MX) -> ca.MX:
        """The same of second derivatives: (4 nodes, 4 nodes) from (8, 8 points)."""
        n = self.order + 1
        columns = ca.reshape(hessian, 64, n)
        place = np.arange(64).reshape(8, 8).T
        blocks = [columns[place[i : i + 4, j : j + 4].T.ravel().tolist(), :] for j in (0, 4) for i in (0, 4)]
        sides = (self._shape, self._derivative)
        pairs = [
            ca.kron(right, ca.DM.ones(1, n)) * ca.kron(ca.DM.ones(1, n), left) for right in sides for left in sides
        ]
        summed = ca.mtimes(ca.horzcat(*blocks), ca.vertcat(*map(ca.sparsify, pairs)))
        # A column for each pair of nodes, the first changing first, with 4 x 4 entries column by column.
        entry = np.arange(16 * n * n).reshape(n, n, 4, 4)
        order = entry.transpose(0, 2, 1, 3).ravel()
        return ca.reshape(ca.densify(summed).nz[order.tolist()], 4 * n, 4 * n)

    def basis(self, q: ca.MX) -> ca.MX:
        """Derivatives of the quaternions of all nodes by their rotation vectors, (4 nodes, 3 nodes)."""
        one = ca.SX.sym("one", 4)
        columns = [product([0.0, *axis], ca.vertsplit(one)) for axis in np.eye(3).tolist()]
        block = ca.Function(
            "basis", [one], [ca.densify(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))]
        )
        blocks = block.map(self.order + 1)(q)
        return ca.diagcat(*ca.horzsplit(blocks, 3))

    def _basis(self, q: ca.MX) -> ca.MX:
        """The same with the strains of the points, which are their own."""
        return ca.diagcat(self.basis(q), ca.MX.eye(self.axes * self.sizes[1]))

    def _of_point(self, what: str) -> ca.Function:
        """Arguments of a point (see :meth:`_point_symbols`) -> gradient, or Hessian with the energy times a weight.

        That is: turned tangent, gradient (8,) or (11,), and the derivatives of the turned tangent by the rotation
        (3, 4), where it changes with it by the slope (3, 4), and by the strain (3, 3); or the Hessian alone.
        """
        symbols, weight = self._point_symbols(), ca.SX.sym("weight")
        strain, now, changed = self._point_energy(symbols)
        name = f"point_{what}_{name_of(self)}"
        if what == "gradient":
            gradient = ca.gradient(strain + ca.dot(symbols[-1], now), ca.vertcat(*changed))
            results = [now, gradient, *self._changes_of(now, changed)]
            return ca.Function(name, symbols, [ca.densify(one) for one in results], {"cse": True})
        hessian = ca.hessian(weight * strain + ca.dot(symbols[-1], now), ca.vertcat(*changed))[0]
        return ca.Function(name, [*symbols, weight], [ca.densify(hessian)], {"cse": True})

    @functools.cached_property
    def _point(self) -> ca.Function:
        """Arguments of one point (see :meth:`_point_symbols`) -> its share of :meth:`rotation_gradient`.

        Strain energy, turned tangent, gradient and Hessian by rotation, slope and strain, and the derivatives of the
        turned tangent as of :meth:`_of_point`.
        """
        symbols = self._point_symbols()
        strain, now, changed = self._point_energy(symbols)
        hessian, gradient = ca.hessian(strain + ca.dot(symbols[-1], now), ca.vertcat(*changed))
        results = [strain, now, gradient, hessian, *self._changes_of(now, changed)]
        return ca.Function(f"point_{name_of(self)}", symbols, [ca.densify(one) for one in results], {"cse": True})

    def _changes_of(self, now: ca.SX, changed: list[ca.SX]) -> list[ca.SX]:
        """Derivatives of the turned tangent of a point by what it depends on."""
        return [ca.jacobian(now, part) for part in changed[:: 1 if self.shifted else 2]]

    def _point_energy(self, symbols: list[ca.SX]) -> tuple[ca.SX, ca.SX, list[ca.SX]]:
        """Strain energy and turned tangent of one point in space, and what they depend on."""
        if not self.yielding:
            here, slope, stiffness, tangent, _ = symbols
            return self._strain_energy(here, slope, stiffness), self._tangent(here, tangent), [here, slope]
        here, slope, *strains, stiffness, tangent, compliance, _ = symbols
        stored = sum((0.5 * ca.sumsqr(strain) for strain in strains), self._strain_energy(here, slope, stiffness))
        by = self.yields(here, slope, ca.vertcat(ca.SX(0, 1), *strains))
        return stored, self._tangent(here, self.strained(tangent, compliance, by)), [here, slope, *strains]

    def _point_symbols(self) -> list[ca.SX]:
        """Rotation, slope, strain, stiffness, tangent, compliance and pull of one point, as far as it has them."""
        strains, yields = 3 * self.strains, self.compliances
        names = {
            "here": 4,
            "slope": 4,
            "strain": strains,
            "stiffness": 6,
            "tangent": 3,
            "compliance": yields,
            "pull": 3,
        }
        return [ca.SX.sym(name, size) for name, size in names.items() if size]

    @functools.cached_property
    def _convex_point(self) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of one point -> its share of :attr:`convex`."""
        sizes = {"here": 4, "slope": 4, "stiffness": 6, "tangent": 3, "pull": 3}
        here, slope, stiffness, tangent, pull = (ca.SX.sym(name, size) for name, size in sizes.items())
        strain = self.curvature(here, slope)
        by_both = ca.jacobian(strain, ca.vertcat(here, slope))
        now = self._tangent(here, tangent)
        across = ca.SX.eye(3) - ca.mtimes(now, now.T) / ca.dot(now, now)
        results = [ca.mtimes(by_both.T, ca.mtimes(self._section(stiffness), by_both))]
        results.append(ca.fabs(ca.dot(now, pull)) * across)
        symbols = [here, slope, stiffness, tangent, pull]
        return ca.Function(
            f"convex_point_{name_of(self)}", symbols, [ca.densify(one) for one in results], {"cse": True}
        )


ELEMENTS = tuple(f"SFET{n}" for n in range(2, 10))
"""Names of the elements, by their number of nodes."""


@functools.cache
def element_by_name(
    name: str, space: bool, gauss: bool = False, strains: bool = False, shifted: bool = False
) -> Element:
    """The element type of a name; each is made once a process, so that its functions are, too."""
    return Element(space, ELEMENTS.index(name) + 1, gauss, strains, shifted)
