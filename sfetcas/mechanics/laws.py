"""Laws of sections as terms: what their potentials are more, or less, than the quadratic one at rest.

An element has the stiffness of its section at rest.  Where that has a law, a term along the element adds

    sum over the points  weight length d(kappa),      d(kappa) = W(kappa) - 1/2 kappa.C kappa,

with the changes of the curvature ``kappa`` about the axes of the section, which are those of the element itself.  In
numbers ``kappa`` is over a unit of curvature of the law, and ``d`` over its unit of energy per length.

Where a law depends on strains, too, ``W`` is that of curvatures and strains, which are those of the element, the scaled
ones of its points times ``(compliance / (weight length))^1/2``; also these are over the unit of curvature.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, final

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.laws import SectionLaw
from ..description.scene import Scene
from ..mathematics import quaternion
from ..mathematics.arrays import TINY, Array, Index, numbers
from ..mathematics.forms import Form
from ..mathematics.hysteresis import energies, lasting, updated
from ..mathematics.potentials import derivatives_of, deviation
from .elements import Element, element_by_name
from .parts import Parts
from .terms import ARGUMENTS, One, Side, Term, name_of

__all__ = [
    "AlongElement",
    "bent_by",
    "curvature_by_moment",
    "form_of",
    "law_data",
    "law_of",
    "laws_in",
    "least_stiffness",
    "solved",
]

PLACE = 10
"""Numbers of a point in space before those of strains: energy, nine of the axes over the unit of curvature."""


@final
@dataclass(frozen=True)
class AlongElement(Term):
    """The deviation of a law from its stiffness at rest, along an element.

    Data of each point: weight times length times the unit of energy; one over length and the unit of curvature, times
    the axes b1, b2, b3 in the undeformed scene (in space), or the sign of the axis about which it bends (in the plane);
    strains over the unit of curvature and the scaled ones; the numbers of the form.

    Attributes
    ----------
    nodes : int
        Nodes of the element.
    gauss : bool
        Whether the element integrates at Gauss points.
    axis : int
        In the plane the axis of the section that is along z: 2 or 3; in space 0.
    form : Form
    """

    along_element: ClassVar[bool] = True
    strains_member: ClassVar[bool] = True

    nodes: int
    gauss: bool
    axis: int
    form: Form

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """The rotations of the element, and the places with the strains of its points; data of its points."""
        return self.nodes, self.nodes if self.form.strains else 0, 0, self.nodes * self.width, 0

    @property
    def width(self) -> int:
        """Numbers of one point."""
        return self._place + len(self.strained) + self.form.size

    @property
    def _place(self) -> int:
        return PLACE if self.space else 2

    @property
    def strained(self) -> tuple[int, ...]:
        """Numbers of the strains, those along b1, b2, b3, on which it depends; in the plane without that across it."""
        inside = (0, 1, 2) if self.space else (0, 4 - self.axis)
        return inside[: self.form.strains]

    def energy(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """Sum over the points."""
        return sum((self._at(*point) for point in self._points(q, u, data)), ca.SX(0))

    def _points(self, q: list[Side], u: list[Side], data: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
        """Change of the curvature times length, scaled strains and data of each point."""
        points, bent = ca.horzsplit(ca.reshape(data, self.width, self.nodes)), self._element.changes(q)
        strains = [ca.vertcat(*side) for side in u] or [ca.SX(0, 1)] * self.nodes
        return list(zip(bent, strains, points, strict=True))

    def bending(self, bent: ca.SX, strain: ca.SX, point: ca.SX) -> ca.SX:
        """Change of twist and curvatures (3,) over the unit of curvature, from that times length in the fixed axes;
        then the strains over that unit.
        """
        found = ca.SX.zeros(self.form.arguments)
        if self.space:
            found[:3] = ca.mtimes(ca.reshape(point[1:PLACE], 3, 3).T, bent)
        else:
            found[self.axis - 1] = point[1] * bent
        for i, component in enumerate(self.strained):
            found[3 + component] = point[self._place + i] * strain[i]
        return found

    def stored(self, q: list[Side], u: list[Side], data: ca.SX, load: ca.SX) -> ca.SX:
        """What is stored: with memory the energy without what a step dissipates."""
        if not self.form.remembers:
            return self.energy(q, u, data, load)
        return sum((self._stored_at(*point) for point in self._points(q, u, data)), ca.SX(0))

    @property
    def memory(self) -> int:
        """Those of the form."""
        return self.form.memory

    @property
    def memory_columns(self) -> Index:
        """The last of each point."""
        return np.arange(self.nodes * self.width).reshape(self.nodes, -1)[:, self.width - self.memory :].ravel()

    def remembered(self) -> ca.Function:
        """As :meth:`.Term.remembered`."""
        sizes = {"q": (self.components, self.nodes), "u": (self.axes, self.sizes[1]), "data": (self.sizes[3], 1)}
        symbols = [ca.SX.sym(name, *size) for name, size in (sizes | {"load": (0, 1), "lam": (0, 1)}).items()]
        q, u = ([ca.vertsplit(side) for side in ca.horzsplit(part)] if part.shape[1] else [] for part in symbols[:2])
        variables, spent, turned = [], ca.SX(0), []
        points = zip(self._points(q, u, symbols[2]), self._element.weights, strict=True)
        for (bent, strain, point), share in points:
            x, own = self.bending(bent, strain, point), point[self.width - self.form.size :]
            variables.append(updated(self.form, x, own))
            spent += point[0] * energies(self.form, x, own)[1]
            # The axes have the length of one over that of the element and the unit of curvature.
            turned.append(share / ca.norm_2(point[1:4] if self.space else point[1]) * lasting(self.form, x, own)[:3])
        results = [ca.densify(part) for part in (ca.vertcat(*variables), spent, ca.vertcat(*turned))]
        names = ["z", "spent", "turned"]
        return ca.Function(f"remembered_{name_of(self)}", symbols, results, [*ARGUMENTS], names, {"cse": True})

    def _stored_at(self, bent: ca.SX, strain: ca.SX, point: ca.SX) -> ca.SX:
        own = point[self.width - self.form.size :]
        return point[0] * energies(self.form, self.bending(bent, strain, point), own)[0]

    def _at(self, bent: ca.SX, strain: ca.SX, point: ca.SX) -> ca.SX:
        own = point[self.width - self.form.size :]
        return point[0] * deviation(self.form, self.bending(bent, strain, point), own)

    # -- derivatives: in space those of one point, mapped over the points, as of the element -------------

    def rotation_gradient(self) -> ca.Function:
        """As :meth:`.Term.rotation_gradient`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_gradient()
        symbols, *point = self._large_symbols(5)
        energy, by_sides, hessian = self._element.summed(self._point("both"), *point)
        gradient, stiffness = self._element.by_rotation_vectors(point[0], by_sides, hessian)
        nothing = ca.MX(0, 1), ca.MX(0, gradient.shape[0])
        stored = energy
        if self.form.remembers:
            sizes = {"here": 4, "slope": 4, "strain": point[1].shape[0], "data": self.width}
            given = [ca.SX.sym(name, size) for name, size in sizes.items()]
            at_point = self._stored_at(self._element.curvature(*given[:2]), *given[2:])
            function = ca.Function(f"stored_{name_of(self)}", given, [at_point], {"cse": True})
            stored = ca.sum2(function.map(self.nodes)(*self._element.at(point[0]), *point[1:]))
        results = [energy, stored, nothing[0], gradient, stiffness, nothing[1]]
        names = ["energy", "stored", "rows", "gradient", "stiffness", "rotation_jacobian"]
        return ca.Function(f"rotation_gradient_{name_of(self)}", symbols, results, [*ARGUMENTS], names)

    def rotation_forces(self) -> ca.Function:
        """As :meth:`.Term.rotation_forces`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().rotation_forces()
        symbols, *point = self._large_symbols(5)
        by_sides = self._element.summed(self._point("gradient"), *point)[1]
        gradient = self._element.by_rotation_vectors(point[0], by_sides, None)[0]
        results = [ca.MX(0, 1), gradient]
        return ca.Function(f"forces_{name_of(self)}", symbols, results, [*ARGUMENTS], ["rows", "gradient"])

    def slopes(self) -> ca.Function:
        """As :meth:`.Term.slopes`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().slopes()
        symbols, *point = self._large_symbols(4)
        by_sides = self._element.summed(self._point("gradient"), *point)[1]
        results = [ca.densify(by_sides), ca.MX(0, by_sides.shape[0])]
        return ca.Function(f"slopes_{name_of(self)}", symbols, results, [*ARGUMENTS[:4]], ["gradient", "jacobian"])

    def curvatures(self) -> ca.Function:
        """As :meth:`.Term.curvatures`; in space assembled from the derivatives of single points."""
        if not self.space:
            return super().curvatures()
        symbols, *point = self._large_symbols(5)
        weight = ca.MX.sym("weight")
        hessian = weight * self._element.summed(self._point("hessian"), *point)[2]
        given = [*ARGUMENTS, "weight"]
        return ca.Function(f"curvatures_{name_of(self)}", [*symbols, weight], [hessian], given, ["hessian"])

    def _large_symbols(self, count: int) -> tuple[list[ca.MX], ca.MX, ca.MX, ca.MX]:
        """The first arguments of functions put together of others, rotations, and strains and data of the points."""
        u = (3, self.sizes[1])
        sizes = {"q": (4, self.nodes), "u": u, "data": (self.sizes[3], 1), "load": (0, 1), "lam": (0, 1)}
        symbols = [ca.MX.sym(name, *size) for name, size in sizes.items()]
        strains = symbols[1] if self.sizes[1] else ca.MX(0, self.nodes)
        return symbols[:count], symbols[0], strains, ca.reshape(symbols[2], self.width, self.nodes)

    def _point(self, wanted: str) -> ca.Function:
        return self._element.point_energy(f"point_{name_of(self)}_{wanted}", self._at, self.width, wanted)

    @property
    def _element(self) -> Element:
        return element_by_name(f"SFET{self.nodes}", self.space, self.gauss, self.form.strains > 0)


