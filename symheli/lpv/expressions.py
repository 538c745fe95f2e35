"""LPV and LFT models from matrices of SymPy or CasADi expressions in the scheduling parameters."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.user_functions import UserFunctions
from symheli.lpv.interconnection import append, feedback, parallel, series
from symheli.lpv.lft.algebra import close
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft.reduction import reduce as reduce_lft
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Scheduling, parameters
from symheli.values.signal import Signal, signals

Given = Any
"""A matrix of numbers and expressions of SymPy or CasADi: nested lists, a NumPy array, or a
matrix of SymPy or CasADi.
"""
Expression = Any
Names = Sequence[str] | None


def lpv_of(
    matrices: Sequence[Given],
    scheduling: Scheduling | Sequence[Scheduling],
    dt: float | None = None,
    states: Names = None,
    inputs: Names = None,
    outputs: Names = None,
) -> LPVStateSpace:
    """See `LPVStateSpace.from_expressions`."""
    sympy = _sympy()

    given = parameters(scheduling)
    A, B, C, D = _matrices(matrices, given)
    symbols = [s.symbol for s in given]
    entries = [*A, *B, *C, *D]
    if all(entry.is_polynomial(*symbols) for entry in entries):
        a, b, c, d = (_by_powers(M, symbols) for M in (A, B, C, D))
        return LPVStateSpace.polynomial(a, b, c, d, given, dt, states, inputs, outputs)
    whole = sympy.Matrix(sympy.BlockMatrix([[A, B], [C, D]])).applyfunc(sympy.expand)
    terms = [
        [_by_parameter(t, symbols) for t in sympy.Add.make_args(entry) if t != 0] for entry in whole
    ]
    factors = []
    for k, s in enumerate(given):
        found = {functions[k] for entry in terms for _, functions in entry}
        used = sorted(found | {sympy.Integer(1)}, key=sympy.default_sort_key)
        factors.append((used, functions_of_one(used, s)))
    basis = factors[0][1] if len(given) == 1 else Product(tuple(one for _, one in factors))
    known = basis.indices if isinstance(basis, Product) else [(k,) for k in range(basis.size)]
    M = np.zeros((basis.size, len(whole)))
    for column, entry in enumerate(terms):
        for number, functions in entry:
            place = tuple(used.index(f) for f, (used, _) in zip(functions, factors, strict=True))
            M[known.index(place), column] += float(number)
    M = M.reshape(basis.size, *whole.shape)
    nx, (ny, nu) = A.rows, D.shape
    names = _named(states, inputs, outputs, (nx, nu, ny))
    blocks = (M[:, :nx, :nx], M[:, :nx, nx:], M[:, nx:, :nx], M[:, nx:, nx:])
    x, u, y = names
    return LPVStateSpace(basis, *blocks, given, x, u, y, dt)


def lft_of(
    matrices: Sequence[Given],
    scheduling: Scheduling | Sequence[Scheduling],
    dt: float | None,
    states: Names,
    inputs: Names,
    outputs: Names,
) -> LFT:
    """See `LFT.from_expressions`."""
    sympy = _sympy()

    given = parameters(scheduling)
    A, B, C, D = _matrices(matrices, given)
    whole = sympy.Matrix(sympy.BlockMatrix([[A, B], [C, D]]))
    symbols = {s.symbol: s for s in given}
    if wrong := [e for e in whole if not e.is_rational_function(*symbols)]:
        raise InputError(
            f"{wrong[0]} is no rational function of {', '.join(map(str, symbols))}, and an LFT"
            " holds no other exactly; LPVStateSpace.from_expressions does"
        )
    x, u, y = _named(states, inputs, outputs, (A.rows, D.cols, D.rows))
    constant, moving = np.zeros(whole.shape), []
    for i in range(whole.rows):
        for j in range(whole.cols):
            if whole[i, j].free_symbols:
                moving.append((i, j, _static(whole[i, j], symbols)))
            else:
                constant[i, j] = float(whole[i, j])
    if not moving:
        raise InputError("no entry depends on the parameters: a LinearModel holds these matrices")
    E, F = np.zeros((len(moving), whole.cols)), np.zeros((whole.rows, len(moving)))
    for k, (i, j, _) in enumerate(moving):
        E[k, j] = F[i, k] = 1.0
    together = append(*(entry for _, _, entry in moving))
    rows, columns = ([Signal(str(k)) for k in range(n)] for n in whole.shape)
    K = np.zeros((len(moving), len(moving)))
    static = close(together, K, E, F, columns, rows, constant)
    blocks = (static.M11, static.M12, static.M21, static.M22, static.blocks)
    return reduce_lft(LFT(*blocks, x, u, y, dt), None)


def _matrices(given: Sequence[Given], known: Sequence[Scheduling]) -> list[Expression]:
    """A, B, C, D with exact numbers and the parameters' own symbols."""
    A, B, C, D = (_matrix(name, M, known) for name, M in zip("ABCD", given, strict=True))
    if A.rows != A.cols or B.rows != A.rows or C.cols != A.rows or D.shape != (C.rows, B.cols):
        raise InputError(
            "expected A (nx, nx), B (nx, nu), C (ny, nx), D (ny, nu), got"
            f" {A.shape}, {B.shape}, {C.shape}, {D.shape}"
        )
    return [A, B, C, D]


