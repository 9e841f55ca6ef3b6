"""Arrays that carry a CasADi expression with their values: active variables of automatic differentiation.

Code that is written for NumPy accepts them as arrays: universal functions and most functions that reshape, join and sum
arrays work on them (NEP 13 and NEP 18).  Decisions (comparisons, signs, roundings, largest entries) use the values, so
that an expression is valid as long as the decisions are.  Operations that would lose the dependence on parameters, as
assigning an active number to an array of plain floats, raise TypeError or ValueError.

Source: Griewank and Walther 2008, Evaluating Derivatives, chapter 6 (operator overloading).
"""

from __future__ import annotations

import string
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from .arrays import Array, values_of

__all__ = ["Active", "applied", "gathered"]


class Active(NDArrayOperatorsMixin):
    """An array of numbers that depend on symbols.

    Parameters
    ----------
    values : ndarray (...)
        The numbers at the values of the symbols; in any unit.
    expression : SX (size, 1)
        The numbers as expressions, in the order of ``values.ravel()``.
    """

    __slots__ = ("expression", "values")
    __array_priority__ = 100.0

    def __init__(self, values: Any, expression: ca.SX) -> None:
        self.values = np.array(values, dtype=float)
        self.expression = expression

    @classmethod
    def of(cls, value: Any) -> Active:
        """An array of numbers, active or not, as an active one; nested lists may mix both."""
        if isinstance(value, Active):
            return value
        if isinstance(value, np.ndarray) and value.dtype == object:
            value = value.tolist()
        nested = (list, tuple, Active, np.ndarray)
        if isinstance(value, (list, tuple)) and any(isinstance(each, nested) for each in value):
            return _stack([cls.of(each) for each in value])
        values = np.asarray(value, dtype=float)
        return cls(values, ca.SX(ca.DM(values.ravel())))

    # -- as an array ----------------------------------------------------------------------------------

    @property
    def shape(self) -> tuple[int, ...]:
        """As :attr:`numpy.ndarray.shape`."""
        return self.values.shape

    @property
    def ndim(self) -> int:
        """As :attr:`numpy.ndarray.ndim`."""
        return self.values.ndim

    @property
    def size(self) -> int:
        """As :attr:`numpy.ndarray.size`."""
        return self.values.size

    @property
    def dtype(self) -> Any:
        """The type of the values."""
        return self.values.dtype

    @property
    def T(self) -> Active:  # noqa: N802
        """The transposed array."""
        return self.transpose()

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Active]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"Active({self.values!r})"

    def __float__(self) -> float:
        raise TypeError("a number that depends on parameters is needed as a plain float")

    __int__ = __index__ = __complex__ = __float__

    def __bool__(self) -> bool:
        return bool(self.values)

    def __format__(self, spec: str) -> str:
        return format(float(self.values), spec)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "reduce" and ufunc in (np.add, np.maximum, np.minimum, np.logical_or, np.logical_and):
            return _REDUCED[ufunc](inputs[0], **{"axis": 0, **options})
        if method == "outer" and ufunc is np.multiply:
            return np.outer(*inputs)
        if method != "__call__":
            return NotImplemented
        if options.get("out") is not None:
            (out,) = options["out"]
            out[...] = ufunc(*inputs)
            return out
        if ufunc is np.matmul:
            return _matmul(*inputs)
        if ufunc in _ELEMENTWISE:
            return _elementwise(ufunc, *inputs)
        if ufunc in _DECIDING:
            return ufunc(*(values_of(each) for each in inputs))
        return NotImplemented

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if function in _FUNCTIONS:
            return _FUNCTIONS[function](*args, **kwargs)
        if function in _MOVING:
            return _moved(function, args, kwargs)
        if function in _DECIDED:
            return function(*(values_of(each) for each in args), **kwargs)
        return NotImplemented

    # -- entries --------------------------------------------------------------------------------------

    @property
    def places(self) -> Array:
        """Indices of the entries in the expression, in the shape of the array."""
        return np.arange(self.size).reshape(self.shape)

    def picked(self, places: Array) -> Active:
        """Entries by their indices in the expression, in the shape of ``places``."""
        places = np.asarray(places)
        return Active(self.values.ravel()[places], self.expression[places.ravel().tolist(), 0])

    def spread(self, shape: tuple[int, ...]) -> ca.SX:
        """The expression of the array broadcast to a shape."""
        if shape == self.shape:
            return self.expression
        return self.expression[np.broadcast_to(self.places, shape).ravel().tolist(), 0]

    def __getitem__(self, key: Any) -> Active:
        return self.picked(self.places[key])

    def __setitem__(self, key: Any, value: Any) -> None:
        value, places = Active.of(value), self.places[key]
        self.values[key] = value.values
        self.expression[places.ravel().tolist(), 0] = value.spread(places.shape)

    # -- methods of arrays ----------------------------------------------------------------------------

    def reshape(self, *shape: Any) -> Active:
        """As :meth:`numpy.ndarray.reshape`."""
        return Active(self.values.reshape(*shape), self.expression)

    def ravel(self) -> Active:
        """As :meth:`numpy.ndarray.ravel`."""
        return self.reshape(-1)

    def copy(self) -> Active:
        """As :meth:`numpy.ndarray.copy`."""
        return Active(self.values, ca.SX(self.expression))

    def transpose(self, *axes: Any) -> Active:
        """As :meth:`numpy.ndarray.transpose`."""
        return self.picked(self.places.transpose(*axes))

    def sum(self, axis: Any = None, keepdims: bool = False) -> Active:
        """As :meth:`numpy.ndarray.sum`."""
        return _sum(self, axis, keepdims)

    def mean(self, axis: Any = None, keepdims: bool = False) -> Active:
        """As :meth:`numpy.ndarray.mean`."""
        total = _sum(self, axis, keepdims)
        return total * (total.size / self.size)

    def max(self, axis: Any = None, initial: float = -np.inf) -> Active:
        """As :meth:`numpy.ndarray.max`: the entry whose value is largest."""
        return _extreme(self, np.argmax, axis, initial)

    def min(self, axis: Any = None, initial: float = np.inf) -> Active:
        """As :meth:`numpy.ndarray.min`: the entry whose value is smallest."""
        return _extreme(self, np.argmin, axis, initial)

    def any(self, axis: Any = None) -> Any:
        """Whether any value is not zero."""
        return self.values.any(axis=axis)

    def all(self, axis: Any = None) -> Any:
        """Whether no value is zero."""
        return self.values.all(axis=axis)

    def tolist(self) -> Any:
        """The entries as active scalars, in nested lists."""
        return [each.tolist() for each in self] if self.ndim else self


