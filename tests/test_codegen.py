"""Generated C: the same numbers as in process, to the last bit; arguments, results, and what is refused."""

import ctypes
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import scenes
import systems
import tomli
from scenes import cantilever, helix

from benchmarks import code as benchmark_code
from sfetcas import Prepared, Scene, SceneError, Settings, assemble, export, load, solve, solve_model
from sfetcas.codegen.core_in_c import SolverTables
from sfetcas.codegen.derivatives import derivatives
from sfetcas.mathematics import core as c
from sfetcas.mathematics import kernels
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.fields import Fields
from sfetcas.parametric.arguments import argument, default_arguments
from sfetcas.parametric.equilibrium import equilibrium_solver
from sfetcas.solvers.globalised import Code

PROBLEMS = Path(__file__).parent.parent / "problems"


def is_static(file):
    """One pose, without contacts and slack tendons.

    By the text, as making scenes of all at each start of tests takes seconds.
    """
    table = tomli.loads(file.read_text(encoding="utf-8"))
    measured = [{"pull", "length"} & set(t) and not t.get("pushes") for t in table.get("tendons", {}).values()]
    static = table.get("analysis", {}).get("type", "static") == "static"
    pushed = any("insertion" in record for kind in ("tubes", "members") for record in table.get(kind, {}).values())
    return static and "contacts" not in table and not any(measured) and not pushed


STATIC = [file for file in sorted(PROBLEMS.glob("*.toml")) if is_static(file)]
FLAGS = ["-std=c99", "-O0", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]

needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler")


def built(folder, name, *, source="check.c", flags=FLAGS, compiler="gcc"):
    """An executable of the folder."""
    out = folder / f"{Path(source).stem}_built"
    files = [str(folder / source), str(folder / f"{name}.c")]
    subprocess.run([compiler, *flags, "-o", str(out), *files, "-lm", "-pthread"], check=True, cwd=folder)
    return out


def said(program, *arguments, code=0):
    run = subprocess.run([str(program), *arguments], capture_output=True, text=True, check=False)
    assert run.returncode == code, run.stdout + run.stderr
    return run.stdout


def beam(**more):
    return Scene.from_dict(cantilever(value=[0.3, 4.0], **more))


# -- the same numbers -----------------------------------------------------------------------------


@needs_compiler
# Every eighth: many are variations of each other, and all are compared by the check that comes with an export.
@pytest.mark.parametrize("file", STATIC[::8], ids=lambda file: file.stem)
def test_c_gives_the_bits_of_the_solver_in_process(file, tmp_path):
    scene = load(file)
    solver = export(scene, tmp_path / "c", name="structure")
    # Whatever the compiler makes faster keeps the bits; -O2 takes three times as long to compile, so that one has it.
    level = "-O2" if file == STATIC[0] else "-O1"
    program = built(tmp_path / "c", "structure", flags=[*FLAGS, level])
    words = re.fullmatch(r"(\d+) of (\d+) cases agree, (\d+) of them to the last bit.*\n", said(program))
    assert words
    outcome, results = solver.solve()
    assert outcome.code is (Code.UNSTABLE if solver.answer.certificate.stable is False else Code.SOLVED)
    # What has no solution is told by its status only.
    cases = int(words[2])
    assert int(words[1]) == cases
    assert int(words[3]) == cases
    # Where the whole loads carry the undeformed structure is where they lead to when they grow, or its mirror image.
    found, wanted = solver.by_name(results)["energy.elastic"], solver.answer.energy["elastic"]
    assert float(found) == pytest.approx(wanted, rel=30.0 * scene.analysis.accuracy, abs=1e-12)


@needs_compiler
@pytest.mark.parametrize("name", ["nothing is free", "many entries"])
def test_c_has_the_bits_of_the_process_whatever_the_size(name, tmp_path):
    if name == "many entries":
        table = scenes.bend_45()
        for member in table["members"].values():
            member["elements"] = 235
    else:
        table = {
            "dimension": "space",
            "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
            "loads": {"f": {"type": "force", "node": "B", "value": [0.3, -0.2, 0.7]}},
            "motions": {"turn": {"node": "A", "rotation": [0.4, -0.7, 0.2]}},
        }
    made = export(Scene.from_dict(table), tmp_path / "c", name="structure", results=["nodes.B.position"])
    assert (len(made.method.equations.row) > 50_000) == (name == "many entries")
    words = re.match(r"(\d+) of (\d+) cases agree, (\d+) of them", said(built(tmp_path / "c", "structure")))
    assert words[1] == words[2] == words[3]


@pytest.mark.skipif(c.core() is None, reason="there is no core")
@pytest.mark.parametrize("name", ["linked", "sliding_plane", "hinged_space", "following_space", "helix"])
def test_memory_of_c_is_what_the_core_takes(name):
    """Sizes that are told without the core, which there may not be where C is written."""
    scene = Scene.from_dict(getattr(systems, name, None)() if hasattr(systems, name) else getattr(scenes, name)())
    solver = equilibrium_solver(scene, "c", arguments=["factor"])
    tables, (core, system) = SolverTables(solver), solver.method.equations.for_search([])
    rules, inputs, alive = solver.method.for_core()
    core._layout.set_convex(rules)
    addresses = [ctypes.addressof(part) for part in (core._handed.structure, rules, inputs)]
    library = c.core()
    assert tables.sizes["work"] == library.sf_work_size(addresses[0])
    assert tables.sizes["find"] == library.sf_find_size(*addresses)
    assert tables.constants["FILLED"] == system._factors._factors.filled
    assert alive


