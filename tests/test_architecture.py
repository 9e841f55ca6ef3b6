"""The rules that keep the source readable: order of the modules, no cycle, nothing hidden."""

import ast
import functools
import importlib
import inspect
from pathlib import Path

import pytest

import benchmarks
import sfetcas
from sfetcas.mechanics.terms import Term

FOLDER = Path(sfetcas.__file__).parent

BENCHMARKS = Path(benchmarks.__file__).parent
"""Not part of the package, but read by the same rules."""

ORDER = [
    "stopping",
    "quoting",
    "errors",
    "files",
    "processes",
    "tolerances",
    "core",
    "core.building",
    "mathematics",
    "mathematics.arrays",
    "mathematics.active",
    "mathematics.threads",
    "mathematics.quaternion",
    "mathematics.interpolation",
    "mathematics.piecewise",
    "mathematics.curves",
    "mathematics.nlp",
    "mathematics.source",
    "mathematics.keeping",
    "mathematics.kernels",
    "mathematics.splines",
    "mathematics.tapes",
    "mathematics.core",
    "mathematics.many",
    "mathematics.linear",
    "mathematics.complementarity",
    "mathematics.constants",
    "mathematics.spectra",
    "mathematics.pieces",
    "mathematics.relations",
    "mathematics.forms",
    "mathematics.hysteresis",
    "mathematics.potentials",
    "mathematics.statements",
    "description",
    "description.described",
    "description.records",
    "description.showing",
    "description.columns",
    "description.matrices",
    "description.formulas",
    "description.laws",
    "description.stretch_laws",
    "description.relaxation",
    "description.sections",
    "description.shapes",
    "description.changes",
    "description.structure",
    "description.springs",
    "description.tendons",
    "description.tubes",
    "description.rings",
    "description.loads",
    "description.field_tables",
    "description.actuation",
    "description.contacts",
    "description.obstacles",
    "description.answers",
    "description.supports",
    "description.dimension",
    "description.task",
    "description.sliding",
    "description.moving",
    "description.remembering",
    "description.inserting",
    "description.scene",
    "description.scenefile",
    "mechanics",
    "mechanics.terms",
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
    "mechanics.parts",
    "mechanics.laws",
    "mechanics.stretch_laws",
    "mechanics.relaxation",
    "mechanics.singles",
    "mechanics.load_terms",
    "mechanics.actuation",
    "mechanics.magnetism",
    "mechanics.tendon_terms",
    "mechanics.tendon_friction",
    "mechanics.tendon_chains",
    "mechanics.tendon_shares",
    "mechanics.tubes",
    "mechanics.rings",
    "mechanics.clearances",
    "mechanics.contact_lines",
    "mechanics.contact_points",
    "mechanics.tube_fields",
    "mechanics.resistance",
    "mechanics.bodies",
    "mechanics.body_masses",
    "mechanics.connections",
    "mechanics.switches",
    "mechanics.pressure",
    "mechanics.loading",
    "mechanics.unwrapping",
    "mechanics.observed",
    "mechanics.body_points",
    "mechanics.mass_centers",
    "mechanics.masses",
    "mechanics.inertia_loads",
    "mechanics.rotating_frame",
    "mechanics.spots",
    "mechanics.model",
    "mechanics.unilateral",
    "mechanics.rubbing",
    "mechanics.tables",
    "mechanics.batches",
    "mechanics.memory",
    "mechanics.reactions",
    "mechanics.layout",
    "mechanics.evaluation",
    "mechanics.equations",
    "mechanics.expressions",
    "mechanics.inputs",
    "mechanics.stationarity",
    "mechanics.balance",
    "mechanics.fields",
    "mechanics.center_lines",
    "mechanics.law_limits",
    "mechanics.margins",
    "mechanics.fronts",
    "mechanics.displacements",
    "mechanics.accuracy",
    "solvers",
    "solvers.residuals",
    "solvers.sharing",
    "solvers.redundancy",
    "solvers.newton",
    "solvers.one_sided",
    "solvers.between_states",
    "solvers.neutral",
    "solvers.constraints",
    "solvers.guess",
    "solvers.sides",
    "solvers.stability",
    "solvers.divergence",
    "solvers.pseudo_transient",
    "solvers.globalised",
    "solvers.program",
    "solvers.problem",
    "solvers.prepared",
    "solvers.unrestrained",
    "solvers.deflation",
    "solvers.arclength",
    "solvers.critical",
    "solvers.continuation",
    "solvers.tracing",
    "solvers.beginning",
    "solvers.open_problem",
    "contact",
    "contact.pairs",
    "contact.nearby",
    "contact.closest",
    "contact.gripping",
    "contact.lines",
    "contact.spread",
    "contact.edges",
    "contact.passing",
    "contact.member_contact",
    "contact.stopped_ends",
    "contact.kept",
    "contact.held_inside",
    "contact.pressing",
    "equilibria",
    "equilibria.mirrors",
    "equilibria.solution",
    "equilibria.force_balance",
    "equilibria.quantities",
    "equilibria.several",
    "equilibria.scanning",
    "equilibria.single",
    "equilibria.settings",
    "equilibria.meshing",
    "equilibria.ways",
    "equilibria.refinement",
    "equilibria.further",
    "equilibria.member_contact_steps",
    "equilibria.several_in_contact",
    "equilibria.rough_contact_steps",
    "equilibria.memory_steps",
    "equilibria.insertion_steps",
    "equilibria.statics",
    "equilibria.stops",
    "dynamics",
    "dynamics.system",
    "dynamics.stages",
    "dynamics.methods",
    "dynamics.steps",
    "dynamics.taken",
    "dynamics.conserving",
    "dynamics.core_steps",
    "dynamics.integrating",
    "dynamics.beginning",
    "dynamics.inertia",
    "dynamics.projecting",
    "dynamics.shaping",
    "dynamics.sampling",
    "dynamics.rough_impacts",
    "dynamics.impacts",
    "dynamics.events",
    "dynamics.friction",
    "dynamics.motion",
    "dynamics.approaching",
    "dynamics.integrators",
    "dynamics.index_one",
    "dynamics.inertialess",
    "dynamics.idas",
    "dynamics.coupling",
    "dynamics.gaps",
    "dynamics.impulses",
    "dynamics.stepping",
    "dynamics.watching",
    "dynamics.simulation",
    "dynamics.small_motion",
    "dynamics.matrices",
    "dynamics.buckling",
    "dynamics.modes",
    "paths",
    "paths.path",
    "paths.vibrations",
    "paths.lying",
    "paths.rubbing",
    "paths.conditions",
    "paths.touching",
    "paths.switching",
    "paths.memory_path",
    "paths.paths",
    "paths.steps_along",
    "parametric",
    "parametric.results",
    "parametric.sliding_tubes",
    "parametric.arguments",
    "parametric.changing",
    "parametric.watching",
    "parametric.switched",
    "parametric.equilibrium",
    "parametric.implicit",
    "parametric.touching",
    "parametric.plain",
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
    "codegen.core_in_c",
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
    "sweeps.outcomes",
    "sweeps.batch",
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
    "pictures.colours",
    "pictures.files",
    "pictures.showing",
    "pictures.sheet",
    "pictures.plotting",
    "pictures.curves",
    "pictures.modeshapes",
    "pictures.charts",
    "pictures.motions",
    "pictures.controls",
    "pictures.fronts",
    "pictures.animation",
    "pictures.paraview",
    "reports",
    "pages",
    "pages.content",
    "pages.live",
    "pages.page",
    "outputs",
    "cli",
    "__init__",
    "__main__",
    "benchmarks",
    "benchmarks.saving",
    "benchmarks.timing",
    "benchmarks.scenes",
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
    "benchmarks.member_oracle",
    "benchmarks.member_checks",
    "benchmarks.member_scenes",
    "benchmarks.member_run",
    "benchmarks.ways",
    "benchmarks.heap",
    "benchmarks.importing",
    "benchmarks.speed",
    "benchmarks.shooting",
    "benchmarks.compared_problems",
    "benchmarks.compared_sfetcas",
    "benchmarks.compared_exudyn",
    "benchmarks.compared_opensees",
    "benchmarks.compared",
    "benchmarks.__main__",
]
"""A module imports only from names to its left."""

