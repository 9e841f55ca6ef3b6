"""What members with memory remember after a step, and what they have dissipated, from the state at its end."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from .batches import GroupBatch
from .mesh import Mesh, Remembered
from .model import Model
from .terms import Group, Term

__all__ = ["dissipated_along", "remembering"]


@functools.cache
def _remembered(kind: Term) -> ca.Function:
    """The function of a kind, made once a process."""
    return kind.remembered()


def _evaluated(model: Model, q: Array) -> Iterator[tuple[Group, Array, Array]]:
    """Each group with memory: internal variables (n, points, variables) after the step to rotations q, and what the
    step has dissipated (n,), dimensionless."""
    nowhere = np.zeros((len(model.segments.places), model.element.axes))
    for group in model.connections:
        if group.kind.memory:
            n = len(group.data)
            found = GroupBatch(model, group, _remembered(group.kind))(q, nowhere, np.zeros(0))
            variables, spent = (part.reshape(n, -1).copy() for part in found)
            yield group, variables.reshape(n, -1, group.kind.memory), spent.ravel()


def dissipated_along(model: Model, q: Array) -> dict[str, float]:
    """What each member with memory has dissipated since it was undeformed, J, after the step to rotations q."""
    before, found = model.mesh.memory or {}, dict[str, float]()
    for group, _, spent in _evaluated(model, q):
        for name in dict.fromkeys(group.names):
            own = np.array([other == name for other in group.names])
            earlier = before[name].dissipated if name in before else 0.0
            found[name] = earlier + float(spent[own].sum()) * model.scales.moment
    return found


def remembering(model: Model, q: Array) -> Mesh:
    """The mesh of a model with what its members remember after the step to rotations q."""
    total, found = dissipated_along(model, q), dict[str, Remembered]()
    for group, variables, _ in _evaluated(model, q):
        for name in dict.fromkeys(group.names):
            own = np.array([other == name for other in group.names])
            # The elements of a member stand in their order.
            found[name] = Remembered(variables[own], total[name])
    return replace(model.mesh, memory=found)
