"""``help`` of all that is public is readable: no addresses, no machinery, every key of a record."""

import argparse
import inspect
import pydoc
import shlex

import pytest

import sfetcas
from sfetcas import Arc, Load
from sfetcas.cli import parser
from sfetcas.description.records import Record

PUBLIC = {name: getattr(sfetcas, name) for name in sfetcas.__all__}
RECORDS = {name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing) and issubclass(thing, Record)}

MOST_LINES = 220
"""The longest, of CrossSection with a paragraph for each of its 32 keys, has 215; others have up to 150."""


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


# -- of the command line ----------------------------------------------------------------------------


def commands():
    (found,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    return found.choices


@pytest.mark.parametrize("name", commands())
def test_help_of_a_command_has_a_sentence_examples_that_are_accepted_and_all_defaults(name, capsys):
    command = commands()[name]
    assert command.description.endswith(".")
    assert command.description[0].isupper()
    head, *examples = command.epilog.splitlines()
    assert head == "examples:"
    assert examples
    for example in examples:
        program, *words = shlex.split(example)
        assert program == "sfetcas"
        assert parser().parse_args(words).command is command.get_default("command")
    for action in command._actions:
        assert action.help, action.dest
        text = " ".join(action.help.split())
        # Lists are empty and switches off unless they are given.
        if action.default not in (None, [], False, argparse.SUPPRESS):
            assert "(default: %(default)s)" in text, action.dest
    with pytest.raises(SystemExit):
        command.parse_args(["--help"])
    printed = capsys.readouterr().out
    assert command.description in " ".join(printed.split())
    assert "examples:\n  sfetcas" in printed


def test_help_of_the_program_names_all_commands(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    printed = capsys.readouterr().out
    assert all(f"    {name} " in printed for name in commands())
