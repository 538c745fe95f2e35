"""Unobservable and uncontrollable modes, by the test of Popov, Belevitch and Hautus."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.lpv.equilibration import equilibrate
from symheli.values.arrays import Array

HIDDEN = 1e-9
"""[A - s I; C], with rows and columns in units of their own, loses rank at s where its smallest
singular value is below this fraction of A's largest entry.
"""

BOUNDARY = 1e-9
"""Distance from the stability boundary, relative to the size of A, within which a mode counts as
on it.
"""

ROUNDING = 1e-7
"""Accuracy of an eigenvalue in a cluster, relative to the size of A."""

NAMED_FRACTION = 0.3
"""Least participation of a state, relative to the largest, with which the state is named."""


class Mode(NamedTuple):
    """An eigenvalue with a part of its eigenvector in the null space of a matrix.

    `participation` (n,): share of each state in it, the largest 1.
    """

    value: complex
    participation: Array

    def among(self, states: tuple[str, ...]) -> str:
        """Return the names of the states with the largest participation."""
        order = np.argsort(-self.participation)
        return ", ".join(states[i] for i in order[:4] if self.participation[i] >= NAMED_FRACTION)

    def place(self, dt: float | None) -> str:
        """Return the eigenvalue in words; rad/s where continuous."""
        imaginary = f" +- {self.value.imag:.4g}j" if self.value.imag else ""
        if dt is None:
            return f"at {self.value.real:.4g}{imaginary} rad/s"
        return f"z = {self.value.real:.4g}{imaginary}"


def hidden_modes(A: Array, C: Array, counts: Callable[[complex, float], bool]) -> list[Mode]:
    """Return eigenvalues of A (n, n), of each complex pair one, with an eigenvector in the null
    space of C (m, n).

    Only where `counts(value, size)` is true, `size` being that of A. Units of states and outputs
    play no part. An eigenvalue of a nearly defective cluster is known to a root of the rounding
    only, so each is improved by Rayleigh quotients first.
    """
    n = len(A)
    if n == 0:
        return []
    balanced, (units, _) = linalg.matrix_balance(A, permute=False, separate=True)
    size = float(np.abs(balanced).max()) or 1.0
    rows, _ = equilibrate(np.abs(C * units)) if len(C) else (np.ones(0), None)
    seen = rows[:, None] * C * units * size
    found: list[Mode] = []
    for value in np.linalg.eigvals(balanced):
        pencil = np.vstack([balanced - value * np.eye(n), seen])
        for _ in range(3):
            vector = np.linalg.svd(pencil)[2][-1].conj()
            value = vector.conj() @ balanced @ vector
            pencil = np.vstack([balanced - value * np.eye(n), seen])
        smallest = np.linalg.svd(pencil, compute_uv=False)[-1]
        if smallest > HIDDEN * size or not counts(complex(value), size):
            continue
        if any(
            min(abs(value - m.value), abs(value.conjugate() - m.value)) < 1e-6 * size for m in found
        ):
            continue
        share = np.abs(vector) ** 2
        found.append(Mode(_rounded(complex(value), size), share / share.max()))
    return found


def _rounded(value: complex, size: float) -> complex:
    """Return the eigenvalue in the upper half plane, with rounding errors set to zero."""
    real, imaginary = (x if abs(x) > ROUNDING * size else 0.0 for x in (value.real, value.imag))
    return complex(real, abs(imaginary))


def unstable(value: complex, size: float, *, sampled: bool) -> bool:
    """Whether a mode is not strictly stable."""
    margin = abs(value) - 1 if sampled else value.real / size
    return margin >= -BOUNDARY


def on_the_border(value: complex, size: float, *, sampled: bool) -> bool:
    """Whether a mode is on the border of stability, to rounding."""
    return abs(abs(value) - 1 if sampled else value.real / size) <= BOUNDARY
