"""The equations of motion of a scene as plain CasADi Functions with named inputs and outputs, for other programs.

    x' = ode(x, z, u, p),      0 = alg(x, z, u, p),      y = outputs(x, u, p)

of index 1, in SI units and seconds, arbitrarily often differentiable: the form that rockit, do-mpc, acados and Opti
take.  States are rotations (quaternions or angles), displacements, their rates (angular velocities about the fixed
axes), and angles that count turns; algebraic variables are accelerations and multipliers.  The constraints of joints
and loops, and their rates, are invariants: met if they are met at the begin, up to errors of the integration.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.scene import Scene, check_scene
from ..description.showing import few, shown
from ..dynamics.index_one import LINEAR, IndexOne
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import TINY, Array
from ..parametric.equilibrium import Place
from .controlled import ControlledSystem
from .optimal_control import moving
from .statement import Control, Variable

__all__ = ["MotionFunctions", "motion_functions"]


class _Differentiable(IndexOne):
    """The same equations without a Jacobian of their own: CasADi differentiates them, exactly."""

    @functools.cached_property
    def balance(self) -> ca.Function:
        """(q, y, w, unwrapped, a, lam, f, f1, f2) -> what is out of balance, then accelerations of the closings."""
        system, n = self.system, self.system.layout
        names = ["q", "y", "w", "unwrapped", "a", "lam", "f", "f1", "f2"]
        sizes = [*self.states, *self.algebraic, *[n.factors] * 3]
        symbols = [ca.MX.sym(name, size) for name, size in zip(names, sizes, strict=True)]
        q, y, w, unwrapped, a, lam, f, f1, f2 = symbols
        spin, faster = self._curve(q, w, a)
        moved = slice(system.equations.rotation_unknowns, self.unknowns)
        seen = self._seen(
            ca.vertcat(q, y, f), ca.vertcat(spin, w[moved], f1), ca.vertcat(faster, a[moved], f2), unwrapped
        )
        forces = system.forces(seen[1][: n.x], seen[2][: n.x])
        stage = system.stage(self._full(q, f), y, lam, forces, f, unwrapped)
        out = ca.vertcat(stage.residual[: self.unknowns], seen[2][n.x :])
        return ca.Function("balance", symbols, [out], names, ["missed"])


@dataclass(frozen=True, eq=False)
class MotionFunctions:
    """The functions of one scene on one mesh.

    Attributes
    ----------
    inputs, parameters, outputs : tuple of str
        Names of the numbers of the scene in ``u`` and ``p``, and of the answers in ``y``, in this order.
    begin : ndarray (states,)
        Initial state, SI units.
    sizes : mapping of str to int
        Sizes of ``x``, ``z``, ``u``, ``p`` and ``y``.
    parts : mapping of str to slice
        Parts of ``x``: rotations ``q``, displacements ``y``, rates ``w``, turn-counting angles ``unwrapped``; of ``z``:
        accelerations ``a``, multipliers ``lam``.
    default : mapping of str to ndarray
        Values of ``u`` and ``p`` in the scene, in its units.
    shapes : mapping of str to tuple of int
        Shapes of the outputs, which are flattened into ``y`` row by row.
    dae : Function
        ``(x, z, u, p) -> ode, alg``
    outputs_of : Function
        ``(x, u, p) -> y``
    invariants : Function
        ``(x, u, p) ->`` gaps of the constraints, their rates, squared norms of quaternions less 1.
    """

    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    begin: Array
    sizes: Mapping[str, int]
    parts: Mapping[str, slice]
    default: Mapping[str, Array]
    shapes: Mapping[str, tuple[int, ...]]
    dae: ca.Function = field(repr=False)
    outputs_of: ca.Function = field(repr=False)
    invariants: ca.Function = field(repr=False)

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name}: {size}" for name, size in self.sizes.items())
        kinds = {"u": self.inputs, "p": self.parameters, "y": self.outputs}
        lines = [f"{symbol}: {few(names)}" for symbol, names in kinds.items() if names]
        return shown(self, [f"sizes of {sizes}"], [*lines, "functions dae(x, z, u, p), explicit(x, u, p), ..."])

    def _symbols(self) -> list[ca.MX]:
        return [ca.MX.sym(name, self.sizes[name]) for name in ("x", "z", "u", "p")]

    @functools.cached_property
    def ode(self) -> ca.Function:
        """``(x, z, u, p) -> x'``, per s."""
        s = self._symbols()
        return ca.Function("ode", s, [self.dae(*s)[0]], ["x", "z", "u", "p"], ["ode"])

    @functools.cached_property
    def alg(self) -> ca.Function:
        """``(x, z, u, p) ->`` residual of the equations of motion, accelerations of the constraints; dimensionless."""
        s = self._symbols()
        return ca.Function("alg", s, [self.dae(*s)[1]], ["x", "z", "u", "p"], ["alg"])

    @functools.cached_property
    def implicit(self) -> ca.Function:
        """``(xdot, x, z, u, p) -> xdot - ode``, then alg: the residual of the implicit DAE."""
        rate, s = ca.MX.sym("xdot", self.sizes["x"]), self._symbols()
        ode, alg = self.dae(*s)
        return ca.Function("implicit", [rate, *s], [ca.vertcat(rate - ode, alg)], ["xdot", "x", "z", "u", "p"], ["f"])

    @functools.cached_property
    def explicit(self) -> ca.Function:
        """``(x, u, p) -> x'``, per s, and z: the algebraic equations, which are linear in z, are solved."""
        x, z, u, p = self._symbols()
        missed = self.alg(x, z, u, p)
        matrix = ca.substitute(ca.jacobian(missed, z), z, ca.MX.zeros(z.shape))
        without = self.alg(x, ca.MX.zeros(z.shape), u, p)
        found = -ca.solve(matrix, without, LINEAR, {"eps": 1e-300}) if self.sizes["z"] else ca.MX(0, 1)
        return ca.Function("explicit", [x, u, p], [self.ode(x, found, u, p), found], ["x", "u", "p"], ["ode", "z"])

    @functools.cached_property
    def jacobians(self) -> ca.Function:
        """``(x, z, u, p) ->`` derivatives of ode and alg by x, z, u: ``ode_x``, ``ode_z``, ``ode_u``, ``alg_x``, ..."""
        s = self._symbols()
        results = dict(zip(("ode", "alg"), self.dae(*s), strict=True))
        by = dict(zip(("x", "z", "u"), s, strict=False))
        found = {f"{name}_{key}": ca.jacobian(e, w) for name, e in results.items() for key, w in by.items()}
        return ca.Function("jacobians", s, list(found.values()), ["x", "z", "u", "p"], list(found))


