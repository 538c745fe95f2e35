"""Polynomial right-hand sides of SymPy and CasADi, read exactly."""

from __future__ import annotations

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


class Equations(NamedTuple):
    """dx/dt = f(x) with f(0) = 0, the names of x, and `read`, which reads functions of x."""

    states: tuple[str, ...]
    f: tuple[SparsePolynomial, ...]
    read: Any


def equations(f: Any, states: Any = None) -> Equations:
    """Return the equations that a mapping, a list of expressions or a CasADi function holds.

    Raises `InputError` for what is no polynomial, or where f(0) is not 0.
    """
    if isinstance(f, Mapping):
        if states is not None:
            raise InputError("states: the mapping {state: dx/dt} names them already; leave it out")
        states, f = list(f), list(f.values())
    own = _by_casadi(f, states) if _is_casadi(f) else _by_sympy(f, states)
    moved = [x for x, each in zip(own.states, own.f, strict=True) if (0,) * each.size in each.terms]
    if moved:
        raise InputError(
            f"f(0) must be 0, but d{moved[0]}/dt is not; write the equations in x - x_e, with the"
            " equilibrium x_e"
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


def _by_sympy(f: Any, states: Any) -> Equations:
    import sympy

    if states is None or not isinstance(f, Sequence | sympy.MatrixBase):
        raise InputError(
            "f: expected {state: dx/dt} of SymPy, a list of expressions with states=[...], or a"
            " casadi.Function x -> dx/dt"
        )
    every: list[Any] = list(f)  # type: ignore[arg-type]
    x = [sympy.Symbol(each) if isinstance(each, str) else each for each in states]
    if len(x) != len(every) or len(set(x)) < len(x) or not x:
        raise InputError(f"states: expected {len(every)} different symbols, got {states!r:.80}")

    def read(expression: Any, name: str) -> SparsePolynomial:
        try:
            own = sympy.sympify(expression)
            exact = own.replace(lambda e: e.is_Float, lambda e: sympy.Rational(float(e)))
            poly = sympy.Poly(exact, *x)
            terms: Any = {k: Fraction(int(c.p), int(c.q)) for k, c in poly.terms()}
        except (sympy.SympifyError, sympy.PolynomialError, AttributeError, TypeError) as error:
            raise InputError(
                f"{name}: expected a polynomial of {', '.join(map(str, x))} with numbers as"
                f" coefficients, got {expression!s:.80}; {ADVICE}"
            ) from error
        return SparsePolynomial(len(x), terms)

    return Equations(
        tuple(map(str, x)), tuple(read(e, f"d{s}/dt") for e, s in zip(every, x, strict=True)), read
    )


def _by_casadi(f: Any, states: Any) -> Equations:
    import casadi

    if isinstance(f, casadi.Function):
        if f.n_in() != 1 or f.n_out() != 1 or f.size_in(0) != f.size_out(0) or f.size2_in(0) != 1:
            raise InputError(
                f"f: expected a casadi.Function x -> dx/dt of one column each, got {f}; put numbers"
                " for its other inputs, with the feedback inside"
            )
        x = casadi.SX.sym("x", f.size1_in(0))
        f, states = f(x), x if states is None else states
        names = _names(states, x)
        states = x
    else:
        if states is None:
            raise InputError("states: expected the casadi column of states in which f is written")
        f = casadi.vertcat(*f) if isinstance(f, list | tuple) else f
        names = _names(states, states)
    n = len(names)
    if f.shape != (n, 1):
        raise InputError(f"f: expected {n} entries, as many as states, got shape {f.shape}")

    def read(expression: Any, name: str) -> SparsePolynomial:
        if isinstance(expression, casadi.Function):
            expression = expression(states)
        return _polynomials(casadi.Function("f", [states], [casadi.vertcat(expression)]), name)[0]

    return Equations(names, _polynomials(casadi.Function("f", [states], [f]), "f"), read)


def _names(states: Any, x: Any) -> tuple[str, ...]:
    if isinstance(states, list | tuple):
        names = tuple(map(str, states))
    else:
        names = tuple(str(states[i]) for i in range(states.shape[0]))
    if len(names) != x.shape[0] or len(set(names)) < len(names):
        raise InputError(f"states: expected {x.shape[0]} different names, got {names}")
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
