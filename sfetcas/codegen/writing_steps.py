"""Time steps as C: their functions, the first state of the motion, and the steps of the check."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..description.records import counted
from ..dynamics.steps import LAST_CHANGE
from ..mathematics.arrays import Array
from ..mathematics.linear import SOLVED
from ..mathematics.source import table
from .core_in_c import StepTables, core_in_c
from .rendering import Status, Writer, defined, filled, row, rows, template
from .timestep import TimeStep

__all__ = ["StepWriter"]

DONE = (
    ("DONE", 0, "the step was taken"),
    ("NOT_CONVERGED", 1, "no step: Newton's method did not converge or a result is not finite, try a shorter one"),
    (
        "BAD_ARGUMENT",
        2,
        "no step: its length is so short that rates would be rounding, or no length, an argument outside of its range, "
        "or the state not a finite number",
    ),
)
"""Result codes of a step: name, number, meaning."""

CHECKED, GROWTHS = 10, (1e-2, 1e-4, 1e-6, 0.0)
"""Number of steps of the check, and by how much histories that begin with zero grow in one, if that is not too much."""


class StepWriter(Writer):
    """The files of a time step."""

    header, example, check = "step.h", "step_main.c", "step_check.c"
    loader, readme = "step_loader.py.in", "step_README.md"

    def __init__(self, step: TimeStep) -> None:
        super().__init__(step.name, step.scene, step.arguments, step.results)
        self.step, by_core = step, step.by_core
        self._tables = None if by_core is None else StepTables(by_core)
        self.bodies = ("step_by_casadi.c", "step.c")
        if by_core is not None:
            # What CasADi's functions are for takes little time, and most of that to compile.
            self.optimisation, self.bodies = "Og", ("memory.c", "step_by_core.c", "step.c")

    @property
    def functions(self) -> list[ca.Function]:
        """The step, or what it depends on, and the results at a state."""
        step = self.step
        return [step.advance if step.by_core is None else step.system.row, step.output]

    def more(self, values: dict[str, object]) -> dict[str, str]:
        """The Python script that makes an FMI unit of the step."""
        named = {**values, "Name": self.name[:1].upper() + self.name[1:]}
        return {f"{self.name}_unit.py": filled(template("unit.py.in"), named)}

    def _manifest(self) -> dict[str, Any]:
        """The manifest, with other names in the FMI unit for results that have the names of arguments."""
        manifest = super()._manifest()
        given = {name for one in self.arguments.arguments for name in one.names}
        for one in manifest["results"]:
            if given & {one["name"], *(f"{one['name']}.{i}" for i in range(one["size"]))}:
                one["in_unit"] = f"answer.{one['name']}"
        return manifest

    @property
    def statuses(self) -> list[Status]:
        """The result codes of a step."""
        return list(DONE)

    @property
    def states(self) -> int:
        """Length of a state: the motion and data of the last step."""
        return len(self.step.begin)

    @property
    def memory(self) -> int:
        """Number of doubles for the state after a step, its arguments, three numbers about its convergence, what the
        core needs.
        """
        tables = self._tables
        of_core = 0 if tables is None else tables.numbers + tables.whole // 2 + 1
        return max(1, self.states) + self._columns + 3 + of_core

    @property
    def _columns(self) -> int:
        return max(1, len(self.arguments.defaults) * len(self.step.times))

    @property
    def own(self) -> dict[str, object]:
        """Method, sizes, usual length of a step, and words about the model."""
        flexible = counted(self.model.mesh.elements, f"{self.model.element.name} element")
        unknowns = counted(self.arguments.expressions.total, "unknown")
        tables, declared = self._tables, ""
        if tables is not None:
            declared = f"\n  double numbers[{tables.numbers}];\n  int whole[{tables.whole}];"
        return {
            "core_declared": declared,
            "shortest": f"{self.step.shortest:.3g}",
            "method": self.step.method.name,
            "n_times": len(self.step.times),
            "sz_p": self._columns,
            "sz_one": max(1, len(self.arguments.defaults)),
            "indent": " " * len(f"int {self.name}_step("),
            "indent_through": " " * len(f"int {self.name}_step_through("),
            "usual_step": repr(self.step.usual),
            "model_in_words": f"In {self.where}: {flexible}, {unknowns} at each stage.",
        }

    @property
    def about(self) -> dict[str, Any]:
        """Functions, integration method, and times within a step at which arguments are needed."""
        names = ["step", "step_through", "begin", "refresh", "times", "tell", "defaults", "message"]
        return {"functions": names, "integrator": self.step.method.name, "times": self.step.times.tolist()}

    @property
    def tables(self) -> list[str]:
        """The first state, the times within a step at which arguments are needed, the limit of convergence; the core
        and what it takes.
        """
        constants: dict[str, float] = {"CONVERGED": LAST_CHANGE, "SHORTEST": self.step.shortest}
        if self._tables is not None:
            constants |= self._tables.constants | {"SOLVED_TO": SOLVED, "TIME": float(self.step.time)}
        of_core = [] if self._tables is None else [*core_in_c("motion.c"), *self._tables.texts]
        return [
            *of_core,
            defined(constants),
            *self.ranges,
            table("sf_begin", self.step.begin),
            table("sf_loaded", self.step.times),
        ]

    @property
    def cases(self) -> dict[str, object]:
        """Results after the first steps, with arguments that change a little within and between steps; histories that
        begin with zero grow, so that something moves, as much as steps of this length take.
        """
        histories = [one.name.startswith("histories.") for one in self.arguments.arguments for _ in one.default]
        growing = np.array(histories, dtype=float) * (self.arguments.defaults == 0.0)
        for growth in GROWTHS if growing.any() else (0.0,):
            arguments, results = self._steps(growth * growing)
            if np.isfinite(results).all():
                break
        return {
            "n_cases": CHECKED,
            "case_arguments": rows(arguments),
            "case_results": rows(results),
            "units": row(self.units(results)),
        }

    def _steps(self, growing: Array) -> tuple[list[Array], list[Array]]:
        """Arguments and results of the steps of the check, to some of the arguments something is added."""
        step, state = self.step, self.step.begin
        arguments, results = [], []
        for number in range(CHECKED):
            parts = (number + step.times)[:, None]
            p = np.clip((1.0 + 0.01 * parts) * self.arguments.defaults + parts * growing, *self.limits)
            state = step.step(state, step.usual, p)
            arguments.append(p.ravel())
            results.append(step.outputs(state, p[-1]))
        return arguments, results
