"""The covariance of a sum of terms that are correlated over some samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from symheli.values.arrays import Array


def long_run_covariance(parts: Iterable[Array], lags: int) -> Array:
    """Covariance (n, n) of the sum of all rows of `parts`, arrays (k, n) one after the other.

    Products of rows up to `lags` apart count, tapered (Bartlett); summed as squares of moving sums,
    so that the result is never indefinite. Source: Newey and West, Econometrica 55 (1987).
    """
    total, tail = np.zeros((0, 0)), np.zeros((0, 0))
    for rows in _run_out(parts, lags):
        if not total.size:
            total, tail = np.zeros((rows.shape[1],) * 2), np.zeros((0, rows.shape[1]))
        whole = np.vstack([tail, rows])
        sums = np.cumsum(np.vstack([np.zeros((1, whole.shape[1])), whole]), axis=0)
        ends = np.arange(len(tail) + 1, len(whole) + 1)
        moving = sums[ends] - sums[np.maximum(ends - lags - 1, 0)]
        total += moving.T @ moving
        tail = whole[max(len(whole) - lags, 0) :]
    return total / (lags + 1)


def _run_out(parts: Iterable[Array], lags: int) -> Iterator[Array]:
    """Yield the parts, and zeros at which the last moving sums end."""
    width = 0
    for rows in parts:
        width = rows.shape[1]
        yield rows
    yield np.zeros((lags, width))
