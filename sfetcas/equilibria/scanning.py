"""All equilibria of one plane member with a free end, by a scan of the one unknown number.

Under loads that keep their directions the internal force of such a member is known everywhere, whatever its shape.
From the free end, where the moment is known too, the angle there gives the whole shape (shooting): what the other end
wants, an angle or no moment, is an equation for that one angle, which need only be scanned over one turn.  The
derivative is integrated beside, and the scan is halved until between neighbours what it finds is what a cubic
expects, extrema included: between these the function is monotone, and every root is bracketed.  So the scan is
complete, but for pairs of roots that nearly coincide at an extremum; a note reports these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .. import tolerances
from ..description.records import counted
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.model import Model
from ..solvers.deflation import deflated
from ..solvers.prepared import Solved
from .solution import Equilibrium

__all__ = ["Scan", "scan"]

SAMPLES = 64
"""Angles that the scan begins with, evenly over one turn."""

NEAREST = 1e-40
"""Samples beside the direction of the load at the free end, to both sides, go down to this angle, rad.

A long beam pulled along itself grows ``e^sqrt(F L^2 / EI)`` times further from it: 1e37 under 7000 EI/L^2.
"""

STEP = 0.1
"""Step of integration in ``sqrt(EI / force)``: fourth order, so 1e-6 of what a beam does within that length."""

FEWEST = 64
"""Steps of integration at least."""

CUBIC = 1e-4
"""By how much, in turns or moments L/EI, the middle of two samples may differ from the cubic between them."""

HALVINGS = 60
"""Halvings of an interval at most: then two samples are neighbouring numbers."""

MOST_SAMPLES = 20_000
"""A scan that needs more is given up."""

ROOT, FLAT, ITERATIONS = 1e-9, 1e-6, 60
"""Roots and extrema are sought to these shares of the distance of two samples, in so many steps at most."""

ROUNDED, NEIGHBOURS = 1e-15, 1e-15
"""Where the direction of the load changes along the member angles are exact to this; two numbers are one nearer by."""

GRAZING = 1e-6
"""An extremum this near to a root, in turns or moments L/EI, may be two roots, one or none."""

BLURRED = 1e9
"""Slope over that of what is exact from which on rounding of angles is felt, and no scan is complete."""

FROM_THE_ROOT = 0.3
"""What Newton's method makes of a root is not further from it than this, rad."""


@dataclass(eq=False)
class Scan:
    """Result of a scan; it has the interface of :class:`~sfetcas.equilibria.several.Search`.

    Attributes
    ----------
    found : list of Solved
        Distinct equilibria; the first is the one that the scan was given.
    roots : int
        Number of equilibria that the scan counts.
    grazing : int
        Extrema of the shooting function that are zero, or nearly.
    """

    found: list[Solved]
    roots: int
    grazing: int

    def sentence(self) -> str:
        """A sentence on how complete the scan is, for the notes of the answer."""
        count = counted(self.roots, "equilibrium", "equilibria")
        text = f"a scan of the angle at the free end over one turn has {count}, and there are no others"
        if self.grazing:
            text += (
                f", but for {counted(self.grazing, 'pair')} that nearly meet, of which one, both or none may be listed"
            )
        if len(self.found) != self.roots:
            text += f"; Newton's method found {len(self.found)} of them on the mesh of the search"
        return text

    def family_note(self, number: int) -> tuple[str, ...]:
        """Empty: a scan of one unknown finds no continuous families of equilibria."""
        return ()

    def missing(self, answers: list[Equilibrium]) -> str:
        """A remark on equilibria that were counted but not found on finer meshes; empty where there are none."""
        lost = self.roots - len(answers)
        return f"; {counted(lost, 'equilibrium', 'equilibria')} of the scan could not be refined" if lost > 0 else ""


