"""All equilibria where members may touch: against closed forms, chains of rigid links, and themselves."""

import itertools
import json
import math

import numpy as np
import pytest
from scenes import SOFT, made

from benchmarks.contact_chain import Chain, ChainState
from benchmarks.contact_oracle import WIDTHS, emerged, settled
from sfetcas import solve
from sfetcas.contact.closest import Closest
from sfetcas.pictures.plotting import save_picture

TOUCHES = 1e-6
"""Push, over the loads, from which on something touches: rounding is far below."""


def walls(height, members):
    """Two walls beside the line y = 0."""
    sides = {"upper": (height, -1), "lower": (-height, 1)}
    return {
        name: {"type": "plane", "point": [0, y], "normal": [0, n], "members": members} for name, (y, n) in sides.items()
    }


def bars(force, height, **analysis):
    """Two rigid bars of length 1 in a line with a spring of stiffness 1 between them, pressed between walls."""
    return {
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "M": {"position": [1, 0], "joint": "hinge"},
            "B": {"position": [2, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
        },
        "members": {"l": {"nodes": ["A", "M"], "type": "rigid"}, "r": {"nodes": ["M", "B"], "type": "rigid"}},
        "springs": {"k": {"type": "rotational", "node": "M", "between": ["l", "r"], "stiffness": 1.0}},
        "loads": {"P": {"type": "force", "node": "B", "value": [-force, 0]}},
        "contacts": walls(height, "all"),
        "analysis": {"equilibria": "all", **analysis},
    }


def strip(nearer, height, **analysis):
    """A strip of length 1 between hinges that come nearer to each other, between walls."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "support": "hinge"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "motions": {"B": {"node": "B", "displacement": [-nearer, 0]}},
        "contacts": walls(height, ["m"]),
        "analysis": {"equilibria": "all", "accuracy": 1e-5, **analysis},
    }


def arch(load, floor):
    """A shallow arch between hinges under an even load above a floor."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0], "support": "hinge"}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -1.0}}},
        "loads": {"w": {"type": "distributed", "member": "m", "value": [0, -load]}},
        "contacts": {"floor": {"type": "plane", "point": [0, floor], "normal": [0, 1], "member": "m"}},
        "analysis": {"equilibria": "all", "accuracy": 1e-5},
    }


def pushes(step):
    """Contacts that push, with their forces."""
    forces = {name: np.linalg.norm(entry["force"]) for name, entry in step.contacts.items()}
    return {name: force for name, force in forces.items() if force > TOUCHES}


FORCE, HEIGHT = 3.0, 0.3


@pytest.fixture(scope="module")
def pressed():
    """Two bars between walls, below and beyond the critical force of 2."""
    return solve(made(bars(FORCE, HEIGHT, steps=[0.5, 1.0], accuracy=1e-9)), runs=10)


@pytest.mark.parametrize("factor", [0.5, 1.0])
def test_bars_between_walls_have_the_equilibria_of_their_energy(pressed, factor):
    force = factor * FORCE
    steps = [step for step in pressed.steps if step.factor == factor]
    # The bars may also be folded, one on the other, and turn together.
    steps = [step for step in steps if step.certificate.stable != "neutral"]
    found = sorted((round(turned(step), 8), step.certificate.stable, *pushes(step).values()) for step in steps)
    # In line, or on the walls: the energy is k (2 t)^2 / 2 - 2 P (1 - cos t), the height sin t.
    known = {0.0: [force < 2.0]}
    for k, side in itertools.product((-1, 0, 1), (1, -1)):
        for turn in (2.0 * math.pi * k + math.asin(HEIGHT), 2.0 * math.pi * k + math.pi - math.asin(HEIGHT)):
            push = (2.0 * force * math.sin(turn) - 4.0 * turn) / math.cos(turn)
            known |= {round(side * turn, 8): [True, push]} if push > 0.0 else {}
    for turn, *rest in found:
        np.testing.assert_allclose(rest, known[turn], atol=1e-8)
    # Those that no bar is wound up for are all there.
    assert {turn for turn in known if abs(turn) < math.pi} <= {turn for turn, *_ in found}
    assert sum(abs(turn) < math.pi for turn in known) == (3 if factor == 0.5 else 5)


def turned(step):
    """How far the first of two bars is turned, by the spring between them, which counts turns."""
    return -0.5 * step.fields.spring("k").travel


