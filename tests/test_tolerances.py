"""What the numbers of `tolerances` decide stays decided when one is ten times as large, or as small."""

import ast
import functools
import inspect
import itertools
import types
from pathlib import Path

import numpy as np
import pytest
from scenes import SOFT, cantilever, made, model_of, three_parallel_cranks
from systems import linked_space, small_plane

import sfetcas
from sfetcas import tolerances
from sfetcas.checks import check
from sfetcas.equilibria.mirrors import mirrors
from sfetcas.solvers.prepared import Prepared

FOLDER = Path(__file__).parent.parent / "problems"
PROBLEMS = [
    "flexible_parallelogram",
    "floor_cantilever_tip_moment",
    "heavy_column_in_space",
    "lee_frame",
]
NAMES = [name for name in vars(tolerances) if name.isupper()]


def told(table):
    """What an analysis says: words that have to stay, and numbers; or the sentence of a refusal."""
    try:
        solution = sfetcas.solve(made(table))
    except (sfetcas.SceneError, sfetcas.SolveError) as error:
        return (str(error),), np.zeros(0)
    if hasattr(solution, "modes"):
        words = (solution.status, solution.rigid)
        return words, np.array([[mode.omega, mode.damping] for mode in solution.modes]).ravel()
    words, numbers = [solution.status], []
    for step in solution.steps:
        words += [step.certificate.stable, step.certificate.negative, *(note.split(":")[0] for note in step.notes)]
        numbers += [step.position(name) for name in step.model.scene.nodes]
        numbers += [[step.certificate.smallest / 100.0]]
    return tuple(words), np.concatenate(numbers)


def all_but_plane():
    """A tip in the plane but for rounding, under loads at places that are one but for that."""
    table = cantilever((0.3, 1.0))
    table["nodes"]["B"]["position"] = [1, 0, 1e-14]
    both = {"type": "force", "member": "m", "value": [0.0, -0.5]}
    table["loads"] |= {"one": {**both, "at": 0.1 + 0.2}, "other": {**both, "at": 0.3}}
    scene = made(table)
    words, numbers = told(table)
    return (*words, scene.resolved_dimension, len(model_of(table).mesh.cuts["m"])), numbers


def universal_joint_in_ten_digits():
    table = linked_space()
    table["nodes"]["A"]["axis2"] = [1, 1e-10, 0]
    return told(table)


def door():
    """On two hinges along one line, whose directions were written with eight digits."""
    post = [0.6, 0.0, 0.8]
    return told(
        {
            "sections": {"s": {**SOFT}},
            "nodes": {
                "A": {"position": [0, 0, 0], "support": "hinge", "axis": post},
                "B": {"position": post, "support": "hinge", "axis": [0.6, 2e-8, 0.8]},
                "C": {"position": [0.3, 0.5, 0.4]},
            },
            "members": {
                "post": {"nodes": ["A", "B"], "type": "rigid"},
                "flap": {"nodes": ["A", "C"], "section": "s"},
            },
            "springs": {"s": {"node": "A", "axis": post, "stiffness": 1.0}},
            "loads": {"push": {"type": "force", "node": "C", "value": [0.8, 0.0, -0.6]}},
        }
    )


def nearly_a_mirror_image():
    """A portal whose second post is longer by what its places were rounded."""
    places = {"A": [0, 0], "B": [0, 1], "C": [1, 1.0 + 1e-8], "D": [1, 0]}
    table = cantilever()
    table["nodes"] = {name: {"position": place} for name, place in places.items()} | {
        "A": {"position": places["A"], "support": "clamped"}
    }
    table["members"] = {a + b: {"nodes": [a, b], "section": "s"} for a, b in itertools.pairwise("ABCD")}
    table["loads"] = {}
    return (len(mirrors(model_of(table))),), np.zeros(0)


def mechanism():
    table = three_parallel_cranks(0.0, (1.0, 0.0, 0.0))
    del table["springs"]
    return Prepared(model_of(table)).diagnosis.motions, np.zeros(0)


def force_that_is_none():
    """The reaction to a moment is asked for to eight digits."""
    table = cantilever((0.0, 0.0), analysis={"accuracy": 1e-8, "accuracy_of": "reactions.A.force"})
    table["members"]["m"]["shape"] = {"type": "arc", "angle": 1.0}
    table["loads"] = {"couple": {"type": "moment", "node": "B", "value": 1.0}}
    return told(table)


def rolled_up():
    """Twenty times: rounding of its rotations leaves more out of balance than counts as converged."""
    table = cantilever()
    table["loads"] = {"couple": {"type": "moment", "node": "B", "value": 40.0 * np.pi}}
    return told(table)


