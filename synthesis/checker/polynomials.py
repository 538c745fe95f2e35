"""Matrices of polynomials on the unit box, exactly: F(t) = sum_k t^k F_k, t in [0, 1]^m, in powers
of t; and whether one is positive definite on all of the box, by Bernstein coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import product as combinations
from typing import NamedTuple

from .exact import Rows, positive_definite, product, shown, transposed

Exponents = tuple[int, ...]
Box = tuple[tuple[Fraction, Fraction], ...]

MOST_BOXES = 4000
"""Boxes that are looked at before a polynomial is left undecided."""


class Whole(NamedTuple):
    """A matrix of rationals: integers over one positive number."""

    rows: Rows
    below: int

    @classmethod
    def of(cls, rows: Sequence[Sequence[Fraction]]) -> Whole:
        """Return the matrix of these rationals."""
        below = math.lcm(*(v.denominator for row in rows for v in row))
        return cls([[v.numerator * (below // v.denominator) for v in row] for row in rows], below)


class Polynomial:
    """A matrix (shape) of polynomials in `variables` variables: {exponents: integers} over `below`.

    A scalar one has the shape (1, 1).
    """

    def __init__(
        self, shape: tuple[int, int], variables: int, terms: dict[Exponents, Rows], below: int = 1
    ) -> None:
        self.shape, self.variables, self.terms, self.below = shape, variables, terms, below

    @classmethod
    def constant(cls, value: Whole, columns: int, variables: int) -> Polynomial:
        """Return a constant matrix of that many columns."""
        shape = (len(value.rows), columns)
        return cls(shape, variables, {(0,) * variables: value.rows}, value.below)

    @classmethod
    def number(cls, value: Fraction | int, variables: int) -> Polynomial:
        """Return a constant scalar."""
        return cls.constant(Whole.of([[Fraction(value)]]), 1, variables)

    @classmethod
    def identity(cls, size: int, variables: int) -> Polynomial:
        """Return the identity."""
        rows = [[int(i == j) for j in range(size)] for i in range(size)]
        return cls((size, size), variables, {(0,) * variables: rows})

    @classmethod
    def zero(cls, rows: int, columns: int, variables: int) -> Polynomial:
        """Return the zero matrix."""
        return cls((rows, columns), variables, {})

    @classmethod
    def variable(cls, axis: int, variables: int) -> Polynomial:
        """Return the scalar t_axis."""
        return cls((1, 1), variables, {tuple(int(i == axis) for i in range(variables)): [[1]]})

    def __add__(self, other: Polynomial) -> Polynomial:
        below = math.lcm(self.below, other.below)
        terms = dict(self._times(below // self.below))
        for k, rows in other._times(below // other.below).items():
            terms[k] = _sum(terms[k], rows) if k in terms else rows
        return Polynomial(self.shape, self.variables, terms, below)

    def __neg__(self) -> Polynomial:
        return Polynomial(self.shape, self.variables, self._times(-1), self.below)

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + -other

    def __mul__(self, factor: Fraction | int) -> Polynomial:
        factor = Fraction(factor)
        terms = self._times(factor.numerator) if factor else {}
        return Polynomial(self.shape, self.variables, terms, self.below * factor.denominator)

    def __matmul__(self, other: Polynomial) -> Polynomial:
        terms: dict[Exponents, Rows] = {}
        for a, left in self.terms.items() if self.shape[1] else ():
            for b, right in other.terms.items():
                key = tuple(map(sum, zip(a, b, strict=True)))
                rows = product(left, right) if other.shape[1] else [[] for _ in left]
                terms[key] = _sum(terms[key], rows) if key in terms else rows
        shape = (self.shape[0], other.shape[1])
        return Polynomial(shape, self.variables, terms, self.below * other.below)

    def times(self, scalar: Polynomial) -> Polynomial:
        """Return the product with a scalar polynomial."""
        return combined([scalar], [self])

    def power(self, exponent: int) -> Polynomial:
        """Return a scalar raised to a power."""
        out = Polynomial.number(1, self.variables)
        for _ in range(exponent):
            out = out @ self
        return out.reduced()

    @property
    def T(self) -> Polynomial:
        """The transpose."""
        terms = {k: transposed(rows, self.shape[1]) for k, rows in self.terms.items()}
        return Polynomial(self.shape[::-1], self.variables, terms, self.below)

    def part(self, rows: Sequence[int], columns: Sequence[int]) -> Polynomial:
        """Return some rows and columns."""
        terms = {k: [[M[i][j] for j in columns] for i in rows] for k, M in self.terms.items()}
        return Polynomial((len(rows), len(columns)), self.variables, terms, self.below)

    def rows(self, which: Sequence[int]) -> Polynomial:
        """Return some rows."""
        return self.part(which, range(self.shape[1]))

    def columns(self, which: Sequence[int]) -> Polynomial:
        """Return some columns."""
        return self.part(range(self.shape[0]), which)

    def derivative(self, axis: int) -> Polynomial:
        """Return the derivative by t_axis."""
        terms = {
            (*k[:axis], k[axis] - 1, *k[axis + 1 :]): _scaled(rows, k[axis])
            for k, rows in self.terms.items()
            if k[axis]
        }
        return Polynomial(self.shape, self.variables, terms, self.below)

    def reduced(self) -> Polynomial:
        """Return the same in the least integers, without terms that are zero."""
        common = self.below
        for rows in self.terms.values():
            common = math.gcd(common, *(v for row in rows for v in row))
        terms = {
            k: [[v // common for v in row] for row in rows]
            for k, rows in self.terms.items()
            if any(any(row) for row in rows)
        }
        return Polynomial(self.shape, self.variables, terms, self.below // common)

    @property
    def varies(self) -> bool:
        """Whether it is more than a constant."""
        return any(any(k) for k in self.reduced().terms)

    @property
    def vanishes(self) -> bool:
        """Whether it is zero."""
        return not self.reduced().terms

    def at(self, point: Sequence[Fraction]) -> list[list[Fraction]]:
        """Return its value."""
        out = [[Fraction(0)] * self.shape[1] for _ in range(self.shape[0])]
        for k, rows in self.terms.items():
            weight = Fraction(1, self.below)
            for t, e in zip(point, k, strict=True):
                weight *= t**e
            for own, row in zip(out, rows, strict=True):
                for j, v in enumerate(row):
                    own[j] += weight * v
        return out

    def _times(self, factor: int) -> dict[Exponents, Rows]:
        if factor == 1:
            return self.terms
        return {k: _scaled(rows, factor) for k, rows in self.terms.items()}


def _sum(X: Rows, Y: Rows) -> Rows:
    return [[a + b for a, b in zip(x, y, strict=True)] for x, y in zip(X, Y, strict=True)]


def _scaled(X: Rows, factor: int) -> Rows:
    return [[factor * v for v in row] for row in X]


def combined(scalars: Sequence[Polynomial], matrices: Sequence[Polynomial]) -> Polynomial:
    """Return sum_j f_j M_j of scalar polynomials f_j and matrices M_j; at least one."""
    shape, variables = matrices[0].shape, matrices[0].variables
    below = math.lcm(*(f.below * M.below for f, M in zip(scalars, matrices, strict=True)))
    terms: dict[Exponents, Rows] = {}
    for f, M in zip(scalars, matrices, strict=True):
        up = below // (f.below * M.below)
        for a, ((c,),) in f.terms.items():
            for b, rows in M.terms.items():
                key = tuple(map(sum, zip(a, b, strict=True)))
                own = _scaled(rows, up * c)
                terms[key] = _sum(terms[key], own) if key in terms else own
    return Polynomial(shape, variables, terms, below).reduced()


def block(grid: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Return the matrix of these blocks."""
    first = grid[0][0]
    below = math.lcm(*(F.below for row in grid for F in row))
    heights, widths = [row[0].shape[0] for row in grid], [F.shape[1] for F in grid[0]]
    keys = {k for row in grid for F in row for k in F.terms}
    terms = {}
    for k in keys:
        out: Rows = []
        for row, height in zip(grid, heights, strict=True):
            strip: Rows = [[] for _ in range(height)]
            for F, width in zip(row, widths, strict=True):
                up = below // F.below
                rows = F.terms.get(k)
                for i, line in enumerate(strip):
                    line += [up * v for v in rows[i]] if rows else [0] * width
            out += strip
        terms[k] = out
    return Polynomial((sum(heights), sum(widths)), first.variables, terms, below)


