"""The functions of p of which a model is the sum, where they are polynomials."""

import math
from abc import ABC, abstractmethod
from fractions import Fraction
from itertools import pairwise

from .polynomials import Polynomial, scalar, zero


class Functions(ABC):
    """Functions of one parameter: how many, where their polynomials change, and what they are."""

    size: int
    breaks: tuple[Fraction, ...]

    @abstractmethod
    def on(self, middle: Fraction, p: Polynomial) -> list[Polynomial]:
        """Return the polynomials of the interval around `middle`, at the polynomial p."""

    def piece(self, middle: Fraction) -> int:
        """Return the interval between breaks in which `middle` lies; beyond them the last one."""
        return sum(middle >= b for b in self.breaks[1:-1])


class Legendre(Functions):
    """sqrt(2 j + 1) P_j(x), x = (2 p - low - high)/(high - low); the root is the nearest double."""

    def __init__(self, degree: int, low: Fraction, high: Fraction) -> None:
        self.size, self.breaks = degree + 1, (low, high)

    def on(self, middle: Fraction, p: Polynomial) -> list[Polynomial]:
        """Return the functions by their recurrence."""
        low, high = self.breaks
        x = _affine(p, low, high) * 2 - scalar(1)
        found = [scalar(1), x.reduced()]
        for j in range(1, self.size - 1):
            following = x @ found[j] * (2 * j + 1) - found[j - 1] * j
            found.append((following * Fraction(1, j + 1)).reduced())
        return [P * Fraction(math.sqrt(2 * j + 1)) for j, P in enumerate(found[: self.size])]


class BSplines(Functions):
    """B-splines of a degree on breakpoints, those at the ends repeated (Cox and de Boor); of degree
    1 they are one at a node and zero at the others.
    """

    def __init__(self, degree: int, breaks: tuple[Fraction, ...]) -> None:
        self.degree, self.breaks, self.size = degree, breaks, len(breaks) - 1 + degree
        self.knots = breaks[:1] * degree + breaks + breaks[-1:] * degree

    def on(self, middle: Fraction, p: Polynomial) -> list[Polynomial]:
        """Return the functions by their recurrence."""
        here, t = self.degree + self.piece(middle), self.knots
        found = [scalar(1) if i == here else zero(1, 1) for i in range(len(t) - 1)]
        for d in range(1, self.degree + 1):
            rising = [
                _affine(p, t[i], t[i + d]) if t[i] < t[i + d] else zero(1, 1)
                for i in range(len(t) - d)
            ]
            found = [
                (rising[i] @ found[i] + (scalar(1) - rising[i + 1]) @ found[i + 1]).reduced()
                for i in range(len(t) - d - 1)
            ]
        return found


class Cubics(Functions):
    """Cubic splines, one at a node and zero at the others, twice continuously differentiable, whose
    third derivative is continuous at the second node and the last but one.
    """

    def __init__(self, nodes: tuple[Fraction, ...]) -> None:
        self.breaks, self.size = nodes, len(nodes)
        h, n = [b - a for a, b in pairwise(nodes)], self.size
        left, right = [], []
        for i in range(n):
            row, values = [Fraction(0)] * n, [Fraction(0)] * n
            if 0 < i < n - 1:
                row[i - 1 : i + 2] = [h[i - 1], 2 * (h[i - 1] + h[i]), h[i]]
                values[i - 1 : i + 2] = [6 / h[i - 1], -6 / h[i - 1] - 6 / h[i], 6 / h[i]]
            else:
                k = 1 if i == 0 else n - 2
                row[k - 1 : k + 2] = [h[k], -h[k - 1] - h[k], h[k - 1]]
            left.append(row)
            right.append(values)
        # second derivatives at every node (rows), of every function (columns)
        self.bends = solved(left, right)

    def on(self, middle: Fraction, p: Polynomial) -> list[Polynomial]:
        """Return the cubic polynomials from their values and second derivatives at the ends."""
        k = self.piece(middle)
        a, b = self.breaks[k], self.breaks[k + 1]
        up, sixth = _affine(p, a, b), (b - a) ** 2 / 6
        down = scalar(1) - up
        bends = [((s @ s @ s) - s) * sixth for s in (down, up)]
        found = []
        for j in range(self.size):
            own = bends[0] * self.bends[k][j] + bends[1] * self.bends[k + 1][j]
            own = own + (down if j == k else up if j == k + 1 else own * 0)
            found.append(own.reduced())
        return found


class Powers(Functions):
    """On each interval, and zero elsewhere, the powers ((p - a)/(b - a))^k, k = degree .. 0."""

    def __init__(self, degree: int, breaks: tuple[Fraction, ...]) -> None:
        self.degree, self.breaks, self.size = degree, breaks, (degree + 1) * (len(breaks) - 1)

    def on(self, middle: Fraction, p: Polynomial) -> list[Polynomial]:
        """Return the powers of the interval, and zeros."""
        k, n = self.piece(middle), self.degree + 1
        u = _affine(p, self.breaks[k], self.breaks[k + 1])
        found = [zero(1, 1)] * self.size
        own = [scalar(1)]
        for _ in range(self.degree):
            own.append((own[-1] @ u).reduced())
        found[k * n : (k + 1) * n] = own[::-1]
        return found


def _affine(p: Polynomial, low: Fraction, high: Fraction) -> Polynomial:
    """Return (p - low)/(high - low)."""
    return ((p - scalar(low)) * (1 / (high - low))).reduced()


def solved(left: list[list[Fraction]], right: list[list[Fraction]]) -> list[list[Fraction]]:
    """Return X with left X = right by Gauss and Jordan; raises `ZeroDivisionError` where there is
    none or more than one.
    """
    n = len(left)
    work = [[*a, *b] for a, b in zip(left, right, strict=True)]
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k][i]), None)
        if pivot is None:
            raise ZeroDivisionError("a matrix that has no inverse")
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [v / work[i][i] for v in work[i]]
        for k in range(n):
            if k != i and work[k][i]:
                factor = work[k][i]
                work[k] = [v - factor * w for v, w in zip(work[k], work[i], strict=True)]
    return [row[n:] for row in work]
