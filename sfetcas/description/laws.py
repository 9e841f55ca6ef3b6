"""Laws of sections: moments from the change of curvature by a potential per length, instead of a constant stiffness.

A law says its *form* (:mod:`~sfetcas.mathematics.forms`) and the numbers of it, which are a unit of energy per
length (J/m), a unit of curvature (1/m) and what the form needs.  The second derivative of the potential at rest is the
stiffness of the section.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, final

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array, numbers, values_of
from ..mathematics.forms import BOTH, Form, hermite_of, monotone_slopes
from ..mathematics.interpolation import gauss
from .records import Number, Numbers, Positive, Record, Sized, listed, number, say

__all__ = [
    "Bilinear",
    "ElasticPlastic",
    "Law",
    "MomentTable",
    "Plateau",
    "Potential",
    "RambergOsgood",
    "Ribbon",
    "Sadowsky",
    "SectionLaw",
    "StressStrain",
    "Superelastic",
    "check_parameters",
    "parameters_given",
    "signed",
]

About = Literal["b2", "b3", "both"]


class SectionLaw(Record):
    """Base class of the laws of sections."""

    type: str

    gives: ClassVar[tuple[str, ...]] = ()
    """Stiffnesses that it says itself, so that the section must not."""

    shaped: ClassVar[str] = ""
    """Whether the section needs a shape: ``any``, the name of one, or empty where it may have none."""

    convex: ClassVar[bool] = True
    """Whether its potential is convex at every curvature."""

    remembers: ClassVar[bool] = False
    """Whether its moments depend on the curvatures of the steps before."""

    hint: ClassVar[str] = ""
    """What it is known for where no equilibrium is found; empty for most."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Stiffnesses of the section with which it begins."""
        return ()

    @property
    @abc.abstractmethod
    def form(self) -> Form:
        """The form of its potential, of a section that does not stretch where that makes a difference."""

    def form_in(self, section: Any) -> Form:
        """The form of its potential in a section, which may depend on the strain along where that stretches."""
        return self.form

    @abc.abstractmethod
    def values(self, section: Any, x: Array) -> Array:
        """Unit of energy per length (J/m), unit of curvature (1/m), numbers of the form at fractions x, (n, 2 + size).

        ``section`` is the cross-section with this law.
        """

    def stiffness(self, section: Any, values: Array, x: Array) -> Array:
        """Stiffness matrices (n, 3, 3) at rest, N m2, with those (n, 3, 3) of the section itself given."""
        return values

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest change of curvature for which it is given, 1/m, where that is known without a section."""
        return -np.inf, np.inf

    def reach(self, section: Any, x: Array) -> Array:
        """Least and largest change of curvature for which it is given at fractions x, (n, 2), 1/m."""
        return np.tile(self.span, (len(x), 1))

    @property
    def fibre_span(self) -> tuple[float, float]:
        """Least and largest strain of a fibre for which it is given, where it is a law of fibres."""
        return -np.inf, np.inf

    def yields(self, section: Any, own: Array, x: Array) -> Array:
        """Compliances (n, 3) along b1, b2, b3 at rest, 1/N, with those (n, 3) of the section itself given."""
        return own

    def check(self, section: Any) -> None:
        """Refuse a section that it does not fit; a law that fits every one refuses none.

        Raises
        ------
        SceneError
            Names the key.
        """

    def slack(self, section: Any, x: Array, change: Array) -> Array:
        """Above 0 where changes (n, 3) of the curvatures, 1/m, at fractions x leave it without stiffness, (n,)."""
        return np.full(len(x), -1.0)

    def stays_in_plane(self, axis: int) -> bool:
        """Whether bending about b2 or b3 alone, given as 2 or 3, gives no moment about other axes."""
        return True


class _OneAxis(SectionLaw):
    """A law of bending about one axis, or about both by the magnitude of the curvature."""

    about: About = "b3"

    @property
    def axis(self) -> int:
        """2, 3, or :data:`~sfetcas.mathematics.forms.BOTH`."""
        return {"b2": 2, "b3": 3, "both": BOTH}[self.about]

    @property
    def needs(self) -> tuple[str, ...]:
        """The bending stiffnesses about its axes, but for those that it gives."""
        own = ("EI2", "EI3") if self.axis == BOTH else (f"EI{self.axis}",)
        return tuple(name for name in own if name not in self.gives)

    def _bending(self, section: Any, x: Array) -> Array:
        """Bending stiffness about the axis at fractions x, (n,), N m2."""
        return numbers(section.own_stiffness(x)[:, 2 if self.axis == BOTH else self.axis - 1])

    def _on_fibres(self, section: Any, x: Array, unit: Array, curve: Any) -> Array:
        """Values of the form ``curve`` at fractions x (n,), with the unit of strain (n,), kinks and changes of slope.

        These are over the unit of strain, and over E.
        """
        reach = section.fibres(x)[:, 2 if self.axis == BOTH else self.axis - 1]
        bent, row = unit / reach, numbers(curve)
        inner = section.hollow(x)
        columns = np.stack([self._bending(section, x) * bent**2, bent, reach, inner], axis=1)
        return numbers(np.concatenate([columns, np.broadcast_to(row, (len(x), row.shape[0]))], axis=1))

    def check(self, section: Any) -> None:
        """Refuse other stiffnesses about b2 and b3 where it is about both.

        Raises
        ------
        SceneError
            They differ.
        """
        if self.axis != BOTH:
            return
        x = np.linspace(0.0, 1.0, 9)
        both = values_of(section.own_stiffness(x))[:, 1:]
        if not np.allclose(both[:, 0], both[:, 1], rtol=tolerances.WRITTEN):
            found = f"found about = 'both' with EI2 = {both[0, 0]:g} and EI3 = {both[0, 1]:g}"
            raise SceneError(f"{found}, accepted: the same stiffness about both axes", ("about",))


@final
class Bilinear(_OneAxis):
    """Bending with one stiffness up to a moment, and a share of it beyond.

    It is a potential: unloading goes back the same way.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2``, ``b3``, or ``both`` for a round section, by the magnitude of the curvature.
    moment : N m
        Moment at which the stiffness changes, of either sign.
    ratio : 1
        Stiffness beyond over that before, above zero.
    """

    type: Literal["bilinear"] = "bilinear"
    moment: Sized
    ratio: Positive
    about: About = "b3"

    @model_validator(mode="after")
    def _softens(self) -> Bilinear:
        if self.about == "both" and self.ratio > 1.0:
            raise SceneError(f"found {self.ratio:g} about both axes, accepted: up to 1", ("ratio",))
        return self

    @property
    def form(self) -> Form:
        """One number, the ratio."""
        return Form("bilinear", self.axis)

    def values(self, section: Any, x: Array) -> Array:
        """In units of the curvature at the moment."""
        stiffness = self._bending(section, x)
        ones = np.ones(len(x))
        return np.stack([self.moment**2 / stiffness, self.moment / stiffness, self.ratio * ones], axis=1)


@final
class RambergOsgood(_OneAxis):
    """Bending as Ramberg and Osgood: the curvature is M/EI + alpha (M0/EI) (M/M0)^n.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2``, ``b3``, or ``both`` for a round section, by the magnitude of the curvature.
    moment : N m
        The moment M0.
    alpha : 1
        Share of M0/EI by which the curvature at M0 is larger than M0/EI.
    exponent : 1
        The exponent n, above 1.
    """

    type: Literal["ramberg-osgood"] = "ramberg-osgood"
    moment: Sized
    alpha: Positive
    exponent: Number
    about: About = "b3"

    @model_validator(mode="after")
    def _grows(self) -> RambergOsgood:
        if not 1.0 < self.exponent <= STEEPEST:
            raise SceneError(f"found {self.exponent:g}, accepted: above 1 and up to {STEEPEST:g}", ("exponent",))
        return self

    @property
    def form(self) -> Form:
        """Two numbers, alpha and the exponent."""
        return Form("ramberg_osgood", self.axis)

    def values(self, section: Any, x: Array) -> Array:
        """In units of the curvature M0/EI."""
        stiffness, ones = self._bending(section, x), np.ones(len(x))
        columns = [self.moment**2 / stiffness, self.moment / stiffness, self.alpha * ones, self.exponent * ones]
        return np.stack(columns, axis=1)


STEEPEST = 100.0
"""Largest exponent: beyond it the power overflows, and a bilinear law says the same."""


@final
class Plateau(_OneAxis):
    """Bending of a rectangle of a superelastic material: linear up to a stress, which then stays the same.

    It is the loading curve of a material whose stress is E times the strain up to the plateau; unloading goes back the
    same way.  For other shapes, and for plateaus that end, give the curve of the material (``stress-strain``).  In a
    section that stretches axial force and moment act upon the same fibres.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2`` or ``b3``.
    stress : N/m²
        Stress on the plateau, the same in tension and compression.
    """

    shaped: ClassVar[str] = "rectangle"

    type: Literal["plateau"] = "plateau"
    stress: Sized
    about: Literal["b2", "b3"] = "b3"

    @property
    def form(self) -> Form:
        """No numbers."""
        return Form("plateau", self.axis)

    def form_in(self, section: Any) -> Form:
        """Where the section stretches a curve with a kink at either end of what is elastic."""
        return Form("curve", self.axis, 2, strains=1) if section.stretch else self.form

    def values(self, section: Any, x: Array) -> Array:
        """In units of the curvature at which the outer fibres reach the plateau."""
        if section.stretch:
            yields = self.stress / section.fibres(x)[:, 0]
            return self._on_fibres(section, x, yields, [-1.0, 1.0, -1.0, -1.0])
        young, *reach = section.fibres(x).T
        bent = self.stress / (young * reach[self.axis - 2])
        return np.stack([self._bending(section, x) * bent**2, bent], axis=1)


def signed(curvature: tuple[float, ...], values: tuple[float, ...], names: tuple[str, str]) -> bool:
    """Check the knots of a curve through zero: rising, with zero among them; whether they begin there.

    Raises
    ------
    SceneError
        Names the key.
    """
    if len(curvature) != len(values):
        found = f"found {len(values)} entries beside {len(curvature)} of {names[0]!r}"
        raise SceneError(f"{found}, accepted: one for each", (names[1],))
    odd = curvature[0] == 0.0
    if len(curvature) < 2 or 0.0 not in curvature or (not odd and len(curvature) < 3):
        found = f"found {say(curvature)}"
        raise SceneError(f"{found}, accepted: two or more numbers from 0 on, or of both signs with 0", (names[0],))
    if values[curvature.index(0.0)] != 0.0:
        raise SceneError(f"found {values[curvature.index(0.0)]:g} at 0, accepted: 0 there", (names[1],))
    for name, given in zip(names, (curvature, values), strict=True):
        for before, after in pairwise(given):
            if after <= before:
                raise SceneError(f"found {after:g} after {before:g}, accepted: rising numbers", (name,))
    slopes = [rise / run for rise, run in zip(*(map(_apart, pairwise(k)) for k in (values, curvature)), strict=True)]
    if not max(slopes) <= STEEPEST * min(slopes):
        found = f"found slopes from {min(slopes):g} to {max(slopes):g}"
        raise SceneError(f"{found}, accepted: the largest up to {STEEPEST:g} times the smallest", (names[0],))
    return odd


def _apart(pair: tuple[float, float]) -> float:
    return pair[1] - pair[0]


STEEPEST = 1e12
"""Largest slope of a table over the smallest: with more a matrix has nothing of the smaller one."""


@final
class MomentTable(_OneAxis):
    """Bending moments at given changes of the curvature, with smooth monotone cubics between.

    The section says the other stiffnesses; that about the axis of the table is its slope at zero.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2``, ``b3``, or ``both`` for a round section, by the magnitude of the curvature.
    curvature : (m,), 1/m
        Changes of the curvature, rising: from 0 on, where moments of the other sign are opposite, or of both signs
        with 0 among them.
    moment : (m,), N m
        The moments there, rising, 0 at 0.
    """

    type: Literal["table"] = "table"
    curvature: Numbers
    moment: Numbers
    about: About = "b3"

    @model_validator(mode="after")
    def _monotone(self) -> MomentTable:
        odd = signed(self.curvature, self.moment, ("curvature", "moment"))
        if self.about == "both" and not odd:
            raise SceneError("found curvatures of both signs about both axes, accepted: from 0 on", ("curvature",))
        return self

    @property
    def gives(self) -> tuple[str, ...]:  # type: ignore[override]
        """The bending stiffness about its axis."""
        return ("EI2", "EI3") if self.about == "both" else (f"EI{self.axis}",)

    @property
    def form(self) -> Form:
        """Knots, moments and slopes."""
        return Form("table", self.axis, len(self.curvature), values_of(self.curvature[0]) == 0.0)

    def _curve(self) -> tuple[Array, Array, Array]:
        """Knots (1/m), moments (N m) and slopes (N m2)."""
        x, y = numbers(list(self.curvature)), numbers(list(self.moment))
        if self.form.odd:
            # The curve of the other sign makes the slope at zero that of the first chord.
            slopes = monotone_slopes(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]))
            return x, y, slopes[len(x) - 1 :]
        return x, y, monotone_slopes(x, y)

    def values(self, section: Any, x: Array) -> Array:
        """In units of the largest curvature and moment."""
        knots, moments, slopes = self._curve()
        bent, most = (np.max(np.abs(part)) for part in (knots, moments))
        table = hermite_of(knots / bent, moments / most, slopes * (bent / most))
        row = np.concatenate([numbers([bent * most, bent]), table])
        return numbers(np.broadcast_to(row, (len(x), row.shape[0])))

    def stiffness(self, section: Any, values: Array, x: Array) -> Array:
        """The slope at zero about its axis."""
        knots, _, slopes = self._curve()
        slope = slopes[int(np.flatnonzero(values_of(knots) == 0.0)[0])]
        for axis in (2, 3) if self.axis == BOTH else (self.axis,):
            where = np.zeros((3, 3))
            where[axis - 1, axis - 1] = 1.0
            values = values + where * slope
        return values

    @property
    def span(self) -> tuple[float, float]:
        """From the first to the last knot."""
        knots = values_of(numbers(list(self.curvature)))
        return (-knots[-1] if self.form.odd else knots[0]), knots[-1]


@final
class StressStrain(_OneAxis):
    """Bending of a shape whose material has a given curve of stress over strain, which may differ by its sign.

    The stress is integrated over the section once, with the neutral axis where the axial force is zero.  In a section
    that stretches the axial force is that of the fibres, too: their strain is that along the member and that of bending
    together, so that axial force and moment depend on both.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2`` or ``b3`` of a rectangle, which needs it; ``both`` of a circle or a tube.  Default:
        ``both``.
    strain : (m,)
        Strains, rising: from 0 on, where stresses of the other sign are opposite, or of both signs with 0 among them.
    stress : (m,), N/m²
        The stresses there, linear between, rising, 0 at 0.  The slopes beside 0 are ``E``.
    """

    shaped: ClassVar[str] = "any"

    type: Literal["stress-strain"] = "stress-strain"
    strain: Numbers
    stress: Numbers
    about: About | None = None  # type: ignore[assignment]

    @model_validator(mode="after")
    def _curve(self) -> StressStrain:
        signed(self.strain, self.stress, ("strain", "stress"))
        if self.strain[-1] == 0.0:
            found = f"found {say(self.strain)}"
            raise SceneError(f"{found}, accepted: numbers from 0 on, or of both signs with 0", ("strain",))
        return self

    @property
    def axis(self) -> int:
        """2, 3, or :data:`~sfetcas.mathematics.forms.BOTH`, which is the default for what is round."""
        return BOTH if self.about is None or self.about == "both" else int(self.about[1])

    @property
    def form(self) -> Form:
        """A table of the integrated moments."""
        return Form("table", self.axis, KNOTS)

    def form_in(self, section: Any) -> Form:
        """Where the section stretches the kinks of the curve itself."""
        if not section.stretch:
            return self.form
        return Form("curve", self.axis, len(values_of(self._kinks()[0])), strains=1)

    def _kinks(self) -> tuple[Array, Array]:
        """Strains but for 0 at which the slope changes, and by how much outwards, over that beside 0; (m,) each."""
        strain, stress = self.both
        zero = int(np.flatnonzero(values_of(strain) == 0.0)[0])
        slopes = (stress[1:] - stress[:-1]) / (strain[1:] - strain[:-1])
        # The last slopes go on beyond the ends.
        below = (slopes[: zero - 1] - slopes[1:zero]) / slopes[zero - 1]
        above = (slopes[zero + 1 :] - slopes[zero:-1]) / slopes[zero]
        return numbers(np.concatenate([strain[1:zero], strain[zero + 1 : -1]])), numbers(np.concatenate([below, above]))

    def check(self, section: Any) -> None:
        """Refuse another slope at zero than E, and an axis that the shape does not have.

        Raises
        ------
        SceneError
            Names the key.
        """
        young, (strain, stress) = values_of(section.fibres(np.array([0.0]))[:, 0]).item(), map(values_of, self.both)
        zero = int(np.flatnonzero(strain == 0.0)[0])
        for i in (zero - 1, zero):
            slope = (stress[i + 1] - stress[i]) / (strain[i + 1] - strain[i])
            if abs(slope - young) > SLOPE * young:
                message = f"found a slope of {slope:g} at zero strain, accepted: E of the section, {young:g}"
                raise SceneError(message, ("stress",))
        if section.shape == "rectangle" and self.about in (None, "both"):
            raise SceneError("found a rectangle, accepted: with about = 'b2' or 'b3'", ("about",))
        if section.shape != "rectangle" and self.about not in (None, "both"):
            raise SceneError(f"found {self.about!r} with a {section.shape}, accepted: 'both'", ("about",))

    @property
    def both(self) -> tuple[Array, Array]:
        """Strains and stresses of both signs."""
        strain, stress = numbers(list(self.strain)), numbers(list(self.stress))
        if values_of(strain[0]) == 0.0:
            return np.concatenate([-strain[:0:-1], strain]), np.concatenate([-stress[:0:-1], stress])
        return strain, stress

    def values(self, section: Any, x: Array) -> Array:
        """In units of the curvature of the end of the table, for a section with a reach of 1.

        Where the section stretches in units of the largest strain of the curve.
        """
        if section.stretch:
            kinks, changes = self._kinks()
            largest = float(np.abs(values_of(self.both[0])).max())
            curve = numbers(np.concatenate([kinks / largest, changes]))
            return self._on_fibres(section, x, numbers(np.full(len(x), largest)), curve)
        if hasattr(numbers([*self.strain, *self.stress]), "expression"):
            message = "found a number of a curve of stress over strain, accepted: one of a section that stretches"
            raise SceneError(message, ("arguments",))
        reach = section.fibres(x)[:, 1:].T
        reach = reach[1 if self.axis == BOTH else self.axis - 2]
        knots, moments, slopes = self._table(section)
        bending = self._bending(section, x)
        bent, row = knots[-1] / reach, hermite_of(knots / knots[-1], moments / knots[-1], slopes)
        units = np.stack([bending * bent**2, bent], axis=1)
        return numbers(np.concatenate([units, np.broadcast_to(row, (len(x), len(row)))], axis=1))

    @property
    def fibre_span(self) -> tuple[float, float]:
        """From the first to the last strain of the curve."""
        strain = values_of(self.both[0])
        return float(strain[0]), float(strain[-1])

    def reach(self, section: Any, x: Array) -> Array:
        """Where a fibre reaches the end of the curve."""
        _, *reach = values_of(section.fibres(x)).T
        most = self._table(section)[0][-1] / reach[1 if self.axis == BOTH else self.axis - 2]
        return np.stack([-most, most], axis=1)

    def _table(self, section: Any) -> tuple[Array, Array, Array]:
        """Knots, moments and slopes of a section with reach 1, E = 1 and second moment 1."""
        ratio = 0.0
        if section.shape == "tube":
            shares = values_of(section.hollow(np.array([0.0, 0.5, 1.0])))
            ratio = float(shares[0])
            if not np.allclose(shares, ratio, rtol=tolerances.WRITTEN):
                message = "found a tube whose inner radius is not everywhere the same share of the outer one"
                raise SceneError(f"{message}, accepted: one share with the law 'stress-strain'", ("law",))
        strain, stress = map(values_of, self.both)
        return _integrated(tuple(strain), tuple(stress), section.shape == "rectangle", ratio)


SLOPE = 1e-3
"""Relative difference of the slope of a curve at zero from E that is taken as rounding of what was written."""

KNOTS = 64
"""Knots of the table of an integrated curve: the cubics between leave a relative error of 1e-7 of the moment."""


@functools.lru_cache(maxsize=64)
def _integrated(
    strain: tuple[float, ...], stress: tuple[float, ...], rectangle: bool, ratio: float
) -> tuple[Array, Array, Array]:
    """Curvatures, moments and slopes (KNOTS,) of a section of reach 1, E = 1 and second moment 1.

    The stress of a fibre at the height ``y`` in [-1, 1] is that at the strain ``e + k y``, ``e`` such that the
    resultant vanishes.
    """
    return _integrate(np.array(strain), np.array(stress), rectangle, ratio)


def _integrate(strain: Array, stress: Array, rectangle: bool, ratio: float) -> tuple[Array, Array, Array]:
    from scipy.optimize import brentq

    zero = int(np.flatnonzero(strain == 0.0)[0])
    stress = stress / ((stress[zero + 1] - stress[zero]) / (strain[zero + 1] - strain[zero]))
    slopes = np.diff(stress) / np.diff(strain)
    points, weights = gauss(24)
    second = 2.0 / 3.0 if rectangle else np.pi / 8.0 * (1.0 - ratio**4)

    def summed(function: Callable[[Array], Array], kinks: Array, radius: float) -> Array:
        """Integral over the section within a radius, on pieces without kinks."""
        inside = np.clip(kinks / radius, -1.0, 1.0)
        edges = np.unique([-1.0, *inside, 1.0])
        if not rectangle:
            edges = np.arcsin(edges)
        at = (edges[:-1, None] + np.diff(edges)[:, None] * points).ravel()
        share = (np.diff(edges)[:, None] * weights).ravel()
        y, width = (at, 1.0) if rectangle else (np.sin(at), np.cos(at) ** 2 * radius)
        return np.asarray((function(y * radius) * width * share * radius).sum(axis=-1))

    def moments(e: float, k: float) -> Array:
        """Resultant and moment, then the first derivatives of both by e and of the moment by k."""

        def integrand(y: Array) -> Array:
            at = e + k * y
            piece = np.clip(np.searchsorted(strain, at) - 1, 0, len(slopes) - 1)
            here, steep = stress[piece] + slopes[piece] * (at - strain[piece]), slopes[piece]
            return np.stack([here, here * y, steep, steep * y, steep * y**2])

        kinks = (strain - e) / k
        found = summed(integrand, kinks, 1.0)
        return found if not ratio else found - summed(integrand, kinks, ratio)

    def neutral(k: float) -> float:
        if np.allclose(strain, -strain[::-1]) and np.allclose(stress, -stress[::-1]):
            return 0.0
        # Beyond its ends the curve goes on with its slopes there, so that there is a neutral axis.
        low, high = strain[0] - k, strain[-1] + k
        return float(brentq(lambda e: moments(e, k)[0], low, high, xtol=1e-15 * (high - low), rtol=8.9e-16))

    # The last curvature is that at which the first fibre is at an end of the curve.
    def room(k: float) -> float:
        e = neutral(k)
        return float(min(strain[-1] - (e + k), (e - k) - strain[0]))

    most = 0.5 * (strain[-1] - strain[0])
    last = most if room(most) >= -1e-12 * most else float(brentq(room, 1e-6 * most, most, xtol=1e-14 * most))
    first = min(strain[zero + 1], -strain[zero - 1])
    if first < 0.999 * last:
        knots = np.concatenate([[0.0], first * (last / first) ** np.linspace(0.0, 1.0, KNOTS - 1)])
    else:
        knots = np.linspace(0.0, last, KNOTS)
    found = [np.array([0.0, 1.0])]
    for k in knots[1:]:
        _, moment, axial, mixed, bending = moments(neutral(k), k)
        found.append(np.array([moment, bending - mixed**2 / axial]) / second)
    return knots, *np.array(found).T


@final
class Ribbon(SectionLaw):
    """A thin wide rectangle: bending and twist make it stretch, as Audoly and Neukirch; no more keys.

    For small curvatures it is a plate strip of stiffness E w h^3/12 and 4 G w h^3/12, for large ones it is the
    ribbon of Sadowsky.  Bending about the other axis stays linear.
    """

    shaped: ClassVar[str] = "rectangle"
    convex: ClassVar[bool] = False

    type: Literal["audoly-neukirch"] = "audoly-neukirch"

    @property
    def form(self) -> Form:
        """One number, Poisson's ratio; the soft axis is chosen with the section."""
        return Form("ribbon", 3)

    def values(self, section: Any, x: Array) -> Array:
        """In units of thickness over squared width."""
        young, half_width, half_height = section.fibres(x).T
        width, thick = 2.0 * half_width, 2.0 * half_height
        bent, poisson = thick / width**2, section.nu
        plate = young * thick**3 / (12.0 * (1.0 - poisson**2))
        return np.stack([plate * width * bent**2, bent, poisson * np.ones(len(x))], axis=1)

    def stiffness(self, section: Any, values: Array, x: Array) -> Array:
        """With the torsion of a plate strip."""
        young, half_width, half_height = section.fibres(x).T
        twist = young / (2.0 * (1.0 + section.nu)) * (2.0 * half_width) * (2.0 * half_height) ** 3 / 3.0
        where = np.zeros((3, 3))
        where[0, 0] = 1.0
        return values + (twist - values[:, 0, 0])[:, None, None] * where

    def check(self, section: Any) -> None:
        """Refuse what is no ribbon.

        Raises
        ------
        SceneError
            No Poisson's ratio, or a rectangle whose width is not at least five times its height.
        """
        if section.nu is None:
            raise SceneError("the key 'nu' is missing: a ribbon needs E and nu")
        _, width, height = values_of(section.fibres(np.linspace(0.0, 1.0, 9))).T
        if (width < THIN * height).any():
            found = f"found a width of {2.0 * width[0]:g} beside a height of {2.0 * height[0]:g}"
            raise SceneError(f"{found}, accepted: a height of at most a fifth of the width")


