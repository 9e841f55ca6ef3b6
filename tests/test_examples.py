"""The problems that are programs: each checks itself."""

import importlib.util
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent / "problems"
PROGRAMS = sorted(FOLDER.glob("*.py"))


def imported(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_are_programs():
    assert PROGRAMS


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program_checks_itself(path):
    module = imported(path)
    differences = module.check()
    assert differences
    for name, difference in differences.items():
        assert difference <= module.TOLERANCE, name


def test_a_wrong_line_is_noticed(monkeypatch):
    module = imported(FOLDER / "tip_on_a_line.py")
    scene = module.with_slider()
    monkeypatch.setattr(module, "HEIGHT", module.HEIGHT + 1e-6)
    monkeypatch.setattr(module, "with_slider", lambda: scene)
    assert module.check()["tip against slider"] > module.TOLERANCE
