"""CasADi's operations on mpmath numbers and on SymPy expressions."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import casadi
import mpmath
import numpy as np
import sympy
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from symheli.values.tape import Arithmetic

# --- numbers with many digits --------------------------------------------------------------------


def _divide(a: Any, b: Any) -> Any:
    if b == 0:
        return mpmath.nan if a == 0 or mpmath.isnan(a) else mpmath.sign(a) * mpmath.inf
    return a / b


def _real(function: Callable[..., Any]) -> Callable[..., Any]:
    """NaN in place of a complex result."""

    def real(*arguments: Any) -> Any:
        value = function(*arguments)
        return mpmath.nan if isinstance(value, mpmath.mpc) else value

    return real


_LOGIC: Mapping[int, Callable[..., Any]] = {
    casadi.OP_LT: operator.lt,
    casadi.OP_LE: operator.le,
    casadi.OP_EQ: operator.eq,
    casadi.OP_NE: operator.ne,
    casadi.OP_NOT: operator.not_,
    casadi.OP_AND: lambda a, b: bool(a) and bool(b),
    casadi.OP_OR: lambda a, b: bool(a) or bool(b),
    casadi.OP_IF_ELSE_ZERO: lambda condition, x: x if condition else mpmath.mpf(0),
}

_PLAIN: Mapping[int, Callable[..., Any]] = {
    casadi.OP_ASSIGN: lambda x: x,
    casadi.OP_ADD: operator.add,
    casadi.OP_SUB: operator.sub,
    casadi.OP_MUL: operator.mul,
    casadi.OP_DIV: operator.truediv,
    casadi.OP_NEG: operator.neg,
    casadi.OP_SQ: lambda x: x * x,
    casadi.OP_TWICE: lambda x: 2 * x,
    casadi.OP_INV: lambda x: 1 / x,
    casadi.OP_POW: operator.pow,
    casadi.OP_CONSTPOW: operator.pow,
    casadi.OP_FABS: abs,
}

_NAMED = (
    "SQRT",
    "EXP",
    "LOG",
    "SIN",
    "COS",
    "TAN",
    "ASIN",
    "ACOS",
    "ATAN",
    "SINH",
    "COSH",
    "TANH",
    "ATAN2",
)
"""Operations that mpmath and SymPy have under the same name."""


def _named(library: Any) -> dict[int, Callable[..., Any]]:
    return {getattr(casadi, f"OP_{name}"): getattr(library, name.lower()) for name in _NAMED}


MPMATH = Arithmetic(
    mpmath.mpf,
    {
        **_PLAIN,
        **{code: _real(function) for code, function in _named(mpmath).items()},
        **_LOGIC,
        casadi.OP_DIV: _divide,
        casadi.OP_INV: lambda x: _divide(mpmath.mpf(1), x),
        casadi.OP_POW: _real(operator.pow),
        casadi.OP_CONSTPOW: _real(operator.pow),
        casadi.OP_SIGN: mpmath.sign,
        casadi.OP_FMIN: min,
        casadi.OP_FMAX: max,
        casadi.OP_FLOOR: mpmath.floor,
        casadi.OP_CEIL: mpmath.ceil,
        casadi.OP_HYPOT: mpmath.hypot,
    },
)
"""mpmath's numbers, in the precision that is set when they are used."""


# --- expressions ---------------------------------------------------------------------------------


def is_condition(value: Any) -> bool:
    """Whether a SymPy object is true or false rather than a number; every symbol could be either
    and counts as a number.
    """
    return isinstance(value, sympy.core.relational.Relational | BooleanFunction | BooleanAtom)


def _truth(value: Any) -> Any:
    return value if is_condition(value) else sympy.Ne(value, 0)


def _number(value: Any) -> Any:
    """Conditions count as 1 and 0 where a number is expected."""
    return sympy.Piecewise((1, value), (0, True)) if is_condition(value) else value


def _of_numbers(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: function(*[_number(a) for a in arguments])


def _relation(kind: Any) -> Callable[..., Any]:
    """Not evaluated, unless between numbers: SymPy would try to decide the sign of large
    differences.
    """

    def relation(a: Any, b: Any) -> Any:
        a, b = _number(a), _number(b)
        return kind(a, b, evaluate=bool(a.is_number and b.is_number))

    return relation


def _if_else_zero(condition: Any, x: Any) -> Any:
    condition = _truth(condition)
    if condition in (sympy.true, sympy.false):
        return x if condition == sympy.true else sympy.Integer(0)
    return sympy.Piecewise((_number(x), condition), (0, True), evaluate=False)


def _exact(value: float) -> Any:
    """The binary number, as a fraction where it is finite."""
    return (
        sympy.Rational(*float(value).as_integer_ratio())
        if np.isfinite(value)
        else sympy.sympify(value)
    )


SYMPY = Arithmetic(
    _exact,
    {
        **{
            code: _of_numbers(function)
            for code, function in (*_PLAIN.items(), *_named(sympy).items())
        },
        casadi.OP_LT: _relation(sympy.Lt),
        casadi.OP_LE: _relation(sympy.Le),
        casadi.OP_EQ: _relation(sympy.Eq),
        casadi.OP_NE: _relation(sympy.Ne),
        casadi.OP_NOT: lambda a: sympy.Not(_truth(a)),
        casadi.OP_AND: lambda a, b: sympy.And(_truth(a), _truth(b)),
        casadi.OP_OR: lambda a, b: sympy.Or(_truth(a), _truth(b)),
        casadi.OP_IF_ELSE_ZERO: _if_else_zero,
        casadi.OP_SIGN: _of_numbers(sympy.sign),
        casadi.OP_FMIN: lambda a, b: sympy.Min(a, b, evaluate=False),
        casadi.OP_FMAX: lambda a, b: sympy.Max(a, b, evaluate=False),
        casadi.OP_FLOOR: _of_numbers(sympy.floor),
        casadi.OP_CEIL: _of_numbers(sympy.ceiling),
        casadi.OP_HYPOT: lambda a, b: sympy.sqrt(a**2 + b**2),
    },
)
"""SymPy expressions; conditions stay conditions."""
