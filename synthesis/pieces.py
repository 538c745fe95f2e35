"""The matrices of an LPV model as polynomials in Bernstein form on the pieces of its scheduling
range.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symheli.lpv import FunctionSpace, LPVStateSpace, Piece
from synthesis.bernstein import restriction

Array = np.ndarray

CONSTANT = 1e-14
"""Coefficients that differ by less than this fraction of the largest are one constant: the rounding
of the basis itself.
"""


class ModelPiece(NamedTuple):
    """A(p), B(p), C(p), D(p) on [low, high]: Bernstein coefficients (d + 1, rows, columns), d = 0
    where constant.
    """

    low: float
    high: float
    A: Array
    B: Array
    C: Array
    D: Array

    def scaled(self, left: Array, right: Array, channel: float, time: float) -> ModelPiece:
        """The piece with states x = right z (left = right^-1), dt = time dtau and outputs divided
        by `channel`.

        Inputs are per square root of the new time unit, so that energies keep their ratio.
        """
        root = np.sqrt(time)
        return self._replace(
            A=time * left @ self.A @ right,
            B=root * left @ self.B,
            C=root * self.C @ right / channel,
            D=self.D / channel,
        )


def model_pieces(lpv: LPVStateSpace) -> tuple[ModelPiece, ...]:
    """The pieces of the model over its scheduling range, in order of p.

    The coefficients are doubles: an exact proof is about the model they define, which is the given
    one to rounding.
    """
    s = lpv.scheduling
    return tuple(
        ModelPiece(a, b, *(_coefficients(M, functions) for M in (lpv.A, lpv.B, lpv.C, lpv.D)))
        for a, b, functions in function_pieces(lpv.basis, s.low, s.high)
    )


def function_pieces(basis: FunctionSpace, low: float, high: float) -> tuple[Piece, ...]:
    """The pieces of the functions of a basis between `low` and `high`."""
    slack = 1e-9 * (high - low)
    out = []
    for piece in basis.pieces():
        a, b = max(piece.low, low), min(piece.high, high)
        a, b = (low if abs(a - low) <= slack else a), (high if abs(b - high) <= slack else b)
        if b - a <= slack:
            continue
        functions = piece.bernstein
        if (a, b) != (piece.low, piece.high):
            width = piece.high - piece.low
            functions = (
                functions
                @ restriction(
                    functions.shape[1] - 1, (a - piece.low) / width, (b - piece.low) / width
                ).T
            )
        out.append(Piece(a, b, functions))
    return tuple(out)


def same_pieces(a: Sequence[ModelPiece], b: Sequence[ModelPiece]) -> bool:
    """Whether they are equal to the last bit."""
    return len(a) == len(b) and all(
        np.array_equal(x, y)
        for one, other in zip(a, b, strict=True)
        for x, y in zip(one, other, strict=True)
    )


def _coefficients(M: Array, functions: Array) -> Array:
    coefficients = np.tensordot(functions.T, M, axes=1)
    spread = np.ptp(coefficients, axis=0)
    # entry by entry: states and channels may differ in size by orders of magnitude
    if np.all(spread <= CONSTANT * np.abs(M).sum(axis=0) * np.abs(functions).max()):
        return coefficients.mean(axis=0)[None]
    return coefficients