PROGRAMS = ("cli", "reports")
"""Modules of the package that print."""

PICTURES = (
    "pictures.showing",
    "pictures.sheet",
    "pictures.plotting",
    "pictures.curves",
    "pictures.modeshapes",
    "pictures.charts",
    "pictures.motions",
    "pictures.controls",
    "pictures.fronts",
    "pictures.animation",
)
"""What needs matplotlib, which a run pays for only when a picture is asked for."""


HEAVY = {"scipy", "tqdm"}
"""Packages that take long to import and that few runs need: they may be imported where they are used."""

DRAWING = ("plot", "animate", "page", "view")
"""Methods by which answers draw themselves: the only ones that import from pictures and pages, and only when called.
"""

PYPLOT = "pictures.showing"
"""The module that imports pyplot, which looks for a window system, when a figure is to be shown."""

DISPATCHERS = (
    "analyses",
    "outputs",
    "cli",
    "equilibria.statics",
    "description.field_tables",
    "description.laws",
    "description.stretch_laws",
)
"""What chooses, by a scene or by the words of a command, among much of which a run needs little: it imports what it
chose.  Potentials alone, of all that describes a scene, are expressions of CasADi."""


def named(path):
    """A module by its place below the package: ``mechanics.mesh``, ``mechanics`` for that package itself."""
    parts = path.relative_to(FOLDER if path.is_relative_to(FOLDER) else BENCHMARKS.parent).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