THIN = 5.0
"""Least width over height of a ribbon."""


@final
class Sadowsky(SectionLaw):
    """A ribbon so thin that it bends without any stretching: the energy of Sadowsky, made convex; no more keys.

    Per length it is half the plate stiffness times the width times (k^2 + t^2)^2 / k^2 where the twist t is below the
    curvature k, and times 4 t^2 beyond, where the ribbon has no stiffness against bending (Freddi and others 2016).  It
    has no length of its own; where it is straight it is smoothed over a thousandth of the curvature thickness over
    squared width.  Bending about the other axis stays linear.
    """

    shaped: ClassVar[str] = "rectangle"
    hint: ClassVar[str] = (
        "the law 'sadowsky' has no stiffness against bending where a ribbon twists more than it bends, accepted there: "
        "'audoly-neukirch'"
    )

    type: Literal["sadowsky"] = "sadowsky"

    @property
    def form(self) -> Form:
        """No numbers."""
        return Form("sadowsky", 3)

    def values(self, section: Any, x: Array) -> Array:
        """In units of the curvature over which it is smoothed."""
        plate, bent = _plate(section, x)
        return np.stack([plate * bent**2, bent], axis=1)

    def stiffness(self, section: Any, values: Array, x: Array) -> Array:
        """Of the smoothed potential: plate stiffness times width against bending, twice that against twist."""
        plate, where = _plate(section, x)[0], np.zeros((2, 3, 3))
        where[0, 0, 0], where[1, 2, 2] = 1.0, 1.0
        twist, bending = (2.0 * plate - values[:, 0, 0], plate - values[:, 2, 2])
        return values + twist[:, None, None] * where[0] + bending[:, None, None] * where[1]

    def check(self, section: Any) -> None:
        """As :meth:`Ribbon.check`."""
        Ribbon().check(section)

    def slack(self, section: Any, x: Array, change: Array) -> Array:
        """How much the twist exceeds the curvature, as a share of it, (n,), for changes (n, 3) of both; above 0 there
        is no stiffness against bending.
        """
        smooth = np.hypot(change[:, 2], values_of(_plate(section, x)[1]))
        return np.abs(change[:, 0]) / smooth - 1.0


