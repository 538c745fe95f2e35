"""The central H-infinity controller of a continuous plant at a level gamma, by two Riccati
equations.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from symheli.lpv.equilibration import is_singular
from symheli.lpv.riccati import stabilising, without_rounding
from symheli.values.arrays import Array
from synthesis.design.lti.linear_quadratic import given_direct_way
from synthesis.design.plant.generalized import Generalized


class Obstacle(Enum):
    """Reason why a level cannot be reached; the value is the sentence to print."""

    DIRECT = "the feedthrough from disturbances to performance is too large at high frequency"
    CONTROL = "not even a controller that measures all states and disturbances reaches it"
    ESTIMATION = (
        "not even a controller that acts on each performance signal directly reaches it: the"
        " measurements do not suffice"
    )
    COUPLING = "control and estimation can each reach it alone, but not together"


class RiccatiTrial(NamedTuple):
    """Result of the Riccati equations at a level: `obstacle` is None where a controller exists.

    `slack`: gamma^2 over the spectral radius of XY, less one, -1 where a solution does not exist.
    X, F and Y, L' are solutions and gains of control and estimation.
    """

    gamma: float
    obstacle: Obstacle | None
    slack: float
    X: Array | None = None
    F: Array | None = None
    Y: Array | None = None
    L: Array | None = None


class Normalised(NamedTuple):
    """A plant with D12 = [0; I], D21 = [0 I] and D22 = 0, and the gains that lead back: u = into ũ,
    ỹ = out y.
    """

    plant: Generalized
    into: Array
    out: Array
    D22: Array

    @classmethod
    def of(cls, plant: Generalized) -> Normalised:
        """Normalise a plant whose D12 has full column and D21 full row rank: rotate performance and
        disturbances, scale controls and measurements, keep the states.
        """
        nu, ny = plant.B2.shape[1], plant.C2.shape[0]
        Q, R = np.linalg.qr(plant.D12, mode="complete")
        P, S = np.linalg.qr(plant.D21.T, mode="complete")
        rows = np.concatenate([Q[:, nu:], Q[:, :nu]], axis=1).T  # of z
        columns = np.concatenate([P[:, ny:], P[:, :ny]], axis=1)  # of w
        into, out = np.linalg.inv(R[:nu]), np.linalg.inv(S[:ny].T)
        normal = Generalized(
            plant.A,
            plant.B1 @ columns,
            plant.B2 @ into,
            rows @ plant.C1,
            out @ plant.C2,
            rows @ plant.D11 @ columns,
            np.eye(len(plant.D12))[:, len(plant.D12) - nu :],
            np.eye(plant.D21.shape[1])[plant.D21.shape[1] - ny :],
            np.zeros((ny, nu)),
        )
        return cls(normal, into, out, plant.D22)

    def least(self) -> float:
        """Lower bound on every level: Parrott's bound of D11."""
        D, nu, ny = self.plant.D11, len(self.into), len(self.out)
        parts = D[: len(D) - nu], D[:, : D.shape[1] - ny]
        return max((float(np.linalg.norm(part, 2)) for part in parts if part.size), default=0.0)

    def trial(self, gamma: float) -> RiccatiTrial:
        """Decide whether a controller with a norm below `gamma` exists."""
        if gamma <= self.least():
            return RiccatiTrial(gamma, Obstacle.DIRECT, -1.0)
        X, F = _half(self.plant, gamma)
        if X is None:
            return RiccatiTrial(gamma, Obstacle.CONTROL, -1.0)
        Y, L = _half(self.plant.dual, gamma)
        if Y is None:
            return RiccatiTrial(gamma, Obstacle.ESTIMATION, -1.0)
        radius = float(np.abs(np.linalg.eigvals(X @ Y)).max(initial=0.0))
        slack = gamma**2 / radius - 1 if radius > 0 else math.inf
        return RiccatiTrial(gamma, None if slack > 0 else Obstacle.COUPLING, slack, X, F, Y, L)

    def controller(self, trial: RiccatiTrial) -> tuple[Array, Array, Array, Array]:
        """Return the central controller u = K y of the original plant; its state estimates the
        plant's, in the same coordinates.
        """
        P, gamma = self.plant, trial.gamma
        X, F, Y, L = trial.X, trial.F, trial.Y, trial.L
        assert X is not None and Y is not None  # noqa: PT018, S101
        assert F is not None and L is not None  # noqa: PT018, S101
        nu, ny = len(self.into), len(self.out)
        z1, w1 = len(P.D11) - nu, P.D11.shape[1] - ny
        D1111, D1112 = P.D11[:z1, :w1], P.D11[:z1, w1:]
        D1121, D1122 = P.D11[z1:, :w1], P.D11[z1:, w1:]
        inner = gamma**2 * np.eye(z1) - D1111 @ D1111.T
        D = -D1121 @ D1111.T @ np.linalg.solve(inner, D1112) - D1122
        n, w = len(P.A), P.B1.shape[1]
        F12, F2 = F[w1:w], F[w:]
        L12, L2 = L[z1 : z1 + nu].T, L[z1 + nu :].T
        Z = np.linalg.inv(np.eye(n) - Y @ X / gamma**2)
        Cy = P.C2 + F12  # the predicted measurement, with the worst disturbance
        B = -Z @ L2 + Z @ (P.B2 + L12) @ D
        C = F2 - D @ Cy
        A = P.A + P.B1 @ F[:w] + P.B2 @ F2 - B @ Cy
        return given_direct_way(self.D22, A, B @ self.out, self.into @ C, self.into @ D @ self.out)


def _half(P: Generalized, gamma: float) -> tuple[Array | None, Array | None]:
    """Return X and F of full-information control; for the dual plant, Y and the transpose of the
    estimator gain.

    Zhou, Doyle, Glover (1996), section 17.1.
    """
    D = np.concatenate([P.D11, P.D12], axis=1)
    B = np.concatenate([P.B1, P.B2], axis=1)
    weight = D.T @ D
    w = P.B1.shape[1]
    weight[:w, :w] -= gamma**2 * np.eye(w)
    if is_singular(weight):
        return None, None
    inverse = np.linalg.inv(weight)
    DC = D.T @ P.C1
    seen, crossed, size = np.abs(P.C1), np.abs(DC), np.abs(inverse)
    Q = without_rounding(
        P.C1.T @ P.C1 - DC.T @ inverse @ DC, seen.T @ seen + crossed.T @ size @ crossed
    )
    R = without_rounding(-B @ inverse @ B.T, np.abs(B) @ size @ np.abs(B).T)
    X = stabilising(P.A - B @ inverse @ DC, R, Q)
    if X is None:
        return None, None
    return X, -inverse @ (DC + B.T @ X)
