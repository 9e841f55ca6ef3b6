"""The table of the extremes counts what is wrong, and prints a line for each."""

import numpy as np
import pytest

from benchmarks import extremes
from benchmarks.__main__ import main


@pytest.mark.parametrize(
    ("outcome", "wrong"),
    [
        (extremes.Outcome(1e-3, 1e-3, "solved", True), False),
        (extremes.Outcome(4e-3, 1e-3, "solved", True), True),
        (extremes.Outcome(np.nan, 1e-3, "solved", True), True),
        (extremes.Outcome(4e-3, 1e-3, "neutral", False), False),
        (extremes.Outcome(None, 0.0, "refused: no", False), False),
    ],
)
def test_wrong_is_what_is_off_and_says_nothing(outcome, wrong):
    assert outcome.wrong is wrong


def test_outcome_of_a_scene():
    tip = extremes.elastica_tip(1.0)
    right = extremes.measured(extremes.cantilever(1.0), lambda s: float(np.linalg.norm(s.position("B") - tip)))
    assert (right.words, right.solved, right.wrong) == ("solved", True, False)
    assert extremes.measured(extremes.cantilever(1.0), lambda s: 1.0).wrong
    refused = extremes.measured(extremes.bars(1e-9, "flexible"), lambda s: 0.0)
    assert refused.error is None
    assert refused.words.startswith("refused: no finite force holds the members (")
    short = extremes.measured(extremes.cantilever(10.0, element="SFET2", elements=1), lambda s: 0.0, accuracy=1e-6)
    assert "not to the accuracy asked for" in short.words


def test_table_is_markdown(monkeypatch, capsys):
    lines = {
        "right": ("itself", lambda: [extremes.Outcome(1e-9, 1e-8, "solved", True)] * 2),
        "wrong": ("itself", lambda: [extremes.Outcome(1e-3, 1e-8, "solved", True)]),
        "told": ("itself", lambda: [extremes.Outcome(None, 0.0, "refused: too coarse (9 elements)", False)] * 3),
    }
    monkeypatch.setattr(extremes, "LINES", lines)
    main(["extremes"])
    head, bar, right, wrong, told = capsys.readouterr().out.strip().splitlines()
    assert head.count("|") == bar.count("|") == right.count("|")
    assert right == "| right | itself | 1e-09 (estimate 1e-08) | 2 of 2 | - |"
    assert wrong == "| wrong | itself | 1e-03 (estimate 1e-08) | 1 of 1, 1 WRONG | - |"
    assert told == "| told | itself | - | 0 of 3 | 3 refused: too coarse |"


@pytest.mark.parametrize("name", ["sizes", "rings"])
def test_lines_have_nothing_wrong(name):
    """The cheap ones; the others are those of the tests beside this one, over wider ranges."""
    outcomes = list(getattr(extremes, name)())
    assert len(outcomes) >= 18
    assert not any(outcome.wrong for outcome in outcomes)
