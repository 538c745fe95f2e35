"""The controller that X and Y promise, at given p.

In the variables A~, B~, C~ of Scherer, Gahinet and Chilali (1997) the inequality of the closed loop
splits into that of Y and that of X once its corner is made zero. C~ minimises the one and B~ the
other, whatever dY/dt or dX/dt is, so that the gains know p alone (Gahinet 1996; Apkarian and Adams
1998, sec. IV). Then with N M' = I - X Y

    C_k = (C~ - D_k C2 Y) M'^-1,  B_k = N^-1 (B~ - X B2 D_k),
    A_k = N^-1 (A~ - X (A - B2 D_k C2) Y - B~ C2 Y - X B2 C~ + X dY/dt + N dM'/dt) M'^-1.

The state of the controller is an estimate of the plant's, in whose coordinates its matrices stay
of the size of the plant's even where X or Y tend to infinity, as X does where the measurements
tell the disturbance: N = -X with M' = Y - X^-1, or M' = Y with N = Y^-1 - X. The last two terms
cancel in the first case if X is constant, in the second if Y is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.lpv.contraction import contraction
from synthesis.lti.linear_quadratic import given_direct_way
from synthesis.plant.generalized import Generalized

Array = np.ndarray


class Gains(NamedTuple):
    """A_k, B_k, C_k, D_k (K, ..) of x_k' = A_k x_k + B_k y, u = C_k x_k + D_k y."""

    A: Array
    B: Array
    C: Array
    D: Array


class Transformed(NamedTuple):
    """A~ (K, n, n), B~ (K, n, ny), C~ (K, nu, n), D (K, nu, ny)."""

    A: Array
    B: Array
    C: Array
    D: Array


def split(plant: Generalized, X: Array, Y: Array, gamma: float) -> Transformed:
    """Of the inequality in continuous time."""
    A, B1, B2, C1, C2, D11, D12, D21, _ = plant
    D = direct(D11, D12, D21, gamma)
    Dcl = D11 + D12 @ D @ D21
    C = control_gain(plant, Y, D, gamma)
    B = _t(control_gain(plant.dual, X, _t(D), gamma))
    nw, nz = B1.shape[-1], C1.shape[-2]
    M = np.block([[_identity(-gamma, nw, Dcl), _t(Dcl)], [Dcl, _identity(-gamma, nz, Dcl)]])
    loop = A + B2 @ D @ C2
    left = np.concatenate([X @ B1 + B @ D21, _t(C1 + D12 @ D @ C2)], axis=-1)
    right = np.concatenate([_t(B1 + B2 @ D @ D21), C1 @ Y + D12 @ C], axis=-2)
    return Transformed(left @ np.linalg.solve(M, right) - _t(loop), B, C, D)


def control_gain(plant: Generalized, Y: Array, D: Array, gamma: float) -> Array:
    """C~ (K, nu, n) that makes the inequality of Y as negative as it can be."""
    _, B1, B2, C1, _, D11, D12, D21, _ = plant
    Dcl = D11 + D12 @ D @ D21
    nu, nz, nw = B2.shape[-1], C1.shape[-2], B1.shape[-1]
    K = len(Y)
    zero = np.zeros
    M = np.block(
        [
            [zero((K, nu, nu)), _t(D12), zero((K, nu, nw))],
            [D12, _identity(-gamma, nz, Dcl), Dcl],
            [zero((K, nw, nu)), _t(Dcl), _identity(-gamma, nw, Dcl)],
        ]
    )
    known = np.concatenate([_t(B2), C1 @ Y, _t(B1 + B2 @ D @ D21)], axis=-2)
    return -np.linalg.solve(M, known)[:, :nu]


def direct(D11: Array, D12: Array, D21: Array, gamma: float) -> Array:
    """D (K, nu, ny) with |D11 + D12 D D21| < gamma; zero where that is enough."""
    nothing = np.zeros((len(D11), D12.shape[-1], D21.shape[-2]))
    if float(np.linalg.norm(D11, 2, axis=(1, 2)).max()) < 0.9 * gamma:
        return nothing
    return contraction(D11, D12, D21, gamma)


def controller(
    plant: Generalized,
    X: Array,
    Y: Array,
    found: Transformed,
    *,
    constant_x: bool,
    moving_x: Array | None = None,
) -> Gains:
    """Its matrices, by N = -X where X is `constant_x`, else by M' = Y; with D22 in the loop.

    With the first X may also move, if `moving_x` (K, n, n), dX/dt, is known.
    """
    A, _, B2, _, C2, *_ = plant
    At, Bt, Ct, D = found
    inner = At - X @ (A - B2 @ D @ C2) @ Y - Bt @ C2 @ Y - X @ B2 @ Ct
    into, out = Bt - X @ B2 @ D, Ct - D @ C2 @ Y
    if constant_x or moving_x is not None:
        N, M = -X, Y - np.linalg.inv(X)
        if moving_x is not None:
            inner = inner - moving_x @ np.linalg.inv(X)
    else:
        N, M = np.linalg.inv(Y) - X, Y
    back = np.linalg.inv(M)
    gains = np.linalg.solve(N, inner @ back), np.linalg.solve(N, into), out @ back, D
    return Gains(*given_direct_way(plant.D22, *gains))


def _identity(factor: float, n: int, like: Array) -> Array:
    return np.broadcast_to(factor * np.eye(n), (len(like), n, n))


def _t(M: Array) -> Array:
    return np.swapaxes(M, -1, -2)
