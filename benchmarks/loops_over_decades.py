"""Random strictly stable loops whose poles lie over seven decades, weighted as textbooks do, in any
units: the norm of each is known, and what is proven of it should be that.
"""

from __future__ import annotations

from typing import NamedTuple

import mpmath
import numpy as np
from scipy import linalg

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import SymheliError
from symheli.lpv.tools import Matrices
from synthesis.designs import mixed_sensitivity
from synthesis.numerics.linear.norm import norm

Array = np.ndarray

DECADES = (-3.0, 4.0)
"""Of the poles of plants, log10 rad/s."""
UNITS = 6.0
"""Half the states come in units of up to so many decades either way."""
DAMPING = 1e-3
"""Least damping ratio of a loop."""
ENTRY = 1e-3
"""Of an entry of A, by which it changes with p."""
DIGITS = 40
"""Of the response from which the norm is known."""


class Loop(NamedTuple):
    """A weighted loop of a `kind` (modes, observer, mixed sensitivity)."""

    kind: str
    model: Matrices

    @property
    def norm(self) -> float:
        """The response at its peak in forty digits: what no proof undercuts."""
        A, B, C, D = self.model
        omega = norm(A, B, C, D)[1]
        with mpmath.workdps(DIGITS):
            if np.isinf(omega):
                return float(np.linalg.norm(D, 2))
            pencil = mpmath.mpc(0, omega) * mpmath.eye(len(A)) - mpmath.matrix(A.tolist())
            columns = [
                mpmath.lu_solve(pencil, mpmath.matrix(b.tolist()))
                for b in np.ascontiguousarray(B.T)
            ]
            G = [[mpmath.fdot(c, x) for x in columns] for c in C.tolist()]
            return float(np.linalg.norm(np.array(G, dtype=complex) + D, 2))

    def scheduled(self, dependence: str, rate: float, seed: int) -> LPVStateSpace:
        """The loop as an LPV model. The dependence on p is "none"; "hidden" in a mode that no input
        reaches and in one that no output shows, which leaves the gain as it is; or of an "entry".
        """
        A, B, C, D = self.model
        rng = np.random.default_rng([seed, 1])
        changed = np.zeros_like(A)
        if dependence == "hidden":
            n, pace = len(A), 10.0 ** rng.uniform(-2, 2, 2)
            A = linalg.block_diag(A, -pace[0], -pace[1])
            row, column = rng.integers(n, size=2)
            # from the one to the loop and from the loop to the other, on the scale of the states
            A[row, n] = abs(A[row, row])
            A[n + 1, column] = pace[1]
            B, C = np.vstack([B, np.zeros((2, B.shape[1]))]), np.hstack([C, np.zeros((len(C), 2))])
            changed = np.zeros_like(A)
            changed[n, n], changed[n + 1, n + 1] = -0.5 * pace
        elif dependence == "entry":
            i, j = rng.choice(np.argwhere(A != 0))
            changed[i, j] = ENTRY * A[i, j]
        p = Scheduling("p", "1", 0.0, 1.0, rate=rate)
        pairs = ((A, changed), *((M, np.zeros_like(M)) for M in (B, C, D)))
        return LPVStateSpace.polynomial(*(np.stack(pair) for pair in pairs), p)


def loop(seed: int) -> Loop:
    """The loop of this seed, of 1 to 16 states."""
    rng = np.random.default_rng([seed, 0])
    kind = ("modes", "observer", "mixed sensitivity", "mixed sensitivity")[rng.integers(4)]
    make = {"modes": _modes, "observer": _observer, "mixed sensitivity": _mixed}[kind]
    while True:
        try:
            A, B, C, D = make(rng)
        except (SymheliError, np.linalg.LinAlgError):
            continue  # such a plant has no controller of this kind
        poles = np.linalg.eigvals(A)
        if (poles.real / np.abs(poles)).max() < -DAMPING and 1 <= len(A) <= 16:
            break
    if rng.random() < 0.5:
        units = 10.0 ** rng.uniform(-UNITS, UNITS, len(A))
        A, B, C = A * units[:, None] / units, B * units[:, None], C / units
    return Loop(kind, Matrices(A, B, C, D))


