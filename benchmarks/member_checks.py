"""Answers in which members touch each other, looked at from outside.

Distances are found by a search of its own, along chains of points; balance is that of each member and each node with
the contact forces of the answer as loads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sfetcas.contact.pairs import NEXT_TO
from sfetcas.description.contacts import contact_radius
from sfetcas.description.obstacles import members_of
from sfetcas.description.scene import Scene
from sfetcas.equilibria.solution import Equilibrium
from sfetcas.mathematics.arrays import Array

from .random_checks import Defects, Pushed, defects

__all__ = ["Touch", "nearest", "touches", "wrong_contacts"]

EDGE = 1.05
"""How much further along members than the limit a place is that is none of the nearest by it."""

PLACES = 600
"""Places along a member between which distances are looked for."""


@dataclass(frozen=True)
class Touch:
    """One place where members touch: its members, fractions of their lengths, and force (3,) N on the first one."""

    contact: str
    members: tuple[str, str]
    at: tuple[float, float]
    force: Array
    gap: float


def touches(step: Equilibrium) -> list[Touch]:
    """All places where members touch, as an answer tells them."""
    found = []
    for name, entry in step.contacts.items():
        if "other" not in entry or entry["at"] is None:
            continue
        many = isinstance(entry["at"], list)
        for i in range(len(entry["at"]) if many else 1):
            one = {key: value[i] for key, value in entry.items()} if many else entry
            members, at = (one["member"], one["other"]), (float(one["at"]), float(one["other_at"]))
            found.append(Touch(name, members, at, np.asarray(one["force"]), float(one["gap"])))
    return found


def nearest(step: Equilibrium) -> Iterator[tuple[str, str, float, float, float, float]]:
    """Of each pair of members that may touch where they are nearest: names, fractions, gap, sum of the radii."""
    scene = step.model.scene
    x = np.linspace(0.0, 1.0, PLACES + 1)
    places = {name: step.along(name, x)["position"] for name in scene.members}
    for contact in scene.contacts.values():
        if not contact.between_members:
            continue
        names = [name for name in members_of(contact, scene.members) if scene.members[name].type != "small"]
        for i, a in enumerate(names):
            for b in names[i:]:
                if a == b and scene.members[a].type == "rigid":
                    continue
                radii = [contact_radius(contact, scene.members[m], scene.sections) or 0.0 for m in (a, b)]
                limit = NEXT_TO * 0.5 * np.pi * sum(radii)
                s, t, gap = _nearest(step, places, x, a, b, limit)
                while np.isfinite(gap) and _beside(scene, a, b, np.array([s]), np.array([t]), EDGE * limit)[0, 0]:
                    # Nearer to a common node they are nearer still: no place where they touch.
                    limit *= EDGE
                    s, t, gap = _nearest(step, places, x, a, b, limit)
                yield a, b, s, t, gap - sum(radii), sum(radii)


def _nearest(
    step: Equilibrium, places: dict[str, Array], x: Array, a: str, b: str, limit: float
) -> tuple[float, float, float]:
    """Fractions and distance of the nearest places further from each other along members than a limit; refined three
    times.
    """
    scene = step.model.scene
    s, t, first, second = x, x, places[a], places[b]
    best = (0.0, 0.0, np.inf)
    for _ in range(5):
        apart = np.linalg.norm(first[:, None] - second[None], axis=2)
        apart[_beside(scene, a, b, s, t, limit)] = np.inf
        i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
        best = min(best, (float(s[i]), float(t[j]), float(apart[i, j])), key=lambda one: one[2])
        if not np.isfinite(best[2]):
            break
        width = 2.0 * np.array([s[1] - s[0], t[1] - t[0]])
        s, t = (np.linspace(max(0.0, p - w), min(1.0, p + w), 61) for p, w in zip(best[:2], width, strict=True))
        first, second = step.along(a, s)["position"], step.along(b, t)["position"]
    return best


def _beside(scene: Scene, a: str, b: str, s: Array, t: Array, limit: float) -> Array:
    """Which places (n, m) follow each other along one member or over a common node, nearer than a limit."""
    lengths = [scene.center_lines[m].length for m in (a, b)]
    if a == b:
        return np.asarray(np.abs(s[:, None] - t[None]) * lengths[0] < limit)
    found = np.zeros((len(s), len(t)), bool)
    for i, node in enumerate(scene.members[a].nodes):
        for k, same in enumerate(scene.members[b].nodes):
            if node == same:
                found |= np.abs(s[:, None] - i) * lengths[0] + np.abs(t[None] - k) * lengths[1] < limit
    return found


def wrong_contacts(step: Equilibrium) -> list[str]:
    """What is wrong with an answer in which members touch; nothing where all fits."""
    scene, words = step.model.scene, list[str]()
    size, estimate = scene.size, step.certificate.error_estimate or 0.0
    accuracy = max(scene.analysis.accuracy, estimate) * size
    for a, b, s, t, gap, radii in nearest(step):
        if gap < -(1e-6 * radii + accuracy):
            words.append(f"{a} {s:.4f} and {b} {t:.4f} penetrate by {-gap:.1e}, radii {radii:.3g}")
    told = touches(step)
    largest = max((float(np.linalg.norm(one.force)) for one in told), default=0.0)
    for one in told:
        words += _wrong_touch(step, one, largest, accuracy)
    found = _defects(step, told)
    proof = step.certificate
    limits = {"forces": 1e-8, "moments": max(0.1 * scene.analysis.accuracy, estimate), "ends": 1e-8, "turned": 1e-8}
    limits |= {"beams": max(1e-5, 10.0 * estimate), "bends": 1e-3}
    words += [f"{key} {getattr(found, key):.1e}" for key, most in limits.items() if not getattr(found, key) <= most]
    words += ["unstable"] if proof.stable is False and scene.analysis.unstable == "leave" else []
    words += ["not accurate"] if not estimate <= scene.analysis.accuracy else []
    return words + ([f"residual {proof.residual:.1e}"] if not proof.residual <= 1e-9 else [])


def _wrong_touch(step: Equilibrium, one: Touch, largest: float, accuracy: float) -> Iterator[str]:
    """What is wrong with one place: its gap, the sign and the direction of its force."""
    (a, b), (s, t) = one.members, one.at
    there = [step.along(m, [x]) for m, x in ((a, s), (b, t))]
    apart = there[0]["position"][0] - there[1]["position"][0]
    normal, label = apart / np.linalg.norm(apart), f"{a} {s:.4f} and {b} {t:.4f}"
    force = float(np.linalg.norm(one.force))
    if abs(one.gap) > 1e-6 * float(np.linalg.norm(apart)) + 0.01 * accuracy:
        yield f"{label} touch at a gap of {one.gap:.1e}"
    if one.force @ normal < -1e-8 * largest:
        yield f"{label} pull by {force:.1e}"
    if np.linalg.norm(np.cross(one.force, normal)) > 1e-7 * max(largest, 1e-300):
        yield f"{label}: a force that is not along the normal"
    for member, x, sign in ((a, s, 1.0), (b, t, -1.0)):
        slope = sign * float(normal @ _tangent(step, member, x))
        # At an end the other member is beyond it; along a line the places are ends of elements, and given.
        given = np.abs(step.model.mesh.cuts[member] - x).min() < 1e-12
        bad = slope < -1e-3 if x <= 0.0 else slope > 1e-3 if x >= 1.0 else abs(slope) > (1e-2 if given else 1e-4)
        if bad and force > 1e-6 * largest:
            yield f"{label}: normal inclined to {member} by {slope:.1e}"


def _tangent(step: Equilibrium, member: str, x: float) -> Array:
    low, high = max(x - 1e-5, 0.0), min(x + 1e-5, 1.0)
    places: Any = step.along(member, [low, high])["position"]
    change = places[1] - places[0]
    return np.asarray(change / np.linalg.norm(change))


def _defects(step: Equilibrium, told: list[Touch]) -> Defects:
    """How far an answer is from balance and from the equations of a beam, with contact forces as loads."""
    pushed: Pushed = {}
    for one in told:
        pushed.setdefault(one.members[0], []).append((one.at[0], one.force))
        pushed.setdefault(one.members[1], []).append((one.at[1], -one.force))
    return defects(step, pushed=pushed)