def scan(first: Solved) -> Scan | None:
    """All equilibria under the loads of a known one, by shooting over the angle at the free end.

    None where the problem does not have a single unknown, or rounding errors spoil the scan.
    """
    prepared, loading = first.prepared, first.loading
    member = _member(prepared.model)
    if member is None:
        return None
    shooting = _Shooting(first, member)
    brackets = shooting.brackets()
    if brackets is None:
        return None
    roots = shooting.roots(*brackets)
    found = [first]
    for state in shooting.states(roots, first.state):
        there = prepared.correct(state, loading, iterations=25, most=1.0)
        if not there.converged:
            there = deflated(prepared, state, loading, ()) or there
        new = all(prepared.distance(there.state, other.state) > tolerances.SAME_STATE for other in found)
        if new and there.converged and prepared.distance(there.state, state) < FROM_THE_ROOT:
            found.append(there)
    return Scan(found, len(roots), shooting.grazing)


def _member(model: Model) -> str | None:
    """The member of a scene that has one, flexible, with a free end and the other one clamped or hinged."""
    scene = model.scene
    others = scene.contacts or scene.springs or scene.rotating is not None
    others = others or scene.stretches or any(member.off_line(scene.sections) for member in scene.members.values())
    joined = any(not group.kind.is_load for group in model.connections)
    if model.space or others or len(scene.members) != 1 or not model.has_potential or joined:
        return None
    (name, member), *_ = scene.members.items()
    if member.type != "flexible" or set(member.release) != {"rigid"}:
        return None
    supports = [scene.nodes[node].support for node in member.nodes]
    supported = [support for support in supports if support != "free"]
    return name if len(supported) == 1 and supported[0] in ("clamped", "hinge") and len(supports) == 2 else None


