"""What objects print as in a session: a few lines with what matters, no addresses, names as texts."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import sfetcas
from sfetcas import (
    Analysis,
    Arc,
    CrossSection,
    Curvature,
    Design,
    Expect,
    History,
    Load,
    Measurement,
    Member,
    Motion,
    Node,
    OptimalControl,
    Parameter,
    Polynomial,
    Prepared,
    QuasiStatic,
    Scene,
    Settings,
    Spring,
    Table,
    assemble,
    equilibrium_nlp,
    fit,
    grid,
    motion_functions,
    parametric,
    respond,
    solve,
    sweep,
    uniform_mesh,
)
from sfetcas.trajectories.controlled_motion import Check

RECORDS = [
    (CrossSection(EI3=1.0), "CrossSection(EI3=1.0)"),
    (CrossSection(EI3=Table(at=[0, 1], value=[1, 2])), "CrossSection(EI3=Table(at=(0.0, 1.0), value=(1.0, 2.0)))"),
    (CrossSection(EI3=Polynomial(polynomial=[1])), "CrossSection(EI3=Polynomial(polynomial=(1.0,)))"),
    (Node(position=[0, 0], support="clamped"), "Node(position=(0.0, 0.0, 0.0), support='clamped')"),
    (Load(type="moment", node='a "b"', value=1), "Load(type='moment', node='a \"b\"', value=1.0)"),
    (
        Member(nodes=["A", "B"], section="s", shape=Arc(angle=1)),
        "Member(nodes=('A', 'B'), section='s', shape=Arc(angle=1.0))",
    ),
    (Curvature(length=1, kappa3=[1]), "Curvature(kappa3=(1.0,), length=1.0)"),
    (Spring(node="A", stiffness=2), "Spring(node='A', stiffness=2.0)"),
    (Motion(node="A", rotation=[0, 0, 1]), "Motion(node='A', rotation=(0.0, 0.0, 1.0))"),
    (
        History(t=[0, 1], value=[0, 1], interpolation="spline"),
        "History(t=(0.0, 1.0), value=(0.0, 1.0), interpolation='spline')",
    ),
    (Analysis(accuracy=1e-6), "Analysis(accuracy=1e-06)"),
    (Expect(quantity="factor", value=1), "Expect(quantity='factor', value=1)"),
]


@pytest.mark.parametrize(("record", "text"), RECORDS, ids=[type(record).__name__ for record, _ in RECORDS])
def test_a_record_prints_as_it_would_be_made(record, text):
    assert repr(record) == str(record) == text
    assert eval(text, vars(sfetcas)) == record
    assert repr(pickle.loads(pickle.dumps(record))) == text


def test_settings_and_parameters_print_what_differs():
    assert repr(Settings()) == "Settings()"
    assert repr(Settings(accuracy=1e-3, element="SFET4")) == "Settings(accuracy=0.001, element='SFET4')"
    assert repr(Parameter(np.float64(1.0), lambda x: {}, low=0.5)) == "Parameter(value=1.0, low=0.5)"


def test_long_lists_and_texts_are_cut():
    history = History(t=range(40), value=np.zeros(40))
    assert (
        repr(history) == "History(t=(0.0, 1.0, 2.0, 3.0, ... and 36 more), value=(0.0, 0.0, 0.0, 0.0, ... and 36 more))"
    )
    small = Member(nodes=["A", "B"], type="small", stiffness=np.diag([0.0, *np.ones(11)]).tolist())
    assert repr(small) == "Member(nodes=('A', 'B'), type='small', stiffness=(12 rows of numbers))"
    assert len(repr(Expect(quantity="factor", value=1, why=1000 * "because "))) < 160


HOSTILE = """</script> "x" 'y' {z} $1 %s \\ \u00e9\u6f22 <!-- */"""


def cantilever(node="tip", title="a strip", **more):
    """A cantilever with a tip force, and one answer in a plane mesh."""
    table = {
        "title": title,
        "sections": {"strip": {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {"root": {"position": [0, 0], "support": "clamped"}, node: {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["root", node], "section": "strip", "elements": 4, "element": "SFET4"}},
        "loads": {"pull": {"type": "force", "node": node, "value": [0, 1]}},
        **more,
    }
    return Scene.from_dict(table)


SCENE = cantilever(gravity=[0, -1e-3], expect=[{"quantity": "factor", "value": 1.0, "tolerance": 0.0}])


def test_a_scene_prints_what_there_is():
    assert repr(SCENE) == str(SCENE)
    assert repr(SCENE).splitlines() == [
        "Scene('a strip', plane, static)",
        "  1 section: 'strip'",
        "  2 nodes: 'root', 'tip'",
        "  1 member: 'beam'",
        "  1 load: 'pull'",
        "  gravity: (0, -0.001, 0) m/s2",
        "  1 known value",
    ]
    many = {f"n{i}": {"position": [i, 0], "support": "clamped" if not i else "free"} for i in range(41)}
    members = {f"m{i}": {"nodes": [f"n{i}", f"n{i + 1}"], "section": "strip"} for i in range(40)}
    text = repr(SCENE.replace(nodes=many, members=members, loads=None, title=None))
    assert "  41 nodes: 'n0', 'n1', 'n2', 'n3', ... and 37 more" in text.splitlines()


def test_an_equilibrium_prints_where_its_free_end_is():
    step = solve(SCENE).last
    x, y, _ = step.position("tip")
    head, place = repr(step).splitlines()
    assert head.startswith("Equilibrium(factor=1, stable, ")
    assert place == f"  node 'tip': position ({x:.6g}, {y:.6g}, 0) m, angle {step.angle('tip'):.6g} rad"
    assert repr(step.certificate).startswith("Certificate(stable, ")


def test_nodes_at_free_ends_come_first_and_others_are_counted():
    nodes = {f"n{i}": Node(position=[i, 0], support="free" if i else "clamped") for i in range(9)}
    members = {f"m{i}": Member(nodes=[f"n{i}", f"n{i + 1}"], section="strip", elements=1) for i in range(8)}
    lines = repr(solve(SCENE.replace(nodes=nodes, members=members, loads=None, expect=())).last).splitlines()
    assert lines[1].startswith("  node 'n8': position (")
    assert lines[5] == "  ... and 4 more nodes"


def pendulum():
    """A bar that swings."""
    return cantilever(
        nodes={"root": {"position": [0, 0], "support": "hinge"}, "tip": {"position": [1, 0]}},
        loads={"pull": {"type": "moment", "node": "root", "value": 0.5}},
        gravity=[0, -1],
        analysis={"type": "dynamic", "end": 0.1, "step": 0.02, "output": 0.05},
    )


@pytest.fixture(scope="module")
def things():
    """One of each public kind of answer and problem, of scenes with a hostile name and title."""
    scene = cantilever(HOSTILE, HOSTILE + "\n\x1b[2J")
    place = f"nodes.{HOSTILE}.position"
    path = solve(scene.replace(analysis=Analysis(type="path", range=[0, 1], points=5, accuracy=1e-2)))
    motion = solve(pendulum())
    tip = parametric(scene, {"loads.pull.value": None}, [place])
    measured = [Measurement(place, [0.8, 0.5], 0.01, {"loads.pull.value": [0, x]}) for x in (1.0, 2.0)]
    model = assemble(scene, uniform_mesh(scene, 3, 4))
    program = equilibrium_nlp(model)
    design = Design(scene, variables={"sections.strip.EI3": (0.2, 50)})
    design.minimise(design.variable("sections.strip.EI3"))
    design.subject_to(design.answer("", place)[1] <= 0.25, name=HOSTILE)
    design.minimise(design.unknown("\x1b[2J\n", 1.0, 0.0, 2.0) ** 2)
    slowly = QuasiStatic(scene, {"loads.pull.value.1": (-5, 5)}, points=3)
    slowly.subject_to(slowly.answer(place)[:, 1] == 0.1 * slowly.s)
    control = OptimalControl(pendulum(), {"loads.pull.value": (-5, 5)}, time=0.5, intervals=4)
    control.minimise(control.integral(control.control("loads.pull.value") ** 2))
    thick = pendulum().replace({"sections.strip.rhoI": [1e-3] * 3})
    response = respond(pendulum(), {"loads.pull.value": History(t=[0, 1], value=[0, 0])}, 0.1)
    fitted = fit(scene, ["sections.strip.EI3"], measured)
    answers = {
        "Scene": scene,
        "Solution": solve(scene),
        "Equilibrium": solve(scene).last,
        "Path": path,
        "Branch": path.main,
        "PathPoint": path.points[1],
        "Modes": solve(scene.replace(analysis=Analysis(type="modes", accuracy=1e-2))),
        "Trajectory": motion,
        "MotionState": motion.last,
        "ParametricEquilibrium": tip,
        "ParametricAnswer": tip.solve(),
        "EquilibriumSolver": tip.solver,
        "Fit": fitted,
        "Fitting": fitted.of,
        "Measurement": measured[0],
        "Model": model,
        "Mesh": model.mesh,
        "Prepared": Prepared(model),
        "OpenProblem": program,
        "NLP": program.nlp,
        "OpenAnswer": program.subject_to(program.position(HOSTILE)[1] == 0.2, name=HOSTILE).solve(),
        "Design": design,
        "DesignAnswer": design.solve(),
        "QuasiStatic": slowly,
        "QuasiStaticAnswer": slowly.solve(),
        "OptimalControl": control,
        "ControlledMotion": control.solve(replay=False),
        "Response": response,
        # A replay of the controlled motion would take longer than all else.
        "Check": Check(response, 1e-5, 1e-6, "radau-3", 0.01),
        "MotionFunctions": motion_functions(thick, inputs=["loads.pull.value"]),
        "Cases": grid({"loads.pull.value.1": np.linspace(0, 1, 50)}),
        "Parameter": Parameter(1.0, lambda x: {}),
    }
    answers["Certificate"] = answers["Equilibrium"].certificate
    answers["Mode"] = answers["Modes"].modes[0]
    answers["NLPResult"] = answers["OpenAnswer"].result
    answers["ControlledMotion"] = replace(answers["ControlledMotion"], check=answers["Check"])
    return answers


def test_all_print_as_a_few_lines_without_addresses(things):
    for name, thing in things.items():
        text = repr(thing)
        assert text == str(thing)
        assert text.startswith(f"{name}("), name
        lines = text.splitlines()
        assert len(lines) <= 12, name
        assert max(map(len, lines)) <= 320, name
        assert " at 0x" not in text
        assert "array(" not in text, name
        # Nothing that a terminal would obey, and lines that are those of the text alone.
        assert all(line.isprintable() for line in lines), name
        assert len(lines) == len(text.split("\n")), name


def test_names_and_titles_stand_as_texts(things):
    assert repr(things["Scene"]).splitlines()[0] == f"Scene({HOSTILE + chr(10) + chr(27) + '[2J'!r}, plane, static)"
    assert f"  2 nodes: 'root', {HOSTILE!r}" in repr(things["Scene"])
    assert f"node {HOSTILE!r}: position (" in repr(things["Solution"])
    assert f"multiplier of {HOSTILE!r}: " in repr(things["OpenAnswer"])
    assert "  \\x1b[2J\\n: " in repr(things["DesignAnswer"])


def test_failures_and_notes_are_told():
    cases = grid({"sections.strip.EI3": [1.0, -1.0]})
    with ThreadPoolExecutor(1) as executor:
        found = sweep(cantilever(), cases, ["nodes.tip.position"], executor=executor)
    lines = repr(found).splitlines()
    assert lines[0].startswith("Sweep(2 cases, 1 solved in ")
    assert lines[-1] == "  case 1: refused: sections.strip.EI3: found -1, accepted: a number above zero"
    column = cantilever(loads={"push": {"type": "force", "node": "tip", "value": [-10, 0]}})
    first, *rest = (note for note in solve(column).last.notes)
    more = f" (and {len(rest)} more note{'s' if len(rest) > 1 else ''}, see .notes)" if rest else ""
    assert repr(solve(column)).splitlines()[-1] == f"  note: {first}{more}"


def test_units_stand_behind_numbers(things):
    assert "  loads.pull.value: (0, 1) N" in repr(things["ParametricAnswer"]).splitlines()
    assert "rad/s" in repr(things["Modes"])
    assert " m/s" in repr(things["MotionState"])
