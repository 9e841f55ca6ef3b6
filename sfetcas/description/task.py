"""What is asked of a scene: its analysis, and known values that the answer is compared with."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, model_validator

from ..errors import SceneError
from .answers import selected
from .records import Fraction, Number, Numbers, Positive, Record, listed, number, say

__all__ = ["FINEST", "Analysis", "Expect", "Until", "checked_accuracy"]

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


MOST_POINTS = 100_000
"""Points of a path, and with them everything that is counted along one."""


def _whole(value: Any, least: int, most: int = MOST_POINTS) -> int:
    found = number(value)
    if found != int(found) or not least <= found <= most:
        raise ValueError(f"found {say(value)}, accepted: a whole number from {least} to {most}")
    return int(found)


Points = Annotated[int, BeforeValidator(lambda value: _whole(value, 2))]
Bends = Annotated[int, BeforeValidator(lambda value: _whole(value, 0))]
Count = Annotated[int, BeforeValidator(lambda value: _whole(value, 1))]
Component = Annotated[int, BeforeValidator(lambda value: _whole(value, 0, 2))]
Names = Annotated[tuple[str, ...], BeforeValidator(lambda value: listed(value, "a list of names"))]

MOST_ANSWERS = 1_000_000
"""Answers of a motion: more fill the memory of a computer."""

USUAL_MODES = 8
"""Modes that are looked for where their number is left out."""

_TYPES = {
    "accuracy_of": ("static", "dynamic"),
    "steps": ("static", "path"),
    "range": ("path",),
    "points": ("path",),
    "branches": ("path",),
    "modes": ("modes", "path"),
    "end": ("dynamic",),
    "output": ("dynamic",),
    "step": ("dynamic",),
    "integrator": ("dynamic",),
    "initial": ("dynamic",),
    "cut": ("dynamic",),
    "release": ("dynamic",),
    "until": ("dynamic",),
}
"""Types of the analysis with which a key has a meaning."""


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


class Until(Record):
    """A condition that ends a motion early: a quantity passes a value.

    Parameters
    ----------
    quantity : text
        Name of a quantity of the answer, as ``nodes.tip.position``.
    component : whole number
        Of a vector: 0, 1 or 2.
    above : number, in the unit of the quantity
        The motion ends when the quantity gets above this.
    below : number, in the unit of the quantity
        Instead: when it gets below this.
    """

    quantity: str
    component: Component | None = None
    above: Number | None = None
    below: Number | None = None

    @model_validator(mode="after")
    def _check(self) -> Until:
        if (self.above is None) == (self.below is None):
            raise SceneError("accepted: either above or below, one of them")
        return self


class Analysis(Record):
    """The analysis of a scene.

    Parameters
    ----------
    type : text
        ``static``.  ``path``: the equilibria from factor 0 on, through limit points.  ``modes``: small
        vibrations about the equilibrium of the loads at factor 1.  ``dynamic``: the motion in time.
    accuracy : 1
        Wanted error of the positions over the size of the scene, 1e-14 to 0.1; of modes that of the frequencies
        over themselves.
    accuracy_of : text
        Static and dynamic: a quantity that the accuracy refers to instead, as ``reactions.A.moment`` or
        ``members.beam.moment at 0.5``.  Errors of positions are over the size of the scene, of rotations in
        rad, all others over the quantity itself (along members over the largest there).
    steps : (n,)
        Load factors.  Each multiplies all loads, gravity and motions without a history, and gives an answer;
        histories are evaluated there.  Each is loaded from zero by itself, but with laws that have memory, with
        friction and with insertion they are a way from one to the next.  On a path each crossing of one
        of these factors is an answer, in the order in which they are met.
    unstable : text
        ``leave`` an unstable equilibrium for a stable one, or ``stay``.
    equilibria : text
        ``one``: the equilibrium to which the loads lead when they grow together from zero; or ``all`` that a
        search finds.
    range : (2,)
        Of a path, needed there: load factors between which it is followed, from 0 upwards, or downwards where
        the range ends at 0.
    points : whole number
        Of a path: it ends after so many points; by default after 1000 instead where laws have memory.
    branches : whole number
        Of a path: from so many of the first bifurcations the branches are followed too, to both sides, each for
        ``points`` points.  Their answers stand after those of the path, in the order of the bifurcations and of the
        sides 1 and -1.  Where several eigenvalues vanish at once the first shape is taken;
        :func:`~sfetcas.switch` takes others.
    modes : whole number
        How many of the lowest modes; on a path at each point.  Default: 8, on a path none.
    end : s
        Dynamic, needed there: the time up to which the motion is followed.
    output : s
        Dynamic: spacing of the answers.  Default: a hundredth of the span.
    step : s
        Dynamic: fixed time step, not with ``idas``.  Default: chosen by the accuracy.
    integrator : text
        Dynamic: ``radau-3``, ``radau-2``, ``generalised-alpha``, ``conserving``, ``stepping`` (many impacts at once in
        fixed steps) or ``idas`` (which needs rotary inertia where masses do not resist a turn).  Default: ``radau-3``.
    initial : text
        Dynamic: the motion begins ``undeformed``, or at rest in the ``equilibrium`` of loads and motions as
        their histories give them at t = 0, with factor 1 where there is none.
    cut : list of names
        Dynamic: names of loads that act in that equilibrium only.
    release : list of names
        Dynamic: names of nodes whose support holds in that equilibrium only.
    until : table
        Dynamic: a condition that ends the motion earlier.
    """

    type: Literal["static", "path", "modes", "dynamic"] = "static"
    accuracy: Annotated[Number, AfterValidator(checked_accuracy)] = 1e-4
    accuracy_of: str = ""
    steps: Numbers = (1.0,)
    unstable: Literal["leave", "stay"] = "leave"
    equilibria: Literal["one", "all"] = "one"
    range: Annotated[Numbers, AfterValidator(_range)] | None = None
    points: Points = 200
    branches: Bends = 0
    modes: Count | None = None
    end: Positive | None = None
    output: Positive | None = None
    step: Positive | None = None
    integrator: Literal["radau-3", "radau-2", "generalised-alpha", "conserving", "stepping", "idas"] | None = None
    initial: Literal["undeformed", "equilibrium"] = "undeformed"
    cut: Names = ()
    release: Names = ()
    until: Until | None = None

    @model_validator(mode="after")
    def _check(self) -> Analysis:
        if self.type == "path" and self.range is None:
            raise SceneError("the key 'range' is missing: a path is followed between two factors")
        if self.type == "path" and self.equilibria == "all":
            raise SceneError(
                "found 'all', accepted: 'one' on a path; its branches are the key 'branches'", ("equilibria",)
            )
        if self.type in ("modes", "dynamic") and self.equilibria == "all":
            raise SceneError(f"found 'all', accepted: 'one' with type {self.type!r}", ("equilibria",))
        for key, types in _TYPES.items():
            if key in self.model_fields_set and self.type not in types:
                accepted = " or ".join(map(repr, types))
                raise SceneError(f"found type {self.type!r}, accepted: type {accepted} with this key", (key,))
        if self.type == "dynamic":
            self._check_times()
        return self

    def _check_times(self) -> None:
        if self.end is None:
            raise SceneError("the key 'end' is missing: a motion is followed up to a time")
        for key in ("output", "step"):
            spacing = getattr(self, key)
            if spacing is not None and spacing > self.end:
                raise SceneError(f"found {spacing:g} s, accepted: up to the span of {self.end:g} s", (key,))
        if self.step is None and self.integrator == "stepping":
            raise SceneError("the key 'step' is missing: steps with impulses are not chosen by their error", ("step",))
        if self.step is not None and self.integrator == "idas":
            accepted = "without 'step', or another integrator"
            message = f"found {self.step:g} s with 'idas', which chooses its steps itself, accepted: {accepted}"
            raise SceneError(message, ("step",))
        if self.output is not None and self.end > MOST_ANSWERS * self.output:
            found = f"found {self.output:g} s, which gives {self.end / self.output:.3g} answers"
            raise SceneError(f"{found}, accepted: at most {MOST_ANSWERS}", ("output",))
        for key in ("cut", "release"):
            if getattr(self, key) and self.initial != "equilibrium":
                raise SceneError(f"found initial = {self.initial!r}, accepted: 'equilibrium' with this key", (key,))

    @property
    def span(self) -> tuple[float, float]:
        """The range of a path."""
        assert self.range is not None
        return self.range[0], self.range[1]

    @property
    def duration(self) -> float:
        """Span of time of dynamics, s."""
        assert self.end is not None
        return self.end

    @property
    def count_of_modes(self) -> int:
        """Number of modes asked for; zero on a path that does not ask for modes."""
        return self.modes or (USUAL_MODES if self.type == "modes" else 0)

    @property
    def moves(self) -> bool:
        """Whether masses matter: vibrations or a motion are asked for."""
        return self.type == "dynamic" or self.count_of_modes > 0


class Expect(Record):
    """An expected value of one quantity of one answer, from the literature or an independent method.

    Parameters
    ----------
    quantity : text
        Name of a quantity of the answer, as ``nodes.tip.position`` or ``nodes.tip.position.y``.  The keys from
        ``at`` on may stand behind it instead: ``members.beam.moment at 0.5``.
    value : number, list, true, false or text
        The expected value, in the unit of the quantity.
    tolerance : number
        Largest absolute difference that is accepted.  Needed for numbers that are not whole.
    why : text
        Reason for the tolerance.
    source : text
        Where the value is from.
    at : 1
        Fraction of the length of a member.
    step : number
        Load factor of the answer.  Default: the last step.
    time : s
        Dynamic: time of the answer.  Default: the end.
    equilibrium : whole number
        With several equilibria: all expectations of the same number are met by one of them.
    crossing : whole number
        Of a path: which crossing of the factor, from 1.
    limit_point : whole number
        Of a path: which limit point, from 1.
    bifurcation : whole number
        Of a path: which bifurcation, from 1.
    flutter_point : whole number
        Of a path: which flutter point, from 1.
    transition : whole number
        Of a path: which transition, where tendons go slack or become taut, stops are reached or left, and members
        touch, leave, stick or slide, from 1.
    """

    quantity: str
    value: Annotated[Any, BeforeValidator(_expected)]
    tolerance: Annotated[Number, AfterValidator(_tolerance)] | None = None
    why: str = ""
    source: str = ""
    at: Fraction | None = None
    step: Number | None = None
    time: Number | None = None
    equilibrium: Count | None = None
    crossing: Count | None = None
    limit_point: Count | None = None
    bifurcation: Count | None = None
    flutter_point: Count | None = None
    transition: Count | None = None

    @model_validator(mode="before")
    @classmethod
    def _selected(cls, values: Any) -> Any:
        """Keys that stand behind the name of the quantity."""
        if not isinstance(values, dict) or not isinstance(values.get("quantity"), str):
            return values
        name, found = selected(values["quantity"].strip())
        twice = [key for key in found if values.get(key) is not None]
        if twice:
            raise SceneError(f"found {twice[0]!r} behind the name and as a key, accepted: one of them", ("quantity",))
        return {**values, **found, "quantity": name}

    @model_validator(mode="after")
    def _check(self) -> Expect:
        if self.crossing is not None and self.step is None:
            raise SceneError("the key 'step' is missing: a crossing is one of a factor", ("crossing",))
        places = ("step", "time", "limit_point", "bifurcation", "flutter_point", "transition")
        if sum(getattr(self, key) is not None for key in places) > 1:
            raise SceneError(f"accepted: one of the keys {', '.join(places)}")
        if self.tolerance is None and isinstance(self.value, (float, tuple)):
            raise SceneError(
                "the key 'tolerance' is missing: only true, false, whole numbers and texts are met exactly"
            )
        return self
