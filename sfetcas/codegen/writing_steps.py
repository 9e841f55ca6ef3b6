"""Time steps as C: their functions, the first state of the motion, and the steps of the check."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..description.records import counted
from ..dynamics.steps import LAST_CHANGE
from ..mathematics.source import table
from .rendering import Status, Writer, filled, row, rows, template
from .timestep import TimeStep

__all__ = ["StepWriter"]

DONE = (
    ("DONE", 0, "the step was taken"),
    ("NOT_CONVERGED", 1, "no step: Newton's method did not converge or a result is not finite, try a shorter one"),
    (
        "BAD_ARGUMENT",
        2,
        "no step: its length is not positive, an argument outside of its range, or the state not a finite number",
    ),
)
"""Result codes of a step: name, number, meaning."""

CHECKED = 10
"""Number of steps of the check."""


class StepWriter(Writer):
    """The files of a time step."""

    header, example, check = "step.h", "step_main.c", "step_check.c"
    loader, readme, bodies = "step_loader.py.in", "step_README.md", ("step.c",)

    def __init__(self, step: TimeStep) -> None:
        super().__init__(step.name, step.scene, step.arguments, step.results)
        self.step = step

    @property
    def functions(self) -> list[ca.Function]:
        """The step, and the results at a state."""
        return [self.step.advance, self.step.output]

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
        """Number of doubles for the state after a step, its arguments, and three numbers about its convergence."""
        return max(1, self.states) + self._columns + 3

    @property
    def _columns(self) -> int:
        return max(1, len(self.arguments.defaults) * len(self.step.times))

    @property
    def own(self) -> dict[str, object]:
        """Method, sizes, usual length of a step, and words about the model."""
        flexible = counted(self.model.mesh.elements, f"{self.model.element.name} element")
        unknowns = counted(self.arguments.expressions.total, "unknown")
        return {
            "method": self.step.method.name,
            "n_times": len(self.step.times),
            "sz_p": self._columns,
            "sz_one": max(1, len(self.arguments.defaults)),
            "indent": " " * len(f"int {self.name}_step("),
            "indent_through": " " * len(f"int {self.name}_step_through("),
            "usual_step": repr(self.usual),
            "model_in_words": f"In {self.where}: {flexible}, {unknowns} at each stage.",
        }

    @property
    def usual(self) -> float:
        """Length of the steps of the check, s."""
        analysis = self.scene.analysis
        return float(analysis.step or analysis.duration / 1000.0)

    @property
    def about(self) -> dict[str, Any]:
        """Functions, integration method, and times within a step at which arguments are needed."""
        names = ["step", "step_through", "begin", "refresh", "times", "tell", "defaults", "message"]
        return {"functions": names, "integrator": self.step.method.name, "times": self.step.times.tolist()}

    @property
    def tables(self) -> list[str]:
        """The first state, the times within a step at which arguments are needed, and the limit of convergence."""
        converged = f"#define SF_CONVERGED {LAST_CHANGE!r}\n"
        return [
            converged,
            *self.ranges,
            table("sf_begin", self.step.begin),
            table("sf_times", self.step.times),
        ]

    @property
    def cases(self) -> dict[str, object]:
        """Results after the first steps, with arguments that change a little within and between steps."""
        step, state = self.step, self.step.begin
        arguments, results = [], []
        for number in range(CHECKED):
            shares = 1.0 + 0.01 * (number + step.times)
            p = np.clip(shares[:, None] * self.arguments.defaults, *self.limits)
            state = step.step(state, self.usual, p)
            arguments.append(p.ravel())
            results.append(step.outputs(state, p[-1]))
        return {
            "n_cases": CHECKED,
            "case_arguments": rows(arguments),
            "case_results": rows(results),
            "units": row(self.units(results)),
        }
