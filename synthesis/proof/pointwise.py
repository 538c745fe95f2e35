"""The inequalities at single values of p, in any arithmetic: from the model's own matrices and the
definition of P, nothing else.

This is the second witness of a proof. What assembly and proof have in common (pieces of the model,
cells, strips, the algebra of Bernstein coefficients; in several parameters the inequalities
themselves) is not used here, so that an error there, which both would believe, does not pass here
where it matters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement, pairwise, product
from math import comb
from typing import Any, NamedTuple

import numpy as np

from symheli.lpv import Matrices
from synthesis.lyapunov.spline import MemoryLyapunov, SplineLyapunov
from synthesis.norm_bounded import NormBounded
from synthesis.polynomial.exact import Number, exact

Array = np.ndarray

INSIDE = (0.03, 0.382, 0.764, 0.97)
"""Where in a stretch between knots and breaks an inequality is looked at: near its ends, where
derivatives jump, and between.
"""
ROUNDING = 1e-10
"""Largest difference of an entry of a polynomial piece from the model's own, as a fraction of what
its terms add up to in size.
"""


def inside(points: Any) -> list[float]:
    """Values of p within each stretch between `points`."""
    ends = sorted(set(map(float, points)))
    return [a + share * (b - a) for a, b in pairwise(ends) for share in INSIDE]


def bernstein(coefficients: Array, t: Any) -> Array:
    """sum_i C(d, i) t^i (1 - t)^(d - i) coefficients[i], written out."""
    d = len(coefficients) - 1
    out = coefficients[0] * (1 - t) ** d
    for i in range(1, d + 1):
        out = out + coefficients[i] * (comb(d, i) * t**i * (1 - t) ** (d - i))
    return out


def segment_of(knots: Array, p: float) -> int:
    """Index of the segment that p lies in."""
    return max(i for i in range(len(knots) - 1) if i == 0 or knots[i] <= p)


def spline(
    knots: Array, degree: int, coefficients: Array, p: float, number: Number
) -> tuple[Array, Array]:
    """(value, derivative) at p of a spline by its Bernstein coefficients (K d + 1, ...), in the
    arithmetic.
    """
    j = segment_of(knots, p)
    low, width = number(float(knots[j])), number(float(knots[j + 1])) - number(float(knots[j]))
    t, c = (
        (number(p) - low) / width,
        exact(coefficients[j * degree : (j + 1) * degree + 1], number),
    )
    return bernstein(c, t), bernstein(c[1:] - c[:-1], t) * degree / width if degree else c[0] * 0


def tensor_spline(
    knots: Sequence[Array], degrees: Sequence[int], coefficients: Array, p: Any, number: Number
) -> tuple[Array, list[Array]]:
    """(value, derivative by each parameter) at p (m,) of a spline in several parameters, in the
    arithmetic.
    """
    index = [segment_of(k, float(q)) for k, q in zip(knots, p, strict=True)]
    ends = [
        (number(float(k[j])), number(float(k[j + 1]))) for k, j in zip(knots, index, strict=True)
    ]
    part = coefficients[
        tuple(slice(j * d, (j + 1) * d + 1) for j, d in zip(index, degrees, strict=True))
    ]
    c, local = (
        exact(part, number),
        [(number(float(q)) - a) / (b - a) for q, (a, b) in zip(p, ends, strict=True)],
    )
    slopes = []
    for i, (a, b) in enumerate(ends):
        steeper = np.diff(c, axis=i) * degrees[i] / (b - a) if degrees[i] else c * 0
        slopes.append(_at(steeper, local))
    return _at(c, local), slopes


def tensor(coefficients: Array, box: Sequence[tuple[float, float]], p: Array) -> Array:
    """The polynomial of these Bernstein coefficients over the box at p (m,)."""
    return _at(coefficients, [(q - a) / (b - a) for q, (a, b) in zip(p, box, strict=True)])


def _at(coefficients: Array, local: Sequence[Any]) -> Array:
    for t in local:
        coefficients = bernstein(coefficients, t)
    return coefficients


class Supplied(NamedTuple):
    """A norm-bounded block of `inputs` d and `outputs` v, |d| <= bound |v|, with its multiplier at
    one p.
    """

    inputs: int
    outputs: int
    bound: Any
    multiplier: Any


def dissipation(
    model: Matrices,
    P: Array,
    drift: Array | None,
    after: Array | None,
    g: Any,
    supplied: Supplied | None = None,
) -> Array:
    """The bounded real inequality at one p; `drift` dP/dt, or `after` P(p(k+1)) in discrete time. g
    None: the state block, with that of d where there is a block.
    """
    if supplied is not None:
        return _around(model, P, drift, after, g, supplied)
    A, B, C, D = model
    if after is None:
        top, side, corner = A.T @ P + P @ A, P @ B, D.T @ D
        top = top if drift is None else top + drift
    else:
        top, side, corner = A.T @ after @ A - P, A.T @ after @ B, D.T @ D + B.T @ after @ B
    if g is None:
        return top
    top, side = top + C.T @ C, side + C.T @ D
    return np.block([[top, side], [side.T, corner - np.eye(len(corner), dtype=int) * g]])


def _around(
    model: Matrices, P: Array, drift: Array | None, after: Array | None, g: Any, block: Supplied
) -> Array:
    """The inequality around a block: dV/dt + |y|^2 - g |u|^2 + multiplier (bound^2 |v|^2 - |d|^2),
    as a quadratic form in x, d and u, from the equations of each.
    """
    A, B, C, D = model
    n, m, y = len(A), B.shape[1], len(C) - block.outputs
    one = np.eye(n + m, dtype=int)
    x, d, u = one[:n], one[n : n + block.inputs], one[n + block.inputs :]
    move, out = A @ x + B @ np.vstack([d, u]), C @ x + D @ np.vstack([d, u])
    if after is None:
        change = x.T @ (P @ move) + (x.T @ (P @ move)).T
        change = change if drift is None else change + x.T @ (drift @ x)
    else:
        change = move.T @ (after @ move) - x.T @ (P @ x)
    v = out[y:]
    change = change + block.multiplier * (block.bound * block.bound * (v.T @ v) - d.T @ d)
    if g is None:
        strict = n + block.inputs
        return change[:strict, :strict]
    return change + out[:y].T @ out[:y] - g * (u.T @ u)


def paces(
    p: Any,
    rates: Sequence[float],
    ties: Sequence[int | None],
    degrees: Sequence[int],
    number: Number,
) -> Iterator[tuple[Any, ...]]:
    """Every extreme dp/dt that matters to P: plus or minus its rate, or the parameter it is."""
    each = [
        (0,)
        if not d
        else (number(float(p[j])),)
        if j is not None
        else (number(-r), number(r))
        if r > 0
        else (0,)
        for r, j, d in zip(rates, ties, degrees, strict=True)
    ]
    return product(*each)


def spans(
    p: Any,
    rates: Sequence[float],
    ties: Sequence[int | None],
    degrees: Sequence[int],
    box: Sequence[tuple[float, float]],
    dt: float,
) -> list[tuple[float, float]]:
    """(least, largest) change of each parameter in a sample that matters to P: dt p_j with an error
    of dt^2/2 times the rate of p_j where p_j is the rate.
    """
    out = []
    for r, j, d in zip(rates, ties, degrees, strict=True):
        if not d:
            out.append((0.0, 0.0))
        elif j is None:
            out.append((-r * dt, r * dt))
        else:
            slack, (low, high) = 0.5 * rates[j] * dt * dt, box[j]
            out.append((max(p[j] * dt - slack, low * dt), min(p[j] * dt + slack, high * dt)))
    return out


def reached(
    p: Any, moves: Sequence[tuple[float, float]], box: Sequence[tuple[float, float]]
) -> Iterator[tuple[float, ...]]:
    """Values of p(k+1) where each parameter changes by (least, largest): as far as it goes either
    way, and part of the way.
    """
    each = []
    for q, (back, on), (low, high) in zip(p, moves, box, strict=True):
        back, on = max(back, low - high), min(on, high - low)
        shares = (0.0, 0.309, 0.5, 0.809, 1.0) if on > back else (0.0,)
        each.append(sorted({min(max(q + back + t * (on - back), low), high) for t in shares}))
    return product(*each)


def spline_inequalities(
    P: SplineLyapunov,
    p: float,
    model: Matrices,
    rate: float,
    dt: float | None,
    g: Any,
    ends: tuple[float, float],
    number: Number,
    block: NormBounded | None = None,
) -> Iterator[Array]:
    """What must be negative definite at p for V = x'P(p)x, the multiplier of a `block` too."""
    here, slope = spline(P.knots, P.degree, P.coefficients, p, number)
    yield -here
    supplied = None
    if block is not None and P.multiplier is not None:
        e = P.multiplier_degree
        value, _ = spline(P.knots, e, np.reshape(P.multiplier, (-1, 1, 1)), p, number)
        yield -value
        bound = number(block.bound)
        supplied = Supplied(block.inputs, block.outputs, bound, value[0, 0])
    if dt is not None:
        step = rate * dt if P.degree else 0.0
        for (q,) in reached((p,), [(-step, step)], (ends,)):
            after = spline(P.knots, P.degree, P.coefficients, q, number)[0]
            yield dissipation(model, here, None, after, g, supplied)
    elif P.degree == 0 or rate == 0:
        yield dissipation(model, here, None, None, g, supplied)
    else:
        yield from (
            dissipation(model, here, sign * number(rate) * slope, None, g, supplied)
            for sign in (-1, 1)
        )


