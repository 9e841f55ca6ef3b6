"""What benchmarks save."""

import json
import re

import pytest

from benchmarks import __main__ as program
from benchmarks import saving

SAVED = sorted(saving.RESULTS.glob("*.md"))


# -- saved results --------------------------------------------------------------------------------


def test_what_is_printed_is_saved_with_date_machine_and_versions(tmp_path, capsys, monkeypatch):
    def measured():
        print("Words\n")
        saving.head("a", "b")
        saving.row("c", 1)
        return {"rows": [1.5]}

    monkeypatch.setattr(saving, "machine", lambda: {"processor": "a fast one", "casadi": "3.8"})
    text, data = saving.saved("name", measured, tmp_path)
    table = "Words\n\n| a | b |\n|---|---|\n| c | 1 |\n"
    assert capsys.readouterr().out == table
    content = text.read_text()
    assert content.endswith("\n" + table)
    assert re.match(
        r"# Benchmark: name\n\n`python -m benchmarks name`, \d{4}-\d\d-\d\d\n\n- processor: a fast one\n", content
    )
    assert json.loads(data.read_text()).keys() == {"date", "machine", "rows"}


def test_a_benchmark_without_data_saves_its_text_alone(tmp_path):
    (text,) = saving.saved("name", lambda: print("x"), tmp_path)
    assert text.name == "name.md"


def test_save_is_a_word_of_the_command_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(program, "order", lambda: print("measured"))
    monkeypatch.setattr(program, "saved", lambda name, benchmark: [tmp_path / name])
    program.main(["order", "--save"])
    assert capsys.readouterr().out == f"saved {tmp_path / 'order'}\n\n"
    program.main(["order"])
    assert capsys.readouterr().out == "measured\n\n"


@pytest.mark.parametrize("path", SAVED, ids=[path.stem for path in SAVED])
def test_saved_tables_are_markdown(path):
    """Each table has a bar below its head, and rows that are as long."""
    text = path.read_text(encoding="utf-8")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        head, bar, *lines = table.splitlines()
        assert re.fullmatch(r"(\|-+)+\|", bar)
        assert lines
        assert {line.count("|") for line in (head, bar, *lines)} == {head.count("|")}
    assert f"python -m benchmarks {path.stem}" in text
