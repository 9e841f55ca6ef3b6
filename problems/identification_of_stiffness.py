"""Bending stiffness and mass per length of a strip from noisy points of it, with bounds of confidence.

A strip of spring steel, 25 mm x 0.5 mm and half a metre long, is clamped level and bends under its weight and forces
at its tip.  Five points of it are measured under each of three forces, with a standard deviation of half a millimetre.
EI and rhoA follow by least squares, begun 40 % off; as derivatives are exact, bounds of confidence and their ellipse
come with them.  ``python problems/identification_of_stiffness.py [PICTURE]`` prints and draws them.

Source of the measured points: shooting with Runge and Kutta's method, nothing of the elements, and normal noise of a
fixed seed.  Checked: points without noise give back both numbers; of many experiments the bounds hold the truth as
often as they say, and so does the ellipse.
"""

from __future__ import annotations

import functools
import sys

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sfetcas import (
    Analysis,
    CrossSection,
    Fit,
    Fitting,
    Load,
    Measurement,
    Member,
    Node,
    Scene,
    Solution,
    fitting,
    solve,
)

LENGTH, GRAVITY = 0.5, 9.81
STIFFNESS, MASS = 0.0536, 0.0981
"""Of the strip: N m2 and kg/m; 206 GPa, 7850 kg/m3."""

FORCES = (0.0, -0.2, 0.3)
"""At the tip, upwards, N."""

