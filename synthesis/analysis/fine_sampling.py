"""Sampled so finely that a sample hardly changes the state: what the arithmetic of a discrete LMI
then costs.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

FINE = 1e-3
"""A least decay per sample, 1 - |pole|, below which margins of 1e-6 in a discrete LMI are felt in
the third digit of a gain.
"""

WORTH_SAYING = 1.01
"""Bounds that are this far apart may be so because of the sample period."""


def fine_sampling(A: Array, dt: float | None, gamma: float, lower: float) -> tuple[str, ...]:
    """A hypothesis where `gamma`, proven of a model sampled every `dt` seconds, may be loose
    because of that period; else nothing.

    A (k, n, n): frozen models of the range. `lower` is the lower bound on the gain.
    """
    if dt is None or not np.isfinite(gamma) or not gamma > WORTH_SAYING * lower:
        return ()
    decay = 1 - float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
    if not decay < FINE:
        return ()
    return (
        (
            f"sampled every {dt:g} s its slowest mode decays by {decay:.1g} a sample, which is"
            " little beside the margin of the LMIs: the bound may be loose for that alone; analyse"
            " the continuous model, or sample more coarsely"
        ),
    )
