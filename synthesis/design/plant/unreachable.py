"""The part of a gain that no controller can lower, and its origin."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Generalized

NEGLIGIBLE = 1e-11
"""Fraction of its terms below which a direction of a response counts as zero."""

POLE_CONDITION = 1e13
"""Condition number of s I - A above which s counts as a pole."""

POLE_OFFSET = 1e-9
"""Distance by which such an s is moved, relative to the size of A."""

PLATEAU_TOLERANCE = 1e-9
"""Relative difference up to which gains count as equal: the first frequency of a plateau is named.
"""

FREQUENCIES = 400
"""Number of frequencies in the initial grid."""


class Unreachable(NamedTuple):
    """The largest gain over frequency that remains whatever the controller does.

    `omega` (rad/s; inf: of the direct way) is where, `at_rest` the gain there with the controls at
    rest, `performance` (nz,) and `disturbances` (nw,) are the sizes, from 0 to 1, of the signals in
    it.
    """

    gamma: float
    omega: float
    at_rest: float
    performance: Array
    disturbances: Array


def unreachable_gain(plant: Generalized, dt: float | None = None) -> Unreachable:
    """Return the largest gain of the disturbances on the part of the performance that the controls
    do not reach, and of the part of the disturbances that is not measured on the performance.

    Parrott's bound at each frequency: with N orthogonal to the columns of P12 there, N'(P11 + P12 Q
    P21) = N' P11 for every Q. On a grid of frequencies made closer around its top: never too high,
    to rounding, and too low by what lies between.

    References
    ----------
    Zhou, Doyle, Glover (1996), Robust and Optimal Control, section 2.11.
    """
    poles = np.abs(_speeds(plant.A, dt))
    poles = poles[poles > 0]
    slow, fast = float(poles.min(initial=1.0)), float(poles.max(initial=1.0))
    omega = np.unique(
        np.concatenate([[0.0], np.geomspace(1e-3 * slow, 1e3 * fast, FREQUENCIES), poles])
    )
    if dt is not None:
        omega = np.append(omega[omega < math.pi / dt], math.pi / dt)
    best = _direct(plant) if dt is None else Unreachable(0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
    for _ in range(8):
        found, sizes = _largest(plant, omega, dt)
        if found.gamma > best.gamma * (1 + PLATEAU_TOLERANCE):
            best = found
        top = int(np.argmax(sizes))
        omega = np.linspace(omega[max(top - 1, 0)], omega[min(top + 1, len(omega) - 1)], 21)
    return best


def _speeds(A: Array, dt: float | None) -> Array:
    """Return the poles (rad/s), those of a sampled plant as log(z)/dt."""
    poles = np.linalg.eigvals(A).astype(complex)
    return poles if dt is None else np.log(poles[np.abs(poles) > 1e-12]) / dt


def _direct(plant: Generalized) -> Unreachable:
    return _of(
        plant.D11[None].astype(complex),
        _left_over(plant.D12[None].astype(complex), np.abs(plant.D12)[None]),
        _left_over(_adjoint(plant.D21[None].astype(complex)), np.abs(plant.D21.T)[None]),
        np.array([math.inf]),
    )[0]


def _largest(plant: Generalized, omega: Array, dt: float | None) -> tuple[Unreachable, Array]:
    """Return the highest gain with its frequency, and the gain at each frequency."""
    A, B, C, D = plant.joined
    s = 1j * omega if dt is None else np.exp(1j * omega * dt)
    on_a_pole = (
        np.linalg.cond(s[:, None, None] * np.eye(len(A)) - A) > POLE_CONDITION if len(A) else False
    )
    # into the unstable side, where the bound holds by the maximum principle as well
    step = (
        POLE_OFFSET * (float(np.abs(A).max(initial=0.0)) or 1.0) if dt is None else POLE_OFFSET * s
    )
    s = np.where(on_a_pole, s + step, s)
    pencil = s[:, None, None] * np.eye(len(A)) - A
    X = np.linalg.solve(pencil, np.broadcast_to(B, (len(omega), *B.shape)))
    G, terms = C @ X + D, np.abs(C) @ np.abs(X) + np.abs(D)
    nz, nw = plant.D11.shape
    left = _left_over(G[:, :nz, nw:], terms[:, :nz, nw:])
    right = _left_over(_adjoint(G[:, nz:, :nw]), np.swapaxes(terms[:, nz:, :nw], 1, 2))
    return _of(G[:, :nz, :nw], left, right, omega)


def _of(P11: Array, left: Array, right: Array, omega: Array) -> tuple[Unreachable, Array]:
    unreached, unmeasured = left @ P11, P11 @ right
    sizes = np.stack([_norms(unreached), _norms(unmeasured)])
    which, k = np.argwhere(sizes >= sizes.max() * (1 - PLATEAU_TOLERANCE))[0]
    U, values, V = np.linalg.svd((unreached, unmeasured)[which][k])
    at_rest = float(np.linalg.norm(P11[k], 2))
    found = Unreachable(float(values[0]), float(omega[k]), at_rest, np.abs(U[:, 0]), np.abs(V[0]))
    return found, sizes.max(axis=0)


def _norms(M: Array) -> Array:
    return np.linalg.norm(M, 2, axis=(1, 2))


def _adjoint(M: Array) -> Array:
    return np.conj(np.swapaxes(M, 1, 2))


def _left_over(P: Array, terms: Array) -> Array:
    """Return projectors (k, n, n) on the orthogonal complement of the columns of P (k, n, m);
    directions below the rounding of their terms (k, n, m) are no columns.
    """
    size = np.linalg.norm(terms, axis=1)
    size = np.where(size > 0, size, 1.0)[:, None, :]
    U, values, _ = np.linalg.svd(P / size, full_matrices=False)
    U = U * (values > NEGLIGIBLE)[:, None, :]
    return np.eye(P.shape[1]) - U @ _adjoint(U)