def _plate(section: Any, x: Array) -> tuple[Array, Array]:
    """Plate stiffness times width of a ribbon, N m2, and the curvature over which that of Sadowsky is smoothed, 1/m."""
    young, half_width, half_height = section.fibres(x).T
    width, thick = 2.0 * half_width, 2.0 * half_height
    return young * thick**3 / (12.0 * (1.0 - section.nu**2)) * width, SMOOTHED * thick / width**2


SMOOTHED = 1e-3
"""Curvature over thickness / width^2 below which the ribbon of Sadowsky is smoothed; that of a plate strip is at 1."""


LEAST_RATIO = 1e-6
"""Least share of the stiffness that is left: with less the shape of what yields is rounding (1e-12 was not solved)."""


class _Remembering(_OneAxis):
    """A law with memory: of the moment about an axis, or of the stress of the fibres of a shape."""

    remembers: ClassVar[bool] = True

    moment: Sized | None = None
    stress: Sized | None = None
    ratio: Positive
    about: About = "b3"

    @property
    def shaped(self) -> str:  # type: ignore[override]
        """Any shape where stresses are given; none is needed where moments are."""
        return "" if self.stress is None else "any"

    @model_validator(mode="after")
    def _one_of_both(self) -> Any:
        if (self.moment is None) == (self.stress is None):
            found = "neither 'moment' nor 'stress'" if self.moment is None else "'moment' and 'stress'"
            raise SceneError(f"found {found}, accepted: one of them")
        if not LEAST_RATIO <= self.ratio < 1.0:
            raise SceneError(f"found {self.ratio:g}, accepted: from {LEAST_RATIO:g} on, and below 1", ("ratio",))
        return self

    def check(self, section: Any) -> None:
        """Refuse an axis that the shape does not have.

        Raises
        ------
        SceneError
            Names the key.
        """
        super().check(section)
        if self.stress is None:
            return
        if section.shape == "rectangle" and self.about == "both":
            raise SceneError("found 'both' with a rectangle, accepted: 'b2' or 'b3'", ("about",))
        if section.shape != "rectangle" and self.about != "both":
            raise SceneError(f"found {self.about!r} with a {section.shape}, accepted: 'both'", ("about",))

    @property
    @abc.abstractmethod
    def material(self) -> list[Any]:
        """Numbers of the material, see :mod:`~sfetcas.mathematics.hysteresis`."""

    @property
    @abc.abstractmethod
    def material_name(self) -> str:
        """Its name there."""

    @property
    def form(self) -> Form:
        """The material, and fibres that remember."""
        return self._form_of(stretches=False)

    def form_in(self, section: Any) -> Form:
        """Where the section of fibres stretches these are those of all of it, not of half."""
        return self._form_of(section.stretch and self.stress is not None)

    def _form_of(self, stretches: bool) -> Form:
        shape, fibres = "circle" if self.axis == BOTH else "rectangle", self.stress is not None
        count = len(_fibres_of(shape, 0.0, stretches)) if fibres else 1
        return Form(self.material_name, self.axis, count, spread=self.axis == BOTH and fibres, strains=int(stretches))

    def values(self, section: Any, x: Array) -> Array:
        """In units of the end of the first elastic range; nothing is remembered."""
        bending, form = self._bending(section, x), self.form_in(section)
        if self.stress is None:
            assert self.moment is not None
            bent, rows = self.moment / bending, np.ones((len(x), 2))
        else:
            young, *reach = section.fibres(x).T
            reach = reach[1 if self.axis == BOTH else self.axis - 2]
            bent = self.stress / (young * reach)
            shares = values_of(section.hollow(x))
            rows = np.stack([_fibres_of(section.shape, float(s), form.strains > 0).T.ravel() for s in shares])
            rows = np.concatenate([reach[:, None], rows], axis=1) if form.strains else rows
        material = numbers([self.material] * len(x)).reshape(len(x), -1)
        units = np.stack([bending * bent**2, bent], axis=1)
        return numbers(np.concatenate([units, material, rows, np.zeros((len(x), form.memory))], axis=1))


