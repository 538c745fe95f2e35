"""The bound that a Lyapunov function over a box admits: a proposal for the proof to check.

Floating point: samples of the inequalities, then the whole box at bounds that are looser by small
fractions.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.proof.box import BoxEvidence
from synthesis.certify.proof.inequalities import Pair, decrease, output_form
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.demand import Demand
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import Pieces
from synthesis.numerics.polynomial.regions import regions
from synthesis.numerics.polynomial.symmetric import schur_complement

LOOSENINGS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Fractions by which the bound is increased in turn until it is verified on the whole box."""


LARGE_LOOSENINGS = (1e2, 1e4, 1e6)
"""Further fractions, for a model without a response to compare rounding with."""

DOUBLINGS = 40
"""Largest number of times a level is raised fourfold in the search for one that holds."""

MIN_LEVEL = 1e-8
"""Least g in scaled units: no strict inequality proves zero."""


def sampled(evidence: BoxEvidence, P: BoxLyapunov, points: int) -> tuple[BoxLyapunov, float]:
    """Return (P, the bound it admits at `points` values of each parameter in every region); inf
    (decay: -inf) where none.

    For the energy-to-peak and H2 gain P is scaled so that its first inequality just holds; NaN
    for stability.
    """
    kind = evidence.demand.kind
    facets = kind.facets
    model, demand = evidence.scaled
    if not demand.meaningful(model.dt, P.degrees):
        return P, -math.inf if facets.sense < 0 else math.inf
    back = evidence.scaled_back(P)
    if not facets.sense:
        return P, math.nan
    samples = _samples(model, back, demand, points)
    if facets.decays:
        alpha = samples.decay(model.dt)
        return P, alpha / evidence.in_units(1.0)
    if kind.indexed:
        g = samples.level()
        bound = facets.bound(g) if math.isfinite(g) else facets.sense * math.inf
        return P, bound / evidence.in_units(1.0)
    g = samples.gain()
    if facets.supply is not None or not 0 < g < math.inf:
        return P, facets.bound(g) / evidence.in_units(1.0)
    factor = 1.0 / (g * (1 + LOOSENINGS[0]))
    P = replace(P, coefficients=P.coefficients * factor)
    back = evidence.scaled_back(P)
    return P, math.sqrt(_samples(model, back, demand, points).output()) / evidence.in_units(1.0)


def least(evidence: BoxEvidence, P: BoxLyapunov, points: int) -> tuple[BoxLyapunov, float] | None:
    """Return (P, the best bound verified on the whole box), None where P proves nothing.
    Floating point.
    """
    P, value = sampled(evidence, P, points)
    kind = evidence.demand.kind
    if math.isinf(value):
        return None
    nothing = (
        kind.gains
        and not kind.indexed
        and value * evidence.in_units(1.0) <= math.sqrt(MIN_LEVEL * (1 + LOOSENINGS[0]))
    )
    for fraction in (*LOOSENINGS, *LARGE_LOOSENINGS) if nothing else LOOSENINGS:
        bound = _looser(evidence, value, fraction)
        if evidence.demand.of_gramian:
            trial = replace(P, coefficients=P.coefficients / (1 + fraction))
            bound *= math.sqrt(1 + fraction)
        else:
            trial = P
        if evidence.floating(trial, bound):
            return trial, bound
        if not kind.facets.sense:
            break
    return None


def _looser(evidence: BoxEvidence, value: float, fraction: float) -> float:
    """Return a bound that is looser by a fraction: gains of gamma^2, decay rates of themselves,
    other levels of one in scaled units.
    """
    kind = evidence.demand.kind
    if not kind.facets.sense:
        return value
    if kind.indexed:
        unit = 1.0 / evidence.in_units(1.0)
        return value + kind.facets.sense * fraction * (abs(value) + unit)
    if kind.facets.decays:
        return value - fraction * abs(value)
    return value * math.sqrt(1 + fraction)


def conditioning(evidence: BoxEvidence, P: BoxLyapunov) -> float:
    """Return the largest condition number of P in scaled coordinates, at its knots and a few
    values between; inf where P is not positive.
    """
    axes = [np.unique([np.linspace(a, b, 5) for a, b in pairwise(k)]) for k in P.knots]
    values = np.linalg.eigvalsh(evidence.to_scaled(P.at(np.array(list(product(*axes))))))
    return float((values[:, -1] / values[:, 0]).max()) if values.min() > 0 else math.inf


