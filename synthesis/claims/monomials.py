"""Polynomials of several variables with rational coefficients, by their monomials.

A polynomial is {exponents: coefficient}, without zeros. In a text a decimal is the rational that it
writes: 0.1 is 1/10.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array

Monomials = dict[tuple[int, ...], Fraction]
MOST_TERMS, HIGHEST_POWER = 5000, 60
"""Terms of a polynomial, and its degree, beyond which it is not read."""
WRITTEN = re.compile(
    r"[-+]?(\d{1,4000}(/\d{1,4000})?|(\d{1,400}\.?\d{0,400}|\.\d{1,400})([eE][-+]?\d{1,3})?)"
)
"""Texts that are rationals, of so many digits."""


def monomials(value: Any, names: Sequence[str]) -> Monomials:
    """Return the polynomial of a text in these names, or of a mapping {exponents: number}.

    Raises `InputError` for a text that is no polynomial.

    Examples
    --------
    >>> monomials("-x + 0.1*x^3", ["x"])
    {(1,): Fraction(-1, 1), (3,): Fraction(1, 10)}
    """
    if isinstance(value, str):
        return _of_text(value, names)
    if isinstance(value, int | float):
        value = {(0,) * len(names): value}
    if not isinstance(value, Mapping):
        raise InputError(f"expected a polynomial as text or {{exponents: number}}, got {value!r}")
    found: Monomials = {}
    for exponents, number in value.items():
        key = tuple(exponents)
        if len(key) != len(names) or not all(isinstance(e, int) and e >= 0 for e in key):
            raise InputError(f"expected {len(names)} exponents >= 0, got {exponents!r:.60}")
        found[key] = rational(number)
    return bounded(_without_zeros(found))


def rational(number: Any) -> Fraction:
    """Return the rational of a number, or of a text such as "3/4" or "1.5e-3".

    Raises `InputError` for anything else, also for one of too many digits.
    """
    try:
        if isinstance(number, str) and not WRITTEN.fullmatch(number):
            raise ValueError(number)
        return Fraction(number)
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise InputError(f"expected a finite number, got {number!r:.60}") from None


def bounded(F: Monomials) -> Monomials:
    """Return the polynomial; raises `InputError` for too many terms or too high a degree."""
    if len(F) > MOST_TERMS or degree(F) > HIGHEST_POWER:
        raise InputError(
            f"a polynomial of more than {MOST_TERMS} terms, or of a degree above {HIGHEST_POWER},"
            " is not read"
        )
    return F


def _of_text(text: str, names: Sequence[str]) -> Monomials:
    source = text.replace("^", "**").strip()
    try:
        tree = ast.parse(source, mode="eval")
        return _without_zeros(_node(tree.body, source, names))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{text!r:.80} is no polynomial ({error})") from None


def _node(node: ast.AST, source: str, names: Sequence[str]) -> Monomials:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        written = ast.get_source_segment(source, node) or ""
        return {(0,) * len(names): rational(written)}
    if isinstance(node, ast.Name):
        if node.id not in names:
            raise InputError(f"{node.id!r} is no state; the states are {', '.join(names)}")
        return {tuple(int(name == node.id) for name in names): Fraction(1)}
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        sign = -1 if isinstance(node.op, ast.USub) else 1
        return scaled(_node(node.operand, source, names), Fraction(sign))
    if isinstance(node, ast.BinOp):
        left = _node(node.left, source, names)
        right = _node(node.right, source, names)
        return _operation(node.op, left, right)
    raise InputError(f"{source!r:.80} is no polynomial: use + - * / ^ ( ), numbers and states")


def _operation(kind: ast.operator, left: Monomials, right: Monomials) -> Monomials:
    if isinstance(kind, ast.Add):
        return added(left, right)
    if isinstance(kind, ast.Sub):
        return added(left, scaled(right, Fraction(-1)))
    if isinstance(kind, ast.Mult):
        return times(left, right)
    number = _number(right)
    if isinstance(kind, ast.Div) and number:
        return scaled(left, 1 / number)
    if isinstance(kind, ast.Pow) and number is not None and number.denominator == 1:
        return power(left, int(number))
    raise InputError("a polynomial is divided by a number other than 0, its powers are whole")


def _number(F: Monomials) -> Fraction | None:
    own = _without_zeros(F)
    if any(any(e) for e in own):
        return None
    return next(iter(own.values()), Fraction(0))


def _without_zeros(F: Monomials) -> Monomials:
    return {e: c for e, c in F.items() if c}


def added(*polynomials: Monomials) -> Monomials:
    """Return the sum."""
    found: Monomials = {}
    for F in polynomials:
        for e, c in F.items():
            found[e] = found.get(e, Fraction(0)) + c
    return _without_zeros(found)


def scaled(F: Monomials, factor: Fraction) -> Monomials:
    """Return the multiple."""
    return _without_zeros({e: c * factor for e, c in F.items()})


def times(F: Monomials, G: Monomials) -> Monomials:
    """Return the product."""
    found: Monomials = {}
    for (e, c), (k, d) in product(F.items(), G.items()):
        key = tuple(a + b for a, b in zip(e, k, strict=True))
        found[key] = found.get(key, Fraction(0)) + c * d
    return bounded(_without_zeros(found))


def power(F: Monomials, exponent: int) -> Monomials:
    """Return a power, of an exponent from 0 to `HIGHEST_POWER`."""
    if not 0 <= exponent <= HIGHEST_POWER:
        raise InputError(f"expected a power from 0 to {HIGHEST_POWER}, got {exponent}")
    found = {(0,) * len(next(iter(F), ())): Fraction(1)}
    for _ in range(exponent):
        found = times(found, F)
    return found


def derivative(F: Monomials, axis: int) -> Monomials:
    """Return the partial derivative by one variable."""
    return {(*e[:axis], e[axis] - 1, *e[axis + 1 :]): c * e[axis] for e, c in F.items() if e[axis]}


def along(V: Monomials, f: Sequence[Monomials]) -> Monomials:
    """Return dV/dt along x' = f(x)."""
    return added(*(times(derivative(V, i), own) for i, own in enumerate(f)))


