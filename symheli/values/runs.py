"""Runs of True in a mask."""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array


def runs(inside: Array) -> list[tuple[int, int]]:
    """Return the first sample, and the one behind the last, of each run of True in a mask (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(inside, int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
