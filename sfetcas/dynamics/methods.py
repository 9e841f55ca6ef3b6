"""Time integration methods with stages: how rates at the stages of a step depend on the quantities there.

A method is a table of numbers, or a formula of its own; a step is put together from it by
:mod:`~sfetcas.dynamics.steps`.  All methods take the equations in their index-3 form: constraints hold at every stage,
and internal forces are their multipliers.

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

from ..mathematics.arrays import Array, Index
from ..mathematics.interpolation import integration
from .stages import StageEquations

__all__ = ["RADAU", "Begin", "GeneralisedAlpha", "Method", "Radau", "Relations", "StageMethod"]


@dataclass(frozen=True, eq=False)
class Relations:
    """What quantities and their rates have to do with each other in a step, as numbers of a method.

    With what the quantities have moved by at the stages, ``X - X_0``, and the rates ``r_k`` that are kept from step to
    step, scaled by powers of its length, ``h^p_k r_k``, each of

        h X' = velocity (X - X_0) + velocity_kept r,      h^2 X'' = acceleration (X - X_0) + acceleration_kept r

    at the stages, and the next ``r = after (X - X_0) + after_kept r``, is linear with the same numbers in all steps.

    Attributes
    ----------
    velocity, acceleration : ndarray (stages, stages)
    velocity_kept, acceleration_kept : ndarray (stages, kept)
    after : ndarray (kept, stages)
    after_kept : ndarray (kept, kept)
    powers : ndarray (kept,)
        1 for velocities, 2 for accelerations.
    """

    velocity: Array
    acceleration: Array
    after: Array
    velocity_kept: Array
    acceleration_kept: Array
    after_kept: Array
    powers: Index


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
    acceleration : int
        Which of these is the acceleration that the equations have at the end of the step; 0 if none.
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
    acceleration: int = 0
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

    @property
    @abc.abstractmethod
    def relations(self) -> Relations:
        """Its numbers."""

    def iteration(self, system: StageEquations) -> ca.Function:
        """The Newton iteration of the stage equations, as of :meth:`Method.iteration`."""
        return system.iteration(self.stages)

    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """The relations, and the factors of the loads."""
        given, scaled = self.relations, self._scaled(h, begin.rates)
        v = ca.mtimes(scaled, ca.DM(given.velocity_kept.T)) / h
        a = ca.mtimes(scaled, ca.DM(given.acceleration_kept.T)) / h**2
        c, b = ca.DM(given.velocity) / h, ca.DM(given.acceleration) / h**2
        return [begin.x, v, a, c, b, factors, begin.unwrapped]

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """The rates that are kept, as of :meth:`Method.after`."""
        given = self.relations
        found = ca.mtimes(moved, ca.DM(given.after.T))
        if given.after_kept.any():
            found += ca.mtimes(self._scaled(h, rates), ca.DM(given.after_kept.T))
        return ca.horzcat(*(one / h**p for one, p in zip(ca.horzsplit(found), given.powers.tolist(), strict=True)))

    def _scaled(self, h: ca.MX, rates: ca.MX) -> ca.MX:
        powers = self.relations.powers.tolist()
        return ca.horzcat(*(one * h**p for one, p in zip(ca.horzsplit(rates), powers, strict=True)))


@final
class Radau(StageMethod):
    """Radau IIA collocation with two or three stages: order 3 or 5, L-stable.

    With ``accelerating`` the acceleration at the end of a step is kept beside the velocity: no step needs it, but what
    tells forces does.
    """

    def __init__(self, stages: int, *, accelerating: bool = False) -> None:
        self.name, self.order = f"radau-{stages}", 2 * stages - 1
        self.places = self.loaded = RADAU[stages]
        self.gain = 3.0 if stages == 2 else 20.0
        self.acceleration = int(accelerating)
        self.kept = 1 + self.acceleration

    @functools.cached_property
    def relations(self) -> Relations:
        """Derivatives of the collocation polynomials at the stages."""
        slopes, kept = np.linalg.inv(integration(self.places, self.places)), self.kept
        # The polynomials of X are those of X - X_0; the polynomials of X' have the velocity at the begin.
        second, begun = slopes @ slopes, np.zeros((self.stages, kept))
        begun[:, 0] = -slopes.sum(axis=1)
        return Relations(
            velocity=slopes,
            acceleration=second,
            after=np.stack([slopes[-1], second[-1]])[:kept],
            velocity_kept=np.zeros((self.stages, kept)),
            acceleration_kept=begun,
            after_kept=np.stack([np.zeros(kept), begun[-1]])[:kept],
            powers=np.array([1, 2])[:kept],
        )


RADAU = {
    2: np.array([1.0 / 3.0, 1.0]),
    3: np.array([(4.0 - np.sqrt(6.0)) / 10.0, (4.0 + np.sqrt(6.0)) / 10.0, 1.0]),
}
"""Places of the stages."""


@final
class GeneralisedAlpha(StageMethod):
    """Generalised-alpha: order 2, one stage; ``damping`` is the spectral radius at infinite frequency, from 0 to 1."""

    kept = 3
    acceleration = 2
    order = 2
    places = loaded = np.array([1.0])
    name = "generalised-alpha"

    def __init__(self, damping: float = 0.9) -> None:
        self.of_mass, self.of_force = (2.0 * damping - 1.0) / (damping + 1.0), damping / (damping + 1.0)
        self.gamma = 0.5 + self.of_force - self.of_mass
        self.beta = 0.25 * (self.gamma + 0.5) ** 2

    @functools.cached_property
    def relations(self) -> Relations:
        """Newmark's formulas with the auxiliary, acceleration-like variable of the method."""
        # Velocity, auxiliary variable, true acceleration.
        first = np.array([-1.0 / self.beta, 1.0 - 0.5 / self.beta, 0.0])
        share = (1.0 - self.of_mass) / (1.0 - self.of_force)
        rest = np.array([0.0, self.of_mass, -self.of_force]) / (1.0 - self.of_force)
        velocity = np.array([1.0, 1.0 - self.gamma, 0.0]) + self.gamma * first
        moved = np.array([[self.gamma], [1.0], [share]]) / self.beta
        kept = np.stack([velocity, first, share * first + rest])
        return Relations(
            velocity=moved[:1],
            acceleration=moved[2:],
            after=moved,
            velocity_kept=kept[:1],
            acceleration_kept=kept[2:],
            after_kept=kept,
            powers=np.array([1, 2, 2]),
        )
