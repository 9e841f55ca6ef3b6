"""The command line: run, page, check, info, sweep, trade, export."""

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import os
import re
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np

from . import __version__
from .analyses import solve
from .checks import Answer, Check, check
from .description.inserting import inserted
from .description.records import counted
from .description.scene import Scene
from .description.scenefile import load
from .dynamics.motion import Trajectory
from .equilibria.solution import Solution
from .equilibria.statics import Settings, pilot_of
from .errors import SceneError, SolveError, Status
from .mechanics.elements import ELEMENTS
from .mechanics.model import assemble
from .mechanics.resistance import check_resistance
from .outputs import Output, outputs_of, outputs_of_page, outputs_of_sweep, outputs_of_trade
from .quoting import printable
from .reports import print_checks, report, report_sweep
from .solvers.prepared import Prepared
from .stopping import COMMAND, INTERRUPTED, SENTENCE, arrived, asked, heard

__all__ = ["main", "parser"]

T = TypeVar("T")

SOLVED, SHORT, BAD_INPUT, NO_SOLUTION, INTERNAL = 0, 1, 2, 3, 70
"""Exit codes, beside those of interrupts."""

REPORT = "a mistake of sfetcas, not of the scene; please report it with the lines above and the scene file"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code is returned."""
    if COMMAND:
        gc.freeze()
        gc.enable()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # Whoever closed it wants to see nothing.
            setattr(sys, name, io.StringIO())
    options = parser().parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # Names have characters that not every terminal has.
            stream.reconfigure(errors="backslashreplace")
    with heard() as code, warnings.catch_warnings():
        warnings.showwarning = _noted
        return code(_ended(options))


def _noted(message: Warning | str, *_: object, **__: object) -> None:
    print(f"sfetcas: note: {printable(str(message))}", file=sys.stderr)


def _ended(options: argparse.Namespace) -> int:
    """Run a command; the exit code is returned."""
    try:
        return _judged(lambda: int(options.command(options)))
    except KeyboardInterrupt:
        arrived()
        print(SENTENCE, file=sys.stderr)
        return INTERRUPTED


def _judged(command: Callable[[], int]) -> int:
    """The exit code of a command, also where it fails, which is told."""
    try:
        try:
            with np.errstate(over="raise"):
                code = command()
            sys.stdout.flush()
            return code
        finally:
            # What failed may be what somebody made of an interrupt.
            if asked() and sys.exc_info()[0] is not None:
                raise KeyboardInterrupt
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
    except BrokenPipeError:
        _print_no_more()
        return SOLVED
    except Exception as failure:
        try:
            # Where it is that nothing can be printed, it happens again.
            print(end="\n" if isinstance(failure, OSError) else "", flush=True)
        except OSError as error:
            print(f"sfetcas: what is printed cannot be written: {error.strerror}", file=sys.stderr)
            _print_no_more()
            return BAD_INPUT
        traceback.print_exc()
        print(f"sfetcas: internal error: {REPORT}", file=sys.stderr)
        return INTERNAL


def _print_no_more() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def parser() -> argparse.ArgumentParser:
    """What reads the command line, with the help of each command."""
    found = argparse.ArgumentParser(
        prog="sfetcas",
        description="Equilibria, paths, vibrations and motions of very flexible beams and mechanisms.",
        epilog="Each command has a help of its own: sfetcas run --help",
    )
    found.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = found.add_subparsers(required=True, metavar="COMMAND")
    for add in (_add_run, _add_page, _add_check, _add_info, _add_sweep, _add_trade, _add_export):
        add(commands)
    return found


Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def _command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], what: str, *examples: str
) -> argparse.ArgumentParser:
    """A command with a sentence of what it does and examples of calls; its scene file is left to add."""
    calls = "\n".join(f"  sfetcas {name} {example}" for example in examples)
    found = commands.add_parser(
        name,
        help=f"{what[0].lower()}{what[1:]}",
        description=f"{what}.",
        epilog=f"examples:\n{calls}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    found.set_defaults(command=run)
    return found


def _add_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="scene file, .toml or .json")


def _add_run(commands: Commands) -> None:
    run = _command(
        commands,
        "run",
        _run,
        "Run the analysis of a scene and print a short report",
        "arch.toml",
        "arch.toml --accuracy 1e-8 --json answer.json --plot answer.png",
    )
    _add_file(run)
    files = run.add_argument_group("files that are written")
    files.add_argument("--json", type=Path, metavar="OUT", help="the whole answer as JSON")
    files.add_argument("--plot", type=Path, metavar="OUT.png", help="a picture, in the format of its ending")
    files.add_argument(
        "--quantity",
        action="append",
        metavar="NAME",
        help="what --plot draws over the load factor or time, as nodes.tip.position.y; may be given several times",
    )
    files.add_argument(
        "--colour",
        metavar="NAME",
        help="what the colours of members show: moment, magnitude, twist, curvature, tension, shear, stress or none "
        "(default: moment)",
    )
    files.add_argument("--animate", type=Path, metavar="OUT.gif", help="a moving picture, .gif or .mp4")
    files.add_argument("--vtk", type=Path, metavar="DIR", help="a folder of files for ParaView")
    files.add_argument(
        "--matrices", type=Path, metavar="OUT", help="matrices of the small vibrations (modes): .npz or a new folder"
    )
    _add_settings(run)


def _add_page(commands: Commands) -> None:
    page = _command(
        commands,
        "page",
        _page,
        "Run the analysis of a scene and write a page for a browser, which turns, plays and tells its values",
        "arch.toml arch.html",
        "arch.toml arch.html --live --argument loads.tip.value",
    )
    _add_file(page)
    page.add_argument("page", type=Path, metavar="OUT.html", help="the page: one file that needs no network")
    page.add_argument("--live", action="store_true", help="the page has the solver itself: numbers change on it")
    page.add_argument(
        "--argument",
        action="append",
        metavar="NAME[=LOW:HIGH]",
        help="number of the scene that changes on a live page; may be given several times (default: the load factor, "
        "all loads and all motions)",
    )
    _add_settings(page)


def _add_check(commands: Commands) -> None:
    checks = _command(
        commands,
        "check",
        _check,
        "Solve scenes and compare the answers with the expect tables of the files",
        "problems/*.toml",
        "arch.toml --elements 32",
    )
    checks.add_argument("files", type=Path, nargs="+", metavar="file", help="scene files, .toml or .json")
    _add_settings(checks)


def _add_info(commands: Commands) -> None:
    info = _command(
        commands,
        "info",
        _info,
        "Show how a scene is modelled: its unknowns and equations, and why it is plane or in space",
        "arch.toml",
    )
    _add_file(info)
    _add_settings(info)


def _add_sweep(commands: Commands) -> None:
    many = _command(
        commands,
        "sweep",
        _sweep,
        "Solve many cases of a scene, each with other numbers",
        "arch.toml --vary loads.tip.value.1=0:10:101 --out cases.csv",
        "arch.toml --sample sections.strip.EI3=normal:1:0.05 --count 1000 --quantity nodes.tip.position.y",
        "arch.toml --cases table.csv --quantity 'members.beam.moment at 0.5'",
    )
    _add_file(many)
    cases = many.add_argument_group("cases, by one of --vary, --sample and --cases")
    cases.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH:COUNT",
        help="evenly spaced values of a number, or a list as in sections.strip.EI3=1,2,5; given several times, all "
        "combinations are solved",
    )
    cases.add_argument(
        "--sample",
        action="append",
        default=[],
        metavar="NAME=KIND:A:B",
        help="random values of a number: normal:MEAN:DEVIATION, lognormal:MEAN:DEVIATION or uniform:LOW:HIGH",
    )
    cases.add_argument(
        "--cases", type=Path, metavar="TABLE.csv", help="a table with names of numbers in its first line, a line a case"
    )
    cases.add_argument("--count", type=int, default=100, help="number of random samples (default: %(default)s)")
    cases.add_argument("--seed", type=int, default=0, help="seed of the random samples (default: %(default)s)")
    cases.add_argument("--latin", action="store_true", help="draw the samples as a Latin hypercube")
    many.add_argument(
        "--quantity",
        action="append",
        metavar="NAME",
        help="quantity of the answer that is kept, as nodes.tip.position; may be given several times (default: "
        "positions of the nodes that can move; frequencies of modes)",
    )
    many.add_argument(
        "--out", type=Path, action="append", default=[], metavar="TABLE", help="write all cases: .csv, .json or .npz"
    )
    many.add_argument("--workers", type=int, metavar="N", help="number of processes (default: that of the processors)")
    many.add_argument(
        "--batch",
        action="store_true",
        help="solve what is not out of the ordinary together in threads, some fifty times as fast; for statics without "
        "contact, stops and histories",
    )
    many.add_argument(
        "--warm",
        action="store_true",
        help="with --batch begin at the nearest case that was solved before: faster still, but which of several stable "
        "equilibria is found depends on the order of the cases",
    )
    _add_settings(many)


def _add_trade(commands: Commands) -> None:
    trading = _command(
        commands,
        "trade",
        _trade,
        "Measure which discretisation gives which error in which time",
        "arch.toml --markdown table.md --plot diagram.png",
    )
    _add_file(trading)
    files = trading.add_argument_group("files that are written")
    files.add_argument("--markdown", type=Path, metavar="OUT.md", help="a table of all settings")
    files.add_argument("--csv", type=Path, metavar="OUT.csv", help="all numbers as lines")
    files.add_argument("--json", type=Path, metavar="OUT", help="everything as JSON")
    files.add_argument("--plot", type=Path, metavar="OUT.png", help="a work-precision diagram")
    trading.add_argument(
        "--against",
        choices=("refined", "file"),
        default="refined",
        help="measure errors against a refined answer, or against the expect table of the file (default: %(default)s)",
    )
    trading.add_argument(
        "--accuracy-of", metavar="NAME", help="errors of this quantity, as reactions.A.moment (default: positions)"
    )
    trading.add_argument(
        "--peer",
        action="append",
        default=[],
        metavar="COMMAND",
        help="another program, with {file} for the scene; it prints answers as run --json does, one a line",
    )
    trading.add_argument(
        "--repeats",
        type=int,
        default=argparse.SUPPRESS,
        metavar="N",
        help="runs of each setting after the first, 0 to 1000 (default: 5)",
    )
    trading.add_argument(
        "--longest", type=float, default=argparse.SUPPRESS, metavar="S", help="seconds for each setting (default: 10)"
    )
    trading.add_argument(
        "--budget",
        type=float,
        default=argparse.SUPPRESS,
        metavar="S",
        help="seconds for all settings, and for each peer (default: 300)",
    )


def _add_export(commands: Commands) -> None:
    code = _command(
        commands,
        "export",
        _export,
        "Write a solver for the scene as C code that needs no other library",
        "arch.toml solver --argument loads.tip.value --result nodes.tip.position",
        "arch.toml solver --argument sections.strip.EI3=0.5:2 --sensitivities",
    )
    _add_file(code)
    code.add_argument("folder", type=Path, metavar="DIR", help="the folder that is made")
    code.add_argument("--name", help="prefix of the files and of all names in C (default: that of the scene file)")
    code.add_argument(
        "--argument",
        action="append",
        metavar="NAME[=LOW:HIGH]",
        help="number of the scene that is an argument, as loads.tip.value; may be given several times (default: the "
        "load factor, all loads and all motions)",
    )
    code.add_argument(
        "--result",
        action="append",
        metavar="NAME",
        help="quantity that is computed, as nodes.tip.position or stiffness.tip; may be given several times (default: "
        "positions, rotations, reactions, section forces, springs and energies)",
    )
    code.add_argument(
        "--places", action="append", metavar="MEMBER=X,X,...", help="fractions of a member's length for its results"
    )
    code.add_argument("--sensitivities", action="store_true", help="also derivatives of the results by the arguments")
    code.add_argument(
        "--derivatives",
        action="store_true",
        help="in place of a solver: energy and constraints with their derivatives",
    )
    code.add_argument("--overwrite", action="store_true", help="replace an earlier export in this folder")
    _add_settings(code)


def _add_settings(command: argparse.ArgumentParser) -> None:
    settings = command.add_argument_group("settings, in place of those of the scene")
    settings.add_argument(
        "--accuracy",
        type=float,
        metavar="E",
        help="wanted error of the positions over the size of the scene (default: that of the scene, else 1e-4)",
    )
    settings.add_argument(
        "--accuracy-of", metavar="NAME", help="quantity that the accuracy is of instead, as reactions.A.moment"
    )
    settings.add_argument(
        "--element", choices=ELEMENTS, metavar="SFETn", help="element type, SFET2 to SFET9 (default: by the accuracy)"
    )
    settings.add_argument(
        "--elements", type=int, metavar="N", help="number of elements of each member (default: by the accuracy)"
    )
    settings.add_argument(
        "--integration",
        choices=("nodes", "gauss"),
        default="nodes",
        help="integration points within elements: their nodes, or Gauss points (default: %(default)s)",
    )
    settings.add_argument(
        "--assembly",
        choices=("auto", "closing", "nodal"),
        default="auto",
        help="unknowns: rotations only (closing), or displacements of nodes too (nodal) (default: %(default)s)",
    )
    settings.add_argument(
        "--solver",
        choices=("ipopt", "newton"),
        default="ipopt",
        help="solver that is tried first for an equilibrium (default: %(default)s)",
    )


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(
        accuracy=options.accuracy,
        accuracy_of=options.accuracy_of,
        element=options.element,
        elements=options.elements,
        gauss=options.integration == "gauss",
        assembly=options.assembly,
        solver=options.solver,
    )


def _run(options: argparse.Namespace) -> int:
    begin, scene = time.perf_counter(), load(options.file)
    return _reported(options, begin, scene, outputs_of(options, scene))


def _reported(options: argparse.Namespace, begin: float, scene: Scene, outputs: Sequence[Output]) -> int:
    """Solve a scene that has been read since ``begin``, report the answer and write its files, also of what a run that
    fails has reached.
    """

    def show(solution: Answer) -> None:
        solved = time.perf_counter() - begin
        _give(solution, lambda: report(solution, solved), outputs)

    try:
        solution, checks = _answered(options.file, scene, _settings(options))
    except SolveError as error:
        if isinstance(error.reached, (Solution, Trajectory)):
            show(error.reached)
        raise
    show(solution)
    return _verdict(solution, checks)


def _page(options: argparse.Namespace) -> int:
    begin, scene = time.perf_counter(), load(options.file)
    spans = dict(_span(text) for text in options.argument) if options.argument else None
    return _reported(options, begin, scene, outputs_of_page(options, scene, spans, _settings(options)))


def _give(answer: object, show: Callable[[], object], outputs: Sequence[Output]) -> None:
    """Print an answer and write its files; what fails of one does not cost the other."""
    try:
        show()
    finally:
        for output in outputs:
            output.write(answer)


def _answered(file: Path, scene: Scene, settings: Settings) -> tuple[Answer, list[Check]]:
    """The answer of a scene and its comparisons; of a motion that was interrupted there are none."""
    with _progress(scene) as progress:
        solution = _named(file, lambda: solve(scene, settings, progress=progress))
    if solution.status is Status.INTERRUPTED:
        if not solution.steps:
            raise KeyboardInterrupt
        return solution, []
    return solution, _named(file, lambda: check(scene, solution))


def _verdict(solution: Answer, checks: Sequence[Check]) -> int:
    """Print the comparisons, and what the exit code of an answer is."""
    print_checks(checks)
    if solution.status is Status.INTERRUPTED and isinstance(solution, Trajectory):
        reached, end = solution.last.time, solution.scene.analysis.duration
        print(f"sfetcas: interrupted: the motion is known up to {reached:.6g} of {end:.6g} s", file=sys.stderr)
        return INTERRUPTED
    return SOLVED if solution.status is Status.SOLVED and all(c.passed for c in checks) else SHORT


def _named(file: Path, work: Callable[[], T]) -> T:
    """What some work on a scene gives; what is wrong with the scene is told with the file."""
    try:
        return work()
    except SceneError as error:
        raise SceneError(str(error), (str(file),)) from None


@contextlib.contextmanager
def _progress(scene: Scene) -> Iterator[Callable[[float], object] | None]:
    """How far a motion is: a bar on a terminal, which is wiped away at the end, else lines now and then."""
    if scene.analysis.type != "dynamic":
        with _lines(lambda: scene.analysis.type):
            yield None
        return
    end, runs, last = scene.analysis.duration, 1, 0.0
    if not sys.stderr.isatty():

        def reach(reached: float) -> None:
            nonlocal runs, last
            runs, last = runs + (reached <= last), reached

        with _lines(lambda: f"run {runs}: {100.0 * min(last / end, 1.0):.0f} %, {last:.4g} of {end:.4g} s"):
            yield reach
        return
    from tqdm import tqdm

    look = "{desc}{percentage:3.0f}% |{bar}| {n:.4g} of {total:.4g} s, {elapsed} and {remaining} to go"
    with tqdm(total=end, desc="run 1: ", bar_format=look, leave=False, file=sys.stderr) as bar:

        def show(reached: float) -> None:
            nonlocal runs, last
            if reached <= last:
                # A finer run checks the one before.
                runs += 1
                bar.reset()
                bar.set_description(f"run {runs}")
            last = reached
            bar.update(min(reached, end) - bar.n)

        yield show


EVERY = 10.0
"""Seconds from a line to the next that says how far a long run is."""


@contextlib.contextmanager
def _lines(show: Callable[[], str]) -> Iterator[None]:
    """Now and then a line on the standard error stream that says how far something is."""
    begin, over = time.perf_counter(), threading.Event()

    def go_on() -> None:
        while not over.wait(EVERY):
            print(f"sfetcas: {show()}, {time.perf_counter() - begin:.0f} s so far", file=sys.stderr, flush=True)

    lines = threading.Thread(target=go_on, daemon=True)
    lines.start()
    try:
        yield
    finally:
        over.set()
        lines.join()


def _check(options: argparse.Namespace) -> int:
    worst = SOLVED
    for file in options.files:
        scene = load(file)
        print(printable(f"{file}: {scene.title}"))
        code = _verdict(*_answered(file, scene, _settings(options)))
        if code == INTERRUPTED:
            return code
        worst = max(worst, code)
    return worst


def _info(options: argparse.Namespace) -> int:
    scene, settings = load(options.file), _settings(options)
    _named(options.file, lambda: check_resistance(scene))
    # What is pushed out is shown as it is before.
    scene = inserted(scene, 0.0)
    mesh = pilot_of(scene, settings)
    model = assemble(scene, mesh, assembly=settings.assembly)
    print(printable(scene.title) or "untitled scene")
    print(f"  {model.dimension}: {model.reason}")
    print(f"  begins with {model.elements_in_words}; {model.assembly} assembly")
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


def _export(options: argparse.Namespace) -> int:
    from .codegen.folder import export

    scene, name = load(options.file), options.name or re.sub(r"\W", "_", options.file.stem, flags=re.ASCII)
    spans = dict(_span(text) for text in options.argument) if options.argument else None
    places = dict(_place(text) for text in options.places or ())
    solver = _named(
        options.file,
        lambda: export(
            scene,
            options.folder,
            name=name,
            arguments=spans,
            results=options.result,
            places=places,
            sensitivities=options.sensitivities,
            derivatives=options.derivatives,
            settings=_settings(options),
            overwrite=options.overwrite,
        ),
    )
    folder = printable(str(options.folder))
    print(f"{folder}: {name}.c, {name}.h and what belongs to them; `make check` there builds and compares")
    print(f"  {solver.model.elements_in_words}, {counted(solver.arguments.expressions.total, 'unknown')}")
    for one in solver.arguments.arguments:
        print(f"  argument {one.name} [{one.unit}]: {', '.join(f'{x:.6g}' for x in one.default)}")
    if solver.results.results:
        print(f"  {counted(solver.results.size, 'number')} in {counted(len(solver.results.results), 'result')}")
    return SOLVED


def _trade(options: argparse.Namespace) -> int:
    from .tradeoff.tables import as_markdown
    from .tradeoff.trading import Limits, trade, with_peer

    limits = Limits(**{key: value for key, value in vars(options).items() if key in ("repeats", "longest", "budget")})
    scene = load(options.file)
    if options.accuracy_of is not None:
        analysis = scene.analysis.model_copy(update={"accuracy_of": options.accuracy_of})
        scene = scene.replace(analysis=analysis)
    outputs = outputs_of_trade(options)
    with _named_progress() as progress:
        found = _named(options.file, lambda: trade(scene, limits=limits, against=options.against, progress=progress))
        for command in options.peer:
            progress(f"peer, {command}")
            found = with_peer(found, command, options.file, limits.budget)
    _give(found, lambda: print(as_markdown(found, every=False), end=""), outputs)
    return SOLVED


def _sweep(options: argparse.Namespace) -> int:
    from .sweeps.sweeping import sweep
    from .sweeps.texts import cases_in_words, usual_quantities

    cases = cases_in_words(
        options.vary,
        options.sample,
        options.cases,
        options.count,
        options.seed,
        "latin" if options.latin else "random",
    )
    scene, outputs = load(options.file), outputs_of_sweep(options)
    quantities, settings = options.quantity or usual_quantities(scene), _settings(options)
    with _counted_progress(len(cases)) as progress:
        found = _named(
            options.file,
            lambda: sweep(
                scene,
                cases,
                quantities,
                workers=options.workers,
                settings=settings,
                progress=progress,
                batch=options.batch,
                warm=options.warm,
            ),
        )
    _give(found, lambda: report_sweep(found), outputs)
    if found.interrupted:
        print("sfetcas: interrupted: what was solved before is kept", file=sys.stderr)
        return INTERRUPTED
    if not found.solved.any():
        print(f"sfetcas: no solution: none of {counted(len(found), 'case')} was solved", file=sys.stderr)
        return NO_SOLUTION
    return SOLVED if (found.table["status"] == "solved").all() else SHORT


@contextlib.contextmanager
def _counted_progress(count: int) -> Iterator[Callable[[int], object] | None]:
    """How many cases are done: a bar on a terminal, which is wiped away at the end, else lines now and then."""
    if not sys.stderr.isatty():
        done = 0

        def more(number: int) -> None:
            nonlocal done
            done += number

        with _lines(lambda: f"{done} of {counted(count, 'case')}"):
            yield more
        return
    from tqdm import tqdm

    with tqdm(total=count, unit=" cases", leave=False, file=sys.stderr) as bar:
        yield bar.update


@contextlib.contextmanager
def _named_progress() -> Iterator[Callable[[str], object]]:
    """What is run: a line on a terminal, which is wiped away at the end, else lines now and then."""
    if not sys.stderr.isatty():
        names: list[str] = []
        with _lines(lambda: f"run {len(names)}: {names[-1]}" if names else "begins"):
            yield names.append
        return
    from tqdm import tqdm

    with tqdm(bar_format="run {n}: {desc} [{elapsed}]", leave=False, file=sys.stderr) as bar:

        def show(name: str) -> None:
            bar.set_description_str(name, refresh=False)
            bar.update()

        yield show


def _span(text: str) -> tuple[str, tuple[float, float] | None]:
    """An argument with the range that it may have."""
    from .sweeps.texts import assigned

    name, span = assigned(text)
    # A name of the scene may have the sign, but no key of a record that ends it.
    if not span and name and "=" not in name.rpartition(".")[2]:
        return name, None
    try:
        low, high = map(float, span.split(":"))
        return name, (low, high)
    except ValueError:
        raise SceneError(f"--argument: found {text!r}, accepted: NAME or NAME=LOW:HIGH") from None


def _place(text: str) -> tuple[str, tuple[float, ...]]:
    """Fractions of a member."""
    from .sweeps.texts import assigned

    name, numbers = assigned(text)
    try:
        return name, tuple(float(x) for x in numbers.split(","))
    except ValueError:
        raise SceneError(f"--places: found {text!r}, accepted: MEMBER=0,0.5,1") from None
