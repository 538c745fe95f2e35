"""Polynomial right-hand sides of SymPy and CasADi, read exactly."""

from __future__ import annotations

import ast
import operator
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.codegen.translation import operations
from symheli.errors import InputError
from symheli.values.arrays import frozen
from synthesis.numerics.polynomial.multivariate import SparsePolynomial

ADVICE = (
    "write it with + - * and whole powers, for instance by a Taylor polynomial about the"
    " equilibrium; the proof is of that model then"
)


HIGHEST = 60
"""Largest power in a text."""


class Equations(NamedTuple):
    """f(x, u) with f(0, 0) = 0, polynomials of x and then u; their names, and `read`, which reads
    functions of x and u.
    """

    states: tuple[str, ...]
    controls: tuple[str, ...]
    f: tuple[SparsePolynomial, ...]
    read: Any


def equations(f: Any, states: Any = None, controls: Any = ()) -> Equations:
    """Return the equations that a mapping, a list of expressions or a CasADi function holds.

    Controls None: a casadi.Function is of x and u. Raises `InputError` for what is no polynomial,
    or where f(0, 0) is not 0.
    """
    if isinstance(f, Mapping):
        if states is not None:
            raise InputError("states: the mapping {state: dx/dt} names them already; leave it out")
        states, f = list(f), list(f.values())
    own = _of_casadi(f, states, controls) if _is_casadi(f) else _of_sympy(f, states, controls)
    names = (*own.states, *own.controls)
    if len(set(names)) < len(names) or not own.states:
        raise InputError(f"states and controls: expected different names, got {', '.join(names)}")
    moved = [x for x, each in zip(own.states, own.f, strict=True) if (0,) * each.size in each.terms]
    if moved:
        raise InputError(
            f"f must be 0 at 0, but that of {moved[0]} is not; write the equations in x - x_e and"
            " u - u_e, with the equilibrium x_e, u_e"
        )
    return own


def function_of(V: Any, own: Equations) -> SparsePolynomial:
    """Return the function V(x) of an expression, or x' P x of a matrix P (n, n)."""
    n = len(own.states)
    if isinstance(V, np.ndarray | list | tuple):
        P, x = frozen(V, "V", (n, n)), SparsePolynomial.variables(n)
        squares = [x[i] * x[j] * Fraction(P[i, j]) for i in range(n) for j in range(n)]
        found = sum(squares, SparsePolynomial(n, {}))
    else:
        found = own.read(V, "V")
    if (0,) * n in found.terms:
        raise InputError("V(0) must be 0; subtract its constant")
    return found


def _is_casadi(f: Any) -> bool:
    first = f[0] if isinstance(f, list | tuple) and f else f
    return type(first).__module__.partition(".")[0] == "casadi"


def _of_sympy(f: Any, states: Any, controls: Any) -> Equations:
    import sympy

    if states is None or controls is None or not isinstance(f, Sequence | sympy.MatrixBase):
        raise InputError(
            "f: expected {state: dx/dt} of SymPy, a list of expressions with states=[...], or a"
            " casadi.Function; controls of SymPy are named, controls=[...]"
        )
    every: list[Any] = list(f)  # type: ignore[arg-type]
    x = [sympy.Symbol(each) if isinstance(each, str) else each for each in (*states, *controls)]
    n = len(list(states))
    if n != len(every):
        raise InputError(f"states: expected {len(every)} symbols, got {states!r:.80}")

    def read(expression: Any, name: str) -> SparsePolynomial:
        try:
            own = _of_text(expression, x) if isinstance(expression, str) else expression
            own = sympy.sympify(own)
            exact = own.replace(lambda e: e.is_Float, lambda e: sympy.Rational(float(e)))
            poly = sympy.Poly(exact, *x)
            terms: Any = {k: Fraction(int(c.p), int(c.q)) for k, c in poly.terms()}
        except (sympy.SympifyError, sympy.PolynomialError, AttributeError, TypeError) as error:
            raise InputError(
                f"{name}: expected a polynomial of {', '.join(map(str, x))} with numbers as"
                f" coefficients, got {expression!s:.80}; {ADVICE}"
            ) from error
        return SparsePolynomial(len(x), terms)

    names = tuple(map(str, x))
    polynomials = tuple(read(e, f"the equation of {s}") for e, s in zip(every, x, strict=False))
    return Equations(names[:n], names[n:], polynomials, read)


