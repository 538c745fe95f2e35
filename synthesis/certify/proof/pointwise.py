"""The inequalities at single values of p, in any arithmetic, from the model's own matrices and the
definition of P only.

This is the independent check of a proof. The code that assembly and proof have in common (pieces of
the model, cells, strips, the algebra of Bernstein coefficients; in several parameters the
inequalities themselves) is not used here, so that an error in it is detected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import combinations_with_replacement, pairwise, product
from math import comb
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symheli.lpv.lpv_matrices import Matrices
from symheli.values.arrays import Array
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.spline import MemoryLyapunov, SplineLyapunov
from synthesis.numerics.polynomial.exact import Number, exact, growth_of, matmul, positive_definite
from synthesis.numerics.polynomial.symmetric import extended, symmetrized

if TYPE_CHECKING:
    from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import Supply

RELATIVE_POSITIONS = (0.03, 0.382, 0.764, 0.97)
"""Positions in an interval between knots and breaks at which an inequality is checked: near its
ends, where derivatives jump, and in between.
"""
ROUNDING = 1e-10
"""Largest difference of an entry of a polynomial piece from the model's own, as a fraction of what
its terms add up to in size.
"""


def inside(points: Any, least: int = 1) -> list[float]:
    """Return values of p within each interval between `points`, which are cut so that there are
    `least` values or more.
    """
    ends = sorted(set(map(float, points)))
    parts = -(-least // (len(RELATIVE_POSITIONS) * (len(ends) - 1)))
    finer = np.interp(np.arange(parts * (len(ends) - 1) + 1) / parts, np.arange(len(ends)), ends)
    return [
        a + share * (b - a) for a, b in pairwise(finer.tolist()) for share in RELATIVE_POSITIONS
    ]


def combined(axes: Sequence[Sequence[float]], count: int) -> Array:
    """Return points (k, m): all values of a single axis; for several axes a diagonal of `count`
    points through their product.
    """
    count = count if len(axes) > 1 else len(axes[0])
    return np.array(
        [[axis[(k * (3 * i + 1)) % len(axis)] for i, axis in enumerate(axes)] for k in range(count)]
    )


def negative(forms: Iterable[Array], number: Number, weight: Array | None = None) -> bool:
    """Whether all forms are negative definite: exactly, or by eigenvalues with the states in the
    coordinates of `weight`.
    """
    if number is not float:
        return all(positive_definite(-F) for F in forms)
    by_size: dict[int, list[Array]] = {}
    for F in forms:
        by_size.setdefault(len(F), []).append(F)
    for size, every in by_size.items():
        stack = symmetrized(np.array(every))
        if weight is not None and size >= len(weight):
            W = extended(weight, size - len(weight))
            stack = symmetrized(W.T @ stack @ W)
        if not np.linalg.eigvalsh(stack).max(initial=-math.inf) < 0:
            return False
    return True


def bernstein(coefficients: Array, t: Any) -> Array:
    """sum_i C(d, i) t^i (1 - t)^(d - i) coefficients[i], written out."""
    d = len(coefficients) - 1
    out = coefficients[0] * (1 - t) ** d
    for i in range(1, d + 1):
        out = out + coefficients[i] * (comb(d, i) * t**i * (1 - t) ** (d - i))
    return out


def segment_of(knots: Array, p: float) -> int:
    """Return the index of the segment that p lies in."""
    return max(i for i in range(len(knots) - 1) if i == 0 or knots[i] <= p)


def spline(
    knots: Array, degree: int, coefficients: Array, p: float, number: Number
) -> tuple[Array, Array]:
    """Return (value, derivative) at p of a spline by its Bernstein coefficients (K d + 1, ...), in
    the arithmetic.
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
    """Return (value, derivative by each parameter) at p (m,) of a spline in several parameters, in
    the arithmetic.
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
    """Return the polynomial of these Bernstein coefficients over the box at p (m,)."""
    return _at(coefficients, [(q - a) / (b - a) for q, (a, b) in zip(p, box, strict=True)])


def _at(coefficients: Array, local: Sequence[Any]) -> Array:
    for t in local:
        coefficients = bernstein(coefficients, t)
    return coefficients


class PointSupply(NamedTuple):
    """A norm-bounded block, |d| <= bound |v| of each part, with the multipliers (parts,) at one
    p.
    """

    block: NormBounded
    bound: Any
    multipliers: Array


def dissipation(
    model: Matrices,
    P: Array,
    drift: Array | None,
    after: Array | None,
    g: Any,
    block: PointSupply | None = None,
    supply: Supply | None = None,
) -> Array:
    """Return the bounded real inequality at one p as a quadratic form in x, d and u: dV/dt + |y|^2
    - g |u|^2 + multiplier (bound^2 |v|^2 - |d|^2), the last term around each part of a `block` d =
    Delta v. With a `supply` dV/dt - (q |y|^2 + 2 s y'u + r |u|^2) instead.

    `drift` is dP/dt, `after` P(p(k+1)) in discrete time. g None: dV/dt and the last term alone, in
    x and d.
    """
    A, B, C, D = model
    inputs, outputs = (0, 0) if block is None else block.block[:2]
    n, m, y = len(A), B.shape[1], len(C) - outputs
    one = np.eye(n + m, dtype=int)
    x, u = one[:n], one[n + inputs :]
    move, out = np.hstack([A, B]), np.hstack([C, D])
    if after is None:
        change = matmul(x.T, matmul(P, move))
        change = change + change.T
        change = change if drift is None else change + matmul(x.T, matmul(drift, x))
    else:
        change = matmul(move.T, matmul(after, move)) - matmul(x.T, matmul(P, x))
    if block is not None:
        places = block.block.places(n, len(C))
        for (rows, columns), factor in zip(places, block.multipliers, strict=True):
            d, v = one[rows], out[columns]
            seen = matmul(v.T, v)
            change = change + factor * (block.bound * block.bound * seen - d.T @ d)
    if g is None:
        return change[: n + inputs, : n + inputs]
    if supply is not None:
        q, s, r = supply
        across = matmul(out.T, u)
        return change - q * matmul(out.T, out) - s * (across + across.T) - r * (u.T @ u)
    return change + matmul(out[:y].T, out[:y]) - g * (u.T @ u)


def paces(
    p: Any,
    rates: Sequence[float],
    ties: Sequence[int | None],
    degrees: Sequence[int],
    number: Number,
) -> Iterator[tuple[Any, ...]]:
    """Yield every extreme dp/dt that changes P: plus or minus its rate, or the parameter that is
    the rate.
    """
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
    """Return the (least, largest) change of each parameter in a sample that changes P: dt p_j with
    an error of dt^2/2 times the rate of p_j where p_j is the rate.
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
    """Yield values of p(k+1) where each parameter changes by (least, largest): both extremes, and
    values between.
    """
    each = []
    for q, (back, on), (low, high) in zip(p, moves, box, strict=True):
        back, on = max(back, low - high), min(on, high - low)
        shares = (0.0, 0.309, 0.5, 0.809, 1.0) if on > back else (0.0,)
        each.append(sorted({min(max(q + back + t * (on - back), low), high) for t in shares}))
    return product(*each)


def inequalities(
    P: SplineLyapunov | BoxLyapunov,
    p: Any,
    model: Matrices,
    demand: Demand,
    dt: float | None,
    bound: float,
    number: Number,
    channel: NormBounded | None = None,
) -> Iterator[Array]:
    """Yield the matrices that must be negative definite at p (m,) for V = x'P(p)x: P, the
    multiplier of a norm-bounded `channel`, and the inequalities of the `demand` with this `bound`.
    """
    if isinstance(P, SplineLyapunov):
        knots, degrees = (P.knots,), (P.degree,)
    else:
        knots, degrees = P.knots, P.degrees
    here, slopes = tensor_spline(knots, degrees, P.coefficients, p, number)
    states = _states_of(P, number)
    here, slopes = states(here), [*map(states, slopes)]
    yield -here
    facets = demand.kind.facets
    g = facets.level(number(bound)) if demand.kind.driven else None
    supply = demand.supply(g, number) if demand.kind.indexed else None
    if demand.of_gramian:
        # V grows by at most the energy of the input, and the outputs are seen by it
        yield -_output_form(here, model, facets.rows, dt, g)
        model, g = model._replace(C=model.C * 0, D=model.D * 0), number(1.0)
    supplied = None
    if channel is not None and isinstance(P, SplineLyapunov) and P.multiplier is not None:
        values = P.multipliers[:, None, :]
        (multipliers,), _ = spline(P.knots, P.multiplier_degree, values, p[0], number)
        for multiplier in multipliers:
            yield -np.array([[multiplier]])
        supplied = PointSupply(channel, number(channel.bound), multipliers)
    decay, motion = facets.decays, demand.motion
    if dt is None:
        for pace in paces(p, demand.rates, motion.ties, degrees, number):
            drift = here * (2 * number(bound)) if decay else here * 0
            for nu, slope in zip(pace, slopes, strict=True):
                drift = drift + number(demand.time) * nu * slope
            yield dissipation(model, here, drift, None, g, supplied, supply)
        return
    growth = number(growth_of(bound, dt)) if decay else number(1.0)
    for q in reached(p, spans(p, demand.rates, motion.ties, degrees, motion.box, dt), motion.box):
        after = states(tensor_spline(knots, degrees, P.coefficients, q, number)[0]) * growth
        yield dissipation(model, here, None, after, g, supplied, supply)


def _states_of(P: SplineLyapunov | BoxLyapunov, number: Number) -> Callable[[Array], Array]:
    """Return the function that makes forms in the coordinates of P forms in the states."""
    if isinstance(P, BoxLyapunov) or P.coordinates is None:
        return lambda form: form
    T = exact(P.coordinates, number)
    return lambda form: matmul(T.T, matmul(form, T))


def _output_form(P: Array, model: Matrices, rows: bool, dt: float | None, g: Any) -> Array:
    """Return the matrix that must be positive definite for |y|^2 < g V, or < g (V + |u|^2) in
    discrete time; for a variance below g, that of the rows of C one after the other beside as many
    copies of V.
    """
    _, B, C, D = model
    if dt is not None:
        one = np.eye(B.shape[1], dtype=int) + D[:0].T @ D[:0]
        P, C = np.block([[P, B * 0], [B.T * 0, one]]), np.hstack([C, D])
    if rows:
        P, C = np.kron(np.eye(len(C), dtype=int), P), C.reshape(1, -1)
    return np.block([[P, C.T], [C, np.eye(len(C), dtype=int) * g]])


def memory_inequalities(
    P: MemoryLyapunov, p: float, model: Matrices, rate: float, g: Any, number: Number
) -> Iterator[Array]:
    """Yield the matrices that must be negative definite at p, and at some lag errors e within their
    limits, for V = x'P(p, e)x, de/dt = dp/dt - e/time.
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


def monomial_inequalities(
    P: SplineLyapunov, p: float, A: Array, rate: float, transform: Array, number: Number
) -> Iterator[Array]:
    """Yield V > 0 > dV/dt as numbers (1, 1) below zero for V of higher degree, at states in all
    directions: dV/dt = sum_i (A x)_i dV/dx_i from the monomials themselves.
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
        yield np.array([[-(zs @ here @ zs)]])
        yield np.array([[2 * (zs @ here @ dzs) + drift]])


def same_entries(found: Array, expected: Array, size: Array) -> bool:
    """Whether the entries agree to rounding, each relative to the size of its own terms."""
    return bool(np.all(np.abs(found - expected) <= ROUNDING * size))
