"""The special finite elements SFET2 to SFET9: energy of one element as a function of its nodal rotations.

The unknowns of an element with p + 1 nodes are rotations *since the undeformed state*: one angle a node in
the plane, one quaternion a node in space, interpolated by Lagrange polynomials on the Gauss-Lobatto points.
With ``q`` this rotation, ``kappa_0`` and ``t_0`` curvature and tangent of the unloaded centre line and
``R_0`` its section axes,

    kappa - kappa_0 = R_0^T 2 G(q) q',      u' = (R(q) - I) t_0,

so that an undeformed element of any shape has exactly no strain and no displacement.  For a straight member
this is the interpolation of the source; for a curved one it interpolates the smaller of the two rotations.

Of each integration point an element is told the stiffness (times weight over length, in the fixed axes of the
undeformed scene), the tangent (unit tangent of the unloaded centre line times weight times length) and the
pull (minus the internal force): its energy is the strain energy plus ``sum pull.R(q) tangent``.

Two ways to integrate: *at the nodes* (Lobatto), where ``q`` is exactly unit and everything is polynomial, and
*Gauss*, with the interpolated quaternion divided by its norm.  Both are of order 2p at the element ends.

Source: Barraco and Munteanu, Part 1, sections 3 and 4 (SFET2, SFET3); the higher orders are ours.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics import interpolation
from ..mathematics.arrays import Array
from ..mathematics.quaternion import Components, product, turned

__all__ = ["ELEMENTS", "Element", "element_by_name"]


@dataclass(frozen=True)
class Element(Components):
    """One element type: order, integration and dimension; everything else follows and is made once.

    Attributes
    ----------
    order : int
        Polynomial order p of the interpolation; the element has p + 1 nodes.
    space : bool
        Quaternions (4 numbers a node) or, in the plane, one angle a node.
    gauss : bool
        Integration on p + 1 Gauss points with the norm divided out instead of at the nodes.
    """

    order: int
    space: bool
    gauss: bool = False

    @property
    def name(self) -> str:
        """The name of scene files: SFET2, SFET3, ..."""
        return f"SFET{self.order + 1}"

    @property
    def stiffnesses(self) -> int:
        """Numbers of a stiffness a point: the upper triangle of a symmetric 3 x 3 matrix, or one number."""
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

    def _symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        n = self.order + 1
        return (
            ca.SX.sym("q", self.components, n),
            ca.SX.sym("stiffness", self.stiffnesses, n),
            ca.SX.sym("tangent", self.axes, n),
            ca.SX.sym("pull", self.axes, n),
        )

    def _at_points(self, q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Rotation and its derivative by xi at the integration points."""
        slope = ca.mtimes(q, ca.DM(interpolation.differentiation(self.nodes, self.points).T))
        here = ca.mtimes(q, ca.DM(interpolation.evaluation(self.nodes, self.points).T)) if self.gauss else q
        return here, slope

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
        t = ca.vertsplit(tangent)
        if not self.space:
            c, s = ca.cos(here[0]), ca.sin(here[0])
            return ca.vertcat(c * t[0] - s * t[1], s * t[0] + c * t[1])
        v = ca.vertcat(*turned(ca.vertsplit(here), t))
        return v / ca.dot(here, here) if self.gauss else v

    def _energy(self, q: ca.SX, stiffness: ca.SX, tangent: ca.SX, pull: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Energy, and the vector from the first to the last node."""
        here, slope = self._at_points(q)
        energy: ca.SX = ca.SX(0)
        reach: ca.SX = ca.SX(self.axes, 1)
        for k in range(self.order + 1):
            turned_tangent = self._tangent(here[:, k], tangent[:, k])
            energy += self._strain_energy(here[:, k], slope[:, k], stiffness[:, k])
            energy += ca.dot(pull[:, k], turned_tangent)
            reach += turned_tangent
        return energy, ca.densify(reach)

    def _spin(self, q: ca.SX) -> ca.SX:
        """Derivative of the nodal unknowns by rotations about the fixed axes: ``dq = 1/2 (0, phi) q``."""
        if not self.space:
            return ca.SX.eye(self.order + 1)
        blocks = []
        for k in range(self.order + 1):
            node = ca.vertsplit(q[:, k])
            columns = [product([0.0, *axis], node) for axis in np.eye(3).tolist()]
            blocks.append(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))
        return ca.diagcat(*blocks)

    def _function(self, name: str, arguments: list[Any], results: dict[str, Any]) -> ca.Function:
        tag = f"{name}_{self._tag}"
        names = list(ARGUMENTS) if len(arguments) == 4 else ["q", "tangent"]
        return ca.Function(tag, arguments, list(results.values()), names, list(results))

    @functools.cached_property
    def energy(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> energy: strain energy plus ``sum pull.R(q) t`` over the points."""
        symbols = self._symbols()
        return self._function("energy", list(symbols), {"energy": self._energy(*symbols)[0]})

    @functools.cached_property
    def gradient(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> energy and its gradient by ``vec(q)``."""
        if self.space:
            return self._gradient_in_space()
        q, *data = self._symbols()
        energy = self._energy(q, *data)[0]
        gradient = ca.vec(ca.gradient(energy, q))
        return self._function("gradient", [q, *data], {"energy": energy, "gradient": gradient})

    @functools.cached_property
    def hessian(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> dense Hessian of the energy by ``vec(q)``."""
        if self.space:
            return self._hessian_in_space()
        q, *data = self._symbols()
        hessian = ca.densify(ca.hessian(self._energy(q, *data)[0], q)[0])
        return self._function("hessian", [q, *data], {"hessian": hessian})

    @functools.cached_property
    def reach(self) -> ca.Function:
        """(q, tangent) -> the vector from the first to the last node, shape (axes, 1)."""
        q, stiffness, tangent, pull = self._symbols()
        return self._function("reach", [q, tangent], {"reach": self._energy(q, stiffness, tangent, pull)[1]})

    @functools.cached_property
    def reach_jacobian(self) -> ca.Function:
        """(q, tangent) -> the reach and its dense derivative by ``vec(q)``."""
        q, stiffness, tangent, pull = self._symbols()
        reach = self._energy(q, stiffness, tangent, pull)[1]
        jacobian = ca.densify(ca.jacobian(reach, q))
        return self._function("reach_jacobian", [q, tangent], {"reach": reach, "jacobian": jacobian})

    @functools.cached_property
    def turned(self) -> ca.Function:
        """(q, tangent) -> turned tangents of the points, (axes, p + 1)."""
        q, _, tangent, _ = self._symbols()
        here = self._at_points(q)[0]
        found = [self._tangent(here[:, k], tangent[:, k]) for k in range(self.order + 1)]
        return self._function("turned", [q, tangent], {"turned": ca.densify(ca.horzcat(*found))})

    @functools.cached_property
    def turning(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> strain energy, work, moments, turning stiffness, reach and its spin.

        Derivatives by rotations ``phi`` about the fixed axes at the nodes, on unit quaternions: with ``E`` from
        ``dq = 1/2 (0, phi) q`` the gradient is ``E^T g`` and the Hessian ``E^T H E - 1/4 (q.g) I`` (the second
        term keeps the quaternion on the unit sphere; it is what the multiplier of the norm does).
        """
        return self._turning_in_space() if self.space else self._turning_in_plane()

    @functools.cached_property
    def moments(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> the moments of :attr:`turning` alone, of which derivatives are short."""
        if self.space:
            return self._moments_in_space()
        q, *data = self._symbols()
        gradient = ca.gradient(self._energy(q, *data)[0], q)
        return self._function("moments", [q, *data], {"moments": ca.densify(ca.vec(gradient))})

    def _moments_in_space(self) -> ca.Function:
        q, *data = self._large_symbols()
        gradient = self._of_point("gradient").map(self.order + 1)(*self._at(q), *data)[1]
        moments = ca.mtimes(self._spins(q).T, ca.vec(self._on_nodes(gradient)))
        return self._function("moments", [q, *data], {"moments": ca.densify(moments)})

    def _turning_in_plane(self) -> ca.Function:
        q, *data = self._symbols()
        energy, reach = self._energy(q, *data)
        strain = ca.substitute(energy, data[2], ca.SX.zeros(data[2].shape))
        hessian, gradient = ca.hessian(energy, q)
        results = {
            "strain": strain,
            "work": energy - strain,
            "moments": ca.densify(ca.vec(gradient)),
            "stiffness_turning": ca.densify(hessian),
            "reach": reach,
            "reach_spin": ca.densify(ca.jacobian(reach, q)),
        }
        return self._function("turning", [q, *data], results)

    # In space derivatives of the whole element are long: those of one point, mapped over the points and put together
    # by constant matrices, are a tenth of the code, and as fast.

    def _turning_in_space(self) -> ca.Function:
        q, *data = self._large_symbols()
        strain, work, tangents, gradient, hessian, change = self._point.map(self.order + 1)(*self._at(q), *data)
        by_q = self._on_nodes(gradient)
        spin = self._spins(q)
        radial = ca.sum1(q * by_q)
        stiffness = ca.mtimes(spin.T, ca.mtimes(self._between_nodes(hessian), spin))
        stiffness -= 0.25 * ca.diag(ca.vec(ca.repmat(radial, 3, 1)))
        by_node = ca.reshape(ca.mtimes(ca.reshape(change, 12, self.order + 1), self._shape), 3, 4 * (self.order + 1))
        results = {
            "strain": ca.sum2(strain),
            "work": ca.sum2(work),
            "moments": ca.densify(ca.mtimes(spin.T, ca.vec(by_q))),
            "stiffness_turning": ca.densify(stiffness),
            "reach": ca.sum2(tangents),
            "reach_spin": ca.densify(ca.mtimes(by_node, spin)),
        }
        return self._function("turning", [q, *data], results)

    def _large_symbols(self) -> list[ca.MX]:
        """As :meth:`_symbols`, for functions put together of others."""
        return [ca.MX.sym(name, *part.shape) for name, part in zip(ARGUMENTS, self._symbols(), strict=True)]

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

    def _spins(self, q: ca.MX) -> ca.MX:
        """As :meth:`_spin`, (4 nodes, 3 nodes)."""
        one = ca.SX.sym("one", 4)
        columns = [product([0.0, *axis], ca.vertsplit(one)) for axis in np.eye(3).tolist()]
        block = ca.Function("spin", [one], [ca.densify(0.5 * ca.horzcat(*[ca.vertcat(*column) for column in columns]))])
        blocks = block.map(self.order + 1)(q)
        return ca.diagcat(*ca.horzsplit(blocks, 3))

    def _gradient_in_space(self) -> ca.Function:
        q, *data = self._large_symbols()
        energy, gradient = self._of_point("gradient").map(self.order + 1)(*self._at(q), *data)
        results = {"energy": ca.sum2(energy), "gradient": ca.densify(ca.vec(self._on_nodes(gradient)))}
        return self._function("gradient", [q, *data], results)

    def _hessian_in_space(self) -> ca.Function:
        q, *data = self._large_symbols()
        hessian = self._of_point("hessian").map(self.order + 1)(*self._at(q), *data)
        return self._function("hessian", [q, *data], {"hessian": self._between_nodes(hessian)})

    def _of_point(self, what: str) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of a point -> its energy and gradient (8,), or Hessian (8, 8)."""
        here, slope, *data = self._point_symbols()
        energy = self._strain_energy(here, slope, data[0]) + ca.dot(data[2], self._tangent(here, data[1]))
        hessian, gradient = ca.hessian(energy, ca.vertcat(here, slope))
        results = [energy, gradient] if what == "gradient" else [hessian]
        name = f"point_{what}_{self._tag}"
        return ca.Function(name, [here, slope, *data], [ca.densify(one) for one in results], {"cse": True})

    @functools.cached_property
    def _point(self) -> ca.Function:
        """(rotation, slope, stiffness, tangent, pull) of one point -> its share of :attr:`turning`.

        Strain energy, work, turned tangent, gradient (8,) and Hessian (8, 8) by rotation and slope, and the derivative
        of the turned tangent by the rotation (3, 4).
        """
        here, slope, *data = self._point_symbols()
        strain = self._strain_energy(here, slope, data[0])
        now = self._tangent(here, data[1])
        work = ca.dot(data[2], now)
        hessian, gradient = ca.hessian(strain + work, ca.vertcat(here, slope))
        results = [strain, work, now, gradient, hessian, ca.jacobian(now, here)]
        return ca.Function(
            f"point_{self._tag}", [here, slope, *data], [ca.densify(one) for one in results], {"cse": True}
        )

    def _point_symbols(self) -> list[ca.SX]:
        names = {"here": 4, "slope": 4, "stiffness": 6, "tangent": 3, "pull": 3}
        return [ca.SX.sym(name, size) for name, size in names.items()]

    @property
    def _tag(self) -> str:
        return f"{'space' if self.space else 'plane'}_{self.order + 1}{'_gauss' if self.gauss else ''}"

    @functools.cached_property
    def convex(self) -> ca.Function:
        """(q, stiffness, tangent, pull) -> a positive matrix in place of the turning stiffness of :attr:`turning`.

        Of the strain energy the share of the first derivatives of the curvature (Gauss and Newton), exact in the plane;
        of the pull what it resists where it is tension, and as much where it is compression, about both normals.
        """
        if self.space:
            return self._convex_in_space()
        q, stiffness, tangent, pull = self._symbols()
        here, slope = self._at_points(q)
        total = ca.SX(self.order + 1, self.order + 1)
        for k in range(self.order + 1):
            by_turns = ca.jacobian(slope[:, k], q)
            along = ca.fabs(ca.dot(self._tangent(here[:, k], tangent[:, k]), pull[:, k]))
            row = ca.DM(interpolation.evaluation(self.nodes, self.points[k : k + 1]))
            total += stiffness[0, k] * ca.mtimes(by_turns.T, by_turns) + along * ca.mtimes(row.T, row)
        return self._function("convex", [q, stiffness, tangent, pull], {"convex": ca.densify(total)})

    def _convex_in_space(self) -> ca.Function:
        n = self.order + 1
        q, *data = self._large_symbols()
        hessian, across = self._convex_point.map(n)(*self._at(q), *data)
        spin = self._spins(q)
        pairs = ca.sparsify(ca.kron(self._shape, ca.DM.ones(1, n)) * ca.kron(ca.DM.ones(1, n), self._shape))
        summed = ca.densify(ca.mtimes(ca.reshape(across, 9, n), pairs))
        order = np.arange(9 * n * n).reshape(n, n, 3, 3).transpose(0, 2, 1, 3).ravel()
        total = ca.mtimes(spin.T, ca.mtimes(self._between_nodes(hessian), spin))
        total += ca.reshape(summed.nz[order.tolist()], 3 * n, 3 * n)
        return self._function("convex", [q, *data], {"convex": ca.densify(total)})

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
        return ca.Function(f"convex_{self._tag}", symbols, [ca.densify(one) for one in results], {"cse": True})


ARGUMENTS = ("q", "stiffness", "tangent", "pull")
ELEMENTS = tuple(f"SFET{n}" for n in range(2, 10))
"""Names of the elements, by their number of nodes."""


@functools.cache
def element_by_name(name: str, space: bool, gauss: bool = False) -> Element:
    """The element type of a name, made once a process so that its functions are, too."""
    return Element(ELEMENTS.index(name) + 1, space, gauss)
