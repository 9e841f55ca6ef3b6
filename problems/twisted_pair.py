"""Two rods twisted round each other under tension: a two-ply.

Both are clamped side by side at one end, and to a bar at the other end.  The bar is pulled and turned, so that they lie
on each other as helices, without friction, and come closer at their ends.  Of each helix the angle ``b`` between its
tangent and the axis tells the moment that the bar needs.  With the radius ``r``, the bending stiffness ``B``, the
torque ``Q`` within each rod and the pull ``T`` the balance of both rods about the axis is

    M = 2 (2 B sin(b)^3 / r + Q cos(2 b) / cos(b) - B r b'' / cos(b)) + T r tan(b)

where ``b''`` is the change of the angle towards the ends, and ``Q`` is the same all along.

``python problems/twisted_pair.py [PICTURE]`` prints how far it is from that, and draws the pair.

Source of the check: Thompson, van der Heijden and Neukirch, From supercoiling of DNA to marine cables: the mechanics of
the generalized ply, Proceedings of the Royal Society A 458, 2002, for uniform helices; the Lagrangian of a curve on a
cylinder for those whose angle changes.
"""

from __future__ import annotations

import functools
import sys

import numpy as np
from matplotlib.figure import Figure

from sfetcas import (
    Analysis,
    Contact,
    CrossSection,
    Equilibrium,
    History,
    Load,
    Member,
    Motion,
    Node,
    Scene,
    Solution,
    solve,
)

RADIUS, LENGTH, PULL, TURN = 0.05, 1.0, 100.0, 6.0
"""m, m, N, rad."""

BENDING, TORSION = 1.0, 0.75
"""N m2."""

BESIDE = 0.05
"""Share of the length over which the change of the angle is differenced, some of the distances of touches."""

TOLERANCE = 2e-4
"""Relative.  Rods touch at places instead of along a line, between which the angle goes up and down: 4e-5 is left."""


def scene() -> Scene:
    """Both rods from side to side."""
    beside = {"a": RADIUS, "b": -RADIUS}
    ends = {f"{name}{i}": [i * LENGTH, y, 0] for name, y in beside.items() for i in (0, 1)}
    nodes = {name: Node(position=at, support="clamped" if at[0] == 0.0 else "free") for name, at in ends.items()}
    bar = Node(position=[LENGTH, 0, 0], support="slider", direction=[1, 0, 0])
    arms = {f"arm {name}": Member(nodes=["bar", f"{name}1"], type="rigid") for name in beside}
    return Scene(
        title="Twisted pair",
        dimension="space",
        sections={"rod": CrossSection(EI2=BENDING, EI3=BENDING, GJ=TORSION)},
        nodes={**nodes, "bar": bar},
        members={**{name: Member(nodes=[f"{name}0", f"{name}1"], section="rod") for name in beside}, **arms},
        contacts={"pair": Contact(type="members", members=["a", "b"], radius=RADIUS)},
        loads={"pull": Load(type="force", node="bar", value=[PULL, 0, 0], history="constant")},
        motions={"turn": Motion(node="bar", rotation=[TURN, 0, 0])},
        histories={"constant": History(t=[0], value=[1])},
        analysis=Analysis(accuracy=1e-2),
    )


@functools.cache
def answer() -> Solution:
    """The pair under its pull, turned."""
    return solve(scene())


def twisted() -> Equilibrium:
    """Its equilibrium."""
    return answer().last


def torques(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the helix, rad, and torques, N m, of a rod at fractions of its length."""
    along = twisted().along("a", at)
    w, x, y, z = along["quaternion"].T
    tangents = np.stack([w**2 + x**2 - y**2 - z**2, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=1)
    angles = np.arctan2(np.linalg.norm(tangents[:, 1:], axis=1), tangents[:, 0])
    return angles, np.einsum("ni,ni->n", along["moment"], tangents)


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    (before, b, after), (_, torque, _) = torques(0.5 + BESIDE * np.array([-1.0, 0.0, 1.0]))
    bend = (before + after - 2.0 * b) / (BESIDE * LENGTH) ** 2
    within = 2.0 * BENDING * np.sin(b) ** 3 / RADIUS - BENDING * RADIUS * bend / np.cos(b)
    moment = 2.0 * (within + torque * np.cos(2.0 * b) / np.cos(b)) + PULL * RADIUS * np.tan(b)
    found = twisted().reaction("bar")[1][0]
    all_along = torques(np.linspace(0.0, 1.0, 21))[1]
    return {
        "moment of the bar": abs(found - moment) / moment,
        "torque along a rod": float(np.ptp(all_along)) / torque,
    }


def picture() -> Figure:
    """Both rods as seen from aside, nearly as thick as they are."""
    figure = Figure(figsize=(9.0, 2.8), layout="constrained")
    axes = figure.subplots()
    for name, colour in (("a", "C0"), ("b", "C1")):
        x, y, z = twisted().along(name, np.linspace(0.0, 1.0, 101))["position"].T
        # What is nearer hides what is behind.
        for i in range(100):
            part, depth = slice(i, i + 3), 2.0 + 10.0 * float(z[i])
            axes.plot(x[part], y[part], color=colour, linewidth=44.0, zorder=depth, solid_capstyle="butt")
            axes.plot(x[part], y[part], color="white", linewidth=0.8, zorder=depth + 0.01)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", ylim=(-0.15, 0.15))
    return figure


if __name__ == "__main__":
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    if sys.argv[1:]:
        picture().savefig(sys.argv[1])
