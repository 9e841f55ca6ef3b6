"""Answers looked at from outside: balance of every part, equations of a beam, the same scene otherwise.

Nothing here reads the equations that were solved: what acts is taken from the scene, and what an answer says of its
nodes and members has to fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from sfetcas.description.scene import Load, Scene
from sfetcas.description.sections import breaks, evaluate
from sfetcas.description.structure import SLIDING
from sfetcas.equilibria.solution import Equilibrium
from sfetcas.equilibria.statics import solve
from sfetcas.errors import SceneError, SolveError
from sfetcas.mathematics.arrays import Array
from sfetcas.mathematics.quaternion import conjugate, from_rotation_vector, matrix, multiply, rotate

from .random_scenes import reordered, transformed

__all__ = ["VARIANTS", "Defects", "Pushed", "Variant", "compared", "defects", "variant", "wrong"]

Pushed = dict[str, list[tuple[float, Array]]]

GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(8)

SUBSTEPS = 24
"""Steps of Runge and Kutta in an element: 1e-7 of an element that turns by 1 rad."""

PLACES = np.linspace(0.0, 1.0, 9)
"""Where answers are compared along members."""


@dataclass(frozen=True)
class Defects:
    """By what an answer misses, at worst.

    Attributes
    ----------
    forces, moments : of each member and of each node, over the largest force, and over that times the size
    ends : of members from their nodes, over the size
    turned : rad, of rigidly joined ends from their nodes
    springs : between what springs give and what their travel says, over the largest force or moment
    beams : places at the end of an element from where the differential equations lead to from its start, over the size
    bends : the same of rotations, rad
    """

    forces: float
    moments: float
    ends: float
    turned: float
    springs: float
    beams: float
    bends: float


def defects(step: Equilibrium, scene: Scene | None = None, pushed: Pushed | None = None) -> Defects:
    """How far an answer is from balance, from its nodes and from the differential equations of a beam.

    Parameters
    ----------
    step : Equilibrium
    scene : Scene, optional
        What acts and what resists; left out, that of the answer.
    pushed : dict of str to list of (float, (3,)), optional
        Forces on members at fractions of their lengths, N, besides the loads of the scene.
    """
    return _Looked(step, step.model.scene if scene is None else scene, pushed or {}).all()


def wrong(step: Equilibrium) -> list[str]:
    """What is wrong with an answer, nothing where all fits."""
    found, proof = defects(step), step.certificate
    estimate = proof.error_estimate or 0.0
    limits = {
        # Residuals are below 1e-9 of what is added up.
        "forces": 1e-8,
        # Levers of what is spread: within elements positions are less right than at their ends, where the estimate is.
        "moments": max(0.1 * step.model.scene.analysis.accuracy, estimate),
        "ends": 1e-8,
        "turned": 1e-8,
        "springs": 1e-8,
        # 1e-6 is what Runge and Kutta leave of elements that turn by 1 rad and more.
        "beams": max(1e-6, estimate),
        # Over a tenth of the size an angle of this moves an end by the accuracy.
        "bends": 1e-3,
    }
    figures = {name: value for name, value in asdict(found).items() if not value <= limits[name]}
    words = [f"{name} {value:.1e}" for name, value in figures.items()]
    words += ["unstable"] if proof.stable is False and step.model.scene.analysis.unstable == "leave" else []
    return words + ([f"residual {proof.residual:.1e}"] if not proof.residual <= 1e-9 else [])


# The same scene otherwise


@dataclass(frozen=True)
class Variant:
    """The same scene otherwise: how it was changed, and with which settings it is solved."""

    scene: Scene
    settings: dict[str, Any] = field(default_factory=dict)
    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 1.0
    energy: float = 1.0

    def there(self, place: Array) -> Array:
        """Where a place of the first scene is in this one."""
        return np.asarray(self.length * (self.turn @ place + self.shift))

    def back(self, place: Array) -> Array:
        """The same the other way."""
        return np.asarray(self.turn.T @ (place / self.length - self.shift))


def _moved(scene: Scene, step: Equilibrium, rng: np.random.Generator) -> Variant:
    space = scene.resolved_dimension == "space"
    turn = matrix(from_rotation_vector(rng.uniform(-3.0, 3.0, size=3) * [space, space, 1.0]))
    shift = scene.size * rng.uniform(-1.0, 1.0, size=3) * [1, 1, space]
    length, force = 10.0 ** rng.uniform(-3.0, 3.0, size=2)
    table = transformed(scene.to_dict(), turn, shift.tolist(), length, force)
    return Variant(Scene.from_dict(table), {}, turn, shift, length, force * length)


def _reordered(scene: Scene, step: Equilibrium, rng: np.random.Generator) -> Variant:
    return Variant(Scene.from_dict(reordered(scene.to_dict(), int(rng.integers(1000)))))


def _assembled(scene: Scene, step: Equilibrium, rng: np.random.Generator) -> Variant:
    return Variant(scene, {"assembly": "nodal" if step.model.assembly == "closing" else "closing"})


def _gauss(scene: Scene, step: Equilibrium, rng: np.random.Generator) -> Variant:
    return Variant(scene, {"gauss": True})


def _in_space(scene: Scene, step: Equilibrium, rng: np.random.Generator) -> Variant:
    table = scene.to_dict() | {"dimension": "space"}
    motions = {name: dict(motion) for name, motion in table.get("motions", {}).items()}
    for motion in motions.values():
        # What turns a clamped node is a vector in space.
        if np.isscalar(motion.get("rotation")) and scene.nodes[motion["node"]].turn == "fixed":
            motion["rotation"] = [0.0, 0.0, motion["rotation"]]
    return Variant(Scene.from_dict(table | {"motions": motions}))


VARIANTS: dict[str, Callable[[Scene, Equilibrium, np.random.Generator], Variant]] = {
    "moved": _moved,
    "reordered": _reordered,
    "assembly": _assembled,
    "gauss": _gauss,
    "space": _in_space,
}
"""The scene turned, moved and in other units, in another order, the other assembly, the other integration, in space."""


def variant(name: str, scene: Scene, step: Equilibrium, seed: int = 0) -> Variant:
    """A scene otherwise, by one of ``VARIANTS``; ``space`` is for scenes in the plane."""
    return VARIANTS[name](scene, step, np.random.default_rng(seed))


def compared(step: Equilibrium, other: Variant) -> str:
    """What the same scene otherwise says of an answer.

    Returns
    -------
    str
        ``same``; ``another equilibrium`` where both are equilibria of one model, have the same energy (mirrored states,
        or one of a family that nothing holds), or say that the way from zero was lost or jumped; ``unstable in
        space`` where the answer of the plane is; ``refused: ...``, ``wrong: ...``, or ``differs by ...``.
    """
    try:
        found = solve(other.scene, **other.settings).last
    except (SceneError, SolveError) as error:
        return f"refused: {error}"
    bad = wrong(found)
    if bad:
        return f"wrong: {', '.join(bad)}"
    if _same(step, found, other):
        return "same"
    if other.scene.resolved_dimension != step.model.dimension and _unstable_there(step, other):
        return "unstable in space"
    kinds = f"{step.certificate.stable}, {found.certificate.stable}"
    if _level(step, found, other):
        return f"another equilibrium (of the same energy; {kinds})"
    notes = [note for answer in (step, found) for note in answer.notes]
    for words, way in (("could not be followed", "the way from zero was lost"), ("jumped", "a jump on the way")):
        if any(words in note for note in notes):
            return f"another equilibrium ({way}; {kinds})"
    # Started from where the other one has its nodes each model may find that one too: then both are equilibria.
    mine = _from(other.scene, {n: other.there(step.position(n)) for n in other.scene.nodes}, other.settings)
    its = _from(step.model.scene, {n: other.back(found.position(n)) for n in other.scene.nodes}, {})
    if (mine is not None and _same(step, mine, other)) or (its is not None and _same(its, found, other)):
        energies = f"{step.energy['total']:.6g} and {found.energy['total'] / other.energy:.6g}"
        return f"another equilibrium (of both models; {kinds}; energies {energies})"
    return f"differs by {_apart(step, found, other):.1e} of the size"


def _apart(one: Equilibrium, other: Equilibrium, how: Variant) -> float:
    """Largest distance of the members of two answers, of the scene and of its variant, over the size."""
    worst = 0.0
    for name in one.model.scene.members:
        mine, its = (step.along(name, PLACES)["position"] for step in (one, other))
        worst = max(worst, float(np.abs([how.there(place) for place in mine] - its).max()))
    return worst / (one.model.scene.size * how.length)


def _same(one: Equilibrium, other: Equilibrium, how: Variant) -> bool:
    estimates = (one.certificate.error_estimate or 0.0) + (other.certificate.error_estimate or 0.0)
    # Each is right to its estimate; rounding leaves less than a millionth.
    return _apart(one, other, how) <= estimates + 1e-6


def _level(one: Equilibrium, other: Equilibrium, how: Variant) -> bool:
    """Whether energies are the same: they differ by the square of what the estimates allow, and by rounding."""
    sizes = [abs(value) for value in one.energy.values()]
    return abs(one.energy["total"] - other.energy["total"] / how.energy) <= 1e-6 * max(sizes)


def _from(scene: Scene, places: dict[str, Array], settings: dict[str, Any]) -> Equilibrium | None:
    """The answer from where another one has its nodes; None where there is none."""
    flat = scene.resolved_dimension == "plane"
    starts = {name: [*place[:2], 0.0 if flat else place[2]] for name, place in places.items()}
    nodes = {name: node.replace(start=starts[name]) for name, node in scene.nodes.items()}
    try:
        return solve(scene.replace(nodes=nodes), **settings).last
    except (SceneError, SolveError):
        return None


def _unstable_there(step: Equilibrium, other: Variant) -> bool:
    """Whether the answer of the plane is an equilibrium in space, but no stable one."""
    analysis = other.scene.analysis.replace(unstable="stay")
    try:
        found = solve(other.scene.replace(analysis=analysis), **other.settings).last
    except (SceneError, SolveError):
        return False
    return _same(step, found, other) and found.certificate.stable is False


class _Looked:
    """One answer with what acts on it."""

    def __init__(self, step: Equilibrium, scene: Scene, pushed: Pushed) -> None:
        self.step, self.scene, self.pushed = step, scene, pushed
        self.gravity = np.zeros(3) if self.scene.gravity is None else step.factor * np.array(self.scene.gravity)
        self.largest = 0.0
        self.inner = {name: step.along(name, [0.0, 1.0]) for name in self.scene.members}

    def factor(self, load: Any) -> float:
        named = load.history
        return self.step.factor if named is None else self.scene.histories[named].factor(self.step.factor)

    def value(self, load: Load, turned: Array) -> Array:
        """Vectors (n, 3) of a load where sections have turned (n, 4) since the undeformed scene."""
        vector = self.factor(load) * np.array(load.vector)
        return np.broadcast_to(vector, (len(turned), 3)) if load.frame == "fixed" else rotate(turned, vector)

    # -- balance --------------------------------------------------------------------------------

    def all(self) -> Defects:
        members = [self.member(name) for name in self.scene.members]
        nodes = [self.node(name) for name in self.scene.nodes]
        # Forces and moments are compared with the largest that were added up anywhere, moments over the size too.
        largest, size = self.largest or 1.0, self.scene.size
        ends, turned = self.joined()
        beams = [self.beam(name) for name, member in self.scene.members.items() if member.type == "flexible"]
        return Defects(
            forces=max(float(np.abs(force).max()) for force, _ in members + nodes) / largest,
            moments=max(float(np.abs(moment).max()) for _, moment in members + nodes) / (largest * size),
            ends=ends / size,
            turned=turned,
            springs=max((self.spring(name) for name in self.scene.springs), default=0.0) / largest,
            beams=max((place for place, _ in beams), default=0.0) / size,
            bends=max((turn for _, turn in beams), default=0.0),
        )

    def summed(self, forces: Any, moments: Any, places: Any) -> tuple[Array, Array]:
        """Sum of forces, and of moments about a corner of the scene."""
        forces, moments = np.reshape(forces, (-1, 3)), np.reshape(moments, (-1, 3))
        places = np.reshape(places, (-1, 3)) - self.step.position(next(iter(self.scene.nodes)))
        size = self.scene.size
        self.largest = max(self.largest, np.abs(forces).max(initial=0.0), np.abs(moments).max(initial=0.0) / size)
        return forces.sum(axis=0), (moments + np.cross(places, forces)).sum(axis=0)

    def member(self, name: str) -> tuple[Array, Array]:
        """What is left over of a member."""
        ends = self.inner[name]
        parts = [(-ends["force"][0], -ends["moment"][0], ends["position"][0])]
        parts += [(ends["force"][1], ends["moment"][1], ends["position"][1]), *self.on_member(name)]
        force, moment = self.summed(*(np.vstack(entries) for entries in zip(*parts, strict=True)))
        if self.scene.members[name].type == "small":
            # What acts within it acts where it would be if it did not bend.
            acting = sum(float(np.linalg.norm(entries[0], axis=1).sum()) for entries in parts[2:])
            spare = self.step.fields.bent[name] * self.scene.center_lines[name].length * acting
            moment = moment * max(0.0, 1.0 - spare / (float(np.linalg.norm(moment)) or 1.0))
        return force, moment

    def on_member(self, name: str) -> Iterator[tuple[Array, Array, Array]]:
        """Forces, moments and places of what acts within a member."""
        for load in self.scene.loads.values():
            if load.member != name or load.type == "distributed":
                continue
            there = self.step.along(name, [load.at])
            value, nothing = self.value(load, there["quaternion"]), np.zeros((1, 3))
            yield (value, nothing, there["position"]) if load.type == "force" else (nothing, value, there["position"])
        for x, force in self.pushed.get(name, ()):
            if 0.0 < x < 1.0:
                yield force[None], np.zeros((1, 3)), self.step.along(name, [x])["position"]
        places, weights = self.points(name)
        there = self.step.along(name, places)
        spread = self.spread(name, places, there["quaternion"])
        if spread.any():
            yield weights[:, None] * spread, np.zeros((len(places), 3)), there["position"]

    def points(self, name: str) -> tuple[Array, Array]:
        """Gauss points of a member between all places where something is not smooth, and weights in m."""
        section = self.scene.members[name].section
        cuts = {0.0, 1.0, *self.step.model.mesh.cuts.get(name, ())}
        cuts |= {x for x, _ in self.pushed.get(name, ())}
        cuts |= set(self.scene.sections[section].breaks) if section is not None else set()
        for load in self.scene.loads.values():
            if load.member == name and load.profile is not None:
                cuts |= set(breaks(load.profile))
        edges = np.array(sorted(cuts))
        half = 0.5 * np.diff(edges)
        x = (edges[:-1] + half)[:, None] + half[:, None] * GAUSS
        return x.ravel(), (half[:, None] * WEIGHTS).ravel() * self.scene.center_lines[name].length

    def spread(self, name: str, x: Array, turned: Array) -> Array:
        """Force per length (n, 3) of the undeformed member."""
        total = np.zeros((len(x), 3))
        for load in self.scene.loads.values():
            if load.type != "distributed" or load.member != name:
                continue
            profile = np.ones(len(x)) if load.profile is None else evaluate(load.profile, x)
            sections = load.frame == "section"
            frames = multiply(turned, self.scene.center_lines[name].quaternions(x)) if sections else turned
            total += profile[:, None] * self.value(load, frames)
        section = self.scene.members[name].section
        if self.gravity.any() and section is not None and not self.hung(name):
            total += self.scene.sections[section].mass(x)[:, None] * self.gravity
        return total

    def hung(self, name: str) -> bool:
        """Whether the weight of a member counts at its nodes: the mass of a rigid one is on the line between them."""
        return self.scene.members[name].type == "rigid" and self.scene.center_lines[name].turning > 0.0

    def weights(self, name: str) -> Array:
        """Weight (2, 3) of a rigid member at its two nodes."""
        section, ends = self.scene.members[name].section, self.scene.members[name].nodes
        if section is None:
            return np.zeros((2, 3))
        x, weights = self.points(name)
        chord = math.dist(*(self.scene.nodes[node].position for node in ends))
        share = self.scene.sections[section].mass(x) * weights * chord / self.scene.center_lines[name].length
        return np.outer([share @ (1.0 - x), share @ x], self.gravity)

    def node(self, name: str) -> tuple[Array, Array]:
        """What is left over of a node with its joints."""
        step, node, here = self.step, self.scene.nodes[name], self.step.position(name)
        parts = [(node.mass * self.gravity, np.zeros(3), here)]
        for member in self.scene.members:
            ends, inner = self.scene.members[member].nodes, self.inner[member]
            sides = [(i, sign) for i, sign in ((0, 1.0), (1, -1.0)) if ends[i] == name]
            parts += [(s * inner["force"][i], s * inner["moment"][i], inner["position"][i]) for i, s in sides]
            parts += [
                (self.weights(member)[i], np.zeros(3), inner["position"][i]) for i, _ in sides if self.hung(member)
            ]
            # What pushes an end acts beyond its last section.
            pushed = [force for x, force in self.pushed.get(member, ()) if x in (0.0, 1.0) and ends[int(x)] == name]
            parts += [(force, np.zeros(3), here) for force in pushed]
        if node.support != "free":
            parts.append((*step.reaction(name), here))
        turned = step.quaternion(name)
        for load in self.scene.loads.values():
            if load.node == name:
                value = self.value(load, np.array([[1.0, 0.0, 0.0, 0.0]] if turned is None else [turned]))[0]
                parts.append((value, np.zeros(3), here) if load.type == "force" else (np.zeros(3), value, here))
        parts += [part for spring in self.scene.springs for part in self.on_node(spring, name)]
        return self.summed(*zip(*parts, strict=True))

    def on_node(self, name: str, node: str) -> Iterator[tuple[Array, Array, Array]]:
        """What a spring to the ground or to another node gives to a node."""
        spring, here, effort = self.scene.springs[name], self.step.position(node), self.step.spring(name).effort
        if spring.type == "rotational":
            if spring.node == node and spring.between is None:
                yield np.zeros(3), effort * self.about(name), here
        elif node in (spring.node, spring.to):
            yield (1.0 if node == spring.node else -1.0) * effort * self.line(name)[1], np.zeros(3), here

    def about(self, name: str) -> Array:
        """Derivative of the angle of a spring to the ground by the rotation of its node: its axis, of a hinge.

        The angle is twice that of the scalar and the part along the axis of the quaternion.
        """
        axis = np.array(self.scene.spring_axis(name)) / np.linalg.norm(self.scene.spring_axis(name))
        turned = self.step.quaternion(self.scene.springs[name].node)
        if turned is None:
            return axis
        w, v = turned[0], turned[1:]
        along = float(v @ axis)
        return np.asarray((w * w * axis + w * np.cross(v, axis) + along * v) / (w * w + along * along))

    def line(self, name: str) -> tuple[float, Array]:
        """Travel of a translational spring, and its direction to its node."""
        spring = self.scene.springs[name]
        first, old = self.step.position(spring.node), np.array(self.scene.nodes[spring.node].position)
        if spring.to is None:
            second = other = np.array(old if spring.anchor is None else spring.anchor)
        else:
            second, other = self.step.position(spring.to), np.array(self.scene.nodes[spring.to].position)
        if spring.direction is not None:
            direction = np.array(spring.direction) / np.linalg.norm(spring.direction)
            moved = first - old - (0.0 if spring.to is None else 1.0) * (second - other)
            return float(moved @ direction) - spring.rest, direction
        free = float(np.linalg.norm(old - other)) if spring.length is None else spring.length
        distance = float(np.linalg.norm(first - second))
        return distance - free, (first - second) / (distance or 1.0)

    def spring(self, name: str) -> float:
        """What a spring gives beside what its angle or its length says, in N."""
        spring, found = self.scene.springs[name], self.step.spring(name)
        if spring.type == "rotational":
            return abs(found.effort + spring.stiffness * (found.travel - spring.rest)) / self.scene.size
        return abs(found.effort + spring.stiffness * self.line(name)[0])

    # -- joints ---------------------------------------------------------------------------------

    def joined(self) -> tuple[float, float]:
        """Distance of ends that do not slide from their nodes, and angle of rigidly joined ones."""
        gap, angle = 0.0, 0.0
        for name, member in self.scene.members.items():
            for i, node in enumerate(member.nodes):
                release, turned = member.release[i], self.step.quaternion(node)
                if release not in SLIDING:
                    gap = max(gap, float(np.linalg.norm(self.inner[name]["position"][i] - self.step.position(node))))
                if release == "rigid" and turned is not None:
                    apart = multiply(conjugate(turned), self.inner[name]["quaternion"][i])
                    angle = max(angle, 2.0 * float(np.linalg.norm(apart[1:])))
        return gap, angle

    # -- differential equations -----------------------------------------------------------------

    def beam(self, name: str) -> tuple[float, float]:
        """Distance and angle at the ends of elements from where the equations of a beam lead to from their starts."""
        within = [x for x, _ in self.pushed.get(name, ())]
        cuts, line = np.union1d(self.step.model.mesh.cuts[name], within), self.scene.center_lines[name]
        start, end = (self.state(name, np.nextafter(x, to)) for x, to in ((cuts[:-1], 1.0), (cuts[1:], 0.0)))
        x, h = cuts[:-1].copy(), np.diff(cuts) / SUBSTEPS
        now, step = start, (h * line.length)[:, None]
        for _ in range(SUBSTEPS):
            slopes: list[Array] = []
            for share in (0.0, 0.5, 0.5, 1.0):
                there = now + share * step * slopes[-1] if slopes else now
                # Where a section or a load has a kink it is at the end of an element, and belongs to the element.
                places = np.clip(x + share * h, np.nextafter(cuts[:-1], 1.0), np.nextafter(cuts[1:], 0.0))
                slopes.append(self.slope(name, places, there))
            now = now + step / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
            x = x + h
        apart = multiply(conjugate(_unit(now[:, 3:7])), end[:, 3:7])
        places = np.linalg.norm(now[:, :3] - end[:, :3], axis=1)
        return float(places.max()), 2.0 * float(np.linalg.norm(apart[:, 1:], axis=1).max())

    def state(self, name: str, x: Array) -> Array:
        """Place, rotation of the section, force and moment (n, 13)."""
        there, line = self.step.along(name, x), self.scene.center_lines[name]
        frames = multiply(there["quaternion"], line.quaternions(x))
        return np.hstack([there["position"], frames, there["force"], there["moment"]])

    def slope(self, name: str, x: Array, now: Array) -> Array:
        """Derivative of the state by the length."""
        line, section = self.scene.center_lines[name], self.scene.sections[str(self.scene.members[name].section)]
        quaternions, force, moment = _unit(now[:, 3:7]), now[:, 7:10], now[:, 10:]
        frames = matrix(quaternions)
        bent = np.einsum("nij,ni->nj", frames, moment) / section.stiffness(x)
        spin = line.curvatures(x) + np.where(np.isnan(bent), 0.0, bent)
        turning = 0.5 * multiply(quaternions, np.hstack([np.zeros((len(x), 1)), spin]))
        loads = self.spread(name, x, multiply(quaternions, conjugate(line.quaternions(x))))
        return np.hstack([frames[:, :, 0], turning, -loads, -np.cross(frames[:, :, 0], force)])


def _unit(q: Array) -> Array:
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))
