"""Is a matrix unstable for sure, or only to the rounding of its eigenvalues?"""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray


def surely_unstable(A: Array, dt: float | None) -> bool:
    """Whether a pole of A (n, n) lies on the wrong side by more than it can be wrong; dt None: continuous time.

    A simple eigenvalue moves by its condition number times the backward error, 10 n eps of the balanced matrix (Wilkinson; Golub
    and Van Loan, section 7.2). Near a defective one that number is large, and nothing is said.
    """
    A = np.asarray(linalg.matrix_balance(A, permute=False)[0])
    poles, left, right = linalg.eig(A, left=True, right=True)
    condition = 1.0 / np.maximum(np.abs(np.sum(left.conj() * right, axis=0)), 1e-300)
    error = 10 * len(A) * np.finfo(float).eps * np.linalg.norm(A) * condition
    beyond = poles.real if dt is None else np.abs(poles) - 1.0
    return bool(np.any(beyond > error))
