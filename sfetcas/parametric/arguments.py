"""Numbers of a scene as arguments: names, defaults, ranges, and the data of the equations as their functions."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import pairwise, zip_longest
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .. import tolerances
from ..description import records
from ..description.changes import FACTOR, branch_of, carry_ends, with_entries
from ..description.records import Record, keys_of, name_of, plain, unknown
from ..description.scene import History, Scene
from ..description.showing import made, named
from ..description.supports import drives
from ..errors import SceneError
from ..mathematics.active import Active, gathered
from ..mathematics.arrays import Array, numbers, unit
from ..mathematics.constants import picked
from ..mathematics.piecewise import piecewise
from ..mechanics.beams import ELEMENT_DATA
from ..mechanics.equations import Equations
from ..mechanics.expressions import LOADS, Expressions
from ..mechanics.loading import Loading
from ..mechanics.mesh import ContactPoint, Mesh, breaks_of
from ..mechanics.model import Model, assemble
from ..mechanics.terms import ALWAYS
from ..solvers.program import Program, data_of, is_data
from .results import Results
from .sliding_tubes import SLIDING, carried_along, reach_of, slid_through

__all__ = [
    "FACTOR",
    "Argument",
    "Arguments",
    "Asked",
    "Parameter",
    "argument",
    "asked_for",
    "default_arguments",
    "in_words",
    "limits_of",
    "refuse_idle",
    "single_numbers",
    "with_cuts",
    "with_numbers",
    "with_values",
]


@dataclass(frozen=True)
class Parameter:
    """A user-defined parameter on which several numbers of a scene depend: a length, the place of a joint on a line.

    ``Parameter(1.0, lambda x: {"nodes.B.position": [x, 0], "nodes.C.position": [2 * x, 0]})``

    Attributes
    ----------
    value : float
        Its value in the scene as given.
    numbers : callable
        Value -> numbers of the scene by their names; also called with a symbol, which NumPy's functions accept.
    low, high : float or None
        Range of accepted values.
    unit, meaning : str
        For tables and messages.
    """

    value: float
    numbers: Callable[[float], Mapping[str, ArrayLike]] = field(repr=False)
    low: float | None = None
    high: float | None = None
    unit: str = ""
    meaning: str = "a number that others follow"

    def __repr__(self) -> str:
        return made(self)


@dataclass(frozen=True)
class Argument:
    """One argument: a number or a vector of the scene.

    Attributes
    ----------
    name : str
        As in the scene: ``loads.tip.value``.
    default : tuple of float
        Its value in the scene.
    unit, meaning : str
    low, high : float or None
        Range of accepted values of each number.
    components : tuple of int or None
        Indices of the numbers of a list; None for a single number.
    numbers : callable or None
        For a :class:`Parameter`: value -> numbers of the scene by their names.
    """

    name: str
    default: tuple[float, ...]
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    components: tuple[int, ...] | None = None
    numbers: Callable[[float], Mapping[str, ArrayLike]] | None = field(default=None, repr=False)

    @property
    def limits(self) -> Array:
        """Least and largest accepted value of each number, (numbers, 2): the range, or what is possible.

        That is above zero for stiffness and radii, from zero for masses, dampers and tension, to zero and from zero for
        the two sides of a stop, anything for others.
        """
        if self.low is not None and self.high is not None:
            return np.tile([self.low, self.high], (len(self.default), 1))
        return np.array([_possible(name) for name in self.names]).reshape(-1, 2)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each of its numbers: with the index for those of a list."""
        if self.components is None:
            return (self.name,)
        return tuple(f"{self.name}.{i}" for i in self.components)


def _possible(name: str) -> tuple[float, float]:
    """Least and largest possible value of a number by its name."""
    if name.endswith((".stop.0", ".stop.1")):
        return (-np.inf, 0.0) if name.endswith("0") else (0.0, np.inf)
    signed = bool(re.search(r"\.(stretch_)?law\..*\d$", name)) or any(part in name for part in SIGNED)
    of_section = name.startswith("sections.") and not signed
    light = of_section and name.split(".")[2] in MAY_BE_ZERO
    if (of_section and not light) or name.endswith(".radius"):
        return float(np.nextafter(0.0, 1.0)), np.inf
    return (0.0 if light or NOT_NEGATIVE.search(name) else -np.inf), np.inf


NOT_NEGATIVE = re.compile(
    r"\.(stiffness|tension|pressure|area)$|^nodes\.[^.]+\.(mass|drag|inertia)(\.\d)?$|^springs\.[^.]+\.damping$"
)
"""Names of numbers that are zero or above."""

SIGNED = (".polynomial", ".coupling", ".stiffness.", ".tension_center", ".shear_center", ".mass_center")
"""Parts of the names of numbers of sections that may have either sign."""

MAY_BE_ZERO = ("rhoA", "rhoI", "rho", "damping", "drag")
"""Keys of sections whose numbers may be zero."""

Asked = Sequence[str] | Mapping[str, tuple[float, float] | Parameter | None] | None
"""Names of numbers, or a mapping of them to ranges (None: no range) or :class:`Parameter`; None: defaults."""


