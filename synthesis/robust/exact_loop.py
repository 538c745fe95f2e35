"""The loop of a model and its blocks in rationals, which is what is proven."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli import LinearModel
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.transfer import Transfer, inverse, rationals


class Part(NamedTuple):
    """A block of the loop: `rows` of z and `columns` of w; `real`: the same number at each."""

    rows: slice
    columns: slice
    real: bool


PARALLEL = 1e6
"""Condition number of modes from which on they are not taken as coordinates."""


class ExactLoop(NamedTuple):
    """A, B, C, D of a loop in rationals, as it follows from model and blocks without rounding;
    `sampled`: of the model from sample to sample itself.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    sampled: bool

    @property
    def transfer(self) -> Transfer:
        """The transfer matrix from w to z, of a sampled loop over s = (z - 1)/(z + 1)."""
        return Transfer.of(*self)

    def nearest(self) -> tuple[Array, Array, Array, Array]:
        """Return the loop in doubles, in the coordinates of the model."""
        A, B, C, D = (M.astype(float) for M in (self.A, self.B, self.C, self.D))
        return A, B, C, D

    def rounded(self) -> tuple[Array, Array, Array, Array]:
        """Return the loop in doubles, in coordinates of its modes, or of Schur's where these are
        nearly parallel: there entries do not cancel.
        """
        A, n = self.A.astype(float), len(self.A)
        balanced, (units, _) = linalg.matrix_balance(A, permute=False, separate=True)
        values, V = np.linalg.eig(balanced)
        T = np.where(np.imag(values) >= 0, np.real(V), np.imag(V))
        if not np.linalg.cond(T) < PARALLEL:
            T = linalg.schur(balanced)[1]
        T = units[:, None] * T
        exact, near = rationals(T), rationals(np.linalg.inv(T))
        back = (rationals(2 * np.eye(n)) - near @ exact) @ near  # a step of Newton's method
        A, B, C = back @ self.A @ exact, back @ self.B, self.C @ exact
        return A.astype(float), B.astype(float), C.astype(float), self.D.astype(float)

    def select(self, into: Array, out: Array) -> ExactLoop:
        """Return the loop from these columns of w to these rows of z."""
        return self._replace(B=self.B[:, into], C=self.C[out], D=self.D[np.ix_(out, into)])

    def within(
        self, parts: Sequence[Part], low: Sequence[float], high: Sequence[float]
    ) -> ExactLoop:
        """Return the loop whose real parts go from these numbers to those where they went from -1
        to 1.

        Raises `InputError` where it is not well posed at the middle.
        """
        real = [part for part in parts if part.real]
        at = np.r_[tuple(np.r_[part.rows] for part in real)] if real else np.zeros(0, int)
        size = [part.rows.stop - part.rows.start for part in real]
        a, b = (rationals(np.repeat(np.asarray(ends, float), size)) for ends in (low, high))
        middle, radius = (a + b) / 2, (b - a) / 2
        inner = inverse(rationals(np.eye(len(at))) - self.D[np.ix_(at, at)] * middle)
        gain = middle[:, None] * inner
        into, out = gain @ self.D[at], gain @ self.C[at]
        A, B = self.A + self.B[:, at] @ out, self.B + self.B[:, at] @ into
        C, D = self.C + self.D[:, at] @ out, self.D + self.D[:, at] @ into
        C[at], D[at] = radius[:, None] * C[at], radius[:, None] * D[at]
        return ExactLoop(A, B, C, D, self.sampled)

    def behind(self, K: LinearModel) -> ExactLoop:
        """Return the loop whose last inputs are K times its last outputs.

        Raises `InputError` where I - K D is singular at infinite frequency.
        """
        a, b, c, d = map(rationals, (K.A, K.B, K.C, K.D))
        nu, ny, n = len(c), b.shape[1], len(a)
        B1, B2, C1, C2 = self.B[:, :-nu], self.B[:, -nu:], self.C[:-ny], self.C[-ny:]
        D11, D12, D21, D22 = (
            M for rows in (self.D[:-ny], self.D[-ny:]) for M in (rows[:, :-nu], rows[:, -nu:])
        )
        loop = inverse(rationals(np.eye(nu)) - d @ D22)
        u = loop @ np.hstack([d @ C2, c, d @ D21])  # of (x, x of K, w)
        y = np.hstack([C2, np.zeros((ny, n), dtype=object), D21]) + D22 @ u
        whole = np.vstack(
            [
                np.hstack([self.A, np.zeros((len(self.A), n), dtype=object), B1]) + B2 @ u,
                np.hstack([np.zeros((n, len(self.A)), dtype=object), a, 0 * b @ D21]) + b @ y,
                np.hstack([C1, np.zeros((len(C1), n), dtype=object), D11]) + D12 @ u,
            ]
        )
        m = len(self.A) + n
        return ExactLoop(whole[:m, :m], whole[:m, m:], whole[m:, :m], whole[m:, m:], self.sampled)
