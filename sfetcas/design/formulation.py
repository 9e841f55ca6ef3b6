"""Statement of a design problem: unknowns, numbers of the scene in each case, answers, constraints, objective."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.records import unknown as not_known
from ..description.scene import Scene
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mathematics.statements import Bounds, Problem, Statement, bounds_of
from ..mechanics.mesh import first_mesh
from ..mechanics.model import assemble
from ..parametric.arguments import Argument, Parameter, argument, single_numbers, with_values
from ..parametric.equilibrium import refuse_search
from ..parametric.results import Results

__all__ = ["Asked", "Cases", "Formulation", "Setting", "labelled"]

EVENLY = tuple(np.linspace(0.0, 1.0, 21).tolist())
"""Where members are told of without a word about it: not where elements end, which may change on the way."""


@dataclass(frozen=True, eq=False)
class Setting:
    """The setting of a number of the scene in one case.

    Attributes
    ----------
    value : float or MX
        A number, or an expression (1,) of unknowns.
    between : tuple of float or None
        Bounds of its value.
    """

    value: float | ca.MX
    between: Bounds | None = None


@dataclass(frozen=True, eq=False)
class Asked:
    """An answer that expressions may contain.

    Attributes
    ----------
    name : str
        ``nodes.tip.position``.
    member : str
        The member along which it is; empty for others.
    label : str
        Name of constraints on it, with the case.
    at : tuple of float
        Fractions of the length of a member.
    cases : tuple of int
    symbol : MX
    shape : tuple of int
        Shape of the symbol; the numbers of each case are consecutive.
    unit : str
    """

    name: str
    member: str
    label: str
    at: tuple[float, ...]
    cases: tuple[int, ...]
    symbol: ca.MX
    shape: tuple[int, ...]
    unit: str


def labelled(case: str, name: str) -> str:
    """The label of a quantity in a case, ``case: name``; in a problem with a single case just its name."""
    return f"{case}: {name}" if case else name


class Formulation(Statement):
    """The statement of a problem, which :class:`~sfetcas.design.solving.Solving` solves.

    Parameters
    ----------
    scene : Scene
        Static; all cases are this scene with other numbers.
    cases : sequence of str
    accuracy : float, optional
        Wanted error of positions over the size of the scene; that of the scene without.

    Attributes
    ----------
    settings : list of dict
        Of each case, by the names of single numbers.
    """

    def __init__(self, scene: Scene, cases: Sequence[str], accuracy: float | None = None) -> None:
        refuse_search(scene, "no part of a design", touching=True)
        if scene.analysis.type != "static":
            message = f"found {scene.analysis.type!r}, accepted: static, an equilibrium for each case"
            raise SceneError(message, ("analysis", "type"))
        if not cases:
            raise SceneError("found no case, accepted: one or more", ("cases",))
        for name, field in scene.fields.items():
            if field.table is not None and scene.magnets:
                message = "found a table, with which no design knows where it ends, accepted: another type of field"
                raise SceneError(message, ("fields", name))
        steps = (float(scene.analysis.steps[-1]),)
        analysis = scene.analysis.model_copy(update={"steps": steps, "equilibria": "one"})
        self.scene = scene.model_copy(update={"analysis": analysis, "expect": ()})
        self.cases, self.accuracy = list(cases), accuracy or scene.analysis.accuracy
        super().__init__()
        self.settings: list[dict[str, Setting]] = [{} for _ in self.cases]
        self.asked: dict[Any, Asked] = {}
        self.tied: dict[str, Argument] = {}
        self.margin: float | None = None
        self._results: Results | None = None

    # -- unknowns -----------------------------------------------------------------------------------

    def numbers(self, name: str) -> Argument:
        """A number or vector of the scene by its name.

        Raises
        ------
        SceneError
            The scene has none of this name.
        """
        if name in self.tied:
            return self.tied[name]
        found = argument(self.scene, name)
        if name.startswith("histories.") and name.count(".") == 1:
            raise SceneError(f"found {name!r}, accepted: numbers of it, as {name}.value.0", ("variables",))
        return found

    def bounds(self, label: str, name: str, given: Bounds | Parameter, guess: ArrayLike | None) -> Bounds:
        """Lower and upper bound of a variable; registers a :class:`~sfetcas.Parameter`.

        Raises
        ------
        SceneError
            The bounds are not two numbers.
        """
        if isinstance(given, Parameter):
            if given.low is None or given.high is None:
                raise SceneError("found no bounds, accepted: a lower and an upper bound, low and high", (label,))
            bounds = bounds_of(label, (given.low, given.high))
            self.tie(name, given, given.value if guess is None else float(np.asarray(guess)), bounds)
            return bounds
        return bounds_of(label, given)

    def tie(self, name: str, tied: Parameter, guess: float, bounds: Bounds) -> None:
        """Register a :class:`~sfetcas.Parameter`, a name on which several numbers of the scene depend.

        Raises
        ------
        SceneError
            A name that is in use, or numbers that the scene does not have.
        """
        known = {n.partition(".")[0] for n in ("factor", "histories.x", *type(self.scene).model_fields)}
        if name.partition(".")[0] in known or name in self.tied:
            raise SceneError(f"found {name!r}, accepted: a name that is none of the scene", ("variables",))

        single_numbers(self.scene, tied.numbers(guess))
        self.tied[name] = Argument(name, (guess,), tied.unit, tied.meaning, *bounds, None, tied.numbers)

    def set(
        self, name: str, value: ArrayLike | ca.MX, *, case: str | None = None, between: Bounds | None = None
    ) -> None:
        """Set a number of the scene, in one case or in all, to a value or an expression of unknowns, in its unit.

        ``design.set("sections.strip.EI3", E * b * thickness**3 / 12)``.

        Parameters
        ----------
        name : as in the scene; the value of a vector has as many entries
        case : name of a case; by default all cases
        between : bounds of each entry

        Raises
        ------
        SceneError
            The scene has no such number, or there are more or fewer values.
        """
        names = self.numbers(name).names
        values = self._values(name, len(names), value)
        for i in range(len(self.cases)) if case is None else [self.number(case)]:
            for one, number in zip(names, values, strict=True):
                self.settings[i][one] = Setting(number, between)

    def _values(self, name: str, count: int, value: ArrayLike | ca.MX) -> list[float | ca.MX]:
        if isinstance(value, ca.MX):
            found: list[float | ca.MX] = list(ca.vertsplit(ca.vec(value)))
        else:
            found = np.asarray(value, dtype=float).ravel().tolist()
        if len(found) != count:
            accepted = "one number" if count == 1 else f"{count} numbers"
            raise SceneError(f"found {len(found)} numbers, accepted: {accepted}", (name,))
        return found

    def number(self, case: str) -> int:
        """The number of a case.

        Raises
        ------
        SceneError
            There is none of this name.
        """
        if case not in self.cases:
            raise SceneError(not_known(case, self.cases, "cases"), ("cases",))
        return self.cases.index(case)

    # -- answers ------------------------------------------------------------------------------------

    def ask(
        self, name: str, cases: Sequence[int], label: str, at: Sequence[float] | None, *, rows: bool = False
    ) -> ca.MX:
        """The symbol of an answer in some cases, with a row for each case if ``rows``; SceneError for wrong places."""
        key = (name, tuple(cases), None if at is None else tuple(at), rows)
        if key not in self.asked:
            places = EVENLY if at is None else tuple(float(x) for x in at)
            if not places or not all(0.0 <= x <= 1.0 for x in places):
                raise SceneError(f"found {list(places)}, accepted: fractions of the length, 0 to 1", ("at", name))
            result = self.result(name, places)
            shape = (len(cases), result.size) if rows else result.shape or (1,)
            symbol = self.known(ca.MX.sym(label, *shape))
            self.asked[key] = Asked(name, result.member, label, places, tuple(cases), symbol, shape, result.unit)
        return self.asked[key].symbol

    def result(self, name: str, places: Sequence[float]) -> Any:
        """Shape, unit and meaning of an answer."""
        if self._results is None:
            self._results = Results(assemble(self.scene, first_mesh(self.scene, 4)), [], {})
        members = [n for n, record in self.scene.members.items() if record.type == "flexible"]
        return Results(self._results.model, [name], dict.fromkeys(members, tuple(places))).results[0]

    def stable(self, margin: float = 0.0) -> None:
        """Require stability: in each case the lowest eigenvalue (``certificate.smallest``, N) is at least the margin.

        SceneError for a negative margin.
        """
        if not margin >= 0.0:
            raise SceneError(f"found {margin}, accepted: zero or more", ("stable",))
        self.margin = float(margin)

    # -- what follows ---------------------------------------------------------------------------------

    def value(self, expression: ca.MX, values: Mapping[str, Array]) -> Array:
        """The value (n,) of an expression of unknowns, column by column; SceneError if it has other symbols."""
        symbols = ca.symvar(expression)
        by_hash = {one.symbol.__hash__(): one.name for one in self.free.values()}
        for symbol in symbols:
            if symbol.__hash__() not in by_hash:
                accepted = "an expression of unknowns"
                raise SceneError(f"found {symbol.name()!r} in what a number is set to, accepted: {accepted}")
        function = ca.Function("value", symbols, [ca.densify(ca.vec(expression))])
        return np.array(function(*(values[by_hash[s.__hash__()]] for s in symbols))).ravel()

    def numbers_of(self, case: int, values: Mapping[str, Array]) -> dict[str, float]:
        """The numbers of the scene that are set in a case, by name and in their units, for values of the unknowns."""
        return {
            name: float(self.value(one.value, values)[0]) if isinstance(one.value, ca.MX) else one.value
            for name, one in self.settings[case].items()
        }

    def case_scene(self, case: int, values: Mapping[str, Array]) -> Scene:
        """The scene of a case for values of the unknowns, in their units."""
        return self.scene_with(self.numbers_of(case, values))

    def scene_with(self, numbers: Mapping[str, float]) -> Scene:
        """The scene with other values of numbers and of parameters."""
        found: dict[str, float] = {}
        for name, value in numbers.items():
            follow = self.tied[name].numbers if name in self.tied else None
            found |= {name: value} if follow is None else single_numbers(self.scene, follow(value))
        return with_values(self.scene, found)

    @property
    def guesses(self) -> dict[str, Array]:
        """Start values of all unknowns, by name, in their units."""
        return {name: one.guess for name, one in self.free.items()}

    def varying(self) -> tuple[list[Argument], list[bool]]:
        """Single numbers that differ between cases or are unknown, with ranges; and for each whether it is unknown."""
        names = dict.fromkeys(name for setting in self.settings for name in setting)
        chosen: list[Argument] = []
        unknown: list[bool] = []
        for name in names:
            settings = [setting.get(name) for setting in self.settings]
            unknown.append(any(one is not None and isinstance(one.value, ca.MX) for one in settings))
            chosen.append(self._argument(name, settings))
        return chosen, unknown

    def _argument(self, name: str, settings: Sequence[Setting | None]) -> Argument:
        found = self.numbers(name)
        if re.fullmatch(r"factor|histories\.[^.]+", name):
            return found
        between = [one.between for one in settings if one is not None and one.between is not None]
        values = [one.value for one in settings if one is not None and not isinstance(one.value, ca.MX)]
        reach = [x for pair in between for x in pair if np.isfinite(x)]
        if len(reach) < 2 * len(between) or not (between or values):
            return found
        reach += [*values, *found.default]
        low, high = min(reach), max(reach)
        return replace(found, low=low, high=high) if low < high else found


class Cases(Problem):
    """Base class of problems over several cases.

    Attributes
    ----------
    statement : Formulation
    """

    statement: Formulation

    def unknown(self, name: str, guess: ArrayLike, low: ArrayLike = -np.inf, high: ArrayLike = np.inf) -> ca.MX:
        """Add unknowns with a name of their own; ``set`` makes numbers of the scene depend on them.

        Parameters
        ----------
        guess : number, (n,) or (n, m): start values, and the shape
        low, high : broadcast to it

        Raises
        ------
        SceneError
            A name that is there already, bounds that contradict each other, or a guess outside.
        """
        return self.statement.unknown(name, guess, low, high)

    def stable(self, margin: float = 0.0) -> None:
        """Require stability: in each case the lowest eigenvalue (``certificate.smallest``, N) is at least a margin."""
        self.statement.stable(margin)

    def _free(self, label: str) -> ca.MX:
        """An unknown by its name.

        Raises
        ------
        SceneError
            There is none of this name.
        """
        if label not in self.statement.free:
            raise SceneError(not_known(label, list(self.statement.free), "unknowns"), ("variable",))
        return self.statement.free[label].symbol
