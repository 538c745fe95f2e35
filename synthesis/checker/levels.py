"""Worst-case gains of an LFT with constant parameters and blocks of bounded gain, by scalings over
frequency.

x' = A x + B w (sampled: x(k+1)), z = C x + D w, w = Delta z: delta_i I of each parameter, |delta_i|
<= 1, blocks of gain <= 1, and the performance. The loop is stable with Delta = 0, and M(s) is its
response, of a sampled one over s = (z - 1)/(z + 1). The gain of the performance is below g where,
at every s = jv, v in [0, inf],

    W - M* Z M - i (G M - M* G*) > 0

with Z = W > 0 and G = G* of each parameter, Z = d I, W = d I of each block, and W = g^2 d I of the
performance, d > 0. In cells a parameter is c + r delta, and the cells leave no value out.

A complex matrix X + iY is the real one [X -Y; Y X] here: the adjoint is the transpose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from math import prod
from typing import Any, NamedTuple

from . import words
from .demands import Claim, Demand
from .functions import solved
from .polynomials import (
    Polynomial,
    block,
    combined,
    diagonal,
    matrix,
    scalar,
    variable,
    zero,
)
from .reading import INFINITE, Unreadable, array, names, number, parameters, period, whole

Rows = list[list[Fraction]]
Range = tuple[Fraction, Fraction]
MOST_CELLS = 1000


def _times(a: Rows, b: Rows, width: int) -> Rows:
    columns = [[row[j] for row in b] for j in range(width)]
    return [
        [sum((u * v for u, v in zip(x, y, strict=True)), Fraction(0)) for y in columns] for x in a
    ]


def _plus(a: Rows, b: Rows, factor: Fraction | int = 1) -> Rows:
    return [[x + factor * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]


def _complex(X: Polynomial, Y: Polynomial) -> Polynomial:
    return block([[X, -Y], [Y, X]]).reduced()


class Loop(NamedTuple):
    """A, B, C, D, and the sizes of the parts: of parameters, (outputs, inputs) of the others."""

    A: Rows
    B: Rows
    C: Rows
    D: Rows
    reals: Sequence[int]
    full: Sequence[tuple[int, int]]
    sampled: bool

    @property
    def parts(self) -> list[list[Any]]:
        """Rows, columns and kind of each part, as a file has them."""
        found, i, j = [], 0, 0
        for out, into in [*((n, n) for n in self.reals), *self.full]:
            found.append([i, i + out, j, j + into, len(found) < len(self.reals)])
            i, j = i + out, j + into
        return found

    def within(self, cell: Sequence[Range]) -> Loop:
        """Return the loop whose parameters go from -1 to 1 within a cell."""
        owner = [k for k, n in enumerate(self.reals) for _ in range(n)]
        n, x = range(len(owner)), len(self.A)
        c, r = ([(cell[k][1] + sign * cell[k][0]) / 2 for k in owner] for sign in (1, -1))
        left = [[Fraction(i == j) - self.D[i][j] * c[j] for j in n] for i in n]
        z = solved(left, [self.C[i] + self.D[i] for i in n])
        rows = [a + b for a, b in zip(self.A + self.C, self.B + self.D, strict=True)]
        into = [row[: len(owner)] for row in self.B + self.D]
        inner = [[c[i] * v for v in z[i]] for i in n]
        rows = _plus(rows, _times(into, inner, x + len(self.D[0])))
        for i in n:
            rows[x + i] = [r[i] * v for v in rows[x + i]]
        A, C = ([row[:x] for row in own] for own in (rows[:x], rows[x:]))
        B, D = ([row[x:] for row in own] for own in (rows[:x], rows[x:]))
        return self._replace(A=A, B=B, C=C, D=D)

    def response(self) -> tuple[Polynomial, tuple[Polynomial, Polynomial]]:
        """Return N and the real and imaginary part of d with M(jv) = N(v)/d(v)."""
        n, w = len(self.A), len(self.D[0])
        adjugate: Rows = [[Fraction(i == j) for j in range(n)] for i in range(n)]
        below, above = [Fraction(1)], [self.D]  # of s^n, s^(n - 1), ...: det(s I - A), and N
        for k in range(1, n + 1):
            passed = _times(_times(self.C, adjugate, n), self.B, w)
            moved = _times(self.A, adjugate, n)
            below.append(-sum((moved[i][i] for i in range(n)), Fraction(0)) / k)
            above.append(_plus(passed, self.D, below[-1]))
            own = [[below[-1] * (i == j) for j in range(n)] for i in range(n)]
            adjugate = _plus(moved, own)
        each = [matrix(M, w) for M in above]
        powers = [self._power(n - k, k) for k in range(n + 1)]
        N = _complex(*(combined(own, each) for own in zip(*powers, strict=True)))
        a, b = (combined(own, [*map(scalar, below)]) for own in zip(*powers, strict=True))
        return N, (a, b)

    def _power(self, up: int, down: int) -> tuple[Polynomial, Polynomial]:
        """Return s^up at s = jv; sampled (1 + s)^up (1 - s)^down."""
        a, b = scalar(1), scalar(0)
        v, one = variable(0), scalar(1 if self.sampled else 0)
        for turn in [v] * up + ([-v] * down if self.sampled else []):
            a, b = (a @ one - b @ turn).reduced(), (a @ turn + b @ one).reduced()
        return a, b

    @property
    def stable(self) -> bool:
        """Whether d(s) has its degree and all roots left of the axis, by Routh's array."""
        d, values = self.response()[1], []
        for k in range(len(self.A), -1, -1):  # d(jv) = sum a_k (jv)^k
            rows = d[k % 2].terms.get((k,) if k else (), [[0]])
            values.append(Fraction(rows[0][0] * (-1) ** (k // 2), d[k % 2].below))
        first, second = values[::2], values[1::2]
        if not values[0]:
            return False
        while second:
            if second[0] * values[0] <= 0:
                return False
            more = [*second[1:], Fraction(0)]
            ratio = first[0] / second[0]
            first, second = second, [a - ratio * b for a, b in zip(first[1:], more, strict=False)]
        return True


def _read(content: Any) -> tuple[Loop, list[str]]:
    """Return the loop of a file, and the hypotheses in words."""
    lft, given = content["model"], content["blocks"]
    if lft["type"] != "LFT":
        raise Unreadable("a worst-case gain is checked of an LFT, another model is not known")
    if "copies" not in content:
        raise Unreadable(
            "the proof is of fewer copies of a parameter than the model in the file has, and this"
            " checker reduces none: save the gain of model.reduce()"
        )
    ranges = [each["scheduling"] for each in lft["blocks"]]
    motion = parameters(ranges) if ranges else ()
    sizes = [whole(each["size"], "the size of a block", 1, 10**3) for each in lft["blocks"]]
    x, u, y = (names(lft[name]) for name in ("states", "inputs", "outputs"))
    n, k, dt = sum(sizes), len(x), period(lft["dt"])
    M11, M12, M21, M22 = (
        array(lft[f"M{i}{j}"], "the LFT", rows, width)
        for i, rows in ((1, n), (2, k + len(y)))
        for j, width in ((1, n), (2, k + len(u)))
    )
    into, out, full, said = [], [], [], []
    for each in given:
        if each["weight"] is not None:
            raise Unreadable("a block with a weight is not known to this checker")
        i, j = [u.index(name) for name in each["inputs"]], [y.index(s) for s in each["outputs"]]
        bound = number(each["bound"], "the bound of a block")
        if bound <= 0:
            raise Unreadable("the file is damaged: the bound of a block is not above zero")
        size = f"{len(j)} by {len(i)} of gain <= {float(bound)!r}"
        said.append(f"stable linear time-invariant dynamics of {size}")
        into, out = into + i, out + [(row, bound) for row in j]
        full.append((len(j), len(i)))
    if len({*into}) < len(into) or len({row for row, _ in out}) < len(out):
        raise Unreadable("the file is damaged: a signal belongs to two blocks")
    w, z = (
        [i for i in range(len(s)) if i not in own]
        for s, own in ((u, into), (y, [r for r, _ in out]))
    )
    into, out = into + w, out + [(row, Fraction(1)) for row in z]
    unit = array(content["copies"], "units of the copies", n)
    if any(v <= 0 for v in unit) or not (w and z):
        raise Unreadable("the file is damaged: units not above zero, or no performance")
    reach = [_reach(own) for own, size in zip(ranges, sizes, strict=True) for _ in range(size)]
    rows = [
        *(
            (M22[i][:k], [M21[i][a] / unit[a] for a in range(n)], M22[i], Fraction(1))
            for i in range(k)
        ),
        *(
            (M12[i][:k], [M11[i][a] / unit[a] for a in range(n)], M12[i], reach[i] * unit[i])
            for i in range(n)
        ),
        *(
            (M22[k + i][:k], [M21[k + i][a] / unit[a] for a in range(n)], M22[k + i], s)
            for i, s in out
        ),
    ]
    left = [[s * v for v in own] for own, _, _, s in rows]
    right = [
        [s * v for v in [*inner, *(whole[k + j] for j in into)]] for _, inner, whole, s in rows
    ]
    still = [p._replace(rate=Fraction(0), tie=None) for p in motion]
    words_said = [*words.model(k, len(w), len(z), dt, still), *said]
    own = Loop(
        left[:k], right[:k], left[k:], right[k:], sizes, [*full, (len(z), len(w))], dt is not None
    )
    return own, words_said


def _reach(own: Any) -> Fraction:
    """Return the largest |delta| of a range, middle and radius rounded as the model has them."""
    low, high = float(own["low"]), float(own["high"])
    middle, radius = Fraction(0.5 * (low + high)), Fraction(0.5 * (high - low))
    return max(Fraction(high) - middle, middle - Fraction(low)) / radius


class Proof(NamedTuple):
    """The scalings of one cell."""

    cell: Sequence[Range]
    level: Fraction
    rows: Sequence[Fraction]
    columns: Sequence[Fraction]
    intervals: Any

    @classmethod
    def read(cls, loop: Loop, content: Any, cell: Sequence[Range]) -> Proof:
        """Return the proof of a cell; raise `Unreadable` where it is of another loop."""
        if content["parts"] != loop.parts or content["performance"] is not True:
            raise Unreadable("the proof is not one of the blocks of the model")
        height, width = len(loop.C), len(loop.D[0])
        rows, columns = (
            array(content["rows"], "rows", height),
            array(content["columns"], "columns", width),
        )
        return cls(cell, number(content["level"], "a level"), rows, columns, content["intervals"])

    def refused(self, loop: Loop, bound: Fraction) -> str:
        """Return why the units and intervals prove nothing of the bound; empty where they may."""
        for k, (i, e, j, f, _) in enumerate(loop.parts):
            rows, columns = {*self.rows[i:e]}, {*self.columns[j:f]}
            if len(rows) != 1 or len(columns) != 1 or min(rows | columns) <= 0:
                return "units of a block are not one number above zero"
            unit = min(rows) * min(columns)
            if k < len(loop.parts) - 1 and unit != 1:
                return "units change the size of a block"
            if k == len(loop.parts) - 1 and not 0 < self.level <= bound * unit:
                return "the level of a cell is above the bound"
        ends = sorted((number(low, "a frequency"), _end(high)) for low, high, *_ in self.intervals)
        if any(low < 0 or (high != ENDLESS and high < low) for low, high in ends):
            return "an interval is none of frequencies from 0 on"
        highest = Fraction(0)
        for low, high in ends:
            if highest is not None and low > highest:
                return "the intervals leave frequencies out"
            if highest is not None:
                highest = None if high == ENDLESS else max(highest, high)
        return "" if ends and highest is None else "the intervals end at a frequency"

    def demands(self, loop: Loop) -> Iterator[Demand]:
        """Yield the inequalities of every interval."""
        own = loop.within(self.cell)
        if not own.stable:
            never = matrix([[Fraction(-1)]], 1)
            yield Demand("the loop is stable at the middle of its cell", never)
            return
        N, (a, b) = own.response()
        size, width = (a @ a + b @ b).reduced(), len(own.D[0])
        left, right = (
            _complex(diagonal(v), zero(len(v), len(v))) for v in (self.rows, self.columns)
        )
        N = left @ N @ right
        eye = diagonal([1] * width)
        turned = _complex(combined([b], [eye]), combined([a], [eye]))  # i times the conjugate of d
        for low, high, *by in self.intervals:
            Z, W, G = self._scalings(own, by)
            where = (
                f"from {float(low)!r} to {'inf' if high == INFINITE else repr(float(high))} rad/s"
            )
            for name, M in (("Z", Z), ("W", W)):
                yield Demand(f"{name} > 0 {where}", M)
            T = turned @ G @ N
            H = combined([size], [W]) - N.T @ Z @ N - T - T.T
            yield Demand(
                f"the scalings hold {where}", _onto(H, number(low, "a"), _end(high)), None, None, 1
            )

    def _scalings(self, loop: Loop, by: Sequence[Any]) -> tuple[Polynomial, Polynomial, Polynomial]:
        height, width = len(loop.C), len(loop.D[0])
        shapes = (height, height), (width, width), (width, height)
        Z, W, G = (
            [array(part, "a scaling", *shape) for part in own]
            for own, shape in zip(by, shapes, strict=True)
        )
        parts = loop.parts
        for name, own, first, second in (("Z", Z, 0, 0), ("W", W, 2, 2), ("G", G, 2, 0)):
            _commutes(name, own, parts, first, second)
        for i, e, j, f, real in parts:
            same = all(
                [row[i:e] for row in z[i:e]] == [row[j:f] for row in w[j:f]]
                for z, w in zip(Z, W, strict=True)
            )
            if not (same if real else Z[0][i][i] == W[0][j][j]):
                raise Unreadable("the file is damaged: Z and W of a block differ")
        j, f = parts[-1][2:4]
        level = [self.level**2 if j <= i < f else Fraction(1) for i in range(width)]
        W = [[[s * v for v in row] for s, row in zip(level, part, strict=True)] for part in W]
        found = [
            _complex(matrix(X, shape[1]), matrix(Y, shape[1]))
            for (X, Y), shape in zip((Z, W, G), shapes, strict=True)
        ]
        return found[0], found[1], found[2]


ENDLESS = Fraction(-1)
"""In place of an end at infinity."""


def _end(value: Any) -> Fraction:
    if value == INFINITE:
        return ENDLESS
    found = number(value, "a frequency")
    if found < 0:
        raise Unreadable("the file is damaged: a frequency is below zero")
    return found


def _commutes(name: str, own: list[Rows], parts: list[list[Any]], first: int, second: int) -> None:
    """Raise `Unreadable` for a scaling that does not commute with the blocks, or is not Hermitian
    in each.
    """
    inside = {}
    for part in parts:
        square = name != "G" or part[4]
        for i in range(part[first], part[first + 1]):
            for j in range(part[second], part[second + 1]) if square else ():
                a, b = i - part[first], j - part[second]
                inside[i, j] = (part[first] + b, part[second] + a)
                if not part[4]:
                    value = own[0][part[first]][part[second]] if a == b else 0
                    if own[0][i][j] != value or own[1][i][j]:
                        raise Unreadable(f"the file is damaged: {name} of a block is no number")
    for i, row in enumerate(own[0]):
        for j, value in enumerate(row):
            other = inside.get((i, j))
            if other is None:
                fits = value == 0 and own[1][i][j] == 0
            else:
                fits = (
                    own[0][other[0]][other[1]] == value
                    and own[1][other[0]][other[1]] == -own[1][i][j]
                )
            if not fits:
                raise Unreadable(f"the file is damaged: {name} does not commute with the blocks")


def _onto(H: Polynomial, low: Fraction, high: Fraction) -> Polynomial:
    """Return H on the interval as a polynomial on [0, 1], to infinity times a power of 1 - t."""
    t = variable(0)
    if high != ENDLESS:
        return H.at(0, scalar(low) + t * (high - low)).reduced()
    degree, down = max((k[0] for k in H.terms if k), default=0), (scalar(1) - t).reduced()
    pace = low if low else Fraction(1)
    up = (down * low + t * pace).reduced()
    powers = [(scalar(1), scalar(1))]
    for _ in range(degree):
        powers.append(((powers[-1][0] @ up).reduced(), (powers[-1][1] @ down).reduced()))
    each = [(k[0] if k else 0, rows) for k, rows in H.terms.items()]
    factors = [(powers[k][0] @ powers[degree - k][1]).reduced() for k, _ in each]
    return combined(factors, [Polynomial(H.shape, {(): rows}, H.below) for _, rows in each])


def _cells(content: Any, count: int) -> list[tuple[Sequence[Range], Any]]:
    if "cells" not in content:
        return [([(Fraction(-1), Fraction(1))] * count, content)]
    found = []
    for each in content["cells"]:
        low, high = ([number(v, "the end of a cell") for v in each[end]] for end in ("low", "high"))
        if not len(low) == len(high) == count:
            raise Unreadable("the file is damaged: a cell is none of these parameters")
        found.append(([*zip(low, high, strict=True)], each))
    if len(found) > MOST_CELLS:
        raise Unreadable("there are more cells than this checker looks at")
    return found


def _left_out(cells: Sequence[Sequence[Range]], count: int) -> str:
    """Return why boxes do not cover [-1, 1]^m; empty where they do."""
    if any(not -1 <= a < b <= 1 for cell in cells for a, b in cell):
        return "a cell is not within the ranges"
    for one, other in combinations(cells, 2):
        if all(max(a, c) < min(b, d) for (a, b), (c, d) in zip(one, other, strict=True)):
            return "two cells have points in common"
    volume = sum(prod((b - a for a, b in cell), start=Fraction(1)) for cell in cells)
    return "" if volume == 2**count else "the cells leave values of the parameters out"


def claimed(content: Mapping[str, Any]) -> Claim:
    """Return what a file of a worst-case gain claims."""
    loop, said = _read(content)
    bound = number(content["bound"], "the bound")
    cells = _cells(content, len(loop.reals))
    proofs = [Proof.read(loop, own, cell) for cell, own in cells]
    refused = _left_out([cell for cell, _ in cells], len(loop.reals))
    for proof in proofs:
        refused = refused or proof.refused(loop, bound)
    size = repr(float(bound))
    claim = f"the energy gain of every member is below {size}: |y|_2 < {size} |u|_2 from rest"

    def demands() -> Iterator[Demand]:
        for proof in proofs:
            yield from proof.demands(loop)

    return Claim(claim, said, demands(), bound, refused=refused)
