"""Colours, dashes and legend texts by which a picture tells steps, or equilibria under the same loads, apart.

Stable states are solid, unstable ones dashed, those whose stability is neutral dash-dotted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..equilibria.solution import Equilibrium, Solution
from ..mathematics.arrays import Array
from .sketch import Ink, Look, Sketch, in_short

__all__ = ["PALETTE", "dashes_of", "looks_of_equilibria", "looks_of_steps", "number_of"]

MANY = 12
"""More thin lines than that have one legend for all of a kind."""
PALETTE = ("#C98A00", "#009E73", "#56B4E9", "#CC5FA0", "#7A5230", "#6B7A00", "#6A51A3", "#00808A")
BOLD = "#222222"
UNSTABLE, NEUTRAL = (0, (6, 2.5)), (0, (6, 2, 1, 2))


def dashes_of(stable: bool | str) -> object:
    """Line style of a stability."""
    return {False: UNSTABLE, "neutral": NEUTRAL}.get(stable, "-")


def _state(step: Equilibrium) -> str:
    return {False: "unstable", "neutral": "neutral", True: "stable"}.get(step.certificate.stable, "")


def _remark(step: Equilibrium) -> str:
    """What is said besides the factor: nothing of what is stable."""
    state = _state(step)
    return "" if state in ("", "stable") else f", {state}"


def looks_of_steps(steps: Sequence[Equilibrium]) -> list[Look]:
    """Earlier steps paler the earlier, and what the legend says of the last one."""
    *earlier, last = steps
    texts = [f"factor {in_short(step.factor)}{_remark(step)}" for step in earlier]
    if len(earlier) > 5:
        texts = _together(earlier)
    looks = [
        Look(shade, dashes_of(step.certificate.stable), text)
        for shade, step, text in zip(_shades(len(earlier)), earlier, texts, strict=True)
    ]
    said = bool(earlier) or last.factor != 1.0 or bool(_remark(last))
    bold = f"{'bold: ' if earlier else ''}factor {in_short(last.factor)}{_remark(last)}"
    return [*looks, Look(BOLD, "-", bold if said else "")]


def _together(steps: Sequence[Equilibrium]) -> list[str]:
    """One text for all steps of the same stability, at the middle one of them."""
    texts = [""] * len(steps)
    for remark in dict.fromkeys(map(_remark, steps)):
        alike = [i for i, step in enumerate(steps) if _remark(step) == remark]
        factors = [steps[i].factor for i in alike]
        span = f"{in_short(min(factors))} to {in_short(max(factors))}"
        texts[alike[len(alike) // 2]] = f"{len(alike)} other factors, {span}{remark}"
    return texts


def _shades(count: int) -> list[str]:
    """Colours of earlier steps, paler the earlier."""
    pale, firm = np.array([0.80, 0.85, 0.90]), np.array([0.42, 0.53, 0.65])
    shares = np.linspace(0.0, 1.0, count) if count > 1 else np.ones(count)
    rounded = [(255 * (pale + share * (firm - pale))).round().astype(int) for share in shares]
    return ["#" + "".join(f"{c:02X}" for c in colour) for colour in rounded]


def number_of(solution: Solution, index: int) -> int:
    """Number of an equilibrium, from 1, among those of its factor."""
    factor = solution.steps[index].factor
    return sum(step.factor == factor for step in solution.steps[: index + 1])


def looks_of_equilibria(sketch: Sketch, solution: Solution, indices: Sequence[int]) -> list[Look]:
    """A colour of its own for each equilibrium, whose number is put beside its line; the last is bold."""
    factors = {solution.steps[i].factor for i in indices}
    looks, many = [], len(indices) > MANY + 1
    for place, i in enumerate(indices):
        step, number = solution.steps[i], number_of(solution, i)
        at = f", factor {in_short(step.factor)}" if factors != {1.0} else ""
        bold = place == len(indices) - 1
        colour = BOLD if bold else PALETTE[place % len(PALETTE)]
        text = f"{number}{' (bold)' if bold else ''}: {_state(step)}{at}"
        if many and not bold:
            colour, text = PALETTE[step.certificate.stable is True], f"others, {_state(step)}"
        looks.append(Look(colour, "-" if bold else dashes_of(step.certificate.stable), text))
        if len(indices) > 1:
            lines = sketch.course.last if bold else sketch.course.earlier[place]
            anchor = _apart(sketch, lines, [*sketch.course.earlier, sketch.course.last], place)
            sketch.label(str(number), anchor, np.array([0.0, 1.0]), Ink(f"equilibrium-{number}", colour, 1.0))
    return looks


def _apart(sketch: Sketch, lines: list[Array], all_lines: list[list[Array]], place: int) -> Array:
    """The sample (3,) of the lines that is farthest from all other lines in the picture."""
    own = np.vstack(lines)[::4]
    others = np.vstack([line[::4] for i, other in enumerate(all_lines) if i != place for line in other])
    flat, rest = sketch.view.flat(own), sketch.view.flat(others)
    distances = np.array([np.hypot(*(rest - point).T).min() for point in flat])
    return np.asarray(own[int(np.argmax(distances))])
