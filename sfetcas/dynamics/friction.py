"""Forces along obstacles at an instant of a motion, from the balance of all forces.

Of what sticks they are unknown; of what slides they are the coefficient times the push of the obstacle, which depends
on them in turn.  Multipliers are linear in these forces, and so is what is left out of balance, in least squares.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.balance import three
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from ..mechanics.terms import GROUND
from .projecting import factor_closings

if TYPE_CHECKING:
    from ..mechanics.rubbing import Rubbing
    from .sampling import Sample

__all__ = ["dragged", "pushed_along", "rubbed"]


def rubbed(rubbing: Rubbing, equations: Equations, free: State, loading: Loading, sample: Sample) -> Array:
    """Forces (m, axes) along the obstacles on the places that rub, dimensionless.

    Parameters
    ----------
    equations : of the model with the rows of those obstacles that push
    free : the state of the sample in that model, without multipliers
    loading : loads with inertia
    """
    rubs, model = sample.rubs, equations.model
    found = np.zeros((len(rubbing), rubbing.axes))
    if rubs is None or not (rubs.sticks + rubs.slides).any():
        return found
    u, v = rubbing.displacements(sample.y), rubbing.of_quantities(sample.v)
    directions, _ = rubbing.directions(u, v, rubs.ways)
    frames = rubbing.idle(u).frames
    slides, sticks = np.flatnonzero(rubs.slides), np.flatnonzero(rubs.sticks)
    # Unit forces: against the directions of sliding, then along the obstacles where places stick.
    owner = np.concatenate([slides, np.repeat(sticks, rubbing.axes - 1)])
    units = np.concatenate([-directions[slides], frames[sticks].reshape(-1, rubbing.axes)])
    n, tables = equations.unknowns, equations.tables
    columns = np.zeros((equations.total, len(owner)))
    for column, (k, force) in enumerate(zip(owner.tolist(), units, strict=True)):
        cells = tables.place_cells(rubbing.places[k : k + 1]).ravel()
        held = tables.unknown[cells] >= 0
        np.add.at(columns[:, column], tables.unknown[cells[held]], -force[held] * tables.weight[cells[held]])
    point = equations.at(free, loading)
    factor_closings(equations, point)
    solved = equations.solver.solve
    left = solved(np.concatenate([-point.residual[:n], np.zeros(equations.rows)]))
    yields = np.stack([solved(-column) for column in columns.T], axis=1)
    # What slides: its force is the coefficient times the push, which is minus the multiplier.
    number = {name: i for i, name in enumerate(model.row_names)}
    rows = n + np.array([number[rubbing.names[k]] for k in slides], np.intp)
    count, weights = len(slides), rubbing.coefficients[slides]
    matrix = np.eye(count) + weights[:, None] * yields[rows, :count]
    given = np.column_stack([-weights * left[rows], -weights[:, None] * yields[rows, count:]])
    of_sliding = np.linalg.solve(matrix, given)
    # What sticks: with these forces the least is out of balance.
    least = left[:n] + yields[:n, :count] @ of_sliding[:, 0]
    more = yields[:n, count:] + yields[:n, :count] @ of_sliding[:, 1:]
    of_sticking = np.linalg.lstsq(more, -least, rcond=REDUNDANT)[0]
    sizes = np.concatenate([of_sliding[:, 0] + of_sliding[:, 1:] @ of_sticking, of_sticking])
    np.add.at(found, owner, sizes[:, None] * units)
    return found


def pushed_along(rubbing: Rubbing, loading: Loading, forces: Array, arms: Array) -> Loading:
    """Loads with forces (m, axes) along obstacles added, and their opposites on what carries these, dimensionless.

    ``arms`` (m, axes) are the places that rub, seen from what carries their obstacles.
    """
    on_places, couple, moment = (np.zeros_like(part) for part in (loading.force, loading.couple, loading.moment))
    np.add.at(on_places, rubbing.places, forces)
    carried = np.flatnonzero(rubbing.carriers != GROUND)
    np.add.at(on_places, rubbing.carriers[carried], -forces[carried])
    for k in carried.tolist():
        back = -np.cross(three(arms[k]), three(forces[k]))
        couple[rubbing.carriers[k]] += back
        moment[rubbing.turns[k]] += back
    force, own = loading.force + on_places, loading.own + on_places
    return replace(loading, force=force, own=own, couple=loading.couple + couple, moment=loading.moment + moment)


def dragged(equations: Equations, loading: Loading, forces: Array) -> Loading:
    """Loads with forces of friction by full coordinates (full,) added, dimensionless."""
    tables = equations.tables
    on_turns, on_places = np.split(forces[: tables.of_rows], [tables.of_places])
    moment, force = np.zeros_like(loading.moment), on_places.reshape(loading.force.shape)
    moment[:, 3 - tables.width :] = on_turns.reshape(len(moment), tables.width)
    return replace(loading, force=loading.force + force, own=loading.own + force, moment=loading.moment + moment)


REDUNDANT = 1e-9
"""Share of the largest below which what a force leaves out of balance says nothing of it."""
