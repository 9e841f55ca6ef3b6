"""sfetcas: equilibria, vibrations and motions of very flexible beams.

The flow, in the order of the names below:

1. a :class:`Scene` says what there is: sections, nodes, members, loads, motions (or :func:`load` a file);
2. :func:`solve` finds its equilibria, each with a certificate, its vibrations or its motion, to the accuracy asked for;
3. a :class:`Solution` answers by the names of the scene; a :class:`Path` does so along a path, and :func:`switch`
   follows other branches from its bifurcations; :class:`Modes` has frequencies and shapes, a :class:`Trajectory` the
   states of a motion, each an :class:`Instant`;
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

# Before all else, as what follows takes long to import.
import sfetcas.stopping  # noqa: F401  # isort: split

from .analyses import solve
from .checks import check
from .codegen.derivatives import Derivatives
from .codegen.folder import export
from .codegen.timestep import TimeStep
from .description.contacts import Contact
from .description.scene import Analysis, Expect, History, Load, Member, Motion, Node, Scene, Until
from .description.scenefile import dump, load
from .description.sections import CrossSection, Polynomial, Table
from .description.shapes import Arc, Curvature, Helix, Spline, Straight
from .description.springs import Spring
from .design.designing import Design, DesignAnswer, find
from .design.quasi_static import QuasiStatic, QuasiStaticAnswer
from .dynamics.modes import Modes
from .dynamics.motion import Instant, Trajectory
from .equilibria.solution import Certificate, Equilibrium, Solution
from .equilibria.statics import Settings, solve_model
from .errors import SceneError, SolveError, Status
from .mathematics.nlp import NLP, Ipopt, NLPResult, Solver
from .mechanics.mesh import Mesh, first_mesh, uniform_mesh
from .mechanics.model import Model, assemble
from .parametric.arguments import Parameter
from .parametric.changing import changed
from .parametric.equilibrium import EquilibriumSolver
from .parametric.fitting import Fit, Fitting, Measurement, fit, fitting
from .parametric.solving import ParametricAnswer, ParametricEquilibrium, parametric
from .paths.path import Branch, Path, PathPoint
from .paths.paths import switch
from .solvers.open_problem import OpenAnswer, OpenProblem, equilibrium_nlp
from .solvers.prepared import Prepared
from .sweeps.cases import Cases, grid, sampled
from .sweeps.distributions import LogNormal, Normal, Uniform
from .sweeps.result import Sweep
from .sweeps.sweeping import sweep
from .trajectories.controlled_motion import Check, ControlledMotion
from .trajectories.functions import MotionFunctions, motion_functions
from .trajectories.optimal_control import OptimalControl
from .trajectories.replay import Response, respond

__version__ = "0.1.0"

__all__ = [
    "NLP",
    "Analysis",
    "Arc",
    "Branch",
    "Cases",
    "Certificate",
    "Check",
    "Contact",
    "ControlledMotion",
    "CrossSection",
    "Curvature",
    "Derivatives",
    "Design",
    "DesignAnswer",
    "Equilibrium",
    "EquilibriumSolver",
    "Expect",
    "Fit",
    "Fitting",
    "Helix",
    "History",
    "Instant",
    "Ipopt",
    "Load",
    "LogNormal",
    "Measurement",
    "Member",
    "Mesh",
    "Model",
    "Modes",
    "Motion",
    "MotionFunctions",
    "NLPResult",
    "Node",
    "Normal",
    "OpenAnswer",
    "OpenProblem",
    "OptimalControl",
    "Parameter",
    "ParametricAnswer",
    "ParametricEquilibrium",
    "Path",
    "PathPoint",
    "Polynomial",
    "Prepared",
    "QuasiStatic",
    "QuasiStaticAnswer",
    "Response",
    "Scene",
    "SceneError",
    "Settings",
    "Solution",
    "SolveError",
    "Solver",
    "Spline",
    "Spring",
    "Status",
    "Straight",
    "Sweep",
    "Table",
    "TimeStep",
    "Trajectory",
    "Uniform",
    "Until",
    "assemble",
    "changed",
    "check",
    "dump",
    "equilibrium_nlp",
    "export",
    "find",
    "first_mesh",
    "fit",
    "fitting",
    "grid",
    "load",
    "motion_functions",
    "parametric",
    "respond",
    "sampled",
    "solve",
    "solve_model",
    "sweep",
    "switch",
    "uniform_mesh",
]
