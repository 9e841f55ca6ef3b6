"""Magnetic fields as tables, against the functions that they are values of, and what they may not be."""

import json
import re

import numpy as np
import pytest
from test_codegen import built, needs_compiler, said

import sfetcas
from sfetcas import Scene, SceneError, SolveError
from sfetcas.solvers.globalised import Code


def cubic(x):
    """A field of polynomials of third degree, which cubic splines meet exactly: a gradient of x^3 y - x y^3."""
    return [
        0.03 + 0.02 * (3 * x[0] ** 2 * x[1] - x[1] ** 3),
        0.04 + 0.02 * (x[0] ** 3 - 3 * x[0] * x[1] ** 2),
        0.0 * x[2],
    ]


def table(function=cubic, *, z=False, high=0.9, count=5):
    """Values of a function on a grid whose places have different distances."""
    axes = [np.array([-0.3, 0.0, 0.3, 0.7, 1.2]), np.linspace(-0.7, high, count)]
    axes += [np.array([-0.6, -0.2, 0.1, 0.5])] if z else []
    places = [part.ravel() for part in np.meshgrid(*axes, indexing="ij")]
    field = function([*places, *([] if z else [np.zeros(len(places[0]))])])
    names = ("x", "y", "z", "Bx", "By", "Bz") if z else ("x", "y", "Bx", "By")
    columns = [*places, *field[: 3 if z else 2]]
    return {name: np.asarray(column).tolist() for name, column in zip(names, columns, strict=True)}


def strip(field, dimension="plane", **analysis):
    """A magnetised strip that begins at the origin."""
    return Scene.from_dict(
        {
            "dimension": dimension,
            "sections": {"s": {"EI3": 0.1, "EI2": 0.1, "GJ": 0.1, "rhoA": 0.1, "rhoI": [2e-4, 1e-4, 1e-4]}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
            "fields": {"f": field},
            "magnets": {"k": {"member": "m", "moment_density": [4.0, -3.0, 0]}},
            "analysis": {"accuracy": 1e-6, **analysis},
        }
    )


def given(**more):
    return {"type": "table", "table": table(**more)}


FUNCTION = {"type": "function", "function": cubic}


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_as_the_function(dimension):
    """Between the points the splines are the polynomials, with their derivatives: the same answers."""
    one = sfetcas.solve(strip(FUNCTION, dimension)).last
    other = sfetcas.solve(strip(given(z=dimension == "space"), dimension)).last
    np.testing.assert_allclose(other.position("B"), one.position("B"), atol=1e-9)
    for key in ("energy", "torque", "force"):
        np.testing.assert_allclose(other.magnet("k")[key], one.magnet("k")[key], atol=1e-9)
    assert abs(one.position("B")[1]) > 0.1


@pytest.mark.parametrize("slope", [0.0, 1e-12, 1e-8])
@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_all_but_uniform_tables_are_as_uniform_fields(dimension, slope):
    """What forces are then is rounding, beside which nothing else acts at the places of the magnets."""
    random = np.random.default_rng(3)
    for _ in range(3):
        value = random.uniform(-0.05, 0.05, 3) * [1.0, 1.0, dimension == "space"]

        def nearly(x, value=value):
            return [value[0] + slope * x[0], value[1] - slope * x[1], value[2] + 0.0 * x[2]]

        one = sfetcas.solve(strip({"type": "uniform", "value": value.tolist()}, dimension, accuracy=1e-5)).last
        other = {"type": "table", "table": table(nearly, z=dimension == "space", high=1.2)}
        steps = sfetcas.solve(strip(other, dimension, accuracy=1e-5, steps=[0.05, 0.5, 1.0])).steps
        # The accuracy of two meshes.
        np.testing.assert_allclose(steps[-1].position("B"), one.position("B"), atol=2e-5)
        assert all(step.certificate.stable for step in steps)


def test_the_file(tmp_path):
    """Columns of a CSV file beside the scene, rows in any order."""
    columns = table()
    order = np.random.default_rng(1).permutation(len(columns["x"]))
    rows = [",".join(columns), *(",".join(repr(columns[name][i]) for name in columns) for i in order)]
    (tmp_path / "field.csv").write_text("\n".join(rows), encoding="utf-8")
    text = strip(given()).to_dict()
    text["fields"]["f"]["table"] = "field.csv"
    (tmp_path / "scene.json").write_text(json.dumps(text), encoding="utf-8")
    places = [
        sfetcas.solve(each).last.position("B") for each in (strip(given()), sfetcas.load(tmp_path / "scene.json"))
    ]
    np.testing.assert_array_equal(*places)


def test_analyses():
    """Path, modes, a motion and parameters with their derivatives, against the function."""
    course = {"type": "dynamic", "end": 0.1, "output": 0.1, "step": 0.01, "accuracy": 1e-3}
    found = []
    for field in (FUNCTION, given()):
        path = sfetcas.solve(strip(field, type="path", range=[0, 1], steps=[0.5]))
        modes = sfetcas.solve(strip(field, type="modes", modes=2, accuracy=1e-4))
        motion = sfetcas.solve(strip(field, **course))
        answer = sfetcas.parametric(strip(field), ["magnets.k.moment_density.0"], ["nodes.B.position"]).solve({})
        slope = answer.jacobian["nodes.B.position"]["magnets.k.moment_density.0"].ravel()
        places = [path.steps[0].position("B"), motion.last.position("B"), answer["nodes.B.position"], slope]
        found.append([*places, modes.omega])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9)


