"""The README's table of keys is that of the records, and its scenes are scenes."""

import json
import re
import sys
import typing
from pathlib import Path

import numpy as np
import pytest

from sfetcas import Scene, solve
from sfetcas.description.answers import ANSWERS, answers_table
from sfetcas.description.records import Record, plain
from sfetcas.equilibria.quantities import value_of

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

README = Path(__file__).parent.parent / "README.md"

TABLES = {
    "top": "Scene",
    "section": "CrossSection",
    "varying, by values": "Table",
    "varying, polynomial": "Polynomial",
    "node": "Node",
    "member": "Member",
    "shape, arc": "Arc",
    "shape, helix": "Helix",
    "shape, curvature": "Curvature",
    "shape, spline": "Spline",
    "spring": "Spring",
    "load": "Load",
    "motion": "Motion",
    "history": "History",
    "contact": "Contact",
    "analysis": "Analysis",
    "analysis, until": "Until",
    "expect": "Expect",
}
"""What the README calls the records."""


def within(annotation, found):
    """Records in an annotation and in the fields of these, by name."""
    if isinstance(annotation, type) and issubclass(annotation, Record):
        if annotation.__name__ not in found:
            found[annotation.__name__] = annotation
            for field in annotation.model_fields.values():
                within(field.annotation, found)
    else:
        for part in typing.get_args(annotation):
            within(part, found)
    return found


def choices(annotation):
    """Words that an annotation allows."""
    if typing.get_origin(annotation) is typing.Literal:
        return set(typing.get_args(annotation))
    return set().union(*(choices(part) for part in typing.get_args(annotation)), set())


RECORDS = within(Scene, {})


def rows():
    """Meaning and default by table and key, in the order of the README."""
    section = README.read_text(encoding="utf-8").partition("## All keys of a scene")[2]
    found = {}
    for line in section.splitlines():
        if line.startswith("| ") and not line.startswith("| table "):
            table, key, meaning, default = (cell.strip() for cell in line.strip("|").split("|"))
            assert (table, key.strip("`")) not in found, line
            found[table, key.strip("`")] = meaning, default
    return found


ROWS = rows()


def field_of(table, key):
    return RECORDS[TABLES[table]].model_fields[key]


each = pytest.mark.parametrize(("table", "key"), list(ROWS), ids=[f"{table}-{key}" for table, key in ROWS])


def test_table_has_each_key_of_each_record_in_their_order():
    tables = {name: table for table, name in TABLES.items()}
    wanted = []
    for name, record in RECORDS.items():
        # The type of a shape stands in the row of the shape and in the name of its table.
        keys = [key for key, field in record.model_fields.items() if not shape_type(key, field)]
        wanted += [(tables[name], key) for key in keys]
    assert list(ROWS) == sorted(wanted, key=lambda row: list(TABLES).index(row[0]))


def shape_type(key, field):
    return key == "type" and choices(field.annotation) == {field.default}


@each
def test_row_gives_the_default(table, key):
    field, (_, cell) = field_of(table, key), ROWS[table, key]
    default = None if field.is_required() else plain(field.get_default(call_default_factory=True))
    if field.is_required():
        assert cell == "needed"
    elif default in (None, {}, []):
        # Nothing that could be written down: words say what is done without.
        assert cell not in ("", "needed")
        assert "`" not in cell
    else:
        assert re.fullmatch("`.*`", cell)
        assert json.loads(cell.strip("`")) == default


@each
def test_row_says_in_a_line_what_is_meant_and_all_that_is_accepted(table, key):
    meaning, _ = ROWS[table, key]
    words = set(re.findall(r"`\"?([\w-]+)", meaning))
    assert meaning
    assert choices(field_of(table, key).annotation) <= words


def test_rows_of_shapes_are_those_of_the_types():
    types = {table.removeprefix("shape, ") for table in TABLES if table.startswith("shape, ")}
    known = {choices(record.model_fields["type"].annotation).pop() for record in shapes()}
    assert types == known - {"straight"}
    assert known <= set(re.findall(r"`(\w+)`", ROWS["member", "shape"][0]))


