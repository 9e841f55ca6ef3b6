"""Figures that show themselves: registered with pyplot where they are asked for, never where they are written."""

import json
import subprocess
import sys

import matplotlib
import matplotlib.pyplot as plt
import pytest
import scenes
from moving import FALLING

from sfetcas import Scene, Settings, solve
from sfetcas.pictures.charts import save_chart
from sfetcas.pictures.curves import curves, save_curves
from sfetcas.pictures.modeshapes import save_modes
from sfetcas.pictures.motions import histories, save_histories, save_motion
from sfetcas.pictures.plotting import save_picture

STEPS = scenes.cantilever(analysis={"steps": [0.5, 1.0]})
PATH = scenes.cantilever(analysis={"type": "path", "range": [0, 1.0], "points": 5})
MODES = {
    **FALLING,
    "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
    "analysis": {"type": "modes", "modes": 1},
}


@pytest.fixture(scope="module")
def answers():
    found = {}
    for name, table in (("steps", STEPS), ("path", PATH), ("motion", FALLING), ("modes", MODES)):
        found[name] = solve(Scene.from_dict(table), Settings(accuracy=1e-4))
    return found


@pytest.mark.parametrize("name", ["steps", "path", "motion", "modes"])
def test_a_figure_is_registered_and_shown_by_pyplot(answers, name):
    figure = answers[name].plot()
    assert plt.get_fignums() == [figure.number]
    assert plt.gcf() is figure
    assert figure.canvas is plt.get_current_fig_manager().canvas
    plt.close(figure)
    assert plt.get_fignums() == []
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_what_else_draws_is_registered(answers):
    found = [answers["steps"].last.plot(), curves(answers["steps"], ["energy.elastic"]), histories(answers["motion"])]
    assert plt.get_fignums() == [figure.number for figure in found]


def test_a_refused_picture_leaves_no_figure(answers):
    for draw in (
        lambda: answers["steps"].plot(colour="red"),
        lambda: answers["steps"].plot(steps=[7]),
        lambda: answers["path"].plot("nodes.C.position"),
        lambda: answers["motion"].plot(quantities=["nodes.C.position"]),
        lambda: answers["modes"].plot(count=9),
        lambda: histories(answers["motion"], ["C"]),
        lambda: curves(answers["steps"], ["nodes.C.position"]),
    ):
        with pytest.raises(ValueError, match="accepted"):
            draw()
    assert plt.get_fignums() == []


def test_what_is_written_is_not_registered(answers, tmp_path):
    file = tmp_path / "a.svg"
    save_picture(answers["steps"], file)
    save_curves(answers["steps"], file, ["energy.elastic"])
    save_chart(answers["path"], file)
    save_motion(answers["motion"], file)
    save_histories(answers["motion"], file)
    save_modes(answers["modes"], file)
    answers["steps"].animate(tmp_path / "a.gif")
    assert plt.get_fignums() == []


def test_a_notebook_shows_a_figure_once(answers, monkeypatch):
    figure = answers["steps"].plot()
    # As with the backend of notebooks, which shows what is still registered at the end of a cell.
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    shown = figure._repr_mimebundle_()
    assert shown["image/png"].startswith(b"\x89PNG")
    assert plt.get_fignums() == []
    # Evaluated once more it is shown once more.
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_elsewhere_showing_a_figure_does_not_close_it(answers):
    figure = answers["steps"].plot()
    figure._repr_mimebundle_()
    assert plt.get_fignums() == [figure.number]


def test_the_command_never_looks_for_a_window(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(STEPS))
    code = (
        "import sys; from sfetcas.cli import main;"
        "code = main(['run', 'a.json', '--plot', 'a.png', '--animate', 'a.gif']);"
        "sys.exit(code or 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False, capture_output=True)
    assert done.returncode == 0, done.stderr