def law_of(scene: Scene, member: str) -> SectionLaw | None:
    """The law of a member's section; None for linear ones, and members that have none."""
    name = scene.members[member].section
    return None if name is None else scene.sections[name].law


def form_of(scene: Scene, member: str) -> Form | None:
    """The form of the law of a member's section; None as of :func:`law_of`."""
    law = law_of(scene, member)
    return None if law is None else law.form_in(scene.sections[str(scene.members[member].section)])


def laws_in(parts: Parts) -> Iterator[One]:
    """The terms of all elements whose sections have a law."""
    scene, element, scales = parts.scene, parts.element, parts.scales
    for name, first in parts.beams.first.items():
        law = law_of(scene, name)
        if law is None:
            continue
        section, line, cuts = (
            scene.sections[str(scene.members[name].section)],
            scene.center_lines[name],
            parts.mesh.cuts,
        )
        x = cuts[name][:-1, None] + np.diff(cuts[name])[:, None] * element.points
        count, axis = len(cuts[name]) - 1, 0 if element.space else line.bending_axis
        form = law.form_in(section)
        kind = AlongElement(element.space, element.order + 1, element.gauss, axis, form)
        values = law.values(section, x.ravel())
        if form.memory and name in (parts.mesh.memory or {}):
            variables = (parts.mesh.memory or {})[name].variables.reshape(len(values), -1)
            values = numbers(np.concatenate([values[:, : -form.memory], variables], axis=1))
        weight = parts.beams.weight[first : first + count] * scales.length
        length = np.repeat(weight.sum(axis=1), x.shape[1])
        frames = quaternion.matrix(line.quaternions(x.ravel()))
        # Columns of the axes one after the other, as CasADi reads them.
        axes = frames.transpose(0, 2, 1).reshape(-1, 9) if element.space else frames[:, 2, axis - 1 : axis]
        soft = section.compliance(x.ravel())[:, list(kind.strained)] * (scales.force * scales.length)
        data = np.concatenate(
            [
                (weight.ravel() * values[:, 0] / scales.moment)[:, None],
                axes / (length * values[:, 1])[:, None],
                np.sqrt(soft / weight.ravel()[:, None]) / values[:, 1:2],
                values[:, 2:],
            ],
            axis=1,
        ).reshape(count, -1)
        for e in range(first, first + count):
            turns = tuple(parts.rotations.turns[e].tolist())
            places = tuple(parts.segments.strains[e].tolist()) if form.strains else ()
            yield One(kind, name, "", numbers(data[e - first]), turns, places, element=e)