def applied(matrix: ca.DM, vector: Any) -> Any:
    """A constant sparse matrix times a vector (n,), active or not."""
    found: Any = np.array(ca.mtimes(matrix, ca.DM(values_of(vector)))).ravel()
    return Active(found, ca.densify(ca.mtimes(matrix, vector.expression))) if isinstance(vector, Active) else found


def gathered(parts: Sequence[Any]) -> Active:
    """Arrays flattened and concatenated into one active array (n,)."""
    every = [Active.of(part) for part in parts]
    values = np.concatenate([np.zeros(0), *(each.values.ravel() for each in every)])
    return Active(values, ca.vertcat(ca.SX(0, 1), *(each.expression for each in every)))


# -- what works entry by entry ----------------------------------------------------------------------------

_ELEMENTWISE: dict[Any, Callable[..., Any]] = {
    np.add: lambda a, b: a + b,
    np.subtract: lambda a, b: a - b,
    np.multiply: lambda a, b: a * b,
    np.divide: lambda a, b: a / b,
    np.power: lambda a, b: a**b,
    np.negative: lambda a: -a,
    np.positive: lambda a: a,
    np.absolute: ca.fabs,
    np.fabs: ca.fabs,
    np.square: lambda a: a * a,
    np.sqrt: ca.sqrt,
    np.exp: ca.exp,
    np.log: ca.log,
    np.sin: ca.sin,
    np.cos: ca.cos,
    np.tan: ca.tan,
    np.arcsin: ca.asin,
    np.arccos: ca.acos,
    np.arctan: ca.atan,
    np.arctan2: ca.atan2,
    np.sinh: ca.sinh,
    np.cosh: ca.cosh,
    np.tanh: ca.tanh,
    np.maximum: ca.fmax,
    np.minimum: ca.fmin,
    np.hypot: lambda a, b: ca.sqrt(a * a + b * b),
    np.conjugate: lambda a: a,
}

_DECIDING = {
    np.less,
    np.less_equal,
    np.greater,
    np.greater_equal,
    np.equal,
    np.not_equal,
    np.isfinite,
    np.isnan,
    np.isinf,
    np.sign,
    np.floor,
    np.ceil,
    np.rint,
    np.logical_and,
    np.logical_or,
    np.logical_not,
}
"""What goes by values, as its derivative is zero or it is no number."""


def _elementwise(ufunc: Any, *inputs: Any) -> Active:
    every = [Active.of(each) for each in inputs]
    values = ufunc(*(each.values for each in every))
    return Active(values, _ELEMENTWISE[ufunc](*(each.spread(values.shape) for each in every)))


# -- sums and products ------------------------------------------------------------------------------------


