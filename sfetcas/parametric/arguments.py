"""Numbers of a scene as arguments, and what is given to the equations as a function of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description import records
from ..description.records import Record, plain, unknown
from ..description.scene import History, Scene
from ..description.shapes import end_of
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations
from ..mechanics.expressions import LOADS, Expressions
from ..mechanics.model import Model, assemble
from ..solvers.program import Program, data_of, is_data
from .dependence import Dependence, Number, found

__all__ = [
    "FACTOR",
    "Argument",
    "Arguments",
    "Asked",
    "Parameter",
    "argument",
    "asked_for",
    "default_arguments",
    "single_numbers",
    "with_numbers",
]

FACTOR = "factor"
"""The argument that multiplies all loads and motions without a history."""


@dataclass(frozen=True)
class Parameter:
    """A number of one's own that several numbers of a scene follow: a length, the place of a joint on a line.

    ``Parameter(1.0, lambda x: {"nodes.B.position": [x, 0], "nodes.C.position": [2 * x, 0]}, low=0.8, high=1.2)``

    Attributes
    ----------
    value : float
        That of the scene as it stands.
    numbers : callable
        Numbers of the scene for a value, by their names; smooth.
    low, high : float or None
        Its range, where it needs one.
    unit, meaning : str
    """

    value: float
    numbers: Callable[[float], Mapping[str, ArrayLike]]
    low: float | None = None
    high: float | None = None
    unit: str = ""
    meaning: str = "a number that others follow"


@dataclass(frozen=True)
class Argument:
    """One argument: a number or a vector of the scene.

    Attributes
    ----------
    name : str
        As in the scene: ``loads.tip.value``.
    default : tuple of float
    unit, meaning : str
    low, high : float or None
        The range of each number, where it needs one.
    components : tuple of int or None
        Which numbers of a list these are; None of a single number.
    numbers : callable or None
        Numbers of the scene for its value, of a :class:`Parameter`.
    """

    name: str
    default: tuple[float, ...]
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    components: tuple[int, ...] | None = None
    numbers: Callable[[float], Mapping[str, ArrayLike]] | None = None

    @property
    def limits(self) -> tuple[float, float]:
        """Least and largest value that is accepted: its range, and of sections what is positive."""
        if self.low is not None and self.high is not None:
            return self.low, self.high
        if self.name.startswith("sections.") and ".polynomial" not in self.name:
            return float(np.nextafter(0.0, 1.0)), np.inf
        return (0.0 if self.name.endswith(".stiffness") else -np.inf), np.inf

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each number."""
        if self.components is None:
            return (self.name,)
        return tuple(f"{self.name}.{i}" for i in self.components)


Asked = Sequence[str] | Mapping[str, tuple[float, float] | Parameter | None] | None
"""Names of numbers, or these with their ranges, and names of one's own with what they are; None for the usual ones."""


def asked_for(scene: Scene, asked: Asked) -> list[Argument]:
    """The arguments that are asked for."""
    chosen = asked if asked is not None else default_arguments(scene)
    spans = chosen if isinstance(chosen, Mapping) else dict.fromkeys(chosen)
    for name, span in spans.items():
        _check_asked(name, span)
        if re.fullmatch(r"loads\.[^.]+\.at|members\.[^.]+\.elements", name):
            message = "found a number that changes the elements, and with them the unknowns"
            raise SceneError(f"{message}, accepted: one that leaves them as they are", ("arguments", name))
    return [
        _own(scene, name, span) if isinstance(span, Parameter) else argument(scene, name, span)
        for name, span in spans.items()
    ]


def _check_asked(name: Any, span: Any) -> None:
    """Refuse what is no name, or no range."""
    if not isinstance(name, str):
        raise SceneError(f"found {name!r}, accepted: names of numbers of the scene", ("arguments",))
    if span is None or isinstance(span, Parameter):
        return
    accepted = "a range from low to high"
    try:
        ends = [records.number(end) for end in records.listed(span, accepted)]
    except ValueError:
        ends = []
    if len(ends) != 2:
        raise SceneError(f"found {span!r}, accepted: {accepted}", ("arguments", name))


