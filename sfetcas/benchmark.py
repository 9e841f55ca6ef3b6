"""Accuracy and speed measured: ``python -m sfetcas.benchmark [order] [loads] [size] [repeated] [start]``.

Not a test: times are medians on the machine at hand, printed as tables.  The problems are those of the
literature for which other programs' figures are known: S1, S1b a cantilever under F L^2/EI = 10 and 100; S2, S2b
the 45-degree bend under 300 and 600; S3, S3b a roll-up of 1 and 5 turns; S4 a beam on hinge and slider.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from .equations import Equations
from .errors import SolveError
from .mesh import uniform_mesh
from .model import assemble
from .prepared import Prepared
from .scene import Load, Member, Node, Scene
from .sections import CrossSection
from .shapes import Arc
from .statics import solve, solve_model

__all__ = ["main"]

T = TypeVar("T")

TIP = np.array([0.445004402246249, 0.810609024880296])
"""Tip of the cantilever under F L^2/EI = 10, elliptic integrals."""


def cantilever(force: list[float], dimension: str = "plane") -> Scene:
    """Straight cantilever, L = EI = GJ = 1."""
    return Scene(
        dimension=dimension,
        sections={"unit": CrossSection(EI2=1.0, EI3=1.0, GJ=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="unit")},
        loads={"tip": Load(type="force", node="tip", value=force)},
    )


def bend(force: float) -> Scene:
    """The 45-degree bend of Bathe and Bolourchi: radius 100, E I = G J = 1e7/12."""
    stiffness = 1e7 / 12.0
    end = [100.0 * np.sin(np.pi / 4), 100.0 * (1.0 - np.cos(np.pi / 4))]
    return cantilever([0.0, 0.0, force], "space").replace(
        sections={"unit": CrossSection(EI2=stiffness, EI3=stiffness, GJ=stiffness)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=end)},
        members={"beam": Member(nodes=["root", "tip"], section="unit", shape=Arc(angle=np.pi / 4))},
    )


def rolled(turns: float) -> Scene:
    """A cantilever rolled up by a moment."""
    moment = Load(type="moment", node="tip", value=2.0 * np.pi * turns)
    return cantilever([0.0, 1.0]).replace(loads={"tip": moment})


def on_slider() -> Scene:
    """Two members of length 1 on hinge and slider, 5 N in the middle."""
    nodes = {
        "left": Node(position=[0, 0], support="hinge"),
        "middle": Node(position=[1, 0]),
        "right": Node(position=[2, 0], support="slider", direction=[1, 0], rotation="hinge"),
    }
    members = {
        "first": Member(nodes=["left", "middle"], section="unit"),
        "second": Member(nodes=["middle", "right"], section="unit"),
    }
    force = Load(type="force", node="middle", value=[0, -5])
    return cantilever([0.0, 1.0]).replace(nodes=nodes, members=members, loads={"middle": force})


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


def start() -> None:
    """Import, and a whole run of the command line, as processes of their own."""
    for name, command in {"import": ["-c", "import sfetcas"], "command line": ["-m", "sfetcas", "--help"]}.items():
        run = [sys.executable, *command]
        seconds, _ = _median(lambda run=run: subprocess.run(run, check=True, capture_output=True), 5)  # type: ignore[misc]
        print(f"{name:>12} {seconds:8.3f} s")


def main(names: list[str]) -> None:
    """Run the benchmarks of these names, all by default."""
    known = {"order": order, "loads": loads, "size": size, "repeated": repeated, "start": start}
    for name in names or list(known):
        if name not in known:
            raise SystemExit(f"found benchmark {name!r}, accepted: {', '.join(known)}")
        try:
            known[name]()
        except SolveError as error:
            print(f"{name}: {error}")
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
