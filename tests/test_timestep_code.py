"""Time steps as generated C: the steps of the integrator, to the last bit."""

import importlib
import json
import re
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import scenes
from systems import EVERYTHING
from test_codegen import built, needs_compiler, said

from sfetcas import Scene, SceneError, export, load, solve
from sfetcas.codegen.timestep import time_step
from sfetcas.dynamics.inertia import Inertia
from sfetcas.dynamics.stages import StageEquations
from sfetcas.dynamics.steps import LAST_CHANGE
from sfetcas.mathematics import core as c
from sfetcas.mechanics.equations import Equations, State
from sfetcas.mechanics.fields import Fields
from sfetcas.mechanics.masses import masses_of
from sfetcas.mechanics.model import assemble

PROBLEMS = Path(__file__).parent.parent / "problems"
MOVING = ["cantilever_force_pulse", "slider_crank_motion", "pendulum_flexible_smooth", "pendulums_rigid"]
MOVING += ["pendulum_in_space", "spin_up"]
INTEGRATORS = ["radau-3", "radau-2", "generalised-alpha", "conserving"]


def rod(**analysis):
    """A cantilever that a tip force bends suddenly."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s", "element": "SFET5", "elements": 2}},
            "loads": {"tip": {"type": "force", "node": "B", "value": [0, 2]}},
            "analysis": {"type": "dynamic", "end": 0.5, **analysis},
        }
    )


@needs_compiler
@pytest.mark.parametrize("name", MOVING)
def test_c_takes_the_steps_of_the_integrator(name, tmp_path):
    export(load(PROBLEMS / f"{name}.toml"), tmp_path / "c", name="motion")
    words = re.fullmatch(r"(\d+) of (\d+) steps agree, (\d+) of them to the last bit.*\n",
                         said(built(tmp_path / "c", "motion")))  # fmt: skip
    assert words
    assert words[1] == words[2] == words[3] == "10"
    # Something moves in them.
    cases = (tmp_path / "c" / "check.c").read_text().partition("expected[STEPS]")[2].partition("};")[0]
    steps = [re.findall(r"[-+.e0-9]+", line) for line in re.findall(r"\{([^{}]*)\}", cases)]
    assert len(steps) == 10
    assert steps[0] != steps[-1]


@needs_compiler
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_every_integrator_in_c(integrator, tmp_path):
    export(rod(integrator=integrator, step=0.01), tmp_path / "c", name="motion")
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_steps_are_those_of_the_simulation(integrator):
    scene = rod(integrator=integrator, step=0.01, output=0.5)
    made = time_step(scene, "motion")
    state = made.begin
    for _ in range(50):
        state = made.step(state, 0.01)
    found = dict(zip([r.name for r in made.results.results], np.split(made.outputs(state), splits(made)), strict=True))
    last = solve(scene).last
    # Elements are given: both have the same mesh; the prediction of a step does not change where Newton's method ends.
    assert found["nodes.B.position"] == pytest.approx(last.position("B"), abs=1e-9)
    # Velocities of answers come of polynomials through several steps: those of a step are of its order only.
    assert found["nodes.B.velocity"] == pytest.approx(last.velocity("B"), abs=0.1)
    assert found["energy.elastic"] == pytest.approx(last.energy["elastic"], abs=1e-9)
    assert found["energy.kinetic"] == pytest.approx(last.energy["kinetic"], rel=2e-3)
    if integrator == "conserving":
        # What it keeps is rounding in each of the steps.
        assert abs(found["energy.total"]) <= 1e-12


@pytest.mark.parametrize(
    ("name", "integrator"),
    [*((name, "radau-3") for name in EVERYTHING), ("hinged_space", "generalised-alpha"), ("guided", "radau-2")],
)
def test_energies_and_reactions_of_steps(name, integrator):
    """Of all kinds of terms and masses, against the evaluation in floating point."""
    scene, given = driven(name, integrator=integrator)
    made = time_step(scene, "motion", arguments=given)
    # The factor is 1, as of what has no history in a scene.
    shares = [(1.0 if one.name == "factor" else 0.6) * np.array(one.default) for one in made.arguments.arguments]
    p = np.concatenate([*shares, np.zeros(0)])
    state = made.step(made.step(made.begin, 0.01, p), 0.01, p)
    found = dict(
        zip([r.name for r in made.results.results], np.split(made.outputs(state, p), splits(made)), strict=True)
    )
    parts, scales = parts_of(made, state), made.model.scales
    rates = parts["rates"].reshape(made.method.kept, -1)
    velocity, acceleration = rates[0], rates[made.method.acceleration]
    model = assemble(made.arguments.scene_at(p), made.model.mesh, assembly="nodal", scales=scales)
    own = StageEquations(Equations(model), masses_of(model), "interpreted")
    inertia, loading = Inertia(own), own.loading(own.factors(0.0))
    q = parts["q"].reshape(made.system.layout.rotations, -1)
    still = State(q, parts["y"], parts["lam"], parts["near"])
    point = own.equations.at(still, loading)
    kinetic, elastic, loads = inertia.kinetic(velocity), point.strain, point.potential - point.strain
    assert kinetic > 0.0
    assert found["energy.kinetic"] == pytest.approx(kinetic * scales.moment, rel=1e-12)
    assert found["energy.elastic"] == pytest.approx(elastic * scales.moment, rel=1e-10)
    assert found["energy.total"] == pytest.approx((kinetic + elastic + loads) * scales.moment, rel=1e-10)
    effective = own.equations.effective(still, loading)
    forces = inertia.loading(own.equations, still, effective, velocity, acceleration)
    fields = Fields(own.equations, still, loading, lambda: (still, forces))
    held = [node for node, one in scene.nodes.items() if one.support != "free"]
    assert {key for key in found if key.startswith("reactions")} >= {f"reactions.{node}.force" for node in held}
    for node in held:
        for key, wanted in zip(("force", "moment"), fields.reaction(node), strict=True):
            told = found[f"reactions.{node}.{key}"]
            assert told == pytest.approx(wanted, rel=1e-9, abs=1e-12 * max(1.0, np.abs(wanted).max())), (node, key)


@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha"])
def test_what_drives_an_arm_and_holds_it(integrator):
    """Closed forms of a rigid arm with a mass at its tip that a history turns; from the first state on."""
    turned = {"t": [0, 1], "polynomial": [[0.0, 0.0, 1.0, -0.25]]}
    scene = Scene.from_dict(
        {
            "gravity": [0, -9.81],
            "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [2, 0], "mass": 0.5}},
            "members": {"arm": {"nodes": ["A", "B"], "type": "rigid"}},
            "motions": {"drive": {"node": "A", "rotation": 1.0, "history": "turn"}},
            "histories": {"turn": turned},
            "analysis": {"type": "dynamic", "end": 1.0, "step": 0.005, "integrator": integrator},
        }
    )
    names = ["reactions.A.force", "motions.drive.moment", "reactions.A.moment.2"]
    made = time_step(scene, "motion", arguments=["histories.turn"], results=names)
    state, t = made.begin, 0.0
    for k in range(101):
        if k:
            there = t + made.times * made.usual
            state, t = made.step(state, made.usual, (there**2 - 0.25 * there**3)[:, None]), t + made.usual
        angle, speed, faster = t**2 - 0.25 * t**3, 2.0 * t - 0.75 * t**2, 2.0 - 1.5 * t
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        force = 0.5 * (2.0 * (faster * across - speed**2 * along) + [0.0, 9.81])
        moment = 2.0 * (force @ across)
        told = made.outputs(state, np.array([angle]))
        if k in (0, 20, 100):
            # Three times the measured error of accelerations, of order 2 or 1, and of those found at the begin.
            bound = 1e-6 if k == 0 else 1e-4 if integrator == "radau-3" else 5e-2
            assert told == pytest.approx([*force, 0.0, moment, moment], abs=bound)


def test_reactions_that_are_not_told():
    """Those that depend on each other, and moments of several supports of one rigid body."""
    fixed = {"support": "clamped"}
    bar = {"type": "rigid", "nodes": ["A", "B"]}
    held = {
        "nodes": {"A": {"position": [0, 0], **fixed}, "B": {"position": [1, 0], **fixed}, "C": {"position": [2, 0]}},
        "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}},
        "members": {"bar": bar, "m": {"nodes": ["B", "C"], "section": "s", "elements": 2}},
        "analysis": {"type": "dynamic", "end": 1.0, "step": 0.01},
    }
    names = [one.name for one in time_step(Scene.from_dict(held), "motion").results.results]
    assert not any(name == "reactions.A.moment" for name in names)
    with pytest.raises(SceneError, match=r"one of several supports of a rigid body|not unique as closings depend"):
        time_step(Scene.from_dict(held), "motion", results=["reactions.A.moment"])


def test_numbers_that_change_how_a_small_member_moves_are_refused():
    with pytest.raises(
        SceneError, match=r"arguments: found sections.thick.EI3, with which masses change, accepted: loads"
    ):
        time_step(motion_of(EVERYTHING["small_space"]()), "motion", arguments=["factor", "sections.thick.EI3"])


needs_core = pytest.mark.skipif(c.core() is None, reason="no core here, and no compiler that makes one")


def motion_of(table, **analysis):
    return scenes.made({**table, "analysis": {"type": "dynamic", "end": 1.0, **analysis}})


def driven(name, **analysis):
    """A scene with every kind of term, whose motions begin at rest, and arguments that change its data."""
    table = EVERYTHING[name]()
    motions = {key: {**motion, "history": "on"} for key, motion in table.get("motions", {}).items()}
    more = {"motions": motions, "histories": {"on": {"t": [0, 1], "polynomial": [[0, 0, 1]]}}} if motions else {}
    scene = motion_of({**table, **more}, **analysis)
    # How a small member that is bent moves hangs on what it is bent by: such a number is refused.
    kept = {"thick"} if name == "small_space" else set()
    given = [
        f"sections.{key}.EI3" for key, one in scene.sections.items() if isinstance(one.EI3, float) and key not in kept
    ]
    given += [f"springs.{key}.stiffness" for key, one in scene.springs.items() if isinstance(one.stiffness, float)]
    given += ["factor"] if scene.loads or scene.motions else []
    return scene, [*given, *(f"loads.{key}.value" for key in scene.loads if not key.startswith("idle"))]


def parts_of(made, state):
    bounds = np.cumsum([0, *made.sizes.values()]).tolist()
    return {name: state[i:j] for name, i, j in zip(made.sizes, bounds, bounds[1:], strict=False)}


@needs_core
@pytest.mark.parametrize("integrator", ["radau-3", "radau-2", "generalised-alpha"])
@pytest.mark.parametrize("name", EVERYTHING)
def test_steps_by_the_core_are_those_of_the_functions(name, integrator):
    """From rest, then from there, then afresh, with arguments that differ from stage to stage."""
    scene, given = driven(name, integrator=integrator)
    made = time_step(scene, "motion", arguments=given)
    assert made.by_core is not None
    state = made.begin
    for number, h in enumerate((0.01, 0.0125, 0.0125)):
        p = (0.5 + 0.1 * number + 0.05 * made.times)[:, None] * made.arguments.defaults
        mine, size, iterations, gap = made.by_core.after(made.system.rows(p), h / made.time, state)
        other, last, count, missed = (np.array(part).ravel() for part in made.advance(state, h, p.T))
        assert iterations == count[0]
        assert abs(size - last[0]) <= 1e-6 * last[0] + 1e-12
        assert abs(gap - missed[0]) <= 1e-12
        assert size <= LAST_CHANGE
        one, two = parts_of(made, mine), parts_of(made, other)
        for part, values in one.items():
            # Rounding of a step, which rates and forces have over powers of its length: see test_core_steps.
            divided = {"rates": made.method.kept, "lam": 2}.get(part, 0)
            bound = 1e-10 * np.abs(two[part]).max(initial=1.0) + 5e-13 * (h / made.time) ** -divided
            assert np.abs(values - two[part]).max(initial=0.0) <= bound, part
        # The third step knows nothing of the second.
        state = np.append(mine[:-1], 0.0) if number else mine
    moved = parts_of(made, state)["q"] - parts_of(made, made.begin)["q"]
    assert np.abs(moved).max() > 1e-5


@needs_core
def test_pivots_of_another_matrix_change_rounding_alone():
    scene, given = driven("linked")
    made = time_step(scene, "motion", arguments=given)
    known, rows = made.by_core, made.system.rows(np.tile(2.0 * made.arguments.defaults, (3, 1)))
    assert known.flat.pivots
    found, state = [], made.begin
    for pivots in (known.flat.pivots, None, known.flat.pivots):
        known.flat.pivots = pivots
        found.append([known.after(rows, h / made.time, state)[0] for h in (0.008, 0.01)])
    # A step hangs on its state alone, not on which was taken before.
    assert all(np.array_equal(*pair) for pair in zip(found[0], found[2], strict=True))
    for mine, other in zip(*found[:2], strict=True):
        # Forces are accelerations, which have the rounding of places over the square of the step.
        assert mine == pytest.approx(other, rel=1e-9, abs=1e-9)
        assert not np.array_equal(mine, other)


@needs_compiler
@pytest.mark.parametrize("name", ["linked_space", "guided", "following_space", "sliding_plane"])
def test_data_that_vary_in_c(name, tmp_path):
    scene, given = driven(name, step=0.001)
    made = export(scene, tmp_path / "c", name="motion", arguments=given)
    assert made.by_core is None or made.system.inputs.varying
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


GAP = """
#include <stdio.h>
#include "motion.h"
static double p[MOTION_ARGUMENTS], state[MOTION_STATE];
static motion_memory memory;
int main(void) {
  motion_report report;
  motion_defaults(p);
  p[0] += 0.1;
  motion_begin(state);
  motion_step(&memory, 0.02, p, state, 0, &report);
  printf("%d %.17g", report.iterations, report.gap);
  return report.status;
}
"""


@needs_core
@needs_compiler
def test_gaps_of_guides_that_turn_are_told_in_c(tmp_path):
    scene, _ = driven("sliding_plane")
    made = export(scene, tmp_path / "c", name="motion", arguments=["nodes.B.direction", "factor"])
    (tmp_path / "c" / "gap.c").write_text(GAP)
    command = ["gcc", "-std=c99", "-O0", "-ffp-contract=off", "-o", "gap", "gap.c", "motion.c", "-lm"]
    subprocess.run(command, cwd=tmp_path / "c", check=True)
    iterations, gap = said(tmp_path / "c" / "gap").split()
    turned = made.arguments.defaults.copy()
    turned[0] += 0.1
    rows = made.system.rows(np.tile(turned, (3, 1)))
    _, size, count, missed = made.by_core.after(rows, 0.02 / made.time, made.begin)
    assert size <= LAST_CHANGE
    assert (int(iterations), float(gap)) == (count, missed)


@needs_compiler
def test_angles_go_on_beyond_a_turn_in_c(tmp_path):
    """A bar that is driven round against a spring and a damper: both count its turns."""
    table = {
        "sections": {"bar": {"rhoA": 2.0, "rhoI": [0.1, 0.1, 0.1]}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [0.5, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid", "section": "bar"}},
        "springs": {"s": {"node": "A", "stiffness": 0.2, "damping": 0.1}},
        "loads": {"d": {"type": "moment", "node": "A", "value": 3.0}},
    }
    scene = motion_of({**table, "dimension": "space"}, end=4.0, step=0.1)
    made = export(scene, tmp_path / "c", name="motion", arguments=["springs.s.stiffness", "loads.d.value"])
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))
    state = made.begin
    for _ in range(40):
        state = made.step(state, 0.1)
    plane = time_step(motion_of(table, end=4.0, step=0.1), "motion")
    flat = plane.begin
    for _ in range(40):
        flat = plane.step(flat, 0.1)
    turned = parts_of(plane, flat)["q"][0]
    assert abs(turned) > 2.0 * np.pi
    assert np.abs(parts_of(made, state)["near"]) == pytest.approx(abs(turned), rel=1e-6)


@needs_compiler
def test_steps_without_the_core_are_those_of_the_functions(tmp_path, monkeypatch):
    monkeypatch.setenv("SFETCAS_CORE", "off")
    made = export(rod(step=0.01), tmp_path / "c", name="motion")
    assert made.by_core is None
    assert "motion_advance(" in (tmp_path / "c" / "motion.c").read_text()
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "c", "motion"))


def splits(made):
    return np.cumsum([result.size for result in made.results.results])[:-1]


def test_loads_in_the_step_are_arguments():
    made = time_step(rod(), "motion", arguments=["loads.tip.value.1", "sections.s.EI3"])
    assert list(made.arguments.defaults) == [2.0, 1.0]
    state = made.begin
    for _ in range(20):
        state = made.step(state, 0.005, [0.0, 1.0])
    # Without load it stays where it is.
    assert made.outputs(state, [0.0, 1.0])[:4] == pytest.approx(made.outputs(made.begin, [0.0, 1.0])[:4], abs=1e-14)
    soft, stiff = made.begin, made.begin
    for _ in range(60):
        soft, stiff = made.step(soft, 0.005, [2.0, 0.5]), made.step(stiff, 0.005, [2.0, 40.0])
    y = [made.outputs(one)[5] for one in (soft, stiff)]
    assert y[0] > 1.5 * y[1] > 0.0


def test_a_step_that_fails_is_no_number():
    made = time_step(rod(), "motion")
    assert np.isnan(made.step(made.begin, 1e9, 1e9 * np.ones(3))).all()


def test_steps_so_short_that_rates_are_rounding_are_none():
    made = time_step(rod(), "motion")
    assert np.isfinite(made.step(made.begin, 2.0 * made.shortest)).all()
    assert np.isnan(made.step(made.begin, 0.5 * made.shortest)).all()


def test_what_nothing_resists_is_not_exported():
    """A rod that flies, turns about its axis and has no inertia there: the sentence of the motion."""
    table = {
        "dimension": "space",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0}},
        "nodes": {"A": {"position": [0, 0, 0]}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "elements": 2}},
        "loads": {"t": {"type": "moment", "node": "B", "value": [0.3, 0.2, 0.1]}},
    }
    scene, sentence = motion_of(table), "without 'rhoI' of the section s some rotations have no inertia"
    for run in (solve, lambda scene: time_step(scene, "motion")):
        with pytest.raises(SceneError, match=sentence):
            run(scene)


@needs_core
def test_threads_may_share_a_step():
    made = time_step(rod(step=0.01), "motion")

    def states(_):
        state, found = made.begin, []
        for _ in range(50):
            state = made.step(state, 0.01)
            found.append(state)
        return np.array(found)

    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(states, range(4))
    assert np.isfinite(first).all()
    assert all(np.array_equal(first, other) for other in others)


@needs_compiler
@pytest.mark.parametrize("flags", [["-O2", "-pedantic"], ["-O0", "-fsanitize=undefined", "-x", "c++"]])
def test_scenes_without_arguments_compile_without_warnings(flags, tmp_path):
    table = rod(step=0.01).to_dict()
    table.pop("loads")
    export(Scene.from_dict(table), tmp_path / "c", name="motion", arguments=[])
    flags = [*flags, "-Wall", "-Wextra", "-Werror"]
    compiler = "g++" if "c++" in flags else "gcc"
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    assert "10 of 10" in said(built(tmp_path / "c", "motion", flags=flags, compiler=compiler))


def test_names_of_what_is_inside_are_not_taken(tmp_path):
    with pytest.raises(SceneError, match=r"found 'sf_take', accepted: .* not with sf_"):
        export(rod(step=0.01), tmp_path / "c", name="sf_take")


@needs_compiler
def test_loader_of_steps(tmp_path):
    export(rod(step=0.01), tmp_path / "c", name="motion")
    subprocess.run(["make", "libmotion.so"], cwd=tmp_path / "c", check=True, capture_output=True)
    text = "import motion\nm = motion.Motion()\nfor _ in range(50): a = m.step(0.01)\n"
    text += (
        "bad = m.step(float('nan'))\nn = 'nodes.B.position'\nprint(a['status'], bad['status'], bad[n], m.time, *a[n])"
    )
    run = subprocess.run([sys.executable, "-c", text], cwd=tmp_path / "c", capture_output=True, text=True, check=True)
    status, bad, nothing, time, *position = run.stdout.split()
    assert (status, bad, nothing) == ("0", "2", "None")
    assert float(time) == pytest.approx(0.5)
    wanted = solve(rod(step=0.01, output=0.5)).last.position("B")
    assert [float(x) for x in position] == pytest.approx(wanted, abs=1e-9)


@needs_compiler
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs a C++ compiler")
def test_steps_are_cpp_and_pass_sanitizers(tmp_path):
    export(rod(step=0.01), tmp_path / "c", name="motion")
    flags = ["-x", "c++", "-O0", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    assert "10 of 10" in said(built(tmp_path / "c", "motion", flags=flags, compiler="g++"))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            {"results": ["reactions.A.force"]},
            "results.reactions.A.force: found steps of 'conserving', which do not tell it, accepted: radau-3, radau-2, "
            "generalised-alpha",
        ),
        (
            {"results": ["members.m.moment"]},
            "accepted of steps: members.*.position, members.*.quaternion",
        ),
        ({"arguments": ["sections.s.rhoA"]}, "accepted"),
        ({"sensitivities": True}, "found a motion, accepted of an equilibrium only"),
    ],
)
def test_what_a_step_cannot_tell(options, sentence, tmp_path):
    with pytest.raises(SceneError, match=re.escape(sentence)):
        export(rod(integrator="conserving"), tmp_path / "c", **options)


def test_steps_of_a_library_are_not_exported(tmp_path):
    with pytest.raises(SceneError, match="found 'idas', whose steps are a library's own, accepted for C: radau-3"):
        export(rod(integrator="idas"), tmp_path / "c")


UNIT = """
import fmpy, json
found = fmpy.simulate_fmu("MotionUnit.fmu", stop_time=0.5, step_size=0.01, output_interval=0.01,
                          start_values={"loads.tip.value.1": 3.0}, output=["nodes.B.position.1", "nodes.B.angle"])
