"""``help`` of all that is public is readable: no addresses, no machinery, every key of a record."""

import inspect
import pydoc

import pytest

import sfetcas
from sfetcas import Arc, Load
from sfetcas.description.records import Record

PUBLIC = {name: getattr(sfetcas, name) for name in sfetcas.__all__}
RECORDS = {name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing) and issubclass(thing, Record)}

MOST_LINES = 200
"""The longest, of OptimalControl with its inherited methods, has some 150."""


@pytest.mark.parametrize("name", PUBLIC)
def test_help_is_short_and_has_no_addresses(name):
    text = pydoc.plain(pydoc.render_doc(PUBLIC[name]))
    assert " at 0x" not in text
    assert "pydantic_" not in text
    assert "model_" not in text.replace("solve_model", "")
    assert len(text.splitlines()) < MOST_LINES


def test_help_of_the_package_begins_with_what_it_is_for():
    text = pydoc.plain(pydoc.render_doc(sfetcas))
    assert " at 0x" not in text
    assert "sfetcas - Equilibria, vibrations and motions of very flexible beams." in text.splitlines()[3]


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_shows_its_keys_with_their_defaults(name):
    record = RECORDS[name]
    shown = inspect.signature(record).parameters
    assert list(shown) == list(record.model_fields)
    for key, field in record.model_fields.items():
        assert (shown[key].default is inspect.Parameter.empty) == field.is_required()
        # The type of a shape is the name of its record.
        assert key in inspect.getdoc(record) or key == "type"


def test_keys_and_methods_are_completed_and_nothing_else():
    arc = Arc(angle=1)
    assert set(dir(arc)) == {"angle", "normal", "start", "type", "from_dict", "replace", "to_dict"}
    assert {"follows", "vector", "replace"} <= set(dir(Load))
    assert not any("model" in key for key in dir(Load))
    assert str(inspect.signature(Load)).startswith("(*, type, node=None, ")
