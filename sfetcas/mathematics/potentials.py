"""Potentials of three curvatures from which the moments of a section follow, as dimensionless CasADi expressions.

With ``x`` the changes of twist and of the curvatures about b2 and b3 over a unit of curvature, a *form* gives the
deviation of the potential from its quadratic part at rest,

    d(x) = w(x) - 1/2 x.H x,      H the second derivative of w at x = 0,

over a unit of energy per length.  Forms of one bending axis are functions ``w(a)`` of one curvature: of that about b2
or b3, or of the magnitude of both together, which is meant for sections that are round.

Where a form depends on strains, too, these follow the curvatures in ``x``, over the unit of curvature, so that they are
lengths in m; what is left out is then the quadratic part without that which couples curvatures with strains, or strains
with each other.

Sources: Ramberg and Osgood 1943 (NACA TN 902); Audoly and Neukirch 2021 (doi 10.1016/j.jmps.2021.104457) for ribbons,
whose transverse profile is solved anew in the theory of the documentation.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import casadi as ca

from .arrays import Array, depends, numbers, values_of
from .forms import BOTH, Form
from .hysteresis import energies

__all__ = ["at_rest", "derivatives_of", "deviation", "function_of", "parameters_of", "text_of"]

TINY = 1e-10
"""Added to a magnitude in its square, so that even potentials are smooth at rest; below what rounding leaves of it."""

STEPS = 12
"""Newton steps from above to the moment of Ramberg and Osgood: quadratic once the power has fallen to one."""


def deviation(form: Form, x: ca.SX, p: ca.SX) -> ca.SX:
    """The deviation of a form from the quadratic potential at curvatures and strains x, with numbers p (size,).

    With memory that is the sum of what is stored and of what is dissipated since the last step.
    """
    if form.remembers:
        return ca.SX(sum(energies(form, x, p)))
    if form.name == "ribbon":
        return _ribbon(x[0], x[form.about - 1], p[0])
    if form.name == "sadowsky":
        return _sadowsky(x[0], x[form.about - 1])
    if form.name == "given":
        function = function_of(form.given)
        own = x if function.numel_in(0) == x.numel() else x[form.about - 1]
        return _beyond_quadratic(function, own, p, form.strains)
    if form.name == "curve":
        return _curve(form, x, p)
    square = ca.sumsqr(x[1:]) if form.about == BOTH else x[form.about - 1] ** 2
    if form.name == "table" and not form.odd:
        return _table(x[form.about - 1], p, form.count)
    a = ca.sqrt(square + TINY**2)
    return _table(a, p, form.count) if form.name == "table" else _FORMS[form.name](a, p)


@functools.cache
def derivatives_of(form: Form) -> ca.Function:
    """``(x, p) ->`` deviation, its gradient (n,) and second derivatives (n, n), n curvatures and strains."""
    x, p = ca.SX.sym("x", form.arguments), ca.SX.sym("p", form.size)
    value = deviation(form, x, p)
    hessian, gradient = ca.hessian(value, x)
    results = [ca.densify(part) for part in (value, gradient, hessian)]
    return ca.Function(f"law_{form}", [x, p], results, ["x", "p"], ["value", "gradient", "hessian"], {"cse": True})


# -- forms of one axis -----------------------------------------------------------------------------------


def _bilinear(a: ca.SX, p: ca.SX) -> ca.SX:
    """Slope 1 up to 1, then p."""
    return -0.5 * (1.0 - p[0]) * ca.fmax(a - 1.0, 0.0) ** 2


def _plateau(a: ca.SX, p: ca.SX) -> ca.SX:
    """Slope 1 up to 1, then the moment 3/2 (1 - 1/(3 a^2)) of a rectangle whose outer fibres have constant stress."""
    b = ca.fmax(a, 1.0)
    return 0.5 + 1.5 * (b - 1.0) + 0.5 * (1.0 / b - 1.0) - 0.5 * b**2


def _ramberg_osgood(a: ca.SX, p: ca.SX) -> ca.SX:
    """``a = m + alpha m^n``: the potential is ``a m`` less the complementary energy, whose slope by m is zero."""
    alpha, n = p[0], p[1]
    m = ca.fmin(a, (a / alpha) ** (1.0 / n))
    for _ in range(STEPS):
        m -= (m + alpha * m**n - a) / (1.0 + alpha * n * m ** (n - 1.0))
    return a * m - 0.5 * m**2 - alpha * m ** (n + 1.0) / (n + 1.0) - 0.5 * a**2


_FORMS: dict[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "bilinear": _bilinear,
    "plateau": _plateau,
    "ramberg_osgood": _ramberg_osgood,
}


# -- tables ----------------------------------------------------------------------------------------------


def _table(a: ca.SX, p: ca.SX, count: int) -> ca.SX:
    """Integral of the cubics through the knots, which go on with the slopes at the ends, less its quadratic part."""
    x, m, d = (ca.vertsplit(p[i * count : (i + 1) * count]) for i in range(3))
    # Coefficients of the potential from a knot on: reference, potential, then of s, s^2, s^3, s^4.
    pieces, potential = [], ca.SX(0)
    for i in range(count - 1):
        h, rise = x[i + 1] - x[i], m[i + 1] - m[i]
        third = (3.0 * rise - h * (2.0 * d[i] + d[i + 1])) / h**2 / 3.0
        fourth = (h * (d[i] + d[i + 1]) - 2.0 * rise) / h**3 / 4.0
        pieces.append((x[i], potential, m[i], 0.5 * d[i], third, fourth))
        potential += h * (m[i] + 0.5 * d[i] * h + third * h**2 + fourth * h**3)
    pieces.append((x[-1], potential, m[-1], 0.5 * d[-1], ca.SX(0), ca.SX(0)))
    first = (x[0], ca.SX(0), m[0], 0.5 * d[0], ca.SX(0), ca.SX(0))

    def at(a: ca.SX) -> tuple[ca.SX, ca.SX]:
        chosen = list(first)
        for piece in pieces:
            chosen = [ca.if_else(a >= piece[0], new, old) for new, old in zip(piece, chosen, strict=True)]
        s = a - chosen[0]
        value = chosen[1] + s * (chosen[2] + s * (chosen[3] + s * (chosen[4] + s * chosen[5])))
        return value, 2.0 * (chosen[3] + s * (3.0 * chosen[4] + s * 6.0 * chosen[5]))

    at_rest, slope = at(ca.SX(0))
    return at(a)[0] - at_rest - 0.5 * slope * a**2


# -- curves of a material over a section that stretches ----------------------------------------------------


def _curve(form: Form, x: ca.SX, p: ca.SX) -> ca.SX:
    """What fibres store whose stress is linear between kinks, integrated over a rectangle, a circle or a tube.

    Each kink changes the slope of the stress, so that the fibres beyond it store half the change times the square of
    the strain beyond.  Numbers: reach of the section, inner over outer radius; strains of the kinks, changes of the
    slope.  Strains are over one unit, so are curvatures times the reach; energy over that of the second moment.
    """
    n, strain = form.count, x[3] / p[0]
    square = ca.sumsqr(x[1:3]) if form.about == BOTH else x[form.about - 1] ** 2
    total = ca.SX(0)
    for kink, change in zip(ca.vertsplit(p[2 : 2 + n]), ca.vertsplit(p[2 + n :]), strict=True):
        middle = ca.sign(kink) * strain - ca.fabs(kink)
        if form.about == BOTH:
            beyond = _beyond_in_circle(middle, square) - p[1] ** 2 * _beyond_in_circle(middle, p[1] ** 2 * square)
        else:
            beyond = _beyond_in_rectangle(middle, square)
        total += 0.5 * change * beyond
    return total / (math.pi / 4.0 * (1.0 - p[1] ** 4) if form.about == BOTH else 2.0 / 3.0)


def _beyond_in_rectangle(middle: ca.SX, square: ca.SX) -> ca.SX:
    """Integral over y in [-1, 1] of the square of ``middle + k y`` where it is positive, from the square of k."""
    k = ca.sqrt(square + TINY**2)
    part = ca.if_else(middle > -k, (middle + k) ** 3 / (3.0 * k), 0.0)
    return ca.if_else(middle >= k, 2.0 * middle**2 + 2.0 / 3.0 * square, part)


def _beyond_in_circle(middle: ca.SX, square: ca.SX) -> ca.SX:
    """The same over the circle of radius 1: with the angle a from the top down to where the integrand begins."""
    k = ca.sqrt(square + TINY**2)
    t = -middle / k
    a = ca.acos(ca.fmax(ca.fmin(t, 1.0 - EDGE), EDGE - 1.0))
    s, c = ca.sin(a), ca.cos(a)
    part = 0.25 * (a + s * c * (1.0 - 2.0 * c**2)) - 4.0 / 3.0 * c * s**3 + c**2 * (a - s * c)
    part = ca.if_else(t < 1.0 - EDGE, (square + TINY**2) * part, 0.0)
    return ca.if_else(t <= EDGE - 1.0, math.pi * (middle**2 + 0.25 * square), part)


EDGE = 1e-6
"""Share of the radius at the edge of a circle beyond which nothing is taken to be: slopes change by 1e-9 there."""


# -- ribbons ---------------------------------------------------------------------------------------------


@functools.cache
def _profile_series() -> list[float]:
    """Coefficients of phi(v) / v in powers of v = lambda^4, see :func:`_ribbon`; terms fall like 1/125."""
    count = 10
    upper = [Fraction(2, math.factorial(4 * k + 2)) for k in range(count + 1)]
    lower = [Fraction(1, math.factorial(4 * k + 1)) for k in range(count + 1)]
    ratio: list[Fraction] = []
    for k in range(count + 1):
        ratio.append(upper[k] - sum((ratio[j] * lower[k - j] for j in range(k)), Fraction(0)))
    return [float(-term) for term in ratio[1:]]


def _ribbon(twist: ca.SX, bending: ca.SX, poisson: ca.SX) -> ca.SX:
    """What the stretching of a ribbon adds to plate bending with free edges, over ``D width kappa_0^2``.

    Curvatures are over ``kappa_0 = thickness / width^2``.  With the Gaussian curvature ``S = nu k^2 + t^2`` that an
    unstrained profile would have, the profile across is that of a beam on an elastic foundation, and

        1/2 (S / k)^2 phi(lambda),     phi = 1 - 2/lambda (cosh lambda - cos lambda) / (sinh lambda + sin lambda),

    with ``lambda^4 = 3 (1 - nu^2) k^2``.
    """
    share = 3.0 * (1.0 - poisson**2)
    v = share * bending**2
    low, far = ca.fmin(v, 1.0), ca.sqrt(ca.sqrt(ca.fmax(v, 1.0)))
    series = ca.SX(0)
    for coefficient in reversed(_profile_series()):
        series = series * low + coefficient
    decay = ca.exp(-far)
    slope = (1.0 + decay**2 - 2.0 * decay * ca.cos(far)) / (1.0 - decay**2 + 2.0 * decay * ca.sin(far))
    closed = (1.0 - 2.0 / far * slope) / far**4
    gaussian = poisson * bending**2 + twist**2
    return 0.5 * gaussian**2 * share * ca.if_else(v < 1.0, series, closed)


def _sadowsky(twist: ca.SX, bending: ca.SX) -> ca.SX:
    """What the energy of Sadowsky, made convex, is more than ``1/2 k^2 + t^2``; all over the plate stiffness.

    With ``b^2 = k^2 + 1`` it is ``1/2 t^4 / b^2`` up to ``|t| = b``, and beyond it the same slopes go on.

    Source: Freddi, Hornung, Mora and Paroni, Journal of Elasticity 123 (2016).
    """
    square, bent = twist**2, bending**2 + 1.0
    low = ca.fmin(square, bent)
    return 0.5 * (low**2 / bent + 2.0 * (square - low))


# -- given functions -------------------------------------------------------------------------------------


@functools.cache
def function_of(text: str) -> ca.Function:
    """The function that CasADi has written into a text."""
    return ca.Function.deserialize(text)


def text_of(value: Any, size: int = 3) -> str:
    """A function of CasADi, one of Python that makes an expression, or a text with one, as a text.

    It takes ``size`` numbers, three curvatures and what strains follow them, or one strain, and a list of parameters
    where it takes two arguments, and gives one number.

    Raises
    ------
    ValueError
        Anything else; with what was found where that says more than the value itself, else with an empty text.
    """
    function = value
    if isinstance(value, str):
        try:
            function = ca.Function.deserialize(value)
        except RuntimeError:
            raise ValueError("") from None
    elif callable(value) and not isinstance(value, ca.Function):
        k, p = ca.SX.sym("k", size), ca.SX.sym("p", MOST_PARAMETERS)
        given = [k, p] if getattr(getattr(value, "__code__", None), "co_argcount", 1) == 2 else [k]
        try:
            function = ca.Function("potential", given, [ca.SX(value(*given))])
        except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
            raise ValueError(f"a function that fails with {str(error).splitlines()[0]!r}") from None
    sized = isinstance(function, ca.Function) and function.n_in() in (1, 2) and function.n_out() == 1
    if not sized or function.numel_in(0) != size or function.numel_out(0) != 1:
        raise ValueError("")
    return str(function.serialize())


MOST_PARAMETERS = 16
"""Parameters that a function of Python may take; those that it does not use are zero."""


def parameters_of(text: str) -> int:
    """How many parameters a given function takes."""
    function = function_of(text)
    return int(function.numel_in(1)) if function.n_in() == 2 else 0


def at_rest(text: str, p: Array) -> tuple[Array, Array]:
    """Gradient (3,), N m, and second derivatives (3, 3), N m2, of a given potential at rest, with parameters p (n,).

    Of one strain (1,) and (1, 1), N; of curvatures and strains of both.
    """
    rest = _at_rest(text)
    gradient, hessian = (part.full() for part in rest(values_of(p)))
    if depends(p):
        active: Any = p
        return gradient.ravel(), numbers(type(active)(hessian, ca.vec(rest(active.expression)[1].T)))
    return gradient.ravel(), hessian


@functools.cache
def _at_rest(text: str) -> ca.Function:
    function = function_of(text)
    k, p = ca.SX.sym("k", function.numel_in(0)), ca.SX.sym("p", parameters_of(text))
    hessian, gradient = ca.hessian(function(*[k, p][: function.n_in()]), k)
    found = [ca.densify(ca.substitute(part, k, ca.SX.zeros(k.numel()))) for part in (gradient, hessian)]
    return ca.Function("at_rest", [p], found)


def _beyond_quadratic(function: ca.Function, x: ca.SX, p: ca.SX, strains: int = 0) -> ca.SX:
    """A given potential less its value and its quadratic part at rest.

    Of the latter what couples strains, the last ones, with others is kept.
    """
    at = ca.SX.sym("at", x.numel())
    value = function(at, p) if function.n_in() == 2 else function(at)
    hessian = ca.hessian(value, at)[0]
    rest = [ca.substitute(part, at, ca.SX.zeros(x.numel())) for part in (value, hessian)]
    left_out = ca.diagcat(ca.SX.ones(x.numel() - strains, x.numel() - strains), *[1.0] * strains)
    return ca.substitute(value, at, x) - rest[0] - 0.5 * ca.dot(x, ca.mtimes(rest[1] * left_out, x))