@pytest.mark.parametrize("name", ["linked", "sliding_plane", "linked_space", "sliding_space", "following_space"])
def test_results_are_those_of_the_answer(name):
    scene = Scene.from_dict(getattr(systems, name)())
    places = {n: (0.0, 0.37, 1.0) for n, m in scene.members.items() if m.type == "flexible"}
    solver = equilibrium_solver(scene, "c", places=places)
    outcome, flat = solver.solve()
    assert outcome.code is Code.SOLVED
    program, model = solver.arguments.program, solver.model
    base = assemble(scene, model.mesh, assembly=model.assembly)
    fields = Fields(Equations(base), program.equations.state(outcome.state), base.loading(scene.analysis.steps[-1]))
    units = {"force": base.scales.force, "moment": base.scales.moment, "position": base.scales.length}
    for result, value in solver.by_name(flat).items():
        kind, _, rest = result.partition(".")
        what, _, key = rest.rpartition(".")
        if kind == "nodes":
            wanted = fields.position(what) if key == "position" else fields.rotation(what)
        elif kind == "reactions":
            wanted = fields.reaction(what)[key == "moment"]
        elif kind == "members":
            wanted = fields.along(what, np.array(places[what]))["rotation" if key in ("angle", "quaternion") else key]
        elif kind == "springs":
            wanted = fields.spring(what).to_dict()[key]
        else:
            continue
        difference = np.abs(value - np.reshape(wanted, value.shape)).max()
        # Residuals of 1e-10 are left.
        assert difference <= 1e-9 * units.get(key, 1.0) * max(1.0, np.abs(wanted).max()), result


# -- arguments ------------------------------------------------------------------------------------


def changed(table, path, value):
    """A table of a scene with another number."""
    table = json.loads(json.dumps(table))
    *way, last = path.split(".")
    here = table
    for key in way:
        here = here[int(key)] if isinstance(here, list) else here[key]
    here[int(last) if isinstance(here, list) else last] = value
    return table


ARGUMENTS = [
    ("linked", "loads.tip.value.1", None, -1.7),
    ("linked", "springs.knee.stiffness", None, 2.9),
    ("helix", "sections.s.GJ", None, 1.3),
    ("cantilever", "sections.s.EI3", None, 0.37),
    ("cantilever", "nodes.B.position.0", (0.7, 1.4), 1.21),
    ("cantilever", "factor", None, -0.8),
]


def table_of(name):
    if name == "cantilever":
        return cantilever(value=[0.3, 4.0])
    return helix() if name == "helix" else getattr(systems, name)()


@pytest.mark.parametrize(("name", "path", "span", "value"), ARGUMENTS)
def test_arguments_are_numbers_of_the_scene(name, path, span, value):
    scene = Scene.from_dict(table_of(name))
    solver = equilibrium_solver(scene, "c", arguments={path: span})
    outcome, flat = solver.solve([value])
    assert outcome.code is Code.SOLVED
    factor = value if path == "factor" else scene.analysis.steps[-1]
    other = scene if path == "factor" else Scene.from_dict(changed(scene.to_dict(), path, value))
    # IPOPT on the same mesh: nothing of the export takes part.
    answer = solve_model(assemble(other, solver.model.mesh, assembly=solver.model.assembly), factor)
    found = solver.by_name(flat)
    for node in scene.nodes:
        assert found[f"nodes.{node}.position"] == pytest.approx(answer.position(node), abs=1e-9)
    for node, record in scene.nodes.items():
        if record.support != "free":
            assert found[f"reactions.{node}.force"] == pytest.approx(answer.reaction(node)[0], abs=1e-8)


def test_arguments_that_act_together():
    table = cantilever(value=[0.0, 1.0])
    table["gravity"] = [0.0, -2.0]
    table["sections"]["s"]["rhoA"] = 0.7
    scene = Scene.from_dict(table)
    names = ["gravity", "sections.s.rhoA", "loads.tip.value", "factor"]
    solver = equilibrium_solver(scene, "c", arguments=names)
    assert solver.arguments.arguments[0].names == ("gravity.0", "gravity.1")
    numbers = [0.4, -1.3, 1.9, 0.3, 0.6, 1.7]
    _, flat = solver.solve(numbers)
    table["gravity"], table["sections"]["s"]["rhoA"] = numbers[:2], numbers[2]
    table["loads"]["tip"]["value"] = numbers[3:5]
    answer = solve_model(assemble(Scene.from_dict(table), solver.model.mesh), numbers[5])
    assert solver.by_name(flat)["nodes.B.position"] == pytest.approx(answer.position("B"), abs=1e-10)


