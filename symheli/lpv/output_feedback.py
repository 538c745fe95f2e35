"""Static output feedback around an LPV model whose outputs may depend on the scheduling and on the
inputs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import factors_of, polynomials
from symheli.lpv.equilibration import loop_inverse
from symheli.lpv.lpv_state_space import LPVStateSpace, Matrices
from symheli.values.arrays import Array

ROUNDING = 64 * np.finfo(float).eps
"""An entry that changes over the range by less than this fraction of its own size is constant: its
units play no part.
"""


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
    """u = K y + r is u = r + L (C x + D r) with L = (I - K D)^-1 K, of which only the feedthrough
    from the inputs that are driven to the outputs that are fed back is a loop.
    """
    values = lpv.matrices(lpv.basis.samples(lpv.box))
    driven, fed = np.any(K, axis=1), np.any(K, axis=0)
    through = values.D[:, fed][:, :, driven]
    if not _is_constant(through):
        raise InputError(
            "the loop through the feedthrough D(p) depends on the scheduling: closed it is a"
            " rational function of it, which no basis holds; lpv.to_lft().feedback(...) closes it"
            " exactly"
        )
    own = K[np.ix_(driven, fed)]
    L = np.zeros(K.shape)
    L[np.ix_(driven, fed)] = loop_inverse(own @ through[0]) @ own
    if _is_constant(values.C[:, fed]) and _is_constant(values.D[:, fed]):
        state, direct = L @ values.C[0], L @ values.D[0]
        A, B, C, D = (
            lpv.A + lpv.B @ state,
            lpv.B + lpv.B @ direct,
            lpv.C + lpv.D @ state,
            lpv.D + lpv.D @ direct,
        )
    elif _is_constant(values.B[:, :, driven]) and _is_constant(values.D[:, :, driven]):
        into, out = values.B[0] @ L, values.D[0] @ L
        A, B, C, D = (
            lpv.A + into @ lpv.C,
            lpv.B + into @ lpv.D,
            lpv.C + out @ lpv.C,
            lpv.D + out @ lpv.D,
        )
    elif lpv.basis.degrees is not None:
        return _product(lpv, lpv.basis.degrees, L)
    else:
        raise InputError(
            "an output that is fed back depends on the scheduling, and so do the inputs: their"
            " product leaves this basis; interpolate with kind='polynomial', whose products are"
            " polynomials"
        )
    return replace(lpv, A=A, B=B, C=C, D=D, trim=None, residuals=None)


def _product(lpv: LPVStateSpace, degrees: tuple[int, ...], L: Array) -> LPVStateSpace:
    """A + B L C and its like, of up to twice the degrees: exact, by values at as many points as
    there are coefficients.
    """
    ranges = lpv.basis.ranges
    double = polynomials([2 * d for d in degrees], ranges)
    axes = [_gauss(f.size, *f.ranges[0]) for f in factors_of(double)]
    points = axes[0][0] if len(axes) == 1 else tensor_grid([p for p, _ in axes])
    weights = reduce(np.multiply.outer, [w for _, w in axes]).ravel()
    f = lpv.basis(points)
    A, B, C, D = (np.tensordot(f, M, axes=1) for M in (lpv.A, lpv.B, lpv.C, lpv.D))
    state, direct = L @ C, L @ D
    # the functions are orthonormal for the mean over the box, which Gauss's rule takes exactly
    project = (double(points) * weights[:, None]).T
    closed = [
        np.tensordot(project, M, axes=1)
        for M in (A + B @ state, B + B @ direct, C + D @ state, D + D @ direct)
    ]
    found = np.any([_matters(M) for M in closed], axis=0)
    exponents = np.array(double.indices) if len(degrees) > 1 else np.arange(double.size)[:, None]  # type: ignore[union-attr]
    kept = [int(d) for d in exponents[found].max(axis=0, initial=0)]
    smaller = np.all(exponents <= kept, axis=1)
    A, B, C, D = (M[smaller] for M in closed)
    basis = polynomials(kept, ranges)
    return replace(lpv, basis=basis, A=A, B=B, C=C, D=D, trim=None, residuals=None)


def _gauss(count: int, low: float, high: float) -> tuple[Array, Array]:
    """Points of [low, high] and weights of Gauss's rule for the mean."""
    x, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * weights


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
