"""Linear recursions whose matrices change from sample to sample, many samples at once."""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array

WIDE = 256
"""Entries of a state from which one product takes longer than the call of it."""


def states_of(A: Array, forcing: Array, start: Array) -> Array:
    """X (n + 1, nx, m) with X(k+1) = A(k) X(k) + forcing(k), from `start` (nx, m).

    A (n, nx, nx) and forcing (n, nx, m). The samples are cut into about sqrt(n) blocks that
    advance together from zero; what each one starts from is added behind. Not finite from where it
    overflows.
    """
    n, nx, m = forcing.shape
    length = n if nx * m > WIDE else max(int(np.sqrt(n)), 1)
    blocks = -(-n // max(length, 1))
    short = blocks * length - n
    if short:
        A = np.concatenate([A, np.zeros((short, nx, nx))])
        forcing = np.concatenate([forcing, np.zeros((short, nx, m))])
    A, forcing = A.reshape(blocks, length, nx, nx), forcing.reshape(blocks, length, nx, m)
    out = np.empty((blocks, length, nx, m))
    X = np.zeros((blocks, nx, m))
    with np.errstate(all="ignore"):
        if blocks == 1:
            X = start[None]
            for k in range(length):
                out[:, k] = X
                X = A[:, k] @ X + forcing[:, k]
            return np.concatenate([out[0], X])
        across = np.tile(np.eye(nx), (blocks, 1, 1))
        passed = np.empty((blocks, length, nx, nx))
        for k in range(length):
            out[:, k], passed[:, k] = X, across
            X, across = A[:, k] @ X + forcing[:, k], A[:, k] @ across
        starts = np.empty((blocks, nx, m))
        for i in range(blocks):
            starts[i] = start
            start = across[i] @ start + X[i]
        out += passed @ starts[:, None]
        last = A[-1, length - short - 1] @ out[-1, length - short - 1]
        last = last + forcing[-1, length - short - 1]
    return np.concatenate([out.reshape(-1, nx, m)[:n], last[None]])