def _own(scene: Scene, name: str, given: Parameter) -> Argument:
    """The argument of a parameter of one's own."""
    if "." in name or name == FACTOR:
        raise SceneError(f"found {name!r} for a parameter of one's own, accepted: a name without dots", ("arguments",))
    if given.low is not None and given.high is not None and not given.low <= given.value <= given.high:
        message = f"found {given.value:g}, accepted: a value from {given.low:g} to {given.high:g}"
        raise SceneError(message, ("arguments", name))
    for number, value in single_numbers(scene, given.numbers(given.value)).items():
        (stands,) = argument(scene, number).default
        if abs(value - stands) > SAME * max(abs(value), abs(stands)):
            found = f"{number} is {stands:g} in the scene, but {value:g} where the parameter is {given.value:g}"
            accepted = "both the same: change that number of the scene, or the value of the parameter"
            raise SceneError(f"{found}, accepted: {accepted}", ("arguments", name))
    unit, meaning = given.unit or "as its numbers", given.meaning
    return Argument(name, (float(given.value),), unit, meaning, given.low, given.high, None, given.numbers)


SAME = 1e-9
"""Share by which numbers of a parameter may differ from those of the scene."""


def single_numbers(scene: Scene, values: Mapping[str, ArrayLike]) -> dict[str, float]:
    """Values of numbers and of lists of numbers, number by number.

    Raises
    ------
    SceneError
        The scene has no such number, or a list of another length.
    """
    if not isinstance(values, Mapping):
        raise SceneError(f"found {values!r}, accepted: values of numbers of the scene by their names", ("arguments",))
    single: dict[str, float] = {}
    for name, value in values.items():
        known = argument(scene, name)
        given = np.asarray(value, dtype=float).ravel()
        if len(given) != len(known.default) or not np.isfinite(given).all():
            count = len(known.default)
            accepted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise SceneError(f"{name}: found {value!r}, accepted: {accepted}")
        single |= dict(zip(known.names, given.tolist(), strict=True))
    return single


def default_arguments(scene: Scene) -> list[str]:
    """The factor where it multiplies anything, those of histories, all loads, and what all motions prescribe."""
    free = [one for table in (scene.loads, scene.motions) for one in table.values() if one.history is None]
    names = [FACTOR] if free or scene.gravity is not None else []
    names += [f"histories.{name}" for name in scene.histories]
    names += [f"loads.{name}.value" for name in scene.loads]
    for name, motion in scene.motions.items():
        keys = ("displacement", "rotation")
        names += [f"motions.{name}.{key}" for key in keys if getattr(motion, key) is not None]
    return names


def argument(scene: Scene, name: str, span: tuple[float, float] | None = None) -> Argument:
    """The argument of a name.

    Raises
    ------
    SceneError
        The scene has no such number.
    """
    low, high = span if span is not None else (None, None)
    if low is not None and high is not None and not low < high:
        raise SceneError(f"found {low:g} to {high:g}, accepted: a range from low to high", ("arguments", name))
    found = _argument(scene, name, low, high)
    outside = [x for x in found.default if not found.limits[0] <= x <= found.limits[1]]
    if outside:
        message = f"found {outside[0]:g} in the scene, accepted: a range from low to high that has it"
        raise SceneError(message, ("arguments", name))
    return found


def _argument(scene: Scene, name: str, low: float | None, high: float | None) -> Argument:
    path = name.split(".")
    if name == FACTOR:
        default = float(scene.analysis.steps[-1])
        return Argument(name, (default,), "1", "factor of all loads and motions without a history", low, high)
    if path[0] == "histories" and len(path) == 2 and path[1] in scene.histories:
        # Of a motion what it begins with.
        when = 0.0 if scene.analysis.type == "dynamic" else float(scene.analysis.steps[-1])
        default = scene.histories[path[1]].factor(when)
        return Argument(name, (default,), "1", f"factor of what has the history {path[1]}", low, high)
    value = _value(scene, path, name)
    if isinstance(value, (list, tuple)):
        count = len(value)
        # Values along a member or over time are no vector, even where they are three.
        vector = path[-1] in VECTORS and (path[-1] != "value" or (path[0] == "loads" and len(path) == 3))
        if scene.resolved_dimension == "plane" and count == 3 and vector:
            # What is out of the plane is no number of a plane scene; moments and rotations are about z.
            about = path[-1] == "rotation" or (path[0] == "loads" and scene.loads[path[1]].type == "moment")
            chosen = [2] if about else [0, 1]
        else:
            chosen = list(range(count))
        values = tuple(float(value[i]) for i in chosen)
        return Argument(name, values, _unit(scene, path), _meaning(path), low, high, tuple(chosen))
    return Argument(name, (float(value),), _unit(scene, path), _meaning(path), low, high)