def test_sensitivities_are_differences():
    scene = Scene.from_dict(systems.linked())
    first = next(iter(scene.loads))
    names = [f"loads.{first}.value", f"springs.{next(iter(scene.springs))}.stiffness"]
    solver = equilibrium_solver(scene, "c", arguments=names)
    base = solver.arguments.defaults
    outcome, _ = solver.solve()
    given = np.array(solver.prepare(base)).ravel()
    found = np.array(solver.sensitivities(base, outcome.state, given)).reshape(-1, len(base))
    for i in range(len(base)):
        step = np.zeros(len(base))
        step[i] = 1e-5
        ahead, behind = (solver.solve(base + sign * step)[1] for sign in (1.0, -1.0))
        wanted = (ahead - behind) / 2e-5
        # Rounding of results of residual 1e-12 over the step, and its square.
        assert np.abs(found[:, i] - wanted).max() <= 1e-6 * max(1.0, np.abs(wanted).max())


def test_compliance_is_what_a_small_load_does():
    scene = beam()
    names = ["nodes.B.position", "nodes.B.angle", "compliance.B", "stiffness.B"]
    solver = equilibrium_solver(scene, "c", arguments=["loads.tip.value"], results=names)
    found = solver.by_name(solver.solve()[1])
    assert found["compliance.B"] @ found["stiffness.B"] == pytest.approx(np.eye(3), abs=1e-9)
    for i in range(2):
        step = np.zeros(2)
        step[i] = 1e-5
        ahead, behind = (
            solver.by_name(solver.solve(solver.arguments.defaults + sign * step)[1]) for sign in (1.0, -1.0)
        )
        wanted = (ahead["nodes.B.position"][:2] - behind["nodes.B.position"][:2]) / 2e-5
        assert found["compliance.B"][:2, i] == pytest.approx(wanted, rel=1e-6, abs=1e-7)
        turned = float(ahead["nodes.B.angle"] - behind["nodes.B.angle"]) / 2e-5
        assert found["compliance.B"][2, i] == pytest.approx(turned, rel=1e-6, abs=1e-7)


def test_arguments_of_another_shape_are_refused_with_a_sentence():
    solver = equilibrium_solver(beam(), "c", arguments=["factor", "loads.tip.value"])
    count = solver.arguments.defaults.size
    for wrong in ([0.4], 0.4, np.ones(count + 1), np.ones((count, 1)), []):
        accepted = rf"arguments: found an array of shape \(.*\), accepted: \({count},\), for factor, loads\.tip\.value"
        with pytest.raises(ValueError, match=accepted):
            solver.solve(wrong)


def test_default_arguments():
    assert default_arguments(beam()) == ["factor", "loads.tip.value"]
    assert argument(beam(), "loads.tip.value").default == (0.3, 4.0)
    scene = load(PROBLEMS / "portal_frame_sprung_feet.toml")
    # Each load has a history, and nothing is left to the factor.
    names = ("first", "second", "third")
    assert default_arguments(scene) == [*(f"histories.{n}" for n in names), *(f"loads.{n}.value" for n in names)]


# -- the files ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("generated") / "c"
    export(beam(), place, **STRIP)
    return place


STRIP = {"name": "strip", "results": ["nodes.B.position", "reactions.A.moment"], "sensitivities": True}


def test_files_stand_alone(folder):
    source = (folder / "strip.c").read_text()
    assert {line for line in source.splitlines() if line.startswith("#include")} == {
        '#include "strip.h"',
        *(f"#include <{name}.h>" for name in ("math", "stddef", "string")),
    }
    assert not re.search(r"\b(malloc|calloc|realloc|free)\b", source)
    # All that is static is a function or constant: nothing is kept from call to call.
    kept = [line for line in source.splitlines() if re.match(r"\s*static ", line) and "const" not in line]
    assert all("(" in line for line in kept)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert [one["name"] for one in manifest["arguments"]] == ["factor", "loads.tip.value"]
    assert manifest["arguments"][1]["default"] == [0.3, 4.0]
    assert manifest["results"][0] == {
        "name": "nodes.B.position",
        "constant": "STRIP_RES_NODES_B_POSITION",
        "first": 0,
        "size": 3,
        "shape": [3],
        "unit": "m",
        "meaning": "position of the node B",
    }
    names = {file.name for file in folder.iterdir()}
    own = {"strip.c", "strip.h", "strip.py", "main.c", "check.c", "manifest.json"}
    assert own | {"Makefile", "CMakeLists.txt", "README.md"} <= names


@needs_compiler
def test_example_reads_arguments_and_prints(folder):
    program = built(folder, "strip", source="main.c")
    lines = said(program, "factor=0.5", "loads.tip.value.1=8").splitlines()
    found = [float(x) for x in lines[1].partition(": ")[2].split()]
    wanted = solve(Scene.from_dict(cantilever(value=[0.15, 4.0]))).last.position("B")
    assert found == pytest.approx(wanted, abs=2e-4)
    assert said(program, "loads.tip.value=1", code=2) == ""
    assert said(program, "factor=", code=2) == ""