FILES = {named(path): path for path in sorted([*FOLDER.rglob("*.py"), *BENCHMARKS.glob("*.py")])}
PACKAGES = {"benchmarks", *(path.parent.name for path in FOLDER.glob("*/__init__.py"))}
MODULES = sorted(FILES)


@functools.cache
def tree(name):
    return ast.parse(FILES[name].read_text())


@functools.cache
def nodes(name):
    return list(ast.walk(tree(name)))


def each(rule):
    """One test of all modules, which tells every one that breaks the rule: a test for each would take twice as long."""

    def test():
        broken = []
        for name in MODULES:
            try:
                rule(name)
            except AssertionError as error:
                broken.append(f"{name}: {error}")
        assert not broken, "\n".join(broken)

    return test


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


@functools.cache
def taken():
    """For each module what others import from it: (module, names)."""
    found = {}
    for other in MODULES:
        for node in nodes(other):
            if isinstance(node, ast.ImportFrom) and node.level and len(sources(other, node)) == 1:
                (name,) = sources(other, node)
                names = {alias.name for alias in node.names} - {name.split(".")[-1]}
                found.setdefault(name, []).append((other, names))
    return found


@functools.cache
def drawn_by_methods(name):
    """Imports of pictures and pages in the methods that draw, and of their types for type checkers."""
    places = [n for n in nodes(name) if isinstance(n, ast.FunctionDef) and n.name in DRAWING]
    places += [n for n in nodes(name) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
    found = [n for place in places for n in ast.walk(place) if isinstance(n, ast.ImportFrom)]
    return {n for n in found if n.module == "matplotlib.figure" or str(n.module).startswith(("pictures.", "pages."))}


@functools.cache
def imported(name):
    """(own modules, other top-level packages) that a module imports, also inside functions."""
    own, other = set(), set()
    drawing = drawn_by_methods(name)
    for node in nodes(name):
        if node in drawing:
            continue
        if isinstance(node, ast.ImportFrom):
            if node.level or node.module.split(".")[0] == "sfetcas":
                own |= sources(name, node)
            else:
                other.add(node.module.split(".")[0])
        elif isinstance(node, ast.Import):
            other |= {alias.name.split(".")[0] for alias in node.names}
    # Whatever else is read from the package itself comes from the modules on the left of its own.
    own.discard("__version__")
    return {source if source in FILES else "__init__" for source in own}, other


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
    assert not {*PICTURES, *PROGRAMS} & own or name in ("outputs", "cli", "__main__", *PICTURES)
    assert "benchmarks" not in other, "benchmarks are not installed"


@each
def test_no_print_no_bare_except_no_global_state(name):
    for node in nodes(name):
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, f"bare except in line {node.lineno}"
            caught = {getattr(t, "id", "") for t in getattr(node.type, "elts", [node.type])}
            # The command line alone says at its end that a mistake is its own, with the whole traceback.
            last = name == "cli" and "traceback.print_exc()" in ast.unparse(node)
            assert not {"Exception", "BaseException"} & caught or last, f"catches everything in line {node.lineno}"
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
            assert name in PROGRAMS or name.startswith("benchmarks."), f"print in line {node.lineno}"
        assert not isinstance(node, ast.Global), f"global in line {node.lineno}"
        if isinstance(node, ast.ImportFrom):
            assert all(alias.name != "*" for alias in node.names)


def packages(node):
    """What an import reads, by its place."""
    return {alias.name for alias in node.names} if isinstance(node, ast.Import) else {node.module}


@each
def test_imports_stand_at_the_top(name):
    imports = [node for node in nodes(name) if isinstance(node, (ast.Import, ast.ImportFrom))]
    inside = {
        node
        for function in nodes(name)
        if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef))
        for node in ast.walk(function)
        if node in imports
    }
    # SciPy, each of whose parts takes a quarter to a half of the time in which sfetcas is imported, never at the top.
    inside -= drawn_by_methods(name)
    if name == PYPLOT:
        inside = {node for node in inside if ast.unparse(node) != "from matplotlib import pyplot"}
    scipy = {node for node in imports if any(str(package).split(".")[0] == "scipy" for package in packages(node))}
    assert scipy <= inside
    if name not in DISPATCHERS:
        assert {str(package).split(".")[0] for node in inside for package in packages(node)} <= HEAVY