def shapes():
    return typing.get_args(RECORDS["Member"].model_fields["shape"].annotation)


def blocks():
    return [tomllib.loads(block) for block in re.findall(r"```toml\n(.*?)```", README.read_text("utf-8"), re.DOTALL)]


def test_scene_of_the_readme_is_solved_as_said():
    x, y, _ = solve(Scene.from_dict(blocks()[0])).last.position("tip")
    # the digits printed there; the accuracy asked for is 1e-6
    assert (x, y) == pytest.approx((0.44500, 0.81060), abs=1e-5)


def programs():
    return re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)


def test_there_are_programs():
    assert len(programs()) == 9


@pytest.mark.parametrize("number", range(9))
def test_program_of_the_readme_runs_as_it_stands(number, monkeypatch, tmp_path):
    """Each by itself, imports and all; what a comment prints with dots is what the line gives, digit by digit."""
    # Beside the problems, and what it writes is not left there.
    (tmp_path / "problems").symlink_to(README.parent / "problems")
    monkeypatch.chdir(tmp_path)
    # Of a thousand cases a few will do.
    text, names = programs()[number].replace("sampled(1000,", "sampled(3,"), {"__name__": "__main__"}
    exec(compile(text, README.name, "exec"), names)
    printed = re.findall(r"^(\S.*?)  # .*?(-?\d+\.\d+)\.\.\.(?:.*?(-?\d+\.\d+)\.\.\.)?", text, re.MULTILINE)
    assert len(printed) == (1, 3, 0, 0, 1, 2, 1, 0, 0)[number]
    for line, *digits in printed:
        found = np.atleast_1d(eval(line, names))
        for value, told in zip(found, filter(None, digits), strict=False):
            assert f"{value:.12f}".startswith(told), line


def test_system_of_the_readme_drives_its_joint():
    (system,) = (block for block in blocks() if "springs" in block)
    nodes = {
        "A": {"position": [0, 0], "support": "hinge"},
        "B": {"position": [0, 1], "joint": "hinge"},
        "C": {"position": [1, 1], "support": "clamped"},
    }
    members = {**system["members"], "beam": {"nodes": ["B", "C"], "section": "strip"}}
    step = solve(
        Scene.from_dict({**system, "nodes": nodes, "members": members, "sections": {"strip": {"EI3": 1.0}}})
    ).last
    # prescribed: right to rounding
    assert step.spring("knee").to_dict() == pytest.approx({"angle": 0.5, "moment": -5.0}, abs=1e-9)


def test_path_of_the_readme_is_an_analysis():
    (path,) = (block["analysis"] for block in blocks() if block.get("analysis", {}).get("type") == "path")
    assert RECORDS["Analysis"].from_dict(path).span == (-1.5, 2.5)


# -- the answer by name -----------------------------------------------------------------------------


def test_table_of_the_answer_is_that_of_the_program():
    assert answers_table() in README.read_text(encoding="utf-8")


def places(step):
    """Names of the places of an answer."""
    found = {"factor"}
    for table, entries in step.to_dict().items():
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            found |= {f"{table}.NAME.{key}" for key in entry} if isinstance(entry, dict) else {f"{table}.{name}"}
    return found


