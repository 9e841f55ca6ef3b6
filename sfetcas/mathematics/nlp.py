"""Nonlinear programs as plain records, and their solution by IPOPT or any other nlpsol plugin.

    minimise f(x, p)  over x,   lower <= g(x, p) <= upper,   x_lower <= x <= x_upper

This module is independent of mechanics.  Multipliers have the sign of CasADi: ``grad f + J^T lam = 0``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..errors import SolveError, Status
from .arrays import Array

__all__ = ["NLP", "Ipopt", "NLPResult", "Solver"]


@dataclass(frozen=True, eq=False)
class NLP:
    """A nonlinear program with named constraint rows; its methods return new programs with further terms and rows.

    Attributes
    ----------
    x, p, f, g : casadi.MX
        Unknowns (n, 1), parameters, objective, and constraint functions (m, 1).
    lower, upper : ndarray (m,)
        Bounds of the constraint functions.
    x_lower, x_upper, guess : ndarray (n,)
        Bounds of the unknowns, and the start.
    p_value : ndarray
        Values of the parameters.
    rows : tuple of str
        Names of the constraints.
    gradient, jacobian : casadi.MX
        Derivatives of f (n, 1) and g (m, n) by x.
    hessian : callable
        (lam_f, lam_g) -> Hessian of ``lam_f f + lam_g.g`` by x, full and symmetric.
    """

    x: ca.MX
    p: ca.MX
    f: ca.MX
    g: ca.MX
    lower: Array
    upper: Array
    x_lower: Array
    x_upper: Array
    guess: Array
    p_value: Array
    rows: tuple[str, ...]
    gradient: ca.MX
    jacobian: ca.MX
    hessian: Callable[[ca.MX, ca.MX], ca.MX]

    def __repr__(self) -> str:
        return f"NLP({self.x.numel()} unknowns, {self.g.numel()} constraint rows, {self.p.numel()} parameters)"

    def with_term(self, term: ca.MX) -> NLP:
        """The program with a term added to the objective, in its unit."""
        old = self.hessian

        def hessian(lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
            return old(lam_f, lam_g) + lam_f * ca.hessian(term, self.x)[0]

        gradient = self.gradient + ca.gradient(term, self.x)
        return replace(self, f=self.f + term, gradient=gradient, hessian=hessian)

    def with_row(self, name: str, row: ca.MX, lower: ArrayLike = 0.0, upper: ArrayLike | None = None) -> NLP:
        """The program with constraints ``lower <= row <= upper`` added; equal to ``lower`` without ``upper``."""
        row = ca.vec(row)
        size = row.numel()
        old, before = self.hessian, self.g.numel()

        def hessian(lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
            own = ca.hessian(ca.dot(lam_g[before:], row), self.x)[0]
            # An empty slice of a column is no column.
            return old(lam_f, lam_g[:before] if before else ca.MX(0, 1)) + own

        low = np.broadcast_to(np.asarray(lower, dtype=float), (size,))
        high = low if upper is None else np.broadcast_to(np.asarray(upper, dtype=float), (size,))
        return replace(
            self,
            g=ca.vertcat(self.g, row),
            lower=np.concatenate([self.lower, low]),
            upper=np.concatenate([self.upper, high]),
            rows=(*self.rows, *([name] if size == 1 else [f"{name}[{i}]" for i in range(size)])),
            jacobian=ca.vertcat(self.jacobian, ca.jacobian(row, self.x)),
            hessian=hessian,
        )


@dataclass(frozen=True, eq=False)
class NLPResult:
    """What a solver returned.

    Attributes
    ----------
    status : Status
        SOLVED, or why it is no solution.
    x, lam : ndarray (n,), (m,)
        Unknowns and multipliers of the constraints.
    f : float
        Objective.
    iterations : int
    message : str
        The return status in the words of the solver.
    """

    status: Status
    x: Array
    lam: Array
    f: float
    iterations: int
    message: str

    def __repr__(self) -> str:
        return f"NLPResult({self.status.value}, f={self.f:.9g}, {self.iterations} iterations, {self.message!r})"


@dataclass(frozen=True)
class Solver:
    """Any nlpsol plugin with its options.

    Attributes
    ----------
    plugin : str
        Name of the plugin: ipopt, sqpmethod, fatrop, ...
    options : mapping
        Options of nlpsol and of the plugin, as CasADi takes them.
    exact : bool
        Pass the derivatives of the :class:`NLP` to the plugin where it accepts them (IPOPT does); otherwise CasADi
        differentiates the expressions again.
    """

    plugin: str = "ipopt"
    options: Mapping[str, Any] = field(default_factory=dict)
    exact: bool = True

    def prepare(self, nlp: NLP) -> Callable[..., NLPResult]:
        """A function ``(p, guess, lam, lower, upper, within) -> NLPResult``; each argument defaults to its value in the
        program; ``within`` are the least and largest values of the unknowns.

        It raises SolveError where the plugin fails with an error instead of a result.
        """
        options = dict(self.options)
        if self.exact and self.plugin == "ipopt":
            options |= _derivatives(nlp)
        function = ca.nlpsol("nlp", self.plugin, {"x": nlp.x, "p": nlp.p, "f": nlp.f, "g": nlp.g}, options)
        # The function keeps numbers alone: it may be kept longer than the program.
        usual = {"x0": nlp.guess, "p": nlp.p_value, "lbx": nlp.x_lower, "ubx": nlp.x_upper}
        usual |= {"lbg": nlp.lower, "ubg": nlp.upper, "lam_g0": np.zeros(nlp.g.numel())}

        def solve(
            p: Array | None = None,
            guess: Array | None = None,
            lam: Array | None = None,
            lower: Array | None = None,
            upper: Array | None = None,
            within: tuple[Array, Array] | None = None,
        ) -> NLPResult:
            low, high = within or (None, None)
            given = {"x0": guess, "p": p, "lbx": low, "ubx": high, "lbg": lower, "ubg": upper, "lam_g0": lam}
            try:
                solution = function(**usual | {name: value for name, value in given.items() if value is not None})
            except RuntimeError as error:
                # What a plugin cannot cope with, CasADi says in many lines, the reason last.
                reason = str(error).strip().splitlines()[-1]
                raise SolveError(Status.FAILED, f"{self.plugin}: {reason}") from None
            stats = function.stats()
            if stats.get("return_status") == "NonIpopt_Exception_Thrown":
                # The one exception that reaches IPOPT from outside is Ctrl-C.
                raise KeyboardInterrupt
            return NLPResult(
                status=_status(stats),
                x=solution["x"].full().ravel(),
                lam=solution["lam_g"].full().ravel(),
                f=float(solution["f"]),
                iterations=int(stats.get("iter_count", 0)),
                message=str(stats.get("return_status", "")),
            )

        return solve

    def solve(self, nlp: NLP) -> NLPResult:
        """Solve the program as it stands."""
        return self.prepare(nlp)()


def _derivatives(nlp: NLP) -> dict[str, ca.Function]:
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.g.numel())
    return {
        "grad_f": ca.Function("nlp_grad_f", [nlp.x, nlp.p], [nlp.f, nlp.gradient]),
        "jac_g": ca.Function("nlp_jac_g", [nlp.x, nlp.p], [nlp.g, nlp.jacobian]),
        "hess_lag": ca.Function("nlp_hess_l", [nlp.x, nlp.p, lam_f, lam_g], [ca.triu(nlp.hessian(lam_f, lam_g))]),
    }


def _status(stats: Mapping[str, Any]) -> Status:
    if stats.get("success"):
        return Status.SOLVED
    message = str(stats.get("return_status", ""))
    for part, status in {
        "nfeasible": Status.INFEASIBLE,
        "Diverging": Status.UNBOUNDED,
        "Maximum_Iterations": Status.ITERATIONS,
    }.items():
        if part in message:
            return status
    return Status.FAILED


@dataclass(frozen=True)
class Ipopt:
    """IPOPT with options that suit equilibria.

    Attributes
    ----------
    tolerance : float
        IPOPT's ``tol``; equilibria are corrected by Newton's method afterwards.
    iterations : int
        IPOPT's ``max_iter``.
    objective_scale : float
        IPOPT's ``obj_scaling_factor``.
    verbose : bool
        Let IPOPT print.
    extra : mapping
        Further options of IPOPT by its own names, as ``{"mu_strategy": "adaptive"}``.
    """

    tolerance: float = 1e-9
    iterations: int = 500
    objective_scale: float = 1.0
    verbose: bool = False
    extra: Mapping[str, Any] = field(default_factory=dict)

    def prepare(self, nlp: NLP) -> Callable[..., NLPResult]:
        """A function ``(p, guess, lam, lower, upper, within) -> NLPResult``, as of :meth:`Solver.prepare`."""
        ipopt = {
            "tol": self.tolerance,
            "max_iter": self.iterations,
            "print_level": 5 if self.verbose else 0,
            "sb": "yes",
            # The problem is dimensionless; IPOPT's own scaling by first gradients would undo that.
            "nlp_scaling_method": "none",
            "obj_scaling_factor": self.objective_scale,
            **self.extra,
        }
        options = {
            "print_time": False,
            "calc_lam_p": False,
            "calc_lam_x": False,
            "error_on_fail": False,
            "no_nlp_grad": True,
            # What leaves the numbers on the way is in the status.
            "show_eval_warnings": self.verbose,
        }
        return Solver("ipopt", {**options, "ipopt": ipopt}).prepare(nlp)

    def solve(self, nlp: NLP) -> NLPResult:
        """Solve the program as it stands."""
        return self.prepare(nlp)()