class _Samples(NamedTuple):
    """Values of the inequalities and of P at points: `moves` for V along trajectories, `here` P
    itself; `outputs` of the second inequality, with g in its last rows `seen`.
    """

    moves: list[Array]
    here: list[Array]
    outputs: list[Array]
    rises: list[Array]
    nx: int
    seen: int

    def gain(self) -> float:
        """Return the least g of the corner block."""
        if any(np.linalg.eigvalsh(P).min() <= 0 for P in self.here):
            return math.inf
        return max([MIN_LEVEL, *(_least_level(F, self.nx) for F in self.moves)])

    def level(self) -> float:
        """Return the least g at which every inequality holds, for a level of any sign: F - g R < 0,
        R >= 0.
        """
        if any(np.linalg.eigvalsh(P).min() <= 0 for P in self.here):
            return math.inf
        return max(map(_least_multiple, self.moves, self.rises), default=math.inf)

    def output(self) -> float:
        """Return the least g of the second inequality."""
        return max([MIN_LEVEL, *(_least_level(F, F.shape[1] - self.seen) for F in self.outputs)])

    def decay(self, dt: float | None) -> float:
        """Return the largest alpha."""
        worst = math.inf
        for F, P in zip(self.moves, self.here, strict=True):
            if np.linalg.eigvalsh(P).min() <= 0:
                return -math.inf
            L = np.linalg.inv(np.linalg.cholesky(P))
            value = float(np.linalg.eigvalsh(L @ F @ np.swapaxes(L, 1, 2)).max())
            if dt is None:
                worst = min(worst, -0.5 * value)
            else:
                # A'P+A - P <= value P
                worst = min(worst, -math.log(max(1 + value, 1e-300)) / (2 * dt))
        return worst


def _least_level(F: Array, n: int) -> float:
    """Return the least g of the last block of matrices (K, N, N) with n rows before it; inf where
    those are not negative definite.
    """
    if np.linalg.eigvalsh(F[:, :n, :n]).max() >= 0:
        return math.inf
    return float(np.linalg.eigvalsh(schur_complement(F, n)).max())


def _least_multiple(F: Array, R: Array) -> float:
    """Return the least g with F - g R < 0 for all matrices (K, N, N), R >= 0; inf for none."""
    size = max(float(np.abs(F).max()), 1e-300)
    high = size / max(float(np.abs(R).max()), 1e-300)
    low = -high
    for _ in range(DOUBLINGS):
        if np.linalg.eigvalsh(F - high * R).max() < 0:
            break
        low, high = high, abs(high) * 4
    else:
        return math.inf
    while np.linalg.eigvalsh(F - low * R).max() < 0 and abs(low) < 1e12 * size:
        low *= 4
    for _ in range(DOUBLINGS + 20):
        middle = 0.5 * (low + high)
        negative = np.linalg.eigvalsh(F - middle * R).max() < 0
        low, high = (low, middle) if negative else (middle, high)
    return high


def _samples(model: Pieces, P: BoxLyapunov, demand: Demand, points: int) -> _Samples:
    nx, _, ny = model.sizes
    moves, here, outputs, rises = [], [], [], []
    for region in regions(model, P.knots, demand.motion, demand.moving(P.degrees)):
        pair = Pair(P.segment(region.segment), P.segment(region.next_segment))
        for F in decrease(model, region, pair, demand, float):
            local = _grid(F, points)
            moves.append(F(local))
            here.append(pair.here(local[:, : len(region.box)]))
        if demand.kind.indexed:
            for G in decrease(model, region, pair, demand, float, 1.0):
                rises.append(moves[len(rises)] - G(_grid(G, points)))
        if demand.of_gramian:
            F = output_form(model, region, pair.here, demand, float)
            outputs.append(F(_grid(F, points)))
    return _Samples(moves, here, outputs, rises, nx, demand.seen(ny))


def _grid(F: PolynomialMatrix, points: int) -> Array:
    """Return points of the box, ends included."""
    every = [
        np.linspace(low, high, points if d else 1)
        for d, (low, high) in zip(F.degrees, F.box, strict=True)
    ]
    return np.array(list(product(*every)))
