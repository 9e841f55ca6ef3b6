"""How far answers can be trusted: loads, sizes, ratios and meshes far beyond use; part of ``python -m benchmarks``.

Each line of the table tries a range, compares with a value that is known by itself, and says how breaking is told.
An answer is *wrong* where it counts as solved, says nothing, and is off by more than three times the larger of its
estimate and the accuracy asked for; there must be none.

Source: the pendulum analogy of Kirchhoff for the elastica; B. C. Carlson, Numerical computation of real or complex
elliptic integrals, 1995.
"""

from __future__ import annotations

import re
import resource
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.dynamics.motion import Trajectory
from sfetcas.dynamics.simulation import simulate
from sfetcas.equilibria.solution import Equilibrium
from sfetcas.equilibria.statics import Settings, solve
from sfetcas.errors import SceneError, SolveError, Status
from sfetcas.mathematics import quaternion
from sfetcas.mathematics.arrays import Array
from sfetcas.mathematics.interpolation import lobatto

__all__ = [
    "LINES",
    "Outcome",
    "bars",
    "bend",
    "cantilever",
    "column",
    "column_amplitude",
    "drift",
    "elastica_tip",
    "extremes",
    "flight",
    "four_bar",
    "frame",
    "length_error",
    "material_strip",
    "measured",
    "pendulum",
    "portal",
    "ring",
    "row",
    "series",
    "solve_motion",
    "turned",
    "twisted",
    "with_short_member",
]

SPATIAL = {"EI2": 2.0, "EI3": 1.0, "GJ": 0.7}
"""A section that bends more easily in the plane of the loads."""

SLANTED = quaternion.matrix(quaternion.from_rotation_vector(np.array([0.36, -0.85, 0.61])))
"""A rotation that leaves no axis where it was."""

FLOOR = 1e-12
"""Errors below this are rounding."""

SAID = 3.0
"""An estimate that is off by no more than this said it."""


@dataclass(frozen=True)
class Outcome:
    """What became of one scene.

    Attributes
    ----------
    error : float or None
        Against what is known; None where the scene was refused.
    estimate : float
        What the answer says of its own error, or the accuracy that was asked for, if that is more.
    told : str
        Status, notes or sentence.
    solved : bool
        Whether it counts as solved without a note.
    """

    error: float | None
    estimate: float
    words: str
    solved: bool

    @property
    def wrong(self) -> bool:
        """Whether it is off and says nothing."""
        return self.solved and not (self.error is not None and self.error <= SAID * max(self.estimate, FLOOR))


# -- what is known --------------------------------------------------------------------------------


