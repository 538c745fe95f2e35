"""A second writing of the inequalities of this room, at single frequencies and from the definition.

Nothing is shared with the proof: responses are solved for in floating point of 60 digits, and each
inequality stands as in the textbook. It covers no frequency between, so that it proves nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.values.arrays import Array

if TYPE_CHECKING:
    from synthesis.robust.exact_loop import ExactLoop
    from synthesis.robust.intervals import LevelProof
    from synthesis.robust.slope import SlopeProof

DIGITS = 60
FREQUENCIES = 40
"""Frequencies besides those of the poles at which a slope is looked at."""


def slope_is_borne(proof: SlopeProof) -> bool:
    """Whether G is stable and Re M (1/k - G) > 0 at frequencies about its poles."""
    mp = _arithmetic()
    A, b, c = (mp.matrix(np.atleast_2d(M).tolist()) for M in (proof.A, proof.b, proof.c))
    poles = mp.eig(A, left=False, right=False) if len(A) else []
    if any(mp.re(p) >= 0 for p in poles):
        return False
    sizes = [abs(p) for p in poles]
    low, high = min(sizes) / 10, max(sizes) * 10
    steps = [low * (high / low) ** (mp.mpf(k) / FREQUENCIES) for k in range(FREQUENCIES + 1)]
    for w in [mp.mpf(0), *steps, *sizes, *(abs(mp.im(p)) for p in poles)]:
        s = mp.mpc(0, w)
        G = (c * mp.lu_solve(s * mp.eye(A.rows) - A, b.T))[0] + mp.mpf(proof.d)
        M = 1 + mp.mpf(proof.popov) * s
        for j, pole in enumerate(proof.poles):
            a = mp.mpf(float(pole))
            for r in range(len(proof.causal)):
                M -= mp.mpf(float(proof.causal[r, j])) * (a / (a + s)) ** (r + 1)
                M -= mp.mpf(float(proof.ahead[r, j])) * (a / (a - s)) ** (r + 1)
        inverse = mp.mpf(0) if np.isinf(proof.slope) else 1 / mp.mpf(proof.slope)
        left = mp.re(M * (inverse - G))
        if not (left > 0 or (inverse == 0 and left == 0)):
            return False
    weights = [mp.mpf(float(v)) for v in (*proof.causal.ravel(), *proof.ahead.ravel())]
    return sum(map(abs, weights), mp.mpf(0)) < 1 and (proof.odd or all(v >= 0 for v in weights))


def level_is_kept(proof: LevelProof, loop: ExactLoop) -> bool:
    """Whether W - M* Z M - i (G M - M* G*) > 0 at both ends and the middle of every interval."""
    mp = _arithmetic()
    A, B, C, D = (_matrix(mp, M) for M in loop[:4])
    rows, columns = (mp.diag([mp.mpf(float(v)) for v in u]) for u in (proof.rows, proof.columns))
    for low, high, by in proof.intervals:
        for w in (low, (low * high) ** 0.5 if 0 < low < high < np.inf else low, high):
            M = D
            if not np.isinf(w):
                s = mp.mpc(0, w)
                s = (1 + s) / (1 - s) if loop.sampled else s
                M = D + C * mp.inverse(s * mp.eye(A.rows) - A) * B if A.rows else D
            elif loop.sampled and A.rows:
                M = D - C * mp.inverse(mp.eye(A.rows) + A) * B
            M = rows * M * columns
            Z, W, G = (_matrix(mp, m) for m in by)
            for k, part in enumerate(proof.parts):
                if not proof.performance or k == len(proof.parts) - 1:
                    for i in range(part.columns.start, part.columns.stop):
                        for j in range(W.cols):
                            W[i, j] *= mp.mpf(proof.level) ** 2
            T = G * M
            F = W - M.H * Z * M - mp.mpc(0, 1) * (T - T.H)
            if min(mp.eighe((F + F.H) / 2, eigvals_only=True)) <= 0:
                return False
    return True


def _matrix(mp: Any, M: Array) -> Any:
    """Return doubles, complex ones or rationals in the arithmetic."""

    def number(v: Any) -> Any:
        if isinstance(v, complex):
            return mp.mpc(v.real, v.imag)
        return mp.mpf(v.numerator) / v.denominator if hasattr(v, "numerator") else mp.mpf(v)

    out = mp.zeros(*M.shape)
    for i, row in enumerate(M.tolist()):
        for j, v in enumerate(row):
            out[i, j] = number(v)
    return out


def _arithmetic() -> Any:
    """Import mpmath on use, at its own precision."""
    import mpmath

    mp = mpmath.mp.clone()
    mp.dps = DIGITS
    return mp
