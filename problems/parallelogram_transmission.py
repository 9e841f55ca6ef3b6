"""The flexible parallelogram mechanism of Figure 3: what a moment on the crank turns, and what arrives at the follower.

Macro-nodes 1, 2, 4, 5 are hinges, 3 is rigid; a rotational spring holds the follower at 5, a moment drives the crank
at 1.  With rigid links the follower turns as the crank does, d beta/d alpha = 1; with flexible ones the ratio is less
than a half and changes with the moment; behind the largest moment it passes infinity and becomes negative.

The scenes are ``flexible_parallelogram.toml`` and ``flexible_parallelogram_rigid_links.toml`` beside this file.
``python problems/parallelogram_transmission.py [PICTURE]`` prints the table and draws mechanism and curve.

Source: Barraco and Munteanu, Part 1, Figure 3 (its dimensions are not printed; those of the scene are chosen).
Reference: rigid links in closed form; flexible ones by Runge-Kutta shooting, in the scene file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import Analysis, Equilibrium, Load, Scene, Solution, load, solve

FOLDER = Path(__file__).parent

MOMENTS = (0.05, 0.1, 0.15, 0.2, 0.25)
"""Moments on the crank, N m; the flexible mechanism bears no more than 0.2677 N m."""

STEP = 1e-5
"""Distance of the moments whose answers give a derivative, N m."""

POINTS = 50
"""Points of the drawn curve: past the largest moment, until the crank has turned by 2 rad and begins to turn back."""

TOLERANCE = 1e-6
"""Angles are within 1e-7 of the shooting at the accuracy 1e-8 of the scene.  A central difference over 2e-5 N m errs by
1e-7 at 0.25 N m, where the nearby largest moment makes the third derivative 3e3 times the first; rounding by 1e-8."""


@dataclass(frozen=True)
class Transmission:
    """Angles and their derivatives by the moment on the crank, each (moments,), rad and rad/(N m)."""

    alpha: np.ndarray
    beta: np.ndarray
    alpha_rate: np.ndarray
    beta_rate: np.ndarray

    @property
    def ratio(self) -> np.ndarray:
        """d beta/d alpha."""
        return self.beta_rate / self.alpha_rate


def flexible() -> Scene:
    """Strips of spring steel, 20 mm x 0.5 mm."""
    return load(FOLDER / "flexible_parallelogram.toml")


def rigid() -> Scene:
    """The same mechanism of rigid links."""
    return load(FOLDER / "flexible_parallelogram_rigid_links.toml")


def at(scene: Scene, moments: tuple[float, ...]) -> tuple[Equilibrium, ...]:
    """The mechanism under these moments on the crank."""
    asked = scene.analysis.replace(steps=moments)
    return solve(scene.replace(analysis=asked, expect=())).steps


def transmission(scene: Scene) -> Transmission:
    """Input and output angle at the moments, with central differences."""
    steps = at(scene, tuple(moment + side * STEP for moment in MOMENTS for side in (-1, 0, 1)))
    alpha, beta = (np.array([step.angle(node) for step in steps]).reshape(-1, 3) for node in ("1", "5"))
    rates = ((angle[:, 2] - angle[:, 0]) / (2.0 * STEP) for angle in (alpha, beta))
    return Transmission(alpha[:, 1], beta[:, 1], *rates)


def back_transmission(scene: Scene, moment: float) -> float:
    """Derivative of the input angle by a moment on the follower, at a moment on the crank; rad/(N m)."""
    sides = []
    for extra in (-STEP, STEP):
        loads = {**scene.loads, "follower": Load(type="moment", node="5", value=extra / moment)}
        (step,) = at(scene.replace(loads=loads), (moment,))
        sides.append(step.angle("1"))
    return (sides[1] - sides[0]) / (2.0 * STEP)


def expected(scene: Scene, quantity: str) -> np.ndarray:
    """What the scene file knows of a quantity at the moments."""
    known = {expect.step: expect.value for expect in scene.expect if expect.quantity == quantity}
    return np.array([known[moment] for moment in MOMENTS])


def check() -> dict[str, float]:
    """Differences that have to be below TOLERANCE."""
    stiff, soft, scene = transmission(rigid()), transmission(flexible()), flexible()
    turned = np.array(MOMENTS) / scene.springs["5"].stiffness
    last = MOMENTS[-1]
    return {
        "rigid links, alpha against M/k": float(np.abs(stiff.alpha - turned).max()),
        "rigid links, beta against M/k": float(np.abs(stiff.beta - turned).max()),
        "rigid links, d beta/d alpha against 1": float(np.abs(stiff.ratio - 1.0).max()),
        "flexible links, alpha against shooting": float(np.abs(soft.alpha - expected(scene, "nodes.1.angle")).max()),
        "flexible links, beta against shooting": float(np.abs(soft.beta - expected(scene, "springs.5.angle")).max()),
        # Betti: what the moment at 1 turns at 5, the same moment at 5 turns at 1.
        "flexible links, d beta/dM_1 against d alpha/dM_5": abs(soft.beta_rate[-1] - back_transmission(scene, last)),
    }


def curve(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Angles alpha and beta along the path of equilibria from no moment on, rad."""
    analysis = Analysis(type="path", range=[0.0, 0.3], points=POINTS, steps=[0.0])
    path = solve(scene.replace(analysis=analysis, expect=()))
    turned = [[path.fields(point).rotation(node)[0] for node in ("1", "5")] for point in path.points]
    alpha, beta = np.array(turned).T
    return alpha, beta


