"""One constant change of coordinates in which the numbers of an LMI are of order one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.lpv import LinearModel, LPVStateSpace
from synthesis.symmetric import symmetrized

Array = np.ndarray


class Scaling(NamedTuple):
    """x = right z, left = right^-1, outputs in units of `channel`, time in units of `time` (s; 1 in discrete time)."""

    left: Array
    right: Array
    channel: float
    time: float

    def to_physical(self, P: Array) -> Array:
        """Lyapunov matrices in physical units from those in z."""
        return symmetrized(self.channel**2 * self.left.T @ P @ self.left)

    def to_scaled(self, P: Array) -> Array:
        """The inverse of `to_physical`."""
        return symmetrized(self.right.T @ P @ self.right / self.channel**2)


def scaling(lpv: LPVStateSpace, gain: float) -> Scaling:
    """From a Lyapunov solution at mid-range, where P(p) is then near the identity; `gain` is the expected one."""
    return model_scaling(lpv.at(lpv.scheduling.middle), gain)


def model_scaling(model: LinearModel, gain: float) -> Scaling:
    """The same from one frozen model.

    The states are balanced first (Osborne), so that their units do not matter. Falls back to balancing alone where the
    model is not stable.
    """
    n = len(model.states)
    channel = gain if np.isfinite(gain) and gain > 0 else 1.0
    balanced, factors = linalg.matrix_balance(model.A, permute=False, separate=True)
    D = np.asarray(factors[0], dtype=float)
    A = np.asarray(balanced)
    time = 1.0
    if model.dt is None:
        fastest = np.abs(np.linalg.eigvals(A))
        time = 1.0 / float(np.median(fastest)) if np.median(fastest) > 0 else 1.0
    X = _lyapunov(A, model.dt is None)
    root = np.eye(n) if X is None else linalg.inv(linalg.cholesky(X / np.exp(np.linalg.slogdet(X)[1] / n)))
    right = D[:, None] * root
    B, C = linalg.solve(right, model.B), model.C @ right
    size_B, size_C = np.linalg.norm(B) * np.sqrt(time), np.linalg.norm(C) * np.sqrt(time) / channel
    # P = alpha I with alpha = |C|/|B| weighs inputs and outputs alike; put it into the coordinates
    alpha = size_C / size_B if size_B > 0 and size_C > 0 else 1.0
    right = right / np.sqrt(alpha)
    return Scaling(linalg.inv(right), right, channel, time)


def _lyapunov(A: Array, continuous: bool) -> Array | None:
    eye = np.eye(len(A))
    poles = np.linalg.eigvals(A)
    if not np.all(poles.real < 0 if continuous else np.abs(poles) < 1):
        return None
    X = linalg.solve_continuous_lyapunov(A.T, -eye) if continuous else linalg.solve_discrete_lyapunov(A.T, eye)
    X = 0.5 * (X + X.T)
    values, vectors = linalg.eigh(X)
    if values[-1] <= 0:
        return None
    return (vectors * np.maximum(values, 1e-8 * values[-1])) @ vectors.T
