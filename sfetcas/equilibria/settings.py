"""How to solve: what a run of statics may be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..description.task import checked_accuracy
from ..errors import SceneError
from ..mathematics.kernels import Kernels
from ..mechanics.elements import ELEMENTS
from .single import SolverName

__all__ = ["Settings"]


@dataclass(frozen=True)
class Settings:
    """How to solve; everything has a default that suits.

    Attributes
    ----------
    accuracy : float or None
        Wanted error of the positions over the size of the scene; None takes that of the scene.
    accuracy_of : str or None
        A quantity that this is meant of instead of the positions, as ``reactions.A.moment`` or
        ``members.beam.moment at 0.5``; None takes that of the scene.
    element, elements : str, int or None
        Element of all members and number of elements of each; None takes those of the members, or chooses.
    gauss : bool
        Gauss integration with the norm divided out instead of integration at the nodes.
    assembly : str
        ``auto``, ``closing`` or ``nodal``.
    branch : bool
        Check the branch by following the loads from zero.
    solver : str
        ``ipopt``, or ``newton``: Newton's method from afar, which is faster, and IPOPT where that finds nothing.
    kernels : str
        Element functions: ``auto`` compiles them where that pays in one run, ``compiled``, ``interpreted``.
    runs : int or None
        Newton runs at most in a search for several equilibria, for each factor; None takes what suits the size.
    """

    accuracy: float | None = None
    accuracy_of: str | None = None
    element: str | None = None
    elements: int | None = None
    gauss: bool = False
    assembly: Literal["auto", "closing", "nodal"] = "auto"
    branch: bool = True
    solver: SolverName = "ipopt"
    kernels: Kernels = "auto"
    runs: int | None = None

    def __post_init__(self) -> None:
        if self.accuracy is not None:
            try:
                checked_accuracy(self.accuracy)
            except ValueError as error:
                raise SceneError(str(error), ("accuracy",)) from None
        if self.element is not None and self.element not in ELEMENTS:
            raise SceneError(f"element: found {self.element!r}, accepted: {', '.join(ELEMENTS)}")
        if self.elements is not None and not 1 <= self.elements <= 1_000_000:
            raise SceneError(f"elements: found {self.elements}, accepted: 1 to 1000000")
        if self.runs is not None and not 0 <= self.runs <= 1_000_000:
            raise SceneError(f"runs: found {self.runs}, accepted: 0 to 1000000")
        if self.solver not in ("ipopt", "newton"):
            raise SceneError(f"solver: found {self.solver!r}, accepted: ipopt, newton")
        if self.kernels not in ("auto", "compiled", "interpreted"):
            raise SceneError(f"kernels: found {self.kernels!r}, accepted: auto, compiled, interpreted")
        if self.assembly not in ("auto", "closing", "nodal"):
            raise SceneError(f"assembly: found {self.assembly!r}, accepted: auto, closing, nodal")