def answer() -> Solution:
    """The mechanism with flexible links under the moments."""
    return solve(flexible().replace({"analysis.steps": MOMENTS}))


def picture() -> Figure:
    """The mechanism with flexible links under the moments, and beta over alpha for both kinds of links."""
    figure = Figure(figsize=(11.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    _draw_shapes(left)
    _draw_curves(right)
    return figure


def _draw_shapes(axes: Axes) -> None:
    scene, fractions = flexible(), np.linspace(0.0, 1.0, 41)
    for i, (moment, step) in enumerate(zip((0.0, *MOMENTS), at(scene, (0.0, *MOMENTS)), strict=True)):
        shade = (0.75 - 0.15 * i,) * 2 + (0.85,) if i else (0.55,) * 3
        for member in scene.members:
            x, y, _ = step.along(member, fractions)["position"].T
            label = f"M = {moment:g} N m" if member == "1-2" else None
            axes.plot(x, y, "-" if i else "--", color=shade, label=label, linewidth=1.4)
        hinges = np.array([step.position(node) for node in ("1", "2", "4", "5")])
        axes.plot(*hinges[:, :2].T, "o", color=shade, fillstyle="none", markersize=4)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Flexible links")
    axes.legend(fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.2))


def _draw_curves(axes: Axes) -> None:
    for name, scene, style in (("rigid links", rigid(), "--"), ("flexible links", flexible(), "-")):
        alpha, beta = curve(scene)
        axes.plot(np.degrees(alpha), np.degrees(beta), style, label=name)
    chosen = transmission(flexible())
    axes.plot(np.degrees(chosen.alpha), np.degrees(chosen.beta), "o", color="C1", label="the moments on the left")
    axes.set(xlabel="input angle alpha, degrees", ylabel="output angle beta, degrees", title="Transmission")
    axes.grid(color="#EBEBEB")
    axes.legend(fontsize=8)


def table() -> list[str]:
    """Angles and ratios of both mechanisms, a line a moment."""
    lines = [f"{'links':>9} {'M, N m':>8} {'alpha, rad':>12} {'beta, rad':>12} {'d beta/d alpha':>15}"]
    for name, scene in (("rigid", rigid()), ("flexible", flexible())):
        found = transmission(scene)
        rows = zip(MOMENTS, found.alpha, found.beta, found.ratio, strict=True)
        lines += [f"{name:>9} {m:8g} {alpha:12.8f} {beta:12.8f} {ratio:15.6f}" for m, alpha, beta, ratio in rows]
    return lines


if __name__ == "__main__":
    print(*table(), sep="\n")
    for name, difference in check().items():
        print(f"{name}: {difference:.1e}")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "parallelogram_transmission.png", dpi=150)
