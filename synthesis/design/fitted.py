"""Gains known at some p as functions of p."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.polynomials import lobatto_points, polynomials

Array = np.ndarray

DEGREES = {1: (0, 1, 2, 3, 4, 5, 6, 8, 10, 12), 2: (0, 1, 2, 3, 4, 5, 6)}
"""Of the polynomials that are tried in turn (more parameters: those of two, up to 4)."""
NEGLIGIBLE = 0.01
"""Of the geometric mean of the largest entries of its row and column an entry matters from here."""
NODES = {1: 41, 2: 13}
"""Values of each parameter at which the gains are computed (more parameters: 7)."""


def fitted(
    gains: Callable[[Array], Array],
    parameters: Sequence[Scheduling],
    accuracy: float,
) -> tuple[FunctionSpace, Array, float]:
    """(basis, coefficients, misfit): polynomials of the least degree that are within `accuracy` of
    every gain, or of the highest that is tried.

    `gains` (K, r, c) at p (K, m). The misfit is the largest of an entry relative to that entry, one
    that is small in its row and column relative to `NEGLIGIBLE` of those.
    """
    m = len(parameters)
    box = [(s.low, s.high) for s in parameters]
    p = lobatto_points(NODES.get(m, 7), box)
    values = gains(p.reshape(len(p), -1))
    size = np.abs(values).max(axis=0)
    rows, columns = (size.max(axis=k, keepdims=True, initial=0.0) for k in (1, 0))
    size = np.maximum(size, NEGLIGIBLE * np.sqrt(rows * columns))
    size[size == 0] = 1.0
    best: tuple[FunctionSpace, Array, float] | None = None
    for degree in DEGREES.get(m, tuple(range(5))):
        basis = polynomials([degree] * m, box)
        coefficients = basis.fit(p, values)
        off = np.abs(np.tensordot(basis(p), coefficients, axes=1) - values)
        best = basis, coefficients, float((off / size).max(initial=0.0))
        if best[2] <= accuracy:
            break
    assert best is not None  # noqa: S101 - some degree is always tried
    return best
