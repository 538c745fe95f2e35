"""Signals of a loop as rows on its states and inputs, and quadratic forms of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from .reading import Unreadable, array, number, period, whole

Row = list[Fraction]
MOST = 10**4


class Loop:
    """Signals as rows on (x, w): `motion` are those of dx/dt, or of the next x."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        """Read the model; states of lags are added later."""
        rows = [array(content[k], k, None, None) for k in "ABCD"]
        A, B, C, D = rows
        n, m, p = len(A), len(B[0]) if B else len(D[0]), len(C)
        shapes = ((A, n, n), (B, n, m), (C, p, n), (D, p, m))
        if any(len(M) != a or any(len(row) != b for row in M) for M, a, b in shapes):
            raise Unreadable("the file is damaged: the matrices of the model do not fit")
        self.A, self.B, self.C, self.D, self.dt = A, B, C, D, period(content["dt"])
        self.lags = sum(_states(each) for each in content["blocks"])
        self.n, self.m, self.own = n + self.lags, m, n
        self.size, self.used = self.n + m, n
        self.motion = [self.wide(A[i], B[i]) for i in range(n)]

    def wide(self, x: Sequence[Fraction], w: Sequence[Fraction]) -> Row:
        """Return a signal of the model's states and inputs."""
        return [*x, *[Fraction(0)] * self.lags, *w]

    def output(self, j: int) -> Row:
        """Return an output."""
        return self.wide(self.C[j], self.D[j])

    def input(self, i: int) -> Row:
        """Return an input."""
        return [Fraction(k == self.n + i) for k in range(self.size)]

    def slope(self, j: int) -> Row:
        """Return the derivative of an output."""
        if self.dt is not None or any(self.D[j]):
            raise Unreadable("an output with feedthrough, or a sampled one, has no derivative")
        return added((c, self.motion[i]) for i, c in enumerate(self.C[j]))

    def state(self, motion: Row) -> Row:
        """Return a new state, its motion without the state itself."""
        self.motion.append(motion)
        self.used += 1
        return [Fraction(k == self.used - 1) for k in range(self.size)]

    def lagged(self, signal: Row, pole: Fraction) -> Row:
        """Return a lag of a signal."""
        stay, enter = (pole, 1 - pole) if self.dt else (-pole, pole)
        own = self.state([enter * v for v in signal])
        self.motion[-1] = added([(Fraction(1), self.motion[-1]), (stay, own)])
        return own


def added(terms: Any, size: int = 0) -> Row:
    """Return the sum of (factor, signal)."""
    out: Row = []
    for factor, row in terms:
        out = out or [Fraction(0)] * len(row)
        if factor:
            out = [a + factor * b for a, b in zip(out, row, strict=True)]
    return out


class Form:
    """The sum of forms, as a symmetric matrix on (x, w)."""

    def __init__(self, size: int) -> None:
        """Begin with zero."""
        self.rows = [[Fraction(0)] * size for _ in range(size)]

    def add(self, factor: Fraction, p: Row, q: Row) -> None:
        """Add factor p q."""
        for a, b in ((p, q), (q, p)) if factor else ():
            right = [(j, v) for j, v in enumerate(b) if v]
            for i, u in enumerate(a):
                if u:
                    for j, v in right:
                        self.rows[i][j] += factor * u * v / 2

    def square(self, M: Sequence[Row], rows: Sequence[Row], factor: Fraction | int = 1) -> None:
        """Add factor times the form of M in these signals."""
        for i, own in enumerate(M):
            for j, value in enumerate(own):
                self.add(factor * value, rows[i], rows[j])


class Block(NamedTuple):
    """A block: its fields, channels, and coefficients that are taken one after the other."""

    content: Mapping[str, Any]
    inputs: Sequence[int]
    outputs: Sequence[int]
    values: Iterator[Fraction]

    def take(self) -> Fraction:
        """Return the next coefficient."""
        value = next(self.values, None)
        if value is None:
            raise Unreadable("the file is damaged: a multiplier has too few coefficients")
        return value

    def lower(self, n: int) -> list[Row]:
        """Return a symmetric matrix of its lower triangle by rows."""
        M = [[Fraction(0)] * n for _ in range(n)]
        for i in range(n):
            for j in range(i + 1):
                M[i][j] = M[j][i] = self.take()
        return M

    def value(self, name: str) -> Fraction:
        """Return a number."""
        return number(self.content[name], name)

    @property
    def poles(self) -> list[Fraction]:
        """Poles of the lags."""
        return [number(v, "a pole") for v in self.content["poles"]]

    @property
    def order(self) -> int:
        """Largest power of a lag."""
        return whole(self.content["order"], "the order", 0)

    def flag(self, name: str) -> bool:
        """Return whether a field is true."""
        if not isinstance(self.content[name], bool):
            raise Unreadable(f"the file is damaged: {name} is neither true nor false")
        return self.content[name]


def _states(content: Any) -> int:
    """Return the number of states that the multipliers of a block add."""
    if content["type"] == "own":
        return len(array(content["filter"][0], "a filter", None, None))
    signals = len(content["inputs"]) + len(content["outputs"])
    order = whole(content["order"], "the order", 0)
    return whole(len(content["poles"]) * order * signals, "a number of states", 0, MOST)


class Refused(Exception):
    """The proof is none, whatever its inequality says."""


def characteristic(A: Sequence[Row]) -> list[Fraction]:
    """Return the coefficients of det(s - A), ascending (Leverrier)."""
    n = len(A)
    found, M = [Fraction(1)], [[Fraction(i == j) for j in range(n)] for i in range(n)]
    for k in range(1, n + 1):
        M = [
            [sum((a * M[q][j] for q, a in enumerate(row)), Fraction(0)) for j in range(n)]
            for row in A
        ]
        found.append(-sum((M[i][i] for i in range(n)), Fraction(0)) / k)
        for i in range(n):
            M[i][i] += found[-1]
    return found[::-1]


def stable(A: Sequence[Row], sampled: bool) -> bool:
    """Whether all eigenvalues are left of the axis, or inside the unit circle; Routh's scheme."""
    p, n = characteristic(A), len(A)
    if sampled:  # z = (1 + s)/(1 - s)
        total = [Fraction(0)] * (n + 1)
        for k, value in enumerate(p):
            own = [value]
            for factor in [1] * k + [-1] * (n - k):
                own = [x + factor * y for x, y in zip([*own, 0], [0, *own], strict=True)]
            total = [x + y for x, y in zip(total, own, strict=True)]
        p = total if total[-1] > 0 else [-v for v in total]
    above, row = p[::-1][0::2], p[::-1][1::2]
    if above[0] <= 0:
        return False
    while row:
        if row[0] <= 0:
            return False
        padded = [*row, *[Fraction(0)] * (len(above) - len(row))]
        after = [a - above[0] * b / row[0] for a, b in zip(above[1:], padded[1:], strict=True)]
        above, row = row, after
    return True