def value(F: Monomials, x: Sequence[Any]) -> Any:
    """Return the value at x, in the arithmetic of x."""
    total: Any = 0
    for e, c in F.items():
        term: Any = c if all(isinstance(v, Fraction | int) for v in x) else float(c)
        for v, k in zip(x, e, strict=True):
            term = term * v**k if k else term
        total = total + term
    return total


def compiled(polynomials: Sequence[Monomials]) -> Callable[[Array], Array]:
    """Return polynomials as a function of points (..., n), in doubles: (..., number of them)."""
    powers = [np.array(list(F), dtype=int) for F in polynomials]
    numbers = [np.array([float(c) for c in F.values()]) for F in polynomials]

    def values(x: Array) -> Array:
        own = [
            np.prod(x[..., None, :] ** e, axis=-1) @ c if len(c) else 0.0 * x[..., 0]
            for e, c in zip(powers, numbers, strict=True)
        ]
        return np.stack(own, axis=-1)

    return values


def least_degree(F: Monomials) -> int:
    """Return the degree of the lowest terms; of zero -1."""
    return min((sum(e) for e in F), default=-1)


def degree(F: Monomials) -> int:
    """Return the degree; of zero -1."""
    return max((sum(e) for e in F), default=-1)


def in_units(F: Monomials, units: Sequence[Fraction]) -> Monomials:
    """Return F(diag(units) z) as a polynomial in z."""
    found: Monomials = {}
    for e, c in F.items():
        for u, k in zip(units, e, strict=True):
            c = c * u**k
        found[e] = c
    return found


def written(F: Monomials, names: Sequence[str]) -> str:
    """Return the polynomial as a text."""
    terms = []
    for e, c in sorted(F.items(), reverse=True):
        powers = [n if k == 1 else f"{n}^{k}" for n, k in zip(names, e, strict=True) if k]
        terms.append("*".join([str(c), *powers]))
    return " + ".join(terms).replace("+ -", "- ") or "0"


def stored(F: Monomials) -> list[Any]:
    """Return the polynomial as JSON holds it: [[exponents, "rational"], ...]."""
    return [[list(e), str(c)] for e, c in sorted(F.items())]


def restored(value: Any, variables: int) -> Monomials:
    """Return the polynomial of `stored`; raises `InputError` for another value."""
    names = [f"x{i}" for i in range(variables)]
    return monomials({tuple(e): str(c) for e, c in value}, names)
