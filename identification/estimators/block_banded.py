"""Covariances over a few samples: block-banded Cholesky factors, and whitening with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs  # type: ignore[attr-defined]

from symheli.errors import AccuracyError
from symheli.values.arrays import Array

TOGETHER = 8
"""Least number of samples in a block of the factor: larger ones take more work each, smaller ones
are more.
"""

AT_ONCE = 64
"""Number of blocks whose rows are formed together."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """Whitening of e(k) = sum_i L_i(k) v(k-i) + .., a sum of such terms with white v: G with G G'
    the covariance of e, blocks below the diagonal only as far as the sums reach.

    `columns` (m, size, (reach + 1) size) are those of G from the diagonal down.
    """

    columns: Array

    @classmethod
    def of(cls, terms: Sequence[tuple[Sequence[Array], Array]]) -> Whitening:
        """Return the whitening from each term's blocks L_0, L_1, .. (m, size, inputs) and variances
        (inputs,), or (n, inputs) of the last n samples; raise `AccuracyError` where the sum is
        singular to rounding, or no longer finite.
        """
        reach = max(len(L) for L, _ in terms) - 1
        m, size = terms[0][0][0].shape[:2]
        columns = np.zeros((m, size, (reach + 1) * size))
        for d in range(min(reach + 1, m)):
            block = np.zeros((m - d, size, size))
            for L, variances in terms:
                for i in range(d, len(L)):
                    own = variances
                    if np.ndim(variances) == 2:
                        ahead = len(variances) - m - i
                        own = variances[ahead + d : ahead + m, None]
                    block += (L[i][d:] * own) @ L[i - d][: m - d].swapaxes(1, 2)
            for column in range(size):
                first, start = 0 if d else column, d * size - column
                below = columns[: m - d, column, start + first : start + size]
                below[:] = block[:, first:, column]
        band = columns.reshape(m * size, -1).T
        whole = band[0].copy()
        try:
            band = cholesky_banded(band, overwrite_ab=True, lower=True)
            # what rounding leaves of a pivot has either sign, by the library that computes it
            if np.any(band[0] ** 2 <= len(band) * np.finfo(float).eps * whole):
                raise ValueError("a pivot is rounding")
        except ValueError as error:  # LinAlgError among them
            raise AccuracyError(
                f"the covariance of the errors is not numerically positive definite ({error}): the"
                " sizes of noise and gusts differ too much; check their units"
            ) from error
        return cls(np.ascontiguousarray(band.T).reshape(columns.shape))

    def whitened(self, e: Array) -> Array:
        """G^-1 e for e (m, size)."""
        return self._solved(e, "N")

    def adjoint(self, e: Array) -> Array:
        """G^-T e for e (m, size)."""
        return self._solved(e, "T")

    def _solved(self, e: Array, transposed: str) -> Array:
        band = self.columns.reshape(e.size, -1).T
        return dtbtrs(band, e.reshape(-1, 1), uplo="L", trans=transposed)[0].reshape(e.shape)


class WhitenedRegressors:
    """Regressors X = G^-1 Y, whitened by the factor G of a `Whitening`.

    Y has own n + a columns. Each of the first `own` equations of a sample has the regressors F (m,
    n) with coefficients of its own, and all equations have D (m, size, a). G is cut into blocks of
    w rows and continued by the identity. `A` are the inverses of the diagonal blocks; `corner` are
    the q rows and columns of the blocks below them that are not 0.
    """

    def __init__(self, white: Whitening, F: Array, D: Array, own: int) -> None:
        m, self.size, deep = white.columns.shape
        samples = max(TOGETHER, deep // self.size - 1)
        count, w, self.q = -(-m // samples), samples * self.size, deep - self.size

        def blocks(each: Array) -> Array:
            out = np.zeros((count * samples, *each.shape[1:]))
            out[:m] = each
            return out.reshape(count, -1, each.shape[-1])

        columns, G = blocks(white.columns), np.zeros((count, w + deep, w))
        columns.reshape(-1, deep)[m * self.size :, 0] = 1.0
        for column in range(w):
            G[:, column : column + deep, column] = columns[:, column]
        self.A = _inverse(G[:, :w])
        self.corner = G[:-1, w : w + self.q, w - self.q :].copy()
        self.push = self.corner @ self.A[:-1, w - self.q :]
        F = blocks(F)
        each = [(slice(i, None, self.size), F) for i in range(own)]
        self.columns = [*each, (slice(None), blocks(D))]

    def gram(self) -> Array:
        """Return X' X = Y' (G G')^-1 Y.

        With S = A' A, the rows of (G G')^-1 Y of a block are S Y, less what the block before adds
        through the first rows, and what the block after adds through the last rows of A.
        """
        A, q, back, own = self.A, self.q, self.corner.swapaxes(1, 2), len(self.columns) - 1
        S, (_, F), (_, D) = A.swapaxes(1, 2) @ A, self.columns[0], self.columns[-1]
        links = -np.concatenate([S[:, :, :q], A[:, -q:].swapaxes(1, 2)], axis=2)
        pull, later = back @ S[1:, :q], back @ links[1:, :q]
        n, a, around = F.shape[2], D.shape[2], np.zeros((len(A), 0, 0))
        out = np.zeros((own * n + a,) * 2)
        for j, (of, each) in enumerate(self.columns):
            if j in (0, own):  # else in the memory of the equation before
                around = np.zeros((len(A), each.shape[1] + 2 * q, each.shape[2]))
                around[:, : -2 * q] = each
            self._before(j, around[:, -2 * q : -q])
            self._times(pull, j, slice(1, None), around[:-1, -q:])
            _carried(later[::-1], around[:0:-1, -2 * q :], around[-2::-1, -q:])
            here, rows = slice(j * n, j * n + each.shape[2]), min(j + 1, own)
            for start in range(0, len(A), AT_ONCE):
                part = slice(start, start + AT_ONCE)
                W = np.concatenate([S[part, :, of], links[part]], axis=2)
                W = W.reshape(len(W), -1, self.size, W.shape[2])[:, :, : j + 1 if j < own else None]
                Z = W.reshape(len(W), -1, W.shape[3]) @ around[part]
                found = F[part].reshape(-1, n).T @ Z.reshape(F[part].size // n, -1)
                found = found.reshape(n, -1, Z.shape[2])[:, :rows].swapaxes(0, 1)
                out[: rows * n, here] += found.reshape(rows * n, -1)
                if j == own:
                    out[here, here] += D[part].reshape(-1, a).T @ Z.reshape(-1, a)
        return np.triu(out) + np.triu(out, 1).T

    def products(self, e: Array) -> Array:
        """Return X' e (m, own n + a) of each sample, for e (m, size)."""
        count, w, _ = self.A.shape
        weights = np.zeros((count * w, 1))
        weights[: e.size, 0] = e.reshape(-1)
        M = (self.A * weights.reshape(count, w, 1)).reshape(count, -1, self.size, w).sum(axis=2)
        found = []
        for j, (_, each) in enumerate(self.columns):
            before = np.zeros((count, self.q, each.shape[2]))
            self._before(j, before)
            found.append(np.empty((count, M.shape[1], each.shape[2])))
            self._times(M, j, slice(None), found[-1])
            found[-1] -= M[:, :, : self.q] @ before
        return np.concatenate(found, axis=2).reshape(count * M.shape[1], -1)[: len(e)]

    def _times(self, M: Array, j: int, blocks: slice, out: Array) -> None:
        """Write M Y (count, .., n) of some blocks, for M (count, .., w): its columns of equation j,
        or of D.
        """
        of, each = self.columns[j]
        np.matmul(np.ascontiguousarray(M[:, :, of]), each[blocks], out=out)

    def _before(self, j: int, out: Array) -> None:
        """Write what the block before adds to the first rows of each block but the first."""
        self._times(self.push, j, slice(None, -1), out[1:])
        _carried(-self.push[:, :, : self.q], out[:-1], out[1:])


def _carried(M: Array, of: Array, to: Array) -> None:
    """Add M[b] of[b] to to[b], one b after the other: of[b + 1] may be part of to[b]."""
    for own, known, sought in zip(np.ascontiguousarray(M), of, to, strict=True):
        sought += own @ known


def _inverse(G: Array) -> Array:
    """Return the inverses of lower triangular matrices (count, w, w), by halves."""
    h = G.shape[1] // 2
    if h < TOGETHER:
        return np.linalg.inv(G)
    out = np.zeros_like(G)
    out[:, :h, :h], out[:, h:, h:] = upper, lower = _inverse(G[:, :h, :h]), _inverse(G[:, h:, h:])
    out[:, h:, :h] = -lower @ (G[:, h:, :h] @ upper)
    return out