def asked_for(scene: Scene, asked: Asked) -> list[Argument]:
    """The arguments of the given names; those of :func:`default_arguments` for None.

    Raises
    ------
    SceneError
        The scene has no such number, it changes the elements, or a range or parameter is wrong.
    """
    chosen = asked if asked is not None else default_arguments(scene)
    spans = chosen if isinstance(chosen, Mapping) else dict.fromkeys(chosen)
    for name, span in spans.items():
        _check_asked(name, span)
        if re.fullmatch(MESHED, name):
            message = "found a number that changes the elements, and with them the unknowns"
            raise SceneError(f"{message}, accepted: one that leaves them as they are", ("arguments", name))
        _check_rings(scene, name)
        twin = re.fullmatch(BESIDE_DIAGONAL, name)
        if twin is not None:
            message = "found an entry that stands on both sides of the diagonal"
            accepted = f"a Parameter that gives both, {name!r} and '{twin[1]}.{twin[3]}.{twin[2]}'"
            raise SceneError(f"{message}, accepted: {accepted}", ("arguments", name))
    return [
        _own(scene, name, span) if isinstance(span, Parameter) else argument(scene, name, span)
        for name, span in spans.items()
    ]


BESIDE_DIAGONAL = r"(sections\.[^.]+\.stiffness)\.(\d)\.(?!\2)(\d)"
"""Names of entries of stiffness matrices that have a twin."""

MESHED = (
    r"members\.[^.]+\.elements|(actuations|magnets)\.[^.]+\.(from|to)|tendons\.[^.]+\.way\.\d+\.(from|to|discs(\.\d+)?)"
    r"|tubes\.[^.]+\.(length|curved_from|insertion)|members\.[^.]+\.insertion|rings\.[^.]+\.at"
)
"""Names of numbers at which elements end."""


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


def _check_rings(scene: Scene, name: str) -> None:
    """Refuse a number with which the node of a ring would leave the undeformed member."""
    path = name.split(".")
    for ring_name, ring in scene.rings.items():
        nodes = {ring.node, *scene.members[ring.member].nodes}
        placed = path[0] == "nodes" and path[1] in nodes and "position" in path
        if placed or (path[:2] == ["members", ring.member] and "shape" in path):
            message = f"found with rings.{ring_name}, whose node has to be on the undeformed member"
            raise SceneError(f"{message}, accepted: the displacement of a motion", ("arguments", name))


def _own(scene: Scene, name: str, given: Parameter) -> Argument:
    """The argument of a parameter of one's own."""
    if "." in name or name == FACTOR:
        raise SceneError(f"found {name!r} for a parameter of one's own, accepted: a name without dots", ("arguments",))
    if given.low is not None and given.high is not None and not given.low <= given.value <= given.high:
        message = f"found {given.value:g}, accepted: a value from {given.low:g} to {given.high:g}"
        raise SceneError(message, ("arguments", name))
    for number, value in single_numbers(scene, given.numbers(given.value)).items():
        (stands,) = argument(scene, number).default
        if abs(value - stands) > tolerances.WRITTEN * max(abs(value), abs(stands)):
            found = f"{number} is {stands:g} in the scene, but {value:g} where the parameter is {given.value:g}"
            accepted = "both the same: change that number of the scene, or the value of the parameter"
            raise SceneError(f"{found}, accepted: {accepted}", ("arguments", name))
    unit, meaning = given.unit or "as its numbers", given.meaning
    return Argument(name, (float(given.value),), unit, meaning, given.low, given.high, None, given.numbers)


