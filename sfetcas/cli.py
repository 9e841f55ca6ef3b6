"""The command line: run, check, info."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .analyses import solve
from .checks import Answer, Check, check
from .description.records import counted
from .description.scene import Scene
from .description.scenefile import load
from .dynamics.modes import Modes
from .dynamics.motion import Motion
from .equilibria.solution import Equilibrium, Solution
from .equilibria.statics import Settings, pilot_of
from .errors import SceneError, SolveError, Status
from .mechanics.elements import ELEMENTS
from .mechanics.model import Model, assemble
from .mechanics.resistance import check_resistance
from .paths.path import Branch
from .paths.path import Path as Course
from .solvers.prepared import Prepared

__all__ = ["main"]

T = TypeVar("T")

SOLVED, SHORT, BAD_INPUT, NO_SOLUTION, INTERNAL = 0, 1, 2, 3, 70
"""Exit codes."""

REPORT = "a mistake of sfetcas, not of the scene; please report it with the lines above and the scene file"

WAYS = ("way out", "ways out")
"""Negative eigenvalues in words."""

MOST_NODES = 20
"""Nodes in the printed report at most."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code is returned."""
    options = _parser().parse_args(arguments)
    try:
        with np.errstate(over="raise"):
            return int(options.command(options))
    except SceneError as error:
        print(f"sfetcas: {error}", file=sys.stderr)
        return BAD_INPUT
    except SolveError as error:
        print(f"sfetcas: no solution: {error}", file=sys.stderr)
        return NO_SOLUTION
    except (FloatingPointError, OverflowError, np.linalg.LinAlgError) as error:
        print(f"sfetcas: no solution: the numbers of this scene leave what can be computed ({error})", file=sys.stderr)
        return NO_SOLUTION
    except MemoryError:
        print("sfetcas: no solution: the scene needs more memory than there is", file=sys.stderr)
        return NO_SOLUTION
    except KeyboardInterrupt:
        print("sfetcas: interrupted; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return SOLVED
    except Exception:
        traceback.print_exc()
        print(f"sfetcas: internal error: {REPORT}", file=sys.stderr)
        return INTERNAL


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sfetcas", description="Equilibria of very flexible beams under large motion."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="solve a scene and print a short report")
    run.add_argument("file", type=Path, help="scene file, .toml or .json")
    run.add_argument("--json", type=Path, metavar="OUT", help="write the whole answer as JSON")
    run.add_argument("--matrices", type=Path, metavar="OUT", help="modes: write the matrices, .npz or a new folder")
    run.add_argument("--plot", type=Path, metavar="OUT.png", help="write a picture")
    _add_overrides(run)
    run.set_defaults(command=_run)
    checks = commands.add_parser("check", help="solve scenes and compare with their expect tables")
    checks.add_argument("files", type=Path, nargs="+", metavar="file")
    _add_overrides(checks)
    checks.set_defaults(command=_check)
    info = commands.add_parser("info", help="show the model: blocks, unknowns, why plane or space")
    info.add_argument("file", type=Path)
    _add_overrides(info)
    info.set_defaults(command=_info)
    return parser


def _add_overrides(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--accuracy", type=float, help="wanted error of positions over the size of the scene")
    parser.add_argument("--element", choices=ELEMENTS, metavar="SFETn", help="element of all members: SFET2 to SFET9")
    parser.add_argument("--elements", type=int, metavar="N", help="number of elements of each member")
    parser.add_argument("--integration", choices=("nodes", "gauss"), default="nodes", help="quadrature in elements")
    parser.add_argument("--assembly", choices=("auto", "closing", "nodal"), default="auto")


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(
        accuracy=options.accuracy,
        element=options.element,
        elements=options.elements,
        gauss=options.integration == "gauss",
        assembly=options.assembly,
    )


def _run(options: argparse.Namespace) -> int:
    begin = time.perf_counter()
    scene, settings = load(options.file), _settings(options)
    if options.matrices is not None and scene.analysis.type != "modes":
        raise SceneError(f"--matrices: found the analysis {scene.analysis.type!r}, accepted: 'modes'")
    if options.matrices is not None and options.matrices.suffix != ".npz" and options.matrices.exists():
        raise SceneError(f"{options.matrices}: exists, accepted: a new folder, or a file that ends in .npz")
    for path in (options.json, options.plot):
        if path is not None:
            _check_writable(path)
            if path.exists() and path.samefile(options.file):
                raise SceneError(f"{path}: is the scene itself, accepted: another file")
    if options.json is not None and options.plot is not None and options.json.resolve() == options.plot.resolve():
        raise SceneError(f"{options.plot}: found for --json and for --plot, accepted: two files")
    drawing = _drawing(options.plot, scene.analysis.type == "path")

    def told(solution: Answer) -> None:
        if options.json is not None:
            _write(options.json, lambda path: path.write_text(json.dumps(solution.to_dict(), allow_nan=False) + "\n"))
        if options.matrices is not None and isinstance(solution, Modes):
            _write_matrices(solution, options.matrices)
        if drawing is not None:
            _write(options.plot, lambda path: drawing(solution, path))
        _report(solution, time.perf_counter() - begin)

    try:
        solution, checks = _answered(options.file, scene, settings)
    except SolveError as error:
        if isinstance(error.reached, Solution):
            told(error.reached)
        raise
    told(solution)
    _print_checks(checks)
    return SOLVED if solution.status is Status.SOLVED and all(c.passed for c in checks) else SHORT


def _answered(file: Path, scene: Scene, settings: Settings) -> tuple[Answer, list[Check]]:
    """The answer of a scene and its comparisons."""
    solution = _named(file, lambda: solve(scene, settings))
    return solution, _named(file, lambda: check(scene, solution))


def _named(file: Path, work: Callable[[], T]) -> T:
    """What some work on a scene gives; what is wrong with the scene is told with the file."""
    try:
        return work()
    except SceneError as error:
        raise SceneError(str(error), (str(file),)) from None


def _drawing(path: Path | None, chart: bool) -> Callable[[Any, Path], None] | None:
    if path is None:
        return None
    # Matplotlib costs more than most solves: only a picture pays for it.
    from .pictures.charts import save_chart
    from .pictures.plotting import ENDINGS, save_picture

    if path.suffix.lower() not in ENDINGS:
        raise SceneError(f"{path}: found the ending {path.suffix!r} of a picture, accepted: {', '.join(ENDINGS)}")
    return save_chart if chart else save_picture


def _check_writable(path: Path) -> None:
    try:
        plain = not path.is_symlink() and (path.is_file() or not path.exists())
        # What permissions say is not all: some folders take no files from anybody.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except (OSError, ValueError):
        plain = False
    if not plain:
        accepted = "a plain file in a folder that exists and can be written"
        raise SceneError(f"{path}: cannot be written; accepted: {accepted}")


def _write(path: Path, writer: Callable[[Path], Any]) -> None:
    """Write beside the final name first, so that nothing half-written is ever seen."""
    name = ""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=path.suffix)
        os.close(handle)
        writer(Path(name))
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None
    finally:
        if name:
            Path(name).unlink(missing_ok=True)


def _write_matrices(modes: Modes, path: Path) -> None:
    matrices = modes.matrices()
    try:
        if path.suffix == ".npz":
            _write(path, matrices.save)
        else:
            matrices.save(path)
    except OSError as error:
        raise SceneError(f"{path}: could not be written: {error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _report(solution: Answer, seconds: float) -> None:
    model = solution.last.model
    print(solution.scene.title or "untitled scene")
    print(f"  {model.dimension}: {model.reason}")
    print(f"  {_flexible(model)}, {counted(model.unknowns, 'unknown')}, {model.assembly} assembly")
    if isinstance(solution, Course):
        _report_path(solution)
    if isinstance(solution, Modes):
        _report_modes(solution)
    if isinstance(solution, Motion):
        _report_motion(solution)
    else:
        for step, place in zip(solution.steps, _places(solution), strict=True):
            _report_step(step, place)
    split = f"model {solution.seconds['model']:.3f} s, solve {solution.seconds['solve']:.3f} s"
    print(f"{solution.status.value} in {seconds:.3f} s ({split})")


def _report_path(path: Course) -> None:
    counts = {"limit point": 0, "bifurcation": 0}
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


def _report_motion(motion: Motion) -> None:
    last = motion.last
    print(f"  {motion.integrator}, {counted(motion.count, 'step')} in time, {counted(len(motion.steps), 'answer')}")
    print(f"at {last.time:.9g} s")
    for name in last.model.nodes[:MOST_NODES]:
        print(f"  node {name}: position {_vector(last.position(name))} m, velocity {_vector(last.velocity(name))} m/s")
    energy = ", ".join(f"{kind} {value:.9g}" for kind, value in last.energy.items())
    print(f"  energy: {energy} N m")
    worst = ", ".join(f"{kind} {value:.1e}" for kind, value in motion.violation.items())
    error = motion.error_estimate
    said = "error not estimated" if error is None else f"estimated error {error:.1e} of the size"
    print(f"  worst violation: {worst}; {said}")
    for note in motion.notes:
        print(f"  note: {note}")


def _report_modes(modes: Modes) -> None:
    estimate = f"estimated relative error {modes.error_estimate:.1e}"
    print(f"{counted(len(modes.modes), 'mode')}, {counted(modes.rigid, 'rigid motion')} left out; {estimate}")
    for number, mode in enumerate(modes.modes, start=1):
        faded = f", damping ratio {mode.damping:.6g}" if modes.damped else ""
        print(f"  mode {number}: {mode.omega:.9g} rad/s ({mode.omega / (2.0 * np.pi):.6g} Hz){faded}")
    for rate in modes.growing:
        print(f"  leaves the equilibrium at a rate of {rate:.9g} 1/s")
    for note in modes.notes:
        print(f"  note: {note}")


def _report_events(branch: Branch, counts: dict[str, int]) -> None:
    """Limit points and bifurcations of a branch, numbered on from those of the branches before, as in ``expect``."""
    for kind, entries in (("limit point", branch.limit_points), ("bifurcation", branch.bifurcations)):
        for entry in entries:
            counts[kind] += 1
            error = entry.certificate.error_estimate
            said = "" if error is None else f", estimated error {error:.1e}"
            ways = f", {counted(entry.certificate.negative, *WAYS)}" if entry.certificate.negative else ""
            print(f"  {kind} {counts[kind]}: factor {entry.factor:.12g}{ways}{said}")
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


def _report_step(step: Equilibrium, place: str) -> None:
    print(f"factor {step.factor:g}{place}")
    for name in step.model.nodes[:MOST_NODES]:
        angle = step.angle(name)
        turned = f"  angle {angle:.9g} rad" if angle is not None else ""
        print(f"  node {name}: position {_vector(step.position(name))} m{turned}")
    if len(step.model.nodes) > MOST_NODES:
        print(f"  ... and {counted(len(step.model.nodes) - MOST_NODES, 'more node')}, see --json")
    for name, node in step.model.scene.nodes.items():
        if node.support != "free":
            force, moment = step.reaction(name)
            print(f"  reaction {name}: force {_vector(force)} N, moment {_vector(moment)} N m")
    for name in step.model.scene.springs:
        state = step.spring(name)
        travel, *efforts = state.to_dict().items()
        unit, unit_of_effort = ("rad", "N m") if state.rotational else ("m", "N")
        told = [
            f"{travel[0]} {travel[1]:.9g} {unit}",
            *(f"{key} {value:.9g} {unit_of_effort}" for key, value in efforts),
        ]
        print(f"  spring {name}: {', '.join(told)}")
    for name in step.model.scene.motions:
        told = [f"{key} {_effort(value)} {UNITS[key]}" for key, value in step.motion(name).items()]
        print(f"  motion {name}: {', '.join(told)}")
    for name, entry in step.contacts.items():
        _report_contact(name, entry)
    proof = step.certificate
    error = proof.error_estimate
    said = "error not estimated" if error is None else f"estimated error {error:.1e} of the size"
    print(f"  {_kind(step)}, residual {proof.residual:.1e}, {said}")
    for note in step.notes:
        print(f"  note: {note}")


def _kind(step: Equilibrium) -> str:
    proof = step.certificate
    if proof.stable == "not defined":
        return "stability not defined, as loads have no potential"
    kind = {"True": "stable", "False": f"unstable ({counted(proof.negative, *WAYS)})"}.get(str(proof.stable), "neutral")
    return f"{kind}, smallest eigenvalue {proof.smallest:.4g} N" if np.isfinite(proof.smallest) else kind


def _report_contact(name: str, entry: dict[str, Any]) -> None:
    if entry["at"] is None:
        print(f"  contact {name}: nothing touches it" + ("" if entry["gap"] is None else f", gap {entry['gap']:.9g} m"))
        return
    several = isinstance(entry["member"], list)
    for member, at, force in zip(
        *(entry[k] if several else [entry[k]] for k in ("member", "at", "force")), strict=True
    ):
        lies = isinstance(at, list)
        where = (
            f"lies on it from {at[0]:.9g} to {at[1]:.9g}, force over this" if lies else f"touches it at {at:.9g}, force"
        )
        print(f"  contact {name}: {member} {where} {_vector(force)} N")


UNITS = {"moment": "N m", "force": "N"}
"""Of what makes a motion."""


def _effort(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else _vector(value)


def _vector(values: Any) -> str:
    return "(" + ", ".join(f"{value + 0.0:.9g}" for value in values) + ")"


def _check(options: argparse.Namespace) -> int:
    worst = SOLVED
    for file in options.files:
        scene = load(file)
        print(f"{file}: {scene.title}")
        solution, checks = _answered(file, scene, _settings(options))
        _print_checks(checks)
        if solution.status is not Status.SOLVED or not all(c.passed for c in checks):
            worst = SHORT
    return worst


def _print_checks(checks: Sequence[Check]) -> None:
    if not checks:
        return
    head = ("quantity", "value", "reference", "error", "tolerance", "")
    rows = [head, *(_row(c) for c in checks)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    for row in rows:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _row(c: Check) -> tuple[str, ...]:
    expect = c.expect
    place = "" if expect.at is None else f" at {expect.at:g}"
    step = "" if expect.step is None else f" step {expect.step:g}"
    step += "" if expect.equilibrium is None else f" equilibrium {expect.equilibrium}"
    for key in ("crossing", "limit_point", "bifurcation"):
        number = getattr(expect, key)
        step += "" if number is None else f" {key.replace('_', ' ')} {number}"
    tolerance = "exact" if expect.tolerance is None else f"{expect.tolerance:.1e}"
    verdict = "ok" if c.passed else "FAILED"
    return expect.quantity + place + step, _short(c.value), _short(expect.value), f"{c.error:.1e}", tolerance, verdict


def _short(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_short(entry) for entry in value) + "]"
    return f"{value:.8g}" if isinstance(value, float) else str(value)


def _flexible(model: Model) -> str:
    """The elements of flexible members: a rigid or small one is cut into none."""
    cuts, members = model.mesh.cuts, model.scene.members
    count = sum(len(cuts[name]) - 1 for name, member in members.items() if member.type == "flexible")
    return f"{counted(count, 'element')} {model.element.name}" if count else "no flexible member"


def _info(options: argparse.Namespace) -> int:
    scene, settings = load(options.file), _settings(options)
    _named(options.file, lambda: check_resistance(scene))
    mesh = pilot_of(scene, settings)
    model = assemble(scene, mesh, assembly=settings.assembly)
    print(scene.title or "untitled scene")
    print(f"  {model.dimension}: {model.reason}")
    print(f"  begins with {_flexible(model)}; {model.assembly} assembly")
    for block in model.blocks:
        print(f"  {block.size:6d}  {block.name}: {block.why}")
    print(f"  {model.unknowns:6d}  unknowns of the minimisation")
    for name, member in scene.members.items():
        made = counted(len(mesh.cuts[name]) - 1, "element") if member.type == "flexible" else member.type
        print(f"  member {name}: {made}, length {scene.center_lines[name].length:.9g} m")
    driven = " (what motions drive counts as held)" if scene.motions else ""
    print(f"  {Prepared(model).diagnosis.sentence}{driven}")
    print(f"  units: length {model.scales.length:.6g} m, force {model.scales.force:.6g} N")
    return SOLVED