@needs_compiler
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs a C++ compiler")
def test_cpp_takes_it(folder):
    flags = ["-x", "c++", "-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    assert "agree" in said(built(folder, "strip", flags=flags, compiler="g++"))


@pytest.mark.skipif(shutil.which("clang") is None, reason="needs clang")
def test_clang_takes_it(folder):
    assert "agree" in said(built(folder, "strip", compiler="clang"))


@needs_compiler
def test_sanitizers_are_silent(folder):
    flags = ["-std=c99", "-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    assert "agree" in said(built(folder, "strip", flags=flags))


THREADS = """
#include <pthread.h>
#include <stdio.h>
#include "strip.h"
#define N 4
#define SOLVES 200
typedef struct { strip_memory memory; double p[STRIP_ARGUMENTS], x[STRIP_STATE], r[SOLVES][STRIP_RESULTS]; } job;
static job jobs[N], serial;
static void work(job *one, int which) {
  int i;
  strip_defaults(one->p);
  for (i = 0; i < SOLVES; ++i) {
    one->p[0] = 0.1 * which + 0.01 * i;
    strip_solve(&one->memory, one->p, one->x, 0, one->r[i], 0);
  }
}
static void *start(void *one) { work((job *)one, (int)((job *)one - jobs)); return 0; }
int main(void) {
  pthread_t threads[N];
  int i, k, n, wrong = 0;
  for (i = 0; i < N; ++i) pthread_create(&threads[i], 0, start, &jobs[i]);
  for (i = 0; i < N; ++i) pthread_join(threads[i], 0);
  for (i = 0; i < N; ++i) {
    work(&serial, i);
    for (k = 0; k < SOLVES; ++k)
      for (n = 0; n < STRIP_RESULTS; ++n) wrong += serial.r[k][n] != jobs[i].r[k][n];
  }
  printf("%d", wrong);
  return 0;
}
"""


@needs_compiler
def test_threads_give_the_serial_answers(folder):
    (folder / "threads.c").write_text(THREADS)
    assert said(built(folder, "strip", source="threads.c", flags=["-std=c99", "-O1"])) == "0"


@needs_compiler
def test_two_exports_in_one_program(folder, tmp_path):
    other = tmp_path / "other"
    export(beam(), other, name="second", arguments=[])
    text = '#include "strip.h"\n#include "second.h"\n#include <stdio.h>\n'
    text += "static strip_memory a; static second_memory b; static double x[9999], p[9], r[999];\n"
    text += "int main(void){int s; strip_defaults(p); s = strip_solve(&a, p, x, 0, r, 0);\n"
    text += 's += second_solve(&b, p, x, 0, r, 0); printf("%d %s", s, second_message(0)); return 0;}\n'
    (tmp_path / "both.c").write_text(text)
    files = [str(tmp_path / "both.c"), str(folder / "strip.c"), str(other / "second.c")]
    out = tmp_path / "both"
    command = ["gcc", "-std=c99", "-O0", f"-I{folder}", f"-I{other}", "-o", str(out), *files, "-lm"]
    subprocess.run(command, check=True)
    assert said(out).startswith("0 an equilibrium")


@needs_compiler
def test_loader_needs_neither_sfetcas_nor_numpy(folder):
    subprocess.run(["make", "libstrip.so"], cwd=folder, check=True, capture_output=True)
    text = "import sys, strip\ns = strip.Solver()\na = s.solve({'factor': 0.5})\n"
    text += "b = s.solve({'factor': 0.51}, warm=True)\nbad = s.solve({'factor': float('nan')})\n"
    text += "assert 'numpy' not in sys.modules\n"
    text += "print(a['status'], b['iterations'] < a['iterations'], bad['nodes.B.position'], *a['nodes.B.position'])\n"
    run = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=True)
    status, sooner, bad, *position = run.stdout.split()
    assert (status, sooner, bad) == ("0", "True", "None")
    wanted = solve(Scene.from_dict(cantilever(value=[0.15, 2.0]))).last.position("B")
    assert [float(x) for x in position] == pytest.approx(wanted, abs=2e-4)
    text = "import strip\na = strip.Solver().solve()\nprint(repr(a['error']), repr(a['residual']), a['negative'])"
    run = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=True)
    error, residual, negative = map(float, run.stdout.split())
    outcome, _ = equilibrium_solver(beam(), "strip", results=STRIP["results"]).solve()
    assert (error, residual, negative) == (outcome.error, outcome.residual, outcome.negative)
    wrong = "import strip; strip.Solver().solve({'loads.tip.value': [1.0]})"
    run = subprocess.run([sys.executable, "-c", wrong], cwd=folder, capture_output=True, text=True, check=False)
    assert "loads.tip.value: found 1 numbers, accepted: 2" in run.stderr


@pytest.mark.parametrize(
    ("name", "factors"), [("cantilever_tip_force", (2.0, 5.0, 10.0)), ("bend_45_degrees", (200.0, 600.0, 1800.0))]
)
def test_error_in_the_report_is_about_that_of_positions(name, factors):
    """On a mesh that becomes too coarse as loads grow: never much below the error, and of its size."""
    scene = load(PROBLEMS / f"{name}.toml")
    coarse, fine = (
        equilibrium_solver(scene, "c", arguments=["factor"], results=["nodes.tip.position"], settings=settings)
        for settings in (Settings(elements=2), Settings(elements=16))
    )
    errors = []
    for factor in factors:
        (outcome, here), (_, there) = coarse.solve([factor]), fine.solve([factor])
        error = np.linalg.norm(here - there) / scene.size
        assert error <= 2.0 * outcome.error
        assert outcome.error <= 30.0 * error
        errors.append(outcome.error)
    assert errors == sorted(errors)
    assert errors[-1] > 100.0 * errors[0]


