"""Final check of answers in contact: within a stretch no load may act that an obstacle cannot balance.

On a stretch the member has the shape of its obstacle.  An obstacle can push against a force that presses a member onto
it; it can neither pull nor exert a moment.  Where a load would need that the member would lift off around it, and the
answer is refused.
"""

from __future__ import annotations

from .. import tolerances
from ..errors import SolveError, Status
from ..mechanics.fields import Fields
from .touches import Touched

__all__ = ["refuse_unbalanced"]


def refuse_unbalanced(fields: Fields) -> None:
    """Refuse an answer in contact with a tensile contact force or a contact moment within a stretch.

    Raises
    ------
    SolveError
        There is one; the message names the member and the obstacle.
    """
    for touch in fields.model.mesh.touches:
        if touch.to is None:
            continue
        lost = Touched.of(fields).opened(touch, tolerances.LOST)
        if lost is not None:
            where = f"at node {lost.node}" if lost.node else f"at {lost.at:.6g}"
            pulled = lost.pull > lost.couple / fields.model.scales.length
            what = f"pull with {lost.pull:.3g} N" if pulled else f"hold a moment of {lost.couple:.3g} N m"
            detail = f"{touch.member} lies on {touch.contact}, which would have to {what} {where} within the stretch"
            raise SolveError(Status.FAILED, f"{detail}; the member lifts off there, which was not found", fields.state)