# -- what a law says at given places ---------------------------------------------------------------------


def _stiffness_and_form(scene: Scene, member: str, x: Array) -> tuple[Array, Array, ca.Function]:
    """Matrices at rest (n, k, k) of curvatures and strains, numbers (n, 2 + size), and the derivatives of the form."""
    section, form = scene.sections[str(scene.members[member].section)], form_of(scene, member)
    assert section.law is not None
    assert form is not None
    rest = section.stiffness_matrix(x)
    if form.strains:
        rest = np.pad(rest, ((0, 0), (0, form.strains), (0, form.strains)))
        each = np.arange(3, form.arguments)
        rest[:, each, each] = 1.0 / section.compliance(x)[:, : form.strains]
    return rest, section.law.values(section, x), derivatives_of(form)


def _moment_and_slope(change: Array, rest: Array, values: Array, derivatives: ca.Function) -> tuple[Array, Array]:
    """Moments (n, 3), N m, and their derivatives (n, 3, 3), N m2, by changes of the curvatures (n, 3), 1/m.

    With strains behind them also forces, N.
    """
    unit, bent = values[:, 0], values[:, 1]
    _, gradient, hessian = derivatives.map(len(change))((change / bent[:, None]).T, values[:, 2:].T)
    moment = np.einsum("nij,nj->ni", rest, change) + gradient.full().T * (unit / bent)[:, None]
    slope = rest + hessian.full().T.reshape(rest.shape) * (unit / bent**2)[:, None, None]
    return moment, slope


