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

WIDEST = 160
"""Number of columns that are taken from block to block together, at most."""


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
    of G, `corner` what is not 0 of those below them: q rows and columns. `groups`: the columns,
    those of an equation or of D, that are taken from block to block together.
    """

    def __init__(self, white: Whitening, F: Array, D: Array, own: int) -> None:
        m, size, deep = white.columns.shape
        samples = max(TOGETHER, deep // size - 1)
        count, w, self.q = -(-m // samples), samples * size, deep - size

        def blocks(each: Array) -> Array:
            out = np.zeros((count * samples, *each.shape[1:]))
            out[:m] = each
            return out.reshape(count, -1, each.shape[-1])

        columns, G = blocks(white.columns), np.zeros((count, w + deep, w))
        columns.reshape(-1, deep)[m * size :, 0] = 1.0
        for column in range(w):
            G[:, column : column + deep, column] = columns[:, column]
        self.A = _inverse(G[:, :w])
        self.corner = G[:, w : w + self.q, w - self.q :].copy()
        self.F, self.D, self.own, self.size = blocks(F), blocks(D), own, size
        together = max(WIDEST // max(F.shape[1], 1), 1)
        self.groups = [range(j, min(j + together, own)) for j in range(0, own, together)]
        self.groups.append(range(own, own + 1))

    def gram(self) -> Array:
        """X' X = Y' (G G')^-1 Y: with S = A' A, rows of (G G')^-1 Y are S Y less what the block
        before adds through the first rows of A, and the one after through the last.
        """
        A, q, n, a = self.A, self.q, self.F.shape[2], self.D.shape[2]
        S = A.swapaxes(1, 2) @ A
        links = np.concatenate([S[:, :, :q], A[:, -q:].swapaxes(1, 2)], axis=2)
        edges, last = links[:, :q].copy(), self.own * n
        F, D, out = self.F.reshape(-1, n), self.D.reshape(-1, a), np.zeros((last + a, last + a))
        for group in self.groups:
            around = np.empty((len(A), 2 * q, self._width(group)))
            self._before(group, around[:, :q])
            self._times(S[:, :q], group, around[:, q:])
            beyond = np.zeros_like(around[0, q:])
            for b in reversed(range(len(A))):
                head, around[b, q:] = around[b, q:].copy(), beyond
                beyond = self.corner[b - 1].T @ (head - edges[b] @ around[b])
            for j, beside in zip(group, np.split(around, len(group), axis=2), strict=True):
                rows = min(j + 1, self.own)
                found = self._weighed(S, links, j, beside)
                here = slice(j * n, j * n + beside.shape[2])
                by_row = F.T @ found[:, :rows].reshape(len(F), -1)
                out[: rows * n, here] = (
                    by_row.reshape(n, rows, -1).swapaxes(0, 1).reshape(rows * n, -1)
                )
                if j == self.own:
                    out[here, here] = D.T @ found.reshape(len(D), a)
        return np.triu(out) + np.triu(out, 1).T

    def _weighed(self, S: Array, links: Array, j: int, around: Array) -> Array:
        """Rows (m, equations, n) of (G G')^-1 Y of the columns of equation j, or of D: those of the
        equations up to j.
        """
        of, each = self._column(j)
        W = np.concatenate([S[:, :, of], -links], axis=2)
        W = W.reshape(len(W), -1, self.size, W.shape[2])[:, :, : j + 1 if j < self.own else None]
        equations = W.shape[2]
        W = W.reshape(len(W), -1, W.shape[3])
        return (W @ np.concatenate([each, around], axis=1)).reshape(-1, equations, around.shape[2])

    def products(self, e: Array) -> Array:
        """X' e (m, own n + a) of each sample, for e (m, size)."""
        count, w, _ = self.A.shape
        weights = np.zeros((count * w, 1))
        weights[: e.size, 0] = e.reshape(-1)
        M = (self.A * weights.reshape(count, w, 1)).reshape(count, -1, self.size, w).sum(axis=2)
        parts = []
        for group in self.groups:
            before = np.empty((count, self.q, self._width(group)))
            self._before(group, before)
            found = np.empty((count, M.shape[1], before.shape[2]))
            self._times(M, group, found)
            found -= M[:, :, : self.q] @ before
            parts.append(found.reshape(-1, before.shape[2])[: len(e)])
        return np.hstack(parts)

    def _column(self, j: int) -> tuple[slice, Array]:
        """Which rows of a block the columns of equation j have, or of D, and what."""
        return (slice(j, None, self.size), self.F) if j < self.own else (slice(None), self.D)

    def _width(self, group: range) -> int:
        return sum(self._column(j)[1].shape[2] for j in group)

    def _times(self, M: Array, group: range, out: Array) -> None:
        """Write M Y (count, .., columns), for M (count, .., w)."""
        for j, here in zip(group, np.split(out, len(group), axis=2), strict=True):
            of, each = self._column(j)
            np.matmul(np.ascontiguousarray(M[:, :, of]), each, out=here)

    def _before(self, group: range, out: Array) -> None:
        """Write what the block before adds to the first rows of each block (count, q, columns)."""
        self._times(self.A[:, -self.q :], group, out)
        push, added = self.A[:, -self.q :, : self.q].copy(), np.zeros_like(out[0])
        for b, corner in enumerate(self.corner):
            out[b], added = added, corner @ (out[b] - push[b] @ added)


def _inverse(G: Array) -> Array:
    """Inverses of lower triangular matrices (count, w, w), by halves."""
    h = G.shape[1] // 2
    if h < TOGETHER:
        return np.linalg.inv(G)
    out = np.zeros_like(G)
    out[:, :h, :h], out[:, h:, h:] = upper, lower = _inverse(G[:, :h, :h]), _inverse(G[:, h:, h:])
    out[:, h:, :h] = -lower @ (G[:, h:, :h] @ upper)
    return out