def carlson(x: float, y: float, z: float) -> tuple[float, float]:
    """Carlson's integrals R_F and R_D, by doubling until the arguments agree."""
    rd, power = 0.0, 1.0
    while max(abs(x - y), abs(y - z), abs(z - x)) > 1e-3 * (x + y + z):
        roots = np.sqrt(x * y) + np.sqrt(y * z) + np.sqrt(z * x)
        rd += power / (np.sqrt(z) * (z + roots))
        x, y, z, power = (0.25 * (x + roots), 0.25 * (y + roots), 0.25 * (z + roots), 0.25 * power)
    mean, middle = (x + y + z) / 3.0, 0.2 * (x + y + 3.0 * z)
    a, b, c = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
    e2, e3 = a * b - c * c, a * b * c
    rf = (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / np.sqrt(mean)
    a, b, c = 1.0 - x / middle, 1.0 - y / middle, 1.0 - z / middle
    ea, eb = a * b, c * c
    ec, ed = ea - eb, ea - 6.0 * eb
    ef = ed + ec + ec
    small = ed * (-3.0 / 14.0 + 9.0 / 88.0 * ed - 4.5 / 26.0 * c * ef) + c * (
        ef / 6.0 + c * (-9.0 / 22.0 * ec + c * 3.0 / 26.0 * ea)
    )
    return float(rf), float(3.0 * rd + power * (1.0 + small) / (middle * np.sqrt(middle)))


def elastica_tip(load: float) -> Array:
    """Tip (x, y, 0) of a cantilever of length 1 under a dead force across it, F L^2/EI: elliptic integrals.

    With sin(theta) = d at the tip, tan^2(psi) = 2 d / (1 - d) and k^2 = (1 + d) / 2 it is sqrt(load) = F(psi, k).
    """
    if load <= 1e-5:
        return np.array([1.0 - load**2 / 15.0, load / 3.0, 0.0])
    if load > 1e5:
        return np.array([np.sqrt(2.0 / load), 1.0 - (2.0 - np.sqrt(2.0)) / np.sqrt(load), 0.0])

    def of(v: float) -> tuple[float, float, float]:
        d, rest = 1.0 / (1.0 + np.exp(-v)), 1.0 / (1.0 + np.exp(v))
        s2, k2 = 2.0 * d / (1.0 + d), 0.5 * (1.0 + d)
        # 1 - k^2 sin^2(psi) is 1 - d, of which nothing is lost.
        rf, rd = carlson(rest / (1.0 + d), rest, 1.0)
        f, s = np.sqrt(s2) * rf, np.sqrt(s2)
        e = f - k2 * s2 * s * rd / 3.0
        return f, 2.0 * (e - k2 * s / np.sqrt(1.0 + d)), d

    low, high = -40.0, 700.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if of(middle)[0] < np.sqrt(load) else (low, middle)
    length, twice, sine = of(0.5 * (low + high))
    return np.array([np.sqrt(2.0 * sine / load), 1.0 - twice / length, 0.0])


def column_amplitude(load: float) -> float:
    """Distance of the tip of a cantilever column of length 1 from its axis under P EI/L^2: 2 k / K(k), K(k)^2 = P."""
    if load <= 0.25 * np.pi**2:
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(200):
        k = 0.5 * (low + high)
        low, high = (k, high) if carlson(0.0, 1.0 - k * k, 1.0)[0] < np.sqrt(load) else (low, k)
    return float(2.0 * k / np.sqrt(load))


def _arc(curvature: float, length: float, heading: float = 0.0) -> Array:
    """End of an arc that starts at the origin."""
    half = 0.5 * curvature * length
    return length * np.sinc(half / np.pi) * np.array([np.cos(heading + half), np.sin(heading + half), 0.0])


# -- scenes ---------------------------------------------------------------------------------------


def turned(vector: Iterable[float], space: bool) -> list[float]:
    """A vector of a plane scene, in space turned out of all planes."""
    v = np.append(np.asarray(list(vector), float), 0.0)[:3]
    return (SLANTED @ v if space else v).tolist()


def _scene(space: bool, nodes: dict[str, Any], loads: dict[str, Any], section: dict[str, Any], **more: Any) -> Scene:
    """One member ``m`` from A, clamped, to B."""
    member = {"nodes": ["A", "B"], "section": "s", "b2": turned([0, 1, 0], space), **more.pop("member", {})}
    table = {"dimension": "space" if space else "plane", "sections": {"s": section}, "nodes": nodes, "loads": loads}
    return Scene.from_dict({**table, "members": {"m": member}, **more})


def cantilever(
    force: float, space: bool = False, *, moment: float = 0.0, length: float = 1.0, unit: float = 1.0, **member: Any
) -> Scene:
    """A cantilever under ``force`` EI/L^2 across it and ``moment`` EI/L, EI = ``unit`` N times L^2."""
    section = {key: unit * length**2 * value for key, value in SPATIAL.items()}
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": turned([length, 0, 0], space)}}
    loads: dict[str, Any] = {}
    if force:
        loads["f"] = {"type": "force", "node": "B", "value": turned([0, unit * force, 0], space)}
    if moment:
        loads["m"] = {"type": "moment", "node": "B", "value": turned([0, 0, unit * length * moment], space)}
    return _scene(space, nodes, loads, section, member=member)


def material_strip(slenderness: float, shape: str, force: float) -> Scene:
    """A steel cantilever of length 1 m given by material and section, in space, under ``force`` EI/L^2."""
    t = 1.0 / slenderness
    form = {"radius": 0.5 * t} if shape == "circle" else {"width": 2.0 * t, "height": t}
    inertia = np.pi * t**4 / 64.0 if shape == "circle" else 2.0 * t**4 / 12.0
    section = {"shape": shape, "E": 2.1e11, "nu": 0.3, **form}
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": [1, 0, 0]}}
    loads = {"f": {"type": "force", "node": "B", "value": [0, 2.1e11 * inertia * force, 0]}}
    table = {"dimension": "space", "sections": {"s": section}, "nodes": nodes, "loads": loads}
    return Scene.from_dict({**table, "members": {"m": {"nodes": ["A", "B"], "section": "s", "b2": [0, 1, 0]}}})


def series(ratio: float, space: bool) -> tuple[Scene, Array]:
    """Two members one after the other, EI as 1 to ``ratio``, under an end moment: two arcs, and where C ends."""
    softest = min(1.0, ratio)
    places = (("A", 0.0), ("B", 0.5), ("C", 1.0))
    nodes: dict[str, Any] = {name: {"position": turned([x, 0, 0], space)} for name, x in places}
    nodes["A"]["support"] = "clamped"
    members = {"1": {"nodes": ["A", "B"], "section": "one"}, "2": {"nodes": ["B", "C"], "section": "two"}}
    table = {
        "dimension": "space" if space else "plane",
        "sections": {n: {"EI2": e, "EI3": e, "GJ": e} for n, e in (("one", 1.0), ("two", ratio))},
        "nodes": nodes,
        "members": members,
        "loads": {"m": {"type": "moment", "node": "C", "value": turned([0, 0, 2.0 * softest], space)}},
    }
    first, second = 2.0 * softest, 2.0 * softest / ratio
    end = _arc(first, 0.5) + _arc(second, 0.5, 0.5 * first)
    return Scene.from_dict(table), np.array(turned(end, space))


def portal(ratio: float, space: bool, sway: float = 1e-5) -> Scene:
    """A square portal frame, EI of beam to columns, pushed sideways at both corners to a linear sway."""
    push = 0.5 * sway * 24.0 * (6.0 * ratio + 1.0) / (6.0 * ratio + 4.0)
    places = {"A": [0, 0, 0], "B": [0, 1, 0], "C": [1, 1, 0], "D": [1, 0, 0]}
    nodes: dict[str, Any] = {name: {"position": turned(place, space)} for name, place in places.items()}
    nodes["A"]["support"] = nodes["D"]["support"] = "clamped"
    bars = {"ab": "column", "bc": "beam", "cd": "column"}
    table = {
        "dimension": "space" if space else "plane",
        "sections": {n: {"EI2": e, "EI3": e, "GJ": e} for n, e in (("column", 1.0), ("beam", ratio))},
        "nodes": nodes,
        "members": {n: {"nodes": list(n.upper()), "section": s} for n, s in bars.items()},
        "loads": {n: {"type": "force", "node": n, "value": turned([push, 0, 0], space)} for n in "BC"},
    }
    return Scene.from_dict(table)


def bend(name: str, ratio: float, deflection: float = 1e-5) -> Scene:
    """A quarter circle of radius 1 with one stiffness ``ratio`` times the others, lifted out of its plane.

    The force is that of Castigliano's theorem, pi/4 / EI2 + (3 pi/4 - 2) / GJ, for a deflection.
    """
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, name: ratio}
    give = 0.25 * np.pi / section["EI2"] + (0.75 * np.pi - 2.0) / section["GJ"]
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": turned([1, 1, 0], True)}}
    loads = {"f": {"type": "force", "node": "B", "value": turned([0, 0, deflection / give], True)}}
    # The arc begins along x: b2 towards its centre, b3 across its plane.
    member = {"shape": {"type": "arc", "angle": 0.5 * np.pi, "normal": turned([0, 0, 1], True)}}
    return _scene(True, nodes, loads, section, member=member)


