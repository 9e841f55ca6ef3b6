"""The nonlinear program of an equilibrium for C: energy, constraints and their derivatives as functions."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..description.showing import shown
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.nlp import NLP
from ..mechanics.model import Model
from ..parametric.arguments import Arguments, Asked, in_words
from ..parametric.equilibrium import equilibrium_solver
from ..parametric.results import Results
from ..solvers.prepared import Prepared
from ..solvers.problem import EquilibriumProblem
from ..solvers.program import is_data

__all__ = ["Derivatives", "derivatives"]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """The program of one scene on one mesh; the same CasADi functions run in process and in C.

    Attributes
    ----------
    name : str
        Prefix of all names in C.
    scene : Scene
    arguments : Arguments
        Numbers of the scene that are arguments, in their SI units.
    results : Results
        Empty: a program has unknowns instead.
    nlp : NLP
        Dimensionless.
    parameters : MX (parameters,)
        Parameters of the program as an expression of what is given, see :class:`~sfetcas.solvers.program.Program`.
    guess : ndarray (unknowns,)
        The static equilibrium for the default arguments, dimensionless.
    """

    name: str
    scene: Scene
    arguments: Arguments
    results: Results
    nlp: NLP
    parameters: ca.MX
    guess: Array

    def __repr__(self) -> str:
        return shown(self, [self.name, self.model.size_in_words], in_words(self.arguments, self.results))

    @property
    def model(self) -> Model:
        """The model, assembled at values of the arguments for which no entry vanishes by chance."""
        return self.arguments.model

    @functools.cached_property
    def functions(self) -> dict[str, ca.Function]:
        """CasADi functions by name: ``energy``, ``gradient``, ``constraints``, ``jacobian`` and ``hessian``.

        Arguments are (arguments, x), for the Hessian (arguments, x, weight, multipliers).  It is the full one of
        ``weight energy + multipliers.constraints``.  Matrices are given by the entries of :attr:`patterns`.
        """
        nlp, program = self.nlp, self.arguments.program
        p = ca.MX.sym("arguments", len(self.arguments.defaults))
        weight, multipliers = ca.MX.sym("weight"), ca.MX.sym("multipliers", nlp.g.numel())
        found = {
            "energy": nlp.f,
            "gradient": ca.densify(nlp.gradient),
            "constraints": ca.densify(nlp.g),
            "jacobian": nlp.jacobian.nz[:],
            "hessian": nlp.hessian(weight, multipliers).nz[:],
        }
        given = ca.substitute([self.parameters], [program.symbol], [self.arguments.given(p)])[0]
        made = {}
        for what, expression in found.items():
            whole = ca.substitute([expression], [nlp.p], [given])[0]
            more = [weight, multipliers] if what == "hessian" else []
            names = ["arguments", "x", *(["weight", "multipliers"] if more else [])]
            made[what] = ca.Function(f"{self.name}_of_{what}", [p, nlp.x, *more], [whole], names, [what])
        return made

    @property
    def patterns(self) -> dict[str, ca.Sparsity]:
        """Sparsity of the Jacobian (constraints, unknowns) and of the Hessian (unknowns, unknowns)."""
        hessian = self.nlp.hessian(ca.MX(1), ca.MX.ones(self.nlp.g.numel()))
        return {"jacobian": self.nlp.jacobian.sparsity(), "hessian": hessian.sparsity()}


def derivatives(
    scene: Scene,
    name: str,
    *,
    arguments: Asked = None,
    settings: Settings | None = None,
) -> Derivatives:
    """The program of a scene, on the mesh that its accuracy asks for.

    Parameters
    ----------
    scene, name, arguments, settings
        As of :func:`~sfetcas.parametric.equilibrium.equilibrium_solver`; arguments can be loads and motions only.

    Raises
    ------
    SceneError
        The scene has loads without potential or cannot be exported, or an argument is no load or motion.
    """
    solver = equilibrium_solver(scene, name, arguments=arguments, settings=settings)
    model, program = solver.model, solver.arguments.program
    if not model.minimisable:
        message = "loads without potential, and moments in space, have no energy, accepted: the equilibrium solver"
        raise SceneError(message, ("loads",))
    changing = [part for part in program.sizes if is_data(part)]
    if changing:
        message = f"found numbers that change the {changing[0]}, accepted of a program: loads and motions"
        raise SceneError(message, ("arguments",))
    outcome, _ = solver.solve()
    state = program.equations.state(outcome.state)
    loading = model.loading(scene.analysis.steps[-1])
    prepared = Prepared(model)
    near = prepared.equations.start(loading)
    problem = EquilibriumProblem(model, loading, near, kernels="interpreted")
    parameters = problem.parameters_by(program.given, near.unwrapped)
    none = Results(model, [], {})
    guess = problem.unknowns(state)
    if not np.isfinite(guess).all():
        guess = problem.unknowns(near)
    return Derivatives(name, scene, solver.arguments, none, problem.nlp, parameters, guess)
