"""The rules that keep the source readable: order of the modules, no cycle, nothing hidden."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import sfetcas

FOLDER = Path(sfetcas.__file__).parent

ORDER = [
    "stopping",
    "quoting",
    "errors",
    "files",
    "processes",
    "mathematics",
    "mathematics.arrays",
    "mathematics.threads",
    "mathematics.quaternion",
    "mathematics.interpolation",
    "mathematics.curves",
    "mathematics.nlp",
    "mathematics.source",
    "mathematics.keeping",
    "mathematics.kernels",
    "mathematics.linear",
    "mathematics.constants",
    "mathematics.spectra",
    "mathematics.pieces",
    "mathematics.relations",
    "mathematics.distributions",
    "mathematics.least_squares",
    "description",
    "description.records",
    "description.answers",
    "description.matrices",
    "description.sections",
    "description.shapes",
    "description.structure",
    "description.springs",
    "description.loads",
    "description.contacts",
    "description.obstacles",
    "description.supports",
    "description.dimension",
    "description.task",
    "description.moving",
    "description.scene",
    "description.scenefile",
    "mechanics",
    "mechanics.elements",
    "mechanics.stations",
    "mechanics.joints",
    "mechanics.contact_joints",
    "mechanics.carried",
    "mechanics.mesh",
    "mechanics.rotations",
    "mechanics.segments",
    "mechanics.positions",
    "mechanics.beams",
    "mechanics.resistance",
    "mechanics.bodies",
    "mechanics.body_masses",
    "mechanics.connections",
    "mechanics.pressure",
    "mechanics.loading",
    "mechanics.winding",
    "mechanics.observed",
    "mechanics.body_points",
    "mechanics.masses",
    "mechanics.spinning",
    "mechanics.model",
    "mechanics.work",
    "mechanics.equations",
    "mechanics.singles",
    "mechanics.entries",
    "mechanics.expressions",
    "mechanics.stationarity",
    "mechanics.balance",
    "mechanics.fields",
    "mechanics.accuracy",
    "solvers",
    "solvers.sharing",
    "solvers.newton",
    "solvers.neutral",
    "solvers.doctor",
    "solvers.guess",
    "solvers.sides",
    "solvers.stability",
    "solvers.divergence",
    "solvers.downhill",
    "solvers.program",
    "solvers.problem",
    "solvers.globalised",
    "solvers.prepared",
    "solvers.unheld",
    "solvers.deflation",
    "solvers.dragging",
    "solvers.arclength",
    "solvers.critical",
    "solvers.tracing",
    "solvers.continuation",
    "solvers.beginning",
    "solvers.open_problem",
    "contact",
    "contact.touches",
    "contact.settling",
    "contact.cushions",
    "contact.passing",
    "contact.rolling",
    "contact.contact_stability",
    "contact.revising",
    "contact.touching",
    "contact.contact_balance",
    "contact.contact_statics",
    "equilibria",
    "equilibria.mirrors",
    "equilibria.solution",
    "equilibria.quantities",
    "equilibria.several",
    "equilibria.scanning",
    "equilibria.single",
    "equilibria.settings",
    "equilibria.meshing",
    "equilibria.piloting",
    "equilibria.refining",
    "equilibria.statics",
    "equilibria.stops",
    "dynamics",
    "dynamics.system",
    "dynamics.stages",
    "dynamics.methods",
    "dynamics.steps",
    "dynamics.conserving",
    "dynamics.integrating",
    "dynamics.beginning",
    "dynamics.inertia",
    "dynamics.projecting",
    "dynamics.sampling",
    "dynamics.motion",
    "dynamics.integrators",
    "dynamics.index_one",
    "dynamics.inertialess",
    "dynamics.idas",
    "dynamics.watching",
    "dynamics.simulation",
    "dynamics.small_motion",
    "dynamics.matrices",
    "dynamics.buckling",
    "dynamics.modes",
    "paths",
    "paths.path",
    "paths.vibrations",
    "paths.contact_curve",
    "paths.contact_trace",
    "paths.contact_path",
    "paths.paths",
    "parametric",
    "parametric.dependence",
    "parametric.arguments",
    "parametric.changing",
    "parametric.results",
    "parametric.equilibrium",
    "parametric.implicit",
    "parametric.solving",
    "parametric.fitting",
    "parametric.moving",
    "design",
    "design.equations",
    "design.formulation",
    "design.bounds",
    "design.assembled",
    "design.certifying",
    "design.solving",
    "design.designing",
    "design.quasi_static",
    "codegen",
    "codegen.derivatives",
    "codegen.timestep",
    "codegen.rendering",
    "codegen.writing_derivatives",
    "codegen.writing_equilibria",
    "codegen.writing_steps",
    "codegen.folder",
    "checks",
    "analyses",
    "trajectories",
    "trajectories.statement",
    "trajectories.controlled",
    "trajectories.transcription",
    "trajectories.warm",
    "trajectories.replay",
    "trajectories.controlled_motion",
    "trajectories.optimal_control",
    "trajectories.functions",
    "sweeps",
    "sweeps.distributions",
    "sweeps.cases",
    "sweeps.quantities",
    "sweeps.work",
    "sweeps.workers",
    "sweeps.feeding",
    "sweeps.result",
    "sweeps.sweeping",
    "sweeps.texts",
    "tradeoff",
    "tradeoff.variants",
    "tradeoff.observed",
    "tradeoff.measuring",
    "tradeoff.running",
    "tradeoff.machine",
    "tradeoff.peers",
    "tradeoff.trading",
    "tradeoff.tables",
    "pictures",
    "pictures.sketch",
    "pictures.limits",
    "pictures.glyphs",
    "pictures.looks",
    "pictures.files",
    "pictures.sheet",
    "pictures.plotting",
    "pictures.charts",
    "pictures.motions",
    "pictures.fronts",
    "pictures.animation",
    "pictures.paraview",
    "benchmarks",
    "benchmarks.random_scenes",
    "benchmarks.random_checks",
    "benchmarks.motion",
    "benchmarks.code",
    "benchmarks.accuracy",
    "benchmarks.pieces",
    "benchmarks.derivatives",
    "benchmarks.extremes",
    "benchmarks.many",
    "benchmarks.worker",
    "benchmarks.random_run",
    "benchmarks.jitter",
    "benchmarks.contact_chain",
    "benchmarks.contact_oracle",
    "benchmarks.contact_scenes",
    "benchmarks.contact_run",
    "benchmark",
    "reports",
    "outputs",
    "cli",
    "__init__",
    "__main__",
]
"""A module imports only from names to its left."""

PROGRAMS = (
    "cli",
    "reports",
    "benchmark",
    "benchmarks.motion",
    "benchmarks.code",
    "benchmarks.accuracy",
    "benchmarks.pieces",
    "benchmarks.derivatives",
    "benchmarks.extremes",
    "benchmarks.many",
    "benchmarks.random_run",
    "benchmarks.jitter",
    "benchmarks.contact_run",
)
"""What is run and not imported: only these print."""

PICTURES = (
    "pictures.files",
    "pictures.sheet",
    "pictures.plotting",
    "pictures.charts",
    "pictures.motions",
    "pictures.fronts",
    "pictures.animation",
)
"""What needs matplotlib, which a run pays for only when a picture is asked for."""


def named(path):
    """A module by its place below the package: ``mechanics.mesh``, ``mechanics`` for that package itself."""
    parts = path.relative_to(FOLDER).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


TREES = {named(path): ast.parse(path.read_text()) for path in sorted(FOLDER.rglob("*.py"))}
PACKAGES = {path.parent.name for path in FOLDER.glob("*/__init__.py")}
MODULES = sorted(TREES)
each = pytest.mark.parametrize("name", MODULES)


def sources(name, node):
    """Modules that one ``from ... import ...`` of a module reads."""
    if node.level:
        here = [] if name in ("__init__", "__main__") else name.split(".")
        above = here[: max(len(here) - node.level, 0)]
        parts = [*above, *(node.module.split(".") if node.module else [])]
    else:
        parts = node.module.split(".")[1:]
    place = ".".join(parts)
    if not place or place in PACKAGES:
        return {f"{place}.{alias.name}".lstrip(".") for alias in node.names}
    return {place}


def taken():
    """For each module what others import from it: (module, names)."""
    found = {}
    for other, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.level and len(sources(other, node)) == 1:
                (name,) = sources(other, node)
                names = {alias.name for alias in node.names} - {name.split(".")[-1]}
                found.setdefault(name, []).append((other, names))
    return found


TAKEN = taken()


def imported(name):
    """(own modules, other top-level packages) that a module imports, also inside functions."""
    own, other = set(), set()
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.ImportFrom):
            if node.level or node.module.split(".")[0] == "sfetcas":
                own |= sources(name, node)
            else:
                other.add(node.module.split(".")[0])
        elif isinstance(node, ast.Import):
            other |= {alias.name.split(".")[0] for alias in node.names}
    # The command line reads the version from the package.
    return {source if source in TREES else "__init__" for source in own}, other


def test_every_module_has_its_place():
    assert set(MODULES) <= set(ORDER), f"add to ORDER: {set(MODULES) - set(ORDER)}"


def test_packages_stand_together_in_the_order():
    heads = [name.split(".")[0] for name in ORDER if name.split(".")[0] in PACKAGES]
    assert [head for head, before in zip(heads, [None, *heads]) if head != before] == list(dict.fromkeys(heads))


@each
def test_modules_import_only_from_their_left(name):
    wrong = {other for other in imported(name)[0] if ORDER.index(other) >= ORDER.index(name)}
    assert not wrong


@each
def test_mechanics_and_solvers_know_no_more_than_they_need(name):
    own, other = imported(name)
    if name.startswith("description"):
        assert "casadi" not in other, "descriptions need no solver"
    assert ("matplotlib" in other) == (name in PICTURES)
    assert not {*PICTURES, *PROGRAMS} & own or name in ("benchmark", "outputs", "cli", "__main__", *PICTURES)


@each
def test_no_print_no_bare_except_no_global_state(name):
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, f"bare except in line {node.lineno}"
            caught = {getattr(t, "id", "") for t in getattr(node.type, "elts", [node.type])}
            # The command line alone says at its end that a mistake is its own, with the whole traceback.
            last = name == "cli" and "traceback.print_exc()" in ast.unparse(node)
            assert not {"Exception", "BaseException"} & caught or last, f"catches everything in line {node.lineno}"
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
            assert name in PROGRAMS, f"print in line {node.lineno}"
        assert not isinstance(node, ast.Global), f"global in line {node.lineno}"
        if isinstance(node, ast.ImportFrom):
            assert all(alias.name != "*" for alias in node.names)


@each
def test_imports_stand_at_the_top(name):
    inside = [
        node
        for function in ast.walk(TREES[name])
        if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef))
        for node in ast.walk(function)
        if isinstance(node, (ast.Import, ast.ImportFrom))
    ]
    # Pictures, and a bar on a terminal, are what a run does not pay for unless they are asked for.
    allowed = {"outputs": {*PICTURES, "pictures.paraview"}, "cli": {"tqdm"}}.get(name, set())
    assert {getattr(node, "module", None) for node in inside} <= allowed


@each
def test_all_is_complete_and_documented(name):
    if name in ("__main__", *PACKAGES, *PICTURES):
        assert ast.get_docstring(TREES[name])
        return
    module = importlib.import_module("sfetcas" if name == "__init__" else f"sfetcas.{name}")
    assert module.__doc__
    assert isinstance(module.__all__, list)
    assert len(set(module.__all__)) == len(module.__all__)
    for public in module.__all__:
        thing = getattr(module, public)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), f"{public} has no docstring"
    if name == "__init__":
        return
    # What other modules import is public in the module it comes from.
    for other, names in TAKEN.get(name, []):
        assert names <= set(module.__all__), f"imported by {other}"


@each
def test_public_methods_are_documented(name):
    classes = [node for node in TREES[name].body if isinstance(node, ast.ClassDef)]
    methods = [(c, m) for c in classes for m in c.body if isinstance(m, ast.FunctionDef) and not m.name.startswith("_")]
    # What an abstract class asks for is said once, in its docstring.
    asked = {m.name for _, m in methods if any("abstractmethod" in ast.unparse(d) for d in m.decorator_list)}
    for owner, method in methods:
        if not owner.name.startswith("_") and method.name not in asked:
            assert ast.get_docstring(method), f"{owner.name}.{method.name}"


def test_package_exports_what_it_lists():
    names = {
        alias.asname or alias.name
        for node in TREES["__init__"].body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert names == set(sfetcas.__all__)