print(json.dumps([float(x) for x in found[-1]]))
"""


@needs_compiler
def test_unit_for_cosimulation(tmp_path):
    made = export(rod(step=0.01), tmp_path / "c", name="motion")
    subprocess.run(["make", "libmotion.so"], cwd=tmp_path / "c", check=True, capture_output=True)
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", "motion_unit.py", "motion.py", "manifest.json"]
    subprocess.run([*build, "libmotion.so"], cwd=tmp_path / "c", check=True, capture_output=True)
    # A Python within a Python: what embeds it has aborted once in some 200 runs.
    runs = (
        subprocess.run([sys.executable, "-c", UNIT], cwd=tmp_path / "c", capture_output=True, text=True, check=False)
        for _ in range(2)
    )
    run = next((run for run in runs if run.returncode != -signal.SIGABRT), None)
    assert run is not None
    assert run.returncode == 0, run.stderr
    time, y, angle = json.loads(run.stdout.splitlines()[-1])
    state, loads = made.begin, made.arguments.defaults.copy()
    loads[-1] = 3.0
    for _ in range(50):
        state = made.step(state, 0.01, loads)
    told = dict(
        zip([r.name for r in made.results.results], np.split(made.outputs(state, loads), splits(made)), strict=True)
    )
    assert time == pytest.approx(0.5)
    # The clock of the co-simulation sums up its steps: their lengths differ by rounding.
    assert [y, angle] == pytest.approx([told["nodes.B.position"][1], told["nodes.B.angle"][0]], abs=1e-10)
    # An earlier export with its unit is one.
    export(rod(step=0.01), tmp_path / "c", name="motion", overwrite=True)


LIBRARY = """
import json, os
class Motion:
    def told(self, arguments):
        with open(os.path.join(os.path.dirname(__file__), "manifest.json")) as file:
            return {one["name"]: [0.0] * one["size"] for one in json.load(file)["results"]}
