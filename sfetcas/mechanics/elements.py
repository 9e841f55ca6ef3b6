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

Two ways to integrate: *at the nodes* (Lobatto), where ``q`` is exactly unit and everything is polynomial, and
*Gauss*, with the interpolated quaternion divided by its norm.  Both are of order 2p at the element ends.

Source: Barraco and Munteanu, Part 1, sections 3 and 4 (SFET2, SFET3); the higher orders are ours.
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
    """

    order: int
    gauss: bool = False

    @property
    def name(self) -> str:
        """The name in scene files: SFET2, SFET3, ..., by the number of nodes."""
        return f"SFET{self.order + 1}"

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """A rotation at each node; data: stiffnesses and tangents of all integration points; load: their pulls."""
        n = self.order + 1
        return n, 0, self.axes, n * (self.stiffnesses + self.axes), n * self.axes

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
        stiffness, tangent = self.split(data)
        pull = ca.reshape(load, self.axes, self.order + 1)
        here, slope = self._at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        energy = ca.SX(0)
        for k in range(self.order + 1):
            energy += self._strain_energy(here[:, k], slope[:, k], stiffness[:, k])
            energy += ca.dot(pull[:, k], self._tangent(here[:, k], tangent[:, k]) - tangent[:, k])
        return energy

    def residual(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> list[ca.SX]:
        """Change of the chord, the vector from the first to the last node, since the undeformed scene."""
        tangent = self.split(data)[1]
        here = self._at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))[0]
        gained = [self._tangent(here[:, k], tangent[:, k]) - tangent[:, k] for k in range(self.order + 1)]
        return ca.vertsplit(sum(gained[1:], gained[0]))

    def split(self, data: Any) -> tuple[Any, Any]:
        """Stiffnesses and tangents of the points from the data, a column for each point."""
        n = self.order + 1
        stiffness, tangent = ca.vertsplit(data, [0, n * self.stiffnesses, data.shape[0]])
        return ca.reshape(stiffness, self.stiffnesses, n), ca.reshape(tangent, self.axes, n)

    def _at_points(self, q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Rotation and its derivative by xi at the integration points."""
        slope = ca.mtimes(q, ca.DM(interpolation.differentiation(self.nodes, self.points).T))
        here = ca.mtimes(q, ca.DM(interpolation.evaluation(self.nodes, self.points).T)) if self.gauss else q
        return here, slope

    def bent(self, q: ca.SX) -> ca.SX:
        """Changes of the curvature times length at the points (3 or 1, p + 1), about the fixed axes of the undeformed
        scene, in the plane about z, from the rotations of the nodes (components, p + 1).
        """
        here, slope = self._at_points(q)
        if not self.space:
            return slope
        return ca.horzcat(*[self._curvature(here[:, k], slope[:, k]) for k in range(self.order + 1)])

    def _curvature(self, here: ca.SX, slope: ca.SX) -> ca.SX:
        """Change of the curvature times length at one point in space, about the fixed axes of the undeformed scene."""
        q = ca.vertsplit(here)
        k = 2.0 * ca.vertcat(*product([q[0], -q[1], -q[2], -q[3]], ca.vertsplit(slope))[1:])
        return k / ca.dot(here, here) if self.gauss else k

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
        """``(q, tangent) ->`` rotated tangents of the points, (axes, p + 1)."""
        n = self.order + 1
        q, tangent = ca.SX.sym("q", self.components, n), ca.SX.sym("tangent", self.axes, n)
        here = self._at_points(q)[0]
        found = ca.horzcat(*[self._tangent(here[:, k], tangent[:, k]) for k in range(n)])
        return ca.Function(f"turned_{name_of(self)}", [q, tangent], [ca.densify(found)])

    # -- derivatives ----------------------------------------------------------------------------------
    # In space derivatives of the whole element are long: those of one point, mapped over the points and put together
    # by constant matrices, are a tenth of the code, and as fast.

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_gradient()
        symbols, q, stiffness, tangent, load, pull = self._large_symbols()
        strain, tangents, gradient, hessian, change = self._point.map(self.order + 1)(
            *self._at(q), stiffness, tangent, pull
        )
        by_q, basis, gained = self._on_nodes(gradient), self._basis(q), tangents - tangent
        matrix = ca.mtimes(basis.T, ca.mtimes(self._between_nodes(hessian), basis))
        # What keeps quaternions on the unit sphere.
        matrix -= 0.25 * ca.diag(ca.vec(ca.repmat(ca.sum1(q * by_q), 3, 1)))
        results = {
            "energy": ca.sum2(strain) + ca.dot(load, gained),
            "stored": ca.sum2(strain),
            "rows": ca.sum2(gained),
            "gradient": ca.densify(ca.mtimes(basis.T, ca.vec(by_q))),
            "stiffness": ca.densify(matrix),
            "rotation_jacobian": ca.densify(ca.mtimes(self._by_nodes(change), basis)),
        }
        return self._function("rotation_gradient", symbols, results)

    def rotation_forces(self) -> ca.Function:
        """As :meth:`.Term.rotation_forces`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_forces()
        symbols, q, stiffness, tangent, _, pull = self._large_symbols()
        tangents, gradient, _ = self._of_point("gradient").map(self.order + 1)(*self._at(q), stiffness, tangent, pull)
        moments = ca.mtimes(self._basis(q).T, ca.vec(self._on_nodes(gradient)))
        return self._function("forces", symbols, {"rows": ca.sum2(tangents - tangent), "gradient": ca.densify(moments)})

    def slopes(self) -> ca.Function:
        """As :meth:`.Term.slopes`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().slopes()
        symbols, q, stiffness, tangent, load, _ = self._large_symbols()
        _, gradient, change = self._of_point("gradient").map(self.order + 1)(*self._at(q), stiffness, tangent, load)
        results = {"gradient": ca.densify(ca.vec(self._on_nodes(gradient))), "jacobian": self._by_nodes(change)}
        return self._function("slopes", symbols[:4], results)

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().curvatures()
        symbols, q, stiffness, tangent, load, _ = self._large_symbols()
        weight = ca.MX.sym("weight")
        pull = weight * load + ca.repmat(symbols[4], 1, self.order + 1)
        hessian = self._of_point("hessian").map(self.order + 1)(*self._at(q), weight * stiffness, tangent, pull)
        return self._function("curvatures", [*symbols, weight], {"hessian": self._between_nodes(hessian)})

    @functools.cached_property
    def convex(self) -> ca.Function:
        """``(q, u, data, load, lam) ->`` a positive semidefinite substitute for the stiffness of
        :meth:`rotation_gradient`.

        Of the strain energy it has the Gauss-Newton part, which in the plane is exact.  Of the internal force it has
        the geometric stiffness of its axial part about both normals, with the sign of tension also in compression.
        """
        symbols, q, stiffness, tangent, _, pull = self._large_symbols()
        if self.space:
            return self._function("convex", symbols, {"convex": self._convex_in_space(q, stiffness, tangent, pull)})
        parts = [ca.SX.sym(name, *part.shape) for name, part in zip("qctp", (q, stiffness, tangent, pull), strict=True)]
        here, slope = self._at_points(parts[0])
        total = ca.SX(self.order + 1, self.order + 1)
        for k in range(self.order + 1):
            by_turns = ca.jacobian(slope[:, k], parts[0])
            along = ca.fabs(ca.dot(self._tangent(here[:, k], parts[2][:, k]), parts[3][:, k]))
            row = ca.DM(interpolation.evaluation(self.nodes, self.points[k : k + 1]))
            total += parts[1][0, k] * ca.mtimes(by_turns.T, by_turns) + along * ca.mtimes(row.T, row)
        inner = ca.Function(f"convex_parts_{name_of(self)}", parts, [ca.densify(total)])
        return self._function("convex", symbols, {"convex": inner(q, stiffness, tangent, pull)})

    def _convex_in_space(self, q: ca.MX, stiffness: ca.MX, tangent: ca.MX, pull: ca.MX) -> ca.MX:
        n = self.order + 1
        hessian, across = self._convex_point.map(n)(*self._at(q), stiffness, tangent, pull)
        basis = self._basis(q)
        pairs = ca.sparsify(ca.kron(self._shape, ca.DM.ones(1, n)) * ca.kron(ca.DM.ones(1, n), self._shape))
        summed = ca.densify(ca.mtimes(ca.reshape(across, 9, n), pairs))
        order = np.arange(9 * n * n).reshape(n, n, 3, 3).transpose(0, 2, 1, 3).ravel()
        total = ca.mtimes(basis.T, ca.mtimes(self._between_nodes(hessian), basis))
        return ca.densify(total + ca.reshape(summed.nz[order.tolist()], 3 * n, 3 * n))

    def _large_symbols(self) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX, ca.MX, ca.MX]:
        """Arguments q, u, data, load, lam of functions put together of others.

        And rotations, stiffnesses, tangents, pulls of loads and whole pulls, a column a node or point.
        """
        turns, places, rows, data, load = self.sizes
        shapes = ((self.components, turns), (self.axes, places), (data, 1), (load, 1), (rows, 1))
        symbols = [ca.MX.sym(name, *shape) for name, shape in zip(ARGUMENTS, shapes, strict=True)]
        given = ca.reshape(symbols[3], self.axes, turns)
        return symbols, symbols[0], *self.split(symbols[2]), given, given + ca.repmat(symbols[4], 1, turns)

    def _function(self, name: str, arguments: list[ca.MX], results: dict[str, ca.MX]) -> ca.Function:
        names = [*ARGUMENTS, "weight"][: len(arguments)]
        return ca.Function(f"{name}_{name_of(self)}", arguments, list(results.values()), names, list(results))

    def point_energy(self, name: str, energy: Callable[[ca.SX, ca.SX], ca.SX], width: int, wanted: str) -> ca.Function:
        """The energy of one point in space from the change of the curvature there, with its derivatives.

        Parameters
        ----------
        name : str
            Of the function.
        energy : callable
            (change of the curvature times length (3,), fixed axes of the undeformed scene; data (width,)) -> energy.
        wanted : str
            ``gradient``, ``hessian`` or ``both``; the other one is empty.

        Returns
        -------
        Function
            ``(rotation, slope, data) ->`` energy, gradient (8,) and second derivatives (8, 8) by rotation and slope.
        """
        here, slope, data = ca.SX.sym("here", 4), ca.SX.sym("slope", 4), ca.SX.sym("data", width)
        value = energy(self._curvature(here, slope), data)
        hessian, gradient = ca.hessian(value, ca.vertcat(here, slope))
        results = [
            value,
            ca.SX(0, 1) if wanted == "hessian" else gradient,
            ca.SX(0, 0) if wanted == "gradient" else hessian,
        ]
        return ca.Function(name, [here, slope, data], [ca.densify(part) for part in results], {"cse": True})

    def summed(self, function: ca.Function, q: ca.MX, data: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Sum over the points of a function as of :meth:`point_energy`, with its derivatives by the nodes.

        Parameters
        ----------
        function : Function
        q : (4, p + 1), rotations of the nodes
        data : (m, p + 1), a column for each point

        Returns
        -------
        energy, its gradient (4, p + 1) and its second derivatives (4 (p + 1), 4 (p + 1)) by the rotations of the nodes
        """
        energies, gradient, hessian = function.map(self.order + 1)(*self._at(q), data)
        by_nodes = self._on_nodes(gradient) if gradient.numel() else ca.MX(4, 0)
        return ca.sum2(energies), by_nodes, self._between_nodes(hessian) if hessian.numel() else ca.MX(0, 0)

    def by_rotation_vectors(self, q: ca.MX, gradient: ca.MX, hessian: ca.MX | None) -> tuple[ca.MX, ca.MX]:
        """Derivatives as of :meth:`summed` by rotation vectors about the fixed axes: (3 (p + 1),), and that squared.

        Of unit quaternions, as :func:`~sfetcas.mechanics.terms.rotation_gradient` says; no second ones for None.
        """
        basis = self._basis(q)
        moments = ca.densify(ca.mtimes(basis.T, ca.vec(gradient)))
        if hessian is None:
            return moments, ca.MX(0, 0)
        radial = ca.diag(ca.vec(ca.repmat(ca.sum1(q * gradient), 3, 1)))
        return moments, ca.densify(ca.mtimes(basis.T, ca.mtimes(hessian, basis)) - 0.25 * radial)

    @functools.cached_property
    def _shape(self) -> ca.DM:
        """Values of the interpolation at the points by those at the nodes, (points, nodes)."""
        return ca.sparsify(ca.DM(interpolation.evaluation(self.nodes, self.points)), 1e-14)

    @functools.cached_property
    def _derivative(self) -> ca.DM:
        """Derivatives at the points by values at the nodes, (points, nodes)."""
        return ca.DM(interpolation.differentiation(self.nodes, self.points))

    def _at(self, q: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Rotations and their derivatives at the points."""
        return (ca.mtimes(q, self._shape.T) if self.gauss else q), ca.mtimes(q, self._derivative.T)

    def _on_nodes(self, gradient: ca.MX) -> ca.MX:
        """Derivatives by the nodes (4, nodes) from those by rotations and slopes at the points (8, points)."""
        return ca.mtimes(gradient[:4, :], self._shape) + ca.mtimes(gradient[4:, :], self._derivative)

    def _by_nodes(self, change: ca.MX) -> ca.MX:
        """Derivative (3, 4 nodes) of the chord from those (3, 4 points) of the tangents by the rotations there."""
        n = self.order + 1
        return ca.densify(ca.reshape(ca.mtimes(ca.reshape(change, 12, n), self._shape), 3, 4 * n))

    def _between_nodes(self, hessian: ca.MX) -> ca.MX:
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

    def _basis(self, q: ca.MX) -> ca.MX:
        """Derivatives of the quaternions of all nodes by their rotation vectors, (4 nodes, 3 nodes)."""
        one = ca.SX.sym("one", 4)
        columns = [product([0.0, *axis], ca.vertsplit(one)) for axis in np.eye(3).tolist()]
        block = ca.Function(
            "basis", [one], [ca.densify(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))]
        )
        blocks = block.map(self.order + 1)(q)
        return ca.diagcat(*ca.horzsplit(blocks, 3))

    def _of_point(self, what: str) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of a point -> Hessian (8, 8) of its energy.

        Or turned tangent, gradient (8,), and the derivative of the turned tangent by the rotation (3, 4).
        """
        here, slope, *data = self._point_symbols()
        now = self._tangent(here, data[1])
        energy = self._strain_energy(here, slope, data[0]) + ca.dot(data[2], now)
        hessian, gradient = ca.hessian(energy, ca.vertcat(here, slope))
        results = [now, gradient, ca.jacobian(now, here)] if what == "gradient" else [hessian]
        name = f"point_{what}_{name_of(self)}"
        return ca.Function(name, [here, slope, *data], [ca.densify(one) for one in results], {"cse": True})

    @functools.cached_property
    def _point(self) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of one point -> its share of :meth:`rotation_gradient`.

        Strain energy, turned tangent, gradient (8,) and Hessian (8, 8) by rotation and slope, and the derivative
        of the turned tangent by the rotation (3, 4).
        """
        here, slope, *data = self._point_symbols()
        strain = self._strain_energy(here, slope, data[0])
        now = self._tangent(here, data[1])
        hessian, gradient = ca.hessian(strain + ca.dot(data[2], now), ca.vertcat(here, slope))
        results = [strain, now, gradient, hessian, ca.jacobian(now, here)]
        symbols = [here, slope, *data]
        return ca.Function(f"point_{name_of(self)}", symbols, [ca.densify(one) for one in results], {"cse": True})

    def _point_symbols(self) -> list[ca.SX]:
        names = {"here": 4, "slope": 4, "stiffness": 6, "tangent": 3, "pull": 3}
        return [ca.SX.sym(name, size) for name, size in names.items()]

    @functools.cached_property
    def _convex_point(self) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of one point -> its share of :attr:`convex`."""
        here, slope, stiffness, tangent, pull = self._point_symbols()
        strain = self._curvature(here, slope)
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
def element_by_name(name: str, space: bool, gauss: bool = False) -> Element:
    """The element type of a name; each is made once a process, so that its functions are, too."""
    return Element(space, ELEMENTS.index(name) + 1, gauss)