def every_kind():
    """Answers with all kinds of places."""
    plane = {
        "sections": {"s": {"shape": "circle", "radius": 0.1, "E": 1e4}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
    }
    force = {"f": {"type": "force", "node": "B", "value": [0, -1]}}
    stopped = {"k": {"node": "A", "stiffness": 2.0, "stop": [-0.1, 0.1]}}
    pulled = {"k": {"type": "translational", "node": "B", "anchor": [1, 1], "stiffness": 1.0}}
    clamped = {**plane, "nodes": {**plane["nodes"], "A": {"position": [0, 0], "support": "clamped"}}}
    floor = {"floor": {"type": "plane", "point": [0, -0.1], "normal": [0, 1], "members": "all"}}
    moved = {"m": {"node": "A", "displacement": [0, 0.1], "rotation": 0.2}}
    for table in (
        {**plane, "springs": stopped, "loads": force},
        {**clamped, "springs": pulled, "motions": moved},
        {**clamped, "contacts": floor, "loads": force},
    ):
        yield solve(Scene.from_dict(table)).last


def test_all_that_an_answer_tells_has_a_name_by_which_it_is_found():
    """But for the list of places along a member: there an expect has its fraction."""
    met = set()
    for step in every_kind():
        names = {
            "nodes": "B",
            "members": "m",
            "reactions": "A",
            **{t: n for t in LATER for n in getattr(step.model.scene, t)},
        }
        for place in places(step) - {"members.NAME.s"}:
            table = place.partition(".")[0]
            value_of(step, place.replace("NAME", names.get(table, "")), 0.5)
            met.add(place)
    # Flutter points have a frequency; the other name of the total energy is no entry of its own.
    others = {"omega", "energy.potential"}
    assert met == {kind.name for kind in ANSWERS if "statics" in kind.where} - others


LATER = ("springs", "motions", "contacts")
"""Tables of a scene whose names are those of the answer."""


def turned(motions, springs, **node):
    """A rigid rod on a node that a motion drives, with a spring that resists."""
    table = {
        "nodes": {"A": {"position": [0, 0], **node}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "motions": {"d": motions},
        "springs": {"k": springs},
    }
    return solve(Scene.from_dict(table)).last


@pytest.mark.parametrize("sign", [1, -1])
def test_signs_of_springs_and_motions_are_as_said(sign):
    hinge = {"support": "hinge", "axis": [0, 0, sign]}
    spring = {"node": "A", "stiffness": 2.0, "rest": 0.1, "axis": [0, 0, 1]}
    step = turned({"node": "A", "rotation": 0.5}, spring, **hinge)
    # prescribed: right to rounding
    assert step.angle("A") == pytest.approx(0.5 * sign, abs=1e-12)
    state = step.spring("k").to_dict()
    assert state == pytest.approx({"angle": 0.5 * sign, "moment": -2.0 * (0.5 * sign - 0.1)}, abs=1e-12)
    # The ground makes the motion against the spring, about the hinge's own axis.
    assert step.motion("d")["moment"] == pytest.approx(-sign * state["moment"], abs=1e-12)
    slider = {"support": "slider", "direction": [sign, 0]}
    along = {"type": "translational", "node": "B", "stiffness": 3.0, "direction": [1, 0], "rest": 0.05}
    step = turned({"node": "A", "displacement": [0.2, 0]}, along, **slider)
    assert step.spring("k").to_dict() == pytest.approx({"travel": 0.2, "force": -3.0 * 0.15}, abs=1e-12)
    assert step.motion("d")["force"][0] == pytest.approx(0.45, abs=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_driven_slides_go_by_the_component_along_the_direction(sign):
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0], "direction": [sign, 0]},
            "C": {"position": [2, 0]},
        },
        "members": {
            "a": {"nodes": ["A", "B"], "type": "rigid"},
            "b": {"nodes": ["B", "C"], "section": "s", "release": ["slider", "rigid"]},
        },
        "motions": {"d": {"node": "B", "between": ["a", "b"], "displacement": [0.2, 0]}},
        "loads": {"pull": {"type": "force", "node": "C", "value": [0.3, 0]}},
    }
    step = solve(Scene.from_dict(table)).last
    assert step.along("b", [0.0])["position"][0, 0] == pytest.approx(1.2, abs=1e-12)
    # On the second member, along the direction: it holds what pulls away.
    assert step.motion("d")["force"] == pytest.approx(-0.3 * sign, abs=1e-9)


def test_every_module_stands_in_the_table():
    rows = [line for line in README.read_text().splitlines() if line.startswith("| `")]
    folder = README.parent / "sfetcas"
    for place in (folder, folder.with_name("benchmarks"), *(path.parent for path in folder.glob("*/__init__.py"))):
        modules = {file.stem for file in place.glob("*.py")} - {"__init__", "__main__"}
        listed = {
            word
            for line in rows
            if (place == folder) == (not line.startswith("| `" + place.name + "/`"))
            for word in re.findall(r"`(\w+)`", line.split("|")[1 if place == folder else 2])
        }
        assert modules <= listed, place.name
