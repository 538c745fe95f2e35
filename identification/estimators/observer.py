"""A Kalman observer instead of the free run: bounded also for an unstable plant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.values.arrays import Array

PROCESS_NOISE = 1e-4
"""Variance of the process noise, as a fraction of that of the output noise: small enough to whiten
the outputs, large enough to keep the observer adapting.
"""


@dataclass(frozen=True, eq=False)
class Observer:
    """Observer of y = x + v, x(k) = -A(k) [x(k-1); x(k-2); ...] + known(k): A (n, ny, na ny),
    `gain` (n, na ny, ny) of the past on the innovation.

    While the plant is stable the gain is small, and the innovation is v; where it is unstable the
    poles of the observer are its own mirrored at the unit circle, which leaves white noise white.
    Source of the mirrored filter: Forssell and Ljung (2000), Identification of unstable systems
    using output error and Box-Jenkins model structures, IEEE Trans. Automatic Control 45.
    """

    A: Array
    gain: Array

    @classmethod
    def of(cls, A: Array, size: Array) -> Observer:
        """Return the observer with the time-varying Kalman gain for white noise v with standard
        deviations `size` (ny,), from a past measured with that noise.
        """
        n, ny, width = A.shape
        R = np.diag(size**2)
        P, drive = np.kron(np.eye(width // ny), R), np.zeros((width, width))
        drive[:ny, :ny] = PROCESS_NOISE * R
        shift, gain = np.eye(width, k=-ny), np.empty((n, width, ny))
        for k in range(n):
            T = shift.copy()
            T[:ny] = -A[k]
            carried = P @ T[:ny].T
            S, cross = T[:ny] @ carried + R, T @ carried
            gain[k] = np.linalg.solve(S, cross.T).T
            P = T @ P @ T.T - gain[k] @ cross.T + drive
            P = 0.5 * (P + P.T)
        return cls(A, gain)

    def innovations(self, equation_error: Array) -> Array:
        """Return the innovations of y, (n, ny, m), where A y = known + `equation_error` (n, ny, m);
        linear in it.
        """
        n, ny, m = equation_error.shape
        width = self.A.shape[2]
        out, past = np.empty_like(equation_error), np.zeros((width, m))
        for k in range(n):
            e = equation_error[k] - self.A[k] @ past
            past[ny:] = past[: width - ny].copy()
            past[:ny] = e
            past -= self.gain[k] @ e
            out[k] = e
        return out
