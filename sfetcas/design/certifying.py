"""Certification of a solution: each case again by Newton's method, with its stability, and on half as long elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import tolerances
from ..description.scene import Scene
from ..equilibria.single import finished, unjudged
from ..equilibria.solution import Equilibrium
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.accuracy import halving
from ..mechanics.equations import State
from ..mechanics.fields import transferred
from ..mechanics.mesh import Mesh
from ..mechanics.model import assemble
from ..solvers.prepared import Prepared
from .equations import CaseEquations
from .formulation import labelled

__all__ = ["Certified", "certified", "prepared_case"]


@dataclass(frozen=True, eq=False)
class Certified:
    """A case with its certificate.

    Attributes
    ----------
    equilibrium : Equilibrium
        On the mesh of the program.
    shape : ndarray
        Eigenvector of its lowest eigenvalue: rotations (rad), then displacements (dimensionless).
    smallest : float
        The eigenvalue, dimensionless.
    prepared : Prepared
        Its model.
    error : float
        Difference of positions to those with all elements halved, over the size of the scene.
    """

    equilibrium: Equilibrium
    shape: Array
    smallest: float
    prepared: Prepared
    error: float


def certified(scene: Scene, equations: CaseEquations, state: State, case: str) -> Certified:
    """Solve a case again, independently of the program, and certify it.

    Raises
    ------
    SolveError
        The case is no equilibrium of its scene.
    """
    prepared = prepared_case(scene, equations, equations.mesh)
    factor = float(scene.analysis.steps[-1])
    loading = prepared.model.loading(factor)
    found = prepared.correct(state, loading)
    if not found.residual <= tolerances.BALANCED or prepared.distance(found.state, state) > tolerances.SAME_STATE:
        raise SolveError(Status.FAILED, labelled(case, "what was found is no equilibrium of the scene"), state)
    stability = prepared.stability(found)
    error, notes = _error(scene, equations, prepared, unjudged(prepared, found, loading, factor))
    equilibrium = finished(prepared, found, loading, factor, stability, estimate=error, notes=notes)
    return Certified(
        equilibrium, np.concatenate([stability.shape, stability.travel]), stability.smallest, prepared, error
    )


def prepared_case(scene: Scene, equations: CaseEquations, mesh: Mesh) -> Prepared:
    """The model of a case on a mesh, with the units of the program."""
    assembly: Any = equations.assembly
    return Prepared(assemble(scene, mesh, assembly=assembly, scales=equations.scales))


def _error(
    scene: Scene, equations: CaseEquations, coarse: Prepared, here: Equilibrium
) -> tuple[float, tuple[str, ...]]:
    mesh = coarse.model.mesh.refined()
    if mesh.same(coarse.model.mesh):
        return 0.0, ()
    fine = prepared_case(scene, equations, mesh)
    loading = fine.model.loading(here.factor)
    found = fine.correct(transferred(coarse.model, here.state, fine.model), loading, iterations=25, most=1.5)
    if not found.converged:
        return np.inf, ("an equilibrium of a coarse mesh only",)
    difference, left = halving(here.fields, unjudged(fine, found, loading, here.factor).fields)
    return difference + left, ()