class _Shooting:
    """The shape from the free end on, for any number of angles there at once; SI units."""

    def __init__(self, first: Solved, name: str) -> None:
        model, fields = first.model, first.fields
        scene, self.model, self.name = model.scene, model, name
        member, line = scene.members[name], scene.center_lines[name]
        supports = [scene.nodes[node].support for node in member.nodes]
        self.backwards = supports[1] == "free"
        self.clamped = "clamped" in supports
        self.places = model.along(name)
        self.fixed_angle = float(first.state.q[model.chain(name)[0 if self.backwards else -1], 0])
        self.grazing = 0
        section = scene.sections[str(member.section)]
        axis = 1 if line.bending_axis == 2 else 2
        moments = first.loading.moment[model.chain(name)][:, 2] * model.scales.moment
        knots = np.unique(np.concatenate([model.mesh.cuts[name], self.places[moments != 0.0], [0.0, 1.0]]))
        middles = 0.5 * (knots[1:] + knots[:-1])
        forces = np.linalg.norm(fields.along(name, np.concatenate([knots, middles]))["force"], axis=1).max(initial=0.0)
        softest = float(section.stiffness(np.linspace(0.0, 1.0, 33))[:, axis].min())
        self.unit = softest / line.length
        count = np.ceil(np.diff(knots) * max(FEWEST, line.length * np.sqrt(forces / softest) / STEP)).astype(int)
        # Begin, middle and end of each step; inside of it, where what jumps at a knot has its own side.
        begins = np.concatenate(
            [a + (b - a) / n * np.arange(n) for a, b, n in zip(knots, knots[1:], count, strict=False)]
        )
        lengths = np.repeat(np.diff(knots) / count, count)
        inside = begins[:, None] + lengths[:, None] * np.array([WITHIN, 0.5, 1.0 - WITHIN])
        section_forces = fields.along(name, inside.ravel())["force"].reshape(*inside.shape, 3)
        tangents = line.tangents(inside.ravel()).reshape(*inside.shape, 3)
        rest, stiffness = np.arctan2(tangents[..., 1], tangents[..., 0]), section.stiffness(inside.ravel())[:, axis]
        soft = line.length / stiffness.reshape(inside.shape)
        pull = (
            line.length * np.hypot(section_forces[..., 0], section_forces[..., 1]),
            np.arctan2(section_forces[..., 1], section_forces[..., 0]),
        )
        # Of the moment of a place the end of the step before it and the begin of the one after differ.
        jump = np.zeros(len(begins) + 1)
        jump[np.searchsorted(begins, self.places[moments != 0.0] - tolerances.DECIMAL)] = moments[moments != 0.0]
        self.at = np.append(begins, 1.0)
        if self.backwards:
            self.sign, order, self.at = -1.0, slice(None, None, -1), self.at[::-1]
            columns = [2, 1, 0]
        else:
            self.sign, order, columns = 1.0, slice(None), [0, 1, 2]
        self.lengths, self.jump = self.sign * lengths[order], self.sign * jump[order]
        self.soft, self.pull, self.toward = (values[order][:, columns] for values in (soft, pull[0], pull[1] - rest))
        # Angles are counted from the direction of the force at the free end, beside which they have to be exact.
        self.along = float(self.toward[0, 0])
        self.toward = self.toward - self.along
        self.exact = not np.abs(self.toward).max() > 0.0

    def shot(self, angles: Array, *, course: bool = False) -> tuple[Array, Array, Array]:
        """What the held end misses by, in turns or moments L/EI, its derivative by the angles, and the shapes.

        Angles are those of the free end from :attr:`along`; shapes are rotations at :attr:`at`, (angles, places), none
        unless they are wanted.
        """
        q, m = angles.astype(float), np.full(len(angles), -self.jump[0])
        dq, dm = np.ones(len(angles)), np.zeros(len(angles))
        shapes = [q]

        def rate(i: int, k: int, q: Array, m: Array, dq: Array, dm: Array) -> tuple[Array, Array, Array, Array]:
            a = q - self.toward[i, k]
            soft, pull = self.soft[i, k], self.pull[i, k]
            return soft * m, pull * np.sin(a), soft * dm, pull * np.cos(a) * dq

        for i, h in enumerate(self.lengths):
            now = q, m, dq, dm
            one = rate(i, 0, *now)
            two = rate(i, 1, *(z + 0.5 * h * r for z, r in zip(now, one, strict=True)))
            three = rate(i, 1, *(z + 0.5 * h * r for z, r in zip(now, two, strict=True)))
            four = rate(i, 2, *(z + h * r for z, r in zip(now, three, strict=True)))
            q, m, dq, dm = (
                z + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                for z, a, b, c, d in zip(now, one, two, three, four, strict=True)
            )
            # What acts at a place makes the difference between its two sides.
            m = m - self.jump[i + 1]
            if course:
                shapes.append(q)
        if self.clamped:
            value, slope = (q + self.along - self.fixed_angle) / (2.0 * np.pi), dq / (2.0 * np.pi)
        else:
            value, slope = m / self.unit, dm / self.unit
        return value, slope, np.array(shapes).T + self.along

    def brackets(self) -> tuple[Array, Array, Array, Array] | None:
        """Angles on both sides of each root and the level it is at; None where rounding hides roots."""
        beside = np.outer([1.0, -1.0], np.geomspace(NEAREST if self.exact else ROUNDED, 0.1, 80)).ravel()
        x = np.unique(np.concatenate([np.linspace(-0.6 * np.pi, 1.4 * np.pi, SAMPLES + 1), beside]))
        f, d, _ = self.shot(x)
        rough = np.ones(len(x) - 1, dtype=bool)
        for _ in range(HALVINGS):
            left = np.flatnonzero(rough & (np.diff(x) > NEIGHBOURS * np.maximum(np.abs(x[1:]), np.abs(x[:-1]))))
            if not len(left) or len(x) > MOST_SAMPLES:
                break
            a, b = x[left], x[left + 1]
            middle, h = 0.5 * (a + b), b - a
            value, slope, _ = self.shot(middle)
            expected = 0.5 * (f[left] + f[left + 1]) + 0.125 * h * (d[left] - d[left + 1])
            steep = 1.5 * (f[left + 1] - f[left]) / h - 0.25 * (d[left] + d[left + 1])
            apart = np.abs(value - expected) > CUBIC
            # The slope is that of the cubic, too, as far as that makes a difference over the interval.
            apart |= np.abs(slope - steep) * h > CUBIC + 0.1 * np.abs(slope) * h
            x, f, d = (np.insert(old, left + 1, new) for old, new in ((x, middle), (f, value), (d, slope)))
            rough = np.zeros(len(x) - 1, dtype=bool)
            there = left + np.arange(len(left))
            rough[there], rough[there + 1] = apart, apart
        blurred = np.abs(d) * (np.abs(x) if self.exact else 1.0) > BLURRED
        if blurred.any() or len(x) > MOST_SAMPLES or not np.isfinite(f).all():
            return None
        x, f = self._with_extrema(x, f, d)
        return self._crossed(x, f)

    def _with_extrema(self, x: Array, f: Array, d: Array) -> tuple[Array, Array]:
        """The samples with those between them where the slope vanishes."""
        turns = np.flatnonzero(d[1:] * d[:-1] < 0.0)
        if not len(turns):
            return x, f
        places = _bracketed(lambda at, _: (self.shot(at)[1], np.zeros(len(at))), x[turns], x[turns + 1], d[turns], FLAT)
        return np.insert(x, turns + 1, places), np.insert(f, turns + 1, self.shot(places)[0])

    def _crossed(self, x: Array, f: Array) -> tuple[Array, Array, Array, Array]:
        """Brackets of the levels between neighbours, and how many extrema nearly touch one."""
        low, high, level, begin = [], [], [], []
        for i in range(len(x) - 1):
            a, b = sorted((f[i], f[i + 1]))
            for k in range(int(np.ceil(a)), int(np.floor(b)) + 1) if self.clamped else ([0] if a <= 0.0 <= b else []):
                # A root at a sample belongs to the interval before it.
                if f[i] == k and i:
                    continue
                low.append(x[i])
                high.append(x[i + 1])
                level.append(float(k))
                begin.append(f[i] - k)
        peaks = np.flatnonzero((f[1:-1] - f[:-2]) * (f[2:] - f[1:-1]) < 0.0) + 1
        off = f[peaks] - np.round(f[peaks]) if self.clamped else f[peaks]
        self.grazing = int((np.abs(off) < GRAZING).sum())
        return np.array(low), np.array(high), np.array(level), np.array(begin)

    def roots(self, low: Array, high: Array, level: Array, begin: Array) -> Array:
        """Angles at the free end of all equilibria."""
        if not len(low):
            return low

        def missed(at: Array, number: Array) -> tuple[Array, Array]:
            value, slope, _ = self.shot(at)
            return value - level[number], slope

        places = _bracketed(missed, low, high, begin, ROOT)
        # A whole turn of the scan is the same shape: its first and last angle.
        same = len(places) > 1 and abs(places[-1] - places[0] - 2.0 * np.pi) < 1e-9
        return places[:-1] if same else places

    def states(self, roots: Array, known: State) -> list[State]:
        """The shapes of roots on the mesh, the held end where it is; near a known state where nothing holds it."""
        if not len(roots):
            return []
        value, _, shapes = self.shot(roots, course=True)
        chain, found = self.model.chain(self.name), []
        for turns, shape in zip(value, shapes, strict=True):
            order = slice(None, None, -1) if self.backwards else slice(None)
            angles = np.interp(self.places, self.at[order], shape[order])
            back = (
                np.round(turns) if self.clamped else np.round((angles.mean() - known.q[chain].mean()) / (2.0 * np.pi))
            )
            q = known.q.copy()
            q[chain, 0] = angles - 2.0 * np.pi * back
            found.append(replace(known, q=q))
        return found