def _sum(a: Any, axis: Any = None, keepdims: bool = False, **_: Any) -> Active:
    a = Active.of(a)
    axes = tuple(range(a.ndim)) if axis is None else tuple(np.atleast_1d(axis) % a.ndim)
    kept = [i for i in range(a.ndim) if i not in axes]
    shape = tuple(1 if i in axes else n for i, n in enumerate(a.shape) if keepdims or i not in axes)
    count = int(np.prod([a.shape[i] for i in axes]))
    flat = a.expression[a.places.transpose(*kept, *axes).ravel().tolist(), 0] if a.ndim else a.expression
    total = ca.sum1(ca.reshape(flat, count, -1)).T if a.size else ca.SX.zeros(int(np.prod(shape)))
    return Active(a.values.sum(axis=axes, keepdims=keepdims), total)


def _extreme(a: Any, which: Any, axis: Any, initial: float = np.nan) -> Active:
    a = Active.of(a)
    if not a.size:
        return Active.of(initial)
    if axis is None:
        return a.ravel()[int(which(a.values))]
    chosen = np.expand_dims(which(a.values, axis=axis), axis)
    return a.picked(np.take_along_axis(a.places, chosen, axis).squeeze(axis))


def _matmul(a: Any, b: Any) -> Any:
    a, b = Active.of(a), Active.of(b)
    row, column = a.ndim == 1, b.ndim == 1
    a, b = a[None, :] if row else a, b[:, None] if column else b
    if a.ndim == b.ndim == 2:
        one, other = (ca.reshape(each.expression, *each.shape[::-1]).T for each in (a, b))
        found = Active(a.values @ b.values, ca.vec(ca.mtimes(one, other).T))
    else:
        found = _sum(a[..., :, :, None] * b[..., None, :, :], axis=-2)
    found = found[..., 0] if column else found
    return found[..., 0, :] if row and not column else found[..., 0] if row else found


def _einsum(subscripts: str, *operands: Any, **options: Any) -> Active:
    """The sum of products of all entries that belong together."""
    inputs, _, output = subscripts.replace(" ", "").partition("->")
    every = [Active.of(each) for each in operands]
    letters = iter(sorted(set(string.ascii_letters) - set(subscripts)))
    names, most = inputs.split(","), 0
    for name, each in zip(names, every, strict=True):
        most = max(most, each.ndim - len(name) + 3) if "..." in name else most
    free = "".join(next(letters) for _ in range(most))
    names = [
        name.replace("...", free[most - (each.ndim - len(name) + 3) :]) if "..." in name else name
        for name, each in zip(names, every, strict=True)
    ]
    output = output.replace("...", free)
    order = output + "".join(sorted({letter for name in names for letter in name} - set(output)))
    total: Any = 1.0
    for name, each in zip(names, every, strict=True):
        axes = [name.index(letter) for letter in order if letter in name]
        lengths = {name[i]: each.shape[i] for i in axes}
        total = total * each.transpose(*axes).reshape([lengths.get(letter, 1) for letter in order])
    return _sum(total, axis=tuple(range(len(output), len(order)))) if len(order) > len(output) else total


def _outer(a: Any, b: Any) -> Any:
    return Active.of(a).ravel()[:, None] * Active.of(b).ravel()[None, :]


def _cross(a: Any, b: Any) -> Any:
    a, b = Active.of(a), Active.of(b)
    shape = np.broadcast_shapes(a.shape, b.shape)
    x, y = ([each[..., i] for i in range(3)] for each in (a, b))
    parts = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    return _stack(parts, axis=len(shape) - 1)


def _norm(a: Any, axis: Any = None, keepdims: bool = False) -> Any:
    return np.sqrt(_sum(Active.of(a) ** 2, axis, keepdims))


def _cumsum(a: Any, axis: int = 0) -> Any:
    rows = list(_moved(np.moveaxis, (a, axis, 0), {}))
    for i in range(1, len(rows)):
        rows[i] = rows[i - 1] + rows[i]
    return _stack(rows, axis=axis % Active.of(a).ndim) if rows else Active.of(a)


def _diff(a: Any, axis: int = -1) -> Any:
    a = _moved(np.moveaxis, (a, axis, 0), {})
    return _moved(np.moveaxis, (a[1:] - a[:-1], 0, axis), {})


def _inv(a: Any) -> Active:
    a = Active.of(a)
    n = a.shape[-1]
    square = ca.reshape(a.expression, n, n).T
    return Active(np.linalg.inv(a.values), ca.vec(ca.solve(square, ca.SX.eye(n)).T))


def _interp(x: Any, at: Any, values: Any) -> Any:
    """Linear between places; which ones goes by the values."""
    x, at, values = Active.of(x), Active.of(at), Active.of(values)
    piece = np.clip(np.searchsorted(at.values, x.values, side="right") - 1, 0, len(at) - 2)
    share = np.minimum(np.maximum((x - at[piece]) / (at[piece + 1] - at[piece]), 0.0), 1.0)
    return values[piece] * (1.0 - share) + values[piece + 1] * share


