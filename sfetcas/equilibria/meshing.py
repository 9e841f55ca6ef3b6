"""The meshes of a static analysis, chosen or prescribed, and an equilibrium together with the mesh it was found on."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, replace
from typing import Any

from ..description.scene import Scene
from ..errors import SceneError
from ..mechanics.accuracy import gained, halving, remaining
from ..mechanics.elements import ELEMENTS
from ..mechanics.equations import Equations
from ..mechanics.mesh import Mesh, Remembered, first_mesh, uniform_mesh
from ..mechanics.model import Model, assemble
from ..solvers.prepared import Prepared, Solved
from ..solvers.stability import Stability
from .quantities import WHERE, Quantity
from .settings import Settings
from .single import unjudged

__all__ = ["PILOT_ELEMENTS", "EquilibriumResult", "Meshing"]

FINE = 1e-8
"""Below this accuracy elements of order 6 need fewer unknowns than those of order 4 (measured)."""

ALONG_PATHS = 3e-5
"""As :data:`FINE` for paths in the plane, where order 6 costs hardly more time than order 4 and saves a halving of the
mesh; not where laws have memory or something rubs, nor where modes are found at each point (measured).
"""

SHORT = 0.25
"""Rotation, rad, expected within elements up to which order 4 is as accurate as order 6 (measured)."""

PILOT_ELEMENTS = 60
"""A mesh that was asked for, if no coarser than the first one in space, is its own pilot up to this many elements."""

PILOT_ORDER = 4
"""Coarse meshes of lower order have equilibria that no beam has."""

RECENT = 12
"""Meshes whose equations are kept: steps that are tried again have the same elements and points of contact."""


@dataclass(frozen=True, eq=False)
class EquilibriumResult:
    """An equilibrium in the course of an analysis.

    Attributes
    ----------
    solved : Solved
    found : Solved or None
        On the mesh where it was found first, if that is another one.
    notes : tuple of str
    iterations : int
        Iterations of IPOPT.
    kept : bool
        Not to be replaced by another equilibrium on finer meshes.
    drifts : int
        Number of finer meshes on which the same equilibrium was not found.
    way : tuple of str
        Strategies that found it, see :data:`~sfetcas.equilibria.ways.WAYS`.
    """

    solved: Solved
    found: Solved | None = None
    notes: tuple[str, ...] = ()
    iterations: int = 0
    kept: bool = False
    drifts: int = 0
    way: tuple[str, ...] = ()

    @property
    def stability(self) -> Stability:
        """On the mesh where it was found first: finer meshes do not repeat the test before the answer."""
        return (self.found or self.solved).stability

    @property
    def neutral(self) -> bool:
        """Whether it is neutral by :attr:`stability`."""
        return (self.found or self.solved).neutral

    def onto(self, solved: Solved, **more: Any) -> EquilibriumResult:
        """The same equilibrium on another mesh."""
        return replace(self, solved=solved, found=self.found or self.solved, **more)


class Meshing:
    """A scene with its settings, and the meshes of a static analysis.

    Attributes
    ----------
    scene, settings, stops
        As given to :func:`~sfetcas.equilibria.statics.solve`.
    accuracy : float
        Wanted relative error; ``asked`` says whether missing it matters.
    quantity : Quantity or None
        The quantity that the accuracy refers to; None for the positions.
    seconds : dict
        Wall time of assembling and solving, s.
    target, pilot_mesh : Mesh
        The mesh wanted, and the one on which the first equilibrium is found.
    named : bool
        Whether the type of element is prescribed.
    fixed : set of str
        Members whose number of elements is prescribed.
    switch_branch : bool
        Whether unstable equilibria are left for stable ones.
    """

    def __init__(self, scene: Scene, settings: Settings, stops: tuple[tuple[str, str], ...] = ()) -> None:
        self.scene, self.settings, self.stops = scene, settings, stops
        self.accuracy = settings.accuracy or scene.analysis.accuracy
        self.asked = settings.accuracy is not None or "accuracy" in scene.analysis.model_fields_set
        name = settings.accuracy_of or scene.analysis.accuracy_of
        self.quantity = Quantity.named(name, scene) if name else None
        self.seconds = {"model": 0.0, "solve": 0.0}
        self.assembly: Any = settings.assembly
        self.model: Model | None = None
        self._recent: list[Equations] = []
        self.switch_branch = scene.analysis.unstable == "leave"
        self._choose_meshes()
        # Where the mesh is the library's own, its default accuracy is a promise as well.
        self.asked = self.asked or not self.fixed

    def _choose_meshes(self) -> None:
        scene, settings = self.scene, self.settings
        names: set[str] = {m.element for m in scene.members.values() if m.element is not None}
        if settings.element is not None:
            names = {settings.element}
        if len(names) > 1:
            raise SceneError(f"members: found the elements {', '.join(sorted(names))}, accepted: one for all members")
        self.named = bool(names)
        name = next(iter(names), "SFET7" if self.accuracy < _fine(scene) and not _short(scene) else "SFET5")
        order = ELEMENTS.index(name) + 1
        # A coarser turning an element for low orders: they need more elements to be near at all.
        mesh = first_mesh(scene, order, turning=min(2.0, 0.5 * order))
        flexible = {n: m for n, m in scene.members.items() if m.type == "flexible"}
        counts = {n: settings.elements or m.elements for n, m in flexible.items()}
        self.fixed = {n for n, count in counts.items() if count is not None}
        cuts = mesh.cuts
        if self.fixed:
            equal = uniform_mesh(scene, order, {n: count or 1 for n, count in counts.items()})
            cuts = {n: (equal if n in self.fixed else mesh).cuts[n] for n in mesh.cuts}
        # Before the first step nothing is remembered.
        memory: dict[str, Remembered] | None = {} if scene.remembers else None
        self.target = Mesh(order, cuts, settings.gauss, mesh.rigid, stops=self.stops, memory=memory)
        # Quaternions lose turns between nodes that are too far apart: the way there is not followed on such a mesh.
        turns = scene.resolved_dimension == "plane" or all(
            len(self.target.cuts[n]) >= len(mesh.cuts[n]) for n in self.fixed
        )
        if order >= PILOT_ORDER and turns and (self.target.elements <= PILOT_ELEMENTS or not self.fixed):
            self.pilot_mesh = self.target
        else:
            pilot = first_mesh(scene, max(order, PILOT_ORDER), turning=1.0)
            self.pilot_mesh = replace(pilot, stops=self.stops, memory=memory)

    @property
    def prescribed(self) -> bool:
        """Whether the number of elements is prescribed for all flexible members."""
        return self.fixed == {n for n, m in self.scene.members.items() if m.type == "flexible"}

    @property
    def error_of(self) -> str:
        """Name of the quantity that the accuracy refers to; empty for the positions."""
        return "" if self.quantity is None else self.quantity.text

    def judged(self, coarse: Solved, fine: Solved) -> tuple[float, float]:
        """Relative difference of two answers in the quantity of the accuracy, and estimated error of the finer one.

        Raises
        ------
        SceneError
            The scene has no such quantity.
        """
        if self.quantity is None:
            return halving(coarse.fields, fine.fields)
        try:
            difference = self.quantity.difference(unjudged(coarse), unjudged(fine))
        except SceneError as error:
            raise SceneError(str(error), WHERE) from None
        return difference, remaining(difference, gained(coarse.fields, fine.fields, positions=self.quantity.positions))

    def prepared(self, mesh: Mesh) -> Prepared:
        """The assembled model on a mesh, ready to be solved."""
        begin = time.perf_counter()
        equations = next((one for one in self._recent if one.model.mesh.same(mesh)), None)
        if equations is None:
            # A state goes from mesh to mesh with its multipliers: all meshes share the assembly of the first.
            model = assemble(self.scene, mesh, assembly=self.assembly, like=self.model)
            equations = Prepared(model, kernels=self.settings.kernels).equations
            # Other meshes do not come again, and may be large; what members remember is no part of what is compared.
            if mesh.points and not self.scene.remembers:
                self._recent = [equations, *self._recent[: RECENT - 1]]
        self.model = equations.model
        self.assembly = self.model.assembly
        prepared = Prepared(self.model, kernels=self.settings.kernels)
        # What is found out about rows of one state is no part of another.
        prepared.equations = copy.copy(equations)
        self.seconds["model"] += time.perf_counter() - begin
        return prepared


def _fine(scene: Scene) -> float:
    """Accuracy below which elements of order 6 take less than those of order 4."""
    simple = scene.resolved_dimension == "plane" and not (scene.remembers or scene.rubs)
    return ALONG_PATHS if scene.analysis.type == "path" and simple and not scene.analysis.count_of_modes else FINE


def _short(scene: Scene) -> bool:
    """Whether holes of tendons make all elements so short that they hardly bend."""
    if not any(way.holes for tendon in scene.tendons.values() for way in tendon.way):
        return False
    usual, finer = (first_mesh(scene, 4, turning=turning) for turning in (2.0, SHORT))
    return usual.same(finer)
