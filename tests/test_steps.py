"""A whole step as one CasADi Function: it is written as C without dependencies, and that gives the same numbers."""

import shutil
import subprocess
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from motions import METHODS, cantilever

from sfetcas import Scene, assemble, uniform_mesh
from sfetcas.dynamics.beginning import at_rest
from sfetcas.dynamics.integrating import Stepper
from sfetcas.dynamics.stages import StageEquations
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.masses import masses_of


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("name", ["radau-2", "conserving"])
def test_step_in_c_is_that_of_casadi(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = Scene.from_dict({**cantilever(), "analysis": {"type": "dynamic", "end": 1.0}})
    model = assemble(scene, replace(uniform_mesh(scene, 2, 1), places=True), assembly="nodal")
    system = StageEquations(Equations(model), masses_of(model), "interpreted")
    method = METHODS[name]
    step, state, n = Stepper(system, method).function, at_rest(model), system.layout
    step.generate("step.c")
    source = (tmp_path / "step.c").read_text()
    # Nothing but the mathematics of C: the linear solver is among the lines.
    assert [line for line in source.splitlines() if line.startswith("#include")] == ["#include <math.h>"]
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "step.c", "-o", "step.so", "-lm"], check=True)
    compiled = ca.external("step", "./step.so")
    x, _ = system.rates(state, np.ones(n.factors), np.zeros(system.equations.unknowns))
    shapes = [step.size_in(i) for i in range(step.n_in())]
    begin = [state.q.T, state.y, state.lam, np.zeros(shapes[3]), np.zeros(shapes[4]), x, np.zeros(shapes[6])]
    arguments = [*begin, 0.0, 0.1, np.ones(shapes[9]), np.zeros(shapes[10])]
    both = step(*arguments), compiled(*arguments)
    # It moves, and both do the same operations in the same order.
    assert float(ca.norm_inf(both[0][1])) > 1e-3
    for expected, found in zip(*both, strict=True):
        assert np.array_equal(np.array(expected), np.array(found))
