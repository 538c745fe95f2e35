"""Cholesky factorisation of a symmetric matrix of square blocks, sparse if P is a spline (a band),
dense if functions of P overlap over the whole range.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import linalg

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.symmetric import length

MAX_DENSE_ROWS = 128
"""Number of rows of a block below which a matrix without zero blocks is factored as one dense
matrix.
"""


class BlockCholesky:
    """M = L L' of a positive definite M by its lower blocks {(i, j): block}, i >= j, each (v, v).

    Raises `numpy.linalg.LinAlgError` where M is not positive definite. The blocks are overwritten.
    """

    def __init__(self, blocks: Mapping[tuple[int, int], Array]):
        self.size = 1 + max(i for i, _ in blocks)
        self.whole: Array | None = None
        self.columns: list[dict[int, Array]] = [{} for _ in range(self.size)]
        rows = len(next(iter(blocks.values())))
        if rows < MAX_DENSE_ROWS and len(blocks) == length(self.size):
            self._factor_whole(blocks, rows)
        else:
            self._factor_blocks(blocks)

    def _factor_whole(self, blocks: Mapping[tuple[int, int], Array], v: int) -> None:
        M = np.zeros((self.size, v, self.size, v))
        for (i, j), block in blocks.items():
            M[i, :, j] = block
        # of the transpose, whose columns are contiguous, the upper triangle is factored
        self.whole = linalg.cholesky(
            M.reshape(self.size * v, -1).T, check_finite=False, overwrite_a=True
        )

    def _factor_blocks(self, blocks: Mapping[tuple[int, int], Array]) -> None:
        for (i, j), block in blocks.items():
            self.columns[j][i] = block
        for k, column in enumerate(self.columns):
            pivot = linalg.cholesky(column[k], lower=True, check_finite=False, overwrite_a=True)
            column[k] = pivot
            below = sorted(i for i in column if i > k)
            for i in below:
                # L_ik = M_ik L_kk^-T
                column[i] = linalg.solve_triangular(
                    pivot, column[i].T, lower=True, check_finite=False
                ).T
            for at, j in enumerate(below):
                for i in below[at:]:
                    update = column[i] @ column[j].T
                    if i in self.columns[j]:
                        self.columns[j][i] -= update
                    else:
                        self.columns[j][i] = -update

    def solve(self, b: Array) -> Array:
        """Return x (size, v) with M x = b."""
        if self.whole is not None:
            solved = linalg.cho_solve((self.whole, False), b.ravel(), check_finite=False)
            return solved.reshape(b.shape)
        x = b.copy()
        for k, column in enumerate(self.columns):
            x[k] = linalg.solve_triangular(column[k], x[k], lower=True, check_finite=False)
            for i, block in column.items():
                if i > k:
                    x[i] -= block @ x[k]
        for k in reversed(range(self.size)):
            column = self.columns[k]
            for i, block in column.items():
                if i > k:
                    x[k] -= block.T @ x[i]
            x[k] = linalg.solve_triangular(column[k], x[k], lower=True, trans=1, check_finite=False)
        return x