def _of_text(text: str, x: Sequence[Any]) -> Any:
    """Return the polynomial of a text in the symbols x; nothing else of the text is evaluated."""
    import sympy

    by = {str(each): each for each in x}
    do = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
          ast.Div: operator.truediv}  # fmt: skip

    def read(node: ast.AST) -> Any:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return sympy.sympify(value)
            case ast.Name(id=name) if name in by:
                return by[name]
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=own):
                return -read(own) if isinstance(sign, ast.USub) else read(own)
            case ast.BinOp(left=own, op=ast.Pow(), right=ast.Constant(value=int() as power)):
                if 0 <= power <= HIGHEST:
                    return read(own) ** power
            case ast.BinOp(left=left, op=kind, right=right) if type(kind) in do:
                return do[type(kind)](read(left), read(right))
        raise TypeError(f"no polynomial: {ast.dump(node):.80}")

    try:
        return read(ast.parse(text.strip().replace("^", "**"), mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise TypeError(str(error)) from error


def _of_casadi(f: Any, states: Any, controls: Any) -> Equations:
    import casadi

    if isinstance(f, casadi.Function):
        inputs = 1 if controls is not None and not len(controls) else 2
        columns = [f.size2_in(i) for i in range(f.n_in())]
        if columns != [1] * inputs or f.n_out() != 1 or f.size_in(0) != f.size_out(0):
            wanted = "x" if inputs == 1 else "(x, u)"
            raise InputError(
                f"f: expected a casadi.Function {wanted} -> one column for x, got {f}; put numbers"
                " for its other inputs, with the feedback inside"
            )
        at = [casadi.SX.sym(name, f.size1_in(i)) for i, name in enumerate("xu"[:inputs])]
        names = [_names(own, x) for own, x in zip((states, controls), at, strict=False)]
        f = f(*at)
    else:
        if states is None or controls is None:
            raise InputError(
                "f: expected states, and controls if any, the columns it is written in"
            )
        f = casadi.vertcat(*f) if isinstance(f, list | tuple) else f
        at = [states, *([] if isinstance(controls, tuple) else [controls])]
        names = [_names(None, own) for own in at]
    if f.shape != (len(names[0]), 1):
        raise InputError(f"f: expected {len(names[0])} entries, as many as states, got {f.shape}")
    column = casadi.vertcat(*at)

    def read(expression: Any, name: str) -> SparsePolynomial:
        if isinstance(expression, casadi.Function):
            expression = expression(*at[: expression.n_in()])
        return _polynomials(casadi.Function("f", [column], [casadi.vertcat(expression)]), name)[0]

    polynomials = tuple(read(f[i], "f") for i in range(len(names[0])))
    return Equations(names[0], names[1] if len(names) > 1 else (), polynomials, read)


def _names(given: Any, x: Any) -> tuple[str, ...]:
    """Return the names given, or those of the column x."""
    found = given if given is not None and len(given) else [x[i] for i in range(x.shape[0])]
    names = tuple(map(str, found))
    if len(names) != x.shape[0]:
        raise InputError(f"expected {x.shape[0]} names, got {', '.join(names)}")
    return names


def _polynomials(function: Any, name: str) -> tuple[SparsePolynomial, ...]:
    program = operations(function.expand())
    x, found = SparsePolynomial.variables(program.sizes[0]), []
    for o in program.operations:
        own = [found[i] for i in o.arguments]
        if o.name == "input":
            found.append(x[o.element[1]])
        elif o.name == "constant":
            found.append(SparsePolynomial.constant(Fraction(o.value), len(x)))
        else:
            found.append(_applied(o.name, own, name))
    return tuple(found[i] for i in program.outputs[0])


def _applied(operation: str, own: Sequence[SparsePolynomial], name: str) -> SparsePolynomial:
    if operation == "add":
        return own[0] + own[1]
    if operation == "sub":
        return own[0] - own[1]
    if operation == "neg":
        return -own[0]
    if operation == "mul":
        return own[0] * own[1]
    if operation == "div" and own[1].degree == 0 and own[1].terms:
        return own[0] * (1 / next(iter(own[1].terms.values())))
    raise InputError(f"{name}: expected a polynomial, found the operation {operation!r}; {ADVICE}")