def motion_functions(
    scene: Scene,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    *,
    parameters: Mapping[str, tuple[float, float]] | Sequence[str] = (),
    places: Place | None = None,
    settings: Settings | None = None,
) -> MotionFunctions:
    """The equations of motion of a scene as plain CasADi Functions.

    Parameters
    ----------
    scene : Scene
    inputs : numbers of the scene that change with time: components of loads, or ``histories.NAME``
    outputs : names of answers: positions, velocities, angles, springs, ``energy.elastic``
    parameters : further numbers of the scene, by name or with ranges ``(low, high)``; not masses
    places : fractions of the length at which outputs along members are given
    settings : accuracy or elements of the mesh

    Raises
    ------
    SceneError
        The scene has no such numbers or answers, or a rotation in it has no inertia.
    """
    check_scene(scene, "motion_functions({}, ...)", steps=False)
    if scene.relaxes:
        message = "motion_functions: found members that relax, whose relaxed strains have no accelerations"
        raise SceneError(f"{message}, accepted: sections without 'relaxation'")
    spans = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters, (-np.inf, np.inf))
    variables = [Variable(name, low, high) for name, (low, high) in spans.items()]
    controls = [Control(name) for name in inputs]
    system = ControlledSystem(moving(scene, 1.0), controls, variables, list(outputs), places, settings)
    return _Made(system, tuple(inputs), tuple(spans), tuple(outputs)).functions()


