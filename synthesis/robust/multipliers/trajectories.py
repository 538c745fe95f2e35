"""Lower bounds of gains to a peak: single motions of a loop with parameters that jump, and energies
of constant members. Nothing is shared with the multipliers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.values.arrays import Array
from synthesis.robust.multipliers.members import Family

STEPS, HORIZON = 400, 12.0
"""Largest number of steps, and time constants of the slowest mode that are looked at."""
FINE = 40.0
"""Steps in a time constant of the fastest mode, in continuous time."""
DIRECTIONS, KEPT = 48, 24
"""Directions of the output, and motions that are followed at once."""


class Closed(NamedTuple):
    """A member: x+ = A x + B f, y = C x + D f."""

    A: Array
    B: Array
    C: Array
    D: Array


def closed(family: Family, numbers: Sequence[float]) -> Closed:
    """Return the loop of a constant linear member."""
    A, B, C, D, into, out, _ = family.plant
    K = np.real(family.delta(numbers, np.zeros(1))[0])
    inner = np.linalg.solve(np.eye(len(K)) - K @ D, K)
    f, y = list(into), list(out)
    left = np.eye(len(C)) + D @ inner
    return Closed(
        A + B @ inner @ C,
        (B @ inner @ D + B)[:, f],
        (left @ C)[y],
        (left @ D)[np.ix_(y, f)],
    )


def energy_to_peak(family: Family) -> tuple[float, tuple[float, ...]]:
    """Return the largest peak of y for an energy of one, of constant members, and the member."""
    best = 0.0, tuple(family.members()[0])
    for numbers in family.members():
        own = closed(family, numbers)
        if not family.stable(numbers):
            return math.inf, numbers
        if not len(own.A):
            square = own.D @ own.D.T
        elif family.dt is None:
            W = linalg.solve_continuous_lyapunov(own.A, -own.B @ own.B.T)
            square = own.C @ W @ own.C.T
        else:
            W = linalg.solve_discrete_lyapunov(own.A, own.B @ own.B.T)
            square = own.C @ W @ own.C.T + own.D @ own.D.T
        value = math.sqrt(max(float(np.linalg.eigvalsh(square)[-1]), 0.0))
        best = max(best, (value, numbers), key=lambda pair: pair[0])
    return best


def peak_to_peak(family: Family) -> tuple[float, tuple[float, ...]]:
    """Return the largest peak of y for inputs of size one at every instant, over motions along
    which parameters jump between the ends of their ranges, and the numbers at the last instant.
    """
    corners = list(itertools.product(*(sorted({a, b}) for a, b in family.ranges)))
    own = [closed(family, numbers) for numbers in corners]
    if not all(map(family.stable, corners)):
        return math.inf, corners[0]
    own, steps = _stepped(own, family.dt)
    jumping = [
        getattr(b, "rate", 0.0) == math.inf or not getattr(b, "constant", True)
        for b in family.blocks
    ]
    free = all(jumping)
    best = 0.0, corners[0]
    for u in _directions(len(own[0].C)):
        for last, corner in zip(own, corners, strict=True):
            others = own if free else [last]
            value = _largest(u, last, others, steps)
            best = max(best, (value, corner), key=lambda pair: pair[0])
    return best


def _stepped(members: list[Closed], dt: float | None) -> tuple[list[Closed], int]:
    """Return members over steps in which f is constant, and a number of steps."""
    if dt is None:
        rates = np.concatenate([np.linalg.eigvals(m.A) for m in members])
        slow, fast = max(-rates.real.max(), 1e-9), np.abs(rates).max()
        h = max(1 / (FINE * fast) if fast else 1.0, HORIZON / slow / STEPS)
        out = []
        for A, B, C, D in members:
            n, m = B.shape
            E = linalg.expm(h * np.block([[A, B], [np.zeros((m, n + m))]]))[:n]
            out.append(Closed(E[:, :n], E[:, n:], C, D))
        return out, STEPS
    radius = max(np.abs(np.linalg.eigvals(m.A)).max(initial=0.0) for m in members)
    steps = HORIZON / -math.log(radius) if 0 < radius < 1 else 2.0
    return members, int(min(max(steps, 4), STEPS))


def _directions(size: int) -> Array:
    if size == 1:
        return np.ones((1, 1))
    if size == 2:
        angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        return np.column_stack([np.cos(angles), np.sin(angles)])
    drawn = np.random.default_rng(0).normal(size=(DIRECTIONS, size))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1)[:, None])


def _largest(u: Array, last: Closed, members: Sequence[Closed], steps: int) -> float:
    """Return the largest u'y found at an instant with that member, backwards in time: of every step
    the best `KEPT` motions are followed.
    """
    rows, values = (u @ last.C)[None], np.array([np.linalg.norm(u @ last.D)])
    for _ in range(steps):
        gains = np.concatenate([values + np.linalg.norm(rows @ m.B, axis=1) for m in members])
        rows = np.concatenate([rows @ m.A for m in members])
        reach = np.concatenate(
            [np.linalg.norm(rows @ m.B, axis=1)[:, None] for m in members], axis=1
        )
        order = np.argsort(-(gains + reach.max(axis=1)))[:KEPT]
        rows, values = rows[order], gains[order]
    return float(values.max())