@needs_compiler
def test_exported_code(tmp_path):
    """The program in C agrees with the process of the same functions, and with statics."""
    scene, arguments = strip(given(high=0.2), accuracy=1e-3, steps=[0.05]), ["factor"]
    made = sfetcas.export(scene, tmp_path / "c", name="c", arguments=arguments, results=["nodes.B.position"])
    outcome, found = made.solve([0.05])
    assert outcome.code is Code.SOLVED
    # The accuracy of both meshes.
    np.testing.assert_allclose(found, sfetcas.solve(scene).last.position("B"), atol=2e-3)
    words = said(built(tmp_path / "c", "c"))
    assert re.match(r"(\d+) of \1 cases agree, \1 of them to the last bit", words), words
    # Where a magnet leaves the table there is no number.
    outcome, found = made.solve([1.0])
    assert outcome.code is Code.NOT_FINITE
    assert np.isnan(found).all()


@needs_compiler
def test_exported_steps(tmp_path):
    """Time steps in C are those of the process."""
    moving = strip(given(), accuracy=1e-3, type="dynamic", end=1.0, step=0.01)
    sfetcas.export(moving, tmp_path / "motion", name="motion")
    assert "10 of 10 steps agree, 10 of them to the last bit" in said(built(tmp_path / "motion", "motion"))


def test_derivatives_of_all_results_are_numbers():
    """That answers beyond a table are none must not reach derivatives within it."""
    names = ["members.m.moment", "members.m.curvature", "magnets.k.energy", "energy.loads", "nodes.B.position"]
    one, other = (sfetcas.parametric(strip(field), ["factor"], names).solve({}) for field in (FUNCTION, given()))
    for name in names:
        expected = one.jacobian[name]["factor"]
        assert np.abs(expected).max() > 1e-3
        np.testing.assert_allclose(other.jacobian[name]["factor"], expected, rtol=1e-7, atol=1e-9)


LEAVING = given(high=0.2)
"""A table that ends where the strip comes to under a part of its loads."""


def test_no_answer_beyond_the_table():
    """Statics, paths, motions and parameters do not go on beyond the table."""
    sentence = r"a magnet leaves the table of its field \(.*'k' is outside of the table of the field 'f'"
    with pytest.raises(SolveError, match=sentence):
        sfetcas.solve(strip(LEAVING))
    path = sfetcas.solve(strip(LEAVING, type="path", range=[0, 1], steps=[1.0]))
    assert re.match("beyond factor .* a magnet leaves the table of its field", path.branches[0].end)
    # The path ends at the last of its points that is inside.
    assert 0.15 < path.positions("B")[-1][1] < 0.2 * (1.0 + 1e-6)
    with pytest.raises(SolveError, match=sentence):
        sfetcas.solve(strip(LEAVING, type="dynamic", end=1.0, output=0.1, accuracy=1e-2))
    family = sfetcas.parametric(strip(LEAVING, steps=[0.05]), ["factor"], ["nodes.B.position"])
    assert np.isfinite(family.solve({"factor": 0.05})["nodes.B.position"]).all()
    assert np.isnan(family.solve({"factor": 1.0})["nodes.B.position"]).all()
    narrow = table()
    narrow["x"] = [0.7 * x for x in narrow["x"]]
    with pytest.raises(
        SceneError, match=r"fields\.f: the magnet 'k' is at x = .* m, outside of the table from -0.21 to"
    ):
        sfetcas.solve(strip({"type": "table", "table": narrow}))


def changed(**columns):
    return {"type": "table", "table": {**table(), **columns}}


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ({"type": "table"}, "fields.f: the key 'table' is missing"),
        ({"value": [0, 1, 0], "table": table()}, "fields.f.table: not accepted: the field is of type 'uniform'"),
        ({"type": "table", "table": 3}, "fields.f.table: found 3, accepted: the name of a CSV file, or columns"),
        (changed(By=[1.0, 2.0]), "fields.f.table.By: found 2 numbers, accepted: 25, as of x"),
        ({"type": "table", "table": {k: v[:-1] for k, v in table().items()}}, "no whole grid of 5 times 5 places"),
        ({"type": "table", "table": {k: [v[0], *v] for k, v in table().items()}}, "found the point [-0.3, -0.7] twice"),
        (given(count=3), "fields.f.table.y: found 3 places along y, accepted: at least 4"),
        (changed(x=[table()["x"][0] + 1e-13, *table()["x"][1:]]), "which are the same but for rounding"),
        (changed(Bx=[float("nan"), *table()["Bx"][1:]]), "fields.f.table.Bx: found nan, accepted: a finite number"),
    ],
)
def test_refused(field, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        strip(field)


def pole(x):
    """Without a value at the origin, where the strip begins."""
    square = x[0] ** 2 + x[1] ** 2
    return [x[0] / square, x[1] / square, 0]


@pytest.mark.parametrize("function", [pole, lambda x: [x[0] * float("nan"), 0, 0], lambda x: [float("inf"), 0, 0]])
def test_functions_without_a_value(function):
    with pytest.raises(SceneError, match=r"fields\.f: the field is not finite at \[0.*, where the magnet 'k' is"):
        sfetcas.solve(strip({"type": "function", "function": function}))


def test_what_does_not_know_tables(tmp_path):
    with pytest.raises(SceneError, match=r"fields\.f: found a table, beyond whose end derivatives would go on"):
        sfetcas.export(strip(given()), tmp_path / "c", name="c", derivatives=True)
    with pytest.raises(SceneError, match=r"fields\.f: found a table, with which no design knows where it ends"):
        sfetcas.find(strip(given()), {"factor": (0.1, 2.0)}, {"nodes.B.position.y": -0.08})
    for name in ("fields.f.table.Bx", "fields.f.table.Bx.3"):
        with pytest.raises(
            SceneError, match=r"table\.Bx: found a number that varies, accepted: numbers, as tables have"
        ):
            sfetcas.parametric(strip(given()), [name], ["nodes.B.position"])
