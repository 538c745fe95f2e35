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

WIDEST, AT_ONCE = 160, 64
"""Number of columns that are taken from block to block together, at most, and of blocks whose rows
are formed together.
"""


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
        self.parts = [slice(b, b + AT_ONCE) for b in range(0, count, AT_ONCE)]

    def gram(self) -> Array:
        """X' X = Y' (G G')^-1 Y: with S = A' A, rows of (G G')^-1 Y are S Y less what the block
        before adds through the first rows of A, and the one after through the last.
        """
        A, q, n, a = self.A, self.q, self.F.shape[2], self.D.shape[2]
        S, back = A.swapaxes(1, 2) @ A, self.corner.swapaxes(1, 2)
        links = -np.concatenate([S[:, :, :q], A[:, -q:].swapaxes(1, 2)], axis=2)
        pull, later = back[:-1] @ S[1:, :q], back[:-1] @ links[1:, :q]
        last = self.own * n
        out = np.zeros((last + a, last + a))
        for group in self.groups:
            around = np.zeros((len(A), 2 * q, self._width(group)))
            before, after = around[:, :q], around[:, q:]
            self._before(group, before)
            self._times(pull, group, slice(1, None), after[:-1])
            _carried(later[::-1], around[:0:-1], after[-2::-1])
            for j, beside in zip(group, np.split(around, len(group), axis=2), strict=True):
                here, rows = slice(j * n, j * n + beside.shape[2]), min(j + 1, self.own)
                of, each = self._column(j)
                for part in self.parts:
                    W = np.concatenate([S[part, :, of], links[part]], axis=2)
                    W = W.reshape(len(W), -1, self.size, W.shape[2])
                    W = W[:, :, : None if j == self.own else rows].reshape(len(W), -1, W.shape[3])
                    Z = W @ np.concatenate([each[part], beside[part]], axis=1)
                    F, D = self.F[part].reshape(-1, n), self.D[part].reshape(-1, a)
                    found = (F.T @ Z.reshape(len(F), -1)).reshape(n, -1, Z.shape[2])[:, :rows]
                    out[: rows * n, here] += found.swapaxes(0, 1).reshape(rows * n, -1)
                    if j == self.own:
                        out[here, here] += D.T @ Z.reshape(len(D), a)
        return np.triu(out) + np.triu(out, 1).T

    def products(self, e: Array) -> Array:
        """X' e (m, own n + a) of each sample, for e (m, size)."""
        count, w, _ = self.A.shape
        weights = np.zeros((count * w, 1))
        weights[: e.size, 0] = e.reshape(-1)
        M = (self.A * weights.reshape(count, w, 1)).reshape(count, -1, self.size, w).sum(axis=2)
        each = []
        for group in self.groups:
            before = np.zeros((count, self.q, self._width(group)))
            found = np.empty((count, M.shape[1], before.shape[2]))
            self._before(group, before)
            self._times(M, group, slice(None), found)
            found -= M[:, :, : self.q] @ before
            each.append(found.reshape(-1, before.shape[2])[: len(e)])
        return np.hstack(each)

    def _column(self, j: int) -> tuple[slice, Array]:
        """Which rows of a block the columns of equation j have, or of D, and what."""
        return (slice(j, None, self.size), self.F) if j < self.own else (slice(None), self.D)

    def _width(self, group: range) -> int:
        return sum(self._column(j)[1].shape[2] for j in group)

    def _times(self, M: Array, group: range, blocks: slice, out: Array) -> None:
        """Write M Y (count, .., columns) of some blocks, for M (count, .., w)."""
        for j, here in zip(group, np.split(out, len(group), axis=2), strict=True):
            of, each = self._column(j)
            np.matmul(np.ascontiguousarray(M[:, :, of]), each[blocks], out=here)

    def _before(self, group: range, out: Array) -> None:
        """Write what the block before adds to the first rows of each (count, q, columns) but the
        first.
        """
        push = self.corner[:-1] @ self.A[:-1, -self.q :]
        self._times(push, group, slice(None, -1), out[1:])
        _carried(-push[:, :, : self.q], out[:-1], out[1:])


def _carried(M: Array, of: Array, to: Array) -> None:
    """Add M of one to the other, one after the other."""
    for own, known, sought in zip(np.ascontiguousarray(M), of, to, strict=True):
        sought += own @ known


def _inverse(G: Array) -> Array:
    """Inverses of lower triangular matrices (count, w, w), by halves."""
    h = G.shape[1] // 2
    if h < TOGETHER:
        return np.linalg.inv(G)
    out = np.zeros_like(G)
    out[:, :h, :h], out[:, h:, h:] = upper, lower = _inverse(G[:, :h, :h]), _inverse(G[:, h:, h:])
    out[:, h:, :h] = -lower @ (G[:, h:, :h] @ upper)
    return out
