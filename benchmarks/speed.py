"""Speed of equilibria and paths: order, loads, size, repeated, net, path; part of ``python -m benchmarks``."""

from __future__ import annotations

import multiprocessing
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from sfetcas.description.scene import Analysis, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.equilibria.statics import Settings, solve, solve_model
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.paths.paths import follow_path
from sfetcas.solvers.prepared import Prepared

from .scenes import arch, bend, cantilever, large, lee_frame, on_slider, rolled

__all__ = ["loads", "net", "order", "path", "repeated", "size"]

T = TypeVar("T")

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


def _median(call: Callable[[], T], runs: int) -> tuple[float, T]:
    times, result = [], call()
    for _ in range(runs):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


def order() -> None:
    """Tip error of the cantilever over elements and their number; the slope is the observed order."""
    print("Tip error, cantilever, F L^2/EI = 10\n")
    counts = (2, 4, 8, 16, 32)
    print(f"{'element':>10} {'points':>7} " + " ".join(f"{n:>9d}" for n in counts) + "   order")
    for dimension in ("plane", "space"):
        scene = cantilever([0.0, 10.0], dimension)
        for p in (1, 2, 3, 4, 6, 8):
            for gauss in (False, True):
                errors = [_tip_error(scene, p, n, gauss) for n in counts]
                good = [e for e in errors if e > 1e-12]
                slope = f"{np.log2(good[-2] / good[-1]):.1f}" if len(good) > 1 else "-"
                rule = "gauss" if gauss else "nodes"
                print(
                    f"{dimension + f' {p + 1}':>10} {rule:>7} " + " ".join(f"{e:9.1e}" for e in errors) + f"   {slope}"
                )


def _tip_error(scene: Scene, p: int, n: int, gauss: bool) -> float:
    step = solve_model(assemble(scene, uniform_mesh(scene, p, n, gauss)))
    return float(np.abs(step.position("tip")[:2] - TIP).max())


def loads() -> None:
    """One solve from the undeformed state at loads from 1e-6 to 1e8 EI/L^2, and roll-ups."""
    print("Loads, one solve to 1e-6: tip angle, estimated error, elements, seconds\n")
    for dimension in ("plane", "space"):
        for exponent in range(-6, 9, 2):
            scene = cantilever([0.0, 10.0**exponent], dimension)
            seconds, step = _median(lambda scene=scene: solve(scene, accuracy=1e-6).last, 1)  # type: ignore[misc]
            turned = step.along("beam", [1.0])["quaternion"][0]
            angle = 2.0 * np.arctan2(turned[3], turned[0])
            print(_line(f"{dimension} 1e{exponent}", angle, step, seconds))
    for turns in (1, 5, 50):
        seconds, step = _median(lambda turns=turns: solve(rolled(turns), accuracy=1e-6).last, 1)  # type: ignore[misc]
        print(_line(f"{turns} turns", step.angle("tip"), step, seconds))


def _line(name: str, angle: Any, step: Any, seconds: float) -> str:
    proof = step.certificate
    count = step.model.mesh.elements
    return f"{name:>12} {angle:12.6f} {proof.error_estimate:9.1e} {count:5d} {seconds:8.3f} s  stable: {proof.stable}"


def size() -> None:
    """Space, SFET2: building and solving over the number of elements, compiled and interpreted."""
    print("Size, space, SFET2: seconds to build the equations, to prepare IPOPT, of a solve; microseconds an element\n")
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
            seconds, _ = _median(lambda prepared=prepared: solve_model(prepared), 3)  # type: ignore[misc]
            figures = f"{built:8.3f} {first:8.3f} first {seconds:8.3f} again {1e6 * seconds / n:8.1f} us"
            print(f"{kernels:>12} {n:6d} {figures}")


def repeated() -> None:
    """Repeated solves of one prepared model at an error of about 1e-6: first, cold and warm."""
    print("Repeated solves of one prepared model: error over size; milliseconds first, cold, warm\n")
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
    for kernels in ("interpreted", "compiled"):
        for name, (scene, p, n) in cases.items():
            begin = time.perf_counter()
            prepared = Prepared(assemble(scene, uniform_mesh(scene, p, n)), kernels=kernels)
            near = solve_model(prepared, 0.97)
            first = time.perf_counter() - begin
            cold, step = _median(lambda prepared=prepared: solve_model(prepared), 15)  # type: ignore[misc]
            warm, _ = _median(lambda prepared=prepared, near=near: solve_model(prepared, start=near), 15)  # type: ignore[misc]
            exact = solve(scene, accuracy=1e-10).last
            error = max(float(np.abs(step.position(k) - exact.position(k)).max()) for k in scene.nodes) / scene.size
            print(f"{kernels:>12} {name:>9} {error:8.1e} {1e3 * first:8.1f} {1e3 * cold:8.2f} {1e3 * warm:8.2f}")


def net() -> None:
    """Systems of many members at the default accuracy, each in a process of its own."""
    print("Nets: members, elements, unknowns; seconds of the scene, of the models, of the solve, of all; memory\n")
    context = multiprocessing.get_context("spawn")
    for kind, counts in NETS.items():
        for members in counts:
            with context.Pool(1) as pool:
                print(f"{kind:>12} {pool.apply(_net, (kind, members))}")


def _net(kind: str, members: int) -> str:
    begin = time.perf_counter()
    scene = large(kind, members)
    made = time.perf_counter() - begin
    solution = solve(scene)
    total, seconds, model = time.perf_counter() - begin, solution.seconds, solution.last.model
    sizes = f"{len(scene.members):6d} {model.mesh.elements:7d} {model.unknowns:8d}"
    times = f"{made:8.2f} {seconds['model']:8.2f} {seconds['solve']:8.2f} {total:8.2f} s"
    return f"{sizes} {times} {1e6 * total / model.unknowns:8.0f} us an unknown {_peak():>9}"


def _peak() -> str:
    """Largest memory of this process so far; Linux counts it for the program alone, without what started it."""
    status = Path("/proc/self/status")
    if not status.exists():
        return "-"
    kilobytes = next(line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return f"{float(kilobytes) / 1e6:.2f} GB"


def path() -> None:
    """Equilibria along a path against single solves from the undeformed state, both at the same accuracy."""
    print("Paths: accuracy, points, limit points, seconds; milliseconds a point and of a single solve; 100 points\n")
    strip = CrossSection(EI2=14400.0, EI3=1440.0, GJ=3000.0)
    courses = {
        "Lee's frame": (lee_frame(), [-1.5, 2.5], 1.0),
        "the same in space": (lee_frame().replace(dimension="space", sections={"strip": strip}), [-1.5, 2.5], 1.0),
        "215-degree arch": (arch(), [-100.0, 1000.0], 500.0),
    }
    for name, (scene, factors, factor) in courses.items():
        for accuracy in PATH_ACCURACIES:
            along = scene.replace(analysis=Analysis(type="path", range=tuple(factors), accuracy=accuracy))
            seconds, found = _median(lambda along=along: follow_path(along, Settings()), 3)  # type: ignore[misc]
            single = scene.replace(analysis=Analysis(steps=(factor,), accuracy=accuracy))
            cold, _ = _median(lambda single=single: solve(single), 5)  # type: ignore[misc]
            count, each = len(found.points), seconds / len(found.points)
            figures = f"{count:4d} {len(found.limit_points):3d} {seconds:8.3f} s {1e3 * each:8.2f} {1e3 * cold:8.2f} ms"
            print(f"{name:>18} {accuracy:.0e} {figures}   100 points: {100.0 * each / cold:.1f} single solves")
