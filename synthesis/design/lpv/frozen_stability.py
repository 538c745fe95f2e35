"""Stability of a loop frozen at every p of its range, between points of a grid as well."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli import LPVStateSpace
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.definite import negative_definite
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import pieces

MAX_CELLS = 500
"""Largest number of Lyapunov equations that are solved; beyond it stability between points is left
undecided.
"""
MAX_BOXES = 16
"""Largest number of boxes on which one Lyapunov matrix is checked."""
DECAY_FRACTION = 0.5
"""Fraction of the decay rate of the slowest mode for which the Lyapunov equation is solved."""


class FrozenVerdict(NamedTuple):
    """Whether a loop is `stable` frozen at every p, None if undecided; `p` (m,) is then, or for an
    unstable loop, the place.
    """

    stable: bool | None
    p: Array | None = None


def frozen_stability(loop: LPVStateSpace) -> FrozenVerdict:
    """Decide stability of the loop frozen at each p of its range.

    For every cell P solves a Lyapunov equation of its middle; where P does not serve the whole
    cell, by the Bernstein coefficients of A'P + PA, the cell is halved. With p at rest P may differ
    from cell to cell.
    """
    waiting = [models[0] for models in pieces(loop).models.values()]
    for _ in range(MAX_CELLS):
        if not waiting:
            return FrozenVerdict(True)
        A = waiting.pop()
        middle = np.mean(np.array(A.box, dtype=float), axis=1)
        root = _lyapunov(A(middle), loop.dt)
        if root is None:
            return FrozenVerdict(False, middle)
        if not negative_definite(_decrease(A, root, loop.dt), cells=MAX_BOXES):
            axis = int(np.argmax(_variation(A)))
            low, high = A.box[axis]
            if not low < middle[axis] < high:  # no double lies between: an eigenvalue on the border
                return FrozenVerdict(None, middle)
            waiting += A.split(axis)
    return FrozenVerdict(None, middle)


def _lyapunov(A: Array, dt: float | None) -> Array | None:
    """Return the square root of a P > 0 for which all states decay at a fraction of the rate of the
    slowest mode; None where A is not stable.
    """
    with np.errstate(invalid="ignore"):  # of the permutation, which is not used
        _, (units, _) = linalg.matrix_balance(A, permute=False, separate=True)
    balanced = A * units / units[:, None]
    poles = np.linalg.eigvals(balanced)
    one = np.eye(len(A))
    if dt is None:
        slowest = -float(poles.real.max(initial=-1.0))
        if slowest <= 0:
            return None
        P = linalg.solve_continuous_lyapunov((balanced + DECAY_FRACTION * slowest * one).T, -one)
    else:
        largest = float(np.abs(poles).max(initial=0.0))
        if largest >= 1:
            return None
        P = linalg.solve_discrete_lyapunov((balanced / max(largest, 0.01) ** DECAY_FRACTION).T, one)
    try:
        return np.linalg.cholesky(0.5 * (P + P.T)).T / units
    except np.linalg.LinAlgError:
        return None


def _decrease(A: PolynomialMatrix, root: Array, dt: float | None) -> PolynomialMatrix:
    """Return A'P + PA, or [-P A'P; PA -P], in the coordinates in which P is the identity."""
    own = root @ A.coefficients @ np.linalg.inv(root)
    turned = np.swapaxes(own, -1, -2)
    if dt is None:
        return PolynomialMatrix(A.box, own + turned)
    minus = np.broadcast_to(-np.eye(len(root)), own.shape)
    return PolynomialMatrix(A.box, np.block([[minus, turned], [own, minus]]))


def _variation(A: PolynomialMatrix) -> list[float]:
    """Return the variation of the coefficients along each axis."""
    return [
        float(np.abs(np.diff(A.coefficients, axis=i)).max(initial=0.0)) for i in range(len(A.box))
    ]
