"""Static output feedback around an LPV model whose outputs may depend on the scheduling and on the
inputs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases import Basis, Polynomial
from symheli.lpv.equilibration import loop_inverse
from symheli.lpv.lpv_state_space import LPVStateSpace, Matrices
from symheli.values.arrays import Array

ROUNDING = 64 * np.finfo(float).eps
"""An entry that changes over the range by less than this fraction of its own size is constant: its
units play no part.
"""


class _Loop(NamedTuple):
    """u = N K y + N r of the loop u = K y + r: `L` = N K."""

    L: Array
    N: Array


def close(lpv: LPVStateSpace, K: Array) -> LPVStateSpace:
    """The model with u = K y + r; see `LPVStateSpace.feedback`. It is a fit of what the loop makes
    of what `lpv` was fitted to.
    """
    closed = _closed(lpv, K)
    if (origin := lpv.fitted_to) is None:
        return closed
    A, B, C, D = origin.matrices
    N = np.stack([loop_inverse(K @ each) for each in D])
    back = N @ K @ C
    return closed.with_residuals(origin.nodes, Matrices(A + B @ back, B @ N, C + D @ back, D @ N))


def _closed(lpv: LPVStateSpace, K: Array) -> LPVStateSpace:
    nodes = _nodes(lpv.basis, lpv.scheduling.low, lpv.scheduling.high)
    values = lpv.matrices(nodes)
    fed = np.any(K, axis=0)  # outputs that are fed back
    if not _is_constant(values.D[:, fed]):
        raise InputError(
            "the loop through the feedthrough D(p) depends on the scheduling: closed it is a"
            " rational function of it, which no basis holds; lpv.to_lft().feedback(...) closes it"
            " exactly"
        )
    N = loop_inverse(K[:, fed] @ values.D[0, fed])
    loop = _Loop(N @ K, N)
    driven = np.any(loop.L, axis=1)  # inputs they act on
    if _is_constant(values.C[:, fed]):
        back = loop.L @ values.C[0]
        closed = Matrices(lpv.A + lpv.B @ back, lpv.B @ N, lpv.C + lpv.D @ back, lpv.D @ N)
    elif _is_constant(values.B[:, :, driven]) and _is_constant(values.D[:, :, driven]):
        back = loop.L @ lpv.C
        closed = Matrices(
            lpv.A + values.B[0] @ back, lpv.B @ N, lpv.C + values.D[0] @ back, lpv.D @ N
        )
    elif isinstance(lpv.basis, Polynomial):
        return _product(lpv, lpv.basis, loop)
    else:
        raise InputError(
            "an output that is fed back depends on the scheduling, and so do the inputs: their"
            " product leaves this basis; interpolate with kind='polynomial', whose products are"
            " polynomials"
        )
    return replace(lpv, A=closed.A, B=closed.B, C=closed.C, D=closed.D, trim=None, residuals=None)


def _product(lpv: LPVStateSpace, basis: Polynomial, loop: _Loop) -> LPVStateSpace:
    """A + B N K C and its like, of up to twice the degree: exact, by values at as many nodes as
    there are coefficients.
    """
    product = Polynomial(2 * basis.degree, basis.low, basis.high)
    x, weights = np.polynomial.legendre.leggauss(product.size)
    p = 0.5 * (basis.low + basis.high) + 0.5 * (basis.high - basis.low) * x
    f = basis(p)
    A, B, C, D = (np.tensordot(f, M, axes=1) for M in (lpv.A, lpv.B, lpv.C, lpv.D))
    LC = loop.L @ C
    # the functions are orthonormal for the mean over the range, which Gauss's rule takes exactly
    project = (product(p) * (0.5 * weights)[:, None]).T
    closed = [
        np.tensordot(project, M, axes=1) for M in (A + B @ LC, B @ loop.N, C + D @ LC, D @ loop.N)
    ]
    size = 1 + max(int(np.flatnonzero(_matters(M)).max(initial=0)) for M in closed)
    A, B, C, D = (M[:size] for M in closed)
    basis = Polynomial(size - 1, basis.low, basis.high)
    return replace(lpv, basis=basis, A=A, B=B, C=C, D=D, trim=None, residuals=None)


def _matters(coefficients: Array) -> Array:
    """Which functions (n,) have a coefficient that is more than rounding of its own entry."""
    size = np.abs(coefficients)
    return np.any(size > ROUNDING * size.max(axis=0), axis=(1, 2))


def _is_constant(values: Array) -> bool:
    """Whether every entry of the stack (K, rows, columns) stays the same, judged by its own size
    alone.
    """
    return bool(
        np.all(np.ptp(values, axis=0) <= ROUNDING * np.abs(values).max(axis=0, initial=0.0))
    )


def _nodes(basis: Basis, low: float, high: float) -> Array:
    """Points in [low, high] at which functions of the basis that are constant there can be told
    from those that are not.
    """
    try:
        pieces = basis.pieces()
    except InputError:  # functions brought along, which no finite number of points tells apart
        return np.linspace(low, high, 4 * basis.size + 1)
    edges = [
        (max(piece.low, low), min(piece.high, high), piece.bernstein.shape[1] + 1)
        for piece in pieces
    ]
    return np.concatenate([np.linspace(a, b, count) for a, b, count in edges if a < b])