def single_numbers(scene: Scene, values: Mapping[str, ArrayLike]) -> dict[str, float]:
    """Values of single numbers, by name, from values of numbers and of lists of numbers; in the units of the scene.

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
        given = numbers(value).ravel()
        if len(given) != len(known.default) or not np.isfinite(given).all():
            count = len(known.default)
            accepted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise SceneError(f"{name}: found {value!r}, accepted: {accepted}")
        single |= dict(zip(known.names, given.tolist(), strict=True))
    return single


def default_arguments(scene: Scene) -> list[str]:
    """Names of the default arguments: the load factor, the histories, loads, tendons, actuations, fields, motions."""
    free = [one for _, _, one in scene.driven if one.history is None]
    names = [FACTOR] if free or scene.gravity is not None else []
    names += [f"histories.{name}" for name in scene.histories]
    names += [f"loads.{name}.value" for name in scene.loads]
    for name, tendon in scene.tendons.items():
        pulls = ("tension", "pressure", "pull", "length")
        names += [f"tendons.{name}.{key}" for key in pulls if getattr(tendon, key) is not None]
    names += [f"tubes.{name}.{key}" for name in scene.tubes for key in ("angle", "rotation")]
    names += [f"rings.{name}.travel" for name, ring in scene.rings.items() if ring.driven]
    names += [f"actuations.{name}.value" for name in scene.actuations]
    for name, source in scene.fields.items():
        names += [f"fields.{name}.{key}" for key in ("value", "moment") if getattr(source, key) is not None]
    for name, motion in scene.motions.items():
        along = _along_guide(scene, name)
        if motion.displacement is not None and along:
            names += [f"motions.{name}.displacement.{i}" for i in _axes(scene) if i not in along]
        elif motion.displacement is not None:
            names.append(f"motions.{name}.displacement")
        names += [f"motions.{name}.rotation"] if motion.rotation is not None else []
    return names


def _axes(scene: Scene) -> range:
    """Numbers of the axes in which things move."""
    return range(2 if scene.resolved_dimension == "plane" else 3)


def _along_guide(scene: Scene, motion: str) -> list[int]:
    """Components of the displacement of a motion that would drive a slider along its guide, where it does not."""
    moved = scene.motions[motion]
    node = None if moved.node is None else scene.nodes[moved.node]
    if node is None or not node.slides or node.direction is None or drives(node, moved.displacement):
        return []
    return [i for i, share in enumerate(unit(node.direction)) if abs(share) > tolerances.DECIMAL]


def _check_guide(scene: Scene, name: str) -> None:
    """Refuse a number with which a slider would be driven along its guide, on which it moves freely."""
    _, motion, _, *component = name.split(".")
    along = _along_guide(scene, motion)
    wrong = along if not component else [i for i in along if i == int(component[0])]
    if wrong:
        accepted = [f"motions.{motion}.displacement.{i}" for i in _axes(scene) if i not in along]
        message = f"found with nodes.{scene.motions[motion].node}, which it would drive along its guide"
        what = f"{' or '.join(accepted)}, across it" if accepted else "a displacement in fixed axes along the guide"
        raise SceneError(f"{message}, accepted: {what}", ("arguments", name))


def argument(scene: Scene, name: str, span: tuple[float, float] | None = None) -> Argument:
    """The argument of a name, with a range ``span`` if given.

    Raises
    ------
    SceneError
        The scene has no such number.
    """
    low, high = span if span is not None else (None, None)
    if low is not None and high is not None and not low < high:
        raise SceneError(f"found {low:g} to {high:g}, accepted: a range from low to high", ("arguments", name))
    if re.fullmatch(r"histories\.[^.]+\.t(\.\d+)?", name):
        message = "found a time or factor at which a history has a knot, accepted: its values or coefficients"
        raise SceneError(message, ("arguments", name))
    if KINKS.fullmatch(name) and not MOVING.fullmatch(name):
        message = "found a place at which a quantity along a member has a kink, where an element ends, accepted: values"
        raise SceneError(message, ("arguments", name))
    found = _argument(scene, name, low, high)
    if MOVING.fullmatch(name) or SLIDING.fullmatch(name):
        found = _within(scene, found)
    if re.fullmatch(r"motions\.[^.]+\.displacement(\.\d)?", name):
        _check_guide(scene, name)
    outside = [x for x, (least, most) in zip(found.default, found.limits, strict=True) if not least <= x <= most]
    if outside:
        message = f"found {outside[0]:g} in the scene, accepted: a range from low to high that has it"
        raise SceneError(message, ("arguments", name))
    if low is not None and high is not None:
        # A range of what is above zero may begin there.
        least, most = (
            max(min(_possible(one)[0], 0.0) for one in found.names),
            min(_possible(one)[1] for one in found.names),
        )
        if low < least or high > most:
            accepted = "from zero on" if low < least else "up to zero"
            raise SceneError(f"found {low:g} to {high:g}, accepted for this number: {accepted}", ("arguments", name))
    return found


def _argument(scene: Scene, name: str, low: float | None, high: float | None) -> Argument:
    path = name.split(".")
    if name == FACTOR:
        default = float(scene.analysis.steps[-1])
        meaning = "factor of all loads and motions without a history"
        if scene.histories and scene.analysis.type != "dynamic":
            meaning += "; histories that are no arguments are evaluated at it"
        return Argument(name, (default,), "1", meaning, low, high)
    if path[0] == "histories" and len(path) == 2 and path[1] in scene.histories:
        # Of a motion what it begins with.
        when = 0.0 if scene.analysis.type == "dynamic" else float(scene.analysis.steps[-1])
        default = scene.histories[path[1]].factor(when)
        return Argument(name, (default,), "1", f"factor of what has the history {path[1]}", low, high)
    value = _value(scene, path, name)
    if isinstance(value, (list, tuple)):
        count = len(value)
        # Values along a member or over time are no vector, even where they are three.
        vector = path[-1] in VECTORS and (path[-1] != "value" or (path[0] in VALUED and len(path) == 3))
        if scene.resolved_dimension == "plane" and count == 3 and vector:
            # What is out of the plane is no number of a plane scene; moments and rotations are about z.
            about = path[-1] == "rotation" or (path[0] == "loads" and scene.loads[path[1]].type == "moment")
            chosen = [2] if about else [0, 1]
            if path[0] == "actuations" or path[-1] == "moment_density":
                # Of the axes of the sections one is along z.
                member = str(getattr(scene, path[0])[path[1]].member)
                normal = scene.center_lines[member].bending_axis - 1
                chosen = [normal] if path[0] == "actuations" else [i for i in range(3) if i != normal]
        else:
            chosen = list(range(count))
        values = tuple(float(value[i]) for i in chosen)
        return Argument(name, values, _unit(scene, path), _meaning(path), low, high, tuple(chosen))
    return Argument(name, (float(value),), _unit(scene, path), _meaning(path), low, high)


KINKS = re.compile(r"(sections|loads|actuations|magnets)\..+\.at(\.\d+)?")
"""Names of places along members between which quantities are linear, with which no element moves."""

MOVING = re.compile(r"loads\.([^.]+)\.(at|from|to)")
"""Names of places of loads along members, with which elements move."""


def _within(scene: Scene, place: Argument) -> Argument:
    """The place of a load or a tube along its member, which stays between the kinks, loads and ends beside it.

    Raises
    ------
    SceneError
        Something else is there too, or a range goes further.
    """
    beside = reach_of if SLIDING.fullmatch(place.name) else _beside
    (at,), (low, here, high) = place.default, beside(scene, place.name)
    if not low + APART < here < high - APART:
        message = f"found {at:g}, where a kink, another load or an end is, accepted: a place by itself"
        raise SceneError(message, ("arguments", place.name))
    share = APART * (high - low if np.isfinite(low) else scene.size)
    least, most = low + share, high - share
    wanted = (least if place.low is None else place.low), (most if place.high is None else place.high)
    if wanted[0] < least or wanted[1] > most:
        message = f"found {wanted[0]:g} to {wanted[1]:g}, accepted: a range between {low:g} and {high:g}"
        raise SceneError(f"{message}, where kinks, other loads or ends are", ("arguments", place.name))
    return replace(place, low=wanted[0], high=wanted[1])


def _beside(scene: Scene, name: str) -> tuple[float, float, float]:
    """The place of a load along its member, between the kinks, other loads and ends beside it."""
    owner, key = name.split(".")[1:]
    load, loads = scene.loads[owner], dict(scene.loads)
    if key == "at":
        del loads[owner]
    else:
        loads[owner] = load.model_copy(update={"from_": 0.0} if key == "from" else {"to": 1.0})
    breaks = breaks_of(scene.model_copy(update={"loads": loads}), str(load.member))
    at = float(load.at or 0.0) if key == "at" else load.part[key == "to"]
    after = min(max(int(np.searchsorted(breaks, at + APART)), 1), len(breaks) - 1)
    return float(breaks[after - 1]), at, float(breaks[after])


APART = 1e-6
"""Share of the way between what is beside a load on its member that it keeps from either: elements need a length."""


def _value(scene: Scene, path: Sequence[str], name: str) -> Any:
    """The number, or list of numbers, at a path of a scene."""
    here: Any = scene
    record: Any = scene
    for i, key in enumerate(path):
        if isinstance(here, Mapping):
            known = list(here)
        elif isinstance(here, (list, tuple)):
            known = [str(k) for k in range(len(here))]
        else:
            known = list(keys_of(type(here))) if isinstance(here, Record) else []
        if key not in known:
            where = ".".join(path[:i]) or "the scene"
            raise SceneError(f"{name} of {where}: {unknown(key, known, 'such numbers')}", ("arguments",))
        record = here
        if isinstance(here, Record):
            here = getattr(here, name_of(type(here), key))
        else:
            here = here[key] if isinstance(here, Mapping) else here[int(key)]
    if here is None:
        # As EI3 of a section that is given by a shape.
        given = [key for key, value in record if key in record.model_fields_set and isinstance(value, (int, float))]
        where = ".".join(path[:-1]) or "the scene"
        message = f"{where} is given without {path[-1]}, accepted: {', '.join(given) or 'a number that it has'}"
        raise SceneError(message, ("arguments",))
    here = plain(here)
    numbers = here if isinstance(here, list) else [here]
    if not numbers or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in numbers):
        raise SceneError(f"found {name!r}, accepted: a number of the scene, or a list of numbers", ("arguments",))
    return here


VECTORS = (
    "value",
    "displacement",
    "rotation",
    "position",
    "gravity",
    "direction",
    "anchor",
    "moment",
    "moment_density",
    "center",
    "point",
    "normal",
)
"""Keys of vectors."""

VALUED = ("loads", "actuations", "fields")
"""Tables whose records have a vector as their value."""

UNITS = {
    "displacement": "m",
    "travel": "m",
    "rotation": "rad",
    "angle": "rad",
    "position": "m",
    "gravity": "m/s2",
    "rhoA": "kg/m",
    "mass": "kg",
    "E": "Pa",
    "G": "Pa",
    "rho": "kg/m3",
    "tension": "N",
    "pull": "m",
    "length": "m",
    "offset": "m",
    "ground": "m",
    "start": "m",
    "pressure": "Pa",
    "area": "m2",
    "factor": "1",
    "moment": "A m2",
    "moment_density": "A m",
    "gradient": "T/m",
    "center": "m",
    "point": "m",
    "radius": "m",
    "member_radius": "m",
}
"""Units of numbers by their keys."""

LAW_UNITS = {
    "moment": "N m",
    "curvature": "1/m",
    "stress": "Pa",
    **dict.fromkeys(("ratio", "alpha", "exponent", "strain"), "1"),
}
"""Units of the numbers of laws of sections."""


def _unit(scene: Scene, path: Sequence[str]) -> str:
    key = next((part for part in reversed(path) if not part.isdigit()), "")
    if path[0] == "loads" and key == "value":
        return {"force": "N", "moment": "N m", "distributed": "N/m"}[scene.loads[path[1]].type]
    if path[0] in ("actuations", "fields") and key == "value":
        return {"actuations": "1/m", "fields": "T"}[path[0]]
    if path[0] == "springs" and len(path) > 2:
        turning = scene.springs[path[1]].type == "rotational"
        return {"stiffness": "N m" if turning else "N/m"}.get(
            key, "rad" if turning and key in ("rest", "stop") else "m"
        )
    if path[0] == "tubes" and key == "curvature":
        return "1/m"
    if path[0] == "tendons" and key == "stiffness":
        return "N/m"
    if path[0] == "sections":
        if re.match(r"EI|GJ|coupling", key):
            return "N m2"
        if key == "stiffness":
            row, column = (int(part) > 2 for part in [*path[3:5], "0", "0"][:2])
            return ("N", "N m", "N m2")[row + column]
        if re.match(r"EA|GA", key):
            return "N"
        if key == "shear_factor":
            return "1"
        if "law" in path[2:]:
            return LAW_UNITS.get(key, "as in the scene")
        return UNITS.get(key, "m")
    return UNITS.get(key, "as in the scene")


def _meaning(path: Sequence[str]) -> str:
    kinds = {"loads": "load", "motions": "motion", "sections": "section", "nodes": "node", "springs": "spring"}
    kinds |= {"tendons": "tendon", "tubes": "tube", "rings": "ring", "actuations": "actuation", "fields": "field"}
    kinds |= {"magnets": "magnet", "contacts": "contact"}
    if len(path) < 2:
        return path[0]
    return f"{'.'.join(path[2:])} of the {kinds.get(path[0], path[0])} {path[1]}"


class Arguments:
    """The data and loads of the equations as functions of the arguments.

    The numbers of the scene are symbols in the data of its model, which is assembled once: at values near those of the
    scene at which no entry vanishes by chance, so that its sparsity is that for all values.  Where members lie along
    obstacles so are the places at which elements end where lines do: these come after the numbers.  They stay where
    there are results along the member.

    With ``needed`` numbers on which nothing depends are refused.

    Attributes
    ----------
    arguments : tuple of Argument
    model : Model
        Assembled at these values.
    program : Program
    defaults : ndarray (numbers,)
        Values of the scene, in its units.
    ends : tuple of ContactPoint
        The points where lines end.
    places : ndarray (ends,)
        Fractions of the lengths of their members at which elements end beside them.
    idle : tuple of str
        Numbers on which nothing depends.
    """

    def __init__(
        self,
        scene: Scene,
        base: Model,
        arguments: Sequence[Argument],
        results: Results,
        prefix: str = "",
        *,
        needed: bool = True,
    ) -> None:
        self.arguments, self._scene = tuple(arguments), scene
        self.defaults = np.array([x for one in self.arguments for x in one.default])
        self._names = [name for one in self.arguments for name in one.names]
        for name in self._names:
            if self._names.count(name) > 1:
                raise SceneError(f"found {name} more than once, accepted: each number once", ("arguments",))
        _check_apart(scene, self.arguments)
        # Factors multiply what the other numbers say.
        self._own = [i for i, name in enumerate(self._names) if not _is_factor(name)]
        told = results.along
        self.ends = tuple(point for point in base.mesh.line_ends if point.members[0] not in told)
        self.places = np.array([_beside_end(base.mesh, point) for point in self.ends])
        self._used = np.array([*self._own, *range(len(self.defaults), self.size)], dtype=np.intp)
        self._symbols = ca.SX.sym("numbers", len(self._used))
        symbolic = self._assembled(base) if len(self._used) else base
        results.refuse_along(name for name, cuts in symbolic.mesh.cuts.items() if isinstance(cuts, Active))
        self.model = _at_values(symbolic)
        self.expressions = Expressions(Equations(self.model, kernels="interpreted"), "interpreted")
        everything = Program(self.expressions, self._every())
        self._layout, self._groups = everything.sizes, list(_loadings(self.model))
        undeformed, data = Active.of(results.rest(symbolic)), self._data(symbolic, everything)
        self._undeformed, self._given = (
            _Part(part, self._symbols, name) for part, name in ((undeformed, "rest"), (data, "data"))
        )
        used = {name: symbolic.scene.histories[name] for name in self._groups if name not in (None, ALWAYS)}
        self._courses: dict[str | None, _Part] = {
            name: _Part(_course(one), self._symbols, "course") for name, one in used.items()
        }
        self.idle = self._check(symbolic)
        if needed:
            refuse_idle(self.idle, moving=scene.analysis.type == "dynamic")
        self.program = Program(self.expressions, self._varying(), prefix=prefix)

    @property
    def size(self) -> int:
        """Length of vectors of all numbers: those of the arguments, then the places where lines end."""
        return len(self.defaults) + len(self.ends)

    def within(self, places: Array) -> bool:
        """Whether elements can end at places (ends,) in the order in which they do, none far shorter than before."""
        for name, ends in self._moved_ends(places.tolist()).items():
            before, there = _knots(self._scene, name, ends), _knots(self._scene, name, ends, ends.values())
            if not (np.diff(there) > LEFT * np.diff(before)).all():
                return False
        return True

    def _moved_ends(self, places: Sequence[Any]) -> dict[str, dict[float, Any]]:
        """For each member with lines where elements that end at fractions of its length are to end."""
        found: dict[str, dict[float, Any]] = {}
        for point, before, there in zip(self.ends, self.places.tolist(), places, strict=True):
            found.setdefault(point.members[0], {})[before] = there
        return found

    def accepted(self, values: Array) -> Array:
        """Whether values (..., numbers), in the units of the scene, are finite and within their limits, (...)."""
        low, high = self._limits
        return np.asarray(((low <= values) & (values <= high) & np.isfinite(values)).all(axis=-1))

    @functools.cached_property
    def _limits(self) -> Array:
        return limits_of(self.arguments)

    # -- the model with symbols -----------------------------------------------------------------------

    def _assembled(self, base: Model) -> Model:
        """The model with symbols in the place of numbers.

        Raises
        ------
        SceneError
            It has none to either side of the defaults.
        """
        count, assembly = len(self._own), base.assembly
        refused: SceneError | None = None
        # To one side a member may begin inside of the obstacle on which it lies.
        for side in (1.0, -1.0):
            values = np.concatenate([self._generic(side), self.places])
            numbers_there = values.tolist(), Active(values, self._symbols).tolist()
            plain, symbolic = (self._followed(each[:count]) for each in numbers_there)
            try:
                known = depending(with_numbers(self._scene, plain), symbolic) if count else self._scene
                mesh = with_cuts(self._scene, base.mesh, symbolic, self._moved_ends(numbers_there[1][count:]))
                return assemble(known, mesh, assembly=assembly, scales=base.scales)  # type: ignore[arg-type]
            except SceneError as error:
                refused = refused or error
        raise SceneError(f"{refused} (asked for by the arguments)") from None

    def _generic(self, side: float) -> Array:
        """Values near the defaults, to a side of these, where nothing vanishes by chance, within their ranges."""
        values = []
        ranges = [(one.low, one.high) for one in self.arguments for _ in one.default]
        for i in self._own:
            (low, high), default = ranges[i], float(self.defaults[i])
            share = NEAR * (1.0 + 0.3 * np.sin(1.0 + i))
            if low is None or high is None:
                values.append(default + side * share * (default or self._scene.size))
            else:
                values.append(default + share * ((high if high - default > default - low else low) - default))
        return np.array(values)

    def _followed(self, values: Sequence[Any]) -> dict[str, Any]:
        """Numbers of the scene, those that follow others among them."""
        followers = {one.name: one.numbers for one in self.arguments}
        found: dict[str, Any] = {}
        for i, value in zip(self._own, values, strict=True):
            name = self._names[i]
            follow = followers.get(name)
            more = {name: value} if follow is None else single_numbers(self._scene, _called(name, follow, value))
            twice = sorted(found.keys() & more.keys())
            if twice:
                raise SceneError(f"found {twice[0]} in two of them, accepted: each number once", ("arguments",))
            found |= more
        return found

    def _check(self, symbolic: Model) -> tuple[str, ...]:
        """Refuse numbers that the unknowns themselves depend on; those on which nothing depends."""
        parts = [symbolic.rotations.axis, symbolic.unwrapping.axis, symbolic.unwrapping.across]
        axes = _Part(gathered(parts), self._symbols, "axes")
        for i, turns in zip(self._own, axes.numbers, strict=False):
            if turns:
                message = "found a number that turns an axis about which angles are unknowns or counted"
                raise SceneError(f"{message}, accepted: one that leaves it as it is", ("arguments", self._names[i]))
        known = self._undeformed.numbers | self._given.numbers
        for name, course in self._courses.items():
            if f"histories.{name}" not in self._names:
                known = known | course.numbers
        return tuple(self._names[i] for i, used in zip(self._own, known, strict=False) if not used)

    def scene_at(self, values: Array) -> Scene:
        """The scene with values (numbers,) of its numbers, in its units; a load factor replaces all ``steps``."""
        scene = with_numbers(self._scene, self._followed([float(values[i]) for i in self._own]))
        steps, histories = (self._scene.analysis.steps[-1],), dict(scene.histories)
        for name, value in zip(self._names, values.tolist(), strict=True):
            if name == FACTOR:
                steps = (value,)
            elif _is_factor(name):
                histories[name.partition(".")[2]] = History(t=(0.0, 1.0), value=(value, value))
        analysis = scene.analysis.model_copy(update={"steps": steps})
        return scene.model_copy(update={"analysis": analysis, "histories": histories})

    def model_near(self, one: Argument) -> Model:
        """The model where one of the arguments alone is not as in the scene, but near that."""
        values = self.defaults.copy()
        for i, near in zip(self._own, self._generic(1.0).tolist(), strict=True):
            if self._names[i] in one.names:
                values[i] = near
        scene, model = self.scene_at(values), self.model
        mesh = self.mesh_at(scene, model.mesh)
        return assemble(scene, mesh, assembly=model.assembly, scales=model.scales)

    def mesh_at(self, scene: Scene, mesh: Mesh, places: Array | None = None) -> Mesh:
        """A mesh of the scene as given, with ends of elements where they are with other values of its numbers.

        ``places`` (ends,) are those where lines end, by default those of the scene.
        """
        moving = [one.name for one in self.arguments if MOVING.fullmatch(one.name) or SLIDING.fullmatch(one.name)]
        there = {name: float(_value(scene, name.split("."), name)) for name in moving}
        ends = self._moved_ends((self.places if places is None else places).tolist())
        moved, points = with_cuts(self._scene, mesh, there, ends), list[ContactPoint]()
        for point in mesh.points:
            (first, *_), (at, *_) = point.members, point.at
            points.append(
                replace(point, at=(float(moved.cuts[first][mesh.cut_at(first, at)]),)) if point.line else point
            )
        return replace(moved, points=tuple(points))

    # -- what is given --------------------------------------------------------------------------------

    def _every(self) -> dict[str, bool]:
        count = range(len(self.model.connections))
        names = [*ELEMENT_DATA, *LOADS, *(f"data_{i}" for i in count), *(f"loads_{i}" for i in count)]
        return dict.fromkeys(names, True)

    def _data(self, model: Model, everything: Program) -> Active:
        """Data of a model, then its loads group by group, flat."""
        first = everything.slice_of_loads.start
        loads = [everything.given_of(loading)[first:] for loading in _loadings(model).values()]
        return gathered([*data_of(model).values(), *loads])

    def _split(self, flat: Any, cut: Callable[[Any, list[int]], Any]) -> tuple[list[Any], list[list[Any]]]:
        """Data, and loads by groups."""
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

        data, loads = self._split(self._given.changing, cut)
        names = list(self._layout)
        flags = {name: bool(part.any()) for name, part in zip(names, data, strict=False)}
        changed = np.any([[part.any() for part in group] for group in loads], axis=0)
        acting = np.any([[part.any() for part in group] for group in self._split(self._given.values, cut)[1]], axis=0)
        flags |= {n: bool(a or b) for n, a, b in zip(names[len(data) :], changed, acting, strict=True)}
        flags |= {f"data_{i}": True for i, group in enumerate(self.model.connections) if group.kind.switches}
        return flags

    def undeformed(self, p: ca.MX) -> ca.MX:
        """Undeformed positions as :meth:`.Results.rest` gives them, for all numbers (size,)."""
        return self._undeformed.at(picked(p, self._used))

    def given(self, p: ca.MX) -> ca.MX:
        """Data and loads as :class:`~sfetcas.solvers.program.Program` takes them, for all numbers (size,)."""
        own = picked(p, self._used)
        data, loads = self._split(self._given.at(own), ca.vertsplit)
        names = list(self._layout)
        found: dict[str, ca.MX] = dict(zip(names, data, strict=False))
        for i, name in enumerate(names[len(data) :]):
            found[name] = sum(
                (self._factor(p, group) * parts[i] for group, parts in zip(self._groups[1:], loads[1:], strict=True)),
                self._factor(p, self._groups[0]) * loads[0][i],
            )
        return ca.vertcat(ca.MX(0, 1), *(found[name] for name in self.program.sizes))

    def _factor(self, p: ca.MX, group: str | None) -> ca.MX | float:
        if group == ALWAYS:
            return 1.0
        name = FACTOR if group is None else f"histories.{group}"
        if name in self._names:
            return p[self._names.index(name)]
        course, moving = self._courses.get(group), self._scene.analysis.type == "dynamic"
        follows = FACTOR in self._names and not moving
        if course is not None and (follows or course.changing.any()):
            at = ca.MX(0.0 if moving else argument(self._scene, FACTOR).default[0])
            at = p[self._names.index(FACTOR)] if follows else at
            knots = self._scene.histories[str(group)].t
            flat = course.at(picked(p, self._used))
            terms, ends = ca.vertsplit(flat, [0, flat.numel() - 2, flat.numel()])
            return piecewise(at, knots, ca.reshape(terms, max(len(knots) - 1, 1), -1), ends)
        # What is no argument stands as it would by default.
        return argument(self._scene, name).default[0]

    def prepare(self, name: str) -> ca.Function:
        """A function (arguments) -> given, with a name."""
        p = ca.MX.sym("arguments", self.size)
        return ca.Function(name, [p], [ca.densify(self.given(p))], ["arguments"], ["given"])


def limits_of(arguments: Sequence[Argument]) -> Array:
    """Least and largest accepted values of all numbers of arguments, (2, numbers)."""
    return np.concatenate([np.zeros((0, 2)), *(one.limits for one in arguments)]).T


def refuse_idle(names: Sequence[str], *, moving: bool = False) -> None:
    """Refuse numbers on which nothing depends, in the equations of a motion with ``moving``.

    Raises
    ------
    SceneError
        Names the first.
    """
    if names:
        accepted = "loads, motions, stiffness" if moving else "one that the equilibrium depends on"
        where = " in the steps of a motion" if moving else ""
        message = f"found a number on which nothing depends{where}, accepted: {accepted}"
        if names[0].startswith("contacts."):
            message += ", as of what touches with the numbers of the scene"
        raise SceneError(message, ("arguments", names[0]))


def _loadings(model: Model) -> dict[str | None, Loading]:
    """Loadings of a model by the names of their histories, with that which is there at every factor."""
    standing = [(loading, 1.0) for loading in model.standing]
    return {**model.groups, **({ALWAYS: Loading.combined(standing)} if standing else {})}


def _course(history: History) -> Active:
    """Coefficients of a history, those of the same power together, then its values at both ends; flat."""
    pieces = history.pieces or ((0.0,),)
    columns = zip_longest(*pieces, fillvalue=0.0)
    ends = [history.factor(history.t[0]), history.factor(history.t[-1])]
    return Active.of(numbers([*(term for column in columns for term in column), *ends]))


def in_words(arguments: Arguments, results: Results) -> list[str]:
    """The names of arguments and of results, a line of each."""
    parameters, answers = [one.name for one in arguments.arguments], [one.name for one in results.results]
    return [named(parameters, "parameter"), named(answers, "answer")]


def with_cuts(
    scene: Scene, mesh: Mesh, symbolic: Mapping[str, Any], ends: Mapping[str, Mapping[float, Any]] | None = None
) -> Mesh:
    """The mesh with symbolic ends of elements that move with the places of loads and tubes along their members.

    With them go others: ``ends`` says for each member where elements that end at fractions of its length are to end.
    """
    moving = {name: dict(places) for name, places in (ends or {}).items()}
    for name, place in symbolic.items():
        found = MOVING.fullmatch(name)
        member = str(scene.loads[found[1]].member) if found else ""
        if member in mesh.cuts:
            moving.setdefault(member, {})[_beside(scene, name)[1]] = place
        for member, at, there in carried_along(scene, name, place) if SLIDING.fullmatch(name) else ():
            moving.setdefault(member, {})[at] = there
    cuts = dict(mesh.cuts)
    for member, places in moving.items():
        breaks = _knots(scene, member, (ends or {}).get(member, ()))
        there, moved = list(breaks), np.zeros(len(cuts[member]), bool)
        for at, place in places.items():
            number = int(np.argmin(np.abs(breaks - at)))
            there[number] = place
            moved |= (cuts[member] > breaks[number - 1]) & (cuts[member] < breaks[number + 1])
        cuts[member] = np.where(moved, np.interp(cuts[member], breaks, numbers(there)), cuts[member])
    return replace(mesh, cuts=cuts)


def _knots(scene: Scene, member: str, ends: Iterable[float], there: Iterable[float] | None = None) -> Array:
    """Fractions (n,) of the length of a member between which its elements keep their shares: kinks, and ends of lines;
    with ``there`` when these have moved there.
    """
    breaks, ends = breaks_of(scene, member), list(ends)
    knots = np.concatenate([breaks, ends])
    order = np.argsort(knots)
    return (knots if there is None else np.concatenate([breaks, list(there)]))[order]


LEFT = 0.05
"""Share of what is between kinks and ends of lines below which elements there are too short."""


def _beside_end(mesh: Mesh, point: ContactPoint) -> float:
    """Where elements end beside the end of a line."""
    member = point.members[0]
    return float(mesh.cuts[member][mesh.cut_at(member, point.at[0])])


def _check_apart(scene: Scene, arguments: Sequence[Argument]) -> None:
    """Refuse places of loads and tubes on one member that might meet."""
    places = [(one, MOVING.fullmatch(one.name), one.low or 0.0, one.high or 0.0) for one in arguments]
    known = [(str(scene.loads[found[1]].member), low, high, one) for one, found, low, high in places if found]
    for one, _, low, high in places:
        if SLIDING.fullmatch(one.name):
            known += [(*each, one) for each in slid_through(scene, one.name, low, high)]
    known.sort(key=lambda each: each[:2])
    for (member, _, high, one), (other, low, _, after) in pairwise(known):
        if member == other and high >= low and one is not after:
            message = f"found {one.name} and {after.name}, which may meet, accepted: ranges apart from each other"
            raise SceneError(message, ("arguments",))


NEAR = 0.01
"""Share by which numbers differ from those of the scene where its structure is looked at: nothing vanishes there by
chance, and nothing else is another scene."""


class _Part:
    """A vector that depends on numbers in some of its entries.

    Attributes
    ----------
    values : ndarray (n,)
        At the values at which the model was assembled; constant but where it is ``changing``, (n,) bool.
    numbers : ndarray (numbers,)
        Which of the numbers it depends on, bool.
    """

    def __init__(self, flat: Active, symbols: ca.SX, name: str) -> None:
        jacobian = ca.jacobian_sparsity(flat.expression, symbols)
        row, column = (np.array(part, dtype=np.intp) for part in jacobian.get_triplet())
        self.values, self.changing = flat.values, np.isin(np.arange(flat.size), row)
        self.numbers = np.isin(np.arange(symbols.shape[0]), column)
        self._entries = np.flatnonzero(self.changing).tolist()
        self._function = ca.Function(name, [symbols], [flat.expression[self._entries, 0]])

    def at(self, own: ca.MX) -> ca.MX:
        """The vector for values of the numbers."""
        found = ca.MX(ca.DM(self.values))
        if self._entries:
            found[self._entries] = self._function(own)
        return found


def _is_factor(name: str) -> bool:
    return name == FACTOR or bool(re.fullmatch(r"histories\.[^.]+", name))


def _called(name: str, follow: Callable[[Any], Mapping[str, ArrayLike]], value: Any) -> Mapping[str, ArrayLike]:
    """What a function of one's own says for a value, which may be a symbol."""
    try:
        return follow(value)
    except TypeError as error:
        if not isinstance(value, Active):
            raise
        found = f"found a function that takes plain numbers only ({error})"
        accepted = "NumPy's functions, as np.sin in the place of math.sin, and no float(...)"
        raise SceneError(f"{found}, accepted: {accepted}", ("arguments", name)) from None


