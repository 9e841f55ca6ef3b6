"""Text reports of answers, sweeps and checks that the command line prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .checks import Answer, Check
from .description.answers import answer_name
from .description.records import counted, enumerated
from .description.showing import WAYS, error_in_words, stability_in_words
from .dynamics.motion import MotionState, Trajectory
from .equilibria.solution import Equilibrium
from .mathematics.arrays import Array, first_of_largest
from .mechanics.model import Model
from .paths.path import Branch, FlutterPoint, TransitionPoint
from .paths.path import Path as Course
from .quoting import printable

if TYPE_CHECKING:
    from .dynamics.modes import Modes
    from .sweeps.result import Sweep

__all__ = ["print_checks", "report", "report_sweep"]

MOST_NODES, MOST_EVENTS = 20, 10
"""Nodes in the printed report at most."""

ROUNDING = 1e-13
"""Share of the largest number of its kind below which a printed number is rounding: it is printed as 0."""


def report(solution: Answer, seconds: float) -> None:
    """Print an answer that took so many seconds from its file on, without pictures and other files."""
    model = solution.last.model
    print(printable(solution.scene.title) or "untitled scene")
    print(f"  {model.dimension}: {model.reason}")
    print(f"  {model.size_in_words}")
    if isinstance(solution, Course):
        _report_path(solution)
    if solution.scene.analysis.type == "modes":
        _report_modes(cast("Modes", solution))
    if isinstance(solution, Trajectory):
        _report_motion(solution)
    else:
        said: set[str] = set()
        for step, place in zip(solution.steps, _places(solution), strict=True):
            _report_step(step, place, said)
    split = ", ".join(f"{what} {spent:.3f} s" for what, spent in solution.seconds.items())
    print(f"{solution.status.value} in {seconds:.3f} s ({split})")


def _report_path(path: Course) -> None:
    counts = {"limit point": 0, "bifurcation": 0, "flutter point": 0, "transition": 0}
    for number, branch in enumerate(path.branches):
        name = f"branch {number} at bifurcation {branch.bifurcation}, side {branch.side:+d}" if number else "path"
        low, high = branch.factors.min(), branch.factors.max()
        print(f"{name}: {counted(len(branch.points), 'point')}, factors {low:.6g} to {high:.6g}; {branch.end}")
        for stable, first, last in branch.stretches():
            # In contact the point where stability changes is not located: the last of its kind is that of a sample.
            digits = 3 if path.scene.contacts else 9
            ends = list(dict.fromkeys(f"{branch.points[i].factor:.{digits}g}" for i in (first, last)))
            kind = {"True": "stable", "False": "unstable", "not defined": "stability not defined"}.get(
                str(stable), "neutral"
            )
            where = f"from factor {ends[0]} to {ends[1]}" if len(ends) > 1 else f"at factor {ends[0]}"
            if len(ends) == 1 and (first, last) == (0, len(branch.points) - 1):
                # A closed branch ends where it begins.
                where = "all along"
            print(f"  {kind} {where}")
        _report_events(branch, counts)
    if path.error_estimate is not None:
        print(f"  estimated error along it {path.error_estimate:.1e}")
    for note in path.notes:
        print(f"  note: {note}")


def _report_motion(motion: Trajectory) -> None:
    answers = counted(len(motion.steps), "answer")
    print(f"  {motion.integrator}, {counted(motion.count, 'step')} in time, {answers} up to {motion.last.time:.9g} s")
    ends = [motion.steps[0], motion.last] if len(motion.steps) > 1 else [motion.last]
    for instant in ends:
        _report_instant(instant)
    if len(ends) > 1:
        _report_course(motion)
    for event in motion.events[:MOST_EVENTS]:
        print(f"  {event}")
    if len(motion.events) > MOST_EVENTS:
        print(f"  ... and {counted(len(motion.events) - MOST_EVENTS, 'more event')}, see --json")
    worst = ", ".join(f"{kind} {value:.1e}" for kind, value in motion.violation.items())
    print(f"  worst violation: {worst}; {error_in_words(motion.error_estimate, motion.error_of)}")
    for note in motion.notes:
        print(f"  note: {note}")


def _report_instant(instant: MotionState) -> None:
    print(f"at {instant.time:.9g} s")
    sizes, nodes = _sizes(instant), instant.model.nodes[:MOST_NODES]
    velocities = {name: instant.velocity(name) for name in nodes}
    fastest = max(float(np.abs(velocity).max()) for velocity in velocities.values())
    for name, velocity in velocities.items():
        position = _vector(instant.position(name), sizes["m"])
        print(f"  node {name}: position {position} m, velocity {_vector(velocity, fastest)} m/s")
    _report_more_nodes(instant.model)
    _report_reactions(instant, sizes)
    energy = ", ".join(f"{kind} {value:.9g}" for kind, value in instant.energy.items())
    print(f"  energy: {energy} N m")


def _report_reactions(state: Equilibrium | MotionState, sizes: Mapping[str, float]) -> None:
    for name, (force, moment) in _reactions(state).items():
        print(f"  reaction {name}: force {_vector(force, sizes['N'])} N, moment {_vector(moment, sizes['N m'])} N m")


def _reactions(state: Equilibrium | MotionState) -> dict[str, tuple[Array, Array]]:
    supported = [name for name, node in state.model.scene.nodes.items() if node.support != "free"]
    return {name: state.reaction(name) for name in supported}


def _sizes(state: Equilibrium | MotionState) -> dict[str, float]:
    """By unit what a number of this unit is compared with: the size of the scene, one radian, the largest reactions.

    Of forces also the tensions of tendons, which may pull on what needs no support.
    """
    reactions = list(_reactions(state).values())
    force, moment = (max((float(np.abs(one[i]).max()) for one in reactions), default=0.0) for i in (0, 1))
    force = max([force, *(abs(state.tendon(name)["tension"]) for name in state.model.scene.tendons)])
    length = state.model.scales.length
    return {"m": length, "rad": 1.0, "N": max(force, moment / length), "N m": max(moment, force * length)}


def _report_course(motion: Trajectory) -> None:
    """What is largest over the answers, and what should stay as it is."""
    print("over all answers")
    _report_largest(motion)
    total = motion.energies()
    largest = float(motion.energies("kinetic").max())
    print(
        f"  total energy: from {total.min():.9g} to {total.max():.9g} N m, off its first value by at most "
        f"{np.abs(total - total[0]).max():.1e} N m; largest kinetic energy {largest:.6g} N m"
    )
    if _floats(motion):
        for kind, unit in (("linear", "kg m/s"), ("angular", "kg m2/s")):
            values = np.array([step.momentum[kind] for step in motion.steps])
            off = float(np.linalg.norm(values - values[0], axis=1).max())
            print(f"  {kind} momentum: {_vector(values[0])} {unit} at first, off by at most {off:.1e}")


def _report_largest(motion: Trajectory) -> None:
    """Nodes that go the farthest and the fastest, and the largest reaction, with their times."""
    nodes = motion.last.model.nodes
    away = [np.linalg.norm(motion.positions(name) - motion.positions(name)[0], axis=1) for name in nodes]
    speed = [np.linalg.norm(motion.velocities(name), axis=1) for name in nodes]
    kinds = [("farthest from where it began", "node", nodes, away, "m"), ("fastest", "node", nodes, speed, "m/s")]
    supported = [name for name, node in motion.last.model.scene.nodes.items() if node.support != "free"]
    forces = [np.array([np.linalg.norm(step.reaction(name)[0]) for step in motion.steps]) for name in supported]
    kinds += [("largest reaction", "at", tuple(supported), forces, "N")] if supported else []
    for what, kind, names, values, unit in kinds:
        table = np.array(values)
        i, k = np.unravel_index(first_of_largest(table.ravel()), table.shape)
        if table[i, k] > 0.0:
            print(f"  {what}: {kind} {names[i]}, {table[i, k]:.6g} {unit} at {motion.times[k]:.6g} s")


def _floats(motion: Trajectory) -> bool:
    """Whether nothing holds the structure while it moves."""
    scene = motion.last.model.scene
    grounded = any(
        spring.to is None if spring.type == "translational" else not spring.between or "ground" in spring.between
        for spring in scene.springs.values()
    )
    grounded = grounded or any(way.ground is not None for tendon in scene.tendons.values() for way in tendon.way)
    return not grounded and all(node.support == "free" for node in scene.nodes.values())


def _report_more_nodes(model: Model) -> None:
    if len(model.nodes) > MOST_NODES:
        print(f"  ... and {counted(len(model.nodes) - MOST_NODES, 'more node')}, see --json")


def _report_modes(modes: Modes) -> None:
    estimate = f"estimated relative error {modes.error_estimate:.1e}"
    print(f"{counted(len(modes.modes), 'mode')}, {counted(modes.rigid, 'rigid motion')} left out; {estimate}")
    for number, mode in enumerate(modes.modes, start=1):
        faded = f", damping ratio {mode.damping:.6g}" if modes.damped else ""
        print(f"  mode {number}: {mode.omega:.9g} rad/s ({mode.omega / (2.0 * np.pi):.6g} Hz){faded}")
    for rate in modes.growing:
        print(f"  leaves the equilibrium at a rate of {rate:.9g} 1/s")
    if len(modes.buckling):
        factors = ", ".join(f"{factor:.9g}" for factor in modes.buckling)
        print(f"  buckles at factors, linear estimate: {factors}")
    for note in modes.notes:
        print(f"  note: {note}")


def _report_events(branch: Branch, counts: dict[str, int]) -> None:
    """Critical points of a branch, numbered on from those of the branches before, as in ``expect``."""
    kinds: tuple[tuple[str, Sequence[Equilibrium]], ...] = (
        ("limit point", branch.limit_points),
        ("bifurcation", branch.bifurcations),
        ("flutter point", branch.flutter_points),
        ("transition", branch.transitions),
    )
    for kind, entries in kinds:
        for entry in entries:
            counts[kind] += 1
            error = entry.certificate.error_estimate
            said = "" if error is None else f", estimated error {error:.1e}"
            ways = f", {counted(entry.certificate.negative, *WAYS)}" if entry.certificate.negative else ""
            wave = f", {entry.omega:.9g} rad/s" if isinstance(entry, FlutterPoint) else ""
            what = f", {enumerated(entry.changes)}" if isinstance(entry, TransitionPoint) else ""
            print(f"  {kind} {counts[kind]}: factor {entry.factor:.12g}{what}{wave}{ways}{said}")
            for note in entry.notes:
                print(f"    note: {note}")


def _places(solution: Answer) -> list[str]:
    """Which of several equilibria of its factor each entry is, in words; empty where one was asked for."""
    factors = [step.factor for step in solution.steps]
    if isinstance(solution, Course):
        named = [f", on branch {i}" if i else ", on the path" for i, b in enumerate(solution.branches) for _ in b.steps]
        numbers = [factors[: i + 1].count(f) for i, f in enumerate(factors)]
        several = len(solution.branches) > 1
        return [
            (f", crossing {number} of {factors.count(factor)}" if factors.count(factor) > 1 else "")
            + (name if several else "")
            for name, number, factor in zip(named, numbers, factors, strict=True)
        ]
    if solution.scene.analysis.equilibria == "one":
        return [""] * len(factors)
    return [f", equilibrium {factors[: i + 1].count(f)} of {factors.count(f)}" for i, f in enumerate(factors)]


def _report_step(step: Equilibrium, place: str, said: set[str]) -> None:
    """One answer; a note that was said of one before is not repeated."""
    print(f"factor {step.factor:g}{place}")
    sizes = _sizes(step)
    for name in step.model.nodes[:MOST_NODES]:
        angle = step.angle(name)
        turned = f"  angle {_number(angle, sizes['rad'])} rad" if angle is not None else ""
        print(f"  node {name}: position {_vector(step.position(name), sizes['m'])} m{turned}")
    _report_more_nodes(step.model)
    _report_reactions(step, sizes)
    for name in step.model.scene.springs:
        found = step.spring(name).to_dict()
        units = {key: answer_name(f"springs.{name}.{key}").kind.unit for key in found}
        # What a stop adds is of the kind of the spring.
        units |= {"stop": units.get("moment", "N")}
        texts = (f"{key} {_number(value, sizes[units[key]])} {units[key]}" for key, value in found.items())
        print(f"  spring {name}: {', '.join(texts)}")
    for name in step.model.scene.tendons:
        state = step.tendon(name)
        asked = (("tension", "N"), ("far_tension", "N"), ("length", "m"))
        told = [f"{key} {_number(state[key], sizes[unit])} {unit}" for key, unit in asked if key in state]
        told += [key for key in ("slack", "released") if state.get(key)]
        print(f"  tendon {name}: {', '.join(told)}")
    for name in step.model.scene.tubes:
        state = step.tube(name)
        texts = (
            f"{key} {_number(state[key], sizes.get(unit, 1.0))} {unit}"
            for key, unit in (("torque", "N m"), ("angle", "rad"))
        )
        print(f"  tube {name}: {', '.join(texts)}")
    for name in step.model.scene.rings:
        state = step.ring(name)
        told = [f"at {_number(state['at'], 1.0)}", f"force {_vector(state['force'], sizes['N'])} N"]
        told += [f"drive {_number(state['drive'], sizes['N'])} N"] if "drive" in state else []
        print(f"  ring {name}: {', '.join(told)}")
    for name in step.model.scene.motions:
        efforts = step.motion(name)
        units = {key: answer_name(f"motions.{name}.{key}").kind.unit for key in efforts}
        texts = (f"{key} {_effort(value, sizes[units[key]])} {units[key]}" for key, value in efforts.items())
        print(f"  motion {name}: {', '.join(texts)}")
    for name in step.model.scene.magnets:
        found = step.magnet(name)
        torque, force = _vector(found["torque"], sizes["N m"]), _vector(found["force"], sizes["N"])
        print(f"  magnet {name}: torque {torque} N m, force {force} N")
    for name, entry in step.contacts.items():
        _report_contact(name, entry, sizes["N"])
    if "dissipated" in step.energy:
        print(f"  dissipated {step.energy['dissipated']:.9g} J")
    proof = step.certificate
    print(f"  {_kind(step)}, residual {proof.residual:.1e}, {error_in_words(proof.error_estimate, proof.error_of)}")
    for note in dict.fromkeys(step.notes):
        if note not in said:
            print(f"  note: {note}")
    said.update(step.notes)


def _kind(step: Equilibrium) -> str:
    proof = step.certificate
    if proof.stable == "not defined":
        return "stability not defined, as loads have no potential"
    kind = stability_in_words(proof.stable, proof.negative)
    return f"{kind}, smallest eigenvalue {proof.smallest:.4g} N" if np.isfinite(proof.smallest) else kind


def _report_contact(name: str, entry: dict[str, Any], size: float) -> None:
    if entry["at"] is None:
        print(f"  contact {name}: nothing touches it" + ("" if entry["gap"] is None else f", gap {entry['gap']:.9g} m"))
        return
    several = isinstance(entry["member"], list)
    keys = list(entry)
    for values in zip(*(entry.values() if several else ([value] for value in entry.values())), strict=True):
        told = dict(zip(keys, values, strict=True))
        at, force = told["at"], f"force {_vector(told['force'], size)} N"
        if "other" in told:
            where = f"at {at:.9g} and {told['other']} at {told['other_at']:.9g}, {force}"
        elif isinstance(at, list):
            where = f"lies on it from {at[0]:.9g} to {at[1]:.9g}, {force.replace('force', 'force over this')}"
        else:
            where = f"touches it at {at:.9g}, {force}"
        if "friction" in told:
            kind = "sticks" if told["sticking"] else "slides"
            where += f", of it friction {_vector(told['friction'], size)} N: it {kind}"
        print(f"  contact {name}: {told['member']} {where}")


def _effort(value: Any, size: float) -> str:
    return _number(value, size) if isinstance(value, float) else _vector(value, size)


def _vector(values: Any, size: float = 0.0) -> str:
    """A vector; components that are rounding beside its largest, or beside a size in its unit, as 0."""
    size = max(size, float(np.abs(values).max()))
    return "(" + ", ".join(_number(value, size) for value in values) + ")"


def _number(value: float, size: float) -> str:
    return "0" if abs(value) < ROUNDING * size else f"{value + 0.0:.9g}"


def print_checks(checks: Sequence[Check]) -> None:
    """Print comparisons as a table."""
    if not checks:
        return
    head = ("quantity", "value", "reference", "error", "tolerance", "")
    rows = [head, *(_row(c) for c in checks)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    for row in rows:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def report_sweep(found: Sweep) -> None:
    """Print what became of the cases of a sweep: how many, failures, and of each quantity what it comes to."""
    print(printable(found.scene.title) or "untitled scene")
    solved = int(found.solved.sum())
    print(f"  {counted(len(found), 'case')} of {', '.join(found.cases.columns)}: {solved} solved")
    _report_statuses(found)
    _report_failures(found)
    if solved:
        _report_quantities(found)
    spent = np.nansum(found.table["seconds"])
    print(f"{counted(len(found), 'case')} in {found.wall:.3f} s; {spent:.3f} s of solving")


def _report_statuses(found: Sweep) -> None:
    short = int((found.table["status"] == "short").sum())
    if short:
        print(f"  {short} of these not to the accuracy asked for")
    noted = int((found.table["notes"] != "").sum())
    if noted:
        print(f"  notes with {counted(noted, 'answer')}, see --out")


MOST_FAILURES = 5
"""Failures that are told one by one."""


def _report_failures(found: Sweep) -> None:
    failures = found.failures
    for failure in failures[:MOST_FAILURES]:
        values = ", ".join(f"{name} = {value:.9g}" for name, value in failure.values.items())
        print(f"  case {failure.case} ({values}): {failure.status}: {failure.reason}")
    if len(failures) > MOST_FAILURES:
        print(f"  ... and {len(failures) - MOST_FAILURES} more without an answer, see --out")


def _report_quantities(found: Sweep) -> None:
    """Least, quartiles and largest, mean and deviation of each number over the solved cases."""
    heads = ("", "least", "quarter", "median", "three quarters", "largest", "mean", "deviation")
    rows: list[tuple[str, ...]] = [heads]
    names = [name for name in found.table if name not in found.cases.columns]
    for name in names[: names.index("status")]:
        numbers = found.table[name][found.solved]
        numbers = numbers[np.isfinite(numbers)]
        if len(numbers):
            statistics = [*np.quantile(numbers, [0.0, 0.25, 0.5, 0.75, 1.0]), numbers.mean()]
            spread = f"{numbers.std(ddof=1):.4g}" if len(numbers) > 1 else ""
            rows.append((name, *(f"{value + 0.0:.9g}" for value in statistics), spread))
    widths = [max(len(row[i]) for row in rows) for i in range(len(heads))]
    for row in rows:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _row(c: Check) -> tuple[str, ...]:
    expect = c.expect
    place = "" if expect.at is None else f" at {expect.at:g}"
    step = "" if expect.step is None else f" step {expect.step:g}"
    step += "" if expect.time is None else f" time {expect.time:g}"
    step += "" if expect.equilibrium is None else f" equilibrium {expect.equilibrium}"
    for key in ("crossing", "limit_point", "bifurcation", "flutter_point", "transition"):
        number = getattr(expect, key)
        step += "" if number is None else f" {key.replace('_', ' ')} {number}"
    tolerance = "exact" if expect.tolerance is None else f"{expect.tolerance:.1e}"
    verdict = "ok" if c.passed else "FAILED"
    return (
        printable(expect.quantity) + place + step,
        _short(c.value),
        _short(expect.value),
        f"{c.error:.1e}",
        tolerance,
        verdict,
    )


def _short(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_short(entry) for entry in value) + "]"
    return f"{value:.8g}" if isinstance(value, float) else str(value)