def chain_state(chain, step):
    """An answer as a state of a chain of one member."""
    (links,) = chain.link_of.values()
    x = np.linspace(0.0, 1.0, len(links) + 1)
    d = np.diff(step.fields.positions("m", x)[:, :2], axis=0)
    there, here = (np.unwrap(np.arctan2(v[:, 1], v[:, 0])) for v in (d, chain.d0))
    return met(chain, there - here, np.array([step.position(name)[:2] for name in chain.names]) / chain.size)


def met(chain, turned, places):
    """A state with links that are turned, back on the constraints."""
    start = chain.start()
    turns = start.turns.copy()
    turns[chain.link_body, 0] = turned
    turns[[i for i in range(len(turns)) if i not in chain.free]] = 0.0
    state = ChainState(turns, places)
    for _ in range(40):
        missed = chain.residual(state, 1.0)
        if np.abs(missed).max() < 1e-11:
            return state
        A = chain.system(state, 1.0, 10.0)[2]
        there = chain.moved(state, -np.linalg.pinv(A, rcond=1e-10) @ missed, 1.0, np.linalg.pinv(A, rcond=1e-10))
        if there is None:
            return None
        state = there
    return None


def chain_minima(chain, tries):
    """Minima of the energy of a chain from states at random."""
    rng, found = np.random.default_rng(1), []
    (links,) = chain.link_of.values()
    x = np.linspace(0.0, 1.0, len(links))
    places = chain.p0 + np.array([[0.0, 0.0], (chain.b0 + chain.b1)[-2:] - chain.p0[1]])
    for _ in range(tries):
        state = met(chain, sum(rng.normal(0.0, 0.5) * np.cos(k * math.pi * x) for k in range(1, 4)), places)
        # Obstacles come in from afar.
        for before, width in itertools.pairwise((1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 8e-3, WIDTHS[0])):
            state = None if state is None else emerged(chain, state, before, width)
            state = None if state is None else settled(chain, state, 1.0, width, True)[0]
        if state is not None and not any(np.abs(chain.points(state) - one).max() < 0.02 for one in found):
            found.append(chain.points(state))
    return found


@pytest.mark.parametrize(
    ("table", "runs", "count"),
    [
        # On one wall bent off it in its middle, and in two lobes of which one touches; with their mirror images.
        pytest.param(strip(0.02, 0.05), 30, 6, id="strip"),
        # Bent down on either side, and through the floor but for that: then it lies on it twice.
        pytest.param(arch(40.0, -0.05), 60, 3, id="arch"),
    ],
)
def test_stable_answers_are_the_minima_of_a_chain_of_links(table, runs, count):
    answer = solve(made(table), runs=runs)
    chain = Chain({name: part for name, part in table.items() if name != "analysis"}, 32)
    stable, moved = [], []
    for step in answer.steps:
        begin = chain_state(chain, step)
        end = settled(chain, begin, 1.0, WIDTHS[0], True)[0]
        moved.append(np.abs(chain.points(end) - chain.points(begin)).max())
        if step.certificate.stable:
            stable.append(chain.points(end))
    # A chain of 32 links is off by less than a hundredth, and from unstable states it falls by more than that.
    assert [far < 0.008 for far in moved] == [step.certificate.stable for step in answer.steps]
    assert len(stable) == count
    found = chain_minima(chain, 6)
    assert found
    for one in found:
        assert min(np.abs(one - other).max() for other in stable) < 0.01


def test_search_goes_downhill_in_contact_where_it_would_fall_through_the_floor_without():
    bar = {
        "nodes": {"A": {"position": [0, 0.3], "support": "hinge"}, "B": {"position": [1, 0.3]}},
        "members": {"m": {"nodes": ["A", "B"], "type": "rigid"}},
        "springs": {"k": {"type": "rotational", "node": "A", "stiffness": 0.1}},
        "loads": {"P": {"type": "force", "node": "B", "value": [-1, 0]}},
        "contacts": {"floor": {"type": "plane", "point": [0, 0], "normal": [0, 1], "member": "m"}},
        "analysis": {"equilibria": "all"},
    }
    lies = [step for step in solve(made(bar), runs=16).steps if pushes(step)]
    assert [round(step.position("B")[1], 9) for step in lies] == [0.0]
    # The moment of the spring helps the floor.
    turn = -math.asin(0.3)
    force = (math.sin(-turn) + 0.1 * turn) / math.cos(turn)
    np.testing.assert_allclose(lies[0].contacts["floor"]["force"], [0, force, 0], atol=1e-9)


