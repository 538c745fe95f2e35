"""Matrices of polynomials on the unit box, exactly: F(t) = sum_k t^k F_k, t in [0, 1]^m, in powers
of t; and whether one is positive definite on all of the box, by Bernstein coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import chain, zip_longest
from itertools import product as combinations

from .exact import Rows, positive_definite, product, shown

Exponents = tuple[int, ...]
Box = tuple[tuple[Fraction, Fraction], ...]

MOST_BOXES = 4000
"""Boxes that are looked at before a polynomial is left undecided."""


class Polynomial:
    """A matrix of polynomials: {exponents: matrix of integers}, all over the number `below` > 0.

    Exponents of the last variables are left out where they are zero; shape (1, 1) is a scalar.
    """

    def __init__(self, shape: tuple[int, int], terms: dict[Exponents, Rows], below: int = 1):
        self.shape, self.terms, self.below = shape, terms, below

    def __add__(self, other: Polynomial) -> Polynomial:
        below = math.lcm(self.below, other.below)
        terms = dict(self._times(below // self.below))
        for k, rows in other._times(below // other.below).items():
            _add(terms, k, rows)
        return Polynomial(self.shape, terms, below)

    def __neg__(self) -> Polynomial:
        return Polynomial(self.shape, self._times(-1), self.below)

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + -other

    def __mul__(self, factor: Fraction | int) -> Polynomial:
        own = Fraction(factor)
        return Polynomial(self.shape, self._times(own.numerator), self.below * own.denominator)

    def __matmul__(self, other: Polynomial) -> Polynomial:
        shape, terms = (self.shape[0], other.shape[1]), {}
        for a, left in self.terms.items() if self.shape[1] and all(shape) else ():
            for b, right in other.terms.items():
                _add(terms, _joined(a, b), product(left, right))
        return Polynomial(shape, terms, self.below * other.below)

    @property
    def T(self) -> Polynomial:
        """The transpose."""
        m, n = self.shape
        terms = {k: [[M[i][j] for i in range(m)] for j in range(n)] for k, M in self.terms.items()}
        return Polynomial((n, m), terms, self.below)

    def part(self, rows: Sequence[int], columns: Sequence[int] | None = None) -> Polynomial:
        """Return some rows and columns."""
        wanted = range(self.shape[1]) if columns is None else columns
        terms = {k: [[M[i][j] for j in wanted] for i in rows] for k, M in self.terms.items()}
        return Polynomial((len(rows), len(wanted)), terms, self.below)

    def derivative(self, axis: int) -> Polynomial:
        """Return the derivative by t_axis."""
        terms = {
            _trimmed((*k[:axis], k[axis] - 1, *k[axis + 1 :])): _scaled(rows, k[axis])
            for k, rows in self.terms.items()
            if len(k) > axis and k[axis]
        }
        return Polynomial(self.shape, terms, self.below)

    def reduced(self) -> Polynomial:
        """Return the same in the least integers, without terms that are zero."""
        terms = {k: rows for k, rows in self.terms.items() if any(map(any, rows))}
        common = math.gcd(self.below, *(v for rows in terms.values() for row in rows for v in row))
        own = {k: [[v // common for v in row] for row in rows] for k, rows in terms.items()}
        return Polynomial(self.shape, own, self.below // common)

    def at(self, axis: int, t: Polynomial) -> Polynomial:
        """Return the polynomial with the scalar polynomial t in the place of t_axis."""
        parts: dict[int, dict[Exponents, Rows]] = {0: {}}
        for k, rows in self.terms.items():
            e = k[axis] if len(k) > axis else 0
            parts.setdefault(e, {})[_trimmed((*k[:axis], 0, *k[axis + 1 :]))] = rows
        powers = [scalar(1)]
        for _ in range(max(parts)):
            powers.append((powers[-1] @ t).reduced())
        matrices = [Polynomial(self.shape, own, self.below) for own in parts.values()]
        return combined([powers[e] for e in parts], matrices)

    def value(self, point: Sequence[Fraction]) -> Polynomial:
        """Return its value at a point, a constant with the one exponent ()."""
        F = self
        for axis, t in enumerate(point):
            F = F.at(axis, scalar(t))
        none = [[0] * self.shape[1]] * self.shape[0]
        return Polynomial(self.shape, {(): F.terms.get((), none)}, F.below)

    def _times(self, factor: int) -> dict[Exponents, Rows]:
        return {k: _scaled(rows, factor) for k, rows in self.terms.items()}


def matrix(rows: Sequence[Sequence[Fraction | int]], columns: int) -> Polynomial:
    """Return a constant matrix of that many columns."""
    below = math.lcm(*(v.denominator for row in rows for v in row))
    whole = [[v.numerator * (below // v.denominator) for v in row] for row in rows]
    return Polynomial((len(rows), columns), {(): whole}, below)


def scalar(value: Fraction | int) -> Polynomial:
    """Return a constant scalar."""
    return matrix([[value]], 1)


def variable(axis: int) -> Polynomial:
    """Return the scalar t_axis."""
    return Polynomial((1, 1), {(*(0,) * axis, 1): [[1]]})


def zero(rows: int, columns: int) -> Polynomial:
    """Return the zero matrix."""
    return Polynomial((rows, columns), {})


def diagonal(values: Sequence[Fraction | int]) -> Polynomial:
    """Return the diagonal matrix of these values."""
    n = range(len(values))
    return matrix([[values[i] if i == j else 0 for j in n] for i in n], len(n))


def even(rows: Sequence[Sequence[Fraction]]) -> Polynomial:
    """Return a symmetric matrix; raises `ValueError` for one that is not."""
    if any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)):
        raise ValueError("a matrix of a quadratic form is not symmetric")
    return matrix(rows, len(rows))


def _joined(a: Exponents, b: Exponents) -> Exponents:
    return tuple(x + y for x, y in zip_longest(a, b, fillvalue=0))


def _trimmed(k: Exponents) -> Exponents:
    while k and not k[-1]:
        k = k[:-1]
    return k


def _add(terms: dict[Exponents, Rows], k: Exponents, rows: Rows) -> None:
    if k in terms:
        pairs = zip(terms[k], rows, strict=True)
        rows = [[a + b for a, b in zip(x, y, strict=True)] for x, y in pairs]
    terms[k] = rows


def _scaled(X: Rows, factor: int) -> Rows:
    return X if factor == 1 else [[factor * v for v in row] for row in X]


def combined(scalars: Iterable[Polynomial], matrices: Sequence[Polynomial]) -> Polynomial:
    """Return sum_j f_j M_j of scalar polynomials f_j and matrices M_j; at least one."""
    pairs = list(zip(scalars, matrices, strict=True))
    below = math.lcm(*(f.below * M.below for f, M in pairs))
    terms: dict[Exponents, Rows] = {}
    for f, M in pairs:
        up = below // (f.below * M.below)
        for a, ((c,),) in f.terms.items():
            for b, rows in M.terms.items():
                _add(terms, _joined(a, b), _scaled(rows, up * c))
    return Polynomial(matrices[0].shape, terms, below).reduced()


def block(grid: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Return the matrix of these blocks."""
    below = math.lcm(*(F.below for row in grid for F in row))
    width = sum(F.shape[1] for F in grid[0])
    terms: dict[Exponents, Rows] = {}
    for k in {k for row in grid for F in row for k in F.terms}:
        terms[k] = []
        for row in grid:
            each = [
                _scaled(F.terms.get(k) or [[0] * F.shape[1]] * F.shape[0], below // F.below)
                for F in row
            ]
            terms[k] += [list(chain(*lines)) for lines in zip(*each, strict=True)]
    return Polynomial((sum(row[0].shape[0] for row in grid), width), terms, below)


def symmetric(lower: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Return the symmetric matrix of a lower triangle of blocks."""
    n = range(len(lower))
    return block([[lower[i][j] if j <= i else lower[j][i].T for j in n] for i in n])


def bernstein_functions(degree: int, u: Polynomial) -> list[Polynomial]:
    """Return C(d, i) u^i (1 - u)^(d - i), i = 0 .. d, of a scalar polynomial u."""
    ups, downs, other = [scalar(1)], [scalar(1)], (scalar(1) - u).reduced()
    for _ in range(degree):
        ups.append((ups[-1] @ u).reduced())
        downs.append((downs[-1] @ other).reduced())
    return [ups[i] @ downs[degree - i] * math.comb(degree, i) for i in range(degree + 1)]


def bernstein_coefficients(F: Polynomial, variables: int) -> dict[Exponents, Rows]:
    """Return the Bernstein coefficients on the unit box, times a positive number."""
    padded = {(*k, *(0,) * (variables - len(k))): rows for k, rows in F.terms.items()}
    degrees = [max((k[i] for k in padded), default=0) for i in range(variables)]
    none = [[0] * F.shape[1]] * F.shape[0]
    values = {k: padded.get(k, none) for k in combinations(*(range(d + 1) for d in degrees))}
    for axis, d in enumerate(degrees):
        # b_i = sum_k C(i, k) / C(d, k) a_k
        common = math.lcm(*(math.comb(d, k) for k in range(d + 1)))
        made: dict[Exponents, Rows] = {}
        for place in values if d else ():
            for k in range(place[axis] + 1):
                weight = math.comb(place[axis], k) * common // math.comb(d, k)
                from_k = values[(*place[:axis], k, *place[axis + 1 :])]
                _add(made, place, _scaled(from_k, weight))
        values = made or values
    return values


def first_miss(
    F: Polynomial, variables: int, reached: Callable[[Box], bool] = lambda box: True
) -> tuple[tuple[Fraction, ...], bool] | None:
    """Return (a point where F is not positive definite, whether it is known to be not); None where
    it is positive definite on all boxes that are `reached`.
    """
    whole = ((Fraction(0), Fraction(1)),) * variables
    waiting, looked = [(F.reduced(), whole)], 0
    while waiting:
        own, box = waiting.pop()
        if not reached(box):
            continue
        looked += 1
        values = bernstein_coefficients(own, variables)
        if all(map(shown, values.values())):
            continue
        degrees = max(values)
        corners = [k for k in values if all(e in (0, d) for e, d in zip(k, degrees, strict=True))]
        false = False
        for k in corners:
            point = tuple(ends[e > 0] for e, ends in zip(k, box, strict=True))
            if not positive_definite(values[k]):
                false = True
                if reached(tuple((t, t) for t in point)):
                    return point, True
        # where p is not reached it may be false: the box is made smaller; else along a curved axis
        axes = [i for i, d in enumerate(degrees) if d > 1 or false]
        if not axes:
            continue  # all coefficients are those of corners
        if looked > MOST_BOXES:
            return tuple(a for a, _ in box), False
        axis = max(axes, key=lambda i: box[i][1] - box[i][0])
        a, b = box[axis]
        for side, ends in enumerate(((a, (a + b) / 2), ((a + b) / 2, b))):
            half = own.at(axis, (variable(axis) + scalar(side)) * Fraction(1, 2))
            waiting.append((half, (*box[:axis], ends, *box[axis + 1 :])))
    return None
