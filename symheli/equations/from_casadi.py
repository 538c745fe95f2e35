"""CasADi functions in SymPy, and evaluated with any number of digits.

Both walk the instructions of the function (`Tape`) with an arithmetic of their own. Nothing is simplified on the way, and
constants are the binary numbers CasADi holds, exactly: 0.1 is not 1/10.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import mpmath
import numpy as np
import sympy
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from symheli.equations.tape import Arithmetic, Tape


def evaluate(function: casadi.Function | Tape, *arguments: Any, digits: int = 50) -> list[Any]:
    """Outputs of `function`, as mpmath matrices, at `arguments` (numbers, sequences or matrices) in `digits` decimal digits.

    A float argument is taken as the binary number it is. As in CasADi, 1/0 is inf and sqrt(-1) is NaN.
    """
    tape = function if isinstance(function, Tape) else Tape.of(function)
    with mpmath.workdps(digits):
        results = tape.run([_rows(argument, mpmath.mpf) for argument in arguments], MPMATH)
        return [mpmath.matrix(rows) for rows in results]


def to_sympy(function: casadi.Function, *arguments: Any) -> list[sympy.Matrix]:
    """Outputs of `function` as SymPy matrices.

    `arguments`: SymPy expressions or numbers, one sequence or matrix an input; without any, symbols named after the inputs
    (x_0, x_1, ...). For a few hundred operations; SymPy takes no end of time over branches inside branches: see `to_steps`.
    """
    return _in_sympy(function, arguments, SYMPY)


def to_steps(function: casadi.Function, *arguments: Any) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], list[sympy.Matrix]]:
    """Outputs of `function` of any size, as `sympy.cse` returns them: definitions (symbol, expression) in order, then matrices.

    Every branch, sign and absolute value has a symbol of its own, so that no expression holds a branch inside a branch.
    """
    definitions: list[tuple[sympy.Symbol, sympy.Expr]] = []

    def naming(carry_out: Callable[..., Any]) -> Callable[..., Any]:
        def named(*operands: Any) -> Any:
            value = carry_out(*operands)
            if not value.has(*_BRANCHES) or _is_condition(value):
                return value
            definitions.append((sympy.Symbol(f"step_{len(definitions)}", real=True), value))
            return definitions[-1][0]

        return named

    operations = {code: naming(carry_out) for code, carry_out in SYMPY.operations.items()}
    return definitions, _in_sympy(function, arguments, Arithmetic(SYMPY.constant, operations))


_BRANCHES = (sympy.Piecewise, sympy.Abs, sympy.sign, sympy.Min, sympy.Max)


def _in_sympy(function: casadi.Function, arguments: Sequence[Any], arithmetic: Arithmetic) -> list[sympy.Matrix]:
    given = arguments or [_symbols(function.name_in(i), function.size_in(i)) for i in range(function.n_in())]
    return [sympy.Matrix(rows) for rows in Tape.of(function).run([_rows(a, sympy.sympify) for a in given], arithmetic)]


def _symbols(name: str, size: tuple[int, int]) -> sympy.Matrix:
    if size == (1, 1):
        return sympy.Matrix([[sympy.Symbol(name, real=True)]])
    label = (lambda i, j: f"{name}_{i}") if size[1] == 1 else (lambda i, j: f"{name}_{i}_{j}")
    return sympy.Matrix(*size, lambda i, j: sympy.Symbol(label(i, j), real=True))


def _rows(argument: Any, convert: Callable[[Any], Any]) -> list[list[Any]]:
    """An argument as rows of numbers: a number is (1, 1), a sequence a column."""
    if isinstance(argument, mpmath.matrix | sympy.MatrixBase):
        return [[convert(argument[i, j]) for j in range(argument.cols)] for i in range(argument.rows)]
    array = np.asarray(argument, dtype=object)
    columns = array.reshape(-1, 1) if array.ndim < 2 else array
    return [[convert(v) for v in row] for row in columns.tolist()]


# --- numbers with many digits ----------------------------------------------------------------------------------


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

_NAMED = ("SQRT", "EXP", "LOG", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ATAN2")
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


# --- expressions -----------------------------------------------------------------------------------------------


def _is_condition(value: Any) -> bool:
    return isinstance(value, sympy.core.relational.Relational | BooleanFunction | BooleanAtom)


def _truth(value: Any) -> Any:
    return value if _is_condition(value) else sympy.Ne(value, 0)


def _number(value: Any) -> Any:
    """Conditions count as 1 and 0 where a number is expected."""
    return sympy.Piecewise((1, value), (0, True)) if _is_condition(value) else value


def _of_numbers(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: function(*[_number(a) for a in arguments])


def _relation(kind: Any) -> Callable[..., Any]:
    """Not evaluated, unless between numbers: SymPy would try to decide the sign of large differences."""

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
    return sympy.Rational(*float(value).as_integer_ratio()) if np.isfinite(value) else sympy.sympify(value)


SYMPY = Arithmetic(
    _exact,
    {
        **{code: _of_numbers(function) for code, function in (*_PLAIN.items(), *_named(sympy).items())},
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