FIBRES = 12
"""Fibres of half the height of a rectangle: the plastic moment is met to 0.1 %."""

ROUND_FIBRES = (3, 10)
"""Rings of fibres of a round section, and fibres on half of each."""


@functools.lru_cache(maxsize=256)
def _fibres_of(shape: str, inner: float, whole: bool = False) -> Array:
    """Weights, and places over the reach of the section, of the fibres of half a section, (n, 2) or (n, 3).

    The weights make the second moment 1.  The other half has the opposite strains and stresses, unless the section
    stretches: then they are those of the ``whole`` section, whose area the weights have, too.
    """
    if whole:
        half = _fibres_of(shape, inner)
        other = half * [1.0, *[-1.0] * (half.shape[1] - 1)]
        both = np.concatenate([half, other]) * [0.5, *[1.0] * (half.shape[1] - 1)]
        if shape == "rectangle":
            # The area over the second moment of a reach of 1 is 3.
            share = both[:, 0].sum() / 3.0
            both = both * [1.0 / share, np.sqrt(share)]
        return both
    if shape == "rectangle":
        # Midpoints of equal parts, of which those of no kink leave the same error each.
        y = (np.arange(FIBRES) + 0.5) / FIBRES
        return np.stack([np.ones(FIBRES) / np.sum(y**2), y], axis=1)
    rings, count = ROUND_FIBRES
    points, weights = gauss(rings)
    radius = inner + (1.0 - inner) * points
    angle = (np.arange(count) + 0.5) * np.pi / count
    share = np.repeat(weights * radius, count)
    # Axes b2 and b3: bending about b3 strains by minus the place along b2.
    y, z = (np.outer(radius, part(angle)).ravel() for part in (np.cos, np.sin))
    return np.stack([share / np.sum(share * y**2), z, -y], axis=1)


