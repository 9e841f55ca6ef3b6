"""Integrators: orders in time and space, what they keep, reversed motions, kinks of loads."""

import numpy as np
import pytest
from motions import FLAT, THICK, Flight, cantilever, changed, moved, tip

pytestmark = pytest.mark.usefixtures("interpreted")

PLANE = cantilever()
SPACE = cantilever(THICK, (0.5, 1.0, 1.5))
ORDERS = {"generalised-alpha": 2, "conserving": 2, "radau-2": 3, "radau-3": 5}
LONG = {"generalised-alpha": 1 / 32, "conserving": 1 / 32, "radau-2": 1 / 32, "radau-3": 1 / 16}
"""Steps, s, at which the highest frequency of one element is resolved: beyond, orders are those of stiff problems."""


def order(errors):
    return np.log2(errors[0] / errors[1])


@pytest.fixture(scope="module", params=["plane", "space"])
def reference(request):
    """A scene and where its end is after 1.3 s, by steps so short that their error is below 1e-11."""
    table = {"plane": PLANE, "space": SPACE}[request.param]
    return table, tip(moved(table, 1.3, 1 / 400, element="SFET3"))


@pytest.mark.parametrize("integrator", ORDERS)
def test_order_in_time(reference, integrator):
    table, there = reference
    errors = [
        np.abs(tip(moved(table, 1.3, LONG[integrator] / k, integrator, element="SFET3")) - there).max() for k in (1, 2)
    ]
    assert order(errors) == pytest.approx(ORDERS[integrator], abs=0.25)


@pytest.mark.parametrize(
    ("table", "p", "counts"),
    [
        (PLANE, 1, (8, 16)),
        (PLANE, 2, (4, 8)),
        (PLANE, 3, (3, 6)),
        (PLANE, 4, (2, 4)),
        (SPACE, 2, (4, 8)),
        (SPACE, 3, (3, 6)),
    ],
)
def test_order_in_space(table, p, counts):
    def end(order, elements):
        return tip(moved(table, 1.0, 1 / 50, element=f"SFET{order + 1}", elements=elements))

    # The error in time is the same for all, to what the mesh changes of it.
    there = end(5, 8)
    assert order([np.abs(end(p, n) - there).max() for n in counts]) == pytest.approx(2 * p, abs=0.4)


# -- what is kept ---------------------------------------------------------------------------------------------------


def thrown(space):
    """A free strip thrown with a spin that bends it."""
    if space:
        nodes = {
            "A": {"position": [0, 0, 0], "velocity": [0, 0.3, 1]},
            "B": {"position": [1, 0, 0], "velocity": [0, 3, -1]},
        }
        member = {"nodes": ["A", "B"], "section": "s", "spin": [2.0, 2.0, 2.7]}
    else:
        nodes = {"A": {"position": [0, 0], "velocity": [0, 0.3]}, "B": {"position": [1, 0]}}
        member = {"nodes": ["A", "B"], "section": "s", "spin": {"polynomial": [4, -8.0]}}
    return {"sections": {"s": dict(THICK if space else FLAT)}, "nodes": nodes, "members": {"m": member}}


def chain(space):
    """A free chain of flexible and rigid members with hinges, a mass in the middle and a spring."""
    turning = {"spin": [0.5, 1.0, 3.0]} if space else {"spin": 3.0}
    table = {
        "sections": {"s": dict(THICK if space else FLAT)},
        "nodes": {
            "A": {"position": [0, 0, 0], "velocity": [0.2, -1.0, 0.5 if space else 0.0]},
            "B": {"position": [1, 0, 0], "joint": "hinge", "mass": 0.3},
            "C": {"position": [1.8, 0.3, 0], "joint": "hinge"},
            "D": {"position": [2.6, -0.2, 0], "mass": 0.2},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s", **turning},
            "two": {"nodes": ["B", "C"], "section": "s", "type": "rigid"},
            "three": {"nodes": ["C", "D"], "section": "s"},
        },
        "springs": {"knee": {"node": "C", "stiffness": 0.7, "between": ["two", "three"]}},
    }
    if space:
        table["members"]["three"]["spin"] = [0.5, 1.0, -2.0]
        del table["springs"]
    return table


