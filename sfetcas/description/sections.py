"""Cross-sections: stiffness and mass per length about b1, b2, b3, constant or varying along the member."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, final

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, BeforeValidator, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import numbers, values_of
from ..mathematics.interpolation import power_series
from .formulas import SAMPLES, Formula
from .laws import Law
from .records import NotNegative, Number, Numbers, Record, number, say

__all__ = [
    "FINE",
    "HEAVY",
    "CrossSection",
    "Polynomial",
    "Quantity",
    "Table",
    "Varying",
    "breaks",
    "evaluate",
    "quantity",
]

Floats = NDArray[np.float64]


@final
class Table(Record):
    """Values at fractions of the length, linear between.

    Parameters
    ----------
    at : (m,)
        Fractions of the length, rising from 0 to 1, at least two.
    value : (m,)
        The values there, linear between.
    """

    at: Numbers
    value: Numbers

    @model_validator(mode="after")
    def _ordered(self) -> Table:
        if len(self.at) < 2:
            raise SceneError(f"found {len(self.at)} fractions, accepted: two or more, from 0 to 1", ("at",))
        if len(self.at) != len(self.value):
            found = f"found {len(self.value)} values at {len(self.at)} fractions"
            raise SceneError(f"{found}, accepted: one at each", ("value",))
        if self.at[0] != 0.0 or self.at[-1] != 1.0:
            raise SceneError(f"found {self.at[0]:g} to {self.at[-1]:g}, accepted: from 0 to 1", ("at",))
        for before, after in pairwise(self.at):
            if after <= before:
                raise SceneError(f"found {after:g} after {before:g}, accepted: rising fractions", ("at",))
        return self


@final
class Polynomial(Record):
    """c0 + c1 x + c2 x^2 + ... in x = s/L.

    Parameters
    ----------
    polynomial : (m,)
        Coefficients c0, c1, ... in x = s/L, at least one.
    """

    polynomial: Numbers


def quantity(value: Any) -> Any:
    """A quantity along a member from a number, a formula, a table as in a file, or a record.

    Raises
    ------
    ValueError
        Anything else.
    """
    if isinstance(value, (Table, Polynomial, Formula)):
        return value
    if isinstance(value, str):
        return Formula(formula=value)
    if isinstance(value, Mapping) and "formula" in value:
        return Formula(**value)
    if isinstance(value, Mapping) and "polynomial" in value:
        return Polynomial(**value)
    if isinstance(value, Mapping) and ("at" in value or "value" in value):
        return Table(**value)
    if isinstance(value, (Mapping, str, Iterable)) and getattr(value, "shape", None) != ():
        accepted = "a number, a formula of x, {at = [..], value = [..]} or {polynomial = [..]}"
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return number(value)


Quantity = float | Table | Polynomial | Formula
Varying = Annotated[Quantity, BeforeValidator(quantity)]
"""A quantity along a member: a number, a :class:`Table`, a :class:`Polynomial` or a :class:`Formula`."""


def evaluate(varying: Quantity, x: ArrayLike, length: float = np.nan) -> Floats:
    """Values of a quantity along a member.

    Parameters
    ----------
    varying : float, Table, Polynomial or Formula
        The quantity.
    x : (n,)
        Fractions of the length.
    length : m
        Of the member; only formulas of ``s`` need it.

    Returns
    -------
    (n,) - in the unit of the quantity
    """
    x = np.atleast_1d(numbers(x))
    if isinstance(varying, Table):
        return numbers(np.interp(x, numbers(varying.at), numbers(varying.value)))
    if isinstance(varying, Polynomial):
        return power_series(x, varying.polynomial)
    if isinstance(varying, Formula):
        return varying.at(x, length)
    return numbers(np.broadcast_to(numbers(varying), x.shape))


def breaks(varying: Quantity, length: float = np.nan) -> tuple[float, ...]:
    """Fractions strictly between 0 and 1 where the slope of a quantity jumps or may jump; ``length`` in m."""
    if isinstance(varying, Formula):
        return varying.breaks(length)
    return varying.at[1:-1] if isinstance(varying, Table) else ()


def _coefficients(varying: Quantity, left: float, right: float) -> Floats:
    """Coefficients in x of a quantity that has no kink between left and right."""
    if isinstance(varying, Polynomial):
        return np.array(varying.polynomial)
    ends = evaluate(varying, [left, right])
    slope = (ends[1] - ends[0]) / (right - left)
    return np.array([ends[0] - slope * left, slope])


def _lowest(varying: Quantity, less: Quantity = 0.0) -> tuple[float, float]:
    """Fraction and value of the minimum of varying - less on [0, 1]; rounding below zero counts as zero."""
    if isinstance(varying, Formula) or isinstance(less, Formula):
        return _least(varying, less)
    edges = sorted({0.0, *breaks(varying), *breaks(less), 1.0})
    candidates = list(edges)
    for left, right in pairwise(edges):
        difference = polynomial.polysub(_coefficients(varying, left, right), _coefficients(less, left, right))
        # the real parts of all roots: a multiple root comes out as a cluster of nearly real ones
        slope = polynomial.polytrim(polynomial.polyder(difference))
        candidates += list(np.clip(polynomial.polyroots(slope).real, left, right))
    values = evaluate(varying, candidates) - evaluate(less, candidates)
    where = int(np.argmin(values))
    terms = varying.polynomial if isinstance(varying, Polynomial) else ()
    noise = 4.0 * np.finfo(float).eps * sum(map(abs, terms))
    return float(candidates[where]), 0.0 if abs(values[where]) <= noise else float(values[where])


def _least(varying: Quantity, less: Quantity) -> tuple[float, float]:
    """As :func:`_lowest` where one is a formula: at many places, then at many between those beside the least."""
    x = np.unique([*np.linspace(0.0, 1.0, SAMPLES), *breaks(varying), *breaks(less)])
    for _ in range(4):
        values = evaluate(varying, x) - evaluate(less, x)
        at = int(np.argmin(values))
        where, least = float(x[at]), float(values[at])
        x = np.linspace(x[max(at - 1, 0)], x[min(at + 1, len(x) - 1)], SAMPLES)
    return where, least


def _bounded(varying: Quantity, accepted: str, zero: bool) -> Quantity:
    if isinstance(varying, Formula) and varying.uses_length:
        found = f"found {say(varying.formula)} in a section, which members of different lengths may share"
        raise ValueError(f"{found}, accepted: a formula of x, the fraction of the length")
    where, lowest = _lowest(varying)
    if lowest > 0.0 or (zero and lowest == 0.0):
        return varying
    if isinstance(varying, float):
        raise ValueError(f"found {varying:g}, accepted: {accepted}")
    raise ValueError(f"found {lowest:g} at {where:g} of the length, accepted: {accepted} everywhere")


def _above_zero(varying: Quantity) -> Quantity:
    return _bounded(varying, "a number above zero", zero=False)


def _not_negative(varying: Quantity) -> Quantity:
    return _bounded(varying, "zero or a number above zero", zero=True)


def _three(value: Any) -> tuple[Any, ...]:
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable):
        raise ValueError(f"found {say(value)}, accepted: three numbers, about b1, b2 and b3")
    entries = tuple(value)
    if len(entries) != 3:
        raise ValueError(f"found {len(entries)} numbers, accepted: three, about b1, b2 and b3")
    return entries


def _poisson(value: float) -> float:
    if not -1.0 < value <= 0.5:
        raise ValueError(f"found {value:g}, accepted: a number above -1 and up to 0.5")
    return value


def _share(value: float) -> float:
    if not 0.0 < value <= 1.0:
        raise ValueError(f"found {value:g}, accepted: a number above 0 and up to 1")
    return value


Above = Annotated[Varying, AfterValidator(_above_zero)]
Inertia = Annotated[Varying, AfterValidator(_not_negative)]

HEAVY = np.linspace(0.0, 1.0, SAMPLES)
"""Fractions of the length at which a mass is looked for."""

FINE = tuple((np.arange(1, 64) / 64).tolist())
"""Ends of the panels on which a formula is integrated where no error estimate asks for finer ones."""

Outline = Callable[..., tuple[Floats, Floats, Floats, Floats]]


def _rectangle(width: Floats, height: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    long, short = np.maximum(width, height), np.minimum(width, height)
    return (
        width * height,
        height * width**3 / 12.0,
        width * height**3 / 12.0,
        long * short**3 * _torsion_factor(long / short),
    )


def _torsion_factor(ratio: Floats) -> Floats:
    """J / (long short^3) of a rectangle with the ratio of its sides >= 1.

        1/3 - 64 / (pi^5 ratio) sum over odd n of tanh(n pi ratio / 2) / n^5

    The sum of 1/n^5 is known; what tanh lacks to 1 falls like exp(-n pi ratio), so few terms give all digits.

    Source: Timoshenko and Goodier, Theory of Elasticity, torsion of rectangular bars (Saint-Venant).
    """
    n = np.arange(1.0, 15.0, 2.0)
    decay = np.exp(-np.pi * n * ratio[:, None])
    odd = 31.0 / 32.0 * 1.0369277551433699263  # zeta(5)
    total = odd - np.sum(2.0 * decay / (1.0 + decay) / n**5, axis=1)
    return np.asarray(1.0 / 3.0 - 64.0 / (np.pi**5 * ratio) * total)


def _circle(radius: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    second = np.pi * radius**4 / 4.0
    return np.pi * radius**2, second, second, 2.0 * second


def _tube(outer: Floats, inner: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    # factored, since the difference of fourth powers of a thin wall loses digits
    area = np.pi * (outer - inner) * (outer + inner)
    second = area * (outer**2 + inner**2) / 4.0
    return area, second, second, 2.0 * second


_OUTLINES: dict[str, tuple[tuple[str, ...], Outline]] = {
    "rectangle": (("width", "height"), _rectangle),
    "circle": (("radius",), _circle),
    "tube": (("outer", "inner"), _tube),
}
_NUMBERS = ("EI2", "EI3", "GJ", "EA", "GA2", "GA3", "rhoA", "rhoI")
_MATERIAL = ("E", "nu", "G", "rho")
_DIMENSIONS = ("width", "height", "radius", "outer", "inner")


@final
class CrossSection(Record):
    """Stiffness and mass of a member per length, as numbers or as a shape with a material.

    Each quantity but nu, damping and drag may vary along the member (a :class:`Table`, a :class:`Polynomial` or a
    :class:`Formula`).

    Parameters
    ----------
    EI2 : N m²
        Bending stiffness about b2.  Needed in space.
    EI3 : N m²
        Bending stiffness about b3.  The axis b3 is z where the member lies in x-y.
    GJ : N m²
        Torsional stiffness about the tangent b1.  Needed in space.
    EA : N
        Stiffness against stretch.  Default: it does not stretch.
    GA2 : N
        Stiffness against shear along b2.  Default: no shear.
    GA3 : N
        Stiffness against shear along b3.  Default: no shear.
    coupling : (3,), N m²
        Entries of the stiffness matrix beside its diagonal ``GJ``, ``EI2``, ``EI3``: of twist with bending about
        b2, of twist with bending about b3, and of bending about b2 with bending about b3.  The moment about b1 is
        ``GJ`` times the change of the twist plus the first entry times that of the curvature about b2 plus the
        second times that about b3, and so on.  Needs all three stiffnesses.  Default: zero.
    rhoA : kg/m
        Mass per length.  Needed with gravity, rotating axes, modes and motions; zero for a member without mass, as
        of a light spring between heavy bodies.
    rhoI : (3,), kg m
        Rotary inertia per length about b1, b2, b3, for modes and motions.  Default: zero.
    law : table
        Moments that are not proportional to the change of the curvature: a table with the key ``type``
        (``bilinear``, ``ramberg-osgood``, ``plateau``, ``table``, ``stress-strain``, ``audoly-neukirch`` or, in
        Python, ``potential``) and the keys of that law.  Default: linear.
    damping : s
        Retardation time of Kelvin and Voigt: a moment, and a force where it stretches or shears, is the stiffness
        times (the strain + ``damping`` times its rate).  With a law it is that of the stiffness at rest.
    drag : N s/m²
        Force per length against the velocity, per unit of the velocity.
    shape : text
        Instead of these numbers: ``rectangle`` (``width``, ``height``), ``circle`` (``radius``) or ``tube``
        (``outer``, ``inner``).
    stretch : true or false
        Whether a shape stretches: ``EA`` from E and the area.  Default: false.
    shear : true or false
        Whether a shape shears: ``GA2`` and ``GA3`` from G, the area and ``shear_factor``.  Default: false.
    shear_factor : 1
        Share of the area of a shape that resists shear.  Default: that of Cowper 1966 for the shape.
    E : N/m²
        Young's modulus of a shape, which needs it.
    nu : 1
        Poisson's ratio of a shape, instead of ``G``.
    G : N/m²
        Shear modulus of a shape.
    rho : kg/m³
        Density of a shape, or zero.
    width : m
        Of a rectangle, along b3.
    height : m
        Of a rectangle, along b2.
    radius : m
        Of a circle.
    outer : m
        Outer radius of a tube.
    inner : m
        Inner radius of a tube.

    Raises
    ------
    SceneError
        A stiffness or mass not above zero somewhere, a coupling so large that the stiffness matrix is not positive
        definite, numbers mixed with a shape, a shape without E or with
        dimensions of another, or nothing at all.
    """

    EI2: Above | None = None
    EI3: Above | None = None
    GJ: Above | None = None
    EA: Above | None = None
    GA2: Above | None = None
    GA3: Above | None = None
    coupling: Annotated[tuple[Varying, Varying, Varying], BeforeValidator(_three)] | None = None
    rhoA: Inertia | None = None
    rhoI: Annotated[tuple[Inertia, Inertia, Inertia], BeforeValidator(_three)] | None = None
    law: Law | None = None
    damping: NotNegative = 0.0
    drag: NotNegative = 0.0
    shape: Literal["rectangle", "circle", "tube"] | None = None
    stretch: bool = False
    shear: bool = False
    shear_factor: Annotated[Number, AfterValidator(_share)] | None = None
    E: Above | None = None
    nu: Annotated[Number, AfterValidator(_poisson)] | None = None
    G: Above | None = None
    rho: Inertia | None = None
    width: Above | None = None
    height: Above | None = None
    radius: Above | None = None
    outer: Above | None = None
    inner: Above | None = None

    @model_validator(mode="after")
    def _consistent(self) -> CrossSection:
        numbers = self._given(_NUMBERS)
        if self.shape is not None:
            if numbers:
                raise SceneError(
                    f"found {numbers[0]!r} together with shape = {self.shape!r}, accepted: either "
                    f"{', '.join(_NUMBERS)} or a shape with {', '.join(_MATERIAL)} and its dimensions"
                )
            self._check_shape(self.shape)
        elif outlined := self._given((*_MATERIAL, *_DIMENSIONS, "shear_factor")) or self._switched():
            raise SceneError(f"found {outlined[0]!r} without a shape, accepted: shape = {' | '.join(_OUTLINES)}")
        elif not numbers and not (self.law is not None and self.law.gives):
            raise SceneError(f"found nothing in it, accepted: {', '.join(_NUMBERS)} or a shape")
        if self.coupling is not None:
            self._check_coupling()
        if self.law is not None:
            self._check_law(self.law)
        return self

    def _check_law(self, law: Law) -> None:
        if self.coupling is not None:
            raise SceneError("found a law beside a coupling, accepted: one of them; a potential may couple", ("law",))
        if law.shaped and self.shape is None:
            accepted = "a shape" if law.shaped == "any" else f"shape = {law.shaped!r}"
            raise SceneError(f"found {law.type!r} without a shape, accepted: with {accepted}, E and G or nu", ("law",))
        if law.shaped not in ("", "any", self.shape):
            raise SceneError(f"found {law.type!r} with a {self.shape}, accepted: with a {law.shaped}", ("law",))
        twice = [name for name in law.gives if self.shape is not None or getattr(self, name) is not None]
        if twice:
            found = repr(twice[0]) if self.shape is None else f"shape = {self.shape!r}"
            message = f"found {found} beside the law {law.type!r}, which says that stiffness, accepted: one of them"
            raise SceneError(message, ("law",))
        missing = self.missing(law.needs)
        if missing:
            raise SceneError(f"the key {missing[0]!r} is missing: the law {law.type!r} begins with that stiffness")
        try:
            law.check(self)
        except SceneError as error:
            raise error.within("law") from None

    def _check_coupling(self) -> None:
        missing = self.missing(("GJ", "EI2", "EI3"))
        if missing:
            message = f"the key {missing[0]!r} is missing: a section with a coupling needs GJ, EI2 and EI3"
            raise SceneError(message)
        edges = np.array([0.0, *self.breaks, 1.0])
        x = np.unique(edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, SAMPLES))
        matrices = values_of(self.stiffness_matrix(x))
        unit = np.sqrt(np.einsum("nii->ni", matrices))
        lowest = np.linalg.eigvalsh(matrices / unit[:, :, None] / unit[:, None, :])[:, 0]
        i = int(np.argmin(lowest))
        if lowest[i] <= tolerances.RANK:
            found = [float(evaluate(item, x[i])[0]) for item in self.coupling or ()]
            where = "" if self.even else f" at {x[i]:g} of the length"
            beside = ", ".join(f"{entry:g}" for entry in matrices[i].diagonal())
            message = f"found {say(found)}{where} beside GJ, EI2 and EI3 of {beside}"
            raise SceneError(f"{message}, accepted: a positive definite stiffness matrix", ("coupling",))

    def _given(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]

    def _switched(self) -> list[str]:
        return [name for name in ("stretch", "shear") if getattr(self, name)]

    def _check_shape(self, shape: str) -> None:
        needed = _OUTLINES[shape][0]
        if self.shear and not self.sheared:
            raise SceneError("the key 'G' is missing, shear = true needs it or nu")
        if self.shear_factor is not None and not self.shear:
            raise SceneError("found 'shear_factor' without shear = true, accepted: both or neither")
        for name in self._given(_DIMENSIONS):
            if name not in needed:
                raise SceneError(f"found {name!r} for a {shape}, accepted: {' and '.join(needed)}")
        for name in (*needed, "E"):
            if getattr(self, name) is None:
                raise SceneError(f"the key {name!r} is missing, a {shape} needs {', '.join(needed)} and E")
        if self.nu is not None and self.G is not None:
            raise SceneError("found both nu and G, accepted: one of them, the other follows from E")
        if self.outer is not None and self.inner is not None:
            self._check_wall(self.outer, self.inner)

    def _check_wall(self, outer: Quantity, inner: Quantity) -> None:
        where, wall = _lowest(outer, inner)
        if wall <= 0.0:
            radii = f"inner {evaluate(inner, where)[0]:g} and outer {evaluate(outer, where)[0]:g}"
            raise SceneError(f"found {radii} at {where:g} of the length, accepted: inner below outer")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Fractions strictly between 0 and 1 where the slope of some quantity jumps, rising."""
        return tuple(sorted({kink for item in self.varying for kink in breaks(item)}))

    @property
    def panels(self) -> tuple[float, ...]:
        """Fractions strictly between 0 and 1 between which quadrature of nine points integrates a section."""
        formulas = any(isinstance(item, Formula) for item in self.varying)
        return tuple(sorted({*self.breaks, *(FINE if formulas else ())}))

    @property
    def even(self) -> bool:
        """Whether it is constant along the member."""
        return not any(isinstance(item, (Table, Polynomial, Formula)) for item in self.varying)

    @property
    def varying(self) -> list[Quantity]:
        """What may vary along the member, of all that is given."""
        names = ("EI2", "EI3", "GJ", "EA", "GA2", "GA3", "rhoA", "E", "G", "rho", *_DIMENSIONS)
        return [getattr(self, name) for name in self._given(names)] + [*(self.coupling or ()), *(self.rhoI or ())]

    def couples(self, axis: int) -> bool:
        """Whether bending about the axis b2 or b3, given as 2 or 3, is coupled with anything else."""
        others = {2: (0, 2), 3: (1, 2)}[axis]
        if self.law is not None and not self.law.stays_in_plane:
            return True
        return self.coupling is not None and any(self.coupling[i] != 0.0 for i in others)

    @property
    def coupled(self) -> bool:
        """Whether the stiffness at rest is more than a diagonal of GJ, EI2 and EI3."""
        return self.coupling is not None or (self.law is not None and self.law.type == "potential")

    def missing(self, names: Iterable[str]) -> list[str]:
        """Which of the names EI2, EI3, GJ, rhoA (N m2, kg/m) this section does not define, in the order given."""
        if self.shape is None:
            known = set(self._given(_NUMBERS)) | {"rhoI"}
        else:
            known = {"EI2", "EI3"}
            known |= {"GJ"} if self.sheared else set()
            known |= {"rhoA", "rhoI"} if self.rho is not None else set()
        known |= set(self.law.gives) if self.law is not None else set()
        return [name for name in names if name not in known]

    def stiffness(self, x: ArrayLike) -> Floats:
        """Stiffness along the member, with a law that at rest.

        Parameters
        ----------
        x : (n,)
            Fractions of the length.

        Returns
        -------
        (n, 3) - GJ, EI2, EI3 in N m2 (about b1, b2, b3), nan where not defined
        """
        if self.law is None:
            return self.own_stiffness(x)
        found = self.stiffness_matrix(x)[:, [0, 1, 2], [0, 1, 2]]
        return np.where(found == 0.0, np.nan, found)

    def own_stiffness(self, x: ArrayLike) -> Floats:
        """What :meth:`stiffness` is without the law, (n, 3), N m2, at fractions x (n,)."""
        if self.shape is None:
            return np.stack([self._value(name, x) for name in ("GJ", "EI2", "EI3")], axis=1)
        _, about_2, about_3, torsion = self._outline(x)
        young = self._value("E", x)
        return np.stack([self._shear_modulus(x) * torsion, young * about_2, young * about_3], axis=1)

    def _shear_modulus(self, x: ArrayLike) -> Floats:
        return self._value("G", x) if self.nu is None else self._value("E", x) / (2.0 * (1.0 + self.nu))

    @property
    def sheared(self) -> bool:
        """Whether the shear modulus of a shape is known, so that it can shear."""
        return self.nu is not None or self.G is not None

    @property
    def stretches(self) -> bool:
        """Whether it stretches or shears."""
        return bool(self._given(("EA", "GA2", "GA3")) or self._switched())

    def compliance(self, x: ArrayLike) -> Floats:
        """Strains by section forces along the member.

        Parameters
        ----------
        x : (n,)
            Fractions of the length.

        Returns
        -------
        (n, 3) - 1/EA, 1/GA2, 1/GA3 in 1/N (along b1, b2, b3), zero where it neither stretches nor shears
        """
        if self.shape is None:
            values = [getattr(self, name) for name in ("EA", "GA2", "GA3")]
            return np.stack([evaluate(0.0, x) if v is None else 1.0 / evaluate(v, x) for v in values], axis=1)
        area, nothing = self._outline(x)[0], evaluate(0.0, x)
        along = 1.0 / (self._value("E", x) * area) if self.stretch else nothing
        across = nothing
        if self.shear:
            modulus = self._shear_modulus(x)
            factor = self._cowper(self._value("E", x) / (2.0 * modulus) - 1.0, x)
            across = 1.0 / (modulus * area * factor)
        return np.stack([along, across, across], axis=1)

    def _cowper(self, nu: Floats, x: ArrayLike) -> Floats:
        """Share of the area that resists shear, (n,).

        Source: Cowper 1966 (doi 10.1115/1.3625046).
        """
        if self.shear_factor is not None:
            return np.full(nu.shape, self.shear_factor)
        if self.shape == "rectangle":
            return 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
        hole = 0.0 if self.inner is None else self._value("inner", x) / self._value("outer", x)
        square = (1.0 + np.square(hole)) ** 2
        return np.asarray(
            6.0 * (1.0 + nu) * square / ((7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * np.square(hole))
        )

    def stiffness_matrix(self, x: ArrayLike) -> Floats:
        """Stiffness along the member as matrices, with what couples twist and bending.

        Parameters
        ----------
        x : (n,)
            Fractions of the length.

        Returns
        -------
        (n, 3, 3) - moments about b1, b2, b3 by changes of the curvatures about them, N m2, zero where not defined
        """
        found = np.nan_to_num(self.own_stiffness(x))[:, :, None] * np.eye(3)
        if self.law is not None:
            return self.law.stiffness(self, found, np.atleast_1d(numbers(x)))
        return found if self.coupling is None else found + self._coupled(x)

    def _coupled(self, x: ArrayLike) -> Floats:
        """The entries of the matrices beside their diagonals, (n, 3, 3)."""
        twist_2, twist_3, both = (evaluate(item, x) for item in self.coupling or ())
        nothing = np.zeros(len(twist_2))
        rows = (nothing, twist_2, twist_3, twist_2, nothing, both, twist_3, both, nothing)
        return np.stack(rows, axis=1).reshape(len(twist_2), 3, 3)

    def compliance_matrix(self, x: ArrayLike) -> Floats:
        """Inverse (n, 3, 3) of :meth:`stiffness_matrix`, 1/(N m2), at fractions x (n,); zero where not defined."""
        if not self.coupled:
            values = self.stiffness(x)
            return np.where(np.isnan(values), 0.0, 1.0 / values)[:, :, None] * np.eye(3)
        a, b, c = (self.stiffness_matrix(x)[:, i] for i in range(3))
        columns = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        return columns / np.einsum("ni,ni->n", a, np.cross(b, c))[:, None, None]

    def fibres(self, x: ArrayLike) -> Floats:
        """Young's modulus (N/m2) and distances (m) of the outermost fibre from axes b2 and b3, (n, 3), at x (n,)."""
        half, names = {
            "rectangle": (0.5, ("width", "height")),
            "circle": (1.0, ("radius", "radius")),
            "tube": (1.0, ("outer", "outer")),
        }[self.shape or ""]
        return np.stack([self._value("E", x), *(half * self._value(name, x) for name in names)], axis=1)

    def radii(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """Outer and inner radius (m) of a tube at fractions x (n,), each (n,)."""
        return self._value("outer", x), self._value("inner", x)

    @property
    def heavy(self) -> bool:
        """Whether it has a mass above zero somewhere."""
        density = self.rhoA if self.shape is None else self.rho
        return density is not None and bool(evaluate(density, HEAVY).any())

    def mass(self, x: ArrayLike) -> Floats:
        """Mass per length: x (n,) fractions of the length -> (n,) kg/m, nan where not known."""
        return self._value("rhoA", x) if self.shape is None else self._value("rho", x) * self._outline(x)[0]

    def inertia(self, x: ArrayLike) -> Floats:
        """Rotary inertia per length: x (n,) fractions -> (n, 3) kg m about b1, b2, b3.

        Zero for a section of numbers without rhoI, nan for a shape without rho.
        """
        if self.shape is None:
            return np.stack([evaluate(item, x) for item in self.rhoI or (0.0, 0.0, 0.0)], axis=1)
        _, about_2, about_3, _ = self._outline(x)
        return self._value("rho", x)[:, None] * np.stack([about_2 + about_3, about_2, about_3], axis=1)

    def _value(self, name: str, x: ArrayLike) -> Floats:
        varying = getattr(self, name)
        return evaluate(np.nan if varying is None else varying, x)

    def _outline(self, x: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """Area (m2), second moments about b2 and b3 and torsion constant (m4), each (n,)."""
        dimensions, outline = _OUTLINES[self.shape or ""]
        return outline(*(self._value(name, x) for name in dimensions))
