"""All CasADi calls go through this module: functions of floats, NumPy arrays, CasADi and SymPy
expressions alike.

The physics is written once with these. Branches are arithmetic (`where`, `minimum`), roots and
quotients are guarded at their source, so that values and derivatives stay finite in hover and at
zero inflow.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

__all__ = [
    "SX",
    "Function",
    "absolute",
    "adjoint_product",
    "arcsin",
    "arctan2",
    "clip",
    "column",
    "cos",
    "dense",
    "exp",
    "jacobian",
    "maximum",
    "minimum",
    "replaced",
    "sin",
    "sqrt",
    "tan",
    "tangent_product",
    "where",
]

_SYMBOLIC = (casadi.SX, casadi.MX, casadi.DM)


def _library(*values: Any) -> Any:
    """The library whose expressions these are; SymPy is loaded by whoever made one."""
    if any(isinstance(v, _SYMBOLIC) for v in values):
        return casadi
    if any(hasattr(v, "free_symbols") for v in values):
        import sympy

        return sympy
    return np


def _is_sympy(library: Any) -> bool:
    return library.__name__ == "sympy"


def sin(x: Any) -> Any:
    """Sine, x in rad."""
    return _library(x).sin(x)


def cos(x: Any) -> Any:
    """Cosine, x in rad."""
    return _library(x).cos(x)


def tan(x: Any) -> Any:
    """Tangent, x in rad."""
    return _library(x).tan(x)


def arcsin(x: Any) -> Any:
    """Arc sine, rad."""
    library = _library(x)
    return library.asin(x) if _is_sympy(library) else library.arcsin(x)


def arctan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y), rad."""
    library = _library(y, x)
    return library.atan2(y, x) if _is_sympy(library) else library.arctan2(y, x)


def exp(x: Any) -> Any:
    """Exponential."""
    return _library(x).exp(x)


def sqrt(x: Any) -> Any:
    """Square root; the caller keeps x > 0 wherever a derivative is taken."""
    return _library(x).sqrt(x)


def absolute(x: Any) -> Any:
    """|x|; derivative sign(x), 0 at 0."""
    library = _library(x)
    return library.Abs(x, evaluate=False) if _is_sympy(library) else library.fabs(x)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, else `no`; both must be finite."""
    library = _library(condition, yes, no)
    if library is casadi:
        return casadi.if_else(condition, yes, no)
    return (
        np.where(condition, yes, no)
        if library is np
        else library.Piecewise((yes, condition), (no, True))
    )


def minimum(a: Any, b: Any) -> Any:
    """Smaller of a and b; a tie takes a, in value and derivative."""
    library = _library(a, b)
    return library.Min(a, b, evaluate=False) if _is_sympy(library) else where(a <= b, a, b)


def maximum(a: Any, b: Any) -> Any:
    """Larger of a and b; a tie takes a, in value and derivative."""
    library = _library(a, b)
    return library.Max(a, b, evaluate=False) if _is_sympy(library) else where(a >= b, a, b)


def clip(x: Any, low: Any, high: Any, smoothing: float = 0.0) -> Any:
    """x limited to [low, high]; a tie takes x. `smoothing` > 0 (in the unit of x) rounds both
    corners by about that much.
    """
    if smoothing == 0.0:
        return minimum(maximum(x, low), high)

    def soft_maximum(a: Any, b: Any) -> Any:
        return 0.5 * (a + b + sqrt((a - b) ** 2 + smoothing**2))

    return -soft_maximum(-soft_maximum(x, low), -high)


def column(values: Any) -> Any:
    """Scalars stacked into one column expression."""
    library = _library(*values)
    return library.Matrix(values) if _is_sympy(library) else dense(casadi.vertcat(*values))


def jacobian(expression: Any, variable: Any) -> Any:
    """Dense Jacobian d expression/d variable (n, m) by algorithmic differentiation."""
    return casadi.densify(casadi.jacobian(expression, variable))


def tangent_product(expression: Any, variables: list[Any], directions: list[Any]) -> Any:
    """Change of the expression (n,) when every variable moves along its direction, by forward
    differentiation, without Jacobians.
    """
    return dense(casadi.jtimes(expression, casadi.vertcat(*variables), casadi.vertcat(*directions)))


def adjoint_product(expression: Any, variable: Any, weights: Any) -> Any:
    """weights' (d expression/d variable), as a column (m,), by reverse differentiation."""
    return dense(casadi.jtimes(expression, variable, weights, True))


def replaced(expressions: list[Any], symbol: Any, value: Any) -> list[Any]:
    """The expressions with `value` in place of `symbol`."""
    return list(casadi.substitute(expressions, [symbol], [value]))


def dense(expression: Any) -> Any:
    """The expression with structural zeros written out."""
    return casadi.densify(casadi.SX(expression))


def unnamed(symbol: str, value: Any) -> Any:
    """The value itself."""
    return value
