"""Time integration methods with stages: how rates at the stages of a step depend on the quantities there.

A method is data and two formulas; a step is put together from them by :mod:`~sfetcas.dynamics.steps`.  All methods take
the equations in their index-3 form: constraints hold at every stage, and internal forces are their multipliers.

Source: Chung and Hulbert 1993, Arnold and Bruls 2007 (generalised-alpha of index 3, doi 10.1007/s11044-007-9084-0);
Hairer and Wanner, Solving Ordinary Differential Equations II, IV.5 and VII (Radau IIA).
"""

from __future__ import annotations

import abc
import functools
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.interpolation import integration
from .stages import StageEquations

__all__ = ["RADAU", "Begin", "GeneralisedAlpha", "Method", "Radau", "Relations", "StageMethod"]


@dataclass(frozen=True)
class Relations:
    """Rates at the stages as functions of the quantities there: ``X' = (X - X_0) C^T + v``, ``X'' = (X - X_0) B^T +
    a``.

    Attributes
    ----------
    C, B : MX (stages, stages)
    v, a : MX (quantities, stages)
    """

    C: ca.MX
    B: ca.MX
    v: ca.MX
    a: ca.MX


class Method(abc.ABC):
    """Base class of integration methods; :mod:`~sfetcas.dynamics.steps` makes a time step of it.

    Attributes
    ----------
    name : str
    order : int
        Order of convergence of the positions.
    places : ndarray (stages,)
        Positions of the stages in the step, as fractions of its length; the last one is 1.
    loaded : ndarray
        Fractions of the step at which loads and motions are evaluated; those of the stages come last.
    kept : int
        Number of rates that are passed from step to step: the velocity first.
    gain : float
        Steps chosen by the error of ``(gain accuracy)**(order of that error / order)`` give some three times the
        accuracy at the end (measured): what a finer run, which follows, confirms.
    polished : bool
        Whether one more iteration follows when Newton's method has converged, as conservation of energy needs.
    """

    name: str
    order: int
    places: Array
    loaded: Array
    kept: int
    gain: float = 3.0
    polished: bool = False

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.places)

    @abc.abstractmethod
    def iteration(self, system: StageEquations) -> ca.Function:
        """One Newton iteration as a function ``(q, y, lam, constants...) -> (q, y, lam, size)``.

        q (components, rotations * stages), y and lam with a column for each stage; ``size`` is the largest rotation or
        displacement by which anything changed.
        """

    @abc.abstractmethod
    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """The further arguments of :meth:`iteration`; h is the step, factors (groups, loaded) multiply the loads."""

    @abc.abstractmethod
    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """Rates (quantities, kept) after a step in which the quantities moved by ``X - X_0`` (quantities, stages)."""


@dataclass(frozen=True)
class Begin:
    """State at the begin of a step: rotations, displacements, quantities, rates (quantities, kept), angles."""

    q: ca.MX
    y: ca.MX
    x: ca.MX
    rates: ca.MX
    unwrapped: ca.MX


class StageMethod(Method):
    """A method that is given by its :class:`Relations` alone."""

    @abc.abstractmethod
    def relations(self, h: ca.MX, rates: ca.MX) -> Relations:
        """The relations in a step of length h after rates (quantities, kept)."""

    def iteration(self, system: StageEquations) -> ca.Function:
        """The Newton iteration of the stage equations, as of :meth:`Method.iteration`."""
        return system.iteration(self.stages)

    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """The relations, and the factors of the loads."""
        given = self.relations(h, begin.rates)
        return [begin.x, given.v, given.a, given.C, given.B, factors, begin.unwrapped]


@final
class Radau(StageMethod):
    """Radau IIA collocation with two or three stages: order 3 or 5, L-stable."""

    kept = 1

    def __init__(self, stages: int) -> None:
        self.name, self.order = f"radau-{stages}", 2 * stages - 1
        self.places = self.loaded = RADAU[stages]
        self.gain = 3.0 if stages == 2 else 20.0

    @functools.cached_property
    def _inverse(self) -> Array:
        """Inverse of the matrix of the method: derivatives at the stages over the length of the step."""
        return np.asarray(np.linalg.inv(integration(self.places, self.places)))

    def relations(self, h: ca.MX, rates: ca.MX) -> Relations:
        """Derivatives of the collocation polynomials at the stages."""
        slopes = ca.DM(self._inverse)
        ones = ca.DM.ones(1, self.stages)
        first = ca.DM(self._inverse.sum(axis=1))
        velocity = rates[:, 0]
        return Relations(
            C=slopes / h,
            B=ca.DM(self._inverse @ self._inverse) / h**2,
            v=ca.MX.zeros(velocity.shape[0], self.stages),
            a=-ca.mtimes(velocity, first.T * ones) / h,
        )

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """The velocity at the last stage."""
        return ca.mtimes(moved, ca.DM(self._inverse[-1])) / h


RADAU = {
    2: np.array([1.0 / 3.0, 1.0]),
    3: np.array([(4.0 - np.sqrt(6.0)) / 10.0, (4.0 + np.sqrt(6.0)) / 10.0, 1.0]),
}
"""Places of the stages."""


@final
class GeneralisedAlpha(StageMethod):
    """Generalised-alpha: order 2, one stage; ``damping`` is the spectral radius at infinite frequency, from 0 to 1."""

    kept = 3
    order = 2
    places = loaded = np.array([1.0])
    name = "generalised-alpha"

    def __init__(self, damping: float = 0.9) -> None:
        self.of_mass, self.of_force = (2.0 * damping - 1.0) / (damping + 1.0), damping / (damping + 1.0)
        self.gamma = 0.5 + self.of_force - self.of_mass
        self.beta = 0.25 * (self.gamma + 0.5) ** 2

    def relations(self, h: ca.MX, rates: ca.MX) -> Relations:
        """Newmark's formulas with the auxiliary, acceleration-like variable of the method."""
        velocity, lagging, true = ca.horzsplit(rates)
        first = -velocity / (self.beta * h) - (0.5 / self.beta - 1.0) * lagging
        share = (1.0 - self.of_mass) / (1.0 - self.of_force)
        rest = (self.of_mass * lagging - self.of_force * true) / (1.0 - self.of_force)
        return Relations(
            C=self.gamma / (self.beta * h),
            B=share / (self.beta * h**2),
            v=velocity + h * ((1.0 - self.gamma) * lagging + self.gamma * first),
            a=share * first + rest,
        )

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """Velocity, auxiliary acceleration-like variable, and true acceleration."""
        velocity, lagging, _ = ca.horzsplit(rates)
        now = self.relations(h, rates)
        true = now.B * moved + now.a
        follows = (moved - h * velocity) / (self.beta * h**2) - (0.5 / self.beta - 1.0) * lagging
        return ca.horzcat(now.C * moved + now.v, follows, true)
