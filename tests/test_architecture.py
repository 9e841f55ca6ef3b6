"""The rules that keep the source readable: order of the modules, no cycle, nothing hidden."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import sfetcas

FOLDER = Path(sfetcas.__file__).parent

ORDER = [
    "errors",
    "arrays",
    "threads",
    "records",
    "quaternion",
    "interpolation",
    "curves",
    "nlp",
    "kernels",
    "linear",
    "later",
    "matrices",
    "sections",
    "shapes",
    "structure",
    "springs",
    "loads",
    "contacts",
    "obstacles",
    "supports",
    "dimension",
    "task",
    "scene",
    "scenefile",
    "elements",
    "joints",
    "contact_joints",
    "carried",
    "mesh",
    "rotations",
    "segments",
    "positions",
    "beams",
    "bodies",
    "connections",
    "pressure",
    "loading",
    "winding",
    "model",
    "work",
    "equations",
    "newton",
    "doctor",
    "guess",
    "stability",
    "divergence",
    "downhill",
    "problem",
    "prepared",
    "arclength",
    "critical",
    "tracing",
    "continuation",
    "beginning",
    "deflation",
    "open_problem",
    "balance",
    "fields",
    "mirrors",
    "touches",
    "settling",
    "cushions",
    "revising",
    "touching",
    "solution",
    "accuracy",
    "several",
    "contact_balance",
    "rolling",
    "contact_statics",
    "settings",
    "single",
    "meshing",
    "piloting",
    "refining",
    "statics",
    "stops",
    "path",
    "contact_curve",
    "contact_trace",
    "contact_path",
    "paths",
    "analyses",
    "checks",
    "benchmark",
    "sketch",
    "limits",
    "glyphs",
    "looks",
    "sheet",
    "plotting",
    "charts",
    "cli",
    "__init__",
    "__main__",
]
"""A module imports only from names to its left."""

PROGRAMS = ("cli", "benchmark")
"""What is run and not imported: only these print."""

PICTURES = ("sheet", "plotting", "charts")
"""What needs matplotlib, which a run pays for only when a picture is asked for."""

MODULES = sorted(path.stem for path in FOLDER.glob("*.py"))
TREES = {name: ast.parse((FOLDER / f"{name}.py").read_text()) for name in MODULES}
each = pytest.mark.parametrize("name", MODULES)


def imported(tree):
    """(own modules, other top-level packages) that a module imports, also inside functions."""
    own, other = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            if node.level:
                own |= {node.module} if node.module else {alias.name for alias in node.names}
            elif node.module.split(".")[0] == "sfetcas":
                own |= {node.module.split(".")[1]} if "." in node.module else {"__init__"}
            else:
                other.add(node.module.split(".")[0])
        elif isinstance(node, ast.Import):
            other |= {alias.name.split(".")[0] for alias in node.names}
    return own, other


def test_every_module_has_its_place():
    assert set(MODULES) <= set(ORDER), f"add to ORDER: {set(MODULES) - set(ORDER)}"


@each
def test_modules_import_only_from_their_left(name):
    wrong = {other for other in imported(TREES[name])[0] if ORDER.index(other) >= ORDER.index(name)}
    assert not wrong


@each
def test_mechanics_and_solvers_know_no_more_than_they_need(name):
    own, other = imported(TREES[name])
    if name in ("nlp", "interpolation", "quaternion", "kernels", "linear"):
        assert own <= {"errors", "arrays", "kernels"}, "mathematics knows no mechanics"
    if name in (
        "sections",
        "shapes",
        "structure",
        "loads",
        "supports",
        "dimension",
        "task",
        "scene",
        "records",
        "scenefile",
    ):
        assert "casadi" not in other, "descriptions need no solver"
    assert ("matplotlib" in other) == (name in PICTURES)
    assert not {*PICTURES, *PROGRAMS} & own or name in ("cli", "__main__", *PICTURES)


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
    # The picture is the one thing that a run does not pay for unless it is asked for.
    allowed = set(PICTURES) if name == "cli" else set()
    assert {getattr(node, "module", None) for node in inside} <= allowed


@each
def test_all_is_complete_and_documented(name):
    if name in ("__main__", *PICTURES):
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
    for other in MODULES:
        for node in ast.walk(TREES[other]):
            if isinstance(node, ast.ImportFrom) and node.level and node.module == name:
                assert {alias.name for alias in node.names} <= set(module.__all__), f"imported by {other}"


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
