"""Gains known at some p as functions of p."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.polynomials import lobatto_points, polynomials

Array = np.ndarray

DEGREES = {1: (0, 1, 2, 3, 4, 5, 6, 8, 10, 12), 2: (0, 1, 2, 3, 4, 5, 6)}
"""Of the polynomials that are tried in turn (more parameters: those of two, up to 4)."""
NODES = {1: 41, 2: 13}
"""Values of each parameter at which the gains are computed (more parameters: 7)."""


def fitted(
    gains: Callable[[Array], Array],
    parameters: Sequence[Scheduling],
    accuracy: float,
    scale: tuple[Array, Array],
) -> tuple[FunctionSpace, Array, float]:
    """(basis, coefficients, misfit): polynomials of the least degree that are within `accuracy` of
    the largest gain, or of the highest that is tried.

    `gains` (K, r, c) at p (K, m); the misfit is the largest spectral norm of rows / scale[0],
    columns * scale[1] relative to that of the gains.
    """
    m = len(parameters)
    box = [(s.low, s.high) for s in parameters]
    p = lobatto_points(NODES.get(m, 7), box)
    values = gains(p.reshape(len(p), -1))
    weigh = (values / scale[0][:, None]) * scale[1]
    size = float(np.linalg.norm(weigh, 2, axis=(1, 2)).max())
    best: tuple[FunctionSpace, Array, float] | None = None
    for degree in DEGREES.get(m, tuple(range(5))):
        basis = polynomials([degree] * m, box)
        coefficients = basis.fit(p, values)
        off = np.tensordot(basis(p), coefficients, axes=1) - values
        miss = float(np.linalg.norm(off / scale[0][:, None] * scale[1], 2, axis=(1, 2)).max())
        best = basis, coefficients, miss / size if size > 0 else 0.0
        if best[2] <= accuracy:
            break
    assert best is not None  # noqa: S101 - some degree is always tried
    return best
