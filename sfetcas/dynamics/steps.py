"""A whole time step as one CasADi Function: prediction, Newton's method, rates after it.

Newton's iterations are nested conditionals, so that a step ends when it has converged; nothing of it is Python.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import casadi as ca
import numpy as np

from ..mechanics.expressions import Given, moved_by
from .methods import Begin, Method
from .stages import StageEquations

__all__ = ["ITERATIONS", "LAST_CHANGE", "LOST", "guessed", "repeated", "step_function"]

ITERATIONS = 10
"""Iterations of Newton's method at most."""

LAST_CHANGE = 1e-8
"""Change, rad or unit of length, at which the iteration ends: convergence is quadratic, the next change is rounding."""


def step_function(system: StageEquations, method: Method) -> ca.Function:
    """A step of a method.

    ``(q, y, lam, turns, shifts, x, rates, ratio, h, factors, unwrapped) -> (q, y, lam, turns, shifts, x, rates, size,
    iterations, gap)``: before and after the step rotations q (components, rotations), displacements y, multipliers lam,
    quantities x and their rates (quantities, kept); of its stages rotation vectors turns (turns, rotations * stages)
    since its begin and shifts (displacements, stages); ``ratio`` is its length h over that of the step before, 0 for a
    restart; factors (groups, loaded) of the loads.  It has converged when ``size`` is at most :data:`LAST_CHANGE`;
    ``gap`` is the largest gap of the constraints.  Everything is dimensionless.
    """
    n, s = system.layout, method.stages
    q, y, lam = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("lam", n.lam)
    turns, shifts = ca.MX.sym("turns", system.turns, n.rotations * s), ca.MX.sym("shifts", n.y, s)
    x, rates = ca.MX.sym("x", n.x), ca.MX.sym("rates", n.x, method.kept)
    ratio, h = ca.MX.sym("ratio"), ca.MX.sym("h")
    loads, unwrapped = ca.MX.sym("factors", n.factors, len(method.loaded)), ca.MX.sym("unwrapped", n.unwrapped)
    factors = loads[:, len(method.loaded) - s :]
    given = [system.given(factors[:, i]) for i in range(s)]
    guess = [*guessed(system, method, q, y, turns, shifts, ratio, given), ca.repmat(lam, 1, s)]
    constants = method.constants(Begin(q, y, x, rates, unwrapped), h, loads)
    newton = repeated(method.iteration(system), polished=method.polished)
    stages, moved, multipliers, size, count = newton(*guess, *constants)
    parts = ca.horzsplit(stages, n.rotations)
    there = ca.horzcat(*[system.moving(parts[i], moved[:, i], given[i], unwrapped) for i in range(s)])
    gaps = system.gaps(parts[-1], moved[:, -1], given[-1], unwrapped)
    results = [
        parts[-1],
        moved[:, -1],
        multipliers,
        ca.horzcat(*[system.turned(q, part) for part in parts]),
        moved - ca.repmat(y, 1, s),
        there,
        method.after(h, rates, there - ca.repmat(x, 1, s)),
        size,
        count,
        ca.norm_inf(ca.vertcat(0.0, system.missed(gaps, unwrapped))),
    ]
    names = ["q", "y", "lam", "turns", "shifts", "x", "rates", "ratio", "h", "factors", "unwrapped"]
    arguments = [q, y, lam, turns, shifts, x, rates, ratio, h, loads, unwrapped]
    out = [
        "q_next",
        "y_next",
        "lam_stages",
        "turns_stages",
        "shifts_stages",
        "x_stages",
        "rates_next",
        "size",
        "iterations",
        "gap",
    ]
    return ca.Function("step", arguments, results, names, out)


def guessed(
    system: StageEquations,
    method: Method,
    q: ca.MX,
    y: ca.MX,
    turns: ca.MX,
    shifts: ca.MX,
    ratio: ca.MX,
    given: Sequence[Given],
) -> list[ca.MX]:
    """Rotations and displacements at the stages of a step: those so far go on along the polynomials of the last step.

    Arguments as of :func:`step_function`; ``given`` is what is given at the stages.
    """
    n, s = system.layout, method.stages
    onward = _onward(tuple(method.places))(ratio)
    spins = ca.horzsplit(turns, n.rotations)
    first = [sum((onward[i, j] * spins[j] for j in range(1, s)), onward[i, 0] * spins[0]) for i in range(s)]
    begin = [system.with_prescribed_rotations(moved_by(system, q, first[i]), given[i]) for i in range(s)]
    return [ca.horzcat(*begin), ca.repmat(y, 1, s) + ca.mtimes(shifts, onward.T)]


def repeated(
    iteration: ca.Function, *, changing: int = 3, most: int = ITERATIONS, polished: bool = False
) -> ca.Function:
    """A function that calls another one again and again, ``(x..., constants) -> (x..., size, iterations)``.

    ``iteration`` gives the first ``changing`` of its arguments anew, and how much they have changed.  What has
    converged, or gone beyond all numbers, ends; if ``polished`` one more iteration follows.
    """
    symbols = [ca.MX.sym(iteration.name_in(i), iteration.sparsity_in(i)) for i in range(iteration.n_in())]
    x, constants = symbols[:changing], symbols[changing:]
    size, count = ca.MX.sym("size"), ca.MX.sym("count")
    arguments = [*symbols, size, count]
    last = [*iteration(*symbols)[:changing], size, count + 1] if polished else [*x, size, count]
    end = ca.Function("end", arguments, last)
    on, name = end, iteration.name()
    for level in range(most):
        *there, change = iteration(*symbols)
        going = ca.logic_and(change > LAST_CHANGE, change < LOST)
        further = ca.Function.if_else(f"further_{name}_{level}", on, end)
        found = further(going, *there, *constants, change, count + 1)
        on = ca.Function(f"repeated_{name}_{level}", arguments, list(found))
    return ca.Function(f"repeated_{name}", symbols, list(on(*symbols, 0.0, 0.0)))


LOST = 1e3
"""Change, rad or unit of length, at which Newton's method is given up."""


@functools.cache
def _onward(places: tuple[float, ...]) -> ca.Function:
    """(ratio) -> matrix that takes what stages have gained since the begin to what the next ones will since the end."""
    ratio = ca.SX.sym("ratio")
    nodes = np.array([0.0, *places])
    rows = []
    for c in places:
        at = 1.0 + ratio * c
        rows.append(
            [
                ca.SX(np.prod([1.0])) * _lagrange(nodes, j, at) - (1.0 if j == len(nodes) - 1 else 0.0)
                for j in range(1, len(nodes))
            ]
        )
    return ca.Function("onward", [ratio], [ca.vertcat(*[ca.horzcat(*row) for row in rows])])


def _lagrange(nodes: np.ndarray, j: int, at: ca.SX) -> ca.SX:
    value = ca.SX(1)
    for k, node in enumerate(nodes):
        if k != j:
            value *= (at - node) / (nodes[j] - node)
    return value
