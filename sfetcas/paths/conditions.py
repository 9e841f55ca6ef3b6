"""What is one-sided along a path, and the choices of what of it acts.

Strings that may be slack, stops of springs, and places where members touch: while a choice holds, a scene is a model
like any other.  Each condition has a margin, dimensionless, that is above zero while the choice holds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from ..description.scene import Scene
from ..equilibria.stops import settled
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.fields import Fields, transferred
from ..mechanics.margins import margins
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.unilateral import Stops, Unilateral, switched_over, unilaterals
from ..solvers.arclength import Curve, Standing
from ..solvers.beginning import begin_path
from ..solvers.prepared import Prepared
from .lying import Lying, Piece

__all__ = ["NEAR", "Begun", "Choice", "Conditions", "Stopping", "Way"]

NEAR = 1e-7
"""Margins that are as small have to be asked how they go on."""

Begun = tuple[Curve, Standing, tuple[str, ...]]
"""The first point of a path, its curve, and notes."""


class Choice(NamedTuple):
    """What acts: a mesh with it has a model.

    Attributes
    ----------
    stops : tuple of (str, str)
        As of :class:`~sfetcas.mechanics.mesh.Mesh`.
    points : tuple of ContactPoint
        Where members touch each other or obstacles.
    """

    stops: Stops = ()
    points: tuple[ContactPoint, ...] = ()

    @classmethod
    def of(cls, mesh: Mesh) -> Choice:
        """That of a mesh."""
        return cls(mesh.stops, mesh.points)

    @property
    def kind(self) -> tuple[object, ...]:
        """What is the same wherever along members the points have begun."""
        return self.stops, tuple(sorted((p.contact, p.members, p.slides) for p in self.points))


@dataclass(frozen=True, eq=False)
class Way:
    """A way on from a point.

    Attributes
    ----------
    which : tuple
        Conditions that are switched over.
    choice : Choice
        What acts then.
    curve : Curve
        Its curve.
    standing : Standing
        The point on it, its tangent ahead.
    """

    which: tuple[Any, ...]
    choice: Choice
    curve: Curve
    standing: Standing


One = TypeVar("One")
"""One condition."""


class Conditions(ABC, Generic[One]):
    """All conditions of a scene."""

    kinds: ClassVar[str]
    """What they are, in a sentence."""

    choosing: ClassVar[str]
    """What a choice says, in a sentence."""

    remembers: ClassVar[bool] = False
    """Whether each point remembers the one before it, so that all of a path is followed by what :meth:`lying` gives."""

    @property
    @abstractmethod
    def any(self) -> bool:
        """Whether there is one."""

    @abstractmethod
    def begin(self, prepared: Callable[[Choice], Prepared], span: tuple[float, float], first: Choice) -> Begun:
        """The first point of a path, in a choice in which no margin is below zero.

        Parameters
        ----------
        prepared : callable
            The model of a choice.
        span : (low, high)
            Range of factors.
        first : Choice
            The search begins with it.

        Raises
        ------
        SolveError
            There is none.
        """

    @abstractmethod
    def watched(self, fields: Fields) -> Array:
        """Margins (n,) at a state; as many at each in one choice."""

    @abstractmethod
    def near(self, fields: Fields, crossed: Sequence[int] = ()) -> list[One]:
        """The conditions without a margin at a state, and those with the numbers of some of what is watched."""

    @abstractmethod
    def margin(self, fields: Fields, which: Sequence[One]) -> Array:
        """Margins (n,) of some conditions at a state, each in the choice of its mesh."""

    @abstractmethod
    def where(self, one: One) -> str:
        """Where it stands in the scene."""

    @abstractmethod
    def active(self, one: One, fields: Fields) -> bool:
        """Whether it acts as a constraint at a state."""

    @abstractmethod
    def becomes(self, one: One, fields: Fields) -> str:
        """What happens to it where it is switched at a state, a sentence."""

    @abstractmethod
    def told(self, one: One, choice: Choice) -> str:
        """What it is in a choice, in a sentence."""

    @abstractmethod
    def switched(self, fields: Fields, which: Sequence[One]) -> Choice | None:
        """The choice in which some are switched over; None where these exclude each other."""

    def convex(self, which: Sequence[One]) -> bool:
        """Whether a strict minimum leaves one way at most on which any of these may change."""
        return True

    def refused(self, fields: Fields, near: Sequence[One]) -> str:
        """Why a path does not go on beyond a state, a sentence; empty where it may."""
        return ""

    def flat(self, fields: Fields, near: Sequence[One] = ()) -> list[ContactPoint]:
        """Places at a state at which members begin to lie along obstacles, also where some conditions change."""
        return []

    def flats(self, fields: Fields) -> tuple[int, ...]:
        """Numbers of what is watched that say where what touches at places begins to lie along something."""
        return ()

    def may_be_flat(self, fields: Fields) -> bool:
        """Whether :meth:`flat` may be another one where elements end at places."""
        return False

    def lying(self, mesh: Mesh, span: tuple[float, float], piece: Piece, finer: float) -> Lying | None:
        """What follows a path where members lie along obstacles, on a mesh; None where none can.

        Parameters
        ----------
        mesh : Mesh
        span : (low, high)
            Range of factors.
        piece, finer
            As of :class:`~sfetcas.paths.lying.Lying`.
        """
        return None

    def made(self, prepared: Prepared) -> Prepared:
        """A model of one choice as the path needs it."""
        return prepared

    def carried(self, at: Standing, prepared: Prepared) -> State:
        """A state in the model of another choice."""
        return transferred(at.model, at.state, prepared.model)

    def onward(
        self, way: Way, curve: Callable[[Choice], Curve], span: tuple[float, float]
    ) -> tuple[Curve, Standing] | None:
        """The curve and the first point on it beyond a change; None where those of the way itself are these."""
        return None

    def fitted(self, mesh: Mesh, fields: Fields) -> Mesh:
        """The mesh with elements that end where something acts at a state; itself where they need not."""
        return mesh

    def passed(self, before: Standing, after: Standing) -> bool:
        """Whether something has passed through something else from one point to the next."""
        return False


class Stopping(Conditions[Unilateral]):
    """Tendons that may be slack, and stops of springs.

    Parameters
    ----------
    scene : Scene
    """

    kinds, choosing = "tendons and stops", "what is taut and at a stop"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.all = scene, unilaterals(scene)

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return bool(self.all)

    def begin(self, prepared: Callable[[Choice], Prepared], span: tuple[float, float], first: Choice) -> Begun:
        """As of :class:`Conditions`."""
        found: dict[Stops, Begun] = {}

        def answer(stops: Stops) -> Mapping[Unilateral, float]:
            found[stops] = begin_path(prepared(Choice(stops)), span)
            return margins(found[stops][1].fields)

        return found[settled(self.scene, answer, first.stops)]

    def watched(self, fields: Fields) -> Array:
        """As of :class:`Conditions`."""
        return np.array(list(margins(fields).values()))

    def near(self, fields: Fields, crossed: Sequence[int] = ()) -> list[Unilateral]:
        """As of :class:`Conditions`."""
        close = [one for one, margin in margins(fields).items() if abs(margin) <= NEAR]
        return list(dict.fromkeys([*(self.all[i] for i in crossed), *close]))

    def margin(self, fields: Fields, which: Sequence[Unilateral]) -> Array:
        """As of :class:`Conditions`."""
        found = margins(fields)
        return np.array([found[one] for one in which])

    def where(self, one: Unilateral) -> str:
        """As of :class:`Conditions`."""
        return one.where

    def active(self, one: Unilateral, fields: Fields) -> bool:
        """As of :class:`Conditions`."""
        return one.active(fields.model.mesh.stops)

    def becomes(self, one: Unilateral, fields: Fields) -> str:
        """As of :class:`Conditions`."""
        return one.becomes(fields.model.mesh.stops)

    def told(self, one: Unilateral, choice: Choice) -> str:
        """As of :class:`Conditions`."""
        return one.is_told(choice.stops)

    def switched(self, fields: Fields, which: Sequence[Unilateral]) -> Choice | None:
        """As of :class:`Conditions`."""
        return Choice(switched_over(fields.model.mesh.stops, which))
