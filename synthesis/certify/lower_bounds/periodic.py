"""Growth and gain of a linear system along one cycle, repeated forever, with their sensitivities.

Over one cycle of N steps z_k = [x; v] -> [x(k+1); y], lifted: x(+) = F x + G v, y = H x + J v with
all v and all y of the cycle stacked. The growth is the largest Floquet multiplier, an eigenvalue of
F; the gain is the largest norm of J + H (z - F)^-1 G on |z| = 1. Source: Bittanti and Colaneri,
"Periodic Systems" (2009), sections 6.2 and 9.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.paths import TransitionMatrices

LANCZOS_STEPS = 30
"""Largest number of steps for the norm at one frequency: an unconverged norm makes the bound
smaller, never wrong.
"""
RESIDUAL = 1e-3
"""Residual of the squared norm, relative to it, at which the iteration ends."""


class Sensitivity(NamedTuple):
    """A `value` and its change d value = Re sum_k left_k' dstep_k right_k; left (N, nx + r), right
    (N, nx + nu).
    """

    value: float
    left: Array
    right: Array

    def along(self, change: Array) -> Array:
        """Return the change of the value (N,) due to the change (N, nx + r, nx + nu) of
        each step.
        """
        return np.real(np.einsum("ki,kij,kj->k", self.left, change, self.right))


class Lifted(NamedTuple):
    """A system over one cycle: x(+) = F x + G v, y = H x + J v."""

    F: Array
    G: Array
    H: Array
    J: Array

    @classmethod
    def of(cls, system: TransitionMatrices) -> Lifted:
        """Return the system over one cycle."""
        n, N = system.states, len(system.step)
        m, r = system.step.shape[2] - n, system.step.shape[1] - n
        F, G = np.eye(n), np.zeros((n, N * m))
        H, J = np.empty((N * r, n)), np.empty((N * r, N * m))
        for k, M in enumerate(system.step):
            rows, columns = slice(k * r, (k + 1) * r), slice(k * m, (k + 1) * m)
            H[rows], J[rows] = M[n:, :n] @ F, M[n:, :n] @ G
            J[rows, columns] += M[n:, n:]
            F, G = M[:n, :n] @ F, M[:n, :n] @ G
            G[:, columns] += M[:n, n:]
        return cls(F, G, H, J)


def multiplier(system: TransitionMatrices) -> float:
    """Return the largest Floquet multiplier (modulus) of one cycle."""
    return float(np.abs(np.linalg.eigvals(system.transition)).max())


def growth(system: TransitionMatrices) -> Sensitivity:
    """Return the logarithm of the largest multiplier, by its left and right eigenvectors carried
    around the cycle.
    """
    n, (N, rows, columns) = system.states, system.step.shape
    values, vectors = np.linalg.eig(system.transition)
    k = int(np.abs(values).argmax())
    # the left eigenvector belonging to it, w' v = 1; the pseudo-inverse keeps a defective
    # multiplier from failing
    x, w = vectors[:, k], np.linalg.pinv(vectors)[k]
    left, right = np.zeros((N, rows), dtype=complex), np.zeros((N, columns), dtype=complex)
    A = system.step[:, :n, :n]
    for i in range(N):
        right[i, :n] = x
        x = A[i] @ x
    w = w / values[k]
    for i in range(N - 1, -1, -1):
        left[i, :n] = w
        w = w @ A[i]
    return Sensitivity(math.log(abs(values[k])) if values[k] != 0 else -math.inf, left, right)


def worst_input(
    system: TransitionMatrices, lifted: Lifted | None = None
) -> tuple[float, float, Array]:
    """Return (gain, phase advance a cycle in rad, worst input (N, nu), complex) of the repeated
    cycle; gain inf where the state grows.
    """
    n, N = system.states, len(system.step)
    m = system.step.shape[2] - n
    F, G, H, J = lifted or Lifted.of(system)
    multipliers = np.linalg.eigvals(F)
    if np.abs(multipliers).max() >= 1:
        return math.inf, 0.0, np.zeros((N, m))
    leading = multipliers[np.argsort(-np.abs(multipliers))[:3]]
    angles = np.unique(
        np.round(np.abs(np.concatenate([np.angle(leading), [0.0, math.pi / 2, math.pi]])), 6)
    )

    def norm(angle: float) -> tuple[float, Array]:
        # complex vectors as two real columns: a complex product would copy the large real matrices
        # every time
        inverse = np.linalg.inv(np.exp(1j * angle) * np.eye(n) - F)

        def squared(v: Array) -> Array:
            columns = np.column_stack([np.real(v), np.imag(v)])
            y = J @ columns + H @ _times(inverse, G @ columns)
            back = J.T @ y + G.T @ _times(inverse.conj().T, H.T @ y)
            return back[:, 0] + 1j * back[:, 1]

        value, v = _largest(squared, N * m)
        return math.sqrt(value), v

    tried = [(*norm(float(angle)), float(angle)) for angle in angles]
    value, v, angle = max(tried, key=lambda item: item[0])
    return value, angle, v.reshape(N, m)


def gain(system: TransitionMatrices) -> Sensitivity:
    """Return the logarithm of the gain, with the worst response and its adjoint; the phase advance
    a cycle is held.
    """
    n, N = system.states, len(system.step)
    lifted = Lifted.of(system)
    value, angle, v = worst_input(system, lifted)
    rows, columns = system.step.shape[1:]
    left, right = np.zeros((N, rows), dtype=complex), np.zeros((N, columns), dtype=complex)
    if math.isinf(value) or value == 0.0:
        return Sensitivity(math.log(value) if value else -math.inf, left, right)
    F, G, H, J = lifted
    turn, eye = np.exp(1j * angle), np.eye(n)
    x = np.linalg.solve(turn * eye - F, G @ v.ravel())
    y = H @ x + J @ v.ravel()
    energy, supply = np.vdot(y, y).real, np.vdot(v, v).real
    if energy == 0.0 or supply == 0.0:
        return Sensitivity(-math.inf, left, right)
    # costate(N) = costate(0) / turn* around the cycle, driven by y
    costate = np.linalg.solve(np.conj(turn) * eye - F.T, H.T @ y)
    y = y.reshape(N, -1)
    for k in range(N):
        right[k, :n], right[k, n:] = x, v[k]
        x = system.step[k, :n] @ right[k]
    for k in range(N - 1, -1, -1):
        left[k, :n], left[k, n:] = costate, y[k]
        costate = system.step[k, :, :n].T @ left[k]
    return Sensitivity(0.5 * math.log(energy / supply), left.conj() / energy, right)


def ratio_from_rest(lifted: Lifted, v: Array, rounds: int) -> tuple[float, Array]:
    """Return (|y|/|v|, v) from rest over len(v) cycles, v (cycles, N nu), after `rounds` of forward
    and adjoint passes.
    """
    F, G, H, J = lifted
    ratio, best = 0.0, v
    for _ in range(rounds):
        size = float(np.linalg.norm(v))
        if size == 0.0:
            break
        v = v / size
        drive, x = v @ G.T, np.zeros((len(v) + 1, len(F)))
        for k in range(len(v)):
            x[k + 1] = F @ x[k] + drive[k]
        y = x[:-1] @ H.T + v @ J.T
        new = float(np.linalg.norm(y))
        if new > ratio:
            ratio, best = new, v
        back, costate = y @ H, np.zeros((len(v) + 1, len(F)))
        for k in range(len(v) - 1, -1, -1):
            costate[k] = F.T @ costate[k + 1] + back[k]
        v = y @ J + costate[1:] @ G
    return ratio, best


def _largest(squared: Callable[[Array], Array], size: int) -> tuple[float, Array]:
    """Return (largest eigenvalue, its vector) of a positive semidefinite operator from below, by
    Lanczos with full reorthogonalisation.
    """
    start = np.random.default_rng(0).standard_normal((2, size))
    v = start[0] + 1j * start[1]
    basis, image = np.zeros((2, min(LANCZOS_STEPS, size), size), dtype=complex)
    value, weights = 0.0, np.ones(1)
    for k in range(len(basis)):
        v = v / np.linalg.norm(v)
        basis[k], image[k] = v, squared(v)
        projected = basis[: k + 1].conj() @ image[: k + 1].T
        values, vectors = np.linalg.eigh(0.5 * (projected + projected.conj().T))
        value, weights = float(values[-1]), vectors[:, -1]
        v = image[k]
        for _ in range(2):
            v = v - basis[: k + 1].T @ (basis[: k + 1].conj() @ v)
        if np.linalg.norm(v) * abs(weights[-1]) <= RESIDUAL * value:
            break
    return max(value, 0.0), basis[: k + 1].T @ weights


def _times(M: Array, v: Array) -> Array:
    """Return complex M times complex v, v as real and imaginary columns."""
    w = M @ (v[:, 0] + 1j * v[:, 1])
    return np.column_stack([w.real, w.imag])
