"""Newton's method on the equations of steady flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symheli.values.arrays import Array

TOLERANCE = 1e-9
"""Largest residual of any equation at a trim, in its SI unit."""
ROUNDING = 1e-13
"""Residual below which another Newton step would only move roundings of accelerations of the size
of gravity.
"""
STEPS = 12
"""Most steps taken."""


def newton(
    system: Callable[[Array], tuple[Array, Array]], balanced: Sequence[int], z: Array
) -> tuple[Array, float]:
    """Full Newton steps from z while the largest residual falls: where they end, and the largest
    residual there.

    system(z) -> residual of every equation, derivative of the `balanced` ones. `steady.c` has the
    same iteration for many flights side by side.
    """
    residual, slopes = system(z)
    miss = np.abs(residual).max()
    for _ in range(STEPS):
        try:
            better = z - np.linalg.solve(slopes, residual[balanced])
        except np.linalg.LinAlgError:
            break
        residual, slopes = system(better)
        left = np.abs(residual).max()
        if not left < miss:
            break
        z, miss = better, left
        if miss < ROUNDING:
            break
    return z, float(miss)
