"""The controller that X and Y promise, at given p.

In the variables A~, B~, C~ of Scherer, Gahinet and Chilali (1997) the inequality of the closed loop
splits into that of Y and that of X once its corner is made zero. C~ minimises the one and B~ the
other, whatever dY/dt or dX/dt is, so that the gains know p alone (Gahinet 1996; Apkarian and Adams
1998, sec. IV). In discrete time the central solution of the whole inequality is taken (Iwasaki and
Skelton 1994). Then with N M' = I - X Y

    C_k = (C~ - D_k C2 Y) M'^-1,  B_k = N^-1 (B~ - X B2 D_k),
    A_k = N^-1 (A~ - X (A - B2 D_k C2) Y - B~ C2 Y - X B2 C~ + X dY/dt + N dM'/dt) M'^-1,

where the last two terms cancel if X is constant and N is, or Y is and M is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.design.generalized import Generalized

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
    """D (K, nu, ny) with |D11 + D12 D D21| < gamma; zero where that is enough (Parrott 1978)."""
    nothing = np.zeros((len(D11), D12.shape[-1], D21.shape[-2]))
    if float(np.linalg.norm(D11, 2, axis=(1, 2)).max()) < 0.9 * gamma:
        return nothing
    U, s, _ = np.linalg.svd(D12)
    _, t, V = np.linalg.svd(D21)
    nu, ny = D12.shape[-1], D21.shape[-2]
    inner = _t(U) @ D11 @ _t(V)
    b, c, d = inner[:, :nu, ny:], inner[:, nu:, :ny], inner[:, nu:, ny:]
    best = -b @ np.linalg.solve(_identity(gamma**2, d.shape[-1], d) - _t(d) @ d, _t(d) @ c)
    del s, t
    return (
        np.linalg.pinv(D12)
        @ U[:, :, :nu]
        @ (best - inner[:, :nu, :ny])
        @ V[:, :ny]
        @ np.linalg.pinv(D21)
    )


def controller(
    plant: Generalized, X: Array, Y: Array, found: Transformed, *, constant_x: bool
) -> Gains:
    """Its matrices, with N = I where X is constant, M = I where Y is."""
    A, _, B2, _, C2, *_ = plant
    At, Bt, Ct, D = found
    inner = At - X @ (A - B2 @ D @ C2) @ Y - Bt @ C2 @ Y - X @ B2 @ Ct
    inverse = np.linalg.inv(np.eye(A.shape[-1]) - X @ Y)
    into, out = Bt - X @ B2 @ D, Ct - D @ C2 @ Y
    if constant_x:
        return Gains(inner @ inverse, into, out @ inverse, D)
    return Gains(inverse @ inner, inverse @ into, out, D)


def _identity(factor: float, n: int, like: Array) -> Array:
    return np.broadcast_to(factor * np.eye(n), (len(like), n, n))


def _t(M: Array) -> Array:
    return np.swapaxes(M, -1, -2)
