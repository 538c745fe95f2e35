"""The states that count: those that some input reaches and some output shows."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.balancing import Model, projected
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array

TOLERANCE = 1e-9
"""A direction smaller than this part of what it is made of is rounding."""


def minimal_realization(model: Model, *, tolerance: float = TOLERANCE) -> Model:
    """Remove the states that no input reaches and those that no output shows, whatever p does; the
    response stays the same.

    The reachable states are the smallest space that holds the columns of every coefficient of B(p)
    and that no coefficient of A(p) leaves; the observable ones by duality. One orthogonal
    projection for all p: no derivative of p enters.

    Parameters
    ----------
    model : LPVStateSpace or LinearModel
        With nx states.
    tolerance : float
        A direction smaller than this part of what it is made of is rounding.

    Returns
    -------
    LPVStateSpace or LinearModel
        The model itself where every state counts.

    Raises
    ------
    InputError
        Another type of model, a tolerance that is not from 0 to 1.

    See Also
    --------
    symheli.lpv.balanced_truncation : fewer states, at a small error

    References
    ----------
    Kalman (1963), SIAM J. Control 1; over p: Balas, Bokor and Szabo (2003), IEEE Trans. Automatic
    Control 48 (invariant subspaces).

    Examples
    --------
    >>> twice = lpv.parallel(spring, spring)
    >>> len(twice.states), len(lpv.minimal_realization(twice).states)
    (4, 2)
    """
    if not isinstance(model, LPVStateSpace | LinearModel):
        raise InputError(
            f"expected an LPVStateSpace or a LinearModel, got {type(model).__name__}; an LFT has"
            " .reduce()"
        )
    if not 0 <= tolerance < 1:
        raise InputError(f"tolerance: expected a number from 0 to 1, got {tolerance!r}")
    small = model
    for dual in (False, True):
        A, into = _stacks(small, dual)
        V = _reached(A, into, tolerance)
        if V.shape[1] < len(V):
            small = projected(small, V.T, V)
    return small


def _stacks(model: LPVStateSpace | LinearModel, dual: bool) -> tuple[Array, Array]:
    """Coefficients (k, n, n) and (k, n, m) of A and B, or of A' and C'."""
    one = isinstance(model, LinearModel)
    A, B, C = (M[None] if one else M for M in (model.A, model.B, model.C))
    return (np.swapaxes(A, 1, 2), np.swapaxes(C, 1, 2)) if dual else (A, B)


def _reached(A: Array, B: Array, tolerance: float) -> Array:
    """An orthonormal basis (n, r) of the smallest space with every B_j that no A_j leaves."""
    n = A.shape[1]
    V, new = np.zeros((n, 0)), np.hstack([np.zeros((n, 0)), *B])
    size = np.linalg.norm(new) or 1.0
    while True:
        new = new - V @ (V.T @ new)
        U, values, _ = np.linalg.svd(new, full_matrices=False)
        found = U[:, values > tolerance * size]
        if not found.shape[1]:
            return V
        V = np.linalg.qr(np.hstack([V, found]))[0]
        if V.shape[1] == n:
            return np.eye(n)
        new = np.hstack([each @ V for each in A])
        size = np.linalg.norm(new) or 1.0