@final
class ElasticPlastic(_Remembering):
    """Bending that is elastic up to a moment, then plastic with a share of the stiffness, and unloads elastically.

    It is linear kinematic hardening: the elastic range stays as wide as it is, and moves.  With ``stress``, in a
    section that stretches, axial force and moment act upon the same fibres.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2``, ``b3``, or ``both`` for a round section, by the vector of both curvatures.
    moment : N m
        Moment at which plastic bending begins, of either sign; or ``stress``.
    stress : N/m²
        With a shape: stress at which its fibres begin to yield.  A rectangle needs an axis, a circle or a tube
        ``both``.
    ratio : 1
        Stiffness beyond over that before, above 0 and below 1; with ``stress`` that of the fibres.
    """

    type: Literal["elastic-plastic"] = "elastic-plastic"

    @property
    def material_name(self) -> str:
        """A slider beside a spring."""
        return "sliders"

    @property
    def material(self) -> list[Any]:
        """The ratio."""
        return [self.ratio]


@final
class Superelastic(_Remembering):
    """Bending with a plateau on loading and a lower one on unloading, from which it comes back without a rest.

    It has the stiffness of the section before and beyond the plateaus, and on unloading between them.  With ``stress``,
    in a section that stretches, axial force and moment act upon the same fibres.

    Parameters
    ----------
    about : text
        Axis of bending: ``b2``, ``b3``, or with ``stress`` ``both``.
    moment : N m
        Moment at which the plateau on loading begins, of either sign; or ``stress``.
    stress : N/m²
        With a shape: stress at which the plateau of its fibres begins.  A rectangle needs an axis, a circle or a tube
        ``both``.
    ratio : 1
        Stiffness on the plateaus over that before, above 0 and below 1.
    curvature : 1/m
        With ``moment``: change of the curvature at which the plateau on loading ends.
    strain : 1
        With ``stress``: strain at which that plateau ends.
    unloading : N m, N/m²
        Moment, or with ``stress`` stress, at which the plateau on unloading ends, above 0 and below that at which the
        one on loading begins.
    """

    type: Literal["superelastic"] = "superelastic"
    curvature: Sized | None = None
    strain: Sized | None = None
    unloading: Sized

    @model_validator(mode="after")
    def _ends(self) -> Superelastic:
        key, other, begins = (
            ("curvature", "strain", "moment") if self.stress is None else ("strain", "curvature", "stress")
        )
        if getattr(self, key) is None:
            raise SceneError(f"the key {key!r} is missing: with {begins!r} it says where the plateau ends")
        if getattr(self, other) is not None:
            raise SceneError(f"found {other!r} beside {begins!r}, accepted: {key!r}")
        if not self.unloading < self._begin:
            found = f"found {self.unloading:g} beside a {begins} of {self._begin:g}"
            raise SceneError(f"{found}, accepted: below it", ("unloading",))
        if self.stress is None and self.about == "both":
            raise SceneError("found 'both' with 'moment', accepted: 'b2' or 'b3', or 'stress' with a shape", ("about",))
        return self

    @property
    def _begin(self) -> float:
        """Moment or stress at which the plateau on loading begins."""
        begin = self.moment if self.stress is None else self.stress
        assert begin is not None
        return begin

    @property
    def _end(self) -> float:
        """Change of the curvature, or strain, at which it ends."""
        end = self.curvature if self.stress is None else self.strain
        assert end is not None
        return end

    @property
    def material_name(self) -> str:
        """A transformation."""
        return "superelastic"

    @property
    def material(self) -> list[Any]:
        """Nothing: the length of the plateau needs the section."""
        return [0.0, 0.0, 0.0, 0.0]

    def _length(self, section: Any, x: Array) -> Array:
        """Where the plateau on loading ends over where it begins, (n,)."""
        if self.stress is None:
            return numbers(self._end * self._bending(section, x) / self._begin)
        return numbers(self._end * section.fibres(x)[:, 0] / self._begin)

    def check(self, section: Any) -> None:
        """Refuse a plateau that ends before it begins.

        Raises
        ------
        SceneError
            Names the key.
        """
        super().check(section)
        key = "curvature" if self.stress is None else "strain"
        least = float(values_of(self._length(section, np.linspace(0.0, 1.0, 9))).min())
        if not least > 1.0:
            found = f"found {getattr(self, key):g}, {least:.6g} times that at which the plateau begins"
            raise SceneError(f"{found}, accepted: above it", (key,))

    def values(self, section: Any, x: Array) -> Array:
        """In units of the end of the first elastic range; nothing is remembered."""
        found = super().values(section, x)
        strain = (self._length(section, x) - 1.0) * (1.0 - self.ratio)
        lower = self.unloading / self._begin
        hardening = strain**2 * (self.ratio / (1.0 - self.ratio))
        material = np.stack([strain, hardening, 0.5 * strain * (1.0 + lower), 0.5 * strain * (1.0 - lower)], axis=1)
        return numbers(np.concatenate([found[:, :2], material, found[:, 6:]], axis=1))


