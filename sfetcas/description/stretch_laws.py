"""Laws of stretch: the axial force of a section from the strain along it by a potential, instead of a constant EA.

As :mod:`~sfetcas.description.laws`, of one strain instead of three curvatures: a law says its form and the numbers of
it, which are a unit of energy per length (J/m), a unit of strain and what the form needs.
"""

from __future__ import annotations

import abc
from typing import Annotated, Any, ClassVar, Literal, final

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.forms import Form
from .laws import MomentTable, check_parameters, parameters_given, signed
from .records import Numbers, Positive, Record, Sized, say

__all__ = ["ALONG", "AnyStretchLaw", "StretchBilinear", "StretchLaw", "StretchPotential", "StretchTable"]

ALONG = 1
"""Number of the strain along a section among those along b1, b2, b3."""


class StretchLaw(Record):
    """Base class of the laws of stretch."""

    type: str

    gives: ClassVar[bool] = True
    """Whether it says EA itself, so that the section must not."""

    convex: ClassVar[bool] = True
    """Whether its potential is convex at every strain."""

    @property
    @abc.abstractmethod
    def form(self) -> Form:
        """The form of its potential."""

    @abc.abstractmethod
    def values(self, stiffness: Array) -> Array:
        """Unit of energy per length (J/m), unit of strain, numbers of the form, (n, 2 + size), with ``EA`` (n,), N."""

    @property
    def stiffness(self) -> Any:
        """EA at rest, N, of a law that says it itself."""
        return None

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest strain for which it is given."""
        return -np.inf, np.inf


@final
class StretchBilinear(StretchLaw):
    """One stiffness EA up to a force, of either sign, and a share of it beyond.

    It is a potential: unloading goes back the same way.

    Parameters
    ----------
    force : N
        Axial force at which the stiffness changes.
    ratio : 1
        Stiffness beyond over that before, above zero.
    """

    gives: ClassVar[bool] = False

    type: Literal["bilinear"] = "bilinear"
    force: Sized
    ratio: Positive

    @property
    def form(self) -> Form:
        """One number, the ratio."""
        return Form("bilinear", ALONG)

    def values(self, stiffness: Array) -> Array:
        """In units of the strain at the force."""
        ones = np.ones(len(stiffness))
        return np.stack([self.force**2 / stiffness, self.force / stiffness, self.ratio * ones], axis=1)


@final
class StretchTable(StretchLaw):
    """Axial forces at given strains, with smooth monotone cubics between; ``EA`` is its slope at zero.

    Parameters
    ----------
    strain : (m,)
        Strains, rising: from 0 on, where forces of the other sign are opposite, or of both signs with 0 among them.
    force : (m,), N
        The forces there, rising, 0 at 0.
    """

    type: Literal["table"] = "table"
    strain: Numbers
    force: Numbers

    @model_validator(mode="after")
    def _monotone(self) -> StretchTable:
        signed(self.strain, self.force, ("strain", "force"))
        return self

    @property
    def _table(self) -> MomentTable:
        # What is a moment over the curvature there is a force over the strain here.
        return MomentTable.model_construct(curvature=self.strain, moment=self.force, about="b3")

    @property
    def form(self) -> Form:
        """Knots, forces and slopes."""
        return Form("table", ALONG, len(self.strain), values_of(self.strain[0]) == 0.0)

    def values(self, stiffness: Array) -> Array:
        """In units of the largest strain and force."""
        return self._table.values(None, np.zeros(len(stiffness)))

    @property
    def stiffness(self) -> Any:
        """The slope at zero."""
        return self._table.stiffness(None, numbers(np.zeros((1, 3, 3))), np.zeros(1))[0, 2, 2]

    @property
    def span(self) -> tuple[float, float]:
        """From the first to the last knot."""
        return self._table.span


def _potential(value: Any) -> str:
    from ..mathematics.potentials import text_of

    accepted = "a function of the strain that gives one number, J/m"
    try:
        return text_of(value, 1)
    except ValueError as error:
        raise ValueError(f"found {error.args[0] or say(value)}, accepted: {accepted}") from None


@final
class StretchPotential(StretchLaw):
    """Any potential per length of the strain along a section; ``EA`` is its second derivative at rest.

    Parameters
    ----------
    potential : function
        Energy per length, J/m, as a CasADi ``Function`` of the strain, or of it and the parameters; or a Python
        function that makes an expression of them.  In a file: the text that ``serialize()`` gives.
    parameters : (m,)
        Numbers that the function takes as its second argument, in their own units.  Default: none.
    """

    convex: ClassVar[bool] = False

    type: Literal["potential"] = "potential"
    potential: Annotated[str, BeforeValidator(_potential)]
    parameters: Annotated[tuple[float, ...], BeforeValidator(parameters_given)] = ()

    @model_validator(mode="after")
    def _sound(self) -> StretchPotential:
        check_parameters(self.parameters, self._wanted)
        force, stiffness = (float(values_of(part).ravel()[0]) for part in self._at_rest())
        if not np.isfinite([force, stiffness]).all():
            raise SceneError("found one that has no two derivatives at rest, accepted: a smooth one", ("potential",))
        if stiffness <= 0.0:
            found = f"found a second derivative of {stiffness:g} N at strain 0"
            raise SceneError(f"{found}, accepted: a potential that is convex there", ("potential",))
        if abs(force) > tolerances.DECIMAL * stiffness:
            raise SceneError(f"found a force of {force:g} N at strain 0, accepted: none", ("potential",))
        return self

    @property
    def _wanted(self) -> int:
        from ..mathematics.potentials import parameters_of

        return parameters_of(self.potential)

    @property
    def form(self) -> Form:
        """The function, its parameters as numbers."""
        return Form("given", ALONG, self._wanted, given=self.potential)

    def _padded(self) -> Array:
        given = numbers(list(self.parameters))
        return numbers(np.concatenate([given, np.zeros(self._wanted - len(self.parameters))]))

    def _at_rest(self) -> tuple[Array, Array]:
        """Force (1,), N, and stiffness (1, 1), N, at rest."""
        from ..mathematics.potentials import at_rest

        return at_rest(self.potential, self._padded())

    def values(self, stiffness: Array) -> Array:
        """In SI units."""
        row = np.concatenate([np.ones(2), self._padded()])
        return numbers(np.broadcast_to(row, (len(stiffness), row.shape[0])))

    @property
    def stiffness(self) -> Any:
        """The second derivative at rest."""
        return self._at_rest()[1][0, 0]


AnyStretchLaw = Annotated[StretchBilinear | StretchTable | StretchPotential, Field(discriminator="type")]
"""A law of stretch, told apart by its ``type``."""
