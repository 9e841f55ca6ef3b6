"""Equilibria, vibrations and motions of very flexible beams.

The flow, in the order of the names below:

1. a :class:`Scene` says what there is: sections, nodes, members, loads, motions (or :func:`load` a file);
2. :func:`solve` finds its equilibria, each with a certificate, its vibrations or its motion, to the accuracy asked for;
3. a :class:`Solution` answers by the names of the scene; a :class:`Path` does so along a path, and :func:`switch`
   follows other branches from its bifurcations; :class:`Modes` has frequencies and shapes, a :class:`Trajectory` the
   states of a motion, each an :class:`MotionState`;
4. :func:`parametric` makes equilibria a function of numbers of the scene, with exact first and second derivatives;
   :func:`fit` finds such numbers from measurements, with bounds of confidence;
5. :class:`Design` looks for numbers of a scene under several load cases at once, :func:`find` for those with wanted
   answers, :class:`QuasiStatic` for inputs along a path of equilibria;
6. :class:`OptimalControl` looks for the motion that is best, replayed by :func:`respond`; :func:`motion_functions`
   gives the equations as plain CasADi Functions.

:func:`sweep` does this for many cases of a scene at once, from a :func:`grid` or :func:`sampled`.

Underneath: :func:`assemble` makes the :class:`Model` of a scene on a :class:`Mesh`; :class:`Prepared` keeps its
solvers for repeated solves by :func:`solve_model`; :func:`equilibrium_nlp` opens the problem as a CasADi program
that takes further terms, rows and bounds; :func:`export` writes a solver of its own as C.

Source: Barraco and Munteanu, A special finite element for static and dynamic study of mechanical systems under
large motion, Part 1.
"""

import gc
import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

# Before all else, as what follows takes long to import.
import sfetcas.stopping

if TYPE_CHECKING:
    from .analyses import solve as solve
    from .checks import check as check
    from .codegen.derivatives import Derivatives as Derivatives
    from .codegen.folder import export as export
    from .codegen.timestep import TimeStep as TimeStep
    from .description.actuation import Actuation as Actuation
    from .description.actuation import Magnet as Magnet
    from .description.actuation import MagneticField as MagneticField
    from .description.contacts import Contact as Contact
    from .description.field_tables import FieldTable as FieldTable
    from .description.formulas import Formula as Formula
    from .description.laws import Bilinear as Bilinear
    from .description.laws import ElasticPlastic as ElasticPlastic
    from .description.laws import MomentTable as MomentTable
    from .description.laws import Plateau as Plateau
    from .description.laws import Potential as Potential
    from .description.laws import RambergOsgood as RambergOsgood
    from .description.laws import Ribbon as Ribbon
    from .description.laws import Sadowsky as Sadowsky
    from .description.laws import StressStrain as StressStrain
    from .description.laws import Superelastic as Superelastic
    from .description.relaxation import Relaxation as Relaxation
    from .description.rings import Ring as Ring
    from .description.scene import Analysis as Analysis
    from .description.scene import Expect as Expect
    from .description.scene import History as History
    from .description.scene import Load as Load
    from .description.scene import Member as Member
    from .description.scene import Motion as Motion
    from .description.scene import Node as Node
    from .description.scene import Scene as Scene
    from .description.scene import Until as Until
    from .description.scenefile import dump as dump
    from .description.scenefile import load as load
    from .description.sections import CrossSection as CrossSection
    from .description.sections import Polynomial as Polynomial
    from .description.sections import Table as Table
    from .description.shapes import Arc as Arc
    from .description.shapes import Curvature as Curvature
    from .description.shapes import Helix as Helix
    from .description.shapes import Spline as Spline
    from .description.shapes import Straight as Straight
    from .description.springs import Spring as Spring
    from .description.stretch_laws import StretchBilinear as StretchBilinear
    from .description.stretch_laws import StretchPotential as StretchPotential
    from .description.stretch_laws import StretchTable as StretchTable
    from .description.tendons import Coil as Coil
    from .description.tendons import Tendon as Tendon
    from .description.tendons import Way as Way
    from .description.tubes import Tube as Tube
    from .design.designing import Design as Design
    from .design.designing import DesignAnswer as DesignAnswer
    from .design.designing import find as find
    from .design.quasi_static import QuasiStatic as QuasiStatic
    from .design.quasi_static import QuasiStaticAnswer as QuasiStaticAnswer
    from .dynamics.modes import Modes as Modes
    from .dynamics.motion import MotionState as MotionState
    from .dynamics.motion import StopEvent as StopEvent
    from .dynamics.motion import Trajectory as Trajectory
    from .equilibria.solution import Certificate as Certificate
    from .equilibria.solution import Equilibrium as Equilibrium
    from .equilibria.solution import Solution as Solution
    from .equilibria.statics import Settings as Settings
    from .equilibria.statics import solve_model as solve_model
    from .errors import SceneError as SceneError
    from .errors import SolveError as SolveError
    from .errors import Status as Status
    from .mathematics.nlp import NLP as NLP
    from .mathematics.nlp import Ipopt as Ipopt
    from .mathematics.nlp import NLPResult as NLPResult
    from .mathematics.nlp import Solver as Solver
    from .mechanics.mesh import Mesh as Mesh
    from .mechanics.mesh import first_mesh as first_mesh
    from .mechanics.mesh import uniform_mesh as uniform_mesh
    from .mechanics.model import Model as Model
    from .mechanics.model import assemble as assemble
    from .parametric.arguments import Parameter as Parameter
    from .parametric.changing import changed as changed
    from .parametric.equilibrium import EquilibriumSolver as EquilibriumSolver
    from .parametric.fitting import Fit as Fit
    from .parametric.fitting import Fitting as Fitting
    from .parametric.fitting import Measurement as Measurement
    from .parametric.fitting import fit as fit
    from .parametric.fitting import fitting as fitting
    from .parametric.solving import ParametricAnswer as ParametricAnswer
    from .parametric.solving import ParametricAnswers as ParametricAnswers
    from .parametric.solving import ParametricEquilibrium as ParametricEquilibrium
    from .parametric.solving import parametric as parametric
    from .paths.path import Branch as Branch
    from .paths.path import Path as Path
    from .paths.path import PathPoint as PathPoint
    from .paths.paths import switch as switch
    from .solvers.open_problem import OpenAnswer as OpenAnswer
    from .solvers.open_problem import OpenProblem as OpenProblem
    from .solvers.open_problem import equilibrium_nlp as equilibrium_nlp
    from .solvers.prepared import Prepared as Prepared
    from .sweeps.cases import Cases as Cases
    from .sweeps.cases import grid as grid
    from .sweeps.cases import sampled as sampled
    from .sweeps.distributions import LogNormal as LogNormal
    from .sweeps.distributions import Normal as Normal
    from .sweeps.distributions import Uniform as Uniform
    from .sweeps.result import Sweep as Sweep
    from .sweeps.sweeping import sweep as sweep
    from .trajectories.controlled_motion import Check as Check
    from .trajectories.controlled_motion import ControlledMotion as ControlledMotion
    from .trajectories.functions import MotionFunctions as MotionFunctions
    from .trajectories.functions import motion_functions as motion_functions
    from .trajectories.optimal_control import OptimalControl as OptimalControl
    from .trajectories.replay import Response as Response
    from .trajectories.replay import respond as respond

