"""What is imported when: the package itself next to nothing, a run of the command what its scene needs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from sfetcas.analyses import LATER
from sfetcas.sweeps.workers import PRELOADED
from sfetcas.tradeoff import running

ROOT = Path(__file__).parent.parent
SCENE = "problems/hinged_beam_end_shortening.toml"


def loaded(code):
    """Names of the modules that a process of its own has when it has run some code."""
    code += "\nimport sys; print(); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    return set(run.stdout.splitlines()[-1].split())


def own(modules):
    return {name for name in modules if name.startswith("sfetcas.")}


def test_package_imports_only_what_hears_signals():
    modules = loaded("import sfetcas; assert {'solve', 'Scene'} <= set(dir(sfetcas)) & set(sfetcas.__all__)")
    assert own(modules) == {"sfetcas.stopping"}
    assert not modules & {"numpy", "casadi", "pydantic", "scipy", "matplotlib", "asyncio", "multiprocessing"}


def test_package_lists_public_names_only():
    """Also after its modules were imported; the folder with functions for users once it is."""
    code = "import sfetcas, sfetcas.mechanics; first = set(dir(sfetcas)); import sfetcas.pictures.plotting"
    code += "; assert first == {*sfetcas.__all__, '__doc__', '__version__'}, first - {*sfetcas.__all__}"
    loaded(code + "; assert {*dir(sfetcas)} - first == {'pictures'}")


def test_scene_needs_no_solver():
    modules = loaded("from sfetcas import Node, Scene, load")
    packages = {name.split(".")[1] for name in own(modules)}
    assert packages == {"stopping", "errors", "quoting", "files", "tolerances", "mathematics", "description"}
    assert "casadi" not in modules


def test_static_run_imports_no_other_analysis():
    modules = loaded(f"from sfetcas.cli import main; main(['run', {SCENE!r}])")
    assert "sfetcas.equilibria.statics" in modules
    packages = {"parametric", "design", "codegen", "trajectories", "sweeps", "tradeoff", "pictures"}
    assert not {name.split(".")[1] for name in own(modules)} & packages
    # The classes of other answers are known, not what computes them.
    assert {name for name in own(modules) if ".dynamics." in name or ".paths." in name} == {
        "sfetcas.dynamics.friction",
        "sfetcas.dynamics.motion",
        "sfetcas.dynamics.projecting",
        "sfetcas.paths.path",
    }
    assert not modules & {"matplotlib", "asyncio", "multiprocessing", "tqdm"}


def test_public_name_stays_where_a_folder_has_the_same():
    loaded("import sfetcas, sfetcas.parametric.arguments\nassert sfetcas.parametric.__name__ == 'parametric'")


@pytest.mark.parametrize("command", [True, False])
def test_garbage_waits_while_the_command_imports(command):
    code = f"""
import gc, sys
sys.argv = [{"sfetcas" if command else "other"!r}]
import sfetcas.cli
assert gc.isenabled() == (not {command})
try:
    sfetcas.cli.main(["--version"])
except SystemExit:
    pass
assert gc.isenabled()
"""
    assert "sfetcas.cli" in loaded(code)


def test_processes_that_solve_have_all_analyses_imported():
    tree = ast.parse((ROOT / "sfetcas" / "analyses.py").read_text())
    (function,) = (node for node in tree.body if isinstance(node, ast.FunctionDef))
    chosen = {f"sfetcas.{node.module}" for node in ast.walk(function) if isinstance(node, ast.ImportFrom)}
    assert chosen - {"sfetcas.checks"} == set(LATER)
    assert set(LATER) <= {*PRELOADED} & {*running.PRELOADED}
