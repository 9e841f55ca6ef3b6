"""The reference of the documentation is made from the program, and nothing that is public is missing in it."""

import re
import typing
from pathlib import Path

import pytest

import sfetcas
from sfetcas import Scene, solve
from sfetcas.description.answers import ANSWERS, answers_table
from sfetcas.description.records import name_of, plain
from sfetcas.equilibria.quantities import value_of

pytest.importorskip("numpydoc")
pytest.importorskip("sphinx")
import reference

RECORDS = reference.records()
KEYS = {(name, key.name): key for name in reference.TABLES for key in reference.keys(RECORDS[name])}

each = pytest.mark.parametrize(("record", "key"), list(KEYS), ids=[f"{record}-{key}" for record, key in KEYS])


def test_every_record_has_its_table():
    # A straight line has no keys, and a ribbon none but its type.
    assert set(RECORDS) - {"Straight"} == set(reference.TABLES)


def is_type_of_shape(field):
    return reference.choices(field.annotation) == {field.default}


def test_tables_have_each_key_of_each_record_in_their_order():
    fields = [
        (name, key)
        for name in reference.TABLES
        for key, field in ((field.alias or key, field) for key, field in RECORDS[name].model_fields.items())
        # The type of a shape stands in the key `shape` and in the heading of its table.
        if not (key == "type" and is_type_of_shape(field))
    ]
    assert list(KEYS) == fields


@each
def test_key_says_what_is_meant_all_that_is_accepted_and_what_it_is_without(record, key):
    said, field = KEYS[record, key], RECORDS[record].model_fields[name_of(RECORDS[record], key)]
    assert said.kind
    assert said.meaning
    assert reference.choices(field.annotation) <= set(re.findall(r"``\"?([\w-]+)", said.meaning))
    default = None if field.is_required() else plain(field.get_default(call_default_factory=True))
    assert (said.default == "needed") == field.is_required()
    if default not in (None, {}, []):
        assert said.default.startswith("`")


def test_headings_of_shapes_are_those_of_the_types():
    shapes = typing.get_args(RECORDS["Member"].model_fields["shape"].annotation)
    known = {reference.choices(record.model_fields["type"].annotation).pop() for record in shapes}
    headings = {heading.removeprefix("Shapes: ") for heading, _ in reference.TABLES.values() if "Shapes" in heading}
    assert headings == known - {"straight"}
    assert known <= set(re.findall(r"``(\w+)``", KEYS["Member", "shape"].meaning))


@pytest.mark.parametrize("name", ["scene", "answers"])
def test_pages_in_the_repository_are_those_of_the_program(name):
    """A build of the documentation writes them anew."""
    made = {"scene": reference.scene_tables, "answers": answers_table}[name]()
    text = (Path(reference.__file__).parents[1] / "reference" / f"{name}.md").read_text(encoding="utf-8")
    assert reference.filled(text, made) == text
    assert reference.filled(text, made + "more") != text


def test_each_public_name_is_on_a_page():
    pages = "\n".join(reference.api_pages().values())
    assert set(re.findall(r"^\.\. auto\w+:: sfetcas\.(\w+)$", pages, re.MULTILINE)) == set(sfetcas.__all__)


def test_a_public_name_without_a_page_is_noticed(monkeypatch):
    monkeypatch.setitem(sfetcas._MODULES, "lost", "stopping")
    with pytest.raises(ValueError, match="without a page of the reference: lost"):
        reference.api_pages()


# -- the answer by name -----------------------------------------------------------------------------


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
    stretching = {"s": {**plane["sections"]["s"], "stretch": True}}
    tubed = {"s": {**plane["sections"]["s"], "nu": 0.3}}
    plastic = {"s": {"EI3": 1.0, "law": {"type": "elastic-plastic", "moment": 2.0, "ratio": 0.1}}}
    force = {"f": {"type": "force", "node": "B", "value": [0, -1]}}
    stopped = {"k": {"node": "A", "stiffness": 2.0, "stop": [-0.1, 0.1]}}
    pulled = {"k": {"type": "translational", "node": "B", "anchor": [1, 1], "stiffness": 1.0}}
    clamped = {**plane, "nodes": {**plane["nodes"], "A": {"position": [0, 0], "support": "clamped"}}}
    floor = {"floor": {"type": "plane", "point": [0, -0.1], "normal": [0, 1], "members": "all"}}
    moved = {"m": {"node": "A", "displacement": [0, 0.1], "rotation": 0.2}}
    for table in (
        {**plane, "springs": stopped, "loads": force},
        {**clamped, "sections": stretching, "springs": pulled, "motions": moved},
        {**clamped, "contacts": {"floor": {**floor["floor"], "friction": 0.1}}, "loads": force},
        {**clamped, **_crossed(clamped), "loads": force},
        {**clamped, "sections": plastic, "loads": force},
        {**clamped, "tendons": {"t": {"way": [{"member": "m", "offset": 0.1}], "pull": 0.01}}},
        {**clamped, "tendons": {"t": {"way": [{"member": "m", "offset": 0.1}], "tension": 0.1, "friction": 0.2}}},
        {**clamped, "sections": tubed, "tubes": {"t": {"members": "m", "section": "s", "length": 0.5}}, "loads": force},
        {
            **clamped,
            "nodes": {**clamped["nodes"], "R": {"position": [0.5, 0], "support": "ball"}},
            "rings": {"r": {"node": "R", "member": "m", "travel": 0.1}},
            "loads": force,
        },
        {**clamped, "fields": {"B": {"value": [0, 1]}}, "magnets": {"end": {"node": "B", "moment": [1, 0]}}},
    ):
        yield solve(Scene.from_dict(table)).last


def _crossed(scene):
    """A second member below the first, which it touches."""
    nodes = {"C": {"position": [0.8, -0.1], "support": "clamped"}, "D": {"position": [2.0, -0.1]}}
    return {
        "nodes": {**scene["nodes"], **nodes},
        "members": {**scene["members"], "below": {"nodes": ["C", "D"], "type": "rigid"}},
        "contacts": {"pair": {"type": "members", "members": "all", "radius": 0.01}},
    }


def test_all_that_an_answer_tells_has_a_name_by_which_it_is_found():
    """But for the lists of places along members and tubes: there an expect has its fraction."""
    met = set()
    for step in every_kind():
        names = {
            "nodes": "B",
            "members": "m",
            "reactions": "A",
            **{t: n for t in LATER for n in getattr(step.model.scene, t)},
        }
        for place in places(step) - {"members.NAME.s", "tubes.NAME.s"}:
            table = place.partition(".")[0]
            value_of(step, place.replace("NAME", names.get(table, "")), 0.5)
            met.add(place)
    # Flutter points have a frequency; the other name of the total energy is no entry of its own.
    others = {"omega", "energy.potential"}
    assert met == {kind.name for kind in ANSWERS if "statics" in kind.where} - others


LATER = ("springs", "tendons", "tubes", "rings", "motions", "magnets", "contacts")
"""Tables of a scene whose names are those of the answer."""
