"""A continuum rod bent into a shape by three moments.

A rod clamped at its base takes moments at a third, two thirds and the whole of its length.  In the plane it is made of
three arcs, whose curvatures follow from the moments: points of such arcs, computed here, are given, and the moments
are asked for.  In space each moment has two components across the base, and the rod is bent and twisted: points of
known moments, by statics, are given.  At last the rod reaches for a helix that no such moments give it, as near as it
can.

``python problems/shape_control_three_moments.py [PICTURE]`` prints the moments and draws the shapes.

Source of the check: arcs in closed form in the plane; in space statics under the known moments, and statics under those
that were found for the helix; no moments beside them are nearer to it.
"""

from __future__ import annotations

import functools
import sys

import casadi as ca
import numpy as np
from matplotlib.figure import Figure

from sfetcas import CrossSection, Design, DesignAnswer, Load, Member, Node, Scene, Solution, changed, solve

EI, GJ = 1.0, 0.8
NODES = {"base": 0.0, "first": 1 / 3, "second": 2 / 3, "tip": 1.0}
LEVELS = ("first", "second", "tip")

IN_PLANE = (1.5, -4.0, 3.0)
"""Moments about z, N m."""

IN_SPACE = ((0.0, 1.0, 0.6), (0.0, -2.0, 0.5), (0.0, 0.5, 1.5))
"""Moments, N m, in fixed axes; x is along the straight rod."""

TOLERANCE = 1e-6
"""Moments, N m, and positions, m: meshes are within 1e-8, of the helix 1e-6, which it is 3 mm from: 1e-8 m2."""


def scene(*, space: bool) -> Scene:
    """The straight rod of 1 m under moments that are nearly nothing."""
    members = {
        f"part {i}": Member(nodes=[a, b], section="rod")
        for i, (a, b) in enumerate(zip(list(NODES)[:-1], list(NODES)[1:], strict=True), start=1)
    }
    value = [0, 0.1, 0.1] if space else 0.1
    return Scene(
        title="Rod under three moments",
        dimension="space" if space else "plane",
        sections={"rod": CrossSection(EI2=EI, EI3=EI, GJ=GJ)},
        nodes={name: Node(position=[x, 0], support="free" if x else "clamped") for name, x in NODES.items()},
        members=members,
        loads={level: Load(type="moment", node=level, value=value) for level in LEVELS},
    )


def arcs(moments: tuple[float, ...]) -> np.ndarray:
    """Ends of three arcs, (3, 2): each has the curvature of all moments from its end on."""
    place, angle, found = 0.0 + 0.0j, 0.0, []
    for i in range(3):
        curvature = sum(moments[i:]) / EI
        # Of an arc of length 1/3.
        place += np.exp(1j * angle) * (np.exp(1j * curvature / 3.0) - 1.0) / (1j * curvature)
        angle += curvature / 3.0
        found.append([place.real, place.imag])
    return np.array(found)


def helix(x: np.ndarray) -> np.ndarray:
    """Points of a helix of 1 m that begins along the rod, (n, 3)."""
    curvature, torsion = 3.0, 1.0
    turn = np.hypot(curvature, torsion)
    radius, pitch = curvature / turn**2, torsion / turn**2
    local = np.stack([radius * np.sin(turn * x), radius * (1.0 - np.cos(turn * x)), pitch * turn * x], axis=1)
    along = np.array([curvature, 0.0, torsion]) / turn
    across = np.array([-torsion, 0.0, curvature]) / turn
    return np.stack([local @ along, local[:, 1], local @ across], axis=1)


def bent(scene: Scene, targets: dict[str, np.ndarray], accuracy: float) -> DesignAnswer:
    """Moments for which nodes are as near as can be to where they shall be."""
    components = (1, 2) if scene.resolved_dimension == "space" else (0,)
    one = "loads.{}.value.{}" if len(components) > 1 else "loads.{}.value"
    names = [one.format(level, i) for level in LEVELS for i in components]
    design = Design(scene, dict.fromkeys(names, (-10.0, 10.0)), accuracy=accuracy)
    off = [design.answer("", f"nodes.{node}.position")[: len(at)] - ca.DM(at) for node, at in targets.items()]
    design.minimise(ca.sumsqr(ca.vertcat(*off)))
    return design.solve()


