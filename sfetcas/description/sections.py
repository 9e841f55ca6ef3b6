"""Cross-sections: stiffness and mass per length about b1, b2, b3, constant or varying along the member."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, final

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import TINY, numbers, values_of
from ..mathematics.interpolation import power_series
from .formulas import SAMPLES, Formula
from .laws import Law
from .records import NotNegative, Number, Numbers, Record, number, say
from .relaxation import Relaxations, check_relaxation
from .stretch_laws import AnyStretchLaw

__all__ = [
    "FINE",
    "HEAVY",
    "OFF_LINE",
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
    if isinstance(varying, float) and isinstance(x, np.ndarray):
        return np.full(x.shape or (1,), varying)
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
    if isinstance(varying, float) and isinstance(less, float):
        return 0.0, varying - less
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


def _many(value: Any) -> bool:
    """Whether it has entries, as an array without dimensions has none."""
    return isinstance(value, Iterable) and getattr(value, "ndim", 1) != 0


def _center(value: Any) -> tuple[Any, ...]:
    if isinstance(value, (str, Mapping)) or not _many(value):
        raise ValueError(f"found {say(value)}, accepted: two numbers, along b2 and b3")
    entries = tuple(value)
    if len(entries) != 2:
        raise ValueError(f"found {len(entries)} numbers, accepted: two, along b2 and b3")
    return entries


def _matrix(value: Any) -> tuple[tuple[Any, ...], ...]:
    """Rows of a stiffness matrix, of which a table has one at each of its fractions."""
    accepted = "six rows of six entries, for N, Q2, Q3, M1, M2, M3"
    if isinstance(value, Mapping):
        if set(value) != {"at", "value"} or not isinstance(value["value"], Iterable):
            raise ValueError(f"found {say(value)}, accepted: {accepted}, or {{at = [..], value = [matrices]}}")
        matrices = [_matrix(each) for each in value["value"]]
        return tuple(tuple(_entry(value["at"], [m[i][j] for m in matrices]) for j in range(6)) for i in range(6))
    if isinstance(value, str) or not _many(value):
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    rows = tuple(value)
    for row in rows:
        if isinstance(row, (str, Mapping)) or not _many(row):
            raise ValueError(f"found {say(row)} for a row, accepted: {accepted}")
    found = tuple(tuple(row) for row in rows)
    if len(found) != 6 or any(len(row) != 6 for row in found):
        lengths = ", ".join(str(len(row)) for row in found)
        raise ValueError(f"found {len(found)} rows of {lengths or 'no'} entries, accepted: {accepted}")
    return found


def _entry(at: Any, values: list[Any]) -> Any:
    """An entry of matrices at fractions of the length: a number where it is the same in all of them."""
    same = all(isinstance(one, (int, float)) and one == values[0] for one in values)
    return values[0] if same and len(values) > 1 else {"at": at, "value": values}


def _inverse(matrices: Floats) -> Floats:
    """Inverses of symmetric matrices (n, 3, 3), also of symbols."""
    a, b, c = (matrices[:, i] for i in range(3))
    columns = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
    return numbers(columns / np.einsum("ni,ni->n", a, np.cross(b, c))[:, None, None])


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

Row = tuple[Varying, Varying, Varying, Varying, Varying, Varying]
Matrix = Annotated[tuple[Row, Row, Row, Row, Row, Row], BeforeValidator(_matrix)]
Center = Annotated[tuple[Varying, Varying], BeforeValidator(_center)]

OFF_LINE = {
    "stiffness": "a stiffness matrix that couples forces with moments",
    "tension_center": "a tension centre off the line",
    "shear_center": "a shear centre off the line",
    "mass_center": "a mass centre off the line",
}
"""Keys of what is off the line of a member, in words."""

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
_NUMBERS = ("EI2", "EI3", "GJ", "EA", "GA2", "GA3", "stiffness_", "rhoA", "rhoI")
_KEYS = ", ".join(_NUMBERS).replace("_", "")
_OF_MATRIX = ("EI2", "EI3", "GJ", "EA", "GA2", "GA3", "coupling", "law", "tension_center", "shear_center")
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
    stiffness_ : (6, 6), N, N m, N m²
        Instead of ``EI2``, ``EI3``, ``GJ``, ``EA``, ``GA2`` and ``GA3``: all forces and moments by all strains of the
        section, symmetric and positive definite.  Rows are the axial force, the shear forces along b2 and b3, and the
        moments about b1, b2, b3; columns are stretch, shear along b2 and b3, twist, and the changes of the curvatures
        about b2 and b3.  Each entry may vary along the member, or the matrix as a whole:
        ``stiffness = {at = [0, 1], value = [matrix, matrix]}``, linear between.  Default: that of the other numbers.
    tension_center : (2,), m
        Place along b2 and b3 of the point of the section at which an axial force bends nothing, from the centre line.
        ``EA`` acts there, and ``EI2``, ``EI3`` are about axes through it; without ``EA`` the fibre at this place keeps
        its length.  Default: on the centre line.
    shear_center : (2,), m
        Place along b2 and b3 of the point at which shear forces twist nothing, from the centre line.  ``GA2`` and
        ``GA3`` act there, and ``GJ`` is about it; without them the sections do not shear at this place.  Default: on
        the centre line.
    mass_center : (2,), m
        Place along b2 and b3 of the centre of mass, from the centre line: weight and inertia act there, and ``rhoI`` is
        about axes through it.  Default: on the centre line.
    rhoA : kg/m
        Mass per length.  Needed with gravity, rotating axes, modes and motions; zero for a member without mass, as
        of a light spring between heavy bodies.
    rhoI : (3,), kg m
        Rotary inertia per length about b1, b2, b3, for modes and motions.  Default: zero.
    law : table
        Moments that are not proportional to the change of the curvature: a table with the key ``type``
        (``bilinear``, ``ramberg-osgood``, ``plateau``, ``table``, ``stress-strain``, ``audoly-neukirch``,
        ``sadowsky``, ``elastic-plastic``, ``superelastic`` or, in Python, ``potential``) and the keys of that law.
        Default: linear.
    stretch_law : table
        Axial force that is not proportional to the strain along, by a law that bending does not change: a table with
        the key ``type`` (``bilinear``, ``table`` or, in Python, ``potential``) and the keys of that law.  Default:
        linear.
    damping : s
        Retardation time of Kelvin and Voigt: a moment, and a force where it stretches or shears, is the stiffness
        times (the strain + ``damping`` times its rate).  With a law it is that of the stiffness at rest.
    relaxation : list of tables
        Branches ``ratio``, ``time`` of a viscoelastic section (standard linear solid, series of Prony), in motions and
        modes.  The stiffness given is the long-term one, to which moments and forces relax.  Default: none.
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
    stiffness_: Matrix | None = Field(default=None, alias="stiffness")
    tension_center: Center | None = None
    shear_center: Center | None = None
    mass_center: Center | None = None
    rhoA: Inertia | None = None
    rhoI: Annotated[tuple[Inertia, Inertia, Inertia], BeforeValidator(_three)] | None = None
    law: Law | None = None
    stretch_law: AnyStretchLaw | None = None
    damping: NotNegative = 0.0
    relaxation: Relaxations = ()
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
                    f"found {numbers[0].rstrip('_')!r} together with shape = {self.shape!r}, accepted: either "
                    f"{_KEYS} or a shape with {', '.join(_MATERIAL)} and its dimensions"
                )
            self._check_shape(self.shape)
        elif outlined := self._given((*_MATERIAL, *_DIMENSIONS, "shear_factor")) or self._switched():
            raise SceneError(f"found {outlined[0]!r} without a shape, accepted: shape = {' | '.join(_OUTLINES)}")
        elif not numbers and self.stretch_law is None and not (self.law is not None and self.law.gives):
            raise SceneError(f"found nothing in it, accepted: {_KEYS} or a shape")
        if self.coupling is not None:
            self._check_coupling()
        if self.stiffness_ is not None:
            self._check_matrix(self.stiffness_)
        if self.mass_center is not None and self.rhoA is None and self.rho is None:
            raise SceneError(f"found a mass centre without a mass, accepted: with {self._of_mass}", ("mass_center",))
        if self.law is not None:
            self._check_law(self.law)
        check_relaxation(self.relaxation)
        if self.stretch_law is not None:
            self._check_stretch_law(self.stretch_law)
        return self

    def _check_stretch_law(self, law: AnyStretchLaw) -> None:
        if self.stiffness_ is not None:
            raise SceneError(
                "found beside a stiffness matrix, which has all of it, accepted: one of them", ("stretch_law",)
            )
        given = "'EA'" if self.EA is not None else "stretch = true" if self.stretch else ""
        if law.gives and given:
            message = f"found {given} beside the law {law.type!r}, which says that stiffness, accepted: one of them"
            raise SceneError(message, ("stretch_law",))
        if not law.gives and not given:
            key = "stretch = true" if self.shape is not None else "the key 'EA'"
            message = f"the law {law.type!r} begins with a stiffness, accepted: with {key}"
            raise SceneError(message, ("stretch_law",))
        if self.relaxation:
            raise SceneError("found beside 'relaxation', accepted: one of them", ("stretch_law",))
        if self.law is not None and self.law.form_in(self).strains:
            message = f"found beside the law {self.law.type!r}, which says the axial force of a section that stretches"
            raise SceneError(f"{message}, accepted: one of them", ("stretch_law",))

    def _check_law(self, law: Law) -> None:
        if self.coupling is not None:
            raise SceneError("found a law beside a coupling, accepted: one of them; a potential may couple", ("law",))
        if self.relaxation:
            raise SceneError("found a law beside 'relaxation', accepted: one of them", ("law",))
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

    @property
    def _of_mass(self) -> str:
        return "rhoA" if self.shape is None else "rho"

    def _check_matrix(self, rows: Any) -> None:
        given = [name for name in _OF_MATRIX if getattr(self, name) is not None]
        if given:
            message = f"found {given[0]!r} beside a stiffness matrix, which has all of it, accepted: one of them"
            raise SceneError(message, ("stiffness",))
        edges = np.array([0.0, *self.breaks, 1.0])
        x = np.unique(edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, SAMPLES))
        matrices = values_of(self._matrices(x))
        diagonal = np.einsum("nii->ni", matrices)
        where = ["" if self.even else f" at {place:g} of the length" for place in x]
        if (diagonal <= 0.0).any():
            n, i = (int(k) for k in np.argwhere(diagonal <= 0.0)[0])
            found = f"found {diagonal[n, i]:g} in row {i + 1}, column {i + 1}{where[n]}"
            message = f"{found}, accepted: numbers above zero on the diagonal"
            raise SceneError(message, ("stiffness",))
        unit = np.sqrt(diagonal)
        scaled = matrices / unit[:, :, None] / unit[:, None, :]
        twins = matrices.transpose(0, 2, 1)
        # Beside the diagonal as well as by themselves: what is next to nothing need not have a twin.
        apart = np.abs(matrices - twins) / np.maximum(np.maximum(np.abs(matrices), np.abs(twins)), TINY)
        apart = np.minimum(apart, np.abs(scaled - scaled.transpose(0, 2, 1)))
        if apart.max() > tolerances.WRITTEN:
            n, i, j = (int(k) for k in np.unravel_index(apart.argmax(), apart.shape))
            i, j = min(i, j), max(i, j)
            found = f"found {matrices[n, i, j]:g} in row {i + 1}, column {j + 1}, and {matrices[n, j, i]:g} in row "
            raise SceneError(f"{found}{j + 1}, column {i + 1}{where[n]}, accepted: a symmetric matrix", ("stiffness",))
        lowest = np.linalg.eigvalsh(scaled)[:, 0]
        n = int(np.argmin(lowest))
        if lowest[n] <= tolerances.RANK:
            message = (
                f"found a matrix{where[n]} whose lowest eigenvalue is {lowest[n]:.3g} where its diagonal is scaled"
            )
            raise SceneError(f"{message} to one, accepted: a positive definite matrix", ("stiffness",))

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
        found = [getattr(self, name) for name in self._given(names)] + [*(self.coupling or ()), *(self.rhoI or ())]
        centers = (self.tension_center, self.shear_center, self.mass_center)
        found += [entry for center in centers for entry in center or ()]
        return found + [entry for row in self.stiffness_ or () for entry in row]

    def leaves(self, axis: int) -> tuple[str, str] | None:
        """Key and words of what takes a member out of the plane across its axis b2 or b3, given as 2 or 3, or None."""
        if self.couples(axis):
            return "coupling", "couples bending in x-y with twist or bending out of it"
        inside = {2: (0, 2, 4), 3: (0, 1, 5)}[axis]
        if any(
            row[j] != 0.0
            for i, row in enumerate(self.stiffness_ or ())
            for j in range(6)
            if (i in inside) != (j in inside)
        ):
            return "stiffness", "couples forces and bending in x-y with others"
        for key in ("tension_center", "shear_center", "mass_center"):
            center = getattr(self, key)
            if center is not None and center[axis - 2] != 0.0:
                return key, "is not in x-y"
        return None

    def couples(self, axis: int) -> bool:
        """Whether bending about the axis b2 or b3, given as 2 or 3, is coupled with anything else."""
        others = {2: (0, 2), 3: (1, 2)}[axis]
        if self.law is not None and not self.law.stays_in_plane(axis):
            return True
        return self.coupling is not None and any(self.coupling[i] != 0.0 for i in others)

    @property
    def coupled(self) -> bool:
        """Whether the stiffness at rest is more than a diagonal of GJ, EI2 and EI3."""
        given = self.coupling is not None or self.stiffness_ is not None
        return given or (self.law is not None and self.law.type == "potential")

    @property
    def off_line(self) -> str:
        """Key of the first of its centres that is off the line, or of the matrix that says so; else empty."""
        if self.stiffness_ is not None and self.shifted:
            return "stiffness"
        return next((key for key in OFF_LINE if key != "stiffness" and getattr(self, key) is not None), "")

    @property
    def matrix(self) -> bool:
        """Whether it is given by a stiffness matrix of forces and moments."""
        return self.stiffness_ is not None

    @property
    def shifted(self) -> bool:
        """Whether bending or twist stretch or shear the centre line where no force acts: the centres are off it."""
        if self.stiffness_ is not None:
            return any(row[j] != 0.0 for row in self.stiffness_[:3] for j in range(3, 6))
        return self.tension_center is not None or self.shear_center is not None

    def missing(self, names: Iterable[str]) -> list[str]:
        """Which of the names EI2, EI3, GJ, rhoA (N m2, kg/m) this section does not define, in the order given."""
        if self.shape is None:
            known = set(self._given(_NUMBERS)) | {"rhoI"}
            known |= {"EI2", "EI3", "GJ", "EA", "GA2", "GA3"} if self.stiffness_ is not None else set()
        else:
            known = {"EI2", "EI3"}
            known |= {"GJ"} if self.sheared else set()
            known |= {"rhoA", "rhoI"} if self.rho is not None else set()
        known |= set(self.law.gives) if self.law is not None else set()
        return [name for name in names if name not in known]

    def stiffness(self, x: ArrayLike) -> Floats:
        """GJ, EI2, EI3, (n, 3) N m2, at fractions x (n,), with a law those at rest; nan where not defined."""
        if self.law is None:
            return self.own_stiffness(x)
        found = self.stiffness_matrix(x)[:, [0, 1, 2], [0, 1, 2]]
        return np.where(found == 0.0, np.nan, found)

    def own_stiffness(self, x: ArrayLike) -> Floats:
        """What :meth:`stiffness` is without the law, (n, 3), N m2, at fractions x (n,)."""
        if self.stiffness_ is not None:
            return np.stack([self._condensed(x)[:, i, i] for i in range(3)], axis=1)
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
        given = self._given(("EA", "GA2", "GA3", "stiffness_", "stretch_law")) or self._switched()
        return bool(given) or (self.law is not None and self.law.form.strains > 0)

    def compliance(self, x: ArrayLike) -> Floats:
        """Strains by section forces: x (n,) fractions of the length -> (n, 3) 1/EA, 1/GA2, 1/GA3 in 1/N.

        Along b1, b2, b3; zero where it neither stretches nor shears; with a law that at rest; of a stiffness matrix the
        diagonal of :meth:`compliance_of_forces`.
        """
        if self.stiffness_ is not None:
            found = self.compliance_of_forces(x)
            return np.stack([found[:, i, i] for i in range(3)], axis=1)
        own = self._own_compliance(x)
        if self.law is not None:
            own = self.law.yields(self, own, np.atleast_1d(numbers(x)))
        if self.stretch_law is None or not self.stretch_law.gives:
            return own
        along = evaluate(0.0, x) + 1.0 / self.stretch_law.stiffness
        return np.stack([along, own[:, 1], own[:, 2]], axis=1)

    def _own_compliance(self, x: ArrayLike) -> Floats:
        """What :meth:`compliance` is without the law of stretch."""
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

    # With a matrix [[A, B], [B^T, D]] of forces and moments the energy is, squares completed,
    #     1/2 (gamma - Q kappa).A (gamma - Q kappa) + 1/2 kappa.C kappa,   Q = -A^-1 B,   C = D - B^T A^-1 B.
    # Centres off the line are a Q of their own: with the centre at c the strain there is gamma + kappa x c.

    def compliance_of_forces(self, x: ArrayLike) -> Floats:
        """Strains by forces of a section neither bent nor twisted, (n, 3, 3) 1/N, zero where stiff, at x (n,)."""
        if self.stiffness_ is not None:
            return _inverse(self._matrices(x)[:, :3, :3])
        return self.compliance(x)[:, :, None] * np.eye(3)

    def arms(self, x: ArrayLike) -> Floats:
        """Strains of the line by changes of twist and curvatures without forces, (n, 3, 3) m, at fractions x (n,)."""
        x = np.atleast_1d(numbers(x))
        if self.stiffness_ is not None:
            whole = self._matrices(x)
            return -np.einsum("nij,njk->nik", _inverse(whole[:, :3, :3]), whole[:, :3, 3:])
        (t2, t3), (s2, s3) = (
            [evaluate(entry, x) for entry in center or (0.0, 0.0)]
            for center in (self.tension_center, self.shear_center)
        )
        nothing = np.zeros(len(x))
        rows = (nothing, -t3, t2, s3, nothing, nothing, -s2, nothing, nothing)
        return np.stack(rows, axis=1).reshape(len(x), 3, 3)

    def mass_arm(self, x: ArrayLike) -> Floats:
        """Place of the centre of mass from the centre line, (n, 3) m along b1, b2, b3, at fractions x (n,)."""
        x = np.atleast_1d(numbers(x))
        places = [evaluate(entry, x) for entry in self.mass_center or (0.0, 0.0)]
        return np.stack([np.zeros(len(x)), *places], axis=1)

    def _matrices(self, x: ArrayLike) -> Floats:
        """The stiffness matrices, (n, 6, 6)."""
        x = np.atleast_1d(numbers(x))
        entries = [evaluate(entry, x) for row in self.stiffness_ or () for entry in row]
        return np.stack(entries, axis=1).reshape(len(x), 6, 6)

    def _condensed(self, x: ArrayLike) -> Floats:
        """Moments by changes of the curvatures of a section without forces, (n, 3, 3), N m2."""
        whole = self._matrices(x)
        return whole[:, 3:, 3:] + np.einsum("nji,njk->nik", whole[:, :3, 3:], self.arms(x))

    def stiffness_matrix(self, x: ArrayLike) -> Floats:
        """Moments by changes of twist and curvatures without forces, (n, 3, 3) N m2, at x (n,); zero if not known."""
        if self.stiffness_ is not None:
            return self._condensed(x)
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
        return _inverse(self.stiffness_matrix(x))

    def fibres(self, x: ArrayLike) -> Floats:
        """Young's modulus (N/m2) and distances (m) of the outermost fibre from axes b2 and b3, (n, 3), at x (n,)."""
        half, names = {
            "rectangle": (0.5, ("width", "height")),
            "circle": (1.0, ("radius", "radius")),
            "tube": (1.0, ("outer", "outer")),
        }[self.shape or ""]
        return np.stack([self._value("E", x), *(half * self._value(name, x) for name in names)], axis=1)

    def hollow(self, x: ArrayLike) -> Floats:
        """Inner over outer radius of a tube at fractions x (n,), (n,); zero for other shapes."""
        return self._value("inner", x) / self._value("outer", x) if self.shape == "tube" else evaluate(0.0, x)

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