def _matrix(name: str, given: Given, known: Sequence[Scheduling]) -> Expression:
    sympy = _sympy()

    own = {s.name: s.symbol for s in known}
    try:
        if _is_casadi(given):
            given = _of_casadi(given)
        elif isinstance(given, list | tuple):
            given = [
                [_of_casadi(e)[0] if _is_casadi(e) else e for e in row]
                if isinstance(row, list | tuple)
                else row
                for row in given
            ]
        M = sympy.Matrix(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected a matrix of expressions ({error})") from None
    for symbol in sorted(M.free_symbols, key=str):
        if str(symbol) not in own:
            raise UnknownNameError("scheduling parameter", str(symbol), list(own))
    exact = {number: sympy.Rational(number) for number in M.atoms(sympy.Float)}
    same = {symbol: own[str(symbol)] for symbol in M.free_symbols}
    M = M.xreplace({**exact, **same})
    if bad := [e for e in M if e.has(sympy.nan, sympy.oo, sympy.zoo, sympy.I)]:
        raise InputError(f"{name}: expected real, finite entries, got {bad[0]}")
    return M


def _is_casadi(given: Given) -> bool:
    return type(given).__module__.partition(".")[0] == "casadi"


def _of_casadi(given: Given) -> Expression:
    """The same matrix in SymPy, with symbols of the same names."""
    import casadi

    from symheli.values.arithmetic import SYMPY
    from symheli.values.tape import Tape

    sympy = _sympy()
    given = casadi.SX(given) if isinstance(given, casadi.DM) else given
    used = casadi.symvar(given)
    if vectors := [s.name() for s in used if not s.is_scalar()]:
        raise InputError(f"{vectors[0]} is a vector: expected one scalar symbol a parameter")
    arguments = [[[sympy.Symbol(s.name())]] for s in used]
    return sympy.Matrix(Tape.of(casadi.Function("f", used, [given])).run(arguments, SYMPY)[0])


def _by_powers(M: Expression, symbols: Sequence[Expression]) -> dict[tuple[int, ...], Any]:
    """{exponents: matrix}."""
    sympy = _sympy()

    found = {(0,) * len(symbols): np.zeros(M.shape)}
    for i in range(M.rows):
        for j in range(M.cols):
            for exponents, number in sympy.Poly(M[i, j], *symbols).terms():
                found.setdefault(exponents, np.zeros(M.shape))[i, j] = float(number)
    return found


def _by_parameter(
    term: Expression, symbols: Sequence[Expression]
) -> tuple[Expression, list[Expression]]:
    """A term as a number times one function of each parameter."""
    number, rest = term.as_independent(*symbols, as_Add=False)
    functions = []
    for symbol in symbols:
        rest, own = rest.as_independent(symbol, as_Add=False)
        functions.append(own)
        if own.free_symbols - {symbol}:
            raise InputError(
                f"{own} is no product of functions of one parameter each, which a basis over"
                " several parameters needs; LFT.from_expressions holds any rational function"
            )
    return number * rest, functions


def functions_of_one(used: Sequence[Expression], s: Scheduling) -> UserFunctions:
    """See `UserFunctions.from_expressions`."""
    sympy = _sympy()

    def compiled(f: Expression) -> Callable[[np.ndarray], np.ndarray]:
        function = sympy.lambdify(s.symbol, f, "numpy")
        return lambda p: function(p) + 0.0 * p  # a constant too has the shape of p

    used = list(_matrix("functions", [list(used)], [s]))

    def name(f: Expression) -> str:
        long = {number: sympy.Float(number, 6) for number in f.atoms(sympy.Rational)}
        return str(f.xreplace({number: short for number, short in long.items() if number.q > 1000}))

    basis = UserFunctions(tuple(map(compiled, used)), s.low, s.high, tuple(map(name, used)))
    slopes = [sympy.diff(f, s.symbol) for f in used]
    if any(f.has(sympy.Derivative) for f in slopes):
        return basis
    with contextlib.suppress(InputError):  # a slope that is not finite, as that of sqrt(p) at 0
        return replace(basis, derivatives=tuple(map(compiled, slopes)))
    return basis


def _static(expression: Expression, symbols: dict[Expression, Scheduling]) -> LFT:
    """y = f(p) u."""
    sympy = _sympy()

    def of(e: Expression) -> LFT | float:
        if not e.free_symbols:
            return float(e)
        if e in symbols:
            return LFT.parameter(symbols[e], "u", "y")
        match e:
            case sympy.Add():
                return reduce(parallel, map(of, e.args))
            case sympy.Mul():
                return reduce(series, map(of, e.args))
            case sympy.Pow() if int(e.exp) < 0:
                inner = of(e.base**-e.exp)
                y = parallel(1.0, series(inner, -1.0))
                return feedback(1.0, y, sign=+1)  # y = u + (1 - f) y
            case sympy.Pow():
                return reduce(series, [of(e.base)] * int(e.exp))
        raise InputError(f"{e} cannot be written as a linear fractional transformation")

    found = of(sympy.horner(expression) if expression.is_polynomial() else expression)
    assert isinstance(found, LFT)  # noqa: S101
    return found


def _named(
    states: Names, inputs: Names, outputs: Names, sizes: Sequence[int]
) -> list[tuple[Signal, ...]]:
    """The names given, or x1.., u1.., y1.."""
    return [
        signals(given or [f"{letter}{i + 1}" for i in range(size)])
        for given, letter, size in zip((states, inputs, outputs), "xuy", sizes, strict=True)
    ]


def _sympy() -> Any:
    """Import SymPy on use; its types are less precise than `Any`."""
    import sympy

    return sympy
