"""Matrices of integers, and whether a symmetric one is positive definite."""

import math
from operator import mul

try:
    from flint import fmpz_mat  # type: ignore[import-not-found]
except ImportError:
    fmpz_mat = None

Rows = list[list[int]]

ENTRY_BITS = 128
"""Bits to which a matrix is rounded, with the rounding counted, before its congruence."""
FACTOR_BITS = 40
"""Bits behind the point of the congruence."""


def product(X: Rows, Y: Rows) -> Rows:
    """Return X Y; X has at least one column."""
    if fmpz_mat is not None and min(len(X), len(Y[0])) > 11:  # faster from there
        found = (fmpz_mat(X) * fmpz_mat(Y)).tolist()
        return [[int(v) for v in row] for row in found]
    columns = list(zip(*Y, strict=True))
    return [[sum(map(mul, row, column)) for column in columns] for row in X]


def positive_definite(M: Rows) -> bool:
    """Whether the symmetric matrix of integers M is positive definite."""
    return shown(M) or pivots_positive(M)


def shown(M: Rows) -> bool:
    """Whether M is positive definite, shown by a congruence or, where doubles cannot tell, by
    elimination; False also where doubles say that it is not.
    """
    if len(M) <= 2:
        return pivots_positive(M)
    if any(M[i][i] <= 0 for i in range(len(M))):
        return False
    N = _rounded(M)
    if any(abs(v) > 2 << ENTRY_BITS for row in N for v in row):
        return False  # a minor of two rows is negative
    back = _congruence(N)
    return back is not None and (_dominant(N, back) or pivots_positive(M))


def _rounded(M: Rows) -> Rows:
    """Return N with M_ij = 2^(e_i + e_j - ENTRY_BITS) (N_ij + r_ij), 0 <= r_ij < 1, N_ii near
    2^ENTRY_BITS and not above: M in units in which its diagonal is one.
    """
    e = [(M[i][i].bit_length() + 1) // 2 for i in range(len(M))]
    out = []
    for i, row in enumerate(M):
        own = []
        for j, value in enumerate(row):
            down = e[i] + e[j] - ENTRY_BITS
            own.append(value >> down if down >= 0 else value << -down)
        out.append(own)
    return out


def _congruence(N: Rows) -> Rows | None:
    """Return L^-1 rounded, times 2^FACTOR_BITS, where L L' is N in doubles; None where a pivot is
    not positive.
    """
    one, size = 1 << ENTRY_BITS, float(1 << FACTOR_BITS)
    L: list[list[float]] = []
    inverse: list[list[float]] = []
    for i, row in enumerate(N):
        own: list[float] = []
        for j, other in enumerate(L):
            own.append((row[j] / one - sum(map(mul, own, other))) / other[j])
        pivot = row[i] / one - sum(v * v for v in own)
        if not 0 < pivot < math.inf:
            return None
        root = math.sqrt(pivot)
        sums = [sum(map(mul, own, column)) for column in zip(*inverse, strict=True)]
        inverse.append([-v / root for v in sums[:i]] + [1 / root] + [0.0] * (len(N) - i - 1))
        L.append([*own, root])
    if not all(math.isfinite(v) for row in inverse for v in row):
        return None
    return [[round(v * size) for v in row] for row in inverse]


def _dominant(N: Rows, back: Rows) -> bool:
    """Whether W' (N + r) W is strictly dominant in its diagonal for all symmetric r with entries
    from 0 to 1, W' = `back`: N + r is positive definite then.
    """
    Q = product(product(back, N), [list(column) for column in zip(*back, strict=True)])
    reach = [sum(map(abs, row)) for row in back]
    every = sum(reach)
    # |(W' r W)_jk| <= reach_j reach_k
    return all(2 * row[j] > sum(map(abs, row)) + reach[j] * every for j, row in enumerate(Q))


def pivots_positive(M: Rows) -> bool:
    """Whether all leading minors are positive, by Bareiss' elimination without fractions."""
    own, before = [list(row) for row in M], 1
    while own:
        pivot, head = own[0][0], own[0][1:]
        if pivot <= 0:
            return False
        own = [
            [(pivot * v - row[0] * top) // before for v, top in zip(row[1:], head, strict=True)]
            for row in own[1:]
        ]
        before = pivot
    return True


def nonnegative(M: Rows) -> bool:
    """Whether a symmetric matrix of integers is positive semidefinite, by elimination."""
    own, before = [list(row) for row in M], 1
    while own:
        pivot, head = own[0][0], own[0][1:]
        if pivot < 0 or (pivot == 0 and any(head)):
            return False
        if pivot == 0:
            own = [row[1:] for row in own[1:]]
            continue
        own = [
            [(pivot * v - row[0] * top) // before for v, top in zip(row[1:], head, strict=True)]
            for row in own[1:]
        ]
        before = pivot
    return True


def shortfall(M: Rows) -> float:
    """Return the least multiple of its own diagonal that must be added to M to make it positive
    definite, to three digits: how far it is from being so, in no units.
    """
    one, n = 1 << 60, range(len(M))

    def enough(t: int) -> bool:
        return shown([[M[i][j] * one + (i == j) * t * abs(M[i][j]) for j in n] for i in n])

    low, high = 0, 1
    while not enough(high):
        low, high = high, 4 * high
        if high > one**3:
            return math.inf
    while high - low > high >> 10:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high / one
