"""What the check programs compare: rows to compute with, and how far other machines may be off."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symheli.values.arrays import Array

TOLERANCE = {"double": 1e-9, "single": 1e-3}
"""What another compiler or processor may differ by, relative to max(1, size): it may contract
products and sums.
"""


def samples(signals: int, ranges: Iterable[tuple[float, float]], count: int) -> Array:
    """Rows of `signals` normal numbers and a point of the ranges, the sample in the middle missing:
    numbers to compute with, no flight.
    """
    rng = np.random.default_rng(0)
    points = [low + (high - low) * rng.uniform(size=count) for low, high in ranges]
    rows = np.column_stack([rng.standard_normal((count, signals)), *points])
    rows[count // 2, 0] = np.nan
    return rows