def _strains(value: int) -> int:
    if value not in (0, 1, 3):
        raise ValueError(f"found {value}, accepted: 0, 1 or 3")
    return value


def _potential(value: Any, info: ValidationInfo) -> str:
    """A function of CasADi, or one of Python that makes an expression, as a text."""
    from ..mathematics.potentials import text_of

    strains = info.data.get("strains", 0)
    followed = {0: "", 1: " and the strain along", 3: " and the strains along b1, b2, b3"}[strains]
    accepted = f"a function of the three changes of curvature (twist, about b2, about b3){followed}"
    accepted += " that gives one number, J/m"
    try:
        return text_of(value, 3 + strains)
    except ValueError as error:
        raise ValueError(f"found {error.args[0] or say(value)}, accepted: {accepted}") from None


def parameters_given(value: Any) -> tuple[float, ...]:
    """The parameters of a given potential, from a list."""
    return tuple(number(entry) for entry in listed(value, "a list of numbers"))


def check_parameters(given: tuple[float, ...], wanted: int) -> None:
    """Refuse more parameters than a given potential takes, or none where it takes some.

    Raises
    ------
    SceneError
        Names their number.
    """
    if len(given) > wanted or (wanted and not given):
        found = f"found {len(given)} numbers, accepted: {wanted}, as the function takes them"
        raise SceneError(found, ("parameters",))


