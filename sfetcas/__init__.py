"""sfetcas: equilibria of very flexible beams under large motion.

The flow, in the order of the names below:

1. a :class:`Scene` says what there is: sections, nodes, members, loads, motions (or :func:`load` a file);
2. :func:`solve` finds its equilibria, to the accuracy asked for, each with a certificate;
3. a :class:`Solution` answers by the names of the scene.

Underneath: :func:`assemble` makes the :class:`Model` of a scene on a :class:`Mesh`; :class:`Prepared` keeps its
solvers for repeated solves by :func:`solve_model`; :func:`equilibrium_nlp` opens the problem as a CasADi program
that takes further terms, rows and bounds.

Source: Barraco and Munteanu, A special finite element for static and dynamic study of mechanical systems under
large motion, Part 1.
"""

from .checks import check
from .contacts import Contact
from .errors import SceneError, SolveError, Status
from .mesh import Mesh, first_mesh, uniform_mesh
from .model import Model, assemble
from .nlp import NLP, Ipopt, NLPResult, Solver
from .open_problem import OpenAnswer, OpenProblem, equilibrium_nlp
from .prepared import Prepared
from .scene import Analysis, Expect, History, Load, Member, Motion, Node, Scene
from .scenefile import dump, load
from .sections import CrossSection
from .shapes import Arc, Curvature, Helix, Spline, Straight
from .solution import Certificate, Equilibrium, Solution
from .statics import Settings, solve, solve_model

__version__ = "0.1.0"

__all__ = [
    "NLP",
    "Analysis",
    "Arc",
    "Certificate",
    "Contact",
    "CrossSection",
    "Curvature",
    "Equilibrium",
    "Expect",
    "Helix",
    "History",
    "Ipopt",
    "Load",
    "Member",
    "Mesh",
    "Model",
    "Motion",
    "NLPResult",
    "Node",
    "OpenAnswer",
    "OpenProblem",
    "Prepared",
    "Scene",
    "SceneError",
    "Settings",
    "Solution",
    "SolveError",
    "Solver",
    "Spline",
    "Status",
    "Straight",
    "assemble",
    "check",
    "dump",
    "equilibrium_nlp",
    "first_mesh",
    "load",
    "solve",
    "solve_model",
    "uniform_mesh",
]