@needs_compiler
def test_no_solution_is_a_status_and_no_numbers(tmp_path):
    scene = Scene.from_dict({**cantilever(value=[0.0, 1.0]), "analysis": {"type": "static"}})
    solver = export(scene, tmp_path / "c", name="c")
    outcome, results = solver.solve([np.nan, 0.0, 1.0])
    assert outcome.code is Code.BAD_ARGUMENT
    assert np.isnan(results).all()
    text = '#include "c.h"\n#include <stdio.h>\n#include <math.h>\nstatic c_memory m; static double x[C_STATE];\n'
    text += "int main(void){double p[C_ARGUMENTS], r[C_RESULTS]; c_report e; int s; c_defaults(p); p[0] = 1e300;\n"
    text += 's = c_solve(&m, p, x, 0, r, &e); printf("%d %d", s == e.status, s <= 1 ? isfinite(r[0]) : isnan(r[0]));\n'
    text += "return 0;}\n"
    (tmp_path / "c" / "huge.c").write_text(text)
    assert said(built(tmp_path / "c", "c", source="huge.c")) == "1 1"


@needs_compiler
def test_what_is_solved_is_finite(tmp_path):
    # A force that turns the member by 135 degrees does more work than numbers can say.
    scene = Scene.from_dict(cantilever(value=[0.3, 4.0]))
    solver = export(scene, tmp_path / "c", name="c", arguments=["loads.tip.value", "sections.s.EI3"])
    cases = [
        [-1.7e308, 1.7e308, 1e306],
        [1.7e308, 1.7e308, 5.9e-309],
        [1.7e308, 4.0, 1.0],
        [-1.7e308, 1e308, 1e300],
        [0.3, 4.0, 1.7e308],
    ]
    statuses = []
    for case in cases:
        outcome, results = solver.solve(case)
        statuses.append(int(outcome.code))
        good = outcome.code in (Code.SOLVED, Code.UNSTABLE)
        assert np.isfinite(results).all() if good else np.isnan(results).all()
    assert {Code.SOLVED, Code.NOT_FINITE} <= set(statuses)
    text = '#include "c.h"\n#include <stdio.h>\n#include <math.h>\nstatic c_memory m; static double x[C_STATE];\n'
    text += "int main(void){int i, k; static const double p[][3] = {"
    text += ", ".join("{" + ", ".join(map(repr, case)) + "}" for case in cases)
    text += f"}};for(i = 0; i < {len(cases)}; ++i){{double r[C_RESULTS]; c_report e; int s, all = 1;\n"
    text += "s = c_solve(&m, p[i], x, 0, r, &e); for(k = 0; k < C_RESULTS; ++k) all &= s <= 1 ? isfinite(r[k]) : "
    text += 'isnan(r[k]);\nprintf("%d %d;", s, s == e.status && all && (s > 1 || isfinite(e.residual)));}return 0;}\n'
    (tmp_path / "c" / "huge.c").write_text(text)
    assert said(built(tmp_path / "c", "c", source="huge.c")) == "".join(f"{status} 1;" for status in statuses)


# -- what an attack found -------------------------------------------------------------------------


def two_strips(stiff):
    """A soft cantilever beside a stiff one, from one clamp."""
    table = cantilever(value=[0.0, 1.0])
    table["sections"]["stiff"] = {"EI3": stiff}
    table["nodes"]["C"] = {"position": [-1, 0]}
    table["members"]["other"] = {"nodes": ["A", "C"], "section": "stiff"}
    return table


@pytest.mark.parametrize("stiff", [1.0, 1e12])
def test_soft_parts_beside_stiff_ones_are_arguments_too(stiff):
    solver = equilibrium_solver(Scene.from_dict(two_strips(stiff)), "c", arguments=["sections.s.EI3"])
    table = cantilever(value=[0.0, 1.0])
    for value in (1.0, 2.0):
        table["sections"]["s"]["EI3"] = value
        wanted = solve(Scene.from_dict(table), accuracy=1e-8).last.position("B")
        found = solver.by_name(solver.solve([value])[1])["nodes.B.position"]
        assert found == pytest.approx(wanted, abs=1e-5)


def test_arguments_have_limits():
    names = {"nodes.B.position.1": (-0.2, 0.2), "sections.s.EI3": None}
    solver = equilibrium_solver(beam(), "c", arguments=names)
    assert solver.solve([0.1, 1.0])[0].code is Code.SOLVED
    for numbers in ([0.3, 1.0], [-0.3, 1.0], [0.0, 0.0], [0.0, -1.0], [np.inf, 1.0]):
        outcome, results = solver.solve(numbers)
        assert outcome.code is Code.BAD_ARGUMENT
        assert np.isnan(results).all()


