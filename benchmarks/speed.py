"""Speed of equilibria and paths: order, loads, size, repeated, whole, net, path; part of ``python -m benchmarks``."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from sfetcas import load
from sfetcas import solve as solve_any
from sfetcas.description.scene import Analysis, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.equilibria.statics import Settings, solve, solve_model
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.paths.paths import follow_path
from sfetcas.solvers.prepared import Prepared

from .saving import head, row
from .scenes import arch, bend, cantilever, large, lee_frame, on_slider, rolled
from .timing import least

__all__ = ["TIP", "loads", "net", "order", "path", "repeated", "size", "whole"]

TIP = np.array([0.445004402246249, 0.810609024880296])
"""Tip of the cantilever under F L^2/EI = 10, elliptic integrals."""

PATH_ACCURACIES = (1e-4, 1e-6, 1e-8)
"""Accuracies at which paths are compared with single solves."""

NETS = {
    "wavy strips": (100, 300, 1000, 2000),
    "rigid rows": (250, 1000, 2000),
    "small": (250, 1000, 2000),
    "all types": (250, 1000, 2000),
    "lattice": (250, 1000, 1860),
    "tree": (250, 1000, 2000),
    "chain": (250, 500, 1000),
}
"""Members of the nets, at least."""


def order() -> None:
    """Tip error of the cantilever over elements and their number; the slope is the observed order."""
    print("Tip error over the length, cantilever, F L²/EI = 10, over the number of elements\n")
    counts = (2, 4, 8, 16, 32)
    head("element", "integration", *map(str, counts), "order")
    for dimension in ("plane", "space"):
        scene = cantilever([0.0, 10.0], dimension)
        for p in (1, 2, 3, 4, 6, 8):
            for gauss in (False, True):
                errors = [_tip_error(scene, p, n, gauss) for n in counts]
                good = [e for e in errors if e > 1e-12]
                slope = f"{np.log2(good[-2] / good[-1]):.1f}" if len(good) > 1 else "-"
                rule = "Gauss points" if gauss else "nodes"
                row(f"SFET{p + 1}, {dimension}", rule, *(f"{e:.1e}" for e in errors), slope)


def _tip_error(scene: Scene, p: int, n: int, gauss: bool) -> float:
    step = solve_model(assemble(scene, uniform_mesh(scene, p, n, gauss)))
    return float(np.abs(step.position("tip")[:2] - TIP).max())


def loads() -> None:
    """One solve from the undeformed state at loads from 1e-6 to 1e8 EI/L^2, and roll-ups."""
    print("One solve to 1e-6 from the undeformed state, without load steps\n")
    head("load", "tip angle, rad", "estimated error", "elements", "seconds", "stable")
    for dimension in ("plane", "space"):
        for exponent in range(-6, 9, 2):
            scene = cantilever([0.0, 10.0**exponent], dimension)
            seconds, step = least(lambda scene=scene: solve(scene, accuracy=1e-6).last, 1)  # type: ignore[misc]
            turned = step.along("beam", [1.0])["quaternion"][0]
            angle = 2.0 * np.arctan2(turned[3], turned[0])
            _line(f"force of 1e{exponent} EI/L², {dimension}", angle, step, seconds)
    for turns in (1, 5, 50):
        seconds, step = least(lambda turns=turns: solve(rolled(turns), accuracy=1e-6).last, 1)  # type: ignore[misc]
        _line(f"roll-up of {turns} turns, plane", step.angle("tip"), step, seconds)


def _line(name: str, angle: Any, step: Any, seconds: float) -> None:
    proof = step.certificate
    elements = step.model.mesh.elements
    row(name, f"{angle:.6f}", f"{proof.error_estimate:.1e}", elements, f"{seconds:.3f}", proof.stable)


def size() -> None:
    """Space, SFET2: building and solving over the number of elements, compiled and interpreted."""
    print("Cantilever in space, SFET2, over the number of elements; memory is the largest of the process so far\n")
    head("kernels", "elements", "equations, s", "first solve, s", "solve again, s", "µs an element", "memory")
    scene = cantilever([0.0, 3.0, 1.0], "space")
    for kernels in ("interpreted", "compiled"):
        for n in (100, 1000, 8192, 10_000):
            begin = time.perf_counter()
            prepared = Prepared(assemble(scene, uniform_mesh(scene, 1, n)), kernels=kernels)
            assert isinstance(prepared.equations, Equations)
            built = time.perf_counter() - begin
            begin = time.perf_counter()
            solve_model(prepared)
            first = time.perf_counter() - begin
            seconds, _ = least(lambda prepared=prepared: solve_model(prepared), 3)  # type: ignore[misc]
            times = (f"{built:.3f}", f"{first:.3f}", f"{seconds:.3f}", f"{1e6 * seconds / n:.1f}")
            row(kernels, n, *times, _peak())


def repeated() -> None:
    """Repeated solves of one prepared model at an error of about 1e-6: first, cold and warm."""
    print(
        "One prepared model solved again and again: cold from the start guess, warm from an answer at 0.97 of the load."
    )
    print("Errors are over the size of the scene, times are the least of several in milliseconds.\n")
    head("problem", "kernels", "error", "model and first solve", "cold", "warm")
    cases = {
        "S1": (cantilever([0.0, 10.0]), 4, 3),
        "S1b": (cantilever([0.0, 100.0]), 4, 10),
        "S1 space": (cantilever([0.0, 10.0], "space"), 4, 3),
        "S2": (bend(300.0), 4, 2),
        "S2b": (bend(600.0), 4, 2),
        "S3": (rolled(1), 6, 2),
        "S3b": (rolled(5), 6, 10),
        "S4": (on_slider(), 4, 2),
    }
    for kernels in ("core", "interpreted", "compiled"):
        for name, (scene, p, n) in cases.items():
            begin = time.perf_counter()
            prepared = Prepared(assemble(scene, uniform_mesh(scene, p, n)), kernels=kernels)
            near = solve_model(prepared, 0.97)
            first = time.perf_counter() - begin
            cold, step = least(lambda prepared=prepared: solve_model(prepared), 15)  # type: ignore[misc]
            warm, _ = least(lambda prepared=prepared, near=near: solve_model(prepared, start=near), 15)  # type: ignore[misc]
            exact = solve(scene, accuracy=1e-10).last
            error = max(float(np.abs(step.position(k) - exact.position(k)).max()) for k in scene.nodes) / scene.size
            row(name, kernels, f"{error:.1e}", f"{1e3 * first:.1f}", f"{1e3 * cold:.2f}", f"{1e3 * warm:.2f}")


def whole() -> None:
    """Whole runs, with branch, mesh, error estimate and certificate, by the core and without it."""
    print("Whole runs at an accuracy of 1e-6, each after two that are not counted; processor time, medians of fifteen")
    print("(paths and contact: five), in milliseconds. With and without the core in turns, in one process.\n")
    head("problem", "solver", "core", "without", "ratio")
    folder = Path(__file__).parent.parent / "problems"
    cantilever_, bend_, portal = (load(folder / f"{name}.toml") for name in ("cantilever_tip_force", *WHOLE))
    statics = {
        "cantilever, F L²/EI = 10": cantilever_.replace({"analysis.steps": [10.0], "analysis.accuracy": 1e-6}),
        "45 degree bend": bend_.replace({"analysis.steps": bend_.analysis.steps[-1:], "analysis.accuracy": 1e-6}),
        "portal frame": portal.replace({"analysis.steps": [5.0], "analysis.accuracy": 1e-6}),
    }
    for name, scene in statics.items():
        for solver in ("ipopt", "newton"):
            _whole(name, scene, solver, 15)
    lee = load(folder / "lee_frame.toml").replace({"analysis.accuracy": 1e-6})
    _whole("path of Lee's frame", lee, "ipopt", 5)
    _whole("heavy cantilever on a floor", load(folder / "floor_heavy_cantilever.toml"), "ipopt", 5)


WHOLE = ("bend_45_degrees", "portal_frame")
"""Problems that are solved as a whole beside the cantilever."""


def _whole(name: str, scene: Scene, solver: str, runs: int) -> None:
    spent: dict[str, list[float]] = {"on": [], "off": []}
    before = os.environ.get("SFETCAS_CORE")
    try:
        for _ in range(runs + 2):
            for core, found in spent.items():
                os.environ["SFETCAS_CORE"] = core
                begin = time.process_time()
                solve_any(scene, solver=solver)
                found.append(time.process_time() - begin)
    finally:
        os.environ.pop("SFETCAS_CORE")
        if before is not None:
            os.environ["SFETCAS_CORE"] = before
    by_core, without = (1e3 * float(np.median(found[2:])) for found in spent.values())
    row(name, solver, f"{by_core:.1f}", f"{without:.1f}", f"{without / by_core:.1f}")


def net() -> None:
    """Systems of many members at the default accuracy, each in a process of its own."""
    print("Systems of many members at the default accuracy; seconds\n")
    times = ("scene", "models", "solve", "all", "µs an unknown")
    head("kind", "members", "elements", "unknowns", *times, "memory")
    context = multiprocessing.get_context("spawn")
    for kind, counts in NETS.items():
        for members in counts:
            with context.Pool(1) as pool:
                row(kind, *pool.apply(_net, (kind, members)))


def _net(kind: str, members: int) -> tuple[str, ...]:
    begin = time.perf_counter()
    scene = large(kind, members)
    made = time.perf_counter() - begin
    solution = solve(scene)
    total, seconds, model = time.perf_counter() - begin, solution.seconds, solution.last.model
    sizes = (len(scene.members), model.mesh.elements, model.unknowns)
    times = (made, seconds["model"], seconds["solve"], total)
    each = f"{1e6 * total / model.unknowns:.0f}"
    return *map(str, sizes), *(f"{one:.2f}" for one in times), each, _peak()


def _peak() -> str:
    """Largest memory of this process so far; Linux counts it for the program alone, without what started it."""
    status = Path("/proc/self/status")
    if not status.exists():
        return "-"
    kilobytes = next(line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return f"{float(kilobytes) / 1e6:.2f} GB"


def path() -> None:
    """Equilibria along a path against single solves from the undeformed state, both at the same accuracy."""
    print("Equilibria along a path, and single solves of the same scene to the same accuracy; least times\n")
    counted = ("points", "limit points", "path, s")
    head("path", "accuracy", *counted, "ms a point", "ms a solve", "100 points, in solves")
    strip = CrossSection(EI2=14400.0, EI3=1440.0, GJ=3000.0)
    courses = {
        "Lee's frame": (lee_frame(), [-1.5, 2.5], 1.0),
        "the same in space": (lee_frame().replace(dimension="space", sections={"strip": strip}), [-1.5, 2.5], 1.0),
        "215-degree arch": (arch(), [-100.0, 1000.0], 500.0),
    }
    for name, (scene, factors, factor) in courses.items():
        for accuracy in PATH_ACCURACIES:
            along = scene.replace(analysis=Analysis(type="path", range=tuple(factors), accuracy=accuracy))
            seconds, found = least(lambda along=along: follow_path(along, Settings()), 3)  # type: ignore[misc]
            single = scene.replace(analysis=Analysis(steps=(factor,), accuracy=accuracy))
            cold, _ = least(lambda single=single: solve(single), 5)  # type: ignore[misc]
            count, each = len(found.points), seconds / len(found.points)
            counts = (count, len(found.limit_points), f"{seconds:.3f}")
            row(
                name, f"{accuracy:.0e}", *counts, f"{1e3 * each:.2f}", f"{1e3 * cold:.2f}", f"{100.0 * each / cold:.1f}"
            )
