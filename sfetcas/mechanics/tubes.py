"""Tubes that share the centre line of members, as terms along the elements of these.

All have the tangent of the member, so that a tube has one further freedom at each section: the angle ``theta`` about
the tangent by which it is turned against the section.  With twist and curvatures ``kappa`` of the member about its own
axes b1, b2, b3 those of the tube about its axes are

    kappa_t = R_1(-theta) kappa + theta' b1,

and it adds ``1/2 (kappa_t - kappa_t0).C_t (kappa_t - kappa_t0)`` per length, ``kappa_t0`` being its own.  The angle
is that of the base and what the tube is twisted beyond that: ``theta = alpha + phi``, and the angles ``phi`` at the
nodes of elements are first components of places, of which nothing else is at.  No rows tie the tubes together, so that
an equilibrium without negative eigenvalues is stable, and one that snaps is a limit point.

The loads of an element are ``alpha`` and the share of what the tube is misfit by: at 0 it has the curvature of the
undeformed member, at 1 its own.  Beyond its base behind the members a tube is held straight and only twists, a spring
between the base and the first section.

Source: Dupont, Lock, Itkowitz and Butler, IEEE Transactions on Robotics 26, 209 (2010); Rucker, Jones and Webster, the
same 26, 769 (2010).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

from ..description.tubes import Run, Tube
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, numbers, values_of
from ..mathematics.interpolation import legendre_tail
from .elements import Element
from .mesh import within_elements
from .parts import Parts
from .stations import Stations
from .terms import ALWAYS, ARGUMENTS, One, Side, Term, name_of

__all__ = [
    "BehindBase",
    "TubeAlong",
    "angles_along",
    "angles_like",
    "elements_in",
    "moments_of",
    "roughness",
    "sections_of",
    "tubes_in",
    "twist_behind",
]

POINT = 21
"""Numbers of a point: stiffness (6), axes (9), twist and curvatures of the member (3) and of the tube (3)."""


@final
@dataclass(frozen=True)
class TubeAlong(Term):
    """The strain energy of a tube along one element, in space.

    Data of each point: stiffness times weight over length, the upper triangle of a matrix in the axes of the tube; the
    axes b1, b2, b3 of the undeformed member, one after the other; twist and curvatures of the undeformed member, and
    those of the unloaded tube, times length.  Loads: angle of the base, and share of the misfit.

    Attributes
    ----------
    element : Element
    """

    table: ClassVar[str] = "tubes"
    answers: ClassVar[Mapping[str, str]] = {"torque": "N m", "angle": "rad", "energy": "J"}
    along_element: ClassVar[bool] = True
    drives: ClassVar[str] = "twist"

    element: Element

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Rotations and angles of the nodes."""
        n = self.element.order + 1
        return n, n, 0, n * POINT, 2

    @property
    def proportional(self) -> bool:
        """False: its forces are not linear in the angle of its base."""
        return False

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Sum over the points."""
        points = ca.reshape(data, POINT, self.element.order + 1)
        here, slope = self.element.at_points(ca.horzcat(*[ca.vertcat(*side) for side in q]))
        angle, twist = self.element.at_points(ca.horzcat(*[side[0] for side in u]))
        return sum(
            (
                self._at(here[:, k], slope[:, k], angle[k], twist[k], points[:, k], load)
                for k in range(self.element.order + 1)
            ),
            ca.SX(0),
        )

    def _at(self, here: ca.SX, slope: ca.SX, angle: ca.SX, twist: ca.SX, point: ca.SX, load: ca.SX) -> ca.SX:
        """Energy of one point, from rotation and twisted angle there and their derivatives by xi."""
        strain = self._strain(self.element.curvature(here, slope), angle + load[0], twist, point, load[1])
        return 0.5 * ca.dot(strain, ca.mtimes(self.element.section(point[:6]), strain))

    def _strain(self, change: ca.SX, angle: ca.SX, twist: ca.SX, point: ca.SX, share: ca.SX) -> ca.SX:
        """Twist and curvatures times length of the tube less its own, from those by which the member changed."""
        rest, own = point[15:18], point[18:21]
        bent = ca.mtimes(ca.reshape(point[6:15], 3, 3).T, change) + rest
        c, s = ca.cos(angle), ca.sin(angle)
        turned = ca.vertcat(bent[0] + twist, c * bent[1] + s * bent[2], c * bent[2] - s * bent[1])
        return turned - rest - share * (own - rest)

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """All of it."""
        return self.energy(q, u, data, load)

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """Torque that the base takes from its drive as far as it is spent here, angle at the end, energy."""
        energy = self.energy(q, u, data, load)
        return [ca.gradient(energy, load)[0], load[0] + u[-1][0], energy]

    # -- derivatives: those of one point, mapped over the points and put together by constant matrices ------------

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`, assembled from the derivatives of single points."""
        symbols, energy, gradient, hessian = self._assembled("both")
        basis = self._basis(symbols[0])
        by_q = ca.reshape(gradient[: 4 * self.sizes[0]], 4, self.sizes[0])
        # What keeps quaternions on the unit sphere.
        radial = ca.vec(ca.repmat(ca.sum1(symbols[0] * by_q), 3, 1))
        stiffness = ca.mtimes(basis.T, ca.mtimes(hessian, basis))
        stiffness -= 0.25 * ca.diag(ca.vertcat(radial, ca.MX.zeros(3 * self.sizes[1])))
        results = [energy, energy, ca.MX(0, 1), ca.densify(ca.mtimes(basis.T, gradient)), ca.densify(stiffness)]
        results.append(ca.MX(0, basis.shape[1]))
        names = ["energy", "stored", "rows", "gradient", "stiffness", "rotation_jacobian"]
        return ca.Function(f"rotation_gradient_{name_of(self)}", symbols, results, [*ARGUMENTS], names)

    def rotation_forces(self) -> ca.Function:
        """As :meth:`.Term.rotation_forces`, assembled from the derivatives of single points."""
        symbols, _, gradient, _ = self._assembled("gradient")
        results = [ca.MX(0, 1), ca.densify(ca.mtimes(self._basis(symbols[0]).T, gradient))]
        return ca.Function(f"forces_{name_of(self)}", symbols, results, [*ARGUMENTS], ["rows", "gradient"])

    def slopes(self) -> ca.Function:
        """As :meth:`.Term.slopes`, assembled from the derivatives of single points."""
        symbols, _, gradient, _ = self._assembled("gradient")
        results = [ca.densify(gradient), ca.MX(0, gradient.shape[0])]
        names = ["gradient", "jacobian"]
        return ca.Function(f"slopes_{name_of(self)}", symbols[:4], results, [*ARGUMENTS[:4]], names)

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`, assembled from the derivatives of single points."""
        symbols, _, _, hessian = self._assembled("hessian")
        weight = ca.MX.sym("weight")
        results = [ca.densify(weight * hessian)]
        return ca.Function(
            f"curvatures_{name_of(self)}", [*symbols, weight], results, [*ARGUMENTS, "weight"], ["hessian"]
        )

    def _assembled(self, wanted: str) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX]:
        """Arguments, energy, and its derivatives by the components of rotations and places."""
        turns, places, rows, count, loads = self.sizes
        shapes = ((4, turns), (3, places), (count, 1), (loads, 1), (rows, 1))
        symbols = [ca.MX.sym(name, *shape) for name, shape in zip(ARGUMENTS, shapes, strict=True)]
        spread, n = self._spread, turns
        at_points = ca.reshape(ca.mtimes(spread, ca.vertcat(ca.vec(symbols[0]), ca.vec(symbols[1]))), 10, n)
        point = self._point(wanted).map(n)
        energy, gradient, hessian = point(at_points, ca.reshape(symbols[2], POINT, n), ca.repmat(symbols[3], 1, n))
        found = [ca.sum2(energy), ca.MX(0, 1), ca.MX(0, 0)]
        if wanted != "hessian":
            found[1] = ca.mtimes(spread.T, ca.vec(gradient))
        if wanted != "gradient":
            blocks = ca.diagcat(*ca.horzsplit(hessian, 10))
            found[2] = ca.mtimes(spread.T, ca.mtimes(blocks, spread))
        return symbols, found[0], found[1], found[2]

    def _point(self, wanted: str) -> ca.Function:
        """(rotation, slope, angle and its derivative (10,), data, loads) of one point -> energy and its derivatives."""
        x, data, load = ca.SX.sym("x", 10), ca.SX.sym("data", POINT), ca.SX.sym("load", 2)
        energy = self._at(x[:4], x[4:8], x[8], x[9], data, load)
        hessian, gradient = ca.hessian(energy, x)
        results = [energy, ca.SX(0, 1) if wanted == "hessian" else gradient]
        results.append(ca.SX(0, 0) if wanted == "gradient" else hessian)
        name = f"point_{name_of(self)}_{wanted}"
        return ca.Function(name, [x, data, load], [ca.densify(part) for part in results], {"cse": True})

    @functools.cached_property
    def _spread(self) -> ca.DM:
        """What is at the points (10 points) by the components of all nodes, (4 nodes) of rotations, (3 nodes)."""
        n, rows = self.element.order + 1, []
        shape, derivative = self.element.at_points(ca.SX.eye(n))
        for k in range(n):
            for row in (shape[:, k].T, derivative[:, k].T):
                rows.append(ca.horzcat(ca.kron(ca.DM(row), ca.DM.eye(4)), ca.DM(4, 3 * n)))
            for row in (shape[:, k].T, derivative[:, k].T):
                rows.append(ca.horzcat(ca.DM(1, 4 * n), ca.kron(ca.DM(row), ca.DM([[1.0, 0.0, 0.0]]))))
        return ca.sparsify(ca.vertcat(*rows), 1e-14)

    def _basis(self, q: ca.MX) -> ca.MX:
        """Derivatives of the components by rotation vectors, and of places by themselves."""
        return ca.diagcat(self.element.basis(q), ca.MX.eye(3 * self.sizes[1]))


@final
@dataclass(frozen=True)
class BehindBase(Term):
    """The part of a tube behind its members, which twists; data: its torsional stiffness."""

    table: ClassVar[str] = "tubes"
    answers: ClassVar[Mapping[str, str]] = TubeAlong.answers

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The place of the angle."""
        return 0, 1, 0, 1, 0

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Half the stiffness times the square of the angle."""
        return 0.5 * data[0] * u[0][0] ** 2

    def answer(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX, lam: ca.SX) -> list[ca.SX]:
        """Of what the tube tells its energy."""
        return [ca.SX(0), ca.SX(0), self.energy(q, u, data, load)]


# -- of a scene -------------------------------------------------------------------------------------


def elements_in(model: Any, run: Run) -> slice:
    """Numbers of the elements along a run of a tube; of a model, or the parts of one."""
    a, b = (model.mesh.cut_at(run.member, end) for end in (run.start, run.end))
    first = model.beams.first[run.member]
    return slice(first + a, first + b)


def _runs(model: Any, tube: str) -> Iterator[tuple[Run, slice, Index]]:
    """Runs of a tube with their elements, and places of the angles (elements, nodes)."""
    begin = 0
    for run in model.scene.tube_runs[tube]:
        part = elements_in(model, run)
        yield run, part, model.segments.angles[tube][begin : begin + part.stop - part.start]
        begin += part.stop - part.start


def tubes_in(parts: Parts) -> Iterator[One]:
    """The terms of all tubes, one for each element along which they lie, in the order of their arc length."""
    for name, tube in parts.scene.tubes.items():
        loads: dict[str | None, Array] = {ALWAYS: numbers([tube.angle, 1.0])}
        if values_of(tube.rotation):
            loads[tube.history] = numbers([tube.rotation, 0.0])
        kind = TubeAlong(parts.element.space, parts.element)
        for run, part, places in _runs(parts, name):
            data = _data(parts, tube, run, part)
            for e in range(part.stop - part.start):
                number = part.start + e
                turns = tuple(parts.rotations.turns[number].tolist())
                yield One(kind, name, "", data[e], turns, tuple(places[e].tolist()), loads=loads, element=number)
        if tube.start < 0.0:
            stiffness = _behind(parts.scene, tube) / parts.scales.moment
            first = (int(parts.segments.angles[name][0, 0]),)
            yield One(BehindBase(parts.element.space), name, "", numbers([stiffness]), (), first)


def _data(parts: Parts, tube: Tube, run: Run, part: slice) -> Array:
    """Data (elements, numbers) of :class:`TubeAlong` along a run."""
    element, line, first = parts.element, parts.scene.center_lines[run.member], parts.beams.first[run.member]
    cuts = parts.mesh.cuts[run.member][part.start - first : part.stop - first + 1]
    x = within_elements(cuts, element.points)
    length = np.diff(cuts) * line.length
    own = numbers(run.begin + x * line.length)
    stiffness = parts.scene.sections[tube.section].stiffness_matrix(values_of(own / tube.length).ravel().clip(0.0, 1.0))
    stiffness = numbers(stiffness[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]).reshape(*x.shape, 6)
    stiffness = stiffness * (element.weights / (length[:, None] * parts.scales.moment))[..., None]
    frames, rest = axes_along(line, run, x.ravel())
    curved = (values_of(own).mean(axis=1) > tube.curved_from)[:, None, None]
    natural = np.where(curved, 1.0, 0.0) * numbers(tube.vector) * np.ones((*x.shape, 1))
    points = [
        stiffness,
        numbers(frames.transpose(0, 2, 1)).reshape(*x.shape, 9),
        rest.reshape(*x.shape, 3) * length[:, None, None],
        natural * length[:, None, None],
    ]
    return numbers(np.concatenate(points, axis=2).reshape(len(length), -1))


def axes_along(line: Any, run: Run, x: Array) -> tuple[Array, Array]:
    """Axes of the undeformed member as columns (n, 3, 3), and its twist and curvatures about them (n, 3), 1/m.

    They go on along all members of the tube.
    """
    c, s = np.cos(run.turned), np.sin(run.turned)
    back = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return numbers(quaternion.matrix(line.quaternions(x)) @ back), numbers(line.curvatures(x) @ back)


def _behind(scene: Any, tube: Tube) -> Any:
    """Torsional stiffness, N m, of the part of a tube behind its members."""
    return 1.0 / _compliance(scene, tube, -tube.start)


def _compliance(scene: Any, tube: Tube, end: Any) -> Any:
    """Torsional compliance, 1/(N m), of a tube from its base to an arc length, m."""
    section, share = scene.sections[tube.section], end / tube.length
    breaks = np.unique([0.0, *(x for x in section.breaks if x < share), share])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    spans = np.diff(breaks)
    x = (breaks[:-1, None] + 0.5 * spans[:, None] * (1.0 + nodes)).ravel()
    return tube.length * ((0.5 * spans[:, None] * weights).ravel() / section.stiffness(x)[:, 0]).sum()


def twist_behind(scene: Any, tube: Tube, own: Array, angle: float) -> tuple[Array, Array, float]:
    """Angle (n,), rad, and twist (n,), 1/m, behind the members of a tube, and its torque, N m.

    At arc lengths (n,), m, from its base, where it is twisted by an angle, rad, up to its members.
    """
    torque = float(_behind(scene, tube)) * angle
    twist = torque / scene.sections[tube.section].stiffness(own / tube.length)[:, 0]
    return np.array([torque * float(_compliance(scene, tube, end)) if end else 0.0 for end in own]), twist, torque


# -- of a state -------------------------------------------------------------------------------------


def _nodal(places: Index, values: Array) -> Array:
    """Values (elements, nodes) of angles at their places, which are zero at the ground, from those of all places."""
    return np.where(places < 0, 0.0, values[np.maximum(places, 0)])


def angles_along(model: Any, tube: str, member: str, x: Array, values: Array) -> tuple[Array, Array, Array]:
    """Angle (n,), rad, by which a tube is twisted since its base, its derivative, 1/m, and whether the tube is there.

    At fractions x (n,) of the length of a member; ``values`` are the angles at all places.
    """
    angle, twist, there = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x), bool)
    for run, part, places in _runs(model, tube):
        if run.member != member:
            continue
        cuts, first = model.mesh.cuts[member], model.beams.first[member]
        cuts = cuts[part.start - first : part.stop - first + 1]
        at, nodal = Stations(model.element, cuts, np.clip(x, cuts[0], cuts[-1])), _nodal(places, values)[..., None]
        length = np.diff(cuts)[at.elements] * model.scene.center_lines[member].length
        angle = np.einsum("nj,njc->n", at.nodal, nodal[at.elements])
        twist = np.einsum("nj,njc->n", at.slopes, nodal[at.elements]) / length
        there = (x >= cuts[0]) & (x <= cuts[-1])
    return angle, twist, there


def angles_like(target: Any, y: Array, source: Any, values: Array) -> None:
    """Set the angles of tubes among the displacement unknowns ``y`` of one model to those of another, in place.

    ``values`` are the displacement unknowns of the other model, of the same tubes on another mesh, or elsewhere along
    their members: beyond the ends of a tube its angles there go on.
    """
    if not target.scene.tubes:
        return
    known = source.positions.retained[:, 0]
    there = np.where(known < 0, 0.0, np.append(values, 0.0)[known])
    for name in target.scene.tubes:
        nodal = {run.member: _nodal(places, there) for run, _, places in _runs(source, name)}
        last = float(next(iter(nodal.values()))[0, 0])
        for run, part, places in _runs(target, name):
            if run.member in nodal:
                cuts, first = target.mesh.cuts[run.member], target.beams.first[run.member]
                cuts = cuts[part.start - first : part.stop - first + 1]
                x = within_elements(cuts, target.element.nodes).ravel()
                found = angles_along(source, name, run.member, x, there)[0].reshape(places.shape)
                last = float(nodal[run.member][-1, -1])
            else:
                found = np.full(places.shape, last)
            unknown = np.where(places < 0, -1, target.positions.retained[np.maximum(places, 0), 0])
            y[unknown[unknown >= 0]] = found[unknown >= 0]


def roughness(model: Any, values: Array) -> Array:
    """Sizes (elements,), rad, of the highest Legendre coefficients of the angles of tubes, summed over these."""
    found = np.zeros(len(model.beams.weight))
    for tube in model.scene.tubes:
        for _, part, places in _runs(model, tube):
            found[part] += np.abs(_nodal(places, values) @ legendre_tail(model.element.nodes))
    return found


def moments_of(model: Any, member: str, x: Array, values: Array, bases: Mapping[str, float]) -> tuple[Array, Array]:
    """What tubes add at sections of a member: stiffnesses (n, 3, 3), N m2, and moments (n, 3), N m, without curvature.

    About the axes b1, b2, b3 of the member; the moment of all tubes is the stiffness times its twist and curvatures
    plus these.

    Parameters
    ----------
    x : (n,), fractions of the length
    values : (places,), rad, twisted angles at all places
    bases : angles of the bases, rad, by the names of the tubes
    """
    stiffness, moment = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3))
    for name, runs in model.scene.tube_runs.items():
        for run in runs:
            if run.member != member:
                continue
            angle, twist, there = angles_along(model, name, member, x, values)
            axes, section, natural = sections_of(model, name, run, x, angle + bases[name] - run.turned)
            natural[:, 0] -= twist
            stiffness += np.einsum("nij,njk,nlk->nil", axes, section, axes) * there[:, None, None]
            moment -= np.einsum("nij,njk,nk->ni", axes, section, natural) * there[:, None]
    return stiffness, moment


def sections_of(model: Any, name: str, run: Run, x: Array, angle: Array) -> tuple[Array, Array, Array]:
    """Axes of a tube as columns (n, 3, 3), about those of the member, stiffness (n, 3, 3), N m2, and natural curvature
    (n, 3), 1/m, at fractions x (n,) of the length of a member against which it is turned by angles (n,), rad.
    """
    tube, scene = model.scene.tubes[name], model.scene
    own = run.begin + x * scene.center_lines[run.member].length
    section = scene.sections[tube.section].stiffness_matrix(np.clip(own / tube.length, 0.0, 1.0))
    c, s, nothing = np.cos(angle), np.sin(angle), np.zeros(len(x))
    rows = [[nothing + 1.0, nothing, nothing], [nothing, c, -s], [nothing, s, c]]
    natural = np.where((own >= tube.curved_from)[:, None], tube.vector, 0.0)
    return np.moveaxis(np.array(rows), 2, 0), section, natural
