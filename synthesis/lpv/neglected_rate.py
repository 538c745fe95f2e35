"""What a loop keeps whose X and Y both move with p while the controller is not told dp/dt.

With N = -X the state of the controller estimates that of the plant, and

    V = e' X e + x_k' (Y - X^-1)^-1 x_k,  e = x - x_k,

is the storage function that X and Y promise. Of the controller only the term -dX/dt X^-1 of A_k is
left out (`recovery`), so V proves the loop for a gamma that is larger the faster p moves.
"""

from __future__ import annotations

import math

import numpy as np

from synthesis.lpv.coordinates import Coordinates
from synthesis.lpv.existence import Existence, Found
from synthesis.lpv.motions import motions, used

Array = np.ndarray


def level_kept(
    coordinates: Coordinates,
    existence: Existence,
    found: Found,
    loop: tuple[Array, ...],
    p: Array,
) -> float:
    """The least gamma, scaled, for which V proves the loop A, B, C, D (K, ..) at every p (K, m) and
    extreme dp/dt; inf where there is none.
    """
    X, Y = existence.X, existence.Y
    assert X is not None  # noqa: S101 - both move
    assert Y is not None  # noqa: S101
    x, y = (u.at(found.coefficients, p) for u in (X, Y))
    back = np.linalg.inv(x)
    w = np.linalg.inv(y - back)
    worst = 0.0
    matters = [a or b for a, b in zip(used(X.basis), used(Y.basis), strict=True)]
    for motion in motions(coordinates.parameters, p, coordinates.time, matters):
        dx, dy = (u.moving(found.coefficients, p, motion) for u in (X, Y))
        dw = -w @ (dy + back @ dx @ back) @ w
        worst = max(worst, _least_level(loop, _joined(x, w), _joined(dx, dw)))
    return worst


def _joined(x: Array, w: Array) -> Array:
    """[x -x; -x x + w] (K, 2n, 2n)."""
    return np.concatenate(
        [np.concatenate([x, -x], axis=2), np.concatenate([-x, x + w], axis=2)], axis=1
    )


def _least_level(loop: tuple[Array, ...], P: Array, moving: Array) -> float:
    """Of [A'P + PA + dP/dt, PB, C'; B'P, -g, D'; C, D, -g] <= 0, in coordinates where P is one."""
    A, B, C, D = loop
    try:
        R = np.linalg.inv(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        return math.inf
    T = np.swapaxes(R, 1, 2)
    PA = R @ P @ A @ T
    flow = PA + np.swapaxes(PA, 1, 2) + R @ moving @ T
    into, out = R @ P @ B, C @ T
    values, vectors = np.linalg.eigh(flow)
    if not values.max() < 0:
        return math.inf
    sides = np.concatenate([np.swapaxes(into, 1, 2), out], axis=1) @ vectors
    nw, nz = B.shape[2], C.shape[1]
    corner = np.zeros((len(A), nw + nz, nw + nz))
    corner[:, :nw, nw:], corner[:, nw:, :nw] = np.swapaxes(D, 1, 2), D
    size = corner + (sides / -values[:, None, :]) @ np.swapaxes(sides, 1, 2)
    return float(np.linalg.eigvalsh(size).max())