PLACES = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Fractions of the length of the measured points."""

NOISE = 5e-4
"""Standard deviation of each coordinate, m."""

EXPERIMENTS, CONFIDENCE = 80, 0.95

NAMES = ("sections.strip.EI3", "sections.strip.rhoA")

EXACT = 1e-7
"""Relative: points are right to 1e-7 of the length or better, and thirty of them average their errors."""

TOLERANCE = 1.0
"""Each difference is told over what it may be at most."""


def scene(stiffness: float = 1.4 * STIFFNESS, mass: float = 0.6 * MASS, force: float = 0.0) -> Scene:
    """The strip as it is thought to be before anything is measured."""
    return Scene(
        title="Strip whose stiffness is looked for",
        gravity=[0, -GRAVITY],
        sections={"strip": CrossSection(EI3=stiffness, rhoA=mass)},
        nodes={"clamp": Node(position=[0, 0], support="clamped"), "tip": Node(position=[LENGTH, 0])},
        members={"strip": Member(nodes=["clamp", "tip"], section="strip")},
        loads={"tip": Load(type="force", node="tip", value=[0, force])},
        analysis=Analysis(accuracy=1e-7),
    )


# -- what is measured ---------------------------------------------------------------------------------


def shot(force: float, steps: int = 200) -> np.ndarray:
    """Points (steps + 1, 2) of the strip by shooting: EI theta'' = -(F - rhoA g (L - s)) cos(theta)."""
    h = LENGTH / steps

    def rate(s: float, z: np.ndarray) -> np.ndarray:
        theta, curvature, _, _ = z
        across = force - MASS * GRAVITY * (LENGTH - s)
        return np.array([curvature, -across * np.cos(theta) / STIFFNESS, np.cos(theta), np.sin(theta)])

    def course(curvature: float) -> np.ndarray:
        z = [np.array([0.0, curvature, 0.0, 0.0])]
        for i in range(steps):
            a = rate(i * h, z[-1])
            b = rate((i + 0.5) * h, z[-1] + 0.5 * h * a)
            c = rate((i + 0.5) * h, z[-1] + 0.5 * h * b)
            d = rate((i + 1) * h, z[-1] + h * c)
            z.append(z[-1] + h / 6.0 * (a + 2.0 * b + 2.0 * c + d))
        return np.array(z)

    first, second = 0.0, 0.1
    ends = [course(x)[-1, 1] for x in (first, second)]
    while abs(second - first) > 1e-13 and ends[0] != ends[1]:
        first, second = second, second - ends[1] * (second - first) / (ends[1] - ends[0])
        ends = [ends[1], course(second)[-1, 1]]
    return course(second)[:, 2:]


@functools.cache
def exact() -> tuple[Measurement, ...]:
    """The points without noise."""
    found = []
    for force in FORCES:
        points = shot(force)
        for place in PLACES:
            there = points[round(place * (len(points) - 1))]
            name = f"members.strip.position at {place:g}"
            found.append(Measurement(name, there.tolist(), NOISE, {"loads.tip.value": [0.0, force]}))
    return tuple(found)


@functools.cache
def prepared() -> Fitting:
    """The fit of these points, for any noise."""
    return fitting(scene(), list(NAMES), exact())


def noise(seed: int = 1) -> np.ndarray:
    """What disturbs the points in all experiments, (experiments, numbers)."""
    return NOISE * np.random.default_rng(seed).standard_normal((EXPERIMENTS, len(prepared().values)))


def experiment() -> Fit:
    """The first of the experiments."""
    return prepared().fit(prepared().values + noise()[0])


# -- what is checked ----------------------------------------------------------------------------------


def held() -> tuple[float, float, float]:
    """Shares of the experiments in which the bounds of each number, and the ellipse of both, hold the truth."""
    truth, begin = np.array([STIFFNESS, MASS]), dict(zip(NAMES, (STIFFNESS, MASS), strict=True))
    found = []
    for disturbed in prepared().values + noise():
        fit = prepared().fit(disturbed, start=begin)
        bounds = np.array(list(fit.bounds(CONFIDENCE).values()))
        off = truth - np.array(list(fit.estimates.values()))
        inside = off @ np.linalg.solve(fit.covariance, off) <= -2.0 * np.log(1.0 - CONFIDENCE)
        found.append([*((bounds[:, 0] <= truth) & (truth <= bounds[:, 1])), inside])
    one, other, both = np.mean(found, axis=0)
    return float(one), float(other), float(both)


def recovered() -> dict[str, float]:
    """What points without noise give, off the truth."""
    found = prepared().fit().estimates
    pairs = zip(NAMES, (STIFFNESS, MASS), strict=True)
    return {f"{name} from points without noise": abs(found[name] / true - 1.0) / EXACT for name, true in pairs}


def trusted() -> dict[str, float]:
    """How often bounds hold the truth, off what they say."""
    # Three standard deviations of the share of so many independent experiments.
    most = 3.0 * np.sqrt(CONFIDENCE * (1.0 - CONFIDENCE) / EXPERIMENTS)
    shares = zip((*NAMES, "both"), held(), strict=True)
    return {f"how often bounds hold {what}": abs(share - CONFIDENCE) / most for what, share in shares}


def check() -> dict[str, float]:
    """Differences over what they may be at most."""
    return recovered() | trusted()


# -- what is told -------------------------------------------------------------------------------------


def table() -> list[str]:
    """Estimates with their bounds, a line each."""
    fit, lines = experiment(), []
    for name, true in zip(NAMES, (STIFFNESS, MASS), strict=True):
        (low, high), (first, last) = fit.bounds()[name], fit.bounds(full=True)[name]
        lines.append(f"{name}: {fit.estimates[name]:.5f}, 95 % from {low:.5f} to {high:.5f}, true {true:.5f}")
        lines.append(f"  with second derivatives from {first:.5f} to {last:.5f}")
    share = fit.chi_square / fit.freedom
    return [*lines, f"chi-square over freedom {share:.2f}, more by chance in {100 * (fit.probability or 0.0):.0f} %"]


def answer() -> Solution:
    """The fitted strip under the last force."""
    return solve(scene(*experiment().estimates.values(), force=FORCES[-1]))


def picture() -> Figure:
    """Measured points with the fitted strip, and the ellipse of confidence."""
    figure = Figure(figsize=(11.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    fit = experiment()
    _draw_strips(left, fit)
    _draw_ellipse(right, fit)
    return figure


def _draw_strips(axes: Axes, fit: Fit) -> None:
    fractions, points = np.linspace(0.0, 1.0, 41), fit.measured.reshape(len(FORCES), -1, 2)
    for i, force in enumerate(FORCES):
        for numbers, style in (((), ":"), (fit.estimates.values(), "-")):
            x, y, _ = solve(scene(*numbers, force=force)).last.along("strip", fractions)["position"].T
            label = f"F = {force:g} N" if style == "-" else None
            axes.plot(x, y, style, color=f"C{i}", linewidth=1.2, label=label)
        axes.errorbar(*points[i].T, NOISE, NOISE, fmt=".", color=f"C{i}", markersize=4)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="Measured points, first guess dotted, fit")
    axes.legend(fontsize=8)


def _draw_ellipse(axes: Axes, fit: Fit) -> None:
    axes.plot(*fit.ellipse(*NAMES, confidence=CONFIDENCE).T, label="95 % together")
    for draw, name in ((axes.axvline, NAMES[0]), (axes.axhline, NAMES[1])):
        for end in fit.bounds(CONFIDENCE)[name]:
            draw(end, color="0.7", linewidth=0.8, linestyle="--")
    axes.plot(*fit.estimates.values(), "o", label="estimate")
    axes.plot(STIFFNESS, MASS, "k+", markersize=10, label="truth")
    axes.set(xlabel="EI, N m²", ylabel="rhoA, kg/m", title="Confidence")
    axes.legend(fontsize=8, loc="lower right")


if __name__ == "__main__":
    print(*table(), sep="\n")
    for name, difference in check().items():
        print(f"{name}: {difference:.2f} of what may be")
    picture().savefig(sys.argv[1] if len(sys.argv) > 1 else "identification_of_stiffness.png", dpi=150)