def test_member_rests_on_another_or_hangs_beside_it():
    table = {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0]},
            "C": {"position": [1.5, -0.3], "support": "clamped"},
            "D": {"position": [0.8, -0.3]},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}, "n": {"nodes": ["C", "D"], "section": "s"}},
        "loads": {"P": {"type": "force", "node": "B", "value": [0, -2]}},
        "contacts": {"both": {"type": "members", "members": ["m", "n"], "radius": 0.02}},
        "analysis": {"equilibria": "all", "accuracy": 1e-4},
    }
    answer = solve(made(table), runs=4)
    rests, hangs = answer.steps
    assert pushes(rests)
    assert not pushes(hangs)
    assert [step.certificate.stable for step in answer.steps] == [True, True]
    np.testing.assert_allclose(rests.contacts["both"]["gap"], 0.0, atol=1e-6)
    # Beside it nothing is known of the other one: as if that were not there.
    del table["contacts"], table["members"]["n"], table["nodes"]["C"], table["nodes"]["D"]
    alone = solve(made(table)).last
    np.testing.assert_allclose(hangs.position("B"), alone.position("B"), atol=2e-4)


def over_ball(contact, **more):
    """A cantilever that a force at its tip bends over a ball or a disc."""
    return {
        "sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"P": {"type": "force", "node": "B", "value": [0, -3]}},
        "contacts": {"ball": {"center": [0.5, -0.3], "radius": 0.2, "member": "m", **contact}},
        "analysis": {"accuracy": 1e-4, "equilibria": "all"},
        **more,
    }


def test_strip_slides_off_a_ball_to_either_side_and_stands_on_it_as_on_a_disc():
    answer = solve(made(over_ball({"type": "sphere"}, dimension="space")), runs=6)
    one, other, above = sorted(answer.steps, key=lambda step: step.potential)
    np.testing.assert_allclose(one.position("B"), [1, 1, -1] * other.position("B"), atol=1e-3)
    assert abs(one.position("B")[2]) > 0.01
    assert [step.certificate.negative for step in (one, other, above)] == [0, 0, 1]
    plane = over_ball({"type": "circle"}, sections={"s": {"EI3": 1.0}}, analysis={"accuracy": 1e-4})
    on_disc = solve(made(plane)).last
    # In the plane it cannot slide off.
    assert on_disc.certificate.stable
    np.testing.assert_allclose(above.position("B"), on_disc.position("B"), atol=1e-4)
    np.testing.assert_allclose(above.energy["total"], on_disc.energy["total"], rtol=1e-4)


@pytest.mark.parametrize(("stop", "pushed"), [(0.4, 0), (0.8, 2)])
def test_what_is_nearer_stops_bars_the_stop_of_their_spring_or_a_wall(stop, pushed):
    table = bars(FORCE, HEIGHT)
    table["springs"]["k"]["stop"] = [-stop, stop]
    steps = solve(made(table), runs=6).steps
    turn = min(0.5 * stop, math.asin(HEIGHT))
    np.testing.assert_allclose(sorted(map(turned, steps)), [-turn, 0.0, turn], atol=1e-9)
    assert sum(bool(pushes(step)) for step in steps) == pushed


def test_surfaces_that_are_drawn_back_stay_on_their_side_of_what_is_round():
    table = arch(1.0, -0.5)
    table["contacts"] |= {
        "drum": {"type": "circle", "center": [0.5, -1], "radius": 0.1, "member": "m"},
        "bowl": {"type": "circle", "center": [0.5, 0], "radius": 2.0, "side": "inside", "member": "m"},
        "pin": {"type": "point", "position": [0.5, -0.4], "side": [0, 1], "member": "m"},
    }
    closest = Closest(made(table))
    given = {name: pair.distance for (name, _), pair in closest.pairs.items()}
    closest.draw_back(0.3)
    back = {name: given[name] - pair.distance for (name, _), pair in closest.pairs.items()}
    assert [back["floor"], back["bowl"]] == pytest.approx([0.3, 0.3])
    assert 0.09 < back["drum"] < 0.1
    assert back["pin"] == 0.0
    closest.draw_back(0.0)
    assert {name: pair.distance for (name, _), pair in closest.pairs.items()} == given


def test_answers_of_all_equilibria_are_written_and_drawn(pressed, tmp_path):
    told = json.loads(json.dumps(pressed.to_dict()))["steps"]
    assert len(told) == len(pressed.steps)
    assert {"upper", "lower"} <= set(told[0]["contacts"])
    note = told[0]["notes"][-1]
    assert note.startswith("searched by ")
    assert "without contact" in note
    save_picture(pressed, tmp_path / "all.png")
    assert (tmp_path / "all.png").stat().st_size > 0
