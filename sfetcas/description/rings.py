"""Rings: nodes that stay on the centre line of a member and slide along it."""

from __future__ import annotations

from typing import Any, final

import numpy as np
from pydantic import model_validator

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array, values_of
from .records import Fraction, Number, Record
from .shapes import CenterLine
from .structure import Member, Node

__all__ = ["Ring", "begins_at", "check_ring"]


@final
class Ring(Record):
    """A ring at a node through which a member goes; it slides along the member without friction.

    It holds the centre line in both directions across the member, and neither holds nor turns the section.  The node
    may be an end of other members, may be held by the ground, or may hang on the ring alone.  Where the ring is on the
    member is an unknown of the equilibrium.

    Parameters
    ----------
    node : name
        The node that slides along the member.
    member : name
        The flexible or rigid member that goes through the ring.
    at : fraction of the length
        Where the ring is in the undeformed scene; the node is there.  Default: the place of the member that is nearest
        to the node.
    travel : m
        Arc length by which the ring is moved along the member at factor 1, towards its second node.  Default: nothing
        moves it, and it slides freely.
    history : name
        Name of a history that replaces the load factor of the step.  It multiplies the ``travel``.

    Examples
    --------
    >>> Ring(node="eyelet", member="wire", at=0.5).driven
    False
    """

    node: str
    member: str
    at: Fraction | None = None
    travel: Number | None = None
    history: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Ring:
        if self.history is not None and self.travel is None:
            message = "found without a travel, accepted: with the key 'travel', which it multiplies"
            raise SceneError(message, ("history",))
        return self

    @property
    def driven(self) -> bool:
        """Whether it is moved along the member."""
        return self.travel is not None


def begins_at(ring: Ring, node: Node, line: CenterLine) -> float:
    """Fraction of the length at which a ring is in the undeformed scene: ``at``, or where the line is nearest."""
    from scipy.optimize import minimize_scalar

    if ring.at is not None:
        return ring.at
    place = values_of(np.asarray(node.position, dtype=object)).astype(float)

    def apart(x: Any) -> Array:
        return np.asarray(np.linalg.norm(line.positions(np.atleast_1d(x)) - place, axis=1))

    x = np.linspace(0.0, 1.0, SAMPLES + 1)
    best = int(np.argmin(apart(x)))
    span = x[max(best - 1, 0)], x[min(best + 1, SAMPLES)]
    fine = {"bounds": span, "method": "bounded", "options": {"xatol": 1e-14}}
    found = minimize_scalar(lambda at: float(apart(at)[0]) ** 2, **fine)
    return min((float(x[best]), *map(float, span), float(found.x)), key=lambda at: float(apart(at)[0]))


SAMPLES = 256
"""Intervals of a member among whose ends the nearest place is looked for first."""


def check_ring(ring: Ring, node: Node, member: Member, line: CenterLine, at: float) -> None:
    """Refuse a ring that is not on its member, or on one that cannot go through it.

    Raises
    ------
    SceneError
        Names the key.
    """
    if member.type == "small":
        message = f"found the small member {ring.member!r}, accepted: a flexible or rigid one, which goes through"
        raise SceneError(message, ("member",))
    apart = float(np.linalg.norm(line.positions(np.array([at]))[0] - np.asarray(node.position, dtype=float)))
    if apart > tolerances.PARALLEL * line.length:
        where = f"at the fraction {at:.6g} of member {ring.member!r}"
        found = f"found the node {ring.node!r}, {apart:.3g} m away from the place {where}"
        raise SceneError(f"{found}, accepted: a node on the undeformed line of the member", ("node",))
    if ring.node in member.nodes and at == float(member.nodes.index(ring.node) > 0):
        message = f"found an end of member {ring.member!r}, accepted: a node that is not already there"
        raise SceneError(message, ("node",))
