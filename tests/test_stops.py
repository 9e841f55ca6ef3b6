"""Springs with stops: against held angles, complementarity, and what is refused."""

import numpy as np
import pytest
from scenes import SOFT, made

from sfetcas import SceneError, dump, solve
from sfetcas.cli import main
from sfetcas.mechanics.unilateral import worst_of

STOP = (-0.2, 0.5)


def lever(steps, *, dimension="plane", stop=STOP, **more):
    """A rod on a hinge with a spring that has stops, under a force across its tip."""
    return {
        "dimension": dimension,
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "springs": {"k": {"node": "A", "stiffness": 2.0, "stop": list(stop)}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, SOFT["EI3"]]}},
        "analysis": {"steps": steps, "accuracy": 1e-8},
        **more,
    }


def clamped(angle, force):
    """The same rod held at an angle."""
    table = lever([1.0])
    del table["springs"]
    table["nodes"]["A"]["support"] = "clamped"
    table["motions"] = {"turn": {"node": "A", "rotation": angle}}
    table["loads"]["f"]["value"] = [0, force]
    return solve(made(table)).last


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_at_a_stop_it_is_a_rod_held_at_that_angle(dimension):
    table = lever([0.1, 5.0, -5.0, 0.1], dimension=dimension)
    free, high, low, again = solve(made(table)).steps
    assert free.spring("k").stop == again.spring("k").stop == 0.0
    np.testing.assert_allclose(free.position("B"), again.position("B"), atol=1e-8)  # twice the accuracy asked for
    for step, at in ((high, STOP[1]), (low, STOP[0])):
        spring = step.spring("k")
        held = clamped(at, step.factor * SOFT["EI3"])
        assert spring.travel == pytest.approx(at, abs=1e-12)
        np.testing.assert_allclose(step.position("B"), held.position("B"), atol=2e-8)
        # Spring and stop together do what the clamp does; the hinge itself takes no moment.
        moment = held.reaction("A")[1][2]
        assert spring.effort + spring.stop == pytest.approx(moment, abs=1e-6 * abs(moment))
        np.testing.assert_allclose(step.reaction("A")[1], 0.0, atol=1e-9 * abs(moment))
        assert spring.stop * at < 0.0  # it pushes back


@pytest.mark.parametrize("force", [-3.0, -1.0, 2.0, 3.0])
def test_stops_hold_the_angle_and_only_push(force):
    spring = solve(made(lever([force]))).last.spring("k")
    at = STOP[0] if force < 0.0 else STOP[1]
    # To rounding.
    assert spring.travel == pytest.approx(at, abs=1e-12)
    assert spring.stop * at < 0.0


@pytest.mark.parametrize("force", [0.0, 1.0])
def test_within_the_stops_they_do_nothing(force):
    spring = solve(made(lever([force]))).last.spring("k")
    assert STOP[0] < spring.travel < STOP[1]
    assert spring.stop == 0.0


def test_stop_along_a_direction_takes_what_the_tip_cannot():
    table = lever([1.0, 8.0])
    table["nodes"]["A"]["support"] = "clamped"
    table["springs"] = {
        "k": {"type": "translational", "node": "B", "stiffness": 0.0, "direction": [0, 1], "stop": [0, 0.1]}
    }
    small, large = solve(made(table)).steps
    for step in (small, large):
        assert step.position("B")[1] == pytest.approx(0.1, abs=1e-12)
    # Whatever is added to the force at the stop goes into the stop.
    added = 7.0 * SOFT["EI3"]
    assert large.spring("k").stop - small.spring("k").stop == pytest.approx(-added, rel=1e-9)
    np.testing.assert_allclose(small.position("B"), large.position("B"), atol=1e-9)
    assert small.to_dict()["springs"]["k"]["stop"] == small.spring("k").stop


@pytest.mark.parametrize(
    ("spring", "sentence"),
    [
        ({"stop": [0.1, 0.5]}, r"^springs\.k\.stop: found \[0\.1, 0\.5\], accepted: \[low, high\] with zero"),
        ({"stop": [0, 0]}, r"^springs\.k\.stop: found \[0, 0\], accepted: "),
        ({"stop": 0.5}, r"^springs\.k\.stop: found 0\.5, accepted: "),
        ({"stop": [0, 1], "type": "translational"}, r"^springs\.k\.stop: accepted with a rotational spring, or with a"),
    ],
)
def test_wrong_stops_are_refused(spring, sentence):
    table = lever([1.0])
    table["springs"]["k"] |= spring
    with pytest.raises(SceneError, match=sentence):
        made(table)


def test_modes_on_a_path_know_no_stops():
    analysis = {"type": "path", "range": [0, 1], "modes": 1}
    with pytest.raises(SceneError, match=r"^springs\.k\.stop: found a stop with analysis.modes on a path"):
        made(lever([1.0]) | {"analysis": analysis})


def test_all_equilibria_of_too_many_stops_are_refused():
    table = lever([1.0], analysis={"equilibria": "all"})
    table["springs"] |= {name: {**table["springs"]["k"], "stiffness": 0.0} for name in ("l", "m")}
    with pytest.raises(
        SceneError, match=r"^analysis\.equilibria: found 'all' with 27 choices of slack tendons and stops"
    ):
        solve(made(table))


def test_report_tells_what_the_stop_does(tmp_path, capsys):
    file = tmp_path / "lever.json"
    dump(made(lever([0.1, 5.0])), file)
    assert main(["run", str(file)]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  spring k")]
    assert "stop 0 N m" in lines[0]
    assert "angle 0.5 rad, moment -1 N m, stop -" in lines[1]


def test_the_worst_is_switched_first():
    """Strings before stops, what acts before what does not; of equal ones the first, rounding aside; none within it."""

    def worst(margins, active, strings, least=1e-9):
        return worst_of(np.array(margins), np.array(active, dtype=bool), np.array(strings, dtype=bool), least)

    assert worst([-1.0, -2.0, -3.0], [1, 1, 0], [0, 0, 0]) == 1
    assert worst([-1.0, -2.0, -0.1], [1, 1, 0], [0, 0, 1]) == 2
    assert worst([-0.1, -5.0], [1, 0], [1, 1]) == 0
    assert worst([-1.0, -1.0 - 1e-14], [1, 1], [0, 0]) == 0
    assert worst([-1e-10, 2.0], [1, 0], [0, 1]) is None
    assert worst([], [], []) is None