def frame(length: float, force: float) -> Scene:
    """A bent elbow in space with clamped feet, sizes in units of length and force."""
    places = {"A": [0, 0, 0], "B": [0.2, 0.1, 1.0], "C": [1.0, 0.7, 0.6]}
    nodes: dict[str, Any] = {n: {"position": (length * np.array(p)).tolist()} for n, p in places.items()}
    nodes["A"]["support"] = nodes["C"]["support"] = "clamped"
    table = {
        "dimension": "space",
        "sections": {"s": {key: force * length**2 * value for key, value in SPATIAL.items()}},
        "nodes": nodes,
        "members": {
            "1": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 1.0, "normal": [1, 2, -0.4]}},
            "2": {"nodes": ["B", "C"], "section": "s", "shape": {"type": "arc", "angle": 0.8, "normal": [1, 0, 2]}},
        },
        "loads": {"f": {"type": "force", "node": "B", "value": [3.0 * force, -2.0 * force, 1.0 * force]}},
    }
    return Scene.from_dict(table)


def with_short_member(share: float, push: float, across: float) -> Scene:
    """A cantilever of length 1 + share of three members, the middle one ``share`` long, under forces of 1/L^2."""
    length = 1.0 + share
    nodes: dict[str, Any] = {n: {"position": [x, 0]} for n, x in zip("ABCD", (0.0, 0.5, 0.5 + share, length))}
    nodes["A"]["support"] = "clamped"
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": nodes,
        "members": {n: {"nodes": list(n), "section": "s"} for n in ("AB", "BC", "CD")},
        "loads": {"f": {"type": "force", "node": "D", "value": [-push / length**2, across / length**2]}},
    }
    return Scene.from_dict(table)


