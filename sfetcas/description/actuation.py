"""Actuation of members by themselves: natural curvature and twist; magnets, and the magnetic fields around them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import numbers
from .field_tables import Tabulated
from .formulas import Formula
from .records import Direction, Fraction, OnPart, Record, Turn, Vector, listed, number, say
from .sections import Quantity, Varying, breaks, evaluate

__all__ = ["ANYWHERE", "PERMEABILITY", "Actuation", "Magnet", "MagneticField"]


def _gradient(value: Any) -> tuple[tuple[float, ...], ...]:
    accepted = "three rows of three numbers: the derivatives of each component by x, y and z"
    rows = tuple(tuple(number(entry) for entry in listed(row, accepted)) for row in listed(value, accepted))
    if [len(row) for row in rows] != [3, 3, 3]:
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return rows


Gradient = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_gradient)]


class _AlongMember(OnPart):
    """What acts on a part of a member, and may vary along it by a profile."""

    if TYPE_CHECKING:  # a field of the records that follow, which say where in their order it stands
        profile: Quantity | None

        @property
        def vector(self) -> tuple[float, float, float]: ...

    def _check_along(self) -> None:
        if isinstance(self.profile, Formula) and self.profile.uses_length:
            message = f"found {self.profile.formula!r}, accepted: a formula of x, the fraction of the length"
            raise SceneError(message, ("profile",))
        self._check_part()

    @property
    def breaks(self) -> tuple[float, ...]:
        """Fractions of the length at which it begins, ends, or has a kink."""
        return (*self.part, *(() if self.profile is None else breaks(self.profile)))

    def along(self, x: ArrayLike) -> NDArray[np.float64]:
        """The vector times the profile (n, 3), section axes, at fractions x (n,) of the length, on the whole member."""
        return evaluate(1.0 if self.profile is None else self.profile, x)[:, None] * numbers(self.vector)


class Actuation(_AlongMember, Record):
    """Natural curvature and twist of a member, added to what its shape has.

    The member is free of moments where it is bent and twisted by just as much.  Chambers under pressure, heat, swelling
    and growth, and strips of two materials are given so.

    Parameters
    ----------
    member : name
        Name of the flexible member.
    value : (3,), 1/m, about b1 (twist), b2 and b3 of the sections
        What is added to the natural twist and curvature at factor 1.  One number is the curvature about b3.
    from_ : 1
        Fraction of the length where it begins.  In Python ``from_``, in files ``from``.  Default: ``0.0``.
    to : 1
        Fraction of the length where it ends.  Default: ``1.0``.
    profile : number or varying
        Factor along the member.
    history : name
        Name of a history that replaces the load factor of the step.

    Examples
    --------
    >>> Actuation(member="finger", value=3.0, from_=0.2, to=0.8).vector
    (0.0, 0.0, 3.0)
    """

    member: str
    value: Turn
    from_: Fraction = Field(default=0.0, alias="from")
    to: Fraction = 1.0
    profile: Varying | None = None
    history: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Actuation:
        self._check_along()
        return self

    @property
    def vector(self) -> tuple[float, float, float]:
        """The value with three components (3,), 1/m, about b1, b2, b3; a single number is the curvature about b3."""
        return self.value if isinstance(self.value, tuple) else (0.0, 0.0, self.value)


class MagneticField(Record):
    """A magnetic field that is given: uniform, with a constant gradient, that of a dipole, or a table.

    The magnets of the scene do not change it, and do not act on each other.

    Parameters
    ----------
    type : text
        ``uniform``; ``linear``: ``value`` at ``position``, and from there it changes by ``gradient``; ``dipole``: of
        a small magnet at ``position``, with the dipole ``moment``; ``table``: between the points of a grid;
        ``function``: any, from Python.
    value : (3,), T, fixed axes
        The field at factor 1; of a linear one at ``position``.
    gradient : (3, 3), T/m, fixed axes
        Of a linear field: derivatives of each component (rows) by x, y and z.  Symmetric and with zero trace, as of
        every field in air.
    position : (3,), m, fixed axes
        Of a linear field where it has the ``value``; of a dipole its place.  Default: the origin.
    moment : (3,), A m², fixed axes
        Of a dipole.
    table : table or file name
        Of a field of type ``table``: columns ``x``, ``y``, ``z`` (m), ``Bx``, ``By``, ``Bz`` (T), or the name of a CSV
        file that has them, in a scene file relative to its folder.
    function : callable
        In Python: place (3,), m, numbers or CasADi expressions -> field (3,), T, at factor 1.
    history : name
        Name of a history that replaces the load factor of the step.

    Examples
    --------
    >>> round(float(MagneticField(type="dipole", position=[0, 0, 0.1], moment=[0, 0, 1]).of([0, 0, 0])[2]), 9)
    0.0002
    """

    type: Literal["uniform", "linear", "dipole", "table", "function"] = "uniform"
    value: Vector | None = None
    gradient: Gradient | None = None
    position: Vector = (0.0, 0.0, 0.0)
    moment: Direction | None = None
    table: Tabulated | None = None
    function: Callable[[Any], Any] | None = None
    history: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _no_text(cls, values: Any) -> Any:
        if isinstance(values, Mapping) and values.get("function") is not None and not callable(values["function"]):
            message = f"found {say(values['function'])}, accepted: a Python function of the place"
            raise SceneError(message, ("function",))
        return values

    @model_validator(mode="after")
    def _check(self) -> MagneticField:
        needed = {"uniform": "value", "linear": "gradient", "dipole": "moment"}.get(self.type, self.type)
        taken = {"linear": ("value", "gradient", "position"), "dipole": ("moment", "position")}
        every = ("value", "gradient", "position", "moment", "table", "function")
        useless = [key for key in every if key not in taken.get(self.type, (needed,))]
        if getattr(self, needed) is None:
            raise SceneError(f"the key {needed!r} is missing: a field of type {self.type!r} needs it")
        for key in useless:
            if key in self.model_fields_set and getattr(self, key) is not None:
                raise SceneError(f"not accepted: the field is of type {self.type!r}", (key,))
        if self.gradient is not None:
            slopes = np.array(self.gradient)
            small = tolerances.WRITTEN * np.abs(slopes).max()
            if np.abs(slopes - slopes.T).max() > small or abs(np.trace(slopes)) > small:
                accepted = "a symmetric matrix with zero trace, as of every field in air"
                raise SceneError(
                    f"found {say([list(row) for row in self.gradient])}, accepted: {accepted}", ("gradient",)
                )
        if self.function is not None:
            self._called(ANYWHERE)
        return self

    def _called(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        """The field (3,), T, that the ``function`` gives at a place (3,), m.

        Raises
        ------
        SceneError
            It fails, or gives other than three numbers.
        """
        assert self.by_place is not None
        try:
            with np.errstate(all="ignore"):
                found = np.array(self.by_place(place), dtype=float).ravel()
        except SceneError as error:
            raise error.within("table") from None
        except (TypeError, ValueError, AttributeError, IndexError, ArithmeticError, NotImplementedError) as error:
            message = f"found a function that fails ({error}), accepted: {FUNCTION}"
            raise SceneError(message, ("function",)) from None
        if found.size != 3:
            raise SceneError(f"found {found.size} components, accepted: {FUNCTION}", ("function",))
        return found

    @property
    def by_place(self) -> Callable[[Any], Any] | None:
        """Place (3,), m, to field (3,), T, numbers or CasADi expressions, of a table or a function."""
        return self.table if self.table is not None else self.function

    @property
    def uniform(self) -> bool:
        """Whether it is the same everywhere, so that it exerts no forces."""
        return self.type == "uniform"

    @property
    def vector(self) -> tuple[float, float, float]:
        """Its value (3,), T, zero where none is given."""
        return self.value or (0.0, 0.0, 0.0)

    def of(self, place: ArrayLike) -> NDArray[np.float64]:
        """The field (..., 3), T, at places (..., 3), m, in the fixed axes, at factor 1."""
        apart = np.asarray(place, dtype=float) - np.array(self.position)
        if self.by_place is not None:
            return np.array([self._called(each) for each in apart.reshape(-1, 3)]).reshape(apart.shape)
        if self.type == "dipole":
            moment = np.array(self.moment)
            distance = np.linalg.norm(apart, axis=-1, keepdims=True)
            along = (apart @ moment)[..., None] / distance**2
            return np.asarray(PERMEABILITY * (3.0 * along * apart - moment) / distance**3)
        slopes = np.zeros((3, 3)) if self.gradient is None else np.array(self.gradient)
        return np.asarray(np.array(self.vector) + apart @ slopes.T)

    @property
    def size(self) -> float:
        """A magnitude, T, or of a dipole T m³."""
        if self.type == "dipole" and self.moment is not None:
            return PERMEABILITY * math.hypot(*self.moment)
        if self.table is not None:
            return self.table.largest
        if self.function is not None:
            size = float(np.linalg.norm(self._called(ANYWHERE)))
            return size if math.isfinite(size) else 0.0
        return math.hypot(*self.vector)


FUNCTION = "a function that makes three components of the place, of numbers and of CasADi expressions alike"
ANYWHERE = np.array([0.137, 0.241, 0.053])
"""A place, m, at which a function is tried."""

PERMEABILITY = 1e-7
"""Magnetic constant over 4 pi, T m/A."""


class Magnet(_AlongMember, Record):
    """A magnetised member, or a magnetic dipole at a node; it turns with what carries it.

    Parameters
    ----------
    member : name
        Name of the magnetised member, flexible or rigid.
    node : name
        Instead of a member: name of the node at which a dipole is.
    moment : (3,), A m², fixed axes of the undeformed scene
        Of a dipole at a node, with which it turns.
    moment_density : (3,), A m, along b1 (the tangent), b2 and b3 of the sections
        Of a member: magnetic moment (A m²) per metre, the magnetisation (A/m) times the area.
    from_ : 1
        Of a member: fraction of the length where it is magnetised from.  In Python ``from_``, in files ``from``.
    to : 1
        Of a member: fraction of the length where that ends.
    profile : number or varying
        Of a member: factor along it.
    """

    member: str | None = None
    node: str | None = None
    moment: Direction | None = None
    moment_density: Direction | None = None
    from_: Fraction = Field(default=0.0, alias="from")
    to: Fraction = 1.0
    profile: Varying | None = None

    @model_validator(mode="after")
    def _check(self) -> Magnet:
        if (self.member is None) == (self.node is None):
            found = "neither member nor node is given" if self.node is None else "found the keys 'member' and 'node'"
            raise SceneError(f"{found}, accepted: one of them, which carries the magnet")
        needed, other = ("moment", "moment_density") if self.member is None else ("moment_density", "moment")
        where = "at a node" if self.member is None else "along a member"
        if getattr(self, needed) is None:
            raise SceneError(f"the key {needed!r} is missing: the magnet is {where}")
        for key in (other, *(("from_", "to", "profile") if self.member is None else ())):
            if key in self.model_fields_set and getattr(self, key) is not None:
                raise SceneError(f"not accepted: the magnet is {where}", (key.rstrip("_"),))
        self._check_along()
        return self

    @property
    def vector(self) -> tuple[float, float, float]:
        """Its moment (3,), A m², or along a member moment per length, A m."""
        found = self.moment if self.member is None else self.moment_density
        assert found is not None
        return found
