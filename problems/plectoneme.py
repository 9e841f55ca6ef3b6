"""A rod under tension that is twisted until it snaps aside, touches itself and winds up: a plectoneme.

One end is clamped, the other one is pulled and turned.  A straight rod takes the torque 2 sqrt(B T) at most
(Greenhill); beyond, it snaps to a loop whose legs lie on each other, without friction, and the turns that follow go
into the helices of both.  Nothing pulls or turns the loop at their end, so each cross-section of both legs together has
neither force nor torque about their axis.  With the angle ``b`` of the helices, the radius ``r`` and the bending
stiffness ``B`` the torque within the rod is

    Q = (2 B sin(b)^3 cos(b) / r - B r b'') / cos(2 b)

where ``b''`` is the change of the angle along the legs.

``python problems/plectoneme.py [PICTURE]`` prints how far it is from that, and draws the rod.

Source of the check: Clauvelin, Audoly and Neukirch, Elasticity and electrostatics of plectonemic DNA, Biophysical
Journal 96, 2009, for uniform helices; the Lagrangian of a curve on a cylinder for those whose angle changes.
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

RADIUS, LENGTH, PULL, TURNS, ASIDE = 0.03, 1.0, 20.0, 3.3, 0.5
"""m, m, N, turns, and a small force in the middle, N, that says to which side it snaps."""

STIFFNESS = 1.0
"""For bending and torsion, N m2."""

WITHIN, BESIDE = (0.42, 0.45, 0.47), 0.04
"""Places where the helices are compared, and distance over which angles are differenced, in halves of the rod."""

TOLERANCE = 2e-2
"""Relative.  The legs touch at some places instead of along a line; between them the angle goes up and down, and its
change with it: up to 0.7 per cent are left at the places, 0.1 in their mean."""


def scene() -> Scene:
    """The rod in two halves."""
    halves = {"first": ["held", "middle"], "second": ["middle", "turned"]}
    return Scene(
        title="Plectoneme",
        dimension="space",
        sections={"rod": CrossSection(EI2=STIFFNESS, EI3=STIFFNESS, GJ=STIFFNESS)},
        nodes={
            "held": Node(position=[0, 0, 0], support="clamped"),
            "middle": Node(position=[LENGTH / 2, 0, 0]),
            "turned": Node(position=[LENGTH, 0, 0], support="slider", direction=[1, 0, 0]),
        },
        members={name: Member(nodes=ends, section="rod") for name, ends in halves.items()},
        contacts={"itself": Contact(type="members", members="all", radius=RADIUS)},
        loads={
            "pull": Load(type="force", node="turned", value=[PULL, 0, 0], history="constant"),
            "aside": Load(type="force", node="middle", value=[0, 0, ASIDE], history="constant"),
        },
        motions={"turn": Motion(node="turned", rotation=[2.0 * np.pi * TURNS, 0, 0])},
        histories={"constant": History(t=[0], value=[1])},
        analysis=Analysis(accuracy=3e-2),
    )


@functools.cache
def answer() -> Solution:
    """The rod under its pull, turned."""
    return solve(scene())


def wound() -> Equilibrium:
    """Its equilibrium."""
    return answer().last


def tangents(member: str, at: np.ndarray) -> np.ndarray:
    """Tangents (n, 3) of a half of the rod at fractions of its length."""
    w, x, y, z = wound().along(member, at)["quaternion"].T
    return np.stack([w**2 + x**2 - y**2 - z**2, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=1)


def angles(at: np.ndarray) -> np.ndarray:
    """Angles of the helices, rad: half of that between both legs, which are as far from the middle."""
    return 0.5 * np.arccos(-np.einsum("ni,ni->n", tangents("first", at), tangents("second", 1.0 - at)))


def torque(at: float) -> float:
    """The torque that the helices ask for at a fraction of the first half, N m."""
    before, b, after = angles(at + BESIDE * np.array([-1.0, 0.0, 1.0]))
    bend = (before + after - 2.0 * b) / (0.5 * BESIDE * LENGTH) ** 2
    helix = 2.0 * np.sin(b) ** 3 * np.cos(b) / RADIUS
    return float(STIFFNESS * (helix - RADIUS * bend) / np.cos(2.0 * b))


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    at = np.linspace(0.0, 1.0, 21)
    found = np.einsum("ni,ni->n", wound().along("first", at)["moment"], tangents("first", at))
    return {
        "torque of the helices": abs(float(np.mean([torque(place) for place in WITHIN])) / found[0] - 1.0),
        "torque along the rod": float(np.ptp(found)) / found[0],
    }


def picture() -> Figure:
    """The rod as seen from aside, nearly as thick as it is."""
    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    axes = figure.subplots()
    for name, colour in (("first", "C0"), ("second", "C1")):
        x, y, z = wound().along(name, np.linspace(0.0, 1.0, 151))["position"].T
        # What is nearer hides what is behind.
        for i in range(150):
            part, depth = slice(i, i + 3), 2.0 - 10.0 * float(y[i])
            axes.plot(x[part], z[part], color=colour, linewidth=40.0, zorder=depth, solid_capstyle="butt")
            axes.plot(x[part], z[part], color="white", linewidth=0.8, zorder=depth + 0.01)
    axes.set(aspect="equal", xlabel="x, m", ylabel="z, m", xlim=(-0.15, 0.4), ylim=(-0.1, 0.45))
    return figure


if __name__ == "__main__":
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    if sys.argv[1:]:
        picture().savefig(sys.argv[1])