def ring(gap: float, space: bool) -> tuple[Scene, Array]:
    """An arc of 2 pi - ``gap``, clamped at one end, under a moment at the other; and where that ends."""
    angle = 2.0 * np.pi - gap
    end = np.array([np.sin(angle), 1.0 - np.cos(angle), 0.0])
    # Radius and heading follow from the ends, which are rounded.
    radius = np.hypot(*end[:2]) / (2.0 * np.sin(0.5 * angle))
    begin = np.arctan2(end[1], end[0]) - 0.5 * angle
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": end.tolist()}}
    loads = {"m": {"type": "moment", "node": "B", "value": [0, 0, 0.3]}}
    table = {"dimension": "space" if space else "plane", "sections": {"s": SPATIAL}, "nodes": nodes, "loads": loads}
    member = {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": angle}}
    return Scene.from_dict({**table, "members": {"m": member}}), _arc(1.0 / radius + 0.3, radius * angle, begin)


def four_bar(offset: float, kind: str, drive: float = -1.0) -> tuple[Scene, Array]:
    """A crank that is driven from ``offset`` before the dead point of its four-bar, and where C comes to."""
    ground, coupler, rocker = np.array([1.7, 0.0]), 1.2, 0.9

    def corners(angle: float) -> tuple[Array, Array]:
        b = 0.4 * np.array([np.cos(angle), np.sin(angle)])
        reach = ground - b
        d = np.hypot(*reach)
        along = (coupler**2 - rocker**2 + d**2) / (2.0 * d)
        across = np.sqrt(max(coupler**2 - along**2, 0.0))
        return b, b + (along * reach + across * np.array([-reach[1], reach[0]])) / d

    b, c = corners(np.pi - offset)
    nodes = {
        "A": {"position": [0, 0], "support": "hinge"},
        "B": {"position": b.tolist(), "joint": "hinge"},
        "C": {"position": c.tolist(), "joint": "hinge"},
        "D": {"position": ground.tolist(), "support": "hinge"},
    }
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": nodes,
        "members": {n: {"nodes": list(n.upper()), "type": kind, "section": "s"} for n in ("ab", "bc", "cd")},
        "motions": {"crank": {"node": "A", "rotation": drive}},
    }
    return Scene.from_dict(table), np.append(corners(np.pi - offset + drive)[1], 0.0)


def bars(rise: float, kind: str) -> Scene:
    """Two bars hinged between hinges 2 apart, ``rise`` from a straight line, drawn away from it by 1 N."""
    nodes = {
        "A": {"position": [0, 0], "support": "hinge"},
        "B": {"position": [1, -rise], "joint": "hinge"},
        "C": {"position": [2, 0], "support": "hinge"},
    }
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": nodes,
        "members": {n: {"nodes": list(n), "type": kind, "section": "s"} for n in ("AB", "BC")},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, -1.0]}},
    }
    return Scene.from_dict(table)