def _value(scene: Scene, path: Sequence[str], name: str) -> Any:
    """The number, or list of numbers, at a path of a scene."""
    here: Any = scene
    for i, key in enumerate(path):
        if isinstance(here, Mapping):
            known = list(here)
        elif isinstance(here, (list, tuple)):
            known = [str(k) for k in range(len(here))]
        else:
            known = list(getattr(type(here), "model_fields", ()))
        if key not in known:
            where = ".".join(path[:i]) or "the scene"
            raise SceneError(f"{name} of {where}: {unknown(key, known, 'such numbers')}", ("arguments",))
        here = here[key] if isinstance(here, Mapping) else here[int(key)] if key.isdigit() else getattr(here, key)
    here = plain(here)
    numbers = here if isinstance(here, list) else [here]
    if not numbers or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in numbers):
        raise SceneError(f"found {name!r}, accepted: a number of the scene, or a list of numbers", ("arguments",))
    return here


VECTORS = ("value", "displacement", "rotation", "position", "gravity", "direction", "anchor")
"""Keys of vectors."""

UNITS = {
    "displacement": "m",
    "rotation": "rad",
    "position": "m",
    "gravity": "m/s2",
    "rhoA": "kg/m",
    "mass": "kg",
    "E": "Pa",
    "G": "Pa",
    "rho": "kg/m3",
    "factor": "1",
}
"""Units of numbers by their keys."""


def _unit(scene: Scene, path: Sequence[str]) -> str:
    key = next((part for part in reversed(path) if not part.isdigit()), "")
    if path[0] == "loads" and key == "value":
        return {"force": "N", "moment": "N m", "distributed": "N/m"}[scene.loads[path[1]].type]
    if path[0] == "springs" and len(path) > 2:
        turning = scene.springs[path[1]].type == "rotational"
        return {"stiffness": "N m" if turning else "N/m", "rest": "rad" if turning else "m"}.get(key, "m")
    if path[0] == "sections":
        if re.match(r"EI|GJ", key):
            return "N m2"
        return UNITS.get(key, "m")
    return UNITS.get(key, "as in the scene")


def _meaning(path: Sequence[str]) -> str:
    kinds = {"loads": "load", "motions": "motion", "sections": "section", "nodes": "node", "springs": "spring"}
    if len(path) < 2:
        return path[0]
    return f"{'.'.join(path[2:])} of the {kinds.get(path[0], path[0])} {path[1]}"


