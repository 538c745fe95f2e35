"""Covariances over a few samples: block-banded Cholesky factors, and whitening with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from symheli.errors import AccuracyError
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class Whitening:
    """Whitening of e(k) = sum_i L_i(k) v(k-i) + .., a sum of such terms with white v: G with G G'
    the covariance of e, blocks below the diagonal only as far as the sums reach.

    `band` is G in LAPACK's lower banded storage; `steps` are (m, size, size) blocks: the inverse of
    the diagonal ones, then that times the one i below.
    """

    band: Array
    steps: tuple[Array, ...]

    @classmethod
    def of(cls, terms: Sequence[tuple[Sequence[Array], Array]]) -> Whitening:
        """Return the whitening from each term's blocks L_0, L_1, .. (m, size, inputs) and variances
        (inputs,); raise `AccuracyError` where the sum is singular to rounding, or no longer finite.
        """
        reach = max(len(L) for L, _ in terms) - 1
        m, size = terms[0][0][0].shape[:2]
        band = np.zeros(((reach + 1) * size, m * size))
        for d in range(reach + 1):
            block = np.zeros((m, size, size))
            for L, variances in terms:
                for i in range(d, len(L)):
                    block[d:] += (L[i][d:] * variances) @ L[i - d][: m - d].swapaxes(1, 2)
            for row, column, offset in _below(d, size):
                band[offset, column : (m - d) * size : size] = block[d:, row, column]
        whole = band[0].copy()
        try:
            band = cholesky_banded(band, lower=True)
            # what rounding leaves of a pivot has either sign, by the library that computes it
            if np.any(band[0] ** 2 <= len(band) * np.finfo(float).eps * whole):
                raise ValueError("a pivot is rounding")
        except ValueError as error:  # LinAlgError among them
            raise AccuracyError(
                f"the covariance of the errors is not numerically positive definite ({error}): the"
                " sizes of noise and gusts differ too much; check their units"
            ) from error
        G = [np.zeros((m, size, size)) for _ in range(reach + 1)]
        for d in range(reach + 1):
            for row, column, offset in _below(d, size):
                G[d][d:, row, column] = band[offset, column : (m - d) * size : size]
        inverse = np.linalg.inv(G[0])
        return cls(band, (inverse, *(inverse @ g for g in G[1:])))

    def whitened(self, e: Array) -> Array:
        """G^-1 e for e (m, size)."""
        return solve_banded((len(self.band) - 1, 0), self.band, e.reshape(-1)).reshape(e.shape)

    def adjoint(self, e: Array) -> Array:
        """G^-T e for e (m, size)."""
        upper = np.zeros_like(self.band)
        width = len(self.band) - 1
        for offset in range(width + 1):
            upper[width - offset, offset:] = self.band[offset, : self.band.shape[1] - offset]
        return solve_banded((0, width), upper, e.reshape(-1)).reshape(e.shape)


def _below(d: int, size: int) -> list[tuple[int, int, int]]:
    """(row, column, offset below the diagonal) of the entries of a block `d` below it that the band
    holds.
    """
    return [
        (row, column, d * size + row - column)
        for row in range(size)
        for column in range(size)
        if d * size + row - column >= 0
    ]