def column(beyond: float, section: dict[str, float], space: bool) -> Scene:
    """A cantilever column under (1 + beyond) times its critical load."""
    nodes = {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": turned([1, 0, 0], space)}}
    push = -0.25 * np.pi**2 * (1.0 + beyond)
    loads = {"f": {"type": "force", "node": "B", "value": turned([push, 0, 0], space)}}
    return _scene(space, nodes, loads, section)


def twisted(turns: float, element: str | None, elements: int | None) -> Scene:
    """A taut straight rod in space, one end of which is turned about its axis: twist by 2 pi turns GJ/L."""
    nodes = {
        "A": {"position": [0, 0, 0], "support": "clamped"},
        "B": {"position": [1, 0, 0], "support": "slider", "direction": [1, 0, 0]},
    }
    loads = {"f": {"type": "force", "node": "B", "value": [200.0, 0, 0]}}
    motions = {"turn": {"node": "B", "rotation": [2.0 * np.pi * turns, 0, 0]}}
    member = {"nodes": ["A", "B"], "section": "s"}
    member |= {} if element is None else {"element": element, "elements": elements}  # type: ignore[dict-item]
    table = {"dimension": "space", "sections": {"s": {"EI2": 100.0, "EI3": 100.0, "GJ": 1.0}}, "nodes": nodes}
    return Scene.from_dict({**table, "loads": loads, "motions": motions, "members": {"m": member}})


def flight(space: bool, steps: int, step: float = 1e-2) -> Scene:
    """A rod that turns and bends in free flight, one element SFET3, by the conserving integrator.

    It stays near the origin: rounding of a place far away, over a step, is that of the velocity.
    """
    up = [-0.35, 0.3501]
    nodes = {
        n: {"position": [x, 0, 0], "velocity": [0, v, 0.4 * (x - 0.5) * space]} for n, x, v in zip("AB", (0.0, 1.0), up)
    }
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0, "rhoA": 1.0, "rhoI": [2e-3, 1e-3, 1e-3]}
    end = steps * step
    analysis = {"type": "dynamic", "end": end, "step": step, "output": end / 20.0, "integrator": "conserving"}
    member = {"nodes": ["A", "B"], "section": "s", "element": "SFET3", "elements": 1}
    table = {"dimension": "space" if space else "plane", "sections": {"s": section}, "nodes": nodes}
    return Scene.from_dict({**table, "members": {"m": member}, "analysis": analysis})


def pendulum(step: float, end: float, integrator: str) -> Scene:
    """A flexible rod that falls from level, by steps of a prescribed length."""
    nodes = {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}}
    analysis = {"type": "dynamic", "end": end, "step": step, "output": end, "integrator": integrator}
    member = {"nodes": ["A", "B"], "section": "s", "element": "SFET4", "elements": 2}
    table = {"gravity": [0, -9.81], "sections": {"s": {"EI3": 1.0, "rhoA": 1.0}}, "nodes": nodes}
    return Scene.from_dict({**table, "members": {"m": member}, "analysis": analysis})


# -- what is measured -----------------------------------------------------------------------------

DOUBTS = ("is not told", "change point", "section moments differ", "branch off there")
"""Words of the notes that say that an answer may be another one."""


def measured(scene: Scene, error: Callable[[Equilibrium], float], allowed: float = FLOOR, **settings: Any) -> Outcome:
    """A scene solved and compared; ``allowed`` is what the comparison itself is off by."""
    try:
        solution = solve(scene, Settings(**settings))
    except (SceneError, SolveError) as refusal:
        return Outcome(None, 0.0, f"refused: {refusal}", False)
    step = solution.last
    words = [note for note in step.notes if any(word in note for word in DOUBTS)]
    words += ["neutral"] if step.certificate.stable == "neutral" else []
    words += [solution.status.value] if solution.status is not Status.SOLVED else []
    estimate = max(step.certificate.error_estimate or 0.0, allowed)
    return Outcome(error(step), estimate, "; ".join(words) or "solved", not words)


def _at(node: str, place: Array) -> Callable[[Equilibrium], float]:
    """Distance of a node from where it is to be, over the size of the scene."""
    return lambda step: float(np.linalg.norm(step.position(node) - place)) / step.model.scene.size


def _along(node: str, way: list[float], value: float) -> Callable[[Equilibrium], float]:
    """How far the place of a node along a direction is off."""
    return lambda step: abs(float(step.position(node) @ np.array(way)) - value)


def _aside(node: str, axis: list[float], distance: float) -> Callable[[Equilibrium], float]:
    """How far its distance from an axis through the origin is off."""
    return lambda step: abs(float(np.linalg.norm(np.cross(step.position(node), axis))) - distance)


def _reacts(node: str, component: int, value: float) -> Callable[[Equilibrium], float]:
    """How far a component of its reaction, force and moment, is off, relative."""
    return lambda step: abs(float(np.concatenate(step.reaction(node))[component]) / value - 1.0)


def _like(places: dict[str, Array], length: float) -> Callable[[Equilibrium], float]:
    """How far the scene is from another one in units of its length."""
    return lambda step: max(float(np.abs(step.position(n) / length - p).max()) for n, p in places.items())