class _Made:
    """What puts the functions of a system together."""

    def __init__(
        self, system: ControlledSystem, inputs: tuple[str, ...], parameters: tuple[str, ...], outputs: tuple[str, ...]
    ) -> None:
        self.system, self.inputs, self.parameters, self.outputs = system, inputs, parameters, outputs
        self.form = _Differentiable(system.system, 0)
        length, time, force = system.model.scales.length, system.time, system.model.scales.force
        n, rotation_unknowns = system.system.layout, system.system.equations.rotation_unknowns
        shifts = self.form.unknowns - rotation_unknowns
        rates = np.repeat([1.0 / time, length / time], [rotation_unknowns, shifts])
        self.x_unit = np.concatenate([np.ones(self.form.q_size), np.full(n.y, length), rates, np.ones(n.unwrapped)])
        self.z_unit = np.concatenate([rates / time, np.full(n.lam, force)])
        self.names = ["x", "z", "u", "p"]
        self.bounds = np.cumsum([0, *self.form.states]).tolist()

    def functions(self) -> MotionFunctions:
        """The functions."""
        sizes = {"x": len(self.x_unit), "z": len(self.z_unit), "u": len(self.inputs), "p": len(self.parameters)}
        sizes["y"] = sum(one.size for one in self.system.results.results)
        symbols = [ca.MX.sym(name, sizes[name]) for name in self.names]
        x, z, u, p = symbols
        states, own = x / ca.DM(self.x_unit), ca.vertcat(1.0, u, p)
        problem = self.form.problem
        terms = [problem[name] for name in ("x", "z", "t", "p")]
        equations = ca.Function("equations", terms, [problem["ode"], problem["alg"]])
        ode, alg = equations(states, z / ca.DM(self.z_unit), 0.0, own)
        dae = ca.Function(
            "dae", symbols, [ca.DM(self.x_unit) * ode / self.system.time, alg], self.names, ["ode", "alg"]
        )
        dae = dae.expand("dae")
        seen = ca.Function("outputs", [x, u, p], [self._outputs(states, ca.vertcat(u, p))], ["x", "u", "p"], ["y"])
        kept = ca.Function("invariants", [x, u, p], self._kept(states, ca.vertcat(u, p)), ["x", "u", "p"], KEPT)
        found = MotionFunctions(
            inputs=self.inputs,
            parameters=self.parameters,
            outputs=self.outputs,
            begin=self._begin(),
            sizes=sizes,
            parts=self._parts(),
            default=dict(zip(("u", "p"), np.split(self.system.arguments.defaults, [len(self.inputs)]), strict=True)),
            shapes={one.name: one.shape for one in self.system.results.results},
            dae=dae,
            outputs_of=seen.expand("outputs"),
            invariants=kept.expand("invariants"),
        )
        self._check(found)
        return found

    def _parts(self) -> dict[str, slice]:
        states = [slice(a, b) for a, b in zip(self.bounds, self.bounds[1:], strict=False)]
        n, lam = self.form.unknowns, self.system.system.layout.lam
        return dict(zip(("q", "y", "w", "near"), states, strict=True)) | {"a": slice(0, n), "lam": slice(n, n + lam)}

    def _split(self, states: ca.MX) -> list[ca.MX]:
        return list(ca.vertsplit(states, self.bounds))

    def _seen(self, states: ca.MX, numbers: ca.MX) -> list[ca.MX]:
        """Quantities with gaps, and their rates."""
        form = self.form
        q, y, w, unwrapped = self._split(states)
        spin, _ = form._curve(q, w, ca.MX.zeros(form.unknowns))
        still = ca.MX.zeros(numbers.shape)
        moved = slice(self.system.system.equations.rotation_unknowns, form.unknowns)
        at, rate = ca.vertcat(q, y, numbers), ca.vertcat(spin, w[moved], still)
        return list(form._seen(at, rate, ca.MX.zeros(at.shape), unwrapped))

    def _outputs(self, states: ca.MX, numbers: ca.MX) -> ca.MX:
        q, y, _, unwrapped = self._split(states)
        system = self.system
        full = self.form._full(q, numbers)
        lam, a = ca.MX.sym("lam", system.system.layout.lam), ca.MX.sym("a", system.quantities)
        rates = self._seen(states, numbers)[1][: system.quantities]
        found = system.outputs(ca.vertcat(ca.vec(full), y, lam, unwrapped), numbers, rates, a)
        # States have neither multipliers nor accelerations.
        unknown, first = ca.vertcat(lam, a), 0
        for one in system.results.results:
            if ca.depends_on(found[first : first + one.size], unknown):
                message = "found what constraints or inertia exert, which no state tells, accepted: positions,"
                raise SceneError(f"{message} velocities, energies, springs", ("outputs", one.name))
            first += one.size
        return ca.substitute([found], [unknown], [ca.MX.zeros(unknown.shape)])[0]

    def _kept(self, states: ca.MX, numbers: ca.MX) -> list[ca.MX]:
        """Gaps of the closings, their rates, and squared lengths of quaternions less one."""
        system, n = self.system, self.system.system.layout
        seen = self._seen(states, numbers)
        q = ca.reshape(self._split(states)[0], n.components, len(self.form.turning))
        norms = ca.sum1(q**2).T - 1.0 if system.model.space else ca.MX(0, 1)
        return [seen[0][n.x :], seen[1][n.x :], norms]

    def _begin(self) -> Array:
        begin = self.system.begin
        q = begin.state.q[self.form.turning].ravel()
        return (
            np.concatenate([q, begin.state.y, begin.rates[: self.form.unknowns], begin.state.unwrapped]) * self.x_unit
        )

    def _check(self, found: MotionFunctions) -> None:
        """Refuse what has no accelerations.

        Raises
        ------
        SceneError
            Something turns without inertia.
        """
        default = found.default
        if not found.sizes["z"]:
            return
        slopes = found.jacobians(found.begin, np.zeros(found.sizes["z"]), default["u"], default["p"])[4]
        scaled = np.array(slopes) * self.z_unit
        # Rows and columns of the size of one: what is small by its units alone is none the less there.
        for axis in (1, 0):
            scaled = scaled / np.maximum(np.abs(scaled).max(axis=axis, keepdims=True), TINY)
        sizes = np.linalg.svd(scaled, compute_uv=False)
        if sizes[-1] < tolerances.RANK * sizes[0]:
            what, accepted = "rotations without inertia", "rhoI of sections, or inertia at nodes"
            if self.system.model.element.strains:
                what, accepted = "stretch or shear, of which a part has no inertia", "sections without"
            message = f"found {what}, or closings that depend on each other, accepted: {accepted}"
            raise SceneError(f"{message}, in motion_functions")


KEPT = ["gaps", "rates", "norms"]
"""Results of the invariants."""
