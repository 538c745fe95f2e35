"""The one door to CasADi: functions that take floats, NumPy arrays and CasADi expressions alike.

The physics is written once with these. Branches are arithmetic (`where`, `minimum`), roots and quotients are guarded
at their source, so that values and derivatives stay finite in hover and at zero inflow.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

__all__ = ["SX", "Function", "absolute", "clip", "column", "cos", "dense", "jacobian", "maximum", "minimum", "sin", "sqrt", "tan", "where"]

_SYMBOLIC = (casadi.SX, casadi.MX, casadi.DM)


def _symbolic(*values: Any) -> bool:
    return any(isinstance(v, _SYMBOLIC) for v in values)


def sin(x: Any) -> Any:
    """Sine, x in rad."""
    return casadi.sin(x) if _symbolic(x) else np.sin(x)


def cos(x: Any) -> Any:
    """Cosine, x in rad."""
    return casadi.cos(x) if _symbolic(x) else np.cos(x)


def tan(x: Any) -> Any:
    """Tangent, x in rad."""
    return casadi.tan(x) if _symbolic(x) else np.tan(x)


def sqrt(x: Any) -> Any:
    """Square root; the caller keeps x > 0 wherever a derivative is taken."""
    return casadi.sqrt(x) if _symbolic(x) else np.sqrt(x)


def absolute(x: Any) -> Any:
    """|x|; derivative sign(x), 0 at 0."""
    return casadi.fabs(x) if _symbolic(x) else np.abs(x)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, else `no`; both must be finite."""
    return casadi.if_else(condition, yes, no) if _symbolic(condition, yes, no) else np.where(condition, yes, no)


def minimum(a: Any, b: Any) -> Any:
    """Smaller of a and b; a tie takes a, in value and derivative."""
    return where(a <= b, a, b)


def maximum(a: Any, b: Any) -> Any:
    """Larger of a and b; a tie takes a, in value and derivative."""
    return where(a >= b, a, b)


def clip(x: Any, low: Any, high: Any, smoothing: float = 0.0) -> Any:
    """x limited to [low, high]; a tie takes x. `smoothing` > 0 (in the unit of x) rounds both corners by about that much."""
    if smoothing == 0.0:
        return minimum(maximum(x, low), high)

    def soft_maximum(a: Any, b: Any) -> Any:
        return 0.5 * (a + b + sqrt((a - b) ** 2 + smoothing**2))

    return -soft_maximum(-soft_maximum(x, low), -high)


def column(values: Any) -> Any:
    """Scalars stacked into one column expression."""
    return dense(casadi.vertcat(*values))


def jacobian(expression: Any, variable: Any) -> Any:
    """Dense Jacobian d expression/d variable (n, m) by algorithmic differentiation."""
    return casadi.densify(casadi.jacobian(expression, variable))


def dense(expression: Any) -> Any:
    """The expression with structural zeros written out."""
    return casadi.densify(casadi.SX(expression))
