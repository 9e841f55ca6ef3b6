"""Certification of a solution: each case again by Newton's method, with its stability, and on half as long elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..equilibria.single import finished
from ..equilibria.solution import Equilibrium
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.accuracy import halving
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from ..parametric.equilibrium import kept_of
from ..solvers.prepared import Prepared, Solved
from .equations import CaseEquations
from .formulation import labelled

__all__ = ["Certified", "certified", "prepared_case"]

COARSE = "an equilibrium of a coarse mesh only"
"""A note."""


@dataclass(frozen=True, eq=False)
class Certified:
    """A case with its certificate.

    Attributes
    ----------
    solved : Solved
        On the mesh of the program.
    equilibrium : Equilibrium
        The answer that this is.
    error : float
        Difference of positions to those with all elements halved, over the size of the scene.
    """

    solved: Solved
    equilibrium: Equilibrium
    error: float


def certified(
    scene: Scene, equations: CaseEquations, state: State, case: str, places: Array, accuracy: float
) -> Certified:
    """Solve a case again, independently of the program, and certify it.

    ``places`` (ends,) are those where lines on obstacles end; ``accuracy`` is that of what touches on half as long
    elements.

    Raises
    ------
    SolveError
        The case is no equilibrium of its scene.
    """
    prepared = prepared_case(scene, equations, equations.arguments.mesh_at(scene, equations.mesh, places))
    found = prepared.correct(state, prepared.model.loading(float(scene.analysis.steps[-1])))
    if not found.residual <= tolerances.BALANCED or prepared.distance(found.state, state) > tolerances.SAME_STATE:
        raise SolveError(Status.FAILED, labelled(case, "what was found is no equilibrium of the scene"), state)
    error, notes = _error(scene, equations, found, accuracy)
    return Certified(found, finished(found, error_estimate=error, notes=notes), error)


def prepared_case(scene: Scene, equations: CaseEquations, mesh: Mesh) -> Prepared:
    """The model of a case on a mesh, with the units of the program."""
    assembly: Any = equations.assembly
    return Prepared(assemble(scene, mesh, assembly=assembly, scales=equations.scales))


def _error(scene: Scene, equations: CaseEquations, here: Solved, accuracy: float) -> tuple[float, tuple[str, ...]]:
    if here.model.mesh.lies:
        found = kept_of(scene, Settings(accuracy=accuracy), here).halved()
        return (np.inf, (COARSE,)) if found is None else (sum(halving(here.fields, found.fields)), ())
    mesh = here.model.mesh.refined()
    if mesh.same(here.model.mesh):
        return 0.0, ()
    fine = prepared_case(scene, equations, mesh)
    state = transferred(here.model, here.state, fine.model)
    found = fine.correct(state, fine.model.loading(here.factor), iterations=25, most=1.5)
    if not found.converged:
        return np.inf, (COARSE,)
    difference, left = halving(here.fields, found.fields)
    return difference + left, ()
