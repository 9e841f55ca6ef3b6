"""Accuracy and speed measured: ``python -m sfetcas.benchmark [NAME ...]``.

Names are order, loads, size, repeated, derivatives, net, path, motion, steps, code, accuracy, pieces, start and
extremes; left out, all are run.  Three others, ``random``, ``jitter`` and ``contact``, stand alone, take options
(``--help``) and half an hour each.

Not a test: times are medians on the machine at hand, printed as tables.  The problems are those of the
literature for which other programs' figures are known: S1, S1b a cantilever under F L^2/EI = 10 and 100; S2, S2b
the 45-degree bend under 300 and 600; S3, S3b a roll-up of 1 and 5 turns; S4 a beam on hinge and slider; Lee's frame and
the arch of 215 degrees for paths.  Nets, lattices, trees and chains have as many
members as wanted.
"""

from __future__ import annotations

import math
import multiprocessing
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .benchmarks.accuracy import knob
from .benchmarks.code import code
from .benchmarks.contact_run import contact
from .benchmarks.derivatives import derivatives
from .benchmarks.extremes import extremes
from .benchmarks.jitter import jitter
from .benchmarks.many import many
from .benchmarks.motion import motion, step_cost
from .benchmarks.pieces import pieces
from .benchmarks.random_run import random_scenes
from .description.scene import Analysis, Load, Member, Node, Scene
from .description.sections import CrossSection
from .description.shapes import Arc
from .equilibria.statics import Settings, solve, solve_model
from .errors import SceneError, SolveError
from .mechanics.equations import Equations
from .mechanics.mesh import uniform_mesh
from .mechanics.model import assemble
from .paths.paths import follow_path
from .solvers.prepared import Prepared

__all__ = ["main"]

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


def lee_frame() -> Scene:
    """The frame of Lee, Manuel and Rossow: it snaps through at 1.856."""
    nodes = {
        "foot": Node(position=[0, 0], support="hinge"),
        "corner": Node(position=[0, 120]),
        "load": Node(position=[24, 120]),
        "end": Node(position=[120, 120], support="hinge"),
    }
    pairs = {"column": ("foot", "corner"), "short": ("corner", "load"), "long": ("load", "end")}
    return Scene(
        sections={"strip": CrossSection(EI3=1440.0)},
        nodes=nodes,
        members={name: Member(nodes=pair, section="strip") for name, pair in pairs.items()},
        loads={"load": Load(type="force", node="load", value=[0, -1])},
    )


def arch() -> Scene:
    """The arch of DaDeppo and Schmidt, 215 degrees, hinged and clamped; it snaps through at 897."""
    half = math.radians(107.5)
    x, y = 100.0 * math.sin(half), 100.0 * math.cos(half)
    nodes = {
        "left": Node(position=[-x, y], support="hinge"),
        "load": Node(position=[0, 100]),
        "right": Node(position=[x, y], support="clamped"),
    }
    pairs = {"first": ("left", "load"), "second": ("load", "right")}
    return Scene(
        sections={"strip": CrossSection(EI3=1e6)},
        nodes=nodes,
        members={name: Member(nodes=pair, section="strip", shape=Arc(angle=-half)) for name, pair in pairs.items()},
        loads={"load": Load(type="force", node="load", value=[0, -1])},
    )


def woven(members: int) -> Scene:
    """A net of at least so many wavy strips welded at their crossings, its lowest row clamped, its highest one pulled.

    Squares of 0.1 m; the strips are arcs of 0.8 rad that bulge to either side in turn, so that the net can stretch.
    Columns c and rows r of squares have r (c + 1) upright strips and r c level ones.
    """
    columns = max(1, round((math.sqrt(8 * members + 1) - 1) / 4))
    rows = math.ceil(members / (2 * columns + 1))
    nodes, strips, loads = {}, {}, {}
    for j in range(rows + 1):
        for i in range(columns + 1):
            here, bulge = f"{i} {j}", 0.8 * (-1) ** (i + j)
            nodes[here] = Node(position=[0.1 * i, 0.1 * j], support="free" if j else "clamped")
            if j < rows:
                strips[f"up {here}"] = _wavy(here, f"{i} {j + 1}", -bulge)
            if j > 0 and i < columns:
                strips[f"right {here}"] = _wavy(here, f"{i + 1} {j}", bulge)
            if j == rows:
                loads[here] = Load(type="force", node=here, value=[0.3, 0.6])
    return Scene(sections={"strip": CrossSection(EI3=0.01)}, nodes=nodes, members=strips, loads=loads)


def _wavy(first: str, second: str, angle: float) -> Member:
    return Member(nodes=[first, second], section="strip", shape=Arc(angle=angle))


def _of_types(scene: Scene, kind: Callable[[int, bool], str]) -> Scene:
    """A net with its members of other types, each by its number and whether it is level."""
    members = {
        name: Member(nodes=member.nodes, section="strip", shape=member.shape, type=kind(i, name.startswith("right")))
        for i, (name, member) in enumerate(scene.members.items())
    }
    return scene.replace(members=members)


def with_rigid_rows(members: int) -> Scene:
    """The net with rigid level members: each row turns as one."""
    return _of_types(woven(members), lambda i, level: "rigid" if level else "flexible")


def of_small_members(members: int) -> Scene:
    """The net of small members."""
    return _of_types(woven(members), lambda i, level: "small")