def curvature_by_moment(scene: Scene, member: str, x: Array, moment: Array, near: Array, axes: list[int]) -> Array:
    """Changes of the curvatures (n, 3), 1/m, at which a law gives moments (n, 3), N m, at fractions x (n,).

    Newton's method from the changes ``near`` (n, 3).  ``axes`` are the numbers, from 0, of those about which the scene
    bends.  Where it does not lead to the moments, ``near`` itself is the answer.  Of a law that depends on strains,
    too, these follow the curvatures, and section forces, N, the moments.
    """
    return solved(*_stiffness_and_form(scene, member, x), moment, near, axes)


def solved(rest: Array, values: Array, derivatives: ca.Function, moment: Array, near: Array, axes: list[int]) -> Array:
    """As :func:`curvature_by_moment`, with matrices at rest (n, 3, 3), the numbers (n, 2 + size) and the derivatives
    of a form; also strains at which a law gives section forces.
    """
    change = near.copy()
    # Forces count as moments that would store as much.
    unit = np.sqrt(np.einsum("nii->ni", rest).max(axis=0, initial=0.0))
    unit = np.concatenate([np.full(3, unit[:3].max()), unit[3:]]) / max(unit[:3].max(), TINY)
    size = np.abs(moment / unit).max(initial=0.0)
    size += np.abs(np.einsum("nij,nj->ni", rest, near) / unit).max(initial=0.0)
    for _ in range(NEWTON_STEPS):
        now, slope = _moment_and_slope(change, rest, values, derivatives)
        miss = (moment - now)[:, axes]
        if not np.abs(miss / unit[axes]).max(initial=0.0) > tolerances.DECIMAL * size:
            break
        # Where a law has no stiffness the step is long, and leads nowhere.
        firm = slope[:, axes][:, :, axes] + tolerances.WRITTEN * rest[:, axes][:, :, axes]
        change[:, axes] += np.linalg.solve(firm, miss[..., None])[..., 0]
    now = _moment_and_slope(change, rest, values, derivatives)[0]
    met = np.abs((moment - now)[:, axes] / unit[axes]).max(axis=1, initial=0.0) <= tolerances.WRITTEN * size
    return np.where(met[:, None], change, near)


