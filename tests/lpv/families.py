"""Random polynomial models with a known answer."""

import numpy as np

from symheli import LPVStateSpace, Scheduling

SPEED = Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)


def random_lpv(degree=3, nx=4, nu=2, ny=3, seed=0, scheduling=SPEED, rank=None):
    """Full matrices of every power of p/10; `rank` limits that of every coefficient of p."""
    rng = np.random.default_rng(seed)

    def power(i):
        M = rng.standard_normal((nx + ny, nx + nu))
        if rank is not None and i:
            U, s, V = np.linalg.svd(M)
            M = U[:, :rank] * s[:rank] @ V[:rank]
        return M / 10.0**i

    whole = [power(i) for i in range(degree + 1)]
    blocks = {
        "A": [M[:nx, :nx] for M in whole],
        "B": [M[:nx, nx:] for M in whole],
        "C": [M[nx:, :nx] for M in whole],
        "D": [M[nx:, nx:] for M in whole],
    }
    return LPVStateSpace.polynomial(**blocks, scheduling=scheduling), whole


def stacked(model):
    """[A B; C D]."""
    return np.block([[model.A, model.B], [model.C, model.D]])