def run_at_import(node):
    """What runs when a module is imported: all but the bodies of functions."""
    yield node
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
        named = [] if isinstance(node, ast.Lambda) else node.decorator_list
        parts = [*named, *node.args.defaults, *(each for each in node.args.kw_defaults if each is not None)]
    else:
        parts = ast.iter_child_nodes(node)
    for part in parts:
        yield from run_at_import(part)


@each
def test_tolerances_are_read_when_they_are_asked(name):
    # What is read at import does not follow a test that moves a tolerance.
    for node in run_at_import(tree(name)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id != "tolerances", f"tolerances.{node.attr} is read at import in line {node.lineno}"


@each
def test_all_is_complete_and_documented(name):
    if name in ("__main__", *PACKAGES, *PICTURES):
        assert ast.get_docstring(tree(name))
        return
    above = "" if name.startswith("benchmarks.") else "sfetcas."
    module = importlib.import_module("sfetcas" if name == "__init__" else above + name)
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
    for other, names in taken().get(name, []):
        assert names <= set(module.__all__), f"imported by {other}"


@each
def test_public_methods_are_documented(name):
    classes = [node for node in tree(name).body if isinstance(node, ast.ClassDef)]
    methods = [(c, m) for c in classes for m in c.body if isinstance(m, ast.FunctionDef) and not m.name.startswith("_")]
    # Overloads are types of the method that follows them.
    methods = [(c, m) for c, m in methods if not any(ast.unparse(d) == "overload" for d in m.decorator_list)]
    # What an abstract class asks for is said once, in its docstring.
    asked = {m.name for _, m in methods if any("abstractmethod" in ast.unparse(d) for d in m.decorator_list)}
    for owner, method in methods:
        if not owner.name.startswith("_") and method.name not in asked:
            assert ast.get_docstring(method), f"{owner.name}.{method.name}"


@functools.cache
def kinds():
    """Modules by the kinds of terms that they define."""

    def below(kind):
        return [kind, *(found for other in kind.__subclasses__() for found in below(other))]

    for name in MODULES:
        if name.startswith("mechanics."):
            importlib.import_module(f"sfetcas.{name}")
    modules = {kind.__name__: kind.__module__ for kind in below(Term)[1:] if kind.__module__.startswith("sfetcas.")}
    assert len(modules) > 30
    return {kind: module.removeprefix("sfetcas.") for kind, module in modules.items()}


def asked(node):
    """Names of the types that a call, a comparison or a pattern asks something for."""
    types = []
    if isinstance(node, ast.MatchClass):
        types = [node.cls]
    elif isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
        types = node.args[1:]
    elif isinstance(node, ast.Compare) and "type(" in ast.unparse(node):
        types = [node.left, *node.comparators]
    every = [part for one in types for part in ast.walk(one)]
    return {getattr(part, "id", getattr(part, "attr", getattr(part, "value", ""))) for part in every}


@each
def test_a_kind_of_term_is_asked_for_by_no_other_module(name):
    for node in nodes(name):
        foreign = {kind for kind in asked(node) if kinds().get(kind, name) != name}
        assert not foreign, f"asks for {', '.join(foreign)} in line {node.lineno}: let terms say what differs"


def test_package_has_the_names_that_type_checkers_see():
    seen = {
        (alias.name, f"sfetcas.{node.module}")
        for node in ast.walk(tree("__init__"))
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
    }
    assert seen == {(name, f"sfetcas.{module}") for name, module in sfetcas._MODULES.items()}
    assert {name for name, _ in seen} == set(sfetcas.__all__) <= set(dir(sfetcas))
    assert not [node for node in tree("__init__").body if getattr(node, "name", "") == "__getattr__"], "hides mistakes"
    for name, module in seen:
        assert getattr(sfetcas, name) is getattr(importlib.import_module(module), name)


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="module 'sfetcas' has no attribute 'solv'"):
        sfetcas.solv  # noqa: B018


def test_durations_are_those_of_tests(lost_names):
    """The line of a test that has another name by now is deleted; `pytest --time` writes the new one."""
    assert lost_names == []