# What is imported stays: looking for garbage in it would take a sixth of a small run, and the command does that later.
if sfetcas.stopping.COMMAND:
    gc.disable()

__version__ = "0.1.0"

_PUBLIC = {
    "analyses": "solve",
    "checks": "check",
    "codegen.derivatives": "Derivatives",
    "codegen.folder": "export",
    "codegen.timestep": "TimeStep",
    "description.actuation": "Actuation Magnet MagneticField",
    "description.field_tables": "FieldTable",
    "description.contacts": "Contact",
    "description.laws": "Bilinear ElasticPlastic MomentTable Plateau Potential RambergOsgood Ribbon Sadowsky "
    "StressStrain Superelastic",
    "description.scene": "Analysis Expect History Load Member Motion Node Scene Until",
    "description.relaxation": "Relaxation",
    "description.scenefile": "dump load",
    "description.formulas": "Formula",
    "description.sections": "CrossSection Polynomial Table",
    "description.shapes": "Arc Curvature Helix Spline Straight",
    "description.rings": "Ring",
    "description.springs": "Spring",
    "description.stretch_laws": "StretchBilinear StretchPotential StretchTable",
    "description.tendons": "Coil Tendon Way",
    "description.tubes": "Tube",
    "design.designing": "Design DesignAnswer find",
    "design.quasi_static": "QuasiStatic QuasiStaticAnswer",
    "dynamics.modes": "Modes",
    "dynamics.motion": "MotionState StopEvent Trajectory",
    "equilibria.solution": "Certificate Equilibrium Solution",
    "equilibria.statics": "Settings solve_model",
    "errors": "SceneError SolveError Status",
    "mathematics.nlp": "NLP Ipopt NLPResult Solver",
    "mechanics.mesh": "Mesh first_mesh uniform_mesh",
    "mechanics.model": "Model assemble",
    "parametric.arguments": "Parameter",
    "parametric.changing": "changed",
    "parametric.equilibrium": "EquilibriumSolver",
    "parametric.fitting": "Fit Fitting Measurement fit fitting",
    "parametric.solving": "ParametricAnswer ParametricAnswers ParametricEquilibrium parametric",
    "paths.path": "Branch Path PathPoint",
    "paths.paths": "switch",
    "solvers.open_problem": "OpenAnswer OpenProblem equilibrium_nlp",
    "solvers.prepared": "Prepared",
    "sweeps.cases": "Cases grid sampled",
    "sweeps.distributions": "LogNormal Normal Uniform",
    "sweeps.result": "Sweep",
    "sweeps.sweeping": "sweep",
    "trajectories.controlled_motion": "Check ControlledMotion",
    "trajectories.functions": "MotionFunctions motion_functions",
    "trajectories.optimal_control": "OptimalControl",
    "trajectories.replay": "Response respond",
}
"""Public names by their modules, each imported when one of its names is first asked for: most programs need few."""

_MODULES = {name: module for module, names in _PUBLIC.items() for name in names.split()}

__all__ = sorted(_MODULES)


if not TYPE_CHECKING:
    # Type checkers would accept any name.
    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
        globals()[name] = value
        return value


_FOLDERS = {"pictures", "tradeoff"}
"""Folders with functions for users, listed once they are imported."""


def __dir__() -> list[str]:
    return sorted({*__all__, "__doc__", "__version__", *(_FOLDERS & globals().keys())})


class _Package(ModuleType):
    """The package, whose function ``parametric`` stays that where the folder of this name is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _MODULES or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
