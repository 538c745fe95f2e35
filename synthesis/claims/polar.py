"""Polynomials on the rays of a box, in Bernstein form with integer coefficients.

A point x other than zero is diag(units) r y: y on a face y_i = +-1 of the unit box, r > 0. Then
V = r^k times a polynomial in (y, r), k the degree of its lowest terms: its sign is decided on all
of 0 <= r <= 1, the neighbourhood of zero too; and with r = 1/s on all of the outside.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product
from math import comb
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.claims.monomials import Monomials, degree, least_degree
from synthesis.numerics.polynomial.exact import whole

Box = tuple[tuple[Fraction, Fraction], ...]
MOST_CELLS = 20_000
"""Boxes that are looked at before a question is left undecided."""


class Face(NamedTuple):
    """The face z_axis = sign of the unit box; (y, r) run over [0, 1]^n, y = 2 t - 1 each."""

    axis: int
    sign: int

    def point(self, t: Sequence[Fraction], units: Sequence[Fraction]) -> list[Fraction]:
        """Return x = diag(units) r y of a point of [0, 1]^n."""
        y = [2 * v - 1 for v in t[:-1]]
        y.insert(self.axis, Fraction(self.sign))
        return [u * t[-1] * v for u, v in zip(units, y, strict=True)]


def faces(n: int) -> Iterator[Face]:
    """Yield all faces of the unit box."""
    for axis, sign in product(range(n), (-1, 1)):
        yield Face(axis, sign)


def inside(F: Monomials, face: Face, lowered: bool = True) -> Array:
    """Return the Bernstein coefficients of F(r y) in (t, r), over r^k where it is `lowered`, times
    a positive number.
    """
    less = least_degree(F) if lowered else 0
    return _bernstein({_turned(e, face, sum(e) - less): _signed(e, c, face) for e, c in F.items()})


def outside(F: Monomials, face: Face) -> Array:
    """Return the Bernstein coefficients of s^d F(y/s) in (t, s), d the degree of F, times a
    positive number.
    """
    most = degree(F)
    return _bernstein({_turned(e, face, most - sum(e)): _signed(e, c, face) for e, c in F.items()})


def _turned(e: tuple[int, ...], face: Face, radial: int) -> tuple[int, ...]:
    """Return the exponents of (y, r), of which y_axis is left out; it tells the sign only."""
    return (*e[: face.axis], *e[face.axis + 1 :], radial, e[face.axis])


def _signed(e: tuple[int, ...], c: Fraction, face: Face) -> Fraction:
    return c if face.sign > 0 or e[face.axis] % 2 == 0 else -c


def _bernstein(terms: dict[tuple[int, ...], Fraction]) -> Array:
    n = len(next(iter(terms))) - 1
    degrees = [max(e[i] for e in terms) for i in range(n)]
    c = np.zeros([d + 1 for d in degrees], dtype=object)
    for (*e, _), value in terms.items():
        c[tuple(e)] += value
    for axis, d in enumerate(degrees):
        change = _of_powers(d) if axis == n - 1 else _of_powers(d) @ _centred(d)
        moved = np.moveaxis(c, axis, 0)
        c = np.moveaxis(np.tensordot(change, moved, axes=(1, 0)), 0, axis)
    return whole(np.asarray(c, dtype=object))[0]


def _of_powers(d: int) -> Array:
    """Return the matrix from powers of t to Bernstein coefficients on [0, 1]."""
    out = np.zeros((d + 1, d + 1), dtype=object)
    for i, k in product(range(d + 1), repeat=2):
        out[i, k] = Fraction(comb(i, k), comb(d, k)) if k <= i else Fraction(0)
    return out


def _centred(d: int) -> Array:
    """Return the matrix from powers of y = 2 t - 1 to powers of t."""
    out = np.zeros((d + 1, d + 1), dtype=object)
    for k in range(d + 1):
        for j in range(k + 1):
            out[j, k] = comb(k, j) * 2**j * (-1) ** (k - j)
    return out


Judge = Callable[[list[bool]], bool]
"""Whether a box is settled, from which polynomials are positive on it."""


Corner = Callable[[list[int], tuple[Fraction, ...]], int]
"""The meaning of the signs of all polynomials at a corner: `FAILS`, `TOUCHES` where one
is zero that has to be positive, or 0.
"""
FAILS, TOUCHES = 2, 1
MORE = 60
"""Boxes that are looked at after a corner touched."""


NARROW = Fraction(1, 2**24)
"""Width of a box, of one, in all directions below which it is not halved again."""


class Open(NamedTuple):
    """A point of [0, 1]^n that settles the question in the negative, or (`certain` False) one at
    which it is undecided.
    """

    point: tuple[Fraction, ...]
    certain: bool


def first_open(
    tensors: Sequence[Array],
    settled: Judge,
    at_corner: Corner,
    cells: int,
) -> tuple[Open | None, int]:
    """Halve [0, 1]^n until every box is `settled`; return where that failed, and the number of
    boxes.
    """
    n = tensors[0].ndim
    waiting: deque[tuple[list[Array], Box]] = deque(
        [([*tensors], ((Fraction(0), Fraction(1)),) * n)]
    )
    looked, touched = 0, None
    while waiting:
        own, box = waiting.popleft()
        looked += 1
        positive = [bool(np.all(c > 0)) for c in own]
        if settled(positive):
            continue
        if looked > cells or all(b - a < NARROW for a, b in box):
            return Open(touched or tuple((a + b) / 2 for a, b in box), False), looked
        for corner in product((0, -1), repeat=n):
            point = tuple(ends[i] for ends, i in zip(box, corner, strict=True))
            said = at_corner([_sign(c[corner]) for c in own], point)
            if said == FAILS:
                return Open(point, True), looked
            if said == TOUCHES and touched is None:
                touched, cells = point, min(cells, looked + MORE)
        axis = _axis([c for c, good in zip(own, positive, strict=True) if not good])
        a, b = box[axis]
        halves = [bisected(c, axis) for c in own]
        for side, ends in enumerate(((a, (a + b) / 2), ((a + b) / 2, b))):
            part = (*box[:axis], ends, *box[axis + 1 :])
            waiting.append(([pair[side] for pair in halves], part))
    return None, looked


def _sign(value: Any) -> int:
    return int(value > 0) - int(value < 0)


def _axis(tensors: Sequence[Array]) -> int:
    """Return the axis along which the polynomials vary most, each over its size."""
    n = tensors[0].ndim
    vary = np.zeros(n)
    for c in tensors:
        shift = max(int(np.abs(c).max()).bit_length() - 900, 0)
        numbers = np.array([float(v >> shift) for v in c.ravel()]).reshape(c.shape)
        size = np.abs(numbers).max() or 1.0
        for i in range(n):
            if c.shape[i] > 1:
                vary[i] = max(vary[i], np.abs(np.diff(numbers, axis=i)).sum(axis=i).max() / size)
    return int(np.argmax(vary))


def bisected(c: Array, axis: int) -> tuple[Array, Array]:
    """Return the coefficients on both halves of an axis, integers times a power of two."""
    row = np.moveaxis(c, axis, 0)
    d = len(row) - 1
    # of one axis the entries are integers, which must not become doubles or machine integers
    left, right = np.empty(row.shape, dtype=object), np.empty(row.shape, dtype=object)
    for k in range(d + 1):
        left[k], right[d - k] = row[0] * 2 ** (d - k), row[-1] * 2 ** (d - k)
        row = row[1:] + row[:-1]
    return np.moveaxis(left, 0, axis), np.moveaxis(right, 0, axis)
