"""The controller that X and Y promise in discrete time, at given p.

With the state of plant and controller in the variables of Scherer, Gahinet and Chilali (1997), and
S <= Y(p(k+1)) for every next p, the inequality of the closed loop is Theta + Gamma K Lambda + its
transpose < 0, whose central solution (Iwasaki and Skelton 1994) is

    K = -r Gamma' Phi Lambda' (Lambda Phi Lambda')^-1,  Phi = (r Gamma Gamma' - Theta)^-1 > 0.
"""

from __future__ import annotations

import numpy as np

from synthesis.design.generalized import Generalized
from synthesis.design.recovery import Transformed

Array = np.ndarray

CENTRED = 2.0
"""r is this much larger than the least that will do."""


def joined(plant: Generalized, X: Array, Y: Array, S: Array, gamma: float) -> Transformed | None:
    """Of the whole inequality; None where no r is large enough."""
    A, B1, B2, C1, C2, D11, D12, D21, _ = plant
    K, n = len(A), A.shape[-1]
    nu, ny = B2.shape[-1], C2.shape[-2]
    one, zero = np.broadcast_to(np.eye(n), (K, n, n)), np.zeros((K, n, n))
    found = _central(
        np.block([[A @ Y, A], [zero, X @ A]]),
        np.concatenate([B1, X @ B1], axis=-2),
        np.concatenate([C1 @ Y, C1], axis=-1),
        D11,
        np.block([[zero, B2], [one, np.zeros((K, n, nu))]]),
        D12,
        np.block([[one, zero], [np.zeros((K, ny, n)), C2]]),
        D21,
        np.block([[Y, one], [one, X]]),
        np.block([[S, one], [one, X]]),
        gamma,
    )
    if found is None:
        return None
    return Transformed(found[:, :n, :n], found[:, :n, n:], found[:, n:, :n], found[:, n:, n:])


def state_gain(plant: Generalized, Y: Array, S: Array, gamma: float) -> Array | None:
    """C~ (K, nu, n) of u = C~ Y^-1 x."""
    A, B1, B2, C1, _, D11, D12, *_ = plant
    K, n = len(A), A.shape[-1]
    one, blind = np.broadcast_to(np.eye(n), (K, n, n)), np.zeros((K, n, B1.shape[-1]))
    return _central(A @ Y, B1, C1 @ Y, D11, B2, D12, one, blind, Y, S, gamma)


def _central(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    left: Array,
    left_z: Array,
    right: Array,
    right_w: Array,
    now: Array,
    after: Array,
    gamma: float,
) -> Array | None:
    """K of the loop A + left K right, B + left K right_w, C + left_z K right, D + left_z K right_w;
    of `left` the last columns are those of `left_z`, of `right` the last rows those of `right_w`.
    """
    K, m, nw, nz = len(A), A.shape[-1], B.shape[-1], C.shape[-2]
    a, x = slice(0, m), slice(m, 2 * m)
    w, z = slice(2 * m, 2 * m + nw), slice(2 * m + nw, 2 * m + nw + nz)
    Theta = np.zeros((K, z.stop, z.stop))
    for rows, columns, block in ((a, x, A), (a, w, B), (z, x, C), (z, w, D)):
        Theta[:, rows, columns], Theta[:, columns, rows] = block, np.swapaxes(block, 1, 2)
    Theta[:, a, a], Theta[:, x, x] = -after, -now
    Theta[:, w, w], Theta[:, z, z] = -gamma * np.eye(nw), -gamma * np.eye(nz)
    Gamma, Lambda = np.zeros((K, z.stop, left.shape[-1])), np.zeros((K, right.shape[-2], z.stop))
    Gamma[:, a], Gamma[:, z, left.shape[-1] - left_z.shape[-1] :] = left, left_z
    Lambda[:, :, x], Lambda[:, right.shape[-2] - right_w.shape[-2] :, w] = right, right_w
    spread, turned = Gamma @ np.swapaxes(Gamma, 1, 2), np.swapaxes(Lambda, 1, 2)
    for r in float(np.abs(Theta).max()) * 2.0 ** np.arange(-6, 40):
        if float(np.linalg.eigvalsh(r * spread - Theta).min()) > 0:
            back = np.linalg.solve(CENTRED * r * spread - Theta, turned)
            gain = np.swapaxes(Gamma, 1, 2) @ back @ np.linalg.inv(Lambda @ back)
            return -CENTRED * r * gain
    return None