NEWTON_STEPS = 30
"""From the curvature of the elements it takes two or three."""


@functools.cache
def bent_by(form: Form, axes: tuple[int, ...]) -> ca.Function:
    """``(moment, near, data) ->`` changes of the curvatures (3,), 1/m, at which a law gives the moments (3,), N m.

    As :func:`curvature_by_moment`, at one place, by a few steps of Newton's method; ``data`` are those of
    :func:`law_data`.
    """
    chosen, derivatives = list(axes), derivatives_of(form)
    moment, change, data = ca.SX.sym("moment", 3), ca.SX.sym("change", 3), ca.SX.sym("data", 11 + form.size)
    rest, unit, bent = ca.reshape(data[:9], 3, 3), data[9], data[10]
    _, gradient, hessian = derivatives(change / bent, data[11:])
    now = ca.mtimes(rest, change) + gradient * (unit / bent)
    slope = rest + ca.reshape(hessian, 3, 3) * (unit / bent**2)
    miss = (moment - now)[chosen]
    there = ca.SX(change)
    there[chosen] += ca.solve(slope[chosen, chosen], miss)
    step = ca.Function("step", [moment, change, data], [there, ca.norm_inf(miss)], {"cse": True})
    given = [ca.MX.sym("moment", 3), ca.MX.sym("near", 3), ca.MX.sym("data", 11 + form.size)]
    found = given[1]
    for _ in range(SYMBOLIC_STEPS):
        found = step(given[0], found, given[2])[0]
    size = ca.norm_inf(given[0]) + ca.norm_inf(ca.mtimes(ca.reshape(given[2][:9], 3, 3), given[1]))
    met = step(given[0], found, given[2])[1] <= tolerances.WRITTEN * size
    return ca.Function(f"bent_by_{form}_{'_'.join(map(str, axes))}", given, [ca.if_else(met, found, given[1])])


SYMBOLIC_STEPS = 5
"""Steps of Newton's method where they are expressions."""


def law_data(scene: Scene, member: str, x: Array) -> Array:
    """Of the law of a member at fractions x (n,): stiffness at rest, units and numbers, (n, 11 + size)."""
    section = scene.sections[str(scene.members[member].section)]
    assert section.law is not None
    values = section.law.values(section, x)
    return numbers(np.concatenate([section.stiffness_matrix(x).reshape(len(x), 9), values], axis=1))


def least_stiffness(scene: Scene, member: str, x: Array, change: Array, axes: list[int]) -> Array:
    """Smallest eigenvalue (n,) of the second derivatives of the potential over those at rest.

    ``change`` (n, 3) are the changes of the curvatures, 1/m, at fractions x (n,), with strains behind them where the
    law depends on these.
    """
    rest, values, derivatives = _stiffness_and_form(scene, member, x)
    unit = np.sqrt(np.einsum("nii->ni", rest)[:, axes])
    slope = _moment_and_slope(change, rest, values, derivatives)[1][:, axes][:, :, axes]
    return np.asarray(np.linalg.eigvalsh(slope / unit[:, :, None] / unit[:, None, :])[:, 0])