def length_error(step: Equilibrium) -> float:
    """Of the member m, along x undeformed in its own plane: tangents not of length one, positions not their integral.

    Over its length; the integral is by the rule of the elements, from cut to cut.
    """
    cuts, (nodes, weights) = step.model.mesh.cuts["m"], lobatto(step.model.element.order + 1)
    steps = np.diff(cuts)
    line = step.model.scene.center_lines["m"]
    begin = quaternion.matrix(line.quaternions([0.0]))[0][:, 0]
    found = step.along("m", (cuts[:-1, None] + steps[:, None] * nodes).ravel())["quaternion"]
    tangents = (quaternion.matrix(found) @ begin).reshape(len(steps), len(nodes), 3)
    reach = line.length * np.cumsum(np.einsum("e,k,eka->ea", steps, weights, tangents), axis=0)
    apart = np.abs(step.along("m", cuts[1:])["position"] - step.position("A") - reach).max() / line.length
    return float(max(apart, np.abs(np.linalg.norm(tangents, axis=2) - 1.0).max()))


BOTH = (False, True)


def loads() -> Iterator[Outcome]:
    """Forces across a cantilever from 1e-8 to 1e8 EI/L^2."""
    for exponent in range(-8, 9):
        for space in BOTH:
            tip = np.array(turned(elastica_tip(10.0**exponent), space))
            yield measured(cantilever(10.0**exponent, space), _at("B", tip))


def lengths() -> Iterator[Outcome]:
    """The same: what is inextensible stays so."""
    for exponent in range(-8, 9, 2):
        for space in BOTH:
            yield measured(cantilever(10.0**exponent, space), length_error)


def rolls() -> Iterator[Outcome]:
    """Rolling up by 1e-3 to 200 turns."""
    for turns in (1e-3, 0.1, 0.5, 1.0, 3.0, 10.0, 50.0, 200.0):
        for space in BOTH:
            moment = 2.0 * np.pi * turns
            yield measured(cantilever(0.0, space, moment=moment), _at("B", np.array(turned(_arc(moment, 1.0), space))))


def slender() -> Iterator[Outcome]:
    """Sections by material, length over thickness from 5 to 1e6."""
    for slenderness in (5.0, 50.0, 1e3, 1e4, 1e5, 1e6):
        for shape in ("rectangle", "circle"):
            for force in (1e-2, 1.0, 30.0):
                scene = material_strip(slenderness, shape, force)
                yield measured(scene, _at("B", elastica_tip(force)))


def stiff() -> Iterator[Outcome]:
    """Stiffness ratios from 1e-12 to 1e12 one after the other, and in a frame."""
    for exponent in range(-12, 13, 3):
        for space in BOTH:
            scene, place = series(10.0**exponent, space)
            yield measured(scene, _at("C", place))
            # The corner is at y = 1 along x.  The frame is linear but for the square of the sway of 1e-5.
            yield measured(portal(10.0**exponent, space), _along("B", turned([1, 0, 0], space), 1e-5), 1e-10)


def unlike() -> Iterator[Outcome]:
    """EI2, EI3, GJ from 1e-6 to 1e6 of each other on a quarter circle."""
    for name in SPATIAL:
        for exponent in range(-6, 7, 2):
            scene = bend(name, 10.0**exponent)
            # Linear but for squares of the deflection of 1e-5 and what one stiffness is to the other: measured.
            yield measured(scene, _along("B", turned([0, 0, 1], True), 1e-5), 1e-10)


def sizes() -> Iterator[Outcome]:
    """From 1e-9 to 1e9 m, uN to MN."""
    places = {n: solve(frame(1.0, 1.0)).last.position(n) for n in "ABC"}
    for length in (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9):
        for force in (1e-6, 1.0, 1e6):
            yield measured(frame(length, force), _like(places, length))


def coarse() -> Iterator[Outcome]:
    """One element of each kind."""
    for order in range(2, 10):
        for force in (1.0, 10.0, 1000.0):
            for space in BOTH:
                tip = np.array(turned(elastica_tip(force), space))
                yield measured(cantilever(force, space, element=f"SFET{order}", elements=1), _at("B", tip))


def fine() -> Iterator[Outcome]:
    """1e4 and 1e5 elements in one member."""
    for space, element, count in ((False, "SFET2", 10_000), (False, "SFET5", 10_000), (True, "SFET5", 10_000),
                                  (False, "SFET2", 100_000), (True, "SFET2", 100_000)):  # fmt: skip
        tip, begin = np.array(turned(elastica_tip(10.0), space)), time.perf_counter()
        found = measured(cantilever(10.0, space, element=element, elements=count), _at("B", tip))
        seconds = time.perf_counter() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        where = "space" if space else "plane"
        words = f"{found.words}, {where}, {count} {element}: {seconds:.1f} s, {memory:.1f} GB"
        yield Outcome(found.error, found.estimate, words, found.solved)


