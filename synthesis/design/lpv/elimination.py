"""The two inequalities of a controller's existence, without the controller, at given p.

Continuous time, for X(p) and Y(p) (Gahinet and Apkarian 1994; with dX/dt, dY/dt Wu 1995):

    N_x' [ X' + X A + A'X   X B1   C1' ]
         [ B1'X             -g I   D11'] N_x < 0,    N_x: null space of [C2 D21], and I,
         [ C1               D11    -g I]

    N_y' [ -Y' + A Y + Y A'   Y C1'   B1 ]
         [ C1 Y               -g I    D11] N_y < 0,  N_y: null space of [B2' D12'], and I,
         [ B1'                D11'    -g I]

and [X I; I Y] > 0. Where D21 has full row rank, a null space has [I 0] for its rows of the state:
X stands beside known matrices on one side only, and every entry is a polynomial where those of the
plant are, with constant D12 and D21.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Generalized


class Half(NamedTuple):
    """One of the two at p (K,): L' X R + its transpose + constant - g level, L = [I 0 ..] (n, N),
    R `flow` (K, n, N), `constant` and `level` (K, N, N).
    """

    flow: Array
    constant: Array
    level: Array


def observed(plant: Generalized) -> Half:
    """Return the half of X: no controller can influence directions that no measurement shows."""
    A, B1, _, C1, C2, D11, _, D21, _ = plant
    K, n, nz = len(A), A.shape[-1], C1.shape[-2]
    inverse = _right_inverse(D21)
    blind = _blind(D21, inverse)
    w = np.concatenate([-inverse @ C2, blind], axis=-1)
    flow = np.concatenate([A, np.zeros((K, n, blind.shape[-1]))], axis=-1) + B1 @ w
    seen = np.concatenate([C1, np.zeros((K, nz, blind.shape[-1]))], axis=-1) + D11 @ w
    m = flow.shape[-1]
    constant, level = np.zeros((K, m + nz, m + nz)), np.zeros((K, m + nz, m + nz))
    constant[:, m:, :m], constant[:, :m, m:] = seen, seen.mT
    level[:, :m, :m], level[:, m:, m:] = w.mT @ w, np.eye(nz)
    return Half(np.concatenate([flow, np.zeros((K, n, nz))], axis=-1), constant, level)


def controlled(plant: Generalized) -> Half:
    """Return the half of Y: directions that no control reaches; the same of the dual plant."""
    return observed(plant.dual)


def _right_inverse(D: Array) -> Array:
    return D.mT @ np.linalg.inv(D @ D.mT)


def _blind(D: Array, inverse: Array) -> Array:
    """Return the disturbances (K, nw, nw - ny) that no measurement shows, as smooth in p as
    D is.
    """
    ny, nw = D.shape[-2:]
    start = np.linalg.svd(D[0])[2][ny:].T
    return start - inverse @ (D @ start) if nw > ny else np.zeros((len(D), nw, 0))
