"""Scenes that move, motions of them with fixed steps, and flights step by step for what is kept to all digits."""

import copy
from dataclasses import replace

import numpy as np

import sfetcas
from sfetcas import Scene, assemble, uniform_mesh
from sfetcas.dynamics.beginning import at_rest, velocities
from sfetcas.dynamics.conserving import Conserving
from sfetcas.dynamics.inertia import Inertia
from sfetcas.dynamics.integrating import Stepper
from sfetcas.dynamics.methods import GeneralisedAlpha, Radau
from sfetcas.dynamics.stages import StageEquations
from sfetcas.dynamics.taken import Memory
from sfetcas.mechanics.equations import Equations, State
from sfetcas.mechanics.masses import masses_of

METHODS = {m.name: m for m in (Radau(3), Radau(2), GeneralisedAlpha(), Conserving())}
SMOOTH = {"t": [0, 1], "polynomial": [[0, 0, 0, 0, 35, -84, 70, -20]]}
"""From 0 to 1 with three continuous derivatives."""
FLAT = {"EI3": 1.0, "rhoA": 1.0, "rhoI": [0.01, 0.0, 0.01]}
THICK = {"EI2": 1.0, "EI3": 2.0, "GJ": 0.8, "rhoA": 1.0, "rhoI": [0.02, 0.015, 0.005]}


def cantilever(section=FLAT, value=(1.0, 2.0), **more):
    """A clamped strip that is pushed at its end, smoothly from rest."""
    return {
        "sections": {"s": dict(section)},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": list(value), "history": "on"}},
        "histories": {"on": SMOOTH},
        **more,
    }


def changed(table, **values):
    """A scene with values set by place, ``nodes__B__mass=1.0``."""
    table = copy.deepcopy(table)
    for place, value in values.items():
        *outer, key = place.split("__")
        inner = table
        for part in outer:
            inner = inner.setdefault(part, {})
        inner[key] = value
    return table


def moved(table, end, step=None, integrator="radau-3", element="SFET4", elements=1, **keys):
    """The motion of a scene, with fixed steps on a given mesh, or by the accuracy among the keys."""
    analysis = {"type": "dynamic", "end": end, "integrator": integrator, "output": end, **keys}
    if step is not None:
        analysis["step"] = step
    scene = Scene.from_dict({**table, "analysis": analysis})
    if step is None:
        return sfetcas.solve(scene)
    return sfetcas.solve(scene, element=element, elements=elements)


def tip(motion, node="B"):
    """Where a node is at the end."""
    return motion.last.position(node)


class Flight:
    """Steps of a scene by hand: every memory is the state at the end of a step, not one between steps."""

    def __init__(self, table, method="conserving", order=3, elements=2):
        scene = Scene.from_dict({**table, "analysis": {"type": "dynamic", "end": 1.0}})
        self.model = assemble(scene, replace(uniform_mesh(scene, order, elements), places=True), assembly="nodal")
        self.equations = Equations(self.model)
        self.system = StageEquations(self.equations, masses_of(self.model))
        self.stepper = Stepper(self.system, METHODS[method])
        self.inertia = Inertia(self.system)
        state = at_rest(self.model)
        self.loading, self.gap = self.model.loading(1.0), 0.0
        rates, _ = velocities(self.system, self.equations, state)
        x, v = self.system.rates(state, self.system.factors(0.0), rates)
        kept = np.zeros((self.stepper.method.kept, len(x)))
        kept[0] = v
        self.memory = Memory(0.0, state.q, state.y, state.lam, x, kept, state.unwrapped)

    def steps(self, h, count):
        """States after steps of a length, s; the first is the begin."""
        h /= self.stepper.time
        self.memory = self.stepper.refreshed(self.memory, h)
        yield self.memory
        for _ in range(count):
            taken = self.stepper.step(self.memory, h)
            assert taken.converged
            self.gap = max(self.gap, taken.gap)
            self.memory = taken.after
            yield self.memory

    def back(self):
        """All velocities reversed."""
        self.memory = replace(self.memory, rates=-self.memory.rates, last=None)

    def energy(self, memory):
        """Kinetic energy and potential of springs, bending and dead loads, dimensionless."""
        state = State(memory.q, memory.y, np.zeros(len(self.model.row_names)), memory.unwrapped)
        return self.inertia.kinetic(memory.rates[0]) + self.equations.at(state, self.loading).potential

    def momentum(self, memory):
        """Linear momentum, and angular momentum about the centre of mass."""
        return self.inertia.momentum(memory.x + np.resize(memory.origin[1], memory.x.shape), memory.rates[0])