def _at_values(value: Any) -> Any:
    """A model, or a part of it, with plain numbers in the place of those that depend on symbols."""
    if isinstance(value, (Active, Scene)):
        return value.values if isinstance(value, Active) else _plain_scene(value)
    if isinstance(value, tuple):
        found: Any = tuple(_at_values(each) for each in value)
        return found if any(a is not b for a, b in zip(found, value, strict=True)) else value
    if isinstance(value, Mapping):
        found = {key: _at_values(each) for key, each in value.items()}
        return found if any(found[key] is not value[key] for key in value) else value
    if is_dataclass(value) and not isinstance(value, type):
        parts = {item.name: getattr(value, item.name) for item in fields(value) if item.init}
        changed = {name: now for name, part in parts.items() if (now := _at_values(part)) is not part}
        return replace(value, **changed) if changed else value
    return value


def with_values(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """The scene with other values of numbers, and of lists of numbers, in the plane or in space as before.

    Values are given as for ``parametric``: in a plane scene vectors have two components.

    Raises
    ------
    SceneError
        The scene has no such number, or does not accept the value.
    """
    return with_numbers(scene, single_numbers(scene, values))


def with_numbers(scene: Scene, numbers: Mapping[str, float]) -> Scene:
    """As :func:`with_values`, of single numbers: ``{"nodes.B.position.0": 1.2}``."""
    whole = [name for name in numbers if name != FACTOR and _is_factor(name)]
    if whole:
        raise SceneError(f"{whole[0]}: found a whole history, accepted: its numbers, as histories.NAME.value.0")
    return scene.replace({**numbers, "dimension": scene.resolved_dimension, "expect": ()})


def depending(scene: Scene, numbers: Mapping[str, Any]) -> Scene:
    """As :func:`with_numbers`, with symbols in place of numbers; the scene is not validated again."""
    new = branch_of(numbers, {"dimension": scene.resolved_dimension, "expect": ()})
    carry_ends(scene, new, _unchecked)
    found = with_entries(scene, new, _unchecked)
    assert isinstance(found, Scene)
    # Which is not asked of symbols.
    vars(found)["_out_of_plane"] = scene._out_of_plane
    vars(found)[PLAIN] = scene
    return found


PLAIN = "_plain"
"""Where a scene with symbols keeps the one that it was made of."""


def _plain_scene(scene: Scene) -> Scene:
    return vars(scene).get(PLAIN, scene)


def _unchecked(record: Record, entries: Mapping[str, Any]) -> Record:
    kept = {name: getattr(record, name) for name in type(record).model_fields}
    new = {name_of(type(record), key): value for key, value in entries.items()}
    return type(record).model_construct(record.model_fields_set, **{**kept, **new})
