"""Units of the states in which couplings are as strong both ways (Osborne's balancing)."""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array

MIN_BALANCED = 1e-3
"""Couplings of which both directions are below this fraction of the states' own rate are not
balanced.
"""


MAX_SWEEPS = 100
"""Largest number of sweeps of balancing."""


def balance(A: Array, B: Array, C: Array) -> Array:
    """Return d (n,) such that each state of z = x/d is driven by other states and inputs as
    strongly as it drives other states and outputs.

    A (n, n) of sizes, its diagonal the states' own. Osborne's balancing of the whole system matrix;
    a state without other couplings ends at `MIN_BALANCED`.
    """
    n = len(A)
    d, own = np.ones(n), np.abs(np.diag(A))
    own = np.where(own > 0, own, max(float(np.abs(A).max(initial=0.0)), 1.0))
    A, into, out = (
        np.abs(A - np.diag(np.diag(A))),
        np.linalg.norm(B, axis=1),
        np.linalg.norm(C, axis=0),
    )
    for _ in range(MAX_SWEEPS):
        # inputs and outputs in the units in which they are as large as one another
        ratio = size_of(out * d) / size_of(into / d)
        unit = np.sqrt(ratio) if into.any() and out.any() else 1.0
        before = d.copy()
        for i in range(n):
            entering = A[i] @ d / d[i] + into[i] * unit / d[i] + MIN_BALANCED * own[i]
            leaving = A[:, i] @ (1 / d) * d[i] + out[i] / unit * d[i] + MIN_BALANCED * own[i]
            d[i] *= np.sqrt(entering / leaving)
        if np.abs(np.log(d / before)).max(initial=0.0) < 0.05:
            break
    return d


def size_of(M: Array) -> float:
    """Return the largest entry, 1 where there is none."""
    return float(np.abs(M).max(initial=0.0)) or 1.0