@final
class Potential(SectionLaw):
    """Any potential per length of the changes of twist and of the curvatures about b2 and b3, and of strains.

    The section gives no stiffness beside it that it says itself.

    Parameters
    ----------
    strains : number
        How many strains follow the three curvatures: ``1`` for that along, so that the section stretches and has no
        ``EA``, or ``3`` for those along b1, b2 and b3, so that it also shears and has no ``GA2`` and ``GA3``.
        Default: ``0``.
    potential : function
        Energy per length, J/m, as a CasADi ``Function`` of the three curvatures (1/m) and the strains as one vector, or
        of this and the parameters; or a Python function that makes an expression of them.  In a file: the text that
        ``serialize()`` gives.
    parameters : (m,)
        Numbers that the function takes as its second argument, in their own units.  Default: none.
    """

    convex: ClassVar[bool] = False

    type: Literal["potential"] = "potential"
    strains: Annotated[int, AfterValidator(_strains)] = 0
    potential: Annotated[str, BeforeValidator(_potential)]
    parameters: Annotated[tuple[float, ...], BeforeValidator(parameters_given)] = ()

    @model_validator(mode="after")
    def _sound(self) -> Potential:
        check_parameters(self.parameters, self._wanted)
        gradient, hessian = self._at_rest()
        if not np.isfinite([*gradient, *hessian.ravel()]).all():
            raise SceneError("found one that has no two derivatives at rest, accepted: a smooth one", ("potential",))
        gradient, hessian = (values_of(part) for part in (gradient, hessian))
        if self.strains:
            self._sound_with_strains(gradient, hessian)
            return self
        lowest = float(np.linalg.eigvalsh(hessian)[0])
        if lowest <= tolerances.RANK * np.abs(hessian).max():
            found = f"found second derivatives at curvature 0 with an eigenvalue of {lowest:g} N m2"
            raise SceneError(f"{found}, accepted: a potential that is convex there", ("potential",))
        # A moment that would bend by less than nothing beside one radian per metre is rounding.
        if np.abs(gradient).max() > tolerances.DECIMAL * np.abs(hessian).max():
            found = f"found moments of {say(gradient.tolist())} N m at curvature 0"
            message = f"{found}, accepted: none; a natural curvature belongs to the member's shape"
            raise SceneError(message, ("potential",))
        return self

    def _sound_with_strains(self, gradient: Array, hessian: Array) -> None:
        """Refuse a potential of curvatures and strains that is not convex at rest, or has moments or forces there."""
        diagonal = hessian.diagonal()
        unit = np.sqrt(np.maximum(diagonal, TINY))
        lowest = float(np.linalg.eigvalsh(hessian / unit[:, None] / unit)[0])
        if diagonal.min() <= 0.0 or lowest <= tolerances.RANK:
            found = f"found second derivatives at rest of {say(diagonal.tolist())}"
            if diagonal.min() > 0.0:
                found = f"found second derivatives at rest with an eigenvalue of {lowest:g} beside a diagonal of ones"
            raise SceneError(f"{found}, accepted: a potential that is convex there", ("potential",))
        if (np.abs(gradient) > tolerances.DECIMAL * diagonal).any():
            found = f"found moments and forces of {say(gradient.tolist())} N m and N at rest"
            raise SceneError(f"{found}, accepted: none", ("potential",))

    def check(self, section: Any) -> None:
        """Refuse damping where strains are coupled at rest, of which that knows each by itself.

        Raises
        ------
        SceneError
            Names the law.
        """
        if not section.damping or not self.strains:
            return
        hessian = values_of(self._at_rest()[1])
        unit = np.sqrt(hessian.diagonal())
        coupled = np.abs(hessian / unit[:, None] / unit - np.eye(len(hessian)))
        coupled[:3, :3] = 0.0
        if coupled.max() > tolerances.DECIMAL:
            message = "found a potential that couples strains with others at rest beside 'damping', accepted: one"
            raise SceneError(f"{message} that does not, or no damping")

    @property
    def gives(self) -> tuple[str, ...]:  # type: ignore[override]
        """Those of bending and twist, and of the strains that it has."""
        return ("EI2", "EI3", "GJ", *("EA", "GA2", "GA3")[: self.strains])

    @property
    def _wanted(self) -> int:
        from ..mathematics.potentials import parameters_of

        return parameters_of(self.potential)

    @property
    def form(self) -> Form:
        """The function, its parameters as numbers."""
        return Form("given", 3, self._wanted, given=self.potential, strains=self.strains)

    def _padded(self) -> Array:
        """The parameters, then zeros for those that the function does not use."""
        given = numbers(list(self.parameters))
        return numbers(np.concatenate([given, np.zeros(self._wanted - len(self.parameters))]))

    def _at_rest(self) -> tuple[Array, Array]:
        """Gradient (3,), N m, and second derivatives (3, 3), N m2, at rest; with strains also N and N m."""
        from ..mathematics.potentials import at_rest

        return at_rest(self.potential, self._padded())

    def values(self, section: Any, x: Array) -> Array:
        """In SI units."""
        row = np.concatenate([np.ones(2), self._padded()])
        return numbers(np.broadcast_to(row, (len(x), row.shape[0])))

    def stiffness(self, section: Any, values: Array, x: Array) -> Array:
        """The second derivatives at rest."""
        return np.tile(self._at_rest()[1][:3, :3], (len(x), 1, 1))

    def yields(self, section: Any, own: Array, x: Array) -> Array:
        """One over the second derivatives at rest by each of its strains."""
        if not self.strains:
            return own
        hessian, ones = self._at_rest()[1], np.ones(len(x))
        found = [ones / hessian[3 + i, 3 + i] for i in range(self.strains)]
        return np.stack([*found, *(own[:, i] for i in range(self.strains, 3))], axis=1)

    def stays_in_plane(self, axis: int) -> bool:
        """Whether bending about b2 or b3 alone, given as 2 or 3, gives no moment about other axes, tried at some.

        With strains also whether it and strains in the plane give no force across that.
        """
        from ..mathematics.potentials import derivatives_of

        derivatives, p = derivatives_of(self.form), values_of(self._padded())
        size = self.form.arguments
        # What the form leaves out: the quadratic part without that of strains with others.
        rest = values_of(self._at_rest()[1]).copy()
        rest[3:, :3], rest[:3, 3:] = 0.0, 0.0
        rest[3:, 3:] = np.diag(rest[3:, 3:].diagonal())
        # The strain along, and that across in the plane: along b2 where it bends about b3.
        inside = [i for i in (axis - 1, 3, 7 - axis) if i < size]
        for k in np.outer([1e-3, 1.0, 1e3], [-1.0, -0.37, 0.61]).ravel():
            for strain in (0.0,) if not self.strains else (0.0, -1e-3, 2e-3):
                x = np.zeros(size)
                x[inside] = [k, strain, 0.7 * strain][: len(inside)]
                found = derivatives(x, p)[1].full().ravel() + rest @ x
                if np.abs(np.delete(found, inside)).max() > tolerances.DECIMAL * np.abs(found).max():
                    return False
        return True


Law = Annotated[
    Bilinear
    | RambergOsgood
    | Plateau
    | MomentTable
    | StressStrain
    | Ribbon
    | Sadowsky
    | ElasticPlastic
    | Superelastic
    | Potential,
    Field(discriminator="type"),
]
"""A law of a section, told apart by its ``type``."""