def _where(condition: Any, *both: Any) -> Any:
    condition = np.asarray(values_of(condition), dtype=bool)
    if not both:
        return np.where(condition)
    one, other = (Active.of(each) for each in both)
    shape = np.broadcast_shapes(condition.shape, one.shape, other.shape)
    together = gathered([one, other])
    chosen = np.where(condition, np.broadcast_to(one.places, shape), one.size + np.broadcast_to(other.places, shape))
    return together.picked(chosen)


def _sinc(a: Any) -> Any:
    """sin(pi a) / (pi a); near zero by its series, which has all digits there."""
    x = np.pi * Active.of(a)
    small = np.abs(x.values) < 1e-3
    safe = _where(small, 1.0, x)
    return _where(small, 1.0 - x**2 / 6.0 + x**4 / 120.0, np.sin(safe) / safe)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.sum: _sum,
    np.mean: lambda a, axis=None, keepdims=False: Active.of(a).mean(axis, keepdims),
    np.max: lambda a, axis=None, **_: _extreme(a, np.argmax, axis),
    np.min: lambda a, axis=None, **_: _extreme(a, np.argmin, axis),
    np.nanmax: lambda a, axis=None, **_: _extreme(a, np.nanargmax, axis),
    np.einsum: _einsum,
    np.dot: _matmul,
    np.outer: _outer,
    np.cross: _cross,
    np.linalg.norm: _norm,
    np.linalg.inv: _inv,
    np.cumsum: _cumsum,
    np.diff: _diff,
    np.interp: _interp,
    np.where: _where,
    np.sinc: _sinc,
    np.trace: lambda a: _sum(Active.of(a)[np.arange(len(a)), np.arange(len(a))]),
    np.kron: lambda a, b: (Active.of(a)[:, None, :, None] * Active.of(b)[None, :, None, :]).reshape(
        a.shape[0] * b.shape[0], a.shape[1] * b.shape[1]
    ),
    np.zeros_like: lambda a, **_: Active.of(np.zeros(a.shape)),
    np.ones_like: lambda a, **_: Active.of(np.ones(a.shape)),
    np.copy: lambda a: a.copy(),
    np.nan_to_num: lambda a: _where(np.isnan(a.values), 0.0, a),
    np.clip: lambda a, low, high: np.minimum(np.maximum(a, low), high),
    np.ptp: lambda a, axis=None: _extreme(a, np.argmax, axis) - _extreme(a, np.argmin, axis),
    np.append: lambda a, b: np.concatenate([Active.of(a).ravel(), Active.of(b).ravel()]),
}

_DECIDED = {
    np.argmax,
    np.argmin,
    np.nonzero,
    np.flatnonzero,
    np.searchsorted,
    np.argsort,
    np.any,
    np.all,
    np.isclose,
    np.allclose,
    np.array_equal,
    np.round,
    np.ndim,
    np.shape,
    np.size,
    np.unique,
    np.count_nonzero,
}
"""What goes by values, and what is asked of the shape."""

_REDUCED: dict[Any, Callable[..., Any]] = {
    np.add: _sum,
    np.maximum: lambda a, axis=0, **_: _extreme(a, np.argmax, axis),
    np.minimum: lambda a, axis=0, **_: _extreme(a, np.argmin, axis),
    np.logical_or: lambda a, axis=0, **_: np.any(values_of(a), axis=axis),
    np.logical_and: lambda a, axis=0, **_: np.all(values_of(a), axis=axis),
}


# -- what only moves entries --------------------------------------------------------------------------------

_MOVING = {
    np.concatenate,
    np.vstack,
    np.hstack,
    np.column_stack,
    np.stack,
    np.reshape,
    np.ravel,
    np.transpose,
    np.moveaxis,
    np.swapaxes,
    np.tile,
    np.repeat,
    np.broadcast_to,
    np.expand_dims,
    np.squeeze,
    np.take,
    np.roll,
    np.flip,
    np.atleast_1d,
    np.atleast_2d,
    np.diag,
}


def _moved(function: Any, args: Any, kwargs: Any) -> Any:
    """A function that only moves entries: done on their places instead."""
    joined = function in (np.concatenate, np.vstack, np.hstack, np.column_stack, np.stack)
    parts = [Active.of(each) for each in args[0]] if joined else [Active.of(args[0])]
    # Zero is the place of what a function adds, as the diagonal matrix of a vector.
    together, start, places = gathered([0.0, *parts]), 1, []
    for part in parts:
        places.append(start + part.places)
        start += part.size
    return together.picked(function(places if joined else places[0], *args[1:], **kwargs))


def _stack(parts: Sequence[Any], axis: int = 0) -> Active:
    shape = np.broadcast_shapes(*(part.shape for part in parts))
    spread = [part if part.shape == shape else np.broadcast_to(part, shape) for part in parts]
    found: Active = _moved(np.stack, (spread,), {"axis": axis})
    return found
