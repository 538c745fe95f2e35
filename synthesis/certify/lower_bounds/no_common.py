"""Witnesses that no quadratic Lyapunov function is common to the frozen models of a set.

V = x'Px with A'P + PA < 0 of two matrices also falls for A1 + s A2^-1 and A1 + s A2, s >= 0, so
that these are regular: A1 A2 and A1 A2^-1 have no negative real eigenvalue. Source: Shorten and
Narendra, "On common quadratic Lyapunov functions for pairs of stable LTI systems whose system
matrices are in companion form", IEEE Trans. Automatic Control 48 (2003).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from symheli import Scheduling
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.frozen import grid_of
from synthesis.numerics.polynomial.pieces import Pieces

POINTS = {1: 9, 2: 4}
"""Values of each parameter that are looked at (more parameters: 2)."""
REAL = 1e-6
"""Imaginary part of an eigenvalue, over its size, up to which it counts as real."""


def no_common(model: Pieces) -> str:
    """Return the sentence that names two frozen models without a common x'Px; empty where none
    were found, and for sampled models.
    """
    if model.dt is not None:
        return ""
    count = POINTS.get(len(model.parameters), 2)
    points = grid_of([np.linspace(s.low, s.high, count) for s in model.parameters])
    A = model.at(points).A
    for i, j in itertools.combinations(range(len(points)), 2):
        for name, product in _products(A[i], A[j]):
            worst = _negative(np.linalg.eigvals(product))
            if worst is not None:
                at = " and ".join(_named(points[k], model.parameters) for k in (i, j))
                return (
                    f"no constant P exists: of the frozen models at {at} the product {name} has the"
                    f" eigenvalue {worst:.4g}; P(p) needs a bounded rate, and HigherOrder may prove"
                    " more where p jumps"
                )
    return ""


def _products(first: Array, second: Array) -> Iterator[tuple[str, Array]]:
    yield "A1 A2", first @ second
    if np.linalg.cond(second) < 1e12:
        yield "A1 A2^-1", first @ np.linalg.inv(second)


def _negative(values: Any) -> float | None:
    """Return the most negative real eigenvalue; None where there is none."""
    real = values[np.abs(values.imag) <= REAL * np.abs(values)].real
    real = real[real < -REAL * np.abs(values).max(initial=0.0)]
    return float(real.min()) if len(real) else None


def _named(p: Array, parameters: tuple[Scheduling, ...]) -> str:
    return ", ".join(f"{s.name} = {v:.4g}" for s, v in zip(parameters, p, strict=True))