def graded() -> Iterator[Outcome]:
    """A member 1e-1 to 1e-12 as long as those beside it, under a force across and one that buckles."""
    for exponent in range(1, 13):
        share = 10.0**-exponent
        tip = (1.0 + share) * elastica_tip(10.0)
        yield measured(with_short_member(share, 0.0, 10.0), _at("D", tip))
        amplitude = (1.0 + share) * column_amplitude(1.2 * 0.25 * np.pi**2)
        scene = with_short_member(share, 1.2 * 0.25 * np.pi**2, 0.0)
        yield measured(scene, _aside("D", [1, 0, 0], amplitude))


def rings() -> Iterator[Outcome]:
    """Arcs of 2 pi less 1 to 1e-15."""
    for exponent in range(16):
        for space in BOTH:
            scene, end = ring(10.0**-exponent, space)
            yield measured(scene, _at("B", end))


def dead_points() -> Iterator[Outcome]:
    """Four-bars that begin 1e-1 to 1e-14 rad from their dead point."""
    for exponent in (1, 2, 3, 4, 6, 8, 10, 12, 14):
        for kind in ("rigid", "flexible", "small"):
            scene, place = four_bar(10.0**-exponent, kind)
            yield measured(scene, _at("C", place))


def straight() -> Iterator[Outcome]:
    """Two bars 1e-1 to 1e-12 from a straight line: F/(2 tan) along each."""
    for exponent in range(1, 13):
        for kind in ("rigid", "flexible"):
            rise = 10.0**-exponent
            # A length of 1 that is rounded to 1e-16 tells a rise only to 1e-16 over its square.
            blur = FLOOR + 1e-15 / rise**2
            yield measured(bars(rise, kind), _reacts("A", 0, -0.5 / rise), blur)


def columns() -> Iterator[Outcome]:
    """Columns 1e-1 to 1e-12 of their critical load below and above it."""
    sections = ({"EI3": 1.0}, {"EI2": 5.0, "EI3": 1.0, "GJ": 1.0}, {"EI2": 1.0, "EI3": 1.0, "GJ": 1.0})
    for beyond in (-1e-2, -1e-6, -1e-8, 0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.1):
        for section in sections:
            space = len(section) > 1
            amplitude = column_amplitude(0.25 * np.pi**2 * (1.0 + beyond))
            scene = column(beyond, section, space)
            yield measured(scene, _aside("B", turned([1, 0, 0], space), amplitude), accuracy=1e-8)


def turns() -> Iterator[Outcome]:
    """Twist by 0.1 to 50 turns between nodes far apart."""
    for amount in (0.1, 0.3, 0.6, 1.0, 1.3, 2.0, 3.0, 5.0, 20.0, 50.0):
        given = [(f"SFET{n}", k) for n in (2, 3, 5, 9) for k in (1, 2)] if amount <= 5.0 else []
        for element, count in [(None, None), *given]:
            # What is compared is the moment, of which the estimate says nothing, but a note from a tenth on.
            scene = twisted(amount, element, count)
            yield measured(scene, _reacts("B", 3, 2.0 * np.pi * amount), 0.1 / SAID)