@needs_compiler
def test_c_has_the_limits_and_refuses_states_that_are_none(tmp_path):
    scene = Scene.from_dict(systems.linked_space())
    export(scene, tmp_path / "c", name="c", arguments={"sections.s.GJ": None, "factor": (0.5, 2.0)})
    text = '#include "c.h"\n#include <stdio.h>\n#include <math.h>\nstatic c_memory m; static double x[C_STATE];\n'
    text += "static double z[C_STATE];\n"
    text += "int main(void){double p[2], r[C_RESULTS], q[C_RESULTS]; int a = 1, b, c, k; c_defaults(p);\n"
    # A state of zeros has no rotations: there the loads are followed from zero.
    text += "c_solve(&m, p, z, 0, q, 0); c_solve(&m, p, x, 1, r, 0);\n"
    text += "for (k = 0; k < C_RESULTS; ++k) a &= fabs(q[k] - r[k]) <= 1e-8 * (1.0 + fabs(q[k]));\n"
    text += "p[1] = 2.5; b = c_solve(&m, p, x, 0, r, 0) == C_BAD_ARGUMENT; p[1] = 1.0;\n"
    text += "p[0] = 0.0; c = c_solve(&m, p, x, 0, r, 0) == C_BAD_ARGUMENT;\n"
    text += 'printf("%d %d %d", a, b, c); return 0;}\n'
    (tmp_path / "c" / "limits.c").write_text(text)
    assert said(built(tmp_path / "c", "c", source="limits.c")) == "1 1 1"


def test_scenes_without_unknowns_are_exported(tmp_path):
    table = cantilever(value=[0.0, 1.0])
    table["members"]["m"] = {"nodes": ["A", "B"], "type": "rigid"}
    solver = export(Scene.from_dict(table), tmp_path / "c", sensitivities=True)
    found = solver.by_name(solver.solve()[1])
    assert found["nodes.B.position"] == pytest.approx([1, 0, 0], abs=1e-15)
    assert found["reactions.A.moment"] == pytest.approx([0, 0, -1], abs=1e-15)
    if shutil.which("gcc"):
        assert "agree" in said(built(tmp_path / "c", "structure"))


def test_what_is_not_unique_is_not_told():
    table = cantilever(value=[0.0, 1.0])
    table |= {"dimension": "space"}
    table["members"] = {n: {"nodes": ["A", "B"], "section": "s"} for n in ("one", "two")}
    table["nodes"]["A"] = {"position": [0, 0], "support": "clamped"}
    scene = Scene.from_dict(table)
    solver = equilibrium_solver(scene, "c")
    unique = not any("not unique" in note for note in solver.answer.notes)
    names = [one.name for one in solver.results.results]
    assert unique == any(name.startswith("reactions.") for name in names)
    if not unique:
        with pytest.raises(SceneError, match="not unique as closings depend on each other"):
            equilibrium_solver(scene, "c", results=["reactions.A.force"])


@pytest.mark.parametrize("title", ['a """ b \\N', "a /* b */ c", "load @50@ N", "\u00e9 %s"])
def test_titles_stand_in_comments(title, tmp_path):
    export(beam(title=title), tmp_path / "c", name="c", results=["nodes.B.position"])
    compile((tmp_path / "c" / "c.py").read_text(), "c.py", "exec")
    if shutil.which("gcc"):
        assert "agree" in said(built(tmp_path / "c", "c"))


@pytest.mark.parametrize("name", ["sf", "math", "m", "json", "main", "while", "INSTALL", "preinstall", "pythonfmu"])
def test_names_that_mean_something_else(name, tmp_path):
    with pytest.raises(SceneError, match="accepted: a name of letters"):
        export(beam(), tmp_path / "c", name=name)


def test_foreign_folders_are_not_overwritten(tmp_path):
    place = tmp_path / "web"
    place.mkdir()
    (place / "manifest.json").write_text("{}")
    with pytest.raises(SceneError, match="holds other things"):
        export(beam(), place, overwrite=True)
    (place / "manifest.json").write_text("[" * 200_000)
    with pytest.raises(SceneError, match="holds other things"):
        export(beam(), place, overwrite=True)
    (place / "manifest.json").unlink()
    export(beam(), place)
    (place / "thesis.txt").write_text("x")
    with pytest.raises(SceneError, match="holds other things"):
        export(beam(), place, overwrite=True)
    assert (place / "thesis.txt").read_text() == "x"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["analysis.accuracy"], "a number on which nothing depends"),
        (["loads.tip.value", "loads.tip.value.1"], "more than once"),
    ],
)
def test_arguments_without_effect(arguments, sentence):
    with pytest.raises(SceneError, match=sentence):
        equilibrium_solver(beam(), "c", arguments=arguments)


def test_stiffness_of_what_the_ground_holds():
    with pytest.raises(SceneError, match=r"a node that the ground holds, accepted: a free one, or compliance\.A"):
        equilibrium_solver(beam(), "c", results=["stiffness.A"])


def test_a_cold_solve_leads_where_statics_does():
    # Far beyond buckling whole loads carry a column elsewhere than growing ones do.
    scene = load(PROBLEMS / "cantilever_inclined_force_near_compression_other_side.toml")
    solver = equilibrium_solver(scene, "c")
    outcome, flat = solver.solve()
    assert outcome.code is Code.SOLVED
    found = solver.by_name(flat)
    for node in scene.nodes:
        size = 10.0 * scene.size * scene.analysis.accuracy
        assert found[f"nodes.{node}.position"] == pytest.approx(solver.answer.position(node), abs=size)


# -- in process -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "bend_45_degrees",
        "fourbar_curved_coupler",
        "fourbar_flexible_hinges_in_space",
        "spatial_loop_ball",
        "clamped_rod_end_twist",
    ],
)
def test_newton_in_process_gives_the_answers_of_ipopt(name):
    scene = load(PROBLEMS / f"{name}.toml")
    both = [solve(scene, Settings(solver=solver)).steps for solver in ("ipopt", "newton")]
    for one, other in zip(*both, strict=True):
        for node in scene.nodes:
            size = scene.size * scene.analysis.accuracy
            assert one.position(node) == pytest.approx(other.position(node), abs=2.0 * size)