def memory_inequalities(
    P: MemoryLyapunov, p: float, model: Matrices, rate: float, g: Any, number: Number
) -> Iterator[Array]:
    """What must be negative definite at p, and at some leads e within their limits, for V = x'P(p,
    e)x, de/dt = dp/dt - e/time.
    """
    region, d = P.region, P.degree
    j = segment_of(P.knots, p)
    low, width = (
        number(float(P.knots[j])),
        number(float(P.knots[j + 1])) - number(float(P.knots[j])),
    )
    t, rows = (number(p) - low) / width, P.coefficients[j * d : (j + 1) * d + 1]
    lower, rise = spline(region.knots, 1, region.lower, p, number)
    upper, climb = spline(region.knots, 1, region.upper, p, number)
    height, widening = upper - lower, climb - rise
    for share in inside(P.lead_knots):
        across = [spline(P.lead_knots, P.lead_degree, row, share, number) for row in rows]
        values, slopes = (np.array(part) for part in zip(*across, strict=True))
        here, in_share, in_p = (
            bernstein(values, t),
            bernstein(slopes, t),
            bernstein(values[1:] - values[:-1], t) * d / width,
        )
        yield -here
        for nu in (-number(rate), number(rate)):
            # the share (e - lower)/height moves with e and with the limits
            pace = (
                nu
                - (lower + number(share) * height) / number(region.time)
                - nu * (rise + number(share) * widening)
            ) / height
            yield dissipation(model, here, nu * in_p + pace * in_share, None, g)