@functools.cache
def plane() -> DesignAnswer:
    """The rod through the ends of three arcs."""
    return bent(scene(space=False), dict(zip(LEVELS, arcs(IN_PLANE), strict=True)), 1e-8)


def known() -> Scene:
    """The rod in space under the known moments."""
    return changed(scene(space=True), {f"loads.{level}.value": m for level, m in zip(LEVELS, IN_SPACE, strict=True)})


@functools.cache
def space() -> DesignAnswer:
    """The rod through its nodes under the known moments."""
    step = solve(known(), accuracy=1e-8).last
    return bent(scene(space=True), {level: step.position(level) for level in LEVELS}, 1e-8)


@functools.cache
def nearest() -> DesignAnswer:
    """The rod as near as can be to a helix."""
    return bent(scene(space=True), dict(zip(LEVELS, helix(np.array([1 / 3, 2 / 3, 1.0])), strict=True)), 1e-6)


def moments(answer: DesignAnswer) -> np.ndarray:
    """What was found, in the order of the levels."""
    return np.array(list(answer.values.values()))


def missed(answer: DesignAnswer, at: np.ndarray) -> float:
    """Sum of the squared distances to the helix under moments, by statics."""
    numbers = dict(zip(answer.values, at.tolist(), strict=True))
    step = solve(changed(scene(space=True), numbers), accuracy=1e-6).last
    wanted = helix(np.array([1 / 3, 2 / 3, 1.0]))
    return float(sum(np.sum((step.position(n) - w) ** 2) for n, w in zip(LEVELS, wanted, strict=True)))


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    wanted = np.array(IN_SPACE)[:, 1:].ravel()
    helical, found = nearest(), moments(nearest())
    beside = min(missed(helical, found * (1.0 + 0.02 * s * np.eye(6)[i])) for i in (0, 3) for s in (-1, 1))
    return {
        "moments in the plane against arcs": float(np.abs(moments(plane()) - IN_PLANE).max()),
        "moments in space against those that were known": float(np.abs(moments(space()) - wanted).max()),
        "distance to the helix against statics": abs(missed(helical, found) - helical.objective),
        "nearer to the helix beside what was found": max(0.0, helical.objective - beside),
    }


def answer() -> Solution:
    """The rod bent to be as near to the helix as can be."""
    return solve(nearest().scene())


def picture() -> Figure:
    """The three shapes with the points that were asked for."""
    figure = Figure(figsize=(11.0, 3.8), layout="constrained")
    flat = figure.add_subplot(1, 3, 1)
    x = np.linspace(0.0, 1.0, 21)
    parts = [plane().cases[""].along(f"part {i}", x)["position"] for i in (1, 2, 3)]
    flat.plot(*np.concatenate(parts)[:, :2].T)
    flat.plot(*arcs(IN_PLANE).T, "o", color="C3")
    flat.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Three arcs")
    targets = (
        ("Known moments", space(), None),
        ("As near to a helix as can be", nearest(), helix(np.linspace(0, 1, 41))),
    )
    for number, (title, answer, line) in enumerate(targets, start=2):
        axes = figure.add_subplot(1, 3, number, projection="3d")
        parts = [answer.cases[""].along(f"part {i}", x)["position"] for i in (1, 2, 3)]
        axes.plot(*np.concatenate(parts).T)
        axes.plot(*np.stack([answer.cases[""].position(n) for n in LEVELS]).T, "o", color="C3")
        if line is not None:
            axes.plot(*line.T, "--", color="0.5")
        axes.set(title=title, xlabel="x, m", ylabel="y, m")
    return figure


if __name__ == "__main__":
    for name, answer in (("plane", plane()), ("space", space()), ("helix", nearest())):
        print(f"{name}: {np.round(moments(answer), 6).tolist()} N m, sum of squares {answer.objective:.2e} m2")
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "shape_control_three_moments.png", dpi=150)