def of_all_types(members: int) -> Scene:
    """The net with flexible and small members, some of its level ones rigid."""
    names = ("flexible", "small", "rigid")
    return _of_types(woven(members), lambda i, level: names[i % (3 if level else 2)])


def lattice(members: int) -> Scene:
    """A square lattice of at least so many straight small members, its feet clamped, its top pushed and pulled."""
    n = math.ceil(math.sqrt(members / 2 + 1 / 16) - 1 / 4)
    nodes, bars, loads = {}, {}, {}
    for j in range(n + 1):
        for i in range(n + 1):
            here = f"{i} {j}"
            nodes[here] = Node(position=[0.1 * i, 0.1 * j], support="free" if j else "clamped")
            if j > 0:
                bars[f"up {here}"] = Member(nodes=[f"{i} {j - 1}", here], section="strip", type="small")
            if i > 0 and j > 0:
                bars[f"right {here}"] = Member(nodes=[f"{i - 1} {j}", here], section="strip", type="small")
            if j == n:
                loads[here] = Load(type="force", node=here, value=[0.3 / n, 0.2 / n])
    return Scene(sections={"strip": CrossSection(EI3=0.01)}, nodes=nodes, members=bars, loads=loads)


def tree(members: int) -> Scene:
    """A tree of so many flexible members, two at each end of another, its leaves pulled."""
    nodes = {"0": Node(position=[0, 0], support="clamped")}
    branches, loads = {}, {}
    for k in range(1, members + 1):
        x, y, _ = nodes[str((k - 1) // 2)].position
        nodes[str(k)] = Node(position=[x + 0.3 * math.sin(3.0 * k), y + 1.0 + 0.2 * math.cos(5.0 * k)])
        branches[str(k)] = Member(nodes=[str((k - 1) // 2), str(k)], section="twig")
        if 2 * k >= members:
            loads[str(k)] = Load(type="force", node=str(k), value=[0.01, 0.02])
    return Scene(sections={"twig": CrossSection(EI3=1.0)}, nodes=nodes, members=branches, loads=loads)


def chain(members: int) -> Scene:
    """Rigid links hinged to each other between two supports, loaded at each hinge; the middle one is flexible."""
    members = max(members, 2)
    nodes, links, loads = {"0": Node(position=[0, 0], support="hinge")}, {}, {}
    for k in range(1, members + 1):
        place = [float(k), -0.3 * members * math.sin(math.pi * k / members)]
        nodes[str(k)] = Node(position=place, joint="hinge") if k < members else Node(position=place, support="hinge")
        kind = "flexible" if k == (members + 1) // 2 else "rigid"
        links[str(k)] = Member(nodes=[str(k - 1), str(k)], section="rod", type=kind)
        if k < members:
            loads[str(k)] = Load(type="force", node=str(k), value=[0.0, -0.5])
    return Scene(sections={"rod": CrossSection(EI3=100.0)}, nodes=nodes, members=links, loads=loads)


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


def large(kind: str, members: int) -> Scene:
    """A system of a kind of NETS with at least so many members."""
    made = {
        "wavy strips": woven,
        "rigid rows": with_rigid_rows,
        "small": of_small_members,
        "all types": of_all_types,
        "lattice": lattice,
        "tree": tree,
        "chain": chain,
    }
    return made[kind](members)


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
            along = scene.replace(analysis=Analysis(type="path", range=factors, accuracy=accuracy))
            seconds, found = _median(lambda along=along: follow_path(along, Settings()), 3)  # type: ignore[misc]
            single = scene.replace(analysis=Analysis(steps=[factor], accuracy=accuracy))
            cold, _ = _median(lambda single=single: solve(single), 5)  # type: ignore[misc]
            count, each = len(found.points), seconds / len(found.points)
            figures = f"{count:4d} {len(found.limit_points):3d} {seconds:8.3f} s {1e3 * each:8.2f} {1e3 * cold:8.2f} ms"
            print(f"{name:>18} {accuracy:.0e} {figures}   100 points: {100.0 * each / cold:.1f} single solves")


def start() -> None:
    """Import, and a whole run of the command line, as processes of their own."""
    for name, command in {"import": ["-c", "import sfetcas"], "command line": ["-m", "sfetcas", "--help"]}.items():
        run = [sys.executable, *command]
        seconds, _ = _median(lambda run=run: subprocess.run(run, check=True, capture_output=True), 5)  # type: ignore[misc]
        print(f"{name:>12} {seconds:8.3f} s")


def main(names: list[str]) -> None:
    """Run the benchmarks of these names, all by default."""
    known = {"order": order, "loads": loads, "size": size, "repeated": repeated, "derivatives": derivatives}
    known |= {"net": net, "path": path, "motion": motion, "steps": step_cost, "code": code}
    known |= {"accuracy": knob, "pieces": pieces, "sweep": many, "start": start, "extremes": extremes}
    alone: dict[str, Callable[[list[str]], None]] = {"random": random_scenes, "jitter": jitter, "contact": contact}
    if names[:1] and names[0] in alone:
        alone[names[0]](names[1:])
        return
    for name in names or list(known):
        if name not in known:
            raise SystemExit(f"found benchmark {name!r}, accepted: {', '.join([*known, *alone])}")
        try:
            known[name]()
        except (SceneError, SolveError) as error:
            print(f"{name}: {error}")
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