def decreases(
    P: SplineLyapunov, p: float, A: Array, rate: float, transform: Array, number: Number
) -> bool:
    """V > 0 > dV/dt for V of higher degree, at states in all directions: dV/dt = sum_i (A x)_i
    dV/dx_i from the monomials themselves.
    """
    here, slope = spline(P.knots, P.degree, P.coefficients, p, number)
    for direction in np.random.default_rng(0).standard_normal((20, len(A))):
        x = exact(transform @ direction, number)
        move = A @ x
        z, dz = [], []
        for factors in combinations_with_replacement(range(len(A)), P.order):
            z.append(math.prod(x[i] for i in factors))
            dz.append(
                sum(
                    move[i] * math.prod(x[j] for k, j in enumerate(factors) if k != at)
                    for at, i in enumerate(factors)
                )
            )
        zs, dzs = np.array(z), np.array(dz)
        drift = number(rate) * abs(zs @ slope @ zs) if P.degree else 0
        if not (zs @ here @ zs > 0 and 2 * (zs @ here @ dzs) + drift < 0):
            return False
    return True


def same_entries(found: Array, expected: Array, size: Array) -> bool:
    """Whether the entries agree to rounding, each beside the size of the terms it is the sum of."""
    return bool(np.all(np.abs(found - expected) <= ROUNDING * size))
