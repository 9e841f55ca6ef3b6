"""Forms of the potentials of sections: their names, their numbers, and tables, without expressions.

:mod:`~sfetcas.mathematics.potentials` has the expressions.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from .arrays import Array, numbers

__all__ = ["BOTH", "CONSTANTS", "Form", "hermite_of", "monotone_slopes"]

BOTH = 0
"""Stands for the magnitude of the curvatures about b2 and b3, where 2 and 3 stand for one of them."""


@dataclass(frozen=True)
class Form:
    """A kind of potential; its numbers are data.

    Attributes
    ----------
    name : str
        ``bilinear``, ``plateau``, ``ramberg_osgood``, ``table``, ``ribbon``, ``sadowsky``, ``curve`` or ``given``; with
        memory ``sliders`` or ``superelastic``, see :mod:`~sfetcas.mathematics.hysteresis`.
    about : int
        Axis of bending: 2, 3 or :data:`BOTH`; of a ribbon the axis about which it is soft; 1 of the strain along.
    count : int
        Knots of a table, kinks of the curve of a material, parameters of a given function, fibres of what has memory.
    odd : bool
        Whether a table gives the moments of one sign of the curvature, those of the other one being opposite.
    given : str
        A given potential as CasADi writes a function into a text.
    spread : bool
        Whether fibres are spread over the section, so that curvatures about both axes strain each; else what remembers
        about both axes remembers a vector.
    strains : int
        How many strains follow the three curvatures: none, that along, or those along b1, b2 and b3.
    """

    name: str
    about: int = 3
    count: int = 0
    odd: bool = True
    given: str = ""
    spread: bool = False
    strains: int = 0

    def __str__(self) -> str:
        """A text that may be part of the name of a function."""
        digest = hashlib.sha256(self.given.encode()).hexdigest()[:16] if self.given else ""
        kind = "spread" if self.spread else "odd" if self.odd else "any"
        strained = f"strained{self.strains}" if self.strains else ""
        return f"{self.name}_{self.about}_{self.count}_{kind}{strained}{digest}"

    @property
    def arguments(self) -> int:
        """How many curvatures and strains it depends on."""
        return 3 + self.strains

    @property
    def size(self) -> int:
        """How many numbers it has; the last ones are what it remembers."""
        if self.remembers:
            # Those of the material, the reach where it stretches; weights, places, internal variables of the fibres.
            return CONSTANTS[self.name] + self.strains + (1 + self.places) * self.count + self.memory
        if self.name == "curve":
            return 2 + 2 * self.count
        return {"bilinear": 1, "plateau": 0, "ramberg_osgood": 2, "table": 3 * self.count, "ribbon": 1}.get(
            self.name, self.count
        )

    @property
    def remembers(self) -> bool:
        """Whether it has internal variables."""
        return self.name in CONSTANTS

    @property
    def variables(self) -> int:
        """Internal variables of one fibre: one number, or a vector about both axes."""
        return 2 if self.about == BOTH and not self.spread else 1

    @property
    def places(self) -> int:
        """Numbers that say where a fibre is."""
        return 2 if self.spread else 1

    @property
    def memory(self) -> int:
        """Internal variables in all."""
        return self.count * self.variables if self.remembers else 0


CONSTANTS = {"sliders": 1, "superelastic": 4}
"""Numbers of the materials with memory: hardening; transformation strain, hardening, energy and resistance."""


def monotone_slopes(x: Array, y: Array) -> Array:
    """Slopes (n,) at knots x (n,) that keep the cubics between rising values y (n,) rising; in the units of y over x.

    Source: Fritsch and Butland 1984 (doi 10.1137/0905021), as in SciPy's PCHIP.
    """
    h, slopes = np.diff(x), np.diff(y) / np.diff(x)
    if len(h) == 1:
        return numbers([slopes[0], slopes[0]])
    one, other = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    inner = (one + other) / (one / slopes[:-1] + other / slopes[1:])
    ends = []
    for i, j in ((0, 1), (-1, -2)):
        end = ((2.0 * h[i] + h[j]) * slopes[i] - h[i] * slopes[j]) / (h[i] + h[j])
        # A slope at an end keeps what rises rising, and not steeper than three times the chord.
        ends.append(np.clip(end, 1e-3 * slopes[i], 3.0 * slopes[i]))
    return numbers([ends[0], *[inner[i] for i in range(len(h) - 1)], ends[1]])


def hermite_of(x: Array, y: Array, slopes: Array) -> Array:
    """The numbers (3 n,) of a table: knots, moments and slopes, one after the other; all dimensionless."""
    return numbers(np.concatenate([x, y, slopes]))
