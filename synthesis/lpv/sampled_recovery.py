"""The controller that X and Y promise in discrete time, at given p.

Its state is an estimate of the plant's, as in `recovery`: in the coordinates (x - x_k, x_k) the
storage function is that of X and of W^-1, W = Y - X^-1. Where these are identities, with S <=
Y(p(k+1)) in place of Y after the step, and gains in units of gamma, the inequality of the closed
loop says that [A B; C D] of the loop, which is known but for left K right, is a contraction.
"""

from __future__ import annotations

import numpy as np

from synthesis.lpv.contraction import contraction
from synthesis.lpv.recovery import Gains
from synthesis.lti.linear_quadratic import given_direct_way
from synthesis.plant.generalized import Generalized

Array = np.ndarray


def joined(plant: Generalized, X: Array, Y: Array, S: Array, gamma: float) -> Gains:
    """Of the whole inequality."""
    A, B1, B2, C1, C2, D11, D12, D21, D22 = plant
    K, n = len(A), A.shape[-1]
    inverse = np.linalg.inv(X)
    root = np.linalg.cholesky(X)
    now, after = (np.linalg.cholesky(Z - inverse) for Z in (Y, S))
    error, ahead = _t(root), np.linalg.inv(after)  # of x - x_k and of x_k after the step
    before = np.concatenate([np.linalg.inv(error), now], axis=-1)  # x of both before it
    zero, none = np.zeros((K, n, n)), np.zeros((K, n, B2.shape[-1]))
    found = _central(
        np.concatenate([error @ A @ before, np.zeros((K, n, 2 * n))], axis=-2),
        np.concatenate([error @ B1, np.zeros((K, n, B1.shape[-1]))], axis=-2),
        C1 @ before,
        D11,
        np.block([[-error, error @ B2], [ahead, none]]),
        np.concatenate([np.zeros((K, C1.shape[-2], n)), D12], axis=-1),
        np.concatenate([np.concatenate([zero, now], axis=-1), C2 @ before], axis=-2),
        np.concatenate([np.zeros((K, n, B1.shape[-1])), D21], axis=-2),
        gamma,
    )
    gains = found[:, :n, :n], found[:, :n, n:], found[:, n:, :n], found[:, n:, n:]
    return Gains(*given_direct_way(D22, *gains))


def state_gain(plant: Generalized, Y: Array, S: Array, gamma: float) -> Array:
    """F (K, nu, n) of u = F x."""
    A, B1, B2, C1, _, D11, D12, *_ = plant
    now, ahead = np.linalg.cholesky(Y), np.linalg.inv(np.linalg.cholesky(S))
    blind = np.zeros((len(A), A.shape[-1], B1.shape[-1]))
    return _central(ahead @ A @ now, ahead @ B1, C1 @ now, D11, ahead @ B2, D12, now, blind, gamma)


def _central(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    left: Array,
    left_z: Array,
    right: Array,
    right_w: Array,
    gamma: float,
) -> Array:
    """K of the loop A + left K right, B + left K right_w, C + left_z K right, D + left_z K right_w,
    the storage before and after the step the identity.
    """
    root = np.sqrt(gamma)
    return contraction(
        np.block([[A, B / root], [C / root, D / gamma]]),
        np.concatenate([left, left_z / root], axis=-2),
        np.concatenate([right, right_w / root], axis=-1),
        1.0,
    )


def _t(M: Array) -> Array:
    return np.swapaxes(M, -1, -2)