def test_newton_is_deterministic():
    solver = equilibrium_solver(beam(), "c")
    first, second = (solver.solve() for _ in range(2))
    assert np.array_equal(first[0].state, second[0].state)
    warm, _ = solver.solve(start=first[0].state)
    assert warm.iterations < first[0].iterations
    assert warm.code is Code.SOLVED


# -- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"arguments": ["loads.tup.value"]}, "found 'tup', accepted: tip; did you mean 'tip'?"),
        ({"arguments": ["loads.tip.type"]}, "found 'loads.tip.type', accepted: a number of the scene"),
        ({"arguments": {"factor": (2.0, 1.0)}}, "found 2 to 1, accepted: a range from low to high"),
        ({"results": ["nodes.B.speed"]}, "found 'speed', accepted: angle, angular_velocity, position"),
        ({"results": ["shape"]}, "found 'shape', accepted: certificate, compliance"),
        ({"places": {"m": (0.0, 1.5)}}, "found [1.5], accepted: fractions from 0 to 1"),
        ({"places": {"bean": (0.0,)}}, "found 'bean', accepted: a flexible member"),
        ({"name": "2nd"}, "found '2nd', accepted: a name of letters"),
        ({"name": "struct"}, "found 'struct', accepted"),
    ],
)
def test_what_cannot_be_exported_is_said(options, sentence, tmp_path):
    with pytest.raises(SceneError, match=re.escape(sentence)):
        export(beam(), tmp_path / "c", **options)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        ("floor_heavy_cantilever", "contacts: member 'beam' lies along contacts.floor, accepted"),
        ("vibration_turning_1", "analysis.type: found 'modes', accepted"),
        ("vibration_clamped_free", "analysis.type: found 'modes', accepted"),
    ],
)
def test_scenes_that_cannot_be_exported(file, sentence, tmp_path):
    with pytest.raises(SceneError, match=re.escape(sentence)):
        export(load(PROBLEMS / f"{file}.toml"), tmp_path / "c")


def test_folders_are_not_lost(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("x")
    with pytest.raises(SceneError, match="exists and is not empty"):
        export(beam(), tmp_path / "full")
    with pytest.raises(SceneError, match="holds other things than an earlier export"):
        export(beam(), tmp_path / "full", overwrite=True)
    with pytest.raises(SceneError, match="is no folder"):
        export(beam(), tmp_path / "full" / "mine.txt")
    with pytest.raises(SceneError, match="found no folder"):
        export(beam(), tmp_path / "none" / "c")
    export(beam(), tmp_path / "c", arguments=[])
    export(beam(), tmp_path / "c", overwrite=True)
    assert "factor" in (tmp_path / "c" / "manifest.json").read_text()
    assert [file.name for file in (tmp_path / "full").iterdir()] == ["mine.txt"]


# -- energy, constraints and their derivatives ----------------------------------------------------

PROGRAMS = ["cantilever_tip_force", "slider_crank", "three_members_spring_and_guide", "spatial_fourbar"]
PROGRAMS += ["bend_45_degrees", "mechanism_two_loops_small"]


@needs_compiler
@pytest.mark.parametrize("name", PROGRAMS)
def test_derivatives_in_c(name, tmp_path):
    export(load(PROBLEMS / f"{name}.toml"), tmp_path / "c", name="c", derivatives=True)
    assert "3 of 3 cases agree, 3 of them to the last bit" in said(built(tmp_path / "c", "c"))


@pytest.mark.parametrize("name", PROGRAMS)
def test_derivatives_are_those_of_the_energy(name):
    program = derivatives(load(PROBLEMS / f"{name}.toml"), "c")
    base, x, functions = program.arguments.defaults, program.guess, program.functions
    random = np.random.default_rng(1)
    way, count = random.standard_normal(len(x)), program.nlp.g.numel()
    x = x + 0.05 * random.standard_normal(len(x))
    multipliers = random.standard_normal(count)

    def at(what, place, *more):
        return np.array(functions[what](base, place, *more)).ravel()

    def matrix(what, *more):
        return np.array(ca.DM(program.patterns[what], at(what, x, *more)))

    def slope(what, step=1e-5):
        return (at(what, x + step * way) - at(what, x - step * way)) / (2.0 * step)

    size = max(1.0, np.abs(at("gradient", x)).max())
    # Differences over 1e-5 know eleven digits less those of the third derivative.
    assert slope("energy") == pytest.approx(at("gradient", x) @ way, abs=1e-6 * size)
    second = matrix("hessian", 1.0, np.zeros(count))
    assert slope("gradient") == pytest.approx(second @ way, abs=1e-6 * max(size, np.abs(second).max()))
    assert second == pytest.approx(second.T, abs=1e-12 * np.abs(second).max())
    if count:
        first = matrix("jacobian")
        assert slope("constraints") == pytest.approx(first @ way, abs=1e-6)
        bent = matrix("hessian", 0.0, multipliers)
        change = [multipliers @ np.array(ca.DM(program.patterns["jacobian"], at("jacobian", x + s * way)))
                  for s in (1e-5, -1e-5)]  # fmt: skip
        assert (change[0] - change[1]) / 2e-5 == pytest.approx(bent @ way, abs=1e-5)


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_answer_is_stationary(name):
    program = derivatives(load(PROBLEMS / f"{name}.toml"), "c")
    base, x = program.arguments.defaults, program.guess
    gradient = np.array(program.functions["gradient"](base, x)).ravel()
    left = gradient
    if program.nlp.g.numel():
        assert np.array(program.functions["constraints"](base, x)).ravel() == pytest.approx(0.0, abs=1e-9)
        entries = np.array(program.functions["jacobian"](base, x)).ravel()
        first = np.array(ca.DM(program.patterns["jacobian"], entries))
        left = gradient + first.T @ np.linalg.lstsq(first.T, -gradient, rcond=None)[0]
    assert np.abs(left).max() <= 1e-9 * max(1.0, np.abs(gradient).max())


def test_programs_follow_their_arguments():
    program = derivatives(beam(), "c", arguments=["loads.tip.value", "factor"])
    numbers = np.array([1.0, -2.0, 0.7])
    table = cantilever(value=[1.0, -2.0])
    model = assemble(Scene.from_dict(table), program.model.mesh, assembly=program.model.assembly)
    problem = Prepared(model)._problem
    x = program.guess
    value = problem.parameters(model.loading(0.7))
    wanted = ca.Function("f", [problem.nlp.x, problem.nlp.p], [problem.nlp.f])(x, value)
    assert float(program.functions["energy"](numbers, x)) == pytest.approx(float(wanted), rel=1e-13)


@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("cantilever_follower_force", {}, "loads without potential, and moments in space, have no energy"),
        ("cantilever_tip_force", {"arguments": ["sections.beam.EI3"]}, "accepted of a program: loads and motions"),
        ("cantilever_tip_force", {"results": ["nodes.tip.position"]}, "accepted: none, as a program has unknowns"),
    ],
)
def test_programs_that_are_none(name, options, sentence, tmp_path):
    scene = load(PROBLEMS / f"{name}.toml")
    if "arguments" in options:
        options = {"arguments": [f"sections.{next(iter(scene.sections))}.EI3"]}
    with pytest.raises(SceneError, match=sentence):
        export(scene, tmp_path / "c", derivatives=True, **options)