WITHIN = 1e-9
"""Share of a step by which its ends are looked at from within."""


def _bracketed(
    function: Callable[[Array, Array], tuple[Array, Array]], low: Array, high: Array, begin: Array, share: float
) -> Array:
    """Places between ``low``, where a function has the sign of ``begin``, and ``high`` where it vanishes, all at once.

    The function takes places and the numbers of their brackets, and gives its values and slopes: Newton's method where
    it stays between what is known, halving where not, down to a share of the first bracket.
    """
    least = share * np.abs(high - low)
    low, high, sign = low.copy(), high.copy(), np.sign(begin)
    place, active = 0.5 * (low + high), np.arange(len(low))
    for _ in range(ITERATIONS):
        value, slope = function(place[active], active)
        same = np.sign(value) == sign[active]
        low[active] = np.where(same, place[active], low[active])
        high[active] = np.where(same, high[active], place[active])
        with np.errstate(divide="ignore", invalid="ignore"):
            trial = place[active] - value / slope
        a, b = np.minimum(low[active], high[active]), np.maximum(low[active], high[active])
        good = (trial > a) & (trial < b)
        trial = np.where(good, trial, 0.5 * (a + b))
        moved = np.abs(trial - place[active])
        place[active] = trial
        active = active[(moved > least[active]) & (b - a > least[active])]
        if not len(active):
            break
    return place
