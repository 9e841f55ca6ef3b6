"""What members with memory remember after a step, and what they have dissipated, from the state at its end."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array
from .mesh import Mesh, Remembered
from .model import Model
from .terms import Group, Term

__all__ = ["Remembering", "dissipated_along", "remembering"]


@functools.cache
def _remembered(kind: Term) -> ca.Function:
    """The function of a kind, made once a process."""
    return kind.remembered()


class Remembering:
    """What the members of a model remember, as one vector: internal variables, then what each element has dissipated.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    numbers : tuple of int
        Numbers of the groups of connections that remember.
    size : int
        Number of internal variables.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.numbers = tuple(i for i, group in enumerate(model.connections) if group.kind.memory)
        self._groups = [model.connections[i] for i in self.numbers]
        shapes = [(len(group.data), len(group.kind.memory_columns)) for group in self._groups]
        self._bounds = np.cumsum([0, *(n * width for n, width in shapes)]).tolist()
        self._shapes, self.size = shapes, int(self._bounds[-1])
        self._functions = [_remembered(group.kind).map(n) for group, (n, _) in zip(self._groups, shapes, strict=True)]

    @property
    def begun(self) -> Array:
        """The vector of the mesh of the model: what the steps before have left."""
        variables = [group.data[:, group.kind.memory_columns].ravel() for group in self._groups]
        spent = [self._before(group) for group in self._groups]
        return np.concatenate([np.zeros(0), *variables, *spent])

    def _before(self, group: Group) -> Array:
        """What its elements have dissipated before, dimensionless, that of a member evenly among them."""
        memory, names = self.model.mesh.memory or {}, np.array(group.names)
        found = np.zeros(len(names))
        for name in set(group.names) & set(memory):
            own = names == name
            found[own] = memory[name].dissipated / self.model.scales.moment / own.sum()
        return found

    def parts(self) -> Iterator[tuple[int, Group, slice]]:
        """Number of each group among the connections, the group, and where its internal variables are."""
        for number, group, begin, end in zip(self.numbers, self._groups, self._bounds, self._bounds[1:], strict=False):
            yield number, group, slice(begin, end)

    def after(self, q: Array, y: Array, before: Array) -> Array:
        """The vector after a step to rotations q and displacement unknowns y, from that before it."""
        found = self._found(q, y, before)
        lost = before[self.size :] + np.concatenate([np.zeros(0), *(each[1].ravel() for each in found)])
        return np.concatenate([np.zeros(0), *(each[0].T.ravel() for each in found), lost])

    def missed(self, way: Sequence[tuple[Array, Array]]) -> float:
        """What one step to the last of several states, rotations q and displacement unknowns y, leaves out.

        It is by how much what the way through all of them bends for good differs, summed along the members, rad.
        """
        *between, last = way
        there = self.begun
        for state in between:
            there = self.after(*state, there)
        pairs = zip(self._found(*last, self.begun), self._found(*last, there), strict=True)
        apart = (np.linalg.norm((one[2] - other[2]).T.reshape(-1, 3), axis=1).sum() for one, other in pairs)
        return float(sum(apart))

    def _found(self, q: Array, y: Array, before: Array) -> list[tuple[Array, ...]]:
        """Results of :meth:`.Term.remembered`, of each group: columns are its elements."""
        results, known = [], np.append(y, 0.0)
        for (_, group, part), function, shape in zip(self.parts(), self._functions, self._shapes, strict=True):
            n = shape[0]
            data = group.data.copy()
            data[:, group.kind.memory_columns] = before[part].reshape(shape)
            turned = q[group.turns].reshape(n * group.turns.shape[1], -1).T
            # Places of strains are all unknown.
            strains = known[self.model.positions.retained[group.places]].reshape(-1, self.model.element.axes).T
            found = function(turned, strains, data.T, ca.DM(0, n), ca.DM(0, n))
            results.append(tuple(np.array(each) for each in found))
        return results

    def mesh(self, vector: Array) -> Mesh:
        """The mesh of the model with what a vector remembers."""
        found, begin = dict[str, Remembered](), self.size
        for (_, group, part), shape in zip(self.parts(), self._shapes, strict=True):
            variables = vector[part].reshape(shape[0], -1, group.kind.memory)
            spent, begin = vector[begin : begin + shape[0]] * self.model.scales.moment, begin + shape[0]
            names = np.array(group.names)
            for name in dict.fromkeys(group.names):
                # The elements of a member stand in their order.
                found[name] = Remembered(variables[names == name], float(spent[names == name].sum()))
        return replace(self.model.mesh, memory=found)

    def model_with(self, vector: Array) -> Model:
        """The model whose members remember what a vector says."""
        connections = list(self.model.connections)
        for (number, group, part), shape in zip(self.parts(), self._shapes, strict=True):
            data = group.data.copy()
            data[:, group.kind.memory_columns] = vector[part].reshape(shape)
            connections[number] = replace(group, data=data)
        return replace(self.model, mesh=self.mesh(vector), connections=tuple(connections))


def dissipated_along(model: Model, q: Array, y: Array) -> dict[str, float]:
    """What each member with memory has dissipated since it was undeformed, J, after the step to rotations q and
    displacement unknowns y.
    """
    return {name: one.dissipated for name, one in (remembering(model, q, y).memory or {}).items()}


def remembering(model: Model, q: Array, y: Array) -> Mesh:
    """The mesh of a model with what its members remember after the step to rotations q and displacement unknowns y."""
    memory = Remembering(model)
    if not memory.size:
        return model.mesh
    return memory.mesh(memory.after(q, y, memory.begun))