"""


def test_numbers_in_a_unit_have_names_of_their_own(tmp_path, monkeypatch):
    export(rod(step=0.01), tmp_path / "c", name="twice", arguments={"nodes.B.position.0": (0.5, 1.5), "factor": None})
    (tmp_path / "c" / "twice.py").write_text(LIBRARY)
    monkeypatch.syspath_prepend(tmp_path / "c")
    unit = importlib.import_module("twice_unit").TwiceUnit(instance_name="unit")
    assert {"nodes.B.position.0", "answer.nodes.B.position.0", "nodes.B.velocity.0"} < {
        v.name for v in unit.vars.values()
    }
    described = unit.to_xml()
    names = [one.get("name") for one in described.iter("ScalarVariable")]
    assert len(set(names)) == len(names)
    # What is structured has numbers in brackets.
    assert described.get("variableNamingConvention") == "flat"


def test_a_history_that_is_no_argument_stands_as_the_argument_would():
    table = rod().to_dict()
    table["histories"] = {"ramp": {"t": [0, 1, 2], "value": [0.25, 1.0, 0.0]}}
    table["loads"]["tip"]["history"] = "ramp"
    forces = []
    for names in (["loads.tip.value"], ["loads.tip.value", "histories.ramp"]):
        arguments = time_step(Scene.from_dict(table), "motion", arguments=names).arguments
        given = np.array(arguments.prepare("prepare")(arguments.defaults)).ravel()
        parts = dict(zip(arguments.program.sizes, np.cumsum(list(arguments.program.sizes.values())), strict=True))
        forces.append(given[parts["force"] - arguments.program.sizes["force"] : parts["force"]])
    assert np.array_equal(*forces)
    assert forces[0].any()
