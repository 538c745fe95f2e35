"""Covariances over a few samples: block-banded Cholesky factors, and whitening with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs

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
        (inputs,); raise `AccuracyError` where the sum is singular to rounding, or no longer finite.
        """
        reach = max(len(L) for L, _ in terms) - 1
        m, size = terms[0][0][0].shape[:2]
        columns = np.zeros((m, size, (reach + 1) * size))
        for d in range(min(reach + 1, m)):
            block = np.zeros((m - d, size, size))
            for L, variances in terms:
                for i in range(d, len(L)):
                    block += (L[i][d:] * variances) @ L[i - d][: m - d].swapaxes(1, 2)
            for column in range(size):
                first, start = 0 if d else column, d * size - column
                below = columns[: m - d, column, start + first : start + size]
                below[:] = block[:, first:, column]
        band = columns.reshape(m * size, -1).T
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
    """X = G^-1 Y for the factor G of a `Whitening` and regressors Y (m, size, own n + a): each of
    the first `own` equations of a sample has F (m, n) with coefficients of its own, and all
    equations have D (m, size, a).

    In blocks of w rows, after whose end G is the identity. A is the inverse of the diagonal blocks
    of G, `corner` what is not 0 of those below them: q rows and columns.
    """

    def __init__(self, white: Whitening, F: Array, D: Array, own: int) -> None:
        m, size, deep = white.columns.shape
        samples = max(TOGETHER, deep // size - 1)
        count, w, self.q = -(-m // samples), samples * size, deep - size
        columns = np.zeros((count * samples, size, deep))
        columns[:, :, 0] = 1.0
        columns[:m] = white.columns
        columns = columns.reshape(count, w, deep)

        def entries(rows: Array, of: Array) -> Array:
            below = rows[:, None] - of
            inside = (below >= 0) & (below < deep)
            return np.where(inside, columns[:, of, below * inside], 0.0)

        def blocks(each: Array) -> Array:
            out = np.zeros((count * samples, *each.shape[1:]))
            out[:m] = each
            return out.reshape(count, -1, each.shape[-1])

        inner = np.arange(w)
        self.A = _inverse(entries(inner, inner))
        self.corner = entries(w + inner[: self.q], inner[w - self.q :])
        self.F, self.D, self.own, self.size = blocks(F), blocks(D), own, size

    def gram(self) -> Array:
        """X' X = Y' (G G')^-1 Y: with S = A' A, rows of (G G')^-1 Y are S Y less what the block
        before adds through the first rows of A, and the one after through the last.
        """
        A, q, n, size = self.A, self.q, self.F.shape[2], self.size
        S, ends = A.swapaxes(1, 2) @ A, A[:, -q:].swapaxes(1, 2)
        links = -np.concatenate([S[:, :, :q], ends], axis=2)
        within, pull = S[:, :q, :q], np.ascontiguousarray(ends[:, :q])
        before = self._before()
        after = self._times(S[:, :q]) - within @ before
        beyond = np.zeros_like(after[0])
        for b in reversed(range(len(A))):
            after[b], beyond = beyond, self.corner[b - 1].T @ (after[b] - pull[b] @ beyond)
        last = self.own * n
        out = np.zeros((before.shape[2],) * 2)
        parts = [slice(b, b + AT_ONCE) for b in range(0, len(A), AT_ONCE)]
        for j in range(self.own):
            here = slice(j * n, j * n + n)
            for part in parts:
                F = self.F[part]
                W = np.concatenate([S[part, :, j::size], links[part]], axis=2)
                W = W.reshape(len(W), -1, size, W.shape[2])[:, :, : j + 1].reshape(
                    len(W), -1, W.shape[2]
                )
                Z = W @ np.concatenate([F, before[part, :, here], after[part, :, here]], axis=1)
                found = F.reshape(-1, n).T @ Z.reshape(-1, (j + 1) * n)
                out[: j * n + n, here] += found.reshape(n, j + 1, n).swapaxes(0, 1).reshape(-1, n)
        Z = S @ self.D + links @ np.concatenate([before[..., last:], after[..., last:]], axis=1)
        a = Z.shape[2]
        found = self.F.reshape(-1, n).T @ Z.reshape(-1, size * a)
        out[:last, last:] = found.reshape(n, size, a)[:, : self.own].swapaxes(0, 1).reshape(-1, a)
        out[last:, last:] = self.D.reshape(-1, a).T @ Z.reshape(-1, a)
        return np.triu(out) + np.triu(out, 1).T

    def products(self, e: Array) -> Array:
        """X' e (m, own n + a) of each sample, for e (m, size)."""
        count, w, _ = self.A.shape
        weights = np.zeros((count * w, 1))
        weights[: e.size, 0] = e.reshape(-1)
        M = self.A * weights.reshape(count, w, 1)
        M = M.reshape(count, -1, self.size, w).sum(axis=2)
        found = self._times(M) - M[:, :, : self.q] @ self._before()
        return found.reshape(-1, found.shape[2])[: len(e)]

    def _times(self, M: Array) -> Array:
        """M Y (count, .., own n + a), for M (count, .., w)."""
        n = self.F.shape[2]
        out = np.empty((*M.shape[:2], self.own * n + self.D.shape[2]))
        for j in range(self.own):
            out[:, :, j * n : j * n + n] = np.ascontiguousarray(M[:, :, j :: self.size]) @ self.F
        out[:, :, self.own * n :] = M @ self.D
        return out

    def _before(self) -> Array:
        """What the block before adds to the first rows of each block (count, q, own n + a)."""
        out = self._times(self.A[:, -self.q :])
        push, added = self.A[:, -self.q :, : self.q].copy(), np.zeros_like(out[0])
        for b, corner in enumerate(self.corner):
            out[b], added = added, corner @ (out[b] - push[b] @ added)
        return out


def _inverse(G: Array) -> Array:
    """Inverses of lower triangular matrices (count, w, w), by halves."""
    h = G.shape[1] // 2
    if h < TOGETHER:
        return np.linalg.inv(G)
    out = np.zeros_like(G)
    out[:, :h, :h], out[:, h:, h:] = upper, lower = _inverse(G[:, :h, :h]), _inverse(G[:, h:, h:])
    out[:, h:, :h] = -lower @ (G[:, h:, :h] @ upper)
    return out