def drift(motion: Trajectory) -> float:
    """How far energy and momenta of later answers are from those of the first tenth of them, relative."""
    energies = motion.energies()[1:]
    momenta = np.array([np.append(s.momentum["linear"], s.momentum["angular"]) for s in motion.steps[1:]])
    tenth = max(1, len(energies) // 10)
    apart = [np.abs(v - v[:tenth].mean(axis=0)).max() / np.abs(v).max() for v in (energies, momenta)]
    return float(max(apart))


def flights() -> Iterator[Outcome]:
    """Steps of the conserving integrator, up to a million."""
    for space, steps in ((False, 10_000), (True, 10_000), (False, 1_000_000)):
        begin = time.perf_counter()
        motion = solve_motion(flight(space, steps))
        seconds = time.perf_counter() - begin
        words = f"{'space' if space else 'plane'}, {steps} steps: {seconds:.0f} s"
        # An angle that counts its turns is rounded the more the further it is, and these add up as a random walk.
        yield Outcome(drift(motion), 1e-15 * steps**1.5, words, True)


def solve_motion(scene: Scene) -> Trajectory:
    """A motion, without conditions that end it."""
    return simulate(scene, Settings())


def steps() -> Iterator[Outcome]:
    """Prescribed steps from 1e-9 to 1e6 s for a pendulum that swings in 2 s."""
    reference = solve_motion(pendulum(2e-4, 0.2, "radau-3")).last.position("B")
    for method in ("radau-3", "radau-2", "generalised-alpha", "conserving"):
        for step in (1e-9, 1e-6, 1e-3, 1e-2, 0.1, 0.2, 1.0, 1e2, 1e6):
            end = 20.0 * step if step < 1e-5 else 5.0 * step if step > 0.2 else 0.2
            try:
                motion = solve_motion(pendulum(step, end, method))
            except SolveError as refusal:
                yield Outcome(None, 0.0, f"refused: {refusal}", False)
                continue
            # From rest it falls by less than g t^2 in so short a time, and stays at its length in any.
            error = float(np.linalg.norm(motion.last.position("B") - reference)) if end == 0.2 else 0.0
            if end < 0.2:
                error = max(0.0, float(np.linalg.norm(motion.last.position("B") - [1.0, 0, 0])) - 9.81 * 1.5 * end**2)
            yield Outcome(error, 5e-2 * step, "; ".join(motion.notes) or "solved", not motion.notes)


LINES: dict[str, tuple[str, Callable[[], Iterable[Outcome]]]] = {
    "tip forces of 1e-8 to 1e8 EI/L², plane, space": ("elliptic integrals", loads),
    "the same: length, tangents, their integral": ("length 1", lengths),
    "rolling up by 1e-3 to 200 turns, plane, space": ("arcs", rolls),
    "length over thickness 5 to 1e6, rectangle, circle": ("elliptic integrals", slender),
    "stiffness ratio 1e-12 to 1e12, in line, in a frame": ("arcs; linear frame", stiff),
    "EI2, EI3, GJ each 1e-6 to 1e6 of the others": ("Castigliano's theorem", unlike),
    "sizes 1e-9 to 1e9 m, forces 1e-6 to 1e6 N": ("the frame of 1 m, 1 N", sizes),
    "one element SFET2 to SFET9, 1 to 1000 EI/L²": ("elliptic integrals", coarse),
    "1e4 and 1e5 elements, 10 EI/L²": ("elliptic integrals", fine),
    "members 1e-1 to 1e-12 of those beside them": ("elliptic integrals", graded),
    "arcs of 2 pi less 1 to 1e-15": ("arcs", rings),
    "four-bars from 1e-1 to 1e-14 rad off their dead point": ("kinematics", dead_points),
    "two bars 1e-1 to 1e-12 off a straight line": ("forces by statics", straight),
    "columns within 1e-1 to 1e-8 of their critical load": ("elliptic integrals", columns),
    "twist of 0.1 to 50 turns, one or two elements, its own": ("moment GJ times twist", turns),
    "10,000 and 1,000,000 conserving steps": ("energy and momenta at first", flights),
    "prescribed steps of 1e-9 to 1e6 s, period 2 s": ("short steps", steps),
}
"""What is tried, with what is compared, and how."""

SHORT = re.compile(
    r" \((?!estimate).*|: from such .*| by \d+ %.*|^loads without .*; | are below zero: .*|(?<=the step is so short).*"
)
"""What the table leaves out of sentences: figures and advice."""


def row(tried: str, compared: str, outcomes: Iterable[Outcome]) -> str:
    """One line of the table."""
    found = list(outcomes)
    silent = [outcome for outcome in found if outcome.solved and outcome.error is not None]
    worst = max(silent, key=lambda outcome: outcome.error or 0.0, default=None)
    said = Counter(SHORT.sub("", outcome.words) for outcome in found if outcome.words != "solved")
    words = [f"{count} {words}" if count > 1 else words for words, count in said.most_common()]
    wrong = sum(outcome.wrong for outcome in found)
    cells = [
        tried,
        compared,
        "-" if worst is None else f"{worst.error:.0e} (estimate {worst.estimate:.0e})",
        f"{len(silent)} of {len(found)}" + (f", {wrong} WRONG" if wrong else ""),
        "; ".join(words) or "-",
    ]
    return f"| {' | '.join(cells)} |"


def extremes() -> None:
    """All lines."""
    print("| tried | compared with | worst error | solved | else told |\n|---|---|---|---|---|")
    for tried, (compared, line) in LINES.items():
        print(row(tried, compared, line()), flush=True)