class Arguments:
    """What is given as a function of the arguments.

    Attributes
    ----------
    arguments : tuple of Argument
    model : Model
        At values where nothing vanishes by chance: its structure is that of all values.
    program : Program
    rest : what is told of a model beside its data: undeformed positions
    defaults : ndarray (numbers,)
    """

    def __init__(
        self,
        scene: Scene,
        base: Model,
        arguments: Sequence[Argument],
        rest: Callable[[Model], Array],
        prefix: str = "",
    ) -> None:
        self._rest, self._undeformed = rest, len(rest(base))
        self.arguments, self._scene, self._base = tuple(arguments), scene, base
        self.defaults = np.array([x for one in self.arguments for x in one.default])
        numbers: list[Number] = []
        for one in self.arguments:
            numbers += [Number(n, x, one.low, one.high) for n, x in zip(one.names, one.default, strict=True)]
        names = [number.name for number in numbers]
        for name in names:
            if names.count(name) > 1:
                raise SceneError(f"found {name} more than once, accepted: each number once", ("arguments",))
        self._numbers = numbers
        self._groups = list(base.groups)
        # Factors multiply what the other numbers say: they are no matter for probes.
        self._own = [i for i, number in enumerate(numbers) if not self._is_factor(number.name)]
        self._mesh = base.mesh
        self.model = self._assembled(self._generic()) if self._own else base
        self.expressions = Expressions(Equations(self.model, kernels="interpreted"), "interpreted")
        everything = Program(self.expressions, self._every())
        self._layout = everything.sizes
        self.dependence = self._dependence(everything)
        self.program = Program(self.expressions, self._varying(), prefix=prefix)

    def _is_factor(self, name: str) -> bool:
        return name == FACTOR or bool(re.fullmatch(r"histories\.[^.]+", name))

    def accepted(self, values: Array) -> bool:
        """Whether values of the numbers are finite and within their limits."""
        limits = [one.limits for one in self.arguments for _ in one.default]
        return all(low <= x <= high and np.isfinite(x) for x, (low, high) in zip(values, limits, strict=True))

    # -- probes -------------------------------------------------------------------------------------

    def _generic(self) -> list[float]:
        values = []
        for i in self._own:
            number = self._numbers[i]
            centre, half = number.span
            values.append(centre + half * (0.37 + 0.11 * np.sin(1.0 + i)))
        return values

    def _assembled(self, values: Sequence[float]) -> Model:
        try:
            scene = with_numbers(self._scene, self._followed(values))
            assembly: Any = self._base.assembly
            return assemble(scene, self._mesh, assembly=assembly, scales=self._base.scales)
        except SceneError as error:
            raise SceneError(f"{error} (asked for by the arguments)") from None

    def _followed(self, values: Sequence[float]) -> dict[str, float]:
        """Numbers of the scene, those that follow others among them."""
        followers = {one.name: one.numbers for one in self.arguments}
        found: dict[str, float] = {}
        for i, value in zip(self._own, values, strict=True):
            name = self._numbers[i].name
            follow = followers.get(name)
            more = {name: value} if follow is None else single_numbers(self._scene, follow(value))
            twice = sorted(found.keys() & more.keys())
            if twice:
                raise SceneError(f"found {twice[0]} in two of them, accepted: each number once", ("arguments",))
            found |= more
        return found

    def scene_at(self, values: Array) -> Scene:
        """The scene with these values of the numbers; the factor in the place of all steps."""
        scene = with_numbers(self._scene, self._followed([values[i] for i in self._own]))
        steps, histories = (self._scene.analysis.steps[-1],), dict(scene.histories)
        for number, value in zip(self._numbers, values.tolist(), strict=True):
            if number.name == FACTOR:
                steps = (value,)
            elif self._is_factor(number.name):
                histories[number.name.partition(".")[2]] = History(t=(0.0, 1.0), value=(value, value))
        analysis = scene.analysis.model_copy(update={"steps": steps})
        return scene.model_copy(update={"analysis": analysis, "histories": histories})

    def _every(self) -> dict[str, bool]:
        names = ["stiffness", "tangent", *LOADS]
        count = len(self.model.connections)
        return dict.fromkeys(
            [*names, *(f"data_{i}" for i in range(count)), *(f"loads_{i}" for i in range(count))], True
        )

    def _data(self, model: Model, everything: Program) -> Array:
        """Data of a model, then its loads group by group, flat."""
        first = everything.slice_of_loads.start
        loads = [everything.given_of(model.groups[name])[first:] for name in self._groups]
        return np.concatenate([self._rest(model), *data_of(model).values(), *loads])

    def _dependence(self, everything: Program) -> Dependence:
        lengths = self._lengths(everything)
        shape = self._data(self.model, everything).shape

        def probe(values: Sequence[float]) -> Array:
            model = self._assembled(values) if self._own else self._base
            if [g.names for g in model.connections] != [g.names for g in self.model.connections]:
                raise SceneError("found arguments that change which joints and springs there are", ("arguments",))
            flat = self._data(model, everything)
            if flat.shape != shape:
                raise SceneError("found arguments that change what the model is made of", ("arguments",))
            if not _alike(model, self.model):
                message = "found arguments that change axes or directions of supports and joints"
                raise SceneError(f"{message}, accepted: numbers that leave these as they are", ("arguments",))
            return flat

        return found([self._numbers[i] for i in self._own], probe, lengths)

    def _lengths(self, everything: Program) -> Array:
        """Lengths of the rows of what :meth:`_data` gives: of a point, an element, a place, a connection."""
        expressions, sizes = self.expressions, everything.sizes
        points, axes = expressions.points, expressions.axes
        known = {"stiffness": points * self.model.element.stiffnesses, "tangent": points * axes, "turn": 3}
        known |= dict.fromkeys(("pull", "tangential", "spread"), points * axes)
        known |= dict.fromkeys(("force", "shift", "following"), axes)
        known |= dict.fromkeys(("moment", "twist"), expressions.turns)
        for i, group in enumerate(self.model.connections):
            known |= {f"data_{i}": group.data.shape[1], f"loads_{i}": group.kind.sizes[4]}

        def rows(names: Sequence[str]) -> list[Array]:
            return [np.full(sizes[n] // max(known[n], 1), known[n], dtype=np.intp) for n in names]

        data = [name for name in sizes if is_data(name)]
        loads = [name for name in sizes if not is_data(name)]
        # Places are judged by the size of the whole scene.
        rest = np.array([self._undeformed], dtype=np.intp)
        found = np.concatenate([rest, *rows(data), *(rows(loads) * len(self._groups))])
        return found[found > 0]

    def _split(self, flat: Any, cut: Callable[[Any, list[int]], Any]) -> tuple[list[Any], list[list[Any]]]:
        """Data, and loads by groups."""
        flat = cut(flat, [0, self._undeformed, flat.shape[0]])[1]
        data = [name for name in self._layout if is_data(name)]
        loads = [name for name in self._layout if name not in data]
        sizes = [self._layout[name] for name in data]
        sizes += [self._layout[name] for name in loads] * len(self._groups)
        parts = cut(flat, np.cumsum([0, *sizes]).tolist())
        rest = parts[len(data) :]
        return parts[: len(data)], [rest[i * len(loads) : (i + 1) * len(loads)] for i in range(len(self._groups))]

    def _varying(self) -> dict[str, bool]:
        """Parts that are not constant: data that numbers change, loads that there are."""

        def cut(flat: Array, bounds: list[int]) -> list[Array]:
            return [flat[a:b] for a, b in zip(bounds, bounds[1:], strict=False)]

        data, loads = self._split(self.dependence.changing, cut)
        names = list(self._layout)
        flags = {name: bool(part.any()) for name, part in zip(names, data, strict=False)}
        changed = np.any([[part.any() for part in group] for group in loads], axis=0)
        acting = np.any([[part.any() for part in group] for group in self._split(self.dependence.base, cut)[1]], axis=0)
        flags |= {n: bool(a or b) for n, a, b in zip(names[len(data) :], changed, acting, strict=True)}
        return flags

    def undeformed(self, p: ca.MX) -> ca.MX:
        """What ``rest`` tells, for numbers (numbers,)."""
        own = p[self._own] if self._own else ca.MX(0, 1)
        return self.dependence.value(own, slice(0, self._undeformed))

    # -- the function ---------------------------------------------------------------------------------

    def given(self, p: ca.MX) -> ca.MX:
        """What is given, as :class:`~sfetcas.solvers.program.Program` takes it, for numbers (numbers,)."""
        own = p[self._own] if self._own else ca.MX(0, 1)
        data, loads = self._split(self.dependence.value(own), ca.vertsplit)
        names = list(self._layout)
        found: dict[str, ca.MX] = dict(zip(names, data, strict=False))
        for i, name in enumerate(names[len(data) :]):
            found[name] = sum(
                (self._factor(p, group) * parts[i] for group, parts in zip(self._groups[1:], loads[1:], strict=True)),
                self._factor(p, self._groups[0]) * loads[0][i],
            )
        return ca.vertcat(ca.MX(0, 1), *(found[name] for name in self.program.sizes))

    def _factor(self, p: ca.MX, group: str | None) -> ca.MX | float:
        name = FACTOR if group is None else f"histories.{group}"
        for i, number in enumerate(self._numbers):
            if number.name == name:
                return p[i]
        # What is no argument stands as it would by default.
        return argument(self._scene, name).default[0]

    def prepare(self, name: str) -> ca.Function:
        """(arguments) -> given."""
        p = ca.MX.sym("arguments", len(self.defaults))
        return ca.Function(name, [p], [ca.densify(self.given(p))], ["arguments"], ["given"])


def _alike(one: Model, other: Model) -> bool:
    """Whether what is no data is the same: unknowns, axes, directions of guides, closings."""

    def parts(model: Model) -> list[Array]:
        positions, rotations = model.positions, model.rotations
        maps = [positions.E, positions.Y, positions.B, positions.Z, positions.W, positions.BZ]
        found = [part for one in maps for part in (one.row, one.column, one.value)]
        return [*found, rotations.kind, rotations.axis, model.winding.axis, model.winding.across]

    pairs = zip(parts(one), parts(other), strict=True)
    return all(a.shape == b.shape and np.allclose(a, b, rtol=1e-12, atol=1e-12) for a, b in pairs)


def with_numbers(scene: Scene, numbers: Mapping[str, float]) -> Scene:
    """The scene with other values of single numbers, ``{"nodes.B.position.0": 1.2}``; in the dimension that it has.

    Where a shape changes that says itself where it ends, as a given curvature does, a free node there goes with it.
    What was expected of its answers is left out.

    Raises
    ------
    SceneError
        The changed scene is none.
    """
    tree: dict[str, Any] = {}
    for name, value in numbers.items():
        *path, last = name.split(".")
        branch = tree
        for key in path:
            branch = branch.setdefault(key, {})
        branch[last] = float(value)
    tree |= {"dimension": scene.resolved_dimension, "expect": ()}
    _carry_ends(scene, tree, numbers)
    found = _with(scene, tree)
    assert isinstance(found, Scene)
    return found


def _carry_ends(scene: Scene, tree: dict[str, Any], numbers: Mapping[str, float]) -> None:
    """Take free nodes to where the shapes end that numbers change."""
    for name, member in scene.members.items():
        first, last = member.nodes[0], member.nodes[-1]
        moved = any(n.startswith((f"members.{name}.shape.", f"nodes.{first}.position.")) for n in numbers)
        others = [n for n, other in scene.members.items() if last in other.nodes and n != name]
        told = any(n.startswith(f"nodes.{last}.position.") for n in numbers)
        if not moved or told or others or scene.nodes[last].support != "free":
            continue
        shape = _with(member.shape, tree.get("members", {}).get(name, {}).get("shape", {}))
        begin = _with(scene.nodes[first].position, tree.get("nodes", {}).get(first, {}).get("position", {}))
        end = end_of(shape, [*begin, 0.0][:3], member.b2)
        if end is not None:
            place = {str(i): x for i, x in enumerate(end.tolist()[: len(scene.nodes[last].position)])}
            tree.setdefault("nodes", {}).setdefault(last, {})["position"] = place


def _with(here: Any, tree: Any) -> Any:
    """A record, table or list with other entries; of records only those are validated that change."""
    if not isinstance(tree, dict):
        # What counts, as elements, is a whole number.
        return int(tree) if type(here) is int and isinstance(tree, float) and tree.is_integer() else tree
    entries: Any
    if isinstance(here, Record):
        entries = {key: getattr(here, key) for key in tree}
    else:
        entries = dict(here) if isinstance(here, Mapping) else plain(here)
    listed = isinstance(entries, list)
    for key, branch in tree.items():
        place = int(key) if listed else key
        try:
            entries[place] = _with(entries[place], branch)
        except SceneError as error:
            raise error.within(key) from None
    return here.replace(**entries) if isinstance(here, Record) else entries
