"""Random scheduled plants of 1 to 8 states, stable and unstable, in units of several decades, every
other one with a column of B2 or a row of C2 that passes through zero within the range of p.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli import LPVStateSpace, Scheduling
from synthesis import Plant
from synthesis.design.lti.hinf import optimum_above
from synthesis.design.plant.generalized import Generalized

Array = np.ndarray

RANGE = (-1.0, 1.0)
"""Of p."""
PACE = 1e-3
"""Of the range of p, in the slowest open-loop time constant."""

UNITS = 3.0
"""States come in units of up to so many decades either way, time too."""
SEEN = 101
"""Values of p at which the plant must have a frozen optimum."""
FINER = 41
"""More of them beside the worst of these."""
LARGEST = 1e3
"""Of the frozen optima: beyond it a plant is so nearly out of control that digits are not left."""


class Drawn(NamedTuple):
    """A plant with the worst optimum of its frozen models, and a rate of p: `PACE` of its range in
    the slowest open-loop time constant.
    """

    plant: Plant
    worst: float
    slow: float


def random_plant(seed: int) -> Drawn:
    """The plant of this seed: every frozen model has an optimum."""
    rng = np.random.default_rng(seed)
    while True:
        plant, slow, zero = _drawn(rng, seed)
        p = np.sort([*np.linspace(*RANGE, SEEN), zero])
        found = frozen_optima(plant, p)
        if 0 < min(found) and max(found) < LARGEST:
            k = int(np.argmax(found))
            near = np.linspace(p[max(k - 1, 0)], p[min(k + 1, len(p) - 1)], FINER)
            worst = max(*found, *frozen_optima(plant, near))
            if worst < LARGEST:
                return Drawn(plant, worst, slow)


def _drawn(rng: np.random.Generator, seed: int) -> tuple[Plant, float, float]:
    n, nu, ny = (int(rng.integers(1, top)) for top in (9, 3, 3))
    nw, nz = ny + int(rng.integers(1, 3)), nu + int(rng.integers(1, 3))
    A = rng.normal(size=(2, n, n)) * np.array([1.0, 0.4])[:, None, None]
    A[0] -= rng.uniform(-0.3, 1.5) * np.sqrt(n) * np.eye(n)
    B1, C1 = rng.normal(size=(n, nw)), rng.normal(size=(nz, n))
    B2 = rng.normal(size=(2, n, nu)) * np.array([1.0, 0.4])[:, None, None]
    C2 = rng.normal(size=(2, ny, n)) * np.array([1.0, 0.4])[:, None, None]
    B1[:, -ny:], C1[-nu:] = 0.0, 0.0  # noise of the measurements, cost of the controls
    zero = rng.uniform(-0.7, 0.7)
    if seed % 4 == 1:
        B2[1, :, 0], B2[0, :, 0] = B2[0, :, 0], -zero * B2[0, :, 0]
    elif seed % 4 == 3:
        C2[1, 0], C2[0, 0] = C2[0, 0].copy(), -zero * C2[0, 0]
    D = np.zeros((nz + ny, nw + nu))
    D[nz - nu : nz, nw:] = np.diag(10 ** rng.uniform(-1, 0.5, nu))
    D[nz:, nw - ny : nw] = np.diag(10 ** rng.uniform(-1, 0.5, ny))
    units, time = 10 ** rng.uniform(-UNITS, UNITS, n), 10 ** rng.uniform(-UNITS, UNITS)
    A = A * units[:, None] / units / time
    B = np.concatenate([np.stack([B1, 0 * B1]), B2], axis=2) * units[:, None] / time
    C = np.concatenate([np.stack([C1, 0 * C1]), C2], axis=1) / units
    poles = np.concatenate([np.linalg.eigvals(A[0] + k * A[1]) for k in (RANGE[0], 0.0, RANGE[1])])
    p = Scheduling("p", "1", *RANGE, rate=0.0)
    w, u = [f"w{i}" for i in range(nw)], [f"u{i}" for i in range(nu)]
    z, y = [f"z{i}" for i in range(nz)], [f"y{i}" for i in range(ny)]
    model = LPVStateSpace.polynomial(
        A, B, C, [D], p, states=[f"x{i}" for i in range(n)], inputs=[*w, *u], outputs=[*z, *y]
    )
    plant = Plant(model, disturbances=w, performance=z, controls=u, measurements=y)
    return plant, PACE * (RANGE[1] - RANGE[0]) * float(np.abs(poles.real).min()), zero


def frozen_optima(plant: Plant, p: Array) -> list[float]:
    """Of H-infinity output feedback, at each p; 0 where none is found."""
    every = zip(*plant.matrices(p), strict=True)
    return [optimum_above(Generalized(*each), 0.0, plant.dt) for each in every]
