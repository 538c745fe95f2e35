"""Recovery of the controller from X and Y, at given p.

In the variables A~, B~, C~ of Scherer, Gahinet and Chilali (1997) the inequality of the closed loop
splits into that of Y and that of X once its corner is made zero. C~ minimises the one and B~ the
other, whatever dY/dt or dX/dt is, so that the gains know p alone (Gahinet 1996; Apkarian and Adams
1998, sec. IV). Then with N M' = I - X Y

    C_k = (C~ - D_k C2 Y) M'^-1,  B_k = N^-1 (B~ - X B2 D_k),
    A_k = N^-1 (A~ - X (A - B2 D_k C2) Y - B~ C2 Y - X B2 C~ + X dY/dt + N dM'/dt) M'^-1.

The state of the controller is an estimate of the plant's, in whose coordinates its matrices stay
of the size of the plant's even where X or Y tend to infinity, as X does where the measurements
determine the disturbance: N = -X with M' = Y - X^-1, or M' = Y with N = Y^-1 - X. The last two
terms cancel in the first case if X is constant, in the second if Y is.

In discrete time the state of the controller is an estimate of the plant's, too: in the coordinates
(x - x_k, x_k) the storage function is that of X and of W^-1, W = Y - X^-1. Where these are
identities, with S <= Y(p(k+1)) in place of Y after the step, and gains in units of gamma, the
inequality of the closed loop states that [A B; C D] of the loop, known except for left K right, is
a contraction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.design.lti.linear_quadratic import given_direct_way
from synthesis.design.plant.generalized import Generalized

ROUNDING = 1e-6
"""Least relative margin of a level above the smallest one, at which the formula is singular."""


class Gains(NamedTuple):
    """A_k, B_k, C_k, D_k (K, ..) of x_k' = A_k x_k + B_k y, u = C_k x_k + D_k y."""

    A: Array
    B: Array
    C: Array
    D: Array

    @property
    def packed(self) -> Array:
        """[A B; C D] (K, ..)."""
        top, bottom = (np.concatenate(pair, axis=-1) for pair in (self[:2], self[2:]))
        return np.concatenate([top, bottom], axis=-2)


class Transformed(NamedTuple):
    """A~ (K, n, n), B~ (K, n, ny), C~ (K, nu, n), D (K, nu, ny)."""

    A: Array
    B: Array
    C: Array
    D: Array


def split(plant: Generalized, X: Array, Y: Array, gamma: float) -> Transformed:
    """Return the transformed controller that solves the inequality in continuous time."""
    A, B1, B2, C1, C2, D11, D12, D21, _ = plant
    D = direct(D11, D12, D21, gamma)
    Dcl = D11 + D12 @ D @ D21
    C = control_gain(plant, Y, D, gamma)
    B = control_gain(plant.dual, X, D.mT, gamma).mT
    nw, nz = B1.shape[-1], C1.shape[-2]
    M = np.block([[_identity(-gamma, nw, Dcl), Dcl.mT], [Dcl, _identity(-gamma, nz, Dcl)]])
    loop = A + B2 @ D @ C2
    left = np.concatenate([X @ B1 + B @ D21, (C1 + D12 @ D @ C2).mT], axis=-1)
    right = np.concatenate([(B1 + B2 @ D @ D21).mT, C1 @ Y + D12 @ C], axis=-2)
    return Transformed(left @ np.linalg.solve(M, right) - loop.mT, B, C, D)


def control_gain(plant: Generalized, Y: Array, D: Array, gamma: float) -> Array:
    """Return C~ (K, nu, n) that makes the inequality of Y as negative as possible."""
    _, B1, B2, C1, _, D11, D12, D21, _ = plant
    Dcl = D11 + D12 @ D @ D21
    nu, nz, nw = B2.shape[-1], C1.shape[-2], B1.shape[-1]
    K = len(Y)
    zero = np.zeros
    M = np.block(
        [
            [zero((K, nu, nu)), D12.mT, zero((K, nu, nw))],
            [D12, _identity(-gamma, nz, Dcl), Dcl],
            [zero((K, nw, nu)), Dcl.mT, _identity(-gamma, nw, Dcl)],
        ]
    )
    known = np.concatenate([B2.mT, C1 @ Y, (B1 + B2 @ D @ D21).mT], axis=-2)
    return -np.linalg.solve(M, known)[:, :nu]


def direct(D11: Array, D12: Array, D21: Array, gamma: float) -> Array:
    """Return D (K, nu, ny) with |D11 + D12 D D21| < gamma; zero where that suffices."""
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
    """Return the controller's matrices, by N = -X where X is `constant_x`, else by M' = Y; with D22
    in the loop.

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


def sampled_controller(plant: Generalized, X: Array, Y: Array, S: Array, gamma: float) -> Gains:
    """Return the controller from the complete inequality, in discrete time."""
    A, B1, B2, C1, C2, D11, D12, D21, D22 = plant
    K, n = len(A), A.shape[-1]
    inverse = np.linalg.inv(X)
    root = np.linalg.cholesky(X)
    now, after = (np.linalg.cholesky(Z - inverse) for Z in (Y, S))
    error, ahead = root.mT, np.linalg.inv(after)  # of x - x_k and of x_k after the step
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
    """Return F (K, nu, n) of u = F x, in discrete time."""
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
    """Return K for the loop A + left K right, B + left K right_w, C + left_z K right, D + left_z K
    right_w, with the identity as storage before and after the step.
    """
    root = np.sqrt(gamma)
    return contraction(
        np.block([[A, B / root], [C / root, D / gamma]]),
        np.concatenate([left, left_z / root], axis=-2),
        np.concatenate([right, right_w / root], axis=-1),
        1.0,
    )


def contraction(M: Array, left: Array, right: Array, level: float) -> Array:
    """Return K (N, k, l) with |M + left K right| <= level, or nearly the least possible norm, if
    that is larger; `left` (N, r, k) of full column rank, `right` (N, l, c) of full row rank.

    References
    ----------
    Davis, Kahan and Weinberger, SIAM J. Numerical Analysis 19 (1982), the central solution.
    """
    k, l = left.shape[-1], right.shape[-2]
    P, into = np.linalg.qr(left, mode="complete")
    Q, out = np.linalg.qr(right.mT, mode="complete")
    inner = P.mT @ M @ Q
    above, beside, corner = inner[:, :k, l:], inner[:, k:, :l], inner[:, k:, l:]
    least = np.maximum(_norm(inner[:, k:]), _norm(inner[:, :, l:]))
    bound = np.maximum(level, least * (1 + ROUNDING))[:, None, None]
    room = bound**2 * np.eye(corner.shape[-1]) - corner.mT @ corner
    best = -above @ np.linalg.solve(room, corner.mT @ beside)
    gain = best - inner[:, :k, :l]
    return np.linalg.solve(into[:, :k], gain) @ np.linalg.inv(out[:, :l].mT)


def _norm(M: Array) -> Array:
    return np.linalg.svd(M, compute_uv=False).max(axis=-1, initial=0.0)


def _identity(factor: float, n: int, like: Array) -> Array:
    return np.broadcast_to(factor * np.eye(n), (len(like), n, n))
