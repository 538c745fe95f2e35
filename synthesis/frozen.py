"""The largest H-infinity norm of the models frozen at each p: what no gain of the LPV model can undercut."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from symheli.lpv import LPVStateSpace
from synthesis.scheduled import Scheduled

Array = np.ndarray


class FrozenGain(NamedTuple):
    """The largest frozen gain `gamma`, the `p` and frequency `omega` (rad/s) where it occurs; inf where unstable."""

    gamma: float
    p: float
    omega: float


def frozen_gain(lpv: Scheduled, *, points: int = 61, tolerance: float = 1e-8) -> FrozenGain:
    """max over p of the H-infinity norm of the frozen models, by a grid of `points` and local search around its peaks.

    Each norm by the level-set method on a Hamiltonian matrix (Boyd and Balakrishnan 1990; Bruinsma and Steinbuch 1990),
    to a relative `tolerance` from below. gamma is inf where a frozen model is unstable. The breaks of a spline are on the grid.
    """
    low, high = lpv.scheduling.low, lpv.scheduling.high
    grid = np.linspace(low, high, points)
    if isinstance(lpv, LPVStateSpace):
        grid = np.unique(np.concatenate([grid, [p for piece in lpv.basis.pieces() for p in (piece.low, piece.high) if low < p < high]]))
    found: list[FrozenGain] = []
    for p in grid:
        gain, omega = norm(*lpv.matrices(float(p)), lpv.dt, tolerance)
        found.append(FrozenGain(gain, float(p), omega))
        if math.isinf(gain):
            return found[-1]
    best = max(found, key=lambda f: f.gamma)
    for k in _peaks([f.gamma for f in found])[:3]:
        a, b = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])
        result: Any = minimize_scalar(
            lambda p: -norm(*lpv.matrices(float(p)), lpv.dt, tolerance)[0],
            bounds=(a, b), method="bounded", options={"xatol": 1e-6 * (b - a)},
        )  # fmt: skip
        gain, omega = norm(*lpv.matrices(float(result.x)), lpv.dt, tolerance)
        best = max(best, FrozenGain(gain, float(result.x), omega), key=lambda f: f.gamma)
    return best


def least_damped(lpv: Scheduled, points: int = 201) -> tuple[float, float]:
    """(stability margin, p) of the worst frozen model: min of -Re(pole) (rad/s), or of 1 - |pole| in discrete time."""
    grid = np.linspace(lpv.scheduling.low, lpv.scheduling.high, points)
    poles = np.linalg.eigvals(lpv.matrices(grid).A)
    margins = (-poles.real if lpv.dt is None else 1 - np.abs(poles)).min(axis=1)
    k = int(np.argmin(margins))
    return float(margins[k]), float(grid[k])


def norm(A: Array, B: Array, C: Array, D: Array, dt: float | None = None, tolerance: float = 1e-8) -> tuple[float, float]:
    """H-infinity norm and the frequency (rad/s) of its peak; (inf, nan) where a pole is not strictly stable."""
    if min(B.shape[1], C.shape[0]) == 0:
        return 0.0, 0.0
    poles = np.linalg.eigvals(A)
    if not np.all(poles.real < 0 if dt is None else np.abs(poles) < 1):
        return math.inf, math.nan
    if dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
        poles = np.linalg.eigvals(A)

    def gains(omega: Array) -> Array:
        responses = C @ np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(omega), *B.shape))) + D
        return np.linalg.svd(responses, compute_uv=False)[:, 0]

    start = np.concatenate([[0.0], np.abs(poles), np.abs(poles.imag)])
    values = gains(start)
    best, omega = float(values.max()), float(start[values.argmax()])
    at_infinity = float(np.linalg.norm(D, 2))
    if at_infinity > best:
        best, omega = at_infinity, math.inf
    if best == 0.0:
        return 0.0, 0.0
    for _ in range(50):
        between = crossings(A, B, C, D, best * (1 + tolerance))
        if len(between) < 2:
            break
        middles = 0.5 * (between[:-1] + between[1:])
        values = gains(middles)
        if values.max() <= best * (1 + tolerance):
            break
        best, omega = float(values.max()), float(middles[values.argmax()])
    if dt is not None:
        omega = 2.0 * math.atan(omega) / dt if math.isfinite(omega) else math.pi / dt
    return best, omega


def crossings(A: Array, B: Array, C: Array, D: Array, level: float) -> Array:
    """Frequencies >= 0 where a singular value of the response equals `level`: imaginary eigenvalues of the Hamiltonian."""
    R = level**2 * np.eye(D.shape[1]) - D.T @ D
    RD, RB = np.linalg.solve(R, D.T @ C), np.linalg.solve(R, B.T)
    F = A + B @ RD
    H = np.block([[F, B @ RB], [-C.T @ (C + D @ RD), -F.T]])
    values = np.linalg.eigvals(H)
    on_axis = np.abs(values.real) <= 1e-7 * (1e-3 * np.abs(values).max() + np.abs(values))
    omega = np.unique(np.abs(values[on_axis].imag))
    return np.concatenate([[0.0], omega]) if len(omega) and np.any(omega > 0) else omega


def to_continuous(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array, Array, Array]:
    """The continuous model with the same norm: z = (1 + s)/(1 - s)."""
    n = len(A)
    inverse = np.linalg.inv(A + np.eye(n))
    root = math.sqrt(2.0)
    return inverse @ (A - np.eye(n)), root * inverse @ B, root * C @ inverse, D - C @ inverse @ B


def _peaks(values: list[float]) -> list[int]:
    last = len(values) - 1
    local = [k for k in range(len(values)) if values[k] >= values[max(k - 1, 0)] and values[k] >= values[min(k + 1, last)]]
    return sorted(local, key=lambda k: -values[k])