def started_below():
    """An arch that was drawn upwards and is asked for downwards."""
    table = cantilever()
    ends = {"A": {"position": [-0.25, 0], "support": "clamped"}, "B": {"position": [0.75, 0], "support": "clamped"}}
    table["nodes"] = ends | {"M": {"position": [0.25, 0.3], "start": [0.25, -0.3]}}
    table["members"] = {a + b: {"nodes": [a, b], "section": "s"} for a, b in ("AM", "MB")}
    table["loads"] = {"tip": {"type": "force", "node": "M", "value": [0.0, -0.1]}}
    return told(table)


def column():
    """It buckles to one of two sides, of which a load of two ten millionths of the other chooses that below."""
    return told(cantilever((-5.0, -1e-6)))


def round_column():
    """It buckles to all sides: one eigenvalue is zero."""
    table = cantilever((-5.0, 0.0, 0.0), dimension="space")
    return told(table)


def damped():
    table = cantilever(analysis={"type": "modes", "modes": 3})
    del table["loads"]
    table["sections"]["s"]["damping"] = 1e-4
    return told(table)


def several():
    return told(cantilever((-15.0, 8.0), analysis={"equilibria": "all"}))


def resting():
    """On a floor: what it pushes with is in balance to rounding."""
    floor = {"type": "plane", "point": [0, -0.05], "normal": [0, 1], "members": "all"}
    return told(cantilever((0.0, -1.0), contacts={"floor": floor}))


CASES = {
    "DECIMAL": (all_but_plane, 1e-3),
    "WRITTEN": (universal_joint_in_ten_digits, 1e-3),
    "PARALLEL": (door, 1e-3),
    "ALIKE": (nearly_a_mirror_image, 1e-3),
    "NEGLIGIBLE": (mechanism, 1e6),
    "UNIT": (force_that_is_none, None),
    "RANK": (lambda: told(small_plane()), 1e10),
    "DUAL": (lambda: told(three_parallel_cranks(0.0, (1.0, 0.0, 0.0))), None),
    "PROXIMAL": (column, 1e10),
    "NEUTRAL": (round_column, 1e3),
    "SOFT": (lambda: told(three_parallel_cranks(0.0, (1.0, 0.0, 0.0))), None),
    "CONVERGED": (rolled_up, None),
    "EXACT": (rolled_up, None),
    "BALANCED": (rolled_up, 1e-3),
    "CLOSED": (lambda: told(three_parallel_cranks(1e-11, (1.0, 0.0, 0.0))), 1e-6),
    "LOST": (resting, None),
    "REACHED": (started_below, None),
    "LEVEL": (column, 1e6),
    "REAL": (damped, 1e6),
    "SAME_STATE": (several, 1e6),
}
"""Of each number a scene that asks for it, and by how many times it has to be moved until the answer is another one.

None where only the way to the answer, or what it takes, hangs on it.
"""


@functools.cache
def usual(name):
    """The answer as it is, and which numbers were asked for on the way."""
    asked = set()

    class Asked(types.ModuleType):
        def __getattribute__(self, name):
            asked.add(name)
            return super().__getattribute__(name)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tolerances, "__class__", Asked)
        words, numbers = CASES[name][0]()
    return words, numbers, asked


def moved(name, times, monkeypatch):
    monkeypatch.setattr(tolerances, name, times * getattr(tolerances, name))
    return CASES[name][0]()


@pytest.mark.parametrize("times", [0.1, 10.0])
@pytest.mark.parametrize("name", NAMES)
def test_answers_stay_where_a_number_is_moved(name, times, monkeypatch):
    words, numbers, asked = usual(name)
    assert name in asked
    others, there = moved(name, times, monkeypatch)
    assert others == words
    np.testing.assert_allclose(there, numbers, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("name", [name for name, (_, times) in CASES.items() if times])
def test_answers_hang_on_it(name, monkeypatch):
    """What is moved far enough decides otherwise, so that the test above is one."""
    words, numbers, _ = usual(name)
    others, there = moved(name, CASES[name][1], monkeypatch)
    assert others != words or there.shape != numbers.shape or np.abs(there - numbers).max() > 1e-6


@pytest.mark.parametrize("times", [0.1, 10.0])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_problems_are_solved_with_all_of_them_moved(problem, times, monkeypatch):
    for name in NAMES:
        monkeypatch.setattr(tolerances, name, times * getattr(tolerances, name))
    scene = sfetcas.load(FOLDER / f"{problem}.toml")
    assert [found for found in check(scene, sfetcas.solve(scene)) if not found.passed] == []


def test_table_has_all_of_them_with_units_and_reasons():
    lines = [line.split() for line in tolerances.table().splitlines()]
    assert [(name, float(value)) for name, value, *_ in lines] == [(n, getattr(tolerances, n)) for n in NAMES]
    assert all(len(words) > 4 for words in lines)
    body = ast.parse(inspect.getsource(tolerances)).body
    reasons = [entry.value.value for entry in body[1:] if isinstance(entry, ast.Expr)]
    assert len(reasons) == len(NAMES)
    assert all("\n\n" in reason for reason in reasons)
