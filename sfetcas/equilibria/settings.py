"""Settings of :func:`sfetcas.solve`: accuracy, mesh, solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from ..description.records import say, unknown
from ..description.showing import made
from ..description.task import Analysis, checked_accuracy
from ..errors import SceneError
from ..mathematics.core import core
from ..mathematics.kernels import Kernels
from ..mechanics.elements import ELEMENTS
from .single import SolverName

__all__ = ["Settings", "settings_with"]


@dataclass(frozen=True)
class Settings:
    """Settings of a solve; each has a default.

    Attributes
    ----------
    accuracy : float or None
        Wanted error of the positions over the size of the scene; None takes that of the scene.
    accuracy_of : str or None
        Name of the quantity that the accuracy refers to instead of the positions, as ``reactions.A.moment`` or
        ``members.beam.moment at 0.5``; None takes that of the scene.
    element, elements : str, int or None
        Element type of all flexible members, ``SFET2`` to ``SFET9``, and number of elements of each; None takes those
        of the members, or chooses by the accuracy.
    gauss : bool
        Integrate at Gauss points of the normalised interpolation instead of at the nodes of the elements.
    assembly : str
        ``closing`` (unknowns are rotations), ``nodal`` (and displacements of nodes), or ``auto``.
    branch : bool
        Follow the loads from zero, so that the answer is on the branch that they lead to.
    solver : str
        ``ipopt``; or ``newton``: globalised Newton's method, which is faster, and IPOPT where that fails.
    kernels : str
        How equations are evaluated: by the ``core`` in C, or in Python with element functions ``compiled`` to C or
        ``interpreted`` by CasADi; ``auto``: by the core if there is one, else compiled where that pays.
    runs : int or None
        Largest number of Newton runs of a search for several equilibria, for each factor; None chooses by the size.
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

    def __repr__(self) -> str:
        return made(self)

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
        if self.kernels not in ("auto", "core", "compiled", "interpreted"):
            raise SceneError(f"kernels: found {self.kernels!r}, accepted: auto, core, compiled, interpreted")
        if self.kernels == "core" and core() is None:
            accepted = "auto, or an installation of sfetcas where there is a C compiler"
            raise SceneError(f"kernels: found 'core', and there is none here, accepted: {accepted}")
        if self.assembly not in ("auto", "closing", "nodal"):
            raise SceneError(f"assembly: found {self.assembly!r}, accepted: auto, closing, nodal")


def settings_with(settings: Settings | None, changes: Mapping[str, Any]) -> Settings:
    """The settings, or the default ones, with other values of some.

    Raises
    ------
    SceneError
        Something that is no settings, or no setting of this name.
    """
    if settings is not None and not isinstance(settings, Settings):
        raise SceneError(f"settings: found {say(settings)}, accepted: Settings(...), or keywords, as accuracy=1e-8")
    known = [field.name for field in fields(Settings)]
    for name in changes:
        if name in known:
            continue
        if name in Analysis.model_fields:
            accepted = f"in the scene, as scene.replace({{'analysis.{name}': ...}})"
            raise SceneError(f"found {name!r}, a key of the analysis, accepted: {accepted}", ("settings",))
        raise SceneError(unknown(name, known), ("settings",))
    return replace(settings or Settings(), **changes)