def symmetric(lower: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Return the symmetric matrix of a lower triangle of blocks."""
    n = len(lower)
    return block([[lower[i][j] if j <= i else lower[j][i].T for j in range(n)] for i in range(n)])


def bernstein_functions(degree: int, u: Polynomial) -> list[Polynomial]:
    """Return C(d, i) u^i (1 - u)^(d - i), i = 0 .. d, of a scalar polynomial u."""
    one = Polynomial.number(1, u.variables)
    other = (one - u).reduced()
    ups, downs = [one], [one]
    for _ in range(degree):
        ups.append((ups[-1] @ u).reduced())
        downs.append((downs[-1] @ other).reduced())
    return [ups[i] @ downs[degree - i] * math.comb(degree, i) for i in range(degree + 1)]


class Coefficients(NamedTuple):
    """The Bernstein coefficients (count_1, .., count_m) of a symmetric matrix times a positive
    number: the lower triangles, one after the other, and the box they stand on.
    """

    counts: tuple[int, ...]
    values: dict[Exponents, list[int]]
    box: Box

    @property
    def corners(self) -> Iterator[Exponents]:
        """The indices of the values at the corners."""
        return combinations(*({0, n - 1} for n in self.counts))

    def point(self, corner: Exponents) -> tuple[Fraction, ...]:
        """Return the point of a corner."""
        return tuple(ends[bool(k)] for k, ends in zip(corner, self.box, strict=True))

    def along(self, axis: int, change: Callable[[list[list[int]]], list[list[int]]]) -> Coefficients:
        """Return the coefficients with every line of them along an axis changed."""
        others = [range(1) if i == axis else range(n) for i, n in enumerate(self.counts)]
        values = {}
        for k in combinations(*others):
            places = [(*k[:axis], i, *k[axis + 1 :]) for i in range(self.counts[axis])]
            line = change([self.values[place] for place in places])
            values.update(zip(places, line, strict=True))
        return self._replace(values=values)

    def halves(self, axis: int) -> Iterator[Coefficients]:
        """Yield those of both halves, by de Casteljau's algorithm times 2^degree."""
        a, b = self.box[axis]
        middle = (a + b) / 2
        for side, ends in ((0, (a, middle)), (1, (middle, b))):
            own = self.along(axis, _left_half if side == 0 else _right_half)
            yield own._replace(box=(*self.box[:axis], ends, *self.box[axis + 1 :]))

    def most_curved(self) -> int | None:
        """Return the axis along which the coefficients deviate most from a straight line; None
        where they are straight along all.
        """
        best, found = 0, None
        for axis, count in enumerate(self.counts):
            for k, own in self.values.items():
                if not 0 < k[axis] < count - 1:
                    continue
                before, after = (
                    self.values[(*k[:axis], k[axis] + step, *k[axis + 1 :])] for step in (-1, 1)
                )
                bend = max(
                    abs(a + c - 2 * b) for a, b, c in zip(before, own, after, strict=True)
                )
                if bend > best:
                    best, found = bend, axis
        return found


def _left_half(line: list[list[int]]) -> list[list[int]]:
    degree, out = len(line) - 1, []
    for k in range(degree + 1):
        out.append([v << (degree - k) for v in line[0]])
        line = [
            [a + b for a, b in zip(x, y, strict=True)]
            for x, y in zip(line, line[1:], strict=False)
        ]
    return out


def _right_half(line: list[list[int]]) -> list[list[int]]:
    return _left_half(line[::-1])[::-1]


def coefficients(F: Polynomial) -> Coefficients:
    """Return the Bernstein coefficients of a symmetric F on the unit box."""
    F = F.reduced()
    n = F.shape[0]
    counts = tuple(1 + max((k[i] for k in F.terms), default=0) for i in range(F.variables))
    none = [0] * (n * (n + 1) // 2)
    values = {
        k: [v for i, row in enumerate(F.terms[k]) for v in row[: i + 1]] if k in F.terms else none
        for k in combinations(*map(range, counts))
    }
    out = Coefficients(counts, values, ((Fraction(0), Fraction(1)),) * F.variables)
    for axis, count in enumerate(counts):
        if count > 1:
            out = out.along(axis, _from_powers)
    return out


def _from_powers(line: list[list[int]]) -> list[list[int]]:
    """Return b_i = sum_k C(i, k) / C(d, k) a_k, times what makes them whole."""
    d = len(line) - 1
    common = math.lcm(*(math.comb(d, k) for k in range(d + 1)))
    out = []
    for i in range(d + 1):
        weights = [math.comb(i, k) * (common // math.comb(d, k)) for k in range(i + 1)]
        out.append(
            [sum(w * v for w, v in zip(weights, entry, strict=False)) for entry in zip(*line)]
        )
    return out


def square(lower: Sequence[int]) -> Rows:
    """Return the symmetric matrix of a lower triangle."""
    n = (math.isqrt(8 * len(lower) + 1) - 1) // 2
    starts = [i * (i + 1) // 2 for i in range(n)]
    return [
        [lower[starts[max(i, j)] + min(i, j)] for j in range(n)] for i in range(n)
    ]


class Miss(NamedTuple):
    """Where a polynomial is not shown to be positive definite: a point of the unit box, and whether
    it is false there or only undecided.
    """

    point: tuple[Fraction, ...]
    false: bool


def first_miss(F: Polynomial, reached: Callable[[Box], bool] = lambda box: True) -> Miss | None:
    """Return where F is not positive definite; None where it is on all boxes that are `reached`."""
    waiting, looked = [coefficients(F)], 0
    while waiting:
        own = waiting.pop()
        if not reached(own.box):
            continue
        looked += 1
        if _all_shown(own.values.values()):
            continue
        false = [k for k in own.corners if not positive_definite(square(own.values[k]))]
        for k in false:
            point = own.point(k)
            if reached(tuple((t, t) for t in point)):
                return Miss(point, True)
        axis = own.most_curved()
        if not false and axis is None:
            continue  # all coefficients lie between the corners
        if false or axis is None:
            # outside of what is reached it may be false: make the box smaller
            axis = max(range(len(own.box)), key=lambda i: own.box[i][1] - own.box[i][0])
        if looked > MOST_BOXES:
            return Miss(own.point(next(own.corners)), False)
        waiting += own.halves(axis)
    return None


def _all_shown(values: Iterable[list[int]]) -> bool:
    return all(shown(square(lower)) for lower in values)