def _pole_pairs(rng: np.random.Generator, n: int, unstable: float = 0.0) -> Array:
    A, i = np.zeros((n, n)), 0
    while i < n:
        omega = 10.0 ** rng.uniform(*DECADES)
        if i + 1 < n and rng.random() < 0.5:
            damping = 10.0 ** rng.uniform(-2.5, 0)
            A[i : i + 2, i : i + 2] = [[0, omega], [-omega, -2 * damping * omega]]
            i += 2
        else:
            A[i, i] = -omega if rng.random() >= unstable else omega
            i += 1
    return A


def _plant(
    rng: np.random.Generator, n: int, inputs: int, outputs: int, unstable: float = 0.0
) -> Matrices:
    A = _pole_pairs(rng, n, unstable)
    pace = np.sqrt(np.abs(A).max(axis=1))
    B = rng.standard_normal((n, inputs)) * pace[:, None]
    C = rng.standard_normal((outputs, n)) * pace
    return Matrices(A, B, C, np.zeros((outputs, inputs)))


def _weight(rng: np.random.Generator) -> LinearModel:
    """(s/M + w)/(s + w eps)."""
    M, w, eps = rng.uniform(1.2, 3.0), 10.0 ** rng.uniform(-2, 3), 10.0 ** rng.uniform(-4, -1)
    root = np.sqrt(w)
    return LinearModel(
        [[-w * eps]], [[root]], [[root * (1 - eps / M)]], [[1 / M]], ["w"], ["e"], ["z"]
    )


def _weighted(rng: np.random.Generator, plant: Matrices) -> Matrices:
    each = [_weight(rng) for _ in plant.C]
    A, B, C, D = (linalg.block_diag(*(getattr(w, name) for w in each)) for name in "ABCD")
    zero = np.zeros((len(plant.A), len(A)))
    return Matrices(
        np.block([[plant.A, zero], [B @ plant.C, A]]),
        np.vstack([plant.B, B @ plant.D]),
        np.hstack([D @ plant.C, C]),
        D @ plant.D,
    )


def _modes(rng: np.random.Generator) -> Matrices:
    n, (m, p) = int(rng.integers(1, 13)), (int(k) for k in rng.integers(1, 3, 2))
    plant = _plant(rng, n, m, p)
    plant = plant._replace(D=0.3 * rng.standard_normal((p, m)) * (rng.random() < 0.5))
    return _weighted(rng, plant) if rng.random() < 0.8 else plant


def _observer(rng: np.random.Generator) -> Matrices:
    """Quadratic optimal gains and filter, from disturbance and noise to weighted output and
    control.
    """
    n = int(rng.integers(1, 7))
    A, B, C, _ = _plant(rng, n, 1, 1, unstable=0.2)
    Q = 0.1 * np.diag(np.abs(A).max(axis=1))
    F = -B.T @ linalg.solve_continuous_are(A, B, Q + 10 * C.T @ C, np.eye(1))
    L = -linalg.solve_continuous_are(A.T, C.T, Q + 10 * B @ B.T, np.eye(1)) @ C.T
    zero, none = np.zeros((n, 1)), np.zeros((1, n))
    return _weighted(
        rng,
        Matrices(
            np.block([[A, B @ F], [-L @ C, A + B @ F + L @ C]]),
            np.block([[B, zero], [zero, -L]]),
            np.block([[C, none], [none, F]]),
            np.array([[0.0, 1.0], [0.0, 0.0]]),
        ),
    )


def _mixed(rng: np.random.Generator) -> Matrices:
    """S and K S at their H-infinity optimum: nearly every frequency has the norm."""
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 3))
    A, B, C, D = _plant(rng, n, m, m, unstable=0.2)
    states, inputs, outputs = (
        [f"{letter}{i}" for i in range(k)] for letter, k in (("x", n), ("u", m), ("y", m))
    )
    weights = [_weight(rng) for _ in range(m)]
    design = mixed_sensitivity(
        LinearModel(A, B, C, D, states, inputs, outputs), weights, 10.0 ** rng.uniform(-3, 0)
    )
    if design.loop is None:
        raise np.linalg.LinAlgError
    return Matrices(design.loop.A, design.loop.B, design.loop.C, design.loop.D)
