"""Instability of a matrix beyond the rounding of its eigenvalues."""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray


def surely_unstable(A: Array, dt: float | None) -> bool:
    """Whether A (n, n), and every matrix within the backward error of the eigenvalues, has an
    unstable pole.

    That error is at most 10 n eps |A|, A balanced; no such change takes a pole across the border
    where the smallest singular value of s - A is larger all along it. dt None: continuous time.
    Source: Van Loan, "How near is a stable matrix to an unstable matrix?", Contemporary Mathematics
    47 (1985).
    """
    A = np.asarray(linalg.matrix_balance(A, permute=False)[0])
    poles = np.linalg.eigvals(A)
    if not np.any(poles.real > 0 if dt is None else np.abs(poles) > 1):
        return False
    if dt is None:
        size = np.abs(poles)
        border = 1j * np.concatenate(
            [[0.0], np.abs(poles.imag), size, np.linspace(0.0, 1.5 * size.max(), 50)]
        )
    else:
        border = np.exp(1j * np.concatenate([np.abs(np.angle(poles)), np.linspace(0.0, np.pi, 50)]))
    distance = np.linalg.svd(border[:, None, None] * np.eye(len(A)) - A, compute_uv=False)[
        :, -1
    ].min()
    return bool(distance > 10 * len(A) * np.finfo(float).eps * np.linalg.norm(A))
