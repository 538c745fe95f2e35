"""CasADi functions as SymPy expressions, and evaluated with any number of digits.

Both walk the instructions of the function (`Tape`) with an arithmetic of their own. Nothing is
simplified on the way, and constants are the binary numbers CasADi holds, exactly: 0.1 is not 1/10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import mpmath
import numpy as np
import sympy

from symheli.values.arithmetic import MPMATH, SYMPY, is_condition
from symheli.values.tape import Arithmetic, Tape


def evaluate(function: casadi.Function | Tape, *arguments: Any, digits: int = 50) -> list[Any]:
    """Outputs of `function`, as mpmath matrices, at `arguments` (numbers, sequences or matrices) in
    `digits` decimal digits.

    A float argument is taken as the binary number it is. As in CasADi, 1/0 is inf and sqrt(-1) is
    NaN.
    """
    tape = function if isinstance(function, Tape) else Tape.of(function)
    with mpmath.workdps(digits):
        results = tape.run([_rows(argument, mpmath.mpf) for argument in arguments], MPMATH)
        return [mpmath.matrix(rows) for rows in results]


def to_sympy(function: casadi.Function, *arguments: Any) -> list[sympy.Matrix]:
    """Outputs of `function` as SymPy matrices.

    `arguments`: SymPy expressions or numbers, one sequence or matrix an input; without any, symbols
    named after the inputs (x_0, x_1, ...). For a few hundred operations; SymPy takes no end of time
    over branches inside branches: see `to_steps`.
    """
    return _in_sympy(function, arguments, SYMPY)


def to_steps(
    function: casadi.Function, *arguments: Any
) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], list[sympy.Matrix]]:
    """Outputs of `function` of any size, as `sympy.cse` returns them: definitions (symbol,
    expression) in order, then matrices.

    Every branch, sign and absolute value has a symbol of its own, so that no expression holds a
    branch inside a branch.
    """
    definitions: list[tuple[sympy.Symbol, sympy.Expr]] = []

    def naming(carry_out: Callable[..., Any]) -> Callable[..., Any]:
        def named(*operands: Any) -> Any:
            value = carry_out(*operands)
            if not value.has(*_BRANCHES) or is_condition(value):
                return value
            definitions.append((sympy.Symbol(f"step_{len(definitions)}", real=True), value))
            return definitions[-1][0]

        return named

    operations = {code: naming(carry_out) for code, carry_out in SYMPY.operations.items()}
    return definitions, _in_sympy(function, arguments, Arithmetic(SYMPY.constant, operations))


_BRANCHES = (sympy.Piecewise, sympy.Abs, sympy.sign, sympy.Min, sympy.Max)


def _in_sympy(
    function: casadi.Function, arguments: Sequence[Any], arithmetic: Arithmetic
) -> list[sympy.Matrix]:
    given = arguments or [
        _symbols(function.name_in(i), function.size_in(i)) for i in range(function.n_in())
    ]
    return [
        sympy.Matrix(rows)
        for rows in Tape.of(function).run([_rows(a, sympy.sympify) for a in given], arithmetic)
    ]


def _symbols(name: str, size: tuple[int, int]) -> sympy.Matrix:
    if size == (1, 1):
        return sympy.Matrix([[sympy.Symbol(name, real=True)]])
    label = (lambda i, j: f"{name}_{i}") if size[1] == 1 else (lambda i, j: f"{name}_{i}_{j}")
    return sympy.Matrix(*size, lambda i, j: sympy.Symbol(label(i, j), real=True))


def _rows(argument: Any, convert: Callable[[Any], Any]) -> list[list[Any]]:
    """An argument as rows of numbers: a number is (1, 1), a sequence a column."""
    if isinstance(argument, mpmath.matrix | sympy.MatrixBase):
        return [
            [convert(argument[i, j]) for j in range(argument.cols)] for i in range(argument.rows)
        ]
    array = np.asarray(argument, dtype=object)
    columns = array.reshape(-1, 1) if array.ndim < 2 else array
    return [[convert(v) for v in row] for row in columns.tolist()]
