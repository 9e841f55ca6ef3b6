"""Which strings pull and which stops push, found by switching them in one model, in process and in generated C alike.

See :mod:`~sfetcas.mechanics.switches`: what acts is said by numbers of what is given, and a state has multiplier and
opening of each constraint, so that one active-set method takes the steps of statics
(:mod:`~sfetcas.equilibria.stops`): after each equilibrium the worst constraint is switched, until none is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import SolveError, Status
from ..mathematics.arrays import Array, Index
from ..mechanics.segments import switch_of
from ..mechanics.unilateral import Stops, Unilateral, unilaterals, worst_of
from ..solvers.program import Program

__all__ = ["BEYOND", "Switches"]

BEYOND = 1e-9
"""How much below zero a margin may be, dimensionless: more than rounding leaves of what is zero."""

STRICT = 1e-7
"""Margins, dimensionless, that are as small leave it to a change of a number to which side of a change it leads."""

ROUNDS = 4
"""Choices at most, over the number of constraints and one more: each is usually switched once."""


@dataclass(frozen=True, eq=False)
class Switches:
    """The unilateral constraints of a model that switches them.

    Attributes
    ----------
    constraints : tuple of Unilateral
    flags : ndarray (n,)
        Where in what is given to the program it stands whether each is active.
    multipliers, openings : ndarray (n,)
        Where in a flat state these are.
    default : ndarray (n,)
        1 for what is active in the answer of statics, else 0.
    """

    constraints: tuple[Unilateral, ...]
    flags: Index
    multipliers: Index
    openings: Index
    default: Array

    @classmethod
    def of(cls, program: Program, stops: Stops) -> Switches:
        """Those of a program whose model has switches; active by default is what is so in a choice."""
        model, found = program.model, unilaterals(program.model.scene)
        switches = [switch_of(one.table, one.name, one.side) for one in found]
        numbers = {group.rows: i for i, group in enumerate(model.connections) if group.kind.switches}
        ((rows, number),) = numbers.items()
        parts = list(program.sizes)
        first = sum(program.sizes[part] for part in parts[: parts.index(f"data_{number}")])
        q, y, *_ = (part.numel() for part in program.parts)
        places = [model.positions.retained[model.segments.place(name), 0] for name in switches]
        return cls(
            found,
            first + np.array([rows.index(name) for name in switches], dtype=np.intp),
            q + y + np.array([model.row_names.index(one.row) for one in found], dtype=np.intp),
            q + np.array(places, dtype=np.intp),
            np.array([one.active(stops) for one in found], dtype=float),
        )

    def __len__(self) -> int:
        return len(self.constraints)

    @property
    def signs(self) -> Array:
        """Of each (n,) the sign of its multiplier while it acts, and of minus its opening while it does not."""
        return np.array([one.sign for one in self.constraints])

    @property
    def strings(self) -> Array:
        """Which (n,) are strings, of bool."""
        return np.array([one.table == "tendons" for one in self.constraints], dtype=bool)

    @property
    def most(self) -> int:
        """How many choices are tried at most."""
        return ROUNDS * (len(self) + 1)

    @property
    def beginnings(self) -> tuple[Array, ...]:
        """Choices (n,) to begin with anew where one has no equilibrium: as in statics, all strings and no stop; and
        nothing, as a structure may not meet more constraints.
        """
        return self.strings.astype(float), np.zeros(len(self))

    def acting(self, state: Array) -> Array:
        """What acts at an equilibrium (states,), as numbers (n,): what has a force and no opening."""
        return (np.abs(state[self.multipliers]) > np.abs(state[self.openings])).astype(float)

    def margins(self, state: Array, acting: Array) -> Array:
        """The margins (n,) at an equilibrium (states,), dimensionless, with what acts (n,)."""
        return np.where(acting != 0.0, state[self.multipliers], -state[self.openings]) * self.signs

    def stops(self, state: Array) -> Stops:
        """What acts at an equilibrium (states,) as the choice of a mesh."""
        pairs = zip(self.constraints, self.acting(state).tolist(), strict=True)
        return tuple(sorted(one.entry for one, now in pairs if bool(now) != (one.side == "slack")))

    def refuse_doubt(self, state: Array) -> None:
        """Refuse derivatives at an equilibrium (states,) where they differ to the sides of a change.

        Raises
        ------
        SolveError
            A constraint has no margin; names it.
        """
        margins = self.margins(state, self.acting(state))
        for one, margin in zip(self.constraints, margins.tolist(), strict=True):
            if margin <= STRICT:
                detail = f"{one.becomes(self.stops(state))} there, and derivatives differ to either side"
                raise SolveError(Status.KINK, detail)

    def expression(self, given: ca.MX, state: ca.MX) -> ca.MX:
        """What is given, as a symbol, with what acts at an equilibrium."""
        found, multiplier, opening = ca.MX(given), self.multipliers.tolist(), self.openings.tolist()
        found[self.flags.tolist()] = ca.fabs(state[multiplier]) > ca.fabs(state[opening])
        return found

    def exact(self, state: Array, acting: Array) -> Array:
        """An equilibrium (states,) of a choice with zeros, not with what rounding leaves of them."""
        state = state.copy()
        state[np.where(acting != 0.0, self.openings, self.multipliers)] = 0.0
        return state

    def given(self, given: Array, acting: Array) -> Array:
        """What is given, with what acts (n,)."""
        given = given.copy()
        given[self.flags] = acting
        return given

    def switched(self, state: Array, acting: Array) -> Array | None:
        """What acts in the next choice, after an equilibrium (states,) of one; None where that one holds."""
        active = acting != 0.0
        worst = worst_of(self.margins(state, acting), active, self.strings, BEYOND)
        if worst is None:
            return None
        found = acting.copy()
        found[worst] = 1.0 - found[worst]
        return found
