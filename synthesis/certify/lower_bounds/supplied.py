"""Levels of a supply rate that no proof can undercut: at single frequencies of frozen models, and
along waves of p.

For an input u and its response y = T u over one period the supply is u'M0 u + g u'M1 u; a level g
at which it is negative for some u is refuted. The least g that is not is an eigenvalue, for T the
response at a frequency or the lifted response over a cycle.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy import linalg

from symheli import LPVStateSpace
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.lower_bound import LowerBoundSearch
from synthesis.certify.lower_bounds.paths import Budget, WaveFamily, samples, steps
from synthesis.certify.lower_bounds.periodic import Lifted
from synthesis.certify.statement.kind import Kind
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.linear.norm import stable

FREQUENCIES = 60
"""Frequencies at which a frozen model is first looked at; the worst is then refined."""
ZOOMS = 12
"""Times that the interval about the worst frequency is cut to a quarter."""
WAVES = 12
"""Waves that are examined, those of the fastest growth first."""
PHASES = (1.0, -1.0, 1j)
"""Factors z of the input from one cycle to the next."""


def frozen_level(A: Array, B: Array, C: Array, D: Array, dt: float | None, kind: Kind) -> float:
    """Return the worst bound of a frozen model over frequencies, times the sense of the kind, so
    that larger is worse; inf where the model is not stable.
    """
    poles = np.linalg.eigvals(A)
    if not stable(poles, dt):
        return math.inf
    one = np.eye(len(A))

    def at(omega: Array) -> Array:
        s = 1j * omega if dt is None else np.exp(1j * omega * dt)
        right = np.broadcast_to(B, (len(s), *B.shape))
        T = C @ np.linalg.solve(s[:, None, None] * one - A, right) + D
        return np.array([_worse(each, kind, None) for each in T])

    pace = np.abs(poles) if dt is None else np.abs(np.log(poles.astype(complex) + 1e-300)) / dt
    pace = pace[pace > 0] if np.any(pace > 0) else np.ones(1)
    top = 1e3 * pace.max() if dt is None else math.pi / dt
    every = np.unique(np.r_[0.0, pace, np.geomspace(1e-3 * pace.min(), top, FREQUENCIES)])
    every = every[every <= top]
    values = at(every)
    k = int(values.argmax())
    low, high = every[max(k - 1, 0)], every[min(k + 1, len(every) - 1)]
    for _ in range(ZOOMS):
        finer = np.linspace(low, high, 9)
        values = at(finer)
        k = int(values.argmax())
        low, high = finer[max(k - 1, 0)], finer[min(k + 1, 8)]
    return float(values.max())


def supplied(
    line: LPVStateSpace, rate: float, search: LowerBoundSearch, kind: Kind
) -> tuple[float, SchedulingTrajectory | None]:
    """Return the worst bound along waves of p, times the sense of the kind, less the error of the
    time steps; inf where the state grows.
    """
    family = WaveFamily(line, rate, search)
    best: tuple[float, SchedulingTrajectory | None] = (-math.inf, None)
    budget = Budget(search.seconds)
    for wave in tracked("searching for a supply that is negative", family.coarse()[:WAVES]):
        if budget.over:
            break
        cycle = SchedulingTrajectory(*wave.vertices())
        longest = max(family.longest, wave.period / search.steps)
        values = []
        for finer in (1, 2) if line.dt is None else (1, 1):
            whole = Lifted.of(steps(line, cycle.time, cycle.p, longest / finer))
            if np.abs(np.linalg.eigvals(whole.F)).max() >= 1:
                return math.inf, cycle
            values.append(max(_along(whole, line, kind, z) for z in PHASES))
        value = values[1] - abs(values[1] - values[0])
        if value > best[0]:
            best = value, cycle if line.dt is None else samples(cycle, line.dt)
    return best


def _along(whole: Lifted, line: LPVStateSpace, kind: Kind, z: complex) -> float:
    """Return the worst bound at one factor z of the lifted response."""
    T = whole.J + whole.H @ np.linalg.solve(z * np.eye(len(whole.F)) - whole.F, whole.G)
    ny = len(line.outputs)
    if line.dt is not None:
        return _worse(T, kind, None)
    # outputs stand at two points of each step, times the root of half of it
    both = math.sqrt(0.5) * np.hstack([np.eye(ny), np.eye(ny)])
    steps_ = len(T) // (2 * ny)
    return _worse(T, kind, lambda M: linalg.block_diag(*[both] * steps_) @ M)


def _worse(T: Array, kind: Kind, paired: Callable[[Array], Array] | None) -> float:
    """Return the bound that the response T (ny, nu) refutes, times the sense of the kind: of the
    least g with u'M0 u + g u'M1 u >= 0 for every u; -inf where every g is refuted or none.
    """
    facets = kind.facets
    own = T if paired is None else paired(T)
    energy, cross, one = T.conj().T @ T, own + own.conj().T, np.eye(T.shape[1])
    assert facets.supply is not None  # noqa: S101 - asked of kinds with one
    q, s, r = (float(v) for v in facets.supply(float, 1.0))
    at_zero = q * energy + s * cross + r * one
    rise = facets.rise.outputs * energy + facets.rise.cross * cross + facets.rise.inputs * one
    try:
        if len(one) == 1:
            ratio = -at_zero[0, 0].real / rise[0, 0].real if rise[0, 0].real > 0 else -math.inf
            return facets.sense * facets.bound(float(ratio)) if math.isfinite(ratio) else -math.inf
        g = float(linalg.eigh(-at_zero, rise, eigvals_only=True)[-1])
    except np.linalg.LinAlgError:
        return -math.inf
    return facets.sense * facets.bound(g)