# -- tools that may be there ----------------------------------------------------------------------


@needs_compiler
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind")
def test_valgrind_is_silent(folder):
    program = built(folder, "strip", flags=["-std=c99", "-O0", "-g"])
    command = ["valgrind", "--error-exitcode=9", "--leak-check=full", "--quiet", str(program)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""


@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("gcc") is None, reason="needs CMake and a compiler")
def test_cmake_builds_and_checks(folder, tmp_path):
    for command in (["-S", str(folder), "-B", "build"], ["--build", "build"]):
        subprocess.run(["cmake", *command], cwd=tmp_path, check=True, capture_output=True)
    run = subprocess.run(["ctest"], cwd=tmp_path / "build", capture_output=True, text=True, check=False)
    assert "100% tests passed" in run.stdout


def test_export_needs_no_compiler(tmp_path, monkeypatch):
    def none(*_):
        raise AssertionError("an export compiles or loads nothing")

    monkeypatch.setenv("SFETCAS_KERNELS", "compiled")
    monkeypatch.setattr(kernels, "compiled", none)
    monkeypatch.setattr(kernels, "_load", none)
    export(beam(), tmp_path / "c")
    export(beam(), tmp_path / "d", derivatives=True)


@needs_compiler
def test_benchmark_of_generated_c(capsys, monkeypatch):
    monkeypatch.setattr(benchmark_code, "CASES", ((False, "SFET5", 2),))
    monkeypatch.setattr(benchmark_code, "STEPS", ("radau-2",))
    benchmark_code.code()
    said_of = capsys.readouterr().out
    assert "plane, 2 SFET5" in said_of
    assert "radau-2" in said_of


@needs_compiler
def test_sensitivities_in_c_are_those_in_process(folder):
    text = '#include "strip.h"\n#include <stdio.h>\nstatic strip_memory m;\n'
    text += "static double x[STRIP_STATE], p[9], r[99], d[999];\n"
    text += (
        "int main(void){int i; strip_defaults(p); strip_solve(&m, p, x, 0, r, 0); strip_sensitivities(&m, p, x, d);\n"
    )
    text += 'for (i = 0; i < STRIP_RESULTS * STRIP_ARGUMENTS; ++i) printf("%.17g ", d[i]);\nreturn 0;}\n'
    (folder / "slopes.c").write_text(text)
    found = [float(x) for x in said(built(folder, "strip", source="slopes.c")).split()]
    results = ["nodes.B.position", "reactions.A.moment"]
    solver = equilibrium_solver(beam(), "c", results=results)
    outcome, _ = solver.solve()
    given = solver.prepare(solver.arguments.defaults)
    wanted = np.array(solver.sensitivities(solver.arguments.defaults, outcome.state, given)).ravel()
    assert np.array_equal(found, wanted)


def test_a_range_has_what_the_scene_says(tmp_path):
    with pytest.raises(SceneError, match="found 4 in the scene, accepted: a range from low to high that has it"):
        export(beam(), tmp_path / "c", arguments={"loads.tip.value": (0.0, 1.0)})
