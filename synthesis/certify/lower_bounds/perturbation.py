"""The worst model of an uncertain one: a Delta of the set with the largest gain of a frozen model,
or the slowest mode.

The derivative of a peak gain, or of a pole, by Delta is a matrix of rank two at most; the point of
the ball that it grows fastest towards has its polar factor as direction. From some Deltas the
ascent goes there, as far as the value grows; p is chosen anew between ascents. What it finds is
attained, whatever it misses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symheli import UncertainStateSpace
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.certify.lower_bounds.frozen import worst_over
from synthesis.numerics.linear.norm import gain_at_poles, norm, surely_unstable

GRID = 17
"""Number of values of p between which the worst perturbation Delta is searched, and of the breaks
of a spline.
"""
STARTS = 2
"""Number of extreme points of the set from which ascents start, besides the nominal model."""
MAX_ROUNDS = 3
"""Largest number of times that p is chosen anew."""
MAX_STEPS = 20
"""Largest number of steps of an ascent at one p."""
MIN_INCREASE = 1e-4
"""Relative increase of a step below which an ascent ends."""
SEED = 0


class Perturbed(NamedTuple):
    """`delta` (nd, nv), and the worst value of its frozen models, at `p`: the gain, or the growth
    in 1/s. `unstable` there, beyond rounding.
    """

    delta: Array
    value: float
    p: float
    unstable: bool = False


def worst_perturbation(unc: UncertainStateSpace, *, gains: bool) -> Perturbed:
    """Return the worst Delta found: of the largest gain of a frozen model (inf: unstable), or with
    `gains` False of the fastest growing mode.
    """
    frozen = _FrozenModels.of(unc, gains)
    grid = np.linspace(unc.scheduling.low, unc.scheduling.high, GRID)
    ends = [p for piece in unc.model.basis.pieces() for p in (piece.low, piece.high)]
    grid = np.unique([*grid, *(p for p in ends if grid[0] < p < grid[-1])])
    starts = [np.zeros(unc.shape)]
    if unc.bound > 0:
        starts += [*unc.perturbations(STARTS, SEED, "boundary")]
    best = Perturbed(starts[0], -math.inf, float(grid[0]))
    for start in starts:
        delta = start
        for _ in range(MAX_ROUNDS):
            value, at = worst_over(
                lambda p, d=delta: frozen.value(d, float(p[0])), [grid], frozen.rough(delta, grid)
            )
            p = float(at[0])
            if value > best.value:
                best = Perturbed(delta, value, p)
            if value == math.inf or unc.bound == 0:
                break
            delta, climbed = frozen.climbed(delta, value, p, unc.bound)
            if climbed > best.value:
                best = Perturbed(delta, climbed, p)
            if climbed <= value + MIN_INCREASE * abs(value) or climbed == math.inf:
                break
        if best.value == math.inf:
            break
    return best._replace(unstable=surely_unstable(frozen.closed(best.delta, best.p).A, unc.dt))


class _FrozenModels(NamedTuple):
    """The models frozen at each p, with the block open: inputs (u, d), outputs (y, v) in any
    order.
    """

    unc: UncertainStateSpace
    d: list[int]
    v: list[int]
    u: list[int]
    y: list[int]
    gains: bool

    @classmethod
    def of(cls, unc: UncertainStateSpace, gains: bool) -> _FrozenModels:
        into, out = unc.model.inputs, unc.model.outputs
        return cls(
            unc,
            indices(unc.perturbation_inputs, into, "input"),
            indices(unc.perturbation_outputs, out, "output"),
            indices(unc.inputs, into, "input"),
            indices(unc.outputs, out, "output"),
            gains,
        )

    def closed(self, delta: Array, p: float | Array) -> Matrices:
        """Return the frozen models with d = delta v + the input d."""
        A, B, C, D = self.unc.model.matrices(p)
        K = np.zeros((B.shape[-1], C.shape[-2]))
        K[np.ix_(self.d, self.v)] = delta
        N = np.linalg.inv(np.eye(len(K)) - K @ D)
        return Matrices(A + B @ N @ K @ C, B @ N, C + D @ N @ K @ C, D @ N)

    def value(self, delta: Array, p: float) -> float:
        """Return the objective of the ascent."""
        return self._value(self.closed(delta, p))

    def rough(self, delta: Array, p: Array) -> Array:
        """Return the objective at each p (k,), of gains a lower bound near it."""
        at = self.closed(delta, p)
        return gain_at_poles(*self._between(at), self.unc.dt) if self.gains else self._growth(at.A)

    def _value(self, at: Matrices) -> float:
        if self.gains:
            return norm(*self._between(at), self.unc.dt)[0]
        return float(self._growth(at.A))

    def _between(self, at: Matrices) -> Matrices:
        """The channels from u to y."""
        B, C = at.B[..., self.u], at.C[..., self.y, :]
        return Matrices(at.A, B, C, at.D[..., self.y, :][..., self.u])

    def _growth(self, A: Array) -> Array:
        poles = np.linalg.eigvals(A)
        if self.unc.dt is None:
            return np.real(poles).max(axis=-1)
        return np.log(np.maximum(np.abs(poles).max(axis=-1), 1e-300)) / self.unc.dt

    def slope(self, at: Matrices) -> Array:
        """Return the derivative of the value by Delta, (nd, nv), up to a positive factor."""
        A, B, C, D = at
        E, G = B[:, self.d], C[self.v]
        if not self.gains:
            poles, right = np.linalg.eig(A)
            k = int(np.argmax(np.real(poles) if self.unc.dt is None else np.abs(poles)))
            left = np.linalg.inv(right)[k]
            turn = 1.0 if self.unc.dt is None else np.conj(poles[k]) / max(abs(poles[k]), 1e-300)
            return np.real(np.outer(turn * (left @ E), G @ right[:, k]))
        u, y = self.u, self.y
        _, omega = norm(*self._between(at), self.unc.dt)
        if math.isinf(omega):
            into, received, out = D[np.ix_(y, self.d)], D[np.ix_(self.v, u)], D[np.ix_(y, u)]
        else:
            dt = self.unc.dt
            z = 1j * omega if dt is None else np.exp(1j * omega * dt)
            X = np.linalg.solve(z * np.eye(len(A)) - A, B)
            into = C[y] @ X[:, self.d] + D[np.ix_(y, self.d)]
            received = G @ X[:, u] + D[np.ix_(self.v, u)]
            out = C[y] @ X[:, u] + D[np.ix_(y, u)]
        left, _, right = np.linalg.svd(out)
        return np.real(np.outer(np.conj(left[:, 0]) @ into, received @ np.conj(right[0])))

    def climbed(self, delta: Array, value: float, p: float, bound: float) -> tuple[Array, float]:
        """Return a better Delta at this p, and its value; the same where none was found."""
        for _ in range(MAX_STEPS):
            slope = self.slope(self.closed(delta, p))
            towards = np.zeros_like(delta)
            for place in self.unc.places:
                left, sizes, right = np.linalg.svd(slope[place], full_matrices=False)
                # where it does not matter Delta stays: directions of no slope are rounding
                large = sizes > 1e-8 * max(float(sizes[0]), 1e-300)
                towards[place] = bound * (left[:, large] @ right[large])
            for share in (1.0, 0.5, 0.2, 0.05):
                trial = delta + share * (towards - delta)
                found = self.value(trial, p)
                if found > value:
                    break
            else:
                return delta, value
            gained = found - value
            delta, value = trial, found
            if value == math.inf or gained <= MIN_INCREASE * abs(value):
                return delta, value
        return delta, value
