"""Ways to solve one scene: discretisations and what else is chosen, and the families of them that are worth a run.

A family is one element, quadrature and integrator in time, on finer and finer meshes; it ends where finer ones gain
nothing.  Assembly, solver, kernels and dimension are tried on the cheapest members of the families only: their effects
multiply, and nothing is learnt from all products.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from ..description.records import counted
from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..mathematics.core import core
from ..mathematics.kernels import Kernels
from ..mechanics.elements import ELEMENTS

__all__ = ["Variant", "by_accuracy", "families", "other_ways"]

COUNTS = (1, 2, 4, 8, 16, 32, 64, 128)
"""Elements of each member, one mesh after the other."""

MOST_UNKNOWNS = 6000
"""Elements of a net times members that are still run."""

FEW_STEPS = 25
"""Steps in time of the coarsest run; each finer one has twice as many."""

STEPPERS = ("radau-3", "radau-2", "generalised-alpha", "conserving")
"""Integrators that take a step that is prescribed."""

MOVING = ("SFET3", "SFET5", "SFET7")
"""Elements of motions: what lies between gives what lies between."""

MOVING_COUNTS = (2, 4, 8, 16)

MOST_STEPS = 12_800

ACCURACIES = {"static": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10), "dynamic": (1e-2, 1e-3, 1e-4, 1e-5)}
"""Accuracies that are asked for, by the type of the analysis; of others those of statics."""


@dataclass(frozen=True)
class Variant:
    """One way to solve a scene.

    Attributes
    ----------
    element : str
        SFET2 to SFET9; empty: chosen by the ``accuracy``.
    elements : int or None
        Of each member.
    integration : str
        ``nodes`` or ``gauss``.
    assembly, solver, kernels : str
        As in :class:`~sfetcas.equilibria.settings.Settings`.
    dimension : str
        ``plane`` or ``space``; empty: that of the scene.
    integrator : str
        Of a motion.
    steps : int or None
        Steps in time of a motion.
    accuracy : float or None
        Where the library chooses.
    core : bool
        Whether equations are evaluated and solved by the core in C, where there is one.
    """

    element: str = ""
    elements: int | None = None
    integration: Literal["nodes", "gauss"] = "nodes"
    assembly: Literal["auto", "closing", "nodal"] = "auto"
    solver: Literal["ipopt", "newton"] = "ipopt"
    kernels: Kernels = "auto"
    dimension: str = ""
    integrator: str = ""
    steps: int | None = None
    accuracy: float | None = None
    core: bool = True

    def settings(self) -> Settings:
        """The settings for :func:`sfetcas.solve`."""
        return Settings(
            accuracy=self.accuracy,
            element=self.element or None,
            elements=self.elements,
            gauss=self.integration == "gauss",
            assembly=self.assembly,
            solver=self.solver,
            kernels=self.kernels,
        )

    def scene(self, scene: Scene) -> Scene:
        """The scene without what it says itself of elements and steps."""
        members = {
            name: member.model_copy(update={"element": None, "elements": None})
            for name, member in scene.members.items()
        }
        update: dict[str, Any] = {}
        if scene.analysis.type == "dynamic":
            update["step"] = scene.analysis.duration / self.steps if self.steps else None
            update["integrator"] = self.integrator or scene.analysis.integrator
        analysis = scene.analysis.model_copy(update=update)
        # What is validated anew tells a mistake by its sentence.
        changes: dict[str, Any] = {"members": members, "analysis": analysis}
        return scene.replace(**changes, **({"dimension": self.dimension} if self.dimension else {}))

    @property
    def chosen(self) -> bool:
        """Whether the library chooses the mesh by the accuracy."""
        return self.accuracy is not None

    @property
    def name(self) -> str:
        """In words, short enough for a table."""
        parts = [f"accuracy {self.accuracy:.0e}"] if self.accuracy is not None else []
        if self.element:
            parts.append(f"{self.element} x {self.elements}")
        parts += [self.integrator] if self.integrator else []
        parts += [counted(self.steps, "step")] if self.steps else []
        parts += ["gauss"] if self.integration == "gauss" else []
        parts += [self.assembly] if self.assembly != "auto" else []
        parts += [self.solver] if self.solver != "ipopt" else []
        parts += [self.kernels] if self.kernels != "auto" else []
        parts += ["without the core"] if not self.core else []
        parts += [f"in {self.dimension}"] if self.dimension else []
        return ", ".join(parts)


def by_accuracy(scene: Scene) -> list[Variant]:
    """What the library chooses, from coarse to fine."""
    return [Variant(accuracy=accuracy) for accuracy in ACCURACIES.get(scene.analysis.type, ACCURACIES["static"])]


def families(scene: Scene) -> list[list[Variant]]:
    """Families of meshes (and steps in time), each from coarse to fine."""
    flexible = sum(member.type == "flexible" for member in scene.members.values())
    if not flexible:
        return []
    if scene.analysis.type == "dynamic":
        return list(_moving(flexible))
    integrations: tuple[Literal["nodes", "gauss"], ...] = ("nodes", "gauss")
    if scene.analysis.type != "static":
        integrations = ("nodes",)
    return [
        [
            Variant(element, count, integration)
            for count in COUNTS
            if count == 1 or count * flexible * order <= MOST_UNKNOWNS
        ]
        for integration in integrations
        for order, element in enumerate(ELEMENTS, start=1)
    ]


def _moving(flexible: int) -> Iterator[list[Variant]]:
    for integrator in STEPPERS:
        for element in MOVING:
            for count in MOVING_COUNTS:
                if count * flexible > MOST_UNKNOWNS / 10:
                    continue
                steps, family = FEW_STEPS, []
                while steps <= MOST_STEPS:
                    family.append(Variant(element, count, integrator=integrator, steps=steps))
                    steps *= 2
                yield family


def other_ways(scene: Scene, variant: Variant, dimension: str) -> list[Variant]:
    """Variants on the same mesh with another assembly, solver or kernels, without the core, and of a plane scene in
    space.
    """
    moving, ways = scene.analysis.type == "dynamic", list[Variant]()
    if core() is not None:
        ways.append(replace(variant, core=False))
    if scene.analysis.type != "modes":
        ways += [replace(variant, kernels=kernels) for kernels in ("compiled", "interpreted")]
    if scene.analysis.type == "static":
        ways += [replace(variant, assembly=assembly) for assembly in ("closing", "nodal")]
        ways += [replace(variant, solver="newton")]
    if dimension == "plane" and not moving:
        ways.append(replace(variant, dimension="space"))
    return ways
