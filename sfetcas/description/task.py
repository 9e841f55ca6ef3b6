"""What is asked of a scene: its analysis, and the values that the answer is compared with."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, model_validator

from ..errors import SceneError
from .later import Staged
from .records import Fraction, Number, Numbers, number, say

__all__ = ["Analysis", "Expect", "checked_accuracy"]

FINEST = 1e-14
"""Accuracy that can be asked for: rounding leaves 4e-16 to 5e-15 of the size between one mesh and the next."""


def checked_accuracy(value: float) -> float:
    """An accuracy that can be reached.

    Raises
    ------
    ValueError
        It is below what rounding leaves, or coarse beyond use.
    """
    if not FINEST <= value <= 0.1:
        raise ValueError(f"found {value:g}, accepted: from {FINEST:g}, what rounding leaves, to 0.1")
    return value


def _tolerance(value: float) -> float:
    if value < 0.0:
        raise ValueError(f"found {value:g}, accepted: zero or a number above zero")
    return value


def _whole(value: Any, least: int) -> int:
    found = number(value)
    if found != int(found) or not least <= found <= MOST_POINTS:
        raise ValueError(f"found {say(value)}, accepted: a whole number from {least} to {MOST_POINTS}")
    return int(found)


MOST_POINTS = 100_000
"""Points of a path, and with them everything that is counted along one."""

Points = Annotated[int, BeforeValidator(lambda value: _whole(value, 2))]
Bends = Annotated[int, BeforeValidator(lambda value: _whole(value, 0))]
Count = Annotated[int, BeforeValidator(lambda value: _whole(value, 1))]


def _range(value: tuple[float, ...]) -> tuple[float, float]:
    if len(value) != 2 or not value[0] <= 0.0 <= value[1] or value[0] == value[1]:
        raise ValueError(f"found {say(value)}, accepted: two rising numbers with zero between them or at one end")
    return value[0], value[1]


def _expected(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (list, tuple)) and value:
        return tuple(_expected(entry) for entry in value)
    if not isinstance(value, (bool, str)):
        number(value)
    return value


class Analysis(Staged):
    """What is asked for.

    Parameters
    ----------
    type : static, or path: the equilibria from factor 0 on, through limit points
    accuracy : wanted error of the positions relative to the size of the scene, 1e-14 to 0.1
    steps : (n,) - factors of the loads, gravity and motions that have no history, each an answer of its own
    unstable : leave an unstable equilibrium for a stable one, or stay there
    equilibria : one, to which the loads lead when they grow together from zero, or all that a search finds
    range : (2,) - path: the factors between which it is followed, downwards where the range ends at 0
    points : path: it ends after so many points
    branches : path: from the first so many bifurcation points the branches that cross there are followed too, to
        both sides, each for so many points; their answers stand after those of the path, in the order of the
        bifurcations and of the sides 1 and -1.  0, the default, stays on the path.  Where several eigenvalues
        vanish at once the first shape is taken; ``switch`` takes others

    On a path each crossing of a factor of ``steps`` is an answer, in the order in which they are met.
    """

    type: Literal["static", "path"] = "static"
    accuracy: Annotated[Number, AfterValidator(checked_accuracy)] = 1e-4
    steps: Numbers = (1.0,)
    unstable: Literal["leave", "stay"] = "leave"
    equilibria: Literal["one", "all"] = "one"
    range: Annotated[Numbers, AfterValidator(_range)] | None = None
    points: Points = 200
    branches: Bends = 0

    @model_validator(mode="after")
    def _check(self) -> Analysis:
        if self.type == "path" and self.range is None:
            raise SceneError("the key 'range' is missing: a path is followed between two factors")
        if self.type == "path" and self.equilibria == "all":
            raise SceneError(
                "found 'all', accepted: 'one' on a path; its branches are the key 'branches'", ("equilibria",)
            )
        if self.type != "path":
            for key in ("range", "points", "branches"):
                if key in self.model_fields_set:
                    raise SceneError(f"found type {self.type!r}, accepted: type 'path' with this key", (key,))
        return self

    @property
    def span(self) -> tuple[float, float]:
        """The range of a path."""
        assert self.range is not None
        return self.range[0], self.range[1]


class Expect(Staged):
    """What the literature or an independent method says about one quantity of one answer.

    Parameters
    ----------
    quantity : place in the answer, as ``nodes.B.position``
    value : number, nested list of numbers, true, false or a text, in the unit of the quantity
    tolerance : largest accepted absolute difference; may be left out for what is met exactly
    why : reason for the tolerance
    source : where the value is from
    at : fraction of the length of a member
    step : factor of the answer; left out: the last step
    equilibrium : expects of the same number are met by one of several equilibria, which one is free
    crossing : path: which crossing of that factor, 1 is the first
    limit_point, bifurcation : path: which limit or bifurcation point
    """

    quantity: str
    value: Annotated[Any, BeforeValidator(_expected)]
    tolerance: Annotated[Number, AfterValidator(_tolerance)] | None = None
    why: str = ""
    source: str = ""
    at: Fraction | None = None
    step: Number | None = None
    equilibrium: Count | None = None
    crossing: Count | None = None
    limit_point: Count | None = None
    bifurcation: Count | None = None

    @model_validator(mode="after")
    def _check(self) -> Expect:
        if self.crossing is not None and self.step is None:
            raise SceneError("the key 'step' is missing: a crossing is one of a factor", ("crossing",))
        if sum(key is not None for key in (self.step, self.limit_point, self.bifurcation)) > 1:
            raise SceneError("accepted: one of the keys step, limit_point, bifurcation")
        if self.tolerance is None and isinstance(self.value, (float, tuple)):
            raise SceneError(
                "the key 'tolerance' is missing: only true, false, whole numbers and texts are met exactly"
            )
        return self
