"""Pieces of a model without what changes by rounding alone: fewer inequalities for the search."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np

from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import ModelPiece, Pieces, function_pieces

CONSTANT = 1e-14
"""In the search for a proof only, coefficients of an entry that differ by less than this fraction
of its terms count as one constant: the rounding of the basis. The proof does not use it.
"""


def rounded(lpv: LPVMatrices, exactly: Sequence[ModelPiece]) -> tuple[ModelPiece, ...]:
    """Return the pieces with a constant for every matrix that changes by rounding alone: fewer
    inequalities for the search.
    """
    s = lpv.scheduling
    out = []
    for piece, (_, _, functions) in zip(
        exactly, function_pieces(lpv.basis, s.low, s.high), strict=True
    ):
        largest = np.abs(functions).max()
        own = []
        for coefficients, M in zip(piece[2:], (lpv.A, lpv.B, lpv.C, lpv.D), strict=True):
            # entry by entry: states and channels may differ in size by orders of magnitude
            terms = np.abs(M).sum(axis=0) * largest
            same = np.all(np.ptp(coefficients, axis=0) <= CONSTANT * terms)
            own.append(coefficients.mean(axis=0)[None] if same else coefficients)
        out.append(ModelPiece(piece.low, piece.high, *own))
    return tuple(out)


def _lowered(coefficients: Array, axis: int) -> Array:
    """Return the same polynomial in its least degree along one axis, to rounding."""
    c = np.moveaxis(coefficients, axis, 0)
    while (d := len(c) - 1) > 0:
        binomials = np.array([comb(d, k) for k in range(d + 1)], dtype=float)
        top = np.tensordot(binomials * (-1.0) ** np.arange(d + 1), c, axes=1)
        if np.any(np.abs(top) > CONSTANT * np.tensordot(binomials, np.abs(c), axes=1)):
            break
        raised = np.zeros((d + 1, d))
        k = np.arange(d)
        raised[k, k], raised[k + 1, k] = 1 - k / d, (k + 1) / d
        c = np.tensordot(np.linalg.pinv(raised), c, axes=1)
    return np.moveaxis(c, 0, axis)


def rounded_pieces(given: Pieces) -> Pieces:
    """Return the same pieces, each matrix in its least degree up to rounding."""
    models = {}
    for key, matrices in given.models.items():
        lower = []
        for M in matrices:
            coefficients = M.coefficients
            for i in range(len(M.box)):
                coefficients = _lowered(coefficients, i)
            lower.append(PolynomialMatrix(M.box, coefficients))
        models[key] = tuple(lower)
    return given._replace(models=models)