def kept(flight, h, count):
    """Changes of the energy over the largest kinetic one, and the largest ones of the momenta over that of its size."""
    energies, momenta, kinetic = [], [], 0.0
    for k, memory in enumerate(flight.steps(h, count)):
        if k % (1 + count // 500):
            continue
        energies.append(flight.energy(memory))
        momenta.append(flight.momentum(memory))
        kinetic = max(kinetic, flight.inertia.kinetic(memory.rates[0]))
    energies = np.array(energies)
    linear, angular = (np.array(part) for part in zip(*momenta, strict=True))
    apart = [np.abs(part - part[0]).max() / np.sqrt(2.0 * kinetic) for part in (linear, angular)]
    return (energies - energies[0]) / kinetic, *apart


FLIGHTS = [thrown(False), thrown(True), chain(False), chain(True)]
ROUNDING = 1e-12
"""Some thousand operations and some hundred steps at 1e-16."""


@pytest.mark.parametrize("table", FLIGHTS, ids=["plane", "space", "chain", "chain in space"])
def test_conserving_keeps_energy_and_momenta(table):
    flight = Flight(table)
    energy, linear, angular = kept(flight, 0.01, 300)
    assert np.abs(energy).max() < ROUNDING
    assert linear < ROUNDING
    assert angular < ROUNDING
    assert flight.gap < ROUNDING
    if flight.model.space:
        assert np.abs((flight.memory.q**2).sum(axis=1) - 1.0).max() < ROUNDING


@pytest.mark.parametrize("table", FLIGHTS[:2], ids=["plane", "space"])
def test_energy_does_not_grow_in_many_steps(table):
    flight = Flight(table, order=2, elements=1)
    energy, linear, angular = kept(flight, 0.02, 5000)
    assert np.abs(energy).max() < 10 * ROUNDING
    # No trend: the ends of the time are no further apart than what lies between.
    assert abs(energy[-100:].mean() - energy[:100].mean()) < ROUNDING
    assert max(linear, angular) < 10 * ROUNDING


@pytest.mark.parametrize("table", FLIGHTS, ids=["plane", "space", "chain", "chain in space"])
@pytest.mark.parametrize("method", ["radau-3", "radau-2", "generalised-alpha"])
def test_others_keep_the_linear_momentum(table, method):
    flight = Flight(table, method)
    _, linear, _ = kept(flight, 0.01, 100)
    # Velocities of these have rounding over the length of a step.
    assert linear < 100 * ROUNDING
    assert flight.gap < ROUNDING


def test_radau_loses_energy_slowly():
    flight = Flight(thrown(False), "radau-3")
    energy, _, _ = kept(flight, 0.005, 400)
    assert -1e-3 < energy[-1] < 0.0
    assert energy.max() < 1e-5


def test_conserving_keeps_energy_under_dead_loads_and_springs():
    table = cantilever(THICK, gravity=[0.0, 0.0, -3.0])
    table["loads"]["tip"] = {"type": "force", "node": "B", "value": [0.3, 1.0, -2.0]}
    table["nodes"]["B"] |= {"mass": 0.2, "velocity": [0.0, -0.5, 0.8]}
    table["springs"] = {"line": {"type": "translational", "node": "B", "stiffness": 2.0, "direction": [0, 1, 0]}}
    flight = Flight(table)
    energy, _, _ = kept(flight, 0.01, 200)
    assert np.abs(energy).max() < ROUNDING


def test_conserving_keeps_energy_under_a_moment_in_the_plane():
    table = changed(cantilever(), loads__tip={"type": "moment", "node": "B", "value": 1.5})
    table["members"]["m"]["spin"] = {"polynomial": [0, 1]}
    energy, _, _ = kept(Flight(table), 0.01, 100)
    assert np.abs(energy).max() < ROUNDING


@pytest.mark.parametrize("table", [FLIGHTS[1], FLIGHTS[2]], ids=["space", "chain"])
def test_conserving_comes_back(table):
    flight = Flight(table)
    start = flight.memory
    for _ in flight.steps(0.01, 150):
        pass
    flight.back()
    for _ in flight.steps(0.01, 150):
        pass
    apart = np.abs(flight.memory.y - start.y).max()
    # Differences of 1e-16 grow with time, in chaotic chains fastest.
    assert apart < 1e-9
    assert np.abs(flight.memory.rates[0] + start.rates[0]).max() < 1e-7
